"""Tests of structure, fine structure that repeats, saturated cells: silent on noise, loud otherwise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.data.saturation import along_a_ceiling
from mpam_calib.criticism.fitting.fit import Fit, fit
from mpam_calib.criticism.searching.candidates import candidates
from mpam_calib.criticism.unexplained import structure
from mpam_calib.criticism.unexplained.bursts import bursts_rms
from mpam_calib.criticism.unexplained.converter import coarse_step
from mpam_calib.criticism.unexplained.repeat import raw_residual, repeating_rms
from mpam_calib.criticism.unexplained.structure import structure_tests
from mpam_calib.model.readings import Readings
from mpam_calib.specimen import Specimen
from mpam_calib.specimen.extremes import saturated
from mpam_calib.specimen.recording import BlockedForce

from .cases import problem_of, specimen_of

Array = NDArray[np.float64]
NULLS = ("develop-null-000", "develop-null-001", "develop-null-003", "develop-null-007")


@pytest.fixture(scope="module")
def specimen() -> Specimen:
    return specimen_of("develop-null-001")


@pytest.fixture(scope="module")
def null(specimen: Specimen) -> tuple[Problem, Fit]:
    problem = problem_of(specimen)
    return problem, fit(problem, frozenset(), 0)


def left(problem: Problem, fitted: Fit) -> Array:
    """What a fit leaves of the raw readings, N."""
    assert problem.rows is not None
    return raw_residual(problem.rows, problem.blueprint.model_dump_json(), fitted)


def test_p_values_are_spread_evenly_over_noise() -> None:
    """Pure noise of the problem's own covariance on top of a fit: Kolmogorov-Smirnov over all tests."""
    problem = problem_of(specimen_of("develop-null-001"))
    base = fit(problem, frozenset(), 0)
    root = np.linalg.cholesky(problem.noise)
    rng = np.random.default_rng(1)
    p_values: dict[str, list[float]] = {}
    for _ in range(60):
        noisy = replace(problem, force=base.force + root @ rng.standard_normal(len(problem)))
        for test in structure_tests(noisy, fit(noisy, frozenset(), 0)):
            p_values.setdefault(test.against, []).append(test.p_value)
    assert p_values.keys() == structure.AGAINST.keys() - {"speed"}  # there is one
    for against, values in p_values.items():
        assert stats.kstest(values, "uniform").pvalue > 1e-3, against


@pytest.mark.parametrize(
    ("against", "shape"),
    [
        ("contraction", lambda r: np.cos(3.0 * np.pi * r.displacement / r.displacement.max())),
        ("branch", lambda r: r.sign),
        ("time", lambda r: r.time / r.time.max()),
        ("cycle", lambda r: 1.0 / r.cycle),
    ],
)
def test_structure_fires_on_what_was_added(
    null: tuple[Problem, Fit], against: str, shape: Callable[[object], Array]
) -> None:
    problem, fitted = null
    added = problem.noise_level.total * shape(problem.middle())
    found = {t.against: t for t in structure_tests(replace(problem, force=problem.force + added), fitted)}
    assert found[against].p_value < 1e-6
    quiet = {t.against: t for t in structure_tests(problem, fitted)}
    assert quiet[against].p_value > 1e-4


@pytest.mark.parametrize(
    ("against", "shape"),
    [
        ("contraction", lambda r: np.cos(3.0 * np.pi * r.displacement / r.displacement.max())),
        ("time", lambda r: r.time / r.time.max()),
        ("cycle", lambda r: 1.0 / r.cycle),
    ],
)
def test_the_size_of_structure_is_that_of_what_was_added(
    null: tuple[Problem, Fit], against: str, shape: Callable[[object], Array]
) -> None:
    """About its mean, which is none; the fit's own parameters could take up little of it."""
    problem, fitted = null
    added = 20.0 * problem.noise_level.total * shape(problem.middle())
    found = structure_tests(replace(problem, force=problem.force + added), fitted)
    size = next(t.size for t in found if t.against == against)
    assert size == pytest.approx(np.std(added), rel=0.25)


