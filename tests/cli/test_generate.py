"""`skincli generate`: the maps, what they hold in numbers, and the manifest that says how to read them."""

from __future__ import annotations

import hashlib
import json
import os
import pty
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result
from numpy.typing import NDArray

from skincli import images, mapset
from skincli.generate import generate as generated
from skincli.gpu.counters import COUNTERS
from skincli.graph.frame_graph import FrameGraph
from skincli.layers.stack import CHANNELS, fuse
from skincli.mesh.load import load_builtin
from skincli.scene.skin import Skin

Run = Callable[..., Result]
Generate = Callable[..., dict[str, Any]]

SKIN = """\
skin: 1
about: Two colors and a relief.
size: 32
extent: 40
seed: 5
layers:
  - color: {albedo: [0.6, 0.4, 0.3], reflectance: 0.25}
  - fbm: {scale: 20, height: [-0.4, 0.2]}
  - image: {name: picture, file: sources/spots.png, opacity: 0}
"""
NAMES = ("albedo", "bump", "reflection")


@pytest.fixture
def generate(folder: Path, skincli: Run, ctx: object) -> Generate:
    """Generate into the folder `maps`, without a word on stderr, and return the manifest."""
    (folder / "skins/sources").mkdir(parents=True)
    (folder / "spots.png").rename(folder / "skins/sources/spots.png")
    (folder / "skins/own.yaml").write_text(SKIN)

    def run(*arguments: object, skin: str = "skins/own.yaml", into: str = "maps") -> dict[str, Any]:
        result = skincli("generate", skin, "-o", into, *arguments)
        assert result.exit_code == 0, result.output
        assert not result.stderr
        written = [str(Path(into) / name) for name in (*(f"{name}.png" for name in NAMES), "manifest.json")]
        assert result.stdout.splitlines() == written
        assert {str(path) for path in Path(into).rglob("*")} == set(written)
        manifest: dict[str, Any] = json.loads((folder / into / "manifest.json").read_text())
        return manifest

    return run


def bump(folder: Path, manifest: dict[str, Any]) -> NDArray[np.floating]:
    """Return the height in mm, as the manifest says it is stored."""
    low, high = manifest["maps"]["bump"]["range"]
    stored: NDArray[np.floating] = images.read_data(folder / "bump.png", 1)[..., 0]
    return low + (high - low) * stored.astype(np.float64)


def test_the_manifest_describes_the_files(generate: Generate, folder: Path) -> None:
    manifest = generate()
    expected = {"manifest": 1, "skin": "own", "size": 32, "extent_mm": 40, "seed": 5}
    assert {key: manifest[key] for key in expected} == expected
    assert manifest["about"] == "Two colors and a relief."
    assert manifest["versions"]["skincli"]
    assert set(manifest["maps"]) == set(NAMES)
    for name, entry in manifest["maps"].items():
        file = folder / "maps" / entry["file"]
        assert file.name == f"{name}.png"
        assert images.size_of(file) == (32, 32)
        assert entry["bytes"] == hashlib.blake2b(file.read_bytes(), digest_size=16).hexdigest()
        assert entry["bits"] == 16
        assert len(entry["pixels"]) == 32
    assert manifest["maps"]["albedo"]["color_space"] == "sRGB"
    assert manifest["maps"]["bump"]["unit"] == "mm"
    assert manifest["maps"]["bump"]["mid_level"] == 0.5
    assert manifest["maps"]["reflection"]["range"] == [0, 1]


def test_the_maps_hold_what_the_layers_say(generate: Generate, folder: Path) -> None:
    manifest = generate()
    albedo = images.read_color(folder / "maps/albedo.png")[..., :3]
    np.testing.assert_allclose(albedo, np.broadcast_to([0.6, 0.4, 0.3], albedo.shape), atol=2e-3)
    reflection = images.read_data(folder / "maps/reflection.png", 1)
    np.testing.assert_allclose(reflection, np.full_like(reflection, 0.25), atol=2e-3)
    height = bump(folder / "maps", manifest)
    low, high = manifest["maps"]["bump"]["range"]
    assert low == -high
    assert np.abs(height).max() == pytest.approx(high, rel=1e-4)
    assert -0.4 <= height.min() < -0.15
    assert 0 < height.max() <= 0.2


