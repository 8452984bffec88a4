"""When an approximation is worth having, and when it gives way to a better one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from points import learned, schema_of, transitions

from relgym.clustering.discovery import Scale
from relgym.clustering.last_resort import Resort, last_resort, timely
from relgym.clustering.mode import NOISE
from relgym.model.world_model import WorldModel

SHIP = schema_of(("v", "th"), ("fire",))


def fly(n: int, seed: int, **config: object) -> WorldModel:
    rng = np.random.default_rng(seed)

    def ship(state: np.ndarray, action: np.ndarray) -> list[float]:
        thrust = action[0] * (0.5 + rng.uniform(-0.2, 0.2))
        return [state[0] + thrust * np.sin(state[1]) + 2e-3 * rng.normal(), state[1]]

    starts = np.column_stack([rng.normal(size=n), rng.uniform(-3.0, 3.0, n)])
    actions = (rng.random((n, 1)) < 0.5).astype(float)
    return learned(SHIP, transitions(SHIP, ship, starts, actions), **config)


def test_an_engine_that_fires_as_it_likes_is_described_by_what_it_does_on_average() -> None:
    model = fly(400, 0, features=("trig", "products"))
    part = model.property_model("self", "v")
    assert part.clusterer.approximate
    largest = max(part.modes, key=lambda m: m.examples)
    weights = dict(largest.roles[0].terms)
    assert abs(weights["v"] - 1.0) < 0.02
    assert abs(weights["action.fire sin(th)"] - 0.5) < 0.05
    assert largest.examples > 380


def test_it_is_only_sought_among_features_that_were_asked_for() -> None:
    assert not fly(300, 0).property_model("self", "v").clusterer.approximate


@dataclass
class Seen:
    """An example table's target after so many examples, of which the present approximation leaves `sigma`."""

    seen: int
    sigma: float
    fly: WorldModel

    @property
    def scale(self) -> Scale:
        return Scale(self.sigma, 4.0, 6.0)

    def __getattr__(self, name: str) -> object:
        return getattr(self.fly.property_model("self", "v").clusterer, name)

    def timely(self, *, again: bool) -> bool:
        population: Any = self
        return timely(population, self.fly._parts.tables["self"], again=again)


@pytest.mark.parametrize("features", [(), ("trig", "products")])
def test_it_is_sought_oftener_among_features_unless_noise_is_what_is_left(features: tuple[str, ...]) -> None:
    model = fly(120, 0, features=features)

    def times(sigma: float, *, again: bool) -> list[int]:
        return [n for n in range(2_000) if Seen(n, sigma, model).timely(again=again)]

    seldom, often = [256, 1024], [216, 256, 324, 486, 729, 1024, 1094, 1641]
    assert times(0.01, again=True) == (often if features else seldom)
    assert times(0.1, again=True) == seldom  # the engine changes v by 0.3 in the mean
    assert times(0.1, again=False) == (often if features else seldom)


def test_an_approximation_gives_way_to_a_better_one_only() -> None:
    model = fly(1_200, 0, features=("trig", "products"))
    clusterer = model.property_model("self", "v").clusterer
    table = model._parts.tables["self"]
    again = last_resort(clusterer.population, table, floor=clusterer.floor, again=True)
    assert again is None  # hardly better than what there is
    clusterer.population.clusters = dict(list(clusterer.clusters.items())[:0])
    found = last_resort(clusterer.population, table, floor=clusterer.floor, again=True)
    assert found is not None
    assert 0.04 < found.sigma < 0.09


def test_slices_of_noise_give_way_to_one_function() -> None:
    model = fly(400, 0, features=("trig", "products"))
    clusterer = model.property_model("self", "v").clusterer
    table = model._parts.tables["self"]
    (cluster,) = clusterer.clusters.values()
    clusterer.labels[:] = cluster.mode.id
    sigma = clusterer.scale.sigma

    def found(slices: int, less: float) -> bool:
        clusterer.population.clusters = {
            k: replace(cluster, mode=replace(cluster.mode, id=k)) for k in range(1, slices + 1)
        }
        clusterer.population.scale = replace(clusterer.scale, sigma=sigma / less)
        return last_resort(clusterer.population, table, floor=clusterer.floor, again=False) is not None

    assert found(3, 2.5)  # three slices of noise would leave a third of it
    assert not found(3, 4.0)
    assert not found(1, 1.1)
    assert found(1, 0.9)
    clusterer.labels[::2] = NOISE  # errors of half of the examples take as many bits as if nothing were known
    assert found(1, 1.1)
    assert not found(1, 100.0)  # a law


def test_what_is_compared_was_fitted_to_other_examples() -> None:
    model = fly(400, 0, features=("trig", "products"))
    clusterer = model.property_model("self", "v").clusterer
    table = model._parts.tables["self"]
    begun = {
        again: Resort.of(clusterer.population, table, floor=clusterer.floor, again=again)
        for again in (False, True)
    }
    assert {again: resort.fitted for again, resort in begun.items()} == {False: 400, True: 360}


def test_a_shorter_approximation_is_taken_if_it_is_as_good() -> None:
    model = fly(400, 0, features=("trig", "products"))
    clusterer = model.property_model("self", "v").clusterer
    table = model._parts.tables["self"]
    (cluster,) = clusterer.clusters.values()
    (role,) = cluster.mode.roles
    padded = replace(role, terms=(*role.terms, *((name, 0.0) for name in ("th", "sin(v)", "cos(v)"))))
    clusterer.population.clusters = {1: replace(cluster, mode=replace(cluster.mode, roles=(padded,)))}
    found = last_resort(clusterer.population, table, floor=clusterer.floor, again=True)
    assert found is not None
    assert found.fit.terms <= cluster.mode.parameters
