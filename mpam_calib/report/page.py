"""The page shell that every command's report uses: blocks in, one self-contained HTML file out.

>>> from mpam_calib.report.blocks import Section, Text
>>> page = Page("MPAM1", "Calibration", lead=[Text("F < 100 N")], sections=[Section("Data")])
>>> "F &lt; 100 N" in page.render()
True
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import jinja2

from mpam_calib.atomic_files import write_atomically
from mpam_calib.report.blocks import Block, Notice, Section


@lru_cache(maxsize=1)
def _environment() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.PackageLoader("mpam_calib.report", "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def anchors(titles: Sequence[str]) -> list[str]:
    """Unique ids for section titles.

    >>> anchors(["Loops & bands", "Loops & bands", "…"])
    ['loops-bands', 'loops-bands-2', 'section']
    """
    found: list[str] = []
    for title in titles:
        stem = re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-") or "section"
        name, n = stem, 1
        while name in found:
            n += 1
            name = f"{stem}-{n}"
        found.append(name)
    return found


@dataclass(frozen=True)
class Page:
    """A report: ``lead`` is its first screen, ``sections`` what backs it up, in order of interest."""

    title: str
    subtitle: str
    lead: Sequence[Block]
    sections: Sequence[Section]
    footer: str = ""

    def under(self, notice: str) -> Page:
        """The page with a notice above all else; as it is without one ("")."""
        return replace(self, lead=[Notice(notice), *self.lead]) if notice else self

    def render(self) -> str:
        """The page as HTML text without any reference to the outside."""
        template = _environment().get_template("page.html.j2")
        ids = anchors([section.title for section in self.sections])
        return template.render(page=self, contents=list(zip(ids, self.sections, strict=True)))

    def write(self, path: str | Path) -> Path:
        """Write the page to ``path`` in one move: readers see the old file or the new one."""
        text = self.render()
        write_atomically(Path(path), lambda p: p.write_text(text, encoding="utf-8", newline="\n"))
        return Path(path)
