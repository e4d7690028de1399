"""Blend modes: how a layer's value joins what lies below it.

`MODES` is the one table: names, formulas, clamping, color spaces and float64 twins. The GLSL is `blend_NAME` in
shaders/lib/blend.glsl. The names are those of Photoshop; formulas follow [W3C2024, "Compositing and Blending Level 1",
section 10] and, for the modes it lacks, the descriptions of blending modes in Adobe's Photoshop User Guide. `density`
and `height_blend` are made for skin.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from skincli.color import srgb_decode, srgb_encode

Array = NDArray[np.float64]

#: Names of `MODES`, spelled out so that types are checked and the schema lists them.
Blend = Literal[
    "normal",
    "darken",
    "multiply",
    "color_burn",
    "linear_burn",
    "lighten",
    "screen",
    "color_dodge",
    "linear_dodge",
    "overlay",
    "soft_light",
    "hard_light",
    "vivid_light",
    "linear_light",
    "pin_light",
    "hard_mix",
    "difference",
    "exclusion",
    "subtract",
    "divide",
    "hue",
    "saturation",
    "color",
    "luminosity",
    "density",
    "height_blend",
]

#: What is blended: linear light, as it is stored, or sRGB-encoded values, as picture editors do.
Space = Literal["linear", "display"]

#: Least divisor of dodge, burn, divide and of the hue modes, and least transmission of `density`. It decides what
#: 0 / 0 is, and departs from the formulas only where a number is within it of 0 or 1.
GUARD = 1e-6

#: Weights of luminosity in the hue modes [W3C2024, section 10.2]; not those of relative luminance.
_LUMINOSITY = np.array([0.3, 0.59, 0.11])


@dataclass(frozen=True)
class Mode:
    """One blend mode of a backdrop b and a source s, both 0 to 1, applied with a weight w, 0 to 1.

    Parameters
    ----------
    name : name in YAML and, after `blend_`, in GLSL
    formula : the result where w is 1, as plain mathematics
    twin : (b, s) -> the same in float64, of (..., components) arrays; for a mode that is not separable the components
        are three, or one, which is a gray
    clamps : what is cut to 0 to 1 and what a quotient 0 / 0 is; empty where b and s in 0 to 1 give no other results
    separable : whether each channel is blended by itself
    weighs : what w does: "mix" mixes result and backdrop; "thickness" is the source's share of its full thickness,
        the exponent of its transmission
    spaces : the spaces in which a layer may blend; the first is taken where it does not choose
    """

    name: Blend
    formula: str
    twin: Callable[[Array, Array], Array]
    clamps: str = ""
    separable: bool = True
    weighs: Literal["mix", "thickness"] = "mix"
    spaces: tuple[Space, ...] = ("linear", "display")

    def apply(self, b: Array, s: Array, w: Array) -> Array:
        """Return b with s laid over it at weight w; arrays (..., components) that broadcast, 0 to 1."""
        if self.weighs == "thickness":
            return self.twin(b, np.maximum(s, GUARD) ** w)
        return (1 - w) * b + w * self.twin(b, s)


def _screen(b: Array, s: Array) -> Array:
    return b + s * (1 - b)


def _color_burn(b: Array, s: Array) -> Array:
    return 1 - (1 - b) / np.maximum(np.maximum(s, 1 - b), GUARD)


def _color_dodge(b: Array, s: Array) -> Array:
    return b / np.maximum(np.maximum(1 - s, b), GUARD)


def _hard_light(b: Array, s: Array) -> Array:
    return np.where(s <= 0.5, 2 * b * s, _screen(b, 2 * s - 1))


def _soft_light(b: Array, s: Array) -> Array:
    lighter = np.where(b <= 0.25, ((16 * b - 12) * b + 4) * b, np.sqrt(np.maximum(b, 0)))
    return np.where(s <= 0.5, b - (1 - 2 * s) * b * (1 - b), b + (2 * s - 1) * (lighter - b))


def _vivid_light(b: Array, s: Array) -> Array:
    return np.where(s <= 0.5, _color_burn(b, 2 * s), _color_dodge(b, 2 * s - 1))


def _pin_light(b: Array, s: Array) -> Array:
    return np.where(s <= 0.5, np.minimum(b, 2 * s), np.maximum(b, 2 * s - 1))


def _hard_mix(b: Array, s: Array) -> Array:
    # Not b + s >= 1: a float32 sum rounds, the difference of 1 and the larger number does not.
    return np.where(np.minimum(b, s) >= 1 - np.maximum(b, s), 1.0, 0.0)


def _luminosity(c: Array) -> Array:
    return np.sum(c * _LUMINOSITY, axis=-1, keepdims=True)


def _spread(c: Array) -> Array:
    return np.ptp(c, axis=-1, keepdims=True)


def _with_luminosity(c: Array, luminosity: Array) -> Array:
    """Shift c to a luminosity, then draw it towards gray until it fits into 0 to 1: SetLum and ClipColor."""
    away = c - _luminosity(c)
    below, above = -away.min(axis=-1, keepdims=True), away.max(axis=-1, keepdims=True)
    room = np.minimum(luminosity / np.maximum(below, GUARD), (1 - luminosity) / np.maximum(above, GUARD))
    return np.clip(luminosity + away * np.minimum(room, 1), 0, 1)


def _with_saturation(c: Array, saturation: Array) -> Array:
    """Stretch c so that its least channel is 0 and its greatest the saturation, a gray to 0: SetSat."""
    return (c - c.min(axis=-1, keepdims=True)) * saturation / np.maximum(_spread(c), GUARD)


def _of_colors(twin: Callable[[Array, Array], Array]) -> Callable[[Array, Array], Array]:
    """Return the twin of a mode that is not separable, for colors and for single channels, which it takes for grays."""

    def of_colors_or_grays(b: Array, s: Array) -> Array:
        shape = np.broadcast_shapes(b.shape, s.shape)
        colors = (*shape[:-1], 3)
        return twin(np.broadcast_to(b, colors), np.broadcast_to(s, colors))[..., : shape[-1]]

    return of_colors_or_grays


def _table(*modes: Mode) -> dict[Blend, Mode]:
    return {mode.name: mode for mode in modes}


#: Every blend mode by its name.
MODES = _table(
    Mode("normal", "s", lambda b, s: s + 0 * b),
    Mode("darken", "min(b, s)", np.minimum),
    Mode("multiply", "b s", lambda b, s: b * s),
    Mode(
        "color_burn",
        "1 - (1 - b) / s",
        _color_burn,
        clamps="below at 0; 1 where b is 1, even if s is 0",
    ),
    Mode("linear_burn", "b + s - 1", lambda b, s: np.maximum(b + s - 1, 0), clamps="below at 0"),
    Mode("lighten", "max(b, s)", np.maximum),
    Mode("screen", "1 - (1 - b) (1 - s)", _screen),
    Mode("color_dodge", "b / (1 - s)", _color_dodge, clamps="above at 1; 0 where b is 0, even if s is 1"),
    Mode("linear_dodge", "b + s", lambda b, s: np.minimum(b + s, 1), clamps="above at 1"),
    Mode("overlay", "hard_light with b and s exchanged", lambda b, s: _hard_light(s, b)),
    Mode(
        "soft_light",
        "b - (1 - 2 s) b (1 - b) if s <= 1/2, else b + (2 s - 1) (d - b), "
        "with d = ((16 b - 12) b + 4) b if b <= 1/4, else sqrt(b)",
        _soft_light,
    ),
    Mode("hard_light", "2 b s if s <= 1/2, else 1 - 2 (1 - b) (1 - s)", _hard_light),
    Mode(
        "vivid_light",
        "color_burn of b and 2 s if s <= 1/2, else color_dodge of b and 2 s - 1",
        _vivid_light,
        clamps="as color_burn and color_dodge",
    ),
    Mode("linear_light", "b + 2 s - 1", lambda b, s: np.clip(b + (2 * s - 1), 0, 1), clamps="to 0 to 1"),
    Mode("pin_light", "min(b, 2 s) if s <= 1/2, else max(b, 2 s - 1)", _pin_light),
    Mode("hard_mix", "1 if b + s >= 1, else 0", _hard_mix),
    Mode("difference", "|b - s|", lambda b, s: np.abs(b - s)),
    Mode("exclusion", "b + s - 2 b s", lambda b, s: b + s * (1 - 2 * b)),
    Mode("subtract", "b - s", lambda b, s: np.maximum(b - s, 0), clamps="below at 0"),
    Mode(
        "divide",
        "b / s",
        lambda b, s: b / np.maximum(np.maximum(s, b), GUARD),
        clamps="above at 1; 0 where b is 0, even if s is 0",
    ),
    Mode(
        "hue",
        "hue of s; saturation and luminosity of b; on a single channel b",
        _of_colors(lambda b, s: _with_luminosity(_with_saturation(s, _spread(b)), _luminosity(b))),
        clamps="towards gray until all channels lie in 0 to 1; the hue of a gray is gray",
        separable=False,
    ),
    Mode(
        "saturation",
        "saturation of s; hue and luminosity of b; on a single channel b",
        _of_colors(lambda b, s: _with_luminosity(_with_saturation(b, _spread(s)), _luminosity(b))),
        clamps="as hue",
        separable=False,
    ),
    Mode(
        "color",
        "hue and saturation of s; luminosity of b; on a single channel b",
        _of_colors(lambda b, s: _with_luminosity(s, _luminosity(b))),
        clamps="as hue",
        separable=False,
    ),
    Mode(
        "luminosity",
        "luminosity of s; hue and saturation of b; on a single channel s",
        _of_colors(lambda b, s: _with_luminosity(b, _luminosity(s))),
        clamps="as hue",
        separable=False,
    ),
    Mode(
        "density",
        "b s^w, the law of Beer and Lambert: s is the transmission of a coat of full thickness, w the thickness",
        lambda b, s: b * s,
        clamps="s from below at 1e-6",
        weighs="thickness",
        spaces=("linear",),
    ),
    # The stack multiplies the weight by `height_coverage`; what is left of the mode is normal.
    Mode("height_blend", "s where its height stands above what lies below, else b", lambda b, s: s + 0 * b),
)


def check_space(mode: Blend, space: Space) -> None:
    """Raise ValueError if a mode has no meaning in a space."""
    allowed = MODES[mode].spaces
    if space not in allowed:
        raise ValueError(
            f"blend {mode} in {space} space has no meaning; allowed is {' or '.join(allowed)}; "
            f"write space: {allowed[0]} or choose another blend"
        )


def apply_in(space: Space, mode: Blend, b: Array, s: Array, w: Array) -> Array:
    """Return b with s laid over it: the twin of `expression`.

    Parameters
    ----------
    space : what is blended and mixed; "display" encodes b and s with the sRGB curve and decodes the result
    mode : a key of `MODES`
    b, s : (..., components) linear, 0 to 1
    w : weight, 0 to 1, broadcast against them

    Returns
    -------
    (..., components) linear, 0 to 1
    """
    if space == "linear":
        return MODES[mode].apply(b, s, w)
    return srgb_decode(MODES[mode].apply(srgb_encode(b), srgb_encode(s), w))


def expression(mode: Blend, space: Space, b: str, s: str, w: str) -> str:
    """Return the GLSL expression for b with s laid over it; needs `lib/blend.glsl`.

    Parameters
    ----------
    mode, space : as for `apply_in`
    b, s : expressions of equal type, float or vec3, 0 to 1
    w : expression of type float, 0 to 1
    """
    if space == "linear":
        return f"blend_{mode}({b}, {s}, {w})"
    return f"srgb_decode(blend_{mode}(srgb_encode({b}), srgb_encode({s}), {w}))"


def height_coverage(own: Array, below: Array, contrast: Array | float) -> Array:
    """Return how much a layer of mode `height_blend` covers: the factor, 0 to 1, of its weight.

    Parameters
    ----------
    own : height of the layer's own relief, mm
    below : height of what lies below, mm
    contrast : difference of height over which one gives way to the other, mm; at equal heights each has one half

    Returns
    -------
    smooth in both heights: 0 where `own` lies contrast / 2 under `below`, 1 where it lies as much above
    """
    t = np.clip((own - below) / np.maximum(contrast, GUARD) + 0.5, 0, 1)
    return t * t * (3 - 2 * t)
