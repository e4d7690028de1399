"""Hold every stage against its exact twin, every method against the exact one, and all of them against the clock."""

from __future__ import annotations

import tempfile
from pathlib import Path

import click


class Bench(click.Group):
    """Measures, unless the first word is the name of a command."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Let what names no command be the scene and the options of the nameless one, which measures."""
        return super().parse_args(ctx, args if args and args[0] in self.commands else ["", *args])


command = Bench("bench", short_help="Measure time and error of every stage and method on this device.")


@command.command("")
@click.argument("scene", required=False, type=click.Path(path_type=Path))
@click.option("--set", "sets", multiple=True, metavar="PATH=VALUE", help="change a value of SCENE")
@click.option(
    "--asset-root", "roots", multiple=True, type=click.Path(path_type=Path), help="folder files may come from"
)
@click.option("--max-error", type=float, metavar="E", help="pick the cheapest point whose relative RMSE is at most E")
@click.option("--full", is_flag=True, help="sweep all settings of all methods, and time single layers; takes long")
@click.option("--paper", is_flag=True, help="measure the frame rates of the seed paper's Table 1 instead")
@click.option("--stress", is_flag=True, help="run every stage at the ends of all ranges instead")
@click.option(
    "--diffusion", is_flag=True, help="measure the diffusion alone: error, cost, seams; on SCENE's mesh if given"
)
@click.option("--json", "as_json", is_flag=True, help="print one JSON object instead of tables")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="also write bench.json, bench.txt, bench.html",
)
def measure(
    scene: Path | None,
    sets: tuple[str, ...],
    roots: tuple[Path, ...],
    max_error: float | None,
    full: bool,
    paper: bool,
    stress: bool,
    diffusion: bool,
    as_json: bool,
    output: Path | None,
) -> None:
    """Measure time and error of every stage and method on this device.

    Without SCENE a head is rendered, and the stages are held against their float64 twins as well. The error of a method
    is that of its linear picture inside the silhouette against `diffusion: exact`; a star marks the points than which
    none is both faster and nearer to it.

    --diffusion makes light in float64 on the texels of each mesh, in its own atlas and in one by xatlas, and tells the
    error of the passes from that of the texels; the atlas is that of SCENE, else of the quality standard.

    Ends with exit code 1 where a stage or the diffusion differs from what is exact by more than is allowed, a case of
    --stress is neither that exact nor refused as documented, or the point that --max-error picks does not hold it when
    rendered again; with 6 where no point is that near.

    `skincli bench compare OLD NEW` tells what became better or worse from one bench.json to another.
    """
    from skincli.bench import report, surfaces, timing
    from skincli.bench.extremes import CASES
    from skincli.bench.fronts import Found, Sweep
    from skincli.bench.generator import time_layers, time_presets
    from skincli.bench.scene import load
    from skincli.bench.stages import StageError, compare_stages
    from skincli.bench.stress import Outcome, run
    from skincli.errors import Fault, SkincliError, UsageError
    from skincli.files import asset_roots
    from skincli.pipeline import OUTPUTS, load_scene_mesh
    from skincli.scene.paths import LoadedScene, load_scene

    if (paper or stress) and (scene is not None or full or max_error is not None or diffusion):
        raise UsageError(
            "--paper and --stress have scenes of their own; leave out SCENE, --full, --diffusion and --max-error"
        )
    if diffusion and max_error is not None:
        raise UsageError("--diffusion picks no point; leave out --max-error")
    if sets and scene is None:
        raise UsageError("--set changes a scene of yours; name its file")
    errors: list[StageError] = []
    outcomes: list[Outcome] = []
    sweep: Found | None = None
    measured: surfaces.Found | None = None
    with tempfile.TemporaryDirectory() as folder:

        def make(*more: str) -> LoadedScene:
            if scene is not None:
                return load_scene(scene, (*sets, *more), asset_roots(roots), outputs=OUTPUTS)
            return load(Path(folder), timing.TIMED_SCENE, *timing.TIMED_SETS, *more)

        if paper or stress:
            outcomes = run(CASES) if stress else []
            found = report.document(paper=timing.time_paper_table() if paper else (), stress=outcomes)
        elif diffusion:
            if scene is not None:
                loaded = make()
                meshes = {scene.stem: load_scene_mesh(loaded)}
                size = loaded.scene.render.atlas
            else:
                meshes, size = surfaces.builtins(), None
            measured = surfaces.run(meshes, size, full)
            found = report.document(surfaces=measured)
        elif scene is not None:
            sweep = Sweep(make, full).run(max_error)
            found = report.document(sweep=sweep)
        else:
            # The clock goes first: the comparison would compile what a cold frame is meant to compile itself.
            frames, nodes = timing.time_scene()
            presets, layers = (time_presets(), time_layers()) if full else (time_presets(1), [])
            sweep = Sweep(make, full).run(max_error)
            errors = compare_stages()
            found = report.document(errors, frames, nodes, presets=presets, layers=layers, sweep=sweep)
    click.echo(report.as_json(found) if as_json else report.as_text(found), nl=not as_json)
    if output is not None:
        report.write(output, found, sweep.shown if sweep else {})
    faults = [Fault(error.sentence) for error in errors if not error.passed]
    faults += [Fault(sentence) for sentence in (measured.faults if measured else ())]
    faults += [Fault(outcome.sentence) for outcome in outcomes if not outcome.passed]
    if faults:
        raise SkincliError(faults)


@command.command()
@click.argument("old", type=click.Path(path_type=Path))
@click.argument("new", type=click.Path(path_type=Path))
@click.pass_context
def compare(ctx: click.Context, old: Path, new: Path) -> None:
    """Tell what became better or worse from OLD to NEW, each a bench.json or the folder that holds one.

    Times are compared as ratios to the seed paper's method in the same run; those of --diffusion, which has none, where
    both ran on the same device. Ends with exit code 1 where an error or the size of tables grew by more than 5 %, or a
    time by more than 25 %.
    """
    from skincli.bench import compare

    before, after = compare.read(old), compare.read(new)
    changes = compare.compare(before, after)
    click.echo(compare.as_text(before, after, changes))
    if any(change.worse for change in changes):
        ctx.exit(1)
