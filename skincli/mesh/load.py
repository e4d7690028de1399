"""From a mesh file to a `Mesh`: units, parts, normals, winding, and the UV set in which light is computed."""

from __future__ import annotations

import hashlib
import importlib
import io
import json
import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skincli import diskcache
from skincli.errors import Fault, InputError, LimitError
from skincli.mesh import surface, unwrap, validate
from skincli.mesh.model import Material, Mesh, Part, Urgent
from skincli.mesh.surface import Floats

SLIVER = 1e-12
"""A triangle whose height is below this share of its longest edge has no area worth the name."""

EXTENT_ALLOWED = (1e-3, 1e7)
"""mm. Outside it a unit is certainly wrong: from a thousandth of a millimeter to ten kilometers."""

EXTENT_PLAUSIBLE = (5.0, 20_000.0)
"""mm. Outside it a note asks whether the unit is right."""

FARTHEST = 1e8
"""mm. How far from the origin the middle of a mesh may lie; a scene's own coordinates reach ten times as far."""

FARTHEST_UV = 1e6
"""Beyond it float32 tells no texels apart."""

MIRRORED_SHARE = 0.01
"""A vertex is split between mirrored and unmirrored faces when both have more than this share of its surface area."""


@dataclass(frozen=True)
class _Piece:
    """One geometry of a file, placed by the scene graph; arrays as in `Mesh`, None where the file has none."""

    name: str
    material: Material | None
    positions: Floats
    faces: NDArray[np.int64]
    normals: Floats | None
    uv: Floats | None


def load_mesh(
    path: Path,
    mm_per_unit: float,
    *,
    display_path: str | None = None,
    roots: Sequence[Path] = (),
    use_cache: bool = True,
) -> Mesh:
    """Load a mesh file: OBJ, PLY, STL, GLB or glTF, through trimesh.

    Every geometry becomes a part, placed by the scene graph. What a file lacks or gets wrong is made good, and
    `Mesh.notes` says so: missing or broken normals are computed, triangles without area dropped, inside-out surfaces
    turned, and UVs in which light cannot be computed accompanied by an atlas from xatlas.

    Winding decides over normals where both are sure: a closed surface of negative volume is turned around; an open one
    is turned when most of its area disagrees with the file's normals. Single normals stay as authored unless they
    disagree with every adjacent face.

    Parameters
    ----------
    path : the file
    mm_per_unit : millimeters per unit of the file, > 0
    display_path : the path as the user wrote it, for messages; `path` if None
    roots : folders besides the file's own to which it may refer (material files, buffers, textures)
    use_cache : whether an xatlas unwrap is read from and written to the disk cache

    Returns
    -------
    The mesh, centered on its bounding box; `Mesh.origin` holds the center in scene millimeters

    Raises
    ------
    InputError
        If the file is missing or damaged, has no triangle, not finite positions, indices out of range, refers to what
        lies outside its folder and the roots, or measures what no unit can explain.
    LimitError
        If it is too large.
    """
    name = display_path if display_path is not None else str(path)
    if not (math.isfinite(mm_per_unit) and mm_per_unit > 0.0):
        raise InputError(f"{name}: the unit is {mm_per_unit} mm; a finite length above 0 is allowed")
    notes: list[str] = []
    pieces = _read(path, name, roots, notes)
    for piece in pieces:
        validate.check_arrays(piece.positions, piece.faces, name, piece.name)
    return _assemble(pieces, mm_per_unit, name, notes, use_cache)


def load_builtin(name: str, detail: str | None, *, use_cache: bool = True) -> Mesh:
    """Return one of the meshes that skincli builds itself, from the disk cache when it was built before.

    Parameters
    ----------
    name : "head", "creature", ...
    detail : one of the mesh's levels of detail, or None for its default
    use_cache : whether the disk cache is read and written

    Raises
    ------
    InputError
        If there is no such mesh or level.
    """
    # The sources are the key: a changed builder, or anything in this folder it draws on, makes a new entry.
    digest = hashlib.blake2b(digest_size=16)
    for source in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(source.read_bytes())

    def make() -> diskcache.Arrays:
        mesh: Mesh = importlib.import_module("skincli.mesh.builtin").build(name, detail)
        return _pack(mesh)

    return _unpack(diskcache.arrays("builtin", f"{digest.hexdigest()}:{name}:{detail}", make, enabled=use_cache))


