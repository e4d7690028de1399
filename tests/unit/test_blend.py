"""Laws of the blend modes and of curves, on their float64 twins: no OpenGL."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, get_args

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError

from skincli.color import srgb_decode, srgb_encode
from skincli.layers.blend import MODES, Blend, Space, apply_in, check_space, expression, height_coverage
from skincli.layers.remap import MAX_POINTS, Curve, call, members, remap, slopes

Array = NDArray[np.float64]

ORDINARY = [name for name, mode in MODES.items() if mode.weighs == "mix"]
HUE_MODES = [name for name, mode in MODES.items() if not mode.separable]
T = np.linspace(0, 1, 41)
#: all pairs of greys, and many pairs of colors, some of them grey or at the corners of the cube
GRAYS = tuple(x.reshape(-1, 1) for x in np.meshgrid(T, T))
_RNG = np.random.default_rng(3)
COLORS = tuple(
    np.concatenate([_RNG.random((2000, 3)), _RNG.integers(0, 3, (2000, 3)) / 2, np.tile(_RNG.random((50, 1)), 3)])
    for _ in range(2)
)


def at(mode: Blend, b: Any, s: Any, w: float = 1.0) -> Array:
    return MODES[mode].apply(np.asarray(b, dtype=np.float64), np.asarray(s, dtype=np.float64), np.array(w))


def test_the_names_that_are_checked_are_those_of_the_table() -> None:
    assert get_args(Blend) == tuple(MODES)
    assert all(name == mode.name and mode.formula for name, mode in MODES.items())


#: backdrop, source -> result, worked out by hand from the published formulas
BY_HAND: list[tuple[Blend, list[tuple[float, float, float]]]] = [
    ("normal", [(0.2, 0.6, 0.6)]),
    ("darken", [(0.2, 0.6, 0.2), (0.6, 0.2, 0.2)]),
    ("multiply", [(0.8, 0.6, 0.48)]),
    ("color_burn", [(0.8, 0.5, 0.6), (0.2, 0.5, 0), (1, 0, 1), (0.9, 0, 0), (0, 0, 0), (0, 1, 0), (1, 1, 1)]),
    ("linear_burn", [(0.8, 0.6, 0.4), (0.2, 0.6, 0)]),
    ("lighten", [(0.2, 0.6, 0.6), (0.6, 0.2, 0.6)]),
    ("screen", [(0.2, 0.6, 0.68)]),
    ("color_dodge", [(0.2, 0.5, 0.4), (0.8, 0.5, 1), (0, 1, 0), (0.1, 1, 1), (1, 1, 1), (1, 0, 1), (0, 0, 0)]),
    ("linear_dodge", [(0.2, 0.6, 0.8), (0.8, 0.6, 1)]),
    ("overlay", [(0.2, 0.6, 0.24), (0.8, 0.6, 0.84)]),
    ("soft_light", [(0.2, 0.25, 0.12), (0.2, 0.75, 0.324), (0.64, 0.75, 0.72), (0.25, 1, 0.5), (0.5, 0, 0.25)]),
    ("hard_light", [(0.6, 0.2, 0.24), (0.6, 0.8, 0.84)]),
    ("vivid_light", [(0.8, 0.25, 0.6), (0.2, 0.75, 0.4), (0.3, 0.5, 0.3), (0, 1, 0), (1, 0, 1)]),
    ("linear_light", [(0.5, 0.6, 0.7), (0.2, 0.1, 0), (0.9, 0.9, 1)]),
    ("pin_light", [(0.5, 0.2, 0.4), (0.3, 0.2, 0.3), (0.5, 0.9, 0.8), (0.9, 0.9, 0.9)]),
    ("hard_mix", [(0.4, 0.5, 0), (0.5, 0.5, 1), (0.6, 0.5, 1), (0, 1, 1), (1, 0, 1), (0, 0, 0)]),
    ("difference", [(0.2, 0.6, 0.4), (0.6, 0.2, 0.4)]),
    ("exclusion", [(0.2, 0.6, 0.56)]),
    ("subtract", [(0.6, 0.2, 0.4), (0.2, 0.6, 0)]),
    ("divide", [(0.2, 0.8, 0.25), (0.8, 0.2, 1), (0.5, 0, 1), (0, 0, 0), (0, 0.5, 0)]),
    ("hue", [(0.2, 0.6, 0.2)]),
    ("saturation", [(0.2, 0.6, 0.2)]),
    ("color", [(0.2, 0.6, 0.2)]),
    ("luminosity", [(0.2, 0.6, 0.6)]),
    ("density", [(0.8, 0.25, 0.2)]),
    ("height_blend", [(0.2, 0.6, 0.6)]),
]


@pytest.mark.parametrize(("mode", "values"), BY_HAND, ids=[mode for mode, _ in BY_HAND])
def test_values_by_hand(mode: Blend, values: list[tuple[float, float, float]]) -> None:
    b, s, expected = np.array(values).T[..., None]
    np.testing.assert_allclose(at(mode, b, s), expected, atol=1e-12)


def test_every_mode_is_worked_out_by_hand() -> None:
    assert [mode for mode, _ in BY_HAND] == list(MODES)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("pairs", [GRAYS, COLORS], ids=["gray", "color"])
def test_results_stay_in_0_to_1(mode: Blend, pairs: tuple[Array, Array]) -> None:
    b, s = pairs
    for space in MODES[mode].spaces:
        for w in (0.0, 0.3, 1.0):
            result = apply_in(space, mode, b, s, np.array(w))
            assert result.min() >= 0
            assert result.max() <= 1 + 1e-15


@pytest.mark.parametrize("mode", MODES)
def test_without_weight_the_backdrop_stays(mode: Blend) -> None:
    b, s = COLORS
    for space in MODES[mode].spaces:
        np.testing.assert_allclose(apply_in(space, mode, b, s, np.array(0.0)), b, atol=1e-14)


@pytest.mark.parametrize("mode", ORDINARY)
def test_ordinary_modes_are_linear_in_the_weight(mode: Blend) -> None:
    b, s = COLORS
    none, half, full = (at(mode, b, s, w) for w in (0.0, 0.5, 1.0))
    np.testing.assert_allclose(half, (none + full) / 2, atol=1e-14)


@pytest.mark.parametrize(
    ("mode", "neutral"),
    [
        ("multiply", 1),
        ("color_burn", 1),
        ("linear_burn", 1),
        ("darken", 1),
        ("divide", 1),
        ("density", 1),
        ("screen", 0),
        ("color_dodge", 0),
        ("linear_dodge", 0),
        ("lighten", 0),
        ("difference", 0),
        ("exclusion", 0),
        ("subtract", 0),
        ("hard_light", 0.5),
        ("soft_light", 0.5),
        ("vivid_light", 0.5),
        ("linear_light", 0.5),
        ("pin_light", 0.5),
    ],
)
def test_each_mode_has_its_neutral_color(mode: Blend, neutral: float) -> None:
    np.testing.assert_allclose(at(mode, COLORS[0], np.full_like(COLORS[0], neutral)), COLORS[0], atol=1e-14)


def test_laws_between_modes() -> None:
    b, s = COLORS
    full: dict[str, Array] = {mode: at(mode, b, s) for mode in MODES}
    np.testing.assert_allclose(full["overlay"], at("hard_light", s, b), atol=1e-14)
    np.testing.assert_allclose(full["screen"], 1 - at("multiply", 1 - b, 1 - s), atol=1e-14)
    np.testing.assert_allclose(full["color_dodge"], 1 - at("color_burn", 1 - b, 1 - s), atol=1e-14)
    np.testing.assert_allclose(full["linear_burn"], 1 - at("linear_dodge", 1 - b, 1 - s), atol=1e-14)
    np.testing.assert_allclose(full["darken"] + full["lighten"], b + s, atol=1e-14)
    np.testing.assert_allclose(full["difference"], full["lighten"] - full["darken"], atol=1e-14)
    for mode in ("multiply", "screen", "difference", "exclusion", "linear_dodge", "linear_burn", "hard_mix"):
        np.testing.assert_allclose(full[mode], at(mode, s, b), atol=1e-14)


def test_a_color_divided_by_itself_is_white_and_subtracted_black() -> None:
    b = np.maximum(COLORS[0], 0.001)
    assert np.all(at("divide", b, b) == 1)
    for mode in ("subtract", "difference"):
        assert np.all(at(mode, b, b) == 0)


def luminosity(c: Array) -> Array:
    return c @ [0.3, 0.59, 0.11]


def test_hue_modes_keep_whose_luminosity_they_should() -> None:
    b, s = COLORS
    for mode in ("hue", "saturation", "color"):
        np.testing.assert_allclose(luminosity(at(mode, b, s)), luminosity(b), atol=1e-12)
    np.testing.assert_allclose(luminosity(at("luminosity", b, s)), luminosity(s), atol=1e-12)
    np.testing.assert_allclose(at("color", b, s), at("luminosity", s, b), atol=1e-14)


@pytest.mark.parametrize("mode", ["hue", "saturation", "color"])
def test_a_gray_source_takes_the_color_away(mode: Blend) -> None:
    b, s = COLORS[0], np.tile(_RNG.random((len(COLORS[0]), 1)), 3)
    expected = np.repeat(luminosity(b)[:, None], 3, axis=1)
    np.testing.assert_allclose(at(mode, b, s), expected, atol=1e-12)


@pytest.mark.parametrize("mode", HUE_MODES)
def test_a_color_over_itself_stays(mode: Blend) -> None:
    np.testing.assert_allclose(at(mode, COLORS[0], COLORS[0]), COLORS[0], atol=1e-12)


@pytest.mark.parametrize("mode", HUE_MODES)
def test_a_single_channel_is_a_gray(mode: Blend) -> None:
    b, s = GRAYS
    np.testing.assert_allclose(at(mode, b, s), s if mode == "luminosity" else b, atol=1e-14)


def test_hue_modes_follow_the_published_steps() -> None:
    """SetLum, ClipColor and SetSat, step by step as W3C writes them."""

    def clip_color(c: Array) -> Array:
        l, n, x = luminosity(c), c.min(), c.max()  # noqa: E741
        c = l + (c - l) * l / (l - n) if n < 0 else c
        return l + (c - l) * (1 - l) / (x - l) if x > 1 else c

    def set_lum(c: Array, l: Array) -> Array:  # noqa: E741
        return clip_color(c + (l - luminosity(c)))

    def set_sat(c: Array, s: float) -> Array:
        least, middle, greatest = np.argsort(c)
        result = np.zeros(3)
        if c[greatest] > c[least]:
            result[middle] = (c[middle] - c[least]) * s / (c[greatest] - c[least])
            result[greatest] = s
        return result

    for b, s in zip(COLORS[0][::20], COLORS[1][::20], strict=True):
        expected = {
            "hue": set_lum(set_sat(s, np.ptp(b)), luminosity(b)),
            "saturation": set_lum(set_sat(b, np.ptp(s)), luminosity(b)),
            "color": set_lum(s, luminosity(b)),
            "luminosity": set_lum(b, luminosity(s)),
        }
        for mode in HUE_MODES:
            np.testing.assert_allclose(at(mode, b, s), expected[mode], atol=1e-12, err_msg=f"{mode} {b} {s}")


def test_coats_of_pigment_add_up_in_any_order() -> None:
    b, s = COLORS
    other = _RNG.random(s.shape)
    half = at("density", at("density", b, s, 0.5), s, 0.5)
    np.testing.assert_allclose(half, at("density", b, s), atol=1e-14)
    one = at("density", at("density", b, s, 0.3), other, 0.8)
    np.testing.assert_allclose(one, at("density", at("density", b, other, 0.8), s, 0.3), atol=1e-14)
    clear = np.ones_like(b)
    np.testing.assert_array_equal(at("density", b, clear, 0.4), b)


def test_display_space_blends_encoded_values() -> None:
    b, s = COLORS
    encoded = at("screen", srgb_encode(b), srgb_encode(s), 0.7)
    np.testing.assert_allclose(apply_in("display", "screen", b, s, np.array(0.7)), srgb_decode(encoded), atol=1e-14)
    np.testing.assert_array_equal(apply_in("linear", "screen", b, s, np.array(0.7)), at("screen", b, s, 0.7))


def test_white_and_black_keep_their_meaning_in_display_space() -> None:
    """The curve's rounding must not turn what is 1 into what is nearly 1."""
    one, zero = np.ones(1), np.zeros(1)
    assert apply_in("display", "color_burn", one, zero, one) == pytest.approx(1)
    assert apply_in("display", "color_dodge", zero, one, one) == pytest.approx(0)


