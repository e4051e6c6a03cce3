"""What was measured and declared: reading a specimen folder into SI arrays."""
