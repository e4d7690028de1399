"""The table of extreme cases, and what is made of those that end before anything is drawn."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from skincli.bench.extremes import CASES, Case, Refusal
from skincli.bench.stress import FAILS, REFUSED, run
from skincli.errors import InputError, LimitError
from skincli.graph.frame_graph import FrameGraph

#: cases that their scene file alone refuses
WRITTEN = [
    ("light", "1e+13", "at most 1000000000000"),
    ("light", "inf", "finite"),
    ("light", "nan", "finite"),
    ("light", "direction of length 0", "zero"),
    ("kernel", "257", "at most 256"),
    ("kernel", "scattering radius 0 mm", "greater than 0"),
    ("bumpiness", "1e+06", "at most 1000"),
    ("Equation 1", "a 0, b 0", "1e-06 or more"),
    ("reflectance", "-0.1", "at least 0"),
    ("reflectance", "1.1", "at most 1"),
    ("unit", "0", "above 0"),
    ("unit", "1e-06, 170 units wide", "0.001 to 1e+07 mm are allowed"),
    ("unit", "1e+06, 170 units wide", "0.001 to 1e+07 mm are allowed"),
    ("place", "1.1e+08 mm from the origin", "up to 1e+08 mm are allowed"),
    ("camera", "fov 180", "less than 180"),
    ("camera", "target at its position", "looks nowhere"),
    ("size", "atlas 16385", "at most 16384"),
    ("uv", "a mesh that is one point", "at least one of non-zero area"),
    ("normal", "positions NaN", "finite numbers"),
]


def chosen(group: str, name: str) -> Case:
    """Return one case of the table."""
    (found,) = [case for case in CASES if (case.group, case.name) == (group, name)]
    return found


def test_every_case_has_a_name_of_its_own() -> None:
    assert [name for name, count in Counter((case.group, case.name) for case in CASES).items() if count > 1] == []
    assert all(case.like is None or case.like in CASES for case in CASES)


@pytest.mark.parametrize(("group", "name", "says"), WRITTEN, ids=lambda value: str(value)[:32])
def test_what_lies_beyond_a_range_is_refused_in_words_that_tell_the_range(group: str, name: str, says: str) -> None:
    (outcome,) = run([chosen(group, name)])
    assert outcome.verdict == REFUSED, outcome.sentence
    assert says in outcome.found
    assert "/tmp" not in outcome.found


def failing(error: Exception) -> Case:
    """Return a case that is to be refused with InputError("too large"), and ends otherwise."""

    def make(_: Path) -> FrameGraph:
        raise error

    return Case("group", "name", make, Refusal(InputError, "too large"))


@pytest.mark.parametrize(
    ("error", "verdict"),
    [
        (InputError("it is too large"), REFUSED),
        (InputError("it is green"), FAILS),
        (LimitError("it is too large"), FAILS),
        (ZeroDivisionError("it is too large"), FAILS),
    ],
    ids=lambda value: type(value).__name__,
)
def test_only_the_documented_error_passes(error: Exception, verdict: str) -> None:
    (outcome,) = run([failing(error)])
    assert outcome.verdict == verdict
    assert str(error) in outcome.found
    assert outcome.passed == outcome.entry()["passed"] == (verdict == REFUSED)
