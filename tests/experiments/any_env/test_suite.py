"""Other people's envs: the table's machinery on few transitions, and one law that few suffice for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from relgym.config import ModelConfig
from relgym.experiments.any_env.data import STUDIES, collect, learned, made, nrmse_d, recommended, regular
from relgym.experiments.any_env.fleet import Diary, taught
from relgym.experiments.any_env.flight import flying
from relgym.experiments.any_env.memory import memory
from relgym.experiments.any_env.suite import SUITE, weight
from relgym.experiments.benchmark import main
from relgym.experiments.criterion import gathered
from relgym.experiments.seeds import TUNING_SEEDS, TUNING_TEST_SEED


def test_the_mountain_car_is_learned_from_its_own_advice() -> None:
    study = STUDIES["mountain"]
    lesson, fresh = collect(study, 250, TUNING_SEEDS[0]), collect(study, 200, TUNING_TEST_SEED)
    plain = learned(lesson)
    assert recommended(plain) == ("trig",)
    assert max(nrmse_d(plain, fresh).values()) > 1e-3
    model = learned(lesson, ModelConfig(features=("trig",)))
    assert max(nrmse_d(model, fresh).values()) < 1e-4
    assert [m.formula(4) for m in model.modes("self", "v")] == [
        "v' = v - 0.0025 cos(3 x) + 0.001 action.a - 0.001"
    ]
    assert [m.formula(4) for m in model.modes("self", "x")] == ["x' = x + v'"]
    for prop, term, value in study.weights:
        assert weight(model, prop, term) == pytest.approx(value, rel=1e-3)
    assert weight(model, "x", "v") == 0.0


def test_limits_are_evaluated_apart() -> None:
    study = STUDIES["pendulum"]
    lesson = collect(study, 60, TUNING_SEEDS[0])
    assert regular(study, lesson).all()
    assert study.special is not None
    assert study.special(np.array([[8.0, 0.0], [-8.0, 1.0], [7.9, 2.0]])).tolist() == [True, True, False]


def test_the_command_prints_a_benchmark(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(SUITE, ["pendulum", "--quick", "--tuning", "--seeds", "1", "--out", str(tmp_path)])
    text = capsys.readouterr().out
    assert "w' = w + 0.75 sin(th) + 0.15 action.a" in text
    assert "th, regular" in text


def test_a_stream_is_what_is_collected() -> None:
    study = STUDIES["lander"]
    lesson, again = collect(study, 120, TUNING_SEEDS[0]), collect(study, 120, TUNING_SEEDS[0])
    np.testing.assert_array_equal(lesson.before, again.before)
    assert 0 < lesson.terminated.sum() < 5
    np.testing.assert_allclose(lesson.before[:, lesson.own] + lesson.change, lesson.after)
    assert lesson.before[:, lesson.action].shape == (120, 5)
    assert 0.8 < flying(lesson).mean() < 1.0
    assert not flying(lesson)[lesson.terminated].any()


@pytest.mark.parametrize(
    ("name", "right"), [("memory", "x, still right"), ("memory-ball", "x, wrong predictions")]
)
def test_a_long_life_is_measured_beyond_its_bound(
    name: str, right: str, capsys: pytest.CaptureFixture[str]
) -> None:
    figures = memory(name, [(TUNING_SEEDS[0], TUNING_TEST_SEED)], steps=600, bound=200)
    found = {m.what: m for m in gathered(figures)}
    assert found["most rows kept, over the bound"].ok
    assert found[right].worst < 0.5
    assert "600 transitions, 200 kept" in capsys.readouterr().out


def test_the_stream_is_predicted_beside_others(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(SUITE, ["stream", "--quick", "--tuning", "--seeds", "1", "--out", str(tmp_path)])
    text = capsys.readouterr().out
    assert "constant velocity" in text and "RLS" in text
    assert "mountain.x, over the best online baseline" in text


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_a_fleet_teaches_what_its_envs_did(mode: AutoresetMode, capsys: pytest.CaptureFixture[str]) -> None:
    figures = taught("cart", mode, TUNING_SEEDS[0], 30)
    assert all(measure.ok for measure in gathered(figures))
    text = capsys.readouterr().out
    assert "x' = x + 0.02 xdot" in text
    assert "fooled by leaps: 0 " not in text  # learned as if they were transitions, resets would be noise


def test_a_diary_holds_steps_only() -> None:
    entries: list[Any] = []
    env = Diary(made(STUDIES["cart"]), entries)
    first, _ = env.reset(seed=0)
    second, *_ = env.step(0)
    env.reset(seed=1)
    assert len(entries) == 1
    np.testing.assert_array_equal(entries[0][0], first)
    np.testing.assert_array_equal(entries[0][2], second)
