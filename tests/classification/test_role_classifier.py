"""Role descriptions: Figure 3.8's boxes, joint assignment, interchangeable roles, learning one at a time."""

from __future__ import annotations

import json
import pickle
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from toy_situations import TRUCK_KINDS, TRUCK_VOCABULARY, Labelled, truck_stream

from relgym.classification.examples import Example, Vocabulary
from relgym.classification.exemplars import Exemplars
from relgym.classification.role_classifier import RoleClassifier, RoleKind
from relgym.config import ClassificationConfig

_CONFIG = ClassificationConfig()
_TOUCH = Vocabulary(relations=("intersect",), unary=("ball", "red"))


def _kinds(mode: int) -> list[RoleKind]:
    return [RoleKind("box", (("friction", float(weight)),)) for weight in TRUCK_KINDS[mode]]


def _learned(items: Sequence[Labelled]) -> tuple[dict[int, RoleClassifier], Exemplars, int]:
    """Learn online; the classifiers, the memory, and how often a prediction was wrong."""
    classifiers = {mode: RoleClassifier(TRUCK_VOCABULARY, _kinds(mode), _CONFIG) for mode in TRUCK_KINDS}
    exemplars = Exemplars(TRUCK_VOCABULARY, _CONFIG)
    exemplars.set_modes((1, 2, 3), np.empty(0, int), np.empty((0, 3), bool), np.empty((0, 3)))
    wrong = 0
    for item in items:
        wrong += classifiers[item.mode].observe(item.example, item.roles)
        exemplars.add(item.example, item.mode, item.fits, item.values, roles=item.roles)
        classifiers[item.mode].refresh(exemplars, item.mode)
    return classifiers, exemplars, wrong


def _players(classifier: RoleClassifier, found: tuple[int, ...] | None) -> list[set[int]] | None:
    return None if found is None else [{found[at] for at in d.places} for d in classifier.descriptions]


@pytest.fixture(scope="module")
def trucks() -> tuple[dict[int, RoleClassifier], Exemplars, int]:
    return _learned(list(truck_stream(48, rng=np.random.default_rng(0))))


def test_figure_3_8(trucks: tuple[dict[int, RoleClassifier], Exemplars, int]) -> None:
    classifiers, _, wrong = trucks
    assert classifiers[2].describe() == ["box: on-top(C, B)", "box: (y-aligned(A, B) ∧ ¬on-top(*, B))"]
    assert classifiers[3].describe() == ["box: any box"]
    # The lowest box is the one that is vertically aligned with the truck, or equally well the one that
    # touches it.
    assert classifiers[1].describe() in (["box: y-aligned(A, B)"], ["box: intersect(A, B)"])
    assert wrong <= 12


def test_fresh_permutations_get_the_right_boxes(
    trucks: tuple[dict[int, RoleClassifier], Exemplars, int],
) -> None:
    for item in truck_stream(60, rng=np.random.default_rng(9)):
        classifier = trucks[0][item.mode]
        assert _players(classifier, classifier.assign(item.example)) == _players(classifier, item.roles)


def test_bystanders_teach_what_any_box_left_open() -> None:
    classifiers, _, _ = _learned(list(truck_stream(48, rng=np.random.default_rng(0), bystanders=2)))
    assert classifiers[3].describe() == ["box: intersect(B, C)"]
    for item in truck_stream(20, rng=np.random.default_rng(9), bystanders=4):
        classifier = classifiers[item.mode]
        assert _players(classifier, classifier.assign(item.example)) == _players(classifier, item.roles)


def test_interchangeable_roles_share_one_description() -> None:
    classifier = RoleClassifier(TRUCK_VOCABULARY, _kinds(3), _CONFIG)
    assert [d.places for d in classifier.descriptions] == [(0, 1, 2)]


def test_too_few_objects_give_no_assignment(trucks: tuple[dict[int, RoleClassifier], Exemplars, int]) -> None:
    item = next(truck_stream(1, rng=np.random.default_rng(0)))
    e = item.example
    two = Example(e.table[:, :3, :3], e.unary[:, :3], e.close[:3], e.pair[:3], e.own)
    assert trucks[0][3].assign(two) is None