def test_density_has_no_meaning_in_display_space() -> None:
    for mode in MODES:
        check_space(mode, "linear")
    with pytest.raises(ValueError, match="density in display space has no meaning; allowed is linear"):
        check_space("density", "display")


@pytest.mark.parametrize(
    ("space", "expected"),
    [
        ("linear", "blend_divide(albedo, value.rgb, w)"),
        ("display", "srgb_decode(blend_divide(srgb_encode(albedo), srgb_encode(value.rgb), w))"),
    ],
)
def test_expression(space: Space, expected: str) -> None:
    assert expression("divide", space, "albedo", "value.rgb", "w") == expected


def test_height_coverage() -> None:
    own = np.array([-0.3, -0.1, 0.0, 0.05, 0.1, 0.5])
    found = height_coverage(own, np.zeros(6), 0.2)
    assert found == pytest.approx([0, 0, 0.5, 0.84375, 1, 1], abs=1e-15)
    np.testing.assert_allclose(found + height_coverage(np.zeros(6), own, 0.2), 1, atol=1e-15)
    np.testing.assert_allclose(height_coverage(own + 7, np.full(6, 7.0), 0.2), found, atol=1e-12)
    assert np.isfinite(height_coverage(own, np.zeros(6), 0.0)).all()


CURVES = [
    [[0, 0], [1, 1]],
    [[0.2, 0.9], [0.7, 0.1]],
    [[0, 0], [0.25, 0.1], [0.5, 0.5], [0.75, 0.9], [1, 1]],
    [[0, 0], [0.1, 0], [0.11, 1], [0.5, 1], [0.9, 0.2]],
    [[0, 0.3], [0.3, 1], [0.6, 0], [0.62, 0.05], [0.8, 0.6], [0.9, 0.6], [0.95, 0.1], [1, 0.4]],
]


