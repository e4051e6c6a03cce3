"""What a bin knows of its motion, on a crosshead that turns gently and dwells: against the exact one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from model import build

from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.model.readings import FAR, TIMES, Readings
from mpam_calib.posterior.likelihood.bins import bin_loops
from mpam_calib.posterior.likelihood.row_motion import row_readings
from mpam_calib.posterior.likelihood.white import Nodes
from mpam_calib.specimen.recording import Loops

STROKE, HALF = 0.012, 6.0
"""Way of a stroke (m) and the time that it takes (s)."""


def gentle(rows: int, dwell: float = 0.0, strokes: int = 6, seed: int | None = None) -> tuple[Loops, dict]:
    """x = STROKE (1 − cos(π t/HALF))/2 there and back, a dwell after each stroke; and the exact motion."""
    n = rows + round(rows * dwell / HALF)
    within = (np.arange(n) + 0.5) * HALF / rows
    moving = np.minimum(within, HALF)
    way = 0.5 * STROKE * (1.0 - np.cos(np.pi * moving / HALF))
    speed = 0.5 * STROKE * np.pi / HALF * np.sin(np.pi * moving / HALF)
    period = n * HALF / rows
    x = np.concatenate([way if i % 2 == 0 else STROKE - way for i in range(strokes)])
    if seed is not None:
        x = x + 1e-6 * np.random.default_rng(seed).standard_normal(len(x))
    number = np.repeat(np.arange(strokes), n)
    ones = np.ones(len(x))
    made = Loops(
        time_s=np.concatenate([within + i * period for i in range(strokes)]),
        pressure_Pa=1.5e5 * ones,
        displacement_m=x,
        force_N=20.0 * ones,
        level=0 * number,
        cycle=number // 2 + 1,
        branch=np.where(number % 2 == 0, -1, 1),
        stroke=number,
        clock=0 * number,
        censored=np.zeros(len(x), dtype=bool),
    )
    exact = {"travel": np.tile(way, strokes), "speed": np.tile(speed, strokes), "moving": within < HALF}
    return made, exact


@pytest.mark.parametrize("rows", [12, 40, 300])
def test_travel_begins_at_the_turn(rows):
    """Between two readings on either side of a turn a gentle crosshead hardly moves: 0.1 % of the stroke."""
    made, exact = gentle(rows)
    assert row_readings(made).travel == pytest.approx(exact["travel"], abs=1e-3 * STROKE)


def test_cycles_of_the_test_go_on_from_level_to_level():
    """Three levels of two cycles, the second level met again at the end: 1, 2 | 3, 4 | 5, 6 | 7, 8."""
    made = build.loops((100.0, 150.0, 200.0), 12.0, 12, cycles=2)
    again = made.without(made.level != 1)
    both = replace(
        made,
        **{
            name: np.concatenate([getattr(made, name), getattr(again, name)])
            for name in ("displacement_m", "force_N", "pressure_Pa", "level", "cycle", "branch", "censored")
        },
        clock=np.zeros(len(made.cycle) + len(again.cycle), dtype=np.int64),
        time_s=np.concatenate([made.time_s, again.time_s + 1e4]),
        stroke=np.concatenate([made.stroke, again.stroke - again.stroke[0] + made.stroke[-1] + 1]),
    )
    found = row_readings(both).test_cycle
    expected = both.cycle + np.concatenate([2.0 * made.level, np.full(len(again.cycle), 6.0)])
    np.testing.assert_array_equal(found, expected)
    bins = bin_loops(both)
    assert set(bins.readings.test_cycle) == set(range(1, 9))


def test_a_stroke_knows_the_lengths_of_the_two_before_it():
    """Of whatever level: 12 mm between turns, a level's last up to its last reading."""
    made = build.loops((100.0, 150.0), 12.0, 12, cycles=2)
    first, _ = made.strokes
    before = row_readings(made).strokes_before[first]
    whole, short = (pytest.approx(way, abs=1e-6) for way in (12e-3, 11.5e-3))
    lengths = [whole, whole, whole, short, whole, whole, whole]
    assert before[:, 0].tolist() == [FAR, *lengths]
    assert before[:, 1].tolist() == [FAR, FAR, *lengths[:-1]]


