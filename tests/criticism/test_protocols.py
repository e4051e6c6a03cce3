"""Whether the search holds the textbook causes however the rig was driven: no noise, their own equations.

What a turn, a rest, a change of speed or few readings leave between the rig's rows and the reduced ones is
misfit for which other causes would be named.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from rig import case as rig_case
from rig import recipes
from rig.effects import shared_form
from rig.recipes import Recipe, Wanted

from criticism.cases import problem_of, read_case
from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.fitting.fit import fit
from mpam_calib.criticism.fitting.forms import forms_of

MULTIPLE = 5.0
"""Times the noise by which the cause moves the force."""
NATS = 20.0
"""Misfit (half the whitened sum of squares) that is left at most."""
QUIET = 1e-4
DRIVEN: dict[str, dict[str, Any]] = {
    "two speeds": {},
    "gently": {"motion": "sine"},
    "with dwells": {"dwell": True},
    "gently, with dwells": {"motion": "sine", "dwell": True},
    "few readings": {"rows_max": 800},
    "one speed": {"speeds": 1, "cycles": 2},
}
WRITTEN = ("", "levels reversed", "no branch")
CAUSES = (None, "rate_friction", "presliding", "creep", "stress_softening", "force_drift", "rig_compliance")
SAMPLE = (
    (None, "strand", "gently, with dwells", "no branch"),
    (None, "coulomb", "with dwells", "no branch"),
    ("rate_friction", "strand", "with dwells", ""),
    ("presliding", "strand", "two speeds", ""),
    ("presliding", "coulomb", "gently, with dwells", "levels reversed"),
    ("stress_softening", "strand", "few readings", ""),
    ("creep", "strand", "one speed", "no branch"),
)


def _speaks(cause: str | None, driven: str) -> bool:
    """A cause of speed needs two, and the rig's own law changes sign where a crosshead nearly stands."""
    return cause != "rate_friction" or not ("gently" in driven or driven == "one speed")


EVERY = [c for c in product(CAUSES, ("coulomb", "strand"), DRIVEN, WRITTEN) if _speaks(c[0], c[2])]


def _problem(one: rig_case.Case) -> Problem:
    return problem_of(read_case(one))


def left(cause: str | None, friction: str, driven: str, written: str) -> float:
    """Nats of misfit under the best of the cause's forms."""
    wanted = () if cause is None else (Wanted(cause, shared_form(cause).name, MULTIPLE, 1),)
    fields = {"levels": 6, "cycles": 3, "speeds": 2, "rows_max": 3000} | DRIVEN[driven]
    one = recipes.build_case(
        Recipe(
            name="driven", seed=12345, group="separable" if wanted else "null", design="tensile",
            family="thumb", moduli="tensile", friction=friction, effects=wanted, **fields,
        )
    )  # fmt: skip
    protocol = one.protocol
    if written == "levels reversed":
        protocol = replace(protocol, levels_kPa=protocol.levels_kPa[::-1])
    elif written == "no branch":
        protocol = replace(protocol, branch_column=False)
    quiet = replace(protocol, noise_N=QUIET * protocol.noise_N, correlated_N=QUIET * protocol.correlated_N)
    loud, clean = (_problem(replace(one, protocol=p)) for p in (protocol, quiet))
    np.testing.assert_allclose(loud.readings.displacement, clean.readings.displacement, rtol=1e-9)
    problem = loud.with_force(clean.force)
    forms = forms_of(cause) if cause else (None,)
    return min(0.5 * fit(problem, frozenset([form] if form else []), 0, {}).chi2 for form in forms)


@pytest.mark.parametrize(("cause", "friction", "driven", "written"), SAMPLE)
def test_a_cause_is_held_however_the_rig_was_driven(
    cause: str | None, friction: str, driven: str, written: str
) -> None:
    assert left(cause, friction, driven, written) < NATS


@pytest.mark.long
@pytest.mark.parametrize(("cause", "friction", "driven", "written"), [c for c in EVERY if c not in SAMPLE])
def test_every_cause_is_held_however_the_rig_was_driven(
    cause: str | None, friction: str, driven: str, written: str
) -> None:
    assert left(cause, friction, driven, written) < NATS
