"""Diagnosing one specimen: search, verdict, budget and gain, as plain values."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from mpam_calib.criticism.budget import Budget, misfit_budget
from mpam_calib.criticism.data.build import build_problem
from mpam_calib.criticism.data.problem import SIZES, Problem
from mpam_calib.criticism.fitting.fit import extended
from mpam_calib.criticism.fitting.noise_scale import settle_guess
from mpam_calib.criticism.gain import Gain, measure_gain
from mpam_calib.criticism.limits import Band, hidden_sizes
from mpam_calib.criticism.searching.candidates import Candidates, candidates
from mpam_calib.criticism.searching.search import open_search
from mpam_calib.criticism.searching.searched import LARGEST, Search
from mpam_calib.criticism.searching.usual_braid import SHAPE_ALONE, need_strands, with_strands
from mpam_calib.criticism.sizes import Sizes, Told, sizes_of
from mpam_calib.criticism.tasks.journal import Journal, journalled
from mpam_calib.criticism.unexplained.instrument import Rival
from mpam_calib.criticism.unexplained.structure import Structure, structure_tests
from mpam_calib.criticism.verdict import Verdict, judge
from mpam_calib.errors import InputError
from mpam_calib.model.blueprint import MaterialPosterior, Options, draw_blueprint
from mpam_calib.model.effect import effect
from mpam_calib.model.state import Setting
from mpam_calib.specimen.declaration import Braid
from mpam_calib.specimen.recording import Specimen
from mpam_calib.units import si_factor

WORKERS = 2
Tell = Callable[[str, float], None]


@dataclass(frozen=True)
class Diagnosis:
    """All that ``diagnosis.json`` and the report are written from."""

    problem: Problem
    candidates: Candidates
    search: Search
    verdict: Verdict
    budget: Budget
    gain: Gain | None
    structure: list[tuple[Structure, Structure]]
    """Every test of structure before and after."""
    limits: dict[str, Band]
    """How large each further effect could be unseen (SI), where nothing is left that would pass for it."""
    sizes: Sizes
    """Those of the causes."""
    assumed_braid: Braid | None
    """The usual strands that were taken for those of a missing [braid]."""

    @property
    def causes(self) -> list[str]:
        """The causes that are reported, the most probable first."""
        return sorted(self.verdict.standing, key=lambda e: (-self.verdict.marginals[e], e))

    @property
    def leant_on(self) -> Braid | None:
        """The assumed strands, where the size of a cause is stated for them."""
        return self.assumed_braid if need_strands(tuple(self.causes)) else None

    @property
    def not_tested(self) -> list[tuple[str, str]]:
        """(id, why) of the effects that these data cannot speak of, or not by their size."""
        by_shape = need_strands(self.candidates.tested) if self.assumed_braid is not None else ()
        absent = [(e, SHAPE_ALONE) for e in by_shape if e not in self.causes]
        return sorted([*self.candidates.not_tested, *absent])

    @property
    def declared_forms(self) -> tuple[str, ...]:
        """The causes as a simulation declares them (with their forms)."""
        return tuple(sorted(self.sizes.fits[0].effects))


def diagnose(
    specimen: Specimen,
    *,
    material: MaterialPosterior | None = None,
    tell: Tell | None = None,
    journal: Journal | None = None,
) -> Diagnosis:
    """Find what the declared simulation gets wrong in a specimen's recordings.

    What is in the ``journal`` of an interrupted diagnosis of the same specimen is not done again. Raises
    ``InputError`` where the specimen has no muscle data.
    """
    if not (specimen.loops is not None or specimen.force_map is not None):
        raise InputError(specimen.folder / "specimen.toml", "no loops and no force map", "one to diagnose")
    listener = tell or (lambda stage, share: None)
    blueprint = with_strands(draw_blueprint(specimen, Options(nuisances=False, remainder=False), material))
    assumed = blueprint.braid if specimen.braid is None else None
    problem = build_problem(specimen, blueprint)
    tested = candidates(problem)
    if problem.noise_guessed:
        sets = [frozenset[str](), *(frozenset({e}) for e in tested.tested)]
        problem = settle_guess(problem, [extended(problem.blueprint, s) for s in sets])
    with open_search(
        problem, tested.tested, partial(listener, "searching"), workers=WORKERS, journal=journal
    ) as found:
        problem = found.problem  # its noise settled by the best set
        verdict = judge(found)
        found.refit_all((verdict.standing, size) for size in range(len(SIZES)))
        # Its likeliest form first: budget, gain and extended model are all made from it.
        found.refit_in_forms([verdict.standing])
        budget = misfit_budget(found, verdict.standing)
    gain = None
    if verdict.standing:
        named = found.best_fit(verdict.standing)
        gain = measure_gain(
            problem, tested.tested, named, WORKERS, partial(listener, "measuring the gain"), journal
        )
    fits = [found.best_fit(s) for s in (frozenset(), verdict.standing)]
    structure = list(zip(*(structure_tests(problem, f) for f in fits), strict=True))
    limits = {}
    if verdict.word in ("adequate", "named"):
        with journalled(problem, WORKERS, journal) as spread:
            without_size = need_strands(tested.tested) if assumed is not None else ()
            told = tuple(e for e in tested.tested if e not in without_size)
            limits = hidden_sizes(problem, told, fits[1], spread)
    sizes = sizes_of(found, verdict.standing)
    return Diagnosis(problem, tested, found, verdict, budget, gain, structure, limits, sizes, assumed)


def describe(diagnosis: Diagnosis, seed: int) -> dict[str, Any]:
    """The content of ``diagnosis.json``."""
    verdict, budget, gain = diagnosis.verdict, diagnosis.budget, diagnosis.gain
    return {
        "verdict": verdict.word,
        "probability": _round(verdict.probabilities.get(verdict.standing, 0.0)),
        "causes": [_cause(diagnosis, e, seed) for e in diagnosis.causes],
        "alternatives": [{"ids": sorted(s), "probability": _round(p)} for s, p in verdict.others().items()],
        "not_tested": [{"id": i, "why": why} for i, why in diagnosis.not_tested],
        "assumed_braid": None if diagnosis.leant_on is None else diagnosis.leant_on.model_dump(),
        "limits": [_limit(diagnosis, e) for e in sorted(diagnosis.limits)],
        "noise_N": _round(budget.noise),
        "noise_assumed": diagnosis.problem.noise_guessed,
        "misfit_before_N": _round(budget.before),
        "misfit_after_N": _round(budget.after),
        "remainder_N": _round(budget.remainder),
        "gain": None if gain is None else _gain(gain),
        "structure": [
            {
                "against": before.against,
                "p_before": _round(before.p_value),
                "p_after": _round(after.p_value),
                "rms_before_N": _round(before.size),
                "rms_after_N": _round(after.size),
            }
            for before, after in diagnosis.structure
        ],
        "saturated_share": _round(verdict.faults.saturated),
        "repeating_N": _round(verdict.faults.repeating),
        "bursts_N": _round(verdict.faults.bursts),
        "hum_N": _round(verdict.faults.hum),
        "step_N": _round(verdict.faults.step),
        "chatter_N": _round(verdict.faults.chatter),
        "trace": None
        if verdict.trace is None
        else {"against": verdict.trace.against, "rms_N": _round(verdict.trace.size)},
        "instrument": told_of(verdict.instrument, diagnosis.sizes.setting, seed),
        "searched": {
            "sets": len(diagnosis.search.seen | {effects for effects, _ in diagnosis.search.searched}),
            "largest": LARGEST,
        },
    }


def _gain(gain: Gain) -> dict[str, Any]:
    """What the extended model gains on held-out rows."""
    return {
        "held_out": gain.held_out,
        "rmse_before_N": _round(gain.rmse_before),
        "rmse_after_N": _round(gain.rmse_after),
        "rmse_named_N": _round(gain.rmse_named),
        "elpd_gain": _round(gain.elpd_gain),
        "elpd_gain_se": _round(gain.elpd_gain_se),
        "elpd_gain_named": _round(gain.elpd_gain_named),
        "elpd_gain_named_se": _round(gain.elpd_gain_named_se),
        "coverage90_before": _round(gain.coverage90_before),
        "coverage90_after": _round(gain.coverage90_after),
        "coverage90_named": _round(gain.coverage90_named),
        "folds_same_set": gain.folds_same_set,
        "folds": gain.folds,
    }


def _cause(diagnosis: Diagnosis, identifier: str, seed: int) -> dict[str, Any]:
    """One cause: its probability, parameters (lab units), share and whether it was to be expected."""
    verdict, sizes = diagnosis.verdict, diagnosis.sizes
    written = next(e for e in sizes.fits[0].effects if e.partition(":")[0] == identifier)
    told = sizes.told(written, seed)
    return {
        "id": identifier,
        "form": written.partition(":")[2],
        "forms": [{"form": f, "probability": _round(p)} for f, p in sizes.forms(identifier).items()],
        "probability": _round(verdict.marginals[identifier]),
        "parameters": _in_lab_units(told),
        "share_of_misfit": _round(diagnosis.budget.shares[identifier]),
        "within_declared_uncertainty": within_declared(identifier, told, sizes.setting),
    }


def within_declared(identifier: str, told: dict[str, Told], setting: Setting) -> bool:
    """Whether a cause's size is within two of the sds that the specimen declares for it."""
    declared = {"braid_angle": setting.geometry.sd.alpha0, "dead_band": setting.pressure_bias_sd}
    size = next(iter(told.values()), None)  # the others shape it; some causes have none
    return size is not None and abs(size.mean) <= 2.0 * declared.get(identifier, 0.0)


