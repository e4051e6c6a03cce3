"""One hypothesis as a density of its own sizes: the moduli integrated out, noise and remainder known.

With the problem's covariance C and coordinates η ~ N(0, w² I) of the moduli,
    ln p(y | u) = ln N(y; f(u), w² A(u) A(u)ᵀ + C),
and u is standard normal: the same density as :mod:`mpam_calib.criticism.fitting.fit` climbs, in many u at
once.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.fitting.climb import furthest_of
from mpam_calib.criticism.fitting.fit import Fit, chain_for
from mpam_calib.model.blueprint import Blueprint
from mpam_calib.model.chain import Chain
from mpam_calib.model.priors import Parameter
from mpam_calib.posterior.density.mode import LOOSEST, Mode, climb, curvature, evaluate
from mpam_calib.posterior.likelihood.algebra import LOG_2PI

Array = NDArray[np.float64]

NEWTON_REACH = 0.5
"""Standard deviations over which differences are taken."""
NEWTON_STEPS, NEWTON_GAIN, SHORTER = 6, 0.005, (1.0, 0.5, 0.2, 0.05)
"""Newton steps at most, the gain (nats) below which they end, and shares of a step that are tried."""
STEEPEST = 1e12
"""Information beyond which differences over the axes saw another hillside, not the mode's own width."""
HARSHEST = 1e14
"""Information on the moduli, in their priors', beyond which the priors are lost to rounding."""
SAME = 1e-11
"""Share to which slopes must be sums of known shapes."""


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
    _memo: dict[str, Array] = field(default_factory=dict, compare=False, repr=False)

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
        n, B = len(self.problem), len(u)
        values = {q.name: q.prior.from_normal(u[:, i : i + 1]) for i, q in enumerate(self.parameters)}
        fixed, slope, linear, _ = self.chain.factored(
            values or {"": np.zeros((B, 1))}, self.problem.readings, self.guide
        )
        columns = linear.every()
        fixed = np.broadcast_to(fixed, (B, 2 * n))
        slope = np.broadcast_to(slope, (B, 2 * n))
        residual = self._whitened((self.problem.force - 0.5 * (fixed[:, :n] + fixed[:, n:])).T).T
        if len(columns) == 1:
            gram, pull = self._products_of_slopes(slope, columns[0], residual)
        else:
            gram, pull = self._products(slope, columns, residual)
        size = np.trace(gram, axis1=1, axis2=2)
        sound = size < HARSHEST
        gram = np.where(sound[:, None, None], gram, 0.0) + np.eye(gram.shape[1])
        mean = np.linalg.solve(gram, pull[..., None])[..., 0]
        quadratic = np.sum(residual**2, axis=1) - np.sum(pull * mean, axis=1)
        log_det = self.problem.log_dets[self.fit.size] + np.linalg.slogdet(gram)[1]
        prior = np.sum(u**2, axis=1) + u.shape[1] * LOG_2PI
        result: Array = -0.5 * (quadratic + log_det + n * LOG_2PI + prior)
        return np.where(sound & np.isfinite(result), result, -np.inf)

    def _whitened(self, columns: Array) -> Array:
        """C^(−1/2) times columns (n, k)."""
        return self.problem.white(columns, self.fit.size)

    def _products(self, slope: Array, columns: Array, residual: Array) -> tuple[Array, Array]:
        """AᵀC⁻¹A (B, p, p) and AᵀC⁻¹r (B, p) for A = slope·columns and whitened residuals r (B, n)."""
        n = len(self.problem)
        full = slope[..., None] * columns
        whole = 0.5 * self.moduli_width * (full[:, :n] + full[:, n:])
        white = self._whitened(np.moveaxis(whole, 1, 0).reshape(n, -1)).reshape(n, len(slope), -1)
        white = np.moveaxis(white, 1, 0)
        across = np.swapaxes(white, 1, 2)
        return across @ white, (across @ residual[..., None])[..., 0]

    def _products_of_slopes(self, slope: Array, columns: Array, residual: Array) -> tuple[Array, Array]:
        """The same where the columns (2n, p) are alike for all u, and slopes are sums of a few shapes."""
        n, p = len(self.problem), columns.shape[1]
        kept = self._memo.get("shapes")
        # Rows of `kept` are orthonormal; what they miss of the slopes starts them anew.
        if kept is None or np.abs(slope - (slope @ kept.T) @ kept).max() > SAME * np.abs(slope).max():
            seen = slope if kept is None else np.concatenate([kept, slope])
            _, size, shapes = np.linalg.svd(seen, full_matrices=False)
            kept = self._memo["shapes"] = shapes[size > 0.1 * SAME * size[0]]
            full = kept[:, :, None] * columns
            whole = 0.5 * self.moduli_width * (full[:, :n] + full[:, n:])
            self._memo["white"] = self._whitened(np.moveaxis(whole, 1, 0).reshape(n, -1))
            self._memo["gram"] = self._memo["white"].T @ self._memo["white"]
        share, r = slope @ kept.T, len(kept)
        each = (share[:, :, None] * share[:, None, :]).reshape(-1, r * r)
        gram = np.moveaxis(self._memo["gram"].reshape(r, p, r, p), 2, 1).reshape(r * r, p * p)
        pull = np.einsum("bk,bkp->bp", share, (residual @ self._memo["white"]).reshape(-1, r, p))
        return (each @ gram).reshape(-1, p, p), pull

    def mode(self) -> Mode:
        """The mode that Newton steps from the fit lead to, or a climb where they do not settle."""
        d = len(self.parameters)
        start = np.empty(d)
        for i, (own, fitted) in enumerate(zip(self.parameters, self.chain.parameters, strict=True)):
            start[i] = own.prior.to_normal(fitted.prior.from_normal(self.fit.u[i : i + 1]))[0]
        furthest = furthest_of(self.parameters)
        start = np.clip(np.nan_to_num(start), -furthest, furthest)
        if d == 0:
            return Mode(start, float(self.log_posterior(start[None])[0]), np.zeros((0, 0)))
        return self._newton(start) or self._climbed(start)

    def _newton(self, u: Array) -> Mode | None:
        """Newton's method with differences along the fit's own axes; None where it gets nowhere."""
        d, furthest = len(u), furthest_of(self.parameters)
        axes = np.linalg.cholesky(self.fit.covariance[:d, :d])
        i, j = np.triu_indices(d, 1)
        e = np.eye(d)
        offsets = np.concatenate([np.zeros((1, d)), e, -e, e[i] + e[j], -e[i] - e[j]])
        for _ in range(NEWTON_STEPS):
            f = evaluate(self, u + NEWTON_REACH * offsets @ axes.T)
            if not np.all(np.isfinite(f)):
                return None
            top, up, down = f[0], f[1 : d + 1], f[d + 1 : 2 * d + 1]
            both = f[2 * d + 1 :].reshape(2, -1).sum(axis=0)
            hessian = np.diag(up + down - 2.0 * top)
            hessian[i, j] = hessian[j, i] = 0.5 * (both + 2.0 * top - (up + down)[i] - (up + down)[j])
            back = np.linalg.inv(axes)
            values, turns = np.linalg.eigh(-(back.T @ hessian @ back) / NEWTON_REACH**2)
            if values[-1] > STEEPEST:
                return None
            shorter = turns / np.sqrt(np.maximum(values, LOOSEST))
            covariance = shorter @ shorter.T
            step = covariance @ (back.T @ (up - down)) / (2.0 * NEWTON_REACH)
            gain = 0.5 * float(step @ (back.T @ (up - down))) / (2.0 * NEWTON_REACH)
            if gain < NEWTON_GAIN:
                return Mode(u + step, float(top) + gain, covariance)
            tried = np.clip(u + np.array(SHORTER)[:, None] * step, -furthest, furthest)
            reached = evaluate(self, tried)
            # Where no step leads uphill, the axes were too long for their slopes: these are shorter.
            if reached.max() > top:
                u = tried[int(reached.argmax())]
            axes = shorter
        return None

    def _climbed(self, start: Array) -> Mode:
        u, top = climb(self, start)
        return Mode(u, top, curvature(self, u, top))
