"""Where the climbs for a law's rates start: what moduli free at each level say of them.

A law of pressure only ties the moduli of the levels to each other. Near its mode the model with moduli free
at each level is a Gaussian in its sizes u and moduli E. Put E = H(ρ) c, a law with rates ρ, into it: u and c
have their optimum at once, and a density of the rates alone is left, cheap enough for many climbs side by
side. Sums of exponentials have many modes; a model's fit climbs the last stretch from the best of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, qmc

from mpam_calib.criticism.fitting.fit import Fit
from mpam_calib.model.chain import Chain
from mpam_calib.model.moduli import ModuliBlock, rate_names

Array = NDArray[np.float64]

DRAWS, SHARED_DRAWS = 16, 8
"""Starts drawn from the priors: rates of each modulus's own, and rates that all moduli share."""
HEATS, LAST = ((8, 5), (3, 15)), ((2, 40),)
"""How many climbs each heat goes on with at most, and its rounds at most; and those of the last one."""
HOPS = (-1.2, 0.0, 1.2)
"""Coordinates to which both rates of one modulus hop from the best climb's end, the others kept."""
MOST_HOPS, GAIN = 6, 0.3
"""Times that all moduli hop at most, and nats gained below which they stop."""
SETTLED = 0.01
"""Nats promised by the next round below which a climb has ended."""
FURTHEST, LONGEST, STEP = 5.0, 1.0, 1e-4
"""Largest coordinate of a rate, longest step and step of differences, prior sds."""
KNOWN = 1e-9
"""Share of the largest information above which a direction is known at all."""


@dataclass(frozen=True)
class Place:
    """Climbs at rates (B, r), all else at its optimum: coordinates (B, p) that columns (B, s, p) belong to.

    ``residual`` (B, s) is whitened, ``slopes`` (B, s, r) are its changes with the rates at fixed coordinates;
    ``objective`` (B,) is the log density of all coordinates up to a constant.
    """

    rates: Array
    columns: Array
    coordinates: Array
    residual: Array
    slopes: Array
    objective: Array

    def take(self, better: NDArray[np.bool_], other: Place) -> Place:
        """The other's climbs where these (B,) are better."""
        mixed = (
            np.where(better.reshape(-1, *[1] * (new.ndim - 1)), new, old)
            for new, old in zip(vars(other).values(), vars(self).values(), strict=True)
        )
        return Place(*mixed)


