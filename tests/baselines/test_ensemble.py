"""The neural baseline learns what nets learn, behind the interface of every model."""

from __future__ import annotations

import numpy as np
import pytest
from dyna_worlds import SCHEMA, LineTask

from relgym.baselines.ensemble import MLPEnsemble
from relgym.baselines.neural_world import NeuralWorldModel
from relgym.errors import ConfigError, QueryError
from relgym.scene.objects import ObjectType, Scene, Target, Transition
from relgym.scene.schema import SceneSchema

pytestmark = pytest.mark.sb3


def sample(n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    x = rng.uniform(-1.0, 1.0, (n, 2))
    return x, np.stack([x[:, 0] + x[:, 1], np.abs(x[:, 0])], axis=1)


def fitted(n: int, rng: np.random.Generator, **options: int) -> MLPEnsemble:
    ensemble = MLPEnsemble(**{"hidden": 32, "train_steps": 150, **options})  # type: ignore[arg-type]
    for x, y in zip(*sample(n, rng), strict=True):
        ensemble.learn_one(x, y)
    return ensemble


def test_fits_a_function_with_a_kink(rng: np.random.Generator) -> None:
    ensemble = fitted(300, rng)
    x, y = sample(200, rng)
    assert np.abs(ensemble.predict_batch(x) - y).mean() < 0.1
    np.testing.assert_allclose(ensemble.predict_one(x[0]), ensemble.predict_batch(x)[0], atol=1e-5)


def test_same_seed_same_nets(rng: np.random.Generator) -> None:
    x, _ = sample(5, rng)
    found = [fitted(60, np.random.default_rng(1), seed=4).predict_batch(x) for _ in range(2)]
    np.testing.assert_array_equal(*found)
    assert not np.array_equal(found[0], fitted(60, np.random.default_rng(1), seed=5).predict_batch(x))


def test_asked_too_early(rng: np.random.Generator) -> None:
    with pytest.raises(QueryError, match="not trained yet: learn from 50 examples first"):
        fitted(10, rng).predict_one(np.zeros(2))
    with pytest.raises(ConfigError, match="members=0: expected at least 1"):
        MLPEnsemble(members=0)


def scene(x: float, push: float) -> Scene:
    return SCHEMA.scene({"cart": [x, 1.0], "other": [0.0, 2.0], "mark": [0.0], "action": [push]})


def after(before: Scene) -> Scene:
    bare = SCHEMA.scene({name: v for name, v in before.values().items() if name != "action"})
    return bare.replace({("cart", "x"): before["cart"]["x"] + before["action"]["push"]})


def test_a_world_with_its_task(rng: np.random.Generator) -> None:
    model = NeuralWorldModel(SCHEMA, ensemble=MLPEnsemble(hidden=32, train_steps=150))
    first = scene(0.5, 0.5)
    assert not model.predict_one(first).ok
    assert model.predict_one(first).scene == first
    task, layout = LineTask(), SCHEMA.layout(("cart", "other", "mark"))
    for x, push in zip(rng.uniform(-5, 5, 400), rng.uniform(-2, 2, 400), strict=True):
        before = scene(float(x), float(push))
        following = after(before)
        said = task.evaluate(layout, following.vector[None], None, following.vector[None])
        model.learn_step(
            Transition(before, following), float(said.rewards[0]), terminated=bool(said.terminated[0])
        )
    tests = [
        scene(float(x), float(p))
        for x, p in zip(rng.uniform(-5, 5, 100), rng.uniform(-2, 2, 100), strict=True)
    ]
    found = model.predict_batch(tests[0].layout, np.stack([t.vector for t in tests]))
    truth = np.array([after(t)["cart"]["x"] for t in tests])
    assert found.ok.all()
    assert np.abs(found.vectors[:, 0] - truth).mean() < 0.2
    np.testing.assert_array_equal(found.vectors[:, 3:], np.stack([t.vector for t in tests])[:, 3:])
    rewards, ended = model.predict_rewards(tests[0].layout, np.stack([t.vector for t in tests]))
    assert np.abs(rewards + np.abs(truth)).mean() < 0.4
    assert (ended == (np.abs(truth) > 5.0)).mean() > 0.9
    one = model.predict_one(tests[0])
    assert one.parts[0].value == pytest.approx(found.vectors[0, 0], abs=1e-4)


def test_nothing_to_predict() -> None:
    with pytest.raises(ConfigError, match="nothing to predict: pass targets="):
        NeuralWorldModel(SceneSchema(SCHEMA.types, SCHEMA.objects))


def test_angles_go_round(rng: np.random.Generator) -> None:
    schema = SceneSchema(
        (ObjectType("hand", ("th",), angles=("th",)),), (("hand", "hand"),), targets=(Target("hand", "th"),)
    )
    model = NeuralWorldModel(schema, ensemble=MLPEnsemble(hidden=32, train_steps=150))
    turned = lambda th: (th + 0.5 + np.pi) % (2.0 * np.pi) - np.pi  # noqa: E731
    for th in rng.uniform(-np.pi, np.pi, 300).tolist():
        model.learn_one(Transition(schema.scene({"hand": [th]}), schema.scene({"hand": [turned(th)]})))
    for th in (-3.0, 0.0, 2.9, 3.1):
        found = model.predict_one(schema.scene({"hand": [th]})).scene["hand"]["th"]
        assert abs(found - turned(th)) < 0.1
