"""The rules of a model say what the model says: they are read back from their text and asked about fresh scenes."""

from __future__ import annotations

import copy
import re
from collections.abc import Iterable, Iterator
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from points import schema_of, transitions

import relgym
from relgym.clustering.mode import NOISE
from relgym.config import ModelConfig
from relgym.errors import ConfigError
from relgym.experiments.data import ball_episodes, truck_episodes
from relgym.experiments.episodes import Episode
from relgym.experiments.worlds.online import learned
from relgym.model.learning.fitting import compare_and_learn
from relgym.model.reports.rules import agreement, rule_list
from relgym.model.target.limits import Limits
from relgym.model.target.scope import Scope
from relgym.model.target.stops import Stop, Stops
from relgym.model.world_model import WorldModel
from relgym.numeric.tree import DecisionTree
from relgym.reporting.conditions import parse_condition
from relgym.reporting.functions import parse_sum
from relgym.reporting.parser import parse_rules
from relgym.reporting.rules import Branch, PropertyRules, RuleList
from relgym.scene.objects import ACTION, ObjectType, Scene, Target, Transition
from relgym.scene.schema import SceneSchema
from relgym.wrappers.follower import scenes_of
from relgym.wrappers.views import view_of


def scenes(episodes: Iterable[Episode]) -> Iterator[Scene]:
    for episode in episodes:
        yield from (episode.scene(k) for k in range(len(episode.vectors) - 1))


def agreed(model: WorldModel, fresh: Iterable[Scene]) -> float:
    """Share of what the model says that its text says as well."""
    text = model.describe()
    rules = parse_rules(text)
    assert str(rules) == text
    return agreement(model, rules, fresh)[1]


@pytest.fixture(scope="module")
def ball() -> WorldModel:
    return learned(ball_episodes(1, seed=0, episodes=15), config=ModelConfig(frames="world"))


def test_the_ball_in_text(ball: WorldModel) -> None:
    assert agreed(ball, scenes(ball_episodes(1, seed=1, episodes=5, test=True))) >= 0.999
    text = ball.describe(check=islice(scenes(ball_episodes(1, seed=1, episodes=1)), 50))
    assert "\nAgreement: on 50 steps these rules say what the model says of 100 % of 100 values." in text
    assert parse_rules(text).agreement
    assert "mode" not in text.split("Agreement")[1].split("\n", 1)[1], "people aren't shown numbers of modes"


def test_the_truck_in_text() -> None:
    model = learned(truck_episodes(seed=0))
    assert agreed(model, scenes(truck_episodes(seed=1, test=True))) >= 0.999
    assert re.search(r"box_., box_., box_. := any box", model.describe())
    assert "Scenes held truck × 1, box × 3; other numbers of objects were never seen." in model.describe()


def test_laws_in_text() -> None:
    model = learned(ball_episodes(1, seed=0, episodes=15), config=ModelConfig(frames="auto"))
    assert agreed(model, scenes(ball_episodes(1, seed=1, episodes=5, test=True))) == 1.0
    text = model.describe()
    assert "    if   u_n > -0.9 v_n:" in text and "# bounces, or rests where v_n = 0" in text


def test_any_env_in_text(tmp_path: Path) -> None:
    env = relgym.wrappers.ModelLearner(gym.make("MountainCar-v0"), config={"features": ("trig",)})
    env.action_space.seed(0)
    env.reset(seed=0)
    for _ in range(600):
        _, _, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
    fresh = gym.make("MountainCar-v0")
    assert agreed(env.model, scenes_of(fresh, view_of(fresh), 400, seed=1)) == 1.0
    assert "always:  x0' = x0 + x1'" in env.model.describe()


def test_a_file_keeps_rules_names_and_advice(ball: WorldModel, tmp_path: Path) -> None:
    name = next(iter(ball.rules()["ball.vy"].names))
    ball.name_condition(f"ball.vy: {name}", "in free flight")
    try:
        text = ball.describe()
        assert "in free flight :=" in text
        ball.save(tmp_path / "ball.json")
        ball.save(tmp_path / "ball.zip", history=True)
    finally:
        ball.condition_names = {}
    for path in ("ball.json", "ball.zip"):
        loaded = WorldModel.load(tmp_path / path)
        assert loaded.describe() == text
        assert loaded.describe(digits=12) != text
        assert list(loaded.advice()) == list(ball.advice())
        again = WorldModel.load(tmp_path / path)
        again.save(tmp_path / "again.json")
        assert WorldModel.load(tmp_path / "again.json").describe() == text


