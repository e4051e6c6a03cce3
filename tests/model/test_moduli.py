"""The moduli's block: a prior in newtons that no fitted row can change, and exact coefficients."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from physics import plain

from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.model.model import Model, build_model
from mpam_calib.model.moduli import Columns, Law, ModuliBlock, rate_parameters
from mpam_calib.model.readings import Readings
from mpam_calib.model.reference import GRID_POINTS, geometric_contraction
from mpam_calib.posterior.draws import Draws, reported
from mpam_calib.specimen.recording import BlockedForce
from mpam_calib.units import level_labels

from . import build

LAWS = ["constant", "linear", "exponential", "exponential_each", "free"]
TUBE = plain.Tube(0.05, 0.003, 0.0007, np.radians(72.0))
KINDS = [("inextensible_braid", "engineering"), ("constant_thickness", "stretch")]


def model_of(law: str, order: int = 3, kinematics: str = "inextensible_braid", strain: str = "engineering"):
    declared = {"law": law, "order": order, "kinematics": kinematics, "strain": strain, "friction": "none"}
    return build_model(build.blueprint(declared, build.PLAIN))


def pressure_part(law: str, P: float, level: int, rates: dict[str, float], k: int) -> list[float]:
    """h_a(P) for modulus k, by the contract's words."""
    if law == "constant":
        return [1.0]
    if law == "linear":
        return [P, 1.0]
    if law == "free":
        return [1.0 if j == level else 0.0 for j in range(3)]
    d, gap = (rates[n] for n in (("d", "gap") if law == "exponential" else (f"d_{k}", f"gap_{k}")))
    return [np.exp(d * P), np.exp((d - gap) * P)]


def grid_matrix(model: Model, law: str, order: int, kinematics: str, strain: str, values) -> np.ndarray:
    """Force per coefficient on levels × contractions, from the scalar formulas: (N, terms·order)."""
    assert model.setting is not None
    rates = {name: float(v[0, 0]) for name, v in values.items()}
    rows = []
    limit = geometric_contraction(model.setting.geometry)
    for level, P in enumerate(model.setting.levels):
        for gamma in np.linspace(0.0, limit, GRID_POINTS):
            L = TUBE.L0 * (1.0 - gamma)
            R = plain.radius(TUBE, L, kinematics)
            t, T = plain.wall(TUBE, L, R, kinematics), plain.tan2(TUBE, L)
            parts = [pressure_part(law, P, level, rates, k) for k in range(1, order + 1)]
            force = [plain.per_modulus(TUBE, L, R, t, T, k, strain) for k in range(1, order + 1)]
            rows.append([parts[k][a] * force[k] for a in range(len(parts[0])) for k in range(order)])
    return np.array(rows)


def prior_values(model: Model, seed: int) -> dict[str, np.ndarray]:
    u = np.random.default_rng(seed).standard_normal((1, len(model.names)))
    return model.values(u)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("kinematics", "strain"), KINDS)
def test_the_prior_is_in_newtons_on_the_reference_grid(law, kinematics, strain):
    """Forces of the wall on the grid have rms `force_scale`, alike in every direction they can take."""
    model = model_of(law, 3, kinematics, strain)
    assert model.moduli is not None
    values = prior_values(model, 4)
    G = grid_matrix(model, law, 3, kinematics, strain, values)
    transform = model.moduli.transform(values)[1][0]
    forces = G @ transform
    scale = model.setting.force_scale
    assert np.sum(forces**2) / len(G) == pytest.approx(scale**2, rel=1e-5)
    # The polynomial basis is ill-conditioned (1e4 in stretches), so the last digits of G count here.
    gram = forces.T @ forces / len(G)
    assert gram == pytest.approx(scale**2 / G.shape[1] * np.eye(G.shape[1]), abs=1e-4 * scale**2)


def test_the_force_scale_is_the_ideal_gas_force():
    model = model_of("linear")
    squares = []
    for P in (1e5, 1.5e5, 2e5):
        for gamma in np.linspace(0.0, geometric_contraction(build.GEOMETRY), GRID_POINTS):
            L = TUBE.L0 * (1.0 - gamma)
            squares.append(
                plain.gas(P, plain.radius(TUBE, L, "inextensible_braid"), plain.tan2(TUBE, L)) ** 2
            )
    assert model.setting.force_scale == pytest.approx(np.sqrt(np.mean(squares)), rel=1e-9)


