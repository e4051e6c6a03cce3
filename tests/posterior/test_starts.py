"""Where walkers start: inside the posterior's support, or not at all."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest

from mpam_calib.errors import InputError
from mpam_calib.posterior.chains.ensembles import start_states
from mpam_calib.posterior.chains.proposal import StudentMixture
from mpam_calib.posterior.density.collapsed import Collapsed

MIXTURE = StudentMixture.build([np.zeros(2)], [np.eye(2)])


class Bounded:
    """A density that is finite below a bound on the first coordinate; counts what it is asked."""

    def __init__(self, bound: float) -> None:
        self.bound, self.calls = bound, 0

    def log_posterior(self, u: np.ndarray) -> np.ndarray:
        self.calls += 1
        assert self.calls <= 1000, "no end in sight"
        return np.where(u[:, 0] < self.bound, -0.5 * np.sum(u**2, axis=1), -np.inf)


def test_a_density_that_is_nowhere_finite_is_refused() -> None:
    nowhere = Bounded(-np.inf)
    with pytest.raises(InputError, match="found no finite probability near the best fit"):
        start_states(cast(Collapsed, nowhere), MIXTURE, 8, [0])


def test_starts_outside_are_drawn_again() -> None:
    half = Bounded(0.0)
    (state,) = start_states(cast(Collapsed, half), MIXTURE, 50, [0])
    assert np.all(state.coords[:, 0] < 0.0)
    assert np.all(np.isfinite(state.log_prob))


def test_starts_are_three_times_as_wide_as_what_was_fitted_and_each_ensemble_has_its_own() -> None:
    """R-hat would else agree before the ensembles had the time to."""
    everywhere = cast(Collapsed, Bounded(np.inf))
    one, other = start_states(everywhere, MIXTURE, 4000, [0, 1])
    fitted = MIXTURE.draw(4000, np.random.RandomState(2))
    assert one.coords.std(axis=0) == pytest.approx(3.0 * fitted.std(axis=0), rel=0.06)
    assert np.abs(np.corrcoef(one.coords[:, 0], other.coords[:, 0])[0, 1]) < 0.06
