from __future__ import annotations

import numpy as np

from relgym.laws.store import Store


def filled(count: int, rare: int = 0) -> Store:
    store = Store(2, 100, seed=0)
    for k in range(rare):
        store.add(np.array([-1.0, k]), cell=1)
    for k in range(count):
        store.add(np.array([0.0, k]), cell=0)
    return store


def test_it_is_bounded_and_counts_all() -> None:
    store = filled(1000)
    assert (len(store.rows), store.seen) == (100, 1000)


def test_what_was_news_stays() -> None:
    store = filled(5000, rare=40)
    assert sorted(store.rows[store.rows[:, 0] < 0.0][:, 1].tolist()) == list(range(40))


def test_the_crowded_cell_is_a_sample_of_all_times() -> None:
    kept = filled(4000).rows[:, 1]
    assert kept.min() < 1000 < 3000 < kept.max()


def test_the_same_stream_keeps_the_same_rows() -> None:
    assert filled(700, rare=5).rows.tobytes() == filled(700, rare=5).rows.tobytes()


def test_saved_and_restored_it_goes_on_alike() -> None:
    one, two = filled(300), Store(2, 100, seed=9)
    two.restore(one.to_json(), one.to_arrays())
    for k in range(200):
        one.add(np.array([2.0, k]), cell=2)
        two.add(np.array([2.0, k]), cell=2)
    assert one.rows.tobytes() == two.rows.tobytes()


def test_it_knows_when_each_row_came() -> None:
    store = filled(1000)
    assert store.arrived.tolist() == (store.rows[:, 1] + 1).tolist()


def test_what_is_dropped_makes_room() -> None:
    store = filled(40, rare=20)
    came = store.arrived.copy()
    store.drop(np.flatnonzero(store.cells == 1))
    assert store.rows[:, 1].tolist() == list(range(40)) and store.arrived.tolist() == came[20:].tolist()
    for k in range(60):
        store.add(np.array([3.0, k]), cell=3)
    assert (len(store.rows), store.seen) == (100, 120)


def test_earlier_files_do_not_say_when_rows_came() -> None:
    one, two = filled(30), Store(2, 100, seed=9)
    arrays = {name: array for name, array in one.to_arrays().items() if name != "arrived"}
    two.restore(one.to_json(), arrays)
    assert two.arrived.tolist() == one.arrived.tolist()
