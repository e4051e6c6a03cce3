"""Effects: nothing at zero, named by the contract, in the chain's order, the rig's textbook forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rig.chain import force_of
from rig.effects import shared_form
from rig.muscle import Braid, Geometry, Law, Muscle, Simulation
from rig.protocol import Protocol, record_rows

from mpam_calib.model.chain import Chain
from mpam_calib.model.effect import Stage, effect, known_effects
from mpam_calib.model.model import build_model
from mpam_calib.model.moduli import Law as PackageLaw
from mpam_calib.model.moduli import ModuliBlock
from mpam_calib.model.readings import Readings
from mpam_calib.units import si_factor

from . import build
from .test_declared_simulation import readings_of

PARAMETERS = {
    "dead_band": "P_DB_kPa",
    "tip_shape": "tip_factor",
    "braid_kinematics": None,
    "braid_angle": "delta_alpha_deg",
    "braid_stretch": "braid_factor",
    "wall_pressure": "wall_factor",
    "length_offset": "offset_mm",
    "strand_friction": "f_s",
    "coulomb_friction": "K_f",
    "rate_friction": "rate_per_decade",
    "presliding": "reversal_mm",
    "stress_softening": "first_cycle_fraction",
    "creep": "creep_per_decade",
    "force_drift": "drift_N_per_min",
    "pressure_droop": "droop_percent",
    "rig_compliance": "compliance_mm_per_N",
    "law_shape": "law_bend_1",
    "order_too_low": "next_order",
}
"""The contract's table; it leaves the names of the last two open."""
STAGES = {
    Stage.RIG: {"dead_band", "pressure_droop", "length_offset", "rig_compliance"},
    Stage.SHAPE: {"braid_kinematics", "braid_angle", "tip_shape"},
    Stage.STATICS: {"wall_pressure", "braid_stretch", "order_too_low"},
    Stage.FRICTION: {"coulomb_friction", "strand_friction", "rate_friction", "presliding"},
    # A gain on the wall's stress is the history stage's to give, whatever it depends on.
    Stage.HISTORY: {"stress_softening", "creep", "law_shape"},
    Stage.SENSOR: {"force_drift"},
}
OTHER_FRICTION = {"coulomb_friction": "strand", "strand_friction": "coulomb"}
SIZES = {
    "dead_band": 9.0,
    "tip_shape": 0.8,
    "braid_angle": -1.3,
    "braid_stretch": 1.4,
    "wall_pressure": 0.7,
    "length_offset": -0.4,
    "strand_friction": 0.3,
    "coulomb_friction": 0.05,
    "rate_friction": 0.25,
    "presliding": 0.6,
    "creep": 0.02,
    "force_drift": 0.3,
    "pressure_droop": 3.0,
    "rig_compliance": 0.02,
    "braid_kinematics": 1.0,
}
"""In the contract's units."""
REFERENCE_SPEED = 0.05 / 60.0
PROTOCOL = Protocol(
    levels_kPa=(80.0, 140.0, 200.0),
    cycles=2,
    # Rate friction counts from their geometric mean.
    speeds_mm_s=(50.0 / 60.0 / 3.0, 50.0 / 60.0 * 3.0),
    rows_max=900,
    stroke_fraction=0.8,
    pressure_noise_kPa=0.0,
)
MUSCLE = Muscle(
    "test",
    Geometry(50.0, 3.0, 0.7, 72.0),
    Braid(2.1, 0.33, 0.11, 48),
    Simulation(friction="coulomb", friction_value=(0.07,), law=Law("constant", ((6e4,), (2e4,)))),
)


def chain_with(muscle: Muscle, rows, effects: tuple[str, ...]) -> Chain:
    sim = muscle.simulation
    declared = {
        "friction": sim.friction,
        "kinematics": sim.kinematics,
        "strain": sim.strain,
        "law": "constant",
        "order": len(sim.law.constants),
        "effects": effects,
    }
    setting = build.blueprint(declared).setting()
    assert setting is not None
    setting = replace(setting, speed=REFERENCE_SPEED)
    setting = type(setting)(**{**vars(setting), "stroke": float(rows.displacement.max()) * 1e-3})
    mean = np.array([c[0] for c in sim.law.constants])
    law = PackageLaw("constant", len(mean), setting.levels)
    return Chain(setting, ModuliBlock(law, 0.0, mean=mean, root=np.zeros((len(mean), 1))))


def declared_values(muscle: Muscle) -> dict[str, np.ndarray]:
    name = {"coulomb": "K_f", "strand": "f_s", "none": ""}[muscle.simulation.friction]
    return {name: np.array([[muscle.simulation.friction_value[0]]])} if name else {}


