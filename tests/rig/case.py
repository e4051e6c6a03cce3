"""One synthetic test: base muscle, protocol, hidden effects, perhaps an outside structure; and its files."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .bending import bending
from .chain import Sized, force_of
from .effects import form
from .effects.friction_stage import reference_speed
from .muscle import Array, Muscle
from .nuisance import differences, left_over, nuisance_of
from .outside import Outside, disturb
from .protocol import Protocol, Rows, noise_sd, record_rows, sensor_noise


@dataclass(frozen=True)
class Hidden:
    """An effect hidden in the data: its id, form and size in the contract's unit."""

    id: str
    form: str
    size: float


@dataclass(frozen=True)
class Case:
    """A declared synthetic test; everything else follows from it and its seed."""

    name: str
    seed: int
    group: str
    muscle: Muscle
    protocol: Protocol
    hidden: tuple[Hidden, ...] = ()
    outside: Outside | None = None
    geometry_sd: tuple[tuple[str, float], ...] = ()
    bent: int = 0
    """Which way the effects' forms are bent at random (see bending.py); 0: not at all."""

    @property
    def ids(self) -> tuple[str, ...]:
        return tuple(sorted(h.id for h in self.hidden))

    @property
    def effects(self) -> list[Sized]:
        return [(form(h.id, h.form), h.size) for h in self.hidden]


@dataclass(frozen=True)
class Recording:
    """Rows, recorded force, noise-free force with everything hidden, and the declared simulation's [N]."""

    case: Case
    rows: Rows
    force: Array
    true_force: Array
    null_force: Array


def record(case: Case) -> Recording:
    """Carry out the test."""
    rows = record_rows(case.protocol, case.muscle, case.seed)
    null = force_of(case.muscle, rows)
    true = force_of(case.muscle, rows, case.effects, seed=case.seed) if case.hidden else null
    if case.bent:
        true = true + bending(case.muscle, rows, case.effects, case.seed, case.bent)
    if case.protocol.floor_N is not None:
        true, null = np.maximum(true, case.protocol.floor_N), np.maximum(null, case.protocol.floor_N)
    noise = sensor_noise(case.protocol, rows, case.seed)
    force = true + noise
    if case.outside is not None:
        force, true = disturb(true, noise, rows, case.outside, case.seed)
    return Recording(case, rows, force, true, null)


def signatures(case: Case, rows: Rows) -> list[tuple[float, float]]:
    """Per hidden effect: rms [N] of its change of the force, and of what the free numbers leave of it."""
    noise = noise_sd(case.protocol)
    nuisance = nuisance_of(case.muscle, rows, noise)
    null = force_of(case.muscle, rows)
    columns = differences(nuisance, np.zeros(nuisance.count), null, lambda m: force_of(m, rows))
    out = []
    for effect in case.effects:
        change = force_of(case.muscle, rows, [effect], seed=case.seed) - null
        left = left_over(change, columns, nuisance, noise)
        out.append((float(np.sqrt(np.mean(change**2))), float(np.sqrt(np.mean(left**2)))))
    return out


def truth_of(recording: Recording) -> dict[str, Any]:
    """What is hidden, as plain values."""
    case, p, sim = recording.case, recording.case.protocol, recording.case.muscle.simulation
    hidden = []
    for (f, size), (rms, left) in zip(case.effects, signatures(case, recording.rows), strict=True):
        hidden.append(
            {
                "id": f.id,
                "form": f.name,
                "shared": f.shared,
                "parameter": f.parameter,
                "value": size,
                "signature_rms_N": rms,
                "signature_left_rms_N": left,
            }
        )
    return {
        "name": case.name,
        "seed": case.seed,
        "group": case.group,
        "ids": list(case.ids),
        "hidden": hidden,
        "outside": asdict(case.outside) if case.outside else None,
        "noise": {
            "white_N": p.noise_N,
            "correlated_N": p.correlated_N,
            "correlation_s": p.correlation_s,
            "total_N": noise_sd(p),
        },
        "friction": sim.friction,
        "friction_value": list(sim.friction_value),
        "law": sim.law.name,
        "moduli": [list(row) for row in sim.law.constants],
        "reference_speed_mm_s": reference_speed(recording.rows),
        "true_force_N": [round(float(v), 6) for v in recording.true_force],
        "null_force_N": [round(float(v), 6) for v in recording.null_force],
    }


