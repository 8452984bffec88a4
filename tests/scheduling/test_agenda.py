from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from relgym.scheduling.agenda import Agenda, Budget
from relgym.scheduling.work import Steps, Task, resumable


@resumable
def counted(pieces: int, cells: int) -> Steps[int]:
    for _ in range(pieces):
        yield cells
    return pieces


def test_without_a_limit_all_is_done() -> None:
    budget, task = Budget(), Task(counted, 1_000, 10**9)
    assert budget.work(task)
    assert budget.spent == 10**12
    assert budget.part(0.1) is budget


def test_what_is_spent_of_a_part_is_spent_of_the_whole() -> None:
    budget = Budget(100)
    part = budget.part(0.6)
    assert part.left == 60
    assert not part.work(Task(counted, 10, 25))
    assert (part.left, budget.left) == (0, 25)
    assert not part.work(other := Task(counted, 10, 25))
    assert other.pieces == 0


def test_a_debt_is_paid_before_anything_else_is_done() -> None:
    agenda = Agenda(earned=10, most=50, saved=0)
    budget = agenda.open()
    assert budget.left == 10  # what is earned may be spent at once
    agenda = Agenda(earned=10, most=50, saved=20)
    budget = agenda.open()
    budget.spend(45)
    agenda.close(budget, [])
    lefts = []
    for _ in range(4):
        budget = agenda.open()
        lefts.append(budget.left)
        agenda.close(budget, [])
    assert lefts == [0, 0, 5, 15]


def test_what_waits_longest_comes_first() -> None:
    agenda = Agenda(earned=1, most=1, saved=1)
    for waiting in (["b"], ["a", "b"], ["a", "b", "c"], ["a", "c"]):
        agenda.close(agenda.open(), waiting)
    assert agenda.waiting == ("a", "c")
    agenda.close(agenda.open(), ["b", "c"])
    assert agenda.waiting == ("c", "b")


def test_who_had_least_comes_first() -> None:
    agenda = Agenda(earned=1, most=1, saved=1)
    agenda.close(agenda.open(), ["long", "longer"])
    agenda.spent_on("longer", 9)
    agenda.spent_on("long", 5)
    agenda.close(agenda.open(), ["long", "longer", "new"])
    assert agenda.waiting == ("new", "long", "longer")
    agenda.close(agenda.open(), ["long", "new"])
    agenda.close(
        agenda.open(), ["long", "longer", "new"]
    )  # begun again: what an earlier search took doesn't count
    assert agenda.waiting == ("new", "longer", "long")


@given(
    st.lists(st.integers(0, 80), max_size=40),
    st.integers(1, 20),
    st.integers(1, 50),
    st.integers(0, 100),
)
def test_in_the_mean_no_more_is_spent_than_is_earned(
    wanted: list[int], earned: int, most: int, saved: int
) -> None:
    agenda, spent = Agenda(earned=earned, most=most, saved=saved), 0
    for cells in wanted:
        budget = agenda.open()
        assert budget.left <= most
        used = min(cells, budget.left)
        budget.spend(used)
        spent += used
        agenda.close(budget, [])
    assert spent <= saved + earned * len(wanted)
