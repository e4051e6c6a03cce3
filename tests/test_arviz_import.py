import os
import subprocess
import sys
from pathlib import Path

import pytest

OURS = "from mpam_calib.arviz_import import import_arviz; import_arviz()"


def said(statement: str, cache: Path) -> tuple[int, str]:
    """Exit code and complaints of a fresh process whose libraries keep their notes there."""
    place = {"XDG_CACHE_HOME": str(cache), "MPLCONFIGDIR": str(cache.parent)}
    done = subprocess.run(
        [sys.executable, "-c", statement],
        env=os.environ | place,
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stderr


@pytest.mark.parametrize("writable", [True, False])
def test_arviz_comes_without_a_word_and_without_a_home(tmp_path: Path, writable: bool) -> None:
    cache = tmp_path / "cache"
    if not writable:
        cache.write_text("a file, in which no folder can be made")
    assert said(OURS, cache) == (0, "")


def test_arviz_by_itself_warns_and_needs_a_home(tmp_path: Path) -> None:
    """Why there is a function for it: the day this fails, it can go."""
    cache = tmp_path / "cache"
    code, complaint = said("import arviz", cache)
    assert code == 0
    assert "FutureWarning" in complaint
    (tmp_path / "file").write_text("")
    assert said("import arviz", tmp_path / "file")[0] != 0