def test_names_for_one_text_only(ball: WorldModel) -> None:
    before = ball.describe()
    name = next(iter(ball.rules()["ball.vy"].names))
    assert "flying :=" in ball.describe(names={f"ball.vy: {name}": "flying"})
    assert ball.describe() == before
    with pytest.raises(ConfigError, match="no condition is called 'nothing'"):
        ball.name_condition("nothing", "something")


def test_rules_follow_what_is_learned() -> None:
    episodes = list(ball_episodes(1, seed=0, episodes=2))
    model = WorldModel(episodes[0].schema, ModelConfig(frames="world"))
    for transition in episodes[0].transitions():
        model.learn_one(transition)
    first = model.rules()
    assert model.rules() == first and first.transitions == 200
    for transition in episodes[1].transitions():
        model.learn_one(transition)
    assert model.rules().transitions == 400


@pytest.mark.slow
@pytest.mark.parametrize("experiment", [1, 2])
def test_the_ball_in_text_on_all_fresh_steps(experiment: int) -> None:
    model = learned(ball_episodes(experiment, seed=0), config=ModelConfig(frames="world"))
    fresh = islice(scenes(ball_episodes(experiment, seed=1, test=True)), 24_000)
    assert agreed(model, fresh) >= 0.999


@pytest.mark.slow
@pytest.mark.parametrize(
    ("env_id", "features"), [("MountainCar-v0", ("trig",)), ("Pendulum-v1", ("trig",)), ("CartPole-v1", ())]
)
def test_any_env_in_text_on_many_fresh_steps(env_id: str, features: tuple[str, ...]) -> None:
    env = relgym.wrappers.ModelLearner(gym.make(env_id), config={"features": features})
    env.action_space.seed(0)
    env.reset(seed=0)
    for _ in range(10_000):
        _, _, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
    env.model.finish()
    fresh = gym.make(env_id)
    view = view_of(fresh, env.model.extra.get("view"))
    assert agreed(env.model, scenes_of(fresh, view, 24_000, seed=1)) >= 0.999


# ---------------------------------------------------------------------- where modes speak, and where they don't
PUSHED = SceneSchema(
    (ObjectType("cart", ("x", "v")), ObjectType(ACTION, ("push", "brake"), flags=("brake",))),
    (("cart", "cart"), (ACTION, ACTION)),
    targets=(Target("cart", "v"),),
)
COLUMNS = ("x", "v", "action.push", "action.brake")


def pushed_scene(x: float, v: float, push: float, brake: float = 0.0) -> Scene:
    return PUSHED.scene({"cart": [x, v], ACTION: [push, brake]})


@cache
def pushed() -> WorldModel:
    """A cart of which v' = v / 2 + push."""
    model, rng = WorldModel(PUSHED), np.random.default_rng(0)
    for x, v, push in rng.uniform(-2.0, 2.0, (40, 3)).tolist():
        before = pushed_scene(x, v, push, float(x > 0.0))
        model.learn_one(Transition(before, before.replace({("cart", "v"): 0.5 * v + push})))
    model.finish()
    return model


def scoped(tree: DecisionTree | None, **walls: Any) -> WorldModel:
    """The cart, whose modes speak where a tree says so."""
    model = copy.deepcopy(pushed())
    part = model.property_model("cart", "v")
    part.fallback.scope = Scope(tree, -9.0, 9.0)
    for name, value in walls.items():
        setattr(part, name, value)
    model._programs.changed()
    return model


def tree_of(*nodes: tuple[str, float] | bool, shape: tuple[tuple[int, int], ...]) -> DecisionTree:
    """A tree in preorder: tests (column, threshold) and leaves (yes or no), with what follows each."""
    tests = [n if isinstance(n, tuple) else None for n in nodes]
    return DecisionTree(
        COLUMNS,
        tuple(-1 if t is None else COLUMNS.index(t[0]) for t in tests),
        tuple(0.0 if t is None else t[1] for t in tests),
        tuple(b for b, _ in shape),
        tuple(a for _, a in shape),
        tuple(2.0 if n is True else 0.0 for n in nodes),
        (1.0,) * len(nodes),
    )


ONE_TEST = ((1, 2), (1, 1), (2, 2))
TWO_TESTS = ((1, 4), (2, 3), (2, 2), (3, 3), (4, 4))


