"""Score ``diagnose`` on a set of hidden-effect cases: in tests/, ``python -m criticism.score locked``.

``locked-halved`` has the same cases with every effect at half its size; ``develop-bent`` has develop's with
their effects' forms bent at random.
Every case is one line of ``reports/score_<set>.csv``; a second run goes on where the first stopped. Every
rate that it prints has its binomial (Wilson) interval.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from rig import case as rig_case
from rig import margins, recipes, sets
from rig.effects import form as rig_form

from criticism.cases import diagnosed_problem_of, read_case
from criticism.found import search
from criticism.resumed import completed, reported
from mpam_calib.criticism.searching.candidates import candidates
from mpam_calib.criticism.searching.searched import Search
from mpam_calib.criticism.sizes import DRAWS, sizes_of
from mpam_calib.criticism.verdict import judge
from mpam_calib.errors import InputError
from mpam_calib.model.effect import effect
from mpam_calib.units import si_factor

FIELDS = ["name", "group", "truth", "outside", "word", "named", "listed", "probability", "inside", "sized"]
HALVED, BENT = "-halved", "-bent"
"""What the name of a set ends in whose effects are halved, or bent."""
NATS = 10.0
"""Nats by which the oracle must prefer the truth for a case to count as separable."""
MARGINS = (NATS, 20.0, 50.0, 200.0, float("inf"))
"""Classes of such margins, nats."""


@dataclass(frozen=True)
class Scored:
    """One case: the truth, the verdict, the causes named and the sets listed (best first)."""

    name: str
    group: str
    truth: frozenset[str]
    outside: bool
    word: str
    named: frozenset[str]
    listed: tuple[frozenset[str], ...]
    """What ``diagnosis.json`` has as causes or alternatives."""
    probability: float
    inside: int = 0
    sized: int = 0


def _inside(search: Search, effects: frozenset[str], one: rig_case.Case) -> tuple[int, int]:
    """How many hidden sizes of a form that the package shares lie in their 90 % bands, and of how many."""
    sizes = sizes_of(search, effects)
    told = {p.name for e in sizes.fits[0].effects for p in effect(e).parameters(sizes.setting)}
    hits = of = 0
    for hidden in one.hidden:
        form = rig_form(hidden.id, hidden.form)
        if not form.shared or form.parameter not in told:
            continue
        values = sizes.draw(form.parameter, DRAWS, np.random.default_rng(one.seed))
        low, high = np.quantile(values, [0.05, 0.95])
        of += 1
        hits += bool(low <= hidden.size * si_factor(form.parameter) <= high)
    return hits, of


def score_case(recipe: recipes.Recipe, which: str = "") -> Scored:
    """Record one case, read it as a specimen folder, search and judge; ``which`` is the set's name."""
    one = recipes.build_case(recipe)
    if which.endswith(HALVED):
        one = recipes.halved(one)
    elif which.endswith(BENT):
        one = replace(one, bent=1)
    truth = frozenset(one.ids)
    try:
        specimen = read_case(one)
    except InputError:  # a muscle that pushes is refused at the door
        return Scored(one.name, one.group, truth, one.outside is not None, "refused", frozenset(), (), 0.0)
    problem = diagnosed_problem_of(specimen)
    found = search(problem, candidates(problem).tested)
    verdict = judge(found)
    named_right = bool(truth) and verdict.word == "named" and verdict.standing == truth
    inside, sized = _inside(found, truth, one) if named_right else (0, 0)
    told = {verdict.standing, *verdict.others()}
    best = [(s, p) for s, p in verdict.probabilities.items() if s in told]
    return Scored(
        one.name, one.group, truth, one.outside is not None, verdict.word,
        verdict.standing, tuple(s for s, _ in best), best[0][1], inside, sized,
    )  # fmt: skip


def _joined(ids: frozenset[str]) -> str:
    return "+".join(sorted(ids))


def _row(s: Scored) -> list[str]:
    listed = "|".join(_joined(ids) or "-" for ids in s.listed)
    named = _joined(s.named)
    return [
        s.name,
        s.group,
        _joined(s.truth),
        str(int(s.outside)),
        s.word,
        named,
        listed,
        f"{s.probability:.4f}",
        str(s.inside),
        str(s.sized),
    ]


def _parsed(row: dict[str, str]) -> Scored:
    def ids(text: str) -> frozenset[str]:
        return frozenset(text.split("+")) if text and text != "-" else frozenset()

    return Scored(
        row["name"], row["group"], ids(row["truth"]), row["outside"] == "1", row["word"], ids(row["named"]),
        tuple(ids(t) for t in row["listed"].split("|") if t), float(row["probability"]),
        int(row["inside"]), int(row["sized"]),
    )  # fmt: skip


def wilson(hits: int, of: int) -> tuple[float, float]:
    """95 % interval of a binomial rate."""
    if of == 0:
        return 0.0, 1.0
    z, p = 1.96, hits / of
    middle = (p + z**2 / (2 * of)) / (1 + z**2 / of)
    half = z * np.sqrt(p * (1 - p) / of + z**2 / (4 * of**2)) / (1 + z**2 / of)
    return float(middle - half), float(middle + half)


def plain(which: str) -> str:
    """The set's name without what was done to its effects."""
    return which.removesuffix(HALVED).removesuffix(BENT)


