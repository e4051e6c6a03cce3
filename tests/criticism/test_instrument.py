"""Instruments at fault: what they do is nobody's cause; a fixture that gives and friction are still named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from criticism.found import search
from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.diagnose import told_of
from mpam_calib.criticism.searching.searched import Search
from mpam_calib.criticism.unexplained.instrument import FAULT, LATE, PLAY, instrument_rival
from mpam_calib.criticism.verdict import judge
from mpam_calib.model.effect import known_effects

from .cases import problem_of, specimen_of

Array = NDArray[np.float64]
RIVALS = ("rig_compliance", "wall_pressure", "braid_stretch", "dead_band")


def all_the_way(force: Array) -> Array:
    """Hyperbolic tangent: a twelfth lost at twice the typical force."""
    most = 2.0 * force.max()
    return np.asarray(most * np.tanh(force / most))


def at_the_top(force: Array) -> Array:
    """Straight for three quarters of the readings, then towards a ceiling."""
    knee = np.quantile(force, 0.75)
    room = force.max() - knee
    return np.where(force > knee, knee + room * np.tanh((force - knee) / room), force)


def below_a_ceiling(force: Array) -> Array:
    """Softly cut off."""
    ceiling, width = np.quantile(force, 0.94), 0.03 * force.max()
    return np.asarray(ceiling - width * np.logaddexp(0.0, (ceiling - force) / width))


def through(cell: Callable[[Array], Array], name: str, tested: tuple[str, ...]) -> Search:
    """A search of a rig's test that was recorded through a cell."""
    specimen = specimen_of(name)
    assert specimen.loops is not None
    loops = replace(specimen.loops, force_N=cell(specimen.loops.force_N))
    return search(problem_of(replace(specimen, loops=loops)), tested)


@pytest.mark.parametrize(
    ("cell", "name"),
    [
        (all_the_way, "develop-null-001"),
        pytest.param(at_the_top, "develop-null-010", marks=pytest.mark.long),
        pytest.param(below_a_ceiling, "develop-null-010", marks=pytest.mark.long),
    ],
)
def test_a_cell_that_saturates_softly_is_no_cause(cell: Callable[[Array], Array], name: str) -> None:
    """Nothing is hidden; a search without this rival names a fixture that gives, or two causes and three."""
    verdict = judge(through(cell, name, RIVALS))
    assert verdict.leading
    assert (verdict.word, verdict.standing) == ("unexplained", frozenset())
    assert verdict.instrument is not None
    assert verdict.instrument.lead > 10.0


def test_a_cause_beside_the_cell_stands() -> None:
    """Creep, which no function of the force imitates, is still named beside it."""
    found = through(all_the_way, "develop-separable-012", ("creep", *RIVALS[:2]))
    verdict = judge(found)
    assert verdict.word == "unexplained"
    assert verdict.standing <= {"creep"}
    assert instrument_rival(found, verdict.leading).beside == {"creep"}


@pytest.mark.parametrize(
    ("name", "truth"),
    [
        ("develop-separable-039", {"rig_compliance"}),
        pytest.param("develop-separable-015", {"dead_band"}, marks=pytest.mark.long),
    ],
)
def test_a_fixture_that_gives_is_no_load_cell(name: str, truth: set[str]) -> None:
    found = through(lambda force: force, name, RIVALS)
    verdict = judge(found)
    assert (verdict.word, verdict.standing, verdict.instrument) == ("named", truth, None)
    assert instrument_rival(found, verdict.leading).lead < -10.0


