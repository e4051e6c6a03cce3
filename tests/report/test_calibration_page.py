"""The calibration report says what its view holds, for a muscle and for a bladder material."""

from __future__ import annotations

import re
import time
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from mpam_calib.prediction.left_out import COLUMNS
from mpam_calib.report.blocks import DataTable, Text
from mpam_calib.report.calibration import _left_out_section, _pairs_section, calibration_page
from mpam_calib.report.figures import corner, density, loops, residuals, style
from mpam_calib.report.numbers import with_band
from mpam_calib.report.parameters import learnt_table, summary_table
from mpam_calib.report.view import CalibrationView
from mpam_calib.report.wording import simulation_sentence
from mpam_calib.specimen.declaration import Simulation

from .synthetic import material, muscle


def words_of(html: str) -> str:
    """What a reader sees, without tags and pictures."""
    return re.sub(r"\s+", " ", re.sub(r"<style>.*?</style>|<[^>]*>", "", html, flags=re.S))


@pytest.fixture(scope="module")
def view() -> CalibrationView:
    return muscle()


@pytest.fixture(scope="module")
def html(view: CalibrationView) -> str:
    return calibration_page(view).render()


def test_first_screen_states_both_numbers_with_their_bands(view: CalibrationView, html: str) -> None:
    lead = words_of(html.split("<nav")[0])
    for quantity, scale, unit in (("blocked_force_N", 1.0, "N"), ("free_contraction", 100.0, "%")):
        row = view.at_level(quantity, 250.0)
        assert row is not None
        value, band = with_band(*(scale * float(row[q]) for q in ("mean", "q05", "q95")))
        assert f"{value} {unit}" in lead
        assert f"90 % band {band} {unit}" in lead
    assert "At 250 kPa, MPAM1 pulls with" in lead
    assert "Yes, you can use these numbers with their bands; but the data say nothing" in lead


def test_every_section_is_there(html: str) -> None:
    titles = re.findall(r'<h2 id="[^"]*">([^<]*)</h2>', html)
    assert titles == [
        "Force against contraction",
        "What the simulation misses",
        "Blocked force and free contraction",
        "Parameters",
        "Which parameters trade off",
        "Has the calculation settled?",
        "What the data could not identify",
        "Data and settings",
    ]
    assert html.count("<figure>") == 5


def test_parameters_and_settings_are_those_of_the_view(view: CalibrationView, html: str) -> None:
    words = words_of(html)
    for row in view.summary.to_dict("records"):
        value, band = with_band(float(row["mean"]), float(row["q05"]), float(row["q95"]))
        assert row["parameter"] in words
        assert value in words
        assert band in words
    for text in ("3f9a1c", "loops.csv", "18000", "1.003 at worst, for K_f", "1,800 independent draws"):
        assert text in words


def test_levels_table_has_a_row_for_each_level(view: CalibrationView, html: str) -> None:
    table = html.split("Mean and 90 % band at each level</p>")[1].split("</table>")[0]
    assert table.count("<tr>") == 1 + len(view.levels_kPa)


def test_unidentified_parameters_come_first(view: CalibrationView) -> None:
    table = learnt_table(view)
    assert table["parameter"].iloc[0] == "P_DB_kPa"
    assert "nothing" in table["what that means"].iloc[0]
    assert table["what that means"].iloc[-1] == "The data determine it."


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (0.005, 0.142, "The data narrow it down; its band is wide."),
        (-0.1, 0.2, "The data narrow it down, but leave its sign open."),
        (0.06, 0.08, "The data determine it."),
        (-0.08, -0.06, "The data determine it."),
    ],
)
def test_a_band_that_is_wide_beside_its_value_is_not_determined(
    view: CalibrationView, low: float, high: float, words: str
) -> None:
    summary = view.summary.copy()
    summary.loc[summary["parameter"] == "K_f", ["q05", "q95"]] = low, high
    table = learnt_table(replace(view, summary=summary)).set_index("parameter")
    assert table.loc["K_f", "what that means"] == words


