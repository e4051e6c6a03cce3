"""Noise along strokes as Markov parts, against the dense covariance that it stands for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from model import build

from mpam_calib.model.blueprint import Options, draw_blueprint
from mpam_calib.posterior.density.target import build_target
from mpam_calib.posterior.likelihood.bins import bin_loops
from mpam_calib.posterior.likelihood.covariance import StrokeCovariance
from mpam_calib.posterior.likelihood.markov import factor, whiten
from mpam_calib.posterior.likelihood.scatter import MarkovScatter

from .reference import Twin

# White sd, correlated sd, its time constant and the strokes' own remainder.
NOISE = {
    "both": tuple(np.array([[0.2, 0.5, 1e-3], [0.1, 1.0, 0.3], [0.05, 2.0, 0.3], [0.1, 0.01, 2.0]])),
    "correlated": (np.array([0.2, 0.5]), np.array([0.1, 1.0]), np.array([0.02, 1.0]), np.zeros(2)),
    "remainder": (np.array([0.2, 0.5]), np.zeros(2), np.ones(2), np.array([0.1, 1.0])),
}
RECORDED = build.loops((100.0, 150.0, 200.0), (8.0, 10.0, 12.5), (200, 250, 12), dt=0.01)


@pytest.mark.parametrize("noise", NOISE)
def test_one_pass_along_time_says_what_the_dense_covariance_says(noise):
    """Strokes of different lengths, so that some places are empty; 1e-10 of products and determinants."""
    layout = StrokeCovariance.build(bin_loops(RECORDED))
    assert layout.pad.any()
    assert layout.steps is not None
    found = factor(layout.parts(layout.steps, *NOISE[noise]))
    dense = layout.matrix(*NOISE[noise])
    B, K, m, _ = dense.shape
    columns = np.random.default_rng(0).standard_normal((B, K, m, 5)) * ~layout.kind_pad[..., None]
    white = np.ascontiguousarray(columns.transpose(2, 3, 0, 1))
    whiten(found, white)
    products = np.einsum("mcbk,mdbk->bkcd", white, white)
    assert products == pytest.approx(np.swapaxes(columns, 2, 3) @ np.linalg.solve(dense, columns), rel=1e-10)
    assert found.log_determinant == pytest.approx(np.linalg.slogdet(dense)[1], abs=1e-10)


def test_the_scatter_inside_bins_says_what_its_dense_covariance_says():
    rng = np.random.default_rng(0)
    loops = build.with_force(build.specimen({}, RECORDED), rng.standard_normal(len(RECORDED.time_s))).loops
    bins = bin_loops(loops)
    assert bins.scatter is not None
    white, correlated, time, _ = NOISE["both"]
    found = MarkovScatter.build(bins.scatter, 3).log_likelihood(white, correlated, time)
    assert found == pytest.approx(bins.scatter.log_likelihood(3, white, correlated, time), rel=1e-10)


def test_a_stroke_that_turns_back_is_left_to_the_dense_covariance():
    """The remainder's kernel is then no product of steps; the likelihood is still the twin's."""
    way = RECORDED.displacement_m.copy()
    way[100:110] -= 2e-3
    made = build.specimen({"law": "linear", "order": 3}, replace(RECORDED, displacement_m=way))
    made = build.with_force(made, 20.0 + np.random.default_rng(0).standard_normal(len(way)))
    blueprint = draw_blueprint(made, Options())
    target = build_target(made, blueprint)
    assert StrokeCovariance.build(target.data.bins).steps is None
    values = target.model.values(np.zeros((1, len(target.model.names))))
    theta = {name: float(v[0, 0]) for name, v in values.items()}
    slow = Twin(made, blueprint).log_likelihood(theta, None, None, None)
    assert target.log_likelihood(values)[0] == pytest.approx(slow, rel=1e-8)


def test_the_only_reading_of_a_stroke_has_the_noise_of_one_reading():
    """It takes no time; whatever the noise's time constant, its variance is white² + correlated²."""
    whole = RECORDED.stroke == RECORDED.stroke[-1]
    alone = RECORDED.without(whole & (np.cumsum(whole) > 1))
    layout = StrokeCovariance.build(bin_loops(alone))
    times = np.array([0.02, 0.2, 1.0, 30.0])
    white, correlated = np.full(4, 0.2), np.full(4, 0.5)
    dense = layout.matrix(white, correlated, times, np.zeros(4))
    kind = layout.kind[-1]
    assert layout.pad[-1].sum() == layout.pad.shape[1] - 1
    assert dense[:, kind, 0, 0] == pytest.approx(np.full(4, 0.04 + 0.25), rel=1e-6)
