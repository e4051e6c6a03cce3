"""``simulate --hide``: what may be hidden, and that a refusal writes nothing."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from .command import Here


@pytest.mark.parametrize(
    "hide",
    ["dead_band=nan", "dead_band=inf", "dead_band=-1e9", "braid_angle=60", "length_offset=1e4"],
)
def test_sizes_that_no_rig_has_are_refused(hide: str, muscle: Path, tmp_path: Path, here: Here) -> None:
    result = here("simulate", muscle, "-o", tmp_path / "made", "--hide", hide)
    assert result.code == 2
    assert result.complaint.startswith(f"error: --hide: found {hide.partition('=')[0]}=")
    assert "expected between " in result.complaint
    assert not (tmp_path / "made").exists()


def test_a_size_that_a_rig_may_have_is_hidden_and_told(muscle: Path, tmp_path: Path, here: Here) -> None:
    assert here("simulate", muscle, "-o", tmp_path / "made", "--hide", "dead_band=7.5").code == 0
    truth = json.loads((tmp_path / "made" / "truth.json").read_text())
    assert truth["hidden"]["dead_band"] == {"P_DB_kPa": 7.5}
