"""Generate a skin's albedo, bump and reflection maps."""

from __future__ import annotations

from pathlib import Path

import click


@click.command()
@click.argument("skin")
@click.option("-o", "--output", type=click.Path(path_type=Path), required=True, help="folder for the maps")
@click.option("--size", type=click.IntRange(min=1), help="texels a side, in place of the skin's own")
@click.option("--set", "sets", multiple=True, metavar="PATH=VALUE", help="change a value, such as skin.seed=3")
@click.option(
    "--asset-root", "roots", multiple=True, type=click.Path(path_type=Path), help="folder files may come from"
)
@click.option("--require-gpu", is_flag=True, help="fail rather than draw in software")
def command(
    skin: str, output: Path, size: int | None, sets: tuple[str, ...], roots: tuple[Path, ...], require_gpu: bool
) -> None:
    """Generate the maps of SKIN, a preset's name or a YAML file, on a flat square.

    Writes albedo.png (sRGB), bump.png (grey, 0.5 is the undisplaced surface), reflection.png, 16 bits each, and
    manifest.json, which says their size, range, unit and hashes.
    """
    from skincli.files import asset_roots
    from skincli.generate import write_maps
    from skincli.gpu.context import get_context
    from skincli.scene.paths import load_skin

    found = load_skin(skin, sets, asset_roots(roots)).skin
    get_context(require_gpu)
    for file in write_maps(output, found, Path(skin).stem, size or found.size):
        click.echo(file)
