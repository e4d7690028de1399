"""Includes to any depth, and a driver's complaints at the file and line a person edits."""

from __future__ import annotations

import pytest

from skincli.errors import DeviceError, Fault
from skincli.gpu.program import Source, expand, locate


def test_includes_go_to_any_depth_and_come_once() -> None:
    texts = {
        "main": 'first\n#include "a"\n#include "b"\nlast',
        "a": '#include "b"\nin a',
        "b": '#include "c"\nin b',
        "c": "in c",
    }
    source = expand("main", texts)
    assert source.text == "first\nin c\nin b\nin a\nlast\n"
    assert source.origin == (("main", 1), ("c", 1), ("b", 2), ("a", 2), ("main", 4))


def test_a_file_that_includes_itself_ends() -> None:
    assert expand("a", {"a": '#include "b"\nx', "b": '#include "a"\ny'}).text == "y\nx\n"


def test_a_missing_include_names_the_line_that_asks() -> None:
    with pytest.raises(DeviceError) as caught:
        expand("main", {"main": '\n#include "lib/nowhere.glsl"'})
    assert str(caught.value) == "shaders/main:2: includes 'lib/nowhere.glsl', which does not exist"


@pytest.mark.parametrize(
    "line", ["0:2(5): error: `foo' undeclared", "0(2) : error: `foo' undeclared", "ERROR: 0:2: error: `foo' undeclared"]
)
def test_complaints_of_every_driver_are_placed(line: str) -> None:
    source = Source("one\ntwo\n", (("lib/x.glsl", 7), ("passes/y.frag", 9)))
    log = f"GLSL Compiler failed\n\nfragment_shader\n===============\n{line}\n"
    assert locate(log, {"fragment_shader": source}) == [Fault("error: `foo' undeclared", "shaders/passes/y.frag", 9)]


def test_the_stage_named_last_is_meant() -> None:
    stages = {"vertex_shader": Source("v\n", (("v", 1),)), "fragment_shader": Source("f\n", (("f", 1),))}
    assert locate("vertex_shader\n=====\n0:1(1): error: x\n", stages)[0].file == "shaders/v"


def test_a_log_nobody_understands_is_shown_whole() -> None:
    assert "gibberish" in locate("gibberish", {})[0].message
