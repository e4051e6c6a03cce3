"""What a tensile test shows that is hardly meant: stretches, the way back, a break, other units."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from mpam_calib.specimen.motion import turning_points
from mpam_calib.specimen.recording import Floats, Specimen

STIFFNESS_PA = 5e3, 2e7
"""Between the softest gels and hard rubber lie the secants of whatever a bladder is made of."""
LONG, SECANT = 0.9, 0.1
"""Strains from here on are stretches where the stress at the first is no more than this share of what the
slope there makes of it: rubber's secant and tangent are nearer to each other."""
FIRST = 10
"""Rows at the least strains that tell the slope."""
BACK, BACK_ROWS = 0.05, 5
"""Share of the range, and rows, over which the strain falls on a way back (to the next file it is one)."""
COLLAPSED = 0.5
"""Share of the largest stress below which a bladder that is stretched further has broken, or slips."""


def odd_tests(specimen: Specimen) -> list[str]:
    """Remarks on the tensile test, if there is one."""
    if specimen.tensile is None:
        return []
    strain, stress = specimen.tensile.strain, specimen.tensile.stress_Pa
    fitted = specimen.fit.tensile_strain
    highest = np.inf if fitted is None else fitted[1]
    return [
        *_units(strain, stress),
        *_stretches(strain, stress),
        *_way_back(strain),
        *_break(strain, stress, highest),
    ]


def _units(strain: Floats, stress: Floats) -> list[str]:
    stretched = strain > 0.0
    if not stretched.any():
        return []
    secant = float(np.median(np.abs(stress[stretched] / strain[stretched])))
    low, high = STIFFNESS_PA
    if low <= secant <= high:
        return []
    return [f"tensile: a stiffness of about {secant:.2g} Pa; is it in pascals?"]


def _stretches(strain: Floats, stress: Floats) -> list[str]:
    least = np.argsort(strain, kind="stable")[:FIRST]
    if strain[least[0]] < LONG or np.ptp(strain[least]) == 0.0:
        return []
    slope, _ = np.polyfit(strain[least], stress[least], 1)
    if stress[least[0]] > SECANT * slope * strain[least[0]]:
        return []
    return [
        f"tensile: strains from {strain.min():.3g}, where the stress is next to nothing; are they stretches? "
        'strain = { name = "...", offset = -1.0 } in [columns.tensile] would do'
    ]


def _way_back(strain: Floats) -> list[str]:
    turns = turning_points(strain, BACK * float(np.ptp(strain)))
    falls = [
        (int(first), int(last))
        for first, last in pairwise(turns)
        if strain[last] < strain[first] and last - first >= BACK_ROWS
    ]
    if not falls:
        return []
    first, last = falls[0]
    rows = last - first
    many = "" if len(falls) == 1 else f", and {len(falls) - 1} times more"
    return [
        f"tensile: the strain falls from {strain[first]:.3g} to {strain[last]:.3g} over {rows} rows{many}; "
        "is the way back meant to count?"
    ]


def _break(strain: Floats, stress: Floats, highest: float) -> list[str]:
    """A stress that collapses while the strain goes on, within what is fitted."""
    top = int(np.argmax(stress))
    further = np.flatnonzero(np.diff(strain[top:]) < 0.0)
    end = top + 1 + (int(further[0]) if len(further) else len(strain) - top - 1)
    broken = top + np.flatnonzero((stress[top:end] < COLLAPSED * stress[top]) & (strain[top:end] <= highest))
    if not len(broken):
        return []
    rows = f"{len(broken)} row{'s' if len(broken) > 1 else ''}"
    return [
        f"tensile: the stress falls from {stress[top]:.3g} Pa to {stress[broken[-1]]:.3g} Pa beyond a strain "
        f"of {strain[top]:.3g} ({rows}); did the test piece break or slip? [fit] tensile_strain would leave "
        "that out"
    ]
