"""The surface lattice: diffusion in millimeters, without stretch and seams; see skincli.mesh.lattice."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skincli.gpu.blocks import Values, Vec3, Vec4
from skincli.graph.node import Draw, Input, Load, Node, Output, Pass, Ref, Source
from skincli.mesh.lattice import (
    BENT,
    DIRECTIONS,
    LINE_BITS,
    NODE_BITS,
    REACH,
    Chain,
    LatticeTables,
    taps,
    tetrahedron_weights,
)
from skincli.mesh.words import WIDTH, as_words, height
from skincli.passes.seen import Tiled, tile_defines

#: stands for the average of a node that no light reaches; lights may be negative, but not so
NONE = -1e30

#: what the shaders share with the tables
DEFINES = (
    ("NONE", str(NONE)),
    ("ROW_WIDTH", str(WIDTH)),
    ("ROW_SHIFT", str(WIDTH.bit_length() - 1)),
    ("REACH", str(REACH)),
    ("LINE_BITS", str(LINE_BITS)),
    ("NODE_BITS", str(NODE_BITS)),
    ("BENT", f"{BENT}u"),
)


@dataclass(frozen=True)
class SplatValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    nodes : how many there are
    place_bits : bits of an entry for each coordinate of its block or texel
    """

    nodes: int
    place_bits: int


class LatticeSplat(Pass):
    """The sums that blocks of texels, and texels, give to each node, up to a common factor."""

    shader = "passes/lattice_splat.frag"
    inputs = {name: Input() for name in ("light", "image", "area", "starts", "entries")}
    outputs = {"splat": Output()}


class LatticeSplatBent(Pass):
    """The same alone and times the normal's coordinates."""

    shader = "passes/lattice_splat_bent.frag"
    inputs = {name: Input() for name in ("light", "facing", "image", "area", "normal", "starts", "entries")}
    outputs = {"one": Output(), "x": Output(), "y": Output(), "z": Output()}


@dataclass(frozen=True)
class LatticeBlurValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    nodes : how many go out
    weights : of a node and of its first, second and third pair
    """

    nodes: int
    weights: Vec4


class LatticeBlur(Pass):
    """One of the four directions."""

    shader = "passes/lattice_blur.frag"
    inputs = {"image": Input(), "lines": Input()}
    outputs = {"blurred": Output()}


class LatticeBlurBent(Pass):
    """One of the four directions for the sums alone and times the normal's coordinates."""

    shader = "passes/lattice_blur_bent.frag"
    inputs = {
        "image_one": Input(),
        "image_x": Input(),
        "image_y": Input(),
        "image_z": Input(),
        "lines": Input(),
    }
    outputs = {"one": Output(), "x": Output(), "y": Output(), "z": Output()}


@dataclass(frozen=True)
class GradientValues(Values):
    """How many nodes there are."""

    nodes: int


class LatticeGradient(Pass):
    """Averages (x, NONE for none) and gradients (yzw) per half lattice constant, a texture per channel."""

    shader = "passes/lattice_gradient.frag"
    inputs = {"image": Input(), "links": Input()}
    outputs = {"red": Output(), "green": Output(), "blue": Output()}


class LatticeGradientBent(Pass):
    """Sums and their gradients per half lattice constant: first of all nodes alone, then times the normal's x, y, z."""

    shader = "passes/lattice_gradient_bent.frag"
    inputs = {**LatticeBlurBent.inputs, "links": Input()}
    outputs = {"sums": Output(), "along_x": Output(), "along_y": Output(), "along_z": Output()}


