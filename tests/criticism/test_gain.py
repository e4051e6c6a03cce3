"""Predictions of levels left out: bands that hold what no remainder of the search is large enough for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mpam_calib.criticism import gain as gain_module
from mpam_calib.criticism.data.problem import SIZES, Problem
from mpam_calib.criticism.fitting.fit import Fit, fit
from mpam_calib.criticism.fitting.folds import FEWEST
from mpam_calib.criticism.fitting.predicted import predict_rows
from mpam_calib.criticism.gain import Z90, _Fold, _over_forms, measure_gain
from mpam_calib.criticism.searching.searched import Search
from mpam_calib.criticism.sizes import Sizes
from mpam_calib.criticism.tasks.spread import Alone
from mpam_calib.specimen.declaration import Simulation


def covered(problem: Problem, size: int) -> float:
    """Share of the readings in their 90 % bands, each level predicted from the others."""
    inside = []
    for level in np.unique(problem.level):
        held = problem.level == level
        fitted = fit(problem.take(~held), frozenset(), size)
        mean, covariance = predict_rows(problem, fitted, (np.flatnonzero(~held), np.flatnonzero(held)))
        inside.append(np.abs(problem.force[held] - mean) <= Z90 * np.sqrt(np.diagonal(covariance)))
    return float(np.mean(np.concatenate(inside)))


@pytest.mark.parametrize("share", [0.1, 0.3])
def test_bands_hold_a_misfit_that_no_remainder_holds(problem: Problem, share: float) -> None:
    """Every level is off by a curve of its own, 10 or 30 % of the force scale: the search stops at 3 %."""
    rng = np.random.default_rng(5)
    x = problem.middle().displacement / problem.middle().displacement.max()
    waves = np.cos(np.pi * np.arange(4) * x[:, None])
    amplitudes = rng.standard_normal((problem.level.max() + 1, 4)) / 2.0
    off = share * problem.force_scale * np.sum(amplitudes[problem.level] * waves, axis=1)
    wrong = replace(problem, force=problem.force + off)
    assert 0.8 <= covered(wrong, len(SIZES) - 1) <= 0.99


def test_named_causes_are_refitted_in_the_forms_that_were_named(problem: Problem) -> None:
    """Whatever forms a fold's search likes better: what tells them apart may be the very rows left out."""
    causes = frozenset(["creep"])
    relaxing = problem.force * (1.0 - 0.03 * np.log10(1.0 + problem.middle().time_at_level))
    problem = replace(problem, force=relaxing)
    plain, bent = (fit(problem, frozenset([form]), 0) for form in ("creep", "creep:wall-bent"))
    assert plain.log_evidence > bent.log_evidence + 10.0
    for known, before in ((plain, bent), (bent, plain)):
        found = Search(problem, ("creep",), Alone(problem), fits={(causes, 0): before})
        again = found.refit_like(known)
        assert again is not None
        assert again.effects == known.effects and again.log_evidence >= known.log_evidence - 5.0
        assert found.fits == {(causes, 0): before}


def test_what_forms_that_are_all_open_foresee_is_their_mixture(problem: Problem) -> None:
    """Mean and covariance of draws from the forms' own predictions; what is excluded has no part in it."""
    held = problem.cycle == 1
    softer = problem.force * (1.0 + 0.05 * np.exp(1.0 - problem.middle().cycle))
    problem = replace(problem, force=softer)
    rest = problem.take(~held)
    forms = ("stress_softening", "stress_softening:power", "stress_softening:test-power")
    known = tuple(
        replace(fit(rest, frozenset([form]), 0), log_evidence=nats)
        for form, nats in zip(forms, (0.0, -0.7, -9.0), strict=True)
    )
    index = (np.flatnonzero(~held), np.flatnonzero(held))
    mean, covariance = _over_forms(problem, Sizes(known, problem.setting), index)
    rng = np.random.default_rng(1)
    shares = np.exp([0.0, -0.7]) / np.exp([0.0, -0.7]).sum()
    drawn = np.concatenate(
        [
            rng.multivariate_normal(*predict_rows(problem, one, index), size=round(20000 * share))
            for one, share in zip(known, shares, strict=False)
        ]
    )
    apart = np.sqrt(np.diagonal(covariance))
    assert apart.max() > 1.5 * np.sqrt(np.diagonal(predict_rows(problem, known[0], index)[1])).max()
    np.testing.assert_array_less(np.abs(drawn.mean(axis=0) - mean), 0.05 * apart)
    np.testing.assert_allclose(drawn.std(axis=0), apart, rtol=0.05)
    scatter = np.corrcoef(drawn.T) - covariance / np.outer(apart, apart)
    assert np.abs(scatter).max() < 0.05


