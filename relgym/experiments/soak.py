"""A long life of a learner: memory, cost and worst step, as they are after more and more transitions."""

from __future__ import annotations

import contextlib
import ctypes
import multiprocessing
import resource
import statistics
import sys
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Final, NamedTuple

import gymnasium as gym
import numpy as np

import relgym  # noqa: F401 - registers the envs
from relgym.config import ModelConfig
from relgym.config.constants import MORE_ROOM
from relgym.experiments.benchmark import Benchmark, Extent, Known, Option, Shown, Suite
from relgym.experiments.criterion import measured
from relgym.experiments.seeds import TRAINING_SEEDS
from relgym.model.reports.text import Cell, table
from relgym.wrappers import ModelLearner

__all__ = ["SUITE", "WORLDS", "Course", "course", "fill_cache", "give_back", "soak", "trial"]

WORLDS: Final[dict[str, tuple[str, dict[str, Any]]]] = {
    "ball": ("relgym/BallBoxRamp-v0", {}),
    "cart": ("CartPole-v1", {}),
    "lander": ("LunarLander-v3", {}),
}
"""Id and arguments of each world."""

LINES: Final = 100
"""Lines that a life is told in."""

LARGER, SLOWER = 1.02, 1.25
"""By how much more memory, and time a step, a life may take at its end: pieces of memory that C libraries keep come to
a per cent or two; a step is dearer while more is remembered than when the laws were just known."""


class _Elsewhere(gym.Env[Any, Any]):
    """An env in a process of its own, so that what is measured here is the learner's.

    Simulators lose memory, too: Box2D some 17 bytes with each step of LunarLander, 1.3 MB in 75,000.
    """

    def __init__(self, name: str) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, there = context.Pipe()
        self._process = context.Process(target=_serve, args=(name, there), daemon=True)
        self._process.start()
        there.close()
        self.observation_space, self.action_space, schema = self._pipe.recv()
        if schema is not None:
            self.schema = schema

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        self._pipe.send((seed, options))
        begun: tuple[Any, dict[str, Any]] = self._pipe.recv()
        return begun

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self._pipe.send(action)
        happened: tuple[Any, float, bool, bool, dict[str, Any]] = self._pipe.recv()
        return happened

    def close(self) -> None:
        self._pipe.close()
        self._process.join()


def _serve(name: str, pipe: Connection) -> None:
    """Make a world, and do what is asked, until nobody is there who asks."""
    env_id, arguments = WORLDS[name]
    env = gym.make(env_id, **arguments)
    schema = env.get_wrapper_attr("schema") if env.has_wrapper_attr("schema") else None
    pipe.send((env.observation_space, env.action_space, schema))
    with contextlib.suppress(EOFError):
        while True:
            asked = pipe.recv()
            if isinstance(asked, tuple):
                pipe.send(env.reset(seed=asked[0], options=asked[1]))
            else:
                pipe.send(env.step(asked))


_MMAP_THRESHOLD, _LARGE = -3, 1 << 17
"""Number of the parameter of `mallopt(3)`, and its default in bytes, which stays if it is set."""

_CACHED, _PER_SIZE = 1024, 7
"""Sizes in bytes below which numpy keeps memory that was freed, and how many pieces of each."""


def soak(
    name: str, steps: int, *, every: int, seed: int = 0, history: int | None = None
) -> list[list[float]]:
    """Learn from random steps of a world, which runs in another process, and take note now and then.

    Parameters
    ----------
    name
        Of `WORLDS`.
    steps
        Transitions.
    every
        Transitions from one line to the next.
    seed
        Of the env and its actions.
    history
        Examples kept per type (`ModelConfig.history`), from which number on memory is to be flat; None: the default.

    Returns
    -------
    A row per line: transitions, hours, and the learner's alone: memory in MB, mean and worst step in ms of processor
    time since the last line.
    """
    env = ModelLearner(_Elsewhere(name), config={} if history is None else {"history": history})
    env.action_space.seed(seed)
    env.reset(seed=seed)
    begin, rows, spent, worst = time.monotonic(), list[list[float]](), 0.0, 0.0
    for k in range(1, steps + 1):
        action, start = env.action_space.sample(), time.thread_time()
        _, _, terminated, truncated, _ = env.step(action)
        took = time.thread_time() - start
        spent, worst = spent + took, max(worst, took)
        if terminated or truncated:
            env.reset()
        if k % every == 0:
            rows.append([k, (time.monotonic() - begin) / 3600.0, _memory(), 1e3 * spent / every, 1e3 * worst])
            spent = worst = 0.0
    env.close()
    return rows


