"""Running the command line: in a process of its own, or in this one where only its result counts."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import pytest

from mpam_calib.cli import main
from mpam_calib.errors import InputError
from mpam_calib.posterior.chains.sampling import Listener, Progress

FAST = ("--no-correlated-noise", "--ess", "100")
"""Enough for tests of files and bytes: the noise of the small specimens is white."""
RESULTS = ("summary.csv", "bands.csv", "run.json", "posterior.nc", "report.html")
PATIENCE = 120.0


@dataclass(frozen=True)
class Result:
    """Exit code and what was printed."""

    code: int
    out: str
    err: str

    @property
    def unremarked(self) -> str:
        """What standard error holds beside the odd lines of the data; of a refusal, all."""
        lines = self.err.splitlines(keepends=True)
        return self.err if self.code == 2 else "".join(x for x in lines if not x.startswith("odd: "))

    @property
    def complaint(self) -> str:
        """The one line of an error; fails where there is more, or a traceback."""
        lines = self.unremarked.splitlines()
        assert len(lines) == 1, self.err
        return lines[0]


def refuse(*arguments: object, listener: Listener, **options: object) -> NoReturn:
    """A calibration that begins and finds that its data cannot be used."""
    listener(Progress("warming up", 0, 1.0, 1.0, 0.0))
    raise InputError("the data", "no finite probability", "readings")


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "mpam_calib", *map(str, arguments)]


def start(*arguments: object) -> subprocess.Popen[str]:
    """The command in a session of its own, as a shell would start it."""
    return subprocess.Popen(
        command(*arguments),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def finish(process: subprocess.Popen[str]) -> Result:
    out, err = process.communicate(timeout=PATIENCE)
    return Result(process.returncode, out, err)


def run(*arguments: object) -> Result:
    """The command in a process of its own."""
    return finish(start(*arguments))


@dataclass(frozen=True)
class Here:
    """The command in this process: without the seconds that its imports take."""

    capture: pytest.CaptureFixture[str]
    patch: pytest.MonkeyPatch

    def __call__(self, *arguments: object) -> Result:
        self.capture.readouterr()
        self.patch.setattr(sys, "argv", ["mpam-calib", *map(str, arguments)])
        before = signal.getsignal(signal.SIGINT)
        try:
            with pytest.raises(SystemExit) as end:
                main()
        finally:
            signal.signal(signal.SIGINT, before)
        printed = self.capture.readouterr()
        code = end.value.code
        assert isinstance(code, int)
        return Result(code, printed.out, printed.err)


def contents(folder: Path) -> dict[str, bytes]:
    """Every file of a folder, by its path inside it."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def stamps(folder: Path) -> dict[str, int]:
    """When every file of a folder was last written, ns."""
    return {str(p.relative_to(folder)): p.stat().st_mtime_ns for p in folder.rglob("*") if p.is_file()}


def living(session: int) -> list[int]:
    """Processes of a session that still run (Linux)."""
    found = []
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            fields = (entry / "stat").read_text().rpartition(")")[2].split()
        except (OSError, UnicodeDecodeError):
            continue
        state, owner = fields[0], int(fields[3])
        if owner == session and state != "Z":
            found.append(int(entry.name))
    return found


def all_gone(session: int, seconds: float = 5.0) -> bool:
    """Whether a session's processes end within some seconds."""
    end = time.monotonic() + seconds
    while living(session):
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


def wait_for(process: subprocess.Popen[str], path: Path, part: str | None = None) -> bool:
    """Wait until a file is there, or a part below a folder; False where the process ended before."""
    end = time.monotonic() + PATIENCE
    while not (path.exists() and (part is None or any(path.rglob(part)))):
        if process.poll() is not None:
            return False
        assert time.monotonic() < end, f"{path} never came"
        time.sleep(0.005)
    return True


def kill(process: subprocess.Popen[str]) -> None:
    """SIGKILL to the parent alone: its workers have to notice by themselves."""
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    for stream in (process.stdout, process.stderr):
        if stream is not None:
            stream.close()
