"""Every stage of the pipeline agrees with its float64 twin."""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np
import pytest

from skincli.bench import stages
from skincli.bench.scene import ring
from skincli.bench.stages import STAGES, StageError, compare, compare_stages
from skincli.graph.node import Pass
from skincli.mesh.surface import tangents, uv_areas
from skincli.pipeline import Pipeline


@pytest.fixture(scope="module")
def errors(ctx: object) -> list[StageError]:
    return compare_stages()


def test_every_stage_is_its_twin(errors: list[StageError]) -> None:
    assert [error.sentence for error in errors if not error.passed] == []


def test_no_stage_is_left_out(errors: list[StageError]) -> None:
    assert {error.stage for error in errors} == {stage.name for stage in STAGES.values()}


@pytest.mark.parametrize("shading", stages.SHADINGS)
def test_both_shadings_are_compared(errors: list[StageError], shading: str) -> None:
    assert len({error.stage for error in errors if error.shading == shading}) > 8


def test_a_pass_with_a_twin_is_a_stage(errors: list[StageError], pipeline: Callable[..., Pipeline]) -> None:
    """A pass of the pictures whose file defines `twin` cannot be forgotten here."""
    drawn = {type(node) for node in pipeline().graph.nodes.values() if isinstance(node, Pass)}
    files = {kind.__module__ for kind in drawn if hasattr(sys.modules[kind.__module__], "twin")}
    assert len(files) > 8
    # The ring's texels are too wide for a window; tests/image/test_diffusion.py holds that to its twin.
    assert files - {"skincli.passes.window"} <= {kind.__module__ for kind in STAGES}


def test_every_stage_shows_something(errors: list[StageError]) -> None:
    """A stage that is black everywhere agrees with any twin."""
    dark = [error.node for error in errors if error.scale < 0.05]
    assert dark == []


def test_the_ring_is_a_mesh_that_tells_mirrored_maps_apart() -> None:
    mesh = ring(32, 16)
    dpdu, dpdv = tangents(mesh.positions, mesh.faces, mesh.uv)
    side = np.sign(np.sum(np.cross(dpdu, dpdv) * mesh.normals, axis=1))
    half = len(side) // 2
    assert (side[:half] == 1).all()
    assert (side[half:] == -1).all()
    # One chart each, with a border around it; the hole lies at the center.
    assert np.ptp(np.sign(uv_areas(mesh.atlas_uv, mesh.faces))) == 0
    assert mesh.atlas_uv.min() > 0.02
    assert mesh.atlas_uv.max() < 0.98
    assert np.hypot(mesh.positions[:, 0], mesh.positions[:, 2]).min() > 20


def test_compare_counts_what_it_says() -> None:
    expected = np.zeros((10, 10, 4))
    expected[:5] = 2.0, 4.0, 2.0, 1.0
    found = expected.copy()
    found[0, 0, 1] += 0.3
    found[0, 1, 3] -= 0.1
    measured = compare(found, expected, half=False)
    assert measured["scale"] == 4
    assert measured["bound"] == pytest.approx(4e-4)
    assert measured["maximum"] == pytest.approx(0.3)
    assert measured["share"] == pytest.approx(2 / 50)
    assert measured["rms"] == pytest.approx(np.sqrt((0.3**2 + 0.1**2) / 200))
    assert compare(found, expected, half=True)["bound"] == pytest.approx(8e-3)
    found[9, 9] = 1e-3  # where the twin leaves nothing
    assert compare(found, expected, half=False)["share"] == pytest.approx(3 / 51)
    assert compare(0 * expected, 0 * expected, half=False)["maximum"] == 0


@pytest.mark.parametrize(
    ("compares_depth", "maximum", "rms", "share", "passed"),
    [
        (False, 9e-5, 9e-5, 0.0, True),
        (False, 1.1e-4, 1e-6, 1e-5, False),
        (False, np.nan, 0.0, 0.0, False),
        (True, 0.5, 4e-4, 9e-4, True),
        (True, 0.5, 4e-4, 1.1e-3, False),
        (True, 0.5, 6e-4, 9e-4, False),
        (True, 0.5, np.nan, 9e-4, False),
    ],
)
def test_the_two_rules(compares_depth: bool, maximum: float, rms: float, share: float, passed: bool) -> None:
    error = StageError(
        "blur", "diffused", "paper", "rgba32f", compares_depth, maximum, rms, share, scale=1.0, bound=1e-4
    )
    assert error.passed is passed
    assert error.entry()["passed"] is passed
    assert "diffused" in error.sentence
