"""The demonstration: the laws of two small worlds, learned online from scratch, measured and drawn."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, wait
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, Protocol

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import relgym  # noqa: F401 - registers the envs
from relgym.experiments.analytic import AnalyticModes
from relgym.experiments.data import BALL_EXPERIMENTS, ball_episodes, truck_episodes
from relgym.experiments.episodes import Episode
from relgym.experiments.evaluate import Evaluation, evaluate
from relgym.experiments.plots import Curve, Imagined, Trajectory, draw_curves, draw_trajectories
from relgym.experiments.rollouts import imagined
from relgym.experiments.truck_check import TruckCheck, check_truck
from relgym.experiments.verdict import Verdict, verdict
from relgym.model.reports.report import ModelReport, report
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ACTION
from relgym.wrappers import ModelLearner, StepReport

__all__ = [
    "DemoOutcome",
    "Demonstration",
    "EpisodeErrors",
    "Figures",
    "demonstrate",
    "demonstrate_all",
    "demonstrations",
    "draw",
    "learn_online",
    "measure",
]

_FRESH = 1000
"""What is added to a seed for scenes to test on."""

_RULE = "━" * 80


@dataclass(frozen=True, slots=True)
class Demonstration:
    """One world to learn, and what to measure on it.

    Attributes
    ----------
    name
        Short name, also of files.
    title
        For people.
    env_id, arguments
        What to hand to ``gym.make``.
    config
        What differs from the learner's default parameters.
    episodes, test_episodes
        How many episodes to learn from, and to test on.
    training, testing
        From a seed to those episodes.
    mover
        Name of the object whose path is drawn.
    by
        What imagines, for people.
    beside
        Name of the demonstration of the same world in whose picture its roll-outs are drawn; none: one of its own.
    drawn
        How many episodes are drawn.
    laws
        The world's linear laws, as far as the test needs them.
    """

    name: str
    title: str
    env_id: str
    arguments: Mapping[str, Any]
    config: Mapping[str, Any]
    episodes: int
    test_episodes: int
    training: Callable[[int], Iterable[Episode]]
    testing: Callable[[int], Iterable[Episode]]
    mover: str
    by: str
    beside: str | None
    drawn: int
    laws: AnalyticModes | None = None

    def make(self) -> ModelLearner:
        """The env with an empty learner around it."""
        return ModelLearner(gym.make(self.env_id, **self.arguments), config=dict(self.config))


@dataclass(frozen=True, slots=True)
class EpisodeErrors:
    """Predictions made during one episode, each before the model learned from its outcome.

    Attributes
    ----------
    steps
        Number of transitions.
    wrong
        Share of wrong predictions of each target, by name (``ball.vx``).
    """

    steps: int
    wrong: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Figures:
    """What was measured of a model on episodes it hasn't learned from.

    Attributes
    ----------
    seed
        Of the test scenes.
    verdict
        How many steps and roll-outs are right; all count.
    evaluation
        Errors by what really happened, of steps that a linear law along the world's axes can explain.
    truck
        The truck's modes against Table 3.1.
    """

    seed: int
    verdict: Verdict
    evaluation: Evaluation
    truck: TruckCheck | None


@dataclass(frozen=True, slots=True)
class DemoOutcome:
    """What came of one demonstration; its text is what ``relgym demo`` prints.

    Attributes
    ----------
    title
        The world.
    transitions, seconds
        How many were learned from, one at a time, and how much processor time that took.
    text
        The model in words.
    report
        The model.
    figures
        How good it is.
    curve
        Errors of each episode, made before learning from it.
    file
        Where the model was saved.
    """

    title: str
    transitions: int
    seconds: float
    text: str
    report: ModelReport
    figures: Figures
    curve: tuple[EpisodeErrors, ...]
    file: str

    def __str__(self) -> str:
        head = [
            _RULE,
            self.title,
            str(self.figures.verdict),
            f"{self.transitions:,} transitions, learned online from nothing; {self.seconds:.0f} s of processor time.",
            _RULE,
        ]
        parts = ["\n".join(head), self.text, *([str(self.figures.truck)] if self.figures.truck else [])]
        return "\n\n".join(parts) + "\n"


class Told(Protocol):
    """Takes the name of a demonstration, and how many of its episodes are over."""

    def __call__(self, name: str, done: int, /) -> None:
        """Take note."""


def demonstrations(*, quick: bool = False) -> tuple[Demonstration, ...]:
    """What is shown, in this order: ball-box-ramp, experiment 1 (§4.3), by laws and by modes; truck-push (§3.1).

    Parameters
    ----------
    quick
        A tenth of the episodes: for a first look, and for tests.
    """
    ball = _ball(quick)
    modes = replace(
        ball,
        name="modes",
        title="The same stream in the thesis' modes, along the world's axes (frames=\"world\")",
        config={"frames": "world"},
        by="world-axis modes",
        beside=ball.name,
    )
    return ball, modes, _truck(quick)


def _ball(quick: bool) -> Demonstration:
    setting = BALL_EXPERIMENTS[1]
    episodes, test_episodes = (8, 12) if quick else (setting.episodes, 120)
    friction = setting.frictions[0]
    return Demonstration(
        name="ball",
        title="ball-box-ramp: a ball flies, bounces and slides",
        env_id="relgym/BallBoxRamp-v0",
        arguments={"incline": setting.incline, "elasticity": setting.elasticity, "friction": friction},
        config={},
        episodes=episodes,
        test_episodes=test_episodes,
        training=partial(_ball_episodes, episodes),
        testing=partial(_ball_episodes, test_episodes, test=True),
        mover="ball",
        by="default model",
        beside=None,
        drawn=3,
        laws=setting.modes(),
    )


def _truck(quick: bool) -> Demonstration:
    episodes = 8 if quick else 48
    return Demonstration(
        name="truck",
        title="truck-push: a truck pushes stacks of boxes, whose frictions are drawn anew at every step",
        env_id="relgym/TruckPush-v0",
        arguments={"resample": "step", "task": None},
        config={},
        episodes=episodes,
        test_episodes=episodes,
        training=partial(_truck_episodes, episodes),
        testing=partial(_truck_episodes, episodes, test=True),
        mover="truck",
        by="default model",
        beside=None,
        drawn=1,
    )


# Functions of a module, since other processes take demonstrations.
def _ball_episodes(count: int, seed: int, *, test: bool = False) -> Iterable[Episode]:
    return islice(ball_episodes(1, seed=seed, test=test), count)


def _truck_episodes(count: int, seed: int, *, test: bool = False) -> Iterable[Episode]:
    return islice(truck_episodes(seed=seed, test=test), count)


def demonstrate_all(
    shown: Sequence[Demonstration], out: Path, *, seed: int, jobs: int, told: Told
) -> Iterator[tuple[DemoOutcome, tuple[Imagined, ...]]]:
    """Carry out demonstrations, some at the same time; the results are the same.

    Parameters
    ----------
    shown
        Which.
    out
        Folder for the models.
    seed
        Of everything random.
    jobs
        How many processes, >= 1; 1: this one.
    told
        Is called with how far each is.

    Yields
    ------
    What came of each, in their order, as soon as it is known.
    """
    if jobs == 1:
        for each in shown:
            yield demonstrate(each, out, seed=seed, told=told)
        return
    start = multiprocessing.get_context("spawn")
    with start.Manager() as manager, ProcessPoolExecutor(jobs, start) as pool:
        news = manager.dict()
        running = [pool.submit(demonstrate, each, out, seed=seed, told=_Board(news)) for each in shown]
        for future in running:
            while not _over(future):
                for name, done in news.items():
                    told(name, done)
            yield future.result()


class _Board:
    """Where processes note how far they are."""

    def __init__(self, news: Any) -> None:
        self._news = news

    def __call__(self, name: str, done: int, /) -> None:
        self._news[name] = done


def _over(future: Future[Any]) -> bool:
    return bool(wait([future], timeout=0.2).done)


def demonstrate(
    shown: Demonstration, out: Path, *, seed: int, told: Told
) -> tuple[DemoOutcome, tuple[Imagined, ...]]:
    """Learn a world, save the model, measure it, and let it imagine the episodes that are drawn.

    Parameters
    ----------
    shown
        The world.
    out
        Folder for the model.
    seed
        Of everything random.
    told
        Is called at the end of each episode.
    """
    env, curve, started = shown.make(), list[EpisodeErrors](), time.process_time()
    for episode in learn_online(env, shown, seed=seed):
        curve.append(episode)
        told(shown.name, len(curve))
    seconds = round(time.process_time() - started, 2)
    file = out / f"{shown.name}.json"
    env.save(file)
    model, steps = env.model, sum(each.steps for each in curve)
    figures = measure(model, shown, seed=seed + _FRESH)
    outcome = DemoOutcome(
        shown.title, steps, seconds, model.describe(), report(model), figures, tuple(curve), str(file)
    )
    drawn = islice(shown.testing(figures.seed), shown.drawn)
    return outcome, tuple(Imagined(shown.by, *imagined(model, e.vectors, e.layout)) for e in drawn)


def learn_online(env: ModelLearner, shown: Demonstration, *, seed: int) -> Iterator[EpisodeErrors]:
    """Run the env through the world's episodes; its wrapper predicts, steps and learns, one transition each.

    Parameters
    ----------
    env
        What `Demonstration.make` returned; its model is being taught.
    shown
        The world.
    seed
        Determines scenes and actions.

    Yields
    ------
    The errors of each episode, as soon as it is over.
    """
    for episode in shown.training(seed):
        # The episode says where to begin and what to do; what then happens is the env's own.
        env.reset(seed=seed, options=dict(episode.configuration))
        wrong: dict[str, list[bool]] = {}
        for action in _actions(episode):
            *_, info = env.step(action)
            for target, is_wrong in _verdicts(info["relgym"], episode):
                wrong.setdefault(target, []).append(is_wrong)
        yield EpisodeErrors(len(episode), {target: float(np.mean(found)) for target, found in wrong.items()})


def measure(model: WorldModel, shown: Demonstration, *, seed: int) -> Figures:
    """Test a model on fresh scenes: one step ahead, and in roll-outs.

    Parameters
    ----------
    model
        The model; unchanged.
    shown
        The world.
    seed
        Of the test scenes.
    """
    episodes = list(shown.testing(seed))
    truck = check_truck(model, episodes, every=4) if shown.name == "truck" else None
    return Figures(seed, verdict(model, episodes), evaluate(model, episodes, shown.laws), truck)


def draw(
    folder: Path,
    shown: Sequence[Demonstration],
    outcomes: Sequence[DemoOutcome],
    dreams: Sequence[Sequence[Imagined]],
) -> dict[str, str]:
    """Write the pictures of some demonstrations into a folder; their files by what they show.

    Parameters
    ----------
    folder
        Where to.
    shown, outcomes, dreams
        The demonstrations and what came of them.

    Raises
    ------
    ConfigError
        matplotlib or pygame isn't installed.
    """
    paths: list[Trajectory] = []
    for k, each in enumerate(shown):
        if each.beside is None:
            others = [own for other, own in zip(shown, dreams, strict=True) if other.beside == each.name]
            paths += _trajectories(each, [dreams[k], *others], seed=outcomes[k].figures.seed)
    paths.sort(key=lambda shown: not shown.events)  # most is to be seen where something is marked
    curves = {
        f"{each.beside or each.name}: {each.by}": _curves(outcome)
        for each, outcome in zip(shown, outcomes, strict=True)
    }
    return {
        "real and imagined episodes": str(draw_trajectories(folder / "trajectories.png", paths)),
        "learning curves": str(draw_curves(folder / "learning.png", curves)),
    }


def _trajectories(
    shown: Demonstration, dreams: Sequence[Sequence[Imagined]], *, seed: int
) -> Iterator[Trajectory]:
    """The first episodes of a test set, real and imagined; not a selection."""
    for k, episode in enumerate(islice(shown.testing(seed), shown.drawn)):
        corner = np.flatnonzero(episode.truth.corner)
        events = ((int(corner[0]), "corner"),) if len(corner) else ()
        title = f"{shown.name}: fresh episode {k + 1}"
        mine = tuple(own[k] for own in dreams)
        yield Trajectory(title, episode.scene(0), shown.mover, episode.vectors, mine, events=events)


def _curves(outcome: DemoOutcome) -> list[Curve]:
    seen = np.cumsum([each.steps for each in outcome.curve]).tolist()
    targets = list(dict.fromkeys(target for each in outcome.curve for target in each.wrong))
    return [Curve(t, seen, [each.wrong.get(t, 0.0) for each in outcome.curve]) for t in targets]


def _actions(episode: Episode) -> Iterator[Any]:
    """The episode's actions in the units of the env's action space."""
    scale = episode.schema.action_scale
    if not scale:
        return (0 for _ in range(len(episode)))
    physical = episode.columns(ACTION, *(prop for prop, _, _ in scale))[:-1]
    low, high = np.array([[a, b] for _, a, b in scale]).T
    normalised: NDArray[np.float32] = (2.0 * (physical - low) / (high - low) - 1.0).astype(np.float32)
    return iter(normalised)


def _verdicts(told: StepReport, episode: Episode) -> Iterator[tuple[str, bool]]:
    """(target, whether its prediction was wrong) for every object of one step."""
    for name, prop in told.residuals:
        yield f"{episode.layout.types[episode.layout.index(name)].name}.{prop}", (name, prop) in told.wrong