@dataclass(frozen=True)
class Rates:
    """The rates of ``law`` given a ``fit`` of the model that is the same but ``free`` at each level."""

    law: Chain
    free: Chain
    fit: Fit

    @cached_property
    def names(self) -> list[str]:
        """The rates as they are sampled (standard normal coordinates): d and gap by turns."""
        simulation = self.law.setting.simulation
        return rate_names(simulation.law, simulation.order)

    @cached_property
    def seen(self) -> tuple[Array, Array]:
        """Whitened columns (s, d + L·order) of sizes and free moduli, and the data (s,); without priors."""
        mode = np.concatenate([self.fit.u, self.fit.eta])
        precision = np.linalg.inv(self.fit.covariance)
        size, turn = np.linalg.eigh(precision - np.eye(len(mode)))
        kept = size > KNOWN * size[-1]
        root, turn = np.sqrt(size[kept]), turn[:, kept].T
        columns = root[:, None] * turn
        d = len(self.fit.u)
        columns[:, d:] = columns[:, d:] @ np.linalg.inv(_block(self.free).transform({})[1][0])
        return columns, (turn @ (precision @ mode)) / root

    @cached_property
    def offset(self) -> float:
        """What log densities here (and half log determinants) lack of the fit's log evidence, nats."""
        seen, data = self.seen
        coefficients = _block(self.free).coefficients(self.fit.eta[None], {})[0]
        residual = data - seen @ np.concatenate([self.fit.u, coefficients])
        height = -0.5 * float(residual @ residual + self.fit.u @ self.fit.u + self.fit.eta @ self.fit.eta)
        return self.fit.log_evidence - height - 0.5 * float(np.linalg.slogdet(self.fit.covariance)[1])

    def look(self, rates: Array) -> Place:
        """All else at its optimum for rates (B, r), and how that changes with them."""
        block, (seen, data), d = _block(self.law), self.seen, len(self.fit.u)
        B, levels, order = len(rates), block.law.levels, block.law.order
        values, pace = self._values(rates)
        h, by, moduli = self._tied(B, values)
        X = np.concatenate([np.broadcast_to(seen[:, :d], (B, len(seen), d)), seen[:, d:] @ moduli], axis=2)
        across = np.swapaxes(X, 1, 2)
        best = np.linalg.solve(across @ X + np.eye(X.shape[2]), (across @ data)[..., None])[..., 0]
        residual = data - (X @ best[..., None])[..., 0]
        # E = c exp(dP) + w exp((d - gap)P): dE/dd = PE and dE/dgap = -Pw exp((d - gap)P) at every level P.
        parts = h * np.einsum("bakp,bp->bak", by, best[:, d:])[:, None]
        change = np.stack([parts.sum(axis=2), -parts[:, :, 1]], axis=-1)
        change *= levels[None, :, None, None] * pace[:, None]
        slopes = np.einsum("slk,blkj->bskj", seen[:, d:].reshape(len(seen), len(levels), order), change)
        if len(self.names) < 2 * order:
            slopes = slopes.sum(axis=2, keepdims=True)
        quadratic = sum(np.sum(part**2, axis=1) for part in (residual, best, rates))
        return Place(
            rates, X, best, residual, slopes.reshape(B, len(seen), len(self.names)), -0.5 * quadratic
        )

    def moduli(self, rates: Array) -> Array:
        """The moduli at the levels for unit coordinates of the law, (B, L·order, p)."""
        return self._tied(len(rates), self._values(rates)[0])[2]

    def _tied(self, B: int, values: dict[str, Array]) -> tuple[Array, Array, Array]:
        """The law's functions h (B or 1, L, 2, order or 1), its transform by modulus, and both together."""
        law = _block(self.law).law
        h = law.basis(law.levels, np.full(len(law.levels), -1), values)
        by = _block(self.law).transform(values)[1].reshape(B, 2, law.order, -1)
        every = np.broadcast_to(h, (B, len(law.levels), 2, law.order))
        moduli = np.einsum("blak,bakp->blkp", every, by)
        return h, by, moduli.reshape(B, len(law.levels) * law.order, -1)

    def _values(self, rates: Array) -> tuple[dict[str, Array], Array]:
        """Values (B, 1) by name, and their change (B, order or 1, 2) with the coordinates."""
        priors = {p.name: p.prior for p in self.law.parameters}
        near = rates + STEP * np.array([-1.0, 0.0, 1.0])[:, None, None]
        found = np.empty_like(near)
        for j in range(2):  # one prior for each kind of rate
            found[..., j::2] = priors[self.names[j]].from_normal(near[..., j::2])
        pace = (found[2] - found[0]) / (2.0 * STEP)
        return dict(zip(self.names, found[1].T[..., None], strict=True)), pace.reshape(len(rates), -1, 2)

    def draws(self, count: int, seed: int) -> Array:
        """Starts (n, r) from the priors: rates that all moduli share, and ``count`` of each one's own."""
        moduli = len(self.names) // 2
        shared = np.tile(_normal(2, SHARED_DRAWS, seed), moduli)
        return np.concatenate([shared, _normal(2 * moduli, count if moduli > 1 else 0, seed)])

    def start(self, rates: Array) -> dict[str, float]:
        """Coordinates of all sizes for these rates (r,), by name."""
        sizes = self.look(rates[None]).coordinates[0, : len(self.fit.u)]
        return dict(zip([*self.fit.names, *self.names], [*sizes.tolist(), *rates.tolist()], strict=True))


