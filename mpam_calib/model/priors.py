"""Normalised priors, each the image of a standard normal: x = g(u), u ~ N(0, 1).

The sampler walks in u, where every prior is the same and no parameter has a bound.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats

from mpam_calib.errors import InputError
from mpam_calib.specimen.arguments import demand_finite, demand_name
from mpam_calib.units import unit_of

Array = NDArray[np.float64]

_FAR = 8.0
"""|u| beyond which a bounded prior is numerically at its bound."""
_WIDE = 12.0
"""z beyond which a normal density counts for nothing in an integral."""


TAIL = 0.7
"""δ of the long-tailed prior: 1 is the normal."""


class Prior(Protocol):
    """A one-dimensional prior. All methods are vectorised."""

    def from_normal(self, u: Array) -> Array:
        """The value whose standard-normal image is u."""

    def to_normal(self, x: Array) -> Array:
        """The standard-normal image of the value x (inside the support)."""

    @property
    def sd(self) -> float:
        """Standard deviation."""

    def describe(self, factor: float = 1.0) -> str:
        """One phrase, with values divided by ``factor`` (the SI size of the printed unit)."""

    def widened(self, factor: float) -> Prior:
        """The same prior, ``factor`` times as wide (below 1: narrower); physical bounds stay."""


def _demand_order(prior: str, low: float, high: float) -> None:
    """Raise ``InputError`` unless a prior's upper bound is above its lower one."""
    if not low < high:
        raise InputError(prior, f"low = {low!r} and high = {high!r}", "low below high")


@dataclass(frozen=True)
class Normal:
    """N(mean, scale²)."""

    mean: float
    scale: float

    def __post_init__(self) -> None:
        demand_finite("Normal", "mean", self.mean)
        demand_finite("Normal", "scale", self.scale, above=0.0)

    def from_normal(self, u: Array) -> Array:
        """mean + scale·u."""
        return self.mean + self.scale * u

    def to_normal(self, x: Array) -> Array:
        """(x − mean)/scale."""
        return (x - self.mean) / self.scale

    @property
    def sd(self) -> float:
        """Standard deviation."""
        return self.scale

    def describe(self, factor: float = 1.0) -> str:
        """One phrase."""
        return f"normal({self.mean / factor:.4g}, sd {self.scale / factor:.4g})"

    def widened(self, factor: float) -> Normal:
        """The same mean."""
        return Normal(self.mean, factor * self.scale)


@dataclass(frozen=True)
class LongTailed:
    """Symmetric about 0, near it like N(0, scale²), with long tails: scale·δ·sinh(arsinh(z)/δ), z ~ N(0, 1).

    Jones and Pewsey 2009 (doi:10.1093/biomet/asp053), sinh-arcsinh without skew. What lies at six scales
    costs the evidence 8 nats, not 18: nobody knows how far off a rig can be.
    """

    scale: float

    def __post_init__(self) -> None:
        demand_finite("LongTailed", "scale", self.scale, above=0.0)

    def from_normal(self, u: Array) -> Array:
        """scale·δ·sinh(arsinh(u)/δ)."""
        return self.scale * _drawn_out(u)

    def to_normal(self, x: Array) -> Array:
        """Inverse of :meth:`from_normal`."""
        return np.sinh(TAIL * np.arcsinh(x / (self.scale * TAIL)))

    @property
    def sd(self) -> float:
        """Standard deviation."""
        return self.scale * _long_tailed_sd()

    def describe(self, factor: float = 1.0) -> str:
        """One phrase."""
        return f"long-tailed about 0 (sinh-arcsinh, scale {self.scale / factor:.4g})"

    def widened(self, factor: float) -> LongTailed:
        """Zero stays the middle."""
        return LongTailed(factor * self.scale)


def _drawn_out(z: Array) -> Array:
    return TAIL * np.sinh(np.arcsinh(z) / TAIL)


