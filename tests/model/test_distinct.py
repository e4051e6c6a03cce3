"""What is alike is reckoned once, and comes out as if each had been reckoned by itself."""

from __future__ import annotations

import numpy as np
import pytest

from mpam_calib.model.distinct import over_distinct
from mpam_calib.model.effect import effect

from .forms import rows, setting_for, start

PRESLIDING = ["presliding", *(f"presliding:{form}" for form in effect("presliding").forms)]


@pytest.mark.parametrize("moved", [[], [3], [1, 4], [1, 2, 3, 4], [0]])
def test_rows_as_the_first_are_reckoned_once(moved: list[int]) -> None:
    sizes = np.tile([[0.3, -1.0]], (5, 1))
    sizes[moved] += np.arange(1.0, 1.0 + len(moved))[:, None]
    seen = []

    def of(some: np.ndarray) -> np.ndarray:
        seen.append(len(some))
        return np.asarray(some @ np.arange(8.0).reshape(2, 4))

    np.testing.assert_allclose(over_distinct(sizes, of), sizes @ np.arange(8.0).reshape(2, 4), rtol=1e-12)
    assert seen == [5 if moved == [0] else 1 + len(moved)]


@pytest.mark.parametrize("form", PRESLIDING)
def test_many_reversals_at_once_are_each_as_alone(form: str) -> None:
    setting = setting_for(form)
    before = start(setting, rows(setting, 40))
    parameters = effect(form).parameters(setting)
    u = np.zeros((4, len(parameters)))
    u[1, 0], u[3, -1] = 0.7, -0.4
    values = {p.name: p.prior.from_normal(u[:, [i]]) for i, p in enumerate(parameters)}
    together = effect(form).apply(before, values, setting).sign
    for i in range(4):
        alone = effect(form).apply(before, {n: v[i : i + 1] for n, v in values.items()}, setting).sign
        np.testing.assert_allclose(together[i : i + 1], alone, rtol=1e-12, atol=1e-12)
    assert not np.array_equal(together[0], together[1])
    assert np.array_equal(together[0], together[2])
