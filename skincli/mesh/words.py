"""Integers that ride in the float32 of a texture, and the shape of the textures that hold long lists of them.

A word is 30 bits in a float32 whose exponent lies in the normal range, so that no driver changes it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from skincli.mesh.bits import parts

#: texels of a row of a list, a power of two
WIDTH = 4096

#: bits of a word
WORD_BITS = 30


def table(words: NDArray[np.integer[Any]]) -> NDArray[np.float32]:
    """Return 30-bit words as (h, WIDTH, 1) floats, zero beyond them."""
    padded = np.zeros(height(len(words)) * WIDTH, dtype=np.float32)
    for part in parts(len(words)):
        padded[part] = as_floats(words[part])
    return padded.reshape(-1, WIDTH, 1)


def as_floats(words: NDArray[np.integer[Any]]) -> NDArray[np.float32]:
    """Return 30-bit words in float32 bit patterns that no driver flushes or quiets: exponents 64 to 127."""
    words = np.asarray(words, dtype=np.uint32)
    bits = words >> np.uint32(29)
    bits <<= np.uint32(31)
    bits |= words & np.uint32(0x1FFFFFFF)
    bits |= np.uint32(0x20000000)
    return bits.view(np.float32)


def as_words(floats: NDArray[np.float32]) -> NDArray[np.uint32]:
    """Return the 30-bit words that a table holds; the inverse of how tables are made."""
    bits = np.ascontiguousarray(floats).view(np.uint32)
    return np.asarray((bits & np.uint32(0x1FFFFFFF)) | (bits >> np.uint32(31)) << np.uint32(29), dtype=np.uint32)


def height(count: int) -> int:
    """Return the rows that so many texels fill."""
    return max(1, -(-count // WIDTH))
