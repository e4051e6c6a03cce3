"""Readings at the floor: their probability against brute-force quadrature over a single modulus."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest
from model import build
from scipy import integrate, stats

from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.model.readings import Readings
from mpam_calib.posterior.density.bin_share import BinShare
from mpam_calib.posterior.density.slack import Slack, with_slack
from mpam_calib.posterior.density.target import build_target
from mpam_calib.posterior.likelihood.bins import bin_loops
from mpam_calib.specimen.declaration import Sensors
from mpam_calib.specimen.recording import ForceMap

NOISE = 0.5
WRONG = 0.01
"""The share of flags that may be wrong, as the model states it."""


def slack_target(readings: int, root: float, seed: int, wrong_flags: int = 0):
    """One modulus, ``readings`` along the stroke and six flagged ones at γ = 0.25 … 0.36; and the pieces.

    The modulus is such that the force vanishes at the contraction ``root``. ``wrong_flags`` of the flags
    are set where the muscle pulls hard.
    """
    rng = np.random.default_rng(seed)
    gamma = np.concatenate([np.linspace(0.02, 0.9 * root, readings), np.linspace(0.25, 0.36, 6)])
    flagged = np.arange(len(gamma)) >= readings
    gamma[readings : readings + wrong_flags] = 0.05
    n = len(gamma)
    empty = ForceMap(np.full(n, 1.5e5), gamma, np.ones(n), np.zeros(n, int), np.zeros(n, int), flagged)
    made = build.specimen(
        {"law": "constant", "order": 1, "friction": "none"},
        levels_kPa=(150.0,),
        force_map=empty,
        sensors=Sensors(force_sd_N=NOISE, force_floor_N=0.0),
    )
    blueprint = draw_blueprint(made, build.PLAIN)
    target = build_target(made, blueprint)
    assert target.model.chain is not None
    assert target.data.points is not None
    values = {"noise_sd_N": np.array([[NOISE]])}
    terms = target.model.chain.terms(values, target.data.points.readings)
    f, A = terms.fixed[0], terms.columns[0][:, 0]
    end = target.model.chain.terms(values, Readings.at_rest(np.array([1.5e5]), np.array([root * 0.05])))
    eta = -end.fixed[0, 0] / end.columns[0, 0, 0]
    y = f + A * eta + NOISE * rng.standard_normal(n)
    target = build_target(replace(made, force_map=replace(empty, force_N=y)), blueprint)
    return target, values, f, A, y, flagged


def by_quadrature(f, A, y, flagged) -> tuple[float, float, float]:
    """ln p(y), mean and sd of η: the integrand row by row on a grid, refined around its bulk."""

    def log_integrand(eta: np.ndarray) -> np.ndarray:
        total = stats.norm.logpdf(eta)
        for i in range(len(y)):
            force = f[i] + A[i] * eta
            if flagged[i]:
                total = total + np.log((1.0 - WRONG) * stats.norm.cdf(0.0, force, NOISE) + WRONG)
            else:
                total = total + stats.norm.logpdf(y[i], force, NOISE)
        return total

    grid = np.linspace(-8.0, 8.0, 40_001)
    heights = log_integrand(grid)
    bulk = grid[heights > heights.max() - 40.0]
    grid = np.linspace(bulk[0] - 1e-3, bulk[-1] + 1e-3, 40_001)
    heights = log_integrand(grid)
    weight = np.exp(heights - heights.max())
    total = integrate.trapezoid(weight, grid)
    mean = integrate.trapezoid(weight * grid, grid) / total
    sd = np.sqrt(integrate.trapezoid(weight * (grid - mean) ** 2, grid) / total)
    return float(heights.max() + np.log(total)), float(mean), float(sd)


@pytest.mark.parametrize("readings", [12, 40])
@pytest.mark.parametrize("root", [0.24, 0.28, 0.31, 0.34, 0.38])
def test_the_probability_of_being_slack(readings, root):
    """Laplace's approximation in η: 0.01 nat where the other readings hold the wall.

    At root 0.28 a flag lies three sds of noise from slack, where "slack by chance" and "wrongly flagged" are
    as likely as each other and the density of η has a shoulder: there a tenth of a nat, what Laplace is
    trusted with near bounds (measured: 0.062 with 12 readings, 0.016 with 40).
    """
    tolerance = 0.1 if root == 0.28 else 0.01
    target, values, *pieces = slack_target(readings, root, seed=readings)
    exact, mean, sd = by_quadrature(*pieces)
    assert target.log_likelihood(values)[0] == pytest.approx(exact, abs=tolerance)
    assert target.linear_mean(values)[0, 0] == pytest.approx(mean, abs=0.1 * sd)
    many = {k: np.repeat(v, 4000, axis=0) for k, v in values.items()}
    drawn = target.linear_draws(many, np.random.default_rng(0))[:, 0]
    assert drawn.std() == pytest.approx(sd, rel=0.1)


def test_slack_rows_say_something():
    """Where the wall would still pull, being slack costs probability; where it is slack, next to nothing."""
    for root, cost in ((0.24, False), (0.38, True)):
        target, values, f, A, y, flagged = slack_target(12, root, seed=1)
        seen = ~flagged
        without = by_quadrature(f[seen], A[seen], y[seen], flagged[seen])[0]
        gain = target.log_likelihood(values)[0] - without
        assert gain < 0.0
        # At root 0.24 the first flag stands where 0.5 N of noise may still hide a pull.
        assert (gain < -3.0) == cost


def test_one_wrong_flag_does_not_outweigh_the_readings():
    """A flag at a place where the muscle pulls with tens of newtons costs ln 0.01 and moves nothing."""
    target, values, *pieces = slack_target(40, 0.24, seed=3, wrong_flags=1)
    exact, mean, sd = by_quadrature(*pieces)
    assert target.log_likelihood(values)[0] == pytest.approx(exact, abs=0.01)
    assert target.linear_mean(values)[0, 0] == pytest.approx(mean, abs=0.1 * sd)
    f, A, y, flagged = (np.delete(part, 40) for part in pieces)
    assert pieces[3][40]
    without, mean_without, _ = by_quadrature(f, A, y, flagged)
    assert target.log_likelihood(values)[0] - without == pytest.approx(np.log(WRONG), abs=0.02)
    assert mean == pytest.approx(mean_without, abs=0.01 * sd)


@pytest.mark.parametrize("rows", [30, 40, 200])
def test_no_bin_holds_what_a_floor_made_of_the_force(rows):
    """Forces of 60 N to -20 N over strokes of few readings, a floor at 0 N, noise of 0.5 N on top.

    A bin is slack, or its mean is that of the force without a floor. Wholly slack bins say so.
    """
    rng = np.random.default_rng(rows)
    for _ in range(10):
        made = build.loops((100.0, 150.0, 200.0), 10.0, rows, cycles=2)
        force = 60.0 - 8000.0 * made.displacement_m + 2e-5 * (made.pressure_Pa - 1e5)
        reading = np.maximum(force, 0.0) + NOISE * rng.standard_normal(len(force))
        bins = bin_loops(replace(made, force_N=reading, censored=reading <= 0.0))
        first = np.concatenate([[0], np.cumsum(bins.count)[:-1]]).astype(int)
        exact = np.add.reduceat(force, first) / bins.count
        off = (bins.force - exact) * np.sqrt(bins.count) / NOISE
        assert np.abs(off[~bins.slack]).max() < 6.0
        assert bins.slack[exact < -2.0 * NOISE].all()
        assert not bins.slack[exact > 8.0 * NOISE].any()


def test_a_slack_bin_stays_below_what_its_readings_may_reach_within_all_that_it_may_be_off():
    """4.5 sds of a reading above the floor; white and lasting noise and the stroke's own remainder, each."""
    made = build.specimen(recorded=build.loops(rows=40), sensors=Sensors(force_sd_N=NOISE, force_floor_N=2.0))
    assert made.loops is not None
    reading = np.maximum(60.0 - 8000.0 * made.loops.displacement_m, 2.0)
    made = replace(made, loops=replace(made.loops, force_N=reading, censored=reading <= 2.0))
    target = build_target(made, draw_blueprint(made))
    bins = target.data.bins
    assert bins is not None and bins.slack.any()
    values = target.model.values(np.zeros((2, len(target.model.names))))
    names = ("noise_sd_N", "noise_corr_sd_N", "stroke_remainder_sd_N")
    values |= {name: np.array([[sd], [1.0]]) for name, sd in zip(names, (0.2, 0.3, 0.6), strict=True)}
    slack = BinShare(target.model, bins, target.guide, target.data.floor).at(values).slack
    assert slack is not None and slack.sd.shape == (2, bins.slack.sum())
    assert slack.sd == pytest.approx(np.broadcast_to([[0.7], [np.sqrt(3.0)]], slack.sd.shape))
    assert slack.floor == pytest.approx(np.broadcast_to([[2.9], [6.5]], slack.sd.shape))


