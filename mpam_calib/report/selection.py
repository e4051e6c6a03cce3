"""The selection report: which simulation the data ask for, and whether they can tell."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pandas as pd
from markupsafe import Markup

from mpam_calib.criticism.selection.select import Selection
from mpam_calib.model.blueprint import MaterialPosterior, draw_blueprint
from mpam_calib.model.nuisance import nuisance_parameters
from mpam_calib.posterior.likelihood.floor import pulling
from mpam_calib.posterior.likelihood.points import KINDS, gather_points
from mpam_calib.report.blocks import Block, DataTable, Headline, Notice, Section, Text, Verdict
from mpam_calib.report.choices import choices_section
from mpam_calib.report.numbers import fixed, probability, significant
from mpam_calib.report.page import Page
from mpam_calib.report.wording import left_aside
from mpam_calib.specimen.recording import Specimen

SHOWN = 20
SURE = 0.95
NAMED = ("kinematics", "strain", "order", "law", "friction")
CHOICES = [*NAMED, "effects"]
MEASURED = 4e-4
"""Nats to which the rules of integration were measured: what their own errors say below is not to be had."""
FIGURES = ("probability", "n", "log evidence", "error (N)", "density (nats)")
RANKING = (
    "Best first. n: parameters; error and log density: of pressure levels that were held out (of loops: the "
    "means of neighbouring readings, which scatter less than single ones)."
)
ASSUMED_NOISE = (
    "Noise of a reading: {} N, assumed. No force_sd_N is declared and the force map has too few readings to "
    "tell it; this is what all models together make of it, from 0.3 % of the force scale within a factor of "
    "about 7. All evidences are as sharp as the noise is small: declare force_sd_N if it is known."
)
AS_DECLARED = Markup(
    "Effects are as declared ({}) in every model of this ranking. One that is missing, such as a dead-band, "
    "shows up here as another {}: run <code>mpam-calib diagnose</code> first."
)


def short_name(row: pd.Series, choices: Sequence[str] = NAMED) -> str:
    """One model in a few words, by these choices."""
    return ", ".join(f"M = {row[c]}" if c == "order" else str(row[c]) for c in choices)


def compared(models: pd.DataFrame) -> tuple[str, ...]:
    """The choices in which the models differ; all, where there is but one model."""
    return tuple(c for c in NAMED if (models[c] != models[c].iloc[0]).any()) or NAMED


def not_compared(models: pd.DataFrame) -> str:
    """The choices that are alike in all models, of which the ranking says nothing; "" where there is none."""
    alike = [c for c in NAMED if c not in compared(models)]
    return ", ".join(f"{c} ({models[c].iloc[0]})" for c in alike)


def selection_sentence(models: pd.DataFrame) -> str:
    """What the data say of the models (best first), or that they cannot tell."""
    if len(models) == 1:
        return f"Nothing could be chosen: {short_name(models.iloc[0])} is the only model."
    if float(models["probability"].iloc[0]) >= SURE:
        return f"The data ask for {short_name(models.iloc[0], compared(models))}."
    together = models["probability"].cumsum().searchsorted(SURE) + 1
    return f"The data cannot tell: {together} models share {SURE:.0%} of the probability."


def held_out_sentence(models: pd.DataFrame) -> tuple[bool, str]:
    """Whether pressure levels left out bear the first model out (or at least do not contradict it), and what
    they say.

    Errors of two models on the same rows go together, so that the root of the sum of their squares is the
    most that their difference can be off by.
    """
    held = models.dropna(subset=["elpd_held_out"])
    first = models.iloc[0]
    if held.empty:
        return False, "pressure levels held out say nothing here: too few can be left out"
    if first.name not in held.index:
        return False, "pressure levels held out say nothing of this model: it cannot be fitted without some"
    if len(held) < 2:
        return False, "pressure levels held out say nothing here: no other model has a figure to compare with"
    ranked = held.sort_values("elpd_held_out", ascending=False, kind="stable")
    agrees = bool(ranked.index[0] == first.name)
    other = ranked.iloc[1 if agrees else 0]
    apart = abs(float(first["elpd_held_out"] - other["elpd_held_out"]))
    error = math.hypot(first["elpd_held_out_se"], other["elpd_held_out_se"])
    by = f"{fixed(apart, 1)} nats, standard error up to {fixed(error, 1)}"
    choices = compared(models)
    winner = "the same model" if agrees else short_name(other, choices)
    if apart >= error:
        return agrees, f"held-out pressure levels prefer {winner} ({by})"
    unclear = f"that does not tell it apart from {short_name(other if agrees else first, choices)}"
    return True, f"held-out pressure levels put {winner} first, but {unclear} ({by})"


def ranking_table(models: pd.DataFrame) -> tuple[pd.DataFrame, str]:
    """The ranking for print, and a sentence on the choices that are the same in all its models."""
    first = models.iloc[0]
    constant = [c for c in CHOICES if len(models) > 1 and (models[c] == first[c]).all()]
    table = models[[c for c in CHOICES if c not in constant]].copy()
    table["probability"] = [probability(p) for p in models["probability"]]
    table["n"] = models["n_parameters"]
    table["log evidence"] = _with_errors(models, "log_evidence", 2, MEASURED)
    errors = models["rmse_held_out_N"].astype(float)
    table["error (N)"] = [significant(x) for x in errors]
    table["density (nats)"] = _with_errors(models, "elpd_held_out", 1)
    same = ", ".join(f"{c} {first[c] or 'none'}" for c in constant)
    return table, f" The same in all of these: {same}." if same else ""


def evidence_text(disagreement: float) -> str:
    """How the evidences were found; ``disagreement`` (nats) is NaN where no model was bridged."""
    first = (
        "Evidence of the leading models is by quadrature or, with many parameters, by annealing: no bridge "
        "was built that is to be relied on."
        if math.isnan(disagreement)
        else "Evidence of the leading models with few parameters is by bridge sampling, with its error; "
        f"quadrature differs from it by at most {disagreement:.2g} nats, and its figure stands, without an "
        "error, where that is more than the errors of both."
    )
    return (
        f"{first} That of models with a rate for each modulus is known less well. A model without an error "
        "lies far below and has Laplace's approximation, or its bridge is not to be relied on."
    )


def _with_errors(models: pd.DataFrame, column: str, digits: int, least: float = 0.0) -> list[str]:
    """Values "v ± error" (at ``least`` so much), or without what is not known."""
    errors = models[f"{column}_se"].astype(float).clip(lower=least)
    found = []
    for value, error in zip(models[column].astype(float), errors, strict=True):
        known = f" ± {error:.1g}" if error < 1.0 else f" ± {error:.0f}"
        found.append(fixed(value, digits) + ("" if math.isnan(error) else known))
    return found


def declared_sds(specimen: Specimen, material: MaterialPosterior | None) -> list[str]:
    """Declared uncertainties of geometry and gauge, of which no effect takes care."""
    setting = draw_blueprint(specimen, material=material).setting()
    return [] if setting is None else [parameter.name for parameter in nuisance_parameters(setting)]


def not_in_evidence(specimen: Specimen, material: MaterialPosterior | None) -> list[str]:
    """What is declared or recorded, calibration uses, and no model of the ranking does."""
    found, slack = [], 0
    if uncertain := declared_sds(specimen, material):
        found.append(
            f"Declared uncertainties ({', '.join(uncertain)}) are not part of this ranking: every model has "
            "the declared values, as if they were exact. If one is off, that shows up here as another "
            "kinematics, order or law, with a probability that is too sure."
        )
    if (loops := specimen.loops) is not None:
        unclear = 0 if loops.unclear is None else int(loops.unclear.sum())
        slack += len(loops.force_N) - int(pulling(loops).sum()) - unclear
    if (points := gather_points(specimen)) is not None:
        slack += int(points.censored.sum())
        if free := int((points.kind == KINDS.index("free_contraction")).sum()):
            found.append(f"Free contractions ({free} rows) are not part of the evidence.")
    if slack:
        found.append(
            f"Slack readings ({slack}: at or below the force floor, and those that only noise lifts above "
            "it) are not part of the evidence."
        )
    return found


def selection_page(found: Selection, specimen: Specimen, material: MaterialPosterior | None = None) -> Page:
    """The page for one selection; ``material`` is what ``moduli = "run:..."`` names."""
    models = found.models
    sure = float(models["probability"].iloc[0]) >= SURE and len(models) > 1
    agrees, said = held_out_sentence(models)
    likely = probability(float(models["probability"].iloc[0]))
    reasons = [f"the best model by evidence has probability {likely}", said]
    if len(models) == 1:
        reasons = ["there is no other model to compare it with"]
    if alike := not_compared(models):
        reasons.append(f"not compared, as all models have the same: {alike}")
    if found.noise_guess is not None:
        reasons.append("the noise of a reading is only assumed, and all probabilities with it")
    if uncertain := declared_sds(specimen, material):
        reasons.append(f"declared uncertainties ({', '.join(uncertain)}) are not in the evidence")
    mistaken = " or ".join([c for c in ("order", "strain") if c in compared(models)] or compared(models))
    good = sure and agrees and not uncertain and found.noise_guess is None
    lead: list[Block] = [
        Headline(selection_sentence(models)),
        Verdict("Model selection", "good" if good else "caution", reasons),
        Notice(AS_DECLARED.format(", ".join(specimen.simulation.effects) or "none", mistaken)),
    ]
    lead += [
        Notice(text) for text in [*left_aside(specimen, "ranking"), *not_in_evidence(specimen, material)]
    ]
    if found.noise_guess is not None:
        lead.append(Notice(ASSUMED_NOISE.format(significant(found.noise_guess))))
    choices = compared(models)
    names = [short_name(models.iloc[i], choices) for i in range(len(found.confusion))]
    table, same = ranking_table(models.head(SHOWN))
    sections = [
        Section(
            "Ranking",
            [
                DataTable(table, f"{RANKING}{same}", dict.fromkeys(FIGURES, "{}")),
                Text(evidence_text(found.disagreement)),
            ],
        ),
        choices_section(found.odds, found.levels),
        _sensitivity_section(found, names, prior_of_moduli(specimen)),
    ]
    if found.replicates:
        sections.append(_confusion_section(found, names, recorded(specimen)))
    return Page(specimen.name, "Model selection", lead, sections)


def recorded(specimen: Specimen) -> str:
    """What a simulated set of readings stands for."""
    parts = {
        "loops": specimen.loops,
        "a force map": specimen.force_map,
        "blocked forces": specimen.blocked_force,
    }
    return " and ".join(name for name, part in parts.items() if part is not None)


def _confusion_section(found: Selection, names: list[str], what: str) -> Section:
    """How often each leading model wins on data simulated from one of them."""
    confusion = pd.DataFrame(found.confusion, columns=[str(i + 1) for i in range(len(names))])
    confusion.insert(0, "simulated from", [f"{i + 1}: {name}" for i, name in enumerate(names)])
    return Section(
        "Would data like these tell them apart?",
        [
            Text(
                f"Each row: {found.replicates} sets of readings ({what}) simulated from that model with this "
                "specimen's design and noise; the columns say how often each model was then ranked first."
            ),
            DataTable(
                confusion,
                "Confusion of the leading models",
                {str(i + 1): "{:.2f}" for i in range(len(names))},
            ),
        ],
    )


def first_under(winners: list[str], first: str) -> str:
    """Whether the ``first`` model is first under all priors; ``winners`` are those that are."""
    each = list(dict.fromkeys(winners))
    if each == [first]:
        return "The first model stays first under all of them."
    if len(each) == 1:
        return f"Another model is first under all of them: {each[0]}."
    return f"Which model is first depends on them: {'; '.join(each)}."


def prior_of_moduli(specimen: Specimen) -> str:
    """What the prior of the moduli is, whose width is halved and doubled."""
    moduli = specimen.simulation.moduli
    if moduli == "loops":
        return "stated in newtons"
    if moduli == "tensile":
        return "what the tensile test gives" if specimen.tensile is not None else "E_rel_sd"
    return "what the material's run gives"


def _sensitivity_section(found: Selection, names: list[str], of_moduli: str) -> Section:
    """Shares among the leading models under other prior widths; ``of_moduli`` says what the moduli's is."""
    shares = found.sensitivity.pivot_table(index="model", columns="prior", values="probability")
    shares = shares[list(dict.fromkeys(found.sensitivity["prior"]))].reset_index(drop=True)
    winners = shares.to_numpy().argmax(axis=0)
    formats = dict.fromkeys(shares.columns, "{}")
    shares = shares.map(probability)
    shares.insert(0, "probability among these", [f"{i + 1}: {name}" for i, name in enumerate(names)])
    return Section(
        "Does it depend on the priors?",
        [
            Text(
                "Evidence weighs a model by what its prior thought possible. Here the widths of the priors "
                f"are halved and doubled: of the moduli ({of_moduli}), and of all other parameters. "
                + first_under([names[int(i)] for i in winners], names[0])
            ),
            DataTable(shares, "Shares among the leading models", formats),
        ],
    )
