"""The rooms of the house: who imports whom, where OpenGL is spoken, what every shader and every file is held to."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "skincli"

# A room may import itself, rooms of its own or a lower level, and the rooms without OpenGL.
LEVELS = {
    "gpu": 0,
    "graph": 1,
    "layers": 2,
    "passes": 2,
    "pipeline": 3,
    "render": 4,
    "generate": 4,
    "presets": 4,
    "preview": 4,
    "bench": 5,
    "farm": 5,
    "cli": 6,
}
SCENE_MAY = {"layers", "passes"}  # their settings models
REFERENCE_MAY = {"scene"}
KNOWS_SCENE = {
    "pipeline",
    "render",
    "generate",
    "presets",
    "preview",
    "bench",
    "farm",
    "cli",
}  # only these, and reference, know what a person wrote


def room(module: str) -> str:
    """Return the room of "skincli.room.rest"; the package itself is ""."""
    return module.split(".")[1] if "." in module else ""


def imports(path: Path) -> Iterator[str]:
    """Yield the full name of everything that the file imports, wherever in it."""
    package = ["skincli", *path.relative_to(PACKAGE).parent.parts]
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parents = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*parents, *([node.module] if node.module else [])])
            # `from skincli import scene` names a room in its last word.
            yield from (f"{module}.{alias.name}" for alias in node.names)


def files() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def home(path: Path) -> str:
    """Return the room a file lies in; a single file beside the rooms is a room of its own."""
    first = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    return {"__init__": "", "__main__": "cli"}.get(first, first)


def allowed(here: str, there: str) -> bool:
    """Tell whether a file of room `here` may import from room `there`."""
    rooms_above = set(LEVELS) | {"scene", "reference"}
    if there == here or there not in rooms_above:
        return True
    if here == "scene":
        return there in SCENE_MAY
    if here == "reference":
        return there in REFERENCE_MAY
    if there == "scene":
        return here in KNOWS_SCENE
    if there == "reference":
        return here in {"bench", "cli"}
    return here in LEVELS and LEVELS[there] <= LEVELS[here]


def test_the_reader_of_imports_sees_every_form(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules[__name__], "PACKAGE", tmp_path)
    (tmp_path / "gpu").mkdir()
    source = tmp_path / "gpu" / "a.py"
    source.write_text(
        "import moderngl.x\nfrom skincli import scene\nfrom skincli.graph.node import Node\n"
        "def f():\n    from ..mesh import load\n    from . import b\n"
    )
    assert sorted(imports(source)) == [
        "moderngl.x",
        "skincli.gpu.b",
        "skincli.graph.node.Node",
        "skincli.mesh.load",
        "skincli.scene",
    ]
    assert home(source) == "gpu"


def test_imports_go_one_way() -> None:
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in files()
        for name in imports(path)
        if name.startswith("skincli.") and not allowed(home(path), room(name))
    ]
    assert not wrong, "\n".join(wrong)


def test_only_gpu_imports_moderngl() -> None:
    guilty = {
        home(path) for path in files() for name in imports(path) if name.split(".")[0] in {"moderngl", "glcontext"}
    }
    assert guilty == {"gpu"}


def test_the_rooms_without_opengl_load_none() -> None:
    """Not even by way of another module."""
    rooms = {home(path) for path in files()} - set(LEVELS) - {"", "scene", "reference"}
    assert {"optics", "mesh"} <= rooms
    script = (
        f"import importlib, sys\nfor name in {sorted(rooms)}: importlib.import_module('skincli.' + name)\n"
        f"gl = {{'moderngl', 'skincli.gpu', 'skincli.graph', 'skincli.passes'}} & set(sys.modules)\nassert not gl, gl"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr


def shaders() -> list[Path]:
    return sorted(path for path in (ROOT / "shaders").rglob("*") if path.is_file())


def test_every_include_resolves() -> None:
    """From the folder of shaders, as the loader of programs does; what it generates itself is no file."""
    wrong = []
    for path in shaders():
        for name in re.findall(r'^\s*#\s*include\s+["<]([^">]+)[">]', path.read_text("utf-8"), re.MULTILINE):
            if not name.startswith("generated/") and not (ROOT / "shaders" / name).is_file():
                wrong.append(f"{path.relative_to(ROOT)} includes {name}")
    assert not wrong, "\n".join(wrong)


def test_no_sine_hash() -> None:
    """`fract` of a sine differs from driver to driver by up to 0.5; integer hashes do not."""
    pattern = re.compile(r"fract\s*\(\s*(\w+\s*\*\s*)?sin\s*\(")
    wrong = [str(path.relative_to(ROOT)) for path in shaders() if pattern.search(path.read_text("utf-8"))]
    assert not wrong, wrong


def test_no_file_is_larger_than_a_clone_should_carry() -> None:
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, timeout=60, check=False
    ).stdout
    # An unpacked archive has no list of tracked files: then all that it holds counts.
    paths = [ROOT / name for name in listed.split("\0") if name]
    if not paths:
        hidden = {".venv", ".git", "out", "build", "dist", ".mypy_cache", ".ruff_cache", ".pytest_cache"}
        paths = [path for path in ROOT.rglob("*") if not hidden & set(path.relative_to(ROOT).parts)]
    large = [f"{path.relative_to(ROOT)}" for path in paths if path.is_file() and path.stat().st_size > 4_000_000]
    assert not large, large
