"""Numbers of chapter 3's running text: the braid's loss, forces by pressure, angle, wall, starts."""

from __future__ import annotations

from mpam_calib.thesis.chapter3 import SHORT, Chapter3, best_force, force, loss, strands_that_fit
from mpam_calib.thesis.ledger import Ledger
from mpam_calib.thesis.tables import table


def enter(ledger: Ledger, chapter: Chapter3) -> None:
    """Enter the numbers of sections 3.4.1 to 3.4.5 and what they leave unsaid."""
    _loss_to_the_braid(ledger, chapter)
    _volume_ratio(ledger)
    _blocked_forces(ledger, chapter)
    _gap_of_the_cases(ledger)
    _braid_angle(ledger, chapter)
    _loss_to_other_strands(ledger, chapter)
    _thickness_term(ledger, chapter)
    _random_starts(ledger, chapter)


def _loss_to_the_braid(ledger: Ledger, chapter: Chapter3) -> None:
    """What the braid takes, with the strands that the text has and with those of the optimum."""
    ledger.check(
        "Text 3.4.1",
        "200 kPa",
        "loss to the braid in Case I (N)",
        "0.00647",
        loss(200, 2.5, 50),
        note=f"with R_br = 2.5 mm, n = 50; {loss(200, 2.5, 100):.5f} N at the optimum's n = 100",
    )
    ledger.unprinted(
        "Text 3.4.1",
        "200 kPa",
        "loss to the braid at Case I's optimum, n = 100 (N)",
        best_force(200) - chapter.case_one.best.value,
        "half of what the thesis's n = 50 loses",
    )


def _volume_ratio(ledger: Ledger) -> None:
    """The bladder's share of the muscle's volume, as the constraints have it."""
    ratio = 0.67621 / 3.0 * (2.0 - 0.67621 / 3.0)
    ledger.check("Eq. 3.19", "Case II", "V_bl/V − 2", "-1.6", ratio - 2.0)
    ledger.check("Eq. 3.20", "Case II", "0.4 − V_bl/V", "0", 0.4 - ratio)


def _blocked_forces(ledger: Ledger, chapter: Chapter3) -> None:
    """Blocked force by pressure, and the radius that belongs to it."""
    ledger.check(
        "Text 3.4.3",
        "600 against 50 kPa",
        "blocked force, times",
        "12",
        best_force(600) / best_force(50),
        note="Eq. 3.16 is proportional to pressure",
    )
    ledger.check(
        "Text 3.4.3",
        "600 kPa",
        "blocked force (N)",
        "238",
        float(chapter.by_pressure["case_two_N"].iloc[-1]),
        about=0.005,
        note="'almost 238 N'; Table 3.5 has 238.7627, which rounds to 239",
    )
    ledger.check(
        "Text 3.4.3",
        "600 kPa",
        "radius of the bladder (mm)",
        "6",
        chapter.case_two.best.x[0] * 1e3,
        misprint="6 mm is the diameter",
    )


def _gap_of_the_cases(ledger: Ledger) -> None:
    """By how much the braid's term lowers the blocked force at most."""
    printed = table("3.5")
    gaps = {}
    for row in printed.rows[2:]:
        one, two = (printed.value(row, f"Cost function (Case {c})") for c in ("I", "II"))
        gaps[row] = 100.0 * (two - one) / two
    widest = max(gaps, key=lambda row: gaps[row])
    ledger.check(
        "Text 3.4.3",
        f"{widest} kPa",
        "difference of Case I and II, at most (%)",
        "0.01",
        gaps[widest],
        misprint="'nearly less than 0.01 %'; its own Table 3.5 has "
        + ", ".join(f"{gap:.4f} at {row} kPa" for row, gap in gaps.items()),
    )


def _braid_angle(ledger: Ledger, chapter: Chapter3) -> None:
    """What the braid's angle is worth."""
    ledger.check(
        "Text 3.4.5",
        "α = 75° against 72°",
        "gain in blocked force (%)",
        "50",
        100.0 * (force(200, chapter.case_two.best.x[1] * 1e3, alpha_deg=75.0) / best_force(200) - 1.0),
        about=0.03,
        note="'a nearly 50 % increase'",
    )
    for delta in (1.0, -1.0):
        changed = force(200, chapter.case_two.best.x[1] * 1e3, alpha_deg=72.0 + delta)
        ledger.unprinted(
            "Text 3.4.5",
            f"α = {72 + delta:.0f}° against 72°",
            "gain in blocked force (%)",
            100.0 * (changed / best_force(200) - 1.0),
            "what one degree of the braid angle is worth",
        )


def _loss_to_other_strands(ledger: Ledger, chapter: Chapter3) -> None:
    """What the braid takes where the strands are real ones, or have to fit round the muscle."""
    for radius in (0.10, 0.11, 0.13):
        ledger.unprinted(
            "Text 3.4.1",
            f"n = 50, R_br = {radius:.2f} mm",
            "loss to the braid at 200 kPa (N)",
            loss(200, radius, 50),
            "a real monofilament; the loss grows with the square of the pressure: 'negligible' follows "
            "from strands of 2.5 mm",
        )
    for name, run in (("packing", chapter.packed), ("packing, R_br <= 0.13 mm", chapter.packed_monofilament)):
        n, r = run.best.x[4], run.best.x[3] * 1e3
        ledger.unprinted(
            "Text 3.4.1",
            f"Case I with {name}",
            "loss to the braid at 200 kPa (N)",
            best_force(200) - run.best.value,
            f"n R_br <= 2πR sin α; optimum n = {n:.0f}, R_br = {r:.4f} mm",
        )
    ledger.unprinted(
        "Table 3.2",
        "R_br = 2.5 mm",
        "strands of one direction that fit round R = 3 mm",
        strands_that_fit(),
        "the optimum has 50",
    )


def _thickness_term(ledger: Ledger, chapter: Chapter3) -> None:
    """What the wall's thickness counts for in Eq. 3.16."""
    for t in (chapter.case_two.best.x[1] * 1e3, 0.7):
        ledger.unprinted(
            "Fig. 3.2, 4.9",
            f"t = {t:.5g} mm, 200 kPa",
            "thickness term (N)",
            force(200, t) - force(200, 0.0),
            "force balance with a stress-free wall; virtual work with an incompressible wall makes it 0",
        )


def _random_starts(ledger: Ledger, chapter: Chapter3) -> None:
    """How often each method reaches the optimum."""
    starts = chapter.starts
    for method, reached in (("GA+SQP", starts.reached_sqp), ("GA+IP", starts.reached_ip)):
        ledger.unprinted(
            "Text 3.4.2",
            f"{starts.runs} random starts, {method}",
            "reached the optimum to 1e-5 N",
            reached,
            f"{starts.evaluations_mean:.0f} evaluations on average in all, {starts.evaluations_max} at most; "
            f"the global stage alone, cut short at {SHORT} generations, stopped between "
            f"{starts.lowest_global:.1f} and {starts.highest_global:.1f} N",
        )
