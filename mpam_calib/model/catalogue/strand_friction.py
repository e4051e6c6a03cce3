"""Strand friction: the strands rub on each other under pressure (thesis Eq. 2.43)."""

from __future__ import annotations

from dataclasses import replace

from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import HalfNormal, Parameter
from mpam_calib.model.state import Setting, State

SCALE = 0.5
"""Scale of the prior on f_s; nylon on nylon is 0.15-0.25, the loops of the thesis imply up to 0.75."""


def f_s(name: str = "f_s") -> Parameter:
    """The strand friction's parameter, under its own or a level's name."""
    return Parameter(name, HalfNormal(SCALE), "coefficient of friction of the strands", "thesis Eq. 2.43", "")


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (f_s(),)


def _apply(state: State, values: Values, setting: Setting) -> State:
    return replace(state, strand=state.strand + values["f_s"])


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
        bends={"pressure": 1, "contraction": 2},
    )
)
