"""What outliers cost: the same stream learned as it is and with some numbers replaced, tested on clean fresh steps."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import Any, Final

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import relgym  # noqa: F401 - registers the envs
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene
from relgym.wrappers import ModelLearner

__all__ = ["ENVS", "Corrupted", "errors_on", "learned"]

ENVS: Final[dict[str, tuple[str, dict[str, Any]]]] = {
    "ball": ("relgym/BallBoxRamp-v0", {"incline": 30, "elasticity": 0.9, "friction": 0.0}),
    "ball-modes": ("relgym/BallBoxRamp-v0", {"incline": 30, "elasticity": 0.9, "friction": 0.0}),
    "cart": ("CartPole-v1", {}),
    "truck": ("relgym/TruckPush-v0", {}),
}
"""Id and arguments of each world; `ball-modes` is learned along the world's axes."""

SMALLEST, LARGEST = 3.0, 300.0
"""Decimal exponents between which outliers' magnitudes are drawn."""


class Corrupted(gym.ObservationWrapper[Any, Any, Any]):
    """An env that observes some numbers wrongly: replaced by ±1e3 … ±1e300, or by NaN.

    Parameters
    ----------
    env
        Its observations are arrays, or dicts of them.
    share
        Probability with which each number is replaced.
    nan
        Share of the replaced ones that become NaN.
    seed
        Seed of the draws.
    """

    def __init__(self, env: gym.Env[Any, Any], share: float, *, nan: float = 0.1, seed: int = 0) -> None:
        super().__init__(env)
        self._share, self._nan = share, nan
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
            wild[self._rng.random(values.shape) < self._nan] = np.nan
            values = np.where(hit, wild, values)
        return values


def learned(name: str, steps: int, seed: int, *, share: float = 0.0) -> ModelLearner:
    """A learner after so many random steps of a world, of which a share of the numbers is replaced."""
    env_id, arguments = ENVS[name]
    inner: gym.Env[Any, Any] = gym.make(env_id, disable_env_checker=True, **arguments)
    config = {"frames": "world"} if name == "ball-modes" else {}
    if share:
        inner = Corrupted(inner, share, seed=seed)
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


def main() -> None:
    """Learn each world twice and print, per target, both errors and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("worlds", nargs="*", default=list(ENVS), help=f"of {', '.join(ENVS)}")
    parser.add_argument("--steps", type=int, default=4_000)
    parser.add_argument("--test", type=int, default=2_000)
    parser.add_argument("--share", type=float, default=1 / 500)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    for name in given.worlds:
        clean = learned(name, given.steps, given.seed)
        dirty = learned(name, given.steps, given.seed, share=given.share)
        one, other = (errors_on(env.model, name, given.test, given.seed + 1000) for env in (clean, dirty))
        corrupted = dirty.get_wrapper_attr("replaced")
        print(
            f"{name}: {given.steps:,} steps, {corrupted} numbers replaced, {dirty.skipped} observations skipped"
        )
        for target in sorted(one.keys() | other.keys()):
            a, b = one.get(target, np.full(1, np.inf)), other.get(target, np.full(1, np.inf))
            rms = [float(np.sqrt(np.mean(np.square(e)))) for e in (a, b)]
            wrong = [float(np.mean(~(e <= 1e-6))) for e in (a, b)]
            print(
                f"  {target:24} wrong {wrong[0]:8.3%} → {wrong[1]:8.3%}   rms {rms[0]:.3g} → {rms[1]:.3g}"
                f"   ratio {rms[1] / max(rms[0], 1e-12):.3g}",
                flush=True,
            )


if __name__ == "__main__":
    main()
