"""Every term of the force against a scalar formula, and properties that the equations promise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpam_calib.physics.friction import coulomb_factor, strand_friction_per_f_s
from mpam_calib.physics.kinematics import (
    SHAPES,
    Rest,
    Shape,
    radius_constant_thickness,
    radius_inextensible_braid,
    tan2_braid_angle,
    tip_shortened_length,
    tip_shortened_length_of_its_own,
    wall_at_constant_volume,
    with_longer_strands,
)
from mpam_calib.physics.statics import (
    axial_lever,
    braid_energy_force,
    gas_force,
    hoop_lever,
    modulus_columns,
    strains,
    strand_strain,
    thickness_force,
    work_lost_at_tips,
)

from . import plain

KINEMATICS = ["inextensible_braid", "constant_thickness"]


def rest_of(m: plain.Tube) -> Rest:
    return Rest(*(np.asarray(v) for v in (m.L0, m.R0, m.t0, m.alpha0)))


@st.composite
def tubes(draw):
    R0 = draw(st.floats(1e-3, 15e-3))
    return plain.Tube(
        draw(st.floats(0.02, 0.5)),
        R0,
        R0 * draw(st.floats(0.05, 0.45)),
        math.radians(draw(st.floats(58.0, 78.0))),
    )


GAMMA = st.floats(0.0, 0.25)
PRESSURE = st.floats(1e3, 1e6)
cheap = settings(max_examples=60, deadline=None)


@cheap
@given(tubes(), GAMMA, PRESSURE, st.sampled_from(KINEMATICS))
def test_each_term_is_its_scalar_formula(m, gamma, P, kinematics):
    L, rest = m.L0 * (1.0 - gamma), rest_of(m)
    shape = SHAPES[kinematics](np.asarray(L), rest)
    R = plain.radius(m, L, kinematics)
    t, T = plain.wall(m, L, R, kinematics), plain.tan2(m, L)
    # t is a difference that is at least a hundredth of R, so that 1e-10 leaves room.
    assert float(shape.R) == pytest.approx(R, rel=1e-10)
    assert float(shape.t) == pytest.approx(t, rel=1e-10)
    assert float(shape.T) == pytest.approx(T, rel=1e-10)
    exact = Shape(*(np.asarray(v) for v in (L, R, t, T)))
    assert float(gas_force(np.asarray(P), exact)) == pytest.approx(plain.gas(P, R, T), rel=1e-12)
    assert float(thickness_force(np.asarray(P), exact)) == pytest.approx(
        plain.thickness(P, R, t, T), rel=1e-12
    )
    for strain in ("engineering", "stretch"):
        columns = modulus_columns(exact, rest, strain, 6)
        lever = float(axial_lever(exact) + hoop_lever(exact))
        for k in range(1, 7):
            expected = plain.per_modulus(m, L, R, t, T, k, strain)
            assert float(columns[k - 1]) == pytest.approx(expected, rel=1e-10, abs=1e-12 * lever)


@cheap
@given(tubes(), GAMMA, PRESSURE, st.floats(0.3e9, 5e9), st.floats(0.0, 0.5), st.integers(10, 200))
def test_braid_terms_are_their_scalar_formulas(m, gamma, P, E_br, nu, n):
    rest, L = rest_of(m), m.L0 * (1.0 - gamma)
    friction = strand_friction_per_f_s(np.asarray(P), np.asarray(L), rest, E_br, nu)
    assert float(friction) == pytest.approx(plain.strand_friction(m, P, gamma, E_br, nu), rel=1e-10)
    energy = braid_energy_force(np.asarray(P), np.asarray(L), rest, E_br, 1e-4, n)
    assert float(energy) == pytest.approx(plain.braid_energy(m, P, L, E_br, 1e-4, n), rel=1e-10)


@cheap
@given(tubes(), GAMMA)
def test_the_wall_keeps_its_volume(m, gamma):
    """Eq. 2.6: L (2Rt − t²) is that at rest, for both kinematics."""
    rest, L = rest_of(m), np.asarray(m.L0 * (1.0 - gamma))
    for kinematics in KINEMATICS:
        shape = SHAPES[kinematics](L, rest)
        volume = float(L * (2.0 * shape.R * shape.t - shape.t**2))
        assert volume == pytest.approx(m.L0 * (2.0 * m.R0 * m.t0 - m.t0**2), rel=1e-9)
        assert 0.0 < float(shape.t) <= float(shape.R)


@cheap
@given(tubes(), GAMMA)
def test_the_strands_keep_their_length(m, gamma):
    """Eq. 2.10 with 2.1: (2πNR)² + L² = B², and cos α = 2πNR/B."""
    rest, L = rest_of(m), m.L0 * (1.0 - gamma)
    B = m.L0 / math.sin(m.alpha0)
    turns = B * math.cos(m.alpha0) / m.R0
    R = float(radius_inextensible_braid(np.asarray(L), rest))
    assert (turns * R) ** 2 + L**2 == pytest.approx(B**2, rel=1e-12)
    T = float(tan2_braid_angle(np.asarray(L), rest))
    assert 1.0 / math.sqrt(1.0 + T) == pytest.approx(turns * R / B, rel=1e-10)


@cheap
@given(tubes(), GAMMA, st.floats(0.0, 0.05))
def test_longer_strands_keep_their_turns(m, gamma, strain):
    """(2πNR)² + L² = B² (1 + ε)² with N as at rest, cos α = 2πNR/(B (1 + ε)), and the wall its volume."""
    rest, L = rest_of(m), np.asarray(m.L0 * (1.0 - gamma))
    shape = with_longer_strands(
        SHAPES["inextensible_braid"](L, rest), rest, "inextensible_braid", np.asarray(strain)
    )
    B = m.L0 / math.sin(m.alpha0) * (1.0 + strain)
    turns = m.L0 / math.tan(m.alpha0) / m.R0
    assert (turns * shape.R) ** 2 + L**2 == pytest.approx(B**2, rel=1e-9)
    assert 1.0 / math.sqrt(1.0 + shape.T) == pytest.approx(float(turns * shape.R / B), rel=1e-8)
    assert float(shape.t) == pytest.approx(float(wall_at_constant_volume(L, shape.R, rest)), rel=1e-12)
    wall = with_longer_strands(
        SHAPES["constant_thickness"](L, rest), rest, "constant_thickness", np.asarray(strain)
    )
    assert wall.R == SHAPES["constant_thickness"](L, rest).R
    assert float(wall.T) == pytest.approx(float(shape.T), rel=1e-9)


@cheap
@given(tubes(), GAMMA, PRESSURE)
def test_the_energy_of_stretched_strands_is_that_of_2_25(m, gamma, P):
    """U = ½ E A B ε² n; its slope along the length is the force that Eq. 2.25 subtracts."""
    rest, L, E, r, n = rest_of(m), m.L0 * (1.0 - gamma), 2.1e9, 1e-4, 48
    B = m.L0 / math.sin(m.alpha0)

    def energy(length):
        return 0.5 * E * math.pi * r**2 * B * n * strand_strain(P, length, rest, E, r, n) ** 2

    step = 1e-4 * L
    slope = (energy(L + step) - energy(L - step)) / (2.0 * step)
    assert slope == pytest.approx(float(braid_energy_force(P, L, rest, E, r, n)), rel=1e-6)


@cheap
@given(tubes(), st.sampled_from(KINEMATICS))
def test_at_rest_nothing_has_changed(m, kinematics):
    rest = rest_of(m)
    shape = SHAPES[kinematics](np.asarray(m.L0), rest)
    assert float(shape.R) == pytest.approx(m.R0, rel=1e-10)
    assert float(shape.t) == pytest.approx(m.t0, rel=1e-9)
    assert float(shape.T) == pytest.approx(math.tan(m.alpha0) ** 2, rel=1e-9)
    z, x = strains(shape, rest, "engineering")
    assert abs(float(z)) < 1e-12
    assert abs(float(x)) < 1e-10


@cheap
@given(tubes(), st.floats(0.1, 20.0), PRESSURE, GAMMA, st.sampled_from(KINEMATICS))
def test_force_at_a_contraction_does_not_depend_on_the_length(m, factor, P, gamma, kinematics):
    """Length drops out of the gas, the thickness and the bladder's terms (blocked force: γ = 0)."""
    longer = plain.Tube(m.L0 * factor, m.R0, m.t0, m.alpha0)
    forces = []
    for tube in (m, longer):
        rest = rest_of(tube)
        shape = SHAPES[kinematics](np.asarray(tube.L0 * (1.0 - gamma)), rest)
        bladder = modulus_columns(shape, rest, "engineering", 3) @ np.array([1e5, 4e4, 2e4])
        forces.append(
            float(gas_force(np.asarray(P), shape) + thickness_force(np.asarray(P), shape) + bladder)
        )
    size = P * math.pi * m.R0**2 * math.tan(m.alpha0) ** 2
    assert forces[0] == pytest.approx(forces[1], rel=1e-8, abs=1e-9 * size)


