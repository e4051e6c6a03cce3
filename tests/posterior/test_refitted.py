"""Evidence by densities that are refitted to their own points: known integrals, much bent ones among them."""

from __future__ import annotations

import numpy as np
import pytest

from mpam_calib.posterior.evidence.refitted import integrate_refitted

from .densities import KNOWN, Curved, dimensions_of, mode_of

ALLOWED, ELSEWHERE = 0.01, 0.03
"""Nats, of all seeds; and where a density is bent this much."""
SEEDS = 20
FEW = [name for name in KNOWN if 2 <= dimensions_of(KNOWN[name]) <= 4]


@pytest.mark.parametrize("name", FEW)
def test_known_evidences(name):
    density = KNOWN[name]
    mode = mode_of(density, dimensions_of(density))
    for seed in range(3):
        found = integrate_refitted(density, mode, seed)
        assert found.value == pytest.approx(density.exact, abs=ALLOWED)
        assert found.error < ALLOWED


class Twice:
    """Two sickles side by side, bent ten of their widths off the axis: two coordinates follow two others."""

    exact = -6.0

    def log_posterior(self, u: np.ndarray) -> np.ndarray:
        one = Curved(0.5)
        return one.log_posterior(u[:, :2]) + one.log_posterior(u[:, 2:])


def test_two_bends_at_once():
    """In four dimensions, where Laplace's figure is off by 0.2 nat."""
    mode = mode_of(Twice(), 4)
    assert mode.log_evidence < Twice.exact - ELSEWHERE
    for seed in range(3):
        assert integrate_refitted(Twice(), mode, seed).value == pytest.approx(Twice.exact, abs=ELSEWHERE)


@pytest.mark.long
def test_the_error_is_what_it_says():
    """The misses of many seeds are as large as the stated errors, and do not lean to one side."""
    density = Curved()
    mode = mode_of(density, 2)
    found = [integrate_refitted(density, mode, seed) for seed in range(SEEDS)]
    away = np.array([(f.value - density.exact) / f.error for f in found])
    assert 0.6 < np.sqrt(np.mean(away**2)) < 1.6
    assert abs(np.mean(away)) < 1.0


@pytest.mark.long
def test_far_bent_tips():
    """Where the tips hold few points the errors are too small, by a factor of three; the figure holds."""
    density = Curved(0.5)
    mode = mode_of(density, 2)
    for seed in range(SEEDS):
        assert integrate_refitted(density, mode, seed).value == pytest.approx(density.exact, abs=ELSEWHERE)