@cache
def _long_tailed_sd() -> float:
    """The sd for scale 1, by quadrature."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(60)
    return float(np.sqrt(weights @ LongTailed(1.0).from_normal(nodes) ** 2 / weights.sum()))


@dataclass(frozen=True)
class NormalWithin:
    """N(mean, scale²) given that the value lies between ``low`` and ``high`` (either may be infinite)."""

    mean: float
    scale: float
    low: float
    high: float

    def __post_init__(self) -> None:
        demand_finite("NormalWithin", "mean", self.mean)
        demand_finite("NormalWithin", "scale", self.scale, above=0.0)
        _demand_order("NormalWithin", self.low, self.high)

    @property
    def _ends(self) -> Array:
        """The bounds in sds from the mean, (2,)."""
        return (np.array([self.low, self.high]) - self.mean) / self.scale

    @property
    def _shares(self) -> tuple[float, float]:
        below, above = special.ndtr(self._ends)
        return float(below), float(above - below)

    def from_normal(self, u: Array) -> Array:
        """The value at the share Φ(u) of what lies between the bounds."""
        below, width = self._shares
        share = below + width * special.ndtr(np.clip(u, -37.0, _FAR))
        return self.mean + self.scale * special.ndtri(np.clip(share, 1e-300, 1.0 - 1e-16))

    def to_normal(self, x: Array) -> Array:
        """Inverse of :meth:`from_normal`."""
        below, width = self._shares
        share = (special.ndtr((np.asarray(x) - self.mean) / self.scale) - below) / width
        return special.ndtri(np.clip(share, 1e-300, 1.0 - 1e-15))

    @property
    def sd(self) -> float:
        """Standard deviation."""
        return float(stats.truncnorm.std(*self._ends, scale=self.scale))

    def describe(self, factor: float = 1.0) -> str:
        """One phrase."""
        bounds = f"between {self.low / factor:.4g} and {self.high / factor:.4g}"
        return f"normal({self.mean / factor:.4g}, sd {self.scale / factor:.4g}) {bounds}"

    def widened(self, factor: float) -> NormalWithin:
        """The same mean and bounds."""
        return NormalWithin(self.mean, factor * self.scale, self.low, self.high)


@dataclass(frozen=True)
class LogNormal:
    """ln (x − least) ~ N(ln median, log_sd²); ``least`` is nothing, or next to nothing beside the median."""

    median: float
    log_sd: float
    least: float = 0.0

    def __post_init__(self) -> None:
        demand_finite("LogNormal", "median", self.median, above=0.0)
        demand_finite("LogNormal", "log_sd", self.log_sd, above=0.0)
        demand_finite("LogNormal", "least", self.least)

    def from_normal(self, u: Array) -> Array:
        """least + median·exp(log_sd·u)."""
        return self.least + self.median * np.exp(self.log_sd * np.clip(u, -40.0, 40.0))

    def to_normal(self, x: Array) -> Array:
        """ln((x − least)/median)/log_sd."""
        above = x - self.least if self.least else x
        return np.log(np.maximum(above, 1e-9 * self.least) / self.median) / self.log_sd

    @property
    def sd(self) -> float:
        """Standard deviation."""
        s2 = self.log_sd**2
        return float(self.median * np.exp(s2 / 2.0) * np.sqrt(np.expm1(s2)))

    def describe(self, factor: float = 1.0) -> str:
        """One phrase."""
        return f"log-normal(median {self.median / factor:.4g}, factor e^±{self.log_sd:.3g})"

    def widened(self, factor: float) -> LogNormal:
        """The same median."""
        return LogNormal(self.median, factor * self.log_sd, self.least)


@dataclass(frozen=True)
class HalfNormal:
    """|N(0, scale²)|."""

    scale: float

    def __post_init__(self) -> None:
        demand_finite("HalfNormal", "scale", self.scale, above=0.0)

    def from_normal(self, u: Array) -> Array:
        """The value with the same upper-tail probability (accurate in both tails)."""
        return self.scale * _folded(u)

    def to_normal(self, x: Array) -> Array:
        """Inverse of :meth:`from_normal`."""
        return -special.ndtri(np.clip(2.0 * special.ndtr(-np.asarray(x) / self.scale), 1e-300, 1.0 - 1e-15))

    @property
    def sd(self) -> float:
        """Standard deviation."""
        return float(self.scale * np.sqrt(1.0 - 2.0 / np.pi))

    def describe(self, factor: float = 1.0) -> str:
        """One phrase."""
        return f"half-normal(scale {self.scale / factor:.4g})"

    def widened(self, factor: float) -> HalfNormal:
        """Zero stays the bound."""
        return HalfNormal(factor * self.scale)


def _folded(u: Array) -> Array:
    return -special.ndtri(special.ndtr(-np.clip(u, -_FAR, 37.0)) / 2.0)


@dataclass(frozen=True)
class HalfLongTailed:
    """|LongTailed(scale)|: a size with one sign, of which nobody knows how large it can be."""

    scale: float

    def __post_init__(self) -> None:
        demand_finite("HalfLongTailed", "scale", self.scale, above=0.0)

    def from_normal(self, u: Array) -> Array:
        """The half-normal's value, its tail drawn out as :class:`LongTailed` does."""
        return self.scale * _drawn_out(_folded(u))

    def to_normal(self, x: Array) -> Array:
        """Inverse of :meth:`from_normal`."""
        return HalfNormal(1.0).to_normal(LongTailed(self.scale).to_normal(x))

    @property
    def sd(self) -> float:
        """Standard deviation (by quadrature)."""
        whole = LongTailed(self.scale)
        nodes, weights = np.polynomial.legendre.leggauss(80)
        z = 0.5 * _WIDE * (nodes + 1.0)
        density = np.sqrt(2.0 / np.pi) * np.exp(-0.5 * z**2)
        mean = 0.5 * _WIDE * float(weights @ (density * whole.from_normal(z)))
        return float(np.sqrt(whole.sd**2 - mean**2))

    def describe(self, factor: float = 1.0) -> str:
        """One phrase."""
        return f"half of a long-tailed one (sinh-arcsinh, scale {self.scale / factor:.4g})"

    def widened(self, factor: float) -> HalfLongTailed:
        """Zero stays the bound."""
        return HalfLongTailed(factor * self.scale)


