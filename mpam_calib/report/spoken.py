"""Numbers inside sentences."""

from __future__ import annotations

from markupsafe import Markup


def spoken(value: str, band: str, unit: str, words: str = "") -> Markup:
    """A number with its band inside a sentence, each kept on one line."""
    text = '<b>{} {}</b>{} (<span class="band-words">90 % band {} {}</span>)'
    return Markup(text).format(value, unit, words, band, unit)
