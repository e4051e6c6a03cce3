"""The report of ``optimize``: the best designs, what they rest on and how far they are extrapolated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from markupsafe import Markup
from numpy.typing import NDArray

from mpam_calib.design.robust import Design, Packed
from mpam_calib.model.blueprint import Blueprint
from mpam_calib.model.effect import effect
from mpam_calib.prediction.curves import LIMIT, Reach
from mpam_calib.prediction.strain_range import MUSCLE
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
    Verdict,
)
from mpam_calib.report.design_bounds import beyond_bounds, within
from mpam_calib.report.designs_table import contraction_band, designs_of, mean_band, same_design
from mpam_calib.report.figures import designs as figure
from mpam_calib.report.numbers import fixed, row_with_band, significant
from mpam_calib.report.page import Page
from mpam_calib.report.spoken import spoken
from mpam_calib.units import DEG, KPA, MM

Array = NDArray[np.float64]

SHOWN_AT = 200.0 * KPA
"""The pressure of the first screen, Pa: that of the thesis's own optimum."""
NEGLIGIBLE = 0.01
"""Share of the blocked force below which the braid's term is."""
LAWS = {
    "constant": "they are taken not to depend on pressure at all",
    "linear": "their straight lines are drawn on",
    "exponential": "their exponentials run on, and grow as exponentials do",
    "exponential_each": "their exponentials run on, and grow as exponentials do",
    "free": "they are held at the nearest level's, give or take what they changed between the last two",
}


@dataclass(frozen=True)
class DesignsView:
    """What the page shows.

    ``designs`` in the order of pressure; ``table`` is designs.csv; ``packed`` one for each pressure,
    all with the upper bounds ``radii`` (m) of R_br; ``printed`` Table 3.5's forces (N) by case, one for
    each pressure; ``draws`` how many stand behind the searches and behind the bands; ``tested`` what the run
    predicts of the tested muscle itself at these pressures (rows as in predictions.csv).
    """

    name: str
    converged: bool
    blueprint: Blueprint
    designs: Sequence[Design]
    table: pd.DataFrame
    packed: Sequence[Packed]
    radii: Sequence[float]
    printed: Mapping[str, Array]
    draws: tuple[int, int]
    tested: pd.DataFrame = field(default_factory=pd.DataFrame)

    @property
    def of_the_thesis(self) -> bool:
        """Whether the tested muscle is the thesis's, so that its Table 3.5 is of the same muscle."""
        own = self.blueprint.geometry
        return own is not None and own.model_dump(exclude={"sd"}) == MUSCLE.model_dump(exclude={"sd"})

    def tested_force(self, P: float) -> tuple[str, str] | None:
        """The tested muscle's own blocked force at P (Pa) and its 90 % band (N), where the run gives it."""
        rows = self.tested
        if rows.empty:
            return None
        here = (rows["quantity"] == "blocked_force_N") & np.isclose(rows["pressure_kPa"], P / KPA)
        if not here.any():
            return None
        row = rows[here].iloc[0]
        return row_with_band(row)

    @property
    def levels(self) -> Array:
        """Recorded pressures, Pa."""
        return np.array(self.blueprint.levels)

    @property
    def pressures(self) -> list[float]:
        """Pressures of the designs, Pa."""
        return sorted({d.P for d in self.designs})

    @property
    def reach(self) -> Reach:
        """Where the recordings end."""
        return Reach.of(self.blueprint)

    def best(self, case: str, method: str = "posterior_mean") -> list[Design]:
        """The designs of a case by one method, by pressure."""
        chosen = [d for d in self.designs if d.case == case and d.method == method]
        return sorted(chosen, key=lambda d: d.P)


def designs_page(view: DesignsView) -> Page:
    """The whole page."""
    return Page(
        f"Designs: {view.name}",
        "Muscles with the largest blocked force, under the posterior of this run",
        lead=[_extrapolation(view), *_lead(view), _trust(view)],
        sections=[_by_pressure(view), _packing(view), _bands(view)],
        footer="Case I: R, t, α, R_br, n (thesis Eq. 3.12, 3.15). Case II: R, t, α (Eq. 3.16, 3.18). "
        "Bounds and constraints of Table 3.1.",
    )