def test_drawn_walls_have_that_size():
    """Monte Carlo through the chain itself: force with moduli less force without, on the grid."""
    model = model_of("linear", 4)
    assert model.chain is not None
    setting = model.setting
    gamma = np.linspace(0.0, geometric_contraction(setting.geometry), GRID_POINTS)
    P, x = np.meshgrid(setting.levels, gamma * setting.geometry.L0, indexing="ij")
    readings = Readings.at_rest(P.ravel(), x.ravel())
    eta = np.random.default_rng(0).standard_normal((4000, 8))
    with_wall = model.chain.force({}, eta, readings)
    without = model.chain.force({}, np.zeros((1, 8)), readings)
    square = np.mean((with_wall - without) ** 2, axis=1)
    # A mean square over 8 equal directions: relative sd √(2/8), over 4,000 draws 0.0079; 4 sd.
    assert square.mean() == pytest.approx(setting.force_scale**2, rel=4 * 0.0079)


@pytest.mark.parametrize("law", ["linear", "exponential", "free"])
def test_rows_that_are_fitted_do_not_change_the_prior(law):
    """More rows, longer strokes, blocked forces or a fold: the same transform to the last bit."""
    declared = {"law": law, "order": 3}
    few = build.blueprint(declared, recorded=build.loops(rows=12))
    many = build.blueprint(declared, recorded=build.loops(rows=200, strokes_mm=14.0, cycles=3))
    blocked = BlockedForce(np.array([1e5, 2e5]), np.array([30.0, 60.0]), np.zeros(2, dtype=bool))
    added = build.blueprint(declared, blocked_force=blocked)
    models = [build_model(b) for b in (few, many, added)]
    values = prior_values(models[0], 1)
    transforms = [m.moduli.transform(values)[1] for m in models]
    assert np.array_equal(transforms[0], transforms[1])
    assert np.array_equal(transforms[0], transforms[2])


def coefficients_to_eta(block: ModuliBlock, values, wanted: np.ndarray) -> np.ndarray:
    matrix = block.transform(values)[1][0]
    return np.linalg.solve(matrix, wanted)[None]


@pytest.mark.parametrize("law", LAWS)
def test_coefficients_drawn_back_are_the_force(law):
    """The thesis's coefficients of a draw, put into the scalar formulas, give the chain's own force."""
    order = 3
    model = model_of(law, order)
    assert model.chain is not None
    assert model.moduli is not None
    rng = np.random.default_rng(7)
    for seed in range(5):
        values = prior_values(model, seed)
        rates = {name: float(v[0, 0]) for name, v in values.items()}
        eta = rng.standard_normal((1, model.linear_sizes[0]))
        coefficients = model.moduli.coefficients(eta, values)[0].reshape(-1, order)
        level, gamma = rng.integers(0, 3, 6), rng.uniform(0.0, 0.3, 6)
        P = model.setting.levels[level]
        readings = replace(Readings.at_rest(P, gamma * 0.05), level=level)
        found = model.chain.force(values, eta, readings)[0]
        for i in range(6):
            E = [
                sum(c * h for c, h in zip(coefficients[:, k - 1],
                    pressure_part(law, P[i], int(level[i]), rates, k), strict=True))
                for k in range(1, order + 1)
            ]  # fmt: skip
            expected = plain.static(TUBE, P[i], gamma[i], E, "inextensible_braid", "engineering")
            size = sum(abs(e) for e in E) * 1e-4
            # Moduli of 1e6 Pa on levers of 1e-4 m² cancel to newtons: the digits that are left.
            assert found[i] == pytest.approx(expected, rel=1e-9, abs=1e-10 * size)


@pytest.mark.parametrize("law", LAWS)
def test_any_coefficients_can_be_reached(law):
    model = model_of(law, 3)
    assert model.moduli is not None
    values = prior_values(model, 2)
    wanted = np.random.default_rng(1).standard_normal(model.linear_sizes[0]) * 1e5
    eta = coefficients_to_eta(model.moduli, values, wanted)
    assert model.moduli.coefficients(eta, values)[0] == pytest.approx(wanted, rel=1e-6, abs=1e-3)


