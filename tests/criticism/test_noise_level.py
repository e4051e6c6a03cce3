"""The noise that is read off before any model is fitted, against the one that the rig put in."""

from __future__ import annotations

import numpy as np
import pytest
from rig import recipes, sets

from .test_hypotheses import problem_of, specimen_of

CURVED = ("develop-separable-006", "develop-separable-022", "develop-null-009", "develop-null-015")
"""Short strokes, sines and dwells, whose own curve passed for a fifth more noise than there is, and more."""
PLAIN = ("develop-null-001", "develop-null-006", "develop-separable-012")


@pytest.mark.parametrize("name", [*CURVED, *PLAIN])
def test_noise_is_that_of_the_sensor(name: str) -> None:
    protocol = recipes.build_case(next(r for r in sets.recipes("develop") if r.name == name)).protocol
    found = problem_of(specimen_of(name)).noise_level
    assert found.total == pytest.approx(np.hypot(protocol.noise_N, protocol.correlated_N), rel=0.2)