@pytest.mark.parametrize("points", CURVES)
def test_a_curve_meets_its_points_and_never_passes_them(points: list[list[float]]) -> None:
    x, y = np.array(points).T
    np.testing.assert_allclose(remap(points, x), y, atol=1e-14)
    for k, (left, right) in enumerate(pairwise(x)):
        steps = np.diff(remap(points, np.linspace(left, right, 200))) * np.sign(y[k + 1] - y[k])
        assert steps.min() >= -1e-13 if y[k + 1] != y[k] else np.all(steps == 0)


@pytest.mark.parametrize("points", CURVES)
def test_a_curve_is_smooth_inside_and_constant_outside(points: list[list[float]]) -> None:
    x, y = np.array(points).T
    step = 1e-7
    inner = x[1:-1]
    left = (remap(points, inner) - remap(points, inner - step)) / step
    right = (remap(points, inner + step) - remap(points, inner)) / step
    np.testing.assert_allclose(left, slopes(points)[1:-1], atol=0.01)
    np.testing.assert_allclose(right, slopes(points)[1:-1], atol=0.01)
    np.testing.assert_allclose(remap(points, np.array([-1, x[0] - 0.1, x[-1] + 0.1, 2])), [y[0], y[0], y[-1], y[-1]])


def test_points_on_a_line_give_the_line() -> None:
    t = np.linspace(0, 1, 101)
    points = [[0, 0.2], [0.1, 0.26], [0.5, 0.5], [1, 0.8]]
    np.testing.assert_allclose(remap(points, t), 0.2 + 0.6 * t, atol=1e-14)


