"""Voting online: what a stream teaches, what it costs, and what must not change the result."""

from __future__ import annotations

import copy
import json
import pickle
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from toy_situations import (
    BALL_VOCABULARY,
    BOUNCE,
    FLY,
    HALT,
    RAMP,
    TRUCK_VOCABULARY,
    Labelled,
    ball_stream,
    truck_stream,
)

from relgym.classification.examples import NOISE, ExampleBatch, Vocabulary
from relgym.classification.mode_classifier import ModeClassifier
from relgym.config import ClassificationConfig

_ALL = range(6)


def _empty(
    modes: Sequence[int] = _ALL,
    vocabulary: Vocabulary = BALL_VOCABULARY,
    config: ClassificationConfig | None = None,
) -> ModeClassifier:
    classifier = ModeClassifier(vocabulary, config or ClassificationConfig())
    m = len(modes)
    classifier.sync(modes, np.empty(0, int), np.empty((0, m), bool), np.empty((0, m)))
    return classifier


def _taught(classifier: ModeClassifier, items: Sequence[Labelled]) -> list[int]:
    """Prequential: predict, then learn; the numbers of the examples predicted wrongly."""
    wrong = []
    for number, item in enumerate(items):
        if not item.fits[
            classifier.modes.index(classifier.rank(item.example, item.values.tolist()).modes[0])
        ]:
            wrong.append(number)
        classifier.observe(item.example, item.mode, item.fits, item.values)
        classifier.refresh()
    return wrong


def _wrong(classifier: ModeClassifier, items: Sequence[Labelled]) -> int:
    batch = ExampleBatch.stack([item.example for item in items])
    ranking = classifier.rank_batch(batch, np.array([item.values for item in items]))
    columns = [classifier.modes.index(mode) for mode in ranking.modes[:, 0].tolist()]
    return sum(not item.fits[column] for item, column in zip(items, columns, strict=True))


@pytest.fixture(scope="module")
def stream() -> list[Labelled]:
    return list(ball_stream(6000, rng=np.random.default_rng(0)))


@pytest.fixture(scope="module")
def fresh() -> list[Labelled]:
    return list(ball_stream(8000, rng=np.random.default_rng(99), ramp_share=0.005))


@pytest.fixture(scope="module")
def learned(stream: list[Labelled]) -> tuple[ModeClassifier, list[int]]:
    classifier = _empty()
    return classifier, _taught(classifier, stream)


def test_a_stream_learned_one_at_a_time_ends_right(
    learned: tuple[ModeClassifier, list[int]], fresh: list[Labelled]
) -> None:
    classifier, wrong = learned
    assert len(wrong) <= 60
    assert sum(number >= 3000 for number in wrong) <= 6
    common = [item for item in fresh if item.mode != RAMP]
    assert _wrong(classifier, common) <= 0.001 * len(common)


def test_rare_modes_do_not_drown() -> None:
    stream = list(ball_stream(4000, rng=np.random.default_rng(4), ramp_share=0.008))
    rare = sum(item.mode == RAMP for item in stream)
    assert 8 <= rare <= 24
    classifier = _empty()
    _taught(classifier, stream)
    ramps = [
        item for item in ball_stream(3000, rng=np.random.default_rng(5), ramp_share=0.1) if item.mode == RAMP
    ]
    assert _wrong(classifier, ramps) <= 0.03 * len(ramps)


def test_single_and_batch_agree_bit_for_bit(
    learned: tuple[ModeClassifier, list[int]], fresh: list[Labelled]
) -> None:
    classifier, _ = learned
    items = fresh[:1500]
    batch = ExampleBatch.stack([item.example for item in items])
    together = classifier.rank_batch(batch, np.array([item.values for item in items]))
    for number, item in enumerate(items):
        assert classifier.rank(item.example, item.values.tolist()) == together[number]


def test_agreeing_examples_only_update_counts(learned: tuple[ModeClassifier, list[int]]) -> None:
    classifier = copy.deepcopy(learned[0])
    before = [str(c.definition) for c in classifier.classifiers]
    count = classifier.counts[FLY]
    work = 0
    for item in ball_stream(300, rng=np.random.default_rng(11)):
        if item.mode == FLY and item.fits.sum() == 1:
            assert classifier.observe(item.example, item.mode, item.fits, item.values) == 0
            work += classifier.refresh()
    assert work == 0
    assert [str(c.definition) for c in classifier.classifiers] == before
    assert classifier.counts[FLY] > count + 50


