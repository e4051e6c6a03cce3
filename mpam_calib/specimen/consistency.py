"""Whether the parts of a declaration fit each other and the data."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from mpam_calib.errors import InputError
from mpam_calib.specimen.declaration import E_REL_SD, Declaration, Simulation
from mpam_calib.specimen.recording import Floats, Tensile
from mpam_calib.specimen.toml_source import TomlSource
from mpam_calib.specimen.validation import fault
from mpam_calib.units import KPA

CONTRACTS_DEG = math.degrees(math.asin(1.0 / math.sqrt(3.0)))
"""Braid angle from the hoop direction above which a muscle contracts under pressure."""
LEAST_LEVELS = {"linear": 2, "exponential": 3, "exponential_each": 3}
"""Pressure levels that a law needs: two make a line; three tell an exponential from one."""
UNITS_OF_LESS = (1.0, "MPa", 1000), (10.0, "bar", 100)
"""Below so many kPa no bladder is inflated, but muscles are at as many of these units (with their scale)."""


def normalised_simulation(source: TomlSource, declaration: Declaration) -> Simulation:
    """The simulation with what follows from its moduli filled in.

    Declared ``E_Pa`` fix the order, the law (constant) and the strain (engineering); another run's
    moduli the order and the strain that they were found with. A tensile test says nothing of pressure:
    its law is constant. Raises ``InputError`` where the moduli are given twice or not at all, another
    run's do not fit, or an effect or friction lacks its braid.
    """
    simulation = declaration.simulation
    tensile = bool(declaration.files.of("tensile"))
    _check_moduli(source, simulation, tensile)
    _check_braid(source, declaration)
    _check_twice(source, simulation)
    if tensile and not declaration.files.muscle and declaration.geometry is None:
        return simulation.model_copy(update={"moduli": "tensile", "law": "constant", "friction": "none"})
    if simulation.moduli.startswith("run:"):
        return _as_in_run(source, simulation)
    if simulation.moduli != "tensile":
        return simulation
    if simulation.E_Pa is None:
        return simulation.model_copy(update={"law": "constant"})
    sd = E_REL_SD if simulation.E_rel_sd is None else simulation.E_rel_sd
    fixed = {"order": len(simulation.E_Pa), "law": "constant", "strain": "engineering", "E_rel_sd": sd}
    return simulation.model_copy(update=fixed)


def unused(source: TomlSource, declaration: Declaration, used: Simulation) -> tuple[str, ...]:
    """Remarks on what is declared and not used: keys that moduli or friction overrule, a tensile test."""
    stated = source.tables.get("simulation", {})
    other: list[str] = []
    if used.friction == "none" and used.friction_by_pressure:
        other.append('simulation: friction_by_pressure = true is not used: friction is "none"')
    if declaration.files.of("tensile") and declaration.files.muscle and used.moduli != "tensile":
        other.append(f'files: the tensile test is not used: moduli = "{used.moduli}"')
    overruled = (
        f"simulation: {name} = {json.dumps(getattr(declaration.simulation, name))} is not used: "
        f"the moduli make it {json.dumps(getattr(used, name))}"
        for name in ("order", "law", "strain", "friction")
        if name in stated and getattr(declaration.simulation, name) != getattr(used, name)
    )
    return (*other, *overruled)


def check_parts(source: TomlSource, declaration: Declaration, *, data_required: bool) -> None:
    """Refuse a declaration without data, or muscle data without a geometry."""
    simulation = declaration.simulation
    muscle = bool(declaration.files.muscle)
    nothing = not muscle and not declaration.files.of("tensile")
    if nothing and (data_required or simulation.E_Pa is None):
        raise fault(source, ["files"], "no data files", 'at least one, such as loops = "loops.csv"')
    if declaration.geometry is None and (muscle or nothing):
        expected = "L0_mm, R0_mm, t0_mm and alpha0_deg of the muscle"
        raise fault(source, ["geometry"], "no table [geometry]", expected)
    if muscle and declaration.geometry is not None and declaration.geometry.alpha0_deg <= CONTRACTS_DEG:
        given = declaration.geometry.alpha0_deg
        radians = CONTRACTS_DEG <= math.degrees(given) <= 90.0
        meant = f"{math.degrees(given):.1f}" if radians else f"{90.0 - given:g}"
        guess = "radians?" if radians else "the angle from the axis?"
        found = f"{given:g}, a braid that lengthens under pressure ({guess})"
        expected = f"above {CONTRACTS_DEG:.1f} degrees from the hoop direction ({meant}?)"
        raise fault(source, ["geometry", "alpha0_deg"], found, expected)
    strain = declaration.fit.tensile_strain
    if strain is not None and not declaration.files.of("tensile"):
        keys = ["fit", "tensile_strain"]
        raise fault(source, keys, "a strain range without a tensile file", "both or neither")


def material_run(folder: Path, simulation: Simulation) -> Path:
    """Folder of the run that ``moduli = "run:PATH"`` names, relative to the specimen's folder."""
    return folder / simulation.moduli.removeprefix("run:").strip()