def _extrapolation(view: DesignsView) -> Notice:
    geometry = view.blueprint.geometry
    assert geometry is not None
    x = np.array([d.x[:3] for d in view.designs])
    spans = [
        f"{symbol} = {_span(x[:, i] / unit, digits)}{name}"
        for i, (symbol, unit, name, digits) in enumerate(
            (("R", MM, " mm", 2), ("t", MM, " mm", 3), ("α", DEG, "°", 1))
        )
    ]
    tested, designed = (_pressures(p, to) for p, to in ((view.levels, " to "), (view.pressures, "–")))
    return Notice(
        f"Extrapolated. Everything that was fitted, the moduli above all, was fitted to one muscle with "
        f"R = {geometry.R0_mm:g} mm, t = {geometry.t0_mm:g} mm, α = {geometry.alpha0_deg:g}° at {tested}. "
        f"Here it is carried to {', '.join(spans)} and to {designed}, as if moduli belonged to the "
        "material alone. Moduli fitted at one R and t need not hold at another, and no band on this page "
        "contains that error: build and test a design before relying on it."
    )


def _span(values: Array, digits: int) -> str:
    low, high = fixed(float(values.min()), digits), fixed(float(values.max()), digits)
    return low if low == high else f"{low}–{high}"


def _pressures(ordered: Sequence[float] | Array, to: str) -> str:
    """The first and the last of some pressures (Pa); one alone stands by itself."""
    ends = dict.fromkeys(f"{P / KPA:.4g}" for P in (ordered[0], ordered[-1]))
    return f"{to.join(ends)} kPa"


def _shown(view: DesignsView) -> float:
    return min(view.pressures, key=lambda P: abs(P - SHOWN_AT))


def _lead(view: DesignsView) -> list[Block]:
    P = _shown(view)
    row = view.pressures.index(P)
    two = view.best("II")[row]
    one = view.best("I")[row]
    force, force_band = mean_band(two.force)
    free, free_band = contraction_band(two.contraction)
    sentence = Markup(
        "Within the thesis's bounds ({}) the muscle with the largest expected force at {:.0f} kPa (Case II: "
        "R {}, t {} mm, α {}°) should pull with {} and shorten by {} of its length without load."
    ).format(
        within(),
        P / KPA,
        fixed(two.x[0] / MM, 2),
        fixed(two.x[1] / MM, 3),
        fixed(two.x[2] / DEG, 1),
        spoken(force, force_band, "N"),
        spoken(free, free_band, "%"),
    )
    value, band = mean_band(one.force)
    cautious = view.best("II", "q05")[row]
    # Rounded down: what is exceeded.
    q05 = np.floor(10.0 * float(np.quantile(cautious.force, 0.05))) / 10.0
    cards = [
        KeyNumber("Case II", force, "N", f"90 % band: {force_band} N", "the wall and the angle chosen"),
        KeyNumber("Case I", value, "N", f"90 % band: {band} N", f"with {one.x[4]:.0f} strands chosen"),
        KeyNumber("Nineteen in twenty exceed", fixed(q05, 1), "N", note="Case II by its 5 % quantile"),
    ]
    tested = view.tested_force(P)
    if tested is not None:
        cards.append(
            KeyNumber("The tested muscle", tested[0], "N", f"90 % band: {tested[1]} N", "itself, by this run")
        )
    if view.of_the_thesis:
        printed = view.printed["II"][row]
        cards.append(
            KeyNumber("Thesis, Table 3.5", f"{printed:.2f}", "N", note="Case II, without any uncertainty")
        )
    assert view.blueprint.geometry is not None
    beyond = beyond_bounds(view.blueprint.geometry)
    notice: list[Block] = []
    if beyond:
        itself = (
            "" if tested is None else f" It pulls with {tested[0]} N ({tested[1]} N) at {P / KPA:.0f} kPa."
        )
        words = "The designs are the best within the bounds, and need not be better than it."
        notice = [Notice(f"The tested muscle lies outside these bounds: {beyond}.{itself} {words}")]
    return [Headline(sentence), *notice, Numbers(cards)]


