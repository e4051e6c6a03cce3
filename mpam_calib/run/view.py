"""What a calibration's report shows, computed from its draws."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.calibration import Calibration
from mpam_calib.model.model import CONTRACTION_SD, Model
from mpam_calib.model.noise import CORRELATED, FREEDOM, GROWTH, TIME, WHITE
from mpam_calib.model.remainder import ROUGH, SMOOTH
from mpam_calib.model.tensile import MISFIT, NOISE
from mpam_calib.posterior.draws import prior_draws
from mpam_calib.posterior.early_root import early_roots
from mpam_calib.posterior.material import material_folder
from mpam_calib.posterior.stored import unconverged
from mpam_calib.prediction.curves import contraction_grid
from mpam_calib.prediction.left_out import levels_left_out
from mpam_calib.prediction.strain_range import strain_range_table
from mpam_calib.report.view import CalibrationView, Convergence
from mpam_calib.run.folder import versions
from mpam_calib.run.observed import in_kpa, observed_readings
from mpam_calib.run.provenance import provenance
from mpam_calib.specimen.oddities import oddities, stroke_stray
from mpam_calib.specimen.recording import Loops, Specimen
from mpam_calib.specimen.summary import reading_noise
from mpam_calib.units import KPA

Array = NDArray[np.float64]

NOT_PHYSICS = (WHITE, CORRELATED, TIME, GROWTH, FREEDOM, SMOOTH, ROUGH, NOISE, MISFIT, CONTRACTION_SD)


def view_of(calibration: Calibration, bands: pd.DataFrame) -> CalibrationView:
    """The report's view of a calibration and its bands at the levels."""
    specimen, model = calibration.specimen, calibration.model
    summary = calibration.summary
    observed, remainder, noise = observed_readings(calibration)
    headline = _headline(calibration)
    draws = {item.name: item.draws for item in calibration.reported if item.name in headline}
    prior = prior_draws(model, [item.name for item in calibration.reported], calibration.seed)
    return CalibrationView(
        name=specimen.name,
        material=specimen.bladder_material,
        simulation=specimen.simulation,
        summary=summary,
        bands=bands,
        observed=observed,
        convergence=_convergence(calibration),
        levels_kPa=tuple(in_kpa(specimen.levels_Pa)),
        draws=draws,
        prior_draws={name: prior[name] for name in prior if name in headline},
        headline=headline,
        meanings={item.name: item.meaning for item in calibration.reported},
        unidentified=_learnt(summary, {i.name: i.draws for i in calibration.reported}, prior),
        left_out=levels_left_out(specimen, calibration.target, calibration.draws, calibration.seed),
        strain_range=strain_range_table(specimen, model, calibration.draws, calibration.seed)
        if model.setting is None
        else pd.DataFrame(),
        settings=_settings(calibration),
        data_files=pd.DataFrame(
            [{"kind": f.kind, "file": f.name, "rows": f.rows} for f in specimen.files],
            columns=["kind", "file", "rows"],
        ),
        warnings=_warnings(calibration),
        provenance=provenance(specimen),
        remainder=remainder,
        noise=noise,
        reading_noise=math.nan if specimen.loops is None else reading_noise(specimen.loops),
        declared_noise=specimen.sensors.force_sd_N or math.nan,
        strays_kPa=() if specimen.loops is None else _strays_kPa(specimen.loops, specimen.levels_Pa),
        curves_end=_curves_end(model),
        pressure_bias_sd_kPa=specimen.sensors.pressure_bias_sd_kPa,
        unsettled_moduli=_unsettled_moduli(specimen),
        early_roots=_early_share(calibration),
    )


