"""The whole scene, handed to a volumetric path tracer: Mitsuba 3, an optional extra of the installation.

What it computes is the light that skin as a participating medium scatters back, without any of the shortcuts of the
passes. Each part of the mesh is filled with one uniform medium that follows from its skin's `optics`; texture layers,
bumps and the factors of `surface` do not enter. Parts without a skin are opaque and diffuse in the mesh file's color.
Ambient light and the environment shine from all around, but are not seen themselves: where no mesh is, the picture is
the scene's background, or transparent, and what passes straight through skin counts as background too.

The mesh must be closed, and parts must not lie within each other: in here a ray is in one medium or in none.
"""

from __future__ import annotations

import importlib
import itertools
import logging
import math
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skincli import images
from skincli.color import srgb_decode
from skincli.errors import DeviceError, InputError, UsageError, did_you_mean
from skincli.mesh import surface
from skincli.mesh.model import Material, Mesh
from skincli.optics.diffusion import burley_width
from skincli.reference import rays
from skincli.reference.rays import METER, Floats, Panorama
from skincli.scene.model import Camera, Light, PointLight, Scene, SpotLight
from skincli.scene.skin import Optics

VARIANTS = ("llvm_ad_rgb", "scalar_rgb")
"""Kinds of Mitsuba, in the order in which they are tried. The first compiles for this processor."""

PROBE_SECONDS = 300
"""How long the trial of a variant may take; seconds are usual."""

PASSES = 16
"""Independent pictures of which the spread tells the error."""

FEWEST_PASSES = 4
"""Before so many, a wanted error may be met by luck."""

ROULETTE_DEPTH = 128
"""Scatterings before a path may be cut by chance. Mitsuba 3.9 leaves the roulette out of the weights of light that a
path hits by itself: at its default of 5 that costs 1 to 3 % of the light from all around, here nothing measurable."""

SKIPPED_SHARE = 0.02
"""Share of a mean free path that may be lost below the surface before a warning says so."""

TILES = (1, 2, 4, 8, 16)
"""Into how many tiles a side the picture may be cut, each traced about its own place, where less is lost."""

LANES = 1 << 22
"""Paths traced together: a few hundred MB."""

SPOT_TEXELS = 1024
"""Side of the picture that a fading spot projects: its falloff is linear between texels."""

# A small scene of all that can occur. A broken LLVM does not raise but aborts the process, so another one tries it.
PROBE = """
import sys
import mitsuba as mi
import numpy
mi.set_variant(sys.argv[1])
rgb = lambda r: {"type": "rgb", "value": [r, 0.5, 0.4]}
medium = {"type": "homogeneous", "albedo": rgb(0.9), "sigma_t": rgb(0.8)}
ball = {"type": "sphere", "interior": medium, "bsdf": {"type": "null"}}
rough = {**ball, "center": [3, 0, 0], "bsdf": {"type": "roughdielectric", "distribution": "ggx", "alpha": 0.4}}
film = {"type": "hdrfilm", "width": 4, "height": 4, "rfilter": {"type": "box"}}
eye = mi.ScalarTransform4f().look_at([0, 0, 9], [0, 0, 0], [0, 1, 0])
sensor = {"type": "perspective", "film": film, "to_world": eye}
scene = {"type": "scene", "integrator": {"type": "volpathmis"}, "sensor": sensor, "ball": ball, "rough": rough}
scene |= {"sky": {"type": "constant"}, "sun": {"type": "directional", "direction": [0, -1, 0]}}
numpy.array(mi.render(mi.load_dict(scene), spp=1))
"""

_log = logging.getLogger("skincli")