@pytest.mark.parametrize(
    ("name", "zero"),
    [
        ("develop-null-007", False),
        pytest.param("develop-null-001", True, marks=pytest.mark.long),
        pytest.param("develop-null-001", False, marks=pytest.mark.long),
        pytest.param("develop-null-007", True, marks=pytest.mark.long),
    ],
)
def test_a_cell_s_zero_or_gain_at_one_level_is_no_crosshead_s(name: str, zero: bool) -> None:
    """Ten times the noise, constant over one level's readings or in proportion to them."""
    specimen = specimen_of(name)
    loops = specimen.loops
    assert loops is not None
    off = 10.0 * problem_of(specimen).noise_level.total * (loops.level == 1)
    if not zero:
        here = loops.force_N[loops.level == 1]
        off = -off * loops.force_N / np.sqrt(np.mean(here**2))
    problem = problem_of(replace(specimen, loops=replace(loops, force_N=loops.force_N + off)))
    verdict = judge(search(problem, ("length_offset", *RIVALS)))
    assert (verdict.word, verdict.standing) == ("unexplained", frozenset())


OPENING = ("presliding", "rate_friction", "creep")
"""Causes that open a loop, or that time tells."""


def told_where_no_cause_stands(problem: Problem, tested: tuple[str, ...]) -> dict[str, Any]:
    """The instrument at fault, where causes lead and none of them stands."""
    verdict = judge(search(problem, tested))
    assert verdict.leading
    assert (verdict.word, verdict.standing) == ("unexplained", frozenset())
    setting = problem.model.setting
    assert setting is not None
    told = told_of(verdict.instrument, setting, 1)
    assert told is not None
    return told


@pytest.mark.parametrize(("name", "delay"), [("develop-null-016", 0.1), ("develop-null-011", 0.3)])
def test_a_cell_that_is_read_late_is_no_friction(name: str, delay: float) -> None:
    """Nothing is hidden, and each force is that of some tenths of a second before."""
    specimen = specimen_of(name)
    loops = specimen.loops
    assert loops is not None
    late = loops.force_N.copy()
    for level in np.unique(loops.level):
        here = loops.level == level
        late[here] = np.interp(loops.time_s[here] - delay, loops.time_s[here], loops.force_N[here])
    problem = problem_of(replace(specimen, loops=replace(loops, force_N=late)))
    told = told_where_no_cause_stands(problem, ("rate_friction", "pressure_droop"))
    assert told["fault"] == LATE
    assert told["parameters"]["cell_delay_s"]["mean"] == pytest.approx(delay, rel=0.2)


def lagging(way: Array, low: float, high: float) -> Array:
    """What a pointer shows that is dragged ``low`` behind on the way forth and ``high`` ahead on it back."""
    shown = np.empty(len(way))
    at = 0.0
    for i, true in enumerate(way):
        at = min(max(at, true - low), true + high)
        shown[i] = at
    return shown


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("develop-null-016", 0.03, 0.0),
        pytest.param("develop-null-011", 0.01, 0.01, marks=pytest.mark.long),
    ],
)
def test_a_gauge_with_play_is_no_friction(name: str, low: float, high: float) -> None:
    """Nothing is hidden; the play is told by shares of the largest stroke."""
    specimen = specimen_of(name)
    loops = specimen.loops
    assert loops is not None
    stroke = loops.displacement_m.max()
    shown = lagging(loops.displacement_m, low * stroke, high * stroke)
    problem = problem_of(replace(specimen, loops=replace(loops, displacement_m=shown)))
    told = told_where_no_cause_stands(problem, ("strand_friction", "presliding", "length_offset"))
    assert told["fault"] == PLAY
    assert told["parameters"]["play_mm"]["mean"] == pytest.approx(1e3 * (low + high) * stroke, rel=0.2)


@pytest.mark.parametrize(
    ("name", "truth"),
    [
        ("develop-separable-036", {"presliding"}),
        pytest.param("develop-separable-033", {"rate_friction"}, marks=pytest.mark.long),
    ],
)
def test_what_opens_a_loop_is_no_instrument(name: str, truth: set[str]) -> None:
    found = search(problem_of(specimen_of(name)), OPENING)
    verdict = judge(found)
    assert (verdict.word, verdict.standing, verdict.instrument) == ("named", truth, None)
    assert instrument_rival(found, verdict.leading).lead < -10.0


def test_the_faults_are_no_effects_that_a_specimen_may_declare() -> None:
    assert not {FAULT, LATE} & set(known_effects())
