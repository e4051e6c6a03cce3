"""Cells that are numbers, but not those that were meant: cut off at a file's end, thousands marked."""

from __future__ import annotations

import re
from collections.abc import Sequence

from mpam_calib.errors import InputError
from mpam_calib.specimen.wording import quoted

COMPARED = 200
"""Rows before the last that tell how its last cell should look."""
LEAST = 10
"""Cells at least with a mark for the thousands, or whole rows before a cut one, for either to be believed."""

_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}")
_HUNDREDS = re.compile(r"[+-]?\d{1,3}")


def cut_off(cells: Sequence[str], last: str) -> bool:
    """Whether the last cell of a file that ends without a line's end has lost characters.

    ``cells`` are those above it. Told where all of them are written alike behind the decimal mark, zeros at
    the end included.

    >>> cut_off(["0.10", "0.15"] * 5, "0.2"), cut_off(["0.1", "0.15"] * 5, "0.2")
    (True, False)
    """
    tails = {re.sub(r"\d", "0", _behind_mark(cell)).replace("-", "+") for cell in cells}
    if len(cells) < LEAST or len(tails) > 1 or not any(_ends_in_zero(cell) for cell in cells):
        return False
    tail = tails.pop()
    own = re.sub(r"\d", "0", _behind_mark(last)).replace("-", "+")
    return own != tail and tail.startswith(own)


def _behind_mark(cell: str) -> str:
    return re.split("[.,]", cell, maxsplit=1)[1] if re.search("[.,]", cell) else ""


def _ends_in_zero(cell: str) -> bool:
    return re.match(r"\d*0(?!\d)", _behind_mark(cell)) is not None


def refuse_thousands(label: str, name: str, cells: Sequence[tuple[int, str]]) -> None:
    """Raise ``InputError`` for a column (rows and cells) whose decimal marks part thousands: 950, then 1.020.

    Nothing else leaves whole numbers below a thousand bare and gives all others three places, zeros included.
    """
    filled = [(row, cell) for row, cell in cells if cell]
    marked = [(row, cell) for row, cell in filled if _THOUSANDS.fullmatch(cell)]
    bare = [cell for _, cell in filled if _HUNDREDS.fullmatch(cell)]
    if len(marked) < LEAST or len(marked) + len(bare) < len(filled):
        return
    if any(abs(int(cell)) >= 100 for cell in bare) and any(cell.endswith("0") for _, cell in marked):
        row, cell = marked[0]
        found = f"{quoted(cell)} beside {quoted(max(bare, key=len))} (a thousands separator?)"
        raise InputError(label, found, "numbers without one", row, name)