@pytest.mark.parametrize("levels", [(100.0, 150.0, 240.0), (240.0, 60.0, 150.0)])
def test_relaxation_is_what_a_spring_and_a_dashpot_have_lost(levels):
    """ẏ = (P(t) − y)/τ, step by step on a fine clock, from rest; a new file begins at rest anew."""
    made = build.loops(levels, 12.0, 60, dt=0.2)
    found = row_readings(made)
    steps = np.array([made.pressure_Pa[made.level == j].mean() for j in range(3)])
    begins = np.array([made.time_s[made.level == j].min() for j in range(3)])
    step = 0.01
    clock = begins[0] + step * (np.arange(round((made.time_s.max() - begins[0]) / step) + 1) + 0.5)
    pressure = steps[np.searchsorted(begins, clock, side="right") - 1]
    for k, time in enumerate(TIMES):
        lost, settled = np.zeros(len(clock) + 1), 0.0
        for i, p in enumerate(pressure):
            settled = p + (settled - p) * np.exp(-step / time)
            lost[i + 1] = settled
        at = np.interp(made.time_s, np.append(begins[0], clock + 0.5 * step), lost)
        np.testing.assert_allclose(found.relaxed[:, k], at / steps[made.level], atol=2e-3)
    files = replace(made, clock=made.level)
    own = row_readings(files)
    np.testing.assert_allclose(own.relaxed, -np.expm1(-own.time_at_level[:, None] / TIMES), atol=1e-12)
    bins = bin_loops(made)
    means = [
        found.relaxed[(made.time_s >= i) & (made.time_s <= j)].mean(axis=0)
        for i, j in zip(bins.start, bins.stop, strict=True)
    ]
    np.testing.assert_allclose(bins.middle().relaxed, means)


def test_travel_of_a_sudden_turn():
    """At full speed the turn lies half a step before the first reading (to rounding)."""
    made = build.loops((150.0,), 12.0, 12, cycles=2)
    travel = row_readings(made).travel
    assert travel[made.stroke == 2] == pytest.approx((np.arange(12) + 0.5) * 1e-3, rel=1e-9)


@pytest.mark.parametrize("phase", [0.1, 0.5, 0.8])
def test_travel_of_a_turn_between_two_speeds(phase):
    """The slow stroke's last reading is ``phase`` of its step before the turn."""
    slow, fast, n = 1e-4, 5e-4, 20
    before = slow * (np.arange(n)[::-1] + phase)
    after = fast * (np.arange(n) + 1.0 - phase)
    made = build.loops((150.0,), 12.0, n, cycles=1)
    made = replace(made, displacement_m=np.concatenate([0.012 - before, 0.012 - after]))
    assert row_readings(made).travel[n:] == pytest.approx(after, rel=1e-9)


@pytest.mark.parametrize("phase", [0.1, 0.5, 0.8])
def test_travel_where_the_rate_of_readings_changes_at_the_turn(phase):
    """The fast stroke is read three times as often as the slow one, and begins its readings anew."""
    slow, fast, n = 1e-4, 5e-4, 20
    t_in, t_out = np.arange(n)[::-1] + phase, (np.arange(n) + 0.25) / 3.0
    made = build.loops((150.0,), 12.0, n, cycles=1)
    made = replace(
        made,
        displacement_m=np.concatenate([0.012 - slow * t_in, 0.012 - fast * t_out]),
        time_s=np.concatenate([n - t_in, n + t_out]),
    )
    assert row_readings(made).travel[n:] == pytest.approx(fast * t_out, rel=1e-9)


