"""Sizes that no muscle has: the density there is none, and nothing is said about the arithmetic."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
from model import build

from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.posterior.density.target import build_target


def test_where_no_muscle_has_the_shape_the_density_is_none_and_silent() -> None:
    """A fixture that gives so much that the muscle would have turned inside out, and further."""
    bare = build.loops((100.0, 150.0), 12.0, 20)
    loops = replace(bare, force_N=np.full(len(bare.force_N), 100.0))
    made = build.specimen({"effects": ["rig_compliance", "tip_shape"], "law": "linear", "order": 2}, loops)
    target = build_target(made, draw_blueprint(made, build.PLAIN))
    u = np.zeros((1, len(target.model.names)))
    u[0, target.model.names.index("compliance_mm_per_N")] = 36.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert target.log_posterior(u)[0] == -np.inf
