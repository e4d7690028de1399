"""Windows and their lists name every texel within reach once, wherever charts end and the surface turns."""

from __future__ import annotations

import numpy as np
import pytest

from skincli.errors import LimitError
from skincli.mesh import windows
from skincli.mesh.windows import RADIUS_BITS, REACH, ROW_BITS, WindowTables
from skincli.mesh.words import as_words

SIZE = 40


def named(tables: WindowTables, block: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the places that the window of a block covers, and those that its list names, as row * side + column."""
    side = len(tables.reach)
    word = int(as_words(tables.reach.ravel())[block])
    mask = (1 << RADIUS_BITS) - 1
    wide, high, number = word & mask, word >> RADIUS_BITS & mask, word >> 2 * RADIUS_BITS
    row, column = divmod(block, side)
    y, x = (axis.ravel() for axis in np.mgrid[-high : high + 1, -wide : wide + 1])
    inside = (row + y >= 0) & (row + y < side) & (column + x >= 0) & (column + x < side)
    seen = ((row + y) * side + column + x)[inside]
    if not number:
        return seen, np.zeros(0, dtype=np.int64)
    starts = as_words(tables.starts.ravel()).astype(np.int64)
    address = as_words(tables.entries.ravel()).astype(np.int64)[starts[number - 1] : starts[number]]
    return seen, (address & (1 << ROW_BITS) - 1) * side + (address >> ROW_BITS)


def charts(bend: float) -> tuple[np.ndarray, np.ndarray]:
    """Return (SIZE², 3) points, 1 mm apart, and normals: a plane whose halves are two charts.

    Rows of the second half lie upside down; beyond the cut the plane is bent by so many degrees.
    """
    row, column = np.mgrid[0:SIZE, 0:SIZE]
    half = SIZE // 2
    second = column >= half
    x = np.where(second, column - half, column - half) + 0.5
    y = np.where(second, SIZE - 1 - row, row) + 0.5
    angle = np.radians(bend) * second
    positions = np.stack([x * np.cos(angle), y, x * np.sin(angle)], axis=-1).astype(float)
    normals = np.stack([-np.sin(angle), np.zeros_like(angle), np.cos(angle)], axis=-1)
    return positions.reshape(-1, 3), normals.reshape(-1, 3)


@pytest.mark.parametrize("bend", [0.0, 50.0])
@pytest.mark.parametrize("sigma", [0.6, 1.3])
def test_every_neighbor_counts_once(bend: float, sigma: float) -> None:
    positions, normals = charts(bend)
    texel = np.arange(SIZE**2)
    tables = windows.tables(positions, normals, np.ones(SIZE**2), texel, SIZE, sigma, 1)
    reach = REACH * sigma
    for block in range(0, SIZE**2, 37):
        seen, listed = named(tables, block)
        assert len(np.intersect1d(seen, listed)) == 0
        assert len(np.unique(listed)) == len(listed)
        away = np.linalg.norm(positions - positions[block], axis=1)
        assert set(np.flatnonzero(away <= reach - 1)) <= {*seen.tolist(), *listed.tolist()}
        assert (away[listed] <= reach).all()


def test_inside_a_chart_there_is_no_list() -> None:
    positions, normals = charts(0.0)
    tables = windows.tables(positions, normals, np.ones(SIZE**2), np.arange(SIZE**2), SIZE, 0.8, 1)
    words = as_words(tables.reach[..., 0])
    listed = words >> 2 * RADIUS_BITS > 0
    assert not listed[4:-4, 4:16].any()
    assert not listed[4:-4, 24:-4].any()
    assert listed[:, 19:21].all()
    assert listed[[0, -1]].all()
    assert tables.nbytes == tables.reach.nbytes + tables.starts.nbytes + tables.entries.nbytes


def test_stretched_texels_widen_the_window() -> None:
    positions, normals = charts(0.0)
    for stretch, wanted in ((1.0, (2, 2)), (0.5, (4, 2))):
        where = positions * [stretch, 1, 1]
        tables = windows.tables(where, normals, np.full(SIZE**2, stretch), np.arange(SIZE**2), SIZE, 0.8, 1)
        word = int(as_words(tables.reach[20, 8])[0])
        assert (word & 15, word >> 4 & 15) == wanted


def test_points_without_area_only_receive() -> None:
    positions, normals = charts(0.0)
    areas = np.ones((SIZE, SIZE))
    areas[:, 0] = 0
    tables = windows.tables(positions, normals, areas.ravel(), np.arange(SIZE**2), SIZE, 0.8, 1)
    seen, listed = named(tables, 10 * SIZE)
    assert seen.tolist() == [10 * SIZE]
    assert sorted(listed.tolist()) == [9 * SIZE + 1, 10 * SIZE + 1, 10 * SIZE + 2, 11 * SIZE + 1]


def test_blocks_stand_for_their_texels() -> None:
    positions, normals = charts(0.0)
    tables = windows.tables(positions, normals, np.ones(SIZE**2), np.arange(SIZE**2), SIZE, 1.6, 2)
    assert tables.reach.shape == (SIZE // 2, SIZE // 2, 1)
    word = int(as_words(tables.reach[10, 5])[0])
    assert (word & 15, word >> 4 & 15) == (2, 2)


def test_too_many_borders_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(windows, "MOST_LISTS", 10)
    positions, normals = charts(0.0)
    with pytest.raises(LimitError, match="near borders of its charts; at most 10 are allowed; choose"):
        windows.tables(positions, normals, np.ones(SIZE**2), np.arange(SIZE**2), SIZE, 0.8, 1)


def test_tables_survive_the_disk() -> None:
    positions, normals = charts(20.0)
    tables = windows.tables(positions, normals, np.ones(SIZE**2), np.arange(SIZE**2), SIZE, 0.8, 1)
    again = windows.unpack(windows.pack(tables))
    assert again.factor == tables.factor
    for name in windows.ARRAYS:
        np.testing.assert_array_equal(getattr(again, name).view(np.uint32), getattr(tables, name).view(np.uint32))
