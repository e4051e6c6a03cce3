"""Reduced readings as a calibration's report shows them: beside the fit, with bands of others like them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.calibration import Calibration
from mpam_calib.model.noise import TIME, WHITE
from mpam_calib.model.readings import Readings
from mpam_calib.model.remainder import ROUGH
from mpam_calib.model.tensile import MISFIT, NOISE
from mpam_calib.posterior.density.target import predict_force
from mpam_calib.posterior.draws import Draws
from mpam_calib.posterior.likelihood.bins import LoopBins
from mpam_calib.posterior.likelihood.covariance import lasting_share
from mpam_calib.posterior.likelihood.points import KINDS, Points
from mpam_calib.prediction.curves import BATCH_CELLS, contraction_grid, first_root, force_curves
from mpam_calib.prediction.fitted import fitted_force, fitted_stress, noise_of, past_force
from mpam_calib.prediction.reading_noise import ReadingNoise
from mpam_calib.report.view import OBSERVED_COLUMNS
from mpam_calib.units import KPA

Array = NDArray[np.float64]

DRAWS, BAND_DRAWS = 200, 400
"""Draws behind the fitted value of each reading, and behind its band."""
BRANCH_WORDS = {1: "loading", -1: "unloading", 0: ""}


def in_kpa(levels: Array) -> Array:
    """Levels (Pa) in kPa, to a thousandth: more a median of readings does not mean."""
    return np.round(levels / KPA, 3)


def observed_readings(calibration: Calibration) -> tuple[pd.DataFrame, float, float]:
    """Reduced readings beside the declared simulation; the remainder's and the noise's size (nan: none)."""
    model, data = calibration.model, calibration.target.data
    draws = calibration.draws.thin(DRAWS)
    frames = []
    squares: list[Array] = []
    if data.bins is not None:
        frame, square = _bins_frame(data.bins, calibration, draws)
        frames.append(frame)
        squares.append(square)
    if data.points is not None:
        found = _points_frames(data.points, calibration, draws)
        frames += [frame for frame, _ in found]
        squares += [square for _, square in found]
    if data.tensile is not None and model.tensile is not None:
        frame, left = _tensile_frame(calibration, draws)
        frames.append(frame)
    # Without a remainder nothing says what the simulation misses: that is not nothing.
    assessed = bool(squares) and model.remainder is not None
    remainder = float(np.sqrt(np.mean(np.concatenate(squares)))) if assessed else float("nan")
    noise = noise_of(draws) if WHITE in draws.values else float("nan")
    if model.setting is None and MISFIT in draws.values:
        remainder = float(np.sqrt(np.mean(left)))
        noise = float(np.mean(draws.values[NOISE]))
    observed = (
        pd.concat(frames, ignore_index=True) if frames else pd.DataFrame(columns=list(OBSERVED_COLUMNS))
    )
    return observed.reindex(columns=list(OBSERVED_COLUMNS)), remainder, noise


def _bins_frame(bins: LoopBins, calibration: Calibration, draws: Draws) -> tuple[pd.DataFrame, Array]:
    """Reduced loops, and the remainder's mean square (n,) of those that are not slack.

    A bin's reading is a mean over its width: so is what it is compared with, or a curve's bend would look
    like a misfit.
    """
    middle, halves = bins.middle(), (slice(len(bins)), slice(len(bins), None))
    places = [bins.readings.take(half) for half in halves]
    fitted, left = np.mean([fitted_force(calibration.model, draws, place) for place in places], axis=0)
    past = np.mean([past_force(calibration.model, draws, place) for place in places], axis=0)
    rough = float(np.mean(draws.values[ROUGH] ** 2)) if ROUGH in draws.values else 0.0
    frame = _frame("loops", middle, bins.force, bins.slack, calibration)
    low, high = _bands(calibration, places, bins)
    frame = frame.assign(
        stroke=bins.segment, time_s=middle.time, cycle=middle.cycle,
        fitted_N=fitted, low_N=low, high_N=high, past_N=past,
    )  # fmt: skip
    return frame, (left + rough)[~bins.slack]


def _points_frames(
    points: Points, calibration: Calibration, draws: Draws
) -> list[tuple[pd.DataFrame, Array]]:
    """Static readings of each kind, and the remainder's mean square (n,) of those that are not slack."""
    model, guide = calibration.model, calibration.target.guide
    assert model.setting is not None
    fitted, left = fitted_force(model, draws, points.readings)
    low, high = _bands(calibration, [points.readings])
    found = []
    for number in np.unique(points.kind):
        rows = points.kind == number
        some = points.take(rows)
        frame = _frame(KINDS[number], some.readings, some.force, some.censored, calibration)
        if KINDS[number] != "free_contraction":
            frame = frame.assign(fitted_N=fitted[rows], low_N=low[rows], high_N=high[rows])
        else:
            frame["low_N"], frame["high_N"] = _free_bands(some.readings.pressure, calibration)
            if guide.slope is not None:
                # Newtons to contraction along the curve's slope there.
                slope = guide.slope[rows] * model.setting.geometry.L0
                frame["fitted_N"] = frame["contraction"] - fitted[rows] / slope
        found.append((frame, left[rows & ~points.censored]))
    return found


