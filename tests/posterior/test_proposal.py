"""The independence proposal: a normalised density, drawn as stated, and a move that keeps a density."""

from __future__ import annotations

import numpy as np
import pytest
from emcee import EnsembleSampler, State
from emcee.moves import MHMove
from scipy import integrate, stats

from mpam_calib.posterior.chains.proposal import FREEDOM, StudentMixture, fit_normals, independence_move

MEANS = [np.array([0.0, 1.0]), np.array([3.0, -1.0])]
SPREADS = [np.array([[1.0, 0.6], [0.6, 2.0]]), np.array([[0.3, -0.1], [-0.1, 0.5]])]
TRUTH = stats.multivariate_normal([0.5, -0.3], [[1.0, 0.7], [0.7, 1.5]])


def mixture() -> StudentMixture:
    return StudentMixture.build(MEANS, SPREADS)


def test_one_component_is_the_multivariate_t():
    made = StudentMixture.build(MEANS[:1], SPREADS[:1])
    x = np.random.default_rng(0).normal(0.0, 4.0, (200, 2))
    assert made.log_density(x) == pytest.approx(
        stats.multivariate_t(MEANS[0], SPREADS[0], df=FREEDOM).logpdf(x), rel=1e-12
    )


def test_two_components_have_equal_weight():
    x = np.random.default_rng(0).normal(0.0, 4.0, (200, 2))
    parts = [stats.multivariate_t(m, s, df=FREEDOM).pdf(x) for m, s in zip(MEANS, SPREADS, strict=True)]
    assert np.exp(mixture().log_density(x)) == pytest.approx(0.5 * (parts[0] + parts[1]), rel=1e-12)


def test_each_component_may_have_tails_of_its_own():
    made = StudentMixture.build(MEANS, SPREADS, np.array([0.3, 0.7]), (8.0, 20.0))
    x = np.random.default_rng(0).normal(0.0, 4.0, (200, 2))
    parts = [stats.multivariate_t(m, s, df=v).pdf(x) for m, s, v in zip(MEANS, SPREADS, (8, 20), strict=True)]
    assert np.exp(made.log_density(x)) == pytest.approx(0.3 * parts[0] + 0.7 * parts[1], rel=1e-12)
    drawn = made.draw(200_000, np.random.RandomState(3))
    weight = np.exp(TRUTH.logpdf(drawn) - made.log_density(drawn))
    assert abs(weight.mean() - 1.0) < 4.0 * weight.std() / np.sqrt(len(weight))


def test_the_density_integrates_to_one():
    """Importance sampling from a wide Gaussian; and over a line in one dimension."""
    wide = stats.multivariate_normal([1.5, 0.0], 36.0 * np.eye(2))
    x = wide.rvs(400_000, random_state=1)
    ratio = np.exp(mixture().log_density(x) - wide.logpdf(x))
    error = ratio.std() / np.sqrt(len(ratio))
    assert error < 0.01
    assert abs(ratio.mean() - 1.0) < 4.0 * error
    single = StudentMixture.build([np.array([2.0])], [np.array([[0.25]])])
    total = integrate.quad(lambda v: float(np.exp(single.log_density(np.array([[v]]))[0])), -60.0, 60.0,
                           points=[2.0], limit=200)[0]  # fmt: skip
    assert total == pytest.approx(1.0, abs=1e-5)


def test_draws_follow_the_density():
    """A Gaussian's integral by importance sampling from the mixture, and the marginals' distribution."""
    made = mixture()
    x = made.draw(200_000, np.random.RandomState(3))
    weight = np.exp(TRUTH.logpdf(x) - made.log_density(x))
    error = weight.std() / np.sqrt(len(weight))
    assert abs(weight.mean() - 1.0) < 4.0 * error
    for i in range(2):
        mean = np.mean(weight * x[:, i])
        spread = np.std(weight * x[:, i]) / np.sqrt(len(x))
        assert abs(mean - TRUTH.mean[i]) < 4.0 * spread

    def marginal(v: np.ndarray) -> np.ndarray:
        parts = [stats.t(6.0, m[0], np.sqrt(s[0, 0])).cdf(v) for m, s in zip(MEANS, SPREADS, strict=True)]
        return 0.5 * (parts[0] + parts[1])

    assert stats.kstest(x[:, 0], marginal).pvalue > 1e-3


def bent(n: int) -> np.ndarray:
    """Draws of u₁ ~ N(0, 1), u₂ | u₁ ~ N(u₁², 0.1²)."""
    rng = np.random.default_rng(7)
    along = rng.standard_normal(n)
    return np.column_stack([along, along**2 + 0.1 * rng.standard_normal(n)])


def log_bent(u: np.ndarray) -> np.ndarray:
    return stats.norm.logpdf(u[:, 0]) + stats.norm.logpdf(u[:, 1], u[:, 0] ** 2, 0.1)


