"""`skincli doctor`: what this installation consists of, whether OpenGL works here, and if not, why."""

from __future__ import annotations

from typing import Any

import click


@click.command(name="doctor")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of text.")
@click.pass_context
def command(ctx: click.Context, as_json: bool) -> None:
    """Check this machine and this installation.

    Ends with exit code 4 where nothing can be drawn.
    """
    import json

    found = examine()
    click.echo(json.dumps(found, indent=2) if as_json else describe(found))
    if found["problems"]:
        ctx.exit(4)


PROBE_SECONDS = 30


def examine() -> dict[str, Any]:
    """Return what `skincli doctor --json` prints.

    `problems` lists {"found", "cause", "remedy"} and is empty where all is well; `gl` is None or what
    `skincli.gpu.probe.probe` returns; `messages` are the lines that driver and skincli wrote to stderr meanwhile.
    """
    import platform
    import sys

    from skincli import __version__, diskcache

    folders = {name: _resource(name) for name in ("shaders", "presets")}
    gl, messages, failures = _probe()
    packages = _packages()
    failures += [f"the folder '{name}' is missing" for name, path in folders.items() if path is None]
    failures += [f"the package '{name}' is missing" for name, version in packages.items() if version is None]
    return {
        "skincli": __version__,
        "python": platform.python_version(),
        "executable": sys.executable,
        "platform": platform.platform(),
        "packages": packages,
        **folders,
        "cache": str(diskcache.folder()),
        "gl": gl,
        "messages": messages,
        "problems": [_problem(text) for text in failures],
    }


def describe(found: dict[str, Any]) -> str:
    """Return what `examine` found as aligned lines for a person."""
    rows: list[tuple[str, Any]] = [(key, found[key]) for key in ("skincli", "python", "executable", "platform")]
    rows += [(key, found[key] or "missing") for key in ("shaders", "presets", "cache")]
    rows += [(f"  {name}", version or "missing") for name, version in found["packages"].items()]
    if found["gl"]:
        rows += [(key.replace("_", " "), value) for key, value in found["gl"]["device"].items()]
        rows += [("context made in", f"{found['gl']['seconds']} s")]
        rows += [(name, "right" if right else "wrong") for name, right in found["gl"]["checks"].items()]
    width = max(len(key) for key, _ in rows) + 2
    lines = [f"{key:{width}}{_words(value)}" for key, value in rows]
    lines += [f"message: {text}" for text in found["messages"]]
    for problem in found["problems"]:
        lines += ["", *(f"{key:{width}}{problem[key]}" for key in ("found", "cause", "remedy"))]
    if not found["problems"]:
        lines += ["", "OpenGL works here."]
    return "\n".join(lines)


def _words(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return str(value)


def _probe() -> tuple[dict[str, Any] | None, list[str], list[str]]:
    """Run `skincli.gpu.probe` in a child process; return what it found, its messages, and what failed, as texts."""
    import json
    import os
    import signal
    import subprocess
    import sys
    from pathlib import Path

    import skincli

    # The child must find this very package, however this process came to it.
    home = str(Path(skincli.__file__).resolve().parent.parent)
    path = os.pathsep.join(part for part in (home, os.environ.get("PYTHONPATH", "")) if part)
    try:
        child = subprocess.run(
            [sys.executable, "-m", "skincli.gpu.probe"],
            capture_output=True,
            text=True,
            errors="replace",
            timeout=PROBE_SECONDS,
            env={**os.environ, "PYTHONPATH": path},
            check=False,
        )
    except subprocess.TimeoutExpired:
        return None, [], [f"the probe ran into its time limit of {PROBE_SECONDS} s"]
    messages = [line.strip() for line in child.stderr.splitlines() if line.strip()]
    if child.returncode < 0:
        return None, messages, [f"the probe was killed by {signal.Signals(-child.returncode).name}"]
    if child.returncode > 0:
        return None, messages, [messages[-1] if messages else f"the probe ended with exit code {child.returncode}"]
    found = json.loads(child.stdout)
    if "error" in found:
        return None, messages, [found["error"]]
    return found, messages, [f"{name} does not work" for name, right in found["checks"].items() if not right]


def _problem(text: str) -> dict[str, str]:
    from skincli.gpu.diagnosis import diagnose

    cause, remedy = diagnose(text)
    return {"found": text, "cause": cause, "remedy": remedy}


def _resource(name: str) -> str | None:
    from skincli import resources

    try:
        return str(resources.folder(name))
    except FileNotFoundError:
        return None


def _packages() -> dict[str, str | None]:
    """Return name -> version, or None where it is missing, of the packages that skincli's own metadata requires."""
    import re
    from importlib import metadata

    try:
        requirements = metadata.requires("skincli") or []
    except metadata.PackageNotFoundError:  # run from a checkout that was never installed
        requirements = _declared()
    names = [re.split(r"[^\w.-]", text, maxsplit=1)[0] for text in requirements if "extra ==" not in text]
    return {name: _version(name) for name in names}


def _declared() -> list[str]:
    import tomllib
    from pathlib import Path

    import skincli

    project = Path(skincli.__file__).resolve().parent.parent / "pyproject.toml"
    declared: list[str] = tomllib.loads(project.read_text("utf-8"))["project"]["dependencies"]
    return declared


def _version(name: str) -> str | None:
    from importlib import metadata

    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None
