"""Braid stretch: the strands store energy (thesis Eq. 2.25)."""

from __future__ import annotations

from mpam_calib.model.curves import middle_pressure, power
from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import HalfLongTailed, LogNormal, Parameter
from mpam_calib.model.state import Setting, State
from mpam_calib.physics.kinematics import with_longer_strands
from mpam_calib.physics.statics import braid_energy_force, strand_strain


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "braid_factor",
            HalfLongTailed(2.0),
            "energy stored in the strands (theory: 1)",
            "thesis Eq. 2.25",
            "",
        ),
    )


def _apply(state: State, values: Values, setting: Setting) -> State:
    braid = setting.braid
    assert braid is not None  # reading refuses this effect without [braid]
    loss = braid_energy_force(state.pressure, state.length, state.rest, braid.E_br, braid.R_br, braid.n)
    return state._replace(lost=state.lost + values["braid_factor"] * loss)


def _power(state: State, values: Values, setting: Setting) -> State:
    """Strands that stiffen as they are pulled straight: the loss is another power of the pressure than 2."""
    part = power(state.pressure / middle_pressure(setting), values["braid_exponent"] - 2.0)
    return _apply(state, {**values, "braid_factor": values["braid_factor"] * part}, setting)


def _longer(state: State, values: Values, setting: Setting) -> State:
    """Strands that are longer under tension let the muscle grow thicker, at a flatter angle."""
    braid = setting.braid
    assert braid is not None
    assert state.shape is not None
    strain = strand_strain(state.pressure, state.length, state.rest, braid.E_br, braid.R_br, braid.n)
    strain = values["braid_factor"] * strain
    return state._replace(shape=with_longer_strands(state.shape, state.rest, state.kinematics, strain))


def _both(state: State, values: Values, setting: Setting) -> State:
    """Longer strands that store their energy, too."""
    return _longer(_apply(state, values, setting), values, setting)


def _exponent(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("braid_exponent", LogNormal(1.7, 0.3), "power of the pressure lost", "textbook", ""),)


register(
    Effect(
        id="braid_stretch",
        stage=Stage.STATICS,
        title="Braid stretch",
        sentence="the strands stretch and store energy that the force then lacks",
        told_by="blocked force at the highest pressures with a stiffer sleeve",
        source="thesis Eq. 2.25-2.26",
        parameters=_parameters,
        apply=_apply,
        memory=False,
        needs_braid=True,
        forms={"power": _power, "longer": _longer, "both": _both},
        own={"power": _exponent},
        sources={
            "power": "textbook: energy in strands whose stiffness grows with tension, ∝ P^m (linear: 2)",
            "both": "the same with the energy of Eq. 2.25 (Davis, Tsagarakis, Canderle & Caldwell 2003)",
        },
        kinds={"longer": "here the strands' length sets angle and radius, and no energy is lost"},
        bends={"contraction": 1, "pressure": 2},
        looseness=2.0,
    )
)