def test_speed_is_tested_where_speeds_differ(null: tuple[Problem, Fit]) -> None:
    """Of one speed, what differs between the branches is no function of it."""
    problem, fitted = null
    readings = replace(problem.readings, speed=np.full(len(problem.readings), 1e-3))
    even = replace(problem, readings=readings)
    assert "speed" not in {t.against for t in structure_tests(even, fitted)}
    fast = np.where(problem.cycle % 2 == 0, 4e-3, 1e-3)
    uneven = replace(problem, readings=replace(readings, speed=np.concatenate([fast, fast])))
    middle = uneven.middle()
    added = {"branch": middle.sign, "speed": middle.sign * np.log(middle.speed / 2e-3)}
    for against, shape in added.items():
        there = replace(uneven, force=problem.force + problem.noise_level.total * shape)
        found = structure_tests(there, fitted)
        assert min(found, key=lambda t: t.p_value).against == against


@pytest.mark.parametrize("name", NULLS)
def test_noise_does_not_repeat(name: str) -> None:
    problem = problem_of(specimen_of(name))
    assert problem.rows is not None
    fitted = fit(problem, frozenset(), 0)
    assert repeating_rms(problem.rows, left(problem, fitted)) == 0.0


def test_a_stroke_that_does_not_move_is_left_out(null: tuple[Problem, Fit]) -> None:
    problem, fitted = null
    assert problem.rows is not None
    x = problem.rows.readings.displacement.copy()
    stroke = np.unique(problem.rows.stroke)[2]
    x[problem.rows.stroke == stroke] = 0.001
    rows = replace(problem.rows, readings=replace(problem.rows.readings, displacement=x))
    assert np.isfinite(repeating_rms(rows, left(replace(problem, rows=rows), fitted)))


def test_a_ripple_of_the_drive_repeats(null: tuple[Problem, Fit]) -> None:
    """A ripple with the size of the noise, finer than the reduced rows, comes out with its size."""
    problem, fitted = null
    assert problem.rows is not None
    x = problem.rows.readings.displacement
    size = problem.noise_level.total
    ripple = np.sqrt(2.0) * size * np.sin(2.0 * np.pi * 14.0 * x / x.max())
    found = repeating_rms(problem.rows, left(problem, fitted) + ripple)
    assert found == pytest.approx(size, rel=0.35)


def test_friction_that_fades_at_rests_half_way_does_not_repeat(null: tuple[Problem, Fit]) -> None:
    """The same while the crosshead moves is a notch that every stroke has."""
    problem, fitted = null
    assert problem.rows is not None
    place = problem.rows.readings.displacement / problem.rows.readings.displacement.max()
    held = np.abs(place - 0.4) < 0.03
    faded = np.where(held, -5.0 * problem.noise_level.total * problem.rows.readings.sign, 0.0)
    residual = left(problem, fitted) + faded
    assert repeating_rms(replace(problem.rows, rest=held), residual) == 0.0
    assert repeating_rms(problem.rows, residual) > 0.0


@pytest.mark.parametrize("one_in", [2, 3])
def test_a_ripple_is_told_by_short_strokes_together(one_in: int) -> None:
    """Of thirty or twenty readings each, at places of their own: none could tell it alone."""
    specimen = specimen_of("develop-null-003")
    loops = specimen.loops
    assert loops is not None
    first, length = loops.strokes
    begins = np.random.default_rng(1).integers(0, one_in, len(first))
    kept = (np.arange(len(loops.force_N)) - np.repeat(first + begins, length)) % one_in == 0
    problem = problem_of(replace(specimen, loops=loops.without(~kept)))
    assert problem.rows is not None
    residual = left(problem, fit(problem, frozenset(), 0))
    assert repeating_rms(problem.rows, residual) == 0.0
    x = problem.rows.readings.displacement
    size = 3.0 * problem.noise_level.total
    ripple = np.sqrt(2.0) * size * np.sin(2.0 * np.pi * 7.0 * x / x.max())
    assert repeating_rms(problem.rows, residual + ripple) == pytest.approx(size, rel=0.35)


