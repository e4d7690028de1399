"""Static tables of the surface lattice: diffusion in millimeters by a sparse body-centered lattice about the surface.

A two-dimensional Gaussian over distances in space is a three-dimensional one up to a factor that cancels in the ratio
of blurred irradiance and blurred area, so the surface may be blurred in space, where it has neither stretch nor seams.
The lattice and its tetrahedra are those of the permutohedral lattice in three dimensions (Adams, Baek and Davis 2010,
"Fast High-Dimensional Filtering Using the Permutohedral Lattice"). New here are the slice, which interpolates averages
with their gradients, and tables that keep each line of nodes contiguous.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from skincli.errors import LimitError

Floats = NDArray[np.float64]
Keys = NDArray[np.int64]

#: lattice constant (edge of the cubic cell) over sigma
RATIO = 1.0

#: texels of a row in all tables and node textures, a power of two
WIDTH = 2048

#: sigmas between the nodes by which bent surface is found, how long a mean normal says it is not, and how many rings
#: of such nodes lie within reach of a bent one
BENT_SPACING = 2.0
BENT_BELOW = 0.97
BENT_RINGS = 2

#: lines along which the blur runs, in half lattice constants
DIRECTIONS = np.array([(1, 1, 1), (1, -1, 1), (1, 1, -1), (1, -1, -1)])

# A key packs (y - x, z - x, x) of a node, 21 bits each: ascending keys follow the lines of the first direction.
_BITS = 21
_MASK = np.int64((1 << _BITS) - 1)
_BIAS = np.int64(1 << (_BITS - 1))
_ORIGIN = _BIAS * np.int64((1 << 2 * _BITS) + (1 << _BITS) + 1)
_UNITS = np.array([1 - (1 << 2 * _BITS) - (1 << _BITS), 1 << 2 * _BITS, 1 << _BITS], dtype=np.int64)

#: bits of a word
WORD_BITS = 30

#: bits of a word of `slices` that name a node; the other eight hold a code or a place
NODE_BITS = 22
PLACE_STEPS = 255

#: bits of a word of `lines` before the five that say which nodes exist
LINE_BITS = 25

#: added to a texel's code where it reads the sums with normals
BENT = 64


@dataclass(frozen=True)
class Chain:
    """From texels to blurred nodes: a splat and four blurs, as (h, WIDTH, 1) float32, first row first.

    Parameters
    ----------
    level : nodes after the splat and after each of the four directions
    starts : first entry of each node of the splat, and one more
    entries : texel and weight of each contribution, by node
    lines : per direction: where a node's line goes on in the previous texture, and which of its five nodes exist
    """

    level: tuple[int, ...]
    starts: NDArray[np.float32]
    entries: NDArray[np.float32]
    lines: tuple[NDArray[np.float32], ...]

    @property
    def nbytes(self) -> int:
        """Bytes of its tables."""
        return sum(array.nbytes for array in (self.starts, self.entries, *self.lines))


@dataclass(frozen=True)
class LatticeTables:
    """Everything about a surface that the passes of one sigma read.

    Words of `entries`, `lines` and `slices` are 30 bits in a float32 whose exponent lies in the normal range.

    Parameters
    ----------
    spacing : lattice constant, mm
    ratio : the same over sigma
    texel_bits : bits of an entry for each coordinate of its texel; the rest hold the weight
    whole : sums of irradiance and area at all nodes
    bent : the same and times the normal, at those nodes where normals differ; they are the first nodes of `whole`
    nodes : how many nodes texels read; those of `whole` after them are only their neighbors
    links : two of (h, WIDTH, 4): nodes one step along and against each direction
    slices : (size, size, 4) the four nodes of a texel's tetrahedron, its orientation, its place in it, and whether it
        reads `bent`; 0 for no texel
    """

    spacing: float
    ratio: float
    texel_bits: int
    whole: Chain
    bent: Chain
    nodes: int
    links: tuple[NDArray[np.float32], NDArray[np.float32]]
    slices: NDArray[np.float32]

    @property
    def nbytes(self) -> int:
        """Bytes of all tables."""
        return self.whole.nbytes + self.bent.nbytes + sum(array.nbytes for array in (*self.links, self.slices))


def tables(
    positions: Floats, normals: Floats, areas: Floats, texel: Keys, size: int, sigma: float, ratio: float = RATIO
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
    ratio : lattice constant over sigma

    Raises
    ------
    LimitError : the surface has more nodes than a table can name
    """
    spacing = ratio * sigma
    corner, place, code = tetrahedra(positions, spacing)
    weights = tetrahedron_weights(place)
    texel_bits = max(11, (size - 1).bit_length())
    address = (texel % size | texel // size << texel_bits).astype(np.uint32)
    keys, node = _numbered(corner)
    if len(keys) >= 1 << NODE_BITS:
        raise LimitError(
            f"sigma {sigma:.2f} mm takes {len(keys)} lattice nodes on this mesh; at most {1 << NODE_BITS} are allowed; "
            "choose a larger optics.radius"
        )
    receives, gives = _bent(positions, normals, areas, sigma)
    first = np.zeros(len(keys), dtype=bool)
    first[node[receives]] = True
    rank = np.empty(len(keys), dtype=np.int64)
    rank[first] = np.arange(first.sum())
    rank[~first] = np.arange(first.sum(), len(keys))

    around = _ring(keys)
    target = np.concatenate([keys[first], keys[~first], np.setdiff1d(around, keys, assume_unique=True)])
    whole, links = _chain(keys, node, weights, areas > 0, address, texel_bits, around, target, len(keys))
    some, some_node = _numbered(corner[gives])
    near = _ring(np.union1d(some, keys[first]))
    bent, _ = _chain(
        some, some_node, weights[gives], areas[gives] > 0, address[gives], texel_bits, near, keys[first], 0
    )

    slices = np.zeros((size * size, 4), dtype=np.float32)
    digits = np.concatenate([code[:, None] + BENT * receives[:, None], np.rint(place * PLACE_STEPS)], axis=1)
    slices[texel] = _as_float(rank[node] | digits.astype(np.int64) << NODE_BITS)
    return LatticeTables(spacing, ratio, texel_bits, whole, bent, len(keys), links, slices.reshape(size, size, 4))


@cache
def taps(ratio: float, gradients: bool = True) -> tuple[float, float, float]:
    """Return the weights of a node and of the first and second pair along a line, which sum to 1.

    Splat, four blurs and slice together answer waves like the Gaussian does, as nearly as least squares over the
    volume of wave vectors allow: the surface is thin, so waves across it are as short as the lattice holds.

    Parameters
    ----------
    ratio : lattice constant over sigma
    gradients : whether the slice knows them; without, it blurs by itself
    """
    random = np.random.default_rng(0)
    length = np.linspace(0.15, 5.0, 60)
    wave = random.normal(size=(8, len(length), 3))
    wave *= (length / np.linalg.norm(wave, axis=2))[..., None]
    # From radians per sigma to radians per half lattice constant.
    wave = wave.reshape(-1, 3) * (ratio / 2)
    around = _transfer(wave, 0.5 if gradients else 0.0, random)
    wanted = np.exp(-0.5 * (np.linalg.norm(wave, axis=1) * 2 / ratio) ** 2)
    phase = wave @ DIRECTIONS.T
    weight = np.linalg.norm(wave, axis=1)

    def fault(pairs: Floats) -> Floats:
        line = 1 - 2 * pairs.sum() + 2 * pairs[0] * np.cos(phase) + 2 * pairs[1] * np.cos(2 * phase)
        return weight * (around * line.prod(axis=1) - wanted)

    near, far = optimize.least_squares(fault, [0.2, 0.03]).x
    return float(1 - 2 * (near + far)), float(near), float(far)


def _transfer(wave: Floats, share: float, random: np.random.Generator) -> Floats:
    """Return the mean response of splat and slice to (m, 3) waves, radians per half lattice constant.

    `share` of the gradients enters the slice.
    """
    _, place, code = tetrahedra(random.uniform(-1, 1, (400, 3)), 2.0)
    offset, weights = unpacked_place(code, place)
    phase = -np.einsum("md,nkd->mnk", wave, offset)
    splat = np.sum(weights * np.cos(phase), axis=2).mean(axis=1)
    # The wave's slope as differences of neighbors tell it.
    slope = np.sin(wave @ DIRECTIONS.T) @ DIRECTIONS / 4
    change = -share * np.einsum("md,nkd->mnk", slope, offset)
    slice_ = np.sum(weights * (np.cos(phase) + np.sin(phase) * change), axis=2).mean(axis=1)
    return splat * slice_


def coordinates(keys: Keys) -> Floats:
    """Return the (..., 3) coordinates of nodes in half lattice constants."""
    x = (keys & _MASK) - _BIAS
    y = (keys >> 2 * _BITS) - _BIAS + x
    z = (keys >> _BITS & _MASK) - _BIAS + x
    return np.stack([x, y, z], axis=-1).astype(np.float64)


def _numbered(corner: Keys) -> tuple[Keys, Keys]:
    """Return the distinct keys, ascending, and for each of (n, 4) keys its number among them."""
    flat = corner.ravel()
    order = np.argsort(flat, kind="stable")
    ordered = flat[order]
    new = np.append(True, ordered[1:] != ordered[:-1])[: len(flat)]
    node = np.empty(len(flat), dtype=np.int64)
    node[order] = np.cumsum(new) - 1
    return ordered[new], node.reshape(-1, 4)


def _ring(keys: Keys) -> Keys:
    """Return ascending keys with all their neighbors."""
    steps = DIRECTIONS @ _UNITS
    # Merging ascending runs is what a stable sort is good at.
    every = np.sort(np.concatenate([keys, *(keys + s for s in steps), *(keys - s for s in steps)]), kind="stable")
    return every[np.append(True, every[1:] != every[:-1])[: len(every)]]


def _bent(
    positions: Floats, normals: Floats, areas: Floats, sigma: float
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which points see normals that differ within reach, and which points are within reach of those.

    Where all normals within reach nearly agree, w = (1 + n . n') / 2 is nearly constant and cancels in the average.
    """
    corner, place, _ = tetrahedra(positions, BENT_SPACING * sigma)
    keys, node = _numbered(corner)
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
    at = positions / (spacing / 2)
    base = 2 * np.floor(at / 2 + 0.5)
    offset = at - base
    size = np.abs(offset)
    axes = np.argsort(-size, axis=1, kind="stable")
    place = np.take_along_axis(size, axes, axis=1)
    negative = offset < 0
    sign = np.where(negative, -1, 1).astype(np.int64)
    steps = sign * _UNITS
    a = base.astype(np.int64) @ _UNITS + _ORIGIN
    far = a + steps.sum(axis=1)
    longest = np.take_along_axis(steps, axes[:, :1], axis=1)[:, 0]
    shortest = np.take_along_axis(steps, axes[:, 2:], axis=1)[:, 0]
    # Lehmer code: which axis is the longest, and whether the other two are in cyclic order.
    cyclic = (axes[:, 1] - axes[:, 0]) % 3 == 1
    code = (axes[:, 0] * 2 + ~cyclic) * 8 + (negative * np.array([1, 2, 4])).sum(axis=1)
    return np.stack([a, a + 2 * longest, far, far - 2 * shortest], axis=1), place, code


def tetrahedron_weights(place: Floats) -> Floats:
    """Return the (n, 4) barycentric weights of points at `place`, see tetrahedra."""
    longest, middle, shortest = place.T
    return np.stack(
        [1 - (longest + middle) / 2, (longest - middle) / 2, (middle + shortest) / 2, (middle - shortest) / 2], axis=1
    )


def unpacked_place(code: NDArray[np.int64], place: Floats) -> tuple[Floats, Floats]:
    """Return what `tetrahedra` packed: (n, 4, 3) offsets from the corners, in half lattice constants, and weights."""
    axes = np.zeros((len(code), 3), dtype=np.int64)
    axes[:, 0] = code >> 4
    step = np.where(code & 8, 2, 1)
    axes[:, 1] = (axes[:, 0] + step) % 3
    axes[:, 2] = (axes[:, 0] - step) % 3
    sign = 1.0 - 2.0 * (code[:, None] >> np.arange(3) & 1)
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


def _as_float(words: NDArray[np.integer[Any]]) -> NDArray[np.float32]:
    """Return 30-bit words in float32 bit patterns that no driver flushes or quiets: exponents 64 to 127."""
    bits = np.asarray(words, dtype=np.uint32)
    return ((bits & np.uint32(0x1FFFFFFF)) | np.uint32(0x20000000) | (bits >> np.uint32(29)) << np.uint32(31)).view(
        np.float32
    )


def as_words(floats: NDArray[np.float32]) -> NDArray[np.uint32]:
    """Return the 30-bit words that a table holds; the inverse of how tables are made."""
    bits = np.ascontiguousarray(floats).view(np.uint32)
    return np.asarray((bits & np.uint32(0x1FFFFFFF)) | (bits >> np.uint32(31)) << np.uint32(29), dtype=np.uint32)


def _line_keys(keys: Keys, direction: NDArray[np.int64]) -> Keys:
    """Return keys whose order follows the lines of a direction; neighbors on a line differ by 1."""
    x = (keys & _MASK) - _BIAS
    shift = ((1 - direction[1]) << 2 * _BITS) + ((1 - direction[2]) << _BITS)
    return keys + x * shift


def _chain(
    keys: Keys,
    node: Keys,
    weights: Floats,
    gives: NDArray[np.bool_],
    address: NDArray[np.uint32],
    texel_bits: int,
    universe: Keys,
    target: Keys,
    linked: int,
) -> tuple[Chain, tuple[NDArray[np.float32], NDArray[np.float32]]]:
    """Return the tables of a splat and four blurs, and the links among the first `linked` nodes and all others.

    Parameters
    ----------
    keys : nodes of the splat, ascending
    node, weights : (n, 4) of each point
    gives, address : (n,) whether a point has area, and its texel
    universe : ascending keys of all nodes that may hold a value
    target : keys of the nodes after the last blur, in their order
    """
    entry = np.argsort(node.ravel(), kind="stable")
    entry = entry[gives[entry >> 2] & (weights.ravel()[entry] > 0)]
    counts = np.bincount(node.ravel()[entry], minlength=len(keys))
    steps = (1 << WORD_BITS - 2 * texel_bits) - 1
    quantized = np.rint(weights.ravel()[entry] * steps).astype(np.uint32)
    words = address[entry >> 2] | quantized << np.uint32(2 * texel_bits)
    starts = np.append(0, np.cumsum(counts)).astype(np.float32)

    orders, joins = [], []
    for direction in DIRECTIONS:
        line = _line_keys(universe, direction)
        order = np.argsort(line, kind="stable").astype(np.int32)
        ahead = line[order]
        orders.append(order)
        joins.append(np.append(ahead[1:] == ahead[:-1] + 1, False)[: len(line)])

    def spread(mask: NDArray[np.bool_], k: int) -> NDArray[np.bool_]:
        """Grow a set of nodes by two steps both ways along direction k."""
        lined, joined = mask[orders[k]], joins[k][:-1]
        for _ in range(2):
            grown = lined.copy()
            grown[:-1] |= lined[1:] & joined
            grown[1:] |= lined[:-1] & joined
            lined = grown
        result = np.empty_like(mask)
        result[orders[k]] = lined
        return result

    final = np.searchsorted(universe, target)
    ends = [np.zeros(len(universe), dtype=bool) for _ in range(2)]
    ends[0][np.searchsorted(universe, keys)] = True
    ends[1][final] = True
    forward, backward = [ends[0]], [ends[1]]
    for k in range(3):
        forward.append(spread(forward[-1], k))
        backward.append(spread(backward[-1], 3 - k))
    levels = [ends[0], *(forward[k] & backward[4 - k] for k in (1, 2, 3)), ends[1]]

    number = np.empty(len(universe), dtype=np.float32)
    number[final] = np.arange(len(final))
    along = np.empty((len(universe), 4), dtype=np.float32)
    against = np.empty((len(universe), 4), dtype=np.float32)
    lines = []
    for k in range(4):
        order, joined = orders[k], joins[k]
        here = levels[k][order]
        # Which of the nodes two and one before, here, one and two after exist.
        chain = [np.zeros(len(order), dtype=bool) for _ in range(5)]
        chain[2] = here
        chain[1][1:] = here[:-1] & joined[:-1]
        chain[3][:-1] = here[1:] & joined[:-1]
        chain[0][2:] = here[:-2] & joined[:-2] & joined[1:-1]
        chain[4][:-2] = here[2:] & joined[:-2] & joined[1:-1]
        place = np.cumsum(here) - here
        exists = sum(one.astype(np.uint32) << bit for bit, one in enumerate(chain))
        word = np.empty(len(order), dtype=np.uint32)
        word[order] = place.astype(np.uint32) | exists << LINE_BITS
        out = final if k == 3 else orders[k + 1][levels[k + 1][orders[k + 1]]]
        lines.append(rows(_as_float(word[out])[:, None]))
        if linked:
            numbers = number[order]
            beside = numbers.copy()
            beside[:-1] = np.where(joined[:-1], numbers[1:], numbers[:-1])
            along[order, k] = beside
            beside = numbers.copy()
            beside[1:] = np.where(joined[:-1], numbers[:-1], numbers[1:])
            against[order, k] = beside
    level = tuple(int(mask.sum()) for mask in levels)
    chain_tables = Chain(level, rows(starts[:, None]), rows(_as_float(words)[:, None]), tuple(lines))
    return chain_tables, (rows(along[final[:linked]]), rows(against[final[:linked]]))


def pack(tables: LatticeTables) -> dict[str, NDArray[Any]]:
    """Return the tables as named arrays, as the disk cache keeps them."""
    entry: dict[str, NDArray[Any]] = {
        "numbers": np.array([tables.spacing, tables.ratio, tables.texel_bits, tables.nodes]),
        "along": tables.links[0],
        "against": tables.links[1],
        "slices": tables.slices,
    }
    for name, chain in (("whole", tables.whole), ("bent", tables.bent)):
        entry |= {f"{name}_level": np.array(chain.level), f"{name}_starts": chain.starts}
        entry |= {f"{name}_entries": chain.entries}
        entry |= {f"{name}_lines{k}": array for k, array in enumerate(chain.lines)}
    return entry


def unpack(entry: dict[str, NDArray[Any]]) -> LatticeTables:
    """Return the tables that `pack` has taken apart."""
    whole, bent = (
        Chain(
            tuple(map(int, entry[f"{name}_level"])),
            entry[f"{name}_starts"],
            entry[f"{name}_entries"],
            tuple(entry[f"{name}_lines{k}"] for k in range(4)),
        )
        for name in ("whole", "bent")
    )
    spacing, ratio, texel_bits, nodes = map(float, entry["numbers"])
    links = entry["along"], entry["against"]
    return LatticeTables(spacing, ratio, int(texel_bits), whole, bent, int(nodes), links, entry["slices"])
