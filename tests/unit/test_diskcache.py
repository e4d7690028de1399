"""The disk cache: what is kept, what is made again, and what happens when the folder is not ours to write."""

from __future__ import annotations

import multiprocessing
import os
from pathlib import Path

import numpy as np
import pytest

from skincli import diskcache
from skincli.errors import UsageError


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SKINCLI_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


class Maker:
    """Counts how often it was asked."""

    def __init__(self, size: int = 4) -> None:
        self.calls = 0
        self.size = size

    def __call__(self) -> diskcache.Arrays:
        self.calls += 1
        return {"a": np.arange(self.size, dtype=np.float64), "b": np.array([[1, 2]], dtype=np.int32)}


def test_an_entry_is_made_once_and_returned_equal(folder: Path) -> None:
    maker = Maker()
    first, second = (diskcache.arrays("table", "key", maker) for _ in range(2))
    assert maker.calls == 1
    assert first.keys() == second.keys()
    for name in first:
        assert np.array_equal(first[name], second[name])
        assert first[name].dtype == second[name].dtype
    assert [path.suffix for path in folder.iterdir()] == [".npz"]


def test_kind_and_key_tell_entries_apart(folder: Path) -> None:
    maker = Maker()
    for kind, key in (("a", "b"), ("a", "c"), ("ab", ""), ("b", "b")):
        diskcache.arrays(kind, key, maker)
    assert maker.calls == 4


def test_a_switched_off_cache_touches_nothing(folder: Path) -> None:
    maker = Maker()
    for _ in range(2):
        diskcache.arrays("table", "key", maker, enabled=False)
    assert maker.calls == 2
    assert not folder.exists()


@pytest.mark.parametrize("damage", ["cut", "empty", "flipped", "other"])
def test_a_damaged_entry_is_made_again(folder: Path, damage: str) -> None:
    maker = Maker(1000)
    diskcache.arrays("table", "key", maker)
    (path,) = folder.iterdir()
    data = path.read_bytes()
    flipped = bytearray(data)
    flipped[len(data) // 2] ^= 255
    path.write_bytes({"cut": data[: len(data) // 2], "empty": b"", "flipped": bytes(flipped), "other": b"text"}[damage])
    again = diskcache.arrays("table", "key", maker)
    assert maker.calls == 2
    assert np.array_equal(again["a"], np.arange(1000))
    diskcache.arrays("table", "key", maker)
    assert maker.calls == 2


def test_a_folder_that_cannot_be_made_is_no_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("SKINCLI_CACHE", str(tmp_path / "file" / "cache"))
    maker = Maker()
    for _ in range(2):
        assert len(diskcache.arrays("table", "key", maker)["a"]) == 4
    assert maker.calls == 2


def test_the_least_recently_used_entries_make_room(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SKINCLI_CACHE_LIMIT_MB", "0.1")
    size = 4000  # 32 kB each: three fit
    for number, key in enumerate("xyz"):
        diskcache.arrays("table", key, Maker(size))
        (newest,) = set(folder.iterdir()) - {path for path in folder.iterdir() if path.stat().st_mtime < 1e6}
        os.utime(newest, (number, number))
    used = Maker(size)
    diskcache.arrays("table", "x", used)  # now the latest used, y the oldest
    diskcache.arrays("table", "w", Maker(size))
    calls = {}
    monkeypatch.setenv("SKINCLI_CACHE_LIMIT_MB", "100")
    for key in "xzwy":
        maker = Maker(size)
        diskcache.arrays("table", key, maker)
        calls[key] = maker.calls
    assert used.calls == 0
    assert calls == {"x": 0, "z": 0, "w": 0, "y": 1}


def test_what_is_larger_than_the_limit_is_not_kept(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SKINCLI_CACHE_LIMIT_MB", "0.01")
    diskcache.arrays("table", "key", Maker(100_000))
    assert not folder.exists() or not list(folder.iterdir())


@pytest.mark.parametrize("text", ["much", "-1", "nan"])
def test_a_limit_that_is_no_size_is_a_usage_error(folder: Path, monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setenv("SKINCLI_CACHE_LIMIT_MB", text)
    with pytest.raises(UsageError, match=f"SKINCLI_CACHE_LIMIT_MB is '{text}'"):
        diskcache.arrays("table", "key", Maker())


def test_the_folder_follows_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SKINCLI_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", "/somewhere")
    assert diskcache.folder() == Path("/somewhere/skincli")
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    monkeypatch.setenv("HOME", "/home/person")
    assert diskcache.folder() == Path("/home/person/.cache/skincli")
    monkeypatch.setenv("SKINCLI_CACHE", "/named")
    assert diskcache.folder() == Path("/named")


def _use(number: int) -> float:
    total = 0.0
    for key in range(8):
        total += diskcache.arrays("table", str(key), Maker(2000))["a"].sum()
    return total


def test_processes_share_a_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SKINCLI_CACHE_LIMIT_MB", "0.06")  # so small that they also remove each other's entries
    with multiprocessing.get_context("spawn").Pool(3) as pool:
        totals = pool.map(_use, range(3))
    assert totals == [8 * 2000 * 1999 / 2] * 3
    assert not [path for path in folder.iterdir() if path.name.startswith(".")]
