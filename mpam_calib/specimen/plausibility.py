"""Values that can be read but cannot be meant: other units, flipped signs, a crosshead that rests."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from mpam_calib.errors import InputError
from mpam_calib.specimen.declaration import FileKind, Geometry
from mpam_calib.specimen.motion import RANGE_SHARE, turn_threshold, turning_points
from mpam_calib.specimen.recording import Bools, Floats, Ints
from mpam_calib.units import ATMOSPHERE, KPA, MM

HIGHEST_LEVEL_KPA = 5000.0
HIGHEST_STRAIN = 20.0
LEAST_STROKE = 0.005
"""Smaller largest displacements, as a share of L0, are taken for metres, or lengthening for shortening."""
LEAST_ROWS = 4
"""Rows that a stroke needs, for the way it goes to be told from noise."""
LONG_SHARE = 0.1
"""Share of the rows that are taken as those where the muscle is long."""
MOST = {
    "force_N": 1e6, "pressure_kPa": 1e9, "displacement_mm": 1e5, "contraction": 1e2, "stress_Pa": 1e10,
    "setpoint_kPa": 1e9, "cycle": 1e9, "time_s": 1e15, "temperature_C": 1e3,
}  # fmt: skip
"""Sizes of readings, in the files' units, that no rig for such muscles reads."""
CODE_TIMES = 10.0
"""Times what nearly all of a column's values stay below, from which nines alone are a code (if above all)."""
USUAL = 0.99
"""Share of a column's values that stay below what is usual."""
AGAINST = 0.8
"""Share of all motion against its branch's direction from which the words are taken for swapped."""


def map_hint(kind: FileKind, column: str, scale: str) -> str:
    """How to map a column whose unit or sign differs."""
    return f'else map it: [columns.{kind}] {column} = {{ name = "...", scale = {scale} }}'


def check_pressure(label: str, kind: FileKind, pressure_Pa: Floats, rows: Ints) -> None:
    """Refuse a level above 5,000 kPa or below a vacuum; ``rows`` are the editor's numbers of the readings."""
    low = np.flatnonzero(pressure_Pa < -ATMOSPHERE)
    if len(low):
        found = f"a pressure level of {pressure_Pa[low[0]] / KPA:g} kPa"
        expected = f"above the atmosphere's, or down to -{ATMOSPHERE / KPA:g} kPa (a vacuum)"
        raise InputError(label, found, expected, int(rows[low[0]]), "pressure_kPa")
    high = np.flatnonzero(pressure_Pa > HIGHEST_LEVEL_KPA * KPA)
    if len(high):
        found = f"a pressure level of {pressure_Pa[high[0]] / KPA:g} kPa (pascals?)"
        expected = f"at most {HIGHEST_LEVEL_KPA:g}; {map_hint(kind, 'pressure_kPa', '0.001')}"
        raise InputError(label, found, expected, int(rows[high[0]]), "pressure_kPa")


def check_force(label: str, kind: FileKind, force_N: Floats, shortening: Floats | None = None) -> None:
    """Refuse forces of which most are negative.

    Except with a ``shortening`` (any unit): a muscle that pulls where it is long may well be driven so far
    that it pushes in most rows.
    """
    median = float(np.median(force_N))
    long = force_N if shortening is None else force_N[shortening <= np.quantile(shortening, LONG_SHARE)]
    if median < 0.0 and np.median(long) < 0.0:
        found = f"a median force of {median:.3g} N (flipped sign?)"
        expected = f"pulling forces above 0; {map_hint(kind, 'force_N', '-1.0')}"
        raise InputError(label, found, expected, None, "force_N")


def check_changes(label: str, values: Floats, column: str) -> None:
    """Refuse a force (N) or a stress (Pa), whatever was done to the test piece, that never changes."""
    if np.ptp(values) == 0.0 and len(values) > 1:
        found = f"a {column.partition('_')[0]} that never changes ({values[0]:g} throughout)"
        raise InputError(label, found, "the load cell's readings", None, column)


def check_branch(label: str, branch: Ints, displacement_m: Floats, rows: Ints) -> None:
    """Refuse branches whose words are swapped: loading pulls back, so that the displacement falls."""
    starts = np.flatnonzero(np.diff(branch, prepend=branch[0] - 1))
    ends = np.append(starts[1:], len(branch)) - 1
    sign = np.where(np.abs(branch[starts]) == 1, branch[starts], 0)
    way = sign * (displacement_m[ends] - displacement_m[starts])
    if way[way > 0.0].sum() > AGAINST * np.abs(way).sum():
        first = int(starts[np.argmax(way)])
        word = "loading" if branch[first] == 1 else "unloading"
        found = f"{word} where displacement_mm {'rises' if branch[first] == 1 else 'falls'} (swapped?)"
        expected = "loading where the muscle is pulled back to its length, unloading where it contracts"
        raise InputError(label, found, expected, int(rows[first]), "branch")


def check_codes(label: str, frame: pd.DataFrame) -> None:
    """Refuse values that no rig reads: what an instrument writes for none (overload 9.9e37, -99999)."""
    for name, most in MOST.items():
        if name in frame:
            values = frame[name].to_numpy()
            far, limit = np.flatnonzero(np.abs(values) > most), most
            if not len(far):
                far, limit = lone_nines(values)
            if len(far):
                found = f"{values[far[0]]:g} (a code for no reading?)"
                raise InputError(label, found, f"at most {limit:g}", int(frame.index[far[0]]), name)


