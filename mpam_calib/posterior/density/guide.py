"""The guide: an estimate of the force, for what in a model depends on the force itself."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mpam_calib.posterior.likelihood.bins import LoopBins

Array = NDArray[np.float64]

PULL = 1e-6
"""Newtons that are enough to say which way a force acts."""


@dataclass(frozen=True)
class Guide:
    """A force estimate at the bins' Gauss points and at the points (N), and the slope there (N/m).

    ``nodes`` (N) is that at the bins' nodes, where white noise alone asks for a force that depends on itself.
    ``bin_echo``, ``node_echo`` and ``point_echo`` are how many times such a force feels a change there
    (:meth:`~mpam_calib.model.chain.Chain.echo`), None where nothing depends on it. ``bin_noise`` and
    ``point_noise`` (N) are where the sites of Student-t noise are settled. ``contradicted``: no curve falls
    to its free contraction as its first root, and such curves are not excluded.
    """

    bins: Array | None = None
    points: Array | None = None
    slope: Array | None = None
    bin_noise: Array | None = None
    point_noise: Array | None = None
    nodes: Array | None = None
    bin_echo: Array | None = None
    node_echo: Array | None = None
    point_echo: Array | None = None
    contradicted: bool = False

    @staticmethod
    def measured(bins: LoopBins | None) -> Guide:
        """The first estimate: the measured force, which may push. What a floor hides still pulls."""
        if bins is None:
            return Guide()
        force = np.where(bins.slack, np.maximum(bins.force, PULL), bins.force)
        return Guide(np.concatenate([force, force]))

    def at_nodes(self, bins: LoopBins) -> tuple[Array | None, Array | None]:
        """Force (3m,), N, and echo at the bins' nodes."""
        if self.nodes is not None:
            return self.nodes, self.node_echo
        # Between bins' means is near enough for signs, and until a model's own force is known.
        at_bins = (self.bins, self.bin_echo)
        force, echo = (bins.nodes.interpolate(x, bins.readings, bins.segment) for x in at_bins)
        return force, echo

    def of_bins_left(self, whole: LoopBins, left: LoopBins | None, level: int) -> Guide:
        """That of the bins that are left without a level; the measured force where they were bounded anew."""
        there, of_nodes = whole.readings.level != level, whole.nodes.readings.level != level
        if left is None or 2 * len(left) != int(there.sum()):
            measured = Guide.measured(left).bins
            return replace(self, bins=measured, bin_noise=None, nodes=None, bin_echo=None, node_echo=None)
        places = whole.nodes.readings.displacement[of_nodes], left.nodes.readings.displacement
        # Which strokes repeat each other, and share nodes, goes by the highest pressure that is left.
        same = np.array_equal(*places)
        return replace(
            self,
            bins=_part(self.bins, there),
            bin_noise=_part(self.bin_noise, there[: len(there) // 2]),
            nodes=_part(self.nodes, of_nodes) if same else None,
            bin_echo=_part(self.bin_echo, there),
            node_echo=_part(self.node_echo, of_nodes) if same else None,
        )

    def of_points(self, points: NDArray[np.bool_]) -> Guide:
        """That of some of the points."""
        return replace(
            self,
            points=_part(self.points, points),
            slope=_part(self.slope, points),
            point_noise=_part(self.point_noise, points),
            point_echo=_part(self.point_echo, points),
        )


def _part(of: Array | None, kept: NDArray[np.bool_]) -> Array | None:
    return None if of is None else of[kept]
