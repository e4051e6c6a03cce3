"""All that a model is built from, and nothing of the data it will be fitted to but their design and scale.

A blueprint is drawn once from a whole specimen. Folds, resumed runs and predictions build their models
from it, so that all of them share one prior.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from mpam_calib.model.pull import pulls_at
from mpam_calib.model.reference import force_scale, geometric_contraction
from mpam_calib.model.state import Setting
from mpam_calib.model.tensile import STRESS_SCALE, stiffness_scale
from mpam_calib.specimen.declaration import Braid, Geometry, Noise, Sensors, Simulation
from mpam_calib.specimen.levels import same_level
from mpam_calib.specimen.motion import run_ids
from mpam_calib.specimen.recording import Loops, Specimen
from mpam_calib.units import MINUTE, MM

Array = NDArray[np.float64]

STILL_SHARE = 0.01
"""A stroke shorter than this share of the longest is a hold."""
DWELL_SHARE = 0.005
"""Where so much of its way is left, a crosshead that dwells at the ends is still under way."""
ENOUGH = 8
"""Rows that tell how a crosshead gathers its speed."""
RAMPS = (0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5)
"""Shares of a stroke's time in which it may do so."""


class Value(BaseModel):
    """A frozen value that goes to JSON and back unchanged."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class Options(Value):
    """What may be left out of a model (for comparison, or to meet an exact reference)."""

    correlated_noise: bool = True
    remainder: bool = True
    nuisances: bool = True


class MaterialPosterior(Value):
    """Moduli as another run left them: mean (order,), covariance (order, order), Pa.

    ``strain_range`` is that of the tensile test behind them, None where a muscle's loops gave them.
    """

    mean: tuple[float, ...]
    covariance: tuple[tuple[float, ...], ...]
    strain_range: tuple[float, float] | None
    convention: str


class Blueprint(Value):
    """Declaration and design of one specimen, SI units.

    ``stroke`` (m) is the largest recorded displacement, ``reach`` the largest contraction at each level,
    ``onset`` the least with a force there (empty: nothing recorded), ``slack`` the largest at which a map's
    muscle was slack (0 without any), ``pulls_at`` (Pa) the lowest pressure with a clear pull,
    ``stroke_time`` (s) the median duration of a stroke (None without loops), ``reading_time`` (s) that
    between two readings, ``duration`` (s) that of the whole test, ``level_time`` (s) the longest at one
    level and ``speed`` (m/s) the geometric mean of the strokes' speeds.
    ``tensile_stiffness`` (Pa at a strain of one) is the scale of what a tensile test is fitted with;
    ``curves`` tells whether forces were recorded along the stroke, not at its ends alone.
    """

    simulation: Simulation
    geometry: Geometry | None
    braid: Braid | None
    sensors: Sensors
    noise: Noise = Noise()
    levels: tuple[float, ...]
    stroke: float
    reach: tuple[float, ...]
    pulls_at: float
    stroke_time: float | None
    reading_time: float
    duration: float = 0.0
    level_time: float = 0.0
    speed: float = 50.0 * MM / MINUTE
    branches: bool
    onset: tuple[float, ...] = ()
    slack: tuple[float, ...] = ()
    free_contraction: bool
    curves: bool = True
    tensile_range: tuple[float, float] | None
    tensile_tested: tuple[float, float] | None = None
    tensile_stiffness: float = STRESS_SCALE
    material: MaterialPosterior | None = None
    options: Options = Options()

    def setting(self) -> Setting | None:
        """The muscle's setting; None where only a material was tested."""
        if self.geometry is None or not self.levels:
            return None
        levels = np.array(self.levels)
        return Setting(
            simulation=self.simulation,
            geometry=self.geometry,
            braid=self.braid,
            levels=levels,
            stroke=self.stroke,
            force_scale=force_scale(self.geometry, levels),
            force_sd=self.sensors.force_sd_N,
            pressure_bias_sd=self.sensors.pressure_bias_sd,
            nuisances=self.options.nuisances,
            pulls_at=self.pulls_at,
            duration=self.duration,
            level_time=self.level_time,
            speed=self.speed,
            strokes=np.array(self.reach) * self.geometry.L0,
        )


