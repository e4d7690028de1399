"""`skincli bench` finds a deliberate fault in any stage, and reports error and time."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner

from skincli.bench import fronts, generator, report, stages, timing
from skincli.bench.scene import ring
from skincli.bench.stages import STAGES, compare_stages
from skincli.cli import root
from skincli.gpu import program
from skincli.mesh.model import Mesh

Inject = Callable[[str, str, str], None]


@pytest.fixture
def inject(ctx: object) -> Iterator[Inject]:
    """Exchange a piece of a shader file as programs read it, until the test ends."""
    genuine = program._file_lines

    def put(file: str, old: str, new: str) -> None:
        text = "\n".join(genuine(file))
        assert text.count(old) == 1, f"shaders/{file} holds '{old}' {text.count(old)} times"
        faulty = tuple(text.replace(old, new).splitlines())
        patch.setattr(program, "_file_lines", lambda name: faulty if name == file else genuine(name))
        program.program_text.cache_clear()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stages, "STAGE_SCENE", stages.STAGE_SCENE.replace("[320, 240]", "[160, 120]"))
        yield put
    program.program_text.cache_clear()


FAULTS = [
    ("passes/slope.frag", "0.5 * vec2(size)", "vec2(size)", "paper", {"slope"}),
    ("lib/bump.glsl", "- gradient;", "+ gradient;", "paper", {"bump"}),
    ("lib/bump.glsl", "sign(det) * ", "", "paper", {"bump"}),
    ("passes/irradiance.frag", "response.x * p.ambient", "p.ambient", "paper", {"lighting"}),
    ("lib/light.glsl", "falloff *= x * x * (3.0 - 2.0 * x)", "falloff *= x", "paper", {"lighting", "specular"}),
    ("lib/light.glsl", "/ distance2;", "/ (1000.0 * sqrt(distance2));", "paper", {"lighting", "specular"}),
    ("passes/blur.frag", "k <= p.radius", "k < p.radius", "paper", {"blur"}),
    ("passes/blur.frag", "sum.rgb / sum.a", "sum.rgb", "paper", {"blur"}),
    ("passes/blur.frag", "p.slot > 0 &&", "p.slot > 9 &&", "paper", {"blur"}),
    ("passes/occlusion_band.frag", "k < p.count;", "k < p.count - 1;", "paper", {"occlusion band"}),
    ("passes/occlusion_band.frag", "+ o.z * n", "- o.z * n", "paper", {"occlusion band"}),
    ("passes/occlusion_band.frag", "z - seen > bias - p", "z - seen > -p", "paper", {"occlusion band"}),
    (
        "passes/occlusion.frag",
        "p.a * log2(max(high, 1e-30)) + p.b * log2(max(low, 1e-30))",
        "p.b * log2(max(high, 1e-30)) + p.a * log2(max(low, 1e-30))",
        "paper",
        {"Equation 1"},
    ),
    ("passes/specular.frag", "R - V", "N.xyz - V", "paper", {"specular"}),
    ("passes/reflection.frag", "atan(R.x, -R.z)", "atan(R.x, R.z)", "paper", {"reflection"}),
    ("passes/reflection.frag", "2.0 * turned", "turned", "paper", {"reflection"}),
    ("passes/reflection.frag", "p.damping)", "0.0)", "paper", {"reflection"}),
    ("passes/absorb.frag", "vec3(1.0)", "vec3(0.9)", "physical", {"absorption"}),
    ("passes/combine.frag", "weight * value", "value", "physical", {"sum of Gaussians"}),
    ("passes/lattice_slice.frag", "(M + m)", "(M - m)", "physical", {"lattice"}),
    ("passes/compose.frag", "p.tint_highlights)", "1.0 - p.tint_highlights)", "physical", {"Equation 2"}),
    ("passes/compose.frag", "left_skin * open * way_out", "left_skin * way_out", "paper", {"Equation 2"}),
    ("passes/display.frag", " * p.gain", "", "paper", {"display"}),
]


def test_there_is_a_fault_for_each_stage() -> None:
    assert set().union(*(fault[-1] for fault in FAULTS)) == {stage.name for stage in STAGES.values()}


@pytest.mark.parametrize(("file", "old", "new", "shading", "guilty"), FAULTS, ids=lambda value: str(value)[:32])
def test_a_fault_shows_in_its_stage_only(
    inject: Inject, file: str, old: str, new: str, shading: str, guilty: set[str]
) -> None:
    inject(file, old, new)
    assert {error.stage for error in compare_stages([shading]) if not error.passed} == guilty


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the clock run over one frame each of tiny pictures of the ring."""

    def load_scene_mesh(_: object) -> Mesh:
        return ring(16, 8)

    plain = "{layers: [{color: {albedo: [0.6, 0.4, 0.3]}}]}"
    for module in (timing, fronts):
        monkeypatch.setattr(module, "load_scene_mesh", load_scene_mesh)
    monkeypatch.setattr(fronts, "METHODS", ("none", "paper"))
    monkeypatch.setattr(
        timing, "TIMED_SETS", ("skin.size=32", f"skin={plain}", "render.size=[64, 48]", "render.atlas=64")
    )
    monkeypatch.setattr(
        timing, "PAPER_SCENE", timing.PAPER_SCENE.replace("shading: paper", "shading: paper, atlas: 64")
    )
    monkeypatch.setattr(timing, "PAPER_SCENE", timing.PAPER_SCENE.replace("octopus", plain))
    for name in ("ROUNDS", "PAPER_ROUNDS"):
        monkeypatch.setattr(timing, name, 1)
    monkeypatch.setattr(fronts, "load_scene_mesh", load_scene_mesh)
    monkeypatch.setattr(fronts, "grid", lambda _: [("none", {"atlas": 64})])
    monkeypatch.setattr(fronts, "ATLAS_OF_QUALITY", {"draft": 64, "standard": 128, "high": 256})
    for stage in ("_occlusion", "_supersampling"):
        monkeypatch.setattr(fronts.Sweep, stage, lambda _: [])
    monkeypatch.setattr(stages, "STAGE_SCENE", stages.STAGE_SCENE.replace("[320, 240]", "[160, 120]"))
    monkeypatch.setattr(generator, "time_presets", lambda _: [])