def test_page_is_small_fast_and_the_same_each_time(view: CalibrationView, html: str) -> None:
    start = time.perf_counter()
    again = calibration_page(view).render()
    # about 2.5 s on a free core; the bound leaves room for a busy machine
    assert time.perf_counter() - start < 15.0
    assert again == html
    assert len(html) < 3_000_000


def test_no_reference_to_the_outside(html: str) -> None:
    assert re.findall(r'(?:src|href)="(?!data:|#)[^"]*"', html) == []
    assert "http://" not in html
    assert "https://" not in html


def test_nasty_names_are_harmless() -> None:
    nasty = "<script>alert(1)</script>$x$"
    view = muscle(
        60, 200, name=nasty, material=nasty, provenance=nasty, warnings=[nasty], settings={nasty: nasty},
        data_files=pd.DataFrame({"file": [nasty]}),
    )  # fmt: skip
    view = replace(view, summary=view.summary.assign(unit="$Pa$"))
    html = calibration_page(view).render()
    assert "<script" not in html
    assert html.count("&lt;script&gt;") >= 6


def test_an_unsettled_run_says_so_on_top_and_below(view: CalibrationView) -> None:
    late = replace(view, convergence=replace(view.convergence, converged=False, rhat_max=1.08))
    words = words_of(calibration_page(late).render())
    assert "No, do not rely on these numbers: the calculation has not settled." in words
    assert "No: treat every number on this page as provisional." in words


def test_a_muscle_with_a_tensile_test_has_the_muscle_s_page(view: CalibrationView) -> None:
    rubber = material()
    both = replace(
        view,
        bands=pd.concat([view.bands, rubber.bands]),
        observed=pd.concat([view.observed, rubber.observed]),
    )
    html = calibration_page(both).render()
    lead = words_of(html.split("<nav")[0])
    assert "Muscle calibration" in lead and "At 250 kPa, MPAM1 pulls with" in lead
    titles = re.findall(r'<h2 id="[^"]*">([^<]*)</h2>', html)
    assert titles[:5] == [
        "Force against contraction",
        "What the simulation misses",
        "Blocked force and free contraction",
        "Stress against strain",
        "What the law misses",
    ]
    assert html.count("<figure>") == 7


def test_material_report() -> None:
    view = material()
    html = calibration_page(view).render()
    words = words_of(html)
    assert "Stretched, Ecoflex 00-50 carries" in words
    assert "at a strain of 3 " in words
    assert "Blocked force and free contraction" not in words
    assert "0.1 to 3 (in use)" in words
    assert "stress at strain 0.5 (Pa)" in words


def test_many_levels_are_spread_over_at_most_nine_panels(view: CalibrationView) -> None:
    frames = []
    for P in range(50, 300, 12):
        frames.append(view.bands[view.bands["pressure_kPa"] == 250.0].assign(pressure_kPa=float(P)))
    levels = tuple(float(P) for P in range(50, 300, 12))
    many = replace(view, bands=pd.concat(frames, ignore_index=True), levels_kPa=levels)
    words = words_of(calibration_page(many).render())
    assert "9 of 21 levels are shown." in words


def test_static_map_without_branches_and_without_draws(view: CalibrationView) -> None:
    rows = view.observed[view.observed["branch"] == "loading"].assign(kind="force_map", branch="")
    bands = view.bands[view.bands["branch"] == "mean"]
    bare = replace(
        view, observed=rows, bands=bands, draws={}, prior_draws={}, headline=(), unidentified=pd.DataFrame(),
        remainder=float("nan"), noise=float("nan"),
    )  # fmt: skip
    words = words_of(calibration_page(bare).render())
    assert "Simulation misses by" not in words and "Levels left out" not in words
    assert "Blue: loading" not in words
    assert "there is nothing to identify" in words and "determine them all" not in words
    assert "Which parameters trade off" not in words


