"""What all tests share: the process's one OpenGL context, watched for errors, and a cache folder of their own."""

from __future__ import annotations

import logging
import signal
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest


@pytest.fixture(scope="session", autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep the user's cache out of the tests and the tests out of the user's cache."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SKINCLI_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="session", autouse=True)
def _interrupts() -> Iterator[None]:
    """Heed Ctrl-C where a shell started the tests in the background, which makes programs ignore it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(autouse=True)
def _log_level() -> Iterator[None]:
    """Undo what a command line under test (`skincli -q ...`) has set for the process."""
    log = logging.getLogger("skincli")
    level = log.level
    yield
    log.setLevel(level)


@pytest.fixture
def memory_is_freed(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Let go of what the frames of a test remember: textures outlive their Python objects."""
    from skincli.graph.store import Store

    made: list[Store] = []
    genuine = Store.__init__

    def remembered(store: Store, *arguments: Any, **options: Any) -> None:
        genuine(store, *arguments, **options)
        made.append(store)

    monkeypatch.setattr(Store, "__init__", remembered)
    yield
    for store in made:
        store.clear()


@pytest.fixture(scope="session")
def ctx() -> Any:
    """Return the process's context. Without OpenGL the test fails, in the words of `skincli doctor`."""
    from skincli.errors import DeviceError
    from skincli.gpu.context import get_context

    try:
        return get_context()
    except DeviceError as problem:
        pytest.fail(str(problem), pytrace=False)


@pytest.fixture(autouse=True)
def _no_gl_errors(request: pytest.FixtureRequest) -> Iterator[None]:
    """Hold each test that uses `ctx` to leave no OpenGL error behind, and to find none."""
    if "ctx" not in request.fixturenames:
        yield
        return
    context = request.getfixturevalue("ctx")
    context.clear_samplers()  # those of an earlier test would rule over this one's textures
    assert context.error == "GL_NO_ERROR", "an OpenGL error was left before this test"
    yield
    assert context.error == "GL_NO_ERROR", "this test left an OpenGL error"


@pytest.fixture(scope="session")
def ball() -> Callable[..., str]:
    """Return the function that writes a small mesh as an OBJ file."""

    def made(scale: float = 1.0, rows: int = 32, columns: int = 64, dents: float = 8.0) -> str:
        """Return an OBJ file of an ellipsoid 200 mm tall, dents (mm) about its waist, a UV seam at its back."""
        v, u = np.mgrid[0 : rows + 1, 0 : columns + 1]
        polar, around = np.pi * v / rows, 2 * np.pi * (u / columns - 0.25)
        radius = 80 + dents * np.sin(3 * around) * np.sin(polar) ** 2
        points = np.stack(
            [radius * np.sin(polar) * np.cos(around), 100 * np.cos(polar), -radius * np.sin(polar) * np.sin(around)],
            axis=-1,
        )
        lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in scale * points.reshape(-1, 3)]
        lines += [f"vt {x:.9g} {y:.9g}" for x, y in np.stack([u / columns, 1 - v / rows], axis=-1).reshape(-1, 2)]
        for row in range(rows):
            for column in range(columns):
                a = row * (columns + 1) + column + 1
                b = a + columns + 1
                # At the poles one of the two has no area.
                faces = [(a + 1, b, b + 1)] * (row < rows - 1) + [(a, b, a + 1)] * (row > 0)
                lines += ["f " + " ".join(f"{i}/{i}" for i in face) for face in faces]
        return "\n".join(lines) + "\n"

    return made
