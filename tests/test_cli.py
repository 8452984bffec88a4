"""The console commands: what they print, write and return."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import pytest
from typer.testing import CliRunner

import relgym
from relgym.cli import app
from relgym.experiments import demo
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene
from relgym.wrappers.views import view_of

RUNNER = CliRunner()


def run(*arguments: Any, code: int = 0) -> str:
    result = RUNNER.invoke(app, [str(a) for a in arguments], prog_name="relgym")
    assert result.exit_code == code, result.output
    return result.stdout if code == 0 else result.output


def test_it_tells_its_version_and_runs_as_a_module() -> None:
    assert run("--version") == f"relgym {relgym.__version__}\n"
    told = subprocess.run(
        [sys.executable, "-m", "relgym", "--version"], capture_output=True, text=True, check=True
    )
    assert told.stdout == f"relgym {relgym.__version__}\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that holds what `relgym demo --quick --json` wrote, and its output."""
    out = tmp_path_factory.mktemp("demo")
    (out / "output.json").write_text(
        run("demo", "--quick", "--json", "--jobs", 1, "--out", out), encoding="utf-8"
    )
    return out


def test_demo_tells_what_it_learned_measured_and_wrote(folder: Path) -> None:
    told = json.loads((folder / "output.json").read_text(encoding="utf-8"))
    assert list(told["worlds"]) == ["ball", "modes", "truck"]
    ball, modes, truck = told["worlds"].values()
    assert [each["transitions"] for each in (ball, modes, truck)] == [1600, 1600, 320]
    assert ball["figures"]["verdict"]["right"] == ball["figures"]["verdict"]["steps"] == 2400
    assert ball["figures"]["verdict"]["exact"] == 12
    assert modes["figures"]["verdict"]["right"] < 2400
    statements = [law["statement"] for law in ball["report"]["laws"]]
    assert "v'_n = max(u_n, -0.9 v_n)" in statements and not ball["report"]["targets"]
    functions = {m["function"] for m in modes["report"]["targets"][0]["modes"]}
    assert {"vx' = vx", "vx' = -0.9 vx"} <= functions
    assert len(ball["curve"]) == 8 and ball["figures"]["evaluation"]["targets"]
    for file in (*told["pictures"].values(), truck["file"], ball["file"]):
        assert Path(file).stat().st_size > 1000


