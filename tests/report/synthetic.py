"""Made-up calibrations with known numbers, for the report's tests."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from mpam_calib.report.view import CalibrationView, Convergence
from mpam_calib.specimen.declaration import Simulation

LEVELS = (50.0, 100.0, 150.0, 200.0, 250.0)
Z = {"q05": -1.645, "q25": -0.674, "q50": 0.0, "q75": 0.674, "q95": 1.645}


def curve(pressure: float, contraction: np.ndarray) -> np.ndarray:
    free = 0.34 * (1 - np.exp(-pressure / 60))
    return 0.39 * (pressure - 9) * ((1 - contraction) ** 2 - (1 - free) ** 2) / (1 - (1 - free) ** 2)


def band_rows(
    quantity: str, pressure: float, contraction: Any, branch: str, mean: Any, sd: Any
) -> pd.DataFrame:
    frame = {"quantity": quantity, "pressure_kPa": pressure, "contraction": contraction, "branch": branch}
    frame |= {"mean": mean, **{q: mean + z * sd for q, z in Z.items()}, "extrapolated": False}
    return pd.DataFrame(frame, index=range(np.size(mean)))


def summary_of(
    draws: dict[str, np.ndarray], priors: dict[str, np.ndarray], units: dict[str, str]
) -> pd.DataFrame:
    rows = []
    for name, x in draws.items():
        q05, q50, q95 = np.quantile(x, [0.05, 0.5, 0.95])
        rows.append(
            (
                name,
                units.get(name, ""),
                x.mean(),
                x.std(),
                q05,
                q50,
                q95,
                priors[name].std(),
                1.003,
                2100,
                1800,
            )
        )
    columns = [
        "parameter",
        "unit",
        "mean",
        "sd",
        "q05",
        "q50",
        "q95",
        "prior_sd",
        "rhat",
        "ess_bulk",
        "ess_tail",
    ]
    return pd.DataFrame(rows, columns=columns)


def unidentified_of(summary: pd.DataFrame) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "parameter": summary["parameter"],
            "prior_sd": summary["prior_sd"],
            "posterior_sd": summary["sd"],
            "contraction": 1 - summary["sd"] / summary["prior_sd"],
        }
    )


def muscle(rows_per_branch: int = 240, n_draws: int = 2000, **changes: Any) -> CalibrationView:
    rng = np.random.default_rng(7)
    bands, observed = [], []
    sign = {"loading": 1.0, "unloading": -1.0, "mean": 0.0}
    for number, P in enumerate(LEVELS):
        free = 0.34 * (1 - np.exp(-P / 60))
        grid = np.append(np.arange(0, free, 0.005), free)
        for branch, s in sign.items():
            force = curve(P, grid) * (1 + 0.07 * s)
            bands.append(band_rows("force_N", P, grid, branch, force, 0.3 + 0.004 * P * (1 + grid)))
            bands.append(band_rows("force_N_observed", P, grid, branch, force, 0.5 + 0.004 * P * (1 + grid)))
            if s == 0:
                continue
            x = np.linspace(0, free, rows_per_branch)[:: -int(s)]
            fitted = curve(P, x) * (1 + 0.07 * s)
            wave = 0.5 * np.sin(9 * x / free) * P / 250
            reading = fitted + wave + 0.25 * rng.standard_normal(len(x))
            half = Z["q95"] * (0.5 + 0.004 * P * (1 + x))
            observed.append(
                pd.DataFrame(
                    {
                        "kind": "loops", "level_kPa": P, "pressure_kPa": P, "contraction": x,
                        "branch": branch, "force_N": reading, "fitted_N": fitted,
                        "low_N": fitted - half, "high_N": fitted + half, "past_N": 0.0, "cycle": 1,
                        "stroke": 2 * number + (s > 0), "time_s": np.arange(len(x)) * 0.1, "censored": False,
                    }
                )
            )  # fmt: skip
        bands.append(band_rows("blocked_force_N", P, 0.0, "mean", curve(P, np.zeros(1)), 0.3 + 0.004 * P))
        bands.append(band_rows("free_contraction", P, np.nan, "mean", np.array([free]), 0.002))
    points = pd.DataFrame(
        {"kind": "blocked_force", "pressure_kPa": [60.0, 120.0, 240.0], "force_N": [20.1, 43.0, 90.5]}
    )
    points = points.assign(level_kPa=points["pressure_kPa"], branch="", contraction=0.0, censored=False)
    a = rng.standard_normal((4, n_draws))
    draws = {
        "a_1": 0.85e3 + 12.0 * a[0],
        "b_1": 7.7e6 + 9e4 * (0.9 * a[0] + 0.44 * a[1]),
        "a_2": -1.95e3 + 30.0 * (0.95 * a[1] - 0.3 * a[0]),
        "b_2": -1.9e7 + 2e5 * (-0.97 * a[0] + 0.2 * a[2]),
        "K_f": 0.07 + 0.002 * a[2],
        "P_DB_kPa": 12.0 + 13.5 * a[3],
        "tip_factor": 0.94 + 0.05 * (0.8 * a[1] + 0.6 * a[2]),
        "noise_sd_N": 0.25 * np.exp(0.02 * a[3]),
    }
    scale = {
        "a_1": 300.0,
        "b_1": 3e6,
        "a_2": 900.0,
        "b_2": 9e6,
        "K_f": 0.1,
        "P_DB_kPa": 14.4,
        "tip_factor": 0.3,
        "noise_sd_N": 0.4,
    }
    priors = {name: draws[name].mean() + s * rng.standard_normal(n_draws) for name, s in scale.items()}
    units = {"P_DB_kPa": "kPa", "noise_sd_N": "N", "a_1": "Pa/kPa", "a_2": "Pa/kPa", "b_1": "Pa", "b_2": "Pa"}
    summary = summary_of(draws, priors, units)
    values: dict[str, Any] = {
        "name": "MPAM1",
        "material": "Ecoflex 00-50",
        "simulation": Simulation(
            kinematics="constant_thickness", strain="stretch", order=2, effects=("dead_band",)
        ),
        "summary": summary,
        "bands": pd.concat(bands, ignore_index=True),
        "observed": pd.concat([*observed, points], ignore_index=True),
        "convergence": Convergence(True, 1.003, "K_f", 2100.0, 1800.0, 4, 32, 4000, n_draws, 0.61),
        "levels_kPa": LEVELS,
        "draws": draws,
        "prior_draws": priors,
        "headline": tuple(draws),
        "unidentified": unidentified_of(summary),
        "settings": {"mpam-calib": "0.1.0", "seed": "0", "digest": "3f9a1c"},
        "data_files": pd.DataFrame({"file": ["loops.csv"], "rows": [18000], "levels": [5]}),
        "remainder": 0.24,
        "noise": 0.25,
    }
    return CalibrationView(**(values | changes))


def material(n_draws: int = 2000, **changes: Any) -> CalibrationView:
    rng = np.random.default_rng(8)
    strain = np.linspace(0, 3.3, 67)

    def stress(e: np.ndarray) -> np.ndarray:
        return 8.0e4 * e - 2.1e4 * e**2 + 6.0e3 * e**3

    bands = band_rows("stress_Pa", 0.0, strain, "mean", stress(strain), 400 + 900 * strain)
    bands["pressure_kPa"] = np.nan
    bands["extrapolated"] = strain > 3.0
    x = np.linspace(0.1, 3.0, 400)
    observed = pd.DataFrame(
        {
            "kind": "tensile", "level_kPa": np.nan, "pressure_kPa": np.nan, "contraction": x, "branch": "",
            "force_N": stress(x) + 1500 * rng.standard_normal(400), "fitted_N": stress(x), "low_N": np.nan,
            "high_N": np.nan, "cycle": 1, "stroke": 0, "time_s": np.nan, "censored": False,
        }
    )  # fmt: skip
    draws = {
        f"E_{k}": m * (1 + 0.03 * rng.standard_normal(n_draws)) for k, m in ((1, 8e4), (2, -2.1e4), (3, 6e3))
    }
    priors = {name: x.mean() + 2e5 * rng.standard_normal(n_draws) for name, x in draws.items()}
    summary = summary_of(draws, priors, dict.fromkeys(draws, "Pa"))
    ranges = [
        (low, high, high == 3.0, quantity, unit, mean * (1 + 0.1 * (3 - high)), mean * 0.95, mean * 1.2)
        for low, high in ((0.0, 0.5), (0.1, 1.0), (0.1, 3.0))
        for quantity, unit, mean in (
            ("E_1", "Pa", 8e4),
            ("stress at strain 0.5", "Pa", 3.5e4),
            ("blocked force", "N", 74.0),
        )
    ]
    columns = ["strain_low", "strain_high", "used", "quantity", "unit", "mean", "q05", "q95"]
    values: dict[str, Any] = {
        "name": "ecoflex_tension",
        "material": "Ecoflex 00-50",
        "simulation": Simulation(order=3, law="constant"),
        "summary": summary,
        "bands": bands,
        "observed": observed,
        "convergence": Convergence(True, 1.002, "E_3", 3000.0, 2500.0, 4, 32, 2000, n_draws),
        "draws": draws,
        "prior_draws": priors,
        "headline": tuple(draws),
        "unidentified": unidentified_of(summary),
        "strain_range": pd.DataFrame(ranges, columns=columns),
        "remainder": 300.0,
        "noise": 1500.0,
    }
    return CalibrationView(**(values | changes))