@pytest.mark.parametrize("rows", [12, 40, 300])
def test_speed_follows_the_motion(rows):
    """To 5 % of the largest speed everywhere, the readings next to a turn included."""
    made, exact = gentle(rows)
    top = exact["speed"].max()
    at_rest = exact["speed"] < 0.06 * top
    assert row_readings(made).speed[~at_rest] == pytest.approx(exact["speed"][~at_rest], abs=0.05 * top)


@pytest.mark.parametrize("dwell", [0.0, 2.0, 30.0])
def test_a_stroke_s_pace_is_one_and_the_same_to_its_ends(dwell):
    """The median speed under way of a cosine, v sin 45°; a stroke driven twice as fast has twice of it."""
    made, exact = gentle(60, dwell=dwell, strokes=4)
    fast = made.stroke >= 2
    made = replace(made, time_s=np.where(fast, 0.5 * (made.time_s + made.time_s[fast][0]), made.time_s))
    pace = row_readings(made).pace
    middle = exact["speed"].max() * np.sqrt(0.5)
    assert pace == pytest.approx(np.where(fast, 2.0, 1.0) * middle, rel=0.03)
    assert all(np.ptp(pace[made.stroke == s]) == 0.0 for s in range(4))


@pytest.mark.parametrize("seed", [None, 3])
def test_motion_and_dwell_share_no_bin(seed):
    """Three quarters of the rows are a dwell; the motion keeps its bins, and none is mixed."""
    made, exact = gentle(20, dwell=60.0, seed=seed)
    bins = bin_loops(made, 16)
    moving = np.tile(exact["moving"], 6)
    starts = np.searchsorted(made.time_s, bins.start)
    stops = np.searchsorted(made.time_s, bins.stop) + 1
    shares = np.array([moving[i:j].mean() for i, j in zip(starts, stops, strict=True)])
    # The last reading or two under way are slower than what counts as rest.
    assert np.all((shares < 0.01) | (shares > 0.99) | (shares * bins.count <= 2.0))
    assert np.sum(shares > 0.99) >= 6 * 10
    assert bins.rest[shares < 0.01] == pytest.approx(1.0)
    assert bins.rest[shares > 0.99].max() < 0.6


@pytest.mark.parametrize("phase", [0.05, 0.1, 0.14, 0.18, 0.3, 0.5, 0.95])
def test_a_dead_stop_has_no_speed_between(phase):
    """At full speed to a dwell that begins ``phase`` of a step after a reading: the next one is at rest.

    The mean of the speeds on its two sides, half to all of the motion's, is one that the crosshead never had;
    a friction that depends on the speed would be off there by as much as it changes in the whole test.
    """
    n, held = 12, 5
    way = np.minimum((np.arange(n + held) + 1.0 - phase) / n, 1.0) * STROKE
    made = build.loops((150.0,), 12.0, n + held, cycles=2)
    away = np.tile(np.concatenate([way, STROKE - way]), 2)
    made = replace(made, displacement_m=away)
    moving = np.tile(np.arange(n + held) < n, 4)
    speed = row_readings(made).speed[moving]
    top = speed.max()
    assert speed == pytest.approx(top, rel=0.05)
    found = bin_loops(made, 16)
    assert found.readings.speed == pytest.approx(top, rel=0.05)
    assert found.rest[found.position >= n] == pytest.approx(1.0)


def stairs(every: int, creeps: float) -> tuple[Loops, np.ndarray]:
    """Strokes of 60 rows at one speed, read anew only every so many rows; the reading creeps meanwhile."""
    n = 60
    way = (np.arange(n) + 0.5) * STROKE / n
    since = np.arange(n) % every
    read = way - since * STROKE / n * (1.0 - creeps)
    made = build.loops((150.0,), 12.0, n, cycles=2)
    return replace(made, displacement_m=np.tile(np.concatenate([read, STROKE - read]), 2)), way


