"""The built-in creature: a bust with an octopus's cranium, heavy brows and a beard of tentacles.

A character in the spirit of the test model of the seed paper (section 4.1), made of formulas only. The body is the zero
set of a smooth scalar field, seen along rays that fan out from an axis; a tentacle is a tube swept along a grown curve,
with suckers as displacement. Both are smooth surfaces over a rectangle of parameters, and a level of detail is nothing
but how densely that rectangle is sampled.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, RectBivariateSpline
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import Delaunay, cKDTree
from scipy.spatial.distance import cdist

from skincli.mesh.builtin.flatten import pack, relax
from skincli.mesh.builtin.levels import DETAILS
from skincli.mesh.model import Mesh, Part

Array = NDArray[np.float64]


# ---- field -----------------------------------------------------------------------------------------------------------


def _smoothstep(a: float, b: float, x: Array) -> Array:
    t = np.clip((x - a) / (b - a), 0.0, 1.0)
    return t * t * t * (t * (6.0 * t - 15.0) + 10.0)


def _smooth_min(a: Array, b: Array, width: float) -> Array:
    """Minimum of two fields, rounded over `width` mm; cubic, so that curvature and highlights stay continuous."""
    overlap = np.maximum(width - np.abs(a - b), 0.0) / width
    return np.minimum(a, b) - overlap**3 * (width / 6.0)


def _smooth_max(a: Array, b: Array, width: float) -> Array:
    return -_smooth_min(-a, -b, width)


def _ellipsoid(p: Array, center: tuple[float, ...], radii: tuple[float, ...], pitch: float = 0.0) -> Array:
    """Distance to an ellipsoid, exact to first order near its surface; `pitch` turns it about x, in degrees."""
    c, s = np.cos(np.radians(pitch)), np.sin(np.radians(pitch))
    q = (p - np.array(center)) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]]).T
    k0 = np.sqrt(np.einsum("ij,ij->i", q / radii, q / radii)) + 1e-9
    q2 = q / np.square(radii)
    return k0 * (k0 - 1.0) / (np.sqrt(np.einsum("ij,ij->i", q2, q2)) + 1e-9)


def _cone(p: Array, a: tuple[float, ...], b: tuple[float, ...], ra: float, rb: float) -> Array:
    """Distance to a round cone from `a` with radius `ra` to `b` with radius `rb`."""
    start = np.array(a)
    axis = np.array(b) - start
    along = np.clip((p - start) @ axis / (axis @ axis), 0.0, 1.0)
    rest = p - start - along[:, None] * axis
    return np.sqrt(np.einsum("ij,ij->i", rest, rest)) - (ra + (rb - ra) * along)


def _gradient(field: Callable[[Array], Array], points: Array) -> Array:
    """Unit gradient of a field, by its differences over a tetrahedron's corners."""
    probes = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
    values = field((points + 0.05 * probes[:, None]).reshape(-1, 3)).reshape(4, len(points))
    return _unit(values.T @ probes + 1e-12)


def _bust(points: Array) -> Array:
    """Signed distance, in mm and approximately, to the body without collars and folds; negative inside."""
    x, y, z = points.T
    # A slow warp takes the machine symmetry out of the face.
    p = points + np.stack(
        [
            2.2 * np.sin(y / 47.0 + 0.6) + 1.2 * np.sin(z / 29.0),
            1.6 * np.sin(x / 41.0 + 0.9),
            1.5 * np.sin(x / 33.0 + y / 58.0),
        ],
        axis=1,
    )
    m = p.copy()
    m[:, 0] = np.sqrt(p[:, 0] ** 2 + 9.0)  # a mirror without a crease

    # Cranium and the mantle that sags behind it, to one side.
    d = _ellipsoid(p, (0, 102, -20), (84, 78, 80), -12)
    d = _smooth_min(d, _ellipsoid(p, (6, 84, -92), (64, 62, 58), 0), 50)
    d = _smooth_min(d, _ellipsoid(p, (14, 20, -124), (40, 54, 34), 14), 46)
    # Face: skull, cheeks, the pad from which the beard grows.
    d = _smooth_min(d, _ellipsoid(p, (0, 30, 8), (64, 60, 58), 0), 30)
    d = _smooth_min(d, _ellipsoid(p, (0, -24, 40), (54, 32, 36), 0), 30)
    d = _smooth_min(d, _cone(p, (0, -30, 34), (0, -84, 22), 42, 26), 24)
    d = _smooth_min(d, _ellipsoid(m, (50, 4, 32), (28, 22, 34), 20), 20)
    d = _smooth_max(d, -_ellipsoid(m, (38, 36, 85), (25, 21, 26), 0), 28)
    # Bridge: narrow between the eyes, spreading into the lip.
    d = _smooth_min(d, _cone(m, (2, 70, 56), (3, 28, 68), 10, 9), 22)
    d = _smooth_min(d, _cone(m, (3, 28, 68), (15, -10, 66), 9, 15), 20)
    # Brows.
    d = _smooth_min(d, _cone(m, (10, 57, 60), (36, 70, 60), 11, 14), 16)
    d = _smooth_min(d, _cone(m, (36, 70, 60), (68, 58, 18), 14, 9), 28)
    d = _smooth_min(d, _cone(m, (66, 58, 16), (62, 20, -2), 9, 6), 24)
    d = _smooth_min(d, _ellipsoid(m, (38, 16, 52), (24, 13, 17), 0), 16)
    # Eyeball under its lids.
    q = m - np.array((36.0, 38.0, 52.0))
    d = _smooth_min(d, np.sqrt(np.einsum("ij,ij->i", q, q)) - 23.0, 15)
    # Neck, shoulders, base.
    d = _smooth_min(d, _cone(p, (0, 0, -44), (0, -160, -24), 60, 74), 50)
    d = _smooth_min(d, _cone(m, (0, -122, -24), (84, -152, -28), 52, 36), 54)
    d = _smooth_min(d, _ellipsoid(p, (0, -150, 0), (92, 70, 62), 0), 40)
    # The rolled hem of the mantle about the neck's root.
    around = np.arctan2(p[:, 0], p[:, 2] + 24.0)
    ring = np.hypot(p[:, 0] / 1.22, p[:, 2] + 24.0) - 76.0
    height = p[:, 1] + 112.0 + 5.0 * np.cos(around) - 3.5 * np.sin(3 * around + 1.0) - 2.0 * np.sin(7 * around)
    d = _smooth_min(d, np.hypot(ring, height) - 9.0 - 1.5 * np.sin(5 * around + 2.0), 16)
    # A siphon on one cheek only.
    d = _smooth_min(d, _cone(p, (50, -2, -8), (84, -10, 2), 16, 11), 18)
    d = _smooth_max(d, -_cone(p, (72, -7, -2), (108, -15, 8), 4.5, 8.5), 7)
    d = _smooth_max(d, -171.0 - p[:, 1], 20)
    return d


