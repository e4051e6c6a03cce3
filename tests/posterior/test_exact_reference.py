"""What calibrate draws, against an exact reference; and what a seed fixes."""

from __future__ import annotations

import numpy as np
import pytest

from mpam_calib.calibration import Calibration, calibrate
from mpam_calib.posterior.chains.sampling import sample
from mpam_calib.posterior.density.target import build_target, locate
from mpam_calib.posterior.draws import Draws, reported

from .exact import NAMES, Exact, exact_posterior, failures, small_specimen

ESS = 10_000


@pytest.fixture(scope="module")
def exact() -> Exact:
    return exact_posterior(*small_specimen())


@pytest.fixture(scope="module")
def calibrated() -> Calibration:
    made, blueprint = small_specimen()
    return calibrate(made, seed=1, ess_wanted=ESS, options=blueprint.options)


def every_draw(calibrated: Calibration) -> np.ndarray:
    """All draws that counted, not only those kept, with the moduli drawn back for 20,000 of them."""
    chain = calibrated.sampling.chain
    u = chain.reshape(-1, chain.shape[-1])
    u = u[np.linspace(0, len(u) - 1, 20_000).astype(int)]
    values = calibrated.model.values(u)
    rng = np.random.default_rng(5)
    eta = [
        calibrated.target.linear_draws({k: v[i : i + 50] for k, v in values.items()}, rng)
        for i in range(0, len(u), 50)
    ]
    listed = {
        item.name: item.draws for item in reported(calibrated.model, Draws(u, values, np.concatenate(eta), 4))
    }
    return np.stack([listed[name] for name in NAMES], axis=1)


def test_the_quadrature_is_fine_enough(exact):
    """Half as many points change no mean by 1e-3 sd and no sd by 1e-3."""
    coarse = exact_posterior(*small_specimen(), points=31)
    assert np.abs((coarse.mean - exact.mean) / exact.sd).max() < 1e-3
    assert coarse.sd == pytest.approx(exact.sd, rel=1e-3)


def test_it_reaches_the_effective_size_asked_for(calibrated):
    assert calibrated.sampling.converged
    assert calibrated.sampling.diagnostics.ess_bulk.min() >= ESS
    assert calibrated.sampling.diagnostics.ess_tail.min() >= ESS


def test_the_summary_s_means_and_sds(calibrated, exact):
    """The table as it is printed: its figures come from the draws that were kept."""
    table = calibrated.summary.set_index("parameter").loc[NAMES]
    size = np.minimum(table["ess_bulk"].to_numpy(), len(calibrated.draws))
    error = exact.sd / np.sqrt(size)
    assert np.abs((table["mean"].to_numpy() - exact.mean) / error).max() < 4.0
    assert table["sd"].to_numpy() == pytest.approx(exact.sd, rel=0.05)


def test_all_draws_agree_with_the_reference(calibrated, exact):
    assert failures(exact, every_draw(calibrated), np.full(6, float(ESS))) == []


def test_narrowed_draws_do_not(calibrated, exact):
    """By 20 %, every sd is noticed."""
    draws = every_draw(calibrated)
    narrowed = draws.mean(axis=0) + 0.8 * (draws - draws.mean(axis=0))
    assert failures(exact, narrowed, np.full(6, float(ESS))) == [f"sd of {name}" for name in NAMES]


def test_shifted_draws_do_not(calibrated, exact):
    """By a tenth of a sd: ten Monte Carlo errors."""
    draws = every_draw(calibrated)
    shifted = draws + 0.1 * exact.sd
    assert failures(exact, shifted, np.full(6, float(ESS))) == [f"mean of {name}" for name in NAMES]


def test_quantiles_and_prior_widths_are_in_the_table(calibrated, exact):
    table = calibrated.summary.set_index("parameter").loc[NAMES]
    draws = every_draw(calibrated)
    for column, share in (("q05", 0.05), ("q50", 0.5), ("q95", 0.95)):
        # A 5 % quantile of 4,000 draws errs by √(0.05·0.95/4000)/φ(1.64)·sd = 0.034 sd.
        off = (table[column].to_numpy() - np.quantile(draws, share, axis=0)) / exact.sd
        assert np.abs(off).max() < 0.2
    assert table.loc["K_f", "prior_sd"] == pytest.approx(0.2 * np.sqrt(1.0 - 2.0 / np.pi))


def test_one_seed_one_posterior():
    """Equal to the last bit with the same seed; within Monte Carlo errors with another one."""
    made, blueprint = small_specimen(3)
    target, modes = locate(build_target(made, blueprint), np.random.default_rng(0))
    runs = [sample(target, modes, seed, max_steps=160) for seed in (7, 7, 8)]
    assert np.array_equal(runs[0].chain, runs[1].chain)
    assert np.array_equal(runs[0].log_prob, runs[1].log_prob)
    assert not np.array_equal(runs[0].chain[:, :5], runs[2].chain[:, :5])
    flat = [r.chain.reshape(-1, r.chain.shape[-1]) for r in (runs[0], runs[2])]
    ess = [r.diagnostics.ess_bulk for r in (runs[0], runs[2])]
    error = np.sqrt(sum(x.var(axis=0) / n for x, n in zip(flat, ess, strict=True)))
    assert np.all(np.abs(flat[0].mean(axis=0) - flat[1].mean(axis=0)) < 4.0 * error)
    again = [calibrate(made, seed=7, options=blueprint.options).summary for _ in range(2)]
    assert again[0].to_csv() == again[1].to_csv()


def test_ensembles_are_independent():
    made, blueprint = small_specimen(3)
    target, modes = locate(build_target(made, blueprint), np.random.default_rng(0))
    chain = sample(target, modes, 0, max_steps=40).chain
    assert len(chain) >= 4
    for i in range(len(chain)):
        for j in range(i):
            assert not np.array_equal(chain[i], chain[j])
            correlation = np.corrcoef(chain[i].mean(axis=1)[:, 0], chain[j].mean(axis=1)[:, 0])[0, 1]
            assert abs(correlation) < 0.9
