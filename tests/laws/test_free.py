from __future__ import annotations

import numpy as np
import pytest

from relgym.laws.columns import Sources, vector_types
from relgym.laws.free import FreeLearner, free_motion
from relgym.scene.objects import POSE, ObjectType, Target
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, Sphere

BALL = ObjectType("thing", (*POSE, "vx", "vy", "heat"), Sphere(), velocity=("vx", "vy", None))
ACTION = ObjectType("action", ("fx", "fy"))
SCHEMA = SceneSchema(
    (BALL, ACTION, ObjectType("box", POSE, Box())), (("a", "thing"), ("action", "action"), ("b", "box"))
)
SOURCES = Sources.of(SCHEMA, BALL)


def taught(rows: list[tuple[list[float], list[float]]], tolerance: float = 1e-12) -> FreeLearner:
    learner = FreeLearner(SOURCES, seed=0)
    for x, after in rows:
        law, right = learner.law, False
        if law is not None:
            value = free_motion(law, SOURCES.names, np.array(x)[:, None])[:, 0]
            right = bool((np.abs(value - after) <= tolerance).all())
        learner.learn_one(np.array(x), np.array(after), right, tolerance)
    return learner


def formulas(learner: FreeLearner) -> list[str]:
    assert learner.law is not None
    return [piece.formula(6) for piece in learner.law.components]


def test_columns_leave_poses_out() -> None:
    assert SOURCES.names == ("vx", "vy", "heat", "action.fx", "action.fy")
    layout = SCHEMA.layout()
    assert SOURCES.places(layout, 0).tolist() == [9, 10, 11, 12, 13]
    assert SOURCES.places(SCHEMA.layout(["a"]), 0).tolist() == [9, 10, 11, 12, 12]  # a NaN behind the vector


def test_only_learned_vectors_take_part() -> None:
    both = (Target("thing", "vx"), Target("thing", "vy"))
    assert [t.name for t in vector_types(SCHEMA, both)] == ["thing"]
    assert vector_types(SCHEMA, both[:1]) == ()


def test_a_fall_from_one_trajectory(rng: np.random.Generator) -> None:
    vy = np.cumsum(np.full(20, -0.01))
    rows = [([0.3, y, 1.0, 0.0, 0.0], [0.3, y - 0.01]) for y in vy]
    # vx never varied: it must not stand in for the constant.
    assert formulas(taught(rows)) == ["vx", "vy - 0.01"]


def test_thrust_and_drag(rng: np.random.Generator) -> None:
    rows = []
    for x in rng.normal(size=(60, 5)):
        rows.append((x.tolist(), [0.9 * x[0] + 0.1 * x[3], x[1] + 0.1 * x[4] - 0.01]))
    assert formulas(taught(rows)) == ["0.9 vx + 0.1 action.fx", "vy + 0.1 action.fy - 0.01"]


def test_an_over_specific_law_is_revised(rng: np.random.Generator) -> None:
    still = [([0.0, y, 0.0, 0.0, 0.0], [0.0, 0.5 * y]) for y in rng.normal(size=10)]
    moving = [([x, y, 0.0, 0.0, 0.0], [0.5 * x, 0.5 * y + x]) for x, y in rng.normal(size=(20, 2))]
    assert formulas(taught(still)) == ["vx", "0.5 vy"]
    assert formulas(taught(still + moving)) == ["0.5 vx", "0.5 vy + vx"]


def test_where_gravity_has_changed_only_what_came_since_counts(rng: np.random.Generator) -> None:
    falls = [
        [([x, y, 0.0, 0.0, 0.0], [x, y - g]) for x, y in rng.normal(size=(900, 2))] for g in (0.01, 0.005)
    ]
    learner = taught(falls[0] + falls[1][:12])
    assert formulas(learner) == ["vx", "vy - 0.005"]
    assert learner.law is not None and learner.law.unexplained == 0 and len(learner.store.rows) == 12
    assert formulas(taught(falls[0] + falls[1] + falls[0][:12])) == ["vx", "vy - 0.01"]  # and back


def test_what_is_done_late_is_no_change_of_the_world(rng: np.random.Generator) -> None:
    idle = [([x, y, 0.0, 0.0, 0.0], [x, y - 0.01]) for x, y in rng.normal(size=(300, 2))]
    pushed = [([x, y, 0.0, f, 0.0], [x + 0.1 * f, y - 0.01]) for x, y, f in rng.normal(size=(100, 3))]
    learner = taught(idle + pushed)
    assert formulas(learner) == ["vx + 0.1 action.fx", "vy - 0.01"] and len(learner.store.rows) == 400


def test_no_law_where_there_is_none(rng: np.random.Generator) -> None:
    rows = [(x.tolist(), [float(np.sin(9 * x[0])), float(x[1] ** 2)]) for x in rng.normal(size=(80, 5))]
    assert taught(rows).law is None


def test_outliers_are_counted_not_fitted(rng: np.random.Generator) -> None:
    rows = [(x.tolist(), [0.5 * x[0], x[1]]) for x in rng.normal(size=(100, 5))]
    rows[30] = (rows[30][0], [7.0, 7.0])
    learner = taught(rows)
    learner.fit(1e-12)
    assert formulas(learner) == ["0.5 vx", "vy"]
    assert learner.law is not None
    assert learner.law.unexplained == 1


def test_spread_estimates_the_noise(rng: np.random.Generator) -> None:
    rows = [
        (x.tolist(), [x[0] + 1e-3 * e, x[1] - 0.5])
        for x, e in zip(rng.normal(size=(400, 5)), rng.normal(size=400), strict=True)
    ]
    assert taught(rows).spread() == pytest.approx(1e-3, rel=0.2)


def test_what_never_moved_scatters_by_nothing(rng: np.random.Generator) -> None:
    learner = taught([(x.tolist(), [0.0, float(np.sin(9 * x[0]))]) for x in rng.normal(size=(80, 5))])
    assert learner.law is None
    assert 0.1 < learner.spread() < 2.0
    assert taught([([0.0] * 5, [0.0, 0.0])] * 10).spread() == 0.0
