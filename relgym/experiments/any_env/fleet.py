"""Many envs at once: what a fleet teaches in each way of beginning anew, and what watching costs the agent.

Every env of the fleet writes its own steps down, innermost, where nothing is reset but by `reset`. What the learner
around the fleet took up must be that and nothing else, and its model the one that the same transitions teach when they
come one by one. Beside it stands a learner that is fooled: it takes every step of the fleet for a transition, the leaps
from an episode's end to the next beginning too. It shows that the fleet would teach leaps if they weren't left out.
"""

from __future__ import annotations

import itertools
import multiprocessing
import time
from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from typing import Any, Final

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from relgym.config import ModelConfig
from relgym.envs.views import NumbersView
from relgym.experiments.any_env.data import STUDIES, Study, made, pumping, view_of
from relgym.experiments.criterion import Figure
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Transition
from relgym.wrappers import VectorModelLearner

__all__ = ["Diary", "fleet", "policy_speed", "taught"]

ENVS, STEPS = 8, 250
"""Envs of a fleet, and how often all of them step."""

FEATURES: Final = {"cart": ("trig", "products"), "mountain": ("trig",)}
"""Envs of the fleets, and what the default's own advice switches on there."""

ROLLOUT, QUEUE, POLICY_STEPS, REPEATS = 2_048, 16_384, 32_768, 3
"""The watched agent: steps between updates (PPO's default); length of the queue to the learning process, which holds
one rollout of all envs; steps of each training; trainings of each kind."""

Entry = tuple[Any, Any, Any]
"""Observation, action, next observation."""


class Diary(gym.Wrapper[Any, Any, Any, Any]):
    """Writes down what an env really did: observation, action, next observation.

    Parameters
    ----------
    env
        Any env.
    entries
        Where to; may be shared, and then stands in the order in which the envs stepped.
    """

    def __init__(self, env: gym.Env[Any, Any], entries: list[Entry]) -> None:
        super().__init__(env)
        self._entries = entries
        self._last: Any = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        """Begin an episode: nothing to write."""
        self._last, info = self.env.reset(seed=seed, options=options)
        return self._last, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Step, and write it down."""
        observation, *rest = self.env.step(action)
        self._entries.append((self._last, action, observation))
        self._last = observation
        return (observation, *rest)


def fleet(seeds: Sequence[tuple[int, int]], *, quick: bool = False) -> Iterator[Figure]:
    """Fleets in every autoreset mode against one env, and an agent's speed with the callback against without."""
    for name in list(FEATURES)[: 1 if quick else None]:
        for mode in AutoresetMode:
            for training, _ in seeds:
                yield from taught(name, mode, training, 60 if quick else STEPS)
    if find_spec("stable_baselines3") is not None and not quick:
        yield from policy_speed(POLICY_STEPS, REPEATS)


def taught(name: str, mode: AutoresetMode, seed: int, steps: int) -> Iterator[Figure]:
    """What a fleet of `ENVS` teaches in one autoreset mode, beside what its envs' diaries teach one by one."""
    study, entries = STUDIES[name], list[Entry]()
    view, config = view_of(study), ModelConfig(features=FEATURES[name])
    ships = [lambda: Diary(made(study), entries)] * ENVS
    learner = VectorModelLearner(SyncVectorEnv(ships, autoreset_mode=mode), view=view, config=config)
    kept, naive = _sailed(learner, study, seed, steps)
    alone, fooled = WorldModel(view.schema, config), WorldModel(view.schema, ModelConfig())
    told = [view.with_action(view.scene(seen), action) for seen, action, _ in entries]
    after = [view.scene(following) for *_, following in entries]
    for scene, following, (_, *said) in zip(told, after, kept, strict=False):
        alone.take_up(Transition(scene, following), *said)
    for transition in naive:
        fooled.learn_one(transition)
    same = learner.model.to_json(history=True) == alone.to_json(history=True)
    foreign = sum(
        t.before.vector.tobytes() != b.vector.tobytes() or t.after.vector.tobytes() != a.vector.tobytes()
        for (t, *_), b, a in zip(kept, told, after, strict=False)
    ) + abs(len(kept) - len(entries))
    where = f"{name}, {mode.value}"
    print(f"{where}: {len(entries):,} transitions of {steps * ENVS:,} steps; x: {_modes(learner.model)}")
    print(
        f"  fooled by leaps: {_unexplained(fooled):.2g} of x unexplained, against {_unexplained(learner.model):.2g}"
    )
    yield f"{where}: transitions learned that no env made, or the other way round", 0.0, foreign, "<="
    yield f"{where}: model equal to that of a single env", 1.0, float(same), ">="