def test_a_level_surface_is_stored_at_mid_level(generate: Generate, folder: Path) -> None:
    manifest = generate("--set", "skin.layers=[color: {albedo: [0.5, 0.5, 0.5]}]")
    assert np.abs(bump(folder / "maps", manifest)).max() < 1e-4
    raised = generate("--set", "skin.layers=[color: {height: 0.25}]", into="raised")
    height = bump(folder / "raised", raised)
    np.testing.assert_allclose(height, np.full_like(height, 0.25), rtol=1e-3)


def test_the_size_changes_the_grain_and_not_the_pattern(generate: Generate, folder: Path) -> None:
    fine = generate("--size", 64, into="fine")
    coarse = generate("--size", 16, into="coarse")
    assert (fine["size"], coarse["size"]) == (64, 16)
    many = bump(folder / "fine", fine).reshape(16, 4, 16, 4).mean(axis=(1, 3))
    few = bump(folder / "coarse", coarse)
    assert np.corrcoef(many.ravel(), few.ravel())[0, 1] > 0.95
    assert np.abs(many - few).mean() < 0.1 * np.ptp(many)


def test_settings_and_the_seed_count(generate: Generate, folder: Path) -> None:
    generate()
    first = (folder / "maps/bump.png").read_bytes()
    generate()
    assert (folder / "maps/bump.png").read_bytes() == first
    changed = generate("--set", "skin.seed=6")
    assert changed["seed"] == 6
    assert (folder / "maps/bump.png").read_bytes() != first
    opaque = generate("--set", "skin.layers.picture.opacity=1", into="opaque")
    assert images.read_color(folder / "opaque/albedo.png")[..., :3].std(axis=(0, 1)).min() > 0.01
    assert opaque["maps"]["albedo"]["bytes"] != changed["maps"]["albedo"]["bytes"]


@pytest.mark.parametrize("preset", ["human", "octopus", "undead"])
def test_presets_have_color_relief_and_shine(generate: Generate, folder: Path, preset: str) -> None:
    manifest = generate("--size", 64, skin=preset, into="new/folder")
    assert manifest["skin"] == preset
    assert manifest["extent_mm"] == Skin.model_fields["extent"].default
    for name in NAMES:
        values = images.read_data(folder / "new/folder" / f"{name}.png", 1)
        assert values.std() > 0.01, name
    assert 0.01 < manifest["maps"]["bump"]["range"][1] < 5


@pytest.mark.parametrize("setting", ["seed=1", "layers.fbm.scale=3", "foo=1", "skin=human", "camera.fov=9"])
def test_a_setting_that_a_skin_does_not_have_is_refused(skincli: Run, tmp_path: Path, setting: str) -> None:
    result = skincli("generate", "human", "-o", tmp_path / "maps", "--size", 16, "--set", setting)
    assert result.exit_code == 3
    assert f"--set {setting}: a skin by itself has no" in result.stderr
    assert not (tmp_path / "maps").exists()


