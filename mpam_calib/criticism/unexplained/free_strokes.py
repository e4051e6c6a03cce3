"""A cause's evidence beside a remainder in which every stroke may be off in a way of its own.

What runs with the time and is no cause (an amplifier that warms up, a supply that wanders) passes for a
history. Beside such a remainder a history must show what strokes have in common.
"""

from __future__ import annotations

import numpy as np

from mpam_calib.criticism.data.problem import SIZES, Problem
from mpam_calib.criticism.fitting.doubt import DOUBTS
from mpam_calib.criticism.fitting.fit import fit
from mpam_calib.criticism.fitting.forms import price
from mpam_calib.criticism.fitting.refits import Set
from mpam_calib.criticism.searching.searched import Search


def score_beside(found: Search, problem: Problem, effects: Set) -> float:
    """Log evidence and prior of a set for ``problem``, the search's own data beside another remainder.

    Of the largest size, in the forms of the set's fit beside the search's own and from where that ended;
    not a number where no climb from there ends.
    """
    known = found.fits[effects, len(SIZES) - 1]
    doubts = DOUBTS if found.doubting else ()
    try:
        again = fit(problem, known.effects, known.size, known.ended, doubts=doubts)
    except np.linalg.LinAlgError:
        return np.nan
    return again.log_evidence - sum(map(price, sorted(known.effects))) + found.log_prior(effects)
