"""The selection report: which simulation the data ask for, and whether they can tell."""

from __future__ import annotations

import pandas as pd

from mpam_calib.criticism.select import Selection
from mpam_calib.report.choices import choices_section
from mpam_calib.report.page import Block, DataTable, Headline, Notice, Page, Section, Text, Verdict
from mpam_calib.report.wording import left_aside
from mpam_calib.specimen.recording import Specimen

SHOWN = 20
SURE = 0.95


def short_name(row: pd.Series) -> str:
    """One model in a few words."""
    return f"{row['kinematics']}, {row['strain']}, M = {row['order']}, {row['law']}, {row['friction']}"


def selection_sentence(models: pd.DataFrame) -> str:
    """What the data say of the models (best first), or that they cannot tell."""
    if float(models["probability"].iloc[0]) >= SURE:
        return f"The data ask for {short_name(models.iloc[0])}."
    together = models["probability"].cumsum().searchsorted(SURE) + 1
    return f"The data cannot tell: {together} models share {SURE:.0%} of the probability."


def selection_page(found: Selection, specimen: Specimen) -> Page:
    """The page for one selection."""
    models = found.models
    best = models.iloc[0]
    sure = float(best["probability"]) >= SURE
    held = models.dropna(subset=["elpd_held_out"])
    reasons = [f"the best model by evidence has probability {best['probability']:.3g}"]
    if len(held):
        winner = held.iloc[int(held["elpd_held_out"].to_numpy().argmax())]
        same = "the same model" if winner.name == best.name else short_name(winner)
        reasons.append(f"held-out pressure levels prefer {same}")
    lead: list[Block] = [
        Headline(selection_sentence(models)),
        Verdict("Model selection", "good" if sure else "caution", reasons),
    ]
    lead += [Notice(text) for text in left_aside(specimen, "ranking")]
    names = [short_name(models.iloc[i]) for i in range(len(found.confusion))]
    ranks = {
        "log_evidence": "{:.2f}", "log_evidence_se": "{:.2g}", "probability": "{:.3g}",
        "rmse_held_out_N": "{:.3g}",
        "elpd_held_out": "{:.1f}", "elpd_held_out_se": "{:.1f}",
    }  # fmt: skip
    sections = [
        Section(
            "Ranking",
            [
                DataTable(models.head(SHOWN), "Best first", ranks),
                Text(
                    "Evidence of the leading models is by bridge sampling, with its error; quadrature "
                    f"differs from it by at most {found.disagreement:.2g} nats. That of models with a rate "
                    "for each modulus is known less well. A model without an error lies far below and has "
                    "Laplace's approximation, or its bridge is not to be relied on."
                ),
            ],
        ),
        choices_section(found.odds, found.levels),
        _sensitivity_section(found, names),
    ]
    if found.replicates:
        sections.append(_confusion_section(found, names))
    return Page(specimen.name, "Model selection", lead, sections)


def _confusion_section(found: Selection, names: list[str]) -> Section:
    """How often each leading model wins on data simulated from one of them."""
    confusion = pd.DataFrame(found.confusion, columns=[str(i + 1) for i in range(len(names))])
    confusion.insert(0, "simulated from", [f"{i + 1}: {name}" for i, name in enumerate(names)])
    return Section(
        "Would data like these tell them apart?",
        [
            Text(
                f"Each row: {found.replicates} sets of loops simulated from that model with this "
                "specimen's design and noise; the columns say how often each model was then ranked first."
            ),
            DataTable(
                confusion,
                "Confusion of the leading models",
                {str(i + 1): "{:.2f}" for i in range(len(names))},
            ),
        ],
    )


def _sensitivity_section(found: Selection, names: list[str]) -> Section:
    """Shares among the leading models under other prior widths."""
    shares = found.sensitivity.pivot_table(index="model", columns="prior", values="probability")
    shares = shares[list(dict.fromkeys(found.sensitivity["prior"]))].reset_index(drop=True)
    winners = sorted({names[int(i)] for i in shares.to_numpy().argmax(axis=0)})
    said = (
        "The first model stays first under all of them."
        if len(winners) == 1
        else f"Which model is first depends on them: {'; '.join(winners)}."
    )
    formats = dict.fromkeys(shares.columns, "{:.3g}")
    shares.insert(0, "probability among these", [f"{i + 1}: {name}" for i, name in enumerate(names)])
    return Section(
        "Does it depend on the priors?",
        [
            Text(
                "Evidence weighs a model by what its prior thought possible. Here the widths of the priors "
                "are halved and doubled: of the moduli (stated in newtons), and of all other parameters. "
                + said
            ),
            DataTable(shares, "Shares among the leading models", formats),
        ],
    )