_ARRAYS = ("positions", "normals", "uv", "atlas_uv", "faces", "origin")


def _pack(mesh: Mesh) -> diskcache.Arrays:
    """Return a mesh as arrays; what is not an array goes into one JSON text."""
    entry: diskcache.Arrays = {name: getattr(mesh, name) for name in _ARRAYS}
    parts = []
    for number, part in enumerate(mesh.parts):
        material = part.material
        parts.append([part.name, part.start, part.stop, None if material is None else material.base_color])
        if material is not None and material.base_color_image is not None:
            entry[f"image{number}"] = material.base_color_image
    text = json.dumps({"parts": parts, "uv_is_unique": mesh.uv_is_unique, "notes": mesh.notes})
    return entry | {"text": np.frombuffer(text.encode(), dtype=np.uint8)}


def _unpack(entry: diskcache.Arrays) -> Mesh:
    """Return the mesh that `_pack` was given."""
    text = json.loads(entry["text"].tobytes())
    parts = []
    for number, (name, start, stop, color) in enumerate(text["parts"]):
        material = None if color is None else Material(tuple(color), entry.get(f"image{number}"))
        parts.append(Part(name, start, stop, material))
    arrays: dict[str, Any] = {name: entry[name] for name in _ARRAYS}
    return Mesh(**arrays, parts=tuple(parts), uv_is_unique=text["uv_is_unique"], notes=tuple(text["notes"]))


# ---------------------------------------------------------------- reading


def _read(path: Path, name: str, roots: Sequence[Path], notes: list[str]) -> list[_Piece]:
    """Return the geometries of a file in file units, their names unique."""
    suffix = path.suffix.lower()
    if suffix not in validate.SUFFIXES:
        validate.fail(name, f"meshes of type '{suffix}' are not read; allowed: {', '.join(validate.SUFFIXES)}")
    data = validate.read_file(path, name)
    references = validate.References(path.parent, roots, name)
    reader = {".obj": _read_obj, ".ply": _read_ply, ".stl": _read_stl}.get(suffix, _read_gltf)
    pieces = reader(data, references, path.stem, notes)
    names: list[str] = []
    for piece in pieces:
        # A name that another part already has gets the lowest number that is free.
        free = (f"{piece.name}_{number}" for number in range(2, len(pieces) + 2))
        names.append(piece.name if piece.name not in names else next(text for text in free if text not in names))
    return [replace(piece, name=unique) for piece, unique in zip(pieces, names, strict=True)]


def _trimesh(kind: str, data: bytes, name: str, **options: Any) -> dict[str, Any]:
    """Return what trimesh's loader for `kind` makes of `data`; what it raises becomes an InputError."""
    from trimesh.exchange.load import mesh_loaders

    # The loaders, not trimesh.load: they tell apart normals of the file from computed ones, and repair nothing.
    try:
        with warnings.catch_warnings():
            # NumPy only warns when a text stops being numbers half way.
            warnings.filterwarnings("error", message="string or file could not be read")
            loaded: dict[str, Any] = mesh_loaders[kind](file_obj=io.BytesIO(data), file_type=kind, **options)
    except MemoryError:
        raise LimitError(Fault("there is not enough memory to read the mesh; use a smaller one", name)) from None
    except Exception as error:  # whatever is wrong with a file, a third-party parser may raise anything
        text = " ".join(str(error).split())[:200]
        validate.fail(
            name, f"the file is damaged and cannot be read as {kind.upper()} ({text or type(error).__name__})"
        )
    return loaded