# ---- tentacles -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Arm:
    """What makes one tentacle differ from the others; lengths in mm, angles in degrees.

    Parameters
    ----------
    root : where it leaves the body, before it is moved onto the surface along `heading`
    heading : direction in which it leaves
    length, thickness : along the curve, and across at the root
    weight : how strongly it gives in to gravity, per 100 mm
    sway : turning to its left and right, degrees per 10 mm, and the number of waves
    curl : how far the tip winds up toward the suckers, in degrees (negative: away), and where it starts, 0 to 1
    suckers : direction toward which the suckers look at the root
    twist : how far the suckers turn about the curve from root to tip
    """

    root: tuple[float, float, float]
    heading: tuple[float, float, float]
    length: float
    thickness: float
    weight: float = 2.0
    sway: tuple[float, float] = (0.0, 1.0)
    curl: tuple[float, float] = (360.0, 0.6)
    suckers: tuple[float, float, float] = (0.0, -0.2, -1.0)
    twist: float = 0.0


_ARMS = (
    # The lip: what the eye meets first.
    _Arm((-15, -14, 75), (-0.35, -0.5, 0.9), 205, 19, 1.9, (15, 1.25), (470, 0.52), (0.8, 0, -0.6), 60),
    _Arm((14, -17, 76), (0.3, -0.6, 0.9), 172, 20, 2.2, (-14, 1.1), (420, 0.5), (-0.9, 0, -0.4), -50),
    _Arm((-40, -8, 66), (-0.9, -0.1, 0.7), 210, 18, 1.3, (9, 0.8), (520, 0.44), (0.2, -1, -0.3), 20),
    _Arm((41, -10, 66), (0.95, 0.0, 0.6), 195, 19, 1.0, (-6, 0.9), (-460, 0.42), (-0.2, -1, -0.1), -30),
    # Behind and between them.
    _Arm((1, -36, 70), (0.05, -0.9, 0.6), 150, 17, 2.6, (13, 1.5), (-400, 0.55), (0.7, 0, 0.7), 70),
    _Arm((-29, -35, 66), (-0.4, -0.8, 0.6), 170, 16, 2.2, (-13, 1.3), (450, 0.52), (-0.8, 0, 0.5), -50),
    _Arm((30, -36, 66), (0.4, -0.8, 0.6), 185, 18, 2.2, (14, 1.2), (420, 0.55), (0.8, 0, 0.5), 60),
    _Arm((-62, -20, 36), (-1, -0.1, 0.3), 200, 17, 0.9, (9, 0.9), (-430, 0.45), (0, -1, 0.3), 40),
    _Arm((63, -22, 36), (1, -0.4, 0.35), 185, 17, 1.3, (-10, 1.2), (430, 0.5), (0, -1, 0.3), -60),
    _Arm((-50, -38, 48), (-0.7, -0.8, 0.5), 165, 15, 2.0, (10, 1.5), (400, 0.55), (0.6, 0, 0.8), 40),
    _Arm((50, -40, 48), (0.7, -0.9, 0.5), 150, 14, 2.0, (-11, 1.4), (-460, 0.5), (-0.7, 0, 0.7), -40),
    _Arm((-14, -52, 62), (-0.2, -1, 0.35), 125, 14, 2.4, (14, 1.1), (360, 0.55), (0.7, 0, 0.7), 30),
    _Arm((17, -54, 62), (0.2, -1, 0.35), 112, 14, 2.4, (-14, 1.2), (-360, 0.55), (-0.7, 0, 0.7), -30),
    # Whiskers.
    _Arm((-27, -16, 72), (-0.5, -0.3, 1), 115, 8, 2.0, (16, 1.5), (320, 0.55)),
    _Arm((29, -20, 72), (0.5, -0.4, 1), 100, 7, 1.8, (-16, 1.4), (380, 0.5)),
    _Arm((0, -20, 76), (0.0, -0.4, 1), 118, 8, 2.6, (16, 1.6), (300, 0.55)),
    _Arm((-55, -2, 52), (-1, 0.1, 0.7), 100, 7, 1.4, (14, 1.2), (420, 0.48)),
    _Arm((54, -28, 54), (0.8, -0.5, 0.8), 100, 8, 1.8, (-14, 1.4), (350, 0.52)),
)
_TIP = 3.0  # thickness of every tentacle where its tip begins to round off, mm
_SUNK = 8.0  # length of a tentacle that lies inside the body, mm
_STEPS = 160  # points of a grown curve


def _unit(v: Array) -> Array:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def _across(v: Array, t: Array) -> Array:
    """The part of `v` that is perpendicular to the unit vector `t`."""
    return v - np.sum(v * t, axis=-1, keepdims=True) * t


def _table(name: str) -> Array:
    """One property of all tentacles, (n,) or (n, k)."""
    return np.array([getattr(arm, name) for arm in _ARMS], dtype=float)


