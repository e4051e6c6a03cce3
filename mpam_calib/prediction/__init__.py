"""What a posterior predicts: forces with bands, blocked force, free contraction, new recordings."""
