"""``python -m mpam_calib``."""

from mpam_calib.cli import main

main()
