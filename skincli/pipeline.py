"""From a scene to its frame graph: the passes in the order in which the light travels. The file to open first."""

from __future__ import annotations

import hashlib
import logging
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skincli import images
from skincli.color import srgb_decode
from skincli.errors import Fault, InputError, LimitError, did_you_mean
from skincli.gpu.blocks import Values
from skincli.gpu.geometry import Geometry
from skincli.gpu.textures import beyond_memory, read_back
from skincli.graph.frame_graph import FrameGraph, NodeReport
from skincli.graph.node import ONE, ZERO, Constant, Draw, Load, Node, Pass, Ref, Source
from skincli.graph.store import Store
from skincli.layers.base import Picture
from skincli.mesh.load import load_builtin, load_mesh
from skincli.mesh.model import Material, Mesh, Urgent
from skincli.mesh.surface import texel_size
from skincli.optics.diffusion import burley_width, gaussian_sigma
from skincli.passes import blur, irradiance, occlusion_band, reflection, resolve
from skincli.passes.atlas import Atlas, AtlasValues
from skincli.passes.camera import View3D, look_at
from skincli.passes.compose import Compose, ComposeValues
from skincli.passes.display import Display, DisplayValues
from skincli.passes.irradiance import Irradiance, IrradianceValues, LightValues
from skincli.passes.maps import Maps, MapSource
from skincli.passes.occlusion import Occlusion, OcclusionValues
from skincli.passes.occlusion_band import BandValues, OcclusionBand
from skincli.passes.reflection import Reflection, ReflectionValues
from skincli.passes.resolve import Resolve, ResolveValues
from skincli.passes.site import Site, SiteValues
from skincli.passes.slope import Slope, SlopeValues
from skincli.passes.specular import Specular, SpecularValues
from skincli.passes.view import View, ViewValues
from skincli.scene.model import Camera, Light
from skincli.scene.paths import LoadedScene
from skincli.scene.skin import Optics, Skin, Surface

#: texels by which charts are continued beyond their border: in the maps, and in the atlas of `physical`
MAP_GUTTER = 4
ATLAS_GUTTER = 2

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

#: the picture as a display shows it; PNG files are made of it
DISPLAYED = Ref("display", "displayed")


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
        for note in mesh.notes:
            _log.log(logging.WARNING if isinstance(note, Urgent) else logging.INFO, "%s: %s", name, note)
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


def _count_text(count: int) -> str:
    """Return 259000 as it is written in YAML, 259k."""
    return f"{count // 1000}k" if count % 1000 == 0 else str(count)


