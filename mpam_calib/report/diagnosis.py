"""The diagnosis report: what the simulation gets wrong, why, and what the repair gains."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd

from mpam_calib.criticism.budget import remainder_rms
from mpam_calib.criticism.diagnose import Diagnosis
from mpam_calib.criticism.fitting.fit import by_equations
from mpam_calib.criticism.fitting.folds import FEWEST
from mpam_calib.criticism.limits import NO_ROOM
from mpam_calib.criticism.verdict import BESIDE, TRACE, TRACE_SIZE
from mpam_calib.model.bend import FORM, is_bend
from mpam_calib.model.effect import effect
from mpam_calib.model.priors import Parameter
from mpam_calib.report import wording
from mpam_calib.report.blocks import Block, DataTable, Figure, Section, Text
from mpam_calib.report.diagnosis_lead import HELD_OUT, first_screen
from mpam_calib.report.figures import misfit
from mpam_calib.report.figures.misfit import Floats
from mpam_calib.report.measurements import TOO_SMALL, not_tested, shown_by, telling, too_small
from mpam_calib.report.numbers import probability, significant, with_band
from mpam_calib.report.page import Page
from mpam_calib.report.unremoved import instrument_of
from mpam_calib.specimen.recording import Specimen
from mpam_calib.units import KPA

LIMITED = ("adequate", "named")
"""Verdicts beside which no structure is left that would pass for a further effect."""

SETTLED = 0.95
"""Probability above which a cause's equation is not said to be open."""


SHARED = (
    "The bar of a cause is the root of its Shapley share of the squared misfit: what either of two could "
    "explain by itself is shared between them, however small one is beside the other."
)

FORMS = (
    "These probabilities suppose that a rig's effects follow the catalogue's equations, bent ones too, "
    "to a few per cent. On hidden test cases sets stated at more than 0.99 were the true ones in six of "
    "seven, and in five of seven where a cause had a form that the catalogue does not have. Try a named "
    "cause on the rig before you rely on it."
)

BENT = (
    "A cause with bends follows no equation that is known here: its size goes with these bends and cannot be "
    "compared with one that an equation has."
)


AMONG_THEMSELVES = (
    "No set that was tried removes all that these data show. Their probabilities compare one with another "
    "alone: even one near 1 says that a set is the least wrong, not that its causes are there."
)
"""Of sets beside which structure is left."""
BUT_AN_INSTRUMENT = (
    "Their probabilities compare sets of causes with each other alone, and not with {} at fault, "
    "which explains these data nearly as well, or better."
)

TIMES_BENDS = ", before its bends"
"""A size of a few thousandths may be bent to several hundredths."""


def diagnosis_page(found: Diagnosis, content: dict[str, Any], specimen: Specimen) -> Page:
    """The page for one diagnosis; ``content`` is that of ``diagnosis.json``."""
    causes, parameters, tested = content["causes"], _parameters(found), found.candidates.tested
    lead = first_screen(content | _beyond_the_file(found), specimen)
    sections = [
        Section("Misfit budget", _budget(found, content)),
        Section("Where the misfit shows", _structure(content)),
        Section("Causes", _causes(causes, parameters)),
        *(
            [Section("What could hide unseen", _limits(content, parameters, specimen, tested))]
            if content["verdict"] in LIMITED
            else []
        ),
        Section("What else could it be", _alternatives(content, found, specimen)),
        Section("Gain on data the fit never saw", _gain(content)),
        Section("What these data cannot test", not_tested(content, specimen)),
        Section("Simulation", [Text(wording.simulation_sentence(specimen.simulation))]),
    ]
    return Page(specimen.name, "Diagnosis: what the simulation gets wrong", lead, sections)


