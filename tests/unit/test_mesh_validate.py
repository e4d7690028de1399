"""Every bad mesh gives one clear error that names the file, and never a traceback of somebody else's."""

from __future__ import annotations

import json
import os
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skincli.errors import InputError, LimitError
from skincli.mesh import validate
from skincli.mesh.load import load_mesh

TRIANGLE = "v 0 0 0\nv 90 0 0\nv 0 90 0\nvt 0 0\nvt 1 0\nvt 0 1\n"


def refuse(tmp_path: Path, name: str, data: bytes | str, match: str, error: type[Exception] = InputError) -> None:
    path = tmp_path / name
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    with pytest.raises(error, match=match) as caught:
        load_mesh(path, 1.0, display_path=f"my/{name}")
    assert type(caught.value) is error
    assert str(caught.value).startswith(f"my/{name}:")
    assert str(tmp_path) not in str(caught.value)


# ---------------------------------------------------------------- any file


@pytest.mark.parametrize("unit", [0.0, -1.0, np.nan, np.inf])
def test_units(tmp_path: Path, unit: float) -> None:
    (tmp_path / "a.obj").write_text(TRIANGLE + "f 1/1 2/2 3/3\n")
    with pytest.raises(InputError, match=r"a\.obj: the unit is"):
        load_mesh(tmp_path / "a.obj", unit)


@pytest.mark.parametrize("unit", [1e-9, 1e9, 1e308])
def test_sizes_that_no_unit_explains(tmp_path: Path, unit: float) -> None:
    (tmp_path / "a.obj").write_text(TRIANGLE + "f 1/1 2/2 3/3\n")
    with pytest.raises(InputError, match=r"a\.obj: the mesh measures .* correct the mesh's unit"):
        load_mesh(tmp_path / "a.obj", unit)


def test_files_that_are_none(tmp_path: Path) -> None:
    refuse(tmp_path, "a.obj", "", "empty")
    refuse(tmp_path, "a.txt", "f", "type '.txt' are not read")
    (tmp_path / "folder.obj").mkdir()
    with pytest.raises(InputError, match="not a file"):
        load_mesh(tmp_path / "folder.obj", 1.0)
    with pytest.raises(InputError, match="does not exist"):
        load_mesh(tmp_path / "gone.glb", 1.0)


def test_limits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(validate, "MOST_TRIANGLES", 1)
    refuse(tmp_path, "a.obj", TRIANGLE + "f 1 2 3\nf 1 3 2\n", "2 triangles; at most 1", LimitError)
    monkeypatch.setattr(validate, "MOST_BYTES", 10)
    refuse(tmp_path, "a.stl", "x" * 11, "at most", LimitError)


def test_memory_that_runs_out_is_a_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from trimesh.exchange import load

    def exhausted(**options: Any) -> None:
        raise MemoryError

    monkeypatch.setitem(load.mesh_loaders, "obj", exhausted)
    refuse(tmp_path, "a.obj", TRIANGLE + "f 1 2 3\n", "not enough memory", LimitError)


@pytest.mark.parametrize("suffix", validate.SUFFIXES)
def test_noise_in_every_format(tmp_path: Path, suffix: str) -> None:
    generator = np.random.default_rng(3)
    for length in (1, 40, 4000):
        noise = generator.integers(0, 256, length, dtype=np.uint8).tobytes()
        for start in (b"", b"glTF\2\0\0\0", b"ply\nformat ascii 1.0\n", b"solid x\n facet", b"v 1 2 3\nf "):
            refuse(tmp_path, "noise" + suffix, start + noise, "noise")


# ---------------------------------------------------------------- OBJ


