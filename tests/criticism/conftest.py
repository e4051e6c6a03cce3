"""Fixtures that several tests of criticism share."""

from __future__ import annotations

import pytest

from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.data.rows import Rows

from .cases import null_recipe, problem_of, specimen_of


@pytest.fixture(scope="module")
def problem() -> Problem:
    """A muscle in which nothing is hidden."""
    return problem_of(specimen_of(null_recipe().name))


@pytest.fixture(scope="module", params=["develop-null-001", "develop-null-003", "develop-null-004"])
def rows(request: pytest.FixtureRequest) -> Rows:
    """The readings of three muscles in which nothing is hidden."""
    found = problem_of(specimen_of(request.param)).rows
    assert found is not None
    return found
