"""Which UVs may carry light, and the atlas for those that may not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from skincli import diskcache
from skincli.mesh import surface, unwrap

Floats = NDArray[np.float64]


def square(uv: Floats, z: float = 0.0) -> tuple[Floats, NDArray[np.int64]]:
    return np.column_stack([uv, np.full(len(uv), z)]), np.array([[0, 1, 2], [0, 2, 3]])


UNIT = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])


def reasons(uv: Floats, *more: Floats) -> str:
    """Return the reasons against several squares' UVs, one clause after another."""
    sets = [uv, *more]
    positions = np.concatenate([square(UNIT, z)[0] for z in range(len(sets))])
    faces = np.concatenate([square(UNIT)[1] + 4 * k for k in range(len(sets))])
    return "; ".join(unwrap.why_not_unique(positions, np.concatenate(sets), faces))


def test_what_fills_the_square_is_unique() -> None:
    assert reasons(UNIT) == ""
    assert reasons(UNIT * [0.5, 1], UNIT * [0.5, 1] + [0.5, 0]) == ""
    assert reasons(UNIT * [-0.5, 1] + [0.5, 0], UNIT * [0.5, 1] + [0.5, 0]) == ""  # mirrored, but beside it


def test_reasons_carry_figures() -> None:
    assert "100.0% of the covered texels are shared" in reasons(UNIT, UNIT)
    assert "50.0% of the covered texels are shared" in reasons(UNIT, UNIT * [0.5, 1])
    assert "leave the square" in reasons(UNIT + np.array([1, 0]))
    assert "leave the square" in reasons(UNIT * 1.001)
    assert "50.0% of the surface has no area" in reasons(UNIT, UNIT * 0)
    assert "fill only 4.0% of the square" in reasons(UNIT * 0.2)
    assert "missing" in reasons(UNIT * np.nan)


def test_a_little_overlap_and_rounding_are_let_pass() -> None:
    assert reasons(UNIT * (1 + 1e-7)) == ""
    assert reasons(UNIT, UNIT * 0.02 + 0.3) == ""  # 0.04 % of the texels
    assert "shared" in reasons(UNIT, UNIT * 0.05 + 0.3)  # 0.25 %


def ball(subdivisions: int = 3) -> tuple[Floats, Floats, NDArray[np.int64]]:
    sphere = trimesh.creation.icosphere(subdivisions=subdivisions, radius=80.0)
    positions = np.array(sphere.vertices)
    return positions, positions / 80.0, np.array(sphere.faces, dtype=np.int64)


def test_an_atlas_is_unique_and_changes_nothing_else() -> None:
    positions, normals, faces = ball()
    source, split, uv = unwrap.atlas(positions, normals, faces, use_cache=False)
    assert np.array_equal(source[split], faces)
    assert uv.min() >= 0
    assert uv.max() <= 1
    assert unwrap.why_not_unique(positions[source], uv, split) == []
    assert (surface.coverage(uv, split, 2048) > 1).sum() == 0
    assert (surface.uv_areas(uv, split) > 0).all()  # no chart is mirrored or folded


def test_texels_are_square_and_even() -> None:
    positions, normals, faces = ball()
    source, split, uv = unwrap.atlas(positions, normals, faces, use_cache=False)
    dpdu, dpdv = surface.tangents(positions[source], split, uv)
    lengths = np.linalg.norm(np.concatenate([dpdu, dpdv]), axis=1)
    assert np.percentile(lengths, 5) / np.percentile(lengths, 95) > 0.7


@pytest.mark.parametrize("subdivisions", [1, 3])
def test_charts_keep_their_distance(subdivisions: int) -> None:
    from scipy.ndimage import binary_dilation
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    positions, normals, faces = ball(subdivisions)
    _, split, uv = unwrap.atlas(positions, normals, faces, use_cache=False)
    count = len(uv)
    graph = coo_array((np.ones(2 * len(split)), (split[:, :2].T.ravel(), split[:, 1:].T.ravel())), shape=(count, count))
    charts, label = connected_components(graph, directed=False)
    assert charts > 1
    grown = np.zeros((1024, 1024), dtype=np.int64)
    for chart in range(charts):
        mine = surface.coverage(uv, split[label[split[:, 0]] == chart], 1024) > 0
        grown += binary_dilation(mine, np.ones((3, 3)), iterations=2)
    assert grown.max() == 1  # two texels around each, so four between


def test_the_atlas_does_not_depend_on_size() -> None:
    positions, normals, faces = ball(2)
    small = unwrap.atlas(positions * 2.0**-10, normals, faces, use_cache=False)
    for one, other in zip(unwrap.atlas(positions, normals, faces, use_cache=False), small, strict=True):
        assert np.array_equal(one, other)


def test_the_atlas_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SKINCLI_CACHE", str(tmp_path))
    positions, normals, faces = ball(1)
    first = unwrap.atlas(positions, normals, faces)
    assert len(list(diskcache.folder().iterdir())) == 1
    monkeypatch.setattr(unwrap, "_run_xatlas", None)
    for one, other in zip(first, unwrap.atlas(positions, normals, faces), strict=True):
        assert np.array_equal(one, other)
    with pytest.raises(TypeError):
        unwrap.atlas(positions + 1.0, normals, faces)