@cheap
@given(tubes(), GAMMA, PRESSURE, st.floats(1.1, 4.0))
def test_scaling_laws(m, gamma, P, factor):
    """Gas forces go with P and with area; Eq. 2.25 with P² and Eq. 2.43 with P^(4/3)."""
    rest, L = rest_of(m), np.asarray(m.L0 * (1.0 - gamma))
    large = Rest(*(np.asarray(v) for v in (m.L0, m.R0 * factor, m.t0 * factor, m.alpha0)))
    p = np.asarray(P)
    for kinematics in KINEMATICS:
        small_shape, large_shape = (SHAPES[kinematics](L, r) for r in (rest, large))
        for term in (gas_force, thickness_force):
            here = float(term(p, small_shape))
            assert float(term(p * factor, small_shape)) == pytest.approx(factor * here, rel=1e-12)
            assert float(term(p, large_shape)) == pytest.approx(factor**2 * here, rel=1e-8)
    energy = braid_energy_force(p, L, rest, 2e9, 1e-4, 50)
    assert float(braid_energy_force(p * factor, L, rest, 2e9, 1e-4, 50) / energy) == pytest.approx(factor**2)
    friction = strand_friction_per_f_s(p, L, rest, 2e9, 0.33)
    ratio = float(strand_friction_per_f_s(p * factor, L, rest, 2e9, 0.33) / friction)
    assert ratio == pytest.approx(factor ** (4.0 / 3.0))


