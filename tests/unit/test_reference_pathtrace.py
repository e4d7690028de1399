"""The path tracer against closed forms: what media follow from a skin, and Mitsuba's pictures where it is installed."""

from __future__ import annotations

import logging
import math
import os
from pathlib import Path

import numpy as np
import pytest
import trimesh

from skincli import images
from skincli.errors import DeviceError, InputError, UsageError
from skincli.mesh.load import load_mesh
from skincli.mesh.model import Material, Mesh, Part
from skincli.optics.diffusion import burley_width
from skincli.optics.pigments import half_space
from skincli.reference import pathtrace, rays
from skincli.reference.pathtrace import Medium, Stuff, Tracer
from skincli.scene.model import Camera, Environment, Scene
from skincli.scene.skin import Optics

ORIGIN = np.array([300.0, -100.0, 50.0])
NO_TRACER = Tracer(None, "none")
HEAD = Path(os.environ.get("SKINCLI_REFERENCE_DATA", Path(__file__).parents[3] / "shared" / "data" / "reference"))


@pytest.fixture(scope="module")
def tracer() -> Tracer:
    """Return Mitsuba in the variant that needs no compiler."""
    pytest.importorskip("mitsuba")
    return pathtrace.load("scalar_rgb")


def body(shape: trimesh.Trimesh, uv: np.ndarray | None = None) -> Mesh:
    """Return a mesh that lies at ORIGIN in its scene."""
    uv = np.zeros((len(shape.vertices), 2)) if uv is None else uv
    parts = (Part("all", 0, len(shape.faces)),)
    faces = shape.faces.astype(np.int32)
    return Mesh(np.array(shape.vertices), np.array(shape.vertex_normals), uv, uv, faces, parts, ORIGIN)


def ball(radius: float = 10.0) -> Mesh:
    return body(trimesh.creation.icosphere(subdivisions=4, radius=radius))


def scene(size: tuple[int, int] = (8, 8), **more: object) -> Scene:
    written = {"scene": 1, "mesh": {"builtin": "head"}, "ambient": (0.0, 0.0, 0.0), "render": {"size": size}}
    return Scene.model_validate({**written, **more})


def camera(distance: float = 500.0, fov: float = 1.0, target: tuple[float, ...] = (0.0, 0.0, 0.0)) -> Camera:
    return Camera(position=tuple(np.add(ORIGIN, [0, 0, distance])), target=tuple(ORIGIN + target), fov=fov)


@pytest.mark.parametrize("kind", ["mfp", "dmfp", "d"])
def test_a_medium_has_the_color_and_the_radius_of_its_skin(kind: str) -> None:
    optics = Optics(color=(0.95, 0.5, 0.02), radius=(2.0, 0.5, 0.1), radius_kind=kind)
    medium = Medium.of(optics)
    sigma_a, sigma_s = np.array(medium.sigma_a), np.array(medium.sigma_s)
    np.testing.assert_allclose(half_space(sigma_a / sigma_s), optics.color, atol=2e-3)
    free_path = 1 / (sigma_a + sigma_s)
    if kind == "mfp":
        np.testing.assert_allclose(free_path, optics.radius, rtol=1e-12)
    width = burley_width(optics.radius, optics.color, kind)
    np.testing.assert_allclose(burley_width(free_path, optics.color, "mfp"), width, rtol=1e-12)


def test_white_absorbs_nothing_and_black_scatters_nothing() -> None:
    medium = Medium.of(Optics(color=(1.0, 0.0, 0.5), radius=(1.0, 1.0, 1.0)))
    assert medium.sigma_a[0] == pytest.approx(0, abs=1e-6)
    assert medium.sigma_s[1] == pytest.approx(0, abs=1e-4)


def test_a_medium_of_nothing_is_refused() -> None:
    with pytest.raises(InputError, match="a medium must absorb or scatter each color"):
        Medium((0.1, 0.0, 0.2), (0.5, 0.0, 0.2))