def draw_blueprint(
    specimen: Specimen, options: Options | None = None, material: MaterialPosterior | None = None
) -> Blueprint:
    """The blueprint of a specimen; ``material`` is what ``moduli = "run:..."`` names, already read."""
    if material is None and specimen.simulation.moduli.startswith("run:"):
        raise ValueError(f"the material of moduli = {specimen.simulation.moduli!r} was not handed over")
    loops = specimen.loops
    reach = _reach(specimen)
    stroke = float(reach.max(initial=0.0)) * (specimen.geometry.L0 if specimen.geometry else 0.0)
    if specimen.geometry is not None and stroke <= 0.0:
        stroke = geometric_contraction(specimen.geometry) * specimen.geometry.L0
    parts = (loops, specimen.force_map)
    return Blueprint(
        simulation=specimen.simulation,
        geometry=specimen.geometry,
        braid=specimen.braid,
        sensors=specimen.sensors,
        noise=specimen.noise,
        levels=tuple(float(level) for level in specimen.levels_Pa),
        stroke=stroke,
        reach=tuple(float(r) for r in reach),
        slack=_slack(specimen),
        onset=_onset(specimen),
        pulls_at=pulls_at(specimen),
        stroke_time=None if loops is None else _stroke_time(loops),
        reading_time=0.0 if loops is None else _reading_time(loops),
        duration=0.0 if loops is None else float(loops.time_s.max()),
        level_time=0.0 if loops is None else _level_time(loops),
        speed=50.0 * MM / MINUTE if loops is None else _speed(loops),
        branches=any(p is not None and bool(np.any(np.abs(p.branch) == 1)) for p in parts),
        free_contraction=specimen.free_contraction is not None,
        curves=any(p is not None for p in parts),
        tensile_range=_tensile_range(specimen),
        tensile_tested=None if specimen.tensile is None else specimen.tensile.strain_range,
        tensile_stiffness=_tensile_stiffness(specimen),
        material=material,
        options=options or Options(),
    )


def _reach(specimen: Specimen) -> Array:
    """Largest recorded contraction at each level (levels,); between two levels' that of one without any."""
    levels = specimen.levels_Pa
    reach = np.full(len(levels), -np.inf)
    if specimen.geometry is None:
        return np.zeros(len(levels))
    if (loops := specimen.loops) is not None:
        np.maximum.at(reach, loops.level, loops.displacement_m / specimen.geometry.L0)
    if (grid := specimen.force_map) is not None:
        # A slack reading reaches nowhere: its level is known not to pull.
        np.maximum.at(reach, grid.level, np.where(grid.censored, 0.0, grid.contraction))
    if (free := specimen.free_contraction) is not None and len(levels):
        nearest = np.abs(free.pressure_Pa[:, None] - levels).argmin(axis=1)
        # Levels that loops or maps gave know nothing of what was seen far from them.
        own = loops is None and grid is None
        here = own | same_level(free.pressure_Pa, levels[nearest])
        np.maximum.at(reach, nearest[here], free.contraction[here])
    known = np.isfinite(reach)
    reach[:] = np.maximum(reach, 0.0)
    if known.any():
        reach[~known] = np.interp(levels[~known], levels[known], reach[known], left=0.0, right=0.0)
    return reach


def _slack(specimen: Specimen) -> tuple[float, ...]:
    """Largest contraction at each level (levels,) that a map's slack reading was taken at; 0 without any."""
    slack = np.zeros(len(specimen.levels_Pa))
    if (grid := specimen.force_map) is not None:
        np.maximum.at(slack, grid.level[grid.censored], grid.contraction[grid.censored])
    return tuple(slack.tolist())


def _onset(specimen: Specimen) -> tuple[float, ...]:
    """Least contraction with a known force at each level (levels,); beside no reading the neighbours'.

    A free contraction tells that the force is zero there.
    """
    levels, loops, grid = specimen.levels_Pa, specimen.loops, specimen.force_map
    onset = np.full(len(levels), np.inf)
    if specimen.geometry is None:
        return ()
    if loops is not None:
        np.minimum.at(onset, loops.level, loops.displacement_m / specimen.geometry.L0)
    if grid is not None:
        np.minimum.at(onset, grid.level[~grid.censored], grid.contraction[~grid.censored])
    if (blocked := specimen.blocked_force) is not None:
        pulling = blocked.pressure_Pa[~blocked.censored]
        onset[np.abs(pulling[:, None] - levels).argmin(axis=1)] = 0.0
    if (free := specimen.free_contraction) is not None:
        nearest = np.abs(free.pressure_Pa[:, None] - levels).argmin(axis=1)
        np.minimum.at(onset, nearest, free.contraction)
    known = np.isfinite(onset)
    return tuple(map(float, np.interp(levels, levels[known], onset[known]))) if known.any() else ()


