"""Bayesian calibration of pneumatic artificial muscles."""
