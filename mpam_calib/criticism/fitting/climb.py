"""The climb to a hypothesis's mode: Levenberg-Marquardt on its sizes, the moduli exact given them.

All on the axes that whiten the problem's noise and remainder; both priors enter as pseudo-observations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import groupby

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from mpam_calib.criticism.data.problem import Problem
from mpam_calib.model.bend import is_bend
from mpam_calib.model.chain import Chain, Unsigned
from mpam_calib.model.priors import LongTailed, Normal, Parameter, Prior

Array = NDArray[np.float64]

STEP = 1e-4
ROUNDS = 25
CONVERGED, NEARLY, SHARE = 5e-3, 0.05, 1e-3
"""Where the next round promises fewer nats than the first (the second where that will do), or than this share
of what the fit leaves beyond twice the noise, the climb ends."""
KEPT = (0.25, 0.75)
"""Shares of the promise below which the damping grows, and above which it falls."""
RIDGE = 0.02
"""Least damping after a step that led downhill."""
NUDGE = 1e-4
"""Step of a force that depends on itself, as a share of the force scale."""
SETTLED = 0.02
"""Share of a reading's noise to which a force that depends on itself must have settled."""
FURTHEST, MOST_BENT = 7.0, 2.5
"""Largest coordinate (prior sds) of a size, and of a bend ..."""
FURTHEST_OUT = 12.0
"""... and of a size with a long tail: thirty-four of its scales."""
REACH = 1.5
"""Longest step of a coordinate, prior sds."""
SIGN_ROUNDS = 3
"""Rounds in which the signs of the force settle; those of a few readings next to zero need not."""
RUNAWAY = 10.0
"""Times the force scale that such a force may move at once before it is given up."""
DECEIVED = 0.5
"""Nats by which a climb may have been better off than with the force come to rest."""
HOPE, SHORT = 4.0, 30.0
"""Times its promise by which a climb may yet rise, and nats that it may then be short of what it is to reach:
what has fewer sizes need not fit as well."""
COARSE = 0.01
"""Share of the misfit below which the sizes have settled well enough to let them bend."""


def furthest_of(parameters: Sequence[Parameter]) -> Array:
    """Largest coordinate of each parameter, prior sds (d,)."""
    bounds = [
        MOST_BENT if is_bend(p.name) else FURTHEST_OUT if isinstance(p.prior, LongTailed) else FURTHEST
        for p in parameters
    ]
    return np.array(bounds, dtype=np.float64)


@dataclass(frozen=True)
class Place:
    """The force linearised at coordinates ``u`` (d,), with the linear ones ``eta`` (q,) at their optimum.

    ``residual`` (n,) and ``columns`` (n, q) are whitened, ``moved`` (n, d) is what a STEP of each size makes
    of the ``force`` (n,), N; ``guide`` (m,) is the force at the lean readings, where ``taken`` and ``pulls``
    are the signs of the muscle's own pull as it was taken and as it came out; ``objective`` is the log
    density up to a constant.
    """

    u: Array
    eta: Array
    residual: Array
    columns: Array
    moved: Array
    force: Array
    guide: Array
    taken: Array
    pulls: Array
    objective: float


