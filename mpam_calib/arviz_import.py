"""ArviZ, imported where it is first needed.

Its import takes a second, warns of its own future once a day, and notes that it did in a folder of the
user's: where that folder cannot be written (a container without a home), the import fails.
"""

from __future__ import annotations

import os
import tempfile
import warnings
from importlib import import_module
from types import ModuleType

CACHE = "XDG_CACHE_HOME"
"""Variable that says where a program may keep what it can do without."""


def import_arviz() -> ModuleType:
    """ArviZ, without its warning, and whether or not the user has a folder for its notes."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"\s*ArviZ is undergoing", FutureWarning)
        try:
            return import_module("arviz")
        except OSError:
            declared = os.environ.get(CACHE)
            with tempfile.TemporaryDirectory() as folder:
                os.environ[CACHE] = folder
                try:
                    return import_module("arviz")
                finally:
                    del os.environ[CACHE]
                    if declared is not None:
                        os.environ[CACHE] = declared
