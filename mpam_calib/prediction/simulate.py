"""Synthetic recordings: the declared simulation at its mode, with effects hidden in it on request."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mpam_calib.errors import InputError
from mpam_calib.model.blueprint import Blueprint, Options, draw_blueprint
from mpam_calib.model.model import CONTRACTION_SD, Model, build_model
from mpam_calib.model.noise import CORRELATED, FREEDOM, GROWTH, TIME, WHITE, grown
from mpam_calib.model.readings import Readings
from mpam_calib.model.tensile import NOISE
from mpam_calib.posterior.density.target import build_target, locate
from mpam_calib.posterior.draws import Draws, reported
from mpam_calib.posterior.likelihood.row_motion import row_readings
from mpam_calib.posterior.material import material_of
from mpam_calib.prediction.curves import contraction_grid, first_root
from mpam_calib.prediction.hidden import checked_sizes, not_shown, with_hidden
from mpam_calib.prediction.protocol import LEVELS, thesis_protocol
from mpam_calib.specimen.arguments import demand_specimen, demand_whole
from mpam_calib.specimen.recording import Loops, Specimen

Array = NDArray[np.float64]

THESIS_FRICTION = {"K_f": 0.0787, "f_s": 0.15}
"""Friction of a specimen without data: mean of thesis Table 4.10; the text to Fig. 4.20."""
THESIS_FORCE_SD = 0.25
"""N; 0.1 % of the thesis's 250 N load cell."""
AS_DECLARED = Options(remainder=False, nuisances=False)
"""What is simulated is the declared simulation: what is uncertain in it is as declared."""
FITTED = Options(remainder=False)
"""What is fitted for it: an offset that the gauge is declared to have is not to end in the moduli."""
NOISES = (WHITE, CORRELATED, TIME, GROWTH, FREEDOM)
ROUNDS, SETTLED = 10, 1e-4
"""Of a test without data at most, and the share by which its longest stroke may still change."""
NOT_PUT_IN = (NOISE, CONTRACTION_SD)
"""Noise of files that are not simulated."""


@dataclass(frozen=True)
class Simulated:
    """Synthetic recordings and the truth behind them (lab units).

    ``parameters`` holds all that was put in, under the names of ``summary.csv``; ``not_shown`` are hidden
    effects that change no force that anybody could tell.
    """

    specimen: Specimen
    hidden: dict[str, dict[str, float]]
    parameters: dict[str, float]
    not_shown: tuple[str, ...]


class _Tested(NamedTuple):
    """A specimen with the rows of a test, and what makes their forces."""

    specimen: Specimen
    model: Model
    hidden: dict[str, dict[str, float]]
    values: dict[str, Array]
    eta: Array

    @property
    def stroke(self) -> float:
        """The longest, m."""
        assert self.specimen.loops is not None
        return float(self.specimen.loops.displacement_m.max())


def simulate(specimen: Specimen, hide: Mapping[str, float | None] | None = None, seed: int = 0) -> Simulated:
    """Synthetic recordings of a specimen.

    With data: the mode fitted to them, at their rows. Without: the declared ``E_Pa`` and the thesis's
    protocol. ``hide`` maps effects (``id``, or ``id:form`` for another author's equation, whose own
    parameters are typical) to a size in lab units (None: a typical one). Uncertain geometry and a gauge's
    offset are fitted like all else, and the synthetic muscle and gauge are the declared ones. Raises
    ``InputError`` for an effect that is unknown, is part of the simulation, has no size to hide or lacks
    what it needs, and for a size that its prior all but rules out.
    """
    demand_specimen(specimen)
    demand_whole("--seed", seed, 0)
    hide = checked_sizes(hide)
    rng = np.random.default_rng([seed, 8])
    _demand_rows(specimen)
    if specimen.has_muscle_data:
        test = _fitted(specimen, hide, rng)
    else:
        test = _settled(replace(specimen, levels_Pa=LEVELS), hide)
    return _recorded(test, hide, rng)


def _demand_rows(specimen: Specimen) -> None:
    """Raise ``InputError`` where there are no rows to simulate, and nothing to make them from."""
    declared = specimen.folder / "specimen.toml"
    if not specimen.has_muscle_data:
        if specimen.geometry is None or specimen.simulation.E_Pa is None:
            found = "neither a muscle's data nor E_Pa"
            raise InputError(declared, found, "one of them, to simulate from")
    elif specimen.loops is None and specimen.force_map is None:
        raise InputError(declared, "neither loops nor a force map", "one of them, whose rows to simulate")


