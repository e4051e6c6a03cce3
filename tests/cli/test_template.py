"""The mappings that ``init`` shows for a rig's own columns do what is said beside them."""

from __future__ import annotations

import re
from importlib import resources
from pathlib import Path

import pytest

from mpam_calib.specimen import read

TEMPLATE = resources.files("mpam_calib.specimen").joinpath("templates", "specimen.toml").read_text("utf-8")
RUBBER = '[specimen]\nname = "rubber"\n[files]\ntensile = "tensile.csv"\n'
SIMULATION = '[simulation]\nmoduli = "tensile"\norder = 2\nlaw = "constant"\n'


def test_extension_and_force_become_engineering_strain_and_stress(tmp_path: Path) -> None:
    """A strip of 25 mm and 10 mm2: 2.5 mm are a strain of 0.1, 1 N is 100 kPa."""
    mapping = re.findall(r"^#(\[columns\.tensile\]|strain = .*|stress_Pa = .*)", TEMPLATE, flags=re.MULTILINE)
    assert len(mapping) == 3
    (tmp_path / "specimen.toml").write_text(RUBBER + SIMULATION + "\n".join(mapping) + "\n")
    rows = "\n".join(f"{2.5 * i},{i}" for i in range(1, 20))
    (tmp_path / "tensile.csv").write_text(f"Extension_mm,Force_N\n{rows}\n")
    tensile = read(tmp_path).tensile
    assert tensile is not None
    assert tensile.strain[:2] == pytest.approx([0.1, 0.2])
    assert tensile.stress_Pa[:2] == pytest.approx([1e5, 2e5])


def test_absolute_pressures_become_gauge_pressures(tmp_path: Path) -> None:
    """As said behind the mapping of a pressure in bar."""
    shown = r"^# (pressure_kPa = \{.*) \} +# absolute readings: and (offset = \S+)$"
    ((mapping, offset),) = re.findall(shown, TEMPLATE, flags=re.MULTILINE)
    geometry = "[geometry]\nL0_mm = 50.0\nR0_mm = 3.0\nt0_mm = 0.7\nalpha0_deg = 72.0\n"
    files = '[files]\nblocked_force = "blocked.csv"\n'
    columns = f"[columns.blocked_force]\n{mapping}, {offset} }}\n"
    (tmp_path / "specimen.toml").write_text(f'[specimen]\nname = "x"\n{geometry}{files}{columns}')
    rows = "\n".join(f"{1.513 + 0.5 * i},{10 * i}" for i in range(1, 20))
    (tmp_path / "blocked.csv").write_text(f"p/bar,force_N\n{rows}\n")
    blocked = read(tmp_path).blocked_force
    assert blocked is not None
    assert blocked.pressure_Pa[:2] == pytest.approx([1e5, 1.5e5])
