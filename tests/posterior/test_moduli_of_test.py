"""What a tensile test says of the moduli, before any muscle is looked at."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from model import build

from mpam_calib.calibration import calibrate
from mpam_calib.posterior import material
from mpam_calib.posterior.draws import reported
from mpam_calib.posterior.tested_moduli import moduli_of_test
from mpam_calib.specimen.declaration import Simulation
from mpam_calib.specimen.recording import Specimen, Tensile

MODULI = np.array([6.0e4, -2.0e4, 8.0e3])
TENSILE = {"moduli": "tensile", "order": 3, "law": "constant"}


def rubber(
    seed: int, noise_Pa: float = 400.0, bend_Pa: float = 0.0, simulation: dict | None = None
) -> Specimen:
    """A tensile test of 40 readings up to a strain of 1.2; ``bend_Pa`` is in no polynomial of these."""
    strain = np.linspace(0.03, 1.2, 40)
    stress = strain[:, None] ** np.arange(1, 4) @ MODULI + bend_Pa * np.tanh((strain - 0.6) / 0.05)
    stress = stress + noise_Pa * np.random.default_rng(seed).standard_normal(len(strain))
    made = build.specimen(simulation or TENSILE, levels_kPa=())
    return replace(made, tensile=Tensile(strain, stress), geometry=None, braid=None)


@pytest.mark.parametrize("bend", [0.0, 3000.0])
def test_moments_are_those_of_the_sampled_posterior(bend: float) -> None:
    made = rubber(1, bend_Pa=bend)
    found = moduli_of_test(made)
    assert found is not None
    sampled = calibrate(made, seed=3)
    draws = {r.name: r.draws for r in reported(sampled.model, sampled.draws)}
    each = np.stack([draws[f"E_{k}"] for k in (1, 2, 3)])
    sd = np.sqrt(np.diagonal(found.covariance))
    assert np.abs(np.array(found.mean) - each.mean(axis=1)) == pytest.approx(
        0.0, abs=float(np.max(0.15 * sd))
    )
    assert sd == pytest.approx(each.std(axis=1), rel=0.1)
    correlated = np.array(found.covariance) / np.outer(sd, sd)
    assert correlated == pytest.approx(np.corrcoef(each), abs=0.02)


def test_true_moduli_are_as_often_inside_as_said() -> None:
    """At least nine times in ten: what the polynomial might leave about doubles the moduli's sds."""
    inside, wider = 0, []
    for seed in range(60):
        made = rubber(seed)
        found = moduli_of_test(made)
        assert found is not None and made.tensile is not None
        off, covariance = MODULI - np.array(found.mean), np.array(found.covariance)
        inside += off @ np.linalg.solve(covariance, off) < 6.251  # chi-squared's 90th percentile
        powers = made.tensile.strain[:, None] ** np.arange(1, 4)
        least_squares = 400.0**2 * np.linalg.inv(powers.T @ powers)
        wider.append(np.sqrt(np.diagonal(covariance) / np.diagonal(least_squares)))
    assert inside >= 49  # 1 in 100 below, were it 90 in 100
    assert np.min(wider) > 1.0 and np.mean(wider) < 3.0


def test_moduli_from_elsewhere_are_not_looked_for() -> None:
    free = {"order": 2, "law": "linear"}
    assert moduli_of_test(rubber(0, simulation=free)) is None
    assert moduli_of_test(replace(rubber(0), tensile=None, simulation=Simulation(**free))) is None


def rising(size: float, top: float) -> Tensile:
    """A test whose slope is ``size`` (Pa) at first, with 0.5 % noise."""
    strain = np.linspace(top / 60.0, top, 60)
    stress = size * strain * (1.0 - 0.3 * strain / top)
    noise = 0.005 * stress.max() * np.random.default_rng(0).standard_normal(60)
    return Tensile(strain, stress + noise)


@pytest.mark.parametrize("top", [0.1, 1.5])
@pytest.mark.parametrize("size", [5e4, 1e7, 5e7])
def test_stiff_rubber_is_no_remainder(size: float, top: float) -> None:
    test = rising(size, top)
    found = moduli_of_test(replace(rubber(0, simulation=TENSILE | {"order": 2}), tensile=test))
    assert found is not None
    powers = test.strain[:, None] ** np.arange(1, 3)
    plain = np.linalg.lstsq(powers, test.stress_Pa, rcond=None)[0]
    off = np.array(found.mean) - plain
    assert np.all(np.abs(off) < 3.0 * np.sqrt(np.diagonal(found.covariance)))
    assert abs(off[0]) < 0.05 * plain[0]


def test_stiff_rubbers_are_the_same_in_other_units() -> None:
    each = []
    for size in (1e7, 5e7):
        made = replace(rubber(0, simulation=TENSILE | {"order": 2}), tensile=rising(size, 1.5))
        found = moduli_of_test(made)
        assert found is not None
        each.append((np.array(found.mean) / size, np.array(found.covariance) / size**2))
    np.testing.assert_allclose(each[1][0], each[0][0], rtol=1e-5)
    np.testing.assert_allclose(each[1][1], each[0][1], rtol=1e-3)


def test_moduli_of_another_run_go_together_as_its_draws_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two moduli of which one is the lower the higher the other is."""
    first, apart = np.random.default_rng(0).standard_normal((2, 500))
    draws = {"E_1": 2e5 + 1e4 * first, "E_2": 6e4 - 3e3 * first + 1e3 * apart, "other": first}
    blueprint = SimpleNamespace(simulation=Simulation(order=2, law="constant"), tensile_range=(0.0, 1.0))
    run = SimpleNamespace(model=SimpleNamespace(blueprint=blueprint, tensile=None), draws=None)
    listed = [SimpleNamespace(name=name, draws=values) for name, values in draws.items()]
    monkeypatch.setattr(material, "load_run", lambda folder: run)
    monkeypatch.setattr(material, "reported", lambda model, draws: listed)
    found = material.material_of(build.specimen({"moduli": "run:elsewhere", "order": 2}, levels_kPa=(100.0,)))
    assert found is not None and found.strain_range is None
    assert found.mean == pytest.approx((2e5, 6e4), rel=0.01)
    expected = [[1e8, -3e7], [-3e7, 1e7]]
    np.testing.assert_allclose(found.covariance, expected, rtol=0.15)
    correlation = found.covariance[0][1] / np.sqrt(found.covariance[0][0] * found.covariance[1][1])
    assert correlation == pytest.approx(np.corrcoef(draws["E_1"], draws["E_2"])[0, 1])
