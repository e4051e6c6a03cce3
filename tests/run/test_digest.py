"""What makes a kept RUN an old one: other code, and other effects where they can come into the result."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

from mpam_calib.model import effect as registry
from mpam_calib.model.effect import known_effects
from mpam_calib.run import folder as run_folder
from mpam_calib.specimen import effect_ids, read


def test_other_code_is_another_digest(
    material: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    specimen = read(material)
    monkeypatch.setattr(run_folder, "PACKAGE", tmp_path)
    (tmp_path / "law.py").write_text("E = 1\n")
    before = run_folder.run_digest(specimen, seed=0)
    assert run_folder.run_digest(specimen, seed=0) == before
    (tmp_path / "law.py").write_text("E = 2\n")
    assert run_folder.run_digest(specimen, seed=0) != before


GRIP = """
from mpam_calib import Effect, Normal, Parameter, Stage, register

def parameters(setting):
    return (Parameter("grip_mm", Normal(0.0, 1e-4), "slip of the grip"),)

def apply(state, values, setting):
    return state._replace(displacement=state.displacement - values["grip_mm"])

register(
    Effect("grip_slip", Stage.RIG, "Slip", "the grip slips", "a test", parameters, apply, bends={"time": 1})
)
"""


@pytest.fixture
def grip(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A laboratory's module with an effect of its own, not yet imported."""
    module = tmp_path / "own_grip.py"
    module.write_text(GRIP)
    monkeypatch.syspath_prepend(tmp_path)
    yield module
    registry._REGISTRY.pop("grip_slip", None)
    effect_ids._added.pop("grip_slip", None)
    sys.modules.pop("own_grip", None)


@pytest.mark.parametrize("form", ["", ":bent"])
def test_a_further_effects_package_counts_where_its_effects_can(muscle: Path, grip: Path, form: str) -> None:
    """In a search they all do; elsewhere those that are declared, and the text of their module."""

    def digests(source: Path) -> tuple[str, str]:
        specimen = read(source)
        return run_folder.run_digest(specimen), run_folder.run_digest(specimen, searched=known_effects())

    before = digests(muscle)
    import_module("own_grip")
    plain, searched = digests(muscle)
    assert plain == before[0]
    assert searched != before[1]
    specimen = Path(shutil.copytree(muscle, grip.parent / "gripped"))
    declaration = specimen / "specimen.toml"
    text = declaration.read_text()
    assert "effects = " not in text
    declaration.write_text(text.replace("[simulation]", f'[simulation]\neffects = ["grip_slip{form}"]'))
    declared = digests(specimen)
    grip.write_text(GRIP.replace("1e-4", "2e-4"))
    assert digests(muscle)[0] == plain and digests(muscle)[1] != searched
    assert all(one != other for one, other in zip(digests(specimen), declared, strict=True))
