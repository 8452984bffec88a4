"""The bounded memory: bounds hold, weights add up, contradictions stay."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from toy_situations import BALL_VOCABULARY, Labelled, ball_stream

from relgym.classification.examples import NOISE, Example
from relgym.classification.exemplars import Exemplars, dyadic
from relgym.classification.rows import RowPool
from relgym.config import ClassificationConfig

_CONFIG = ClassificationConfig(exemplars_per_state=5, noise_per_state=12, max_exemplars=100)


def _filled(
    items: list[Labelled],
    hard: range = range(0),
    config: ClassificationConfig = _CONFIG,
    pool: RowPool | None = None,
) -> Exemplars:
    exemplars = Exemplars(BALL_VOCABULARY, config, pool)
    exemplars.set_modes(range(6), np.empty(0, int), np.empty((0, 6), bool), np.empty((0, 6)))
    for number, item in enumerate(items):
        exemplars.add(item.example, item.mode, item.fits, item.values, hard=number in hard)
    return exemplars


@pytest.fixture(scope="module")
def items() -> list[Labelled]:
    return list(ball_stream(1500, rng=np.random.default_rng(1)))


def _cells(items: list[Labelled]) -> dict[tuple[int, bytes], int]:
    counts: dict[tuple[int, bytes], int] = {}
    for item in items:
        cell = item.mode, item.example.key
        counts[cell] = counts.get(cell, 0) + 1
    return counts


def test_no_more_than_the_bound_per_mode_and_state(items: list[Labelled]) -> None:
    exemplars = _filled(items, config=ClassificationConfig(exemplars_per_state=5))
    assert len(exemplars) == sum(min(count, 5) for count in _cells(items).values())


def test_weights_add_up_to_the_examples_seen(items: list[Labelled]) -> None:
    exemplars = _filled(items, config=ClassificationConfig(exemplars_per_state=5))
    assert exemplars.weights().sum() == pytest.approx(1500, rel=2e-3)
    for mode in range(6):
        assert exemplars.weights()[exemplars.assigned == mode].sum() == pytest.approx(
            sum(item.mode == mode for item in items), rel=5e-3
        )


def test_total_is_bounded_and_every_rare_state_survives(items: list[Labelled]) -> None:
    exemplars = _filled(items)
    assert len(exemplars) == 100
    kept = {
        (int(m), items[row].example.key) for m, row in zip(exemplars.assigned, exemplars.rows, strict=True)
    }
    assert len(kept) == min(len(_cells(items)), 100)


def test_contradictions_stay_whatever_comes_later(items: list[Labelled]) -> None:
    one_state = [
        item for item in items if item.example.key == items[0].example.key and item.mode == items[0].mode
    ]
    assert len(one_state) > 20
    exemplars = _filled(one_state, hard=range(8, 11))
    assert {one_state[at].example.row for at in range(8, 11)} <= set(exemplars.rows.tolist())
    np.testing.assert_array_equal(exemplars.weights()[exemplars.columns["hard"]], [1.0, 1.0, 1.0])
    assert exemplars.weights().sum() == pytest.approx(len(one_state), rel=2e-3)


def test_reservoir_is_spread_over_the_stream_and_repeatable(items: list[Labelled]) -> None:
    config = ClassificationConfig(exemplars_per_state=100)
    one = [Labelled(items[0].example, 0, items[0].fits, np.full(6, float(i))) for i in range(4000)]
    exemplars = _filled(one, config=config)
    first = exemplars.columns["values"][:, 0]
    assert 1700 < first.mean() < 2300
    np.testing.assert_array_equal(first, _filled(one, config=config).columns["values"][:, 0])


def test_noise_that_becomes_a_mode_keeps_its_examples_and_their_weight(items: list[Labelled]) -> None:
    exemplars = Exemplars(BALL_VOCABULARY, _CONFIG)
    for item in items[:60]:
        exemplars.add(items[0].example, NOISE, np.empty(0, bool), np.empty(0), roles=(item.mode,))
    assert len(exemplars) == 12
    n = len(exemplars)
    exemplars.set_modes([4], np.full(n, 4), np.ones((n, 1), bool), np.zeros((n, 1)))
    assert len(exemplars) == 5
    assert exemplars.weights().sum() == pytest.approx(60)
    assert exemplars.columns["fits"].shape == (5, 1)


def test_content_survives_json_and_goes_on_alike(items: list[Labelled]) -> None:
    exemplars = _filled(items[:700], hard=range(50))
    again = Exemplars(BALL_VOCABULARY, _CONFIG)
    again.load(json.loads(json.dumps(exemplars.to_dict())))
    for each in (exemplars, again):
        for item in items[700:]:
            each.add(item.example, item.mode, item.fits, item.values)
    np.testing.assert_array_equal(again.rows, exemplars.rows)
    np.testing.assert_array_equal(again.weights(), exemplars.weights())


def _among(example: Example, bodies: int, key: bytes) -> Example:
    """The example with bystanders of which nothing is true."""
    more = bodies - len(example.close)
    return replace(
        example,
        table=np.pad(example.table, ((0, 0), (0, more), (0, more))),
        unary=np.pad(example.unary, ((0, 0), (0, more))),
        close=np.pad(example.close, (0, more)),
        pair=np.pad(example.pair, ((0, more), (0, 0)), constant_values=np.nan),
        approached=np.pad(example.struck, (0, more)),
        key=key,
    )


def test_memory_is_bounded_however_many_bodies_come(items: list[Labelled]) -> None:
    exemplars = Exemplars(BALL_VOCABULARY, ClassificationConfig(exemplar_memory=1))
    exemplars.set_modes(range(6), np.empty(0, int), np.empty((0, 6), bool), np.empty((0, 6)))
    memory = lambda: sum(exemplars.columns[name].nbytes for name in exemplars.columns.columns)  # noqa: E731
    kept = {}
    for bodies in (8, 16, 24):
        for number in range(1500):
            item, key = items[number % len(items)], b"%d of %d" % (number % 700, bodies)
            slot = exemplars.add(_among(item.example, bodies, key), item.mode, item.fits, item.values)
            assert slot is None or exemplars.key_of(slot) == key
        assert memory() <= 2**20
        assert memory() > 2**19 or len(exemplars) == 700
        kept[bodies] = len(exemplars)
        slots = sorted(slot for _, _, members in exemplars.cells for slot in members)
        assert slots == list(range(len(exemplars)))
    assert kept[8] > kept[16] > kept[24] > 100
    exemplars.add(_among(items[0].example, 200, b""), 0, items[0].fits, items[0].values)
    assert len(exemplars) == 100


# ---------------------------------------------------------------------- by hand
_ANY = next(ball_stream(1, rng=np.random.default_rng(0)))


def _memory(**settings_: int) -> Exemplars:
    """A memory for modes 1 and 2."""
    exemplars = Exemplars(BALL_VOCABULARY, ClassificationConfig(**settings_))
    exemplars.set_modes((1, 2), np.empty(0, int), np.empty((0, 2), bool), np.empty((0, 2)))
    return exemplars


def _offer(
    exemplars: Exemplars,
    row: int,
    key: bytes = b"k",
    mode: int = 1,
    *,
    hard: bool = False,
    weight: float = 1.0,
) -> int | None:
    example = replace(_ANY.example, key=key, row=row)
    return exemplars.add(example, mode, np.array([True, False]), np.zeros(2), hard=hard, weight=weight)


def test_weights_are_rounded_to_64ths_and_never_nothing() -> None:
    given_ = np.array([1.0, 1 / 3, 1 / 64, 1e-9, 10.01, 2.0 + 1 / 128])
    assert dyadic(given_).tolist() == [1.0, 21 / 64, 1 / 64, 1 / 64, 641 / 64, 2.0]  # halves to even


def test_what_each_example_stands_for_by_hand() -> None:
    """Ten were seen in a state, of which three are kept, two of them hard: the third one stands for eight."""
    exemplars = _memory(exemplars_per_state=3)
    for row in range(10):
        _offer(exemplars, row, hard=row in (4, 6))
    for row in range(20, 24):
        _offer(exemplars, row, b"other", hard=True)  # all are hard, and one is gone: they share
    slots = {key: members for _, key, members in exemplars.cells}
    weights = exemplars.weights()
    assert sorted(weights[slots[b"k"]].tolist()) == [1.0, 1.0, 8.0]
    assert weights[exemplars.columns["hard"] & np.isin(exemplars.rows, (4, 6))].tolist() == [1.0, 1.0]
    assert weights[slots[b"other"]].tolist() == [85 / 64] * 3  # 4 / 3, rounded
    _offer(exemplars, 30, b"heavy", weight=2.5)
    assert exemplars.weights()[-1] == 2.5


def test_hard_ones_push_out_soft_ones_and_then_one_another() -> None:
    exemplars = _memory(exemplars_per_state=2)
    assert [_offer(exemplars, row) for row in (0, 1)] == [0, 1]
    assert _offer(exemplars, 2, hard=True) in (0, 1)
    assert _offer(exemplars, 3, hard=True) in (0, 1)
    assert sorted(exemplars.rows.tolist()) == [2, 3]
    assert [_offer(exemplars, row) for row in range(4, 50)] == [None] * 46  # no soft one gets in any more
    assert _offer(exemplars, 50, hard=True) in (0, 1)
    assert 50 in exemplars.rows.tolist() and len(exemplars) == 2


def test_a_full_memory_gives_a_new_state_the_room_of_the_most_crowded() -> None:
    exemplars = _memory(exemplars_per_state=200, max_exemplars=100)
    for row in range(60):
        _offer(exemplars, row, b"a")
    for row in range(60, 100):
        _offer(exemplars, row, b"b")
    assert len(exemplars) == 100
    assert _offer(exemplars, 100, b"c") is not None
    sizes = lambda: {key: len(members) for _, key, members in exemplars.cells}  # noqa: E731
    assert sizes() == {b"a": 59, b"b": 40, b"c": 1}
    for row in range(101, 161):
        _offer(exemplars, row, b"c")
    assert sum(sizes().values()) == len(exemplars) == 100
    assert max(sizes().values()) - min(sizes().values()) <= 7
    slots = sorted(slot for _, _, members in exemplars.cells for slot in members)
    assert slots == list(range(100))


def test_how_many_examples_a_memory_holds_by_hand() -> None:
    """A megabyte of 2^20 bytes, through the bytes of one example; never fewer than a hundred, nor more than told."""
    exemplars = _memory(exemplar_memory=1)
    # With K bodies: 5 relations K^2, 5 types and 3 flags K, of a byte; 4 pair features K, 2 own ones, target, row,
    # mode, state and 2 values of 8 bytes; `hard` and 2 fits of one. No roles.
    for bodies in (6, 40, 200):
        size = 5 * bodies**2 + (5 + 3) * bodies + 8 * (4 * bodies + 2 + 4 + 2) + 1 + 2
        assert exemplars._most(bodies) == max(100, 2**20 // size)
    assert _memory(exemplar_memory=1, max_exemplars=150)._most(6) == 150


def test_more_bodies_take_the_room_of_the_most_crowded_states() -> None:
    exemplars = _memory(exemplar_memory=1, exemplars_per_state=10_000)
    for row in range(1_200):
        _offer(exemplars, row, b"a" if row < 900 else b"b")
    assert exemplars._most(40) == 108
    example = _among(_ANY.example, 40, b"c")
    exemplars.add(example, 1, np.array([True, False]), np.zeros(2))
    sizes = {key: len(members) for _, key, members in exemplars.cells}
    # Shed to 54 of 900 and 54 of 300; the newcomer takes one of the first.
    assert sizes == {b"a": 53, b"b": 54, b"c": 1}
    assert sum(exemplars.columns[name].nbytes for name in exemplars.columns.columns) <= 2**20


@settings(max_examples=40, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(0, 3), st.sampled_from([NOISE, 1, 2]), st.booleans()), min_size=1, max_size=250
    ),
    st.integers(1, 6),
    st.integers(1, 9),
)
def test_bounds_hold_and_weights_add_up_whatever_comes(
    offers: list[tuple[int, int, bool]], per_state: int, noise: int
) -> None:
    exemplars = _memory(exemplars_per_state=per_state, noise_per_state=noise, max_exemplars=100)
    seen: dict[tuple[int, bytes], int] = {}
    for row, (state, mode, hard) in enumerate(offers):
        key = bytes([state + 1])
        seen[mode, key] = seen.get((mode, key), 0) + 1
        slot = _offer(exemplars, row, key, mode, hard=hard)
        assert slot is not None or not hard
        assert slot is None or (exemplars.rows[slot] == row and exemplars.key_of(slot) == key)
    weights = exemplars.weights()
    slots = []
    for mode, key, members in exemplars.cells:
        cap = noise if mode == NOISE else per_state
        assert len(members) == min(seen[mode, key], cap)  # four states of three modes never fill it
        assert (exemplars.assigned[members] == mode).all()
        assert weights[members].sum() == pytest.approx(seen[mode, key], abs=cap / 128)
        hard = exemplars.columns["hard"][members]
        told = [row for row, each in enumerate(offers) if (each[1], bytes([each[0] + 1])) == (mode, key)]
        assert hard.sum() == min(sum(offers[row][2] for row in told), cap)
        slots += members
    assert sorted(slots) == list(range(len(exemplars)))


def test_the_kth_example_enters_with_probability_size_over_k() -> None:
    """Of 400 streams of 40 with room for 8, each place of the stream is kept one time in five."""
    exemplars = _memory(exemplars_per_state=8, max_exemplars=10_000)
    for stream in range(400):
        for k in range(40):
            _offer(exemplars, k, stream.to_bytes(3, "big"))
    kept = np.bincount(exemplars.rows, minlength=40)
    assert kept.sum() == 3_200
    assert np.abs(kept / 400 - 0.2).max() < 4.0 * np.sqrt(0.2 * 0.8 / 400)


def test_those_who_share_a_pool_keep_what_they_would_alone(items: list[Labelled]) -> None:
    pool = RowPool(len(BALL_VOCABULARY.own))
    alone = [_filled(part) for part in (items, items[::2])]
    together = [_filled(part, pool=pool) for part in (items, items[::2])]
    assert [each.to_dict() for each in together] == [each.to_dict() for each in alone]
    assert [each.own_of(3).tolist() for each in together] == [
        each.columns["own"][3].tolist() for each in alone
    ]
    assert len(pool) == len({row.tobytes() for each in alone for row in each.columns["own"]})
    restored = pickle.loads(pickle.dumps(together))
    assert [each.to_dict() for each in restored] == [each.to_dict() for each in alone]
