"""Envs that nobody here wrote: the table's machinery on few transitions, and one law that few suffice for."""

from __future__ import annotations

import numpy as np
import pytest

from relgym.config import ModelConfig
from relgym.experiments.any_env import STUDIES, collect, learned, main, nrmse_d, recommended, regular
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


def test_limits_are_judged_apart() -> None:
    study = STUDIES["pendulum"]
    lesson = collect(study, 60, TUNING_SEEDS[0])
    assert regular(study, lesson).all()
    assert study.special is not None
    assert study.special(np.array([[8.0, 0.0], [-8.0, 1.0], [7.9, 2.0]])).tolist() == [True, True, False]


def test_the_command_prints_a_row(capsys: pytest.CaptureFixture[str]) -> None:
    main(["pendulum", "--quick", "--tuning"])
    text = capsys.readouterr().out
    assert "w' = w + 0.75 sin(th) + 0.15 action.a" in text
    assert "th, regular" in text