def scene(identifier: str) -> Muscle:
    """The muscle that the effect is put on: with the other friction or kinematics where it replaces one."""
    friction = OTHER_FRICTION.get(identifier, "coulomb")
    kinematics = "constant_thickness" if identifier == "braid_kinematics" else "inextensible_braid"
    value = (0.07,) if friction == "coulomb" else (0.25,)
    return MUSCLE.with_simulation(friction=friction, friction_value=value, kinematics=kinematics)


def test_the_list_of_effects_is_the_contract_s():
    assert set(known_effects()) == set(PARAMETERS)


@pytest.mark.parametrize("identifier", sorted(PARAMETERS))
def test_parameter_names_and_stage(identifier):
    item = effect(identifier)
    setting = build.blueprint({"order": 2, "law": "constant"}).setting()
    assert setting is not None
    names = [p.name for p in item.parameters(setting)]
    assert names[:1] == ([PARAMETERS[identifier]] if PARAMETERS[identifier] else [])
    assert len(names) <= 1 or identifier == "law_shape"
    assert identifier in STAGES[item.stage]
    assert item.sentence
    assert item.source
    for parameter in item.parameters(setting):
        # A unit is in the name's ending, or stated; never neither where the SI size differs from one.
        assert si_factor(parameter.name) != 1.0 or parameter.unit is not None or "_N" in parameter.name
        assert np.isfinite(parameter.prior.sd)


def test_effects_act_in_the_order_of_the_chain():
    setting = build.blueprint({"order": 2, "law": "constant"}).setting()
    assert setting is not None
    wanted = ("force_drift", "creep", "presliding", "wall_pressure", "tip_shape", "dead_band")
    simulation = setting.simulation.model_copy(update={"effects": wanted})
    chain = Chain(type(setting)(**{**vars(setting), "simulation": simulation}), None)
    stages = [item.stage for item in chain.effects]
    assert stages == sorted(stages)
    assert [item.id for item in chain.effects] == list(reversed(wanted))
    order = [effect(i).stage for i in known_effects()]
    assert order == sorted(order)


@pytest.mark.parametrize("identifier", sorted(set(PARAMETERS) - {"braid_kinematics"}))
def test_at_zero_an_effect_changes_nothing(identifier):
    """The force is that of the declared simulation, and at the size used below it is another one."""
    muscle = scene(identifier)
    rows = record_rows(PROTOCOL, muscle, 1)
    readings = readings_of(rows)
    eta, values = np.zeros((1, 1)), declared_values(muscle)
    without = chain_with(muscle, rows, ()).force(values, eta, readings)
    chain = chain_with(muscle, rows, (identifier,))
    name = PARAMETERS[identifier]
    values |= {p.name: np.zeros((1, 1)) for p in effect(identifier).parameters(chain.setting)}
    # Turning over within no travel at all is the limit of presliding.
    zero = 1e-12 if identifier == "presliding" else 0.0
    same = chain.force({**values, name: np.array([[zero]])}, eta, readings)
    assert same == pytest.approx(without, rel=1e-12, abs=1e-9)
    size = SIZES.get(identifier, 0.1) * si_factor(name)
    other = chain.force({**values, name: np.array([[size]])}, eta, readings)
    assert np.max(np.abs(other - without)) > 0.1


@pytest.mark.parametrize("identifier", sorted(SIZES))
def test_an_effect_is_the_rig_s_textbook_form(identifier):
    """Same rows, same size, two codes: the forces agree to 1e-9 of the largest force.

    Softening is left out: the package softens the bladder's stress, the rig's forms the whole force.
    """
    muscle = scene(identifier)
    rows = record_rows(PROTOCOL, muscle, 1)
    expected = force_of(muscle, rows, [(shared_form(identifier), SIZES[identifier])])
    chain = chain_with(muscle, rows, (identifier,))
    values = declared_values(muscle)
    if name := PARAMETERS[identifier]:
        values[name] = np.array([[SIZES[identifier] * si_factor(name)]])
    found = chain.force(values, np.zeros((1, 1)), readings_of(rows))[0]
    # The fixture's fixed point is stopped at a micronewton.
    tolerance = 2e-6 if effect(identifier).uses_force else 1e-9 * float(np.abs(expected).max())
    assert found == pytest.approx(expected, abs=tolerance)
    assert np.max(np.abs(expected - force_of(muscle, rows))) > 1e3 * tolerance


EVERY_FORM = sorted(
    f"{identifier}{form and ':'}{form}"
    for identifier in PARAMETERS
    for form in ("", *effect(identifier).all_forms)
)