def test_ambiguous_examples_teach_nothing(learned: tuple[ModeClassifier, list[int]]) -> None:
    classifier = copy.deepcopy(learned[0])
    item = next(ball_stream(1, rng=np.random.default_rng(11)))
    counts = [c.counts for c in classifier.classifiers]
    before = copy.deepcopy(counts)
    assert classifier.observe(item.example, HALT, np.ones(6, bool), item.values) == 0
    assert counts == before
    assert classifier.stale == ()


def test_budget_is_spent_on_the_most_contradicted_pair_first() -> None:
    classifier = _empty((FLY, BOUNCE, RAMP))
    items = [
        item for item in ball_stream(800, rng=np.random.default_rng(2), ramp_share=0.02) if item.mode <= RAMP
    ]
    for item in items:
        classifier.observe(item.example, item.mode, item.fits[:3], item.values[:3])
    assert len(classifier.stale) == 3
    most = classifier.stale[0]
    calls = 0
    while most in classifier.stale:  # a piece at a time, whatever it costs
        assert classifier.refresh(budget=1) > 0
        calls += 1
    assert calls > 1
    assert len(classifier.stale) == 2
    assert classifier.refresh() > 0
    assert classifier.stale == ()


def test_a_pair_learned_in_pieces_is_the_pair_learned_at_once() -> None:
    whole, pieces = _empty(), _empty()
    for item in ball_stream(600, rng=np.random.default_rng(3)):
        for classifier in (whole, pieces):
            classifier.observe(item.example, item.mode, item.fits, item.values)
    whole.refresh()
    begun = 0
    while pieces.stale:
        assert pieces.refresh(budget=100_000) > 0
        begun += any(pair.draft is not None for pair in pieces._pairs.values())
        pieces = copy.deepcopy(pieces)  # it may be copied between two pieces
    assert begun
    assert pieces.to_dict() == whole.to_dict()
    again = ModeClassifier.from_dict(json.loads(json.dumps(pieces.to_dict())), pieces.config)
    assert again.to_dict() == whole.to_dict()


def test_who_reads_a_file_begins_a_pair_again() -> None:
    classifier = _empty()
    for item in ball_stream(300, rng=np.random.default_rng(3)):
        classifier.observe(item.example, item.mode, item.fits, item.values)
    classifier.refresh(budget=1)
    assert any(pair.draft is not None for pair in classifier._pairs.values())
    again = ModeClassifier.from_dict(json.loads(json.dumps(classifier.to_dict())), classifier.config)
    assert again.stale == classifier.stale
    classifier.refresh(), again.refresh()
    assert again.to_dict() == classifier.to_dict()


def test_a_mode_found_in_noise_is_learned_and_a_lost_one_forgotten(stream: list[Labelled]) -> None:
    items = [item for item in stream if item.mode in (FLY, BOUNCE)][:500]
    classifier = ModeClassifier(BALL_VOCABULARY, ClassificationConfig())
    for item in items:
        classifier.observe(item.example, NOISE, np.empty(0, bool), np.empty(0))
    assert classifier.rank(items[0].example, []).modes == ()
    rows = classifier.exemplars.rows
    truth = {item.example.row: item for item in items}
    kept = [truth[int(row)] for row in rows]
    assigned = np.array([7 if item.mode == FLY else 3 for item in kept])
    fits = np.array([item.fits[[FLY, BOUNCE]] for item in kept])
    values = np.array([item.values[[FLY, BOUNCE]] for item in kept])
    classifier.sync((7, 3), assigned, fits, values)
    classifier.refresh()
    found = [classifier.rank(i.example, i.values[[FLY, BOUNCE]].tolist()).modes[0] for i in items]
    assert sum(mode != (7 if i.mode == FLY else 3) for mode, i in zip(found, items, strict=True)) == 0
    n = len(classifier.exemplars)
    classifier.sync((7,), np.where(assigned[:n] == 7, 7, NOISE), fits[:n, :1], values[:n, :1])
    assert classifier.classifiers == ()
    assert classifier.rank(items[0].example, [0.0]).modes == (7,)
    assert classifier.rank(items[0].example, [0.0]).margin == float("inf")


