"""The diffusion by itself: on meshes and atlases against exact sums, and what the picture must not depend on.

The light on the texels is made here, in float64, and takes the place of the irradiance in the pipeline's own graph;
three lights share one run as red, green and blue. Two errors are told apart. Filter: what the passes make of that light
against the exact sum over the same texels. Sampling: that sum against the one over a sampling of the mesh itself that
is finer than any atlas, at the same points of the surface.
"""

from __future__ import annotations

import itertools
import math
import os
import tempfile
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import asdict, dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skincli import metrics
from skincli.bench.scene import load
from skincli.bench.timing import MEMO, Spread, free, turned
from skincli.gpu.textures import read_back
from skincli.graph.frame_graph import FrameGraph
from skincli.graph.node import Load, Pass, Ref
from skincli.graph.store import Store
from skincli.mesh import unwrap
from skincli.mesh.load import load_builtin
from skincli.mesh.model import Mesh
from skincli.mesh.subdivide import subdivided
from skincli.mesh.surface import face_areas
from skincli.mesh.texels import Texels, atlas_texels
from skincli.optics.gaussians import HUMAN
from skincli.passes.combine import LEVELS, Combine
from skincli.passes.irradiance import averaged
from skincli.passes.lattice import LatticeSlice
from skincli.passes.seen import seen_node
from skincli.passes.window import Window
from skincli.pipeline import ATLAS_GUTTER, OUTPUTS, Pipeline, frame_camera
from skincli.reference.surface_integral import Light, mesh_samples
from skincli.reference.texels import samples_of
from skincli.scene.model import ATLAS_OF_QUALITY, Render

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

#: what is measured where no scene is given
BUILTINS = ("head", "creature")

#: points of the surface at which errors are measured, and pairs of them across seams, at most
POINTS, SEAM_PAIRS = 20_000, 2000

#: of the points, every so many show how the sampling error falls
SOME = 4

#: the Gaussians that are measured each by itself: the widest ones of the human profile, mm
SINGLE = 3
SIGMAS = tuple(math.sqrt(variance) for variance in HUMAN.variances)

#: lengths over which the lights change, mm, and how the checker lies in space
CHECKER, NOISE = 9.0, 2.0
AXES = np.linalg.qr(np.array([[5.0, 2.0, 1.0], [-1.0, 4.0, 2.0], [1.0, -2.0, 6.0]]))[0]
TOWARDS = np.array([0.48, 0.36, 0.8])
LIGHTS = ("checker", "Lambert", "noise")

#: samples of the mesh over which a sum counts as converged: mm² each, or of a large mesh about so many
FINE_AREA, FINE_SAMPLES = 0.05, 6_000_000

#: places of a Gaussian in the plane where it is narrower than so many of those samples are wide
PLACES, NARROW = 128, 1.5

#: of the noise's table, which repeats beyond: cells a side
TABLE = 64

#: texels whose light is made at once
TEXELS_AT_ONCE = 1 << 17

#: what is aimed at, and what is never allowed
FILTER_AIM, FILTER_LIMIT, P99_AIM, SAMPLING_AIM, SAMPLING_NAMED = 0.01, 0.02, 0.015, 0.02, 0.01
CONSTANT_LIMIT, STEP_AIM, FLIP_AIM = 1e-5, 1.5, 0.01
TABLE_MB_AIM, BUILD_S_AIM, FRAME_MS_AIM = 64.0, 3.0, 250.0

#: constant light
CONSTANT = (0.7, 0.5, 0.3)

#: power of the texel's width with which an error has to fall to tell where it will be small
LEAST_ORDER = 0.2

#: digits of a mm to which the points of two charts agree
SAME_POINT = 6

#: pixels of one surface whose depths may differ by so much, mm
SAME_SURFACE = 2.0

#: what is diffused: the pipeline's own nodes; the light takes the place of what the lamp would give
SCENE = """
scene: 1
mesh: {builtin: head}  # stands in for the mesh that is measured
skin: {optics: {profile: human}, surface: {bumpiness: 0}}
lights: [{type: directional, direction: [-0.5, -0.3, -1], irradiance: [1, 1, 1]}]
render: {size: [640, 480], supersample: 1, diffusion: {terms: 6}}
"""

