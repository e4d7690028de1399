"""Hold every stage against its exact twin and against the clock."""

from __future__ import annotations

from pathlib import Path

import click


@click.command()
@click.option("--paper", is_flag=True, help="measure the frame rates of the seed paper's Table 1 instead")
@click.option("--json", "as_json", is_flag=True, help="print one JSON object instead of tables")
@click.option("-o", "--output", type=click.Path(path_type=Path), metavar="DIR", help="also write bench.json, bench.txt")
def command(paper: bool, as_json: bool, output: Path | None) -> None:
    """Measure error and time of every stage on this device.

    Ends with exit code 1 where a stage differs from its float64 twin by more than is allowed.
    """
    from skincli.bench import report
    from skincli.bench.stages import compare_stages
    from skincli.bench.timing import time_paper_table, time_scene
    from skincli.errors import Fault, SkincliError

    if paper:
        errors = []
        found = report.document(paper=time_paper_table())
    else:
        # The clock goes first: the comparison would compile what a cold frame is meant to compile itself.
        frames, nodes = time_scene()
        errors = compare_stages()
        found = report.document(errors, frames, nodes)
    click.echo(report.as_json(found) if as_json else report.as_text(found), nl=not as_json)
    if output is not None:
        report.write(output, found)
    if not all(error.passed for error in errors):
        raise SkincliError([Fault(error.sentence) for error in errors if not error.passed])
