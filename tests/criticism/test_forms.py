"""Whether a cause's forms can hold the curves that another author would have written for it.

A cause that moves the force by five times the noise is recorded in each of these curves
(``rig/effects/textbook`` and the develop set's own) and fitted by the forms of that cause alone. What its
best form leaves, in nats, is what further causes would be named for.
"""

from __future__ import annotations

import random
from dataclasses import replace

import numpy as np
import pytest
from rig import case as rig_case
from rig import effects, recipes, sets
from rig.effects import textbook
from rig.recipes import Recipe, Wanted

from criticism.cases import problem_of, read_case
from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.fitting.fit import fit
from mpam_calib.criticism.fitting.forms import forms_of
from mpam_calib.criticism.searching.searched import STARTS
from mpam_calib.model.effect import effect

NATS = 20.0
"""Misfit of noise-free curves (half the whitened sum of squares) that a doubt of some percent covers."""
WORSE = {("braid_stretch", "crimped"): 100.0, ("order_too_low", "hinge"): 25.0}
"""Curves that the forms do not hold so well, and what they leave at most: crimped strands straighten, and a
wall whose stress sets in at a strain is bent there."""
QUIET = 1e-4
SAMPLE = (
    ("tip_shape", "cap"),
    ("pressure_droop", "smoothstep"),
    ("stress_softening", "inverse"),
    ("rate_friction", "dashpot"),
    ("force_drift", "returning"),
    ("coulomb_friction", "with_contraction"),
)
EVERY = [(f.id, f.name) for f in textbook.FORMS] + [
    (identifier, name)
    for identifier, names in sets.DEVELOP_HALF.other.items()
    if identifier != "braid_kinematics"
    for name in names
]


def _problem(one: rig_case.Case) -> Problem:
    return problem_of(read_case(one))


def _recorded(identifier: str, name: str) -> Problem:
    """A muscle with this cause: the noise of the rig, and the force without it."""
    rng = random.Random(f"{identifier}-{name}")
    wanted = Wanted(identifier, name, 5.0, 1)
    recipe = Recipe(
        name="textbook", seed=rng.getrandbits(40), group="separable", design="tensile",
        family=rng.choice(sets.DEVELOP_HALF.families), moduli="tensile", levels=6, cycles=3, speeds=2,
        rows_max=3000, effects=(wanted,),
    )  # fmt: skip
    suited = {k: v for k, v in sets._suited((wanted,), rng).items() if k in ("friction", "kinematics")}
    one = recipes.build_case(replace(recipe, **suited))
    p = one.protocol
    quiet = replace(p, noise_N=QUIET * p.noise_N, correlated_N=QUIET * p.correlated_N)
    loud, clean = _problem(one), _problem(replace(one, protocol=quiet))
    np.testing.assert_allclose(loud.readings.displacement, clean.readings.displacement, rtol=1e-12)
    return loud.with_force(clean.force)


def left(identifier: str, name: str) -> float:
    """Nats of misfit under the best of the cause's forms."""
    problem = _recorded(identifier, name)
    assert problem.model.setting is not None
    own = [p.name for p in effect(identifier).parameters(problem.model.setting)]
    found = []
    for form in forms_of(identifier):
        for start in ({}, *(dict.fromkeys(own, value) for value in STARTS)):
            found.append(0.5 * fit(problem, frozenset([form]), 0, start).chi2)
    return min(found)


@pytest.mark.parametrize(("identifier", "name"), SAMPLE)
def test_curves_of_another_author(identifier: str, name: str) -> None:
    assert left(identifier, name) < WORSE.get((identifier, name), NATS)


@pytest.mark.long
@pytest.mark.parametrize(("identifier", "name"), [pair for pair in EVERY if pair not in SAMPLE])
def test_every_curve_of_another_author(identifier: str, name: str) -> None:
    assert left(identifier, name) < WORSE.get((identifier, name), NATS)


def test_neither_develop_nor_locked_uses_them() -> None:
    names = {(f.id, f.name) for f in textbook.FORMS}
    for half in (sets.DEVELOP_HALF, sets.LOCKED_HALF):
        assert not names & {(i, n) for i, forms in half.other.items() for n in forms}
    assert names <= set(effects.FORMS)