@dataclass(frozen=True)
class SliceValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    weight : of this Gaussian in the sum, per channel
    share : its part of the sum's alpha
    half_spacing : half a lattice constant, mm
    nodes : how many have links
    bent : how many of them have sums times the normal's coordinates too
    """

    weight: Vec3
    share: float
    half_spacing: float
    nodes: int
    bent: int


@dataclass(frozen=True)
class Term:
    """One Gaussian of a sum.

    Parameters
    ----------
    key : names the tables: the mesh, the atlas, sigma
    tables : of its sigma
    weight : per channel
    """

    key: str
    tables: LatticeTables
    weight: tuple[float, float, float]


class LatticeSlice(Tiled):
    """The weighted sum of Gaussians at each texel (rgb); a is 1 where light reaches all corners of its tetrahedra."""

    shader = "passes/lattice_slice.frag"
    additive = True
    inputs = {
        **{name: Input() for name in ("seen", "slices", "links", "position", "normal")},
        **{name: Input() for name in (*LatticeGradient.outputs, *LatticeGradientBent.outputs)},
    }
    outputs = {"sliced": Output()}

    def __init__(self, *arguments: Any, terms: Sequence[Term], **options: Any) -> None:
        super().__init__(*arguments, **options)
        #: of which the draws are made, for the twin
        self.terms = tuple(terms)


def lattice_nodes(
    name: str,
    size: tuple[int, int],
    image: Source,
    position: Source,
    normal: Source,
    area: Source,
    blocks: Pass,
    seen: Source,
    terms: Sequence[Term],
) -> list[Node]:
    """Return the nodes of a sum of Gaussians; the last, `name`, has the output `sliced`.

    Parameters
    ----------
    size : of the atlas
    image : irradiance (rgb) in the atlas
    position : of the surface (xyz, mm) in the atlas
    normal : of the surface without bumps (xyz) in the atlas
    area : mm² of each texel (r), 0 where it gives nothing
    blocks : a WindowSource of as many texels as the tables say
    seen : see skincli.passes.seen
    terms : one with weights of 1 returns a single Gaussian
    """
    nodes: list[Node] = []
    draws = []
    light, facing = (Ref(blocks.name, output) for output in ("light", "facing"))
    gifts = {"light": light, "image": image, "area": area}
    for number, term in enumerate(terms):
        own, table = f"{name}_{number}", term.tables
        whole = _chain(f"{own}_whole", term, table.whole, (LatticeSplat, LatticeBlur, LatticeGradient), gifts)
        slices = table_loads(own, term.key, {"slices": table.slices})
        gradient = whole[-1]
        assert isinstance(gradient, Pass)
        inputs = {**_results(gradient), **_images(slices), "links": gradient.wired["links"]}
        nodes += [*whole, *slices.values()]
        if table.bent.read:
            turned = {**gifts, "normal": normal, "facing": facing}
            passes = (LatticeSplatBent, LatticeBlurBent, LatticeGradientBent)
            bent = _chain(f"{own}_bent", term, table.bent, passes, turned)
            inputs |= _results(bent[-1])
            nodes += bent
        share = SliceValues(term.weight, 1 / len(terms), table.spacing / 2, table.whole.read, table.bent.read)
        draws.append(Draw(share, inputs))
    shared = {"position": position, "normal": normal, "seen": seen}
    return [*nodes, LatticeSlice(name, size, draws, shared, defines=(*DEFINES, *tile_defines(size)), terms=terms)]


def _chain(
    name: str,
    term: Term,
    chain: Chain,
    passes: tuple[type[Pass], type[Pass], type[Pass]],
    inputs: Mapping[str, Source],
) -> list[Node]:
    """Return the nodes of a splat, its four blurs and their gradients, these last."""
    splat, blur, gradient = passes
    lines = {f"lines{k}": array for k, array in enumerate(chain.lines)}
    loads = table_loads(
        name, term.key, {"starts": chain.starts, "entries": chain.entries, **lines, "links": chain.links}
    )
    tables = _images(loads)
    wired = {**inputs, "starts": tables["starts"], "entries": tables["entries"]}
    splatted, *blurred = chain.counts
    draw = Draw(SplatValues(splatted, term.tables.place_bits))
    last = splat(f"{name}_splat", _extent(splatted), [draw], wired, defines=DEFINES)
    nodes: list[Node] = [*loads.values(), last]
    weights = taps(term.tables.ratio)
    for k, count in enumerate(blurred):
        wired = dict(zip(blur.inputs, _results(last).values(), strict=False)) | {"lines": tables[f"lines{k}"]}
        draw = Draw(LatticeBlurValues(count, weights))
        last = blur(f"{name}_blur{k}", _extent(count), [draw], wired, defines=DEFINES)
        nodes.append(last)
    wired = dict(zip(gradient.inputs, _results(last).values(), strict=False)) | {"links": tables["links"]}
    texels = chain.read * (4 if gradient is LatticeGradientBent else 1)
    draw = Draw(GradientValues(chain.read))
    return [*nodes, gradient(f"{name}_gradient", _extent(texels), [draw], wired, defines=DEFINES)]


def table_loads(name: str, key: str, tables: Mapping[str, NDArray[np.float32]]) -> dict[str, Load]:
    """Return the nodes that load (h, w, c) tables, whose first row GL has at the bottom.

    Parameters
    ----------
    name : their common name
    key : says what the tables are made of
    """
    return {
        what: Load(
            f"{name}_{what}",
            f"{key} {name} {what}",
            partial(_upwards, array),
            {1: "r32f", 4: "rgba32f"}[array.shape[2]],
        )
        for what, array in tables.items()
    }


def _upwards(array: NDArray[np.float32]) -> list[NDArray[np.floating]]:
    return [array[::-1]]


def _images(loads: Mapping[str, Load]) -> dict[str, Source]:
    return {what: Ref(load.name, "image") for what, load in loads.items()}


def _results(node: Node) -> dict[str, Source]:
    return {output: Ref(node.name, output) for output in node.outputs}


def _extent(count: int) -> tuple[int, int]:
    return WIDTH, height(count)


def twin(
    terms: Sequence[Term],
    image: NDArray[np.float64],
    position: NDArray[np.float64],
    normal: NDArray[np.float64],
    area: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the weighted sum of Gaussians as the passes compute it.

    Parameters
    ----------
    image : (h, w, 3), top row first
    position : (h, w, 3) mm
    normal : (h, w, 3) unit
    area : (h, w) mm²

    Returns
    -------
    (h, w, 4)
    """
    # Tables count from the lowest row.
    image, position, normal, area = image[::-1], position[::-1], normal[::-1], area[::-1]
    source = np.concatenate([image * area[..., None], area[..., None]], axis=-1)
    total = np.zeros((*area.shape, 4))
    for term in terms:
        table = term.tables
        whole = splat_twin(table.whole, table, source)
        bent = splat_twin(table.bent, table, source, normal)
        for k in range(4):
            whole = blur_twin(table.whole, k, taps(table.ratio), whole)
            bent = blur_twin(table.bent, k, taps(table.ratio), bent)
        averages, sums = gradient_twin(table.whole, whole), gradient_bent_twin(table.bent, bent)
        found = slice_twin(table, averages, sums, position, normal)
        total += found * [*term.weight, 1 / len(terms)]
    return total[::-1]


