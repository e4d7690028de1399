"""Laws of the whole pipeline: skipping is exact, light is linear, place and unit do not matter, culling culls."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from skincli.gpu.counters import COUNTERS
from skincli.mesh.model import Mesh, Part
from skincli.metrics import flip
from skincli.passes.lattice import LatticeGradient
from skincli.pipeline import OUTPUTS, Pipeline, load_scene_mesh
from skincli.scene.model import Camera
from skincli.scene.paths import LoadedScene

Make = Callable[..., Pipeline]

SWITCHES = [
    (),
    ("render.shading=paper",),
    ("skin.surface.bumpiness=0",),
    ("skin.surface.reflectance=0",),
    ("skin.surface.specular=0",),
    ("render.effects.blur=false",),
    ("render.shading=paper", "skin.surface.blur=0"),
    ("render.effects.specular=false",),
    ("render.effects.occlusion_high=false",),
    ("render.effects.occlusion_low=false",),
    ("render.effects.occlusion_high=false", "render.effects.occlusion_low=false"),
    ("render.effects.reflection=false",),
    ("render.effects.reflection_damping=false",),
    ("lights=[]",),
    ("environment=null",),
    ("render.supersample=2", "background=[0.1, 0.2, 0.3]"),
]


@pytest.mark.parametrize("sets", SWITCHES, ids=lambda sets: ",".join(sets) or "plain")
def test_skipping_is_exact(pipeline: Make, sets: tuple[str, ...]) -> None:
    outputs = ["beauty", "albedo", "normal", "depth", "occlusion", "specular", "reflection", "diffused"]
    lazy = pipeline(*sets).run(outputs, display=True)
    eager_pipeline = pipeline(*sets, skip=False)
    eager = eager_pipeline.run(outputs, display=True)
    assert {report.state for report in eager_pipeline.reports} == {"ran"}
    for name in lazy:
        np.testing.assert_array_equal(lazy[name], eager[name], err_msg=name)
    assert np.isfinite(lazy["beauty"]).all()
    assert lazy["beauty"][..., 3].max() == 1


@pytest.mark.parametrize(
    ("sets", "skipped"),
    [
        (("skin.surface.bumpiness=0",), {"skin0_slope"}),
        (("skin.surface.reflectance=0",), {"reflection", "environment"}),
        (("skin.surface.specular=0",), {"specular"}),
        (("render.effects.blur=false",), {"diffused", "diffused_weights"}),
        (("render.effects.occlusion_high=false",), {"occlusion_high", "occlusion_high_samples"}),
        (
            ("render.effects.occlusion_high=false", "render.effects.occlusion_low=false"),
            {"occlusion", "occlusion_low", "occlusion_high", "occlusion_low_samples"},
        ),
        (("lights=[]",), {"specular"}),
    ],
)
def test_what_a_value_makes_needless_is_skipped(pipeline: Make, sets: tuple[str, ...], skipped: set[str]) -> None:
    made = pipeline(*sets)
    made.run(["beauty"])
    states = {report.name: report.state for report in made.reports}
    assert skipped <= {name for name, state in states.items() if state == "skipped"}
    assert states["compose"] == "ran"
    reasons = {report.name: report.reason for report in made.reports}
    assert all(reasons[name] != "no output that is asked for needs it" for name in skipped)


def test_an_output_pulls_only_what_it_needs(pipeline: Make) -> None:
    made = pipeline()
    before = COUNTERS.snapshot()
    made.run(["depth"])
    after = COUNTERS.snapshot()
    assert {report.name for report in made.reports if report.state == "ran"} == {"view", "depth_picture"}
    assert after["draws"] - before["draws"] == 2
    assert after["bytes_read"] - before["bytes_read"] == 160 * 120 * 16


def test_draws_match_the_states_of_the_report(pipeline: Make) -> None:
    made = pipeline()
    before = COUNTERS.snapshot()["draws"]
    made.run(["beauty"])
    ran = {report.name for report in made.reports if report.state == "ran"}
    expected = sum(len(getattr(made.graph.nodes[name], "draws", ())) for name in ran)
    assert COUNTERS.snapshot()["draws"] - before == expected
    made.run(["beauty"])
    assert COUNTERS.snapshot()["draws"] - before == expected
    assert {report.state for report in made.reports} == {"reused", "skipped"}


def test_a_moved_camera_keeps_the_light_in_the_skin(pipeline: Make) -> None:
    made = pipeline()
    first = made.run(["beauty"])["beauty"]
    camera = Camera(position=(-150.0, 20.0, 580.0), target=(0.0, 0.0, 0.0))
    made.look_from(camera)
    moved = made.run(["beauty"])["beauty"]
    states = {report.name: report.state for report in made.reports}
    # What the camera sees is brought from the lattice to the texels anew; the lattice keeps its light.
    kept = {"atlas", "irradiance", "skin0_maps", "skin0_slope", "environment"}
    kept |= {node.name for node in made.graph.nodes.values() if isinstance(node, LatticeGradient)}
    assert len(kept) > 5
    assert all(states[name] == "reused" for name in kept)
    assert states["view"] == "ran"
    fresh = pipeline("camera.position=[-150, 20, 580]").run(["beauty"])["beauty"]
    np.testing.assert_array_equal(moved, fresh)
    made.look_from(made.loaded.scene.camera)
    np.testing.assert_array_equal(made.run(["beauty"])["beauty"], first)


def test_a_memo_without_room_changes_nothing(pipeline: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = pipeline().run(["beauty"])["beauty"]
    monkeypatch.setenv("SKINCLI_MEMO_MB", "0")
    tight = pipeline()
    for _ in range(2):
        np.testing.assert_array_equal(tight.run(["beauty"])["beauty"], expected)


def test_light_is_linear(pipeline: Make) -> None:
    sets = ("ambient=[0, 0, 0]", "render.shading=paper")
    scene = pipeline(*sets).scene

    def lit(lights: str) -> np.ndarray:
        return pipeline(*sets, f"lights={lights}").run(["irradiance", "specular"])

    one = "{type: directional, direction: [-0.5, -0.3, -1], irradiance: [1.5, 1.4, 1.3]}"
    two = "{type: point, position: [-300, 200, 100], intensity: [0.1, 0.1, 0.2]}"
    doubled = "{type: point, position: [-300, 200, 100], intensity: [0.2, 0.2, 0.4]}"
    both, first, second, twice = (lit(text) for text in (f"[{one}, {two}]", f"[{one}]", f"[{two}]", f"[{doubled}]"))
    for name in ("irradiance", "specular"):
        assert both[name].max() > 0.1
        np.testing.assert_allclose(both[name], first[name] + second[name], rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(twice[name], 2 * second[name], rtol=1e-6)
    assert scene.lights


def test_constant_irradiance_passes_the_diffusion_unchanged(pipeline: Make) -> None:
    made = pipeline("lights=[]", "ambient=[0.25, 0.5, 0.125]")
    arrays = made.run(["irradiance", "diffused"])
    covered = arrays["irradiance"].max(axis=-1) > 0
    assert covered.mean() > 0.3
    expected = np.pi * np.array([0.25, 0.5, 0.125])
    np.testing.assert_allclose(arrays["diffused"][covered], np.broadcast_to(expected, (covered.sum(), 3)), rtol=1e-5)


def test_constant_irradiance_passes_the_papers_blur_inside_a_chart(pipeline: Make) -> None:
    made = pipeline("render.shading=paper", "lights=[]", "ambient=[0.25, 0.5, 0.125]", "skin.surface.blur=8")
    arrays = made.run(["irradiance", "diffused"])
    covered = arrays["irradiance"].max(axis=-1) > 0
    padded = np.pad(covered, 4)
    size = len(covered)
    shifted = [padded[y : y + size, x : x + size] for y in range(9) for x in range(9)]
    inside = np.all(shifted, axis=0)
    assert inside.sum() > 1000
    np.testing.assert_allclose(
        arrays["diffused"][inside], np.broadcast_to([0.25, 0.5, 0.125], (inside.sum(), 3)), rtol=1e-5
    )


def test_no_place_in_the_scene_is_special(pipeline: Make) -> None:
    here = pipeline()
    far = (10_000.0, -10_000.0, 10_000.0)
    there = Pipeline(here.loaded, replace(here.mesh, origin=here.mesh.origin + far))
    camera = here.scene.camera
    assert camera is not None
    moved = camera.model_copy(
        update={
            "position": tuple(np.add(camera.position, far)),
            "target": tuple(np.add(camera.target, far)),
        }
    )
    lights = tuple(
        light
        if light.type == "directional"
        else light.model_copy(update={"position": tuple(np.add(light.position, far))})
        for light in here.scene.lights
    )
    loaded = replace(here.loaded, scene=here.scene.model_copy(update={"camera": moved, "lights": lights}))
    there = Pipeline(loaded, there.mesh)
    one, other = (made.run(["beauty"], display=True) for made in (here, there))
    mask = one["beauty"][..., 3] > 0
    assert mask.mean() > 0.1
    assert flip(one["display"][..., :3], other["display"][..., :3], mask)[0] < 0.005


def test_the_unit_of_the_file_does_not_matter(pipeline: Make, load: Callable[..., LoadedScene]) -> None:
    one = pipeline().run(["beauty"], display=True)
    loaded = load("mesh.file=ball_in_metres.obj", "mesh.unit=m")
    other = Pipeline(loaded, load_scene_mesh(loaded)).run(["beauty"], display=True)
    mask = one["beauty"][..., 3] > 0
    assert flip(one["display"][..., :3], other["display"][..., :3], mask)[0] < 0.005


def test_bumpiness_0_leaves_the_normal_bit_by_bit(pipeline: Make) -> None:
    from skincli.gpu.textures import read_back
    from skincli.graph.node import Ref

    for skip in (True, False):
        made = pipeline("skin.surface.bumpiness=0", skip=skip)
        refs = [Ref("atlas", "normal"), Ref("atlas", "frame_n")]
        found = made.graph.run(refs)
        bumped, plain = (read_back(found[ref]) for ref in refs)
        np.testing.assert_array_equal(bumped[..., :3], plain[..., :3])


def test_every_output_has_its_size_and_is_finite(pipeline: Make) -> None:
    arrays = pipeline("render.supersample=2").run(list(OUTPUTS), display=True)
    for name, kind in OUTPUTS.items():
        expected = (256, 256) if kind.room == "atlas" else (120, 160)
        assert arrays[name].shape == (*expected, kind.channels), name
        assert np.isfinite(arrays[name]).all(), name
    assert arrays["display"].shape == (120, 160, 4)


def test_the_paper_divides_nothing_and_tints_highlights(pipeline: Make) -> None:
    """Equation 2 from its own intermediates, with the values of the paper."""
    made = pipeline("render.shading=paper")
    a = made.run(["beauty", "diffuse", "albedo", "occlusion", "specular", "reflection"])
    expected = (a["diffuse"] * a["occlusion"] + a["specular"]) * a["albedo"] + a["reflection"]
    covered = a["beauty"][..., 3] > 0
    np.testing.assert_allclose(a["beauty"][covered][:, :3], expected[covered], rtol=1e-5, atol=1e-6)


def test_check_names_the_pass_that_left_a_nan(pipeline: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    from skincli.errors import SkincliError
    from skincli.gpu import program

    read = program._file_lines.__wrapped__

    def broken(name: str) -> tuple[str, ...]:
        lines = read(name)
        if name != "passes/specular.frag":
            return lines
        text = "\n".join(lines).replace("* total,", "* (total.r > 0.1 ? vec3(uintBitsToFloat(0x7fc00000u)) : total),")
        return tuple(text.split("\n"))

    pipeline().run(["beauty"], check=True)
    monkeypatch.setattr(program, "_file_lines", broken)
    program.program_text.cache_clear()
    try:
        with pytest.raises(SkincliError, match=r"specular\.specular: \d+ pixels are not finite, the first at column"):
            pipeline().run(["beauty"], check=True)
    finally:
        program.program_text.cache_clear()


def test_what_cannot_fit_into_memory_is_refused_before_it_is_made(pipeline: Make) -> None:
    from skincli.errors import LimitError

    with pytest.raises(LimitError, match=r"about \d+ GB are needed"):
        pipeline("render.size=[16384, 16384]", "render.supersample=4")


def test_large_pictures_do_not_push_the_maps_out_of_the_memo(pipeline: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    sets = ("render.size=[320, 240]", "render.atlas=64", "skin.size=64")
    monkeypatch.setenv("SKINCLI_MEMO_MB", "15")  # two thirds of what one picture takes
    made = pipeline(*sets)
    made.run(["beauty"])
    made.look_from(Camera(position=(-150.0, 20.0, 580.0), target=(0.0, 0.0, 0.0)))
    made.run(["beauty"])
    states = {report.name: report.state for report in made.reports}
    assert {states[name] for name in ("skin0_maps", "skin0_site", "environment")} == {"reused"}
    assert states["view"] == "ran"


@pytest.mark.parametrize("megabytes", [10, 30])
def test_a_full_memo_draws_into_memory_that_it_lets_go(
    pipeline: Make, monkeypatch: pytest.MonkeyPatch, megabytes: int
) -> None:
    monkeypatch.setenv("SKINCLI_MEMO_MB", str(megabytes))
    made = pipeline("render.size=[160, 120]", "render.atlas=128", "skin.size=64")
    for turn in range(5):
        before = COUNTERS.snapshot()
        made.look_from(Camera(position=(-150.0 + turn, 20.0, 580.0), target=(0.0, 0.0, 0.0)))
        made.run(["beauty"])
        made_anew = COUNTERS.since(before)
    assert made_anew["draws"] > 10
    assert made_anew["textures"] <= 2


def test_maps_alone_may_be_kept(pipeline: Make) -> None:
    made = pipeline("render.atlas=64", "skin.size=64")
    expected = made.run(["beauty"])["beauty"]
    made.graph.store.clear(but_dear=True)
    np.testing.assert_array_equal(made.run(["beauty"])["beauty"], expected)
    states = {report.name: report.state for report in made.reports}
    assert {states[name] for name in ("skin0_maps", "skin0_site")} == {"reused"}
    assert {states[name] for name in ("environment", "atlas", "view")} == {"ran"}


def test_parts_that_share_the_texture_square_have_patterns_of_their_own(
    ctx: object, load: Callable[..., LoadedScene], mesh: Mesh
) -> None:
    """Two balls side by side with equal uv: the pattern of one must not be the other's, nor cut at its seams."""
    count = len(mesh.positions)
    away = np.array([200.0, 0.0, 0.0])
    half = mesh.atlas_uv * [0.5, 1.0]
    two = Mesh(
        np.concatenate([mesh.positions, mesh.positions + away]),
        np.concatenate([mesh.normals] * 2),
        np.concatenate([mesh.uv] * 2),
        np.concatenate([half, half + np.array([0.5, 0.0])]),
        np.concatenate([mesh.faces, mesh.faces + count]).astype(np.int32),
        (Part("left", 0, len(mesh.faces)), Part("right", len(mesh.faces), 2 * len(mesh.faces))),
        origin=mesh.origin,
        uv_is_unique=False,
    )
    sets = ("camera.position=[100, 0, 900]", "camera.target=[100, 0, 0]", "skin.surface.bumpiness=0")
    both = Pipeline(load(*sets), two).run(["albedo", "depth"])
    alone = [
        Pipeline(load(*sets), replace(mesh, positions=mesh.positions + shift)).run(["albedo"])["albedo"]
        for shift in (0 * away, away)
    ]
    expected = np.where(alone[0] > 0, alone[0], alone[1])
    seen = both["depth"][..., 0] > 0
    assert seen.mean() > 0.1
    np.testing.assert_allclose(both["albedo"][seen], expected[seen], atol=1e-3)
    assert np.abs(alone[0][:, :80] - np.roll(alone[1], -35, axis=1)[:, :80]).max() > 0.05


