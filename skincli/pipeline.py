"""From a scene to its frame graph: the passes in the order in which the light travels. The file to open first."""

from __future__ import annotations

import hashlib
import logging
import math
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property, partial
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skincli import diskcache, images
from skincli.color import srgb_decode
from skincli.errors import Fault, InputError, LimitError, did_you_mean
from skincli.files import file_digest
from skincli.gpu.blocks import Values
from skincli.gpu.context import device_info, get_context
from skincli.gpu.geometry import Geometry
from skincli.gpu.textures import FORMATS, beyond_memory, read_back
from skincli.graph.frame_graph import FrameGraph, NodeReport
from skincli.graph.node import ONE, ZERO, Constant, Draw, Load, Node, Pass, Ref, Source, module_digest
from skincli.graph.store import Store
from skincli.layers.base import Texture
from skincli.mesh import bits, lattice, windows, words
from skincli.mesh.bake import bake
from skincli.mesh.load import load_builtin, load_mesh
from skincli.mesh.model import Material, Mesh, Urgent
from skincli.mesh.surface import face_areas, texel_size
from skincli.mesh.texels import Texels, atlas_texels
from skincli.mesh.udim import require_one_tile
from skincli.optics.gaussians import GaussianSum, fit
from skincli.optics.levels import MAX_SPREAD, SPREAD_STEPS, edge_error, levels, spread_weights
from skincli.passes import blur, irradiance, occlusion_band, reflection, resolve
from skincli.passes.absorb import WAYS_IN, Absorb, AbsorbValues
from skincli.passes.atlas import Atlas, AtlasValues
from skincli.passes.camera import View3D, look_at
from skincli.passes.combine import combine_node
from skincli.passes.compose import Compose, ComposeValues
from skincli.passes.display import Display, DisplayValues
from skincli.passes.irradiance import Irradiance, IrradianceValues, LightValues
from skincli.passes.lattice import Term, lattice_nodes
from skincli.passes.maps import Maps, MapSource
from skincli.passes.near import cubes, near_nodes
from skincli.passes.occlusion import Occlusion, OcclusionValues
from skincli.passes.occlusion_band import BandValues, OcclusionBand
from skincli.passes.reflection import Reflection, ReflectionValues
from skincli.passes.resolve import Resolve, ResolveValues
from skincli.passes.screen_diffusion import Arriving, ArrivingValues, screen_nodes, screen_values
from skincli.passes.seen import seen_node, tile_defines
from skincli.passes.site import Site, SiteValues
from skincli.passes.slope import Slope, SlopeValues
from skincli.passes.specular import Specular, SpecularValues
from skincli.passes.splat_diffusion import LEAST_SPACING, quads, spacing, splat_nodes, splat_values
from skincli.passes.stretched_blur import chained
from skincli.passes.view import View, ViewValues
from skincli.passes.window import LEAST_SAMPLES, WindowSource, block_node, window_factor, window_nodes
from skincli.scene.model import Camera, Light
from skincli.scene.paths import LoadedScene, LoadedSkin
from skincli.scene.skin import Optics, Skin, Surface

#: texels by which charts are continued beyond their border: in the maps, and in the atlas of `physical`
MAP_GUTTER = 4
ATLAS_GUTTER = 2

#: mm: narrower Gaussians take more nodes of the surface lattice than they are worth; and how many of their variances a
#: surface may measure before they take more than tables can name
LEAST_LATTICE, MOST_SPOTS = 0.75, 750_000

#: standard deviations from which the passes bring light to what the picture sees, all told: nodes of the lattice and
#: their gradients lie within three, its blurs reach six, and windows as far as matters in float32
REACH = 9.0

_log = logging.getLogger("skincli")

#: widest panorama that is kept, pixels
MAX_PANORAMA = 4096

#: bytes that a texel of a skin's maps takes: site (32), albedo, height, reflectance, tilt and slope with mip levels
MAP_BYTES = 80


@dataclass(frozen=True)
class OutputKind:
    """What is said of an output: where it comes from and how it is filed.

    Parameters
    ----------
    source : node and output
    room : "view" for picture size, "atlas" for texture space
    channels : how many of the four are meant
    color : whether it is light or color, which the display transform and half floats suit; data otherwise
    doc : a sentence
    """

    source: Ref
    room: str
    channels: int
    color: bool
    doc: str


def _resolved(name: str) -> Ref:
    return Ref(f"{name}_picture", "resolved")


OUTPUTS: Mapping[str, OutputKind] = {
    "beauty": OutputKind(_resolved("beauty"), "view", 4, True, "the picture, scene-linear"),
    "diffuse": OutputKind(_resolved("diffuse"), "view", 3, True, "light that left the skin, before albedo"),
    "albedo": OutputKind(_resolved("albedo"), "view", 3, True, "surface color"),
    "specular": OutputKind(_resolved("specular"), "view", 3, True, "highlights"),
    "reflection": OutputKind(_resolved("reflection"), "view", 3, True, "mirrored environment"),
    "occlusion": OutputKind(_resolved("occlusion"), "view", 1, False, "Equation 1, 1 is open"),
    "occlusion_high": OutputKind(_resolved("occlusion_high"), "view", 1, False, "fine band"),
    "occlusion_low": OutputKind(_resolved("occlusion_low"), "view", 1, False, "coarse band"),
    "normal": OutputKind(_resolved("normal"), "view", 3, False, "bumped normal in the scene's axes"),
    "depth": OutputKind(_resolved("depth"), "view", 1, False, "mm along the view axis, 0 is background"),
    "uv": OutputKind(_resolved("uv"), "view", 2, False, "authored texture coordinates"),
    "atlas_position": OutputKind(Ref("atlas", "position"), "atlas", 3, False, "mm relative to the mesh's center"),
    "atlas_normal": OutputKind(Ref("atlas", "normal"), "atlas", 3, False, "bumped normal in the scene's axes"),
    "irradiance": OutputKind(Ref("irradiance", "irradiance"), "atlas", 3, True, "light that reaches the surface"),
    "diffused": OutputKind(Ref("diffused", "blurred"), "atlas", 3, True, "the same after diffusion"),
}

