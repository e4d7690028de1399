"""The surface lattice: diffusion in millimeters, without stretch and seams; see skincli.mesh.lattice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from skincli.gpu.blocks import Values, Vec3
from skincli.graph.node import Draw, Input, Load, Node, Output, Pass, Ref, Source
from skincli.mesh.lattice import (
    BENT,
    DIRECTIONS,
    LINE_BITS,
    NODE_BITS,
    PLACE_STEPS,
    WIDTH,
    Chain,
    LatticeTables,
    as_words,
    taps,
    unpacked_place,
)

#: what the shaders share with the tables
DEFINES = (
    ("ROW_WIDTH", str(WIDTH)),
    ("ROW_SHIFT", str(WIDTH.bit_length() - 1)),
    ("LINE_BITS", str(LINE_BITS)),
    ("NODE_BITS", str(NODE_BITS)),
    ("PLACE_STEPS", f"{PLACE_STEPS}.0"),
    ("BENT", f"{BENT}u"),
)


@dataclass(frozen=True)
class SourceValues(Values):
    """No values."""


class LatticeSource(Pass):
    """Irradiance times area (rgb) and area (a, mm²) of each texel."""

    shader = "passes/lattice_source.frag"
    inputs = {"image": Input(), "area": Input()}
    outputs = {"source": Output()}


@dataclass(frozen=True)
class SplatValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    nodes : how many there are
    texel_bits : bits of an entry for each coordinate of its texel
    """

    nodes: int
    texel_bits: int


class LatticeSplat(Pass):
    """The sums that the texels give to each node, up to a common factor."""

    shader = "passes/lattice_splat.frag"
    inputs = {"source": Input(), "starts": Input(), "entries": Input()}
    outputs = {"splat": Output()}


class LatticeSplatBent(Pass):
    """The same alone and times the normal's coordinates."""

    shader = "passes/lattice_splat_bent.frag"
    inputs = {"source": Input(), "normal": Input(), "starts": Input(), "entries": Input()}
    outputs = {"one": Output(), "x": Output(), "y": Output(), "z": Output()}


@dataclass(frozen=True)
class LatticeBlurValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    nodes : how many go out
    middle, near, far : taps of a node and of its first and second pair
    """

    nodes: int
    middle: float
    near: float
    far: float


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
    """Averages (x) and their gradients (yzw) per half lattice constant, one texture per channel."""

    shader = "passes/lattice_gradient.frag"
    inputs = {"image": Input(), "along": Input(), "against": Input()}
    outputs = {"red": Output(), "green": Output(), "blue": Output()}


@dataclass(frozen=True)
class SliceValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    weight : of this Gaussian in the sum, per channel
    share : its part of the sum's alpha
    """

    weight: Vec3
    share: float


class LatticeSlice(Pass):
    """The weighted sum of Gaussians at each texel (rgb); a is 1 where a texel has a surface."""

    shader = "passes/lattice_slice.frag"
    additive = True
    inputs = {
        **{name: Input() for name in ("slices", "normal", "red", "green", "blue")},
        **{name: Input() for name in ("one", "x", "y", "z")},
    }
    outputs = {"sliced": Output()}


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


