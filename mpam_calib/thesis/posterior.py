"""Where a posterior joins the reproduction: Tables 4.4, 4.10 and 4.12, f_s, and the figures with bands.

The reproduction itself needs no sampling. Given the RUN folders of calibrated muscles, these functions
put their bands beside the printed numbers.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.arviz_import import import_arviz
from mpam_calib.errors import InputError
from mpam_calib.posterior.stored import RUN_FILE, unconverged
from mpam_calib.thesis import decoded, friction
from mpam_calib.thesis.tables import table
from mpam_calib.units import DEG, GPA, MM

Array = NDArray[np.float64]

QUANTITIES = {
    "Blocked Force (N)": ("blocked_force_N", 1.0),
    "Free Contraction (%)": ("free_contraction", 100.0),
}
COMPARED_AT = {"Blocked Force (N)": (300.0, 250.0), "Free Contraction (%)": (250.0,)}
"""Pressures (kPa) at which Table 4.12 is compared: its title's, and the highest that was measured."""


MPAM1, MPAM2, MPAM1_STRAND = "MPAM1", "MPAM2", "MPAM1, strand friction"
"""The runs that the reproduction can show."""
GEOMETRY = {
    "L0_mm": decoded.L0 / MM,
    "R0_mm": decoded.R0 / MM,
    "t0_mm": decoded.T0 / MM,
    "alpha0_deg": decoded.ALPHA0 / DEG,
}
"""That of both muscles."""
MATERIALS = {MPAM1: "Ecoflex 00-50", MPAM2: "PDMS + Ecoflex 00-30 (1:10)"}
"""What tells one from the other."""
NEAR_KPA = 2.0
"""A recorded level lies this near to its nominal pressure."""


@dataclass(frozen=True)
class MuscleBands:
    """A calibrated muscle: the frames of its ``predictions.csv`` or ``bands.csv``, and ``summary.csv``.

    ``f_s`` holds the draws (draws,) of the strands' friction, None where the run has none; ``converged`` is
    false where the run says so of itself.
    """

    muscle: str
    bands: pd.DataFrame
    summary: pd.DataFrame
    f_s: Array | None = None
    converged: bool = True

    @classmethod
    def read(cls, muscle: str, run: Path) -> MuscleBands:
        """Read a RUN folder; ``predictions.csv``, which can reach further, goes before ``bands.csv``.

        Raises ``InputError`` where it is no finished run, one of something else, or without the friction that
        is wanted.
        """
        frames = []
        for name in ("predictions.csv", "bands.csv"):
            if (run / name).is_file():
                frames.append(pd.read_csv(run / name))
        if not frames or not (run / "summary.csv").is_file():
            raise InputError(run, "no summary.csv and bands.csv", "the RUN folder of a finished calibrate")
        _demand_muscle(muscle, run / RUN_FILE)
        keys = ["quantity", "pressure_kPa", "contraction", "branch"]
        bands = pd.concat(frames).drop_duplicates(keys).sort_values(["quantity", "pressure_kPa"])
        summary = pd.read_csv(run / "summary.csv")
        names = set(summary["parameter"])
        if muscle == MPAM1_STRAND and "f_s" not in names:
            raise InputError(run / "summary.csv", "no f_s", 'a run with friction = "strand"')
        f_s = _strand_draws(run) if "f_s" in names else None
        return cls(muscle, bands.reset_index(drop=True), summary, f_s, not unconverged(run))

    @property
    def coulomb(self) -> bool:
        """Whether its declared friction is Coulomb's."""
        return bool(self.summary["parameter"].str.startswith("K_f").any())

    def curve(self, P_kPa: float, branch: str) -> pd.DataFrame:
        """Rows of a force-contraction band at the pressure nearest to a level; empty where none is near."""
        rows = self.bands[(self.bands["quantity"] == "force_N") & (self.bands["branch"] == branch)]
        distance = (rows["pressure_kPa"] - P_kPa).abs()
        near: pd.DataFrame = rows[(distance <= NEAR_KPA) & (distance == distance.min())]
        return near.sort_values("contraction")


def _demand_muscle(muscle: str, record: Path) -> None:
    """Raise ``InputError`` where a run's record is not that of the thesis's muscle."""
    try:
        content = json.loads(record.read_text(encoding="utf-8"))
        geometry = content["blueprint"]["geometry"]
        levels, material = content["blueprint"]["levels"], str(content["specimen"]["bladder_material"])
        own = {name: float(geometry[name]) for name in GEOMETRY} if geometry else {}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(record, "no readable record", "that of a finished calibrate") from error
    name = MPAM1 if muscle == MPAM1_STRAND else muscle
    if not own or not levels:
        raise InputError(record, "a run of a material", f"one of the muscle {name}")
    other = {k: v for k, v in own.items() if not np.isclose(v, GEOMETRY[k])}
    if other:
        found = "another muscle, " + ", ".join(f"{k} = {v:g}" for k, v in other.items())
        expected = f"{name}'s " + ", ".join(f"{k} = {GEOMETRY[k]:g}" for k in other)
        raise InputError(record, found, expected)
    if material in MATERIALS.values() and material != MATERIALS[name]:
        raise InputError(record, f"a bladder of {material}", f"{name}'s, of {MATERIALS[name]}")


def _strand_draws(run: Path) -> Array | None:
    """Draws of f_s, (draws,), of a RUN folder; None where it holds no posterior."""
    az = import_arviz()

    if not (run / "posterior.nc").is_file():
        return None
    posterior = az.from_netcdf(str(run / "posterior.nc"), engine="h5netcdf")["posterior"]
    return np.asarray(posterior["f_s"].to_numpy(), dtype=np.float64).ravel()


