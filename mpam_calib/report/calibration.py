"""The calibration report: can I trust this number, and what does it rest on?"""

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
    Notice,
    Numbers,
    Section,
    Text,
)
from mpam_calib.report.figures import corner, loops, pressure, priors, residuals
from mpam_calib.report.held import held_between
from mpam_calib.report.numbers import decimals, fixed, row_with_band, significant
from mpam_calib.report.one_branch import pull_of
from mpam_calib.report.page import Page
from mpam_calib.report.parameters import RIGHT, learnt_table, summary_table
from mpam_calib.report.past import off_bands
from mpam_calib.report.reach import MOST, contraction_band, still_pulling
from mpam_calib.report.spoken import spoken
from mpam_calib.report.tensile import tensile_lead, tensile_sections
from mpam_calib.report.trust import assess
from mpam_calib.report.view import CalibrationView

LONG_TABLE = 12
"""Tables with more rows are folded."""


def calibration_page(view: CalibrationView) -> Page:
    """The report of one calibration: a muscle, or a bladder material if only a tensile test was made."""
    lead = tensile_lead(view) if view.tensile else _lead(view)
    sections = [] if view.tensile else _sections(view)
    sections += tensile_sections(view) if view.stretched else []
    notice: list[Block] = [Notice(view.provenance)] if view.provenance else []
    kind = "Bladder material" if view.tensile else "Muscle"
    subtitle = f"{kind} calibration" + (f" · {view.material}" if view.material else "")
    return Page(view.name, subtitle, [*notice, *lead], [*sections, *common_sections(view)])


def _lead(view: CalibrationView) -> list[Block]:
    top = view.top_level_kPa
    parts: list[Markup] = []
    cards: list[KeyNumber] = []
    blocked = view.at_level("blocked_force_N", top)
    if blocked is not None:
        value, band = row_with_band(blocked)
        parts.append(Markup("pulls with ") + spoken(value, band, "N", " when it is held at full length"))
        cards.append(
            KeyNumber(
                "Blocked force", value, "N", f"90 % band: {band} N", f"at {top:.4g} kPa, {pull_of(view)}"
            )
        )
    free = view.at_level("free_contraction", top)
    if free is not None:
        words, card = _free(view, free)
        parts.append(words)
        cards.append(card)
    cards += _fit_cards(view)
    sentence = Markup("At {} kPa, {} {}.").format(f"{top:.4g}", view.name, Markup(" and ").join(parts))
    return [Headline(sentence), Numbers(cards), assess(view)]


def _free(view: CalibrationView, free: pd.Series) -> tuple[Markup, KeyNumber]:
    """The top level's free contraction in the headline and on its card, or that the muscle pulls there."""
    value, band = contraction_band(view, free)
    note = f"at {view.top_level_kPa:.4g} kPa, of the length at rest"
    if (which := still_pulling(view, free)) in MOST:
        words = Markup("<b>{} %</b> contraction").format(value)
        said = f"{which} of the plausible curves do, and end there"
        return words, KeyNumber("Free contraction", value, "%", said, note)
    words = Markup("shortens by ") + spoken(value, band, "%", " of its length without load")
    note += "; some of the plausible curves pull as far as they go" if which else ""
    return words, KeyNumber("Free contraction", value, "%", f"90 % band: {band} %", note)


def _fit_cards(view: CalibrationView) -> list[KeyNumber]:
    """What the simulation misses, and whether levels left out are foreseen, where these were assessed."""
    held = held_between(view)
    unseen = f"at a pressure level that the fit had not seen, {held} of readings fell in bands meant for 90 %"
    if math.isfinite(view.remainder):
        size, noise = (fixed(x, decimals(x)) for x in (view.remainder, view.noise))
        words = f"noise of a reading: {noise} N" if math.isfinite(view.noise) else ""
        return [KeyNumber("Simulation misses by", size, "N", words, "" if held is None else unseen)]
    if held is None:
        return []
    text = f"{100 * held.share:.0f}"
    words = "of readings at a pressure level that the fit had not seen fell in its bands"
    return [KeyNumber("Levels left out", text, "%", words, "should be 90 %")]