def test_many_lights_add_up(pipeline: Make) -> None:
    light = "{type: directional, direction: [-0.5, -0.3, -1], irradiance: [0.01, 0.02, 0.03]}"
    one = pipeline("ambient=[0, 0, 0]", f"lights=[{light}]").run(["irradiance"])["irradiance"]
    many = pipeline("ambient=[0, 0, 0]", f"lights=[{', '.join([light] * 200)}]").run(["irradiance"])["irradiance"]
    assert one.max() > 0.02
    np.testing.assert_allclose(many, 200 * one, rtol=2e-5)


def test_lights_of_all_kinds_add_up_over_several_draws(pipeline: Make) -> None:
    from skincli.gpu.textures import read_back
    from skincli.graph.node import Ref
    from skincli.passes import irradiance, specular

    some = [
        "{type: spot, position: [80, 260, 200], direction: [-1, -3, -2], intensity: [0.02, 0.01, 0.01], angle: 50}",
        "{type: point, position: [-250, 150, 220], intensity: [0.002, 0.004, 0.006]}",
        "{type: directional, direction: [-0.5, -0.6, -1], irradiance: [0.02, 0.03, 0.01]}",
    ]
    made = pipeline("ambient=[0.1, 0.2, 0.3]", f"lights=[{', '.join(some * 50)}]", "skin.surface.specular=1")
    refs = [Ref("atlas", "position"), Ref("atlas", "normal"), Ref("irradiance", "irradiance")]
    position, normal, found = (read_back(texture).astype(np.float64) for texture in made.graph.run(refs).values())
    draws = [draw.values for draw in made.graph.nodes["irradiance"].draws]
    assert [len(draw.sources()) for draw in draws] == [64, 64, 22]
    np.testing.assert_allclose(found, irradiance.twin(draws, position, normal[..., :3]), atol=2e-5)
    assert found[..., :3].max() > 1
    refs = [*(Ref("view", output) for output in ("depth", "normal", "finish")), Ref("specular", "specular")]
    depth, normal, finish, shine = (read_back(texture).astype(np.float64) for texture in made.graph.run(refs).values())
    shining = [draw.values for draw in made.graph.nodes["specular"].draws]
    assert [len(draw.sources()) for draw in shining] == [64, 64, 22]
    expected = specular.twin(shining, depth[..., 0], normal, finish)
    assert np.abs(shine[..., :3] - expected).max() <= 2e-5 * expected.max()


