"""Generate the maps of a skin."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from skincli.generate import Ground, Order
    from skincli.mesh.model import Mesh
    from skincli.scene.paths import LoadedSkin


@click.command()
@click.argument("skin", required=False)
@click.option("-o", "--output", type=click.Path(path_type=Path), required=True, help="folder for the maps")
@click.option("--size", type=click.IntRange(min=1), help="texels a side, in place of the skin's own")
@click.option("--maps", "names", metavar="A,B,...", help="maps to make, in place of albedo, bump and reflection")
@click.option("--mesh", metavar="FILE|builtin:NAME", help="mesh on which the maps lie; a flat square without one")
@click.option("--unit", metavar="UNIT", help="of the mesh file: mm, cm, m, in, or millimeters per unit")
@click.option(
    "--scene", type=click.Path(path_type=Path), help="make the maps of every skin of a scene, on the scene's mesh"
)
@click.option("--format", "format_", type=click.Choice(["png", "exr"]), help="of the files; png without --depth")
@click.option(
    "--depth", type=click.Choice(["8", "16", "half", "float"]), help="per channel; relief is never written in 8 bits"
)
@click.option("--normal", type=click.Choice(["opengl", "directx"]), default="opengl", help="where y of normals points")
@click.option("--naming", type=click.Choice(["skincli", "ambientcg"]), default="skincli", help="of the files")
@click.option("--preview", is_flag=True, help="also write preview.png: the maps, a lit ball and a lit head")
@click.option("--json", "as_json", is_flag=True, help="print the manifests as JSON")
@click.option("--set", "sets", multiple=True, metavar="PATH=VALUE", help="change a value, such as skin.seed=3")
@click.option(
    "--asset-root", "roots", multiple=True, type=click.Path(path_type=Path), help="folder files may come from"
)
@click.option("--require-gpu", is_flag=True, help="fail rather than draw in software")
def command(skin: str | None, output: Path, size: int | None, preview: bool, as_json: bool, **options: Any) -> None:
    """Generate the maps of SKIN: a preset's name, a YAML file, or a folder of maps from elsewhere.

    They lie on a flat square of the skin's `extent`, or on a mesh. What can be made: albedo, height, bump, normal,
    reflection, roughness, specular, scattering_radius and cavity. Beside them lies manifest.json, which says size,
    unit, range, color space and hashes. Where several skins are made, or parts of a mesh need maps of their own, each
    gets a folder.
    """
    import json

    from skincli import images
    from skincli import preview as previews
    from skincli.generate import write_maps
    from skincli.gpu.context import get_context

    order, manifests = _order(options), []
    wearers = _wearers(skin, options)
    get_context(options["require_gpu"])
    for name, worn, ground in wearers:
        own = worn.skin if size is None else worn.skin.model_copy(update={"size": size})
        folder = output / name if len(wearers) > 1 else output
        picture = folder / "preview.png"
        if preview:
            images.require_writable(picture)
        with _progress(f"{name}, {own.size} x {own.size}", order.steps + preview) as told:
            written = write_maps(folder, own, name, order, ground, told)
            files = list(written.files)
            if preview:
                images.write_png(picture, previews.sheet(name, worn, written.arrays))
                files.append(picture)
                told()
        manifests.append(written.manifest.model_dump(mode="json", exclude_none=True) | {"folder": str(folder)})
        if not as_json:
            click.echo("\n".join(map(str, files)))
    if as_json:
        click.echo(json.dumps(manifests if options["scene"] or len(manifests) > 1 else manifests[0], indent=1))


@contextmanager
def _progress(label: str, steps: int) -> Iterator[Callable[[], None]]:
    """Show a bar on stderr where a person watches it; piped it would only litter a log."""
    import sys

    if click.get_current_context().find_root().params["quiet"] or not sys.stderr.isatty():
        yield lambda: None
        return
    with click.progressbar(length=steps, label=label, file=sys.stderr) as bar:
        bar.render_progress()
        yield lambda: bar.update(1)


def _order(options: dict[str, Any]) -> Order:
    from skincli.generate import DEFAULT, Order
    from skincli.mapset import Encoding, parse_maps

    encoding = Encoding.of(options["format_"], options["depth"])
    maps = DEFAULT if options["names"] is None else parse_maps(options["names"])
    return Order(maps, encoding, options["naming"], options["normal"])


def _wearers(skin: str | None, options: dict[str, Any]) -> list[tuple[str, LoadedSkin, Ground]]:
    """Return name, skin and ground of everything that is to be generated; the names differ and suit as files' names."""
    from skincli.errors import UsageError
    from skincli.files import asset_roots
    from skincli.generate import Ground
    from skincli.pipeline import OUTPUTS, keeps_apart, load_scene_mesh, wearers
    from skincli.scene.paths import load_scene, load_skin

    roots = asset_roots(options["roots"])
    if options["unit"] is not None and (options["mesh"] is None or options["mesh"].startswith(_BUILTIN)):
        raise UsageError(f"--unit {options['unit']}: belongs to a file named by --mesh; remove --unit")
    if options["scene"] is not None:
        if skin is not None or options["mesh"] is not None:
            raise UsageError("--scene names skins and mesh itself; leave out SKIN and --mesh")
        loaded = load_scene(options["scene"], options["sets"], roots, outputs=OUTPUTS)
        mesh = load_scene_mesh(loaded)
        found = wearers(loaded, mesh)
        if not found:
            raise UsageError(f"--scene {options['scene']}: there is no skin in it; give it one, as in skin: human")
        names = _file_names([name for name, _, _ in found])
        return [(name, worn, Ground(mesh, parts)) for name, (_, worn, parts) in zip(names, found, strict=True)]
    if skin is None:
        raise UsageError("nothing to generate; name a SKIN, such as human, or a --scene")
    worn = load_skin(skin, options["sets"], roots)
    title = Path(skin).stem or Path(skin).resolve().stem
    if options["mesh"] is None:
        return [(title, worn, Ground())]
    mesh = _mesh(options["mesh"], options["unit"], roots)
    if not keeps_apart(mesh) or len(mesh.parts) == 1:
        return [(title, worn, Ground(mesh, tuple(range(len(mesh.parts)))))]
    names = _file_names([part.name for part in mesh.parts])
    return [(name, worn, Ground(mesh, (part,))) for part, name in enumerate(names)]


