"""The built-in head is measured as one would measure a plaster cast: with a ruler, a feeler gauge and a shadow."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion

from skincli.errors import InputError
from skincli.mesh import builtin
from skincli.mesh.builtin.flatten import border, charts, cut, flatten, pack
from skincli.mesh.model import Mesh

Floats = NDArray[np.float64]


@pytest.fixture(scope="module")
def head() -> Mesh:
    return builtin.build("head")


@pytest.fixture(scope="module")
def coarser() -> Mesh:
    return builtin.build("head", "16k")


def crossings(mesh: Mesh, start: Floats, direction: Floats) -> tuple[Floats, Floats]:
    """Return where a line from `start` meets the mesh, in order: distances, and cosines to the triangles' normals."""
    direction = direction / np.linalg.norm(direction)
    a, b, c = (mesh.positions[mesh.faces[:, k]] for k in range(3))
    cross = np.cross(direction, c - a)
    det = np.einsum("ij,ij->i", b - a, cross)
    inverse = 1 / np.where(np.abs(det) > 1e-12, det, np.inf)
    u = np.einsum("ij,ij->i", start - a, cross) * inverse
    q = np.cross(start - a, b - a)
    v = q @ direction * inverse
    t = np.einsum("ij,ij->i", c - a, q) * inverse
    hit = (u >= 0) & (v >= 0) & (u + v < 1) & (t > 0) & (inverse != 0)
    order = np.argsort(t[hit])
    return t[hit][order], (np.cross(b - a, c - a)[hit] @ direction)[order]


def gaps(mesh: Mesh, start: Floats, direction: Floats) -> Floats:
    """Return the lengths of air between solid that a line meets which starts outside."""
    distance, cosine = crossings(mesh, start, direction)
    return np.diff(distance)[(cosine[:-1] > 0) & (cosine[1:] < 0)]


def welded(mesh: Mesh) -> NDArray[np.int64]:
    """Return faces over unique positions."""
    _, index = np.unique(np.round(mesh.positions, 9), axis=0, return_inverse=True)
    return index.reshape(-1)[mesh.faces]


def covered(points: Floats, faces: NDArray[np.int32], width: int, height: int) -> NDArray[np.int64]:
    """Count, for the pixels of a picture, the triangles whose inside holds the pixel's center."""
    count = np.zeros(width * height, dtype=np.int64)
    corner = points[faces]
    low = np.clip(np.floor(corner.min(axis=1)), 0, None).astype(int)
    span = np.clip(np.ceil(corner.max(axis=1)).astype(int), 0, (width, height)) - low
    for extent in np.unique(span, axis=0):
        if extent.min() <= 0:
            continue
        mine = np.flatnonzero((span == extent).all(axis=1))
        offset = np.stack(np.meshgrid(*(np.arange(e) for e in extent), indexing="ij"), axis=-1).reshape(-1, 2)
        cell = low[mine][:, None] + offset
        a, b, c = corner[mine].transpose(1, 0, 2)[:, :, None] - (cell + 0.5)
        sides = [p[..., 0] * q[..., 1] - p[..., 1] * q[..., 0] for p, q in ((a, b), (b, c), (c, a))]
        inside = (np.minimum.reduce(sides) > 1e-9) | (np.maximum.reduce(sides) < -1e-9)
        hit = cell[inside]
        count += np.bincount(hit[:, 0] * height + hit[:, 1], minlength=len(count))
    return count.reshape(width, height)


def jacobians(mesh: Mesh) -> tuple[Floats, Floats]:
    """Return the singular values of dP/duv and the area of each triangle."""
    a, b, c = (mesh.positions[mesh.faces[:, k]] for k in range(3))
    u, v, w = (mesh.uv[mesh.faces[:, k]] for k in range(3))
    derivative = np.stack([b - a, c - a], axis=2) @ np.linalg.inv(np.stack([v - u, w - u], axis=2))
    area: Floats = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    return np.asarray(np.linalg.svd(derivative, compute_uv=False), dtype=np.float64), area


def median(values: Floats, weights: Floats, at: float = 0.5) -> float:
    order = np.argsort(values)
    return float(np.interp(at, np.cumsum(weights[order]) / weights.sum(), values[order]))


def test_is_life_size_and_centered(head: Mesh) -> None:
    p = head.positions
    crown = p[:, 1].max()
    chin = p[(np.abs(p[:, 0]) < 10) & (p[:, 2] > 65), 1].min()
    assert 230 < crown - chin < 260
    assert abs(crown + chin) < 6
    skull = p[p[:, 1] > 30]
    assert 140 < np.ptp(skull[:, 0]) < 165
    assert 180 < np.ptp(skull[:, 2]) < 215
    assert p[p[:, 2].argmax(), 1] == pytest.approx(-40, abs=8)  # the nose's tip is what looks to +Z


