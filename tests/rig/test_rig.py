"""The rig tested: known values, exact nulls, signatures, determinism, files, independence, the locked set."""

from __future__ import annotations

import ast
import csv
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from .calibration import hyperelastic_muscle, write_calibration_case
from .case import Case, Hidden, record, signatures, write_case
from .chain import force_of
from .effects import FORMS, IDS, forms_of, shared_form
from .margins import read_margins, row_of
from .muscle import Braid, Geometry, Law, Muscle, Simulation, free_contraction, static_force
from .oracle import Oracle, Whitener, held_out_rmse
from .outside import KINDS, Outside
from .protocol import Protocol, noise_sd, record_rows, sensor_noise
from .recipes import build_case, halved
from .sets import DEVELOP_HALF, LOCKED_HALF, digest, recipes

LOCKED_SHA256 = "0fcbaa62649a3523ecea102aacfdf5050c7c7f459b8087b63cd62cc5d50b397a"

MPAM1_E = {
    50.0: (4.6791e7, -1.0822e8, 7.8137e7, -1.66755e7),
    100.0: (9.2886e7, -2.1444e8, 1.5480e8, -3.3207e7),
    150.0: (1.4356e8, -3.3089e8, 2.3844e8, -5.1072e7),
    200.0: (1.7603e8, -4.0556e8, 2.9214e8, -6.2561e7),
    250.0: (2.1824e8, -5.0125e8, 3.5947e8, -7.6423e7),
}
MPAM1_N = {
    50.0: (16.02, 12.14, 8.35, 1.64),
    100.0: (34.98, 27.60, 20.66, 8.79),
    150.0: (54.80, 44.12, 33.87, 16.33),
    200.0: (73.25, 57.48, 44.05, 21.91),
    250.0: (94.32, 74.49, 57.90, 30.51),
}
MPAM1_FREE = {50.0: 0.2264, 100.0: 0.2873, 150.0: 0.3125, 200.0: 0.3230, 250.0: 0.3334}


def _published() -> Muscle:
    constants = tuple(tuple(MPAM1_E[p][k] for p in MPAM1_E) for k in range(4))
    law = Law("free", constants, levels_kPa=tuple(MPAM1_E))
    simulation = Simulation("constant_thickness", "stretch", "coulomb", (0.08,), source="loops", law=law)
    return Muscle("published", Geometry(50.0, 3.0, 0.7, 72.0), Braid(2.1, 0.33, 0.11, 48), simulation)


def _rubber(friction: str = "coulomb", kinematics: str = "inextensible_braid") -> Muscle:
    simulation = Simulation(
        kinematics,
        "engineering",
        friction,
        (0.3 if friction == "strand" else 0.06,),
        law=Law("constant", ((4e5,), (1e5,))),
        declared_E_Pa=(4e5, 1e5),
    )
    return Muscle("rubber", Geometry(80.0, 3.4, 0.6, 69.0), Braid(1.8, 0.33, 0.12, 48), simulation)


PROTOCOL = Protocol(
    (90.0, 160.0, 240.0), cycles=2, speeds_mm_s=(1.5, 8.0), rows_max=700, noise_N=0.2, correlated_N=0.1
)


def _muscle_for(effect: str) -> Muscle:
    return _rubber(
        "strand" if effect == "coulomb_friction" else "coulomb",
        "constant_thickness" if effect == "braid_kinematics" else "inextensible_braid",
    )


@pytest.mark.parametrize("pressure", list(MPAM1_N))
def test_published_curves(pressure: float) -> None:
    muscle = _published()
    found = static_force(muscle, pressure, np.array([0.0, 0.05, 0.10, 0.20]))
    assert found == pytest.approx(MPAM1_N[pressure], abs=0.01)
    assert free_contraction(muscle, pressure) == pytest.approx(MPAM1_FREE[pressure], abs=2e-4)


def test_blocked_force_of_inextensible_braid_by_hand() -> None:
    # At gamma = 0 both kinematics give R0, t0 and no strain: P pi [R^2 (2T-1) + 2Rt - t^2 - 2tRT].
    T = np.tan(np.radians(69.0)) ** 2
    by_hand = 0.2 * np.pi * (3.4**2 * (2 * T - 1) + 2 * 3.4 * 0.6 - 0.6**2 - 2 * 0.6 * 3.4 * T)
    for kinematics in ("inextensible_braid", "constant_thickness"):
        muscle = _rubber(kinematics=kinematics)
        assert static_force(muscle, 200.0, 0.0)[0] == pytest.approx(by_hand, rel=1e-12)