def _bands(
    calibration: Calibration, places: list[Readings], bins: LoopBins | None = None
) -> tuple[Array, Array]:
    """Ends (n,), N, of the 90 % band of another reading where, and at the pressure at which, each was made.

    Each is a mean over its places; one of ``bins`` has the noise of a mean of its rows.
    """
    model, draws = calibration.model, calibration.draws.thin(BAND_DRAWS)
    assert model.setting is not None
    rng = np.random.default_rng([calibration.seed, 12])
    size = max(1, BATCH_CELLS // len(draws))
    ends = []
    for i in range(0, len(places[0]), size):
        part = slice(i, i + size)
        some = [place.take(part) for place in places]
        force = np.mean([predict_force(model, draws.values, draws.eta, place) for place in some], axis=0)
        if ROUGH in draws.values:
            force = force + draws.values[ROUGH] * rng.standard_normal(force.shape)
        noise = ReadingNoise(draws.values, model.setting.force_scale)
        if bins is not None:
            noise = _noise_of_means(noise, bins, part)
        ends.append(np.quantile(force + noise.draw(force, rng), [0.05, 0.95], axis=0))
    low, high = np.concatenate(ends, axis=1)
    return low, high


def _free_bands(pressures: Array, calibration: Calibration) -> tuple[Array, Array]:
    """Ends (n,) of the 90 % band of the curve's own free contraction at pressures (n,), Pa.

    Without the noise of a reading, which takes up whatever the readings and the curve differ by.
    """
    model, draws = calibration.model, calibration.draws.thin(BAND_DRAWS)
    grid = contraction_grid(model, max(model.blueprint.reach))
    different, which = np.unique(pressures, return_inverse=True)
    ends = np.empty((2, len(different)))
    for i in range(len(different)):
        curves = force_curves(model, draws, different[i : i + 1], grid, calibration.seed)
        ends[:, i] = np.quantile(first_root(grid, curves.force[:, 0, 2]), [0.05, 0.95])
    low, high = ends[:, which]
    return low, high


def _noise_of_means(noise: ReadingNoise, bins: LoopBins, part: slice) -> ReadingNoise:
    """That of some bins: all their means would lie in bands of single readings, however wrong the fit."""
    rows, dt = bins.count[part], bins.dt[bins.segment[part]]
    lasting = lasting_share(rows, dt, noise.values[TIME][:, 0]) if TIME in noise.values else 1.0
    return replace(noise, averaged=rows * bins.averaged, lasting=lasting)


def _frame(
    kind: str, readings: Readings, force: Array, censored: NDArray[np.bool_], calibration: Calibration
) -> pd.DataFrame:
    specimen = calibration.specimen
    assert specimen.geometry is not None
    levels = in_kpa(specimen.levels_Pa)
    nearest = np.abs(readings.pressure[:, None] - specimen.levels_Pa).argmin(axis=1)
    level = np.where(readings.level >= 0, readings.level, nearest)
    return pd.DataFrame(
        {
            "kind": kind,
            "level_kPa": levels[level],
            "pressure_kPa": readings.pressure / KPA,
            "contraction": readings.displacement / specimen.geometry.L0,
            "branch": pd.Series(readings.sign.astype(int)).map(BRANCH_WORDS).to_numpy(),
            "force_N": force,
            "censored": censored,
        }
    )


def _tensile_frame(calibration: Calibration, draws: Draws) -> tuple[pd.DataFrame, Array]:
    """The tensile readings beside the law, and the remainder's mean square (n,)."""
    tensile = calibration.target.data.tensile
    assert tensile is not None
    stress, left = fitted_stress(calibration.model, draws, tensile.strain)
    frame = pd.DataFrame(
        {
            "kind": "tensile",
            "level_kPa": np.nan,
            "pressure_kPa": np.nan,
            "contraction": tensile.strain,
            "branch": "",
            "force_N": tensile.stress,
            "fitted_N": stress,
            "censored": False,
        }
    )
    return frame, left
