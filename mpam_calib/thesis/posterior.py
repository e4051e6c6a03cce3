"""Where a posterior joins the reproduction: Tables 4.4, 4.10 and 4.12, f_s, and the figures with bands.

The reproduction itself needs no sampling. Given the RUN folders of calibrated muscles, these functions
put their bands beside the printed numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.errors import InputError
from mpam_calib.thesis import decoded, friction
from mpam_calib.thesis.tables import table

Array = NDArray[np.float64]

QUANTITIES = {
    "Blocked Force (N)": ("blocked_force_N", 1.0),
    "Free Contraction (%)": ("free_contraction", 100.0),
}
COMPARED_AT = {"Blocked Force (N)": (300.0, 250.0), "Free Contraction (%)": (250.0,)}
"""Pressures (kPa) at which Table 4.12 is compared: its title's, and the highest that was measured."""


@dataclass(frozen=True)
class MuscleBands:
    """A calibrated muscle: the frames of its ``predictions.csv`` or ``bands.csv``, and ``summary.csv``."""

    muscle: str
    bands: pd.DataFrame
    summary: pd.DataFrame

    @classmethod
    def read(cls, muscle: str, run: Path) -> MuscleBands:
        """Read a RUN folder; ``predictions.csv``, which can reach further, goes before ``bands.csv``."""
        frames = []
        for name in ("predictions.csv", "bands.csv"):
            if (run / name).is_file():
                frames.append(pd.read_csv(run / name))
        if not frames or not (run / "summary.csv").is_file():
            raise InputError(run, "no summary.csv and bands.csv", "the RUN folder of a finished calibrate")
        keys = ["quantity", "pressure_kPa", "contraction", "branch"]
        bands = pd.concat(frames).drop_duplicates(keys).sort_values(["quantity", "pressure_kPa"])
        return cls(muscle, bands.reset_index(drop=True), pd.read_csv(run / "summary.csv"))


def table_4_12(bands: dict[str, MuscleBands]) -> pd.DataFrame:
    """Table 4.12's two muscles beside our bands, at the pressures that the runs hold.

    Columns ``muscle, quantity, printed, pressure_kPa, q05, q50, q95, extrapolated``.
    """
    printed = table("4.12")
    rows = []
    for muscle, own in bands.items():
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
    if muscle == "MPAM1" and name == "K_f" and level:
        return table("4.10").text("K_f", f"{float(level):g} kPa")
    letter, _, k = name.partition("_")
    if muscle == "MPAM1" and letter in ("a", "b") and k.isdigit() and int(k) <= 4:
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
