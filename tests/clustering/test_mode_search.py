"""When modes are looked for, in which examples, and what becomes of a search that takes many steps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from streams import ALONE, BALL, Stream, V, mode_of

from relgym.clustering.columns import SlotSignature
from relgym.clustering.discovery import Scale
from relgym.clustering.em import Cluster
from relgym.clustering.examples import ExampleTable
from relgym.clustering.mode import NOISE
from relgym.clustering.mode_search import ALTERNATIVES, ModeSearch, Search
from relgym.clustering.population import Population
from relgym.config import ClusteringConfig
from relgym.config.constants import SEARCHED_ROWS
from relgym.scene.objects import ObjectType
from relgym.scene.shapes import Box
from relgym.scheduling.agenda import Budget

CONFIG = ClusteringConfig(noise_std=1e-6, min_examples=10)
BOXED = SlotSignature((BALL, ObjectType("box", ("friction",), Box())))


def filled(
    values: np.ndarray, labels: np.ndarray, kinds: np.ndarray, *, persists: bool = False
) -> tuple[ModeSearch, ExampleTable]:
    """A search among examples of two signatures; v is their number, and ``v' = v`` a mode if asked for."""
    table, population = ExampleTable(), Population(V, CONFIG)
    population.scale = Scale(1e-6, 4.0, 8.0)
    if persists:
        population.clusters[1] = Cluster(mode_of(("v", 1.0)))
    for k, (y, kind) in enumerate(zip(values.tolist(), kinds.tolist(), strict=True)):
        signature = (ALONE, BOXED)[kind]
        row = np.zeros(len(signature.columns))
        row[0] = k
        population.log.append(table.add(signature, row, b"", [-1] * len(signature.types)), y)
    population.labels[:] = labels
    return ModeSearch(population, seed=0), table


# ---------------------------------------------------------------------- in which examples
def test_what_is_searched_is_noise_of_one_kind_and_no_modes_tail() -> None:
    values = np.arange(8.0)
    values[[2, 4, 5]] += [7e-6, 9e-6, 1.0]  # 8e-6 is the tail's end
    labels = np.array([1, NOISE, NOISE, NOISE, NOISE, NOISE, 1, NOISE])
    kinds = np.array([0, 0, 0, 1, 0, 0, 0, 0])
    search, table = filled(values, labels, kinds)
    assert search._pool(table, 0).tolist() == [1, 2, 4, 5, 7]
    assert search._pool(table, 1).tolist() == [3]
    search, table = filled(values, labels, kinds, persists=True)
    assert search._pool(table, 0).tolist() == [4, 5]
    assert search._pool(table, 0, slice(5, 8)).tolist() == [5]
    assert search._pool(table, 1).tolist() == []