def _piece(geometry: dict[str, Any], name: str, material: Material | None, matrix: Floats | None = None) -> _Piece:
    """Return a geometry of trimesh's as a piece, in float64, with equal vertices merged, moved by a 4 x 4 matrix."""
    positions = np.asarray(geometry["vertices"], dtype=np.float64)
    # Minus zero would keep equal positions apart.
    positions = positions.reshape(-1, 3) + 0.0
    faces = np.asarray(geometry["faces"], dtype=np.int64)
    faces = np.concatenate([faces[:, (0, k, k + 1)] for k in range(1, faces.shape[1] - 1)])
    normals = geometry.get("vertex_normals")
    uv = getattr(geometry.get("visual"), "uv", None)
    per_vertex = [
        None if values is None or np.shape(values) != (len(positions), width) else np.asarray(values, dtype=np.float64)
        for values, width in ((normals, 3), (uv, 2))
    ]
    normals, uv = per_vertex
    if matrix is not None:
        positions = _apply(matrix[:3, :3], positions) + matrix[:3, 3]
        cofactors = np.stack([np.cross(matrix[(k + 1) % 3, :3], matrix[(k + 2) % 3, :3]) for k in range(3)])
        mirrored = np.linalg.det(matrix[:3, :3]) < 0.0
        if normals is not None:
            # The cofactor matrix is the inverse transpose but for its scale and, when mirroring, its sign.
            normals = _apply(-cofactors if mirrored else cofactors, normals)
        if mirrored:
            faces = faces[:, ::-1]
    return _Piece(name, material, positions, faces, normals, uv)


def _apply(matrix: Floats, vectors: Floats) -> Floats:
    """Return matrix times each row; one row at a time, for BLAS rounds equal rows differently, which parts welds."""
    x, y, z = vectors.T
    return np.stack([row[0] * x + row[1] * y + row[2] * z for row in matrix], axis=1)


def _read_obj(data: bytes, references: validate.References, stem: str, notes: list[str]) -> list[_Piece]:
    plain = validate.obj(data, references.name)
    materials: dict[str, Material] = {}
    for library in plain.libraries:
        path = references.locate(library)
        if path is None:
            notes.append(f"the material file '{library}' does not exist; its materials are left out")
        else:
            text = validate.read_file(path, f"{references.name}: {library}").decode("utf-8", "surrogateescape")
            materials |= validate.mtl(text, references, notes)
    loaded = _trimesh("obj", plain.text, references.name, split_objects=True, group_material=False, skip_materials=True)
    pieces = []
    for number, (group, material) in enumerate(plain.parts):
        several = sum(other == group for other, _ in plain.parts) > 1
        name = "_".join(text for text in (group, material if several or not group else "") if text) or stem
        pieces.append(_piece(loaded["geometry"][str(number)], name, materials.get(material)))
    return pieces


def _read_ply(data: bytes, references: validate.References, stem: str, notes: list[str]) -> list[_Piece]:
    plain = validate.ply(data, references.name)
    # trimesh's re-indexing by UV loses normals; only UVs that belong to corners need it.
    loaded = _trimesh("ply", plain.data, references.name, skip_materials=True, fix_texture=plain.uv_per_corner)
    material = None
    if plain.texture:
        material = validate.image_material(references, plain.texture, (1.0, 1.0, 1.0), notes)
    return [_piece(loaded, stem, material)]


def _read_stl(data: bytes, references: validate.References, stem: str, notes: list[str]) -> list[_Piece]:
    validate.stl(data, references.name)
    loaded = _trimesh("stl", data, references.name)
    geometries = loaded.get("geometry", {stem: loaded})
    if not geometries:
        validate.fail(references.name, "the mesh has no triangles; at least one is needed")
    return [_piece(geometry, name or stem, None) for name, geometry in geometries.items()]


def _read_gltf(data: bytes, references: validate.References, stem: str, notes: list[str]) -> list[_Piece]:
    plain = validate.gltf(data, references, notes)
    loaded = _trimesh("gltf", plain.text, references.name, resolver={"buffer": plain.buffer})
    number = {key: position for position, key in enumerate(loaded["geometry"])}
    frames = {loaded["base_frame"]: np.eye(4)}
    placed = []
    for edge in loaded["graph"]:
        frame = edge["frame_to"]
        frames[frame] = frames[edge["frame_from"]] @ edge["matrix"]
        if key := edge.get("geometry"):
            # trimesh walks backward; its frames begin with the node's number, which restores the file's order.
            placed.append((int(frame.partition("_")[0]), number[key], key, frame))
    return [
        _piece(loaded["geometry"][key], *plain.parts[position], frames[frame])
        for _, position, key, frame in sorted(placed)
    ]


