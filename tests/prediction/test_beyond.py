"""Bands at pressures below and above all recorded levels, where the remainder has learnt nothing.

The muscles are those of :mod:`.far_off`: a hyperelastic wall, lost pull, a dead-band and an offset, none of
which the declared simulation has.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from model import build

from mpam_calib.design.draws import MuscleDraws
from mpam_calib.model.blueprint import Options, draw_blueprint
from mpam_calib.model.model import Model, build_model
from mpam_calib.model.readings import Readings
from mpam_calib.posterior.density.target import predict_force
from mpam_calib.posterior.draws import Draws
from mpam_calib.prediction.bands import muscle_bands
from mpam_calib.prediction.beyond import Beyond
from mpam_calib.prediction.curves import force_curves
from mpam_calib.specimen.declaration import Sensors
from mpam_calib.specimen.recording import ForceMap, Specimen

from .coverage import posterior_draws
from .far_off import Array, Curve, far_off

MUSCLES = 6
RECORDED = ((0, 1, 2, 3), (1, 2), (2,))
"""Which of the four levels, at 25, 50, 75 and 100 % of the highest, are calibrated on."""
ALONG = np.array([0.0, 0.04, 0.08])
ABOVE, BELOW = (0.5, 1.0), (-0.5, -1.0)
"""Distances from the outer levels, in spacings."""
TANH_LEVELS = (100.0, 150.0, 200.0, 250.0, 300.0)
DRAWS = 4000


@dataclass(frozen=True)
class Case:
    """True friction-free forces (pressures, contractions), and whether bands with and without what comes
    beyond the levels hold them; ``side`` (pressures,) is +1 above, −1 below."""

    side: np.ndarray
    held: np.ndarray
    frozen: np.ndarray
    lone: bool


def recorded_at(whole: Specimen, kept: tuple[int, ...]) -> Specimen:
    """The specimen as if no other levels had been recorded."""
    part = build.take_levels(whole, list(kept))
    assert part.loops is not None
    loops = replace(part.loops, level=np.searchsorted(kept, part.loops.level))
    law = "linear" if len(kept) > 1 else "constant"
    simulation = whole.simulation.model_copy(update={"law": law})
    return replace(part, loops=loops, levels_Pa=whole.levels_Pa[list(kept)], simulation=simulation)


def case(seed: int, folder: Path) -> list[Case]:
    whole, true = far_off(seed, folder)
    found = []
    for kept in RECORDED:
        specimen = recorded_at(whole, kept)
        levels = specimen.levels_Pa
        spacing = float(np.diff(levels).mean()) if len(levels) > 1 else float(levels[0])
        model, draws = posterior_draws(specimen, specimen, Options(), seed, exact=False)
        asked = [levels[-1] + d * spacing for d in ABOVE] + [levels[0] + d * spacing for d in BELOW]
        pressures = np.array([P for P in asked if P > 1e3])
        truth = true(pressures[:, None] / 1e3, ALONG[None, :])
        force = force_curves(model, draws, pressures, ALONG, seed).force[:, :, 2]
        grid = np.meshgrid(pressures, ALONG * 1e-3 * whole.geometry.L0_mm, indexing="ij")
        plain = predict_force(model, draws.values, draws.eta, Readings.at_rest(*(g.ravel() for g in grid)))
        held = [inside(each, truth) for each in (force, plain.reshape(force.shape))]
        found.append(Case(np.where(pressures > levels[-1], 1, -1), *held, len(kept) == 1))
    return found


def inside(draws: np.ndarray, true: np.ndarray) -> np.ndarray:
    low, high = np.quantile(draws, [0.05, 0.95], axis=0)
    return (low <= true) & (true <= high)


@pytest.fixture(scope="module")
def cases(tmp_path_factory: pytest.TempPathFactory) -> list[Case]:
    folder = tmp_path_factory.mktemp("muscles")
    return [each for seed in range(MUSCLES) for each in case(seed, folder / str(seed))]


@pytest.mark.parametrize("side", [1, -1], ids=["above", "below"])
def test_bands_hold_the_true_forces_half_a_spacing_and_one_beyond(cases: list[Case], side: int) -> None:
    held = np.concatenate([each.held[each.side == side].ravel() for each in cases])
    assert held.mean() >= 0.9


def test_a_remainder_that_stays_as_it_is_misses_them(cases: list[Case]) -> None:
    above = np.concatenate([each.frozen[each.side == 1].ravel() for each in cases])
    lone = np.concatenate([each.frozen.ravel() for each in cases if each.lone])
    assert above.mean() < 0.3 and lone.mean() < 0.3


def tanh_muscle(seed: int, effects: tuple[str, ...], bias_kPa: float) -> tuple[Specimen, Curve]:
    """A force map of a muscle that the simulation cannot follow, and its true force (N) at a pressure (kPa)
    and contractions: its rubber is no polynomial, and its tips take up a share of the length."""
    rng = np.random.default_rng([seed, 11])
    g = build.GEOMETRY
    dead, stiff, bent, tips = (rng.uniform(*each) for each in ((0, 12), (10, 35), (2, 5), (0, 0.3)))
    angle = np.radians(g.alpha0_deg)

    def force(pressure: float, contraction: Array) -> Array:
        sine = np.sin(angle) * (1.0 - contraction * (1.0 + tips * contraction))
        radius = g.R0_mm * np.sqrt(1.0 - sine**2) / np.cos(angle)
        gas = 1e-3 * np.pi * radius**2 * (2.0 * sine**2 / (1.0 - sine**2) - 1.0)
        rubber = stiff * np.tanh(bent * contraction) * (0.7 + pressure / 1e3)
        return np.maximum(pressure - dead, 0.0) * gas - rubber

    rows = []
    for level, pressure in enumerate(TANH_LEVELS):
        contraction = np.linspace(0.0, 0.3, 20)
        pull = force(pressure, contraction)
        rows += [(pressure, c, F, level) for c, F in zip(contraction[pull > 0], pull[pull > 0], strict=True)]
    P, contraction, pull, level = np.array(rows).T
    readings = ForceMap(
        1e3 * P, contraction, pull + 0.2 * rng.standard_normal(len(P)), level.astype(np.int64),
        np.zeros(len(P), dtype=np.int64), np.zeros(len(P), dtype=bool),
    )  # fmt: skip
    made = build.specimen(
        {"law": "linear", "order": 2, "effects": effects, "friction": "none"},
        levels_kPa=TANH_LEVELS,
        force_map=readings,
        sensors=Sensors(force_sd_N=0.2, pressure_bias_sd_kPa=bias_kPa),
    )
    return made, force


@pytest.mark.parametrize(("effects", "bias_kPa"), [(("dead_band",), 0.0), ((), 22.5)])
def test_a_pressure_that_made_up_for_a_misfit_is_no_certain_pull_without_any(
    effects: tuple[str, ...], bias_kPa: float
) -> None:
    """The model pulls or pushes there by newtons, and the remainder has ended."""
    for seed in range(4):
        specimen, true = tanh_muscle(seed, effects, bias_kPa)
        model, draws = posterior_draws(specimen, specimen, Options(), seed, exact=False)
        force = force_curves(model, draws, np.array([0.0, 25e3]), np.zeros(1), seed).force[:, :, 2, 0]
        assert inside(force, np.array([true(P, np.zeros(1))[0] for P in (0.0, 25.0)])).all()


def made(
    levels_kPa: tuple[float, ...], options: Options | None = None, effects: tuple[str, ...] = ()
) -> tuple[Model, Draws]:
    """Draws at the prior's middle but for a remainder of every shape, and no stroke's own."""
    law = "linear" if len(levels_kPa) > 1 else "constant"
    specimen = build.specimen({"law": law, "effects": effects}, build.loops(levels_kPa))
    model = build_model(draw_blueprint(specimen, options or Options()))
    u = np.zeros((DRAWS, len(model.names)))
    p, q, _ = model.linear_sizes
    eta = np.zeros((DRAWS, sum(model.linear_sizes)))
    eta[:, p : p + q] = np.random.default_rng(3).standard_normal((DRAWS, q))
    values = model.values(u)
    if "stroke_remainder_sd_N" in values:
        values["stroke_remainder_sd_N"] = np.zeros((DRAWS, 1))
    return model, Draws(u, values, eta, 1)


def remainder(model: Model, draws: Draws, kPa: list[float], mm: float = 5.0, seed: int = 0) -> np.ndarray:
    """Force (draws, pressures) less that of the same model without a remainder."""
    pressures, along = 1e3 * np.array(kPa), np.array([mm / 50.0])
    force = force_curves(model, draws, pressures, along, seed).force[:, :, 2, 0]
    p = model.linear_sizes[0]
    bare = Draws(draws.u, draws.values, np.where(np.arange(draws.eta.shape[1]) < p, draws.eta, 0.0), 1)
    readings = Readings.at_rest(pressures, 1e-3 * mm)
    return force - predict_force(model, bare.values, bare.eta, readings)


def test_nothing_comes_at_or_between_the_levels() -> None:
    model, draws = made((100.0, 150.0, 200.0))
    beyond = Beyond.draw(model, draws, 0)
    assert beyond is not None
    for sign in (-1.0, 0.0, 1.0):
        rows = Readings.at_rest(np.linspace(1e5, 2e5, 21), 0.004, sign)
        assert not beyond.force(rows, np.zeros((DRAWS, 21))).any()
    near = beyond.force(Readings.at_rest(np.array([1e5 - 1.0, 2e5 + 1.0]), 0.004), np.zeros((DRAWS, 2)))
    size = draws.values["remainder_sd_N"][0, 0]
    assert 0.0 < np.abs(near).max() < 1e-3 * size


def test_bands_widen_by_the_remainder_s_size_with_every_spacing() -> None:
    model, draws = made((100.0, 150.0, 200.0))
    at = remainder(model, draws, [200.0, 225.0, 250.0, 300.0])
    size = draws.values["remainder_sd_N"][0, 0]
    new = (at[:, 1:] - at[:, :1]) / np.array([0.5, 1.0, 2.0])
    # One function for each draw, whose size varies along the contraction about the remainder's.
    assert np.allclose(new, new[:, :1]) and 0.6 < new[:, 0].std() / size < 1.4
    everywhere = [remainder(model, draws, [200.0, 250.0], mm) @ [-1.0, 1.0] for mm in np.linspace(0, 19, 39)]
    assert np.sqrt(np.mean(np.square(everywhere))) == pytest.approx(size, rel=0.1)
    assert np.abs(np.corrcoef(everywhere[0], everywhere[1])[0, 1]) > 0.8
    # Neither side knows of the other, nor of what was fitted.
    below = remainder(model, draws, [75.0, 100.0]) @ [1.0, -0.75]
    for other in (new[:, 0], at[:, 0]):
        assert np.abs(np.corrcoef(below, other)[0, 1]) < 0.1
    assert below.std() > 0.3 * size


def test_nothing_pulls_without_pressure() -> None:
    for levels in ((100.0, 150.0, 200.0), (200.0,)):
        model, draws = made(levels)
        at = remainder(model, draws, [0.0, 1e-3], mm=0.0)
        assert np.abs(at).max() < 1e-3
        table = muscle_bands(model, draws, np.zeros(1), 0).set_index("quantity")
        assert table.loc["blocked_force_N", "q05"] == pytest.approx(0.0, abs=1e-9)
        assert table.loc["blocked_force_N", "q95"] == pytest.approx(0.0, abs=1e-9)


def test_what_a_lone_level_misses_goes_with_the_pressure() -> None:
    model, draws = made((200.0,))
    at = remainder(model, draws, [100.0, 200.0, 400.0])
    slopes = np.linalg.lstsq(at[:, 1:2], at, rcond=None)[0][0]
    assert slopes == pytest.approx([0.5, 1.0, 2.0], abs=0.05)
    assert (at[:, 2] - 2.0 * at[:, 1]).std() > 0.6 * draws.values["remainder_sd_N"][0, 0]


def test_a_pressure_has_the_same_bands_whatever_others_are_asked_for() -> None:
    model, draws = made((100.0, 150.0, 200.0))
    few = draws.thin(200)
    draws = replace(few, values=few.values | {"stroke_remainder_sd_N": np.full((200, 1), 0.3)})

    def bands(*kPa: float):
        table = muscle_bands(model, draws, 1e3 * np.array(kPa), 1)
        return table[table["pressure_kPa"].isin([50.0, 150.0])].reset_index(drop=True)

    apart = [bands(50.0), bands(150.0)]
    together = bands(0.0, 50.0, 100.0, 150.0, 300.0)
    for table in apart:
        same = together[together["pressure_kPa"] == table["pressure_kPa"].iloc[0]].reset_index(drop=True)
        assert list(same["quantity"]) == list(table["quantity"])
        for name in ("mean", "q05", "q50", "q95"):
            assert same[name].to_numpy() == pytest.approx(table[name].to_numpy(), rel=1e-9, abs=1e-9)
    assert not muscle_bands(model, draws, np.array([5e4]), 2)["q05"].equals(apart[0]["q05"])


def test_without_a_remainder_nothing_is_added() -> None:
    model, draws = made((100.0, 150.0), Options(remainder=False))
    assert Beyond.draw(model, draws, 0) is None


def test_designs_are_given_the_same() -> None:
    """Also where a dead-band below zero has the muscle pull without pressure."""
    model, draws = made((100.0, 150.0, 200.0), effects=("dead_band",))
    draws = draws.thin(300)
    draws = replace(draws, values=draws.values | {"P_DB_kPa": np.full((300, 1), -30e3)})
    g = model.setting.geometry
    own = np.array([g.R0, g.t0, g.alpha0])
    muscle = MuscleDraws.prepare(model, draws, 300, 5)
    pressures = [0.0, 25e3, 150e3, 300e3]
    force = force_curves(model, draws, np.array(pressures), np.zeros(1), 5).force[:, :, 2, 0]
    for j, P in enumerate(pressures):
        assert muscle.blocked_forces(P, own) == pytest.approx(force[:, j], rel=1e-9)
    # A design that no gas pulls has no remainder either.
    weak = np.array([g.R0, g.t0, np.radians(30.0)])
    assert np.isfinite(muscle.blocked_forces(25e3, weak)).all()
