"""Regenerates Figures 3, 4, 5, 8, 9, 10, 12, 13, 14 and 15 of the seed paper on the built-in creature.

Each becomes a contact sheet with labelled panels, and a line says by how much neighboring panels differ. The scene is
creature.yaml, beside this file. Run from anywhere: python examples/paper/figures.py -o out/paper
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray

from skincli import images
from skincli.color import srgb_decode
from skincli.errors import SkincliError
from skincli.graph.store import Store
from skincli.layers.color import Color
from skincli.mesh.builtin import DETAILS
from skincli.mesh.model import Mesh
from skincli.pipeline import Pipeline, load_scene_mesh
from skincli.render import data_to_unit
from skincli.scene.paths import LoadedScene, load_scene

HERE = Path(__file__).parent

Array = NDArray[np.float32]

#: where the camera looks, mm, and its field of view, degrees
BROW = ((-30.0, 50.0, 95.0), 9.0)
CHEEK = ((-55.0, 14.0, 85.0), 7.5)
EYES = ((-12.0, 28.0, 90.0), 10.5)
FACE = ((-10.0, 10.0, 80.0), 15.0)
MOUTH = ((-15.0, -60.0, 90.0), 13.0)
TANGLE = ((-35.0, -60.0, 85.0), 9.0)

NO_MIRROR = "render.effects.reflection=false"
NO_GLOSS = "render.effects.specular=false"
NO_OCCLUSION = ("render.effects.occlusion_high=false", "render.effects.occlusion_low=false")
NO_BLUR = "render.effects.blur=false"


def seen(camera: tuple[tuple[float, ...], float]) -> tuple[str, str]:
    """Return the settings that turn the scene's camera to a target and narrow its view."""
    target, fov = camera
    return f"camera.target={list(target)}", f"camera.fov={fov}"


@dataclass(frozen=True)
class Panel:
    """One picture of a figure.

    Parameters
    ----------
    label : what stands below it
    picture : (h, w, 3) light of a display, linear, 0 to 1
    values : (h', w', c) what is compared: scene-linear light, or data
    mask : (h', w') where the creature is
    """

    label: str
    picture: Array
    values: Array
    mask: NDArray[np.bool_]


@dataclass(frozen=True)
class Figure:
    """Panels in rows, as the paper shows them."""

    title: str
    columns: int
    panels: Sequence[Panel]

    def neighbors(self) -> list[tuple[Panel, Panel]]:
        """Return the panels that stand side by side."""
        pairs = zip(self.panels, self.panels[1:], strict=False)
        return [pair for index, pair in enumerate(pairs) if (index + 1) % self.columns]


def difference(one: Panel, other: Panel) -> float:
    """Return the mean absolute difference of two panels' values where both show the creature."""
    both = one.mask & other.mask
    return float(np.abs(one.values[both] - other.values[both]).mean())


class Studio:
    """Renders the scene with other settings; what two panels have in common is computed once.

    Parameters
    ----------
    size : width and height of a panel, pixels
    atlas : side of the atlas, texels; None: the paper's
    detail : of the mesh, one of its DETAILS
    """

    def __init__(self, size: tuple[int, int], atlas: int | None = None, detail: str = "259k") -> None:
        self.size = size
        # The paper has a bumpiness of 1 in all figures but Figure 4.
        self.sets = [
            f"render.size={list(size)}",
            f"mesh.detail={detail}",
            "skin.surface.bumpiness=1",
            "skin.surface.reflectance=0.1",
        ]
        if atlas is not None:
            self.sets.append(f"render.atlas={atlas}")
        self.store = Store()

    def load(self, sets: Sequence[str] = (), colored: bool = True) -> LoadedScene:
        """Return the scene with settings; without color its skin is white, with the same relief and gloss."""
        # White skin sends back all light: the picture, though not what is compared, is exposed for it.
        exposure = () if colored else ("camera.exposure=-1",)
        # The environment lies beside the folder of the paper's scene.
        loaded = load_scene(HERE / "creature.yaml", (*self.sets, *exposure, *sets), (HERE.parent,))
        if colored:
            return loaded
        coat = Color(albedo=(1.0, 1.0, 1.0))
        skins = {
            part: own._replace(skin=own.skin.model_copy(update={"layers": (*own.skin.layers, coat)}))
            for part, own in loaded.skins.items()
        }
        return replace(loaded, skins=skins)

    @cached_property
    def mesh(self) -> Mesh:
        """The creature."""
        return load_scene_mesh(self.load())

    @cached_property
    def background(self) -> Array:
        """(3,) light around the creature."""
        return np.array(self.load().scene.background or (0, 0, 0), np.float32)

    def arrays(
        self, outputs: Sequence[str], sets: Sequence[str] = (), colored: bool = True, display: bool = False
    ) -> dict[str, Array]:
        """Return outputs of the scene with settings."""
        return Pipeline(self.load(sets, colored), self.mesh, self.store).run(outputs, display)

    def beauty(self, label: str, *sets: str, colored: bool = True) -> Panel:
        """Return the picture of the scene with settings."""
        found = self.arrays(["beauty", "depth"], sets, colored, display=True)
        return Panel(label, found["display"][..., :3], found["beauty"][..., :3], found["depth"][..., 0] > 0)

    def factor(self, label: str, output: str, *sets: str) -> Panel:
        """Return an occlusion output; as in the paper, its numbers are shown as they are, black to white."""
        found = self.arrays([output, "depth", "albedo"], sets, colored=False)
        values, coverage = found[output].repeat(3, axis=2), found["albedo"]  # of white skin
        picture = coverage * srgb_decode(values) + (1 - coverage) * self.background
        return Panel(label, picture.astype(np.float32), values, found["depth"][..., 0] > 0)


