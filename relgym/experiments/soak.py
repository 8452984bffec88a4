"""A long life of a learner: memory, cost and worst step, as they are after more and more transitions."""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import multiprocessing
import resource
import statistics
import sys
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Final

import gymnasium as gym
import numpy as np

import relgym  # noqa: F401 - registers the envs
from relgym.config import ModelConfig
from relgym.model.learning.forgetting import SLACK
from relgym.wrappers import ModelLearner

__all__ = ["WORLDS", "fill_cache", "give_back", "main", "soak", "summary"]

WORLDS: Final[dict[str, tuple[str, dict[str, Any]]]] = {
    "ball": ("relgym/BallBoxRamp-v0", {}),
    "cart": ("CartPole-v1", {}),
    "lander": ("LunarLander-v3", {}),
}
"""Id and arguments of each world."""


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
    name: str,
    steps: int,
    *,
    every: int,
    hours: float = float("inf"),
    seed: int = 0,
    history: int | None = None,
) -> list[list[float]]:
    """Learn from random steps of a world, which runs in another process, and print a line now and then.

    Parameters
    ----------
    name
        Of `WORLDS`.
    steps, hours
        When to end: after so many transitions, or so much time, whichever is first.
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
    print(
        f"{name}: {'transitions':>12} {'hours':>7} {'memory MB':>10} {'mean ms':>9} {'worst ms':>9}",
        flush=True,
    )
    for k in range(1, steps + 1):
        action, start = env.action_space.sample(), time.thread_time()
        _, _, terminated, truncated, _ = env.step(action)
        took = time.thread_time() - start
        spent, worst = spent + took, max(worst, took)
        if terminated or truncated:
            env.reset()
        over = time.monotonic() - begin >= 3600.0 * hours
        if k % every == 0 or over:
            passed = (time.monotonic() - begin) / 3600.0
            rows.append([k, passed, _memory(), 1e3 * spent / (k % every or every), 1e3 * worst])
            print(
                f"{name}: {k:12,} {passed:7.3f} {rows[-1][2]:10.1f} {rows[-1][3]:9.3f} {rows[-1][4]:9.1f}",
                flush=True,
            )
            spent = worst = 0.0
        if over:
            break
    env.close()
    return rows


def summary(rows: list[list[float]], bound: int) -> str:
    """What became of memory and cost in a long life.

    A line's memory is that of one moment, in which a search may be under way; so medians of quarters are compared. What
    a step costs at the end is compared with what it cost from 10,000 to 20,000 transitions, when the laws are known.

    Parameters
    ----------
    rows
        As `soak` returns them.
    bound
        Transitions after which no more examples are kept than before.

    Returns
    -------
    A sentence on each, of a run with four lines at least after the bound; else that it was too short.
    """
    after = [row for row in rows if row[0] >= bound]
    if (quarter := len(after) // 4) == 0:
        return f"too short to say what becomes of memory after {bound:,} transitions"
    first, last = (statistics.median(row[2] for row in some) for some in (after[:quarter], after[-quarter:]))
    early = [row for row in rows if 10_000 < row[0] <= 20_000] or rows[:1]
    then, at_end = (statistics.median(row[3] for row in some) for some in (early, after[-quarter:]))
    return (
        f"memory after {bound:,} transitions: {first:.1f} MB in the first quarter, {last:.1f} in the last "
        f"({100.0 * (last / first - 1.0):+.1f} %), {max(row[2] for row in after):.1f} at most\n"
        f"cost: {then:.3f} ms up to {early[-1][0]:,}, {at_end:.3f} in the last quarter ({at_end / then:.2f} times)"
    )


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


def main() -> None:
    """Soak the worlds that are named, one after the other."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("worlds", nargs="*", default=["ball"], help=f"of {', '.join(WORLDS)}")
    parser.add_argument("--steps", type=int, default=1_000_000)
    parser.add_argument("--every", type=int, default=10_000)
    parser.add_argument("--hours", type=float, default=float("inf"))
    parser.add_argument("--history", type=int, help="examples kept per type; default: the learner's")
    given = parser.parse_args()
    give_back()
    fill_cache()
    for name in given.worlds:
        rows = soak(name, given.steps, every=given.every, hours=given.hours, history=given.history)
        history = ModelConfig().history if given.history is None else given.history
        print(summary(rows, int(SLACK * history)))


if __name__ == "__main__":
    main()
