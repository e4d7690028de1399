"""The surface lattice against exact sums over the same texels, and the laws its tables keep. No GL."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.special import ndtr

from skincli.errors import LimitError
from skincli.mesh import lattice, surface
from skincli.mesh.bits import Row
from skincli.mesh.model import Mesh, Part
from skincli.mesh.texels import Texels, atlas_texels
from skincli.mesh.words import as_floats, as_words
from skincli.passes.lattice import Term, twin

SIZE = 64


def wavy(side: float = 20.0, height: float = 1.5, cells: int = 24, turn: float = 0.4) -> Mesh:
    """Return a wavy, tilted square sheet, `side` mm wide, whose two UV charts meet in a seam across its middle."""
    v, u = np.mgrid[0 : cells + 1, 0 : cells + 1] / cells
    x, y = (u - 0.5) * side, (v - 0.5) * side
    z = height * np.sin(2 * np.pi * u) * np.cos(np.pi * v)
    positions = np.stack([x, np.cos(turn) * y - np.sin(turn) * z, np.sin(turn) * y + np.cos(turn) * z], axis=-1)
    grid = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    a, b, c, d = (part.ravel() for part in (grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    points = positions.reshape(-1, 3)
    flat = np.stack([u, v], axis=-1).reshape(-1, 2)
    right = flat[faces].mean(axis=1)[:, 0] > 0.5
    # The right half is a chart of its own, turned upside down and stretched.
    other = np.stack([0.96 - 0.44 * (flat[:, 0] - 0.5) * 2, 0.95 - 0.6 * flat[:, 1]], axis=1)
    uv = np.concatenate([flat * [0.9, 0.9] + 0.03, other])
    faces = np.where(right[:, None], faces + len(points), faces)
    points = np.tile(points, (2, 1))
    normals = surface.angle_weighted_normals(points[: len(flat)], faces % len(flat))
    faces32 = faces.astype(np.int32)
    return Mesh(points, np.tile(normals, (2, 1)), uv, uv, faces32, (Part("sheet", 0, len(faces)),))


def images(texels: Texels, values: np.ndarray, size: int = SIZE) -> SimpleNamespace:
    """Return image, position, normal and area of texels as pictures, top row first."""
    image, position, normal, area = (np.zeros((size * size, channels)) for channels in (3, 3, 3, 1))
    image[texels.index], position[texels.index] = values, texels.positions
    normal[texels.index], area[texels.index, 0] = texels.normals, texels.areas
    return SimpleNamespace(
        image=image.reshape(size, size, 3)[::-1],
        position=position.reshape(size, size, 3)[::-1],
        normal=normal.reshape(size, size, 3)[::-1],
        area=area.reshape(size, size)[::-1],
    )


def tables(texels: Texels, sigma: float, size: int = SIZE, **options: Any) -> lattice.LatticeTables:
    return lattice.tables(texels.positions, texels.normals, texels.areas, texels.index, size, sigma, **options)


def diffused(texels: Texels, values: np.ndarray, sigma: float, size: int = SIZE, **options: Any) -> np.ndarray:
    """Return the twin's (n, 3) answer at the texels."""
    term = Term("", tables(texels, sigma, size, **options), (1.0, 1.0, 1.0))
    given = images(texels, values, size)
    result = twin([term], given.image, given.position, given.normal, given.area)[::-1].reshape(-1, 4)[texels.index]
    np.testing.assert_allclose(result[:, 3], 1, atol=1e-12)
    return result[:, :3]


def exact(texels: Texels, values: np.ndarray, sigma: float, some: Any = slice(None)) -> np.ndarray:
    """Return the (n, 3) sums over all texels, weighted by area, Gaussian distance and (1 + n . n') / 2, at some."""
    squared = np.sum((texels.positions[some, None] - texels.positions) ** 2, axis=-1)
    weights = np.exp(squared / (-2 * sigma**2)) * (1 + texels.normals[some] @ texels.normals.T) / 2 * texels.areas
    return np.asarray(weights @ values / weights.sum(axis=1, keepdims=True))


