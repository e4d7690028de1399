"""`skincli doctor`, and the diagnosis it shares with every command that needs OpenGL."""

from __future__ import annotations

import json
import logging
import os
import sys
import threading
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from skincli.cli import doctor, root
from skincli.errors import DeviceError
from skincli.gpu import context
from skincli.gpu.diagnosis import FAILURES, diagnose


def no_driver(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make EGL find no driver, in child processes."""
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", "/nonexistent")


def test_a_machine_that_draws() -> None:
    result = CliRunner().invoke(root, ["doctor", "--json"])
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert found["problems"] == []
    assert found["gl"]["checks"] == {"float32 target": True, "float16 target": True, "float32 blending": True}
    device = found["gl"]["device"]
    assert device["max_texture_size"] >= 1024  # the least that OpenGL 3.3 allows, as the next three
    assert device["max_samplers"] >= 16
    assert device["max_draw_buffers"] >= 8
    assert device["max_uniform_block_size"] >= 16384
    assert device["renderer"]
    assert Path(found["shaders"]).is_dir()
    assert Path(found["presets"]).is_dir()
    assert found["cache"] == os.environ["SKINCLI_CACHE"]
    assert all(found["packages"].values())
    assert "moderngl" in found["packages"]


def test_a_machine_without_driver(monkeypatch: pytest.MonkeyPatch) -> None:
    no_driver(monkeypatch)
    result = CliRunner().invoke(root, ["doctor"])
    assert result.exit_code == 4
    lines = {line.split("  ")[0]: line.split("  ", 1)[1].strip() for line in result.stdout.splitlines() if "  " in line}
    assert lines["found"] == "requested device index 0, but found 0 devices"
    assert lines["cause"] == "EGL is installed, but no driver has registered with it"
    assert "libgl1-mesa-dri" in lines["remedy"]


@pytest.mark.parametrize(
    ("program", "found"),
    [
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "the probe was killed by SIGSEGV"),
        ("import no_such_package", "ModuleNotFoundError: No module named 'no_such_package'"),
        ("raise SystemExit(9)", "the probe ended with exit code 9"),
        ("import time; time.sleep(60)", "the probe ran into its time limit of 1 s"),
    ],
)
def test_a_probe_that_does_not_answer(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, program: str, found: str
) -> None:
    """The child's interpreter is exchanged for one that behaves like a bad driver."""
    fake = tmp_path / "python"
    fake.write_text(f"#!{sys.executable}\n{program}\n")
    fake.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(fake))
    monkeypatch.setattr(doctor, "PROBE_SECONDS", 1 if "sleep" in program else 30)
    report = doctor.examine()
    assert report["gl"] is None
    assert [problem["found"] for problem in report["problems"]] == [found]
    assert report["problems"][0]["cause"]
    assert report["problems"][0]["remedy"]


@pytest.mark.parametrize(
    ("message", "cause"),
    [
        ("libGL.so.1 not loaded", "library is not installed"),
        ("libEGL.so not loaded", "library is not installed"),
        ("requested device index 0, but found 0 devices", "no driver has registered"),
        ("requested device index 3, but found 1 devices", "no EGL device of that number"),
        ("eglInitialize failed (0x3001)", "cannot be started"),
        ("eglCreateContext failed (0x3009)", "does not offer OpenGL 3.3"),
        ("(standalone) XOpenDisplay: cannot open display", "needs a display"),
        ("eglQueryDevicesEXT not found", "too old"),
        ("a pixel drawn as (1.0,) reads back as (0.0,)", "draws is wrong"),
        ("float32 blending does not work", "draws is wrong"),
        ("the probe was killed by SIGSEGV", "crashed or hung"),
        ("the folder 'presets' is missing", "not completely installed"),
        ("something new", "not known"),
    ],
)
def test_diagnosis(message: str, cause: str) -> None:
    assert cause in diagnose(message)[0]


def test_no_message_is_diagnosed_without_remedy() -> None:
    assert all(cause and remedy for _, cause, remedy in FAILURES)


