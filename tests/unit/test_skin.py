"""What a skin file may contain, and the presets that come with the program."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from pydantic import ValidationError

from skincli import images, resources
from skincli.layers import LAYERS
from skincli.layers.image import Picture
from skincli.layers.stack import CHANNELS, fuse
from skincli.scene.skin import Optics, Skin, Surface

PRESETS = sorted(resources.folder("presets").glob("*.yaml"))


def faults(*layers: Any, **keys: Any) -> list[tuple[str, str, str]]:
    """Return (place, kind, message) of all that is wrong with a skin.

    Where an item of a list is wrong, pydantic adds that the list is too short without it; that is left out.
    """
    with pytest.raises(ValidationError) as caught:
        Skin.model_validate({"skin": 1, "layers": list(layers), **keys})
    return [
        (".".join(map(str, e["loc"])), e["type"], e["msg"]) for e in caught.value.errors() if e["type"] != "too_short"
    ]


def test_defaults() -> None:
    skin = Skin.model_validate({"skin": 1})
    assert (skin.size, skin.extent, skin.seed, skin.layers) == (2048, 100.0, 0, ())
    assert skin.optics == Optics()
    assert skin.surface == Surface()


def test_layers_are_typed_and_in_order() -> None:
    skin = Skin.model_validate({"skin": 1, "layers": [{"color": {"height": 1}}, {"pores": {"spacing": 2}}]})
    assert [layer.kind() for layer in skin.layers] == ["color", "pores"]


def test_a_document_with_its_defaults_filled_in_says_the_same() -> None:
    layer = {"color": {"height": 1, "mask": {"image": {"file": "a.png", "mask": {"fbm": {}}}}}}
    skin = Skin.model_validate({"skin": 1, "layers": [layer]})
    document = skin.model_dump(mode="json")
    assert document["layers"][0]["color"]["mask"]["image"]["mask"]["fbm"]["octaves"] == 5
    assert Skin.model_validate(document) == skin


@pytest.mark.parametrize(
    ("layer", "place", "kind"),
    [
        ({"poors": {}}, "layers.0.poors", "extra_forbidden"),
        ({"pores": {"spacng": 1}}, "layers.0.pores.spacng", "extra_forbidden"),
        ({"pores": {"spacing": -1}}, "layers.0.pores.spacing", "greater_than_equal"),
        ({"pores": {"spacing": "1"}}, "layers.0.pores.spacing", "float_type"),
        ({"pores": {"spacing": float("nan")}}, "layers.0.pores.spacing", "finite_number"),
        ({"pores": None}, "layers.0.pores", "model_type"),
        ("pores", "layers.0", "model_type"),
        ({"fbm": {"height": [0, 1], "octaves": 2.0}}, "layers.0.fbm.octaves", "int_type"),
        ({"fbm": {"albedo": [[0, 0, 0], [0, 2, 0]]}}, "layers.0.fbm.albedo.1.1", "less_than_equal"),
        ({"fbm": {"height": [0, 1], "blend": "mutliply"}}, "layers.0.fbm.blend", "literal_error"),
        ({"color": {"albedo": [1, 1, 1], "seed": 1}}, "layers.0.color.seed", "extra_forbidden"),
        (
            {"fbm": {"height": [0, 1], "mask": {"worley": {"scale": 0}}}},
            "layers.0.fbm.mask.worley.scale",
            "greater_than_equal",
        ),
    ],
)
def test_a_fault_is_reported_at_its_place(layer: Any, place: str, kind: str) -> None:
    assert [(p, k) for p, k, _ in faults(layer)] == [(place, kind)]


@pytest.mark.parametrize(
    ("layer", "message"),
    [
        ({"fbm": {}, "pores": {}}, "one key, the layer's name; found fbm, pores"),
        ({}, "one key, the layer's name; found nothing"),
        ({"fbm": {}}, "this fbm layer writes nothing; give it at least one of albedo, height, pigments"),
        ({"pores": {"depth": 0}}, "this pores layer writes nothing; give it at least one of albedo, depth, height"),
        ({"pores": {"radius": 0.6}}, "radius is 0.6 mm, more than half of spacing, 1 mm"),
        ({"worley": {"pattern": "edges", "height": [0, 1]}}, "needs the width of its lines"),
        ({"worley": {"width": 1, "height": [0, 1]}}, "the pattern f1 has no lines; remove width"),
        ({"pores": {"mask": {"color": {"height": 1}}}}, "this color layer has no pattern to mask with"),
        ({"pores": {"mask": {"image": {"file": "n.png", "role": "normal_gl"}}}}, "this image layer has no pattern"),
        ({"pores": {"mask": {"fbm": {"height": [0, 1], "blend": "screen"}}}}, "remove blend, height from the mask"),
        ({"image": {"file": "a.png", "tile_size": 1, "tiles": 1}}, "write one of them"),
        ({"image": {"file": "a.png", "role": "normal_gl", "tile_size": 1}}, "a normal map follows the uv"),
        ({"image": {"file": "a.png", "role": "normal_dx", "height": [0, 1]}}, "only tilts the surface; remove height"),
        ({"image": {"file": "a.png", "into": ["reflectance"], "reflectance": [0, 1]}}, "reflectance is in `into`"),
    ],
)
def test_a_contradiction_is_explained(layer: dict[str, Any], message: str) -> None:
    [(_, kind, found)] = faults(layer)
    assert kind == "value_error"
    assert message in found


def test_all_faults_are_reported_together() -> None:
    found = faults({"fbm": {}}, {"pores": {"spacing": 0}}, size=0, optics={"radius": [1, 0, 1]})
    assert [place for place, _, _ in found] == ["size", "layers.0", "layers.1.pores.spacing", "optics.radius.1"]


def test_names_of_layers_differ() -> None:
    [(place, _, message)] = faults({"pores": {"name": "a"}}, {"fbm": {"name": "a", "height": [0, 1]}})
    assert place == "layers"
    assert "more than one layer has the name a" in message


@pytest.mark.parametrize(("size", "valid"), [(1, True), (16384, True), (0, False), (16385, False)])
def test_size_has_bounds(size: int, valid: bool) -> None:
    if valid:
        assert Skin.model_validate({"skin": 1, "size": size}).size == size
    else:
        assert [place for place, _, _ in faults(size=size)] == ["size"]


@pytest.mark.parametrize("model", [Skin, Optics, Surface])
def test_every_key_is_described(model: Any) -> None:
    for name, field in model.model_fields.items():
        assert field.description, name


def load(path: Path) -> Skin:
    context = {"base": path.parent, "roots": ()}
    return Skin.model_validate(yaml.safe_load(path.read_text(encoding="utf-8")), context=context)


def test_there_are_three_presets_at_least() -> None:
    assert {"human", "octopus", "undead"} <= {path.stem for path in PRESETS}


@pytest.mark.parametrize("path", PRESETS, ids=lambda path: path.stem)
def test_presets_are_valid_and_complete(path: Path) -> None:
    skin = load(path)
    assert skin.about.endswith(".")
    assert fuse(skin, set(CHANNELS)).written >= {"albedo", "height", "reflectance"}


def test_some_presets_blend_source_images_as_the_paper_does() -> None:
    textures = [item for path in PRESETS for _, item in fuse(load(path), {"albedo", "height"}).textures]
    assert any(item.file.is_file() for item in textures if isinstance(item, Picture))


def test_every_layer_has_its_shader_and_appears_in_a_preset_or_an_example() -> None:
    shown = [*PRESETS, *(Path(__file__).resolve().parents[2] / "examples").glob("*.yaml")]
    text = "\n".join(path.read_text(encoding="utf-8") for path in shown)
    for kind, layer in LAYERS.items():
        assert f"{kind}: {{" in text or f"{kind}:\n" in text, f"no preset or example shows the layer {kind}"
        assert (resources.folder("shaders") / "layers" / f"{kind}.glsl").is_file() == (layer.kernel is not None)


def test_source_images_are_what_their_script_makes(tmp_path: Path) -> None:
    folder = resources.folder("presets") / "sources"
    runpy.run_path(str(folder / "make.py"))["main"](tmp_path)
    names = sorted(path.name for path in folder.glob("*.png"))
    assert names == sorted(path.name for path in tmp_path.glob("*.png"))
    for name in names:
        kept, made = (images.read_color(place / name) for place in (folder, tmp_path))
        # Other builds of the Fourier transform round differently, which may move a texel by a step.
        assert np.mean(np.abs(kept - made)) < 1 / 255, name


def test_source_images_tile() -> None:
    """The step from the last row to the first is no larger than the largest step between rows; so for columns."""
    for path in (resources.folder("presets") / "sources").glob("*.png"):
        pixels = images.read_data(path, 1)[..., 0]
        for axis in (0, 1):
            inside = np.abs(np.diff(pixels, axis=axis)).mean(axis=1 - axis).max()
            across = np.abs(pixels.take(0, axis) - pixels.take(-1, axis)).mean()
            assert across <= inside, path.name
