"""Tables 4.3-4.9: moduli at each level, and the laws fitted to each modulus alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpam_calib.thesis import decoded, laws
from mpam_calib.thesis.ledger import FROM_MEASUREMENT, Ledger, lost_table
from mpam_calib.thesis.statistics import determination
from mpam_calib.thesis.tables import half_unit, number, table

Array = NDArray[np.float64]


def enter(ledger: Ledger) -> None:
    """Enter every number of Tables 4.3-4.5 and 4.7-4.9, and what the printed laws do to the force."""
    _table_4_3(ledger)
    _lines(ledger)
    lost_table(ledger, table("4.7"), f"{FROM_MEASUREMENT}; this number decodes the curve of its level")
    _exponentials(ledger)
    _printed_laws(ledger)
    _cancelling_moduli(ledger)
    _line_of_every_digit(ledger)


def recovered(k: int, level: int) -> tuple[float, float]:
    """E_k of MPAM1 at one level from Table 4.4 and the other levels, and its rounding (Pa).

    Slope and intercept of a least-squares line are two linear combinations of the five moduli. Either
    gives one modulus from the other four; both give two, which is needed for E_4, whose 50 kPa is wrong.
    """
    x = laws.P_KPA
    slope = (x - x.mean()) / np.sum((x - x.mean()) ** 2)
    weights = np.stack([slope, 1.0 / x.size - x.mean() * slope])
    lines = table("4.4")
    column = lines.columns[k]
    texts = [lines.text(name, column) for name in ("a", "b")]
    target = np.array([number(text) for text in texts])
    rounding = np.array([significant_half_unit(text) for text in texts])
    printed = table("4.3")
    E = printed.values()[:, k]
    E_rounding = np.array([half_unit(row[k]) for row in printed.cells])
    unknown = sorted({level, 0}) if k == 3 else [level]
    known = [i for i in range(5) if i not in unknown]
    rows = [1] if len(unknown) == 1 else [0, 1]
    inverse = np.linalg.inv(weights[np.ix_(rows, unknown)])
    value = inverse @ (target[rows] - weights[np.ix_(rows, known)] @ E[known])
    spread = np.abs(inverse) @ (rounding[rows] + np.abs(weights[np.ix_(rows, known)]) @ E_rounding[known])
    i = unknown.index(level)
    return float(value[i]), float(spread[i])


def significant_half_unit(text: str) -> float:
    """Half a unit of the fourth digit: Tables 4.4 and 4.9 print four, without trailing zeros.

    >>> significant_half_unit("1.4e6")
    500.0
    """
    return float(0.5 * 10.0 ** (np.floor(np.log10(abs(number(text)))) - 3.0))


def _table_4_3(ledger: Ledger) -> None:
    printed = table("4.3")
    for i, row in enumerate(printed.rows):
        for k, column in enumerate(printed.columns):
            if (i, k) == (0, 3):
                value, spread = decoded.corrected_e4_50(), significant_half_unit("-3.333e6") / 0.8
            else:
                value, spread = recovered(k, i)
            ledger.check(
                printed.source,
                row,
                column,
                printed.text(row, column),
                value,
                allow=spread,
                note="from Table 4.4's line and the other levels" if (k, i) != (3, 0) else "",
                misprint=f"repeats E_2 of its row; Table 4.4's intercept implies {value:.5e} (± "
                f"{spread:.0f}), with which Table 4.5's R² of E_4 is 0.9938 (with the printed value 0.037)",
            )


def _lines(ledger: Ledger) -> None:
    constants, quality = table("4.4"), table("4.5")
    E = decoded.moduli("MPAM1")
    for k, column in enumerate(constants.columns):
        a, b, r2 = laws.line(E[:, k])
        extra = "; E_4(50 kPa) corrected from the intercept" if k == 3 else ""
        ledger.check(
            constants.source,
            "a",
            column,
            constants.text("a", column),
            a,
            note="ordinary least squares to Table 4.3" + extra,
        )
        ledger.check(
            constants.source,
            "b",
            column,
            constants.text("b", column),
            b,
            note="ordinary least squares to Table 4.3" + (extra + ": by construction" if extra else ""),
        )
        ledger.check(
            quality.source,
            "R^2",
            column,
            quality.text("R^2", column),
            r2,
            note="squared correlation, equal to 1 − SSE/SST for a least-squares line" + extra,
        )
    wrong = laws.line(decoded.moduli("MPAM1", corrected=False)[:, 3])[2]
    ledger.unprinted(
        quality.source,
        "R^2",
        "E_4 with Table 4.3 as printed",
        wrong,
        "the print of E_4(50 kPa) cannot be what the thesis fitted",
    )


def _exponentials(ledger: Ledger) -> None:
    constants, quality = table("4.9"), table("4.8")
    C = constants.values()
    E = decoded.moduli("MPAM2")
    fitted = laws.double_exponential(C, laws.P_KPA)
    for k, column in enumerate(quality.columns):
        r2 = determination(fitted[:, k], E[:, k])
        ledger.check(
            quality.source,
            "R^2",
            column,
            quality.text("R^2", column),
            r2,
            note="of Table 4.9's constants against Table 4.7",
        )
        d, z = C[1, k], C[3, k]
        own = laws.exponential(E[:, k], (d, z), z_fixed=True)
        alone = "least squares to Table 4.7 at the printed z"
        for row, value in (("c", own.c), ("d", own.d), ("w", own.w)):
            # w exp(50 z) is what the data fix, so that the rounding of z carries over to w.
            allow = (
                abs(own.w) * 50.0 * significant_half_unit(constants.text("z", column)) if row == "w" else 0.0
            )
            ledger.check(
                constants.source,
                row,
                column,
                constants.text(row, column),
                value,
                allow=allow,
                about=0.002,
                note=alone + (f"; R² {r2:.7f}, at the optimum {own.r2:.7f}" if k == 4 else ""),
            )
        free = laws.exponential(E[:, k], (d, 2.0 * z), z_fixed=True)
        ledger.lost(
            constants.source,
            "z",
            column,
            constants.text("z", column),
            f"where an optimiser stopped on a ridge: z = {2 * z:.4g} gives R² {free.r2:.6f} against "
            f"{own.r2:.6f}; only w·exp(50 z) is identified"
            if k < 4
            else "four constants for five points; the optimum is given",
            np.nan if k < 4 else laws.exponential(E[:, k], (d, z)).z,
        )


def _printed_laws(ledger: Ledger) -> None:
    """What the printed constants do to the blocked force (γ = 0), level by level."""
    exponential = laws.double_exponential(table("4.9").values(), laws.P_KPA)
    cases = (
        (
            "Table 4.9",
            "MPAM2",
            exponential,
            "its R² of each modulus (Table 4.8) reproduce all the same; "
            "moduli that cancel to 1e-4 lose the force when each is fitted alone",
        ),
        ("Table 4.4", "MPAM1", laws.printed_line(), "four digits of a and b are too few"),
    )
    for source, muscle, E, why in cases:
        error = laws.force_error(muscle, E)
        true = decoded.blocked_forces(muscle)
        for i, P in enumerate(laws.P_KPA):
            ledger.unprinted(
                source,
                f"{P:.0f} kPa",
                f"F(γ=0) of {muscle} by the printed law (N)",
                true[i] + error[i],
                f"Table {decoded.MUSCLES[muscle]} decodes to {true[i]:.2f} N; the law is off by "
                f"{error[i]:+.1f} N: {why}",
            )
    for i, (P, sd) in enumerate(zip(laws.P_KPA, rounding_of_exponential(), strict=True)):
        ledger.unprinted(
            "Table 4.9",
            f"{P:.0f} kPa",
            "sd of F(γ=0) by the rounding of the constants (N)",
            sd,
            f"four digits each; the law is off by {laws.force_error('MPAM2', exponential)[i]:+.1f} N there",
        )


def _cancelling_moduli(ledger: Ledger) -> None:
    """The tabled moduli beside their sum, which is what acts at rest length."""
    for muscle, name in decoded.MUSCLES.items():
        E = decoded.moduli(muscle)
        for P, row in zip(laws.P_KPA, E, strict=True):
            ledger.unprinted(
                f"Table {name}",
                f"{P:.0f} kPa",
                "sum of the moduli (Pa)",
                float(row.sum()),
                f"their sizes add up to {np.abs(row).sum():.2e} Pa: they cancel",
            )


def _line_of_every_digit(ledger: Ledger) -> None:
    """What the line of Table 4.4 is worth before its constants are rounded."""
    full = laws.force_error("MPAM1", laws.full_line())
    for i, P in enumerate(laws.P_KPA):
        ledger.unprinted(
            "Table 4.4",
            f"{P:.0f} kPa",
            "error of F(γ=0), same line with every digit (N)",
            full[i],
            "fitted to Table 4.3 (corrected)",
        )
    ledger.unprinted(
        "Table 4.4",
        "all levels",
        "rms error to free contraction, same line with every digit (N)",
        _rms_to_free_contraction(),
        "five curves, 200 points each",
    )


def rounding_of_exponential() -> Array:
    """Standard deviation of F(γ=0) (N) that four-digit constants of Table 4.9 leave, at each level.

    Every constant is taken as uniform within its last digit.
    """
    constants = table("4.9")
    C = constants.values()
    half = np.array([[significant_half_unit(text) for text in row] for row in constants.cells])
    lever = decoded.columns(np.asarray(0.0), C.shape[1])
    variance = np.zeros(laws.P_KPA.size)
    for i in range(C.shape[0]):
        changed = C.copy()
        changed[i] += half[i]
        shift = (
            laws.double_exponential(changed, laws.P_KPA) - laws.double_exponential(C, laws.P_KPA)
        ) * lever
        variance += np.sum(shift**2, axis=1) / 3.0
    spread: Array = np.sqrt(variance)
    return spread


def _rms_to_free_contraction() -> float:
    E = decoded.moduli("MPAM1")
    errors = []
    for P, own, law in zip(decoded.LEVELS, E, laws.full_line(), strict=True):
        gamma = np.linspace(0.0, decoded.first_root(float(P), own), 200)
        errors.append(decoded.force(P, gamma, law) - decoded.force(P, gamma, own))
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
