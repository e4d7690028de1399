"""Color science in float64 NumPy: the sRGB curve, CIE spaces, color difference and the display transform."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

REC709_LUMA: Array = np.array([0.2126, 0.7152, 0.0722])
"""Weights of relative luminance of linear Rec.709, as ITU-R BT.709 rounds them."""


def srgb_encode(linear: ArrayLike) -> Array:
    """Encode linear values with the exact piecewise sRGB curve.

    Parameters
    ----------
    linear : any shape; 0 and 1 map to themselves, values outside [0, 1] continue the two pieces

    Returns
    -------
    Array
        Encoded values, same shape. Source: IEC 61966-2-1.
    """
    x = np.asarray(linear, dtype=np.float64)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0.0031308) ** (1 / 2.4) - 0.055)


def srgb_decode(encoded: ArrayLike) -> Array:
    """Decode sRGB-encoded values to linear ones; the inverse of `srgb_encode` (IEC 61966-2-1)."""
    v = np.asarray(encoded, dtype=np.float64)
    return np.where(v <= 0.04045, v / 12.92, ((np.maximum(v, 0.04045) + 0.055) / 1.055) ** 2.4)


def luminance(rgb: ArrayLike) -> Array:
    """Return the relative luminance (...,) of linear Rec.709 colors (..., 3)."""
    return np.asarray(np.asarray(rgb, dtype=np.float64) @ REC709_LUMA)


def _white(x: float, y: float) -> Array:
    """Return the XYZ, with Y = 1, of the chromaticity (x, y)."""
    return np.array([x / y, 1.0, (1.0 - x - y) / y])


def _rgb_to_xyz(primaries: Sequence[tuple[float, float]], white: Array) -> Array:
    """Return the (3, 3) matrix from linear RGB with these primaries and this white to XYZ (SMPTE RP 177)."""
    columns = np.stack([_white(x, y) for x, y in primaries], axis=1)
    return columns * np.asarray(np.linalg.solve(columns, white), dtype=np.float64)


_D65 = _white(0.3127, 0.3290)
_D60 = _white(0.32168, 0.33767)
_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])

REC709_TO_XYZ: Array = _rgb_to_xyz([(0.64, 0.33), (0.30, 0.60), (0.15, 0.06)], _D65)
"""Linear Rec.709 to CIE XYZ (D65), a (3, 3) matrix that multiplies column vectors."""

_AP1_TO_XYZ = _rgb_to_xyz([(0.713, 0.293), (0.165, 0.830), (0.128, 0.044)], _D60)
_D60_TO_D65 = np.linalg.solve(_BRADFORD, ((_BRADFORD @ _D65) / (_BRADFORD @ _D60))[:, None] * _BRADFORD)

ACESCG_TO_REC709: Array = np.asarray(np.linalg.solve(REC709_TO_XYZ, _D60_TO_D65 @ _AP1_TO_XYZ), dtype=np.float64)
"""Linear ACEScg (AP1, D60; S-2014-004) to linear Rec.709 (D65), Bradford-adapted; multiplies column vectors."""


def rgb_to_xyz(rgb: ArrayLike) -> Array:
    """Convert linear Rec.709 (..., 3) to CIE XYZ (D65, white has Y = 1)."""
    return np.asarray(np.asarray(rgb, dtype=np.float64) @ REC709_TO_XYZ.T)


def xyz_to_rgb(xyz: ArrayLike) -> Array:
    """Convert CIE XYZ (..., 3) (D65, white has Y = 1) to linear Rec.709; the inverse of `rgb_to_xyz`."""
    return np.asarray(np.asarray(xyz, dtype=np.float64) @ np.linalg.inv(REC709_TO_XYZ).T)


def xyz_to_lab(xyz: ArrayLike) -> Array:
    """Convert CIE XYZ (..., 3) to CIELAB (L* in [0, 100]) under D65 (CIE 15:2018)."""
    t = np.asarray(xyz, dtype=np.float64) / _D65
    delta = 6 / 29
    f = np.where(t > delta**3, np.cbrt(t), t / (3 * delta**2) + 4 / 29)
    fx, fy, fz = np.moveaxis(f, -1, 0)
    return np.stack([116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)], axis=-1)


def lab_to_xyz(lab: ArrayLike) -> Array:
    """Convert CIELAB (..., 3) under D65 to CIE XYZ; the inverse of `xyz_to_lab`."""
    L, a, b = np.moveaxis(np.asarray(lab, dtype=np.float64), -1, 0)
    fy = (L + 16) / 116
    f = np.stack([fy + a / 500, fy, fy - b / 200], axis=-1)
    delta = 6 / 29
    return np.where(f > delta, f**3, 3 * delta**2 * (f - 4 / 29)) * _D65


def rgb_to_lab(rgb: ArrayLike) -> Array:
    """Convert linear Rec.709 (..., 3) to CIELAB under D65."""
    return xyz_to_lab(rgb_to_xyz(rgb))


def ciede2000(lab1: ArrayLike, lab2: ArrayLike) -> Array:
    """Return the CIEDE2000 color difference of CIELAB colors.

    Parameters
    ----------
    lab1, lab2 : (..., 3), broadcast against each other

    Returns
    -------
    Array
        (...,), 0 for equal colors; about 1 is just noticeable. Weights kL = kC = kH = 1.

    Notes
    -----
    Sharma, Wu and Dalal, "The CIEDE2000 Color-Difference Formula: Implementation Notes, Supplementary Test Data, and
    Mathematical Observations", Color Research & Application 30(1), 2005. Their numbers of equations stand at the side.
    """
    L1, a1, b1 = np.moveaxis(np.asarray(lab1, dtype=np.float64), -1, 0)
    L2, a2, b2 = np.moveaxis(np.asarray(lab2, dtype=np.float64), -1, 0)
    chroma7 = ((np.hypot(a1, b1) + np.hypot(a2, b2)) / 2) ** 7
    stretch = 1.5 - 0.5 * np.sqrt(chroma7 / (chroma7 + 25.0**7))  # 1 + G, (4)
    a1, a2 = stretch * a1, stretch * a2
    C1, C2 = np.hypot(a1, b1), np.hypot(a2, b2)
    h1, h2 = np.degrees(np.arctan2(b1, a1)) % 360, np.degrees(np.arctan2(b2, a2)) % 360  # (7)

    # A gray has no hue: its hue must neither turn the difference nor enter the mean.
    gray = C1 * C2 == 0
    turn = np.where(gray, 0.0, (h2 - h1 + 180) % 360 - 180)  # (10)
    dL, dC = L2 - L1, C2 - C1
    dH = 2 * np.sqrt(C1 * C2) * np.sin(np.radians(turn) / 2)  # (11)

    L, C = (L1 + L2) / 2, (C1 + C2) / 2
    across = np.where(h1 + h2 < 360, 360.0, -360.0)
    h = np.where(gray, h1 + h2, np.where(np.abs(h1 - h2) > 180, h1 + h2 + across, h1 + h2) / 2)  # (14)
    T = (
        1
        - 0.17 * np.cos(np.radians(h - 30))
        + 0.24 * np.cos(np.radians(2 * h))
        + 0.32 * np.cos(np.radians(3 * h + 6))
        - 0.20 * np.cos(np.radians(4 * h - 63))
    )  # (15)
    S_L = 1 + 0.015 * (L - 50) ** 2 / np.sqrt(20 + (L - 50) ** 2)  # (18)
    S_C = 1 + 0.045 * C
    S_H = 1 + 0.015 * C * T
    C7 = C**7
    rotation = np.radians(60 * np.exp(-(((h - 275) / 25) ** 2)))
    R_T = -np.sin(rotation) * 2 * np.sqrt(C7 / (C7 + 25.0**7))  # (21)
    l, c, hue = dL / S_L, dC / S_C, dH / S_H  # noqa: E741
    # Rounding can bring the quadratic form of equal colors just below zero.
    return np.asarray(np.sqrt(np.maximum(l * l + c * c + hue * hue + R_T * c * hue, 0.0)))


#: below this peak the display transform leaves a color as it is; above, it loses saturation by this factor
SHOULDER_START, SHOULDER_DESATURATION = 0.8, 0.15


def neutral_display(rgb: ArrayLike) -> Array:
    """Map scene-linear color to display-linear [0, 1) by the shoulder of the Khronos PBR Neutral tone mapper.

    Its toe is left out: it takes off the 4 % that a dielectric reflects under uniform light, which here would only
    darken and saturate the shadows.

    Parameters
    ----------
    rgb : (..., 3) linear Rec.709, 0 or more

    Returns
    -------
    Array
        (..., 3) linear, still to be encoded with `srgb_encode`. Colors up to 0.8 stay; brighter peaks roll off
        towards white.

    Notes
    -----
    [KhronosNeutral2024]
    """
    color = np.asarray(rgb, dtype=np.float64)
    peak = color.max(axis=-1, keepdims=True)
    bright = np.maximum(peak, SHOULDER_START)
    room = 1 - SHOULDER_START
    mapped = 1 - room * room / (bright + room - SHOULDER_START)
    gray = 1 - 1 / (SHOULDER_DESATURATION * (bright - mapped) + 1)
    compressed = color * (mapped / bright)
    return np.where(peak < SHOULDER_START, color, compressed + (mapped - compressed) * gray)
