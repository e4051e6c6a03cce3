"""Evidence by densities that are refitted to their own points: known integrals, much bent ones among them."""

from __future__ import annotations

import numpy as np
import pytest

from mpam_calib.posterior.refitted import integrate_refitted

from .densities import KNOWN, Curved, dimensions_of, mode_of

ALLOWED, ELSEWHERE = 0.02, 0.1
"""Nats, of all seeds; and where a density is bent this much."""
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
    """In four dimensions; the tips, which no point has reached, are missed as at bounds."""
    mode = mode_of(Twice(), 4)
    assert mode.log_evidence < Twice.exact - ELSEWHERE
    for seed in range(3):
        assert integrate_refitted(Twice(), mode, seed).value == pytest.approx(Twice.exact, abs=ELSEWHERE)