def _as_in_run(source: TomlSource, simulation: Simulation) -> Simulation:
    """The simulation with the order and strain of the run that its moduli come from."""
    keys = ["simulation", "moduli"]
    folder = material_run(source.file.parent, simulation)
    if not folder.is_dir():
        found = f'"{simulation.moduli}", which is not there'
        raise fault(source, keys, found, "the folder of a finished run")
    try:
        record = json.loads((folder / "run.json").read_text(encoding="utf-8"))
        run: dict[str, Any] = record["blueprint"]["simulation"]
        own = {"order": int(run["order"]), "strain": str(run["strain"]), "law": str(run["law"])}
    except (OSError, ValueError, KeyError, TypeError):
        found = f'"{simulation.moduli}", a folder without a readable run.json'
        raise fault(source, keys, found, "the folder of a finished run") from None
    if own["law"] != "constant":
        found = f'"{simulation.moduli}", whose moduli depend on pressure (law "{own["law"]}")'
        raise fault(source, keys, found, "a run with a constant law")
    stated = source.tables.get("simulation", {})
    for name in ("order", "strain"):
        if name in stated and getattr(simulation, name) != own[name]:
            expected = f'{own[name]} as in "{simulation.moduli}", or no {name} here'
            raise fault(source, ["simulation", name], f"{getattr(simulation, name)}", expected)
    return simulation.model_copy(update=own)


def check_levels(
    source: TomlSource, simulation: Simulation, levels_Pa: Floats, *, by_setpoint: bool = False
) -> None:
    """Refuse a pressure law that the number of levels (Pa), perhaps told ``by_setpoint``, cannot carry."""
    needed = LEAST_LEVELS.get(simulation.law, 1)
    levels = len(levels_Pa)
    if simulation.moduli == "loops" and levels < needed:
        which = "s" if levels > 1 else _one_level(levels_Pa[0] / KPA, by_setpoint)
        found = f'law "{simulation.law}" with {levels} pressure level{which}'
        expected = f'at least {needed} levels, or law = "constant"'
        raise fault(source, ["simulation", "law"], found, expected)


def _one_level(kilopascals: float, by_setpoint: bool) -> str:
    """Which it is, and what may have made one of several."""
    named = f" ({kilopascals:.3g} kPa"
    for highest, unit, scale in UNITS_OF_LESS:
        if kilopascals < highest:
            return f"{named}: {unit}? scale = {scale} in [columns])"
    return f"{named}, by setpoint_kPa alone: is it what was set?)" if by_setpoint else f"{named})"


def least_parameters(simulation: Simulation, levels: int) -> int:
    """The number of parameters that the muscle's rows have to tell, noise included."""
    order = simulation.order
    by_law = {
        "constant": order,
        "linear": 2 * order,
        "exponential": 2 * order + 2,
        "exponential_each": 4 * order,
        "free": order * levels,
    }
    moduli = by_law[simulation.law] if simulation.moduli == "loops" else 0
    friction = 0 if simulation.friction == "none" else 1
    if simulation.friction_by_pressure:
        friction *= levels
    return moduli + friction + len(simulation.effects) + 1


def check_rows(label: str, rows: int, parameters: int) -> None:
    """Refuse fewer rows than parameters."""
    if rows < parameters:
        found = f"{rows} row{'s' if rows != 1 else ''} of data"
        raise InputError(label, found, _at_least(parameters))


def check_strains(
    source: TomlSource, declaration: Declaration, label: str, tensile: Tensile, parameters: int
) -> None:
    """Refuse fewer rows than parameters of a tensile test within the strains that are fitted."""
    low, high = declaration.fit.tensile_strain or tensile.strain_range
    rows, every = int(((tensile.strain >= low) & (tensile.strain <= high)).sum()), len(tensile.strain)
    if declaration.fit.tensile_strain is None or every < parameters:
        check_rows(label, rows, parameters)
    elif rows < parameters:
        found = f"{rows} of {every} rows between {low:g} and {high:g}"
        runs = f"the strains run from {tensile.strain.min():.3g} to {tensile.strain.max():.3g}"
        raise fault(source, ["fit", "tensile_strain"], found, f"{_at_least(parameters)}; {runs}")


def _at_least(parameters: int) -> str:
    return f"at least {parameters}, one for each parameter of the simulation"


def _check_moduli(source: TomlSource, simulation: Simulation, tensile: bool) -> None:
    keys = ["simulation", "E_Pa"]
    if simulation.E_Pa is not None and tensile:
        raise fault(source, keys, "both E_Pa and a tensile file", "one of them")
    for name, value in (("E_Pa", simulation.E_Pa), ("E_rel_sd", simulation.E_rel_sd)):
        if value is not None and simulation.moduli != "tensile":
            keys = ["simulation", name]
            found = f'{name} with moduli = "{simulation.moduli}"'
            raise fault(source, keys, found, f'moduli = "tensile", or no {name}')
    if simulation.moduli == "tensile" and simulation.E_Pa is None and not tensile:
        keys = ["simulation", "moduli"]
        raise fault(source, keys, '"tensile" without E_Pa and without a tensile file', "one of them")
    if simulation.E_rel_sd is not None and simulation.E_Pa is None:
        raise fault(source, ["simulation", "E_rel_sd"], "E_rel_sd without E_Pa", "both or neither")


def _check_braid(source: TomlSource, declaration: Declaration) -> None:
    simulation = declaration.simulation
    users: list[str] = [
        name for name in ("braid_stretch", "strand_friction") if name in simulation.effect_ids
    ]
    if simulation.friction == "strand":
        users.append('friction = "strand"')
    if users and declaration.braid is None:
        keys = ["simulation", "effects" if "=" not in users[0] else "friction"]
        raise fault(source, keys, f"{users[0]} without a [braid]", "E_br_GPa, nu_s, R_br_mm and n in [braid]")


def _check_twice(source: TomlSource, simulation: Simulation) -> None:
    """Refuse an effect that the simulation has already."""
    has = simulation.effects_within
    for name in simulation.effect_ids:
        if name in has:
            keys = ["simulation", "effects"]
            raise fault(source, keys, f'"{name}" beside {has[name]}, which is the same', "one of them")
