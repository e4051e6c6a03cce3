"""What a calibration report shows, as plain tables and arrays: the seam between fit and report.

Every number is in laboratory units (kPa, N, mm, °); contraction is a fraction of the length at rest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.posterior.chains.convergence import ESS_WANTED
from mpam_calib.specimen.declaration import Simulation

Floats = NDArray[np.float64]

OBSERVED_COLUMNS = (
    "kind",
    "level_kPa",
    "pressure_kPa",
    "contraction",
    "branch",
    "force_N",
    "fitted_N",
    "low_N",
    "high_N",
    "past_N",
    "cycle",
    "stroke",
    "time_s",
    "censored",
)
"""Columns of ``CalibrationView.observed``; see there."""


@dataclass(frozen=True)
class Convergence:
    """How the sampling ended: its worst parameters and its size.

    ``rhat_max`` compares independent ensembles; ``modes`` counts the separate explanations that they
    ended in; ``acceptance`` is the share of accepted proposals (nan: not recorded), ``ess_wanted`` the least
    effective sample size that the run was asked for.
    """

    converged: bool
    rhat_max: float
    rhat_parameter: str
    ess_bulk_min: float
    ess_tail_min: float
    ensembles: int
    walkers: int
    steps: int
    draws: int
    acceptance: float = float("nan")
    modes: int = 1
    ess_wanted: float = ESS_WANTED

    @property
    def ess_min(self) -> float:
        """The smaller of bulk and tail ESS; nan if either is."""
        return float(np.min([self.ess_bulk_min, self.ess_tail_min]))


@dataclass(frozen=True)
class CalibrationView:
    """One calibration as its report shows it. A frame that does not apply is left empty.

    ``levels_kPa``: pressure levels, shape (levels,); empty for a tensile test. ``summary`` and
    ``bands`` have the columns of ``summary.csv`` and ``bands.csv``. ``observed`` has one row per
    reduced reading (``OBSERVED_COLUMNS``): kind is loops, force_map, blocked_force, free_contraction
    or tensile; ``fitted_N`` is the posterior mean of the declared simulation *without* the remainder,
    ``low_N`` and ``high_N`` the 90 % band of another such reading (of as many rows), with it, at that
    reading's own pressure and place; of loops ``past_N`` is what a reading owes to the test's past, which
    ``bands`` are without. A free contraction has its reading in ``contraction``, and in these
    columns contractions too, of which the band is that of the curve without a reading's noise; a tensile
    reading has the strain in ``contraction`` and stresses in Pa in the columns of force.

    ``draws`` and ``prior_draws``: parameter name to draws, shape (draws,), for the names in
    ``headline`` (at most eight are shown), ``meanings`` what each parameter is, in a few words.
    ``remainder`` is the root mean square of what the
    simulation leaves out and ``noise`` one sigma of a reading, both in N (Pa for a tensile test);
    nan where not assessed; ``reading_noise`` (N) is what readings scatter by from one to the next,
    ``declared_noise`` the declared ``force_sd_N``; ``strays_kPa`` how far the strokes of each level
    stray from its pressure, shape (levels,), empty without loops; ``curves_end`` the contraction up to which
    the curves behind the bands were looked at; ``unsettled_moduli`` whether the moduli come from a run that
    did not converge, ``early_roots`` the share of draws whose force is gone well short of a measured free
    contraction. ``unidentified`` has ``parameter, prior_sd,
    posterior_sd, contraction`` (1 − 90 % band of the posterior over that of the prior).
    ``left_out`` has a row for each level that was predicted from the others: ``pressure_kPa, readings,
    rmse_N, bias_N, bias_sd_N, inside90, extrapolated``.

    ``strain_range`` (tensile) has one row per range and quantity: ``strain_low, strain_high, used,
    quantity, unit, mean, q05, q95``, where a quantity is a modulus or a prediction. ``provenance``
    is a sentence that is shown on top when the data are not measurements (reconstructed, digitised).
    """

    name: str
    material: str
    simulation: Simulation
    summary: pd.DataFrame
    bands: pd.DataFrame
    observed: pd.DataFrame
    convergence: Convergence
    levels_kPa: Sequence[float] = ()
    draws: Mapping[str, Floats] = field(default_factory=dict)
    prior_draws: Mapping[str, Floats] = field(default_factory=dict)
    headline: Sequence[str] = ()
    meanings: Mapping[str, str] = field(default_factory=dict)
    unidentified: pd.DataFrame = field(default_factory=pd.DataFrame)
    left_out: pd.DataFrame = field(default_factory=pd.DataFrame)
    strain_range: pd.DataFrame = field(default_factory=pd.DataFrame)
    settings: Mapping[str, str] = field(default_factory=dict)
    data_files: pd.DataFrame = field(default_factory=pd.DataFrame)
    warnings: Sequence[str] = ()
    provenance: str = ""
    remainder: float = float("nan")
    noise: float = float("nan")
    reading_noise: float = float("nan")
    declared_noise: float = float("nan")
    strays_kPa: Sequence[float] = ()
    curves_end: float = float("nan")
    pressure_bias_sd_kPa: float = 0.0
    unsettled_moduli: bool = False
    early_roots: float = 0.0

    @property
    def tensile(self) -> bool:
        """Whether this is a bladder material's tensile test, with bands on stress and no muscle."""
        return self.stretched and not (self.bands["quantity"] == "force_N").any()

    @property
    def stretched(self) -> bool:
        """Whether there are bands on stress: a tensile test of a material, or beside a muscle's readings."""
        return bool((self.bands["quantity"] == "stress_Pa").any())

    @property
    def top_level_kPa(self) -> float:
        """The highest pressure level, kPa (of the bands, if the data have no levels)."""
        return float(max(self.levels_kPa, default=self.bands["pressure_kPa"].max()))

    def shown_parameters(self) -> list[str]:
        """The headline parameters that have draws to show, at most eight."""
        return [name for name in self.headline if name in self.draws][:8]

    def quantity(self, name: str) -> pd.DataFrame:
        """The rows of ``bands`` that hold this quantity, by pressure and contraction."""
        rows = self.bands[self.bands["quantity"] == name]
        return rows.sort_values(["pressure_kPa", "contraction"], kind="stable")

    def stress(self) -> pd.DataFrame:
        """The rows of ``bands`` on stress within the strains of the readings (all, if none is)."""
        rows = self.quantity("stress_Pa")
        inside = rows[~rows["extrapolated"].astype(bool)]
        return inside if len(inside) else rows

    def readings(self, *kinds: str) -> pd.DataFrame:
        """The rows of ``observed`` of these kinds."""
        if self.observed.empty:
            return self.observed.reindex(columns=list(OBSERVED_COLUMNS))
        return self.observed[self.observed["kind"].isin(kinds)]

    def at_level(self, quantity: str, level_kPa: float) -> pd.Series | None:
        """The band of ``blocked_force_N`` or ``free_contraction`` nearest to a level, if any."""
        rows = self.quantity(quantity)
        if rows.empty:
            return None
        return rows.iloc[int(np.argmin(np.abs(rows["pressure_kPa"].to_numpy() - level_kPa)))]

    def unit_of(self, parameter: str) -> str:
        """The parameter's unit as ``summary`` has it ("" without one)."""
        rows = self.summary[self.summary["parameter"] == parameter]
        if rows.empty or not isinstance(rows["unit"].iloc[0], str):
            return ""
        return str(rows["unit"].iloc[0])
