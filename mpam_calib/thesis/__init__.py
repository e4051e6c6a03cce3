"""The thesis, whole: its printed tables, its calibration recomputed, its misprints and their proofs."""
