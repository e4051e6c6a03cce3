"""Synthetic recordings: the declared simulation at its mode, with effects hidden in it on request."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mpam_calib.errors import InputError
from mpam_calib.model.blueprint import Blueprint, draw_blueprint
from mpam_calib.model.effect import effect, known_effects
from mpam_calib.model.model import CONTRACTION_SD, Model, build_model
from mpam_calib.model.noise import CORRELATED, FREEDOM, GROWTH, TIME, WHITE, grown
from mpam_calib.model.readings import Readings
from mpam_calib.model.remainder import ROUGH, SMOOTH
from mpam_calib.model.tensile import MISFIT, NOISE
from mpam_calib.posterior.draws import Draws, reported
from mpam_calib.posterior.material import material_of
from mpam_calib.posterior.row_motion import row_readings
from mpam_calib.posterior.target import build_target, locate
from mpam_calib.prediction.curves import contraction_grid, first_root
from mpam_calib.prediction.protocol import LEVELS, thesis_protocol
from mpam_calib.specimen.arguments import demand_specimen, demand_whole, is_number
from mpam_calib.specimen.recording import ForceMap, Loops, Specimen
from mpam_calib.units import si_factor

Array = NDArray[np.float64]

THESIS_FRICTION = {"K_f": 0.0787, "f_s": 0.15}
"""Friction of a specimen without data: mean of thesis Table 4.10; the text to Fig. 4.20."""
THESIS_FORCE_SD = 0.25
"""N; 0.1 % of the thesis's 250 N load cell."""
NOT_PUT_IN = (SMOOTH, ROUGH, NOISE, MISFIT, CONTRACTION_SD)
"""Parameters of what is not simulated: the remainder, and other files' readings."""
FRICTIONS = {"coulomb_friction", "strand_friction"}
OF_FRICTION = {"presliding", "rate_friction"}
"""Effects that are a friction, and those that only change one."""
TYPICAL = 1.0
"""Standard normal image of a hidden effect's default size: a large but ordinary draw of its prior."""
FARTHEST = 6.0
"""Standard normal image of the largest size that may be hidden, and less this of the smallest."""


@dataclass(frozen=True)
class Simulated:
    """Synthetic recordings and the truth behind them (lab units).

    ``parameters`` holds all that was put in, under the names of ``summary.csv``.
    """

    specimen: Specimen
    hidden: dict[str, dict[str, float]]
    parameters: dict[str, float]


def simulate(specimen: Specimen, hide: Mapping[str, float | None] | None = None, seed: int = 0) -> Simulated:
    """Synthetic recordings of a specimen.

    With data: the mode fitted to them, at their rows. Without: the declared ``E_Pa`` and the thesis's
    protocol. ``hide`` maps effects (``id``, or ``id:form`` for another author's equation, whose own
    parameters are typical) to a size in lab units (None: a typical one). Raises ``InputError`` for one that
    is unknown, is part of the simulation, has no size to hide, or lacks what it needs, and for a size that
    its prior all but rules out.
    """
    demand_specimen(specimen)
    demand_whole("--seed", seed, 0)
    hide = _checked(hide)
    rng = np.random.default_rng([seed, 8])
    fitted = specimen.has_muscle_data
    if not fitted and (specimen.geometry is None or specimen.simulation.E_Pa is None):
        raise InputError(
            specimen.folder / "specimen.toml",
            "neither a muscle's data nor E_Pa",
            "one of them, to simulate from",
        )
    if fitted and specimen.loops is None and specimen.force_map is None:
        raise InputError(
            specimen.folder / "specimen.toml",
            "neither loops nor a force map",
            "one of them, whose rows to simulate",
        )
    if fitted:
        blueprint = draw_blueprint(specimen, material=material_of(specimen))
        target, modes = locate(build_target(specimen, blueprint), rng)
        values = {k: v.copy() for k, v in target.model.values(modes[0].u[None]).items()}
        eta = target.linear_mean(values)
    else:
        specimen = replace(specimen, levels_Pa=LEVELS)
        blueprint = draw_blueprint(specimen)
        model = build_model(blueprint)
        values = _without_data(model)
        eta = np.zeros((1, sum(model.linear_sizes)))
    model, hidden = _with_hidden(blueprint, values, hide, specimen)
    assert model.chain is not None
    eta = eta[:, : model.linear_sizes[0]]
    loops, grid = specimen.loops, specimen.force_map
    if not fitted:
        loops = _protocol(model, values, eta)
    if loops is not None:
        force = model.chain.force(values, eta, row_readings(loops))[0]
        assert model.setting is not None
        floor = specimen.sensors.force_floor_N
        loops = _record(loops, force, values, model.setting.force_scale, floor, rng)
    if grid is not None:
        grid = _record_map(model, grid, values, eta, specimen, rng)
    result = replace(
        specimen,
        loops=loops,
        force_map=grid,
        blocked_force=None,
        free_contraction=None,
        tensile=specimen.tensile,
    )
    return Simulated(result, hidden, _put_in(model, values, eta))