def test_sync_leaves_pairs_alone_whose_examples_did_not_change(
    learned: tuple[ModeClassifier, list[int]],
) -> None:
    classifier = copy.deepcopy(learned[0])
    kept = {(c.i, c.j): c for c in classifier.classifiers}
    exemplars = classifier.exemplars
    assigned, fits = exemplars.assigned.copy(), exemplars.columns["fits"].copy()
    values = exemplars.columns["values"].copy()
    assigned[assigned == HALT] = FLY  # so labelled, halting flatly contradicts what was learned of flying
    fits[assigned == FLY] = np.arange(6) == FLY
    classifier.sync(_ALL, assigned, fits, values)
    changed = {pair for pair in classifier.stale if FLY in pair or HALT in pair}
    assert classifier.stale
    assert set(classifier.stale) == changed
    assert all(kept[c.i, c.j] is c for c in classifier.classifiers)


def test_refitted_functions_by_rounding_leave_everything(learned: tuple[ModeClassifier, list[int]]) -> None:
    classifier = copy.deepcopy(learned[0])
    c = classifier.exemplars.columns
    counts = [classifier_.counts for classifier_ in classifier.classifiers]
    classifier.sync(_ALL, c["assigned"].copy(), c["fits"].copy(), c["values"] * (1 + 1e-14))
    assert classifier.stale == ()
    assert [each.counts for each in classifier.classifiers] == counts


def test_same_stream_same_bytes(stream: list[Labelled]) -> None:
    one, two = _empty(), _empty()
    _taught(one, stream[:600])
    for item in stream[:600]:  # asked or not asked in between
        two.observe(item.example, item.mode, item.fits, item.values)
        two.refresh()
    assert json.dumps(one.to_dict()) == json.dumps(two.to_dict())


def test_saved_copied_and_pickled_classifiers_answer_and_go_on_alike(stream: list[Labelled]) -> None:
    classifier = _empty()
    _taught(classifier, stream[:500])
    plain = json.loads(json.dumps(classifier.to_dict()))
    others = [
        ModeClassifier.from_dict(plain, classifier.config),
        pickle.loads(pickle.dumps(classifier)),
        copy.deepcopy(classifier),
    ]
    expected = _taught(classifier, stream[500:800])
    for other in others:
        assert _taught(other, stream[500:800]) == expected
        assert other.to_dict() == classifier.to_dict()


def test_without_exemplars_a_classifier_still_answers(learned: tuple[ModeClassifier, list[int]]) -> None:
    classifier, _ = learned
    plain = json.loads(json.dumps(classifier.to_dict(exemplars=False)))
    again = ModeClassifier.from_dict(plain, classifier.config)
    for item in ball_stream(200, rng=np.random.default_rng(8)):
        values = item.values.tolist()
        assert again.rank(item.example, values) == classifier.rank(item.example, values)


def test_explanation_names_the_clause_and_the_runner_up(learned: tuple[ModeClassifier, list[int]]) -> None:
    classifier, _ = learned
    item = next(i for i in ball_stream(900, rng=np.random.default_rng(3)) if i.mode == BOUNCE)
    verdicts = classifier.explain(item.example, item.values.tolist())
    assert [v.runner_up for v in verdicts] == list(
        classifier.rank(item.example, item.values.tolist()).modes[1:]
    )
    assert {v.winner for v in verdicts} == {BOUNCE}
    assert any("approach" in str(v.clause) for v in verdicts)
    assert all(v.probability > 0.5 for v in verdicts)


def test_ties_go_to_the_mode_with_more_examples_then_to_the_lower_id() -> None:
    item = next(ball_stream(1, rng=np.random.default_rng(0)))
    classifier = _empty((4, 2, 9))
    assert classifier.rank(item.example, [0.0] * 3).modes == (2, 4, 9)
    classifier.counts[9] = 5.0
    assert classifier.rank(item.example, [0.0] * 3).modes == (9, 2, 4)