@dataclass
class Climb:
    """A climb beside a remainder of SIZES[size]; ``extra`` (n, r), N, are further linear columns.

    One that has no hope to come near the objective ``rival`` is given up on its way; ``converged`` are the
    nats that the last round may still promise.
    """

    problem: Problem
    chain: Chain
    size: int
    extra: Array
    rival: float = -np.inf
    converged: float = CONVERGED
    _kept: tuple[Array, Unsigned] | None = field(default=None, init=False, repr=False)
    _sloped: tuple[Place, Array] | None = field(default=None, init=False, repr=False)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """What ``u`` stands for."""
        return tuple(p.name for p in self.chain.parameters)

    @cached_property
    def _by_level(self) -> int:
        """How many sizes, the first ones, move the force at one level each."""
        return self.chain.friction.by_level if np.all(self.problem.lean[0].level >= 0) else 0

    @cached_property
    def _moves(self) -> NDArray[np.intp]:
        """The move (d,) that each size takes part in: those at one level each share the first.

        No reading feels more than one of them (Curtis, Powell and Reid 1974).
        """
        return np.maximum(np.arange(len(self.names)) - max(self._by_level - 1, 0), 0)

    @cached_property
    def _offsets(self) -> Array:
        """Where the force is looked at: at the place itself and after each move, (1 + moves, d)."""
        d = len(self.names)
        offsets = np.zeros((1 + int(self._moves.max(initial=-1)) + 1, d))
        offsets[1 + self._moves, np.arange(d)] = STEP
        return offsets

    def _moved(self, force: Array) -> Array:
        """What a STEP of each size makes of the force (1 + moves, n) at the offsets, (n, d)."""
        moved = force[1:] - force[0]
        if self._by_level:
            readings, first, _ = self.problem.lean
            moved = moved[self._moves]
            moved[: self._by_level] *= readings.level[first] == np.arange(self._by_level)[:, None]
        return np.asarray(moved.T)

    @cached_property
    def _extra(self) -> Array:
        """The further columns, whitened."""
        return self.problem.white(self.extra, self.size)

    @cached_property
    def _alike(self) -> list[tuple[Callable[[Array], Array], slice]]:
        """What makes values of coordinates: once for neighbours that share a prior, or are normal."""
        priors = [p.prior for p in self.chain.parameters]
        found, end = [], 0
        for key, same in groupby(priors, key=lambda prior: Normal if isinstance(prior, Normal) else prior):
            run = list(same)
            start, end = end, end + len(run)
            found.append((_normals(run) if key is Normal else run[0].from_normal, slice(start, end)))
        return found

    def values(self, u: Array) -> dict[str, Array]:
        """Values (B, 1) for coordinates u (B, d)."""
        if not self.names:
            return {"": np.zeros((len(u), 1))}
        every = np.concatenate([of(u[:, alike]) for of, alike in self._alike], axis=1)
        return {name: every[:, i : i + 1] for i, name in enumerate(self.names)}

    def guide(self) -> Array:
        """The measured force at the lean readings: the first estimate of what depends on the force."""
        return self.problem.at_lean(self.problem.force)

    @np.errstate(over="ignore", invalid="ignore", divide="ignore")  # of shapes that no muscle has
    def look(self, u: Array, guide: Array, eta: Array) -> Place:
        """Linearise at u; ``eta`` (p,) serves where the force depends on itself.

        Where no muscle has such a shape the objective is -inf.
        """
        problem, p = self.problem, self.chain.linear_size
        _, first, second = problem.lean
        points, guides, nudge = u + self._offsets, guide, NUDGE * problem.force_scale
        if self.chain.uses_force:
            points = np.concatenate([points, points[:1]])
            guides = _nudged(guide, len(points), nudge)
        unsigned = self._unsigned(points, guides)
        fixed, slope, columns, beside = unsigned.pulling(guides)
        factor = np.ones(1)
        if self.chain.uses_force:
            # A force that depends on itself, F = f(F): one Newton step of its fixed point, for all at once.
            force = fixed + slope * columns.times(eta)
            factor = 1.0 / np.clip(1.0 - (force[-1] - force[0]) / nudge, 0.2, 5.0)

        def rows(lean: Array) -> Array:
            return 0.5 * (lean.take(first, axis=-1) + lean.take(second, axis=-1))

        here = guide + (fixed[0] - guide) * factor
        per_eta = rows(factor * slope[0] * columns.first().every()[0].T).T
        known = problem.force - (rows(here) + problem.bow)
        white = problem.white(np.concatenate([known[:, None], per_eta], axis=1), self.size)
        X = np.concatenate([white[:, 1:], self._extra], axis=1)
        # Given the sizes, the linear coordinates' optimum is exact.
        best = _solve(plus_one(X.T @ X), X.T @ white[:, 0])
        residual = white[:, 0] - X @ best
        force = fixed + slope * columns.times(best[:p])
        if self.chain.uses_force:
            force = guide + (force - guide) * factor
        if len(force) == 1:  # alike for all
            force = np.broadcast_to(force, points.shape[:1] + force.shape[1:])
        force = force[: len(self._offsets)]
        whole = rows(force) + problem.bow
        taken = np.sign(guide - beside[0])
        # Where no friction asks which way the muscle pulls, and nothing feeds on the force, any sign will do.
        matters = unsigned.signed or self.chain.uses_force
        objective = -0.5 * float(residual @ residual + u @ u + best @ best)
        return Place(
            u=u,
            eta=best,
            residual=residual,
            columns=X,
            moved=self._moved(whole),
            force=whole[0],
            guide=force[0],
            taken=taken,
            pulls=np.sign(force[0] - beside[0]) if matters else taken,
            objective=objective if np.isfinite(objective) else -np.inf,
        )

    def _unsigned(self, points: Array, guide: Array) -> Unsigned:
        """The force at points (B, d): kept, as most places are looked at once more with other signs."""
        if self.chain.uses_force or self._kept is None or not np.array_equal(points, self._kept[0]):
            self._kept = points, self.chain.unsigned(self.values(points), self.problem.lean[0], guide)
        return self._kept[1]

    def slopes(self, place: Place) -> Array:
        """Whitened changes of the force with all coordinates, (n, d + q); the last ones are kept."""
        if self._sloped is None or self._sloped[0] is not place:
            white = self.problem.white(place.moved / STEP, self.size)
            self._sloped = place, np.concatenate([white, place.columns], axis=1)
        return self._sloped[1]

    @cached_property
    def _still(self) -> float:
        """Newtons to which a force that depends on itself must have settled."""
        return SETTLED * self.problem.noise_level.total

    def look_with_its_signs(self, u: Array, guide: Array, eta: Array) -> Place:
        """:meth:`look` with friction against the muscle's own pull, not against that of the last estimate.

        A place that looked better with the signs of another one would never be left again.
        """
        first = place = self.look(u, guide, eta)
        for _round in range(SIGN_ROUNDS - 1):
            if np.array_equal(place.pulls, place.taken):
                break
            place = self.look(u, place.guide, place.eta[: self.chain.linear_size])
            if not self.chain.uses_force and np.array_equal(place.pulls, first.taken):
                return first  # where these signs lead back to
        return place

    def look_at_rest(self, u: Array, guide: Array, eta: Array) -> Place:
        """:meth:`look` with a force that depends on itself come to rest, as predictions solve for it.

        Where it never does the objective is -inf: a specimen that pulls the harder the more it contracts
        has no equilibrium with a fixture that is soft enough.
        """
        for _round in range(ROUNDS):
            place = self.look(u, guide, eta)
            gap = float(np.abs(place.guide - guide).max())
            if gap <= self._still:
                return place
            if not gap < RUNAWAY * self.problem.force_scale:
                break
            guide, eta = place.guide, place.eta[: self.chain.linear_size]
        return replace(place, objective=-np.inf)

    def climb(self, u: Array, guide: Array, eta: Array) -> Place:
        """The mode that is reached from u (d,).

        Raises ``numpy.linalg.LinAlgError`` where a force that depends on itself has no equilibrium.
        """
        best = self._ascend(u, guide, eta, self.look_with_its_signs)
        if not self.chain.uses_force:
            return best
        # One step of the fixed point is cheap, but may look better than the force it leads to.
        rest = self.look_at_rest(best.u, best.guide, best.eta[: self.chain.linear_size])
        if rest.objective < best.objective - DECEIVED:
            rest = self._ascend(u, guide, eta, self.look_at_rest)
        if not np.isfinite(rest.objective):
            raise np.linalg.LinAlgError("a force that depends on itself does not come to rest")
        return rest

    def _ascend(
        self, u: Array, guide: Array, eta: Array, look: Callable[[Array, Array, Array], Place]
    ) -> Place:
        d = len(u)
        bends = np.array([is_bend(name) for name in self.names], dtype=bool)
        furthest = furthest_of(self.chain.parameters)
        released = not bends.any() or bool(np.any(u[bends] != 0.0))
        best: Place | None = None
        hessian, gradient = np.empty((0, 0)), np.empty(0)
        damping, promise, shortened = 1e-3, 0.0, False
        for _round in range(ROUNDS):
            place = look(u, guide, eta)
            if best is None and not np.isfinite(place.objective):
                return place
            if best is None or place.objective > best.objective:
                waiting = self.chain.uses_force and float(np.abs(place.guide - guide).max()) > self._still
                kept = 1.0
                if best is not None and not shortened:
                    kept = (place.objective - best.objective) / max(promise, 1e-12)
                damping *= 4.0 if kept < KEPT[0] else 0.2 if kept > KEPT[1] else 1.0
                damping = max(damping, 1e-6)
                best, J = place, self.slopes(place)
                hessian = plus_one(J.T @ J)
                gradient = J.T @ best.residual - np.concatenate([best.u, best.eta])
            else:
                waiting = False
                damping = max(8.0 * damping, RIDGE)
                if damping > 1e4:
                    break
            # What depends on the force is fed with the model's own.
            guide, eta = best.guide, best.eta[: self.chain.linear_size]
            misfit = float(best.residual @ best.residual)
            stuck = (np.abs(best.u) >= furthest) & (best.u * gradient[:d] >= 0.0)
            if not released:
                stuck |= bends
            step = _damped(hessian, gradient, damping, stuck)
            promise = 0.5 * float(step @ gradient)
            if released and damping < RIDGE and best.objective + HOPE * promise < self.rival - SHORT:
                break
            left = misfit - 2.0 * len(self.problem)
            if d == 0 or (promise < max(self.converged, SHARE * left) and not waiting and released):
                break
            # Sizes first: the bend of a size near zero says nothing and wanders off.
            released = released or promise < COARSE * misfit
            shortened = float(np.abs(step[:d]).max(initial=0.0)) > REACH
            step *= min(1.0, REACH / float(np.abs(step[:d]).max(initial=1e-9)))
            u = np.clip(best.u + step[:d], -furthest, furthest)
        assert best is not None
        return best