def _put_in(model: Model, values: dict[str, Array], eta: Array) -> dict[str, float]:
    """What was put in, lab units: the moduli with everything else that ``summary.csv`` would list."""
    # What a hidden effect takes the place of (a declared sd's parameter) still acts as fitted.
    shown = {k: float(v[0, 0] / si_factor(k)) for k, v in values.items() if k not in model.names}
    drawn = Draws(np.zeros((1, len(model.names))), values, eta, 1)
    shown |= {item.name: float(item.draws[0]) for item in reported(model, drawn)}
    return {name: value for name, value in shown.items() if name not in NOT_PUT_IN}


def _checked(hide: object) -> Mapping[str, float | None]:
    """What is to be hidden, where it is ids with sizes."""
    expected = 'effect ids with sizes, such as {"dead_band": 7.5}, None for a typical one'
    if not isinstance(hide, Mapping | None):
        raise InputError("--hide", f"{type(hide).__name__} {str(hide)[:40]}", expected)
    for name, size in (hide or {}).items():
        if not isinstance(name, str) or not (size is None or is_number(size)):
            raise InputError("--hide", f"{name}={size!r}", expected)
    return hide or {}


def _without_data(model: Model) -> dict[str, Array]:
    """Every prior's centre, the thesis's friction and its load cell's noise."""
    values = model.values(np.zeros((1, len(model.names))))
    for name in values:
        stem = name.split("@")[0]
        if stem in THESIS_FRICTION:
            values[name] = np.full((1, 1), THESIS_FRICTION[stem])
    assert model.setting is not None
    values[WHITE] = np.full((1, 1), model.setting.force_sd or THESIS_FORCE_SD)
    return values


def _with_hidden(
    blueprint: Blueprint, values: dict[str, Array], hide: Mapping[str, float | None], specimen: Specimen
) -> tuple[Model, dict[str, dict[str, float]]]:
    """The model with the hidden effects, their sizes put among the values."""
    place = "--hide"
    hidden: dict[str, dict[str, float]] = {}
    for declared, size in hide.items():
        identifier, _, form = declared.partition(":")
        if identifier not in known_effects():
            raise InputError(place, f'"{identifier}"', "one of " + ", ".join(known_effects()))
        forms = effect(identifier).forms
        if declared != identifier and form not in forms:
            known = "one of " + ", ".join(f"{identifier}:{f}" for f in forms) if forms else identifier
            raise InputError(place, f'"{declared}"', known)
        item = effect(declared)
        if item.needs_braid and specimen.braid is None:
            raise InputError(place, f"{identifier} without [braid]", "the strands' values in specimen.toml")
        simulation = blueprint.simulation
        if identifier in simulation.effect_ids or identifier in simulation.effects_within:
            raise InputError(place, f'"{identifier}"', "an effect that the simulation does not have")
        extended = simulation.model_copy(update={"effects": (*simulation.effects, declared)})
        blueprint = blueprint.model_copy(update={"simulation": extended})
        setting = blueprint.setting()
        assert setting is not None
        parameters = item.parameters(setting)
        shared = {p.name for p in effect(identifier).parameters(setting)}
        sizes = [p.name for p in parameters if p.name in shared]
        if size is not None and len(sizes) != 1:
            raise InputError(place, f"{declared}={size:g}", f"no value: {declared} has no single size")
        hidden[declared] = {}
        for parameter in parameters:
            factor = si_factor(parameter.name)
            smallest, typical, largest = (
                float(parameter.prior.from_normal(np.array(z))) for z in (-FARTHEST, TYPICAL, FARTHEST)
            )
            value = typical if size is None or parameter.name not in sizes else size * factor
            if not smallest <= value <= largest:
                bounds = f"between {smallest / factor:.3g} and {largest / factor:.3g}"
                expected = f"{bounds} {parameter.printed_unit}".strip()
                raise InputError(place, f"{declared}={size:g}", expected)
            if parameter.name in values:
                raise InputError(place, f'"{identifier}"', f"an effect without the declared {parameter.name}")
            values[parameter.name] = np.full((1, 1), value)
            hidden[declared][parameter.name] = value / factor
    rubs = blueprint.simulation.friction != "none" or FRICTIONS & set(blueprint.simulation.effect_ids)
    for identifier in sorted(OF_FRICTION & {declared.partition(":")[0] for declared in hidden}):
        if not rubs:
            raise InputError(place, f"{identifier} without friction", "a friction that it can change")
    return build_model(blueprint), hidden


