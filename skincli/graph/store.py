"""The memo: textures by content key, least recently used first out, bounded in bytes."""

from __future__ import annotations

import math
import os
from collections import OrderedDict
from collections.abc import Collection, Sequence

from skincli.errors import UsageError
from skincli.gpu.textures import Shape, Texture, TexturePool, bytes_of, destroy_texture

DEFAULT_BUDGET_MB = 1024


def default_budget() -> int:
    """Return the memo's budget in bytes; the environment variable SKINCLI_MEMO_MB overrides it.

    Raises
    ------
    UsageError : the variable is not a number, 0 or more
    """
    text = os.environ.get("SKINCLI_MEMO_MB", str(DEFAULT_BUDGET_MB))
    try:
        megabytes = float(text)
    except ValueError:
        megabytes = math.nan
    if not 0 <= megabytes < math.inf:
        raise UsageError(f"SKINCLI_MEMO_MB is '{text}'; it must be a number of megabytes, 0 or more")
    return int(megabytes * 1_000_000)


class Store:
    """Textures that were computed, by key.

    Parameters
    ----------
    budget : bytes that textures nobody needs at the moment may take; 0 keeps nothing
    """

    def __init__(self, budget: int | None = None) -> None:
        self.budget = default_budget() if budget is None else budget
        self.pool = TexturePool()
        self._kept: OrderedDict[str, Texture] = OrderedDict()
        self._owned: set[str] = set()
        self._dear: set[str] = set()

    def __contains__(self, key: str) -> bool:
        return key in self._kept

    def get(self, key: str) -> Texture:
        """Return a texture that is here, and mark it used."""
        self._kept.move_to_end(key)
        return self._kept[key]

    def put(self, key: str, texture: Texture, pooled: bool = True, dear: bool = False) -> None:
        """Keep a texture.

        Parameters
        ----------
        pooled : False (an upload) is destroyed on eviction, not handed out again
        dear : costs more to make than its memory is worth, and goes last
        """
        self._kept[key] = texture
        if not pooled:
            self._owned.add(key)
        if dear:
            self._dear.add(key)

    def evict(self, pinned: Collection[str], coming: Sequence[Shape] = ()) -> None:
        """Let go of the least recently used textures until the rest fits the budget; pinned ones stay.

        What has the shape of what is coming goes first: fresh memory costs software GL more than most passes do. Dear
        ones go only when no other is left, for the targets of one large picture may fill the budget alone.
        Memory that waits to be handed out again counts too, and is freed first.

        Parameters
        ----------
        coming : what is drawn next, for which memory that is let go is held
        """
        total = sum(texture.bytes for texture in self._kept.values())
        room = sum(map(bytes_of, coming))

        def last(key: str) -> tuple[bool, bool]:
            # An upload is destroyed, and nothing can be drawn into it.
            return key in self._dear, key in self._owned or self._kept[key].shape not in coming

        for key in sorted(self._kept, key=last):  # stable: the least recently used first
            if total <= self.budget - room:
                break
            if key in pinned:
                continue
            texture = self._kept.pop(key)
            self._dear.discard(key)
            total -= texture.bytes
            if key in self._owned:
                self._owned.discard(key)
                destroy_texture(texture)
            else:
                self.pool.release(texture)
        self.pool.trim(max(self.budget - total, room), coming)

    def clear(self, but_dear: bool = False) -> None:
        """Forget everything, or all but what was drawn and is dear, and free its memory."""
        budget, self.budget = self.budget, 0
        self.evict(self._dear - self._owned if but_dear else ())
        self.budget = budget