def _trust(view: DesignsView) -> Verdict:
    reasons = []
    P = np.array(view.pressures)
    outside = P[view.reach.outside(P)] / KPA
    law = view.blueprint.simulation.law
    if outside.size:
        reasons.append(
            f"{', '.join(f'{p:.0f}' for p in outside)} kPa lie outside the recorded pressures: the moduli's "
            f"law ({law.replace('_', ' ')}) is extrapolated, {LAWS[law]}. The bands hold its constants and "
            "a misfit that grows with the distance from the recorded pressures, not more about its shape."
        )
    far = [d for d in view.best("II") if bool(view.reach.beyond(np.array(d.P), d.contraction.mean()))]
    if far:
        listed = ", ".join(f"{d.P / KPA:.0f}" for d in far)
        reasons.append(f"Free contraction lies beyond the recorded contractions at {listed} kPa (Case II).")
    rootless = [d for d in view.designs if d.without_root > 0.0]
    if rootless:
        worst = max(d.without_root for d in rootless)
        share = f"up to {worst:.0%}" if worst >= 0.01 else "less than 1%"
        reasons.append(
            f"In {share} of the draws the force stays positive to {LIMIT:.0%} contraction; "
            "these count with that contraction, so that means and upper ends are too low."
        )
    if not view.converged:
        reasons.append("The calibration did not converge within its budget.")
    sd = view.blueprint.geometry.sd if view.blueprint.geometry else None
    if sd is None or sd.alpha0_deg == 0.0:
        reasons.append("The specimen declares no sd of the braid angle: the bands hold no tolerance of it.")
    return Verdict("A forecast for muscles that nobody has built.", "caution", reasons)


def _by_pressure(view: DesignsView) -> Section:
    apart = sorted(
        {
            round(a.P / KPA)
            for case in ("I", "II")
            for a, b in zip(view.best(case), view.best(case, "q05"), strict=True)
            if not same_design(a, b)
        }
    )
    crosses = " Crosses: Table 3.5." if view.of_the_thesis else ""
    words = "Both aims lead to the same design: what raises the mean raises the lower end of the band."
    if apart:
        words = (
            f"The two aims lead to different designs at {', '.join(map(str, apart))} kPa, where some force "
            "can be given up for less doubt; elsewhere what raises the mean raises the lower end of the band."
        )
    return Section(
        "Force and free contraction by pressure",
        [
            Figure(
                figure.draw(view),
                "Design of the largest mean at each pressure: median, 50 % and 90 % bands. Dashed: ends of "
                f"the 90 % band of the other aim's design.{crosses} Grey: outside the recorded pressures.",
                "Blocked force and free contraction against pressure with bands, for both cases.",
            ),
            Text(words),
            *(designs_of(view, case) for case in ("I", "II")),
        ],
    )


def _packing(view: DesignsView) -> Section:
    names = [f"packed, R_br to {radius / MM:g} mm" for radius in view.radii]
    rows = []
    for item, two in zip(view.packed, view.best("II"), strict=True):
        cells: list[object] = [item.P / KPA, float(two.force.mean()), item.free]
        for x, force in zip(item.x, item.force, strict=True):
            cells.append(f"{force:.2f} ({x[4]:.0f} × {fixed(x[3] / MM, 3)} mm)")
        rows.append(cells)
    columns = ["kPa", "Case II", "Case I", *names]
    i = view.pressures.index(_shown(view))
    item, one, two = view.packed[i], view.best("I")[i], view.best("II")[i]
    whole = float(two.force.mean())
    taken = " and ".join(
        f"{significant(whole - force, 2)} N with {x[4]:.0f} strands of R_br = {fixed(x[3] / MM, 2)} mm"
        for x, force in zip(item.x, item.force, strict=True)
    )
    # Half of the strands run each way.
    fit = np.floor(np.pi * one.x[0] * np.sin(one.x[2]) / one.x[3])
    formats = {"kPa": "{:.0f}", "Case II": "{:.2f}", "Case I": "{:.2f}"} | dict.fromkeys(names, "{}")
    return Section(
        "Strands that fit",
        [
            Text(
                f"Case I within the thesis's bounds ends at {one.x[4]:.0f} strands of R_br = "
                f"{fixed(one.x[3] / MM, 2)} mm at {item.P / KPA:.0f} kPa; of such strands {fit:.0f} in each "
                f"direction fit round the muscle. They cost {significant(whole - item.free, 2)} N against "
                f"Case II{_of_strands(whole, item)}. With strands that must fit, it takes {taken}: the first "
                "within Table 3.1's bound, the last no thicker than a real monofilament. The designs in "
                "designs.csv are those without this constraint, as in the thesis."
            ),
            DataTable(
                pd.DataFrame(rows, columns=columns),
                "Posterior mean of blocked force in N (strands × their radius).",
                formats,
            ),
        ],
    )