def test_a_saturated_cell_is_seen_and_left_out(specimen: Specimen) -> None:
    loops = specimen.loops
    assert loops is not None
    assert not saturated(loops).any()
    limit = float(np.quantile(loops.force_N, 0.97))
    clipped = replace(loops, force_N=np.minimum(loops.force_N, limit))
    found = saturated(clipped)
    assert found.mean() == pytest.approx(0.03, abs=0.005)
    assert np.all(clipped.force_N[found] == limit)
    assert clipped.without(found).force_N.max() < limit
    # A coarse converter repeats every value: that is no saturation.
    step = 0.1 * float(np.ptp(loops.force_N)) / 2.0
    assert not saturated(replace(loops, force_N=step * np.round(loops.force_N / step))).any()


@pytest.mark.parametrize("name", [*NULLS, "develop-separable-001", "develop-separable-003"])
@pytest.mark.parametrize("share", [0.0, 0.1])
def test_a_ceiling_is_seen_through_noise(name: str, share: float) -> None:
    """A cell that saturates before its noise is added; without a ceiling nothing is one."""
    loops = specimen_of(name).loops
    assert loops is not None
    noise = problem_of(specimen_of(name)).noise_level.total
    limit = float(np.quantile(loops.force_N, 1.0 - share))
    above = loops.force_N >= limit if share else np.zeros(len(loops.force_N), dtype=bool)
    after = noise * np.random.default_rng(3).standard_normal(len(above))
    clipped = replace(loops, force_N=np.where(above, limit + after, loops.force_N))
    found = along_a_ceiling(clipped, noise)
    assert not saturated(clipped).any()
    assert found.mean() == pytest.approx(share, abs=0.3 * share)
    # Three of the noise's sds below a ceiling whose place is known to half of one.
    assert not np.any(found & ~above & (loops.force_N < limit - 3.5 * noise))
    # One reading at the end of a stroke is as wrong as twenty.
    assert np.sum(above & ~found) <= 0.02 * np.sum(above)


def with_rests(name: str, rows: int) -> Specimen:
    """The specimen with so many readings more at the end of every stroke, the crosshead at rest."""
    specimen = specimen_of(name)
    loops = specimen.loops
    assert loops is not None
    first, length = loops.strokes
    count = np.ones(len(loops.force_N), dtype=int)
    count[first + length - 1] += rows
    here = np.repeat(np.arange(len(count)), count)
    added = np.arange(len(here)) - np.searchsorted(here, here)
    step = float(np.median(np.diff(loops.time_s)))
    arrays = {
        f.name: value[here] for f in fields(loops) if isinstance(value := getattr(loops, f.name), np.ndarray)
    }
    arrays["time_s"] = arrays["time_s"] + step * np.cumsum(added > 0)
    noise = problem_of(specimen).noise_level.total * np.random.default_rng(5).standard_normal(len(here))
    arrays["force_N"] = np.where(added > 0, arrays["force_N"] + noise, arrays["force_N"])
    return replace(specimen, loops=replace(loops, **arrays))


@pytest.mark.parametrize("name", [*NULLS, "develop-null-004", "develop-null-010"])
def test_a_muscle_that_is_held_is_no_ceiling(name: str) -> None:
    """Readings at the longest, where the force is largest, crowd about it; a ceiling is seen all the same."""
    specimen = with_rests(name, 8)
    loops = specimen.loops
    assert loops is not None
    noise = problem_of(specimen_of(name)).noise_level.total
    assert not along_a_ceiling(loops, noise).any()
    limit = float(np.quantile(loops.force_N, 0.9))
    above = loops.force_N >= limit
    after = noise * np.random.default_rng(3).standard_normal(len(above))
    found = along_a_ceiling(replace(loops, force_N=np.where(above, limit + after, loops.force_N)), noise)
    assert found.mean() == pytest.approx(0.1, abs=0.04)


