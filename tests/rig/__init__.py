"""Independent rig: synthetic recordings of pneumatic muscles with hidden effects, and an oracle over them.

Nothing in this package imports the code under test, and nothing in it was written from that code.
Units: mm, N, kPa, Pa, s, degrees; inside the force formulas pressures and moduli are N/mm2.

From a declaration to files and an answer:
    one = recipes.build_case(sets.recipes("locked")[0])   # recipes.halved(one) halves its effects
    truth = case.write_case(one, folder)                  # specimen.toml, loops.csv; the truth stays outside
    verdict = oracle.Oracle(case.record(one)).judge()     # does the true set lead by 10 nats?
    kept = margins.read_margins("locked")                 # that verdict for every case of a set
`calibration.write_calibration_case` makes a muscle outside the model class with held-out pressure levels.
"""