def test_occlusion_stops_at_the_outline(pipeline: Make) -> None:
    # Samples all around the point find half of them inside the surface.
    arrays = pipeline("render.occlusion.samples=sphere").run(["depth", "occlusion", "occlusion_low"])
    outside = arrays["depth"] == 0
    for name in ("occlusion", "occlusion_low"):
        np.testing.assert_array_equal(arrays[name][outside], 1)
        assert np.median(arrays[name][~outside]) < 0.8


@pytest.mark.parametrize("blend", [0.02, 0.4])
def test_the_edge_of_a_light_agrees_with_its_twin(pipeline: Make, blend: float) -> None:
    from skincli.gpu.textures import read_back
    from skincli.graph.node import Ref
    from skincli.passes import irradiance

    where = "type: spot, position: [0, 400, 300], direction: [0, -1, -0.6], angle: 15"
    made = pipeline("ambient=[0, 0, 0]", f"lights=[{{{where}, intensity: [0.4, 0.3, 0], blend: {blend}}}]")
    refs = [Ref("atlas", "position"), Ref("atlas", "normal"), Ref("irradiance", "irradiance")]
    position, normal, found = (read_back(texture).astype(np.float64) for texture in made.graph.run(refs).values())
    lights = [draw.values for draw in made.graph.nodes["irradiance"].draws]
    expected, coarsely = (
        irradiance.twin([replace(light, samples=samples) for light in lights], position, normal[..., :3])
        for samples in (4, 2)
    )
    assert {draw.samples for draw in lights} == {4}
    assert np.abs(found - expected).max() <= 1e-4 * expected.max()
    # A sharp edge is looked at closely, a soft one is not.
    assert (np.abs(expected - coarsely).max() > 0.01 * expected.max()) == (blend < 0.1)