#: the picture that must not depend on atlas and triangles, and what changes in it
PICTURE = """
scene: 1
mesh: {builtin: head}  # stands in for the mesh that is measured
skin: human
lights:
  - {type: directional, direction: [-0.5, -0.3, -1], irradiance: [2.5, 2.4, 2.3]}
  - {type: directional, direction: [1, 0.2, -0.3], irradiance: [0.6, 0.7, 0.9]}
render: {size: [640, 480]}
"""
PICTURE_SETS = ("skin.size=1024",)


# -- lights ----------------------------------------------------------------------------------------------------------


def lights(positions: Floats, normals: Floats, width: Floats | float = 0.0) -> Floats:
    """Return the three lights, (n, 3): Lambert's law times a checker, Lambert's law, noise.

    Parameters
    ----------
    positions, normals : (n, 3) mm and unit
    width : mm, (n,) or scalar: over which the checker's edges are averaged, for a point that stands for a piece
    """
    return _lit(positions, normals, width)[1]


def _lit(positions: Floats, normals: Floats, width: Floats | float = 0.0) -> tuple[Floats, Floats]:
    """Return the lights on surfaces that face them, and `lights`."""
    lambert = np.maximum(normals @ TOWARDS, 0.0)
    at = positions @ (AXES / CHECKER)
    cell = np.floor(at)
    at -= cell
    # Half of a piece as wide as the distance from the edge lies beyond it.
    slant = np.sqrt(np.maximum(1 - (normals @ AXES) ** 2, 0)) * (np.reshape(width, (-1, 1)) / 2)
    inside = np.clip(CHECKER * np.minimum(at, 1 - at) / np.maximum(slant, 1e-9), 0, 1)
    sign = np.prod(inside, axis=1) * (1 - 2 * (cell.sum(axis=1) % 2))
    one = np.ones_like(lambert)
    arriving = np.stack([(1 + sign) / 2, one, _noise(positions)], axis=1)
    return arriving, np.stack([lambert, lambert, one], axis=1) * arriving


@cache
def _table() -> Floats:
    return np.random.default_rng(7).random(TABLE**3)


def _noise(positions: Floats) -> Floats:
    """Return random values, 0 to 1, on the corners of cells of NOISE mm, linear between them."""
    at = positions.T / NOISE
    cell = np.floor(at)
    at -= cell
    here = cell.astype(np.int32) % TABLE
    strides = np.array([[TABLE**2], [TABLE], [1]], dtype=np.int32)
    places = here * strides, (here + 1) % TABLE * strides
    shares = 1 - at, at
    total = np.zeros(at.shape[1])
    for i, j, k in np.ndindex(2, 2, 2):
        value = _table()[places[i][0] + places[j][1] + places[k][2]]
        total += value * shares[i][0] * shares[j][1] * shares[k][2]
    return total


def light_of_texels(texels: Texels, size: int) -> Floats:
    """Return the lights on an atlas, (n, 3), averaged over each texel as the irradiance pass does.

    Parameters
    ----------
    texels : with the gutter
    size : texels a side
    """
    samples = Render().irradiance_samples

    def part(first: int) -> Floats:
        rows = slice(first, first + TEXELS_AT_ONCE)
        return averaged(_lit, texels.index, size, texels.positions, texels.normals, samples, rows)

    return _in_parts(part, len(texels.index))