def specimen_toml(case: Case, files: dict[str, str]) -> str:
    """The specimen file: what is declared, without anything hidden."""
    m, g, sim, p = case.muscle, case.muscle.geometry, case.muscle.simulation, case.protocol
    lines = [
        "[specimen]",
        f'name = "{case.name}"',
        'bladder_material = "silicone rubber"',
        "",
        "[geometry]",
        f"L0_mm = {g.L0_mm!r}",
        f"R0_mm = {g.R0_mm!r}",
        f"t0_mm = {g.t0_mm!r}",
        f"alpha0_deg = {g.alpha0_deg!r}",
        "",
    ]
    if case.geometry_sd:
        lines += ["[geometry.sd]", *(f"{k} = {v!r}" for k, v in case.geometry_sd), ""]
    if m.braid is not None:
        lines += [
            "[braid]",
            f"E_br_GPa = {m.braid.E_br_GPa!r}",
            f"nu_s = {m.braid.nu_s!r}",
            f"R_br_mm = {m.braid.R_br_mm!r}",
            f"n = {m.braid.n}",
            "",
        ]
    lines += ["[sensors]", f"force_sd_N = {float(f'{noise_sd(p):.3g}')!r}"]
    if p.floor_N is not None:
        lines += [f"force_floor_N = {float(p.floor_N)!r}"]
    lines += [
        "",
        "[files]",
        *(f'{k} = "{v}"' for k, v in files.items()),
        "",
        "[simulation]",
        f'kinematics = "{sim.kinematics}"',
        f'strain = "{sim.strain}"',
        f'friction = "{sim.friction}"',
        f"friction_by_pressure = {str(sim.friction_by_pressure).lower()}",
        "effects = []",
        f'moduli = "{sim.source}"',
    ]
    if sim.source == "tensile":
        lines += [
            f"E_Pa = [{', '.join(repr(float(e)) for e in sim.declared_E_Pa)}]",
            f"E_rel_sd = {sim.E_rel_sd!r}",
        ]
    else:
        lines += [f"order = {sim.law.order}", f'law = "{sim.law.name}"']
    return "\n".join(lines) + "\n"


def loops_csv(recording: Recording) -> str:
    """The recording as CSV."""
    rows, optional = recording.rows, recording.case.protocol.branch_column
    names = "time_s,pressure_kPa,displacement_mm,force_N,setpoint_kPa" + (",cycle,branch" if optional else "")
    out = [names]
    for i in range(rows.count):
        line = (
            f"{rows.time[i]:.4f},{rows.reading[i]:.4f},{rows.displacement[i]:.6f},"
            f"{recording.force[i]:.6f},{rows.setpoint[i]:.6g}"
        )
        if optional:
            line += f",{int(rows.cycle[i])},{'loading' if rows.direction[i] > 0 else 'unloading'}"
        out.append(line)
    return "\n".join(out) + "\n"


def write_case(case: Case, folder: Path, truth: Path | None = None) -> dict[str, Any]:
    """Write specimen.toml and loops.csv into `folder`; return the truth, and write it to `truth` if given.

    `truth` must lie outside the folder: whoever reads the specimen must not find the answer beside it.
    """
    folder = Path(folder)
    if truth is not None and folder.resolve() in Path(truth).resolve().parents:
        raise ValueError("the truth must lie outside the specimen folder")
    recording = record(case)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "specimen.toml").write_text(specimen_toml(case, {"loops": "loops.csv"}), encoding="utf-8")
    (folder / "loops.csv").write_text(loops_csv(recording), encoding="utf-8")
    answer = truth_of(recording)
    if truth is not None:
        Path(truth).write_text(json.dumps(answer, sort_keys=True) + "\n", encoding="utf-8")
    return answer
