"""The part of the calibration report that is about a bladder material's tensile test."""

from __future__ import annotations

import math

import pandas as pd
from markupsafe import Markup

from mpam_calib.report import wording
from mpam_calib.report.blocks import (
    Block,
    DataTable,
    Figure,
    Headline,
    KeyNumber,
    Numbers,
    Section,
    Text,
)
from mpam_calib.report.figures import residuals, strain_range
from mpam_calib.report.figures import tensile as stress_strain
from mpam_calib.report.headline import first_modulus, stresses
from mpam_calib.report.numbers import row_with_band, with_band
from mpam_calib.report.spoken import spoken
from mpam_calib.report.trust import assess
from mpam_calib.report.view import CalibrationView


def tensile_lead(view: CalibrationView) -> list[Block]:
    """First screen: the stress at two strains, the first modulus, and whether to trust them."""
    cards, parts = [], []
    for row in stresses(view):
        value, band = row_with_band(row, 1e-3)
        strain = f"{row['contraction']:.3g}"
        parts.append(spoken(value, band, "kPa", f" at a strain of {strain}"))
        cards.append(KeyNumber(f"Stress at strain {strain}", value, "kPa", f"90 % band: {band} kPa"))
    if (first := first_modulus(view)) is not None:
        value, band = row_with_band(first, 1e-3)
        engineering = view.simulation.strain == "engineering"
        hint = "the law's slope at no strain" if engineering else "a coefficient in the stretch, not a slope"
        cards.append(KeyNumber("First modulus E_1", value, "kPa", f"90 % band: {band} kPa", hint))
    name = view.material or view.name
    sentence = Markup("Stretched, {} carries {}.").format(name, Markup(" and ").join(parts))
    return [Headline(sentence), Numbers(cards), assess(view)]


def tensile_sections(view: CalibrationView) -> list[Section]:
    """Stress against strain, what the law misses, and what the strain range does."""
    caption = (
        "Dots: readings. Line: median of the law; dark and light band: 50 % and 90 %. "
        "Grey: outside the readings."
    )
    found = [
        Section(
            "Stress against strain",
            [
                Text(wording.material_sentence(view.simulation)),
                Figure(stress_strain.draw(view), caption, "Stress against strain with bands."),
            ],
        )
    ]
    if not view.readings("tensile").empty:
        caption = (
            "Readings minus law. Dots: single readings. Line: their means over short stretches of the strain."
        )
        if view.tensile and math.isfinite(view.noise):
            caption += " Grey: one sigma of the noise."
        found.append(
            Section(
                "What the law misses",
                [Figure(residuals.draw_stress(view), caption, "Residuals against strain.")],
            )
        )
    if not view.strain_range.empty:
        found.append(_range_section(view))
    return found


def _range_section(view: CalibrationView) -> Section:
    caption = (
        "Dot and line: mean and 90 % band when only readings in that strain range are fitted. "
        "Filled: the range in use."
    )
    table = range_table(view.strain_range)
    return Section(
        "What the strain range does",
        [
            Figure(strain_range.draw(view), caption, "Moduli and predictions for several strain ranges."),
            DataTable(
                table, "Mean (90 % band) for each strain range", {str(c): "{}" for c in table.columns[1:]}
            ),
        ],
        "A polynomial fitted to large strains can be wrong at the small ones that a muscle's bladder sees, "
        "and the other way round. Choose the range that the bladder sees." + _slope(view),
    )


def _slope(view: CalibrationView) -> str:
    """What E_1 is where the law misses: its band holds the polynomial's slope, not the rubber's."""
    if view.simulation.strain != "engineering":
        return ""
    return (
        " E_1 is the slope at no strain of the polynomial, and its band is that slope's: where it moves with "
        "the range, the rubber's own slope at small strains lies elsewhere."
    )


def range_table(frame: pd.DataFrame) -> pd.DataFrame:
    """One row for each quantity, one column for each strain range, "mean (q05–q95)" in the cells."""
    rows: dict[str, dict[str, str]] = {}
    for row in frame.to_dict("records"):
        label = f"{row['quantity']} ({row['unit']})" if row["unit"] else str(row["quantity"])
        used = " (in use)" if row["used"] else ""
        column = f"{row['strain_low']:g} to {row['strain_high']:g}{used}"
        mean, q05, q95 = float(row["mean"]), float(row["q05"]), float(row["q95"])
        text, band = with_band(mean, q05, q95)
        rows.setdefault(label, {"quantity": label})[column] = f"{text} ({band})"
    return pd.DataFrame(list(rows.values()))
