"""Path-trace a scene, as what other pictures of it are held against."""

from __future__ import annotations

from pathlib import Path

import click


class Triple(click.ParamType):
    """Three numbers of 0 or more, as R,G,B."""

    name = "R,G,B"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        """Return the numbers."""
        try:
            found = tuple(float(part) for part in str(value).split(","))
        except ValueError:
            found = ()
        if len(found) != 3 or not all(0 <= number <= 1e6 for number in found):
            self.fail(f"{value!r} is not three numbers from 0 to 1e6; write for example 0.03,0.17,0.48", param, ctx)
        return found


@click.command()
@click.argument("scene", type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path), required=True, help="picture: NAME.exr")
@click.option("--set", "sets", multiple=True, metavar="PATH=VALUE", help="change a value, such as camera.fov=20")
@click.option(
    "--asset-root", "roots", multiple=True, type=click.Path(path_type=Path), help="folder files may come from"
)
@click.option("--spp", type=click.IntRange(2, 1 << 20), default=256, help="paths per pixel, at most")
@click.option(
    "--max-error", type=click.FloatRange(0, 1), default=0.0, help="relative RMSE inside the silhouette at which to stop"
)
@click.option(
    "--boundary",
    type=click.Choice(["matched", "dielectric"]),
    default="matched",
    help="matched: diffuse light alone; dielectric: a rough surface that reflects",
)
@click.option("--ior", type=click.FloatRange(1, 4, min_open=True), default=1.4, help="of the dielectric boundary")
@click.option("--sigma-a", type=Triple(), help="absorption of all skin, 1/mm, in place of what its optics say")
@click.option("--sigma-s", type=Triple(), help="reduced scattering of all skin, 1/mm; goes with --sigma-a")
@click.option("--seed", type=click.IntRange(0, 1 << 30), default=0, help="of all random numbers")
@click.option("--variant", help="of Mitsuba, such as scalar_rgb; left out: the first that works here")
@click.option("--json", "as_json", is_flag=True, help="print one JSON object")
def command(
    scene: Path,
    output: Path,
    sets: tuple[str, ...],
    roots: tuple[Path, ...],
    spp: int,
    max_error: float,
    boundary: str,
    ior: float,
    sigma_a: tuple[float, ...] | None,
    sigma_s: tuple[float, ...] | None,
    seed: int,
    variant: str | None,
    as_json: bool,
) -> None:
    """Path-trace SCENE, a YAML file, to the picture OUTPUT, with Mitsuba 3.

    The skin is a closed body full of one medium that follows from its optics; its layers and bumps do not enter. The
    file holds the layer "beauty", and in the layer "error" the standard error of each of its values. What is printed is
    the error that is left: the RMSE inside the silhouette over the root mean square of the picture there.
    """
    import json
    import logging

    from skincli import __version__
    from skincli.errors import UsageError
    from skincli.files import asset_roots
    from skincli.images import require_writable
    from skincli.pipeline import frame_camera, load_scene_mesh, looks_of
    from skincli.reference import pathtrace
    from skincli.scene.paths import load_scene

    if output.suffix.lower() != ".exr":
        raise UsageError(f"-o {output}: a reference ends in .exr; write for example {output.stem or 'reference'}.exr")
    if (sigma_a is None) != (sigma_s is None):
        raise UsageError("--sigma-a and --sigma-s make a medium together; give both, or none")
    given = None if sigma_a is None or sigma_s is None else pathtrace.Medium(sigma_a, sigma_s)
    loaded = load_scene(scene, sets, asset_roots(roots))
    require_writable(output)
    tracer = pathtrace.load(variant)
    mesh = load_scene_mesh(loaded)
    looks, look_of_part = looks_of(loaded, mesh)
    stuff = []
    for look in (looks[index] for index in look_of_part):
        if look.optics is None:
            stuff.append(pathtrace.Stuff(None, material=look.material))
        else:
            medium = given or pathtrace.Medium.of(look.optics)
            stuff.append(pathtrace.Stuff.skin(medium, look.surface.shininess))
    size = (loaded.scene.render.size[0], loaded.scene.render.size[1])
    found = pathtrace.render(
        loaded.scene,
        mesh,
        loaded.scene.camera or frame_camera(mesh, size),
        stuff,
        tracer=tracer,
        spp=spp,
        max_error=max_error,
        ior=ior if boundary == "dielectric" else None,
        seed=seed,
    )
    pathtrace.write(output, found)
    if found.relative_rmse > max_error > 0:
        logging.getLogger("skincli").warning(
            "the error is %.3g, not yet %.3g; allow more paths with --spp", found.relative_rmse, max_error
        )
    if as_json:
        report = {
            "output": str(output),
            "relative_rmse": found.relative_rmse,
            "skipped": found.skipped,
            "spp": found.spp,
            "seconds": round(found.seconds, 3),
            "variant": found.variant,
            "boundary": boundary,
            "versions": {"skincli": __version__, **found.versions},
        }
        click.echo(json.dumps(report, indent=1))
    else:
        click.echo(
            f"{output}: {found.relative_rmse:.2%} error left (relative RMSE inside the silhouette) after {found.spp} "
            f"paths per pixel in {found.seconds:.1f} s, {found.variant}, Mitsuba {found.versions['mitsuba']}"
        )