def _recorded(test: _Tested, hide: Mapping[str, float | None], rng: np.random.Generator) -> Simulated:
    """What a load cell makes of the forces at the rows of a test."""
    specimen, model, values = test.specimen, test.model, test.values
    assert model.chain is not None and model.setting is not None
    eta, scale = test.eta[:, : model.linear_sizes[0]], model.setting.force_scale
    loops, grid = specimen.loops, specimen.force_map
    floor = specimen.sensors.force_floor_N
    rows = [] if loops is None else [row_readings(loops)]
    if grid is not None:
        assert specimen.geometry is not None
        rows.append(Readings.of_map(grid, specimen.geometry.L0))
    unseen = not_shown(model, values, eta, rows, hide, floor)
    if loops is not None:
        force = model.chain.force(values, eta, rows[0])[0]
        dt = float(np.median(np.diff(loops.time_s)))
        reading, slack = _read(force, dt, values, scale, floor, rng)
        # Each row has the noise of one reading, whatever the rows stood for that it takes its place from.
        loops = replace(loops, force_N=reading, censored=slack, averaged=1)
    if grid is not None:
        force = model.chain.force(values, eta, rows[-1])[0]
        reading, slack = _read(force, None, values, scale, floor, rng)
        grid = replace(grid, force_N=reading, censored=slack)
    made = replace(specimen, loops=loops, force_map=grid, blocked_force=None, free_contraction=None)
    return Simulated(made, test.hidden, _put_in(model, values, eta), unseen)


def _fitted(specimen: Specimen, hide: Mapping[str, float | None], rng: np.random.Generator) -> _Tested:
    """The specimen's own test, with the mode that is fitted to its data."""
    blueprint = draw_blueprint(specimen, AS_DECLARED, material_of(specimen))
    values, eta = _mode(specimen, blueprint.model_copy(update={"options": FITTED}), rng)
    values = {name: values[name] for name in build_model(blueprint).names}
    # What the declared simulation misses is no noise: that is told beside a remainder.
    beside, _ = _mode(specimen, blueprint.model_copy(update={"options": Options()}), rng)
    values |= {name: beside[name] for name in NOISES if name in beside}
    model, hidden = with_hidden(blueprint, values, hide, specimen)
    return _Tested(specimen, model, hidden, values, eta)


def _mode(
    specimen: Specimen, blueprint: Blueprint, rng: np.random.Generator
) -> tuple[dict[str, Array], Array]:
    """Values (1, 1) by name and coordinates (1, k) of the moduli at the best mode of a fit to the data."""
    target, modes = locate(build_target(specimen, blueprint), rng)
    values = {name: value.copy() for name, value in target.model.values(modes[0].u[None]).items()}
    return values, target.linear_mean(values)


def _put_in(model: Model, values: dict[str, Array], eta: Array) -> dict[str, float]:
    """What was put in, lab units: the moduli with everything else that ``summary.csv`` would list."""
    drawn = Draws(np.zeros((1, len(model.names))), values, eta, 1)
    listed = {item.name: float(item.draws[0]) for item in reported(model, drawn)}
    return {name: value for name, value in listed.items() if name not in NOT_PUT_IN}


def _settled(specimen: Specimen, hide: Mapping[str, float | None]) -> _Tested:
    """A test of the hidden effects whose sizes refer to that test: made anew until its strokes stay."""
    test = _tested(specimen, {})
    for _ in range(ROUNDS):
        before, test = test.stroke, _tested(test.specimen, hide)
        if abs(test.stroke - before) <= SETTLED * before:
            break
    return test


def _tested(specimen: Specimen, hide: Mapping[str, float | None]) -> _Tested:
    """The thesis's protocol; a hidden effect's size refers to the time and the strokes that there are."""
    blueprint = draw_blueprint(specimen, AS_DECLARED)
    values, eta = _without_data(build_model(blueprint))
    model, hidden = with_hidden(blueprint, values, hide, specimen)
    loops = _protocol(model, values, eta)
    assert model.chain is not None
    force = model.chain.force(values, eta, row_readings(loops))[0]
    return _Tested(replace(specimen, loops=replace(loops, force_N=force)), model, hidden, values, eta)


def _without_data(model: Model) -> tuple[dict[str, Array], Array]:
    """Every prior's centre, the thesis's friction and its load cell's noise; the moduli's coordinates."""
    values = model.values(np.zeros((1, len(model.names))))
    for name in values:
        stem = name.split("@")[0]
        if stem in THESIS_FRICTION:
            values[name] = np.full((1, 1), THESIS_FRICTION[stem])
    assert model.setting is not None
    values[WHITE] = np.full((1, 1), model.setting.force_sd or THESIS_FORCE_SD)
    return values, np.zeros((1, sum(model.linear_sizes)))


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


def _read(
    force: Array,
    dt: float | None,
    values: dict[str, Array],
    scale: float,
    floor: float | None,
    rng: np.random.Generator,
) -> tuple[Array, NDArray[np.bool_]]:
    """What a load cell makes of forces (n,), N, and which of the readings are slack."""
    held = force if floor is None else np.maximum(force, floor)
    reading = held + _noise(held, dt, values, scale, rng)
    return reading, np.zeros(len(force), dtype=bool) if floor is None else reading <= floor