def test_the_context_is_one_and_keeps_float32(ctx: Any) -> None:
    assert context.get_context() is ctx
    target = ctx.framebuffer([ctx.texture((1, 1), 4, dtype="f4")])
    value = (-3.0, 1e-20, 65537.25, 1e20)
    assert context.draw_value(ctx, target, value) == pytest.approx(value, rel=1e-7)
    # Released while bound, a framebuffer would make the next operation an error; `rest` prevents it.
    context.rest()
    target.release()
    ctx.framebuffer([ctx.texture((1, 1), 4, dtype="f4")]).clear()
    assert ctx.error == "GL_NO_ERROR"


def test_device_info_is_plain(ctx: Any) -> None:
    info = context.device_info()
    assert json.loads(json.dumps(info)) == info
    assert info["software"] == context.is_software(ctx)


def test_another_thread_and_another_device_are_refused(ctx: Any) -> None:
    caught: list[DeviceError] = []

    def draw() -> None:
        try:
            context.get_context()
        except DeviceError as problem:
            caught.append(problem)

    thread = threading.Thread(target=draw)
    thread.start()
    thread.join()
    assert "another thread" in str(caught[0])
    with pytest.raises(DeviceError, match="start another process"):
        context.get_context(device=7)


def test_a_forked_process_is_refused(ctx: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "getpid", lambda: -1)
    with pytest.raises(DeviceError, match="forked"):
        context.get_context()


class Fake:
    """A context that tells nothing but the renderer's name."""

    def __init__(self, renderer: str) -> None:
        self.info = {"GL_RENDERER": renderer}


@pytest.fixture
def fresh(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Let `get_context` believe that this process has no context; what it opens next does not outlast the test."""
    monkeypatch.setattr(context, "_owned", None)
    monkeypatch.setattr(context, "_draw_one_pixel", lambda ctx: None)
    monkeypatch.delenv("SKINCLI_DEVICE", raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    return monkeypatch


@pytest.mark.parametrize(
    ("renderer", "gpu", "noticed"),
    [
        ("llvmpipe (LLVM 15.0.6, 256 bits)", "/dev/nvidia0", True),
        ("softpipe", "/dev/dri/renderD128", True),
        ("llvmpipe (LLVM 15.0.6, 256 bits)", None, False),
        ("NVIDIA H200/PCIe/SSE2", "/dev/nvidia0", False),
    ],
)
def test_software_beside_a_gpu_is_noticed_once(
    fresh: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, renderer: str, gpu: str | None, noticed: bool
) -> None:
    fresh.setattr(context, "_open", lambda device: Fake(renderer))
    fresh.setattr(context, "gpu_present", lambda: gpu)
    context.get_context()
    context.get_context()
    assert [record.levelno for record in caplog.records] == [logging.WARNING] * noticed
    if noticed:
        assert str(gpu) in caplog.text


def test_a_required_gpu_refuses_software(fresh: pytest.MonkeyPatch) -> None:
    fresh.setattr(context, "_open", lambda device: Fake("llvmpipe (LLVM 15.0.6, 256 bits)"))
    with pytest.raises(DeviceError, match="drawing falls to the processor"):
        context.get_context(require_gpu=True)


def test_a_device_that_fails_is_passed_over_aloud(fresh: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    def open_device(device: int) -> Fake:
        if device == 0:
            raise RuntimeError("eglInitialize failed (0x3001)")
        return Fake("llvmpipe")

    fresh.setattr(context, "gpu_present", lambda: None)
    fresh.setattr(context, "_open", open_device)
    context.get_context()
    assert caplog.messages == [
        "OpenGL device 0 cannot be used (eglInitialize failed (0x3001)); drawing on device 1",
    ]


@pytest.mark.parametrize("text", ["x", "-1", "1.5"])
def test_a_device_that_is_no_number(fresh: pytest.MonkeyPatch, text: str) -> None:
    fresh.setenv("SKINCLI_DEVICE", text)
    with pytest.raises(DeviceError, match=r"0, 1, \.\.\., is allowed"):
        context.get_context()


def test_a_device_that_was_asked_for_is_not_exchanged(fresh: pytest.MonkeyPatch) -> None:
    def open_device(device: int) -> Fake:
        raise RuntimeError(f"requested device index {device}, but found 1 devices")

    fresh.setattr(context, "_open", open_device)
    fresh.setenv("SKINCLI_DEVICE", "2")
    with pytest.raises(DeviceError, match="requested device index 2"):
        context.get_context()
