"""Scenes in which roll-outs begin: drawn, permuted and resampled without leaving what the model knows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from dyna_worlds import SCHEMA, LineModel

from relgym.errors import ConfigError
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ObjectType, Scene, Target, Transition
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box
from relgym.wrappers.dyna.config import DynaConfig
from relgym.wrappers.dyna.stock import SceneStock, free_properties, permuted

POSE = ("px", "py", "pz", "rx", "ry", "rz", "sx", "sy", "sz")
BLOCKS = SceneSchema(
    (ObjectType("block", (*POSE, "vx", "weight"), Box(), velocity=("vx", None, None)),),
    tuple((f"block{k}", "block") for k in range(3)),
    targets=(Target("block", "vx"),),
)


def scene(x: float, at: float = 0.0) -> Scene:
    return SCHEMA.scene({"cart": [x, 1.0], "other": [-x, 2.0], "mark": [at]})


def test_draws_first_scenes_and_all_scenes(rng: np.random.Generator) -> None:
    stock = SceneStock()
    for k in range(10):
        stock.add(scene(float(k)), first=k == 0)
    assert len(stock) == 10
    _, firsts = stock.draw(50, from_start=1.0, rng=rng)
    assert set(firsts[:, 0]) == {0.0}
    layout, anywhere = stock.draw(200, from_start=0.0, rng=rng)
    assert set(anywhere[:, 0]) == set(map(float, range(10)))
    assert layout.names == ("cart", "other", "mark")


def test_forgets_the_oldest(rng: np.random.Generator) -> None:
    stock = SceneStock(capacity=3)
    for k in range(10):
        stock.add(scene(float(k)), first=False)
    assert set(stock.draw(50, from_start=0.5, rng=rng)[1][:, 0]) == {7.0, 8.0, 9.0}


def test_nothing_to_draw_from(rng: np.random.Generator) -> None:
    with pytest.raises(ConfigError, match="no scenes to begin roll-outs in"):
        SceneStock().draw(1, from_start=0.5, rng=rng)
    with pytest.raises(ConfigError, match="capacity=0: expected at least 1"):
        SceneStock(capacity=0)


def test_permuted_blocks_keep_places_and_exchange_weights(rng: np.random.Generator) -> None:
    layout = BLOCKS.layout()
    before = np.arange(33.0)[None].repeat(60, axis=0)
    after = permuted(layout, before, WorldModel(BLOCKS), rng=rng).reshape(60, 3, 11)
    places, weights = after[:, :, :10], after[:, :, 10]
    # Whatever stands there (place, size, motion) stays together ...
    assert {tuple(row) for row in places.reshape(-1, 10)} == {
        tuple(row) for row in before[0].reshape(3, 11)[:, :10]
    }
    assert all(set(row) == {10.0, 21.0, 32.0} for row in weights.tolist())
    # ... and each weight comes to stand in every place.
    assert (
        len(
            {
                (place[0], w)
                for row, ws in zip(places, weights, strict=True)
                for place, w in zip(row, ws, strict=True)
            }
        )
        == 9
    )
    assert len({tuple(row) for row in after[:, :, 0]}) == 6


def test_a_lone_object_stays_as_it_is(rng: np.random.Generator) -> None:
    layout = SCHEMA.layout(("cart", "mark"))
    before = np.arange(9.0).reshape(3, 3)
    np.testing.assert_array_equal(permuted(layout, before, LineModel(), rng=rng), before)


def pushed(before: Scene, by: float) -> Scene:
    return before.replace({("cart", "x"): before["cart"]["x"] + by})


def taught(rng: np.random.Generator, *, minding_the_mark: bool) -> WorldModel:
    model = WorldModel(SCHEMA)
    for _ in range(80):
        x, at, push = rng.uniform(-2, 2, 3)
        before = SCHEMA.scene({"cart": [x, 1.0], "other": [-x, 2.0], "mark": [at], "action": [push]})
        model.learn_one(Transition(before, pushed(before, push + at * minding_the_mark)))
    return model


def test_only_what_no_law_mentions_is_resampled(rng: np.random.Generator) -> None:
    free, minding = (taught(rng, minding_the_mark=minds) for minds in (False, True))
    assert free_properties(free) == {("mark", "at")}
    assert free_properties(minding) == frozenset()
    assert free_properties(LineModel()) == frozenset()  # nothing to read, nothing licensed
    stock = SceneStock()
    for at in (1.0, 3.0):
        stock.add(scene(0.5, at), first=True)
    layout, vectors = stock.draw(40, from_start=1.0, rng=rng)
    varied = stock.resampled(layout, vectors, free, rng=rng)
    np.testing.assert_array_equal(varied[:, :4], vectors[:, :4])
    assert ((varied[:, 4] >= 1.0) & (varied[:, 4] <= 3.0)).all()
    assert len(set(varied[:, 4])) == 40
    np.testing.assert_array_equal(stock.resampled(layout, vectors, minding, rng=rng), vectors)


def blocks(speed: float) -> Scene:
    return BLOCKS.scene({f"block{k}": [*np.arange(9.0), speed + k, 5.0] for k in range(3)})


def test_perturbed_bodies_have_up_to_twice_the_speed_ever_seen_and_are_where_they_were(
    rng: np.random.Generator,
) -> None:
    stock = SceneStock()
    for speed in (-1.0, 1.0, 3.0):
        stock.add(blocks(speed), first=True)
    layout, vectors = stock.draw(400, from_start=1.0, rng=rng)
    kept = vectors.copy()
    perturbed = stock.perturbed(layout, vectors, WorldModel(BLOCKS), rng=rng)
    np.testing.assert_array_equal(vectors, kept)
    speeds = [layout.column(k, "vx") for k in range(3)]
    np.testing.assert_array_equal(np.delete(perturbed, speeds, axis=1), np.delete(kept, speeds, axis=1))
    for k, column in enumerate(speeds):  # seen: -1 to 3, and k more
        drawn = perturbed[:, column] - k
        assert drawn.min() >= -3.0 and drawn.max() <= 5.0
        assert drawn.min() < -2.0 and drawn.max() > 4.0


def test_what_no_law_moves_is_not_perturbed(rng: np.random.Generator) -> None:
    still = WorldModel(BLOCKS, targets=(Target("block", "weight"),))
    stock = SceneStock()
    stock.add(blocks(1.0), first=True)
    stock.add(blocks(2.0), first=True)
    layout, vectors = stock.draw(20, from_start=1.0, rng=rng)
    np.testing.assert_array_equal(stock.perturbed(layout, vectors, still, rng=rng), vectors)


def test_so_many_starts_are_perturbed_as_was_asked_for(rng: np.random.Generator) -> None:
    stock = SceneStock()
    for speed in (-1.0, 1.0, 3.0):
        stock.add(blocks(speed), first=True)
    model = WorldModel(BLOCKS)
    plain = DynaConfig(permute=False, resample=False)
    same = stock.starts(1_000, model, plain, rng=np.random.default_rng(5))[1]
    np.testing.assert_array_equal(
        same, stock.draw(1_000, from_start=plain.from_start, rng=np.random.default_rng(5))[1]
    )
    varied = stock.starts(1_000, model, replace(plain, perturb_velocity=0.25), rng=rng)[1]
    whole = np.isin(varied[:, stock.draw(1, from_start=1.0, rng=rng)[0].column(0, "vx")], (-1.0, 1.0, 3.0))
    assert 0.2 < (~whole).mean() < 0.3


def test_where_nothing_has_a_body_nothing_is_resampled(rng: np.random.Generator) -> None:
    """Position and speed of a flat env are no goal that may lie anywhere: they go with one another."""
    schema = SceneSchema((ObjectType("self", ("x", "v")),), (("self", "self"),))
    model = WorldModel(schema)
    for _ in range(60):
        x, v = rng.uniform(-1, 1, 2)
        before = schema.scene({"self": [x, v]})
        model.learn_one(Transition(before, schema.scene({"self": [x + 0.5 * v, 0.9 * v]})))
    assert model.modes("self", "v") and free_properties(model) == frozenset()


def test_what_the_law_of_another_property_of_its_type_mentions_is_not_resampled(
    rng: np.random.Generator,
) -> None:
    schema = SceneSchema(
        (ObjectType("block", (*POSE,), Box()), ObjectType("clock", ("time", "pace", "name"))),
        (("block", "block"), ("clock", "clock")),
        targets=(Target("clock", "time"),),
    )
    model = WorldModel(schema)
    for _ in range(60):
        time, pace, name = rng.uniform(-1, 1, 3)
        before = schema.scene({"block": np.arange(9.0), "clock": [time, pace, name]})
        model.learn_one(Transition(before, before.replace({("clock", "time"): time + pace})))
    assert free_properties(model) == {("clock", "time"), ("clock", "name")}
