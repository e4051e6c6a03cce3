"""Each check fires where it should, keeps quiet where it should, and moves the verdict."""

from __future__ import annotations

from dataclasses import replace

import pandas as pd
import pytest

from mpam_calib.report import trust
from mpam_calib.report.numbers import significant
from mpam_calib.report.parameters import learnt_table
from mpam_calib.report.view import CalibrationView
from mpam_calib.report.wording import convergence_sentences

from .synthetic import material, muscle


@pytest.fixture(scope="module")
def sound() -> CalibrationView:
    """A muscle with nothing wrong but an unidentified dead-band."""
    return muscle(n_draws=400)


def settled(view: CalibrationView, **changes: object) -> CalibrationView:
    return replace(view, convergence=replace(view.convergence, **changes))


def test_a_sound_calibration_is_trusted_and_its_limit_named(sound: CalibrationView) -> None:
    verdict = trust.assess(sound)
    assert verdict.level == "good"
    assert verdict.sentence.startswith("Yes")
    assert "P_DB_kPa" in verdict.sentence
    assert verdict.reasons[-1].startswith("What is fine: the calculation has settled; ")


def test_nothing_to_remark(sound: CalibrationView) -> None:
    identified = sound.unidentified.assign(contraction=0.9)
    verdict = trust.assess(replace(sound, unidentified=identified))
    assert verdict.sentence == "Yes: you can use these numbers with their bands."
    assert len(verdict.reasons) == 1


@pytest.mark.parametrize(
    ("learnt", "praised", "told"),
    [(0.9, True, False), (0.5, True, False), (0.45, False, True), (0.1, False, False)],
)
def test_parameters_are_called_narrowed_by_the_table_s_limit(
    sound: CalibrationView, learnt: float, praised: bool, told: bool
) -> None:
    frame = sound.unidentified.assign(contraction=0.9)
    frame.loc[frame.index[0], "contraction"] = learnt
    view = replace(sound, unidentified=frame)
    fine = trust.assess(view).reasons[-1]
    assert ("narrow every parameter to at most 50 % of the band assumed before" in fine) == praised
    assert learnt_table(view)["what that means"].str.contains("the prior still matters").any() == told


def test_what_leaves_a_sign_open_or_mixes_explanations_is_not_called_identified(
    sound: CalibrationView,
) -> None:
    summary = sound.summary.copy()
    summary.loc[summary["parameter"] == "K_f", ["q05", "q95"]] = -0.1, 0.2
    view = replace(sound, summary=summary, unidentified=sound.unidentified.assign(contraction=0.9))
    assert learnt_table(view)["what that means"].str.contains("leave its sign open").any()
    fine = trust.assess(view).reasons[-1]
    assert "identified" not in fine and "narrow every parameter" in fine
    assert "narrow every parameter" not in trust.assess(settled(view, modes=2)).reasons[-1]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"rhat_max": 1.011, "rhat_parameter": "K_f"}, "K_f"),
        ({"ess_bulk_min": 399.0}, "399"),
        ({"ess_tail_min": 12.0}, "12"),
        ({"converged": False}, "budget"),
        ({"rhat_max": float("nan")}, "R-hat"),
        ({"ess_tail_min": float("nan")}, "independent"),
    ],
)
def test_an_unsettled_sampler_is_bad(sound: CalibrationView, changes: dict[str, object], words: str) -> None:
    verdict = trust.assess(settled(sound, **changes))
    assert verdict.level == "bad"
    assert verdict.sentence.startswith("No")
    assert words in verdict.reasons[0]
    assert "the calculation has settled" not in verdict.reasons[-1]


def test_the_limits_themselves_pass(sound: CalibrationView) -> None:
    assert trust.convergence(settled(sound, rhat_max=1.01, ess_bulk_min=400.0, ess_tail_min=400.0)) is None