def _in_parts(part: Callable[[int], Floats], count: int) -> Floats:
    """Return the rows that `part` gives from each multiple of TEXELS_AT_ONCE on, made side by side."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return np.concatenate(list(pool.map(part, range(0, count, TEXELS_AT_ONCE))))


class Converged:
    """The lights on a mesh, sampled more finely than an atlas does.

    Parameters
    ----------
    mesh : in mm
    """

    def __init__(self, mesh: Mesh) -> None:
        area = max(FINE_AREA, float(face_areas(mesh).sum()) / FINE_SAMPLES)
        samples = mesh_samples(mesh, area)
        width = np.sqrt(samples.areas)

        def part(first: int) -> Floats:
            rows = slice(first, first + TEXELS_AT_ONCE)
            return lights(samples.positions[rows], samples.normals[rows], width[rows])

        self._light = Light(samples, _in_parts(part, len(width)))
        self._narrow = NARROW * float(np.sqrt(np.mean(samples.areas)))

    def diffused(self, positions: Floats, normals: Floats, sigma: float) -> Floats:
        """Return one Gaussian of the lights at points of the surface, (n, 3)."""
        if sigma > self._narrow:
            return self._light.diffused(positions, normals, sigma)
        # So near a point the surface is its tangent plane.
        across = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        along = np.cross(across, normals)
        total = np.zeros((len(positions), 3))
        for place in range(PLACES):
            away = sigma * math.sqrt(-2 * math.log(1 - (place + 0.5) / PLACES))
            turn = place * math.pi * (3 - math.sqrt(5))
            there = positions + away * (math.cos(turn) * across + math.sin(turn) * along)
            total += lights(there, normals, 3 * sigma / math.sqrt(PLACES))
        return total / PLACES


# -- seams -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Seams:
    """Edges of the surface at which two charts of the atlas meet.

    Parameters
    ----------
    ends : (k, 2, 3) mm
    uv : (2, k, 2, 2) of both ends, in the one chart and in the other
    inner : (2, k, 2) uv of the middle of the face on each side
    """

    ends: Floats
    uv: Floats
    inner: Floats

    @classmethod
    def of(cls, mesh: Mesh) -> Seams:
        """Find the seams of a mesh: edges that two faces share, but not their atlas uv."""
        _, point = np.unique(mesh.positions.round(SAME_POINT) + 0.0, axis=0, return_inverse=True)
        point = point.ravel().astype(np.int64)
        begin, end = mesh.faces.T.ravel(), np.roll(mesh.faces, -1, axis=1).T.ravel()
        face = np.tile(np.arange(len(mesh.faces)), 3)
        low, high = np.minimum(point[begin], point[end]), np.maximum(point[begin], point[end])
        _, inverse, uses = np.unique(low * len(point) + high, return_inverse=True, return_counts=True)
        order = np.argsort(inverse, kind="stable")
        order = order[uses[inverse[order]] == 2].reshape(-1, 2)
        one, other = order.T
        # The faces run along their edge in opposite directions.
        facing = point[begin[one]] == point[end[other]]
        one, other = one[facing], other[facing]
        uv = mesh.atlas_uv
        there = uv[np.stack([begin[one], end[one]], axis=1)], uv[np.stack([end[other], begin[other]], axis=1)]
        apart = (there[0] != there[1]).any(axis=(1, 2))
        inner = [uv[mesh.faces[face[side[apart]]]].mean(axis=1) for side in (one, other)]
        ends = mesh.positions[np.stack([begin[one], end[one]], axis=1)[apart]]
        return cls(ends, np.stack([half[apart] for half in there]), np.stack(inner))

    def pairs(self, texels: Texels, size: int, most: int) -> Indices:
        """Return pairs of texels that lie beside each other across a seam, (m, 2), as places in `texels`."""
        own = np.full(size * size, -1, dtype=np.int64)
        gives = texels.areas > 0
        own[texels.index[gives]] = np.flatnonzero(gives)
        step = max(1, len(self.ends) // most)
        middle = self.uv[:, ::step].mean(axis=2) * size
        inwards = self.inner[:, ::step] * size - middle
        inwards /= np.maximum(np.linalg.norm(inwards, axis=2, keepdims=True), 1e-12)
        column, row = np.clip(np.floor(middle + 0.75 * inwards), 0, size - 1).astype(np.int64).transpose(2, 0, 1)
        found = own[row * size + column]
        point = self.ends[::step].mean(axis=1)
        near = np.linalg.norm(texels.positions[found] - point, axis=2) < 3 * np.sqrt(texels.areas[found])
        return found[:, (near & (found >= 0)).all(axis=0)].T

    def steps(self, pipeline: Pipeline, depth: Floats, picture: Floats) -> tuple[Floats, Floats]:
        """Return the steps between neighboring pixels, (m, c) each: across a seam, and the mean of both beside it.

        Parameters
        ----------
        depth : (h, w) mm along the view axis, 0 where there is nothing
        picture : (h, w, c)
        """
        view, (height, width) = pipeline.view, depth.shape
        axes = np.array([view.right, view.up, view.forward])
        seen = (self.ends - np.array(view.eye)) @ axes.T
        scale = np.array([width / 2 / view.tan_half[0], -height / 2 / view.tan_half[1]])
        screen = seen[..., :2] / seen[..., 2:] * scale + np.array([width / 2, height / 2])
        length = np.linalg.norm(screen[:, 1] - screen[:, 0], axis=1)
        count = np.maximum(np.ceil(2 * length), 1).astype(np.int64)
        edge = np.repeat(np.arange(len(count)), count)
        share = (np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[edge]
        start, stop = screen[edge].transpose(1, 0, 2)
        at = start + share[:, None] * (stop - start)
        z = 1 / ((1 - share) / seen[edge, 0, 2] + share / seen[edge, 1, 2])
        along = stop - start
        across = np.abs(along[:, 1]) < np.abs(along[:, 0])  # whether one crosses it up and down
        corner = np.floor(at - np.where(across[:, None], [0, 0.5], [0.5, 0])).astype(np.int64)
        places = [corner + k * np.where(across[:, None], [0, 1], [1, 0]) for k in (-1, 0, 1, 2)]
        places = [np.clip(place, 0, [width - 1, height - 1]) for place in places]
        depths = np.stack([depth[y, x] for x, y in (place.T for place in places)])
        visible = (depths > 0).all(axis=0) & (np.abs(depths - z) < SAME_SURFACE).all(axis=0)
        key = (corner @ np.array([2, 2 * width])) + across
        chosen = np.unique(key[visible], return_index=True)[1]
        row = [picture[y, x][visible][chosen] for x, y in (place.T for place in places)]
        before, here, after = (np.abs(b - a) for a, b in itertools.pairwise(row))
        return here, (before + after) / 2


# -- one mesh in one atlas -------------------------------------------------------------------------------------------


class Surface:
    """A mesh whose light is diffused by the pipeline's own nodes, and by exact sums.

    Parameters
    ----------
    mesh : with one of its atlases
    size : texels a side of the atlas
    """

    def __init__(self, mesh: Mesh, size: int) -> None:
        self.mesh, self.size = mesh, size
        with tempfile.TemporaryDirectory() as folder:
            loaded = load(Path(folder), SCENE, f"render.atlas={size}")
        start = time.perf_counter()
        # Nothing is taken from the disk, so that this is the time of all tables.
        self.pipeline = Pipeline(loaded, mesh, skip=False)
        self.build_s = time.perf_counter() - start
        nodes = dict(self.pipeline.graph.nodes)
        nodes["given"] = Load("given", "nothing yet", lambda: [np.zeros((1, 1, 4))])
        incoming = copy(nodes["incoming"])
        assert isinstance(incoming, Pass)
        incoming.wired = {**incoming.wired, "image": Ref("given", "image")}
        nodes["incoming"] = incoming
        combine = nodes["diffused"]
        assert isinstance(combine, Pass)
        #: what the widest Gaussians give, narrowest first
        self.terms = [term for name in LEVELS if isinstance(term := combine.wired.get(name), Ref)][-SINGLE:]
        slices = [nodes[term.node] for term in self.terms]
        #: bytes of their tables
        self.nbytes = sum(
            term.tables.nbytes for node in slices if isinstance(node, LatticeSlice) for term in node.terms
        )
        self._graph = FrameGraph(nodes.values(), Store(MEMO))
        # The same for a picture, which reads a part of the atlas.
        read = seen_node(self.pipeline.atlas_size, self.pipeline.size, Ref("view", "depth"), Ref("view", "uv"))
        part = {
            name: node.over(Ref(read.name, "seen"))
            for name, node in nodes.items()
            if isinstance(node, Window | LatticeSlice | Combine)
        }
        self._rewired = set(part)
        self._picture = FrameGraph({**nodes, **part, read.name: read}.values(), self._graph.store)
        self._images = {name: self._read(Ref("atlas", name))[0] for name in ("position", "frame_n", "metric")}
        covered = self._images["position"][..., 3] > 0
        self._row, self._column = np.nonzero(covered[::-1])
        index = self._row * size + self._column
        position, normal, area = (self.at(image) for image in self._images.values())
        #: as the GPU has them, the gutter included
        self.texels = Texels(index, position[:, :3], normal[:, :3], np.where(area[:, 0] > 0, area[:, 0], 0.0))
        self._images.clear()
        self._given = 0
        #: ms of the single Gaussians' nodes in a picture
        self.frames: list[float] = []

    def at(self, image: NDArray[np.floating]) -> Floats:
        """Return the texels of an image, top row first, in their order."""
        return image[::-1][self._row, self._column].astype(np.float64)

    def _read(self, *refs: Ref) -> list[NDArray[np.float32]]:
        found = self._graph.run(refs)
        return [read_back(found[ref]) for ref in refs]

    def give(self, light: Floats) -> None:
        """Put (n, 3) light on the texels."""
        image = np.zeros((self.size, self.size, 4), dtype=np.float32)
        self._light = light
        image[self._row, self._column] = np.concatenate([light, np.ones((len(light), 1))], axis=1)
        self._given += 1
        load = Load("given", f"given {self._given}", partial(list, [image[::-1]]))
        for graph in (self._graph, self._picture):
            graph.update([load])

    def diffused(self, wanted: Indices) -> list[Floats]:
        """Return what the single Gaussians and the profile make of the light at some texels, (n, 3) each."""
        refs = [*self.terms, Ref("diffused", "blurred")]
        found = [self.at(image)[wanted] for image in self._read(*refs)]
        # Where a Gaussian finds no light, what lies there stays, as in the sum.
        shares = [np.where(value[:, 3:] > 0, value[:, 3:], 1) for value in found]
        return [
            np.where(value[:, 3:] > 0, value[:, :3] / share, self._light[wanted])
            for value, share in zip(found, shares, strict=True)
        ]

    def constant_change(self) -> float:
        """Return the greatest relative change of constant light, of any Gaussian and the profile, at any texel."""
        self.give(np.broadcast_to(CONSTANT, self.texels.positions.shape))
        everywhere = np.flatnonzero(self.texels.areas > 0)
        return max(float(np.abs(found / np.array(CONSTANT) - 1).max()) for found in self.diffused(everywhere))

    def seen_steps(self, seams: Seams) -> tuple[Floats, Floats]:
        """Return the steps at the seams in the picture from the front and from behind, see `Seams.steps`."""
        camera = frame_camera(self.mesh, self.pipeline.size)
        names = (*(term.node for term in self.terms), "blocks", "seen")
        targets = OUTPUTS["depth"].source, OUTPUTS["diffuse"].source
        found = []
        for degrees in (0.0, 180.0):
            self.pipeline.look_from(turned(camera, degrees))
            # What reads the light here or is read in part does not depend on the camera's values.
            own = {"incoming", *self._rewired}
            self._picture.update(node for name, node in self.pipeline.graph.nodes.items() if name not in own)
            drawn = self._picture.run(targets, timing=True)
            depth, picture = (read_back(drawn[target]).astype(np.float64) for target in targets)
            found.append(seams.steps(self.pipeline, depth[..., 0], picture[..., :3]))
            if degrees == 0:
                times = (report.ms for report in self._picture.reports if report.name.startswith(names))
                self.frames.append(sum(ms for ms in times if ms is not None))
        (front, front_beside), (behind, behind_beside) = found
        return np.concatenate([front, behind]), np.concatenate([front_beside, behind_beside])

    def close(self) -> None:
        """Free what the GPU holds."""
        free(self._graph.store)


# -- what is found ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Row:
    """Errors of one kernel under one light.

    Parameters
    ----------
    mesh, layout, light, kernel : what was measured; the kernel is a Gaussian of so many mm or the human profile
    filter : relative RMSE of the passes against the exact sum over the same texels
    p99, maximum : of that error's absolute value, as shares of the signal's RMS
    seam : RMS of that error's difference across a seam, likewise; None without seams
    sampling : relative RMSE of the exact sum over the texels against the converged one
    halved : the same of an atlas of half the side, over some of the points
    named : texels a side at which `sampling` is SAMPLING_NAMED, by the power law of both; None where there is none
    """

    mesh: str
    layout: str
    light: str
    kernel: str
    filter: float
    p99: float
    maximum: float
    seam: float | None
    sampling: float
    halved: float
    named: int | None

    @property
    def misses(self) -> list[str]:
        """Return which of the aims it misses."""
        aims = {"filter": FILTER_AIM, "p99": P99_AIM, "sampling": SAMPLING_AIM}
        return [name for name, aim in aims.items() if not getattr(self, name) <= aim]


@dataclass(frozen=True)
class Layout:
    """What holds for one mesh in one atlas.

    Parameters
    ----------
    atlas, texel_mm : texels a side, and the mean width of one
    constant : greatest relative change of constant light, of all Gaussians at all texels
    table_mb : of the single Gaussians
    build_s : time until the tables of the whole profile are made
    frame : ms of the nodes of the single Gaussians in a picture from the front
    steps : by light, the mean step between pixels across a seam over that beside it; None where no seam is seen
    seam_pixels : on which that rests
    """

    mesh: str
    layout: str
    triangles: int
    atlas: int
    texel_mm: float
    constant: float
    table_mb: float
    build_s: float
    frame: Spread
    steps: Mapping[str, float | None]
    seam_pixels: int

    @property
    def misses(self) -> list[str]:
        """Return which of the aims it misses."""
        steps = [step for step in self.steps.values() if step is not None]
        found = {
            "constant": self.constant <= CONSTANT_LIMIT,
            "seams": all(step <= STEP_AIM for step in steps),
            "tables": self.table_mb <= TABLE_MB_AIM,
            "build": self.build_s <= BUILD_S_AIM,
            "frame": self.frame.median <= FRAME_MS_AIM,
        }
        return [name for name, holds in found.items() if not holds]


@dataclass
class Found:
    """All that was found.

    Parameters
    ----------
    rows, layouts : see there
    pictures : mesh, what was changed, mean FLIP inside the silhouette
    """

    rows: list[Row] = field(default_factory=list)
    layouts: list[Layout] = field(default_factory=list)
    pictures: list[dict[str, Any]] = field(default_factory=list)

    def entry(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            "points": POINTS,
            "rows": [{**asdict(row), "misses": row.misses} for row in self.rows],
            "layouts": [{**asdict(one), "misses": one.misses} for one in self.layouts],
            "pictures": self.pictures,
        }

    @property
    def faults(self) -> list[str]:
        """Sentences about what is never allowed."""
        found = [
            f"{row.mesh}, {row.layout}, {row.light}, {row.kernel}: the diffusion is {row.filter:.3g} off the exact sum "
            f"over the same texels (relative RMSE); at most {FILTER_LIMIT:g} is allowed; compare the passes lattice "
            "and window with their twins"
            for row in self.rows
            if not row.filter <= FILTER_LIMIT
        ]
        found += [
            f"{one.mesh}, {one.layout}: constant light changes by {one.constant:.3g}; at most {CONSTANT_LIMIT:g} is "
            "allowed; look for table entries that name the wrong node"
            for one in self.layouts
            if not one.constant <= CONSTANT_LIMIT
        ]
        return found


def run(meshes: Mapping[str, Mesh], size: int | None = None, full: bool = False) -> Found:
    """Measure meshes, each in its own atlas and in another one.

    Parameters
    ----------
    meshes : by name
    size : texels a side of the atlas; left out, that of the quality standard
    full : hold the picture of a coarse atlas against that of the finest, not of the standard one
    """
    found = Found()
    size = size or ATLAS_OF_QUALITY["standard"]
    for name, mesh in meshes.items():
        other = unwrapped(mesh)
        converged = Converged(mesh)
        for layout, one in (("own", mesh), ("other", other)):
            rows, about = measure(name, layout, one, size, converged)
            found.rows += rows
            found.layouts.append(about)
        del converged
        found.pictures += pictures(name, mesh, other, size, full)
    return found


def builtins() -> dict[str, Mesh]:
    """Return the meshes that are measured where no scene is given."""
    return {name: load_builtin(name, None) for name in BUILTINS}


# -- the errors ------------------------------------------------------------------------------------------------------


def measure(name: str, layout: str, mesh: Mesh, size: int, converged: Converged) -> tuple[list[Row], Layout]:
    """Measure a mesh in one of its atlases.

    Parameters
    ----------
    name, layout : for the report
    size : texels a side
    converged : the lights on that mesh
    """
    surface, seams = Surface(mesh, size), Seams.of(mesh)
    texels = surface.texels
    light = light_of_texels(texels, size)
    points, pairs = _spread(texels), seams.pairs(texels, size, SEAM_PAIRS)
    chosen = np.concatenate([points, *pairs.T])
    constant = surface.constant_change()
    passed = Passed.of(surface, light, chosen, seams)
    frame, table_mb = Spread.of(surface.frames), surface.nbytes / 1e6
    surface.close()

    at, count = (texels.positions[chosen], texels.normals[chosen]), len(points)
    exact = _sums(Light(samples_of(texels), light[texels.areas > 0]).diffused, *at)
    smaller = atlas_texels(mesh, size // 2, ATLAS_GUTTER)
    rough = light_of_texels(smaller, size // 2)[smaller.areas > 0]
    truth = _sums(converged.diffused, *(array[:count] for array in at))
    # That the error falls is told by some of the points.
    some = slice(0, count, SOME)
    halved = _sums(Light(samples_of(smaller), rough).diffused, *(array[some] for array in at))

    profile = np.array(HUMAN.weights) / HUMAN.total()
    rows = []
    for number, lit in enumerate(LIGHTS):
        kernels = [("human", passed.human[number], profile)]
        for k in range(SINGLE):
            which = k - SINGLE
            alone = np.eye(len(SIGMAS))[:, which, None]
            kernels.insert(k, (f"{SIGMAS[which]:.2f} mm", passed.single[k][:, number, None], alone))
        for kernel, found, shares in kernels:
            wanted, coarse, fine = (
                np.einsum("kn,kc->nc", sums[..., number], shares) for sums in (exact, halved, truth)
            )
            scale = float(np.sqrt(np.mean(wanted[:count] ** 2)))
            here, error = (found[:count], wanted[:count]), found - wanted
            apart = error[count : count + len(pairs)] - error[count + len(pairs) :]
            sampling, same, half = (
                metrics.relative_rmse(*pair)
                for pair in ((wanted[:count], fine), (wanted[some], fine[some]), (coarse, fine[some]))
            )
            rows.append(
                Row(
                    name, layout, lit, kernel, metrics.relative_rmse(*here),
                    metrics.p99(*here) / scale, metrics.max_abs(*here) / scale,
                    float(np.sqrt(np.mean(apart**2))) / scale if len(pairs) else None,
                    sampling, half, _named(size, sampling, half / same if same else 0.0),
                )
            )  # fmt: skip
    texel = float(np.sqrt(texels.areas[texels.areas > 0].mean()))
    about = Layout(
        name, layout, len(mesh.faces), size, texel, constant, table_mb, round(surface.build_s, 2), frame,
        dict(zip(LIGHTS, passed.steps, strict=True)), passed.seam_pixels,
    )  # fmt: skip
    return rows, about


@dataclass(frozen=True)
class Passed:
    """What the passes make of the lights.

    Parameters
    ----------
    single : (SINGLE, n, lights), by Gaussian
    human : (lights, n, 3), each light in all channels
    steps : by light, see `Layout`
    seam_pixels : on which they rest
    """

    single: Floats
    human: Floats
    steps: list[float | None]
    seam_pixels: int

    @classmethod
    def of(cls, surface: Surface, light: Floats, chosen: Indices, seams: Seams) -> Passed:
        """Run the passes: every light is in every channel once."""
        count = len(LIGHTS)
        single: list[Floats] = []
        human, steps = np.zeros((count, len(chosen), 3)), np.zeros((2, count))
        for turn in range(count):
            order = np.roll(np.arange(count), -turn)
            surface.give(light[:, order])
            # The picture goes first: the clock must find what both share undone.
            seen = surface.seen_steps(seams)
            steps[:, order] += [part.sum(axis=0) for part in seen]
            *terms, whole = surface.diffused(chosen)
            single = single or terms
            human[order, :, range(3)] = whole.T
        ratios = [float(across / beside) if beside > 0 else None for across, beside in steps.T]
        return cls(np.stack(single), human, ratios, len(seen[0]))


def _sums(diffused: Callable[[Floats, Floats, float], Floats], positions: Floats, normals: Floats) -> Floats:
    """Return all Gaussians of the human profile, (k, n, lights)."""
    return np.stack([diffused(positions, normals, sigma) for sigma in SIGMAS])


def _named(size: int, sampling: float, growth: float) -> int | None:
    """Return the texels a side at which the sampling error is SAMPLING_NAMED; it grows so with texels twice as wide."""
    order = math.log2(growth) if growth > 1 else 0.0
    return math.ceil(size * (sampling / SAMPLING_NAMED) ** (1 / order)) if order > LEAST_ORDER else None


def _spread(texels: Texels) -> Indices:
    """Return at least POINTS texels, or all, spread evenly over the surface."""
    gives = np.flatnonzero(texels.areas > 0)
    place = np.cumsum(texels.areas[gives])
    count = POINTS
    while len(gives) > POINTS:
        # A texel wider than the distance of two points is met twice.
        found = np.unique(np.searchsorted(place, (np.arange(count) + 0.5) / count * place[-1]))
        if len(found) >= POINTS:
            return gives[found]
        count += count // 4
    return gives


def unwrapped(mesh: Mesh) -> Mesh:
    """Return a mesh in another atlas, made by xatlas."""
    source, faces, atlas_uv = unwrap.atlas(mesh.positions, mesh.normals, mesh.faces)
    return replace(
        mesh,
        positions=mesh.positions[source],
        normals=mesh.normals[source],
        uv=mesh.uv[source],
        atlas_uv=atlas_uv,
        faces=faces.astype(np.int32),
        uv_is_unique=False,
    )


# -- what a picture must not depend on -------------------------------------------------------------------------------


def pictures(name: str, mesh: Mesh, other: Mesh, size: int, full: bool) -> list[dict[str, Any]]:
    """Return the mean FLIP between pictures of a mesh that ought to be alike.

    Parameters
    ----------
    other : the same in another atlas
    size : texels a side of the usual atlas
    full : hold the coarse atlas against the finest
    """
    store = Store(MEMO)

    def rendered(of: Mesh, atlas: int) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        with tempfile.TemporaryDirectory() as folder:
            loaded = load(Path(folder), PICTURE, *PICTURE_SETS, f"render.atlas={atlas}")
        found = Pipeline(loaded, of, store).run(["depth"], display=True)
        return found["display"][..., :3] * found["display"][..., 3:], found["depth"][..., 0] > 0

    usual, inside = rendered(mesh, size)
    fine = max(ATLAS_OF_QUALITY.values()) if full else size
    pairs = {
        "another atlas_uv": (rendered(other, size)[0], usual),
        f"atlas {size // 2} for {fine}": (rendered(mesh, size // 2)[0], rendered(mesh, fine)[0] if full else usual),
        "subdivided": (rendered(subdivided(mesh), size)[0], usual),
    }
    free(store)
    return [
        {"mesh": name, "changed": changed, "flip": metrics.flip(*pair, inside)[0]} for changed, pair in pairs.items()
    ]
