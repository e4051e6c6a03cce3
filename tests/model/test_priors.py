"""Priors are what they say: normalised densities, each the image of a standard normal."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import integrate, special, stats

from mpam_calib.errors import InputError
from mpam_calib.model.model import build_model
from mpam_calib.model.noise import correlated_noise_parameters, white_noise_prior
from mpam_calib.model.priors import (
    TAIL,
    HalfLongTailed,
    HalfNormal,
    LogNormal,
    LogUniform,
    LongTailed,
    Normal,
    NormalWithin,
    Parameter,
    Uniform,
)

from .build import blueprint


class SinhArcsinh(stats.rv_continuous):
    """Jones and Pewsey 2009, equations 1 and 2, without skew: S(x) = sinh(δ arsinh x)."""

    def _pdf(self, x, delta):
        s = np.sinh(delta * np.arcsinh(x))
        return delta * np.sqrt(1.0 + s**2) / np.sqrt(2.0 * np.pi * (1.0 + x**2)) * np.exp(-0.5 * s**2)

    def _cdf(self, x, delta):
        return special.ndtr(np.sinh(delta * np.arcsinh(x)))

    def _sf(self, x, delta):
        return special.ndtr(-np.sinh(delta * np.arcsinh(x)))


class FoldedSinhArcsinh(SinhArcsinh):
    """Its absolute value."""

    def _pdf(self, x, delta):
        return 2.0 * super()._pdf(x, delta)

    def _cdf(self, x, delta):
        return 1.0 - self._sf(x, delta)

    def _sf(self, x, delta):
        return 2.0 * super()._sf(x, delta)


FOLDED = FoldedSinhArcsinh(name="folded_sinh_arcsinh", a=0.0)

CASES = {
    "half long-tailed": (HalfLongTailed(0.4), FOLDED(TAIL, scale=0.4 * TAIL)),
    "long-tailed": (LongTailed(0.4), SinhArcsinh(name="sinh_arcsinh")(TAIL, scale=0.4 * TAIL)),
    "normal": (Normal(3.0, 2.0), stats.norm(3.0, 2.0)),
    "below": (NormalWithin(1.0, 2.0, -np.inf, 2.5), stats.truncnorm(-np.inf, 0.75, 1.0, 2.0)),
    "far below": (NormalWithin(0.0, 1.0, -np.inf, -2.0), stats.truncnorm(-np.inf, -2.0, 0.0, 1.0)),
    "above": (NormalWithin(0.5, 2.0, -0.5, np.inf), stats.truncnorm(-0.5, np.inf, 0.5, 2.0)),
    "between": (NormalWithin(0.0, 3.0, -1.0, 2.0), stats.truncnorm(-1.0 / 3.0, 2.0 / 3.0, 0.0, 3.0)),
    "no bound": (NormalWithin(0.0, 1.5, -np.inf, np.inf), stats.norm(0.0, 1.5)),
    "log-normal": (LogNormal(0.2, 0.7), stats.lognorm(0.7, scale=0.2)),
    "log-normal above": (LogNormal(0.2, 0.7, 0.01), stats.lognorm(0.7, loc=0.01, scale=0.2)),
    "half-normal": (HalfNormal(0.2), stats.halfnorm(scale=0.2)),
    "uniform": (Uniform(-1.0, 4.0), stats.uniform(-1.0, 5.0)),
    "log-uniform": (LogUniform(0.01, 3.0), stats.loguniform(0.01, 3.0)),
}
cases = pytest.mark.parametrize(("prior", "named"), CASES.values(), ids=list(CASES))


@cases
def test_draws_follow_the_named_distribution(prior, named):
    u = np.random.default_rng(1).standard_normal(200_000)
    assert stats.kstest(prior.from_normal(u), named.cdf).pvalue > 1e-3


@cases
def test_the_image_has_the_named_probability_everywhere(prior, named):
    u = np.linspace(-5.0, 5.0, 101)
    x = prior.from_normal(u)
    assert np.all(np.diff(x) > 0.0)
    assert named.cdf(x) == pytest.approx(special.ndtr(u), rel=1e-7, abs=1e-14)
    assert named.sf(x) == pytest.approx(special.ndtr(-u), rel=1e-7, abs=1e-14)


@cases
def test_the_density_integrates_to_one(prior, named):
    """φ(u)·du/dx by differences of the prior's own inverse, integrated over its range."""
    x = prior.from_normal(np.linspace(-6.0, 6.0, 20_001))
    u = prior.to_normal(x)
    density = np.exp(-0.5 * u**2) / np.sqrt(2.0 * np.pi) * np.gradient(u, x)
    assert integrate.trapezoid(density, x) == pytest.approx(1.0, abs=1e-4)
    inner = slice(2000, 18_001)
    assert density[inner] == pytest.approx(named.pdf(x[inner]), rel=1e-3)


@cases
def test_the_inverse(prior, named):
    u = np.linspace(-6.0, 6.0, 61)
    assert prior.to_normal(prior.from_normal(u)) == pytest.approx(u, abs=1e-6)


@cases
def test_the_standard_deviation(prior, named):
    assert prior.sd == pytest.approx(named.std(), rel=1e-6)


