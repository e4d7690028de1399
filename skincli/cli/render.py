"""Render a scene to a picture and its data layers."""

from __future__ import annotations

from pathlib import Path

import click


@click.command()
@click.argument("scene", type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path), required=True, help="picture: NAME.exr or NAME.png")
@click.option("--set", "sets", multiple=True, metavar="PATH=VALUE", help="change a value, such as camera.fov=20")
@click.option("--outputs", "names", metavar="A,B,...", help="outputs to write, in place of the scene's")
@click.option(
    "--asset-root", "roots", multiple=True, type=click.Path(path_type=Path), help="folder files may come from"
)
@click.option("--explain", is_flag=True, help="print what ran, was reused or skipped, and why")
@click.option("--report", type=click.Path(path_type=Path), metavar="FILE.json", help="write times, keys and versions")
@click.option("--no-skip", is_flag=True, help="run every pass of the shading mode, remember nothing")
@click.option("--check", is_flag=True, help="fail where any pass left a NaN or Inf, and name it")
@click.option("--require-gpu", is_flag=True, help="fail rather than draw in software")
def command(
    scene: Path,
    output: Path,
    sets: tuple[str, ...],
    names: str | None,
    roots: tuple[Path, ...],
    explain: bool,
    report: Path | None,
    no_skip: bool,
    check: bool,
    require_gpu: bool,
) -> None:
    """Render SCENE, a YAML file, to the picture OUTPUT.

    An EXR file holds all outputs of picture size as layers, and those of texture space in NAME.atlas.exr. PNG writes
    one file per output: NAME.png for beauty, NAME.OUTPUT.png for others. EXR is for measuring: in PNG a normal is
    stored as 0.5 + 0.5 n, and depth and positions span the range they have in the picture, which the report tells.
    Missing folders are made.
    """
    from skincli import render
    from skincli.errors import Fault, UsageError
    from skincli.files import asset_roots
    from skincli.gpu.context import get_context
    from skincli.images import require_writable
    from skincli.pipeline import OUTPUTS, Pipeline, load_scene_mesh
    from skincli.reference.texels import diffuse_texels
    from skincli.scene.model import check_outputs
    from skincli.scene.paths import load_scene

    target = render.Target(output)
    if report is not None and report.suffix != ".json":
        raise UsageError(f"--report {report}: a report ends in .json; write for example {report.stem or 'report'}.json")
    if names is not None:
        unknown = check_outputs([name.strip() for name in names.split(",") if name.strip()], OUTPUTS)
        if unknown:
            raise UsageError([Fault(message, f"--outputs {names}") for message in unknown])
        sets = (*sets, f"outputs=[{names}]")
    loaded = load_scene(scene, sets, asset_roots(roots), outputs=OUTPUTS)
    # What fails quickly comes first: files to write, the device, and only then the mesh.
    target.require_writable(loaded.scene.outputs)
    if report is not None:
        require_writable(report)
    get_context(require_gpu)
    mesh = load_scene_mesh(loaded, use_cache=not no_skip)
    pipeline = Pipeline(loaded, mesh, skip=not no_skip, exact=diffuse_texels, single=True)
    timing = explain or report is not None
    frame = {"frame": 1, **render.render_frame(pipeline, target, loaded.scene.outputs, timing, check)}
    if report is not None:
        render.write_report(report, [frame])
    if explain:
        click.echo(render.explain(frame))
