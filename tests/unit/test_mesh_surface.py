"""Measures of surface and UV: against closed forms and against plain, slow counting."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from skincli.mesh import surface
from skincli.mesh.model import Mesh, Part

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]


def grid(n: int) -> tuple[Floats, Indices]:
    """Return a square of (n + 1)² points in [0, 1]² and its 2 n² triangles, counter-clockwise."""
    u, v = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).reshape(-1)
    faces = np.concatenate(
        [np.stack([first, first + 1, first + n + 2], 1), np.stack([first, first + n + 2, first + n + 1], 1)]
    )
    return np.stack([u.ravel(), v.ravel()], axis=1), faces


def as_mesh(positions: Floats, faces: Indices, uv: Floats) -> Mesh:
    return Mesh(positions, np.zeros_like(positions), uv, uv, faces.astype(np.int32), (Part("all", 0, len(faces)),))


def test_areas_of_a_rectangle() -> None:
    uv, faces = grid(4)
    positions = np.column_stack([uv * [30.0, 20.0], np.zeros(len(uv))])
    mesh = as_mesh(positions, faces, uv)
    assert surface.face_areas(mesh) == pytest.approx(np.full(32, 600 / 32))
    assert surface.uv_areas(uv, faces) == pytest.approx(np.full(32, 1 / 32))
    assert surface.uv_areas(uv * [-1, 1], faces) == pytest.approx(np.full(32, -1 / 32))
    assert surface.texel_size(mesh, uv, 100) == pytest.approx(np.sqrt(600 / 100**2))


def test_texel_size_needs_uv_area_and_leaves_out_what_has_none() -> None:
    uv, faces = grid(2)
    positions = np.column_stack([uv, np.zeros(len(uv))])
    with pytest.raises(ValueError, match="no face has any area"):
        surface.texel_size(as_mesh(positions, faces, np.zeros_like(uv)), np.zeros_like(uv), 64)
    flat = np.vstack([uv, np.full((3, 2), 0.5)])
    more = np.vstack([positions, [[0, 0, 5], [1, 0, 5], [0, 1, 5]]])
    mesh = as_mesh(more, np.vstack([faces, [[9, 10, 11]]]), flat)
    assert surface.texel_size(mesh, flat, 64) == pytest.approx(1 / 64)


def test_angle_weights_do_not_depend_on_the_cut() -> None:
    corners = np.array([(x, y, z) for x in (0.0, 1) for y in (0.0, 1) for z in (0.0, 1)])
    box = trimesh.creation.box()
    faces = np.array(box.faces)
    positions = np.array(box.vertices)
    assert len(corners) == len(positions)
    normals = surface.angle_weighted_normals(positions, faces)
    assert normals == pytest.approx(positions / np.linalg.norm(positions, axis=1, keepdims=True), abs=1e-12)


def test_normals_of_a_sphere_and_of_lone_points() -> None:
    ball = trimesh.creation.icosphere(subdivisions=3)
    positions = np.vstack([ball.vertices, [[9, 9, 9]]])
    normals = surface.angle_weighted_normals(positions, np.array(ball.faces))
    assert normals[:-1] == pytest.approx(np.array(ball.vertices), abs=5e-3)
    assert np.linalg.norm(normals, axis=1) == pytest.approx(np.ones(len(positions)))
    assert tuple(normals[-1]) == (0, 0, 1)


def test_tangents_of_an_affine_map_are_its_columns() -> None:
    uv, faces = grid(5)
    matrix = np.array([[30.0, 4.0], [-2.0, 11.0], [5.0, 7.0]])
    dpdu, dpdv = surface.tangents(uv @ matrix.T, faces, uv)
    assert dpdu == pytest.approx(np.tile(matrix[:, 0], (36, 1)))
    assert dpdv == pytest.approx(np.tile(matrix[:, 1], (36, 1)))
    mirrored, along = surface.tangents(uv @ matrix.T, faces, uv * [-1, 1])
    assert mirrored == pytest.approx(-dpdu)
    assert along == pytest.approx(dpdv)


def test_tangents_weight_by_surface_area() -> None:
    # Two faces on one line of vertices: 1 mm per unit over area 1/2, 3 mm per unit over area 3/2.
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [4, 0, 0]])
    uv = np.array([[0.0, 0], [1, 0], [1, 1], [2, 0]])
    dpdu, _ = surface.tangents(positions, np.array([[0, 1, 2], [1, 3, 2]]), uv)
    assert dpdu[0] == pytest.approx([1, 0, 0])
    assert dpdu[3] == pytest.approx([3, 0, 0])
    assert dpdu[1] == pytest.approx([(0.5 * 1 + 1.5 * 3) / 2, 0, 0])


@pytest.mark.parametrize("broken", [0.5, np.nan, np.inf])
def test_tangents_are_zero_where_uv_are_useless(broken: float) -> None:
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    for values in surface.tangents(positions, np.array([[0, 1, 2]]), np.full((3, 2), broken)):
        assert not values.any()


def test_boundary_of_a_grid_and_of_a_sphere() -> None:
    _, faces = grid(4)
    edges = surface.border_edges(faces)[:, :2]
    assert edges.shape == (16, 2)
    assert sorted(edges[:, 0]) == sorted(edges[:, 1])  # a closed loop, each point left once and reached once
    assert len(surface.border_edges(np.array(trimesh.creation.icosphere(1).faces))) == 0
    assert surface.border_edges(np.zeros((0, 3), dtype=np.int64)).shape == (0, 3)


def counted(uv: Floats, faces: Indices, size: int) -> Indices:
    """Count strictly covered centers one by one."""
    centers = (np.arange(size) + 0.5) / size
    x, y = np.meshgrid(centers, centers)
    total = np.zeros((size, size), dtype=np.int64)
    for a, b, c in uv[faces]:
        sides = [(q - p)[0] * (y - p[1]) - (q - p)[1] * (x - p[0]) for p, q in ((a, b), (b, c), (c, a))]
        total += (np.min(sides, axis=0) > 0) | (np.max(sides, axis=0) < 0)
    return total


def test_coverage_agrees_with_counting() -> None:
    generator = np.random.default_rng(5)
    uv = generator.random((60, 2)) * 1.4 - 0.2
    faces = np.arange(60).reshape(-1, 3)
    assert np.array_equal(surface.coverage(uv, faces, 37), counted(uv, faces, 37))


def test_shared_edges_are_counted_once_even_through_centers() -> None:
    uv, faces = grid(8)  # at 16 texels the diagonals run through centers; at 64 again
    for size in (16, 64):
        assert (surface.coverage(uv, faces, size) == 1).all()
    seams = uv[faces].reshape(-1, 2)
    assert (surface.coverage(seams, np.arange(len(seams)).reshape(-1, 3), 16) == 1).all()
    generator = np.random.default_rng(1)
    jittered = uv + np.where((uv > 0) & (uv < 1), generator.uniform(-0.04, 0.04, uv.shape), 0)
    assert (surface.coverage(jittered, faces, 61) == 1).all()


def test_coverage_in_small_pieces_is_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    uv, faces = grid(9)
    whole = surface.coverage(uv * 0.9, faces, 50)
    monkeypatch.setattr(surface, "SPANS_AT_ONCE", 7)
    assert np.array_equal(surface.coverage(uv * 0.9, faces, 50), whole)


def test_tiles_of_faces_in_and_across() -> None:
    uv = np.array([[0.0, 0], [1, 0], [0, 1], [0.9, 0.1], [1.1, 0.1], [1, 0.2], [-1.5, 2.5], [-1.4, 2.5], [-1.4, 2.6]])
    face, shift = surface.raster_tiles(uv, np.arange(9).reshape(-1, 3))
    assert face.tolist() == [0, 1, 1, 2]
    assert shift.tolist() == [[0, 0], [0, 0], [-1, 0], [2, -2]]


def test_shifted_images_cover_the_wrapped_face() -> None:
    uv = np.array([[-0.7123, 0.4321], [1.3217, 0.2111], [0.4567, 1.9182]])
    faces = np.array([[0, 1, 2]])
    face, shift = surface.raster_tiles(uv, faces)
    size = 40
    drawn = sum(surface.coverage(uv + offset, faces, size) for offset in shift)
    large = surface.coverage((uv + 1) / 3, faces, 3 * size)
    wrapped = large.reshape(3, size, 3, size).sum(axis=(0, 2))
    assert np.array_equal(drawn, wrapped)
    assert len(face) <= surface.MOST_TILES


def test_tiles_are_capped_about_the_middle() -> None:
    uv = np.array([[0.0, 0], [100, 0], [0, 100], [0, 0], [50, 0], [50, 0.5]])
    face, shift = surface.raster_tiles(uv, np.arange(6).reshape(-1, 3))
    assert np.bincount(face).tolist() == [16, 16]
    assert len(np.unique(shift[face == 1], axis=0)) == 16
    assert -shift[face == 1].mean(axis=0) == pytest.approx([24.5, 0], abs=0.6)