def test_demo_in_words(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    truck, folder = demo.demonstrations(quick=True)[2], tmp_path
    monkeypatch.setattr(demo, "demonstrations", lambda *, quick: (truck,))
    text = run("demo", "--quick", "--jobs", 1, "--out", folder)
    assert re.search(r"vx' = vx \+ 0.025 action.force - 7.5 box\w*.friction", text)
    verdict = text.index("of 320 fresh steps")
    assert verdict < text.index("vx' = vx")
    for file in ("truck.json", "trajectories.png", "learning.png"):
        assert str(folder / file) in text
    assert max(len(line) for line in text.replace(str(folder), "").split("\n")) <= 100


@pytest.mark.sb3
def test_dyna_shows_both_agents_and_the_laws(tmp_path: Path) -> None:
    text = run("dyna", "--steps", 260, "--out", tmp_path)
    assert "successes of 100 fixed episodes" in text
    assert "Dyna, relgym, reward given" in text and "SAC" in text
    assert "What the agent learned of its world, and dreamed in:" in text
    assert "truck.vx" in text
    for name in ("curves.png", "episodes.png"):
        assert (tmp_path / name).stat().st_size > 5_000


def test_export_writes_python_and_compares(folder: Path, tmp_path: Path) -> None:
    file = tmp_path / "ball.py"
    told = run("export", folder / "ball.json", file, "--steps", 60)
    assert re.search(
        r"on 60 fresh steps [\d.]+ % of the outcomes are the model's, values differ by at most 0\n", told
    )
    assert "def free_ball" in file.read_text(encoding="utf-8")
    assert "on 5 fresh steps 100 %" in run(
        "export", folder / "truck.json", file, "--steps", 5
    )  # roles are cast
    assert "expected 'python'" in run("export", folder / "ball.json", file, "--to", "c", code=2)


def test_help_on_benchmarks_lists_them() -> None:
    told = run("benchmark", "--help")
    assert "Usage: relgym benchmark" in told and "Other people's envs" in told
    assert run("benchmark").rstrip() in told


def test_rules_print_a_model(folder: Path) -> None:
    model = WorldModel.load(folder / "ball.json")
    assert run("rules", folder / "ball.json").rstrip("\n") == model.describe()
    tables = json.loads(run("rules", folder / "modes.json", "--json", "--details"))
    assert [t["target"] for t in tables["targets"]] == ["ball.vx", "ball.vy"]


def test_rules_as_json_are_those_that_are_printed(folder: Path) -> None:
    rules = WorldModel.load(folder / "modes.json").rules()
    told = json.loads(run("rules", folder / "modes.json", "--json"))
    assert [p["property"] for p in told["properties"]] == [p.target for p in rules.properties]
    for part, printed in zip(told["properties"], rules.properties, strict=True):
        text = printed.text()
        assert len(part["branches"]) == len(printed.branches) > 1
        assert part["branches"][-1]["if"] is None, "else"
        assert all(branch["name"] in text for branch in part["branches"])
    laws = json.loads(run("rules", folder / "ball.json", "--json", "--check", "--steps", 50))
    assert laws["motion"] in WorldModel.load(folder / "ball.json").describe()
    assert "of 50" in laws["agreement"] or "50 " in laws["agreement"]


def test_rules_are_checked_on_scenes_that_learning_has_not_seen(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from relgym.wrappers import follower

    asked: list[Scene] = []

    def noted(*arguments: Any, **named: Any) -> Iterator[Scene]:
        for scene in scenes_of(*arguments, **named):
            asked.append(scene)
            yield scene

    scenes_of = follower.scenes_of
    monkeypatch.setattr(follower, "scenes_of", noted)
    run("rules", folder / "ball.json", "--check", "--steps", 5)
    env = gym.make("relgym/BallBoxRamp-v0")
    learned = list(scenes_of(env, view_of(env), 5, seed=0))
    assert len(asked) == 5
    assert not any((a.vector == b.vector).all() for a, b in zip(asked, learned, strict=True))


def test_explain_a_scene_of_the_models_env(folder: Path) -> None:
    for more in ((), ("--env", "relgym/BallBoxRamp-v0", "--arg", "incline=45")):
        text = run("explain", folder / "ball.json", "--step", 3, "--seed", 1, *more)
        assert "ball.vx: " in text and "ball.vy: " in text


def test_explain_goes_by_the_models_own_view_and_from_episode_to_episode(
    folder: Path, tmp_path: Path
) -> None:
    run("learn", "Pendulum-v1", "--steps", 60, "--out", tmp_path / "p.json")
    assert "self.x2: " in run("explain", tmp_path / "p.json", "--step", 5)
    first, second = (run("explain", folder / "truck.json", "--step", n) for n in (0, 40))
    assert "truck.vx: " in second and second != first


def test_explain_an_action(folder: Path) -> None:
    assert "truck.vx: 0" in run("explain", folder / "truck.json", "--arg", "task=null")


def test_eval_tells_errors_and_what_really_happened(folder: Path) -> None:
    """Of a home world; the file says how its env was made."""
    told = json.loads(run("eval", folder / "truck.json", "--steps", 400, "--json"))
    assert told["env"] == "relgym/TruckPush-v0"
    assert told["score"]["steps"] == 400
    assert {t["target"]: t["predictions"] for t in told["score"]["targets"]} == {
        "truck.vx": 400,
        "box.px": 1200,
    }
    assert {t["target"]: sum(m["examples"] for m in t["modes"]) for t in told["truth"]["targets"]} == {
        "truck.vx": 400,
        "box.px": 1200,
    }
    text = run("eval", folder / "truck.json", "--steps", 400)
    assert "of 400 fresh steps." in text and "what really happened" in text


def test_rollout_tells_how_the_error_grows(folder: Path) -> None:
    told = json.loads(run("rollout", folder / "truck.json", "--trials", 5, "--json"))
    assert told["horizons"]["trials"] == 5 and told["horizons"]["longest"] == 40
    assert told["truth"]["trials"] == 5
    text = run("rollout", folder / "truck.json", "--trials", 5, "--steps", 12)
    assert "of 5 roll-outs of up to 12 steps stay with the real episode" in text
    assert "truth" not in text, "test sets have whole episodes only"


def test_envs_are_listed() -> None:
    told = json.loads(run("envs", "--json"))
    assert {"relgym/BallBoxRamp-v0", "relgym/TruckPush-v0"} <= set(told)
    assert all(told.values()), "every env says in a line what it is"
    assert run("envs").count("relgym/") >= len(told)


def test_all_installed_envs_are_listed() -> None:
    told = json.loads(run("envs", "--all", "--json"))
    assert {"relgym/TruckPush-v0", "CartPole-v1", "MountainCar-v0"} <= set(told)


def test_inspect_shows_types_and_relations() -> None:
    text = run("inspect", "relgym/TruckPush-v0", "-a", "n_boxes=1")
    for part in (
        "n_boxes=3",
        "truck.px' = px + vx'",
        "box1    box",
        "intersect: (box1, truck), (truck, box1)",
    ):
        assert part in text


def test_inspect_shows_any_env_as_it_is_learned() -> None:
    text = run("inspect", "CartPole-v1")
    for part in (
        "sutton_barto_reward=False",
        "4 numbers (float32)",
        "Discrete(2)",
        "x0 x1 x2 x3",
        "self: x0 = ",
    ):
        assert part in text
    assert "angle_x0" in run("inspect", "Pendulum-v1"), "with the angles that a first observation shows"
    assert "self: x = " in run("inspect", "MountainCar-v0", "--names", "x,v")


def test_doctor_finds_everything_that_the_tests_run_with() -> None:
    told = {f["name"]: f for f in json.loads(run("doctor", "--json"))}
    assert all(f["ok"] for f in told.values() if f["required"])
    assert told["relgym/BallBoxRamp-v0"]["text"] == "made, reset and stepped"
    assert not told["torch"]["required"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("rules", "missing.json"), "there is no file missing.json"),
        (("inspect", "relgym/Nowhere-v0"), "relgym envs"),
        (("inspect", "relgym/TruckPush-v0", "-a", "n_boxes"), "NAME=VALUE"),
        (("inspect", "relgym/TruckPush-v0", "-a", "nosuch=3"), "nosuch"),
        (("inspect", "relgym/LearnedModel-v0"), "needs --arg model=VALUE"),
        (("inspect", "nomod:Foo-v0"), "No module named 'nomod'"),
        (("inspect", "a:b:c"), "module 'a:b' can't be imported"),
        (("inspect", "relgym/TruckPush-v0", "-a", "n_boxes=99"), "n_boxes"),
    ],
)
def test_foreseeable_errors_are_sentences(arguments: tuple[str, ...], message: str) -> None:
    text = run(*arguments, code=2)
    assert text.startswith("relgym: ") and message in text
    assert "Traceback" not in text


def test_another_kind_of_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("hello", encoding="utf-8")
    assert "expected a relgym model" in run("rules", tmp_path / "notes.txt", code=2)
