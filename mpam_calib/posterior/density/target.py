"""From a specimen to the function that is sampled: reduced data, guide forces, modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.blueprint import Blueprint
from mpam_calib.model.model import Model, build_model
from mpam_calib.model.noise import CORRELATED, FREEDOM, GROWTH, WHITE
from mpam_calib.model.readings import Readings
from mpam_calib.model.remainder import ROUGH, SMOOTH
from mpam_calib.posterior.density.collapsed import Collapsed, Data
from mpam_calib.posterior.density.free_ends import SLOPE_STEP
from mpam_calib.posterior.density.guide import Guide
from mpam_calib.posterior.density.mode import CLIMBED, Mode, climb_modes, evaluate, find_modes
from mpam_calib.posterior.likelihood.bins import LoopBins, bin_loops
from mpam_calib.posterior.likelihood.points import FREE, floor_of, gather_points
from mpam_calib.posterior.likelihood.sites import LEAST_SHARE
from mpam_calib.posterior.likelihood.tensile_points import gather_tensile
from mpam_calib.specimen.recording import Loops, Specimen

Array = NDArray[np.float64]

GUIDE_ROUNDS, SITE_ROUNDS = 4, 12
"""Rounds in which guide forces, and sites of heavy-tailed noise, may settle."""
GUIDE_TOLERANCE = 0.02
"""Share of the noise by which a guide force may still move between rounds."""
STARTS = 2048
"""Draws with moduli that are looked at before they are climbed from."""
ECHO_TOLERANCE = 0.005
"""Share of itself by which the echo of a force that depends on itself may still move, on average."""
SITE_TOLERANCE = 0.02
"""Share of the typical noise by which that of a heavy-tailed row may still move."""


def build_target(specimen: Specimen, blueprint: Blueprint) -> Collapsed:
    """The collapsed posterior of a specimen's recordings under a blueprint's model.

    The recordings may be part of those that the blueprint was drawn from (a fold).
    """
    model = build_model(blueprint)
    tensile = None
    if specimen.tensile is not None and model.tensile is not None:
        tensile = gather_tensile(specimen.tensile, model.tensile.low, model.tensile.high)
    points = gather_points(specimen) if model.chain else None
    data = Data(
        bins=_bins(specimen.loops, model) if specimen.loops is not None and model.chain else None,
        points=points,
        tensile=tensile,
        floor=floor_of(specimen.sensors.force_floor_N, points),
    )
    return Collapsed(model, data, Guide.measured(data.bins))


def without_level(specimen: Specimen, target: Collapsed, level: int) -> Collapsed:
    """The target without what was recorded at one level, but for the motion; ``level`` indexes the levels.

    Guide forces are those of the whole target.
    """
    data, guide = target.data, target.guide
    bins, points = data.bins, data.points
    if specimen.loops is not None and bins is not None:
        whole, bins = bins, _bins(specimen.loops, target.model, level)
        guide = guide.of_bins_left(whole, bins, level)
    if points is not None:
        kept = points.level(specimen.levels_Pa) != level
        points = points.take(kept) if kept.any() else None
        guide = guide.of_points(kept)
    return replace(target, data=replace(data, bins=bins, points=points), guide=guide)


def _bins(loops: Loops, model: Model, without: int | None = None) -> LoopBins | None:
    """The loops' bins, but for one level's; None where there are no others."""
    memory = model.chain is None or model.chain.memory
    if without is None:
        return bin_loops(loops, memory=memory)
    out = loops.level == without
    if out.all():
        return None
    return bin_loops(
        replace(loops, unclear=out if loops.unclear is None else out | loops.unclear), memory=memory
    )


def locate(target: Collapsed, rng: np.random.Generator) -> tuple[Collapsed, list[Mode]]:
    """The target with settled guide forces, and its modes, best first.

    What depends on the force itself (the sign in Coulomb's law, a fixture's give, the slope at a free
    contraction, noise that grows) is fed with the model's force at the mode, until that no longer moves;
    and the sites that stand for heavy-tailed noise are those of the mode.
    """
    if target.model.coordinates_sampled:
        found = _with_moduli(target, rng)
    else:
        found = _settle(target, find_modes(target, rng))
    if FREEDOM not in target.model.names:
        return found
    # What looks like structure may be bursts: sites settle there first, then everything else.
    start = _bursts(target, found[1][0].u)
    other = found[0]
    for _ in range(SITE_ROUNDS):
        other = replace(other, guide=_eased(other.guide, _guide(other, start)))
    bursts = _settle(other, climb_modes(other, [start]))
    return max((found, bursts), key=lambda pair: pair[1][0].log_posterior)


def _with_moduli(target: Collapsed, rng: np.random.Generator) -> tuple[Collapsed, list[Mode]]:
    """The same where the moduli are sampled: climbs start from draws of a target that integrates them out.

    There every curve falls as steeply as a straight line from the blocked force. If none of them can be, the
    simulation contradicts the free contractions, and none is excluded.
    """
    model, points = target.model, target.data.points
    assert model.setting is not None and points is not None
    integrated = replace(model, coordinates_sampled=())
    start = np.zeros((1, len(integrated.names)))
    way = np.maximum(points.readings.displacement, SLOPE_STEP * model.setting.geometry.L0)
    at_rest = Readings.at_rest(points.readings.pressure, np.zeros(len(points)))
    moduli = np.zeros((1, sum(model.linear_sizes)))
    blocked = predict_force(integrated, integrated.values(start), moduli, at_rest)[0]
    twin = replace(target, model=integrated, guide=replace(target.guide, slope=-np.abs(blocked) / way))
    modes = find_modes(twin, rng)
    u = rng.multivariate_normal(modes[0].u, modes[0].covariance, STARTS)
    eta = twin.linear_draws(integrated.values(u), rng)
    u = np.concatenate([u, eta[:, : model.linear_sizes[0]]], axis=1)
    height = evaluate(target, u)
    if not np.isfinite(height).any():
        target = replace(target, guide=replace(target.guide, contradicted=True))
        height = evaluate(target, u)
    best = u[np.argsort(-height)[:CLIMBED]]
    return _settle(target, climb_modes(target, list(best)))


def _eased(old: Guide, new: Guide) -> Guide:
    """The new guide with heavy-tailed noise on the way to its own: with all curvatures a step overshoots."""

    def between(before: Array | None, after: Array | None) -> Array | None:
        return after if before is None or after is None else before + LEAST_SHARE * (after - before)

    bins = between(old.bin_noise, new.bin_noise)
    return replace(new, bin_noise=bins, point_noise=between(old.point_noise, new.point_noise))


def _settle(target: Collapsed, modes: list[Mode]) -> tuple[Collapsed, list[Mode]]:
    """Round after round: guide forces and sites of the best mode, then the modes under them."""
    for _ in range(SITE_ROUNDS if FREEDOM in target.model.names else GUIDE_ROUNDS):
        guide = _guide(target, modes[0].u)
        if not _matters(target, guide):
            break
        target = replace(target, guide=guide)
        modes = climb_modes(target, [mode.u for mode in modes])
    return target, modes


def _bursts(target: Collapsed, u: Array) -> Array:
    """A start (d,) that takes the misfit for bursts (heavy tails, little else), not for structure."""
    other = u.copy()
    for name, place in ((FREEDOM, -2.5), (WHITE, 0.0), (CORRELATED, -1.5), (SMOOTH, -1.5), (ROUGH, -1.5)):
        if name in target.model.names:
            other[target.model.names.index(name)] = place
    return other


def _guide(target: Collapsed, u: Array) -> Guide:
    model, data = target.model, target.data
    values = model.values(u[None])
    eta = target.linear_mean(values)

    def estimate(readings: Readings) -> tuple[Array, Array | None]:
        assert model.chain is not None
        force = predict_force(model, values, eta, readings)[0]
        echo = model.chain.echo(values, eta[:, : model.linear_sizes[0]], readings, force)
        return force, None if echo is None else echo[0]

    bins, bin_echo = (None, None) if data.bins is None else estimate(data.bins.readings)
    nodes, node_echo = None, None
    if data.bins is not None and bin_echo is not None and target.white_only:
        nodes, node_echo = estimate(data.bins.nodes.readings)
    heavy = _heavy_noise(target, values)
    loops = Guide(
        bins, bin_noise=heavy[0], nodes=nodes, bin_echo=bin_echo, node_echo=node_echo,
        contradicted=target.guide.contradicted,
    )  # fmt: skip
    if data.points is None or model.setting is None:
        return loops
    rows = data.points.readings
    step = SLOPE_STEP * model.setting.geometry.L0
    shifted = [
        predict_force(model, values, eta, replace(rows, displacement=rows.displacement + side * step))[0]
        for side in (-1.0, 1.0)
    ]
    slope = (shifted[1] - shifted[0]) / (2.0 * step)
    points, point_echo = estimate(rows)
    return replace(loops, points=points, slope=slope, point_noise=heavy[1], point_echo=point_echo)


def _heavy_noise(target: Collapsed, values: dict[str, Array]) -> tuple[Array | None, Array | None]:
    """Noise (n,), N, of the bins and of the points at the mode where it is heavy-tailed; 0 in slack rows."""
    if FREEDOM not in values:
        return None, None
    noise = [each[0] for each in target.free_noise(values)]
    found: list[Array | None] = []
    bins, points = target.data.bins, target.data.points
    for slack in (None if bins is None else bins.slack, None if points is None else points.censored):
        if slack is None:
            found.append(None)
            continue
        whole = np.zeros(len(slack))
        whole[~slack] = noise.pop(0)
        found.append(whole)
    return found[0], found[1]


def _matters(target: Collapsed, guide: Guide) -> bool:
    """Whether a new guide would change the terms."""
    old, chain, data = target.guide, target.model.chain, target.data
    if chain is None:
        return False
    for noise, before in ((guide.bin_noise, old.bin_noise), (guide.point_noise, old.point_noise)):
        if noise is None:
            continue
        typical = float(np.median(np.abs(noise)))
        if before is None or float(np.max(np.abs(noise - before))) > SITE_TOLERANCE * typical:
            return True
    for name in ("bin_echo", "node_echo", "point_echo"):
        echo, before = getattr(guide, name), getattr(old, name)
        # Compliance and moduli may trade places where the force stays.
        if echo is not None and (
            before is None or float(np.mean(np.abs(echo / before - 1.0))) > ECHO_TOLERANCE
        ):
            return True
    signs = any(item is not None and bool(np.any(item < 0.0)) for item in (guide.bins, guide.points))
    slopes = data.points is not None and bool(np.any(data.points.kind == FREE))
    slopes &= not target.model.coordinates_sampled
    if not (chain.uses_force or signs or slopes or GROWTH in target.model.names):
        return False
    setting = chain.setting
    tolerance = GUIDE_TOLERANCE * (setting.force_sd or 0.003 * setting.force_scale)
    pairs = [(guide.bins, old.bins), (guide.nodes, old.nodes), (guide.points, old.points)]
    return any(
        new is not None and (before is None or float(np.max(np.abs(new - before))) > tolerance)
        for new, before in pairs
    )


def predict_force(model: Model, values: dict[str, Array], eta: Array, readings: Readings) -> Array:
    """Force (B, n), N, with the smooth remainder, for values (B, 1) and coordinates η (B, k)."""
    assert model.chain is not None
    p, q, _ = model.linear_sizes
    force = model.chain.force(values, eta[:, :p], readings)
    if model.remainder is not None:
        force = force + values[SMOOTH] * (eta[:, p : p + q] @ model.remainder.columns(readings).T)
    return force