@dataclass(frozen=True)
class Uniform:
    """Uniform on (low, high)."""

    low: float
    high: float

    def __post_init__(self) -> None:
        demand_finite("Uniform", "low", self.low)
        demand_finite("Uniform", "high", self.high)
        _demand_order("Uniform", self.low, self.high)

    def from_normal(self, u: Array) -> Array:
        """low + (high − low)·Φ(u)."""
        return self.low + (self.high - self.low) * special.ndtr(np.clip(u, -_FAR, _FAR))

    def to_normal(self, x: Array) -> Array:
        """Φ⁻¹ of the relative position."""
        return special.ndtri((np.asarray(x) - self.low) / (self.high - self.low))

    @property
    def sd(self) -> float:
        """Standard deviation."""
        return (self.high - self.low) / float(np.sqrt(12.0))

    def describe(self, factor: float = 1.0) -> str:
        """One phrase."""
        return f"uniform({self.low / factor:.4g} … {self.high / factor:.4g})"

    def widened(self, factor: float) -> Uniform:
        """The lower bound stays."""
        return Uniform(self.low, self.low + factor * (self.high - self.low))


@dataclass(frozen=True)
class LogUniform:
    """ln x uniform between the logarithms of low and high."""

    low: float
    high: float

    def __post_init__(self) -> None:
        demand_finite("LogUniform", "low", self.low, above=0.0)
        demand_finite("LogUniform", "high", self.high)
        _demand_order("LogUniform", self.low, self.high)

    @property
    def _log(self) -> Uniform:
        return Uniform(float(np.log(self.low)), float(np.log(self.high)))

    def from_normal(self, u: Array) -> Array:
        """low·(high/low)^Φ(u)."""
        return np.exp(self._log.from_normal(u))

    def to_normal(self, x: Array) -> Array:
        """Φ⁻¹ of the relative position of the logarithm."""
        return self._log.to_normal(np.log(x))

    @property
    def sd(self) -> float:
        """Standard deviation."""
        span = np.log(self.high / self.low)
        mean = (self.high - self.low) / span
        return float(np.sqrt((self.high**2 - self.low**2) / (2.0 * span) - mean**2))

    def describe(self, factor: float = 1.0) -> str:
        """One phrase."""
        return f"log-uniform({self.low / factor:.4g} … {self.high / factor:.4g})"

    def widened(self, factor: float) -> LogUniform:
        """The same middle on the logarithmic scale."""
        middle, reach = np.sqrt(self.low * self.high), np.sqrt(self.high / self.low) ** factor
        return LogUniform(float(middle / reach), float(middle * reach))


@dataclass(frozen=True)
class Parameter:
    """A sampled quantity: its name (which ends in its lab unit), its prior in SI units, and what it is."""

    name: str
    prior: Prior
    meaning: str
    source: str = ""
    unit: str | None = None
    """Printed unit where the name does not carry it."""

    def __post_init__(self) -> None:
        demand_name("Parameter", "name", self.name)
        if not callable(getattr(self.prior, "from_normal", None)):
            found = f"{type(self.prior).__name__} {self.prior!r}"
            raise InputError("Parameter", found, "a prior, such as Normal(0.0, 1.0)", None, self.name)

    @property
    def printed_unit(self) -> str:
        """The unit in print: an f_s is no number of seconds."""
        return unit_of(self.name) if self.unit is None else self.unit
