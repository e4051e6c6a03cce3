"""Units stated in a file, in a row of their own or in a mapped name, against the scale declared for them."""

from __future__ import annotations

from pathlib import Path

import pytest

from mpam_calib.errors import InputError
from mpam_calib.specimen import read
from mpam_calib.specimen.units_row import worth

from .folders import DECLARATION, loops, make


def folder(path: Path, column: int, unit: str, scale: float, divisor: float, *, in_name: str) -> Path:
    """Loops whose column is divided by ``divisor``, with its unit in the header or in a row below it."""
    names = ["time_s", "pressure_kPa", "displacement_mm", "force_N"]
    usual = ["s", "kPa", "mm", "N"]
    header, *body = loops().text().splitlines()
    rows = [line.split(",") for line in body]
    for cells in rows:
        cells[column] = f"{float(cells[column]) / divisor:.9g}"
    header_cells = header.split(",")
    header_cells[column] = written = in_name.format(unit) if in_name else "Channel 3"
    usual[column] = unit
    above = [",".join(header_cells)] + ([] if in_name else [",".join(usual)])
    text = "\n".join([*above, *map(",".join, rows)]) + "\n"
    mapped = f'{names[column]} = {{ name = "{written}", scale = {scale} }}'
    return make(
        path, DECLARATION.replace("[simulation]", f"[columns.loops]\n{mapped}\n[simulation]"), loops=text
    )


WAYS = ["", "Channel ({})", "Channel [{}]", "Channel/{}"]


@pytest.mark.parametrize("in_name", WAYS)
@pytest.mark.parametrize(
    ("column", "unit", "scale", "expected"),
    [
        (3, "kN", -1.0, "scale = -1000"),
        (3, "lbf", 1.0, "N, or scale = 4.44822"),
        (1, "psi", 100.0, "scale = 6.89476"),
        (1, "bar", 1.0, "kPa, or scale = 100"),
        (1, "kPa", 100.0, "scale = 1 "),
        (0, "min", 1.0, "s, or scale = 60"),
        (2, "in", -1.0, "scale = -25.4"),
    ],
)
def test_a_unit_of_another_scale_is_refused(
    in_name: str, column: int, unit: str, scale: float, expected: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError) as caught:
        read(folder(tmp_path, column, unit, scale, 1.0, in_name=in_name))
    message = str(caught.value)
    assert f'found the unit "{unit}"' in message and f"expected {expected}" in message
    assert f"loops.csv:{1 if in_name else 2}:" in message and "\n" not in message


@pytest.mark.parametrize("in_name", WAYS)
@pytest.mark.parametrize(
    ("column", "unit", "scale"),
    [
        pytest.param(3, "kN", 1000.0, id="kN"),
        pytest.param(3, "kN", -1000.0, id="turned round"),
        pytest.param(3, "N", -1.0, id="turned round alone"),
        pytest.param(3, "N", 1.02, id="a cell's own gain"),
        pytest.param(3, "N", 2.0, id="a lever"),
        pytest.param(3, "kN", 2000.0, id="a lever in kN"),
        pytest.param(1, "bar", 100.0, id="bar"),
        pytest.param(1, "psi", 6.895, id="psi"),
    ],
)
def test_a_unit_of_its_own_scale_is_read(
    in_name: str, column: int, unit: str, scale: float, tmp_path: Path
) -> None:
    specimen = read(folder(tmp_path, column, unit, scale, scale, in_name=in_name))
    assert specimen.levels_Pa == pytest.approx([5e4, 1e5, 1.5e5])


@pytest.mark.parametrize("name", ["Channel (left)", "Channel/2", "Channel (kN) raw", "kN"])
def test_what_is_no_unit_is_a_name(name: str, tmp_path: Path) -> None:
    read(folder(tmp_path, 3, "", 1.0, 1.0, in_name=name))


@pytest.mark.parametrize(("units", "read_as"), [("mm,N", True), ("furlong,N", False)])
def test_units_of_what_a_map_makes_another_quantity_of(tmp_path: Path, units: str, read_as: bool) -> None:
    """Extension and force of a tensile tester, in its units, become strain and stress."""
    rows = "\n".join(f"{0.5 * i},{0.02 * i}" for i in range(60))
    mapped = (
        '[columns.tensile]\nstrain = { name = "Extension", scale = 0.04 }\n'
        'stress_Pa = { name = "Force", scale = 1e5 }\n[simulation]'
    )
    text = DECLARATION.replace("[simulation]", mapped)
    text = text.replace('loops = "loops.csv"', 'loops = "loops.csv"\ntensile = "tensile.csv"')
    made = make(tmp_path, text, loops=loops().text(), tensile=f"Extension,Force\n{units}\n{rows}\n")
    if read_as:
        found = read(made).tensile
        assert found is not None and found.strain.max() == pytest.approx(0.04 * 29.5)
    else:
        said = (
            r'tensile.csv:2:strain: found the unknown unit "furlong", expected the unit of a time, a pressure'
        )
        with pytest.raises(InputError, match=said):
            read(made)


@pytest.mark.parametrize(
    ("units", "said"),
    [
        pytest.param(
            "s,kPa,mm,kip",
            'loops.csv:2:force_N: found the unknown unit "kip", expected one of "N", "mN", "g", "kg"',
            id="one",
        ),
        pytest.param("s,(bar(g)),mm,N", '2:pressure_kPa: found the unknown unit "(bar(g))"', id="brackets"),
        pytest.param(",,,kip", "2:time_s: found an empty cell, expected a number", id="alone"),
        pytest.param("0.0,kPa,mm,N", '2:pressure_kPa: found "kPa", expected a number', id="beside a number"),
        pytest.param("a,b,c,d", '2:time_s: found "a", expected a number', id="words"),
        pytest.param("seconds,Kilopascal,millimetres,Newtons", "", id="in full"),
        pytest.param("s,,mm,N", "", id="one empty"),
    ],
)
def test_an_unknown_unit_is_refused_where_it_is(units: str, said: str, tmp_path: Path) -> None:
    header, body = loops().text().split("\n", 1)
    made = make(tmp_path, loops=f"{header}\n{units}\n{body}")
    if not said:
        assert read(made).levels_Pa == pytest.approx([5e4, 1e5, 1.5e5])
        return
    with pytest.raises(InputError) as caught:
        read(made)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("column", "units"),
    [
        ("time_s", {"s": 1.0, "ms": 1e-3, "min": 60.0}),
        ("pressure_kPa", {"Pa": 1e-3, "hPa": 0.1, "mbar": 0.1, "bar": 100.0, "MPa": 1000.0, "psi": 6.8948}),
        ("displacement_mm", {"µm": 1e-3, "um": 1e-3, "cm": 10.0, "m": 1000.0, "in": 25.4}),
        (
            "force_N",
            {"mN": 1e-3, "kN": 1000.0, "g": 9.80665e-3, "kg": 9.80665, "kgf": 9.80665, "lbf": 4.4482},
        ),
        ("stress_Pa", {"kPa": 1e3, "MPa": 1e6, "N/mm²": 1e6, "N/mm^2": 1e6, "psi": 6894.76}),
        ("contraction", {"%": 0.01, "-": 1.0, "mm/mm": 1.0}),
        ("strain", {"%": 0.01, "": 1.0}),
    ],
)
def test_what_a_unit_is_worth(column: str, units: dict[str, float]) -> None:
    assert {unit: worth(column, unit) for unit in units} == pytest.approx(units, rel=1e-4)
    assert worth(column, "furlong") is None
