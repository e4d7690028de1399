"""Static tables of the surface lattice: diffusion in millimeters by a sparse body-centered lattice about the surface.

A two-dimensional Gaussian over distances in space is a three-dimensional one up to a factor that cancels in the ratio
of blurred irradiance and blurred area, so the surface may be blurred in space, where it has neither stretch nor seams.
The lattice and its tetrahedra are those of the permutohedral lattice in three dimensions (Adams, Baek and Davis 2010,
"Fast High-Dimensional Filtering Using the Permutohedral Lattice"). New here are the slice, which interpolates averages
with their gradients, and tables that keep each line of nodes contiguous.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skincli.errors import LimitError

Floats = NDArray[np.float64]
Keys = NDArray[np.int64]

#: lattice constant (edge of the cubic cell) over sigma up to this many mm and beyond, where nodes are few
NARROW, RATIO_NARROW, RATIO_WIDE = 1.0, 1.0, 0.9

#: what the taps are given of the variance that they should have: least error on planes and heads, where the end of the
#: lattice beside the surface cuts what goes far
KEPT_VARIANCE = 0.98

#: nodes on either side of a node that the blur along a line reads; and how many steps far nodes are kept for it, along
#: the line and from the nodes that texels read
REACH = 3
SPREAD = 2

#: texels of a row in all tables and node textures, a power of two
WIDTH = 4096

#: sigmas between the nodes by which bent surface is found, how long a mean normal says it is not, and how many rings
#: of such nodes lie within reach of a bent one
BENT_SPACING = 2.0
BENT_BELOW = 0.98
BENT_RINGS = 2

#: lines along which the blur runs, in half lattice constants
DIRECTIONS = np.array([(1, 1, 1), (1, -1, 1), (1, 1, -1), (1, -1, -1)])

# A key packs (y - x, z - x, x) of a node, 21 bits each: ascending keys follow the lines of the first direction.
_BITS = 21
_MASK = np.int64((1 << _BITS) - 1)
_BIAS = np.int64(1 << (_BITS - 1))
_ORIGIN = _BIAS * np.int64((1 << 2 * _BITS) + (1 << _BITS) + 1)
_UNITS = np.array([1 - (1 << 2 * _BITS) - (1 << _BITS), 1 << 2 * _BITS, 1 << _BITS], dtype=np.int64)
_STEPS = DIRECTIONS @ _UNITS
_NONE = np.iinfo(np.int64).max

#: bits of a word
WORD_BITS = 30

#: bits of a word of `slices` that name a node; after them three that tell the node from others nearby, and BENT
NODE_BITS = 22
BENT = 1 << NODE_BITS + 3

#: bits of a word of `lines` before those that say which nodes of a line exist
LINE_BITS = WORD_BITS - 2 * REACH - 1

#: texels along the side of a block are the power of two by which it stays below sigma over this: wider ones move the
#: light at its edges by more than all else errs
BLOCKS_PER_SIGMA = 2.2

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

    Words of `starts`, `entries`, `lines` and `slices` are 30 bits in a float32 whose exponent lies in the normal range.

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
    of : (n,) the point of each texel
    blur : variance about the middle of a block, mm² per axis of the surface
    """

    positions: Floats
    normals: Floats
    areas: Floats
    address: NDArray[np.uint32]
    blocks: int
    of: Keys
    blur: float


def block_factor(sigma: float, texel: float) -> int:
    """Return the texels along the side of the blocks from which a Gaussian's light is given; both in mm."""
    return 1 << max(0, math.floor(math.log2(sigma / (BLOCKS_PER_SIGMA * texel))))


