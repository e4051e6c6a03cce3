"""The bladder's moduli as a linear block: E_k(P) = Σ_a coefficient_{a,k} h_a(P).

The force is linear in the coefficients, so they are integrated out. Their prior is stated in
newtons on the reference grid: with the grid's columns G = QR (pressure part ⊗ contraction part) the
block's coordinates η ~ N(0, I) give forces Q η of root mean square ``scale``; coefficients are
``mean + transform·η`` exactly.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.effect import Values
from mpam_calib.model.priors import LogNormal, Normal, Parameter, Prior
from mpam_calib.units import KPA, level_labels

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


def rate_names(law: str, order: int) -> list[str]:
    """Names of a law's rates as they are sampled: d and its distance to z (so that d > z)."""
    if law == "exponential":
        return ["d", "gap"]
    if law == "exponential_each":
        return [f"{name}_{k}" for k in range(1, order + 1) for name in ("d", "gap")]
    return []


def rate_parameters(law: str, order: int, levels: Array) -> tuple[Parameter, ...]:
    """Priors of the rates, in 1/Pa: d of order one over the pressure span, z below it (thesis Eq. 4.8)."""
    span = float(levels[-1] - levels[0]) or float(levels[-1])
    priors: dict[str, Prior] = {"d": Normal(0.0, 2.0 / span), "gap": LogNormal(5.0 / span, 1.0)}
    meaning = {"d": "faster rate of the law", "gap": "how much slower the other rate z is"}
    return tuple(
        Parameter(name, priors[name.split("_")[0]], meaning[name.split("_")[0]], "thesis Eq. 4.8", "1/kPa")
        for name in rate_names(law, order)
    )


@dataclass(frozen=True)
class Law:
    """h_a(P) for one law, and the names of its coefficients.

    ``terms`` are the printed letters (a, b), (c, w), (E,) or (E@level...); ``units`` their units;
    ``factors`` the SI size of each unit.
    """

    name: str
    order: int
    levels: Array

    @property
    def terms(self) -> int:
        """How many functions h_a of pressure the law has."""
        return {
            "constant": 1,
            "linear": 2,
            "exponential": 2,
            "exponential_each": 2,
            "free": len(self.levels),
        }[self.name]

    def coefficient_names(self) -> list[str]:
        """Names in the block's order (a major, k minor)."""
        letters = {"constant": ["E"], "linear": ["a", "b"], "exponential": ["c", "w"]}
        letters["exponential_each"] = letters["exponential"]
        orders = range(1, self.order + 1)
        if self.name == "free":
            return [f"E_{k}@{label}" for label in level_labels(self.levels) for k in orders]
        return [f"{letter}_{k}" for letter in letters[self.name] for k in orders]

    def coefficient_meanings(self) -> list[str]:
        """A few words for each coefficient."""
        orders = range(1, self.order + 1)
        if self.name == "constant":
            return [f"modulus of strain to the power {k}" for k in orders]
        if self.name == "free":
            labels = level_labels(self.levels)
            return [f"modulus of strain to the power {k}, at {at} kPa" for at in labels for k in orders]
        linear = ("change per unit of pressure", "value at zero pressure")
        words = (
            linear if self.name == "linear" else ("weight of the faster rate", "weight of the slower rate")
        )
        return [f"modulus E_{k}: {what}" for what in words for k in orders]

    def coefficient_units(self) -> list[tuple[str, float]]:
        """(printed unit, SI size) of each coefficient."""
        pairs = [("Pa", 1.0)] * (self.terms * self.order)
        if self.name == "linear":
            pairs[: self.order] = [("Pa/kPa", 1.0 / KPA)] * self.order
        return pairs

    def basis(self, pressure: Array, level: Ints, values: Values) -> Array:
        """h_a for each modulus: shape (B or 1, n, terms, order or 1).

        ``pressure`` is the reading (n,), Pa: a law in the gauge's pressure is closed under a gauge
        offset, and its constants are then not confounded with it.
        """
        P = pressure[None, :]
        if self.name == "constant":
            return np.ones((1, P.shape[1], 1, 1))
        if self.name == "linear":
            return np.moveaxis(np.stack([P, np.ones_like(P)]), 0, -1)[..., None]
        if self.name == "free":
            known = level >= 0
            hats = np.eye(len(self.levels))[level]
            if not known.all():
                between = pressure[~known]
                hats[~known] = np.stack(
                    [np.interp(between, self.levels, row) for row in np.eye(len(self.levels))], -1
                )
            return hats[None, :, :, None]
        names = ["d"] if self.name == "exponential" else [f"d_{k}" for k in range(1, self.order + 1)]
        d = np.concatenate([values[name] for name in names], axis=1)
        gap = np.concatenate([values[name.replace("d", "gap")] for name in names], axis=1)
        return _exp(np.stack([d, d - gap], axis=1)[:, None] * P[..., None, None])


