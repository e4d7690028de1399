"""The cases of `skincli bench --stress`: every number a person may write at the ends of its range, and beyond them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from skincli import images
from skincli.bench.scene import STAGE_SCENE, load, ring
from skincli.bench.stages import SHADINGS
from skincli.errors import InputError, LimitError, SkincliError
from skincli.graph.frame_graph import FrameGraph
from skincli.graph.node import Draw, Load, Ref
from skincli.mesh.model import Mesh
from skincli.passes.display import Display, DisplayValues
from skincli.passes.occlusion import Occlusion, OcclusionValues
from skincli.pipeline import Pipeline, load_scene_mesh

Floats = NDArray[np.float64]
Make = Callable[[Path], FrameGraph]

#: small enough that the whole suite takes a minute or two in software
SMALL = ("render.size=[96, 72]", "render.atlas=128", "skin.size=64", "parts.left.skin.size=32")

#: the side up to which pictures and atlases are held to work
LARGE = 8192


@dataclass(frozen=True)
class Refusal:
    """The error with which a case has to end.

    Parameters
    ----------
    error : its class, which has the exit code
    says : part of its message
    always : False where only some machines refuse, for want of memory
    """

    error: type[SkincliError]
    says: str
    always: bool = True


@dataclass(frozen=True)
class Case:
    """A scene at some extreme.

    Parameters
    ----------
    group : what varies
    name : to which value
    make : the graph to run; its folder is empty and lives until the case is over
    refused : the error it ends with; None where it has to render
    faint : how much fainter than usual the light is, and with it what counts as an error
    like : the case whose picture this one has to repeat
    lean : whether only what the picture needs is run and no twin is asked, since the targets are large
    """

    group: str
    name: str
    make: Make
    refused: Refusal | None = None
    faint: float = 1.0
    like: Case | None = None
    lean: bool = False


# -- ways to a graph -------------------------------------------------------------------------------------------------


def _ring(*sets: str, change: Callable[[Mesh], Mesh] = lambda mesh: mesh, lean: bool = False) -> Make:
    """Return what renders the ring of skincli.bench.scene, changed in memory."""

    def make(folder: Path) -> FrameGraph:
        return Pipeline(load(folder, STAGE_SCENE, *SMALL, *sets), change(ring(48, 24)), skip=lean).graph

    return make


@dataclass(frozen=True)
class Obj:
    """What a coarse ring's OBJ file says, in the file's unit; one uv and one normal per position.

    Parameters
    ----------
    positions, uv, normals : (n, 3), (n, 2), (n, 3)
    faces : (m, 3) from 0
    """

    positions: Floats
    uv: Floats
    normals: Floats
    faces: NDArray[np.int32]

    @classmethod
    def of_ring(cls) -> Obj:
        """Return the ring with the uv in which its light is computed."""
        mesh = ring(32, 16)
        return cls(mesh.positions, mesh.atlas_uv, mesh.normals, mesh.faces)

    def write(self, path: Path) -> None:
        """Write the file, its halves as the objects "right" and "left"."""
        lines = [
            f"{kind} {' '.join(map(repr, row))}"
            for kind, table in (("v", self.positions), ("vt", self.uv), ("vn", self.normals))
            for row in table.tolist()
        ]
        half = len(self.faces) // 2
        for name, faces in (("right", self.faces[:half]), ("left", self.faces[half:])):
            lines.append(f"o {name}")
            lines += ["f " + " ".join(f"{i}/{i}/{i}" for i in face) for face in (faces + 1).tolist()]
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _file(*sets: str, change: Callable[[Obj], Obj] = lambda obj: obj, unit: float = 1.0) -> Make:
    """Return what writes the ring into a file, changed, and renders that."""

    def make(folder: Path) -> FrameGraph:
        change(Obj.of_ring()).write(folder / "ring.obj")
        loaded = load(folder, STAGE_SCENE, *SMALL, f"mesh={{file: ring.obj, unit: {unit!r}}}", *sets)
        return Pipeline(loaded, load_scene_mesh(loaded, use_cache=False), skip=False).graph

    return make


def _with_picture(picture: Floats, *sets: str) -> Make:
    """Return what renders the ring beside a picture, extreme.exr: an environment or the source of a layer."""
    rendered = _ring(*sets)

    def make(folder: Path) -> FrameGraph:
        images.write_exr(folder / "extreme.exr", {"beauty": picture.astype(np.float32)}, half=False)
        return rendered(folder)

    return make


def _given(name: str, values: Floats) -> Load:
    """Return a node that gives a single pass (h, w) numbers to work on, in all three colors."""
    image = np.stack([values, values, values, np.ones_like(values)], axis=-1)
    return Load(name, name, lambda: [image], "rgba32f")


# -- the cases, by what varies ---------------------------------------------------------------------------------------


def _rgb(value: float) -> str:
    return f"[{value!r}, {value!r}, {value!r}]"


def _lit(value: float) -> tuple[str, ...]:
    """Return the settings that give all three lights one brightness, and leave no other light on the skin."""
    lights = (f"lights[0].irradiance={_rgb(value)}", *(f"lights[{i}].intensity={_rgb(value)}" for i in (1, 2)))
    return (*lights, "ambient=[0.0, 0.0, 0.0]")


def _point(position: Floats | tuple[float, ...], value: float) -> str:
    return f"{{type: point, position: {list(map(float, position))}, intensity: {_rgb(value)}}}"


def _lights() -> Iterator[Case]:
    for value, shading in product((1e-12, 1e-6, 1e6, 1e12, -1.0, -1e12), SHADINGS):
        faint = min(abs(value), 1.0)
        yield Case("light", f"{value:g}, {shading}", _ring(*_lit(value), f"render.shading={shading}"), faint=faint)
    for value in (1e13, -1e13, float("inf"), float("nan")):
        written = {"inf": ".inf", "nan": ".nan"}.get(str(value), repr(value))
        setting = f"lights[0].irradiance=[1.0, {written}, 1.0]"
        yield Case("light", f"{value:g}", _ring(setting), Refusal(InputError, "lights[0].irradiance"))
    yield Case("light", "none", _ring("lights=[]"))
    yield Case("light", "none, no ambient, no environment", _ring("lights=[]", *_DARK))
    angles = np.arange(64) * (2 * np.pi / 64)
    around = [_point((300 * np.sin(a), 50 * np.cos(5 * a), 300 * np.cos(a)), 0.02) for a in angles]
    for shading in SHADINGS:
        yield Case("light", f"64, {shading}", _ring(f"lights=[{', '.join(around)}]", f"render.shading={shading}"))
    at = ring(48, 24).positions[300]
    yield Case("light", "point on a vertex", _ring(f"lights=[{_point(at, 1e-3)}]"))
    yield Case("light", "point on a vertex, 1e12, 64 EV", _ring(f"lights=[{_point(at, 1e12)}]", "camera.exposure=64.0"))
    yield Case("light", "point 1e9 mm away", _ring(f"lights=[{_point((1e9, 1e9, 1e9), 1e12)}]"), faint=1e-6)
    aim = at - [80.0, 260.0, 120.0]
    for angle, blend in product((0.01, 0.3, 1.0, 10.0, 179.99), (0.0, 0.3, 1.0)):
        spot = f"type: spot, position: [80, 260, 120], direction: {aim.tolist()}, angle: {angle}, blend: {blend}"
        made = _ring(f"lights=[{{{spot}, intensity: [1, 1, 1]}}]", *_DARK)
        yield Case("light", f"spot of {angle:g} degrees, blend {blend:g}", made)
    made = _ring("lights[0].direction=[0.0, -1e-11, -1e-11]", "lights[2].direction=[-3e8, -9e8, -4e8]")
    yield Case("light", "directions of length 1e-11 and 1e9", made)
    yield Case("light", "direction of length 0", _ring("lights[0].direction=[0, 0, 0]"), Refusal(InputError, "zero"))
    for ev in (-64.0, 64.0):
        for display in ("neutral", "srgb"):
            sets = f"camera.exposure={ev}", f"render.display={display}"
            yield Case("light", f"exposure {ev:g} EV, {display}", _ring(*_lit(1e12), *sets))
    factors = [f"skin.surface.{name}=1000.0" for name in ("ambient", "diffuse", "specular")]
    yield Case("light", "1e12 on factors of 1000", _ring(*_lit(1e12), *factors))


_DARK = ("ambient=[0, 0, 0]", "environment=null")


def _kernels() -> Iterator[Case]:
    for width in (0.0, 1e-6, 0.5, 1.0, 1.5, 2.0, 127.0, 128.0, 256.0):
        sets = f"skin.surface.blur={width}", "render.shading=paper"
        yield Case("kernel", f"{width:g} of 128 texels", _ring(*sets))
    for width in (-1.0, 257.0):
        yield Case("kernel", f"{width:g}", _ring(f"skin.surface.blur={width}"), Refusal(InputError, "surface.blur"))
    for radius in (1e-12, 0.01, 0.1, 1.0, 30.0):
        yield Case("kernel", f"scattering radius {radius:g} mm", _ring(f"skin.optics.radius={_rgb(radius)}"))
    yield Case("kernel", "radii of 1e-12, 1 and 30 mm", _ring("skin.optics.radius=[1e-12, 1.0, 30.0]"))
    for radius in (0.0, -1.0, 1001.0):
        setting = f"skin.optics.radius=[1.0, {radius}, 1.0]"
        yield Case("kernel", f"scattering radius {radius:g} mm", _ring(setting), Refusal(InputError, "optics.radius"))
    for color in (0.0, 1.0):
        yield Case("kernel", f"scattering color {color:g}", _ring(f"skin.optics.color={_rgb(color)}"))


def _bumps() -> Iterator[Case]:
    for value, shading in product((0.0, 1e-6, 1.0, 1000.0), SHADINGS):
        sets = f"skin.surface.bumpiness={value}", f"render.shading={shading}"
        yield Case("bumpiness", f"{value:g}, {shading}", _ring(*sets))
    for value in (-1.0, 1e6):
        setting = f"skin.surface.bumpiness={value}"
        yield Case("bumpiness", f"{value:g}", _ring(setting), Refusal(InputError, "surface.bumpiness"))


def _equation_1() -> Iterator[Case]:
    high, low = np.meshgrid(*[[0.0, 1e-30, 1e-3, 1.0]] * 2)

    def alone(a: float, b: float, _: Path) -> FrameGraph:
        bands = {"occlusion_high": _given("high", high), "occlusion_low": _given("low", low)}
        wired = {name: Ref(band.name, "image") for name, band in bands.items()}
        node = Occlusion("occlusion", high.shape, [Draw(OcclusionValues(a, b))], wired)
        return FrameGraph([*bands.values(), node], skip=False)

    for a, b in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 2.42), (1e-6, 0.0), (1e-6, 1e3), (1e3, 1e3)):
        yield Case("Equation 1", f"a {a:g}, b {b:g}, bands of 0 to 1", partial(alone, a, b))
    for a, b in ((1e-6, 0.0), (0.0, 1e3), (1e-30, 1e3)):
        yield Case("Equation 1", f"a {a:g}, b {b:g}", _ring(f"render.occlusion.a={a}", f"render.occlusion.b={b}"))
    off = "render.effects.occlusion_high=false", "render.effects.occlusion_low=false"
    yield Case("Equation 1", "both bands off", _ring(*off))
    for a, b in ((0.0, 0.0), (-1.0, 2.0), (1e-7, 0.0)):
        sets = f"render.occlusion.a={a}", f"render.occlusion.b={b}"
        yield Case("Equation 1", f"a {a:g}, b {b:g}", _ring(*sets), Refusal(InputError, "render.occlusion"))
    for radius in (1e-6, 1e6):
        sets = f"render.occlusion.radius_high={radius}", f"render.occlusion.radius_low={radius}"
        yield Case("Equation 1", f"radii of {radius:g} mm", _ring(*sets))
    yield Case("Equation 1", "samples in a sphere", _ring("render.occlusion.samples=sphere"))


def _surfaces() -> Iterator[Case]:
    for value in (0.0, 1.0):
        yield Case("reflectance", f"{value:g}", _ring(f"skin.surface.reflectance={value}"))
    for value in (-0.1, 1.1):
        setting = f"skin.surface.reflectance={value}"
        yield Case("reflectance", f"{value:g}", _ring(setting), Refusal(InputError, "surface.reflectance"))
    for value in (0.0, 1e-6, 1e5):
        yield Case("shininess", f"{value:g}", _ring(f"skin.surface.shininess={value}"))
    for value in (0.0, 1.0):
        layers = f"skin.layers=[{{color: {{albedo: {_rgb(value)}, roughness: {value}}}}}]"
        yield Case("shininess", f"albedo and roughness {value:g}", _ring(layers))


def _units() -> Iterator[Case]:
    plain = Case("unit", "1", _file())

    def divided(unit: float, obj: Obj) -> Obj:
        return replace(obj, positions=obj.positions / unit)

    yield plain
    for unit in (1e-6, 1e-3, 1e3, 1e6):
        made = _file(change=partial(divided, unit), unit=unit)
        yield Case("unit", f"{unit:g}, the same size", made, like=plain)
    for unit in (1e-5, 1e4):
        made = _file("camera=null", "render.effects.blur=false", unit=unit)
        yield Case("unit", f"{unit:g}, 170 units wide", made)
    for unit in (1e-6, 1e6):
        refused = Refusal(InputError, "correct the mesh's unit")
        yield Case("unit", f"{unit:g}, 170 units wide", _file("camera=null", unit=unit), refused)
    for unit in (0.0, -1.0, 1e7):
        yield Case("unit", f"{unit:g}", _file(unit=unit), Refusal(InputError, "millimetres per unit"))
    # Everything that has a length, scaled together: the picture must not know.
    scaled = {scale: _file(*_all_lengths(scale), unit=scale) for scale in (1.0, 1e-4, 1e4)}
    whole = Case("unit", "the whole scene", scaled.pop(1.0))
    yield whole
    for scale, make in scaled.items():
        yield Case("unit", f"the whole scene times {scale:g}", make, like=whole)


def _all_lengths(scale: float) -> tuple[str, ...]:
    """Return the settings that scale the scene but for its mesh; layers and scattering have no such range."""
    at, spot, camera = ([scale * x for x in point] for point in ((-250, 150, 120), (80, 260, 120), (60, 210, 330)))
    return (
        f"camera.position={camera}",
        f"lights[1].position={at}",
        f"lights[1].intensity={_rgb(0.1 * scale**2)}",
        f"lights[2].position={spot}",
        f"lights[2].intensity={_rgb(0.3 * scale**2)}",
        f"render.occlusion.radius_high={4.0 * scale}",
        f"render.occlusion.radius_low={25.0 * scale}",
        "render.effects.blur=false",
        "skin.layers=[{color: {albedo: [0.7, 0.45, 0.35]}}]",
        "parts.left.skin.layers=[]",
    )


def _places() -> Iterator[Case]:
    here = Case("place", "origin", _file())

    def moved(by: float, obj: Obj) -> Obj:
        return replace(obj, positions=obj.positions + by)

    def at(*position: float, by: float) -> str:
        return str([x + by for x in position])

    yield here
    for by in (1e5, -1e7, 9e7, 1.1e8, 1.1e9):
        sets = (
            f"camera.position={at(60, 210, 330, by=by)}",
            f"camera.target={at(0, 0, 0, by=by)}",
            f"lights[1].position={at(-250, 150, 120, by=by)}",
            f"lights[2].position={at(80, 260, 120, by=by)}",
        )
        made = _file(*sets, change=partial(moved, by))
        name = f"{by:g} mm from the origin"
        if by < 1e8:
            yield Case("place", name, made, like=here)
        else:
            says = "up to 1e+08 mm are allowed" if by < 1e9 else "camera.position"
            yield Case("place", name, made, Refusal(InputError, says))


def _cameras() -> Iterator[Case]:
    mesh = ring(48, 24)
    point, normal = mesh.positions[300], mesh.normals[300]
    spots = {
        "inside the tube": ((0.0, 0.0, 60.0), (60.0, 0.0, 0.0)),
        "in the middle of the ring": ((0.0, 0.0, 0.0), (0.0, 5.0, 60.0)),
        "on a vertex": (tuple(point), (0.0, 0.0, 0.0)),
        "on a vertex, looking away": (tuple(point), tuple(point + normal)),
        "1e-3 mm above the surface": (tuple(point + 1e-3 * normal), tuple(point)),
        "1e-3 mm above the surface, grazing": (tuple(point + 1e-3 * normal), tuple(point + np.array([5.0, 1.0, 0.0]))),
        "1e4 mm away": ((3e3, 4e3, 8.7e3), (0.0, 0.0, 0.0)),
        "1e6 mm away": ((3e5, 4e5, 8.7e5), (0.0, 0.0, 0.0)),
        "1e9 mm away": ((3e8, 4e8, 8.7e8), (0.0, 0.0, 0.0)),
    }
    for name, (position, target) in spots.items():
        distance = float(np.linalg.norm(np.subtract(target, position)))
        fov = float(np.clip(np.degrees(2 * np.arctan(100 / distance)), 0.001, 90))
        sets = (f"camera.position={list(map(float, position))}", f"camera.target={list(map(float, target))}")
        yield Case("camera", name, _ring(*sets, f"camera.fov={fov}"))
    for fov in (0.001, 1.0, 90.0, 170.0, 179.999):
        yield Case("camera", f"fov {fov:g}", _ring(f"camera.fov={fov}"))
    for fov in (0.0, 180.0):
        yield Case("camera", f"fov {fov:g}", _ring(f"camera.fov={fov}"), Refusal(InputError, "camera.fov"))
    nowhere = _ring("camera.position=[1.0, 2.0, 3.0]", "camera.target=[1.0, 2.0, 3.0]")
    yield Case("camera", "target at its position", nowhere, Refusal(InputError, "looks nowhere"))
    upright = _ring("camera.position=[0, 300, 0]", "camera.target=[0, 0, 0]")
    yield Case("camera", "looking along its up", upright, Refusal(InputError, "along its own up"))


def _sizes() -> Iterator[Case]:
    for width, height in ((1, 1), (1, 72), (96, 1), (LARGE, 1), (1, LARGE), (3, 2)):
        yield Case("size", f"picture {width} x {height}", _ring(f"render.size=[{width}, {height}]"))
    for side in (1, 2, 3):
        for shading in SHADINGS:
            sets = f"render.atlas={side}", f"render.shading={shading}"
            yield Case("size", f"atlas {side}, {shading}", _ring(*sets))
        yield Case("size", f"maps {side}", _ring(f"skin.size={side}", f"parts.left.skin.size={side}"))
    yield Case("size", "all 1", _ring("render.size=[1, 1]", "render.atlas=1", "skin.size=1", "parts.left.skin.size=1"))
    yield Case("size", "picture 24 x 18, 4 x 4 samples", _ring("render.size=[24, 18]", "render.supersample=4"))
    memory = Refusal(LimitError, "", always=False)
    # No effect on these: software OpenGL would take minutes.
    plain = *(f"render.effects.{name}=false" for name in _EFFECTS), "environment=null", "lights=[]"
    for name, large in (("picture", f"render.size=[{LARGE}, {LARGE}]"), ("atlas", f"render.atlas={LARGE}")):
        yield Case("size", f"{name} {LARGE} x {LARGE}", _ring(*plain, large, lean=True), memory, lean=True)
    for name, setting in (
        ("picture", "render.size=[{0}, 1]"),
        ("atlas", "render.atlas={0}"),
        ("maps", "skin.size={0}"),
    ):
        for side in (0, 16385):
            refused = Refusal(InputError, setting.partition("=")[0].partition("render.")[2] or "size")
            yield Case("size", f"{name} {side}", _ring(setting.format(side)), refused)


_EFFECTS = ("blur", "specular", "occlusion_high", "occlusion_low", "reflection")


def _uvs() -> Iterator[Case]:
    def edited(edit: Callable[[Floats], Floats]) -> Make:
        return _file(change=lambda obj: replace(obj, uv=edit(obj.uv.copy())))

    def collapsed(uv: Floats) -> Floats:
        uv[: len(uv) // 4] = 0.5
        return uv

    def broken(value: float) -> Callable[[Floats], Floats]:
        def edit(uv: Floats) -> Floats:
            uv[::17] = value
            return uv

        return edit

    edits: dict[str, Callable[[Floats], Floats]] = {
        "all at one point": lambda uv: 0.0 * uv + 0.5,
        "a quarter at one point": collapsed,
        "on a line": lambda uv: uv * [1.0, 0.0],
        "slivers of 1e-7": lambda uv: uv * [1e-7, 1.0],
        "slivers of 1e-13": lambda uv: uv * [1e-13, 1.0],
        "mirrored": lambda uv: uv * [-1.0, 1.0] + [1.0, 0.0],
        "halves on each other": lambda uv: uv % [0.5, 1.0],
        "everything on everything": lambda uv: (uv * 7.0) % 1.0,
        "10 times the square": lambda uv: 10.0 * uv - 5.0,
        "1000 times the square": lambda uv: 1e3 * uv,
        "shifted by -3": lambda uv: uv - 3.0,
        "shifted by 1e6": lambda uv: uv + 1e6,
        "shifted by 1e30": lambda uv: uv + 1e30,
        "some NaN": broken(np.nan),
        "some infinite": broken(np.inf),
        "some 1e300": broken(1e300),
        "all NaN": lambda uv: uv * np.nan,
    }
    for name, edit in edits.items():
        yield Case("uv", name, edited(edit))

    def flat(obj: Obj) -> Obj:
        thin = obj.positions.copy()
        thin[obj.faces[::5, 0]] = thin[obj.faces[::5, 1]]
        return replace(obj, positions=thin)

    yield Case("uv", "triangles without area", _file(change=flat))
    point = _file(change=lambda obj: replace(obj, positions=0.0 * obj.positions))
    yield Case("uv", "a mesh that is one point", point, Refusal(InputError, "no triangles"))


def _normals() -> Iterator[Case]:
    def edited(edit: Callable[[Floats], Floats]) -> Make:
        return _file(change=lambda obj: replace(obj, normals=edit(obj.normals.copy())))

    def some(value: float) -> Callable[[Floats], Floats]:
        def edit(normals: Floats) -> Floats:
            normals[::3] = value
            return normals

        return edit

    plain = Case("normal", "unit", _file())
    yield plain
    for scale in (1e-30, 1e-3, 1e3, 1e30):
        yield Case("normal", f"of length {scale:g}", edited(lambda normals, s=scale: s * normals), like=plain)  # type: ignore[misc]
    for value in (0.0, np.nan, np.inf):
        yield Case("normal", f"a third {value:g}", edited(some(value)))
        yield Case("normal", f"all {value:g}", edited(lambda normals, v=value: 0.0 * normals + v))  # type: ignore[misc]
    yield Case("normal", "inward", edited(lambda normals: -normals))

    def opposed(mesh: Mesh) -> Mesh:
        sign = np.where(np.arange(len(mesh.normals)) % 2, 1.0, -1.0)
        return replace(mesh, normals=mesh.normals * sign[:, None])

    # Between two that oppose each other the interpolated normal is zero.
    yield Case("normal", "opposed from vertex to vertex", _ring(change=opposed))
    yield Case("normal", "zero in memory", _ring(change=lambda mesh: replace(mesh, normals=0.0 * mesh.normals)))
    lost = _file(change=lambda obj: replace(obj, positions=np.where(obj.positions > 80, np.nan, obj.positions)))
    yield Case("normal", "positions NaN", lost, Refusal(InputError, "finite numbers"))


def _halves() -> Iterator[Case]:
    """Values that half floats, in which maps are kept, cannot hold."""
    ramp = np.linspace(-1, 1, 32 * 32).reshape(32, 32, 1)
    for top in (1e-8, 65504.0, 65520.0, 1e5, 1e30):
        layer = "{image: {file: extreme.exr, into: [albedo]}}"
        made = _with_picture(top * np.abs(np.repeat(ramp, 3, axis=2)), f"skin.layers=[{layer}]")
        yield Case("float16", f"albedo picture to {top:g}", made)
    for top in (1e5, 1e30, 3e38):
        layer = "{image: {file: extreme.exr, role: grey, height: [-10.0, 10.0], into: []}}"
        made = _with_picture(top * np.repeat(ramp, 3, axis=2), f"skin.layers=[{layer}]")
        yield Case("float16", f"height picture to {top:g}", made)
    odd = np.array([[0, 0, 0], [0.5, 0.5, 0.5], [1, 0.5, 0.5], [0, 1, 0], [1, 1, 0.5], [0.5, 0.5, 1]])
    layer = "{image: {file: extreme.exr, role: normal_gl}}"
    made = _with_picture(np.resize(odd, (8, 8, 3)), f"skin.layers=[{layer}]")
    yield Case("float16", "normal map with normals of length 0, flat and inward", made)
    for value in (0.0, 1000.0):
        layer = f"{{color: {{scattering_radius: {_rgb(value)}}}}}"
        yield Case("float16", f"scattering radius {value:g} mm", _ring(f"skin.layers=[{layer}]"))

    values = np.array([[-1e30, -1.0, 0.0, 1e-30, 1.0, 65504.0, 65520.0, 1e30]])

    def shown(neutral: int, ev: int, _: Path) -> FrameGraph:
        beauty = _given("beauty", values)
        draw = Draw(DisplayValues(2.0**ev, neutral))
        node = Display("display", values.shape[::-1], [draw], {"beauty": Ref("beauty", "image")})
        return FrameGraph([beauty, node], skip=False)

    for neutral, ev in product((0, 1), (-64, 0, 64)):
        name = f"display of +-1e30, {ev} EV, {'neutral' if neutral else 'srgb'}"
        yield Case("float16", name, partial(shown, neutral, ev))


def _environments() -> Iterator[Case]:
    def sky(value: float, size: tuple[int, int] = (32, 64), all_over: bool = False) -> Floats:
        picture = np.ones((*size, 3))
        picture[... if all_over else (slice(0, None, 8), slice(0, None, 8))] = value
        return picture

    def mirrored(picture: Floats, *sets: str) -> Make:
        return _with_picture(picture, "environment.image=extreme.exr", "skin.surface.reflectance=1.0", *sets)

    for value in (1e5, -1e5, np.nan, np.inf, -np.inf, 3e38):
        yield Case("environment", f"some pixels {value:g}", mirrored(sky(value)))
    for value in (0.0, np.nan, np.inf, 3e38):
        yield Case("environment", f"all pixels {value:g}", mirrored(sky(value, all_over=True)))
    for ev in (-64.0, 64.0):
        for value in (1e5, 3e38):
            sets = f"environment.exposure={ev}", f"camera.exposure={ev}"
            yield Case("environment", f"pixels of {value:g}, {ev:g} EV", mirrored(sky(value), *sets))
    for size in ((1, 1), (1, 2), (2, 1), (3, 5), (1, LARGE)):
        yield Case("environment", f"{size[1]} x {size[0]} pixels", mirrored(sky(1e5, size)))
    for turn in (-3600.0, 3600.0):
        yield Case("environment", f"turned by {turn:g} degrees", mirrored(sky(1e5), f"environment.rotation={turn}"))


CASES: tuple[Case, ...] = tuple(
    case
    for group in (
        _lights, _kernels, _bumps, _equation_1, _surfaces, _units, _places, _cameras, _sizes, _uvs, _normals, _halves,
        _environments,
    )
    for case in group()
)  # fmt: skip
