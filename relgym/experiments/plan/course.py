"""One planning agent's course of learning, tested again and again: what it learns, and what it plans in."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from time import process_time
from typing import Any, Final, Literal, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from relgym.envs.scripted import push_knowing
from relgym.envs.tasks import Task
from relgym.envs.truck_push import GRAVITY
from relgym.experiments.dyna import arms as dyna_arms
from relgym.experiments.dyna import course as dyna
from relgym.experiments.dyna.course import ENOUGH, EPISODES, solved_at
from relgym.model.predicting.prediction import OUTCOMES, Outcome
from relgym.planning import EnvSimulator, Objective, Planner, PlanningAgent, Steps, TreeSearch
from relgym.planning.review import right
from relgym.scene.objects import Float1D, Float2D, Scene, Transition
from relgym.wrappers.action_repeat import ActionRepeat
from relgym.wrappers.dyna.acting import acting_all
from relgym.wrappers.dyna.recorder import Experience, TransitionRecorder
from relgym.wrappers.dyna.trainer import ModelTrainer

__all__ = [
    "ARMS",
    "COURSES",
    "Arm",
    "Course",
    "Tests",
    "ceiling",
    "knowing",
    "learning",
    "played",
    "recovering",
]

_FIRST_EPISODE: Final = 50_000
"""Seed of the first test episode: those of the agents that dream, far from those of training."""

_FRESH: Final = 40
"""Episodes of fresh steps that laws and task are tested on: at random and by who knows, in turn."""

_KNOWN: Final = 0.99
"""Share of the fresh steps that have to be right."""

_THROWN: Final = 0.12
"""Most that a ball is thrown up by at the beginning of a fresh episode, in units a step: no random play comes to the
ceiling, but what touches it obeys a law, too."""

_TOLERANCE: Final = 1e-6
"""How far a prediction of a fresh step's motion may be off."""

_PREDICTED: Final = OUTCOMES.index(Outcome.PREDICTED)

_CHANGE: Final = 1_000
"""Real steps after which the world changes."""


@dataclass(frozen=True)
class Course:
    """An env and how agents plan in it.

    Attributes
    ----------
    name, title
        For files, and for people.
    env_id, arguments
        What `gymnasium.make` is asked for.
    repeat
        Env steps that a decision lasts.
    limit
        Decisions that an episode lasts at most; agents that learn find out by themselves.
    every
        Decisions between two tests.
    final
        Decisions after which there is a test in any case; None: none.
    agent
        Parameters of `PlanningAgent` that aren't the default.
    search
        How to plan.
    expert
        A controller that knows the way to the goal; None: there is none.
    """

    name: str
    title: str
    env_id: str
    arguments: Mapping[str, Any] = field(default_factory=dict)
    repeat: int = 1
    limit: int | None = None
    every: int = 50
    final: int | None = None
    agent: Mapping[str, Any] = field(default_factory=dict)
    search: TreeSearch = field(default_factory=TreeSearch)
    expert: Callable[[Scene], Any] | None = None

    def make(self) -> gym.Env[Any, Any]:
        """Its env, a step at a time."""
        return gym.make(self.env_id, disable_env_checker=True, **self.arguments)


_BALL: Final = Course(
    "ball",
    "BallGoal",
    "relgym/BallGoal-v0",
    repeat=5,
    limit=100,
    final=200,
    agent={"commit": 10},
    search=TreeSearch(horizon=100, batch=256),
)

COURSES: Final = {
    course.name: course
    for course in (
        Course(
            "truck",
            "TruckPush",
            "relgym/TruckPush-v0",
            limit=20,
            final=300,
            search=TreeSearch(horizon=20, batch=512),
            expert=push_knowing,
        ),
        _BALL,
        replace(
            _BALL,
            name="materials",
            title="BallGoal, five materials",
            arguments={"elasticity": {"floor": 0.9, "ramp": 0.7, "ceiling": 0.6, "box": 0.5, "wall": 0.3}},
        ),
    )
}


@dataclass(frozen=True, slots=True)
class Arm:
    """What is planned in.

    Attributes
    ----------
    name, title
        For files, and for people.
    model
        Learned by relgym, or by an ensemble of nets.
    task
        Whether reward and termination are learned or given; None: nothing pays.
    explores
        Whether it looks for what is new, or acts at random until it has learned.
    patience
        How many times as many real decisions as others it may take.
    """

    name: str
    title: str
    model: Literal["relational", "neural"] = "relational"
    task: Literal["learned", "given"] | None = "learned"
    explores: bool = True
    patience: int = 1


ARMS: Final = {
    arm.name: arm
    for arm in (
        Arm("relgym", "planner, relgym"),
        Arm("relgym-given", "planner, relgym, reward given", task="given"),
        Arm("greedy", "planner, relgym, without exploration", explores=False),
        Arm("ensemble", "planner, MLP ensemble", model="neural", patience=5),
    )
}


