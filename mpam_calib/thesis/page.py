"""The reproduction's report: errata first, tables side by side, figures redrawn."""

from __future__ import annotations

import pandas as pd

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
from mpam_calib.report.page import Page
from mpam_calib.thesis import errata as printed_errors
from mpam_calib.thesis import orders
from mpam_calib.thesis.chapter3 import MONOFILAMENTS, SHORT, Chapter3, best_force, loss, strands_that_fit
from mpam_calib.thesis.figures import muscles, optimisation
from mpam_calib.thesis.ledger import MISPRINT, NOT_REPRODUCIBLE, REPRODUCED, Ledger
from mpam_calib.thesis.posterior import MPAM2, MuscleBands, missing, parameters, strand_factors, table_4_12
from mpam_calib.thesis.reproduction import Reproduction
from mpam_calib.thesis.tables import NAMES, table


def page(result: Reproduction, bands: dict[str, MuscleBands] | None = None) -> Page:
    """The whole page; ``bands`` puts a posterior beside Table 4.12 and into the figures that can show it."""
    bands = bands or {}
    return Page(
        "The thesis, recomputed",
        "Every printed number held against its own equations",
        lead=_lead(result.ledger),
        sections=[
            _errata(result.ledger),
            _optimiser(result.chapter3),
            *_tables(result.ledger),
            _unprinted(result.ledger),
            _figures(result.chapter3, bands),
            compared(bands),
        ],
        footer="S. Zabihollah, Modelling, Design Optimization, and Experimental Characterization of "
        "Miniaturized Pneumatic Artificial Muscles (thesis).",
    )


def _lead(ledger: Ledger) -> list[Block]:
    n = ledger.counts()
    return [
        Headline(
            f"Of {n[REPRODUCED] + n[MISPRINT] + n[NOT_REPRODUCIBLE]} printed numbers {n[REPRODUCED]} are "
            f"reproduced, {n[MISPRINT]} contradict the thesis's own equations or tables, and "
            f"{n[NOT_REPRODUCIBLE]} cannot be recomputed, nearly all because the measurements are lost."
        ),
        Numbers(
            [
                KeyNumber(
                    "reproduced",
                    str(n[REPRODUCED]),
                    note="to rounding, or the text's “nearly”; flat optima to 0.2 %",
                ),
                KeyNumber("misprint", str(n[MISPRINT]), note="each with its proof below"),
                KeyNumber("not reproducible", str(n[NOT_REPRODUCIBLE]), note="measured curves are lost"),
                KeyNumber("recomputed besides", str(n["unprinted"]), note="values not printed as numbers"),
            ]
        ),
        Notice(
            "Nothing here was measured by us. The thesis's measured loops are lost; curves of its two "
            "muscles are "
            "reconstructed from the moduli that it prints, and are the image of polynomials, not of a test."
        ),
    ]


def _errata(ledger: Ledger) -> Section:
    found = printed_errors.errata(ledger)
    frame = pd.DataFrame(
        [(e.place, e.printed, e.reading, e.proof) for e in found],
        columns=["where", "printed", "read as", "proof"],
    )
    return Section(
        "Errata",
        [DataTable(frame, f"{len(found)} places where the print is not followed, and why.")],
        note="Numbers in the proofs are computed by this run.",
    )


def _optimiser(chapter: Chapter3) -> Section:
    one, two = chapter.optimality
    active = pd.DataFrame(
        [
            (case, a.name, a.multiplier, f"N per {a.unit}" if a.unit != "1" else "N per unit")
            for case, found in (("I", one), ("II", two))
            for a in found.active
        ],
        columns=["case", "active bound or constraint", "multiplier", "unit"],
    )
    starts = chapter.starts
    return Section(
        "Design optimisation",
        [
            Text(
                f"{starts.runs} searches of Case II from random populations, their evolutionary stage cut "
                f"short at {SHORT} generations ({starts.lowest_global:.1f} to {starts.highest_global:.1f} N, "
                f"as scattered as Table 3.3): SQP then reached {best_force(200):.5f} N to 1e-5 N in "
                f"{starts.reached_sqp} of them, interior point in {starts.reached_ip}, with "
                f"{starts.evaluations_mean:.0f} evaluations on average for all three stages, those for "
                "gradients included."
            ),
            DataTable(
                active,
                "What holds the optimum at 200 kPa, and what it would gain if relaxed. Non-negative "
                f"multipliers leave {max(one.residual, two.residual):.1%} of the gradient unbalanced.",
            ),
            _braids_share(chapter),
            *_optimisation_figures(chapter),
        ],
    )


def _braids_share(chapter: Chapter3) -> Text:
    """What the braid takes of the force at the optimum, with the printed strands and with others."""
    best, free = best_force(200), chapter.case_one.best
    packed, thin = chapter.packed.best, chapter.packed_monofilament.best
    losses = ", ".join(f"{loss(200, r * 1e3, 50):.1f} N at {r * 1e3:.2f} mm" for r in MONOFILAMENTS)
    return Text(
        f"Case I ends at n = {free.x[4]:.0f} strands of R_br = {free.x[3] * 1e3:.1f} mm, of which "
        f"{strands_that_fit():.0f} in each direction fit round the muscle. With strands that must "
        f"fit, the braid takes {best - packed.value:.3f} N instead of {best - free.value:.5f} N "
        f"(n = {packed.x[4]:.0f}, R_br = {packed.x[3] * 1e3:.2f} mm); with strands no thicker than a "
        f"real monofilament {best - thin.value:.2f} N (n = {thin.x[4]:.0f}, R_br = "
        f"{thin.x[3] * 1e3:.2f} mm), and with 50 of them {losses}. That the braid's term is "
        "negligible follows from strands that no braid has."
    )