@pytest.mark.parametrize(
    ("tree", "lines"),
    [
        (
            tree_of(("x", 0.5), True, False, shape=ONE_TEST),
            ["if   x <= 0.5: v' = 0.5 v + action.push", "else: no prediction (unexplained elsewhere)"],
        ),
        (
            tree_of(("action.brake", 0.5), True, False, shape=ONE_TEST),
            [
                "if   not action.brake: v' = 0.5 v + action.push",
                "else: no prediction (unexplained elsewhere)",
            ],
        ),
        (  # no: x <= 1 and v > 0, two tests; yes: three of them
            tree_of(("x", 1.0), ("v", 0.0), True, False, True, shape=TWO_TESTS),
            ["if   x <= 1 and v > 0: no prediction (unexplained there)", "else: v' = 0.5 v + action.push"],
        ),
        (  # of two tests of one number on one way the closer one is told
            tree_of(("x", 1.0), ("x", 0.0), True, False, False, shape=TWO_TESTS),
            ["if   x <= 0: v' = 0.5 v + action.push", "else: no prediction (unexplained elsewhere)"],
        ),
        (  # subtrees that say one thing are one part
            tree_of(("x", 1.0), ("v", 0.0), False, False, True, shape=TWO_TESTS),
            ["if   x > 1: v' = 0.5 v + action.push", "else: no prediction (unexplained elsewhere)"],
        ),
        (tree_of(("x", 1.0), True, True, shape=ONE_TEST), ["always: v' = 0.5 v + action.push"]),
        (
            tree_of(("x", 1.0), False, False, shape=ONE_TEST),
            ["always: no prediction (unexplained everywhere)"],
        ),
        (None, ["always: v' = 0.5 v + action.push"]),
    ],
)
def test_where_modes_speak_by_hand(tree: DecisionTree | None, lines: list[str]) -> None:
    text = rule_list(scoped(tree)).text(3)
    start = text.index("cart.v'")
    told = [" ".join(line.split()) for line in text[start:].splitlines()[1 : len(lines) + 1]]
    assert [line.split(" 40 steps")[0].split(" 20 steps")[0] for line in told] == [
        " ".join(line.split()) for line in lines
    ]
    assert parse_rules(text).text(3) == text


@st.composite
def trees(draw: st.DrawFn) -> DecisionTree:
    """Trees of up to four tests, with thresholds that scenes may lie on."""
    nodes: list[tuple[str, float] | bool] = []
    shape: list[tuple[int, int]] = []

    def grow(depth: int) -> int:
        at = len(nodes)
        if depth == 0 or draw(st.booleans()):
            nodes.append(draw(st.booleans()))
            shape.append((at, at))
            return at
        column = draw(st.sampled_from(COLUMNS))
        nodes.append((column, 0.5 if column == "action.brake" else draw(QUARTERS)))
        shape.append((at, at))
        shape[at] = (grow(depth - 1), grow(depth - 1))
        return at

    grow(3)
    return tree_of(*nodes, shape=tuple(shape))


QUARTERS = st.integers(-6, 6).map(lambda k: k / 4.0)
PUSHES = st.builds(pushed_scene, QUARTERS, QUARTERS, QUARTERS, st.sampled_from((0.0, 1.0)))


@settings(max_examples=40, deadline=None)
@given(trees(), st.lists(PUSHES, min_size=1, max_size=12))
def test_the_text_speaks_where_modes_do(tree: DecisionTree, some: list[Scene]) -> None:
    model = scoped(tree)
    rules = parse_rules(rule_list(model).text(17))
    for each in some:
        one = model.predict_one(each).parts[0]
        said = rules.predict(each)["cart", "v"]
        assert np.isnan(said) if not one.ok else said == pytest.approx(one.value, rel=1e-14, abs=1e-14)
    assert agreement(model, rules, some)[1] == 1.0


@settings(max_examples=25, deadline=None)
@given(data=st.data(), some=st.lists(PUSHES, min_size=1, max_size=12))
def test_the_text_tells_of_walls(data: st.DataObject, some: list[Scene]) -> None:
    low, high = sorted(data.draw(st.lists(QUARTERS, min_size=2, max_size=2)))
    side = data.draw(st.sampled_from((-1.0, 1.0)))
    bound = data.draw(QUARTERS) + 0.013  # beside all that rounding could bring about
    stop = Stop(1, data.draw(QUARTERS), "x", data.draw(QUARTERS), bound, side, 0.1)
    some_limits = data.draw(st.sampled_from((Limits(), Limits(1, NOISE, low), Limits(1, 1, low, high))))
    model = scoped(None, stops=Stops((stop,) * data.draw(st.integers(0, 1))), limits=some_limits)
    rules = parse_rules(rule_list(model).text(17))
    for each in some:
        one = model.predict_one(each).parts[0]
        assert rules.predict(each)["cart", "v"] == pytest.approx(one.value, rel=1e-14, abs=1e-14)


