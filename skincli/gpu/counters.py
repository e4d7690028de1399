"""Counts of what the GPU was asked to do, so that tests and reports can hold claims of skipping against them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass


@dataclass
class Counters:
    """Running totals of this process.

    Parameters
    ----------
    draws, compiles, uploads : numbers of draw calls, compiled programs, texture and mesh uploads
    textures : how many were made
    bytes_uploaded, bytes_read : bytes sent to the GPU and read back from it
    bytes_live, peak_bytes : bytes of textures that exist now, and the most that existed at once
    """

    draws: int = 0
    compiles: int = 0
    uploads: int = 0
    textures: int = 0
    bytes_uploaded: int = 0
    bytes_read: int = 0
    bytes_live: int = 0
    peak_bytes: int = 0

    def allocated(self, count: int) -> None:
        """Note `count` bytes of new texture memory (negative when freed)."""
        self.bytes_live += count
        self.peak_bytes = max(self.peak_bytes, self.bytes_live)

    def since(self, before: Mapping[str, int]) -> dict[str, int]:
        """Return how much was counted since a snapshot; the two totals of live memory are left out."""
        now = self.snapshot()
        return {name: now[name] - before[name] for name in now if name not in ("bytes_live", "peak_bytes")}

    def snapshot(self) -> dict[str, int]:
        """Return the totals as a plain mapping."""
        return asdict(self)


COUNTERS = Counters()
