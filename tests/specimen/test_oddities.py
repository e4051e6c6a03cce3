"""What can be read but is hardly meant: ``check`` says so."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mpam_calib.errors import InputError
from mpam_calib.specimen import read
from mpam_calib.specimen.oddities import oddities

from .folders import DECLARATION, loops, make

Change = Callable[[list[list[str]]], None]


def times(column: int, factor: float) -> Change:
    def change(rows: list[list[str]]) -> None:
        for row in rows:
            row[column] = f"{factor * float(row[column]):.8g}"

    return change


def offset(column: int, by: float) -> Change:
    def change(rows: list[list[str]]) -> None:
        for row in rows:
            row[column] = f"{by + float(row[column]):.8g}"

    return change


def from_the_other_end(rows: list[list[str]]) -> None:
    """The crosshead's position counted from where the muscle is shortest."""
    top = max(float(row[2]) for row in rows)
    for row in rows:
        row[2] = f"{top - float(row[2]):.8g}"


def one_level_in_bar(rows: list[list[str]]) -> None:
    for row in rows:
        if abs(float(row[1]) - 100.0) < 10.0:
            row[1] = f"{0.01 * float(row[1]):.8g}"


def one_level_of(kPa: float) -> Change:
    def change(rows: list[list[str]]) -> None:
        for row in rows:
            if abs(float(row[1]) - 50.0) < 10.0:
                row[1] = f"{float(row[1]) - 50.0 + kPa:.8g}"

    return change


def blip(rows: list[list[str]]) -> None:
    rows[7][3] = "-8000"


def gust(rows: list[list[str]]) -> None:
    rows[7][1] = "-8000"


def remarks(folder: Path, change: Change | None = None) -> str:
    header, *body = loops().text().splitlines()
    rows = [line.split(",") for line in body]
    if change is not None:
        change(rows)
    return " ".join(oddities(read(make(folder, loops="\n".join([header, *map(",".join, rows)]) + "\n"))))


def test_nothing_is_odd_in_a_plain_test(tmp_path: Path) -> None:
    found = remarks(tmp_path)
    usual = ("cannot pull", "seconds", "millimetres", "setpoint", "pascals", "bias")
    for words in ("far from", "gas alone", "the gas pulls", "zeroed", "grows with", *usual):
        assert words not in found


@pytest.mark.parametrize(
    ("change", "said"),
    [
        pytest.param(times(1, 0.01), "while the gas alone pulls about", id="bar"),
        pytest.param(times(3, 1e-3), "while the gas alone pulls about", id="kilonewtons"),
        pytest.param(times(3, 1e3), "while the gas alone pulls about", id="millinewtons"),
        pytest.param(times(1, 10.0), "while the gas alone pulls about", id="millibars"),
        pytest.param(times(3, 0.101972), "while the gas alone pulls about", id="kilograms-force"),
        pytest.param(
            blip, "a force is far from all others (-8000 N, 0.7 s after the first reading)", id="a knock"
        ),
        pytest.param(one_level_in_bar, "N at 1 kPa, where the gas pulls about", id="one level in bar"),
        pytest.param(one_level_of(-80.0), "N at -80 kPa, where a bladder under less than", id="a vacuum"),
        pytest.param(offset(3, -16.0), "every force at 50 kPa is below zero; was the load", id="zero"),
        pytest.param(from_the_other_end, "the force grows with the contraction at 3 of 3", id="reversed"),
        pytest.param(gust, "50 kPa has a reading far from it (-8000 kPa)", id="the same of a pressure"),
        pytest.param(times(2, 0.1), "is displacement_mm in millimetres", id="centimetres"),
        pytest.param(times(0, 1e3), "a reading every 100 s; is time_s in seconds?", id="milliseconds"),
        pytest.param(times(0, 1e-3), "mm/min; is time_s in seconds?", id="kiloseconds"),
    ],
)
def test_what_is_hardly_meant_is_said(change: Change, said: str, tmp_path: Path) -> None:
    assert said in remarks(tmp_path, change)


def test_a_gauge_whose_zero_is_a_little_off_reads_no_vacuum(tmp_path: Path) -> None:
    assert "cannot pull" not in remarks(tmp_path, one_level_of(-1.0))


