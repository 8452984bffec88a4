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
from relgym.experiments.blocks import Block
from relgym.experiments.data import BALL_EXPERIMENTS, ball_blocks, truck_blocks
from relgym.experiments.evaluate import Evaluation, evaluate, explicable
from relgym.experiments.plots import Trajectory, draw_curves, draw_trajectories
from relgym.experiments.rollouts import RolloutErrors, imagined, rollouts
from relgym.experiments.truck_check import TruckCheck, check_truck
from relgym.model.report import ModelReport
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ACTION
from relgym.wrappers import ModelLearner, StepReport

__all__ = [
    "BlockErrors",
    "DemoOutcome",
    "Demonstration",
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
    blocks, test_blocks
        How many blocks to learn from, and to test on.
    training, testing
        From a seed to those blocks.
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
    blocks: int
    test_blocks: int
    training: Callable[[int], Iterable[Block]]
    testing: Callable[[int], Iterable[Block]]
    mover: str
    drawn: int
    laws: AnalyticModes | None = None

    def make(self) -> ModelLearner:
        """The env with an empty learner around it."""
        return ModelLearner(gym.make(self.env_id, **self.arguments), config=dict(self.config))


@dataclass(frozen=True, slots=True)
class BlockErrors:
    """Predictions made during one block, each before the model learned from its outcome.

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
    """What was measured of a model on blocks it hasn't learned from."""

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
        Errors of each block, made before learning from it.
    file
        Where the model was saved.
    """

    title: str
    transitions: int
    seconds: float
    report: ModelReport
    figures: Figures
    curve: tuple[BlockErrors, ...]
    file: str

    def __str__(self) -> str:
        rule = "━" * 80
        head = (
            f"{rule}\n{self.title}\n{self.transitions:,} transitions, learned online in {self.seconds:.1f} s"
        )
        return f"{head}\n{rule}\n\n{self.report}\n\n{rule}\nOn fresh scenes\n{rule}\n\n{self.figures}\n"


def demonstrations(*, quick: bool = False) -> tuple[Demonstration, ...]:
    """Truck-push with frictions redrawn at every step (§3.1), and ball-box-ramp, experiment 1 (§4.3).

    Parameters
    ----------
    quick
        A tenth of the blocks: for a first look, and for tests.
    """
    return _truck(quick), _ball(quick)


def _truck(quick: bool) -> Demonstration:
    blocks = 8 if quick else 48
    return Demonstration(
        name="truck",
        title="truck-push: a truck pushes stacks of boxes",
        env_id="relgym/TruckPush-v0",
        arguments={"redraw": "step", "task": None},
        config={},
        blocks=blocks,
        test_blocks=blocks,
        training=lambda seed: islice(truck_blocks(seed=seed), blocks),
        testing=lambda seed: islice(truck_blocks(seed=seed, test=True), blocks),
        mover="truck",
        drawn=1,
    )


def _ball(quick: bool) -> Demonstration:
    setting = BALL_EXPERIMENTS[1]
    blocks, test_blocks = (8, 12) if quick else (setting.blocks, 120)
    friction = setting.frictions[0]
    return Demonstration(
        name="ball",
        title="ball-box-ramp: a ball flies, bounces and slides",
        env_id="relgym/BallBoxRamp-v0",
        arguments={"incline": setting.incline, "elasticity": setting.elasticity, "friction": friction},
        config={"frames": "world"},  # the thesis' tables; without it, three contact laws
        blocks=blocks,
        test_blocks=test_blocks,
        training=lambda seed: islice(ball_blocks(1, seed=seed), blocks),
        testing=lambda seed: islice(ball_blocks(1, seed=seed, test=True), test_blocks),
        mover="ball",
        drawn=3,
        laws=setting.modes(),
    )


def learn_online(env: ModelLearner, shown: Demonstration, *, seed: int) -> Iterator[BlockErrors]:
    """Run the env through the world's blocks; its wrapper predicts, steps and learns, one transition each.

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
    The errors of each block, as soon as it is over.
    """
    for block in shown.training(seed):
        # The block says where to begin and what to do; what then happens is the env's own.
        env.reset(seed=seed, options=dict(block.configuration))
        counted = explicable(block, shown.laws)
        wrong: dict[str, list[bool]] = {}
        for k, action in enumerate(_actions(block)):
            *_, info = env.step(action)
            for target, is_wrong in _verdicts(info["relgym"], block):
                if target not in counted or counted[target][k]:
                    wrong.setdefault(target, []).append(is_wrong)
        yield BlockErrors(len(block), {target: float(np.mean(found)) for target, found in wrong.items()})


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
    blocks = list(shown.testing(seed))
    truck = check_truck(model, blocks, every=4) if shown.name == "truck" else None
    return Figures(seed, evaluate(model, blocks, shown.laws), rollouts(model, blocks[:80]), truck)


def trajectories(model: WorldModel, shown: Demonstration, *, seed: int) -> list[Trajectory]:
    """The first episodes of a test set, real and imagined; not a selection."""
    found = []
    for block in islice(shown.testing(seed), shown.drawn):
        dream, steps = imagined(model, block.vectors, block.layout)
        title = f"{shown.name}, which hits a corner" if block.truth.corner.any() else shown.name
        found.append(Trajectory(title, block.scene(0), shown.mover, block.vectors, dream, steps))
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


def _actions(block: Block) -> Iterator[Any]:
    """The block's actions in the units of the env's action space."""
    scale = block.schema.action_scale
    if not scale:
        return (0 for _ in range(len(block)))
    physical = block.columns(ACTION, *(prop for prop, _, _ in scale))[:-1]
    low, high = np.array([[a, b] for _, a, b in scale]).T
    normalised: NDArray[np.float32] = (2.0 * (physical - low) / (high - low) - 1.0).astype(np.float32)
    return iter(normalised)


def _verdicts(told: StepReport, block: Block) -> Iterator[tuple[str, bool]]:
    """(target, whether its prediction was wrong) for every object of one step."""
    for name, prop in told.residuals:
        yield f"{block.layout.types[block.layout.index(name)].name}.{prop}", (name, prop) in told.wrong
