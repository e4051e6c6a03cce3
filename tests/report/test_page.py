"""The page shell: self-contained, safe, deterministic, written in one move."""

from __future__ import annotations

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pandas as pd
import pytest
from markupsafe import Markup
from matplotlib.figure import Figure as MplFigure

from mpam_calib.atomic_files import sweep
from mpam_calib.report.blocks import (
    DataTable,
    Figure,
    Headline,
    KeyNumber,
    Notice,
    Numbers,
    Section,
    Text,
    Verdict,
)
from mpam_calib.report.page import Page

NASTY = '<script>alert("x")</script> & "quoted" \'too\''


def plot() -> MplFigure:
    figure = MplFigure(figsize=(4, 2))
    figure.subplots().plot([1, 3, 2])
    return figure


def page(words: str = "plain") -> Page:
    frame = pd.DataFrame({words: [1.25, float("nan")], "text": [words, None], "flag": [True, False]})
    blocks = [
        Headline(words),
        Text(words),
        Notice(words),
        Numbers([KeyNumber(words, words, words, words, words)]),
        Verdict(words, "caution", [words]),
        Figure(plot(), words, words),
        DataTable(frame, words, {words: "{:.2f}"}, collapse=True),
    ]
    return Page(words, words, blocks, [Section(words, blocks, words), Section(words, [])], words)


class Tags(HTMLParser):
    VOID = frozenset({"meta", "link", "img", "br"})

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.attributes: list[tuple[str, str, str]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes += [(tag, name, value or "") for name, value in attrs]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def parsed(html: str) -> Tags:
    tags = Tags()
    tags.feed(html)
    return tags


def test_every_tag_is_closed_and_ids_are_unique() -> None:
    tags = parsed(page().render())
    assert tags.open == []
    ids = [value for _, name, value in tags.attributes if name == "id"]
    assert len(ids) == len(set(ids))
    links = [value for tag, name, value in tags.attributes if (tag, name) == ("a", "href")]
    assert links == ["#plain", "#plain-2"]
    assert {link[1:] for link in links} <= set(ids)


def test_nothing_is_fetched_from_outside() -> None:
    html = page().render()
    for _, name, value in parsed(html).attributes:
        if name in {"src", "href", "srcset", "action", "data"}:
            assert value.startswith(("data:", "#")), value
    style = re.search(r"<style>(.*?)</style>", html, re.S)
    assert style is not None
    assert "url(" not in style.group(1)
    assert "@import" not in style.group(1)
    assert "<script" not in html


def test_words_of_the_user_are_escaped_everywhere() -> None:
    html = page(NASTY).render()
    assert "<script" not in html
    assert "&lt;script&gt;" in html
    assert parsed(html).open == []


def test_markup_is_kept_and_blank_lines_split_paragraphs() -> None:
    html = Page("t", "s", [Text(Markup("<em>a</em>\n\nb")), Text("<em>c")], []).render()
    assert "<p><em>a</em></p>" in html
    assert "<p>b</p>" in html
    assert "<p>&lt;em&gt;c</p>" in html


def test_table_cells() -> None:
    frame = pd.DataFrame({"n": [1.23456, float("nan")], "k": [3, 4], "s": ["a", None], "b": [True, False]})
    table = DataTable(frame, "caption", {"n": "{:.2f}"})
    assert table.rows == [["1.23", "3", "a", "yes"], ["–", "4", "–", "no"]]
    assert table.header == [("n", True), ("k", True), ("s", False), ("b", False)]


def test_rendering_is_deterministic() -> None:
    one = page()
    assert one.render() == one.render() == page().render()


def test_writing_replaces_the_file_and_leaves_nothing_else(tmp_path) -> None:
    target = tmp_path / "new" / "report.html"
    page("first").write(target)
    page("second").write(target)
    assert "second" in target.read_text(encoding="utf-8")
    assert [path.name for path in target.parent.iterdir()] == ["report.html"]


def test_what_a_killed_write_leaves_is_swept(tmp_path, monkeypatch) -> None:
    written = []
    monkeypatch.setattr("os.replace", lambda source, target: written.append(Path(source)))
    page("first").write(tmp_path / "report.html")
    written[0].write_text("<html")
    sweep(tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_failed_write_keeps_the_old_file(tmp_path, monkeypatch) -> None:
    target = tmp_path / "report.html"
    page("first").write(target)
    before = target.read_bytes()

    def refuse(source: object, target: object) -> None:
        raise OSError("no")

    monkeypatch.setattr("os.replace", refuse)
    with pytest.raises(OSError, match="no"):
        page("second").write(target)
    assert target.read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


def test_importing_the_page_does_not_import_matplotlib() -> None:
    code = (
        "import sys, mpam_calib.report.page, mpam_calib.report.calibration;"
        "sys.exit('matplotlib' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