@pytest.mark.parametrize(("change", "more"), [(times(1, 0.01), True), (one_level_in_bar, False)])
def test_levels_whose_forces_are_far_above_the_gas_s_are_said_in_one_line(
    change: Change, more: bool, tmp_path: Path
) -> None:
    found = remarks(tmp_path, change)
    assert found.count("is every file's pressure in kPa") == 1
    assert ("(likewise at " in found) == more


def test_contractions_of_another_unit_beyond_the_braid_s_limit_are_asked_about(tmp_path: Path) -> None:
    asked = "from the hoop direction, or is displacement_mm not the shortening in mm?"
    assert asked in remarks(tmp_path / "a", times(2, 2.0))
    assert "hoop direction" not in remarks(tmp_path / "b")


def test_a_handful_of_readings_is_said_to_be_one(tmp_path: Path) -> None:
    lines = loops().text().splitlines()
    few = "\n".join(lines[:13]) + "\n"
    text = DECLARATION.replace('law = "linear"', 'law = "constant"')
    assert "loops: 12 readings; so few hardly" in " ".join(oddities(read(make(tmp_path, text, loops=few))))


def test_per_cent_of_strain_are_refused(tmp_path: Path) -> None:
    folder = make(tmp_path, '[specimen]\nname = "Rubber"\n[files]\ntensile = "tensile.csv"\n')
    rows = "".join(f"{10.0 * k},{1e4 * k}\n" for k in range(12))
    (folder / "tensile.csv").write_text("strain,stress_Pa\n" + rows)
    with pytest.raises(InputError, match=r"tensile.csv:5:strain: found 30 \(per cent\?\)"):
        read(folder)


@pytest.mark.parametrize(
    ("factor", "said"), [(1.0, ""), (1.1, ""), (0.01, "setpoint_kPa is 1.5 where pressure_kPa reads 150")]
)
def test_setpoints_that_say_other_pressures(factor: float, said: str, tmp_path: Path) -> None:
    header, *body = loops().text().splitlines()
    rows = [f"{line},{factor * round(float(line.split(',')[1]))}" for line in body]
    text = "\n".join([f"{header},setpoint_kPa", *rows]) + "\n"
    found = " ".join(oddities(read(make(tmp_path, loops=text))))
    assert said in found if said else "setpoint" not in found


def test_a_gauge_that_knows_nothing_and_moduli_in_megapascals(tmp_path: Path) -> None:
    text = DECLARATION.replace("[files]", "[sensors]\npressure_bias_sd_kPa = 1e9\n[files]")
    found = " ".join(oddities(read(make(tmp_path / "a", text, loops=loops().text()))))
    assert "pressure_bias_sd_kPa = 1e+09 is above the highest level, 150 kPa" in found
    text = DECLARATION.replace("order = 2", 'moduli = "tensile"\nE_Pa = [0.04, 0.02]')
    found = " ".join(oddities(read(make(tmp_path / "b", text, loops=loops().text()))))
    assert "a modulus of 0.04 Pa; is it in pascals?" in found


@pytest.mark.parametrize(("scale", "odd"), [(1.0, False), (1e-6, True)])
def test_a_tensile_test_in_megapascals(scale: float, odd: bool, tmp_path: Path) -> None:
    folder = make(tmp_path, '[specimen]\nname = "Rubber"\n[files]\ntensile = "tensile.csv"\n')
    rows = "".join(f"{0.1 * k:.3g},{5e3 * k * scale:.6g}\n" for k in range(12))
    (folder / "tensile.csv").write_text("strain,stress_Pa\n" + rows)
    assert ("is it in pascals?" in " ".join(oddities(read(folder)))) == odd


@pytest.mark.parametrize(("modulus", "odd"), [(2.1, False), (230.0, False), (2.1e9, True), (2.1e-3, True)])
def test_strands_that_no_braid_has(modulus: float, odd: bool, tmp_path: Path) -> None:
    braid = f"[braid]\nE_br_GPa = {modulus}\nnu_s = 0.3\nR_br_mm = 0.1\nn = 48\n[files]"
    text = DECLARATION.replace("[files]", braid)
    found = " ".join(oddities(read(make(tmp_path, text, loops=loops().text()))))
    assert (f"E_br_GPa: a modulus of {modulus:.2g} GPa; is it in gigapascals?" in found) == odd
    assert ("E_br_GPa" in found) == odd


