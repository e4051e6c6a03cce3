"""What binned loops add to the collapsed posterior, at the least cost that their noise allows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.model import Model
from mpam_calib.model.noise import CORRELATED, FREEDOM, GROWTH, TIME, WHITE
from mpam_calib.model.remainder import ROUGH, SMOOTH
from mpam_calib.posterior.density.added import Added, Values, fill, growth
from mpam_calib.posterior.density.guide import Guide
from mpam_calib.posterior.density.piece import Piece, forget, segment_piece
from mpam_calib.posterior.density.slack import Slack
from mpam_calib.posterior.likelihood.algebra import LOG_2PI
from mpam_calib.posterior.likelihood.bins import SLACK_ABOVE, LoopBins
from mpam_calib.posterior.likelihood.covariance import StrokeCovariance
from mpam_calib.posterior.likelihood.scatter import MarkovScatter
from mpam_calib.posterior.likelihood.sites import FreeRows, Sites, chunk_log_likelihood, usual_chunks
from mpam_calib.posterior.likelihood.strokes import Strokes
from mpam_calib.posterior.likelihood.white import white_terms

Array = NDArray[np.float64]


class _Noise(NamedTuple):
    """White and correlated sd (N), time constant (s), the strokes' own remainder (N), each (B,)."""

    white: Array
    correlated: Array
    time: Array
    rough: Array

    @staticmethod
    def of(values: Values) -> _Noise:
        """From the values (B, 1) by name, what the model lacks being none."""
        white = values[WHITE][:, 0]
        given = {CORRELATED: np.zeros_like(white), TIME: np.ones_like(white), ROUGH: np.zeros_like(white)}
        for name in given.keys() & values.keys():
            given[name] = values[name][:, 0]
        return _Noise(white, given[CORRELATED], given[TIME], given[ROUGH])

    @property
    def reading(self) -> tuple[Array, Array, Array]:
        """What the load cell adds: white and correlated sd, time constant."""
        return self.white, self.correlated, self.time


class _Uneven(NamedTuple):
    """Noise that differs from bin to bin: growth of its sd, its scale (N), each (B, n), and its sites."""

    growth: Array
    scale: Array
    sites: Sites


