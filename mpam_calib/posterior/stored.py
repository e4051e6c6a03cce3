"""A posterior on disk: the draws that a calibration leaves, and a finished RUN read back."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpam_calib.arviz_import import import_arviz
from mpam_calib.atomic_files import write_atomically
from mpam_calib.errors import InputError
from mpam_calib.model.blueprint import Blueprint
from mpam_calib.model.model import Model, build_model
from mpam_calib.posterior.draws import Draws, Reported
from mpam_calib.specimen.effect_ids import forms_of_id, known_effect_ids
from mpam_calib.specimen.wording import listed, quoted

Array = NDArray[np.float64]

RUN_FILE = "run.json"
"""The mark of a finished calibration."""
POSTERIOR = "posterior.nc"


@dataclass(frozen=True)
class StoredRun:
    """A finished RUN, ready to predict."""

    path: Path
    model: Model
    draws: Draws
    state: dict[str, Any]

    @property
    def seed(self) -> int:
        """The seed that the run was made with."""
        return int(self.state["seed"])


def write_draws(path: Path, draws: Draws, reported: Sequence[Reported], log_prob: Array, digest: str) -> None:
    """ArviZ InferenceData, chain = ensemble: reported quantities in lab units, and what predictions need.

    ``log_prob`` (ensembles, steps, walkers) is that of all steps, of which ``draws.index`` were kept;
    ``digest`` is the run's: the draws are of no use beside another one's ``run.json``.
    """
    az = import_arviz()
    assert draws.index is not None
    shape = (draws.chains, len(draws) // draws.chains)
    kept = np.broadcast_to(draws.index, shape)
    data = az.from_dict(
        posterior={item.name: item.draws.reshape(shape) for item in reported},
        sample_stats={"lp": np.take_along_axis(log_prob.reshape(draws.chains, -1), kept, axis=1)},
        attrs={"inference_library": "emcee", "digest": digest},
    )
    sampler = {
        "coordinates": draws.u.reshape(*shape, -1),
        "linear_coordinates": draws.eta.reshape(*shape, -1),
    }
    coordinates = az.dict_to_dataset(sampler, library=None)
    data.add_groups({"sampler_coordinates": coordinates}, warn_on_custom_groups=False)
    for group in data.groups():
        # A time of writing would make two equal runs differ.
        data[group].attrs.pop("created_at", None)
        data[group].attrs.setdefault("digest", digest)
    write_atomically(path, lambda p: data.to_netcdf(str(p), engine="h5netcdf"))


def readable(path: Path) -> bool:
    """Whether every array of a file of draws can be read."""
    import h5netcdf

    try:
        with h5netcdf.File(path, "r") as file:
            for group in file.groups.values():
                for variable in group.variables.values():
                    _ = variable[...]
    except (OSError, RuntimeError, ValueError, KeyError):
        return False
    return True


def load_run(path: Path) -> StoredRun:
    """Read a RUN folder; raises ``InputError`` where it is none, not finished, or of several runs."""
    az = import_arviz()
    try:
        state: dict[str, Any] = json.loads((path / RUN_FILE).read_text(encoding="utf-8"))
        blueprint = Blueprint.model_validate(state["blueprint"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(path / RUN_FILE, "no finished run", "a folder that calibrate wrote") from error
    _demand_effects(path, blueprint)
    try:
        data = az.from_netcdf(str(path / POSTERIOR), engine="h5netcdf")
        stored = data["sampler_coordinates"]
        u, eta = stored["coordinates"].to_numpy(), stored["linear_coordinates"].to_numpy()
        digest = stored.attrs["digest"]
    except (OSError, RuntimeError, ValueError, KeyError) as error:
        found = "a damaged file" if (path / POSTERIOR).is_file() else "no such file"
        raise InputError(path / POSTERIOR, found, "the draws that calibrate wrote") from error
    # Older versions kept the digest of the data and the declaration alone.
    if digest not in (state.get("digest"), state.get("specimen_digest")):
        raise InputError(path / POSTERIOR, "the draws of another run", f"those of the {RUN_FILE} beside it")
    model = build_model(blueprint)
    widths, wanted = (u.shape[-1], eta.shape[-1]), (len(model.names), sum(model.linear_sizes))
    if widths != wanted:
        found = "a model of {} and {} coordinates beside draws of {} and {}".format(*wanted, *widths)
        raise InputError(path / RUN_FILE, found, "the file that calibrate wrote")
    u, eta, chains = u.reshape(-1, u.shape[-1]), eta.reshape(-1, eta.shape[-1]), u.shape[0]
    return StoredRun(path, model, Draws(u, model.values(u), eta, chains), state)


def _demand_effects(path: Path, blueprint: Blueprint) -> None:
    """Raise ``InputError`` where an effect of a run, or its form, is of a package that is not there."""
    known = known_effect_ids()
    for written in blueprint.simulation.effects:
        effect, _, form = written.partition(":")
        if effect not in known or (form and form not in forms_of_id(effect)):
            found = f"the effect {quoted(written)}, which is not installed"
            raise InputError(path / RUN_FILE, found, f"ids among {listed(known, limit=len(known))}")


def unconverged(path: Path) -> bool:
    """Whether a RUN says of itself that its sampling did not converge."""
    try:
        state: dict[str, Any] = json.loads((path / RUN_FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(state, dict) and state.get("converged") is False
