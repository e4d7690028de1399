"""`skincli reference`: the picture and its error, and what a person is told when there is none."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest
from click.testing import Result

Run = Callable[..., Result]


def test_without_mitsuba_it_says_how_to_install_it(folder: Path, skincli: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    done = skincli("reference", "scene.yaml", "-o", "out.exr")
    assert done.exit_code == 4
    assert "needs Mitsuba 3" in done.stderr
    assert "pip install 'skincli[reference]'" in done.stderr
    assert not (folder / "out.exr").exists()


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("scene.yaml", "-o", "out.png"), 2, "a reference ends in .exr"),
        (("scene.yaml", "-o", "out.exr", "--sigma-a", "1,1,1"), 2, "give both"),
        (("scene.yaml", "-o", "out.exr", "--sigma-a", "1,1"), 2, "three numbers"),
        (("scene.yaml", "-o", "out.exr", "--spp", "1"), 2, "2<=x"),
        (("none.yaml", "-o", "out.exr"), 3, "none.yaml"),
        (("scene.yaml", "-o", "out.exr", "--set", "camera.fov=500"), 3, "camera.fov"),
        (("scene.yaml", "-o", "scene.yaml/out.exr"), 7, "cannot be written"),
    ],
)
def test_bad_requests_are_refused_before_mitsuba_is_asked_for(
    folder: Path, skincli: Run, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], code: int, message: str
) -> None:
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    done = skincli("reference", *arguments)
    assert done.exit_code == code, done.stderr
    assert message in done.stderr
    assert not list(folder.glob("**/*out.*"))


def test_picture_and_error_are_written_and_told(folder: Path, skincli: Run) -> None:
    pytest.importorskip("mitsuba")
    small = ("--set", "render.size=[16, 12]", "--variant", "scalar_rgb", "--spp", 32)
    done = skincli("reference", "scene.yaml", "-o", "deep/out.exr", *small, "--max-error", 1e-4, "--json")
    assert done.exit_code == 0, done.stderr
    assert "the error is" in done.stderr  # and not yet what was asked for
    told = json.loads(done.stdout)
    assert told["output"] == "deep/out.exr"
    assert told["variant"] == "scalar_rgb"
    assert told["boundary"] == "matched"
    assert told["spp"] == 32
    assert 0.001 < told["relative_rmse"] < 0.5
    assert {"skincli", "mitsuba", "drjit"} <= told["versions"].keys()
    source = oiio.ImageInput.open("deep/out.exr")
    pixels, names = source.read_image(oiio.FLOAT), source.spec().channelnames
    source.close()
    channels = dict(zip(names, np.moveaxis(pixels, -1, 0), strict=True))
    assert set(channels) == {"R", "G", "B", "A", "error.R", "error.G", "error.B"}
    inside = channels["A"] == 1
    assert 10 < inside.sum() < inside.size
    errors, values = ([channels[f"{layer}{c}"][inside] for c in "RGB"] for layer in ("error.", ""))
    left = np.sqrt(np.mean(np.square(errors)) / np.mean(np.square(values)))
    assert left == pytest.approx(told["relative_rmse"], rel=1e-4)
    assert not channels["R"][channels["A"] == 0].any()


def test_a_medium_in_numbers_replaces_that_of_the_skin(folder: Path, skincli: Run) -> None:
    pytest.importorskip("mitsuba")
    black = ("--sigma-a", "1,1,1", "--sigma-s", "0,0,0")
    done = skincli(
        "reference", "scene.yaml", "-o", "out.exr", "--set", "render.size=[8, 6]", "--variant", "scalar_rgb",
        "--spp", 2, *black,
    )  # fmt: skip
    assert done.exit_code == 0, done.stderr
    assert "0.00% error left" in done.stdout
