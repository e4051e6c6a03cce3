"""The command line itself: help, errors in one line, exit codes, a bar only where someone looks."""

from __future__ import annotations

import os
import pty
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from run.command import Here, Result
from specimen.folders import DECLARATION, loops, make

from mpam_calib.cli import main
from mpam_calib.cli.app import ORDER
from mpam_calib.cli.progress import sampling_progress
from mpam_calib.posterior.chains.sampling import Progress
from mpam_calib.run import diagnose as diagnosed
from mpam_calib.run import select as selected
from mpam_calib.run import synthetic
from mpam_calib.run.predict import parse_pressures
from mpam_calib.specimen.toml_source import SPECIMEN_FILE

COMMAND = [sys.executable, "-m", "mpam_calib"]


def run(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*COMMAND, *arguments],
        capture_output=True,
        text=True,
        timeout=60,
        env={**os.environ, **environment},
        check=False,
    )


def test_help_lists_the_commands_in_the_order_of_use() -> None:
    result = run("--help")
    assert (result.returncode, result.stderr) == (0, "")
    listed = re.findall(r"^  ([a-z]+)  ", result.stdout.partition("Commands:")[2], flags=re.MULTILINE)
    assert {"init", "check", "calibrate", "predict"} <= set(listed) <= set(ORDER)
    assert listed == [name for name in ORDER if name in listed]


@pytest.mark.parametrize("command", ["calibrate", "predict"])
def test_each_option_is_explained_within_a_window_of_80_columns(command: str) -> None:
    text = run(command, "--help", COLUMNS="80").stdout
    assert max(map(len, text.splitlines())) <= 80
    assert "…" not in text and "\x1b" not in text
    options = text.partition("Options:")[2]
    for entry in re.split(r"\n  (?=-)", options.strip("\n")):
        assert re.search(r" {2,}[A-Z][a-z]+", entry), entry


@pytest.mark.parametrize(
    ("command", "files"),
    [
        ("select", selected.FILES),
        ("diagnose", diagnosed.FILES),
        ("simulate", (SPECIMEN_FILE, synthetic.LOOPS, synthetic.FORCE_MAP, synthetic.TRUTH)),
    ],
)
def test_help_names_the_files_that_are_written(command: str, files: tuple[str, ...]) -> None:
    words = run(command, "--help").stdout.replace(",", " ").split()
    assert set(files) <= set(words)


def test_help_says_what_replaces_a_run() -> None:
    text = " ".join(run("calibrate", "--help").stdout.split())
    assert "other data, another model, seed or options replace it" in text


def test_help_of_pressure_says_what_is_meant() -> None:
    text = " ".join(run("predict", "--help").stdout.split())
    assert "--pressure A:B:STEP" in text
    assert "One pressure A, or A:B:STEP, in kPa, B included" in text


def test_help_comes_at_once() -> None:
    run("--help")
    times = []
    for _ in range(5):
        before = time.perf_counter()
        run("--help")
        times.append(time.perf_counter() - before)
    assert min(times) < 0.5


def test_the_commands_load_nothing_heavy() -> None:
    heavy = ("numpy", "scipy", "pandas", "arviz", "matplotlib", "emcee", "pydantic", "xarray", "jinja2")
    code = f"import sys, mpam_calib.cli.app; print([m for m in {heavy!r} if m in sys.modules])"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


@pytest.mark.parametrize(
    "arguments",
    [
        ("calbrate",),
        ("calibrate",),
        ("calibrate", "x"),
        ("calibrate", "x", "-o"),
        ("calibrate", "x", "y", "-o", "z"),
        ("calibrate", "x", "-o", "z", "--sed", "1"),
        ("calibrate", "x", "-o", "z", "--seed", "one"),
        ("calibrate", "x", "-o", "z", "--seed", "-1"),
        ("calibrate", "x", "-o", "z", "--max-steps", "0"),
        ("calibrate", "x", "-o", "z", "--ess", "nan"),
        ("calibrate", "nowhere", "-o", "z"),
        ("calibrate", "", "-o", "z"),
        ("predict",),
        ("predict", "nowhere"),
        ("predict", "nowhere", "--pressure", "much"),
        ("--nonsense",),
    ],
    ids=" ".join,
)
def test_wrong_usage_is_one_line_and_exit_2(
    arguments: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = run(*arguments)
    assert result.returncode == 2
    assert result.stdout == ""
    assert re.fullmatch(r"error: \S.*\n", result.stderr), result.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("check", "SPECIMEN: found nothing, expected an argument (specimen folder, or its specimen.toml)"),
        (
            "calibrate",
            "SPECIMEN: found nothing, expected an argument (specimen folder, or its specimen.toml)",
        ),
        ("calibrate x", "--output: found nothing, expected this option (folder to write, resume or keep)"),
        ("simulate x -o y --hide", "--hide: found nothing, expected a value after it"),
        ("calibrate x -o z --remainder=3", "--remainder: found a value, expected none"),
        ("calibrate x -o z --seed one", '--seed: found "one", expected a valid integer'),
        ("calibrate x -o z --seed=-1", '--seed: found "-1", expected greater than or equal to 0'),
        ("--nonsense", "--nonsense: found an unknown option, expected one that --help lists"),
        (
            "calibrate x -o z --sed 1",
            '--sed: found an unknown option (did you mean "--seed"?), expected one that --help lists',
        ),
        ("predict x y", "command line: found unexpected extra argument(s) (y), expected what --help lists"),
        (
            "calbrate",
            'command line: found the unknown command "calbrate" (did you mean "calibrate"?), expected one of '
            '"init", "check", "calibrate", "select", "diagnose", "predict", '
            '"optimize", "simulate", "reproduce"',
        ),
    ],
)
def test_wrong_usage_is_said_as_all_else_is(
    arguments: str, said: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["mpam-calib", *arguments.split()])
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(SystemExit) as end:
        main()
    signal.signal(signal.SIGINT, before)
    assert end.value.code == 2
    assert capsys.readouterr().err == f"error: {said}\n"