def test_features_stand_where_the_canon_puts_them(head: Mesh) -> None:
    p = head.positions
    middle = p[(np.abs(p[:, 0]) < 1.5) & (p[:, 2] > 60)]
    crown = p[:, 1].max()
    chin = p[(np.abs(p[:, 0]) < 10) & (p[:, 2] > 65), 1].min()
    # Behind the lips the slit is the place on the middle line that lies deepest near the mouth.
    mouth = middle[(middle[:, 1] < -65) & (middle[:, 1] > -85)]
    lips = mouth[mouth[:, 2].argmin(), 1]
    tip = p[p[:, 2].argmax()]
    below = middle[(middle[:, 1] < tip[1] - 8) & (middle[:, 1] > -66)]
    base = below[below[:, 2].argmin(), 1]
    assert abs(-4 - (crown + chin) / 2) < 8  # the lids at half height
    assert (-4 - base) / (-4 - chin) == pytest.approx(0.47, abs=0.06)
    assert (base - lips) / (base - chin) == pytest.approx(1 / 3, abs=0.1)


@pytest.mark.parametrize("side", [-1, 1])
def test_ears_are_flaps_with_a_front_and_a_back(head: Mesh, side: int) -> None:
    p = head.positions
    ear = p[(p[:, 0] * side > 78) & (np.abs(p[:, 1] + 12) < 32)]
    assert 50 < np.ptp(ear[:, 1]) < 70
    normal = np.array([side * 0.85, 0.0, 0.5])
    toward = np.array([-side * 0.5, 0, 0.85])  # along the flap, from the rim toward the canal
    thick = []
    # Nearer to the canal than these insets the flap grows out of the head and has no back.
    for height, insets in {
        8.0: (3, 5, 7, 9, 11), 2.0: (3, 5, 7, 9), -4.0: (3, 5, 7, 9), -12.0: (3, 5, 7, 9), -20.0: (3, 5, 7, 9, 11),
        -28.0: (3, 5, 7, 9, 11), -34.0: (3, 5),
    }.items():  # fmt: skip
        rim = ear[np.abs(ear[:, 1] - height) < 2]
        edge = rim[rim[:, 2].argmin()]
        start = np.array([edge[0], height, edge[2]])
        for inset in insets:
            distance, cosine = crossings(head, start + inset * toward + 20 * normal, -normal)
            assert cosine[0] < 0 < cosine[1]
            thick.append(distance[1] - distance[0])
            assert cosine[2] < 0  # behind the flap there is air, then the head
            assert distance[2] - distance[1] > 0.5
    assert min(thick) > 3
    assert max(thick) < 6


@pytest.mark.parametrize("side", [-1, 1])
def test_nostrils_are_pits(head: Mesh, side: int) -> None:
    up = np.array([0.0, 1, 0])
    bottom = max(
        crossings(head, np.array([side * x, -90.0, z]), up)[0][0]
        for x in (6, 6.5, 7, 7.5)
        for z in (103, 104, 105, 106)
    )
    rim = [crossings(head, np.array([x, -90.0, 102.0]), up)[0][0] for x in (side * 7.2 - 5.5, side * 7.2 + 5)]
    assert bottom - max(rim) > 5


@pytest.mark.parametrize("x", [-15.0, -8.0, 0.1, 8.0, 15.0])
def test_lips_touch_along_a_slit(head: Mesh, x: float) -> None:
    p = head.positions
    front = p[(np.abs(p[:, 0] - x) < 2) & (np.abs(p[:, 1] + 75) < 8), 2].max()
    for inward in (5.5, 6.5, 7.5):
        gap = gaps(head, np.array([x, -140.0, front - inward]), np.array([0.0, 1, 0]))
        assert np.sum((gap > 0.02) & (gap < 1)) == 1


@pytest.mark.parametrize("x", [-38.0, -32.0, -26.0, 26.0, 32.0, 38.0])
def test_lids_touch_along_a_slit(head: Mesh, x: float) -> None:
    p = head.positions
    front = p[(np.abs(p[:, 0] - x) < 1) & (np.abs(p[:, 1] + 8) < 3), 2].max()
    for inward in (2.0, 2.8):
        gap = gaps(head, np.array([x, -140.0, front - inward]), np.array([0.0, 1, 0]))
        assert np.any((gap > 0.02) & (gap < 1))


