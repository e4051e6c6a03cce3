"""A selection in words: orders and laws against each other, and levels predicted from the others."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from mpam_calib.report.blocks import Block, DataTable, Section, Text
from mpam_calib.report.numbers import probability, superscript

WORDS = {"order": "Orders", "law": "Laws"}
HUGE = 1e4
"""Odds beyond this are written as a power of ten."""
AWAY = 2.0
"""Standard deviations of its prediction beyond which a level's mean is off."""
WHOSE = {
    "first": "the first model",
    "held out": "the model that is best at levels left out",
    "declared": "the declared model",
}


def against(nats: float) -> str:
    """Odds of so many nats in words.

    >>> against(0.0), against(-2.302585), against(2.302585), against(-4.603), against(-230.2585)
    ('1 to 1', '1 to 10', '10 to 1', '1 to 100', '1 to 10¹⁰⁰')
    """
    size = abs(nats)
    if size > math.log(HUGE):
        text = f"10{superscript(round(size / math.log(10.0)))}"
    else:
        odds = math.exp(size)
        text = f"{odds:.2g}" if odds < 99.5 else f"{odds:.0f}"
    return f"1 to {text}" if nats <= 0.0 else f"{text} to 1"


def choice_sentences(odds: pd.DataFrame, choice: str) -> list[str]:
    """One sentence with all else as declared, one over all models; odds against the best of each."""
    table = odds[odds["choice"] == choice]
    found = []
    for column, where in (
        ("log_evidence_declared", "all else as declared"),
        ("log_evidence", "over all models"),
    ):
        known = table.dropna(subset=[column]).sort_values(column, ascending=False)
        if len(known) < 2:
            continue
        best = known.iloc[0]
        others = [
            f"{_named(choice, row['value'])} ({against(row[column] - best[column])})"
            for _, row in known.iloc[1:].iterrows()
        ]
        found.append(
            f"{WORDS[choice]}, {where}: {_named(choice, best['value'])} is the most probable; "
            f"against it the odds are {', '.join(others)}."
        )
    neighbours = _neighbours(table) if choice == "order" else []
    return [*found, *neighbours]


def _neighbours(table: pd.DataFrame) -> list[str]:
    """Each order against the one below it, from the first that is not hopeless."""
    found = []
    for column, where in (
        ("log_evidence_declared", "all else as declared"),
        ("log_evidence", "over all models"),
    ):
        known = table.dropna(subset=[column]).sort_values("value")
        pairs = [
            f"{_named('order', high['value'])} against {low['value']} ({against(high[column] - low[column])})"
            for (_, low), (_, high) in zip(known.iloc[:-1].iterrows(), known.iloc[1:].iterrows(), strict=True)
        ]
        if pairs:
            found.append(f"Each order against the next lower one, {where}: {', '.join(pairs)}.")
    return found


def _named(choice: str, value: object) -> str:
    return f"M = {value}" if choice == "order" else str(value)


def level_sentence(levels: pd.DataFrame, model: str) -> str:
    """Which levels a model predicts from the others, and which not."""
    rows = levels[levels["model"] == model]
    if not len(rows):
        return ""
    off = rows[rows["bias_N"].abs() > AWAY * rows["bias_sd_N"]]
    ends = ", ".join(f"{p:.4g} kPa" for p in rows.loc[rows["extrapolated"], "pressure_kPa"])
    said = "; ".join(
        f"{row['pressure_kPa']:.4g} kPa by {row['bias_N']:.2g} N (expected sd {row['bias_sd_N']:.2g} N)"
        for _, row in off.iterrows()
    )
    verdict = (
        f"it misses {said}" if said else "no level's mean is missed by more than two standard deviations"
    )
    inside = np.average(rows["inside90"], weights=rows["rows"])  # levels differ in how many rows they have
    return (
        f"Each level predicted from all others by {WHOSE[model]}: {verdict}; root mean square errors are "
        f"{rows['rmse_N'].min():.2g} to {rows['rmse_N'].max():.2g} N, and {inside:.0%} of the rows "
        f"lie inside their 90 % bands{f' ({ends} extrapolated)' if ends else ''}."
    )


def choices_section(odds: pd.DataFrame, levels: pd.DataFrame) -> Section:
    """Orders, laws and levels in words, with the figures behind them."""
    blocks: list[Block] = [Text(s) for choice in WORDS for s in choice_sentences(odds, choice)]
    blocks += [Text(s) for model in WHOSE if (s := level_sentence(levels, model))]
    # A choice of one value was not made.
    table = odds[odds.groupby("choice")["value"].transform("size") > 1]
    if len(table):
        blocks.append(
            DataTable(
                table.assign(probability=[probability(p) for p in table["probability"]]),
                "Each choice by itself (log evidence in nats)",
                {"log_evidence_declared": "{:.2f}", "log_evidence": "{:.2f}", "probability": "{}"},
                collapse=True,
            )
        )
    if len(levels):
        formats = {"pressure_kPa": "{:.4g}", "inside90": "{:.2f}"}
        formats |= dict.fromkeys(("rmse_N", "bias_N", "bias_sd_N"), "{:.3g}")
        blocks.append(DataTable(levels, "Levels predicted from the others", formats, collapse=True))
    return Section(
        "Orders, laws and levels",
        blocks,
        "Odds compare evidence: how probable each made these readings before it saw them. With "
        "more than seven parameters beside the moduli (a rate for each modulus) it may be off by several "
        "nats: see its error in the ranking.",
    )
