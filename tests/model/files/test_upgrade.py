"""Files of earlier versions are read: what is gone is left out, what came later is filled in."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import pytest
from file_fuzzing import worlds
from hypothesis import given
from hypothesis import strategies as st

from relgym.config import ClassificationConfig, ClusteringConfig, ModelConfig
from relgym.errors import ModelFileError
from relgym.files.records import checked
from relgym.model.files.format import CalibrationRecord
from relgym.model.files.storage import VERSION, read_model, write_model
from relgym.model.files.upgrade import upgraded
from relgym.model.world_model import WorldModel
from relgym.program.records import RATES
from relgym.scene.objects import Transition

FOLDER = Path(__file__).parent
FILES = {
    path.stem: path
    for folder in ("v1", "v2", "v3", "v4", "v5")
    for path in sorted((FOLDER / folder).glob("*.relgym"))
}


def raw(name: str) -> dict[str, Any]:
    """The body of a file without history, as it was written."""
    body: dict[str, Any] = json.loads(FILES[name].read_bytes())["body"]
    return body


@pytest.mark.parametrize("name", FILES)
def test_files_of_earlier_versions_are_read_and_saved_in_the_present_one(name: str, tmp_path: Path) -> None:
    model = WorldModel.load(FILES[name])
    assert model.frozen is not name.endswith("-history")
    assert model.seen > 100
    model.save(tmp_path / "one", history=not model.frozen)
    again = WorldModel.load(tmp_path / "one")
    assert again.describe(details=True) == model.describe(details=True)
    assert again.describe() == model.describe()  # without rules, what is printed are the details
    again.save(tmp_path / "two", history=not model.frozen)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()
    assert f'"version":{VERSION}'.encode() in (tmp_path / "one").read_bytes()


@pytest.fixture(scope="module")
def steps_of() -> dict[str, list[Transition]]:
    return worlds()


@pytest.mark.parametrize("name", [name for name in FILES if name.endswith("-history")])
def test_models_of_earlier_versions_learn_on(name: str, steps_of: dict[str, list[Transition]]) -> None:
    model = WorldModel.load(FILES[name])
    steps = next(steps for world, steps in steps_of.items() if name.startswith(world))
    seen = model.seen
    for step in steps:
        model.learn_one(
            type(step)(*(model.schema.scene(scene.values()) for scene in (step.before, step.after)))
        )
    assert model.seen == seen + len(steps)


def test_retired_settings_are_left_out() -> None:
    body = raw("mountain-car")
    assert body["config"]["classification"]["votes"] == "soft"
    kept = copy.deepcopy(body)
    found = upgraded(body, 1)
    assert body == kept  # what was read isn't changed
    assert "votes" not in found["config"]["classification"]
    assert "review" not in found["config"]["clustering"]
    assert body["config"]["work_per_step"] == 400_000
    assert "work_per_step" not in found["config"]
    assert raw("truck-budgeted")["config"].keys() - upgraded(raw("truck-budgeted"), 5)["config"].keys() == {
        "work_per_step"
    }
    assert ModelConfig.from_json(found["config"]).classification.beam == 4
    assert upgraded(body, VERSION) == body  # the present version is taken as it is


def test_other_rules_than_all_models_have_now_are_told() -> None:
    body = raw("mountain-car")
    body["config"]["classification"]["votes"] = "hard"
    body["config"]["clustering"]["review"] = False
    with pytest.warns(
        UserWarning, match=r"clustering\.review=False, classification\.votes='hard', which relgym"
    ):
        found = upgraded(body, 2)
    assert "votes" not in found["config"]["classification"]


def test_every_setting_that_is_gone_has_gone() -> None:
    from relgym.model.files.upgrade import _RETIRED

    for part, kind in (("clustering", ClusteringConfig), ("classification", ClassificationConfig)):
        assert not _RETIRED[part].keys() & kind.__dataclass_fields__.keys()


def test_settings_that_there_never_were_are_named(tmp_path: Path) -> None:
    for part in ("config", "clustering", "classification"):
        body, _ = read_model(FILES["mountain-car"])
        (body["config"] if part == "config" else body["config"][part])["sticky"] = 1
        write_model(tmp_path / "file", body, None)
        where = r"config\.sticky" if part == "config" else rf"config\.{part}\.sticky"
        with pytest.raises(ModelFileError, match=rf"{where}: relgym has no such setting"):
            WorldModel.load(tmp_path / "file")


def test_calibrations_get_what_came_later() -> None:
    old = {
        "trials": 12,
        "slips": [12.0, 1.0],
        "changes": [[3, 12.0]],
        "cells": [
            {
                "key": [0, -1, 7],
                "speaker": 0,
                "records": [[0, 9.0, 8.0, 3, [[0, 9.0]]], [2, 12.0, 1.0, -1, [[4, 12.0]]]],
                "squares": [[1.0, 2.0, 3.0]] * 6,
            }
        ],
    }
    kept = copy.deepcopy(old)
    found = upgraded({"calibration": {"ball.x": old}}, 2)["calibration"]["ball.x"]
    assert old == kept
    cell = found["cells"][0]
    assert cell["records"][0] == [0, 9.0, 8.0, 3, [[0, 9.0]], [0.0, 0.0, 0.0, 0.0]]
    assert cell["heard"] == 12.0  # whoever was looked back at most often
    assert found["vouched"] == 0.0
    checked(found, CalibrationRecord, "the calibration")


def test_linear_regression_is_part_of_regression_on_everything() -> None:
    """Who spoke in its place does; the others are one place further up."""
    records = [[k, 10.0 + k, 8.0, 3, [[0, 9.0]], [0.0] * 4] for k in (0, 2, 3, 6)]
    squares = [[float(k), 2.0, 3.0] for k in range(7)]
    old = {"cells": [{"speaker": k, "records": records, "squares": squares} for k in (0, 2, 3, 5, 6)]}
    kept = copy.deepcopy(old)
    cells = upgraded({"calibration": {"ball.x": old}}, 4)["calibration"]["ball.x"]["cells"]
    assert old == kept
    assert [cell["speaker"] for cell in cells] == [0, 2, 2, 4, 5]
    for cell in cells:
        assert [(who, trials) for who, trials, *_ in cell["records"]] == [(0, 10.0), (2, 13.0), (5, 16.0)]
        assert [trials for trials, *_ in cell["squares"]] == [0.0, 1.0, 3.0, 4.0, 5.0, 6.0]


def test_words_of_regressions_count_as_they_did() -> None:
    """By b / (b + s q): of 3 and 4 by the rate 3, next to 4; of 4 and 4 not at all; of 0 and 4 always."""
    old = {"targets": ["x", "y", "z"], "left": [[4.0, 4.0, 4.0], [3.0, 4.0, 0.0], [2.0, 4.0, 0.0]]}
    kept = copy.deepcopy(old)
    found = upgraded({"regressions": {"self": old}}, 4)["regressions"]["self"]
    assert old == kept
    assert "left" not in found
    rates = [
        [[rate for rate, says in zip(RATES, say, strict=True) if says] for say in kind]
        for kind in found["say"]
    ]
    assert rates == [[[4.0], [], [0.0]], [[1.0], [], []]]  # 2 / 1 lies next to 1 and to 4
    for left in (
        None,
        [],
        [["?"]],
        [[1.0], [1.0]],
        [[10**400], [1.0], [1.0]],
        {"x": 1.0},
        "left",
        3,
    ):
        unknown = {"targets": ["x"]} | ({} if left is None else {"left": left})
        found = upgraded({"regressions": {"self": unknown}}, 3)["regressions"]["self"]
        assert found["say"] == [[[1.0] + [0.0] * (len(RATES) - 1)]] * 2


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=3),
        lambda inner: (
            st.lists(inner, max_size=4)
            | st.dictionaries(
                st.sampled_from(
                    [
                        "config",
                        "clustering",
                        "votes",
                        "calibration",
                        "cells",
                        "records",
                        "heard",
                        "regressions",
                        "left",
                    ]
                ),
                inner,
            )
        ),
        max_leaves=12,
    )
)
@pytest.mark.filterwarnings("ignore:the model was learned with")
def test_what_is_malformed_is_left_to_be_named(value: Any) -> None:
    body = {"config": value, "calibration": value if isinstance(value, dict) else {"x": value}}
    assert upgraded(body, 2).keys() == body.keys()
