"""A model: the chain, the remainder, the noise and the tensile part of one declared simulation.

Everything else in the package sees a model through its parameters with their priors, and through the
force (or stress) it gives.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mpam_calib.errors import InputError
from mpam_calib.model.chain import Chain
from mpam_calib.model.moduli import Law, ModuliBlock
from mpam_calib.model.noise import correlated_noise_parameters, white_noise_parameter
from mpam_calib.model.priors import LogNormal, Parameter
from mpam_calib.model.reference import (
    force_scale,
    geometric_contraction,
    reference_shape,
    rest_of,
)
from mpam_calib.model.remainder import Remainder, remainder_parameters
from mpam_calib.model.state import Setting
from mpam_calib.model.tensile import TensileModel
from mpam_calib.physics.statics import modulus_columns
from mpam_calib.specimen.declaration import Simulation
from mpam_calib.specimen.recording import Loops, Specimen

Array = NDArray[np.float64]

CONTRACTION_SD = "contraction_sd"


@dataclass(frozen=True)
class Options:
    """What may be left out of a model (for comparison, or to meet an exact reference)."""

    correlated_noise: bool = True
    remainder: bool = True
    nuisances: bool = True


@dataclass(frozen=True)
class MaterialPosterior:
    """Moduli as another run left them: mean (order,) and covariance (order, order), Pa."""

    mean: Array
    covariance: Array
    strain_range: tuple[float, float]
    convention: str


@dataclass(frozen=True)
class Model:
    """One declared simulation, ready to be calibrated: see the module's docstring.

    ``chain`` is None for a specimen with only a tensile test, ``tensile`` where there is no such
    test; ``remainder`` None where it is left out.
    """

    setting: Setting | None
    chain: Chain | None
    moduli: ModuliBlock | None
    tensile: TensileModel | None
    remainder: Remainder | None
    stroke_time: float | None
    extra: tuple[Parameter, ...]
    options: Options
    limits: tuple[float, float] = (0.0, 0.0)
    """Strain range of the tensile data behind the moduli (0, 0: none)."""

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Everything that is sampled, in the order of the sampler's coordinates."""
        return (*(self.chain.parameters if self.chain else ()), *self.extra)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the sampled parameters."""
        return tuple(parameter.name for parameter in self.parameters)

    def values(self, u: Array) -> dict[str, Array]:
        """SI values (B, 1) by name, of sampler coordinates u (B, d)."""
        return {p.name: p.prior.from_normal(u[:, i : i + 1]) for i, p in enumerate(self.parameters)}

    def coordinates(self, values: Mapping[str, Array]) -> Array:
        """Sampler coordinates (B, d) of SI values (B, 1)."""
        return np.concatenate([p.prior.to_normal(values[p.name]) for p in self.parameters], axis=1)

    @property
    def linear_sizes(self) -> tuple[int, int, int]:
        """Coordinates of the moduli, of the muscle's remainder, of the tensile remainder."""
        tensile = 0
        if self.tensile is not None and self.options.remainder:
            tensile = self.tensile.remainder(np.zeros(1)).shape[1]
        return (
            self.moduli.size if self.moduli else 0,
            self.remainder.size if self.remainder else 0,
            tensile,
        )


def build_setting(specimen: Specimen) -> Setting:
    """The setting of a specimen with a declared geometry."""
    geometry = specimen.geometry
    assert geometry is not None  # reading refuses muscle data without it
    strokes = [geometric_contraction(geometry) * geometry.L0]
    if specimen.loops is not None:
        strokes = [float(np.max(np.abs(specimen.loops.displacement_m)))]
    elif specimen.force_map is not None:
        strokes = [float(np.max(np.abs(specimen.force_map.contraction))) * geometry.L0]
    sensors = specimen.sensors
    return Setting(
        simulation=specimen.simulation,
        geometry=geometry,
        braid=specimen.braid,
        levels=specimen.levels_Pa,
        stroke=max(strokes) or geometry.L0 * geometric_contraction(geometry),
        force_scale=force_scale(geometry, specimen.levels_Pa),
        force_sd=sensors.force_sd_N,
        pressure_bias_sd=sensors.pressure_bias_sd,
        pulls_at=_pulls_at(specimen),
    )


PULL_SHARE = 0.02
"""A muscle that shows this share of its greatest force pulls."""


def _pulls_at(specimen: Specimen) -> float:
    """The lowest pressure (Pa) with a clear pull; the top level where nothing pulls."""
    parts = [p for p in (specimen.loops, specimen.force_map, specimen.blocked_force) if p is not None]
    if not parts:
        return float(specimen.levels_Pa[-1])
    force = np.concatenate([part.force_N for part in parts])
    pressure = np.concatenate([part.pressure_Pa for part in parts])
    clear = force > max(PULL_SHARE * float(force.max()), 5.0 * (specimen.sensors.force_sd_N or 0.0))
    if not clear.any():
        return float(specimen.levels_Pa[-1])
    # One stray reading must not decide: the first percentile of the pulling pressures.
    return float(np.quantile(pressure[clear], 0.01))