@cache
def _roots() -> tuple[Array, Array]:
    """Where the tentacles leave the bust, (n, 3) mm, and their unit headings, (n, 3)."""
    heading = _unit(_table("heading"))
    point = _table("root") + 60.0 * heading
    for _ in range(60):
        point -= 0.8 * _bust(point)[:, None] * heading
    return point, heading


def _radius(u: Array, thickness: Array) -> Array:
    """Radius of a tentacle, without its tip's rounding, at the fraction `u` of its length."""
    u = np.clip(u, 0.0, 1.0)
    return 0.5 * (_TIP + (thickness - _TIP) * (1.0 - u))


@cache
def _curves() -> tuple[Array, Array]:
    """Center lines, (n, steps + 1, 3) mm, and directions of the suckers, (n, steps + 1, 3), of all tentacles.

    They grow side by side, turned by gravity, by their own sway and curl, and away from the body; then they push
    each other apart.
    """
    start, t = _roots()
    length, thickness = _table("length"), _table("thickness")
    sway, curl = _table("sway"), _table("curl")
    twist = np.radians(_table("twist"))
    weight = _table("weight") / 100.0
    v = _unit(_across(_table("suckers"), t))
    x = start - _SUNK * t
    step = ((length + _SUNK) / _STEPS)[:, None]
    points, ventral = [x], [v]
    for k in range(_STEPS):
        u = np.full(len(x), (k + 0.5) / _STEPS)
        out = step[:, 0] * k > _SUNK + 6.0
        radius = _radius(u, thickness)
        hang = (weight * (1.0 - _smoothstep(0.45, 1.0, u)))[:, None]
        turn = hang * _across(np.array([0.0, -1.0, 0.0]), t)
        wave = np.radians(sway[:, 0]) / 10.0 * np.sin(2 * np.pi * sway[:, 1] * u) * (1.0 - curl[:, 1] * u)
        turn += wave[:, None] * _across(np.array([1.0, 0.0, 0.3]), t)
        wind = np.clip((u - curl[:, 1]) / (1.0 - curl[:, 1]), 0.0, 1.0) ** 1.2
        turn += (np.radians(curl[:, 0]) * 2.2 / ((1.0 - curl[:, 1]) * length) * wind)[:, None] * v
        # What would sink below the base turns up again.
        turn += (0.05 * np.clip((-135.0 - x[:, 1]) / 30.0, 0.0, 1.0))[:, None] * _across(np.array([0.0, 1.0, 0.0]), t)
        near = _bust(x) - radius - 5.0
        away = _gradient(_bust, x)
        turn += (out * np.clip(-near, 0.0, 12.0) * 0.006)[:, None] * _across(away, t)
        # A bend tighter than the tube is thick would fold its inner side.
        bend = np.linalg.norm(turn, axis=1)
        turn *= np.minimum(1.0, 0.6 / radius / (bend + 1e-9))[:, None]
        t = _unit(t + step * turn)
        v = _unit(_across(v, t))
        v = _unit(v + step * (twist / (length + _SUNK))[:, None] * np.cross(t, v))
        x = x + step * t
        points.append(x)
        ventral.append(v)
    line, side = np.stack(points, axis=1), np.stack(ventral, axis=1)
    return _separate(line, thickness), side


def _separate(line: Array, thickness: Array) -> Array:
    """Push center lines off each other and off the body until the tubes no longer cut, keeping their forms."""
    count, steps, _ = line.shape
    u = np.linspace(0.0, 1.0, steps)
    radius = _radius(u[None, :], thickness[:, None]).ravel()
    owner = np.repeat(np.arange(count), steps)
    index = np.tile(np.arange(steps), count)
    spacing = np.linalg.norm(np.diff(line, axis=1), axis=2).mean(axis=1)[owner]
    free = _smoothstep(0.04, 0.22, u)[None, :, None]
    for _ in range(40):
        flat = line.reshape(-1, 3)
        pairs = cKDTree(flat).query_pairs(2.3 * radius.max(), output_type="ndarray")
        i, j = pairs.T
        apart = (owner[i] != owner[j]) | (np.abs(index[i] - index[j]) * spacing[i] > 3.2 * (radius[i] + radius[j]))
        i, j = i[apart], j[apart]
        gap = flat[i] - flat[j]
        distance = np.linalg.norm(gap, axis=1) + 1e-9
        lack = 1.22 * (radius[i] + radius[j]) - distance
        i, j, gap, distance, lack = i[lack > 0], j[lack > 0], gap[lack > 0], distance[lack > 0], lack[lack > 0]
        push = np.zeros_like(flat)
        hits = np.zeros(len(flat))
        # The thinner one gives way.
        share = (radius[j] ** 2 / (radius[i] ** 2 + radius[j] ** 2))[:, None]
        force = gap * (lack / distance)[:, None]
        np.add.at(push, i, force * share)
        np.add.at(push, j, -force * (1.0 - share))
        np.add.at(hits, i, 1.0)
        np.add.at(hits, j, 1.0)
        push /= np.maximum(hits, 1.0)[:, None]
        sunk = np.clip(radius * 1.02 - _bust(flat), 0.0, None)
        push += sunk[:, None] * _gradient(_bust, flat)
        push = gaussian_filter1d(push.reshape(line.shape) * free, 8.0, axis=1, mode="nearest")
        line = line + 0.9 * push * free
    return line


# ---- body ------------------------------------------------------------------------------------------------------------

_HEAD = np.array([0.0, 24.0, -22.0])  # from where the rays of the head fan out, mm
_CAP = 0.45  # parameter s up to which they do so; below, they come from an axis


