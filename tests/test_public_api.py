"""The public names, and an effect that another package brings along."""

from __future__ import annotations

import inspect
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import mpam_calib

ROOT = Path(__file__).resolve().parents[1]

NAMES = [
    "Calibration",
    "Effect",
    "HalfLongTailed",
    "HalfNormal",
    "InputError",
    "Interrupted",
    "LogNormal",
    "LogUniform",
    "LongTailed",
    "MpamError",
    "Normal",
    "Parameter",
    "Simulated",
    "Specimen",
    "Stage",
    "Uniform",
    "__version__",
    "calibrate",
    "known_effects",
    "read",
    "register",
    "simulate",
]
"""What users may rely on: a name leaves this list with a new major version only."""


def test_the_names_are_these_and_all_of_them_are_there() -> None:
    assert mpam_calib.__all__ == NAMES
    assert all(getattr(mpam_calib, name) is not None for name in NAMES)
    assert set(NAMES) <= set(dir(mpam_calib))


def test_every_public_thing_says_what_it_is() -> None:
    assert all(getattr(mpam_calib, name).__doc__ for name in NAMES if name != "__version__")


def test_a_name_that_is_not_there() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'callibrate'"):
        _ = mpam_calib.callibrate


def test_importing_the_package_imports_nothing_heavy() -> None:
    code = (
        "import sys, mpam_calib; print(*{'numpy', 'pandas', 'scipy', 'arviz', 'pydantic'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def howto_module() -> str:
    """The example module of docs/add_an_effect.md."""
    text = (ROOT / "docs" / "add_an_effect.md").read_text(encoding="utf-8")
    blocks: list[str] = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    return blocks[0]


def test_the_how_to_names_the_priors_arguments_as_they_are() -> None:
    text = (ROOT / "docs" / "add_an_effect.md").read_text(encoding="utf-8")
    written = re.findall(r"`([A-Z]\w+)\(([a-z_, ]+)\)`", text)
    assert {"Normal", "LogNormal", "Uniform"} <= {name for name, _ in written}
    for name, arguments in written:
        found = inspect.signature(getattr(mpam_calib, name)).parameters.values()
        assert arguments.split(", ") == [one.name for one in found if one.default is one.empty], name


def test_an_installed_package_brings_its_effect_to_the_command_line(tmp_path: Path) -> None:
    """The how-to's module, installed as its text says, is known to ``check`` and hidden by ``simulate``."""
    site = tmp_path / "site"
    info = site / "room_effects-1.0.dist-info"
    info.mkdir(parents=True)
    (site / "room_effects.py").write_text(howto_module(), encoding="utf-8")
    (info / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: room-effects\nVersion: 1.0\n", encoding="utf-8"
    )
    (info / "entry_points.txt").write_text("[mpam_calib.effects]\nroom = room_effects\n", encoding="utf-8")
    folder = tmp_path / "muscle"
    folder.mkdir()
    (folder / "specimen.toml").write_text(MUSCLE, encoding="utf-8")

    def run(*arguments: str, path: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "mpam_calib", *arguments]
        environment = {**os.environ, "PYTHONPATH": path}
        return subprocess.run(command, capture_output=True, text=True, env=environment, check=False)

    known = run("check", str(folder), path=str(site))
    assert known.returncode == 0, known.stderr
    unknown = run("check", str(folder), path="")
    assert unknown.returncode == 2
    assert "room_temperature" in unknown.stderr
    plain = MUSCLE.replace('["room_temperature"]', "[]")
    (folder / "specimen.toml").write_text(plain, encoding="utf-8")
    hide = ("--hide", "room_temperature=2.5", "-o", str(tmp_path / "made"))
    made = run("simulate", str(folder), *hide, path=str(site))
    assert made.returncode == 0, made.stderr
    assert '"zero_swing_N": 2.5' in (tmp_path / "made" / "truth.json").read_text(encoding="utf-8")


MUSCLE = """
[specimen]
name = "M"
bladder_material = "Ecoflex 00-50"

[geometry]
L0_mm = 50.0
R0_mm = 3.0
t0_mm = 0.7
alpha0_deg = 72.0

[simulation]
kinematics = "inextensible_braid"
strain = "engineering"
friction = "coulomb"
effects = ["room_temperature"]
moduli = "tensile"
E_Pa = [4.0e4, 2.6e4]
E_rel_sd = 0.1
order = 2
law = "constant"
"""