#: the outputs that need light to be diffused: its tables are not made where nobody asks for one of them
DIFFUSED = frozenset({"beauty", "diffuse", "diffused"})

#: the picture as a display shows it; PNG files are made of it
DISPLAYED = Ref("display", "displayed")


#: exact diffusion of the light on texels: all of them, their irradiance, which receive, variances, weights and, where
#: the skin's layers write it, the scattering radius over that of the optics
Exact = Callable[
    [
        Texels,
        NDArray[np.float64],
        NDArray[np.bool_],
        Sequence[float],
        Sequence[Sequence[float]],
        NDArray[np.float64] | None,
    ],
    NDArray[np.float64],
]


@dataclass(frozen=True)
class Look:
    """A skin as the passes need it: resolved numbers and the maps' description.

    Parameters
    ----------
    surface, optics : as written; None optics scatter nothing
    skin : the layers, or None where a material of the mesh file stands in
    material : of the mesh file
    """

    surface: Surface
    optics: Optics | None
    skin: Skin | None
    material: Material | None = None


def load_scene_mesh(loaded: LoadedScene, use_cache: bool = True) -> Mesh:
    """Return the mesh a scene names, and tell (-v) what had to be made good in it.

    Raises
    ------
    InputError : the mesh is broken, there is no such built-in one, or `parts` names a part that it does not have
    LimitError : it is too large
    """
    source = loaded.scene.mesh
    if source.builtin is not None:
        detail = None if source.detail is None else _count_text(source.detail)
        try:
            mesh = load_builtin(source.builtin, detail, use_cache=use_cache)
        except InputError as error:
            raise InputError(loaded.fault("mesh", fault.message) for fault in error.faults) from None
    else:
        assert source.file is not None
        written = loaded.document.node(("mesh", "file"))
        name = source.file.name if written is None else str(written.value)
        mesh = load_mesh(source.file, source.mm_per_unit, display_path=name, roots=loaded.roots, use_cache=use_cache)
        tell_notes(mesh, name)
    known = [part.name for part in mesh.parts]
    unknown = [name for name in loaded.scene.parts if name not in known]
    if unknown:
        raise InputError(
            Fault(
                f"the mesh has no part '{name}'{did_you_mean(name, known) or '.'} It has: {', '.join(known)}",
                *loaded.document.mark(("parts", name), key=True),
            )
            for name in unknown
        )
    return mesh


def tell_notes(mesh: Mesh, name: str) -> None:
    """Log what had to be made good in a mesh file; only what asks the person to do something is a warning."""
    for note in mesh.notes:
        _log.log(logging.WARNING if isinstance(note, Urgent) else logging.INFO, "%s: %s", name, note)


def _count_text(count: int) -> str:
    """Return 259000 as it is written in YAML, 259k."""
    return f"{count // 1000}k" if count % 1000 == 0 else str(count)


def keeps_apart(mesh: Mesh) -> bool:
    """Tell whether each part of a mesh wears maps of its own, even where parts share a skin: their uv overlap."""
    return not mesh.uv_is_unique and len(mesh.parts) <= irradiance.MAX_SLOTS


def looks_of(loaded: LoadedScene, mesh: Mesh) -> tuple[list[Look], list[int]]:
    """Return the distinct looks of a mesh and, per part, the index of its own.

    Parts that share a skin share its maps, unless the authored uv overlap: then each part has maps of its own, so that
    eyes and skin that both fill the unit square do not draw over each other.
    """
    looks: list[Look] = []
    index = []
    apart = keeps_apart(mesh)
    for part in mesh.parts:
        # A part that is named without a skin keeps the mesh file's material.
        found = loaded.skins.get(part.name if part.name in loaded.scene.parts else "")
        if found is not None:
            look = Look(found.skin.surface, found.skin.optics, found.skin)
        else:
            plain = Surface(bumpiness=0.0, reflectance=0.0)
            look = Look(plain, None, None, part.material or Material())
        same = None if apart else next((i for i, other in enumerate(looks) if _same(other, look)), None)
        if same is None:
            looks.append(look)
            same = len(looks) - 1
        index.append(same)
    if len(looks) > irradiance.MAX_SLOTS:
        raise LimitError(f"the mesh carries {len(looks)} different skins; at most {irradiance.MAX_SLOTS} are allowed")
    return looks, index


def wearers(loaded: LoadedScene, mesh: Mesh) -> list[tuple[str, LoadedSkin, tuple[int, ...]]]:
    """Return the skins of a scene that are made of layers: a name, the skin, and the parts that wear it."""
    looks, index = looks_of(loaded, mesh)
    found = []
    for number, look in enumerate(looks):
        if look.skin is None:
            continue
        parts = tuple(part for part, own in enumerate(index) if own == number)
        first = mesh.parts[parts[0]].name
        worn = loaded.skins[first if first in loaded.scene.parts else ""]
        found.append((first, worn, parts))
    return found


def _same(one: Look, other: Look) -> bool:
    if one.skin is not None or other.skin is not None:
        return one.skin is other.skin
    if one.material is None or other.material is None:
        return one.material is other.material
    same_image = one.material.base_color_image is other.material.base_color_image
    return same_image and one.material.base_color == other.material.base_color


