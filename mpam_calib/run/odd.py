"""What looks odd in a specimen, told beside a calibration of it: nobody is made to ask ``check`` first."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

from mpam_calib.specimen.oddities import oddities
from mpam_calib.specimen.recording import Specimen

MOST = 3
"""Lines that are told; of more only their number, and where they stand."""


def tell_odd(specimen: Specimen, source: str | Path) -> None:
    """Say on standard error what ``check`` says is odd; ``source`` is the SPECIMEN as it was given."""
    lines = oddities(specimen)
    if len(lines) > MOST:
        lines = [f"{len(lines)} remarks on these data; see mpam-calib check {shlex.quote(str(source))}"]
    for line in lines:
        print(f"odd: {line}", file=sys.stderr)
