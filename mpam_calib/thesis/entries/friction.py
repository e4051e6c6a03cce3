"""Tables 4.10 and 4.11, Fig. 4.20."""

from __future__ import annotations

import numpy as np

from mpam_calib.thesis import decoded, friction, laws
from mpam_calib.thesis.ledger import FROM_MEASUREMENT, Ledger
from mpam_calib.thesis.statistics import squared_correlation
from mpam_calib.thesis.tables import table

LIMIT = 0.98
"""How far towards free contraction the loops are used, as a fraction: at 1 relative errors are infinite."""


def enter(ledger: Ledger) -> None:
    """Enter the numbers of Tables 4.10 and 4.11 and what is known of f_s."""
    _table_4_10(ledger)
    _table_4_11(ledger)
    _strand_factor(ledger)


def _table_4_10(ledger: Ledger) -> None:
    printed = table("4.10")
    for i, column in enumerate(printed.columns):
        gamma, measured, sign = friction.loop("MPAM1", i, LIMIT)
        model = decoded.force(decoded.LEVELS[i], gamma, decoded.moduli("MPAM1")[i])
        ledger.lost(
            printed.source,
            "K_f",
            column,
            printed.text("K_f", column),
            f"{FROM_MEASUREMENT}. Computed: Eq. 4.17 on the reconstructed loop, which was built with this "
            "K_f (circular)",
            friction.coulomb_factor(model, measured, sign),
        )


def _table_4_11(ledger: Ledger) -> None:
    printed = table("4.11")
    for i, row in enumerate(printed.rows):
        gamma, loop, sign = friction.loop("MPAM1", i, LIMIT)
        P = decoded.LEVELS[i]
        strand = decoded.force(P, gamma, decoded.moduli("MPAM1")[i]) + sign * decoded.strand_friction(
            P, gamma
        )
        between = squared_correlation(strand, loop)
        theory, empirical = printed.columns
        ledger.lost(
            printed.source,
            row,
            theory,
            printed.text(row, theory),
            f"against loops that are lost; against the loops with Table 4.10's friction it is {between:.6f}",
        )
        ledger.lost(
            printed.source, row, empirical, printed.text(row, empirical), "against loops that are lost"
        )
    means = printed.values().mean(axis=0)
    for column, mean in zip(printed.columns, means, strict=True):
        ledger.unprinted(printed.source, "mean", column, float(mean), "mean of the printed column")


def _strand_factor(ledger: Ledger) -> None:
    relative = friction.best_strand_factor(3, LIMIT)
    absolute = friction.best_strand_factor(3, LIMIT, relative=False)
    ledger.lost(
        "Fig. 4.20",
        "200 kPa",
        "f_s",
        "0.15",
        f"lower bound of the range searched. On the loop with Table 4.10's friction, to {LIMIT:g} of free "
        "contraction, relative least squares has its "
        f"minimum at {relative:.3f}, so that the bound is taken; ordinary least squares gives {absolute:.2f}",
        max(relative, 0.15),
    )
    for i, P in enumerate(laws.P_KPA):
        ledger.unprinted(
            "Fig. 4.20",
            f"{P:.0f} kPa",
            "f_s that matches K_f at γ = 0",
            friction.matching_strand_factor(i),
            "from Tables 4.3 and 4.10 and Eq. 4.14",
        )
    P = decoded.LEVELS[3]
    root = decoded.first_root(float(P), decoded.moduli("MPAM1")[3])
    F0 = float(decoded.force(P, np.asarray(0.0), decoded.moduli("MPAM1")[3]))
    for name, value in (
        ("strand friction at γ = 0 (N)", float(decoded.strand_friction(P, np.asarray(0.0)))),
        ("strand friction at free contraction (N)", float(decoded.strand_friction(P, np.asarray(root)))),
        ("Coulomb friction at γ = 0 (N)", float(decoded.coulomb_factors()[3]) * F0),
    ):
        ledger.unprinted("Eq. 4.14, 4.17", "200 kPa", name, value, "f_s = 0.15; K_f of Table 4.10")
    ledger.unprinted(
        "Eq. 2.40, 2.42",
        "200 kPa",
        "strand friction at γ = 0 if S_scale were a ratio of areas (N)",
        friction.strand_friction_by_area(),
        "Eq. 2.40 divides an area by the ratio of lengths of Eq. 2.42; Eq. 2.43 is kept as printed, as "
        "empirical",
    )
