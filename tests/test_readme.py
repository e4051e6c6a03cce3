"""What the README promises: its example runs, its specimen is read, its lists are complete."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import typer
import typer.core

from mpam_calib.cli.app import app
from mpam_calib.errors import InputError
from mpam_calib.model.effect import effect, known_effects
from mpam_calib.run.predict import parse_pressures
from mpam_calib.specimen.declaration import Declaration, FileKind
from mpam_calib.specimen.tables import TABLES
from mpam_calib.specimen.toml_source import read_toml
from mpam_calib.specimen.validation import validate

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    found: list[str] = re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)
    assert len(found) == 1
    return found[0]


def test_the_example_is_short_and_runs(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ROOT)
    code = block("python")
    assert len(code.splitlines()) <= 10
    exec(code, {"__name__": "readme"})
    printed = capsys.readouterr().out
    assert printed.startswith("True\n")
    assert "E_1" in printed and "stress_Pa" in printed


def test_its_specimen_is_a_valid_one(tmp_path: Path) -> None:
    (tmp_path / "specimen.toml").write_text(block("toml"), encoding="utf-8")
    declaration = validate(read_toml(tmp_path))
    assert isinstance(declaration, Declaration)
    assert declaration.simulation.effects == ("dead_band",)


@pytest.mark.parametrize("kind", TABLES)
def test_it_lists_the_columns_that_are_read(kind: FileKind) -> None:
    (row,) = re.findall(rf"^\| {kind} \| (.*) \|$", README, flags=re.MULTILINE)
    listed = {name for part in re.findall(r"`([\w, ]+)`", row) for name in part.split(", ")}
    assert listed == {*TABLES[kind].columns, *TABLES[kind].unread}


def test_it_lists_the_commands_that_there_are() -> None:
    listed = set(re.findall(r"^\| `([a-z]+)[ `]", README, flags=re.MULTILINE))
    group = typer.main.get_command(app)
    assert isinstance(group, typer.core.TyperGroup)
    assert listed >= set(group.commands)


def test_it_names_every_effect_in_its_stage() -> None:
    chain = README[README.index("    reading (pressure") : README.index("The posterior holds")]
    lines = dict(re.findall(r"^      \d (\w+) (.*)$", chain, flags=re.MULTILINE))
    for name in known_effects():
        stage = effect(name).stage.name.lower()
        assert re.search(rf"\b{name}\b", lines[stage]), f"{name} is not in {stage}"


def test_what_it_links_to_is_there() -> None:
    links = re.findall(r"\]\(([^)#]+)\)", README)
    local = [link for link in links if "://" not in link]
    assert local and all((ROOT / link).exists() for link in local)
    packages = re.findall(r"^      ([a-z]+)/ ", README, flags=re.MULTILINE)
    there = {p.parent.name for p in (ROOT / "mpam_calib").glob("*/__init__.py")}
    assert set(packages) == there


def test_as_many_pressures_as_it_says_are_predicted_at_once() -> None:
    (most,) = re.findall(r"`predict` at .* it takes at most (\d+)\)", README)
    assert int(most) == len(parse_pressures(f"1:{most}:1"))
    with pytest.raises(InputError, match=f"more than {most} pressures"):
        parse_pressures(f"0:{most}:1")
