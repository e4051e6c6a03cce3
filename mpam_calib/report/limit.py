"""What a check of a calibration's numbers finds."""

from __future__ import annotations

from dataclasses import dataclass

from mpam_calib.report.blocks import Level


@dataclass(frozen=True)
class Limit:
    """Something that limits the numbers: how badly, in a full sentence, and in a few words.

    A limit of level "good" is a remark: worth knowing, but the numbers with their bands stand.
    """

    level: Level
    sentence: str
    brief: str