def test_a_vector_without_a_number_says_nothing_and_spoils_no_other():
    rng = np.random.default_rng(2)
    slack = Slack(
        rng.uniform(-1.0, 1.0, (2, 4)), rng.standard_normal((2, 4, 1)), np.zeros((2, 4)), np.ones((2, 4))
    )
    others = np.full((2, 1, 1), 3.0), np.ones((2, 1)), np.ones(2)
    alone = with_slack(*others, [slack])
    slack.fixed[0] = np.nan
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = with_slack(*others, [slack])
    for whole, part in zip(alone, found, strict=True):
        assert np.isnan(part[0]).any()
        np.testing.assert_allclose(part[1], whole[1], rtol=1e-12)


@pytest.mark.parametrize(
    ("declared", "recorded", "floor"),
    [(None, 2.0, 2.0), (None, -3.0, 0.0), (0.5, 2.0, 0.5), (-1.0, 2.0, -1.0)],
)
def test_without_a_declared_floor_it_is_what_flagged_readings_read(declared, recorded, floor):
    """But for a muscle that pushes: its flags say that it does not pull."""
    flagged = np.arange(20) >= 15
    force = np.where(flagged, recorded, 10.0)
    gamma = np.linspace(0.0, 0.3, 20)
    grid = ForceMap(np.full(20, 1.5e5), gamma, force, np.zeros(20, int), np.zeros(20, int), flagged)
    made = build.specimen(
        {"law": "constant", "order": 1, "friction": "none"},
        levels_kPa=(150.0,),
        force_map=grid,
        sensors=Sensors(force_sd_N=NOISE, force_floor_N=declared),
    )
    assert build_target(made, draw_blueprint(made, build.PLAIN)).data.floor == floor
