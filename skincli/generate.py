"""From a skin to map files: the generator without a picture."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from skincli import images, mapset
from skincli.errors import LimitError
from skincli.gpu.context import device_info, get_context
from skincli.gpu.geometry import Geometry
from skincli.gpu.textures import Texture, beyond_memory, read_back
from skincli.graph.frame_graph import FrameGraph
from skincli.graph.node import Constant, Draw, Node, Ref, Source
from skincli.mapset import MAPS, Convention, Encoding, Naming
from skincli.mesh.bake import bake
from skincli.mesh.model import Mesh
from skincli.passes import cavity
from skincli.passes.cavity import Cavity, CavityValues
from skincli.passes.maps import MapSource
from skincli.passes.normal_map import NormalMap, NormalMapValues
from skincli.pipeline import MAP_BYTES, SkinMaps, skin_maps
from skincli.scene.skin import Skin

Array = NDArray[np.float32]

#: packages beside our own and the writer's whose version can change a map
PACKAGES = ("moderngl", "numpy")

#: maps that are written unless others are asked for
DEFAULT = ("albedo", "bump", "reflection")

#: map -> output of the generator that holds it as it is; the others are derived
_DIRECT = {
    "albedo": "albedo",
    "height": "height",
    "bump": "height",
    "reflection": "reflectance",
    "roughness": "roughness",
    "specular": "specular",
    "scattering_radius": "scattering_radius",
}


@dataclass(frozen=True)
class Ground:
    """What a skin's maps lie on.

    Parameters
    ----------
    mesh : None for a flat square
    parts : of the mesh, that wear the skin
    """

    mesh: Mesh | None = None
    parts: tuple[int, ...] = (0,)


def generate(skin: Skin, maps: Sequence[str] = DEFAULT, ground: Ground = Ground()) -> dict[str, Array]:
    """Return the maps of a skin.

    Parameters
    ----------
    skin : the description; its size is that of the maps
    maps : keys of `skincli.mapset.MAPS`; no other is computed
    ground : a mesh, or a flat square of `skin.extent` mm

    Returns
    -------
    (size, size, c) by name, top row first: albedo linear Rec.709; height and bump mm; normal unit vectors, y up;
    scattering_radius mm; the others 0 to 1

    Raises
    ------
    LimitError : more than the driver or the memory can hold, or a mesh with several UDIM tiles
    """
    side = skin.size
    limit = get_context().info["GL_MAX_TEXTURE_SIZE"]
    if side > limit:
        need = side * side * MAP_BYTES / 1e9
        raise LimitError(
            f"maps of {side} x {side} texels are asked for ({need:.1f} GB); this driver allows {limit} a side; "
            "choose a smaller --size"
        )
    beyond = beyond_memory(MAP_BYTES * side * side)
    if beyond is not None:
        raise LimitError(f"maps of {side} x {side} texels are asked for: {beyond}; choose a smaller --size")
    source = MapSource.of_skin(skin)
    geometry = None
    if ground.mesh is not None:
        geometry = Geometry(ground.mesh, bake(ground.mesh) if source.reads_bake else None)
    nodes, sources = _with_derived(skin_maps("skin", skin, source, geometry, ground.parts), skin, flat=geometry is None)
    graph = FrameGraph(nodes)
    found = graph.run([origin for name in maps if isinstance(origin := sources[name], Ref)])
    arrays = {name: _array(sources[name], found, MAPS[name].channels, side) for name in maps}
    # Nothing else frees them, and a scene may have many skins.
    graph.store.clear()
    return arrays


def _array(origin: Source, found: Mapping[Ref, Texture], channels: int, side: int) -> Array:
    """Return (side, side, channels): a texture's texels, or a constant everywhere."""
    if isinstance(origin, Ref):
        return read_back(found[origin])[..., :channels]
    return np.broadcast_to(np.array(origin.value[:channels], np.float32), (side, side, channels))


