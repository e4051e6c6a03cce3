"""What a summary lists: the rates of the law by their differences, and priors in the units of print."""

from __future__ import annotations

import numpy as np
import pytest
from model import build

from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.model.model import Model, build_model
from mpam_calib.posterior import draws
from mpam_calib.posterior.chains.convergence import diagnose_chains
from mpam_calib.posterior.chains.sampling import Sampling
from mpam_calib.posterior.density.target import build_target
from mpam_calib.posterior.draws import Draws, Reported, keep_draws, prior_draws, reported
from mpam_calib.specimen.declaration import GeometrySd

COUNT = 50


def listed(model: Model, **values: np.ndarray) -> dict[str, Reported]:
    """What is listed of draws at the middle of the prior, but for some values (COUNT,), SI."""
    u = np.zeros((COUNT, len(model.names)))
    found = model.values(u) | {name: value[:, None] for name, value in values.items()}
    eta = np.zeros((COUNT, sum(model.linear_sizes)))
    return {item.name: item for item in reported(model, Draws(u, found, eta, 1))}


def test_the_slower_rate_is_the_faster_one_less_the_gap() -> None:
    """Per pascal inside, per kilopascal in print."""
    model = build_model(build.blueprint({"law": "exponential", "order": 2}, build.PLAIN))
    rng = np.random.default_rng(0)
    d, gap = -1e-5 * rng.uniform(1.0, 2.0, COUNT), 1e-5 * rng.uniform(0.5, 1.5, COUNT)
    found = listed(model, d=d, gap=gap)
    assert "gap" not in found
    assert found["d"].draws == pytest.approx(1e3 * d)
    assert found["z"].draws == pytest.approx(1e3 * (d - gap))
    assert (found["d"].unit, found["z"].unit) == ("1/kPa", "1/kPa")
    assert (found["d"].draws > found["z"].draws).all()


def test_a_prior_s_width_is_in_the_unit_of_its_parameter() -> None:
    """Of the dead-band a tenth of the top level, 20 kPa; of the angle what is declared, 2°."""
    geometry = build.GEOMETRY.model_copy(update={"sd": GeometrySd(alpha0_deg=2.0)})
    declared = {"law": "linear", "order": 2, "effects": ("dead_band",)}
    model = build_model(build.blueprint(declared, build.PLAIN, geometry=geometry))
    found = listed(model, P_DB_kPa=np.full(COUNT, 7e3))
    assert (found["P_DB_kPa"].unit, found["P_DB_kPa"].draws[0]) == ("kPa", pytest.approx(7.0))
    assert found["P_DB_kPa"].prior_sd == pytest.approx(20.0, rel=1e-4)
    assert found["alpha0_deg"].draws == pytest.approx(72.0)
    assert found["alpha0_deg"].prior_sd == pytest.approx(2.0, rel=1e-4)


def test_no_two_kept_draws_share_their_random_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    """However few are drawn back at once: of forty at one place the moduli are forty, and the seed's own."""
    made = build.with_force(build.specimen(None, build.loops()), np.full(72, 10.0))
    target = build_target(made, draw_blueprint(made, build.PLAIN))
    monkeypatch.setattr(draws, "batch_size", lambda target: 8)
    chain = np.zeros((4, 10, 1, len(target.model.names)))
    sampling = Sampling(chain, chain[..., 0], diagnose_chains(chain), [], 0.3, [0.3])
    first, again, other = (keep_draws(target, sampling, seed).eta for seed in (0, 0, 1))
    assert len(np.unique(first[:, 0])) == 40
    assert np.array_equal(first, again)
    assert not np.isin(first[:, 0], other[:, 0]).any()


def test_draws_of_the_prior_are_the_seed_s_own() -> None:
    model = build_model(build.blueprint({"law": "linear", "order": 2}, build.PLAIN))
    for name in ("K_f", "a_1"):
        first, again, other = (prior_draws(model, [name], seed)[name] for seed in (0, 0, 1))
        assert np.array_equal(first, again)
        assert not np.isin(first, other).any()