def rates(scored: list[Scored], which: str) -> list[tuple[str, int, int]]:
    """The rates that are asked of diagnose, as (what, hits, of)."""
    table = margins.read_margins(plain(which))
    column = "margin_halved" if which.endswith(HALVED) else "margin"
    separable = {name for name, row in table.items() if row[column] and float(row[column]) >= NATS}
    beaten = {name for name, row in table.items() if row[column] and float(row[column]) <= 0.0}
    clean = [s for s in scored if not s.outside]
    sep = [s for s in clean if s.truth and s.name in separable]
    other = [s for s in clean if s.truth and s.name not in separable]
    seen = [s for s in other if s.word != "adequate"]
    null = [s for s in clean if not s.truth]
    outside = [s for s in scored if s.outside]
    return [
        ("separable: exact set named", sum(s.word == "named" and s.named == s.truth for s in sep), len(sep)),
        ("separable: truth ranked first", sum(s.listed[:1] == (s.truth,) for s in sep), len(sep)),
        ("separable: wrong set named", sum(s.word == "named" and s.named != s.truth for s in sep), len(sep)),
        ("not separable: truth among the listed", sum(s.truth in s.listed for s in other), len(other)),
        (
            "not separable: another set beats it for the oracle",
            sum(s.name in beaten for s in other),
            len(other),
        ),
        (
            "not separable, not adequate: truth among the listed",
            sum(s.truth in s.listed for s in seen),
            len(seen),
        ),
        ("not separable: adequate", sum(s.word == "adequate" for s in other), len(other)),
        (
            "not separable: wrong set named",
            sum(s.word == "named" and s.named != s.truth for s in other),
            len(other),
        ),
        ("nothing hidden: nothing named", sum(s.word == "adequate" for s in null), len(null)),
        ("outside: unexplained", sum(s.word == "unexplained" for s in outside), len(outside)),
        ("outside: no false name", sum(s.named <= s.truth for s in outside), len(outside)),
        (
            "named: size of a shared form in its band",
            sum(s.inside for s in scored),
            sum(s.sized for s in scored),
        ),
    ]


def by_margin(scored: list[Scored], which: str) -> list[tuple[str, int, int]]:
    """Exact sets of the separable cases by how clearly the oracle tells them, as (what, hits, of)."""
    table = margins.read_margins(plain(which))
    column = "margin_halved" if which.endswith(HALVED) else "margin"
    told = [s for s in scored if s.truth and not s.outside and table[s.name][column]]
    found = []
    for low, high in pairwise(MARGINS):
        here = [s for s in told if low <= float(table[s.name][column]) < high]
        exact = sum(s.word == "named" and s.named == s.truth for s in here)
        found.append((f"separable by {low:g} to {high:g} nats: exact set named", exact, len(here)))
    return found


def calibration(scored: list[Scored]) -> list[tuple[float, float, int, int]]:
    """Stated probability of the leading set against how often it is the truth: (from, to, hits, cases)."""
    clean = [s for s in scored if not s.outside and s.listed]
    table = []
    for low, high in pairwise((0.0, 0.5, 0.8, 0.95, 0.99, 1.0)):
        here = [s for s in clean if low < s.probability <= high]
        table.append((low, high, sum(s.listed[0] == s.truth for s in here), len(here)))
    return table


def draw_calibration(scored: list[Scored], path: Path) -> None:
    """Stated probabilities of the leading set against actual frequencies, with 95 % intervals."""
    mpl.rcParams["svg.hashsalt"] = "calibration"
    figure = Figure(figsize=(4.2, 3.6), layout="constrained")
    axes = figure.subplots()
    axes.plot([0, 1], [0, 1], color="0.7", linewidth=1)
    clean = [s for s in scored if not s.outside and s.listed]
    for low, high, hits, of in calibration(scored):
        if of:
            stated = float(np.mean([s.probability for s in clean if low < s.probability <= high]))
            bottom, top = wilson(hits, of)
            axes.plot([stated, stated], [bottom, top], color="tab:blue")
            axes.plot(stated, hits / of, "o", color="tab:blue")
            axes.annotate(
                f"{hits}/{of}", (stated, bottom), textcoords="offset points", xytext=(-12, -11), fontsize=8
            )
    axes.set(xlabel="stated probability of the leading set", ylabel="share in which it is the truth")
    axes.set(xlim=(-0.02, 1.04), ylim=(-0.08, 1.04))
    figure.savefig(path, metadata={"Date": None})


def _score_line(recipe: recipes.Recipe, which: str) -> list[str]:
    return _row(score_case(recipe, which))


def main(which: str, shard: int = 0, shards: int = 1, workers: int = 2) -> None:
    """Score what is not scored yet, then print the rates of all that is."""
    path = reported(f"score_{which}.csv")
    todo = sets.recipes(plain(which))[shard::shards]
    if plain(which) != which:
        todo = [r for r in todo if r.effects and not r.outside]
    todo = sorted(todo, key=lambda r: r.seed)  # so that what an interrupted run has done is a fair sample
    lines = completed(path, FIELDS, todo, partial(_score_line, which=which), workers)
    everything = [_parsed(line) for line in lines]
    for what, hits, of in rates(everything, which) + by_margin(everything, which):
        low, high = wilson(hits, of)
        share = hits / of if of else float("nan")
        print(f"{what:<52} {hits:>4} of {of:<4} {share:6.1%}  ({low:.1%} to {high:.1%})")
    print("stated probability of the leading set, and how often it is the truth")
    for low, high, hits, of in calibration(everything):
        print(f"  {low:.2f} to {high:.2f}: {hits:>4} of {of}")
    draw_calibration(everything, path.with_suffix(".svg"))


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:]))
