from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from logic_worlds import Rows, random_facts, tuples_of
from numpy.typing import NDArray

from relgym.errors import ConfigError
from relgym.logic.clause import Definition
from relgym.logic.csp import decide
from relgym.logic.facts import Facts, facts_from_tuples
from relgym.logic.foil import FoilConfig, learn, learn_both, recounted

TEXTBOOK = FoilConfig(mdl=False)
"""A handful of exact examples can't pay for clauses in bits; the textbook's FOIL doesn't ask them to."""


def _learn(worlds, objects, positives: Rows, negatives: Rows, **options):  # type: ignore[no-untyped-def]
    facts, numbers = facts_from_tuples(worlds, objects, options.pop("numeric", None))
    positives, negatives = list(positives), list(negatives)
    arity = len((positives or negatives)[0][1])
    return learn(facts, tuples_of(positives, numbers, arity), tuples_of(negatives, numbers, arity), **options)


# --- the thesis' and the textbooks' examples ----------------------------------------------------------------


def test_figure_3_4_can_reach() -> None:
    # G can't be told from A by fewer steps, the loop E-F not from the chain by having edges at all
    edges = [("A", "B"), ("B", "C"), ("C", "D"), ("E", "F"), ("F", "E"), ("A", "E"), ("G", "A")]
    definition = _learn(
        [{"connected": edges, "goal": [("D",)]}],
        ["ABCDEFG"],
        [(0, (node,)) for node in "BCD"],
        [(0, (node,)) for node in "AEFG"],
        config=TEXTBOOK,
    )
    assert [str(clause) for clause in definition.clauses] == [
        "goal(A)",
        "connected(A, B) ∧ goal(B)",
        "connected(A, B) ∧ connected(B, C) ∧ goal(C)",
    ]
    assert definition.errors == 0


def test_grandparent() -> None:
    parents = [("a", "b"), ("a", "c"), ("b", "d"), ("c", "e"), ("d", "f"), ("x", "b")]
    pairs = {(old, young) for old, middle in parents for other, young in parents if middle == other}
    others = [(old, young) for old in "abcdefx" for young in "abcdefx" if (old, young) not in pairs]
    definition = _learn(
        [{"parent": parents}],
        ["abcdefx"],
        [(0, pair) for pair in sorted(pairs)],
        [(0, pair) for pair in others],
    )
    assert str(definition) == "(parent(A, C) ∧ parent(C, B))"


def test_figure_3_5_a_flying_ball_touches_nothing() -> None:
    worlds = [{"left": [("A", "B")]}, {"intersect": [("A", "B"), ("B", "A")]}, {}]
    definition = _learn(worlds, ["AB"] * 3, [(0, ("A",)), (2, ("A",))], [(1, ("A",))], config=TEXTBOOK)
    assert str(definition) == "¬intersect(A, *)"


CARS = {
    # train: (length, roof or shape, load) of each car; Larson and Michalski (1977), trains 1-5 go east
    1: ["long open rectangle", "short closed triangle", "long open hexagon", "short open circle"],
    2: ["short open triangle", "short open rectangle", "short closed circle"],
    3: ["short open circle", "short closed triangle", "long closed triangle"],
    4: ["short open triangle", "short open triangle", "short closed rectangle", "short open rectangle"],
    5: ["short open triangle", "long closed rectangle", "short closed circle"],
    6: ["long closed circle", "short open triangle"],
    7: ["short open circle", "short open triangle", "long jagged empty"],
    8: ["long closed rectangle", "short open circle"],
    9: ["short open circle", "long jagged rectangle", "short open rectangle"],
    10: ["short open rectangle", "long open rectangle"],
}


def test_michalskis_trains() -> None:
    world: dict[str, list[tuple[str, ...]]] = {"has-car": [], "in-front": []}
    for train, cars in CARS.items():
        for place, car in enumerate(cars):
            world["has-car"].append((f"t{train}", f"c{train}{place}"))
            world["in-front"] += (
                [(f"c{train}{place}", f"c{train}{place + 1}")] if place + 1 < len(cars) else []
            )
            for word in car.split():
                world.setdefault(word, []).append((f"c{train}{place}",))
    objects = [f"t{train}" for train in CARS] + [car for _, car in world["has-car"]]
    definition = _learn(
        [world],
        [objects],
        [(0, (f"t{train}",)) for train in range(1, 6)],
        [(0, (f"t{train}",)) for train in range(6, 11)],
        config=TEXTBOOK,
    )
    assert str(definition) == "(has-car(A, B) ∧ short(B) ∧ closed(B))"