def _sections(view: CalibrationView) -> list[Section]:
    shown = len(loops.shown_levels(view))
    omitted = f" {shown} of {len(view.levels_kPa)} levels are shown." if shown < len(view.levels_kPa) else ""
    branches = set(view.readings("loops", "force_map")["branch"])
    moving = bool({"loading", "unloading"} & branches)
    found: list[Section] = []
    if not view.quantity("force_N").empty:
        caption = (
            "Dots: readings, or means of neighbours in one stroke. Line: median of the calibrated "
            "simulation; dark and light bands hold the true "
            f"force with 50 % and 90 % probability.{_noisy_words(view)}{off_bands(view)}{omitted}"
        )
        colours = " Blue: loading (pulled back to length). Orange: unloading (contracting)." if moving else ""
        alt = f"Force against contraction with bands at {shown} pressure levels of {view.name}."
        found.append(
            Section(
                "Force against contraction",
                [
                    Text(wording.simulation_sentence(view.simulation)),
                    Figure(loops.draw(view), caption + colours, alt),
                ],
            )
        )
    if not view.readings("loops", "force_map").empty:
        found.append(_residual_section(view))
    found.append(_pressure_section(view))
    if not view.left_out.empty:
        found.append(_left_out_section(view))
    return found


def _noisy_words(view: CalibrationView) -> str:
    if view.quantity("force_N_observed").empty:
        return ""
    return " Dotted: where 90 % of new readings fall, their noise included."


def _residual_section(view: CalibrationView) -> Section:
    caption = (
        "Readings minus simulation. Dots: readings, or means of neighbours in one stroke. Lines: their means "
        "over short stretches of the stroke, one colour for each level. Grey: one sigma of a reading's noise."
    )
    return Section(
        "What the simulation misses",
        [Figure(residuals.draw(view), caption, "Residuals against contraction by level and branch.")],
        "A simulation that is right leaves lines that wander inside the grey strip. A shape that several "
        "levels share is physics that it leaves out.",
    )


def _pressure_section(view: CalibrationView) -> Section:
    measured = not view.readings("blocked_force", "free_contraction").empty
    caption = (
        "Line: median. Dark and light band: 50 % and 90 %. Dots: the levels of the data; hollow where "
        "the readings end before." + (" Crosses: readings of the test itself." if measured else "")
    )
    if any(still_pulling(view, view.at_level("free_contraction", level)) for level in view.levels_kPa):
        caption += f" A band that goes up to {100 * view.curves_end:.3g} % ends only where the curves end."
    levels = pd.DataFrame([_level_row(view, level) for level in sorted(float(x) for x in view.levels_kPa)])
    right = dict.fromkeys(levels.columns, "{}")
    return Section(
        "Blocked force and free contraction",
        [
            Figure(
                pressure.draw(view),
                caption,
                "Blocked force and free contraction against pressure with bands.",
            ),
            DataTable(levels, "Mean and 90 % band at each level", right, collapse=len(levels) > LONG_TABLE),
        ],
    )


def _left_out_section(view: CalibrationView) -> Section:
    beyond = {True: " (beyond the others)", False: ""}
    rows = [
        {
            "level (kPa)": f"{row['pressure_kPa']:.4g}{beyond[bool(row['extrapolated'])]}",
            "in their 90 % band": f"{100 * row['inside90']:.0f} %",
            "missed by (N, rms)": significant(row["rmse_N"], 2),
            "mean miss (N)": f"{significant(row['bias_N'], 2)} ± {significant(row['bias_sd_N'], 1)}",
        }
        for row in view.left_out.to_dict("records")
    ]
    table = pd.DataFrame(rows)
    some = len(rows) < len(view.levels_kPa)
    caption = (
        "Readings of a level that the fit has not seen; ±: one sigma that the prediction gives its own mean"
        + (f". {len(rows)} of {len(view.levels_kPa)} levels are looked at" if some else "")
    )
    return Section(
        "Each level predicted from the others",
        [DataTable(table, caption, dict.fromkeys(table.columns, "{}"), collapse=len(table) > LONG_TABLE)],
        "What happens at a pressure that was not recorded: far fewer than 90 % means that the simulation's "
        "dependence on pressure is wrong, and its bands hold at the recorded pressures only.",
    )