def _rays(s: Array, theta: Array) -> tuple[Array, Array]:
    """Ray of the body's parameters: s from 0 at the crown's pole to 1 under the base, theta in radians, 0 in front."""
    s = np.asarray(s, float)
    polar = np.minimum(s / _CAP, 1.0)
    elevation = np.pi / 2 * (1.0 - polar) - 0.2 * _smoothstep(_CAP, 0.6, s)
    elevation = elevation + 0.3 * _smoothstep(0.58, 0.88, s) - 0.46 * _smoothstep(0.88, 1.0, s)
    # The pole leans back, out of the front view.
    lean = np.radians(52.0) * (1.0 - _smoothstep(0.0, 0.5, s))
    x = np.cos(elevation) * np.sin(theta)
    y = np.sin(elevation)
    z = np.cos(elevation) * np.cos(theta)
    direction = np.stack([x, y * np.cos(lean) + z * np.sin(lean), z * np.cos(lean) - y * np.sin(lean)], axis=-1)
    down = np.clip((s - _CAP) / (1.0 - _CAP), 0.0, 1.0)
    origin = _HEAD + np.stack([0 * s, -174.0 * down**1.1, 12.0 * down], axis=-1)
    return origin, direction


def _body_points(field: Callable[[Array], Array], s: Array, theta: Array) -> Array:
    """Where rays first meet the zero set of `field`, coming from outside, (n, 3) mm."""
    origin, direction = _rays(s, theta)
    t = np.full(len(s), 190.0)
    active = np.arange(len(s))
    for _ in range(60):
        d = field(origin[active] + t[active, None] * direction[active])
        t[active] -= 0.85 * d
        active = active[np.abs(d) > 1e-4]
        if not len(active):
            break
    return origin + t[:, None] * direction


def _flesh(points: Array) -> Array:
    """Signed distance to the bust with the sheaths from which the tentacles come."""
    d = _bust(points)
    sheaths, thickness = _sheaths(), _table("thickness")
    far = cdist(points, sheaths[:, 1])
    for k, ((a, b, c), thick) in enumerate(zip(sheaths, thickness, strict=True)):
        # Beyond a sphere round it a sheath cannot change the minimum.
        near = np.flatnonzero(far[:, k] < d + 32.0)
        p = points[near]
        sheath = _smooth_min(_cone(p, a, b, 0.76 * thick, 0.5 * thick), _cone(p, b, c, 0.5 * thick, 0.3 * thick), 6)
        d[near] = _smooth_min(d[near], sheath, 8)
    return d


@cache
def _sheaths() -> Array:
    """Three points along the root of each tentacle, (n, 3, 3) mm, about which the flesh rises to meet it."""
    line, _ = _curves()
    places = np.array([0.0, _SUNK + 3.0, _SUNK + 12.0])
    spans = np.linalg.norm(np.diff(line, axis=1), axis=2).mean(axis=1)
    return np.stack(
        [CubicSpline(np.arange(_STEPS + 1) * span, curve)(places) for curve, span in zip(line, spans, strict=True)]
    )


def _groove(distance: Array, width: float) -> Array:
    """Profile of a crease between two swellings: -1 in the middle, a little above 0 beside it."""
    q = (distance / width) ** 2
    return (1.1 * q - 1.0) * np.exp(-q)


@cache
def _warts() -> tuple[Array, Array, Array]:
    """Centers (n, 3), radii (n,) and heights (n,) of the warts, mm."""
    count = 150
    k = np.arange(count)
    # Golden-angle spiral, loosened by irrational multiples: even, without order, and without a random generator.
    s = 0.56 * np.sqrt((k + 0.5) / count) + 0.02 * np.sin(12.9898 * k)
    theta = np.pi - np.mod(2.39996323 * k + 0.4 * np.sin(78.233 * k), 2 * np.pi)
    radius = 6.0 + 8.0 * (0.5 + 0.5 * np.sin(37.719 * k + 1.0)) ** 5
    center = _body_points(_bust, np.abs(s), theta)
    face = np.exp(-((center[:, 0] / 62) ** 4) - ((center[:, 1] - 45) / 62) ** 4) * (center[:, 2] > 0)
    height = radius * (0.10 + 0.13 * np.sin(23.14 * k) ** 2) * (1.0 - face)
    return center, radius, height


