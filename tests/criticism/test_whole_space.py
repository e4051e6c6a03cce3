"""Evidence over the whole space of models of a data set: the time it takes, and how far from quadrature."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from criticism.cases import problem_of
from criticism.test_evidence import dense, inside
from mpam_calib.criticism.data.problem import SIZE_PRIOR
from mpam_calib.criticism.fitting.hypothesis import Hypothesis
from mpam_calib.criticism.selection import ranking, space
from mpam_calib.criticism.selection.evidence import FEW, NEGLIGIBLE, SETTLES, log_evidence_beyond_laplace
from mpam_calib.criticism.selection.ranking import Ranked
from mpam_calib.criticism.tasks.spread import held_problem, spread_over
from mpam_calib.posterior.evidence import refitted
from mpam_calib.posterior.evidence.quadrature import integrate
from mpam_calib.posterior.evidence.refitted import integrate_refitted
from mpam_calib.specimen import read

DATASETS = Path(__file__).parents[2] / "datasets"
WELL = 4.0
"""Sds above its bound at 0 from which a size is well inside."""
ALLOWED, ALLOWED_NEAR = 0.02, 0.1
"""Nats that the evidence may miss where all sizes are well inside, and elsewhere."""
MILLISECONDS = 20.0
SEEDS, POINTS = (1, 2), 2
"""Those of the reference, and its points in the rule's."""


@pytest.mark.long
@pytest.mark.parametrize("name", ["mpam1_reconstructed", "mpam2_reconstructed", "festo_dmsp10"])
def test_what_ranks_is_the_quadrature(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Of all models of up to seven parameters within 50 nats of the best, whatever remainder matters.

    The reference is a dense grid in one or two dimensions, elsewhere the mean of the rule with other seeds
    and more points. Laplace's first term alone is printed beside it.
    """
    specimen = read(DATASETS / name)
    problem = problem_of(specimen)
    models = [s for s in space.model_space(specimen) if s.law != ranking.EACH]
    start = time.process_time()
    with threadpool_limits(1):
        ranked = [r for s in models if (r := ranking.fitted(problem, s)) is not None]
    each = 1e3 * (time.process_time() - start) / len(models)
    near = max(r.log_evidence for r in ranked) - ranking.NEAR
    leading = [r for r in ranked if r.log_evidence >= near and 0 < len(r.best.u) <= SETTLES]
    with threadpool_limits(1), spread_over(problem, 2) as spread:
        away, laplace, ranks = np.array([row for rows in spread(_off, leading) for row in rows]).T
    well = away >= WELL
    with capsys.disabled():
        print(f"\n{name}: {each:.1f} ms of processor time for each of {len(models)} models")
        for words, here in (("sizes 4 sds inside", well), ("nearer to a bound", ~well)):
            print(f"  {words}: {_counts('Laplace', laplace[here])}; {_counts('what ranks', ranks[here])}")
    assert len(ranks) >= 5
    assert np.all(ranks <= ALLOWED_NEAR)
    assert np.all(ranks[well] <= ALLOWED)
    assert each <= MILLISECONDS


def _off(ranked: Ranked) -> list[tuple[float, float, float]]:
    """By size of the remainder: distance to a bound (sds), misses of Laplace and what ranks (nats)."""
    problem = held_problem()
    blueprint = ranking.blueprint_of(problem, ranked.simulation)
    rows = []
    for found in ranked.fits:
        if found.log_evidence < ranked.best.log_evidence - NEGLIGIBLE:
            continue
        hypothesis = Hypothesis(problem, blueprint, found)
        mode = hypothesis.mode()
        if len(mode.u) <= 2:
            exact = dense(hypothesis, mode)
        else:
            rule = integrate_refitted if len(mode.u) <= FEW else integrate
            with pytest.MonkeyPatch.context() as more:
                more.setattr(refitted, "POINTS", POINTS * refitted.POINTS)
                more.setattr(refitted, "PICKED", POINTS * refitted.PICKED)
                exact = float(np.mean([rule(hypothesis, mode, seed).value for seed in SEEDS]))
        value = log_evidence_beyond_laplace(problem, blueprint, [found])[0] - np.log(SIZE_PRIOR[found.size])
        rows.append((inside(hypothesis, mode), abs(mode.log_evidence - exact), abs(value - exact)))
    return rows


def _counts(what: str, off: np.ndarray) -> str:
    within = ", ".join(f"{np.sum(off <= limit)} within {limit}" for limit in (ALLOWED, ALLOWED_NEAR))
    return f"{what} {within} of {len(off)}, largest {off.max(initial=0.0):.3f} nat"
