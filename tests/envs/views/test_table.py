"""Tables: rows as objects that come, go, and are sorted anew."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st
from plain_envs import Birds

from relgym.envs.views import Rows, Static, TableView, TaskView, view_from_json
from relgym.envs.views.matching import matched
from relgym.errors import ConfigError, ObservationError
from relgym.scene.shapes import Box, Sphere
from relgym.wrappers import ModelLearner

SPACE = spaces.Box(-100.0, 100.0, (3, 3), np.float64)
NOTHING = spaces.Discrete(1)


def birds(**arguments: Any) -> TableView:
    return TableView(SPACE, NOTHING, **{"columns": ("here", "x", "d"), "presence": "here", **arguments})


def test_rows_are_objects_and_empty_ones_are_absent() -> None:
    scene = birds().scene(np.array([[1.0, 4.0, 0.5], [0.0, 9.0, 9.0], [1.0, 5.0, -0.5]]))
    assert scene.values().keys() == {"row1", "row3"}
    assert scene["row3"].type.properties == ("x", "d")
    assert scene["row3"]["d"] == -0.5


def test_rows_of_kinds_with_bodies_beside_walls() -> None:
    view = birds(
        rows=[Rows("fox", shape=Box(), pose={"px": "x"}), Rows("bird", 2, shape=Sphere(), pose={"px": "x"},
              constants={"sx": 0.5, "sy": 0.5, "sz": 0.5}, velocity=("d", None, None))],
        static=[Static("wall", {"px": 50.0, "sy": 9.0}, shape=Box())],
    )  # fmt: skip
    scene = view.scene(np.array([[1.0, 4.0, 0.5], [1.0, 5.0, 0.0], [1.0, 6.0, 0.0]]))
    assert [(o.name, o.type.name) for o in scene] == [
        ("fox", "fox"),
        ("bird1", "bird"),
        ("bird2", "bird"),
        ("wall", "wall"),
    ]
    np.testing.assert_array_equal(scene.pose()[:, 0], [4.0, 5.0, 6.0, 50.0])
    np.testing.assert_array_equal(scene.pose()[:, 6], [1.0, 0.5, 0.5, 1.0])


# ---------------------------------------------------------------------- who is who
@given(order=st.permutations(range(3)), seed=st.integers(0, 1000))
def test_resorted_rows_keep_their_names(order: list[int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    view = birds(match={"x": 2.0})
    table = np.column_stack(
        [np.ones(3), np.array([0.0, 10.0, 20.0]) + rng.uniform(-1, 1, 3), rng.uniform(-1, 1, 3)]
    )
    first = view.scene(table)
    moved = table + np.array([0.0, 0.4, 0.0])
    later = view.scene(moved[order], last=first)
    assert later == view.scene(moved, last=first)
    for name in first.layout.names:
        assert later[name]["d"] == first[name]["d"]


def test_rows_are_matched_with_where_they_were_expected() -> None:
    view = birds(match={"x": 4.0})
    first = view.scene(np.array([[1.0, 0.0, 1.0], [1.0, 1.0, -1.0], [0.0, 0.0, 0.0]]))
    crossed = np.array([[1.0, 0.0, -1.0], [1.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    expected = first.replace({("row1", "x"): 1.0, ("row2", "x"): 0.0})
    assert view.scene(crossed, last=first)["row1"]["d"] == -1.0  # nearest to where it was: wrong
    assert view.scene(crossed, last=first, expected=expected)["row1"]["d"] == 1.0


def test_only_views_that_match_rows_ask_where_things_were_expected() -> None:
    assert birds(match={"x": 4.0}).matches
    assert not birds().matches
    assert TaskView(birds(match={"x": 4.0})).matches
    assert not TaskView(birds()).matches


def test_what_comes_while_another_goes_gets_a_name_of_its_own() -> None:
    view = birds(match={"x": 2.0})
    first = view.scene(np.array([[1.0, 0.0, 0.1], [1.0, 5.0, 0.2], [1.0, 9.0, 0.3]]))
    later = view.scene(np.array([[1.0, 0.1, 0.1], [1.0, 5.2, 0.2], [1.0, -9.0, 0.9]]), last=first)
    assert later.layout.names == ("row1", "row2", "row4")
    # A name that was free for a step may be given again.
    last = view.scene(np.array([[1.0, 0.2, 0.1], [1.0, 30.0, 0.2], [1.0, -9.0, 0.9]]), last=later)
    assert last.layout.names == ("row1", "row3", "row4")


def test_the_cheapest_assignment_by_hand() -> None:
    rows, expected = np.array([[0.0], [1.0], [5.0]]), np.array([[1.1], [0.2]])
    assert matched(rows, expected, farthest=1.0).tolist() == [1, 0, -1]
    # Greedy would give row 0 to object 0 (0.1 away) and leave row 1 alone.
    assert matched(np.array([[0.0], [0.9]]), np.array([[0.1], [-0.5]]), farthest=1.0).tolist() == [1, 0]
    assert matched(np.empty((0, 1)), expected, farthest=1.0).tolist() == []
    assert matched(rows, np.empty((0, 1)), farthest=1.0).tolist() == [-1, -1, -1]


def test_a_single_row_is_one_object_however_far_it_moves() -> None:
    """An agent's own car drives further in a step than others are allowed to be off."""
    space = spaces.Box(-99.0, 99.0, (1, 2), np.float64)
    view = TableView(
        space, NOTHING, columns=("here", "x"), presence="here", rows=[Rows("ego")], match={"x": 1.0}
    )
    first = view.scene(np.array([[1.0, 0.0]]))
    assert view.scene(np.array([[1.0, 50.0]]), last=first, expected=first)["ego"]["x"] == 50.0