def _of_strands(whole: float, item: Packed) -> str:
    """Where the braid's term is negligible beside the ``whole`` force (N) only if strands need not fit."""
    free, fitting = whole - item.free, whole - min(item.force)
    if free < NEGLIGIBLE * whole <= fitting:
        return ", and that the braid's term is negligible follows from them alone"
    return ""


def _bands(view: DesignsView) -> Section:
    rows = []
    for d in view.best("II"):
        ends = [np.subtract(*np.quantile(draws, [0.95, 0.05])) for draws in (d.force, d.exact)]
        rows.append((d.P / KPA, float(d.force.mean()), float(d.force.std()), float(d.exact.std()), *ends))
    names = ["kPa", "mean N", "sd N", "sd without tolerance N", "band's width N", "width without tolerance N"]
    frame = pd.DataFrame(rows, columns=names)
    blueprint = view.blueprint
    assert blueprint.geometry is not None
    sds = {k: v for k, v in blueprint.geometry.sd.model_dump().items() if v > 0.0}
    told = ", ".join(f"{name} {value:g}" for name, value in sds.items()) or "none is declared"
    effects = blueprint.simulation.effects
    left = [e for e in effects if effect(e).of_test]
    carried = [e for e in effects if e not in left]
    of_test = f", and so does what it found about its rig or build ({', '.join(left)})" if left else ""
    gauge = " and the gauge's offset" if blueprint.sensors.pressure_bias_sd_kPa > 0.0 else ""
    strands = (
        "the fitted multiple of it"
        if any(e.startswith("braid_stretch") for e in effects)
        else "taken in full"
    )
    stiff = (
        f"{blueprint.braid.E_br_GPa:g} GPa"
        if blueprint.braid
        else "2.1 GPa, chapter 3's, none being declared"
    )
    return Section(
        "What the bands hold",
        [
            Text(
                "Every draw of the posterior goes through the model itself, with its effects "
                f"({', '.join(carried) or 'none declared'}){gauge}, at the new geometry. Moduli in "
                "engineering strain do not act on the blocked force, in stretch they do. Manufacturing: "
                f"every draw is built with its own deviation from the drawing, of the declared sd ({told}); "
                f"what the run found about the tested muscle's own geometry stays with that muscle{of_test}. "
                "The remainder (what the physics left unexplained) is carried as the same share of the ideal "
                "gas force at rest length. Left out: the sensor's noise, a single stroke's own remainder, "
                "and friction, for the force is the mean of both branches.\n\n"
                f"Case I subtracts the energy in the strands (Eq. 2.25, {strands}; E_br = {stiff}). Case II "
                f"leaves the strands as they are declared. Length at rest stays {blueprint.geometry.L0_mm:g} "
                "mm.\n\n"
                f"The searches (differential evolution, then SQP) use {view.draws[0]} draws, their last "
                f"refinement and the bands {view.draws[1]}."
            ),
            DataTable(
                frame,
                "Case II, largest mean: how much of the band is tolerance, and how much the posterior.",
                dict.fromkeys(names[1:], "{:.2f}") | {"kPa": "{:.0f}"},
            ),
        ],
    )