def _optimisation_figures(chapter: Chapter3) -> list[Block]:
    return [
        Figure(
            optimisation.histories(chapter),
            "Approach by iteration. Interior point passes through designs outside the constraints.",
            "convergence curves",
        ),
        Figure(
            optimisation.over_pressure(chapter),
            "Three force models, and the optimum by pressure.",
            "lines over pressure with printed points",
        ),
        Figure(
            optimisation.sensitivity(chapter),
            "Post-optimality: R and α one at a time, the wall through the bound of V_bl/V, each ± 5 %.",
            "three sensitivity curves",
        ),
    ]


def _tables(ledger: Ledger) -> list[Section]:
    frame = ledger.frame()
    columns = ["row", "column", "printed", "computed", "verdict", "note"]
    blocks: list[Block] = []
    for name in NAMES:
        rows = frame[(frame["source"] == f"Table {name}") & (frame["printed"] != "")]
        if len(rows):
            counts = rows["verdict"].value_counts()
            told = ", ".join(f"{counts[v]} {v}" for v in counts.index)
            blocks.append(
                DataTable(rows[columns], f"{table(name).source}: {told}.", _formats(), collapse=True)
            )
    other = frame[~frame["source"].str.startswith("Table") & (frame["printed"] != "")]
    words = DataTable(other[["source", *columns]], "Numbers of text, equations and figures.", _formats())
    return [
        Section("Tables, printed beside computed", blocks),
        Section("The text's numbers", [words]),
    ]


def _unprinted(ledger: Ledger) -> Section:
    frame = ledger.frame()
    rows = frame[frame["printed"] == ""][["source", "row", "column", "computed", "note"]].copy()
    rows["note"] = rows["note"].str.replace("nothing printed to compare with; ", "", regex=False)
    caption = "Decoded curves, joint fits, checks: values that the thesis draws or implies but does not "
    "print."
    return Section("Recomputed values", [DataTable(rows, caption, _formats(), collapse=True)])


def _figures(chapter: Chapter3, bands: dict[str, MuscleBands]) -> Section:
    limits = {m: orders.range_from_print(m, r) for m, r in (("MPAM1", 0.8838), ("MPAM2", 0.8879))}
    note = "The measured curves of these figures are lost and are not imitated."
    return Section(
        "Figures of chapter 4",
        [
            Figure(muscles.outputs(bands), f"Blocked force and free contraction. {note}", "three panels"),
            Figure(muscles.order_selection(limits), "Orders, by relative least squares.", "curves"),
            Figure(
                muscles.average_curves(bands), f"Decoded average curves. {note}", "force against contraction"
            ),
            Figure(
                muscles.modulus_laws(),
                "Moduli (points) with the printed laws (dashed).",
                "moduli over pressure",
            ),
            Figure(
                muscles.strand_search(),
                "Search for f_s against the loop with Table 4.10's friction; shaded: the range that the "
                "thesis searched. The relative "
                "error's minimum depends on how near to free contraction the loop is used.",
                "error against f_s",
            ),
            Figure(
                muscles.loops(bands),
                f"Loops by theory, lines: f_s = 0.15 and Table 4.10's K_f. {note}"
                + (" Shaded: 90 % bands, where not narrower than the lines." if bands else ""),
                "loops",
            ),
        ],
        note="Shaded: 90 % bands of the posteriors that were given (medians where drawn); the last section "
        "says which are missing."
        if bands
        else "No calibrated run was given, so that no bands are drawn: the last section says how to add "
        "them.",
    )


def compared(bands: dict[str, MuscleBands]) -> Section:
    """What posteriors say beside the print, and which of them were not given."""
    blocks: list[Block] = []
    if bands:
        words = (
            "Printed beside the posterior's 90 % bands; the blocked force at 300 kPa needs a prediction to "
            "that pressure (mpam-calib predict RUN --pressure 50:300:50) and is extrapolated."
        )
        constants = "The thesis's constants beside the posterior's (Tables 4.4, 4.10, Fig. 4.20)."
        blocks += [
            Notice(
                "The runs are calibrations to reconstructed loops: they return what the loops were made from."
            ),
            *_unconverged(bands),
            DataTable(table_4_12(bands), f"Table 4.12. {words}"),
            DataTable(parameters(bands), constants),
        ]
        if any(own.f_s is not None for own in bands.values()):
            blocks += _strands(bands)
    absent = missing(bands)
    if len(absent):
        told = "Parts that need a posterior and were given none, and the commands that add them."
        blocks.append(DataTable(absent, told))
    return Section("With a posterior" if bands else "Posteriors: none given", blocks)


def _unconverged(bands: dict[str, MuscleBands]) -> list[Block]:
    """Which bands may be wrong."""
    names = [name for name, own in bands.items() if not own.converged]
    words = f"The sampling did not converge for {' and '.join(names)}: these bands may be wrong until it has."
    return [Notice(words)] if names else []


def _strands(bands: dict[str, MuscleBands]) -> list[Block]:
    words = (
        "f_s, the strands' friction, by least squares (200 kPa, to 0.98 of free contraction) and by "
        "posterior. The thesis's least squares are relative to the force and run to its lower bound, 0.15; "
        "the posterior weighs all levels by the noise."
    )
    own = bands.get(MPAM2)
    made = (
        "MPAM2's loops were reconstructed with f_s = 0.15: its posterior returns that value and proves "
        "nothing about the muscle. "
        if own is not None and own.f_s is not None
        else ""
    )
    coulomb = "MPAM1's loops carry the Coulomb friction of Table 4.10, and f_s is what comes nearest to it."
    return [DataTable(strand_factors(bands), words), Text(made + coulomb)]


def _formats() -> dict[str, str]:
    return {"computed": "{:.6g}"}