def test_an_object_that_only_one_role_could_take_is_left_to_it() -> None:
    # "red" objects play role 0, objects that touch the target play role 1. The only red one touches the
    # target too, and comes first: a greedy assignment in the order of roles 1, 0 would take it away from role
    # 0.
    kinds = [RoleKind("ball", (("v", 1.0),)), RoleKind("ball", (("v", 2.0),))]
    classifier = RoleClassifier(_TOUCH, kinds, _CONFIG)
    exemplars = Exemplars(_TOUCH, _CONFIG)
    exemplars.set_modes((1,), np.empty(0, int), np.empty((0, 1), bool), np.empty((0, 1)))
    for touching, red in ((1, 2), (2, 1), (3, 1), (1, 3), (2, 3), (3, 2)):
        example = _balls({touching}, {red})
        exemplars.add(example, 1, np.ones(1, bool), np.zeros(1), roles=(red, touching))
    classifier.refresh(exemplars, 1)
    assert classifier.describe() == ["ball: red(B)", "ball: intersect(A, B)"]
    assert classifier.assign(_balls({1, 3}, {1})) == (1, 3)
    assert classifier.assign(_balls({1}, {1})) is None


def _balls(touching: set[int], red: set[int]) -> Example:
    table = np.zeros((1, 4, 4), dtype=np.bool_)
    for other in touching:
        table[0, 0, other] = table[0, other, 0] = True
    unary = np.array([[True] * 4, [at in red for at in range(4)]])
    key = table.tobytes() + unary.tobytes()
    return Example(table, unary, table[0, 0] | (np.arange(4) == 0), np.empty((4, 0)), np.empty(0), key=key)


def test_preference_decides_where_nothing_else_does() -> None:
    classifier, _ = _touched([(1,)] * 4)
    two = _balls({1, 3}, set())
    assert classifier.describe() == ["ball: intersect(A, B)"]
    assert classifier.assign(two) == (1,)
    assert classifier.assign(two, order=(3, 2, 1, 0)) == (3,)


def test_a_choice_that_experience_never_left_is_no_sure_answer() -> None:
    classifier, exemplars = _touched([(1,)] * 4)
    two = _balls({1, 3}, set())
    assert classifier.assign(two, sure=True) is None
    assert classifier.assign(_balls({3}, set()), sure=True) == (3,)
    for _ in range(3):  # either ball may play, as these examples show: then preference is all there is
        classifier.observe(two, (1,))
        exemplars.add(two, 1, np.ones(1, bool), np.zeros(1), roles=(1,))
    classifier.refresh(exemplars, 1)
    assert classifier.errors > 0
    assert classifier.assign(two, sure=True) == (1,)


def _touched(touching: Sequence[tuple[int, ...]]) -> tuple[RoleClassifier, Exemplars]:
    """A role that was played by the first ball that touched the target."""
    classifier = RoleClassifier(_TOUCH, [RoleKind("ball", (("v", 1.0),))], _CONFIG)
    exemplars = Exemplars(_TOUCH, _CONFIG)
    exemplars.set_modes((1,), np.empty(0, int), np.empty((0, 1), bool), np.empty((0, 1)))
    for balls in touching:
        example = _balls(set(balls), set())
        classifier.observe(example, balls[:1])
        exemplars.add(example, 1, np.ones(1, bool), np.zeros(1), roles=balls[:1])
    classifier.refresh(exemplars, 1)
    return classifier, exemplars


def test_descriptions_learned_in_pieces_are_those_learned_at_once() -> None:
    items = list(truck_stream(48, rng=np.random.default_rng(0), bystanders=2))
    whole, exemplars, _ = _learned(items)
    for mode in TRUCK_KINDS:
        known = RoleClassifier(TRUCK_VOCABULARY, _kinds(mode), _CONFIG)
        calls = 0
        while known.stale:
            spent = known.refresh(exemplars, mode, budget=1.0)
            calls += spent > 0
            if calls == 2:
                known = pickle.loads(pickle.dumps(known))  # begun, and gone on with elsewhere
        again = RoleClassifier(TRUCK_VOCABULARY, _kinds(mode), _CONFIG)
        again.refresh(exemplars, mode)
        assert known.to_dict() == again.to_dict()
        assert calls > 1 or not any(d.definition for d in known.descriptions)
    assert set(whole) == set(TRUCK_KINDS)