ALIKE = 1e-10
"""Sine of the angle between a column of the linear block and those before it, below which it adds nothing."""


FURTHEST = 300.0
"""Exponents beyond this are not told from it: the squares of forces and coefficients stay numbers."""


def _exp(x: Array) -> Array:
    return np.exp(np.clip(x, -FURTHEST, FURTHEST))


def _orthogonal(columns: Array) -> Array:
    """Coefficients (B, p, p) that make columns (B, n, p) of length one orthogonal; zero for one left out.

    Far out rates meet, or leave a single level in sight: a column that says no more than those before it is
    left out. Gram and Schmidt's way, each column twice.
    """
    B, _, p = columns.shape
    made, coefficients = np.zeros_like(columns), np.zeros((B, p, p))
    for j in range(p):
        left, by = columns[:, :, j], np.broadcast_to(np.eye(p)[j], (B, p))
        for _ in range(2):
            along = np.einsum("bnk,bn->bk", made, left)
            left = left - np.einsum("bnk,bk->bn", made, along)
            by = by - np.einsum("bqk,bk->bq", coefficients, along)
        size = np.linalg.norm(left, axis=1, keepdims=True)
        own = size > ALIKE
        size = np.where(own, size, 1.0)
        made[:, :, j], coefficients[:, :, j] = own * left / size, own * by / size
    return coefficients


class Columns(NamedTuple):
    """Force per coordinate η, N, not multiplied out: gain·(h ⊗ per modulus)·transform.

    ``h`` (B or 1, n, terms, order or 1), ``per_modulus`` (B or 1, n, order), ``gain`` (B or 1, n or 1),
    ``transform`` (B or 1, q, p).
    """

    h: Array
    per_modulus: Array
    gain: Array
    transform: Array

    @classmethod
    def none(cls, n: int) -> Columns:
        """No moduli: n readings, no coordinates."""
        return cls(np.zeros((1, n, 0, 1)), np.zeros((1, n, 1)), np.ones((1, 1)), np.zeros((1, 0, 0)))

    @property
    def size(self) -> int:
        """Number of coordinates p."""
        return int(self.transform.shape[2])

    def first(self) -> Columns:
        """Of the first parameter vector alone."""
        return Columns(*(part[:1] for part in self))

    def every(self) -> Array:
        """Multiplied out, (B or 1, n, p)."""
        natural = self.h * self.per_modulus[:, :, None, :]
        found = natural.reshape(*natural.shape[:2], -1) @ self.transform
        return found if np.all(self.gain == 1.0) else self.gain[..., None] * found

    def times(self, eta: Array) -> Array:
        """Force (B or 1, n), N, for coordinates η (p,) or (B, p)."""
        return self.of((self.transform @ np.atleast_2d(eta)[..., None])[..., 0])

    def of(self, coefficients: Array) -> Array:
        """Force (B or 1, n), N, of coefficients (B or 1, q): through the moduli at every reading."""
        terms, order = self.h.shape[2], self.per_modulus.shape[2]
        each = coefficients.reshape(len(coefficients), 1, terms, order)
        moduli = self.h[..., 0] @ each[:, 0] if self.h.shape[3] == 1 else (self.h * each).sum(axis=2)
        force = self.per_modulus[..., 0] * moduli[..., 0]
        for k in range(1, order):
            force = force + self.per_modulus[..., k] * moduli[..., k]
        return np.asarray(self.gain * force)


