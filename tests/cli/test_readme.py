"""The README's library example does what it says."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = re.findall(
    r"^```python\n(.*?)^```", (ROOT / "README.md").read_text("utf-8"), re.DOTALL | re.MULTILINE
)


@pytest.mark.skipif(not EXAMPLES, reason="README.md holds no library example yet")
def test_the_readmes_example_runs(tmp_path: Path) -> None:
    # Data sets are named as seen from the repository; what the example writes stays out of it.
    (tmp_path / "datasets").symlink_to(ROOT / "datasets")
    for example in EXAMPLES:
        lines = [line for line in example.splitlines() if line.strip()]
        assert len(lines) <= 15
        result = subprocess.run(
            [sys.executable, "-W", "error::DeprecationWarning:__main__", "-c", example],
            capture_output=True,
            text=True,
            timeout=240,
            cwd=tmp_path,
            env={**os.environ, "MPLBACKEND": "agg"},
            check=False,
        )
        assert result.returncode == 0, result.stderr
        assert ("print(" not in example) or result.stdout.strip()
