"""`skincli bench --stress` passes what is sound, and finds a NaN, an error and an unlike picture."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from skincli.bench import extremes, report
from skincli.bench.extremes import CASES, Case, Refusal
from skincli.bench.stress import FAILS, OK, run
from skincli.cli import root
from skincli.errors import InputError
from skincli.gpu import program

Inject = Callable[[str, str, str], None]

pytestmark = pytest.mark.usefixtures("ctx")

#: of every kind one; the whole table is the command's
SOME = [
    ("light", "1e+12, physical"),
    ("light", "1e-12, physical"),
    ("light", "point on a vertex, 1e12, 64 EV"),
    ("light", "spot of 1 degrees, blend 0.3"),
    ("light", "none, no ambient, no environment"),
    ("kernel", "256 of 128 texels"),
    ("bumpiness", "1000, paper"),
    ("Equation 1", "a 1000, b 1000, bands of 0 to 1"),
    ("unit", "the whole scene times 0.0001"),
    ("place", "-1e+07 mm from the origin"),
    ("camera", "on a vertex"),
    ("camera", "1e6 mm away"),
    ("size", "all 1"),
    ("uv", "some 1e300"),
    ("normal", "a third nan"),
    ("normal", "opposed from vertex to vertex"),
    ("float16", "height picture to 1e+30"),
    ("environment", "pixels of 3e+38, 64 EV"),
]


def chosen(group: str, name: str) -> Case:
    """Return one case of the table."""
    (found,) = [case for case in CASES if (case.group, case.name) == (group, name)]
    return found


@pytest.fixture
def inject(ctx: object) -> Iterator[Inject]:
    """Exchange a piece of a shader file as programs read it, until the test ends."""
    genuine = program._file_lines

    def put(file: str, old: str, new: str) -> None:
        text = "\n".join(genuine(file))
        assert text.count(old) == 1, f"shaders/{file} holds '{old}' {text.count(old)} times"
        faulty = tuple(text.replace(old, new).splitlines())
        patch.setattr(program, "_file_lines", lambda name: faulty if name == file else genuine(name))
        program.program_text.cache_clear()

    with pytest.MonkeyPatch.context() as patch:
        yield put
    program.program_text.cache_clear()


@pytest.mark.parametrize(("group", "name"), SOME, ids=lambda value: str(value))
def test_an_extreme_is_finite_and_on_its_twins(group: str, name: str) -> None:
    (outcome,) = run([chosen(group, name)])
    assert outcome.verdict == OK, outcome.sentence
    assert outcome.nonfinite == 0
    assert outcome.error <= 1
    assert outcome.node


def test_a_nan_anywhere_is_counted(inject: Inject) -> None:
    inject("passes/reflection.frag", "reflection = vec4(p.scale", "reflection = vec4(sqrt(-1.0 - z) * p.scale")
    (outcome,) = run([chosen("reflectance", "1")])
    assert outcome.verdict == FAILS
    assert outcome.nonfinite > 0
    assert "values of reflection.reflection are not finite" in outcome.found


def test_a_wrong_power_of_ten_is_an_error_however_faint_the_light(inject: Inject) -> None:
    inject("lib/light.glsl", "/ distance2;", "/ (1.001 * distance2);")
    (outcome,) = run([chosen("light", "1e-12, paper")])
    assert outcome.verdict == FAILS
    assert outcome.nonfinite == 0
    assert outcome.error > 1
    assert outcome.node in ("irradiance", "specular")


def test_a_wrong_gradient_on_the_lattice_is_an_error(inject: Inject) -> None:
    inject("passes/lattice_slice.frag", "(M + m)", "(M - m)")
    (outcome,) = run([chosen("kernel", "scattering radius 1 mm")])
    assert outcome.verdict == FAILS
    assert outcome.node.startswith("diffused_")


def test_another_picture_is_told_from_the_one_to_repeat() -> None:
    other = chosen("light", "none")
    (outcome,) = run([replace(chosen("reflectance", "1"), like=other)])
    assert outcome.verdict == FAILS
    assert "differs from that of none" in outcome.found
    assert outcome.unlike is not None
    assert outcome.unlike > 1


def test_what_has_to_be_refused_may_not_render() -> None:
    (outcome,) = run([replace(chosen("reflectance", "1"), refused=Refusal(InputError, "too large"))])
    assert outcome.verdict == FAILS
    assert "not refused with 'too large'" in outcome.found


FEW = (("light", "inf"), ("Equation 1", "a 1, b 2.42, bands of 0 to 1"), ("reflectance", "1"))


def test_the_command_reports_every_case(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(extremes, "CASES", [chosen(*names) for names in FEW])
    done = CliRunner().invoke(root, ["bench", "--stress", "--json", "-o", str(tmp_path)])
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert [(row["group"], row["case"]) for row in found["stress"]] == list(FEW)
    assert [row["verdict"] for row in found["stress"]] == ["refused as documented", "ok", "ok"]
    assert all(row["passed"] for row in found["stress"])
    assert found["stages"] == found["paper"] == []
    text = (tmp_path / "bench.txt").read_text("utf-8")
    assert text == report.as_text(found) + "\n"
    assert "1 refused as documented, 2 ok" in text


def test_the_command_ends_with_exit_code_1_and_names_the_case(inject: Inject, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extremes, "CASES", [chosen(*names) for names in FEW])
    inject("passes/occlusion.frag", "exp2(logarithm / total)", "exp2(logarithm)")
    done = CliRunner().invoke(root, ["bench", "--stress"])
    assert done.exit_code == 1
    assert "FAILS" in done.stdout
    assert "stress case Equation 1, a 1, b 2.42, bands of 0 to 1: occlusion differs from its twin" in done.stderr
    assert "light" not in done.stderr