def lattice_nodes(
    name: str, size: tuple[int, int], image: Source, normal: Source, area: Source, terms: Sequence[Term]
) -> list[Node]:
    """Return the nodes of a sum of Gaussians; the last, `name`, has the output `sliced`.

    Parameters
    ----------
    size : of the atlas
    image : irradiance (rgb) in the atlas
    normal : of the surface without bumps (xyz) in the atlas
    area : mm² of each texel (r), 0 where it gives nothing
    terms : one with weights of 1 returns a single Gaussian
    """
    source = LatticeSource(f"{name}_source", size, [Draw(SourceValues())], {"image": image, "area": area})
    nodes: list[Node] = [source]
    draws = []
    gifts = {"source": Ref(source.name, "source")}
    for number, term in enumerate(terms):
        own, table = f"{name}_{number}", term.tables
        whole = _chain(f"{own}_whole", term, table.whole, LatticeSplat, LatticeBlur, gifts)
        links = _loads(f"{own}_links", term, {"along": table.links[0], "against": table.links[1]})
        inputs = {"image": Ref(whole[-1].name, "blurred"), **_images(links)}
        values = GradientValues(table.nodes)
        gradient = LatticeGradient(f"{own}_gradient", _extent(table.nodes), [Draw(values)], inputs, defines=DEFINES)
        slices = _loads(own, term, {"slices": table.slices})
        inputs = {**_results(gradient), **_images(slices)}
        nodes += [*whole, *links.values(), gradient, *slices.values()]
        if table.bent.level[-1]:
            turned = {**gifts, "normal": normal}
            bent = _chain(f"{own}_bent", term, table.bent, LatticeSplatBent, LatticeBlurBent, turned)
            inputs |= _results(bent[-1])
            nodes += bent
        draws.append(Draw(SliceValues(term.weight, 1 / len(terms)), inputs))
    return [*nodes, LatticeSlice(name, size, draws, {"normal": normal}, defines=DEFINES)]


def _chain(
    name: str, term: Term, chain: Chain, splat: type[Pass], blur: type[Pass], inputs: Mapping[str, Source]
) -> list[Node]:
    """Return the nodes of a splat and its four blurs, the last blur last."""
    lines = {f"lines{k}": array for k, array in enumerate(chain.lines)}
    loads = _loads(name, term, {"starts": chain.starts, "entries": chain.entries, **lines})
    tables = _images(loads)
    wired = {**inputs, "starts": tables["starts"], "entries": tables["entries"]}
    draw = Draw(SplatValues(chain.level[0], term.tables.texel_bits))
    last = splat(f"{name}_splat", _extent(chain.level[0]), [draw], wired, defines=DEFINES)
    nodes: list[Node] = [*loads.values(), last]
    weights = taps(term.tables.ratio, gradients=blur is LatticeBlur)
    for k, count in enumerate(chain.level[1:]):
        wired = dict(zip(blur.inputs, _results(last).values(), strict=False)) | {"lines": tables[f"lines{k}"]}
        draw = Draw(LatticeBlurValues(count, *weights))
        last = blur(f"{name}_blur{k}", _extent(count), [draw], wired, defines=DEFINES)
        nodes.append(last)
    return nodes