@cheap
@given(tubes(), PRESSURE)
def test_the_gas_does_the_work_of_the_volume(m, P):
    """Eq. 2.18 with its sign mended: F dL = −P dV along the inextensible strands (V = πR²L)."""
    rest, L, h = rest_of(m), 0.9 * m.L0, 1e-5 * m.L0

    def volume(length: float) -> float:
        return math.pi * float(radius_inextensible_braid(np.asarray(length), rest)) ** 2 * length

    slope = (volume(L + h) - volume(L - h)) / (2.0 * h)
    force = float(gas_force(np.asarray(P), SHAPES["inextensible_braid"](np.asarray(L), rest)))
    assert force == pytest.approx(-P * slope, rel=1e-6, abs=1e-7 * P * math.pi * m.R0**2)


@cheap
@given(tubes(), PRESSURE, st.floats(0.01, 0.25))
def test_the_gas_does_no_work_on_what_conical_ends_lack(m, P, gamma):
    """The ends' volume summed slice by slice, from R0 at the fitting to R one step ρ further."""
    rest, L, h = rest_of(m), (1.0 - gamma) * m.L0, 1e-5 * m.L0

    def lacking(length: float) -> float:
        R = float(radius_inextensible_braid(np.asarray(length), rest))
        edges = np.linspace(m.R0, R, 2001)
        r = 0.5 * (edges[1:] + edges[:-1])
        return 2.0 * math.pi * float(np.sum(R**2 - r**2)) * (edges[1] - edges[0])

    slope = (lacking(L + h) - lacking(L - h)) / (2.0 * h)
    lost = float(work_lost_at_tips(np.asarray(P), SHAPES["inextensible_braid"](np.asarray(L), rest), rest))
    assert lost == pytest.approx(-P * slope, rel=1e-4)


def test_2_25_and_2_43_by_hand():
    """Two numbers worked out with pencil from MPAM1's data at 200 kPa."""
    rest = Rest(*(np.asarray(v) for v in (0.05, 0.003, 0.0007, math.radians(72.0))))
    # B = 52.573 mm, 2πN = B cos α0/R0 = 5.41531, A = π (0.11 mm)² = 0.0380133 mm²; E = 2.1 GPa, n = 48:
    # L/(E A n) = 0.05/3.83174e6·... and so on, all in SI.
    B = 0.05 / 0.951056516
    turns = B * 0.309016994 / 0.003
    by_hand = 0.05 / (2.1e9 * 3.80132711e-8 * 48) * 39.4784176 * 4e10 * B**3 / turns**4
    energy = braid_energy_force(np.asarray(2e5), np.asarray(0.05), rest, 2.1e9, 1.1e-4, 48)
    assert float(energy) == pytest.approx(by_hand, rel=1e-7)
    # Thesis notes, section A point 6 and C point 17: friction for f_s = 0.15 at γ = 0 is 1.8 N; the energy
    # term of a real monofilament (0.10 to 0.13 mm, n = 50, E 2.1 GPa) costs 4.0 to 2.4 N.
    friction = 0.15 * strand_friction_per_f_s(np.asarray(2e5), np.asarray(0.05), rest, 2e9, 0.33)
    assert float(friction) == pytest.approx(1.8, abs=0.05)
    low, high = (
        float(braid_energy_force(np.asarray(2e5), np.asarray(0.05), rest, 2.1e9, r, 50))
        for r in (1.0e-4, 1.3e-4)
    )
    assert low == pytest.approx(4.0, abs=0.05)
    assert high == pytest.approx(2.4, abs=0.05)