def _normals(priors: Sequence[Prior]) -> Callable[[Array], Array]:
    """Values (B, k) of the coordinates (B, k) of normal priors."""
    origin = np.zeros(1)
    mean = np.concatenate([prior.from_normal(origin) for prior in priors])
    sd = np.array([prior.sd for prior in priors])
    return lambda u: mean + sd * u


def plus_one(matrix: Array) -> Array:
    """The matrix (k, k), to which the prior's is added in place."""
    matrix.flat[:: len(matrix) + 1] += 1.0
    return matrix


def _damped(hessian: Array, gradient: Array, damping: float, stuck: NDArray[np.bool_]) -> Array:
    """Levenberg's and Marquardt's step (k,), without the first coordinates where they are ``stuck`` (d,)."""
    damped, right = hessian.copy(), gradient
    damped.flat[:: len(damped) + 1] *= 1.0 + damping
    if stuck.any():
        held = np.flatnonzero(stuck)
        damped[held], damped[:, held], damped[held, held] = 0.0, 0.0, 1.0
        right = gradient.copy()
        right[held] = 0.0
    return _solve(damped, right)


def _solve(matrix: Array, right: Array) -> Array:
    """x (k,) of matrix (k, k, positive definite)·x = right; LAPACK's own routine: most of the rest is checks.

    Raises ``numpy.linalg.LinAlgError`` where the matrix is not positive definite.
    """
    if not len(right):
        return np.zeros(0)
    _, found, info = lapack.dposv(matrix, right)
    if info != 0:
        raise np.linalg.LinAlgError("a climb's matrix is not positive definite")
    return np.asarray(found)


def _nudged(guide: Array, copies: int, nudge: float) -> Array:
    """The guide (m,) for every row of a batch (copies, m), the last one moved."""
    rows = np.repeat(guide[None, :], copies, axis=0)
    rows[-1] += nudge
    return rows