def _relief(p: Array) -> Array:
    """Height in mm of folds, warts and slits over the flesh."""
    x, y, z = p.T
    h = np.zeros(len(p))
    center, radius, height = _warts()
    near = cKDTree(p).query_ball_point(center, radius)
    for wart, (i, c, r, top) in enumerate(zip(near, center, radius, height, strict=True)):
        if i:
            q = np.sum((p[i] - c) ** 2, axis=1) / r**2
            # Every fifth has a crater.
            h[i] += top * ((1.0 - q) ** 3 - (wart % 5 == 0) * 1.2 * np.clip(1.0 - 3.0 * q, 0.0, None) ** 3)
    front = _smoothstep(0.0, 40.0, z)
    m = np.sqrt(x**2 + 4.0)
    # Two lobes of the mantle, and swellings that run over it from brow to nape.
    top = _smoothstep(84.0, 128.0, y + 0.55 * np.maximum(-z, 0.0))
    h += 3.2 * top * _groove(x + 5.0 * np.sin(z / 31.0 + y / 45.0), 15.0)
    h += 0.7 * top * np.cos(2 * np.pi * (m + 6.0 * np.sin(z / 37.0) + 3.0 * np.sin(y / 19.0)) / 27.0)
    # Forehead: folds that hang from the middle like a curtain.
    drop = y - 85.0 - 0.005 * x**2 + 2.5 * np.sin(x / 14.0 + 0.5)
    mask = np.exp(-((x / 38) ** 2) - ((y - 97) / 21) ** 4) * front
    h += 1.8 * mask * _groove(drop - 18.0 * np.round(drop / 18.0), 6.4)
    # Frown lines.
    mask = np.exp(-(((y - 68) / 15) ** 4)) * front
    h += 2.4 * mask * _groove(m - 8.0 - 0.1 * (y - 66), 4.8)
    # Lids: an almond sunk between a heavy upper and a thin lower rim, low at the nose; a flat pupil; the lid's crease.
    along = (m - 37.0) / 19.5
    arch = np.clip(1.0 - along**2, 0.0, None)
    rise = y - 37.5 - 2.6 * along
    upper, lower = 6.0 * arch - rise, rise + 5.6 * arch
    opened = _smoothstep(-2.6, 3.0, _smooth_min(upper, lower, 3.0))
    lids = np.exp(-((along / 1.25) ** 8)) * front
    h += lids * (
        1.3 * np.exp(-(((upper + 3.0) / 3.8) ** 2)) + 0.8 * np.exp(-(((lower + 2.4) / 3.0) ** 2)) - 2.0 * opened
    )
    h += lids * _smoothstep(-1.1, -0.4, along) * 0.7 * _groove(upper + 9.5 - 2.0 * arch, 4.0)
    h -= opened * front * 1.0 * np.exp(-((rise / 2.2) ** 2) - (along / 0.42) ** 4)
    # Bags under the eyes.
    ex, ey = m - 36.0, y - 38.0
    far = np.hypot(ex, 1.15 * ey)
    under = _smoothstep(0.0, 18.0, -ey - 0.3 * np.abs(ex)) * front
    h += under * 1.3 * _groove(far - 29.5, 4.5)
    # Crow's feet.
    angle = np.arctan2(ey, ex)
    mask = np.exp(-(((far - 38.0) / 12.0) ** 4)) * np.exp(-((angle / 0.7) ** 4)) * _smoothstep(-40.0, 0.0, z)
    h += 0.7 * mask * np.cos(angle * 9.0)
    # Folds swept back from the temple to the nape.
    mask = _smoothstep(40.0, 58.0, m) * np.exp(-(((y - 40.0) / 34.0) ** 4) - ((z + 46.0) / 44.0) ** 4)
    h += 1.5 * mask * np.cos(2 * np.pi * (y + 0.22 * z + 7.0 * np.sin(z / 27.0)) / 19.0)
    # Folds from the bridge round the cheeks.
    far = np.hypot(m - 64.0, y + 6.0)
    mask = np.exp(-(((np.arctan2(y + 6.0, 64.0 - m) - 0.15) / 0.8) ** 4)) * front
    h += mask * 2.2 * _groove(far - 33.0, 5.0)
    # Nostrils: two slits that lean together, and pleats of the lip.
    mask = np.exp(-(((y - 9.0) / 8.5) ** 4)) * front
    h += 2.4 * mask * _groove(m - 9.0 + 0.32 * (y - 9.0), 3.2)
    mask = np.exp(-(((y + 6.0) / 9.0) ** 4) - (x / 46.0) ** 8) * front
    h += 0.7 * mask * np.cos(2 * np.pi * x / 12.5 + 1.3 * np.sin(x / 9.0) + 0.05 * y)
    # Gill slits on the sides of the neck.
    for k in range(3):
        gx = z + 34.0 + 0.45 * (y + 62.0) - 20.0 * (k - 1) - 0.008 * (y + 62.0) ** 2
        h += 3.6 * np.exp(-(((y + 62.0) / 21.0) ** 4)) * _groove(gx, 6.5) * _smoothstep(25.0, 45.0, m)
    # Sinews of the neck, swellings of the mantle's hem.
    around = np.arctan2(x, z + 24.0)
    h += 0.9 * np.exp(-(((y + 70.0) / 36.0) ** 4)) * np.cos(13 * around + 2.0 * np.sin(y / 21.0))
    drape = 1.0 - _smoothstep(-146.0, -118.0, y)
    h += 2.4 * drape * np.cos(11 * around + 0.9 * np.sin(y / 24.0) + 1.5 * np.sin(2 * around))
    h += 0.4 * np.sin(x / 7.1 + 1.7 * np.sin(y / 16.0)) * np.sin(y / 8.3 + 1.3 * np.sin(z / 14.0)) * np.sin(z / 9.2)
    return h


def _skin(points: Array) -> Array:
    """The whole body's field: flesh under its relief."""
    return _flesh(points) - _relief(points)


# ---- sampling --------------------------------------------------------------------------------------------------------


def _delaunay(points: Array) -> NDArray[np.int64]:
    """Counter-clockwise Delaunay triangles of points that fill a rectangle, corners included."""
    faces = Delaunay(points).simplices.astype(np.int64)
    a, b, c = points[faces].transpose(1, 0, 2)
    area = _cross(b - a, c - a)
    faces[area < 0] = faces[area < 0][:, ::-1]
    kept: NDArray[np.int64] = faces[np.abs(area) > 1e-7]
    return kept


def _with_pole(params: Array, faces: NDArray[np.int64], end: int, place: float) -> tuple[Array, NDArray[np.int64]]:
    """Close the first (`end` 0) or last (-1) ring with a fan about one vertex at `place`, which has no angle (NaN)."""
    ring = np.flatnonzero(params[:, 0] == np.sort(params[:, 0])[end])
    ring = ring[np.argsort(params[ring, 1])]
    if end == 0:
        ring = ring[::-1]
    fan = np.stack([ring[:-1], np.full(len(ring) - 1, len(params)), ring[1:]], axis=1)
    return np.concatenate([params, [[place, np.nan]]]), np.concatenate([faces, fan])