def test_table_3_2_from_a_truck_with_bystanders() -> None:
    classifier = _empty((1, 2, 3), TRUCK_VOCABULARY)
    _taught_truck(classifier, 48, bystanders=2)
    found = {(c.i, c.j): str(c.definition) for c in classifier.classifiers}
    assert found == {
        (1, 2): "(y-greater-than(B, A) ∧ on-top(C, B))",
        (1, 3): "y-greater-than(B, A)",
        (2, 3): "y-greater-than(B, A)",
    }
    rows = {(c.i, c.j): [row[1:3] for row in c.describe()] for c in classifier.classifiers}
    assert rows[1, 2] == [(120.0, 0.0), (240.0, 0.0)]
    assert [c.context for c in classifier.classifiers] == ["all"] * 3
    fresh = truck_stream(40, rng=np.random.default_rng(7), bystanders=5)
    assert all(classifier.rank(i.example, i.values.tolist()).modes[0] == i.mode for i in fresh)


def test_unseen_layouts_are_not_familiar_where_no_clause_speaks() -> None:
    classifier = _empty((1, 2, 3), TRUCK_VOCABULARY)
    _taught_truck(classifier, 48)
    known = next(truck_stream(1, rng=np.random.default_rng(0)))
    assert classifier.rank(known.example, known.values.tolist()).seen
    on_top = TRUCK_VOCABULARY.relations.index("on-top")
    floating = np.zeros_like(known.example.table)
    floating[on_top] = ~np.eye(floating.shape[-1], dtype=bool)  # all on top of each other, none higher
    ranking = classifier.rank(replace(known.example, table=floating), known.values.tolist())
    assert not ranking.seen
    assert not ranking.familiar


def _taught_truck(classifier: ModeClassifier, episodes: int, bystanders: int = 0) -> None:
    for item in truck_stream(episodes, rng=np.random.default_rng(0), bystanders=bystanders):
        classifier.observe(item.example, item.mode, item.fits, item.values)
        classifier.refresh()


def test_an_ambiguous_example_speaks_for_both_modes_against_a_third() -> None:
    # Else votes go round in circles: 0 beats 2, 1 is a tie with 0, and 2, never taught otherwise, beats 1.
    classifier = _empty((0, 1, 2))
    items = list(ball_stream(200, rng=np.random.default_rng(0)))
    for item in items:
        flying = item.mode == FLY
        fits = np.array([flying, flying, not flying])
        classifier.observe(item.example, 0 if flying else 2, fits, np.full(3, np.nan))
        classifier.refresh()
    told = {(c.i, c.j): sum(map(sum, c.counts)) for c in classifier.classifiers}
    assert told[0, 1] == 0
    assert told[0, 2] == told[1, 2] == pytest.approx(200, rel=2e-3)


def test_what_a_covering_mode_fails_to_explain_teaches_the_two_apart() -> None:
    # Mode 1 explains nearly all of mode 0's examples: the rare others are all that tells the two apart.
    items = list(ball_stream(400, rng=np.random.default_rng(0)))
    classifier = _empty((0, 1))

    def observe(at: int, *, both: bool) -> None:
        classifier.observe(items[at].example, 0, np.array([True, both]), np.zeros(2))

    for at in range(300):
        observe(at, both=True)
    slots = len(classifier.exemplars)
    fits, values = np.ones((slots, 2), dtype=np.bool_), np.zeros((slots, 2))
    classifier.sync((0, 1), np.zeros(slots, dtype=np.int64), fits, values)  # what covers what is noted here
    for at in range(300, 304):
        observe(at, both=False)
    assert [0, 1] in classifier.to_dict()["covered"]
    assert sum(map(sum, classifier.classifiers[0].counts)) == 4


# ---------------------------------------------------------------------- contradictions, by hand
def _speeds(modes: Sequence[int] = (1, 2, 3)) -> tuple[ModeClassifier, Callable[..., int]]:
    """Slow, middling and fast examples in one relational state, and how to observe more."""
    classifier = _empty(modes)
    item = next(ball_stream(1, rng=np.random.default_rng(0)))
    count = iter(range(10_000))

    def observe(vx: float, mode: int, *others: int, also: Sequence[int] = ()) -> int:
        example = replace(item.example, own=np.array([vx, 0.0]), row=next(count))
        fits = np.array([m == mode or m in (*others, *also) for m in modes])
        return classifier.observe(example, mode, fits, np.zeros(len(modes)))

    for k in range(12):
        for mode in modes:
            observe(mode - 2.0 + 0.02 * k, mode)
    classifier.refresh()
    assert classifier.stale == ()
    return classifier, observe


