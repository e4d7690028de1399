"""Static tables of windows over an atlas: how far each texel looks around, and what it must look up one by one.

A Gaussian of a few texels is summed over the texels around, by straight distances in space. Where the atlas ends, or
the surface turns, what lies near in space does not lie near in the atlas: a list names it, so that the sum is whole.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skincli.errors import LimitError
from skincli.mesh.lattice import bent, block_means
from skincli.mesh.words import as_floats, table

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

#: standard deviations to which a window and its lists reach
REACH = 2.5

#: bits of a word of `reach` for the blocks on each side of the middle, along each axis; the rest name the list
RADIUS_BITS = 4

#: bits of an entry for its row; the rest are its column
ROW_BITS = 13

#: lists of a table; beyond the bits of a word cannot name them
MOST_LISTS = (1 << 30 - 2 * RADIUS_BITS) - 1

#: a step from block to block is a border of the chart where it is so many times as long as the blocks are wide
TORN = 2.5

#: the arrays of a table
ARRAYS = ("reach", "starts", "entries")

#: receivers whose neighbors are looked for at once
AT_ONCE = 1 << 11

#: rows of blocks whose windows are found at once, few enough for the caches
ROWS = 128


@dataclass(frozen=True)
class WindowTables:
    """What the passes of one Gaussian read.

    Words are 30 bits in a float32, see skincli.mesh.words.

    Parameters
    ----------
    factor : texels along the side of a block; blocks give light, and the texels of a block share window and list
    reach : (h, w, 1) of each block: blocks on each side along the row, along the column, and the number of its list
        from 1 on, 0 for none
    starts : where each list begins in `entries`, and where the last ends, as (rows, WIDTH, 1)
    entries : row and column of blocks
    """

    factor: int
    reach: NDArray[np.float32]
    starts: NDArray[np.float32]
    entries: NDArray[np.float32]

    @property
    def nbytes(self) -> int:
        """Bytes of all tables."""
        return self.reach.nbytes + self.starts.nbytes + self.entries.nbytes


def tables(
    positions: Floats, normals: Floats, areas: Floats, texel: Integers, size: int, sigma: float, factor: int
) -> WindowTables:
    """Return the tables of one Gaussian.

    Parameters
    ----------
    positions : (n, 3) mm
    normals : (n, 3) unit
    areas : (n,) mm², 0 for points that only receive
    texel : (n,) row * size + column, ascending
    size : texels a side
    sigma : mm
    factor : texels along the side of a block

    Raises
    ------
    LimitError : the charts have more borders than a table can name
    """
    side = -(-size // factor)
    if factor == 1:
        some, place, facing, area = texel, positions, normals, areas
    else:
        block, held, middle, mean = block_means(positions, normals, areas, texel, size, factor)
        some = np.flatnonzero(held)
        place, facing = middle[some], mean[some]
        area = np.bincount(block, areas, side * side).astype(np.float64)[some]
    radius, whole = _boxes(some, side, place, area, REACH * sigma)
    turned, _ = bent(place, facing, area, sigma)
    radius[:, turned] = 0
    listed = np.flatnonzero(~whole | turned)
    if len(listed) > MOST_LISTS:
        raise LimitError(
            f"an atlas of {size} texels a side has {len(listed)} texels near borders of its charts; at most "
            f"{MOST_LISTS} are allowed; choose a smaller render.atlas or an atlas_uv of fewer charts"
        )
    givers = np.flatnonzero(area > 0)
    near = _Near([axis[givers] for axis in place.T], REACH * sigma)
    row, column = np.divmod(some.astype(np.int32), np.int32(side))

    def part(first: int) -> tuple[Integers, Integers]:
        own = listed[first : first + AT_ONCE]
        receiver, source = near.pairs([axis[own] for axis in place.T])
        source, wanted = givers[source], own[receiver]
        # What the window sees is not named again.
        beyond = np.abs(column[source] - column[wanted]) > radius[0, wanted]
        beyond |= np.abs(row[source] - row[wanted]) > radius[1, wanted]
        return np.bincount(receiver[beyond], minlength=len(own)), some[source[beyond]]

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        found = [(np.zeros(0, dtype=np.int64),) * 2, *pool.map(part, range(0, len(listed), AT_ONCE))]
    counts, named = (np.concatenate(arrays) for arrays in zip(*found, strict=True))
    own = radius[0] | radius[1].astype(np.int32) << RADIUS_BITS
    own[listed] |= np.arange(1, len(listed) + 1, dtype=np.int32) << 2 * RADIUS_BITS
    words = np.zeros(side * side, dtype=np.int32)
    words[some] = own
    starts = np.append(0, np.cumsum(counts))
    return WindowTables(
        factor,
        as_floats(words).reshape(side, side, 1),
        table(starts),
        table(named // side | named % side << ROW_BITS),
    )


def _boxes(
    some: Integers, side: int, place: Floats, area: Floats, reach: float
) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Return the window of each block, (2, n) along row and column, and whether no border of a chart lies in it.

    Parameters
    ----------
    some : (n,) row * side + column of the blocks, ascending
    side : blocks along the side of the atlas
    place, area : (n, 3) mm and (n,) mm², 0 for a block that gives no light
    reach : mm
    """
    # As wide as windows may be; beyond the atlas all is border.
    margin = 1 << RADIUS_BITS
    height, width = ROWS + 2 * margin, side + 2 * margin
    radius = np.zeros((2, len(some)), dtype=np.uint8)
    whole = area > 0

    def find(top: int) -> None:
        """Find those of the rows from `top` on."""
        begin, stop = np.searchsorted(some, side * np.array([top - margin, top + ROWS + margin]))
        givers = begin + np.flatnonzero(area[begin:stop] > 0)
        row, column = np.divmod(some[givers], side)
        at = (row - top + margin) * width + column + margin
        spots = np.full((3, height * width), np.nan)
        spots[:, at] = place[givers].T
        own = slice(*np.searchsorted(row, (top, top + ROWS)))
        at, givers = at[own], givers[own]
        steps, sums = [], []
        for stride in (1, width):
            # From the block before; none where one of them gives no light.
            away = np.full(height * width, np.nan)
            away[stride:] = np.sqrt(sum((spot[stride:] - spot[:-stride]) ** 2 for spot in spots))
            step = away.copy()
            step[:-stride] = np.fmin(away[:-stride], away[stride:])
            torn = np.ones((height, width), dtype=np.bool_)
            torn.ravel()[stride:] = ~(away[stride:] <= TORN * np.minimum(step[:-stride], step[stride:]))
            steps.append(np.nan_to_num(step[at]))
            # No window holds as many blocks as make these counts begin anew.
            sums.append(torn.cumsum(axis=0, dtype=np.uint16).cumsum(axis=1, dtype=np.uint16).ravel())

        # The box about the ellipse that a circle becomes in the atlas.
        wide, high = (
            np.clip(reach * step / area[givers] + 0.5, 1, margin - 1).astype(np.int64) for step in steps[::-1]
        )
        radius[:, givers] = wide, high
        right, end = at + wide, width * high
        # That of the first block along the axis lies outside.
        for links, left, start in zip(sums, (at - wide, at - wide - 1), (-end - width, -end), strict=True):
            whole[givers] &= links[right + end] - links[right + start] == links[left + end] - links[left + start]

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(find, range(0, side, ROWS)))
    return radius, whole


