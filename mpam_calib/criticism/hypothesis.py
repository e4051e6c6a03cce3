"""One hypothesis as a density of its own sizes: the moduli integrated out, noise and remainder known.

With the problem's covariance C and coordinates η ~ N(0, w² I) of the moduli,
    ln p(y | u) = ln N(y; f(u), w² A(u) A(u)ᵀ + C),
and u is standard normal: the same density as :mod:`mpam_calib.criticism.fit` climbs, in many u at once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mpam_calib.criticism.climb import FURTHEST
from mpam_calib.criticism.fit import Fit, chain_for
from mpam_calib.criticism.problem import Problem
from mpam_calib.model.blueprint import Blueprint
from mpam_calib.model.chain import Chain
from mpam_calib.model.priors import Parameter
from mpam_calib.posterior.mode import Mode, climb, curvature

Array = NDArray[np.float64]

LOG_2PI = float(np.log(2.0 * np.pi))


@dataclass(frozen=True)
class Hypothesis:
    """A fitted simulation whose evidence is wanted; prior widths may differ from the fit's.

    ``moduli_width`` multiplies the moduli's prior sd (in newtons on the reference grid), ``other_width``
    that of every other parameter. What depends on the force is fed with the fit's.
    """

    problem: Problem
    blueprint: Blueprint
    fit: Fit
    moduli_width: float = 1.0
    other_width: float = 1.0

    @cached_property
    def chain(self) -> Chain:
        """The simulation's chain."""
        return chain_for(self.blueprint.model_dump_json(), self.fit.effects)

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """What u stands for, with the priors as wide as asked."""
        return tuple(replace(p, prior=p.prior.widened(self.other_width)) for p in self.chain.parameters)

    @cached_property
    def guide(self) -> Array:
        """The fit's force at the rows' Gauss points (2n,), N."""
        return np.concatenate([self.fit.force, self.fit.force])

    def log_posterior(self, u: Array) -> Array:
        """Log posterior density (B,) of coordinates u (B, d)."""
        n, p, B = len(self.problem), self.chain.linear_size, len(u)
        values = {q.name: q.prior.from_normal(u[:, i : i + 1]) for i, q in enumerate(self.parameters)}
        terms = self.chain.terms(values or {"": np.zeros((B, 1))}, self.problem.readings, self.guide)
        fixed = np.broadcast_to(terms.fixed, (B, 2 * n))
        columns = np.broadcast_to(terms.columns, (B, 2 * n, p))
        stacked = np.empty((B, n, p + 1))
        stacked[:, :, :p] = 0.5 * self.moduli_width * (columns[:, :n] + columns[:, n:])
        stacked[:, :, p] = self.problem.force - 0.5 * (fixed[:, :n] + fixed[:, n:])
        flat = np.moveaxis(stacked, 1, 0).reshape(n, -1)
        white = (self.problem.axes[0] @ flat) / self.problem.spreads[self.fit.size][:, None]
        white = np.moveaxis(white.reshape(n, B, p + 1), 1, 0)
        full = np.swapaxes(white, 1, 2) @ white
        gram, pull = full[:, :p, :p] + np.eye(p), full[:, :p, p]
        mean = np.linalg.solve(gram, pull[..., None])[..., 0]
        quadratic = full[:, p, p] - np.sum(pull * mean, axis=1)
        log_det = self.problem.log_dets[self.fit.size] + np.linalg.slogdet(gram)[1]
        prior = np.sum(u**2, axis=1) + u.shape[1] * LOG_2PI
        result: Array = -0.5 * (quadratic + log_det + n * LOG_2PI + prior)
        return np.where(np.isfinite(result), result, -np.inf)

    def mode(self) -> Mode:
        """The mode that a climb from the fit leads to."""
        d = len(self.parameters)
        start = np.empty(d)
        for i, (own, fitted) in enumerate(zip(self.parameters, self.chain.parameters, strict=True)):
            start[i] = own.prior.to_normal(fitted.prior.from_normal(self.fit.u[i : i + 1]))[0]
        start = np.clip(np.nan_to_num(start), -FURTHEST, FURTHEST)
        if d == 0:
            return Mode(start, float(self.log_posterior(start[None])[0]), np.zeros((0, 0)))
        u, top = climb(self, start)
        return Mode(u, top, curvature(self, u, top))
