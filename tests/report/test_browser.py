"""The report in a real browser: it shows, without complaints and without a network."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest
from matplotlib.image import imread

from mpam_calib.report.calibration import calibration_page

from .synthetic import muscle

CHROMIUM = next(
    (found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))),
    None,
)
pytestmark = pytest.mark.skipif(
    CHROMIUM is None, reason="no Chromium found: the report was not loaded in a browser"
)

OPTIONS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
    "--enable-logging=stderr",
    "--v=0",
)


def browse(page: Path, profile: Path, *options: str) -> subprocess.CompletedProcess[str]:
    command = [str(CHROMIUM), *OPTIONS, f"--user-data-dir={profile}", *options, page.as_uri()]
    return subprocess.run(command, capture_output=True, text=True, timeout=90, check=True)


def complaints(result: subprocess.CompletedProcess[str]) -> list[str]:
    return [line for line in result.stderr.splitlines() if "CONSOLE" in line]


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    view = muscle(100, 500, name="Muscle <b>7</b>")
    return calibration_page(view).write(tmp_path_factory.mktemp("report") / "report.html")


def test_it_loads_with_its_headline_and_without_complaints(report: Path, tmp_path: Path) -> None:
    result = browse(report, tmp_path, "--dump-dom")
    assert "At 250 kPa, Muscle &lt;b&gt;7&lt;/b&gt; pulls with" in result.stdout
    assert result.stdout.count("<figure>") == 5
    assert complaints(result) == []


def test_a_page_that_reaches_outside_would_be_seen(report: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken.html"
    html = report.read_text(encoding="utf-8")
    broken.write_text(html.replace("</main>", '<img src="other.png"></main>'), encoding="utf-8")
    assert complaints(browse(broken, tmp_path / "profile", "--dump-dom"))


def test_it_paints_its_figures(report: Path, tmp_path: Path) -> None:
    shot = tmp_path / "shot.png"
    browse(report, tmp_path, "--window-size=1280,1600", f"--screenshot={shot}")
    pixels = imread(shot)[..., :3]
    assert pixels.shape[:2] == (1600, 1280)
    # the loops' blue and orange lines are on the page
    for colour in ((0.0, 0.447, 0.698), (0.835, 0.369, 0.0)):
        near = (abs(pixels - colour) < 0.05).all(axis=-1)
        assert near.sum() > 500