@pytest.mark.parametrize("shininess", [0, 5, 60, 1000, 20000])
def test_highlights_of_any_size_agree_with_their_twin(pipeline: Make, shininess: float) -> None:
    from skincli.gpu.textures import read_back
    from skincli.graph.node import Ref
    from skincli.passes import specular

    made = pipeline(f"skin.surface.shininess={shininess}", "skin.surface.specular=1")
    refs = [*(Ref("view", output) for output in ("depth", "normal", "finish")), Ref("specular", "specular")]
    found = made.graph.run(refs)
    depth, normal, finish, shine = (read_back(found[ref]).astype(np.float64) for ref in refs)
    lights = [draw.values for draw in made.graph.nodes["specular"].draws]
    expected = specular.twin(lights, depth[..., 0], normal, finish)
    assert expected.max() > 1e-4
    # Small highlights cover less than a hundredth of the picture: the brightest pixel is the measure here.
    assert np.abs(shine[..., :3] - expected).max() <= 2e-5 * expected.max()


def test_a_node_nobody_asked_for_says_so(pipeline: Make) -> None:
    made = pipeline("render.effects.blur=false")
    made.run(["depth"])
    reasons = {report.name: report.reason for report in made.reports if report.state == "skipped"}
    assert {"atlas", "irradiance", "diffused", "specular", "compose", "environment"} <= set(reasons)
    assert set(reasons.values()) == {"no output that is asked for needs it"}


def test_a_moved_camera_brings_its_exposure(pipeline: Make) -> None:
    made = pipeline()
    made.run([], display=True)
    camera = made.loaded.scene.camera
    assert camera is not None
    made.look_from(camera.model_copy(update={"exposure": -1.0}))
    darker = made.run([], display=True)["display"]
    fresh = pipeline("camera.exposure=-1").run([], display=True)["display"]
    np.testing.assert_array_equal(darker, fresh)
    assert {report.name for report in made.reports if report.state == "ran"} == {"display"}
