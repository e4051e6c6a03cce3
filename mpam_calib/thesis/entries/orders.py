"""Tables 4.1, 4.2 and 4.6: the material's moduli, and the order of the polynomial."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mpam_calib.thesis import decoded, laws, orders
from mpam_calib.thesis.ledger import FROM_MEASUREMENT, Ledger
from mpam_calib.thesis.statistics import scaled_condition
from mpam_calib.thesis.tables import PrintedTable, half_unit, number, table
from mpam_calib.thesis.tensile import RANGES, ecoflex, tensile_fit

LIKELY_FALL = 0.0105
"""R² that a higher order of nested fits lost at most in 2,621 random disturbances of the decoded curve."""


@dataclass(frozen=True)
class OrderTable:
    """A table of order selection: the contraction up to which it is fitted, and the fits themselves."""

    muscle: str
    printed: PrintedTable
    limit: float
    fits: list[orders.Fit]


def tables() -> tuple[OrderTable, OrderTable]:
    """Tables 4.2 and 4.6 on the decoded curves (the material's moduli only in the first)."""
    found = []
    for muscle, name, highest in (("MPAM1", "4.2", 5), ("MPAM2", "4.6", 6)):
        printed = table(name)
        limit = orders.range_from_print(muscle, printed.value("R^2", "F_{G+t}"))
        fits = orders.order_table(muscle, limit, range(1, highest + 1))
        found.append(OrderTable(muscle, printed, limit, fits if muscle == "MPAM1" else [fits[0], *fits[2:]]))
    return found[0], found[1]


def enter(ledger: Ledger) -> None:
    """Enter Tables 4.1, 4.2, 4.6, and the joint fits that judge order and law."""
    _table_4_1(ledger)
    for selection in tables():
        _selection(ledger, selection)
    _joint_fits(ledger)


def _table_4_1(ledger: Ledger) -> None:
    printed = table("4.1")
    column = printed.columns[0]
    strain, stress = ecoflex()
    spans = [tensile_fit(strain, stress, *span) for span in RANGES]
    own = next(fit for fit in spans if (fit.low, fit.high) == (0.1, 3.0))
    for k, row in enumerate(printed.rows):
        others = ", ".join(f"{f.moduli[k]:.3g} to {f.high:g}" for f in spans)
        ledger.lost(
            printed.source,
            row,
            column,
            printed.text(row, column),
            f"{FROM_MEASUREMENT}, and the strain range is not printed. Computed: the same method on a "
            "measured curve of "
            f"Ecoflex 00-50 (Marechal et al. 2020), strain 0.1 to 3; by upper strain: {others}",
            own.moduli[k],
        )


def _selection(ledger: Ledger, selection: OrderTable) -> None:
    printed = selection.printed
    for column, fit in zip(printed.columns, selection.fits, strict=True):
        text = printed.text("R^2", column)
        note, proof = _note(selection, column, fit), _not_converged(selection, text, fit)
        if proof:
            ledger.contradicted(
                printed.source, "R^2", column, text, fit.squared_correlation, f"{proof}; {note}"
            )
        else:
            ledger.lost(printed.source, "R^2", column, text, note, fit.squared_correlation)
    _strains(ledger, selection)
    whole = decoded.first_root(2e5, decoded.moduli(selection.muscle)[orders.LEVEL])
    gas = orders.gas_fit(selection.muscle, whole)
    ledger.unprinted(
        printed.source,
        "1 − SSE/SST",
        "F_{G+t} to free contraction",
        gas.determination,
        f"the squared correlation there is {gas.squared_correlation:.4f}: the two kinds of R² must not be "
        "compared",
    )


def _column(order: int) -> str:
    return f"F_{{G+t+NL}} (E_k of the MPAM, M={order})"


def _note(selection: OrderTable, column: str, fit: orders.Fit) -> str:
    honest = f"1 − SSE/SST is {fit.determination:.4f}, rms {fit.rmse_N:.2f} N"
    if column == "F_{G+t}":
        return f"used to find the range of the fit, γ <= {selection.limit:.4f}; {honest}"
    tabled = orders.tabled_order(selection.muscle)
    if fit.order < tabled:
        return f"on the decoded curve (the measured average is lost), γ <= {selection.limit:.4f}; {honest}"
    return f"the decoded curve is of order {tabled}, so that this order's R² with it is 1 by construction"


def _not_converged(selection: OrderTable, text: str, fit: orders.Fit) -> str:
    """Why a printed R² is hardly a converged fit's beside that of the tabled order; "" where it may be.

    Least squares of nested polynomials with the same weights: what fits the measurement best in a lower
    order is what fits the best curve of a higher order best. That curve is decoded and its R² printed.
    """
    tabled = orders.tabled_order(selection.muscle)
    own = selection.printed.value("R^2", _column(tabled))
    if fit.order > tabled and number(text) < own - LIKELY_FALL:
        return (
            f"this order or M = {tabled} is hardly converged: in 2,621 random disturbances no higher order "
            f"lost more than {LIKELY_FALL} of R², and this is {own - number(text):.4f} below M = {tabled} ("
            "no proof: they do not maximise R², and the print at M = 2 is below M = 1 in both tables)"
        )
    if not 0 < fit.order < tabled:
        return ""
    least = orders.least_correlation(own, fit.squared_correlation)
    if number(text) + half_unit(text) >= least:
        return ""
    return (
        f"this order or M = {tabled} is not converged: the best order {fit.order} is also the best one to "
        f"the curve of order {tabled} (nested least squares) and matches that to a squared correlation of "
        f"{fit.squared_correlation:.5f}; as that curve has {own:.4f} with the measurement, this would have "
        f"at least {least:.3f}"
    )


def _strains(ledger: Ledger, selection: OrderTable) -> None:
    """The reading in strains, which Eq. 4.5 prints, order by order beside that in stretches."""
    for fit in selection.fits:
        if not 0 < fit.order <= 3:
            continue
        print_ = selection.printed.value("R^2", _column(fit.order))
        strain = orders.order_fit(selection.muscle, selection.limit, fit.order, "engineering")
        ours = {"stretches": fit.squared_correlation, "strains": strain.squared_correlation}
        nearer = min(ours, key=lambda kind: abs(ours[kind] - print_))
        ledger.unprinted(
            selection.printed.source,
            "R^2",
            f"M = {fit.order} in strains, as Eq. 4.5 prints",
            strain.squared_correlation,
            f"on the decoded curve; stretches have {fit.squared_correlation:.4f}, the print {print_:.4f}: "
            f"{nearer} come nearer",
        )


def _joint_fits(ledger: Ledger) -> None:
    source = "Eq. 4.7, 4.8 fitted jointly to the force of MPAM2"
    linear = laws.linear_basis()
    fits = [laws.joint("MPAM2", M, linear, "linear") for M in (3, 4, 5)]
    fits += [
        laws.joint_exponential("MPAM2", 4),
        laws.joint_double_exponential("MPAM2", 4),
        laws.joint("MPAM2", 4, np.eye(5), "free at each level"),
        laws.joint("MPAM2", 4, linear, "linear, without 50 kPa", slice(1, None)),
    ]
    for fit in fits:
        name = f"{fit.law}, M = {fit.order}"
        rates = f"; rates {', '.join(f'{r:.6f}' for r in fit.rates)} per kPa" if fit.rates else ""
        note = f"γ = 0 (0.005) 0.29, 59 points a level, {fit.n_constants} constants{rates}"
        ledger.unprinted(source, name, "rms (N)", fit.rmse_N, note)
        ledger.unprinted(source, name, "1 − SSE/SST", fit.r2, note)
    for order in (4, 5, 6):
        X = decoded.columns(np.linspace(0.0, 0.33, 100), order)
        ledger.unprinted(
            "Eq. 4.10",
            f"M = {order}",
            "condition number of the scaled columns",
            scaled_condition(X),
            "γ = 0 to 0.33: the polynomial basis is ill-conditioned",
        )
