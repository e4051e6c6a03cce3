"""Values that are hardly meant: another unit, a code for no reading, strokes of too few rows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mpam_calib.errors import InputError
from mpam_calib.specimen import read

from .folders import DECLARATION, HEADER, Recording, loops, make

LONG = DECLARATION.replace("L0_mm = 50.0", "L0_mm = 180.0")
RUBBER = '[specimen]\nname = "rubber"\n[files]\ntensile = "t.csv"\n[simulation]\norder = 1\n'
MAP = DECLARATION.replace('loops = "loops.csv"', 'force_map = "force_map.csv"')


def table(columns: np.ndarray) -> str:
    return "\n".join([HEADER, *(",".join(f"{value:.6g}" for value in row) for row in columns)]) + "\n"


def refused(folder: Path) -> str:
    with pytest.raises(InputError) as error:
        read(folder)
    said = str(error.value).removeprefix(f"{folder}/")
    assert "\n" not in said
    return said


@pytest.mark.parametrize(
    ("largest", "said", "scale"),
    [(0.361, "(a share of L0?)", "scale = 180.0"), (0.065, "(metres?)", "scale = 1000.0")],
)
def test_a_displacement_as_a_share_is_told_from_metres(
    largest: float, said: str, scale: str, tmp_path: Path
) -> None:
    """A thousand times what is given must be shorter than the muscle, or it is not in metres."""
    columns = loops().columns()
    columns[:, 2] *= largest / columns[:, 2].max()
    message = refused(make(tmp_path, LONG, loops=table(columns)))
    assert message.startswith("loops.csv:displacement_mm: found a largest displacement of ")
    assert said in message and scale in message


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("1.15", ("found 1.15, a braid that lengthens under pressure (radians?)", "(65.9?)")),
        ("18.0", ("(the angle from the axis?)", "(72?)")),
    ],
)
def test_a_braid_angle_in_radians_is_told_from_one_from_the_axis(
    given: str, said: tuple[str, str], tmp_path: Path
) -> None:
    declaration = DECLARATION.replace("72.0", given)
    message = refused(make(tmp_path, declaration, loops=loops().text()))
    assert all(part in message for part in said)


@pytest.mark.parametrize("rows", [2, 3])
def test_strokes_of_too_few_rows_are_not_said_to_rest(rows: int, tmp_path: Path) -> None:
    way = np.linspace(0.0, 17.5, rows)
    x = np.tile(np.concatenate([way, way[::-1]]), 12)
    pressure = np.repeat([50.0, 100.0, 150.0], len(x) // 3)
    columns = np.stack([0.1 * np.arange(len(x)), pressure, x, 0.3 * pressure - x], axis=1)
    message = refused(make(tmp_path, loops=table(columns)))
    assert f"found {24 * rows} rows for 24 strokes" in message
    assert "expected at least 4 rows a stroke" in message
    assert "never moves" not in message


def test_a_held_crosshead_whose_encoder_rustles_never_moves(tmp_path: Path) -> None:
    made = loops()
    rest = 5.0 + 0.001 * np.random.default_rng(0).standard_normal(len(made.time))
    held = Recording(made.time, made.pressure, rest, made.force, made.branch, made.cycle)
    message = refused(make(tmp_path, loops=held.text()))
    assert "found a displacement that never moves (4.99" in message
    assert "no more than it scatters" in message


@pytest.mark.parametrize(
    ("column", "name", "code"),
    [(3, "force_N", 9.9e37), (1, "pressure_kPa", 9.9e37), (2, "displacement_mm", -1e6)],
)
def test_a_code_for_no_reading_is_refused_where_it_stands(
    column: int, name: str, code: float, tmp_path: Path
) -> None:
    columns = loops().columns()
    columns[20, column] = code
    message = refused(make(tmp_path, loops=table(columns)))
    assert message.startswith(f"loops.csv:22:{name}: found {code:g} (a code for no reading?)")


@pytest.mark.parametrize("name", ["cycle", "setpoint_kPa", "temperature_C"])
def test_such_a_code_in_a_column_beside_them(name: str, tmp_path: Path) -> None:
    header, *rows = loops().text().splitlines()
    beside = ["9.9e37" if i == 20 else "1" for i in range(len(rows))]
    lines = [f"{header},{name}", *(f"{row},{cell}" for row, cell in zip(rows, beside, strict=True))]
    message = refused(make(tmp_path, loops="\n".join(lines) + "\n"))
    assert message.startswith(f"loops.csv:22:{name}: found 9.9e+37 (a code for no reading?)")


@pytest.mark.parametrize("code", [-9999.0, 99999.0, -9999.9])
@pytest.mark.parametrize("column", range(1, 4))
def test_nines_alone_far_from_all_the_rest_are_a_code(column: int, code: float, tmp_path: Path) -> None:
    columns = loops(rate=20.0).columns()
    columns[120, column] = code
    message = refused(make(tmp_path, loops=table(columns)))
    assert message.startswith(f"loops.csv:122:{HEADER.split(',')[column]}: found {code:g} (a code for no rea")


def test_nines_alone_in_a_setpoint_and_in_rows_that_are_averaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording = loops(rate=20.0)
    header, *rows = recording.text().splitlines()
    beside = ["-99999" if i == 20 else f"{p:g}" for i, p in enumerate(recording.pressure)]
    lines = [f"{header},setpoint_kPa", *(f"{row},{cell}" for row, cell in zip(rows, beside, strict=True))]
    message = refused(make(tmp_path / "setpoint", loops="\n".join(lines) + "\n"))
    assert message.startswith("loops.csv:22:setpoint_kPa: found -99999 (a code for no reading?)")
    monkeypatch.setattr("mpam_calib.specimen.reduction.ROWS_KEPT", 150)
    columns = recording.columns()
    columns[120, 3] = -9999.0
    message = refused(make(tmp_path / "averaged", loops=table(columns)))
    assert message.startswith("loops.csv:122:force_N: found -9999 (a code for no reading?)")


def test_nines_among_their_like_are_readings(tmp_path: Path) -> None:
    columns = loops().columns()
    columns[30, 3] = 9.99
    columns[columns[:, 1] == 100.0, 1] = 99.9
    made = read(make(tmp_path, loops=table(columns)))
    assert made.levels_Pa[1] == 99.9e3


def test_a_muscle_drawn_far_beyond_its_strands_is_refused_where_it_is(tmp_path: Path) -> None:
    columns = loops().columns()
    columns[30, 2] = -321.0
    message = refused(make(tmp_path, loops=table(columns)))
    assert message.startswith("loops.csv:32:displacement_mm: found -321 mm, longer than the strands by more")


def test_such_a_code_in_a_force_map_and_a_tensile_test(tmp_path: Path) -> None:
    rows = "".join(f"{P},{g},{P / 5}\n" for P in (50, 100) for g in (0.0, 0.05, 0.1))
    text = f"pressure_kPa,contraction,force_N\n{rows}100,0.12,9.9e37\n"
    message = refused(make(tmp_path / "map", MAP, force_map=text))
    assert message.startswith("force_map.csv:8:force_N: found 9.9e+37 (a code for no reading?)")
    text = "strain,stress_Pa\n0.1,4000\n0.2,9.9e37\n0.3,12000\n"
    message = refused(make(tmp_path / "rubber", RUBBER, t=text))
    assert message.startswith("t.csv:3:stress_Pa: found 9.9e+37 (a code for no reading?)")


@pytest.mark.parametrize("kind", ["force_map", "blocked_force"])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_slack_rows_say_nothing_of_a_force_s_sign(kind: str, sign: float, tmp_path: Path) -> None:
    """Zeros of a slack muscle are more than half of the rows."""
    lengths = {"force_map": ("contraction,", "0.05,"), "blocked_force": ("", "")}[kind]
    rows = [f"50,{lengths[1]}0,1"] * 8 + [f"{p},{lengths[1]}{sign * p / 5},0" for p in (100, 150, 200)]
    text = "\n".join([f"pressure_kPa,{lengths[0]}force_N,censored", *rows]) + "\n"
    folder = make(tmp_path, MAP.replace("force_map", kind), **{kind: text})
    if sign > 0.0:
        assert read(folder).has_muscle_data
    else:
        assert f"{kind}.csv:force_N: found a median force of -30 N (flipped sign?)" in refused(folder)


@pytest.mark.parametrize(
    ("strains", "said"),
    [
        ((0.2, 0.2, 0.2), "t.csv:strain: found a strain of 0.2 throughout, expected a range of strains"),
        ((-0.1, -0.2, -0.3), "t.csv:strain: found a median strain of -0.2 (flipped sign?), expected "),
    ],
)
def test_strains_that_tell_nothing_are_refused(strains: tuple[float, ...], said: str, tmp_path: Path) -> None:
    rows = "".join(f"{strain},{4000 + i}\n" for i, strain in enumerate(strains))
    assert refused(make(tmp_path, RUBBER, t=f"strain,stress_Pa\n{rows}")).startswith(said)


@pytest.mark.parametrize("stress", [0.0, 4000.0])
def test_stresses_that_never_change_are_refused(stress: float, tmp_path: Path) -> None:
    rows = "".join(f"{i / 10},{stress}\n" for i in range(12))
    assert refused(make(tmp_path, RUBBER, t=f"strain,stress_Pa\n{rows}")) == (
        f"t.csv:stress_Pa: found a stress that never changes ({stress:g} throughout), expected the load "
        "cell's readings"
    )


def test_a_nul_in_a_file_s_name_is_refused(tmp_path: Path) -> None:
    declaration = DECLARATION.replace('"loops.csv"', '"lo\\u0000ops.csv"')
    message = refused(make(tmp_path, declaration, loops=loops().text()))
    assert message.startswith("specimen.toml:11:files.loops: found ")
    assert message.endswith("expected a file's name")
