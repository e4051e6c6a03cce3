"""The numbers of a band: its quantiles, the noise of a new reading, a new stroke's own part, its marks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from model import build
from scipy import stats

from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.model.model import Model, build_model
from mpam_calib.posterior.draws import Draws
from mpam_calib.posterior.likelihood.covariance import ROUGH_LENGTH
from mpam_calib.prediction.bands import _table, muscle_bands
from mpam_calib.prediction.curves import Reach, force_curves
from mpam_calib.prediction.fitted import noise_of
from mpam_calib.specimen.recording import BlockedForce, FreeContraction

DRAWS = 2000
LEVELS = np.array([1e5, 1.5e5, 2e5])
NOISE, CONTRACTION_NOISE, ROUGH = 0.8, 0.004, 0.5
"""sds of a reading of the force (N), of the contraction, and of a stroke's own remainder (N)."""
SHARES = {"q05": 0.05, "q25": 0.25, "q50": 0.5, "q75": 0.75, "q95": 0.95}


def known() -> tuple[Model, Draws]:
    """Draws that are all one muscle, with the noise above and no stroke's own remainder."""
    free = FreeContraction(pressure_Pa=LEVELS, contraction=np.array([0.4, 0.43, 0.45]))
    made = build.with_force(build.specimen(None, build.loops(), free_contraction=free), np.full(72, 10.0))
    model = build_model(draw_blueprint(made))
    u = np.zeros((DRAWS, len(model.names)))
    values = model.values(u)
    for name, value in (
        ("noise_sd_N", NOISE), ("noise_corr_sd_N", 0.0), ("stroke_remainder_sd_N", 0.0),
        ("contraction_sd", CONTRACTION_NOISE),
    ):  # fmt: skip
        assert name in values
        values[name] = np.full((DRAWS, 1), value)
    return model, Draws(u, values, np.zeros((DRAWS, sum(model.linear_sizes))), 1)


@pytest.fixture(scope="module")
def bands() -> pd.DataFrame:
    return muscle_bands(*known(), LEVELS, 3)


def test_quantiles_stand_in_their_columns() -> None:
    draws = np.random.default_rng(0).permutation(np.linspace(0.0, 100.0, 1001))
    row = _table("force_N", np.array([2e5]), np.array([0.1]), "mean", draws[:, None, None]).iloc[0]
    assert row[list(SHARES)].tolist() == pytest.approx([100.0 * share for share in SHARES.values()])
    assert (row["mean"], row["pressure_kPa"], row["contraction"]) == pytest.approx((50.0, 200.0, 0.1))


@pytest.mark.parametrize("quantity", ["force_N", "blocked_force_N"])
def test_a_new_reading_of_a_known_muscle_scatters_by_the_noise(bands: pd.DataFrame, quantity: str) -> None:
    bare, noisy = (bands[bands["quantity"] == quantity + s].reset_index() for s in ("", "_observed"))
    assert bare["q95"].to_numpy() == pytest.approx(bare["q05"].to_numpy(), abs=1e-9)
    for name, share in SHARES.items():
        off = noisy[name] - bare["mean"]
        assert off.mean() == pytest.approx(NOISE * stats.norm.ppf(share), abs=0.06 * NOISE)


def test_a_new_free_contraction_scatters_by_its_own_noise_and_the_cell_s(bands: pd.DataFrame) -> None:
    """The cell's moves the root by its size over the curve's slope there."""
    at = bands[bands["pressure_kPa"] == 200.0]
    free = at[at["quantity"].str.startswith("free_contraction")].set_index("quantity")
    curve = at[(at["quantity"] == "force_N") & (at["branch"] == "mean")]
    last = curve.iloc[-3:]
    slope = np.polyfit(last["contraction"], last["mean"], 1)[0]
    expected = np.hypot(CONTRACTION_NOISE, NOISE / slope)
    assert expected > 1.1 * CONTRACTION_NOISE
    seen = free.loc["free_contraction_observed"]
    assert (seen["q95"] - seen["q05"]) / 3.29 == pytest.approx(expected, rel=0.07)
    assert free.loc["free_contraction", "q95"] == pytest.approx(free.loc["free_contraction", "q05"])