@pytest.mark.parametrize("name", NULLS)
def test_friction_that_fades_at_rest_is_no_burst(name: str) -> None:
    """However much of it, at every stop; bursts under way are seen as before."""
    problem = problem_of(with_rests(name, 8))
    assert problem.rows is not None
    sd = np.ones(len(problem.rows.force))
    quiet, loud = in_bursts(problem, 15.0 * problem.noise_level.total, 1)
    faded = np.where(problem.rows.rest, -10.0 * problem.noise_level.total * problem.rows.readings.sign, 0.0)
    assert bursts_rms(problem.rows, quiet + faded, sd) == 0.0
    assert bursts_rms(problem.rows, loud + faded, sd) > 0.0


def test_readings_along_a_ceiling_are_left_out(specimen: Specimen) -> None:
    loops = specimen.loops
    assert loops is not None
    noise = problem_of(specimen).noise_level.total
    limit = float(np.quantile(loops.force_N, 0.9))
    after = noise * np.random.default_rng(4).standard_normal(len(loops.force_N))
    force = np.where(loops.force_N >= limit, limit + after, loops.force_N)
    problem = problem_of(replace(specimen, loops=replace(loops, force_N=force)))
    assert problem.saturated == pytest.approx(0.1, abs=0.03)
    assert problem.force.max() < limit + noise


def thinned(name: str, one_in: int) -> Specimen:
    """The specimen with so many fewer readings."""
    specimen = specimen_of(name)
    assert specimen.loops is not None
    left_out = np.arange(len(specimen.loops.force_N)) % one_in > 0
    return replace(specimen, loops=specimen.loops.without(left_out))


