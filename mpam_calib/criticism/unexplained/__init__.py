"""What no cause may stand for: structure, faults of the readings, and rivals of the causes that lead."""