def _contacts() -> tuple[Facts, NDArray[np.int64], NDArray[np.bool_]]:
    """Tables 4.3 and 4.4: a ball on or beside boxes and ramps; mode 3 is being over a ramp."""
    worlds, on_ramp = [], []
    sides = ("x-aligned", "x-greater", "x-less")
    for first in sides:
        for second in sides:
            for kind in ("ramp", "box"):
                for other in ("ramp", "floor"):
                    world = {kind: [("b",)], first: [("ball", "b")]}
                    world[other] = [*world.get(other, []), ("c",)]
                    world[second] = [*world.get(second, []), ("ball", "c")]
                    worlds.append(world)
                    on_ramp.append(
                        (first, kind) == ("x-aligned", "ramp") or (second, other) == ("x-aligned", "ramp")
                    )
    facts, _ = facts_from_tuples(worlds, [["ball", "b", "c"]] * len(worlds))
    tuples = np.array([[world, 0] for world in range(len(worlds))])
    return facts, tuples, np.array(on_ramp)


def test_tables_4_3_and_4_4_the_side_that_takes_one_clause_is_described() -> None:
    facts, tuples, ramp = _contacts()
    given = learn(facts, tuples[~ramp], tuples[ramp], config=TEXTBOOK)
    both = learn_both(facts, tuples[~ramp], tuples[ramp], config=TEXTBOOK)
    assert len(given.clauses) > 1
    assert both.negated
    assert str(both) == "¬[(x-aligned(A, B) ∧ ramp(B))]"
    assert both.errors == 0
    assert decide(both, facts, tuples).tolist() == (~ramp).tolist()
    assert [count.positives for count in both.coverage] == [ramp.sum()]
    assert both.uncovered.negatives == (~ramp).sum()


def test_equal_polarities_keep_the_given_one() -> None:
    facts = Facts({"red": np.eye(2, dtype=np.bool_)[:, :1]}, np.ones((2, 1), dtype=np.bool_))
    definition = learn_both(facts, np.array([[0, 0]]), np.array([[1, 0]]), config=TEXTBOOK)
    assert (str(definition), definition.negated) == ("red(A)", False)


# --- numbers and noise --------------------------------------------------------------------------------------


def _bounces(rng: np.random.Generator, worlds: int) -> tuple[Facts, NDArray[np.int64], NDArray[np.bool_]]:
    """A ball among four objects: it bounces if it comes close to a ramp fast enough."""
    exists = np.ones((worlds, 5), dtype=np.bool_)
    touching = np.zeros((worlds, 5, 5), dtype=np.bool_)
    touching[:, 0, 1:] = rng.random((worlds, 4)) < 0.5
    touching |= touching.transpose(0, 2, 1)
    kind = rng.integers(0, 3, (worlds, 5))
    relations = {name: kind == number for number, name in enumerate(("box", "floor", "ramp"))}
    relations |= {"touching": touching, "above": rng.random((worlds, 5, 5)) < 0.3}
    approach = rng.normal(size=(worlds, 5))
    numeric = {"approach": approach, "spin": rng.normal(size=(worlds, 5)), "vy": rng.normal(size=worlds)}
    facts = Facts(relations, exists, numeric, frozenset({"approach", "spin", "vy"}))
    bounces = (touching[:, 0] & relations["ramp"] & (approach <= -0.5)).any(axis=1)
    tuples = np.stack([np.arange(worlds), np.zeros(worlds, dtype=np.int64)], axis=1)
    return facts, tuples, bounces


def test_a_threshold_and_a_type_bind_the_same_object() -> None:
    facts, tuples, bounces = _bounces(np.random.default_rng(1), 600)
    definition = learn(facts, tuples[bounces], tuples[~bounces])
    [clause] = definition.clauses
    names = {literal.relation: literal for literal in clause}
    assert sorted(names) == ["approach", "ramp", "touching"]
    assert {literal.args[-1] for literal in clause} == {1}
    assert names["approach"].threshold == pytest.approx(-0.5, abs=0.05)
    assert definition.errors == 0