# ---------------------------------------------------------------- assembling


def _assemble(pieces: list[_Piece], mm_per_unit: float, name: str, notes: list[str], use_cache: bool) -> Mesh:
    """Return the mesh of all pieces, in millimeters, with both UV sets."""
    with np.errstate(over="ignore", invalid="ignore"):
        pieces = [replace(piece, positions=piece.positions * mm_per_unit) for piece in pieces]
    origin = _center(pieces, name, notes)
    pieces = [_merge_equal(_drop_flat(replace(piece, positions=piece.positions - origin), notes)) for piece in pieces]
    pieces = [piece for piece in pieces if len(piece.faces)]
    validate.check_triangles(sum(len(piece.faces) for piece in pieces), name)

    offsets = np.cumsum([0] + [len(piece.positions) for piece in pieces])
    positions = np.concatenate([piece.positions for piece in pieces])
    faces = np.concatenate([piece.faces + offset for piece, offset in zip(pieces, offsets, strict=False)])
    part = np.repeat(np.arange(len(pieces)), [len(piece.positions) for piece in pieces])
    normals = np.concatenate([_or_missing(piece.normals, piece) for piece in pieces])
    uv = np.concatenate([_or_missing(piece.uv, piece)[:, :2] for piece in pieces])

    welded = _weld(positions, faces, part)
    normals, faces = _orient(positions, faces, normals, part, welded, notes)
    uv = _mend_uv(pieces, uv, part, notes)
    positions, normals, uv, faces = _split_mirrored(positions, normals, uv, faces)

    reasons = unwrap.why_not_unique(positions, uv, faces)
    if not reasons:
        atlas_uv = np.clip(uv, 0.0, 1.0)
    else:
        source, faces, atlas_uv = unwrap.atlas(positions, normals, faces, use_cache=use_cache)
        positions, normals, uv = positions[source], normals[source], uv[source]
        missing = np.isnan(uv[:, 0])
        uv[missing] = atlas_uv[missing]
        if not missing.all():
            notes.append(f"light is computed in UVs made by xatlas, for of the authored ones {'; '.join(reasons)}")
    stops = np.cumsum([len(piece.faces) for piece in pieces])
    parts = [
        Part(piece.name, int(stop) - len(piece.faces), int(stop), piece.material)
        for piece, stop in zip(pieces, stops, strict=True)
    ]
    return Mesh(
        positions=positions,
        normals=normals,
        uv=uv,
        atlas_uv=atlas_uv,
        faces=faces.astype(np.int32),
        parts=tuple(parts),
        origin=origin,
        uv_is_unique=bool(np.array_equal(uv, atlas_uv)) or not reasons,
        notes=tuple(dict.fromkeys(notes)),
    )


def _or_missing(values: Floats | None, piece: _Piece) -> Floats:
    """Return `values`, or NaN for each vertex of the piece when it has none."""
    return np.full((len(piece.positions), 3), np.nan) if values is None else values


def _center(pieces: list[_Piece], name: str, notes: list[str]) -> Floats:
    """Return the center of the bounding box, (3,) mm; raise InputError for a size that no unit explains."""
    used = [piece.positions[np.unique(piece.faces)] for piece in pieces if len(piece.faces)]
    validate.check_triangles(sum(len(piece.faces) for piece in pieces), name)
    low, high = np.min([p.min(axis=0) for p in used], axis=0), np.max([p.max(axis=0) for p in used], axis=0)
    with np.errstate(over="ignore", invalid="ignore"):
        size = high - low
        origin: Floats = 0.5 * low + 0.5 * high
    least, most = EXTENT_ALLOWED
    if not size.max() <= most or 0.0 < size.max() < least:
        validate.fail(
            name,
            f"the mesh measures {size.max():.3g} mm; {least:g} to {most:g} mm are allowed; correct the mesh's unit",
        )
    if not np.abs(origin).max() <= FARTHEST:
        validate.fail(
            name,
            f"the mesh's middle lies at {', '.join(f'{value:.3g}' for value in origin)} mm; up to {FARTHEST:g} mm are "
            "allowed; move it to the origin, or correct its unit",
        )
    if size.max() > 0.0 and not EXTENT_PLAUSIBLE[0] <= size.max() <= EXTENT_PLAUSIBLE[1]:
        extent = " x ".join(f"{value:.3g}" for value in size)
        notes.append(Urgent(f"the mesh measures {extent} mm; if that is not so, correct its unit"))
    return origin


