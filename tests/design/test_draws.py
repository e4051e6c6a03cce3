"""The model's chain at another geometry against an independent reckoning, and what a design is given."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mpam_calib.design import robust
from mpam_calib.design.draws import MuscleDraws
from mpam_calib.design.optimality import ActiveConstraint, Optimality
from mpam_calib.design.problem import case_one, case_two
from mpam_calib.design.robust import COLUMNS, Design, Optimiser, designs_table
from mpam_calib.model.blueprint import Blueprint, Options
from mpam_calib.model.model import Model, build_model
from mpam_calib.posterior.draws import Draws
from mpam_calib.prediction.curves import force_curves
from mpam_calib.specimen.declaration import Braid, Geometry, GeometrySd, Sensors, Simulation
from mpam_calib.units import DEG, MM

from . import by_hand

P = 200e3
R, ALPHA = 3 * MM, 72 * DEG
ROOT = np.sqrt(0.6)
T_BEST = R * (1.0 - ROOT)
F_BEST = P * np.pi * R**2 * (2.0 * ROOT * np.tan(ALPHA) ** 2 - 0.6)
"""Closed form of Case II at 200 kPa: 79.58756 N."""
X = np.array([2.4 * MM, 0.6 * MM, 66.0 * DEG])


def model(sd: float = 0.0, braid: Braid | None = None, remainder: bool = False, **declared: Any) -> Model:
    """A muscle of R 3 mm, t 0.7 mm, α 72°, with nothing but what is declared."""
    told: dict[str, Any] = {"effects": (), "friction": "none", "order": 2, "law": "constant"}
    geometry = Geometry(L0_mm=50.0, R0_mm=3.0, t0_mm=0.7, alpha0_deg=72.0, sd=GeometrySd(alpha0_deg=sd))
    return build_model(
        Blueprint(
            simulation=Simulation(**(told | declared)),
            geometry=geometry,
            braid=braid,
            sensors=Sensors(),
            levels=(1e5, 2e5, 3e5),
            stroke=0.015,
            reach=(0.3, 0.3, 0.3),
            pulls_at=1e5,
            stroke_time=None,
            reading_time=0.0,
            branches=False,
            free_contraction=False,
            tensile_range=None,
            options=Options(remainder=remainder, correlated_noise=False),
        )
    )


def point(made: Model, count: int = 50, **values: np.ndarray) -> Draws:
    """Draws at the middle of the prior with moduli of zero, but for what is given by name, (count,)."""
    u = np.zeros((count, len(made.names)))
    found = made.values(u) | {name: value[:, None] for name, value in values.items()}
    return Draws(u, found, np.zeros((count, sum(made.linear_sizes))), 1)


def designs(made: Model, draws: Draws, seed: int = 0) -> dict[tuple[str, str], Design]:
    return {(d.case, d.method): d for d in Optimiser(made, draws, seed).at(P)}


def test_a_point_posterior_gives_the_closed_form() -> None:
    made = model(effects=("dead_band",), strain="stretch")
    draws = point(made, P_DB_kPa=np.zeros(50))
    assert pytest.approx(79.58756, abs=5e-6) == F_BEST
    found = designs(made, draws)
    for method in ("posterior_mean", "q05"):
        two = found["II", method]
        assert two.force == pytest.approx(F_BEST, abs=1e-5)
        assert two.x == pytest.approx([R, T_BEST, ALPHA], rel=1e-6)
        one = found["I", method]
        assert one.x[3:] == pytest.approx([2.5 * MM, 100.0], rel=1e-5)
        assert F_BEST - one.force == pytest.approx(0.00324, abs=2e-5)


def test_the_pressure_that_does_no_work_is_taken_off() -> None:
    made = model(effects=("dead_band",))
    found = designs(made, point(made, P_DB_kPa=np.full(50, 50e3)))
    assert found["II", "posterior_mean"].force == pytest.approx(0.75 * F_BEST, abs=1e-5)


@pytest.mark.parametrize("strain", ["stretch", "engineering"])
@pytest.mark.parametrize("kinematics", ["inextensible_braid", "constant_thickness"])
def test_chain_at_another_geometry_is_the_reckoning_by_hand(strain: str, kinematics: str) -> None:
    rng = np.random.default_rng(4)
    # The tested braid's angle is off its drawing: a new braid's is not.
    effects = ("dead_band", "braid_angle", "tip_shape", "wall_pressure")
    made = model(strain=strain, kinematics=kinematics, effects=effects)
    given = {
        "P_DB_kPa": rng.normal(15e3, 3e3, 20),
        "tip_factor": rng.normal(0.9, 0.1, 20),
        "delta_alpha_deg": rng.normal(0.5, 0.5, 20) * DEG,
        "wall_factor": rng.normal(0.3, 0.1, 20),
    }
    draws = point(made, 20, **given)
    draws = Draws(draws.u, draws.values, 0.1 * rng.standard_normal(draws.eta.shape), 1)
    assert made.moduli is not None
    moduli = made.moduli.coefficients(draws.eta, draws.values)
    hand = by_hand.MuscleDraws.none(
        P,
        moduli,
        kinematics=kinematics,
        strain=strain,
        dead_band=given["P_DB_kPa"],
        tip_factor=given["tip_factor"],
        delta_alpha=np.zeros(20),
        wall_factor=given["wall_factor"],
    )
    muscle = MuscleDraws.prepare(made, draws, 20, 0)
    grid = np.linspace(0.0, 0.3, 31)
    assert muscle.curves(P, X, grid) == pytest.approx(by_hand.forces_along(hand, X, grid), rel=1e-9)
    assert muscle.blocked_forces(P, X) == pytest.approx(by_hand.blocked_forces(hand, X), rel=1e-9)
    roots = muscle.free_contractions(P, X)
    there = by_hand.free_contractions(hand, X, limit=0.6)
    assert roots == pytest.approx(np.where(np.isnan(there), 0.6, there), abs=1e-3)


@pytest.mark.parametrize("fitted", [False, True])
def test_strands_of_case_one_are_the_design_s(fitted: bool) -> None:
    braid = Braid(E_br_GPa=3.0, nu_s=0.33, R_br_mm=0.11, n=48)
    made = model(braid=braid, effects=("braid_stretch",) if fitted else ())
    draws = point(made, 5, **({"braid_factor": np.arange(5.0)} if fitted else {}))
    muscle = MuscleDraws.prepare(made, draws, 5, 0)
    five = np.stack([np.append(X, [0.12 * MM, 40.0]), np.append(X, [0.2 * MM, 60.0])])
    rigid = by_hand.MuscleDraws.none(P, np.zeros((5, 1)), E_br=3e9)
    with_loss, without = by_hand.blocked_forces(rigid, five), by_hand.blocked_forces(rigid, X)
    share = np.arange(5.0) if fitted else np.ones(5)
    assert muscle.blocked_forces(P, five) == pytest.approx(without + share * (with_loss - without), rel=1e-9)


def test_bands_widen_with_the_sd_of_the_angle() -> None:
    widths = []
    for sd in (0.0, 0.5, 1.0):
        made = model(sd)
        draws = point(made, 200)
        two = designs(made, draws)["II", "posterior_mean"]
        widths.append(float(np.subtract(*np.quantile(two.force, [0.95, 0.05]))))
        assert two.exact == pytest.approx(F_BEST, abs=1e-5)
        assert (np.ptp(two.contraction) > 0.003) == (sd > 0.0)
    # dF/F is 13 % a degree; the band spans 3.3 sd.
    assert widths[0] < 1e-9 and widths[2] == pytest.approx(2.0 * widths[1], rel=0.1)
    assert widths[2] == pytest.approx(3.29 * 0.125 * F_BEST, rel=0.1)


def test_tested_muscle_s_own_angle_stays_with_it() -> None:
    made = model(1.0)
    assert "alpha0_deg" in made.names
    off = point(made, 200, alpha0_deg=np.full(200, 60.0 * DEG))
    assert designs(made, off)["II", "posterior_mean"].force.mean() == pytest.approx(F_BEST, rel=0.02)


def test_careful_design_is_no_worse_in_what_it_is_careful_about() -> None:
    rng = np.random.default_rng(0)
    made = model(1.0, strain="stretch")
    draws = point(made, 60)
    # Moduli that turn over what a thicker wall does, in some draws.
    eta = rng.normal(0.0, 0.6, draws.eta.shape)
    found = designs(made, Draws(draws.u, draws.values, eta, 1))
    for case in ("I", "II"):
        mean, careful = found[case, "posterior_mean"], found[case, "q05"]
        assert np.quantile(careful.force, 0.05) >= np.quantile(mean.force, 0.05)
        assert mean.force.mean() >= careful.force.mean()
    assert np.quantile(found["II", "q05"].force, 0.05) > np.quantile(
        found["II", "posterior_mean"].force, 0.05
    )


def test_no_variable_alone_gains_in_the_careful_design() -> None:
    """Its aim has a kink wherever another draw becomes the one in twenty."""
    made = model(0.5, strain="stretch")
    draws = point(made, 200)
    eta = np.random.default_rng(2).standard_normal(draws.eta.shape)
    optimiser = Optimiser(made, Draws(draws.u, draws.values, eta, 1))
    careful = {d.case: d for d in optimiser.at(P) if d.method == "q05"}
    for case, problem in (("I", case_one(P)), ("II", case_two(P))):
        best = careful[case]
        for i in (0, 1, 2):
            along = np.tile(best.x, (400, 1))
            along[:, i] = np.linspace(problem.lower[i], problem.upper[i], 400)
            along = along[[problem.feasible(x) for x in along]]
            aim = np.quantile(optimiser.many.blocked_forces(P, along), 0.05, axis=-1)
            assert aim.max() < 1.001 * np.quantile(best.force, 0.05)


def test_remainder_keeps_its_share_of_the_gas_force() -> None:
    made = model(0.0)
    with_remainder = build_model(
        made.blueprint.model_copy(update={"options": Options(correlated_noise=False)})
    )
    draws = point(with_remainder, 3)
    eta = np.random.default_rng(1).standard_normal(draws.eta.shape)
    eta[:, : with_remainder.linear_sizes[0]] = 0.0
    muscle = MuscleDraws.prepare(with_remainder, Draws(draws.u, draws.values, eta, 1), 3, 0)
    plain = MuscleDraws.prepare(made, point(made, 3), 3, 0)
    own = np.array([R, 0.7 * MM, ALPHA])

    def gas(x: np.ndarray) -> float:
        return float(x[0] ** 2 * (2 * np.tan(x[2]) ** 2 - 1))

    left = [muscle.blocked_forces(P, x) - plain.blocked_forces(P, x) for x in (own, X)]
    assert np.all(left[0] != 0.0)
    assert left[1] == pytest.approx(left[0] * gas(X) / gas(own), rel=1e-9)


def test_same_seed_same_table() -> None:
    made = model(1.0)
    draws = point(made, 100)
    tables = [designs_table(Optimiser(made, draws, seed).at(P)) for seed in (0, 0, 1)]
    assert list(tables[0].columns) == COLUMNS
    assert tables[0].equals(tables[1]) and not tables[0].equals(tables[2])
    assert list(tables[0]["case"]) == ["I", "I", "II", "II"]
    assert tables[0]["n"].isna().tolist() == [False, False, True, True]


def test_what_was_found_of_the_test_no_new_muscle_has() -> None:
    """Zero, give and drift of the rig, and the error of one braid's angle."""
    values = {
        "offset_mm": 1.5 * MM,
        "compliance_mm_per_N": 0.01 * MM,
        "drift_N_per_min": 0.02,
        "delta_alpha_deg": -1.5 * DEG,
        "P_DB_kPa": 12e3,
    }
    names = ("length_offset", "rig_compliance", "force_drift", "braid_angle")
    forces = []
    for effects in (("dead_band",), ("dead_band", *names)):
        made = model(effects=effects)
        known = {name: np.full(50, value) for name, value in values.items() if name in made.names}
        assert len(known) == len(effects)
        forces.append(MuscleDraws.prepare(made, point(made, **known), 50, 0).blocked_forces(P, X))
    assert forces[1] == pytest.approx(forces[0], rel=1e-12)


