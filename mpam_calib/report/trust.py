"""Whether to trust a calibration's numbers, and what limits them: a handful of plain checks.

Each check looks at one thing and returns a :class:`Limit` or None. The verdict is the worst limit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from mpam_calib.posterior.chains.convergence import RHAT_LIMIT
from mpam_calib.report.blocks import Level, Verdict
from mpam_calib.report.doubts import look_first, overruled_slack, wandering
from mpam_calib.report.free_read import early_roots, free_read
from mpam_calib.report.gauge import gauge
from mpam_calib.report.headline import FIRST_MODULUS, headline_bands
from mpam_calib.report.held import (
    Held,
    along_stroke,
    between_levels,
    beyond_levels,
    full_length,
    held_along,
    held_between,
    held_near,
)
from mpam_calib.report.limit import Limit
from mpam_calib.report.noise_size import NOISE_CAUTION, lasting_noise, noise_as_declared, noise_size
from mpam_calib.report.numbers import significant
from mpam_calib.report.one_branch import one_branch
from mpam_calib.report.past import past
from mpam_calib.report.reach import UNSEEN, between_ends, cut_off, extrapolation
from mpam_calib.report.view import CalibrationView

REMAINDER_CAUTION: Final = 0.02
"""A remainder above the noise and above this share of the top force is worth a caution ..."""
REMAINDER_BAD: Final = 0.10
"""... and above this share the simulation is not a description of the muscle."""
WIDE_CAUTION: Final = 0.10
WIDE_BAD: Final = 0.30
"""Half of the 90 % band over the value."""
UNIDENTIFIED: Final = 0.20
"""A posterior that is narrower than its prior by less than this share learnt nothing."""
LITTLE: Final = 0.50
"""One that is narrower by less than this share learnt a little, and the prior still matters."""
NAMED, NAMED_BRIEFLY = 5, 2
"""Parameters that a sentence names, and the verdict."""
_RANK: dict[Level, int] = {"good": 0, "caution": 1, "bad": 2}


def convergence(view: CalibrationView) -> Limit | None:
    """The calculation has not settled, or ended in several separate explanations."""
    c = view.convergence
    failed = []
    if not c.rhat_max <= RHAT_LIMIT:
        failed.append(
            f"independent starts disagree on {c.rhat_parameter} (R-hat {c.rhat_max:.3f}, limit {RHAT_LIMIT})"
        )
    if not c.ess_min >= c.ess_wanted:
        failed.append(
            f"the draws are worth only {c.ess_min:.0f} independent ones ({c.ess_wanted:.0f} wanted)"
        )
    if failed or not c.converged:
        why = "; ".join(failed) or "it was stopped by its step budget"
        sentence = (
            f"The calculation has not settled: {why}. Run it longer (--max-steps) before using any number "
            "here."
        )
        return Limit("bad", sentence, "the calculation has not settled")
    if c.modes > 1:
        sentence = f"The data allow {c.modes} separate explanations; the bands mix them."
        return Limit("caution", sentence, f"there are {c.modes} separate explanations")
    return None


def borrowed(view: CalibrationView) -> Limit | None:
    """The moduli come from a run that has not settled itself."""
    if not view.unsettled_moduli:
        return None
    words = "the run that the moduli come from did not converge"
    sentence = (
        f"T{words[1:]}: they and their bands may be wrong. Run it longer (--max-steps), then this again."
    )
    return Limit("bad", sentence, words)


def remainder(view: CalibrationView) -> Limit | None:
    """The simulation misses the data by more than a reading's noise."""
    top = _top_value(view)
    if not (math.isfinite(view.remainder) and math.isfinite(view.noise)) or top <= 0:
        return None
    share = view.remainder / top
    if view.remainder <= view.noise or share <= REMAINDER_CAUTION / 4:
        return None
    unit = "Pa" if view.tensile else "N"
    size = f"{significant(view.remainder, 2)} {unit}"
    largest = "stress" if view.tensile else "blocked force"
    sentence = (
        f"The simulation is wrong by about {size} (root mean square, {100 * share:.1f} % of the largest "
        f"{largest}; noise of a reading: {significant(view.noise, 2)} {unit}). "
        f"The bands include this.{_advice(view)}"
    )
    level: Level = "good" if share <= REMAINDER_CAUTION else "caution" if share <= REMAINDER_BAD else "bad"
    return Limit(level, sentence, f"the simulation is wrong by about {size}")


