"""What one data set adds to the collapsed posterior, and what all of them reckon alike."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.model import Model
from mpam_calib.model.noise import GROWTH, WHITE, grown
from mpam_calib.model.remainder import SMOOTH
from mpam_calib.posterior.density.piece import Piece
from mpam_calib.posterior.density.slack import Slack
from mpam_calib.posterior.likelihood.sites import FreeRows

Array = NDArray[np.float64]
Values = Mapping[str, Array]
Place = slice | NDArray[np.int64]


class Added(NamedTuple):
    """Its products, its slack rows, and its rows whose noise is Student-t, where it has such."""

    piece: Piece
    slack: Slack | None = None
    free: FreeRows | None = None


def fill(
    model: Model, result: Array, place: Place, values: Values, moduli: Array, remainder: Array | None
) -> None:
    """Write the moduli's columns (B, n, p) and the remainder's (n, q) into an array (B, rows, k or more).

    At the rows of ``place``.
    """
    p, q, _ = model.linear_sizes
    result[:, place, :p] = moduli
    if remainder is not None:
        result[:, place, p : p + q] = values[SMOOTH][:, :, None] * remainder


def growth(model: Model, values: Values, force: Array) -> Array:
    """Factor (B, n) on the noise's sd at forces (n,), N."""
    assert model.setting is not None
    none = np.zeros_like(values[WHITE])
    return grown(values.get(GROWTH, none), force, model.setting.force_scale)
