"""The decoded curves: forces and free contractions that Tables 4.3 and 4.7 stand for."""

from __future__ import annotations

import numpy as np

from mpam_calib.thesis import decoded, laws
from mpam_calib.thesis.ledger import Ledger

CHECKS = (0.0, 0.05, 0.10, 0.20)
FIGURE = {"MPAM1": "Fig. 4.14", "MPAM2": "Fig. 4.18"}


def enter(ledger: Ledger) -> None:
    """Enter forty forces, ten free contractions, and what follows from them."""
    for muscle in decoded.MUSCLES:
        E = decoded.moduli(muscle)
        for i, P in enumerate(decoded.LEVELS):
            row = f"{laws.P_KPA[i]:.0f} kPa"
            how = f"figure lost; decoded from Table {decoded.MUSCLES[muscle]} (stretches, R of Eq. 4.16"
            how += ", corrected E_4)" if (muscle, i) == ("MPAM1", 0) else ")"
            for gamma in CHECKS:
                F = float(decoded.force(P, np.asarray(gamma), E[i]))
                ledger.unprinted(FIGURE[muscle], row, f"F(γ={gamma:g}) of {muscle} (N)", F, how)
            root = decoded.first_root(float(P), E[i])
            ledger.unprinted("Fig. 4.10", row, f"free contraction of {muscle}", root, how)
    for P, E, level in zip(decoded.LEVELS, decoded.moduli("MPAM2"), laws.P_KPA, strict=True):
        pair = decoded.force(P, np.array([0.0, 0.05]), E)
        ledger.unprinted(
            "Fig. 4.18",
            f"{level:.0f} kPa",
            "F(0.05)/F(0) of MPAM2",
            float(pair[1] / pair[0]),
            "the 50 kPa curve is unlike the others: an outlier",
        )
    _nonlinear_term(ledger)
    _blocked_slope(ledger)
    points = np.array([0.0, 0.1, 0.2, 0.3])
    strains = decoded.force(np.asarray(2e5), points, decoded.moduli("MPAM1")[3], "engineering")
    for g, f in zip(points, strains, strict=True):
        ledger.unprinted(
            "Eq. 4.5",
            "200 kPa",
            f"F(γ={g:g}) of MPAM1 in strains, as printed (N)",
            float(f),
            "the printed strains give kilonewtons of compression: stretches are meant",
        )


def _nonlinear_term(ledger: Ledger) -> None:
    """Text 2.3.1: the bladder "does not have any impact on the blocked force predictions"."""
    for muscle in decoded.MUSCLES:
        for level, value in zip(laws.P_KPA, decoded.bladder_at_rest(muscle), strict=True):
            ledger.unprinted(
                "Eq. 4.10",
                f"{level:.0f} kPa",
                f"F_NL of {muscle} at γ = 0 (N)",
                float(value),
                f"decoded from Table {decoded.MUSCLES[muscle]}; 'does not have any impact' in the text",
            )
    F = decoded.bladder_force(np.asarray(2e5), np.asarray(0.05), decoded.moduli("MPAM1")[3])
    ledger.unprinted(
        "Eq. 2.48",
        "200 kPa",
        "F_NL of MPAM1 at γ = 0.05 (N)",
        float(F),
        "positive, where Eq. 2.48 subtracts |F_NL|",
    )


def _blocked_slope(ledger: Ledger) -> None:
    for muscle in decoded.MUSCLES:
        slope, intercept = laws.blocked_line(muscle)
        ledger.unprinted(
            "Fig. 4.7",
            muscle,
            "slope of the blocked force (N/kPa)",
            float(slope),
            "line through the five decoded values; the measured points are lost",
        )
        ledger.unprinted(
            "Fig. 4.7",
            muscle,
            "pressure where that line is 0 (kPa)",
            float(-intercept / slope),
            "a dead-band or a gauge offset: the gauge allows ± 22.5 kPa",
        )