@pytest.mark.parametrize(("wanted", "ess", "told"), [(100.0, 150.0, False), (1000.0, 600.0, True)])
def test_the_sample_size_is_held_against_what_the_run_was_asked_for(
    sound: CalibrationView, wanted: float, ess: float, told: bool
) -> None:
    view = settled(sound, ess_bulk_min=ess, ess_tail_min=ess, ess_wanted=wanted)
    limit = trust.convergence(view)
    words = convergence_sentences(view.convergence)
    assert (limit is not None) == told == words.startswith("No")
    assert f"{wanted:.0f} is the least" in words
    assert limit is None or f"({wanted:.0f} wanted)" in limit.sentence


def test_separate_explanations_are_a_caution(sound: CalibrationView) -> None:
    limit = trust.convergence(settled(sound, modes=2))
    assert limit is not None
    assert limit.level == "caution"
    assert "2 separate" in limit.sentence


def test_moduli_of_a_run_that_has_not_settled_are_bad(sound: CalibrationView) -> None:
    assert trust.borrowed(sound) is None
    verdict = trust.assess(replace(sound, unsettled_moduli=True))
    assert verdict.level == "bad"
    assert verdict.sentence.endswith(": the run that the moduli come from did not converge.")
    assert "--max-steps" in verdict.reasons[0]


@pytest.mark.parametrize(
    ("remainder", "noise", "level"),
    [
        (0.24, 0.25, None),  # within the noise
        (0.30, 0.25, None),  # above it, but nothing beside 94 N
        (1.2, 0.25, "good"),
        (3.0, 0.25, "caution"),
        (12.0, 0.25, "bad"),
        (3.0, 4.0, None),
        (float("nan"), 0.25, None),
    ],
)
def test_remainder(sound: CalibrationView, remainder: float, noise: float, level: str | None) -> None:
    limit = trust.remainder(replace(sound, remainder=remainder, noise=noise))
    assert (limit.level if limit else None) == level
    if limit:
        assert f"wrong by about {significant(remainder, 2)} N" in limit.sentence


def test_the_fit_to_within_the_noise_is_no_praise_where_the_misfit_is_in_it(sound: CalibrationView) -> None:
    praise = ("fits to within the noise", "readings lie in their bands", "inner levels lie")
    left_out = pd.DataFrame({"inside90": 0.9, "readings": 200, "extrapolated": [True, False, True]})
    reasons = trust.assess(replace(sound, left_out=left_out)).reasons
    assert all(told in reasons[-1] for told in praise)
    summary = sound.summary.copy()
    summary.loc[summary["parameter"] == "noise_sd_N", "mean"] = 30.0
    verdict = trust.assess(replace(sound, summary=summary, left_out=left_out, reading_noise=0.25))
    assert verdict.level == "bad"
    assert "30 N against 0.25 N from reading to reading" in verdict.sentence
    assert not any(told in reason for told in praise for reason in verdict.reasons)


def test_whatever_is_doubted_in_the_data_stands_behind_the_worst_reason(sound: CalibrationView) -> None:
    odd = "loops: a force is far from all others (1e+05 N at 3 s)"
    warned = replace(sound, warnings=["loops: 4 readings at turns are left out", odd])
    assert not any(odd in reason for reason in trust.assess(warned).reasons)
    for doubtful in (replace(warned, provenance="reconstructed"), settled(warned, converged=False)):
        assert trust.assess(doubtful).reasons[1] == f"Look at the data first: {odd}"


def test_nothing_is_fine_and_nothing_was_found_before_the_calculation_has_settled(
    sound: CalibrationView,
) -> None:
    same = "All of them found the same explanation"
    for view, told in ((sound, True), (settled(sound, converged=False), False)):
        assert any("What is fine" in reason for reason in trust.assess(view).reasons) == told
        assert (same in convergence_sentences(view.convergence)) == told
    apart = settled(sound, converged=False, modes=2)
    assert "They found 2 separate explanations" in convergence_sentences(apart.convergence)


def test_an_unassessed_remainder_is_no_good_news(sound: CalibrationView) -> None:
    verdict = trust.assess(replace(sound, remainder=float("nan")))
    assert not any("noise" in reason for reason in verdict.reasons)