def test_a_stroke_s_own_remainder_fades_along_the_contraction_and_is_each_branch_s() -> None:
    along = np.array([0.0, 0.02, 0.1])
    model, plain = known()
    rough = replace(plain, values=plain.values | {"stroke_remainder_sd_N": np.full((DRAWS, 1), ROUGH)})
    force, without = (force_curves(model, draws, LEVELS, along, 4).force for draws in (rough, plain))
    own = force - without
    loading, unloading, mean = np.moveaxis(own[:, 1], 1, 0)
    assert mean == pytest.approx(0.5 * (loading + unloading), abs=1e-9)
    assert loading.std(axis=0) == pytest.approx(np.full(3, ROUGH), rel=0.06)
    assert abs(np.corrcoef(loading[:, 1], unloading[:, 1])[0, 1]) < 0.08
    assert abs(np.corrcoef(loading[:, 1], own[:, 2, 0, 1])[0, 1]) < 0.08
    assert model.setting is not None
    length = ROUGH_LENGTH * model.setting.stroke / model.setting.geometry.L0
    expected = np.exp(-(along - along[0]) / length)
    assert np.corrcoef(loading.T)[0] == pytest.approx(expected, abs=0.06)


def test_what_readings_and_strokes_add_is_the_seed_s_own() -> None:
    model, plain = known()
    few = plain.thin(50)
    rough = replace(few, values=few.values | {"stroke_remainder_sd_N": np.full((50, 1), ROUGH)})
    first, again, other = (
        force_curves(model, rough, LEVELS[2:], np.zeros(1), seed).force for seed in (4, 4, 5)
    )
    without, there = (force_curves(model, few, LEVELS[2:], np.zeros(1), seed).force for seed in (4, 5))
    assert np.array_equal(first, again)
    assert not np.allclose(first - without, other - there)
    first, again, other = (muscle_bands(model, few, LEVELS[2:], seed) for seed in (4, 4, 5))
    assert first.equals(again)
    for quantity in ("force_N_observed", "blocked_force_N_observed", "free_contraction_observed"):
        one, two = (table.loc[table["quantity"] == quantity, "q95"] for table in (first, other))
        assert not np.isclose(one, two).any()


def test_curves_without_a_root_are_marked_where_they_are_more_than_a_few() -> None:
    """Pushed up by a zero of the remainder's; the noise of the cell makes no difference."""
    model, draws = known()
    p = model.linear_sizes[0]
    for share, marked in ((0.02, False), (0.045, False), (0.055, True), (0.2, True)):
        eta = draws.eta.copy()
        eta[: int(share * DRAWS), p] = 1e4
        found = muscle_bands(model, replace(draws, eta=eta), LEVELS[2:], 0).set_index("quantity")
        assert found.loc["free_contraction", "extrapolated"] == marked


def test_pressures_more_than_a_hundredth_of_the_highest_outside_the_levels_are_extrapolated() -> None:
    model, draws = known()
    found = muscle_bands(model, draws.thin(50), np.array([2e5, 2.1e5]), 0)
    assert found[found["pressure_kPa"] > 205.0]["extrapolated"].all()
    assert (
        not found[found["pressure_kPa"] < 205.0].set_index("quantity").loc["free_contraction", "extrapolated"]
    )
    furthest = np.array([0.2, 0.25, 0.3])
    reach = Reach(LEVELS, furthest, np.zeros(3), furthest)
    asked = np.array([0.97e5, 0.985e5, 0.99e5, 1.5e5, 2.01e5, 2.015e5, 2.03e5])
    assert reach.outside(asked).tolist() == [True, *[False] * 5, True]
    assert reach.between(np.array([0.985e5, 1.015e5, 1.03e5, 1.485e5])).tolist() == [
        False,
        False,
        True,
        False,
    ]
    assert reach.at(np.array([1.25e5])) == pytest.approx([0.225])
    assert reach.beyond(np.array(1.25e5), np.array([0.22, 0.25])).tolist() == [False, True]


