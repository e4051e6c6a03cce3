"""What a specimen folder declares: the tables of ``specimen.toml`` as validated models, in SI units.

Field names are those of the file, so that a message can quote them; the ``*_SI`` properties of
each table convert once, here.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from mpam_calib.units import DEG, GPA, KPA, MM

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False, strict=True)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False, strict=True)]
Finite = Annotated[float, Field(allow_inf_nan=False, strict=True)]
Angle = Annotated[float, Field(gt=0, lt=90, strict=True)]

Kinematics = Literal["inextensible_braid", "constant_thickness"]
Strain = Literal["engineering", "stretch"]
Friction = Literal["coulomb", "strand", "none"]
Law = Literal["constant", "linear", "exponential", "exponential_each", "free"]


class Table(BaseModel):
    """A TOML table: unknown keys are refused, values are not coerced from text."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class GeometrySd(Table):
    """1-sigma of geometry values that are themselves uncertain (0: known)."""

    L0_mm: NonNegative = 0.0
    R0_mm: NonNegative = 0.0
    t0_mm: NonNegative = 0.0
    alpha0_deg: NonNegative = 0.0


class Geometry(Table):
    """Length, outer radius, wall and braid angle (from the hoop direction) at rest."""

    L0_mm: Positive
    R0_mm: Positive
    t0_mm: Positive
    alpha0_deg: Angle
    sd: GeometrySd = GeometrySd()

    @model_validator(mode="after")
    def _wall_inside_radius(self) -> Geometry:
        if self.t0_mm >= self.R0_mm:
            raise ValueError(f"t0_mm = {self.t0_mm:g}|a wall thinner than R0_mm = {self.R0_mm:g}")
        return self

    @property
    def L0(self) -> float:
        """Length at rest, m."""
        return self.L0_mm * MM

    @property
    def R0(self) -> float:
        """Outer radius at rest, m."""
        return self.R0_mm * MM

    @property
    def t0(self) -> float:
        """Wall thickness at rest, m."""
        return self.t0_mm * MM

    @property
    def alpha0(self) -> float:
        """Braid angle at rest, rad, from the hoop direction."""
        return self.alpha0_deg * DEG


class Braid(Table):
    """The braid's strands."""

    E_br_GPa: Positive
    nu_s: Annotated[float, Field(ge=0, le=0.5, strict=True)]
    R_br_mm: Positive
    n: Annotated[int, Field(gt=0, strict=True)]

    @property
    def E_br(self) -> float:
        """Young's modulus of a strand, Pa."""
        return self.E_br_GPa * GPA

    @property
    def R_br(self) -> float:
        """Radius of a strand, m."""
        return self.R_br_mm * MM


class Sensors(Table):
    """What is known of the instruments (all optional)."""

    force_sd_N: Positive | None = None
    pressure_bias_sd_kPa: NonNegative = 0.0
    force_floor_N: Finite | None = None

    @property
    def pressure_bias_sd(self) -> float:
        """1-sigma of the gauge's constant offset, Pa."""
        return self.pressure_bias_sd_kPa * KPA


class Simulation(Table):
    """The model to calibrate and to criticise: a declared value."""

    kinematics: Kinematics = "inextensible_braid"
    strain: Strain = "engineering"
    friction: Friction = "coulomb"
    friction_by_pressure: bool = False
    effects: tuple[str, ...] = ()
    moduli: str = "loops"
    order: Annotated[int, Field(ge=1, le=8, strict=True)] = 4
    law: Law = "linear"
    E_Pa: tuple[Finite, ...] | None = None
    E_rel_sd: NonNegative | None = None


class Fit(Table):
    """Choices of the fit that are not the simulation's."""

    tensile_strain: tuple[Finite, Finite] | None = None


class Csv(Table):
    """How the CSV files are written, where detection should not decide."""

    delimiter: str | None = None
    decimal: Literal[".", ","] | None = None
    skip_rows: Annotated[int, Field(ge=0, strict=True)] | None = None