def _drop_flat(piece: _Piece, notes: list[str]) -> _Piece:
    """Return the piece without triangles that have no area."""
    corners = piece.positions[piece.faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0.0)
    double_area = 2.0 * np.linalg.norm(surface.area_vectors(piece.positions, piece.faces), axis=1)
    solid = double_area > SLIVER * longest**2
    if dropped := int(np.count_nonzero(~solid)):
        notes.append(f"'{piece.name}': {dropped} triangles without area were dropped")
    return replace(piece, faces=piece.faces[solid])


def _merge_equal(piece: _Piece) -> _Piece:
    """Return the piece with vertices equal in position, normal and UV merged, and unused ones dropped.

    Files without indices would otherwise have a chart border along every edge.
    """
    used = np.unique(piece.faces)
    columns = [values[used] for values in (piece.positions, piece.normals, piece.uv) if values is not None]
    first, inverse = _unique_rows(np.concatenate(columns, axis=1))
    number = np.zeros(len(piece.positions), dtype=np.int64)
    number[used] = inverse
    keep = used[first]
    return replace(
        piece,
        positions=piece.positions[keep],
        faces=number[piece.faces],
        normals=None if piece.normals is None else piece.normals[keep],
        uv=None if piece.uv is None else piece.uv[keep],
    )


