"""An oracle that knows the true forms: the evidence of every set of up to three effects.

Gaussian likelihood with the true noise (white + exponentially correlated), priors N(0, (2 units)^2) on effect
sizes (half of it for effects of one sign; braid_kinematics is on or off), the declared prior on tensile
moduli, wide ones on friction and free moduli; every set equally probable. Laplace at the mode:
log Z = -chi2/2 - theta' Lambda theta / 2 + logdet(Lambda)/2 - logdet(J'J + Lambda)/2.
All sets are scored by one linearisation (at the null fit, and at the fit of the true set); the leaders of
both are refitted exactly by Gauss-Newton. A case is separable when the true set leads every set that lacks
one of its effects by 10 nats; sets that only add to the truth lose by their priors alone, and by less.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from .case import Recording
from .chain import Form, force_of
from .effects import IDS, form, shared_form
from .muscle import Array
from .nuisance import nuisance_of
from .protocol import Protocol, noise_sd

Key = tuple[str, ...]


class Whitener:
    """Inverse Cholesky factors of the noise covariance, in blocks of at most 400 rows."""

    def __init__(self, p: Protocol, time: Array) -> None:
        self.parts: list[tuple[slice, Array]] = []
        for start in range(0, time.size, 400):
            part = slice(start, min(start + 400, time.size))
            lag = np.abs(time[part, None] - time[None, part])
            covariance = p.correlated_N**2 * np.exp(-lag / p.correlation_s)
            covariance[np.diag_indices_from(covariance)] += p.noise_N**2
            self.parts.append((part, np.linalg.inv(np.linalg.cholesky(covariance))))

    def __call__(self, values: Array) -> Array:
        return np.concatenate([factor @ values[part] for part, factor in self.parts])


@dataclass(frozen=True)
class Fit:
    """A refit of one set: log evidence, sizes (contract units), free numbers, predicted force [N]."""

    ids: Key
    log_evidence: float
    sizes: dict[str, float]
    free: Array
    force: Array


@dataclass(frozen=True)
class Verdict:
    """`margin`: lead over sets lacking a true effect; `superset_margin`: over sets that only add to it."""

    truth: Key
    margin: float
    rival: Key
    superset_margin: float
    fits: dict[Key, Fit]

    @property
    def separable(self) -> bool:
        return self.margin >= 10.0


def candidates(recording: Recording) -> list[Form]:
    """The forms in play: the hidden ones as hidden, the textbook form of every other testable effect."""
    case, rows = recording.case, recording.rows
    sim, hidden = case.muscle.simulation, {h.id: h.form for h in case.hidden}
    rubbing = sim.friction != "none" or {"coulomb_friction", "strand_friction"} & hidden.keys()
    ruled_out = {
        "braid_kinematics": sim.kinematics != "constant_thickness",
        "strand_friction": sim.friction == "strand" or case.muscle.braid is None,
        "coulomb_friction": sim.friction == "coulomb",
        "braid_stretch": case.muscle.braid is None,
        "rate_friction": not rubbing or np.unique(rows.nominal_speed).size < 2,
        "presliding": not rubbing,
        "stress_softening": rows.cycle.max() < 2,
        "law_shape": sim.source == "loops" and sim.law.name == "free",
    }
    return [form(i, hidden[i]) if i in hidden else shared_form(i) for i in IDS if not ruled_out.get(i, False)]


class Oracle:
    """Fits sets of effects to one recording; `keep` restricts the rows fitted (predictions cover all)."""

    def __init__(self, recording: Recording, keep: Array | None = None) -> None:
        self.recording, self.rows = recording, recording.rows
        case = recording.case
        self.keep = np.ones(self.rows.count, dtype=bool) if keep is None else keep.astype(bool)
        self.forms = {f.id: f for f in candidates(recording)}
        self.nuisance = nuisance_of(case.muscle, self.rows, noise_sd(case.protocol))
        self.units = {i: f.unit(case.muscle, self.rows) for i, f in self.forms.items()}
        self.strides = {i: self._stride(i) for i in self.forms}
        self.white = Whitener(case.protocol, self.rows.time[self.keep])
        self.target = self.white(recording.force[self.keep])

    def force(self, sizes: dict[str, float], free: Array) -> Array:
        """Predicted force [N] for all rows, from the pressure as read."""
        case = self.recording.case
        effects = [(self.forms[i], s) for i, s in sizes.items() if s != 0.0]
        out = force_of(self.nuisance.apply(free), self.rows, effects, self.rows.reading, case.seed)
        return out if case.protocol.floor_N is None else np.maximum(out, case.protocol.floor_N)

    def _stride(self, effect: str) -> float:
        """The unit, or less where a unit changes the force by over 20 noise sds (cancelling free moduli)."""
        noise = noise_sd(self.recording.case.protocol)
        free = np.zeros(self.nuisance.count)
        change = self.force({effect: self.units[effect]}, free) - self.force({}, free)
        rms = float(np.sqrt(np.mean(change**2)))
        return self.units[effect] * min(1.0, 20.0 * noise / max(rms, 1e-12))

    def _prior_sd(self, ids: Key) -> Array:
        return np.array([1.0 if i == "braid_kinematics" else 2.0 * self.units[i] for i in ids])

    def _jacobian(self, sizes: dict[str, float], free: Array, base: Array, ids: Key, step: float) -> Array:
        """Whitened forward differences in the free numbers, then in the sizes of `ids`."""
        out = np.empty((int(self.keep.sum()), self.nuisance.count + len(ids)))
        for j in range(self.nuisance.count):
            moved = free.copy()
            moved[j] += self.nuisance.step[j]
            out[:, j] = (self.force(sizes, moved) - base)[self.keep] / self.nuisance.step[j]
        for j, i in enumerate(ids):
            at = sizes.get(i, 0.0)
            change = 1.0 if i == "braid_kinematics" else step * self.strides[i]
            if i == "braid_kinematics" and at == 1.0:
                change = -1.0
            difference = self.force({**sizes, i: at + change}, free) - base
            out[:, self.nuisance.count + j] = difference[self.keep] / change
        return self.white(out)

    def _objective(self, base: Array, sizes: dict[str, float], free: Array, ids: Key) -> float:
        residual = self.target - self.white(base[self.keep])
        value = -0.5 * float(residual @ residual) - 0.5 * float(np.sum((free / self.nuisance.sd) ** 2))
        sd = self._prior_sd(ids)
        return value - 0.5 * sum((sizes[i] / s) ** 2 for i, s in zip(ids, sd, strict=True))

    def fit(
        self, ids: Key, start: dict[str, float] | None = None, free: Array | None = None, steps: int = 12
    ) -> Fit:
        """Exact refit of one set by damped Gauss-Newton and its Laplace evidence."""
        ids = tuple(sorted(ids))
        fixed = {i: 1.0 for i in ids if i == "braid_kinematics"}
        moving = tuple(i for i in ids if i not in fixed)
        known = start or {}
        sizes = {i: self._allowed(i, known.get(i, self._beginning(i))) for i in moving} | fixed
        free = np.zeros(self.nuisance.count) if free is None else free.copy()
        base = self.force(sizes, free)
        value = self._objective(base, sizes, free, moving)
        sd = np.concatenate([self.nuisance.sd, self._prior_sd(moving)])
        for _ in range(steps):
            jacobian = self._jacobian(sizes, free, base, moving, 0.02)
            at = np.concatenate([free, [sizes[i] for i in moving]])
            scaled = jacobian * sd
            normal = scaled.T @ scaled + np.eye(sd.size)
            residual = self.target - self.white(base[self.keep])
            gain = 0.0
            # Full step first, then shorter ones bent to the gradient (Levenberg-Marquardt).
            for ridge in (0.0, 0.03, 0.3, 3.0, 30.0, 300.0):
                bent = normal + ridge * np.diag(np.diag(normal))
                new = at + self._step(bent, scaled.T @ residual - at / sd, at / sd, moving) * sd
                trial = {
                    i: self._allowed(i, v) for i, v in zip(moving, new[free.size :], strict=True)
                } | fixed
                force = self.force(trial, new[: free.size])
                score = self._objective(force, trial, new[: free.size], moving)
                if np.isfinite(score) and score > value:
                    gain, value, base, sizes, free = score - value, score, force, trial, new[: free.size]
                    break
            if gain < 0.02:
                break
        _, logdet = np.linalg.slogdet(normal)
        one_sided = sum(not self.forms[i].signed for i in moving)
        return Fit(ids, value - 0.5 * float(logdet) + one_sided * float(np.log(2.0)), sizes, free, base)

    def _step(self, normal: Array, right: Array, at: Array, moving: Key) -> Array:
        """Newton step; one-signed sizes that would turn negative are held at zero, the rest solved again."""
        q = self.nuisance.count
        one_signed = np.array([False] * q + [not self.forms[i].signed for i in moving])
        held = np.zeros(at.size, dtype=bool)
        move: Array = np.zeros(at.size)
        for _ in range(len(moving) + 1):
            move[held] = -at[held]
            free = ~held
            target = right[free] - normal[np.ix_(free, held)] @ move[held]
            move[free] = np.linalg.solve(normal[np.ix_(free, free)], target)
            beyond = one_signed & free & (at + move < 0.0)
            if not beyond.any():
                break
            held |= beyond
        return move

    def _beginning(self, effect: str) -> float:
        """Small, so that a larger set begins where the smaller one ended; presliding needs rows inside it."""
        return 0.3 * self.units[effect] if effect == "presliding" else 0.02 * self.strides[effect]

    def _allowed(self, effect: str, size: float) -> float:
        limit = 1.5 * self.forms[effect].high * self.units[effect]
        low = -limit if self.forms[effect].signed else 0.0
        return float(np.clip(size, low, limit))

    def scores(self, at: Fit) -> dict[Key, float]:
        """Linearised log evidence of every set of up to three, from the Jacobian at a fit."""
        ids = tuple(self.forms)
        jacobian = self._jacobian(at.sizes, at.free, at.force, ids, 0.25)
        q, sd = self.nuisance.count, np.concatenate([self.nuisance.sd, self._prior_sd(ids)])
        scaled = jacobian * sd
        where = np.concatenate([at.free, [at.sizes.get(i, 0.0) for i in ids]]) / sd
        # Residual as seen from all sizes at zero, so that dropping a true effect costs its column.
        residual = self.target - self.white(at.force[self.keep]) + scaled @ where
        full, right = scaled.T @ scaled + np.eye(sd.size), scaled.T @ residual
        inner = np.linalg.solve(full[:q, :q], np.column_stack([full[:q, q:], right[:q]]))
        A = full[q:, q:] - full[q:, :q] @ inner[:, :-1]
        b = right[q:] - full[q:, :q] @ inner[:, -1]
        out: dict[Key, float] = {(): 0.0}
        for size in (1, 2, 3):
            sets = np.array(list(combinations(range(len(ids)), size)))
            blocks = A[sets[:, :, None], sets[:, None, :]]
            rights = b[sets]
            gain = 0.5 * np.einsum("si,si->s", rights, np.linalg.solve(blocks, rights[..., None])[..., 0])
            value = gain - 0.5 * np.linalg.slogdet(blocks)[1]
            out |= {tuple(ids[j] for j in members): float(v) for members, v in zip(sets, value, strict=True)}
        return out

    def judge(self, refits: int = 10) -> Verdict:
        """Refit the truth and its strongest rivals exactly."""
        case = self.recording.case
        truth = case.ids
        null = self.fit(())
        true = self.fit(truth, {h.id: h.size for h in case.hidden}, null.free * 0.0) if truth else null
        fits: dict[Key, Fit] = {(): null, truth: true}
        tables = [self.scores(null)] + ([self.scores(true)] if truth else [])
        for table in tables:
            lacking = [k for k in table if not set(truth) <= set(k)]
            adding = [k for k in table if set(truth) < set(k)]
            chosen: list[Key] = sorted(adding, key=lambda k: -table[k])[:3]
            for size in (1, 2, 3):
                chosen += sorted((k for k in lacking if len(k) == size), key=lambda k: -table[k])[:refits]
            for ids in chosen:
                ids = tuple(sorted(ids))
                if ids not in fits:  # from both ends: a curved effect can hold a fit in a side valley
                    starts = [true, null] if truth and not set(truth) <= set(ids) else [true]
                    found = [self.fit(ids, near.sizes, near.free) for near in starts]
                    fits[ids] = max(found, key=lambda f: f.log_evidence)
        lead = {k: true.log_evidence - f.log_evidence for k, f in fits.items() if k != truth}
        lacking_lead = {k: v for k, v in lead.items() if not set(truth) <= set(k)}
        adding_lead = [v for k, v in lead.items() if set(truth) < set(k)]
        rival = min(lacking_lead, key=lambda k: lacking_lead[k]) if lacking_lead else ()
        return Verdict(truth, lacking_lead.get(rival, np.inf), rival, min(adding_lead, default=np.inf), fits)


def held_out_rmse(recording: Recording, ids: Key, held: Array) -> float:
    """RMSE [N] against the recorded force on the rows `held`, fitted without them with the true forms."""
    oracle = Oracle(recording, ~held.astype(bool))
    known = {h.id: h.size for h in recording.case.hidden}
    fitted = oracle.fit(tuple(ids), known)
    return float(np.sqrt(np.mean((fitted.force - recording.force)[held.astype(bool)] ** 2)))
