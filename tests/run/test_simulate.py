"""``simulate --hide``: what may be hidden, and that a refusal writes nothing."""

from __future__ import annotations

import errno
import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mpam_calib.posterior.material import material_of
from mpam_calib.prediction.simulate import simulate
from mpam_calib.run.synthetic import demand_synthetic_folder
from mpam_calib.specimen import read

from .command import Here, contents, stamps
from .small import ALPHA0, L0, MODULI, R0, SIMULATION, Specimen, free_contraction, loops_text, static_force

UNITS = {"dead_band": "kPa", "braid_angle": "°", "length_offset": "mm"}


@pytest.mark.parametrize(
    "hide",
    ["dead_band=nan", "dead_band=inf", "dead_band=-1e9", "braid_angle=60", "length_offset=1e4"],
)
def test_sizes_that_no_rig_has_are_refused(hide: str, muscle: Path, tmp_path: Path, here: Here) -> None:
    result = here("simulate", muscle, "-o", tmp_path / "made", "--hide", hide)
    assert result.code == 2
    assert result.complaint.startswith(f"error: --hide: found {hide.partition('=')[0]}=")
    assert "expected between " in result.complaint
    assert result.complaint.endswith(f" {UNITS[hide.partition('=')[0]]}")
    assert not (tmp_path / "made").exists()


def test_a_size_that_a_rig_may_have_is_hidden_and_told(muscle: Path, tmp_path: Path, here: Here) -> None:
    assert here("simulate", muscle, "-o", tmp_path / "made", "--hide", "dead_band=7.5").code == 0
    truth = json.loads((tmp_path / "made" / "truth.json").read_text())
    assert truth["hidden"]["dead_band"] == {"P_DB_kPa": 7.5}


@pytest.mark.parametrize("name", ["tensile.csv", "truth.json"])
def test_files_that_no_simulation_wrote_are_left_alone(
    muscle: Path, tmp_path: Path, here: Here, name: str
) -> None:
    made = tmp_path / "made"
    made.mkdir()
    (made / name).write_text("mine")
    assert f"{name}: found a file that no simulation wrote" in here("simulate", muscle, "-o", made).complaint
    assert contents(made) == {name: b"mine"}
    for ours in ("specimen.toml", "truth.json"):
        (made / ours).touch()
    demand_synthetic_folder(made)


def test_the_truth_holds_all_that_was_put_in_under_the_summary_s_names(muscle: Path) -> None:
    """The force of its moduli and friction is the one at the rows, but for noise."""
    specimen = read(muscle)
    made = simulate(specimen, {"dead_band": 7.5})
    names = {"a_1", "a_2", "b_1", "b_2", "K_f", "noise_sd_N", "P_DB_kPa"}
    assert names <= set(made.parameters)
    assert not [name for name in made.parameters if "remainder" in name]
    loops, put = made.specimen.loops, made.parameters
    assert loops is not None
    moduli = tuple((put[f"a_{k}"], put[f"b_{k}"]) for k in (1, 2))
    pressure, contraction = loops.pressure_Pa / 1e3, loops.displacement_m / 0.05
    # The law is one in the gauge's pressure; only the gas has 7.5 kPa less.
    free = static_force(pressure, contraction, moduli)
    none = ((0.0, 0.0), (0.0, 0.0))
    free -= static_force(pressure, contraction, none) - static_force(pressure - 7.5, contraction, none)
    force = free + put["K_f"] * np.abs(free) * loops.branch
    noise = np.hypot(put["noise_sd_N"], put["noise_corr_sd_N"])
    assert np.std(loops.force_N - force) == pytest.approx(noise, rel=0.15)


def test_rates_of_a_law_are_told_as_the_summary_tells_them(tmp_path: Path) -> None:
    simulation = SIMULATION.replace('"linear"', '"exponential"')
    specimen = read(Specimen(simulation=simulation).write(tmp_path / "own", loops=loops_text(rows=40)))
    put = simulate(specimen).parameters
    assert {"c_1", "c_2", "w_1", "w_2", "d", "z"} <= set(put) and "gap" not in put
    assert put["d"] > put["z"] and abs(put["z"]) < 1.0
    factor = np.exp(put["d"] * 150.0), np.exp(put["z"] * 150.0)
    stiff = put["c_1"] * factor[0] + put["w_1"] * factor[1]
    assert stiff == pytest.approx(MODULI[0][0] * 150.0 + MODULI[0][1], rel=0.3)


