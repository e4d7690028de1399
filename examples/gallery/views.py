"""Draws the built-in meshes from five sides, as unlit clay and lit in their example's skin, for the gallery.

Run from anywhere: python examples/gallery/views.py -o out/views
"""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np

from skincli import images
from skincli.errors import SkincliError
from skincli.graph.store import Store
from skincli.mesh.model import Mesh
from skincli.passes.camera import look_at
from skincli.pipeline import Pipeline, load_scene_mesh
from skincli.scene.model import Camera
from skincli.scene.paths import load_scene

EXAMPLES = Path(__file__).parents[1]
SCENES = {"head": "01_human.yaml", "creature": "02_octopus.yaml"}

SIZE = (288, 324)
FOV = 20.0
MARGIN = 1.04

#: where the camera stands, seen from the mesh, and what is up in the picture
VIEWS = {
    "front": ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
    "three quarters": ((-0.7, 0.15, 0.7), (0.0, 1.0, 0.0)),
    "side": ((-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    "back": ((0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
    "above": ((0.0, 1.0, 0.0), (0.0, 0.0, -1.0)),
}

#: Gray all over, in light that comes from everywhere: only the shape is seen. Occlusion by depth alone marks not only
#: what hides light from the surface; it also lets ridges stand out bright from hollows.
CLAY = (
    "skin={skin: 1, size: 16, layers: [{color: {albedo: [0.5, 0.5, 0.5]}}]}",
    "lights=[]",
    "environment=null",
    "ambient=[1.7, 1.7, 1.7]",
    "render.effects={blur: false, specular: false}",
    "render.occlusion={samples: sphere, radius_high: 8, radius_low: 30, a: 1, b: 1}",
)


def cameras(mesh: Mesh) -> dict[str, Camera]:
    """Return a camera for each of VIEWS, all as far away as the view that needs most room asks for."""
    lenses, targets, distance = {}, {}, 0.0
    for name, (direction, up) in VIEWS.items():
        lens = lenses[name] = look_at(np.array(direction), np.zeros(3), np.array(up), FOV, SIZE, 1.0)
        axes = np.array([lens.right, lens.up, lens.forward])
        seen = mesh.positions @ axes.T
        middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
        targets[name] = mesh.origin + middle @ axes
        away = np.abs(seen - middle)[:, :2] / lens.tan_half - (seen - middle)[:, 2:]
        distance = max(distance, MARGIN * float(away.max()))
    return {
        name: Camera(
            position=tuple(map(float, targets[name] - distance * np.array(lens.forward))),
            target=tuple(map(float, targets[name])),
            up=lens.up,
            fov=FOV,
        )
        for name, lens in lenses.items()
    }


def sheet(scene: Path, sets: tuple[str, ...]) -> images.Image:
    """Return the views of a scene's mesh side by side."""
    loaded = load_scene(scene, (f"render.size={list(SIZE)}", *sets))
    mesh = load_scene_mesh(loaded)
    pipeline = Pipeline(loaded, mesh, Store())
    panels = []
    for name, camera in cameras(mesh).items():
        pipeline.look_from(camera)
        panels.append((name, pipeline.run([], display=True)["display"][..., :3]))
    return images.contact_sheet(panels, len(panels))


@click.command()
@click.option("-o", "--output", type=click.Path(path_type=Path), default=Path("out/views"), help="folder of the sheets")
def main(output: Path) -> None:
    """Write MESH_clay.png and MESH_lit.png for each built-in mesh."""
    try:
        for mesh, scene in SCENES.items():
            for look, sets in (("clay", CLAY), ("lit", ())):
                file = output / f"{mesh}_{look}.png"
                images.require_writable(file)
                images.write_png(file, sheet(EXAMPLES / scene, sets))
                click.echo(f"{scene} -> {file}")
    except SkincliError as problem:
        raise click.ClickException(str(problem)) from None


if __name__ == "__main__":
    main()