class Played(NamedTuple):
    """How an episode ended, how many decisions it took, and processor time to choose them."""

    seen: Any
    info: dict[str, Any]
    decisions: int
    seconds: float


def played(env: gym.Env[Any, Any], predict: Callable[[Any, Any], tuple[Any, Any]], seed: int) -> Played:
    """Play one episode: an agent predicts its action, and its next state, from an observation and its state."""
    seen, info = env.reset(seed=seed)
    state, over, decisions, seconds = None, False, 0, 0.0
    while not over:
        started = process_time()
        action, state = predict(seen, state)
        seconds += process_time() - started
        decisions += 1
        seen, _, terminated, truncated, info = env.step(action)
        over = bool(terminated or truncated)
    return Played(seen, info, decisions, seconds)


class Tests:
    """Fixed episodes, one after the other.

    Parameters
    ----------
    course
        Where.
    episodes
        How many, of `EPISODES`.
    first
        Number of the first one.
    failures
        Most episodes that may fail: one more ends a test. None: all episodes are played.

    Attributes
    ----------
    decisions, seconds
        Of all tests so far: decisions, and processor time to choose them.
    """

    def __init__(
        self, course: Course, episodes: int = EPISODES, *, first: int = 0, failures: int | None = None
    ) -> None:
        env = course.make()
        self._env = ActionRepeat(env, course.repeat) if course.repeat > 1 else env
        self._first, self._episodes = first, episodes
        self._failures = episodes if failures is None else failures
        self.decisions, self.seconds = 0, 0.0

    def successes(self, agent: Any) -> tuple[int, int]:
        """How many episodes the agent ends well, and of how many; ``info["is_success"]`` at the end counts."""
        good = 0
        for k in range(self._episodes):
            episode = played(self._env, agent.predict, _FIRST_EPISODE + self._first + k)
            self.decisions, self.seconds = self.decisions + episode.decisions, self.seconds + episode.seconds
            good += bool(episode.info["is_success"])
            if k + 1 - good > self._failures:
                return good, k + 1
        return good, self._episodes


class NeuralSimulator:
    """A `NeuralWorldModel`, its rewards and ends included, as a simulator.

    Parameters
    ----------
    model
        The model.
    like
        An env whose observations are scenes.
    repeat
        Env steps that a decision lasts.
    task
        Gives rewards and ends, if they aren't learned.
    """

    def __init__(self, model: Any, like: gym.Env[Any, Any], repeat: int, task: Task | None = None) -> None:
        self.model, self._repeat, self._task = model, repeat, task
        self.action_space, self.observation_space = like.action_space, like.observation_space
        self._layout = model.schema.layout(name for name, kind in model.schema.objects if kind != "action")

    def state(self, observation: Any) -> Float1D:
        """State vector that an observation shows."""
        scene = observation if isinstance(observation, Scene) else self.model.schema.scene(observation)
        self._layout = scene.layout
        return scene.vector

    def prepare(self) -> None:
        """Nothing to do."""

    def step(self, states: Float2D, actions: NDArray[Any]) -> Steps:
        """Follow n actions from n states."""
        found, rewards = states.copy(), np.zeros(len(states))
        ended = np.zeros(len(states), dtype=np.bool_)
        for _ in range(self._repeat):
            going = np.flatnonzero(~ended)
            if not len(going):
                break
            whole, joined = acting_all(self.model.schema, self._layout, found[going], actions[going])
            told = self.model.predict_batch(whole, joined)
            after = np.delete(told.vectors, whole.slice(whole.index("action")), axis=1)
            if self._task is None:
                paid, over = self.model.predict_rewards(whole, joined)
            else:
                outcome = self._task.evaluate(self._layout, found[going], actions[going], after)
                paid, over = outcome.rewards, outcome.terminated
            found[going] = after
            rewards[going] += paid
            ended[going] = over
        return Steps(found, rewards, ended, np.full(len(states), bool(self.model.ensemble.ready)))


def make_agent(course: Course, arm: Arm, *, seed: int, env: gym.Env[Any, Any] | None = None) -> PlanningAgent:
    """An agent that has seen nothing yet, in the course's env or another one with the same spaces."""
    env = course.make() if env is None else env
    options: dict[str, Any] = {"search": course.search, "repeat": course.repeat, "seed": seed, **course.agent}
    if not arm.explores:
        options["exploration"] = 0.0
    if arm.model == "neural":

        def simulated(trainer: ModelTrainer) -> NeuralSimulator:
            given: Any = getattr(env.unwrapped, "task", None) if arm.task == "given" else None
            return NeuralSimulator(trainer.model, env, course.repeat, given)

        options |= {"model": dyna_arms.nets_of(env, seed=seed), "simulator": simulated}
    return PlanningAgent(env, task=arm.task, **options)