@dataclass(frozen=True)
class Medium:
    """A uniform medium that scatters alike to all sides.

    Parameters
    ----------
    sigma_a : (3,) 1/mm, >= 0, absorption
    sigma_s : (3,) 1/mm, >= 0, reduced scattering

    Raises
    ------
    InputError
        If the medium does nothing to the light of a channel.
    """

    sigma_a: tuple[float, ...]
    sigma_s: tuple[float, ...]

    def __post_init__(self) -> None:
        if not np.add(self.sigma_a, self.sigma_s).all():
            raise InputError(
                f"sigma_a is {list(self.sigma_a)} and sigma_s {list(self.sigma_s)} per mm; a medium must absorb or "
                "scatter each color; give both above 0"
            )

    @classmethod
    def of(cls, optics: Optics) -> Medium:
        """Return the medium that looks like a skin's color and scatters as far as its radius says.

        Notes
        -----
        The albedo of single scattering is 1 - s², in which s inverts the reflectance of a half space in the form that
        OpenPBR gives it [OpenPBR2024, VanDeHulst1980]. A radius of kind `mfp` is the mean free path, the inverse of
        sigma_a + sigma_s; for the other kinds it is the mean free path whose profile has the same width, by the fits of
        [Christensen2015]. Scattering is reduced: a skin that scatters forward is replaced by its isotropic equal.
        """
        color = np.array(optics.color)
        root = np.sqrt(9.59217 + 41.6808 * color + 17.7126 * color**2)
        # Towards white the difference of two large numbers is rounding.
        s = np.clip(4.09712 + 4.20863 * color - root, 0.0, 1.0)
        width = burley_width(optics.radius, optics.color, optics.radius_kind)
        extinction = burley_width((1.0, 1.0, 1.0), optics.color, "mfp") / width
        return cls(tuple(map(float, extinction * s**2)), tuple(map(float, extinction * (1 - s**2))))


@dataclass(frozen=True)
class Stuff:
    """What a part of the mesh is made of.

    Parameters
    ----------
    medium : fills it; None where it is opaque
    alpha : roughness of a dielectric boundary, GGX
    material : color of an opaque part
    """

    medium: Medium | None
    alpha: float = 0.5
    material: Material | None = None

    @classmethod
    def skin(cls, medium: Medium, shininess: float) -> Stuff:
        """Return a medium under a surface as rough as a Phong exponent says, alpha² = 2 / (n + 2)."""
        return cls(medium, math.sqrt(2 / (shininess + 2)))


@dataclass(frozen=True)
class Converged:
    """A path-traced picture and how far it is from the truth.

    Parameters
    ----------
    beauty : (h, w, 4) float32, linear Rec.709, premultiplied, top row first; alpha is the share that the mesh fills
    error : (h, w, 3) float32, standard error of each value
    relative_rmse : root mean square of the standard errors over that of the picture, inside the silhouette
    skipped : share of the shortest mean free path that Mitsuba leaves out below the surface, the mean over the pixels;
        about as much, at most, is missing from the color that scatters most, which no number of paths makes good
    spp : paths per pixel that were traced, the mean over the tiles of the picture
    seconds : wall time of the passes
    variant : of Mitsuba
    versions : of Mitsuba and what it compiles with
    """

    beauty: NDArray[np.float32]
    error: NDArray[np.float32]
    relative_rmse: float
    skipped: float
    spp: int
    seconds: float
    variant: str
    versions: Mapping[str, str]


@dataclass(frozen=True)
class Tracer:
    """Mitsuba, ready to trace.

    Parameters
    ----------
    mi : the module
    variant : to which it has been set
    """

    mi: Any
    variant: str


def load(variant: str | None = None) -> Tracer:
    """Return Mitsuba, in a variant that has been tried on this machine.

    Parameters
    ----------
    variant : one that computes with "rgb"; None: the first of `VARIANTS` that works on this machine

    Raises
    ------
    DeviceError
        If Mitsuba is not installed, or the variant that is asked for does not work here.
    UsageError
        If there is no such variant.
    """
    try:
        mi: Any = importlib.import_module("mitsuba")
    except ImportError as error:
        raise DeviceError(
            f"skincli reference needs Mitsuba 3 ({error}); install it with: pip install 'skincli[reference]'"
        ) from None
    known = [name for name in mi.variants() if name.endswith("_rgb")]
    if variant is not None and variant not in known:
        raise UsageError(
            f"Mitsuba has no variant '{variant}' for this{did_you_mean(variant, known)}; choose {', '.join(known)}"
        )
    for name in [variant] if variant is not None else VARIANTS:
        trouble = _trouble(name)
        if trouble is None:
            mi.set_variant(name)
            mi.set_log_level(mi.LogLevel.Error)
            return Tracer(mi, name)
        found = f"Mitsuba's variant {name} does not work here ({trouble})"
        if name == VARIANTS[-1]:
            raise DeviceError(f"{found}; install Mitsuba again")
        remedy = f"{found}; DRJIT_LIBLLVM_PATH may name an LLVM above 15" if name.startswith("llvm") else found
        if name == variant:
            raise DeviceError(f"{remedy}; or choose --variant {VARIANTS[-1]}")
        _log.warning("%s; the slower %s is used", remedy, VARIANTS[-1])
    raise AssertionError("the last variant works or raises")


