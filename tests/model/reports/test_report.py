"""What people read of a model: the thesis' tables as text, and why a prediction came about."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relgym.config import ClassificationConfig, ModelConfig
from relgym.experiments.data import truck_episodes
from relgym.model.reports.report import (
    ClauseRow,
    ModelReport,
    ModeRow,
    PairTable,
    RoleRow,
    TargetReport,
    report,
)
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ACTION, ObjectType, Scene, Target, Transition
from relgym.scene.schema import SceneSchema

BALL = ObjectType("ball", ("v",))
SCHEMA = SceneSchema((BALL,), (("b", "ball"),), targets=(Target("ball", "v"),))

_TERSE = ModelConfig(
    classification=ClassificationConfig(max_literals=1, max_clauses=1, clause_tree_threshold=0.0)
)
"""So short definitions leave the rest to trees."""


def halving(steps: int = 12) -> WorldModel:
    """A model of one ball without a body whose velocity halves."""
    model, v = WorldModel(SCHEMA), 8.0
    for _ in range(steps):
        model.learn_one(Transition(SCHEMA.scene({"b": [v]}), SCHEMA.scene({"b": [0.5 * v]})))
        v *= 0.5
    return model


@pytest.fixture(scope="module")
def truck() -> tuple[WorldModel, Scene]:
    """The truck's model after all 48 episodes, and a scene with a stack of two and a single box."""
    model, scene = None, None
    for episode in truck_episodes(seed=0):
        model = model or WorldModel(episode.schema)
        for transition in episode.transitions():
            model.learn_one(transition)
        if episode.configuration["layout"] == 2:
            scene = episode.scene(7)
    assert model is not None and scene is not None
    model.finish()
    return model, scene


def test_a_model_without_targets_says_so() -> None:
    open_schema = SceneSchema((BALL,), (("b", "ball"),))
    model = WorldModel(open_schema)
    assert model.describe() == "No targets yet: nothing changed in 0 transitions."
    assert "no targets yet" in model.explain(open_schema.scene({"b": [1.0]}))


def test_a_target_without_modes_says_so() -> None:
    assert "ball.v: no mode learned yet, 0 examples" in WorldModel(SCHEMA).describe(details=True)


def test_an_empty_model_explains_that_it_kept_the_value() -> None:
    text = WorldModel(SCHEMA).explain(SCHEMA.scene({"b": [1.25]}))
    assert text == (
        "b.v: 1.25 keeps its value: no prediction\n"
        "  outcome   no mode learned yet: learn from more transitions"
    )


def test_one_mode_word_for_word() -> None:
    assert halving().describe(details=True) == (
        "Learned from 12 transitions.\n\n" + "─" * 80 + "\n"
        "ball.v: 1 mode, 12 examples\n\n"
        "  mode  examples  function\n"
        "     0         0  noise\n"
        "     1        12  v' = 0.5 v"
    )


def test_the_only_mode_has_no_runner_up() -> None:
    assert halving().explain(SCHEMA.scene({"b": [3.0]})) == (
        "b.v: 3 -> 1.5\n  rule      v' = 0.5 v  (12 training steps)\n  because   no other rule is known"
    )


def test_records_as_text_word_for_word() -> None:
    pair = PairTable(
        2,
        1,
        (
            ClauseRow("ramp(B) ∧ approaching(A, B)", 295.0, 1.0, ("F1 - F2 <= 0.5 -> yes (295 : 1)",)),
            ClauseRow("else", 15574.0, 26.0),
        ),
    )
    target = TargetReport(
        "ball.vx",
        "ball",
        105,
        (ModeRow(1, 15600, "vx' = vx"), ModeRow(2, 295, "vx' = -0.9 vx")),
        (pair,),
        (RoleRow(2, "box", ("box_a",), "on-top(C, B)"), RoleRow(2, "box", ("box_b", "box_c"), "")),
    )
    assert pair.performance == pytest.approx(15869 / 15896)
    text = str(ModelReport(16000, (target,)))
    body = text.split("─" * 80)[1]
    assert body == (
        "\nball.vx: 2 modes, 16,000 examples\n\n"
        "  mode  examples  function\n"
        "     0       105  noise: no mode explains these 0.66 %\n"
        "     1    15,600  vx' = vx\n"
        "     2       295  vx' = -0.9 vx\n\n"
        "  clauses                        correct  incorrect  tree\n"
        "  mode 2 rather than 1  (training accuracy 0.9983)\n"
        "    ramp(B) ∧ approaching(A, B)      295          1  yes\n"
        "        F1 - F2 <= 0.5 -> yes (295 : 1)\n"
        "    else                          15,574         26  no\n\n"
        "  mode  role          bound to\n"
        "     2  box_a         a box B with on-top(C, B)\n"
        "     2  box_b, box_c  any box\n\n"
    )
    assert "F1 is what mode 1 would predict" in text
    assert "* is any object" not in text