def checker(texels: Texels) -> np.ndarray:
    shade = np.floor(texels.positions / 7 + 0.31).astype(int).sum(axis=1) % 2
    return np.stack([shade, 0.2 + texels.normals[:, 0] ** 2, 1.0 - 0.5 * shade], axis=1)


@pytest.fixture(scope="module")
def sheet() -> Texels:
    return atlas_texels(wavy(), SIZE, gutter=1)


def test_tetrahedra_hold_their_points() -> None:
    points = np.random.default_rng(3).uniform(-40, 40, (500, 3))
    cubes = lattice.Cubes(points, 1.7)
    every = slice(0, len(points))
    cube, which = np.divmod(cubes.corners(every), 1 << lattice.SLOT_BITS)
    assert np.array_equal(cube, np.repeat(cubes.of[:, None], 4, axis=1))
    nodes, weights = 2 * cubes.cubes[cube] + lattice.NEAR[which], cubes.weights(every)
    assert np.all(nodes % 2 == nodes[..., :1] % 2)
    assert weights.min() >= 0
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-12)
    np.testing.assert_allclose(np.einsum("nk,nkd->nd", weights, nodes) * 0.85, points, atol=1e-9)


def test_points_share_cubes() -> None:
    points = np.random.default_rng(5).uniform(-9, 9, (3000, 3))
    cubes = lattice.Cubes(points, 2.0)
    distinct, of = np.unique(np.floor(points / 2 + 0.5).astype(int), axis=0, return_inverse=True)
    assert np.array_equal(cubes.cubes, distinct)
    assert np.array_equal(cubes.of, of.ravel())
    some = np.array([3, 5, 8, 2000])
    assert np.array_equal(cubes.met(some), np.unique(cubes.corners(some)))
    assert np.array_equal(cubes.met(range(3000)), np.unique(cubes.corners(slice(0, 3000))))
    nodes = np.zeros(len(distinct) << lattice.SLOT_BITS, dtype=bool)
    nodes[cubes.met(some)] = True
    assert np.array_equal(cubes.touch(nodes), nodes[cubes.corners(slice(0, 3000))].any(axis=1))


def test_points_too_far_from_the_origin_are_refused() -> None:
    with pytest.raises(LimitError, match="from the origin"):
        lattice.Cubes(np.array([[0.0, 0.0, 0.0], [0.0, -6e5, 0.0]]), 1.0)


@pytest.mark.parametrize("direction", range(4))
def test_a_row_follows_the_lines_of_its_direction(direction: int) -> None:
    nodes = 2 * np.random.default_rng(direction).integers(-30, 30, (400, 3))
    lines, first = (lattice._Lines(nodes, lattice.DIRECTIONS[k]) for k in (direction, 0))
    near = nodes + lattice.NEAR[np.arange(400) % 15]
    at = lines.at(near)
    assert np.array_equal(lines.nodes(at), near)
    assert np.array_equal(lines.at(near + lattice.DIRECTIONS[direction]), at + 1)
    assert len(np.unique(at)) == len(np.unique(near, axis=0))
    assert 64 <= at.min() <= at.max() < 64 * lines.words
    row = Row([at], lines.words)
    members = row.members(row.marked(at))
    assert np.array_equal(first.of(lines, row, members), first.at(lines.nodes(np.unique(at))))


def test_neighbors_of_nodes() -> None:
    nodes = 2 * np.random.default_rng(2).integers(-9, 9, (60, 3))
    lines = lattice._Lines(nodes, lattice.DIRECTIONS[0])
    steps = (lattice.DIRECTIONS @ lines.unit).tolist()
    ring = np.unique(lines.at(nodes)[:, None] + [0, *steps, *(-step for step in steps)])
    row = Row([ring], lines.words)
    assert np.array_equal(row.at(row.members(lattice._ring(row, row.marked(lines.at(nodes)), steps))), ring)