def test_what_comes_while_descriptions_are_learned_counts_against_them() -> None:
    classifier, exemplars = _touched([(1,)] * 4)
    assert classifier.errors == 0.0
    classifier.stale = True
    assert classifier.refresh(exemplars, 1, budget=0.0) > 0  # begun
    assert classifier.stale
    odd = _balls({2}, set())  # the one that doesn't touch
    classifier.observe(odd, (1,))
    exemplars.add(odd, 1, np.ones(1, bool), np.zeros(1), roles=(1,))
    classifier.refresh(exemplars, 1)
    assert not classifier.stale
    assert classifier.describe() == ["ball: intersect(A, B)"]
    assert classifier.errors == 2.0  # it misses one and takes another one


def test_who_has_all_that_players_had_in_common_comes_first(
    trucks: tuple[dict[int, RoleClassifier], Exemplars, int],
) -> None:
    # There never was another ball to tell the player from, so any ball will do; but the player always touched.
    classifier = RoleClassifier(_TOUCH, [RoleKind("ball", (("v", 1.0),))], _CONFIG)
    only = _balls({1}, set())
    only = replace(only, table=only.table[:, :2, :2], unary=only.unary[:, :2], close=only.close[:2])
    classifier.observe(only, (1,))
    assert classifier.describe() == ["ball: any ball"]
    assert classifier.assign(_balls({3}, set()), sure=True) == (3,)
    assert classifier.assign(_balls({2, 3}, set()), sure=True) is None
    # Nobody is as every player was: a new situation.
    assert classifier.assign(_balls(set(), set())) == (1,)
    assert classifier.assign(_balls(set(), set()), sure=True) is None
    # Boxes of the lowest rank, and others farther along the row that touch nothing: all as players were.
    item = next(i for i in truck_stream(4, rng=np.random.default_rng(1), bystanders=3) if i.mode == 3)
    assert trucks[0][3].assign(item.example) is not None
    assert trucks[0][3].assign(item.example, sure=True) is None


def test_examples_that_turn_out_to_be_the_modes_own_tell_what_players_have_in_common() -> None:
    classifier = RoleClassifier(_TOUCH, [RoleKind("ball", (("v", 1.0),))], _CONFIG)
    exemplars = Exemplars(_TOUCH, _CONFIG)
    exemplars.set_modes((1, 2), np.empty(0, int), np.empty((0, 2), bool), np.empty((0, 2)))
    apart, red = _alone(_balls(set(), set())), _alone(_balls({1}, {1}))
    exemplars.add(apart, 2, np.ones(2, bool), np.zeros(2), roles=(1,))
    exemplars.add(red, 1, np.ones(2, bool), np.zeros(2), roles=(1,))
    classifier.observe(red, (1,))
    classifier.refresh(exemplars, 1)
    assert classifier.assign(apart, sure=True) is None  # the only player was red, and touched
    classifier.recall(exemplars, 1)
    assert classifier.assign(apart, sure=True) is None
    exemplars.assigned[:] = 1  # the other mode was the same one
    classifier.recall(exemplars, 1)
    assert classifier.assign(apart, sure=True) == (1,)


def _alone(example: Example) -> Example:
    """With the target and one other object."""
    table, unary = example.table[:, :2, :2], example.unary[:, :2]
    key = table.tobytes() + unary.tobytes()
    return replace(example, table=table, unary=unary, close=example.close[:2], pair=example.pair[:2], key=key)


