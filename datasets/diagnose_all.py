"""What the simulations get wrong on the bundled data, as a table (``make diagnose``).

    python datasets/diagnose_all.py OUTPUT.md

The two muscles reconstructed from the thesis are diagnosed twice: as an inextensible braid with the moduli
of the thesis's tensile tests (Table 4.1) and no corrections, and as the thesis's own simulation; the measured
Festo muscles and the pneumatic cylinder as they are declared.
"""

from __future__ import annotations

import csv
import shutil
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mpam_calib.criticism.data.build import build_problem
from mpam_calib.criticism.diagnose import describe, diagnose
from mpam_calib.criticism.selection.held_out import hold_out_each
from mpam_calib.criticism.selection.ranking import fitted
from mpam_calib.criticism.tasks.spread import spread_over
from mpam_calib.model.blueprint import Options, draw_blueprint
from mpam_calib.specimen import read
from mpam_calib.specimen.recording import Specimen

HERE = Path(__file__).resolve().parent
BARE = """
[simulation]
kinematics = "inextensible_braid"
strain = "engineering"
friction = "none"
effects = []
moduli = "tensile"
law = "constant"
E_Pa = [{moduli}]
E_rel_sd = 0.1
order = {order}
"""
MUSCLES = ("mpam1_reconstructed", "mpam2_reconstructed")
LEFT_OUT = """\
Two ways to repair the bare braid, each level predicted from all others (root mean square error and coverage
of 90 % bands). The first is physical: the leading set of corrections beside Table 4.1's tensile moduli, named
or not. The other is the thesis's: a joint linear law of eight moduli, friction at each level and a dead-band,
in stretches and with a constant thickness. The comparison is circular: these loops were computed from moduli
that the thesis fitted to its own data with the second form, so it is right by construction and only its law
of pressure is tested."""
AS_DECLARED = (*MUSCLES, "festo_dmsp10", "festo_dmsp20", "cylinder_zillen")


def bare(name: str, folder: Path) -> Path:
    """A copy of a muscle's specimen that declares an inextensible braid with Table 4.1's moduli."""
    shutil.copytree(HERE / name, folder)
    with (HERE / "thesis_tables" / "table_4_1.csv").open() as file:
        moduli = [row["Value (Pa)"] for row in csv.DictReader(file)]
    text = (HERE / name / "specimen.toml").read_text()
    declared = BARE.format(moduli=", ".join(moduli), order=len(moduli))
    (folder / "specimen.toml").write_text(text[: text.index("[simulation]")] + declared)
    return folder


def row(title: str, content: dict[str, Any]) -> str:
    """One line of the table."""
    causes = []
    for cause in content["causes"]:
        sizes = ", ".join(f"{n} {v['q05']:.3g} to {v['q95']:.3g}" for n, v in cause["parameters"].items())
        causes.append(f"{cause['id']} (p {cause['probability']:.2f}{'; ' + sizes if sizes else ''})")
    others = [" + ".join(a["ids"]) or "nothing" for a in content["alternatives"][:3]]
    held = "–"
    if (gain := content["gain"]) is not None:
        error = f"{gain['rmse_before_N']:.2f} → {gain['rmse_after_N']:.2f} N"
        coverage = f"coverage {gain['coverage90_before']:.2f} → {gain['coverage90_after']:.2f}"
        held = f"{error}; {coverage}; same set in {gain['folds_same_set']} of {gain['folds']}"
    before, after, noise = (content[k] for k in ("misfit_before_N", "misfit_after_N", "noise_N"))
    size = f"{before:.2f} → {after:.2f} (noise {noise:.2f})"
    cells = (title, content["verdict"], "; ".join(causes) or "–", "; ".join(others), size, held)
    return f"| {' | '.join(cells)} |"


class LeftOut(NamedTuple):
    """Root mean square error (N) at all levels, coverage of 90 % bands, and the error between levels."""

    rmse: float
    coverage: float
    between: float

    def __str__(self) -> str:
        return f"{self.rmse:.2f} N, coverage {self.coverage:.2f}; between other levels {self.between:.2f} N"


def left_out(specimen: Specimen) -> LeftOut:
    """How the declared simulation, fitted to all other levels, predicts each level."""
    problem = build_problem(specimen, draw_blueprint(specimen, Options(nuisances=False, remainder=False)))
    with spread_over(problem, 1):
        ranked = fitted(problem, specimen.simulation)
        assert ranked is not None
        levels = hold_out_each(ranked)
    share = levels["rows"] / levels["rows"].sum()
    between = levels[~levels["extrapolated"]]
    return LeftOut(
        float(np.sqrt(np.sum(share * levels["rmse_N"] ** 2))),
        float(np.sum(share * levels["inside90"])),
        float(np.sqrt(np.average(between["rmse_N"] ** 2, weights=between["rows"]))),
    )


def leading(content: dict[str, Any]) -> list[str]:
    """The named set, or else the first of the others."""
    if content["verdict"] == "named" or not content["alternatives"]:
        return [cause["id"] for cause in content["causes"]]
    return list(content["alternatives"][0]["ids"])


def with_effects(specimen: Specimen, effects: list[str]) -> Specimen:
    """The same recordings under a simulation that has these effects."""
    return replace(specimen, simulation=specimen.simulation.model_copy(update={"effects": tuple(effects)}))


def main(target: Path) -> None:
    """Diagnose everything and write the tables."""
    lines = [
        "| data | verdict | causes | other sets, most probable first | misfit (N) | held out |",
        "|---|---|---|---|---|---|",
    ]
    with tempfile.TemporaryDirectory() as place:
        jobs = [(f"{name}, bare braid", bare(name, Path(place) / name)) for name in MUSCLES]
        jobs += [(f"{name}, as declared", HERE / name) for name in AS_DECLARED]
        repaired = []
        for title, folder in jobs:
            print(title, flush=True)
            specimen = read(folder)
            content = describe(diagnose(specimen), 0)
            lines.append(row(title, content))
            if folder.parent != HERE:
                causes = leading(content)
                held = left_out(with_effects(specimen, causes))
                repaired.append(f"- {title} with {' + '.join(causes) or 'nothing'}: {held}.")
    lines += ["", LEFT_OUT, "", *repaired]
    lines += [f"- {name}, eight moduli: {left_out(read(HERE / name))}." for name in MUSCLES]
    target.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