def lone_nines(values: Floats) -> tuple[Ints, float]:
    """Places (n,) of nines alone, such as -9999, that are far from all the rest, and where far begins."""
    coded = nines(values)
    if not coded.any() or coded.all():
        return np.zeros(0, dtype=np.int64), np.inf
    rest = np.abs(values[~coded])
    limit = max(CODE_TIMES * float(np.quantile(rest, USUAL)), float(rest.max()))
    return np.flatnonzero(coded & (np.abs(values) > limit)), limit


def nines(values: Floats) -> Bools:
    """Whether values (n,) are written as three nines or more and nothing else, whatever the unit."""
    size = np.abs(values)
    size = np.where(size > 1e-300, size, 1.0)
    rest = 10.0 - size / 10.0 ** np.floor(np.log10(size))
    places = np.log10(np.maximum(rest, 1e-15))
    whole = np.round(places)
    return np.asarray((whole <= -2.0) & (np.abs(places - whole) < 1e-4))


def check_strain(label: str, strain: Floats, rows: Ints) -> None:
    """Refuse strains that no rubber survives, one strain throughout, and compression."""
    median = float(np.median(strain))
    if median < 0.0:
        expected = f"extension above 0; {map_hint('tensile', 'strain', '-1.0')}"
        raise InputError(label, f"a median strain of {median:.3g} (flipped sign?)", expected, None, "strain")
    if strain.max() <= max(float(strain.min()), 0.0):
        raise InputError(
            label, f"a strain of {strain.max():g} throughout", "a range of strains", None, "strain"
        )
    high = np.flatnonzero(strain > HIGHEST_STRAIN)
    if len(high):
        found = f"{strain[high[0]]:g} (per cent?)"
        expected = (
            f"an engineering strain of at most {HIGHEST_STRAIN:g}; {map_hint('tensile', 'strain', '0.01')}"
        )
        raise InputError(label, found, expected, int(rows[high[0]]), "strain")


def check_displacement(
    label: str, displacement_m: Floats, rows: Ints, geometry: Geometry, strokes: Bools
) -> None:
    """Refuse a displacement that never moves in its ``strokes`` (n,), if any, has few rows there or another
    unit, or is impossible anywhere."""
    column = "displacement_mm"
    millimetres = displacement_m[strokes] / MM
    if strokes.any():
        way = displacement_m[strokes]
        if len(turning_points(way, turn_threshold(way))) < 2:
            raise _unmoved(label, millimetres, LEAST_STROKE * geometry.L0_mm)
        largest = float(millimetres.max())
        if largest < LEAST_STROKE * geometry.L0_mm:
            flipped = millimetres.min() <= -LEAST_STROKE * geometry.L0_mm
            guess, scale = ("flipped sign", "-1.0") if flipped else ("metres", "1000.0")
            if not flipped and largest / MM >= geometry.L0_mm:
                guess, scale = "a share of L0", f"{geometry.L0_mm:.1f}"
            found = f"a largest displacement of {largest:.3g} mm ({guess}?)"
            hint = map_hint("loops", column, scale)
            expected = f"at least {LEAST_STROKE:g} of L0 = {geometry.L0_mm:g} mm; {hint}"
            raise InputError(label, found, expected, None, column)
    check_contraction(label, displacement_m / geometry.L0, rows, geometry, "loops", column)


def _unmoved(label: str, millimetres: Floats, least: float) -> InputError:
    """Why no stroke is seen: too few rows for each, where it moves by ``least`` (mm), or none is there."""
    low, high = float(millimetres.min()), float(millimetres.max())
    strokes = len(turning_points(millimetres, RANGE_SHARE * (high - low))) - 1
    if high - low >= least and len(millimetres) < LEAST_ROWS * strokes:
        found = f"{len(millimetres)} rows for {strokes} strokes, too few to see which way each goes"
        expected = f"at least {LEAST_ROWS} rows a stroke"
    else:
        span = f"{low:g} throughout" if low == high else f"{low:g} to {high:g}, no more than it scatters"
        found = f"a displacement that never moves ({span})"
        expected = "loops over length"
    expected += ", or branch pressurising/depressurising at held length"
    return InputError(label, found, expected, None, "displacement_mm")


def longest_contraction(geometry: Geometry) -> float:
    """The (negative) contraction at which the strands are straight: no braid is longer."""
    return 1.0 - 1.0 / math.sin(geometry.alpha0)


def check_contraction(
    label: str, contraction: Floats, rows: Ints, geometry: Geometry, kind: FileKind, column: str
) -> None:
    """Refuse a muscle shorter than nothing, or one that is mostly (or once far) longer than its straight
    strands."""
    unit, factor = (" mm", geometry.L0_mm) if column == "displacement_mm" else ("", 1.0)
    short = np.flatnonzero(contraction >= 1.0)
    if len(short):
        found = f"{contraction[short[0]] * factor:.4g}{unit}"
        expected = f"a shortening below L0 = {geometry.L0_mm:g} mm (not a length)"
        raise InputError(label, found, expected, int(rows[short[0]]), column)
    long = np.flatnonzero(contraction <= longest_contraction(geometry) - 1.0)
    median = float(np.median(contraction))
    if len(long) and median > longest_contraction(geometry):
        found = f"{contraction[long[0]] * factor:.4g}{unit}, longer than the strands by more than L0"
        expected = f"a shortening from L0 = {geometry.L0_mm:g} mm"
        raise InputError(label, found, expected, int(rows[long[0]]), column)
    if median <= longest_contraction(geometry):
        found = f"a median of {median * factor:.4g}{unit}, longer than the strands (flipped sign?)"
        expected = f"contraction above 0; {map_hint(kind, column, '-1.0')}"
        raise InputError(label, found, expected, None, column)
