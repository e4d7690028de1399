"""The bake: occlusion against closed forms and many rays, curvature against surfaces whose curvature is known."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from skincli import diskcache
from skincli.errors import DeviceError
from skincli.mesh import bake as module
from skincli.mesh.bake import bake, mean_curvature, occlusion_at
from skincli.mesh.model import Mesh, Part
from skincli.mesh.subdivide import subdivided
from skincli.mesh.surface import angle_weighted_normals

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

UP = np.array([[0.0, 0.0, 1.0]])


def as_mesh(positions: Floats, faces: Indices, normals: Floats | None = None) -> Mesh:
    normals = angle_weighted_normals(positions, faces) if normals is None else normals
    uv = np.zeros((len(positions), 2))
    return Mesh(positions, normals, uv, uv, faces.astype(np.int32), (Part("all", 0, len(faces)),))


def sheet(n: int, size: float, wrap: bool = False) -> tuple[Floats, Indices]:
    """Return (n + 1)² points (u, v) of a square about 0 and its triangles; `wrap` joins the two ends of u."""
    v, u = np.mgrid[0 : n + 1, 0 : n + 1]
    here = u + v * (n + 1)
    if wrap:
        here[:, n] = here[:, 0]
    a, b, c, d = (corner.ravel() for corner in (here[:-1, :-1], here[:-1, 1:], here[1:, 1:], here[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return np.stack([u, v], axis=-1).reshape(-1, 2) / n * size - size / 2.0, faces


def height_field(n: int, size: float, curve: tuple[float, float]) -> Mesh:
    """Return z = (a x² + b y²) / 2; its mean curvature at 0, seen from above, is -(a + b) / 2."""
    plane, faces = sheet(n, size)
    return as_mesh(np.column_stack([plane, 0.5 * plane**2 @ np.array(curve)]), faces)


def ball(radius: float, subdivisions: int = 3) -> Mesh:
    shape = trimesh.creation.icosphere(subdivisions, radius)
    return as_mesh(np.array(shape.vertices), np.array(shape.faces))


def tube(radius: float, length: float, n: int = 48) -> Mesh:
    """Return an open cylinder about z, seen from outside."""
    plane, faces = sheet(n, length, wrap=True)
    angle = plane[:, 0] / length * 2.0 * np.pi
    return as_mesh(np.column_stack([radius * np.cos(angle), radius * np.sin(angle), plane[:, 1]]), faces)


def cup() -> Mesh:
    """Return a deep bowl, seen from inside: something with every value of occlusion."""
    plane, faces = sheet(24, 60.0)
    return as_mesh(np.column_stack([plane, 30.0 * (1.0 - np.exp(-np.sum(plane**2, axis=1) / 200.0))]), faces)


def middle(mesh: Mesh) -> int:
    """Return the vertex nearest to the vertical axis."""
    return int(np.argmin(np.linalg.norm(mesh.positions[:, :2], axis=1)))


# ---------------------------------------------------------------- occlusion


def test_an_open_plane_is_fully_open() -> None:
    assert np.array_equal(bake(height_field(8, 100.0, (0.0, 0.0)), use_cache=False).occlusion, np.ones(81))


def test_a_closed_box_is_closed_inside_and_open_outside() -> None:
    box = trimesh.creation.box([100.0, 100.0, 100.0]).subdivide().subdivide()
    inside = as_mesh(np.array(box.vertices), np.array(box.faces)[:, ::-1])
    assert not bake(inside, reach=np.inf, use_cache=False).occlusion.any()
    points = np.array([[0.0, 0.0, -50.0], [0.0, 0.0, 50.0]])
    assert occlusion_at(inside, points, np.repeat(UP, 2, axis=0), reach=1000.0).tolist() == [0.0, 1.0]
    # Nothing on the floor's middle is nearer than the walls.
    assert occlusion_at(inside, points[:1], UP, reach=49.0)[0] == 1.0
    # Each corner's averaged normal sees its three walls only.
    corner = int(np.argmin(inside.positions.sum(axis=1)))
    assert 0.0 <= bake(inside, reach=30.0, use_cache=False).occlusion[corner] < 1.0


def test_reach_is_the_length_of_a_ray() -> None:
    # A ceiling at height h blocks the rays within acos(h / reach) of the vertical: 1 - (h / reach)² by cosine weight.
    plane, faces = sheet(2, 1000.0)
    floor = np.column_stack([plane, np.zeros(len(plane))])
    mesh = as_mesh(
        np.vstack([floor, floor + np.array([0.0, 0.0, 30.0])]), np.vstack([faces, faces[:, ::-1] + len(floor)])
    )
    points = np.zeros((50, 3))
    open_share = occlusion_at(mesh, points, np.repeat(UP, 50, axis=0), reach=60.0)
    assert open_share.mean() == pytest.approx(0.25, abs=0.002)
    assert open_share.std() < 0.01


@pytest.mark.parametrize("welded", [False, True])
def test_a_wall_takes_half_of_the_hemisphere(welded: bool) -> None:
    plane, faces = sheet(10, 400.0)
    x, y = plane.T
    floor, wall = np.column_stack([x + 200.0, y, 0.0 * x]), np.column_stack([0.0 * x, y, 200.0 - x])
    positions, faces = np.vstack([floor, wall]), np.vstack([faces, faces + len(x)])
    normals = np.repeat([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]], len(x), axis=0)
    if welded:
        # The vertices along the crease keep the floor's normals, which lie in the plane of the wall.
        _, kept, number = np.unique(positions, axis=0, return_index=True, return_inverse=True)
        positions, faces, normals = positions[kept], number.reshape(-1)[faces], normals[kept]
    foot = (positions[:, 0] == 0.0) & (positions[:, 2] == 0.0) & (np.abs(positions[:, 1]) < 100.0)
    occlusion = bake(as_mesh(positions, faces, normals), rays=512, use_cache=False).occlusion[foot]
    assert occlusion == pytest.approx(np.full(len(occlusion), 0.5), abs=0.01)


def test_the_default_rays_come_near_many_rays() -> None:
    mesh = cup()
    exact = bake(mesh, rays=4096, use_cache=False).occlusion
    assert exact.min() < 0.4
    assert exact.max() == 1.0
    error = bake(mesh, use_cache=False).occlusion - exact
    assert np.sqrt(np.mean(error**2)) < 0.01
    assert abs(error.mean()) < 0.001
    assert np.abs(error).max() < 0.05


def test_more_chunks_and_threads_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = cup()
    once = bake(mesh, use_cache=False)
    monkeypatch.setattr(module, "RAYS_AT_ONCE", 7 * module.RAYS)
    again = bake(mesh, use_cache=False)
    assert np.array_equal(once.occlusion, again.occlusion)
    assert np.array_equal(once.curvature, again.curvature)


@pytest.mark.parametrize("scale", [1e-6, 1e3, 1e6])
def test_scale_invariance(scale: float) -> None:
    mesh = cup()
    large = replace(mesh, positions=mesh.positions * scale)
    one = bake(mesh, use_cache=False)
    other = bake(large, reach=module.REACH * scale, smoothing=module.SMOOTHING * scale, use_cache=False)
    # A ray that grazes an edge may fall to either side by rounding.
    assert other.occlusion == pytest.approx(one.occlusion, abs=2.0 / module.RAYS)
    assert np.mean(other.occlusion != one.occlusion) < 0.02
    assert other.curvature * scale == pytest.approx(one.curvature, abs=1e-7)


def test_vertices_of_a_seam_get_the_same_values() -> None:
    # Every triangle has vertices of its own, whose last digits differ, as after arithmetic on each side of a seam.
    mesh = cup()
    source = mesh.faces.ravel()
    noise = 1e-12 * np.random.default_rng(1).standard_normal((len(source), 3))
    loose = as_mesh(mesh.positions[source] + noise, np.arange(len(source)).reshape(-1, 3), mesh.normals[source] + noise)
    baked, whole = bake(loose, use_cache=False), bake(mesh, use_cache=False)
    for values in (baked.occlusion, baked.curvature):
        least, most = np.full(len(mesh.positions), np.inf), np.full(len(mesh.positions), -np.inf)
        np.minimum.at(least, source, values)
        np.maximum.at(most, source, values)
        assert np.array_equal(least, most)
    # The points come in another order, so that their rays are turned otherwise.
    assert np.sqrt(np.mean((baked.occlusion - whole.occlusion[source]) ** 2)) < 0.015
    assert baked.curvature == pytest.approx(whole.curvature[source], abs=1e-7)


def test_nearly_equal_normals_of_a_seam_get_nearly_equal_values() -> None:
    mesh = cup()
    count = len(mesh.positions)
    tilted = mesh.normals + np.array([0.002, -0.002, 0.0])
    tilted /= np.linalg.norm(tilted, axis=1, keepdims=True)
    twice = as_mesh(np.tile(mesh.positions, (2, 1)), mesh.faces.astype(np.int64), np.vstack([mesh.normals, tilted]))
    # So few rays are noisy; on either side of the seam they must be so alike.
    occlusion = bake(twice, rays=16, use_cache=False).occlusion
    assert np.mean(occlusion[:count] != occlusion[count:]) < 0.1


def test_no_ray_slips_between_triangles() -> None:
    mesh = ball(50.0)
    edges = mesh.positions[mesh.faces], mesh.positions[np.roll(mesh.faces, 1, axis=1)]
    point = np.array([[10.0, 3.0, 7.0]])
    aims = np.concatenate([((1.0 - share) * edges[0] + share * edges[1]).reshape(-1, 3) for share in (0.0, 0.13, 0.5)])
    directions = (aims - point) / np.linalg.norm(aims - point, axis=1, keepdims=True)
    # What is left is the rounding of the directions; otherwise it is one ray in ten.
    assert np.mean(~module.RayScene(mesh).blocked(point, directions, np.inf)) < 0.002


def test_normals_of_a_hard_edge_see_their_own_sides() -> None:
    # A step whose riser and tread share positions but not normals: the tread is open, the riser sees the lower floor.
    plane, faces = sheet(4, 400.0)
    x, y = plane.T
    tread = np.column_stack([x - 200.0, y, np.zeros(len(x))])
    riser = np.column_stack([np.zeros(len(x)), y, -200.0 - x])
    normals = np.repeat([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]], len(x), axis=0)
    baked = bake(as_mesh(np.vstack([tread, riser]), np.vstack([faces, faces + len(x)]), normals), use_cache=False)
    assert np.array_equal(baked.occlusion, np.ones(2 * len(x)))


@pytest.mark.parametrize(
    "setting", [{"reach": 0.0}, {"reach": np.nan}, {"rays": 0}, {"smoothing": -1.0}, {"smoothing": np.nan}]
)
def test_settings_out_of_range(setting: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=f"{next(iter(setting))} is "):
        bake(ball(10.0, 1), use_cache=False, **setting)  # type: ignore[arg-type]


def test_without_points_there_is_nothing() -> None:
    assert occlusion_at(ball(10.0, 1), np.zeros((0, 3)), np.zeros((0, 3))).shape == (0,)


@pytest.mark.parametrize("normal", [(0, 0, 1), (0, 0, -1), (0.6, 0, -0.8), (1, 0, 0), (-0.48, 0.6, 0.64)])
def test_directions_are_cosine_weighted(normal: tuple[float, float, float]) -> None:
    axis = np.array([normal])
    directions = module._hemisphere(axis, np.array([7]), 4096)[0].astype(np.float64)
    assert np.linalg.norm(directions, axis=1) == pytest.approx(np.ones(4096), abs=1e-6)
    along = directions @ axis[0]
    assert along.min() > 0.0
    # By cosine weight the mean of cos is 2/3 and of cos² 1/2; what lies across is even on all sides.
    assert along.mean() == pytest.approx(2.0 / 3.0, abs=1e-3)
    assert np.mean(along**2) == pytest.approx(0.5, abs=1e-3)
    assert directions.mean(axis=0) == pytest.approx(axis[0] * 2.0 / 3.0, abs=2e-3)


# ---------------------------------------------------------------- curvature


@pytest.mark.parametrize("smoothing", [0.0, 2.0, 30.0])
@pytest.mark.parametrize("radius", [3.0, 80.0])
def test_curvature_of_a_ball(radius: float, smoothing: float) -> None:
    mesh = ball(radius)
    exact = np.full(len(mesh.positions), 1.0 / radius)
    assert mean_curvature(mesh, smoothing=smoothing) == pytest.approx(exact, rel=1e-6)
    hollow = replace(mesh, faces=mesh.faces[:, ::-1])
    assert mean_curvature(hollow, smoothing=smoothing) == pytest.approx(-exact, rel=1e-6)


def test_curvature_of_a_tube_up_to_its_open_ends() -> None:
    mesh = tube(20.0, 100.0)
    used = np.unique(mesh.faces)
    assert mean_curvature(mesh)[used] == pytest.approx(np.full(len(used), 1 / 40.0), rel=0.02)


@pytest.mark.parametrize(
    ("curve", "expected"), [((0.0, 0.0), 0.0), ((0.01, -0.01), 0.0), ((0.01, 0.01), -0.01), ((-0.02, 0.0), 0.01)]
)
def test_curvature_of_plane_saddle_bowl_and_ridge(curve: tuple[float, float], expected: float) -> None:
    mesh = height_field(32, 64.0, curve)
    assert mean_curvature(mesh)[middle(mesh)] == pytest.approx(expected, rel=0.02, abs=1e-5)
    if not any(curve):
        assert np.abs(mean_curvature(mesh)).max() < 1e-12


def test_smoothing_is_the_standard_deviation_of_the_average() -> None:
    plane, faces = sheet(60, 60.0)
    points = np.column_stack([plane, np.zeros(len(plane))])
    areas = np.ones(len(points))
    spot = np.where(np.linalg.norm(plane, axis=1) < 1e-9, 1.0, 0.0)
    spread = module._diffuse(points, faces, areas, spot, 0.5 * 3.0**2)
    assert spread.sum() == pytest.approx(1.0)
    assert spread.min() >= -1e-9
    assert spread @ plane**2 == pytest.approx([9.0, 9.0], rel=0.01)


def test_slivers_flat_faces_and_lone_points_do_no_harm() -> None:
    mesh = ball(50.0)
    # Needles: each of some edges gets a triangle of almost no area between its ends and a point beside one end.
    a, b = mesh.faces[:40, 0], mesh.faces[:40, 1]
    beside = mesh.positions[a] + 1e-4 * (mesh.positions[b] - mesh.positions[a])
    lone = np.array([[0.0, 0.0, 0.0]])
    count = len(mesh.positions)
    faces = np.vstack([mesh.faces, np.stack([a, b, count + np.arange(40)], axis=1), [[0, 0, 1]]])
    values = mean_curvature(as_mesh(np.vstack([mesh.positions, beside, lone]), faces))
    assert np.isfinite(values).all()
    assert values[:count] == pytest.approx(np.full(count, 0.02), rel=0.02)
    assert values[-1] == 0.0


# ---------------------------------------------------------------- cache and ray tracer


def test_the_cache_knows_geometry_and_settings_only(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = cup()
    made = bake(mesh, rays=8)

    def refuse(*arguments: object) -> Floats:
        raise AssertionError("baked again")

    monkeypatch.setattr(module, "_vertex_occlusion", refuse)
    for same in (mesh, replace(mesh, uv=mesh.uv + 0.5, atlas_uv=mesh.atlas_uv + 0.25, notes=("other",))):
        found = bake(same, rays=8)
        assert np.array_equal(found.occlusion, made.occlusion)
        assert np.array_equal(found.curvature, made.curvature)
    for setting in ({"rays": 9}, {"reach": 41.0}, {"smoothing": 3.0}, {"use_cache": False}):
        with pytest.raises(AssertionError, match="baked again"):
            bake(mesh, **({"rays": 8} | setting))
    for other in (
        replace(mesh, positions=mesh.positions + np.array([0, 0, 1e-6])),
        replace(mesh, normals=-mesh.normals),
        replace(mesh, faces=mesh.faces[::-1]),
    ):
        with pytest.raises(AssertionError, match="baked again"):
            bake(other, rays=8)
    assert list(diskcache.folder().glob("bake-*.npz"))


def test_without_the_ray_tracer_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = ball(10.0, 1)
    kept = bake(mesh)
    monkeypatch.setitem(sys.modules, "embreex.rtcore_scene", None)
    with pytest.raises(DeviceError, match="pip install embreex"):
        bake(mesh, use_cache=False)
    assert np.array_equal(bake(mesh).occlusion, kept.occlusion)


def test_the_bake_does_not_depend_on_the_triangles() -> None:
    """Coarse triangles are cut for the average, so a mesh and the same in four times the triangles agree."""
    mesh = height_field(16, 40.0, (0.03, -0.01))
    fine = bake(subdivided(mesh), rays=4, use_cache=False).curvature[: len(mesh.positions)]
    np.testing.assert_allclose(bake(mesh, rays=4, use_cache=False).curvature, fine, atol=1e-9)
    assert np.abs(mean_curvature(mesh) - fine).max() > 1e-5