def learning(*, course: str, arm: str, seed: int, steps: int, episodes: int = EPISODES) -> dict[str, Any]:
    """One agent's course of learning.

    Parameters
    ----------
    course, arm
        Names in `COURSES` and `ARMS`.
    seed
        Of everything random.
    steps
        Real decisions at most; the run ends sooner with two tests in a row of which 90 % succeed.
    episodes
        Of a test.

    Returns
    -------
    ``curve``, (real decisions, successes in %) at each test; one that can't succeed any more is broken off, and its
    share is that of the episodes played. ``solved_at``, decisions at the second good test in a row or None; ``final``,
    successes in % of a whole test at `Course.final`, or None; ``seconds`` of processor time without tests,
    ``decision``, mean processor time of a decision in the last test, in seconds; ``laws``, what was learned.
    """
    place = COURSES[course]
    agent = make_agent(place, ARMS[arm], seed=seed)
    spent = 0.0

    def tested(at: int, *, whole: bool = False) -> tuple[int, float]:
        nonlocal spent
        started = process_time()
        agent.learn(at * place.repeat)
        spent += process_time() - started
        most = episodes if whole else episodes * (EPISODES - ENOUGH) // EPISODES
        tests = Tests(place, episodes, failures=most)
        # Who has only acted at random so far has nothing to show: at most what random actions reach.
        good, played = tests.successes(agent) if agent.ready else (0, episodes)
        told = f"{course}, {arm}, seed {seed}: {good} of {played} after {at:,}"
        print(told, file=sys.stderr, flush=True)
        return round(good * EPISODES / played), tests.seconds / max(1, tests.decisions)

    curve: list[tuple[int, int]] = []
    decision = 0.0
    for at in range(place.every, steps * ARMS[arm].patience + 1, place.every):
        good, decision = tested(at)
        curve.append((at, good))
        if solved_at(curve) is not None:
            break
    final = None if place.final is None else dict(curve).get(place.final)
    if place.final is not None and final is None and curve and curve[-1][0] < place.final:
        final = tested(place.final, whole=True)[0]
    describe = getattr(agent.model, "describe", None)
    return {
        "curve": curve,
        "solved_at": solved_at(curve),
        "final": final,
        "seconds": spent,
        "decision": decision,
        "laws": describe() if describe is not None else "",
    }


def knowing(*, course: str, explores: bool, seed: int, steps: int, every: int = 25) -> dict[str, Any]:
    """How many real decisions it takes to know a world: of 99 % of fresh steps all laws, and the task if it counts.

    Where there is an expert fresh steps are its own and those of random play, in equal shares, and reward and end
    count. In BallGoal the agent has no task, and it is laws of contact that count: fresh steps are those in which the
    ball touches something, as it is thrown or left where it lies and random play goes on with it, and of each body 99 %
    of those that touch it have to be right of how the ball moves.

    Parameters
    ----------
    course
        Name in `COURSES`.
    explores
        Whether the agent looks for what is new, or acts at random throughout, in whole episodes.
    seed
        Of everything random.
    steps
        Real decisions at most.
    every
        Real decisions between two tests.

    Returns
    -------
    ``curve``: (real decisions, share of laws right, share of rewards and ends right) at each test; ``known_at``: real
    decisions at the first test at which both are enough, or None.
    """
    place = COURSES[course]
    arm, options = ARMS["relgym"], dict[str, Any]()
    if place.expert is None:
        arm, options = replace(arm, task=None), {"random_steps": 0}
    if not explores:
        options = {"random_steps": 10**9, "restarts": False}
    agent = make_agent(replace(place, agent={**place.agent, **options}), arm, seed=seed)
    fresh, known = _fresh_steps(place), right if place.expert is not None else _moves_right
    curve: list[tuple[int, float, float]] = []
    known_at = None
    for at in range(every, steps + 1, every):
        agent.learn(at * place.repeat)
        shares = [known(agent.model, [real.transition for real in group]).mean() for group in fresh]
        task = 1.0 if place.expert is None else float(1.0 - agent.mistaken(fresh[0]).mean())
        curve.append((at, float(min(shares)), task))
        told = f"{course}, explores: {explores}, seed {seed}, {at:,}: {curve[-1][1:]}"
        print(told, file=sys.stderr, flush=True)
        if min(curve[-1][1:]) >= _KNOWN:
            known_at = at
            break
    return {"curve": curve, "known_at": known_at}


