"""What ``check`` says of parts that are not there."""

from __future__ import annotations

from dataclasses import replace

from criticism.cases import specimen_of

from mpam_calib.cli.check import _missing


def test_without_a_braid_strands_may_still_be_named() -> None:
    """As the diagnosis page says, which states their size for strands that it assumes."""
    specimen = replace(specimen_of("develop-null-006"), braid=None)
    (words,) = (line for line in _missing(specimen) if line.startswith("[braid]"))
    assert "its size is stated for nylon strands that it assumes" in words
