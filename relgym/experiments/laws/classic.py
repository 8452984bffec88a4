"""Classic control as streams of one object: no contacts, so nothing for laws to say, and nothing to lose.

An observation is one object's property vector. It is shown to the learner twice: flat, and as a body whose velocity
laws of motion may look for.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import gymnasium as gym
import numpy as np

from relgym.scene.objects import ACTION, ObjectType, Scene, Target, Transition
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Sphere

__all__ = ["CLASSICS", "Classic", "classic_transitions"]


@dataclass(frozen=True, slots=True)
class Classic:
    """A classic control env: its id, what its observation's components are called, and which two move on their own.

    Attributes
    ----------
    env
        Gymnasium's id.
    properties
        Names of the observation's components.
    place, velocity
        Two of them each that count as position and velocity, if the object is shown as a body.
    """

    env: str
    properties: tuple[str, ...]
    place: tuple[str, str]
    velocity: tuple[str, str]

    def schema(self, *, body: bool) -> SceneSchema:
        """The schema of its scenes: the object and the action."""
        described = (
            ObjectType(
                "thing",
                self.properties,
                Sphere(),
                pose=dict(zip(("px", "py"), self.place, strict=True)),
                velocity=(*self.velocity, None),
            )
            if body
            else ObjectType("thing", self.properties)
        )
        return SceneSchema(
            (described, ObjectType(ACTION, ("u",))),
            (("thing", "thing"), (ACTION, ACTION)),
            planar=True,
            targets=tuple(Target("thing", p) for p in self.properties),
        )


CLASSICS: Final = (
    Classic("CartPole-v1", ("x", "speed", "angle", "turning"), ("x", "angle"), ("speed", "turning")),
    Classic("MountainCar-v0", ("x", "speed"), ("x", "x"), ("speed", "x")),
    Classic("Pendulum-v1", ("across", "along", "turning"), ("across", "along"), ("turning", "across")),
)


def classic_transitions(
    classic: Classic, steps: int, *, seed: int, body: bool
) -> tuple[SceneSchema, list[Transition]]:
    """Random play: the schema, and so many transitions; none across the end of an episode.

    Parameters
    ----------
    classic
        The env.
    steps
        How many transitions.
    seed
        Seed of env and actions.
    body
        Whether to show the object as a body.
    """
    schema = classic.schema(body=body)
    layout, env = schema.layout(), gym.make(classic.env)
    env.action_space.seed(seed)
    seen, _ = env.reset(seed=seed)
    found: list[Transition] = []
    while len(found) < steps:
        action = env.action_space.sample()
        u = float(np.ravel(action)[0])
        following, _, terminated, truncated, _ = env.step(action)
        rows = [np.array([*map(float, o), a]) for o, a in ((seen, u), (following, 0.0))]
        found.append(Transition(*(Scene(schema, layout, row) for row in rows)))
        seen = following
        if terminated or truncated:
            seen, _ = env.reset()
    env.close()
    return schema, found
