"""What the page says of structure that no set of causes removes."""

from __future__ import annotations

from typing import Any

import pytest

from mpam_calib.criticism.unexplained.instrument import FAULT, LATE, PLAY
from mpam_calib.model.effect import effect
from mpam_calib.report.diagnosis_lead import _headline, _verdict_sentence
from mpam_calib.report.unremoved import INSTRUMENT_FAULTS, only_recording, unremoved

FAULTLESS = {
    **dict.fromkeys(
        ("saturated_share", "repeating_N", "bursts_N", "hum_N", "step_N", "chatter_N", "remainder_N"), 0.0
    ),
    "left_N": 0.0,
    "read_N": (-1.0, 50.0),
    "misfit_after_N": 0.567,
    "instrument": None,
    "trace": None,
}


@pytest.mark.parametrize(
    ("fault", "size", "said"),
    [
        ("load_cell", " (from about 0.12 N on)", "dead weights up to the blocked force"),
        ("load_cell:zeroed", "", "with the muscle unhooked"),
        ("load_cell:rescaled", "", "its plug and its range"),
        ("late_force", " (by about 0.12 s)", "its amplifier's filter"),
        ("gauge_play", " (of about 0.12 mm)", "the displacement stands while the force goes on"),
    ],
)
@pytest.mark.parametrize(("nats", "by"), [(12.0, "better"), (-2.0, "nearly as well")])
def test_an_instrument_at_fault_is_told_with_how_to_look_at_it(
    fault: str, size: str, said: str, nats: float, by: str
) -> None:
    band = {"mean": 0.1234, "sd": 0.006, "q05": 0.11, "q95": 0.13}
    parameters = dict.fromkeys(
        ("cell_loss_N", "cell_knee_N", "cell_delay_s", "play_mm", "cell_zero_1_N"), band
    )
    told = {"fault": fault, "nats": nats, "parameters": parameters}
    (text,) = unremoved(FAULTLESS | {"instrument": told})
    assert said in text
    assert f"{size} explains the readings {by}" in text


def test_a_load_cell_that_gives_way_below_all_readings_is_told_with_their_range() -> None:
    knee = {"mean": 7.91, "sd": 3.0, "q05": 3.0, "q95": 15.0}
    content = FAULTLESS | {"instrument": {"fault": FAULT, "nats": 3.0, "parameters": {"cell_knee_N": knee}}}
    (text,) = unremoved(content | {"read_N": (38.2, 74.1)})
    assert "of large forces (at all forces read, 38 to 74 N) explains" in text
    (text,) = unremoved(content | {"read_N": (0.4, 74.1)})
    assert "of large forces (from about 7.9 N on) explains" in text


def test_every_fault_of_an_instrument_has_words() -> None:
    assert set(INSTRUMENT_FAULTS) == {FAULT, *(f"{FAULT}:{form}" for form in effect(FAULT).forms), LATE, PLAY}


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("repeating_N", "in every stroke at the same place"),
        ("bursts_N", "a loose plug"),
        ("hum_N", "a regulator that hunts, a displacement that sticks?"),
        ("chatter_N", "a guide that chatters"),
        ("step_N", "use a finer range"),
        ("left_N", "beside every set tried"),
    ],
)
def test_a_fault_is_told_with_its_size_and_what_may_cause_it(fault: str, said: str) -> None:
    (text,) = unremoved(FAULTLESS | {fault: 1.234})
    assert "1.23 N" in text
    assert said in text


def test_saturated_readings_are_told_in_per_cent() -> None:
    (text,) = unremoved(FAULTLESS | {"saturated_share": 0.0234})
    assert "2.34 % of the readings lie at one extreme force" in text


def test_what_the_residuals_depend_on_is_told_beside_a_remainder() -> None:
    trace = {"trace": {"against": "branch", "rms_N": 0.0456}}
    (text,) = unremoved(FAULTLESS | trace)
    assert "still depends on branch (0.0456 N)" in text
    assert len(unremoved(FAULTLESS | trace | {"left_N": 1.234})) == 2


def test_what_is_left_is_not_what_the_likeliest_set_explains() -> None:
    """The remainder beside no cause at all holds that as well; where none is needed the misfit is left."""
    reported = FAULTLESS | {"remainder_N": 4.31}
    assert unremoved(reported | {"left_N": 0.193}) == ["structure of 0.193 N is left beside every set tried"]
    assert unremoved(reported) == ["structure of 0.567 N is left beside every set tried"]


@pytest.mark.parametrize(
    ("found", "only"),
    [
        ({"hum_N": 2.0}, True),
        ({"saturated_share": 0.02}, True),
        ({"instrument": {"fault": FAULT, "nats": 9.0, "parameters": {}}}, True),
        ({"step_N": 0.5, "remainder_N": 0.3, "misfit_before_N": 0.4}, True),  # the noise would hide it
        ({"step_N": 0.5, "remainder_N": 0.3, "misfit_before_N": 2.0}, False),
        ({"hum_N": 2.0, "trace": {"against": "branch", "rms_N": 0.4}}, False),
        ({"hum_N": 2.0, "causes": [{"id": "creep"}]}, False),
        ({"remainder_N": 0.3}, False),
        ({}, False),
    ],
)
def test_a_recording_at_fault_is_not_the_simulation_s_fault(found: dict[str, Any], only: bool) -> None:
    content = FAULTLESS | {"verdict": "unexplained", "causes": [], "misfit_before_N": 2.0, "noise_N": 1.0}
    content |= {"alternatives": [], "probability": 0.9} | found
    assert only_recording(content) == only
    assert _headline(content).startswith("The recording is at fault" if only else "The declared simulation")
    if content["instrument"]:
        doubtful = content | {"instrument": content["instrument"] | {"nats": -2.0}}
        assert _headline(doubtful).startswith("The recording may be at fault")
    assert _verdict_sentence(content).endswith("the recording is at fault.") == only
