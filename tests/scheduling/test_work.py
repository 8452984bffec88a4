from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

from relgym.numeric.ransac import consensus
from relgym.scheduling.work import Steps, Task, resumable


@resumable
def drawn(count: int, *, rng: np.random.Generator) -> Steps[list[float]]:
    """Draw numbers, one a piece."""
    found = []
    for _ in range(count):
        found.append(float(rng.random()))
        yield 10
    return found


def test_at_once_or_in_pieces_the_result_is_the_same() -> None:
    whole = drawn(5, rng=np.random.default_rng(1))
    task = Task(drawn, 5, rng=np.random.default_rng(1))
    spent = []
    while not task.done:
        spent.append(task.advance(1))
    assert task.result == whole
    assert spent == [10, 10, 10, 10, 10, 0]
    assert drawn.__doc__ == "Draw numbers, one a piece."


def test_a_budget_is_overdrawn_by_one_piece_at_most() -> None:
    task = Task(drawn, 5, rng=np.random.default_rng(1))
    assert task.advance(25) == 30
    assert not task.done and task.pieces == 3
    assert task.advance(10**9) == 20
    assert task.done


def test_random_numbers_are_the_tasks_own() -> None:
    rng = np.random.default_rng(1)
    before = rng.bit_generator.state
    task = Task(drawn, 3, rng=rng)
    task.advance(10**9)
    assert rng.bit_generator.state == before
    expected = np.random.default_rng(1)
    expected.random(3)
    assert task.rng.bit_generator.state == expected.bit_generator.state


@pytest.mark.parametrize("made", [copy.deepcopy, lambda task: pickle.loads(pickle.dumps(task))])
@pytest.mark.parametrize("pieces", [0, 2, 6])
def test_a_copy_goes_on_where_the_original_stands(made, pieces: int) -> None:  # type: ignore[no-untyped-def]
    task = Task(drawn, 5, rng=np.random.default_rng(1))
    for _ in range(pieces):
        task.advance(1)
    twin = made(task)
    assert (twin.pieces, twin.done) == (task.pieces, task.done)
    assert twin.advance(10**9) == task.advance(10**9)
    assert twin.result == task.result
    assert twin.rng is None or twin.rng.bit_generator.state == task.rng.bit_generator.state


def test_a_search_in_pieces_finds_what_it_finds_at_once() -> None:
    rng = np.random.default_rng(3)
    x = rng.normal(size=(120, 7))
    y = np.where(np.arange(120) < 80, 2.0 * x[:, 1] - x[:, 4], rng.normal(size=120))
    given = {"sigma": 1e-12, "tolerance": 4e-12, "terms": 2, "size": 5, "draws": 200}
    whole = consensus(x, y, rng=np.random.default_rng(0), **given)  # type: ignore[arg-type]
    task = Task(consensus, x, y, rng=np.random.default_rng(0), **given)
    pieces = 0
    while not task.done:
        assert task.advance(1) <= 5_000_000
        pieces += 1
    assert pieces > 5
    assert whole is not None and task.result is not None
    assert task.result.fit == whole.fit
    assert whole.fit.columns == (1, 4)