def _with_derived(made: SkinMaps, skin: Skin, *, flat: bool) -> tuple[list[Node], dict[str, Source]]:
    """Return all nodes, with those of the maps that follow from others, and where each map comes from."""
    size = (skin.size, skin.size)
    nodes = list(made.nodes)
    sources = {name: made.maps[output] for name, output in _DIRECT.items()}
    sources |= {"normal": Constant((0.0, 0.0, 1.0, 1.0)), "cavity": Constant((1.0, 1.0, 1.0, 1.0))}
    if isinstance(made.slope, Ref):
        wired = {"slope": made.slope, "metric_map": made.site("metric")}
        normal = [Draw(NormalMapValues(skin.extent if flat else 0.0))]
        nodes.append(NormalMap("normal_map", size, normal, wired))
        sources["normal"] = Ref("normal_map", "normal")
    if isinstance(made.maps["height"], Ref):
        wired = {"height": made.maps["height"], "site_normal": made.site("normal")}
        footprint = skin.extent / skin.size if flat else 0.0
        openness = [Draw(CavityValues(footprint, skin.cavity_radius, int(skin.tileable)))]
        nodes.append(Cavity("cavity_map", size, openness, wired, defines=cavity.DEFINES))
        sources["cavity"] = Ref("cavity_map", "cavity")
    return nodes, sources


@dataclass(frozen=True)
class Order:
    """What is to be written, and how.

    Parameters
    ----------
    maps : keys of `skincli.mapset.MAPS`
    encoding, naming, convention : see `skincli.mapset`
    """

    maps: tuple[str, ...] = DEFAULT
    encoding: Encoding = field(default_factory=Encoding)
    naming: Naming = "skincli"
    convention: Convention = "opengl"

    @property
    def steps(self) -> int:
        """How many steps there are to tell of: the maps are generated at once and written one by one."""
        return 1 + len(self.maps)

    def files(self, folder: Path, name: str) -> dict[str, Path]:
        """Return the file of each map."""
        return {
            kind: folder / mapset.file_name(kind, self.encoding.fit(MAPS[kind]), self.naming, name, self.convention)
            for kind in self.maps
        }


@dataclass(frozen=True)
class Written:
    """What was written.

    Parameters
    ----------
    arrays : the maps, see `generate`
    files : the manifest last: where it stands, the others are whole
    manifest : what it says
    """

    arrays: Mapping[str, Array]
    files: Sequence[Path]
    manifest: mapset.Manifest


def write_maps(
    folder: Path,
    skin: Skin,
    name: str,
    order: Order = Order(),
    ground: Ground = Ground(),
    told: Callable[[], None] = lambda: None,
) -> Written:
    """Generate a skin's maps and write them with their manifest.

    Parameters
    ----------
    folder : made when missing
    skin : the description
    name : what the skin is called in the manifest
    order : which maps, and how they are written
    ground : what they lie on
    told : called after each of `order.steps`

    Raises
    ------
    OutputError : a file cannot be written
    LimitError : see `generate`
    """
    files = order.files(folder, name)
    manifest = folder / mapset.MANIFEST
    for file in (*files.values(), manifest):
        images.require_writable(file)
    arrays = generate(skin, order.maps, ground)
    told()
    # An old manifest must not vouch for new maps, should what follows be interrupted.
    manifest.unlink(missing_ok=True)
    entries = {}
    for kind, file in files.items():
        entries[kind] = mapset.write_map(file, kind, arrays[kind], order.encoding, order.convention)
        told()
    description = mapset.Manifest(
        skin=name,
        about=skin.about,
        size=skin.size,
        extent_mm=skin.extent if ground.mesh is None else None,
        tileable=skin.tileable,
        seed=skin.seed,
        versions={package: version(package) for package in PACKAGES}
        | {"driver": "{renderer}, {version}".format(**device_info())},
        maps=entries,
        optics=skin.optics.model_dump(mode="json", exclude_unset=True),
        surface=skin.surface.model_dump(mode="json", exclude_unset=True),
    )
    return Written(arrays, (*files.values(), mapset.write_manifest(folder, description)), description)
