"""The first screen of a diagnosis: what it comes to, how far to go by it, and what to do next."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, Literal

from markupsafe import Markup

from mpam_calib.criticism.verdict import LEAD
from mpam_calib.model.effect import effect
from mpam_calib.report import wording
from mpam_calib.report.blocks import Block, Headline, KeyNumber, Notice, Numbers, Verdict
from mpam_calib.report.numbers import probability, significant
from mpam_calib.report.unremoved import faults_in_readings, instrument_of, only_recording, unremoved
from mpam_calib.specimen.recording import Specimen

LEVELS: dict[str, Literal["good", "caution", "bad"]] = {
    "adequate": "good",
    "named": "caution",
    "ambiguous": "caution",
    "unexplained": "bad",
}
SENTENCES = {
    "adequate": "The declared simulation leaves nothing but noise: these data show no fault in it.",
    "named": "The declared simulation is wrong, and what is wrong has a name.",
    "ambiguous": "The declared simulation is wrong, and these data cannot tell several causes apart.",
    "unexplained": "The declared simulation is wrong in a way that no known set of causes removes.",
}

RECORDING = (
    "The recording {} at fault: before that is put right nothing can be said of the declared simulation."
)
UNDECIDED = "These data cannot tell a wrong simulation from {} at fault."
PARTLY_UNDECIDED = (
    "The declared simulation is wrong, but these data cannot tell all that is wrong with it from {} at fault."
)
INSTRUMENT = "{} at fault explains these data better than any known set of causes does."
MORE = (
    "The declared simulation is wrong, and these data cannot tell whether more is wrong than is named here."
)
DOUBTED = "No fault is shown beyond doubt, but {}: see “What else could it be”."

HELD_OUT = {"cycle": "cycles", "pressure": "pressure levels"}
"""What is left out as a whole, by its key in diagnosis.json."""

COVERED = 0.75
"""Share of left-out readings below which 90 % bands are too narrow to go by."""


def _next(causes: list[dict[str, Any]]) -> list[Block]:
    """What to do with the extended model, where it holds anything new."""
    words = (
        "Next: <code>mpam-calib calibrate RUN/extended -o RUN_extended</code> fits the simulation with these "
        "causes in it (RUN: the folder of this page)."
    )
    return [Notice(Markup(words))] if causes else []


def _noise(content: dict[str, Any]) -> str:
    if not content["noise_assumed"]:
        return "of one reading"
    return "of one reading, assumed: too few readings tell it, and no force_sd_N is declared"


def first_screen(content: dict[str, Any], specimen: Specimen) -> list[Block]:
    """Headline, verdict with its reasons, key numbers, what to beware of.

    ``content`` is that of diagnosis.json, with the ``leading`` set and whether it leaves anything (``left``).
    """
    lead: list[Block] = [
        Headline(_headline(content)),
        _verdict(content),
        Numbers(
            [
                KeyNumber("Misfit before", significant(content["misfit_before_N"]), "N", "", "beyond noise"),
                KeyNumber("Misfit after", significant(content["misfit_after_N"]), "N", "", "beyond noise"),
                KeyNumber("Noise", significant(content["noise_N"]), "N", "", _noise(content)),
            ]
        ),
    ]
    notices = (*_assumed(content), *_unproven(content), *wording.left_aside(specimen, "search"))
    lead += [Notice(text) for text in notices]
    return [*lead, *_next(content["causes"])]


def _headline(content: dict[str, Any]) -> str:
    word = content["verdict"]
    if word == "adequate" and (rival := likelier(content)):
        return DOUBTED.format(_rivalry(rival, content["probability"]))
    if word == "ambiguous" and _all_in_every_rival(content):
        return MORE
    if word == "unexplained" and only_recording(content):
        return RECORDING.format(_sure_of_fault(content))
    if word == "unexplained" and _undecided(content):
        instrument = instrument_of(content)
        if _of_the_instrument(content):
            return INSTRUMENT.format(instrument.capitalize())
        return (PARTLY_UNDECIDED if content["causes"] else UNDECIDED).format(instrument)
    return SENTENCES[word]


def _all_in_every_rival(content: dict[str, Any]) -> bool:
    """Whether all that keeps the causes from being named are sets that hold them, too, and more."""
    causes = {c["id"] for c in content["causes"]}
    least = content["probability"] * math.exp(-LEAD)
    rivals = [set(a["ids"]) for a in content["alternatives"] if a["probability"] >= least]
    return bool(rivals) and all(causes <= rival for rival in rivals)


def _undecided(content: dict[str, Any]) -> bool:
    """Whether the likeliest set leaves nothing, and only an instrument at fault keeps it from its name."""
    return content["instrument"] is not None and not content["left"]


def _of_the_instrument(content: dict[str, Any]) -> bool:
    """Whether an instrument at fault is clearly likelier than the likeliest set."""
    return float(content["instrument"]["nats"]) > LEAD


def _sure_of_fault(content: dict[str, Any]) -> str:
    """An instrument that explains the readings only nearly as well as the simulation is no sure fault."""
    if faults_in_readings(content) or content["instrument"]["nats"] > 0.0:
        return "is"
    return "may be"


def likelier(content: dict[str, Any]) -> dict[str, Any] | None:
    """The likeliest alternative, where it is more probable than the set that is reported."""
    first = max(content["alternatives"], key=lambda a: float(a["probability"]), default=None)
    return first if first is not None and first["probability"] > content["probability"] else None


def _rivalry(rival: dict[str, Any], none: float) -> str:
    """How much more probable a set of causes is than none."""
    titles = [effect(e).title.lower() for e in rival["ids"]]
    names = f"{' and '.join(titles)} {'together are' if len(titles) > 1 else 'is'}"
    if none <= 0.0:
        return f"{names} far more probable than none"
    return f"{names} {significant(rival['probability'] / none, 2)} times as probable as none"


def _verdict(content: dict[str, Any]) -> Verdict:
    """Green only where nothing found is more probable than that there is no fault."""
    word, reasons = content["verdict"], _reasons(content)
    if word == "adequate" and (rival := likelier(content)):
        said = f"{probability(rival['probability'])}, of no cause {probability(content['probability'])}"
        titles = _titles(rival["ids"])
        return Verdict("Adequate, with a doubt.", "caution", [f"probability of {titles}: {said}", *reasons])
    return Verdict(_verdict_sentence(content), LEVELS[word], reasons)


def _titles(ids: Iterable[str]) -> str:
    return " and ".join(effect(e).title.lower() for e in ids)


def _verdict_sentence(content: dict[str, Any]) -> str:
    titles = ", ".join(effect(c["id"]).title.lower() for c in content["causes"])
    if content["verdict"] == "adequate":
        return "Adequate."
    if content["verdict"] == "unexplained" and only_recording(content):
        return f"Unexplained: the recording {_sure_of_fault(content)} at fault."
    if content["verdict"] == "unexplained" and not titles and _undecided(content):
        either = "" if _of_the_instrument(content) else f"{_titles(content['leading']['ids'])}, or "
        return f"Unexplained: {either}{instrument_of(content)} at fault."
    if not titles:
        return f"{content['verdict'].capitalize()}: no cause stands by itself."
    if content["verdict"] == "unexplained":
        return f"Unexplained even with {titles}."
    return f"{content['verdict'].capitalize()}: {titles}."


def _reasons(content: dict[str, Any]) -> list[str]:
    reasons = [
        f"{effect(c['id']).title}: {effect(c['id']).sentence} (probability {probability(c['probability'])})"
        for c in content["causes"]
    ]
    if content["verdict"] == "unexplained":
        reasons += [*_kept_from_its_name(content), *unremoved(content)]
    reasons += [
        f"{effect(c['id']).title} stays inside twice its declared uncertainty"
        for c in content["causes"]
        if c["within_declared_uncertainty"]
    ]
    return reasons


def _kept_from_its_name(content: dict[str, Any]) -> list[str]:
    """The set that explains the readings, where it is an instrument alone that keeps it from its name."""
    if not _undecided(content) or only_recording(content):
        return []
    leading = content["leading"]
    titles, told = _titles(leading["ids"]), probability(leading["probability"])
    return [f"the likeliest set of causes leaves nothing beyond the noise: {titles} (probability {told})"]


def _assumed(content: dict[str, Any]) -> list[str]:
    """What is to be known of a cause whose size goes with strands that nobody declared."""
    if (braid := content["assumed_braid"]) is None:
        return []
    titles = [effect(c["id"]).title.lower() for c in content["causes"] if effect(c["id"]).needs_braid]
    strands = f"{braid['n']} nylon strands of {braid['R_br_mm']:g} mm radius and {braid['E_br_GPa']:g} GPa"
    return [
        f"specimen.toml has no [braid]. That there is {' and '.join(titles)} is told by how the force goes "
        f"with pressure and contraction; its size is stated for {strands}, and is another for others. "
        "Declare your sleeve to have its size."
    ]


def _unproven(content: dict[str, Any]) -> list[str]:
    """What readings that the fit never saw say against the causes, if anything."""
    gain = content["gain"]
    if gain is None:
        return []
    which = HELD_OUT[gain["held_out"]]
    if against := _against(gain, "named", "elpd_gain_named", "these"):
        return [
            f"Readings of whole {which} that were left out speak against this result: {against}. "
            "Make the measurement that tells the causes apart before you rely on them."
        ]
    if against := _against(gain, "after", "elpd_gain", "such"):
        return [
            f"With whole {which} left out the search may settle on other causes, or on other forms of them, "
            f"that do not hold in those: {against}. The causes named here, fitted to the same rows, do: "
            f"their error is {significant(gain['rmse_named_N'])} N."
        ]
    return []


def _against(gain: dict[str, Any], which: str, elpd: str, such: str) -> str:
    """What left-out readings say against one of the two kinds of causes, if anything.

    Nothing by figures that print alike, nor by a loss of probability within its standard error.
    """
    before, after = (significant(gain[f"rmse_{when}_N"]) for when in ("before", which))
    against = []
    if gain[f"rmse_{which}_N"] > gain["rmse_before_N"] and after != before:
        against.append(f"their error is {after} N with {such} causes and {before} N without")
    if gain[elpd] < -gain[f"{elpd}_se"]:
        against.append(f"they are less probable with {such} causes than without")
    if gain[f"coverage90_{which}"] < COVERED:
        against.append(f"{100.0 * gain[f'coverage90_{which}']:.0f} % of them lie in the 90 % bands")
    return "; ".join(against)