def runs(first: Integers, count: Integers) -> Integers:
    """Return `count` numbers from each of `first` on, one run after the other."""
    return np.asarray(np.arange(count.sum()) + np.repeat(first - np.cumsum(count) + count, count))


class _Near:
    """Points in the order of cells as wide as the reach within which they are looked up.

    Parameters
    ----------
    points : x, y and z of each, mm
    reach : mm
    """

    def __init__(self, points: Sequence[Floats], reach: float) -> None:
        self.reach = reach
        self.low = np.array([axis.min(initial=np.inf) for axis in points]) - 2 * reach
        # Beyond the cells of points is one more on each side, for targets.
        high = np.array([axis.max(initial=-np.inf) for axis in points])
        self.most = np.maximum(np.floor((high - self.low) / reach), 0) + 1
        self.strides = np.append(np.cumprod(self.most[:0:-1] + 2)[::-1], 1).astype(np.int64)
        key = self._keys(points)
        self.order = np.argsort(key, kind="stable")
        self.keys, self.points = key[self.order], [axis[self.order] for axis in points]

    def pairs(self, targets: Sequence[Floats]) -> tuple[Integers, Integers]:
        """Return the pairs of a target and a point within reach: places in `targets`, ascending, and in the points."""
        key, which = np.unique(self._keys(targets), return_inverse=True)
        # Three cells that follow each other along the last axis are one run; nine runs hold all neighbors.
        beside = np.array([(x, y, -1) for x in (-1, 0, 1) for y in (-1, 0, 1)]) @ self.strides
        begin = key[:, None] + beside
        first = np.searchsorted(self.keys, begin)
        count = np.searchsorted(self.keys, begin + 2, side="right") - first
        point = runs(first[which].ravel(), count[which].ravel())
        target = np.repeat(np.arange(len(which)), count.sum(axis=1)[which])
        square = sum((own[point] - of[target]) ** 2 for own, of in zip(self.points, targets, strict=True))
        close = np.flatnonzero(square <= self.reach**2)
        return target[close], self.order[point[close]]

    def _keys(self, points: Sequence[Floats]) -> Integers:
        """Return the numbers of the cells of points, x first; cells beyond the outermost count as these."""
        key = np.zeros(len(points[0]), dtype=np.int64)
        for axis, low, most, stride in zip(points, self.low, self.most, self.strides, strict=True):
            key += stride * np.clip(np.floor((axis - low) / self.reach), 1, most).astype(np.int64)
        return key


def pack(tables: WindowTables) -> dict[str, NDArray[Any]]:
    """Return the tables as named arrays, as the disk cache keeps them."""
    return {"factor": np.array(tables.factor), **{name: getattr(tables, name) for name in ARRAYS}}


def unpack(entry: dict[str, NDArray[Any]]) -> WindowTables:
    """Return the tables that `pack` has taken apart."""
    return WindowTables(int(entry["factor"]), *(entry[name] for name in ARRAYS))