@pytest.mark.parametrize(("factor", "level"), [(1.0, None), (8.0, "caution"), (20.0, "bad")])
def test_wide_bands(sound: CalibrationView, factor: float, level: str | None) -> None:
    bands = sound.bands.copy()
    rows = bands["quantity"] == "blocked_force_N"
    for q in ("q05", "q95"):
        bands.loc[rows, q] = bands.loc[rows, "mean"] + factor * (bands.loc[rows, q] - bands.loc[rows, "mean"])
    limit = trust.band_width(replace(sound, bands=bands))
    assert (limit.level if limit else None) == level
    if limit:
        assert "blocked force" in limit.sentence


def test_a_gauge_that_makes_up_the_band_is_named(sound: CalibrationView) -> None:
    assert trust.gauge(sound) is None
    assert trust.gauge(replace(sound, pressure_bias_sd_kPa=0.1)) is None
    limit = trust.gauge(replace(sound, pressure_bias_sd_kPa=22.5))
    assert limit is not None
    # 22.5 kPa at 0.39 N/kPa, 90 %: 14 N
    assert "± 14 N" in limit.sentence
    assert limit.level == "good"
    assert "as this gauge reads them" in limit.sentence  # the band is far narrower: it cannot be what sets it
    # One measure of uncertainty in a sentence, and the declaration by its name.
    assert "90 %, by pressure_bias_sd_kPa = 22.5" in limit.sentence and "sigma" not in limit.sentence
    limit = trust.gauge(replace(sound, pressure_bias_sd_kPa=5.0))
    assert limit is not None and "sets the width" in limit.sentence


@pytest.mark.parametrize(
    ("sd", "levels", "told"),
    [
        (1.5, 5, ""),
        (2.0, 5, "sets the width of the band"),
        (6.0, 5, "sets the width of the band"),
        (7.5, 5, "the bands hold for pressures as this gauge reads them"),
        (6.0, 4, "the bands hold for pressures as this gauge reads them"),
    ],
)
def test_a_gauge_is_held_against_the_band_at_the_highest_level(
    sound: CalibrationView, sd: float, levels: int, told: str
) -> None:
    """0.39 N/kPa beside sds of 1.3 N at 250 kPa and 1.1 N at 200: 30 and 35 % of the band for each kPa."""
    view = replace(sound, pressure_bias_sd_kPa=sd, levels_kPa=sound.levels_kPa[:levels])
    limit = trust.gauge(view)
    assert (limit is not None) == bool(told)
    assert limit is None or told in limit.brief


def test_what_the_data_do_not_tell_is_named_in_words(sound: CalibrationView) -> None:
    said = replace(sound, meanings={"P_DB_kPa": "pressure that does no work yet"})
    limit = trust.identification(said)
    assert limit is not None
    assert limit.sentence == (
        "Do not quote the pressure that does no work yet (P_DB_kPa) alone: the data say nothing about it, "
        "and what you see is what was assumed before the test."
    )
    assert limit.brief == "the data say nothing about the pressure that does no work yet (P_DB_kPa)"
    several = replace(said, unidentified=sound.unidentified.assign(contraction=0.0))
    limit = trust.identification(several)
    count = len(sound.unidentified)
    assert limit is not None and limit.brief.endswith(f" and {count - 2} more")
    assert f" and {count - 5} more alone: the data say nothing about them" in limit.sentence


def test_parameters_that_learnt_less_than_a_fifth_are_named_the_worst_first(sound: CalibrationView) -> None:
    frame = sound.unidentified.assign(contraction=0.9)
    frame.loc[frame.index[:4], "contraction"] = [0.19, 0.1, 0.21, 0.45]
    expected = [frame["parameter"].iloc[1], frame["parameter"].iloc[0]]
    assert trust.unidentified_names(replace(sound, unidentified=frame)) == expected


def test_reconstructed_data_are_a_caution(sound: CalibrationView) -> None:
    verdict = trust.assess(replace(sound, provenance="These loops are reconstructed from tables."))
    assert verdict.level == "caution"
    assert "reconstructed" in verdict.sentence
    assert trust.source(replace(sound, provenance="Digitised from a figure.")) is None


