"""Turns of phrase that every message of the reader shares."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def one_line(text: object, limit: int = 60) -> str:
    """``text`` without line breaks or control characters, shortened to ``limit`` characters."""
    plain = " ".join("".join(c if c.isprintable() else " " for c in str(text)).split())
    return plain if len(plain) <= limit else plain[: limit - 3] + "..."


def quoted(text: object) -> str:
    """``text`` in double quotes, on one line.

    >>> quoted("abc")
    '"abc"'
    """
    return f'"{one_line(text)}"'


def shown(value: object) -> str:
    """A TOML value as a message shows it: text in quotes, so that "50" is told from 50."""
    if isinstance(value, str):
        return quoted(value)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a table"
    return one_line(value)


def listed(words: Iterable[str], limit: int = 12) -> str:
    """Quoted words in a row, the first ``limit`` of them."""
    every = [quoted(word) for word in words]
    return ", ".join(every[:limit]) + (", ..." if len(every) > limit else "")


def did_you_mean(word: str, words: Iterable[str]) -> str:
    """`` (did you mean "...")`` where one of ``words`` is near, else nothing.

    >>> did_you_mean("liner", ["linear", "free"])
    ' (did you mean "linear"?)'
    >>> did_you_mean("xyz", ["linear", "free"])
    ''
    """
    by_lower = {candidate.lower(): candidate for candidate in words}
    near = difflib.get_close_matches(word.lower(), list(by_lower), n=1, cutoff=0.55)
    return f' (did you mean "{by_lower[near[0]]}"?)' if near else ""


def os_reason(error: OSError) -> str:
    """What an operating system's error amounts to, as "found ..."."""
    if isinstance(error, FileNotFoundError):
        return "no such file"
    if isinstance(error, IsADirectoryError):
        return "a folder"
    if isinstance(error, PermissionError):
        return "a file that may not be read"
    return f"a file that cannot be read ({one_line(error.strerror or error)})"
