"""Sentences of the reports: what was simulated, what was left aside, whether the calculation settled."""

from __future__ import annotations

import math

import numpy as np

from mpam_calib.criticism.data.rows import telling_points, telling_strokes
from mpam_calib.posterior.chains.convergence import RHAT_LIMIT
from mpam_calib.posterior.likelihood.points import gather_points
from mpam_calib.report.view import Convergence
from mpam_calib.specimen.declaration import Simulation
from mpam_calib.specimen.recording import Specimen

_KINEMATICS = {
    "inextensible_braid": "the braid's strands keep their length and the bladder its volume",
    "constant_thickness": "the radius follows a bladder of constant volume and constant thickness",
}
_MEASURE = {"engineering": "engineering strain", "stretch": "stretch"}
_FRICTION = {
    "coulomb": "friction in proportion to the force (Coulomb)",
    "strand": "friction between the braid's strands",
    "none": "no friction",
}
_LAW = {
    "constant": "the same at every pressure",
    "linear": "linear in pressure",
    "exponential": "a sum of two exponentials of pressure with shared rates",
    "exponential_each": "a sum of two exponentials of pressure, with rates for each modulus",
    "free": "free at each pressure level",
}


def simulation_sentence(simulation: Simulation) -> str:
    """The declared simulation of a muscle in one sentence."""
    each = simulation.friction_by_pressure and simulation.friction != "none"
    per_level = ", one value per level" if each else ""
    if simulation.moduli == "tensile" and simulation.E_Pa is not None:
        moduli = _declared_moduli(simulation.E_Pa, simulation.E_rel_sd or 0.0)
    elif simulation.moduli == "tensile":
        moduli = "the bladder's stiffness comes from a tensile test"
    elif simulation.moduli.startswith("run:"):
        moduli = f"the bladder's stiffness comes from the run {simulation.moduli.removeprefix('run:')}"
    else:
        moduli = (
            f"the bladder's stress is a polynomial of order {simulation.order} in "
            f"{_MEASURE[simulation.strain]}, its moduli {_LAW[simulation.law]}"
        )
    effects = ", ".join(simulation.effects) or "none"
    return (
        f"The simulation: {_KINEMATICS[simulation.kinematics]}; {moduli}; {_FRICTION[simulation.friction]}"
        f"{per_level}; further effects: {effects}."
    )


def _declared_moduli(E_Pa: tuple[float, ...], sd: float) -> str:
    listed = ", ".join(f"E_{k} = {1e-3 * E:.4g} kPa".replace("-", "−") for k, E in enumerate(E_Pa, start=1))
    known = "taken as exact" if sd == 0.0 else f"known but for one common factor of sd {100 * sd:.3g} %"
    return f"the bladder's moduli are declared: {listed}, {known}"


def material_sentence(simulation: Simulation) -> str:
    """The law of a bladder material in one sentence."""
    return f"The law: stress is a polynomial of order {simulation.order} in {_MEASURE[simulation.strain]}."


def left_aside(specimen: Specimen, what: str) -> list[str]:
    """What was recorded, or declared of the noise, and this ``what`` (ranking, search) does not use."""
    found = []
    if specimen.loops is not None:
        used, strokes = len(telling_strokes(specimen.loops)), len(np.unique(specimen.loops.stroke))
        if used < strokes:
            found.append(
                f"This {what} looks at {used} of {strokes} strokes: of each level's cycles the first, the "
                "last and some between."
            )
    if (points := gather_points(specimen)) is not None:
        looked_at, usable = telling_points(points)
        if len(looked_at) < usable:
            found.append(
                f"This {what} looks at {len(looked_at)} of {usable} static readings, evenly along the "
                "pressure."
            )
    if specimen.noise.robust:
        found.append(
            f"Heavy tails of the noise ([noise] robust) are not part of this {what}: bursts are left out "
            "where the noise is measured, but weigh on the evidence like any reading."
        )
    if specimen.noise.growth and specimen.loops is None:
        found.append(
            f"Growth of the noise with the force ([noise] growth) is not part of this {what}: static "
            "readings alone do not tell it before a model is fitted."
        )
    return found


def convergence_sentences(c: Convergence) -> str:
    """Whether the calculation settled, for a reader who has never run one; paragraphs."""
    ess = c.ess_min
    settled = c.converged and c.rhat_max <= RHAT_LIMIT and ess >= c.ess_wanted
    answer = "Yes." if settled else "No: treat every number on this page as provisional."
    start = (
        f"{answer} The answer is a cloud of {c.draws:,} plausible parameter sets. {c.ensembles} groups of "
        f"{c.walkers} walkers began far apart and walked {c.steps:,} steps without knowing of each "
        "other. If they end in the same place, the answer does not depend on where they began."
    )
    agreement = (
        f"Agreement (R-hat): {c.rhat_max:.3f} at worst, for {c.rhat_parameter}; 1 is perfect, {RHAT_LIMIT} "
        f"is the limit. Sample size (ESS): the cloud is worth {ess:,.0f} independent draws at worst; "
        f"{c.ess_wanted:.0f} is the least."
    )
    if ess > 0 and math.isfinite(ess):
        agreement += (
            f" Sampling therefore moves a mean by about {100 / math.sqrt(ess):.1f} % of its own sd, which "
            "the printed digits do not show."
        )
    if math.isfinite(c.acceptance):
        agreement += f" {100 * c.acceptance:.0f} % of the proposed steps were taken."
    paragraphs = [start, agreement]
    if c.modes > 1:
        paragraphs.append(
            f"They found {c.modes} separate explanations; more data, not more steps, must choose."
        )
    elif settled:
        paragraphs.append("All of them found the same explanation of the data.")
    return "\n\n".join(paragraphs)
