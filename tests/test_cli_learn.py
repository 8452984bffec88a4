"""``relgym learn``: any env, any options, an interrupt, a failing env, and what comes after."""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from plain_envs import Birds, Slider, Wheel
from typer.testing import CliRunner

from relgym.cli import app
from relgym.clustering import features
from relgym.console.learning import Round
from relgym.console.next_steps import next_steps
from relgym.model.world_model import WorldModel

RUNNER = CliRunner()

VIEW = """
from relgym.envs.views import FunctionView, NumbersView
from relgym.scene.objects import ObjectType
from relgym.scene.schema import SceneSchema

def named(observations, actions):
    return NumbersView(observations, actions, names=("place", "speed"))

def halved(observations, actions):
    kind = ObjectType("car", ("x", "v"))
    schema = SceneSchema((kind,), (("car", "car"),))
    return FunctionView(schema, lambda seen, info: {"car": {"x": seen[0] / 2, "v": seen[1] / 2}}, actions)
"""


class Impatient(Slider):
    """Somebody presses Ctrl-C at its 40th step."""

    def step(self, action: Any) -> Any:
        if self.steps == 40:
            os.kill(os.getpid(), signal.SIGINT)
        return super().step(action)


class Fragile(Slider):
    """Fails at its 40th step, as `how` says."""

    def __init__(self, how: str = "raise") -> None:
        super().__init__()
        self.how = how

    def step(self, action: Any) -> Any:
        if self.steps == 40 and self.how == "raise":
            raise RuntimeError("the simulator is gone")
        if self.steps == 40:
            self.says = np.full(2, np.nan)
        return super().step(action)


class Pendulous(Slider):
    """v' = v - 0.1 sin(x) + 0.05 a, x' = x + 0.1 v': linear laws are approximations at best."""

    def step(self, action: Any) -> Any:
        self.v += -0.1 * float(np.sin(self.x)) + 0.05 * float(action[0])
        self.x += 0.1 * self.v
        self.steps += 1
        return self._seen(), 0.0, False, self.steps % 20 == 0, {}


class Dice(Slider):
    """x' is drawn anew at every step."""

    def __init__(self) -> None:
        super().__init__()
        self.observation_space = spaces.Box(0.0, 1.0, (1,), np.float64)

    def _seen(self) -> Any:
        return self.np_random.uniform(0.0, 1.0, 1)


ENVS = {
    "test/Dice-v0": Dice,
    "test/Slider-v1": Slider,
    "test/Wheel-v0": Wheel,
    "test/Birds-v0": Birds,
    "test/Impatient-v0": Impatient,
    "test/Fragile-v0": Fragile,
    "test/Pendulous-v0": Pendulous,
}


@pytest.fixture(autouse=True)
def _world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """An empty folder to work in, and the envs above."""
    monkeypatch.chdir(tmp_path)
    for name, env in ENVS.items():
        gym.register(name, env, disable_env_checker=True)
    yield
    for name in ENVS:
        del gym.registry[name]


def run(*arguments: Any, code: int = 0) -> str:
    result = RUNNER.invoke(app, [str(a) for a in arguments], prog_name="relgym")
    assert result.exit_code == code, result.output
    return result.stdout if code in (0, 1, 130) else result.stderr


def test_learning_ends_with_figures_and_what_to_do_next() -> None:
    text = run("learn", "test/Slider-v1", "--steps", 120, "--out", "new/slider.json")
    assert "Learned test/Slider-v1 from 120 steps" in text
    assert "Right on 120 of 120 fresh steps." in text
    for part in ("RMSE", "R²", "wrong", "relgym rules new/slider.json", "relgym rollout new/slider.json"):
        assert part in text
    assert WorldModel.load("new/slider.json").seen == 120
    assert "x1' = 0.8 x1 + 0.5 action.a" in run("rules", "new/slider.json")


def test_it_tells_a_program_the_same() -> None:
    (told,) = json.loads(run("learn", "test/Slider-v1", "--steps", 120, "--out", "s.json", "--json"))
    assert (told["steps"], told["planned"], told["stopped"]) == (120, 120, "")
    assert told["score"]["right"] == 120 and told["advice"] == []
    for target in told["score"]["targets"]:
        assert target["wrong"] == 0 and target["rmse"] < 1e-12 and target["r2"] > 1.0 - 1e-12


def test_the_same_seed_writes_the_same_file() -> None:
    for name in ("a", "b"):
        run("learn", "relgym/BallBoxRamp-v0", "--steps", 250, "--seed", 4, "--out", name)
    assert Path("a").read_bytes() == Path("b").read_bytes()