def _unique_rows(rows: NDArray[Any]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the first row of each group of equal rows, in order of appearance, and each row's group."""
    order = np.lexsort(rows.T)
    ordered = rows[order]
    fresh = np.ones(len(rows), dtype=bool)
    fresh[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    group = np.cumsum(fresh) - 1
    # lexsort is stable, so a group's first row is the earliest of its rows.
    first = order[fresh]
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    inverse = np.empty(len(rows), dtype=np.int64)
    inverse[order] = rank[group]
    return np.sort(first), inverse


def _weld(positions: Floats, faces: NDArray[np.int64], part: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return for each vertex the number of its point of the surface.

    Vertices at one position are one point within a part; across parts only where the parts' open borders meet, so
    that a surface cut by material shades without a seam and bodies that merely touch keep apart.
    """
    _, place = _unique_rows(positions)
    _, point = _unique_rows(np.stack([place, part], axis=1))
    border = np.zeros(len(point), dtype=bool)
    border[surface.border_edges(point[faces])[:, :2]] = True
    _, welded = _unique_rows(np.stack([place, np.where(border[point], -1, part)], axis=1))
    return welded


def _orient(
    positions: Floats,
    faces: NDArray[np.int64],
    normals: Floats,
    part: NDArray[np.int64],
    welded: NDArray[np.int64],
    notes: list[str],
) -> tuple[Floats, NDArray[np.int64]]:
    """Return unit normals and faces that agree on which side is outside; NaN normals are missing ones."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    # Parts that share points are one surface, and turned together.
    count = part.max() + 1
    table = coo_array((np.ones(len(part)), (part, count + welded)), shape=(count + welded.max() + 1,) * 2)
    body = connected_components(table, directed=False)[1][part[faces[:, 0]]]
    with np.errstate(invalid="ignore", divide="ignore"):
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    given = np.isfinite(normals.sum(axis=1))
    broken = int(np.count_nonzero(~given))
    if broken == len(given):
        notes.append("normals were computed: the file has none")
    elif broken:
        notes.append(f"{broken} of {len(given)} normals are missing or broken and were computed")
    normals = np.where(given[:, None], normals, 0.0)

    faces = faces.copy()
    for surface_number in np.unique(body):
        mine = body == surface_number
        inside_out = _signed_volume(positions, welded, faces[mine]) < 0.0
        agreement = _agreement(positions, faces[mine], normals)
        if inside_out or (agreement < 0.0 and not _is_closed(welded[faces[mine]])):
            faces[mine] = faces[mine][:, ::-1]
            agreement = -agreement
            name = "an inside-out surface was" if inside_out else "faces that disagree with the normals were"
            notes.append(f"{name} turned around")
        if agreement < 0.0:
            normals[np.unique(faces[mine])] *= -1.0
            notes.append("normals that point inward were turned around")

    points = np.zeros((welded.max() + 1, 3))
    points[welded] = positions
    smooth = surface.angle_weighted_normals(points, welded[faces])[welded]
    flat = surface.area_vectors(positions, faces)
    best = np.full(len(positions), -np.inf)
    for corner in range(3):
        np.maximum.at(best, faces[:, corner], np.einsum("ij,ij->i", flat, normals[faces[:, corner]]))
    backward = given & (best < 0.0)
    if backward.any():
        notes.append(f"{np.count_nonzero(backward)} normals that disagree with every adjacent face were computed anew")
    return np.where((given & ~backward)[:, None], normals, smooth), faces


def _is_closed(triangles: NDArray[np.int64]) -> bool:
    """Return whether each edge is used once in each direction: a surface with an inside, consistently wound."""
    edges = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
    base = triangles.max() + 1
    forward, backward = np.sort(edges[:, 0] * base + edges[:, 1]), np.sort(edges[:, 1] * base + edges[:, 0])
    return bool((forward == backward).all() and (np.diff(forward) > 0).all())


def _signed_volume(positions: Floats, welded: NDArray[np.int64], faces: NDArray[np.int64]) -> float:
    """Return the enclosed volume, mm³, negative when inside out; 0 for a surface that is not closed."""
    if not _is_closed(welded[faces]):
        return 0.0
    a, b, c = (positions[faces[:, corner]] - positions[faces[0, 0]] for corner in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def _agreement(positions: Floats, faces: NDArray[np.int64], normals: Floats) -> float:
    """Return the area whose winding agrees with the normals minus that which disagrees; missing normals are zero."""
    flat = surface.area_vectors(positions, faces)
    votes = np.sign(np.einsum("ij,ij->i", flat, normals[faces].sum(axis=1)))
    return float((votes * np.linalg.norm(flat, axis=1)).sum())


def _mend_uv(pieces: list[_Piece], uv: Floats, part: NDArray[np.int64], notes: list[str]) -> Floats:
    """Return UVs within FARTHEST_UV wherever the file gives a part UVs, and NaN throughout where it does not."""
    given = np.array([piece.uv is not None for piece in pieces])[part]
    for piece in pieces:
        if piece.uv is None:
            notes.append(f"'{piece.name}' has no UVs; xatlas made them")
    broken = given & ~(np.abs(uv) <= FARTHEST_UV).all(axis=1)
    if broken.any():
        notes.append(f"{np.count_nonzero(broken)} UVs that are not finite, or beyond {FARTHEST_UV:g}, were set to 0")
    uv = np.where(broken[:, None], 0.0, uv)
    return np.where(given[:, None], uv, np.nan)


def _split_mirrored(
    positions: Floats, normals: Floats, uv: Floats, faces: NDArray[np.int64]
) -> tuple[Floats, Floats, Floats, NDArray[np.int64]]:
    """Split the vertices that mirrored and unmirrored faces share, or their tangents would cancel.

    Folded slivers of a scanned layout are no mirroring: both sides need some share of the vertex's area.
    """
    signed = np.nan_to_num(surface.uv_areas(uv, faces))
    area = np.linalg.norm(surface.area_vectors(positions, faces), axis=1)
    mirrored = signed < -surface.TINY_UV_AREA
    shares = [
        np.bincount(faces.reshape(-1), weights=np.repeat(area * side, 3), minlength=len(uv))
        for side in (mirrored, signed > surface.TINY_UV_AREA)
    ]
    split = np.minimum(*shares) > MIRRORED_SHARE * np.maximum(*shares)
    number = len(uv) + np.cumsum(split) - 1
    faces = np.where(split[faces] & mirrored[:, None], number[faces], faces)
    source = np.concatenate([np.arange(len(uv)), np.flatnonzero(split)])
    return positions[source], normals[source], uv[source], faces
