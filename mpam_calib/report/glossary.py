"""What a parameter of ``summary.csv`` means, in a few words for a rig engineer."""

from __future__ import annotations

import re

_WORDS: dict[str, str] = {
    "K_f": "Coulomb friction, as a share of the force",
    "f_s": "friction between the strands",
    "P_DB_kPa": "pressure that does no work yet (dead-band)",
    "tip_factor": "how far the rounded tips shorten the muscle (theory: 1)",
    "delta_alpha_deg": "true braid angle minus the declared one",
    "braid_factor": "energy stored in the strands (theory: 1)",
    "wall_factor": "share of the wall's pressure term that is missing",
    "offset_mm": "true shortening minus the reading",
    "rate_per_decade": "change of friction for ten times the speed",
    "reversal_mm": "travel in which friction turns over after a reversal",
    "first_cycle_fraction": "how much stiffer the first cycle is",
    "creep_per_decade": "relaxation of the force for ten times the time",
    "drift_N_per_min": "wandering of the load cell's zero",
    "droop_percent": "loss of pressure inside the muscle at full stroke",
    "compliance_mm_per_N": "give of the fixture",
    "noise_sd_N": "sensor noise, one sigma",
    "noise_sd_Pa": "noise of the stress readings, one sigma",
    "pressure_bias_kPa": "constant offset of the pressure gauge",
    "L0_mm": "length at rest",
    "R0_mm": "outer radius at rest",
    "t0_mm": "wall thickness at rest",
    "alpha0_deg": "braid angle at rest",
    "d": "faster rate of the exponential law",
    "z": "slower rate of the exponential law",
}
_PATTERNS: list[tuple[str, str]] = [
    (r"a_(\d+)", "modulus E_{0}: change per unit of pressure"),
    (r"b_(\d+)", "modulus E_{0} at zero pressure"),
    (r"c_(\d+)", "modulus E_{0}: weight of the faster exponential"),
    (r"w_(\d+)", "modulus E_{0}: weight of the slower exponential"),
    (r"d_(\d+)", "modulus E_{0}: faster rate"),
    (r"z_(\d+)", "modulus E_{0}: slower rate"),
    (r"E_(\d+)", "modulus of strain to the power {0}"),
    (r"remainder.*", "what the simulation leaves out, one sigma"),
]


def meaning(parameter: str) -> str:
    """A few words for the parameter ("" for one that is not known); ``@50`` reads "at 50 kPa".

    >>> meaning("E_2@50")
    'modulus of strain to the power 2, at 50 kPa'
    """
    name, _, level = parameter.partition("@")
    words = _WORDS.get(name, "")
    if not words:
        for pattern, text in _PATTERNS:
            match = re.fullmatch(pattern, name)
            if match:
                words = text.format(*match.groups())
                break
    return f"{words}, at {level} kPa" if words and level else words
