"""The bounded memory: bounds hold, weights add up, contradictions stay."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from toy_situations import BALL_VOCABULARY, Labelled, ball_stream

from relgym.classification.examples import NOISE, Example
from relgym.classification.exemplars import Exemplars
from relgym.config import ClassificationConfig

_CONFIG = ClassificationConfig(exemplars_per_state=5, noise_per_state=12, max_exemplars=100)


def _filled(
    items: list[Labelled], hard: range = range(0), config: ClassificationConfig = _CONFIG
) -> Exemplars:
    exemplars = Exemplars(BALL_VOCABULARY, config)
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
        for number in range(3000):
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
