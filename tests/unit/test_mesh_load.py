"""Loading: the same mesh from every format, what is repaired on the way, and both UV sets of awkward layouts."""

from __future__ import annotations

import io
import json
import struct
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from PIL import Image

from skincli.errors import InputError
from skincli.mesh import load, surface, unwrap
from skincli.mesh.load import load_builtin, load_mesh
from skincli.mesh.model import Material, Mesh, Part

Floats = NDArray[np.float64]

HEAD = Path(__file__).parents[3] / "shared" / "data" / "lee-perry-smith" / "head.obj"


@pytest.fixture(autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SKINCLI_CACHE", str(tmp_path_factory.getbasetemp() / "cache"))


def dome(n: int = 6) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Return positions, UVs filling the square, and faces of a curved patch, counter-clockwise seen from +z."""
    u, v = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1)))
    first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.concatenate(
        [np.stack([first, first + 1, first + n + 2], 1), np.stack([first, first + n + 2, first + n + 1], 1)]
    )
    z = 30 * np.cos(2 * (u - 0.4)) + 20 * np.sin(v)
    return np.stack([100 * u, 80 * v, z], axis=1), np.stack([u, v], axis=1), faces


def picture(color: tuple[int, int, int]) -> Image.Image:
    pixels = np.zeros((4, 4, 3), dtype=np.uint8)
    pixels[:] = color
    pixels[0] = 255  # the top row
    return Image.fromarray(pixels)


def textured(positions: Floats, faces: Any, uv: Floats, color: tuple[int, int, int] | None = None) -> trimesh.Trimesh:
    material = trimesh.visual.material.PBRMaterial(
        baseColorTexture=None if color is None else picture(color), baseColorFactor=[128, 255, 255, 255]
    )
    visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    return trimesh.Trimesh(positions, faces, visual=visual, process=False)


def write_obj(path: Path, positions: Floats, uv: Floats | None, faces: Any, extra: str = "") -> Path:
    lines = [extra, *("v " + " ".join(map(repr, row)) for row in positions.tolist())]
    corner = "{0}"
    if uv is not None:
        lines += ["vt " + " ".join(map(repr, row)) for row in uv.tolist()]
        corner = "{0}/{0}"
    lines += ["f " + " ".join(corner.format(index + 1) for index in face) for face in np.asarray(faces).tolist()]
    path.write_text("\n".join(lines) + "\n")
    return path


def triangles(mesh: Mesh, values: Floats) -> Floats:
    """Return per-corner values in an order that depends on neither faces nor vertices."""
    corners = np.concatenate([(mesh.positions + mesh.origin)[mesh.faces], values[mesh.faces]], axis=2)
    start = np.argmin(np.round(corners, 3) @ (1 + np.arange(corners.shape[2]) ** 2), axis=1)
    turned = np.stack([np.roll(face, -first, axis=0) for face, first in zip(corners, start, strict=True)])
    return turned[np.lexsort(np.round(turned.reshape(len(turned), -1), 3).T)]


def check(mesh: Mesh) -> None:
    """Assert what holds for every mesh."""
    assert mesh.positions.dtype == mesh.normals.dtype == mesh.uv.dtype == mesh.atlas_uv.dtype == np.float64
    assert mesh.faces.dtype == np.int32
    count = len(mesh.positions)
    assert len(mesh.normals) == len(mesh.uv) == len(mesh.atlas_uv) == count
    assert np.array_equal(np.unique(mesh.faces), np.arange(count))
    for array in (mesh.positions, mesh.normals, mesh.uv, mesh.atlas_uv):
        assert np.isfinite(array).all()
    assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(np.ones(count))
    assert mesh.positions.max(axis=0) == pytest.approx(-mesh.positions.min(axis=0), rel=1e-9, abs=1e-9)
    assert surface.face_areas(mesh).min() > 0
    assert unwrap.why_not_unique(mesh.positions, mesh.atlas_uv, mesh.faces.astype(np.int64)) == []
    assert mesh.uv_is_unique == np.array_equal(mesh.uv, mesh.atlas_uv)
    assert [part.start for part in mesh.parts] == [0] + [part.stop for part in mesh.parts[:-1]]
    assert mesh.parts[-1].stop == len(mesh.faces)
    assert len({part.name for part in mesh.parts}) == len(mesh.parts)


# ---------------------------------------------------------------- formats


@pytest.mark.parametrize("kind", ["obj", "ply", "ply-ascii", "stl", "stl-ascii", "glb", "gltf"])
def test_every_format_gives_the_same_surface(tmp_path: Path, kind: str) -> None:
    positions, uv, faces = dome()
    suffix, _, style = kind.partition("-")
    path = tmp_path / f"dome.{suffix}"
    source = textured(positions, faces, uv)
    if kind == "obj":
        write_obj(path, positions, uv, faces)
    elif suffix == "ply":
        path.write_bytes(trimesh.exchange.ply.export_ply(source, encoding=style or "binary", vertex_normal=True))
    elif kind == "stl-ascii":
        path.write_text(trimesh.exchange.stl.export_stl_ascii(source))
    elif kind == "gltf":
        for name, data in trimesh.exchange.gltf.export_gltf(trimesh.Scene(source)).items():
            (tmp_path / name.replace("model", "dome")).write_bytes(data)
    else:
        source.export(path)
    mesh = load_mesh(path, 2.0)
    check(mesh)
    assert mesh.origin == pytest.approx(positions.min(axis=0) + positions.max(axis=0))
    reference = load_mesh(write_obj(tmp_path / "reference.obj", positions, uv, faces), 2.0)
    assert len(mesh.faces) == len(faces)
    assert len(mesh.positions) == len(positions)
    assert triangles(mesh, mesh.normals) == pytest.approx(triangles(reference, reference.normals), rel=1e-6, abs=1e-4)
    if suffix == "stl":
        assert mesh.uv_is_unique
        assert any("has no UVs" in note for note in mesh.notes)
    else:
        assert triangles(mesh, mesh.uv) == pytest.approx(triangles(reference, reference.uv), rel=1e-6, abs=1e-5)
        assert not any("UV" in note for note in mesh.notes)


def test_positions_stay_exact_far_from_the_origin(tmp_path: Path) -> None:
    positions, uv, faces = dome()
    mesh = load_mesh(write_obj(tmp_path / "far.obj", positions + 1e7, uv, faces), 1.0)
    near = load_mesh(write_obj(tmp_path / "near.obj", positions, uv, faces), 1.0)
    assert mesh.positions == pytest.approx(near.positions, abs=1e-8)
    assert mesh.origin - near.origin == pytest.approx(np.full(3, 1e7))
    assert np.abs(mesh.positions.astype(np.float32) - near.positions).max() < 1e-5


def test_obj_polygons_and_relative_indices(tmp_path: Path) -> None:
    text = """
        v 0 0 0
        v 10 0 0
        vt 0 0
        vt 1 0
        v 10 10 0 # a comment
        v 0 10 0
        vt 1 1
        vt 0 1
        f -4/-4 -3/-3 -2/-2 \\
          -1/-1
        v 0 0 50
        v 10 0 50
        v 12 5 50
        v 10 10 50
        v 0 10 50
        f 5 6 7 8 9
    """
    path = tmp_path / "mixed.obj"
    path.write_text(text)
    mesh = load_mesh(path, 1.0)
    check(mesh)
    assert len(mesh.faces) == 5
    assert surface.face_areas(mesh).sum() == pytest.approx(100 + 110)
    assert (mesh.normals[:, 2] > 0).all()


def test_obj_seams_keep_both_uv(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 10 0 0\nv 10 10 0\nv 0 10 0\nvt 0 0\nvt .4 0\nvt .4 .9\nvt .6 0\nvt 1 .9\nvt .6 .9\n"
    path = tmp_path / "seam.obj"
    path.write_text(text + "f 1/1 2/2 3/3\nf 1/4 3/5 4/6\n")
    mesh = load_mesh(path, 1.0)
    assert len(mesh.positions) == 6
    assert mesh.uv[mesh.faces].reshape(-1, 2) == pytest.approx(
        np.array([[0, 0], [0.4, 0], [0.4, 0.9], [0.6, 0], [1, 0.9], [0.6, 0.9]])
    )
    assert len(surface.border_edges(mesh.faces)) == 6
    assert mesh.normals == pytest.approx(np.tile([0, 0, 1], (6, 1)))


@pytest.mark.parametrize("order", ["<", ">"])
def test_binary_ply_of_triangles_and_quads(tmp_path: Path, order: str) -> None:
    name = {"<": "little", ">": "big"}[order]
    header = f"ply\ncomment first\nformat binary_{name}_endian 1.0\nelement vertex 5\n"
    header += "property float x\nproperty float y\nproperty float z\nelement face 2\n"
    header += "property list uchar int vertex_indices\nend_header\n"
    points = np.array([[0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0], [5, 15, 0]], dtype=order + "f4")
    faces = struct.pack(f"{order}B4iB3i", 4, 0, 1, 2, 3, 3, 3, 2, 4)
    path = tmp_path / "mixed.ply"
    path.write_bytes(header.encode() + points.tobytes() + faces)
    mesh = load_mesh(path, 1.0)
    check(mesh)
    assert len(mesh.faces) == 3
    assert surface.face_areas(mesh).sum() == pytest.approx(125)


@pytest.mark.parametrize("mixed", [False, True])
def test_ply_uv_per_corner(tmp_path: Path, mixed: bool) -> None:
    header = "ply\nformat binary_little_endian 1.0\nelement vertex 5\nproperty float x\nproperty float y\n"
    header += "property float z\nelement face {}\nproperty list uchar int vertex_indices\n"
    header += "property list uchar float texcoord\nend_header\n"
    points = np.array([[0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0], [5, 15, 0]], dtype="<f4")
    faces = struct.pack("<B4iB8f", 4, 0, 1, 2, 3, 8, 0, 0, 0.5, 0, 0.5, 1, 0, 1)
    if mixed:
        faces += struct.pack("<B3iB6f", 3, 3, 2, 4, 6, 0.6, 0, 1, 0, 0.8, 1)
    path = tmp_path / "corner.ply"
    path.write_bytes(header.format(1 + mixed).encode() + points.tobytes() + faces)
    mesh = load_mesh(path, 1.0)
    check(mesh)
    assert mesh.uv_is_unique
    assert len(mesh.positions) == (7 if mixed else 4)
    assert np.abs(surface.uv_areas(mesh.uv, mesh.faces)).sum() == pytest.approx(0.7 if mixed else 0.5)
    corner = np.flatnonzero((np.abs(mesh.positions + mesh.origin - [10, 10, 0]) < 1e-6).all(axis=1))
    assert sorted(mesh.uv[corner, 0]) == pytest.approx([0.5, 1.0] if mixed else [0.5])


def test_vertices_without_index_are_merged(tmp_path: Path) -> None:
    positions, uv, faces = dome()
    flat = np.arange(faces.size).reshape(-1, 3)
    mesh = load_mesh(write_obj(tmp_path / "soup.obj", positions[faces.ravel()], uv[faces.ravel()], flat), 1.0)
    assert len(mesh.positions) == len(positions)
    assert len(surface.border_edges(mesh.faces)) == 24


# ---------------------------------------------------------------- glTF


def gltf(tmp_path: Path, tree: dict[str, Any], **arrays: NDArray[Any]) -> Path:
    """Write a glTF file whose accessors, in order, are `arrays`; `tree` may override every key of them."""
    blobs = [array.tobytes() + b"\0" * (-array.nbytes % 4) for array in arrays.values()]
    starts = np.cumsum([0] + [len(blob) for blob in blobs]).tolist()
    kinds = {"float32": 5126, "uint16": 5123, "uint32": 5125, "uint8": 5121, "int16": 5122}
    views = [
        {"buffer": 0, "byteOffset": start, "byteLength": array.nbytes}
        for start, array in zip(starts, arrays.values(), strict=False)
    ]
    accessors = [
        {
            "bufferView": number,
            "componentType": kinds[array.dtype.name],
            "count": len(array),
            "type": {1: "SCALAR", 2: "VEC2", 3: "VEC3"}[array.shape[1] if array.ndim == 2 else 1],
        }
        for number, array in enumerate(arrays.values())
    ]
    for number, changes in tree.pop("changes", {}).items():
        accessors[number] |= changes
    whole = {
        "asset": {"version": "2.0"},
        "buffers": [{"uri": "data.bin", "byteLength": starts[-1]}],
        "bufferViews": views,
        "accessors": accessors,
    } | tree
    (tmp_path / "data.bin").write_bytes(b"".join(blobs))
    path = tmp_path / "mesh.gltf"
    path.write_text(json.dumps(whole))
    return path


def primitive(**changes: Any) -> dict[str, Any]:
    return {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2} | changes


def arrays(uv: Floats | None = None) -> dict[str, NDArray[Any]]:
    positions, own, faces = dome()
    return {
        "positions": positions.astype(np.float32),
        "uv": (own if uv is None else uv).astype(np.float32),
        "indices": faces.astype(np.uint16).ravel(),
    }


def test_two_parts_with_two_textures_in_one_square(tmp_path: Path) -> None:
    positions, uv, faces = dome()
    scene = trimesh.Scene()
    scene.add_geometry(textured(positions / 1000, faces, uv, (200, 10, 20)), geom_name="skin")
    lift = np.eye(4)
    lift[2, 3] = 0.1
    scene.add_geometry(textured(positions / 2000, faces, uv, (30, 40, 250)), geom_name="eyes", transform=lift)
    path = tmp_path / "head.glb"
    scene.export(path)
    mesh = load_mesh(path, 1000.0)
    check(mesh)
    assert not mesh.uv_is_unique
    assert any("shared by several faces" in note for note in mesh.notes)
    assert [part.name for part in mesh.parts] == ["skin", "eyes"]
    for part, color, scale, height in zip(mesh.parts, ((200, 10, 20), (30, 40, 250)), (1, 0.5), (0, 100), strict=True):
        assert part.stop - part.start == len(faces)
        assert part.material is not None
        assert part.material.base_color == pytest.approx((128 / 255, 1, 1), abs=1e-3)
        pixels = part.material.base_color_image
        assert pixels is not None
        assert tuple(pixels[0, 0, :3]) == (255, 255, 255)
        assert tuple(pixels[-1, 0, :3]) == color
        mine = mesh.faces[part.start : part.stop]
        expected = positions[faces] * scale + [0, 0, height]
        assert (mesh.positions + mesh.origin)[mine] == pytest.approx(expected, abs=1e-4)
        assert mesh.uv[mine] == pytest.approx(uv[faces], abs=1e-6)


def test_nodes_place_mirror_and_repeat(tmp_path: Path) -> None:
    tree = {
        "nodes": [
            {"children": [1, 2], "scale": [2, 2, 2]},
            {"mesh": 0, "translation": [100, 0, 0]},
            {"mesh": 0, "scale": [-1, 1, 1], "camera": 0},
            {"mesh": 0},  # no part of the scene
        ],
        "scenes": [{"nodes": [0]}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 1}}],
        "meshes": [{"name": "ear", "primitives": [primitive()]}],
    }
    mesh = load_mesh(gltf(tmp_path, tree, **arrays()), 1.0)
    check(mesh)
    assert [part.name for part in mesh.parts] == ["ear", "ear_2"]
    low, high = mesh.origin + mesh.positions.min(axis=0), mesh.origin + mesh.positions.max(axis=0)
    assert (low[0], high[0]) == pytest.approx((-200, 400))
    assert (mesh.normals[:, 2] > 0).all()
    assert (surface.area_vectors(mesh.positions, mesh.faces)[:, 2] > 0).all()


def test_gltf_uv_without_material_and_without_nodes(tmp_path: Path) -> None:
    mesh = load_mesh(gltf(tmp_path, {"meshes": [{"primitives": [primitive()]}]}, **arrays()), 1.0)
    _, uv, faces = dome()
    flipped = np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1)  # glTF's v grows downward
    assert mesh.uv[mesh.faces] == pytest.approx(flipped[faces], abs=1e-6)
    assert mesh.uv_is_unique
    assert mesh.parts[0].material is None


def test_gltf_second_uv_set_normalized_integers_and_transform(tmp_path: Path) -> None:
    _, uv, faces = dome()
    look = {
        "baseColorTexture": {
            "index": 0,
            "texCoord": 1,
            "extensions": {"KHR_texture_transform": {"scale": [0.5, 0.5], "rotation": np.pi / 2, "offset": [0, 1]}},
        }
    }
    tree = {
        "meshes": [{"primitives": [primitive(attributes={"POSITION": 0, "TEXCOORD_1": 1}, material=0)]}],
        "materials": [{"pbrMetallicRoughness": look}],
        "textures": [{"source": 0}],
        "images": [{"uri": "gone.png"}],
        "changes": {1: {"normalized": True}},
    }
    given = arrays() | {"uv": np.round(uv * 65535).astype(np.uint16)}
    mesh = load_mesh(gltf(tmp_path, tree, **given), 1.0)
    # The lower left quadrant, turned: the example of the extension's own text.
    expected = np.stack([0.5 * uv[:, 1], 1 - (1 - 0.5 * uv[:, 0])], axis=1)
    assert mesh.uv[mesh.faces] == pytest.approx(expected[faces], abs=1e-4)
    assert any("gone.png" in note for note in mesh.notes)


def test_gltf_sparse_values_are_applied(tmp_path: Path) -> None:
    given = arrays() | {"at": np.array([3], dtype=np.uint16), "to": np.array([[50, 0, 90]], dtype=np.float32)}
    sparse = {"count": 1, "indices": {"bufferView": 3, "componentType": 5123}, "values": {"bufferView": 4}}
    tree = {"meshes": [{"primitives": [primitive()]}], "changes": {0: {"sparse": sparse}}}
    mesh = load_mesh(gltf(tmp_path, tree, **given), 1.0)
    assert (mesh.positions + mesh.origin)[:, 2].max() == pytest.approx(90)


@pytest.mark.parametrize(("mode", "indices"), [(5, [0, 1, 7, 8]), (6, [0, 1, 8, 7])])
def test_gltf_strips_and_fans(tmp_path: Path, mode: int, indices: list[int]) -> None:
    given = arrays() | {"indices": np.array(indices, dtype=np.uint16)}
    mesh = load_mesh(gltf(tmp_path, {"meshes": [{"primitives": [primitive(mode=mode)]}]}, **given), 1.0)
    assert len(mesh.faces) == 2
    assert (surface.area_vectors(mesh.positions, mesh.faces)[:, 2] > 0).all()


# ---------------------------------------------------------------- UV sets


def test_mirrored_halves(tmp_path: Path) -> None:
    positions, uv, faces = dome(8)
    half = np.stack([2 * np.abs(uv[:, 0] - 0.5), uv[:, 1]], axis=1)
    mesh = load_mesh(write_obj(tmp_path / "mirror.obj", positions, half, faces), 1.0)
    check(mesh)
    assert not mesh.uv_is_unique
    assert any("100.0% of the covered texels are shared" in note for note in mesh.notes)
    assert mesh.uv[mesh.faces] == pytest.approx(half[faces])
    assert (mesh.positions + mesh.origin)[mesh.faces] == pytest.approx(positions[faces])
    # No vertex serves both halves: dpdu points away from the middle on either side, never to zero.
    dpdu, _ = surface.tangents(mesh.positions, mesh.faces, mesh.uv)
    assert np.abs(dpdu[:, 0]) == pytest.approx(np.full(len(dpdu), 50.0))
    sign = np.sign(surface.uv_areas(mesh.uv, mesh.faces))
    for side in (-1, 1):
        assert np.sign(dpdu[np.unique(mesh.faces[sign == side])][:, 0]) == pytest.approx(side)


@pytest.mark.parametrize(("shift", "reason"), [((1, 0), "leave the square"), ((0.5, 0), "leave the square")])
def test_uv_in_other_tiles_stay_for_maps(tmp_path: Path, shift: tuple[float, float], reason: str) -> None:
    positions, uv, faces = dome()
    mesh = load_mesh(write_obj(tmp_path / "tile.obj", positions, uv + shift, faces), 1.0)
    check(mesh)
    assert mesh.uv[mesh.faces] == pytest.approx((uv + shift)[faces])
    assert any(reason in note for note in mesh.notes)


def test_degenerate_and_broken_uv(tmp_path: Path) -> None:
    positions, uv, faces = dome()
    uv[10] = np.nan
    mesh = load_mesh(write_obj(tmp_path / "broken.obj", positions, uv, faces), 1.0)
    check(mesh)
    assert any("1 UVs that are not finite" in note for note in mesh.notes)
    collapsed = load_mesh(write_obj(tmp_path / "zero.obj", positions, uv * 0, faces), 1.0)
    check(collapsed)
    assert not collapsed.uv.any()
    assert len(collapsed.faces) == len(faces)


def test_a_part_without_uv_gets_its_place_in_the_atlas(tmp_path: Path) -> None:
    positions, uv, faces = dome()
    path = write_obj(tmp_path / "parts.obj", positions, uv, faces, "o skin")
    more = "".join(f"v {x} {y} {z + 90}\n" for x, y, z in positions)
    more += "o teeth\n" + "".join("f " + " ".join(str(i + 1 + len(positions)) for i in face) + "\n" for face in faces)
    path.write_text(path.read_text() + more)
    mesh = load_mesh(path, 1.0)
    check(mesh)
    assert [part.name for part in mesh.parts] == ["skin", "teeth"]
    skin, teeth = (np.unique(mesh.faces[part.start : part.stop]) for part in mesh.parts)
    assert np.array_equal(mesh.uv[teeth], mesh.atlas_uv[teeth])
    assert not np.array_equal(mesh.uv[skin], mesh.atlas_uv[skin])
    assert any("'teeth' has no UVs" in note for note in mesh.notes)


# ---------------------------------------------------------------- materials


def test_mtl_colors_and_maps(tmp_path: Path) -> None:
    positions, uv, faces = dome()
    half = len(faces) // 2
    (tmp_path / "textures").mkdir()
    picture((9, 8, 7)).save(tmp_path / "textures" / "skin color.png")
    (tmp_path / "head.mtl").write_text(
        "newmtl skin\nKd 0 0 0\nmap_Kd -s 1 1 1 -clamp on textures\\skin color.png\nnewmtl lip\nKd 0.5 0.2 0.1\n"
    )
    lines = write_obj(tmp_path / "head.obj", positions, uv, faces, "mtllib head.mtl").read_text().splitlines()
    first = next(number for number, line in enumerate(lines) if line.startswith("f "))
    lines[first + half : first + half] = ["usemtl lip"]
    lines[first:first] = ["usemtl skin"]
    (tmp_path / "head.obj").write_text("\n".join(lines))
    mesh = load_mesh(tmp_path / "head.obj", 1.0)
    check(mesh)
    assert [(part.name, part.stop) for part in mesh.parts] == [("skin", half), ("lip", len(faces))]
    skin, lip = (part.material for part in mesh.parts)
    assert skin is not None
    assert skin.base_color == (1, 1, 1)
    assert skin.base_color_file == tmp_path / "textures" / "skin color.png"
    assert skin.base_color_image is not None
    assert tuple(skin.base_color_image[-1, 0]) == (9, 8, 7)
    assert lip == Material((0.5, 0.2, 0.1))
    # The border between the materials shades like the rest: the surface is one.
    whole = load_mesh(write_obj(tmp_path / "whole.obj", positions, uv, faces), 1.0)
    assert triangles(mesh, mesh.normals) == pytest.approx(triangles(whole, whole.normals))


def test_missing_material_files_are_notes(tmp_path: Path) -> None:
    positions, uv, faces = dome()
    mesh = load_mesh(write_obj(tmp_path / "a.obj", positions, uv, faces, "mtllib gone.mtl\nusemtl skin"), 1.0)
    assert any("gone.mtl" in note for note in mesh.notes)
    assert mesh.parts == (Part("skin", 0, len(faces)),)


# ---------------------------------------------------------------- normals and winding


def ball() -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=2, radius=50)


def test_computed_normals_have_no_seam(tmp_path: Path) -> None:
    sphere = ball()
    corners = np.array(sphere.vertices)[sphere.faces].reshape(-1, 3)
    uv = np.random.default_rng(0).random((len(corners), 2))  # every face its own chart
    mesh = load_mesh(write_obj(tmp_path / "a.obj", corners, uv, np.arange(len(corners)).reshape(-1, 3)), 1.0)
    check(mesh)
    place = np.round(mesh.positions, 6)
    _, inverse = np.unique(place, axis=0, return_inverse=True)
    for axis in range(3):
        mean = np.bincount(inverse, mesh.normals[:, axis]) / np.bincount(inverse)
        assert mesh.normals[:, axis] == pytest.approx(mean[inverse], abs=1e-12)
    assert any("normals were computed" in note for note in mesh.notes)


def test_bodies_that_touch_do_not_smooth_into_each_other(tmp_path: Path) -> None:
    box = trimesh.creation.box(extents=(20, 20, 20))
    both = [np.array(box.vertices), np.array(box.vertices) + np.array([20, 0, 0])]
    text = ""
    for number, positions in enumerate(both):
        text += f"o box{number}\n" + "".join("v {} {} {}\n".format(*row) for row in positions)
        text += "".join("f {} {} {}\n".format(*(face + 1 + 8 * number)) for face in np.array(box.faces))
    path = tmp_path / "boxes.obj"
    path.write_text(text)
    mesh = load_mesh(path, 1.0)
    for part, positions in zip(mesh.parts, both, strict=True):
        mine = np.unique(mesh.faces[part.start : part.stop])
        outward = (mesh.positions + mesh.origin)[mine] - positions.mean(axis=0)
        assert mesh.normals[mine] == pytest.approx(outward / np.linalg.norm(outward, axis=1, keepdims=True))


@pytest.mark.parametrize("with_normals", [False, True])
def test_an_inside_out_surface_is_turned(tmp_path: Path, with_normals: bool) -> None:
    sphere = ball()
    sphere.invert()
    path = tmp_path / "ball.ply"
    path.write_bytes(trimesh.exchange.ply.export_ply(sphere, vertex_normal=with_normals))
    mesh = load_mesh(path, 1.0)
    check(mesh)
    assert (np.einsum("ij,ij->i", mesh.positions, mesh.normals) > 0).all()
    assert np.einsum("ij,ij->", mesh.positions[mesh.faces[:, 0]], surface.area_vectors(mesh.positions, mesh.faces)) > 0
    assert any("inside-out" in note for note in mesh.notes)


def normals_file(tmp_path: Path, normals: Floats, flip_faces: bool = False) -> Path:
    _, _, faces = dome()
    given = arrays() | {"normals": normals.astype(np.float32)}
    if flip_faces:
        given["indices"] = faces[:, ::-1].astype(np.uint16).ravel()
    attributes = {"POSITION": 0, "TEXCOORD_0": 1, "NORMAL": 3}
    return gltf(tmp_path, {"meshes": [{"primitives": [primitive(attributes=attributes)]}]}, **given)


def smooth() -> Floats:
    positions, _, faces = dome()
    return surface.angle_weighted_normals(positions, faces)


def test_authored_normals_are_kept_and_renormalized(tmp_path: Path) -> None:
    tilted = smooth() + np.array([0.3, 0, 0])
    mesh = load_mesh(normals_file(tmp_path, tilted * 7), 1.0)
    assert mesh.normals == pytest.approx(tilted / np.linalg.norm(tilted, axis=1, keepdims=True), abs=1e-6)
    assert mesh.notes == ()


def test_broken_and_backward_normals_are_computed(tmp_path: Path) -> None:
    normals = smooth()
    normals[3] = np.nan
    normals[9] = 0
    normals[20] *= -1
    mesh = load_mesh(normals_file(tmp_path, normals), 1.0)
    check(mesh)
    assert mesh.normals == pytest.approx(smooth(), abs=1e-5)
    assert any("2 of 49 normals are missing or broken" in note for note in mesh.notes)
    assert any("1 normals that disagree" in note for note in mesh.notes)


def test_an_open_surface_wound_against_its_normals_is_turned(tmp_path: Path) -> None:
    mesh = load_mesh(normals_file(tmp_path, smooth(), flip_faces=True), 1.0)
    check(mesh)
    assert mesh.normals == pytest.approx(smooth(), abs=1e-6)
    assert (surface.area_vectors(mesh.positions, mesh.faces)[:, 2] > 0).all()
    assert any("turned around" in note for note in mesh.notes)


def test_triangles_without_area_are_dropped(tmp_path: Path) -> None:
    positions, uv, faces = dome()
    bad = [[0, 0, 1], [0, 1, 2], [5, 5, 5]]  # the second lies on a line only when z is flat
    positions[:, 2] = 0
    mesh = load_mesh(write_obj(tmp_path / "a.obj", positions, uv, [*faces.tolist(), *bad]), 1.0)
    check(mesh)
    assert len(mesh.faces) == len(faces)
    assert any("3 triangles without area" in note for note in mesh.notes)


def test_a_strange_size_is_asked_about(tmp_path: Path) -> None:
    positions, uv, faces = dome()
    path = write_obj(tmp_path / "two.obj", positions / 50, uv, faces)
    assert any("2 x 1.6" in note and "unit" in note for note in load_mesh(path, 1.0).notes)
    assert not any("unit" in note for note in load_mesh(path, 120.0).notes)


# ---------------------------------------------------------------- built-in meshes, cache, a real head


def test_builtin_meshes_are_built_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("SKINCLI_CACHE", str(tmp_path))
    positions, uv, faces = dome()
    image = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)
    built = Mesh(
        positions, smooth(), uv, uv, faces.astype(np.int32),
        (Part("a", 0, 9, Material((0.1, 0.2, 0.3), image)), Part("b", 9, len(faces))), np.ones(3), True, ("made",),
    )  # fmt: skip
    calls = []

    def build(name: str, detail: str | None) -> Mesh:
        calls.append((name, detail))
        return built

    monkeypatch.setattr(load.importlib, "import_module", lambda name: SimpleNamespace(build=build))
    first, second = load_builtin("head", "9k"), load_builtin("head", "9k")
    load_builtin("head", None)
    assert calls == [("head", "9k"), ("head", None)]
    for mesh in (first, second):
        assert mesh.key == built.key
        assert mesh.notes == built.notes
        assert [(part.name, part.start, part.stop) for part in mesh.parts] == [("a", 0, 9), ("b", 9, len(faces))]
        assert mesh.parts[0].material is not None
        assert mesh.parts[0].material.base_color == (0.1, 0.2, 0.3)
        assert np.array_equal(mesh.parts[0].material.base_color_image, image)
        assert mesh.parts[1].material is None


def test_loading_twice_gives_the_same_key(tmp_path: Path) -> None:
    sphere = ball()
    path = tmp_path / "ball.stl"
    sphere.export(path)
    keys = {load_mesh(path, 1.0, use_cache=use_cache).key for use_cache in (True, True, False)}
    assert len(keys) == 1
    assert load_mesh(path, 2.0).key not in keys


def test_a_coarse_head_two_units_tall(tmp_path: Path) -> None:
    sphere = trimesh.creation.uv_sphere(count=[26, 26])
    sphere.apply_scale([0.75, 1.0, 0.85])
    path = tmp_path / "head.obj"
    sphere.export(path, include_normals=False)
    mesh = load_mesh(path, 120.0)
    check(mesh)
    assert 2300 <= len(mesh.faces) <= 2700
    assert np.ptp(mesh.positions, axis=0) == pytest.approx([180, 240, 204], rel=0.01)
    assert len(mesh.notes) == 2  # normals computed, UVs made; nothing about the unit


@pytest.mark.skipif(not HEAD.exists(), reason="the scanned head is not at hand")
def test_a_scanned_head_works_untouched() -> None:
    mesh = load_mesh(HEAD, 1.0)
    check(mesh)
    assert mesh.notes == ()
    assert mesh.uv_is_unique
    assert len(mesh.faces) == 70736
    assert surface.texel_size(mesh, mesh.atlas_uv, 2048) == pytest.approx(0.31, abs=0.01)


def test_embedded_images_with_alpha_keep_it(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    Image.fromarray(np.full((2, 2, 4), 100, dtype=np.uint8)).save(buffer, "PNG")
    given = arrays() | {"image": np.frombuffer(buffer.getvalue(), dtype=np.uint8)}
    tree = {
        "meshes": [{"primitives": [primitive(material=0)]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "baseColorFactor": [0.5, 1, 1, 1]}}],
        "textures": [{"source": 0}],
        "images": [{"bufferView": 3, "mimeType": "image/png"}],
    }
    (part,) = load_mesh(gltf(tmp_path, tree, **given), 1.0).parts
    assert part.material is not None
    assert part.material.base_color == (0.5, 1, 1)
    assert part.material.base_color_image is not None
    assert part.material.base_color_image.shape == (2, 2, 4)


def test_a_missing_file_names_what_the_user_wrote(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"^meshes/gone\.obj: the file does not exist"):
        load_mesh(tmp_path / "gone.obj", 1.0, display_path="meshes/gone.obj")
