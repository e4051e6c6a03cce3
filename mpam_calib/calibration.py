"""Calibrating one specimen: the whole way from recordings to draws, in memory."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.errors import InputError
from mpam_calib.model.blueprint import MaterialPosterior, Options, draw_blueprint
from mpam_calib.model.model import Model
from mpam_calib.posterior.chains.checkpoint import Checkpoint
from mpam_calib.posterior.chains.convergence import ESS_WANTED
from mpam_calib.posterior.chains.sampling import MAX_STEPS, Listener, Sampling, sample
from mpam_calib.posterior.density.collapsed import Collapsed
from mpam_calib.posterior.density.guide import Guide
from mpam_calib.posterior.density.mode import Mode
from mpam_calib.posterior.density.target import build_target, locate
from mpam_calib.posterior.draws import Draws, Reported, keep_draws, kept_for, reported
from mpam_calib.posterior.early_root import without_early_roots
from mpam_calib.posterior.material import material_of
from mpam_calib.posterior.summary import all_converged, summarise
from mpam_calib.prediction.bands import muscle_bands, stress_bands
from mpam_calib.prediction.recorded import Recorded
from mpam_calib.specimen.arguments import (
    demand_number,
    demand_optional,
    demand_pressures,
    demand_specimen,
    demand_whole,
)
from mpam_calib.specimen.recording import Specimen
from mpam_calib.specimen.toml_source import SPECIMEN_FILE
from mpam_calib.units import KPA

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Calibration:
    """A specimen's posterior: how it was drawn, and what it says."""

    specimen: Specimen
    target: Collapsed
    sampling: Sampling
    draws: Draws
    seed: int
    ess_wanted: float = ESS_WANTED

    @property
    def model(self) -> Model:
        """The model that was calibrated."""
        return self.target.model

    @cached_property
    def reported(self) -> list[Reported]:
        """Every reported quantity with its draws, lab units."""
        return reported(self.model, self.draws, self.seed)

    @cached_property
    def summary(self) -> pd.DataFrame:
        """The table ``summary.csv``."""
        return summarise(self.reported, self.model.names, self.sampling)

    @property
    def converged(self) -> bool:
        """Whether every reported quantity meets the limits on R-hat and ESS."""
        return all_converged(self.summary, self.sampling, self.ess_wanted)

    def bands(self, pressures_kPa: Array | list[float] | None = None) -> pd.DataFrame:
        """Credible bands at pressures (kPa; the specimen's levels by default), as in ``bands.csv``.

        Raises ``InputError`` for what is no list of pressures.
        """
        if pressures_kPa is not None:
            pressures_kPa = demand_pressures("pressures_kPa", pressures_kPa)
            if self.model.chain is None:
                raise InputError("pressures_kPa", "pressures", "none for a material without a muscle")
        return predict(self.model, self.draws, self.seed, pressures_kPa, Recorded.of(self.specimen))


def predict(
    model: Model,
    draws: Draws,
    seed: int,
    pressures_kPa: Array | list[float] | None = None,
    recorded: Recorded | None = None,
) -> pd.DataFrame:
    """Bands of everything the model predicts: the muscle's at the pressures, the material's stress.

    ``recorded`` marks what it does not hold as extrapolated.
    """
    parts = []
    if model.chain is not None:
        pressures = (
            np.array(model.blueprint.levels) if pressures_kPa is None else np.asarray(pressures_kPa) * KPA
        )
        parts.append(muscle_bands(model, draws, pressures, seed, recorded=recorded))
    if model.tensile is not None:
        parts.append(stress_bands(model, draws, seed))
    return pd.concat(parts, ignore_index=True)


def calibrate(
    specimen: Specimen,
    *,
    seed: int = 0,
    max_steps: int = MAX_STEPS,
    ess_wanted: float = ESS_WANTED,
    options: Options | None = None,
    material: MaterialPosterior | None = None,
    checkpoint: Checkpoint | None = None,
    listener: Listener | None = None,
) -> Calibration:
    """Draw the posterior of a specimen's declared simulation.

    ``material`` is what ``moduli = "run:..."`` names; it is read from there where it is not given.
    Raises ``InputError`` where the specimen cannot carry the model, and for options that mean nothing. See
    ``Calibration.converged`` for whether the draws can be used.
    """
    demand_specimen(specimen)
    demand_whole("--seed", seed, 0)
    demand_whole("--max-steps", max_steps, 1)
    demand_number("--ess", ess_wanted, 1.0)
    demand_optional("options", options, Options)
    demand_optional("material", material, MaterialPosterior)
    if not specimen.has_muscle_data and specimen.tensile is None:
        expected = 'at least one, such as loops = "loops.csv"'
        raise InputError(specimen.folder / SPECIMEN_FILE, "no data files", expected, None, "files")
    if material is None:
        material = material_of(specimen)
    target = build_target(specimen, draw_blueprint(specimen, options, material))
    found: tuple[Guide, list[Mode]] | None = checkpoint.load("modes") if checkpoint else None
    if found is None:
        target, modes = locate(target, np.random.default_rng([seed, 0]))
        if checkpoint:
            checkpoint.save("modes", (target.guide, modes))
    else:
        guide, modes = found
        target = replace(target, guide=guide)
    sampling = sample(target, modes, seed, max_steps, ess_wanted, checkpoint, listener)
    draws = without_early_roots(target, keep_draws(target, sampling, seed, kept_for(ess_wanted)), seed)
    return Calibration(specimen, target, sampling, draws, seed, ess_wanted)
