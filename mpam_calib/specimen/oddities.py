"""What can be used but is hardly meant: remarks for ``check``, one sentence each."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mpam_calib.physics.kinematics import SHAPES, Rest
from mpam_calib.physics.statics import gas_force, thickness_force
from mpam_calib.specimen.declaration import Geometry
from mpam_calib.specimen.load_cell import odd_readings
from mpam_calib.specimen.motion import run_ids
from mpam_calib.specimen.odd_tensile import odd_tests
from mpam_calib.specimen.plausibility import longest_contraction
from mpam_calib.specimen.recording import Floats, Loops, Specimen
from mpam_calib.specimen.repeats import repeated_rows
from mpam_calib.specimen.sticking import sticking
from mpam_calib.specimen.summary import BRANCH_NAMES, sampling_rates, stroke_speeds
from mpam_calib.units import KPA, MINUTE, MM

FEW = 30
"""Readings of loops below which little can be learnt from them."""
GAP_STEPS = 20.0
"""A pause in the recording is this many times longer than the usual step."""
WANDER_SHARE = 0.05
"""Pressure that strays further than this share from its level is worth a remark."""
FAR_LEVEL = 0.5
"""Readings further from their level than this share of the highest are no wandering."""
USUAL_SHARE = 0.99
"""Forces and pressures up to this quantile are the usual ones ..."""
FAR = 30.0
"""... and this many times as large is far from them."""
GAS = 3.0
"""Forces of muscles are within this factor of what the gas alone pulls."""
BELOW_GAS = 10.0
"""A bladder that is not stretched beyond L0 adds no such multiple of the gas's own pull."""
VACUUM, BY_VACUUM = 0.02, 0.1
"""Share of the largest pressure by which a gauge may be off, and of the gas's push in a vacuum by which
a load cell may."""
SLOW_HZ, FAST = 0.05, 0.2
"""Readings rarer than this, and crossheads faster (m/s), are no tensile tester's."""
STIFFNESS_PA = 100.0, 1e11
"""Between these are the declared moduli of everything that a bladder is made of, and far beyond."""
STRAND_GPA = 0.01, 1e3
"""Between these are the moduli of all threads and wires, from elastic cord to carbon."""
STRETCHED = 0.01
"""A bladder that is longer than at rest by more than this share pulls by itself."""
LITTLE_FURTHER = 0.01
"""An encoder's zero may make up for this much more contraction than the braid allows."""
SMALL_SHARE = 0.12
"""Contractions that stay below this share of what the braid allows may be in other units."""


def oddities(specimen: Specimen) -> list[str]:
    """What can be used but should be looked at, one sentence each."""
    remarks = list(specimen.notes)
    loops = specimen.loops
    if loops is not None:
        if len(loops.force_N) < FEW:
            remarks.append(f"loops: {len(loops.force_N)} readings; so few hardly contradict any simulation")
        remarks += _odd_times(loops)
        remarks += _odd_speeds(loops)
        remarks += _odd_cycles(loops) + _cycles_that_go_on(loops, specimen.levels_Pa)
        remarks += _odd_levels(loops, specimen.levels_Pa)
        remarks += odd_readings(loops, specimen.levels_Pa) + sticking(loops)
    if specimen.force_map is not None:
        remarks += repeated_rows(specimen.force_map)
    if specimen.geometry is not None:
        remarks += _odd_forces(specimen) + _odd_signs(specimen)
    remarks += _odd_contractions(specimen)
    remarks += _odd_stiffness(specimen) + odd_tests(specimen)
    gauge, top = specimen.sensors.pressure_bias_sd_kPa, float(specimen.levels_Pa.max(initial=0.0)) / KPA
    if gauge > top > 0.0:
        remarks.append(f"sensors: pressure_bias_sd_kPa = {gauge:g} is above the highest level, {top:.4g} kPa")
    for name, part in (
        ("loops", loops),
        ("force_map", specimen.force_map),
        ("blocked_force", specimen.blocked_force),
    ):
        if part is not None and part.censored.any():
            count = int(part.censored.sum())
            remarks.append(
                f"{name}: {count} of {len(part.censored)} rows are slack (at the floor or censored)"
            )
    return remarks


def _odd_times(loops: Loops) -> list[str]:
    remarks = []
    for clock in np.unique(loops.clock):
        time, level = loops.time_s[loops.clock == clock], loops.level[loops.clock == clock]
        steps = np.diff(time)
        if not len(steps):
            continue
        # A pause between two levels is the protocol's; one within a level is not.
        gaps = np.flatnonzero((steps > GAP_STEPS * np.median(steps)) & (np.diff(level) == 0))
        if len(gaps):
            longest = gaps[np.argmax(steps[gaps])]
            many = "a gap" if len(gaps) == 1 else f"{len(gaps)} gaps"
            remarks.append(
                f"loops: {many} in the time of file {clock + 1} within a level, "
                f"the longest {steps[longest]:.3g} s, {time[longest]:.6g} s after the first reading"
            )
    return remarks