@pytest.mark.parametrize(
    ("friction", "by_pressure", "said"),
    [("none", "true", True), ("none", "false", False), ("coulomb", "true", False)],
)
def test_a_friction_for_each_pressure_of_none_is_said(
    friction: str, by_pressure: str, said: bool, tmp_path: Path
) -> None:
    declared = f'friction = "{friction}"\nfriction_by_pressure = {by_pressure}'
    text = DECLARATION.replace('friction = "coulomb"', declared)
    found = " ".join(oddities(read(make(tmp_path, text, loops=loops().text()))))
    assert ('friction_by_pressure = true is not used: friction is "none"' in found) == said


@pytest.mark.parametrize(
    ("number", "said"),
    [
        pytest.param(lambda n: n, False, id="up"),
        pytest.param(lambda n: 4 - n, True, id="down"),
        pytest.param(lambda n: 1 + (n + 1) % 3, False, id="once anew"),
    ],
)
def test_cycles_that_count_down_are_said_to(number: Callable[[int], int], said: bool, tmp_path: Path) -> None:
    made = loops(cycles=3)
    lines = made.text().splitlines()
    rows = [f"{line},{number(int(n))}" for line, n in zip(lines[1:], made.cycle, strict=True)]
    text = "\n".join([lines[0] + ",cycle", *rows]) + "\n"
    found = " ".join(oddities(read(make(tmp_path, loops=text))))
    assert ("loops: the column cycle counts down (6 of 6 changes within a level)" in found) == said
    assert ("counts down" in found) == said


@pytest.mark.parametrize(
    ("levels", "before", "said"),
    [
        pytest.param((50.0, 100.0, 150.0), (0, 0, 0), "", id="from 1 at each level"),
        pytest.param((50.0, 100.0, 150.0), (1, 1, 1), "", id="from 2 at each level"),
        pytest.param((50.0, 100.0, 150.0), (0, 3, 6), "100 kPa begins with 4", id="through the test"),
        pytest.param((150.0, 100.0, 50.0), (0, 3, 6), "100 kPa begins with 4", id="downwards"),
        pytest.param((50.0, 100.0, 50.0, 150.0), (0, 3, 6, 9), "100 kPa begins with 4", id="a level again"),
        pytest.param((50.0, 100.0, 50.0, 150.0), (0, 0, 3, 0), "", id="a level again, each from 1"),
        pytest.param((50.0,), (3,), "", id="one level"),
    ],
)
def test_cycles_that_go_on_from_level_to_level_are_asked_about(
    levels: tuple[float, ...], before: tuple[int, ...], said: str, tmp_path: Path
) -> None:
    parts = [loops((level,), cycles=3) for level in levels]
    cycle = np.concatenate([part.cycle + more for part, more in zip(parts, before, strict=True)])
    lines = loops(levels, cycles=3).text().splitlines()
    rows = [f"{line},{number}" for line, number in zip(lines[1:], cycle, strict=True)]
    text = DECLARATION.replace('law = "linear"', 'law = "constant"')
    folder = make(tmp_path, text, loops="\n".join([lines[0] + ",cycle", *rows]) + "\n")
    found = " ".join(oddities(read(folder)))
    assert (f"loops: cycle goes on from level to level ({said}); does it count from 1" in found) == bool(said)
    assert ("goes on" in found) == bool(said)


@pytest.mark.parametrize(
    ("simulation", "said"),
    [
        (
            'moduli = "tensile"\norder = 4\nE_Pa = [4.0e4, 2.6e4]',
            "order = 4 is not used: the moduli make",
        ),
        ('moduli = "tensile"\nlaw = "linear"\nE_Pa = [4.0e4]', 'law = "linear" is not used'),
        ('moduli = "tensile"\norder = 2\nE_Pa = [4.0e4, 2.6e4]', ""),
        ('moduli = "tensile"\nE_Pa = [4.0e4, 2.6e4]', ""),
        ("order = 3", ""),
    ],
)
def test_what_declared_moduli_overrule_is_said(tmp_path: Path, simulation: str, said: str) -> None:
    """Declared moduli fix the order, the law and the strain: what is declared beside them is not used."""
    text = DECLARATION.replace('order = 2\nlaw = "linear"', simulation)
    found = " ".join(oddities(read(make(tmp_path, text, loops=loops().text()))))
    assert said in found
    assert ("is not used" in found) == bool(said)


