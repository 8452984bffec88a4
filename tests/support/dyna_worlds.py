"""A world small enough to work out by hand: a cart on a line, and models of it that are right, wrong or mute."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from relgym.envs.tasks import TaskOutcome
from relgym.model.predicting.prediction import OUTCOMES, BatchPrediction, Outcome, Prediction, ScenePrediction
from relgym.scene.objects import Float2D, ObjectType, Scene, SceneLayout, Target, Transition
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box

SCHEMA = SceneSchema(
    (
        ObjectType("cart", ("x", "mass"), Box(), pose={"px": "x"}),
        ObjectType("mark", ("at",)),
        ObjectType("action", ("push",)),
    ),
    (("cart", "cart"), ("other", "cart"), ("mark", "mark"), ("action", "action")),
    targets=(Target("cart", "x"),),
    action_scale=(("push", -2.0, 2.0),),
)
"""Two carts, of which only the first is pushed: x' = x + push; and a mark that nothing depends on."""


class LineTask:
    """Reward -|x'| of the first cart; over when it is further than 5 from the origin."""

    def evaluate(self, layout: SceneLayout, before: Float2D, actions: Any, after: Float2D) -> TaskOutcome:
        x = after[:, layout.column(layout.index("cart"), "x")]
        return TaskOutcome(-np.abs(x), np.abs(x) > 5.0, np.zeros(len(x), dtype=bool))


class LineEnv(gym.Env[Any, Any]):
    """The cart; episodes last 8 steps at most."""

    def __init__(self, *, dtype: Any = np.float64) -> None:
        self.schema, self.task = SCHEMA, LineTask()
        box = spaces.Box(-100.0, 100.0, (2,), dtype)
        self.observation_space = spaces.Dict(
            {"cart": box, "other": box, "mark": spaces.Box(-100.0, 100.0, (1,), dtype)}
        )
        self.action_space = spaces.Box(-1.0, 1.0, (1,), np.float32)
        self.vector = np.zeros(5)
        self.steps = 0
        self._dtype = dtype

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        x, other, at = self.np_random.uniform(-2.0, 2.0, 3)
        self.vector = np.array([x, 1.0, other, 2.0, at])
        self.steps = 0
        return self._observation(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        before, self.vector = self.vector, self.vector.copy()
        self.vector[0] += 2.0 * float(action[0])
        self.steps += 1
        layout = SCHEMA.layout(("cart", "other", "mark"))
        said = self.task.evaluate(layout, before[None], action, self.vector[None])
        return self._observation(), float(said.rewards[0]), bool(said.terminated[0]), self.steps >= 8, {}

    def _observation(self) -> Any:
        cart, other, mark = self.vector[:2], self.vector[2:4], self.vector[4:]
        parts = {"cart": cart, "other": other, "mark": mark}
        return {name: part.astype(self._dtype) for name, part in parts.items()}


class LineModel:
    """x' = x + push + `off`; says nothing of carts beyond `mute_from`."""

    frozen = False

    def __init__(self, *, off: float = 0.0, mute_from: float = np.inf) -> None:
        self.schema = SCHEMA
        self.targets = (Target("cart", "x"),)
        self.off, self.mute_from = off, mute_from
        self.learned: list[Transition] = []

    def learn_one(self, transition: Transition) -> None:
        self.learned.append(transition)

    def predict_one(self, scene: Scene) -> ScenePrediction:
        found = self.predict_batch(scene.layout, scene.vector[None])
        outcome = OUTCOMES[int(found.outcomes[0, 0])]
        parts = (Prediction("cart", "x", float(found.vectors[0, 0]), outcome),)
        return ScenePrediction(Scene(scene.schema, scene.layout, found.vectors[0]), parts)

    def predict_batch(self, layout: SceneLayout, vectors: Float2D) -> BatchPrediction:
        after: NDArray[np.float64] = vectors.copy()
        x, push = (layout.column(layout.index(n), p) for n, p in (("cart", "x"), ("action", "push")))
        after[:, x] += vectors[:, push] + self.off
        mute = np.abs(vectors[:, x]) > self.mute_from
        spoken, abstained = OUTCOMES.index(Outcome.PREDICTED), OUTCOMES.index(Outcome.OUTSIDE)
        outcomes = np.where(mute, abstained, spoken).astype(np.int8)[:, None]
        n = len(vectors)
        return BatchPrediction(
            layout, after, (("cart", "x"),), np.zeros((n, 1), dtype=np.int64), outcomes, np.zeros((n, 1))
        )


class Flat(gym.ObservationWrapper[Any, Any, Any]):
    """Shows the pushed cart's place alone, halved, in float32."""

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        super().__init__(env)
        self.observation_space = spaces.Box(-50.0, 50.0, (1,), np.float32)

    def observation(self, observation: Any) -> Any:
        return (observation["cart"][:1] / 2.0).astype(np.float32)
