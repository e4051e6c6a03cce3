"""What a posterior owes to the data, by the width of its band."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from mpam_calib.run.view import _learnt


def learnt(posterior: np.ndarray, prior: np.ndarray) -> float:
    summary = pd.DataFrame({"parameter": ["w_1"], "sd": [posterior.std()], "prior_sd": [prior.std()]})
    return float(_learnt(summary, {"w_1": posterior}, {"w_1": prior})["contraction"].iloc[0])


def test_a_heavy_tail_of_the_prior_is_not_what_the_data_told() -> None:
    x = np.linspace(-1.0, 1.0, 2000)
    prior = x.copy()
    prior[-1] = 1e20
    assert learnt(0.9 * x, prior) == pytest.approx(0.1, abs=0.01)


def test_a_heavy_tail_of_the_posterior_is_not_ignorance() -> None:
    x = np.linspace(-1.0, 1.0, 2000)
    posterior = 0.01 * x
    posterior[-1] = 1e20
    assert learnt(posterior, x) == pytest.approx(0.99, abs=0.001)


def test_a_value_that_nothing_can_move_has_learnt_nothing() -> None:
    assert learnt(np.ones(10), np.ones(10)) == 0.0
