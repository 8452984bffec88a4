"""Every example runs, with a tiny budget, and says what it promises."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"

RUNS = {
    "read_the_laws.py": (["--steps", "400"], "vy' = vy - 0.00098"),
    "live_in_a_dream.py": (["--episodes", "8", "--trials", "1"], "trial 0: the trucks were never more than"),
    "grandparents.py": ([], "grandparent(A, B) ← parent(A, C) ∧ parent(C, B)"),
    "periodic_law.py": ([], "+ 0.4605 sin(0.36319 x1) + 0.1947 cos(0.36319 x1)"),
    "saturating_law.py": ([], "saturating: clip(0.799"),
    "plan_mountain_car.py": (["--steps", "300", "--episodes", "0"], "0 of 0 reach the flag"),
    "plan_ball.py": (
        ["--decisions", "22", "--expansions", "64", "--episodes", "1"],
        "of 1 balls stay at the goal after 22 real decisions",
    ),
    "plan_truck.py": (
        ["--steps", "62", "--random_steps", "60", "--episodes", "1"],
        "of 1 episodes end on the goal after 62 real steps",
    ),
    "plan_pendulum.py": (["--steps", "200", "--episodes", "0"], "angle_x0' = angle_x0 + 0.05 x2'"),
    "vector_envs.py": (["--transitions", "400"], "8 envs: "),
    "view_dict.py": (["--steps", "120"], "lower.x: x' = 0.85 x + 0.1 upper.x"),
    "view_function.py": (["--steps", "40"], "wrong in the latest steps"),
    "view_numbers.py": (["--steps", "80"], "cart.x: x' = x + 0.02 x_dot"),
    "view_table.py": (["--steps", "300"], "vx' = -0.99 vx"),
}

NEED_SB3 = {
    "dyna_ball.py": (
        ["--decisions", "120", "--warm_up", "118", "--episodes", "1"],
        "of 1 test episodes reach the goal",
    ),
    "dyna_truck.py": (
        ["--steps", "400", "--warm_up", "390", "--catch_up", "20", "--episodes", "2"],
        "of 2 test episodes end on the goal after 400 real steps",
    ),
}
"""Likewise for those that need Stable-Baselines3."""


def test_every_example_is_run() -> None:
    assert {path.name for path in EXAMPLES.glob("*.py")} == {*RUNS, *NEED_SB3}


@pytest.mark.parametrize("name", sorted(RUNS))
def test_example(name: str) -> None:
    _run(name, *RUNS[name])


@pytest.mark.sb3
@pytest.mark.parametrize("name", sorted(NEED_SB3))
def test_example_with_stable_baselines3(name: str) -> None:
    _run(name, *NEED_SB3[name])


def _run(name: str, options: list[str], expected: str) -> None:
    script = EXAMPLES / name
    assert len(script.read_text(encoding="utf-8").splitlines()) < 120
    command = [sys.executable, "-X", "utf8", "-W", "error", str(script), *options]
    done = subprocess.run(command, capture_output=True, text=True, encoding="utf-8", check=False)
    assert done.returncode == 0, done.stderr
    assert expected in done.stdout
