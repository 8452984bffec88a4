"""Other people's envs, as streams of transitions, and how errors of one step are measured on them."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Any, Final

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from relgym.config import ModelConfig
from relgym.envs.views import NumbersView
from relgym.model.percepts.scenes import next_values, unwrapped
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ACTION, Transition

__all__ = [
    "STUDIES",
    "Lesson",
    "Policy",
    "Step",
    "Study",
    "at_random",
    "collect",
    "errors",
    "learned",
    "made",
    "nrmse_d",
    "pumping",
    "racing",
    "recommended",
    "regular",
    "size",
    "stream",
    "view_of",
]

Policy = Callable[[Any, gym.Env[Any, Any], np.random.Generator], Any]


@dataclass(frozen=True, slots=True)
class Study:
    """An env and how it is looked at.

    Attributes
    ----------
    env
        Gymnasium's id.
    names
        Names of the observation's numbers.
    angles
        Pairs of them that are cosine and sine of an angle, and its name.
    special
        Whether next values show a limit at work (a wall, a clip): property vectors ``(n, d)`` to ``(n,)``.
    weights
        Coefficients of the law in the env's source: property, name of the term, value.
    """

    env: str
    names: tuple[str, ...]
    angles: tuple[tuple[str, str, str], ...] = ()
    special: Callable[[NDArray[np.float64]], NDArray[np.bool_]] | None = None
    weights: tuple[tuple[str, str, float], ...] = ()


def _mountain_limit(s: NDArray[np.float64]) -> NDArray[np.bool_]:
    found: NDArray[np.bool_] = (s[:, 0] <= -1.2) | (np.abs(s[:, 1]) >= 0.07)
    return found


def _pendulum_limit(s: NDArray[np.float64]) -> NDArray[np.bool_]:
    found: NDArray[np.bool_] = np.abs(s[:, 0]) >= 8.0
    return found


def _mountain(force: float) -> tuple[tuple[str, str, float], ...]:
    return (("v", "cos(3 x)", -0.0025), ("v", "action.a", force), ("x", "v'", 1.0))


STUDIES: Final = {
    "mountain": Study("MountainCar-v0", ("x", "v"), (), _mountain_limit, _mountain(0.001)),
    "mountain-continuous": Study(
        "MountainCarContinuous-v0", ("x", "v"), (), _mountain_limit, _mountain(0.0015)
    ),
    "cart": Study(
        "CartPole-v1",
        ("x", "xdot", "th", "thdot"),
        weights=(("x", "xdot", 0.02), ("th", "thdot", 0.02)),
    ),
    "pendulum": Study(
        "Pendulum-v1",
        ("c", "s", "w"),
        (("c", "s", "th"),),
        _pendulum_limit,
        (("w", "sin(th)", 0.75), ("w", "action.a", 0.15), ("th", "w'", 0.05)),
    ),
    "acrobot": Study(
        "Acrobot-v1", ("c1", "s1", "c2", "s2", "w1", "w2"), (("c1", "s1", "th1"), ("c2", "s2", "th2"))
    ),
    "lander": Study("LunarLander-v3", ("px", "py", "vx", "vy", "th", "w", "left", "right")),
}
"""Classic control and LunarLander."""


@dataclass(frozen=True, slots=True)
class Step:
    """A transition, and whether the episode was terminated by it."""

    transition: Transition
    terminated: bool


@dataclass(frozen=True, slots=True)
class Lesson:
    """Transitions of an env.

    Attributes
    ----------
    view
        What made them.
    transitions
        In the order in which they came.
    terminated
        Which of them ended an episode, shape ``(n,)``.
    """

    view: NumbersView
    transitions: list[Transition]
    terminated: NDArray[np.bool_]

    @property
    def before(self) -> NDArray[np.float64]:
        """Scenes with their actions, shape ``(n, width)``."""
        return np.array([t.before.vector for t in self.transitions])

    @property
    def after(self) -> NDArray[np.float64]:
        """Next property vectors of the object `self`, shape ``(n, d)``."""
        return np.array([t.after["self"].values for t in self.transitions])

    @property
    def own(self) -> slice:
        """Where the properties of `self` lie in `before`."""
        return self._place("self")

    @property
    def action(self) -> slice:
        """Where the action's numbers lie in `before`."""
        return self._place(ACTION)

    @property
    def change(self) -> NDArray[np.float64]:
        """What became of each property of `self`, angles the short way round, shape ``(n, d)``."""
        layout = self.transitions[0].before.layout
        rows = [
            unwrapped(layout, t.before.vector, next_values(t.before, t.after)) - t.before.vector
            for t in self.transitions
        ]
        return np.array(rows)[:, self.own]

    def _place(self, name: str) -> slice:
        layout = self.transitions[0].before.layout
        index = layout.index(name)
        start = layout.offsets[index]
        return slice(start, start + len(layout.types[index].properties))


def at_random(_: Any, env: gym.Env[Any, Any], rng: np.random.Generator) -> Any:
    """Any action."""
    return env.action_space.sample()


