"""What a ranking says of one choice at a time: of each order, law, friction, kinematics and strain."""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy import special

from mpam_calib.specimen.declaration import Simulation

CHOICES = ("order", "law", "friction", "kinematics", "strain")
ODDS_COLUMNS = ["choice", "value", "log_evidence_declared", "log_evidence", "probability"]


def declared_or_beside(simulation: Simulation, declared: Simulation) -> bool:
    """Whether a model differs from the declared one in at most one choice."""
    return sum(bool(getattr(simulation, c) != getattr(declared, c)) for c in CHOICES) <= 1


def odds(models: pd.DataFrame, declared: Simulation) -> pd.DataFrame:
    """One row for each value of each choice in a table with the columns of ``models.csv``.

    ``log_evidence_declared`` (nats) is that of the declared model with this one choice made so (NaN where
    it could not be fitted), ``log_evidence`` the logarithm of the sum over all models that make it,
    ``probability`` their share. All models are taken as equally probable beforehand.
    """
    rows = []
    for choice in CHOICES:
        others = [c for c in CHOICES if c != choice]
        beside = np.all([models[c] == getattr(declared, c) for c in others], axis=0)
        for value in sorted(models[choice].unique()):
            here = models[models[choice] == value]
            own = models.loc[beside & (models[choice] == value), "log_evidence"]
            rows.append(
                [
                    choice, value, float(own.iloc[0]) if len(own) else float("nan"),
                    float(special.logsumexp(here["log_evidence"])), float(here["probability"].sum()),
                ]
            )  # fmt: skip
    return pd.DataFrame(rows, columns=ODDS_COLUMNS)
