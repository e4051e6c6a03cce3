"""How large the noise is, put right by what the best models leave of the rows.

Before any model is fitted, windows of consecutive readings tell the noise; short strokes leave short windows,
and what they say of correlated noise at the length of a reduced row is good to some tens of percent. That
matters: all evidences are as sharp as the noise is small. A model whose moduli are free at every level, or
that has the right causes, leaves of hundreds of rows little but noise. Its evidence as a function of a common
scale on the noise's sd, with the remainder's sizes summed over, is combined with the windows' own
uncertainty; the maximum is taken for all.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mpam_calib.criticism.data.problem import SIZES, Problem
from mpam_calib.criticism.fitting.fit import Fit, fit
from mpam_calib.model.blueprint import Blueprint
from mpam_calib.specimen.declaration import Simulation

Array = NDArray[np.float64]

LOG_SCALES = np.linspace(-0.8, 0.8, 17)
"""Logarithms of the scales that are tried."""
WINDOWS_SD = 0.35
"""Standard deviation of the logarithm of the noise's sd as the windows give it."""
GUESS_SCALES, GUESS_SD = np.linspace(-3.0, 5.0, 41), 2.0
"""The same where the noise is a guess, and the guess's standard deviation."""
ROUNDS, SETTLED = 4, 0.05
"""Times that models are fitted to settle a guess, and its change at which they end."""
FLEXIBLE = ("free", "linear", "constant")
"""The law of the models that are asked: the first that a space has (of few levels it has no free one)."""
MOST_ORDER = 5
"""Highest order of the models that are asked."""


def settle_noise(problem: Problem, space: Sequence[Simulation]) -> Problem:
    """The problem with its noise scaled as the most probable flexible model of a space asks.

    Where it is a guess, as all models together ask (:func:`settle_guess`).
    """
    if problem.noise_guessed:
        plain = [s for s in space if s.law in FLEXIBLE and s.order <= MOST_ORDER] or list(space)
        return settle_guess(problem, [problem.blueprint.model_copy(update={"simulation": s}) for s in plain])
    law = next((law for law in FLEXIBLE if any(s.law == law for s in space)), "")
    flexible = [s for s in space if s.law == law and s.order <= MOST_ORDER] or list(space)
    top = max(s.order for s in flexible)
    blueprints = [problem.blueprint.model_copy(update={"simulation": s}) for s in flexible if s.order == top]
    fits = [(b, found) for b in blueprints if (found := _fits(problem, b, {}))]
    if not fits:
        return problem
    blueprint, found = max(fits, key=lambda item: _evidence(item[1].values()))
    starts = {size: f.ended for size, f in found.items()}
    each = [
        _evidence(_fits(problem.with_noise_scale(float(np.exp(s))), blueprint, starts).values())
        for s in LOG_SCALES
    ]
    posterior = np.array(each) - 0.5 * (LOG_SCALES / WINDOWS_SD) ** 2
    return problem.with_noise_scale(float(np.exp(_top(LOG_SCALES, posterior))))


def noise_scale(problem: Problem, fits: Sequence[Fit]) -> float:
    """The scale on the noise's sd that one model's fits (one for each size of the remainder) ask for.

    At their modes: ln p(y | s) = ln N(residual; 0, s² noise + remainder) + k ln s, where k is the number of
    parameters that the data settle, whose widths go with s.
    """
    posterior = _by_scale(problem, fits, LOG_SCALES) - 0.5 * (LOG_SCALES / WINDOWS_SD) ** 2
    return float(np.exp(_top(LOG_SCALES, posterior)))


def _by_scale(problem: Problem, fits: Iterable[Fit], log_scales: Array) -> Array:
    """Log evidence of one model at these scales on the noise's sd, the modes held as they are."""
    axes = problem.axes
    terms = []
    for f in fits:
        residual = axes @ (problem.force - f.force - f.doubt)
        remainder = (SIZES[f.size] * problem.force_scale) ** 2 * axes.powers
        settled = len(f.covariance) - float(np.trace(f.covariance))
        scales = np.append(log_scales, 0.0)
        variance = np.exp(2.0 * scales)[:, None] + remainder
        change = -0.5 * np.sum(residual**2 / variance + np.log(variance), axis=1) + settled * scales
        terms.append(f.log_share + change[:-1] - change[-1])
    return np.asarray(np.logaddexp.reduce(terms, axis=0))


def settle_guess(problem: Problem, blueprints: Sequence[Blueprint]) -> Problem:
    """Noise that no reading told before: its mean (of logarithms) under all models, of laws without rates.

    The flexible ones alone fit a few readings whatever the noise is; and of three readings the most probable
    noise is next to none. Where the scale is far off, parameters that are settled there are others: the fits
    are made again.
    """
    found, at = problem, 0.0
    for _ in range(ROUNDS):
        fits = [each for b in blueprints if (each := _fits(found, b, {}))]
        if not fits:
            return problem
        curves = [_by_scale(found, each.values(), GUESS_SCALES - at) for each in fits]
        posterior = np.logaddexp.reduce(curves, axis=0) - 0.5 * (GUESS_SCALES / GUESS_SD) ** 2
        before, at = at, float(GUESS_SCALES @ special.softmax(posterior))
        found = problem.with_noise_scale(float(np.exp(at)))
        if abs(at - before) < SETTLED:
            break
    level = problem.noise_level
    return replace(found, noise_level=replace(level, white=float(np.exp(at)) * level.white))


def _fits(problem: Problem, blueprint: Blueprint, starts: dict[int, dict[str, float]]) -> dict[int, Fit]:
    found = {}
    for size in range(len(SIZES)):
        try:
            found[size] = fit(problem, frozenset(), size, starts.get(size), blueprint)
        except np.linalg.LinAlgError:
            continue
    return found


def _evidence(fits: Iterable[Fit]) -> float:
    terms = [f.log_share for f in fits]
    return float(np.logaddexp.reduce(terms)) if terms else -np.inf


def _top(x: Array, y: Array) -> float:
    """Where a curve is highest: the vertex of the parabola through the best point and its neighbours."""
    i = int(np.clip(np.argmax(y), 1, len(x) - 2))
    bend = y[i - 1] - 2.0 * y[i] + y[i + 1]
    if not bend < 0.0:
        return float(x[int(np.argmax(y))])
    return float(np.clip(x[i] + 0.5 * (y[i - 1] - y[i + 1]) / bend * (x[1] - x[0]), x[0], x[-1]))
