"""Reaction and diffusion: spots, stripes, labyrinths and nets, as on the coats of animals."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from skincli import diskcache
from skincli.layers import hashing, remap
from skincli.layers.base import (
    LEVELS_FIELD,
    Array,
    Ground,
    Pattern,
    Site,
    Texture,
    UnitRamp,
    Value,
    joint_seed,
)

Name = Literal["spots", "stripes", "labyrinth", "net"]

#: Wavelengths along a tile, and the most of them where the tile must fit a period.
WAVES = 16
MAX_WAVES = 20
#: Samples along a tile while it is simulated: 6 per wavelength hold the third harmonic, and higher ones are faint.
GRID = 128
#: Samples along a tile as it is laid.
SIDE = 512
#: Half of the least width of the step between `levels`, in values of the raw pattern: about a tenth of a wavelength,
#: as sharp as SIDE samples can draw without ringing.
SHARPEST = 0.12
#: Square root of the ratio of the diffusion constants, activator to inhibitor. Below 1 by so much that patterns grow
#: fast, and near enough to it that waves of about one length grow alone.
RATIO = 0.4
#: Rate at which the inhibitor decays, against that at which the activator makes it.
DECAY = 0.5
#: Activator of the uniform state. Off 0 the pattern prefers islands: of high values below 0, of low ones above.
REST = {"spots": -0.27, "stripes": 0.0, "labyrinth": 0.0, "net": 0.27}
#: Activator that becomes 0 and 1 of the raw pattern. The net's lines are drawn thinner than its holes would leave them.
ENDS = {"spots": (-0.65, 0.65), "stripes": (-0.65, 0.65), "labyrinth": (-0.65, 0.65), "net": (-0.25, 0.65)}
#: By how much faster the activator diffuses along stripes than across.
ANISOTROPY = 0.3
#: Time after which the pattern stands still but for the slow healing of its irregularities, which are wanted.
DURATION = 200.0
TIME_STEP = 0.4


def simulate(pattern: Name, waves: int, seed: int) -> Array:
    """Return the activator of a reaction-diffusion system on a periodic square, some time after a random start.

    Activator u and inhibitor v with FitzHugh-Nagumo kinetics; v follows u at once:

        du/dt = u - u^3 - v + c + Du laplace u,    0 = u - DECAY v + Dv laplace v

    Waves of one length grow fastest [Turing1952]; Du and Dv are such that `waves` of these fit the square. Stripes
    take the direction in which the activator diffuses faster [Shoji2002]. Linear terms are integrated implicitly, by
    the Fourier transform. Another machine may round transforms otherwise, which can move single features: equal
    everywhere are the statistics, not the samples.

    Parameters
    ----------
    pattern : key of REST
    waves : wavelengths along the square
    seed : of the random start

    Returns
    -------
    (GRID, GRID) u, about -0.65 to 0.65; stripes follow one another along the first axis

    References
    ----------
    [Turing1952], [FitzHugh1961], [Shoji2002, anisotropic diffusion of the activator]
    """
    # The uniform state is least stable at wavenumber 1 where these two derivatives of the growth cancel.
    inhibitor = 1 / RATIO - DECAY
    activator = RATIO**2 * inhibitor
    along, across = (k / waves for k in _wavenumbers(GRID))
    squared = along**2 + across**2
    drift = ANISOTROPY * along**2 if pattern == "stripes" else 0.0
    growth = 1 - activator * (squared + drift) - 1 / (DECAY + inhibitor * squared)
    implicit = 1 / (1 - TIME_STEP * growth)

    rest = REST[pattern]
    source = rest**3 - rest + rest / DECAY
    rows, columns = np.mgrid[0:GRID, 0:GRID]
    noise = hashing.hash_cell(np.stack([columns, rows, 0 * rows], axis=-1), seed)[..., 0] - 0.5
    state = np.fft.rfft2(rest + 0.2 * noise)
    for _ in range(round(DURATION / TIME_STEP)):
        u = np.fft.irfft2(state, s=(GRID, GRID))
        state = implicit * (state + TIME_STEP * np.fft.rfft2(source - u * u * u))
    return np.fft.irfft2(state, s=(GRID, GRID))


def _wavenumbers(side: int) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return waves per square of rfft2's spectrum: along a row, (1, side // 2 + 1), and along a column, (side, 1)."""
    return np.fft.rfftfreq(side, 1 / side)[None], np.fft.fftfreq(side, 1 / side)[:, None]