def test_pieces_far_apart_keep_their_tables(sheet: Texels, monkeypatch: pytest.MonkeyPatch) -> None:
    left = sheet.positions[:, 0] < 0

    def parted(lattice_constants: int) -> lattice.LatticeTables:
        away = sheet.positions + 0.8 * lattice_constants
        return tables(replace(sheet, positions=np.where(left[:, None], sheet.positions, away)), 0.8)

    near, far, farther = (parted(constants) for constants in (100, 500, 60_000))
    for other in (far, farther):
        for name, array in lattice.pack(near).items():
            assert np.array_equal(lattice.pack(other)[name], array), name
    # Where they are, they meet as little as where they are moved to.
    monkeypatch.setattr(lattice, "GAP", 1000)
    assert (parted(100).whole.counts, parted(100).bent.counts) == (near.whole.counts, near.bent.counts)


@pytest.mark.parametrize("factor", [1, 2])
def test_an_atlas_without_texels_has_empty_tables(factor: int) -> None:
    none = np.zeros((0, 3))
    made = lattice.tables(none, none, none[:, 0], np.zeros(0, dtype=np.int64), SIZE, 1.0, factor)
    assert made.whole.counts == made.bent.counts == (0, 0, 0, 0, 0)
    assert not made.slices.any()


def test_a_lattice_too_large_is_refused(sheet: Texels, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lattice, "MOST_WORDS", 1000)
    with pytest.raises(LimitError, match=r"choose a larger optics\.radius"):
        tables(sheet, 0.75)


@pytest.mark.parametrize("ratio", [0.85, 1.0, 1.15, 1.3])
def test_taps_leave_the_gaussian_its_variance(ratio: float) -> None:
    weights = np.array(lattice.taps(ratio))
    assert 2 * weights.sum() - weights[0] == pytest.approx(1, abs=1e-12)
    # The splat blurs by a twelfth of the squared lattice constant.
    left = 1 / ratio**2 - 1 / 12
    assert 2 * weights @ np.arange(4) ** 2 == pytest.approx(left, rel=0.03)


def edge_errors(sigma: float, size: int = 96) -> np.ndarray:
    """Return the errors of a blurred edge across tilted planes, against the exact response of an endless edge."""
    step = sigma / 6
    flat = (np.indices((size, size)).reshape(2, -1).T - size / 2) * step
    shown = np.abs(flat).max(axis=1) < size / 2 * step - 4 * sigma
    found = []
    for seed in range(4):
        random = np.random.default_rng(seed)
        across, along, normal = np.linalg.qr(random.normal(size=(3, 3)))[0]
        positions = flat[:, :1] * across + flat[:, 1:] * along + random.uniform(0, 9, 3)
        normals, areas = np.tile(normal, (size**2, 1)), np.full(size**2, step**2)
        turn = random.uniform(0, np.pi)
        beyond = flat @ [np.cos(turn), np.sin(turn)]
        texels = Texels(np.arange(size**2), positions, normals, areas)
        # Texels share an edge in proportion, so that it lies where it should.
        light = np.clip(beyond / step + 0.5, 0, 1)
        result = diffused(texels, np.tile(light[:, None], 3), sigma, size)[:, 0]
        found.append((result - ndtr(beyond / sigma))[shown])
    return np.concatenate(found)


@pytest.mark.parametrize(("sigma", "rms", "most"), [(0.8, 0.003, 0.008), (1.41, 0.001, 0.0025), (2.72, 0.001, 0.0025)])
def test_an_edge_on_a_plane_is_blurred_as_by_a_gaussian(sigma: float, rms: float, most: float) -> None:
    errors = edge_errors(sigma)
    assert np.sqrt(np.mean(errors**2)) < rms
    assert np.percentile(np.abs(errors), 99) < most


