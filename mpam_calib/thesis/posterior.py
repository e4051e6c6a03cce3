"""Where a posterior joins the reproduction: f_s, Table 4.12 and the figures with bands.

The reproduction itself needs no sampling. Given a calibrated run's draws or its ``bands.csv``, these
functions put bands beside the printed numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.thesis.tables import table

Array = NDArray[np.float64]

QUANTITIES = {
    "Blocked Force (N)": ("blocked_force_N", 1.0),
    "Free Contraction (%)": ("free_contraction", 100.0),
}


@dataclass(frozen=True)
class MuscleBands:
    """Bands of one calibrated muscle: the frame of its ``bands.csv`` or ``predictions.csv``."""

    muscle: str
    bands: pd.DataFrame

    @classmethod
    def read(cls, muscle: str, path: Path) -> MuscleBands:
        """Read ``bands.csv`` or ``predictions.csv``."""
        return cls(muscle, pd.read_csv(path))


def strand_factor(draws: Array, matched: Array | None = None) -> dict[str, float]:
    """What a posterior says of f_s: mean, sd, quantiles, and the share of it below the thesis's 0.15.

    ``draws`` has shape (draws,); ``matched`` are the values that match K_f at γ = 0, for comparison.
    """
    low, middle, high = np.quantile(draws, [0.05, 0.5, 0.95])
    out = {
        "mean": float(draws.mean()),
        "sd": float(draws.std()),
        "q05": float(low),
        "q50": float(middle),
        "q95": float(high),
        "below_0.15": float(np.mean(draws < 0.15)),
    }
    if matched is not None:
        out["matched_low"], out["matched_high"] = float(matched.min()), float(matched.max())
    return out


def table_4_12(bands: dict[str, MuscleBands], pressure_kPa: dict[str, float]) -> pd.DataFrame:
    """Table 4.12's two muscles beside our bands.

    ``pressure_kPa`` says at which pressure each printed column is compared (300 for the blocked force, 250
    for the free contraction). Columns ``muscle, quantity, printed, pressure_kPa, q05, q50, q95,
    extrapolated``.
    """
    printed = table("4.12")
    rows = []
    for muscle, own in bands.items():
        for column, (quantity, scale) in QUANTITIES.items():
            P = pressure_kPa[column]
            at = own.bands[(own.bands["quantity"] == quantity) & np.isclose(own.bands["pressure_kPa"], P)]
            text = printed.text(f"Present work (MPAM_{muscle[-1]})", column)
            for _, row in at.iterrows():
                q = [scale * float(row[name]) for name in ("q05", "q50", "q95")]
                rows.append((muscle, column, text, P, *q, bool(row["extrapolated"])))
    names = ["muscle", "quantity", "printed", "pressure_kPa", "q05", "q50", "q95", "extrapolated"]
    return pd.DataFrame(rows, columns=names)
