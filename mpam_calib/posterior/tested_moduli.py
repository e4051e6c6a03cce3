"""The moduli that a specimen's own tensile test gives, before any muscle is looked at.

``calibrate`` samples test and muscle at once. Where many simulations of the muscle are compared
(``diagnose``, ``select``) the test comes first, and what it says is their common prior: the posterior of
the moduli is averaged over the test's noise and remainder, and taken for a Gaussian.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.blueprint import MaterialPosterior, draw_blueprint
from mpam_calib.model.model import build_model
from mpam_calib.posterior.density.collapsed import Collapsed, Data
from mpam_calib.posterior.density.guide import Guide
from mpam_calib.posterior.density.mode import Mode, climb, curvature, evaluate, starts
from mpam_calib.posterior.likelihood.tensile_points import gather_tensile
from mpam_calib.specimen.recording import Specimen

Array = NDArray[np.float64]

NODES = np.linspace(-5.0, 5.0, 33)
"""Places along each axis of the mode's ellipsoid, in Laplace sds."""
TELLING = 1e-6
"""Weights below this share of the largest say nothing."""


def moduli_of_test(specimen: Specimen) -> MaterialPosterior | None:
    """Mean and covariance of the moduli by the tensile test, Pa; None where they come from elsewhere."""
    declared = specimen.simulation
    if declared.moduli != "tensile" or specimen.tensile is None:
        return None
    blueprint = draw_blueprint(specimen).model_copy(update={"geometry": None})
    model = build_model(blueprint)
    assert model.tensile is not None and model.moduli is not None
    low, high = model.tensile.low, model.tensile.high
    target = Collapsed(model, Data(None, None, gather_tensile(specimen.tensile, low, high)), Guide())
    u = _places(_best(target))
    log_p = evaluate(target, u)
    telling = log_p > log_p.max() + np.log(TELLING)
    u, weight = u[telling], np.exp(log_p[telling] - log_p.max())
    weight /= weight.sum()
    values = model.values(u)
    mean, covariance = target.linear_moments(values)
    _, transform = model.moduli.transform(values)
    p = model.linear_sizes[0]
    mean = np.einsum("bqp,bp->bq", np.broadcast_to(transform, (len(u), *transform.shape[1:])), mean[:, :p])
    covariance = transform @ covariance[:, :p, :p] @ np.swapaxes(transform, 1, 2)
    centre = weight @ mean
    apart = mean - centre
    whole = np.einsum("b,bij->ij", weight, covariance) + (apart * weight[:, None]).T @ apart
    return MaterialPosterior(
        mean=tuple(map(float, centre)),
        covariance=tuple(tuple(map(float, row)) for row in whole),
        strain_range=blueprint.tensile_range,
        convention=declared.strain,
    )


def _best(target: Collapsed) -> Mode:
    """The likeliest mode, whether the misfit is taken for noise or for structure."""
    ends = [climb(target, start) for start in starts(target)]
    return max(
        (Mode(u, top, curvature(target, u, top)) for u, top in ends), key=lambda mode: mode.log_evidence
    )


def _places(mode: Mode) -> Array:
    """Even places (n, d) all about a mode, along the axes of its ellipsoid."""
    power, axes = np.linalg.eigh(mode.covariance)
    grid = np.stack(np.meshgrid(*[NODES] * len(mode.u), indexing="ij"), -1).reshape(-1, len(mode.u))
    return np.asarray(mode.u + (grid * np.sqrt(power)) @ axes.T)