def _advice(view: CalibrationView) -> str:
    """Where to look for what the simulation misses; diagnose takes loops and force maps only."""
    if view.tensile:
        return " Try another order, or the strains that the bladder sees ([fit] tensile_strain)."
    if view.readings("loops", "force_map").empty:
        return ""
    return " The command diagnose looks for the cause."


def band_width(view: CalibrationView) -> Limit | None:
    """The band of a headline number is wide."""
    found = []
    for name, mean, low, high in headline_bands(view):
        half = (high - low) / 2.0
        relative = half / abs(mean) if mean else math.inf if half else 0.0
        # Moduli that the readings do not tell apart may still give a stress that is well known.
        bad = relative > WIDE_BAD and name != FIRST_MODULUS
        if relative > WIDE_CAUTION:
            found.append((bad, relative, f"the {name} is known to ± {100 * relative:.0f} % only"))
    if not found:
        return None
    bad, worst, words = max(found)
    if math.isinf(worst):
        words = "a headline number is zero within its band"
    return Limit(
        "bad" if bad else "caution", f"{words[0].upper()}{words[1:]} (half of its 90 % band).", words
    )


def identification(view: CalibrationView) -> Limit | None:
    """Parameters on which the data say nothing beyond their priors."""
    names = unidentified_names(view)
    if not names:
        return None
    them = "it" if len(names) == 1 else "them"
    sentence = (
        f"Do not quote {_in_words(view, names, NAMED)} alone: the data say nothing about {them}, and what "
        "you see is what was assumed before the test."
    )
    return Limit("good", sentence, f"the data say nothing about {_in_words(view, names, NAMED_BRIEFLY)}")


def _in_words(view: CalibrationView, names: list[str], most: int) -> str:
    """Some parameters by what they are, their ids in brackets."""
    said = []
    for name in names[:most]:
        meaning = view.meanings.get(name, "")
        article = "" if meaning.split(" ")[0] in ("the", "how", "what") else "the "
        said.append(f"{article}{meaning} ({name})" if meaning else name)
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return f"{', '.join(said)}{more}"


def source(view: CalibrationView) -> Limit | None:
    """The data are not measurements."""
    if "reconstructed" not in view.provenance.lower():
        return None
    sentence = (
        "The data are reconstructed from printed tables: this describes those tables, not a muscle on a rig."
    )
    return Limit("caution", sentence, "the data are reconstructed, not measured")


def _always(view: CalibrationView) -> bool:
    return True


def _all_narrowed(view: CalibrationView) -> bool:
    """Whether no row of the page's table says that the prior still matters, of one explanation.

    Bands that mix several explanations narrow none of their parameters.
    """
    frame = view.unidentified
    one = view.convergence.modes <= 1
    return one and not frame.empty and bool((frame["contraction"] >= LITTLE).all())


def _noise_ordinary(view: CalibrationView) -> bool:
    return _plain_noise(view) and lasting_noise(view) is None


def _plain_noise(view: CalibrationView) -> bool:
    """Whether no noise, of the load cell or of a free contraction, holds what the simulation misses."""
    return noise_size(view) is None and free_read(view) is None


def _enough(held: Held | None) -> bool:
    return held is not None and held.enough


@dataclass(frozen=True)
class Check:
    """A check, what holds when it finds nothing ("": not worth saying), and whether it could be made."""

    find: Callable[[CalibrationView], Limit | None]
    holds: str = ""
    possible: Callable[[CalibrationView], bool] = _always