def _odd_speeds(loops: Loops) -> list[str]:
    """Times that are hardly seconds."""
    remarks = []
    rates, speeds = sampling_rates(loops), stroke_speeds(loops)
    if rates and min(rates) < SLOW_HZ:
        remarks.append(f"loops: a reading every {1.0 / min(rates):.3g} s; is time_s in seconds?")
    if speeds.max(initial=0.0) > FAST:
        fastest = speeds.max() * MINUTE / MM
        remarks.append(f"loops: the crosshead moves at {fastest:.3g} mm/min; is time_s in seconds?")
    return remarks


def _odd_cycles(loops: Loops) -> list[str]:
    """Cycles that are numbered from the last to the first; a number that begins anew now and then is none."""
    step = np.diff(loops.cycle)[np.diff(run_ids(loops.clock, loops.level)) == 0]
    down, changes = int((step < 0).sum()), int((step != 0).sum())
    if 2 * down <= changes:
        return []
    return [
        f"loops: the column cycle counts down ({down} of {changes} changes within a level); does 1 stand for "
        "the first cycle?"
    ]


def _cycles_that_go_on(loops: Loops, levels_Pa: Floats) -> list[str]:
    """Cycles that are numbered through the whole test: most levels begin with the next number."""
    sure = loops.clear  # a row that is another level's has its cycle, too
    levels, first = np.unique(sure.level, return_index=True)
    later = np.argsort(first)[1:]
    lowest = {place: int(sure.cycle[sure.level == levels[place]].min()) for place in later}
    on = [place for place, number in lowest.items() if number == sure.cycle[: first[place]].max() + 1]
    if 2 * len(on) <= len(later):
        return []
    return [
        f"loops: cycle goes on from level to level ({levels_Pa[levels[on[0]]] / KPA:.4g} kPa begins with "
        f"{lowest[on[0]]}); does it count from 1 within each level?"
    ]


def level_stray(loops: Loops, levels_Pa: Floats, index: int) -> float:
    """How far (Pa) the readings of a level's pressure stray from it, all but one in a hundred; 0 without any.

    Where it is changed on purpose it does not stray.
    """
    steady = _steady(loops, index)
    return float(np.quantile(np.abs(steady - levels_Pa[index]), 0.99)) if len(steady) else 0.0


def stroke_stray(loops: Loops, levels_Pa: Floats, index: int) -> float:
    """How far (Pa) a stroke at a level strays from it, by the median of its readings; 0 without any.

    Neither a gauge's noise nor a regulator that is slow makes a stroke of another level.
    """
    rows = _steady_rows(loops, index)
    pressure, stroke = loops.pressure_Pa[rows], loops.stroke[rows]
    middles = [np.median(pressure[stroke == one]) for one in np.unique(stroke)]
    return float(np.abs(np.array(middles) - levels_Pa[index]).max(initial=0.0))


def _steady(loops: Loops, index: int) -> Floats:
    return np.asarray(loops.pressure_Pa[_steady_rows(loops, index)])


def _steady_rows(loops: Loops, index: int) -> NDArray[np.bool_]:
    return np.asarray((loops.level == index) & (np.abs(loops.branch) != 2))


def _odd_levels(loops: Loops, levels_Pa: Floats) -> list[str]:
    remarks = []
    for index in np.unique(loops.level):
        rows = loops.level == index
        name = f"loops: {levels_Pa[index] / KPA:.4g} kPa"
        present = [int(code) for code in np.unique(loops.branch[rows]) if code != 0]
        if len(present) == 1:
            remarks.append(f"{name} has only the branch {BRANCH_NAMES[present[0]]}")
        steady = _steady(loops, index)
        if len(steady):
            stray = level_stray(loops, levels_Pa, index)
            if stray > WANDER_SHARE * abs(levels_Pa[index]):
                remarks.append(f"{name} wanders by {stray / KPA:.3g} kPa")
            blips = np.abs(steady - levels_Pa[index]) > max(FAR_LEVEL * levels_Pa.max(), 2.0 * stray)
            if blips.any():
                worst = steady[np.abs(steady - levels_Pa[index]).argmax()] / KPA
                many = "a reading" if blips.sum() == 1 else f"{int(blips.sum())} readings"
                remarks.append(f"{name} has {many} far from it ({worst:.4g} kPa)")
        idle = int((loops.branch[rows] == 0).sum())
        if idle:
            remarks.append(
                f"{name} has {idle} rows without a branch (before the first motion, or empty cells)"
            )
    return remarks


