"""A scene of an episode with random actions, for ``relgym explain``."""

from __future__ import annotations

from relgym.console.models import ModelInEnv
from relgym.errors import ConfigError
from relgym.scene.objects import Scene

__all__ = ["scene_at"]


def scene_at(found: ModelInEnv, *, step: int, seed: int) -> Scene:
    """The scene after some random steps of an episode, with the action that would come next.

    Raises
    ------
    ConfigError
        The episode was over before.
    """
    env, view = found.env, found.view
    env.action_space.seed(seed)
    observation, info = env.reset(seed=seed)
    scene = view.scene(observation, info)
    for taken in range(step):
        observation, _, terminated, truncated, info = env.step(env.action_space.sample())
        scene = view.scene(observation, info, last=scene)
        if (terminated or truncated) and taken + 1 < step:
            raise ConfigError(
                f"--step {step}: the episode was over after {taken + 1} steps; try a smaller one, or another --seed"
            )
    return view.with_action(scene, env.action_space.sample())
