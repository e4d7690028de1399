"""The root of the command line: finding commands, help without heavy imports, errors to messages and exit codes."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import click
import pytest
from click.testing import CliRunner, Result

import skincli.cli
from skincli import __version__, errors
from skincli.cli import root


def run(*args: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *args], capture_output=True, text=True, timeout=60, check=False)


def commands() -> list[str]:
    return root.list_commands(click.Context(root))


def failing(monkeypatch: pytest.MonkeyPatch, error: BaseException, *options: str) -> Result:
    """Run a command that raises `error`."""

    @click.command()
    def fail() -> None:
        raise error

    monkeypatch.setattr(type(root), "get_command", lambda *_: fail)
    return CliRunner().invoke(root, [*options, "fail"])


def test_every_file_is_a_command_with_help() -> None:
    files = {path.stem.replace("_", "-") for path in Path(skincli.cli.__file__).parent.glob("[a-z]*.py")}
    assert set(commands()) == files
    assert "doctor" in files
    for name in files:
        result = CliRunner().invoke(root, [name, "--help"])
        assert result.exit_code == 0, result.output
        assert result.output.startswith(f"Usage: root {name}")


def test_help_lists_the_commands_and_imports_nothing_heavy() -> None:
    heavy = "moderngl numpy scipy trimesh pydantic OpenImageIO PIL yaml xatlas"
    script = (
        "import sys; from skincli.cli import root; root(['--help'], standalone_mode=False);"
        f"print('heavy:', [name for name in '{heavy}'.split() if name in sys.modules])"
    )
    done = run("-c", script)
    assert "heavy: []" in done.stdout, done.stdout + done.stderr
    for name in commands():
        assert f"\n  {name} " in done.stdout


def test_module_and_version() -> None:
    done = run("-m", "skincli", "--version")
    assert (done.returncode, done.stdout) == (0, f"skincli, version {__version__}\n")


def test_unknown_command_and_option_are_usage_errors() -> None:
    for args in (["doctro"], ["--no-such-option"], ["doctor", "--no-such-option"]):
        result = CliRunner().invoke(root, args)
        assert result.exit_code == 2
        assert "No such" in result.stderr
        assert not result.stdout


@pytest.mark.parametrize(
    ("kind", "code"),
    [
        (errors.UsageError, 2),
        (errors.InputError, 3),
        (errors.DeviceError, 4),
        (errors.FramesError, 5),
        (errors.LimitError, 6),
        (errors.OutputError, 7),
    ],
)
def test_an_error_of_the_family_is_its_text_and_its_code(
    monkeypatch: pytest.MonkeyPatch, kind: type[errors.SkincliError], code: int
) -> None:
    faults = [errors.Fault("size is 0", "a.yaml", 3, 7), errors.Fault("seed is -1", "a.yaml", 4, 7)]
    result = failing(monkeypatch, kind(faults))
    assert result.exit_code == code
    assert result.stderr == "skincli: a.yaml:3:7: size is 0\na.yaml:4:7: seed is -1\n"
    assert not result.stdout


def test_debug_adds_the_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    result = failing(monkeypatch, errors.InputError("no"), "--debug")
    assert result.exit_code == 3
    assert result.stderr.startswith("Traceback")
    assert result.stderr.endswith("skincli: no\n")


def test_what_nobody_expected_is_called_our_bug(monkeypatch: pytest.MonkeyPatch) -> None:
    result = failing(monkeypatch, KeyError("radius"))
    assert result.exit_code == 1
    assert "a bug of ours (KeyError: 'radius')" in result.stderr
    assert "--debug" in result.stderr
    assert "Traceback" not in result.stderr


@pytest.mark.parametrize(
    ("error", "code"), [(KeyboardInterrupt(), 130), (click.Abort(), 130), (MemoryError(), 6), (SystemExit(5), 5)]
)
def test_other_ends(monkeypatch: pytest.MonkeyPatch, error: BaseException, code: int) -> None:
    result = failing(monkeypatch, error)
    assert result.exit_code == code
    assert "Traceback" not in result.output


def test_a_reader_that_leaves_is_no_news() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    script = (
        "import click, skincli.cli as cli\n"
        "command = click.Command('many', callback=lambda: [click.echo('x' * 100) for _ in range(10000)])\n"
        "cli.Commands.get_command = lambda *_: command\n"
        "cli.root(['many'])"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], stdout=writing, stderr=subprocess.PIPE, text=True, timeout=60, check=False
    )
    os.close(writing)
    assert (done.returncode, done.stderr) == (7, "")


@pytest.mark.parametrize(
    ("options", "heard"),
    [
        ([], ["skincli: warning: loud"]),
        (["-q"], []),
        (["-v"], ["skincli: info: low", "skincli: warning: loud"]),
        (["--debug"], ["skincli: debug: lowest", "skincli: info: low", "skincli: warning: loud"]),
    ],
)
def test_logs_go_to_stderr_by_level(monkeypatch: pytest.MonkeyPatch, options: list[str], heard: list[str]) -> None:
    @click.command()
    def talk() -> None:
        log = logging.getLogger("skincli.some.module")
        say: tuple[tuple[Callable[[str], None], str], ...] = (
            (log.debug, "lowest"),
            (log.info, "low"),
            (log.warning, "loud"),
        )
        for level, text in say:
            level(text)
        click.echo("result")

    monkeypatch.setattr(type(root), "get_command", lambda *_: talk)
    for _ in range(2):  # the second run must not say things twice
        result = CliRunner().invoke(root, [*options, "talk"])
        assert result.stdout == "result\n"
        assert result.stderr.splitlines() == heard
