"""List the presets, or print one with all its parameters."""

from __future__ import annotations

import click


@click.group(invoke_without_command=True)
@click.option("--json", "as_json", is_flag=True, help="print as JSON")
@click.pass_context
def command(ctx: click.Context, as_json: bool) -> None:
    """List the presets with a sentence each."""
    if ctx.invoked_subcommand is not None:
        return
    import json

    from skincli import presets

    found = presets.names()
    about = {name: presets.about(name) for name in found}
    if as_json:
        click.echo(json.dumps(about, indent=1))
        return
    width = max(map(len, found))
    for name, sentence in about.items():
        click.echo(f"{name:<{width}}  {sentence}")


@command.command()
@click.argument("name")
@click.option("--json", "as_json", is_flag=True, help="print values and descriptions as JSON")
def show(name: str, as_json: bool) -> None:
    """Print preset NAME with every parameter, its unit and its range; those it leaves alone have their defaults."""
    import json

    from skincli import presets

    if as_json:
        click.echo(json.dumps(presets.described(name), indent=1))
    else:
        click.echo(presets.text(name), nl=False)