def _protocol(model: Model, values: dict[str, Array], eta: Array) -> Loops:
    assert model.chain is not None and model.setting is not None
    L0 = model.setting.geometry.L0
    grid = contraction_grid(model, 0.0)
    free = []
    for level in LEVELS:
        readings = Readings.at_rest(np.full(len(grid), level), grid * L0)
        free.append(float(first_root(grid, model.chain.force(values, eta, readings))[0]))
    return thesis_protocol(np.array(free), L0)


def _noise(
    force: Array, dt: float | None, values: dict[str, Array], scale: float, rng: np.random.Generator
) -> Array:
    """White noise (Student-t where that is declared) and an AR(1) part, N; without a clock the former alone.

    Both grow with the force (n,) over ``scale`` (N) where that is declared.
    """
    count = len(force)
    noise = values[WHITE][0, 0] * rng.standard_normal(count)
    if FREEDOM in values:
        dof = values[FREEDOM][0, 0]
        noise = noise / np.sqrt(rng.chisquare(dof, count) / dof)
    if dt is not None and CORRELATED in values:
        from scipy.signal import lfilter

        rho = float(np.exp(-dt / values[TIME][0, 0]))
        shocks = rng.standard_normal(count) * np.sqrt(1.0 - rho**2)
        shocks[0] = rng.standard_normal()
        noise = noise + values[CORRELATED][0, 0] * lfilter([1.0], [1.0, -rho], shocks)
    if GROWTH in values:
        noise = noise * grown(values[GROWTH][0, 0], force, scale)
    return np.asarray(noise)


def _record(
    loops: Loops,
    force: Array,
    values: dict[str, Array],
    scale: float,
    floor: float | None,
    rng: np.random.Generator,
) -> Loops:
    dt = float(np.median(np.diff(loops.time_s)))
    held = force if floor is None else np.maximum(force, floor)
    reading = held + _noise(held, dt, values, scale, rng)
    censored = np.zeros(len(force), dtype=bool) if floor is None else reading <= floor
    # Each row has the noise of one reading, whatever the rows stood for that it takes its place from.
    return replace(loops, force_N=reading, censored=censored, averaged=1)


def _record_map(
    model: Model,
    grid: ForceMap,
    values: dict[str, Array],
    eta: Array,
    specimen: Specimen,
    rng: np.random.Generator,
) -> ForceMap:
    assert model.chain is not None and specimen.geometry is not None
    sign = np.where(np.abs(grid.branch) == 1, grid.branch, 0).astype(np.float64)
    readings = Readings.at_rest(grid.pressure_Pa, grid.contraction * specimen.geometry.L0, sign)
    readings = replace(readings, level=grid.level)
    force = model.chain.force(values, eta, readings)[0]
    floor = specimen.sensors.force_floor_N
    held = force if floor is None else np.maximum(force, floor)
    assert model.setting is not None
    reading = held + _noise(held, None, values, model.setting.force_scale, rng)
    censored = np.zeros(len(force), dtype=bool) if floor is None else reading <= floor
    return replace(grid, force_N=reading, censored=censored)