@pytest.mark.parametrize("creeps", [0.0, 0.05])
@pytest.mark.parametrize("every", [2, 3, 5])
def test_a_reading_that_stands_while_the_force_goes_on_is_no_crosshead_at_rest(every, creeps):
    """Such strokes keep their bins and have one speed; where the force stands as well the crosshead rests."""
    made, way = stairs(every, creeps)
    force = 50.0 - 2e3 * np.tile(np.concatenate([way, STROKE - way]), 2)
    step = STROKE / 60 / float(np.diff(made.time_s)[0])
    noise = 0.05 * np.random.default_rng(1).standard_normal(len(force))
    sticks = bin_loops(replace(made, force_N=force + noise), 12)
    middle = (sticks.position > 0) & (sticks.position < 11)
    assert np.bincount(sticks.segment).tolist() == [12] * 4
    assert not sticks.rest[middle].any()
    assert sticks.middle().speed[middle] == pytest.approx(step, rel=0.25)
    for stands in (50.0 - 2e3 * made.displacement_m + noise, np.zeros_like(noise)):
        assert bin_loops(replace(made, force_N=stands), 12).rest.mean() > 0.4


@pytest.mark.parametrize("late", [0.02, 0.3, 0.9])
def test_a_level_s_first_stroke_begins_where_the_others_turn(late):
    """Its first reading is ``late`` steps under way; only the later turns tell, to a hundredth of a step."""
    n, cycles = 40, 3
    step = STROKE / n
    path = (np.arange(2 * n * cycles) + late) * step
    away = STROKE - np.abs(np.mod(path, 2.0 * STROKE) - STROKE)
    made = build.loops((150.0,), 12.0, n, cycles=cycles)
    travel = row_readings(replace(made, displacement_m=away)).travel
    assert travel[:n] == pytest.approx(path[:n], abs=0.01 * step)


def test_a_first_stroke_from_elsewhere_is_taken_to_begin_half_a_step_before():
    n = 40
    step = STROKE / n
    away = (np.arange(n) + 0.5) * step
    other = STROKE - away
    made = build.loops((150.0,), 12.0, n, cycles=2)
    x = np.concatenate([away, other, away, other])
    x[:n] = 0.5 * (x[:n] + STROKE)
    travel = row_readings(replace(made, displacement_m=x)).travel
    assert travel[0] == pytest.approx(0.25 * step, rel=0.05)


def test_a_stroke_without_motion_keeps_its_bins():
    """Held at one length, as in an isometric test, time alone divides the rows."""
    made, _ = gentle(40, strokes=2)
    still = Loops(**{**made.__dict__, "displacement_m": np.full(len(made.time_s), 0.004)})
    assert len(bin_loops(still, 16)) == 2 * 16


@pytest.mark.parametrize("dwell", [0.0, 2.0, 30.0])
@pytest.mark.parametrize("rows", [20, 60, 400])
def test_a_dwell_does_not_slow_a_stroke_down(rows, dwell):
    """The mean speed of a cosine is its way over the time from end to end, whatever it dwells there."""
    made, _ = gentle(rows, dwell=dwell)
    blueprint = draw_blueprint(build.specimen({"law": "linear", "order": 2}, made), build.PLAIN)
    assert blueprint.setting().speed == pytest.approx(STROKE / HALF, rel=0.02)


