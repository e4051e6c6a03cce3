"""What naming the causes gains, beside an oracle: in tests/, ``python -m criticism.gains locked 30``.

For the first cases (by seed) of a set whose verdict reports causes: root mean square error of the extended
model on levels or cycles held out (``after``: search, verdict and fit repeated in every fold; ``named``: the
causes that all rows name, refitted in every fold), beside that of the rig's own model with the true forms
refitted to the same folds; and the coverage of the 90 % bands. All errors are against the same reduced rows.
Every case is one line of ``reports/gains_<set>.csv``; a second run goes on.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
from rig import case as rig_case
from rig import recipes, sets
from rig.oracle import Oracle

from criticism.cases import diagnosed_problem_of, read_case
from criticism.found import search
from criticism.resumed import completed, reported
from mpam_calib.criticism.data.problem import SIZES, Problem
from mpam_calib.criticism.fitting.folds import folds_of
from mpam_calib.criticism.gain import measure_gain
from mpam_calib.criticism.searching.candidates import HISTORY, candidates
from mpam_calib.criticism.verdict import judge
from mpam_calib.errors import InputError
from mpam_calib.specimen.recording import Specimen

FIELDS = [
    "name", "word", "causes", "held_out", "rmse_before_N", "rmse_after_N", "rmse_named_N",
    "rmse_oracle_N", "coverage90_before", "coverage90_after", "coverage90_named", "folds_same_set", "folds",
]  # fmt: skip


def oracle_rmse(recording: rig_case.Recording, specimen: Specimen, problem: Problem, by_cycle: bool) -> float:
    """RMSE (N) of the true forms, fitted without each fold, on the fold's reduced rows."""
    loops = specimen.loops
    assert loops is not None
    raw, reduced = (loops.cycle, problem.cycle) if by_cycle else (loops.level, problem.level)
    known = {h.id: h.size for h in recording.case.hidden}
    squares = []
    for part in folds_of(np.unique(reduced)):
        held = np.isin(raw, part)
        fitted = Oracle(recording, ~held).fit(recording.case.ids, known)
        # The same reduction of the oracle's force as of the readings.
        force = diagnosed_problem_of(replace(specimen, loops=replace(loops, force_N=fitted.force))).force
        squares.append((force - problem.force)[np.isin(reduced, part)] ** 2)
    return float(np.sqrt(np.mean(np.concatenate(squares))))


def measure(recipe: recipes.Recipe) -> list[str] | None:
    """One line of the table; None where the case is refused, names nothing or loses readings to a floor."""
    one = recipes.build_case(recipe)
    try:
        specimen = read_case(one)
    except InputError:
        return None
    if specimen.loops is None or specimen.loops.censored.any():
        return None
    problem = diagnosed_problem_of(specimen)
    tested = candidates(problem).tested
    found = search(problem, tested)
    verdict = judge(found)
    if not verdict.standing:
        return None
    for size in range(len(SIZES)):
        found.refit(verdict.standing, size)
    named = found.best_fit(verdict.standing)
    gain = measure_gain(found.problem, tested, named)
    if gain is None:
        return None
    by_cycle = gain.held_out == "cycle"
    assert by_cycle == (bool(verdict.standing & set(HISTORY)) and len(np.unique(problem.cycle)) > 2)
    oracle = oracle_rmse(rig_case.record(one), specimen, problem, by_cycle)
    return [
        recipe.name, verdict.word, "+".join(sorted(verdict.standing)), gain.held_out,
        *(f"{x:.4f}" for x in (gain.rmse_before, gain.rmse_after, gain.rmse_named, oracle)),
        *(f"{x:.3f}" for x in (gain.coverage90_before, gain.coverage90_after, gain.coverage90_named)),
        str(gain.folds_same_set), str(gain.folds),
    ]  # fmt: skip


def main(which: str, count: int, workers: int = 2) -> None:
    """Measure the first ``count`` cases with hidden effects, then print medians over all lines there are."""
    chosen = [r for r in sets.recipes(which) if r.group == "separable" and not r.outside]
    chosen = sorted(chosen, key=lambda r: r.seed)[:count]
    rows = completed(reported(f"gains_{which}.csv"), FIELDS, chosen, measure, workers)
    for label in ("before", "after", "named"):
        cover = np.array([float(r[f"coverage90_{label}"]) for r in rows])
        print(f"coverage of 90 % bands {label}: median {np.median(cover):.3f}, mean {cover.mean():.3f}")
    for label in ("after", "named"):
        ratio = np.array([float(r[f"rmse_{label}_N"]) / float(r["rmse_oracle_N"]) for r in rows])
        low, middle, high = np.quantile(ratio, [0.25, 0.5, 0.75])
        print(
            f"RMSE {label} over the oracle's, {len(rows)} cases: median {middle:.3f} ({low:.3f}-{high:.3f})"
        )


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:]))
