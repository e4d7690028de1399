"""`skincli generate`: the maps, what they hold in numbers, and the manifest that says how to read them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result
from numpy.typing import NDArray

from skincli import images
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