def test_declared_moduli_are_put_in_as_declared(tmp_path: Path) -> None:
    tensile = 'moduli = "tensile"\nE_Pa = [4.0e4, 2.6e4]\nE_rel_sd = 0.1\n'
    simulation = "[simulation]\n" + tensile + 'friction = "coulomb"\n'
    specimen = read(Specimen(simulation=simulation).write(tmp_path / "own"), data_required=False)
    put = simulate(specimen).parameters
    assert (put["E_1"], put["E_2"]) == pytest.approx((4.0e4, 2.6e4))
    assert put["K_f"] == pytest.approx(0.0787)


def test_without_data_the_test_is_the_thesis_s(tmp_path: Path) -> None:
    """From free contraction to L0 and back at each of five levels, 50 mm/min, a hundred readings a second.

    The noise is the seed's own.
    """
    simulation = '[simulation]\nmoduli = "tensile"\nE_Pa = [4.0e4, 2.6e4]\nfriction = "coulomb"\n'
    specimen = read(Specimen(simulation=simulation).write(tmp_path / "own"), data_required=False)
    loops, again, other = (simulate(specimen, seed=seed).specimen.loops for seed in (0, 0, 1))
    assert loops is not None and again is not None and other is not None
    assert np.diff(loops.time_s) == pytest.approx(0.01)
    step = np.diff(loops.displacement_m)[np.diff(loops.stroke) == 0]
    assert np.abs(step) == pytest.approx(50e-3 / 60.0 / 100.0, rel=2e-3)
    first, rows = loops.strokes
    assert loops.branch[first].tolist() == 5 * [1, -1]
    assert loops.pressure_Pa[first] == pytest.approx(np.repeat([50e3, 100e3, 150e3, 200e3, 250e3], 2))
    assert loops.displacement_m[first + rows - 1][::2] == pytest.approx(np.zeros(5))
    ends = [free_contraction(kPa, ((0.0, 4.0e4), (0.0, 2.6e4))) for kPa in (50.0, 100.0, 150.0, 200.0, 250.0)]
    assert loops.displacement_m[first][::2] / (1e-3 * L0) == pytest.approx(ends, abs=2e-3)
    assert np.array_equal(loops.force_N, again.force_N)
    assert (loops.force_N - other.force_N).std() == pytest.approx(np.sqrt(2.0) * 0.25, rel=0.05)


def test_without_data_a_size_refers_to_the_test_that_is_made(tmp_path: Path) -> None:
    """A zero that wanders out until half the test and back by its end: 0.6 N/min × half the test, there."""
    simulation = '[simulation]\nmoduli = "tensile"\nE_Pa = [4.0e4, 2.6e4]\nfriction = "coulomb"\n'
    specimen = read(Specimen(simulation=simulation).write(tmp_path / "own"), data_required=False)
    plain, wandering = (simulate(specimen, h).specimen.loops for h in ({}, {"force_drift:return": 0.6}))
    assert plain is not None and wandering is not None
    half = plain.time_s.max() / 2.0
    out = (0.6 / 60.0) * half * np.sin(np.pi * plain.time_s / (2.0 * half))
    assert wandering.force_N - plain.force_N == pytest.approx(out, abs=0.01 * out.max())


def test_without_data_a_size_refers_to_the_strokes_that_the_hidden_effect_leaves(tmp_path: Path) -> None:
    """Conical ends: every contraction is longer by as much as rounded ones take at half of the stroke."""
    simulation = '[simulation]\nmoduli = "tensile"\nE_Pa = [4.0e4, 2.6e4]\nfriction = "coulomb"\n'
    specimen = read(Specimen(simulation=simulation).write(tmp_path / "own"), data_required=False)
    made = simulate(specimen, {"tip_shape:tapered": 1.0})
    loops, plain = made.specimen.loops, simulate(specimen).specimen.loops
    assert loops is not None and plain is not None
    half = loops.displacement_m.max() / 2.0
    assert half < 0.8 * plain.displacement_m.max() / 2.0
    turns_length = L0 / np.sin(np.radians(ALPHA0))
    radius = np.sqrt(turns_length**2 - (L0 - 1e3 * half) ** 2) / np.sqrt(turns_length**2 - L0**2) * R0
    taken = (np.pi - 2.0) * (radius - R0) / (1e3 * half)
    contraction = (1.0 + taken) * 1e3 * loops.displacement_m / L0
    free = static_force(loops.pressure_Pa / 1e3, contraction, ((0.0, 4.0e4), (0.0, 2.6e4)))
    missed = loops.force_N - free - 0.0787 * np.abs(free) * loops.branch
    assert np.sqrt(np.mean(missed**2)) == pytest.approx(0.25, rel=0.05)


