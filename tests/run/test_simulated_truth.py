"""What ``simulate`` puts in is the declared simulation, as it fits the data, and what is hidden: no more."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from mpam_calib.prediction.simulate import Simulated, _noise, simulate
from mpam_calib.run.synthetic import write_specimen
from mpam_calib.specimen import read

from .command import Here
from .small import GEOMETRY, SIMULATION, Moduli, Specimen, loops_text, map_text, static_force

Array = NDArray[np.float64]
NOTHING: Moduli = ((0.0, 0.0), (0.0, 0.0))
DECLARED_71 = GEOMETRY.replace("72.0", "71.0")
UNCERTAIN = "[geometry.sd]\nalpha0_deg = 2.0\n[sensors]\npressure_bias_sd_kPa = 20.0\n"


def read_too_much(loops: str) -> str:
    """Loops (CSV text) as a gauge reads them that is 15 kPa too high."""
    header, *rows = loops.splitlines()
    cells = [row.split(",") for row in rows]
    return "\n".join([header, *(f"{t},{float(P) + 15.0:.6g},{x},{F}" for t, P, x, F in cells)]) + "\n"


def as_put_in(made: Simulated, dead_band_kPa: float) -> Array:
    """Force (n,), N, of what ``truth.json`` says, by the contract's equations, with a braid of 72°."""
    loops, put = made.specimen.loops, made.parameters
    assert loops is not None
    moduli = tuple((put[f"a_{k}"], put[f"b_{k}"]) for k in (1, 2))
    pressure, contraction = loops.pressure_Pa / 1e3, loops.displacement_m / 0.05
    # The moduli's law is one in the gauge's pressure.
    bladder = static_force(pressure, contraction, moduli) - static_force(pressure, contraction, NOTHING)
    free = bladder + static_force(pressure - dead_band_kPa, contraction, NOTHING)
    return free + put["K_f"] * np.abs(free) * loops.branch


@pytest.mark.parametrize(
    ("geometry", "hide", "dead_band_kPa"),
    [
        (GEOMETRY, {}, 0.0),
        (GEOMETRY, {"dead_band": 12.0}, 12.0),
        (DECLARED_71, {"braid_angle": 1.0}, 0.0),
        (DECLARED_71, {"braid_angle": 1.0, "dead_band": 12.0}, 12.0),
    ],
)
def test_what_is_uncertain_stays_as_declared(
    geometry: str, hide: dict[str, float | None], dead_band_kPa: float, tmp_path: Path
) -> None:
    """The data are of a braid at 72° whose gauge reads 15 kPa too much: the fit would move both."""
    text = read_too_much(loops_text())
    made = simulate(read(Specimen(geometry=geometry + UNCERTAIN).write(tmp_path / "own", loops=text)), hide)
    assert not {"alpha0_deg", "pressure_bias_kPa"} & set(made.parameters)
    assert made.specimen.loops is not None
    missed = made.specimen.loops.force_N - as_put_in(made, dead_band_kPa)
    noise = np.hypot(made.parameters["noise_sd_N"], made.parameters["noise_corr_sd_N"])
    assert np.sqrt(np.mean(missed**2)) == pytest.approx(noise, rel=0.15)


KNOWN_E_PA = 8.5e4


def test_an_offset_that_was_declared_possible_does_not_end_in_the_declared_moduli(tmp_path: Path) -> None:
    """A gauge that reads 15 kPa too much, declared to 22.5 kPa; moduli that are right, declared to 10 %."""
    text = read_too_much(loops_text(rows=40, moduli=((0.0, KNOWN_E_PA),)))
    tensile = f'moduli = "tensile"\nE_Pa = [{KNOWN_E_PA}]\nE_rel_sd = 0.1\n'
    simulation = f'[simulation]\n{tensile}friction = "coulomb"\n'
    sensors = "[sensors]\npressure_bias_sd_kPa = 22.5\n"
    made = simulate(read(Specimen(simulation=simulation, tables=sensors).write(tmp_path / "own", loops=text)))
    put = made.parameters
    assert abs(put["E_1"] / KNOWN_E_PA - 1.0) < 0.05
    assert "pressure_bias_kPa" not in put
    # The gauge of the synthetic rig has the declared offset of zero: its readings are the pressures.
    loops = made.specimen.loops
    assert loops is not None
    pressure, contraction = loops.pressure_Pa / 1e3, loops.displacement_m / 0.05
    free = static_force(pressure, contraction, ((0.0, put["E_1"]),))
    missed = loops.force_N - free - put["K_f"] * np.abs(free) * loops.branch
    assert np.std(missed) == pytest.approx(np.hypot(put["noise_sd_N"], put["noise_corr_sd_N"]), rel=0.15)
    assert abs(np.mean(missed)) < 0.05


