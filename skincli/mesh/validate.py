"""Checks that a mesh file must pass before trimesh sees it, and the repairs without which trimesh would misread it.

trimesh 5.2 trusts what it reads: a glTF of 300 bytes may ask for 22 GiB, an index out of range is a bare IndexError,
NaN passes. It also reads some valid files wrongly, without a word: relative OBJ indices count from the end of the
file and index 0 is the first vertex; polygons of five corners stay uncut; glTF's sparse and normalized accessors,
TEXCOORD_1 and UVs without a material are lost; a comment in a PLY file's second line changes its encoding. So each
format is checked here and handed on in a plain form that trimesh reads right.
"""

from __future__ import annotations

import base64
import binascii
import io
import json
import math
import re
import struct
import urllib.parse
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from skincli.errors import Fault, InputError, LimitError
from skincli.mesh.model import Material, Urgent

MOST_BYTES = 512 * 2**20
MOST_JSON_BYTES = 64 * 2**20
MOST_TRIANGLES = 20_000_000

SUFFIXES = (".obj", ".ply", ".stl", ".glb", ".gltf")


def fail(name: str, message: str, line: int | None = None) -> NoReturn:
    """Raise InputError for the file the user called `name`."""
    raise InputError(Fault(message, name, line))


def read_file(path: Path, name: str) -> bytes:
    """Return a file's bytes.

    Raises
    ------
    InputError
        If it is missing, no regular file, empty or unreadable.
    LimitError
        If it is larger than MOST_BYTES.
    """
    try:
        if not path.exists():
            fail(name, "the file does not exist; check the path, which is relative to the file that names it")
        if not path.is_file():
            fail(name, "this is not a file; name a mesh file (" + ", ".join(SUFFIXES) + ")")
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise LimitError(
                Fault(f"the file has {size / 2**20:.0f} MiB; at most {MOST_BYTES / 2**20:.0f} are allowed", name)
            )
        data = path.read_bytes()
    except (OSError, ValueError) as error:
        fail(name, f"the file cannot be read ({error})")
    if not data:
        fail(name, "the file is empty")
    return data


@dataclass(frozen=True)
class References:
    """What a mesh file may refer to: files in its own folder or in a declared root.

    Parameters
    ----------
    folder : of the mesh file
    roots : further folders that are allowed
    name : the mesh file as the user wrote it, for messages
    """

    folder: Path
    roots: Sequence[Path]
    name: str

    def locate(self, reference: str) -> Path | None:
        """Return where `reference` lies, or None when there is no such file.

        Raises
        ------
        InputError
            If it is a URL or, symlinks resolved, leaves the allowed folders.
        """
        if re.match(r"[A-Za-z][A-Za-z0-9+.-]+:", reference):
            fail(self.name, f"refers to '{reference[:200]}'; only files are allowed, no URLs; copy it beside the mesh")
        found = None
        # Exporters on Windows write backslashes, which elsewhere are letters of a name.
        for spelling in dict.fromkeys((reference, reference.replace("\\", "/"))):
            try:
                path = (self.folder / spelling).resolve()
                allowed = any(path.is_relative_to(folder.resolve()) for folder in (self.folder, *self.roots))
                exists = path.is_file()
            except (OSError, RuntimeError, ValueError) as error:
                fail(self.name, f"refers to '{reference[:200]}', which is no usable path ({error})")
            if not allowed:
                fail(
                    self.name,
                    f"refers to '{reference[:200]}', outside the mesh's folder; "
                    "copy that file beside the mesh, or allow its folder with --asset-root",
                )
            if exists:
                found = found or path
        return found

    def read(self, reference: str) -> bytes:
        """Return the bytes of a file without which the mesh cannot be read."""
        path = self.locate(reference)
        if path is None:
            fail(self.name, f"refers to '{reference[:200]}', which does not exist; copy it beside the mesh")
        return read_file(path, self.name)


def decode_image(data: bytes) -> NDArray[np.uint8] | None:
    """Return an image's pixels, (h, w, 3 or 4) uint8, top row first; None when they cannot be decoded."""
    from PIL import Image

    try:
        with warnings.catch_warnings():
            # Pillow only warns of images that would fill the memory when they are merely huge.
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(io.BytesIO(data)) as image:
                alpha = "A" in image.getbands() or "transparency" in image.info
                return np.array(image.convert("RGBA" if alpha else "RGB"))
    except Exception:  # a decoder may raise anything on a damaged file
        return None


def image_material(
    references: References, reference: str, factor: tuple[float, float, float], notes: list[str]
) -> Material:
    """Return a material with the image file `reference`; without it, and with a note, when it cannot be had."""
    path = references.locate(reference)
    if path is None:
        notes.append(Urgent(f"the texture '{reference}' does not exist; its part keeps a plain color"))
        return Material(factor)
    pixels = decode_image(read_file(path, f"{references.name}: {reference}"))
    if pixels is None:
        notes.append(Urgent(f"the texture '{reference}' cannot be decoded; its part keeps a plain color"))
        return Material(factor)
    return Material(factor, pixels, path)