def frame_camera(mesh: Mesh, size: tuple[int, int]) -> Camera:
    """Return a camera that sees the whole mesh from the front."""
    low, high = mesh.positions.min(axis=0), mesh.positions.max(axis=0)
    middle = mesh.origin + (low + high) / 2
    fov = 30.0
    tangent = math.tan(math.radians(fov) / 2) * min(1.0, size[0] / size[1])
    half = max(high[0] - low[0], high[1] - low[1]) / 2
    distance = 1.1 * half / tangent + (high[2] - low[2]) / 2
    return Camera(position=(middle[0], middle[1], middle[2] + distance), target=tuple(middle), fov=fov)


class Pipeline:
    """A scene made ready: its graph, its mesh on the GPU, its outputs.

    Parameters
    ----------
    loaded : the scene and its skins
    mesh : see load_scene_mesh
    store : memo to share with other pipelines
    skip : False runs every node and remembers nothing
    exact : what `diffusion: exact` calls; see skincli.reference.texels
    use_cache : whether tables come from the disk cache; left out, as `skip`
    single : True computes light only near what the picture sees, which other views of the same light cannot reuse

    Raises
    ------
    InputError : `diffusion: exact` without it
    LimitError : the scene is too large
    """

    def __init__(
        self,
        loaded: LoadedScene,
        mesh: Mesh,
        store: Store | None = None,
        skip: bool = True,
        exact: Exact | None = None,
        use_cache: bool | None = None,
        single: bool = False,
    ) -> None:
        self.loaded = loaded
        self.scene = loaded.scene
        self.mesh = mesh
        self.looks, self.look_of_part = looks_of(loaded, mesh)
        self._sources = {
            index: MapSource.of_skin(look.skin) for index, look in enumerate(self.looks) if look.skin is not None
        }
        baked = any(source.reads_bake for source in self._sources.values())
        self.geometry = Geometry(mesh, bake(mesh) if baked else None)
        render = self.scene.render
        self.paper = render.shading == "paper"
        diffuses = not skip or not DIFFUSED.isdisjoint(self.scene.outputs)
        self.method = render.diffusion_method if diffuses else "none"
        #: whether light is diffused in the whole atlas, or only where the picture reads it
        self.whole = not skip or "diffused" in self.scene.outputs
        self._single, self._whole_light = single, "irradiance" in self.scene.outputs
        self._exact = exact
        if render.diffusion_method == "exact" and exact is None:
            raise InputError(
                loaded.fault("render.diffusion", "the exact diffusion is for single pictures; choose lattice")
            )
        self.samples = render.samples_per_axis
        self.size = (render.size[0] * self.samples, render.size[1] * self.samples)
        self.atlas_size = (render.atlas_size, render.atlas_size)
        self._require_memory()
        self._skip = skip
        self._use_cache = skip if use_cache is None else use_cache
        self._store = store or Store()
        self.graph = FrameGraph(self._nodes(), self._store, skip)

    def _require_memory(self) -> None:
        """Refuse a scene whose textures software GL would have to swap for."""
        # At most about six float32 targets of the atlas, two and their tables per Gaussian, and ten of the picture live
        # at once, and all maps of a skin.
        targets = 6 + 3 * len(self._widths)
        texels = targets * self.atlas_size[0] * self.atlas_size[1] + 10 * self.size[0] * self.size[1]
        maps = sum(look.skin.size**2 for look in self.looks if look.skin is not None)
        found = beyond_memory(16 * texels + MAP_BYTES * maps)
        if found is not None:
            remedy = "choose a smaller render.size, render.supersample, render.atlas or skin.size"
            raise LimitError(self.loaded.fault("render.size", f"{found}; {remedy}"))

    # -- frames --------------------------------------------------------------------------------------------------

    def run(
        self, outputs: Sequence[str], display: bool = False, timing: bool = False, check: bool = False
    ) -> dict[str, NDArray[np.float32]]:
        """Compute outputs and read them back.

        Parameters
        ----------
        outputs : keys of OUTPUTS
        display : also return "display", the beauty as a display shows it (straight alpha)
        timing : measure every node
        check : fail where a node leaves a NaN or Inf

        Returns
        -------
        (h, w, channels) float32 by name, top row first; beauty is premultiplied
        """
        diffuses = display or not DIFFUSED.isdisjoint(outputs)
        method = self.scene.render.diffusion_method if diffuses else self.method
        whole = self.whole or "diffused" in outputs
        whole_light = self._whole_light or "irradiance" in outputs
        if (method, whole, whole_light) != (self.method, self.whole, self._whole_light):
            self.method, self.whole, self._whole_light = method, whole, whole_light
            self.__dict__.pop("_widths", None)
            self.graph = FrameGraph(self._nodes(), self._store, self._skip)
        targets = {name: OUTPUTS[name].source for name in outputs}
        if display:
            targets["display"] = DISPLAYED
        if self.method == "exact":
            self.graph.update([self._exactly_diffused()])
        found = self.graph.run(list(targets.values()), timing, check)
        arrays = {}
        for name, ref in targets.items():
            channels = OUTPUTS[name].channels if name in OUTPUTS else 4
            array = read_back(found[ref])
            if array.shape[:2] == (1, 1):
                array = np.broadcast_to(array, (*self._target_size(name)[::-1], array.shape[2]))
            arrays[name] = array[..., :channels]
        return arrays

    def _target_size(self, name: str) -> tuple[int, int]:
        in_atlas = name in OUTPUTS and OUTPUTS[name].room == "atlas"
        return self.atlas_size if in_atlas else (self.scene.render.size[0], self.scene.render.size[1])

    @property
    def reports(self) -> list[NodeReport]:
        """What became of each node in the last frame."""
        return self.graph.reports

    def look_from(self, camera: Camera) -> None:
        """Move the camera; whatever does not depend on it stays."""
        self.scene = self.scene.model_copy(update={"camera": camera})
        self.__dict__.pop("view", None)
        changed = []
        for name, values in self._camera_values().items():
            node = self.graph.nodes[name]
            assert isinstance(node, Pass)
            changed.append(node.with_values(values))
        self.graph.update(changed)

    # -- the way of the light --------------------------------------------------------------------------------------

    def _nodes(self) -> list[Node]:
        nodes: list[Node] = []
        # skin description -> maps
        maps = [self._maps(index, look, nodes) for index, look in enumerate(self.looks)]
        # mesh + height -> surface, in the atlas
        nodes.append(self._atlas(maps))
        # mesh + camera -> view -> the part of the atlas in which light is wanted
        values = self._camera_values()
        per_part = [Draw(own, self._map_inputs(maps, part), "faces", part) for part, own in enumerate(values["view"])]
        nodes.append(View("view", self.size, per_part, geometry=self.geometry))
        seen, wanted = self._wanted(nodes)
        # surface + lights -> irradiance -> diffused irradiance
        nodes.append(
            Irradiance(
                "irradiance",
                self.atlas_size,
                draws_of(self._atlas_lights()),
                {"position": Ref("atlas", "position"), "normal": Ref("atlas", "normal"), "seen": wanted},
                defines=(*irradiance.DEFINES, *tile_defines(self.atlas_size)),
            )
        )
        way_in = AbsorbValues(WAYS_IN[self.scene.render.diffusion.albedo])
        incoming = {"image": Ref("irradiance", "irradiance"), "albedo": Ref("atlas", "albedo"), "seen": wanted}
        absorbed = Draw(way_in)
        nodes.append(Absorb("incoming", self.atlas_size, [absorbed], incoming, defines=tile_defines(self.atlas_size)))
        nodes += self._diffusion(nodes, seen, wanted)
        # view -> occlusion; view + lights -> specular; view + environment -> reflection
        view = {"depth": Ref("view", "depth"), "normal": Ref("view", "normal")}
        for band in ("high", "low"):
            name = f"occlusion_{band}"
            nodes.append(OcclusionBand(f"{name}_samples", self.size, draws_of(values[f"{name}_samples"]), view))
            window = occlusion_band.HIGH_WINDOW if band == "high" else occlusion_band.LOW_WINDOW
            nodes += blur.separable(
                name,
                self.size,
                Ref(f"{name}_samples", "occlusion"),
                [blur.window_taps(window)],
                division=blur.BY_ALPHA,
                owner=Ref(f"{name}_samples", "occlusion"),
                empty=1.0,
            )
        weights = self._occlusion_weights()
        bands = {f"occlusion_{band}": Ref(f"occlusion_{band}", "blurred") for band in ("high", "low")}
        nodes.append(Occlusion("occlusion", self.size, [Draw(weights)], bands))
        shine = {**view, "finish": Ref("view", "finish")}
        nodes.append(Specular("specular", self.size, draws_of(values["specular"]), shine))
        nodes += self._reflection(view, draws_of(values["reflection"]))
        # all of the above -> composition -> display
        nodes += self._composition(draws_of(values["display"]))
        return nodes

    def _maps(self, index: int, look: Look, nodes: list[Node]) -> dict[str, Source]:
        """Append the nodes that make one skin's maps; return what the view reads of them."""
        name = f"skin{index}"
        if look.skin is None:
            return {
                "albedo": self._material(name, look.material or Material(), nodes),
                "slope": ZERO,
                "reflectance": ONE,
                "specular": ONE,
                "roughness": ONE,
                "scattering_radius": ONE,
            }
        parts = [part for part, own in enumerate(self.look_of_part) if own == index]
        made = skin_maps(name, look.skin, self._sources[index], self.geometry, parts)
        nodes += [new for new in made.nodes if all(node.name != new.name for node in nodes)]
        channels = ("albedo", "reflectance", "specular", "roughness", "scattering_radius")
        read = {channel: made.maps[channel] for channel in channels}
        return {**read, "slope": made.slope}

    def _material(self, name: str, material: Material, nodes: list[Node]) -> Source:
        """Return the albedo that the mesh file itself gives."""
        factor = np.array(material.base_color)
        if material.base_color_image is None:
            red, green, blue = map(float, factor)
            return Constant((red, green, blue, 1.0))
        image = material.base_color_image
        digest = hashlib.blake2b(np.ascontiguousarray(image).tobytes(), digest_size=16)
        digest.update(repr((image.shape, material.base_color)).encode())

        def make() -> list[NDArray[np.floating]]:
            linear = srgb_decode(image[..., :3] / 255.0) * factor
            return [np.concatenate([linear, np.ones_like(linear[..., :1])], axis=-1)]

        nodes.append(Load(f"{name}_material", digest.hexdigest(), make, "rgba16f", mipmaps=True))
        return Ref(f"{name}_material", "image")

    def _map_inputs(self, maps: list[dict[str, Source]], part: int) -> dict[str, Source]:
        own = maps[self.look_of_part[part]]
        return {f"{channel}_map": source for channel, source in own.items() if f"{channel}_map" in View.inputs}

    def _atlas(self, maps: list[dict[str, Source]]) -> Node:
        gutter = 0.0 if self.paper else ATLAS_GUTTER / self.atlas_size[0]
        draws = []
        for topology in ("atlas_gutter", "faces"):
            for part, look in enumerate(self.look_of_part):
                own, optics = maps[look], self.looks[look].optics
                # A map that no layer writes need not be sampled: its ratio is 1 everywhere.
                radius = optics.radius if optics and isinstance(own["scattering_radius"], Ref) else (1.0, 1.0, 1.0)
                bumpiness, gives = self.looks[look].surface.bumpiness, float(topology == "faces")
                values = AtlasValues(bumpiness, look + 1.0, gutter, gives, radius)
                read = {"slope": own["slope"], "albedo_map": own["albedo"]}
                read["radius_map"] = own["scattering_radius"] if isinstance(own["scattering_radius"], Ref) else ONE
                draws.append(Draw(values, read, topology, part))
        return Atlas("atlas", self.atlas_size, draws, geometry=self.geometry)

    @cached_property
    def _lights(self) -> list[LightValues]:
        return [light_values(light, self.mesh.origin) for light in self.scene.lights]

    def _atlas_lights(self) -> list[IrradianceValues]:
        response = tuple((look.surface.ambient, look.surface.diffuse, 0.0, 0.0) for look in self.looks)
        # Uniform ambient radiance L gives the irradiance pi L; the paper's ambient light is a plain Phong color.
        scale = 1.0 if self.paper else math.pi
        ambient = tuple(scale * x for x in self.scene.ambient)
        return [
            IrradianceValues(
                **block,
                ambient=(0.0, 0.0, 0.0) if number else ambient,
                covers=0.0 if number else 1.0,
                samples=self.scene.render.irradiance_samples,
                response=response,
            )
            for number, block in enumerate(irradiance.in_blocks(self._lights))
        ]

    def _wanted(self, nodes: list[Node]) -> tuple[Source, Source]:
        """Append what finds the tiles of the atlas that the picture reads, and those whose light reaches them."""
        part = {"lattice", "none", "sum_of_gaussians", "exact"} | ({"screen_space"} if self._single else set())
        if self.whole or self.method not in part:
            return ONE, ONE
        nodes.append(seen_node(self.atlas_size, self.size, Ref("view", "depth"), Ref("view", "uv")))
        seen = Ref("seen", "seen")
        if not self._single or self._whole_light or self.method in ("sum_of_gaussians", "exact"):
            return seen, ONE
        if self.method != "lattice" or not self._widths:
            return seen, seen
        grid = cubes(self.mesh.positions, REACH * self._widths[-1])
        nodes += near_nodes(self.atlas_size, grid, seen, Ref("atlas", "position"))
        return seen, Ref("wanted", "wanted")

    def _diffusion(self, before: Sequence[Node], seen: Source, wanted: Source) -> list[Node]:
        """How light spreads below the surface: a sum of Gaussians, each a level, or the paper's blur.

        `before` are the nodes so far; `seen` and `wanted` tiles of the atlas, see `_wanted`.
        """
        image, position, size = Ref("incoming", "absorbed"), Ref("atlas", "position"), self.atlas_size
        if self.method == "paper":
            kernels = [blur.window_taps(look.surface.blur) for look in self.looks]
            return list(blur.separable("diffused", size, image, kernels, owner=position))
        widths = self._widths
        terms: list[Source] = []
        nodes: list[Node] = []
        metric, owner = Ref("atlas", "metric"), position
        spread: Source = Ref("atlas", "spread") if self.method == "lattice" and self._spreads else ONE
        if self.method == "exact":
            nodes.append(self._blank)
            image = Ref(self._blank.name, "image")
        elif self.method == "lattice":
            normal = Ref("atlas", "frame_n")
            blocks: dict[int, WindowSource] = {}

            def block(factor: int) -> WindowSource:
                if factor not in blocks:
                    blocks[factor] = block_node(size, image, metric, position, normal, wanted, factor)
                    nodes.append(blocks[factor])
                return blocks[factor]

            for number, (width, (key, table)) in enumerate(zip(widths, self._tables(before), strict=True)):
                name, given = f"diffused_{number}", block(table.factor)
                if width < self._least_lattice:
                    nodes += window_nodes(name, size, given, position, normal, seen, width, self._texel, key, table)
                    terms.append(Ref(name, "windowed"))
                else:
                    term = Term(key, table, (1.0, 1.0, 1.0))
                    nodes += lattice_nodes(name, size, image, position, normal, metric, given, seen, [term])
                    terms.append(Ref(name, "sliced"))
        elif self.method == "sum_of_gaussians":
            blurs, found = chained("diffused", size, image, metric, widths)
            nodes += blurs
            terms += found
        elif self.method in ("screen_space", "splat"):
            owner, depth, size, seen = Ref("view", "normal"), Ref("view", "depth"), self.size, ONE
            read: dict[str, Source] = {"image": image, "uv": Ref("view", "uv"), "depth": depth}
            nodes.append(Arriving("arriving", size, [Draw(ArrivingValues())], read))
            light = Ref("arriving", "arriving")
            if self.method == "screen_space":
                blurs, found = screen_nodes(size, light, depth, screen_values(widths, self._pixels_per_mm))
            else:
                points = quads(self._texels, self.atlas_size[0])
                blurs, found = splat_nodes(size, image, depth, points, splat_values(widths, self.view, size))
            image = light
            nodes += blurs
            terms += found
        slots = len(self.looks)
        steps = SPREAD_STEPS if isinstance(spread, Ref) else 1
        table = np.stack(
            [spread_weights(self._profile(look), widths, self._texel / 2, steps) for look in range(slots)], axis=1
        )
        table = table.reshape(-1, steps, 3)
        table = np.concatenate([table, np.ones_like(table[..., :1])], axis=-1)
        digest = hashlib.blake2b(table.tobytes(), digest_size=16).hexdigest()
        nodes.append(Load("diffused_weights", f"{table.shape} {digest}", lambda: [table[::-1]]))
        weights = Ref("diffused_weights", "image")
        nodes.append(combine_node("diffused", size, image, terms, slots, owner, spread, weights, seen))
        return nodes

    def _profile(self, look: int) -> GaussianSum:
        """The Gaussians of a look; light stays where it is in one without optics."""
        optics = self.looks[look].optics
        if optics is None:
            return GaussianSum((), ())
        return fit(optics.diffusion_profile(), self.scene.render.diffusion_terms)

    @cached_property
    def _spreads(self) -> bool:
        """Whether a skin's layers say how far light gets."""
        return any("scattering_radius" in source.written for source in self._sources.values())

    @cached_property
    def _widths(self) -> tuple[float, ...]:
        """Standard deviations of the Gaussians that are rendered, mm, ascending."""
        profiles = [self._profile(look) for look in range(len(self.looks))]
        if self.method == "lattice":
            found = levels(profiles, min(LEAST_SAMPLES * self._texel, LEAST_LATTICE), self._spreads, self._texel)
            for look, profile in enumerate(profiles):
                error = edge_error(profile, found, self._texel / 2) if profile.variances else 0.0
                _log.info("skin %d: light at an edge is up to %.1f %% off its profile", look, 100 * error)
            return found
        if self.method == "splat":
            return levels(profiles, LEAST_SPACING * spacing(self._texels), False, self._texel)
        if self.method in ("sum_of_gaussians", "screen_space"):
            return levels(profiles, 0.0, False, self._texel)
        return ()

    @cached_property
    def _least_lattice(self) -> float:
        """Standard deviation, mm, from which on the lattice serves; narrower ones are windows."""
        spots = math.sqrt(float(face_areas(self.mesh).sum()) / MOST_SPOTS)
        return max(LEAST_LATTICE, spots, lattice.least_sigma(self.mesh.positions))

    def _tables(self, before: Sequence[Node]) -> list[tuple[str, Any]]:
        """For each width the tables of its windows or its lattice, with the key that names them."""
        # What texels the driver fills, and where they lie, it knows best.
        driver = "{renderer}, {version}".format(**device_info())
        rooms = " ".join(module_digest(room.__name__).hex() for room in (lattice, windows, bits, words))
        about = f"{rooms} {driver} {self.mesh.key} {self.atlas_size} {ATLAS_GUTTER}"
        wanted: list[tuple[ModuleType, float, int, str]] = []
        for width in self._widths:
            room, factor = (windows, window_factor) if width < self._least_lattice else (lattice, lattice.block_factor)
            texels = factor(width, self._texel)
            wanted.append((room, width, texels, f"{about} {width!r} {texels}"))

        def kind(room: ModuleType) -> str:
            return room.__name__.rpartition(".")[2]

        kept = [diskcache.find(kind(room), key) if self._use_cache else None for room, _, _, key in wanted]
        missing = [place for place, entry in enumerate(kept) if entry is None]
        if missing:
            refs = [Ref("atlas", output) for output in ("position", "frame_n", "metric")]
            found = FrameGraph(before, self._store).run(refs)
            position, normal, metric = (read_back(found[ref])[::-1].reshape(-1, 4).astype(np.float64) for ref in refs)
            own = np.flatnonzero(position[:, 3] > 0)
            surface = position[own, :3], normal[own, :3], metric[own, 0], own, self.atlas_size[0]
            del position, normal, metric

            def make(place: int) -> dict[str, NDArray[Any]]:
                room, width, factor, _ = wanted[place]
                return dict(room.pack(room.tables(*surface, width, factor)))

            with ThreadPoolExecutor(os.cpu_count()) as pool:
                for place, entry in zip(missing, pool.map(make, missing), strict=True):
                    kept[place] = entry
                    # Written here, where an interrupt removes what is half written.
                    if self._use_cache:
                        diskcache.keep(kind(wanted[place][0]), wanted[place][3], entry)
        return [(key, room.unpack(entry)) for (room, _, _, key), entry in zip(wanted, kept, strict=True)]

    @cached_property
    def _texels(self) -> Texels:
        return atlas_texels(self.mesh, self.atlas_size[0], ATLAS_GUTTER)

    _blank = Load("exact", "nothing yet", lambda: [np.zeros((1, 1, 4))])

    def _exactly_diffused(self) -> Load:
        """The light on the atlas, diffused on the host; what the GPU makes of it is read back first."""
        assert self._exact is not None
        ref = Ref("incoming", "absorbed")
        light = read_back(self.graph.run([ref])[ref])
        owner = read_back(self.graph.run([Ref("atlas", "position")])[Ref("atlas", "position")])
        spread = None
        if self._spreads:
            spread = read_back(self.graph.run([Ref("atlas", "spread")])[Ref("atlas", "spread")])
        texels, exact = self._texels, self._exact
        height, width = light.shape[:2]
        row, column = height - 1 - texels.index // width, texels.index % width
        slot = owner[row, column, 3]
        digest = hashlib.blake2b(light.tobytes(), digest_size=16)
        digest.update(b"" if spread is None else spread.tobytes())

        def make() -> list[NDArray[np.floating]]:
            signal, result = light[row, column, :3].astype(np.float64), np.zeros(light.shape)
            for look in range(len(self.looks)):
                # The gutter stays empty: what reads at a border takes the mean of the texels that are there.
                here = (slot == look + 1) & (texels.areas > 0)
                profile = self._profile(look)
                total = np.broadcast_to(profile.total(), 3)
                shares = np.array(profile.weights).reshape(-1, 3) / np.where(total > 0, total, 1)
                ratio = None
                if spread is not None:
                    ratio = np.clip(spread[row[here], column[here], :3].astype(np.float64), 0, MAX_SPREAD)
                found = exact(texels, signal, here, profile.variances, shares.tolist(), ratio)
                found += signal[here] * (1 - shares.sum(axis=0))
                result[row[here], column[here]] = np.concatenate([found, np.ones_like(found[:, :1])], axis=1)
            return [result]

        profiles = [self._profile(look) for look in range(len(self.looks))]
        return Load(self._blank.name, f"{digest.hexdigest()} {self.mesh.key} {profiles}", make)

    @property
    def _pixels_per_mm(self) -> float:
        """Pixels that a mm takes at a depth of 1 mm."""
        return self.size[1] / (2 * self.view.tan_half[1])

    @cached_property
    def _texel(self) -> float:
        """Mean mm per texel of the atlas."""
        return texel_size(self.mesh, self.mesh.atlas_uv, self.atlas_size[0])

    @cached_property
    def view(self) -> View3D:
        """The camera relative to the mesh."""
        camera = self.scene.camera or frame_camera(self.mesh, self.size)
        return look_at(
            np.array(camera.position) - self.mesh.origin,
            np.array(camera.target) - self.mesh.origin,
            np.array(camera.up),
            camera.fov,
            self.size,
            float(np.linalg.norm(self.mesh.positions, axis=1).max()),
        )

    def _camera_values(self) -> dict[str, list[Values]]:
        """Return the values, one per draw, of the nodes that depend on the camera."""
        view, render = self.view, self.scene.render
        axes: dict[str, Any] = {"right": view.right, "up": view.up, "forward": view.forward}
        lens: dict[str, Any] = {"tan_half": view.tan_half, "size": tuple(map(float, self.size))}
        environment = self.scene.environment
        values: dict[str, list[Values]] = {"view": []}
        if self.method == "screen_space":
            changing = screen_values(self._widths, self._pixels_per_mm)
            values |= {name: [block] for name, block in changing.items()}
        elif self.method == "splat":
            discs = splat_values(self._widths, view, self.size)
            values |= {name: [block] for name, block in discs.items()}
        strength = 1.0 if render.effects.specular else 0.0
        mirrors = False
        for look in self.look_of_part:
            surface = self.looks[look].surface
            reflectance = surface.reflectance if render.effects.reflection and environment else 0.0
            mirrors |= reflectance > 0
            values["view"].append(
                ViewValues(
                    view.clip, view.eye, surface.bumpiness, view.forward, look + 1.0, reflectance,
                    strength * surface.specular, -1.0 if self._rough(look) else surface.shininess,
                )
            )  # fmt: skip
        hemisphere = render.occlusion.samples == "hemisphere"
        for band, count, radius in (
            ("high", occlusion_band.HIGH_SAMPLES, render.occlusion.radius_high),
            ("low", occlusion_band.LOW_SAMPLES, render.occlusion.radius_low),
        ):
            samples = occlusion_band.sample_set(count, hemisphere)
            band_values = BandValues(
                **lens, **axes, radius=radius, bias=occlusion_band.BIAS, count=count, hemisphere=int(hemisphere),
                seed=int(band == "low"), samples=samples,
            )  # fmt: skip
            values[f"occlusion_{band}_samples"] = [band_values]
        dull = int(strength == 0 or all(look.surface.specular == 0 for look in self.looks))
        values["specular"] = [
            SpecularValues(**block, **axes, **lens, eye=view.eye, scale=self._radiance, dull=dull)
            for block in irradiance.in_blocks(self._lights)
        ]
        values["reflection"] = [
            ReflectionValues(
                **axes,
                **lens,
                scale=2.0**environment.exposure if environment and mirrors else 0.0,
                turn=environment.rotation / 360 if environment else 0.0,
                damping=float(render.effects.reflection_damping),
                levels=self._panorama[1] if environment else 1,
            )
        ]
        exposure = self.scene.camera.exposure if self.scene.camera else 0.0
        values["display"] = [DisplayValues(2.0**exposure, int(render.display == "neutral"))]
        return values

    @property
    def _radiance(self) -> float:
        """Factor from irradiance to radiance; the paper's light values are Phong colors already."""
        return 1.0 if self.paper else 1 / math.pi

    def _rough(self, look: int) -> bool:
        """Whether a skin's layers say how rough it is."""
        return look in self._sources and "roughness" in self._sources[look].written

    def _occlusion_weights(self) -> OcclusionValues:
        occlusion, effects = self.scene.render.occlusion, self.scene.render.effects
        return OcclusionValues(
            occlusion.a if effects.occlusion_high else 0.0, occlusion.b if effects.occlusion_low else 0.0
        )

    @cached_property
    def _panorama(self) -> tuple[Load, int]:
        """The environment's pyramid and the number of its levels."""
        assert self.scene.environment is not None
        path = self.scene.environment.image
        # The size decides the number of levels, which is wanted before the pixels are.
        side = max(images.size_of(path))
        levels = math.floor(math.log2(side)) + 1
        smaller = max(0, math.ceil(math.log2(side / MAX_PANORAMA)))

        def make() -> list[NDArray[np.floating]]:
            found = reflection.pyramid(images.read_environment(path).astype(np.float64))[smaller:]
            return [np.concatenate([level, np.ones_like(level[..., :1])], axis=-1) for level in found]

        return Load("environment", f"{file_digest(path)} panorama", make, "rgba32f"), levels - smaller

    def _reflection(self, view: Mapping[str, Source], draws: Sequence[Draw]) -> list[Node]:
        inputs = {**view, "reflectance": Ref("view", "finish"), "occlusion": Ref("occlusion", "occlusion")}
        if self.scene.environment is None:
            return [Reflection("reflection", self.size, draws, {**inputs, "environment": ZERO})]
        load, _ = self._panorama
        inputs["environment"] = Ref(load.name, "image")
        return [load, Reflection("reflection", self.size, draws, inputs)]

    def _composition(self, display: Sequence[Draw]) -> list[Node]:
        values = ComposeValues(
            self._radiance,
            float(self.paper),
            normalize=int(self.method != "paper"),
            in_atlas=int(self.method not in ("screen_space", "splat")),
            way_out=2 - WAYS_IN[self.scene.render.diffusion.albedo],
        )
        inputs = {
            **{name: Ref("view", name) for name in ("depth", "uv", "albedo")},
            "occlusion": Ref("occlusion", "occlusion"),
            "specular": Ref("specular", "specular"),
            "reflection": Ref("reflection", "reflection"),
            "diffused": Ref("diffused", "blurred"),
        }
        nodes: list[Node] = [Compose("compose", self.size, [Draw(values)], inputs)]
        sources = {
            "beauty": Ref("compose", "beauty"),
            "diffuse": Ref("compose", "diffuse"),
            "specular": Ref("specular", "specular"),
            "reflection": Ref("reflection", "reflection"),
            "occlusion": Ref("occlusion", "occlusion"),
            "occlusion_high": Ref("occlusion_high", "blurred"),
            "occlusion_low": Ref("occlusion_low", "blurred"),
            **{name: Ref("view", name) for name in ("albedo", "normal", "depth", "uv")},
        }
        picture = (self.scene.render.size[0], self.scene.render.size[1])
        for name, source in sources.items():
            behind = self.scene.background if name == "beauty" else None
            background = (*behind, 1.0) if behind is not None else resolve.NO_BACKGROUND
            mixes = int(name not in ("depth", "uv"))
            draw = Draw(ResolveValues(background, self.samples, mixes))
            nodes.append(Resolve(f"{name}_picture", picture, [draw], {"image": source, "depth": Ref("view", "depth")}))
        nodes.append(Display("display", picture, display, {"beauty": OUTPUTS["beauty"].source}))
        return nodes


