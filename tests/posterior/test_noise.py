"""Noise that grows and noise in bursts: what the options of ``[noise]`` recover, and that they do no harm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from model import build
from scipy import special, stats

from mpam_calib.model.blueprint import Options, draw_blueprint
from mpam_calib.model.noise import FREEDOM, GROWTH, WHITE
from mpam_calib.posterior.density.guide import Guide
from mpam_calib.posterior.density.target import build_target, locate, predict_force
from mpam_calib.posterior.likelihood.sites import FreeRows, Sites, chunk_log_likelihood, usual_chunks
from mpam_calib.specimen.declaration import Noise
from mpam_calib.specimen.recording import BlockedForce, Specimen

from .noisy import K_F, SD, Fitted, fitted, loops_with

CORRELATED = Options(remainder=False)
ROBUST, GROWING = Noise(robust=True), Noise(growth=True)
SEEDS = range(4)


def coverage(found: Fitted, truth: np.ndarray) -> float:
    low, high = np.quantile(found.force, [0.05, 0.95], axis=0)
    return float(np.mean((truth >= low) & (truth <= high)))


def miss(found: Fitted, truth: np.ndarray) -> float:
    """Root mean square of the mean curve's error, N."""
    return float(np.sqrt(np.mean((found.force.mean(axis=0) - truth) ** 2)))


def test_bursts_spoil_the_bands_unless_noise_is_robust():
    """Thirty bursts in 2,400 rows, four times. A curve has five parameters: coverages of one are no more than
    a handful of independent ones, so their mean over the four is judged: above 0.8, against below 0.6.
    """
    plain, robust = [], []
    for seed in SEEDS:
        for noise, results in ((Noise(), plain), (ROBUST, robust)):
            made, truth = loops_with(noise, bursts=30, seed=seed)
            found = fitted(made, build.PLAIN)
            results.append((coverage(found, truth), miss(found, truth), found.mean_sd(WHITE)[0]))
    covered, missed, _ = np.mean(plain, axis=0)
    assert covered < 0.6 and missed > SD
    covered, missed, noise_sd = np.mean(robust, axis=0)
    assert covered > 0.8
    assert missed < 0.1 * SD
    assert 0.8 * SD < noise_sd < 1.5 * SD


@pytest.mark.long
def test_bursts_are_not_taken_for_structure():
    """With the remainders in play as well: they stay small, and friction is found."""
    made, truth = loops_with(ROBUST, bursts=30, seed=0)
    found = fitted(made, Options())
    assert miss(found, truth) < 0.2 * SD
    assert found.mean_sd(FREEDOM)[0] < 3.0
    assert found.mean_sd("stroke_remainder_sd_N")[0] < SD
    assert found.mean_sd("K_f")[0] == pytest.approx(K_F, abs=0.02)


@pytest.mark.long
def test_robust_noise_does_no_harm_where_there_are_no_bursts():
    """Sds within a tenth, means within half an sd, and degrees of freedom that say: Gaussian."""
    for seed in (0, 1):
        plain, robust = (fitted(loops_with(n, seed=seed)[0], CORRELATED) for n in (Noise(), ROBUST))
        ratio = robust.force.std(axis=0) / plain.force.std(axis=0)
        # Sds of 200 draws each err by 5 %: their mean over the curve by less.
        assert np.mean(ratio) == pytest.approx(1.0, abs=0.1)
        apart = (robust.force.mean(axis=0) - plain.force.mean(axis=0)) / plain.force.std(axis=0)
        assert np.abs(apart).max() < 0.7
        assert np.median(robust.values[FREEDOM]) > 20.0
        assert robust.mean_sd(WHITE)[0] == pytest.approx(plain.mean_sd(WHITE)[0], rel=0.03)


@pytest.mark.parametrize("growth", [1.0, pytest.param(3.0, marks=pytest.mark.long)])
def test_growth_is_recovered(growth):
    """Four recordings: within 3.5 sds each, and their mean within 3.5 of its own."""
    found = [fitted(loops_with(GROWING, growth=growth, seed=seed)[0], CORRELATED) for seed in SEEDS]
    means, sds = np.array([f.mean_sd(GROWTH) for f in found]).T
    assert np.abs((means - growth) / sds).max() < 3.5
    assert abs(means.mean() - growth) < 3.5 * np.sqrt(np.mean(sds**2) / len(sds))
    assert np.mean(sds) < 0.25 * growth


@pytest.mark.long
def test_growth_is_near_zero_where_there_is_none():
    """A growth of 0.3 is 4 % more noise at the force scale: the data of 2,400 rows allow no more."""
    found = [fitted(loops_with(GROWING, seed=seed)[0], CORRELATED).mean_sd(GROWTH)[0] for seed in SEEDS]
    assert np.max(found) < 0.45
    assert np.mean(found) < 0.3