def test_pressures_between_free_contractions_are_not_extrapolated() -> None:
    """Blocked forces every 10 kPa make levels that no contraction was read at."""
    pressures = np.arange(0.0, 251e3, 10e3)
    blocked = BlockedForce(pressures, 2e-4 * pressures, np.zeros(26, dtype=bool))
    free = FreeContraction(np.arange(50e3, 251e3, 50e3), np.array([0.06, 0.14, 0.2, 0.24, 0.26]))
    made = build.specimen(
        None, None, levels_kPa=tuple(pressures / 1e3), blocked_force=blocked, free_contraction=free
    )
    reach = Reach.of(draw_blueprint(made))
    for P in (1e5, 1.2e5, 1.25e5, 1.5e5):
        assert not reach.beyond(np.array(P), np.array(0.05))
        assert reach.beyond(np.array(P), np.array(0.25))


def test_noise_of_a_reading_is_white_and_correlated() -> None:
    _, draws = known()
    values = draws.values | {"noise_sd_N": np.full((DRAWS, 1), 0.3)}
    assert noise_of(replace(draws, values=values)) == pytest.approx(0.3)
    values["noise_corr_sd_N"] = np.full((DRAWS, 1), 0.4)
    assert noise_of(replace(draws, values=values)) == pytest.approx(0.5)


def test_curves_end_at_the_first_contraction_past_the_mean_free_one() -> None:
    """However far a few of them go on: here a fifth without end."""
    model, draws = known()
    eta = draws.eta.copy()
    eta[: DRAWS // 5, model.linear_sizes[0]] = 1e4
    found = muscle_bands(model, replace(draws, eta=eta), LEVELS[2:], 0)
    free = found.loc[found["quantity"] == "free_contraction"].iloc[0]
    last = found.loc[found["quantity"] == "force_N", "contraction"].max()
    assert last - 0.005 < free["mean"] <= last < free["q95"]


def test_noise_that_grows_with_the_force_is_that_of_the_blocked_force_at_full_length() -> None:
    model, draws = known()
    assert model.setting is not None
    draws = replace(draws, values=draws.values | {"noise_growth": np.full((DRAWS, 1), 2.0)})
    found = muscle_bands(model, draws, LEVELS[2:], 3).set_index("quantity")
    seen, bare = (found.loc[f"blocked_force_N{suffix}"] for suffix in ("_observed", ""))
    expected = NOISE * np.sqrt(1.0 + (2.0 * bare["mean"] / model.setting.force_scale) ** 2)
    assert expected > 1.5 * NOISE
    assert (seen["q95"] - seen["q05"]) / 3.29 == pytest.approx(expected, rel=0.07)


def test_noise_that_grows_with_the_force_is_that_of_each_branch_s_own_force() -> None:
    """Loading and unloading differ by half of the force in between, which friction adds and takes."""
    model, draws = known()
    assert model.setting is not None
    more = {"noise_growth": 2.0, "K_f": 0.25}
    draws = replace(draws, values=draws.values | {k: np.full((DRAWS, 1), v) for k, v in more.items()})
    found = muscle_bands(model, draws, LEVELS[2:], 3)
    found = found[found["contraction"] < 0.1]
    wide = []
    for branch in ("loading", "mean", "unloading"):
        own = found[found["branch"] == branch]
        bare, seen = (own[own["quantity"] == f"force_N{s}"].reset_index() for s in ("", "_observed"))
        expected = NOISE * np.sqrt(1.0 + (2.0 * bare["mean"] / model.setting.force_scale) ** 2)
        width = (seen["q95"] - seen["q05"]) / 3.29
        assert (width / expected).mean() == pytest.approx(1.0, abs=0.03)
        wide.append(width.mean())
    assert wide[0] > 1.1 * wide[1] > 1.2 * wide[2]
