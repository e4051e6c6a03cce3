"""Diagnostics on series whose effective size is known, and on ensembles that disagree."""

from __future__ import annotations

import warnings

import numpy as np
import pandas as pd
import pytest

from mpam_calib.posterior.chains.convergence import RHAT_LIMIT, diagnose_chains
from mpam_calib.posterior.chains.sampling import Sampling
from mpam_calib.posterior.draws import Reported, kept_for, spread_over
from mpam_calib.posterior.summary import all_converged, summarise

SHAPE = (4, 1500, 16)


def ar1(rho: float, seed: int, shape: tuple[int, int, int] = SHAPE) -> np.ndarray:
    """Stationary AR(1) along the steps, unit variance, walkers independent: τ = (1 + ρ)/(1 − ρ)."""
    rng = np.random.default_rng(seed)
    z = rng.standard_normal(shape)
    x = np.empty(shape)
    x[:, 0] = z[:, 0]
    for t in range(1, shape[1]):
        x[:, t] = rho * x[:, t - 1] + np.sqrt(1.0 - rho**2) * z[:, t]
    return x[..., None]


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.8, 0.95])
def test_ess_of_a_series_of_known_tau(rho):
    found = diagnose_chains(ar1(rho, 1))
    expected = np.prod(SHAPE) * (1.0 - rho) / (1.0 + rho)
    assert found.ess_bulk[0] == pytest.approx(expected, rel=0.2)
    assert found.rhat[0] <= RHAT_LIMIT


@pytest.mark.parametrize("rho", [0.5, 0.95])
def test_the_mean_s_error_is_what_ess_promises(rho):
    """Forty series: the means scatter as 1/√ESS says."""
    shape = (4, 500, 8)
    runs = [ar1(rho, seed, shape) for seed in range(40)]
    ess = np.mean([diagnose_chains(x).ess_bulk[0] for x in runs[:5]])
    scatter = np.var([x.mean() for x in runs])
    # A variance of 40 has a relative sd of √(2/39) = 0.23; ESS itself may be 20 % off.
    assert scatter * ess == pytest.approx(1.0, abs=0.2 + 3.0 * 0.23)


def test_ess_is_never_flattered_by_anticorrelation():
    assert diagnose_chains(ar1(-0.5, 2)).ess_bulk[0] <= np.prod(SHAPE)


def test_chains_too_short_to_tell_are_worth_a_draw_each():
    free = np.random.default_rng(0).standard_normal((4, 10, 400, 2))
    assert np.all(diagnose_chains(free).ess_bulk > 400.0)
    for steps in (1, 2, 3, 4, 9):
        found = diagnose_chains(free[:, :steps])
        assert np.all(found.ess_bulk == 4.0) and np.all(found.ess_tail == 4.0)
        assert not found.meets(400.0)


def test_tail_ess_sees_tails_that_do_not_mix():
    """The sign of a series flips freely, its size hardly: the bulk is fine, the tails are not."""
    size = np.exp(1.5 * ar1(0.995, 3))
    sign = np.random.default_rng(0).choice([-1.0, 1.0], size=size.shape)
    found = diagnose_chains(sign * size)
    assert found.ess_tail[0] < 0.05 * np.prod(SHAPE)


def test_rhat_is_quiet_on_independent_draws():
    fired = [
        np.any(diagnose_chains(np.random.default_rng(s).standard_normal((4, 200, 8, 5))).rhat > RHAT_LIMIT)
        for s in range(10)
    ]
    assert not any(fired)


def test_rhat_fires_where_one_ensemble_sits_elsewhere():
    x = ar1(0.5, 4)
    x[2] += 1.0
    assert diagnose_chains(x).rhat[0] > 1.05


def test_rhat_fires_where_one_ensemble_is_wider():
    x = ar1(0.5, 5)
    x[1] *= 2.0
    assert diagnose_chains(x).rhat[0] > 1.02


def test_walkers_that_agree_inside_their_ensemble_do_not_hide_that_ensembles_differ():
    """Every walker mixes within its ensemble's own mode: R-hat over walkers would see 64 good chains."""
    x = 0.3 * ar1(0.3, 6)
    x += np.array([-1.0, -0.4, 0.4, 1.0])[:, None, None, None]
    found = diagnose_chains(x)
    assert found.rhat[0] > 1.5
    assert not found.converged


def test_an_ensemble_that_drifts_has_not_converged():
    x = ar1(0.5, 7) + np.linspace(0.0, 3.0, SHAPE[1])[None, :, None, None]
    found = diagnose_chains(x)
    assert not found.converged or found.ess_bulk[0] < 0.01 * np.prod(SHAPE)


def test_each_parameter_has_its_own_figures():
    x = np.concatenate([ar1(0.0, 8), ar1(0.95, 9)], axis=-1)
    found = diagnose_chains(x)
    assert found.ess_bulk[0] > 10.0 * found.ess_bulk[1]


