"""1,024 dreams stepped at once (at least: 100,000 env-steps a second on one core, three times the engine's).

Everything is recomputed in each step: geometry, relations, votes, players, functions. A round is one step of all
dreams, so 10.24 ms are 100,000 env-steps a second.
"""

from __future__ import annotations

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from relgym.experiments.dyna.speed import WORLDS, dreams, engine


@pytest.mark.parametrize("world", WORLDS)
def test_dreams(benchmark: BenchmarkFixture, world: str) -> None:
    envs = dreams(world)
    envs.reset(seed=0)
    envs.action_space.seed(0)
    actions = envs.action_space.sample()
    benchmark.pedantic(envs.step, args=(actions,), rounds=100, warmup_rounds=5)


@pytest.mark.parametrize("world", ["truck", "ball by laws"])
def test_the_engine_in_a_sync_vector_env(benchmark: BenchmarkFixture, world: str) -> None:
    envs = engine(world)
    envs.reset(seed=0)
    envs.action_space.seed(0)
    actions = envs.action_space.sample()
    benchmark.pedantic(envs.step, args=(actions,), rounds=5, warmup_rounds=1)
