"""`skincli bench --diffusion` measures a small ring in seconds, and finds a width that is wrong."""

from __future__ import annotations

import copy
import functools
import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

from skincli.bench import report, surfaces
from skincli.bench.scene import ring
from skincli.cli import root
from skincli.mesh import lattice
from skincli.mesh.model import Mesh
from skincli.mesh.subdivide import subdivided
from skincli.mesh.surface import face_areas
from skincli.mesh.texels import atlas_texels


@functools.cache
def small_ring() -> Mesh:
    """Return a ring about as large as a hand."""
    mesh = ring(48, 24)
    return replace(mesh, positions=0.5 * mesh.positions)


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch, ctx: object) -> None:
    """Let few points of the ring be measured on a small atlas."""
    monkeypatch.setattr(surfaces, "builtins", lambda: {"ring": small_ring()})
    monkeypatch.setattr(surfaces, "ATLAS_OF_QUALITY", {"draft": 64, "standard": 128, "high": 256})
    for name, count in (("POINTS", 2000), ("SEAM_PAIRS", 200), ("FINE_SAMPLES", 100_000)):
        monkeypatch.setattr(surfaces, name, count)
    monkeypatch.setattr(surfaces, "SCENE", surfaces.SCENE.replace("[640, 480]", "[160, 120]"))
    plain = "skin={layers: [{color: {albedo: [0.7, 0.4, 0.3]}}]}"
    monkeypatch.setattr(surfaces, "PICTURE_SETS", (plain, "render.size=[96, 72]", "render.supersample=1"))


def bench(*words: object) -> Result:
    return CliRunner().invoke(root, ["bench", "--diffusion", *map(str, words)])


@pytest.mark.usefixtures("small")
def test_the_diffusion_is_measured(tmp_path: Path) -> None:
    done = bench("-o", tmp_path)
    assert done.exit_code == 0, done.output
    document = json.loads((tmp_path / "bench.json").read_text("utf-8"))
    found = document["surfaces"]
    assert found["points"] == 2000
    rows: dict[tuple[str, str, str], dict[str, Any]] = {
        (row["layout"], row["light"], row["kernel"]): row for row in found["rows"]
    }
    kernels = ("0.75 mm", "1.41 mm", "2.72 mm", "human")
    assert set(rows) == {(a, b, c) for a in ("own", "other") for b in surfaces.LIGHTS for c in kernels}
    for row in rows.values():
        assert 0 < row["filter"] < 0.02
        assert row["filter"] < row["maximum"]
        assert row["p99"] <= row["maximum"]
        assert 0 < row["sampling"] < row["halved"]
        assert row["seam"] > 0
        assert ("p99" in row["misses"]) == (row["p99"] > surfaces.P99_AIM)
    for layout in ("own", "other"):
        # Hard edges are the hardest, and a wide Gaussian hides the texels that a narrow one shows.
        checker, lambert = (
            [rows[layout, light, kernel]["sampling"] for kernel in kernels] for light in ("checker", "Lambert")
        )
        assert checker[0] > checker[1] > checker[2]
        assert all(a > b for a, b in zip(checker, lambert, strict=True))
    for one in found["layouts"]:
        assert one["constant"] < 1e-5
        assert one["table_mb"] > 0
        assert one["frame"]["count"] == 3
        assert one["seam_pixels"] > 20
    changed = {picture["changed"]: picture["flip"] for picture in found["pictures"]}
    assert set(changed) == {"another atlas_uv", "atlas 64 for 128", "subdivided"}
    assert max(changed.values()) < 0.02
    text = (tmp_path / "bench.txt").read_text("utf-8")
    assert text == report.as_text(document) + "\n"
    assert "The diffusion by itself" in (tmp_path / "bench.html").read_text("utf-8")

    def compared(change: Callable[[dict[str, Any]], None]) -> Result:
        other = copy.deepcopy(document)
        change(other)
        (tmp_path / "other.json").write_text(json.dumps(other))
        return CliRunner().invoke(root, ["bench", "compare", str(tmp_path), str(tmp_path / "other.json")])

    same = compared(lambda _: None)
    assert same.exit_code == 0, same.output
    # Of each row filter, p99, maximum, seam, sampling; of each layout constant, tables, three steps, build, frame.
    assert f"{24 * 5 + 2 * 7 + 3} numbers compared, 0 worse" in same.stdout

    def worsen(other: dict[str, Any]) -> None:
        other["surfaces"]["rows"][0]["seam"] *= 1.06
        other["surfaces"]["layouts"][1]["frame"]["median"] *= 1.3
        other["surfaces"]["layouts"][0]["build_s"] *= 1.2
        other["surfaces"]["pictures"][2]["flip"] = math.nan

    worse = compared(worsen)
    assert worse.exit_code == 1
    found_worse = [line.split()[:-5] for line in worse.stdout.splitlines() if line.endswith("WORSE")]
    assert found_worse == [
        ["ring:", "other", "frame", "ms"],
        ["ring:", "own:", "checker:", "0.75", "mm", "seam"],
        ["ring:", "subdivided", "flip"],
    ]
    # Times of another machine say nothing.
    document["device"]["cores"] += 1
    assert ", 2 worse" in compared(worsen).stdout
    finer = compared(lambda other: other["surfaces"]["layouts"][0].update(atlas=256))
    assert finer.exit_code == 3
    assert "ring: own: atlas: 128 in OLD, 256 in NEW" in finer.stderr


