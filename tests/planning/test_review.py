from __future__ import annotations

from dataclasses import replace

import gymnasium as gym
import numpy as np

from relgym import WorldModel
from relgym.planning.review import learned_again, length, missed, mixed, off_by, right
from relgym.scene.objects import Transition
from relgym.wrappers.dyna.recorder import TransitionRecorder


def cart_steps(count: int) -> tuple[TransitionRecorder, list[Transition]]:
    env = TransitionRecorder(gym.make("relgym/TruckPush-v0", n_boxes=1))
    env.action_space.seed(0)
    env.reset(seed=0)
    found: list[Transition] = []
    while len(found) < count:
        *_, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
        found += [real.transition for real in env.take()]
    return env, found


def test_a_model_that_learned_again_is_right_of_what_it_saw_and_the_old_one_is_left_alone() -> None:
    env, seen = cart_steps(60)
    old = WorldModel(env.schema)
    fresh = learned_again(old, seen, rng=np.random.default_rng(0))
    assert old.seen == 0 and fresh.seen == 60
    assert right(fresh, seen).mean() > 0.9


def one_wrong() -> tuple[WorldModel, list[Transition]]:
    """A model, and three steps: it is right of all but the second, whose velocity is off by 0.5."""
    env, seen = cart_steps(60)
    model = learned_again(WorldModel(env.schema), seen, rng=np.random.default_rng(0))
    first, second, third = (seen[k] for k in np.flatnonzero(right(model, seen))[:3])
    moved = second.after.replace({("truck", "vx"): second.after["truck"]["vx"] + 0.5})
    return model, [first, replace(second, after=moved), third]


def test_each_transition_is_told_from_the_others() -> None:
    model, steps = one_wrong()
    assert right(model, steps).tolist() == [True, False, True]


def test_a_step_is_off_by_the_largest_ratio_of_its_values() -> None:
    model, steps = one_wrong()
    asked: set[tuple[str, str]] = set()

    def ratio(key: tuple[str, str], off: float) -> float:
        asked.add(key)
        return abs(off) / 2.0

    np.testing.assert_allclose(off_by(model, steps, ratio), [0.0, 0.25, 0.0], atol=1e-9)
    assert asked == {(t.type, t.property) for t in model.targets}
    nothing = WorldModel(model.schema, targets=())
    assert off_by(nothing, steps, ratio).tolist() == [1.0] * 3  # it knows of nothing that changes


def test_nothing_is_right_of_nothing() -> None:
    env, _ = cart_steps(1)
    assert right(WorldModel(env.schema), []).tolist() == []


def test_the_steps_of_all_episodes_take_turns(rng: np.random.Generator) -> None:
    episodes = np.array([0, 0, 0, 0, 1, 1, 2, 2, 2])
    order = mixed(episodes, rng)
    assert sorted(order) == list(range(9))
    turns = [sorted(episodes[order[begin:end]].tolist()) for begin, end in ((0, 3), (3, 6), (6, 8), (8, 9))]
    assert turns == [[0, 1, 2], [0, 1, 2], [0, 2], [0]]
    assert mixed(episodes[:0], rng) == []


def test_what_a_model_states_makes_its_length() -> None:
    env, seen = cart_steps(60)
    assert length(WorldModel(env.schema)) == 0.0
    model = learned_again(WorldModel(env.schema), seen, rng=np.random.default_rng(0))
    numbers = sum(
        len({round(weight, 9) for role in mode.roles for _, weight in role.terms}) + (mode.intercept != 0.0)
        for target in model.targets
        for mode in model.modes(target.type, target.property)
    )
    assert numbers <= length(model) < numbers + 10


def test_what_stays_the_same_in_an_episode_is_missed_once() -> None:
    env, seen = cart_steps(60)
    model = learned_again(WorldModel(env.schema), seen, rng=np.random.default_rng(0))
    good = [seen[k] for k in np.flatnonzero(right(model, seen))[:6]]

    def slower(told: Transition, by: float) -> Transition:
        return replace(told, after=told.after.replace({("truck", "vx"): told.after["truck"]["vx"] - by}))

    episodes = np.array([0, 0, 0, 1, 1, 1])
    assert missed(model, good, episodes) == 0
    assert missed(model, [slower(told, 0.5) for told in good], episodes) == 2
    assert missed(model, [slower(told, 0.5 + 0.1 * k) for k, told in enumerate(good)], episodes) == 6
    assert missed(model, good, episodes[::-1]) == 0
