"""The figure of strain ranges: titles that keep to their panels, an axis label for each."""

from __future__ import annotations

from dataclasses import replace

import pandas as pd

from mpam_calib.report.figures import strain_range
from mpam_calib.report.tensile import tensile_sections

from .synthetic import material

QUANTITIES = (
    ("E_1", "Pa"),
    ("E_2", "Pa"),
    ("force at 10 % of an MPAM1-shaped muscle, 200 kPa", "N"),
    ("its free contraction", ""),
)


def test_titles_do_not_print_over_each_other_and_every_axis_has_a_label() -> None:
    rows = [(0.0, high, high == 1.0, *q, 1.0, 0.9, 1.1) for high in (0.5, 1.0) for q in QUANTITIES]
    columns = ["strain_low", "strain_high", "used", "quantity", "unit", "mean", "q05", "q95"]
    figure = strain_range.draw(material(strain_range=pd.DataFrame(rows, columns=columns)))
    figure.canvas.draw()
    boxes = [ax.title.get_window_extent() for ax in figure.axes]
    for i, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[i + 1 :])
    assert all(ax.get_xlabel() for ax in figure.axes)


def test_the_first_modulus_is_told_to_be_the_polynomials_slope_not_the_rubbers() -> None:
    """A rubber that is no polynomial has a slope at small strains that the band of E_1 may not hold."""
    rows = [(0.0, high, high == 1.0, "E_1", "Pa", 1.0, 0.9, 1.1) for high in (0.5, 1.0)]
    columns = ["strain_low", "strain_high", "used", "quantity", "unit", "mean", "q05", "q95"]
    view = material(strain_range=pd.DataFrame(rows, columns=columns))
    for convention, told in (("engineering", True), ("stretch", False)):
        simulation = view.simulation.model_copy(update={"strain": convention})
        sections = tensile_sections(replace(view, simulation=simulation))
        (section,) = (s for s in sections if s.title == "What the strain range does")
        assert ("slope at no strain of the polynomial" in section.note) == told