def splat_twin(
    chain: Chain, table: LatticeTables, source: NDArray[np.float64], normal: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Return the (n, 4) sums at the nodes; with a normal (n, 16), alone and times its coordinates."""
    nodes = chain.counts[0]
    starts = as_words(chain.starts.ravel()[: 2 * nodes + 1]).astype(np.int64)
    words = as_words(chain.entries.ravel()[: starts[-1]]).astype(np.int64)
    mask = (1 << table.place_bits) - 1
    column, row = words & mask, words >> table.place_bits & mask
    slot = np.repeat(np.arange(2 * nodes), np.diff(starts))
    single = slot[:, None] % 2 == 1

    def of_entries(texels: NDArray[np.float64], blocks: NDArray[np.float64]) -> NDArray[np.float64]:
        low = np.minimum(row, blocks.shape[0] - 1), np.minimum(column, blocks.shape[1] - 1)
        return np.where(single, texels[row, column], blocks[low])

    light = _blocks(source, table.factor)
    gifts = of_entries(source, light) * (words >> 2 * table.place_bits)[:, None]
    if normal is not None:
        area = light[..., 3:]
        facing = _blocks(normal * source[..., 3:], table.factor) / np.where(area > 0, area, 1)
        factors = np.concatenate([np.ones((len(words), 1)), of_entries(normal, facing)], axis=1)
        gifts = (factors[:, :, None] * gifts[:, None]).reshape(-1, 16)
    return np.stack([np.bincount(slot // 2, column, nodes) for column in gifts.T], axis=1)


def _blocks(image: NDArray[np.float64], factor: int) -> NDArray[np.float64]:
    """Return the sums over blocks of texels, lowest row first."""
    height, width, channels = image.shape
    rows, columns = -(-height // factor), -(-width // factor)
    padded = np.pad(image, ((0, rows * factor - height), (0, columns * factor - width), (0, 0)))
    return np.asarray(padded.reshape(rows, factor, columns, factor, channels).sum(axis=(1, 3)))


def blur_twin(
    chain: Chain, direction: int, weights: tuple[float, ...], sums: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the (m, c) sums after one direction, from the (n, c) before it."""
    count = chain.counts[direction + 1]
    words = as_words(chain.lines[direction].ravel()[:count]).astype(np.int64)
    index = words & ((1 << LINE_BITS) - 1)
    held = np.append(sums, np.zeros((1, sums.shape[1])), axis=0)
    total = np.zeros((count, sums.shape[1]))
    for k in range(2 * REACH + 1):
        there = words >> LINE_BITS + k & 1
        total += weights[abs(k - REACH)] * there[:, None] * held[index]
        index += there
    return total


def gradient_twin(chain: Chain, sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (n, 4, 3): averages of the channels, NONE for none, and their change along x, y, z."""
    known = sums[:, 3:] > 0
    average = np.where(known, sums[:, :3] / np.where(known, sums[:, 3:], 1), 0)
    here = average[: chain.read]
    result = np.zeros((chain.read, 4, 3))
    result[:, 0] = np.where(known[: chain.read], here, NONE)
    for direction, ahead, behind in _beside(chain):
        forward = (average[ahead] - here) * known[ahead] * (2 - known[behind])
        backward = (here - average[behind]) * known[behind] * (2 - known[ahead])
        result[:, 1:] += (forward + backward)[:, None] * direction[:, None] / 8
    return result


def gradient_bent_twin(chain: Chain, sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (n, 4, 16): the sums and their change along x, y, z."""
    result = np.zeros((chain.read, 4, 16))
    result[:, 0] = sums[: chain.read]
    for direction, ahead, behind in _beside(chain):
        result[:, 1:] += (sums[ahead] - sums[behind])[:, None] * direction[:, None] / 8
    return result


def _beside(chain: Chain) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]]:
    """Yield each direction, and the nodes one step along and against it."""
    links = chain.links.reshape(-1, 8)[: chain.read].astype(np.int64)
    yield from zip(DIRECTIONS, links.T[:4], links.T[4:], strict=True)