@settings(max_examples=40)
@given(
    st.integers(1, 4_000),
    st.sampled_from([0.005, 0.1, 0.3, 1.0]),
    st.sampled_from(["numbers", "flag"]),
    st.booleans(),
    st.integers(0, 2**32 - 1),
)
def test_the_newest_are_the_end_of_all(n: int, noisy: float, sort: str, persists: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = (
        rng.integers(2, size=n).astype(float) if sort == "flag" else np.arange(n) + rng.integers(2, size=n)
    )
    labels = np.where(rng.random(n) < noisy, NOISE, 1)
    search, table = filled(values, labels, rng.integers(2, size=n), persists=persists)
    for signature in range(len(table.signatures)):
        whole = search._pool(table, signature)
        newest = search._newest(table, signature)
        # Of a flag it counts how many took a value: all are needed.
        np.testing.assert_array_equal(newest, whole if sort == "flag" else whole[-SEARCHED_ROWS:])


# ---------------------------------------------------------------------- when
def test_how_long_is_waited_for_news() -> None:
    """The root of those in vain where searches are cheap, as many where laws are doubtful, their square if hopeless."""
    search, _ = filled(np.zeros(200), np.r_[np.zeros(101), np.ones(99)], np.zeros(200, dtype=int))
    waited = [search._patience(Search(failures=k), dear=False, doubtful=False) for k in (0, 5, 6, 17, 60)]
    assert waited == [0, 2, 2, 4, 7]
    assert search._patience(Search(failures=7), dear=False, doubtful=True) == 7
    assert search._patience(Search(failures=7), dear=True, doubtful=True) == 49  # 101 of 200 are unexplained
    search.population.labels[0] = 1
    assert search._patience(Search(failures=7), dear=True, doubtful=True) == 7
    search.population.approximate = True
    assert search._patience(Search(failures=7), dear=False, doubtful=False) == 49
    fewer, _ = filled(np.zeros(199), np.zeros(199), np.zeros(199, dtype=int))
    assert fewer._patience(Search(failures=7), dear=True, doubtful=True) == 7


def test_searches_in_vain_become_rare(rng: np.random.Generator) -> None:
    """Nine examples are too few. The next one is searched for, then every other one, after four in vain every third."""
    stream, told = Stream(config=CONFIG), []
    for x, y in zip(rng.normal(size=(31, 2)), rng.normal(size=31), strict=True):
        stream.feed([x], [y])
        told.append(tuple(stream.clusterer.search.to_json()["searches"][0][1:]))
    every_other = [each for k in range(1, 4) for each in ((1, k), (0, k + 1))]
    every_third = [each for k in range(4, 9) for each in ((1, k), (2, k), (0, k + 1))]
    assert told == [*[(0, 0)] * 9, (0, 1), *every_other, *every_third]


def test_a_search_that_finds_something_has_no_failures(rng: np.random.Generator) -> None:
    stream, x = Stream(config=CONFIG), rng.normal(size=(40, 2))
    stream.feed(x[:20], rng.normal(size=20))
    (before,) = stream.clusterer.search.to_json()["searches"]
    stream.feed(x[20:], 0.5 * x[20:, 0] - 0.2 * x[20:, 1])
    (after,) = stream.clusterer.search.to_json()["searches"]
    assert stream.formulas == ["v' = 0.5 v - 0.2 w"]
    assert before[2] > 4 and after[2] == 1  # none was left but the one that found nothing more


# ---------------------------------------------------------------------- in pieces
def hunting(rng: np.random.Generator, *, lawful: bool = True) -> Stream:
    """Twelve examples, a search for whose mode has begun with the last and got no further."""
    stream = Stream(config=CONFIG)
    stream.clusterer.search._searches.clear()
    x = rng.normal(size=(12, 2))
    y = -0.9 * x[:, 0] if lawful else rng.normal(size=12)
    rows = [stream.table.add(ALONE, row, b"", [-1]) for row in x]
    for row, value in zip(rows, y.tolist(), strict=True):
        last = stream.clusterer._append(stream.table, row, value, Budget())
    stream.clusterer.search.discover(stream.table, last, Budget(1))
    assert stream.clusterer.searching and not stream.clusterer.modes
    return stream


def pursued(stream: Stream, cells: int | None) -> int:
    """Go on with so many cells at a time; how often."""
    for steps in range(1, 10_000):
        stream.clusterer.search.pursue(stream.table, Budget(cells))
        if not stream.clusterer.searching:
            return steps
    raise AssertionError("the search never ends")


@pytest.mark.parametrize("lawful", [True, False])
def test_in_pieces_it_finds_what_it_finds_at_once(lawful: bool) -> None:
    found = []
    for cells in (None, 1):
        stream = hunting(np.random.default_rng(5), lawful=lawful)
        steps = pursued(stream, cells)
        assert (steps == 1) is (cells is None)
        told = stream.clusterer.to_json()
        assert stream.counts() == ({"v' = -0.9 v": 12} if lawful else {"noise": 12})
        found.append((told, stream.clusterer.labels.tolist()))
    assert found[0] == found[1]


def test_what_comes_while_a_search_is_under_way_is_news_to_the_next(rng: np.random.Generator) -> None:
    stream = hunting(rng, lawful=False)
    for _ in range(3):
        row = stream.table.add(ALONE, rng.normal(size=2), b"", [-1])
        example = stream.clusterer._append(stream.table, row, 17.0 + rng.random(), Budget())
        stream.clusterer.search.discover(stream.table, example, Budget())  # begins no other search
    assert stream.clusterer.search.to_json()["searches"] == [[0, 4, 0]]
    pursued(stream, 1)
    assert stream.clusterer.search.to_json()["searches"] == [[0, 3, 1]]


def test_what_is_explained_in_the_meantime_is_not_adopted(rng: np.random.Generator) -> None:
    stream = hunting(rng)
    population = stream.clusterer.population
    population.clusters[1], population.next_id = Cluster(mode_of(("v", -0.9))), 2
    population.labels[:] = 1
    pursued(stream, None)
    assert [mode.id for mode in stream.clusterer.modes] == [1]
    assert population.next_id == 2


def test_starting_over_ends_what_is_under_way(rng: np.random.Generator) -> None:
    stream = hunting(rng)
    stream.clusterer.search.start_over()
    assert not stream.clusterer.searching
    assert stream.clusterer.search.to_json()["searches"] == []


def test_one_example_begins_so_many_modes_at_most(rng: np.random.Generator) -> None:
    """Six laws wait; four are found with one piece of news, the others with the next."""
    stream, x = Stream(config=CONFIG), rng.normal(size=(120, 2))
    y = np.repeat(np.arange(-3.0, 3.0), 20) * x[:, 0] + x[:, 1]
    for row, value in zip(x, y.tolist(), strict=True):
        number = stream.table.add(ALONE, row, b"", [-1])
        last = stream.clusterer._append(stream.table, number, value, Budget())
    for many in (ALTERNATIVES, 6):
        stream.clusterer.search.discover(stream.table, last, Budget())
        assert len(stream.clusterer.modes) == many
        assert stream.clusterer.noise_examples == 20 * (6 - many)