@pytest.mark.parametrize("identifier", EVERY_FORM)
def test_an_effect_without_memory_looks_at_nothing_that_was_before(identifier):
    """Another past, the same force; and what is said to have a memory has one in some form."""
    item = effect(identifier)
    muscle = scene(item.id.partition(":")[0])
    rows = record_rows(PROTOCOL, muscle, 1)
    readings = readings_of(rows)
    chain = chain_with(muscle, rows, (identifier,))
    rng = np.random.default_rng(5)
    values = declared_values(muscle)
    values |= {p.name: p.prior.from_normal(np.full((1, 1), 1.0)) for p in item.parameters(chain.setting)}
    past = ("time", "file_time", "time_at_level", "cycle", "test_cycle", "travel", "reversal", "speed")
    other = replace(readings, **{name: rng.permutation(getattr(readings, name)) for name in past})
    force, again = (chain.force(values, np.zeros((1, 1)), r) for r in (readings, other))
    if not item.memory:
        np.testing.assert_array_equal(force, again)
    elif ":" not in identifier:
        assert np.max(np.abs(force - again)) > 1e-3


@pytest.mark.parametrize("times", [1.0, 10.0])
def test_a_soft_fixture_is_in_balance_with_the_muscle(times):
    """The force at a reading is that of the muscle as much shorter as the fixture gives."""
    rows = record_rows(PROTOCOL, MUSCLE, 1)
    values = declared_values(MUSCLE)
    compliance = times * SIZES["rig_compliance"] * si_factor("compliance_mm_per_N")
    values["compliance_mm_per_N"] = np.array([[compliance]])
    readings = readings_of(rows)
    found = chain_with(MUSCLE, rows, ("rig_compliance",)).force(values, np.zeros((1, 1)), readings)[0]
    shorter = replace(readings, displacement=readings.displacement + compliance * found)
    bare = chain_with(MUSCLE, rows, ()).force(values, np.zeros((1, 1)), shorter)[0]
    assert bare == pytest.approx(found, abs=1e-4)
    assert np.abs(compliance * found).max() > 1e-5 * times


def test_terms_and_force_agree_with_the_right_guide():
    """The linear part given the force's own sign and size is the exact force, fixture included.

    η is kept small: a wall drawn from the prior can be so steep that a fixture and it have no equilibrium.
    """
    everything = ("dead_band", "tip_shape", "rig_compliance", "creep", "force_drift", "stress_softening")
    model = build_model(build.blueprint({"order": 3, "law": "linear", "effects": everything}, build.PLAIN))
    assert model.chain is not None
    rng = np.random.default_rng(3)
    rows = record_rows(PROTOCOL, MUSCLE, 1)
    readings = readings_of(rows)
    for _ in range(5):
        values = model.values(0.5 * rng.standard_normal((1, len(model.names))))
        eta = 0.05 * rng.standard_normal((1, model.linear_sizes[0]))
        force = model.chain.force(values, eta, readings)
        terms = model.chain.terms(values, readings, force[0])
        again = terms.fixed + np.einsum("bnp,bp->bn", terms.columns, eta)
        assert again == pytest.approx(force, abs=2e-5 + 1e-9 * np.abs(force).max())


@pytest.mark.parametrize(
    ("friction", "effects", "sizes"),
    [
        ("strand", ("coulomb_friction",), {"f_s": 0.5, "K_f": 0.2}),
        ("coulomb", ("strand_friction",), {"f_s": 0.5, "K_f": 0.2}),
        ("coulomb", ("force_drift",), {"K_f": 0.2, "drift_N_per_min": 2.0}),
    ],
)
def test_coulomb_s_law_goes_by_the_muscle_s_own_pull(friction, effects, sizes):
    """Where another friction or the cell's zero turns the reading's sign, terms and force still agree."""
    rows = record_rows(replace(PROTOCOL, stroke_fraction=1.1), MUSCLE, 1)
    chain = chain_with(MUSCLE.with_simulation(friction=friction, friction_value=(0.5,)), rows, effects)
    values = declared_values(MUSCLE) | {
        name: np.array([[size * si_factor(name)]]) for name, size in sizes.items()
    }
    readings, eta = readings_of(rows), np.zeros((1, 1))
    force = chain.force(values, eta, readings)
    found = chain.factored(values, readings, force[0])
    again = found.fixed + found.slope * found.columns.times(eta[0])
    assert again == pytest.approx(force, abs=1e-9 * np.abs(force).max())
    assert np.sum(np.sign(force) != np.sign(force - found.beside)) > 5, "no such rows"


def test_rest_rows_have_no_history():
    """Bands are for a settled muscle: creep, drift, softening and presliding leave it as it is."""
    history = ("creep", "force_drift", "stress_softening", "presliding", "rate_friction")
    readings = Readings.at_rest(np.full(4, 1.5e5), np.linspace(0.0, 0.01, 4), 1.0)
    rows = record_rows(PROTOCOL, MUSCLE, 1)
    chain, bare = chain_with(MUSCLE, rows, history), chain_with(MUSCLE, rows, ())
    values = declared_values(MUSCLE)
    sized = {PARAMETERS[i]: np.array([[0.1 * si_factor(PARAMETERS[i])]]) for i in history}
    with_history = chain.force({**values, **sized}, np.zeros((1, 1)), readings)
    assert with_history == pytest.approx(bare.force(values, np.zeros((1, 1)), readings), rel=1e-12)