def test_an_effect_may_be_hidden_in_another_form(muscle: Path, tmp_path: Path, here: Here) -> None:
    """Relaxation by a power of time: its size is the effect's, its power a typical one."""
    assert here("simulate", muscle, "-o", tmp_path / "made", "--hide", "creep:power=0.02").code == 0
    assert here("simulate", muscle, "-o", tmp_path / "plain", "--hide", "creep=0.02").code == 0
    truth = json.loads((tmp_path / "made" / "truth.json").read_text())
    hidden = truth["hidden"]["creep:power"]
    assert set(hidden) == {"creep_per_decade", "creep_exponent", "creep_before_s"}
    assert hidden["creep_per_decade"] == 0.02
    made, plain = (read(tmp_path / name).loops for name in ("made", "plain"))
    assert made is not None and plain is not None
    assert np.abs(made.force_N - plain.force_N).max() > 0.0
    assert here("check", tmp_path / "made").code == 0


@pytest.mark.parametrize(
    ("hide", "complaint"),
    [
        ("creep:none", 'found "creep:none", expected one of creep:wall, creep:early, creep:power,'),
        ("creep:bent", 'found "creep:bent", expected one of creep:wall,'),
        ("creep:", 'found "creep:", expected one of creep:wall,'),
    ],
)
def test_a_form_that_has_no_equation_is_refused(
    hide: str, complaint: str, muscle: Path, tmp_path: Path, here: Here
) -> None:
    result = here("simulate", muscle, "-o", tmp_path / "made", "--hide", hide)
    assert result.code == 2
    assert result.complaint.startswith(f"error: --hide: {complaint}")
    assert not (tmp_path / "made").exists()


def test_several_effects_may_follow_one_hide(muscle: Path, tmp_path: Path, here: Here) -> None:
    for folder, hide in (
        ("one", ["--hide", "dead_band=7.5", "creep=0.01"]),
        ("each", ["--hide", "dead_band=7.5", "--hide", "creep=0.01"]),
    ):
        assert here("simulate", muscle, "-o", tmp_path / folder, *hide).code == 0
    one, each = (json.loads((tmp_path / name / "truth.json").read_text()) for name in ("one", "each"))
    assert one == each
    assert set(one["hidden"]) == {"dead_band", "creep"}
    result = here("simulate", muscle, "creep", "-o", tmp_path / "none")
    assert (result.code, result.complaint) == (2, 'error: simulate: found "creep", expected one specimen')
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize("effect", ["braid_kinematics", "coulomb_friction", "dead_band"])
def test_what_the_simulation_has_already_cannot_be_hidden(effect: str, tmp_path: Path, here: Here) -> None:
    specimen = Specimen(simulation=SIMULATION + 'effects = ["dead_band"]\n')
    folder = specimen.write(tmp_path / "own", loops=loops_text(rows=30))
    result = here("simulate", folder, "-o", tmp_path / "made", "--hide", effect)
    assert result.code == 2
    assert result.complaint.startswith(f'error: --hide: found "{effect}"')
    assert "expected an effect that the simulation does not " in result.complaint
    assert not (tmp_path / "made").exists()


@pytest.mark.parametrize("effect", ["presliding", "rate_friction"])
def test_no_friction_cannot_be_changed(effect: str, tmp_path: Path, here: Here) -> None:
    specimen = Specimen(simulation=SIMULATION.replace('friction = "coulomb"', 'friction = "none"'))
    folder = specimen.write(tmp_path / "own", loops=loops_text(rows=30))
    result = here("simulate", folder, "-o", tmp_path / "made", "--hide", effect)
    assert result.code == 2
    assert result.complaint.startswith(f"error: --hide: found {effect} without friction, expected ")
    with_friction = ("--hide", effect, "--hide", "coulomb_friction")
    assert here("simulate", folder, "-o", tmp_path / "made", *with_friction).code == 0