@pytest.mark.usefixtures("small")
def test_a_wrong_width_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    genuine = lattice.tables

    def wider(positions: Any, *of: Any) -> Any:
        # What lies 10 % nearer to each other is blurred as much wider.
        return genuine(positions / 1.1, *of)

    monkeypatch.setattr(lattice, "tables", wider)
    monkeypatch.setattr(surfaces, "pictures", lambda *_: [])
    done = bench()
    assert done.exit_code == 1
    for kernel in ("0.75 mm", "1.41 mm", "2.72 mm"):
        assert f"ring, own, checker, {kernel}: the diffusion is" in done.stderr


@pytest.mark.parametrize("words", [["--paper"], ["--stress"], ["--max-error", "0.1"]])
def test_words_that_do_not_go_with_it_are_usage_errors(words: list[str]) -> None:
    assert bench(*words).exit_code == 2


def test_light_is_averaged_over_texels_as_the_surface_lies() -> None:
    """The average over a texel is that of the texels of an atlas that is finer by as much as an edge is looked at."""
    mesh, finer = ring(192, 96), 4
    coarse, fine = (atlas_texels(mesh, size, 2) for size in (128, finer * 128))
    light = surfaces.light_of_texels(coarse, 128)[coarse.areas > 0]
    parts = surfaces.lights(fine.positions, fine.normals)[fine.areas > 0]
    owner = fine.index // (finer**2 * 128) * 128 + fine.index % (finer * 128) // finer
    owner = owner[fine.areas > 0]
    count = np.bincount(owner, minlength=128**2)
    mean = np.stack([np.bincount(owner, column, 128**2) for column in parts.T], axis=1) / np.maximum(count, 1)[:, None]
    index = coarse.index[coarse.areas > 0]
    whole = count[index] == finer**2
    assert whole.sum() > 8000
    apart = np.abs(light[whole] - mean[index][whole])
    # A place just beside an edge of the checker may fall on its other side.
    assert (apart[:, 0] > 0.02).mean() < 0.06
    # The noise's cells are hardly wider than these texels.
    assert apart[:, 1:].max() < 0.1
    assert (apart.mean(axis=0) < [0.004, 0.001, 0.006]).all()


def test_subdivision_moves_no_point() -> None:
    mesh = small_ring()
    found = subdivided(mesh)
    assert len(found.faces) == 4 * len(mesh.faces)
    assert [(part.start, part.stop) for part in found.parts] == [(4 * p.start, 4 * p.stop) for p in mesh.parts]
    np.testing.assert_allclose(face_areas(found).reshape(-1, 4).sum(axis=1), face_areas(mesh), rtol=1e-12)
    corners = found.positions[found.faces].reshape(-1, 12, 3)
    np.testing.assert_allclose(corners.mean(axis=1), mesh.positions[mesh.faces].mean(axis=1), atol=1e-9)


def test_seams_are_the_borders_of_charts() -> None:
    mesh = ring(16, 8)
    seams = surfaces.Seams.of(mesh)
    # Two halves, each cut along the ring once and joined at both ends.
    assert len(seams.ends) == 16 + 2 * 8
    assert (seams.uv[0] != seams.uv[1]).any(axis=(1, 2)).all()
    texels = atlas_texels(mesh, 128)
    pairs = seams.pairs(texels, 128, 1000)
    assert len(pairs) > 20
    one, other = texels.positions[pairs.T]
    assert np.linalg.norm(one - other, axis=1).max() < 12