def _tensile_range(specimen: Specimen) -> tuple[float, float] | None:
    """The declared range of strain, else that of the test."""
    if specimen.tensile is None:
        return None
    return specimen.fit.tensile_strain or specimen.tensile.strain_range


def _tensile_stiffness(specimen: Specimen) -> float:
    """The priors' scale by what is fitted of the tensile test, Pa at a strain of one."""
    test, span = specimen.tensile, _tensile_range(specimen)
    if test is None or span is None:
        return STRESS_SCALE
    inside = (test.strain >= span[0]) & (test.strain <= span[1])
    return stiffness_scale(test.strain[inside], test.stress_Pa[inside])


def _stroke_time(loops: Loops) -> float:
    first, rows = loops.strokes
    return float(np.median(np.maximum(loops.time_s[first + rows - 1] - loops.time_s[first], 1e-3)))


def _speed(loops: Loops) -> float:
    """Geometric mean of the strokes' mean speeds, m/s, of those that move; the thesis's where none does."""
    x = pd.Series(loops.displacement_m)
    low, high = (x.groupby(loops.stroke).transform(f).to_numpy() for f in ("min", "max"))
    way = high - low
    share = (loops.displacement_m - low) / np.where(way > 0.0, way, 1.0)
    under_way = (np.abs(share - 0.5) < 0.5 - DWELL_SHARE) & (way > STILL_SHARE * way.max())
    _, stroke = np.unique(loops.stroke[under_way], return_inverse=True)
    times = _times_under_way(share[under_way], loops.time_s[under_way], stroke)
    ways = np.zeros(len(times))
    ways[stroke] = way[under_way]
    moved = times > 0.0
    return float(np.exp(np.mean(np.log(ways[moved] / times[moved])))) if moved.any() else 50.0 * MM / MINUTE


def _times_under_way(share: Array, time: Array, stroke: NDArray[np.intp]) -> Array:
    """How long (strokes,) a crosshead takes from end to end, s, by what it does between; 0 where unknown.

    ``share`` (rows,) is the part of its stroke's way. The time is linear in the one of the profiles that fits
    best: speed gathered and lost over RAMPS of the time, or a sine.
    """
    rows = np.bincount(stroke)
    since = time - (np.bincount(stroke, time) / rows)[stroke]
    passed = [_passed(share, ramp) for ramp in RAMPS] + [np.arccos(1.0 - 2.0 * share) / np.pi]
    slopes, left = [], []
    for t in passed:
        t = t - (np.bincount(stroke, t) / rows)[stroke]
        slope = np.bincount(stroke, t * since) / np.maximum(np.bincount(stroke, t**2), 1e-12)
        slopes.append(np.abs(slope))
        left.append(np.bincount(stroke, (since - slope[stroke] * t) ** 2))
    best = np.argmin(left, axis=0)
    return np.where(rows >= ENOUGH, np.array(slopes)[best, np.arange(len(rows))], slopes[0])


def _passed(share: Array, ramp: float) -> Array:
    """Share of the time that a share (rows,) of the way takes, with speed gathered and lost evenly."""
    near = np.minimum(share, 1.0 - share)
    early = np.sqrt(2.0 * near * ramp * (1.0 - ramp))
    passed = np.where(2.0 * near * (1.0 - ramp) < ramp, early, near * (1.0 - ramp) + 0.5 * ramp)
    return np.where(share < 0.5, passed, 1.0 - passed)


def _reading_time(loops: Loops) -> float:
    return max(float(np.median(np.diff(loops.time_s))), 1e-6) if len(loops.time_s) > 1 else 1.0


def _level_time(loops: Loops) -> float:
    """The longest that one level was held, s; a level that comes back later is held anew."""
    spans = pd.Series(loops.time_s).groupby(run_ids(loops.clock, loops.level))
    return float((spans.max() - spans.min()).max())
