"""The Dyna experiment's own arithmetic by hand, and its runs with tiny budgets."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from relgym.errors import ConfigError
from relgym.experiments.dyna.arms import ARMS, COURSES, Change, make_env
from relgym.experiments.dyna.course import Examination, Run, run, solved_at
from relgym.experiments.dyna.report import curves, draw_runs, interquartile_mean, interval, summary


def of(arm: str, seed: int, *successes: int) -> Run:
    curve = tuple((250 * (k + 1), good) for k, good in enumerate(successes))
    return Run("truck", arm, seed, 1000, curve, solved_at(curve), 10.0)


def test_success_is_two_in_a_row() -> None:
    assert of("sac", 0, 95, 89, 90, 91).solved_at == 1000
    assert of("sac", 0, 95, 89, 95).solved_at is None
    assert of("sac", 0).solved_at is None


def test_interquartile_mean_by_hand() -> None:
    assert interquartile_mean(np.array([0.0, 1.0, 2.0, 100.0])) == 1.5
    assert interquartile_mean(np.array([7.0])) == 7.0
    # Of five, the middle 2.5: half of the second, all of the third, and so on.
    assert interquartile_mean(np.array([100.0, 0.0, 4.0, 2.0, 1.0])) == pytest.approx(
        (0.75 + 2.0 + 3.0) / 2.5
    )


def test_intervals_hold_the_mean_and_shrink_to_it(rng: np.random.Generator) -> None:
    values = rng.uniform(0, 100, (3, 5))
    mean, low, high = interval(values, rng=rng)
    assert ((low <= mean) & (mean <= high)).all()
    same, low, high = interval(np.full((1, 5), 42.0), rng=rng)
    np.testing.assert_allclose([same[0], low[0], high[0]], 42.0)


def test_a_solved_run_keeps_its_last_value() -> None:
    steps, values = curves(
        [run.curve for run in (of("relgym", 0, 10, 95, 96), of("relgym", 1, 5, 10, 20, 30))]
    )
    assert steps.tolist() == [250, 500, 750, 1000]
    assert values.T.tolist() == [[10, 95, 96, 96], [5, 10, 20, 30]]


def test_the_table_counts_unsolved_runs_as_more() -> None:
    runs = [of("sac", s, 1, 2, 3, 4) for s in range(3)] + [
        of("relgym", 0, 91, 92),
        of("relgym", 1, 0, 91, 92),
    ]
    text = summary(runs)
    assert "SAC" in text and "> 1,000" in text and "0 of 3" in text
    assert "2 of 2" in text and "625" in text and "500, 750" in text


def test_curves_are_drawn(tmp_path: Path) -> None:
    runs = [of("sac", 0, 1, 2), of("relgym", 0, 50, 91), of("relgym", 1, 60, 95)]
    assert draw_runs(tmp_path / "curves.png", runs, "truck").stat().st_size > 5_000


def test_runs_outlive_json() -> None:
    done = of("sac", 3, 1, 2)
    assert Run.from_json(json.loads(json.dumps(asdict(done)))) == done
    assert (done.last, of("sac", 3).last) == (2, 0)


@pytest.mark.parametrize(
    ("arm", "decisions"),
    [("relgym-given", [100, 10, 10]), ("relgym", [100, 10, 10]), ("sac5", [100, 100, 100])],
)
def test_who_dreams_sees_more_beginnings(arm: str, decisions: list[int]) -> None:
    env = make_env(COURSES["ball"], arm=ARMS[arm])
    lasted = []
    for _ in decisions:
        env.reset(seed=0)
        steps, over = 0, False
        while not over:
            *_, terminated, truncated, _ = env.step(np.zeros(2, np.float32))
            steps, over = steps + 1, terminated or truncated
        lasted.append(steps)
        assert truncated
    assert lasted == decisions


def test_a_world_changes_with_the_first_episode_after_its_time() -> None:
    change = Change(after=3, arguments={"gravity": 0.0})
    env, plain = make_env(COURSES["truck"], change), make_env(COURSES["truck"])
    options = {"layout": 1, "order": ("box1", "box2", "box3"), "box1_friction": 0.2, "goal_distance": 40.0}
    push = np.array([1.0], np.float32)
    for world in (env, plain):
        world.reset(seed=0, options=options)
        for _ in range(4):  # no change within an episode
            world.step(push)
    assert env.get_wrapper_attr("scene") == plain.get_wrapper_attr("scene")
    env.reset(options=options)
    env.step(push)
    assert env.get_wrapper_attr("scene")["truck"]["vx"] == pytest.approx(0.025 * 250.0)


def test_agents_see_short_vectors_and_the_recorder_scenes() -> None:
    env = make_env(COURSES["truck"])
    seen, _ = env.reset(seed=0)
    assert seen.shape == (15,)
    assert seen.dtype == np.float32
    env.step(env.action_space.sample())
    (real,) = env.get_wrapper_attr("take")()
    assert {"truck", "goal"} <= set(real.start.layout.names)


def test_without_the_extra_a_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    with pytest.raises(
        ConfigError, match=r"Dyna needs the extra sb3 \(pip install 'relgym\[sb3\]', or make dyna\)"
    ):
        run(COURSES["truck"], ARMS["sac"], seed=0, testing=Examination(COURSES["truck"], episodes=1))


@pytest.mark.sb3
@pytest.mark.parametrize("arm", sorted(ARMS))
def test_every_arm_runs(arm: str) -> None:
    heard: list[tuple[int, int]] = []
    found = run(
        COURSES["truck"],
        ARMS[arm],
        seed=100,
        steps=260,
        testing=Examination(COURSES["truck"], episodes=3),
        heard=lambda at, good: heard.append((at, good)),
        agent={"learning_starts": 245, "batch_size": 16},
        dyna={"dreams": 8, "updates": 1, "catch_up": 2} if ARMS[arm].dreams else {},
    )
    assert found.curve == tuple(heard)
    assert [at for at, _ in heard] == [250]
    assert found.solved_at is None
    assert ("truck.vx" in found.laws) == (ARMS[arm].model == "relational")


@pytest.mark.sb3
@pytest.mark.parametrize(("arm", "entropy"), [("sac5", 1.0), ("relgym", 0.01)])
def test_what_suits_dreams_is_not_asked_of_baselines(arm: str, entropy: float) -> None:
    weights: list[float] = []
    run(
        COURSES["ball"],
        ARMS[arm],
        seed=100,
        steps=1,
        testing=Examination(COURSES["ball"], episodes=1),
        met=lambda agent, _: weights.append(float(agent.log_ent_coef.detach().exp())),
    )
    assert weights == [pytest.approx(entropy)]


@pytest.mark.sb3
@pytest.mark.slow
def test_dreaming_pays_in_truck_push() -> None:
    """The benchmark *truck* in small: one seed, given reward; SAC alone is nowhere near at these steps."""
    course, tests = COURSES["truck"], Examination(COURSES["truck"])
    dreaming = run(course, ARMS["relgym-given"], seed=100, steps=3_000, testing=tests)
    assert dreaming.solved_at is not None
    alone = run(course, ARMS["sac"], seed=100, steps=dreaming.solved_at, testing=tests)
    assert max(good for _, good in alone.curve) < 50
    assert "a limit to what the others predict" in dreaming.laws
