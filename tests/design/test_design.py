"""The optimiser against closed forms, and its claims against the thesis's problem."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mpam_calib.design import blocked
from mpam_calib.design.optimality import optimality
from mpam_calib.design.problem import RATIO_LOW, case_one, case_two
from mpam_calib.design.search import hybrid, refine, to_bounds
from mpam_calib.design.sensitivity import around, of_ratio_bound
from mpam_calib.physics.kinematics import Rest
from mpam_calib.physics.statics import braid_energy_force
from mpam_calib.thesis import decoded
from mpam_calib.units import DEG, MM

from . import by_hand as draws

P = 200e3
R, ALPHA = 3 * MM, 72 * DEG
T = np.tan(ALPHA) ** 2


def closed_form(ratio: float) -> tuple[float, float]:
    """Best wall (m) and force (N) of Case II at R and α on their upper bounds, for V_bl/V = ratio."""
    root = np.sqrt(1.0 - ratio)
    return R * (1.0 - root), P * np.pi * R**2 * (2.0 * root * T - root**2)


def test_braid_loss_is_equation_2_25_at_rest() -> None:
    rest = Rest(np.asarray(0.05), np.asarray(R), np.asarray(0.7 * MM), np.asarray(ALPHA))
    energy = braid_energy_force(np.asarray(P), np.asarray(0.05), rest, 2.1e9, 0.11 * MM, 48)
    loss = blocked.braid_loss(np.asarray(P), R, ALPHA, np.asarray(0.11 * MM), np.asarray(48.0), 2.1e9)
    assert loss == pytest.approx(float(energy), rel=1e-12)


def test_a_hundred_random_starts_reach_the_closed_form() -> None:
    t, F = closed_form(0.4)
    # Few generations: the evolutionary stage then stops short, as the thesis's does (Table 3.3).
    runs = [hybrid(case_two(P), seed, generations=6) for seed in range(100)]
    assert min(run.start.value for run in runs) < F - 1.0
    for run in runs:
        for stage in run.stages:
            assert stage.value == pytest.approx(F, abs=1e-5)
            assert stage.x == pytest.approx([R, t, ALPHA], rel=1e-5)
            assert run.problem.feasible(stage.x, 1e-7)


def test_case_one_ends_at_a_hundred_strands() -> None:
    best = hybrid(case_one(P), 1, generations=15).best
    assert best.x[4] == 100.0
    assert best.x[3] == pytest.approx(2.5 * MM, rel=1e-4)
    loss = blocked.braid_loss(np.asarray(P), R, ALPHA, np.asarray(2.5 * MM), np.asarray(100.0), 2.1e9)
    assert best.value == pytest.approx(closed_form(0.4)[1] - loss, abs=1e-5)


def test_packing_leaves_no_room_for_thick_strands() -> None:
    run = hybrid(case_one(P, packing=True), 0, generations=15)
    # n R_br² is largest, on n R_br = 2πR sin α, with as few strands as the bounds allow.
    assert run.best.x[4] == 30.0
    assert run.best.x[3] == pytest.approx(2 * np.pi * R * np.sin(ALPHA) / 30, rel=1e-5)
    free = hybrid(case_one(P), 0, generations=15).best
    assert closed_form(0.4)[1] - run.best.value > 50 * (closed_form(0.4)[1] - free.value)


def test_integer_is_kept_where_the_best_is_between_two() -> None:
    problem = case_one(P)

    def towards(x: np.ndarray) -> np.ndarray:
        return -((x[..., 4] - 57.4) ** 2) + problem.objective(x)

    shifted = case_one(P, objective=towards)
    start = np.array([2.5 * MM, 0.8 * MM, 70 * DEG, 1 * MM, 40.0])
    assert refine(shifted, start, "SQP").x[4] == 57.0


def test_to_bounds_moves_what_gains_and_is_allowed() -> None:
    # n and R_br go to their upper bounds; the wall's lower bound would break the constraint.
    x = to_bounds(case_one(P), np.array([R, 0.8 * MM, ALPHA, 2.4 * MM, 75.0]))
    assert x == pytest.approx([R, 0.8 * MM, ALPHA, 2.5 * MM, 100.0])
    packed = case_one(P, packing=True)
    start = np.array([R, 0.8 * MM, ALPHA, 0.1 * MM, 75.0])
    assert packed.feasible(to_bounds(packed, start)) and to_bounds(packed, start)[4] == 100.0


def test_part_of_the_way_to_bounds_kinks_are_found_and_integers_stay_whole() -> None:
    problem = replace(
        case_one(P), objective=lambda x: -np.abs(x[..., 4] - 80.0) - np.abs(x[..., 1] / MM - 1.1)
    )
    start = np.array([R, 0.8 * MM, ALPHA, 2.4 * MM, 45.0])
    x = to_bounds(problem, start, [0.5**k for k in range(12)])
    assert x[4] == 80.0 and x[1] == pytest.approx(1.1 * MM, rel=1e-3)
    assert x[[0, 2, 3]] == pytest.approx(start[[0, 2, 3]])


def test_multipliers_are_the_derivatives_of_the_optimum() -> None:
    problem = case_two(P)
    best = refine(problem, np.array([2.8 * MM, 0.9 * MM, 70 * DEG]), "SQP")
    found = optimality(problem, best.x)
    assert found.residual < 1e-6
    by_name = {a.name: a.multiplier for a in found.active}
    assert set(by_name) == {"R at its upper bound", "α at its upper bound", "V_bl/V >= low"}
    h = 1e-4
    slope = (closed_form(0.4 + h)[1] - closed_form(0.4 - h)[1]) / (2 * h)
    assert by_name["V_bl/V >= low"] == pytest.approx(-slope, rel=1e-4)
    # Along the active constraint t grows with R, so that F grows with R².
    assert by_name["R at its upper bound"] == pytest.approx(2 * best.value / 3, rel=1e-4)


def test_a_point_that_is_no_optimum_leaves_a_residual() -> None:
    problem = case_two(P)
    assert optimality(problem, np.array([2.8 * MM, 0.9 * MM, 70 * DEG])).residual > 0.5


def test_sensitivity_follows_the_closed_form() -> None:
    t, F = closed_form(0.4)
    x = np.array([R, t, ALPHA])
    table = around(case_two(P), x)
    assert table[table.factor == 1.0].force_N.to_numpy() == pytest.approx(F, rel=1e-12)
    thin = table[(table.variable == "t") & (table.factor == table.factor.min())].iloc[0]
    assert thin.force_N > F and not thin.allowed
    bound = of_ratio_bound(lambda low: case_two(P, ratio_low=low), x)
    assert bound.force_N.to_numpy() == pytest.approx([closed_form(b)[1] for b in bound.bound], abs=1e-4)
    assert bound.bound.iloc[5] == pytest.approx(RATIO_LOW)


def test_draws_without_effects_are_the_decoded_muscle() -> None:
    moduli = decoded.moduli("MPAM1")
    x = np.array([decoded.R0, decoded.T0, decoded.ALPHA0])
    for level, pressure in enumerate(decoded.LEVELS):
        one = draws.MuscleDraws.none(float(pressure), moduli[level : level + 1])
        F0 = decoded.force(pressure, np.array(0.0), moduli[level])
        assert draws.blocked_forces(one, x) == pytest.approx(F0, rel=1e-9)
        root = decoded.first_root(float(pressure), moduli[level])
        assert draws.free_contractions(one, x) == pytest.approx(root, abs=2e-5)


def test_effects_of_draws_act_as_named() -> None:
    zero = np.zeros((4, 1))
    x = np.array([[R, 0.7 * MM, ALPHA], [R, 0.8 * MM, 70 * DEG]])
    plain = draws.blocked_forces(draws.MuscleDraws.none(P, zero), x)
    assert plain.shape == (2, 4)
    dead = np.array([0.0, 10e3, 50e3, 300e3])
    forces = draws.blocked_forces(draws.MuscleDraws.none(P, zero, dead_band=dead), x)
    assert forces[0] == pytest.approx(plain[0] * np.array([1.0, 0.95, 0.75, 0.0]))
    no_wall = draws.MuscleDraws.none(P, zero, wall_factor=np.ones(4))
    assert draws.blocked_forces(no_wall, x)[0] == pytest.approx(
        float(blocked.gaylord_force(np.asarray(P), R, ALPHA))
    )
    assert draws.mean_force(no_wall)(x).shape == (2,)


def test_optimum_over_draws_beats_its_neighbours() -> None:
    rng = np.random.default_rng(3)
    tolerance = np.radians(rng.normal(0.0, 1.0, 200))
    many = draws.MuscleDraws.none(
        P, np.zeros((200, 1)), dead_band=rng.normal(15e3, 3e3, 200), delta_alpha=tolerance
    )
    problem = case_two(P, objective=draws.mean_force(many))
    best = hybrid(problem, 0, local=("SQP",), generations=8).best
    assert best.x == pytest.approx([R, closed_form(0.4)[0], ALPHA], rel=1e-4)
    careful = hybrid(case_two(P, objective=draws.quantile_force(many)), 0, local=("SQP",), generations=8).best
    assert careful.value < best.value
