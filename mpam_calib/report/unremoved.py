"""What no set of causes removes, in the words of the diagnosis page, and where to look for it on the rig."""

from __future__ import annotations

from typing import Any

from mpam_calib.criticism.unexplained.instrument import FAULT, LATE, PLAY, RESCALED, ZEROED
from mpam_calib.criticism.verdict import NOISE_SIZE
from mpam_calib.report.numbers import significant

INSTRUMENT_FAULTS = {
    FAULT: (
        "a load cell that shows less and less of large forces",
        "load it with dead weights up to the blocked force",
    ),
    ZEROED: (
        "a load cell whose zero differs from level to level",
        "look at it with the muscle unhooked, before and after each level",
    ),
    RESCALED: (
        "a load cell whose gain differs from level to level",
        "hang one dead weight on it before and after each level, and look at its plug and its range",
    ),
    LATE: (
        "a load cell that is read late",
        "look at its amplifier's filter and at the clocks of force and crosshead, and repeat a level slowly",
    ),
    PLAY: (
        "a displacement gauge with play",
        "turn slowly and see whether the displacement stands while the force goes on, and look at its "
        "pulley, cord, joints and tip",
    ),
}
"""What an instrument does that explains the readings, and how to look at it."""

FAULT_SIZES = {
    FAULT: ("cell_knee_N", "from about {} N on"),
    LATE: ("cell_delay_s", "by about {} s"),
    PLAY: ("play_mm", "of about {} mm"),
}
"""The parameter of such a fault that is told, and how: without a band, which knows nothing of how roughly
the fault itself is reckoned."""

FAULTS = {
    "repeating_N": "a fine structure of {} N comes back in every stroke at the same place",
    "bursts_N": (
        "bursts of {} N (over all readings) stand out of their strokes: a loose plug? What cannot be "
        "recorded again is calibrated with [noise] robust = true"
    ),
    "hum_N": (
        "a hum of {} N, one frequency in all strokes: mains, a pump, a loose shield, a regulator that hunts, "
        "a displacement that sticks?"
    ),
    "chatter_N": (
        "the readings scatter by {} N more one way than on the way back: strands that stick and slip, "
        "a guide that chatters? See whether another speed ends it"
    ),
    "step_N": "forces are recorded in steps of {} N, coarser than their noise: use a finer range",
}
"""What is said of a fault of so many newtons, and where to look for it."""


def faults_in_readings(content: dict[str, Any]) -> bool:
    """Whether the raw readings show a fault by themselves."""
    return any(content[name] > 0.0 for name in ("saturated_share", *FAULTS))


def instrument_of(content: dict[str, Any]) -> str:
    """The instrument that is, or may be, at fault."""
    return "a displacement gauge" if content["instrument"]["fault"] == PLAY else "a load cell"


def only_recording(content: dict[str, Any]) -> bool:
    """Whether a fault of the recording is all that was found: nothing of the simulation was shown.

    No cause, no trace, and no misfit that a reading's noise would not hide.
    """
    fault = faults_in_readings(content) or content["instrument"] is not None
    hidden = content["misfit_before_N"] < NOISE_SIZE * content["noise_N"]
    small = content["remainder_N"] == 0.0 or hidden
    return fault and small and not content["causes"] and content["trace"] is None


def unremoved(content: dict[str, Any]) -> list[str]:
    """What no set of causes removes.

    ``left_N`` is the remainder beside the likeliest set, ``read_N`` the least and the largest reading.
    """
    found = []
    if content["saturated_share"] > 0.0:
        share = significant(100.0 * content["saturated_share"])
        found.append(f"the load cell saturates: {share} % of the readings lie at one extreme force")
    found += [said.format(significant(content[name])) for name, said in FAULTS.items() if content[name] > 0.0]
    if content["instrument"]:
        found.append(_of_instrument(**content["instrument"], read=content["read_N"]))
    elif content["left_N"] > 0.0 or not (found or content["trace"]):
        # Where no remainder is needed either, the likeliest set's equations lessen nothing.
        size = significant(content["left_N"] or content["misfit_after_N"])
        found.append(f"structure of {size} N is left beside every set tried")
    if content["trace"]:
        size, against = significant(content["trace"]["rms_N"]), content["trace"]["against"]
        found.append(f"what the likeliest set leaves still depends on {against} ({size} N)")
    return found


def _of_instrument(
    fault: str, nats: float, parameters: dict[str, dict[str, float]], read: tuple[float, float]
) -> str:
    """What an instrument at fault explains, how large the fault is, and where to look for it."""
    does, look = INSTRUMENT_FAULTS[fault]
    if fault in FAULT_SIZES:
        name, said = FAULT_SIZES[fault]
        size = parameters[name]["mean"]
        if fault == FAULT and size < read[0]:
            # No reading tells where it begins.
            low, high = (significant(force, 2) for force in read)
            does += f" (at all forces read, {low} to {high} N)"
        else:
            does += f" ({said.format(significant(size, 2))})"
    return f"{does} explains the readings {'better' if nats > 0.0 else 'nearly as well'}: {look}"