def test_maps_beyond_memory_are_refused(
    skincli: Run, tmp_path: Path, ctx: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("skincli.gpu.textures.MEMORY_SHARE", 1e-6)
    result = skincli("generate", "human", "-o", tmp_path / "maps", "--size", 512)
    assert result.exit_code == 6
    assert "choose a smaller --size" in result.stderr
    assert not (tmp_path / "maps").exists()


# -- what is computed ------------------------------------------------------------------------------------------------


def skin(*layers: Any, **keys: Any) -> Skin:
    return Skin.model_validate({"skin": 1, "size": 16, "layers": list(layers), **keys})


RELIEF = {"fbm": {"scale": 20, "height": [-0.4, 0.2], "roughness": [0.2, 0.6], "albedo": [[0, 0, 0], [1, 1, 1]]}}


@pytest.mark.parametrize(
    ("maps", "ran"),
    [
        (("albedo",), {"skin_maps": {"albedo"}}),
        (("height", "bump"), {"skin_maps": {"height"}}),
        (("normal",), {"skin_maps": {"height"}, "skin_slope": {"slope"}, "normal_map": {"normal"}}),
        (("cavity", "roughness"), {"skin_maps": {"height", "roughness"}, "cavity_map": {"cavity"}}),
        (("reflection", "specular", "scattering_radius"), {}),
    ],
)
def test_only_maps_that_are_asked_for_are_computed(
    ctx: object, monkeypatch: pytest.MonkeyPatch, maps: tuple[str, ...], ran: dict[str, set[str]]
) -> None:
    drawn: dict[str, set[str]] = {}
    draw = FrameGraph._draw

    def watched(self: FrameGraph, step: Any, outputs: tuple[str, ...]) -> None:
        drawn[step.node.name] = set(outputs)
        draw(self, step, outputs)

    monkeypatch.setattr(FrameGraph, "_draw", watched)
    before = COUNTERS.snapshot()
    found = generated(skin(RELIEF), maps)
    assert set(found) == set(maps)
    assert all(array.shape == (16, 16, mapset.MAPS[name].channels) for name, array in found.items())
    assert drawn == ran
    assert COUNTERS.since(before)["draws"] == len(ran)


def test_what_does_not_show_costs_nothing() -> None:
    """A layer without opacity, switched off, or behind a mask without opacity leaves no trace in shader or textures."""
    hidden = [
        {"worley": {"scale": 3, "height": [0, 1], "opacity": 0}},
        {"worley": {"scale": 3, "height": [0, 1], "enabled": False}},
        {"worley": {"scale": 3, "height": [0, 1], "mask": {"pores": {"opacity": 0}}}},
        {"image": {"file": "none.png", "opacity": 0}},
    ]
    plain, more = (fuse(skin(*layers), set(CHANNELS)) for layers in ([RELIEF], [RELIEF, *hidden]))
    assert more == plain


def test_a_layer_is_not_evaluated_where_its_mask_is_0() -> None:
    masked = {"worley": {"scale": 3, "height": [0, 1], "mask": {"fbm": {"scale": 9}}}}
    lines = [line.strip() for line in fuse(skin(masked), {"height"}).source.splitlines()]
    call = next(index for index, line in enumerate(lines) if "worley_layer(" in line)
    guard = lines.index("if (layer0_weight > 0.0)")
    assert lines[guard + 1] == "{"
    assert guard < call < lines.index("}", guard)
    mask = next(index for index, line in enumerate(lines) if "fbm_layer(" in line)
    assert mask < guard


def test_the_same_pixels_in_another_process_with_other_threads(generate: Generate, folder: Path) -> None:
    here = generate("--maps", "albedo,bump,reflection")["maps"]
    for threads in ("0", "3"):
        done = subprocess.run(
            [sys.executable, "-m", "skincli", "generate", "skins/own.yaml", "-o", f"by{threads}", "--json"],
            env={**os.environ, "LP_NUM_THREADS": threads, "PYTHONPATH": str(Path(images.__file__).parents[1])},
            capture_output=True,
            text=True,
            check=True,
            timeout=60,
        )
        assert not done.stderr
        assert json.loads(done.stdout)["maps"] == here


EVERY_KIND = """\
skin: 1
size: 48
extent: 30
seed: 3
pigments: {}
layers:
  - color: {pigments: {melanin: 0.03, oxyhemoglobin: 0.01}, reflectance: 0.4}
  - fbm: {scale: 12, warp: 4, height: [-0.3, 0.3], pigments: {melanin: [0, 0.05]}}
  - veins: {height: [0, 0.2], pigments: {deoxyhemoglobin: [0, 0.05]}}
  - worley: {pattern: edges, scale: 6, width: 0.6, height: [0, -0.2], albedo: [[1, 1, 1], [0.5, 0.4, 0.4]]}
  - pores: {height: [0, -0.1], mask: {ridged: {scale: 15}}}
  - reaction_diffusion: {scale: 5, height: [0, 0.1]}
  - scales: {spacing: 5, height: [0, 0.3], opacity: 0.5}
  - chromatophores: {spacing: 2, pigments: {melanin: [0, 0.3]}}
  - slime: {reflectance: [0.2, 0.9], blend: overlay}
"""


def test_another_driver_draws_the_same_to_five_digits(tmp_path: Path, ctx: Any) -> None:
    """Image layers are left out: softpipe loses texels that loops of unequal length fetch."""
    if "llvmpipe" not in ctx.info["GL_RENDERER"]:
        pytest.skip("drivers are compared with Mesa's software drivers")
    (tmp_path / "every.yaml").write_text(EVERY_KIND)
    asked = ["--maps", "albedo,height,reflectance", "--format", "exr", "--depth", "float", "--json"]
    found = []
    for driver in ("llvmpipe", "softpipe"):
        done = subprocess.run(
            [sys.executable, "-m", "skincli", "generate", "every.yaml", "-o", driver, *asked],
            env={**os.environ, "GALLIUM_DRIVER": driver, "PYTHONPATH": str(Path(images.__file__).parents[1])},
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
            timeout=120,
        )
        assert json.loads(done.stdout)["versions"]["driver"].startswith(driver)
        maps = {
            path.stem: images.read_data(path, 3 if path.stem == "albedo" else 1)
            for path in tmp_path.glob(f"{driver}/*.exr")
        }
        found.append(maps)
    here, there = found
    assert set(here) == set(there) == {"albedo", "height", "reflection"}
    for name, values in here.items():
        span = np.ptp(values)
        assert span > 0.05
        # Color is kept in halves: 11 digits of the binary number.
        error, allowed = np.abs(values - there[name]), 2.0**-11 if name == "albedo" else 1e-5 * span
        assert np.mean(error > allowed) < 0.001, (name, error.max())


# -- where they lie --------------------------------------------------------------------------------------------------


def ball_arguments(*more: object) -> tuple[object, ...]:
    return ("--mesh", "ball.obj", "--unit", "mm", *more)


def test_maps_on_a_mesh_follow_its_surface(generate: Generate, folder: Path) -> None:
    coarse = ("--set", "skin.layers.fbm.scale=90", "--set", "skin.extent=300", "--size", 64)
    on_mesh = generate(*ball_arguments(*coarse))
    assert "extent_mm" not in on_mesh
    by_uv = generate(*ball_arguments(*coarse, "--set", "skin.domain=uv"), into="by_uv")
    flat = generate(*coarse, into="flat")
    assert on_mesh["maps"]["bump"]["pixels"] != flat["maps"]["bump"]["pixels"]
    assert by_uv["maps"]["bump"]["pixels"] == flat["maps"]["bump"]["pixels"]
    # The ball's left and right edge are the same line on it.
    assert step_at_the_seam(bump(folder / "maps", on_mesh)) < 1.2
    assert step_at_the_seam(bump(folder / "flat", flat)) > 1.8


def step_at_the_seam(height: NDArray[np.floating]) -> float:
    """Return the largest step from the last column to the first, relative to the largest between neighbors."""
    return float(np.abs(height[:, 0] - height[:, -1]).max() / np.abs(np.diff(height, axis=1)).max())


def test_a_scene_gives_mesh_and_skins(skincli: Run, folder: Path, ctx: object) -> None:
    result = skincli("generate", "--scene", "scene.yaml", "-o", "maps", "--set", "skin.size=32", "--json")
    assert result.exit_code == 0, result.output
    [manifest] = json.loads(result.stdout)
    assert (manifest["size"], manifest["folder"]) == (32, "maps")
    same = skincli("generate", "--scene", "scene.yaml", "-o", "again", "--size", 32, "--json")
    assert json.loads(same.stdout)[0]["maps"] == manifest["maps"]


def two_parts(folder: Path, second: str = "0 0\nvt 1 0\nvt 0 1") -> None:
    """Write two triangles of the names `../a` and `b c`, whose uv overlap or do not."""
    corners = "v 0 0 0\nv 50 0 0\nv 0 50 0\nv 0 0 60\nv 50 0 60\nv 0 50 60\n"
    uv = f"vt 0 0\nvt 1 0\nvt 0 1\nvt {second}\n"
    (folder / "two.obj").write_text(f"{corners}{uv}o ../a\nf 1/1 2/2 3/3\no b c\nf 4/4 5/5 6/6\n")


def test_parts_whose_uv_overlap_get_a_folder_each(skincli: Run, folder: Path, ctx: object) -> None:
    two_parts(folder)
    arguments = ("human", "--mesh", "two.obj", "--unit", "mm", "--size", 16)
    result = skincli("generate", *arguments, "-o", "maps")
    assert result.exit_code == 0, result.output
    names = sorted(path.name for path in (folder / "maps").iterdir())
    assert names == ["_._a", "b_c"]
    assert len(result.stdout.splitlines()) == 2 * 4
    result = skincli("generate", *arguments, "-o", "json", "--json")
    assert [manifest["folder"] for manifest in json.loads(result.stdout)] == [f"json/{name}" for name in names]


def test_parts_that_share_the_uv_square_share_their_maps(skincli: Run, folder: Path, ctx: object) -> None:
    two_parts(folder, "1 1\nvt 0.6 1\nvt 1 0.6")
    result = skincli("generate", "human", "--mesh", "two.obj", "--unit", "mm", "--size", 16, "-o", "maps")
    assert result.exit_code == 0, result.output
    assert (folder / "maps/manifest.json").is_file()


# -- what is written -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        (("--maps", "normal,height"), {"height.png", "normal.png"}),
        (("--maps", "normal", "--normal", "directx"), {"normal_dx.png"}),
        (("--maps", "albedo,radius", "--depth", "float"), {"albedo.exr", "scattering_radius.exr"}),
        (("--maps", "albedo,normal", "--naming", "ambientcg"), {"own_Color.png", "own_NormalGL.png"}),
    ],
)
def test_files_are_named_and_encoded_as_asked(
    generate: Generate, skincli: Run, folder: Path, arguments: tuple[str, ...], names: set[str]
) -> None:
    result = skincli("generate", "skins/own.yaml", "-o", "maps", *arguments)
    assert (result.exit_code, result.stderr) == (0, "")
    assert {path.name for path in (folder / "maps").iterdir()} == {*names, "manifest.json"}


