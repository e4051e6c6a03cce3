"""What a tensile test adds to the collapsed posterior: stress, linear in the moduli, and its remainder."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.model import Model
from mpam_calib.model.tensile import MISFIT, NOISE
from mpam_calib.posterior.density.piece import Piece, white_piece
from mpam_calib.posterior.likelihood.algebra import LOG_2PI
from mpam_calib.posterior.likelihood.tensile_points import TensilePoints

Array = NDArray[np.float64]


def tensile_piece(model: Model, values: Mapping[str, Array], tensile: TensilePoints) -> Piece:
    """Points that stand for rows of the test, for values (B, 1) by name."""
    stress = model.tensile
    assert stress is not None and model.moduli is not None
    sizes = model.linear_sizes
    B = len(values[NOISE])
    mean, matrix = model.moduli.transform(values)
    powers = stress.powers(tensile.strain)
    design = np.zeros((B, len(tensile.strain), sum(sizes)))
    design[:, :, : sizes[0]] = powers @ matrix
    if MISFIT in values:
        design[:, :, sizes[0] + sizes[1] :] = values[MISFIT][:, :, None] * stress.remainder(tensile.strain)
    residual = np.broadcast_to(tensile.stress - powers @ mean[0], design.shape[:2])
    variance = values[NOISE] ** 2
    piece = white_piece(design, residual, variance / tensile.count)
    # What scatters about the points knows the noise alone.
    others = tensile.rows - len(tensile.strain)
    scatter = tensile.within / variance + others * (np.log(variance) + LOG_2PI)
    weights = float(np.log(tensile.count).sum())
    return piece._replace(constant=piece.constant + scatter[:, 0] + weights)
