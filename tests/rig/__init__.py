"""Independent rig: synthetic recordings of pneumatic muscles with hidden effects, and an oracle over them.

Nothing in this package imports the code under test, and nothing in it was written from that code.
Units: mm, N, kPa, Pa, s, degrees; inside the force formulas pressures and moduli are N/mm2.
"""
