"""Meaning of the scene's keys: units, defaults that follow from others, refusals that need two keys."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from skincli.scene.model import Camera, MeshSource, Render, Scene, check_outputs
from skincli.scene.skin import Optics


def fields(model: type[BaseModel]) -> Iterator[tuple[str, FieldInfo]]:
    """Yield every field of a model and of the models below it."""
    for name, info in model.model_fields.items():
        yield f"{model.__name__}.{name}", info
        todo = [info.annotation]
        while todo:
            kind = todo.pop()
            todo += getattr(kind, "__args__", ())
            if isinstance(kind, type) and issubclass(kind, BaseModel):
                yield from fields(kind)


def test_every_key_is_described() -> None:
    assert [name for name, info in fields(Scene) if not info.description] == []
    assert len(list(fields(Scene))) > 40


@pytest.mark.parametrize(
    ("source", "factor"),
    [
        ({"file": "a.glb"}, 1000),
        ({"file": "a.GLTF"}, 1000),
        ({"file": "a.glb", "unit": "cm"}, 10),
        ({"file": "a.obj", "unit": "mm"}, 1),
        ({"file": "a.ply", "unit": "in"}, 25.4),
        ({"file": "a.stl", "unit": 2}, 2),
        ({"file": "a.stl", "unit": 0.5}, 0.5),
        ({"builtin": "head"}, 1),
    ],
)
def test_millimetres_per_unit(source: dict[str, object], factor: float) -> None:
    assert MeshSource.model_validate(source).mm_per_unit == factor


@pytest.mark.parametrize("unit", ["km", "MM", "", -1, 0, float("nan"), float("inf"), True, [1], 1e7, "2"])
def test_units_refused(unit: object) -> None:
    with pytest.raises(ValidationError):
        MeshSource.model_validate({"file": "a.obj", "unit": unit})


@pytest.mark.parametrize(("written", "triangles"), [("259k", 259_000), ("2M", 2_000_000), (12, 12)])
def test_detail(written: object, triangles: int) -> None:
    assert MeshSource.model_validate({"builtin": "creature", "detail": written}).detail == triangles


@pytest.mark.parametrize("detail", ["k", "-1k", "1e3", "99M", 0, 1.0, True])
def test_detail_refused(detail: object) -> None:
    with pytest.raises(ValidationError):
        MeshSource.model_validate({"builtin": "creature", "detail": detail})


@pytest.mark.parametrize(
    ("render", "atlas", "samples"),
    [
        ({}, 2048, 2),
        ({"quality": "draft"}, 1024, 1),
        ({"quality": "high"}, 4096, 3),
        ({"shading": "paper"}, 2500, 1),
        ({"shading": "paper", "quality": "high"}, 2500, 1),
        ({"shading": "paper", "atlas": 512, "supersample": 4}, 512, 4),
        ({"quality": "draft", "atlas": 16384}, 16384, 1),
    ],
)
def test_quality_sets_what_is_not_written(render: dict[str, object], atlas: int, samples: int) -> None:
    settings = Render.model_validate(render)
    assert (settings.atlas_size, settings.samples_per_axis) == (atlas, samples)


def camera(**keys: Any) -> Camera:
    return Camera.model_validate({"position": [0, 0, 600], "target": [0, 0, 0]} | keys)


def test_cameras_that_can_see() -> None:
    camera()
    camera(position=[0, 500, 1])
    camera(position=[0, 500, 0], up=[0, 0, -1])
    camera(position=[0, 0, 1e-6])
    camera(up=[1e-6, 2e-6, 0])


@pytest.mark.parametrize(
    "keys",
    [
        {"position": [0, 0, 0]},
        {"position": [1e6, 0, 0], "target": [1e6 + 1e-7, 0, 0]},
        {"position": [0, 500, 0]},
        {"position": [0, 500, 0], "up": [0, -3, 0]},
        {"up": [0, 0, 0]},
        {"up": [0, 0, 7]},
        {"fov": 0},
        {"fov": 180},
        {"exposure": 65},
        {"position": [0, 0, 1e10]},
        {"position": (0, 0)},
    ],
)
def test_cameras_that_cannot(keys: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        camera(**keys)


def test_light_may_be_negative_and_ambient_not() -> None:
    light = {"type": "point", "position": [0, 0, 0], "intensity": [-1, 0, 2]}
    scene = {"scene": 1, "mesh": {"builtin": "head"}, "lights": [light]}
    assert Scene.model_validate(scene).lights[0].type == "point"
    with pytest.raises(ValidationError):
        Scene.model_validate(scene | {"ambient": [-1, 0, 0]})


def test_what_is_read_cannot_be_changed() -> None:
    with pytest.raises(ValidationError):
        camera().fov = 3


def test_unknown_outputs() -> None:
    assert check_outputs(["beauty"], ["beauty", "depth"]) == []
    assert check_outputs(["deph", "x"], ["beauty", "depth"]) == [
        "no output has that name; did you mean 'depth'? There are: beauty, depth",
        "no output has that name. There are: beauty, depth",
    ]


@pytest.mark.parametrize(
    ("written", "method", "terms"),
    [
        ({}, "lattice", 4),
        ({"quality": "draft"}, "lattice", 2),
        ({"quality": "high", "diffusion": "none"}, "none", 6),
        ({"diffusion": {"method": "screen_space", "terms": 2}}, "screen_space", 2),
        ({"shading": "paper"}, "paper", 4),
        ({"effects": {"blur": False}}, "none", 4),
    ],
)
def test_diffusion(written: dict[str, object], method: str, terms: int) -> None:
    render = Render.model_validate(written)
    assert (render.diffusion_method, render.diffusion_terms) == (method, terms)


@pytest.mark.parametrize(
    "written",
    [
        {"diffusion": "sharp"},
        {"diffusion": {"terms": 0}},
        {"diffusion": {"albedo": "never"}},
        {"shading": "paper", "diffusion": "lattice"},
        {"shading": "paper", "diffusion": {"albedo": "split"}},
    ],
)
def test_diffusions_refused(written: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        Render.model_validate(written)


LAYER = {"sigma_a": [0.1, 0.2, 0.3], "sigma_s": [3.0, 4.0, 5.0], "thickness": 0.5}
BOTTOM = {"sigma_a": [0.03, 0.1, 0.2], "sigma_s": [1.0, 1.5, 2.0]}


@pytest.mark.parametrize(
    "written",
    [
        {},
        {"profile": "gaussian", "radius": [2.0, 1.0, 0.5]},
        {"profile": "dipole", "sigma_a": [0.03, 0.1, 0.2], "sigma_s": [1.0, 1.5, 2.0]},
        {"profile": "multipole", "layers": [LAYER, LAYER, BOTTOM]},
        {"profile": "human"},
        {"profile": "jensen_skin1"},
        {"profile": "jensen_skin2"},
    ],
)
def test_profiles(written: dict[str, object]) -> None:
    """Each profile is one, and brings back no more light than there was."""
    total = Optics.model_validate(written).diffusion_profile().total()
    assert total.shape == (3,)
    assert ((total > 0) & (total <= 1)).all()


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ({"profile": "dipole"}, "needs sigma_a and sigma_s"),
        ({"profile": "multipole"}, "needs layers"),
        ({"sigma_a": [1.0, 1.0, 1.0]}, "does not read sigma_a"),
        ({"profile": "human", "ior": 1.3}, "does not read ior"),
        ({"profile": "multipole", "layers": [BOTTOM, BOTTOM]}, "only the lowest"),
        ({"profile": "multipole", "layers": [{**LAYER, "thickness": 0.01}]}, "mean free path"),
    ],
)
def test_profiles_refused(written: dict[str, object], said: str) -> None:
    with pytest.raises(ValidationError, match=said):
        Optics.model_validate(written)
