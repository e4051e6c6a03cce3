"""What no reading comes near is marked, at both ends of the contraction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from model import build

from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.model.model import build_model
from mpam_calib.posterior.draws import Draws
from mpam_calib.prediction.bands import muscle_bands
from mpam_calib.prediction.curves import Reach
from mpam_calib.specimen.recording import BlockedForce, ForceMap, FreeContraction, Specimen

TOP = 2e5
FREE = {"pressure_Pa": np.array([1e5, 1.5e5, TOP]), "contraction": np.array([0.25, 0.28, 0.3])}


def muscle(start_mm: float) -> Specimen:
    """Loops at 100 to 200 kPa from a displacement to 10 mm on."""
    recorded = build.loops()
    moved = replace(recorded, displacement_m=recorded.displacement_m + 1e-3 * start_mm)
    return build.with_force(build.specimen(None, moved), np.full(len(moved.time_s), 10.0))


def marked(specimen: Specimen, pressure: float = TOP) -> pd.DataFrame:
    model = build_model(draw_blueprint(specimen))
    u = np.zeros((4, len(model.names)))
    draws = Draws(u, model.values(u), np.zeros((4, sum(model.linear_sizes))), 1)
    return muscle_bands(model, draws, np.array([pressure]), 0, trim=False).set_index("quantity")


def contractions(bands: pd.DataFrame) -> np.ndarray:
    """Contractions (50 mm is the muscle's length) whose force is not marked."""
    rows = bands.loc["force_N"]
    return rows.loc[~rows["extrapolated"] & (rows["branch"] == "mean"), "contraction"].to_numpy()


def test_loops_from_the_full_length_on_support_the_blocked_force() -> None:
    bands = marked(muscle(0.0))
    assert not bands.loc["blocked_force_N", "extrapolated"]
    assert contractions(bands).min() == 0.0 and 0.195 <= contractions(bands).max() <= 0.205


def test_loops_that_start_far_from_it_do_not() -> None:
    bands = marked(muscle(6.0))
    assert (
        bands.loc["blocked_force_N", "extrapolated"] and bands.loc["blocked_force_N_observed", "extrapolated"]
    )
    assert 0.1 <= contractions(bands).min() <= 0.125


def test_blocked_forces_beside_them_do() -> None:
    made = muscle(6.0)
    blocked = BlockedForce(np.array([TOP]), np.array([80.0]), np.array([False]))
    assert not marked(replace(made, blocked_force=blocked)).loc["blocked_force_N", "extrapolated"]
    slack = replace(blocked, force_N=np.zeros(1), censored=np.array([True]))
    assert marked(replace(made, blocked_force=slack)).loc["blocked_force_N", "extrapolated"]


def test_free_contractions_say_nothing_of_the_force_before_them() -> None:
    free = FreeContraction(**FREE)
    made = build.specimen(None, levels_kPa=(100.0, 150.0, 200.0), free_contraction=free)
    bands = marked(made)
    assert bands.loc["blocked_force_N", "extrapolated"]
    assert 0.27 <= contractions(bands).min() <= contractions(bands).max() <= 0.31


def test_a_free_contraction_further_than_the_loops_went_is_marked_until_it_was_read() -> None:
    """Without forces of its own the muscle goes on to 0.45; the loops end at 0.2, the others at 0.44."""
    made = muscle(0.0)
    found = marked(made).loc["free_contraction"]
    assert 0.4 < found["mean"] < 0.5 and found["extrapolated"]
    read = FreeContraction(**{**FREE, "contraction": np.array([0.4, 0.42, 0.46])})
    assert not marked(replace(made, free_contraction=read)).loc["free_contraction", "extrapolated"]


KNOWN = {
    "moduli": "tensile",
    "E_Pa": (6.0e5,),
    "E_rel_sd": 0.1,
    "order": 1,
    "law": "constant",
    "friction": "none",
}
ENDS = (100.0, 300.0)
"""Levels, kPa, between which a muscle of known moduli is asked for."""


@pytest.mark.parametrize(("slack_from", "told"), [(None, False), (0.9, False), (1.05, True)])
def test_a_slack_reading_beyond_the_free_contraction_tells_of_it(
    slack_from: float | None, told: bool
) -> None:
    """One before it does not, and neither tells of the force, which it but bounds."""
    free = free_at(200.0)
    contraction = np.array([0.0, 0.4, 0.8, *([] if slack_from is None else [slack_from])]) * free
    rows = len(contraction)
    made = build.specimen(
        KNOWN,
        levels_kPa=(200.0,),
        force_map=ForceMap(
            pressure_Pa=np.full(rows, 2e5),
            contraction=contraction,
            force_N=np.where(np.arange(rows) < 3, 10.0, 0.0),
            level=np.zeros(rows, dtype=np.int64),
            branch=np.zeros(rows, dtype=np.int64),
            censored=np.arange(rows) >= 3,
        ),
    )
    bands = marked(made)
    assert bands.loc["free_contraction", "extrapolated"] == (not told)
    assert bands.loc["free_contraction_observed", "extrapolated"] == (not told)
    assert 0.79 * free < contractions(bands).max() < 0.83 * free


def free_at(kPa: float) -> float:
    """The free contraction of the known muscle, whatever was recorded of it."""
    made = build.with_force(build.specimen(KNOWN, build.loops(ENDS)), np.full(48, 10.0))
    return float(marked(made, 1e3 * kPa).loc["free_contraction", "mean"])


def recorded_to(*shares: float) -> Specimen:
    """Loops at ENDS that go so far on the way to the free contraction."""
    rows = 12
    lengths = [
        share * free_at(kPa) * 50.0 * rows / (rows - 0.5) for kPa, share in zip(ENDS, shares, strict=True)
    ]
    loops = build.loops(ENDS, tuple(lengths), rows)
    return build.with_force(build.specimen(KNOWN, loops), np.full(48, 10.0))


@pytest.mark.parametrize("kPa", [130.0, 150.0, 200.0, 240.0])
@pytest.mark.parametrize("shares", [(0.98, 0.98), (0.5, 0.5), (0.5, 0.98)])
def test_between_levels_the_share_of_the_way_to_the_end_is_what_was_recorded(
    kPa: float, shares: tuple[float, float]
) -> None:
    made, free = recorded_to(*shares), free_at(kPa)
    straight = np.interp(kPa, ENDS, [share * free_at(P) for P, share in zip(ENDS, shares, strict=True)])
    furthest = max(min(shares) * free, straight)
    if shares[0] == shares[1]:
        assert furthest > 1.03 * straight  # the free contraction bends: a straight line falls short
    bands = marked(made, 1e3 * kPa)
    seen = contractions(bands)
    # Some slack of 2 % and 0.001 is allowed beyond what was recorded, and rows are 0.005 apart.
    assert furthest - 0.005 < seen.max() <= 1.02 * furthest + 0.002
    assert bool(bands.loc["free_contraction", "extrapolated"]) == (min(shares) < 0.98)


def test_without_a_free_contraction_at_both_neighbours_the_reach_is_a_straight_line() -> None:
    reach = Reach(np.array([1e5, 3e5]), np.array([0.1, 0.2]), np.zeros(2), np.array([0.1, 0.2]))
    pressure, known = np.array([1e5, 2e5, 3e5]), np.array([0.12, 0.25, 0.25])
    assert reach.along(pressure, known, np.array([0.125, 0.25])) == pytest.approx([0.1, 0.2, 0.2])
    for missing in (np.nan, 0.0):
        assert reach.along(pressure, known, np.array([missing, 0.25])) == pytest.approx([0.1, 0.15, 0.2])
    unknown = np.full(3, np.nan)
    assert reach.along(pressure, unknown, np.array([0.125, 0.25])) == pytest.approx([0.1, 0.15, 0.2])
