"""Free contractions without a force along the stroke: each draw's curve falls in its own way."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from model import build
from scipy import stats

from mpam_calib.calibration import calibrate
from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.model.readings import Readings
from mpam_calib.posterior.density.collapsed import Collapsed
from mpam_calib.posterior.density.free_ends import Short
from mpam_calib.posterior.density.target import build_target, locate, predict_force
from mpam_calib.specimen.recording import BlockedForce, ForceMap, FreeContraction, Specimen

Array = np.ndarray
PRESSURE = np.array([80.0, 120.0, 160.0, 200.0]) * 1e3
L0 = build.GEOMETRY.L0_mm * 1e-3
TWO = {"law": "constant", "order": 2, "friction": "none", "strain": "engineering"}


def ends(contraction: Array, blocked: Array | None = None, **simulation: object) -> Specimen:
    """Blocked forces (N) and free contractions at PRESSURE."""
    force = np.full(4, 20.0) if blocked is None else blocked
    return build.specimen(
        TWO | simulation,
        levels_kPa=tuple(PRESSURE / 1e3),
        blocked_force=BlockedForce(PRESSURE, force, np.zeros(4, dtype=bool)),
        free_contraction=FreeContraction(PRESSURE, contraction),
    )


def plain_target(made: Specimen) -> Collapsed:
    return build_target(made, draw_blueprint(made, build.PLAIN))


def curves(target: Collapsed, moduli: Array, contraction: Array) -> Array:
    """Force (B, 4, n), N, of moduli's coordinates (B, 2) at contractions (4, n), a row for each pressure."""
    rows = Readings.at_rest(np.repeat(PRESSURE, contraction.shape[1]), L0 * contraction.ravel())
    values = target.model.values(np.zeros((1, len(target.model.names))))
    return predict_force(target.model, values, moduli, rows).reshape(len(moduli), 4, -1)


def vectors(target: Collapsed, moduli: Array) -> Array:
    """Coordinates (B, d) of these moduli (B, 2) at the centre of all other priors."""
    u = np.zeros((len(moduli), len(target.model.names)))
    u[:, [target.model.names.index(f"modulus_coordinate_{i}") for i in (1, 2)]] = moduli
    return u


def from_zero(target: Collapsed) -> tuple[Array, Array]:
    """Some moduli (n, 2) whose curves fall to their first root at every pressure, and these roots (n, 4)."""
    rng = np.random.default_rng(0)
    moduli = 0.3 * rng.standard_normal((400, 2))
    grid = np.linspace(0.0, 0.45, 1801)
    force = curves(target, moduli, np.tile(grid, (4, 1)))
    below = force <= 0.0
    kept = below.any(axis=2).all(axis=1) & (force[:, :, 0] > 0.0).all(axis=1)
    roots = grid[below.argmax(axis=2)]
    kept &= (np.diff(force, axis=2).max(axis=(1, 2)) < 0.0) & (roots.min(axis=1) > 0.03)
    return moduli[kept], roots[kept]


def test_their_density_is_that_of_the_first_root() -> None:
    """A contraction read with a noise, and a force of zero with another's, stand at the curve's root."""
    target = plain_target(ends(np.full(4, 0.2)))
    moduli, roots = from_zero(target)
    assert len(moduli) >= 20
    rng = np.random.default_rng(1)
    found, expected = [], []
    for eta, root in zip(moduli[:20], roots[:20], strict=True):
        read = root + 0.001 * rng.standard_normal(4)
        blocked = curves(target, eta[None], np.zeros((4, 1)))[0, :, 0]
        there = plain_target(ends(read, blocked))
        u = vectors(there, eta[None])
        values = {name: float(value[0, 0]) for name, value in there.model.values(u).items()}
        step = np.array([-1e-4, 1e-4])
        sides = curves(target, eta[None], root[:, None] + step)[0]
        falls = (sides[:, 0] - sides[:, 1]) / 2e-4
        white, sd = values["noise_sd_N"], values["contraction_sd"]
        expected.append(
            stats.norm.logpdf(read, root, np.hypot(sd, white / falls)).sum()
            + 4 * stats.norm.logpdf(0.0, 0.0, white)
        )
        found.append(float(there.log_likelihood(there.model.values(u))[0]))
    assert np.abs(np.array(found) - expected).max() < 0.1
    assert np.ptp(expected) > 0.3


def test_a_curve_that_is_gone_short_of_them_or_rises_there_is_none() -> None:
    target = plain_target(ends(np.full(4, 0.2)))
    moduli, roots = from_zero(target)
    late = int(roots.min(axis=1).argmax())
    u = vectors(target, moduli[late][None])
    for off, possible in ((0.0, True), (0.1, False)):
        there = plain_target(ends(roots[late] + off))
        assert np.isfinite(there.log_posterior(u))[0] == possible
    # Turned over, the same curve rises through its root.
    rising = plain_target(ends(np.full(4, 1e-3)))
    pushes = vectors(rising, np.array([[-30.0, 0.0], [30.0, 0.0]]))
    slope = np.diff(curves(rising, pushes[:, -2:], np.full((4, 2), [0.0, 2e-3])), axis=2)[:, :, 0]
    assert np.array_equal(np.isfinite(rising.log_posterior(pushes)), (slope < 0.0).all(axis=1))
    assert (slope > 0.0).all(axis=1).any()