def tables(
    positions: Floats,
    normals: Floats,
    areas: Floats,
    texel: Keys,
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
    LimitError : the surface has more nodes than a table can name
    """
    spacing = sigma * (ratio or (RATIO_NARROW if sigma < NARROW else RATIO_WIDE))
    place_bits = max(11, (size - 1).bit_length())
    points = _points(positions, normals, areas, texel, size, factor, BLOCK_REACH * sigma, place_bits)
    receives, gives = bent(points.positions, points.normals, points.areas, sigma)
    bends = receives[points.of]

    base, code, _ = _cubes(positions, spacing)
    keys, own = _numbered(_key(base))
    corner, place, _ = tetrahedra(points.positions, spacing)
    # Many texels share a tetrahedron; mostly those of few nodes see normals differ.
    some = _corners_of(keys, own[bends], code[bends])
    reads = _distinct([_corners_of(keys, own, code), some])
    if factor > 1:
        reads = _distinct([reads, corner.ravel()])
    weights = tetrahedron_weights(place)
    gifts = _Gifts(corner, weights, points.address, points.areas > 0, points.blocks)
    whole, number = _chain(reads, np.append(some, np.setdiff1d(reads, some, assume_unique=True)), gifts, place_bits)
    if len(reads) > 1 << NODE_BITS or max(whole.counts) > 1 << LINE_BITS:
        raise LimitError(
            f"sigma {sigma:.2f} mm takes {max(whole.counts)} lattice nodes on this mesh, of which texels read "
            f"{len(reads)}; at most {1 << LINE_BITS} and {1 << NODE_BITS} are allowed; choose a larger optics.radius"
        )

    near = np.flatnonzero(gives)
    gifts = _Gifts(
        corner[near],
        weights[near],
        points.address[near],
        points.areas[near] > 0,
        int(np.searchsorted(near, points.blocks)),
    )
    turned, _ = _chain(_distinct([corner[near].ravel(), some]), some, gifts, place_bits)

    words = number(keys)[own] | (base.astype(np.int64) >> 1 & 1) @ np.array([1, 2, 4], dtype=np.int64) << NODE_BITS
    slices = np.zeros(size * size, dtype=np.float32)
    slices[texel] = as_floats(words | BENT * bends)
    left = spacing / np.sqrt(sigma**2 - points.blur)
    return LatticeTables(spacing, left, factor, place_bits, whole, turned, slices.reshape(size, size, 1))


def block_means(
    positions: Floats, normals: Floats, areas: Floats, texel: Keys, size: int, factor: int
) -> tuple[Keys, Floats, Floats, Floats]:
    """Return the block of each texel, and of each block what it holds, its middle and its mean normal.

    Parameters are those of `tables`; a block holds its area and next to nothing more, 0 where it has no texel.
    """
    row, column = np.divmod(texel, size)
    side = -(-size // factor)
    block = row // factor * side + column // factor
    # Where a block holds no area, its middle counts.
    mass = areas + 1e-9 * areas.mean()

    def summed(values: Floats) -> Floats:
        return np.bincount(block, values, side * side).astype(np.float64)

    total = summed(mass)
    held = np.maximum(total, 1e-300)
    middle, mean = (np.stack([summed(mass * axis) / held for axis in of.T], axis=1) for of in (positions, normals))
    return block, total, middle, mean


def _points(
    positions: Floats, normals: Floats, areas: Floats, texel: Keys, size: int, factor: int, reach: float, bits: int
) -> _Points:
    """Return the blocks of texels that lie within `reach` of their middle and face one way, and all other texels."""
    side = -(-size // factor)
    block, total, middle, mean = block_means(positions, normals, areas, texel, size, factor)

    def summed(values: Floats) -> Floats:
        return np.bincount(block, values, side * side).astype(np.float64)

    away = np.sum((positions - middle[block]) ** 2, axis=1)
    apart = (summed((away > reach**2).astype(np.float64)) > 0) | (np.linalg.norm(mean, axis=1) < BENT_BELOW)
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
        np.concatenate([summed(areas)[good], areas[alone]]),
        np.concatenate([_address(good, side, bits), _address(texel[alone], size, bits)]),
        len(good),
        of,
        float(areas[own] @ away[own] / max(areas.sum(), 1e-300)) / 2,
    )


def _address(index: Keys, side: int, bits: int) -> NDArray[np.uint32]:
    """Return column and row of places in a square."""
    return (index % side | index // side << bits).astype(np.uint32)


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


def coordinates(keys: Keys) -> Floats:
    """Return the (..., 3) coordinates of nodes in half lattice constants."""
    x = (keys & _MASK) - _BIAS
    y = (keys >> 2 * _BITS) - _BIAS + x
    z = (keys >> _BITS & _MASK) - _BIAS + x
    return np.stack([x, y, z], axis=-1).astype(np.float64)


def _numbered(keys: Keys) -> tuple[Keys, Keys]:
    """Return the distinct keys, ascending, and for each its number among them."""
    order = np.argsort(keys, kind="stable")
    distinct, number = _grouped(keys[order])
    node = np.empty(len(keys), dtype=np.int64)
    node[order] = number
    return distinct, node


def _grouped(ascending: Keys) -> tuple[Keys, Keys]:
    """Return the distinct keys, and for each its number among them."""
    new = np.append(True, ascending[1:] != ascending[:-1])[: len(ascending)]
    return ascending[new], np.cumsum(new) - 1


def _distinct(parts: Sequence[Keys]) -> Keys:
    """Return the keys of all parts, each once, ascending."""
    # Merging ascending runs is what a stable sort is good at.
    every = np.sort(np.concatenate(parts), kind="stable")
    return every[np.append(True, every[1:] != every[:-1])[: len(every)]]


def _ring(keys: Keys) -> Keys:
    """Return ascending keys with all their neighbors."""
    return _distinct([keys, *(keys + way * step for way in (-1, 1) for step in _STEPS)])


def _common(keys: Keys, others: Keys) -> Keys:
    """Return those of ascending keys that are among others, which ascend too."""
    return keys[np.append(others, _NONE)[np.searchsorted(others, keys)] == keys]


def _spread(keys: Keys, direction: int, within: Keys) -> Keys:
    """Return those keys of `within`, all ascending, that are up to SPREAD steps along a direction from others."""
    near = _distinct([keys + k * _STEPS[direction] for k in range(-SPREAD, SPREAD + 1)])
    return _common(near, within)


def bent(
    positions: Floats, normals: Floats, areas: Floats, sigma: float
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which points see normals that differ within reach, and which points are within reach of those.

    Where all normals within reach nearly agree, w = (1 + n . n') / 2 is nearly constant and cancels in the average.
    """
    base, code, place = _cubes(positions, BENT_SPACING * sigma)
    cubes, own = _numbered(_key(base))
    # Many points share a tetrahedron.
    kinds, kind = _numbered(own * 48 + code)
    keys, number = _numbered(_corners(cubes[kinds // 48], kinds % 48).ravel())
    node = number.reshape(-1, 4)[kind]
    weight = tetrahedron_weights(place) * areas[:, None]
    total = np.bincount(node.ravel(), weight.ravel(), len(keys))
    sums = [np.bincount(node.ravel(), (weight * axis[:, None]).ravel(), len(keys)) for axis in normals.T]
    mixed = np.linalg.norm(sums, axis=0) < BENT_BELOW * total
    receives: NDArray[np.bool_] = mixed[node].any(axis=1)
    reached = np.zeros(len(keys), dtype=bool)
    reached[node[receives]] = True
    for _ in range(BENT_RINGS):
        reached[np.flatnonzero(np.isin(keys, _ring(keys[reached]), assume_unique=True))] = True
    return receives, np.asarray(reached[node].any(axis=1))


def tetrahedra(positions: Floats, spacing: float) -> tuple[Keys, Floats, NDArray[np.int64]]:
    """Return the tetrahedron of the lattice in which each point lies.

    Returns
    -------
    corner : (n, 4) keys of its nodes: a, a + 2 s_i along the longest axis, a + s, a + s - 2 s_k along the shortest
    place : (n, 3) distances from a along the axes, in half lattice constants, longest first: 1 >= M >= m >= n >= 0
    code : (n,) 0 to 47: the order of the axes times 8 plus the signs
    """
    base, code, place = _cubes(positions, spacing)
    return _corners(_key(base), code), place, code


def _cubes(positions: Floats, spacing: float) -> tuple[Floats, NDArray[np.int64], Floats]:
    """Return coordinates of the even node a in whose cube each point lies, and code and place as `tetrahedra` does."""
    at = positions / (spacing / 2)
    base = 2 * np.floor(at / 2 + 0.5)
    offset = at - base
    size = np.abs(offset)
    axes = np.argsort(-size, axis=1, kind="stable")
    # Lehmer code: which axis is the longest, and whether the other two are in cyclic order.
    cyclic = (axes[:, 1] - axes[:, 0]) % 3 == 1
    code = (axes[:, 0] * 2 + ~cyclic) * 8 + ((offset < 0) * np.array([1, 2, 4])).sum(axis=1)
    return base, code, np.take_along_axis(size, axes, axis=1)


def _key(base: Floats) -> Keys:
    return np.asarray(base.astype(np.int64) @ _UNITS + _ORIGIN)


def _corners(key: Keys, code: NDArray[np.int64]) -> Keys:
    """Return (n, 4) keys of a tetrahedron by its first node and its code."""
    axes, sign = _oriented(code)
    steps = sign.astype(np.int64) * _UNITS
    longest, shortest = (np.take_along_axis(steps, axes[:, k : k + 1], axis=1)[:, 0] for k in (0, 2))
    far = key + steps.sum(axis=1)
    return np.stack([key, key + 2 * longest, far, far - 2 * shortest], axis=1)


def _corners_of(keys: Keys, own: Keys, code: NDArray[np.int64]) -> Keys:
    """Return the distinct nodes, ascending, of tetrahedra that begin at keys[own]."""
    met = np.zeros(len(keys) * 48, dtype=bool)
    met[own * 48 + code] = True
    found = np.flatnonzero(met)
    return _distinct([_corners(keys[found // 48], found % 48).ravel()])


def _oriented(code: NDArray[np.int64]) -> tuple[NDArray[np.int64], Floats]:
    """Return (n, 3) the axes, longest first, and the signs along x, y, z."""
    axes = np.zeros((len(code), 3), dtype=np.int64)
    axes[:, 0] = code >> 4
    step = np.where(code & 8, 2, 1)
    axes[:, 1] = (axes[:, 0] + step) % 3
    axes[:, 2] = (axes[:, 0] - step) % 3
    return axes, (1.0 - 2.0 * (code[:, None] >> np.arange(3) & 1)).astype(np.float64)


def tetrahedron_weights(place: Floats) -> Floats:
    """Return the (n, 4) barycentric weights of points at `place`, see tetrahedra."""
    longest, middle, shortest = place.T
    return np.stack(
        [1 - (longest + middle) / 2, (longest - middle) / 2, (middle + shortest) / 2, (middle - shortest) / 2], axis=1
    )


def unpacked_place(code: NDArray[np.int64], place: Floats) -> tuple[Floats, Floats]:
    """Return what `tetrahedra` packed: (n, 4, 3) offsets from the corners, in half lattice constants, and weights."""
    axes, sign = _oriented(code)
    unit = np.eye(3)
    offset = sign * np.einsum("nk,nkd->nd", place, unit[axes])
    far = offset - sign
    longest, shortest = (2 * sign * unit[axes[:, k]] for k in (0, 2))
    return np.stack([offset, offset - longest, far, far + shortest], axis=1), tetrahedron_weights(place)


def rows(array: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return (n, c) as (h, WIDTH, c), zero beyond n."""
    height = max(1, -(-len(array) // WIDTH))
    padded = np.zeros((height * WIDTH, array.shape[1]), dtype=np.float32)
    padded[: len(array)] = array
    return padded.reshape(height, WIDTH, -1)


def as_floats(words: NDArray[np.integer[Any]]) -> NDArray[np.float32]:
    """Return 30-bit words in float32 bit patterns that no driver flushes or quiets: exponents 64 to 127."""
    bits = np.asarray(words, dtype=np.uint32)
    return ((bits & np.uint32(0x1FFFFFFF)) | np.uint32(0x20000000) | (bits >> np.uint32(29)) << np.uint32(31)).view(
        np.float32
    )


def as_words(floats: NDArray[np.float32]) -> NDArray[np.uint32]:
    """Return the 30-bit words that a table holds; the inverse of how tables are made."""
    bits = np.ascontiguousarray(floats).view(np.uint32)
    return np.asarray((bits & np.uint32(0x1FFFFFFF)) | (bits >> np.uint32(31)) << np.uint32(29), dtype=np.uint32)


def _line_keys(keys: Keys, direction: int) -> Keys:
    """Return keys whose order follows the lines of a direction; neighbors on a line differ by 1."""
    x = (keys & _MASK) - _BIAS
    _, y, z = DIRECTIONS[direction]
    shift = ((1 - y) << 2 * _BITS) + ((1 - z) << _BITS)
    return keys + x * shift


@dataclass(frozen=True)
class _Gifts:
    """What points give to nodes.

    Parameters
    ----------
    corner, weights : (n, 4) the nodes and the shares
    address : (n,) column and row of block or texel
    gives : (n,) whether a point has area
    blocks : how many points are blocks; texels follow
    """

    corner: Keys
    weights: Floats
    address: NDArray[np.uint32]
    gives: NDArray[np.bool_]
    blocks: int


def _chain(near: Keys, read: Keys, gifts: _Gifts, place_bits: int) -> tuple[Chain, Callable[[Keys], Keys]]:
    """Return the tables of a splat and four blurs, and what numbers the nodes of the last.

    Parameters
    ----------
    near : ascending keys of nodes; two rings about them may hold a value
    read : keys of nodes that texels read, in their order
    """
    around = _ring(np.sort(read))
    target = np.append(read, np.setdiff1d(around, read, assume_unique=True))
    universe = _ring(_ring(near))
    flat = gifts.corner.ravel()
    steps = (1 << WORD_BITS - 2 * place_bits) - 1
    quantized = np.rint(gifts.weights.ravel() * steps).astype(np.uint32)
    entry = np.flatnonzero(np.repeat(gifts.gives, 4) & (quantized > 0))
    # Blocks come before texels, and a stable sort leaves them there.
    entry = entry[np.argsort(flat[entry], kind="stable")]
    words = gifts.address[entry >> 2] | quantized[entry] << np.uint32(2 * place_bits)
    keys, node = _grouped(flat[entry])
    single = entry >> 2 >= gifts.blocks
    starts = np.append(0, np.cumsum(np.bincount(2 * node + single, minlength=2 * len(keys))))

    order = np.argsort(target, kind="stable")
    held = [keys]
    for k in (0, 1, 2):
        held.append(_spread(held[k], k, universe))
    needed = around
    for k in (3, 2, 1):
        needed = _spread(needed, k, universe)
        held[k] = _common(held[k], needed)
    # Ascending keys follow the lines of the first direction already.
    held = [keys[np.argsort(_line_keys(keys, k), kind="stable")] for k, keys in enumerate(held)]
    lines = [_words(_line_keys(held[k], k), _line_keys(out, k)) for k, out in enumerate([*held[1:], target])]

    def number(keys: Keys) -> Keys:
        return order[np.searchsorted(around, keys)]

    links = np.empty((len(read), 8), dtype=np.float32)
    for k, step in enumerate([*_STEPS, *-_STEPS]):
        # A ring is about all of them.
        links[:, k] = number(read + step)
    chain = Chain(
        tuple(map(len, [*held, target])),
        len(read),
        rows(as_floats(starts)[:, None]),
        rows(as_floats(words)[:, None]),
        tuple(rows(as_floats(line)[:, None]) for line in lines),
        rows(links.reshape(-1, 4)),
    )
    return chain, number


def _words(held: Keys, wanted: Keys) -> NDArray[np.uint32]:
    """Return for nodes on lines where the nodes within REACH begin among those held, and which of them there are.

    Both are keys of one direction's lines; those held ascend.
    """
    index = np.searchsorted(held, wanted - REACH)
    words = index.astype(np.uint32)
    held = np.append(held, _NONE)
    for k in range(2 * REACH + 1):
        there = held[index] == wanted + (k - REACH)
        words |= there.astype(np.uint32) << np.uint32(LINE_BITS + k)
        index += there
    return words


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
