"""The figures of the paper show what they are meant to show: their panels differ, and in the right direction."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray

from skincli import images
from skincli.mesh.builtin import DETAILS

FILE = Path(__file__).parents[2] / "examples" / "paper" / "figures.py"

COARSE = DETAILS["creature"][0]

#: least mean absolute difference of neighboring panels, linear, where full light on white skin is about 1
LEAST = 0.004


def load_script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("paper_figures", FILE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


script = load_script()


@pytest.fixture(scope="module")
def figure(ctx: object) -> Any:
    """Make a figure, small, of a coarse creature, one sample a pixel."""
    studio = script.Studio((128, 128), atlas=640, detail=COARSE)
    studio.sets += ["skin.size=768", "render.supersample=1"]
    made: dict[str, Any] = {}

    def make(number: str) -> Any:
        if number not in made:
            made[number] = script.FIGURES[number](studio)
        return made[number]

    return make


def contrast(panel: Any) -> float:
    """Return how far a pixel of the creature commonly lies off the mean of those beside it; edges do not count."""
    inside = panel.mask[:, 2:] & panel.mask[:, 1:-1] & panel.mask[:, :-2]
    return float(np.median(np.abs(np.diff(panel.values, 2, axis=1))[inside]))


def on_creature(panel: Any) -> NDArray[np.float32]:
    values: NDArray[np.float32] = panel.values[panel.mask]
    return values


@pytest.mark.parametrize("number", list(script.FIGURES))
def test_neighboring_panels_differ(figure: Any, number: str) -> None:
    made = figure(number)
    for panel in made.panels:
        assert np.isfinite(panel.values).all()
        assert panel.mask.mean() > 0.2, panel.label
        assert on_creature(panel).std() > 0.01, panel.label
    for one, other in made.neighbors():
        assert script.difference(one, other) > LEAST, (one.label, other.label)


def test_only_panels_of_a_row_are_neighbors(figure: Any) -> None:
    made = figure("4")
    pairs = [(one.label, other.label) for one, other in made.neighbors()]
    labels = [panel.label for panel in made.panels]
    assert pairs == [(labels[i], labels[i + 1]) for i in (0, 1, 3, 4)]


def test_bumps_roughen_the_light(figure: Any) -> None:
    smooth, bumpy, rough = map(contrast, figure("4").panels[:3])
    assert 1.1 * smooth < bumpy
    assert 1.2 * bumpy < rough


def test_a_wider_blur_softens_the_light(figure: Any) -> None:
    for row in (slice(0, 3), slice(3, 6)):
        narrow, middle, wide = map(contrast, figure("5").panels[row])
        assert narrow > middle > wide


def test_depth_alone_darkens_flat_skin(figure: Any) -> None:
    sphere, hemisphere = figure("8").panels
    for panel in (sphere, hemisphere, *figure("9").panels, *figure("10").panels):
        assert on_creature(panel).min() >= 0
        assert on_creature(panel).max() <= 1
    open_skin = hemisphere.mask & (hemisphere.values[..., 0] > 0.95)
    assert open_skin.mean() > 0.2
    # Half of a sphere about a point of a plane lies below it, and most of that far enough to count.
    assert 0.4 < np.median(sphere.values[open_skin]) < 0.75


def test_occlusion_damps_the_reflection(figure: Any) -> None:
    untreated, damped = figure("12").panels
    assert (damped.values <= untreated.values + 1e-6).all()
    assert damped.values[damped.mask].mean() < 0.97 * untreated.values[damped.mask].mean()


def test_light_in_the_skin_step_by_step(figure: Any) -> None:
    lit, blurred, shaded, glossy = figure("14").panels
    assert contrast(blurred) < contrast(lit)
    assert (shaded.values <= blurred.values + 1e-6).all()
    assert (glossy.values >= shaded.values - 1e-6).all()


def test_effects_add_and_take_away_light(figure: Any) -> None:
    plain, mirrored, shaded, both = (panel.values for panel in figure("15").panels)
    assert (mirrored >= plain - 1e-6).all()
    assert (shaded <= plain + 1e-6).all()
    assert (both <= mirrored + 1e-6).all()
    assert (both >= shaded - 1e-6).all()


def test_sheets_are_written(ctx: object, tmp_path: Path) -> None:
    options = ["-o", str(tmp_path), "--size", "48x40", "--atlas", "64", "--detail", COARSE, "9"]
    result = CliRunner().invoke(script.main, options)
    assert result.exit_code == 0, result.output
    assert "high frequency | b  low frequency" in result.output
    assert [path.name for path in tmp_path.iterdir()] == ["fig09.png"]
    width, height = images.size_of(tmp_path / "fig09.png")
    assert width > 2 * 48
    assert height > 40


def test_a_wrong_size_is_a_usage_error() -> None:
    result = CliRunner().invoke(script.main, ["--size", "wide"])
    assert result.exit_code == 2
    assert "'wide' is no size; write width and height as in 480x540" in result.output
