"""Where the print is wrong, what is read instead, and the proof: computed when asked for, never quoted."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mpam_calib.thesis import decoded, friction, laws, orders
from mpam_calib.thesis.ledger import MISPRINT, Ledger
from mpam_calib.thesis.tables import table


@dataclass(frozen=True)
class Erratum:
    """One place of the thesis: what it prints, how this package reads it, why."""

    place: str
    printed: str
    reading: str
    proof: str


READINGS = (
    Erratum(
        "Eq. 2.13-2.17, 4.5, 4.6, 4.10-4.12, 4.18",
        "Strains L/L0 − 1, R/R0 − 1 in the stress polynomials",
        "Stretches L/L0, R/R0; R from Eq. 4.16, α from Eq. 4.15, in the form of Eq. 4.6",
        "With Table 4.3 at 200 kPa strains give {strains_at_10:.0f} N at γ = 0.1 and {strains_at_30:.0f} N "
        "at 0.3. Stretches give curves that fall to 0 at {root:.1f} % (250 kPa; Table 4.12: 33.2 %). "
        "Refitted for M = 1, 2, 3, R² is {of_stretches} with stretches and "
        "{of_strains} with strains; Table 4.2 has 0.8784, 0.8771, 0.9780.",
    ),
    Erratum(
        "Table 4.9 (Eq. 4.8)",
        "Constants of each modulus, validated by R² of 0.986 to 0.9997",
        "Not used for the force; laws are fitted to the force of all levels jointly",
        "The R² reproduce, and the law gives {forces_of_law} N at γ = 0 where "
        "Table 4.7 decodes to {forces_of_table} N: moduli that add up to "
        "{sizes_of_moduli:.1e} Pa in size at 250 kPa cancel to {sum_of_moduli:.1e} Pa.",
    ),
    Erratum(
        "Tables 4.2, 4.6, 4.11",
        "R² as coefficient of determination of a force",
        "Squared correlation; 1 − SSE/SST is given beside it",
        "F_{{G+t}} of MPAM1 to free contraction has a squared correlation of "
        "{gas_correlation:.2f} and 1 − SSE/SST of {gas_determination:.2f}.",
    ),
    Erratum(
        "Eq. 4.5, 4.17",
        "Relative least squares",
        "Absolute least squares in the package; the relative kind only to repeat the thesis",
        "Residuals are divided by a force that goes to 0 at free contraction, so that the blocked force "
        "counts least; it is also why f_s comes out at the lower bound of its range (Fig. 4.20).",
    ),
)
"""What has to be read otherwise for the tables to describe a muscle at all; the proofs' numbers left open."""

STATEMENTS = (
    Erratum(
        "Eq. 2.44 in 4.13",
        "F_F = −K_f F sgn(V), then ± F_F",
        "F(1 + K_f) on loading, F(1 − K_f) on unloading",
        "Put into 4.13 the direction would count twice.",
    ),
    Erratum(
        "Eq. 2.48",
        "F = |F_ideal| − |F_braid| − |F_nonlinearity| ∓ |F_f|",
        "F_NL is added with its sign",
        "F_NL of MPAM1 at 200 kPa, γ = 0.05 is {nonlinear:+.1f} N.",
    ),
    Erratum(
        "Eq. 4.9",
        "F_th = F_{G+t} + F_br + F_NL",
        "F_br is subtracted, as in Eq. 2.26 and 3.10",
        "It is a loss.",
    ),
    Erratum(
        "Eq. 4.15",
        "L = L0 ± ΔL, plus during expansion",
        "L = L0 − ΔL on both branches",
        "Length depends on position, not on the direction of motion; the muscle never exceeds L0 in the "
        "test.",
    ),
    Erratum(
        "Eq. 2.18",
        "F = P dV/dL",
        "F = −P dV/dL",
        "The muscle pulls where its volume grows while it shortens.",
    ),
    Erratum(
        "Eq. 2.40, 2.42",
        "S_contact / S_scale with S_scale a ratio of lengths",
        "Eq. 2.43 as printed, called empirical",
        "An area has to be scaled by a ratio of areas; the friction would then be "
        "{friction_by_area:.2f} N at 200 kPa instead of {friction_as_printed:.2f} N.",
    ),
    Erratum(
        "Eq. 2.42, middle form",
        "(P D_s² (D_s/2) / E_br)",
        "With E* of Eq. 2.41 a factor 2(1 − ν_s²) stands beside it",
        "The last form has it again.",
    ),
    Erratum(
        "Eq. 3.15, 3.18",
        "V_bl/V <= 2",
        "Never binds",
        "(t/R)(2 − t/R) is at most 1, at t = R.",
    ),
    Erratum(
        "Text 2.3.1",
        "The bladder's term 'does not have any impact on the blocked force predictions'",
        "In stretches the sum of the moduli acts at rest length",
        "True of strains. With the stretches that the moduli need it is {rest_of_mpam1} of MPAM1 and "
        "{rest_of_mpam2} of MPAM2.",
    ),
    Erratum(
        "Text 4.4",
        "'Both MPAMs exhibit almost identical force output'",
        "MPAM2 pulls harder at every level",
        "The decoded blocked forces differ by factors of {least_ratio:.2f} to {largest_ratio:.2f}.",
    ),
    Erratum(
        "Text 3.4.3",
        "'the optimization formulation including the braid term (Case II)'",
        "Case I",
        "Case II is the one without the braid term (3.2.2).",
    ),
    Erratum(
        "Table 4.12, title",
        "P = 300 kPa",
        "Free contraction at 250 kPa",
        "Free contraction was measured from 50 to 250 kPa (4.3); the decoded roots at 250 kPa are the "
        "printed values.",
    ),
    Erratum(
        "Text 4.6.1.2",
        "MPAM2 requires a fifth-degree polynomial",
        "Order 4 does as well",
        "Fitted jointly, linear in P, order 4 leaves {order_four_N:.2f} N and order 5 {order_five_N:.2f} N; "
        "at 200 kPa order 4 matches the decoded fifth-order curve to {curve_by_order_four_N:.2f} N rms.",
    ),
    Erratum(
        "Fig. 4.19, Eq. 4.8",
        "Moduli that saturate above 100 kPa, explained by cross-linking",
        "One outlying level",
        "The moduli at 50 kPa are {least_growth:.0f} to {largest_growth:,.0f} times smaller than the "
        "others and the curve there falls to {fall_at_50:.2f} of its blocked force at γ = 0.05 (the "
        "others to {fall_at_100:.2f}-{fall_at_250:.2f}). Four constants describe five points, and for k <= 4 "
        "w exp(zP) matters at that one alone (of E_5 it is still {second_part_percent:.0f} % at 100 "
        "kPa). Without that level a linear law of order 4 leaves {without_50_N:.2f} N.",
    ),
)
"""Errors of equations and statements; the proofs' numbers left open."""


