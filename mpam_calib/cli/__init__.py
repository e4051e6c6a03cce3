"""The command line: one module for each command, one place where errors become exit codes."""

from __future__ import annotations

import os
import sys

DONE, BAD_INPUT, NOT_CONVERGED, INTERRUPTED = 0, 2, 3, 130
"""Exit codes."""


def main() -> None:
    """Run the command line; the only place where an exception becomes a line and an exit code."""
    # One BLAS thread: the parallelism is over ensembles, and sums must not depend on the machine.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    import typer

    from mpam_calib.cli.app import app
    from mpam_calib.errors import InputError, Interrupted

    try:
        code = app(standalone_mode=False)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        code = BAD_INPUT
    except (Interrupted, KeyboardInterrupt, typer.Abort):
        print("interrupted: the same command resumes", file=sys.stderr)
        code = INTERRUPTED
    except Exception as error:
        # A wrong option: the command line's parser knows how to say so in one line.
        message = getattr(error, "format_message", None)
        if message is None:
            raise
        print(f"error: {message()}", file=sys.stderr)
        code = BAD_INPUT
    sys.exit(code)