@pytest.mark.parametrize("seed", range(3))
def test_two_per_cent_of_flipped_labels_leave_the_clause_clean(seed: int) -> None:
    rng = np.random.default_rng(seed)
    facts, tuples, bounces = _bounces(rng, 1000)
    observed = bounces ^ (rng.random(1000) < 0.02)
    definition = learn(facts, tuples[observed], tuples[~observed])
    [clause] = definition.clauses
    assert sorted(literal.relation for literal in clause) == ["approach", "ramp", "touching"]
    assert (decide(definition, facts, tuples) != bounces).mean() <= 0.002
    assert definition.performance == pytest.approx(1 - (observed != bounces).mean(), abs=0.002)


def test_the_threshold_lies_in_the_middle_of_the_gap() -> None:
    speeds = np.array([-3.0, -2.0, 1.0, 2.0, 5.0])
    facts = Facts({}, np.ones((5, 1), dtype=np.bool_), {"vy": speeds}, frozenset({"vy"}))
    tuples = np.stack([np.arange(5), np.zeros(5, dtype=np.int64)], axis=1)
    definition = learn(facts, tuples[:2], tuples[2:], config=TEXTBOOK)
    [[literal]] = definition.clauses
    assert (literal.relation, literal.op) == ("vy", "<=")
    assert -1.25 <= literal.threshold <= 0.25


def test_relations_are_preferred_to_numbers_that_say_the_same() -> None:
    red = np.arange(40) % 2 == 0
    facts = Facts({"red": red[:, None]}, np.ones((40, 1), dtype=np.bool_), {"hue": red.astype(np.float64)})
    tuples = np.stack([np.arange(40), np.zeros(40, dtype=np.int64)], axis=1)
    for config in (TEXTBOOK, FoilConfig()):
        assert str(learn(facts, tuples[red], tuples[~red], config=config)) == "red(A)"


def test_numbers_that_tell_most_tuples_apart_hide_no_relations_that_tell_all() -> None:
    # a truck, then three or four boxes in a row: two of four aren't touched by what stands in front and not next
    rng, n = np.random.default_rng(3), 200
    four = np.arange(n) % 3 > 0
    exists = np.ones((n, 5), dtype=np.bool_)
    exists[~four, 4] = False
    place = np.arange(5)
    there = exists[:, :, None] & exists[:, None, :]
    relations = {
        "box": exists & (place > 0),
        "behind": there & (place[:, None] > place) & (place > 0),
        "touches": there & (np.abs(place[:, None] - place) == 1),
        "parallel": there & (place[:, None] != place),
    }
    speed = np.where(four, rng.uniform(0.0, 1.1, n), rng.uniform(0.9, 2.0, n))
    facts = Facts(
        relations, exists, {"speed": speed, "size": rng.random((n, 5))}, relative=frozenset({"speed"})
    )
    tuples = np.stack([np.arange(n), np.zeros(n, dtype=np.int64)], axis=1)
    weights = {"pos_weights": np.full(four.sum(), 5.0), "neg_weights": np.full((~four).sum(), 5.0)}
    definition = learn_both(facts, tuples[four], tuples[~four], **weights)
    assert definition.errors == 0
    assert all(literal.op is None for clause in definition.clauses for literal in clause)


def test_numbers_of_one_tuple_are_evidence_once_however_much_it_weighs() -> None:
    rng = np.random.default_rng(7)
    red = np.arange(200) < 100
    hue = np.where(red, rng.normal(1.0, 1.0, 200), rng.normal(-1.0, 1.0, 200))
    truth = red.copy()
    truth[np.argsort(hue)[-1:]] = True
    truth[np.argmax(np.where(red, -np.inf, hue))] = True
    facts = Facts({"red": red[:, None]}, np.ones((200, 1), dtype=np.bool_), {"hue": hue})
    tuples = np.stack([np.arange(200), np.zeros(200, dtype=np.int64)], axis=1)
    heavy = {"pos_weights": np.full(truth.sum(), 20.0), "neg_weights": np.full((~truth).sum(), 20.0)}
    assert str(learn(facts, tuples[truth], tuples[~truth], **heavy)) == "red(A)"


