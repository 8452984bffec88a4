"""Courses of planning: the whole command with tiny tasks, and figures by hand from made-up results."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import gymnasium as gym
import numpy as np
import pytest

from relgym.experiments.benchmark import main
from relgym.experiments.criterion import report
from relgym.experiments.jobs.store import Result, ResultStore
from relgym.experiments.plan import course as plan
from relgym.experiments.plan import demo as plan_demo
from relgym.experiments.plan import suite as plan_benchmark
from relgym.experiments.plan.demo import demonstrate
from relgym.planning import TreeSearch

TINY = plan.Course(
    "truck",
    "TruckPush",
    "relgym/TruckPush-v0",
    arguments={"n_boxes": 1},
    every=30,
    agent={"random_steps": 30},
    search=TreeSearch(horizon=6, expansions=64, batch=32),
)


@pytest.fixture(autouse=True)
def tiny(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(plan.COURSES, "truck", TINY)


def made_up(solved_at: int | None, *successes: int, decision: float = 0.02) -> dict[str, Any]:
    curve = [(50 * (k + 1), good) for k, good in enumerate(successes)]
    return {
        "curve": curve,
        "solved_at": solved_at,
        "seconds": 9.0,
        "decision": decision,
        "laws": "",
        "final": None,
    }


def test_a_course_of_learning_is_tested_again_and_again() -> None:
    found = plan.learning(course="truck", arm="relgym-given", seed=100, steps=60, episodes=2)
    assert [at for at, _ in found["curve"]] == [30, 60]
    assert all(good in (0, 50, 100) for _, good in found["curve"])
    assert found["solved_at"] is None or found["curve"][-1][1] == 100
    assert "truck.vx'" in found["laws"] and found["decision"] > 0.0


def test_the_exact_engine_is_the_ceiling() -> None:
    found = plan.ceiling(course="truck", episodes=1)
    assert found["successes"] in (0, 100) and found["decision"] > 0.0


def test_tests_begin_with_the_episode_that_is_asked_for() -> None:
    """The second and third of three are the three without the first."""

    class Stub:
        def __init__(self) -> None:
            self.space = gym.make(TINY.env_id, **TINY.arguments).action_space
            self.firsts: list[Any] = []

        def predict(self, seen: Any, state: Any) -> tuple[Any, bool]:
            if state is None:
                self.firsts.append({name: values.tolist() for name, values in seen.items()})
            self.space.seed(0)
            return self.space.sample(), True

    whole, rest = Stub(), Stub()
    assert plan.Tests(TINY, 3).successes(whole)[1] == 3
    assert plan.Tests(TINY, 2, first=1).successes(rest)[1] == 2
    assert rest.firsts == whole.firsts[1:]
    assert whole.firsts[0] != whole.firsts[1]


def test_nets_are_planned_in_by_the_same_agent() -> None:
    pytest.importorskip("torch")
    from relgym.baselines.ensemble import MLPEnsemble
    from relgym.baselines.neural_world import NeuralWorldModel

    agent = plan.make_agent(TINY, plan.ARMS["ensemble"], seed=0)
    assert isinstance(agent.model, NeuralWorldModel) and isinstance(agent.model.ensemble, MLPEnsemble)
    agent.learn(3)
    world = plan.NeuralSimulator(agent.model, agent.env, 1)
    seen, _ = agent.env.reset(seed=0)
    now = world.state(seen)
    stepped = world.step(np.repeat(now[None], 2, axis=0), np.zeros((2, 1), np.float32))
    assert (
        stepped.states.shape == (2, len(now)) and stepped.known.tolist() == [agent.model.ensemble.ready] * 2
    )


def test_medians_are_measured_against_their_limits() -> None:
    found = {
        "relgym": [
            made_up(250, 0, 40, 95, 96, 97),
            made_up(350, 0, 0, 0, 0, 20, 95, 95),
            made_up(None, 0, 5),
        ],
        "engine": [{"successes": 99, "decision": 0.4, "episodes": 25}],
    }
    others = "# x\n\n## truck: TruckPush\n\n```text\nSAC  5 of 5  8,250  1, 2  90  49 s  0 s  0 s\n```\n\n## b: c\n"
    shown = plan_benchmark.told("truck", found, steps=400, episodes=25, others=others)
    text = report("TruckPush", shown.measures, shown.notes)
    limit = next(line for line in text.splitlines() if "decisions to success, median" in line)
    assert "350" in limit and "MISSED" in limit
    row = next(line for line in text.splitlines() if line.startswith("planner, relgym "))
    assert "2 of 3" in row and "250, 350, > 400" in row
    assert "the same search, exact engine" in text and "8,250" in text and "Tests of 25 episodes." in text


def test_finished_runs_are_not_run_again_and_make_the_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("matplotlib")
    store = ResultStore(tmp_path / "cache")
    for task in plan_benchmark.tasks("truck", ["relgym"], seeds=(0, 1), steps=400, episodes=25):
        store.put(task, Result(made_up(100 + 50 * task.arguments["seed"], 50, 95, 95), 1.0))
    monkeypatch.setattr(plan, "learning", None)  # nothing is left to run
    page = tmp_path / "plan.md"
    options = ["--arms", "relgym", "--seeds", "2", "--episodes", "25", "--out", str(tmp_path)]
    main(plan_benchmark.SUITE, ["truck", *options, "--page", str(page)])
    assert "2 of 2" in capsys.readouterr().out
    assert (tmp_path / "plan-truck.png").is_file()
    page.write_text(
        page.read_text(encoding="utf-8") + "\nA remark by hand.\n\n## Not run\n\nMuch.\n", encoding="utf-8"
    )
    main(plan_benchmark.SUITE, ["truck", *options, "--page", str(page), "--report"])
    text = page.read_text(encoding="utf-8")
    assert text.endswith("A remark by hand.\n\n## Not run\n\nMuch.\n")
    assert text.startswith("# What planning is worth") and text.count("A remark by hand.") == 1
    assert text.count("## truck") == 1


def test_the_demo_tells_laws_task_and_plans(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    shown = demonstrate(tmp_path, steps=40, episodes=1, seed=0)
    text = str(shown)
    assert "truck.vx'" in text and "task.reward'" in text and "of 1 episodes end on the goal" in text
    assert Path(shown.picture).is_file()


def test_the_first_plan_is_shown_while_it_is_followed() -> None:
    env = gym.make(TINY.env_id, **TINY.arguments)
    states = np.zeros((6, len(env.reset(seed=0)[1]["scene"].vector)))
    first, better = (SimpleNamespace(states=states) for _ in range(2))

    class Scripted:
        told = iter([first, first, *[better] * 20])

        def predict(self, observation: Any, state: Any = None) -> tuple[Any, Any]:
            return np.zeros(1, np.float32), (SimpleNamespace(plan=next(self.told)),)

    shown, _, _ = plan_demo._episode(cast(Any, Scripted()), env, 0)
    (dream,) = shown.imagined
    assert len(shown.real) == 4 and dream.predicted == 2  # three steps, two of them by the first plan
