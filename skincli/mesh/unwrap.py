"""Whether authored UVs may carry light, and an atlas made by xatlas where they may not."""

from __future__ import annotations

import hashlib
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray

from skincli import diskcache
from skincli.mesh import surface
from skincli.mesh.surface import Floats, Integers

CHECK_SIZE = 1024
"""Texels a side at which overlap is counted."""

RANGE_SLACK = 1e-6
"""How far beyond [0, 1] rounding may carry a UV."""

MOST_OVERLAP = 1e-3
"""Share of the covered texels that several faces may claim: real scans have a few folded triangles."""

MOST_DEGENERATE = 1e-3
"""Share of the surface area that may lie on faces without UV area."""

LEAST_USE = 0.05
"""Share of the unit square the charts must fill, or light would be computed at a needlessly coarse grain."""

ATLAS_SIZE = 1024
"""Texels a side at which charts are packed."""

PADDING = 6
"""Texels between charts at the packed size, which xatlas lets exceed ATLAS_SIZE by some 10 %: over 4 of 1024."""

ATLAS_EXTENT = 256.0
"""Extent to which a mesh is scaled for xatlas, whose tolerances are absolute."""


def why_not_unique(positions: Floats, uv: Floats, faces: Integers) -> list[str]:
    """Return the reasons why light cannot be computed in a UV set; none means that it can.

    Parameters
    ----------
    positions : (n, 3) float64, mm
    uv : (n, 2) float64; not finite where the vertex has none
    faces : (m, 3)

    Returns
    -------
    clauses for the user, with figures ("12.5 % of the covered texels are shared by several faces")
    """
    if not np.isfinite(uv).all():
        return ["they are missing in places"]
    reasons = []
    if uv.min() < -RANGE_SLACK or uv.max() > 1.0 + RANGE_SLACK:
        reasons.append("they leave the square from 0 to 1")
    uv_area = np.abs(surface.uv_areas(uv, faces))
    area = np.linalg.norm(surface.area_vectors(positions, faces), axis=1)
    degenerate = area[uv_area <= surface.TINY_UV_AREA].sum() / area.sum()
    if degenerate > MOST_DEGENERATE:
        reasons.append(f"{degenerate:.1%} of the surface has no area in them")
    if not reasons:
        covering = surface.coverage(uv, faces, CHECK_SIZE)
        covered = np.count_nonzero(covering)
        if covered < LEAST_USE * covering.size:
            reasons.append(f"they fill only {covered / covering.size:.1%} of the square")
        if (shared := np.count_nonzero(covering > 1)) > MOST_OVERLAP * covered:
            reasons.append(f"{shared / covered:.1%} of the covered texels are shared by several faces")
    return reasons


def atlas(
    positions: Floats, normals: Floats, faces: Integers, *, use_cache: bool = True
) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats]:
    """Unwrap a whole mesh into one unit square by xatlas, without overlap.

    The result is deterministic, and kept in the disk cache.

    Parameters
    ----------
    positions : (n, 3) float64
    normals : (n, 3) float64, unit
    faces : (m, 3)
    use_cache : whether the disk cache is read and written

    Returns
    -------
    source : (k,) index of the input vertex of which each output vertex is a copy; seams make several of one
    faces : (m, 3) into the output vertices, in the input's order
    atlas_uv : (k, 2) float64 in [0, 1]; charts lie at least 4 / 1024 apart, none mirrored
    """
    digest = hashlib.blake2b(f"{version('xatlas')}:{ATLAS_SIZE}:{PADDING}:{ATLAS_EXTENT}".encode(), digest_size=16)
    for array in (positions, normals, faces):
        digest.update(np.ascontiguousarray(array).tobytes())

    def make() -> diskcache.Arrays:
        source, indices, atlas_uv = _run_xatlas(positions, normals, faces)
        return {"source": source, "faces": indices, "uv": atlas_uv}

    found = diskcache.arrays("unwrap", digest.hexdigest(), make, enabled=use_cache)
    return found["source"].astype(np.int64), found["faces"].astype(np.int64), found["uv"].astype(np.float64)


def _run_xatlas(
    positions: Floats, normals: Floats, faces: Integers
) -> tuple[NDArray[np.uint32], NDArray[np.uint32], Floats]:
    """Return xatlas's vertex mapping, faces and UVs."""
    import xatlas

    low = positions.min(axis=0)
    scaled = (positions - low) * (ATLAS_EXTENT / (positions.max(axis=0) - low).max())
    maker = xatlas.Atlas()
    # One call for all parts: xatlas packs what it is given together into one square.
    maker.add_mesh(scaled.astype(np.float32), faces.astype(np.uint32), normals.astype(np.float32))
    charting = xatlas.ChartOptions()
    charting.fix_winding = True
    packing = xatlas.PackOptions()
    packing.resolution = ATLAS_SIZE
    packing.padding = PADDING
    packing.bilinear = True
    # Its rotation by 90 degrees is an exchange of u and v, which mirrors the chart.
    packing.rotate_charts = False
    maker.generate(charting, packing)
    source, indices, uv = maker.get_mesh(0)
    # xatlas divides by the width and height of its page, which need not be square; texels must be.
    page = np.array([maker.width, maker.height], dtype=np.float64)
    return source, indices, np.clip(uv.astype(np.float64) * page / page.max(), 0.0, 1.0)
