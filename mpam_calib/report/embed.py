"""A matplotlib figure as a data URI: the same bytes each time, nothing left open."""

from __future__ import annotations

import base64
import io
import sys
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PNG_DPI = 160


def data_uri(figure: Figure, format: Literal["svg", "png"] = "svg") -> str:
    """``data:image/...;base64,...`` of the figure.

    SVG ids come from a fixed salt and no date or version is written, so equal figures give equal
    bytes. Text becomes outlines: it looks the same on every machine.
    """
    import matplotlib as mpl

    buffer = io.BytesIO()
    with mpl.rc_context({"svg.hashsalt": "mpam-calib", "svg.fonttype": "path"}):
        if format == "svg":
            nameless = {"Date": None, "Creator": None, "Format": None, "Type": None}
            figure.savefig(buffer, format="svg", metadata=nameless)
        else:
            figure.savefig(buffer, format="png", dpi=PNG_DPI, metadata={"Software": None})
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close(figure)
    mime = "image/svg+xml" if format == "svg" else "image/png"
    return f"data:{mime};base64,{base64.b64encode(buffer.getvalue()).decode('ascii')}"