@pytest.mark.parametrize(("moduli", "said"), [("loops", True), ("tensile", False)])
def test_a_tensile_test_that_is_not_used_is_said(moduli: str, said: bool, tmp_path: Path) -> None:
    """Beside a muscle's readings it counts only where the moduli are said to be its own."""
    text = DECLARATION.replace("order = 2", f'order = 2\nmoduli = "{moduli}"')
    folder = make(tmp_path, text.replace("[files]", '[files]\ntensile = "t.csv"'), loops=loops().text())
    rows = "\n".join(f"{i / 10},{1e4 * i}" for i in range(1, 9))
    (folder / "t.csv").write_text(f"strain,stress_Pa\n{rows}\n")
    found = " ".join(oddities(read(folder)))
    assert ('files: the tensile test is not used: moduli = "loops"' in found) == said
    assert ("tensile test is not used" in found) == said


def turning_point(kinematics: str) -> float:
    """The contraction where gas and wall cancel, of a muscle of 50, 3 and 0.7 mm and 72°, by bisection."""
    low, high = 0.0, 0.6
    for _ in range(60):
        middle = 0.5 * (low + high)
        length, section = 50.0 * (1.0 - middle), 50.0 * (3.0**2 - 2.3**2)
        sine = (1.0 - middle) * np.sin(np.radians(72.0))
        tangent = sine**2 / (1.0 - sine**2)
        if kinematics == "constant_thickness":
            wall = 0.7
            radius = (section / length + wall**2) / (2.0 * wall)
        else:
            radius = 3.0 * np.sqrt(1.0 - sine**2) / np.cos(np.radians(72.0))
            wall = radius - np.sqrt(radius**2 - section / length)
        gas = radius**2 * (2.0 * tangent - 1.0)
        pulls = gas + 2.0 * radius * wall - wall**2 - 2.0 * tangent * radius * wall > 0.0
        low, high = (middle, high) if pulls else (low, middle)
    return low


@pytest.mark.parametrize("kinematics", ["inextensible_braid", "constant_thickness"])
@pytest.mark.parametrize(("further", "asked"), [(-0.002, False), (0.005, False), (0.03, True)])
def test_a_thick_wall_contracts_further_than_a_thin_one(
    kinematics: str, further: float, asked: bool, tmp_path: Path
) -> None:
    """As its declared thickness term says: 1 - 1/(sqrt(3) sin 72°) = 0.393 is the thin wall's."""
    limit = turning_point(kinematics)
    assert limit > 0.4
    text = DECLARATION.replace('loops = "loops.csv"', 'force_map = "force_map.csv"')
    text = text.replace("linear", "constant").replace(
        "[simulation]", f'[simulation]\nkinematics = "{kinematics}"'
    )
    rows = "".join(f"200,{c:.6g},{50.0 * (1.0 - c / 0.5)}\n" for c in np.linspace(0.0, limit + further, 12))
    found = oddities(read(make(tmp_path, text, force_map="pressure_kPa,contraction,force_N\n" + rows)))
    assert ("is alpha0_deg from the hoop direction?" in " ".join(found)) == asked
    if asked:
        said = re.search(r"braid's limit of (\S+)", " ".join(found))
        assert said is not None and float(said[1]) == pytest.approx(limit, abs=1.5e-3)


@pytest.mark.parametrize("said", [True, False], ids=["within a level", "between two"])
def test_a_pause_within_a_level_is_said(said: bool, tmp_path: Path) -> None:
    row = 20 if said else int(np.argmax(loops().pressure > 50.0))

    def pause(rows: list[list[str]]) -> None:
        for cells in rows[row:]:
            cells[0] = f"{float(cells[0]) + 5.0:.8g}"

    found = remarks(tmp_path, pause)
    words = (
        "loops: a gap in the time of file 1 within a level, the longest 5.1 s, 1.9 s after the first reading"
    )
    assert (words in found, "a gap" in found) == (said, said)


@pytest.mark.parametrize(("share", "said"), [(0.03, False), (0.08, True)])
def test_a_pressure_that_wanders_is_said_to(share: float, said: bool, tmp_path: Path) -> None:
    def ripple(rows: list[list[str]]) -> None:
        for i, cells in enumerate(rows):
            cells[1] = f"{float(cells[1]) * (1.0 + share * np.sin(0.9 * i)):.8g}"

    wanders = re.findall(r"loops: (\S+) kPa wanders by (\S+) kPa", remarks(tmp_path, ripple))
    assert len(wanders) == (3 if said else 0)
    for level, by in wanders:
        assert float(by) == pytest.approx(share * float(level), rel=0.15)


