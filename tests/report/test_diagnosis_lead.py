"""The first screen of a diagnosis: how sure "adequate" is, and what a load cell leaves open."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from criticism.cases import problem_of, specimen_of

from mpam_calib.criticism.fitting.fit import fit
from mpam_calib.criticism.unexplained.instrument import FAULT, PLAY
from mpam_calib.report.blocks import Figure, Headline, Verdict
from mpam_calib.report.diagnosis import _budget, _compared, _markers
from mpam_calib.report.diagnosis_lead import first_screen
from mpam_calib.report.figures.misfit import residual_maps

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


UNEXPLAINED: dict[str, Any] = CONTENT | {
    **dict.fromkeys(("saturated_share", "repeating_N", "bursts_N", "hum_N", "step_N", "chatter_N"), 0.0),
    "verdict": "unexplained",
    "misfit_before_N": 1.3,
    "misfit_after_N": 1.3,
    "remainder_N": 2.0,
    "left_N": 2.0,
    "read_N": (0.0, 50.0),
    "trace": None,
    "alternatives": [],
    "probability": 0.0,
    "leading": {"ids": ["braid_angle"], "probability": 0.964},
}
CREEP = {"id": "creep", "probability": 0.99, "within_declared_uncertainty": False}


@pytest.mark.parametrize(
    ("fault", "nats", "left", "causes", "headline", "verdict"),
    [
        (FAULT, -2.3, False, [], "a wrong simulation from a load cell at", "braid angle, or a load cell"),
        (PLAY, -2.3, False, [], "a wrong simulation from a displacement", "braid angle, or a displacement"),
        (FAULT, -2.3, True, [], "in a way that no known set of causes removes", "no cause stands by itself"),
        (FAULT, None, True, [], "in a way that no known set of causes removes", "no cause stands by itself"),
        (FAULT, 9.0, False, [], "A load cell at fault explains these data", "Unexplained: a load cell at"),
        (
            PLAY,
            9.0,
            False,
            [],
            "A displacement gauge at fault explains",
            "Unexplained: a displacement gauge at",
        ),
        (FAULT, -2.3, False, [CREEP], "but these data cannot tell all", "Unexplained even with creep."),
    ],
)
def test_a_set_that_only_an_instrument_rivals_is_told(
    fault: str, nats: float | None, left: bool, causes: list[dict[str, Any]], headline: str, verdict: str
) -> None:
    size = {"cell_knee_N": {"mean": 3.6}, "play_mm": {"mean": 0.8}}
    at_fault = None if nats is None else {"fault": fault, "nats": nats, "parameters": size}
    content = UNEXPLAINED | {"instrument": at_fault, "left": left, "causes": causes}
    said, box = first_screen(content, specimen_of("develop-null-006"))[:2]
    assert isinstance(said, Headline) and isinstance(box, Verdict)
    assert headline in said.html and verdict in box.sentence
    assert any("leaves nothing beyond the noise: braid angle" in r for r in box.reasons) == (not left)


@pytest.mark.parametrize(
    ("standing", "leading", "second"),
    [
        (["creep"], ["creep", "dead_band"], ["with the causes named"]),
        ([], ["creep"], ["with the likeliest set, which is not named"]),
        ([], [], []),
    ],
)
def test_residuals_are_drawn_of_what_their_titles_say(
    standing: list[str], leading: list[str], second: list[str]
) -> None:
    found: Any = SimpleNamespace(
        verdict=SimpleNamespace(standing=frozenset(standing), leading=frozenset(leading)),
        search=SimpleNamespace(fits={(frozenset(leading), 0): None}),
    )
    compared = _compared(found)
    assert list(compared) == ["declared simulation", *second]
    place, same = np.linspace(0.0, 0.3, 20), np.ones(20)
    figure = residual_maps(place, same, np.repeat([5.0, 9.0], 10), dict.fromkeys(compared, same), 1.0)
    assert [ax.get_title(loc="left") for ax in figure.axes] == list(compared)
    (last,) = ([text.get_text() for text in ax.texts] for ax in figure.axes if ax.texts)
    assert last == ["9 kPa", "5 kPa"]  # which colour is which level


def test_captions_say_what_the_figures_show() -> None:
    """Bars of causes only where there are any, and the markers that are drawn."""
    problem = problem_of(specimen_of("develop-null-006"))
    none = frozenset[str]()
    found: Any = SimpleNamespace(
        problem=problem,
        search=SimpleNamespace(fits={(none, 0): fit(problem, none, 0)}),
        verdict=SimpleNamespace(standing=none, leading=none),
    )
    cause = {"id": "creep", "share_of_misfit": 0.6}
    for causes in ([], [cause]):
        bars, residuals = _budget(found, CONTENT | {"causes": causes})
        assert isinstance(bars, Figure) and isinstance(residuals, Figure)
        # A tiny braid angle may have two fifths of a creep's newtons, as it could stand in for it.
        assert ("what either of two could explain by itself is shared" in bars.caption) == bool(causes)
        assert residuals.caption.endswith(" Triangles up: loading, down: unloading.")
    assert _markers(np.array([1.0, 0.0])).endswith("circles: neither.")
    assert _markers(np.zeros(3)) == ""


@pytest.mark.parametrize(
    ("rivals", "more"),
    [
        ([(["creep", "force_drift"], 0.007), (["dead_band"], 1e-6)], True),
        ([(["creep", "force_drift"], 0.007), (["dead_band"], 0.008)], False),
        ([(["creep"], 0.3), (["dead_band"], 0.1)], False),
        ([(["creep", "force_drift"], 0.001)], False),  # many of these, all far behind
    ],
)
def test_causes_that_every_rival_holds_are_not_said_to_be_confused(
    rivals: list[tuple[list[str], float]], more: bool
) -> None:
    """What no rival is without, and another that may be there as well, are not several of which one is."""
    content = CONTENT | {
        "verdict": "ambiguous",
        "causes": [CREEP] if rivals[0][0] != ["creep"] else [CREEP, CREEP | {"id": "braid_angle"}],
        "probability": 0.98,
        "alternatives": [{"ids": ids, "probability": p} for ids, p in rivals],
    }
    headline = first_screen(content, specimen_of("develop-null-006"))[0]
    assert isinstance(headline, Headline)
    assert ("whether more is wrong than is named" in headline.html) == more
    assert ("cannot tell several causes apart" in headline.html) != more