def find_rates(target: Rates, known: Array | None, worth: float, seed: int = 0) -> Array:
    """Rates (k, r), best first: ends of climbs from ``known`` rates (n, r) and from draws of the priors.

    Where the best end's evidence is ``worth`` more, one modulus after the other hops to other rates, as long
    as climbs from there lead to better modes: these are mostly modes of single moduli.
    """
    alone = len(target.names) > 2 and worth < np.inf
    starts = [] if known is None else [known]
    if known is None or alone:
        starts.append(target.draws(DRAWS if alone else 0, seed))
    best, reached = _heats(target, np.concatenate(starts), HEATS)
    for _ in range(MOST_HOPS if alone else 0):
        before = reached
        if before < worth:
            break
        best, reached = _heats(target, np.concatenate([best, _hopped(best[0])]), HEATS)
        if reached < before + GAIN:
            break
    return _heats(target, best, LAST)[0] if worth < np.inf else best


def _hopped(rates: Array) -> Array:
    """The rates (r,) with those of one modulus replaced, (r/2·|HOPS|², r)."""
    moduli, pairs = len(rates) // 2, np.stack(np.meshgrid(HOPS, HOPS), axis=-1).reshape(-1, 2)
    result = np.tile(rates, (moduli, len(pairs), 1))
    for k in range(moduli):
        result[k, :, 2 * k : 2 * k + 2] = pairs
    return result.reshape(-1, len(rates))


def _heats(target: Rates, starts: Array, heats: tuple[tuple[int, int], ...]) -> tuple[Array, float]:
    """Ends of the best climbs, and about the evidence (nats) of the first; most evidence comes first.

    A mode's evidence is its height and its width; the highest modes are often the narrowest.
    """
    reached = -np.inf
    for keep, rounds in heats:
        place = _climb(target, starts, rounds)
        gram, hessian, _ = _curved(place)
        evidence = place.objective - 0.5 * (np.linalg.slogdet(gram)[1] + np.linalg.slogdet(hessian)[1])
        order = np.argsort(-evidence, kind="stable")[:keep]
        starts, reached = place.rates[order], target.offset + float(evidence[order[0]])
    return starts, reached


def _climb(target: Rates, start: Array, rounds: int) -> Place:
    """Levenberg-Marquardt for all starts at once, all else at its optimum (Kaufman 1975).

    doi:10.1007/BF01932995
    """
    best = target.look(start)
    damping = np.full(len(start), 1e-2)
    for _ in range(rounds):
        _, hessian, gradient = _curved(best)
        diagonal = np.einsum("bii->bi", hessian)
        hessian = hessian + (damping[:, None] * diagonal)[:, :, None] * np.eye(hessian.shape[2])
        step = np.linalg.solve(hessian, gradient[..., None])[..., 0]
        if np.all(0.5 * np.sum(step * gradient, axis=1) < SETTLED):
            break
        step *= np.minimum(1.0, LONGEST / np.maximum(np.abs(step).max(axis=1, keepdims=True), 1e-12))
        tried = target.look(np.clip(best.rates + step, -FURTHEST, FURTHEST))
        better = tried.objective > best.objective
        damping = np.clip(np.where(better, 0.3 * damping, 5.0 * damping), 1e-6, 1e6)
        best = best.take(better, tried)
    return best


def _curved(place: Place) -> tuple[Array, Array, Array]:
    """Information on all else (B, p, p), on the rates beside it (B, r, r), and their gradient (B, r)."""
    X, slopes = place.columns, place.slopes
    across, down = np.swapaxes(X, 1, 2), np.swapaxes(slopes, 1, 2)
    gram = across @ X + np.eye(X.shape[2])
    # What the rest, at its optimum, leaves of the slopes.
    left = slopes - X @ np.linalg.solve(gram, across @ slopes)
    gradient = (down @ place.residual[..., None])[..., 0] - place.rates
    return gram, down @ left + np.eye(slopes.shape[2]), gradient


def _normal(dimensions: int, count: int, seed: int) -> Array:
    """Quasi-random standard normal points (count, dimensions)."""
    return np.asarray(norm.ppf(qmc.Sobol(dimensions, rng=np.random.default_rng(seed)).random(count)))


def _block(chain: Chain) -> ModuliBlock:
    assert chain.moduli is not None
    return chain.moduli
