"""The effects that ship with the package: one file each, registered on import."""

from mpam_calib.model.catalogue import (
    braid_angle,
    braid_kinematics,
    braid_stretch,
    coulomb_friction,
    creep,
    dead_band,
    force_drift,
    length_offset,
    presliding,
    pressure_droop,
    rate_friction,
    rig_compliance,
    strand_friction,
    stress_softening,
    tip_shape,
    wall_pressure,
)

__all__ = [
    "braid_angle",
    "braid_kinematics",
    "braid_stretch",
    "coulomb_friction",
    "creep",
    "dead_band",
    "force_drift",
    "length_offset",
    "presliding",
    "pressure_droop",
    "rate_friction",
    "rig_compliance",
    "strand_friction",
    "stress_softening",
    "tip_shape",
    "wall_pressure",
]