def test_without_numeric_literals_only_relations_are_used() -> None:
    facts, tuples, bounces = _bounces(np.random.default_rng(2), 200)
    definition = learn(facts, tuples[bounces], tuples[~bounces], config=FoilConfig(numeric=False))
    assert all(literal.op is None for clause in definition.clauses for literal in clause)


def test_a_single_relation_may_speak_of_any_object() -> None:
    ramp = np.zeros((30, 3), dtype=np.bool_)
    ramp[:15, 1] = True
    facts = Facts({"ramp": ramp}, np.ones((30, 3), dtype=np.bool_))
    tuples = np.stack([np.arange(30), np.zeros(30, dtype=np.int64)], axis=1)
    assert str(learn(facts, tuples[:15], tuples[15:])) == "ramp(B)"
    assert str(learn(facts, tuples[15:], tuples[:15])) == "¬ramp(*)"


def test_all_objects_on_one_side_of_a_threshold() -> None:
    rng = np.random.default_rng(5)
    approach = rng.uniform(0.0, 1.0, (200, 4))
    quiet = np.arange(200) < 100
    approach[~quiet, rng.integers(0, 4, 100)] = 2.0
    facts = Facts({}, np.ones((200, 4), dtype=np.bool_), {"approach": approach}, frozenset({"approach"}))
    tuples = np.stack([np.arange(200), np.zeros(200, dtype=np.int64)], axis=1)
    [[literal]] = learn(facts, tuples[quiet], tuples[~quiet]).clauses
    assert str(literal).startswith("¬(approach(A, *) > 1.")


# --- choices and limits -------------------------------------------------------------------------------------


def test_algorithm_2_as_printed_filters_negatives() -> None:
    facts, tuples, ramp = _contacts()
    config = FoilConfig(choice="negatives", mdl=False, beam=1)
    definition = learn(facts, tuples[ramp], tuples[~ramp], config=config)
    assert definition.errors == 0
    assert definition.errors == (decide(definition, facts, tuples) != ramp).sum()


def test_limits_are_kept() -> None:
    facts, tuples, bounces = _bounces(np.random.default_rng(3), 200)
    config = FoilConfig(max_literals=2, max_clauses=1, max_new_variables=1, mdl=False)
    [clause] = learn(facts, tuples[bounces], tuples[~bounces], config=config).clauses
    assert len(clause) <= 2
    assert clause.variables <= 2


def test_a_single_class_needs_no_literals() -> None:
    facts, tuples, _ = _bounces(np.random.default_rng(4), 10)
    assert str(learn(facts, tuples, tuples[:0])) == "true"
    assert str(learn(facts, tuples[:0], tuples)) == "false"
    assert learn_both(facts, tuples, tuples[:0]).errors == 0


def test_weights_stand_for_repeated_tuples() -> None:
    rng = np.random.default_rng(6)
    facts, tuples, bounces = _bounces(rng, 150)
    counts = rng.integers(1, 4, 150)
    twice = np.repeat(np.arange(150), counts)
    grouped = learn(
        facts,
        tuples[bounces],
        tuples[~bounces],
        pos_weights=counts[bounces],
        neg_weights=counts[~bounces],
        config=TEXTBOOK,
    )
    repeated = learn(facts, tuples[twice][bounces[twice]], tuples[twice][~bounces[twice]], config=TEXTBOOK)
    assert grouped.clauses == repeated.clauses
    assert grouped.coverage == repeated.coverage
    assert grouped.work < repeated.work


@pytest.mark.parametrize(
    ("positives", "negatives", "options", "message"),
    [
        ([[0, 0]], [[0, 0, 0]], {}, "one width"),
        ([[99, 0]], [[0, 0]], {}, "positives: expected a world"),
        ([[0, 0]], [[0, 7]], {}, "negatives: expected a world"),
        ([[0.0, 0.0]], [[0, 0]], {}, "positives: expected integers"),
        ([[0, 0]], [[1, 0]], {"pos_weights": [0.0]}, "positive, finite weights"),
        ([[0, 0]], [[1, 0]], {"neg_weights": [1.0, 1.0]}, "one per tuple"),
    ],
)
def test_malformed_problems_are_refused(
    positives: list[list[float]], negatives: list[list[float]], options: dict[str, list[float]], message: str
) -> None:
    facts, _, _ = _bounces(np.random.default_rng(0), 5)
    with pytest.raises(ConfigError, match=message):
        learn(facts, np.array(positives), np.array(negatives), **options)  # type: ignore[arg-type]


