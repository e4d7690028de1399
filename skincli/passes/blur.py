"""Separable Gaussian blur: the diffusion of the seed paper, and the smoothing of its occlusion bands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skincli.errors import LimitError
from skincli.gpu.blocks import Taps, Values
from skincli.graph.node import ONE, Draw, Input, Output, Pass, Ref, Source

NO_DIVISION, BY_ALPHA, BY_COVERAGE = range(3)

MAX_RADIUS = 511

#: standard deviations between the middle and the end of a window that is given by its width
WINDOW_SIGMAS = 2.0

#: standard deviations kept on each side of a Gaussian that is given by its width in mm: 0.13 % at an edge
KEPT_SIGMAS = 3.0

#: taps of a blur that changes nothing
IDENTITY: tuple[tuple[float, ...], ...] = ((1.0, 1.0, 1.0, 1.0),)

#: below this share of blurred coverage an average is rounding noise
LEAST_COVERAGE = 1e-4


@dataclass(frozen=True)
class BlurValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    step_x, step_y : direction in texels
    radius : taps on each side
    division : NO_DIVISION, BY_ALPHA or BY_COVERAGE
    coverage_only : 1 blurs 1 where the image's alpha is above 0
    slot : only texels of this skin are written; 0 writes all
    empty : value where no coverage is known
    least_coverage : share of coverage below which nothing is known
    taps : weight of the middle and of each pair, per channel
    """

    step_x: int
    step_y: int
    radius: int
    division: int
    coverage_only: int
    slot: int
    empty: float
    least_coverage: float
    taps: Taps


class Blur(Pass):
    """One direction of the blur."""

    shader = "passes/blur.frag"
    inputs = {"image": Input("bordered"), "coverage": Input(), "owner": Input()}
    outputs = {"blurred": Output()}

    def shortcut(self, output: str) -> tuple[Source, str] | None:
        """A kernel of one tap returns its image."""
        values = [draw.values for draw in self.draws]
        if all(v.radius == 0 and v.coverage_only == 0 for v in values):  # type: ignore[attr-defined]
            return self.source(self.draws[0], "image"), "the blur is off, or its window holds one texel"
        return None

    def needed_inputs(self, output: str) -> Sequence[str]:
        """The coverage is read only where it divides, the owner only where it decides what is written."""
        values = [draw.values for draw in self.draws]
        divides = any(v.division == BY_COVERAGE for v in values)  # type: ignore[attr-defined]
        owned = any(v.slot > 0 or v.division == BY_ALPHA for v in values)  # type: ignore[attr-defined]
        return ("image", *(("coverage",) if divides else ()), *(("owner",) if owned else ()))


def window_taps(width: float) -> tuple[tuple[float, ...], ...]:
    """Return the taps of the paper's window.

    Parameters
    ----------
    width : texels, 0 and more; an even width gets half weights at both ends, so that nothing shifts

    Returns
    -------
    (radius + 1, 4) weight of the middle and of each pair; the whole kernel sums to 1
    """
    half = width / 2
    radius = int(np.ceil(half - 0.5)) if half > 0.5 else 0
    offsets = np.arange(radius + 1)
    weights = np.exp(-0.5 * (offsets * WINDOW_SIGMAS / max(half, 0.5)) ** 2)
    # The share of the last texel that lies inside the window: 1 for odd widths, a half for even ones.
    weights[radius] *= min(1.0, half + 0.5 - radius) if radius else 1.0
    return _normalized(np.repeat(weights[:, None], 4, axis=1))