def check_triangles(count: int, name: str) -> None:
    """Raise LimitError for more than MOST_TRIANGLES triangles, InputError for none."""
    if count == 0:
        fail(name, "the mesh has no triangles; at least one of non-zero area is needed")
    if count > MOST_TRIANGLES:
        raise LimitError(Fault(f"the mesh has {count} triangles; at most {MOST_TRIANGLES} are allowed", name))


def check_arrays(positions: NDArray[np.float64], faces: NDArray[np.int64], name: str, part: str) -> None:
    """Raise InputError when a position is not finite or a face refers to a vertex that is not there."""
    bad = np.flatnonzero(~np.isfinite(positions).all(axis=1))
    if len(bad):
        fail(name, f"vertex {bad[0]} of '{part}' is {positions[bad[0]].tolist()}; finite numbers are allowed")
    if len(faces) and (faces.min() < 0 or faces.max() >= len(positions)):
        worst = faces.min() if faces.min() < 0 else faces.max()
        fail(name, f"'{part}' uses vertex {worst}, but has {len(positions)} vertices; export the mesh again")


# ---------------------------------------------------------------- OBJ


@dataclass(frozen=True)
class ObjFile:
    """An OBJ file in the form trimesh reads right.

    Parameters
    ----------
    text : vertices, then one object "o NUMBER" per part, of triangles with absolute indices
    parts : (object, material) names of each part; empty where the file gives none
    libraries : the material files it names
    """

    text: bytes
    parts: tuple[tuple[str, str], ...]
    libraries: tuple[str, ...]