def _odd_forces(specimen: Specimen) -> list[str]:
    """Forces far from what the gas can pull, and readings far from all others."""
    assert specimen.geometry is not None
    geometry, remarks = specimen.geometry, []
    for name, (pressure, contraction, force) in _with_contraction(specimen).items():
        remarks += _stray_forces(name, specimen, force)
        usual, top = (float(np.quantile(np.abs(x), USUAL_SHARE)) for x in (force, pressure))
        gas = _gas_force(geometry, top, max(float(contraction.min()), 0.0))
        if gas > 0.0 and not gas / GAS < usual < GAS * gas:
            remarks.append(
                f"{name}: forces up to {usual:.3g} N, while the gas alone pulls about {gas:.3g} N at the "
                "highest pressure; are the units of force and pressure right, and R0_mm a radius?"
            )
        remarks += _pulls_in_a_vacuum(name, geometry, pressure, contraction, force)
    return remarks + _odd_level_forces(specimen)


def _pulls_in_a_vacuum(
    name: str, geometry: Geometry, pressure: Floats, contraction: Floats, force: Floats
) -> list[str]:
    """Forces that no gas pulls with, since it is under less than the air's pressure."""
    under = (pressure < -VACUUM * np.abs(pressure).max()) & (contraction > -STRETCHED)
    if under.mean() < 1.0 - USUAL_SHARE:  # no level
        return []
    pulls, lowest = float(np.quantile(force[under], USUAL_SHARE)), float(np.median(pressure[under]))
    if pulls <= BY_VACUUM * abs(_gas_force(geometry, lowest, 0.0)):
        return []
    return [
        f"{name}: forces up to {pulls:.3g} N at {lowest / KPA:.4g} kPa, where a bladder under less than the "
        "air's pressure cannot pull; is the pressure's sign right, and 0 the atmosphere, not a vacuum?"
    ]


def _odd_level_forces(specimen: Specimen) -> list[str]:
    """Levels of loops whose force is like the others', under a pressure that is not: one file in bar."""
    loops, geometry = specimen.loops, specimen.geometry
    assert geometry is not None
    if loops is None or len(np.unique(loops.level)) < 2:
        return []
    top = {}
    for index in np.unique(loops.level):
        at = loops.level == index
        pulls = float(np.quantile(loops.force_N[at], USUAL_SHARE))
        top[int(index)] = pulls if loops.displacement_m[at].min() > -STRETCHED * geometry.L0 else 0.0
    found = []
    for index, pulls in top.items():
        if specimen.levels_Pa[index] < -VACUUM * np.abs(specimen.levels_Pa).max():
            continue  # told of already
        gas = _gas_force(geometry, float(specimen.levels_Pa[index]), 0.0)
        others = float(np.median([force for other, force in top.items() if other != index]))
        if pulls > BELOW_GAS * gas and pulls > 0.5 * others:
            found.append((pulls / gas if gas > 0.0 else np.inf, index, pulls, gas))
    if not found:
        return []
    _, index, pulls, gas = max(found)
    more = "" if len(found) == 1 else f" (likewise at {len(found) - 1} of the other levels)"
    return [
        f"loops: forces up to {pulls:.3g} N at {specimen.levels_Pa[index] / KPA:.4g} kPa, where the gas "
        f"pulls about {gas:.2g} N{more}; is every file's pressure in kPa, and the load cell zeroed?"
    ]


def _odd_signs(specimen: Specimen) -> list[str]:
    """A load cell's zero and a contraction's sign that are off."""
    parts = _with_contraction(specimen)
    remarks = []
    for name, part in (("loops", specimen.loops), ("force_map", specimen.force_map)):
        if part is None:
            continue
        contraction, force = parts[name][1:]
        levels = [part.level == index for index in np.unique(part.level)]
        below = [float(np.median(part.pressure_Pa[at])) / KPA for at in levels if force[at].max() < 0.0]
        if below:
            remarks.append(
                f"{name}: every force at {below[0]:.4g} kPa is below zero; was the load cell zeroed?"
            )
        rises = [np.cov(contraction[at], force[at])[0, 1] > 0.0 for at in levels if np.ptp(contraction[at])]
        if rises and np.mean(rises) > 0.5:
            column = "displacement_mm" if name == "loops" else "contraction"
            remarks.append(
                f"{name}: the force grows with the contraction at {sum(rises)} of {len(rises)} levels; does "
                f"{column} count the shortening from L0?"
            )
    return remarks


