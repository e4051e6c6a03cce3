"""Which orders of Tables 4.2 and 4.6 can be converged, and what is said of each."""

from __future__ import annotations

import numpy as np
import pytest

from mpam_calib.thesis import decoded, orders
from mpam_calib.thesis.entries import orders as entries
from mpam_calib.thesis.ledger import MISPRINT, NOT_REPRODUCIBLE, Ledger, Row
from mpam_calib.thesis.statistics import least_squares, squared_correlation
from mpam_calib.thesis.tables import number

TABLES = ("Table 4.2", "Table 4.6")


@pytest.fixture(scope="module")
def rows() -> dict[tuple[str, str], Row]:
    """Rows of both tables by source and column."""
    ledger = Ledger()
    entries.enter(ledger)
    return {(row.source, row.column): row for row in ledger.rows if row.source in TABLES}


def of_order(rows: dict[tuple[str, str], Row], table: str, order: int) -> Row:
    return rows[table, f"F_{{G+t+NL}} (E_k of the MPAM, M={order})"]


def test_orders_that_cannot_be_converged_and_those_that_may(rows: dict[tuple[str, str], Row]) -> None:
    four, six = of_order(rows, "Table 4.6", 4), of_order(rows, "Table 4.6", 6)
    assert four.verdict == MISPRINT and "at least 0.993" in four.note
    # R² is not what least squares maximise, so that a fall alone is no proof.
    assert six.verdict == MISPRINT and "hardly converged" in six.note and "no proof" in six.note
    assert [row.verdict for row in rows.values()].count(MISPRINT) == 2
    others = {row.verdict for row in rows.values() if row.printed and row not in (four, six)}
    assert MISPRINT not in others and NOT_REPRODUCIBLE in others


def test_r2_is_1_by_construction_from_the_tabled_order_on(rows: dict[tuple[str, str], Row]) -> None:
    for table, tabled in zip(TABLES, (4, 5), strict=True):
        for order in range(1, tabled + 2):
            row = of_order(rows, table, order)
            assert ("by construction" in row.note) == (order >= tabled) == (row.computed > 0.999999)


def test_which_convention_is_nearer_is_told_row_by_row(rows: dict[tuple[str, str], Row]) -> None:
    nearer = []
    for table in TABLES:
        for order in (1, 2, 3):
            ours = of_order(rows, table, order)
            strains = rows[table, f"M = {order} in strains, as Eq. 4.5 prints"]
            printed = number(ours.printed)
            in_strains = abs(strains.computed - printed) < abs(ours.computed - printed)
            nearer.append("strains" if in_strains else "stretches")
            assert strains.note.endswith(f"{nearer[-1]} come nearer")
    assert nearer == ["stretches"] * 5 + ["strains"]


def test_least_correlation_holds_for_any_two_curves() -> None:
    rng = np.random.default_rng(3)
    for size in (0.01, 0.1, 1.0):
        y = rng.normal(size=50)
        first = y + size * rng.normal(size=50)
        second = first + size * rng.normal(size=50)
        least = orders.least_correlation(squared_correlation(first, y), squared_correlation(second, first))
        assert 0.0 <= least <= squared_correlation(second, y)
    assert orders.least_correlation(0.9935, 1.0) == pytest.approx(0.9935)


def test_order_four_of_a_measurement_is_that_of_its_order_five() -> None:
    """A lower order fits the measurement as it fits the best curve of a higher one, weights being equal."""
    gamma, F = orders.curve("MPAM2", 0.24)
    G = decoded.gas_and_thickness(decoded.LEVELS[3], gamma)
    four, five = (decoded.columns(gamma, order) for order in (4, 5))
    structure = 6.0 * np.sin(60.0 * gamma)
    measured = F + structure - five @ least_squares(five, structure, 1.0 / F)
    fitted = G + four @ least_squares(four, measured - G, 1.0 / F)
    assert fitted == pytest.approx(G + four @ least_squares(four, F - G, 1.0 / F), abs=1e-3)
    own, found = squared_correlation(F, measured), squared_correlation(fitted, measured)
    assert orders.least_correlation(own, squared_correlation(fitted, F)) <= found
    assert own < 0.999 and abs(found - own) < 5e-4


def test_higher_orders_seldom_lose_as_much_as_is_printed() -> None:
    """Relative least squares of a disturbed curve, the disturbances as large as the printed R² says."""
    gamma, F = orders.curve("MPAM2", 0.24)
    G = decoded.gas_and_thickness(decoded.LEVELS[3], gamma)
    five, six = (decoded.columns(gamma, order) for order in (5, 6))
    rng = np.random.default_rng(5)
    lost = []
    for _ in range(300):
        waves = rng.normal(size=8)[:, None] * np.sin(
            rng.uniform(5.0, 120.0, 8)[:, None] * gamma + rng.uniform(0.0, 6.3, 8)[:, None]
        )
        size = np.sqrt(rng.uniform(0.002, 0.01)) * F.std() / waves.sum(axis=0).std()
        measured = F + size * waves.sum(axis=0)
        lower, higher = (
            squared_correlation(G + X @ least_squares(X, measured - G, 1.0 / F), measured)
            for X in (five, six)
        )
        lost.append(lower - higher)
    assert max(lost) > 0.0  # a fall is no proof
    assert max(lost) <= entries.LIKELY_FALL