def test_what_cannot_be_traced_is_refused() -> None:
    dark = {"type": "directional", "direction": (0.0, 0, -1), "irradiance": (1.0, 1, -1)}
    with pytest.raises(InputError, match=r"lights\[0\] is \[1.0, 1.0, -1.0\]; a path tracer needs 0 or more"):
        pathtrace.render(scene(lights=[dark]), ball(), camera(), [], tracer=NO_TRACER, spp=2)
    away = camera(target=(0.0, 0.0, 1000.0))
    with pytest.raises(InputError, match="does not see the mesh"):
        pathtrace.render(scene(), ball(), away, [], tracer=NO_TRACER, spp=2)


def test_a_hole_is_told(caplog: pytest.LogCaptureFixture) -> None:
    closed = ball()
    pathtrace._warn_of_holes(closed)
    assert not caplog.records
    faces = closed.faces[1:]
    pathtrace._warn_of_holes(Mesh(closed.positions, closed.normals, closed.uv, closed.uv, faces, (Part("a", 0, 1),)))
    assert "not closed (3 edges have one face)" in caplog.text


def test_a_variant_that_does_not_work_is_replaced_or_refused(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    pytest.importorskip("mitsuba")

    def no_llvm(name: str) -> str | None:
        return "it ended with signal 6" if name.startswith("llvm") else None

    monkeypatch.setattr(pathtrace, "_trouble", no_llvm)
    caplog.set_level(logging.WARNING)
    assert pathtrace.load().variant == "scalar_rgb"
    assert "llvm_ad_rgb does not work here (it ended with signal 6)" in caplog.text
    with pytest.raises(DeviceError, match="llvm_ad_rgb does not work here"):
        pathtrace.load("llvm_ad_rgb")
    with pytest.raises(UsageError, match=r"no variant 'scalar_rbg'.* did you mean 'scalar_rgb'"):
        pathtrace.load("scalar_rbg")


def test_the_trial_of_a_variant_survives_what_aborts_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pathtrace, "PROBE", "import os; os.abort()")
    assert pathtrace._trouble("any") == "it ended with signal 6"
    monkeypatch.setattr(pathtrace, "PROBE", "import sys; sys.exit('no ' + sys.argv[1])")
    assert pathtrace._trouble("variant") == "no variant"


def test_lights_and_environment_are_those_of_the_rays(tracer: Tracer, tmp_path: Path) -> None:
    """An opaque white plane shines its irradiance over pi: two ways to the same light, unit by unit."""
    box = trimesh.creation.box((400.0, 400.0, 400.0), trimesh.transformations.translation_matrix((0, 0, -200)))
    box.unmerge_vertices()  # for each face to have normals of its own
    plane = body(box)
    place = tuple(np.add(ORIGIN, [-60.0, 20.0, 150.0]))
    lights = [
        {"type": "directional", "direction": (1.0, 2.0, -4.0), "irradiance": (0.5, 0.2, 0.1)},
        {"type": "point", "position": place, "intensity": (0.01, 0.02, 0.0)},
        {"type": "spot", "position": place, "direction": (0.5, 0, -1), "intensity": (0, 0, 0.02), "angle": 80.0,
         "blend": 0.7},
        {"type": "spot", "position": place, "direction": (1, -1, -1), "intensity": (0, 0.01, 0.02), "angle": 50.0},
    ]  # fmt: skip
    v, u = np.mgrid[0:16, 0:32]
    sky = np.stack([1 + np.sin(u / 5), v / 16, (v > 4) * (u < 9)], axis=-1).astype(np.float32)
    images.write_exr(tmp_path / "sky.exr", {"beauty": sky}, half=False)
    environment = Environment.model_validate(
        {"image": "sky.exr", "rotation": 37.0, "exposure": -1.0}, context={"base": tmp_path, "roots": ()}
    )
    lit = scene(size=(12, 10), lights=lights, ambient=(0.1, 0.0, 0.2)).model_copy(update={"environment": environment})
    view = camera(distance=300.0, fov=30.0)
    white = Stuff(None, material=Material(base_color=(1.0, 1.0, 1.0)))
    found = pathtrace.render(lit, plane, view, [white], tracer=tracer, spp=256)
    half = 300 * math.tan(math.radians(15))
    y, x = np.meshgrid(
        half - (np.arange(40) + 0.5) / 20 * half, ((np.arange(48) + 0.5) / 24 - 1) * half * 1.2, indexing="ij"
    )
    points = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    up = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    panorama = rays.Panorama.of(environment)
    expected = rays.irradiance(plane, points, up, lit.lights, ambient=lit.ambient, environment=panorama) / math.pi
    expected = expected.reshape(10, 4, 12, 4, 3).mean(axis=(1, 3))
    assert (found.beauty[..., 3] == 1).all()
    # The sharp edge of a spot is resolved by 4 x 4 points a pixel only.
    deviation = np.abs(found.beauty[..., :3] - expected)
    assert np.quantile(deviation / (found.error + 2e-3 * expected.max()), 0.95) < 3
    np.testing.assert_allclose(found.beauty[..., :3].mean(axis=(0, 1)), expected.mean(axis=(0, 1)), rtol=5e-3)