@cache
def recorded() -> Specimen:
    """Ends of a muscle of the model's own, its curves well bent, with some noise."""
    target = plain_target(ends(np.full(4, 0.2)))
    moduli, roots = from_zero(target)
    chosen = int(np.abs(roots.mean(axis=1) - 0.2).argmin())
    rng = np.random.default_rng(2)
    blocked = curves(target, moduli[chosen][None], np.zeros((4, 1)))[0, :, 0]
    return ends(roots[chosen] + 0.003 * rng.standard_normal(4), blocked + 0.2 * rng.standard_normal(4))


def test_draws_are_those_of_a_posterior_by_quadrature() -> None:
    """Quantiles of the force half way, against sums over a grid of two moduli and two noises."""
    made = recorded()
    assert made.blocked_force is not None and made.free_contraction is not None
    read = made.free_contraction.contraction
    drawn = calibrate(made, options=build.PLAIN, seed=3)
    target = drawn.target
    assert drawn.converged and len(target.model.coordinates_sampled) == 2
    half = 0.5 * read[:, None]
    sampled = curves(target, drawn.draws.eta[:, :2], half)[:, :, 0]

    low, high = (np.quantile(drawn.draws.eta[:, :2], q, axis=0) for q in (0.0005, 0.9995))
    wide = 0.4 * (high - low)
    axes = [np.linspace(low[i] - wide[i], high[i] + wide[i], 90) for i in (0, 1)]
    moduli = np.stack([x.ravel() for x in np.meshgrid(*axes, indexing="ij")], axis=1)
    noises = np.linspace(-3.5, 3.5, 29)
    u = np.zeros((29, len(target.model.names)))
    names = target.model.names
    u[:, names.index("noise_sd_N")] = u[:, names.index("contraction_sd")] = noises
    values = target.model.values(u)
    white, sd = values["noise_sd_N"][:, 0], values["contraction_sd"][:, 0]
    force = curves(target, moduli, np.stack([read - 5e-4, read, read + 5e-4], axis=1))
    falls = (force[:, :, 0] - force[:, :, 2]) / 1e-3
    grid = np.linspace(0.0, 1.0, 60) * (read.min() - 0.02)
    early = (curves(target, moduli, np.tile(grid, (4, 1))) <= 0.0).any(axis=(1, 2))
    blocked = made.blocked_force.force_N - curves(target, moduli[:1], np.zeros((4, 1)))[0, :, 0]
    height = np.zeros((len(moduli), 29, 29))
    height += stats.norm.logpdf(blocked[:, None], 0.0, white).sum(axis=0)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        for i in range(4):
            spread = np.hypot(white[:, None], falls[:, i, None, None] * sd)
            height += np.log(np.maximum(falls[:, i], 0.0))[:, None, None]
            height += stats.norm.logpdf(force[:, i, 1, None, None], 0.0, spread)
    height += stats.norm.logpdf(noises)[:, None] + stats.norm.logpdf(noises)
    height += stats.norm.logpdf(moduli).sum(axis=1)[:, None, None]
    height[early | (falls <= 0.0).any(axis=1)] = -np.inf
    weight = np.exp(height - height.max()).sum(axis=(1, 2))
    weight /= weight.sum()
    edge = np.isclose(moduli, [axes[0][0], axes[1][0]]) | np.isclose(moduli, [axes[0][-1], axes[1][-1]])
    assert weight[edge.any(axis=1)].sum() < 1e-3
    exact = curves(target, moduli, half)[:, :, 0]
    for level in range(4):
        order = np.argsort(exact[:, level])
        share = np.cumsum(weight[order])
        for q in (0.05, 0.25, 0.5, 0.75, 0.95):
            there = exact[order[np.searchsorted(share, q)], level]
            assert abs(float(np.mean(sampled[:, level] < there)) - q) < 0.03


def test_where_a_force_along_the_stroke_or_one_modulus_tells_the_slope_moduli_are_integrated_out() -> None:
    made = ends(np.full(4, 0.2))
    grid = ForceMap(
        np.full(3, 1e5), np.array([0.0, 0.1, 0.2]), np.array([20.0, 9.0, 1.0]),
        np.zeros(3, dtype=np.int64), np.zeros(3, dtype=np.int64), np.zeros(3, dtype=bool),
    )  # fmt: skip
    for other in (
        replace(made, force_map=grid),
        ends(np.full(4, 0.2), order=1),
        replace(made, free_contraction=None),
    ):
        assert not plain_target(other).model.coordinates_sampled
    assert len(plain_target(made).model.coordinates_sampled) == 2
    assert len(plain_target(ends(np.full(4, 0.2), law="linear")).model.coordinates_sampled) == 4


def test_where_no_curve_can_be_none_is_excluded(monkeypatch: pytest.MonkeyPatch) -> None:
    """The model stays what it is, so that a run can be resumed and predicted from."""
    monkeypatch.setattr(Short, "gone", lambda short, force, sd: np.ones(len(force), dtype=bool))
    made = recorded()
    assert not np.isfinite(plain_target(made).log_posterior(np.zeros((1, 4)))).any()
    target, modes = locate(plain_target(made), np.random.default_rng(0))
    assert target.guide.contradicted and target.model.names == plain_target(made).model.names
    assert len(modes[0].u) == len(target.model.names) and np.isfinite(modes[0].log_posterior)
    # Nor is one that rises there.
    u = vectors(target, np.array([[-30.0, 0.0], [30.0, 0.0]]))
    assert np.isfinite(target.log_posterior(u)).all()


def test_no_coordinate_is_reported() -> None:
    made = calibrate(recorded(), options=build.PLAIN, max_steps=1)
    assert not [name for name in made.summary["parameter"] if "coordinate" in name]
    assert {"E_1", "E_2", "contraction_sd"} <= set(made.summary["parameter"])