def test_a_folder_of_maps_is_generated_anew(generate: Generate, skincli: Run, folder: Path) -> None:
    arguments = ("--maps", "albedo,height,reflection", "--format", "exr", "--depth", "float")
    first = skincli("generate", "skins/own.yaml", "-o", "first", *arguments, "--json")
    second = skincli("generate", "first", "-o", "second", *arguments, "--json")
    assert second.exit_code == 0, second.output
    one, two = json.loads(first.stdout), json.loads(second.stdout)
    pixels = [{name: entry["pixels"] for name, entry in made["maps"].items()} for made in (one, two)]
    assert pixels[0] == pixels[1]
    assert (two["skin"], two["size"], two["extent_mm"]) == ("first", 32, 40)
    assert [one[key] for key in ("about", "optics", "surface")] == [two[key] for key in ("about", "optics", "surface")]
    changed = skincli(
        "generate", "first/", "-o", "third", *arguments, "--json", "--set", "skin.layers.height.height=[0, 2]"
    )
    assert json.loads(changed.stdout)["maps"]["height"]["pixels"] != pixels[0]["height"]


def test_the_preview_shows_maps_ball_and_head(
    skincli: Run, folder: Path, ctx: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("skincli.preview.load_builtin", lambda name, _: load_builtin(name, "4k"))
    result = skincli("generate", "human", "-o", "maps", "--size", 32, "--preview", "--maps", "albedo,height,roughness")
    assert result.exit_code == 0, result.output
    assert result.stdout.splitlines()[-1] == "maps/preview.png"
    sheet = images.read_color(folder / "maps/preview.png")
    width, height = images.size_of(folder / "maps/preview.png")
    assert width > 5 * 384
    assert 384 < height < 500
    lit = sheet[:, -2 * 392 :, :3]
    assert lit.std() > 0.1
    assert 0.1 < lit.mean() < 0.5


def test_progress_is_shown_to_a_person_alone(generate: Generate, folder: Path) -> None:
    """Nobody else gets a word on stderr; `generate` holds all other tests to that."""
    reader, writer = pty.openpty()
    done = subprocess.run(
        [sys.executable, "-m", "skincli", "generate", "skins/own.yaml", "-o", "maps"],
        env={**os.environ, "PYTHONPATH": str(Path(images.__file__).parents[1]), "TERM": "xterm"},
        stdout=subprocess.PIPE,
        stderr=writer,
        text=True,
        check=True,
        timeout=60,
    )
    os.close(writer)
    shown = os.read(reader, 10000).decode()
    os.close(reader)
    assert "own, 32 x 32" in shown
    assert "100%" in shown
    assert done.stdout.splitlines() == [f"maps/{name}.png" for name in NAMES] + ["maps/manifest.json"]


def test_an_interrupted_writing_leaves_no_old_manifest(
    generate: Generate, skincli: Run, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = generate()
    write = mapset.write_map

    def second_fails(path: Path, name: str, *rest: Any) -> Any:
        if name == "bump":
            raise KeyboardInterrupt
        return write(path, name, *rest)

    monkeypatch.setattr(mapset, "write_map", second_fails)
    result = skincli("generate", "skins/own.yaml", "-o", "maps", "--set", "skin.seed=8")
    assert result.exit_code == 130
    left = {path.name for path in (folder / "maps").iterdir()}
    assert left == {f"{name}.png" for name in NAMES}
    assert images.read_data(folder / "maps/bump.png", 1).shape == (32, 32, 1)
    kept = hashlib.blake2b((folder / "maps/bump.png").read_bytes(), digest_size=16).hexdigest()
    assert kept == old["maps"]["bump"]["bytes"]