def test_of_two_levels_cycles_are_left_out(problem: Problem) -> None:
    """Or nothing is, where there are two cycles as well. No offset is hidden: to name one gains nothing."""
    problem = problem.take(problem.level < 2)
    softer = problem.force + 0.05 * problem.force_scale * problem.middle().displacement / 1e-2
    problem = replace(problem, force=softer)
    tested = ("length_offset", "wall_pressure")
    named = fit(problem, frozenset(["length_offset"]), 0)
    gain = measure_gain(problem, tested, named)
    assert gain is not None
    assert gain.held_out == "cycle"
    assert gain.folds == len(np.unique(problem.cycle)) >= FEWEST
    assert gain.rmse_named == pytest.approx(gain.rmse_before, rel=0.01)
    assert measure_gain(problem.take(problem.cycle <= 2), tested, named) is None


def test_bands_are_no_wider_than_they_need_be(problem: Problem) -> None:
    assert covered(problem, 0) == pytest.approx(0.9, abs=0.06)


@pytest.mark.parametrize("own", [{"law": "free", "moduli": "loops"}, {"friction_by_pressure": True}])
def test_of_what_each_level_has_of_its_own_cycles_are_left_out(
    problem: Problem, own: dict[str, object]
) -> None:
    """Another level's moduli or friction say nothing of a level left out: its prior alone would be scored."""
    declared = problem.blueprint.simulation.model_dump() | {"friction": "coulomb"} | own
    simulation = type(problem.blueprint.simulation)(**declared)
    blueprint = problem.blueprint.model_copy(update={"simulation": simulation})
    problem = replace(problem, blueprint=blueprint)
    named = fit(problem, frozenset({"length_offset"}), 0)
    gain = measure_gain(problem, ("length_offset",), named)
    assert gain is not None
    assert gain.held_out == "cycle"
    assert gain.rmse_before < 3.0 * problem.noise_level.total


def made_up(same: int) -> Callable[..., _Fold]:
    """A fold of one label l: errors of 3, 2 and 1 N, gains of 1 + l nats and twice that.

    The causes named are found in the first so many folds.
    """

    def fold(
        problem: object, tested: object, named: Fit, groups: object, part: np.ndarray, *_: object
    ) -> _Fold:
        (label,) = part
        sign = np.array([1.0, -1.0, 1.0, -1.0])
        inside = [np.arange(4) < count for count in (1, 3, 4)]
        gained = 1.0 + label
        return _Fold(
            residuals=[size * sign for size in (3.0, 2.0, 1.0)],
            inside=inside,
            elpd=np.array([[-50.0], [-50.0 + gained], [-50.0 + 2.0 * gained]]),
            chosen=named.effects if label < same else frozenset(["tip_shape"]),
        )

    return fold


@pytest.mark.parametrize(
    ("cause", "cycles", "held_out", "folds"),
    [("dead_band", 4, "pressure", 5), ("creep", 4, "cycle", 4), ("creep", 2, "pressure", 5)],
)
def test_each_figure_of_the_gain_is_that_of_its_own_model(
    cause: str, cycles: int, held_out: str, folds: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whole cycles are left out where the history is the cause, and there are enough of them."""
    monkeypatch.setattr(gain_module, "_fold", made_up(same=2))
    rows = np.arange(40)
    problem: Any = SimpleNamespace(
        blueprint=SimpleNamespace(simulation=Simulation()),
        cycles=np.arange(cycles),
        cycle=rows % cycles,
        level=rows % 5,
    )
    named: Any = SimpleNamespace(effects=frozenset([cause]))
    gain = measure_gain(problem, (), named)
    assert gain is not None
    assert (gain.held_out, gain.folds, gain.folds_same_set) == (held_out, folds, 2)
    assert (gain.rmse_before, gain.rmse_after, gain.rmse_named) == (3.0, 2.0, 1.0)
    assert (gain.coverage90_before, gain.coverage90_after, gain.coverage90_named) == (0.25, 0.75, 1.0)
    # 1 + 2 + ... nats; the sd of 1 ... n is sqrt(n (n + 1) / 12), and the sum's error sqrt(n) of that.
    assert gain.elpd_gain == pytest.approx(folds * (folds + 1) / 2)
    assert gain.elpd_gain_se == pytest.approx(folds * np.sqrt((folds + 1) / 12.0))
    assert gain.elpd_gain_named == pytest.approx(2.0 * gain.elpd_gain)
    assert gain.elpd_gain_named_se == pytest.approx(2.0 * gain.elpd_gain_se)