def _in_lab_units(told: dict[str, Told]) -> dict[str, dict[str, float]]:
    """Parameters as they are written."""
    return {
        name: {key: _round(x / si_factor(name)) for key, x in of._asdict().items()}
        for name, of in told.items()
    }


def told_of(rival: Rival | None, setting: Setting, seed: int) -> dict[str, Any] | None:
    """An instrument at fault, as it is written: its parameters in lab units, and its lead in nats."""
    if rival is None or rival.fitted is None:
        return None
    told = Sizes((rival.fitted,), setting).told(rival.fault, seed)
    return {"fault": rival.fault, "nats": _round(rival.lead), "parameters": _in_lab_units(told)}


def _limit(diagnosis: Diagnosis, identifier: str) -> dict[str, Any]:
    """How large an effect could be by itself without being seen, lab units."""
    (parameter,) = effect(identifier).parameters(diagnosis.problem.setting)
    low, high = (_round(x / si_factor(parameter.name)) for x in diagnosis.limits[identifier])
    return {"id": identifier, "parameters": {parameter.name: {"q05": low, "q95": high}}}


def _round(x: float) -> float:
    """Six significant digits: all that is meant, and the same on every machine."""
    return float(f"{x:.6g}")


def extended_effects(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Effects of the extended simulation: the declared ones and the causes."""
    return (*diagnosis.problem.blueprint.simulation.effects, *diagnosis.declared_forms)
