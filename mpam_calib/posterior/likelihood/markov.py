"""Covariances of Markov parts and a diagonal, factored and applied in one pass along time.

What readings share dies away from one to the next: for i < j
    C_ij = Σ_p e_pi e_pj Π decays from the end of i to the start of j,
and what a reading has in itself stands on the diagonal. Then C = L D Lᵀ with unit lower L, and both the
factor and L⁻¹ times any columns need only what each part carries from one reading to the next
(Foreman-Mackey, Agol, Ambikasaran and Angus 2017, doi:10.3847/1538-3881/aa9332, with readings that have a
length). Nothing is approximated. The first axis is time, so that a step is a whole array.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Parts(NamedTuple):
    """A covariance of m readings with P Markov parts, for any batch shape (...).

    ``own`` (m, ...): the diagonal C_jj. ``shared`` (m, P, ...): e_pj². ``within`` (m, P, ...): decay from
    the start to the end of reading j. ``onward`` (m, P, ...): decay from its end to the start of reading
    j + 1, times e_p,j+1 / e_pj; 0 where nothing follows.
    """

    own: Array
    shared: Array
    within: Array
    onward: Array


class Factor(NamedTuple):
    """L and D: ``carry``, ``gain`` (m, P, ...), and the sds ``deviation`` (m, ...) that D consists of."""

    carry: Array
    gain: Array
    deviation: Array

    def take(self, kind: NDArray[np.int64]) -> Factor:
        """The factors at places of the last axis."""
        return Factor(*(np.ascontiguousarray(array[..., kind]) for array in self))

    @property
    def log_determinant(self) -> Array:
        """ln|C| (...,)."""
        return np.asarray(2.0 * np.sum(np.log(self.deviation), axis=0))


def factor(parts: Parts) -> Factor:
    """L and D, with P² numbers of state."""
    own, shared, within, onward = parts
    carry = onward * within
    both = carry[:, :, None] * carry[:, None, :]
    gain, variance = np.empty_like(carry), np.empty_like(own)
    # What the readings so far explain of the parts at the next one's start.
    known = np.zeros(both.shape[1:])
    for j in range(len(own)):
        explained = np.add.reduce(known)
        np.subtract(own[j], np.add.reduce(explained), out=variance[j])
        explained *= within[j]
        np.subtract(shared[j], explained, out=explained)
        explained *= onward[j]
        np.divide(explained, variance[j], out=gain[j])
        known *= both[j]
        known += explained[:, None] * gain[j]
    with np.errstate(invalid="ignore"):
        return Factor(carry, gain, np.sqrt(variance))


def whiten(factor: Factor, columns: Array) -> None:
    """D^(−1/2) L⁻¹ times columns (m, c, ...), in place."""
    carry, gain = factor.carry[:, :, None], factor.gain[:, :, None]
    # What the parts are expected to be at the next reading's start.
    expected = np.zeros((carry.shape[1], *columns.shape[1:]))
    step = np.empty_like(expected)
    for j in range(len(columns)):
        for part in expected:
            columns[j] -= part
        np.multiply(gain[j], columns[j], out=step)
        expected *= carry[j]
        expected += step
    columns /= factor.deviation[:, None]