def test_the_mode_is_that_of_the_declared_simulation_and_the_noise_that_of_the_sensor(tmp_path: Path) -> None:
    """One modulus for all pressures cannot follow the muscle: it comes as near as least squares do."""
    simulation = SIMULATION.replace("order = 2", "order = 1").replace("linear", "constant")
    specimen = read(Specimen(simulation=simulation).write(tmp_path / "own", loops=loops_text()))
    made = simulate(specimen)
    assert specimen.loops is not None and made.specimen.loops is not None
    loops = specimen.loops
    pressure, contraction = loops.pressure_Pa / 1e3, loops.displacement_m / 0.05
    gas = static_force(pressure, contraction, NOTHING)
    per_Pa = static_force(pressure, contraction, ((0.0, 1.0),)) - gas
    left = []
    for K_f in np.linspace(0.0, 0.2, 401):
        factor = 1.0 + K_f * loops.branch
        E = np.sum(factor**2 * per_Pa * (loops.force_N / factor - gas)) / np.sum((factor * per_Pa) ** 2)
        left.append(np.mean((loops.force_N - factor * (gas + E * per_Pa)) ** 2))
    least = np.sqrt(min(left))
    assert least > 0.5  # ten times the noise: the simulation is wrong
    missed = np.sqrt(np.mean((made.specimen.loops.force_N - loops.force_N) ** 2))
    assert missed < 1.15 * least
    assert np.hypot(made.parameters["noise_sd_N"], made.parameters["noise_corr_sd_N"]) < 0.15


ONE_LEVEL = SIMULATION.replace("linear", "constant")


@pytest.mark.parametrize("effect", ["force_drift", "creep", "stress_softening", "coulomb_friction"])
def test_a_static_map_without_branches_shows_no_history_and_no_friction(
    effect: str, tmp_path: Path, here: Here
) -> None:
    simulation = SIMULATION.replace('friction = "coulomb"', 'friction = "none"')
    folder = Specimen(simulation=simulation).write(tmp_path / "own", force_map=map_text())
    for others in ((), ("dead_band=7.5",)):
        result = here("simulate", folder, "-o", tmp_path / "made", "--hide", effect, *others)
        assert result.code == 0
        assert result.complaint == f"warning: {effect} changes no force that this recording could show"
        truth = json.loads((tmp_path / "made" / "truth.json").read_text())
        assert truth["not_shown"] == [effect] and len(truth["hidden"]) == 1 + len(others)
    shown = here("simulate", folder, "-o", tmp_path / "made", "--hide", "dead_band=7.5")
    assert shown.code == 0 and shown.err == ""
    assert "not_shown" not in json.loads((tmp_path / "made" / "truth.json").read_text())


@pytest.mark.parametrize("effect", ["rate_friction", "law_shape"])
def test_one_level_at_one_speed_shows_neither_speeds_nor_laws(effect: str, tmp_path: Path) -> None:
    specimen = read(Specimen(simulation=ONE_LEVEL).write(tmp_path / "own", loops=loops_text(levels=(150.0,))))
    assert simulate(specimen, {effect: None}).not_shown == (effect,)


def test_speeds_that_a_clock_of_centiseconds_tells_apart_are_one_speed(tmp_path: Path) -> None:
    """Strokes at 0.8 mm/s throughout: what is read of their speeds differs by the clock's rounding alone."""
    header, *rows = loops_text(rows=100).splitlines()
    cells = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    way = np.cumsum(np.abs(np.diff(cells[:, 2], prepend=cells[0, 2])))
    turns = np.diff(cells[:, 2], prepend=-1.0) == 0.0
    cells[:, 0] = np.round(way / 0.8 + 0.05 * np.cumsum(turns), 2)
    text = "\n".join([header, *(",".join(f"{cell:.8g}" for cell in row) for row in cells)]) + "\n"
    specimen = read(Specimen().write(tmp_path / "own", loops=text))
    assert simulate(specimen, {"rate_friction": 0.1}).not_shown == ("rate_friction",)