def _trouble(variant: str) -> str | None:
    """Return what keeps a variant from working, None if nothing does; found out by another process."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", PROBE, variant], capture_output=True, text=True, timeout=PROBE_SECONDS, check=False
        )
    except subprocess.TimeoutExpired:
        return f"a picture of 16 pixels took more than {PROBE_SECONDS} s"
    if done.returncode == 0:
        return None
    last = (done.stderr.strip().splitlines() or ["no message"])[-1]
    return f"it ended with signal {-done.returncode}" if done.returncode < 0 else last


def render(
    scene: Scene,
    mesh: Mesh,
    camera: Camera,
    stuff: Sequence[Stuff],
    *,
    tracer: Tracer,
    spp: int,
    max_error: float = 0.0,
    ior: float | None = None,
    seed: int = 0,
) -> Converged:
    """Trace a scene until it has converged.

    Parameters
    ----------
    scene : its lights, ambient, environment, background and picture size are used
    mesh : closed
    camera : the scene's, or one that stands for it
    stuff : for each part of the mesh
    tracer : see `load`
    spp : paths per pixel at most, >= 2
    max_error : the `Converged.relative_rmse` at which to stop earlier
    ior : above 1, of a rough dielectric boundary, with highlights and Fresnel reflection from both sides; None: the
        boundary is matched, neither reflects nor bends: the diffuse light alone, to which a skin's color refers
    seed : of all random numbers, >= 0

    Raises
    ------
    DeviceError
        If the ray tracer for the silhouette is not installed.
    InputError
        If the camera does not see the mesh, a light is negative, or the environment cannot be read.

    Notes
    -----
    The integrator is volpathmis (Miller, Georgiev and Jarosz 2019, "A null-scattering path integral formulation of
    light transport"). It traces independent passes, whose spread tells the standard error of their mean.

    A rough dielectric is many times noisier than a matched boundary. As light between its microfacets is left
    out, it is too dark, the more the rougher and whiter: a white ball of alpha 0.3 and ior 1.4 returns 73 %.
    """
    _require_possible(scene)
    _warn_of_holes(mesh)
    size = (scene.render.size[0], scene.render.size[1])
    covered = rays.coverage(mesh, camera, size)
    # Pixels at the edge of the silhouette count where there are no others.
    mask = covered >= min(1.0, float(covered.max()))
    if not covered.any():
        raise InputError("the camera does not see the mesh; move it, or leave camera out to frame the whole mesh")
    mi = tracer.mi
    tiles, skipped = _tiles(mi, mesh, camera, covered, stuff)
    mean, error = np.zeros((2, size[1], size[0], 3))
    start = time.perf_counter()
    paths = 0
    for number, tile in enumerate(tiles):
        traced = mi.load_dict(_description(mi, scene, mesh, camera, stuff, ior, tile))
        here = mask[tile.rows, tile.columns]
        here = here if here.any() else covered[tile.rows, tile.columns] > 0
        found, spread, each = _traced(mi, traced, here, spp, max_error, seed + number * spp)
        mean[tile.rows, tile.columns], error[tile.rows, tile.columns] = found, spread
        paths += each * here.size
        _log.info(
            "tile %d of %d: %d paths per pixel, %.3g left", number + 1, len(tiles), each, _relative(spread, found)
        )
    relative = _relative(error[mask], mean[mask])
    beauty = np.concatenate([mean, covered[..., None]], axis=2)
    if scene.background is not None:
        beauty += np.append(scene.background, 1.0) * (1 - covered)[..., None]
    return Converged(
        beauty.astype(np.float32),
        error.astype(np.float32),
        relative,
        skipped,
        round(paths / sum(covered[tile.rows, tile.columns].size for tile in tiles)),
        time.perf_counter() - start,
        tracer.variant,
        {"mitsuba": mi.__version__, "drjit": importlib.import_module("drjit").__version__},
    )


@dataclass(frozen=True)
class _Tile:
    """A part of the picture, and the point, mm relative to the mesh's origin, about which it is traced."""

    rows: slice
    columns: slice
    origin: Floats


def _tiles(mi: Any, mesh: Mesh, camera: Camera, covered: Floats, stuff: Sequence[Stuff]) -> tuple[list[_Tile], float]:
    """Return the tiles that show the mesh, as few as will do, and `Converged.skipped`, with a warning where it is much.

    Rays that enter start a little below the surface, lest they hit it again; how far grows with the coordinates.
    """
    media = [made_of.medium for made_of in stuff if made_of.medium is not None]
    extinction = max((float(np.add(medium.sigma_a, medium.sigma_s).max()) for medium in media), default=0.0)
    hits = rays.first_hits(mesh, camera, covered.shape[::-1])
    hit = np.isfinite(hits[..., 0])
    away = np.linalg.norm(hits[hit] + mesh.origin - camera.position, axis=1).max(initial=0.0)
    pixel = 2 * math.tan(math.radians(camera.fov) / 2) / len(hits) * away
    tiles: list[_Tile] = []
    for side in TILES:
        tiles, depth = [], np.zeros(hit.shape)
        for rows, columns in itertools.product(_slices(hits.shape[0], side), _slices(hits.shape[1], side)):
            if not covered[rows, columns].any():
                continue
            # A tile of which no pixel's middle shows the mesh shows its edge: any place nearby will do.
            seen = hits[rows, columns][hit[rows, columns]] if hit[rows, columns].any() else hits[hit]
            low, high = (seen.min(axis=0), seen.max(axis=0)) if len(seen) else np.zeros((2, 3))
            tiles.append(_Tile(rows, columns, 0.5 * (low + high)))
            off = np.abs(hits[rows, columns] - tiles[-1].origin).max(axis=2)
            depth[rows, columns] = mi.math.RayEpsilon * (1 + off + 0.5 * pixel)
        mean = float(depth[hit].mean()) if hit.any() else 0.0
        if mean * extinction <= SKIPPED_SHARE:
            return tiles, mean * extinction
    _log.warning(
        "Mitsuba starts paths %.2g mm below the surface, %.0f %% of the shortest mean free path; the color that "
        "scatters most comes out darker by up to that", mean, 100 * mean * extinction,
    )  # fmt: skip
    return tiles, mean * extinction


def _slices(count: int, parts: int) -> list[slice]:
    """Return `count` rows cut into about equal parts, none of them empty."""
    cuts = np.unique(np.linspace(0, count, parts + 1).astype(int)).tolist()
    return [slice(*pair) for pair in itertools.pairwise(cuts)]


def _traced(
    mi: Any, traced: Any, mask: NDArray[np.bool_], spp: int, max_error: float, seed: int
) -> tuple[Floats, Floats, int]:
    """Return (h, w, 3) means and standard errors of a tile, and how many paths per pixel they took."""
    each = max(1, min(spp // PASSES, LANES // mask.size))
    mean, squares, error = np.zeros((3, *mask.shape, 3))
    for number in range(1, spp // each + 1):
        picture = np.array(mi.render(traced, spp=each, seed=seed + number), dtype=np.float64)
        step = picture - mean
        mean += step / number
        squares += step * (picture - mean)
        error = np.sqrt(squares / (number * max(number - 1, 1)))
        # Where no light has been found, some may yet be.
        if number >= FEWEST_PASSES and mean[mask].any() and _relative(error[mask], mean[mask]) <= max_error:
            break
    return mean, error, number * each


def write(path: images.StrPath, found: Converged) -> None:
    """Write the layers "beauty" and "error", both float, into one EXR file.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    layers = {"beauty": images.straight(found.beauty), "error": found.error}
    about: dict[str, str | int | float] = {
        "spp": found.spp,
        "relative_rmse": found.relative_rmse,
        "skipped": found.skipped,
        "variant": found.variant,
        **found.versions,
    }
    images.write_exr(path, layers, half=False, attributes={f"skincli:{key}": value for key, value in about.items()})


def _relative(error: Floats, mean: Floats) -> float:
    """Return root mean square over root mean square, as `skincli.metrics.relative_rmse`."""
    power = float(np.sum(mean**2))
    return math.sqrt(float(np.sum(error**2)) / power) if power > 0 else 0.0


def _require_possible(scene: Scene) -> None:
    """Refuse light that takes light away, of which no path can be traced."""
    colors = [light.irradiance if light.type == "directional" else light.intensity for light in scene.lights]
    for number, color in enumerate(colors):
        if min(color) < 0:
            raise InputError(f"lights[{number}] is {list(color)}; a path tracer needs 0 or more; remove or change it")


def _warn_of_holes(mesh: Mesh) -> None:
    """Log a warning where light could get into the medium through a hole."""
    _, point = np.unique(mesh.positions, axis=0, return_inverse=True)
    edges = len(surface.border_edges(point.reshape(-1)[mesh.faces]))
    if edges:
        _log.warning("the mesh is not closed (%d edges have one face); light goes in and out there", edges)


# ---------------------------------------------------------------------------------------- the scene in Mitsuba's terms


def _rgb(values: Sequence[float] | Floats) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(value) for value in values]}


def _description(
    mi: Any, scene: Scene, mesh: Mesh, camera: Camera, stuff: Sequence[Stuff], ior: float | None, tile: _Tile
) -> dict[str, Any]:
    """Return a tile of the scene for `load_dict`, all positions relative to the tile's origin."""
    origin = mesh.origin + tile.origin
    position, target = np.array(camera.position) - origin, np.array(camera.target) - origin
    film = {
        "type": "hdrfilm",
        "width": scene.render.size[0],
        "height": scene.render.size[1],
        "crop_offset_x": tile.columns.start,
        "crop_offset_y": tile.rows.start,
        "crop_width": tile.columns.stop - tile.columns.start,
        "crop_height": tile.rows.stop - tile.rows.start,
        "pixel_format": "rgb",
        "component_format": "float32",
        # No path counts in two pixels, so their errors are independent.
        "rfilter": {"type": "box"},
    }
    reach = float(np.linalg.norm(position)) + float(np.linalg.norm(mesh.positions - tile.origin, axis=1).max())
    description: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "volpathmis", "rr_depth": ROULETTE_DEPTH, "hide_emitters": True},
        "sensor": {
            "type": "perspective",
            "fov": camera.fov,
            "fov_axis": "y",
            "near_clip": reach * 1e-6,
            "far_clip": reach * 2,
            "to_world": mi.ScalarTransform4f().look_at(position.tolist(), target.tolist(), list(camera.up)),
            "film": film,
        },
    }
    for number, light in enumerate(scene.lights):
        description[f"light{number}"] = _light(mi, light, origin)
    surroundings = _surroundings(mi, scene)
    if surroundings is not None:
        description["surroundings"] = surroundings
    for number, (part, made_of) in enumerate(zip(mesh.parts, stuff, strict=True)):
        description[f"part{number}"] = _shape(mi, mesh, slice(part.start, part.stop), made_of, ior, tile.origin)
    return description


def _light(mi: Any, light: Light, origin: Floats) -> dict[str, Any]:
    if light.type == "directional":
        return {"type": "directional", "direction": list(light.direction), "irradiance": _rgb(light.irradiance)}
    # Radiant intensity is irradiance times squared distance, and the unit of length is the millimeter.
    intensity = _rgb(np.array(light.intensity) * METER**2)
    position = np.array(light.position) - origin
    if isinstance(light, PointLight):
        return {"type": "point", "position": position.tolist(), "intensity": intensity}
    direction = np.array(light.direction) / np.linalg.norm(light.direction)
    side = np.eye(3)[np.argmin(np.abs(direction))]
    spot = {
        "type": "spot",
        "intensity": intensity,
        "cutoff_angle": light.angle / 2,
        # Its own falloff is another one: it is kept out, but for a step too small to divide by zero.
        "beam_width": light.angle / 2 * (1 - 1e-6),
        "to_world": mi.ScalarTransform4f().look_at(position.tolist(), (position + direction).tolist(), side.tolist()),
    }
    if light.blend > 0:
        spot["texture"] = {"type": "bitmap", "bitmap": mi.Bitmap(_projected(light)), "raw": True}
    return spot


def _projected(light: SpotLight) -> NDArray[np.float32]:
    """Return the picture (n, n, 3) that a spot throws on a plane before it, the cone's edge touching its border."""
    at = ((np.arange(SPOT_TEXELS) + 0.5) / SPOT_TEXELS * 2 - 1) * math.tan(math.radians(light.angle) / 2)
    share = rays.spot_falloff(light, 1 / np.sqrt(1 + at[:, None] ** 2 + at**2))
    return np.repeat(share[..., None], 3, axis=2).astype(np.float32)


def _surroundings(mi: Any, scene: Scene) -> dict[str, Any] | None:
    """Return ambient light and environment as one emitter, for there can be no two; None where both are dark."""
    if scene.environment is None:
        return {"type": "constant", "radiance": _rgb(scene.ambient)} if any(scene.ambient) else None
    panorama = Panorama.of(scene.environment)
    image = np.maximum(panorama.image + np.array(scene.ambient), 0.0)
    # There the first and last row lie at the poles, here half a row away from them. With a row between each two
    # and one beyond either end, both interpolate the same values.
    padded = np.concatenate([image[:1], image, image[-1:]])
    rows = np.empty((2 * len(image) + 1, *image.shape[1:]))
    rows[1::2] = image
    rows[::2] = 0.5 * (padded[1:] + padded[:-1])
    # There the middle of an unturned picture is +Z.
    turned = mi.ScalarTransform4f().rotate([0, 1, 0], 180 + panorama.rotation)
    return {"type": "envmap", "bitmap": mi.Bitmap(rows.astype(np.float32)), "to_world": turned}


def _shape(mi: Any, mesh: Mesh, faces: slice, made_of: Stuff, ior: float | None, origin: Floats) -> Any:
    """Return a part of the mesh, about a point of it, as a shape."""
    used, corners = np.unique(mesh.faces[faces], return_inverse=True)
    properties = mi.Properties()
    # What neither bends nor reflects has no use for normals.
    plain = made_of.medium is not None and ior is None
    if made_of.medium is None:
        properties["surface"] = mi.load_dict({"type": "diffuse", "reflectance": _color(mi, made_of.material)})
    else:
        properties["interior"] = mi.load_dict(_medium(made_of.medium))
        rough = {
            "type": "roughdielectric",
            "distribution": "ggx",
            "alpha": made_of.alpha,
            "int_ior": ior,
            "ext_ior": 1.0,
        }
        properties["surface"] = mi.load_dict({"type": "null"} if plain else rough)
    shape = mi.Mesh(
        "part", len(used), len(corners.reshape(-1, 3)), has_vertex_normals=not plain, has_vertex_texcoords=not plain,
        props=properties,
    )  # fmt: skip
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = (mesh.positions[used] - origin).astype(np.float32).ravel()
    parameters["faces"] = corners.astype(np.uint32).ravel()
    if not plain:
        parameters["vertex_normals"] = mesh.normals[used].astype(np.float32).ravel()
        # Pictures are top row first there, and v grows downward.
        parameters["vertex_texcoords"] = (mesh.uv[used] * [1, -1] + [0, 1]).astype(np.float32).ravel()
    parameters.update()
    return shape


def _medium(medium: Medium) -> dict[str, Any]:
    extinction = np.add(medium.sigma_a, medium.sigma_s)
    # Colors beyond 1 are refused, a factor is not.
    scale = float(extinction.max())
    return {
        "type": "homogeneous",
        "albedo": _rgb(np.array(medium.sigma_s) / extinction),
        "sigma_t": _rgb(extinction / scale),
        "scale": scale,
    }


def _color(mi: Any, material: Material | None) -> dict[str, Any]:
    material = material or Material()
    if material.base_color_image is None:
        return _rgb(np.clip(material.base_color, 0.0, 1.0))
    linear = srgb_decode(material.base_color_image[..., :3] / 255.0) * np.array(material.base_color)
    return {"type": "bitmap", "bitmap": mi.Bitmap(np.clip(linear, 0.0, 1.0).astype(np.float32)), "raw": True}