def test_levels_predicted_from_the_others(view: CalibrationView) -> None:
    left_out = pd.DataFrame(
        [[50.0, 200, 2.0, 1.5, 0.2, 0.31, True], [100.0, 200, 1.0, -0.5, 0.1, 0.86, False]],
        columns=COLUMNS,
    )
    for remainder, heading in ((0.24, "Simulation misses by"), (np.nan, "Levels left out")):
        shown = replace(view, left_out=left_out, remainder=remainder)
        words = words_of(calibration_page(shown).render())
        assert heading in words and "Each level predicted from the others" in words
        assert "86 %" in words and "50 (beyond the others)" in words and "1.5 ± 0.2" in words
        assert "2 of 5 levels are looked at" in words
        assert "at a pressure level that the fit had not seen" in words
    every = replace(view, left_out=pd.concat([left_out] * 3)[:5])
    assert "levels are looked at" not in words_of(calibration_page(every).render())


def test_constant_and_broken_draws_do_not_stop_the_page(view: CalibrationView) -> None:
    draws = {"K_f": np.full(100, 0.07), "a_1": np.linspace(1, 2, 100)}
    html = calibration_page(replace(view, draws=draws, headline=("K_f", "a_1", "absent"))).render()
    assert "K_f" in html


@pytest.mark.parametrize("moduli", ["loops", "tensile", "run:../ecoflex"])
def test_every_declared_simulation_has_words(view: CalibrationView, moduli: str) -> None:
    simulation = Simulation(moduli=moduli, friction="none", law="free", friction_by_pressure=True)
    words = words_of(calibration_page(replace(view, simulation=simulation)).render())
    assert "no friction, one value per level" not in words
    assert "The simulation:" in words


def test_summary_table_says_what_a_parameter_is(view: CalibrationView) -> None:
    said = replace(view, meanings={"K_f": "Coulomb friction"})
    assert list(summary_table(said, ["K_f", "tip_factor"])["what it is"]) == ["Coulomb friction", ""]


def test_summary_table_keeps_the_order_asked_for(view: CalibrationView) -> None:
    assert list(summary_table(view, ["tip_factor", "K_f"])["parameter"]) == ["tip_factor", "K_f"]


def test_correlations_are_those_of_the_draws(view: CalibrationView) -> None:
    a, b, r = next(pair for pair in corner.correlations(view) if set(pair[:2]) == {"a_1", "b_1"})
    assert r == pytest.approx(np.corrcoef(view.draws[a], view.draws[b])[0, 1])


def test_density_is_that_of_a_normal() -> None:
    draws = np.random.default_rng(1).normal(3.0, 2.0, 20_000)
    x = np.linspace(-4, 10, 301)
    exact = np.exp(-0.5 * ((x - 3) / 2) ** 2) / (2 * np.sqrt(2 * np.pi))
    found = density.density(draws, x)
    assert np.abs(found - exact).max() < 0.01
    assert np.trapezoid(found, x) == pytest.approx(1.0, abs=0.01)


def test_density_shows_something_of_draws_over_many_decades() -> None:
    """An unidentified coefficient's few largest draws must not empty the picture of the others."""
    draws = np.random.default_rng(3).standard_cauchy(4000) ** 9
    low, high = np.quantile(draws, [0.002, 0.998])
    x = np.linspace(low, high, 120)
    found = density.density(draws, x)
    assert found.max() > 0.0
    assert np.trapezoid(found, x) == pytest.approx(1.0, abs=0.05)


def test_density_is_zero_where_no_draw_is_near() -> None:
    """A posterior eight prior sds away is far from all draws of the prior that it is drawn over."""
    draws = np.random.default_rng(4).normal(size=4000)
    for away in (-9.0, 9.0, 1e6):
        assert not density.density(draws, np.linspace(away - 0.1, away + 0.1, 240)).any()
    assert density.density(draws, np.linspace(2.9, 3.1, 240)).min() > 0.0


