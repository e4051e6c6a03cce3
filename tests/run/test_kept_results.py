"""Results of diagnose and select are kept where they are those of the same data, model and options."""

from __future__ import annotations

from pathlib import Path

import pytest

from mpam_calib.run.files import KEPT_FILE
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