def test_the_file_says_how_its_env_was_made() -> None:
    run(
        "learn", "relgym/TruckPush-v0", "-a", "task=None", "-a", "n_boxes=2", "--steps", 60, "--out", "t.json"
    )
    model = WorldModel.load("t.json")
    assert [name for name, kind in model.schema.objects if kind == "box"] == ["box1", "box2"]
    assert model.extra["metadata"]["arguments"] == {"task": None, "n_boxes": 2}
    told = json.loads(run("eval", "t.json", "--steps", 50, "--json"))
    assert {t["target"]: t["predictions"] for t in told["score"]["targets"]}["box.px"] == 100
    told = json.loads(run("eval", "t.json", "--steps", 50, "--arg", "n_boxes=3", "--json"))
    assert {t["target"]: t["predictions"] for t in told["score"]["targets"]}["box.px"] == 150


def test_ctrl_c_saves_what_there_is_and_says_so() -> None:
    text = run("learn", "test/Impatient-v0", "--steps", 500, "--out", "half.json", code=130)
    assert "Stopped by Ctrl-C after 41 of 500 steps; what was learned is in half.json" in text
    assert WorldModel.load("half.json").seen == 41


@pytest.mark.parametrize("how", ["raise", "nan"])
def test_an_env_that_fails_costs_nothing_that_was_learned(how: str) -> None:
    text = run("learn", "test/Fragile-v0", "-a", f"how={how}", "--steps", 500, "--out", "part.json", code=1)
    assert "after 40 of 500 steps; what was learned is in part.json" in text
    assert ("RuntimeError: the simulator is gone" if how == "raise" else "finite number") in text
    assert WorldModel.load("part.json").seen == 40


def test_ctrl_c_while_following_advice_keeps_the_round_before(monkeypatch: pytest.MonkeyPatch) -> None:
    usual, made = Pendulous.step, []

    def step(self: Pendulous, action: Any) -> Any:
        made.append(1)
        if (
            len(made) == 820
        ):  # 300 to learn, as many to test on (cut at episodes' ends), and some of the next 300
            os.kill(os.getpid(), signal.SIGINT)
        return usual(self, action)

    monkeypatch.setattr(Pendulous, "step", step)
    arguments = ("learn", "test/Pendulous-v0", "--steps", 300, "--follow-advice", "--out", "p.json")
    text = run(*arguments, code=130)
    assert "Stopped by Ctrl-C; kept the round before, after" in text
    assert WorldModel.load("p.json").config.features == ()


def test_an_env_that_fails_at_once_leaves_no_file(monkeypatch: pytest.MonkeyPatch) -> None:
    def reset(self: Slider, **options: Any) -> Any:
        raise RuntimeError("no display")

    monkeypatch.setattr(Slider, "reset", reset)
    told = run("learn", "test/Slider-v1", "--steps", 9, "--out", "new/s.json", code=2)
    assert "RuntimeError: no display" in told and "nothing was saved" in told
    assert not Path("new").exists()


def test_a_model_with_history_goes_on_learning() -> None:
    run("learn", "test/Slider-v1", "-a", "length=25", "--steps", 60, "--history", "--out", "a.json")
    text = run("learn", "--resume", "a.json", "--steps", 40, "--out", "b.json")
    assert "from 40 steps (100 in all)" in text
    more = WorldModel.load("b.json")
    assert more.seen == 100 and not more.frozen
    assert more.extra["metadata"]["arguments"] == {"length": 25}


def test_advice_is_followed_until_there_is_none() -> None:
    text = run("learn", "test/Pendulous-v0", "--steps", 300, "--follow-advice", "--out", "p.json")
    first, second = text.split("Learned test/Pendulous-v0")[1:]
    assert "Advice for self." in first and second.startswith(" with trig from 300 steps")
    assert "Advice" not in second and "Right on 300 of 300" in second
    assert WorldModel.load("p.json").config.features == ("trig",)


def test_advice_is_shown_as_a_command() -> None:
    told = Round(
        "My-v0", "my file.json", ("trig",), 9, 9, 9, 0.1, "", None, ("x: unexplained",), ("products",)
    )
    assert "Advice for x: unexplained" in str(told)
    text = next_steps(told)
    assert "relgym rules 'my file.json'" in text
    assert "--features trig,products, or --follow-advice" in text


def test_features_and_parameters_reach_the_model() -> None:
    run(
        *("learn", "test/Slider-v1", "--steps", 30, "--out", "s.json", "--features", "trig(x0),squares"),
        *("--config", "seed=7", "-c", "clustering.draws=200", "-c", "classification.context=all"),
    )
    config = WorldModel.load("s.json").config
    assert config.features == ("trig(x0)", "squares")
    assert (config.seed, config.clustering.draws, config.classification.context) == (7, 200, "all")