def test_mass_levels_hold_their_mass() -> None:
    rng = np.random.default_rng(2)
    _, _, height = density.joint_density(*rng.normal(size=(2, 20_000)))
    low, high = density.mass_levels(height, (0.5, 0.9))
    assert height[height >= low].sum() / height.sum() == pytest.approx(0.9, abs=0.02)
    assert height[height >= high].sum() / height.sum() == pytest.approx(0.5, abs=0.02)


def test_binned_means() -> None:
    x = np.array([0.0, 0.1, 0.9, 1.0])
    mean_x, mean_y = residuals.binned(x, np.array([1.0, 3.0, 5.0, 7.0]), bins=2)
    np.testing.assert_allclose(mean_x, [0.05, 0.95])
    np.testing.assert_allclose(mean_y, [2.0, 6.0])


def test_each_figure_of_a_level_left_out_stands_in_its_column(view: CalibrationView) -> None:
    """A bias below zero is one: the readings lie below what the others foresee."""
    rows = [(50.0, 40, 2.5, 1.9, 0.7, 0.4, True), (150.0, 40, 1.234, -0.56, 0.21, 0.85, False)]
    section = _left_out_section(replace(view, left_out=pd.DataFrame(rows, columns=COLUMNS)))
    (table,) = section.blocks
    assert isinstance(table, DataTable)
    first, second = table.frame.to_numpy().tolist()
    assert first == ["50 (beyond the others)", "40 %", "2.5", "1.9 ± 0.7"]
    assert second == ["150", "85 %", "1.2", "−0.56 ± 0.2"]


def test_parameters_that_go_against_each_other_are_linked_as_strongly() -> None:
    plain = muscle(n_draws=300)
    made = replace(
        plain,
        headline=("K_f", "tip_factor"),
        draws={"K_f": plain.draws["K_f"], "tip_factor": -plain.draws["K_f"]},
    )
    text = next(block for block in _pairs_section(made).blocks if isinstance(block, Text))
    assert "K_f and tip_factor (−1.00)" in text.html


@pytest.mark.parametrize(
    ("branches", "labels"),
    [
        (("loading", "unloading", ""), ["loading", "unloading", "others, friction-free"]),
        (("loading", "unloading"), ["loading", "unloading"]),
        (("",), []),
    ],
)
def test_every_reading_has_its_place_beside_the_curves(
    view: CalibrationView, branches: tuple[str, ...], labels: list[str]
) -> None:
    """Also one without a branch where others have one."""
    seen = view.observed[view.observed["kind"] == "loops"]
    ways = np.array(branches)[np.arange(len(seen)) % len(branches)]
    for panel in loops.draw(replace(view, observed=seen.assign(branch=ways))).axes:
        if not panel.get_title(loc="left"):
            continue
        dots = [line.get_color() for line in panel.lines if line.get_marker() == "o"]
        assert dots == [style.BRANCH_COLOURS[branch or "mean"] for branch in branches]
        written = [text.get_text() for text in panel.texts]
        assert written == (labels if panel.get_title(loc="left") == "50 kPa" else [])


@pytest.mark.parametrize(
    ("declared", "words"),
    [
        ({}, "the bladder's stiffness comes from a tensile test; "),
        (
            {"E_Pa": (4.0e4, -2.6e3), "E_rel_sd": 0.1},
            "the bladder's moduli are declared: E_1 = 40 kPa, E_2 = −2.6 kPa, known but for one common "
            "factor of sd 10 %; ",
        ),
        (
            {"E_Pa": (4.0e4,), "E_rel_sd": 0.0},
            "the bladder's moduli are declared: E_1 = 40 kPa, taken as exact; ",
        ),
    ],
)
def test_declared_moduli_are_not_called_a_tensile_test(declared: dict[str, object], words: str) -> None:
    simulation = Simulation(moduli="tensile", law="constant", **declared)
    assert words in simulation_sentence(simulation)
