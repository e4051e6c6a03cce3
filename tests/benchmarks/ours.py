"""The package's own way to the posterior: ``mpam_calib.calibrate``, with every draw's moduli drawn back."""

from __future__ import annotations

import numpy as np

import mpam_calib as mc
from mpam_calib.model.blueprint import Options
from mpam_calib.posterior.draws import keep_draws, reported
from mpam_calib.posterior.sampling import BLOCK, Progress
from mpam_calib.specimen import Specimen

from .problem import NAMES
from .stopwatch import Drawn, Stopwatch


def draw(specimen: Specimen, options: Options, ess: float) -> Drawn:
    """Calibrate until ``ess``. What counts as sampling begins after the first block of steps.

    Everything else is in it: the checks whether to go on, and drawing the moduli for each draw.
    """
    watches: list[Stopwatch] = []

    def listen(progress: Progress) -> None:
        if progress.stage == "sampling" and not watches:
            watches.append(Stopwatch())

    made = mc.calibrate(specimen, options=options, ess_wanted=ess, max_steps=100_000, listener=listen)
    wall, cpu = watches[0].read()
    ensembles, steps, walkers, _ = made.sampling.chain.shape
    watch = Stopwatch()
    draws = keep_draws(made.target, made.sampling, seed=0, kept=None)
    listed = {item.name: item.draws for item in reported(made.model, draws)}
    figures = np.stack([listed[name] for name in NAMES], axis=-1)
    own_wall, own_cpu = watch.read()
    share = 1.0 - BLOCK / steps
    # The time before the first block's end is not counted, nor are its draws; a short run is one block.
    return Drawn(
        figures.reshape(ensembles, steps, walkers, -1)[:, BLOCK if steps > BLOCK else 0 :],
        wall + share * own_wall,
        cpu + share * own_cpu,
    )