def test_without_growth_the_noise_of_small_forces_is_wrong():
    made, _ = loops_with(Noise(), growth=3.0, seed=0)
    assert fitted(made, CORRELATED).mean_sd(WHITE)[0] > 2.0 * SD


# --- the approximation itself --------------------------------------------------------------------------


ROWS = 60


def blocked(outlier: float, seed: int) -> Specimen:
    """Sixty blocked forces, one modulus: a single linear coordinate, noise 0.5 N."""
    rng = np.random.default_rng(seed)
    pressure = np.linspace(8e4, 2e5, ROWS)
    zeros = np.zeros(ROWS, dtype=bool)
    declared = {"law": "constant", "order": 1, "friction": "none", "strain": "stretch"}
    made = build.specimen(
        declared,
        levels_kPa=(100.0, 150.0, 200.0),
        noise=ROBUST,
        blocked_force=BlockedForce(pressure, pressure * 4e-4, zeros),
    )
    target = build_target(made, draw_blueprint(made, build.PLAIN))
    values = {WHITE: np.array([[0.5]]), FREEDOM: np.array([[5.0]])}
    force = predict_force(target.model, values, np.full((1, 1), 0.1), target.data.points.readings)[0]
    force = force + 0.5 * rng.standard_normal(ROWS)
    force[[3, 11, 30, 31, 50, 58]] += outlier
    return replace(made, blocked_force=BlockedForce(pressure, force, zeros))


def test_no_noise_at_all_is_no_mode():
    """There squares of 1e20 and more leave rounding of each other, which may be millions of nats."""
    made = blocked(50.0, 2)
    target, modes = locate(build_target(made, draw_blueprint(made, build.PLAIN)), np.random.default_rng(0))
    for freedom in (-30.0, -17.0, 0.0, 3.0):
        values = target.model.values(np.array([modes[0].u, [modes[0].u[0], freedom]]))
        assert values[WHITE][0, 0] > 0.1
        # Less than the prior allows.
        values[WHITE] = values[WHITE] * np.array([[1.0], [1e-9]])
        assert np.isfinite(target.log_likelihood(values)).tolist() == [True, False]


@pytest.mark.parametrize(
    ("outlier", "allowed"), [(0.0, 0.01), (5.0, 0.1), pytest.param(50.0, 0.1, marks=pytest.mark.long)]
)
def test_against_quadrature_over_the_linear_coordinate(outlier, allowed):
    """∫ Π t_ν(y − f − A η) N(η) dη on a grid: differences of ln p across the posterior, mean and sd of η.

    Sixty rows for one coordinate, a tenth of them wrong. A constant changes no posterior and is allowed twice
    what differences are.
    """
    for seed in range(3):
        made = blocked(outlier, seed)
        target, modes = locate(
            build_target(made, draw_blueprint(made, build.PLAIN)), np.random.default_rng(0)
        )
        rng = np.random.default_rng(3)
        d = len(modes[0].u)
        u = modes[0].u + rng.standard_normal((12, d)) @ np.linalg.cholesky(modes[0].covariance).T
        u = np.concatenate([modes[0].u[None], u])
        values = target.model.values(u)
        assert target.data.points is not None and target.model.chain is not None
        terms = target.model.chain.terms(values, target.data.points.readings)
        eta = np.linspace(-6.0, 6.0, 24_001)
        found, exact = target.log_likelihood(values), []
        mean, draws = target.linear_mean(values)[:, 0], np.empty((len(u), 4000))
        for i in range(len(u)):
            fixed, column = terms.fixed[min(i, len(terms.fixed) - 1)], terms.columns[0, :, 0]
            scale, dof = float(values[WHITE][i, 0]), float(values[FREEDOM][i, 0])
            rows = (target.data.points.force - fixed)[:, None] - column[:, None] * eta
            log_p = (
                stats.t.logpdf(rows / scale, dof).sum(axis=0) - ROWS * np.log(scale) + stats.norm.logpdf(eta)
            )
            exact.append(special.logsumexp(log_p) + np.log(eta[1] - eta[0]))
            weight = np.exp(log_p - special.logsumexp(log_p))
            if i == 0:
                centre = float(weight @ eta)
                spread = float(np.sqrt(weight @ (eta - centre) ** 2))
        off = found - np.array(exact)
        assert np.abs(off.mean()) < 2.0 * allowed
        assert off.std() < allowed
        one = {k: np.repeat(v[:1], 4000, axis=0) for k, v in values.items()}
        draws = target.linear_draws(one, np.random.default_rng(0))[:, 0]
        assert mean[0] == pytest.approx(centre, abs=0.1 * spread)
        assert draws.std() == pytest.approx(spread, rel=0.12)


