"""Laplace's approximation to its next term, which also tells where it may be believed.

In coordinates z that make the Gaussian at the mode a standard normal one, with f = ln p and its derivatives
there (Tierney and Kadane 1986; Shun and McCullagh 1995, eq. 6),
    ln ∫ p = Laplace + (1/8) Σ f_iijj + (1/8) Σ_k (Σ_i f_iik)² + (1/12) Σ f_ijk².
Six parameters whose sizes lie six standard deviations above 0 cost Laplace's figure 0.03 nats: these terms.
Where they are large the density is bent, or a bound is near, and a rule has to integrate it.
"""

from __future__ import annotations

from itertools import combinations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mpam_calib.posterior.density.mode import Density, Mode, evaluate

Array = NDArray[np.float64]

STEP = 0.5
"""Standard deviations over which differences are taken."""
TAME = 0.04
"""Nats of both terms together up to which those after them do not count."""


class Expansion(NamedTuple):
    """Laplace's log evidence at the top, and the terms of the fourth and the third derivatives, nats."""

    laplace: float
    fourth: float
    third: float

    @property
    def value(self) -> float:
        """Log evidence, nats."""
        return self.laplace + self.fourth + self.third

    @property
    def error(self) -> float:
        """Half of both terms' sizes: what the terms after them stayed below wherever these are tame."""
        return 0.5 * (abs(self.fourth) + abs(self.third))

    @property
    def tame(self) -> bool:
        """Whether those after these terms do not count; never where they are not finite."""
        return abs(self.fourth) + abs(self.third) <= TAME


def expand(density: Density, mode: Mode) -> Expansion:
    """The expansion at a mode of the density, from differences along the axes of the mode's covariance.

    Takes 1 + 4 d + 2 d (d − 1) + (4/3) d (d − 1) (d − 2) evaluations of the density: 245 for six parameters.
    """
    d, h = len(mode.u), STEP
    if d == 0:
        return Expansion(mode.log_evidence, 0.0, 0.0)
    e = np.eye(d)
    pairs, triples = (np.array(list(combinations(range(d), k)), dtype=int).reshape(-1, k) for k in (2, 3))
    two, three = (np.array(list(product((1.0, -1.0), repeat=k))) for k in (2, 3))
    at_pairs = np.einsum("sk,pkd->spd", two, e[pairs]).reshape(-1, d)
    at_triples = np.einsum("sk,pkd->spd", three, e[triples]).reshape(-1, d)
    offsets = np.concatenate([np.zeros((1, d)), e, -e, 2.0 * e, -2.0 * e, at_pairs, at_triples])
    f = evaluate(density, mode.u + h * offsets @ np.linalg.cholesky(mode.covariance).T)
    top, near, far = f[0], f[1 : 2 * d + 1].reshape(2, d), f[2 * d + 1 : 4 * d + 1].reshape(2, d)
    corners = f[4 * d + 1 :][: len(at_pairs)].reshape(4, -1)
    last = f[4 * d + 1 + len(at_pairs) :].reshape(8, -1)
    (i, j), (up, down) = pairs.T, near
    if not np.all(np.isfinite(f)):
        return Expansion(mode.log_evidence, np.inf, np.inf)
    iiii = (far.sum(axis=0) - 4.0 * near.sum(axis=0) + 6.0 * top) / h**4
    iijj = (corners.sum(axis=0) - 2.0 * (up + down)[i] - 2.0 * (up + down)[j] + 4.0 * top) / h**4
    iii = (far[0] - far[1] - 2.0 * (up - down)) / (2.0 * h**3)
    # Signs of `two` are (+, +), (+, -), (-, +), (-, -): the slope along one axis of the bend along the other.
    iij = (corners[0] + corners[2] - corners[1] - corners[3] - 2.0 * (up - down)[j]) / (2.0 * h**3)
    ijj = (corners[0] + corners[1] - corners[2] - corners[3] - 2.0 * (up - down)[i]) / (2.0 * h**3)
    ijk = three.prod(axis=1) @ last / (8.0 * h**3)
    along = iii + np.bincount(j, iij, d) + np.bincount(i, ijj, d)
    every = np.sum(iii**2) + 3.0 * (np.sum(iij**2) + np.sum(ijj**2)) + 6.0 * np.sum(ijk**2)
    # The mode is not quite the top (its slope adds ½ Σ f_k f_iik), and its covariance comes from wider
    # differences: Laplace's figure anew.
    slope = (8.0 * (up - down) - (far[0] - far[1])) / (12.0 * h)
    bend = np.diag((16.0 * near.sum(axis=0) - far.sum(axis=0) - 30.0 * top) / (12.0 * h**2))
    bend[i, j] = bend[j, i] = (corners[0] - corners[1] - corners[2] + corners[3]) / (4.0 * h**2)
    precision, axes = np.linalg.eigh(-bend)
    if precision[0] <= 0.0:
        return Expansion(mode.log_evidence, np.inf, np.inf)
    laplace = top + 0.5 * (d * np.log(2.0 * np.pi) + np.linalg.slogdet(mode.covariance)[1])
    laplace += 0.5 * np.sum((slope @ axes) ** 2 / precision - np.log(precision))
    fourth = np.sum(iiii) / 8.0 + np.sum(iijj) / 4.0
    third = 0.5 * slope @ along + np.sum(along**2) / 8.0 + every / 12.0
    return Expansion(float(laplace), float(fourth), float(third))
