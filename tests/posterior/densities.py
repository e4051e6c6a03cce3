"""Densities in sampler coordinates whose evidence is known in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special, stats

from mpam_calib.model.priors import HalfNormal
from mpam_calib.posterior.density.mode import Mode, climb, curvature

Array = np.ndarray


@dataclass(frozen=True)
class Gaussian:
    """2.5 nats times a normal density in four dimensions, with correlations up to 0.95."""

    dimensions: int = 4
    exact: float = 2.5

    def covariance(self) -> Array:
        d = self.dimensions
        correlation = 0.95 ** np.abs(np.subtract.outer(np.arange(d), np.arange(d)))
        sd = np.geomspace(0.01, 0.8, d)
        return correlation * np.outer(sd, sd)

    def log_posterior(self, u: Array) -> Array:
        mean = np.linspace(-1.0, 1.0, self.dimensions)
        return self.exact + stats.multivariate_normal.logpdf(u, mean, self.covariance()).reshape(len(u))


@dataclass(frozen=True)
class Skewed:
    """Σ (a u − e^u): independent logarithms of gamma variables, ln Z = Σ ln Γ(a); skewness up to -1."""

    shapes: tuple[float, ...] = (1.5, 3.0, 8.0)

    @property
    def exact(self) -> float:
        return float(special.gammaln(self.shapes).sum())

    def log_posterior(self, u: Array) -> Array:
        return (np.array(self.shapes) * u - np.exp(u)).sum(axis=1)


@dataclass(frozen=True)
class Bounded:
    """Half-normal parameters x_i of scale s seen as y_i ± σ: a flat tail in u where y_i is about zero.

    Z = Π 2 N(y; 0, s² + σ²) Φ(m/v), with m, v the posterior's mean and sd without the bound.
    """

    y: tuple[float, ...]
    s: float = 0.2
    sigma: float = 0.05

    @property
    def exact(self) -> float:
        total = 0.0
        for y in self.y:
            m, v = y * self.s**2, self.s * self.sigma * np.sqrt(self.s**2 + self.sigma**2)
            marginal = stats.norm.logpdf(y, 0.0, np.hypot(self.s, self.sigma))
            total += np.log(2.0) + marginal + special.log_ndtr(m / v)
        return float(total)

    def log_posterior(self, u: Array) -> Array:
        x = HalfNormal(self.s).from_normal(u)
        return (stats.norm.logpdf(u) + stats.norm.logpdf(np.array(self.y), x, self.sigma)).sum(axis=1)


@dataclass(frozen=True)
class Curved:
    """u₁ ~ N(0, 1), u₂ | u₁ ~ N(bend·u₁², 0.2²), as two coordinates turned by 30 degrees."""

    bend: float = 0.2
    exact: float = -3.0

    def log_posterior(self, u: Array) -> Array:
        c, s = np.cos(np.pi / 6.0), np.sin(np.pi / 6.0)
        a, b = c * u[:, 0] + s * u[:, 1], c * u[:, 1] - s * u[:, 0]
        return self.exact + stats.norm.logpdf(a) + stats.norm.logpdf(b, self.bend * a**2, 0.2)


@dataclass(frozen=True)
class Sheet:
    """Two wide coordinates and four that lie 0.02 thin on a bent sheet over them: ln Z = 1.5."""

    exact: float = 1.5

    def log_posterior(self, u: Array) -> Array:
        z, y = u[:, :2], u[:, 2:]
        at = np.stack([0.5 * np.sin(z[:, 0]), z[:, 1] ** 2, z[:, 0] * z[:, 1], np.exp(0.5 * z[:, 1])], axis=1)
        return self.exact + stats.norm.logpdf(z).sum(axis=1) + stats.norm.logpdf(y, at, 0.02).sum(axis=1)


@dataclass(frozen=True)
class Sheets:
    """Two independent sheets: twelve dimensions, ln Z = 3."""

    exact: float = 2.0 * Sheet.exact

    def log_posterior(self, u: Array) -> Array:
        return Sheet().log_posterior(u[:, :6]) + Sheet().log_posterior(u[:, 6:])


KNOWN = {
    "gaussian": Gaussian(),
    "skewed": Skewed(),
    "inside its bound": Bounded((0.3,)),
    "at its bound": Bounded((0.0,)),
    "beyond its bound": Bounded((-0.1,)),
    "two at their bounds, one inside": Bounded((0.0, 0.02, 0.3)),
    "curved": Curved(),
}


def mode_of(density: object, dimensions: int) -> Mode:
    u, top = climb(density, np.zeros(dimensions))
    return Mode(u, top, curvature(density, u, top))


def dimensions_of(density: object) -> int:
    return {
        Gaussian: lambda d: d.dimensions, Skewed: lambda d: len(d.shapes),
        Bounded: lambda d: len(d.y), Curved: lambda d: 2, Sheet: lambda d: 6, Sheets: lambda d: 12,
    }[type(density)](density)  # fmt: skip
