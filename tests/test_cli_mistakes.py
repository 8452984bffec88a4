"""Typical mistakes at the console: each ends in one message that says what to do, and writes nothing."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from plain_envs import Slider
from typer.testing import CliRunner

from relgym.cli import app

RUNNER = CliRunner()


class Camera(Slider):
    """Shows an image."""

    def __init__(self) -> None:
        super().__init__()
        self.observation_space = spaces.Box(0, 255, (8, 8, 3), np.uint8)


class Nested(Slider):
    """Shows what no view of numbers takes."""

    def __init__(self) -> None:
        super().__init__()
        self.observation_space = spaces.Dict(a=spaces.Dict(b=spaces.Box(-1.0, 1.0, (2,))))


class Needy(Slider):
    """Comes with a package that isn't there."""

    def __init__(self) -> None:
        raise gym.error.DependencyNotInstalled('Thing is not installed, run `pip install "gymnasium[thing]"`')


ENVS = {"test/Slider-v1": Slider, "test/Camera-v0": Camera, "test/Nested-v0": Nested, "test/Needy-v0": Needy}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with the envs above registered, and models of two worlds in it, one of them with history."""
    out = tmp_path_factory.mktemp("mistakes")
    for name, env in ENVS.items():
        gym.register(name, env)
    slider, truck = out / "slider.json", out / "truck.json"
    for arguments in (
        ["learn", "test/Slider-v1", "--steps", "30", "--out", str(slider)],
        ["learn", "test/Slider-v1", "--steps", "30", "--history", "--out", str(out / "full.json")],
        ["learn", "relgym/TruckPush-v0", "-a", "task=null", "--steps", "30", "--out", str(truck)],
    ):
        done = RUNNER.invoke(app, arguments)
        assert done.exit_code == 0, done.output
    (out / "truncated.json").write_bytes(slider.read_bytes()[:700])
    (out / "other.json").write_text("{}", encoding="utf-8")
    (out / "edited.json").write_text(slider.read_text().replace('"seen":30', '"seen":31'), encoding="utf-8")
    (out / "view.json").write_text('{"kind": "numbers", "nmes": ["x", "v"]}', encoding="utf-8")
    yield out
    for name in ENVS:
        del gym.registry[name]


LEARN = "learn test/Slider-v1 --steps 20 --out new.json"

MISTAKES = {
    # what was typed: parts of the message
    "lern test/Slider-v1 --out new.json": ["no command 'lern'", "did you mean 'learn'?", "rollout"],
    "learn CartPol-v1 --out new.json": ["no env 'CartPol-v1'", "did you mean 'CartPole-v1'?", "envs --all"],
    "learn TruckPush-v0 --out new.json": ["did you mean 'relgym/TruckPush-v0'?"],
    "learn CartPole-v9 --out new.json": ["there is CartPole-v0 and CartPole-v1"],
    "learn cartpole --out new.json": ["there is CartPole-v0 and CartPole-v1"],
    "learn nobody/Thing-v0 --out new.json": ["nothing that is installed here registers 'nobody'", "MODULE:"],
    "learn no_such_module:Thing-v0 --out new.json": ["module 'no_such_module' can't be imported"],
    "--import no_such_module envs": ["--import: the module 'no_such_module' can't be imported"],
    "learn --out new.json": ["name the env to learn"],
    "learn test/Slider-v1": ["Missing option '--out'", "relgym learn --help"],
    f"{LEARN} --step 5": ["no option --step", "did you mean '--steps'?", "--features"],
    "learn test/Slider-v1 --steps 0 --out new.json": ["'--steps'", "1"],
    "learn test/Slider-v1 --steps many --out new.json": ["'--steps'", "integer"],
    f"{LEARN} --seed -1": ["'--seed'", "0"],
    f"{LEARN} extra": ["extra", "relgym learn --help"],
    "learn test/Slider-v1 --out .": ["--out . is a folder", "model.json"],
    "learn test/Slider-v1 --out other.json/new.json": ["can't be written", "expected a file in a folder"],
    f"{LEARN} --features trog": ["--features trog", "did you mean 'trig'?", "squares, products"],
    f"{LEARN} --features trig(th)": ["'trig(th)'", "expected some of ['x0', 'x1']"],
    f"{LEARN} --features car:trig": ["'car'", "expected one of ['self']"],
    f"{LEARN} --config sed=1": ["--config sed", "did you mean 'seed'?", "frames"],
    f"{LEARN} --config draws=9": ["did you mean 'clustering.draws'?"],
    f"{LEARN} --config seed": ["--config seed", "expected NAME=VALUE"],
    f"{LEARN} --config seed=1 --config seed=2": ["seed was given twice"],
    f"{LEARN} --config clustering.draws=many": ["draws must be a whole number, got 'many'"],
    f"{LEARN} --config clustering.draws=0": ["draws must be at least 1, got 0"],
    f"{LEARN} --config frames=word": ["frames must be one of ('auto', 'world'), got 'word'"],
    f"{LEARN} --config features=trig": ["--features trig"],
    f"{LEARN} --view number": ["--view number", "did you mean 'numbers'?", "MODULE:NAME"],
    f"{LEARN} --view no_such_module:view": ["module 'no_such_module' can't be imported"],
    f"{LEARN} --view gymnasium:mak": ["gymnasium has no 'mak'", "did you mean 'make'?"],
    f"{LEARN} --view gymnasium:make": ["--view gymnasium:make fails with", "expected a view"],
    f"{LEARN} --view none.json": ["--view none.json can't be read"],
    f"{LEARN} --view view.json": ["no entry 'nmes'", "did you mean 'names'?"],
    f"{LEARN} --view other.json": ["--view other.json", "expected one of ['numbers', 'table']"],
    f"{LEARN} --names x": ["expected 2 different Python identifiers"],
    f"{LEARN} --names x,v --view gymnasium:make": ["--names x,v goes with --view numbers alone"],
    f"{LEARN} --arg lenth=3": ["no argument 'lenth'", "did you mean 'length'?", "length=1000, limit"],
    f"{LEARN} --arg length": ["--arg length", "expected NAME=VALUE"],
    "learn relgym/TruckPush-v0 --arg n_boxes=0 --out new.json": ["n_boxes=0", "from 1 to 12"],
    "learn test/Needy-v0 --out new.json": ["needs a package that isn't there", "gymnasium[thing]"],
    "learn test/Camera-v0 --out new.json": ["an image", "FunctionView"],
    "learn test/Nested-v0 --out new.json": ["FunctionView"],
    "learn --resume slider.json --out new.json": ["slider.json was saved without its history", "--history"],
    "learn --resume none.json --out new.json": ["there is no file none.json"],
    "learn --resume full.json --features trig --out new.json": ["can't go with --resume", "begin anew"],
    "eval slidr.json": ["there is no file slidr.json", "did you mean 'slider.json'?", "relgym learn"],
    "rules slidr.json": ["there is no file slidr.json", "did you mean 'slider.json'?"],
    "eval .": ["is a folder", "slider.json"],
    "eval truncated.json": ["truncated.json", "truncated or another kind of file"],
    "rollout other.json": ["expected a relgym model file"],
    "explain edited.json": ["the checksum doesn't match"],
    "eval slider.json --env CartPole-v1": [
        "a model of test/Slider-v1",
        "learned from 2 numbers",
        "4 numbers",
    ],
    "eval slider.json --env relgym/TruckPush-v0": ["can't speak of relgym/TruckPush-v0", "Dict of box1"],
    "rollout truck.json --env test/Slider-v1": ["a model of relgym/TruckPush-v0", "2 numbers"],
    "eval slider.json --world ball": ["no option --world", "--env"],
    "eval slider.json --arg lenth=3": ["no argument 'lenth'", "did you mean 'length'?"],
    "rollout slider.json --trials 0": ["'--trials'"],
    "explain slider.json --step -1": ["'--step'"],
    "export": ["relgym export", "Missing argument 'MODEL'", "relgym export --help"],
    "export slider.json": ["Missing argument 'FILE'"],
    "export slidr.json new.py": ["there is no file slidr.json", "did you mean 'slider.json'?"],
    "export slider.json new.py --to fortran": ["--to=", "fortran", "expected 'python'"],
    "export slider.json new.py --steps 0": ["'--steps'"],
    "export slider.json .": ["is a folder"],
    "export slider.json new.py --env CartPole-v1": ["a model of test/Slider-v1", "4 numbers"],
    "reproduce nonsense": ["no experiment 'nonsense'", "table-4.2", "relgym reproduce --list"],
    "reproduce --workers many": ["'--workers'"],
    "dyna --step 3": ["no option --step", "did you mean '--steps'?"],
    "plan --word x": ["relgym plan has no option --word", "--episodes"],
    "rules slider.json --env CartPole-v1": ["--env", "give --check, too"],
    "benchmark nothing": ["benchmark 'nothing': expected one of laws"],
    "doctor extra": ["relgym doctor", "(extra)"],
    "envs --al": ["no option --al", "did you mean '--all'?"],
    "inspect": ["Missing argument 'ENV'"],
    "inspect relgym/TruckPsh-v0": ["did you mean 'relgym/TruckPush-v0'?"],
    "demo --seed x": ["relgym demo", "'--seed'", "integer"],
    "inspect test/Camera-v0": ["an image"],
    "demo --out other.json": ["other.json is a file, and a folder is needed"],
}


@pytest.mark.parametrize("typed", MISTAKES)
def test_a_mistake_gets_one_message_with_the_remedy(
    typed: str, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    before = contents(tmp_path)
    done = RUNNER.invoke(app, typed.split(), prog_name="relgym")
    assert done.exit_code == 2, done.output
    assert isinstance(done.exception, SystemExit), "no traceback"
    assert done.stdout == ""
    message = done.stderr
    assert message.startswith("relgym: ") and message.count("relgym: ") == 1
    assert "Traceback" not in message and len(message.splitlines()) <= 3
    for part in MISTAKES[typed]:
        assert part in message
    assert contents(tmp_path) == before, "nothing is written, and nothing lost"


def contents(folder: Path) -> dict[str, Any]:
    return {p.name: p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_there_are_as_many_as_people_make() -> None:
    assert len(MISTAKES) >= 20