def test_a_misspelt_command_is_guessed() -> None:
    assert "calibrate" in run("calbrate").stderr


def test_without_a_command_the_help_is_shown() -> None:
    result = run()
    assert result.returncode == 2
    assert "Commands:" in result.stdout
    assert result.stderr.startswith("error: ") and result.stderr.count("\n") == 1


def test_output_that_nobody_reads_is_no_error(tmp_path: Path) -> None:
    run("init", str(tmp_path / "new"))
    reader, writer = os.pipe()
    os.close(reader)
    result = subprocess.run(
        [*COMMAND, "check", str(tmp_path / "new")],
        stdout=writer,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    os.close(writer)
    assert "Traceback" not in result.stderr


@pytest.mark.parametrize(("encoding", "said"), [("ascii", r"\u0420\u0435\u0437"), ("utf-8", "Рез")])
def test_a_name_that_the_output_cannot_hold_is_escaped(encoding: str, said: str, tmp_path: Path) -> None:
    text = DECLARATION.replace("Test muscle", "Рез")
    folder = make(tmp_path / "new", text, loops=loops(rate=20.0).text())
    result = run("check", str(folder), PYTHONIOENCODING=encoding)
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.startswith(said)


@pytest.mark.parametrize("closed", [">&-", ">&- 2>&-"])
@pytest.mark.parametrize("command", ["check", "init", "--version"])
def test_a_closed_output_is_no_error(closed: str, command: str, tmp_path: Path) -> None:
    run("init", str(tmp_path / "new"))
    (tmp_path / "new" / "loops.csv").write_text(loops(rate=20.0).text())
    there = {"check": [tmp_path / "new"], "init": [tmp_path / "other"]}.get(command, [])
    line = shlex.join([*COMMAND, command, *map(str, there)])
    result = subprocess.run(["sh", "-c", f"{line} {closed}"], capture_output=True, text=True, check=False)
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")


BAR = """
from mpam_calib.cli.app import ORDER
from mpam_calib.cli.progress import sampling_progress
from mpam_calib.posterior.chains.sampling import Progress
import time
with sampling_progress(400) as tell:
    tell(Progress("warming up", 0, float("nan"), 0.0, 0.0))
    for steps in (40, 80, 120):
        time.sleep(0.3)
        tell(Progress("sampling", steps, 1.02, steps, steps / 400))
"""


def test_a_terminal_sees_a_bar_with_the_time_left() -> None:
    leader, follower = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "120"}
    process = subprocess.Popen([sys.executable, "-c", BAR], stderr=follower, env=environment)
    os.close(follower)
    seen = b""
    while True:
        try:
            seen += os.read(leader, 4096)
        except OSError:
            break
    os.close(leader)
    assert process.wait(timeout=60) == 0
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", seen.decode())
    assert "warming up" in text
    assert re.search(r"0:00:0\d gone, 0:00:0\d left \(\d+ steps, ESS \d+, R-hat 1\.020\)", text), text


def test_a_pipe_sees_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    with sampling_progress(400) as tell:
        tell(Progress("sampling", 40, 1.02, 40.0, 0.1))
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("100:200:50", [100.0, 150.0, 200.0]),
        ("0:0.3:0.1", [0.0, 0.1, 0.2, 0.3]),
        ("100:250:100", [100.0, 200.0, 250.0]),
        ("100:100:10", [100.0]),
        ("120", [120.0]),
        ("0:1:0.333333333", [0.0, 0.333333333, 0.666666666, 1.0]),
    ],
)
def test_pressures_include_the_last(text: str, expected: list[float]) -> None:
    assert parse_pressures(text).tolist() == expected


def test_the_version_is_told() -> None:
    import mpam_calib

    assert run("--version").stdout.strip() == mpam_calib.__version__


def test_a_data_file_is_no_specimen(tmp_path: Path) -> None:
    (tmp_path / "loops.csv").write_text("time_s,force_N\n0,1\n")
    result = run("check", str(tmp_path / "loops.csv"))
    assert result.returncode == 2
    assert result.stderr.endswith(
        "loops.csv: found a data file, expected a specimen folder with its specimen.toml\n"
    )


@pytest.mark.parametrize(
    ("words", "place"),
    [
        *(
            ([command, "specimen", "-o", ""], "-o")
            for command in ("calibrate", "select", "diagnose", "simulate")
        ),
        (["reproduce", "--output="], "--output"),
        (["calibrate", "specimen", "--output", " "], "--output"),
        *(([name, ""], "command line") for name in ("init", "check", "predict", "optimize")),
    ],
)
def test_an_empty_word_is_no_folder(
    words: list[str],
    place: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """As an unset variable leaves it: not the current folder, in which nothing is written."""
    make(tmp_path / "specimen", DECLARATION, loops=loops().text())
    before = sorted(tmp_path.rglob("*"))
    monkeypatch.chdir(tmp_path)
    told = Here(capsys, monkeypatch)(*words)
    assert told == Result(2, "", f"error: {place}: found an empty word, expected a name or a value\n")
    assert sorted(tmp_path.rglob("*")) == before