def _beyond_the_file(found: Diagnosis) -> dict[str, Any]:
    """What the first screen says that ``diagnosis.json`` has no key for.

    Its remainder is beside the causes reported: without any it holds what the likeliest set explains, too.
    """
    verdict = found.verdict
    likely = verdict.probabilities.get(verdict.leading, 0.0)
    return {
        "left": verdict.left,
        "read_N": (float(found.problem.force.min()), float(found.problem.force.max())),
        "left_N": remainder_rms(found.problem, found.search.best_fit(verdict.leading)),
        "leading": {"ids": sorted(verdict.leading), "probability": likely},
    }


def _structure(content: dict[str, Any]) -> list[Block]:
    rows = [
        {
            "residuals against": row["against"],
            "p before": probability(row["p_before"]),
            "p after": probability(row["p_after"]),
            "size before (N)": row["rms_before_N"],
            "size after (N)": row["rms_after_N"],
        }
        for row in content["structure"]
    ]
    text = (
        "Each row asks whether the residuals still depend on something. Without structure p is evenly spread "
        "between 0 and 1; below 0.001 there is structure. As the noise is only estimated, the verdict turns "
        f"on it only where p is below {TRACE:.6f} and the size above {TRACE_SIZE:g} times a reading's noise."
    )
    formats = dict.fromkeys(["p before", "p after"], "{}")
    formats |= dict.fromkeys(["size before (N)", "size after (N)"], "{:.2g}")
    return [Text(text), DataTable(pd.DataFrame(rows), "Tests of structure, before and after", formats)]


def _budget(found: Diagnosis, content: dict[str, Any]) -> list[Block]:
    names = [effect(c["id"]).title for c in content["causes"]]
    misfit_before = content["misfit_before_N"]
    newtons = [misfit_before * float(np.sqrt(max(c["share_of_misfit"], 0.0))) for c in content["causes"]]
    left = content["misfit_after_N"]
    problem, search = found.problem, found.search
    # By its equations, as the bars: what a doubt about them adds would hide, or make, structure.
    shown = {
        title: problem.force - by_equations(problem, search.fits[effects, 0])
        for title, effects in _compared(found).items()
    }
    middle = problem.middle()
    maps = misfit.residual_maps(
        middle.displacement / problem.setting.geometry.L0,
        middle.sign,
        problem.setting.levels[problem.level] / KPA,
        shown,
        float(np.sqrt(np.median(np.diagonal(problem.noise)))),
    )
    return [
        Figure(
            misfit.budget([*names, "still unexplained"], [*newtons, left], content["noise_N"]),
            SHARED if names else "What the declared simulation leaves, refitted, beside a reading's noise.",
            "Bars of the newtons that each cause explains",
        ),
        Figure(
            maps,
            "Reduced readings minus the refitted simulation; grey: twice the noise of a reduced reading."
            + _markers(middle.sign),
            f"Residuals: {', '.join(shown)}",
        ),
    ]


def _markers(sign: Floats) -> str:
    """What the markers of readings with such directions mean: a force map may have none."""
    moving, still = np.any(sign != 0.0), np.any(sign == 0.0)
    return (
        f" Triangles up: loading, down: unloading{'; circles: neither' if still else ''}." if moving else ""
    )


def _compared(found: Diagnosis) -> dict[str, frozenset[str]]:
    """Whose residuals are drawn, by their titles: where nothing is named, those of what comes nearest."""
    declared, standing, leading = frozenset[str](), found.verdict.standing, found.verdict.leading
    compared = {"declared simulation": declared}
    if standing:
        return compared | {"with the causes named": standing}
    if leading and (leading, 0) in found.search.fits:
        compared["with the likeliest set, which is not named"] = leading
    return compared


def _parameters(found: Diagnosis) -> dict[str, Parameter]:
    """Every size on the page by its name."""
    setting = found.problem.setting
    forms = (*found.declared_forms, *found.limits)
    return {p.name: p for form in forms for p in effect(form).parameters(setting)}