def _with_contraction(specimen: Specimen) -> dict[str, tuple[Floats, Floats, Floats]]:
    """Pressure (Pa), contraction and force (N) of the readings of each kind of force data."""
    assert specimen.geometry is not None
    found = {}
    if (loops := specimen.loops) is not None:
        found["loops"] = loops.pressure_Pa, loops.displacement_m / specimen.geometry.L0, loops.force_N
    if (map_ := specimen.force_map) is not None:
        found["force_map"] = map_.pressure_Pa, map_.contraction, map_.force_N
    if (blocked := specimen.blocked_force) is not None:
        found["blocked_force"] = blocked.pressure_Pa, np.zeros(len(blocked.force_N)), blocked.force_N
    return found


def _gas_force(geometry: Geometry, pressure: float, contraction: float) -> float:
    """Chou and Hannaford 1996 (doi:10.1109/70.481753), N; alpha0 from the hoop direction."""
    a, b = 3.0 * math.tan(geometry.alpha0) ** 2, 1.0 / math.cos(geometry.alpha0) ** 2
    return math.pi * geometry.R0**2 * pressure * (a * (1.0 - contraction) ** 2 - b)


def _stray_forces(name: str, specimen: Specimen, force: Floats) -> list[str]:
    """Readings so far from all others that they are codes for missing values, or knocks."""
    usual = float(np.quantile(np.abs(force), USUAL_SHARE))
    stray = int((np.abs(force) > FAR * usual).sum()) if usual > 0.0 else 0
    if not stray:
        return []
    row = int(np.abs(force).argmax())
    loops = specimen.loops if name == "loops" else None
    when = "" if loops is None else f", {loops.time_s[row]:.6g} s after the first reading"
    many = "a force is" if stray == 1 else f"{stray} forces are"
    return [f"{name}: {many} far from all others ({force[row]:.4g} N{when})"]


def _odd_contractions(specimen: Specimen) -> list[str]:
    if specimen.geometry is None:
        return []
    geometry = specimen.geometry
    parts: dict[str, Floats] = {}
    if specimen.loops is not None:
        parts["loops"] = specimen.loops.displacement_m / geometry.L0
    if specimen.force_map is not None:
        parts["force_map"] = specimen.force_map.contraction
    if specimen.free_contraction is not None:
        parts["free_contraction"] = specimen.free_contraction.contraction
    limit = _braid_limit(geometry, specimen.simulation.kinematics)
    longest = longest_contraction(geometry)
    remarks = []
    for name, contraction in parts.items():
        if name == "loops" and contraction.max() < SMALL_SHARE * limit:
            remarks.append(
                f"loops: contractions up to {contraction.max():.3g}, while the braid allows {limit:.2g}; is "
                "displacement_mm in millimetres, and L0_mm the free length?"
            )
        beyond, straight = (
            int((contraction > limit + LITTLE_FURTHER).sum()),
            int((contraction <= longest).sum()),
        )
        if beyond:
            remarks.append(
                f"{name}: {beyond} rows contract further than the braid's limit of {limit:.3f} "
                f"(largest {contraction.max():.3f}); is alpha0_deg from the hoop direction{_or_else(name)}?"
            )
        if straight:
            remarks.append(
                f"{name}: {straight} rows are longer than the straight strands (contraction {longest:.3f})"
            )
    return remarks


def _or_else(name: str) -> str:
    """What else makes contractions too large: those of loops may be lengths, or per cent of L0."""
    return ", or is displacement_mm not the shortening in mm" if name == "loops" else ""


def _braid_limit(geometry: Geometry, kinematics: str) -> float:
    """The contraction beyond which the pressure pushes instead of pulling."""
    # Of a thin wall that is sin(alpha) = 1/sqrt(3); a thick one, itself under pressure, goes further.
    thin = 1.0 - 1.0 / (math.sqrt(3.0) * math.sin(geometry.alpha0))
    if thin <= 0.0:
        return thin
    contraction = np.linspace(thin, 1.0, 1000, endpoint=False)
    rest = Rest(*np.array([geometry.L0, geometry.R0, geometry.t0, geometry.alpha0]))
    shape = SHAPES[kinematics](geometry.L0 * (1.0 - contraction), rest)
    pressure = np.ones(1)
    pushes = gas_force(pressure, shape) + thickness_force(pressure, shape) < 0.0
    return float(contraction[pushes.argmax()]) if pushes.any() else thin


def _odd_stiffness(specimen: Specimen) -> list[str]:
    """Moduli that no bladder and no strand has."""
    moduli, braid = specimen.simulation.E_Pa, specimen.braid
    declared = []
    if moduli is not None:
        declared.append(("E_Pa", max(map(abs, moduli)), STIFFNESS_PA, "Pa", "pascals"))
    if braid is not None:
        declared.append(("E_br_GPa", braid.E_br_GPa, STRAND_GPA, "GPa", "gigapascals"))
    return [
        f"{key}: a modulus of {value:.2g} {unit}; is it in {word}?"
        for key, value, (low, high), unit, word in declared
        if not low <= value <= high
    ]