def obj(data: bytes, name: str) -> ObjFile:
    """Check an OBJ file and cut its polygons; every message names the line.

    Raises
    ------
    InputError
        If a number is missing or not finite, an index is 0 or out of range, a face has fewer than 3 corners, or
        there is no face.
    """
    lines = data.decode("utf-8-sig", "surrogateescape").splitlines()
    if b"\\" in data:
        _join_continued(lines)
    if b"#" in data:
        lines = [line.partition("#")[0] for line in lines]
    lines = [line.strip() for line in lines]
    found: dict[str, list[int]] = {kind: [] for kind in ("", *_OBJ_KINDS.values())}
    for row, line in enumerate(lines):
        found[_OBJ_KINDS.get(line[:2], "")].append(row)

    tables = [_obj_table(lines, found[kind], kind, least, width, name) for kind, least, width in _OBJ_NUMBERS]
    rows = found["f"]
    if not rows:
        fail(name, "there is no face; at least one triangle is needed")
    corners = [lines[row][1:] for row in rows]
    counts = np.fromiter((len(text.split()) for text in corners), dtype=np.int64)
    if counts.min() < 3:
        at = int(np.argmax(counts < 3))
        fail(name, f"a face has {counts[at]} corners; 3 or more are needed", rows[at] + 1)
    check_triangles(int((counts - 2).sum()), name)
    indices = _obj_indices(corners, counts, rows, found, name)
    triangles = _fans(counts)

    labels, parts = _obj_labels(lines, found)
    part_of_face = np.repeat(labels[rows], counts - 2)
    # A corner without UV or normal among others that have them gets one that later counts as missing.
    tables += ["vt 0 0\n", "vn 0 0 0\n"]
    spare = {1: len(found["vt"]) + 1, 2: len(found["vn"]) + 1}
    used = np.unique(part_of_face)
    for number, part in enumerate(used):
        chosen = indices[triangles[part_of_face == part]].reshape(-1, 3)
        given = chosen.any(axis=0)
        for column, missing in spare.items():
            chosen[chosen[:, column] == 0, column] = missing
        corner = {(True, True): "%d/%d/%d", (True, False): "%d/%d", (False, True): "%d//%d"}.get(
            (bool(given[1]), bool(given[2])), "%d"
        )
        face = f"f {corner} {corner} {corner}\n"
        text = face * (len(chosen) // 3) % tuple(chosen[:, given].reshape(-1).tolist())
        tables.append(f"o {number}\n{text}")
    libraries = tuple(lines[row][6:].strip() for row in found["mtllib"] if lines[row].startswith("mtllib"))
    return ObjFile("".join(tables).encode("ascii"), tuple(parts[part] for part in used), libraries)


_OBJ_KINDS = {
    "v ": "v", "v\t": "v", "vt": "vt", "vn": "vn", "f ": "f", "f\t": "f",
    "o ": "o", "o\t": "o", "us": "usemtl", "mt": "mtllib",
}  # fmt: skip
"""An OBJ line's first two characters -> its kind."""

_OBJ_NUMBERS = (("v", 3, 3), ("vt", 1, 2), ("vn", 3, 3))
"""Kind, fewest numbers on a line, numbers that are used (of a vertex neither weight nor color)."""


def _obj_table(lines: list[str], rows: list[int], kind: str, least: int, width: int, name: str) -> str:
    """Return the lines of one kind with `width` numbers each.

    Raises
    ------
    InputError
        At the first line with too few, or one that is no number. A position must also be finite; a UV or normal that
        is not is made good later.
    """
    texts = [lines[row][len(kind) :] for row in rows]
    if any(len(text.split()) != width for text in texts):
        for row, text in zip(rows, texts, strict=True):
            if len(text.split()) < least:
                fail(name, f"'{kind}' has {len(text.split())} numbers; {least} are needed", row + 1)
        texts = [" ".join([*text.split(), "0"][:width]) for text in texts]

    def sound(text: str) -> bool:
        try:
            return all(map(math.isfinite, map(float, text.split()))) or kind != "v"
        except ValueError:
            return False

    if not sound(" ".join(texts)):
        at = next(number for number, text in enumerate(texts) if not sound(text))
        fail(name, f"'{kind} {texts[at].strip()[:80]}' is not {width} finite numbers", rows[at] + 1)
    return "".join([f"{kind} {text}\n" for text in texts])


def _join_continued(lines: list[str]) -> None:
    """Append to each line that ends in a backslash the next one, which stays as an empty line, so that numbers hold."""
    for row in range(len(lines) - 2, -1, -1):
        if lines[row].endswith("\\"):
            lines[row] = lines[row][:-1] + " " + lines[row + 1]
            lines[row + 1] = ""


def _obj_indices(
    corners: list[str], counts: NDArray[np.int64], rows: list[int], found: dict[str, list[int]], name: str
) -> NDArray[np.int64]:
    """Return (corners, 3) indices of vertex, UV and normal: absolute, from 1; 0 where a corner gives none."""
    padding = ("/0/0", "/0", "")

    def parse(text: str) -> NDArray[np.int64]:
        words = text.split()
        padded = " ".join([word + padding[word.count("/")] for word in words]) + " "
        plain = padded.replace("//", "/0/").replace("/ ", "/0 ").replace("/", " ")
        indices = np.fromiter(map(int, plain.split()), dtype=np.int64)
        if len(indices) != 3 * len(words):
            raise ValueError(text)
        return indices.reshape(-1, 3)

    try:
        indices = parse(" ".join(corners))
    except (ValueError, IndexError, OverflowError):
        for row, text in zip(rows, corners, strict=True):
            try:
                parse(text)
            except (ValueError, IndexError, OverflowError):
                fail(name, f"the face '{text.strip()[:80]}' is not of the form v, v/vt, v//vn or v/vt/vn", row + 1)
        raise  # one of the faces has just failed together with the others, so this is our own bug
    line_of = np.repeat(rows, counts)
    for column, kind in enumerate(("v", "vt", "vn")):
        defined = len(found[kind])
        # A relative index counts back from the last vertex above its own line.
        above = np.searchsorted(found[kind], line_of)
        index = indices[:, column]
        resolved = np.where(index < 0, above + 1 + index, index)
        bad = (resolved > defined) | ((resolved < 1) & ((index != 0) | (column == 0)))
        if bad.any():
            at = int(np.argmax(bad))
            fail(
                name,
                f"a face uses {kind} {index[at]}, but the file defines {defined}; "
                f"1 to {defined}, or -1 to -{above[at]} counted back, are allowed",
                int(line_of[at]) + 1,
            )
        indices[:, column] = resolved
    return indices


def _fans(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the triangles, (k, 3) positions in the flat list of corners, of polygons with `counts` corners."""
    first = np.repeat(np.cumsum(counts) - counts, counts - 2)
    step = np.arange(len(first)) - np.repeat(np.cumsum(counts - 2) - (counts - 2), counts - 2)
    return np.stack([first, first + step + 1, first + step + 2], axis=1)


def _obj_labels(lines: list[str], found: dict[str, list[int]]) -> tuple[NDArray[np.int64], list[tuple[str, str]]]:
    """Return for each line the part it belongs to, and the parts' (object, material) names in order of appearance."""
    labels = np.zeros(len(lines), dtype=np.int64)
    parts: dict[tuple[str, str], int] = {}
    group = material = ""
    since = 0
    for row in [*sorted(found["o"] + found["usemtl"]), len(lines)]:
        labels[since:row] = parts.setdefault((group, material), len(parts))
        since = row
        if row < len(lines):
            word, _, rest = lines[row].replace("\t", " ").partition(" ")
            group = rest.strip() if word == "o" else group
            material = rest.strip() if word == "usemtl" else material
    return labels, list(parts)


def mtl(text: str, references: References, notes: list[str]) -> dict[str, Material]:
    """Return the materials of an MTL file: Kd as a linear factor; map_Kd stands in its place where there is one."""
    options = r"(?:-(?:blendu|blendv|cc|clamp|bm|boost|texres|imfchan|type)\s+\S+\s+|-mm\s+\S+\s+\S+\s+"
    options += r"|-[ost](?:\s+[-+]?[\d.]+(?:[eE][-+]?\d+)?(?=\s)){1,3}\s+)*"
    colors: dict[str, tuple[float, float, float]] = {}
    images: dict[str, str] = {}
    current = ""
    for line in text.splitlines():
        word, _, rest = line.strip().partition(" ")
        if word == "newmtl":
            current = rest.strip()
            colors[current] = Material.base_color
        elif word == "Kd":
            try:
                red, green, blue = (float(number) for number in rest.split())
            except ValueError:
                continue  # "Kd spectral FILE" and "Kd xyz", which nobody writes
            if all(math.isfinite(value) for value in (red, green, blue)):
                colors[current] = (red, green, blue)
        elif word.lower() == "map_kd" and (match := re.fullmatch(options + "(.+)", rest.strip())):
            images[current] = match[1].strip()
    return {
        name: image_material(references, images[name], (1.0, 1.0, 1.0), notes) if name in images else Material(color)
        for name, color in colors.items()
    }


# ---------------------------------------------------------------- STL


def stl(data: bytes, name: str) -> None:
    """Raise InputError unless the size of a binary STL file agrees with its count, or it is an ASCII one."""
    if len(data) >= 84:
        (count,) = struct.unpack_from("<I", data, 80)
        if len(data) == 84 + 50 * count:
            return check_triangles(count, name)
    if re.match(rb"\s*solid\b", data) and b"facet" in data:
        return check_triangles(len(re.findall(rb"\bendfacet\b", data)), name)
    if len(data) < 84:
        fail(name, f"the file has {len(data)} bytes; an STL file starts with a header of 84")
    fail(name, f"the header counts {count} triangles ({84 + 50 * count} bytes), but the file has {len(data)} bytes")


# ---------------------------------------------------------------- PLY

_PLY_TYPES = {
    "char": "b", "int8": "b", "uchar": "B", "uint8": "B", "short": "h", "int16": "h", "ushort": "H", "uint16": "H",
    "int": "i", "int32": "i", "uint": "I", "uint32": "I", "float": "f", "float32": "f", "double": "d", "float64": "d",
}  # fmt: skip


@dataclass
class _PlyElement:
    """One element of a PLY header; a property is (name, type code, type code of its count or "")."""

    name: str
    count: int
    properties: list[tuple[str, str, str]] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class PlyFile:
    """A PLY file in the form trimesh reads right.

    Parameters
    ----------
    data : the file with a plain header and, when binary, polygons of one size
    texture : the image its header names, or ""
    uv_per_corner : whether faces, not vertices, carry the UVs
    """

    data: bytes
    texture: str
    uv_per_corner: bool


def ply(data: bytes, name: str) -> PlyFile:
    """Check a PLY file: its header, and its element counts against its size.

    Raises
    ------
    InputError
        If the header is damaged, the data are shorter than it promises, or there is no face.
    """
    if not re.match(rb"ply\s", data):
        fail(name, "the file does not begin with 'ply'; it is no PLY file")
    end = re.search(rb"^end_header[ \t]*\r?\n", data[:65536], re.MULTILINE)
    if end is None:
        fail(name, "the PLY header has no end_header")
    header = data[: end.start()].decode("utf-8", "replace").splitlines()
    encoding, texture, elements = _ply_header(header, name)
    by_name = {element.name: element for element in elements}
    if not {"x", "y", "z"} <= {prop[0] for prop in by_name.get("vertex", _PlyElement("", 0)).properties}:
        fail(name, "the PLY header has no vertex element with x, y and z")
    body = data[end.end() :]
    face = by_name.get("face", _PlyElement("", 0))
    check_triangles(face.count, name)
    if encoding == "ascii":
        promised, given, what = sum(element.count for element in elements), len(body.split(b"\n")), "lines"
    else:
        promised, given, what = sum(_ply_least(element) for element in elements), len(body), "bytes"
    if given < promised:
        fail(
            name, f"the PLY header promises at least {promised} {what} of data, but there are {given}; the file is cut"
        )
    if encoding != "ascii":
        body = _ply_cut_polygons(body, elements, "<" if "little" in encoding else ">", name)
    text = [f"ply\nformat {encoding} 1.0"]
    for element in elements:
        text += [f"element {element.name} {element.count}", *element.lines]
    plain = ("\n".join(text) + "\nend_header\n").encode() + body
    return PlyFile(plain, texture, any(prop[0] == "texcoord" for prop in face.properties))


def _ply_header(header: list[str], name: str) -> tuple[str, str, list[_PlyElement]]:
    """Return encoding, texture file and elements; raise InputError, with its line, for what is not understood."""
    encoding, texture = "", ""
    elements: list[_PlyElement] = []
    for number, line in enumerate(header, 1):
        match line.split():
            case ["format", ("ascii" | "binary_little_endian" | "binary_big_endian") as encoding, _]:
                pass
            case ["element", element, count] if count.isdecimal():
                elements.append(_PlyElement(element, int(count)))
            case ["property", "list", count, kind, prop] if elements and {count, kind} <= _PLY_TYPES.keys():
                elements[-1].properties.append((prop, _PLY_TYPES[kind], _PLY_TYPES[count]))
                elements[-1].lines.append(line.strip())
            case ["property", kind, prop] if elements and kind in _PLY_TYPES:
                elements[-1].properties.append((prop, _PLY_TYPES[kind], ""))
                elements[-1].lines.append(line.strip())
            case ["comment", word, *_] if word.lower() == "texturefile":
                texture = line.split(None, 2)[2].strip() if len(line.split()) > 2 else ""
            case ["ply" | "comment" | "obj_info", *_] | []:
                pass
            case _:
                fail(name, f"the PLY header has '{line.strip()[:80]}', which is not understood", number)
    if not encoding:
        fail(name, "the PLY header has no format line")
    return encoding, texture, elements


def _ply_least(element: _PlyElement) -> int:
    """Return the fewest bytes a binary element can have: its lists empty."""
    return element.count * sum(struct.calcsize("=" + (listed or kind)) for _, kind, listed in element.properties)


def _ply_cut_polygons(body: bytes, elements: list[_PlyElement], order: str, name: str) -> bytes:
    """Cut the faces of a binary file into triangles where they have different numbers of corners.

    trimesh takes the first face's number for all of them.
    """
    at = 0
    for element in elements:
        if element.name == "face":
            break
        if any(listed for _, _, listed in element.properties):
            return body
        at += _ply_least(element)
    start = at
    rows: list[dict[str, tuple[float, ...]]] = []
    try:
        for _ in range(element.count):
            row = {}
            for prop, kind, listed in element.properties:
                length = 1
                if listed:
                    (length,) = struct.unpack_from(order + listed, body, at)
                    at += struct.calcsize("=" + listed)
                row[prop] = struct.unpack_from(f"{order}{length}{kind}", body, at)
                at += length * struct.calcsize("=" + kind)
            rows.append(row)
    except struct.error:
        fail(name, "the PLY file ends amid its faces; it is cut or damaged")
    index = next((prop for prop, _, listed in element.properties if listed and prop.startswith("vertex_ind")), "")
    if not index:
        fail(name, "the PLY header has no face property vertex_indices")
    counts = np.array([len(row[index]) for row in rows])
    if counts.min() == counts.max() and counts.min() >= 3:
        return body
    if counts.min() < 3:
        fail(name, f"face {int(np.argmin(counts))} has {counts.min()} corners; 3 or more are needed")
    corners = np.array([corner for row in rows for corner in row[index]], dtype=np.int64)[_fans(counts)]
    columns = [np.full((len(corners), 1), 3, "B"), corners.astype(order + "i4")]
    element.lines = ["property list uchar int vertex_indices"]
    if any(prop == "texcoord" for prop, _, _ in element.properties):
        flat = [value for row in rows for value in row["texcoord"]]
        if len(flat) != 2 * counts.sum():
            fail(name, "the faces' texcoord lists do not have two numbers per corner")
        uv = np.array(flat).reshape(-1, 2)[_fans(counts)].reshape(-1, 6)
        columns += [np.full((len(corners), 1), 6, "B"), uv.astype(order + "f8")]
        element.lines.append("property list uchar double texcoord")
    element.count = len(corners)
    record = np.hstack([np.ascontiguousarray(column).view("B").reshape(len(corners), -1) for column in columns])
    return body[:start] + record.tobytes() + body[at:]


# ---------------------------------------------------------------- glTF

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_EXTENSIONS = re.compile(r"KHR_materials_\w+|KHR_mesh_quantization|KHR_texture_transform|KHR_lights_punctual|\w+_webp")


@dataclass(frozen=True)
class GltfFile:
    """A glTF or GLB file in the form trimesh reads right.

    Parameters
    ----------
    text : its JSON: the nodes and triangles of its scene, nothing else; buffer 0 has the URI "buffer"
    buffer : float32 positions, normals and UVs, uint32 indices
    parts : (name, material) of each primitive, in order
    """

    text: bytes
    buffer: bytes
    parts: tuple[tuple[str, Material | None], ...]


def gltf(data: bytes, references: References, notes: list[str]) -> GltfFile:
    """Check a glTF or GLB file: every size and index it states against what it holds.

    Raises
    ------
    InputError
        If it is damaged, asks for data it does not have or for an extension that is not read, or refers to a file
        outside its folder.
    LimitError
        If it holds more than MOST_TRIANGLES triangles.
    """
    return _GltfReader(data, references, notes).read()


class _GltfReader:
    """The state of reading one file: its JSON, its buffers, and what has been gathered for trimesh."""

    def __init__(self, data: bytes, references: References, notes: list[str]) -> None:
        self.references = references
        self.notes = notes
        self.tree, self.binary = self._chunks(data)
        self.buffers: dict[int, bytes] = {}
        self.materials: dict[int, Material] = {}
        self.plain: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "materials": [{}],
            "accessors": [],
            "bufferViews": [],
        }
        self.blobs: list[bytes] = []

    def fail(self, message: str) -> NoReturn:
        fail(self.references.name, message)

    def read(self) -> GltfFile:
        try:
            return self._read()
        except (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError) as error:
            self.fail(f"the glTF structure is damaged ({type(error).__name__}: {error}); export the mesh again")

    def _chunks(self, data: bytes) -> tuple[dict[str, Any], bytes]:
        """Return the JSON and, of a GLB, the binary chunk."""
        text, binary = data, b""
        if data[:4] == b"glTF":
            chunks: list[tuple[bytes, bytes]] = []
            if len(data) < 20:
                self.fail(f"the file has {len(data)} bytes; a GLB file has at least 20")
            _, version, length = struct.unpack_from("<4sII", data)
            if version != 2:
                self.fail(f"the file is GLB version {version}; version 2 is allowed")
            if length > len(data):
                self.fail(f"the header promises {length} bytes, but there are {len(data)}; the file is cut")
            at = 12
            while at + 8 <= length and len(chunks) < 2:
                size, kind = struct.unpack_from("<I4s", data, at)
                if at + 8 + size > length:
                    self.fail(f"a chunk promises {size} bytes, but {length - at - 8} are left; the file is damaged")
                chunks.append((kind, data[at + 8 : at + 8 + size]))
                at += 8 + size
            if chunks[0][0] != b"JSON":
                self.fail("the first chunk is not JSON; the file is damaged")
            text = chunks[0][1]
            binary = next((chunk for kind, chunk in chunks if kind == b"BIN\0"), b"")
        if len(text) > MOST_JSON_BYTES:
            raise LimitError(
                Fault(f"its JSON has {len(text)} bytes; at most {MOST_JSON_BYTES} are allowed", self.references.name)
            )
        try:
            tree = json.loads(text.decode("utf-8-sig"))
        except (ValueError, RecursionError) as error:
            self.fail(f"its JSON is damaged ({error})")
        if not isinstance(tree, dict) or not str((tree.get("asset") or {}).get("version", "")).startswith("2"):
            self.fail("this is not glTF 2: there is no asset.version that begins with 2")
        return tree, binary

    def _at(self, what: str, index: object) -> dict[str, Any]:
        """Return entry `index` of the list `what`; raise InputError when it has none."""
        entries = self.tree.get(what, [])
        if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(entries):
            self.fail(f"{what}[{index}] is referred to, but there are {len(entries)}; export the mesh again")
        entry: dict[str, Any] = entries[index]
        return entry

    def _read(self) -> GltfFile:
        for extension in self.tree.get("extensionsRequired", []):
            if not _EXTENSIONS.fullmatch(extension):
                self.fail(f"it needs the extension {extension}, which is not read; export the mesh without it")
        nodes, roots = self._nodes()
        triangles: dict[int, int] = {}
        parts: list[tuple[str, Material | None]] = []
        meshes: list[dict[str, Any]] = []
        for node in nodes:
            if "mesh" not in node:
                continue
            mesh = node["mesh"]
            if mesh not in triangles:
                primitives, looks, triangles[mesh] = self._mesh(mesh)
                parts += looks
                meshes.append({"name": f"mesh {len(meshes)}", "primitives": primitives})
        used = {mesh: number for number, mesh in enumerate(triangles)}
        total = sum(triangles[node["mesh"]] for node in nodes if "mesh" in node)
        check_triangles(total, self.references.name)
        for node in nodes:
            if "mesh" in node:
                node["mesh"] = used[node["mesh"]]
        buffer = b"".join(self.blobs)
        self.plain |= {"nodes": nodes, "meshes": meshes, "scene": 0, "scenes": [{"nodes": roots}]}
        self.plain["buffers"] = [{"uri": "buffer", "byteLength": len(buffer)}]
        return GltfFile(json.dumps(self.plain).encode(), buffer, tuple(parts))

    def _nodes(self) -> tuple[list[dict[str, Any]], list[int]]:
        """Return the nodes of the scene, with what places geometry only, and its roots, both renumbered."""
        given = self.tree.get("nodes", [])
        if not given:
            # A file may hold meshes alone, for others to place; alone they stand at the origin.
            count = len(self.tree.get("meshes", []))
            return [{"mesh": mesh} for mesh in range(count)], list(range(count))
        scenes = self.tree.get("scenes")
        if scenes:
            roots = self._at("scenes", self.tree.get("scene", 0)).get("nodes", [])
        else:
            children = {child for node in given for child in node.get("children", [])}
            roots = [index for index in range(len(given)) if index not in children]
        order: list[int] = []
        pending = list(reversed(roots))
        seen = set()
        while pending:
            index = pending.pop()
            node = self._at("nodes", index)
            if index in seen:
                self.fail(f"nodes[{index}] has several parents or is its own ancestor; export the mesh again")
            seen.add(index)
            order.append(index)
            pending += reversed(node.get("children", []))
        number = {index: position for position, index in enumerate(order)}
        nodes = []
        for index in order:
            node = given[index]
            plain: dict[str, Any] = {"children": [number[child] for child in node.get("children", [])]}
            for key, length in (("matrix", 16), ("translation", 3), ("rotation", 4), ("scale", 3)):
                if key in node:
                    values = [float(value) for value in node[key]]
                    if len(values) != length or not all(map(math.isfinite, values)):
                        self.fail(f"nodes[{index}].{key} is {node[key]}; {length} finite numbers are allowed")
                    plain[key] = values
            if "mesh" in node:
                plain["mesh"] = node["mesh"]
            nodes.append(plain)
        return nodes, [number[root] for root in roots]

    def _mesh(self, index: int) -> tuple[list[dict[str, Any]], list[tuple[str, Material | None]], int]:
        """Return a mesh's primitives for trimesh, their names and materials, and its number of triangles."""
        mesh = self._at("meshes", index)
        plain, looks, triangles = [], [], 0
        for primitive in mesh["primitives"]:
            mode = primitive.get("mode", 4)
            if mode not in (4, 5, 6):
                self.notes.append("points and lines were left out")
                continue
            attributes = primitive["attributes"]
            positions = self._accessor(attributes["POSITION"], 3)
            count = len(positions)
            if "indices" in primitive:
                indices = self._accessor(primitive["indices"], 1).reshape(-1)
                if indices.max() >= count:
                    self.fail(f"meshes[{index}] uses vertex {indices.max():.0f}, but has {count} vertices")
            else:
                indices = np.arange(count)
            faces = self._triangles(indices.astype(np.int64), mode)
            triangles += len(faces)
            given = {"POSITION": self._add(positions)}
            if "NORMAL" in attributes:
                given["NORMAL"] = self._add(self._same_count(self._accessor(attributes["NORMAL"], 3), count))
            material = self._at("materials", primitive["material"]) if "material" in primitive else {}
            texture = (material.get("pbrMetallicRoughness") or {}).get("baseColorTexture") or {}
            transform = (texture.get("extensions") or {}).get("KHR_texture_transform") or {}
            coordinates = f"TEXCOORD_{transform.get('texCoord', texture.get('texCoord', 0))}"
            if coordinates in attributes:
                uv = self._same_count(self._accessor(attributes[coordinates], 2), count)
                given["TEXCOORD_0"] = self._add(_transform_uv(uv, transform))
            plain.append({"attributes": given, "indices": self._add(faces.reshape(-1, 1)), "material": 0})
            name = mesh.get("name") or f"mesh {index}"
            if len(mesh["primitives"]) > 1 and material.get("name"):
                name = f"{name}_{material['name']}"
            looks.append((str(name), self._material(primitive["material"]) if "material" in primitive else None))
        return plain, looks, triangles

    def _triangles(self, indices: NDArray[np.int64], mode: int) -> NDArray[np.int64]:
        """Return (k, 3) vertex indices from a list (mode 4), a strip (5) or a fan (6)."""
        if mode == 4:
            if len(indices) % 3:
                self.fail(f"a list of triangles has {len(indices)} indices, which is not a multiple of 3")
            return indices.reshape(-1, 3)
        if mode == 6:
            return np.stack([np.full(len(indices) - 2, indices[0]), indices[1:-1], indices[2:]], axis=1)
        strip = np.stack([indices[:-2], indices[1:-1], indices[2:]], axis=1)
        strip[1::2, :2] = strip[1::2, 1::-1]
        return strip

    def _same_count(self, values: NDArray[np.float32], count: int) -> NDArray[np.float32]:
        if len(values) != count:
            self.fail(f"a primitive has {count} positions but {len(values)} normals or UVs")
        return values

    def _accessor(self, index: object, width: int) -> NDArray[Any]:
        """Return an accessor's values, (count, width); normalized integers as the fractions they stand for."""
        accessor = self._at("accessors", index)
        if "bufferView" not in accessor:
            self.fail(f"accessors[{index}] has no data; export the mesh without compression")
        if _WIDTHS.get(accessor["type"]) != width:
            self.fail(f"accessors[{index}] is {accessor['type']}; {width} numbers per item are expected")
        values = self._items(accessor, accessor["count"], accessor["componentType"], width, f"accessors[{index}]")
        if "sparse" in accessor:
            sparse = accessor["sparse"]
            where = self._items(sparse["indices"], sparse["count"], sparse["indices"]["componentType"], 1, "sparse")
            if where.max() >= len(values):
                self.fail(f"accessors[{index}] replaces item {where.max()}, but has {len(values)}")
            values = values.copy()
            values[where[:, 0]] = self._items(
                sparse["values"], sparse["count"], accessor["componentType"], width, "sparse"
            )
        if accessor.get("normalized") and values.dtype.kind in "iu":
            values = np.maximum(values / np.iinfo(values.dtype).max, -1.0)
        return values

    def _items(self, source: dict[str, Any], count: object, component: int, width: int, what: str) -> NDArray[Any]:
        """Return (count, width) numbers from the buffer view that `source` names."""
        view = self._at("bufferViews", source["bufferView"])
        dtype = np.dtype(_COMPONENTS[component])
        row = dtype.itemsize * width
        stride = view.get("byteStride", row)
        start, held = source.get("byteOffset", 0), view["byteLength"]
        offset = view.get("byteOffset", 0)
        buffer = self._buffer(view["buffer"])
        for number in (count, stride, start, held, offset):
            if not isinstance(number, int) or number < 0:
                self.fail(f"{what} has {number} for a size; integers of 0 or more are allowed")
        if count == 0 or offset + held > len(buffer) or start + (count - 1) * stride + row > held:  # type: ignore[operator]
            self.fail(
                f"{what} asks for {count} items of {row} bytes, but its buffer view has {held} bytes "
                f"of a buffer of {len(buffer)}; the file is cut or damaged"
            )
        return np.ndarray((count, width), dtype, buffer, offset + start, (stride, dtype.itemsize))  # type: ignore[arg-type]

    def _buffer(self, index: int) -> bytes:
        if index not in self.buffers:
            buffer = self._at("buffers", index)
            data = self._uri(buffer["uri"]) if "uri" in buffer else self.binary
            if len(data) < buffer["byteLength"]:
                self.fail(f"buffers[{index}] promises {buffer['byteLength']} bytes, but has {len(data)}; it is cut")
            self.buffers[index] = data
        return self.buffers[index]

    def _uri(self, uri: str) -> bytes:
        if not uri.startswith("data:"):
            return self.references.read(urllib.parse.unquote(uri))
        try:
            return base64.b64decode(uri.partition("base64,")[2], validate=True)
        except binascii.Error as error:
            self.fail(f"an embedded data URI is damaged ({error})")

    def _add(self, values: NDArray[Any]) -> int:
        """Append an array to the plain buffer and return its accessor."""
        blob = values.astype("<u4" if values.dtype == np.int64 else "<f4").tobytes()
        start = sum(view["byteLength"] for view in self.plain["bufferViews"][-1:])
        start += sum(view["byteOffset"] for view in self.plain["bufferViews"][-1:])
        index = len(self.plain["accessors"])
        self.plain["bufferViews"].append({"buffer": 0, "byteOffset": start, "byteLength": len(blob)})
        kind = next(kind for kind, width in _WIDTHS.items() if width == values.shape[1])
        component = 5125 if values.dtype == np.int64 else 5126
        self.plain["accessors"].append(
            {"bufferView": index, "componentType": component, "count": len(values), "type": kind}
        )
        self.blobs.append(blob)
        return index

    def _material(self, index: int) -> Material:
        """Return a material's base color; its texture when there is one that can be decoded."""
        if index in self.materials:
            return self.materials[index]
        look = self._at("materials", index).get("pbrMetallicRoughness") or {}
        red, green, blue = (float(value) for value in look.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0))[:3])
        material = Material((red, green, blue))
        if "baseColorTexture" in look:
            texture = self._at("textures", look["baseColorTexture"]["index"])
            webp = (texture.get("extensions") or {}).get("EXT_texture_webp") or {}
            source = webp.get("source", texture.get("source"))
            if source is None:
                self.notes.append("a texture has no image that is read; its part keeps a plain color")
            else:
                material = self._image_material(source, material.base_color)
        self.materials[index] = material
        return material

    def _image_material(self, source: int, factor: tuple[float, float, float]) -> Material:
        image = self._at("images", source)
        if "bufferView" not in image and not image["uri"].startswith("data:"):
            return image_material(self.references, urllib.parse.unquote(image["uri"]), factor, self.notes)
        if "bufferView" in image:
            view = self._at("bufferViews", image["bufferView"])
            size = view["byteLength"]
            data = self._items({"bufferView": image["bufferView"]}, size, 5121, 1, f"images[{source}]").tobytes()
        else:
            data = self._uri(image["uri"])
        pixels = decode_image(data)
        if pixels is None:
            self.notes.append(Urgent(f"the embedded texture {source} cannot be decoded; its part keeps a plain color"))
        return Material(factor, pixels)


def _transform_uv(uv: NDArray[Any], transform: dict[str, Any]) -> NDArray[Any]:
    """Return UVs, (n, 2), scaled, turned and shifted as KHR_texture_transform says; v grows downward here."""
    if not transform:
        return uv
    u, v = (uv * np.asarray(transform.get("scale", (1.0, 1.0)), dtype=np.float64)).T
    angle = transform.get("rotation", 0.0)
    sine, cosine = math.sin(angle), math.cos(angle)
    turned = np.stack([cosine * u + sine * v, cosine * v - sine * u], axis=1)
    return turned + np.asarray(transform.get("offset", (0.0, 0.0)), dtype=np.float64)