@dataclass(frozen=True)
class BinShare:
    """The share of a model's bins; ``floor`` in N."""

    model: Model
    bins: LoopBins
    guide: Guide
    floor: float

    def at(self, values: Values) -> Added:
        """What they add for values (B, 1) by name."""
        if self.white_only:
            return Added(self._of_rows(values))
        if self.strokes is not None:
            return Added(self._of_strokes(values, self.strokes))
        return self._of_any(values)

    @cached_property
    def white_only(self) -> bool:
        """Whether all bins have readings whose noise is white and of one size."""
        others = {GROWTH, FREEDOM, CORRELATED, ROUGH} & set(self.model.names)
        return not others and not bool(self.bins.slack.any())

    @cached_property
    def strokes(self) -> Strokes | None:
        """The bins, where their noise allows them to be taken as one."""
        names = self.model.names
        uneven = self.bins.slack.any() or GROWTH in names or FREEDOM in names
        if uneven or not (CORRELATED in names or ROUGH in names) or (steps := self._layout.steps) is None:
            return None
        return Strokes.build(self._layout, steps, self._remainder)

    @cached_property
    def _layout(self) -> StrokeCovariance:
        return StrokeCovariance.build(self.bins)

    @cached_property
    def _remainder(self) -> Array | None:
        return None if self.model.remainder is None else self.model.remainder.columns(self.bins.middle())

    def _of_rows(self, values: Values) -> Piece:
        """Without correlated noise and remainder: all rows count, at less cost."""
        assert self.model.chain is not None
        nodes = self.bins.nodes
        fixed, slope, linear, _ = self.model.chain.factored(values, nodes.readings, *self._node_guide)
        white = values[WHITE][:, 0]
        piece = white_terms(nodes, self.bins.averaged, fixed, slope, linear.every(), white)
        return Piece(*piece).widened(sum(self.model.linear_sizes))

    @cached_property
    def _node_guide(self) -> tuple[Array | None, Array | None]:
        """The guide's force (N) at the bins' nodes, and its echo there."""
        return self.guide.at_nodes(self.bins)

    def _of_strokes(self, values: Values, strokes: Strokes) -> Piece:
        """With noise that is Gaussian and alike in all bins: one pass along time."""
        assert self.model.chain is not None
        bins, noise = self.bins, _Noise.of(values)
        guide, echo = self.guide.bins, self.guide.bin_echo
        fixed, slope, linear, _ = self.model.chain.factored(values, bins.readings, guide, echo)
        columns = linear.every()
        n, B, p = len(bins), len(noise.white), columns.shape[-1]
        slope = 0.5 * np.broadcast_to(slope, (len(slope), 2 * n))
        known = np.empty((p + 1, B, n))
        for one, column in zip(known, np.moveaxis(columns, 2, 0), strict=False):
            np.multiply(slope[:, :n], column[:, :n], out=one)
            one += slope[:, n:] * column[:, n:]
        known[p] = bins.force - 0.5 * (fixed[:, :n] + fixed[:, n:])
        amplitude = values[SMOOTH][:, 0] if SMOOTH in values else np.zeros(B)
        full, log_det = strokes.products(strokes.factor(*noise), known, amplitude)
        constant = full[:, -1, -1] + log_det + n * LOG_2PI
        if self._markov_scatter is not None:
            constant = constant - 2.0 * self._markov_scatter.log_likelihood(*noise.reading)
        return Piece(full[:, :-1, :-1], full[:, :-1, -1], constant).widened(sum(self.model.linear_sizes))

    @cached_property
    def _markov_scatter(self) -> MarkovScatter | None:
        scatter = self.bins.scatter
        return None if scatter is None else MarkovScatter.build(scatter, self.bins.averaged)

    def _of_any(self, values: Values) -> Added:
        """With any noise, slack bins too: strokes are padded to one length, each with its own covariance."""
        assert self.model.chain is not None
        bins, layout, n = self.bins, self._layout, len(self.bins)
        terms = self.model.chain.terms(values, bins.readings, self.guide.bins, self.guide.bin_echo)
        fixed = 0.5 * (terms.fixed[:, :n] + terms.fixed[:, n:])
        columns = 0.5 * (terms.columns[:, :n] + terms.columns[:, n:])
        noise, uneven = _Noise.of(values), self._uneven(values)
        B = len(noise.white)
        residual = np.broadcast_to(bins.force - fixed, (B, n))
        if uneven is None:
            covariance, kind = layout.matrix(*noise), layout.kind
        else:
            residual = residual - uneven.scale * uneven.sites.shift
            covariance = layout.of_each(*noise, uneven.growth, uneven.sites.spread)
            kind = np.arange(bins.segments)
        padded = np.zeros((B, layout.pad.size, sum(self.model.linear_sizes) + 1))
        fill(self.model, padded, layout.place, values, columns, self._remainder)
        padded[:, layout.place, -1] = residual
        lost, slack, free = layout.pad, None, None
        if bins.slack.any():
            slack = self._slack(noise, fixed, padded[..., :-1])
            lost = lost | bins.slack[layout.index]
            covariance = forget(covariance[:, kind], lost)
            kind = np.arange(bins.segments)
            padded[:, lost.ravel()] = 0.0
        piece, weighted = segment_piece(covariance, kind, padded, int((~lost).sum()))
        if uneven is not None and FREEDOM in values:
            at = layout.index[~lost]
            seen = weighted[:, ~lost.ravel()]
            free = FreeRows(seen[..., :-1], seen[..., -1], uneven.scale[:, at], uneven.sites.take(at))
        if bins.scatter is not None:
            piece = piece._replace(constant=piece.constant - 2.0 * self._fast_noise(noise, uneven))
        return Added(piece, slack, free)

    def _uneven(self, values: Values) -> _Uneven | None:
        """How the noise differs from bin to bin; None where it does not."""
        if GROWTH not in values and FREEDOM not in values:
            return None
        dof = values[FREEDOM][:, 0] if FREEDOM in values else None
        # Grown by the guide's force, at first the measured one.
        at = self.guide.bins
        grows = growth(self.model, values, self.bins.force if at is None else at.reshape(2, -1).mean(axis=0))
        scale = values[WHITE] * grows / np.sqrt(self._layout.rows_of(self.bins) * self.bins.averaged)
        return _Uneven(grows, scale, Sites.at(self.guide.bin_noise, scale, dof))

    def _slack(self, noise: _Noise, fixed: Array, padded: Array) -> Slack:
        """The slack bins, their columns taken from those of all places in the padded layout."""
        bins, B = self.bins, len(noise.white)
        rows = bins.slack
        sd = np.sqrt(noise.white[:, None] ** 2 + noise.correlated[:, None] ** 2 + noise.rough[:, None] ** 2)
        # Slack readings stay within some sds of one above the floor; the force may be as high.
        floor = self.floor + SLACK_ABOVE * np.broadcast_to(noise.white[:, None], (B, int(rows.sum())))
        return Slack(
            np.broadcast_to(fixed, (B, len(bins)))[:, rows],
            padded[:, bins.segment[rows] * bins.width + bins.position[rows]],
            floor,
            np.broadcast_to(sd, floor.shape),
        )

    def _fast_noise(self, noise: _Noise, uneven: _Uneven | None) -> Array:
        """ln p (B,) of the scatter inside the bins."""
        scatter, chunks, averaged = self.bins.scatter, self.bins.chunks, self.bins.averaged
        assert scatter is not None and chunks is not None
        if uneven is None:
            return scatter.log_likelihood(averaged, *noise.reading)
        usual = self._usual_chunks
        covariance = scatter.covariance(averaged, *noise.reading)
        return chunk_log_likelihood(covariance, chunks.residuals[usual], uneven.growth[:, chunks.bin[usual]])

    @cached_property
    def _usual_chunks(self) -> NDArray[np.bool_]:
        """Chunks (c,) that tell the noise: bursts are left out where it has heavy tails."""
        chunks = self.bins.chunks
        assert chunks is not None
        if FREEDOM not in self.model.names:
            return np.ones(len(chunks.bin), dtype=bool)
        return usual_chunks(chunks.residuals, self.bins.force[chunks.bin])