def test_the_worst_limit_comes_first(sound: CalibrationView) -> None:
    view = replace(settled(sound, converged=False), remainder=3.0, provenance="reconstructed")
    verdict = trust.assess(view)
    assert verdict.level == "bad"
    assert verdict.reasons[0].startswith("The calculation has not settled")
    assert any("wrong by about 3.0 N" in reason for reason in verdict.reasons)


def test_a_material_is_judged_on_its_stress() -> None:
    view = material(n_draws=400)
    assert trust.assess(view).level == "good"
    assert trust.headline_bands(view)[0][1] == pytest.approx(213e3, rel=0.01)
    limit = trust.remainder(replace(view, remainder=3e4))
    assert limit is not None
    assert limit.level == "bad"
    assert " Pa " in limit.sentence
    assert "tensile_strain" in limit.sentence and "diagnose" not in limit.sentence


def of_material(view: CalibrationView, name: str, half: float) -> CalibrationView:
    """A material's page on which one of its three numbers is known to ± so much of it."""
    q = {"mean": 1.0, "q05": 1.0 - half, "q95": 1.0 + half}
    if name == "E_1":
        summary = view.summary.copy()
        rows = summary["parameter"] == name
        summary.loc[rows, list(q)] = [8e4 * x for x in q.values()]
        return replace(view, summary=summary)
    bands = view.bands.copy()
    rows = (bands["contraction"] - float(name)).abs() < 1e-9
    bands.loc[rows, list(q)] = bands.loc[rows, ["mean"] * 3].to_numpy() * list(q.values())
    return replace(view, bands=bands)


@pytest.mark.parametrize(
    ("name", "half", "level", "told"),
    [
        ("3", 0.15, "caution", "stress at the largest strain"),
        ("3", 0.40, "bad", "stress at the largest strain"),
        ("1.5", 0.15, "caution", "stress at a strain of 1.5"),
        ("1.5", 0.40, "bad", "stress at a strain of 1.5"),
        ("E_1", 0.08, None, ""),
        ("E_1", 0.15, "caution", "first modulus E_1"),
        ("E_1", 0.40, "caution", "first modulus E_1"),  # the stresses are known all the same
    ],
)
def test_every_number_on_a_material_s_first_screen_is_judged(
    name: str, half: float, level: str | None, told: str
) -> None:
    view = of_material(material(n_draws=400), name, half)
    limit = trust.band_width(view)
    assert (limit.level if limit else None) == level
    assert ("the bands are within ± 10 %" in trust.assess(view).reasons[-1]) == (level is None)
    if limit:
        assert limit.brief == f"the {told} is known to ± {100 * half:.0f} % only"


def test_a_wide_modulus_hides_no_wide_stress() -> None:
    view = of_material(of_material(material(n_draws=400), "E_1", 0.5), "3", 0.4)
    limit = trust.band_width(view)
    assert limit is not None and limit.level == "bad"
    assert limit.brief == "the stress at the largest strain is known to ± 40 % only"


def test_a_muscle_with_a_tensile_test_is_judged_in_newtons(sound: CalibrationView) -> None:
    bands = pd.concat([sound.bands, material(n_draws=400).bands])
    view = replace(sound, bands=bands, remainder=40.0)
    assert [name for name, *_ in trust.headline_bands(view)] == ["blocked force", "free contraction"]
    verdict = trust.assess(view)
    assert verdict.level == "bad" and "wrong by about 40 N" in verdict.sentence


def test_diagnose_is_offered_only_where_it_can_look(sound: CalibrationView) -> None:
    """It takes loops and force maps, and refuses the rest."""
    for observed, told in ((sound.observed, True), (sound.readings("blocked_force"), False)):
        limit = trust.remainder(replace(sound, observed=observed, remainder=12.0))
        assert limit is not None
        assert ("diagnose" in limit.sentence) == told
