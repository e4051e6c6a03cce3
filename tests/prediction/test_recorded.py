"""A branch on which nothing was read is marked; that without friction goes by the readings' reach."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from model import build

from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.model.model import build_model
from mpam_calib.posterior.draws import Draws
from mpam_calib.prediction.bands import muscle_bands
from mpam_calib.prediction.recorded import RECORDED, Recorded
from mpam_calib.specimen.recording import (
    DEPRESSURISING,
    LOADING,
    NO_BRANCH,
    PRESSURISING,
    BlockedForce,
    ForceMap,
    Specimen,
)

BOTH = {"loading", "unloading"}
NO_FRICTION = {"order": 2, "law": "linear", "friction": "none"}


def muscle(simulation: dict[str, object], branch: np.ndarray | None = None) -> Specimen:
    """Loops that pull with 10 N, on these branches (one for each row)."""
    recorded = build.loops()
    if branch is not None:
        recorded = replace(recorded, branch=branch)
    return build.with_force(build.specimen(simulation, recorded), np.full(len(recorded.time_s), 10.0))


def one_way(simulation: dict[str, object], code: int) -> Specimen:
    """The loops of one branch."""
    made = muscle(simulation)
    assert made.loops is not None
    return replace(made, loops=made.loops.without(made.loops.branch != code))


def static_map(simulation: dict[str, object]) -> Specimen:
    """A force map without branches."""
    level, contraction = (x.ravel() for x in np.meshgrid(np.arange(3), [0.0, 0.1, 0.2], indexing="ij"))
    pressure = 1e5 + 5e4 * level
    zero = np.zeros(len(level), dtype=np.int64)
    grid = ForceMap(pressure, contraction, np.full(len(level), 10.0), level, zero, zero.astype(bool))
    return build.specimen(simulation, levels_kPa=(100.0, 150.0, 200.0), force_map=grid)


def bands_of(made: Specimen, pressures: np.ndarray, recorded: Recorded) -> pd.DataFrame:
    """Whole curves at pressures (Pa), by what a run keeps of the recording."""
    model = build_model(draw_blueprint(made))
    u = np.zeros((4, len(model.names)))
    draws = Draws(u, model.values(u), np.zeros((4, sum(model.linear_sizes))), 1)
    kept = Recorded.kept(json.loads(json.dumps({RECORDED: recorded.as_json()})))
    assert kept == recorded
    return muscle_bands(model, draws, pressures, 0, trim=False, recorded=kept)


def untold(made: Specimen) -> set[str]:
    """Branches of which every row is marked, observed or not."""
    bands = bands_of(made, np.array([1e5, 1.5e5]), Recorded.of(made))
    marked = []
    for quantity in ("force_N", "force_N_observed"):
        rows = bands[bands["quantity"] == quantity].groupby("branch")["extrapolated"]
        marked.append({str(branch) for branch in rows.all()[lambda found: found].index})
        reach = _reached(bands, quantity)
        assert reach["mean"] and all(reach[branch] for branch in BOTH - marked[-1])
    assert marked[0] == marked[1]
    return marked[0]


def _reached(bands: pd.DataFrame, quantity: str) -> dict[str, bool]:
    """Whether, by branch, the rows up to the recorded contraction of 0.19 are unmarked."""
    rows = bands[(bands["quantity"] == quantity) & bands["contraction"].between(0.01, 0.19)]
    return {str(branch): not any(found) for branch, found in rows.groupby("branch")["extrapolated"]}


@pytest.mark.parametrize("friction", ["none", "coulomb"])
def test_a_branch_that_was_never_recorded_is_extrapolated(friction: str) -> None:
    simulation = NO_FRICTION | {"friction": friction}
    assert untold(muscle(simulation)) == set()
    assert untold(one_way(simulation, -LOADING)) == {"loading"}
    assert untold(one_way(simulation, LOADING)) == {"unloading"}


def test_held_lengths_tell_neither() -> None:
    held = np.where(build.loops().branch > 0, PRESSURISING, DEPRESSURISING)
    assert untold(muscle(NO_FRICTION, held)) == BOTH


def test_readings_of_no_branch_stand_for_both_where_nothing_rubs() -> None:
    assert Recorded.of(static_map(NO_FRICTION)).branches == {""} and NO_BRANCH == 0
    assert untold(static_map(NO_FRICTION)) == set()
    assert untold(static_map(NO_FRICTION | {"friction": "coulomb"})) == BOTH
    assert untold(static_map(NO_FRICTION | {"effects": ("coulomb_friction",)})) == BOTH


def blocked(*kPa: float, slack: int = 0) -> Specimen:
    """Loops at 100 to 200 kPa with blocked forces beside them, the first of them slack."""
    P = 1e3 * np.array(kPa)
    return replace(muscle(NO_FRICTION), blocked_force=BlockedForce(P, 3e-4 * P, np.arange(len(P)) < slack))


def marked_blocked(made: Specimen, *kPa: float) -> list[bool]:
    """Whether blocked forces at these pressures are extrapolated."""
    bands = bands_of(made, 1e3 * np.array(kPa), Recorded.of(made))
    found = [bands.loc[bands["quantity"] == f"blocked_force_N{s}", "extrapolated"] for s in ("", "_observed")]
    assert found[0].tolist() == found[1].tolist()
    force = bands[(bands["quantity"] == "force_N") & ~bands["pressure_kPa"].between(100.0, 200.0)]
    assert force["extrapolated"].all()
    return found[0].tolist()


def test_blocked_forces_off_the_levels_are_no_extrapolation_among_their_own_pressures() -> None:
    asked = (5.0, 10.0, 60.0, 150.0, 250.0, 390.0, 400.0)
    alone = muscle(NO_FRICTION)
    assert marked_blocked(alone, *asked) == [True, True, True, False, True, True, True]
    read = blocked(10.0, 120.0, 390.0)
    assert marked_blocked(read, *asked) == [True, False, False, False, False, False, True]
    # One that the load cell's floor hides is no reading.
    assert marked_blocked(blocked(10.0, 120.0, 390.0, slack=1), 60.0, 250.0) == [True, False]
    assert Recorded.of(blocked(10.0, slack=1)).blocked_kPa is None


def test_a_run_of_an_older_version_keeps_nothing_of_it() -> None:
    assert Recorded.kept({}) is None