def _convergence(calibration: Calibration) -> Convergence:
    summary, sampling = calibration.summary, calibration.sampling
    worst = summary.iloc[int(summary["rhat"].to_numpy().argmax())]
    ensembles, steps, walkers, _ = sampling.chain.shape
    return Convergence(
        converged=calibration.converged,
        rhat_max=float(worst["rhat"]),
        rhat_parameter=str(worst["parameter"]),
        ess_bulk_min=float(summary["ess_bulk"].min()),
        ess_tail_min=float(summary["ess_tail"].min()),
        ensembles=ensembles,
        walkers=walkers,
        steps=steps,
        draws=len(calibration.draws),
        acceptance=sampling.acceptance,
        modes=len(sampling.modes),
        ess_wanted=calibration.ess_wanted,
    )


def _strays_kPa(loops: Loops, levels_Pa: Array) -> tuple[float, ...]:
    return tuple(stroke_stray(loops, levels_Pa, index) / KPA for index in range(len(levels_Pa)))


def _curves_end(model: Model) -> float:
    if model.setting is None:
        return math.nan
    return float(contraction_grid(model, max(model.blueprint.reach))[-1])


def _headline(calibration: Calibration) -> list[str]:
    """Friction, effects and rates first, then the law's coefficients, then noise: at most eight."""
    names = [item.name for item in calibration.reported]
    coefficients = [item.name for item in calibration.reported if not item.sampled]
    physics = [name for name in names if name not in NOT_PHYSICS and name not in coefficients]
    rest = [name for name in names if name in (WHITE, SMOOTH, NOISE)]
    room = max(8 - len(rest) - len(physics), 0)
    return [*physics, *coefficients[:room], *rest][:8]


def _learnt(
    summary: pd.DataFrame, posterior: Mapping[str, Array], prior: Mapping[str, Array]
) -> pd.DataFrame:
    """What each physical parameter's posterior owes to the data: how much narrower its 90 % band became.

    Not how much smaller its sd: one far draw of a heavy tail makes a prior's sd as large as one likes.
    Amplitudes of noise and remainder are left out: what they tell is where they lie, not how narrow they are
    beside their priors.
    """
    summary = summary[~summary["parameter"].isin(NOT_PHYSICS)]
    before = np.array([_width(prior[name]) for name in summary["parameter"]])
    after = np.array([_width(posterior[name]) for name in summary["parameter"]])
    ratio = np.divide(after, before, out=np.ones_like(after), where=before > 0.0)
    return pd.DataFrame(
        {
            "parameter": summary["parameter"],
            "prior_sd": summary["prior_sd"],
            "posterior_sd": summary["sd"],
            "contraction": 1.0 - ratio,
        }
    )


def _width(draws: Array) -> float:
    low, high = np.quantile(draws, [0.05, 0.95])
    return float(high - low)


def _settings(calibration: Calibration) -> dict[str, str]:
    options = calibration.model.blueprint.options
    return {
        "seed": str(calibration.seed),
        "effective draws wanted": f"{calibration.ess_wanted:g}",
        "remainder": "yes" if options.remainder else "left out",
        "correlated noise": "yes" if options.correlated_noise else "left out",
        "data digest": calibration.specimen.digest[:16],
        **{f"version of {name}": version for name, version in versions().items()},
    }


def _warnings(calibration: Calibration) -> list[str]:
    specimen, material = calibration.specimen, calibration.model.blueprint.material
    warnings = oddities(specimen)
    if material is None:
        return warnings
    if material.strain_range is None:
        warnings.append(
            "The moduli come from another muscle's run: they are constants of its force curve, not of the "
            "rubber."
        )
    else:
        low, high = material.strain_range
        warnings.append(
            f"The moduli come from a tensile test between strains {low:g} and {high:g}; "
            "a wall strained otherwise is extrapolated."
        )
    return warnings


def _early_share(calibration: Calibration) -> float:
    early = early_roots(calibration.target, calibration.draws)
    return 0.0 if early is None else float(early.mean())


def _unsettled_moduli(specimen: Specimen) -> bool:
    folder = material_folder(specimen)
    return folder is not None and unconverged(folder)
