"""A scene among random actions, for ``relgym explain``."""

from __future__ import annotations

from relgym.console.models import ModelInEnv
from relgym.scene.objects import Scene

__all__ = ["scene_at"]


def scene_at(found: ModelInEnv, *, step: int, seed: int) -> Scene:
    """The scene after so many random steps, episode after episode, with the action that comes next."""
    env, view = found.env, found.view
    env.action_space.seed(seed)
    scene = view.scene(*env.reset(seed=seed))
    for _ in range(step):
        observation, _, terminated, truncated, info = env.step(env.action_space.sample())
        over = terminated or truncated
        scene = view.scene(*env.reset()) if over else view.scene(observation, info, last=scene)
    return view.with_action(scene, env.action_space.sample())