def _sailed(
    learner: VectorModelLearner, study: Study, seed: int, steps: int
) -> tuple[list[tuple[Any, ...]], list[Transition]]:
    """Drive a fleet; what its learner took up and had predicted, and all steps as who knows no ends sees them."""
    kept, naive = list[tuple[Any, ...]](), list[Transition]()
    learn = learner.model.take_up

    def take_up(transition: Transition, *told: Any) -> Any:
        kept.append((transition, *told))
        return learn(transition, *told)

    learner.model.take_up = take_up  # type: ignore[assignment, method-assign]
    act = _policy(study, learner, seed)
    view = learner.view
    assert isinstance(view, NumbersView), "chosen above"
    seen, _ = learner.reset(seed=seed)
    for _ in range(steps):
        actions = act(seen)
        following, _, terminated, truncated, _ = learner.step(actions)
        over = terminated | truncated
        if over.any() and learner.metadata["autoreset_mode"] is AutoresetMode.DISABLED:
            following, _ = learner.reset(options={"reset_mask": over})
        naive += [
            Transition(view.with_action(view.scene(a), u), view.scene(b))
            for a, u, b in zip(seen, actions, following, strict=True)
        ]
        seen = np.array(following)
    return kept, naive


def _policy(study: Study, learner: VectorModelLearner, seed: int) -> Callable[[Any], Any]:
    """Random actions; a car is driven by pumping, so that it meets its wall and its goal."""
    rng, single = np.random.default_rng(seed), made(study)
    learner.action_space.seed(seed)
    single.action_space.seed(seed)
    if not study.env.startswith("MountainCar"):
        return lambda seen: learner.action_space.sample()
    return lambda seen: np.array([pumping(each, single, rng) for each in seen])


def _modes(model: WorldModel) -> str:
    return "; ".join(mode.formula(4) for mode in model.modes("self", "x"))


def _unexplained(model: WorldModel) -> float:
    """Share of x that no mode explains."""
    part = model.property_model("self", "x").clusterer
    return part.noise_examples / max(part.seen, 1)


def policy_speed(steps: int, repeats: int) -> Iterator[Figure]:
    """How fast PPO trains with the callback (learning in a process of its own), over its speed without.

    So many trainings of each kind, in turns; one torch thread; those of the first turn are short and don't count. The
    clock on the wall is right on two idle cores only. Hence two more figures that hold on busy ones too: processor time
    of the agent's own process, and the clock where a process that does nothing but count stands in for the learner.
    """
    import torch

    torch.set_num_threads(1)
    kinds: dict[str, list[tuple[float, float]]] = {"bare": [], "watched": [], "beside a counter": []}
    for turn in range(repeats + 1):
        for kind, times in kinds.items():
            spent = _trained(steps if turn else ROLLOUT * ENVS, kind)
            times.extend([spent] if turn else [])
    for kind, times in kinds.items():
        wall, own = np.median(times, axis=0)
        print(f"PPO, {steps:,} steps, {kind}: {wall:.1f} s, of which the agent's process works {own:.1f} s")
    for what, reference, clock in (
        ("PPO's speed with the callback, over that without", "bare", 0),
        ("... by processor time of the agent's process", "bare", 1),
        ("... by the clock, beside a process that counts", "beside a counter", 0),
    ):
        for other, watched in zip(kinds[reference], kinds["watched"], strict=True):
            yield what, 0.8, other[clock] / watched[clock], ">="


def _trained(steps: int, kind: str) -> tuple[float, float]:
    """Seconds on the wall and of processor time of one training of PPO, defaults throughout, in `ENVS` CartPoles."""
    from stable_baselines3 import PPO
    from stable_baselines3.common.env_util import make_vec_env

    from relgym.wrappers.sb3 import ModelCallback

    cars = make_vec_env("CartPole-v1", ENVS, seed=0)
    agent = PPO("MlpPolicy", cars, n_steps=ROLLOUT, seed=0, device="cpu")
    callback = ModelCallback(background=QUEUE, predict=False) if kind == "watched" else None
    counter = multiprocessing.get_context("spawn").Process(target=_count, daemon=True)
    if kind == "beside a counter":
        counter.start()
    start = np.array([time.perf_counter(), time.process_time()])
    agent.learn(steps, callback=callback)
    spent = np.array([time.perf_counter(), time.process_time()]) - start
    if counter.is_alive():
        counter.terminate()
    if callback is not None:
        dropped = callback.dropped
        callback.close()
        print(f"  {steps:,} steps, {dropped:,} found the queue full; {callback.world}")
    return float(spent[0]), float(spent[1])


def _count() -> None:
    """Keep a core busy."""
    for _ in itertools.count():
        pass
