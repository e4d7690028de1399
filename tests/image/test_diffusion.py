"""Diffusion: the laws every method keeps, each method against exact sums, and what a picture must not depend on."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from skincli import metrics, pipeline
from skincli.bench.scene import load, ring
from skincli.gpu.textures import read_back
from skincli.graph.frame_graph import FrameGraph
from skincli.graph.node import ONE, Load, Ref
from skincli.mesh import lattice, windows
from skincli.mesh.model import Mesh
from skincli.passes import near, window
from skincli.passes.lattice import LatticeSlice
from skincli.passes.seen import Seen
from skincli.passes.window import Window, WindowSource, WindowValues, block_node, window_nodes
from skincli.pipeline import DIFFUSED, OUTPUTS, Pipeline
from skincli.reference.texels import diffuse_texels

Array = NDArray[np.float64]

SCENE = """
scene: 1
mesh: {builtin: head}  # stands in for the ring
skin:
  size: 64
  surface: {bumpiness: 0, specular: 0, reflectance: 0}
  optics: {color: [0.8, 0.6, 0.5], radius: [3, 2, 1]}
camera: {position: [60, 210, 330], target: [0, 0, 0], fov: 30}
ambient: [0, 0, 0]
lights:
  - {type: spot, position: [80, 260, 120], direction: [-1, -4, -1], intensity: [0.2, 0.2, 0.2], angle: 22}
