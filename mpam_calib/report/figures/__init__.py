"""The reports' figures: one concept for each file, one style for all."""
