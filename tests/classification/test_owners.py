"""Whose an example is: relations decide where several modes explain it, and numbers don't."""

from __future__ import annotations

import numpy as np
import pytest
from toy_situations import BALL_VOCABULARY, BOUNCE, FLY, HALT, Labelled, ball_stream

from relgym.classification.examples import NOISE
from relgym.classification.exemplars import Exemplars
from relgym.classification.mode_classifier import ModeClassifier
from relgym.classification.owners import Owners
from relgym.config import ClassificationConfig

AIR, FLOOR, NEW = b"air", b"floor", b"new"


@pytest.fixture
def owners() -> Owners:
    """Flying was seen in the air, resting on the floor; bouncing explains every rest and so covers it."""
    known = Owners({}, {(HALT, BOUNCE)})
    for _ in range(3):
        known.count(FLY, AIR, [FLY])
        known.count(HALT, FLOOR, [HALT, BOUNCE])
    return known


def test_a_coincidence_belongs_to_the_mode_that_was_seen_in_such_relations(owners: Owners) -> None:
    # At the top of its flight a ball is as fast as one at rest, and resting is the simpler mode.
    assert owners.owner(HALT, AIR, [FLY, HALT]) == FLY
    assert owners.owner(HALT, FLOOR, [FLY, HALT, BOUNCE]) == HALT


def test_where_nothing_is_known_an_example_stays_where_it_was_assigned(owners: Owners) -> None:
    assert owners.owner(HALT, NEW, [FLY, HALT]) == HALT
    assert owners.owner(HALT, AIR, [HALT, BOUNCE]) == HALT
    assert owners.owner(NOISE, AIR, [FLY]) == NOISE


def test_a_coincidence_is_no_evidence_for_the_next_one(owners: Owners) -> None:
    for _ in range(100):
        owners.count(HALT, AIR, [FLY, HALT])
    assert owners.owner(HALT, AIR, [FLY, HALT]) == FLY
    # One example that nothing else explains is.
    owners.count(HALT, AIR, [HALT])
    assert owners.owner(HALT, AIR, [FLY, HALT]) == HALT


def test_of_several_modes_the_one_seen_most_often_owns_it(owners: Owners) -> None:
    owners.count(BOUNCE, AIR, [BOUNCE])
    assert owners.owner(HALT, AIR, [FLY, BOUNCE, HALT]) == FLY
    for _ in range(5):
        owners.count(BOUNCE, AIR, [BOUNCE])
    assert owners.owner(HALT, AIR, [FLY, BOUNCE, HALT]) == BOUNCE


def test_exemplars_say_the_same_as_the_examples_did() -> None:
    items = list(ball_stream(800, rng=np.random.default_rng(5)))
    exemplars = Exemplars(BALL_VOCABULARY, ClassificationConfig(exemplars_per_state=1000))
    exemplars.set_modes(range(6), np.empty(0, int), np.empty((0, 6), bool), np.empty((0, 6)))
    one_by_one = Owners({}, ())
    for item in items:
        exemplars.add(item.example, item.mode, item.fits, item.values)
        one_by_one.count(item.mode, item.example.key, np.flatnonzero(item.fits).tolist())
    together = Owners.of(exemplars, ())
    assert together.to_list() == one_by_one.to_list()
    expected = [together.owner(i.mode, i.example.key, np.flatnonzero(i.fits).tolist()) for i in items]
    assert together.owners(exemplars).tolist() == expected
    assert Owners.from_list(together.to_list(), ()).to_list() == together.to_list()


def test_a_ball_that_seems_to_rest_in_mid_air_teaches_nothing_about_resting() -> None:
    items = [i for i in ball_stream(600, rng=np.random.default_rng(2)) if i.mode in (FLY, BOUNCE, HALT)]
    plain, tricked = _taught(items, 0), _taught(items, 40)
    definitions = [{(c.i, c.j): str(c.definition) for c in each.classifiers} for each in (plain, tricked)]
    assert definitions[0][BOUNCE, HALT] == definitions[1][BOUNCE, HALT]


def _taught(items: list[Labelled], tricks: int) -> ModeClassifier:
    """Learned of some examples, and of flights that rest explains as well and, being simpler, is given."""
    classifier = ModeClassifier(BALL_VOCABULARY, ClassificationConfig())
    classifier.sync(range(6), np.empty(0, int), np.empty((0, 6), bool), np.empty((0, 6)))
    for item in items:
        classifier.observe(item.example, item.mode, item.fits, item.values)
    for item in [i for i in items if i.mode == FLY and i.fits.sum() == 1][:tricks]:
        fits = item.fits.copy()
        fits[HALT] = True
        classifier.observe(item.example, HALT, fits, item.values)
    classifier.refresh()
    return classifier
