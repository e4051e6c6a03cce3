"""An effect registered from outside the package calibrates like its own."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mpam_calib.errors import InputError
from mpam_calib.model import effect as registry
from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.model.effect import Effect, Stage, effect, known_effects, register
from mpam_calib.model.priors import Normal, Parameter
from mpam_calib.posterior.density.target import build_target, locate, predict_force
from mpam_calib.specimen import effect_ids, read

from . import build

DATASETS = Path(__file__).parents[2] / "datasets"
IDENTIFIER = "temperature_zero"
SWING = 0.8


def _parameters(setting):
    return (Parameter("swing_N", Normal(0.0, 2.0), "daily swing of the load cell's zero"),)


def _apply(state, values, setting):
    return state._replace(zero=state.zero + values["swing_N"] * np.sin(5.0 * state.readings.time))


@pytest.fixture
def outside() -> Iterator[Effect]:
    made = register(
        Effect(
            id=IDENTIFIER,
            stage=Stage.SENSOR,
            title="Swing of the zero",
            sentence="the load cell's zero swings with the room's temperature",
            source="a test",
            parameters=_parameters,
            apply=_apply,
            bends={"time": 1},
        )
    )
    yield made
    # There is no call for this: an effect stays for as long as the process does.
    del registry._REGISTRY[IDENTIFIER]
    del effect_ids._added[IDENTIFIER]


def test_it_is_known(outside):
    assert effect(IDENTIFIER) is outside
    assert IDENTIFIER in known_effects()
    assert IDENTIFIER in effect_ids.known_effect_ids()
    assert known_effects()[-1] == IDENTIFIER  # in the chain's order: a sensor's effect comes last


def test_an_id_can_be_taken_only_once(outside):
    with pytest.raises(ValueError, match="registered already"):
        register(outside)
    effect_ids.add_effect_id(IDENTIFIER)
    assert effect_ids.known_effect_ids().count(IDENTIFIER) == 1


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"id": ""}, "register:id: found ''"),
        ({"id": "a:b"}, "register:id: found 'a:b'"),
        ({"id": "has space"}, "register:id: found 'has space'"),
        ({"id": "other", "stage": "sensor"}, "register:stage: found 'sensor', expected a Stage"),
        ({"id": "other", "apply": None}, "register:apply: found None, expected a function"),
        ({"id": "other", "parameters": ()}, "register:parameters: found (), expected a function"),
        ({"id": "other", "bends": {"swing_N": 1}}, "register:bends: found 'swing_N', expected one of contr"),
        ({"id": "other", "bends": {"time": 0}}, "register:bends: found 0, expected a whole number"),
        ({"id": "other", "looseness": 0.0}, "register:looseness: found 0.0, expected a number above 0"),
        ({"id": "other", "resolution": {"swing_N": 0}}, "register:resolution: found {'swing_N': 0}"),
        ({"id": "other", "forms": {"a b": _apply}}, "register:forms: found 'a b'"),
    ],
)
def test_what_cannot_be_an_effect_is_not_registered(outside, changes, said):
    with pytest.raises(InputError) as error:
        register(replace(outside, **changes))
    assert str(error.value).startswith(said)
    assert isinstance(error.value, ValueError)
    assert known_effects()[-1] == IDENTIFIER


@pytest.mark.parametrize(("form", "refused"), [("bent", False), ("soft", True)])
def test_its_forms_may_be_declared(outside, tmp_path, form, refused):
    """`diagnose` writes such a form into the extended specimen: reading it back must work."""
    folder = tmp_path / "mpam1"
    shutil.copytree(DATASETS / "mpam1_reconstructed", folder)
    toml = folder / "specimen.toml"
    toml.write_text(toml.read_text().replace('["dead_band"]', f'["{IDENTIFIER}:{form}"]'))
    if refused:
        with pytest.raises(InputError, match="bent"):
            read(folder)
    else:
        assert list(read(folder).simulation.effects) == [f"{IDENTIFIER}:{form}"]


def test_it_calibrates(outside):
    """A swing of 0.8 N is found again to 4 posterior sds; without the effect it counts as noise."""
    recorded = build.loops(rows=16, cycles=2)
    with_it = {"law": "linear", "order": 2, "effects": (IDENTIFIER,)}
    made = build.with_force(build.specimen(with_it, recorded), np.full(192, 20.0))
    blueprint = draw_blueprint(made, build.PLAIN)
    target = build_target(made, blueprint)
    assert target.model.names == ("K_f", "swing_N", "noise_sd_N")
    rng = np.random.default_rng(2)
    truth = {"K_f": np.array([[0.05]]), "swing_N": np.array([[SWING]])}
    eta = 0.3 * rng.standard_normal((1, 4))
    force = predict_force(target.model, truth, eta, build.rows_of(recorded))[0]
    made = build.with_force(made, force + 0.2 * rng.standard_normal(len(force)))
    target, modes = locate(build_target(made, blueprint), np.random.default_rng(0))
    i = target.model.names.index("swing_N")
    mean = float(target.model.values(modes[0].u[None])["swing_N"][0, 0])
    sd = 2.0 * float(np.sqrt(modes[0].covariance[i, i]))  # the prior is normal with sd 2
    assert sd < 0.1
    assert abs(mean - SWING) < 4.0 * sd
    # A quick swing that no modulus follows: rms 0.57 N beside 0.2 N of noise make 0.60 N.
    without = replace(made, simulation=made.simulation.model_copy(update={"effects": ()}))
    bare, bare_modes = locate(
        build_target(without, draw_blueprint(without, build.PLAIN)), np.random.default_rng(0)
    )
    noise = float(bare.model.values(bare_modes[0].u[None])["noise_sd_N"][0, 0])
    assert noise > 0.5
    assert modes[0].log_evidence > bare_modes[0].log_evidence + 20.0


def test_it_is_gone_afterwards():
    assert IDENTIFIER not in known_effects()
    assert IDENTIFIER not in effect_ids.known_effect_ids()
