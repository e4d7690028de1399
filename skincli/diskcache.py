"""Arrays that are dear to make, kept on disk between runs: unwraps, baked tables, built-in meshes."""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skincli import __version__
from skincli.errors import UsageError

DEFAULT_LIMIT_MB = 2048

Arrays = dict[str, NDArray[Any]]


def folder() -> Path:
    """Return where entries lie: $SKINCLI_CACHE, else $XDG_CACHE_HOME/skincli, else ~/.cache/skincli.

    The folder need not exist. A relative $XDG_CACHE_HOME is ignored, as its specification demands.
    """
    if named := os.environ.get("SKINCLI_CACHE"):
        return Path(named)
    base = Path(os.environ.get("XDG_CACHE_HOME", ""))
    if not base.is_absolute():
        try:
            base = Path.home() / ".cache"
        except RuntimeError:
            # An account without a home (a container's bare user id) works uncached: nothing can be made under a device.
            base = Path(os.devnull)
    return base / "skincli"


def limit_bytes() -> int:
    """Return how many bytes the folder may hold, from $SKINCLI_CACHE_LIMIT_MB (MiB) or the default.

    Raises
    ------
    UsageError
        If the variable is not a number of at least 0.
    """
    text = os.environ.get("SKINCLI_CACHE_LIMIT_MB", str(DEFAULT_LIMIT_MB))
    try:
        limit = float(text) * 2**20
        if limit >= 0:
            return int(limit)
    except (ValueError, OverflowError):
        pass
    raise UsageError(f"SKINCLI_CACHE_LIMIT_MB is '{text}'; a number of MiB, 0 or more, is allowed; correct or unset it")


def arrays(kind: str, key: str, make: Callable[[], Arrays], *, enabled: bool = True) -> Arrays:
    """Return the arrays of an entry, made only when the folder does not hold them.

    Safe among processes: entries appear whole or not at all, and what cannot be read is made again. A folder
    that cannot be written costs time, never an error. The entries not used for longest make room for new ones.

    Parameters
    ----------
    kind : what the arrays are ("unwrap"); part of the file's name, so letters and digits only
    key : everything the arrays depend on, as text or a hash; the package's version is added here
    make : computes the arrays; none may hold Python objects
    enabled : False neither reads nor writes the folder

    Returns
    -------
    name -> array, equal to what `make` returned when the entry was written

    Raises
    ------
    UsageError
        If SKINCLI_CACHE_LIMIT_MB is no number.
    """
    if not enabled:
        return make()
    found = find(kind, key)
    if found is None:
        found = make()
        keep(kind, key, found)
    return found


def find(kind: str, key: str) -> Arrays | None:
    """Return the arrays of an entry, see `arrays`, or None where the folder does not hold it whole."""
    limit_bytes()
    return _read(_path(kind, key))


def keep(kind: str, key: str, entry: Arrays) -> None:
    """Write an entry, see `arrays`; what cannot be written is not kept."""
    limit = limit_bytes()
    with contextlib.suppress(OSError):
        _write(_path(kind, key), entry, limit)


def _path(kind: str, key: str) -> Path:
    digest = hashlib.blake2b("\0".join((kind, key, __version__)).encode(), digest_size=16).hexdigest()
    return folder() / f"{kind}-{digest}.npz"


def _read(path: Path) -> Arrays | None:
    """Return the arrays in `path`, or None when they are missing or damaged (the container carries checksums)."""
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as entry:
            found = {name: entry[name] for name in entry.files}
    except (OSError, EOFError, ValueError, KeyError, AttributeError, NotImplementedError, zipfile.BadZipFile):
        return None
    # The modification time serves as "last used": access times are switched off on many machines.
    with contextlib.suppress(OSError):
        os.utime(path)
    return found


def _write(path: Path, entry: Arrays, limit: int) -> None:
    """Write `entry` beside `path`, rename it there, and remove the least recently used entries above `limit` bytes."""
    if sum(array.nbytes for array in entry.values()) > limit:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(suffix=path.suffix, prefix=f".{path.stem}-", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as stream:
            np.savez(stream, **entry)  # type: ignore[arg-type]
        os.replace(name, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(name)
        raise
    _evict(path.parent, limit, newest=path)


def _evict(where: Path, limit: int, newest: Path) -> None:
    """Remove entries, the least recently used first, until at most `limit` bytes are left; `newest` goes last."""
    entries = []
    for path in where.glob("*.npz"):
        # Another process may have removed it since it was listed.
        with contextlib.suppress(OSError):
            state = path.stat()
            entries.append((path == newest, state.st_mtime_ns, state.st_size, path))
    total = sum(size for _, _, size, _ in entries)
    for _, _, size, path in sorted(entries):
        if total <= limit:
            break
        with contextlib.suppress(OSError):
            path.unlink()
        total -= size
