"""``select``: models that data could ask for, ranked by evidence, and how they predict what is left out."""
