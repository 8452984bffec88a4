"""World models that predict by laws of motion: where they do, what they say, and what their files keep."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relgym.config import ModelConfig
from relgym.envs.ball_box_ramp import BallBoxRampEnv
from relgym.envs.dreams.env import LearnedModelEnv
from relgym.errors import ConfigError
from relgym.experiments.bodies.worlds import Setting, body_rooms
from relgym.experiments.data import ball_episodes, truck_episodes
from relgym.experiments.episodes import Episode
from relgym.experiments.laws.score import taught
from relgym.experiments.laws.trials import trial_rooms
from relgym.experiments.laws.worlds import Ball, Material, World
from relgym.experiments.rollouts import largest_errors
from relgym.model.predicting.prediction import Outcome
from relgym.model.reports.report import report
from relgym.model.world_model import WorldModel
from relgym.program.records import FREE, TOUCHING
from relgym.scene.objects import Scene, Target

VX, VY = Target("ball", "vx"), Target("ball", "vy")


def train(episodes: list[Episode], config: ModelConfig | None = None) -> WorldModel:
    model = WorldModel(episodes[0].schema, config)
    for episode in episodes:
        for each in episode.transitions():
            model.learn_one(each)
    return model


@pytest.fixture(scope="module")
def model() -> WorldModel:
    return train(list(ball_episodes(2, seed=0, episodes=10)))


@pytest.fixture(scope="module")
def unseen() -> list[Episode]:
    return list(ball_episodes(2, seed=1, episodes=6, test=True))


def test_laws_are_the_shorter_description_of_a_bouncing_ball(model: WorldModel) -> None:
    assert model.governed == {"ball"}
    assert model.governs(VX)
    assert model.governs(VY)
    assert model.laws is not None


def test_every_step_is_right_corners_included(model: WorldModel, unseen: list[Episode]) -> None:
    for episode in unseen:
        found = model.predict_batch(episode.layout, episode.vectors[:-1])
        assert found.ok.all()
        assert found.frames == ("contact", "contact")
        assert np.abs(found.vectors - episode.vectors[1:]).max() < 1e-12
    assert largest_errors(model, unseen).max() < 1e-9


def test_one_by_one_as_in_a_batch(model: WorldModel, unseen: list[Episode]) -> None:
    episode = unseen[0]
    batch = model.predict_batch(episode.layout, episode.vectors[:-1])
    for k in range(len(episode)):
        single = model.predict_one(episode.scene(k))
        assert single.scene.vector.tobytes() == batch.vectors[k].tobytes()
        assert [p.mode for p in single.parts] == batch.modes[k].tolist()


def test_predictions_name_the_frame_and_what_is_touched(model: WorldModel, unseen: list[Episode]) -> None:
    parts = [model.predict_one(unseen[0].scene(k))["ball", "vx"] for k in range(200)]
    free = next(p for p in parts if p.mode == FREE)
    touching = next(p for p in parts if p.mode == TOUCHING)
    assert (free.frame, free.roles) == ("world", ("ball",))
    assert (touching.frame, touching.roles[0]) == ("contact", "ball")
    assert len(touching.roles) > 1


def test_modes_alone_when_asked_for() -> None:
    episodes = list(ball_episodes(1, seed=0, episodes=2))
    model = train(episodes, ModelConfig(frames="world"))
    assert (model.laws, model.governed) == (None, frozenset())
    with pytest.raises(ConfigError, match="frames must be one of"):
        ModelConfig(frames="contact")  # type: ignore[arg-type]


def test_without_contacts_nothing_changes() -> None:
    episodes = list(truck_episodes("step", seed=0, repeats=1))[:8]
    by_default, along_axes = (train(episodes, ModelConfig(frames=f)) for f in ("auto", "world"))  # type: ignore[arg-type]
    assert by_default.governed == frozenset()
    assert by_default.to_json()["targets"] == along_axes.to_json()["targets"]


def test_modes_rest_while_laws_suffice(model: WorldModel) -> None:
    episode = next(iter(ball_episodes(2, seed=9, episodes=1)))
    before = model.property_model("ball", "vx").clusterer.y.size
    reports = [model.learn_one(each) for each in list(episode.transitions())[:5]]
    assert [r.parts for r in reports] == [{}] * 5
    assert model.property_model("ball", "vx").clusterer.y.size == before


def test_laws_that_fail_wake_the_modes() -> None:
    model = train(list(ball_episodes(1, seed=0, episodes=6)))
    assert not model.learn_one(next(next(ball_episodes(1, seed=3, episodes=1)).transitions())).parts
    strange = next(iter(ball_episodes(1, seed=4, episodes=1)))
    vectors = strange.vectors.copy()
    column = strange.layout.column(strange.layout.index("ball"), "vx")
    vectors[1:, column] += 0.01 * np.arange(1, len(vectors))  # a wind that never blew before
    odd = Episode(strange.schema, strange.layout, vectors, strange.truth, strange.configuration)
    reports = [model.learn_one(each) for each in list(odd.transitions())[:30]]
    assert any(("ball", "vx") in r.parts for r in reports[1:])


def test_what_modes_say_of_bodies_that_turn_is_no_claim(tmp_path: Path) -> None:
    room = body_rooms(Setting(("box",), magnet=0.3), 1, seed=412, steps=150)[0]
    model = taught([room])
    assert not model.governed and any(part.modes for part in model._parts.models.values())
    model.save(tmp_path / "magnet.json", history=True)
    for each in (model, WorldModel.load(tmp_path / "magnet.json")):
        told = each.predict_batch(room.layout, room.vectors[:-1])
        assert not told.ok.any()
        assert not any(part.ok for part in each.predict_one(next(room.transitions()).before).parts)


def test_a_world_the_laws_never_met_is_not_guessed(unseen: list[Episode]) -> None:
    model = train(list(ball_episodes(1, seed=0, episodes=4)))
    assert model.laws is not None
    assert model.laws.pair is not None
    env = BallBoxRampEnv(balls=2)
    scene = env.reset(seed=0)[1]["scene"]
    vector = scene.vector.copy()
    one, two = (scene.layout.slice(scene.layout.index(name)) for name in ("ball", "ball2"))
    vector[two][:2] = vector[one][:2] + np.array([0.5 * vector[one][6], 0.0])
    part = model.predict_one(type(scene)(env.schema, scene.layout, vector))["ball", "vx"]
    assert part.outcome is Outcome.OUTSIDE  # how two balls share an impulse was never seen


@pytest.mark.parametrize("history", [False, True])
def test_files_keep_the_laws(model: WorldModel, unseen: list[Episode], history: bool, tmp_path: Path) -> None:
    model.save(tmp_path / "one", history=history)
    again = WorldModel.load(tmp_path / "one")
    episode = unseen[0]
    ours, theirs = (m.predict_batch(episode.layout, episode.vectors[:-1]) for m in (model, again))
    assert ours.vectors.tobytes() == theirs.vectors.tobytes()
    again.save(tmp_path / "two", history=history)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


def test_learning_goes_on_as_if_never_saved(tmp_path: Path) -> None:
    episodes = list(ball_episodes(2, seed=2, episodes=3))
    whole = train(episodes)
    train(episodes[:1]).save(tmp_path / "part", history=True)
    again = WorldModel.load(tmp_path / "part")
    for episode in episodes[1:]:
        for each in episode.transitions():
            again.learn_one(each)
    again.save(tmp_path / "again", history=True)
    whole.save(tmp_path / "whole", history=True)
    assert (tmp_path / "again").read_bytes() == (tmp_path / "whole").read_bytes()


def test_description(model: WorldModel) -> None:
    assert [str(row) for row in report(model).laws] == [
        "ball touching nothing: vx' = vx, vy' = vy - 0.00098",
        "touching, along the normal n: v'_n = max(u_n, -0.95 v_n)",
        "touching, along the slip direction t: v'_t = max(0, u_t - 0.2 J_n)",
    ]
    assert report(model).targets == ()
    text = model.describe(details=True, frame="world", incline=45.0)
    assert "max(u_n, -0.95 v_n)" in text
    assert "vx' = -0.17 vx - 1.17 vy + 0.000588" in text
    with pytest.raises(ConfigError, match="frame='own'"):
        model.describe(details=True, frame="own")


def test_explanations(model: WorldModel, unseen: list[Episode]) -> None:
    episode = unseen[0]
    modes = model.predict_batch(episode.layout, episode.vectors[:-1]).modes[:, 0]
    free, touching = (int(np.flatnonzero(modes == m)[0]) for m in (FREE, TOUCHING))
    assert "since it touches nothing" in model.explain(episode.scene(free))
    text = model.explain(episode.scene(touching))
    assert "ball touches" in text
    assert "v'_n = max(u_n, -0.95 v_n)" in text


def test_a_spinning_ball_is_predicted_told_and_kept(tmp_path: Path) -> None:
    world = World(2, (Ball(spins=True),), materials={"block": Material(0.9, 0.2)})
    model = taught(trial_rooms(world, 5, seed=1))
    room = trial_rooms(world, 1, seed=2)[0]
    batch = model.predict_batch(room.layout, room.vectors[:-1])
    assert np.abs(batch.vectors - room.vectors[1:]).max() < 1e-12  # the angle included
    touching = int(np.flatnonzero((batch.modes == TOUCHING).all(axis=1))[0])
    scene = Scene(room.schema, room.layout, room.vectors[touching])
    parts = model.predict_one(scene).parts
    assert {p.property: p.frame for p in parts} == {"vx": "point", "vy": "point", "spin": "point"}
    assert "v'_t = max(0, u_t - 0.6 J_n)" in model.explain(scene)
    assert "velocities take 0.3333333 of the change along t, spins the rest" in model.describe(details=True)
    with pytest.raises(ConfigError, match="contact normals"):
        model.describe(details=True, frame="world", incline=30.0)
    model.save(tmp_path / "spin")
    again = WorldModel.load(tmp_path / "spin").predict_batch(room.layout, room.vectors[:-1])
    assert again.vectors.tobytes() == batch.vectors.tobytes()


def test_a_dream_by_laws_is_the_real_thing(model: WorldModel) -> None:
    env = BallBoxRampEnv(incline=45.0, elasticity=0.95, friction=0.2)
    dream = LearnedModelEnv(model, like=env)
    env.reset(seed=5)
    scene = env.scene
    dream.reset(options={"scene": scene})
    for _ in range(150):
        real, *_ = env.step(0)
        seen, _, _, truncated, info = dream.step(0)
        assert not truncated, info
        assert np.abs(real["ball"] - seen["ball"]).max() < 1e-9