def _edges(faces: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Undirected edges (k, 2) and the edge of each face that lies opposite to each of its corners, (m, 3)."""
    pairs = np.sort(np.stack([faces[:, [1, 2]], faces[:, [2, 0]], faces[:, [0, 1]]], axis=1), axis=2)
    edges, of_face = np.unique(pairs.reshape(-1, 2), axis=0, return_inverse=True)
    return edges, of_face.reshape(-1, 3)


def _cross(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _halve(params: Array, faces: NDArray[np.int64]) -> tuple[Array, NDArray[np.int64]]:
    """Cut every triangle into four at the middles of its edges, in parameters; a pole has no angle (NaN)."""
    edges, of_face = _edges(faces)
    a, b = params[edges[:, 0]], params[edges[:, 1]]
    middle = np.where(np.isnan(a), b, np.where(np.isnan(b), a, 0.5 * (a + b)))
    v0, v1, v2 = faces.T
    m0, m1, m2 = (of_face + len(params)).T
    quarters = [(v0, m2, m1), (m2, v1, m0), (m1, m0, v2), (m0, m1, m2)]
    return np.concatenate([params, middle]), np.concatenate([np.stack(q, axis=1) for q in quarters])


_PITCH = 1.5  # distance of suckers along a row, in radii of the tentacle
_SUCKER = 0.54  # radius of a sucker, in radii of the tentacle
_ROW = 0.62  # angle of a row of suckers from the middle of the ventral side, radians


class _Tube:
    """One tentacle: a surface over (arc length, angle about the curve), where angle 0 is its ventral middle."""

    def __init__(self, arm: _Arm, line: Array, ventral: Array) -> None:
        self.arm = arm
        arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        self.length = float(arc[-1])
        self.line = CubicSpline(arc, line)
        self.ventral = CubicSpline(arc, ventral)
        self.cap = self.length - 0.5 * _TIP
        # Suckers follow each other at a distance that shrinks with the radius.
        centers = [_SUNK + 14.0]
        while (radius := float(self._full_radius(centers[-1]))) > 3.3 and centers[-1] < 0.93 * self.length:
            centers.append(centers[-1] + _PITCH * radius)
        self.centers = np.array(centers)
        # The cut runs along the side that looks away from the front: the groove between the suckers, or the back.
        self.cut = 0.0 if np.mean(ventral[:, 2]) < 0.15 else -np.pi

    def _full_radius(self, arc: Array | float) -> Array:
        return _radius(np.asarray(arc) / self.length, np.array(self.arm.thickness))

    def radius(self, arc: Array) -> Array:
        """Radius without suckers, mm; 0 where the tip ends."""
        end = np.clip((arc - self.cap) / (self.length - self.cap), 0.0, 1.0)
        # Narrower where it is sunk in the body, lest the rim of its open end come out at the side.
        return self._full_radius(arc) * np.sqrt(1.0 - end**2) * (0.55 + 0.45 * _smoothstep(0.0, _SUNK, arc))

    def _suckers(self, arc: Array, angle: Array) -> Array:
        """Height of the suckers over the tube, mm: a raised ring about a cup, two rows that alternate."""
        count = len(self.centers)
        place = np.interp(arc, self.centers, np.arange(count, dtype=float), left=-5.0, right=count + 5.0)
        height = np.zeros(len(arc))
        for side, shift in ((1.0, 0.0), (-1.0, 0.5)):
            nearest = np.clip(np.round(place - shift), 0, count - 2) + shift
            along = (place - nearest) * _PITCH
            around = angle - side * _ROW
            around = around - 2 * np.pi * np.round(around / (2 * np.pi))
            q = np.sqrt(along**2 + around**2) / _SUCKER
            ring = 0.62 * (1.0 - _smoothstep(0.66, 1.16, q)) - 0.9 * (1.0 - _smoothstep(0.0, 0.76, q))
            fade = _smoothstep(-0.5, 2.5, nearest) * (1.0 - _smoothstep(count - 5.0, count - 1.0, nearest))
            height += ring * fade
        return height * _SUCKER * self.radius(arc)

    def _point(self, arc: Array, angle: Array) -> Array:
        t = _unit(self.line(arc, 1))
        v = _unit(_across(self.ventral(arc), t))
        radius = self.radius(arc) + self._suckers(arc, angle)
        return self.line(arc) + radius[:, None] * (np.cos(angle)[:, None] * v + np.sin(angle)[:, None] * np.cross(v, t))

    def surface(self, params: Array) -> tuple[Array, Array]:
        """Positions, mm, and unit normals."""
        arc, angle = params[:, 0], np.nan_to_num(params[:, 1])
        position = self._point(arc, angle)
        da, dt = 0.02, 0.002
        inner = np.minimum(arc, self.length - 1e-3)
        along = self._point(inner, angle) - self._point(np.maximum(inner - da, 0.0), angle)
        along += self._point(np.minimum(inner + da, self.length - 1e-3), angle) - self._point(inner, angle)
        across = self._point(inner, angle + dt) - self._point(inner, angle - dt)
        normal = _unit(np.cross(along, across))
        normal[np.isnan(params[:, 1])] = _unit(self.line(self.length, 1))
        # Where it comes out of the flesh, both surfaces are lit alike, and the crossing does not show.
        root = np.flatnonzero(arc < _SUNK + 30.0)
        depth = _flesh(position[root])
        share = ((1.0 - _smoothstep(0.2, 2.6, depth)) * _smoothstep(-3.0, -1.0, depth))[:, None]
        normal[root] = _unit((1.0 - share) * normal[root] + share * _gradient(_flesh, position[root]))
        return position, normal

    def chart(self, params: Array) -> Array:
        """The strip it unrolls to, (n, 2) mm."""
        arc, angle = params[:, 0], np.nan_to_num(params[:, 1])
        return np.stack([arc, (angle - self.cut - np.pi) * self.radius(arc)], axis=1)

    def samples(self, level: int) -> tuple[Array, NDArray[np.int64]]:
        """Parameters and triangles. Each sucker has rings of its own, so that few vertices make it round."""
        rings = ((0.0, 1), (0.4, 5), (0.7, 8), (1.1, 7)) if level else ((0.0, 1), (0.7, 5))
        points = []
        for side, shift in ((1.0, 0.0), (-1.0, 0.5)):
            place = np.arange(len(self.centers) - 1) + shift
            center = np.interp(place, np.arange(len(self.centers)), self.centers)[:, None]
            reach = _SUCKER * self._full_radius(center)
            for k, (far, count) in enumerate(rings):
                turn = 2 * np.pi * (np.arange(count) + 0.5 * (k % 2)) / count
                arc = center + far * reach * np.cos(turn)
                points.append(
                    np.stack([arc, 0.0 * arc + side * (_ROW + far * _SUCKER * np.sin(turn))], -1).reshape(-1, 2)
                )
        # Elsewhere: rings across, as far apart as the tube is thick.
        rows = np.interp(
            np.arange(0, 2 * len(self.centers) - 1, 2 - level) / 2, np.arange(len(self.centers)), self.centers
        )
        root = np.linspace(0.0, rows[0], 2 + 2 * level, endpoint=False)
        tail = np.linspace(rows[-1], self.cap, 2 + round((self.cap - rows[-1]) / (6.0 - 2.8 * level)))[1:]
        end = self.cap + (self.length - self.cap) * np.sin(np.radians((30, 60) if level else (45,)))
        bare = np.linspace(0.0, np.pi, 4 + 4 * level)
        back = np.linspace(1.5, np.pi, 3 + level)
        edge = self.cut + np.array([0.0, 2 * np.pi])
        for row in np.concatenate([root, rows, tail, end]):
            half = back if rows[0] < row < rows[-1] else bare
            points.append(np.stack([np.full(2 * len(half), row), np.concatenate([-half, half])], -1))
            points.append(np.stack([np.full(2, row), edge], -1))
        params = np.concatenate(points)
        params[:, 1] = np.where(params[:, 1] < edge[0] - 1e-9, params[:, 1] + 2 * np.pi, params[:, 1])
        clear = np.abs(params[:, 1:] - edge).min(axis=1)
        params = np.unique(np.round(params[(clear < 1e-9) | (clear > 0.1)], 9), axis=0)
        # Lengths along are measured in radii, so that well-shaped means the same here and in space.
        fine = np.linspace(0.0, self.length, 2000)
        stretch = np.concatenate([[0.0], np.cumsum(np.diff(fine) / np.maximum(self.radius(fine[1:]), 0.3))])
        flat = np.stack([np.interp(params[:, 0], fine, stretch), params[:, 1]], axis=1)
        return _with_pole(params, _delaunay(flat), -1, self.length)


def _settle(field: Callable[[Array], Array], points: Array, direction: Array) -> Array:
    """Move points that are near the zero set of `field` onto it, along their rays."""
    points = points.copy()
    active = np.arange(len(points))
    for _ in range(8):
        d = field(points[active])
        points[active] -= 0.8 * d[:, None] * direction[active]
        active = active[np.abs(d) > 1e-4]
        if not len(active):
            break
    return points


def _conformal(params: Array) -> tuple[Array, Array]:
    """The body's parameters so stretched that angles are about right in space, and the mm one unit is worth there."""
    s = np.minimum(params[:, 0], _CAP)
    along = (2 * _CAP / np.pi) * np.log(np.tan(np.pi / 4 * s / _CAP)) + params[:, 0] - s
    return np.stack([4.1 * along, params[:, 1]], axis=1), 82.0 * np.sin(np.pi / 2 * s / _CAP)


class _Body:
    """The bust: a surface over (s, theta) as in `_rays`, seen from the axis."""

    def __init__(self) -> None:
        s = np.linspace(0.0, 1.0, 49)
        theta = np.linspace(-np.pi, np.pi, 65)
        grid = np.meshgrid(s, theta, indexing="ij")
        points = _body_points(_bust, grid[0].ravel(), grid[1].ravel()).reshape(len(s), len(theta), 3)
        points = gaussian_filter1d(points, 1.0, axis=0, mode="nearest")
        points[:, :-1] = gaussian_filter1d(points[:, :-1], 1.0, axis=1, mode="wrap")
        points[:, -1] = points[:, 0]
        points[0] = points[0].mean(axis=0)
        flat = _flatten_grid(points, theta)
        self._chart = [RectBivariateSpline(s, theta, flat[..., k]) for k in range(2)]

    def surface(self, params: Array) -> tuple[Array, Array]:
        """Positions, mm, and unit normals."""
        s, theta = params[:, 0], np.nan_to_num(params[:, 1])
        position = _settle(_skin, _body_points(_flesh, s, theta), _rays(s, theta)[1])
        return position, _gradient(_skin, position)

    def chart(self, params: Array) -> Array:
        """The flattened skin, (n, 2) mm."""
        return np.stack([spline.ev(params[:, 0], np.nan_to_num(params[:, 1])) for spline in self._chart], axis=-1)

    def samples(self, level: int) -> tuple[Array, NDArray[np.int64]]:
        """Parameters and triangles, densest over the face."""
        dense = np.linspace(0.0, 1.0, 601)
        face = _smoothstep(0.06, 0.19, dense) * (1.0 - _smoothstep(0.54, 0.66, dense))
        # Rings follow each other as profiles of the face and of the back are long, and closer where the face is.
        length = np.zeros(600)
        for theta, share in ((0.1, 0.3), (0.4, 0.3), (0.8, 0.2), (np.pi, 0.2)):
            profile = _body_points(_bust, dense, np.full(601, theta))
            length += share * np.linalg.norm(np.diff(profile, axis=0), axis=1)
        pace = gaussian_filter1d(length, 6.0) * (0.5 + 0.9 * face[1:] + 0.3 * _smoothstep(0.75, 0.88, dense[1:]))
        total = np.concatenate([[0.0], np.cumsum(pace)])
        places = np.interp(np.linspace(0.0, total[-1], 70 * 2**level + 1), total, dense)
        points = []
        for k, (s, front) in enumerate(zip(places[1:], np.interp(places[1:], dense, face), strict=True)):
            turn = np.linspace(-1.0, 1.0, 2 * round((5 + 37 * np.tanh(8.0 * s) + 14 * front) * 2.0 ** (level - 1)) + 1)
            # Every second ring lies between the places of its neighbors.
            turn[1:-1] += (k % 2) * 0.5 * (turn[1] - turn[0]) * (1.0 - np.abs(turn[1:-1]))
            points.append(
                np.stack([np.full(len(turn), s), np.pi * (turn - 0.16 * front * np.sin(np.pi * turn))], axis=1)
            )
        params = np.concatenate(points)
        position, normal = self.surface(params)
        # Then, a few times, new points in the middle of those edges over which the surface turns most.
        for _ in range(3):
            flat, scale = _conformal(params)
            i, j = _edges(_delaunay(flat))[0].T
            apart = np.linalg.norm(flat[i] - flat[j], axis=1) * scale[i]
            turn = np.linalg.norm(normal[i] - normal[j], axis=1) * np.maximum(apart - 0.6 / (1 + level), 0.0)
            # The face is worth more than what the beard hides.
            x, y, z = position[i].T
            seen = (np.hypot(x / 64.0, (y - 28.0) / 36.0) < 1.0) & (z > 30.0)
            turn *= np.where(seen, 4.0, np.where(y < -40.0, 0.4, 1.0))
            # Both sides of the cut must stay alike.
            turn[(np.abs(params[i, 1]) == np.pi) & (np.abs(params[j, 1]) == np.pi)] = 0.0
            worst = np.sort(np.argsort(-turn, kind="stable")[: 230 * 4**level])
            middle = 0.5 * (params[i[worst]] + params[j[worst]])
            more = self.surface(middle)
            params = np.concatenate([params, middle])
            position, normal = np.concatenate([position, more[0]]), np.concatenate([normal, more[1]])
        return _with_pole(params, _delaunay(_conformal(params)[0]), 0, 0.0)


def _flatten_grid(points: Array, theta: Array) -> Array:
    """Lay a grid with the topology of a capped cylinder, cut along its back, flat with little stretch.

    Parameters
    ----------
    points : (m, n, 3) mm, the first row one point, first and last column the two sides of the cut
    theta : (n,) radians, angle of each column

    Returns
    -------
    (m, n, 2) mm
    """
    rows, columns, _ = points.shape
    index = np.concatenate([np.zeros((1, columns), int), 1 + np.arange((rows - 1) * columns).reshape(-1, columns)])
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack(q, axis=-1).reshape(-1, 3) for q in ((a, b, c), (a, c, d))])
    faces = faces[faces[:, 0] != faces[:, 2]]
    # Start as a fan about the pole, which nothing can overlap.
    reach = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=2).mean(axis=1))])
    fan = (reach[:, None, None] * np.stack([np.sin(0.5 * theta), -np.cos(0.5 * theta)], axis=-1)).reshape(-1, 2)
    once = np.concatenate([[0], np.arange(columns, rows * columns)])
    flat = relax(points.reshape(-1, 3)[once], faces, fan[once], 12)
    return flat[index]