def draws_of(values: Sequence[Values]) -> list[Draw]:
    """Return one draw over the whole target per block of values."""
    return [Draw(block) for block in values]


def light_values(light: Light, origin: NDArray[np.float64]) -> LightValues:
    """Return a light relative to the mesh's origin, subtracted in float64."""
    if light.type == "directional":
        direction = np.array(light.direction) / np.linalg.norm(light.direction)
        return LightValues(light.irradiance, irradiance.DIRECTIONAL, direction=tuple(map(float, direction)))
    position = tuple(map(float, np.array(light.position) - origin))
    if light.type == "point":
        return LightValues(light.intensity, irradiance.POINT, position)
    direction = np.array(light.direction) / np.linalg.norm(light.direction)
    outer, inner = irradiance.spot_cosines(light.angle, light.blend)
    return LightValues(light.intensity, irradiance.SPOT, position, outer, tuple(map(float, direction)), inner)


def load_textures(source: MapSource) -> tuple[dict[str, Load], dict[str, Source]]:
    """Return the nodes that upload what a skin's layers sample, by name, and what each sampler reads."""
    loads = {}
    inputs: dict[str, Source] = {}
    for sampler, texture in source.textures:
        digest = hashlib.blake2b(texture.key.encode(), digest_size=8).hexdigest()
        load = Load(f"texture {digest}", texture.key, partial(_texels, texture), texture.format, True)
        loads[load.name] = load
        inputs[sampler] = Ref(load.name, "image")
    return loads, inputs