def test_2_47_takes_length_in_proportion_to_the_bulge():
    rest = Rest(*(np.asarray(v) for v in (0.05, 0.003, 0.0007, math.radians(72.0))))
    L, R = np.asarray(0.04), np.asarray(0.005)
    assert float(tip_shortened_length(L, R, rest, np.asarray(1.0))) == pytest.approx(
        0.04 - 2.0 * (math.pi / 2.0 - 1.0) * 0.002, rel=1e-12
    )
    assert float(tip_shortened_length(L, R, rest, np.asarray(0.0))) == 0.04
    assert float(tip_shortened_length(L, rest.R0, rest, np.asarray(3.0))) == 0.04


def test_tips_whose_radius_is_that_of_the_working_length_solve_2_47_for_it():
    rest = Rest(*(np.asarray(v) for v in (0.05, 0.003, 0.0007, math.radians(72.0))))
    L = np.linspace(0.036, 0.05, 8)[None, :]
    factor = np.array([[-0.5], [0.0], [0.5], [1.0]])
    for kinematics, shape in SHAPES.items():
        working = tip_shortened_length_of_its_own(L, kinematics, rest, factor)
        again = tip_shortened_length(L, shape(working, rest).R, rest, factor)
        np.testing.assert_allclose(again, working, atol=1e-9)
        np.testing.assert_array_equal(working[1], L[0])


def test_3_16_at_the_published_optimum():
    """Case II's closed form: R = 3 mm, α = 72°, t = R(1 − √0.6), F = PπR²(2√0.6 T − 0.6) = 79.58756 N."""
    t = 3e-3 * (1.0 - math.sqrt(0.6))
    T = math.tan(math.radians(72.0)) ** 2
    shape = Shape(np.asarray(0.05), np.asarray(3e-3), np.asarray(t), np.asarray(T))
    force = float(gas_force(np.asarray(2e5), shape) + thickness_force(np.asarray(2e5), shape))
    assert force == pytest.approx(2e5 * math.pi * 9e-6 * (2.0 * math.sqrt(0.6) * T - 0.6), rel=1e-12)
    assert force == pytest.approx(79.58756, abs=1e-5)


def test_radii_of_the_two_kinematics_at_thirty_percent():
    """Notes B 8: at γ = 0.3 Eq. 4.16 gives 4.14 mm, the inextensible strands 7.24 mm."""
    rest = Rest(*(np.asarray(v) for v in (0.05, 0.003, 0.0007, math.radians(72.0))))
    L = np.asarray(0.035)
    assert float(radius_constant_thickness(L, rest)) == pytest.approx(4.14e-3, abs=5e-6)
    assert float(radius_inextensible_braid(L, rest)) == pytest.approx(7.24e-3, abs=5e-6)


def test_a_wall_that_would_fill_the_tube_has_the_radius_for_thickness():
    rest = Rest(*(np.asarray(v) for v in (0.05, 0.003, 0.0029, math.radians(72.0))))
    R = np.asarray(0.0029)
    assert float(wall_at_constant_volume(np.asarray(0.05), R, rest)) == 0.0029


@pytest.mark.parametrize(
    ("sign", "force", "expected"), [(1, 40.0, 44.0), (-1, 40.0, 36.0), (0, 40.0, 40.0), (1, -40.0, -36.0)]
)
def test_coulomb_friction_opposes_the_motion(sign, force, expected):
    """F + K_f |F| s: loading always adds, unloading always takes away, also where the muscle pushes."""
    factor = coulomb_factor(np.asarray(0.1), np.asarray(float(sign)), np.sign(np.asarray(force)))
    assert float(force * factor) == pytest.approx(expected, rel=1e-12)


def test_no_pressure_no_strand_friction():
    rest = Rest(*(np.asarray(v) for v in (0.05, 0.003, 0.0007, math.radians(72.0))))
    P = np.array([-1e4, 0.0, 1e4])
    friction = strand_friction_per_f_s(P, np.full(3, 0.05), rest, 2e9, 0.33)
    assert friction[0] == 0.0
    assert friction[1] == 0.0
    assert friction[2] > 0.0
