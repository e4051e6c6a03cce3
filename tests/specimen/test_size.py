"""Files of any size: memory that does not grow with them, and averages that respect the turns."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from mpam_calib.errors import InputError
from mpam_calib.specimen import blocks, read, reduction
from mpam_calib.specimen.summary import force_noise, summarise_loops

from .folders import DECLARATION, HEADER, Recording, loops, make

LIMIT_MIB = 300.0


def write_large(folder: Path, megabytes: float) -> int:
    """Write loops of about this size, the same strokes again and again; returns the number of rows."""
    make(folder, DECLARATION)
    part = loops((50.0, 100.0, 150.0), cycles=2, rate=100.0, encoder_sd=0.01, pressure_sd=0.2)
    body = part.columns()
    count = 0
    with (folder / "loops.csv").open("w") as stream:
        stream.write(HEADER + "\n")
        while stream.tell() < megabytes * 1e6:
            body[:, 0] = part.time + count / 100.0
            np.savetxt(stream, body, fmt="%.3f", delimiter=",")
            count += len(body)
    return count


def check_in_a_process(folder: Path) -> tuple[str, float]:
    """Output of ``check`` and its process's peak memory, MiB (rusage would count the parent's, too)."""
    code = (
        "import sys\n"
        "from mpam_calib.cli import main\n"
        f"sys.argv = ['mpam-calib', 'check', {str(folder)!r}]\n"
        "try:\n    main()\nfinally:\n"
        "    peak = next(line.split()[1] for line in open('/proc/self/status') if line.startswith('VmHWM'))\n"
        "    print('peak', peak, file=sys.stderr)\n"
        "    heavy = {'matplotlib', 'arviz', 'emcee', 'scipy'} & set(sys.modules)\n"
        "    print('heavy', sorted(heavy), file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    lines = done.stderr.splitlines()
    assert lines[1:] == ["heavy []"]
    return done.stdout, int(lines[0].split()[1]) / 1024


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs /proc")
@pytest.mark.parametrize("megabytes", [10, pytest.param(200, marks=pytest.mark.long)])
def test_memory_of_check(megabytes: int, tmp_path: Path) -> None:
    count = write_large(tmp_path, megabytes)
    output, peak = check_in_a_process(tmp_path)
    assert f"{count}" in output
    assert peak <= LIMIT_MIB


@pytest.fixture
def few_rows_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reduction, "ROWS_KEPT", 3000)


def noisy() -> Recording:
    return loops((50.0, 150.0), cycles=3, rate=100.0, encoder_sd=0.01, pressure_sd=0.3, dwell=50)


@pytest.mark.usefixtures("few_rows_kept")
def test_averages_keep_strokes_levels_and_means(tmp_path: Path) -> None:
    recording = noisy()
    specimen = read(make(tmp_path, loops=recording.text()))
    found = specimen.loops
    assert found is not None and found.averaged > 2
    assert any("averaged" in note for note in specimen.notes)
    assert len(found.time_s) <= 1.2 * len(recording.time) / found.averaged
    assert specimen.levels_Pa / 1e3 == pytest.approx([50.0, 150.0], abs=0.2)
    assert found.stroke[-1] + 1 == 12
    assert set(found.cycle) == {1, 2, 3}
    told = summarise_loops(found, specimen.levels_Pa, 0.05).levels
    assert sum(level.rows for level in told) == pytest.approx(len(recording.time), rel=0.2)
    # No average mixes two levels or two branches: the force law of each holds for the means.
    sign = np.where(found.branch == 1, 1.0, -1.0)
    law = 0.3 * found.pressure_Pa / 1e3 * (1.0 - found.displacement_m * 1e3 / 20.0) * (1.0 + 0.05 * sign)
    assert np.quantile(np.abs(found.force_N - law) / law, 0.99) < 0.02
    assert np.abs(found.pressure_Pa[found.level == 0] - 50e3).max() < 1e3


@pytest.mark.usefixtures("few_rows_kept")
def test_averages_leave_empty_cells_out(tmp_path: Path) -> None:
    """A temperature in every seventh row, and averages of more rows and of fewer between."""
    recording = noisy()
    body = recording.text().splitlines()
    true = 20.0 + recording.time / 60.0
    cells = [f"{t:.4f}" if not i % 7 else "" for i, t in enumerate(true)]
    text = "\n".join([body[0] + ",temperature_C", *map(",".join, zip(body[1:], cells, strict=True))])
    found = read(make(tmp_path, loops=text)).loops
    assert found is not None and found.averaged > 2 and found.temperature_C is not None
    seven_rows_min = 7.0 * float(np.median(np.diff(recording.time))) / 60.0
    expected = 20.0 + (found.time_s + recording.time[0]) / 60.0
    assert np.abs(found.temperature_C - expected).max() < 1.5 * seven_rows_min


@pytest.mark.usefixtures("few_rows_kept")
def test_averages_do_not_depend_on_where_the_blocks_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mpam_calib.specimen.blocks.BLOCK_BYTES", 40_000)
    specimen = read(make(tmp_path, loops=noisy().text()))
    assert specimen.loops is not None and specimen.loops.stroke[-1] + 1 == 12


@pytest.mark.parametrize("size", [blocks.BLOCK_BYTES, 40_000])
def test_the_noise_of_one_reading_is_what_it_was_before_averaging(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: int
) -> None:
    """A part of the noise lasts for five rows, and stays in their means."""
    recorded, rng = noisy(), np.random.default_rng(3)
    fast, slow = 0.2 * rng.standard_normal((2, len(recorded.time)))
    kept = np.exp(-0.2 * np.arange(50))
    noise = fast + np.convolve(slow, kept)[: len(slow)] * np.sqrt(1.0 - kept[1] ** 2)
    folder = make(tmp_path, loops=replace(recorded, force=recorded.force + noise).text())
    every = read(folder).loops
    monkeypatch.setattr(reduction, "ROWS_KEPT", 3000)
    monkeypatch.setattr(blocks, "BLOCK_BYTES", size)
    means = read(folder).loops
    assert every is not None and every.averaged == 1 and every.noise_N == 0.0
    assert means is not None and means.averaged > 2
    assert force_noise(means) == pytest.approx(force_noise(every), rel=0.05)


def test_small_blocks_report_the_right_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mpam_calib.specimen.blocks.BLOCK_BYTES", 1000)
    lines = noisy().text().splitlines()
    lines[2345] = "1,2,x,4"
    with pytest.raises(InputError, match=r"loops.csv:2346:displacement_mm: "):
        read(make(tmp_path, loops="\n".join(lines)))


@pytest.mark.usefixtures("few_rows_kept")
def test_averages_do_not_stop_at_the_noise_of_a_setpoint_read_back(tmp_path: Path) -> None:
    recording = noisy()
    rng = np.random.default_rng(2)
    force_sd = 0.25
    commanded = 50.0 * np.round(recording.pressure / 50.0)
    columns = recording.columns()
    columns[:, 3] += force_sd * rng.standard_normal(len(commanded))
    setpoint = commanded + np.round(0.2 * rng.standard_normal(len(commanded)), 2)
    rows = [",".join(f"{value:.5f}" for value in row) for row in np.column_stack([columns, setpoint])]
    specimen = read(make(tmp_path, loops="\n".join([f"{HEADER},setpoint_kPa", *rows])))
    found = specimen.loops
    assert found is not None and found.averaged > 2
    assert len(found.time_s) * found.averaged == pytest.approx(len(commanded), rel=0.2)
    assert specimen.levels_Pa / 1e3 == pytest.approx([50.0, 150.0], abs=0.2)
    assert found.stroke[-1] + 1 == 12
    told = summarise_loops(found, specimen.levels_Pa, 0.05)
    assert told.sampling_Hz == pytest.approx([100.0], rel=0.1)
    assert told.noise_N == pytest.approx(force_sd, rel=0.1)


@pytest.mark.usefixtures("few_rows_kept")
def test_rows_that_were_not_averaged_are_not_said_to_be(tmp_path: Path) -> None:
    """Cycles of three rows: no mean spans two of them."""
    recording = noisy()
    cycle = np.arange(len(recording.time)) // 3 + 1
    body = recording.text().splitlines()
    rows = [f"{row},{number}" for row, number in zip(body[1:], cycle, strict=True)]
    specimen = read(make(tmp_path, loops="\n".join([f"{HEADER},cycle", *rows])))
    found = specimen.loops
    assert found is not None
    assert len(found.time_s) * found.averaged == pytest.approx(len(cycle), rel=0.2)


@pytest.mark.parametrize(("slack", "said"), [(0, False), (2, False), (3, True), (5, True)])
def test_a_mean_is_slack_where_at_least_half_of_its_rows_are(slack: int, said: bool) -> None:
    """Sixty rows on one stroke, six to a mean, whose number in the file is its first row's."""
    time = np.arange(60.0)
    frame = pd.DataFrame(
        {"time_s": time, "pressure_kPa": 100.0, "displacement_mm": 0.1 * time, "force_N": 90.0 - time},
        index=np.arange(60) + 2,
    )
    means, censored = reduction.average_rows(frame, 6, time >= 60 - slack)
    assert censored.tolist() == [False] * 9 + [said]
    assert means["force_N"].tolist() == pytest.approx(87.5 - 6.0 * np.arange(10))
    assert means.index.tolist() == list(range(2, 62, 6))