def test_an_example_contradicts_each_pair_that_it_loses() -> None:
    classifier, observe = _speeds()
    assert observe(-0.95, 1) == 0
    assert observe(1.1, 1) == 2  # as fast as 3 is: 1 loses to 2 and to 3
    assert set(classifier.stale) == {(1, 2), (1, 3)}
    assert observe(0.9, 2) == 1  # 2 loses to 3; of 1 and 3 neither is right
    assert set(classifier.stale) == {(1, 2), (1, 3), (2, 3)}
    assert classifier.counts == {1: 14.0, 2: 13.0, 3: 12.0}


def test_what_several_explain_contradicts_none_of_their_pairs() -> None:
    classifier, observe = _speeds()
    before = [pair.counts for pair in copy.deepcopy(classifier.classifiers)]
    assert observe(1.1, 1, 2, 3) == 0  # both others explain it
    assert [pair.counts for pair in classifier.classifiers] == before
    assert observe(1.1, 1, 3) == 1  # 2 doesn't
    assert classifier.stale == ((1, 2),)


def test_noise_contradicts_nothing_and_is_remembered() -> None:
    classifier, observe = _speeds()
    slots = len(classifier.exemplars)
    assert observe(1.1, NOISE, 1) == 0
    assert (classifier.stale, sum(classifier.counts.values())) == ((), 36.0)
    assert len(classifier.exemplars) == slots + 1


def test_a_contradiction_is_remembered_first() -> None:
    classifier, observe = _speeds()
    for _ in range(40):
        observe(-0.9, 1)
    observe(1.1, 1)
    for _ in range(60):
        observe(-0.9, 1)
    hard = classifier.exemplars.columns["hard"]
    assert 1.1 in classifier.exemplars.columns["own"][hard, 0].tolist()


def test_what_is_remembered_and_how_it_is_ranked() -> None:
    classifier, _ = _speeds()
    view, weights, ranking = classifier.remembered()
    assert len(view) == len(weights) == len(ranking) == len(classifier.exemplars)
    assert weights.sum() == pytest.approx(36.0, abs=0.5)
    assert ranking.modes[:, 0].tolist() == classifier.exemplars.assigned.tolist()


def test_which_relations_are_looked_at() -> None:
    classifier, _ = _speeds()
    assert classifier.relations == frozenset()  # numbers alone tell these apart
    names, seen = classifier.experience()
    assert all(relations == unary == () for _, relations, unary in names)
    assert len(seen) == 1
    touching = _empty((FLY, BOUNCE))
    for item in ball_stream(400, rng=np.random.default_rng(3), ramp_share=0.0):
        if item.mode in (FLY, BOUNCE):
            touching.observe(item.example, item.mode, item.fits[[FLY, BOUNCE]], item.values[[FLY, BOUNCE]])
    touching.refresh()
    used = {
        literal.relation
        for c in touching.classifiers
        for clause in c.definition.clauses
        for literal in clause
    }
    assert touching.relations == used & set(BALL_VOCABULARY.relations)
    ((_, relations, unary), *_) = touching.experience()[0]
    assert set(relations) == touching.relations and set(unary) == used & set(BALL_VOCABULARY.unary)


def test_another_own_feature_is_learned_from_what_is_remembered() -> None:
    """Only the feature that comes later tells the modes apart."""
    rng, classifier = np.random.default_rng(1), _empty((1, 2))
    item = next(ball_stream(1, rng=np.random.default_rng(0)))
    for k in range(40):
        example = replace(item.example, own=rng.normal(size=2), row=k)
        classifier.observe(example, 1 + k % 2, np.array([k % 2 == 0, k % 2 == 1]), np.zeros(2))
    classifier.refresh()
    wider = replace(BALL_VOCABULARY, own=("vx", "vy", "light"))
    own = np.column_stack([classifier.exemplars.columns["own"], classifier.exemplars.rows % 2])
    classifier.widen(wider, own)
    assert classifier.vocabulary == wider
    assert classifier.stale == ((1, 2),)
    classifier.refresh()
    assert "light" in str(classifier.classifiers[0].definition)
    asked = [replace(item.example, own=np.array([9.0, 9.0, light])) for light in (0.0, 1.0)]
    assert [classifier.rank(example, [0.0, 0.0]).modes[0] for example in asked] == [1, 2]
