"""Coulomb friction: in proportion to the force (thesis Eq. 2.44)."""

from __future__ import annotations

import numpy as np

from mpam_calib.model.curves import power
from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import HalfNormal, LogNormal, Normal, Parameter
from mpam_calib.model.state import Setting, State

SCALE = 0.2
"""Scale of the prior on K_f; the thesis finds 0.07-0.09 (Table 4.10)."""


def k_f(name: str = "K_f") -> Parameter:
    """The friction factor's parameter, under its own or a level's name."""
    return Parameter(
        name, HalfNormal(SCALE), "Coulomb friction, as a share of the force", "thesis Eq. 2.44", ""
    )


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (k_f(),)


def _apply(state: State, values: Values, setting: Setting) -> State:
    return state._replace(coulomb=state.coulomb + values["K_f"])


def _constant(state: State, values: Values, setting: Setting) -> State:
    """A part of it is the same at any force; at the force scale it is all K_f times the force."""
    constant = values["K_f"] * values["constant_share"]
    drag = state.drag + constant * setting.force_scale
    return state._replace(coulomb=state.coulomb + values["K_f"] - constant, drag=drag)


def _share(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("constant_share", Normal(0.4, 0.3), "share that is the same at any force", "", ""),)


def _capstan(state: State, values: Values, setting: Setting) -> State:
    """Strands wound round the bladder: F·exp(μs), sinh μ = K_f, which lifts the loop's middle as well."""
    lifted = np.sqrt(1.0 + values["K_f"] ** 2) - 1.0
    return _apply(state, values, setting)._replace(tightening=state.tightening + lifted)


def _power(state: State, values: Values, setting: Setting) -> State:
    """A power of the force, as large at the force scale: contacts that spread under load."""
    part = power(np.abs(state.guide) / setting.force_scale, values["force_exponent"] - 1.0)
    return state._replace(coulomb=state.coulomb + values["K_f"] * part)


def _exponent(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("force_exponent", LogNormal(0.8, 0.3), "power of the force", "textbook", ""),)


register(
    Effect(
        id="coulomb_friction",
        stage=Stage.FRICTION,
        title="Coulomb friction",
        sentence="friction grows with the force: pulling out takes more than letting in",
        told_by=(
            "loops at low pressure and at low force: friction that follows the pressure stays, one "
            "that follows the force goes"
        ),
        source="thesis Eq. 2.44",
        parameters=_parameters,
        apply=_apply,
        memory=False,
        forms={"constant": _constant, "capstan": _capstan, "power": _power},
        own={"constant": _share, "power": _exponent},
        by_force=("power",),
        sources={
            "constant": "K|F| + a constant dry friction (Chou & Hannaford 1996)",
            "power": "friction of fibres, a·N^n with n from 2/3 to 1 (Howell & Mazur 1953)",
            "capstan": "friction of a wound rope (Euler 1769; Eytelwein 1808): F·exp(±μ), K_f = sinh μ",
        },
        bends={"force": 1, "pressure": 2, "contraction": 1},
    )
)
