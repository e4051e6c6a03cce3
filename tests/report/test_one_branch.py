"""One direction, or held lengths alone: the page does not call such forces free of friction."""

from __future__ import annotations

from dataclasses import replace

import pytest

from mpam_calib.report import trust
from mpam_calib.report.calibration import calibration_page
from mpam_calib.report.one_branch import one_branch, pull_of
from mpam_calib.report.view import CalibrationView
from mpam_calib.specimen.declaration import Simulation

from .synthetic import material, muscle

NO_FRICTION = Simulation(friction="none", order=2)


@pytest.fixture(scope="module")
def both() -> CalibrationView:
    """Loops of both branches with blocked forces beside them, and nothing to remark."""
    view = muscle(n_draws=400, simulation=NO_FRICTION)
    return replace(view, unidentified=view.unidentified.assign(contraction=0.9))


def only(view: CalibrationView, *branches: str, points: bool = False) -> CalibrationView:
    """The view with these branches of its loops, with or without the blocked forces."""
    rows = view.observed
    kept = (rows["kind"] == "loops") & rows["branch"].isin(branches)
    return replace(view, observed=rows[kept | (points & (rows["kind"] == "blocked_force"))])


@pytest.mark.parametrize(("branch", "other"), [("unloading", "loading"), ("loading", "unloading")])
def test_one_direction_alone_does_not_tell_forces_without_friction(
    both: CalibrationView, branch: str, other: str
) -> None:
    assert trust.assess(both).sentence.startswith("Yes")
    view = only(both, branch)
    verdict = trust.assess(view)
    assert verdict.level == "caution"
    assert verdict.sentence == f"Use these numbers with care: only the {branch} branch was recorded."
    assert f"without friction, or on the {other} branch, is not told by these data" in verdict.reasons[0]
    lead = calibration_page(view).render().split("<nav")[0]
    assert "friction-free" not in lead and f"as on the {branch} branch" in lead


def test_both_directions_or_forces_at_rest_tell_it(both: CalibrationView) -> None:
    for view in (both, only(both, "loading", "unloading"), only(both, "unloading", points=True)):
        assert one_branch(view) is None and pull_of(view) == "friction-free"
    assert one_branch(material(n_draws=400)) is None


@pytest.mark.parametrize(
    "declared", [{"friction": "coulomb"}, {"friction": "none", "effects": ("strand_friction",)}]
)
def test_where_friction_is_declared_its_equation_tells_it(
    both: CalibrationView, declared: dict[str, object]
) -> None:
    view = only(replace(both, simulation=Simulation(order=2, **declared)), "unloading")
    limit = one_branch(view)
    assert limit is not None and limit.level == "good"
    assert "the simulation's equations alone tell" in limit.sentence and pull_of(view) == "friction-free"


def test_held_lengths_alone_say_nothing_of_friction(both: CalibrationView) -> None:
    rows = both.observed[both.observed["kind"] == "loops"].assign(branch="")
    for friction in ("none", "coulomb"):
        view = replace(both, observed=rows, simulation=Simulation(friction=friction, order=2))
        limit = one_branch(view)
        assert limit is not None and limit.level == "caution" and "held lengths" in limit.sentence
        assert pull_of(view) == "as at held length"
