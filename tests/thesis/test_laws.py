"""Laws, orders, friction and tension, recomputed."""

from __future__ import annotations

import numpy as np
import pytest

from mpam_calib.thesis import decoded, friction, laws, orders
from mpam_calib.thesis.statistics import determination, squared_correlation
from mpam_calib.thesis.tables import table
from mpam_calib.thesis.tensile import ecoflex, tensile_fit


def test_linear_r2_to_the_printed_digits() -> None:
    own = [round(laws.line(E)[2], 4) for E in decoded.moduli("MPAM1").T]
    assert own == list(table("4.5").values()[0])
    assert laws.line(decoded.moduli("MPAM1", corrected=False)[:, 3])[2] < 0.1


def test_exponential_r2_to_the_printed_digits() -> None:
    E = decoded.moduli("MPAM2")
    fitted = laws.double_exponential(table("4.9").values(), laws.P_KPA)
    own = [round(determination(fitted[:, k], E[:, k]), 4) for k in range(5)]
    assert own == list(table("4.8").values()[0])


def test_exponential_law_loses_the_force_all_the_same() -> None:
    law = laws.double_exponential(table("4.9").values(), laws.P_KPA)
    F = decoded.force(decoded.LEVELS, np.asarray(0.0), law)
    assert pytest.approx([110, 477, -679, -214, 540], abs=1.0) == F


def test_linear_law_as_printed_and_with_every_digit() -> None:
    printed = laws.force_error("MPAM1", laws.printed_line())
    assert printed == pytest.approx([-2.7, -4.2, -6.6, -7.6, -11.2], abs=0.05)
    assert np.abs(laws.force_error("MPAM1", laws.full_line())).max() < 0.95


@pytest.mark.parametrize(
    ("order", "levels", "rms", "r2"),
    [
        (3, slice(None), 3.37, 0.987),
        (4, slice(None), 2.23, 0.9945),
        (5, slice(None), 2.22, 0.9945),
        (4, slice(1, None), 1.41, 0.998),
    ],
)
def test_joint_linear_fits(order: int, levels: slice, rms: float, r2: float) -> None:
    fit = laws.joint("MPAM2", order, laws.linear_basis(), "linear", levels)
    assert fit.rmse_N == pytest.approx(rms, abs=0.02)
    assert fit.r2 == pytest.approx(r2, abs=5e-4)


def test_other_joint_fits() -> None:
    assert laws.joint_exponential("MPAM2", 4).rmse_N == pytest.approx(2.18, abs=0.02)
    free = laws.joint("MPAM2", 4, np.eye(5), "free")
    assert free.rmse_N == pytest.approx(0.20, abs=0.02)
    both = laws.joint_double_exponential("MPAM2", 4)
    assert both.rmse_N <= laws.joint("MPAM2", 4, laws.linear_basis(), "linear").rmse_N
    # The two shared rates run into each other: nothing but their sum is identified.
    assert both.rates[0] - both.rates[1] < 1e-4


def test_joint_fit_recovers_a_law_that_is_in_its_span() -> None:
    # MPAM1's own line is a linear law of order 4: fitted jointly to its force it leaves nothing.
    X, target, _ = laws._stacked("MPAM1", 4, laws.linear_basis(), slice(None))
    line = laws.full_line()
    gas = decoded.gas_and_thickness(decoded.LEVELS[:, None], laws.GRID)
    own = np.stack([decoded.force(P, laws.GRID, E) for P, E in zip(decoded.LEVELS, line, strict=True)])
    left = (own - gas).ravel()
    beta, *_ = np.linalg.lstsq(X / np.linalg.norm(X, axis=0), left, rcond=1e-15)
    assert X / np.linalg.norm(X, axis=0) @ beta == pytest.approx(left, abs=1e-6)
    assert not np.allclose(left, target, atol=0.1)


def test_exponential_fit_returns_known_constants() -> None:
    E = 1.6e8 * np.exp(0.0026 * laws.P_KPA) - 2e9 * np.exp(-0.04 * laws.P_KPA)
    found = laws.exponential(E, (0.002, -0.05))
    assert (found.c, found.d, found.w, found.z) == pytest.approx((1.6e8, 0.0026, -2e9, -0.04), rel=1e-3)


def test_order_tables_near_the_print_in_stretches_and_not_in_strains() -> None:
    limit = orders.range_from_print("MPAM1", 0.8838)
    assert limit == pytest.approx(0.263, abs=0.003)
    printed = [0.8784, 0.8771, 0.9780]
    stretch = [orders.order_fit("MPAM1", limit, M).squared_correlation for M in (1, 2, 3)]
    strain = [orders.order_fit("MPAM1", limit, M, "engineering").squared_correlation for M in (1, 2, 3)]
    assert stretch == pytest.approx(printed, abs=0.003)
    assert max(abs(a - b) for a, b in zip(strain, printed, strict=True)) > 0.05


def test_nested_orders_never_get_worse() -> None:
    gamma, F = orders.curve("MPAM2", 0.24)
    G = decoded.gas_and_thickness(decoded.LEVELS[3], gamma)
    errors = []
    for order in range(1, 7):
        fit = orders.order_fit("MPAM2", 0.24, order)
        errors.append(fit.rmse_N)
        assert fit.squared_correlation >= fit.determination - 1e-12
    assert errors[3] < 0.2 < errors[2]
    assert squared_correlation(2.0 * G + 5.0, F) == pytest.approx(squared_correlation(G, F))


def test_coulomb_factor_returns_what_the_loop_was_made_with() -> None:
    for i, expected in enumerate(table("4.10").values()[0]):
        gamma, measured, sign = friction.loop("MPAM1", i, 0.95)
        model = decoded.force(decoded.LEVELS[i], gamma, decoded.moduli("MPAM1")[i])
        assert friction.coulomb_factor(model, measured, sign) == pytest.approx(expected, abs=1e-9)
    assert friction.coulomb_factor(model, model * (1 - 0.1 * sign), sign) == 0.0


def test_relative_least_squares_draws_f_s_to_its_lower_bound() -> None:
    assert friction.best_strand_factor(3, 0.98) < 0.15 < friction.best_strand_factor(3, 0.98, relative=False)
    matched = [friction.matching_strand_factor(i) for i in range(5)]
    assert min(matched) > 0.44 and max(matched) < 0.76
    f = np.linspace(0.0, 1.0, 2001)
    grid = f[np.argmin(friction.strand_misfit(f, 3, 0.9))]
    assert friction.best_strand_factor(3, 0.9) == pytest.approx(grid, abs=1e-3)


def test_tensile_fit_returns_known_moduli() -> None:
    strain = np.linspace(0.0, 3.0, 50)
    fit = tensile_fit(strain, 4e4 * strain + 2e4 * strain**2, 0.1, 2.0)
    assert fit.moduli == pytest.approx([4e4, 2e4])
    assert fit.determination == pytest.approx(1.0)


def test_measured_moduli_depend_on_the_strain_range() -> None:
    strain, stress = ecoflex()
    assert strain.size == 721
    short, long = (tensile_fit(strain, stress, 0.1, high) for high in (0.5, 5.0))
    assert short.moduli[0] > 1.4 * long.moduli[0]
    assert short.moduli[1] < 0.0 < long.moduli[1]