@pytest.mark.parametrize(
    ("faces", "line", "match"),
    [
        ("", None, "there is no face"),
        ("f 1 2\n", 7, "2 corners"),
        ("f 1 2 4\n", 7, "uses v 4, but the file defines 3"),
        ("f 1 2 3\n\nf 1 2 -4\n", 9, "uses v -4"),
        ("f 0 1 2\n", 7, "uses v 0"),
        ("f 1/1 2/2 3/9\n", 7, "uses vt 9"),
        ("f 1//1 2//1 3//1\n", 7, "uses vn 1, but the file defines 0"),
        ("f 1 2 x\n", 7, "not of the form"),
        ("f 1/1/1/1 2 3\n", 7, "not of the form"),
        ("f /1 2 3\n", 7, "not of the form"),
        ("f 1 2 99999999999999999999999\n", 7, "not of the form"),
        ("v 1 nan 2\nf 1 2 3\n", 7, "not 3 finite numbers"),
        ("v 1 inf 2\nf 1 2 3\n", 7, "not 3 finite numbers"),
        ("v 1 2\nf 1 2 3\n", 7, "'v' has 2 numbers"),
        ("v 1 2 three\nf 1 2 3\n", 7, "not 3 finite numbers"),
        ("f 1 1 1\nf 2 2 3\n", None, "no triangles"),
    ],
)
def test_obj(tmp_path: Path, faces: str, line: int | None, match: str) -> None:
    refuse(tmp_path, "a.obj", TRIANGLE + faces, (rf"a\.obj:{line}: " if line else "") + f".*{match}")


def test_the_plain_form_of_an_obj() -> None:
    text = "v 0 0 0 1 0 0\nv 1 0 0\nv\t0 1 0\nvt 0\nf 1/1 2 3\n"
    plain = validate.obj(text.encode(), "a.obj")
    assert plain.text == b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 0 0\nvn 0 0 0\no 0\nf 1/1 2/2 3/2\n"
    assert plain.parts == (("", ""),)


# ---------------------------------------------------------------- STL and PLY


def test_stl(tmp_path: Path) -> None:
    refuse(tmp_path, "a.stl", b"\0" * 20, "header of 84")
    refuse(tmp_path, "a.stl", b"\0" * 80 + struct.pack("<I", 1000) + b"\0" * 50, "counts 1000 triangles")
    refuse(tmp_path, "a.stl", b"\0" * 84, "no triangles")
    refuse(tmp_path, "a.stl", "solid a\nendsolid a facet\n", "no triangles")
    vertex = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, np.nan, 0, 0, 0, 1, 0, 0)
    refuse(tmp_path, "a.stl", b"\0" * 80 + struct.pack("<I", 1) + vertex, "finite numbers are allowed")
    facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 9 zero 0\nvertex 0 9 0\nendloop\nendfacet\n"
    refuse(tmp_path, "a.stl", f"solid a\n{facet}endsolid a\n", "damaged")


HEADER = "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
FACES = "element face {}\nproperty list uchar int vertex_indices\nend_header\n"
POINTS = "0 0 0\n9 0 0\n0 9 0\n"


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("plx", "does not begin with 'ply'"),
        ("ply\nformat ascii 1.0\n", "no end_header"),
        ("ply\nend_header\n", "no format line"),
        ("ply\nformat ascii 1.0\nelement vertex x\nend_header\n", "a.ply:3: .*not understood"),
        (HEADER.format("ascii", 3) + "end_header\n" + POINTS, "no triangles"),
        ("ply\nformat ascii 1.0\n" + FACES.format(1) + "3 0 1 2\n", "no vertex element"),
        (HEADER.format("ascii", 3) + FACES.format(5) + POINTS + "3 0 1 2\n", "promises at least 8 lines"),
        (HEADER.format("ascii", 3) + FACES.format(1) + POINTS + "3 0 1 3\n", "uses vertex 3, but has 3"),
        (HEADER.format("ascii", 3) + FACES.format(1) + POINTS + "3 0 1 -1\n", "uses vertex -1"),
        (HEADER.format("ascii", 3) + FACES.format(1) + POINTS.replace("9", "nan", 1) + "3 0 1 2\n", "finite"),
        (HEADER.format("ascii", 3) + FACES.format(1) + POINTS + "3 0 one 2\n", "damaged"),
        (HEADER.format("binary_little_endian", 10**12) + FACES.format(1) + "abc", "promises at least"),
        (HEADER.format("binary_little_endian", 1) + FACES.format(2) + "\0" * 12 + "\3abc", "ends amid its faces"),
        (HEADER.format("binary_little_endian", 1) + FACES.format(1) + "\0" * 12 + "\0", "0 corners"),
    ],
)
def test_ply(tmp_path: Path, text: str, match: str) -> None:
    refuse(tmp_path, "a.ply", text, match)


