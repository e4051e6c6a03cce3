"""The picture of a tensile test: what lies outside the readings is grey, on either side of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.patches import Rectangle

from mpam_calib.report.blocks import Numbers
from mpam_calib.report.figures import tensile
from mpam_calib.report.tensile import tensile_lead

from .synthetic import material


@pytest.mark.parametrize(
    ("low", "high", "shaded"),
    [
        (0.5, 3.0, [(0.0, 0.5), (3.0, 3.3)]),
        (0.5, 4.0, [(0.0, 0.5)]),
        (0.0, 3.0, [(3.0, 3.3)]),
        (0.0, 4.0, []),
        (5.0, 6.0, []),
    ],
)
def test_strains_that_were_not_read_are_shaded(
    low: float, high: float, shaded: list[tuple[float, float]]
) -> None:
    view = material(n_draws=100)
    strain = view.bands["contraction"]
    beyond = (strain < low - 1e-9) | (strain > high + 1e-9)
    (ax,) = tensile.draw(replace(view, bands=view.bands.assign(extrapolated=beyond))).axes
    spans = [p for p in ax.patches if isinstance(p, Rectangle)]
    found = sorted((p.get_x(), p.get_x() + p.get_width()) for p in spans)
    assert len(found) == len(shaded)
    assert np.allclose(found, shaded, atol=1e-6)
    assert len([t for t in ax.texts if t.get_text() == "outside the readings"]) == len(shaded)


@pytest.mark.parametrize(("strain", "slope"), [("engineering", True), ("stretch", False)])
def test_a_polynomial_in_the_stretch_has_no_slope_for_a_first_coefficient(strain: str, slope: bool) -> None:
    """σ = Σ E_k (1 + ε)^k rises by Σ k E_k at no strain: E_1 alone may be far from it, and below 0."""
    view = material(n_draws=100)
    simulation = view.simulation.model_copy(update={"strain": strain})
    numbers = next(b for b in tensile_lead(replace(view, simulation=simulation)) if isinstance(b, Numbers))
    (card,) = (card for card in numbers.items if card.label == "First modulus E_1")
    assert (card.note == "the law's slope at no strain") == slope
