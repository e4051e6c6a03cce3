"""Measurements that the diagnosis page asks for: none that was made already."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from model import build

from mpam_calib.model import effect as registry
from mpam_calib.model.effect import effect, known_effects
from mpam_calib.report.blocks import Block, DataTable, Text
from mpam_calib.report.diagnosis import _alternatives, _limits
from mpam_calib.report.measurements import STAND_IN, TOO_SMALL, not_tested, shown_by, telling, too_small

ORDER = "order_too_low"
TEST = effect(ORDER).told_by


def words_of(blocks: list[Block]) -> str:
    return " ".join(
        str(cell) for block in blocks if isinstance(block, DataTable) for row in block.rows for cell in row
    )


@pytest.mark.parametrize(
    ("test", "moduli", "tested"),
    [(None, "loops", False), (object(), "loops", True), (None, "run:../material_run", True)],
)
def test_a_tensile_test_is_asked_for_where_there_is_none(test: object, moduli: str, tested: bool) -> None:
    """Nor where the moduli are those of a run with one."""
    specimen: Any = SimpleNamespace(tensile=test, simulation=SimpleNamespace(moduli=moduli))
    assert (shown_by(ORDER, specimen) == TEST) != tested
    assert (telling({ORDER}, set(), specimen, {}) == TEST) != tested
    assert telling(set(), set(), specimen, {ORDER: 0.9}) == ""
    content: dict[str, Any] = {
        "verdict": "ambiguous",
        "causes": [],
        "alternatives": [{"ids": [ORDER], "probability": 0.1}],
        "not_tested": [{"id": ORDER, "why": "one level"}],
        "limits": [{"id": ORDER, "parameters": {"next_order": {"q05": -0.1, "q95": 0.1}}}],
    }
    found: Any = SimpleNamespace(verdict=SimpleNamespace(near=lambda: 1, likeliest=lambda: 1, marginals={}))
    parameter: Any = SimpleNamespace(prior=SimpleNamespace(from_normal=abs), printed_unit="")
    pages = (
        _alternatives(content, found, specimen),
        _limits(content, {"next_order": parameter}, specimen),
        not_tested(content, specimen),
    )
    for blocks in pages:
        assert (TEST in words_of(blocks)) != tested
        assert ("the tensile test, fitted at a higher order" in words_of(blocks)) == tested


def test_what_tells_sets_apart_is_of_the_likeliest_effect_in_which_they_differ() -> None:
    specimen: Any = SimpleNamespace()
    marginals = {"creep": 0.4, "rate_friction": 0.9, "tip_shape": 1.0}
    one, other = {"creep", "tip_shape"}, {"rate_friction", "tip_shape"}
    for pair in ((one, other), (other, one)):
        assert telling(*pair, specimen, marginals) == effect("rate_friction").told_by
        assert telling(*pair, specimen, marginals | {"creep": 0.95}) == effect("creep").told_by
        assert telling(*pair, specimen, {}) == effect("creep").told_by


@pytest.mark.parametrize(("size", "small"), [(0.02, True), (0.6, False)])
def test_a_size_that_the_measurement_would_not_tell_is_not_sent_there(size: float, small: bool) -> None:
    specimen: Any = SimpleNamespace()
    photograph = effect("braid_angle").told_by
    band = {"delta_alpha_deg": {"mean": 0.0, "sd": size, "q05": -size, "q95": 0.5 * size}}
    content: dict[str, Any] = {
        "verdict": "named",
        "causes": [{"id": "braid_angle", "parameters": band}],
        "alternatives": [{"ids": ["creep"], "probability": 0.1}],
        "limits": [{"id": "braid_angle", "parameters": band}],
        "not_tested": [],
    }
    verdict = SimpleNamespace(near=lambda: 1, likeliest=lambda: 1, marginals={"braid_angle": 0.9})
    found: Any = SimpleNamespace(verdict=verdict)
    parameter: Any = SimpleNamespace(prior=SimpleNamespace(from_normal=abs), printed_unit="deg")
    for blocks, instead in (
        (_alternatives(content, found, specimen), effect("creep").told_by),
        (_limits(content, {"delta_alpha_deg": parameter}, specimen), TOO_SMALL),
    ):
        assert (photograph in words_of(blocks)) != small
        assert (instead in words_of(blocks)) == small
    assert telling({"braid_angle"}, set(), specimen, {}, {"braid_angle"}) == TOO_SMALL


def test_an_effect_from_outside_says_what_its_measurement_tells(monkeypatch: pytest.MonkeyPatch) -> None:
    """In SI, where its band is in printed units; of one that says nothing no size is too small."""
    item = replace(effect("creep"), id="grip", told_by="a dial gauge", resolution={"grip_mm": 2e-5})
    monkeypatch.setitem(registry._REGISTRY, "grip", item)
    band = {"mean": 0.0, "sd": 0.01, "q05": -0.015, "q95": 0.01}
    assert too_small("grip", {"grip_mm": band})
    assert not too_small("grip", {"grip_mm": band | {"q95": 0.021}})
    assert not too_small("grip", {"other_mm": band})
    assert not too_small("creep", {"creep_per_decade": band})


def test_what_a_measurement_tells_is_a_size_of_its_effect() -> None:
    setting: Any = build.blueprint({}).setting()
    for identifier in known_effects():
        item = effect(identifier)
        assert set(item.resolution) <= {p.name for p in item.parameters(setting)}, identifier
        assert item.told_by or not item.resolution, identifier


def test_another_speed_is_asked_for_however_many_there_are() -> None:
    """One is too few to test for the speed; three may be there already."""
    assert not re.search("second|third", effect("rate_friction").told_by)


@pytest.mark.parametrize(
    ("forces", "stopped"), [(None, False), ([8.0, 40.0], False), ([0.4, 8.0, 40.0], True)]
)
def test_blocked_forces_down_to_nothing_are_asked_for_once(forces: list[float] | None, stopped: bool) -> None:
    pulls = None if forces is None else np.array(forces)
    readings = None if pulls is None else SimpleNamespace(force_N=pulls, censored=pulls < 0.0)
    specimen: Any = SimpleNamespace(blocked_force=readings)
    asked = shown_by("dead_band", specimen)
    assert (asked == effect("dead_band").told_by) != stopped
    assert asked.startswith("more readings of the blocked force") == stopped


@pytest.mark.parametrize("loops", [None, object()])
def test_no_loop_is_to_be_repeated_where_there_is_none(loops: object) -> None:
    specimen: Any = SimpleNamespace(loops=loops)
    assert ("the same loop" in shown_by("pressure_droop", specimen)) == (loops is not None)


@pytest.mark.parametrize("verdict", ["adequate", "named", "ambiguous", "unexplained"])
def test_a_cause_may_stand_in_for_one_that_is_not_tested(verdict: str) -> None:
    specimen: Any = SimpleNamespace(blocked_force=None)
    silent = [{"id": "dead_band", "why": "1 pressure level"}]
    blocks = not_tested({"verdict": verdict, "not_tested": silent}, specimen)
    assert isinstance(blocks[-1], DataTable)
    told = [b.html for b in blocks if isinstance(b, Text)]
    assert told == ([] if verdict == "adequate" else [STAND_IN])
