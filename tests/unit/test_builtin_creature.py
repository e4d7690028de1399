"""The built-in creature: every property that the renderer and the gallery rely on, measured."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from skincli.mesh.builtin import creature as module
from skincli.mesh.builtin.creature import creature
from skincli.mesh.model import Mesh

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def mesh() -> Mesh:
    return creature("65k")


@pytest.fixture(scope="module")
def coarse() -> Mesh:
    return creature("16k")


@pytest.fixture(scope="module")
def fine() -> Mesh:
    return creature("259k")


@pytest.fixture(scope="module")
def params(mesh: Mesh) -> list[Array]:
    """Parameters of the vertices of `mesh`, of the body and then of each tentacle."""
    result = [own for own, _ in module._samples(1)]
    assert sum(map(len, result)) == len(mesh.positions)
    return result


def _tubes() -> list[module._Tube]:
    return [shape for shape in module._shapes() if isinstance(shape, module._Tube)]


def _cross(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _corners(mesh: Mesh) -> Array:
    return mesh.positions[mesh.faces]


def _face_cross(mesh: Mesh) -> Array:
    a, b, c = _corners(mesh).transpose(1, 0, 2)
    return np.cross(b - a, c - a)


def _charts(mesh: Mesh) -> NDArray[np.int64]:
    """Chart, that is connected component, of every face."""
    i, j = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]]]).T
    n = len(mesh.positions)
    label = connected_components(coo_matrix((np.ones(len(i)), (i, j)), shape=(n, n)), directed=False)[1]
    return np.asarray(label[mesh.faces[:, 0]], dtype=np.int64)


def _rasterize(points: Array, faces: NDArray[np.int32], size: tuple[int, int]) -> NDArray[np.int32]:
    """How many triangles strictly contain each pixel's center; points in pixels, the result indexed [x, y]."""
    count = np.zeros(size[0] * size[1], dtype=np.int32)
    corner = points[faces]
    low = np.clip(np.floor(corner.min(axis=1)), 0, None).astype(int)
    span = np.clip(np.ceil(corner.max(axis=1)).astype(int), 0, size) - low
    for extent in np.unique(span, axis=0):
        if extent.min() <= 0:
            continue
        mine = np.flatnonzero((span == extent).all(axis=1))
        offset = np.stack(np.meshgrid(*(np.arange(e) for e in extent), indexing="ij"), axis=-1).reshape(-1, 2)
        for part in np.array_split(mine, len(mine) * len(offset) // 4_000_000 + 1):
            cell = low[part][:, None] + offset
            center = cell + 0.5
            a, b, c = corner[part].transpose(1, 0, 2)[:, :, None]
            turn = np.sign(_cross(b - a, c - a))
            inside = np.ones(cell.shape[:2], dtype=bool)
            for start, end in ((a, b), (b, c), (c, a)):
                inside &= turn * _cross(end - start, center - start) > 1e-9
            hit = cell[inside]
            count += np.bincount(hit[:, 0] * size[1] + hit[:, 1], minlength=len(count)).astype(np.int32)
    return count.reshape(size)


def _silhouette(mesh: Mesh) -> NDArray[np.bool_]:
    """Mask at 640 x 480 from (0, 20, 700), 30 degrees vertical."""
    p = mesh.positions - np.array([0.0, 20.0, 700.0])
    scale = 240.0 / np.tan(np.radians(15.0))
    pixel = np.stack([320.0 + scale * p[:, 0] / -p[:, 2], 240.0 + scale * p[:, 1] / -p[:, 2]], axis=1)
    return _rasterize(pixel, mesh.faces, (640, 480)) > 0


def test_number_of_triangles(mesh: Mesh, coarse: Mesh) -> None:
    assert len(mesh.faces) == pytest.approx(65e3, rel=0.1)
    assert len(coarse.faces) == pytest.approx(16e3, rel=0.15)


def test_lies_about_the_origin_in_life_size(mesh: Mesh) -> None:
    low, high = mesh.positions.min(axis=0), mesh.positions.max(axis=0)
    assert high[1] - low[1] == pytest.approx(350, abs=15)
    assert np.abs(low + high).max() < 40
    assert np.all(high - low < 360)


def test_is_made_the_same_twice(coarse: Mesh) -> None:
    parts = (module._samples, module._layout, module._shapes, module._curves, module._roots)
    for part in (*parts, module._sheaths, module._warts):
        part.cache_clear()
    assert creature("16k").key == coarse.key


def test_finest_level_has_four_times_the_triangles_and_the_same_outline(mesh: Mesh, fine: Mesh) -> None:
    assert len(fine.faces) == 4 * len(mesh.faces)
    coarse_mask, fine_mask = _silhouette(mesh), _silhouette(fine)

    def grown(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
        padded = np.pad(mask, 1)
        return np.any([padded[i : i + 640, j : j + 480] for i in range(3) for j in range(3)], axis=0)

    assert not (coarse_mask & ~grown(fine_mask)).any()
    assert not (fine_mask & ~grown(coarse_mask)).any()


def test_all_levels_share_one_layout(mesh: Mesh, coarse: Mesh) -> None:
    distance, nearest = cKDTree(mesh.positions).query(coarse.positions[coarse.positions[:, 1] > 60])
    near = distance < 0.5
    assert near.sum() > 50
    apart = mesh.uv[nearest[near]] - coarse.uv[coarse.positions[:, 1] > 60][near]
    assert np.median(np.linalg.norm(apart, axis=1)) < 1e-3


def test_no_triangle_is_degenerate(mesh: Mesh) -> None:
    twice = np.linalg.norm(_face_cross(mesh), axis=1)
    assert twice.min() > 0.01
    longest = np.linalg.norm(_corners(mesh) - np.roll(_corners(mesh), 1, axis=1), axis=2).max(axis=1)
    assert (twice / longest).min() > 0.02


def test_every_edge_joins_two_triangles_or_lies_on_a_border(mesh: Mesh) -> None:
    edges = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    assert len(np.unique(edges, axis=0)) == len(edges), "two triangles run the same way along one edge"
    # With the cuts sewn up, the only borders left are the base's and those inside the body.
    same = np.arange(len(mesh.positions))
    one, two = cKDTree(mesh.positions).query_pairs(1e-6, output_type="ndarray").T
    np.minimum.at(same, two, one)
    sewn, times = np.unique(np.sort(same[edges], axis=1), axis=0, return_counts=True)
    assert times.max() == 2
    places = mesh.positions[np.unique(sewn[times == 1])]
    base = places[:, 1] < -160
    assert module._flesh(places[~base]).max() < 0


def test_normals_are_unit_smooth_and_point_outward(mesh: Mesh) -> None:
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-9)
    cross = _face_cross(mesh)
    area = np.linalg.norm(cross, axis=1)
    cosine = np.einsum("fi,fci->fc", cross / area[:, None], mesh.normals[mesh.faces])
    weight = area / area.sum()
    assert weight[cosine.mean(axis=1) < 0].sum() < 1e-3
    assert weight @ (cosine.mean(axis=1) > np.cos(np.radians(20))) > 0.75
    assert weight @ (cosine.mean(axis=1) > np.cos(np.radians(45))) > 0.93
    body = mesh.parts[0]
    outward = np.einsum("ij,ij->i", cross[body.start : body.stop], _corners(mesh)[body.start : body.stop].mean(axis=1))
    assert outward.sum() > 0


def test_parts_cover_all_faces(mesh: Mesh) -> None:
    assert [part.name for part in mesh.parts] == ["body", "tentacles"]
    assert mesh.parts[0].start == 0
    assert mesh.parts[0].stop == mesh.parts[1].start
    assert mesh.parts[1].stop == len(mesh.faces)


def test_uv_is_unique_and_fills_the_square(mesh: Mesh) -> None:
    size = 1024
    assert mesh.uv.min() >= 0
    assert mesh.uv.max() <= 1
    assert mesh.uv_is_unique
    np.testing.assert_array_equal(mesh.uv, mesh.atlas_uv)
    count = _rasterize(mesh.uv * size, mesh.faces, (size, size))
    assert (count > 1).sum() < 1e-4 * (count > 0).sum()
    assert (count > 0).mean() > 0.5


def test_charts_keep_a_gap(mesh: Mesh) -> None:
    size = 1024
    owner = np.full((size, size), -1)
    charts = _charts(mesh)
    for chart, label in enumerate(np.unique(charts)):
        mask = _rasterize(mesh.uv * size, mesh.faces[charts == label], (size, size)) > 0
        near = np.zeros_like(mask)
        x, y = np.nonzero(mask)
        for dx in (-2, 0, 2):
            for dy in (-2, 0, 2):
                near[np.clip(x + dx, 0, size - 1), np.clip(y + dy, 0, size - 1)] = True
        assert (owner[near] == -1).all()
        owner[mask] = chart


def test_uv_has_little_stretch_one_scale_and_few_charts(mesh: Mesh) -> None:
    a, b, c = _corners(mesh).transpose(1, 0, 2)
    u, v, w = mesh.uv[mesh.faces].transpose(1, 0, 2)
    flat = np.stack([v - u, w - u], axis=2)
    assert np.linalg.det(flat).min() > 0, "a chart is mirrored"
    jacobian = np.stack([b - a, c - a], axis=2) @ np.linalg.inv(flat)
    sigma = np.linalg.svd(jacobian, compute_uv=False)
    area = 0.5 * np.linalg.norm(_face_cross(mesh), axis=1)
    order = np.argsort(sigma[:, 0] / sigma[:, 1])
    middle = np.searchsorted(np.cumsum(area[order]), 0.5 * area.sum())
    assert (sigma[:, 0] / sigma[:, 1])[order[middle]] < 1.5

    charts = _charts(mesh)
    assert charts.max() + 1 == 1 + len(module._ARMS)
    density = np.sqrt(np.bincount(charts, 0.5 * np.linalg.det(flat)) / np.bincount(charts, area))
    assert density.max() / density.min() < 1.5


def test_seam_of_the_body_runs_down_its_back(mesh: Mesh, params: list[Array]) -> None:
    seam = np.abs(params[0][:, 1]) == np.pi
    position = mesh.positions[: len(params[0])][seam]
    assert np.abs(position[:, 0]).max() < 25
    assert position[position[:, 1] > -150, 2].max() < 0


def test_tentacles_are_3_to_20_mm_thick(mesh: Mesh, params: list[Array]) -> None:
    tubes = _tubes()
    assert 14 <= len(tubes) <= 20
    start = len(params[0])
    roots = []
    for tube, own in zip(tubes, params[1:], strict=True):
        stop = start + len(own)
        arc, angle = own.T
        reach = np.linalg.norm(mesh.positions[start:stop] - tube.line(arc), axis=1)
        start = stop
        back = np.abs(np.mod(angle, 2 * np.pi) - np.pi) < 1.3
        thick = 2 * reach[back & (arc > module._SUNK) & (arc < tube.cap - 0.5)]
        assert thick.max() <= 20
        assert thick.min() >= 3 - 0.05
        roots.append(thick.max())
    assert max(roots) > 17
    assert min(roots) < 9


def test_suckers_are_cups_in_two_rows_that_shrink_toward_the_tip(mesh: Mesh, params: list[Array]) -> None:
    with_suckers = 0
    start = len(params[0])
    for tube, own in zip(_tubes(), params[1:], strict=True):
        stop = start + len(own)
        height = np.linalg.norm(mesh.positions[start:stop] - tube.line(own[:, 0]), axis=1) - tube.radius(own[:, 0])
        start = stop
        if len(tube.centers) < 9:
            continue
        with_suckers += 1
        angle = np.mod(own[:, 1] + np.pi, 2 * np.pi) - np.pi
        for side, shift in ((1.0, 0.0), (-1.0, 0.5)):
            rims = []
            for place in np.arange(3, len(tube.centers) - 5) + shift:
                center = np.interp(place, np.arange(len(tube.centers)), tube.centers)
                size = tube.radius(np.array([center]))[0]
                away = np.hypot(own[:, 0] - center, (angle - side * module._ROW) * size) / (module._SUCKER * size)
                rim, cup = height[(away > 0.6) & (away < 0.8)], height[away < 0.1]
                assert len(rim) >= 6
                assert rim.min() > 0.15 * size, "the rim stands out of the tube"
                assert cup.max() < rim.min() - 0.3 * size, "and the cup lies below its rim"
                rims.append(rim.mean())
            assert np.all(np.diff(rims) < 0)
    assert with_suckers >= 9


def test_tentacles_neither_cut_each_other_nor_dive_into_the_body() -> None:
    tubes = _tubes()
    samples = []
    for k, tube in enumerate(tubes):
        arc = np.linspace(module._SUNK + 22.0, tube.cap, 120)
        line, radius = tube.line(arc), tube.radius(arc)
        assert (module._bust(line) - 0.4 * radius).min() > 0
        samples.append((np.full(len(arc), k), line, radius))
    owner, line, radius = (np.concatenate(column) for column in zip(*samples, strict=True))
    apart = np.linalg.norm(line[:, None] - line[None], axis=2) - radius[:, None] - radius[None]
    apart[owner[:, None] == owner[None]] = np.inf
    assert apart.min() > -0.5