_MARGIN = 3.0  # free border round each chart, mm


@cache
def _layout() -> list[Array]:
    """Where each chart lies in the unit square: for each shape the (3, 2) matrix that takes (u, v, 1), u and v in mm.

    The coarsest level decides for all, so that a texture made for one level fits the others.
    """
    coarse = _samples(0)
    charts = [shape.chart(params) for shape, (params, _) in zip(_shapes(), coarse, strict=True)]
    first = np.cumsum([0, *map(len, charts)])
    faces = np.concatenate([faces + start for (_, faces), start in zip(coarse, first[:-1], strict=True)])
    packed = np.split(pack(np.concatenate(charts), faces, _MARGIN), first[1:-1])
    return [np.asarray(np.linalg.lstsq(_with_one(c), p)[0], float) for c, p in zip(charts, packed, strict=True)]


def _with_one(points: Array) -> Array:
    return np.concatenate([points, np.ones((len(points), 1))], axis=1)


@cache
def _shapes() -> tuple[_Body | _Tube, ...]:
    line, ventral = _curves()
    return (_Body(), *(_Tube(arm, *curve) for arm, *curve in zip(_ARMS, line, ventral, strict=True)))


@cache
def _samples(level: int) -> list[tuple[Array, NDArray[np.int64]]]:
    """Parameters and triangles of all shapes at one of the two levels that are sampled afresh."""
    return [shape.samples(level) for shape in _shapes()]


