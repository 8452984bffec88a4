"""A car that is paid for stopping near a mark: what it expects of places where it has hardly been."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from relgym.planning.doubts import DoubtedTask, OptimisticTask
from relgym.scene.objects import Float1D, Float2D, ObjectType, Target, Transition
from relgym.scene.schema import SceneSchema
from relgym.wrappers.dyna.reward_models import LearnedRewardModel

CAR = ObjectType("car", ("x", "v"))
SCHEMA = SceneSchema((CAR,), (("car", "car"),), targets=(Target("car", "x"), Target("car", "v")))


def step(x: float, v: float, after: float) -> tuple[Transition, float, bool]:
    """From x at speed v to x at speed `after`; it costs 0.02, a stop ends it, and one within 1 of the mark pays 2."""
    moved = Transition(SCHEMA.scene({"car": [x - after, v]}), SCHEMA.scene({"car": [x, after]}))
    return moved, -0.02 + 2.0 * (after == 0.0 and abs(x) <= 1.0), after == 0.0


def taught(stops: list[float], rng: np.random.Generator, *, drives: int = 150) -> LearnedRewardModel:
    """Has driven about, stopped far from the mark now and then, and at these places in the end."""
    model = LearnedRewardModel(SCHEMA, {("car", "x"), ("car", "v")})
    lessons = [
        step(rng.uniform(-20.0, 20.0), rng.uniform(1.0, 5.0), rng.uniform(1.0, 5.0)) for _ in range(drives)
    ]
    lessons += [
        step(side * rng.uniform(3.0, 20.0), rng.uniform(1.0, 5.0), 0.0) for side in (-1, 1) for _ in range(8)
    ]
    for k in rng.permutation(len(lessons)):
        model.learn_step(*lessons[k][:2], terminated=lessons[k][2])
    for x in stops:
        moved, paid, over = step(x, rng.uniform(1.0, 5.0), 0.0)
        model.learn_step(moved, paid, terminated=over)
    return model


def expected(
    model: LearnedRewardModel | DoubtedTask | OptimisticTask, places: list[float], after: float = 0.0
) -> Float1D:
    """Of coming to these places at that speed."""
    states: Float2D = np.array([[x, after] for x in places])
    before = np.array([[x - after, 2.0] for x in places])
    return model.evaluate(SCHEMA.layout(), before, np.zeros((len(places), 0)), states).rewards


def test_what_was_paid_twice_is_expected_again_there_and_less_far_away(rng: np.random.Generator) -> None:
    model = taught([0.4, -0.3], rng)
    assert expected(model, [0.0])[0] == pytest.approx(-0.02)  # two examples are no mode yet
    here, near, far, moving = (
        *expected(DoubtedTask(model), [0.0, 1.5, 10.0]),
        *expected(DoubtedTask(model), [0.0], 2.0),
    )
    assert here == pytest.approx(1.98)
    assert here > near > far
    assert far == pytest.approx(-0.02) and moving < 0.5


def test_a_bonus_is_surest_where_it_was_paid(rng: np.random.Generator) -> None:
    model = taught(rng.uniform(-0.6, 0.6, 14).tolist(), rng)
    assert expected(model, [0.0]) == pytest.approx([1.98])
    here, outside = expected(DoubtedTask(model), [0.0, 1.2])  # what is paid there nobody has seen
    assert here == pytest.approx(1.98)
    assert outside < 1.9


def test_an_optimist_takes_what_half_of_the_rules_promise_until_it_was_tried(
    rng: np.random.Generator,
) -> None:
    model = taught(rng.uniform(0.1, 0.6, 14).tolist(), rng, drives=600)
    doubted = DoubtedTask(model)
    places = np.linspace(-20.0, 20.0, 161)
    likely, best = expected(doubted, places.tolist()), expected(OptimisticTask(doubted), places.tolist())
    assert (best >= likely).all()
    known = (places >= 0.1) & (places <= 0.6)
    assert best[known] == pytest.approx(likely[known])
    beside = places[(best > 1.9) & ~known]
    assert len(beside) and likely[(best > 1.9) & ~known].max() < 1.97
    assert best[np.abs(places) > 10.0].max() < 0.0  # where nothing was paid, nothing is expected
    before, last = beside.min(), beside.min() - 0.05
    moved, _, over = step(last, 2.0, 0.0)
    for _ in range(2):  # it isn't paid there
        model.learn_step(moved, -0.02, terminated=over)
    tried = expected(OptimisticTask(doubted), [before - 0.1, last, 0.3])
    assert tried[:2].max() < 0.0 < tried[2]


def test_an_optimist_takes_the_end_with_the_bonus(rng: np.random.Generator) -> None:
    # A plan would be paid again and again where the bonus is one mode's and no end another's.
    model = taught(rng.uniform(0.1, 0.6, 14).tolist(), rng, drives=600)
    states: Float2D = np.array([[x, 0.0] for x in np.linspace(-3.0, 3.0, 61)])
    before = states + np.array([0.0, 2.0])
    told = OptimisticTask(DoubtedTask(model)).evaluate(SCHEMA.layout(), before, np.zeros((61, 0)), states)
    assert told.terminated[told.rewards > 1.0].all() and (told.rewards > 1.0).sum() > 5


@pytest.mark.parametrize("kind", [DoubtedTask, lambda model: OptimisticTask(DoubtedTask(model))])
def test_it_says_nothing_where_nothing_is_known(kind: Any) -> None:
    assert np.isnan(expected(kind(LearnedRewardModel(SCHEMA, {("car", "x")})), [0.0])).all()


def test_it_learns_on_with_the_model(rng: np.random.Generator) -> None:
    model = taught([], rng)
    task = DoubtedTask(model)
    assert expected(task, [0.0])[0] < 0.0
    for x in (0.4, -0.3):
        moved, paid, over = step(x, 2.0, 0.0)
        model.learn_step(moved, paid, terminated=over)
    assert expected(task, [0.0])[0] == pytest.approx(1.98)


def test_where_no_mode_is_known_what_is_usual_counts() -> None:
    # To the right every step pays its length, to the left it costs that; what crossing over pays nobody has seen.
    model = LearnedRewardModel(SCHEMA, {("car", "x"), ("car", "v")})
    rng = np.random.default_rng(1)
    for _ in range(150):
        side, v = rng.choice([-1.0, 1.0]), rng.uniform(1.0, 5.0)
        moved, _, _ = step(side * rng.uniform(10.0, 20.0), v, v)
        model.learn_step(moved, side * v, terminated=False)
    task = DoubtedTask(model)
    modes, said = model.claims(model.lessons(), np.zeros(150, dtype=np.bool_))
    assert len(modes) == 2 and np.allclose(said.sum(axis=1), 0.0)
    usual = task._usual(model.lessons(), np.zeros(150, dtype=np.bool_))
    more = max(modes, key=lambda mode: mode.examples)
    assert usual.tolist() == said[:, modes.index(more)].tolist()
    far = expected(task, [-15.0, 15.0], 2.0)
    assert far == pytest.approx([-2.0, 2.0])