def test_names_and_views() -> None:
    Path("mine.py").write_text(VIEW, encoding="utf-8")
    Path("view.json").write_text(json.dumps({"kind": "numbers", "names": ["p", "w"]}), encoding="utf-8")
    told = {("--names", "x,v"): ("x", "v"), ("--view", "mine:named"): ("place", "speed")}
    told |= {("--view", "view.json"): ("p", "w"), ("--view", "numbers"): ("x0", "x1")}
    for number, (options, properties) in enumerate(told.items()):
        run("learn", "test/Slider-v1", "--steps", 60, "--out", f"{number}.json", *options)
        assert WorldModel.load(f"{number}.json").schema.type_of("self").properties == properties
        assert "Right on 50 of 50" in run("eval", f"{number}.json", "--steps", 50)


def test_a_table_as_a_file_says() -> None:
    rows = [{"name": "bird", "count": 3}]
    columns = {
        "kind": "table",
        "columns": ["here", "x", "d"],
        "presence": "here",
        "rows": rows,
        "match": {"x": 1.0},
    }
    Path("birds.json").write_text(json.dumps(columns), encoding="utf-8")
    run("learn", "test/Birds-v0", "--view", "birds.json", "--steps", 40, "--out", "b.json")
    assert "bird.x" in run("eval", "b.json", "--steps", 20)


def test_a_view_that_is_a_function_is_named_again() -> None:
    Path("mine.py").write_text(VIEW, encoding="utf-8")
    run("learn", "test/Slider-v1", "--view", "mine:halved", "--steps", 60, "--out", "h.json")
    assert "name it, --view MODULE:NAME" in run("eval", "h.json", code=2)
    assert "Right on 50 of 50" in run("eval", "h.json", "--view", "mine:halved", "--steps", 50)


def test_an_env_of_the_folders_own_module() -> None:
    Path("homemade.py").write_text(
        "import gymnasium\nfrom plain_envs import Slider\n"
        "gymnasium.register('test/Homemade-v0', Slider, disable_env_checker=True)\n",
        encoding="utf-8",
    )
    try:
        run("learn", "homemade:test/Homemade-v0", "--steps", 40, "--out", "h.json")
        assert "Right on" in run("eval", "h.json", "--env", "homemade:test/Homemade-v0", "--steps", 40)
    finally:
        gym.registry.pop("test/Homemade-v0", None)
    assert "there is no env 'test/Homemade-v0'" in run("eval", "h.json", code=2)


def test_features_of_the_folders_own_module() -> None:
    Path("drags.py").write_text(
        "import numpy\nfrom relgym.clustering.features import register_function\n"
        "def drag(v):\n    return v * numpy.abs(v)\nregister_function('drag', drag)\n",
        encoding="utf-8",
    )
    try:
        told = run("learn", "test/Slider-v1", "--features", "drag", "--steps", 20, "--out", "d.json", code=2)
        assert "--features drag: unknown" in told
        run(
            "--import",
            "drags",
            "learn",
            "test/Slider-v1",
            "--features",
            "drag",
            "--steps",
            20,
            "--out",
            "d.json",
        )
        assert WorldModel.load("d.json").config.features == ("drag",)
    finally:
        features._functions.pop("drag", None)
        sys.modules.pop("drags", None)


def test_reward_and_end_are_learned_and_tested_too() -> None:
    run(
        "learn",
        "test/Slider-v1",
        "-a",
        "limit=2",
        "--reward",
        "--termination",
        "--steps",
        200,
        "--out",
        "r.json",
    )
    told = json.loads(run("eval", "r.json", "--steps", 100, "--json"))
    found = {t["target"]: t for t in told["score"]["targets"]}
    assert found["task.reward"]["wrong"] == 0
    assert "task.terminated" in found
    assert "self.x0" in run("rollout", "r.json", "--trials", 3)


def test_angles_that_a_first_observation_shows_are_kept() -> None:
    run("learn", "test/Wheel-v0", "--steps", 60, "--out", "w.json")
    told = json.loads(run("eval", "w.json", "--steps", 50, "--json"))
    assert [t["target"] for t in told["score"]["targets"]] == ["self.angle_x0"]
    assert told["score"]["right"] == 50


def test_what_nothing_explains_stops_a_roll_out_and_is_named() -> None:
    run("learn", "test/Dice-v0", "--steps", 60, "--out", "d.json")
    text = run("rollout", "d.json", "--trials", 3)
    assert "0 of 3 roll-outs" in text and "without a prediction of self.x" in text