@dataclass(frozen=True)
class ModuliBlock:
    """The linear block: a law, its prior mean and how its coordinates become coefficients.

    Exactly one of two priors: in newtons on a reference grid (``grid`` = (pressure, contraction
    columns)), or Gaussian on the coefficients themselves (``mean`` (q,), ``root`` (q, p)).
    """

    law: Law
    scale: float
    grid: tuple[Array, Array] | None = None
    """(levels (l,) Pa, force per modulus on the grid's contractions (g, order))"""
    mean: Array | None = None
    root: Array | None = None
    _cache: dict[str, Array] = field(default_factory=dict, compare=False, repr=False)

    @property
    def size(self) -> int:
        """Number of coordinates η."""
        return self.law.terms * self.law.order if self.root is None else self.root.shape[1]

    @property
    def fixed(self) -> bool:
        """Whether the coefficients' prior is the same for all values: the law has no rates of its own."""
        return self.root is not None or self.law.name in ("constant", "linear", "free")

    def transform(self, values: Values) -> tuple[Array, Array]:
        """(mean (1, q), transform (B or 1, q, p)): coefficients = mean + transform·η."""
        if self.root is not None and self.mean is not None:
            return self.mean[None, :], self.root[None, :, :]
        if self.fixed and "transform" in self._cache:
            matrix = self._cache["transform"]
        else:
            matrix = self._newton_transform(values)
            if self.fixed:
                self._cache["transform"] = matrix
        return np.zeros((1, matrix.shape[1])), matrix

    def _newton_transform(self, values: Values) -> Array:
        assert self.grid is not None
        levels, columns = self.grid[0], self._grid_shape
        index = np.arange(len(levels)) if self.law.name == "free" else np.full(len(levels), -1)
        h = self.law.basis(levels, index, values)
        # Columns of the whole grid in the block's order (term major, modulus minor).
        full = h[:, :, None, :, :] * columns[None, None, :, None, :]
        full = full.reshape(h.shape[0], len(levels) * len(columns), -1)
        norm = np.linalg.norm(full, axis=1, keepdims=True)
        norm[norm == 0.0] = 1.0
        R = np.asarray(np.linalg.qr(full / norm, mode="r"))
        p = full.shape[2]
        points = len(levels) * len(self.grid[1])
        alike = np.any(np.abs(np.diagonal(R, axis1=1, axis2=2)) < ALIKE, axis=1)
        R[alike] = np.eye(p)
        inverse = np.linalg.solve(R, np.broadcast_to(np.eye(p), R.shape))
        if alike.any():
            inverse[alike] = _orthogonal((full / norm)[alike])
        result: Array = self.scale * np.sqrt(points / p) * inverse / np.swapaxes(norm, 1, 2)
        return result

    @property
    def _grid_shape(self) -> Array:
        """Rows (≤ order, order) with the lengths and angles of the grid's contraction columns."""
        assert self.grid is not None
        if "grid" not in self._cache:
            self._cache["grid"] = np.asarray(np.linalg.qr(self.grid[1], mode="r"))
        return self._cache["grid"]

    def columns(
        self, pressure: Array, level: Ints, per_modulus: Array, gain: Array, values: Values
    ) -> tuple[Array, Columns]:
        """Force without the data's say and per coordinate: (B or 1, n), and :class:`Columns`.

        ``per_modulus`` (B or 1, n, order) is the force per unit of each modulus, ``gain`` (B or 1, n or 1) a
        factor on the bladder's stress.
        """
        mean, matrix = self.transform(values)
        columns = Columns(self.law.basis(pressure, level, values), per_modulus, gain, matrix)
        return columns.of(mean) if self.mean is not None else np.zeros((1, len(pressure))), columns

    def coefficients(self, eta: Array, values: Values) -> Array:
        """Coefficients (B, q) of coordinates (B, p)."""
        mean, matrix = self.transform(values)
        result: Array = mean + np.einsum(
            "bqp,bp->bq", np.broadcast_to(matrix, (len(eta), *matrix.shape[1:])), eta
        )
        return result