_BUILTIN = "builtin:"


def _mesh(text: str, unit: str | None, roots: tuple[Path, ...]) -> Mesh:
    """Return the mesh that --mesh names."""
    from pydantic import ValidationError

    from skincli.errors import UsageError
    from skincli.mesh.load import load_builtin, load_mesh
    from skincli.pipeline import tell_notes
    from skincli.scene.model import MeshSource

    if text.startswith(_BUILTIN):
        name, _, detail = text.removeprefix(_BUILTIN).partition(":")
        return load_builtin(name, detail or None)
    try:
        source = MeshSource.model_validate({"file": text} | ({} if unit is None else {"unit": _number(unit)}))
    except ValidationError as error:
        problem = error.errors()[0]["msg"].removeprefix("Value error, ")
        raise UsageError(f"--mesh {text}, --unit {unit or 'left out'}: {problem}") from None
    mesh = load_mesh(Path(text), source.mm_per_unit, display_path=text, roots=roots)
    tell_notes(mesh, text)
    return mesh


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def _file_names(names: list[str]) -> list[str]:
    """Return names of a mesh's parts as files' names: what is no letter, digit, dash or inner dot becomes _."""
    import re

    found: list[str] = []
    for name in names:
        plain = re.sub(r"[^\w.-]|^\.", "_", name) or "_"
        while plain.lower() in {other.lower() for other in found}:
            plain += "_"
        found.append(plain)
    return found