def test_slopes_by_hand() -> None:
    """Secants 1 and 2: their mean inside, themselves at the ends; and 0.1 and 9, which are drawn into the disk."""
    assert slopes([[0, 0], [0.25, 0.25], [0.5, 0.75]]) == pytest.approx([1, 1.5, 2])
    found = slopes([[0, 0], [0.5, 0.05], [0.6, 0.95]])
    assert np.hypot(*found[:2]) == pytest.approx(0.3)
    assert found[1] / found[0] == pytest.approx(45.5)
    assert found[2] == pytest.approx(9)


class Remapped(BaseModel):
    """As strict as a layer is."""

    model_config = ConfigDict(strict=True)

    curve: Curve


@pytest.mark.parametrize("points", CURVES)
def test_curves_that_are_allowed(points: list[list[float]]) -> None:
    read = Remapped.model_validate({"curve": points})
    assert read.curve == tuple(tuple(map(float, point)) for point in points)
    assert Remapped.model_validate(read.model_dump(mode="json")) == read


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([[0, 0]], "at least 2"),
        ([[i / 8, 0] for i in range(9)], "at most 8"),
        ([[0, 0], [0.5, 0.5], [0.4, 1]], "goes from 0.5 to 0.4; .* rise by at least 0.01"),
        ([[0, 0], [0, 1]], "goes from 0 to 0"),
        ([[0, 0], [1, 1.5]], "less than or equal to 1"),
        ([[0, 0], [1]], "at least 2"),
        ([[0, 0, 0], [1, 1]], "at most 2"),
    ],
)
def test_curves_that_are_refused(points: Any, message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        Remapped.model_validate({"curve": points})


def test_written_decimals_may_lie_at_the_least_distance() -> None:
    Remapped.model_validate({"curve": [[0.29, 0], [0.3, 1]]})


def test_members_of_a_curve_fill_up_with_its_last_point() -> None:
    found = members([[0, 0.25], [0.5, 0.75], [1, 1]])
    assert list(found) == [str(i) for i in range(MAX_POINTS)]
    assert found["0"] == pytest.approx((0, 0.25, 1, 2))
    assert found["2"] == pytest.approx((1, 1, 0.5, 0))
    assert all(found[str(i)] == found["2"] for i in range(3, MAX_POINTS))
    assert call("p.curve", "value.w").startswith("remap_curve(value.w, p.curve_0, p.curve_1, ")