@pytest.mark.parametrize("arrivals", [False, True])
def test_the_law_is_learned_from_a_table_sorted_anew_at_every_step(arrivals: bool) -> None:
    view = TableView(
        Birds().observation_space, NOTHING, columns=("here", "x", "d"), presence="here", match={"x": 1.0}
    )
    env = ModelLearner(Birds(arrivals), view=view)
    for k in range(8):
        env.reset(seed=k)
        for _ in range(15):
            env.step(0)
    (mode,) = env.model.modes("row", "x")
    assert mode.formula(6) == "x' = x + 0.25 d"
    assert env.model.property_model("row", "x").clusterer.noise_examples == 0
    assert [str(t) for t in env.model.targets] == ["row.x"]


# ---------------------------------------------------------------------- bad input, files
def test_numbers_of_an_empty_row_mean_nothing() -> None:
    table = np.array([[1.0, 4.0, 0.5], [0.0, np.nan, np.inf], [1.0, 5.0, -0.5]])
    scene = birds(presence="here").scene(table)
    assert scene.layout.names == ("row1", "row3")
    table[1, 0] = np.nan
    with pytest.raises(ObservationError, match="row 1, column 'here': expected a finite number, got nan"):
        birds(presence="here").scene(table)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (np.zeros((2, 3)), r"a table of shape \(3, 3\), columns \('here', 'x', 'd'\), got shape \(2, 3\)"),
        (
            np.array([[0, 0, 0], [1, 0, np.nan], [0, 0, 0]]),
            "row 1, column 'd': expected a finite number, got nan",
        ),
        ([["a"] * 3] * 3, "expected a table of numbers"),
    ],
)
def test_bad_tables_are_named(table: Any, message: str) -> None:
    with pytest.raises(ObservationError, match=message):
        birds().scene(table)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"columns": ("here", "x")}, "columns: expected 3 different"),
        ({"presence": "there"}, r"name columns \['there'\]"),
        ({"match": {"z": 1.0}}, r"name columns \['z'\]"),
        ({"match": {"x": 0.0}}, "greater than 0"),
        ({"rows": [Rows("bird", 2)]}, "sum to the table's 3 rows, got 2"),
    ],
)
def test_declarations_that_do_not_fit_are_refused(arguments: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        birds(**arguments)
    with pytest.raises(ConfigError, match="ReshapeObservation"):
        TableView(spaces.Box(-1, 1, (4,)), NOTHING, columns=("a", "b"))
    with pytest.raises(ConfigError, match="a count of at least 1, got 0"):
        Rows("bird", 0)


def test_tables_come_back_and_survive_json() -> None:
    table = np.array([[1.0, 4.0, 0.5], [0.0, 0.0, 0.0], [1.0, 5.0, -0.5]])
    for match in (None, {"x": 1.0}):
        view = birds(match=match, static=[Static("wall", {"px": 1.0}, shape=Box())])
        again = view_from_json(json.loads(json.dumps(view.to_json(), sort_keys=True)))
        assert again.schema == view.schema
        shown = again.observation(view.scene(table))
        expected = table if match is None else table[[0, 2, 1]]
        np.testing.assert_array_equal(shown, expected)


def test_more_objects_than_rows_can_not_be_shown() -> None:
    view = birds(match={"x": 1.0})
    scene = view.schema.scene({f"row{k}": [0.0, 0.0] for k in range(1, 5)})
    with pytest.raises(ObservationError, match="at most 3 objects"):
        view.observation(scene)


# ---------------------------------------------------------------------- what has just changed
def test_changes_of_columns_are_properties_too() -> None:
    view = birds(changes=("d",), match={"x": 2.0})
    assert view.schema.type_of("row1").properties == ("x", "d", "d_change")
    first = view.scene(np.array([[1.0, 4.0, 0.5], [0.0, 9.0, 9.0], [1.0, 15.0, -0.5]]))
    assert [first[name]["d_change"] for name in ("row1", "row2")] == [0.0, 0.0]
    # Rows change places, and a new one comes.
    second = view.scene(np.array([[1.0, 15.5, 0.0], [1.0, 4.5, 0.75], [1.0, 50.0, 3.0]]), last=first)
    assert [second[name]["d_change"] for name in ("row1", "row2", "row3")] == [0.25, 0.5, 0.0]
    again = view_from_json(json.loads(json.dumps(view.to_json())))
    assert again.schema == view.schema
    with pytest.raises(ConfigError, match="nope"):
        birds(changes=("nope",))


def test_offsets_are_asked_for_in_the_schema() -> None:
    assert not birds().schema.offsets
    view = birds(offsets=True)
    assert view.schema.offsets
    assert view_from_json(json.loads(json.dumps(view.to_json()))).schema.offsets
