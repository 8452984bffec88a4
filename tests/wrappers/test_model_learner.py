"""The wrapper watches and changes nothing."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from carts import CartEnv, run
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ResetNeeded

import relgym
from relgym.config import ModelConfig
from relgym.errors import ActionError, ConfigError, ObservationError
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Target
from relgym.wrappers import ModelLearner
from relgym.wrappers.study import NOTHING

HALF = np.array([0.5], np.float32)


def learned(steps: int = 100, **arguments: Any) -> ModelLearner:
    env = ModelLearner(CartEnv(), **arguments)
    run(env, steps)
    return env


def cart(env: ModelLearner) -> CartEnv:
    inner = env.unwrapped
    assert isinstance(inner, CartEnv)
    return inner


def everything(model: WorldModel) -> dict[str, Any]:
    return model.to_json(history=True)


# ---------------------------------------------------------------------- it watches
def test_what_the_env_says_passes_through_untouched() -> None:
    bare, watched = run(CartEnv(), 60), run(ModelLearner(CartEnv()), 60)
    assert str(bare) == str(watched)


def test_the_ball_env_passes_through_untouched_and_is_seeded_alike() -> None:
    bare, watched = (run(wrap(gym.make("relgym/BallBoxRamp-v0")), 50) for wrap in (lambda e: e, ModelLearner))
    assert str(bare) == str(watched)


def test_the_law_is_learned_in_physical_units_and_targets_are_found() -> None:
    model = learned().model
    assert model.targets == (Target("cart", "v"),)
    (mode,) = model.modes("cart", "v")
    assert mode.formula(6) == "v' = 0.9 v + 0.1 action.push"
    assert mode.examples >= 95


def test_every_step_reports_prediction_residual_and_what_was_learned() -> None:
    env = ModelLearner(CartEnv())
    env.reset(seed=0)
    first = env.step(HALF)[4]["relgym"]
    assert not first.prediction.parts  # nothing had changed yet: no targets
    assert ("cart", "v") in first.learned.parts
    run(env, 50)
    env.reset(seed=99)
    info = env.step(HALF)[4]
    assert info["push"] == 7.5
    assert info["relgym"].wrong == ()
    assert abs(info["relgym"].residuals["cart", "v"]) < 1e-12


def test_residuals_are_of_predictions_made_before_learning() -> None:
    env = ModelLearner(CartEnv(), targets=["cart.v"])
    env.reset(seed=0, options={"v": 10.0})
    report = env.step(HALF)[4]["relgym"]
    # No mode yet, so persistence: 0.9 * 10 + 0.1 * 7.5 = 9.75 came, 10 was said.
    assert report.residuals["cart", "v"] == pytest.approx(-0.25, abs=1e-12)
    assert report.wrong == (("cart", "v"),)


def test_prequential_error_falls() -> None:
    env = learned(300)
    assert env.prequential.steps == 300
    assert 0 < env.prequential.wrong["cart", "v"] < 30
    run(env, 1000, seed=1)
    assert env.prequential.recent == 0.0


def test_without_predicting_nothing_is_counted() -> None:
    env = learned(predict=False)
    assert env.prequential.steps == 0
    assert env.step(HALF)[4]["relgym"].prediction is None
    assert everything(env.model) == everything(_learned_likewise())


def _learned_likewise() -> WorldModel:
    env = learned()
    env.step(HALF)
    return env.model


def test_pausing_learning_leaves_the_model_as_it_is() -> None:
    env = learned()
    env.pause()
    assert not env.learning
    before = everything(env.model)
    run(env, 30, seed=7)
    assert everything(env.model) == before
    assert env.prequential.steps == 130
    env.learning = True
    run(env, 10, seed=8)
    assert env.model.seen == 110


def test_same_seed_same_bytes(tmp_path: Path) -> None:
    for name in ("a.json", "b.json"):
        learned().save(tmp_path / name)
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()


# ---------------------------------------------------------------------- episodes
def test_no_transition_crosses_a_reset() -> None:
    env = ModelLearner(CartEnv())
    for k in range(40):
        env.reset(seed=k)
        env.step(np.array([0.0], np.float32))
    assert env.model.seen == 40
    assert env.model.property_model("cart", "v").clusterer.noise_examples == 0


@pytest.mark.parametrize("inside", [True, False])
def test_pseudo_transitions_of_autoreset_are_dropped(inside: bool) -> None:
    if inside:
        env: gym.Env[Any, Any] = ModelLearner(gym.wrappers.Autoreset(CartEnv(length=5)))
    else:
        env = gym.wrappers.Autoreset(ModelLearner(CartEnv(length=5)))
    env.action_space.seed(0)
    env.reset(seed=0)
    for _ in range(60):  # 5 transitions, then a reset, ten times over
        env.step(env.action_space.sample())
    model = env.get_wrapper_attr("model")
    assert model.seen == 50
    assert model.property_model("cart", "v").clusterer.noise_examples == 0
    assert [m.formula(6) for m in model.modes("cart", "v")] == ["v' = 0.9 v + 0.1 action.push"]


def test_a_reset_is_needed_first() -> None:
    env = ModelLearner(CartEnv())
    with pytest.raises(ResetNeeded, match=r"call reset\(\) first"):
        env.step(HALF)


def test_the_current_scene_is_at_hand() -> None:
    env = ModelLearner(CartEnv())
    env.reset(options={"v": 10.0})
    assert env.scene["cart"]["v"] == 10.0
    assert env.view.with_action(env.scene, HALF)["action"]["push"] == 7.5


# ---------------------------------------------------------------------- bad input
def test_an_action_that_the_env_refuses_changes_nothing() -> None:
    env = learned()
    v, before = cart(env).v, everything(env.model)
    with pytest.raises(ValueError, match="could not convert string"):  # the env's own words
        env.step("left")
    assert (cart(env).v, env.skipped) == (v, 0)
    assert everything(env.model) == before
    env.step(HALF)  # the episode goes on
    assert env.model.seen == 101
    pushed = ModelLearner(gym.make("relgym/TruckPush-v0"))
    pushed.reset(seed=0)
    with pytest.raises(ActionError, match="within"):
        pushed.step([2.0, 0.0])
    assert pushed.model.seen == 0


def test_an_action_outside_its_space_that_the_env_takes_is_learned_from_as_it_was_given() -> None:
    env = learned()
    v = cart(env).v
    report = env.step([1.5])[4]["relgym"]
    assert cart(env).v == pytest.approx(0.9 * v + 0.1 * 12.5)
    assert report.learned is not None and not report.wrong
    assert (env.model.seen, env.skipped) == (101, 0)


def test_an_action_that_the_view_cannot_read_teaches_nothing_and_is_counted() -> None:
    env = learned()
    v, before = cart(env).v, everything(env.model)
    assert env.step([0.0, 0.0])[4]["relgym"] is NOTHING
    assert cart(env).v == pytest.approx(0.9 * v + 0.5)
    assert everything(env.model) == before
    assert env.skipped == 1
    env.step(HALF)
    assert env.model.seen == 101


BAD = [
    ({"cart": np.array([np.nan])}, "'cart', property 'v': expected a finite number, got nan"),
    ({"cart": np.array([-np.inf])}, "'cart', property 'v': expected a finite number, got -inf"),
    ({"cart": np.array([1.0, 2.0])}, r"'cart' of type 'cart': expected 1 properties .* shape \(2,\)"),
    ({"cart": np.array([1.0]), "cow": np.array([1.0])}, r"unknown objects \['cow'\]"),
    (np.array([1.0]), "property vector}, got ndarray"),
]


@pytest.mark.parametrize(("says", "message"), BAD)
def test_bad_observations_are_named_and_not_learned(says: Any, message: str) -> None:
    env = learned()
    env.reset(seed=3)
    before = everything(env.model)
    cart(env).says = says
    with pytest.raises(ObservationError, match=message) as caught:
        env.step(HALF)
    assert "the model is unchanged: call reset()" in str(caught.value)
    assert everything(env.model) == before
    with pytest.raises(ResetNeeded):
        env.step(HALF)
    with pytest.raises(ObservationError, match=message):
        env.reset()
    cart(env).says = None
    env.reset(seed=4)
    env.step(HALF)
    assert env.model.seen == 101


def test_vector_envs_are_refused_with_a_remedy() -> None:
    envs: Any = gym.make_vec("relgym/BallBoxRamp-v0", num_envs=2)
    with pytest.raises(ConfigError, match=r"vector env.*wrappers=\[ModelLearner\]"):
        ModelLearner(envs)
    envs.close()


def test_the_remedy_for_vector_envs_works() -> None:
    options = {"vectorization_mode": "sync", "wrappers": [ModelLearner], "task": None}
    envs = gym.make_vec("relgym/TruckPush-v0", num_envs=2, **options)
    envs.reset(seed=0)
    for _ in range(45):  # past the end of an episode, after 40
        *_, info = envs.step(envs.action_space.sample())
    assert info["relgym"].shape == (2,)
    first, second = envs.get_attr("model")
    assert first is not second and first.seen == second.seen == 44
    envs.close()


def test_arguments_that_mean_nothing_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"target 'v': expected 'ball\.vx'"):
        ModelLearner(CartEnv(), targets=["v"])
    with pytest.raises(ConfigError, match="drawings"):
        ModelLearner(CartEnv(), config={"clustering": {"drawings": 3}})
    with pytest.raises(ConfigError, match="window=0"):
        ModelLearner(CartEnv(), window=0)


# ---------------------------------------------------------------------- specs, copies, files
@pytest.mark.parametrize("targets", [["cart.v"], [("cart", "v")], [Target("cart", "v")]])
def test_targets_and_config_may_be_plain_data(targets: Any) -> None:
    env = ModelLearner(CartEnv(), targets=targets, config={"seed": 3, "clustering": {"draws": 99}})
    assert env.model.config.seed == 3
    assert env.model.config.clustering.draws == 99
    assert env.model.config.classification == ModelConfig().classification
    assert env.model.targets == (Target("cart", "v"),)


def test_the_spec_rebuilds_the_stack_with_an_empty_model() -> None:
    truck = Target("truck", "vx")
    env = ModelLearner(gym.make("relgym/TruckPush-v0"), config=ModelConfig(seed=3), targets=[truck])
    env.reset(seed=0)
    env.step(HALF)
    assert env.spec is not None
    for spec in (env.spec, EnvSpec.from_json(env.spec.to_json())):
        model = gym.make(spec).get_wrapper_attr("model")
        assert (model.seen, model.config, model.targets) == (0, ModelConfig(seed=3), (truck,))


def test_copies_learn_apart() -> None:
    env = learned()
    twin = copy.deepcopy(env)
    run(twin, 30, seed=5)
    assert (env.model.seen, twin.model.seen) == (100, 130)


def test_it_is_found_lazily_and_its_model_pickles() -> None:
    assert relgym.wrappers.ModelLearner is ModelLearner
    model = pickle.loads(pickle.dumps(learned().model))
    assert model.modes("cart", "v")[0].formula(6) == "v' = 0.9 v + 0.1 action.push"


def test_learning_goes_on_from_a_file_as_if_it_had_never_stopped(tmp_path: Path) -> None:
    def last(env: ModelLearner) -> bytes:
        run(env, 50, seed=9)
        env.model.save(tmp_path / "last.json", extra={})
        return (tmp_path / "last.json").read_bytes()

    env = learned()
    env.save(tmp_path / "half.json", history=True)
    assert last(ModelLearner(CartEnv(), model=tmp_path / "half.json")) == last(env)


def test_a_model_without_history_is_only_asked(tmp_path: Path) -> None:
    learned().save(tmp_path / "cart.json")
    with pytest.raises(ConfigError, match="history=True"):
        ModelLearner(CartEnv(), model=tmp_path / "cart.json")
    env = ModelLearner(CartEnv(), model=tmp_path / "cart.json", learn=False)
    run(env, 30)
    assert env.prequential.recent == 0.0
    with pytest.raises(ConfigError, match="history=True"):
        env.learning = True


def test_what_would_follow_an_observation_and_an_action_can_be_asked() -> None:
    env = learned()
    observation, _ = env.reset(seed=3)
    action = env.action_space.sample()
    told = env.predict(observation, action)
    assert told.ok
    following, *_ = env.step(action)
    said = env.view.observation(told.scene)
    np.testing.assert_allclose(np.concatenate(list(said.values())), np.concatenate(list(following.values())))
    with pytest.raises(
        ObservationError, match=r"expected a Scene, got ndarray.*predict\(observation, action\)"
    ):
        env.model.predict_one(np.zeros(3))


def test_a_model_of_another_world_is_refused(tmp_path: Path) -> None:
    learned().save(tmp_path / "cart.json", history=True)
    with pytest.raises(ConfigError, match="another world"):
        ModelLearner(gym.make("relgym/BallBoxRamp-v0"), model=tmp_path / "cart.json")
    with pytest.raises(ConfigError, match="keeps its targets and config"):
        ModelLearner(CartEnv(), model=tmp_path / "cart.json", config={"seed": 1})
    with pytest.raises(ConfigError, match=r"without reward or termination.*pass the learn_reward"):
        ModelLearner(CartEnv(), model=tmp_path / "cart.json", learn_reward=True)


def test_laws_that_are_rare_among_many_objects_are_found_though_nothing_was_explained_at_first() -> None:
    # Six orders of four boxes, one of which stands aside: in the first hundreds of steps no law explains most.
    env = ModelLearner(gym.make("relgym/TruckPush-v0", bystanders=1, disable_env_checker=True))
    env.reset(seed=0)
    env.action_space.seed(0)
    for _ in range(900):
        *_, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
    part = env.model.property_model("truck", "vx")
    assert not part.unexplained
    laws = {mode.formula() for mode in part.modes if "force" in mode.formula()}
    assert len(laws) == 3
    assert (part.clusterer.labels[-300:] == 0).mean() < 0.05


def test_a_bystander_makes_states_many_but_hides_no_law() -> None:
    # Boxes' places and sizes beside one that isn't pushed: hardly two steps are in the same relational state.
    env = ModelLearner(gym.make("relgym/TruckPush-v0", task="push", bystanders=1, disable_env_checker=True))
    env.reset(seed=100)
    env.action_space.seed(100)
    for _ in range(250):
        *_, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
    part = env.model.property_model("truck", "vx")
    assert {mode.formula(4) for mode in part.modes} == {
        "vx' = 0",
        "vx' = vx + 0.025 action.force - 7.5 box.friction",
        "vx' = vx + 0.025 action.force - 5 box_a.friction - 2.5 box_b.friction",
        "vx' = vx + 0.025 action.force - 2.5 box_a.friction - 2.5 box_b.friction - 2.5 box_c.friction",
    }
    assert part.clusterer.noise_examples == 0
