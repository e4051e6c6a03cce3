"""The package's own way to the posterior: ``mpam_calib.calibrate``, with every draw's moduli drawn back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import mpam_calib as mc
from mpam_calib.model.blueprint import Options
from mpam_calib.posterior.chains.sampling import BLOCK, Progress
from mpam_calib.posterior.draws import keep_draws, reported
from mpam_calib.specimen import Specimen

from .problem import NAMES
from .stopwatch import Drawn, Stopwatch


def draw(specimen: Specimen, options: Options, ess: float, thin: int) -> Drawn:
    """Calibrate until ``ess``, counting every ``thin``-th step. Sampling begins after the first block.

    Everything else is in it: the checks whether to go on, and drawing the moduli for each draw.
    """
    watches: list[Stopwatch] = []
    taken = [(0.0, 0.0)]

    def listen(progress: Progress) -> None:
        if progress.stage == "sampling":
            watches.append(Stopwatch())
            taken.append(watches[0].read())

    made = mc.calibrate(specimen, options=options, ess_wanted=ess, max_steps=100_000, listener=listen)
    wall, cpu = taken[-1]
    steps = made.sampling.chain.shape[1]
    # The first block's time is not counted, nor are its draws; a short run is one block.
    counted = made.sampling.chain[:, BLOCK if steps > BLOCK else 0 :: thin]
    watch = Stopwatch()
    draws = keep_draws(made.target, replace(made.sampling, chain=counted), seed=0, kept=None)
    listed = {item.name: item.draws for item in reported(made.model, draws)}
    figures = np.stack([listed[name] for name in NAMES], axis=-1)
    own_wall, own_cpu = watch.read()
    return Drawn(figures.reshape(*counted.shape[:3], -1), wall + own_wall, cpu + own_cpu)
