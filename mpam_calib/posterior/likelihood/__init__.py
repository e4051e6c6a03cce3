"""Recordings reduced before anything is drawn, and the covariance of what is left of them."""