def errata(ledger: Ledger) -> list[Erratum]:
    """Errors of equations and statements first, then every misprinted number of the ledger."""
    numbers = _of_readings() | _of_statements()
    proven = [replace(one, proof=one.proof.format(**numbers)) for one in (*READINGS, *STATEMENTS)]
    return [*proven, *_of_number(ledger)]


def _of_number(ledger: Ledger) -> list[Erratum]:
    return [
        Erratum(
            f"{r.source}, {r.row}, {r.column}",
            r.printed,
            f"{r.computed:.6g}",
            f"{r.note[:1].upper()}{r.note[1:].rstrip('.')}.",
        )
        for r in ledger.rows
        if r.verdict == MISPRINT
    ]


def _of_readings() -> dict[str, object]:
    """The numbers in READINGS, by name."""
    E, E2 = decoded.moduli("MPAM1"), decoded.moduli("MPAM2")[4]
    strain = decoded.force(np.asarray(2e5), np.array([0.1, 0.3]), E[3], "engineering")
    limit = orders.range_from_print("MPAM1", 0.8838)
    fits = {
        kind: [orders.order_fit("MPAM1", limit, M, kind).squared_correlation for M in (1, 2, 3)]
        for kind in ("stretch", "engineering")
    }
    gas = orders.gas_fit("MPAM1", decoded.first_root(2e5, E[3]))
    law = laws.double_exponential(table("4.9").values(), laws.P_KPA)
    return {
        "strains_at_10": strain[0],
        "strains_at_30": strain[1],
        "root": 100.0 * decoded.first_root(2.5e5, E[4]),
        "of_stretches": ", ".join(f"{r2:.3f}" for r2 in fits["stretch"]),
        "of_strains": ", ".join(f"{r2:.3f}" for r2 in fits["engineering"]),
        "forces_of_law": ", ".join(f"{F:.0f}" for F in decoded.force(decoded.LEVELS, np.asarray(0.0), law)),
        "forces_of_table": ", ".join(f"{F:.0f}" for F in decoded.blocked_forces("MPAM2")),
        "sizes_of_moduli": np.abs(E2).sum(),
        "sum_of_moduli": abs(E2.sum()),
        "gas_correlation": gas.squared_correlation,
        "gas_determination": gas.determination,
    }


def _of_statements() -> dict[str, object]:
    """The numbers in STATEMENTS, by name."""
    E1, E2 = decoded.moduli("MPAM1"), np.abs(decoded.moduli("MPAM2"))
    growth, ratio = E2[1:] / E2[0], decoded.blocked_ratio()
    linear = laws.linear_basis()
    curve = orders.order_fit("MPAM2", orders.range_from_print("MPAM2", 0.8879), 4)
    return {
        "nonlinear": float(decoded.bladder_force(np.asarray(2e5), np.asarray(0.05), E1[3])),
        "friction_by_area": friction.strand_friction_by_area(),
        "friction_as_printed": float(decoded.strand_friction(np.asarray(2e5), np.asarray(0.0))),
        "rest_of_mpam1": _rest("MPAM1"),
        "rest_of_mpam2": _rest("MPAM2"),
        "least_ratio": ratio.min(),
        "largest_ratio": ratio.max(),
        "order_four_N": laws.joint("MPAM2", 4, linear, "").rmse_N,
        "order_five_N": laws.joint("MPAM2", 5, linear, "").rmse_N,
        "curve_by_order_four_N": curve.rmse_N,
        "least_growth": growth.min(),
        "largest_growth": growth.max(),
        "fall_at_50": _fall(0),
        "fall_at_100": _fall(1),
        "fall_at_250": _fall(4),
        "second_part_percent": 100 * _second_part(),
        "without_50_N": laws.joint("MPAM2", 4, linear, "", slice(1, None)).rmse_N,
    }


def _rest(muscle: str) -> str:
    own = decoded.bladder_at_rest(muscle)
    return f"{own.min():+.1f} to {own.max():+.1f} N"


def _second_part() -> float:
    """Share of w exp(zP) in the E_5 that Table 4.9 gives at 100 kPa."""
    c, d, w, z = table("4.9").values()[:, 4]
    first, second = c * np.exp(100.0 * d), w * np.exp(100.0 * z)
    return float(abs(second / (first + second)))


def _fall(level: int) -> float:
    """Share of its blocked force that the curve of MPAM2 has at γ = 0.05."""
    E = decoded.moduli("MPAM2")[level]
    F = decoded.force(decoded.LEVELS[level], np.array([0.0, 0.05]), E)
    return float(F[1] / F[0])