def test_a_design_s_row_is_that_of_its_draws_in_laboratory_units() -> None:
    force, contraction = np.linspace(70.0, 80.0, 101), np.linspace(0.2, 0.4, 101) ** 2
    x = np.array([2.5e-3, 0.6e-3, np.radians(70.0), 0.12e-3, 48.0])
    one = Design("I", 2e5, "q05", x, force, force, contraction, ())
    two = Design("II", 3e5, "posterior_mean", x[:3], force[::-1], force, contraction, ())
    table = designs_table([two, one])
    assert table["case"].tolist() == ["I", "II"]
    row = table.iloc[0]
    geometry = ["pressure_kPa", "R_mm", "t_mm", "alpha_deg", "R_br_mm", "n"]
    assert row[geometry].tolist() == pytest.approx([200.0, 2.5, 0.6, 70.0, 0.12, 48.0])
    assert row[["blocked_force_N", "q05", "q50", "q95"]].tolist() == pytest.approx([75.0, 70.5, 75.0, 79.5])
    ends = [contraction.mean(), 0.21**2, 0.39**2]
    assert row[["free_contraction", "fc_q05", "fc_q95"]].tolist() == pytest.approx(ends)
    assert table[["R_br_mm", "n"]].iloc[1].isna().all()


def test_a_draw_that_pulls_to_the_end_of_the_curves_has_no_root() -> None:
    contraction = np.array([0.3, 0.6, 0.6, 0.4])
    found = Design("II", P, "q05", X, contraction, contraction, contraction, ())
    assert found.without_root == 0.5


