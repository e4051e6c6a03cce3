"""Sizes of a set's causes: over every doubt, and over every form that the data do not exclude.

The likeliest form alone would be too sure of a size: that of another may lie a few of its own sds away.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mpam_calib.criticism.fitting.fit import Fit
from mpam_calib.criticism.fitting.refits import Set, named_forms
from mpam_calib.criticism.searching.searched import Search
from mpam_calib.model.effect import effect
from mpam_calib.model.state import Setting

Array = NDArray[np.float64]

EXCLUDED = 8.0
"""Nats behind the likeliest form from which on another is left out."""
DRAWS = 4000


class Told(NamedTuple):
    """What is told of one parameter (SI units): its 90 % band is from ``q05`` to ``q95``."""

    mean: float
    sd: float
    q05: float
    q95: float


@dataclass(frozen=True)
class Sizes:
    """One set's fits in all forms that count, the likeliest first: a mixture by their evidence."""

    fits: tuple[Fit, ...]
    setting: Setting

    @property
    def weights(self) -> Array:
        """Probability of each fit (fits,)."""
        return np.asarray(special.softmax([fit.log_evidence for fit in self.fits]))

    def forms(self, identifier: str) -> dict[str, float]:
        """The forms of one cause (of which none is "") with their probabilities, the likeliest first."""
        found: dict[str, float] = {}
        for fit, weight in zip(self.fits, self.weights.tolist(), strict=True):
            form = named_forms(fit)[identifier].partition(":")[2]
            found[form] = found.get(form, 0.0) + weight
        return dict(sorted(found.items(), key=lambda item: -item[1]))

    def draw(self, name: str, count: int, rng: np.random.Generator) -> Array:
        """Draws (count,) of one parameter, SI units, from the forms that have it."""
        having, priors, weights = [], [], []
        for fit, weight in zip(self.fits, self.weights, strict=True):
            own = {p.name: p.prior for e in fit.effects for p in effect(e).parameters(self.setting)}
            if name in own:
                having.append(fit)
                priors.append(own[name])
                weights.append(weight)
        counts = rng.multinomial(count, np.array(weights) / sum(weights))
        drawn = [fit.draw(name, n, rng) for fit, n in zip(having, counts, strict=True)]
        return np.concatenate([prior.from_normal(u) for prior, u in zip(priors, drawn, strict=True)])

    def told(self, written: str, seed: int) -> dict[str, Told]:
        """Each parameter of one of the effects (written with its form), by name."""
        found = {}
        for number, parameter in enumerate(effect(written).parameters(self.setting)):
            values = self.draw(parameter.name, DRAWS, np.random.default_rng([seed, 9, number]))
            q05, q95 = np.quantile(values, [0.05, 0.95])
            found[parameter.name] = Told(
                float(values.mean()), float(values.std(ddof=1)), float(q05), float(q95)
            )
        return found


def sizes_of(found: Search, effects: Set) -> Sizes:
    """A set's fit beside the remainder that suits it, and those with one of its effects in another form."""
    found.refit_in_forms([effects])
    fits = sorted(found.in_forms[effects], key=lambda f: -f.log_evidence)
    counting = tuple(f for f in fits if f.log_evidence > fits[0].log_evidence - EXCLUDED)
    return Sizes(counting, found.problem.setting)