@pytest.mark.parametrize(
    ("law", "names"),
    [
        ("constant", ["E_1", "E_2"]),
        ("linear", ["a_1", "a_2", "b_1", "b_2"]),
        ("exponential", ["c_1", "c_2", "w_1", "w_2", "d", "z"]),
        ("exponential_each", ["c_1", "c_2", "w_1", "w_2", "d_1", "z_1", "d_2", "z_2"]),
        ("free", ["E_1@100", "E_2@100", "E_1@150", "E_2@150", "E_1@200", "E_2@200"]),
    ],
)
def test_reported_in_the_thesis_s_terms(law, names):
    model = model_of(law, 2)
    rng = np.random.default_rng(0)
    u = rng.standard_normal((200, len(model.names)))
    values = model.values(u)
    eta = rng.standard_normal((200, sum(model.linear_sizes)))
    listed = {item.name: item for item in reported(model, Draws(u, values, eta, 1))}
    assert set(listed) == {*names, "noise_sd_N"}
    if law == "exponential":
        assert listed["z"].draws == pytest.approx(((values["d"] - values["gap"])[:, 0]) * 1e3)
        assert np.all(listed["d"].draws > listed["z"].draws)
    if law == "linear":
        # a in Pa/kPa: at P kPa the modulus is a·P + b.
        coefficients = model.moduli.coefficients(eta[:, :4], values)
        E_1 = coefficients[:, 0] * 1.5e5 + coefficients[:, 2]
        assert listed["a_1"].draws * 150.0 + listed["b_1"].draws == pytest.approx(E_1)
        assert listed["a_1"].unit == "Pa/kPa"


def test_declared_moduli_have_one_common_factor():
    declared = {"moduli": "tensile", "E_Pa": (4e4, 2.6e4), "E_rel_sd": 0.1, "order": 2, "law": "constant"}
    model = build_model(build.blueprint(declared, build.PLAIN))
    eta = np.random.default_rng(0).standard_normal((20_000, 1))
    drawn = model.moduli.coefficients(eta, {})
    assert drawn[:, 1] / drawn[:, 0] == pytest.approx(2.6 / 4.0)
    # 20,000 draws: the mean to 4·0.1/√20000, the sd to 4·0.1/√40000 of themselves.
    assert drawn[:, 0].mean() / 4e4 == pytest.approx(1.0, abs=0.003)
    assert drawn[:, 0].std() / 4e4 == pytest.approx(0.1, abs=0.002)


def test_folds_share_the_blueprint():
    """A fold's own blueprint would know other levels; the whole specimen's gives it the same prior."""
    made = build.specimen({"law": "linear", "order": 3}, build.loops())
    made = build.with_force(made, np.full(72, 10.0))
    whole = draw_blueprint(made)
    fold = build.take_levels(made, [0, 2])
    from mpam_calib.posterior.density.target import build_target

    full, part = build_target(made, whole), build_target(fold, whole)
    assert full.model.names == part.model.names
    assert [p.prior for p in full.model.parameters] == [p.prior for p in part.model.parameters]
    values = prior_values(full.model, 0)
    a, b = (t.model.moduli.transform(values)[1] for t in (full, part))
    assert np.array_equal(a, b)
    rows = build.rows_of(made.loops)
    assert np.array_equal(full.model.remainder.columns(rows), part.model.remainder.columns(rows))
    assert len(part.data.bins) == len(full.data.bins) * 2 // 3


@pytest.mark.parametrize("law", ["exponential", "exponential_each"])
def test_rates_that_no_walker_should_have_still_give_a_force(law: str) -> None:
    """A stretch move may try any u: rates that meet, and rates that leave one level alone in sight."""
    model = model_of(law)
    assert model.moduli is not None
    names = [p.name for p in model.parameters if p.name.split("_")[0] in ("d", "gap")]
    priors = {p.name: p.prior for p in model.parameters}
    u = np.random.default_rng(0).uniform(-36.0, 36.0, (2000, len(names)))
    u[0], u[1] = -36.0, 36.0
    values = {name: priors[name].from_normal(u[:, i : i + 1]) for i, name in enumerate(names)}
    levels, columns = model.moduli.grid or (np.empty(0), np.empty(0))
    _, transform = model.moduli.transform(values)
    assert np.isfinite(transform).all()
    # What is left is still forces of the stated size on the grid: orthogonal, or left out.
    h = model.moduli.law.basis(levels, np.full(len(levels), -1), values)
    grid = (h[:, :, None, :, :] * columns[None, None, :, None, :]).reshape(len(u), -1, transform.shape[1])
    forces = grid @ transform
    gram = np.swapaxes(forces, 1, 2) @ forces / forces.shape[1] * transform.shape[1] / model.moduli.scale**2
    kept = np.abs(np.diagonal(gram, axis1=1, axis2=2)) > 0.5
    assert kept.any(axis=1).all()
    wanted = np.where(kept[:, :, None] & kept[:, None, :], np.eye(transform.shape[1]), 0.0)
    np.testing.assert_allclose(gram, wanted, atol=1e-4)


