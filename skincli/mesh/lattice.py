"""Static tables of the surface lattice: diffusion in millimeters by a sparse body-centered lattice about the surface.

A two-dimensional Gaussian over distances in space is a three-dimensional one up to a factor that cancels in the ratio
of blurred irradiance and blurred area, so the surface may be blurred in space, where it has neither stretch nor seams.
The lattice and its tetrahedra are those of the permutohedral lattice in three dimensions (Adams, Baek and Davis 2010,
"Fast High-Dimensional Filtering Using the Permutohedral Lattice"). New here are the slice, which interpolates averages
with their gradients, and tables that keep each line of nodes contiguous.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from skincli.errors import LimitError
from skincli.mesh.bits import Bits, Row, below, parts
from skincli.mesh.words import WIDTH, WORD_BITS, as_floats, height, table

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

#: lattice constant (edge of the cubic cell) over sigma up to this many mm and beyond, where nodes are few
NARROW, RATIO_NARROW, RATIO_WIDE = 1.0, 1.0, 0.9

#: what the taps are given of the variance that they should have: least error on planes and heads, where the end of the
#: lattice beside the surface cuts what goes far
KEPT_VARIANCE = 0.98

#: nodes on either side of a node that the blur along a line reads; and how many steps far nodes are kept for it, along
#: the line and from the nodes that texels read
REACH = 3
SPREAD = 2

#: sigmas between the nodes by which bent surface is found, how long a mean normal says it is not, and how many rings
#: of such nodes lie within reach of a bent one
BENT_SPACING = 2.0
BENT_BELOW = 0.98
BENT_RINGS = 2

#: lines along which the blur runs, in half lattice constants
DIRECTIONS = np.array([(1, 1, 1), (1, -1, 1), (1, 1, -1), (1, -1, -1)])

#: half lattice constants by which bits of a row reach beyond the cubes: two rings about their nodes, SPREAD, REACH
MARGIN = 8

#: lattice constants to which pieces apart are moved together: what is read of one ends before the next
GAP = 16

#: words of a row of bits at most, 128 MB of their numbers
MOST_WORDS = 1 << 25

# A key packs three coordinates.
_BITS = 21
_UNITS = np.array([1 << 2 * _BITS, 1 << _BITS, 1])
_ORIGIN = int(_UNITS.sum()) << _BITS - 1

#: cubes between a point and the origin along an axis, at most
MOST_CUBES = (1 << _BITS - 2) - 2

#: bits by which a node is told from others of its cube, after the cube's number
SLOT_BITS = 4

#: bits of a word of `slices` that name a node; after them three that tell the node from others nearby, and BENT
NODE_BITS = 22
BENT = 1 << NODE_BITS + 3

#: bits of a word of `lines` before those that say which nodes of a line exist
LINE_BITS = WORD_BITS - 2 * REACH - 1

#: sigmas that a texel may lie from the middle of its block; others give their light by themselves
BLOCK_REACH = 0.18


@dataclass(frozen=True)
class Chain:
    """From texels to blurred nodes: a splat and four blurs, as (h, WIDTH, 1) float32, first row first, and `links`.

    Parameters
    ----------
    counts : nodes of the splat and of each blur; between, only those that are reached and from which others are
    read : how many of the last nodes texels read; those after them are only their neighbors
    starts : for each node its first entry of a block and its first of a texel; and where the last ends
    entries : place and weight of each contribution, by node
    lines : per direction and node: where the nodes of its line begin in the previous texture, and which there are
    links : (h, WIDTH, 4), two of each node that texels read: the nodes one step along each direction, and against it
    """

    counts: tuple[int, ...]
    read: int
    starts: NDArray[np.float32]
    entries: NDArray[np.float32]
    lines: tuple[NDArray[np.float32], ...]
    links: NDArray[np.float32]

    @property
    def nbytes(self) -> int:
        """Bytes of its tables."""
        return sum(array.nbytes for array in (self.starts, self.entries, *self.lines, self.links))


@dataclass(frozen=True)
class LatticeTables:
    """Everything about a surface that the passes of one sigma read.

    `starts`, `entries`, `lines` and `slices` hold words, see skincli.mesh.words.

    Parameters
    ----------
    spacing : lattice constant, mm
    ratio : the same over what the blocks leave of sigma
    factor : texels along the side of a block
    place_bits : bits of an entry for each coordinate of its block or texel; the rest hold the weight
    whole : sums of irradiance and area at all nodes
    bent : the same and times the normal, where normals differ; what nodes texels read there, they are the first of
        `whole`
    slices : (size, size, 1) the node in whose cube a texel lies, the parity of half its coordinates, and whether the
        texel reads `bent`; 0 for no texel
    """

    spacing: float
    ratio: float
    factor: int
    place_bits: int
    whole: Chain
    bent: Chain
    slices: NDArray[np.float32]

    @property
    def nbytes(self) -> int:
        """Bytes of all tables."""
        return self.whole.nbytes + self.bent.nbytes + self.slices.nbytes


@dataclass(frozen=True)
class _Points:
    """Where light is given from: blocks of texels, then single ones.

    Parameters
    ----------
    positions, normals, areas : of the points
    address : column and row of the block or texel
    blocks : how many are blocks
    of : (n,) the point of each texel, or all in their order
    blur : variance about the middle of a block, mm² per axis of the surface
    """

    positions: Floats
    normals: Floats
    areas: Floats
    address: NDArray[np.uint32]
    blocks: int
    of: Integers | slice
    blur: float


def block_factor(sigma: float, texel: float) -> int:
    """Return the texels along the side of the blocks from which a Gaussian's light is given; both in mm.

    Most texels of a flat block lie within BLOCK_REACH of its middle.
    """
    return 1 << int(math.log2(1 + math.sqrt(2) * BLOCK_REACH * sigma / texel))


def least_sigma(positions: Floats) -> float:
    """Return the standard deviation, mm, from which on the lattice about points fits into rows of bits.

    Parameters
    ----------
    positions : (n, 3) mm
    """
    extent = np.ptp(positions, axis=0)
    sigma = 1e-5 * float(extent.max()) + 1e-30
    while True:
        # The box of _Lines about the cubes that these points may lie in.
        x, y, z = 2 * extent / _spacing(sigma) + 4
        words = ((x + 2 * MARGIN) / 64 + 1) * ((x + y) / 2 + 2 * MARGIN + 1) * ((x + z) / 2 + 2 * MARGIN + 1)
        if words <= MOST_WORDS:
            return sigma
        sigma *= 1.02


def _spacing(sigma: float) -> float:
    """Return the lattice constant that suits."""
    return sigma * (RATIO_NARROW if sigma < NARROW else RATIO_WIDE)


def tables(
    positions: Floats,
    normals: Floats,
    areas: Floats,
    texel: Integers,
    size: int,
    sigma: float,
    factor: int = 1,
    ratio: float | None = None,
) -> LatticeTables:
    """Return the tables of one Gaussian.

    Parameters
    ----------
    positions : (n, 3) mm
    normals : (n, 3) unit
    areas : (n,) mm², 0 for points that only receive
    texel : (n,) row * size + column
    size : texels a side
    sigma : mm
    factor : texels along the side of the blocks from which light is given
    ratio : lattice constant over sigma, if not the one that suits

    Raises
    ------
    LimitError : the surface has more nodes than a table can name, or the box about it is too large
    """
    spacing = sigma * ratio if ratio else _spacing(sigma)
    place_bits = max(11, (size - 1).bit_length())
    points = _points(positions, normals, areas, texel, size, factor, BLOCK_REACH * sigma, place_bits)
    receives, gives = bent(points.positions, points.normals, points.areas, sigma)
    bends = receives[points.of]

    # Where every block is a texel, these are the points.
    every = positions if factor == 1 else np.concatenate([points.positions, positions])
    cubes = Cubes(every, spacing)
    first = len(every) - len(positions)
    nodes = _together(cubes.cubes)
    lines = [_Lines(nodes, direction) for direction in DIRECTIONS]
    most = max(one.words for one in lines)
    if most > MOST_WORDS:
        raise LimitError(
            f"sigma {sigma:.2f} mm takes a lattice of {64 * most} places about this mesh; at most {64 * MOST_WORDS} "
            f"are allowed; choose a larger optics.radius"
        )
    at = lines[0].at(nodes)

    def places(found: Integers) -> Integers:
        return _near(at, lines[0].unit, found)

    reads = places(cubes.met(range(len(cubes.of))))
    row = Row([reads], lines[0].words)
    read, some = row.marked(reads), row.marked(places(cubes.met(first + np.flatnonzero(bends))))
    del reads
    gifts = _gifts(cubes, points, range(len(points.areas)), place_bits)
    whole, number = _chain(lines, row, read, some, read, gifts, places)
    if whole.read > 1 << NODE_BITS or max(whole.counts) > 1 << LINE_BITS:
        raise LimitError(
            f"sigma {sigma:.2f} mm takes {max(whole.counts)} lattice nodes on this mesh, of which texels read "
            f"{whole.read}; at most {1 << LINE_BITS} and {1 << NODE_BITS} are allowed; choose a larger optics.radius"
        )

    near = np.flatnonzero(gives)
    gifts = _gifts(cubes, points, near, place_bits)
    turned, _ = _chain(lines, row, row.marked(places(cubes.met(near))) | some, some, some, gifts, places)

    words = number(at) | (cubes.cubes & 1) @ np.array([1, 2, 4]) << NODE_BITS
    slices = np.zeros(size * size, dtype=np.float32)
    slices[texel] = as_floats(words[cubes.of[first:]] | BENT * bends)
    left = spacing / np.sqrt(sigma**2 - points.blur)
    return LatticeTables(spacing, left, factor, place_bits, whole, turned, slices.reshape(size, size, 1))


def block_means(
    positions: Floats, normals: Floats, areas: Floats, texel: Integers, size: int, factor: int
) -> tuple[Integers, Floats, Floats, Floats]:
    """Return the block of each texel, and of each block what it holds, its middle and its mean normal.

    Parameters are those of `tables`; a block holds its area and next to nothing more, 0 where it has no texel.
    """
    side = -(-size // factor)
    # Where a block holds no area, its middle counts.
    least = 1e-9 * areas.sum() / max(len(areas), 1)
    block = np.empty(len(texel), dtype=np.int64)
    total = np.zeros(side * side)
    middle, mean = np.zeros((2, side * side, 3))
    for part in parts(len(texel)):
        row = texel[part] // size
        block[part] = own = row // factor * side + (texel[part] - row * size) // factor
        mass = areas[part] + least
        np.add.at(total, own, mass)
        for sums, of in ((middle, positions), (mean, normals)):
            for axis, values in zip(sums.T, of[part].T, strict=True):
                np.add.at(axis, own, mass * values)
    held = np.maximum(total, 1e-300)[:, None]
    middle /= held
    mean /= held
    return block, total, middle, mean


def _points(
    positions: Floats, normals: Floats, areas: Floats, texel: Integers, size: int, factor: int, reach: float, bits: int
) -> _Points:
    """Return the blocks of texels that lie within `reach` of their middle and face one way, and all other texels."""
    if factor == 1:
        # Each texel is a block.
        return _Points(positions, normals, areas, _address(texel, size, bits), len(texel), slice(None), 0.0)
    side = -(-size // factor)
    block, total, middle, mean = block_means(positions, normals, areas, texel, size, factor)

    away = np.empty(len(texel))
    for part in parts(len(texel)):
        x, y, z = (positions[part] - middle[block[part]]).T ** 2
        away[part] = x + y + z
    apart = np.linalg.norm(mean, axis=1) < BENT_BELOW
    apart[block[away > reach**2]] = True
    alone = np.flatnonzero(apart[block])
    good = np.flatnonzero((total > 0) & ~apart)
    of = np.empty(side * side, dtype=np.int64)
    of[good] = np.arange(len(good))
    of = of[block]
    of[alone] = len(good) + np.arange(len(alone))
    own = np.ones(len(texel), dtype=bool)
    own[alone] = False
    return _Points(
        np.concatenate([middle[good], positions[alone]]),
        np.concatenate([mean[good], normals[alone]]),
        np.concatenate([np.bincount(block, areas, side * side)[good], areas[alone]]),
        np.concatenate([_address(good, side, bits), _address(texel[alone], size, bits)]),
        len(good),
        of,
        float(areas[own] @ away[own] / max(areas.sum(), 1e-300)) / 2,
    )


def _address(index: Integers, side: int, bits: int) -> NDArray[np.uint32]:
    """Return column and row of places in a square."""
    result = np.empty(len(index), dtype=np.uint32)
    for part in parts(len(index)):
        row = index[part] // side
        result[part] = index[part] - row * side | row << bits
    return result


def taps(ratio: float) -> tuple[float, ...]:
    """Return the weights of a node and of the pairs 1 to REACH steps along a line, which sum to 1: a Gaussian's.

    Four directions together blur by their variance times the squared lattice constant along each axis; the splat does
    by a twelfth of it, the slice, which knows gradients, by none.

    Parameters
    ----------
    ratio : lattice constant over sigma
    """
    variance = KEPT_VARIANCE * (1 / ratio**2 - 1 / 12)
    squares = np.arange(REACH + 1) ** 2
    low, high = 0.0, 1.0
    # The variance of the weights rises with that of a neighbor over that of the middle.
    while high - low > 1e-12:
        share = (low + high) / 2
        weights = share**squares / (2 * np.sum(share**squares) - 1)
        low, high = (share, high) if 2 * weights @ squares < variance else (low, share)
    return tuple(weights.tolist())


class Cubes:
    """The tetrahedra of the lattice in which points lie, four nodes each, by the cubes that hold them.

    Parameters
    ----------
    positions : (n, 3) mm
    spacing : lattice constant, mm

    Attributes
    ----------
    cubes : (k, 3) where the even nodes a lie about which cubes are, lattice constants
    of : (n,) the cube of each point
    code : (n,) the order of the axes, and the signs, by which its tetrahedron is a row of CORNERS

    Raises
    ------
    LimitError : a point is too far from the origin
    """

    def __init__(self, positions: Floats, spacing: float) -> None:
        self._positions, self._spacing = positions, spacing
        self.code = np.empty(len(positions), dtype=np.uint8)
        firsts, keys = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
        for part in parts(len(positions)):
            cube, at = self._split(part)
            if np.abs(cube).max() > MOST_CUBES:
                raise LimitError(
                    f"the mesh reaches {np.abs(positions).max():.4g} mm from the origin; at most "
                    f"{MOST_CUBES * spacing:.4g} mm are allowed; move it there, or choose a larger optics.radius"
                )
            x, y, z = np.abs(at)
            code = np.zeros(len(x), dtype=np.uint8)
            for bit, true in enumerate((x >= y, x >= z, y >= z, *(at < 0))):
                code |= true.view(np.uint8) << np.uint8(bit)
            self.code[part] = code
            # Texels beside each other mostly share a cube.
            key = _key(cube.astype(np.int64).T)
            new = np.flatnonzero(np.append(True, key[1:] != key[:-1]))
            firsts.append(new + part.start)
            keys.append(key[new])
        distinct, number = np.unique(np.concatenate(keys), return_inverse=True)
        ends = np.append(np.concatenate(firsts), len(positions))
        self.of = np.repeat(number.astype(np.int32), ends[1:] - ends[:-1])
        self.cubes = (distinct[:, None] // _UNITS & (1 << _BITS) - 1) - (1 << _BITS - 1)

    def _split(self, points: slice | Integers) -> tuple[Floats, Floats]:
        """Return (3, n) the cubes of points, and how far these are from the nodes in half lattice constants."""
        at = np.ascontiguousarray(self._positions[points].T) / (self._spacing / 2)
        cube = np.floor(at / 2 + 0.5)
        return cube, at - 2 * cube

    def corners(self, points: slice | Integers) -> Integers:
        """Return (n, 4): which of all nodes of all cubes, 1 << SLOT_BITS of each, are corners of points' tetrahedra."""
        result = CORNERS.take(self.code[points], axis=0)
        result += self.of[points, None].astype(np.int64) << SLOT_BITS
        return result

    def weights(self, points: slice | Integers) -> Floats:
        """Return the (n, 4) barycentric weights of points in their tetrahedra."""
        x, y, z = np.abs(self._split(points)[1])
        low, high = np.minimum(x, y), np.maximum(x, y)
        return tetrahedron_weights(np.maximum(high, z), np.maximum(low, np.minimum(high, z)), np.minimum(low, z))

    def met(self, points: range | Integers) -> Integers:
        """Return which nodes of the cubes are corners of points' tetrahedra, each once."""
        found = np.zeros(len(self.cubes) << SLOT_BITS, dtype=bool)
        for part in parts(len(points)):
            found[self.corners(_part(points, part))] = True
        return np.flatnonzero(found)

    def touch(self, nodes: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return (n,) which points' tetrahedra have one of these nodes of the cubes as a corner."""
        found = np.empty(len(self.of), dtype=bool)
        for part in parts(len(self.of)):
            a, b, c, d = nodes[self.corners(part)].T
            found[part] = a | b | c | d
        return found


def _part(points: range | Integers, part: slice) -> slice | Integers:
    """Return a part of the points, which is not copied where they follow each other."""
    some = points[part]
    return slice(some.start, some.stop) if isinstance(some, range) else some


def _near(cubes: Integers, unit: Integers, slots: Integers) -> Integers:
    """Return numbers of nodes of cubes, see Cubes.corners, given those of the cubes and what steps along axes add."""
    beside = NEAR @ unit
    result = np.empty(len(slots), dtype=np.int64)
    for part in parts(len(slots)):
        some = slots[part]
        result[part] = cubes[some >> SLOT_BITS] + beside[some & (1 << SLOT_BITS) - 1]
    return result


def _key(coordinates: Integers) -> Integers:
    return np.asarray(coordinates @ _UNITS + _ORIGIN)


def _corner_table() -> tuple[Integers, Integers]:
    """Return NEAR, the (15, 3) nodes of a cube about its own, and CORNERS, (64, 4) of them by the code of Cubes.

    They are a, a + 2 s_i along the longest axis, a + s, a + s - 2 s_k along the shortest.
    """
    signs = 1 - 2 * (np.arange(8)[:, None] >> np.arange(3) & 1)
    near = np.concatenate(
        [np.zeros((1, 3), dtype=np.int64), 2 * np.eye(3, dtype=np.int64), -2 * np.eye(3, dtype=np.int64), signs]
    )
    corners = np.zeros((64, 4), dtype=np.int64)
    for code in range(64):
        xy, xz, yz = code & 1, code >> 1 & 1, code >> 2 & 1
        shorter = np.array([xy + xz, 1 - xy + yz, 2 - xz - yz])
        longest, shortest = shorter.argmax(), shorter.argmin()
        sign = code >> 3
        corners[code, 1:] = 1 + longest + 3 * (sign >> longest & 1), 7 + sign, 7 + (sign ^ 1 << shortest)
    return near, corners


#: nodes of a cube, in half lattice constants from its own, and which of them are corners of its tetrahedra
NEAR, CORNERS = _corner_table()


def _together(cubes: Integers) -> Integers:
    """Return the (k, 3) even nodes of cubes, half lattice constants from the lowest along each axis.

    Pieces of the surface that are more than GAP apart along an axis are moved together.
    """
    nodes = np.empty_like(cubes)
    for axis, along in enumerate(cubes.T):
        along = along - along.min(initial=MOST_CUBES)
        taken = np.zeros(along.max(initial=0) + 1, dtype=np.int64)
        taken[along] = 1
        planes = np.flatnonzero(taken)
        taken[planes] = 2 * np.cumsum(np.minimum(np.diff(planes, prepend=0), GAP))
        nodes[:, axis] = taken[along]
    return nodes


class _Lines:
    """Places of nodes in a row of bits where those of each line along a direction follow each other.

    Parameters
    ----------
    nodes : (n, 3) even nodes of the cubes, half lattice constants
    direction : one of DIRECTIONS

    Attributes
    ----------
    unit : (3,) how much farther a node lies in the row by half a lattice constant along x, y, z
    words : of 64 bits
    """

    def __init__(self, nodes: Integers, direction: Integers) -> None:
        self.direction = direction
        if not len(nodes):
            nodes = np.zeros((1, 3), dtype=np.int64)
        # A line is where two coordinates are equal, and x goes along it.
        along = nodes[:, 0]
        across = np.stack([nodes[:, axis] - direction[axis] * along for axis in (1, 2)]) // 2
        self._low = across.min(axis=1) - MARGIN
        high, self._wide = (across.max(axis=1) - self._low + MARGIN + 1).tolist()
        self._start = int(along.min()) - MARGIN
        # Whole words, so that nodes of one step across have the same bits.
        self._length = -(-(int(along.max()) - self._start + MARGIN + 1) // 64) * 64
        self.words = high * self._wide * (self._length // 64)
        half = self._length // 2
        self.unit = np.array([1 - half * (direction[1] * self._wide + direction[2]), half * self._wide, half])
        self._origin = int((self._low[0] * self._wide + self._low[1]) * self._length + self._start)

    def at(self, nodes: Integers) -> Integers:
        """Return the places of (..., 3) nodes."""
        return np.asarray(nodes @ self.unit - self._origin)

    def nodes(self, at: Integers) -> Integers:
        """Return the (..., 3) nodes at places."""
        line, along = np.divmod(at, self._length)
        first, second = np.divmod(line, self._wide)
        x = along + self._start
        y = 2 * (first + self._low[0]) + self.direction[1] * x
        z = 2 * (second + self._low[1]) + self.direction[2] * x
        return np.stack([x, y, z], axis=-1)

    def of(self, other: _Lines, row: Row, members: Integers) -> Integers:
        """Return the places of nodes that are members of another row, of other lines."""
        start, step = self.at(other.nodes(row.place << 6)), int(other.direction @ self.unit)
        result = np.empty(len(members), dtype=np.int64)
        for part in parts(len(members)):
            result[part] = start[members[part] >> 6] + (members[part] & 63) * step
        return result


def _ring(row: Row, bits: Bits, steps: list[int]) -> Bits:
    """Return nodes with all their neighbors, which the row must hold.

    Parameters
    ----------
    steps : along the directions
    """
    result = bits
    for way in (-1, 1):
        beside = row.moved(bits, way * steps[0])
        # What leads from the first direction to the second, and to the third, together leads to the fourth.
        for across in (steps[1] - steps[0], steps[2] - steps[0]):
            beside = beside | row.moved(beside, way * across)
        result = result | beside
    return result


def _spread(row: Row, bits: Bits, step: int) -> Bits:
    """Return nodes with those up to SPREAD steps along a direction and against it, as far as the row holds them."""
    result = bits
    for k in range(1, SPREAD + 1):
        result = result | row.moved(bits, k * step) | row.moved(bits, -k * step)
    return result


def bent(
    positions: Floats, normals: Floats, areas: Floats, sigma: float
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which points see normals that differ within reach, and which points are within reach of those.

    Where all normals within reach nearly agree, w = (1 + n . n') / 2 is nearly constant and cancels in the average.

    Raises
    ------
    LimitError : a point is too far from the origin
    """
    cubes = Cubes(positions, BENT_SPACING * sigma)
    met = cubes.met(range(len(positions)))
    keys, number = np.unique(_near(_key(2 * cubes.cubes), _UNITS, met), return_inverse=True)
    node = np.zeros(len(cubes.cubes) << SLOT_BITS, dtype=np.int32)
    node[met] = number
    total, *sums = np.zeros((4, len(keys)))
    for part in parts(len(positions)):
        own = node[cubes.corners(part)].ravel().astype(np.int64)
        weight = cubes.weights(part) * areas[part, None]
        np.add.at(total, own, weight.ravel())
        for axis, one in zip(normals[part].T, sums, strict=True):
            np.add.at(one, own, (weight * axis[:, None]).ravel())
    mixed = np.linalg.norm(sums, axis=0) < BENT_BELOW * total
    receives = cubes.touch(mixed[node])
    reached = np.zeros(len(keys), dtype=bool)
    reached[node[cubes.met(np.flatnonzero(receives))]] = True
    fresh = np.flatnonzero(reached)
    for _ in range(BENT_RINGS):
        found = np.zeros(len(keys), dtype=bool)
        for step in (*DIRECTIONS @ _UNITS, *-DIRECTIONS @ _UNITS):
            at = np.searchsorted(keys, keys[fresh] + step)
            found[at[keys.take(at, mode="clip") == keys[fresh] + step]] = True
        fresh = np.flatnonzero(found & ~reached)
        reached[fresh] = True
    return receives, cubes.touch(reached[node])


def tetrahedron_weights(longest: Floats, middle: Floats, shortest: Floats) -> Floats:
    """Return the (n, 4) barycentric weights of points in their tetrahedra.

    Parameters
    ----------
    longest, middle, shortest : distances from the cube's node along the axes, half lattice constants
    """
    return np.stack(
        [1 - (longest + middle) / 2, (longest - middle) / 2, (middle + shortest) / 2, (middle - shortest) / 2], axis=1
    )


@dataclass(frozen=True)
class _Gifts:
    """What points give to nodes.

    Parameters
    ----------
    corner : (n, 4) to which nodes of which cubes, see Cubes.corners
    nowhere : stands for the node where nothing is given
    words : (n, 4) column and row of the block or texel, and the weight
    blocks : how many points are blocks; texels follow
    """

    corner: NDArray[np.int32]
    nowhere: int
    words: NDArray[np.uint32]
    blocks: int


def _gifts(cubes: Cubes, points: _Points, some: range | Integers, place_bits: int) -> _Gifts:
    """Return what some of the points give, which are the first of those of the cubes."""
    nowhere = len(cubes.cubes) << SLOT_BITS
    steps = (1 << WORD_BITS - 2 * place_bits) - 1
    corner = np.empty((len(some), 4), dtype=np.int32)
    words = np.empty((len(some), 4), dtype=np.uint32)
    for part in parts(len(some)):
        own = _part(some, part)
        weight = np.rint(cubes.weights(own) * steps).astype(np.uint32)
        given = (weight > 0) & (points.areas[own] > 0)[:, None]
        corner[part] = np.where(given, cubes.corners(own), nowhere)
        words[part] = points.address[own, None] | weight << np.uint32(2 * place_bits)
    return _Gifts(corner, nowhere, words, bisect_left(some, points.blocks))


def _splat(
    row: Row, gifts: _Gifts, places: Callable[[Integers], Integers]
) -> tuple[Bits, NDArray[np.int32], NDArray[np.uint32]]:
    """Return the nodes that are given something, and the `starts` and `entries` of a Chain, as words.

    The gifts are spent: of so many there is no second copy.

    Parameters
    ----------
    places : says where nodes of cubes lie in the row
    """
    given = np.zeros(gifts.nowhere + 1, dtype=bool)
    for part in parts(len(gifts.corner)):
        given[gifts.corner[part].astype(np.int64)] = True
    corners = np.flatnonzero(given[:-1])
    own = places(corners)
    nodes = row.marked(own)
    count = int(np.bitwise_count(nodes).sum())
    # Entries of blocks come before those of texels, and what nobody gets comes last.
    number = np.full(gifts.nowhere + 1, 2 * count, dtype=np.int32)
    number[corners] = 2 * row.number(nodes, own)
    column = gifts.corner
    for part in parts(len(column)):
        column[part] = number[column[part].astype(np.int64)]
    column[gifts.blocks :] += 1
    # A row of a matrix, seen as columns, is sorted in one pass.
    ends = np.array([0, column.size], dtype=np.int32)
    matrix = csr_array((gifts.words.ravel(), column.ravel(), ends), shape=(1, 2 * count + 2)).tocsc()
    starts = matrix.indptr[: 2 * count + 1]
    return nodes, starts, matrix.data[: starts[-1]]


def _chain(
    lines: list[_Lines],
    row: Row,
    near: Bits,
    first: Bits,
    read: Bits,
    gifts: _Gifts,
    places: Callable[[Integers], Integers],
) -> tuple[Chain, Callable[[Integers], Integers]]:
    """Return the tables of a splat and four blurs, and what numbers the nodes of the last by their places.

    Parameters
    ----------
    lines : of each direction
    row : of the first direction's lines
    near : nodes in this row; two rings about them may hold a value
    first, read : nodes that texels read; the first of them, and all
    places : says where nodes of cubes lie in the row
    """
    steps = (DIRECTIONS @ lines[0].unit).tolist()
    universe = near
    for _ in range(2):
        narrow, row = row, row.around(universe, [way * step for way in (-1, 1) for step in steps])
        universe, first, read = (narrow.within(row, bits) for bits in (universe, first, read))
        universe = _ring(row, universe, steps)
    around = _ring(row, read, steps)

    nodes, starts, entries = _splat(row, gifts, places)
    held = [nodes]
    for step in steps[:3]:
        held.append(_spread(row, held[-1], step) & universe)
    needed = around
    for k in (3, 2, 1):
        needed = _spread(row, needed, steps[k]) & universe
        held[k] &= needed

    # What is read comes first in the last texture.
    target = np.concatenate([row.members(bits) for bits in (first, read & ~first, around & ~read)])
    last = row.at(target)
    order = np.empty(len(last), dtype=np.int64)
    order[row.number(around, last)] = np.arange(len(last))

    def number(nodes: Integers) -> Integers:
        return order[row.number(around, nodes)]

    # Each direction has a row of its own, in which its lines are.
    own, sets = [row], [held[0]]
    inside = row.members(held[1])
    for k in (1, 2, 3):
        given = lines[k].of(lines[0], row, inside)
        inside = row.members(held[k + 1]) if k < 3 else target
        own.append(Row([given, lines[k].of(lines[0], row, inside)], lines[k].words))
        sets.append(own[k].marked(given))
    del given, inside
    words = []
    for k in range(4):
        if k < 3:
            wanted = lines[k].of(lines[k + 1], own[k + 1], own[k + 1].members(sets[k + 1]))
        else:
            wanted = lines[k].of(lines[0], row, target)
        words.append(table(_words(own[k], sets[k], wanted)))

    count = int(np.bitwise_count(read).sum())
    links = np.zeros((height(2 * count) * WIDTH // 2, 8), dtype=np.float32)
    for k, step in enumerate([*steps, *(-step for step in steps)]):
        # A ring is about all of them.
        links[:count, k] = number(last[:count] + step)
    chain = Chain(
        (*(int(np.bitwise_count(bits).sum()) for bits in held), len(last)),
        count,
        table(starts),
        table(entries),
        tuple(words),
        links.reshape(-1, WIDTH, 4),
    )
    return chain, number


def _words(row: Row, held: Bits, wanted: Integers) -> NDArray[np.uint32]:
    """Return for nodes on lines where the nodes within REACH begin among those held, and which of them there are.

    The words of all that are wanted are in the row.
    """
    # Half a word with what is within reach of it.
    low, high = row.moved(held, REACH), row.moved(held, REACH - 32)
    before = row.before(held)
    ends = np.uint64((1 << REACH) - 1), np.uint64((1 << 32 - REACH) - 1)
    first = np.stack([before - np.bitwise_count(low & ends[0]), before + np.bitwise_count(held & ends[1])], axis=1)
    first_of, near_of = first.astype(np.uint32).ravel(), np.stack([low, high], axis=1).ravel()
    result = np.empty(len(wanted), dtype=np.uint32)
    for part in parts(len(wanted)):
        at = wanted[part]
        half, bit = row.slot(at) << 1 | at >> 5 & 1, at & 31
        near = near_of[half]
        index = first_of[half] + np.bitwise_count(near & below(bit))
        there = near >> bit.view(np.uint64) & np.uint64((1 << 2 * REACH + 1) - 1)
        result[part] = index | there.astype(np.uint32) << np.uint32(LINE_BITS)
    return result


def pack(tables: LatticeTables) -> dict[str, NDArray[Any]]:
    """Return the tables as named arrays, as the disk cache keeps them."""
    entry: dict[str, NDArray[Any]] = {
        "numbers": np.array([tables.spacing, tables.ratio, tables.factor, tables.place_bits]),
        "slices": tables.slices,
    }
    for name, chain in (("whole", tables.whole), ("bent", tables.bent)):
        entry |= {f"{name}_counts": np.array([*chain.counts, chain.read]), f"{name}_starts": chain.starts}
        entry |= {f"{name}_entries": chain.entries, f"{name}_links": chain.links}
        entry |= {f"{name}_lines{k}": array for k, array in enumerate(chain.lines)}
    return entry


def unpack(entry: dict[str, NDArray[Any]]) -> LatticeTables:
    """Return the tables that `pack` has taken apart."""

    def chain(name: str) -> Chain:
        *counts, read = map(int, entry[f"{name}_counts"])
        starts, entries, links = (entry[f"{name}_{what}"] for what in ("starts", "entries", "links"))
        return Chain(tuple(counts), read, starts, entries, tuple(entry[f"{name}_lines{k}"] for k in range(4)), links)

    spacing, ratio, *numbers = map(float, entry["numbers"])
    factor, place_bits = map(int, numbers)
    return LatticeTables(spacing, ratio, factor, place_bits, chain("whole"), chain("bent"), entry["slices"])
