"""Whether data are measurements, by the marks that this project itself puts on those that are not.

A word in a specimen's name is the user's own: "synthetic latex" is a rubber.
"""

from __future__ import annotations

from pathlib import Path, PurePath

from mpam_calib.specimen.recording import Specimen

# Synthetic first: made from a reconstructed specimen's declaration, a recording bears both marks.
PROVENANCE = {
    "synthetic": "These data are synthetic: a simulation made them, not a rig.",
    "reconstructed": "These data are reconstructed from printed tables, not measured.",
    "digitised": "These data were digitised from a printed figure.",
}


def provenance(specimen: Specimen) -> str:
    """A sentence on data that are no measurements, "" for all others."""
    header = _header(specimen.declared_in)
    stems = [PurePath(file.name).stem for file in specimen.files]
    for word, sentence in PROVENANCE.items():
        named = f"({word})" in specimen.name or any(stem.endswith(f"_{word}") for stem in stems)
        if named or header.startswith(word.upper()):
            return sentence
    return ""


def _header(declaration: Path | None) -> str:
    """The comment that a declaration begins with; "" without one."""
    if declaration is None:
        return ""
    try:
        text = declaration.read_text(encoding="utf-8-sig")
    except OSError:  # gone since it was read
        return ""
    first = text.lstrip().partition("\n")[0]
    return first.removeprefix("#").strip() if first.startswith("#") else ""
