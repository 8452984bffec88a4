"""What outliers cost: the same stream learned as it is and with some numbers replaced, tested on clean fresh steps."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import relgym  # noqa: F401 - registers the envs
from relgym.experiments.benchmark import Benchmark, Extent, Known, Option, Shown, Suite
from relgym.experiments.criterion import measured
from relgym.experiments.seeds import TRAINING_SEEDS
from relgym.model.reports.text import Cell, table
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene
from relgym.wrappers import ModelLearner

__all__ = ["ENVS", "SUITE", "Corrupted", "errors_on", "learned", "trial"]

ENVS: Final[dict[str, tuple[str, dict[str, Any]]]] = {
    "ball": ("relgym/BallBoxRamp-v0", {"incline": 30, "elasticity": 0.9, "friction": 0.0}),
    "ball-modes": ("relgym/BallBoxRamp-v0", {"incline": 30, "elasticity": 0.9, "friction": 0.0}),
    "cart": ("CartPole-v1", {}),
    "truck": ("relgym/TruckPush-v0", {}),
}
"""Id and arguments of each world; `ball-modes` is learned along the world's axes."""

SMALLEST, LARGEST = 3.0, 300.0
"""Decimal exponents between which outliers' magnitudes are drawn."""

NAN = 0.1
"""Share of outliers that are NaN."""


class Corrupted(gym.ObservationWrapper[Any, Any, Any]):
    """An env that observes some numbers wrongly: replaced by ±1e3 … ±1e300, or by NaN.

    Parameters
    ----------
    env
        Its observations are arrays, or dicts of them.
    share
        Probability with which each number is replaced.
    seed
        Seed of the draws.
    """

    def __init__(self, env: gym.Env[Any, Any], share: float, seed: int) -> None:
        super().__init__(env)
        self._share = share
        self._rng = np.random.default_rng(seed)
        self.replaced = 0

    def observation(self, observation: Any) -> Any:
        """The observation with some numbers replaced."""
        if isinstance(observation, Mapping):
            return {name: self.observation(part) for name, part in observation.items()}
        values = np.array(observation, dtype=np.float64)
        hit = self._rng.random(values.shape) < self._share
        if hit.any():
            self.replaced += int(hit.sum())
            exponents = self._rng.uniform(SMALLEST, LARGEST, values.shape)
            wild = np.power(10.0, exponents) * self._rng.choice([-1.0, 1.0], values.shape)
            wild[self._rng.random(values.shape) < NAN] = np.nan
            values = np.where(hit, wild, values)
        return values


def learned(name: str, steps: int, seed: int, *, share: float = 0.0) -> ModelLearner:
    """A learner after so many random steps of a world, of which a share of the numbers is replaced."""
    env_id, arguments = ENVS[name]
    inner: gym.Env[Any, Any] = gym.make(env_id, disable_env_checker=True, **arguments)
    config = {"frames": "world"} if name == "ball-modes" else {}
    if share:
        inner = Corrupted(inner, share, seed)
    env = ModelLearner(inner, bad_observations="skip", config=config, predict=True)
    env.action_space.seed(seed)
    env.reset(seed=seed)
    for _ in range(steps):
        _, _, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
    return env


def errors_on(model: WorldModel, name: str, steps: int, seed: int) -> dict[str, NDArray[np.float64]]:
    """Absolute errors of predictions on clean fresh steps, by target; infinite where the model abstains."""
    env_id, arguments = ENVS[name]
    env = ModelLearner(gym.make(env_id, disable_env_checker=True, **arguments), learn=True, predict=False)
    env.pause()
    env.action_space.seed(seed)
    env.reset(seed=seed)
    found: dict[str, list[float]] = {}
    for _ in range(steps):
        action = env.action_space.sample()
        before = env.view.with_action(env.scene, action)
        _, _, terminated, truncated, _ = env.step(action)
        after = None
        if terminated or truncated:
            env.reset()
        else:
            after = env.scene
        if after is not None:
            _count(model, before, after, found)
    return {target: np.array(errors) for target, errors in sorted(found.items())}


def _count(model: WorldModel, before: Scene, after: Scene, found: dict[str, list[float]]) -> None:
    prediction = model.predict_one(before)
    for target in model.targets:
        for index in before.layout.of_type(target.type):
            one = before.layout.names[index]
            off = abs(prediction.scene[one][target.property] - after[one][target.property])
            found.setdefault(str(target), []).append(float(off))


def trial(*, world: str, steps: int, tests: int, every: int, seed: int) -> dict[str, Any]:
    """A world learned clean, and with one number of so many replaced: errors of both, target by target."""
    clean, dirty = learned(world, steps, seed), learned(world, steps, seed, share=1.0 / every)
    one, other = (errors_on(env.model, world, tests, seed + 1_000) for env in (clean, dirty))
    targets = {}
    for target in sorted(one.keys() | other.keys()):
        both = one.get(target, np.full(1, np.inf)), other.get(target, np.full(1, np.inf))
        rms = [float(np.sqrt(np.mean(np.square(e)))) for e in both]
        targets[target] = {
            "wrong": [100.0 * float(np.mean(~(e <= 1e-6))) for e in both],
            "rms": [size if np.isfinite(size) else None for size in rms],
        }
    return {
        "replaced": int(dirty.get_wrapper_attr("replaced")),
        "skipped": dirty.skipped,
        "targets": targets,
    }


def _benchmark(world: str) -> Benchmark:
    def measure(extent: Extent, known: Known) -> Shown:
        size = {name: extent[name] for name in ("steps", "tests", "every")}
        asked = [{"world": world, "seed": seed, **size} for seed in extent.first(TRAINING_SEEDS)]
        found = known.pairs("relgym.experiments.outliers:trial", asked)
        worse = [one["wrong"][1] - one["wrong"][0] for _, each in found for one in each["targets"].values()]
        rows: list[list[Cell]] = [
            [arguments["seed"], target, *(f"{share:.3f}" for share in one["wrong"]), *map(_size, one["rms"])]
            for arguments, each in found
            for target, one in each["targets"].items()
        ]
        heads = ["seed", "target", "clean: wrong, %", "with outliers", "clean: rms", "with outliers"]
        notes = [table(heads, rows)]
        notes += [
            f"seed {a['seed']}: {one['replaced']} numbers replaced, {one['skipped']} observations skipped"
            for a, one in found
        ]
        return Shown(
            [measured("more wrong than without, % of predictions", _MORE, worse)] if found else (), notes
        )

    return Benchmark(f"{world}: one number in {_EVERY} replaced", measure)


def _size(rms: float | None) -> str:
    return "-" if rms is None else f"{rms:.3g}"


_EVERY: Final = 500
_MORE: Final = 0.5
"""Per cent of predictions that may be wrong, or not made, because of them."""

SUITE: Final = Suite(
    "outliers",
    "What outliers cost",
    {world: _benchmark(world) for world in ENVS},
    seeds=1,
    options={
        "steps": Option(4_000, "to learn from"),
        "tests": Option(2_000, "clean fresh ones"),
        "every": Option(_EVERY, "one number in so many is replaced"),
    },
)
