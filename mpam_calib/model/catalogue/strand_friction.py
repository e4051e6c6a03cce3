"""Strand friction: the strands rub on each other under pressure (thesis Eq. 2.43)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.curves import middle_pressure, power
from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import HalfNormal, LogNormal, Normal, Parameter
from mpam_calib.model.state import Setting, State
from mpam_calib.physics.kinematics import SHORTEST, Rest, radius_inextensible_braid

Array = NDArray[np.float64]

HERTZIAN = 4.0 / 3.0
"""Power of the pressure in Eq. 2.43."""
SCALE = 0.5
"""Scale of the prior on f_s; nylon on nylon is 0.15-0.25, the loops of the thesis imply up to 0.75."""


def f_s(name: str = "f_s") -> Parameter:
    """The strand friction's parameter, under its own or a level's name."""
    return Parameter(name, HalfNormal(SCALE), "friction between the strands", "thesis Eq. 2.43", "")


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (f_s(),)


def _apply(state: State, values: Values, setting: Setting) -> State:
    return _rubbing(state, values, np.ones((1, 1)))


def _power(state: State, values: Values, setting: Setting) -> State:
    """Another power of the pressure than 4/3: 1 is Amontons' law, 2/3 a Hertzian contact's area."""
    return _rubbing(state, values, _pressed(state, values, setting))


def _even(state: State, values: Values, setting: Setting) -> State:
    """Such a power, with the contact that there is at half the stroke: the same all along it."""
    middle = _spread(state.rest.L0 - 0.5 * setting.stroke, state.rest)
    return _rubbing(
        state, values, _pressed(state, values, setting) * middle / _spread(state.length, state.rest)
    )


def _surface(state: State, values: Values, setting: Setting) -> State:
    """Such a power of the pressure and another of the contact's spread: what P·2πRL presses together."""
    return _contact(state, {**values, "f_s": values["f_s"] * _pressed(state, values, setting)}, setting)


def _powers(setting: Setting) -> tuple[Parameter, ...]:
    grown = Parameter("contact_exponent", Normal(-1.0, 0.5), "power of the contact's spread", "", "")
    return (*_exponent(setting), grown)


def _pivoting(state: State, values: Values, setting: Setting) -> State:
    """Crossed strands that turn on each other: moments ∝ (P·RL)^m, turns dα ∝ dL/R."""
    length = state.rest.L0 - 0.5 * setting.stroke
    grown = _spread(length, state.rest) / _spread(state.length, state.rest)
    part = _pressed(state, values, setting) * power(grown, values["strand_exponent"]) * state.length / length
    return _rubbing(state, values, part)


def _pressed(state: State, values: Values, setting: Setting) -> Array:
    """What another power of the pressure makes of Eq. 2.43."""
    return power(state.pressure / middle_pressure(setting), values["strand_exponent"] - HERTZIAN)


def _rubbing(state: State, values: Values, part: Array) -> State:
    """With so much (B or 1, n) of Eq. 2.43."""
    return state._replace(strand=state.strand + values["f_s"] * part)


def _exponent(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("strand_exponent", LogNormal(1.0, 0.35), "power of the pressure", "textbook", ""),)


def _spread(length: Array, rest: Rest) -> Array:
    """(R0/R)·(L0/L) of Eq. 2.43: how the pressed surface shrinks to the strands' contact."""
    length = np.maximum(length, SHORTEST * rest.L0)
    return rest.R0 / radius_inextensible_braid(length, rest) * rest.L0 / length


def _contact(state: State, values: Values, setting: Setting) -> State:
    """Another power of the contact's spread: 0 the same along the stroke, −1 as the whole surface grows."""
    middle = _spread(state.rest.L0 - 0.5 * setting.stroke, state.rest)
    part = power(_spread(state.length, state.rest) / middle, values["contact_exponent"] - 1.0)
    return _rubbing(state, values, part)


def _contact_exponent(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("contact_exponent", Normal(0.0, 1.0), "power of the contact's spread", "", ""),)


def _tension(state: State, values: Values, setting: Setting) -> State:
    """A sleeve whose own tension presses the strands together, as so much more pressure would."""
    middle, own = middle_pressure(setting), values["sleeve_tension_kPa"]
    pressed = power((state.pressure + own) / (middle + own), np.full((1, 1), HERTZIAN))
    part = pressed * power(state.pressure / middle, np.full((1, 1), -HERTZIAN))
    return _rubbing(state, values, part)


def _own_tension(setting: Setting) -> tuple[Parameter, ...]:
    prior = LogNormal(0.3 * middle_pressure(setting), 0.7)
    return (Parameter("sleeve_tension_kPa", prior, "pressure that the sleeve's own tension is like", ""),)


register(
    Effect(
        id="strand_friction",
        stage=Stage.FRICTION,
        title="Strand friction",
        sentence="the strands rub on each other: friction follows pressure and contact, not force",
        told_by=(
            "loops at low pressure and at low force: friction that follows the pressure stays, one "
            "that follows the force goes"
        ),
        source="thesis Eq. 2.43 (empirical)",
        parameters=_parameters,
        apply=_apply,
        memory=False,
        needs_braid=True,
        forms={
            "power": _power,
            "even": _even,
            "pivoting": _pivoting,
            "contact": _contact,
            "surface": _surface,
            "tension": _tension,
        },
        own={
            "power": _exponent,
            "even": _exponent,
            "pivoting": _exponent,
            "contact": _contact_exponent,
            "surface": _powers,
            "tension": _own_tension,
        },
        sources={
            "power": "Amontons ∝ P; Hertzian contacts ∝ P^(2/3) (Archard 1957); Eq. 2.43 ∝ P^(4/3)",
            "even": "adhesion ∝ contact area ∝ P^m, m = 2/3 to 1 (Bowden & Tabor 1950; Archard 1957)",
            "pivoting": (
                "textbook: virtual work of friction moments where crossed strands turn on each other, "
                "(P·2πRL)^m·2dα/dL with R ∝ cos α: ∝ (P·RL)^m/R, m = 1 (Amontons) to 4/3 (Hertz)"
            ),
            "contact": "friction ∝ pressure × contact area along the stroke (Davis & Caldwell 2006)",
            "surface": "Amontons between bladder and braid, μ·P·2πRL, or another power of either (textbook)",
            "tension": "Eq. 2.43 of P + P_0, for a sleeve that presses at no pressure too (textbook)",
        },
        bends={"pressure": 1, "contraction": 2},
    )
)