def pumping(observation: Any, env: gym.Env[Any, Any], rng: np.random.Generator) -> Any:
    """Push the way the car moves, so that it swings up and meets walls; one action in ten is random."""
    if rng.random() < 0.1:
        return env.action_space.sample()
    forward = observation[1] >= 0.0
    if isinstance(env.action_space, gym.spaces.Discrete):
        return 2 if forward else 0
    return np.array([1.0 if forward else -1.0], dtype=np.float32)


def racing(observation: Any, env: gym.Env[Any, Any], rng: np.random.Generator) -> Any:
    """Roll back from just below the goal, pushing all the way: so the car gets fast enough to be held at its limit.

    A car that is pumped reaches that in 0 to 3 of 20,000 steps. One action in twenty is random.
    """
    if rng.random() < 0.05:
        return env.action_space.sample()
    x, v = map(float, observation)
    energy, goal = 0.5 * v * v + 0.0025 / 3.0 * np.sin(3.0 * x), 0.0025 / 3.0 * np.sin(1.5)
    push = -1 if v < 0.0 or energy > 0.99 * goal else int(energy < 0.97 * goal)
    return (
        push + 1 if isinstance(env.action_space, gym.spaces.Discrete) else np.array([push], dtype=np.float32)
    )


def made(study: Study) -> gym.Env[Any, Any]:
    """The study's env."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Box2D's bindings warn when they are imported
        return gym.make(study.env)


def view_of(study: Study) -> NumbersView:
    """The study's view of its env."""
    env = made(study)
    found = NumbersView(env.observation_space, env.action_space, names=study.names, angles=study.angles)
    env.close()
    return found


def stream(study: Study, view: NumbersView, seed: int, policy: Policy = at_random) -> Iterator[Step]:
    """Step an env under a policy without end; episodes follow one another."""
    env = made(study)
    env.action_space.seed(seed)
    rng = np.random.default_rng(seed)
    observation, _ = env.reset(seed=seed)
    scene = view.scene(observation)
    while True:
        action = policy(observation, env, rng)
        observation, _, terminated, truncated, _ = env.step(action)
        following = view.scene(observation, last=scene)
        yield Step(Transition(view.with_action(scene, action), following), bool(terminated))
        scene = following
        if terminated or truncated:
            observation, _ = env.reset()
            scene = view.scene(observation)


def collect(study: Study, steps: int, seed: int, policy: Policy = at_random) -> Lesson:
    """So many transitions of `stream`."""
    view = view_of(study)
    found = list(islice(stream(study, view, seed, policy), steps))
    return Lesson(view, [s.transition for s in found], np.array([s.terminated for s in found]))


def learned(lesson: Lesson, config: ModelConfig | None = None) -> WorldModel:
    """A model of all transitions, its classifiers up to date."""
    model = WorldModel(lesson.view.schema, config)
    for transition in lesson.transitions:
        model.learn_one(transition)
    model.finish()
    return model


def recommended(model: WorldModel) -> tuple[str, ...]:
    """Features that the model itself advises to switch on, of all its targets."""
    return tuple(dict.fromkeys(kind for advice in model.advice() for kind in advice.features))


def nrmse_d(model: WorldModel, lesson: Lesson, keep: NDArray[np.bool_] | None = None) -> dict[str, float]:
    """Errors of one step by property of the object `self`.

    Parameters
    ----------
    model, lesson
        What predicts, and what really followed.
    keep
        Which transitions count, shape ``(n,)``; default: all. Those alone give the standard deviation of the change;
        where they all change alike, it is that of all.
    """
    error, change = errors(model, lesson), lesson.change
    keep = np.ones(len(error), dtype=bool) if keep is None else keep
    found = {}
    for k, name in enumerate(lesson.view.schema.type_of("self").properties):
        spread = float(change[keep, k].std()) or float(change[:, k].std()) or 1.0
        found[name] = float(np.sqrt(np.square(error[keep, k]).mean())) / spread
    return found


def size(
    error: NDArray[np.float64], change: NDArray[np.float64], keep: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """nRMSE-d on some rows: root mean square error over the change's standard deviation there, shape ``(d,)``."""
    spread = np.maximum(change[keep].std(axis=0), 1e-12)
    found: NDArray[np.float64] = np.sqrt(np.square(error[keep]).mean(axis=0)) / spread
    return found


def errors(model: WorldModel, lesson: Lesson) -> NDArray[np.float64]:
    """Predicted minus observed next values of `self`, angles the short way round, shape ``(n, d)``."""
    layout = lesson.transitions[0].before.layout
    found = model.predict_batch(layout, lesson.before).vectors[:, lesson.own] - lesson.after
    kind = lesson.view.schema.type_of("self")
    for k, name in enumerate(kind.properties):
        if name in kind.angles:
            found[:, k] = np.remainder(found[:, k] + np.pi, 2.0 * np.pi) - np.pi
    return found


def regular(study: Study, lesson: Lesson) -> NDArray[np.bool_]:
    """Transitions at which no limit is at work."""
    if study.special is None:
        return np.ones(len(lesson.transitions), dtype=bool)
    return ~study.special(lesson.after)
