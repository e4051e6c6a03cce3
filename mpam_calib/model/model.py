"""A model: the chain, the remainder, the noise and the tensile part of one declared simulation.

Everything else in the package sees a model through its parameters with their priors, and through the
force (or stress) it gives.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.blueprint import Blueprint
from mpam_calib.model.chain import Chain
from mpam_calib.model.moduli import Law, ModuliBlock
from mpam_calib.model.noise import (
    correlated_noise_parameters,
    declared_noise_parameters,
    white_noise_parameter,
)
from mpam_calib.model.priors import LogNormal, Normal, Parameter
from mpam_calib.model.reference import reference_shape, rest_of
from mpam_calib.model.remainder import Remainder, remainder_parameters
from mpam_calib.model.state import Setting
from mpam_calib.model.tensile import TensileModel
from mpam_calib.physics.statics import modulus_columns

Array = NDArray[np.float64]

CONTRACTION_SD = "contraction_sd"
COORDINATE = "modulus_coordinate_"
"""What the names of the moduli's coordinates begin with where they are sampled."""


@dataclass(frozen=True)
class Model:
    """One declared simulation, ready to be calibrated: see the module's docstring.

    ``setting`` and ``chain`` are None for a specimen with only a tensile test, ``tensile`` where no
    such test is part of the model, ``remainder`` where it is left out. ``coordinates_sampled`` are the
    moduli's where free contractions alone tell how a curve falls: such readings are not linear in them.
    """

    blueprint: Blueprint
    setting: Setting | None
    chain: Chain | None
    moduli: ModuliBlock | None
    tensile: TensileModel | None
    remainder: Remainder | None
    extra: tuple[Parameter, ...]
    coordinates_sampled: tuple[Parameter, ...] = ()

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Everything that is sampled, in the order of the sampler's coordinates."""
        own = self.chain.parameters if self.chain else ()
        return (*own, *self.extra, *self.coordinates_sampled)

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

    def moduli_of(self, values: Mapping[str, Array]) -> Array | None:
        """The moduli's coordinates (B, p) where they are sampled."""
        if not self.coordinates_sampled:
            return None
        return np.concatenate([values[p.name] for p in self.coordinates_sampled], axis=1)

    @cached_property
    def linear_sizes(self) -> tuple[int, int, int]:
        """Coordinates of the moduli, of the muscle's remainder, of the tensile remainder."""
        tensile = self.tensile is not None and self.blueprint.options.remainder
        return (
            self.moduli.size if self.moduli else 0,
            self.remainder.size if self.remainder else 0,
            self.tensile.remainder(np.zeros(1)).shape[1] if self.tensile is not None and tensile else 0,
        )


def build_model(blueprint: Blueprint) -> Model:
    """The model that a blueprint describes."""
    setting = blueprint.setting()
    options, simulation = blueprint.options, blueprint.simulation
    tensile = None
    if (
        blueprint.tensile_range is not None
        and blueprint.material is None
        and (setting is None or simulation.moduli == "tensile")
    ):
        tensile = TensileModel(
            *blueprint.tensile_range, simulation.order, simulation.strain, blueprint.tensile_stiffness
        )
    moduli = _moduli(blueprint, setting, tensile)
    extra: list[Parameter] = []
    remainder = None
    if setting is not None:
        extra.append(white_noise_parameter(setting))
        if blueprint.stroke_time is not None and options.correlated_noise:
            extra += correlated_noise_parameters(setting, blueprint.stroke_time, blueprint.reading_time)
        extra += declared_noise_parameters(blueprint.noise)
        if blueprint.free_contraction:
            prior = LogNormal(0.003, 0.7)
            extra.append(Parameter(CONTRACTION_SD, prior, "noise of one contraction reading", "", ""))
        if options.remainder:
            extra += remainder_parameters(setting, strokes=blueprint.stroke_time is not None)
            remainder = Remainder.build(setting, blueprint.branches)
    if tensile is not None:
        extra += tensile.parameters() if options.remainder else tensile.parameters()[:1]
    chain = None if setting is None else Chain(setting, moduli, options.nuisances)
    sampled: tuple[Parameter, ...] = ()
    if blueprint.free_contraction and not blueprint.curves and simulation.order > 1 and tensile is None:
        sampled = _coordinates(0 if moduli is None or blueprint.material is not None else moduli.size)
    return Model(blueprint, setting, chain, moduli, tensile, remainder, tuple(extra), sampled)


def _coordinates(size: int) -> tuple[Parameter, ...]:
    """Coordinates of moduli, each a standard normal."""
    meaning = "coordinate of the moduli"
    return tuple(Parameter(f"{COORDINATE}{i + 1}", Normal(0.0, 1.0), meaning, "", "") for i in range(size))


def _root(covariance: Array) -> Array:
    """A square root (k, k) of a covariance, whose moduli may move as one (then it is singular)."""
    sd = np.sqrt(np.diagonal(covariance))
    scale = np.where(sd > 0.0, sd, 1.0)
    power, axes = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray(scale[:, None] * axes * np.sqrt(np.maximum(power, 0.0)))


def _moduli(blueprint: Blueprint, setting: Setting | None, tensile: TensileModel | None) -> ModuliBlock:
    """The moduli's block with the prior that the declaration asks for."""
    simulation, material = blueprint.simulation, blueprint.material
    levels = np.array(blueprint.levels or (0.0,))
    if simulation.moduli == "tensile" and simulation.E_Pa is not None:
        mean = np.asarray(simulation.E_Pa, dtype=np.float64)
        # One common factor on all moduli, with the declared relative sd.
        root = ((simulation.E_rel_sd or 0.0) * mean)[:, None]
        return ModuliBlock(Law("constant", len(mean), levels), 0.0, mean=mean, root=root)
    if material is not None:
        mean = np.array(material.mean)
        return ModuliBlock(
            Law("constant", len(mean), levels), 0.0, mean=mean, root=_root(np.array(material.covariance))
        )
    if tensile is not None:
        law = Law("constant", tensile.order, levels)
        return ModuliBlock(law, tensile.scale, grid=(np.zeros(1), tensile.grid()))
    assert setting is not None  # without a tensile test there is a muscle
    shape = reference_shape(setting.geometry, simulation.kinematics)
    columns = modulus_columns(shape, rest_of(setting.geometry), simulation.strain, simulation.order)
    law = Law(simulation.law, simulation.order, levels)
    grid = (levels, columns.reshape(-1, simulation.order))
    return ModuliBlock(law, setting.force_scale, grid=grid)