render: {size: [160, 120], supersample: 2, atlas: 128, effects: {occlusion_high: false, occlusion_low: false}}
"""
#: the light ends within a few texels: what a wrong width or a seam does shows
METHODS = ("lattice", "none", "paper", "sum_of_gaussians", "screen_space", "splat", "exact")


@functools.cache
def mesh() -> Mesh:
    return ring(48, 24)


@pytest.fixture(scope="module")
def render(ctx: object, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., dict[str, Array]]:
    """Render the scene with settings."""
    folder = tmp_path_factory.mktemp("diffusion")

    def rendered(method: str, *sets: str, outputs: tuple[str, ...] = ("diffused",), of: Mesh | None = None) -> Any:
        loaded = load(Path(folder), SCENE, f"render.diffusion.method={method}", *sets)
        found = Pipeline(loaded, of or mesh(), exact=diffuse_texels).run(outputs, check=True)
        return {name: array.astype(np.float64) for name, array in found.items()}

    return rendered


@pytest.fixture(scope="module")
def exact(render: Callable[..., dict[str, Array]]) -> dict[str, Array]:
    found = render("exact", "render.diffusion.terms=6", outputs=("diffused", "irradiance", "atlas_position"))
    found["covered"] = np.asarray((found["diffused"] > 0).any(axis=-1), dtype=np.float64)
    return found


CONSTANT = ("lights=[]", "ambient=[0.7, 0.5, 0.3]")


OPTICS = ("{}", "{radius: [9, 4, 0.5]}", "{profile: human}", "{color: [0, 1, 0.5]}")


@pytest.mark.parametrize(
    ("method", "optics"),
    [*(("lattice", optics) for optics in OPTICS), *((method, "{}") for method in METHODS if method != "lattice")],
)
def test_constant_light_is_unchanged(render: Callable[..., dict[str, Array]], method: str, optics: str) -> None:
    found = render(method, *CONSTANT, f"skin.optics={optics}", "render.atlas=96", outputs=("diffuse", "normal"))
    # Whole pixels of the surface alone: others are mixed with what is behind.
    inside = np.linalg.norm(found["normal"], axis=-1) > 0.9
    light = found["diffuse"][inside]
    if method == "paper":
        # It darkens at seams, far from them it does not.
        light = light[light[:, 0] > 0.6999]
        assert len(light) < 0.9 * inside.sum()
    assert len(light) > 2000
    np.testing.assert_allclose(
        light, np.broadcast_to([0.7, 0.5, 0.3], light.shape), rtol=2e-4 if method == "paper" else 1e-5
    )


def test_a_varying_radius_keeps_constant_light(render: Callable[..., dict[str, Array]]) -> None:
    layers = "skin.layers=[{fbm: {scale: 20, scattering_radius: [[0.5, 0.2, 0.1], [9, 6, 3]]}}]"
    found = render("lattice", *CONSTANT, layers, outputs=("diffused", "irradiance"))
    covered = found["irradiance"][..., 0] > 0
    np.testing.assert_allclose(found["diffused"][covered], found["irradiance"][covered], rtol=1e-5)


@pytest.mark.parametrize("method", [method for method in METHODS if method != "exact"])
def test_light_adds_up(render: Callable[..., dict[str, Array]], method: str) -> None:
    one, three = (
        render(method, f"lights[0].intensity=[{x}, {x}, {x}]", outputs=("diffuse",))["diffuse"] for x in (0.2, 0.6)
    )
    np.testing.assert_allclose(three, 3 * one, rtol=2e-5, atol=1e-6)


@pytest.mark.parametrize(
    ("method", "bound"), [("lattice", 0.012), ("sum_of_gaussians", 0.1), ("none", 0.35), ("paper", 0.35)]
)
def test_methods_against_exact_sums(
    render: Callable[..., dict[str, Array]], exact: dict[str, Array], method: str, bound: float
) -> None:
    found = render(method, "render.diffusion.terms=6")["diffused"]
    error = metrics.relative_rmse(found, exact["diffused"], exact["covered"] > 0)
    assert error < bound
    assert method == "lattice" or error > 0.02


def test_windows_against_exact_sums(render: Callable[..., dict[str, Array]]) -> None:
    """On a ring of a tenth of the size no width needs the lattice."""
    small = replace(mesh(), positions=0.1 * mesh().positions)
    light = "{type: spot, position: [8, 26, 12], direction: [-1, -4, -1], intensity: [0.002, 0.002, 0.002], angle: 22}"
    sets = ("skin.optics.radius=[0.4, 0.25, 0.2]", f"lights=[{light}]", "render.diffusion.terms=5")
    none, found, wanted = (render(method, *sets, of=small)["diffused"] for method in ("none", "lattice", "exact"))
    assert metrics.relative_rmse(found, wanted, wanted.max(axis=-1) > 0) < 0.006
    assert metrics.relative_rmse(none, wanted, wanted.max(axis=-1) > 0) > 0.1


def test_surfaces_too_large_for_the_lattice_are_served_by_windows(
    render: Callable[..., dict[str, Array]], exact: dict[str, Array], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(pipeline, "MOST_SPOTS", 100)
    made = Pipeline(load(tmp_path, SCENE, "render.diffusion.terms=6"), mesh())
    kinds = {type(node) for node in made.graph.nodes.values()}
    assert Window in kinds
    assert LatticeSlice not in kinds
    found = render("lattice", "render.diffusion.terms=6")["diffused"]
    assert metrics.relative_rmse(found, exact["diffused"], exact["covered"] > 0) < 0.012


@pytest.mark.parametrize(("terms", "bound"), [(3, 0.03), (4, 0.02)])
def test_fewer_terms_are_near(
    render: Callable[..., dict[str, Array]], exact: dict[str, Array], terms: int, bound: float
) -> None:
    found = render("lattice", f"render.diffusion.terms={terms}")["diffused"]
    assert metrics.relative_rmse(found, exact["diffused"], exact["covered"] > 0) < bound


@pytest.mark.parametrize(("method", "bound"), [("lattice", 0.03), ("exact", 1e-3)])
def test_wider_scattering_map_is_wider_optics(
    render: Callable[..., dict[str, Array]], method: str, bound: float
) -> None:
    """The map's radius is the one at the receiving point; a constant map is the optics' own radius."""
    mapped = render(method, "skin.layers=[{color: {scattering_radius: [6, 4, 2]}}]")["diffused"]
    wide = render(method, "skin.optics.radius=[6, 4, 2]")["diffused"]
    narrow = render(method)["diffused"]
    lit = wide.max(axis=-1) > 0
    assert metrics.relative_rmse(mapped, wide, lit) < bound
    assert metrics.relative_rmse(narrow, wide, lit) > 0.06


def test_a_varying_radius_against_exact_sums(render: Callable[..., dict[str, Array]]) -> None:
    layers = "skin.layers=[{fbm: {scale: 20, scattering_radius: [[0.5, 0.2, 0.1], [9, 6, 3]]}}]"
    found, wanted = (render(method, layers, "render.diffusion.terms=6")["diffused"] for method in ("lattice", "exact"))
    plain = render("exact", "render.diffusion.terms=6")["diffused"]
    lit = wanted.max(axis=-1) > 0
    assert metrics.relative_rmse(found, wanted, lit) < 0.03
    assert metrics.relative_rmse(plain, wanted, lit) > 0.05


def test_albedo_after_before_and_split(render: Callable[..., dict[str, Array]]) -> None:
    """On skin of one color it makes no difference; where colors change, light carries them on."""
    color = "skin.layers=[{color: {albedo: [0.7, 0.4, 0.2]}}]"
    pictures = [
        render("lattice", color, f"render.diffusion.albedo={where}", outputs=("beauty",))["beauty"]
        for where in ("after", "before", "split")
    ]
    for other in pictures[1:]:
        np.testing.assert_allclose(other, pictures[0], rtol=2e-4, atol=1e-5)
    mottled = "skin.layers=[{worley: {scale: 6, albedo: [[0.9, 0.3, 0.2], [0.1, 0.6, 0.4]]}}]"
    after, before = (
        render("lattice", mottled, f"render.diffusion.albedo={where}", outputs=("beauty",))["beauty"]
        for where in ("after", "before")
    )
    assert np.abs(np.diff(before[..., 0], axis=1)).mean() < 0.8 * np.abs(np.diff(after[..., 0], axis=1)).mean()


def test_only_what_shows_diffused_light_diffuses_it(render: Callable[..., dict[str, Array]], tmp_path: Path) -> None:
    made = Pipeline(load(tmp_path, SCENE, "outputs=[depth]"), mesh())
    others = [name for name in OUTPUTS if name not in DIFFUSED]
    made.run(others)
    assert not any(name.startswith("diffused_0") for name in made.graph.nodes)
    assert {report.state for report in made.reports if report.name == "diffused"} == {"skipped"}
    found = made.run(["diffused", *others])["diffused"]
    np.testing.assert_array_equal(found, render("lattice")["diffused"].astype(np.float32))


@pytest.mark.parametrize("side", [120, 101])
@pytest.mark.parametrize("method", ["lattice", "sum_of_gaussians"])
def test_only_what_the_picture_reads_is_diffused(tmp_path: Path, method: str, side: int) -> None:
    """Bit by bit the same picture, of an atlas that is not whole; an odd one has tiles of one texel."""
    text = load(tmp_path, SCENE, f"render.diffusion.method={method}", f"render.atlas={side}", "outputs=[beauty]")
    part, whole = Pipeline(text, mesh()), Pipeline(text, mesh(), skip=False)
    seen, wanted = (made.run(["beauty"])["beauty"] for made in (part, whole))
    np.testing.assert_array_equal(seen, wanted)
    assert seen.max() > 0.1
    ref = Ref("diffused", "blurred")
    few, all_ = (np.count_nonzero(read_back(made.graph.run([ref])[ref])[..., 3]) for made in (part, whole))
    assert few < 0.95 * all_
    assert [type(node) for node in part.graph.nodes.values()].count(Seen) == 1
    # Who asks for the atlas gets all of it.
    seen, wanted = (made.run(["diffused"])["diffused"] for made in (part, whole))
    np.testing.assert_array_equal(seen, wanted)


@pytest.mark.parametrize("side", [120, 101, 514])
def test_light_is_computed_only_near_what_the_picture_sees(tmp_path: Path, side: int) -> None:
    """Bit by bit the same picture; tiles of 8 texels, of one, and of two, where blocks of them give light, too."""
    optics = "skin.optics={color: [0.8, 0.6, 0.5], radius: [1.5, 1, 0.7]}"
    sets = (optics, "camera.target=[70, 0, 30]", "camera.fov=7")
    text = load(tmp_path, SCENE, *sets, f"render.atlas={side}", "outputs=[beauty]")
    part, whole = Pipeline(text, mesh(), single=True), Pipeline(text, mesh(), skip=False)
    found, expected = (made.run(["beauty"])["beauty"] for made in (part, whole))
    np.testing.assert_array_equal(found, expected)
    assert found.max() > 0.1
    factors = {node.draws[0].values.factor for node in part.graph.nodes.values() if isinstance(node, WindowSource)}
    assert (max(factors) > 1) == (side == 514)
    ref = Ref("irradiance", "irradiance")
    few, all_ = (np.count_nonzero(read_back(made.graph.run([ref])[ref])[..., 3]) for made in (part, whole))
    assert few < 0.9 * all_
    # Who asks for the atlas gets all of it.
    found, expected = (made.run(["irradiance"])["irradiance"] for made in (part, whole))
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("method", METHODS)
def test_a_single_picture_is_that_of_all_light(tmp_path: Path, method: str) -> None:
    sets = ("camera.target=[70, 0, 30]", "camera.fov=7", "outputs=[beauty]", f"render.diffusion.method={method}")
    sets = sets if method != "paper" else (*sets[:3], "render.shading=paper")
    text = load(tmp_path, SCENE, *sets)
    part, whole = (Pipeline(text, mesh(), exact=diffuse_texels, single=single) for single in (True, False))
    for shift in (0.0, 20.0, 1e4):
        camera = text.scene.camera
        assert camera is not None
        moved = camera.model_copy(update={"target": (70.0 + shift, 0.0, 30.0)})
        for made in (part, whole):
            made.look_from(moved)
        found, expected = (made.run(["beauty"])["beauty"] for made in (part, whole))
        np.testing.assert_array_equal(found, expected)
        assert (expected[..., 3].max() > 0.1) == (shift < 1e3)


def test_light_is_wanted_beyond_charts_that_abut(tmp_path: Path) -> None:
    """What a pixel at a border reads may lie elsewhere: the two halves of the ring meet in the atlas far apart."""
    uv = mesh().atlas_uv.copy()
    half = len(uv) // 2
    uv[:half, 0] = 0.5 * (uv[:half, 0] - 0.03) / 0.44
    uv[half:, 0] = 1.0 - 0.5 * (uv[half:, 0] - 0.53) / 0.44
    view = ("camera.fov=6", "camera.target=[5, 0, -60]", "camera.position=[10, 160, -300]", "ambient=[0.3, 0.3, 0.3]")
    optics = "skin.optics={color: [0.8, 0.6, 0.5], radius: [1.5, 1, 0.7]}"
    text = load(tmp_path, SCENE, optics, *view, "outputs=[beauty]")
    of = replace(mesh(), atlas_uv=uv)
    found, expected = (Pipeline(text, of, single=single).run(["beauty"])["beauty"][..., :3] for single in (True, False))
    np.testing.assert_array_equal(found, expected)
    assert expected.max() > 0.1


def test_all_that_the_passes_reach_is_wanted() -> None:
    """Splat and slice by a lattice constant each, a gradient by a step, four blurs; windows by corners of squares."""
    most = max(lattice.RATIO_NARROW, lattice.RATIO_WIDE)
    assert (2 + np.sqrt(3) / 2 + 2 * lattice.REACH) * most <= pipeline.REACH
    assert np.sqrt(2) * windows.REACH < pipeline.REACH


def test_what_lies_within_reach_lies_in_the_same_cube_or_beside_it() -> None:
    random = np.random.default_rng(2)
    for reach in (0.01, 3.0, 500.0):
        points = random.uniform(-50, 80, (4000, 3)) * [1, 2, 0.5]
        values = near.cubes(points, reach)
        cube = np.clip(np.floor((points - values.low) / values.side), 0, np.array(values.count) - 1)
        assert (cube == np.floor((points - values.low) / values.side)).all()
        assert max(values.count) <= near.MOST_CUBES
        close = np.linalg.norm(points[:2000] - points[2000:], axis=1) <= reach
        pairs = np.abs(cube[:2000] - cube[2000:]).max(axis=1)
        assert (pairs[close] <= 1).all()
        beside = points + random.normal(size=points.shape) * reach / 3
        away = np.floor((beside - values.low) / values.side) - cube
        assert (np.abs(away[np.linalg.norm(beside - points, axis=1) <= reach]) <= 1).all()


LAYOUTS: Mapping[str, Callable[[Array], Array]] = {
    "mirrored": lambda uv: np.stack([1 - uv[:, 0], uv[:, 1]], axis=1),
    "turned": lambda uv: np.stack([uv[:, 1], 1 - uv[:, 0]], axis=1),
    "sheared": lambda uv: np.stack([0.7 * uv[:, 0] + 0.25 * uv[:, 1], 0.9 * uv[:, 1] + 0.05], axis=1),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_picture_does_not_depend_on_the_layout(render: Callable[..., dict[str, Array]], layout: str) -> None:
    other = replace(mesh(), atlas_uv=LAYOUTS[layout](mesh().atlas_uv))
    first, second = (
        render("lattice", "render.atlas=512", outputs=("beauty",), of=one)["beauty"] for one in (mesh(), other)
    )
    assert metrics.flip(second[..., :3], first[..., :3])[0] < 0.01


def test_a_picture_does_not_depend_on_the_atlas(render: Callable[..., dict[str, Array]]) -> None:
    first, second = (render("lattice", f"render.atlas={side}", outputs=("beauty",))["beauty"] for side in (512, 1024))
    assert metrics.flip(second[..., :3], first[..., :3])[0] < 0.01


def test_a_picture_does_not_depend_on_the_triangles(render: Callable[..., dict[str, Array]]) -> None:
    first, second = (render("lattice", outputs=("beauty",), of=one)["beauty"] for one in (ring(96, 48), ring(192, 96)))
    assert metrics.flip(second[..., :3], first[..., :3])[0] < 0.01


@pytest.mark.parametrize("method", ["screen_space", "splat"])
def test_methods_in_the_picture_are_near(render: Callable[..., dict[str, Array]], method: str) -> None:
    none, ours, found = (render(name, outputs=("diffuse",))["diffuse"] for name in ("none", "lattice", method))
    error = metrics.relative_rmse(found, ours)
    assert error < 0.12
    assert error < 0.7 * metrics.relative_rmse(none, ours)


@pytest.mark.parametrize("factor", [1, 2])
def test_window_matches_its_twin(ctx: object, factor: int) -> None:
    random = np.random.default_rng(2)
    side, sigma = 24, 0.4 * factor
    rows, columns = np.indices((side, side)).reshape(2, -1)
    # Two charts that meet in space: what lies right of the middle is turned over and bent up.
    second = columns >= side // 2
    x = columns - side // 2 + 0.5
    place = 0.4 * np.stack([x, np.where(second, side - 1 - rows, rows) + 0.3 * x, second * 0.6 * x], axis=-1)
    normal = np.where(second[:, None], [-0.6, 0.0, 0.8], [0.0, 0.0, 1.0])
    gives = random.random(side**2) < 0.95
    made = windows.tables(place, normal, 0.16 * gives, np.arange(side**2), side, sigma, factor)
    images = {"position": place, "normal": normal, "image": random.random((side**2, 3)), "area": 0.16 * gives[:, None]}
    loads = []
    for name, values in images.items():
        padded = np.concatenate([values, np.ones((side**2, 4 - values.shape[1]))], axis=1).reshape(side, side, 4)[::-1]
        loads.append(Load(name, f"{name} {factor}", functools.partial(list, [padded])))
    image, area, position, facing = (Ref(name, "image") for name in ("image", "area", "position", "normal"))
    blocks = block_node((side, side), image, area, position, facing, ONE, factor)
    nodes = window_nodes("window", (side, side), blocks, position, facing, ONE, sigma, 0.4, f"{factor}", made)
    graph = FrameGraph([*loads, blocks, *nodes])
    refs = [Ref(blocks.name, name) for name in blocks.outputs]
    refs += [Ref(load.name, "image") for load in loads[:2]] + [Ref("window", "windowed")]
    drawn = graph.run(refs, check=True)
    *inputs, found = (read_back(drawn[ref]).astype(np.float64) for ref in refs)
    node = nodes[-1]
    assert isinstance(node, Window)
    values = node.draws[0].values
    assert isinstance(values, WindowValues)
    np.testing.assert_allclose(found, window.twin(values, node.tables, *inputs), atol=2e-6)
    assert (found[..., 3] == 1).all()


def test_windows_see_beyond_the_borders_of_charts(ctx: object) -> None:
    """Light on a plane that is cut in two charts is diffused as on the whole plane."""
    random = np.random.default_rng(3)
    side, sigma = 32, 1.0
    rows, columns = np.indices((side, side)).reshape(2, -1)
    second = columns >= side // 2
    x, y = columns - side // 2 + 0.5, np.where(second, side - 1 - rows, rows) + 0.5
    place = np.stack([x, y, np.zeros(side**2)], axis=-1)
    normal = np.broadcast_to([0.0, 0.0, 1.0], place.shape)
    light = random.random((side**2, 3))
    made = windows.tables(place, normal, np.ones(side**2), np.arange(side**2), side, sigma, 1)
    sums = np.concatenate([light, np.ones((side**2, 1))], axis=1)
    values = WindowValues(1, np.log2(np.e) / (2 * sigma**2))
    images = (np.concatenate([array, np.ones((side**2, 1))], axis=1) for array in (place, normal))
    where, facing = (image.reshape(side, side, 4)[::-1] for image in images)
    given = sums.reshape(side, side, 4)[::-1]
    found = window.twin(values, made, given, where, facing, where, facing)[::-1].reshape(-1, 4)[:, :3]
    kernel = np.exp(-np.sum((place[:, None] - place) ** 2, axis=2) / (2 * sigma**2))
    wanted = kernel @ light / kernel.sum(axis=1, keepdims=True)
    seam = np.abs(x) < 2
    assert np.sqrt(np.mean((found - wanted)[seam] ** 2)) < 0.005
    assert np.sqrt(np.mean((found - wanted) ** 2)) < 0.005
