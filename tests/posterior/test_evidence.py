"""The evidence by quadrature: known integrals, dense grids on real posteriors, another program, time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from model import build
from scipy import special

from mpam_calib.model.blueprint import Blueprint, Options, draw_blueprint
from mpam_calib.posterior.density.collapsed import Collapsed
from mpam_calib.posterior.density.mode import Mode, evaluate
from mpam_calib.posterior.density.target import build_target, locate, predict_force
from mpam_calib.posterior.evidence.nested import scatter
from mpam_calib.posterior.evidence.quadrature import integrate
from mpam_calib.specimen.recording import Specimen

from .densities import KNOWN, Curved, Sheet, dimensions_of, mode_of

INSIDE, ELSEWHERE = 0.02, 0.1
"""Nats allowed where a mode is four sds inside its bounds, and elsewhere."""


@pytest.mark.parametrize("name", KNOWN)
def test_known_evidences(name):
    density = KNOWN[name]
    for seed in range(5):
        found = integrate(density, mode_of(density, dimensions_of(density)), seed)
        assert found.value == pytest.approx(density.exact, abs=INSIDE)
        assert found.error < INSIDE


@pytest.mark.parametrize("name", ["gaussian", "skewed"])
def test_seeds_differ_by_the_error_that_is_stated(name):
    """Of forty seeds: neither less, as if the error were that of one randomisation, nor more."""
    density = KNOWN[name]
    mode = mode_of(density, dimensions_of(density))
    found = [integrate(density, mode, seed) for seed in range(40)]
    stated = np.sqrt(np.mean([one.error**2 for one in found]))
    assert 0.6 * stated < np.std([one.value for one in found], ddof=1) < 1.3 * stated


def test_the_error_of_a_mean_of_randomisations():
    """Means of 1 and 3 about 2: half of it each way, so √½ of it as an sd, and over √2 a half."""
    value, error = scatter(np.log([[1.0, 1.0], [2.0, 4.0]]))
    assert value == pytest.approx(np.log(2.0))
    assert error == pytest.approx(0.5)


def test_a_strongly_curved_density():
    """Bent ten of its widths off the axis: what is left out stays below what is allowed at bounds."""
    density = Curved(0.5)
    for seed in range(5):
        assert integrate(density, mode_of(density, 2), seed).value == pytest.approx(-3.0, abs=ELSEWHERE)
    assert mode_of(density, 2).log_evidence < -3.0 - ELSEWHERE


def test_a_sheet_in_six_dimensions():
    """Two wide coordinates that four others follow: no axes and no single ridge show it."""
    density = Sheet()
    mode = mode_of(density, 6)
    found = [integrate(density, mode, seed) for seed in range(5)]
    off = np.array([e.value for e in found]) - density.exact
    assert abs(mode.log_evidence - density.exact) > ELSEWHERE
    assert np.sqrt(np.mean(off**2)) < INSIDE
    assert np.all(np.abs(off) < 4.0 * np.array([e.error for e in found]))
    assert all(e.reliable for e in found)
    for e in found:
        assert np.abs(e.mean[:2]).max() < 0.15
        assert np.diag(e.covariance)[:2] == pytest.approx([1.0, 1.0], abs=0.15)


@pytest.mark.parametrize("name", ["at its bound", "beyond its bound", "skewed"])
def test_laplace_alone_does_not_do(name):
    density = KNOWN[name]
    mode = mode_of(density, dimensions_of(density))
    assert abs(mode.log_evidence - density.exact) > INSIDE


def test_mean_and_covariance_of_what_was_integrated():
    density = KNOWN["gaussian"]
    found = integrate(density, mode_of(density, 4))
    sd = np.sqrt(np.diag(density.covariance()))
    assert np.abs((found.mean - np.linspace(-1.0, 1.0, 4)) / sd).max() < 0.1
    ratio = found.covariance / density.covariance()
    assert np.abs(ratio - 1.0).max() < 0.2


def test_without_parameters_it_is_the_density_itself():
    mode = Mode(np.zeros(0), -12.5, np.zeros((0, 0)))
    assert integrate(KNOWN["gaussian"], mode).value == -12.5


class Halo:
    """A wide, faint mass around a narrow one, 20 times as much of it in five dimensions."""

    exact = float(np.log((1.0 + 6.0**5 * np.exp(-3.0)) * (2.0 * np.pi) ** 2.5))

    def log_posterior(self, u: np.ndarray) -> np.ndarray:
        narrow = -0.5 * np.sum(u**2, axis=1)
        wide = -0.5 * np.sum((u / 6.0) ** 2, axis=1) - 3.0
        return np.logaddexp(narrow, wide)


def test_a_halo_is_found():
    mode = Mode(np.zeros(5), 0.0, np.eye(5))
    assert Halo.exact - mode.log_evidence > 5.0
    for seed in range(3):
        assert integrate(Halo(), mode, seed).value == pytest.approx(Halo.exact, abs=ELSEWHERE)


def test_what_does_not_settle_says_so():
    """Ten dimensions on a folded sheet, which no choice of the wide coordinates unfolds."""

    class Folded:
        def log_posterior(self, u: np.ndarray) -> np.ndarray:
            z, y = u[:, :5], u[:, 5:]
            return -0.5 * np.sum(z**2, axis=1) - 0.5 * np.sum(((y - 3.0 * z**2) / 0.05) ** 2, axis=1)

    turn = np.linalg.qr(np.random.default_rng(1).standard_normal((10, 10)))[0]

    class Turned:
        def log_posterior(self, u: np.ndarray) -> np.ndarray:
            return Folded().log_posterior(u @ turn)

    found = integrate(Turned(), mode_of(Turned(), 10))
    assert abs(found.value - 5.0 * np.log(2.0 * np.pi * 0.05)) > ELSEWHERE
    assert not found.reliable


def posterior(K_f: float | None, options: Options, seed: int = 0) -> tuple[Collapsed, Mode]:
    """72 rows of three loops, linear law of order 2; no friction at all where K_f is None."""
    rng = np.random.default_rng(seed)
    recorded = build.loops((100.0, 150.0, 200.0), 12.0, 12)
    declared = {"law": "linear", "order": 2, "friction": "none" if K_f is None else "coulomb"}
    made = build.with_force(build.specimen(declared, recorded), np.full(72, 20.0))
    model = build_target(made, draw_blueprint(made, build.PLAIN)).model
    values = {"noise_sd_N": np.array([[0.2]])} | ({} if K_f is None else {"K_f": np.array([[K_f]])})
    force = predict_force(model, values, 0.2 * rng.standard_normal((1, 4)), build.rows_of(recorded))[0]
    made = build.with_force(made, force + 0.2 * rng.standard_normal(72))
    return _located(made, draw_blueprint(made, options))


def _located(made: Specimen, blueprint: Blueprint) -> tuple[Collapsed, Mode]:
    target, modes = locate(build_target(made, blueprint), np.random.default_rng(0))
    return target, modes[0]


def dense(target: Collapsed, mode: Mode, points: int) -> float:
    """The trapezoidal rule on a box that holds all within e^-18 of the top, found on a coarser one."""
    d = len(mode.u)
    low, high = np.full(d, -7.0), np.full(d, 7.0)
    reach = 9.0 * np.sqrt(np.diag(mode.covariance))
    low, high = np.maximum(low, mode.u - reach), np.minimum(high, mode.u + reach)
    for size in (15, 15, points):
        axes = [np.linspace(a, b, size) for a, b in zip(low, high, strict=True)]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        log_p = evaluate(target, grid.reshape(-1, d)).reshape((size,) * d)
        inside = log_p > mode.log_posterior - 18.0
        for i in range(d):
            seen = np.flatnonzero(inside.any(axis=tuple(j for j in range(d) if j != i)))
            step = (high[i] - low[i]) / (size - 1)
            if size != points:
                low[i], high[i] = axes[i][seen[0]] - step, axes[i][seen[-1]] + step
    return float(special.logsumexp(log_p) + sum(np.log(a[1] - a[0]) for a in axes))


REMAINDER = Options(correlated_noise=False)
REAL = {
    "noise": (None, build.PLAIN, INSIDE, 101),
    "friction inside its bound": (0.06, build.PLAIN, INSIDE, 61),
    "friction at its bound": (0.0, build.PLAIN, ELSEWHERE, 61),
    "remainder at its bound": (None, REMAINDER, ELSEWHERE, 31),
}


@pytest.mark.parametrize("name", REAL)
def test_dense_quadrature_of_the_collapsed_posterior(name):
    """One, two, two and three dimensions of the package's own posterior."""
    K_f, options, allowed, points = REAL[name]
    target, mode = posterior(K_f, options)
    reference = dense(target, mode, points)
    assert dense(target, mode, points - points // 3) == pytest.approx(reference, abs=allowed / 10.0)
    found = integrate(target, mode)
    assert found.value == pytest.approx(reference, abs=allowed)
    assert found.error < allowed
    if K_f:
        i = target.model.names.index("K_f")
        x = target.model.values(mode.u[None])["K_f"][0, 0]
        beside = target.model.values((mode.u + np.eye(2)[i] * np.sqrt(mode.covariance[i, i]))[None])["K_f"]
        assert x > 4.0 * (beside[0, 0] - x)


def test_a_narrow_curvature_is_made_good():
    """Laplace's sds wrong by a factor of two either way: the answer stays."""
    target, mode = posterior(0.06, build.PLAIN)
    reference = integrate(target, mode).value
    for factor in (0.25, 4.0):
        off = integrate(target, replace(mode, covariance=factor * mode.covariance))
        assert off.value == pytest.approx(reference, abs=INSIDE)


@pytest.mark.long
@pytest.mark.parametrize("K_f", [0.06, 0.0])
def test_another_program_agrees(K_f):
    """dynesty's nested sampling of the same likelihood and prior, within four of its errors."""
    dynesty = pytest.importorskip("dynesty")
    target, mode = posterior(K_f, Options(remainder=False))

    def log_likelihood(u: np.ndarray) -> float:
        return float(target.log_likelihood(target.model.values(u[None]))[0])

    sampler = dynesty.NestedSampler(
        log_likelihood, special.ndtri, len(mode.u), nlive=200, rstate=np.random.default_rng(1)
    )
    sampler.run_nested(dlogz=0.05, print_progress=False)
    found = integrate(target, mode)
    error = float(sampler.results.logzerr[-1])
    assert error < 0.5
    assert abs(float(sampler.results.logz[-1]) - found.value) < 4.0 * error + ELSEWHERE
