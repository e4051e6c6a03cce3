"""Free contraction as the first root of a curve."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from model import build

from mpam_calib.model.blueprint import Options, draw_blueprint
from mpam_calib.model.model import build_model
from mpam_calib.prediction.curves import contraction_grid, first_root
from mpam_calib.specimen.declaration import Geometry

GRID = np.arange(101) * 0.005


@settings(max_examples=100, deadline=None)
@given(st.floats(0.0, 0.499), st.floats(1.0, 500.0))
def test_exact_on_straight_lines(root, slope):
    assert float(first_root(GRID, slope * (root - GRID))) == pytest.approx(root, abs=1e-12)


def test_zero_where_the_muscle_does_not_pull():
    assert float(first_root(GRID, -1.0 - GRID)) == 0.0
    assert float(first_root(GRID, -GRID)) == 0.0
    # Nor without any force, nor where it only begins to pull after a contraction that nothing brings about.
    assert float(first_root(GRID, 0.0 * GRID)) == 0.0
    assert float(first_root(GRID, GRID)) == 0.0
    # A curve that starts below zero and rises above it pulls nowhere that it could have reached.
    assert float(first_root(GRID, GRID - 0.1)) == 0.0


def test_the_end_of_the_grid_where_there_is_no_root():
    assert float(first_root(GRID, 1.0 + GRID)) == GRID[-1]


def test_the_first_of_several():
    wave = np.cos(GRID * np.pi / 0.2)
    assert float(first_root(GRID, wave)) == pytest.approx(0.1, abs=1e-12)


def test_a_root_on_a_grid_point():
    curve = 0.25 - GRID
    curve[50] = 0.0
    assert float(first_root(GRID, curve)) == pytest.approx(0.25, abs=1e-15)


def test_many_curves_at_once():
    roots = np.linspace(0.01, 0.49, 12).reshape(3, 4)
    assert first_root(GRID, roots[..., None] - GRID) == pytest.approx(roots, abs=1e-12)


@pytest.mark.parametrize(
    ("alpha0", "kinematics", "root"),
    [(54.7, "inextensible_braid", 0.363), (61.4, "constant_thickness", 0.408)],
)
def test_thick_soft_walls_pull_beyond_the_limit_of_an_ideal_braid(alpha0, kinematics, root):
    """Roots (computed by another code from the declared equations) of walls of no stiffness."""
    simulation = {
        "kinematics": kinematics, "moduli": "tensile", "E_Pa": [1.0], "E_rel_sd": 0.1,
        "order": 1, "law": "constant",
    }  # fmt: skip
    geometry = Geometry(L0_mm=50.0, R0_mm=3.0, t0_mm=1.2, alpha0_deg=alpha0)
    specimen = build.specimen(simulation, build.loops(), geometry=geometry)
    grid = contraction_grid(build_model(draw_blueprint(specimen, Options())), 0.0)
    assert root < grid[-1] < 1.15 * root
