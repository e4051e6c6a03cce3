"""What a RUN of a small muscle holds: columns, grid, quantities, the truth inside the bands, the report."""

from __future__ import annotations

import json
import re
from pathlib import Path

import arviz as az
import numpy as np
import pandas as pd
import pytest

from mpam_calib.model.blueprint import Options, draw_blueprint
from mpam_calib.posterior.density.mode import evaluate
from mpam_calib.posterior.density.target import build_target, locate
from mpam_calib.specimen import read

from .command import Here
from .small import K_F, LEVELS, MODULI, NOISE_N, free_contraction, static_force

SUMMARY = "parameter,unit,mean,sd,q05,q50,q95,prior_sd,rhat,ess_bulk,ess_tail"
BANDS = "quantity,pressure_kPa,contraction,branch,mean,q05,q25,q50,q75,q95,extrapolated"
QUANTILES = ["q05", "q25", "q50", "q75", "q95"]


@pytest.fixture(scope="module")
def summary(muscle_run: Path) -> pd.DataFrame:
    return pd.read_csv(muscle_run / "summary.csv", index_col="parameter")


@pytest.fixture(scope="module")
def bands(muscle_run: Path) -> pd.DataFrame:
    return pd.read_csv(muscle_run / "bands.csv")


def test_the_columns_are_those_that_others_rely_on(muscle_run: Path) -> None:
    assert (muscle_run / "summary.csv").read_text().splitlines()[0] == SUMMARY
    assert (muscle_run / "bands.csv").read_text().splitlines()[0] == BANDS


def test_the_summary_finds_what_the_data_were_made_with(summary: pd.DataFrame) -> None:
    truth = {"K_f": K_F, "noise_sd_N": NOISE_N}
    for k, (a, b) in enumerate(MODULI, start=1):
        truth |= {f"a_{k}": a, f"b_{k}": b}
    assert set(truth) <= set(summary.index)
    for name, value in truth.items():
        row = summary.loc[name]
        assert abs(row["mean"] - value) < 4.0 * row["sd"], name
        assert row["sd"] < 0.5 * row["prior_sd"], name
    assert list(summary.loc[["a_1", "b_1", "noise_sd_N"], "unit"]) == ["Pa/kPa", "Pa", "N"]
    assert (summary["q05"] < summary["q50"]).all() and (summary["q50"] < summary["q95"]).all()
    assert (summary["rhat"] <= 1.01).all()
    assert (summary[["ess_bulk", "ess_tail"]] >= 100.0).all(axis=None)


def test_each_stored_log_posterior_is_that_of_its_draw(muscle: Path, muscle_run: Path) -> None:
    stored = az.from_netcdf(str(muscle_run / "posterior.nc"))
    log_prob = stored["sample_stats"]["lp"].to_numpy()
    assert log_prob.shape == stored["posterior"]["K_f"].shape
    specimen = read(muscle)
    blueprint = draw_blueprint(specimen, Options(correlated_noise=False))
    target, _ = locate(build_target(specimen, blueprint), np.random.default_rng([0, 0]))
    some = np.s_[:, ::97]
    u = stored["sampler_coordinates"]["coordinates"].to_numpy()[some]
    again = evaluate(target, u.reshape(-1, u.shape[-1])).reshape(u.shape[:2])
    np.testing.assert_allclose(log_prob[some], again, atol=1e-6)


def test_the_bands_hold_every_quantity_and_its_observed_twin(bands: pd.DataFrame) -> None:
    bare = ["force_N", "blocked_force_N", "free_contraction"]
    assert set(bands["quantity"]) == {*bare, *(f"{name}_observed" for name in bare)}
    force = bands[bands["quantity"].isin(["force_N", "force_N_observed"])]
    assert set(force["branch"]) == {"loading", "unloading", "mean"}
    rest = bands.drop(force.index)
    assert rest["branch"].isna().all()
    assert (rest.loc[rest["quantity"].str.startswith("blocked"), "contraction"] == 0.0).all()
    assert rest.loc[rest["quantity"].str.startswith("free"), "contraction"].isna().all()
    for name in bare:
        for suffix in ("", "_observed"):
            found = bands.loc[bands["quantity"] == name + suffix, "pressure_kPa"].unique()
            assert list(found) == list(LEVELS)
    assert bands["extrapolated"].dtype == bool