def table_4_12(bands: dict[str, MuscleBands]) -> pd.DataFrame:
    """Table 4.12's two muscles beside our bands, at the pressures that the runs hold.

    Columns ``muscle, quantity, printed, pressure_kPa, q05, q50, q95, extrapolated``.
    """
    printed = table("4.12")
    rows = []
    for muscle, own in bands.items():
        if muscle not in (MPAM1, MPAM2):
            continue
        for column, (quantity, scale) in QUANTITIES.items():
            for P in COMPARED_AT[column]:
                near = np.isclose(own.bands["pressure_kPa"], P, atol=1.0)
                text = printed.text(f"Present work (MPAM_{muscle[-1]})", column)
                for _, row in own.bands[(own.bands["quantity"] == quantity) & near].iterrows():
                    q = [scale * float(row[name]) for name in ("q05", "q50", "q95")]
                    rows.append((muscle, column, text, P, *q, bool(row["extrapolated"])))
    names = ["muscle", "quantity", "printed", "pressure_kPa", "q05", "q50", "q95", "extrapolated"]
    return pd.DataFrame(rows, columns=names)


def parameters(bands: dict[str, MuscleBands]) -> pd.DataFrame:
    """The thesis's constants beside the posterior's: ``muscle, parameter, printed, mean, sd, q05, q95``."""
    rows = []
    for muscle, own in bands.items():
        for _, row in own.summary.iterrows():
            text = _printed(muscle, str(row["parameter"]))
            if text:
                values = [float(row[name]) for name in ("mean", "sd", "q05", "q95")]
                rows.append((muscle, row["parameter"], text, *values))
    return pd.DataFrame(rows, columns=["muscle", "parameter", "printed", "mean", "sd", "q05", "q95"])


def _printed(muscle: str, parameter: str) -> str:
    """What the thesis prints for a parameter of summary.csv ("" where nothing)."""
    name, _, level = parameter.partition("@")
    if name == "f_s":
        return f"{decoded.F_S:g}"
    if muscle == MPAM1 and name == "K_f" and level:
        return table("4.10").text("K_f", f"{float(level):g} kPa")
    letter, _, k = name.partition("_")
    if muscle != MPAM2 and letter in ("a", "b") and k.isdigit() and int(k) <= 4:
        return table("4.4").text(letter, f"E_{k}")
    return ""


def strand_factor(draws: Array) -> dict[str, float]:
    """What draws of f_s, shape (draws,), say beside the thesis's least-squares value 0.15.

    Mean, sd, quantiles, the share below 0.15, and the range of f_s that matches K_f at γ = 0.
    """
    low, middle, high = np.quantile(draws, [0.05, 0.5, 0.95])
    matched = [friction.matching_strand_factor(i) for i in range(decoded.LEVELS.size)]
    return {
        "mean": float(draws.mean()),
        "sd": float(draws.std()),
        "q05": float(low),
        "q50": float(middle),
        "q95": float(high),
        "below_printed": float(np.mean(draws < decoded.F_S)),
        "matched_low": min(matched),
        "matched_high": max(matched),
    }


def strand_factors(bands: dict[str, MuscleBands]) -> pd.DataFrame:
    """Posterior of f_s of every run that has one, beside the thesis's 0.15 and least squares (Fig. 4.20)."""
    squares = [friction.best_strand_factor(3, 0.98, relative) for relative in (True, False)]
    rows = []
    for muscle, own in bands.items():
        if own.f_s is None:
            continue
        said = strand_factor(own.f_s)
        fitted = squares if muscle != MPAM2 else [np.nan, np.nan]
        matched = f"{said['matched_low']:.2f} to {said['matched_high']:.2f}" if muscle != MPAM2 else "–"
        posterior = [said[name] for name in ("mean", "sd", "q05", "q95", "below_printed")]
        rows.append((muscle, f"{decoded.F_S:g}", *fitted, matched, *posterior))
    names = ["run", "printed", "relative least squares", "least squares", "matching K_f at γ = 0"]
    names += ["posterior mean", "sd", "q05", "q95", "share below the print"]
    return pd.DataFrame(rows, columns=names)


MISSING = {
    MPAM1: (
        "bands in Fig. 4.7, 4.10, 4.14 and 4.22; Table 4.12 and 4.10 and 4.4 beside the posterior",
        "mpam-calib calibrate datasets/mpam1_reconstructed -o RUN1; "
        "mpam-calib predict RUN1 --pressure 50:300:50; mpam-calib reproduce -o DIR --mpam1 RUN1",
    ),
    MPAM2: (
        "bands in Fig. 4.7, 4.10, 4.18 and 4.23; Table 4.12 beside the posterior; MPAM2's f_s by posterior",
        "mpam-calib calibrate datasets/mpam2_reconstructed -o RUN2; "
        "mpam-calib predict RUN2 --pressure 50:300:50; mpam-calib reproduce -o DIR --mpam2 RUN2",
    ),
    MPAM1_STRAND: (
        "bands in Fig. 4.21; MPAM1's f_s by posterior (Fig. 4.20)",
        'in a copy of datasets/mpam1_reconstructed set friction = "strand", friction_by_pressure = false and '
        f"E_br_GPa = {decoded.E_BR / GPA:.1f} (chapter 4's); "
        "mpam-calib calibrate COPY -o RUN3; mpam-calib reproduce -o DIR --mpam1-strand RUN3",
    ),
}
"""What each run would add, and the commands that add it."""


def missing(bands: dict[str, MuscleBands]) -> pd.DataFrame:
    """Parts of the reproduction that need a posterior and have none: ``run, what is missing, commands``."""
    rows = [(name, *words) for name, words in MISSING.items() if name not in bands]
    return pd.DataFrame(rows, columns=["run", "what is missing", "commands"])
