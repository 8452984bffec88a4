"""What a user might write, for type checkers alone: each call of the public names has the type it says it has.

`.ci/check_types.py` hands it to mypy and pyright, beside an installed relgym and away from the checkout. A name that is
`Any` to them fails its `assert_type`; what `reveal_type` says is printed.
"""

from typing import Any, assert_type, reveal_type

import gymnasium as gym
from gymnasium.vector import VectorEnv

import relgym
from relgym import WorldModel
from relgym.envs import BallBoxRampEnv, LearnedModelEnv, LearnedModelVectorEnv
from relgym.wrappers import ModelLearner, NumbersView, StepReport, VectorModelLearner
from relgym.wrappers.sb3 import Dyna, DynaConfig, ModelCallback

assert_type(relgym.__version__, str)
assert_type(relgym.WorldModel, type[WorldModel])
assert_type(relgym.wrappers.ModelLearner, type[ModelLearner])
assert_type(relgym.wrappers.VectorModelLearner, type[VectorModelLearner])
assert_type(relgym.wrappers.NumbersView, type[NumbersView])
assert_type(relgym.envs.BallBoxRampEnv, type[BallBoxRampEnv])
assert_type(relgym.envs.LearnedModelEnv, type[LearnedModelEnv])
assert_type(relgym.envs.LearnedModelVectorEnv, type[LearnedModelVectorEnv])


def learn(steps: int) -> WorldModel:
    """Watch an env, and read what was learned."""
    env = relgym.wrappers.ModelLearner(gym.make("relgym/BallBoxRamp-v0"), config={"frames": "world"})
    env.reset(seed=0)
    for _ in range(steps):
        _, _, terminated, truncated, info = env.step(env.action_space.sample())
        report: StepReport = info["relgym"]
        print(reveal_type(report.wrong), reveal_type(report.prediction))
        if terminated or truncated:
            env.reset()
    reveal_type(env)
    reveal_type(env.prequential.recent)
    reveal_type(env.model)
    reveal_type(env.model.describe())
    reveal_type(env.model.laws)
    reveal_type(env.model.modes("ball", "vx"))
    env.save("ball.json")
    return env.model


def dream(world: BallBoxRampEnv) -> str:
    """Predict a step, then live in the model."""
    model = reveal_type(relgym.WorldModel.load("ball.json"))
    scene = world.schema.scene(world.reset(seed=1)[0])
    prediction = reveal_type(model.predict_one(scene))
    reveal_type(prediction.scene["ball"]["vx"])
    reveal_type(prediction.ok)
    env = reveal_type(relgym.envs.LearnedModelEnv(model))
    _, reward, terminated, _, _ = env.step(env.action_space.sample())
    assert_type((reward, terminated), tuple[float, bool])
    reveal_type(relgym.envs.LearnedModelVectorEnv("ball.json", 64))
    return reveal_type(model.explain(scene))


def train(model: WorldModel) -> tuple[Dyna, ModelCallback]:
    """An agent that trains in what it has learned, and a callback that only watches."""
    callback = reveal_type(Dyna(model, DynaConfig(updates=20)))
    watch = reveal_type(ModelCallback(background=4096))
    reveal_type(watch.catch_up().describe())
    return callback, watch


def together(envs: VectorEnv[Any, Any, Any]) -> WorldModel:
    """Learn from many envs at once."""
    watched = reveal_type(VectorModelLearner(envs))
    return reveal_type(watched.model)
