"""What scales, warts, papillae, suckers, slime and chromatophores do, on their float64 twins: no OpenGL."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError

from skincli.layers import filtering
from skincli.layers.base import Ground, Layer, Site
from skincli.layers.chromatophores import Chromatophores
from skincli.layers.papillae import Papillae
from skincli.layers.scales import Scales
from skincli.layers.slime import Slime
from skincli.layers.suckers import Suckers
from skincli.layers.warts import Warts
from tests.layers_kit import assert_tileable, evaluate, flat

Array = NDArray[np.float64]

LAYERS = [
    Scales(),
    Scales(part="gap", gap=0.4),
    Scales(part="value", point=0.7, keel=1.0),
    Warts(),
    Papillae(variation=0.3),
    Suckers(),
    Suckers(part="rim", folds=0.0),
    Suckers(part="cup"),
    Slime(),
    Chromatophores(),
]
NAMES = [f"{layer.kind()}-{getattr(layer, 'part', 'all')}" for layer in LAYERS]


@pytest.mark.parametrize("layer", LAYERS, ids=NAMES)
def test_the_pattern_lies_in_0_to_1_and_fills_it(layer: Layer) -> None:
    t = evaluate(layer, flat(180, 60))
    assert t.min() >= 0
    assert t.max() <= 1
    assert np.ptp(t) > 0.8


@pytest.mark.parametrize("layer", LAYERS, ids=NAMES)
def test_a_map_that_repeats_wraps(layer: Layer) -> None:
    assert_tileable(layer, side=64)


@pytest.mark.parametrize(
    ("small", "large"),
    [
        (Scales(spacing=2, gap=0.1), Scales(spacing=4, gap=0.2)),
        (Warts(spacing=2, diameter=1.5, cluster_size=9), Warts(spacing=4, diameter=3, cluster_size=18)),
        (Papillae(spacing=4, diameter=3), Papillae(spacing=8, diameter=6)),
        (Suckers(spacing=4, diameter=3), Suckers(spacing=8, diameter=6)),
        (Slime(scale=5, drop_size=0.5), Slime(scale=10, drop_size=1)),
        (Chromatophores(spacing=1, closed=0.1, open=0.4), Chromatophores(spacing=2, closed=0.2, open=0.8)),
    ],
    ids=lambda layer: layer.kind(),
)
def test_sizes_are_millimetres(small: Layer, large: Layer) -> None:
    """Twice the size at twice the place is the same pattern; another seed is another."""
    one, two = evaluate(small, flat(40, 30, 0.1)), evaluate(large, flat(40, 60, 0.2))
    np.testing.assert_allclose(one, two, atol=1e-9)
    assert np.abs(evaluate(small, flat(40, 30, 0.1), Ground(seed=1)) - one).max() > 0.1


@pytest.mark.parametrize("layer", LAYERS, ids=NAMES)
def test_the_pattern_is_continuous_all_around(layer: Layer) -> None:
    """On a ball of 60 mm, a step of 0.1 µm of place and normal changes nothing much, wherever the normal points."""
    rng = np.random.default_rng(3)
    normal, aside = rng.standard_normal((2, 4000, 3))
    aside = normal + 3e-6 * aside

    def on_ball(direction: Array) -> Site:
        unit = direction / np.linalg.norm(direction, axis=1, keepdims=True)
        site = flat(1, 1)
        return {
            **{key: np.repeat(array, len(unit), axis=0) for key, array in site.items()},  # type: ignore[typeddict-item, attr-defined]
            "position": 30 * unit,
            "normal": unit,
            "footprint": np.full(len(unit), 0.1),
        }

    assert np.abs(evaluate(layer, on_ball(normal)) - evaluate(layer, on_ball(aside))).max() < 0.02


@pytest.mark.parametrize("texel", [0.01, 0.5, 1.2, 3.0])
@pytest.mark.parametrize("softness", [0.0, 0.15])
def test_a_disk_keeps_its_mass_and_grows_by_the_variance_of_a_texel(texel: float, softness: float) -> None:
    away = (np.arange(40_000) + 0.5) * 5e-4

    def moments(texel: float) -> tuple[float, float]:
        disk = filtering.disk_of(np.array(0.6), np.array(softness), np.array(texel))
        weight = disk.at(away) * away * 5e-4 * 2 * np.pi
        return float(weight.sum()), float((weight * away**2).sum() / weight.sum() / 2)

    (mass, variance), (mass0, variance0) = moments(texel), moments(1e-4)
    assert mass == pytest.approx(mass0, rel=1e-3)
    assert variance - variance0 == pytest.approx(texel**2 / 12, rel=0.1, abs=1e-4)


def test_places_of_a_texel_are_those_of_the_four_finer_ones() -> None:
    normal = np.array([[0.0, 0.6, 0.8]])
    coarse, fine = (
        np.concatenate(list(filtering.places_in_texel(normal, np.array([size]), count)))
        for size, count in ((2, 8), (1, 4))
    )
    quarters = np.concatenate(list(filtering.places_in_texel(normal, np.array([2.0]), 2)))
    four = (quarters[:, None] + fine).reshape(-1, 3)
    assert np.abs(coarse[:, None] - four).sum(axis=-1).min(axis=1).max() < 1e-12


# --- scales ---------------------------------------------------------------------------------------------------------


def test_rows_of_scales_repeat_at_their_spacing() -> None:
    """Without disorder a row repeats after the spacing, and every second row is the same."""
    layer = Scales(spacing=3, length=0.5, jitter=0, direction=(0, 1, 0))
    site = flat(60, 20, 0.02)
    t = evaluate(layer, site)
    for step in ((3, 0, 0), (0, 3, 0), (1.5, 1.5, 0)):
        moved: Site = {**site, "position": site["position"] + np.array(step)}  # type: ignore[typeddict-item]
        np.testing.assert_allclose(evaluate(layer, moved), t, atol=1e-9)
    aside: Site = {**site, "position": site["position"] + np.array([0, 1.5, 0])}  # type: ignore[typeddict-item]
    assert np.abs(evaluate(layer, aside) - t).max() > 0.3


@pytest.mark.parametrize("direction", [(0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.6, 0.8, 0.0)])
def test_scales_rise_towards_their_tips(direction: tuple[float, ...]) -> None:
    """Most places lie on a slope up along the direction; the steps down behind the tips are narrow."""
    site = flat(80, 20, 0.02)
    here = evaluate(Scales(direction=direction), site)
    site["position"] = site["position"] + 0.02 * np.array(direction)
    rise = evaluate(Scales(direction=direction), site) - here
    assert np.mean(rise > 0) > 0.65


def test_gaps_are_where_scales_end() -> None:
    site = flat(120, 20, 0.05)
    height, gap = (evaluate(Scales(gap=0.5, part=part), site) for part in ("scale", "gap"))
    assert height[gap > 0.95].max() < 0.1
    assert np.median(height[gap < 0.01]) > 0.4
    assert evaluate(Scales(gap=1.0, part="gap"), site).mean() > 1.5 * gap.mean()


def test_each_scale_has_one_value() -> None:
    site = flat(150, 20, 0.01)
    value = evaluate(Scales(part="value"), site).reshape(150, 150)
    assert np.mean(np.abs(np.diff(value, axis=0)) < 1e-9) > 0.85
    assert len(np.unique(np.round(value, 6))) > 20
    assert value.std() == pytest.approx(12**-0.5, abs=0.06)


def test_a_keel_raises_the_middle_of_scales() -> None:
    site = flat(120, 20, 0.05)
    plain, keeled = (evaluate(Scales(keel=keel, jitter=0, direction=(0, 1, 0)), site) for keel in (0.0, 1.0))
    across = (site["position"][:, 0] / 4) % 0.5
    middle = (across < 0.05) | (across > 0.45)
    flank = (across > 0.2) & (across < 0.3)
    change = keeled - plain
    assert np.percentile(change[middle], 80) > np.percentile(change[flank], 80) + 0.1


# --- warts and papillae ---------------------------------------------------------------------------------------------


def test_warts_are_as_wide_as_is_asked_for() -> None:
    """Equal warts without disorder, on the flat: the area they cover, and their number."""
    layer = Warts(spacing=4, diameter=3, variation=0, jitter=0, clustering=0)
    t = evaluate(layer, flat(400, 40))
    assert np.mean(t > 0) == pytest.approx(np.pi * 1.5**2 / 16, rel=0.02)


def test_clusters_leave_skin_bare_and_flat_tops_fill_more() -> None:
    site = flat(200, 120)
    everywhere, clustered, flat_tops = (
        evaluate(Warts(**settings), site) for settings in ({"clustering": 0.0}, {"clustering": 1.0}, {"flatness": 1.0})
    )
    blocks = [t.reshape(10, 20, 10, 20).mean(axis=(1, 3)) for t in (everywhere, clustered)]
    assert blocks[0].min() > 0
    assert np.mean(blocks[1] < 0.01) > 0.1
    assert flat_tops.mean() > evaluate(Warts(), site).mean()


def test_papillae_are_pointed_and_of_unequal_height() -> None:
    layer = Papillae(variation=0.9, ridges=0, jitter=0, lean=0)
    t = evaluate(layer, flat(192, 64)).reshape(8, 24, 8, 24)
    heights = t.max(axis=(1, 3)).ravel()
    assert heights.max() > 0.7
    assert np.median(heights) < 0.5
    assert heights.min() < 0.2
    # A cone loses height at once, a dome does not.
    single = evaluate(Papillae(variation=0, ridges=0, jitter=0, lean=0), flat(160, 8))
    assert single.max() - np.sort(single)[-30] > 0.03


def test_leaning_moves_the_point_and_keeps_the_base() -> None:
    settings: dict[str, Any] = {"variation": 0, "ridges": 0, "jitter": 0}
    upright, leaning = (evaluate(Papillae(lean=lean, **settings), flat(300, 32)) for lean in (0.0, 0.7))
    assert np.mean((upright > 0) ^ (leaning > 0)) < 0.01
    assert np.abs(upright - leaning).max() > 0.2


def test_ridges_lie_about_the_base_and_spare_the_point() -> None:
    plain, ridged = (evaluate(Papillae(ridges=r, jitter=0, variation=0), flat(300, 32)) for r in (0.0, 1.0))
    change = np.abs(plain - ridged)
    assert change[plain > 0.9].max() < 0.05
    assert change[(plain > 0.1) & (plain < 0.4)].max() > 0.05


# --- suckers --------------------------------------------------------------------------------------------------------


def test_a_sucker_has_a_rim_a_cup_and_a_hole() -> None:
    settings: dict[str, Any] = {"spacing": 8, "diameter": 6, "variation": 0, "folds": 0, "jitter": 0}
    site = flat(160, 8)
    site["position"] = site["position"] - np.array([4, 4, 0])
    height, rim, cup = (evaluate(Suckers(part=part, **settings), site) for part in ("all", "rim", "cup"))
    away = np.linalg.norm(site["position"] - np.average(site["position"], axis=0, weights=rim + cup), axis=1) / 3
    assert height[away < 0.1].max() < 0.05
    assert height[(away > 0.3) & (away < 0.45)].mean() == pytest.approx(0.35, abs=0.03)
    assert rim[(away > 0.71) & (away < 0.72)].min() > 0.95
    assert cup[away < 0.45].min() > 0.95
    assert (rim + cup).max() <= 1 + 1e-9


def test_folds_turn_sixteen_times_around_a_sucker() -> None:
    settings: dict[str, Any] = {"spacing": 8, "diameter": 6, "variation": 0, "jitter": 0}
    around = flat(160, 8)
    around["position"] = around["position"] - np.array([4, 4, 0])
    center = np.average(around["position"], axis=0, weights=evaluate(Suckers(part="cup", folds=0, **settings), around))
    site = flat(40, 1, 0.01)
    angle = np.arange(1600) * 2 * np.pi / 1600
    site["position"] = center + 1.3 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    spectrum = np.abs(np.fft.rfft(evaluate(Suckers(folds=1, **settings), site)))
    assert np.argmax(spectrum[1:]) + 1 == 16


# --- slime ----------------------------------------------------------------------------------------------------------


def test_slime_covers_what_is_asked_for() -> None:
    site = flat(120, 200)
    means = [evaluate(Slime(coverage=coverage, drops=0.0), site).mean() for coverage in (0.0, 0.25, 0.5, 0.75, 1.0)]
    assert np.all(np.diff(means) > 0.05)
    assert means[0] < 0.02
    assert means[2] == pytest.approx(0.5, abs=0.06)
    assert means[4] > 0.98


def test_pools_are_flat_and_drops_are_round() -> None:
    pools = evaluate(Slime(drops=0.0), flat(200, 60))
    assert np.mean(pools > 0.999) > 0.2
    drops = evaluate(Slime(coverage=0.0, drops=1.0, drop_size=2.0), flat(200, 40))
    assert 0.05 < np.mean(drops > 0.02) < 0.3
    assert drops.max() > 0.9


# --- chromatophores -------------------------------------------------------------------------------------------------


def test_coverage_grows_with_expansion() -> None:
    site = flat(120, 30, 0.05)
    maps = [evaluate(Chromatophores(expansion=e), site) for e in np.linspace(0, 1, 6)]
    assert np.all(np.diff([t.mean() for t in maps]) > 0.01)
    assert maps[0].mean() < 0.05
    assert maps[-1].mean() > 0.4


@pytest.mark.parametrize("variation", [0.0, 1.0])
def test_sacs_open_smoothly_and_stay_where_they_are(variation: float) -> None:
    site = flat(60, 6, 0.1)
    closed = evaluate(Chromatophores(expansion=0.0, variation=variation), site)
    for expansion in (0.0, 0.3, 0.6, 0.99):
        one, two = (
            evaluate(Chromatophores(expansion=expansion + step, variation=variation), site) for step in (0.0, 0.01)
        )
        assert np.abs(one - two).max() < 0.2
    # A closed sac lies within the open one.
    assert evaluate(Chromatophores(expansion=1.0, variation=variation), site)[closed > 0.5].min() > 0.8


@pytest.mark.parametrize(
    ("cls", "settings", "message"),
    [
        (Warts, {"diameter": 5.0}, "more than spacing"),
        (Warts, {"cluster_size": 5.0}, "three times the spacing"),
        (Papillae, {"diameter": 9.0}, "more than spacing"),
        (Suckers, {"diameter": 9.0}, "more than spacing"),
        (Scales, {"direction": (0.0, 0.0, 0.0)}, "direction is 0"),
        (Chromatophores, {"closed": 0.6}, "closed must be less than open"),
    ],
)
def test_what_does_not_fit_is_refused(cls: type[Layer], settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        cls(**settings)