def _loads(name: str, term: Term, tables: Mapping[str, NDArray[np.float32]]) -> dict[str, Load]:
    # Tables begin at the first row, which GL has at the bottom.
    return {
        what: Load(
            f"{name}_{what}",
            f"{term.key} {name} {what}",
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
    return WIDTH, max(1, -(-count // WIDTH))


def twin(
    terms: Sequence[Term], image: NDArray[np.float64], normal: NDArray[np.float64], area: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the weighted sum of Gaussians as the passes compute it.

    Parameters
    ----------
    image : (h, w, 3), top row first
    normal : (h, w, 3) unit
    area : (h, w) mm²

    Returns
    -------
    (h, w, 4)
    """
    source = source_twin(image, area)
    total = np.zeros((*area.shape, 4))
    for term in terms:
        table = term.tables
        whole = splat_twin(table.whole, table.texel_bits, source)
        for k in range(4):
            whole = blur_twin(table.whole, k, taps(table.ratio), whole)
        bent = splat_twin(table.bent, table.texel_bits, source, normal)
        for k in range(4):
            bent = blur_twin(table.bent, k, taps(table.ratio, gradients=False), bent)
        total += slice_twin(term, gradient_twin(table, whole), bent, normal) * [1, 1, 1, 1 / len(terms)]
    return total


def source_twin(image: NDArray[np.float64], area: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (h, w, 4) irradiance times area, and area; see twin."""
    return np.concatenate([image * area[..., None], area[..., None]], axis=-1)


def splat_twin(
    chain: Chain, texel_bits: int, source: NDArray[np.float64], normal: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Return the (n, 4) sums at the nodes; with a normal (n, 16), alone and times its coordinates."""
    starts = chain.starts.ravel()[: chain.level[0] + 1].astype(np.int64)
    words = as_words(chain.entries.ravel()[: starts[-1]]).astype(np.int64)
    mask = (1 << texel_bits) - 1
    column, row = words & mask, source.shape[0] - 1 - (words >> texel_bits & mask)
    gifts = source[row, column] * (words >> 2 * texel_bits)[:, None]
    if normal is not None:
        factors = np.concatenate([np.ones((len(words), 1)), normal[row, column]], axis=1)
        gifts = (factors[:, :, None] * gifts[:, None]).reshape(-1, 16)
    node = np.repeat(np.arange(chain.level[0]), np.diff(starts))
    return np.stack([np.bincount(node, column, chain.level[0]) for column in gifts.T], axis=1)


def blur_twin(
    chain: Chain, direction: int, weights: tuple[float, float, float], sums: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the (m, c) sums after one direction, from the (n, c) before it."""
    words = as_words(chain.lines[direction].ravel()[: chain.level[direction + 1]]).astype(np.int64)
    place = words & ((1 << LINE_BITS) - 1)
    exists = words[:, None] >> LINE_BITS + np.arange(5) & 1
    middle, near, far = weights
    total = np.zeros((len(words), sums.shape[1]))
    # Nodes that exist follow each other without gaps.
    index = place[:, None] + np.cumsum(exists, axis=1) - exists - exists[:, :2].sum(axis=1, keepdims=True)
    for k, weight in enumerate((far, near, middle, near, far)):
        total += weight * exists[:, k : k + 1] * sums[np.clip(index[:, k], 0, len(sums) - 1)]
    return total


def gradient_twin(table: LatticeTables, sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (n, 4, 3): averages of the channels and their change along x, y, z per half lattice constant."""
    known = sums[:, 3:] > 0
    average = np.where(known, sums[:, :3] / np.where(known, sums[:, 3:], 1), 0)
    here = average[: table.nodes]
    result = np.zeros((table.nodes, 4, 3))
    result[:, 0] = here
    after, before = (array.reshape(-1, 4)[: table.nodes].astype(np.int64) for array in table.links)
    for k, direction in enumerate(DIRECTIONS):
        ahead, behind = after[:, k], before[:, k]
        forward = (average[ahead] - here) * known[ahead] * (2 - known[behind])
        backward = (here - average[behind]) * known[behind] * (2 - known[ahead])
        result[:, 1:] += (forward + backward)[:, None] * direction[:, None] / 8
    return result


def slice_twin(
    term: Term, averages: NDArray[np.float64], bent: NDArray[np.float64], normal: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (h, w, 4): one weighted Gaussian, and 1 where a texel has a surface."""
    slices = term.tables.slices
    rows, columns = np.nonzero(slices[..., 0])
    words = as_words(slices[rows, columns]).astype(np.int64)
    node, digits = words & ((1 << NODE_BITS) - 1), words >> NODE_BITS
    code = digits[:, 0]
    offset, weights = unpacked_place(code % BENT, digits[:, 1:] / PLACE_STEPS)
    turned = code >= BENT
    N = normal[::-1][rows, columns]
    straight = averages[node[~turned]]
    change = np.einsum("nkd,nkdc->nkc", offset[~turned], straight[:, :, 1:])
    found = np.zeros((len(words), 3))
    found[~turned] = np.einsum("nk,nkc->nc", weights[~turned], straight[:, :, 0] + 0.5 * change)
    factors = np.concatenate([np.ones((turned.sum(), 1)), N[turned]], axis=1)
    sums = np.einsum("nf,nk,nkfc->nc", factors, weights[turned], bent.reshape(-1, 4, 4)[node[turned]])
    found[turned] = sums[:, :3] / sums[:, 3:]
    result = np.zeros((*slices.shape[:2], 4))
    result[rows, columns] = np.concatenate([found * term.weight, np.ones((len(words), 1))], axis=1)
    return result[::-1]