def test_the_grid_runs_from_0_in_steps_to_free_contraction(bands: pd.DataFrame) -> None:
    free = bands[bands["quantity"] == "free_contraction"].set_index("pressure_kPa")["mean"]
    curves = bands[bands["quantity"].isin(["force_N", "force_N_observed"])]
    for (_, level, _), curve in curves.groupby(["quantity", "pressure_kPa", "branch"]):
        grid = curve["contraction"].to_numpy()
        assert grid[0] == 0.0
        np.testing.assert_allclose(np.diff(grid), 0.005, atol=1e-9)
        assert free[level] <= grid[-1] < free[level] + 0.005


def test_the_bands_agree_with_the_truth_and_among_themselves(bands: pd.DataFrame) -> None:
    assert (np.diff(bands[QUANTILES], axis=1) >= 0.0).all()
    width = bands["q95"] - bands["q05"]
    force = bands[bands["quantity"] == "force_N"]
    mean = force[force["branch"] == "mean"]
    truth = static_force(mean["pressure_kPa"].to_numpy(), mean["contraction"].to_numpy())
    assert np.abs(mean["mean"] - truth).max() < NOISE_N
    keys = ["pressure_kPa", "contraction"]
    branches = force.pivot_table(index=keys, columns="branch", values="mean")
    pull = branches["mean"] > 1.0
    ratio = (branches["loading"] - branches["unloading"])[pull] / (2.0 * branches["mean"][pull])
    assert np.abs(ratio - K_F).max() < 0.02
    for level in LEVELS:
        at = bands[bands["pressure_kPa"] == level].set_index("quantity")
        assert abs(at.loc["free_contraction", "mean"] - free_contraction(level)) < 1e-3
        start = mean[(mean["pressure_kPa"] == level) & (mean["contraction"] == 0.0)].iloc[0]
        assert at.loc["blocked_force_N", "mean"] == pytest.approx(start["mean"], rel=1e-6)
    # Sensor noise comes on top: 1.645 sd each way.
    for name in ("force_N", "blocked_force_N"):
        bare, noisy = (width[bands["quantity"] == name + s].to_numpy() for s in ("", "_observed"))
        assert (noisy > 2.5 * NOISE_N).all() and (noisy > bare).all()
        assert bare.mean() < 0.7 * noisy.mean()


def test_the_state_says_how_it_was_drawn(muscle_run: Path) -> None:
    state = json.loads((muscle_run / "run.json").read_text())
    assert state["converged"] is True
    assert state["seed"] == 0
    assert state["sampling"]["ensembles"] >= 4
    assert {"emcee", "numpy", "mpam-calib"} <= set(state["versions"])


def test_the_posterior_opens_in_arviz_with_a_chain_for_each_ensemble(
    muscle_run: Path, summary: pd.DataFrame
) -> None:
    import arviz as az

    data = az.from_netcdf(str(muscle_run / "posterior.nc"))
    state = json.loads((muscle_run / "run.json").read_text())
    assert data.posterior.sizes["chain"] == state["sampling"]["ensembles"]
    assert set(data.posterior.data_vars) == set(summary.index)
    for name, row in summary.iterrows():
        draws = data.posterior[name].to_numpy()
        assert float(draws.mean()) == pytest.approx(row["mean"], rel=1e-6)
        assert np.isfinite(draws).all()
    table = az.summary(data, var_names=["K_f"])
    assert table["mean"].iloc[0] == pytest.approx(K_F, abs=0.002)
    assert "created_at" not in data.posterior.attrs


