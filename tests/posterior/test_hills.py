"""Further hills of a density: found where they are, and only there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy import special, stats

from mpam_calib.posterior.density.hills import hills
from mpam_calib.posterior.density.mode import Mode, climb, curvature
from mpam_calib.posterior.evidence.refitted import integrate_refitted

from .densities import KNOWN, dimensions_of, mode_of

ALLOWED = 0.02
"""Nats."""


@dataclass(frozen=True)
class Hilly:
    """Correlated normal hills at ``centres`` along the first of three coordinates, e^``heights`` large."""

    centres: tuple[float, ...]
    heights: tuple[float, ...]
    widths: tuple[float, ...]

    @property
    def exact(self) -> float:
        return float(special.logsumexp(self.heights))

    def log_posterior(self, u: np.ndarray) -> np.ndarray:
        correlation = np.array([[1.0, 0.6, 0.0], [0.6, 1.0, 0.3], [0.0, 0.3, 1.0]])
        each = [
            h + stats.multivariate_normal.logpdf(u, [c, 0.3 * c, 0.0], w**2 * correlation).reshape(len(u))
            for c, h, w in zip(self.centres, self.heights, self.widths, strict=True)
        ]
        return np.logaddexp.reduce(each)

    def mode(self) -> Mode:
        """The first hill's."""
        start = np.array([self.centres[0], 0.3 * self.centres[0], 0.0])
        u, top = climb(self, start)
        return Mode(u, top, curvature(self, u, top))


TWO = Hilly((-1.0, 0.8), (0.0, 2.0), (0.15, 0.3))
THREE = Hilly((-1.0, 0.8, 2.5), (0.0, -1.0, 1.0), (0.2, 0.3, 0.2))


@pytest.mark.parametrize("density", [TWO, THREE], ids=["two", "three"])
def test_all_hills_are_found(density):
    found = hills(density, density.mode())
    assert sorted(m.u[0] for m in found) == pytest.approx(sorted(density.centres), abs=0.05)


def test_the_other_hill_counts():
    """Of two hills seven eighths lie under the one that no climb from the first would reach."""
    mode = TWO.mode()
    assert mode.log_evidence < TWO.exact - 2.0
    for seed in range(3):
        assert integrate_refitted(TWO, mode, seed).value == pytest.approx(TWO.exact, abs=ALLOWED)


def test_a_hill_of_no_weight_is_left():
    density = Hilly((-1.0, 0.8), (0.0, -20.0), (0.2, 0.2))
    assert len(hills(density, density.mode())) == 1


@pytest.mark.parametrize("name", KNOWN)
def test_one_hill_is_one(name):
    density = KNOWN[name]
    mode = mode_of(density, dimensions_of(density))
    assert hills(density, mode) == [mode]