@pytest.mark.parametrize("pair", [1, 2, 3])
def test_a_wrong_tap_is_caught(pair: int, monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong(ratio: float) -> tuple[float, ...]:
        weights = np.array(lattice.taps(ratio))
        weights[[0, pair]] += [-0.02, 0.01]
        return tuple(weights)

    monkeypatch.setattr("skincli.passes.lattice.taps", wrong)
    assert np.sqrt(np.mean(edge_errors(1.41) ** 2)) > 0.002


def test_lines_find_their_nodes() -> None:
    """Among nodes with gaps, those that exist and no others, each in its place."""
    random = np.random.default_rng(8)
    held, wanted = (64 + np.flatnonzero(random.random(400) < 0.4) for _ in range(2))
    row = Row([held, wanted], 9)
    words = lattice._words(row, row.marked(held), wanted).astype(int)
    for word, node in zip(words, wanted, strict=True):
        first, exists = word & (1 << lattice.LINE_BITS) - 1, word >> lattice.LINE_BITS
        near = [k for k in range(-lattice.REACH, lattice.REACH + 1) if node + k in held]
        assert exists == sum(1 << k + lattice.REACH for k in near)
        assert np.array_equal(held[first : first + len(near)], node + np.array(near, dtype=int))


def test_words_survive_as_normal_floats() -> None:
    words = np.array([0, 1, 2**22 - 1, 2**29, 2**30 - 1], dtype=np.uint32)
    floats = as_floats(words)
    assert np.all(np.abs(floats) > np.finfo(np.float32).tiny)
    assert np.all(np.isfinite(floats))
    assert np.array_equal(as_words(floats), words)


def test_constant_light_stays(sheet: Texels) -> None:
    values = np.tile([0.7, 1.0, 3.0], (len(sheet.index), 1))
    np.testing.assert_allclose(diffused(sheet, values, 1.2), values, rtol=1e-12)


@pytest.mark.parametrize(("sigma", "factor"), [(0.75, 1), (1.41, 2), (2.72, 1), (2.72, 2), (2.72, 4)])
def test_agrees_with_the_exact_sum_across_a_seam(sheet: Texels, sigma: float, factor: int) -> None:
    values = checker(sheet)
    wanted = exact(sheet, values, sigma)
    error = (diffused(sheet, values, sigma, factor=factor) - wanted) / np.sqrt(np.mean(wanted**2, axis=0))
    assert np.sqrt(np.mean(error**2, axis=0)).max() < 0.007


def test_agrees_with_the_exact_sum_where_normals_differ() -> None:
    texels = atlas_texels(wavy(height=4.0), 2 * SIZE)
    bent = as_words(tables(texels, 2.72, 2 * SIZE).slices.ravel()[texels.index]) & lattice.BENT > 0
    assert bent.mean() > 0.5
    values = checker(texels)
    some = np.random.default_rng(4).choice(np.flatnonzero(bent), 500, False)
    wanted = exact(texels, values, 2.72, some)
    error = (diffused(texels, values, 2.72, 2 * SIZE)[some] - wanted) / np.sqrt(np.mean(wanted**2, axis=0))
    assert np.sqrt(np.mean(error**2, axis=0)).max() < 0.005


def test_opposed_sheets_keep_their_light_apart() -> None:
    low = wavy(height=0.0)
    back = replace(low, positions=low.positions - 1.0 * low.normals, faces=low.faces[:, ::-1], normals=-low.normals)
    both = Mesh(
        np.concatenate([low.positions, back.positions]),
        np.concatenate([low.normals, back.normals]),
        np.tile(low.uv, (2, 1)),
        np.concatenate([low.atlas_uv * [1, 0.49], back.atlas_uv * [1, 0.49] + [0, 0.5]]),
        np.concatenate([low.faces, back.faces + len(low.positions)]),
        (Part("both", 0, 2 * len(low.faces)),),
    )
    texels = atlas_texels(both, SIZE)
    front = texels.normals @ low.normals[0] > 0
    result = diffused(texels, np.repeat(front[:, None], 3, axis=1).astype(float), 1.5)
    np.testing.assert_allclose(result[front], 1, atol=1e-9)
    np.testing.assert_allclose(result[~front], 0, atol=1e-9)


def test_another_atlas_gives_the_same_light() -> None:
    mesh = wavy()
    turned = replace(mesh, atlas_uv=np.stack([1 - mesh.atlas_uv[:, 1], mesh.atlas_uv[:, 0]], axis=1) * 0.8 + 0.1)
    answers = []
    for one in (mesh, turned):
        texels = atlas_texels(one, 2 * SIZE)
        shade = 0.5 + 0.5 * np.sin(texels.positions[:, :1] / 2)
        light = diffused(texels, np.repeat(shade, 3, axis=1), 1.41, 2 * SIZE)[:, 0]
        cells = np.floor(texels.positions / 1.0).astype(int) @ [1, 1000, 1000000]
        cells, inverse = np.unique(cells, return_inverse=True)
        area = np.bincount(inverse, texels.areas)
        large = area > 0.8
        means = np.bincount(inverse, light * texels.areas) / area
        answers.append(dict(zip(cells[large], means[large], strict=True)))
    shared = answers[0].keys() & answers[1].keys()
    assert len(shared) > 50
    assert np.median([abs(answers[0][cell] - answers[1][cell]) for cell in shared]) < 0.01


def test_tables_come_back_from_arrays(sheet: Texels) -> None:
    made = tables(sheet, 1.0)
    again = lattice.unpack(lattice.pack(made))
    assert made.nbytes == again.nbytes
    assert (made.whole.counts, made.bent.counts) == (again.whole.counts, again.bent.counts)
    assert (made.ratio, made.factor, made.whole.read) == (again.ratio, again.factor, again.whole.read)
    assert made.place_bits == again.place_bits
    assert np.array_equal(made.slices, again.slices)


def test_texels_follow_coverage_and_area() -> None:
    mesh = wavy()
    texels = atlas_texels(mesh, 256)
    covered = surface.coverage(mesh.atlas_uv, mesh.faces, 256) > 0
    assert np.array_equal(texels.index, np.flatnonzero(covered))
    assert texels.areas.sum() == pytest.approx(surface.face_areas(mesh).sum(), rel=0.02)
    np.testing.assert_allclose(np.linalg.norm(texels.normals, axis=1), 1, atol=1e-12)


def test_a_gutter_continues_the_surface_without_area() -> None:
    flat = wavy(height=0.0)
    bare, wide = atlas_texels(flat, SIZE), atlas_texels(flat, SIZE, gutter=2)
    assert set(bare.index) < set(wide.index)
    inside = np.isin(wide.index, bare.index)
    assert np.all((wide.areas > 0) == inside)
    assert np.array_equal(wide.positions[inside], bare.positions)
    np.testing.assert_allclose(wide.positions @ flat.normals[0], flat.positions[0] @ flat.normals[0], atol=1e-9)


@pytest.mark.parametrize("sigma", [0.3, 3.0, 3.9, 4.0, 9.0, 11.7, 11.9, 40.0])
def test_blocks_are_as_large_as_most_of_them_hold(sigma: float) -> None:
    factor = lattice.block_factor(sigma, 1.0)
    reach = lattice.BLOCK_REACH * sigma
    assert (factor - 1) / np.sqrt(2) <= reach < (2 * factor - 1) / np.sqrt(2)
    rows, columns = np.indices((16, 16)).reshape(2, -1)
    place = np.stack([columns, rows, np.zeros(256)], axis=-1).astype(np.float64)
    normal = np.broadcast_to([0.0, 0.0, 1.0], place.shape)
    made = lattice.tables(place, normal, np.ones(256), np.arange(256), 16, sigma, factor)
    # Of each node the first entries are of blocks, the others of texels that give their light by themselves.
    starts = as_words(made.whole.starts.ravel()[: 2 * made.whole.counts[0] + 1]).astype(np.int64)
    alone = (starts[2::2] - starts[1::2]).sum()
    assert alone == 0
    assert starts[-1] > 0


@pytest.mark.parametrize("extent", [(100.0, 100.0, 100.0), (1800.0, 1800.0, 300.0), (10.0, 2000.0, 5.0)])
def test_the_least_sigma_fits_and_half_of_it_does_not(extent: tuple[float, float, float]) -> None:
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * np.array(extent)

    def words(sigma: float) -> int:
        cubes = lattice.Cubes(corners, lattice._spacing(sigma))
        return max(lattice._Lines(2 * cubes.cubes, direction).words for direction in lattice.DIRECTIONS)

    least = lattice.least_sigma(corners)
    assert words(least) <= lattice.MOST_WORDS < words(least / 2)