def test_the_report_is_one_self_contained_page(muscle_run: Path, bands: pd.DataFrame) -> None:
    page = (muscle_run / "report.html").read_text()
    assert "blocked force" in page.lower() and "free contraction" in page.lower()
    assert "Small muscle" in page
    assert "data:image" in page or "<svg" in page
    outside = re.findall(r"""(?:src|href)\s*=\s*["']([^"'#]+)""", page)
    assert [link for link in outside if not link.startswith("data:")] == []
    assert not re.search(r"@import|url\((?!['\"]?data:)", page)
    blocked = bands[(bands["quantity"] == "blocked_force_N") & (bands["pressure_kPa"] == max(LEVELS))]
    assert f"{blocked['mean'].iloc[0]:.3g}" in page


def test_predictions_at_any_pressures(run_copy: Path, bands: pd.DataFrame, here: Here) -> None:
    result = here("predict", run_copy, "--pressure", "50:250:50")
    assert result.code == 0
    assert result.complaint.startswith("warning: 50, 250 kPa lie beyond")
    path = run_copy / "predictions.csv"
    assert result.out.strip() == str(path)
    assert path.read_text().splitlines()[0] == BANDS
    table = pd.read_csv(path)
    assert list(table["quantity"].unique()) == list(bands["quantity"].unique())
    blocked = table[table["quantity"] == "blocked_force_N"].set_index("pressure_kPa")
    assert list(blocked.index) == [50.0, 100.0, 150.0, 200.0, 250.0]
    assert list(blocked["extrapolated"]) == [True, False, False, False, True]
    inside = table[(table["quantity"] == "force_N") & (table["pressure_kPa"] == 150.0)]
    assert not inside.loc[inside["contraction"] <= 0.95 * free_contraction(150.0), "extrapolated"].any()
    # What the run said of its own levels, said again; only new noise differs.
    own = bands[bands["quantity"] == "blocked_force_N"].set_index("pressure_kPa")
    np.testing.assert_allclose(blocked.loc[list(LEVELS), "mean"], own["mean"], rtol=1e-4)
    assert (blocked["q95"] - blocked["q05"])[250.0] > (blocked["q95"] - blocked["q05"])[150.0]


def test_without_pressures_the_levels_are_predicted_as_in_the_bands(run_copy: Path, here: Here) -> None:
    assert here("predict", run_copy).code == 0
    assert (run_copy / "predictions.csv").read_bytes() == (run_copy / "bands.csv").read_bytes()


def test_low_pressures_that_do_not_pull_have_no_free_contraction(run_copy: Path, here: Here) -> None:
    assert here("predict", run_copy, "--pressure", "0").code == 0
    table = pd.read_csv(run_copy / "predictions.csv").set_index("quantity")
    # Without pressure only the remainder is left of F(0): half of the draws do not pull at all.
    assert table.loc["free_contraction", "q05"] == 0.0
    assert (table.loc[["force_N"], "contraction"].max()) < 0.05


@pytest.mark.parametrize(
    "text",
    ["", "abc", "100:200", "100:200:0", "100:200:-5", "200:100:5", "-10:100:5", "nan", "0:inf:1", "1:2:3:4",
     "100000:200000:1000", "0:1000:0.0001"],
)  # fmt: skip
def test_pressures_that_make_no_sense_are_refused(text: str, run_copy: Path, here: Here) -> None:
    result = here("predict", run_copy, f"--pressure={text}")
    assert result.code == 2
    assert result.complaint.startswith("error: --pressure: found ")
    assert not (run_copy / "predictions.csv").exists()


@pytest.mark.parametrize("content", [None, "{", "{}", '{"blueprint": {}, "converged": true}'])
def test_a_folder_that_is_no_run_is_refused(content: str | None, tmp_path: Path, here: Here) -> None:
    if content is not None:
        (tmp_path / "run.json").write_text(content)
    result = here("predict", tmp_path)
    assert result.code == 2
    assert result.complaint.startswith(f"error: {tmp_path / 'run.json'}: found ")


def test_a_spoilt_posterior_is_refused(run_copy: Path, here: Here) -> None:
    path = run_copy / "posterior.nc"
    path.write_bytes(path.read_bytes()[:5000])
    result = here("predict", run_copy)
    assert result.code == 2
    assert result.complaint.startswith(f"error: {path}: found ")
