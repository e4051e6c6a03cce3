"""Settings, readings and states that tests of the effects' forms share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mpam_calib.model.chain import Chain
from mpam_calib.model.effect import effect
from mpam_calib.model.moduli import Law, ModuliBlock
from mpam_calib.model.readings import FAR, TIMES, Readings
from mpam_calib.model.state import Setting, State
from mpam_calib.physics.kinematics import SHAPES

from . import build

Array = np.ndarray

LEVELS = (100.0, 150.0, 200.0, 250.0)
MIDDLE = 500.0 * (LEVELS[0] + LEVELS[-1])
"""Pa: the middle of the levels, where forms that go by the pressure agree with the effect's own."""
DURATION, LEVEL_TIME, SPEED = 300.0, 60.0, 1e-3
MODULI = np.array([6e4, 2e4])
STEPS = 400
"""Readings of a stroke of :func:`driven`."""


def setting_for(form: str, law: str = "constant") -> Setting:
    identifier = form.partition(":")[0]
    kinematics = "constant_thickness" if identifier == "braid_kinematics" else "inextensible_braid"
    friction = "strand" if identifier == "coulomb_friction" else "coulomb"
    declared = {"law": law, "order": 2, "kinematics": kinematics, "friction": friction, "effects": (form,)}
    setting = build.blueprint(declared, recorded=build.loops(LEVELS)).setting()
    assert setting is not None
    strokes = setting.stroke * np.linspace(0.6, 1.0, len(LEVELS))
    return replace(setting, duration=DURATION, level_time=LEVEL_TIME, speed=SPEED, strokes=strokes)


def without(setting: Setting) -> Setting:
    return replace(setting, simulation=setting.simulation.model_copy(update={"effects": ()}))


def chain_of(setting: Setting) -> Chain:
    """The chain with known moduli."""
    law = Law("constant", len(MODULI), setting.levels)
    return Chain(setting, ModuliBlock(law, 0.0, mean=MODULI, root=np.zeros((len(MODULI), 1))), False)


def force(setting: Setting, values: dict[str, np.ndarray], readings: Readings) -> np.ndarray:
    count = max((len(v) for v in values.values()), default=1)
    declared = {"K_f": np.full((count, 1), 0.06), "f_s": np.full((count, 1), 0.2)}
    found = chain_of(setting).force({**declared, **values}, np.zeros((count, 1)), readings)
    return np.broadcast_to(found, (count, len(readings)))


def rows(setting: Setting, count: int = 60) -> Readings:
    """Rows all over the recordings, from the very start of every clock and stroke."""
    rng = np.random.default_rng(2)
    share = np.linspace(0.0, 1.0, count)
    time_at_level = LEVEL_TIME * rng.permutation(share)
    cycle = 1.0 + np.arange(count) % 4
    return Readings(
        pressure=rng.permutation(np.linspace(setting.levels[0], setting.top_pressure, count)),
        displacement=np.linspace(-0.01, 1.0, count) * setting.stroke,
        sign=np.where(np.arange(count) % 2, 1.0, -1.0),
        level=np.zeros(count, dtype=np.int64),
        time=DURATION * share,
        file_time=DURATION * share,
        time_at_level=time_at_level,
        cycle=cycle,
        test_cycle=cycle + 3.0 * (share > 0.5),
        travel=1e-6 + rng.permutation(share) * setting.stroke,
        reversal=np.where(share > 0.2, 1.0, 0.0),
        strokes_before=np.full((count, 2), FAR),
        speed=SPEED * 10.0 ** (2.0 * rng.permutation(share) - 1.0),
        behind=rng.permutation(share) * setting.stroke,
        relaxed=-np.expm1(-time_at_level[:, None] / TIMES),
        pace=SPEED * 10.0 ** (2.0 * rng.permutation(share) - 1.0),
    )


def middle(setting: Setting, **away: float) -> Readings:
    """One reading in the middle of everything, on a level's first stroke."""
    values = {
        "pressure": 0.5 * (setting.levels[0] + setting.top_pressure),
        "displacement": 0.5 * setting.stroke,
        "sign": -1.0,
        "level": 0,
        "time": 0.5 * DURATION,
        "file_time": 0.5 * DURATION,
        "time_at_level": 0.5 * LEVEL_TIME,
        "cycle": 1.0,
        "test_cycle": 1.0,
        "travel": 0.02 * setting.stroke,
        "reversal": 1.0,
        "strokes_before": (FAR, FAR),
        "speed": SPEED,
        "pace": SPEED,
        "behind": 0.0,
        "relaxed": -np.expm1(-0.5 * LEVEL_TIME / TIMES),
    }
    return Readings(**{name: np.array([value]) for name, value in (values | away).items()})


def driven(setting: Setting, strokes: int = 4) -> Readings:
    """Triangles at one speed and one pressure, from a rest at no contraction."""
    way = (np.arange(STEPS) + 0.5) / STEPS * setting.stroke
    number = np.repeat(np.arange(strokes), STEPS)
    x = np.concatenate([way if i % 2 == 0 else setting.stroke - way for i in range(strokes)])
    return replace(
        rows(setting, len(x)),
        pressure=np.full(len(x), LEVELS[-1] * 1e3),
        displacement=x,
        sign=np.where(number % 2 == 0, -1.0, 1.0),
        cycle=number // 2 + 1.0,
        travel=np.tile(way, strokes),
        reversal=(number > 0).astype(float),
        strokes_before=np.where(number[:, None] > [0, 1], setting.stroke, FAR),
        behind=np.maximum.accumulate(x) - x,
        speed=np.full(len(x), SPEED),
        pace=np.full(len(x), SPEED),
    )


def start(setting: Setting, readings: Readings) -> State:
    """The state in which the readings come to the first effect."""
    return Chain(setting, None, False).start(readings, np.zeros(1))


def shaped(setting: Setting, at: Readings | None = None) -> State:
    """A state with its length and shape, without a fixture or tips."""
    state = start(setting, rows(setting) if at is None else at)
    length = state.rest.L0 - state.displacement
    return state._replace(length=length, shape=SHAPES[state.kinematics](length, state.rest))


def one(value: float) -> np.ndarray:
    return np.full((1, 1), value)


def applied(form: str, state: State, setting: Setting, **values: float) -> State:
    """The state after a form."""
    return effect(form).apply(state, {name: one(value) for name, value in values.items()}, setting)


def before_and_after(form: str, **values: float) -> tuple[State, State]:
    """The state before and after a form, over readings all along the recordings."""
    setting = setting_for(form)
    before = start(setting, rows(setting))
    return before, effect(form).apply(before, {k: one(v) for k, v in values.items()}, setting)


def rubbing(form: str, share: float, pressure: float, **values: float) -> float:
    """Friction (N) of strands alone at a share of the stroke, on the way in."""
    setting = setting_for(form)
    known = {"K_f": one(0.0), **{name: one(value) for name, value in values.items()}}
    at = middle(setting, displacement=share * setting.stroke, pressure=pressure)
    return -float((force(setting, known, at) - force(without(setting), {"K_f": one(0.0)}, at))[0, 0])


def proportional(found: Array, expected: Array) -> None:
    """One is a number times the other."""
    found, expected = np.broadcast_arrays(np.ravel(found), np.ravel(expected))
    i = int(np.argmax(np.abs(expected)))
    np.testing.assert_allclose(found / found[i], expected / expected[i], rtol=1e-9, atol=1e-12)