def test_the_order_of_objects_is_irrelevant(
    trucks: tuple[dict[int, RoleClassifier], Exemplars, int],
) -> None:
    order = np.array([2, 0, 3, 1])
    for item in truck_stream(8, rng=np.random.default_rng(3)):
        if item.mode == 3:  # any box will do
            continue
        e = item.example
        table, unary = e.table[:, order][:, :, order], e.unary[:, order]
        moved = replace(e, table=table, unary=unary, target=int(np.flatnonzero(order == 0)[0]))
        found = trucks[0][item.mode].assign(moved)
        assert found is not None
        assert tuple(int(order[at]) for at in found) == trucks[0][item.mode].assign(e)


def test_agreeing_examples_cost_no_work(trucks: tuple[dict[int, RoleClassifier], Exemplars, int]) -> None:
    classifiers, exemplars, _ = trucks
    for item in truck_stream(8, rng=np.random.default_rng(12)):
        assert not classifiers[item.mode].observe(item.example, item.roles)
        assert classifiers[item.mode].refresh(exemplars, item.mode) == 0


def test_a_contradiction_is_learned() -> None:
    items = list(truck_stream(8, rng=np.random.default_rng(0)))
    first = [item for item in items if item.mode == 2][:1]
    classifiers, exemplars, _ = _learned(first)
    other = next(i for i in items if i.mode == 2 and i.example.key != first[0].example.key)
    classifier = classifiers[2]
    # A description learned from a single example is short; sooner or later an example contradicts it.
    wrong = sum(_observed(classifier, exemplars, item) for item in [other, *items] if item.mode == 2)
    assert wrong >= 1
    assert classifier.contradictions == 0
    assert _players(classifier, classifier.assign(other.example)) == _players(classifier, other.roles)


def _observed(classifier: RoleClassifier, exemplars: Exemplars, item: Labelled) -> bool:
    wrong = classifier.observe(item.example, item.roles)
    exemplars.add(item.example, item.mode, item.fits, item.values, roles=item.roles)
    classifier.refresh(exemplars, item.mode)
    return wrong


def test_the_right_objects_coming_first_by_luck_is_a_contradiction_all_the_same() -> None:
    classifier = RoleClassifier(_TOUCH, [RoleKind("ball", (("v", 1.0),))], _CONFIG)
    exemplars = Exemplars(_TOUCH, _CONFIG)
    exemplars.set_modes((1,), np.empty(0, int), np.empty((0, 1), bool), np.empty((0, 1)))
    for player in (1, 2, 3) * 3:
        exemplars.add(_balls({player}, {player}), 1, np.ones(1, bool), np.zeros(1), roles=(player,))
    classifier.refresh(exemplars, 1)
    by_touch = classifier.describe() == ["ball: intersect(A, B)"]
    assert by_touch or classifier.describe() == ["ball: red(B)"]  # either would do so far
    example = _balls({1, 3}, {1}) if by_touch else _balls({1}, {1, 3})
    assert classifier.assign(example) == (1,)  # the description holds for ball 3 too, but ball 1 comes first
    for _ in range(3):
        assert classifier.observe(example, (1,))
        exemplars.add(example, 1, np.ones(1, bool), np.zeros(1), roles=(1,))
    assert classifier.refresh(exemplars, 1) > 0
    assert classifier.describe() == (["ball: red(B)"] if by_touch else ["ball: intersect(A, B)"])


def test_no_roles_need_no_objects() -> None:
    classifier = RoleClassifier(TRUCK_VOCABULARY, [], _CONFIG)
    item = next(truck_stream(1, rng=np.random.default_rng(0)))
    assert classifier.assign(item.example) == ()
    assert not classifier.observe(item.example, ())
    assert not classifier.stale


def test_saved_and_pickled_classifiers_answer_alike(
    trucks: tuple[dict[int, RoleClassifier], Exemplars, int],
) -> None:
    for mode, classifier in trucks[0].items():
        plain = json.loads(json.dumps(classifier.to_dict()))
        again = RoleClassifier.from_dict(plain, TRUCK_VOCABULARY, _CONFIG)
        copied = pickle.loads(pickle.dumps(classifier))
        assert again.to_dict() == classifier.to_dict()
        for item in truck_stream(8, rng=np.random.default_rng(2)):
            if item.mode == mode:
                assert again.assign(item.example) == classifier.assign(item.example)
                assert copied.assign(item.example) == classifier.assign(item.example)
