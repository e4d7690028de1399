"""Where the shaders and presets lie: inside the installed package, or beside it in a checkout."""

from __future__ import annotations

from functools import cache
from pathlib import Path


@cache
def folder(name: str) -> Path:
    """Return the folder `name` ("shaders" or "presets") that belongs to this installation.

    The wheel carries both inside the package; a checkout (and an editable install) has them beside it.
    """
    package = Path(__file__).resolve().parent
    for candidate in (package / name, package.parent / name):
        if candidate.is_dir():
            return candidate
    raise FileNotFoundError(f"this installation of skincli lacks its folder '{name}'; reinstall the package")
