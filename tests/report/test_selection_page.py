"""What the selection page says: levels held out beside evidence, effects not in play, readable odds."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from criticism.cases import specimen_of

from mpam_calib.criticism.selection.held_out import LEVEL_COLUMNS
from mpam_calib.criticism.selection.odds import odds
from mpam_calib.criticism.selection.select import COLUMNS, Selection
from mpam_calib.model.blueprint import MaterialPosterior
from mpam_calib.report.blocks import DataTable, Headline, Notice, Text, Verdict
from mpam_calib.report.choices import choice_sentences, choices_section, level_sentence
from mpam_calib.report.page import Page
from mpam_calib.report.selection import (
    evidence_text,
    prior_of_moduli,
    ranking_table,
    selection_page,
    selection_sentence,
)
from mpam_calib.specimen.declaration import GeometrySd, Sensors
from mpam_calib.specimen.recording import ForceMap, FreeContraction, Specimen, Tensile

SPECIMEN = specimen_of("develop-null-006")


MATERIAL = MaterialPosterior(mean=(4e4,), covariance=((1e6,),), strain_range=None, convention="stretch")

UNKNOWN = (float("nan"), float("nan"))


def test_moduli_of_another_run_have_their_page() -> None:
    simulation = SPECIMEN.simulation.model_copy(update={"moduli": "run:../material"})
    told = page(
        models(UNKNOWN, UNKNOWN), specimen=replace(SPECIMEN, simulation=simulation), material=MATERIAL
    )
    assert any(isinstance(block, Headline) for block in told.lead)


@pytest.mark.parametrize(
    ("changed", "tested", "said"),
    [
        ({"moduli": "loops"}, False, "(stated in newtons)"),
        ({"moduli": "tensile"}, True, "(what the tensile test gives)"),
        ({"moduli": "tensile", "E_Pa": (4e4,), "E_rel_sd": 0.1}, False, "(E_rel_sd)"),
        ({"moduli": "run:../material"}, False, "(what the material's run gives)"),
    ],
)
def test_the_prior_that_is_widened_is_that_of_the_declared_moduli(
    changed: dict[str, Any], tested: bool, said: str
) -> None:
    simulation = SPECIMEN.simulation.model_copy(update=changed)
    test = Tensile(np.array([0.1, 0.2]), np.array([4e3, 8e3])) if tested else None
    assert said == f"({prior_of_moduli(replace(SPECIMEN, simulation=simulation, tensile=test))})"
    if not tested:
        specimen = replace(SPECIMEN, simulation=simulation)
        material = MATERIAL if simulation.moduli.startswith("run:") else None
        told = page(models(UNKNOWN, UNKNOWN), specimen=specimen, material=material)
        (section,) = (s for s in told.sections if "priors" in s.title)
        assert any(isinstance(b, Text) and said in str(b.html) for b in section.blocks)


def models(*held: tuple[float, float]) -> pd.DataFrame:
    """Models of order 1, 2, ..., 10 nats apart; ``held``: density and error of levels left out."""
    rows: list[list[Any]] = []
    for i, (elpd, error) in enumerate(held):
        one = ["inextensible_braid", "stretch", i + 1, "constant", "coulomb", "", i + 2]
        rows.append([*one, -10.0 * i, 0.01, float(np.exp(-10.0 * i)), 0.5, elpd, error])
    return pd.DataFrame(rows, columns=COLUMNS)


def page(
    table: pd.DataFrame,
    sensitivity: pd.DataFrame | None = None,
    specimen: Specimen = SPECIMEN,
    noise: float | None = None,
    replicates: int = 0,
    material: MaterialPosterior | None = None,
) -> Page:
    if sensitivity is None:
        widths = [(i + 1, "as declared", 0.0, 1.0) for i in range(len(table))]
        sensitivity = pd.DataFrame(widths, columns=["model", "prior", "log_evidence", "probability"])
    levels = pd.DataFrame(columns=["model", *LEVEL_COLUMNS])
    chances = odds(table, SPECIMEN.simulation)
    found = Selection(table, chances, levels, np.eye(len(table)), replicates, sensitivity, 0.01, noise)
    return selection_page(found, specimen, material)


@pytest.mark.parametrize(
    ("held", "level", "said"),
    [
        (((-100.0, 1.0), (-110.0, 1.0)), "good", "prefer the same model"),
        (((-100.0, 8.0), (-101.0, 8.0)), "good", "does not tell it apart from"),
        (((-110.0, 1.0), (-100.0, 1.0)), "caution", "prefer M = 2 ("),
        (
            ((-104.2, 8.6), (-100.0, 9.6)),
            "good",
            "put M = 2 first, but that does not tell it apart from M = 1",
        ),
        ((UNKNOWN, UNKNOWN), "caution", "too few can be left out"),
        ((UNKNOWN, (-100.0, 1.0)), "caution", "say nothing of this model: it cannot be fitted"),
        (((-100.0, 1.0), UNKNOWN), "caution", "no other model has a figure"),
    ],
)
def test_the_box_is_green_only_where_levels_left_out_do_not_contradict(
    held: tuple[tuple[float, float], ...], level: str, said: str
) -> None:
    (verdict,) = (b for b in page(models(*held)).lead if isinstance(b, Verdict))
    assert verdict.level == level
    assert any(said in reason for reason in verdict.reasons)


def test_bridges_are_spoken_of_where_there_are_any() -> None:
    assert "is by bridge sampling" in evidence_text(0.02) and "at most 0.02 nats" in evidence_text(0.02)
    none = evidence_text(float("nan"))
    assert "no bridge was built" in none and "nan" not in none and "at most" not in none


def said_of(specimen: Specimen) -> tuple[Verdict, str]:
    """The box, and all notices of a page on which everything else is good."""
    lead = page(models((-100.0, 1.0), (-110.0, 1.0)), specimen=specimen).lead
    (verdict,) = (b for b in lead if isinstance(b, Verdict))
    return verdict, " ".join(b.html for b in lead if isinstance(b, Notice))


def test_declared_uncertainties_are_said_to_be_left_aside() -> None:
    assert SPECIMEN.geometry is not None
    verdict, notices = said_of(replace(SPECIMEN, sensors=Sensors()))
    assert verdict.level == "good" and "uncertainties" not in notices
    sds = GeometrySd(alpha0_deg=1.0, t0_mm=0.02)
    geometry = SPECIMEN.geometry.model_copy(update={"sd": sds})
    gauge = Sensors(pressure_bias_sd_kPa=5.0)
    for changed, names in (
        ({"geometry": geometry}, "t0_mm, alpha0_deg"),
        ({"sensors": gauge}, "pressure_bias_kPa"),
    ):
        verdict, notices = said_of(replace(SPECIMEN, **{"sensors": Sensors()} | changed))
        assert verdict.level == "caution" and any(names in reason for reason in verdict.reasons)
        assert f"Declared uncertainties ({names}) are not part of this ranking" in notices


def test_rows_that_carry_no_evidence_are_counted() -> None:
    assert SPECIMEN.loops is not None
    assert "part of the evidence" not in said_of(SPECIMEN)[1]
    free = FreeContraction(SPECIMEN.levels_Pa[:3], np.array([0.1, 0.15, 0.2]))
    lowest = SPECIMEN.loops.force_N <= np.quantile(SPECIMEN.loops.force_N, 0.002)
    loops = replace(SPECIMEN.loops, censored=lowest)
    _, notices = said_of(replace(SPECIMEN, loops=loops, free_contraction=free))
    assert "Free contractions (3 rows) are not part of the evidence" in notices
    assert "Slack readings (" in notices


def test_a_noise_that_was_guessed_is_stated() -> None:
    table = models((-100.0, 1.0), (-110.0, 1.0))
    for noise, there in ((None, False), (2.1, True)):
        lead = page(table, noise=noise).lead
        notices = " ".join(b.html for b in lead if isinstance(b, Notice))
        assert ("Noise of a reading: 2.10 N, assumed" in notices) is there
        (verdict,) = (b for b in lead if isinstance(b, Verdict))
        assert verdict.level == ("caution" if there else "good")
        assert any("noise of a reading is only assumed" in reason for reason in verdict.reasons) is there


def test_only_what_was_compared_is_said_to_be_asked_for() -> None:
    """With moduli from elsewhere order, law and strain are the declared ones in every model."""
    table = models((-100.0, 1.0), (-110.0, 1.0))
    table["order"], table["friction"] = 2, ["coulomb", "none"]
    table["kinematics"] = ["constant_thickness", "inextensible_braid"]
    assert selection_sentence(table) == "The data ask for constant_thickness, coulomb."
    (verdict,) = (b for b in page(table).lead if isinstance(b, Verdict))
    alike = "not compared, as all models have the same: strain (stretch), order (2), law (constant)"
    assert alike in verdict.reasons
    shown = page(table)
    told = " ".join(b.html for b in shown.lead if isinstance(b, Notice))
    assert "shows up here as another kinematics or friction:" in told
    tables = [b for s in shown.sections for b in s.blocks if isinstance(b, DataTable)]
    (odds_,) = (t.frame for t in tables if "choice" in t.frame)
    assert set(odds_["choice"]) == {"kinematics", "friction"}
    every = table.assign(strain=["stretch", "engineering"], order=[1, 2], law=["constant", "linear"])
    assert (
        selection_sentence(every) == "The data ask for constant_thickness, stretch, M = 1, constant, coulomb."
    )
    (verdict,) = (b for b in page(every).lead if isinstance(b, Verdict))
    assert not any("not compared" in reason for reason in verdict.reasons)


def test_one_model_alone_is_no_choice() -> None:
    shown = page(models((-100.0, 1.0)))
    headline, verdict = shown.lead[:2]
    assert isinstance(headline, Headline) and isinstance(verdict, Verdict)
    assert headline.html.startswith("Nothing could be chosen: inextensible_braid, stretch, M = 1")
    assert verdict.level == "caution"
    assert not any("probability" in reason for reason in verdict.reasons)
    assert "Each choice by itself" not in shown.render()


def test_no_probability_is_certain() -> None:
    shown = page(models((-100.0, 1.0), (-110.0, 1.0)))
    (verdict,) = (b for b in shown.lead if isinstance(b, Verdict))
    assert "the best model by evidence has probability > 0.999" in verdict.reasons
    tables = [b for s in shown.sections for b in s.blocks if isinstance(b, DataTable)]
    columns = [t.frame[name] for t in tables for name in ("probability", "as declared") if name in t.frame]
    assert len(columns) == 3
    assert not any(str(p) in ("1", "1.0") for column in columns for p in column)


@pytest.mark.parametrize(("static", "what"), [(False, "loops"), (True, "a force map")])
def test_simulated_readings_are_called_what_they_stand_for(static: bool, what: str) -> None:
    specimen = SPECIMEN
    if static:
        grid = ForceMap(*np.zeros((3, 3)), *np.zeros((2, 3), dtype=np.int64), np.zeros(3, dtype=bool))
        specimen = replace(SPECIMEN, loops=None, force_map=grid)
    shown = page(models((-100.0, 1.0), (-110.0, 1.0)), specimen=specimen, replicates=8)
    assert f"8 sets of readings ({what}) simulated" in words_of(shown)


def test_an_error_below_what_was_measured_is_not_shown() -> None:
    table = models((-100.0, 1.0), (-110.0, 1.0))
    table["log_evidence_se"] = [2e-7, float("nan")]
    assert list(ranking_table(table)[0]["log evidence"]) == ["0.00 ± 0.0004", "−10.00"]


@pytest.mark.parametrize(
    ("second", "said"),
    [
        ((0.1, 0.1), "The first model stays first under all of them."),
        ((0.9, 0.9), "Another model is first under all of them: M = 2."),
        ((0.1, 0.9), "Which model is first depends on them: M = 1; M = 2."),
    ],
)
def test_which_model_is_first_under_other_priors(second: tuple[float, float], said: str) -> None:
    """Sampled and integrated figures differ: the one that the table has first need not be."""
    shares = [
        (model, prior, p if model == 2 else 1.0 - p) for model in (1, 2) for prior, p in enumerate(second)
    ]
    sensitivity = pd.DataFrame(
        [(model, f"prior {prior}", 0.0, share) for model, prior, share in shares],
        columns=["model", "prior", "log_evidence", "probability"],
    )
    shown = page(models((-100.0, 1.0), (-110.0, 1.0)), sensitivity)
    assert said in words_of(shown)


def words_of(shown: Page) -> str:
    return " ".join(b.html for s in shown.sections for b in s.blocks if isinstance(b, Text))


def test_effects_are_said_to_be_as_declared_and_diagnose_to_come_first() -> None:
    shown = page(models((-100.0, 1.0), (-110.0, 1.0)))
    (words,) = (b.html for b in shown.lead if isinstance(b, Notice) and "as declared" in b.html)
    assert "dead-band" in words and "<code>mpam-calib diagnose</code> first" in words


def test_choices_that_all_models_share_leave_the_table() -> None:
    shown = page(models((-100.0, 1.0), (-110.0, 1.0)))
    (table,) = (b for b in shown.sections[0].blocks if isinstance(b, DataTable))
    assert list(table.frame.columns)[:2] == ["order", "probability"]
    assert "strain stretch, law constant, friction coulomb, effects none" in table.caption
    assert table.rows[0][3:] == ["0.00 ± 0.01", "0.500", "−100.0 ± 1"]
    alone, same = ranking_table(models((-100.0, 1.0)))
    assert "strain" in alone.columns and same == ""


def test_each_model_stands_apart_from_its_odds() -> None:
    table = odds(models((0.0, 1.0), (0.0, 1.0)), SPECIMEN.simulation)
    said = " ".join(choice_sentences(table, "order"))
    assert "M = 2 (1 to 10⁴)" in said or "M = 2 (1 to 22026)" in said
    assert "M = 2 against 1 (" in said


def levels_of(*rows: tuple[float, int, float, bool]) -> pd.DataFrame:
    """Levels left out: pressure, rows, the share inside, and whether it is extrapolated."""
    table = [("first", p, n, 1.0, 0.1, 0.2, inside, beyond) for p, n, inside, beyond in rows]
    return pd.DataFrame(table, columns=["model", *LEVEL_COLUMNS])


def test_the_share_of_rows_inside_counts_rows_and_not_levels() -> None:
    said = level_sentence(levels_of((2.5, 10, 0.0, True), (50.0, 90, 1.0, False)), "first")
    assert "90% of the rows" in said and "(2.5 kPa extrapolated)" in said


def test_low_levels_keep_their_decimals_and_nothing_is_extrapolated_where_no_level_is() -> None:
    levels = levels_of((2.5, 10, 0.9, False), (50.0, 90, 0.9, False)).assign(bias_N=1.0)
    said = level_sentence(levels, "first")
    assert "it misses 2.5 kPa by 1 N" in said and "extrapolated" not in said
    choices = odds(models(UNKNOWN), SPECIMEN.simulation)
    (table,) = (b for b in choices_section(choices, levels).blocks if isinstance(b, DataTable))
    assert [row[1] for row in table.rows] == ["2.5", "50"]


def test_errors_at_levels_held_out_are_told_to_be_of_means() -> None:
    """Beside a load cell's noise they would look too small otherwise."""
    told = page(models((-100.0, 1.0), (-110.0, 1.0)))
    (table,) = (b for b in told.sections[0].blocks if isinstance(b, DataTable))
    assert "means of neighbouring readings" in table.caption