def test_gaylord_force_is_work_of_the_volume() -> None:
    # Without wall the force must be -P dV/dL of the cylinder inside inextensible strands.
    muscle = _rubber().with_simulation(law=Law("constant", ((0.0,),)))
    muscle = replace(muscle, geometry=Geometry(80.0, 3.4, 1e-9, 69.0))

    def volume(length: float) -> float:
        strand = 80.0 / np.sin(np.radians(69.0))
        turns = strand * np.cos(np.radians(69.0)) / 3.4
        return float(np.pi * (strand**2 - length**2) / turns**2 * length)

    length = 80.0 * 0.9
    slope = (volume(length + 1e-3) - volume(length - 1e-3)) / 2e-3
    assert static_force(muscle, 150.0, 0.1)[0] == pytest.approx(-0.15 * slope, rel=1e-5)


def test_laws_agree_where_they_must() -> None:
    p = np.array([50.0, 200.0])
    assert Law("linear", ((2.0, 3.0),)).moduli(p, p)[0] == pytest.approx([103.0, 403.0])
    one = Law("exponential", ((2.0, 1.0),), rates=(0.01, -0.02)).moduli(p, p)
    each = Law("exponential_each", ((2.0, 0.01, 1.0, -0.02),)).moduli(p, p)
    assert one == pytest.approx(each)
    assert one[0, 0] == pytest.approx(2 * np.exp(0.5) + np.exp(-1.0))


def test_every_effect_has_a_shared_and_another_form() -> None:
    assert len(IDS) == 18
    for effect in IDS:
        assert sum(f.shared for f in forms_of(effect)) == 1
        assert len(forms_of(effect)) >= 3


@pytest.mark.parametrize(("effect", "name"), list(FORMS))
def test_form_is_null_at_zero_and_not_at_one(effect: str, name: str) -> None:
    muscle, one = _muscle_for(effect), FORMS[effect, name]
    rows = record_rows(PROTOCOL, muscle, 3)
    null = force_of(muscle, rows)
    assert np.array_equal(force_of(muscle, rows, [(one, 0.0)]), null)
    changed = force_of(muscle, rows, [(one, one.unit(muscle, rows))])
    rms = float(np.sqrt(np.mean((changed - null) ** 2)))
    assert np.isfinite(changed).all()
    assert 0.0008 * null.max() < rms < 0.5 * null.max()
    other = force_of(muscle, rows, [(shared_form(effect), one.unit(muscle, rows))])
    if not one.shared:  # another form is another curve, not the textbook one under a new name
        assert float(np.sqrt(np.mean((changed - other) ** 2))) > 0.01 * rms


def test_compliance_feeds_on_the_true_force() -> None:
    muscle = _rubber()
    rows = record_rows(PROTOCOL, muscle, 3)
    give = 0.01
    force = force_of(muscle, rows, [(shared_form("rig_compliance"), give)])
    shifted = replace(rows, displacement=rows.displacement + give * force)
    assert force_of(muscle, shifted) == pytest.approx(force, abs=1e-6)


def test_tip_shortens_the_working_length() -> None:
    muscle = _rubber("none")
    rows = record_rows(PROTOCOL, muscle, 3)
    force = force_of(muscle, rows, [(shared_form("tip_shape"), 1.0)])
    g, length = muscle.geometry, 80.0 - rows.displacement
    sine = length * np.sin(np.radians(g.alpha0_deg)) / g.L0_mm
    radius = g.R0_mm * np.sqrt(1 - sine**2) / np.cos(np.radians(g.alpha0_deg))
    working = length - 2 * (np.pi / 2 - 1) * (radius - g.R0_mm)
    for level in PROTOCOL.levels_kPa:
        here = rows.setpoint == level
        by_hand = static_force(muscle, rows.pressure[here], 1 - working[here] / g.L0_mm)
        assert force[here] == pytest.approx(by_hand, abs=1e-9)


def test_rows_follow_the_protocol() -> None:
    rows = record_rows(replace(PROTOCOL, motion="sine", dwell_s=1.0), _rubber(), 5)
    assert rows.count <= PROTOCOL.rows_max
    assert np.all(np.diff(rows.time) > 0)
    for level in range(3):
        here = rows.level == level
        assert rows.cycle[here].min() == 1
        assert rows.cycle[here].max() == 4
        assert set(np.unique(rows.direction[here])) == {-1.0, 1.0}
    full = record_rows(replace(PROTOCOL, rows_max=18_000, sampling_hz=100.0), _rubber(), 5)
    assert 9_000 < full.count <= 18_000


