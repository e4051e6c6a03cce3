"""What a specimen folder declares: the tables of ``specimen.toml`` as validated models, in SI units.

Field names are those of the file, so that a message can quote them; the ``*_SI`` properties of
each table convert once, here.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, StrictBool, field_validator, model_validator

from mpam_calib.units import DEG, GPA, KPA, MM

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False, strict=True)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False, strict=True)]
Finite = Annotated[float, Field(allow_inf_nan=False, strict=True)]
Angle = Annotated[float, Field(gt=0, lt=90, strict=True)]

Kinematics = Literal["inextensible_braid", "constant_thickness"]
Strain = Literal["engineering", "stretch"]
Friction = Literal["coulomb", "strand", "none"]
Law = Literal["constant", "linear", "exponential", "exponential_each", "free"]
FileKind = Literal["loops", "force_map", "blocked_force", "free_contraction", "tensile"]

E_REL_SD = 0.1
"""Relative 1-sigma of the factor common to declared moduli, where the file gives none."""


class Table(BaseModel):
    """A TOML table: unknown keys are refused, values are not coerced from text."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Identity(Table):
    """What the specimen is called and what its bladder is made of."""

    name: Annotated[str, Field(min_length=1)]
    bladder_material: str = ""


class GeometrySd(Table):
    """1-sigma of geometry values that are themselves uncertain (0: known)."""

    L0_mm: NonNegative = 0.0
    R0_mm: NonNegative = 0.0
    t0_mm: NonNegative = 0.0
    alpha0_deg: NonNegative = 0.0

    @property
    def alpha0(self) -> float:
        """1-sigma of the braid angle, rad."""
        return self.alpha0_deg * DEG


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

    @model_validator(mode="after")
    def _sd_below_value(self) -> Geometry:
        for name in ("L0_mm", "R0_mm", "t0_mm", "alpha0_deg"):
            sd, value = getattr(self.sd, name), getattr(self, name)
            if sd >= value:
                raise ValueError(f"sd of {name} = {sd:g}|one sigma below {name} = {value:g} itself")
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


class Noise(Table):
    """What the load cell's noise may do beyond being white and correlated, and of one size."""

    growth: StrictBool = False
    """Whether it may grow with the force."""
    robust: StrictBool = False
    """Whether it may have heavy tails, so that bursts and knocks do not move the curve."""


class Simulation(Table):
    """The model to calibrate and to criticise: a declared value."""

    kinematics: Kinematics = "inextensible_braid"
    strain: Strain = "engineering"
    friction: Friction = "coulomb"
    friction_by_pressure: StrictBool = False
    effects: tuple[str, ...] = ()
    moduli: str = "loops"
    order: Annotated[int, Field(ge=1, le=8, strict=True)] = 4
    law: Law = "linear"
    E_Pa: Annotated[tuple[Finite, ...], Field(min_length=1, max_length=8)] | None = None
    E_rel_sd: NonNegative | None = None

    @property
    def effect_ids(self) -> tuple[str, ...]:
        """Ids of the declared effects, without their forms (``id:form``)."""
        return tuple(effect.partition(":")[0] for effect in self.effects)

    @property
    def effects_within(self) -> dict[str, str]:
        """Effects that the friction or the kinematics are already, and the words that declare these."""
        within = (
            {} if self.friction == "none" else {f"{self.friction}_friction": f'friction = "{self.friction}"'}
        )
        if self.kinematics == "inextensible_braid":
            within["braid_kinematics"] = 'kinematics = "inextensible_braid"'
        return within

    @field_validator("moduli")
    @classmethod
    def _moduli_word(cls, value: str) -> str:
        if value in ("loops", "tensile") or (value.startswith("run:") and value[4:].strip()):
            return value
        raise ValueError(f'"{value}"|one of "loops", "tensile", "run:PATH"')


class Fit(Table):
    """Choices of the fit that are not the simulation's."""

    tensile_strain: tuple[Finite, Finite] | None = None

    @field_validator("tensile_strain")
    @classmethod
    def _rising(cls, value: tuple[float, float] | None) -> tuple[float, float] | None:
        if value is not None and value[0] >= value[1]:
            raise ValueError(f"[{value[0]:g}, {value[1]:g}]|the lower strain before the higher one")
        if value is not None and value[0] <= -1.0:
            # At -1 nothing is left of the test piece; bands would go on beyond it.
            raise ValueError(f"[{value[0]:g}, {value[1]:g}]|strains above -1")
        return value


class Csv(Table):
    """How the CSV files are written, where detection should not decide."""

    delimiter: Annotated[str, Field(min_length=1, max_length=1)] | None = None
    decimal: Literal[".", ","] | None = None
    skip_rows: Annotated[int, Field(ge=0, strict=True)] | None = None

    @model_validator(mode="after")
    def _marks_differ(self) -> Csv:
        if self.delimiter is not None and self.delimiter == self.decimal:
            raise ValueError(f'delimiter and decimal both "{self.decimal}"|two different characters')
        return self


class Column(Table):
    """Where a column stands in a rig's own export: value = scale * cell + offset."""

    name: Annotated[str, Field(min_length=1)] | None = None
    scale: Finite = 1.0
    offset: Finite = 0.0

    @model_validator(mode="before")
    @classmethod
    def _plain_name(cls, value: object) -> object:
        return {"name": value} if isinstance(value, str) else value

    @field_validator("scale")
    @classmethod
    def _scale_is_not_zero(cls, value: float) -> float:
        if value == 0.0:
            raise ValueError("0|a factor other than zero")
        return value


Names = Annotated[str, Field(min_length=1)] | Annotated[tuple[str, ...], Field(min_length=1)]


class Files(Table):
    """The data files, each a name or a list of names (one file per pressure, say)."""

    loops: Names | None = None
    force_map: Names | None = None
    blocked_force: Names | None = None
    free_contraction: Names | None = None
    tensile: Names | None = None

    def of(self, kind: FileKind) -> tuple[str, ...]:
        """Names of the files of one kind, in the order given."""
        names = getattr(self, kind)
        if names is None:
            return ()
        return (names,) if isinstance(names, str) else tuple(names)

    @property
    def muscle(self) -> tuple[str, ...]:
        """Names of all files that record the muscle rather than its material."""
        return (*self.of("loops"), *self.of("force_map"), *self.of("blocked_force"),
                *self.of("free_contraction"))  # fmt: skip


class Columns(Table):
    """Maps from the package's column names to a rig's, for each kind of file."""

    loops: dict[str, Column] = {}
    force_map: dict[str, Column] = {}
    blocked_force: dict[str, Column] = {}
    free_contraction: dict[str, Column] = {}
    tensile: dict[str, Column] = {}

    def of(self, kind: FileKind) -> dict[str, Column]:
        """The map of one kind of file."""
        mapping: dict[str, Column] = getattr(self, kind)
        return mapping


class Declaration(Table):
    """The whole of ``specimen.toml``."""

    specimen: Identity
    geometry: Geometry | None = None
    braid: Braid | None = None
    sensors: Sensors = Sensors()
    noise: Noise = Noise()
    files: Files = Files()
    csv: Csv = Csv()
    columns: Columns = Columns()
    simulation: Simulation = Simulation()
    fit: Fit = Fit()