def _causes(causes: list[dict[str, Any]], parameters: dict[str, Parameter]) -> list[Block]:
    if not causes:
        return [Text("None is named.")]
    named = [
        {
            "cause": effect(c["id"]).title,
            "probability": probability(c["probability"]),
            "share of misfit": c["share_of_misfit"],
            "what it means": _meaning(c["id"], c["form"]),
        }
        for c in causes
    ]
    sizes = [
        (
            "" if number else effect(c["id"]).title,
            name,
            *with_band(values["mean"], values["q05"], values["q95"]),
            parameters[name].printed_unit,
            parameters[name].meaning
            + (TIMES_BENDS if not is_bend(name) and any(map(is_bend, c["parameters"])) else ""),
        )
        for c in causes
        for number, (name, values) in enumerate(c["parameters"].items())
    ]
    bent = any(is_bend(name) for c in causes for name in c["parameters"])
    text = f"{FORMS} {BENT}" if bent else FORMS
    undecided = [
        effect(c["id"]).title.lower()
        for c in causes
        if any(f["form"] == c["form"] and f["probability"] < SETTLED for f in c["forms"])
    ]
    if undecided:
        text += (
            f" The data leave other equations open for: {', '.join(undecided)}. The bands allow for these."
        )
    told = {"probability": "{}", "share of misfit": "{:.3g}"}
    blocks: list[Block] = [Text(text), DataTable(pd.DataFrame(named), "What they are", told)]
    if sizes:
        frame = pd.DataFrame(sizes, columns=["cause", "parameter", "size", "90 % band", "unit", "meaning"])
        blocks.append(DataTable(frame, "Their sizes", {"size": "{}", "90 % band": "{}"}))
    return blocks


def _meaning(identifier: str, form: str) -> str:
    """The effect's sentence, what its form takes otherwise, and whose equation that is."""
    item = effect(identifier)
    plain = form.removesuffix(FORM).removesuffix("-")
    kinds = [k for k in item.kinds if plain == k or plain.startswith(f"{k}-")]
    words = [item.kinds[max(kinds, key=len)]] if kinds else []
    words += [f"equation: {item.sources[plain]}"] if plain in item.sources else []
    return f"{item.sentence} ({'; '.join(words)})" if words else item.sentence


def _alternatives(content: dict[str, Any], found: Diagnosis, specimen: Specimen) -> list[Block]:
    near, shown = found.verdict.near(), found.verdict.likeliest()
    causes = {c["id"] for c in content["causes"]}
    small = {c["id"] for c in content["causes"] if too_small(c["id"], c["parameters"])}
    text = (
        f"Other sets within {BESIDE:g} nats of the likeliest (a factor of "
        f"{round(float(np.exp(BESIDE)), -3):,.0f} in probability): {near or 'none'}."
    )
    if more := len(content["alternatives"][shown:]):
        text += (
            f" Sets with one cause more, less likely beforehand, that the data do not exclude either: {more} "
            "(in diagnosis.json)."
        )
    if content["verdict"] == "unexplained":
        left = found.verdict.left
        text += f" {AMONG_THEMSELVES if left else BUT_AN_INSTRUMENT.format(instrument_of(content))}"
    rows = [
        {
            "set": ", ".join(a["ids"]) or "nothing beyond the declared simulation",
            "probability": probability(a["probability"]),
            "what would tell them apart": telling(
                set(a["ids"]), causes, specimen, found.verdict.marginals, small
            ),
        }
        for a in content["alternatives"][:shown]
    ]
    return [Text(text), DataTable(pd.DataFrame(rows), "Other sets of causes", {"probability": "{}"})]


