"""Issue "Dream": how many real steps agents need with a relational model, a neural one, and none.

``python -m relgym.experiments.dyna --arms relgym sac --seeds 3 --steps 2000`` runs two arms with three seeds each and
reports them. Runs that are done are kept in files and not run again, so that the whole comparison (``make dyna-full``)
can be stopped and resumed.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from time import perf_counter
from typing import Any, Final

import gymnasium as gym
import numpy as np

from relgym.errors import ConfigError
from relgym.experiments.dyna_arms import ARMS, COURSES, Arm, Course, make_agent, make_dyna, make_env
from relgym.experiments.seeds import TRAINING_SEEDS

__all__ = ["CHECK_EVERY", "ENOUGH", "EPISODES", "Examination", "Run", "main", "run"]

EPISODES: Final = 100
"""Evaluation episodes, always the same."""

ENOUGH: Final = 90
"""So many of them, twice in a row, are success."""

CHECK_EVERY: Final = 250
"""Real steps between two evaluations."""

STEPS: Final = 60_000
"""Runs end here, and count as more."""

_FIRST_EPISODE: Final = 50_000  # its seed: far from those of training


@dataclass(frozen=True, slots=True)
class Run:
    """One agent's course of learning.

    Attributes
    ----------
    course, arm, seed
        What was run.
    curve
        (real steps, successes of `EPISODES`) at every evaluation.
    solved_at
        Real steps after which success was seen twice in a row; none: never.
    seconds
        Wall time, evaluations included.
    learning_seconds, dreaming_seconds
        Of it, time that the model took to foretell and learn, and to dream.
    laws
        What was learned, as text; empty where nothing readable was.
    """

    course: str
    arm: str
    seed: int
    curve: tuple[tuple[int, int], ...]
    solved_at: int | None
    seconds: float
    learning_seconds: float = 0.0
    dreaming_seconds: float = 0.0
    laws: str = ""

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Run:
        """Read what ``asdict`` wrote."""
        return cls(**{**data, "curve": tuple((int(steps), int(good)) for steps, good in data["curve"])})


class Examination:
    """Fixed evaluation episodes, played side by side.

    Parameters
    ----------
    course
        Where.
    episodes
        How many.
    arguments
        Of the env, where they differ from the course's.
    """

    def __init__(self, course: Course, episodes: int = EPISODES, **arguments: Any) -> None:
        self._envs = [make_env(course, **arguments) for _ in range(episodes)]
        self._horizon = course.horizon

    def successes(self, agent: Any) -> int:
        """How many episodes the agent's best actions end well; ``info["is_success"]`` at the end counts."""
        firsts = [env.reset(seed=_FIRST_EPISODE + k)[0] for k, env in enumerate(self._envs)]
        seen, good = np.stack(firsts), 0
        going = np.arange(len(self._envs))
        for _ in range(self._horizon):
            actions, _ = agent.predict(seen[going], deterministic=True)
            over = np.zeros(len(going), dtype=bool)
            for at, (k, action) in enumerate(zip(going.tolist(), actions, strict=True)):
                seen[k], _, terminated, truncated, info = self._envs[k].step(action)
                over[at] = terminated or truncated
                good += bool(over[at] and info["is_success"])
            going = going[~over]
            if not len(going):
                break
        for env in self._envs:
            env.get_wrapper_attr("take")()  # nobody learns from tests
        return good


def run(
    course: Course,
    arm: Arm,
    *,
    seed: int,
    steps: int = STEPS,
    testing: Examination | None = None,
    to_the_end: bool = False,
    heard: Callable[[int, int], None] | None = None,
    met: Callable[[Any, Any], None] | None = None,
    agent: dict[str, Any] | None = None,
    dyna: dict[str, Any] | None = None,
) -> Run:
    """Let one agent learn until it succeeds twice in a row, or for so many real steps.

    Parameters
    ----------
    course, arm
        Where and how.
    seed
        Of agent, env and model.
    steps
        Real steps (decisions) at most.
    testing
        Evaluation episodes; default: new ones.
    to_the_end
        Go on after success.
    heard
        Is told (real steps, successes) at every evaluation.
    met
        Is shown the trained agent and its model (none: it has none) at the end.
    agent, dyna
        Parameters of the agent and of Dyna that differ from the course's.
    """
    env: gym.Env[Any, Any] = make_env(course)
    algorithm = make_agent(arm, env, seed=seed, **(agent or {}))  # says so where the extra is missing
    import torch
    from stable_baselines3.common.callbacks import BaseCallback, CallbackList

    torch.set_num_threads(1)  # nets this small lose by more
    own = make_dyna(arm, course, env, seed=seed, **(dyna or {}))
    tests = testing or Examination(course)
    curve: list[tuple[int, int]] = []

    class Check(BaseCallback):  # type: ignore[misc]
        def _on_step(self) -> bool:
            if self.num_timesteps % CHECK_EVERY:
                return True
            curve.append((self.num_timesteps, tests.successes(self.model)))
            if heard is not None:
                heard(*curve[-1])
            return to_the_end or solved_at(curve) is None

    started = perf_counter()
    algorithm.learn(steps, callback=CallbackList([*([own] if own is not None else []), Check()]))
    seconds = perf_counter() - started
    if met is not None:
        met(algorithm, getattr(own, "world", None))
    learning, dreaming, laws = _costs(own)
    return Run(course.name, arm.name, seed, tuple(curve), solved_at(curve), seconds, learning, dreaming, laws)


