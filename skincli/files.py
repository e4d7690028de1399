"""Where a file named in YAML may lie, and what a person is told when it does not."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated

from pydantic import PlainValidator, ValidationInfo, WithJsonSchema

from skincli import resources
from skincli.errors import InputError, did_you_mean

ROOTS_VARIABLE = "SKINCLI_ASSET_ROOTS"


def asset_roots(options: Iterable[str | Path] = ()) -> tuple[Path, ...]:
    """Return the folders that may hold assets beside the scene's own: `--asset-root` first, then the environment's.

    Parameters
    ----------
    options : the values of `--asset-root`, relative to the working folder

    Raises
    ------
    InputError : one of them is not a folder
    """
    named = [("--asset-root", os.fspath(option)) for option in options]
    named += [(ROOTS_VARIABLE, part) for part in os.environ.get(ROOTS_VARIABLE, "").split(os.pathsep) if part]
    for source, text in named:
        if not Path(text).is_dir():
            raise InputError(f"{source} names '{text}', which is not a folder; name an existing folder")
    return tuple(Path(text).resolve() for _, text in named)


def resolve(path_text: str | Path, base: Path, roots: Sequence[Path], what: str, *, folders: bool = False) -> Path:
    """Return the existing file that `path_text` means, symbolic links resolved.

    Parameters
    ----------
    path_text : the path as written, relative to `base`
    base : folder of the file in which the path is written; the path may lead anywhere inside it
    roots : further folders that may hold the file, see `asset_roots`; the packaged presets always may
    what : how a message calls the path, such as "mesh.file"
    folders : whether it may be a folder

    Raises
    ------
    InputError : a URL, a path that leaves the allowed folders, or no such file
    """
    text = os.fspath(path_text)
    try:
        return _locate(text, base, roots, folders)
    except ValueError as error:
        raise InputError(f"{what} is {text!r}; {error}") from None


def _locate(text: str, base: Path, roots: Sequence[Path], folders: bool = False) -> Path:
    """Do the work of `resolve`; a ValueError carries the second half of the sentence."""
    if not text.strip() or "\0" in text:
        raise ValueError("it must be the path of a file")
    # One letter before the colon is a Windows drive.
    if re.match(r"[A-Za-z][A-Za-z0-9+.-]+:", text):
        raise ValueError("it must be a path, not a URL; save the file beside the scene and write its name")
    try:
        path = (base / text).resolve()
    except (OSError, RuntimeError):
        raise ValueError("its symbolic links lead in a circle; mend them") from None
    # The check comes before any look at the disk, so that a message never tells what exists elsewhere.
    if not any(path.is_relative_to(allowed.resolve()) for allowed in (base, *_presets(), *roots)):
        link = "" if Path(os.path.normpath(base / text)) == path else " by a symbolic link"
        raise ValueError(
            f"it leads{link} outside the folder '{base.resolve()}'; move the file into that folder, "
            f"or allow its own with --asset-root DIR or {ROOTS_VARIABLE}"
        )
    try:
        if path.is_dir() and not folders:
            raise ValueError("that is a folder; name a file in it")
        if not path.is_file() and not path.is_dir():
            raise ValueError(f"no such file{nearest(path)}")
    except OSError as error:
        raise ValueError(f"it cannot be read: {error.strerror}") from None
    return path


def file_digest(path: Path) -> str:
    """Return the hash of a file's bytes."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16)).hexdigest()


def nearest(path: Path) -> str:
    """Say of a missing file where it was sought, and which name there comes nearest."""
    folder = path.parent.resolve()
    if not folder.is_dir():
        return f": there is no folder '{folder}'"
    try:
        names = sorted(entry.name for entry in folder.iterdir())
    except OSError:
        names = []
    return f" in '{folder}'{did_you_mean(path.name, names)}"


def _presets() -> tuple[Path, ...]:
    try:
        return (resources.folder("presets"),)
    except FileNotFoundError:
        return ()


def _asset(value: object, info: ValidationInfo) -> Path:
    if not isinstance(value, str | Path):
        raise ValueError("it must be the path of a file, as text")
    if info.context is None or "base" not in info.context:
        return Path(value)
    return _locate(os.fspath(value), info.context["base"], info.context["roots"])


AssetPath = Annotated[Path, PlainValidator(_asset), WithJsonSchema({"type": "string", "format": "path"})]
"""A field that names a file. Validated with the context {"base": folder, "roots": folders}, it becomes the resolved
path, so that a missing or forbidden file is reported at its line; without a context it stays as it is."""


def _picture(value: object, info: ValidationInfo) -> Path:
    from skincli.images import size_of  # here, for OpenImageIO takes its time to load

    path = _asset(value, info)
    if info.context is not None and "base" in info.context:
        try:
            size_of(path, str(value))
        except InputError as error:
            raise ValueError(f"that file {error.faults[0].message}") from None
    return path


PicturePath = Annotated[Path, PlainValidator(_picture), WithJsonSchema({"type": "string", "format": "path"})]
"""An AssetPath whose file is a picture, told by its header: a wrong or broken one is reported at its line, too."""
