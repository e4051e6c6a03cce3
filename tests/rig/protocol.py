"""Test protocols: which pressures, strokes, speeds and rows a rig records, and its sensor noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .muscle import Array, Muscle, free_contraction


@dataclass(frozen=True)
class Protocol:
    """One isobaric force-displacement test.

    At every level the crosshead runs `cycles` cycles at each of `speeds_mm_s` from the initial length to
    `stroke_fraction` of the level's free contraction (or `strokes_mm`) and back, with `dwell_s` of rest at
    both ends.
    Noise: white sd and an exponentially correlated part (sd, time constant [s]), both in N.
    """

    levels_kPa: tuple[float, ...]
    cycles: int = 3
    speeds_mm_s: tuple[float, ...] = (2.0,)
    dwell_s: float = 0.0
    sampling_hz: float = 20.0
    rows_max: int = 3000
    motion: str = "triangle"
    stroke_fraction: float = 0.85
    strokes_mm: tuple[float, ...] = ()
    pause_s: float = 20.0
    noise_N: float = 0.1
    correlated_N: float = 0.05
    correlation_s: float = 0.1
    pressure_noise_kPa: float = 0.02
    pressure_wander: float = 0.002
    floor_N: float | None = None
    branch_column: bool = True


@dataclass(frozen=True)
class Rows:
    """Everything that is known per recorded row before any force (all arrays of one length).

    direction: +1 loading (towards L0), -1 unloading; since_reversal and stroke in mm;
    level_time counts from the moment the level was reached; fraction = displacement / largest displacement.
    """

    time: Array
    setpoint: Array
    level: Array
    pressure: Array
    reading: Array
    displacement: Array
    direction: Array
    speed: Array
    nominal_speed: Array
    since_reversal: Array
    travel: Array
    stroke: Array
    cycle: Array
    level_time: Array

    @property
    def count(self) -> int:
        return int(self.time.size)

    @property
    def fraction(self) -> Array:
        return self.displacement / self.displacement.max()

    @property
    def level_fraction(self) -> Array:
        return self.displacement / self.stroke


def _half_stroke(
    motion: str, speed: float, stroke: float, dwell: float, dt: float
) -> tuple[Array, Array, float]:
    """Times within one half cycle, way covered [0..stroke], and its duration; `speed` is the mean speed."""
    duration = stroke / speed
    # Half a step off the reversal: what friction does at the very turn is not defined.
    times = dt * (np.arange(int(np.ceil((duration + dwell) / dt - 1e-9))) + 0.5)
    times = times[times < duration + dwell]
    phase = np.minimum(times / duration, 1.0)
    way = stroke * (phase if motion == "triangle" else 0.5 * (1.0 - np.cos(np.pi * phase)))
    return times, way, duration + dwell


def _step(dt: float, stroke: float, speed: float) -> float:
    """Sampling interval of one stroke [s]: thinning leaves fast strokes at least 12 rows."""
    return min(dt, stroke / speed / 12.0)


def _sampling_step(p: Protocol, strokes: list[float]) -> float:
    """Sampling interval [s], thinned by a whole factor until the rows fit."""
    for factor in range(1, 10_000):
        dt = factor / p.sampling_hz
        rows = sum(
            2 * p.cycles * int(np.ceil((s / v + p.dwell_s) / _step(dt, s, v) + 1e-9))
            for s in strokes
            for v in p.speeds_mm_s
        )
        if rows <= p.rows_max or dt > max(strokes):
            return dt
    raise ValueError("rows cannot be thinned enough")


def record_rows(p: Protocol, muscle: Muscle, seed: int) -> Rows:
    """The rows of the test; strokes follow from the declared muscle's own free contraction."""
    rng = np.random.default_rng([seed, 11])
    scale = p.stroke_fraction * muscle.geometry.L0_mm
    strokes = list(p.strokes_mm) or [scale * free_contraction(muscle, level) for level in p.levels_kPa]
    if min(strokes) <= 0.0:
        raise ValueError("a level at which the muscle does not contract")
    dt = _sampling_step(p, strokes)
    parts: list[dict[str, Array]] = []
    clock = 0.0
    for j, (level, stroke) in enumerate(zip(p.levels_kPa, strokes, strict=True)):
        start, travelled, cycle = clock, 0.0, 0
        for speed in p.speeds_mm_s:
            times, way, duration = _half_stroke(p.motion, speed, stroke, p.dwell_s, _step(dt, stroke, speed))
            pace = np.full(times.size, speed)
            if p.motion == "sine":
                pace = speed * np.pi / 2.0 * np.sin(np.pi * np.minimum(times * speed / stroke, 1.0))
            for _ in range(p.cycles):
                cycle += 1
                for direction in (-1.0, 1.0):
                    ones = np.ones(times.size)
                    parts.append(
                        {
                            "time": clock + times,
                            "setpoint": level * ones,
                            "level": j * ones,
                            "displacement": way if direction < 0 else stroke - way,
                            "direction": direction * ones,
                            "speed": pace,
                            "nominal_speed": speed * ones,
                            "since_reversal": way,
                            "travel": travelled + way,
                            "stroke": stroke * ones,
                            "cycle": cycle * ones,
                            "level_time": clock + times - start,
                        }
                    )
                    clock += duration
                    travelled += stroke
        clock += p.pause_s
    joined = {k: np.concatenate([part[k] for part in parts]) for k in parts[0]}
    # A regulator holds its level up to a slow ripple; the gauge adds its own noise.
    ripple = p.pressure_wander * np.sin(2 * np.pi * joined["time"] / 37.0 + rng.uniform(0, 2 * np.pi))
    pressure = joined["setpoint"] * (1.0 + ripple)
    reading = pressure + p.pressure_noise_kPa * rng.standard_normal(pressure.size)
    return Rows(pressure=pressure, reading=reading, **joined)


def sensor_noise(p: Protocol, rows: Rows, seed: int) -> Array:
    """White noise plus an exponentially correlated part along the clock, in N."""
    rng = np.random.default_rng([seed, 12])
    white = p.noise_N * rng.standard_normal(rows.count)
    kicks = rng.standard_normal(rows.count)
    if p.correlated_N <= 0.0:
        return white
    decay = np.exp(-np.diff(rows.time, prepend=rows.time[0]) / p.correlation_s)
    decay[0] = 0.0
    slow = np.empty(rows.count)
    value = 0.0
    for i, (a, kick) in enumerate(zip(decay, kicks, strict=True)):
        value = a * value + np.sqrt(1.0 - a * a) * kick
        slow[i] = value
    return white + p.correlated_N * slow


def noise_sd(p: Protocol) -> float:
    """Total sd of the sensor noise [N]."""
    return float(np.hypot(p.noise_N, p.correlated_N))
