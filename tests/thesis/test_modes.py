"""Roles of lines, and the objects bound to them, by hand."""

from __future__ import annotations

import math

import numpy as np

from relgym.clustering.mode import Role
from relgym.scene.objects import ACTION, ObjectType, Target
from relgym.scene.schema import SceneSchema
from relgym.thesis.examples import Arrangement, Examples
from relgym.thesis.modes import Cluster, castings, roles_of
from relgym.thesis.regression import Line

# Columns: truck x 0, v 1; box_a x 2, friction 3; box_b x 4, friction 5; action push 6.
SCHEMA = SceneSchema(
    (ObjectType("truck", ("x", "v")), ObjectType("box", ("x", "friction")), ObjectType(ACTION, ("push",))),
    (("truck", "truck"), ("box_a", "box"), ("box_b", "box"), (ACTION, ACTION)),
)
LAYOUT = SCHEMA.layout()
HERE = Arrangement(LAYOUT, LAYOUT.index("truck"))
FRICTION = Role("box", (("friction", -2.0),))
OWN = Role("truck", (("v", 1.0),))
PUSH = Role(ACTION, (("push", 0.5),))


def test_columns_and_places() -> None:
    assert [HERE.place(column) for column in range(7)] == [
        (0, 0),
        (0, 1),
        (1, 0),
        (1, 1),
        (2, 0),
        (2, 1),
        (3, 0),
    ]
    assert [list(HERE.columns(index)) for index in range(4)] == [[0, 1], [2, 3], [4, 5], [6]]
    assert HERE.alone() == (0, 3)  # there are two boxes
    assert Arrangement(LAYOUT, 1).alone() == (0, 1, 3)  # a box that is the target is one of its own
    assert HERE.key == (("truck", "box", "box", ACTION), 0)


def test_a_line_is_cut_into_roles() -> None:
    """v' = v - 2 friction_a + 0.5 push, as in Figure 3.3; the target comes first whatever it contributes."""
    assert roles_of(Line((1, 3, 6), (1.0, -2.0, 0.5), 0.0), HERE) == (OWN, PUSH, FRICTION)
    assert roles_of(Line((6,), (0.5,), 1.0), HERE) == (Role("truck", ()), PUSH)
    both = roles_of(Line((3, 4, 5), (-2.0, 0.1, -2.0), 0.0), HERE)
    assert both == (Role("truck", ()), FRICTION, Role("box", (("friction", -2.0), ("x", 0.1))))
    assert roles_of(Line((0,), (3.0,), 0.0), HERE, (5,)) == (
        Role("truck", ()),
        Role("box", (("friction", 3.0),)),
    )


def test_all_ways_to_fill_roles() -> None:
    assert [c.objects for c in castings((OWN, FRICTION), 0.0, HERE)] == [(0, 1), (0, 2)]
    two = list(castings((OWN, FRICTION, FRICTION), 1.0, HERE))
    assert [c.objects for c in two] == [(0, 1, 2), (0, 2, 1)]  # nobody twice
    assert two[0].columns == (1, 3, 5) and two[0].weights == (1.0, -2.0, -2.0)
    assert two[0].value([0.0, 10.0, 0.0, 1.0, 0.0, 2.0, 0.0]) == 1.0 + 10.0 - 2.0 - 4.0
    assert list(castings((OWN, FRICTION, FRICTION, FRICTION), 0.0, HERE)) == []


def test_the_best_casting_counts() -> None:
    """v = 10 and frictions 1 and 3: v' = v - 2 friction is 8 or 4."""
    mode = Cluster(1, (OWN, FRICTION), 0.0)
    x = np.array([[0.0, 10.0, 0.0, 1.0, 0.0, 3.0, 0.0]] * 3)
    y = np.array([8.0, 4.5, 5.9])
    np.testing.assert_allclose(mode.errors(HERE, x, y), [0.0, 0.5, 1.9])
    assert mode.cast(HERE, x, y).tolist() == [0, 1, 1]
    assert [
        mode.error(HERE, row.tolist(), each) for row, each in zip(x, y.tolist(), strict=True)
    ] == mode.errors(HERE, x, y).tolist()


def test_without_players_nothing_is_explained() -> None:
    mode = Cluster(1, (OWN, FRICTION, FRICTION, FRICTION), 0.0)
    assert mode.errors(HERE, np.zeros((2, 7)), np.zeros(2)).tolist() == [math.inf, math.inf]
    assert mode.error(HERE, [0.0] * 7, 0.0) == math.inf


def test_parameters_are_weights_and_a_constant() -> None:
    assert Cluster(1, (OWN, FRICTION), 0.0).parameters == 2
    assert Cluster(1, (OWN, FRICTION), 0.5).parameters == 3
    assert Cluster(1, (Role("truck", ()),), 0.0).parameters == 0


def test_another_function_forgets_old_castings() -> None:
    mode = Cluster(1, (OWN, FRICTION), 0.0)
    assert len(mode.castings(HERE)) == 2
    assert not mode.become((OWN, FRICTION), 0.0)
    assert mode.become((OWN,), 0.0)
    assert [c.objects for c in mode.castings(HERE)] == [(0,)]


def test_a_mode_as_a_record() -> None:
    found = Cluster(4, (OWN, PUSH, FRICTION), 0.25).mode(Target("truck", "v"), 12)
    assert (found.id, found.examples, found.intercept) == (4, 12, 0.25)
    assert found.roles == (OWN, *sorted((PUSH, FRICTION)))


def test_examples_are_kept_as_they_came() -> None:
    """More of them than fit at first, of two arrangements in turn."""
    known = Examples()
    groups = [known.number_of(LAYOUT, LAYOUT.index(name)) for name in ("truck", "box_a")]
    assert groups == [0, 1] and known.number_of(LAYOUT, 0) == 0
    for k in range(1200):
        assert known.add(groups[k % 2], np.full(7, float(k)), -float(k)) == k
    assert known.count == 1200 and known.y.tolist() == [-float(k) for k in range(1200)]
    assert known.groups.tolist() == [k % 2 for k in range(1200)]
    numbers, x = known.rows(1)
    assert numbers.tolist() == list(range(1, 1200, 2)) and x[:, 3].tolist() == [float(k) for k in numbers]
    assert known.x(0, [4, 1198])[:, 0].tolist() == [4.0, 1198.0]
    assert [(target, x[0], y) for _, target, x, y in known.stream()][-2:] == [
        (0, 1198.0, -1198.0),
        (1, 1199.0, -1199.0),
    ]
