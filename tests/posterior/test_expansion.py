"""Laplace's expansion to its next term: where it is exact, where it helps, where it must not be believed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy import special

from mpam_calib.posterior.density.mode import Mode
from mpam_calib.posterior.evidence.expansion import TAME, expand

from .densities import KNOWN, Bounded, Curved, Sheet, Skewed, dimensions_of, mode_of

SHAPES = np.array([20.0, 40.0, 60.0, 90.0])


@dataclass(frozen=True)
class Mixed:
    """Logarithms of gamma variables seen in coordinates that mix them: every derivative counts."""

    mixing: np.ndarray

    def log_posterior(self, u: np.ndarray) -> np.ndarray:
        return Skewed(tuple(SHAPES)).log_posterior(u @ self.mixing.T)

    def mode(self) -> Mode:
        back = np.linalg.inv(self.mixing)
        top = float(np.sum(SHAPES * np.log(SHAPES) - SHAPES))
        return Mode(back @ np.log(SHAPES), top, back @ np.diag(1.0 / SHAPES) @ back.T)


@pytest.mark.parametrize("seed", range(3))
def test_the_terms_are_stirling_s(seed):
    """ln Γ(a) = Laplace + 1/(12 a) + ...; of the fourth derivatives -1/(8 a), of the third 5/(24 a)."""
    mixing = np.random.default_rng(seed).standard_normal((4, 4))
    density = Mixed(mixing)
    found = expand(density, density.mode())
    exact = float(special.gammaln(SHAPES).sum()) - np.linalg.slogdet(mixing)[1]
    assert found.fourth == pytest.approx(-np.sum(1.0 / SHAPES) / 8.0, rel=0.03)
    assert found.third == pytest.approx(np.sum(5.0 / SHAPES) / 24.0, rel=0.03)
    assert abs(found.value - exact) < 5e-4 < abs(found.laplace - exact)


def test_a_gaussian_has_no_terms():
    density = KNOWN["gaussian"]
    found = expand(density, mode_of(density, 4))
    assert found.tame
    assert found.value == pytest.approx(density.exact, abs=2e-3)


@pytest.mark.parametrize(("count", "sds"), [(1, 3.0), (1, 4.0), (2, 5.0), (6, 8.0)])
def test_sizes_inside_their_bounds(count, sds):
    """Half-normal sizes some sds above 0: of a single one at four sds Laplace's figure is 0.026 nat off."""
    density = Bounded((0.3,) * count, s=0.4, sigma=0.3 / sds)
    found = expand(density, mode_of(density, count))
    assert found.tame
    assert abs(found.laplace - density.exact) > 0.02
    assert abs(found.value - density.exact) < 0.01
    assert abs(found.value - density.exact) < found.error


@pytest.mark.parametrize(("count", "sds"), [(1, 2.0), (2, 3.0), (6, 4.0)])
def test_sizes_nearer_to_their_bounds_are_not_tame(count, sds):
    density = Bounded((0.3,) * count, s=0.4, sigma=0.3 / sds)
    assert not expand(density, mode_of(density, count)).tame


@pytest.mark.parametrize(
    "name", ["at its bound", "beyond its bound", "two at their bounds, one inside", "skewed"]
)
def test_near_a_bound_it_is_not_tame(name):
    density = KNOWN[name]
    found = expand(density, mode_of(density, dimensions_of(density)))
    assert abs(found.laplace - density.exact) > 0.02
    assert not found.tame


def test_bent_it_is_not_tame_though_the_terms_cancel():
    found = expand(Curved(0.2), mode_of(Curved(0.2), 2))
    assert not found.tame
    assert found.fourth < -TAME < TAME < found.third


def test_much_bent_it_is_not_tame():
    assert not expand(Sheet(), mode_of(Sheet(), 6)).tame


def test_the_mode_and_its_covariance_need_not_be_exact():
    density = Mixed(np.eye(4))
    mode = density.mode()
    aside = mode.u + 0.02 * np.sqrt(np.diag(mode.covariance))
    near = Mode(aside, mode.log_posterior - 0.001, 1.02 * mode.covariance)
    assert abs(near.log_evidence - mode.log_evidence) > 0.03
    assert expand(density, near).value == pytest.approx(expand(density, mode).value, abs=0.002)


def test_what_is_not_finite_is_not_tame():
    class Edge:
        def log_posterior(self, u: np.ndarray) -> np.ndarray:
            return np.where(np.abs(u[:, 0]) < 0.9, -0.5 * np.sum(u**2, axis=1), -np.inf)

    assert not expand(Edge(), Mode(np.zeros(2), 0.0, np.eye(2))).tame


def test_without_parameters_it_is_the_density_itself():
    found = expand(KNOWN["gaussian"], Mode(np.zeros(0), -12.5, np.zeros((0, 0))))
    assert found.value == -12.5
    assert found.tame