def test_surface_is_one_closed_manifold_turned_outward(head: Mesh) -> None:
    faces = welded(head)
    edges = Counter(map(tuple, np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2).tolist()))
    assert max(edges.values()) == 1
    assert all((b, a) in edges for a, b in edges)
    vertices, count = faces.max() + 1, len(edges) // 2
    assert vertices - count + len(faces) == 2
    a, b, c = (head.positions[head.faces[:, k]] for k in range(3))
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6 > 3e6
    cross = np.cross(b - a, c - a)
    assert np.linalg.norm(cross, axis=1).min() / 2 > 1e-3
    assert np.mean(np.einsum("ij,ij->i", cross, head.normals[head.faces].sum(axis=1)) <= 0) < 2e-4
    np.testing.assert_allclose(np.linalg.norm(head.normals, axis=1), 1, atol=1e-9)


def test_uv_is_unique_even_and_isotropic(head: Mesh) -> None:
    assert head.uv_is_unique
    np.testing.assert_array_equal(head.uv, head.atlas_uv)
    assert head.uv.min() > 0
    assert head.uv.max() < 1
    assert len(charts(head.faces.astype(np.int64))) <= 6
    count = covered(head.uv * 1024, head.faces, 1024, 1024)
    assert np.sum(count > 1) <= 1e-4 * np.sum(count > 0)
    assert np.mean(count > 0) > 0.55
    sigma, area = jacobians(head)
    assert median(sigma[:, 0] / sigma[:, 1], area) < 1.5
    scale = np.sqrt(sigma[:, 0] * sigma[:, 1])
    assert median(scale, area, 0.95) < 2 * median(scale, area, 0.05)


def test_details_sample_one_surface(head: Mesh, coarser: Mesh) -> None:
    """Two builds of two levels agree in every vertex they share, so building is deterministic as well."""
    assert len(head.faces) == pytest.approx(65_000, rel=0.1)
    assert 4 * len(coarser.faces) == len(head.faces)
    fine = {tuple(row) for row in np.round(np.hstack([head.positions, head.normals, head.uv]), 9).tolist()}
    coarse = np.round(np.hstack([coarser.positions, coarser.normals, coarser.uv]), 9)
    assert all(tuple(row) in fine for row in coarse.tolist())


def test_details_share_their_silhouette(head: Mesh, coarser: Mesh) -> None:
    """Seen from in front at 640 x 480, the outlines lie within two pixels."""
    inside = []
    for mesh in (head, coarser):
        seen = mesh.positions - (0, 20, 620)
        scale = 240 / np.tan(np.radians(15)) / -seen[:, 2:]
        inside.append(covered(seen[:, :2] * scale + (320, 240), mesh.faces, 640, 480) > 0)
    assert not binary_erosion(inside[0] ^ inside[1], np.ones((3, 3))).any()


def test_unknown_names_are_answered() -> None:
    with pytest.raises(InputError, match=r"'haed'.*head, creature.*did you mean 'head'"):
        builtin.build("haed")
    with pytest.raises(InputError, match=r"'64k'.*4k, 16k, 65k, 259k.*did you mean '4k'"):
        builtin.build("head", "64k")


def test_cylinder_unrolls_to_its_own_size() -> None:
    """A cylinder is developable: cut open it flattens to circumference by height, without any stretch."""
    turn, rise = np.meshgrid(np.arange(24), np.arange(9), indexing="ij")
    angle = 2 * np.pi * turn.ravel() / 24
    positions = np.stack([10 * np.cos(angle), 3.0 * rise.ravel(), -10 * np.sin(angle)], axis=1)
    corner = np.array([[i * 9 + j, (i + 1) % 24 * 9 + j] for i in range(24) for j in range(8)])
    a, b = corner.T
    faces = np.concatenate([np.stack([a, b, b + 1], axis=1), np.stack([a, b + 1, a + 1], axis=1)])
    seam = np.stack([np.arange(8), np.arange(1, 9)], axis=1)
    opened = cut(faces, seam)
    assert opened.max() + 1 == len(positions) + 9
    split = np.empty(opened.max() + 1, dtype=np.int64)
    split[opened] = faces
    uv = flatten(positions[split], opened, 60)
    flat, true = (
        np.linalg.norm(table[index] - table[np.roll(index, -1, axis=1)], axis=2)
        for table, index in ((uv, opened), (positions, faces))
    )
    np.testing.assert_allclose(flat, true, rtol=2e-2)
    assert len(border(opened)) == 2 * 24 + 2 * 8
    packed = pack(uv, opened, 1.0)
    assert packed.min() > 0
    assert packed.max() < 1