def test_what_absorbs_nothing_vanishes_in_a_white_furnace(tracer: Tracer) -> None:
    white = Stuff(Medium((0.0, 0.0, 0.0), (0.5, 1.0, 2.0)))
    found = pathtrace.render(
        scene(ambient=(0.3, 0.3, 0.3)), ball(3.0), camera(fov=0.2), [white], tracer=tracer, spp=512
    )
    mean = found.beauty[..., :3].mean(axis=(0, 1))
    noise = np.sqrt(np.sum(found.error**2, axis=(0, 1))) / 64
    assert (noise < 0.003).all()
    # But for the light that passes straight through, which is background.
    scattered = 1 - np.exp(-6.0 * np.array([0.5, 1.0, 2.0]))
    np.testing.assert_array_less(np.abs(mean - 0.3 * scattered), 4 * noise)


def test_skin_has_its_color_in_light_from_around(tracer: Tracer) -> None:
    optics = Optics(color=(0.8, 0.5, 0.2), radius=(0.5, 0.3, 0.2))
    view = camera(distance=12500.0, fov=0.6)
    found = pathtrace.render(
        scene(size=(16, 16), ambient=(1.0, 1.0, 1.0)),
        ball(50.0),
        view,
        [Stuff(Medium.of(optics))],
        tracer=tracer,
        spp=256,
    )
    # From afar each part of a ball counts as Lambert's cosine has it: the mean is the albedo in diffuse light.
    color = found.beauty[..., :3].sum(axis=(0, 1)) / found.beauty[..., 3].sum()
    np.testing.assert_allclose(color, optics.color, rtol=0.02)


def test_the_error_that_is_told_is_the_error_that_is_left(tracer: Tracer) -> None:
    lit = scene(lights=[{"type": "directional", "direction": (1.0, 0, -1), "irradiance": (1.0, 1, 1)}])
    skin = [Stuff(Medium((0.03, 0.2, 0.5), (0.7, 0.9, 1.0)))]
    one, other = (
        pathtrace.render(lit, ball(), camera(fov=1.5), skin, tracer=tracer, spp=128, seed=seed) for seed in (0, 1000)
    )
    difference = float(np.sqrt(np.mean((one.beauty - other.beauty)[..., :3] ** 2)))
    told = one.relative_rmse * float(np.sqrt(np.mean(one.beauty[..., :3] ** 2)))
    assert difference == pytest.approx(math.sqrt(2) * told, rel=0.3)
    again = pathtrace.render(lit, ball(), camera(fov=1.5), skin, tracer=tracer, spp=128)
    np.testing.assert_array_equal(again.beauty, one.beauty)
    rough = pathtrace.render(
        lit, ball(), camera(fov=1.5), skin, tracer=tracer, spp=128, max_error=2 * one.relative_rmse
    )
    assert rough.relative_rmse <= 2 * one.relative_rmse
    assert rough.spp < 128


