"""Rows that are only known to be slack: a Laplace approximation in the linear coordinates.

A slack row says ln((1 − ε) Φ((floor − f − Aη)/sd) + ε), where ε is the share of flags that may be wrong.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mpam_calib.posterior.likelihood.algebra import cholesky, log_determinant, solve

Array = NDArray[np.float64]

NEWTON_STEPS = 6
WRONG_FLAG = 0.01
"""Share of slack flags that may be wrong: one of them must not outweigh all other readings."""


class Slack(NamedTuple):
    """Censored rows: force (B, n) without η, its columns (B, n, k), floor and sd (B, n), N."""

    fixed: Array
    columns: Array
    floor: Array
    sd: Array


def with_slack(gram: Array, pull: Array, constant: Array, parts: list[Slack]) -> tuple[Array, Array, Array]:
    """Laplace's approximation in η with slack rows: the better of two climbs.

    One climb starts from all other rows' fit,
    where a wrong flag is left aside at once; the other takes all flags at their word first.
    """
    whole = Slack(*(np.concatenate(arrays, axis=1) for arrays in zip(*parts, strict=True)))
    start = solve(gram, pull)
    trusting = _climb(gram, pull, whole, start, 0.0)
    ends = [_climb(gram, pull, whole, first, WRONG_FLAG) for first in (start, trusting)]
    found = [_laplace(gram, pull, constant, whole, eta) for eta in ends]
    value, mean, factor = found[0]
    better = found[1][0] > value
    return (
        np.where(better, found[1][0], value),
        np.where(better[:, None], found[1][1], mean),
        np.where(better[:, None, None], found[1][2], factor),
    )


def _slack_terms(slack: Slack, eta: Array, wrong: float) -> tuple[Array, Array, Array]:
    """Sum of the rows' log probabilities (B,), their slopes and (clipped) curvatures in force (B, n)."""
    z = (slack.floor - slack.fixed - np.einsum("bnk,bk->bn", slack.columns, eta)) / slack.sd
    log_cdf = special.log_ndtr(z) + np.log1p(-wrong)
    # φ/Φ by the scaled error function: both underflow far from the floor.
    ratio = np.sqrt(2.0 / np.pi) / special.erfcx(-z / np.sqrt(2.0))
    # Far out of the prior there may be no number here: such a vector counts as impossible.
    with np.errstate(invalid="ignore"):
        log_term = np.logaddexp(log_cdf, np.log(wrong)) if wrong else log_cdf
    share = np.exp(log_cdf - log_term)
    curvature = share * ratio * (z + ratio) - share * (1.0 - share) * ratio**2
    return log_term.sum(axis=1), share * ratio / slack.sd, np.clip(curvature, 0.0, 1.0) / slack.sd**2


def _climb(gram: Array, pull: Array, slack: Slack, eta: Array, wrong: float) -> Array:
    for _ in range(NEWTON_STEPS):
        _, slope, curvature = _slack_terms(slack, eta, wrong)
        gradient = pull - np.einsum("bkl,bl->bk", gram, eta) - np.einsum("bnk,bn->bk", slack.columns, slope)
        eta = eta + solve(_slack_hessian(gram, slack, curvature), gradient)
    return eta


def _slack_hessian(gram: Array, slack: Slack, curvature: Array) -> Array:
    result: Array = gram + np.swapaxes(slack.columns, 1, 2) @ (slack.columns * curvature[..., None])
    return result


def _laplace(
    gram: Array, pull: Array, constant: Array, slack: Slack, eta: Array
) -> tuple[Array, Array, Array]:
    log_term, _, curvature = _slack_terms(slack, eta, WRONG_FLAG)
    factor = cholesky(_slack_hessian(gram, slack, curvature))
    quadratic = np.einsum("bk,bkl,bl->b", eta, gram, eta) - 2.0 * np.einsum("bk,bk->b", pull, eta)
    value: Array = log_term - 0.5 * (constant + quadratic + log_determinant(factor))
    return value, eta, factor
