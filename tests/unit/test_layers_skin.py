"""Laws of the layers of skin and of scattered marks, on their float64 twins: no OpenGL."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError

from skincli.layers import LAYERS, hashing, marks
from skincli.layers.base import Pattern
from tests.layers_kit import assert_tileable, cloud, evaluate, flat

Array = NDArray[np.float64]


def layer(kind: str, **settings: object) -> Pattern:
    made = LAYERS[kind].model_validate(settings)
    assert isinstance(made, Pattern)
    return made


SKIN = [
    layer("pores"),
    layer("follicles"),
    layer("follicles", part="rim"),
    layer("follicles", part="dot"),
    layer("wrinkles"),
    layer("wrinkles", cross=0.5),
    layer("veins"),
    layer("freckles"),
    layer("moles"),
    layer("moles", part="dome"),
    layer("mottling"),
    layer("scars"),
    layer("scars", part="puckers"),
    layer("scars", part="stitches"),
]


def names(made: Pattern) -> str:
    return "-".join([made.kind(), *(str(getattr(made, key)) for key in ("part", "cross") if getattr(made, key, 0))])


@pytest.mark.parametrize("made", SKIN, ids=names)
def test_maps_repeat(made: Pattern) -> None:
    assert_tileable(made, period=12 * made.size())


@pytest.mark.parametrize("made", SKIN, ids=names)
def test_patterns_fill_0_to_1(made: Pattern) -> None:
    t = evaluate(made, flat(100, 12 * made.size()))
    assert t.min() >= 0
    assert t.max() <= 1
    assert np.ptp(t) > 0.6


@pytest.mark.parametrize("made", SKIN, ids=names)
def test_a_size_in_mm_is_that_of_the_features(made: Pattern) -> None:
    """With all lengths doubled the pattern at twice the place is the same."""
    lengths = {"spacing", "radius", "length", "width", "interval", "cluster", "scale"}
    written = {key: value for key, value in made.model_dump(exclude_none=True).items() if key != "name"}
    double = layer(made.kind(), **{key: 2 * value if key in lengths else value for key, value in written.items()})
    one = evaluate(made, flat(40, 8 * made.size()))
    two = evaluate(double, flat(40, 16 * made.size()))
    np.testing.assert_allclose(one, two, atol=1e-9)


@pytest.mark.parametrize("radius", [0.1, 0.4, 1.3])
def test_no_mark_is_cut_off(radius: float) -> None:
    """All marks of a far larger box that lie within the radius are among those that are found."""
    site = cloud(20)
    position, normal = site["position"][:400], site["normal"][:400]
    found = marks.find_marks(position, normal, marks.disk(normal, radius), 0, 1.0, 5)
    for place in range(0, 400, 7):
        one = slice(place, place + 1)
        alone = marks.find_marks(position[one], normal[one], marks.disk(normal[one], radius), 0, 1.0, 5)
        wide = marks.find_marks(position[one], normal[one], np.full((1, 3), radius + 2), 0, 1.0, 5)
        sums = [
            np.sum(some.near[i] * np.maximum(radius**2 - some.squared()[i], 0))
            for some, i in ((found, place), (alone, 0), (wide, 0))
        ]
        assert sums == pytest.approx([sums[2]] * 3, abs=1e-12)


@pytest.mark.parametrize(("axis", "jitter"), list(product([None, (0, 0, 1)], [0.0, 0.5, 1.0])))
def test_marks_are_one_cell_apart(axis: tuple[int, int, int] | None, jitter: float) -> None:
    """Per area there are as many as cells, on a flat square and, jittered or not, on planes of any direction."""
    site = cloud(50)
    normal = site["normal"] if axis is None else np.tile(np.array(axis, float), (len(site["normal"]), 1))
    position = site["position"] * (np.array([1, 1, 0]) if axis else 1)
    found = marks.find_marks(position, normal, marks.disk(normal, 1.0), 0, jitter, 2)
    per_area = np.mean(np.sum(found.near * (found.squared() < 1), axis=1)) / np.pi
    assert per_area == pytest.approx(1, rel=0.2)


def test_the_numbers_of_the_two_marks_of_a_cell_are_independent() -> None:
    cells = np.stack(np.meshgrid(*[np.arange(20)] * 3), axis=-1).reshape(-1, 3)
    first = hashing.hash_cell(cells, 3)
    second = 4096 * first % 1
    numbers = np.column_stack([first, second, 16 * first % 1, 16 * second % 1])
    assert np.abs(np.corrcoef(numbers.T) - np.eye(16)).max() < 0.09  # 1/16 of it by construction, see more_random
    assert np.allclose(numbers.mean(axis=0), 0.5, atol=0.015)
    assert np.allclose(numbers.var(axis=0), 1 / 12, atol=0.003)


@pytest.mark.parametrize("texel", [0.05, 0.3, 1.0])
def test_widened_bumps_keep_mass_and_gain_the_variance_of_a_texel(texel: float) -> None:
    x, y = np.meshgrid(*[np.linspace(-3, 3, 601)] * 2)
    moments = []
    for size in (0.0, texel):
        wide2 = marks.widened2(0.4, np.array(size))
        bump = 0.4**2 / wide2 * marks.bump((x**2 + y**2) / wide2)
        moments.append((bump.sum() * 1e-4, np.sum(bump * x**2) / bump.sum()))
    assert moments[1][0] == pytest.approx(moments[0][0], rel=1e-3)
    assert moments[1][1] - moments[0][1] == pytest.approx(texel**2 / 12, rel=1e-3)


def test_wrinkles_run_along_their_direction() -> None:
    """The pattern changes far less along it than across."""
    for direction, along in (([1, 0, 0], 1), ([0, 1, 0], 0)):
        t = evaluate(layer("wrinkles", direction=direction), flat(150, 8)).reshape(150, 150)
        changes = [np.abs(np.diff(t, axis=axis)).mean() for axis in (0, 1)]
        assert changes[along] < 0.3 * changes[1 - along]


def test_parts_of_one_seed_meet() -> None:
    """The dot lies in the pit, the rim around it; puckers and stitches lie where the scars are."""
    site = flat(150, 15)
    pit, rim, dot = (evaluate(layer("follicles", part=part, variation=0), site) for part in ("pit", "rim", "dot"))
    assert pit[dot > 0.5].min() > 0.2
    assert rim[pit > 0.9].max() < 0.3
    site = flat(150, 150)
    line, puckers = (evaluate(layer("scars", part=part), site) for part in ("line", "puckers"))
    assert np.all(puckers <= line + 1e-12)


def test_freckles_come_in_clusters() -> None:
    site = flat(160, 160)
    means = []
    for clustering in (0.0, 1.0):
        t = evaluate(layer("freckles", clustering=clustering), site).reshape(16, 10, 16, 10).mean(axis=(1, 3))
        means.append(t.std() / t.mean())
    assert means[1] > 1.3 * means[0]


def test_branches_add_thinner_veins_and_leave_the_large() -> None:
    site = flat(160, 60)
    trunk, tree = (evaluate(layer("veins", branches=count), site) for count in (0, 3))
    assert np.all(tree >= trunk - 1e-12)
    assert tree.mean() > 1.1 * trunk.mean()


@pytest.mark.parametrize(
    ("kind", "settings"),
    [
        ("pores", {"spacing": 1.0, "radius": 0.6}),
        ("follicles", {"spacing": 1.0, "radius": 0.6}),
        ("follicles", {"direction": [0, 0, 0]}),
        ("wrinkles", {"spacing": 1.0, "length": 50.0}),
        ("wrinkles", {"spacing": 1.0, "width": 3.0}),
        ("veins", {"spacing": 1.0, "width": 0.5}),
        ("freckles", {"spacing": 1.0, "radius": 0.6}),
        ("freckles", {"spacing": 15.0, "cluster": 20.0}),
        ("moles", {"spacing": 1.0, "radius": 0.6}),
        ("scars", {"spacing": 5.0, "length": 20.0}),
        ("scars", {"length": 3.0, "width": 2.0}),
    ],
)
def test_what_does_not_fit_is_refused(kind: str, settings: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        layer(kind, **settings)