def test_many_degrees_of_freedom_are_gaussian_noise():
    """ν = 10⁸: the robust likelihood is the Gaussian one, whatever the sites."""
    made, _ = loops_with(ROBUST, seed=1, rows=14)
    robust = build_target(made, draw_blueprint(made, CORRELATED))
    plain_made = replace(made, noise=Noise())
    plain = build_target(plain_made, draw_blueprint(plain_made, CORRELATED))
    u = 0.3 * np.random.default_rng(0).standard_normal((3, len(plain.model.names)))
    values = plain.model.values(u)
    gaussian = plain.log_likelihood(values)
    n = len(robust.data.bins)
    values[FREEDOM] = np.full((3, 1), 1e8)
    assert robust.log_likelihood(values) == pytest.approx(gaussian, rel=1e-6)
    rng = np.random.default_rng(1)
    other = replace(robust, guide=Guide(bin_noise=0.1 * rng.standard_normal(n)))
    assert other.log_likelihood(values) == pytest.approx(gaussian, rel=1e-5)


def test_a_site_touches_the_density_where_it_was_settled():
    z = np.array([-30.0, -2.0, 0.0, 0.7, 4.0])
    sites = Sites.settle(z, 4.0)
    h = 1e-4
    slope = (stats.t.logpdf(z + h, 4.0) - stats.t.logpdf(z - h, 4.0)) / (2.0 * h)
    assert -(z - sites.shift) / sites.spread == pytest.approx(slope, rel=1e-5, abs=1e-8)
    bend = -(stats.t.logpdf(z + h, 4.0) - 2.0 * stats.t.logpdf(z, 4.0) + stats.t.logpdf(z - h, 4.0)) / h**2
    kept = np.maximum(bend, 0.02)
    assert 1.0 / sites.spread == pytest.approx(kept * bend.sum() / kept.sum(), rel=1e-4)
    scale, dof = np.full((2, 5), 0.3), np.array([4.0, 9.0])
    many = Sites.at(0.3 * z, scale, dof)
    assert many.spread[0] == pytest.approx(sites.spread)
    assert many.shift[1] == pytest.approx(Sites.settle(z, 9.0).shift)
    assert np.all(Sites.at(None, scale, dof).spread == 1.0)


def test_the_correction_swaps_densities():
    """Σ ln t(z) − ln N(z; shift, spread) at the z that α = (r − Aη) implies."""
    rng = np.random.default_rng(0)
    sites = Sites(np.array([[1.0, 2.0, 5.0]] * 2), np.array([[0.0, 0.5, -1.0]] * 2))
    rows = FreeRows(rng.standard_normal((2, 3, 2)), rng.standard_normal((2, 3)), np.full((2, 3), 0.3), sites)
    eta, dof = rng.standard_normal((2, 2)), np.array([3.0, 8.0])
    z = rows.noise(eta)
    for b in range(2):
        alpha = rows.residual[b] - rows.design[b] @ eta[b]
        assert z[b] == pytest.approx(sites.shift[b] + sites.spread[b] * 0.3 * alpha)
        expected = stats.t.logpdf(z[b], dof[b]) - stats.norm.logpdf(
            z[b], sites.shift[b], np.sqrt(sites.spread[b])
        )
        assert rows.correction(eta, dof)[b] == pytest.approx(expected.sum())


def test_chunks_far_above_their_neighbours_are_left_out():
    rng = np.random.default_rng(0)
    force = rng.uniform(0.0, 100.0, 400)
    clean = rng.standard_normal((400, 5)) * (1.0 + 0.05 * force)[:, None]
    # Noise that grows sixfold is no burst ...
    assert usual_chunks(clean, force).mean() > 0.99
    burst = clean.copy()
    burst[::20] *= 10.0
    kept = usual_chunks(burst, force)
    # ... but ten times the noise of the same force is.
    assert kept[::20].mean() < 0.1
    assert np.delete(kept, np.arange(0, 400, 20)).mean() > 0.99


def test_chunks_are_normal_with_their_own_growth():
    rng = np.random.default_rng(0)
    root = rng.standard_normal((2, 4, 4))
    covariance = root @ np.swapaxes(root, 1, 2) + np.eye(4)
    chunks, grown = rng.standard_normal((7, 4)), rng.uniform(1.0, 3.0, (2, 7))
    exact = [
        sum(
            stats.multivariate_normal.logpdf(chunks[c], np.zeros(4), grown[b, c] ** 2 * covariance[b])
            for c in range(7)
        )
        for b in range(2)
    ]
    assert chunk_log_likelihood(covariance, chunks, grown) == pytest.approx(exact)