def test_what_the_rows_show_is_measured_by_the_noise(muscle: Path) -> None:
    """A likelihood that knows all but the effect gains half of Σ(change/noise)²: at 0.3² it says nothing."""
    specimen = read(muscle)
    assert specimen.loops is not None
    pressure, contraction = specimen.loops.pressure_Pa / 1e3, specimen.loops.displacement_m / 0.05
    per_kPa = static_force(pressure, contraction, NOTHING) - static_force(
        pressure - 1.0, contraction, NOTHING
    )
    put = simulate(specimen).parameters
    noise = np.hypot(put["noise_sd_N"], put["noise_corr_sd_N"])
    size = 0.3 * noise / np.linalg.norm(per_kPa * (1.0 + put["K_f"] * specimen.loops.branch))
    for seen in (1.05 * size, -1.05 * size):
        made = simulate(specimen, {"dead_band": seen})
        assert made.hidden["dead_band"]["P_DB_kPa"] == pytest.approx(seen) and made.not_shown == ()
    for unseen in (0.95 * size, -0.95 * size, 0.0):
        assert simulate(specimen, {"dead_band": unseen}).not_shown == ("dead_band",)


def test_what_lies_below_the_floor_is_not_shown(tmp_path: Path) -> None:
    """All that a floor above every force leaves is the floor."""
    specimen = read(Specimen().write(tmp_path / "own", loops=loops_text(rows=60)))
    high = replace(specimen, sensors=specimen.sensors.model_copy(update={"force_floor_N": 1e3}))
    assert simulate(high, {"dead_band": 5.0}).not_shown == ("dead_band",)


def test_noise_that_is_put_in_is_white_lasts_grows_and_has_tails_as_declared() -> None:
    force = np.repeat([0.0, 50.0], 40_000)

    def made(dt: float | None = 0.1, **values: float) -> Array:
        known = {name: np.full((1, 1), value) for name, value in values.items()}
        return _noise(force, dt, known, 25.0, np.random.default_rng(0))

    both = {"noise_sd_N": 0.3, "noise_corr_sd_N": 0.4, "noise_corr_time_s": 0.2}
    noise = made(**both)
    assert noise.std() == pytest.approx(0.5, rel=0.02)
    # Of the whole, what lasts is 0.16/0.25 and falls by e^(−dt/τ) with every reading.
    for lag in (1, 3):
        correlation = np.corrcoef(noise[lag:], noise[:-lag])[0, 1]
        assert correlation == pytest.approx(0.64 * np.exp(-0.5 * lag), abs=0.02)
    assert made(None, **both).std() == pytest.approx(0.3, rel=0.02)
    # At twice the force scale and a growth of one: √5 times the noise.
    grown = made(noise_sd_N=0.3, noise_growth=1.0)
    assert [part.std() for part in np.split(grown, 2)] == pytest.approx([0.3, 0.3 * np.sqrt(5.0)], rel=0.02)
    tailed = made(noise_sd_N=0.3, noise_dof=3.0)
    assert stats.kstest(tailed / 0.3, stats.t(3.0).cdf).pvalue > 1e-3


def test_every_recording_keeps_its_own_clock(tmp_path: Path) -> None:
    """Three files: the second's clock begins anew, and the third's goes on from it after half a minute."""
    header, *rows = loops_text(rows=60).splitlines()
    cells = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    parts = np.split(cells, 3)
    for part, start in zip(parts, (40.0, 0.0, 42.0), strict=True):
        part[:, 0] += start - part[0, 0]
    folder = Specimen().write(tmp_path / "own", loops="")
    toml = folder / "specimen.toml"
    toml.write_text(toml.read_text().replace('"loops.csv"', '["a.csv", "b.csv", "c.csv"]'))
    for name, part in zip("abc", parts, strict=True):
        lines = [",".join(f"{cell:.8g}" for cell in row) for row in part]
        (folder / f"{name}.csv").write_text("\n".join([header, *lines]) + "\n")
    own = read(folder)
    write_specimen(simulate(own, {"force_drift:tared": None}), toml, tmp_path / "made")
    made = read(tmp_path / "made")
    assert own.loops is not None and made.loops is not None
    assert len(np.unique(made.loops.began_s)) == 2 and made.loops.clock.max() == 2
    for name in ("time_s", "began_s", "clock", "stroke", "cycle", "level"):
        assert getattr(made.loops, name) == pytest.approx(getattr(own.loops, name), abs=1e-5)
    assert [file.name for file in made.files] == [f"loops_{i}_synthetic.csv" for i in (1, 2, 3)]