def in_bursts(problem: Problem, size: float, seed: int) -> tuple[Array, Array]:
    """What a fit leaves, and with bursts of three to seven readings, of about the ``size`` (N)."""
    assert problem.rows is not None
    residual = left(problem, fit(problem, frozenset(), 0))
    rng = np.random.default_rng(seed)
    added = np.zeros(len(residual))
    for start in rng.integers(0, len(added) - 8, size=max(6, len(added) // 200)):
        added[start : start + int(rng.integers(3, 8))] += rng.choice([-1, 1]) * rng.uniform(0.5, 1.5) * size
    return residual, residual + added


@pytest.mark.parametrize("name", [*NULLS, "develop-null-004", "develop-null-010"])
@pytest.mark.parametrize("one_in", [1, 3])
def test_bursts_stand_out_of_short_and_long_strokes(name: str, one_in: int) -> None:
    """Noise alone has none, near the floor neither; of large ones a third and more is seen."""
    problem = problem_of(thinned(name, one_in))
    assert problem.rows is not None
    sd = np.ones(len(problem.rows.force))
    for size, least in ((6.0, 0.0), (15.0, 0.3)):
        quiet, loud = in_bursts(problem, size * problem.noise_level.total, 1)
        assert bursts_rms(problem.rows, quiet, sd) == 0.0
        added = float(np.sqrt(np.mean((loud - quiet) ** 2)))
        assert least * added < bursts_rms(problem.rows, loud, sd) < 1.2 * added


def test_bursts_are_in_newtons_whatever_the_noise_is_measured_in(null: tuple[Problem, Fit]) -> None:
    problem, _ = null
    assert problem.rows is not None
    quiet, loud = in_bursts(problem, 15.0 * problem.noise_level.total, 1)
    even = np.ones(len(quiet))
    found = [bursts_rms(problem.rows, loud, scale * even) for scale in (1.0, 0.1, 5.0)]
    assert found == pytest.approx([found[0]] * 3)
    assert 0.3 < found[0] / np.sqrt(np.mean((loud - quiet) ** 2)) < 1.2


@pytest.mark.parametrize("name", NULLS)
@pytest.mark.parametrize("freedom", [5, 8])
def test_long_tails_are_no_bursts_and_hide_none(name: str, freedom: int) -> None:
    """Student's t, 20 draws each: two at most have neighbours far out; bursts among it are seen."""
    problem = problem_of(specimen_of(name))
    assert problem.rows is not None
    n, total = len(problem.rows.force), problem.noise_level.total
    sd = np.ones(n)
    added = np.subtract(*in_bursts(problem, 15.0 * total, 1)[::-1])
    draws = [total * np.random.default_rng(seed).standard_t(freedom, n) for seed in range(20)]
    assert sum(bursts_rms(problem.rows, noise, sd) > 0.0 for noise in draws) <= 2
    assert all(bursts_rms(problem.rows, noise + added, sd) > 0.0 for noise in draws)


@pytest.mark.parametrize("name", NULLS)
def test_lone_spikes_are_bursts(name: str) -> None:
    """One reading in a hundred, nothing beside it: the noise's own tails would not end so suddenly."""
    problem = problem_of(specimen_of(name))
    assert problem.rows is not None
    residual = left(problem, fit(problem, frozenset(), 0))
    rng = np.random.default_rng(3)
    spikes = (rng.random(len(residual)) < 0.01) * rng.choice([-1.0, 1.0], len(residual))
    spiked = residual + rng.uniform(10.0, 20.0, len(residual)) * problem.noise_level.total * spikes
    assert bursts_rms(problem.rows, spiked, np.ones(len(residual))) > 0.0


def test_what_comes_back_in_the_next_cycle_is_no_burst(null: tuple[Problem, Fit]) -> None:
    """However sharp: fine structure that repeats is told by another test."""
    problem, fitted = null
    assert problem.rows is not None
    x = problem.rows.readings.displacement
    notch = -10.0 * problem.noise_level.total * np.exp(-0.5 * ((x / x.max() - 0.4) / 0.01) ** 2)
    residual = left(problem, fitted) + notch
    assert bursts_rms(problem.rows, residual, np.ones(len(x))) == 0.0
    assert repeating_rms(problem.rows, residual) > 0.0


@pytest.mark.parametrize("name", NULLS)
@pytest.mark.parametrize(("steps", "seen"), [(0.5, False), (1.5, False), (8.0, True), (20.0, True)])
def test_a_converter_coarser_than_the_noise_is_seen(name: str, steps: float, seen: bool) -> None:
    """Steps in the noise's sd: what noise smears out is a usual export, what it does not is not."""
    loops = specimen_of(name).loops
    assert loops is not None
    noise = problem_of(specimen_of(name)).noise_level.total
    step = steps * noise
    force = np.round(step * np.round(loops.force_N / step), 4)
    with_steps = float(np.hypot(noise, step / np.sqrt(12.0)))
    assert coarse_step(force, with_steps) == pytest.approx(step if seen else 0.0, rel=0.01)
    assert coarse_step(loops.force_N, noise) == 0.0


def test_static_readings_are_no_cycle_of_the_loops(specimen: Specimen) -> None:
    """One cycle and blocked forces are one cycle: nothing can soften from one to the next."""
    assert specimen.loops is not None
    levels = specimen.levels_Pa
    blocked = BlockedForce(levels, np.linspace(10.0, 40.0, len(levels)), np.zeros(len(levels), dtype=bool))
    one = specimen.loops.without(specimen.loops.cycle > 1)
    problem = problem_of(replace(specimen, loops=one, blocked_force=blocked))
    assert len(np.unique(problem.cycle)) == 2
    assert problem.cycles.tolist() == [1]
    assert dict(candidates(problem).not_tested)["stress_softening"] == "one cycle"


def test_blocked_forces_belong_to_their_levels(specimen: Specimen, monkeypatch: pytest.MonkeyPatch) -> None:
    """They were held against the pressure as a level by themselves."""
    levels = specimen.levels_Pa
    blocked = BlockedForce(levels, np.linspace(10.0, 40.0, len(levels)), np.zeros(len(levels), dtype=bool))
    problem = problem_of(replace(specimen, blocked_force=blocked))
    grouped: list[Array] = []

    def watch(readings: Readings) -> Array:
        grouped.append(readings.level)
        return np.empty((len(readings), 0))

    monkeypatch.setitem(structure.AGAINST, "pressure", watch)
    structure_tests(problem, fit(problem, frozenset(), 0))
    assert len(grouped[0]) == len(problem_of(specimen)) + len(levels)
    assert set(grouped[0]) == set(range(len(levels)))