@pytest.mark.usefixtures("ctx")
def test_the_generator_is_timed(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, side in (("LAYER_SIDE", 16), ("PRESET_SIDE", 32), ("TWIN_SIDE", 8)):
        monkeypatch.setattr(generator, name, side)
    monkeypatch.setattr(generator.presets, "names", lambda: ["alien"])
    (preset,) = generator.time_presets(2)
    assert (preset["preset"], preset["side"], preset["ms"]["count"]) == ("alien", 32, 2)
    assert preset["ms_per_megatexel"] == pytest.approx(preset["ms"]["median"] / (32**2 / 1e6), rel=1e-3)
    every = generator.shown_layers()
    one = next(kind for kind, (_, layer) in sorted(every.items()) if kind == "worley")
    monkeypatch.setattr(generator, "shown_layers", lambda: {one: every[one]})
    (layer,) = generator.time_layers()
    assert (layer["layer"], layer["preset"]) == (one, "alien")
    assert layer["twin_ratio"] > 0
    text = report.as_text(report.document(presets=[preset], layers=[layer]))
    assert "Maps of the presets, 32 x 32 texels" in text
    assert "Layers, each alone" in text


@pytest.mark.usefixtures("ctx", "small")
def test_the_report_is_complete(tmp_path: Path) -> None:
    done = CliRunner().invoke(root, ["bench", "--json", "-o", str(tmp_path / "made" / "here")])
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert found["device"]["renderer"]
    assert found["device"]["cores"] >= 1
    assert "skincli" in found["versions"]
    assert {stage["stage"] for stage in found["stages"]} == {stage.name for stage in STAGES.values()}
    assert all(stage["passed"] for stage in found["stages"])
    assert found["frames"]["cold_ms"] > 0
    assert found["frames"]["warm"]["count"] == 1
    nodes = {node["name"]: node for node in found["nodes"]}
    # The camera moved: what lies in the atlas stayed, what the camera sees did not.
    assert nodes["irradiance"]["warm"] is None
    assert nodes["irradiance"]["cold_ms"] > 0
    assert nodes["view"]["warm"]["low"] <= nodes["view"]["warm"]["median"] <= nodes["view"]["warm"]["high"]
    assert found["paper"] == []
    written = tmp_path / "made" / "here"
    assert json.loads((written / "bench.json").read_text("utf-8")) == found
    text = (written / "bench.txt").read_text("utf-8")
    assert text == report.as_text(found) + "\n"
    assert found["device"]["renderer"] in text
    assert "FAILS" not in text


@pytest.mark.usefixtures("ctx", "small")
def test_a_fault_ends_with_exit_code_1_and_names_the_stage(inject: Inject, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timing, "time_scene", lambda: ({}, []))
    monkeypatch.setattr(fronts.Sweep, "run", lambda *_: None)
    inject("passes/blur.frag", "k <= p.radius", "k < p.radius")
    done = CliRunner().invoke(root, ["bench"])
    assert done.exit_code == 1
    assert "FAILS" in done.stdout
    assert "stage blur (node diffused_rows, paper) differs from its twin" in done.stderr
    assert "stage lighting" not in done.stderr


def test_the_table_is_the_papers() -> None:
    """[Fecko2013, Table 1]"""
    sizes = [(640, 480), (800, 600), (1280, 720), (1920, 1080)]
    assert list(timing.PAPER_TABLE) == [(detail, size) for detail in ("65k", "259k") for size in sizes]
    assert list(timing.PAPER_TABLE.values()) == [63, 63, 47, 31, 46, 35, 31, 21]


@pytest.mark.usefixtures("ctx", "small")
def test_the_papers_table_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timing, "PAPER_TABLE", {("65k", (64, 48)): 63, ("65k", (96, 64)): 50})
    done = CliRunner().invoke(root, ["bench", "--paper", "--json"])
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert found["stages"] == found["nodes"] == []
    assert [(row["size"], row["paper_fps"]) for row in found["paper"]] == [([64, 48], 63), ([96, 64], 50)]
    for row in found["paper"]:
        assert row["triangles"] == len(ring(16, 8).faces)
        # A frame rate beside the paper's must not leave out what the paper's program did in every frame.
        texture_space = {"atlas", "irradiance", "diffused_rows", "diffused"}
        assert texture_space | {"view", "specular", "reflection", "compose"} < set(row["full_nodes"])
        assert set(row["full_nodes"]) - set(row["camera_nodes"]) == texture_space
        assert not {"skin0_maps", "environment"} & set(row["full_nodes"])
        assert row["full_fps"] == pytest.approx(1000 / row["full"]["median"], rel=1e-2)
        assert row["full_to_paper"] == pytest.approx(row["full_fps"] / row["paper_fps"], rel=1e-2)
    assert "96 x 64" in report.as_text(found)


@pytest.mark.usefixtures("ctx", "small")
def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(timing, "PAPER_TABLE", {("65k", (64, 48)): 63})
    done = CliRunner().invoke(root, ["bench", "--paper", "-o", str(tmp_path / "file")])
    assert done.exit_code == 7
    assert str(tmp_path / "file") in done.stderr
