"""Sets of numbers as bits, of which words hold 64: they are merged, moved, counted and numbered word by word."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

Integers = NDArray[np.int64]
Bits = NDArray[np.uint64]

#: of what is handled at a time
AT_ONCE = 1 << 13


def parts(count: int) -> Iterator[slice]:
    """Yield slices of so many, one after the other, small enough that what is made of them stays in the cache."""
    for first in range(0, count, AT_ONCE):
        yield slice(first, min(first + AT_ONCE, count))


class Row:
    """A long row of bits, of which only some words may hold any: a set is these words, (m,) uint64.

    The first word of the row is among them and must hold none: it stands for all words that are not among them. The
    others lie so far from the ends that nothing moves beyond these.

    Parameters
    ----------
    numbers : arrays of which each number's word is one of these
    count : words of the row
    """

    def __init__(self, numbers: Iterable[Integers], count: int) -> None:
        self.count = count
        held = np.zeros(count, dtype=bool)
        held[0] = True
        for some in numbers:
            for part in parts(len(some)):
                held[some[part] >> 6] = True
        #: (m,) the places of the words in the row, ascending
        self.place = np.flatnonzero(held)
        self._slot = np.zeros(count, dtype=np.int32)
        self._slot[self.place] = np.arange(len(self.place))
        self._beside: dict[int, NDArray[np.int32]] = {}

    def slot(self, numbers: Integers) -> Integers:
        """Return which of the words hold numbers."""
        return self._slot[numbers >> 6].astype(np.int64)

    def marked(self, numbers: Integers) -> Bits:
        """Return the set of numbers, whose words must be held."""
        flags = np.zeros(64 * len(self.place), dtype=bool)
        for part in parts(len(numbers)):
            some = numbers[part]
            flags[self.slot(some) << 6 | some & 63] = True
        return np.packbits(flags, bitorder="little").view("<u8")

    def members(self, bits: Bits) -> Integers:
        """Return of each member, ascending, 64 times which of the words holds it, and which of its bits it is."""
        result = np.empty(int(np.bitwise_count(bits).sum()), dtype=np.int64)
        count = 0
        for part in parts(len(bits)):
            octets = bits[part].astype("<u8").view(np.uint8)
            some = np.flatnonzero(octets != 0)
            found = np.flatnonzero(np.unpackbits(octets[some], bitorder="little").view(bool))
            result[count : count + len(found)] = (some[found >> 3] << 3 | found & 7) + 64 * part.start
            count += len(found)
        return result

    def at(self, members: Integers) -> Integers:
        """Return the numbers that stand for what `members` returns."""
        return self.place[members >> 6] << 6 | members & 63

    def before(self, bits: Bits) -> Integers:
        """Return how many members lie before each word."""
        counts = np.bitwise_count(bits)
        return np.cumsum(counts, dtype=np.int64) - counts

    def number(self, bits: Bits, members: Integers) -> Integers:
        """Return the place of members among all, ascending, from 0 on."""
        before = self.before(bits)
        result = np.empty(len(members), dtype=np.int64)
        for part in parts(len(members)):
            some = members[part]
            slot = self.slot(some)
            result[part] = before[slot] + np.bitwise_count(bits[slot] & below(some & 63))
        return result

    def moved(self, bits: Bits, step: int) -> Bits:
        """Return the set with a step added to all members, as far as the words hold it."""
        whole, part = divmod(step, 64)
        near = bits[self._words(-whole)]
        if not part:
            return near
        return near << np.uint64(part) | bits[self._words(-whole - 1)] >> np.uint64(64 - part)

    def within(self, other: Row, bits: Bits) -> Bits:
        """Return a set of this row as one of another, which holds all its words."""
        result = np.zeros(len(other.place), dtype=np.uint64)
        result[other.slot(self.place << 6)] = bits
        return result

    def around(self, bits: Bits, steps: Iterable[int]) -> Row:
        """Return a row that holds the words of a set, also when moved by any of the steps."""
        places = [self.place[bits > 0]]
        for whole, part in (divmod(step, 64) for step in steps):
            places.append(self.place[bits > 0] + whole)
            if part:
                places.append(self.place[bits >> 64 - part > 0] + whole + 1)
        return Row((place << 6 for place in places), self.count)

    def _words(self, offset: int) -> NDArray[np.int32]:
        """Return which of the words lies so many places after each."""
        if offset not in self._beside:
            # Before the first word counts from the end of the row, where there are none either.
            self._beside[offset] = self._slot[self.place + offset]
        return self._beside[offset]


def below(bit: Integers) -> Bits:
    """Return words that hold all bits before one of them."""
    return (np.uint64(1) << bit.view(np.uint64)) - np.uint64(1)