def _fresh_steps(course: Course) -> list[list[Experience]]:
    """Steps that an agent is tested on: all in one group, or one for each body that is touched."""
    made = course.make()
    env = TransitionRecorder(made if course.expert is not None else _Throws(made, np.random.default_rng(0)))
    env.action_space.seed(0)
    found: dict[str, list[Experience]] = {}
    for k in range(_FRESH):
        env.reset(seed=2 * _FIRST_EPISODE + k)
        over, step, action = False, 0, None
        while not over:
            if course.expert is not None and k % 2 == 0:
                action = course.expert(env.get_wrapper_attr("scene"))
            elif step % course.repeat == 0:
                action = env.action_space.sample()
            touched = (
                [""] if course.expert is not None else [c.other for c in env.get_wrapper_attr("contacts")]
            )
            _, _, terminated, truncated, _ = env.step(action)
            over, step = terminated or truncated, step + 1
            real = env.take()
            for name in touched:
                found.setdefault(name, []).extend(real)
    return list(found.values())


def _moves_right(model: Any, transitions: Sequence[Transition]) -> NDArray[np.bool_]:
    """Of which transitions, all of one layout, a model is right how bodies move; shape ``(n,)``."""
    now, then = transitions[0].before.layout, transitions[0].after.layout
    told = model.predict_batch(now, np.stack([t.before.vector for t in transitions]))
    seen = np.stack([t.after.vector for t in transitions])
    good = np.ones(len(seen), dtype=np.bool_)
    for k, (name, prop) in enumerate(told.parts):
        if now.types[now.index(name)].has_body:
            expected = told.vectors[:, now.column(now.index(name), prop)]
            off = seen[:, then.column(then.index(name), prop)] - expected
            good &= (told.outcomes[:, k] == _PREDICTED) & (np.abs(off) <= _TOLERANCE)
    return good


class _Throws(gym.Wrapper[Any, Any, Any, Any]):
    """Begins every other episode with the ball on its way up, at some angle and speed."""

    def __init__(self, env: gym.Env[Any, Any], rng: np.random.Generator) -> None:
        super().__init__(env)
        self._rng, self._begun = rng, 0

    def reset(self, **how: Any) -> tuple[Any, dict[str, Any]]:
        """Begin an episode."""
        found = self.env.reset(**how)
        self._begun += 1
        if self._begun % 2:
            return found
        env: Any = self.env.unwrapped
        state, speed, angle = env.get_state(), self._rng.uniform(0.0, _THROWN), self._rng.uniform(0.0, np.pi)
        vector, layout, ball = state.vector.copy(), env.scene.layout, env.scene.layout.index("ball")
        vector[layout.column(ball, "vx")] = speed * np.cos(angle)
        vector[layout.column(ball, "vy")] = speed * np.sin(angle)
        return env.set_state(replace(state, vector=vector)), {**found[1], "scene": env.scene}


def recovering(*, seed: int, steps: int, episodes: int) -> dict[str, Any]:
    """What becomes of an agent that has learned everything when gravity, and all friction with it, is halved.

    Parameters
    ----------
    seed
        Of everything random.
    steps
        Real steps after the change.
    episodes
        Of a test.

    Returns
    -------
    ``curve``: (real steps since the change, successes in %) at each test in the world of that time; ``baseline``: the
    same of SAC, which is tested more seldom.
    """
    course = COURSES["truck"]
    later = replace(course, arguments={**course.arguments, "gravity": GRAVITY / 2.0})
    world = dyna_arms.ChangingWorld(course.make(), later.make(), _CHANGE)
    agent = make_agent(course, ARMS["relgym"], seed=seed, env=world)
    curve: list[tuple[int, int]] = []
    for at in range(0, steps + 1, course.every):
        agent.learn(_CHANGE + at)
        failures = episodes * (EPISODES - ENOUGH) // EPISODES
        tests = Tests(later if at else course, episodes, failures=failures)
        good, played = tests.successes(agent)
        curve.append((at, round(good * EPISODES / played)))
        print(f"changed world, seed {seed}: {curve[-1]}", file=sys.stderr, flush=True)
    sac = dyna.run(
        dyna_arms.COURSES["truck"],
        dyna_arms.ARMS["sac"],
        seed=seed,
        steps=_CHANGE + steps,
        to_the_end=True,
        change=dyna_arms.Change(_CHANGE, {"gravity": GRAVITY / 2.0}),
    )
    return {"curve": curve, "baseline": [(at - _CHANGE, good) for at, good in sac.curve if at >= _CHANGE]}


def ceiling(*, course: str, episodes: int = EPISODES) -> dict[str, Any]:
    """The same search in the exact engine: nothing is learned."""
    place = COURSES[course]
    objective = Objective(discount=PlanningAgent.DISCOUNT)
    tests = Tests(place, episodes)
    simulator = EnvSimulator(place.make(), repeat=place.repeat)
    good, played = tests.successes(Planner(simulator, place.search, objective, limit=place.limit))
    return {
        "successes": round(good * 100 / played),
        "decision": tests.seconds / max(1, tests.decisions),
        "episodes": episodes,
    }