def looks_of(loaded: LoadedScene, mesh: Mesh) -> tuple[list[Look], list[int]]:
    """Return the distinct looks of a mesh and, per part, the index of its own.

    Parts that share a skin share its maps, unless the authored uv overlap: then each part has maps of its own, so that
    eyes and skin that both fill the unit square do not draw over each other.
    """
    looks: list[Look] = []
    index = []
    apart = not mesh.uv_is_unique and len(mesh.parts) <= irradiance.MAX_SLOTS
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
    """

    def __init__(self, loaded: LoadedScene, mesh: Mesh, store: Store | None = None, skip: bool = True) -> None:
        self.loaded = loaded
        self.scene = loaded.scene
        self.mesh = mesh
        self.geometry = Geometry(mesh)
        self.looks, self.look_of_part = looks_of(loaded, mesh)
        render = self.scene.render
        self.paper = render.shading == "paper"
        self.samples = render.samples_per_axis
        self.size = (render.size[0] * self.samples, render.size[1] * self.samples)
        self.atlas_size = (render.atlas_size, render.atlas_size)
        self._require_memory()
        self.graph = FrameGraph(self._nodes(), store, skip)

    def _require_memory(self) -> None:
        """Refuse a scene whose textures software GL would have to swap for."""
        # At most about six float32 targets of the atlas and ten of the picture live at once, and all maps of a skin.
        texels = 6 * self.atlas_size[0] * self.atlas_size[1] + 10 * self.size[0] * self.size[1]
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
        targets = {name: OUTPUTS[name].source for name in outputs}
        if display:
            targets["display"] = DISPLAYED
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
        # surface + lights -> irradiance -> diffused irradiance
        nodes.append(
            Irradiance(
                "irradiance",
                self.atlas_size,
                draws_of(self._atlas_lights()),
                {"position": Ref("atlas", "position"), "normal": Ref("atlas", "normal")},
            )
        )
        nodes += self._diffusion()
        # mesh + camera -> view; view -> occlusion; view + lights -> specular; view + environment -> reflection
        values = self._camera_values()
        view = {"depth": Ref("view", "depth"), "normal": Ref("view", "normal")}
        per_part = [Draw(own, self._map_inputs(maps, part), "faces", part) for part, own in enumerate(values["view"])]
        nodes.append(View("view", self.size, per_part, geometry=self.geometry))
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
        nodes.append(Specular("specular", self.size, draws_of(values["specular"]), view))
        nodes += self._reflection(view, draws_of(values["reflection"]))
        # all of the above -> composition -> display
        nodes += self._composition(draws_of(values["display"]))
        return nodes

    def _maps(self, index: int, look: Look, nodes: list[Node]) -> dict[str, Source]:
        """Append the nodes that make one skin's maps; return albedo, slope and reflectance."""
        name = f"skin{index}"
        if look.skin is None:
            return {
                "albedo": self._material(name, look.material or Material(), nodes),
                "slope": ZERO,
                "reflectance": ONE,
            }
        side = look.skin.size
        size = (side, side)
        source = MapSource.of_skin(look.skin)
        loads, inputs = load_pictures(source)
        nodes += [load for name, load in loads.items() if all(node.name != name for node in nodes)]
        if source.on_surface:
            parts = [part for part, own in enumerate(self.look_of_part) if own == index]
            values = SiteValues(1 / side, MAP_GUTTER / side)
            draws = [Draw(values, {}, topology, part) for topology in ("map_gutter", "tiles") for part in parts]
            nodes.append(Site(f"{name}_site", size, draws, geometry=self.geometry))
            inputs |= {f"site_{what}": Ref(f"{name}_site", what) for what in ("position", "normal")}
        nodes.append(Maps(f"{name}_maps", size, source, inputs, on_mesh=True, extent=look.skin.extent))

        def map_of(channel: str) -> Source:
            return Ref(f"{name}_maps", channel) if channel in source.written else Maps.neutral[channel]

        slope: Source = ZERO
        if {"height", "tangent_slope"} & source.written:
            wired = {"height": map_of("height"), "tangent_slope": map_of("tangent_slope")}
            nodes.append(Slope(f"{name}_slope", size, [Draw(SlopeValues())], wired))
            slope = Ref(f"{name}_slope", "slope")
        return {"albedo": map_of("albedo"), "slope": slope, "reflectance": map_of("reflectance")}

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
        return {f"{channel}_map": source for channel, source in own.items()}

    def _atlas(self, maps: list[dict[str, Source]]) -> Node:
        gutter = 0.0 if self.paper else ATLAS_GUTTER / self.atlas_size[0]
        draws = []
        for topology in ("atlas_gutter", "faces"):
            for part, look in enumerate(self.look_of_part):
                values = AtlasValues(self.looks[look].surface.bumpiness, look + 1.0, gutter)
                draws.append(Draw(values, {"slope": maps[look]["slope"]}, topology, part))
        return Atlas("atlas", self.atlas_size, draws, geometry=self.geometry)

    @cached_property
    def _lights(self) -> list[LightValues]:
        return [light_values(light, self.mesh.origin) for light in self.scene.lights]

    def _atlas_lights(self) -> list[IrradianceValues]:
        response = tuple((look.surface.ambient, look.surface.diffuse, 0.0, 0.0) for look in self.looks)
        # Uniform ambient radiance L gives the irradiance pi L; the paper's ambient light is a plain Phong color.
        scale = 1.0 if self.paper else math.pi
        ambient = LightValues(tuple(scale * x for x in self.scene.ambient), irradiance.AMBIENT)
        return [IrradianceValues(**asdict(light), response=response) for light in (ambient, *self._lights)]

    def _diffusion(self) -> list[Node]:
        """The paper's blur, a window in texels; or one Gaussian per channel in mm, divided by blurred coverage."""
        image, size = Ref("irradiance", "irradiance"), self.atlas_size
        kernels = [self._kernel(look) for look in self.looks]
        if self.paper:
            return list(blur.separable("diffused", size, image, kernels, owner=Ref("atlas", "position")))
        position = Ref("atlas", "position")
        coverage = blur.separable("coverage", size, position, kernels, coverage_only=True, owner=position)
        diffused = blur.separable(
            "diffused",
            size,
            image,
            kernels,
            division=blur.BY_COVERAGE,
            coverage=Ref("coverage", "blurred"),
            owner=position,
        )
        return [*coverage, *diffused]

    def _kernel(self, look: Look) -> tuple[tuple[float, ...], ...]:
        if not self.scene.render.effects.blur:
            return blur.IDENTITY
        if self.paper:
            return blur.window_taps(look.surface.blur)
        if look.optics is None:
            return blur.IDENTITY
        optics = look.optics
        sigma = gaussian_sigma(burley_width(optics.radius, optics.color, optics.radius_kind))
        return blur.gaussian_taps(list(sigma / self._texel))

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
        mirrors = False
        for look in self.look_of_part:
            surface = self.looks[look].surface
            reflectance = surface.reflectance if render.effects.reflection and environment else 0.0
            mirrors |= reflectance > 0
            values["view"].append(
                ViewValues(view.clip, view.eye, surface.bumpiness, view.forward, look + 1.0, reflectance)
            )
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
        strength = 1.0 if render.effects.specular else 0.0
        gloss = tuple((strength * look.surface.specular, look.surface.shininess, 0.0, 0.0) for look in self.looks)
        # Without a light there is nothing to add up; one that shines nothing keeps the node's form.
        lights = self._lights or [LightValues((0.0, 0.0, 0.0), irradiance.DIRECTIONAL)]
        values["specular"] = [
            SpecularValues(**asdict(light), **axes, **lens, eye=view.eye, scale=self._radiance, gloss=gloss)
            for light in lights
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
        inputs = {**view, "reflectance": Ref("view", "reflectance"), "occlusion": Ref("occlusion", "occlusion")}
        if self.scene.environment is None:
            return [Reflection("reflection", self.size, draws, {**inputs, "environment": ZERO})]
        load, _ = self._panorama
        inputs["environment"] = Ref(load.name, "image")
        return [load, Reflection("reflection", self.size, draws, inputs)]

    def _composition(self, display: Sequence[Draw]) -> list[Node]:
        values = ComposeValues(self._radiance, float(self.paper), int(not self.paper))
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


def file_digest(path: Path) -> str:
    """Return the hash of a file's bytes."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16)).hexdigest()


def load_picture(picture: Picture) -> Load:
    """Return the node that uploads a source image of a skin, read by its role."""
    path, role = picture.file, picture.role
    readers: dict[str, Callable[[], NDArray[np.float32]]] = {
        "color": lambda: images.read_color(path),
        "grey": lambda: np.repeat(images.read_data(path, 1), 4, axis=-1),
        "normal": lambda: images.read_data(path, 4),
    }
    digest = file_digest(path)
    format = "rgba32f" if role == "grey" else "rgba16f"
    return Load(f"image {path.name} {digest[:8]} {role}", f"{digest} {role}", lambda: [readers[role]()], format, True)


def load_pictures(source: MapSource) -> tuple[dict[str, Load], dict[str, Source]]:
    """Return the nodes that upload a skin's source images, by name, and what each sampler reads."""
    by_sampler = {sampler: load_picture(picture) for sampler, picture in source.images}
    inputs: dict[str, Source] = {sampler: Ref(load.name, "image") for sampler, load in by_sampler.items()}
    return {load.name: load for load in by_sampler.values()}, inputs