def effective_share(made: StudentMixture) -> float:
    x = made.draw(20_000, np.random.RandomState(1))
    weight = np.exp(log_bent(x) - made.log_density(x))
    return float(weight.sum() ** 2 / np.sum(weight**2) / len(weight))


def test_many_normals_follow_a_bend_that_few_do_not():
    x = bent(6000)
    weight = np.full(len(x), 1.0 / len(x))
    shares = [effective_share(StudentMixture.build(*fit_normals(x, weight, count))) for count in (1, 6, 20)]
    assert shares[0] < 0.2
    assert shares[2] > max(0.6, shares[1])


def test_widened_draws_are_wider():
    narrow, wide = (mixture().draw(50_000, np.random.RandomState(4), widen=w) for w in (1.0, 3.0))
    from_mean = [np.abs(x[:, :, None] - np.stack(MEANS, axis=1)).min(axis=2) for x in (narrow, wide)]
    assert np.median(from_mean[1]) > 1.5 * np.median(from_mean[0])


def ends(move: MHMove, steps: int = 25) -> np.ndarray:
    """Where 4,000 walkers, started as exact draws of TRUTH, stand after some steps of a move."""
    start = TRUTH.rvs(4000, random_state=5)
    sampler = EnsembleSampler(4000, 2, TRUTH.logpdf, moves=move, vectorize=True)
    state = State(start, random_state=np.random.RandomState(6).get_state())
    return sampler.run_mcmc(state, steps, skip_initial_state_check=True).coords


def p_values(x: np.ndarray) -> list[float]:
    """Marginals, a combination of them, and the squared distance against the known ones."""
    white = np.linalg.solve(np.linalg.cholesky(TRUTH.cov), (x - TRUTH.mean).T)
    tests = [stats.kstest(w, "norm").pvalue for w in (white[0], white[1], (white[0] - white[1]) / np.sqrt(2))]
    return [*tests, stats.kstest((white**2).sum(axis=0), stats.chi2(2).cdf).pvalue]


def test_the_move_leaves_a_known_density_as_it_is():
    assert min(p_values(ends(independence_move(mixture())))) > 1e-3


def test_a_wrong_hastings_factor_does_not_pass_as_the_move():
    made = mixture()

    def symmetric(x, rng):
        """As if the proposal did not matter."""
        return made.draw(len(x), rng), np.zeros(len(x))

    def inverted(x, rng):
        q = made.draw(len(x), rng)
        return q, made.log_density(q) - made.log_density(x)

    for wrong in (symmetric, inverted):
        assert min(p_values(ends(MHMove(wrong)))) < 1e-6


def test_the_move_finds_the_density_from_elsewhere():
    """Walkers that start far out end up as draws of the target."""
    start = TRUTH.rvs(4000, random_state=8) * 4.0 + 5.0
    sampler = EnsembleSampler(4000, 2, TRUTH.logpdf, moves=independence_move(mixture()), vectorize=True)
    state = State(start, random_state=np.random.RandomState(9).get_state())
    x = sampler.run_mcmc(state, 150, skip_initial_state_check=True).coords
    assert min(p_values(x)) > 1e-3


def test_a_fit_to_weighted_draws_of_a_skewed_density():
    """Draws of a Gaussian weighted to a skew normal: three components propose better than one."""
    rng = np.random.default_rng(0)
    x = np.column_stack([rng.normal(0.5, 1.2, 4000), rng.standard_normal(4000)])
    skew = stats.skewnorm(4.0)

    def target(x: np.ndarray) -> np.ndarray:
        return skew.logpdf(x[:, 0]) + stats.norm.logpdf(x[:, 1])

    weight = np.exp(target(x) - stats.norm(0.5, 1.2).logpdf(x[:, 0]) - stats.norm.logpdf(x[:, 1]))
    weight /= weight.sum()
    shares = []
    for count in (1, 3):
        made = StudentMixture.build(*fit_normals(x, weight, count))
        assert made.shares.sum() == pytest.approx(1.0)
        drawn = made.draw(20_000, np.random.RandomState(1))
        ratio = np.exp(target(drawn) - made.log_density(drawn))
        shares.append(ratio.mean() ** 2 / np.mean(ratio**2))
    assert shares[1] > 0.8
    assert shares[1] > shares[0] + 0.05


def test_a_fit_of_one_component_has_the_draws_moments():
    x = np.random.default_rng(0).standard_normal((300, 3)) @ np.diag([1.0, 2.0, 3.0])
    means, covariances, shares = fit_normals(x, np.full(300, 1.0 / 300), 1)
    assert means[0] == pytest.approx(x.mean(axis=0))
    assert covariances[0] == pytest.approx(np.cov(x.T, bias=True), rel=1e-6)
    assert shares == pytest.approx([1.0])