def test_noise_has_the_declared_sd_and_correlation() -> None:
    p = replace(PROTOCOL, rows_max=18_000, sampling_hz=100.0, correlated_N=0.3)
    rows = record_rows(p, _rubber(), 5)
    noise = sensor_noise(p, rows, 8)
    assert noise.std() == pytest.approx(noise_sd(p), rel=0.08)
    step = float(np.median(np.diff(rows.time)))
    one_apart = np.isclose(np.diff(rows.time), step)
    expected = 0.09 * np.exp(-step / p.correlation_s)
    assert np.mean((noise[1:] * noise[:-1])[one_apart]) == pytest.approx(expected, rel=0.25)
    white = Whitener(p, rows.time[:2000])(noise[:2000])
    assert white.std() == pytest.approx(1.0, abs=0.06)
    assert abs(np.mean(white[1:] * white[:-1])) < 0.07


@pytest.mark.parametrize("kind", KINDS)
def test_outside_structures_have_the_wanted_size(kind: str) -> None:
    clean = Case("x", 4, "outside", _rubber(), PROTOCOL)
    found = record(replace(clean, outside=Outside(kind, 0.8)))
    change = found.true_force - record(clean).true_force
    assert float(np.sqrt(np.mean(change**2))) == pytest.approx(0.8, rel=0.05)


def _example() -> Case:
    return Case(
        "example",
        12,
        "separable",
        _rubber(),
        PROTOCOL,
        (Hidden("creep", "stretched", 0.02), Hidden("dead_band", "sharp", 8.0)),
    )


