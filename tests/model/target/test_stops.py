"""Walls at work: a rate's constant told by where its follower would get to, and what refutes that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from points import learned, schema_of, transitions

from relgym.clustering.columns import SlotSignature
from relgym.model.target.stops import Landing, Stop, Stops
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Transition

PUCK = schema_of(("x", "v"), ("push",))
LEFT, RIGHT = -1.0, 2.0
STOP = Stop(3, 0.0, "x", 0.5, -1.0, -1.0, 1e-6)
LANDING = Landing(4, -1.0, "v", 0.0, 1e-6)


def slide(state: np.ndarray, action: np.ndarray) -> list[float]:
    """A puck in a channel: it is pushed, and either end stops it."""
    x, v = state
    v = 0.9 * v + action[0]
    if x + 0.5 * v <= LEFT:
        return [LEFT, 0.0]
    return [RIGHT, 0.0] if x + 0.5 * v >= RIGHT else [x + 0.5 * v, v]


def pushed(n: int, seed: int) -> list[Transition]:
    rng = np.random.default_rng(seed)
    starts = np.column_stack([rng.uniform(LEFT, RIGHT, n), rng.normal(0.0, 1.0, n)])
    return transitions(PUCK, slide, starts, rng.uniform(-1.0, 1.0, (n, 1)))


def test_both_ends_stop_with_one_mode() -> None:
    part = learned(PUCK, pushed(900, 0)).property_model("self", "v")
    assert [(s.bound, s.side) for s in part.stops.stops] == [(LEFT, -1.0), (RIGHT, 1.0)]
    assert len({s.mode for s in part.stops.stops}) == 1


def test_a_wall_at_one_end_is_exact_on_fresh_steps() -> None:
    steps = [t for t in pushed(900, 0) if t.after["self"]["x"] != RIGHT]
    model = learned(PUCK, steps)
    assert [(s.property, s.bound, s.side) for s in model.property_model("self", "v").stops.stops] == [
        ("x", LEFT, -1.0)
    ]
    assert model.property_model("self", "x").limits.least == -np.inf
    fresh = [t for t in pushed(300, 1) if t.after["self"]["x"] != RIGHT]
    assert sum(t.after["self"]["x"] == LEFT for t in fresh) > 10
    layout = fresh[0].before.layout
    batch = model.predict_batch(layout, np.array([t.before.vector for t in fresh]))
    np.testing.assert_allclose(
        batch.vectors[:, :2], np.array([t.after["self"].values for t in fresh]), atol=1e-9
    )
    one = [model.predict_one(t.before) for t in fresh]
    assert batch.vectors.tolist() == [p.scene.vector.tolist() for p in one]
    assert batch.modes.tolist() == [[part.mode for part in p.parts] for p in one]


def test_stops_outlive_the_file(tmp_path: object) -> None:
    model = learned(PUCK, [t for t in pushed(600, 0) if t.after["self"]["x"] != RIGHT])
    model.save(f"{tmp_path}/model.json")
    loaded = WorldModel.load(f"{tmp_path}/model.json")
    for prop in ("x", "v"):
        assert loaded.property_model("self", prop).stops == model.property_model("self", prop).stops
    assert loaded.property_model("self", "v").stops.stops


def test_getting_beyond_the_bound_refutes_a_stop() -> None:
    steps = [t for t in pushed(600, 0) if t.after["self"]["x"] != RIGHT]
    model = learned(PUCK, steps)
    assert model.property_model("self", "v").stops.stops
    before = steps[0].before
    model.learn_one(Transition(before, before.replace({("self", "x"): LEFT - 0.5, ("self", "v"): -1.0})))
    assert not model.property_model("self", "v").stops.stops


def test_conditions_by_hand() -> None:
    row, led = np.array([0.0, -0.9, -0.9]), np.array([-1.0, -0.1, -0.2])
    assert STOP.holds(row, led).tolist() == [False, False, True]
    above = replace(STOP, bound=0.1, side=1.0)
    assert above.holds(np.array([0.0, 0.0]), np.array([0.1, 0.2])).tolist() == [False, True]
    assert LANDING.holds(np.array([0.0, 0.1, 0.0]), np.array([1.0, 1.0, np.nan])).tolist() == [
        True,
        False,
        False,
    ]


def test_what_refutes_by_hand() -> None:
    signature = SlotSignature((PUCK.type("self"),), chained=(("self", "x"), ("self", "v")))

    def row(x: float, v: float) -> np.ndarray:
        values = np.zeros(len(signature.columns))
        values[[signature.column(0, "x'"), signature.column(0, "v'")]] = x, v
        return values

    stops = Stops((STOP,))
    assert not stops.contradicted(3, signature, row(-1.0, 0.0))
    assert stops.contradicted(3, signature, row(-0.5, 0.0))  # it stopped elsewhere
    assert stops.contradicted(1, signature, row(-1.5, 0.0))  # it got through
    assert not stops.contradicted(1, signature, row(-0.5, 0.0))
    landings = Stops((), (LANDING,))
    assert not landings.contradicted(4, signature, row(-1.0, 0.0))
    assert landings.contradicted(4, signature, row(-1.0, 0.2))
    assert landings.contradicted(1, signature, row(-1.0, 0.0))


def test_what_is_not_predicted_stays_so() -> None:
    signature = SlotSignature((PUCK.type("self"),), chained=(("self", "x"), ("self", "v")))
    x = np.zeros((2, len(signature.columns)))
    x[:, signature.column(0, "x")] = -0.9
    values, modes = np.array([np.nan, -1.0]), np.array([0, 1])
    Stops((STOP,)).apply(signature, x, values, modes)
    np.testing.assert_array_equal(values, [np.nan, 0.0])
    assert modes.tolist() == [0, 3]


def test_they_say_when_they_hold() -> None:
    every = Stops((STOP,), (LANDING,))
    assert every.text(3, "v") == "where x + 0.5 v' would be <= -1"
    assert every.text(4, "x") == "where v' = 0"
    assert 3 in every and 4 in every and 1 not in every
    assert Stops.from_json(every.to_json()) == every
