"""Tables 3.2-3.5."""

from __future__ import annotations

from mpam_calib.thesis.chapter3 import Chapter3, best_force, best_wall, force, loss
from mpam_calib.thesis.ledger import Ledger
from mpam_calib.thesis.tables import half_unit, number, table
from mpam_calib.units import DEG, MM

DESIGN = ("R (mm)", "t (mm)", "α (°)")
SCALES = (MM, MM, DEG)


def enter(ledger: Ledger, chapter: Chapter3) -> None:
    """Enter every number of Tables 3.2-3.5."""
    _table_3_2(ledger, chapter)
    _table_3_3(ledger)
    _table_3_4(ledger, chapter)
    _table_3_5(ledger, chapter)


def _table_3_2(ledger: Ledger, chapter: Chapter3) -> None:
    printed = table("3.2")
    for row, optimum in (("Case I", chapter.case_one), ("Case II", chapter.case_two)):
        x = optimum.best.x
        for i, column in enumerate(DESIGN):
            ledger.check(
                printed.source, row, column, printed.text(row, column), x[i] / SCALES[i], note="hybrid search"
            )
    one = chapter.case_one.best
    ledger.check(
        printed.source,
        "Case I",
        "R_br (mm)",
        printed.text("Case I", "R_br (mm)"),
        one.x[3] / MM,
        misprint="0.0025 m = 2.5 mm, the upper bound; 0.0025 mm is below the lower bound 0.005 mm of Table "
        f"3.1, and with n = 50 would cost {loss(200, 0.0025, 50):.0f} N",
    )
    ledger.check(
        printed.source,
        "Case I",
        "n",
        printed.text("Case I", "n"),
        one.x[4],
        misprint=f"not converged: more strands always lose less; n = 100 loses {loss(200, 2.5, 100):.5f} N, "
        f"n = 50 loses {loss(200, 2.5, 50):.5f} N. Table 3.5 has n = 100 at 500 and 600 kPa",
    )
    ledger.check(
        printed.source,
        "Case I",
        "Cost function",
        printed.text("Case I", "Cost function"),
        best_force(200) - loss(200, 2.5, 50),
        note=f"with R_br = 2.5 mm and n = 50; the optimum is {one.value:.5f} N with n = 100",
    )
    ledger.check(
        printed.source,
        "Case II",
        "Cost function",
        printed.text("Case II", "Cost function"),
        chapter.case_two.best.value,
        note=f"closed form {best_force(200):.6f} N",
    )


def _table_3_3(ledger: Ledger) -> None:
    printed = table("3.3")
    cost = "Optimized Cost function from GA"
    for row in printed.rows:
        t_text = printed.text(row, "t (mm)")
        t = number(t_text)
        h = half_unit(t_text)
        value = force(200, t)
        spread = abs(force(200, t + h) - force(200, t - h)) / 2.0
        ratio = t / 3.0 * (2.0 - t / 3.0)
        note = (
            f"Eq. 3.16 with the printed R, t, α; four digits of t allow ± {spread:.4f} N. "
            f"{'V_bl/V = ' + format(ratio, '.4f') + ' violates the constraint' if ratio < 0.4 else ''}"
        ).strip()
        ledger.check(printed.source, row, cost, printed.text(row, cost), value, allow=spread, misprint=note)
        ledger.lost(
            printed.source,
            row,
            "t (mm)",
            t_text,
            "where a stochastic search stopped; another seed stops elsewhere",
        )
    t = number(printed.text("X_2", "t (mm)"))
    ledger.unprinted(
        printed.source,
        "X_2",
        "V_bl/V",
        t / 3.0 * (2.0 - t / 3.0),
        "the constraint wants 0.4 or more: X_2 is not feasible",
    )


def _table_3_4(ledger: Ledger, chapter: Chapter3) -> None:
    printed = table("3.4")
    cost, steps = "Optimized Cost function", "No. of iterations"
    stages = {"GA+SQP": chapter.case_two.stages[0], "GA+IP": chapter.case_two.stages[1]}
    t_ga = number(printed.text("GA", "t (mm)"))
    ledger.lost(
        printed.source, "GA", "t (mm)", printed.text("GA", "t (mm)"), "mean of ten stochastic searches"
    )
    ledger.check(
        printed.source,
        "GA",
        cost,
        printed.text("GA", cost),
        force(200, t_ga),
        allow=abs(force(200, t_ga + 5e-6) - force(200, t_ga - 5e-6)) / 2.0,
        note="Eq. 3.16 with the printed t",
    )
    for row, stage in stages.items():
        for i, column in enumerate(DESIGN):
            ledger.check(
                printed.source,
                row,
                column,
                printed.text(row, column),
                stage.x[i] / SCALES[i],
                note=f"closed form {best_wall():.8f} mm" if i == 1 else "upper bound",
            )
        ledger.check(
            printed.source,
            row,
            cost,
            printed.text(row, cost),
            stage.value,
            note=f"{stage.evaluations} evaluations",
        )
    for row, iterations in (
        ("GA", chapter.case_two.start.iterations),
        *((name, stage.iterations) for name, stage in stages.items()),
    ):
        ledger.lost(
            printed.source,
            row,
            steps,
            printed.text(row, steps),
            "depends on the implementation (there MATLAB, here SciPy); ours is given",
            iterations,
        )


def _table_3_5(ledger: Ledger, chapter: Chapter3) -> None:
    printed = table("3.5")
    one, two = "Cost function (Case I)", "Cost function (Case II)"
    found = chapter.by_pressure
    for i, row in enumerate(printed.rows):
        P = float(row)
        ours = found.iloc[i]
        for column, name in zip(DESIGN, ("R_mm", "t_mm", "alpha_deg"), strict=True):
            ledger.check(printed.source, row, column, printed.text(row, column), float(ours[name]))
        by_n = {n: best_force(P) - loss(P, 2.5, n) for n in (50, 100)}
        n = min(by_n, key=lambda n: abs(by_n[n] - number(printed.text(row, one))))
        optimum = f"the optimum, n = {ours['n']:.0f}, is {ours['case_one_N']:.5f} N"
        ledger.check(
            printed.source,
            row,
            one,
            printed.text(row, one),
            by_n[n] if row != "100" else by_n[50],
            note=f"with n = {n}; {optimum}",
            misprint=f"columns swapped and a digit slipped: Case I with n = 50 is {by_n[50]:.5f} N, which "
            f"stands in the Case II column; 39.70377 is Case II's {best_force(P):.6f} cut off after five "
            "decimals, a 9 read as 0",
        )
        ledger.check(
            printed.source,
            row,
            two,
            printed.text(row, two),
            float(ours["case_two_N"]),
            misprint=f"columns swapped: {printed.text(row, two)} is Case I with n = 50 ({by_n[50]:.5f} N)",
        )
