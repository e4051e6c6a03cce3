"""A measured free contraction is the first root: no draw's force is gone short of it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from model import build

from mpam_calib.calibration import Calibration, calibrate
from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.posterior.chains.sampling import Sampling, sample
from mpam_calib.posterior.density.collapsed import Collapsed
from mpam_calib.posterior.density.target import build_target, locate
from mpam_calib.posterior.draws import Draws, keep_draws
from mpam_calib.posterior.early_root import early_roots, without_early_roots
from mpam_calib.prediction.curves import contraction_grid, first_root, force_curves
from mpam_calib.specimen.recording import BlockedForce, FreeContraction, Specimen

KPA = 1e3


def blocked_and_free() -> Specimen:
    """0.45 N/kPa above 8 kPa at full length, nothing at contractions that flatten with the pressure."""
    pressure = np.arange(20.0, 281.0, 20.0)
    force = np.append(0.0, 0.45 * (pressure - 8.0))
    return build.specimen(
        {"law": "linear", "order": 2, "friction": "none", "effects": ("dead_band",)},
        levels_kPa=(0.0, *pressure),
        blocked_force=BlockedForce(np.append(0.0, pressure) * KPA, force, np.zeros(15, dtype=bool)),
        free_contraction=FreeContraction(pressure * KPA, np.round(0.3 - 0.225 * 40 / (pressure + 20), 4)),
    )


@cache
def calibrated() -> Calibration:
    return calibrate(blocked_and_free(), max_steps=100)


@cache
def integrated() -> tuple[Collapsed, Sampling]:
    """The same with the moduli integrated out, under one slope for all draws."""
    made = blocked_and_free()
    target = build_target(made, draw_blueprint(made))
    target = replace(target, model=replace(target.model, coordinates_sampled=()))
    target, modes = locate(target, np.random.default_rng([0, 0]))
    return target, sample(target, modes, 0, 100)


@pytest.mark.long
def test_the_mean_lies_in_its_band() -> None:
    bands = calibrated().bands()
    free = bands[(bands["quantity"] == "free_contraction") & (bands["pressure_kPa"] > 0.0)]
    assert len(free) == 14
    assert (free["mean"] > free["q05"]).all() and (free["mean"] < free["q95"]).all()


@pytest.mark.long
def test_no_draw_has_an_early_root() -> None:
    made = calibrated()
    early = early_roots(made.target, made.draws)
    assert made.model.coordinates_sampled and early is not None and not early.any()
    free = made.specimen.free_contraction
    assert free is not None
    grid = contraction_grid(made.model, 0.3)
    force = force_curves(made.model, made.draws, free.pressure_Pa, grid, 0).force[:, :, 2]
    assert (first_root(grid, force) > free.contraction - 0.05).all()


def test_draws_that_stay_are_where_they_were_and_the_others_of_their_ensemble() -> None:
    target, sampling = integrated()
    sampled = keep_draws(target, sampling, 0)
    gone = early_roots(target, sampled)
    assert gone is not None and 0 < gone.sum() < 0.2 * len(sampled)
    left = without_early_roots(target, sampled, 0)
    after = early_roots(target, left)
    assert after is not None and not after.any()
    assert np.array_equal(left.u[~gone], sampled.u[~gone])
    assert np.array_equal(left.eta[~gone], sampled.eta[~gone])
    assert sampled.index is not None and left.index is not None
    assert left.index.shape == (sampled.chains, len(sampled) // sampled.chains)
    shape = (sampled.chains, -1, sampled.u.shape[1])
    for own, all_of_it in zip(left.u.reshape(shape), sampled.u.reshape(shape), strict=True):
        assert {tuple(u) for u in own} <= {tuple(u) for u in all_of_it}
    again = without_early_roots(target, sampled, 0)
    assert np.array_equal(again.u, left.u)
    # What is stored beside each draw is its own.
    drawn = sampling.chain.reshape(sampled.chains, -1, sampled.u.shape[1])
    assert np.array_equal(
        np.take_along_axis(drawn, left.index[:, :, None], axis=1).reshape(left.u.shape), left.u
    )


def by_hand(moduli: np.ndarray, contraction: float = 0.2) -> tuple[Specimen, Draws]:
    """Two ensembles of a muscle's draws without a remainder, with these moduli (prior sds)."""
    pressure = np.array([1e5, 2e5])
    made = build.specimen(
        {"law": "constant", "order": 1, "friction": "none"},
        levels_kPa=(100.0, 200.0),
        blocked_force=BlockedForce(pressure, np.full(2, 20.0), np.zeros(2, dtype=bool)),
        free_contraction=FreeContraction(pressure, np.full(2, contraction)),
    )
    target = build_target(made, draw_blueprint(made, build.PLAIN))
    u = np.zeros((len(moduli), len(target.model.names)))
    return made, Draws(u, target.model.values(u), moduli[:, None], 2, np.arange(len(moduli) // 2))


@pytest.mark.parametrize(("many", "replaced"), [(1, True), (2, True), (3, False)])
def test_where_most_contradict_the_data_all_are_left(many: int, replaced: bool) -> None:
    """A bladder that holds the muscle back at once, in some of the four draws of one ensemble."""
    moduli = np.zeros(8)
    moduli[4 : 4 + many] = -1e3
    made, draws = by_hand(moduli)
    target = build_target(made, draw_blueprint(made, build.PLAIN))
    early = early_roots(target, draws)
    assert early is not None and np.array_equal(early, moduli < 0.0)
    found = without_early_roots(target, draws, 0)
    assert (found is not draws) == replaced
    assert bool((found.eta < 0.0).any()) != replaced


def test_without_free_contractions_nothing_is_touched() -> None:
    moduli = np.full(8, -1e3)
    made, draws = by_hand(moduli)
    for other in (
        replace(made, free_contraction=None),
        by_hand(moduli, contraction=0.0)[0],  # which says that it pulls with nothing, or pushes
    ):
        target = build_target(other, draw_blueprint(other, build.PLAIN))
        own = replace(draws, values=target.model.values(np.zeros((8, len(target.model.names)))))
        assert early_roots(target, own) is None
        assert without_early_roots(target, own, 0) is own
