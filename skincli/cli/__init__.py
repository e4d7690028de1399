"""The command line: one file per command, found by its file's name; logs on stderr, results on stdout.

A file `skincli/cli/NAME.py` is the command NAME (an underscore is a hyphen to the user) and defines
`command: click.Command`. Beside click it imports at its top only what is light, for `skincli --help` reads every
command; the rest is imported inside the command. A test holds it to that.
"""

from __future__ import annotations

import importlib
import logging
import os
import sys
import traceback
from pathlib import Path
from typing import Any, NoReturn

import click

from skincli import __version__
from skincli.errors import LimitError, OutputError, SkincliError

log = logging.getLogger("skincli")

INTERRUPTED = 130


class Commands(click.Group):
    """The group of the commands in this folder, and the place where every error becomes a message and an exit code."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the commands' names, from the file names."""
        names = (path.stem for path in Path(__file__).parent.glob("*.py"))
        return sorted(name.replace("_", "-") for name in names if not name.startswith("_"))

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return one command, or None where there is none of that name."""
        if cmd_name not in self.list_commands(ctx):
            return None
        module = importlib.import_module(f"{__name__}.{cmd_name.replace('-', '_')}")
        command: click.Command = module.command
        return command

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; end with the exit code of ARCHITECTURE's table, and with a traceback only for --debug."""
        try:
            return super().invoke(ctx)
        except (KeyboardInterrupt, click.Abort):
            self._end(ctx, "interrupted", INTERRUPTED)
        except (click.ClickException, click.exceptions.Exit):
            raise  # click's own: usage errors with exit code 2, --help, --version
        except SkincliError as problem:
            self._end(ctx, str(problem), problem.exit_code)
        except BrokenPipeError:
            # The reader (`| head`) has left: nothing to tell, and nothing more to write when Python flushes at its end.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            ctx.exit(OutputError.exit_code)
        except MemoryError:
            self._end(
                ctx,
                "memory ran out; choose a smaller size, atlas or mesh, or run fewer at a time",
                LimitError.exit_code,
            )
        except Exception as bug:
            text = f"{type(bug).__name__}: {bug}".strip(": ")
            self._end(ctx, f"a bug of ours ({text}); please report it with what `skincli --debug ...` prints", 1)

    def _end(self, ctx: click.Context, text: str, code: int) -> NoReturn:
        """Leave with `text` on stderr, called while an error is handled."""
        if ctx.params.get("debug"):
            click.echo(traceback.format_exc(), err=True, nl=False)
        click.echo(f"skincli: {text}", err=True)
        ctx.exit(code)


class _Stderr(logging.Handler):
    """Writes records as click writes, so that they reach the stderr of the moment (tests exchange it)."""

    def emit(self, record: logging.LogRecord) -> None:
        click.echo(f"skincli: {record.levelname.lower()}: {record.getMessage()}", err=True)


@click.command(cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "show_default": True})
@click.version_option(__version__, prog_name="skincli")
@click.option("-q", "--quiet", is_flag=True, help="Errors only.")
@click.option("-v", "--verbose", is_flag=True, help="Tell more on stderr.")
@click.option("--debug", is_flag=True, help="Tell everything, and give a traceback with each error.")
def root(quiet: bool, verbose: bool, debug: bool) -> None:
    """Render skin without a display, and generate the textures it needs."""
    if debug:
        level = logging.DEBUG
    elif verbose:
        level = logging.INFO
    else:
        level = logging.ERROR if quiet else logging.WARNING
    log.setLevel(level)
    if not any(isinstance(handler, _Stderr) for handler in log.handlers):
        log.addHandler(_Stderr())


def main() -> None:
    """Run the command line of this process."""
    root(prog_name="skincli")