# To lie within noise that holds what the simulation misses is no good news.
CHECKS: tuple[Check, ...] = (
    Check(convergence, "the calculation has settled"),
    Check(borrowed),
    Check(
        along_stroke,
        "the readings lie in their bands",
        lambda view: _enough(held_along(view)) and _plain_noise(view),
    ),
    Check(
        between_levels,
        "the inner levels lie in the bands that the others give",
        lambda view: _enough(held_between(view)) and noise_size(view) is None,
    ),
    Check(beyond_levels),
    Check(wandering),
    Check(noise_size),
    Check(
        lasting_noise,
        f"the noise of a reading is at most {NOISE_CAUTION:g} times the declared one",
        lambda view: noise_as_declared(view) and noise_size(view) is None,
    ),
    Check(
        remainder,
        "the simulation fits to within the noise or half a per cent",
        lambda view: math.isfinite(view.remainder) and math.isfinite(view.noise) and _noise_ordinary(view),
    ),
    Check(free_read),
    Check(early_roots),
    Check(past),
    Check(overruled_slack),
    Check(
        full_length,
        "the readings near full length lie in their bands",
        lambda view: _enough(held_near(view)) and noise_size(view) is None,
    ),
    # A band without an upper end, which the check leaves out, is not within anything.
    Check(
        band_width,
        f"the bands are within ± {100 * WIDE_CAUTION:.0f} %",
        lambda view: view.tensile or cut_off(view) is None,
    ),
    Check(
        extrapolation,
        f"no headline number is extrapolated by more than {100 * UNSEEN:.0f} %",
        lambda view: not view.tensile and cut_off(view) is None,
    ),
    Check(cut_off),
    Check(one_branch),
    Check(between_ends),
    Check(source),
    Check(gauge),
    # What was tested, and no more: a narrow band may leave a sign open, which the table says.
    Check(
        identification,
        f"the data narrow every parameter to at most {100 * (1.0 - LITTLE):.0f} % of the band assumed before",
        _all_narrowed,
    ),
)


def assess(view: CalibrationView) -> Verdict:
    """The verdict on the headline numbers: sentence, level, and reasons with the worst first.

    A check that the data do not allow is neither a limit nor good news: it is left out.
    """
    limits: list[Limit] = []
    in_order: list[str] = []
    for check in CHECKS:
        limit = check.find(view)
        if limit is not None:
            limits.append(limit)
        elif check.holds and check.possible(view):
            in_order.append(check.holds)
    limits.sort(key=lambda limit: -_RANK[limit.level])
    level: Level = limits[0].level if limits else "good"
    reasons = [limit.sentence for limit in limits]
    if asked := look_first(view, level):
        reasons.insert(1, asked)
    stopped = convergence(view)
    unsettled = stopped is not None and stopped.level == "bad"
    if in_order and not unsettled:  # by draws that do not stand for the posterior nothing is in order
        reasons.append(f"What is fine: {'; '.join(in_order)}.")
    return Verdict(_sentence(level, limits), level, reasons)


def _sentence(level: Level, limits: list[Limit]) -> str:
    if level == "bad":
        return f"No, do not rely on these numbers: {limits[0].brief}."
    if level == "caution":
        others = " and ".join(x.brief for x in limits if x.level == "caution")
        return f"Use these numbers with care: {others}."
    if limits:
        return f"Yes, you can use these numbers with their bands; but {limits[0].brief}."
    return "Yes: you can use these numbers with their bands."


def unidentified_names(view: CalibrationView) -> list[str]:
    """Parameters whose posterior is hardly narrower than their prior, least identified first."""
    frame = view.unidentified
    if frame.empty:
        return []
    rows = frame[frame["contraction"] < UNIDENTIFIED].sort_values("contraction", kind="stable")
    return [str(name) for name in rows["parameter"]]


def _top_value(view: CalibrationView) -> float:
    bands = headline_bands(view)
    return abs(bands[0][1]) if bands else 0.0