@pytest.mark.parametrize("ramp", [0.0, 0.1, 0.25])
def test_the_mean_speed_of_a_stroke_that_begins_and_ends_in_a_ramp(ramp):
    """A share ``ramp`` of the time to gather speed and to lose it, with an encoder's noise of 0.03 %."""
    made, _ = gentle(200, dwell=2.0, seed=5)
    s = np.minimum((made.time_s - made.time_s[made.stroke == 1][0] * made.stroke) / HALF, 1.0)
    way = np.where(s < ramp, s**2 / (2.0 * ramp or 1.0), s - 0.5 * ramp)
    way = np.where(s > 1.0 - ramp, 1.0 - ramp - (1.0 - s) ** 2 / (2.0 * ramp or 1.0), way) / (1.0 - ramp)
    x = STROKE * np.where(made.stroke % 2 == 0, way, 1.0 - way)
    noisy = x + 3e-4 * STROKE * np.random.default_rng(2).standard_normal(len(x))
    made = replace(made, displacement_m=noisy)
    blueprint = draw_blueprint(build.specimen({"law": "linear", "order": 2}, made), build.PLAIN)
    assert blueprint.setting().speed == pytest.approx(STROKE / HALF, rel=0.02)


def test_a_stroke_knows_what_was_stretched_before():
    """The first is as new at both points of every bin; the second lies behind it by what it came back."""
    made, _ = gentle(300, strokes=3)
    bins = bin_loops(made, 16)
    low, high = (bins.readings.take(half) for half in (slice(0, len(bins)), slice(len(bins), None)))
    first, others = bins.segment == 0, bins.segment > 0
    for point in (low, high):
        np.testing.assert_array_equal(point.behind[first], 0.0)
        longest = float(made.displacement_m.max())
        assert point.behind[others] == pytest.approx(longest - point.displacement[others], abs=1e-3 * STROKE)


def test_nodes_of_a_bin_have_the_motion_of_its_rows():
    """All that changes along a stroke: on average over the bin, and not alike at its nodes."""
    made = build.loops((100.0, 150.0), 12.0, 40, cycles=2)
    rows = row_readings(made)
    start = np.arange(0, len(rows), 20)
    nodes = Nodes.build(made.force_N, rows, start)
    weight = nodes.weight.reshape(3, -1)
    changing = {
        name
        for name in vars(rows)
        if np.ptp(value := np.asarray(getattr(rows, name))[:20], axis=0).max() > 1e-9 * np.abs(value).max()
    }
    assert {"displacement", "time", "travel", "time_at_level"} <= changing
    back = np.asarray(rows.behind)[40:60]
    assert np.ptp(back) > 0.0
    for name in changing | {"behind"}:
        at_nodes = np.asarray(getattr(nodes.readings, name))
        at_nodes = at_nodes.reshape(3, len(start), -1)
        own = np.asarray(getattr(rows, name)).reshape(len(start), 20, -1).mean(axis=1)
        mean = np.sum(weight[..., None] * at_nodes, axis=0) / weight.sum(axis=0)[:, None]
        assert mean == pytest.approx(own, abs=1e-9 * np.abs(own).max()), name


def test_the_middle_of_two_places_is_their_mean():
    rows = Readings.at_rest(np.full(4, 1e5), np.array([1e-3, 2e-3, 3e-3, 6e-3]))
    rows = replace(rows, travel=np.array([1.0, 2.0, 5.0, 8.0]), behind=np.array([4.0, 0.0, 2.0, 6.0]))
    middle = rows.middles()
    assert middle.displacement == pytest.approx([2e-3, 4e-3])
    assert middle.travel == pytest.approx([3.0, 5.0])
    assert middle.behind == pytest.approx([3.0, 3.0])


def test_nodes_have_the_moments_of_their_rows_up_to_the_fifth():
    """However lopsided a bin's rows lie: Gauss's rule for three of them."""
    x = np.random.default_rng(0).gamma(1.5, 1.0, 400)
    nodes = Nodes.build(x, Readings.at_rest(np.full(400, 1e5), 1e-3 * x), np.array([0, 150]))
    at, weight = (v.reshape(3, 2) for v in (1e3 * nodes.readings.displacement, nodes.weight))
    for bin_, rows in enumerate((x[:150], x[150:])):
        for power in range(6):
            expected = np.sum(rows**power)
            assert weight[:, bin_] @ at[:, bin_] ** power == pytest.approx(expected, rel=1e-9)