def test_a_level_that_goes_one_way_alone_is_said_to(tmp_path: Path) -> None:
    made = loops()
    kept = (made.branch == -1) | (made.pressure != 100.0)
    header, *body = made.text().splitlines()
    text = "\n".join([header, *(line for line, keep in zip(body, kept, strict=True) if keep)]) + "\n"
    found = " ".join(oddities(read(make(tmp_path, loops=text))))
    assert re.findall(r"loops: (\S+) kPa has only the branch (\w+)", found) == [("100", "unloading")]


def test_rows_without_a_branch_are_counted(tmp_path: Path) -> None:
    made, words = loops(), {1: "loading", -1: "unloading"}
    header, *body = made.text().splitlines()
    named = [words[int(b)] if i >= 4 else "" for i, b in enumerate(made.branch)]
    text = "\n".join([f"{header},branch", *map(",".join, zip(body, named, strict=True))]) + "\n"
    found = " ".join(oddities(read(make(tmp_path, loops=text))))
    assert re.findall(r"loops: (\S+) kPa has (\d+) rows without a branch", found) == [("50", "4")]


def test_slack_rows_are_counted(tmp_path: Path) -> None:
    text = DECLARATION.replace("[files]", "[sensors]\nforce_floor_N = 12.0\n[files]")
    made = loops()
    found = " ".join(oddities(read(make(tmp_path, text, loops=made.text()))))
    count = int(np.sum(made.force <= 12.0))
    assert f"loops: {count} of {len(made.force)} rows are slack" in found
    assert "slack" not in remarks(tmp_path / "none")


def test_rows_longer_than_the_straight_strands_are_counted(tmp_path: Path) -> None:
    """1 - 1/sin 72° = -0.0515."""
    text = DECLARATION.replace('loops = "loops.csv"', 'force_map = "force_map.csv"')
    text = text.replace('law = "linear"', 'law = "constant"')
    rows = "".join(f"200,{c},{50.0 - 100.0 * c}\n" for c in (-0.06, -0.052, -0.05, 0.0, 0.1, 0.2, 0.3))
    found = " ".join(
        oddities(read(make(tmp_path, text, force_map="pressure_kPa,contraction,force_N\n" + rows)))
    )
    assert "force_map: 2 rows are longer than the straight strands (contraction -0.051)" in found


@pytest.mark.parametrize(("factor", "said"), [(0.25, True), (0.5, False), (2.0, False), (4.0, True)])
def test_forces_beyond_three_times_the_gas_s_pull_or_a_third_are_asked_about(
    factor: float, said: bool, tmp_path: Path
) -> None:
    """The gas at 150 kPa and full length: pi R0^2 P (2 tan^2 72° - 1) = 76.1 N."""
    header, *body = loops().text().splitlines()
    rows = [line.split(",") for line in body]
    top = np.quantile([float(row[3]) for row in rows], 0.99)
    gas = np.pi * 0.003**2 * 150e3 * (2.0 * np.tan(np.radians(72.0)) ** 2 - 1.0)
    times(3, factor * gas / top)(rows)
    found = " ".join(oddities(read(make(tmp_path, loops="\n".join([header, *map(",".join, rows)]) + "\n"))))
    assert (f"while the gas alone pulls about {gas:.3g} N" in found) == said


def test_a_crosshead_s_speed_is_told_in_millimetres_a_minute(tmp_path: Path) -> None:
    """0.8 mm/s a thousand times too fast: 48 m/min."""
    told = re.search(r"the crosshead moves at (\S+) mm/min", remarks(tmp_path, times(0, 1e-3)))
    assert told is not None and float(told[1]) == pytest.approx(48e3, rel=0.03)


@pytest.mark.parametrize(("sd", "said"), [(149.0, False), (151.0, True)])
def test_a_gauge_is_held_against_the_highest_level(sd: float, said: bool, tmp_path: Path) -> None:
    text = DECLARATION.replace("[files]", f"[sensors]\npressure_bias_sd_kPa = {sd}\n\n[files]")
    found = " ".join(oddities(read(make(tmp_path, text, loops=loops().text()))))
    assert (f"pressure_bias_sd_kPa = {sd:g} is above the highest level, 150 kPa" in found) == said
