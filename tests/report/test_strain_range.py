"""The figure of strain ranges: titles that keep to their panels, an axis label for each."""

from __future__ import annotations

import pandas as pd

from mpam_calib.report.figures import strain_range

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
