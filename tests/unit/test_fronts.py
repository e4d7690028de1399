"""The Pareto front, the picks from it, the comparison of two benches, and the page."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skincli.bench import compare, html
from skincli.bench.fronts import (
    STAGE_TITLES,
    Errors,
    Found,
    Point,
    Shown,
    cheapest,
    grid,
    levels_of_quality,
    marked,
    pareto,
)
from skincli.bench.report import FORMAT
from skincli.bench.timing import Spread
from skincli.errors import InputError, LimitError
from skincli.scene.model import ATLAS_OF_QUALITY, TERMS_OF_QUALITY, Quality


def point(ms: float, error: float, method: str = "lattice", **settings: int) -> Point:
    errors = Errors(error, 2 * error, 5 * error, error / 10, -error / 3, 0)
    return Point("picture", method, settings, Spread(ms, ms, ms, 3), errors, error / 2, error / 2, to_paper=ms / 100)


# -- the front -------------------------------------------------------------------------------------------------------


def test_the_front_is_what_nothing_beats() -> None:
    random = np.random.default_rng(3)
    for count in (1, 2, 5, 40):
        costs, errors = random.integers(1, 12, (2, count)).astype(float).tolist()
        front = pareto(costs, errors)
        for i in range(count):
            beaten = any(
                costs[j] <= costs[i] and errors[j] <= errors[i] and (costs[j], errors[j]) != (costs[i], errors[i])
                for j in range(count)
            )
            assert front[i] == (not beaten)


def test_the_front_does_not_depend_on_order_or_on_beaten_points() -> None:
    random = np.random.default_rng(4)
    costs, errors = random.random((2, 30))
    front = np.array(pareto(costs.tolist(), errors.tolist()))
    order = random.permutation(30)
    assert (np.array(pareto(costs[order].tolist(), errors[order].tolist())) == front[order]).all()
    alone = pareto(costs[front].tolist(), errors[front].tolist())
    assert all(alone)
    # From the cheapest to the dearest the error falls.
    by_cost = np.argsort(costs[front])
    assert (np.diff(errors[front][by_cost]) < 0).all()


def test_what_is_not_finite_is_never_on_the_front() -> None:
    assert pareto([1.0, 2.0, math.nan], [math.nan, 0.5, 0.1]) == [False, True, False]
    assert pareto([1.0, 1.0], [0.5, 0.5]) == [True, True]
    assert pareto([], []) == []


# -- picks -----------------------------------------------------------------------------------------------------------


def test_the_cheapest_that_holds_is_picked() -> None:
    points = [point(10, 0.2), point(20, 0.01), point(30, 0.009), point(15, math.nan)]
    assert cheapest(points, 0.01) is points[1]
    assert cheapest(points, 0.5) is points[0]


def test_where_none_holds_the_least_error_is_named() -> None:
    with pytest.raises(LimitError, match=r"none of 3 points holds it; the least relative RMSE is 0\.009, of lattice"):
        cheapest([point(10, 0.2), point(30, 0.009), point(1, math.nan)], 0.001)


def test_quality_levels_name_what_is_faster_and_as_near() -> None:
    draft = point(50, 0.02, atlas=ATLAS_OF_QUALITY["draft"], terms=TERMS_OF_QUALITY["draft"])
    better = point(40, 0.01, method="splat", atlas=512, terms=2)
    first, *others = levels_of_quality(marked([draft, better]))
    assert (first["point"], first["front"], first["better"]) == (draft.name, False, better.name)
    assert [level["point"] for level in others] == [None, None]


@pytest.mark.parametrize("full", [False, True])
def test_the_grid_has_every_point_once_and_the_levels(full: bool) -> None:
    points = grid(full)
    names = [(method, *sorted(settings.items())) for method, settings in points]
    assert len(set(names)) == len(names)
    assert "exact" not in {method for method, _ in points}
    swept = {(settings["atlas"], settings.get("terms")) for method, settings in points if method == "lattice"}
    levels: tuple[Quality, ...] = ("draft", "standard", "high") if full else ("draft", "standard")
    for level in levels:
        assert (ATLAS_OF_QUALITY[level], TERMS_OF_QUALITY[level]) in swept


# -- two benches -----------------------------------------------------------------------------------------------------


def bench(points: list[Point]) -> dict[str, Any]:
    scene = {"size": [64, 48], "triangles": 8, "reference": "exact", "rounds": 3}
    sweep = Found(scene, marked(points), notes={stage: f"about {stage} <&>" for stage in STAGE_TITLES})
    sweep.levels = levels_of_quality(sweep.points)
    stage = {"node": "diffused", "shading": "paper", "rms": 1e-4, "scale": 1.0}
    device = {"renderer": "a <device>", "version": "4.5 & more", "software": True, "cores": 2}
    found = {"bench": FORMAT, "device": device, "versions": {"skincli": "1"}, "surfaces": None}
    return {**found, "stages": [stage], "sweep": sweep.entry()}


def test_a_bench_is_not_worse_than_itself() -> None:
    found = bench([point(10, 0.2, atlas=512), point(20, 0.01, atlas=1024)])
    changes = compare.compare(found, found)
    assert len(changes) == 2 * 7 + 1
    assert {change.ratio for change in changes} == {1.0}
    assert not any(change.worse for change in changes)


def test_growth_beyond_the_threshold_is_worse_and_less_is_not() -> None:
    old = bench([point(10, 0.2, atlas=512), point(20, 0.01, atlas=1024)])
    new = bench([point(10 * 1.2, 0.2 * 1.2, atlas=512), point(20 * 1.3, 0.001, atlas=1024), point(5, 0.3, atlas=64)])
    worse = {(change.what, change.metric) for change in compare.compare(old, new) if change.worse}
    first, second = "picture: lattice, atlas 512", "picture: lattice, atlas 1024"
    errors = ("relative_rmse", "p99", "maximum", "flip", "energy_drift")
    assert worse == {(second, "time to paper"), *((first, metric) for metric in errors)}
    assert "WORSE" in compare.as_text(old, new, compare.compare(old, new))


def test_nan_and_new_values_that_are_not_finite_are_worse() -> None:
    old = bench([point(10, 0.2)])
    broken = point(10, 0.2)
    new = bench([replace(broken, errors=replace(broken.errors, relative_rmse=math.nan, nonfinite=3))])
    assert {change.metric for change in compare.compare(old, new) if change.worse} == {"relative_rmse", "nonfinite"}


def test_what_is_no_bench_is_refused(tmp_path: Path) -> None:
    for name, text in (("list.json", "[]"), ("other.json", "{}"), ("broken.json", "{")):
        (tmp_path / name).write_text(text)
        with pytest.raises(InputError, match=name):
            compare.read(tmp_path / name)
    with pytest.raises(InputError, match="missing"):
        compare.read(tmp_path / "missing")
    found = bench([point(10, 0.2)])
    (tmp_path / "bench.json").write_text(json.dumps(found))
    assert compare.read(tmp_path) == found


# -- the page --------------------------------------------------------------------------------------------------------


class Checker(HTMLParser):
    """Holds a page to balanced elements, unique ids and no address outside itself."""

    VOID = ("meta", "input", "img")

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.count: dict[str, int] = {}

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.count[tag] = self.count.get(tag, 0) + 1
        if tag not in self.VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name == "id":
                self.ids.append(value or "")
            if name in ("src", "href"):
                assert (value or "").startswith("data:image/png;base64,")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in self.VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def checked(page: str) -> Checker:
    checker = Checker()
    checker.feed(page)
    checker.close()
    assert checker.open == []
    assert len(set(checker.ids)) == len(checker.ids)
    assert "http" not in page
    assert "nan" not in page.lower().replace("finance", "")
    return checker


def test_the_page_is_well_formed_and_needs_nothing_else() -> None:
    points = [point(10, 0.2, atlas=512), point(20, 0.01, atlas=1024), point(15, 0.1, method="screen_space", atlas=512)]
    found = bench(points)
    display = np.ones((6, 8, 4), dtype=np.float32)
    display[0, :, 3] = 0
    shown = {p.name: Shown(display, np.full((6, 8), 0.1, dtype=np.float32)) for p in points}
    shown["exact"] = Shown(display, np.zeros((6, 8), dtype=np.float32))
    page = html.page(found, shown, "a table <with> marks")
    checker = checked(page)
    assert checker.count["svg"] == 1
    assert checker.count["option"] == 2 * 4
    assert checker.count["circle"] >= 3 + 2  # points and rings of the front
    assert "a &lt;device&gt;" in page
    assert {"compare", "left", "right", "at", "picture0", "picture3"} <= set(checker.ids)


def test_a_page_without_a_sweep_is_well_formed() -> None:
    checked(html.page({**bench([]), "sweep": None}, {}, "tables"))


def test_a_plot_leaves_out_what_has_no_logarithm() -> None:
    entries = [p.entry() for p in marked([point(10, 0.0), point(10, math.inf), point(20, 0.5)])]
    assert html.plot(entries).count("<title>") == 1
    assert html.plot(entries[:2]) == ""


def test_error_maps_go_from_black_to_bright() -> None:
    found = html.heat_map(np.array([[0.0, 1e-3, 1e-2, 1e-1, 1.0, 50.0]])).sum(axis=-1)[0]
    assert found[0] == found[1] < 0.01
    assert (np.diff(found[1:5]) > 0).all()
    assert found[5] == found[4] > 2