@cases
def test_far_tails_stay_finite(prior, named):
    x = prior.from_normal(np.array([-36.0, -9.0, 9.0, 36.0]))
    assert np.all(np.isfinite(x))
    assert np.all(np.diff(x) >= 0.0)


def test_every_parameter_of_a_full_model_goes_there_and_back():
    everything = {
        "friction": "strand",
        "friction_by_pressure": True,
        "law": "exponential_each",
        "order": 3,
        "effects": (
            "dead_band", "tip_shape", "braid_angle", "braid_stretch", "wall_pressure", "length_offset",
            "coulomb_friction", "rate_friction", "presliding", "stress_softening", "creep", "force_drift",
            "pressure_droop", "rig_compliance",
        ),
    }  # fmt: skip
    model = build_model(blueprint(everything))
    assert len(set(model.names)) == len(model.names)
    u = np.random.default_rng(0).standard_normal((50, len(model.names)))
    assert model.coordinates(model.values(u)) == pytest.approx(u, abs=1e-7)


@pytest.mark.parametrize("sd", [None, 1e-6, 0.2])
def test_noise_is_about_as_large_as_declared_however_small_that_is(sd):
    """Without a declaration it is three thousandths of the force scale; next to none is little beside it."""
    assert white_noise_prior(sd, 50.0).from_normal(0.0) == pytest.approx(sd or 0.15, rel=0.11)
    assert white_noise_prior(sd, 50.0).from_normal(-40.0) > 0.0


def test_noise_lasts_for_two_readings_at_least_and_for_much_less_than_a_stroke():
    """Of 60 s, a thirtieth; of few readings a stroke, twice the least."""
    setting = blueprint({"order": 2, "law": "linear"}).setting()
    for reading_time, longest in ((0.01, 2.0), (1.5, 6.0)):
        _, time = correlated_noise_parameters(setting, 60.0, reading_time)
        assert (time.prior.low, time.prior.high) == pytest.approx((2.0 * reading_time, longest))


def test_widened_priors():
    """Sds, or logarithmic sds, by the factor; bounds that physics sets stay where they are."""
    for factor in (0.5, 2.0):
        assert Normal(3.0, 2.0).widened(factor) == Normal(3.0, factor * 2.0)
        assert LogNormal(0.2, 0.7, 0.01).widened(factor) == LogNormal(0.2, factor * 0.7, 0.01)
        assert LongTailed(0.2).widened(factor) == LongTailed(factor * 0.2)
        assert HalfLongTailed(0.2).widened(factor) == HalfLongTailed(factor * 0.2)
        assert HalfNormal(0.2).widened(factor).sd == pytest.approx(factor * HalfNormal(0.2).sd)
        assert Uniform(-1.0, 4.0).widened(factor) == Uniform(-1.0, -1.0 + factor * 5.0)
        within = NormalWithin(0.5, 2.0, -0.5, np.inf).widened(factor)
        assert within == NormalWithin(0.5, factor * 2.0, -0.5, np.inf)
        span = LogUniform(0.01, 3.0).widened(factor)
        assert np.log(span.high / span.low) == pytest.approx(factor * np.log(300.0))
        assert span.low * span.high == pytest.approx(0.03)


@cases
def test_a_factor_of_one_changes_nothing(prior, named):
    u = np.linspace(-3.0, 3.0, 13)
    assert prior.widened(1.0).from_normal(u) == pytest.approx(prior.from_normal(u), rel=1e-12)


WRONG = {
    "Normal:scale: found -1.0": lambda: Normal(0.0, -1.0),
    "Normal:mean: found nan": lambda: Normal(np.nan, 1.0),
    "Normal:scale: found str": lambda: Normal(0.0, "1"),
    "LongTailed:scale: found 0.0": lambda: LongTailed(0.0),
    "HalfNormal:scale: found 0": lambda: HalfNormal(0),
    "HalfLongTailed:scale: found inf": lambda: HalfLongTailed(np.inf),
    "LogNormal:median: found 0.0": lambda: LogNormal(0.0, 0.5),
    "LogNormal:log_sd: found -0.5": lambda: LogNormal(1.0, -0.5),
    "LogUniform:low: found 0.0": lambda: LogUniform(0.0, 1.0),
    "LogUniform: found low = 2.0 and high = 1.0": lambda: LogUniform(2.0, 1.0),
    "Uniform: found low = 2.0 and high = 1.0": lambda: Uniform(2.0, 1.0),
    "NormalWithin: found low = 1.0 and high = 1.0": lambda: NormalWithin(0.0, 1.0, 1.0, 1.0),
    "Parameter:name: found str ''": lambda: Parameter("", Normal(0.0, 1.0), "a size"),
    "Parameter:name: found 3": lambda: Parameter(3, Normal(0.0, 1.0), "a size"),
    "Parameter:name: found str 'a size'": lambda: Parameter("a size", Normal(0.0, 1.0), "a size"),
    "Parameter:size_N: found int 5": lambda: Parameter("size_N", 5, "a size"),
}


@pytest.mark.parametrize("said", WRONG)
def test_what_is_no_prior_is_refused_where_it_is_made(said):
    with pytest.raises(InputError) as error:
        WRONG[said]()
    assert str(error.value).startswith(said)
