"""Envs whose observations no array holds: a function finds the objects in them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

import relgym
from relgym.data import Dataset
from relgym.envs.views import FunctionView
from relgym.errors import ConfigError
from relgym.scene.objects import ObjectType, Scene
from relgym.scene.schema import SceneSchema
from relgym.wrappers import ModelLearner, VectorModelLearner

SCHEMA = SceneSchema((ObjectType("cart", ("x", "v")),), (("cart", "cart"),))
LIMITS = spaces.Box(-1e3, 1e3, (2,), np.float64)


class Own(spaces.Space[Any]):
    """A space of somebody's own."""

    def __init__(self) -> None:
        super().__init__(None, None)

    def sample(self, mask: Any = None, probability: Any = None) -> Any:
        raise NotImplementedError

    def contains(self, x: Any) -> bool:
        return isinstance(x, Shown)


class Shown(tuple[float, float]):
    """What such a space holds."""


def told(scene: Scene) -> str:
    return f"{scene['cart']['x']!r};{scene['cart']['v']!r}"


FORMS: dict[str, tuple[spaces.Space[Any], Any, Any]] = {
    "text": (
        spaces.Text(60, charset="0123456789.e+-;"),
        lambda x, v: f"{x!r};{v!r}",
        lambda seen, info: {"cart": [float(part) for part in seen.split(";")]},
    ),
    "sequence": (
        spaces.Sequence(spaces.Box(-1e3, 1e3, (1,), np.float64)),
        lambda x, v: (np.array([x]), np.array([v])),
        lambda seen, info: {"cart": [float(part[0]) for part in seen]},
    ),
    "graph": (
        spaces.Graph(spaces.Box(-1e3, 1e3, (2,), np.float64), None),
        lambda x, v: spaces.GraphInstance(np.array([[x, v]]), None, None),
        lambda seen, info: {"cart": seen.nodes[0]},
    ),
    "one of": (
        spaces.OneOf([spaces.Discrete(2), LIMITS]),
        lambda x, v: (np.int64(1), np.array([x, v])),
        lambda seen, info: {"cart": seen[1]},
    ),
    "nested": (
        spaces.Dict(deep=spaces.Dict(er=LIMITS), note=spaces.Text(9)),
        lambda x, v: {"deep": {"er": np.array([x, v])}, "note": "hello"},
        lambda seen, info: {"cart": seen["deep"]["er"]},
    ),
    "one's own": (Own(), lambda x, v: Shown((x, v)), lambda seen, info: {"cart": list(seen)}),
}


class Cart(gym.Env[Any, Any]):
    """v' = 0.5 v + a - 1, x' = x + v'; shown in some form."""

    def __init__(self, form: str = "text") -> None:
        self.observation_space, self.shown, _ = FORMS[form]
        self.action_space = spaces.Discrete(3)

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.x, self.v, self.steps = *(float(n) for n in self.np_random.uniform(-1, 1, 2)), 0
        return self.shown(self.x, self.v), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.v = 0.5 * self.v + int(action) - 1
        self.x += self.v
        self.steps += 1
        return self.shown(self.x, self.v), 0.0, False, self.steps >= 20, {}


def view_of(form: str, **options: Any) -> Any:
    return lambda seen, done: FunctionView(SCHEMA, FORMS[form][2], done, **options)


def lived(form: str, steps: int = 80, **options: Any) -> ModelLearner:
    learner = ModelLearner(Cart(form), view=view_of(form, **options))
    learner.action_space.seed(0)
    learner.reset(seed=0)
    for _ in range(steps):
        *_, truncated, _ = learner.step(learner.action_space.sample())
        if truncated:
            learner.reset()
    return learner


@pytest.mark.parametrize("form", FORMS)
def test_learned_online_and_from_data(form: str, tmp_path: Path) -> None:
    learner = lived(form)
    assert learner.prequential.recent_wrong["cart", "x"] < 20
    assert learner.model.modes("cart", "x")[0].formula() == "x' = x + v'"
    model = relgym.fit(Dataset.collect(Cart(form), 80, seed=0), view=view_of(form))
    for what in (learner.model, model):
        what.save(tmp_path / f"{what is model}.relgym", history=True)
    assert (tmp_path / "True.relgym").read_bytes() == (tmp_path / "False.relgym").read_bytes()


def test_dreams_of_text(tmp_path: Path) -> None:
    learner = lived("text", 120)
    learner.save(tmp_path / "cart.relgym")
    view = view_of("text", inverse=told)(None, spaces.Discrete(3))
    dream = gym.make("relgym/LearnedModel-v0", model=str(tmp_path / "cart.relgym"), view=view)
    assert dream.observation_space == FORMS["text"][0]
    seen, _ = dream.reset(seed=0)
    x, v = (float(part) for part in seen.split(";"))
    seen, *_ = dream.step(2)
    assert [float(part) for part in seen.split(";")] == pytest.approx(
        [x + 0.5 * v + 1, 0.5 * v + 1], abs=1e-9
    )


def test_a_space_of_ones_own_is_learned_of_but_no_file_holds_it(tmp_path: Path) -> None:
    learner = lived("one's own")
    assert learner.model.seen == 80
    with pytest.raises(ConfigError, match=r"TransformObservation"):
        learner.save(tmp_path / "own.relgym")
    learner.model.save(tmp_path / "own.relgym")  # the model by itself
    assert relgym.WorldModel.load(tmp_path / "own.relgym").seen == 80


def test_vectors_of_such_envs() -> None:
    envs = gym.vector.SyncVectorEnv([lambda: Cart("text")] * 2)
    learner = VectorModelLearner(envs, view=view_of("text"))
    learner.reset(seed=0)
    for _ in range(5):
        learner.step(envs.action_space.sample())
    assert learner.model.seen == 10


def test_the_message_that_recommends_a_function_view() -> None:
    for form in ("text", "sequence", "graph", "nested"):
        with pytest.raises(ConfigError, match=r"pass view=.*FunctionView|FunctionView.*takes any function"):
            ModelLearner(Cart(form))
