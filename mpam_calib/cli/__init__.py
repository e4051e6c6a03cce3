"""The command line: one module for each command, one place where errors become exit codes."""

from __future__ import annotations

import errno
import io
import os
import signal
import sys
from collections.abc import Sequence
from types import FrameType

from mpam_calib.errors import InputError, Interrupted

DONE, BAD_INPUT, NOT_CONVERGED, INTERRUPTED = 0, 2, 3, 130
"""Exit codes."""
NO_ROOM = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS}
"""What a full or failing disk says, without a file's name."""


def main() -> None:
    """Run the command line; the only place where an exception becomes a line and an exit code."""
    # A name that the output's encoding lacks is no error (stderr escapes anyway; a closed output is None).
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    # One BLAS thread: the parallelism is over ensembles, and sums must not depend on the machine.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[variable] = "1"
    global _ctrl_c
    ctrl_c = _ctrl_c = CtrlC()
    signal.signal(signal.SIGINT, ctrl_c)
    sys.unraisablehook = _unraisable
    try:
        code = _run()
    except (Interrupted, KeyboardInterrupt) as error:
        code = _interrupted(error)
    except InputError as error:
        code = _refused(str(error))
    except BrokenPipeError:
        # The reader of our output went away (mpam-calib ... | head): nobody is left to tell.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = DONE
    except OSError as error:
        if error.filename is None and error.errno not in NO_ROOM:
            raise
        where = error.filename or "output"
        code = _refused(f"{where}: found {error.strerror}, expected a place to read or write")
    except Exception as error:
        # Compiled code may turn Ctrl-C into an error of its own.
        if not ctrl_c.pressed:
            raise
        code = _interrupted(error)
    sys.exit(code)


class Stopped(KeyboardInterrupt):
    """Ctrl-C was pressed.

    Not ``KeyboardInterrupt`` itself: when that passes through ``exec`` of a text (which makes every
    dataclass), Python remembers it as unhandled and ends with a signal instead of our exit code.
    """


class CtrlC:
    """Ctrl-C stops this process; workers that were just forked leave the decision to it."""

    def __init__(self) -> None:
        self.process = os.getpid()
        self.pressed = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Handle the signal."""
        if os.getpid() == self.process:
            self.pressed = True
            raise Stopped


_ctrl_c: CtrlC | None = None


def stop_where_pressed() -> None:
    """Stop here where Ctrl-C was pressed and got lost: Python drops what is raised inside a finaliser."""
    if _ctrl_c is not None and _ctrl_c.pressed and _ctrl_c.process == os.getpid():
        raise Stopped


def _unraisable(lost: sys.UnraisableHookArgs) -> None:
    """Ctrl-C that Python drops is not worth a traceback: ``stop_where_pressed`` makes up for it."""
    if not isinstance(lost.exc_value, Stopped):
        sys.__unraisablehook__(lost)


def _run() -> int:
    """The exit code of one command; what the parser refuses is told in one line."""
    import typer

    from mpam_calib.cli.app import app

    if place := _empty_word(sys.argv[1:]):
        return _refused(f"{place}: found an empty word, expected a name or a value")
    if len(sys.argv) == 1:
        app(["--help"], standalone_mode=False)
        return _refused("command line: found no command, expected one of those above")
    try:
        code = int(app(standalone_mode=False) or DONE)
    except typer.Abort as error:
        raise Interrupted from error
    except Exception as error:
        # A wrong option: the parser knows what it is.
        if not hasattr(error, "format_message"):
            raise
        from mpam_calib.cli.usage import usage_message

        return _refused(usage_message(error))
    if code == INTERRUPTED:
        # The parser has swallowed Ctrl-C.
        raise Interrupted
    return code


def _empty_word(words: Sequence[str]) -> str:
    """Where the command line has an empty word, as an unset variable leaves it; "" where it has none.

    A path would take it for the current folder, and nothing else takes it at all.
    """
    for before, word in zip(["", *words], words, strict=False):
        name, mark, value = word.partition("=")
        if name.startswith("--") and mark and not value:
            return name
        if not word.strip():
            return before if before.startswith("-") else "command line"
    return ""


def _refused(message: str) -> int:
    print(f"error: {message}", file=sys.stderr)
    return BAD_INPUT


def _interrupted(error: BaseException) -> int:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    words = str(error) if isinstance(error, Interrupted) else ""
    print(words or "interrupted", file=sys.stderr)
    return INTERRUPTED
