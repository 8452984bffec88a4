from __future__ import annotations

import numpy as np
import pytest

from relgym.errors import ConfigError
from relgym.logic.clause import ANY, Literal
from relgym.logic.facts import Facts, facts_from_tuples

EXISTS = np.array([[True, True, False]])


def test_symbols_become_numbers() -> None:
    worlds = [{"parent": [("ann", "bob")]}, {"parent": [("eve", "dan"), ("dan", "kim")]}]
    ages = [{"age": {("ann",): 70.0}}, {"age": {("kim",): 3.0}}]
    facts, numbers = facts_from_tuples(worlds, [["ann", "bob"], ["dan", "eve", "kim"]], ages)
    assert facts.exists.tolist() == [[True, True, False], [True, True, True]]
    assert np.argwhere(facts.relations["parent"]).tolist() == [[0, 0, 1], [1, 0, 2], [1, 1, 0]]
    assert facts.numeric["age"][1, numbers[1]["kim"]] == 3.0
    assert np.isnan(facts.numeric["age"][0, numbers[0]["bob"]])


def test_unknown_symbols_and_mixed_lengths_are_refused() -> None:
    with pytest.raises(ConfigError, match="'bob' is not among"):
        facts_from_tuples([{"parent": [("ann", "bob")]}], [["ann"]])
    with pytest.raises(ConfigError, match="tuples of one length"):
        facts_from_tuples([{"parent": [("ann",), ("ann", "ann")]}], [["ann"]])
    with pytest.raises(ConfigError, match="objects of 1 worlds"):
        facts_from_tuples([{}], [])
    with pytest.raises(ConfigError, match="numbers of 1 worlds, got 2 lists"):
        facts_from_tuples([{}], [["ann"]], [{}, {}])
    with pytest.raises(ConfigError, match=r"every object of a world once, got \['ann', 'ann'\]"):
        facts_from_tuples([{}], [["ann", "ann"]])


def test_arrays_of_other_shapes_or_types_are_refused() -> None:
    with pytest.raises(
        ConfigError, match=r"red: expected bool of shape \(1, 3\), got bool of shape \(1, 2\)"
    ):
        Facts({"red": np.zeros((1, 2), dtype=np.bool_)}, EXISTS)
    with pytest.raises(ConfigError, match="speed: expected float64"):
        Facts({}, EXISTS, {"speed": np.zeros((1, 3), dtype=np.float32)})  # type: ignore[dict-item]
    with pytest.raises(ConfigError, match="exists: expected booleans"):
        Facts({}, np.zeros(3, dtype=np.bool_))
    with pytest.raises(ConfigError, match="both a relation and"):
        Facts({"red": EXISTS}, EXISTS, {"red": np.zeros((1, 3))})


def test_relations_hold_for_existing_objects_only() -> None:
    facts = Facts({"near": np.ones((1, 3, 3), dtype=np.bool_)}, EXISTS)
    assert facts.relation("near").sum() == 4
    assert not facts.all_exist
    assert facts.truth(Literal("near", (0, ANY), True)).tolist() == [[True, True, False]]


def test_undefined_values_satisfy_neither_side() -> None:
    facts = Facts({}, EXISTS, {"speed": np.array([[np.nan, 1.0, -1.0]])})
    assert facts.truth(Literal("speed", (0,), op="<=", threshold=1.0)).tolist() == [[False, True, False]]
    assert facts.truth(Literal("speed", (0,), op=">", threshold=-9.0)).tolist() == [[False, True, False]]


def test_relative_names_have_the_target_as_an_unstored_first_argument() -> None:
    facts = Facts(
        {}, EXISTS, {"approach": np.zeros((1, 3)), "vx": np.zeros(1)}, frozenset({"approach", "vx"})
    )
    assert (facts.arity("approach"), facts.arity("vx")) == (2, 1)
    facts.require(Literal("approach", (0, 1), op=">"))
    with pytest.raises(ConfigError, match="always the target"):
        facts.require(Literal("approach", (1, 2), op=">"))
    with pytest.raises(ConfigError, match="expected 2 arguments"):
        facts.require(Literal("approach", (0,), op=">"))
    with pytest.raises(ConfigError, match="one of the relations"):
        facts.require(Literal("approach", (0, 1)))


def test_other_functions_share_the_relations() -> None:
    facts = Facts({"red": EXISTS}, EXISTS)
    masked = facts.relation("red")
    view = facts.with_numeric({"vx": np.zeros(1)}, frozenset({"vx"}))
    assert view.relation("red") is masked
    assert view.arity("vx") == 1
    assert facts.numeric == {}
