"""The whole reproduction: every entry of the ledger, in the order of the thesis."""

from __future__ import annotations

from dataclasses import dataclass

from mpam_calib.thesis.chapter3 import STARTS, Chapter3
from mpam_calib.thesis.entries import curves, friction, moduli, optimisation, orders, performance, text
from mpam_calib.thesis.ledger import Ledger


@dataclass(frozen=True)
class Reproduction:
    """The filled ledger and the searches that it rests on."""

    ledger: Ledger
    chapter3: Chapter3


def reproduce(seed: int = 0, starts: int = STARTS) -> Reproduction:
    """Recompute everything that the thesis prints and that can be recomputed.

    ``seed`` is that of the stochastic searches, ``starts`` how often Case II is searched from scratch.
    """
    chapter = Chapter3(seed, starts)
    ledger = Ledger()
    optimisation.enter(ledger, chapter)
    orders.enter(ledger)
    moduli.enter(ledger)
    friction.enter(ledger)
    performance.enter(ledger)
    curves.enter(ledger)
    text.enter(ledger, chapter)
    return Reproduction(ledger, chapter)