def test_an_effect_is_hidden_once(muscle: Path, tmp_path: Path, here: Here) -> None:
    twice = ("--hide", "dead_band=7.5", "--hide", "dead_band:soft")
    result = here("simulate", muscle, "-o", tmp_path / "made", *twice)
    assert result.code == 2
    assert result.complaint == "error: --hide: found dead_band twice, expected each effect once"
    assert not (tmp_path / "made").exists()


def test_recordings_without_rows_of_their_own_are_not_simulated(tmp_path: Path, here: Here) -> None:
    rows = "".join(f"{P},{0.35 * P - 5}\n" for P in range(60, 220, 20))
    blocked = f"pressure_kPa,force_N\n{rows}"
    only = Specimen().write(tmp_path / "only", blocked_force=blocked)
    result = here("simulate", only, "-o", tmp_path / "made")
    assert result.code == 2
    assert "found neither loops nor a force map" in result.complaint
    assert not (tmp_path / "made").exists()
    beside = Specimen().write(tmp_path / "beside", loops=loops_text(rows=60), blocked_force=blocked)
    assert "not simulated: blocked_force.csv" in here("simulate", beside, "-o", tmp_path / "made").out


def test_a_full_disk_is_one_line(
    muscle: Path, tmp_path: Path, here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*arguments: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("mpam_calib.run.synthetic.write_csv", full)
    result = here("simulate", muscle, "-o", tmp_path / "made")
    assert result.code == 2
    assert result.complaint.startswith("error: output: found No space left on device, expected ")


def test_only_another_synthetic_specimen_is_replaced(
    muscle: Path, run_copy: Path, tmp_path: Path, here: Here
) -> None:
    real = Path(shutil.copytree(muscle, tmp_path / "real"))
    for folder, owner in ((real, "a specimen's folder"), (run_copy, "a calibration's folder")):
        before = stamps(folder)
        result = here("simulate", muscle, "-o", folder)
        assert result.code == 2
        assert result.complaint.startswith(f"error: {folder}: found {owner}, expected ")
        assert stamps(folder) == before
    made = tmp_path / "made"
    assert here("simulate", muscle, "-o", made).code == 0
    first = contents(made)
    assert here("simulate", muscle, "-o", made, "--seed", 1).code == 0
    assert contents(made).keys() == first.keys() and contents(made) != first


def test_a_synthetic_specimen_finds_the_run_of_its_moduli(
    material_run: Path, tmp_path: Path, here: Here
) -> None:
    shutil.copytree(material_run, tmp_path / "material_run")
    simulation = SIMULATION.replace('"loops"', '"run:../material_run"').replace("linear", "constant")
    folder = Specimen(simulation=simulation).write(tmp_path / "muscle", loops=loops_text(rows=60))
    made = tmp_path / "deep" / "made"
    assert here("simulate", folder, "-o", made).code == 0
    assert material_of(read(made)) == material_of(read(folder))


def test_a_declaration_may_have_its_tables_in_braces(muscle: Path, tmp_path: Path, here: Here) -> None:
    folder = Path(shutil.copytree(muscle, tmp_path / "braces"))
    (folder / "specimen.toml").write_text(
        'specimen = { name = "Small muscle" }\n'
        "geometry = { L0_mm = 50.0, R0_mm = 3.0, t0_mm = 0.7, alpha0_deg = 72.0 }\n"
        'files = { loops = "loops.csv" }\n'
        'simulation = { friction = "coulomb", order = 2, law = "linear" }\n'
    )
    assert here("simulate", folder, "-o", tmp_path / "made").code == 0
    made, own = read(tmp_path / "made"), read(folder)
    assert made.name == "Small muscle (synthetic)"
    assert (made.geometry, made.simulation) == (own.geometry, own.simulation)


def test_each_synthetic_row_is_one_reading(muscle: Path) -> None:
    """Though the rows that it stands at were averages of a very large file."""
    specimen = read(muscle)
    assert specimen.loops is not None
    made = simulate(replace(specimen, loops=replace(specimen.loops, averaged=9))).specimen
    assert made.loops is not None and made.loops.averaged == 1