def test_tuples_are_of_objects_that_exist() -> None:
    exists = np.array([[True, True, False], [True, True, True]])
    facts = Facts({"red": exists.copy()}, exists)
    assert learn(facts, np.array([[0, 1]]), np.array([[1, 2]])) is not None
    with pytest.raises(ConfigError, match=r"negatives: expected objects that exist, got \[0, 2\]"):
        learn(facts, np.array([[0, 1]]), np.array([[1, 2], [0, 2]]))


# --- properties ---------------------------------------------------------------------------------------------


def _random_problem(seed: int) -> tuple[Facts, NDArray[np.int64], NDArray[np.bool_]]:
    rng = np.random.default_rng(seed)
    facts = random_facts(rng, worlds=40)
    tuples = np.array([[world, 0] for world in range(facts.worlds)])
    truth = facts.relation("near")[:, 0].any(axis=1) & facts.relation("calm")
    return facts, tuples, truth ^ (rng.random(len(tuples)) < 0.1)


def _solve(facts: Facts, tuples: NDArray[np.int64], truth: NDArray[np.bool_], **options: bool) -> Definition:
    return learn_both(facts, tuples[truth], tuples[~truth], config=FoilConfig(**options))


@settings(max_examples=15)
@given(seed=st.integers(0, 10_000), mdl=st.booleans())
def test_a_definition_never_errs_more_than_the_larger_class(seed: int, mdl: bool) -> None:
    facts, tuples, truth = _random_problem(seed)
    definition = _solve(facts, tuples, truth, mdl=mdl)
    wrong = (decide(definition, facts, tuples) != truth).sum()
    assert wrong == definition.errors
    assert wrong <= min(truth.sum(), (~truth).sum())


@settings(max_examples=15)
@given(seed=st.integers(0, 10_000))
def test_a_definition_counted_again_is_what_it_was(seed: int) -> None:
    facts, tuples, truth = _random_problem(seed)
    found = _solve(facts, tuples, truth)
    again = recounted(found, facts, tuples[truth], tuples[~truth])
    for part in ("clauses", "negated", "coverage", "uncovered", "bits", "rank"):
        assert getattr(again, part) == getattr(found, part)


@settings(max_examples=15)
@given(seed=st.integers(0, 10_000), mdl=st.booleans())
def test_renaming_and_reordering_objects_changes_nothing(seed: int, mdl: bool) -> None:
    facts, tuples, truth = _random_problem(seed)
    rng = np.random.default_rng(seed)
    orders = np.array([rng.permutation(facts.objects) for _ in range(facts.worlds)])
    moved = Facts(
        {name: _permuted(array, orders) for name, array in facts.relations.items()},
        _permuted(facts.exists, orders),
        {name: _permuted(array, orders) for name, array in facts.numeric.items()},
        facts.relative,
    )
    targets = np.array([[world, int(np.flatnonzero(orders[world] == 0)[0])] for world in range(facts.worlds)])
    assert _solve(moved, targets, truth, mdl=mdl) == _solve(facts, tuples, truth, mdl=mdl)


def _permuted(array: NDArray[Any], orders: NDArray[np.int64]) -> NDArray[Any]:
    index = [np.arange(len(orders)).reshape(-1, *[1] * (array.ndim - 1))]
    for axis in range(1, array.ndim):
        shape = [len(orders)] + [1] * (array.ndim - 1)
        shape[axis] = orders.shape[1]
        index.append(orders.reshape(shape))
    return array[tuple(index)]


@settings(max_examples=10)
@given(seed=st.integers(0, 10_000))
def test_learning_again_gives_the_same_definition_for_the_same_work(seed: int) -> None:
    facts, tuples, truth = _random_problem(seed)
    first, second = _solve(facts, tuples, truth), _solve(facts, tuples, truth)
    assert first == second
    assert first.work == second.work > 0
