"""Files named in YAML stay inside the folders that a person has allowed."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from skincli import resources
from skincli.errors import InputError
from skincli.files import ROOTS_VARIABLE, asset_roots, resolve


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """Return a folder: work/{scene, other} with an image each, and links that lead about."""
    for name in ("scene", "other", "scene/sub"):
        (tmp_path / "work" / name).mkdir(parents=True)
        (tmp_path / "work" / name / "skin.png").write_text("x")
    work = tmp_path / "work"
    (work / "scene" / "inside.png").symlink_to(work / "scene" / "sub" / "skin.png")
    (work / "scene" / "escape.png").symlink_to(work / "other" / "skin.png")
    (work / "scene" / "door").symlink_to(work / "other")
    (work / "scene" / "loop.png").symlink_to(work / "scene" / "loop.png")
    (work / "linked").symlink_to(work / "scene")
    return work


def refused(text: str, base: Path, roots: tuple[Path, ...] = ()) -> str:
    with pytest.raises(InputError) as caught:
        resolve(text, base, roots, "mesh.file")
    assert caught.value.exit_code == 3
    return str(caught.value)


def test_inside(tree: Path) -> None:
    scene = tree / "scene"
    assert resolve("skin.png", scene, (), "x") == scene / "skin.png"
    assert resolve("sub/../skin.png", scene, (), "x") == scene / "skin.png"
    assert resolve("inside.png", scene, (), "x") == scene / "sub" / "skin.png"
    assert resolve("skin.png", tree / "linked", (), "x") == scene / "skin.png"
    assert resolve(scene / "skin.png", scene, (), "x") == scene / "skin.png"


def test_outside(tree: Path) -> None:
    scene = tree / "scene"
    rest = (
        f"outside the folder '{scene}'; move the file into that folder, "
        f"or allow its own with --asset-root DIR or SKINCLI_ASSET_ROOTS"
    )
    assert refused("../other/skin.png", scene) == f"mesh.file is '../other/skin.png'; it leads {rest}"
    assert refused("/etc/passwd", scene) == f"mesh.file is '/etc/passwd'; it leads {rest}"
    assert refused("escape.png", scene) == f"mesh.file is 'escape.png'; it leads by a symbolic link {rest}"
    assert refused("door/skin.png", scene) == f"mesh.file is 'door/skin.png'; it leads by a symbolic link {rest}"
    # Whether a file exists elsewhere is not told.
    assert refused("../other/none.png", scene) == f"mesh.file is '../other/none.png'; it leads {rest}"
    # A sibling whose name begins alike is not inside.
    assert "outside" in refused("../scene2/skin.png", scene)


def test_roots_open_other_folders(tree: Path) -> None:
    scene, other = tree / "scene", tree / "other"
    for text in ("../other/skin.png", "escape.png", "door/skin.png", str(other / "skin.png")):
        assert resolve(text, scene, (other,), "x") == other / "skin.png"
    assert "outside" in refused("../skin.png", scene, (other,))


def test_presets_are_always_allowed(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resources, "folder", lambda name: tree / "other")
    assert resolve("../other/skin.png", tree / "scene", (), "x") == tree / "other" / "skin.png"


@pytest.mark.parametrize("text", ["file:///etc/passwd", "file:skin.png", "http://x.org/a.png", "s3://b/c"])
def test_urls(text: str, tree: Path) -> None:
    assert refused(text, tree / "scene") == (
        f"mesh.file is '{text}'; it must be a path, not a URL; save the file beside the scene and write its name"
    )


def test_missing(tree: Path) -> None:
    scene = tree / "scene"
    assert refused("skn.png", scene) == f"mesh.file is 'skn.png'; no such file in '{scene}'; did you mean 'skin.png'?"
    assert refused("subb/a.png", scene) == f"mesh.file is 'subb/a.png'; no such file: there is no folder '{scene}/subb'"
    assert refused("sub", scene) == "mesh.file is 'sub'; that is a folder; name a file in it"
    assert refused("", scene) == "mesh.file is ''; it must be the path of a file"
    assert refused("a\0b", scene) == r"mesh.file is 'a\x00b'; it must be the path of a file"
    assert "loop.png" in refused("loop.png", scene)
    assert "cannot be read" in refused("x" * 5000, scene)


def test_asset_roots(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(ROOTS_VARIABLE, os.pathsep.join([str(tree / "scene"), "", str(tree / "linked")]))
    assert asset_roots([tree / "other"]) == (tree / "other", tree / "scene", tree / "scene")
    monkeypatch.setenv(ROOTS_VARIABLE, "/no/such/folder")
    with pytest.raises(InputError, match="SKINCLI_ASSET_ROOTS names '/no/such/folder', which is not a folder"):
        asset_roots()
    monkeypatch.delenv(ROOTS_VARIABLE)
    assert asset_roots() == ()
    with pytest.raises(InputError, match="--asset-root names"):
        asset_roots([tree / "scene" / "skin.png"])
