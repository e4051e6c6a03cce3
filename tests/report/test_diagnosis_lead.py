"""The first screen of a diagnosis: how sure "adequate" is."""

from __future__ import annotations

from typing import Any

import pytest
from criticism.test_hypotheses import specimen_of

from mpam_calib.report.diagnosis_lead import first_screen
from mpam_calib.report.page import Headline, Verdict

CONTENT: dict[str, Any] = {
    "verdict": "adequate",
    "causes": [],
    "misfit_before_N": 0.1,
    "misfit_after_N": 0.1,
    "noise_N": 0.2,
    "noise_assumed": False,
    "assumed_braid": None,
    "gain": None,
}


@pytest.mark.parametrize(
    ("none", "others", "level", "said"),
    [
        (0.9, [(["dead_band"], 0.05)], "good", "leaves nothing but noise: these data show no fault"),
        (0.9, [], "good", "leaves nothing but noise"),
        (0.073, [(["creep"], 0.02), (["dead_band"], 0.874)], "caution", "dead-band is 12 times as probable"),
        (0.2, [(["creep", "dead_band"], 0.5)], "caution", "together are 2.5 times as probable as none: see"),
        (0.0, [(["dead_band"], 1.0)], "caution", "dead-band is far more probable than none"),
    ],
)
def test_adequate_is_green_only_where_no_cause_is_more_probable(
    none: float, others: list[tuple[list[str], float]], level: str, said: str
) -> None:
    alternatives = [{"ids": ids, "probability": p} for ids, p in others]
    content = CONTENT | {"probability": none, "alternatives": alternatives}
    headline, verdict = first_screen(content, specimen_of("develop-null-006"))[:2]
    assert isinstance(headline, Headline) and isinstance(verdict, Verdict)
    assert verdict.level == level
    assert said in headline.html
    assert ("show no fault" in headline.html) == (level == "good")
    assert any("of no cause" in reason for reason in verdict.reasons) == (level == "caution")