def test_packed_strands_cost_what_their_energy_takes() -> None:
    """Of strands up to 0.13 mm a hundred fit round the muscle; of thicker ones 30, as many as it takes."""
    made = model()
    free, thin, thick = 2.5 * MM, 0.13 * MM, 2.0 * np.pi * R * np.sin(ALPHA) / 30.0
    found = Optimiser(made, point(made), 0).packed(P, (0.13 * MM, 2.5 * MM))

    def loss(radius: float, n: float) -> float:
        return 4.0 * np.pi * P**2 * R**4 * np.sin(ALPHA) / (2.1e9 * n * radius**2 * np.cos(ALPHA) ** 4)

    assert F_BEST - found.free == pytest.approx(loss(free, 100.0), rel=0.01)
    losses = [F_BEST - force for force in found.force]
    assert losses == pytest.approx([loss(thin, 100.0), loss(thick, 30.0)], rel=0.01)
    assert [x[4] for x in found.x] == [100.0, 30.0]


def test_no_tolerance_turns_a_strand_over() -> None:
    """An angle known to ten degrees: beyond 89° from the hoop direction none is wound."""
    made = model(10.0)
    muscle = MuscleDraws.prepare(made, point(made, 200), 200, 0)
    wound = ALPHA + muscle.tolerance["alpha0_deg"][:, 0]
    assert wound.max() > 91.0 * DEG
    T = np.tan(np.minimum(wound, 89.0 * DEG)) ** 2
    t = 0.7 * MM
    by_hand_force = P * np.pi * (R**2 * (2.0 * T - 1.0) + 2.0 * R * t - t**2 - 2.0 * t * R * T)
    assert muscle.blocked_forces(P, np.array([R, t, ALPHA])) == pytest.approx(by_hand_force, rel=1e-9)


