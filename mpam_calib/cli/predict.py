"""``mpam-calib predict RUN [--pressure A:B:STEP]``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mpam_calib.cli.app import app
from mpam_calib.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@app.command()
def predict(
    run: Annotated[Path, typer.Argument(help="RUN folder that calibrate wrote")],
    pressure: Annotated[str, typer.Option(help="A:B:STEP in kPa, B included; the levels without it")] = "",
) -> None:
    """Bands on force, blocked force and free contraction at any pressures: RUN/predictions.csv."""
    from mpam_calib.calibration import predict as predict_bands
    from mpam_calib.run.files import write_csv
    from mpam_calib.run.folder import load_run

    pressures = _pressures(pressure) if pressure else None
    stored = load_run(run)
    write_csv(predict_bands(stored.model, stored.draws, stored.seed, pressures), run / "predictions.csv")
    print(run / "predictions.csv")


def _pressures(text: str) -> NDArray[np.float64]:
    """Pressures (kPa) of ``A:B:STEP``, or of a single ``A``."""
    import numpy as np

    expected = "A:B:STEP in kPa with 0 <= A <= B and STEP > 0"
    try:
        parts = [float(part) for part in text.split(":")]
    except ValueError as error:
        raise InputError("--pressure", f'"{text}"', expected) from error
    if len(parts) == 1 and 0.0 <= parts[0] < float("inf"):
        return np.array(parts)
    if len(parts) != 3 or not all(map(np.isfinite, parts)) or not 0 <= parts[0] <= parts[1] or parts[2] <= 0:
        raise InputError("--pressure", f'"{text}"', expected)
    first, last, step = parts
    # Half a step's millionth: rounding must not lose the last pressure.
    count = int(np.floor((last - first) / step + 1e-6)) + 1
    return first + step * np.arange(count)
