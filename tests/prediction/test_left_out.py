"""What is said of levels left out: quiet where the simulation is true, loud where its law is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from model import build
from rig.muscle import static_force

from mpam_calib.calibration import Calibration, calibrate
from mpam_calib.model.blueprint import Options
from mpam_calib.posterior.density.target import predict_force
from mpam_calib.posterior.draws import Draws
from mpam_calib.prediction import left_out
from mpam_calib.prediction.fitted import noise_of
from mpam_calib.prediction.left_out import (
    COLUMNS,
    levels_left_out,
    levels_looked_at,
)
from mpam_calib.specimen.declaration import Sensors
from mpam_calib.specimen.recording import ForceMap, Specimen

from .coverage import as_specimen, posterior_draws, rig_case

WITHOUT = Options(remainder=False)


def specimen_of(seed: int) -> Specimen:
    muscle, rows, _, reading, protocol = rig_case(seed)
    return as_specimen(muscle, rows, reading, protocol)


def told(calibration: Calibration):
    return levels_left_out(calibration.specimen, calibration.target, calibration.draws, calibration.seed)


@pytest.fixture(scope="module")
def sound() -> Calibration:
    return calibrate(specimen_of(0))


def test_levels_of_a_true_simulation_are_foreseen(sound):
    table = told(sound)
    assert list(table.columns) == COLUMNS
    assert table["extrapolated"].tolist() == [True, *[False] * 5, True]
    assert abs(table["inside90"].mean() - 0.90) < 0.05
    # The noise of the mean's own readings is in its sd: the misses are as large as foreseen, no larger.
    assert 0.3 < np.sqrt(np.mean((table["bias_N"] / table["bias_sd_N"]) ** 2)) < 2.0
    assert told(sound).equals(table)


def test_reweighting_and_refitting_say_the_same(sound):
    """The level that was least like the others, against a posterior drawn without it."""
    specimen = sound.specimen
    table = told(sound)
    for level in (0, 3):
        kept = [j for j in range(len(specimen.levels_Pa)) if j != level]
        model, draws = posterior_draws(build.take_levels(specimen, kept), specimen, Options(), 1, False)
        mask = specimen.loops.level == level
        places = build.rows_of(specimen.loops).take(mask)
        force = predict_force(model, draws.values, draws.eta, places)
        bias = float(np.mean(specimen.loops.force_N[mask] - force.mean(axis=0)))
        noise = noise_of(draws) / np.sqrt(table["readings"][level])
        spread = float(np.hypot(force.mean(axis=1).std(), noise))
        row = table.iloc[level]
        assert row["bias_N"] == pytest.approx(bias, abs=0.35 * spread)
        assert row["bias_sd_N"] == pytest.approx(spread, rel=0.3)


def test_a_law_that_is_wrong_in_pressure_is_told_though_every_level_fits():
    """Forces off by an eighth of a wave from level to level: the moduli follow each level, not the next."""
    specimen = specimen_of(1)
    loops = specimen.loops
    zigzag = 0.03 * loops.force_N.max() * (-1.0) ** loops.level
    wrong = replace(specimen, loops=replace(loops, force_N=loops.force_N + zigzag))
    table = told(calibrate(wrong, options=Options()))
    inner = table[~table["extrapolated"]]
    assert inner["inside90"].mean() < 0.5
    assert (np.sign(inner["bias_N"]) == (-1.0) ** np.arange(1, 6)).all()


@pytest.mark.long
def test_friction_of_a_level_s_own_is_foreseen_from_its_neighbours(sound):
    """As predictions there take it: neither unknown, nor what the readings left out have said of it."""
    simulation = sound.specimen.simulation.model_copy(update={"friction_by_pressure": True})
    table = told(calibrate(replace(sound.specimen, simulation=simulation)))
    inner, common = (t[~t["extrapolated"]] for t in (table, told(sound)))
    assert abs(inner["inside90"].mean() - 0.90) < 0.05
    assert inner["rmse_N"].to_numpy() == pytest.approx(common["rmse_N"].to_numpy(), rel=0.2)
    assert (inner["bias_sd_N"] < 2.0 * common["bias_sd_N"]).all()


@pytest.mark.long
def test_rows_that_are_means_have_the_noise_of_means(sound):
    specimen, many = sound.specimen, 25
    table = told(
        calibrate(
            replace(
                specimen,
                loops=replace(specimen.loops, averaged=many),
                sensors=Sensors(force_sd_N=many**0.5 * specimen.sensors.force_sd_N),
            )
        )
    )
    assert abs(table["inside90"].mean() - 0.90) < 0.05


@pytest.mark.long
def test_readings_that_noise_lifts_above_a_floor_are_foreseen_by_nobody(sound):
    """The same test, driven on until every level is slack: its table is that of the readings that pull."""
    loops = sound.specimen.loops
    floor = float(np.quantile(loops.force_N, 0.3))
    noise = 0.1 * np.random.default_rng(2).standard_normal(len(loops.force_N))
    force = np.where(loops.force_N < floor, floor + noise, loops.force_N)
    held = replace(loops, force_N=force, censored=force <= floor)
    clipped = replace(
        sound.specimen, loops=held, sensors=sound.specimen.sensors.model_copy(update={"force_floor_N": floor})
    )
    table = told(calibrate(clipped))
    pulls = told(sound)
    assert (table["rmse_N"] < 1.5 * pulls["rmse_N"].max()).all()
    assert abs(table["inside90"].mean() - 0.90) < 0.06


def test_of_a_map_every_level_is_left_out_and_of_loops_eight(sound):
    muscle = rig_case(0)[0]
    levels, places = np.linspace(0.4, 1.0, 10) * sound.specimen.levels_Pa[-1], np.linspace(0.0, 0.15, 5)
    pressure, contraction = (grid.ravel() for grid in np.meshgrid(levels, places, indexing="ij"))
    noise = 0.1 * np.random.default_rng(3).standard_normal(len(pressure))
    grid = ForceMap(
        pressure, contraction, static_force(muscle, pressure / 1e3, contraction) + noise,
        np.repeat(np.arange(10), 5), np.zeros(50, dtype=np.int64), np.zeros(50, dtype=bool),
    )  # fmt: skip
    still = sound.specimen.simulation.model_copy(update={"friction": "none"})
    specimen = replace(sound.specimen, loops=None, force_map=grid, levels_Pa=levels, simulation=still)
    table = told(calibrate(specimen))
    assert len(table) == 10
    assert table["extrapolated"].sum() == 2

    assert levels_looked_at(specimen).tolist() == list(range(10))
    looped = replace(sound.specimen, levels_Pa=levels)
    assert len(levels_looked_at(looped)) == 8 and levels_looked_at(looped)[[0, -1]].tolist() == [0, 9]


def test_moduli_of_a_level_s_own_are_foreseen_from_the_others(sound):
    """As predictions there take them; the muscle's follow the pressure in a straight line."""
    simulation = sound.specimen.simulation.model_copy(update={"law": "free"})
    table = told(calibrate(replace(sound.specimen, simulation=simulation)))
    inner, straight = (t[~t["extrapolated"]] for t in (table, told(sound)))
    assert len(table) == 7
    assert abs(inner["inside90"].mean() - 0.90) < 0.05
    assert inner["rmse_N"].to_numpy() == pytest.approx(straight["rmse_N"].to_numpy(), rel=0.2)
    assert (inner["bias_sd_N"] < 4.0 * straight["bias_sd_N"]).all()
    # Beyond the others the moduli may change by as much again.
    assert (table["bias_sd_N"][table["extrapolated"]] > 4.0 * inner["bias_sd_N"].max()).all()


def test_nothing_to_leave_out(sound):
    two = replace(sound.specimen, levels_Pa=sound.specimen.levels_Pa[:2])
    assert levels_left_out(two, sound.target, sound.draws, 0).empty


def test_draws_are_reweighted_by_what_the_level_added(sound, monkeypatch: pytest.MonkeyPatch):
    """A level whose log likelihood is −0.4 u has pulled standard normal draws down: they go back by 0.4."""
    u = np.random.default_rng(5).standard_normal((20_000, 1))
    draws = Draws(u, {}, np.zeros((len(u), 0)), 1)
    monkeypatch.setattr(left_out, "_likelihood", lambda target, some: 7.0 + 0.4 * some.u[:, 0])
    found = left_out._reweighted(sound.target, draws, np.full(len(u), 7.0), np.random.default_rng(0))
    assert found is not None and np.isin(found, u).all()
    assert found.mean() == pytest.approx(0.4, abs=0.03) and found.std() == pytest.approx(1.0, abs=0.03)