def test_what_is_lost_below_the_surface_is_little_or_told(tracer: Tracer, caplog: pytest.LogCaptureFixture) -> None:
    skin = [Stuff(Medium.of(Optics(color=(0.8, 0.5, 0.2), radius=(0.5, 0.3, 0.2))))]
    small = pathtrace.render(scene(), ball(20.0), camera(), skin, tracer=tracer, spp=2)
    assert small.skipped < pathtrace.SKIPPED_SHARE
    # Tiles of it are small enough.
    large = pathtrace.render(scene(size=(32, 32)), ball(500.0), camera(distance=5000.0), skin, tracer=tracer, spp=2)
    assert small.skipped < large.skipped < pathtrace.SKIPPED_SHARE
    assert not caplog.records
    # A pixel of it is not.
    huge = pathtrace.render(scene(), ball(50000.0), camera(distance=500000.0), skin, tracer=tracer, spp=2)
    assert huge.skipped > pathtrace.SKIPPED_SHARE
    assert "% of the shortest mean free path" in caplog.text


def test_tiles_make_one_picture(tracer: Tracer, monkeypatch: pytest.MonkeyPatch) -> None:
    """A ball far from where its coordinates begin, whole and in tiles: no more apart than their noise."""
    lit = scene(size=(12, 8), lights=[{"type": "directional", "direction": (1.0, 0, -1), "irradiance": (1.0, 1, 1)}])
    skin = [Stuff(Medium((0.03, 0.2, 0.5), (0.7, 0.9, 1.0)))]
    view = camera(fov=3.0)
    whole = pathtrace.render(lit, ball(), view, skin, tracer=tracer, spp=256)
    monkeypatch.setattr(pathtrace, "TILES", (4,))
    tiled = pathtrace.render(lit, ball(), view, skin, tracer=tracer, spp=256)
    np.testing.assert_array_equal(tiled.beauty[..., 3], whole.beauty[..., 3])
    noise = np.hypot(whole.error, tiled.error)
    apart = np.abs(tiled.beauty - whole.beauty)[..., :3]
    assert noise.max() > 0
    assert np.mean(apart > 3 * noise) < 0.03


def test_a_dielectric_adds_highlights(tracer: Tracer) -> None:
    lit = scene(lights=[{"type": "directional", "direction": (0.0, 0, -1), "irradiance": (1.0, 1, 1)}])
    dark = [Stuff(Medium((1.0, 1.0, 1.0), (0.0, 0.0, 0.0)), alpha=0.3)]
    matched = pathtrace.render(lit, ball(), camera(fov=0.02), dark, tracer=tracer, spp=2)
    assert not matched.beauty[..., :3].any()
    found = pathtrace.render(lit, ball(), camera(fov=0.02), dark, tracer=tracer, spp=16, ior=1.4)
    # Head on the microfacet model is F0 D / 4 with D = 1 / (pi alpha²).
    expected = (0.4 / 2.4) ** 2 / (4 * math.pi * 0.3**2)
    np.testing.assert_allclose(found.beauty[..., :3], expected, rtol=0.02)


@pytest.mark.skipif(not HEAD.is_dir(), reason="the reference scene is not beside this checkout")
def test_the_known_head(tracer: Tracer) -> None:
    mesh = load_mesh(HEAD / "head.obj", 1.0)
    size = 32
    lit = scene(
        size=(size, size), lights=[{"type": "directional", "direction": (0.6, -0.45, -0.75), "irradiance": (3.0, 3, 3)}]
    )
    view = Camera(position=(125.0, 15.0, 400.0), target=(0.0, -3.0, 0.0), fov=35.0)
    skin = [Stuff(Medium((0.032, 0.17, 0.48), (0.74, 0.88, 1.01)))]
    found = pathtrace.render(lit, mesh, view, skin, tracer=tracer, spp=256)
    known = images.read_color(HEAD / "head256_key.exr")[..., :3].astype(np.float64)
    known = known.reshape(size, 256 // size, size, 256 // size, 3).mean(axis=(1, 3))
    inside = found.beauty[..., 3] == 1
    ratio = found.beauty[inside][:, :3].mean(axis=0) / known[inside].mean(axis=0)
    np.testing.assert_allclose(ratio, 1.0, atol=0.015)