# Figures -----------------------------------------------------------------------------------------------------------


def figure_3(studio: Studio) -> Figure:
    """The contents of the atlas, above; the texels about an eye, below, since the whole hides the blur."""
    outputs = {
        "atlas_normal": "normal",
        "atlas_position": "position",
        "irradiance": "ambient + diffuse",
        "diffused": "blurred",
    }
    found = studio.arrays(list(outputs))
    mask = np.linalg.norm(found["atlas_normal"], axis=-1) > 0
    distance = np.linalg.norm(found["atlas_position"] + studio.mesh.origin - np.array(BROW[0]), axis=-1)
    row, column = np.unravel_index(np.where(mask, distance, np.inf).argmin(), mask.shape)
    side, atlas = studio.size[0], mask.shape[0]
    half = min(side // 4, atlas // 8)
    top, left = (int(np.clip(at - half, 0, atlas - 2 * half)) for at in (row, column))
    window = (slice(top, top + 2 * half), slice(left, left + 2 * half))
    whole, close = [], []
    for letter, (output, label) in zip("abcd", outputs.items(), strict=True):
        data = output.startswith("atlas")
        values = data_to_unit(output, found[output]) if data else found[output]
        picture = np.where(mask[..., None], srgb_decode(values) if data else values, studio.background)
        whole.append(Panel(f"{letter}  {label}", images.resize(picture, side, side), values, mask))
        texels = np.repeat(np.repeat(picture[window], 2, axis=0), 2, axis=1).astype(np.float32)
        close.append(Panel(f"{letter}  {2 * half} x {2 * half} texels", texels, values[window], mask[window]))
    return Figure("Figure 3  contents of the atlas", 4, [*whole, *close])


def figure_4(studio: Studio) -> Figure:
    """Bumpiness 0, 0.75 and 3; without color and environment above, complete below."""
    bumps = [(letter, f"skin.surface.bumpiness={bump}", bump) for letter, bump in zip("abc", (0, 0.75, 3), strict=True)]
    plain = [
        studio.beauty(f"{letter}  bumpiness {bump:g}", setting, NO_MIRROR, *seen(FACE), colored=False)
        for letter, setting, bump in bumps
    ]
    complete = [studio.beauty(f"{letter}  {bump:g}, complete", setting, *seen(FACE)) for letter, setting, bump in bumps]
    return Figure("Figure 4  bumpiness", 3, [*plain, *complete])


def figure_5(studio: Studio) -> Figure:
    """Blur of 3, 8 and 13 texels; ambient and diffuse light above, with highlights and occlusion below."""
    blurs = [(letter, f"skin.surface.blur={width}", width) for letter, width in zip("abc", (3, 8, 13), strict=True)]
    soft = [
        studio.beauty(
            f"{letter}  {width} x {width} texels", blur, NO_MIRROR, NO_GLOSS, *NO_OCCLUSION, *seen(BROW), colored=False
        )
        for letter, blur, width in blurs
    ]
    whole = [
        studio.beauty(f"{letter}  with specular and SSAO", blur, NO_MIRROR, *seen(BROW), colored=False)
        for letter, blur, _ in blurs
    ]
    return Figure("Figure 5  width of the blur", 3, [*soft, *whole])


def figure_8(studio: Studio) -> Figure:
    """Occlusion from depth alone, and from normals as well."""
    panels = [
        studio.factor(label, "occlusion", f"render.occlusion.samples={samples}", *seen(CHEEK))
        for label, samples in (("a  depth only, sphere", "sphere"), ("b  normals, hemisphere", "hemisphere"))
    ]
    return Figure("Figure 8  occlusion", 2, panels)


def figure_9(studio: Studio) -> Figure:
    """The two bands of the occlusion."""
    panels = [
        studio.factor(label, output, *seen(EYES))
        for label, output in (("a  high frequency", "occlusion_high"), ("b  low frequency", "occlusion_low"))
    ]
    return Figure("Figure 9  bands", 2, panels)


def figure_10(studio: Studio) -> Figure:
    """The bands joined by Equation 1."""
    return Figure("Figure 10", 1, [studio.factor("occlusion, Equation 1", "occlusion", *seen(FACE))])


def figure_12(studio: Studio) -> Figure:
    """A strong reflection as it is, and damped by the occlusion."""
    panels = [
        studio.beauty(
            label,
            "skin.surface.reflectance=0.75",
            f"render.effects.reflection_damping={damped}",
            "camera.exposure=-1",
            *seen(TANGLE),
        )
        for label, damped in (("a  reflection untreated", "false"), ("b  damped by SSAO", "true"))
    ]
    return Figure("Figure 12  reflectance 0.75", 2, panels)


def figure_13(studio: Studio) -> Figure:
    """The final picture, twice as large as other panels."""
    large = f"render.size={[2 * side for side in studio.size]}"
    return Figure("Figure 13", 1, [studio.beauty("final, reflectance 0.1", large, "skin.surface.reflectance=0.1")])


def figure_14(studio: Studio) -> Figure:
    """Light in the skin, step by step."""
    steps = {
        "a  ambient + diffuse": (NO_BLUR, NO_GLOSS, *NO_OCCLUSION),
        "b  blurred": (NO_GLOSS, *NO_OCCLUSION),
        "c  with SSAO": (NO_GLOSS,),
        "d  with specular": (),
    }
    panels = [studio.beauty(label, *sets, NO_MIRROR, *seen(FACE), colored=False) for label, sets in steps.items()]
    return Figure("Figure 14  subsurface scattering, step by step", 4, panels)


def figure_15(studio: Studio) -> Figure:
    """Scattering with and without environment and occlusion."""
    steps = {
        "a  SSS": (NO_MIRROR, *NO_OCCLUSION),
        "b  SSS + environment": NO_OCCLUSION,
        "c  SSS + SSAO": (NO_MIRROR,),
        "d  SSS + both": (),
    }
    panels = [studio.beauty(label, *sets, *seen(MOUTH)) for label, sets in steps.items()]
    return Figure("Figure 15  composition of the effects", 4, panels)


FIGURES: Mapping[str, Callable[[Studio], Figure]] = {
    "3": figure_3,
    "4": figure_4,
    "5": figure_5,
    "8": figure_8,
    "9": figure_9,
    "10": figure_10,
    "12": figure_12,
    "13": figure_13,
    "14": figure_14,
    "15": figure_15,
}


# Files -------------------------------------------------------------------------------------------------------------


def sheet(figure: Figure) -> Array:
    """Return a figure as one picture."""
    return images.contact_sheet([(panel.label, panel.picture) for panel in figure.panels], figure.columns)


def size_of(context: click.Context, parameter: click.Parameter, text: str) -> tuple[int, int]:
    """Return width and height written as 480x540."""
    width, cross, height = text.partition("x")
    if not (cross and width.isdecimal() and height.isdecimal()):
        raise click.BadParameter(f"'{text}' is no size; write width and height as in 480x540")
    return int(width), int(height)


@click.command()
@click.argument("figures", nargs=-1, type=click.Choice(list(FIGURES)))
@click.option("-o", "--output", type=click.Path(path_type=Path), default=Path("out/paper"), help="folder of the sheets")
@click.option("--size", default="480x540", callback=size_of, metavar="WxH", help="size of a panel, pixels")
@click.option("--atlas", type=int, metavar="N", help="side of the atlas, texels; left out: the paper's 2500")
@click.option("--detail", type=click.Choice(DETAILS["creature"]), default="259k", help="detail of the creature")
def main(figures: Sequence[str], output: Path, size: tuple[int, int], atlas: int | None, detail: str) -> None:
    """Write fig03.png to fig15.png, or the FIGURES that are named, and say how much neighboring panels differ."""
    try:
        studio = Studio(size, atlas, detail)
        for number in figures or FIGURES:
            file = output / f"fig{int(number):02}.png"
            images.require_writable(file)
            figure = FIGURES[number](studio)
            images.write_png(file, sheet(figure))
            click.echo(f"{figure.title} -> {file}")
            for one, other in figure.neighbors():
                click.echo(f"  {difference(one, other):.4f}  {one.label} | {other.label}")
    except SkincliError as problem:
        raise click.ClickException(str(problem)) from None


if __name__ == "__main__":
    main()