def test_a_bound_that_a_design_only_touches_does_not_hold_it(monkeypatch: pytest.MonkeyPatch) -> None:
    touched = (
        ActiveConstraint("R at its upper bound", 2.0, "mm"),
        ActiveConstraint("V_bl/V >= low", 0.0, "1"),
    )
    monkeypatch.setattr(robust, "optimality", lambda problem, x: Optimality(touched, {}, 0.0))
    made = model()
    assert {d.held_by for d in Optimiser(made, point(made, 5)).at(P)} == {("R at its upper bound",)}


def test_free_moduli_change_between_levels_and_beyond_them() -> None:
    """At pressures without a level a design's bands are as wide as those of what was tested."""
    made = model(remainder=True, law="free")
    rng = np.random.default_rng(3)
    draws = point(made, 400)
    p = made.linear_sizes[0]
    eta = np.zeros_like(draws.eta)
    eta[:, :p] = rng.standard_normal(p)
    muscle = MuscleDraws.prepare(made, Draws(draws.u, draws.values, eta, 1), 400, 0)
    own = np.array([R, 0.7 * MM, ALPHA])
    gamma = np.linspace(0.05, 0.2, 4)
    for pressure in (150e3, 200e3, 250e3, 350e3):
        tested = force_curves(made, muscle.draws, np.array([pressure]), gamma, 0).force[:, 0, 2]
        assert muscle.curves(pressure, own, gamma) == pytest.approx(tested)
        spread = muscle.curves(pressure, X, gamma).std(axis=0)
        assert (spread > 1e-6).all() == (pressure != 200e3)