def creature(detail: str = "65k") -> Mesh:
    """Build the creature.

    Parameters
    ----------
    detail : a level of DETAILS["creature"]; all sample the same smooth surface

    Returns
    -------
    the mesh, in mm, y up, the face toward +z, about 350 mm high; its parts are "body" and "tentacles"
    """
    level = DETAILS["creature"].index(detail)
    pieces = []
    for shape, (params, faces) in zip(_shapes(), _samples(min(level, 1)), strict=True):
        if level == 2:
            params, faces = _halve(params, faces)
        position, normal = shape.surface(params)
        pieces.append((position, normal, shape.chart(params), faces))
    uv = np.concatenate([_with_one(piece[2]) @ place for piece, place in zip(pieces, _layout(), strict=True)])
    first = np.cumsum([0, *(len(piece[0]) for piece in pieces)])
    triangles = np.concatenate([piece[3] + start for piece, start in zip(pieces, first[:-1], strict=True)])
    body = len(pieces[0][3])
    return Mesh(
        positions=np.concatenate([piece[0] for piece in pieces]),
        normals=np.concatenate([piece[1] for piece in pieces]),
        uv=uv,
        atlas_uv=uv,
        faces=triangles.astype(np.int32),
        parts=(Part("body", 0, body), Part("tentacles", body, len(triangles))),
    )