@pytest.mark.parametrize("gap", [0.0, 0.5, 1.0])
def test_close_levels_far_from_zero_are_told_apart(gap: float) -> None:
    """Up to a prior sd above the usual gap: 30 kPa between the levels, exponents of absolute pressure."""
    levels = np.array([480e3, 490e3, 500e3, 510e3])
    law = Law("exponential", 1, levels)
    priors = {p.name: p.prior for p in rate_parameters("exponential", 1, levels)}
    values = {name: priors[name].from_normal(np.full((1, 1), u)) for name, u in (("d", 0.0), ("gap", gap))}
    slower = law.basis(levels, np.full(4, -1), values)[0, :, 1, 0]
    assert slower[1:] / slower[:-1] == pytest.approx(np.full(3, np.exp(-1e4 * values["gap"][0, 0])), rel=1e-9)


@pytest.mark.parametrize(
    ("levels", "labels"),
    [((100.0, 150.0), ["100", "150"]), ((12.5, 13.5, 14.5, 15.5), ["12.5", "13.5", "14.5", "15.5"])],
)
def test_every_level_has_parameters_of_its_own(levels, labels):
    """Levels that round to the same kilopascal shared one factor."""
    declared = {"law": "free", "order": 1, "friction": "coulomb", "friction_by_pressure": True}
    model = build_model(build.blueprint(declared, recorded=build.loops(levels)))
    assert [n for n in model.names if n.startswith("K_f")] == [f"K_f@{label}" for label in labels]
    assert model.moduli.law.coefficient_names() == [f"E_1@{label}" for label in labels]


@pytest.mark.parametrize("law", LAWS)
def test_every_quantity_of_a_summary_says_what_it_is(law):
    declared = {"law": law, "order": 2, "friction": "coulomb", "friction_by_pressure": True}
    model = build_model(build.blueprint(declared, recorded=build.loops([50.0, 100.0, 200.0])))
    u, eta = np.zeros((3, len(model.names))), np.zeros((3, sum(model.linear_sizes)))
    listed = {item.name: item.meaning for item in reported(model, Draws(u, model.values(u), eta, 1))}
    assert all(listed.values())
    assert listed["K_f@50"] == "Coulomb friction, as a share of the force, at 50 kPa"
    name, meaning = {
        "constant": ("E_1", "modulus of strain to the power 1"),
        "linear": ("b_2", "modulus E_2: value at zero pressure"),
        "exponential": ("d", "faster rate of the law"),
        "exponential_each": ("z_2", "slower rate of modulus E_2"),
        "free": ("E_2@100", "modulus of strain to the power 2, at 100 kPa"),
    }[law]
    assert listed[name] == meaning


def test_levels_that_are_the_same_have_no_labels():
    with pytest.raises(ValueError, match="not apart"):
        level_labels([1e5, 1e5])


@pytest.mark.parametrize("order", [None, 1, 3])
@pytest.mark.parametrize("batch", [1, 4])
def test_columns_say_the_same_multiplied_out_or_not(order: int | None, batch: int) -> None:
    """With functions of pressure that all moduli share (None), or of each one's own; a gain of the stress."""
    rng = np.random.default_rng(3)
    n, terms, orders = 7, 2, order or 3
    h = rng.standard_normal((batch, n, terms, order or 1))
    gain, transform = rng.uniform(0.5, 1.5, (batch, n)), rng.standard_normal((1, terms * orders, 5))
    columns = Columns(h, rng.standard_normal((1, n, orders)), gain, transform)
    assert columns.size == 5
    for eta in (rng.standard_normal(5), rng.standard_normal((batch, 5))):
        by_hand = np.einsum("bnp,bp->bn", columns.every(), np.broadcast_to(eta, (batch, 5)))
        np.testing.assert_allclose(columns.times(eta), by_hand, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(columns.first().every(), columns.every()[:1])
    none = Columns.none(n)
    assert none.size == 0 and none.every().shape == (1, n, 0)
    np.testing.assert_array_equal(none.times(np.zeros(0)), np.zeros((1, n)))
