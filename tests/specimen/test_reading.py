"""What a good folder becomes: SI arrays, levels, branches, cycles, digest."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mpam_calib.errors import InputError
from mpam_calib.specimen import Specimen, read
from mpam_calib.specimen.loops import one_after_the_other
from mpam_calib.specimen.recording import Loops

from .folders import DECLARATION, HEADER, Recording, loops, make


def loops_of(specimen: Specimen) -> Loops:
    assert specimen.loops is not None
    return specimen.loops


def test_si_units_and_names(tmp_path: Path) -> None:
    recording = loops()
    specimen = read(make(tmp_path, loops=recording.text()) / "specimen.toml")
    found = loops_of(specimen)
    assert specimen.name == "Test muscle"
    assert specimen.geometry is not None and specimen.geometry.L0 == 0.05
    assert found.pressure_Pa == pytest.approx(recording.pressure * 1e3)
    assert found.displacement_m == pytest.approx(recording.displacement * 1e-3, abs=1e-8)
    assert found.force_N == pytest.approx(recording.force, abs=1e-5)
    assert specimen.levels_Pa == pytest.approx([50e3, 100e3, 150e3])
    assert (found.branch == recording.branch).mean() > 0.97
    assert found.cycle.tolist() == recording.cycle.tolist()
    assert found.averaged == 1 and not found.censored.any()


@pytest.mark.parametrize("order", [(50.0, 100.0, 150.0), (150.0, 50.0, 100.0), (250.0, 225.0, 200.0, 20.0)])
def test_levels_from_noisy_wandering_pressure(tmp_path: Path, order: tuple[float, ...]) -> None:
    recording = loops(order, cycles=2, rate=50.0, pressure_sd=0.5, wander=0.02, encoder_sd=0.005, dwell=20)
    specimen = read(make(tmp_path, loops=recording.text()))
    found = loops_of(specimen)
    assert specimen.levels_Pa / 1e3 == pytest.approx(sorted(order), rel=0.01)
    nominal = np.sort(order)[found.level]
    assert (np.abs(found.pressure_Pa / 1e3 - nominal) < 0.03 * nominal + 2.5).all()
    for level in range(len(order)):
        assert set(found.cycle[found.level == level]) == {1, 2}
    assert found.stroke[-1] + 1 == 4 * len(order)


def test_pressure_changed_during_a_hold(tmp_path: Path) -> None:
    recording = loops((50.0, 150.0), cycles=1, rate=50.0, dwell=300, pressure_sd=0.2)
    pressure = recording.pressure.copy()
    half = len(pressure) - int(np.count_nonzero(recording.pressure > 100.0))
    pressure[half - 150 : half] = 150.0
    changed = Recording(
        recording.time, pressure, recording.displacement, recording.force, recording.branch, recording.cycle
    )
    specimen = read(make(tmp_path, loops=changed.text()))
    assert specimen.levels_Pa / 1e3 == pytest.approx([50.0, 150.0], abs=0.2)
    assert (loops_of(specimen).level == (pressure > 100.0)).all()


def test_rows_without_a_sure_branch_are_left_out(tmp_path: Path) -> None:
    """Holds under a coarse encoder: all other rows have their branch; a column branch leaves none unclear."""
    recording = loops((50.0, 150.0), cycles=2, rate=20.0, dwell=10, quantum=0.05)
    specimen = read(make(tmp_path / "without", loops=recording.text()))
    found = loops_of(specimen)
    assert found.unclear is not None
    assert 0 < found.unclear.sum() < 4 * 8
    assert (found.branch == recording.branch)[~found.unclear].all()
    (note,) = specimen.notes
    assert note.startswith(f"loops: {found.unclear.sum()} readings at turns and beside holds are left out")
    header, *lines = recording.text().splitlines()
    names = {1: "loading", -1: "unloading"}
    lines = [f"{line},{names[int(b)]}" for line, b in zip(lines, recording.branch, strict=True)]
    given = read(make(tmp_path / "with", loops="\n".join([f"{header},branch", *lines]) + "\n"))
    assert loops_of(given).unclear is None
    assert not given.notes


def test_setpoints_only_group(tmp_path: Path) -> None:
    recording = loops((50.0, 52.0), rate=20.0)
    header = "time_s,pressure_kPa,displacement_mm,force_N,setpoint_kPa"
    body = recording.text().splitlines()[1:]
    half = len(body) // 2
    text = "\n".join([header, *(f"{row},{60 if i < half else 40}" for i, row in enumerate(body))])
    specimen = read(make(tmp_path, loops=text))
    assert specimen.levels_Pa == pytest.approx([50e3, 52e3])
    assert loops_of(specimen).level[0] == 0  # by its reading, not by its setpoint


def test_time_goes_on_from_file_to_file() -> None:
    """A clock that begins anew follows the file before; one that goes on keeps its pauses."""
    first, again, goes_on = 70.0 + np.arange(4.0), 7.0 + 0.5 * np.arange(3), 50.0 + np.arange(2)
    time, began = one_after_the_other([first, again, goes_on])
    assert time.tolist() == [0.0, 1.0, 2.0, 3.0, 3.5, 4.0, 4.5, 46.5, 47.5]
    assert began.tolist() == [0.0] * 4 + [3.5] * 5
    assert one_after_the_other([first])[0].tolist() == np.arange(4.0).tolist()


def test_one_file_for_each_pressure_with_its_own_clock(tmp_path: Path) -> None:
    declaration = DECLARATION.replace('"loops.csv"', '["b.csv", "a.csv", "c.csv"]')
    a, b, c = loops((50.0,)), loops((100.0,)), loops((50.0,), start_t=3.0)
    specimen = read(make(tmp_path, declaration, a=a.text(), b=b.text(delimiter=";"), c=c.text()))
    found = loops_of(specimen)
    assert specimen.levels_Pa == pytest.approx([50e3, 100e3])
    assert np.unique(found.clock).tolist() == [0, 1, 2]
    assert found.level[found.clock == 0].tolist() == [1] * len(b.time)
    assert set(found.cycle[found.clock == 1]) == {1} and set(found.cycle[found.clock == 2]) == {2}
    assert [file.name for file in specimen.files] == ["b.csv", "a.csv", "c.csv"]
    assert np.all(np.diff(found.time_s) > 0.0)
    assert any("begins anew in 2 of 3 files" in note for note in specimen.notes)


def test_a_column_of_empty_branches_says_no_more_than_none(tmp_path: Path) -> None:
    header, *lines = loops((50.0, 150.0), cycles=2, rate=20.0).text().splitlines()
    bare = "\n".join([header, *lines]) + "\n"
    empty = "\n".join([f"{header},branch", *(f"{line}," for line in lines)]) + "\n"
    without, given = (
        loops_of(read(make(tmp_path / name, loops=text))) for name, text in (("a", bare), ("b", empty))
    )
    assert set(np.unique(given.branch)) == {-1, 1}
    np.testing.assert_array_equal(given.branch, without.branch)
    np.testing.assert_array_equal(given.cycle, without.cycle)


def test_given_branches_and_cycles_are_kept(tmp_path: Path) -> None:
    recording = loops((50.0, 100.0))
    body = recording.text().splitlines()
    words = {1: "loading", -1: "unloading"}
    rows = [f"{row},{words[b]},7,21.5" for row, b in zip(body[1:], recording.branch, strict=True)]
    specimen = read(make(tmp_path, loops="\n".join([body[0] + ",branch,cycle,temperature_C", *rows])))
    found = loops_of(specimen)
    assert found.branch.tolist() == recording.branch.tolist()
    assert set(found.cycle) == {7}
    assert found.temperature_C is not None and set(found.temperature_C) == {21.5}


@pytest.mark.parametrize(
    ("every", "found"), [(40, True), (10**6, True), (0, False)], ids=["slower", "once", "never"]
)
def test_a_thermometer_may_be_slower_than_the_load_cell(tmp_path: Path, every: int, found: bool) -> None:
    """Between its readings the temperature goes straight; without any reading there is none."""
    body = loops((50.0, 100.0)).text().splitlines()
    count = len(body) - 1
    true = 20.0 + 0.01 * np.arange(count)
    cells = [f"{t:.2f}" if every and not i % every else " " * (i % 2) for i, t in enumerate(true)]
    text = "\n".join([body[0] + ",temperature_C", *map(",".join, zip(body[1:], cells, strict=True))])
    read_back = loops_of(read(make(tmp_path, loops=text))).temperature_C
    if not found:
        assert read_back is None
        return
    assert read_back is not None
    last = (count - 1) // every * every
    np.testing.assert_allclose(read_back, np.minimum(true, true[last]))


@pytest.mark.parametrize("word", ["nan", "NaN", "NAN", " NaN"])
@pytest.mark.parametrize("first", [0, 1])
def test_no_temperature_may_be_written_as_nan(tmp_path: Path, word: str, first: int) -> None:
    """As an instrument or a program writes it that has none; in the first row as well."""
    body = loops((50.0, 100.0)).text().splitlines()
    rows = [f"{line},{word if i % 7 != first else 20.0 + 0.01 * i}" for i, line in enumerate(body[1:])]
    text = "\n".join([body[0] + ",temperature_C", *rows]) + "\n"
    found = loops_of(read(make(tmp_path, loops=text))).temperature_C
    assert found is not None
    known = np.arange(first, len(found), 7)
    np.testing.assert_allclose(found[known], 20.0 + 0.01 * known)
    assert np.isfinite(found).all()


def test_nan_elsewhere_is_no_number(tmp_path: Path) -> None:
    body = loops().text().splitlines()
    body[9] = ",".join([*body[9].split(",")[:3], "nan"])
    with pytest.raises(InputError, match=r'loops\.csv:10:force_N: found "nan", expected a number'):
        read(make(tmp_path, loops="\n".join(body) + "\n"))


def test_held_length_with_given_words(tmp_path: Path) -> None:
    pressure = np.concatenate([np.linspace(0, 200, 100), np.linspace(200, 0, 100)])
    words = np.repeat(["pressurising", "depressurising"], 100)
    rows = [
        f"{0.1 * i:.1f},{p:.3f},0.0,{0.3 * p:.3f},{w}"
        for i, (p, w) in enumerate(zip(pressure, words, strict=True))
    ]
    text = "\n".join(["time_s,pressure_kPa,displacement_mm,force_N,branch", *rows])
    specimen = read(make(tmp_path, loops=text))
    found = loops_of(specimen)
    assert found.branch.tolist() == [2] * 100 + [-2] * 100
    assert len(specimen.levels_Pa) > 5 and (np.diff(specimen.levels_Pa) > 0).all()


def test_floor_and_censored_column(tmp_path: Path) -> None:
    declaration = DECLARATION.replace("[files]", "[sensors]\nforce_floor_N = 12.0\n\n[files]")
    specimen = read(make(tmp_path, declaration, loops=loops().text()))
    found = loops_of(specimen)
    assert found.censored.any() and (found.censored == (found.force_N <= 12.0)).all()


def test_a_reading_at_the_floor_itself_is_slack(tmp_path: Path) -> None:
    """As the load cell writes it; so it is in a file of blocked forces."""
    declaration = DECLARATION.replace("[files]", "[sensors]\nforce_floor_N = 12.0\n\n[files]")
    declaration = declaration.replace('"loops.csv"', '"loops.csv"\nblocked_force = "blocked_force.csv"')
    columns = loops().columns()
    columns[:, 3] = np.maximum(columns[:, 3], 12.0)
    rows = "\n".join(",".join(f"{value:.5f}" for value in row) for row in columns)
    blocked = "pressure_kPa,force_N\n10,12\n20,12.01\n30,11.9\n"
    specimen = read(make(tmp_path, declaration, loops=f"{HEADER}\n{rows}\n", blocked_force=blocked))
    found = loops_of(specimen)
    assert found.censored.any() and (found.censored == (found.force_N == 12.0)).all()
    assert specimen.blocked_force is not None
    assert specimen.blocked_force.censored.tolist() == [True, False, True]


STATIC = """
force_map = "force_map.csv"
blocked_force = "blocked_force.csv"
free_contraction = "free_contraction.csv"
tensile = "tensile.csv"
"""


def test_every_kind_of_file_and_one_list_of_levels(tmp_path: Path) -> None:
    declaration = DECLARATION.replace('loops = "loops.csv"', 'loops = "loops.csv"' + STATIC)
    declaration += '\n[columns.force_map]\nrepeat = "no"\n'
    specimen = read(
        make(
            tmp_path,
            declaration,
            loops=loops((50.0, 100.0)).text(),
            force_map="pressure_kPa,contraction,force_N,branch,censored,no\n"
            "50.4,0.0,12,,0,1\n50.4,0.1,6,loading,0,1\n200,0.0,50,unloading,0,1\n200,0.2,0,,1,1\n",
            blocked_force="pressure_kPa,force_N\n10,0\n300,70\n",
            free_contraction="pressure_kPa,contraction\n50,0.1\n100,0.2\n",
            tensile="strain,stress_Pa\n0.1,4000\n0.2,8000\n0.3,12000\n",
        )
    )
    assert specimen.levels_Pa / 1e3 == pytest.approx([50.0, 100.0, 200.0])
    assert specimen.force_map is not None and specimen.force_map.level.tolist() == [0, 0, 2, 2]
    assert specimen.force_map.branch.tolist() == [0, 1, -1, 0]
    assert specimen.force_map.censored.tolist() == [False, False, False, True]
    assert specimen.blocked_force is not None and specimen.blocked_force.pressure_Pa.tolist() == [10e3, 300e3]
    assert specimen.free_contraction is not None and specimen.tensile is not None
    assert specimen.has_muscle_data


def test_a_tensile_test_alone_needs_no_geometry(tmp_path: Path) -> None:
    declaration = '[specimen]\nname = "rubber"\n[files]\ntensile = "t.csv"\n[simulation]\norder = 2\n'
    specimen = read(make(tmp_path, declaration, t="strain,stress_Pa\n0.1,1\n0.2,2\n0.3,3\n"))
    assert specimen.geometry is None and len(specimen.levels_Pa) == 0
    assert (specimen.simulation.moduli, specimen.simulation.law) == ("tensile", "constant")


def test_declared_moduli_settle_order_law_and_strain(tmp_path: Path) -> None:
    declaration = DECLARATION + 'strain = "stretch"\nmoduli = "tensile"\nE_Pa = [4.0e4, 2.6e4, 1]\n'
    simulation = read(make(tmp_path, declaration, loops=loops().text())).simulation
    assert (simulation.order, simulation.law, simulation.strain) == (3, "constant", "engineering")
    assert simulation.E_rel_sd == 0.1


def test_without_data_only_where_asked(tmp_path: Path) -> None:
    declaration = (DECLARATION + 'moduli = "tensile"\nE_Pa = [4.0e4]\n').replace('loops = "loops.csv"', "")
    folder = make(tmp_path, declaration)
    assert not read(folder, data_required=False).has_muscle_data
    with pytest.raises(InputError, match="no data files"):
        read(folder)


def test_digest_follows_meaning_and_bytes(tmp_path: Path) -> None:
    folder = make(tmp_path, loops=loops().text())
    first = read(folder).digest
    (folder / "specimen.toml").write_text("# a comment\n" + DECLARATION)
    assert read(folder).digest == first
    (folder / "specimen.toml").write_text(DECLARATION.replace("72.0", "71.0"))
    second = read(folder).digest
    assert second != first
    with (folder / "loops.csv").open("a") as stream:
        stream.write("\n")
    assert read(folder).digest not in (first, second)


def test_a_muscle_that_pushes_in_most_rows_is_read(tmp_path: Path) -> None:
    """Driven far beyond its free contraction; it still pulls where it is long."""
    recording = loops()
    beyond = (
        recording.force.max()
        - 2.0 * recording.force.max() * (recording.displacement / recording.displacement.max()) ** 0.5
    )
    assert np.median(beyond) < 0.0
    pushing = Recording(
        recording.time, recording.pressure, recording.displacement, beyond, recording.branch, recording.cycle
    )
    assert loops_of(read(make(tmp_path, loops=pushing.text()))).force_N.min() < 0.0
