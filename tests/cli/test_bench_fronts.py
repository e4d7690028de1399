"""`skincli bench` sweeps, picks, verifies and compares: a small sweep from the scene to the page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from skincli.bench import fronts
from skincli.bench.fronts import Settings
from skincli.bench.scene import ring
from skincli.cli import root
from skincli.mesh.model import Mesh

SCENE = """
scene: 1
mesh: {builtin: head}  # stands in for the ring, which is made in code
skin: {layers: [{color: {albedo: [0.7, 0.45, 0.35]}}], optics: {color: [0.5, 0.3, 0.2], radius: [8, 4, 2]}}
camera: {position: [60, 210, 330], target: [0, 0, 0], fov: 30}
lights: [{type: directional, direction: [-0.5, -0.6, -1], irradiance: [2.0, 1.8, 1.6]}]
render: {size: [96, 72], atlas: 64}
"""

POINTS: list[tuple[str, Settings]] = [
    ("none", {"atlas": 64}),
    ("lattice", {"atlas": 64, "terms": 3}),
    ("lattice", {"atlas": 128, "terms": 3}),
    ("screen_space", {"atlas": 128, "terms": 3}),
]


@pytest.fixture
def scene(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, ctx: object) -> Path:
    """Write a scene whose sweep takes seconds."""

    def load_scene_mesh(_: object) -> Mesh:
        return ring(48, 24)

    def grid(_: bool) -> list[tuple[str, Settings]]:
        return POINTS

    monkeypatch.setattr(fronts, "load_scene_mesh", load_scene_mesh)
    monkeypatch.setattr(fronts, "grid", grid)
    monkeypatch.setattr(fronts, "TRACED_POINTS", 200)
    monkeypatch.setattr(fronts, "ROUNDS", 2)
    monkeypatch.setattr(fronts, "ATLAS_OF_QUALITY", {"draft": 64, "standard": 128, "high": 256})
    file = tmp_path / "scene.yaml"
    file.write_text(SCENE)
    return file


def test_a_scene_is_swept_to_a_page_and_compared(scene: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    done = CliRunner().invoke(root, ["bench", str(scene), "--max-error", "0.05", "-o", str(folder)])
    assert done.exit_code == 0, done.output
    sweep = json.loads((folder / "bench.json").read_text("utf-8"))["sweep"]
    picture = {p["name"]: p for p in sweep["points"] if p["stage"] == "picture"}
    assert len(picture) == len(POINTS)
    near, far = picture["lattice, atlas 128, terms 3"], picture["none, atlas 64"]
    # The atlas of the reference has no sampling error; what it diffuses is close to the sum over all texels.
    assert near["sampling_error"] == 0
    assert near["filter_error"] == pytest.approx(near["errors"]["relative_rmse"], rel=0.02)
    assert near["errors"]["relative_rmse"] < 0.02 < far["errors"]["relative_rmse"]
    assert far["sampling_error"] > 0
    assert near["errors"]["flip"] < far["errors"]["flip"]
    assert all(p["errors"]["nonfinite"] == 0 for p in sweep["points"])
    assert any(p["front"] for p in picture.values())
    # In the picture there is no light on the atlas to compare.
    atlas = {p["name"] for p in sweep["points"] if p["stage"] == "diffusion"}
    assert atlas == {name for name in picture if not name.startswith("screen_space")}
    samples = [p for p in sweep["points"] if p["stage"] == "supersampling"]
    assert [p["settings"]["samples"] for p in samples] == [1, 2, 3]
    errors = [p["errors"]["relative_rmse"] for p in samples]
    assert errors[0] > errors[1] > errors[2]
    chosen = sweep["chosen"]
    assert chosen["errors"]["relative_rmse"] <= 0.05
    assert chosen["errors"] == picture[chosen["point"]]["errors"]
    cheaper = [p for p in picture.values() if p["ms"]["median"] < picture[chosen["point"]]["ms"]["median"]]
    assert all(p["errors"]["relative_rmse"] > 0.05 for p in cheaper)
    assert chosen["point"] in done.stdout
    page = (folder / "bench.html").read_text("utf-8")
    assert page.count("<svg") >= 3
    assert "data:image/png;base64," in page

    same = CliRunner().invoke(root, ["bench", "compare", str(folder), str(folder / "bench.json")])
    assert same.exit_code == 0, same.output
    assert ", 0 worse" in same.stdout
    found = json.loads((folder / "bench.json").read_text("utf-8"))
    found["sweep"]["points"][0]["errors"]["relative_rmse"] *= 1.2
    (tmp_path / "worse.json").write_text(json.dumps(found))
    worse = CliRunner().invoke(root, ["bench", "compare", str(folder), str(tmp_path / "worse.json")])
    assert worse.exit_code == 1
    assert "WORSE" in worse.stdout


def test_an_error_that_no_point_holds_ends_with_exit_code_6(scene: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fronts, "grid", lambda _: POINTS[:1])
    for stage in ("_occlusion", "_supersampling"):
        monkeypatch.setattr(fronts.Sweep, stage, lambda _: [])
    done = CliRunner().invoke(root, ["bench", str(scene), "--max-error", "1e-9"])
    assert done.exit_code == 6
    assert "none of 1 points holds it" in done.stderr


def test_a_pick_that_does_not_hold_again_ends_with_exit_code_1(scene: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fronts, "grid", lambda _: POINTS[:1])
    for stage in ("_occlusion", "_supersampling"):
        monkeypatch.setattr(fronts.Sweep, stage, lambda _: [])
    rendered, calls = fronts.Reference.errors, []

    def drifting(self: fronts.Reference, pipeline: fronts.Pipeline) -> tuple[fronts.Shown, fronts.Errors]:
        calls.append(pipeline)
        shown, errors = rendered(self, pipeline)
        return shown, fronts.replace(errors, relative_rmse=float(np.float64(len(calls))))

    monkeypatch.setattr(fronts.Reference, "errors", drifting)
    done = CliRunner().invoke(root, ["bench", str(scene), "--max-error", "1.5"])
    assert done.exit_code == 1
    assert "had a relative RMSE of 1, but 2 when rendered anew" in done.stderr


@pytest.mark.parametrize(
    "words",
    [["--paper", "--max-error", "0.1"], ["--stress", "--full"], ["--set", "render.atlas=64"], ["compare", "one"]],
)
def test_words_that_do_not_go_together_are_usage_errors(words: list[str]) -> None:
    assert CliRunner().invoke(root, ["bench", *words]).exit_code == 2


EMPTY: dict[str, Any] = {"sweep": None, "stages": [], "surfaces": None}
SWEPT: dict[str, Any] = {"scene": {"triangles": 8, "size": [4, 3], "reference": "exact"}, "points": []}
DIFFUSED: dict[str, Any] = {
    "points": 9,
    "rows": [],
    "layouts": [],
    "pictures": [{"mesh": "a", "changed": "b", "flip": 0.0}],
}


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ({"frames": []}, {}, "no report of a bench"),
        ({"bench": 2}, {}, "a report of format 2; format 1 is read"),
        ({"bench": 1, **EMPTY}, {}, "nothing that is compared"),
        ({"surfaces": DIFFUSED}, {"sweep": SWEPT}, "OLD holds the diffusion by itself, NEW a scene's sweep"),
        ({"sweep": SWEPT}, {"sweep": {"scene": {**SWEPT["scene"], "triangles": 9}}}, "triangles: 8 in OLD, 9 in NEW"),
        ({"surfaces": DIFFUSED}, {"surfaces": {**DIFFUSED, "points": 5}}, "points: 9 in OLD, 5 in NEW"),
    ],
)
def test_benches_that_cannot_be_compared_are_refused(
    old: dict[str, Any], new: dict[str, Any], says: str, tmp_path: Path
) -> None:
    whole: dict[str, Any] = {"bench": 1, **EMPTY, "device": {}}
    for name, found in (("old", old), ("new", new)):
        is_part = not found.keys() & {"bench", "frames"}
        (tmp_path / f"{name}.json").write_text(json.dumps({**whole, **found} if is_part else found))
    done = CliRunner().invoke(root, ["bench", "compare", str(tmp_path / "old.json"), str(tmp_path / "new.json")])
    assert done.exit_code == 3
    assert says in done.stderr


def test_a_negative_error_is_a_usage_error(scene: Path) -> None:
    done = CliRunner().invoke(root, ["bench", str(scene), "--max-error", "-1"])
    assert done.exit_code == 2
    assert "--max-error -1" in done.stderr