def test_files_parse_back_and_are_the_same_bytes(tmp_path: Path) -> None:
    truth = write_case(_example(), tmp_path / "a", tmp_path / "truth.json")
    write_case(_example(), tmp_path / "b", tmp_path / "again.json")
    for name in ("specimen.toml", "loops.csv"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    assert (tmp_path / "truth.json").read_bytes() == (tmp_path / "again.json").read_bytes()
    declared = tomllib.loads((tmp_path / "a" / "specimen.toml").read_text())
    assert declared["geometry"] == {"L0_mm": 80.0, "R0_mm": 3.4, "t0_mm": 0.6, "alpha0_deg": 69.0}
    assert declared["simulation"]["E_Pa"] == [4e5, 1e5]
    assert declared["simulation"]["effects"] == []
    with (tmp_path / "a" / "loops.csv").open() as file:
        lines = list(csv.DictReader(file))
    recording = record(_example())
    assert [float(row["force_N"]) for row in lines] == pytest.approx(recording.force, abs=1e-6)
    assert {row["branch"] for row in lines} == {"loading", "unloading"}
    assert len(truth["true_force_N"]) == len(truth["null_force_N"]) == len(lines)
    assert truth["ids"] == ["creep", "dead_band"]


def test_truth_never_lies_beside_the_specimen(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="outside"):
        write_case(_example(), tmp_path / "a", tmp_path / "a" / "truth.json")


def test_free_moduli_take_up_a_static_effect() -> None:
    tensile = _example()
    rows = record_rows(PROTOCOL, tensile.muscle, 12)
    law = Law("linear", ((0.0, 4e5), (0.0, 1e5), (0.0, 1e4), (0.0, 1e3)))
    free = replace(tensile, muscle=tensile.muscle.with_simulation(source="loops", law=law))
    left_tensile, left_free = signatures(tensile, rows)[1][1], signatures(free, rows)[1][1]
    assert left_free < 0.35 * left_tensile


def test_calibration_case_lies_outside_the_model_class(tmp_path: Path) -> None:
    kinds = ("loops", "force_map", "blocked_force", "free_contraction", "tensile")
    truth = write_calibration_case(3, tmp_path / "fit", tmp_path / "held", kinds)
    for place in ("fit", "held"):
        declared = tomllib.loads((tmp_path / place / "specimen.toml").read_text())
        assert set(declared["files"]) == set(kinds)
        with (tmp_path / place / "force_map.csv").open() as file:
            levels = {float(row["pressure_kPa"]) for row in csv.DictReader(file)}
        curves = truth["levels"]
        assert levels == {p for p, c in curves.items() if c["held_out"] == (place == "held")}
    muscle = hyperelastic_muscle(3)
    assert 0.05 < muscle.free_contraction(muscle.top_kPa) < 0.35
    # Near zero strain the tube's modulus is 6 (C1 + C2) for Mooney-Rivlin and 6 C1 for Yeoh.
    modulus = muscle.uniaxial(np.array([1e-6]))[0] / 1e-6
    expected = 6e6 * (muscle.C1 + (muscle.C2 if muscle.wall == "mooney_rivlin" else 0.0))
    assert modulus == pytest.approx(expected, rel=1e-4)


def test_oracle_names_what_is_hidden_and_its_size() -> None:
    case = _example()
    verdict = Oracle(record(case)).judge()
    assert verdict.separable
    assert verdict.superset_margin > -3.0
    fit = verdict.fits[case.ids]
    assert fit.sizes["dead_band"] == pytest.approx(8.0, abs=0.5)
    assert fit.sizes["creep"] == pytest.approx(0.02, abs=0.002)
    null = replace(case, hidden=())
    assert Oracle(record(null)).judge().superset_margin > -3.0


def test_oracle_predicts_a_level_it_has_not_seen() -> None:
    recording = record(_example())
    held = recording.rows.level == 1
    with_causes = held_out_rmse(recording, recording.case.ids, held)
    assert with_causes < 1.3 * noise_sd(PROTOCOL)
    assert held_out_rmse(recording, (), held) > 2.0 * with_causes


def test_the_sets_share_nothing_but_textbook_forms() -> None:
    develop, locked = recipes("develop"), recipes("locked")
    assert not {r.seed for r in develop} & {r.seed for r in locked}
    assert not {r.family for r in develop} & {r.family for r in locked}
    assert not {r.outside for r in develop if r.outside} & {r.outside for r in locked if r.outside}
    for effect in IDS:
        ours, theirs = set(DEVELOP_HALF.other[effect]), set(LOCKED_HALF.other[effect])
        assert ours
        assert theirs
        assert not ours & theirs
        assert shared_form(effect).name not in ours | theirs
    used = [{(w.id, w.form) for r in s for w in r.effects} for s in (develop, locked)]
    assert all(FORMS[pair].shared for pair in used[0] & used[1])


def test_the_locked_set_is_locked() -> None:
    locked = recipes("locked")
    assert len(locked) >= 240
    assert len({r.name for r in locked}) == len({r.seed for r in locked}) == len(locked)
    assert {w.id for r in locked for w in r.effects} == set(IDS)
    assert digest("locked") == LOCKED_SHA256


def test_practice_has_curves_of_its_own() -> None:
    practice, locked = recipes("practice"), recipes("locked")
    assert not {r.seed for r in practice} & {r.seed for r in locked}
    used = [{(w.id, w.form) for r in s for w in r.effects} for s in (practice, locked, recipes("develop"))]
    assert all(FORMS[pair].shared for pair in used[0] & (used[1] | used[2]))
    assert sum(not FORMS[pair].shared for pair in used[0]) > 20


@pytest.mark.parametrize("name", ["develop", "practice", "locked"])
def test_kept_margins_belong_to_the_set(name: str) -> None:
    kept = read_margins(name)
    assert list(kept) == [r.name for r in recipes(name)]
    for recipe in (r for r in recipes(name) if r.group == "separable"):
        assert kept[recipe.name]["ids"] == " ".join(sorted(w.id for w in recipe.effects))
    sample = next(r for r in recipes(name) if len(r.effects) == 2 and r.rows_max == 1000)
    again, margin = float(row_of(sample)["margin"]), float(kept[sample.name]["margin"])
    assert again == pytest.approx(margin, abs=0.5, rel=0.02)


def test_a_built_case_is_sensible_and_its_half_is_half() -> None:
    for recipe in recipes("locked")[::37]:
        case = build_case(recipe)
        found = record(case)
        assert found.rows.count <= 3000
        assert np.isfinite(found.force).all()
        for whole, half in zip(case.hidden, halved(case).hidden, strict=True):
            assert half.size == (whole.size if whole.id == "braid_kinematics" else 0.5 * whole.size)


def test_nothing_here_imports_the_package() -> None:
    for path in Path(__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                names = [node.module or ""]
            assert not any(n.split(".")[0] == "mpam_calib" for n in names), path
