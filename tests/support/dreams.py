"""Models to dream of: small, learned within a second or two, with all that a file would say of their env."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from worlds import LINE_TARGETS, ROOM_TARGETS, RawStep, learned, line, room, scene, schema_of

from relgym.config import ModelConfig
from relgym.envs.model_files import EnvRecord
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ACTION, TASK, Float2D, ObjectType, Scene, SceneLayout, Target, Transition
from relgym.scene.schema import SceneSchema
from relgym.wrappers import ModelLearner

ROOM_STEPS = room(0, 260)
LINE_STEPS = line(0, 300, ("light", "heavy", "light"))


@cache
def room_model(frames: str = "world") -> WorldModel:
    """A ball among three boxes: two modes an axis along the world's axes, or laws of contacts."""
    schema = schema_of(ROOM_STEPS, ROOM_TARGETS)
    config = ModelConfig(frames=frames)  # type: ignore[arg-type]
    return recorded(learned(schema, ROOM_STEPS, config=config), starts_of(schema, ROOM_STEPS[:8]))


@cache
def line_model() -> WorldModel:
    """Balls of two masses on a line: functions with a role that some object must play."""
    schema = schema_of(LINE_STEPS, LINE_TARGETS)
    config = ModelConfig(frames="world")
    return recorded(learned(schema, LINE_STEPS, config=config), starts_of(schema, LINE_STEPS[:8]))


def starts_of(schema: SceneSchema, steps: Sequence[RawStep]) -> list[Scene]:
    """The scenes before some raw steps."""
    return [scene(schema, before) for before, _ in steps]


def recorded(model: WorldModel, starts: Sequence[Scene], actions: spaces.Space | None = None) -> WorldModel:
    """The model with wide spaces for all its objects, and first scenes."""
    seen = {
        name: spaces.Box(-1e4, 1e4, (len(model.schema.type_of(name).properties),), np.float64)
        for name in model.schema.order
        if name not in (ACTION, TASK)
    }
    model.extra = EnvRecord(spaces.Dict(seen), actions or spaces.Discrete(1), tuple(starts)).to_json()
    return model


# ---------------------------------------------------------------------- a cart whose task is learned
CART_SCHEMA = SceneSchema(
    (
        ObjectType("cart", ("x", "v")),
        ObjectType(ACTION, ("push",)),
        ObjectType(TASK, ("reward", "terminated")),
    ),
    (("cart", "cart"), (ACTION, ACTION), (TASK, TASK)),
    action_scale=(("push", 0.0, 10.0),),
    targets=(
        Target("cart", "v"),
        Target("cart", "x", given=(("cart", "v"),)),
        Target(TASK, "reward", given=(("cart", "v"),)),
        Target(TASK, "terminated", given=(("cart", "x"),)),
    ),
)


def cart_step(x: float, v: float, push: float) -> tuple[float, float, float, float]:
    """The cart's next x and v, the reward, and how far it is on its way (more than 0.5: there)."""
    after = 0.9 * v + 0.1 * push
    return x + after, after, 2.0 * after - 1.0, 0.01 * (x + after)


@cache
def cart_model(rewarded: bool = True) -> WorldModel:
    """A cart that was pushed at random, with reward and end as properties of the task."""
    rng = np.random.default_rng(0)
    targets = CART_SCHEMA.targets if rewarded else CART_SCHEMA.targets[:2]  # type: ignore[index]
    model = WorldModel(CART_SCHEMA, targets=targets)
    for x, v, push in rng.uniform((-50, -5, 0), (50, 5, 10), (60, 3)):
        after = cart_step(x, v, push)
        before = CART_SCHEMA.scene({"cart": [x, v], ACTION: [push], TASK: [0.0, 0.0]})
        model.learn_one(
            Transition(before, CART_SCHEMA.scene({"cart": after[:2], ACTION: [0.0], TASK: after[2:]}))
        )
    model.finish()
    starts = [CART_SCHEMA.scene({"cart": [float(x), 0.0]}) for x in range(4)]
    return recorded(model, starts, spaces.Box(-1.0, 1.0, (1,), np.float32))


