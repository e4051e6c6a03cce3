"""Bent forms: the share of an effect changes by a few per cent to a fifth, and never its sign."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from .bending import LARGEST, STRENGTH, bending
from .case import record
from .chain import force_of
from .protocol import record_rows
from .recipes import build_case
from .sets import recipes

NAMES = ("creep", "dead_band", "force_drift", "tip_shape", "rate_friction")


@pytest.mark.parametrize("effect", NAMES)
@pytest.mark.parametrize("turn", [1, 2])
def test_a_share_is_bent_and_keeps_its_size_and_sign(effect: str, turn: int) -> None:
    recipe = next(r for r in recipes("develop") if effect in [w.id for w in r.effects])
    case = build_case(replace(recipe, effects=tuple(w for w in recipe.effects if w.id == effect)))
    rows = record_rows(case.protocol, case.muscle, case.seed)
    share = force_of(case.muscle, rows, case.effects, seed=case.seed) - force_of(case.muscle, rows)
    added = bending(case.muscle, rows, case.effects, case.seed, turn)
    acting = np.abs(share) > 1e-6 * np.abs(share).max()
    assert np.all(np.abs(added[acting] / share[acting]) < LARGEST)
    assert abs(share @ added) < 0.03 * (share @ share)
    strength = float(np.sqrt(np.sum(added**2) / np.sum(share**2)))
    assert 0.7 * STRENGTH[0] < strength <= STRENGTH[1]


def test_it_is_the_same_each_time_and_another_for_each_turn() -> None:
    case = build_case(next(r for r in recipes("develop") if len(r.effects) == 2))
    once, again, other = (record(replace(case, bent=turn)) for turn in (1, 1, 2))
    np.testing.assert_array_equal(once.force, again.force)
    assert np.abs(once.force - other.force).max() > 0.0
    assert np.abs(once.true_force - record(case).true_force).max() > 0.0


def test_what_is_one_or_the_other_is_not_bent() -> None:
    recipe = next(r for r in recipes("develop") if [w.id for w in r.effects] == ["braid_kinematics"])
    case = build_case(recipe)
    rows = record_rows(case.protocol, case.muscle, case.seed)
    np.testing.assert_array_equal(bending(case.muscle, rows, case.effects, case.seed, 1), 0.0)
