"""select: the model that made the loops comes first; a table as the contract has it."""

from __future__ import annotations

import numpy as np
import pytest
from rig import sets

from criticism.test_hypotheses import problem_of, specimen_of
from mpam_calib.criticism import select as module
from mpam_calib.criticism import space
from mpam_calib.criticism.fit import fit


def test_the_simulated_model_comes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(space, "ORDERS", range(1, 4))
    monkeypatch.setattr(module, "HELD_OUT", 3)
    monkeypatch.setattr(module, "CONFUSED", 2)
    recipe = next(r for r in sets.recipes("develop") if r.group == "null" and r.moduli == "loops")
    specimen = specimen_of(recipe.name)
    found = module.select(specimen, replicates=2)
    models = found.models
    assert list(models.columns) == module.COLUMNS
    assert np.all(np.diff(models["log_evidence"]) <= 0)
    assert models["probability"].sum() == pytest.approx(1.0)
    assert found.confusion.shape == (2, 2)
    np.testing.assert_allclose(found.confusion.sum(axis=1), 1.0)
    # The leading models have an error of their evidence, and figures under other priors; no other has.
    assert models["log_evidence_se"].notna().tolist() == [True] * 2 + [False] * (len(models) - 2)
    assert models["log_evidence_se"].iloc[:2].between(0.0, 0.1).all()
    assert len(found.sensitivity) == 2 * 5
    assert found.disagreement < 0.2
    best = models.iloc[0]
    for name in ("kinematics", "strain", "order", "law", "friction"):
        assert best[name] == getattr(recipe, name), name


def test_held_out_levels_are_predicted_from_the_others() -> None:
    """A model's held-out density falls when the held-out forces are wrong."""
    recipe = next(r for r in sets.recipes("develop") if r.group == "null" and r.moduli == "tensile")
    problem = problem_of(specimen_of(recipe.name))
    held = problem.level == problem.level.max()
    index = (np.flatnonzero(~held), np.flatnonzero(held))
    from mpam_calib.criticism.gain import log_density, predict_rows

    fitted = fit(problem.take(~held), frozenset(), 0)
    mean, covariance = predict_rows(problem, fitted, index)
    right = log_density(problem.force[held] - mean, covariance)
    wrong = log_density(1.1 * problem.force[held] - mean, covariance)
    assert right > wrong + 10.0
