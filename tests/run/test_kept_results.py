"""Results of diagnose and select are kept where they are those of the same data, model and options."""

from __future__ import annotations

from pathlib import Path

import pytest

from mpam_calib.model.blueprint import MaterialPosterior, Options
from mpam_calib.run import calibrate, diagnose, select
from mpam_calib.run.files import KEPT_FILE
from mpam_calib.run.folder import RunFolder
from mpam_calib.run.kept import Kept

FILES = ("report.html", "extended/specimen.toml")


@pytest.fixture
def kept(tmp_path: Path) -> Kept:
    (tmp_path / "extended").mkdir()
    for name in FILES:
        (tmp_path / name).write_text(name)
    return Kept(tmp_path, "diagnose", "a digest", FILES)


def test_what_was_finished_is_kept(kept: Kept) -> None:
    assert not kept.finished()
    kept.finish()
    assert kept.finished()
    assert not Kept(kept.folder, "diagnose", "another digest", FILES).finished()


def test_what_another_command_wrote_over_is_not(kept: Kept) -> None:
    kept.finish()
    (kept.folder / "report.html").write_text("another command's page")
    assert not kept.finished()


def test_what_lacks_a_file_or_was_begun_again_is_not(kept: Kept) -> None:
    kept.finish()
    (kept.folder / FILES[1]).unlink()
    assert not kept.finished()
    (kept.folder / FILES[1]).write_text(FILES[1])
    assert kept.finished()
    kept.begin()
    assert not kept.finished()


@pytest.mark.parametrize("content", ["", "[]", '{"digest": "a digest"}', "not JSON"])
def test_a_damaged_mark_keeps_nothing(kept: Kept, content: str) -> None:
    (kept.folder / KEPT_FILE).write_text(content)
    assert not kept.finished()


MATERIAL = MaterialPosterior(
    mean=(2.2e5, 6e4), covariance=((1e6, 0.0), (0.0, 1e6)), strain_range=(0.0, 1.0), convention="engineering"
)


@pytest.mark.parametrize(
    ("command", "changed"),
    [
        ("calibrate", {"seed": 1}),
        ("calibrate", {"ess_wanted": 500.0}),
        ("calibrate", {"options": Options(remainder=False)}),
        ("calibrate", {"material": MATERIAL}),
        ("select", {"seed": 1}),
        ("select", {"replicates": 4}),
        ("select", {"material": MATERIAL}),
        ("diagnose", {"seed": 1}),
        ("diagnose", {"material": MATERIAL}),
    ],
)
def test_all_that_a_result_depends_on_is_in_its_digest(
    command: str, changed: dict[str, object], muscle: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Asked for again it is kept; anything else that was asked for is other results."""
    digests: list[str] = []

    def kept_by(folder: Kept | RunFolder, *_: object) -> calibrate.Outcome:
        digests.append(folder.digest)
        return calibrate.Outcome(converged=True, kept=True)

    monkeypatch.setattr(Kept, "finished", kept_by)
    monkeypatch.setattr(calibrate, "_kept", kept_by)
    module = {"calibrate": calibrate, "select": select, "diagnose": diagnose}[command]
    for asked in ({}, {}, changed):
        options = dict(asked)
        found = options.pop("material", None)
        monkeypatch.setattr(module, "material_of", lambda _, found=found: found)
        getattr(module, f"{command}_to_folder")(muscle, tmp_path / "run", **options)
    first, again, other = digests
    assert first == again
    assert other != first