def test_long_lines_are_broken() -> None:
    clause = " ∧ ".join(f"x-greater-than(A, {letter})" for letter in "BCDEFG")
    function = "vx' = vx" + " - 2.5 box_a.friction" * 6
    pair = PairTable(1, 2, (ClauseRow(clause, 1.0, 0.0), ClauseRow("else", 1.0, 0.0)))
    text = str(TargetReport("t.vx", "t", 0, (ModeRow(1, 1, function), ModeRow(2, 1, "vx' = 0")), (pair,), ()))
    assert max(map(len, text.split("\n"))) <= 100
    assert text.count("x-greater-than") == 6 and text.count("box_a.friction") == 6


def test_a_pair_without_examples_is_not_wrong() -> None:
    assert PairTable(1, 2, (ClauseRow("else", 0.0, 0.0),)).performance == 1.0


def test_truck_report_is_table_3_1(truck: tuple[WorldModel, Scene]) -> None:
    velocity = report(truck[0]).targets[0]
    found = {mode.function: mode.examples for mode in velocity.modes}
    force = "vx' = vx + 0.025 action.force"
    assert found == {
        f"{force} - 7.5 box.friction": 480,
        f"{force} - 5 box_a.friction - 2.5 box_b.friction": 960,
        f"{force} - 2.5 box_a.friction - 2.5 box_b.friction - 2.5 box_c.friction": 480,
    }
    assert velocity.noise == 0 and velocity.examples == 1920


def test_truck_clauses_are_perfect_as_in_table_3_2(truck: tuple[WorldModel, Scene]) -> None:
    velocity = report(truck[0]).targets[0]
    assert [pair.performance for pair in velocity.pairs] == [1.0, 1.0, 1.0]
    counts = {mode.mode: mode.examples for mode in velocity.modes}
    for pair in velocity.pairs:
        *clauses, otherwise = pair.rows
        # Not exact: a classifier remembers a sample of its examples, each with a weight.
        assert sum(row.correct for row in clauses) == pytest.approx(counts[pair.mode], rel=0.05)
        assert otherwise.correct == pytest.approx(counts[pair.other], rel=0.05)


def test_truck_roles_as_in_figure_3_8(truck: tuple[WorldModel, Scene]) -> None:
    velocity = report(truck[0]).targets[0]
    by_size = {row.roles: row for row in velocity.roles if row.roles != ("box",)}
    assert set(by_size) == {("box_a",), ("box_b",), ("box_a", "box_b", "box_c")}
    assert by_size["box_a", "box_b", "box_c"].rule == "", "any box can fulfil any role"
    assert by_size["box_a",].rule and by_size["box_b",].rule
    assert all(row.type == "box" for row in velocity.roles), "the action is the only one of its type"


@pytest.mark.parametrize("config", [None, _TERSE], ids=["clauses", "trees"])
def test_choices_are_told_as_relations(config: ModelConfig | None, tmp_path: Path) -> None:
    # Left and right move it, and nothing else does: functions may use the choices, clauses and trees may test them.
    types = (
        ObjectType("cart", ("x", "v")),
        ObjectType(ACTION, ("stay", "left", "right"), flags=("stay", "left", "right")),
    )
    schema = SceneSchema(types, tuple((t.name, t.name) for t in types), targets=(Target("cart", "v"),))
    model, rng = WorldModel(schema, config), np.random.default_rng(0)
    for _ in range(150):
        v, choice = float(rng.normal()), int(rng.integers(3))
        act = np.eye(3)[choice].tolist()
        following = (v, 0.5 * v + 1.0, -2.0 * v)[choice]
        before, after = ({"cart": [0.0, w], ACTION: act} for w in (v, following))
        model.learn_one(Transition(schema.scene(before), schema.scene(after)))
    model.finish()
    text = model.describe(details=True)
    assert "action.stay" in text or "action.left" in text or "action.right" in text
    told = [text]
    told += [model.explain(schema.scene({"cart": [0.0, 1.0], ACTION: act})) for act in np.eye(3).tolist()]
    assert any("action." in each for each in told[1:])
    told.append(model.describe())
    assert not any("> 0.5" in each or "<= 0.5" in each for each in told)
    model.save(tmp_path / "cart.relgym")
    assert WorldModel.load(tmp_path / "cart.relgym").describe(details=True) == text


def test_saving_changes_no_word(truck: tuple[WorldModel, Scene], tmp_path: Path) -> None:
    model, scene = truck
    model.save(tmp_path / "truck.json")
    loaded = WorldModel.load(tmp_path / "truck.json")
    assert loaded.describe(details=True, digits=12) == model.describe(details=True, digits=12)
    assert loaded.describe(digits=12) == model.describe(digits=12)
    assert loaded.explain(scene) == model.explain(scene)


def test_describing_and_explaining_change_nothing(truck: tuple[WorldModel, Scene]) -> None:
    model, scene = truck
    before = model.to_json()
    model.describe(details=True)
    model.describe()
    model.explain(scene)
    assert model.to_json() == before