def slice_twin(
    table: LatticeTables,
    averages: NDArray[np.float64],
    bent: NDArray[np.float64],
    position: NDArray[np.float64],
    normal: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return (h, w, 4): one Gaussian, and the share of it that is known."""
    rows, columns = np.nonzero(table.slices[..., 0])
    words = as_words(table.slices[rows, columns, 0]).astype(np.int64)
    own, turned = words & ((1 << NODE_BITS) - 1), words & BENT > 0
    at = position[rows, columns] / (table.spacing / 2)
    parity = words[:, None] >> NODE_BITS + np.arange(3) & 1
    offset = np.clip(at - 2 * (2 * np.floor((at / 2 - parity) / 2 + 0.5) + parity), -1, 1)
    sign = np.where(offset < 0, -1.0, 1.0)
    order = np.argsort(-np.abs(offset), axis=1, kind="stable")
    weights = tetrahedron_weights(*np.take_along_axis(np.abs(offset), order, axis=1).T)
    longest, shortest = (2 * sign * (np.arange(3) == order[:, k : k + 1]) for k in (0, 2))
    read, links = table.whole.read, table.whole.links.reshape(-1, 8)

    def beside(node: NDArray[np.int64], step: NDArray[np.float64]) -> NDArray[np.int64]:
        k = (step[:, 1] * step[:, 0] < 0) + 2 * (step[:, 2] * step[:, 0] < 0) + 4 * (step[:, 0] < 0)
        return np.where(node < read, links[np.minimum(node, read - 1), k], node).astype(np.int64)

    across = beside(own, sign)
    node = np.stack([own, beside(across, longest - sign), across, beside(own, sign - shortest)], axis=1)
    # See the shader: rounding may choose the tetrahedron next door.
    weights = weights * (node < np.where(turned, len(bent), read)[:, None])
    away = np.stack([offset, offset - longest, offset - sign, offset - sign + shortest], axis=1)
    found = np.zeros((len(words), 4))
    straight = averages[np.minimum(node[~turned], read - 1)]
    share = weights[~turned] * (straight[:, :, 0, 0] != NONE)
    change = np.einsum("nkd,nkdc->nkc", away[~turned], straight[:, :, 1:])
    found[~turned, :3] = np.einsum("nk,nkc->nc", share, straight[:, :, 0] + 0.5 * change)
    found[~turned, 3] = share.sum(axis=1)
    factors = np.concatenate([np.ones((turned.sum(), 1)), normal[rows, columns][turned]], axis=1)
    held = np.append(bent, np.zeros((1, 4, 16)), axis=0)[np.minimum(node[turned], len(bent))]
    from_node = np.concatenate([np.ones((len(held), 4, 1)), 0.5 * away[turned]], axis=2)
    sliced = np.einsum("nk,nkd,nkdc->nc", weights[turned], from_node, held).reshape(-1, 4, 4)
    sums = np.einsum("nf,nfc->nc", factors, sliced)
    known = sums[:, 3:] > 0
    found[turned] = np.where(known, np.append(sums[:, :3], known, axis=1) / np.where(known, sums[:, 3:], 1), 0)
    found[turned, 3] = known[:, 0]
    result = np.zeros((*position.shape[:2], 4))
    result[rows, columns] = found
    return result
