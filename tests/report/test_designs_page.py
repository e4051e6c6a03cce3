"""The page of the best designs: within which bounds, beside the tested muscle, in tables that fit."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from mpam_calib.design.robust import Design, Packed, designs_table
from mpam_calib.model.blueprint import Blueprint
from mpam_calib.report.blocks import DataTable, Headline, Notice, Numbers, Text
from mpam_calib.report.design_bounds import beyond_bounds
from mpam_calib.report.designs import DesignsView, designs_page
from mpam_calib.report.designs_table import contraction_band
from mpam_calib.report.page import Page
from mpam_calib.specimen.declaration import Geometry, Sensors, Simulation

THESIS = Geometry(L0_mm=50.0, R0_mm=3.0, t0_mm=0.7, alpha0_deg=72.0)
LARGE = Geometry(L0_mm=180.0, R0_mm=8.0, t0_mm=1.2, alpha0_deg=66.0)
P = 200e3
HELD = ("R at its upper bound", "α at its upper bound", "V_bl/V >= low")
TESTED = pd.DataFrame(
    {
        "quantity": ["blocked_force_N"],
        "pressure_kPa": [200.0],
        "mean": [292.2],
        "q05": [291.8],
        "q50": [292.2],
    }
).assign(q95=292.6)


def design(case: str, method: str, wall: float) -> Design:
    draws = 73.07 + 0.1 * np.linspace(-1.0, 1.0, 50)
    x = np.array([3e-3, wall, np.radians(72.0), 0.13e-3, 100.0])[: 5 if case == "I" else 3]
    return Design(case, P, method, x, draws, draws, 0.3 + 0.0 * draws, HELD)


def page(
    geometry: Geometry,
    tested: pd.DataFrame = TESTED,
    cautious: float = 0.676e-3,
    levels: tuple[float, ...] = (1e5, 3e5),
    packed: tuple[float, float] = (73.0, 72.9),
) -> Page:
    """A page of one pressure; the two aims part where the ``cautious`` wall is another.

    ``packed``: the force (N) with any strands, and with those that fit; it is 73.07 N without any.
    """
    designs = [
        design(case, method, wall)
        for case in ("I", "II")
        for method, wall in (("posterior_mean", 0.676e-3), ("q05", cautious))
    ]
    # Only what the page reads: the recordings' own numbers say nothing here.
    blueprint = Blueprint.model_construct(
        geometry=geometry,
        braid=None,
        sensors=Sensors(),
        simulation=Simulation(),
        levels=levels,
        reach=(0.3,) * len(levels),
    )
    view = DesignsView(
        "A", True, blueprint, designs, designs_table(designs),
        [Packed(P, packed[0], (designs[0].x,), packed[1:])], (2.5e-3,),
        {"I": np.array([79.58]), "II": np.array([79.59])}, (50, 50), tested,
    )  # fmt: skip
    return designs_page(view)


def cards(page: Page) -> dict[str, str]:
    (numbers,) = (b for b in page.lead if isinstance(b, Numbers))
    return {item.label: item.value for item in numbers.items}


def told(page: Page) -> list[str]:
    return [b.html for b in page.lead if isinstance(b, Notice)]


def tables(page: Page) -> list[DataTable]:
    return [b for b in page.sections[0].blocks if isinstance(b, DataTable)]


def test_the_headline_says_within_which_bounds() -> None:
    (headline,) = (b for b in page(LARGE).lead if isinstance(b, Headline))
    assert "Within the thesis's bounds (R 0.45–3 mm, t 0.16–1.5 mm, α 36–72°" in headline.html


@pytest.mark.parametrize(
    ("levels", "said"),
    [((1e5, 3e5), "° at 100 to 300 kPa."), ((2e5,), "° at 200 kPa."), ((2.5e3, 3e5), "° at 2.5 to 300 kPa.")],
)
def test_recorded_pressures_are_told_from_to_and_one_by_itself(levels: tuple[float, ...], said: str) -> None:
    (words,) = (t for t in told(page(THESIS, levels=levels)) if t.startswith("Extrapolated."))
    assert said in words and "and to 200 kPa, as if" in words


@pytest.mark.parametrize(
    ("packed", "told"),
    [((73.0, 71.9), True), ((73.06, 73.05), False), ((60.0, 50.0), False)],
)
def test_strands_are_said_to_hide_the_braid_s_term_only_where_they_do(
    packed: tuple[float, float], told: bool
) -> None:
    """Not where stiff ones that fit cost nothing either, nor where it is large with any."""
    (text,) = (b.html for b in page(THESIS, packed=packed).sections[1].blocks if isinstance(b, Text))
    assert ("negligible follows from them alone" in text) == told
    assert "N against Case II" in text


def test_a_tested_muscle_outside_the_bounds_is_told_with_its_own_force() -> None:
    shown = page(LARGE)
    assert cards(shown)["The tested muscle"] == "292.2"
    (words,) = (t for t in told(shown) if "outside these bounds" in t)
    assert "R = 8 mm, V_bl/V = 0.28" in words and "292.2 N" in words
    assert not any("outside these bounds" in t for t in told(page(THESIS)))


def test_a_run_that_does_not_give_its_own_force_has_no_such_card() -> None:
    shown = page(LARGE, pd.DataFrame())
    assert "The tested muscle" not in cards(shown)
    assert any("outside these bounds: R = 8 mm" in t for t in told(shown))


def test_a_muscle_at_the_bounds_lies_within_them() -> None:
    assert beyond_bounds(THESIS) == ""
    flat = Geometry(L0_mm=50.0, R0_mm=3.0, t0_mm=0.7, alpha0_deg=30.0)
    assert beyond_bounds(flat) == "α = 30°"


def test_a_muscle_just_outside_a_bound_is_told_with_digits_enough_to_see_it() -> None:
    """V_bl/V of 0.399 was said to lie outside "at least 0.4" as 0.4."""
    near = Geometry(L0_mm=80.0, R0_mm=4.0, t0_mm=0.9, alpha0_deg=72.003)
    assert beyond_bounds(near) == "R = 4 mm, α = 72.003°, V_bl/V = 0.399"


@pytest.mark.parametrize(("geometry", "there"), [(THESIS, True), (LARGE, False)])
def test_table_3_5_is_shown_beside_the_thesiss_own_muscle_alone(geometry: Geometry, there: bool) -> None:
    shown = page(geometry)
    assert ("Thesis, Table 3.5" in cards(shown)) == there
    assert all(("Table 3.5 N" in table.frame.columns) == there for table in tables(shown))


def test_aims_that_lead_to_one_design_have_one_row() -> None:
    assert [len(table.rows) for table in tables(page(LARGE))] == [1, 1]
    assert [len(table.rows) for table in tables(page(LARGE, cautious=0.7e-3))] == [2, 2]


def test_what_holds_a_design_stands_at_its_value() -> None:
    one, _ = tables(page(LARGE))
    row = dict(zip(one.frame.columns, one.rows[0], strict=True))
    assert (row["R mm"], row["t mm"], row["α °"], row["n"]) == ("3.00↑", "0.676†", "72.0↑", "100")
    assert "held by" not in one.frame.columns


def test_what_nineteen_in_twenty_exceed_is_not_rounded_up() -> None:
    assert cards(page(THESIS))["Nineteen in twenty exceed"] == "72.9"  # of 72.98


def test_a_free_contraction_has_an_upper_end_where_all_but_a_few_draws_have_a_root() -> None:
    """In per cent; those without count with where the curves end, 60 %."""
    draws = np.linspace(0.30, 0.32, 101)
    assert contraction_band(draws) == ("31.0", "30.1–31.9")
    value, band = contraction_band(np.where(np.arange(101) < 91, draws, 0.6))
    assert value.startswith("at least ") and band == "30 to beyond 60"
