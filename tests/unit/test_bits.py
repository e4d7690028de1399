"""Sets of numbers as bits, against numpy's own."""

from __future__ import annotations

import numpy as np
import pytest

from skincli.mesh.bits import Row

COUNT = 4000


def numbers(seed: int, spread: int = 30) -> np.ndarray:
    """Return numbers in clusters, some more than once, in no order, away from the ends of the row."""
    random = np.random.default_rng(seed)
    return (random.integers(100, COUNT - 100, (40, 1)) * 64 + random.integers(0, spread, (40, 60))).ravel()


@pytest.mark.parametrize("spread", [3, 30, 200])
def test_members_and_their_numbers(spread: int) -> None:
    some, others = numbers(1, spread), numbers(2, spread)
    row = Row([some, others], COUNT)
    bits = row.marked(some)
    distinct, number = np.unique(some, return_inverse=True)
    members = row.members(bits)
    assert np.array_equal(row.at(members), distinct)
    assert np.array_equal(row.slot(distinct), members >> 6)
    assert np.array_equal(row.number(bits, some), number)
    assert np.array_equal(row.before(bits), np.searchsorted(distinct, row.place * 64))
    both, either = bits & row.marked(others), bits | row.marked(others)
    assert np.array_equal(row.at(row.members(both)), np.intersect1d(some, others))
    assert np.array_equal(row.at(row.members(either)), np.union1d(some, others))


@pytest.mark.parametrize("step", [0, 1, -1, 63, 64, -64, 65, 1000, -1000])
def test_a_moved_set_is_cut_where_no_words_are(step: int) -> None:
    some = numbers(3, 200)
    row = Row([some], COUNT)
    moved = np.unique(some) + step
    kept = moved[np.isin(moved >> 6, row.place)]
    assert np.array_equal(row.at(row.members(row.moved(row.marked(some), step))), kept)


def test_a_row_around_a_set_holds_it_moved() -> None:
    some, steps = numbers(4), [1, -1, 640, -640 + 7, 129]
    narrow = Row([some, numbers(5)], COUNT)
    bits = narrow.marked(some)
    row = narrow.around(bits, steps)
    same = narrow.within(row, bits)
    assert np.array_equal(row.at(row.members(same)), np.unique(some))
    for step in steps:
        assert np.array_equal(row.at(row.members(row.moved(same, step))), np.unique(some) + step)


def test_no_members() -> None:
    none = np.zeros(0, dtype=np.int64)
    row = Row([none], COUNT)
    bits = row.marked(none)
    assert not bits.any()
    assert len(row.members(bits)) == len(row.number(bits, none)) == 0
