"""What the parser refuses, in the words of all other errors: where, what was found, what was expected."""

from __future__ import annotations

import re
import sys
from typing import Any

from mpam_calib.cli.app import ORDER
from mpam_calib.specimen.wording import did_you_mean, listed, one_line, quoted

SHOULD_BE = "Input should be "
"""How the parser begins to say what a value should have been."""
LONG = 200


def usage_message(error: Any) -> str:
    """``PLACE: found ..., expected ...`` of the parser's error (by name: its module is no interface)."""
    kind, said = type(error).__name__, one_line(error.format_message(), LONG)
    option, param = getattr(error, "option_name", None), getattr(error, "param", None)
    if kind == "MissingParameter" and param is not None:
        what = "this option" if _is_option(param) else "an argument"
        return f"{_place(param)}: found nothing, expected {what}{_meaning(param)}"
    if kind == "NoSuchOption" and option:
        guess = did_you_mean(option, error.possibilities or ())
        return f"{option}: found an unknown option{guess}, expected one that --help lists"
    if kind == "BadOptionUsage" and option:
        if "requires" in said:
            return f"{option}: found nothing, expected a value after it"
        return f"{option}: found a value, expected none"
    if kind == "BadParameter" and param is not None and SHOULD_BE in said:
        expected = said.partition(SHOULD_BE)[2].partition(", ")[0]
        return f"{_place(param)}: found {_given(param)}, expected {expected}"
    if unknown := re.match(r"No such command ['\"](.*?)['\"]", said):
        found = f"the unknown command {quoted(unknown[1])}{did_you_mean(unknown[1], ORDER)}"
        return f"command line: found {found}, expected one of {listed(ORDER)}"
    said = said.removeprefix("Got ").rstrip(".")
    return f"command line: found {said[:1].lower()}{said[1:]}, expected what --help lists"


def _is_option(param: Any) -> bool:
    return str(param.opts[0]).startswith("-")


def _place(param: Any) -> str:
    """An option's long name, or an argument's as the help writes it."""
    return max(param.opts, key=len) if _is_option(param) else str(param.metavar or param.name).upper()


def _meaning(param: Any) -> str:
    text = one_line(getattr(param, "help", None) or "", LONG).rstrip(".")
    return f" ({text[:1].lower()}{text[1:]})" if text else ""


def _given(param: Any) -> str:
    """The value that was written after an option, or with it; the parser does not keep it."""
    for word, after in zip(sys.argv[1:], [*sys.argv[2:], ""], strict=True):
        name, mark, value = word.partition("=")
        if name in param.opts:
            return quoted(value if mark else after)
    return "another value"
