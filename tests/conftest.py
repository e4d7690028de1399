"""What all tests share: the process's one OpenGL context, watched for errors, and a cache folder of their own."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from typing import Any

import pytest


@pytest.fixture(scope="session", autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep the user's cache out of the tests and the tests out of the user's cache."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SKINCLI_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(autouse=True)
def _log_level() -> Iterator[None]:
    """Undo what a command line under test (`skincli -q ...`) has set for the process."""
    log = logging.getLogger("skincli")
    level = log.level
    yield
    log.setLevel(level)


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
