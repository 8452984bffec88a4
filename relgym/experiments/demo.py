"""The demonstration: the laws of two small worlds, learned online from scratch, measured and drawn."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import relgym  # noqa: F401 - registers the envs
from relgym.experiments.analytic import AnalyticModes
from relgym.experiments.data import BALL_EXPERIMENTS, ball_episodes, truck_episodes
from relgym.experiments.episodes import Episode
from relgym.experiments.evaluate import Evaluation, evaluate, explicable
from relgym.experiments.plots import Trajectory, draw_curves, draw_trajectories
from relgym.experiments.rollouts import RolloutErrors, imagined, rollouts
from relgym.experiments.truck_check import TruckCheck, check_truck
from relgym.model.report import ModelReport
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ACTION
from relgym.wrappers import ModelLearner, StepReport

__all__ = [
    "DemoOutcome",
    "Demonstration",
    "EpisodeErrors",
    "Figures",
    "demonstrations",
    "draw",
    "learn_online",
    "measure",
    "trajectories",
]


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
    """What was measured of a model on episodes it hasn't learned from."""

    seed: int
    evaluation: Evaluation
    rollouts: RolloutErrors
    truck: TruckCheck | None

    def __str__(self) -> str:
        return "\n\n".join(
            str(part) for part in (self.truck, self.evaluation, self.rollouts) if part is not None
        )


@dataclass(frozen=True, slots=True)
class DemoOutcome:
    """What came of one demonstration; its text is what ``relgym demo`` prints.

    Attributes
    ----------
    title
        The world.
    transitions, seconds
        How many were learned from, one at a time, and how long that took.
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
    report: ModelReport
    figures: Figures
    curve: tuple[EpisodeErrors, ...]
    file: str

    def __str__(self) -> str:
        rule = "━" * 80
        head = (
            f"{rule}\n{self.title}\n{self.transitions:,} transitions, learned online in {self.seconds:.1f} s"
        )
        return f"{head}\n{rule}\n\n{self.report}\n\n{rule}\nOn fresh scenes\n{rule}\n\n{self.figures}\n"


def demonstrations(*, quick: bool = False) -> tuple[Demonstration, ...]:
    """Truck-push with frictions resampled at every step (§3.1), and ball-box-ramp, experiment 1 (§4.3).

    Parameters
    ----------
    quick
        A tenth of the episodes: for a first look, and for tests.
    """
    return _truck(quick), _ball(quick)


def _truck(quick: bool) -> Demonstration:
    episodes = 8 if quick else 48
    return Demonstration(
        name="truck",
        title="truck-push: a truck pushes stacks of boxes",
        env_id="relgym/TruckPush-v0",
        arguments={"resample": "step", "task": None},
        config={},
        episodes=episodes,
        test_episodes=episodes,
        training=lambda seed: islice(truck_episodes(seed=seed), episodes),
        testing=lambda seed: islice(truck_episodes(seed=seed, test=True), episodes),
        mover="truck",
        drawn=1,
    )


def _ball(quick: bool) -> Demonstration:
    setting = BALL_EXPERIMENTS[1]
    episodes, test_episodes = (8, 12) if quick else (setting.episodes, 120)
    friction = setting.frictions[0]
    return Demonstration(
        name="ball",
        title="ball-box-ramp: a ball flies, bounces and slides",
        env_id="relgym/BallBoxRamp-v0",
        arguments={"incline": setting.incline, "elasticity": setting.elasticity, "friction": friction},
        config={"frames": "world"},  # the thesis' tables; without it, three contact laws
        episodes=episodes,
        test_episodes=test_episodes,
        training=lambda seed: islice(ball_episodes(1, seed=seed), episodes),
        testing=lambda seed: islice(ball_episodes(1, seed=seed, test=True), test_episodes),
        mover="ball",
        drawn=3,
        laws=setting.modes(),
    )


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
        counted = explicable(episode, shown.laws)
        wrong: dict[str, list[bool]] = {}
        for k, action in enumerate(_actions(episode)):
            *_, info = env.step(action)
            for target, is_wrong in _verdicts(info["relgym"], episode):
                if target not in counted or counted[target][k]:
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
    return Figures(seed, evaluate(model, episodes, shown.laws), rollouts(model, episodes[:80]), truck)


def trajectories(model: WorldModel, shown: Demonstration, *, seed: int) -> list[Trajectory]:
    """The first episodes of a test set, real and imagined; not a selection."""
    found = []
    for episode in islice(shown.testing(seed), shown.drawn):
        dream, steps = imagined(model, episode.vectors, episode.layout)
        title = f"{shown.name}, which hits a corner" if episode.truth.corner.any() else shown.name
        found.append(Trajectory(title, episode.scene(0), shown.mover, episode.vectors, dream, steps))
    return found


def draw(folder: Path, outcomes: Iterable[DemoOutcome], paths: Sequence[Trajectory]) -> dict[str, str]:
    """Write the pictures of some demonstrations into a folder; their files by what they show.

    Raises
    ------
    ConfigError
        matplotlib or pygame isn't installed.
    """
    curves = {
        outcome.title: {t: [b.wrong.get(t, 0.0) for b in outcome.curve] for t in outcome.curve[-1].wrong}
        for outcome in outcomes
    }
    return {
        "trajectories": str(draw_trajectories(folder / "trajectories.png", paths)),
        "learning curves": str(draw_curves(folder / "learning.png", curves)),
    }


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
