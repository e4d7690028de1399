"""Separable Gaussian blur: the diffusion of the seed paper, and the smoothing of its occlusion bands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skincli.gpu.blocks import Taps, Values
from skincli.graph.node import ONE, Draw, Input, Output, Pass, Ref, Source

NO_DIVISION, BY_ALPHA = range(2)

#: standard deviations between the middle and the end of a window that is given by its width
WINDOW_SIGMAS = 2.0

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
    division : NO_DIVISION or BY_ALPHA
    slot : only texels of this skin are written; 0 writes all
    empty : value where no coverage is known
    least_coverage : share of coverage below which nothing is known
    taps : weight of the middle and of each pair, per channel
    """

    step_x: int
    step_y: int
    radius: int
    division: int
    slot: int
    empty: float
    least_coverage: float
    taps: Taps


class Blur(Pass):
    """One direction of the blur."""

    shader = "passes/blur.frag"
    inputs = {"image": Input("bordered"), "owner": Input()}
    outputs = {"blurred": Output()}

    def shortcut(self, output: str) -> tuple[Source, str] | None:
        """A kernel of one tap returns its image."""
        values = [draw.values for draw in self.draws]
        if all(v.radius == 0 for v in values):  # type: ignore[attr-defined]
            return self.source(self.draws[0], "image"), "the blur is off, or its window holds one texel"
        return None

    def needed_inputs(self, output: str) -> Sequence[str]:
        """The owner is read only where it decides what is written."""
        values = [draw.values for draw in self.draws]
        owned = any(v.slot > 0 or v.division == BY_ALPHA for v in values)  # type: ignore[attr-defined]
        return ("image", *(("owner",) if owned else ()))


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
    owner: Source = ONE,
    empty: float = 0.0,
) -> list[Blur]:
    """Return the two nodes NAME_rows and NAME (columns) of a separable blur.

    Parameters
    ----------
    kernels : taps, one set for all texels or one per slot of the owner
    owner : w is the slot of the skin that owns a texel, 0 where there is none
    division, empty : see BlurValues; the division happens once, after the second direction
    """

    def draws(step: tuple[int, int], last: bool) -> list[Draw]:
        return [
            Draw(
                BlurValues(
                    *step,
                    len(taps) - 1,
                    division if last else NO_DIVISION,
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

    rows = Blur(f"{name}_rows", size, draws((1, 0), False), {"image": image, "owner": owner})
    columns = Blur(
        name,
        size,
        draws((0, 1), True),
        {"image": Ref(rows.name, "blurred"), "owner": owner},
    )
    return [rows, columns]


def twin(values: BlurValues, image: NDArray[np.float64], owner: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return one direction of the blur.

    Parameters
    ----------
    image : (h, w, 4), top row first
    owner : (h, w, 4) or (1, 1, 4), read where values.division asks for it

    Returns
    -------
    (h, w, 4)
    """
    taps = np.array(values.taps, float)
    radius, axis = values.radius, 1 if values.step_x else 0
    padding = [(0, 0)] * 3
    padding[axis] = (radius, radius)
    padded = np.pad(image, padding)
    length = image.shape[axis]
    total = np.zeros_like(image)
    for k in range(-radius, radius + 1):
        total += taps[abs(k)] * np.take(padded, np.arange(radius + k, radius + k + length), axis=axis)
    if values.division == NO_DIVISION:
        return total
    share = total[..., 3:]
    known = (share > values.least_coverage) & (owner[..., 3:] > 0)
    divided = np.concatenate([total[..., :3] / np.where(known, share, 1), np.ones((*total.shape[:2], 1))], axis=-1)
    nothing = np.array([values.empty] * 3 + [0.0])
    return np.where(known, divided, nothing)
