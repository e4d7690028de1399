"""Static tables of windows over an atlas: how far each texel looks around, and what it must look up one by one.

A Gaussian of a few texels is summed over the texels around, by straight distances in space. Where the atlas ends, or
the surface turns, what lies near in space does not lie near in the atlas: a list names it, so that the sum is whole.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skincli.errors import LimitError
from skincli.mesh.lattice import as_floats, bent, block_means, rows

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
AT_ONCE = 1 << 13


@dataclass(frozen=True)
class WindowTables:
    """What the passes of one Gaussian read.

    Words are 30 bits in a float32, see skincli.mesh.lattice.

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
    texel : (n,) row * size + column
    size : texels a side
    sigma : mm
    factor : texels along the side of a block

    Raises
    ------
    LimitError : the charts have more borders than a table can name
    """
    side = -(-size // factor)
    block, held, middle, mean = block_means(positions, normals, areas, texel, size, factor)
    some = np.flatnonzero(held)
    place, facing = middle[some], mean[some]
    area = np.bincount(block, areas, side * side).astype(np.float64)[some]
    gives = area > 0
    radius, whole = _boxes(some, side, place, area, REACH * sigma)
    turned, _ = bent(place, facing, area, sigma)
    radius[turned] = 0
    listed = np.flatnonzero(~whole | turned)
    if len(listed) > MOST_LISTS:
        raise LimitError(
            f"an atlas of {size} texels a side has {len(listed)} texels near borders of its charts; at most "
            f"{MOST_LISTS} are allowed; choose a smaller render.atlas or an atlas_uv of fewer charts"
        )
    givers = np.flatnonzero(gives)
    near = _Near(place[givers], REACH * sigma)

    def part(first: int) -> tuple[Integers, Integers]:
        own = listed[first : first + AT_ONCE]
        receiver, source = near.pairs(place[own])
        source = givers[source]
        away = np.stack(np.divmod(some[source], side)) - np.stack(np.divmod(some[own[receiver]], side))
        # What the window sees is not named again.
        beyond = (np.abs(away[::-1]) > radius[own[receiver]].T).any(axis=0)
        return np.bincount(receiver[beyond], minlength=len(own)), some[source[beyond]]

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        found = [(np.zeros(0, dtype=np.int64),) * 2, *pool.map(part, range(0, len(listed), AT_ONCE))]
    counts, named = (np.concatenate(arrays) for arrays in zip(*found, strict=True))
    words = np.zeros(side * side, dtype=np.int64)
    words[some] = radius[:, 0] | radius[:, 1] << RADIUS_BITS
    words[some[listed]] |= np.arange(1, len(listed) + 1) << 2 * RADIUS_BITS
    starts = np.append(0, np.cumsum(counts))
    return WindowTables(
        factor,
        as_floats(words).reshape(side, side, 1),
        rows(as_floats(starts)[:, None]),
        rows(as_floats(named // side | named % side << ROW_BITS)[:, None]),
    )


def _boxes(some: Integers, side: int, place: Floats, area: Floats, reach: float) -> tuple[Integers, NDArray[np.bool_]]:
    """Return the window of each block, (n, 2) along row and column, and whether no border of a chart lies in it.

    Parameters
    ----------
    some : (n,) row * side + column of the blocks
    side : blocks along the side of the atlas
    place, area : (n, 3) mm and (n,) mm², 0 for a block that gives no light
    reach : mm
    """
    at = np.stack(np.divmod(some, side)[::-1])
    number = np.full((side + 1, side + 1), -1, dtype=np.int32)
    number[at[1], at[0]] = np.where(area > 0, np.arange(len(some)), -1)
    links = []
    step = np.full((len(some), 2), np.inf)
    for axis in range(2):
        here, there = number[:-1, :-1], (number[:-1, 1:], number[1:, :-1])[axis]
        known = (here >= 0) & (there >= 0)
        one, other = here[known], there[known]
        away = np.linalg.norm(place[one] - place[other], axis=1)
        step[one, axis] = away
        step[other, axis] = np.minimum(step[other, axis], away)
        links.append((known, one, other, away))

    # The box about the ellipse that a circle becomes in the atlas.
    most = (1 << RADIUS_BITS) - 1
    with np.errstate(divide="ignore", invalid="ignore"):
        wide = np.nan_to_num(reach * step[:, ::-1] / area[:, None], nan=0.0, posinf=0.0)
    radius = np.where(area[:, None] > 0, np.clip(wide + 0.5, 1, most), 0).astype(np.int64)

    low, high = at - radius.T, at + radius.T
    whole = (area > 0) & (low >= 0).all(axis=0) & (high < side).all(axis=0)
    (left, bottom), (right, top) = np.maximum(low, 0), np.minimum(high, side - 1)
    for axis, (known, one, other, away) in enumerate(links):
        torn = ~known
        torn[known] = away > TORN * np.minimum(step[one, axis], step[other, axis])
        sums = np.zeros((side + 1, side + 1), dtype=np.int32)
        np.cumsum(np.cumsum(torn, axis=0, dtype=np.int32), axis=1, out=sums[1:, 1:])
        # One link fewer than blocks along this axis.
        stop, end = (right, top + 1) if axis == 0 else (right + 1, top)
        whole &= sums[end, stop] - sums[bottom, stop] - sums[end, left] + sums[bottom, left] == 0
    return radius, whole


def runs(first: Integers, count: Integers) -> Integers:
    """Return `count` numbers from each of `first` on, one run after the other."""
    return np.asarray(np.arange(count.sum()) + np.repeat(first - np.cumsum(count) + count, count))


class _Near:
    """Points in the order of cells as wide as the reach within which they are looked up.

    Parameters
    ----------
    points : (n, 3) mm
    reach : mm
    """

    def __init__(self, points: Floats, reach: float) -> None:
        self.reach = reach
        self.low = points.min(axis=0, initial=np.inf) - 2 * reach
        cell = self._cells(points)
        self.shape = cell.max(axis=0, initial=0) + 3
        key = self._keys(cell)
        self.order = np.argsort(key, kind="stable")
        self.keys, self.points = key[self.order], points[self.order]

    def pairs(self, targets: Floats) -> tuple[Integers, Integers]:
        """Return the pairs of a target and a point within reach: places in `targets`, ascending, and in the points."""
        cell, which = np.unique(np.clip(self._cells(targets), 1, self.shape - 2), axis=0, return_inverse=True)
        which = which.ravel()
        # Three cells that follow each other along the last axis are one run; nine runs hold all neighbors.
        beside = np.array([(x, y, -1) for x in (-1, 0, 1) for y in (-1, 0, 1)])
        begin = self._keys(cell[:, None] + beside)
        first = np.searchsorted(self.keys, begin)
        count = np.searchsorted(self.keys, begin + 2, side="right") - first
        first, count = first[which].ravel(), count[which].ravel()
        target = np.repeat(np.repeat(np.arange(len(targets)), 9), count)
        point = runs(first, count)
        close = np.sum((self.points[point] - targets[target]) ** 2, axis=1) <= self.reach**2
        return target[close], self.order[point[close]]

    def _cells(self, points: Floats) -> Integers:
        return np.asarray(np.floor((points - self.low) / self.reach).astype(np.int64))

    def _keys(self, cell: Integers) -> Integers:
        return np.asarray((cell[..., 0] * self.shape[1] + cell[..., 1]) * self.shape[2] + cell[..., 2])


def pack(tables: WindowTables) -> dict[str, NDArray[Any]]:
    """Return the tables as named arrays, as the disk cache keeps them."""
    return {"factor": np.array(tables.factor), **{name: getattr(tables, name) for name in ARRAYS}}


def unpack(entry: dict[str, NDArray[Any]]) -> WindowTables:
    """Return the tables that `pack` has taken apart."""
    return WindowTables(int(entry["factor"]), *(entry[name] for name in ARRAYS))
