"""A slow twin of the collapsed likelihood: loops over rows, one dense covariance, nothing of the package's.

Everything is written from the definitions: y = f + A η + ε with η ~ N(0, I), so that y ~ N(f, A Aᵀ + C).
A declaration and a recording come in as the package's plain records (numbers and words only); the binning,
the forces, the prior's root, the remainder and every covariance are computed here again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product

import numpy as np
from physics import plain
from scipy.linalg import null_space

from mpam_calib.model.blueprint import Blueprint
from mpam_calib.specimen.recording import Loops, Specimen

Array = np.ndarray
Theta = dict[str, float]
"""Sampled values by name, SI."""

LOG_2PI = math.log(2.0 * math.pi)
FINE = [0.25, 0.5, 0.75, 1.0, 1.5, 2.0]


@dataclass(frozen=True)
class Dense:
    """y ~ N(f, A Aᵀ + C); ``root`` turns the first columns' η into moduli coefficients."""

    y: Array
    f: Array
    A: Array
    C: Array
    root: Array

    def log_density(self) -> float:
        """ln N(y; f, A Aᵀ + C)."""
        L = np.linalg.cholesky(self.A @ self.A.T + self.C)
        z = np.linalg.solve(L, self.y - self.f)
        return float(-0.5 * (z @ z) - np.sum(np.log(np.diag(L))) - 0.5 * len(self.y) * LOG_2PI)

    def conditional(self) -> tuple[Array, Array]:
        """Mean and covariance of η given y, by the gain matrix."""
        gain = np.linalg.solve(self.A @ self.A.T + self.C, self.A).T
        return gain @ (self.y - self.f), np.eye(self.A.shape[1]) - gain @ self.A


@dataclass(frozen=True)
class Row:
    """One place at which a force is wanted: pressure (Pa), shortening (m), branch, level."""

    P: float
    x: float
    s: float
    level: int


