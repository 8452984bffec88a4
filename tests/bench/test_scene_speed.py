"""Cost of relations and contacts: one scene of seven objects (at most: 250 us) and a batch (at most: 10 us each)."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from scenes import random_vectors, schema_of

from relgym.experiments.data import ball_episodes
from relgym.scene import Extractor, canonical_order, signature

BATCH = 24_000


@pytest.fixture(scope="module")
def world() -> tuple[Extractor, np.ndarray]:
    """A ball among six bodies that stand still: the states of some episodes of experiment 1."""
    episodes = list(ball_episodes(1, episodes=10, seed=0))
    vectors = np.concatenate([b.vectors[:-1] for b in episodes])
    return Extractor(episodes[0].schema), np.resize(vectors, (BATCH, vectors.shape[1]))


def test_one_scene(benchmark: BenchmarkFixture, world: tuple[Extractor, np.ndarray]) -> None:
    extractor, vectors = world
    layout, rows = extractor.schema.layout(), itertools.cycle(range(200))

    def step() -> None:
        i = next(rows)
        extractor.extract(layout, vectors[i : i + 1]).contacts(0)

    benchmark(step)


def test_batch(benchmark: BenchmarkFixture, world: tuple[Extractor, np.ndarray]) -> None:
    extractor, vectors = world
    benchmark(lambda: extractor.extract(extractor.schema.layout(), vectors).contacts(0))


@pytest.mark.parametrize("function", [canonical_order, signature])
def test_order_of_one_scene(
    benchmark: BenchmarkFixture, world: tuple[Extractor, np.ndarray], function: object
) -> None:
    extractor, vectors = world
    found = extractor.extract(extractor.schema.layout(), vectors[:1])
    benchmark(function, found, 0)


@pytest.mark.parametrize("geometry", ["arrays", "fcl"])
def test_rotated_solids_in_space(benchmark: BenchmarkFixture, geometry: str) -> None:
    schema = schema_of(("ball", "box", "ramp", "hull", "box"), planar=False)
    vectors = random_vectors(schema.layout(), 50, np.random.default_rng(0))
    extractor = Extractor(schema, geometry=geometry)  # type: ignore[arg-type]
    benchmark(lambda: extractor.extract(schema.layout(), vectors))