def gaussian_taps(sigma: Sequence[float]) -> tuple[tuple[float, ...], ...]:
    """Return the taps of a Gaussian of a width per channel.

    Parameters
    ----------
    sigma : (3,) texels, standard deviation for R, G, B; the alpha channel takes the widest

    Returns
    -------
    (radius + 1, 4) as window_taps; the radius is KEPT_SIGMAS of the widest channel
    """
    widths = np.array([*sigma, max(sigma)], float)
    # A Gaussian below a tenth of a texel moves nothing that float32 can hold.
    radius = int(np.ceil(KEPT_SIGMAS * widths.max())) if widths.max() > 0.1 else 0
    if radius > MAX_RADIUS:
        raise LimitError(
            f"the scattering radius spans {radius} texels of the atlas; at most {MAX_RADIUS} are allowed; "
            "choose a smaller render.atlas or optics.radius"
        )
    offsets = np.arange(radius + 1)[:, None]
    return _normalized(np.exp(-0.5 * (offsets / np.maximum(widths, 1e-3)) ** 2))


def _normalized(weights: NDArray[np.float64]) -> tuple[tuple[float, ...], ...]:
    weights = weights / (weights[0] + 2 * weights[1:].sum(axis=0))
    return tuple(tuple(float(x) for x in row) for row in weights)


def separable(
    name: str,
    size: tuple[int, int],
    image: Source,
    kernels: Sequence[tuple[tuple[float, ...], ...]],
    *,
    division: int = NO_DIVISION,
    coverage_only: bool = False,
    coverage: Source = ONE,
    owner: Source = ONE,
    empty: float = 0.0,
) -> list[Blur]:
    """Return the two nodes NAME_rows and NAME (columns) of a separable blur.

    Parameters
    ----------
    kernels : taps, one set for all texels or one per slot of the owner
    owner : w is the slot of the skin that owns a texel, 0 where there is none
    division, coverage, empty : see BlurValues; the division happens once, after the second direction
    """

    def draws(step: tuple[int, int], last: bool, only: bool) -> list[Draw]:
        return [
            Draw(
                BlurValues(
                    *step,
                    len(taps) - 1,
                    division if last else NO_DIVISION,
                    int(only),
                    # The first kernel also fills the texels that belong to nobody.
                    slot if slot > 1 else 0,
                    empty,
                    LEAST_COVERAGE,
                    taps,
                )
            )
            for slot, taps in enumerate(kernels, start=1)
            if slot == 1 or taps != kernels[0]
        ]

    rows = Blur(f"{name}_rows", size, draws((1, 0), False, coverage_only), {"image": image, "owner": owner})
    columns = Blur(
        name,
        size,
        draws((0, 1), True, False),
        {"image": Ref(rows.name, "blurred"), "coverage": coverage, "owner": owner},
    )
    return [rows, columns]


def twin(
    values: BlurValues, image: NDArray[np.float64], coverage: NDArray[np.float64], owner: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return one direction of the blur.

    Parameters
    ----------
    image : (h, w, 4), top row first
    coverage, owner : (h, w, 4) or (1, 1, 4), read where values.division asks for them

    Returns
    -------
    (h, w, 4)
    """
    source = np.repeat((image[..., 3:] > 0).astype(float), 4, axis=-1) if values.coverage_only else image
    taps = np.array(values.taps, float)
    radius, axis = values.radius, 1 if values.step_x else 0
    padding = [(0, 0)] * 3
    padding[axis] = (radius, radius)
    padded = np.pad(source, padding)
    length = source.shape[axis]
    total = np.zeros_like(source)
    for k in range(-radius, radius + 1):
        total += taps[abs(k)] * np.take(padded, np.arange(radius + k, radius + k + length), axis=axis)
    if values.division == NO_DIVISION:
        return total
    share = total[..., 3:] if values.division == BY_ALPHA else coverage[..., :3]
    known = share.min(axis=-1, keepdims=True) > values.least_coverage
    if values.division == BY_ALPHA:
        known &= owner[..., 3:] > 0
    divided = np.concatenate([total[..., :3] / np.where(known, share, 1), np.ones((*total.shape[:2], 1))], axis=-1)
    nothing = np.array([values.empty] * 3 + [0.0])
    return np.where(known, divided, nothing)
