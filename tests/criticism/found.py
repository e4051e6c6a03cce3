"""A search by itself, whose workers are gone."""

from __future__ import annotations

from typing import Any

from mpam_calib.criticism.searching.search import open_search
from mpam_calib.criticism.searching.searched import Search


def search(*given: Any, **named: Any) -> Search:
    """What ``open_search`` finds; arguments as there."""
    with open_search(*given, **named) as found:
        return found
