"""Table 4.12."""

from __future__ import annotations

import numpy as np

from mpam_calib.thesis import decoded, laws
from mpam_calib.thesis.ledger import Ledger
from mpam_calib.thesis.tables import half_unit, table

FORCE, CONTRACTION = "Blocked Force (N)", "Free Contraction (%)"
OWN = {"Present work (MPAM_1)": "MPAM1", "Present work (MPAM_2)": "MPAM2"}


def root_and_rounding(muscle: str) -> tuple[float, float]:
    """Decoded free contraction at 250 kPa, and its largest change within the last digits of its moduli."""
    printed = table(decoded.MUSCLES[muscle])
    half = np.array([half_unit(text) for text in printed.cells[-1]])
    E = decoded.moduli(muscle)[-1]
    P = decoded.LEVELS[-1]
    root = decoded.first_root(float(P), E)
    h = 1e-5
    slope = float(decoded.force(P, np.asarray(root + h), E) - decoded.force(P, np.asarray(root - h), E)) / (
        2 * h
    )
    return root, float(np.abs(decoded.columns(np.asarray(root), E.size)) @ half / abs(slope))


def enter(ledger: Ledger) -> None:
    """Enter the outputs that Table 4.12 compares."""
    printed = table("4.12")
    for row in printed.rows:
        if row not in OWN:
            for column in (FORCE, CONTRACTION):
                ledger.lost(
                    printed.source, row, column, printed.text(row, column), "another author's measurement"
                )
            continue
        muscle = OWN[row]
        ledger.lost(
            printed.source,
            row,
            FORCE,
            printed.text(row, FORCE),
            "measured at 300 kPa; computed: the line through the five decoded values, extrapolated from "
            "250 kPa" + ("; the text has 136 N" if muscle == "MPAM2" else ""),
            float(np.polyval(laws.blocked_line(muscle), 300.0)),
        )
        root, rounding = root_and_rounding(muscle)
        allow = 100.0 * rounding
        ledger.check(
            printed.source,
            row,
            CONTRACTION,
            printed.text(row, CONTRACTION),
            100.0 * root,
            allow=allow,
            note="decoded at 250 kPa, the highest pressure that it was measured at (not the 300 kPa of the "
            f"table's title); digits of the moduli allow ± {allow:.2f}",
        )
