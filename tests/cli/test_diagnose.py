"""The line that ``diagnose`` prints, where its verdict's word alone would say too much."""

from __future__ import annotations

from typing import Any

import pytest

from mpam_calib.cli.diagnose import verdict_line


@pytest.mark.parametrize(
    ("verdict", "causes", "others", "line"),
    [
        ("adequate", [], [(["dead_band"], 0.05)], "adequate"),
        ("adequate", [], [], "adequate"),
        (
            "adequate",
            [],
            [(["creep"], 0.1), (["creep", "dead_band"], 0.6)],
            "adequate, with a doubt: creep and dead_band more probable than no cause",
        ),
        ("named", ["creep", "dead_band"], [(["creep"], 0.5)], "named: creep, dead_band"),
        ("unexplained", [], [(["braid_angle"], 0.96)], "unexplained"),
        ("unexplained", ["creep"], [], "unexplained even with creep"),
    ],
)
def test_the_line_says_no_more_than_the_data_do(
    verdict: str, causes: list[str], others: list[tuple[list[str], float]], line: str
) -> None:
    said: dict[str, Any] = {
        "verdict": verdict,
        "probability": 0.2,
        "causes": [{"id": cause} for cause in causes],
        "alternatives": [{"ids": ids, "probability": p} for ids, p in others],
    }
    assert verdict_line(said) == line