def test_a_stuck_walker_does_not_hide_the_others_tau():
    """emcee's estimate is nan with a constant series among the walkers; it must still bound ESS."""
    x = ar1(0.95, 10)
    free = diagnose_chains(x).ess_bulk[0]
    x[1, :, 3] = 0.2
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # emcee's 0/0
        held = diagnose_chains(x).ess_bulk[0]
    assert 0.0 < held < free
    x[:] = np.arange(4.0)[:, None, None, None]
    assert not diagnose_chains(x).converged


@pytest.mark.parametrize(
    ("steps", "walkers"), [(1000, 48), (1500, 16), (160, 48), (200, 128), (1000, 32), (5, 300), (7, 8)]
)
def test_kept_draws_say_as_much_as_so_many_can(steps: int, walkers: int) -> None:
    """AR(1) of τ = 39 for each walker: the variance of a mean over kept draws, against that over all of them.

    So many independent ones beside it: 1/ESS is at most 1/(ESS of all) + 1/(kept).
    """
    rho, kept = 0.95, min(1000, steps * walkers)

    def ess(index: np.ndarray) -> float:
        time, walker = np.divmod(index, walkers)
        apart = np.abs(np.subtract.outer(time, time))
        together = np.equal.outer(walker, walker)
        return float(len(index) ** 2 / np.sum(rho**apart * together))

    found = spread_over(steps, walkers, 1000)
    assert len(np.unique(found)) == len(found) == kept
    assert found.min() >= 0 and found.max() < steps * walkers
    own = rho ** np.abs(np.subtract.outer(np.arange(steps), np.arange(steps)))
    every = steps**2 * walkers / float(own.sum())
    assert 1.0 / ess(found) <= 1.0 / every + 1.0 / kept


@pytest.mark.parametrize(("wanted", "kept"), [(400.0, 1000), (2000.0, 1000), (4000.0, 2000), (4001.0, 2001)])
def test_twice_as_many_draws_are_kept_as_effective_ones_are_wanted(wanted: float, kept: int) -> None:
    """Of four ensembles; a thousand of each at least."""
    assert kept_for(wanted) == kept


def test_what_follows_from_kept_draws_has_no_more_of_them_than_what_it_follows_from() -> None:
    """Kept draws of many walkers look as if nothing lasted; a sum of the parameter is as slow as it is."""
    chain = ar1(0.95, 3)
    figures = diagnose_chains(chain)
    kept = chain[..., 0].reshape(4, -1)[:, spread_over(1500, 16, 1000)]
    listed = [
        Reported("K_f", "", kept.ravel(), 1.0, True, "factor"),
        Reported("E_1", "Pa", 3.0 * kept.ravel() + 1.0, 1.0, False, "modulus"),
    ]
    sampling = Sampling(chain, chain[..., 0], figures, [], 0.3, [0.3])
    table = summarise(listed, ("K_f",), sampling).set_index("parameter")
    for figure in ("ess_bulk", "ess_tail"):
        assert table.loc["E_1", figure] <= figures.ess_bulk[0]
    assert table.loc["E_1", "ess_bulk"] == pytest.approx(table.loc["K_f", "ess_bulk"], rel=0.05)


def test_a_sampled_parameter_has_no_more_effective_draws_than_were_kept() -> None:
    """Of 96,000 independent draws 400 are kept, from which its figures are."""
    chain = ar1(0.0, 1)
    figures = diagnose_chains(chain)
    assert min(figures.ess_bulk[0], figures.ess_tail[0]) > 4000.0
    kept = chain[..., 0].reshape(4, -1)[:, spread_over(1500, 16, 100)]
    sampling = Sampling(chain, chain[..., 0], figures, [], 0.3, [0.3])
    table = summarise([Reported("K_f", "", kept.ravel(), 1.0, True, "factor")], ("K_f",), sampling)
    assert table.loc[0, ["ess_bulk", "ess_tail"]].tolist() == [400.0, 400.0]


@pytest.mark.parametrize(
    ("figure", "value"), [("rhat", 1.02), ("ess_bulk", 399.0), ("ess_tail", 399.0), ("ess_tail", 400.0)]
)
def test_what_follows_from_parameters_has_to_converge_as_well(figure: str, value: float) -> None:
    """The sampled parameter's own figures are good, and so are those of all but one that follow from it."""
    chain = ar1(0.0, 1)
    sampling = Sampling(chain, chain[..., 0], diagnose_chains(chain), [], 0.3, [0.3])
    rows = pd.DataFrame({"rhat": 1.0, "ess_bulk": 4000.0, "ess_tail": 4000.0}, index=["K_f", "a_1", "b_1"])
    assert all_converged(rows, sampling, 400.0)
    rows.loc["b_1", figure] = value
    assert all_converged(rows, sampling, 400.0) == (value == 400.0)
