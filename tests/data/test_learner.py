"""Models learned from data: the same as those learned online, to the last byte of their files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from plain_envs import Slider, Wheel

import relgym
from relgym.data import DataLearner, Dataset, Episode
from relgym.envs.views import FunctionView, NumbersView, TableView
from relgym.errors import ConfigError, DataError
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ObjectType, Transition
from relgym.scene.schema import SceneSchema
from relgym.wrappers import ModelLearner


def lived(env: gym.Env[Any, Any], steps: int, seed: int = 0, **options: Any) -> ModelLearner:
    """Learned online from random actions, as `Dataset.collect` chooses them."""
    learner = ModelLearner(env, **options)
    learner.action_space.seed(seed)
    learner.reset(seed=seed)
    for _ in range(steps):
        *_, terminated, truncated, _ = learner.step(learner.action_space.sample())
        if terminated or truncated:
            learner.reset()
    return learner


def file_of(model: WorldModel | ModelLearner, folder: Path, *, history: bool = True) -> bytes:
    model.save(folder / "model.relgym", history=history)
    return (folder / "model.relgym").read_bytes()


def cart() -> gym.Env[Any, Any]:
    return gym.make("CartPole-v1")


def ball() -> gym.Env[Any, Any]:
    return gym.make("relgym/BallBoxRamp-v0")


def truck() -> gym.Env[Any, Any]:
    return gym.make("relgym/TruckPush-v0")


def rows(observation_space: spaces.Space[Any], action_space: spaces.Space[Any]) -> TableView:
    return TableView(observation_space, action_space, columns=("x", "v"), match={"x": 15.0})


class Loose(Slider):
    """Two sliders as rows of a table, in an order of their own at every step."""

    def __init__(self) -> None:
        super().__init__(length=25)
        self.observation_space = spaces.Box(-100.0, 100.0, (2, 2), np.float64)

    def _seen(self) -> Any:
        table = np.array([[self.x, self.v], [self.x + 30.0, self.v]])
        return table[:: 1 if self.steps % 3 else -1].copy()


class NotAngles(Wheel):
    """Shows numbers that pass for cosine and sine until the tenth step."""

    def _seen(self) -> Any:
        seen = super()._seen()
        self.count = getattr(self, "count", 0) + 1
        return (0.5 * seen if self.count > 10 else seen).astype(np.float32)


WORLDS: Mapping[str, tuple[Callable[[], gym.Env[Any, Any]], int, dict[str, Any]]] = {
    "scenes": (ball, 220, {}),
    "scenes with a task": (truck, 20, {"learn_reward": True, "learn_termination": True}),
    "float32": (cart, 45, {}),
    "task and dict config": (cart, 40, {"learn_termination": True, "config": {"seed": 4}}),
    "angles guessed": (Wheel, 60, {}),
    "angles refuted": (NotAngles, 60, {}),
    "rows matched": (Loose, 110, {"view": rows}),
    "targets": (lambda: Slider(40), 150, {"targets": ["self.x1"], "learn_reward": True}),
}


@pytest.mark.parametrize("world", WORLDS)
def test_byte_for_byte_the_model_learned_online(world: str, tmp_path: Path) -> None:
    make, steps, options = WORLDS[world]
    online = lived(make(), steps, **options)
    learner = DataLearner(Dataset.collect(make(), steps, seed=0), **options).run()
    for history in (True, False):
        assert file_of(learner.model, tmp_path, history=history) == file_of(online, tmp_path, history=history)
    assert learner.prequential.wrong == online.prequential.wrong
    assert learner.withdrawn == online.withdrawn


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "steps", "options"),
    [
        ("CartPole-v1", 1_000, {"learn_reward": True, "learn_termination": True}),
        ("MountainCar-v0", 1_000, {"config": {"features": ["trig"]}}),
        ("relgym/BallBoxRamp-v0", 4_000, {}),
        ("relgym/TruckPush-v0", 400, {"learn_reward": True}),
    ],
)
def test_byte_for_byte_after_many_steps(
    name: str, steps: int, options: dict[str, Any], tmp_path: Path
) -> None:
    online = lived(gym.make(name), steps, **options)
    model = relgym.fit(Dataset.collect(gym.make(name), steps, seed=0), **options)
    assert file_of(model, tmp_path) == file_of(online, tmp_path)


def test_withdrawn_angles_are_among_the_worlds() -> None:
    assert lived(NotAngles(), 60).withdrawn


@pytest.mark.parametrize(("make", "steps"), [(ball, 90), (cart, 25)])
def test_from_transitions_too(make: Callable[[], gym.Env[Any, Any]], steps: int, tmp_path: Path) -> None:
    online = lived(make(), steps)
    transitions = [r.transition for r in DataLearner(Dataset.collect(make(), steps, seed=0), learn=False)]
    assert all(isinstance(t, Transition) for t in transitions)
    model = relgym.fit(transitions)
    model.extra = online.model.extra  # transitions know of no env
    assert file_of(model, tmp_path) == file_of(online, tmp_path)


def test_from_what_a_recorder_kept(tmp_path: Path) -> None:
    from relgym.wrappers.dyna.recorder import TransitionRecorder

    online = lived(ball(), 90)
    recorder = TransitionRecorder(ball())
    recorder.action_space.seed(0)
    recorder.reset(seed=0)
    for _ in range(90):
        *_, terminated, truncated, _ = recorder.step(recorder.action_space.sample())
        if terminated or truncated:
            recorder.reset()
    model = relgym.fit(recorder.take())
    model.extra = online.model.extra
    assert file_of(model, tmp_path) == file_of(online, tmp_path)


def test_from_a_recording_of_the_experiments() -> None:
    from relgym.experiments.recording import record

    view = NumbersView(Slider().observation_space, Slider().action_space)
    kept = record(Slider(30), view, lambda _, rng: rng.uniform(-1.0, 1.0, 1), 80, seed=1)
    data = Dataset.from_arrays(
        kept.before, kept.actions, kept.after, terminations=kept.terminated, truncations=kept.truncated
    )
    model = relgym.fit(data, view=kept.view)
    assert model.modes("self", "x1")[0].formula() == "x1' = 0.8 x1 + 0.5 action.a"


def test_from_arrays_too(tmp_path: Path) -> None:
    online = lived(cart(), 25)
    data = Dataset.collect(cart(), 25, seed=0)
    steps = [(e, k) for e in data for k in range(len(e))]
    arrays = Dataset.from_arrays(
        np.array([e.observations[k] for e, k in steps]),
        np.array([e.actions[k] for e, k in steps]),
        np.array([e.observations[k + 1] for e, k in steps]),
        rewards=np.array([e.reward(k) for e, k in steps]),
        terminations=np.array([e.terminates(k) for e, k in steps]),
        env=cart(),
    )
    assert len(arrays) == 25
    assert [len(e) for e in arrays if len(e)] == [len(e) for e in data if len(e)]
    assert file_of(relgym.fit(arrays), tmp_path) == file_of(online, tmp_path)


def test_a_model_goes_on(tmp_path: Path) -> None:
    make, _, options = WORLDS["rows matched"]
    whole = Dataset.collect(make(), 100, seed=0)  # four episodes of 25, and the beginning of another
    halves = [
        Dataset(part, whole.observation_space, whole.action_space)
        for part in (whole.episodes[:2], whole.episodes[2:])
    ]
    model = relgym.fit(halves[0], **options)
    again = relgym.fit(halves[1], model=model, **options)
    assert again is model
    once = relgym.fit(whole, **options)
    again.extra = once.extra  # first scenes are those of the data seen last
    assert file_of(again, tmp_path) == file_of(once, tmp_path)


def test_reports_are_those_of_the_steps() -> None:
    data = Dataset.collect(Slider(30), 90, seed=1)
    reports = list(DataLearner(data))
    assert len(reports) == 90
    assert [r.wrong for r in reports[:1]] == [()]  # no target yet
    assert reports[-1].wrong == ()
    online = lived(Slider(30), 90, seed=1)
    assert sum(len(r.wrong) for r in reports) == sum(online.prequential.wrong.values())


def test_progress_in_the_manner_of_river() -> None:
    data = Dataset.collect(Slider(30), 100, seed=1)
    reports = list(relgym.progressive(data, every=40))
    assert [r.steps for r in reports] == [40, 80, 100]
    assert [r.score.transitions for r in reports] == [40, 40, 20]
    assert reports[-1].score.right == 1.0
    assert reports[0].score.right < 1.0
    online = lived(Slider(30), 100, seed=1)
    wrong = sum(round((1.0 - t.right) * t.count) for r in reports for t in r.score.targets.values())
    assert wrong == sum(online.prequential.wrong.values())
    with pytest.raises(ConfigError, match="every=0"):
        relgym.progressive(data, every=0)


def test_the_score_on_fresh_data() -> None:
    model = relgym.fit(Dataset.collect(Slider(30), 120, seed=1))
    fresh = Dataset.collect(Slider(30), 60, seed=2)
    before = model.to_json(history=True)
    score = relgym.score(model, fresh)
    assert (score.transitions, score.exact, score.right, score.abstained) == (60, 60, 1.0, 0.0)
    assert score.r2 == pytest.approx(1.0)
    assert set(score.targets) == {"self.x0", "self.x1"}
    assert score.targets["self.x0"].rmse < 1e-12
    assert "60 of 60 steps right in every target" in str(score)
    assert model.to_json(history=True) == before


def test_the_score_of_rows_that_have_to_be_matched() -> None:
    make, _, options = WORLDS["rows matched"]
    model = relgym.fit(Dataset.collect(make(), 110, seed=1), **options)
    score = relgym.score(model, Dataset.collect(make(), 50, seed=2))
    assert score.right == 1.0


def test_the_score_of_rewards() -> None:
    model = relgym.fit(Dataset.collect(Slider(30), 120, seed=1), learn_reward=True)
    fresh = Dataset.collect(Slider(30), 60, seed=2)
    assert relgym.score(model, fresh).targets["task.reward"].right == 1.0
    own = NumbersView(fresh.observation_space, fresh.action_space)
    assert relgym.score(model, fresh, view=own).targets["task.reward"].right == 1.0


def test_what_the_model_abstains_from_is_counted() -> None:
    data = Dataset.collect(Slider(30), 60, seed=2)
    score = relgym.score(relgym.fit(Dataset.collect(Slider(30), 3, seed=1)), data)
    assert (score.right, score.abstained) == (0.0, 1.0)


# ---------------------------------------------------------------------- trouble
def spoilt(value: float) -> Dataset:
    data = Dataset.collect(Slider(30), 50, seed=1)
    data.episodes[1].observations[3][0] = value
    return data


def test_a_bad_observation_is_found_before_anything_is_learned() -> None:
    model = relgym.fit(Dataset.collect(Slider(30), 20, seed=1))
    seen, extra = model.seen, dict(model.extra)
    with pytest.raises(DataError, match=r"episode 1, observation 3: .*nan.*nothing was learned"):
        relgym.fit(spoilt(np.nan), model=model)
    assert (model.seen, model.extra) == (seen, extra)
    with pytest.raises(DataError, match="episode 1, observation 3"):
        relgym.score(model, spoilt(np.inf))


def test_a_bad_observation_can_be_skipped() -> None:
    learner = DataLearner(spoilt(np.nan), bad_observations="skip").run()
    assert (learner.skipped, learner.model.seen) == (1, 48)
    assert relgym.score(learner.model, spoilt(np.nan), bad_observations="skip").transitions == 48


def test_rewards_that_nobody_wrote_down_can_not_be_learned() -> None:
    x = np.arange(8.0)[:, None]
    data = Dataset.from_arrays(x[:-1], np.ones((7, 1)), x[1:])
    assert relgym.fit(data).seen == 7
    with pytest.raises(DataError, match="rewards weren't recorded"):
        relgym.fit(data, learn_reward=True)


@pytest.mark.parametrize("data", [None, 7, {"observations": []}, b"", np.float64(3)])
def test_what_is_no_data(data: Any) -> None:
    with pytest.raises(DataError, match="expected"):
        relgym.fit(data)


def test_what_a_dataset_knows_is_not_said_twice() -> None:
    data = Dataset.collect(Slider(30), 10, seed=1)
    with pytest.raises(ConfigError, match="leave out env"):
        relgym.fit(data, env=Slider())
    transitions = [r.transition for r in DataLearner(data)]
    with pytest.raises(ConfigError, match="are transitions"):
        relgym.fit(transitions, learn_reward=True)
    with pytest.raises(ConfigError, match="either model or those"):
        relgym.fit(transitions, model=relgym.fit(data), config={"seed": 2})
    with pytest.raises(ConfigError, match="expected a WorldModel"):
        relgym.score("model.json", data)  # type: ignore[arg-type]


def test_a_view_of_functions_is_passed_again() -> None:
    schema = SceneSchema((ObjectType("box", ("x", "v")),), (("box", "box"),))

    def view(_: spaces.Space[Any], actions: spaces.Space[Any]) -> FunctionView:
        return FunctionView(schema, lambda seen, info: {"box": seen}, actions)

    model = relgym.fit(Dataset.collect(Slider(30), 100, seed=1), view=view)
    fresh = Dataset.collect(Slider(30), 40, seed=2)
    assert relgym.score(model, fresh, view=view).right == 1.0
    with pytest.raises(relgym.errors.ModelFileError, match="pass the FunctionView again"):
        relgym.score(model, fresh)


def test_episodes_as_records() -> None:
    data = Dataset.collect(Slider(30), 90, seed=1)
    dicts = [
        {
            "observations": np.array(e.observations),
            "actions": np.array(e.actions),
            "rewards": np.array(e.rewards),
            "truncations": np.array([False] * (len(e) - 1) + [e.truncated]),
        }
        for e in data
        if len(e)
    ]
    assert relgym.fit(dicts, env=Slider()).targets == relgym.fit(data).targets
    model = relgym.fit([Episode(e.observations, e.actions) for e in data], env=Slider())
    assert model.seen == 90