def test_agreement_counts_what_differs() -> None:
    """Four scenes: two of them where the list says nothing, one where it is off by more than digits."""
    model = scoped(None)
    some = [pushed_scene(x, v, 0.0) for x, v in ((0.0, 1.0), (1.0, 1.0), (2.0, 1.0), (3.0, 1.0))]
    branch = Branch((), parse_sum("0.5 v + action.push"))
    none = Branch((parse_condition("x > 1.5"),), None, reason="unexplained there")
    off = Branch((parse_condition("x > 0.5"),), parse_sum("0.51 v + action.push"))
    rules = RuleList(1, (), (PropertyRules("cart", "v", (none, off, branch)),))
    told, share = agreement(model, rules, some)
    assert share == 0.25
    assert told.agreement == "on 4 steps these rules say what the model says of 25 % of 4 values."


def test_a_share_is_not_rounded_up_to_all() -> None:
    from relgym.model.reports.rules import _floor

    assert _floor(1.0) == 1.0 and _floor(0.9999999) == 0.99999 and _floor(0.5) == 0.5


def test_what_both_leave_open_agrees() -> None:
    from relgym.model.reports.rules import _same

    nan = float("nan")
    value, rule = np.array([2.0, 2.0, nan, nan, 2.0]), np.array([2.00009, 2.0002, nan, 1.0, nan])
    equal, none = _same(value, rule, np.full(5, 1.0))  # values change by 1: slack 1e-4
    assert equal.tolist() == [True, False, True, False, False]
    assert none.tolist() == [False, False, True, False, False]


def test_a_law_that_reads_what_is_not_predicted_predicts_nothing_and_says_so() -> None:
    schema, rng = schema_of(("x", "y"), ("a",)), np.random.default_rng(0)
    starts, actions = rng.normal(size=(400, 2)), rng.normal(size=(400, 1))

    def step(now: np.ndarray, a: np.ndarray) -> list[float]:
        noise = float(rng.normal())
        return [0.5 * now[0] + noise, noise]

    model = WorldModel(schema)
    for transition in transitions(schema, step, starts, actions):
        compare_and_learn(model, transition, model.predict_one(transition.before))
    (reading,) = (part for part in model.rules().properties if part.doubt.startswith("it reads"))
    other = {"self.x": "y", "self.y": "x"}[reading.target]
    assert reading.doubt == f"it reads next values that aren't predicted: {other}"
    assert f"no prediction: {reading.doubt}" in model.describe()
    assert all(part.doubt for part in model.rules().properties)
    assert not any(
        part.ok for part in model.predict_one(model.schema.scene({"self": [0.0, 0.0], ACTION: [0.0]})).parts
    )


@pytest.mark.parametrize("seed", [1, 2])
def test_what_is_hardly_ever_claimed_is_printed_as_no_prediction(seed: int) -> None:
    """A lamp that a switch turns on for sure, and that else goes on and off by chance once in 25 steps."""
    rng, schema = np.random.default_rng(seed), schema_of(("x",), ("u",))
    model, x = WorldModel(schema), 0.0
    for u in rng.uniform(0.0, 1.0, 1_500).tolist():
        now, x = x, 1.0 if u > 0.85 else abs(x - float(rng.random() < 0.04))
        before = {"self": (now,), "action": (u,)}
        step = Transition(schema.scene(before), schema.scene(before | {"self": (x,)}))
        compare_and_learn(model, step, model.predict_one(step.before))
    part = model.property_model("self", "x")
    assert not part.doubtful and 0.0 < part.claimed < 0.1
    doubt = model.rules().properties[0].doubt
    assert re.fullmatch(r"too few such predictions .* to claim any, but in [\d.]+ % of steps", doubt)
    assert f"no prediction: {doubt}" in model.describe()


def test_conditions_have_no_more_digits_than_the_numbers() -> None:
    """A brake in single precision: what weights differ by is rounding, and isn't printed."""
    rng, schema = np.random.default_rng(0), schema_of(("x", "v"), ("u",))
    model, x, v = WorldModel(schema), np.float32(0.0), np.float32(1.0)
    for u in rng.uniform(-0.3, 0.3, 1_500).astype(np.float32):
        before = {"self": (float(x), float(v)), "action": (float(u),)}
        v = v + u if v + u > 0.0 else np.float32(0.0)
        x = x + np.float32(0.3) * v if x < 40.0 else np.float32(-40.0)
        step = Transition(schema.scene(before), schema.scene(before | {"self": (float(x), float(v))}))
        compare_and_learn(model, step, model.predict_one(step.before), precision=5e-7)
    told = str(model.rules().properties)
    assert "action.u" in told
    assert not re.search(r"\\d\\.\\d{8,}", model.describe())