def _limits(
    content: dict[str, Any],
    parameters: dict[str, Parameter],
    specimen: Specimen,
    tested: Iterable[str] = (),
) -> list[Block]:
    """How large each effect could be without being seen, and of which ``tested`` ones that is not told."""
    without = _without_limit(content, tested)
    if not content["limits"]:
        return without or [Text("No further effect was looked for.")]
    # Not "found": beside an adequate simulation a cause may even be the likelier.
    shown = "Beside the causes named nothing was shown" if content["causes"] else "Nothing was shown"
    text = (
        f"{shown}; that is not to say that nothing is there. Each effect by itself could have any "
        "size inside its 90 % band, in one of its kinds at least, and these data would look the same. Where "
        "such a size would matter to you, make the measurement beside it."
    )
    bands = [
        (limit["id"], name, band) for limit in content["limits"] for name, band in limit["parameters"].items()
    ]
    no_room = {e for e, _, band in bands if (band["q05"], band["q95"]) == NO_ROOM}
    # Of a size with one sign no band holds nothing.
    signed = {n for n, p in parameters.items() if p.prior.from_normal(np.array([-1.0]))[0] < 0.0}
    seen = [
        effect(e).title.lower()
        for e, name, band in bands
        if name in signed and e not in no_room and not band["q05"] < 0.0 < band["q95"]
    ]
    if seen:
        text += (
            f" Bands that exclude zero, though that is too little for a name: {', '.join(seen)}. Look at "
            "these first; one in ten does so by chance."
        )
    if excluded := [effect(e).title.lower() for e in sorted(no_room)]:
        text += (
            f" These data have no room for any size of: {', '.join(excluded)}. Even the smallest that were "
            "tried fit far worse than none."
        )
    rows = [
        {
            "effect": effect(e).title,
            "parameter": name,
            "5 %": significant(band["q05"], 2),
            "95 %": significant(band["q95"], 2),
            "unit": parameters[name].printed_unit,
            "what would show it": TOO_SMALL if too_small(e, {name: band}) else shown_by(e, specimen),
        }
        for e, name, band in bands
    ]
    formats = dict.fromkeys(["5 %", "95 %"], "{}")
    table = DataTable(pd.DataFrame(rows), "Sizes that these data leave room for", formats)
    return [Text(text), table, *without]


def _without_limit(content: dict[str, Any], tested: Iterable[str]) -> list[Block]:
    """Effects that could be there, and of which no size can be told that would be seen; often none."""
    told = {known["id"] for key in ("causes", "limits", "not_tested") for known in content[key]}
    if not (silent := [effect(e).title.lower() for e in tested if e not in told]):
        return []
    return [
        Text(
            f"No limit is stated for: {', '.join(silent)}. How large these are is not told by one number, or "
            "none could be found for them; they may hide as well."
        )
    ]


def _gain(content: dict[str, Any]) -> list[Block]:
    gain = content["gain"]
    if gain is None:
        if content["causes"]:
            few = f"Not measured: of fewer than {FEWEST} pressure levels, or cycles, none can be left out."
            return [Text(few)]
        return [Text("Nothing is named, so there is nothing to gain.")]
    rows = [
        {
            "": what,
            "before": gain[f"{key}_before{unit}"],
            "after": gain[f"{key}_after{unit}"],
            "with the causes named above": gain[f"{key}_named{unit}"],
        }
        for what, key, unit in (
            ("held-out error (N)", "rmse", "_N"),
            ("coverage of 90 % bands", "coverage90", ""),
        )
    ]
    text = (
        f"Whole {HELD_OUT[gain['held_out']]} were held out, {gain['folds']} folds, with search and fit "
        f"repeated in each (after); {gain['folds_same_set']} of them chose the same causes. The held-out "
        f"readings are {_nats(gain, 'elpd_gain')} with what each fold chose than before (each nat is a "
        "factor of 2.7). With fewer data a fold may recognise other causes: the last column keeps those "
        f"named above, fitted anew in every fold ({_nats(gain, 'elpd_gain_named')})."
    )
    table = pd.DataFrame(rows)
    return [
        Text(text),
        DataTable(table, "Before and after, held out", dict.fromkeys(table.columns[1:], "{:.3g}")),
    ]


def _nats(gain: dict[str, Any], key: str) -> str:
    """A gain in words: one that is lost is no negative gain."""
    nats, se = gain[key], significant(gain[f"{key}_se"], 2)
    return f"{significant(abs(nats))} ± {se} nats {'less' if nats < 0.0 else 'more'} probable"