def solved_at(curve: Sequence[tuple[int, int]]) -> int | None:
    """Real steps at the second of two evaluations in a row that are success; none if there are none."""
    pairs = pairwise(curve)
    return next((later[0] for sooner, later in pairs if min(sooner[1], later[1]) >= ENOUGH), None)


def _costs(own: Any) -> tuple[float, float, str]:
    if own is None or not hasattr(own, "apprentice"):
        return 0.0, 0.0, ""
    parts = [own.world, getattr(own.apprentice.judge, "model", None)]
    laws = [part.describe() for part in dict.fromkeys(parts) if hasattr(part, "describe")]
    return own.apprentice.seconds, own.dreaming_seconds, "\n\n".join(laws)


# ------------------------------------------------------------------ many runs
def kept(folder: Path, course: Course, arm: Arm, seed: int, steps: int) -> Path:
    """Where a run is kept."""
    return folder / f"{course.name}-{arm.name}-{steps}-seed{seed}.json"


def load(path: Path) -> Run:
    """Read a kept run; `ConfigError` where the file is damaged."""
    try:
        return Run.from_json(json.loads(path.read_text(encoding="utf-8")))
    except (ValueError, TypeError, KeyError) as error:
        raise ConfigError(
            f"{path} is no run of this experiment ({error}): delete it to run it again"
        ) from None


def _job(folder: str, course: str, arm: str, seed: int, steps: int) -> str:
    """One run in a process of its own, written atomically."""
    path = kept(Path(folder), COURSES[course], ARMS[arm], seed, steps)

    def heard(at: int, good: int) -> None:
        print(f"{course}, {arm}, seed {seed}: {good} of {EPISODES} after {at:,}", file=sys.stderr, flush=True)

    found = run(COURSES[course], ARMS[arm], seed=seed, steps=steps, heard=heard)
    partial = path.with_suffix(f".{os.getpid()}.partial")
    partial.write_text(json.dumps(asdict(found), indent=1), encoding="utf-8")
    partial.replace(path)
    return str(path)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run what isn't run yet, then report everything that was asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--course", choices=sorted(COURSES), default="truck")
    parser.add_argument("--arms", nargs="+", choices=list(ARMS), default=list(ARMS))
    parser.add_argument("--seeds", type=int, default=len(TRAINING_SEEDS), help="number of seeds, at most 5")
    parser.add_argument("--steps", type=int, default=STEPS, help="real steps at most")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, default=Path("out/dyna"))
    chosen = parser.parse_args(arguments)
    from relgym.experiments.dyna_report import draw_runs, summary

    chosen.out.mkdir(parents=True, exist_ok=True)
    course, seeds = COURSES[chosen.course], TRAINING_SEEDS[: chosen.seeds]
    wanted = [(arm, seed) for arm in chosen.arms for seed in seeds]
    places = {(arm, seed): kept(chosen.out, course, ARMS[arm], seed, chosen.steps) for arm, seed in wanted}
    missing = [key for key, path in places.items() if not path.is_file()]
    with ProcessPoolExecutor(chosen.jobs) as pool:
        jobs = [pool.submit(_job, str(chosen.out), course.name, *key, chosen.steps) for key in missing]
        for count, job in enumerate(as_completed(jobs), start=1):
            print(f"{count} of {len(missing)} runs: {job.result()}", file=sys.stderr, flush=True)
    runs = [load(path) for path in places.values()]
    print(summary(runs, chosen.steps))
    print(draw_runs(chosen.out / f"{course.name}.png", runs, course.title))


if __name__ == "__main__":
    main()