@lru_cache(maxsize=16)
def _activator(pattern: Name, waves: int, seed: int) -> Array:
    """Return what `simulate` does, kept on disk."""
    # The source is part of the key: another method makes another entry.
    digest = hashlib.blake2b(Path(__file__).read_bytes(), digest_size=16).hexdigest()
    key = f"{digest} {pattern} {waves} {seed}"
    return diskcache.arrays("pattern", key, lambda: {"activator": simulate(pattern, waves, seed)})["activator"]


def _resample(field: Array, side: int) -> Array:
    """Return a periodic (n, n) field with side > n samples along its axes: the same sum of waves."""
    half = len(field) // 2
    spectrum = np.fft.rfft2(field)
    wider = np.zeros((side, side // 2 + 1), complex)
    wider[:half, :half] = spectrum[:half, :half]
    wider[1 - half :, :half] = spectrum[1 - half :, :half]
    return np.fft.irfft2(wider, s=(side, side)) * (side / len(field)) ** 2


def integrals(field: Array) -> NDArray[np.float32]:
    """Return periodic integrals of a field, from which its mean over any rectangle follows.

    With g the field without its mean, whose waves along both axes are z, and along one axis only r(x) + c(y):

    Parameters
    ----------
    field : (n, n) samples along y and x of a square that repeats

    Returns
    -------
    (n, n, 4) : the integral of z over x and y; that of r over x plus that of c over y; the mean of the field; 0.
        The first two are coefficients of quadratic B-splines, lengths in samples. Integrals are taken of the waves
        that pass through the samples, so that they repeat, unlike the sums of [Crow1984]

    References
    ----------
    [Crow1984, "Summed-Area Tables for Texture Mapping"], [Unser1999, interpolation by B-splines]
    """
    side = len(field)
    spectrum = np.fft.rfft2(field)
    # A wave of the shortest length has no phase that its samples tell, hence no integral.
    spectrum[side // 2] = 0
    spectrum[:, side // 2] = 0
    along, across = (2 * math.pi / side * k for k in _wavenumbers(side))
    over_x, over_y = (np.divide(-1j, k, out=np.zeros(k.shape, complex), where=k != 0) for k in (along, across))
    spline = [(3 + np.cos(k)) / 4 for k in (along, across)]
    both = spectrum * over_x * over_y
    single = spectrum * (over_x * (across == 0) + over_y * (along == 0))
    pixels = np.zeros((side, side, 4), np.float32)
    for channel, waves in enumerate((both, single)):
        pixels[..., channel] = np.fft.irfft2(waves / (spline[0] * spline[1]), s=(side, side))
    pixels[..., 2] = np.mean(field)
    return pixels


@dataclass(frozen=True)
class Tile(Texture):
    """A periodic tile of a pattern, as integrals.

    Parameters
    ----------
    pattern : its name
    waves : wavelengths along its side
    seed : of the random start
    levels : values of the raw pattern that become 0 and 1
    curve : what remaps it then
    """

    format: ClassVar[str] = "rgba32f"

    pattern: Name
    waves: int
    seed: int
    levels: tuple[float, ...]
    curve: remap.Points | None = None

    @property
    def key(self) -> str:
        return f"reaction_diffusion {self.pattern} {self.waves} {self.seed} {self.levels} {self.curve}"

    def field(self) -> Array:
        """Return (SIDE, SIDE) the pattern itself, 0 to 1, y upwards."""
        low, high = ENDS[self.pattern]
        activator = _resample(_activator(self.pattern, self.waves, self.seed), SIDE)
        field = hashing.levels((activator - low) / (high - low), self.levels, SHARPEST)
        if self.curve is None:
            return field
        # Averaged over neighboring values, for the same reason for which the step of the levels is never sharper.
        return np.mean([remap.remap(self.curve, field + SHARPEST * step) for step in np.linspace(-1, 1, 9)], axis=0)

    def make(self) -> NDArray[np.float32]:
        return integrals(self.field())[::-1]


class Axis(IntEnum):
    """Axis of the mesh."""

    X = 0
    Y = 1
    Z = 2


#: Which coordinates take the place of x, y and z, so that the axis becomes y; as the swizzles of the shader.
TURN = {Axis.X: [2, 0, 1], Axis.Y: [0, 1, 2], Axis.Z: [1, 2, 0]}
#: Plane seen along each axis -> its horizontal and vertical coordinate.
PLANES = ([2, 1], [0, 2], [0, 1])
#: A plane takes part where the square of the normal along its axis is larger; below 1/3, so that one always does.
LEAST_FACING = 0.27


class ReactionDiffusion(Pattern):
    """Patterns that two diffusing substances form [Turing1952], on a tile laid along the three axes."""

    scale: float = Field(
        default=5.0,
        ge=0.01,
        le=10000,
        description="mean distance between stripes or rows of spots, mm; where the map is tileable up to 5 % off, so "
        "that a whole number fits",
    )
    pattern: Name = Field(
        default="spots",
        description="spots: 1 in round spots on 0; net: 0 in round holes in 1; stripes: parallel, with forks; "
        "labyrinth: winding, without a direction",
    )
    axis: Literal["x", "y", "z"] = Field(default="y", description="axis along which stripes follow one another")
    levels: UnitRamp = LEVELS_FIELD

    def size(self) -> float:
        return self.scale

    def _waves(self, ground: Ground) -> tuple[int, float]:
        """Return wavelengths along a tile and the tile's side, mm."""
        if ground.period is None:
            return WAVES, WAVES * self.scale
        tiles = math.ceil(ground.period / (MAX_WAVES * self.scale))
        return max(1, round(ground.period / (tiles * self.scale))), ground.period / tiles

    def values(self, ground: Ground) -> dict[str, Value]:
        return {
            "axis": Axis[self.axis.upper()],
            "side": self._waves(ground)[1],
            "seed": joint_seed(ground.seed, self.seed),
        }

    def textures(self, ground: Ground) -> tuple[Tile]:
        waves, _ = self._waves(ground)
        return (Tile(True, self.pattern, waves, joint_seed(ground.seed, self.seed), self.levels, self.curve),)

    def curve_is_in_texture(self) -> bool:
        return True

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        tile = textures[0][::-1]
        side, turn = len(tile), TURN[values["axis"]]
        x = site["position"][:, turn] * (side / values["side"])
        width = np.hypot(site["footprint"] * (side / values["side"]), 2)
        facing = np.maximum(site["normal"][:, turn] ** 2 - LEAST_FACING, 0) ** 2
        total = np.zeros(len(x))
        for plane, axes in enumerate(PLANES):
            shift = np.floor(side * hashing.hash_cell(np.array([[plane, 0, 0]]), values["seed"])[0, :2])
            total += facing[:, plane] * _departure(tile, x[:, axes] + shift, width)
        strength = np.sqrt(np.sum(facing**2, axis=1))
        return np.clip(tile[0, 0, 2] + total / np.maximum(strength, 1e-6), 0, 1)


def _departure(tile: Array, x: Array, width: Array) -> Array:
    """Twin of `reaction_diffusion_departure`: (n,) mean over squares about x, (n, 2), less that of the whole tile."""
    half = 0.5 * width[:, None]
    corner = [[_integrals_at(tile, x + half * [i, j]) for i in (-1, 1)] for j in (-1, 1)]
    both = corner[1][1] - corner[1][0] - corner[0][1] + corner[0][0]
    single = corner[1][1] - corner[0][0]
    return (both[:, 0] / width + single[:, 1]) / width


def _integrals_at(tile: Array, x: Array) -> Array:
    """Twin of `reaction_diffusion_integrals`: (n, 2) at x, (n, 2)."""
    cell, fraction = hashing.split(x + 0.5)
    fraction = fraction - 0.5
    weights = np.stack([0.5 * (0.5 - fraction) ** 2, 0.75 - fraction**2, 0.5 * (0.5 + fraction) ** 2])
    total = np.zeros(x.shape)
    for row in range(3):
        for column in range(3):
            texel = tile[(cell[:, 1] + row - 1) % len(tile), (cell[:, 0] + column - 1) % len(tile), :2]
            total += (weights[row, :, 1] * weights[column, :, 0])[:, None] * texel
    return total
