"""A matplotlib figure as a data URI: the same bytes each time, nothing left open."""

from __future__ import annotations

import base64
import io
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def data_uri(figure: Figure) -> str:
    """``data:image/svg+xml;base64,...`` of the figure.

    Its ids come from a fixed salt and no date or version is written, so equal figures give equal
    bytes. Text becomes outlines: it looks the same on every machine.
    """
    import matplotlib as mpl

    buffer = io.BytesIO()
    nameless = {"Date": None, "Creator": None, "Format": None, "Type": None}
    with mpl.rc_context({"svg.hashsalt": "mpam-calib", "svg.fonttype": "path"}):
        figure.savefig(buffer, format="svg", metadata=nameless)
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close(figure)
    return f"data:image/svg+xml;base64,{base64.b64encode(buffer.getvalue()).decode('ascii')}"