def _texels(texture: Texture) -> list[NDArray[np.floating]]:
    """Return a texture's pixels, of as many channels as its format has, within what the driver can hold."""
    pixels: NDArray[np.floating] = np.asarray(texture.make())
    limit = get_context().info["GL_MAX_TEXTURE_SIZE"]
    height, width = pixels.shape[:2]
    if max(height, width) > limit:
        _log.warning("a picture of %d x %d is reduced to the %d a side that this driver holds", width, height, limit)
        pixels = images.reduce_to(pixels, limit)
    channels = FORMATS[texture.format][0]
    if pixels.shape[2] < channels:
        pixels = np.repeat(pixels[..., :1], channels, axis=-1)
    return [pixels]


@dataclass(frozen=True)
class SkinMaps:
    """The nodes that make a skin's maps.

    Parameters
    ----------
    nodes : in no particular order
    source : the layers as shaders
    maps : by output of the pass `Maps`, where it comes from
    slope : of the heights and normal maps together
    site : where the texels lie on the mesh, if there is one
    """

    nodes: Sequence[Node]
    source: MapSource
    maps: Mapping[str, Source]
    slope: Source
    site: Callable[[str], Source]


def skin_maps(name: str, skin: Skin, source: MapSource, geometry: Geometry | None, parts: Sequence[int]) -> SkinMaps:
    """Return what makes the maps of a skin.

    Parameters
    ----------
    name : begins the nodes' names
    skin : the description
    source : its layers as shaders
    geometry : the mesh they lie on; None for a flat square
    parts : of the mesh, that wear the skin

    Raises
    ------
    LimitError : the uv of the parts need several UDIM tiles
    """
    if geometry is not None:
        require_one_tile(geometry.mesh, parts)
    side = skin.size
    size = (side, side)
    loads, inputs = load_textures(source)
    nodes: list[Node] = list(loads.values())
    on_surface = geometry is not None and skin.domain == "object"
    if geometry is not None:
        values = SiteValues(1 / side, MAP_GUTTER / side)
        draws = [Draw(values, {}, topology, part) for topology in ("map_gutter", "tiles") for part in parts]
        nodes.append(Site(f"{name}_site", size, draws, geometry=geometry))
        if on_surface:
            inputs |= {f"site_{what}": Ref(f"{name}_site", what) for what in ("position", "normal")}
        if source.reads_bake:
            inputs["site_baked"] = Ref(f"{name}_site", "baked")
    nodes.append(Maps(f"{name}_maps", size, source, inputs, on_surface=on_surface, extent=skin.extent))
    maps = {
        output: Ref(f"{name}_maps", output) if output in source.written else source.constant(output)
        for output in Maps.outputs
    }
    slope: Source = ZERO
    if {"height", "tangent_slope"} & source.written:
        wired = {"height": maps["height"], "tangent_slope": maps["tangent_slope"]}
        nodes.append(Slope(f"{name}_slope", size, [Draw(SlopeValues())], wired))
        slope = Ref(f"{name}_slope", "slope")
    return SkinMaps(nodes, source, maps, slope, lambda what: ZERO if geometry is None else Ref(f"{name}_site", what))
