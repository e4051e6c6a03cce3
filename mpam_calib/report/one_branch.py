"""Whether the readings tell what friction does: that takes strokes in both directions."""

from __future__ import annotations

from typing import Final

from mpam_calib.model.friction import rubs
from mpam_calib.report.limit import Limit
from mpam_calib.report.view import CalibrationView

BOTH: Final = frozenset({"loading", "unloading"})


def one_branch(view: CalibrationView) -> Limit | None:
    """Only one direction was recorded, or held lengths alone: what friction does there is not known."""
    if view.tensile:
        return None
    if only := branch_alone(view):
        brief = f"only the {only} branch was recorded"
        if rubs(view.simulation):
            sentence = (
                f"O{brief[1:]}: how much of its force is friction, the simulation's equations alone tell, "
                "if they hold. Strokes in both directions would measure it."
            )
            return Limit("good", sentence, brief)
        (other,) = BOTH - {only}
        sentence = (
            f"O{brief[1:]}, and the simulation has no friction: these are the forces of that branch. What "
            f"the muscle pulls without friction, or on the {other} branch, is not told by these data. Record "
            "strokes in both directions."
        )
        return Limit("caution", sentence, brief)
    if held_alone(view):
        sentence = (
            "All loops were recorded at held lengths: whether friction acts there, and which way, is not "
            "told by these data; the forces here take it that none does. Strokes in both directions would "
            "tell it."
        )
        return Limit("caution", sentence, "readings at held lengths do not tell what friction does")
    return None


def pull_of(view: CalibrationView) -> str:
    """Which pull a force without friction stands for, in a few words."""
    if held_alone(view):
        return "as at held length"
    only = branch_alone(view)
    return f"as on the {only} branch" if only and not rubs(view.simulation) else "friction-free"


def branch_alone(view: CalibrationView) -> str:
    """The one direction in which forces were read, where there is no other reading of a force; else ""."""
    found = BOTH & _branches(view)
    return next(iter(found)) if len(found) == 1 and not _static(view) else ""


def held_alone(view: CalibrationView) -> bool:
    """Whether there are loops, all at held lengths, and no other reading of a force."""
    loops = not view.readings("loops").empty
    return loops and not BOTH & _branches(view) and not _static(view)


def _branches(view: CalibrationView) -> set[str]:
    return set(view.readings("loops", "force_map")["branch"])


def _static(view: CalibrationView) -> bool:
    """Whether forces were read at rest, which the declaration takes for those without friction."""
    rows = view.readings("force_map", "blocked_force")
    return bool((~rows["branch"].isin(list(BOTH))).any())