def build_model(
    specimen: Specimen, options: Options | None = None, material: MaterialPosterior | None = None
) -> Model:
    """The model that a specimen declares.

    ``material`` is the posterior that ``moduli = "run:..."`` names, already read.
    """
    options = options or Options()
    simulation = specimen.simulation
    tensile = _tensile_model(specimen)
    if specimen.geometry is None or not len(specimen.levels_Pa):
        return _material_model(specimen, tensile, options)
    setting = build_setting(specimen)
    moduli = _moduli(setting, simulation, tensile, material)
    chain = Chain(setting, moduli, options.nuisances)
    extra = [white_noise_parameter(setting)]
    stroke_time = _stroke_time(specimen.loops) if specimen.loops is not None else None
    if stroke_time is not None and options.correlated_noise:
        extra += correlated_noise_parameters(setting, stroke_time)
    if specimen.free_contraction is not None:
        extra.append(
            Parameter(CONTRACTION_SD, LogNormal(0.003, 0.7), "noise of one contraction reading", "", "")
        )
    remainder = None
    if options.remainder:
        extra += remainder_parameters(setting, strokes=stroke_time is not None)
        remainder = Remainder.build(setting, _has_branches(specimen))
    used = tensile if simulation.moduli == "tensile" else None
    if used is not None:
        extra += used.parameters() if options.remainder else used.parameters()[:1]
    limits = (used.low, used.high) if used else material.strain_range if material else (0.0, 0.0)
    return Model(setting, chain, moduli, used, remainder, stroke_time, tuple(extra), options, limits)


def _material_model(specimen: Specimen, tensile: TensileModel | None, options: Options) -> Model:
    if tensile is None:
        raise InputError(specimen.folder / "specimen.toml", "no data files", "at least one under [files]")
    law = Law("constant", tensile.order, np.zeros(1))
    moduli = ModuliBlock(law, tensile.scale, grid=(np.zeros(1), tensile.grid()))
    extra = tensile.parameters() if options.remainder else tensile.parameters()[:1]
    return Model(None, None, moduli, tensile, None, None, extra, options, (tensile.low, tensile.high))


def _tensile_model(specimen: Specimen) -> TensileModel | None:
    if specimen.tensile is None:
        return None
    strain = specimen.tensile.strain
    low, high = specimen.fit.tensile_strain or (max(float(strain.min()), 0.0), float(strain.max()))
    simulation = specimen.simulation
    return TensileModel(low, high, simulation.order, simulation.strain)


def _moduli(
    setting: Setting, simulation: Simulation, tensile: TensileModel | None, material: MaterialPosterior | None
) -> ModuliBlock:
    """The moduli's block with the prior that the declaration asks for."""
    if simulation.moduli == "tensile" and simulation.E_Pa is not None:
        mean = np.asarray(simulation.E_Pa, dtype=np.float64)
        law = Law("constant", len(mean), setting.levels)
        # One common factor on all moduli, with the declared relative sd.
        sd = simulation.E_rel_sd or 0.0
        return ModuliBlock(law, 0.0, mean=mean, root=(sd * mean)[:, None])
    if material is not None:
        law = Law("constant", len(material.mean), setting.levels)
        return ModuliBlock(
            law,
            0.0,
            mean=material.mean,
            root=np.asarray(np.linalg.cholesky(material.covariance), dtype=np.float64),
        )
    if simulation.moduli == "tensile" and tensile is not None:
        law = Law("constant", tensile.order, setting.levels)
        return ModuliBlock(law, tensile.scale, grid=(np.zeros(1), tensile.grid()))
    shape = reference_shape(setting.geometry, simulation.kinematics)
    columns = modulus_columns(shape, rest_of(setting.geometry), simulation.strain, simulation.order)
    columns = columns.reshape(-1, simulation.order)
    law = Law(simulation.law, simulation.order, setting.levels)
    return ModuliBlock(law, setting.force_scale, grid=(setting.levels, columns))


def with_simulation(specimen: Specimen, simulation: Simulation) -> Specimen:
    """The same recordings under another declared simulation."""
    return replace(specimen, simulation=simulation)


def _has_branches(specimen: Specimen) -> bool:
    parts = (specimen.loops, specimen.force_map)
    return any(part is not None and bool(np.any(np.abs(part.branch) == 1)) for part in parts)


def _stroke_time(loops: Loops) -> float:
    """Median duration of a stroke, s."""
    starts = np.flatnonzero(np.diff(loops.stroke, prepend=loops.stroke[0] - 1))
    ends = np.append(starts[1:], len(loops.stroke)) - 1
    return float(np.median(np.maximum(loops.time_s[ends] - loops.time_s[starts], 1e-3)))