def _level_row(view: CalibrationView, level: float) -> dict[str, str]:
    blocked, free = view.at_level("blocked_force_N", level), view.at_level("free_contraction", level)
    row = {"pressure (kPa)": f"{level:.4g}"}
    for name, cells in (
        ("blocked force (N)", None if blocked is None else row_with_band(blocked)),
        ("free contraction (%)", None if free is None else contraction_band(view, free)),
    ):
        mean, band = cells or ("–", "–")
        row |= {name: mean, f"90 % band of the {name.split(' (')[0]}": band}
    return row


def common_sections(view: CalibrationView) -> list[Section]:
    """Parameters, their pairs, convergence, identification, data: the same for every calibration."""
    return [
        *_parameter_sections(view),
        _convergence_section(view),
        _identified_section(view),
        _data_section(view),
    ]


def _parameter_sections(view: CalibrationView) -> list[Section]:
    names = view.shown_parameters()
    columns = ["parameter", "what it is", "unit", "mean", "90 % band", "sd", "prior sd"]
    full = summary_table(view)
    blocks: list[Block] = []
    if names:
        head = summary_table(view, names)
        blocks.append(DataTable(head[columns], "Headline parameters", RIGHT))
        caption = (
            "Blue: after the data. Grey: before them (prior), cut off where it runs on beyond the picture."
        )
        blocks.append(
            Figure(priors.draw(view), caption, "Prior and posterior density of each headline parameter.")
        )
    caption = f"All {len(full)} parameters, with sampling diagnostics"
    blocks.append(DataTable(full, caption, RIGHT, collapse=bool(names)))
    note = "A parameter whose blue and grey curves coincide has learnt nothing from the data."
    found = [Section("Parameters", blocks, note if names else "")]
    if len(names) > 1:
        found.append(_pairs_section(view))
    return found


def _pairs_section(view: CalibrationView) -> Section:
    blocks: list[Block] = []
    strong = [(a, b, r) for a, b, r in corner.correlations(view) if abs(r) >= 0.8][:3]
    if strong:
        listed = "; ".join(f"{a} and {b} ({'+' if r > 0 else '−'}{abs(r):.2f})" for a, b, r in strong)
        blocks.append(
            Text(
                f"Strongly linked (correlation): {listed}. A change in one is made up for by the other: "
                "quote them together or not at all."
            )
        )
    caption = (
        "Dark and light regions hold 50 % and 90 % of the plausible pairs. "
        "A thin slanted region is a trade-off."
    )
    blocks.append(Figure(corner.draw(view), caption, "Corner plot of the headline parameters."))
    return Section("Which parameters trade off", blocks)


def _convergence_section(view: CalibrationView) -> Section:
    return Section("Has the calculation settled?", [Text(wording.convergence_sentences(view.convergence))])


def _identified_section(view: CalibrationView) -> Section:
    if view.unidentified.empty:
        return Section(
            "What the data could not identify",
            [Text("Nothing but noise and misfit was fitted: there is nothing to identify.")],
        )
    table = learnt_table(view)
    note = (
        "“Learnt” is how much narrower than its prior a parameter became: "
        "0 % is nothing, 100 % is everything."
    )
    caption = "Least identified first"
    return Section(
        "What the data could not identify",
        [DataTable(table, caption, RIGHT, collapse=len(table) > 2 * LONG_TABLE)],
        note,
    )


def _data_section(view: CalibrationView) -> Section:
    blocks: list[Block] = [Notice(text) for text in view.warnings]
    if not view.data_files.empty:
        blocks.append(DataTable(view.data_files, "Files read"))
    if view.settings:
        settings = pd.DataFrame({"setting": list(view.settings), "value": list(view.settings.values())})
        blocks.append(
            DataTable(settings, "Settings: with the same seed, data and versions the same numbers come out")
        )
    return Section("Data and settings", blocks)
