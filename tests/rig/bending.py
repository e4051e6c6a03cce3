"""Forms bent at random: what an effect does, times a smooth factor that nobody has an equation for.

Each hidden effect's share of the force is multiplied by 1 + g, where g is a sum of a few broad bumps over
what such an effect may depend on: the share's own size and what OWN says. The strength (rms of g over the
share) is drawn anew for each effect. Any catalogue is a little wrong about a real rig; this is a little wrong
in as many ways as there are seeds.
"""

from __future__ import annotations

import random

import numpy as np

from .chain import Sized, force_of
from .muscle import Array, Muscle
from .protocol import Rows

STRENGTH = (0.05, 0.2)
PLACE = ("contraction", "level")
OWN: dict[str, tuple[str, ...]] = {
    "stress_softening": ("contraction", "cycle"),
    "creep": ("contraction", "time at the level"),
    "force_drift": ("time",),
}
"""What an effect's form may depend on besides its size; all others on the place."""
LARGEST = 0.6
"""No factor leaves 1 - LARGEST .. 1 + LARGEST, so that no share changes its sign."""


def _unit(v: Array) -> Array:
    """Scaled to 0 .. 1."""
    return (v - v.min()) / max(float(np.ptp(v)), 1e-12)


def _drivers(effect: str, rows: Rows, share: Array) -> list[Array]:
    """What a factor may depend on, each from 0 to 1."""
    every = {
        "contraction": rows.level_fraction,
        "level": rows.setpoint,
        "time": rows.time,
        "time at the level": np.log1p(rows.level_time),
        "cycle": 1.0 / rows.cycle,
    }
    return [_unit(np.abs(share)), *(_unit(every[name]) for name in OWN.get(effect, PLACE))]


def _factor(rng: random.Random, effect: str, rows: Rows, share: Array) -> Array:
    g = np.zeros(rows.count)
    for driver in rng.sample(_drivers(effect, rows, share), 2):
        for _ in range(3):
            middle, width, height = rng.random(), rng.uniform(0.2, 0.5), rng.gauss(0.0, 1.0)
            g += height * np.exp(-0.5 * ((driver - middle) / width) ** 2)
    weight = share**2 / max(float(np.sum(share**2)), 1e-300)
    # Without its mean: a factor that is the same everywhere is a size and no form.
    g -= float(weight @ g)
    g *= rng.uniform(*STRENGTH) / max(float(np.sqrt(weight @ g**2)), 1e-12)
    return LARGEST * np.tanh(g / LARGEST)


def bending(muscle: Muscle, rows: Rows, effects: list[Sized], seed: int, turn: int) -> Array:
    """What bent forms add to the force (n,) [N]; `turn` numbers the ways to bend one case."""
    rng = random.Random(f"{seed}-bent-{turn}")
    full = force_of(muscle, rows, effects, seed=seed)
    added = np.zeros(rows.count)
    for k, (form, _) in enumerate(effects):
        if form.low == form.high:  # one or the other: nothing to bend
            continue
        share = full - force_of(muscle, rows, effects[:k] + effects[k + 1 :], seed=seed)
        added += share * _factor(rng, form.id, rows, share)
    return added
