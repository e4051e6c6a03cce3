"""The chain: from a row of readings to the force it should show.

rig → shape → statics → friction → history → sensor. Given the sampled values the force is linear in
the moduli's coordinates η: :meth:`Chain.terms` returns the two parts, :meth:`Chain.force` the force
for known η.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.effect import Effect, Stage, Values
from mpam_calib.model.effect import effect as effect_by_id
from mpam_calib.model.friction import DeclaredFriction
from mpam_calib.model.moduli import Columns, ModuliBlock, rate_parameters
from mpam_calib.model.nuisance import apply_nuisances, nuisance_parameters
from mpam_calib.model.priors import Parameter
from mpam_calib.model.readings import Readings
from mpam_calib.model.reference import rest_of
from mpam_calib.model.state import Setting, State
from mpam_calib.physics.friction import coulomb_factor, strand_friction_per_f_s
from mpam_calib.physics.kinematics import SHAPES, SHORTEST, Rest, swollen
from mpam_calib.physics.statics import gas_force, modulus_columns, thickness_force

Array = NDArray[np.float64]

FIXED_POINT_STEPS = 30
FIXED_POINT_TOLERANCE = 1e-6
"""Newtons between a force that depends on itself and what it was computed from."""
SLOPES = (-1e3, 0.9)
"""Slopes of such a force that are believed."""
NUDGE = 1e-4
"""Step of such a force for its slope, as a share of the force scale."""


class Terms(NamedTuple):
    """F = fixed + columns·η: newtons, shapes (B, n) and (B, n, p)."""

    fixed: Array
    columns: Array


class Factors(NamedTuple):
    """F = fixed + slope·(columns·η): newtons, (B, n), (B or 1, n or 1) and, multiplied out, (B or 1, n, p).

    ``beside`` (B or 1, n) is the part of the fixed force, N, that is none of the muscle's pull: friction that
    is not in proportion to it, and the load cell's zero.
    """

    fixed: Array
    slope: Array
    columns: Columns
    beside: Array

    def echoing(self, guide: Array, echo: Array) -> Factors:
        """The force that comes to rest, by one Newton step from where it was fed with a guide (n,), N.

        F = f(F) moves by the ``echo`` (n,) 1/(1 − df/dF) times what f moves by, whatever moves it.
        """
        return self._replace(fixed=guide + (self.fixed - guide) * echo, slope=self.slope * echo)


class Unsigned(NamedTuple):
    """A force but for which way the muscle pulls: F = slope·(fixed + columns·η) + beside.

    Shapes as in :class:`Factors`; the slope comes from the ``state`` and the pull.
    """

    fixed: Array
    columns: Columns
    beside: Array
    state: State

    @property
    def signed(self) -> bool:
        """Whether it matters which way the muscle pulls."""
        return bool(self.state.coulomb.any())

    def pulling(self, guide: Array | None) -> Factors:
        """With the signs that a force estimate (B or 1, n), N, says; without one the muscle pulls."""
        state = self.state
        factor = np.ones((1, 1))
        if self.signed:
            # Coulomb's law goes by what the muscle itself pulls, not by what the load cell reads.
            pull = np.ones(1) if guide is None else np.sign(guide - self.beside)
            factor = coulomb_factor(state.friction_gain * state.coulomb, state.sign, pull)
        if state.tightening.any():
            factor = factor + _tightened(state)
        slope = state.gain * factor
        return Factors(slope * self.fixed + self.beside, slope, self.columns, self.beside)


def _tightened(state: State) -> Array:
    """Share of the force that friction adds in either direction."""
    return np.asarray(state.tightening * (state.friction_gain * state.sign) ** 2)


@dataclass(frozen=True)
class Chain:
    """A declared simulation with its effects, ready to be evaluated for many parameter vectors."""

    setting: Setting
    moduli: ModuliBlock | None
    with_nuisances: bool = True

    @cached_property
    def effects(self) -> tuple[Effect, ...]:
        """The declared effects in the order of the chain, whatever order they were declared in."""
        declared = (effect_by_id(i) for i in self.setting.simulation.effects)
        return tuple(sorted(declared, key=lambda e: (e.stage, e.comes_last, e.id)))

    @cached_property
    def friction(self) -> DeclaredFriction:
        """The declared friction."""
        return DeclaredFriction(self.setting)

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Everything sampled for the force: friction, effects, the law's rates, nuisances."""
        simulation = self.setting.simulation
        found = list(self.friction.parameters())
        for item in self.effects:
            found += item.parameters(self.setting)
        if self.moduli is not None and self.moduli.root is None:
            found += rate_parameters(simulation.law, simulation.order, self.setting.levels)
        if self.with_nuisances:
            found += nuisance_parameters(self.setting)
        return tuple(found)

    @property
    def linear_size(self) -> int:
        """Number of the moduli's coordinates."""
        return 0 if self.moduli is None else self.moduli.size

    @cached_property
    def uses_force(self) -> bool:
        """Whether an effect needs the muscle's own force."""
        return any(item.uses_force for item in self.effects)

    @cached_property
    def memory(self) -> bool:
        """Whether an effect looks at what was before."""
        return any(item.memory for item in self.effects)

    def terms(
        self, values: Values, readings: Readings, guide: Array | None = None, echo: Array | None = None
    ) -> Terms:
        """The force's fixed part and its columns.

        ``values``: (B, 1) arrays, SI. ``guide`` (n,): a force estimate (N) for what depends on the
        force itself (the sign in Coulomb's law, a fixture's give); without one the muscle pulls and
        the fixture is stiff. With the :meth:`echo` (n,) there the force answers to its own changes;
        without it the give stays the guide's, whatever the values.
        """
        fixed, slope, columns, _ = self.factored(values, readings, guide, echo)
        return Terms(fixed, np.broadcast_to(slope, fixed.shape)[..., None] * columns.every())

    def factored(
        self, values: Values, readings: Readings, guide: Array | None = None, echo: Array | None = None
    ) -> Factors:
        """:meth:`terms` as (fixed, slope, columns): F = fixed + slope·(columns·η).

        The slope (B or 1, n) is what friction and gain make of the muscle's own force; multiplied out the
        columns are (1, n, p) where no parameter changes them.
        """
        found = self.unsigned(values, readings, guide).pulling(guide)
        return found if guide is None or echo is None else found.echoing(guide, echo)

    def unsigned(self, values: Values, readings: Readings, guide: Array | None = None) -> Unsigned:
        """:meth:`factored` but for the pull's signs: alike for all guides without :attr:`uses_force`."""
        state = self._through(values, readings, np.zeros(len(readings)) if guide is None else guide)
        fixed, columns = self._statics(state, values)
        return Unsigned(fixed, columns, self._friction_beside(state) + state.zero, state)

    def force(self, values: Values, eta: Array, readings: Readings) -> Array:
        """Force (B, n), N, for coordinates η (B, p): exact; by secants where it depends on itself."""
        guide = np.zeros((1, len(readings)))
        force = self._force_given(guide, values, eta, readings)
        before: tuple[Array, Array] | None = None
        for _ in range(FIXED_POINT_STEPS if self.uses_force else 0):
            gap = force - guide
            if np.max(np.abs(gap), initial=0.0) < FIXED_POINT_TOLERANCE:
                break
            slope = np.zeros(1)
            if before is not None:
                step = guide - before[0]
                safe = np.where(np.abs(step) > FIXED_POINT_TOLERANCE, step, 1.0)
                slope = np.where(safe == step, np.clip((force - before[1]) / safe, *SLOPES), 0.0)
            before = (guide, force)
            guide = guide + gap / (1.0 - slope)
            force = self._force_given(guide, values, eta, readings)
        return force

    def echo(self, values: Values, eta: Array, readings: Readings, guide: Array) -> Array | None:
        """How many times a change is felt by a force (n,), N, that depends on itself: (B, n) for η (B, p).

        None where nothing depends on it.
        """
        if not self.uses_force:
            return None
        step = NUDGE * self.setting.force_scale
        low, high = (
            self._force_given(np.atleast_2d(guide + side), values, eta, readings) for side in (-step, step)
        )
        return np.asarray(1.0 / (1.0 - np.clip((high - low) / (2.0 * step), *SLOPES)))

    def _force_given(self, guide: Array, values: Values, eta: Array, readings: Readings) -> Array:
        """Force (B, n), N, where what depends on the force is fed with a guide (B or 1, n)."""
        state = self._through(values, readings, guide)
        fixed, columns = self._statics(state, values)
        free = state.gain * (fixed + columns.times(eta) if columns.size else fixed)
        friction = state.friction_gain * state.coulomb * np.abs(free) * state.sign
        friction = friction + _tightened(state) * free
        return np.asarray(free + friction + self._friction_beside(state) + state.zero)

    def _through(self, values: Values, readings: Readings, guide: Array) -> State:
        """The state behind all stages; what the muscle's own force comes to is not reckoned yet."""
        state = self.start(readings, guide)
        if self.with_nuisances:
            state = apply_nuisances(state, values)
        state = self._stage(Stage.RIG, state, values)
        state = state._replace(length=state.rest.L0 - state.displacement)
        state = self._stage(Stage.SHAPE, state, values)
        # Tips may take the whole length: what rubs and stretches is never shorter than the shape.
        state = state._replace(length=np.maximum(state.length, SHORTEST * state.rest.L0))
        shape = swollen(SHAPES[state.kinematics](state.length, state.rest), state.rest, state.swell)
        state = self._stage(Stage.STATICS, state._replace(shape=shape), values)
        state = self.friction.apply(state, values)
        for stage in (Stage.FRICTION, Stage.HISTORY, Stage.SENSOR):
            state = self._stage(stage, state, values)
        return state

    def _statics(self, state: State, values: Values) -> tuple[Array, Columns]:
        P, shape = state.pressure, state.shape
        assert shape is not None
        fixed = gas_force(P, shape) + state.wall_factor * thickness_force(P, shape) - state.lost
        if self.moduli is None:
            return fixed, Columns.none(fixed.shape[1])
        simulation = self.setting.simulation
        per_modulus = modulus_columns(shape, state.rest, simulation.strain, simulation.order)
        readings = state.readings
        known, columns = self.moduli.columns(
            readings.pressure, readings.level, per_modulus, state.wall_gain, values
        )
        return fixed + known, columns

    def _friction_beside(self, state: State) -> Array:
        """Friction (N) beside what is in proportion to the force; history acts on it as on the force."""
        braid = self.setting.braid
        force = state.drag
        if braid is not None and state.strand.any():
            unit = strand_friction_per_f_s(state.pressure, state.length, state.rest, braid.E_br, braid.nu_s)
            force = force + state.friction_gain * state.strand * unit
        result: Array = state.gain * state.sign * force
        return result

    def _stage(self, stage: Stage, state: State, values: Values) -> State:
        for item in self._at_stage.get(stage, ()):
            state = item.apply(state, values, self.setting)
        return state

    @cached_property
    def _at_stage(self) -> dict[Stage, tuple[Effect, ...]]:
        """The declared effects by where they act."""
        return {stage: tuple(at) for stage, at in groupby(self.effects, key=lambda e: e.stage)}

    @cached_property
    def _rest(self) -> Rest:
        """The declared geometry at rest."""
        return rest_of(self.setting.geometry)

    def start(self, readings: Readings, guide: Array) -> State:
        """The state before any stage: the recording as it is, nothing corrected."""
        zero, one = np.zeros((1, 1)), np.ones((1, 1))
        return State(
            readings=readings,
            guide=np.atleast_2d(guide),
            pressure=readings.pressure[None, :],
            displacement=readings.displacement[None, :],
            rest=self._rest,
            kinematics=self.setting.simulation.kinematics,
            swell=one,
            length=zero,
            shape=None,
            wall_factor=one,
            lost=zero,
            sign=readings.sign[None, :],
            coulomb=zero,
            tightening=zero,
            strand=zero,
            drag=zero,
            friction_gain=one,
            wall_gain=one,
            gain=one,
            zero=zero,
        )