@cache
def lost_model() -> WorldModel:
    """A cart whose velocity is drawn anew at every step: where it goes is known once its velocity is."""
    rng = np.random.default_rng(0)
    model = WorldModel(CART_SCHEMA, targets=CART_SCHEMA.targets[:2])  # type: ignore[index]
    for x, v, after in rng.uniform(-5.0, 5.0, (60, 3)):
        before = CART_SCHEMA.scene({"cart": [x, v], ACTION: [0.0], TASK: [0.0, 0.0]})
        model.learn_one(Transition(before, before.replace({("cart", "x"): x + after, ("cart", "v"): after})))
    model.finish()
    assert not model.modes("cart", "v") and model.modes("cart", "x")
    return recorded(model, [CART_SCHEMA.scene({"cart": [0.0, 1.0]})], spaces.Box(-1.0, 1.0, (1,), np.float32))


@cache
def rough_model() -> WorldModel:
    """A cart whose velocity no few functions describe: guesses and regressions say what comes."""
    rng = np.random.default_rng(0)
    model = WorldModel(CART_SCHEMA, targets=CART_SCHEMA.targets[:2])  # type: ignore[index]
    for x, v in rng.uniform(-5.0, 5.0, (300, 2)):
        after = 3.0 * np.sin(v) + 0.1 * x * v
        before = CART_SCHEMA.scene({"cart": [x, v], ACTION: [0.0], TASK: [0.0, 0.0]})
        model.learn_one(Transition(before, before.replace({("cart", "x"): x + after, ("cart", "v"): after})))
    model.finish()
    return recorded(model, [CART_SCHEMA.scene({"cart": [0.0, 1.0]})], spaces.Box(-1.0, 1.0, (1,), np.float32))


@cache
def hilly_model() -> WorldModel:
    """A cart on a hill, of which it has seen the foot: an approximation says what comes."""
    rng = np.random.default_rng(0)
    model = WorldModel(CART_SCHEMA, targets=CART_SCHEMA.targets[:2])  # type: ignore[index]
    for x, v in rng.normal(0.0, 0.2, (400, 2)):
        after = v - 0.05 * np.sin(x)
        before = CART_SCHEMA.scene({"cart": [x, v], ACTION: [0.0], TASK: [0.0, 0.0]})
        model.learn_one(Transition(before, before.replace({("cart", "x"): x + after, ("cart", "v"): after})))
    model.finish()
    return recorded(model, [CART_SCHEMA.scene({"cart": [0.0, 0.1]})], spaces.Box(-1.0, 1.0, (1,), np.float32))


class FlatCart(gym.Env[Any, Any]):
    """The cart with flat numbers, x and v."""

    def __init__(self) -> None:
        self.observation_space = spaces.Box(-1e3, 1e3, (2,), np.float64)
        self.action_space = spaces.Box(-1.0, 1.0, (1,), np.float32)
        self._state = np.zeros(2)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self._state = self.np_random.uniform(-1.0, 1.0, 2)
        return self._state.copy(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        x, v = self._state
        v = 0.9 * v + 0.5 * float(action[0])
        self._state = np.array([x + v, v])
        return self._state.copy(), 2.0 * v, False, False, {}


@cache
def flat_model() -> WorldModel:
    """What a learner around the flat cart learned."""
    speed = (("self", "x1"),)
    targets = [Target("self", "x1"), Target("self", "x0", speed), Target(TASK, "reward", speed)]
    env = ModelLearner(FlatCart(), learn_reward=True, targets=targets)
    env.action_space.seed(0)
    for episode in range(8):
        env.reset(seed=episode)
        for _ in range(25):
            env.step(env.action_space.sample())
    env.model.finish()
    return env.model


def vectors_of(scenes: Sequence[Scene]) -> NDArray[np.float64]:
    """State vectors of scenes with the same objects."""
    return np.array([each.vector for each in scenes])


class Errand:
    """A task with functions of one step and of many: be at x > 0.5, whatever it takes."""

    def reward(self, before: Scene, action: Any, after: Scene) -> float:
        return after["cart"]["x"] - before["cart"]["x"] + 0.1 * float(action[0])

    def terminated(self, before: Scene, action: Any, after: Scene) -> bool:
        return after["cart"]["x"] > 0.5

    succeeded = terminated

    def rewards(
        self, layout: SceneLayout, before: Float2D, actions: Any, after: Float2D
    ) -> NDArray[np.float64]:
        x = layout.column(layout.index("cart"), "x")
        return after[:, x] - before[:, x] + 0.1 * actions[:, 0]

    def terminations(
        self, layout: SceneLayout, before: Float2D, actions: Any, after: Float2D
    ) -> NDArray[np.bool_]:
        return np.asarray(after[:, layout.column(layout.index("cart"), "x")] > 0.5)

    successes = terminations