class Course(NamedTuple):
    """What became of memory and cost in a long life (`course`).

    Attributes
    ----------
    memory
        MB: medians of the first and the last quarter of what follows the bound.
    cost
        ms a step: in the median from 10,000 to 20,000 transitions, when the laws are known (of shorter lives in the
        first quarter), and in the last quarter.
    """

    memory: tuple[float, float]
    cost: tuple[float, float]


def course(rows: list[list[float]], bound: int) -> Course | None:
    """What became of memory and cost; of fewer than four lines after the bound nothing can be told.

    A line's memory is that of one moment, in which a search may be under way; so medians of quarters are compared.

    Parameters
    ----------
    rows
        As `soak` returns them.
    bound
        Transitions after which no more examples are kept than before.
    """
    after = [row for row in rows if row[0] >= bound]
    if (quarter := len(after) // 4) == 0:
        return None
    first, last = (statistics.median(row[2] for row in some) for some in (after[:quarter], after[-quarter:]))
    early = [row for row in rows if 10_000 < row[0] <= 20_000] or after[:quarter]
    then, at_end = (statistics.median(row[3] for row in some) for some in (early, after[-quarter:]))
    return Course((first, last), (then, at_end))


def _memory() -> float:
    """Memory of this process in MB: at present where the system tells, else its peak."""
    statm = Path("/proc/self/statm")
    if statm.exists():
        return int(statm.read_text().split()[1]) * resource.getpagesize() / 2**20
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)


def give_back() -> None:
    """Have the C library give large pieces of memory back as soon as they are freed, where it is one that can.

    By itself glibc raises the size from which on it does (`mallopt(3)`, M_MMAP_THRESHOLD), and keeps gaps for later:
    with LunarLander memory then rises in one step, by one per cent or two, though no more is in use.
    """
    with contextlib.suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).mallopt(_MMAP_THRESHOLD, _LARGE)


def fill_cache() -> None:
    """Have numpy's cache of small arrays full from the beginning.

    Numpy keeps up to seven freed pieces of each size below 1,024 bytes for the next array that asks for as many, and
    gives none back (`numpy/_core/src/multiarray/alloc.c`). As rows of ever other numbers are looked at the cache fills,
    for hundreds of thousands of steps: .6 MB from 30,000 to 90,000 transitions of LunarLander, 3.6 MB at most.
    """
    for size in range(1, _CACHED):
        _ = [np.empty(size, dtype=np.uint8) for _ in range(_PER_SIZE)]


def trial(*, world: str, steps: int, history: int, seed: int) -> list[list[float]]:
    """`soak` of a world in so many steps, told in `LINES` lines, from a process as quiet as can be."""
    give_back()
    fill_cache()
    return soak(world, steps, every=max(1, steps // LINES), seed=seed, history=history)


def _benchmark(world: str) -> Benchmark:
    def measure(extent: Extent, known: Known) -> Shown:
        size = {name: extent[name] for name in ("steps", "history")}
        asked = [{"world": world, "seed": seed, **size} for seed in extent.first(TRAINING_SEEDS)]
        found = known("relgym.experiments.soak:trial", asked)
        courses = [
            told
            for rows in found
            if (told := course(rows, int((1.0 + MORE_ROOM) * extent["history"]))) is not None
        ]
        measures = []
        if courses:
            grown = [told.memory[1] / told.memory[0] for told in courses]
            slower = [told.cost[1] / told.cost[0] for told in courses]
            measures = [
                measured("memory at the end, over that when the history was full", LARGER, grown),
                measured("time a step at the end, over that when laws were known", SLOWER, slower),
            ]
        heads = ["transitions", "hours", "memory, MB", "mean, ms", "worst, ms"]
        notes = [table(heads, [_line(row) for row in rows[:: max(1, len(rows) // 10)]]) for rows in found]
        notes += [
            f"Of all lines: {max(memory):.1f} MB at most, and {max(worst):.1f} ms for a step."
            for _, _, memory, _, worst in (zip(*rows, strict=True) for rows in found)
        ]
        if len(courses) < len(found):
            notes.append("Too short to say what becomes of memory: take more steps, or keep fewer examples.")
        return Shown(measures, notes)

    return Benchmark(f"{world}: memory, cost and worst step of a long life", measure)


def _line(row: list[float]) -> list[Cell]:
    steps, hours, memory, mean, worst = row
    return [int(steps), f"{hours:.3f}", f"{memory:.1f}", f"{mean:.3f}", f"{worst:.1f}"]


SUITE: Final = Suite(
    "soak",
    "Long lives",
    {world: _benchmark(world) for world in WORLDS},
    seeds=1,
    options={
        "steps": Option(1_000_000, "transitions of a life"),
        "history": Option(ModelConfig().history, "examples kept per type"),
    },
    usual=("ball", "cart"),
)