# ---------------------------------------------------------------- glTF


def tree(**changes: Any) -> dict[str, Any]:
    """Return a glTF of one triangle with its data embedded."""
    data = "AAAAAAAAAAAAAAAAAAC0QgAAAAAAAAAAAAAAAAAAtEIAAAAA"  # 3 float triples: (0 0 0) (90 0 0) (0 90 0)
    return {
        "asset": {"version": "2.0"},
        "buffers": [{"uri": f"data:application/octet-stream;base64,{data}", "byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    } | changes


def test_the_tree_itself_is_good(tmp_path: Path) -> None:
    (tmp_path / "a.gltf").write_text(json.dumps(tree()))
    assert len(load_mesh(tmp_path / "a.gltf", 1.0).faces) == 1


def accessor(**changes: Any) -> dict[str, Any]:
    return {"accessors": [tree()["accessors"][0] | changes]}


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        (accessor(count=2**31), "asks for 2147483648 items"),
        (accessor(count=-3), "has -3 for a size"),
        (accessor(count=0), "asks for 0 items"),
        (accessor(byteOffset=12), "asks for 3 items"),
        (accessor(type="VEC9"), "VEC9"),
        (accessor(componentType=1), "structure is damaged"),
        ({"accessors": [{"componentType": 5126, "count": 2**30, "type": "VEC3"}]}, "has no data"),
        ({"accessors": []}, r"accessors\[0\] is referred to, but there are 0"),
        ({"bufferViews": [{"buffer": 0, "byteLength": 10**9}]}, "buffer view has 1000000000 bytes of a buffer of 36"),
        ({"buffers": [{"byteLength": 36}]}, "promises 36 bytes, but has 0"),
        ({"buffers": [{"uri": "data:;base64,????", "byteLength": 3}]}, "data URI is damaged"),
        ({"buffers": [{"uri": "gone.bin", "byteLength": 36}]}, "'gone.bin', which does not exist"),
        ({"buffers": [{"uri": "../out.bin", "byteLength": 36}]}, "'../out.bin', outside the mesh's folder"),
        ({"buffers": [{"uri": "%2e%2e/out.bin", "byteLength": 36}]}, "outside the mesh's folder"),
        ({"buffers": [{"uri": "/etc/hostname", "byteLength": 1}]}, "outside the mesh's folder"),
        ({"buffers": [{"uri": "https://example.org/a.bin", "byteLength": 1}]}, "no URLs"),
        ({"buffers": [{"uri": "file:///etc/hostname", "byteLength": 1}]}, "no URLs"),
        ({"meshes": []}, "no triangles"),
        ({"meshes": [{"primitives": []}]}, "no triangles"),
        ({"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 1}]}]}, "no triangles"),
        ({"meshes": [{"primitives": [{"attributes": {}}]}]}, "structure is damaged"),
        ({"meshes": 5}, "structure is damaged"),
        ({"nodes": [{"mesh": 7}]}, r"meshes\[7\] is referred to, but there are 1"),
        ({"nodes": [{"mesh": -1}]}, r"meshes\[-1\] is referred to"),
        ({"nodes": [{"mesh": 0, "children": [0]}], "scenes": [{"nodes": [0]}]}, "its own ancestor"),
        ({"nodes": [{"mesh": 0, "matrix": [1]}]}, "16 finite numbers"),
        ({"nodes": [{"mesh": 0, "scale": [1, 0, 0]}]}, "no triangles"),
        ({"asset": {"version": "1.0"}}, "not glTF 2"),
        ({"extensionsRequired": ["KHR_draco_mesh_compression"]}, "needs the extension KHR_draco_mesh_compression"),
    ],
)
def test_gltf(tmp_path: Path, changes: dict[str, Any], match: str) -> None:
    refuse(tmp_path, "a.gltf", json.dumps(tree(**changes)), match)


def test_gltf_indices_out_of_range(tmp_path: Path) -> None:
    whole = tree()
    whole["buffers"].append({"uri": "data:;base64,AAABAAkA", "byteLength": 6})  # 0 1 9
    whole["bufferViews"].append({"buffer": 1, "byteLength": 6})
    whole["accessors"].append({"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"})
    whole["meshes"][0]["primitives"][0]["indices"] = 1
    refuse(tmp_path, "a.gltf", json.dumps(whole), "uses vertex 9, but has 3")


def test_gltf_json_that_is_none(tmp_path: Path) -> None:
    refuse(tmp_path, "a.gltf", "{", "JSON is damaged")
    refuse(tmp_path, "a.gltf", "[" * 100_000, "JSON is damaged")
    refuse(tmp_path, "a.gltf", "[]", "not glTF 2")


def test_a_few_bytes_cannot_ask_for_many_triangles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(validate, "MOST_TRIANGLES", 10)
    refuse(tmp_path, "a.gltf", json.dumps(tree(nodes=[{"mesh": 0}] * 11)), "11 triangles", LimitError)


def test_glb(tmp_path: Path) -> None:
    text = json.dumps(tree()).encode()
    text += b" " * (-len(text) % 4)
    chunk = struct.pack("<I4s", len(text), b"JSON") + text

    def glb(version: int = 2, length: int = 12 + len(chunk), body: bytes = chunk) -> bytes:
        return struct.pack("<4sII", b"glTF", version, length) + body

    (tmp_path / "good.glb").write_bytes(glb())
    assert len(load_mesh(tmp_path / "good.glb", 1.0).faces) == 1
    refuse(tmp_path, "a.glb", b"glTF\2\0\0\0", "at least 20")
    refuse(tmp_path, "a.glb", glb(version=1), "GLB version 1")
    refuse(tmp_path, "a.glb", glb(length=10**6), "promises 1000000 bytes")
    refuse(tmp_path, "a.glb", glb(body=struct.pack("<I4s", 2**31, b"JSON") + text), "a chunk promises 2147483648")
    refuse(tmp_path, "a.glb", glb(body=chunk.replace(b"JSON", b"BIN\0")), "not JSON")


# ---------------------------------------------------------------- references


def test_obj_references_stay_in_the_folder(tmp_path: Path) -> None:
    (tmp_path / "out.mtl").write_text("newmtl a\nKd 1 0 0\n")
    (tmp_path / "out.png").write_text("")
    inside = tmp_path / "scene"
    inside.mkdir()
    mesh = TRIANGLE + "usemtl a\nf 1/1 2/2 3/3\n"
    refuse(inside, "a.obj", "mtllib ../out.mtl\n" + mesh, r"'\.\./out\.mtl', outside the mesh's folder.*--asset-root")
    os.symlink(tmp_path / "out.mtl", inside / "link.mtl")
    refuse(inside, "a.obj", "mtllib link.mtl\n" + mesh, "'link.mtl', outside the mesh's folder")
    (inside / "a.mtl").write_text("newmtl a\nmap_Kd ../out.png\n")
    refuse(inside, "a.obj", "mtllib a.mtl\n" + mesh, r"'\.\./out\.png', outside the mesh's folder")
    (inside / "a.obj").write_text("mtllib ../out.mtl\n" + mesh)
    loaded = load_mesh(inside / "a.obj", 1.0, roots=[tmp_path])
    assert loaded.parts[0].material is not None
    assert loaded.parts[0].material.base_color == (1, 0, 0)


def test_ply_references_stay_in_the_folder(tmp_path: Path) -> None:
    header = HEADER.format("ascii", 3).replace("ply\n", "ply\ncomment TextureFile ../skin.png\n", 1)
    refuse(tmp_path, "a.ply", header + FACES.format(1) + POINTS + "3 0 1 2\n", r"'\.\./skin\.png', outside")


def test_a_damaged_texture_is_a_note(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text("newmtl a\nmap_Kd a.png\n")
    (tmp_path / "a.png").write_bytes(b"no picture")
    (tmp_path / "a.obj").write_text("mtllib a.mtl\n" + TRIANGLE + "usemtl a\nf 1/1 2/2 3/3\n")
    mesh = load_mesh(tmp_path / "a.obj", 1.0)
    assert any("'a.png' cannot be decoded" in note for note in mesh.notes)
    assert mesh.parts[0].material == validate.Material((1, 1, 1))