class Twin:
    """The slow likelihood of one specimen under one blueprint."""

    def __init__(self, specimen: Specimen, blueprint: Blueprint) -> None:
        self.specimen, self.blueprint, self.sim = specimen, blueprint, blueprint.simulation
        g = blueprint.geometry
        if g is not None:
            self.tube = plain.Tube(g.L0_mm * 1e-3, g.R0_mm * 1e-3, g.t0_mm * 1e-3, math.radians(g.alpha0_deg))
            # Where an ideal braid stops pulling: 2T = 1, sin α = 1/√3.
            self.limit = max(1.0 - 1.0 / (math.sqrt(3.0) * math.sin(self.tube.alpha0)), 0.1)
            forces = [
                plain.gas(P, self.bare_radius(gamma), plain.tan2(self.tube, self.tube.L0 * (1.0 - gamma)))
                for P in blueprint.levels
                for gamma in np.linspace(0.0, self.limit, 16)
            ]
            self.scale = math.sqrt(sum(f * f for f in forces) / len(forces))
        self.tensile = specimen.tensile is not None and (g is None or self.sim.moduli == "tensile")
        self.modes = self._remainder_modes()

    def bare_radius(self, gamma: float) -> float:
        return plain.radius(self.tube, self.tube.L0 * (1.0 - gamma), "inextensible_braid")

    # --- the moduli -----------------------------------------------------------------------------------

    def pressure_part(self, P: float, level: int, theta: Theta, k: int) -> list[float]:
        law, levels = self.sim.law, self.blueprint.levels
        if law == "constant":
            return [1.0]
        if law == "linear":
            return [P, 1.0]
        if law == "free":
            if level >= 0:
                return [1.0 if j == level else 0.0 for j in range(len(levels))]
            return [float(np.interp(P, levels, np.eye(len(levels))[j])) for j in range(len(levels))]
        d, gap = (theta["d"], theta["gap"]) if law == "exponential" else (theta[f"d_{k}"], theta[f"gap_{k}"])
        return [math.exp(d * P), math.exp((d - gap) * P)]

    def wall_row(self, row: Row, theta: Theta, P: float) -> tuple[float, list[float]]:
        """Force without the wall's stress, and force per coefficient (term major, modulus minor)."""
        L = self.tube.L0 - row.x
        R = plain.radius(self.tube, L, self.sim.kinematics)
        t, T = plain.wall(self.tube, L, R, self.sim.kinematics), plain.tan2(self.tube, L)
        per = [
            plain.per_modulus(self.tube, L, R, t, T, k, self.sim.strain) for k in range(1, self.sim.order + 1)
        ]
        parts = [self.pressure_part(row.P, row.level, theta, k) for k in range(1, self.sim.order + 1)]
        columns = [parts[k][a] * per[k] for a in range(len(parts[0])) for k in range(len(per))]
        return plain.gas(P, R, T) + plain.thickness(P, R, t, T), columns

    def root(self, theta: Theta) -> Array:
        """A root of the coefficients' prior covariance."""
        if self.tensile:
            low, high = self.blueprint.tensile_range or (0.0, 0.0)
            strains = np.linspace(low, high, 32)
            size = self.blueprint.tensile_stiffness * math.sqrt(float(np.mean(strains**2)))
            grid = [self.stress_powers(float(e)) for e in strains]
            return np.array(plain.prior_root(grid, size))
        grid = []
        for level, P in enumerate(self.blueprint.levels):
            for gamma in np.linspace(0.0, self.limit, 16):
                row = Row(P, gamma * self.tube.L0, 0.0, level)
                grid.append(self.wall_row(row, theta, P)[1])
        return np.array(plain.prior_root(grid, self.scale))

    # --- the force ------------------------------------------------------------------------------------

    def force_row(self, row: Row, theta: Theta, pulls: float) -> tuple[float, list[float]]:
        """Force without the moduli, and per coefficient, friction included; ``pulls`` is the force's sign."""
        P = max(row.P - theta.get("P_DB_kPa", 0.0), 0.0)
        fixed, columns = self.wall_row(row, theta, P)
        stem = {"coulomb": "K_f", "strand": "f_s", "none": ""}[self.sim.friction]
        name = (
            f"{stem}@{self.blueprint.levels[row.level] / 1e3:.0f}" if self.sim.friction_by_pressure else stem
        )
        if self.sim.friction == "coulomb":
            factor = 1.0 + theta[name] * row.s * pulls
            return fixed * factor, [c * factor for c in columns]
        if self.sim.friction == "strand":
            braid = self.blueprint.braid
            assert braid is not None
            unit = plain.strand_friction(self.tube, P, row.x / self.tube.L0, braid.E_br_GPa * 1e9, braid.nu_s)
            fixed += theta[name] * row.s * unit
        return fixed, columns

    # --- the remainder --------------------------------------------------------------------------------

    def _remainder_modes(self) -> list[tuple[int, int, int, float]]:
        """(degree along, in pressure, apart, weight): the 40 heaviest, of mean square one over the span."""
        if self.blueprint.geometry is None or not self.blueprint.options.remainder:
            return []
        degrees = min(6, len(self.blueprint.levels) - 1) + 1
        sides = 2 if self.blueprint.branches else 1
        every = [
            (j, d, b, 1.0 / ((1.0 + j) * (1.0 + d) * (1.0 + b)))
            for j, d, b in product(range(8), range(degrees), range(sides))
        ]
        every = sorted(every, key=lambda m: -m[3])[:40]
        power = sum(w * w / ((2 * j + 1) * (2 * d + 1)) for j, d, _, w in every)
        return [(j, d, b, w / math.sqrt(power)) for j, d, b, w in every]

    def remainder_row(self, row: Row) -> list[float]:
        x = min(max(2.0 * row.x / self.tube.L0 / (1.25 * self.limit) - 1.0, -1.0), 1.0)
        P = min(max(2.0 * row.P / self.blueprint.levels[-1] - 1.0, -1.0), 1.0)
        return [w * _legendre(j, x) * _legendre(d, P) * (row.s if b else 1.0) for j, d, b, w in self.modes]

    # --- the recordings -------------------------------------------------------------------------------

    def bins(self) -> list[list[int]]:
        """Row numbers of each bin, stroke after stroke; with white noise alone every row is one."""
        return [rows for stroke in self.strokes() for rows in stroke]

    def strokes(self) -> list[list[list[int]]]:
        assert self.specimen.loops is not None
        number = self.specimen.loops.stroke
        options = self.blueprint.options
        every_row = not (options.correlated_noise or options.remainder)
        result = []
        for stroke in dict.fromkeys(number.tolist()):
            rows = [i for i in range(len(number)) if number[i] == stroke]
            result.append([[i] for i in rows] if every_row else [rows[a:b] for a, b in _cuts(len(rows))])
        return result

    def loop_rows(self, loops: Loops, members: list[int]) -> tuple[list[Row], Row]:
        """The two Gauss points of a bin and its middle."""
        n = len(members)
        x = sum(float(loops.displacement_m[i]) for i in members) / n
        P = sum(float(loops.pressure_Pa[i]) for i in members) / n
        spread = math.sqrt(sum((float(loops.displacement_m[i]) - x) ** 2 for i in members) / n)
        s, level = float(loops.branch[members[0]]), int(loops.level[members[0]])
        return [Row(P, x - spread, s, level), Row(P, x + spread, s, level)], Row(P, x, s, level)

    def grown(self, theta: Theta, force: float) -> float:
        """Variance of the noise at a force, over that at none."""
        return 1.0 + (theta.get("noise_growth", 0.0) * force / self.scale) ** 2

    def dense(
        self,
        theta: Theta,
        guide_points: Array | None = None,
        slope: Array | None = None,
        guide_bins: Array | None = None,
    ) -> Dense:
        """The whole Gaussian system for loops, points and tensile test (slack rows are not known here)."""
        y: list[float] = []
        fixed: list[float] = []
        moduli: list[list[float]] = []
        rest: list[list[float]] = []
        blocks: list[Array] = []
        q = len(self.modes)
        waves = 12 if "tensile_remainder_sd_Pa" in theta else 0
        amplitude = theta.get("remainder_sd_N", 0.0)
        if self.specimen.loops is not None:
            loops = self.specimen.loops
            for members in self.bins():
                pair, middle = self.loop_rows(loops, members)
                ends = [self.force_row(r, theta, 1.0) for r in pair]
                y.append(sum(float(loops.force_N[i]) for i in members) / len(members))
                fixed.append(0.5 * (ends[0][0] + ends[1][0]))
                moduli.append([0.5 * (a + b) for a, b in zip(ends[0][1], ends[1][1], strict=True)])
                rest.append([amplitude * c for c in self.remainder_row(middle)] + [0.0] * waves)
            blocks.append(self.loops_covariance(theta, guide_bins))
        for number, (row, value, kind) in enumerate(self.points()):
            pulls = 1.0 if guide_points is None else float(np.sign(guide_points[number]))
            here, columns = self.force_row(row, theta, pulls)
            y.append(value)
            fixed.append(here)
            moduli.append(columns)
            rest.append([amplitude * c for c in self.remainder_row(row)] + [0.0] * waves)
            force = value if guide_points is None else float(guide_points[number])
            variance = theta["noise_sd_N"] ** 2 * self.grown(theta, force)
            if kind == "free":
                lean = 0.0 if slope is None else float(slope[number])
                variance += (theta["contraction_sd"] * self.tube.L0 * lean) ** 2
            blocks.append(np.array([[variance]]))
        if self.tensile and self.specimen.tensile is not None:
            low, high = self.blueprint.tensile_range or (0.0, 0.0)
            test = sorted(zip(self.specimen.tensile.strain, self.specimen.tensile.stress_Pa, strict=True))
            for strain, stress in test:
                if low <= strain <= high:
                    y.append(float(stress))
                    fixed.append(0.0)
                    moduli.append(self.stress_powers(float(strain)))
                    half = self.stress_waves(float(strain), low, high)
                    size = theta.get("tensile_remainder_sd_Pa", 0.0)
                    rest.append([0.0] * q + [size * c for c in half][:waves])
                    blocks.append(np.array([[theta["tensile_noise_sd_Pa"] ** 2]]))
        n = len(y)
        C = np.zeros((n, n))
        place = 0
        for block in blocks:
            C[place : place + len(block), place : place + len(block)] = block
            place += len(block)
        root = self.root(theta)
        A = np.concatenate([np.array(moduli) @ root, np.array(rest).reshape(n, -1)], axis=1)
        return Dense(np.array(y), np.array(fixed), A, C, root)

    def points(self) -> list[tuple[Row, float, str]]:
        """Force map, blocked forces, free contractions: where, the value, which."""
        found = []
        if (grid := self.specimen.force_map) is not None:
            for i in range(len(grid.force_N)):
                s = float(grid.branch[i]) if abs(grid.branch[i]) == 1 else 0.0
                row = Row(
                    float(grid.pressure_Pa[i]),
                    float(grid.contraction[i]) * self.tube.L0,
                    s,
                    int(grid.level[i]),
                )
                found.append((row, float(grid.force_N[i]), "map"))
        if (blocked := self.specimen.blocked_force) is not None:
            for P, force in zip(blocked.pressure_Pa, blocked.force_N, strict=True):
                found.append((Row(float(P), 0.0, 0.0, -1), float(force), "blocked"))
        if (free := self.specimen.free_contraction) is not None:
            for P, gamma in zip(free.pressure_Pa, free.contraction, strict=True):
                found.append((Row(float(P), float(gamma) * self.tube.L0, 0.0, -1), 0.0, "free"))
        return found

    def stress_powers(self, strain: float) -> list[float]:
        e = strain if self.sim.strain == "engineering" else 1.0 + strain
        return [e**k for k in range(1, self.sim.order + 1)]

    def stress_waves(self, strain: float, low: float, high: float) -> list[float]:
        weights = [1.0 / (1 + j) for j in range(12)]
        power = sum(w * w * (0.5 if j else 1.0) for j, w in enumerate(weights))
        u = (strain - low) / (high - low)
        return [w / math.sqrt(power) * math.cos(math.pi * j * u) for j, w in enumerate(weights)]

    # --- noise ----------------------------------------------------------------------------------------

    def bin_forces(self, guide: Array | None) -> list[float]:
        """What noise grows by: the mean of the guide's forces at a bin's two Gauss points, or its reading."""
        assert self.specimen.loops is not None
        every = self.bins()
        if guide is not None:
            return [0.5 * float(guide[i] + guide[i + len(every)]) for i in range(len(every))]
        return [sum(float(self.specimen.loops.force_N[j]) for j in b) / len(b) for b in every]

    def loops_covariance(self, theta: Theta, guide: Array | None = None) -> Array:
        """Covariance of all bin means: rows' noise averaged pair by pair, and each stroke's own kernel."""
        loops = self.specimen.loops
        assert loops is not None
        white = theta["noise_sd_N"] ** 2 / loops.averaged
        slow, tau = theta.get("noise_corr_sd_N", 0.0) ** 2, theta.get("noise_corr_time_s", 1.0)
        rough = theta.get("stroke_remainder_sd_N", 0.0) ** 2
        every = self.bins()
        means = [sum(float(loops.displacement_m[i]) for i in b) / len(b) for b in every]
        length = (max(means) - min(means)) / 6.0
        growth = [math.sqrt(self.grown(theta, force)) for force in self.bin_forces(guide)]
        C = np.zeros((len(every), len(every)))
        place = 0
        for stroke in self.strokes():
            for a, first in enumerate(stroke):
                for b, second in enumerate(stroke):
                    gaps = np.abs(np.subtract.outer(loops.time_s[first], loops.time_s[second]))
                    total = slow * float(np.mean(np.exp(-gaps / tau))) if slow > 0.0 else 0.0
                    if a == b:
                        total += white / len(first)
                    total *= growth[place + a] * growth[place + b]
                    total += rough * math.exp(-abs(means[place + a] - means[place + b]) / length)
                    C[place + a, place + b] = total
            place += len(stroke)
        return C

    def scatter(self, theta: Theta, guide: Array | None = None) -> float:
        """Log density of the detrended beginnings of all regular bins (0 where there are too few)."""
        loops = self.specimen.loops
        assert loops is not None
        white = theta["noise_sd_N"] ** 2 / loops.averaged
        slow, tau = theta.get("noise_corr_sd_N", 0.0) ** 2, theta.get("noise_corr_time_s", 1.0)
        number = {b[0]: i for i, b in enumerate(self.bins())}
        forces = self.bin_forces(guide)
        regular = [b for stroke in self.strokes() for b in stroke[7:-1] if len(b) >= 4]
        if len(regular) < 8:
            return 0.0
        size = int(min(32, np.quantile([len(b) for b in regular], 0.1)))
        if size < 4:
            return 0.0
        u = np.linspace(-1.0, 1.0, size)
        Q = null_space(np.stack([u**d for d in range(3)]))
        times = loops.time_s[regular[0][:size]]
        C = slow * np.exp(-np.abs(np.subtract.outer(times, times)) / tau) + white * np.eye(size)
        S = Q.T @ C @ Q
        total = 0.0
        for b in regular:
            if len(b) >= size:
                z = Q.T @ loops.force_N[b[:size]]
                growth = self.grown(theta, forces[number[b[0]]])
                z, extra = z / math.sqrt(growth), len(z) * math.log(growth)
                total -= 0.5 * extra
                total -= 0.5 * (z @ np.linalg.solve(S, z) + np.linalg.slogdet(S)[1] + len(z) * LOG_2PI)
        return float(total)

    def log_likelihood(
        self,
        theta: Theta,
        guide_points: Array | None = None,
        slope: Array | None = None,
        guide_bins: Array | None = None,
    ) -> float:
        """ln p(y | θ)."""
        value = self.dense(theta, guide_points, slope, guide_bins).log_density()
        return value + (self.scatter(theta, guide_bins) if self.specimen.loops is not None else 0.0)


def _legendre(degree: int, x: float) -> float:
    """Bonnet's recursion."""
    before, here = 1.0, x
    if degree == 0:
        return before
    for n in range(1, degree):
        before, here = here, ((2 * n + 1) * x * here - n * before) / (n + 1)
    return here


def _cuts(rows: int) -> list[tuple[int, int]]:
    """First and last + 1 row of each bin of a stroke."""
    if rows <= 16:
        return [(i, i + 1) for i in range(rows)]
    bins = min(32, max(16, rows // 4))
    shares = [i / bins for i in range(bins)]
    if rows >= 8 * bins:
        shares = [0.0, *(f / bins for f in FINE), *(i / bins for i in range(3, bins))]
    starts = sorted({round(f * rows) for f in shares})
    return list(zip(starts, [*starts[1:], rows], strict=True))
