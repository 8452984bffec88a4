"""Hypothesis classes from outside: registered, scored, believed where they are right, and nowhere else."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis_worlds import PERIODIC, SATURATING, fitted, motor, registered, slider, tide
from numpy.typing import NDArray

import relgym
from relgym import hypotheses
from relgym.errors import ConfigError, ModelFileError
from relgym.hypotheses import Examples, code_length, register_hypothesis
from relgym.model.world_model import WorldModel

BOTH = registered()


@dataclass(frozen=True)
class Table:
    """What followed the nearest of the rows that were seen: a regressor."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]

    @property
    def parameters(self) -> int:
        return 1

    def predict(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        far = np.abs(x[:, None, :] - self.x).sum(axis=2)
        found: NDArray[np.float64] = self.y[far.argmin(axis=1)]
        return found

    def text(self) -> str:
        return f"a table of {len(self.y)} rows"

    def to_json(self) -> dict[str, Any]:
        return {"x": self.x.tolist(), "y": self.y.tolist()}


class Tables:
    """Any regressor is a hypothesis class: this one remembers."""

    name = "table"

    def propose(self, examples: Examples) -> Table:
        _, first = np.unique(examples.x, axis=0, return_index=True)
        return Table(examples.x[first], examples.y[first])

    def from_json(self, data: Mapping[str, Any]) -> Table:
        return Table(np.array(data["x"]), np.array(data["y"]))


def test_code_length_by_hand() -> None:
    # 1 + 2 log2(1 + k) of k = 0, 3, too much, and a number stated as it is.
    assert code_length(np.array([0.0, 3.0, -1e300, math.nan]), 1.0) == 1.0 + 5.0 + 64.0 + 64.0
    assert code_length(np.zeros(8), 1.0, parameters=4) == 8.0 + 0.5 * 4 * 3.0


@pytest.mark.parametrize("period", [4.3, 17.3, 61.0])
def test_a_period_that_nobody_knows(period: float) -> None:
    without = relgym.score(fitted(tide(0, 300, period)), tide(1, 100, period)).targets["self.x0"]
    model = fitted(tide(0, 300, period), PERIODIC.name)
    found = relgym.score(model, tide(1, 100, period)).targets["self.x0"]
    assert found.right == 1.0 and found.rmse < 1e-9 < 0.1 < without.rmse
    law = model.property_model("self", "x0").candidates.laws[0]
    assert getattr(law, "speed", math.nan) == pytest.approx(2.0 * math.pi / period)


@pytest.mark.parametrize("noise", [0.003, 0.01])
def test_a_law_that_saturates_is_seen_through_noise(noise: float) -> None:
    without = relgym.score(fitted(motor(0, 600, noise)), motor(1, 200, noise)).targets["self.x"]
    found = relgym.score(fitted(motor(0, 600, noise), *BOTH), motor(1, 200, noise)).targets["self.x"]
    assert found.rmse < 1.15 * noise < 3.0 * noise < without.rmse


def test_where_others_are_as_good_nothing_changes() -> None:
    for data, fresh in ((slider(0), slider(1)), (slider(0, 300, 0.02), slider(1, 300, 0.02))):
        plain, asked = fitted(data), fitted(data, *BOTH)
        for k, (one, other) in enumerate(
            zip(_predicted(plain, fresh), _predicted(asked, fresh), strict=True)
        ):
            assert one == other, f"step {k}"


def test_claims_are_right() -> None:
    model = fitted(tide(0), *BOTH)
    claimed = [p for parts in _predicted(model, tide(1)) for p in parts if p[1] == "x0"]
    assert all(ok for *_, ok in claimed)
    assert model.property_model("self", "x0").explained_by == 0
    assert not model.property_model("self", "x0").unexplained and not model.advice()


def test_text_says_which_law_it_is() -> None:
    model = fitted(motor(0), *BOTH)
    assert "a hypothesis tells, saturating: clip(0.79" in model.describe()
    scene = _first(model, motor(1))
    assert "laws      saturating: clip(" in model.explain(scene)


def test_batches_agree_with_single_scenes_to_the_bit() -> None:
    model = fitted(tide(0), *BOTH)
    scenes = [t.before for t in _transitions(model, tide(1))]
    batch = model.predict_batch(scenes[0].layout, np.stack([s.vector for s in scenes]))
    singly = np.stack([model.predict_one(s).scene.vector for s in scenes])
    assert batch.vectors.tobytes() == singly.tobytes()


def test_the_same_seed_gives_the_same_file(tmp_path: Path) -> None:
    files = [tmp_path / "one.json", tmp_path / "two.json"]
    for file in files:
        fitted(tide(0), *BOTH).save(file)
    assert files[0].read_bytes() == files[1].read_bytes()


@pytest.mark.parametrize("history", [False, True])
def test_files_hold_laws_and_name_their_class(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, history: bool
) -> None:
    model = fitted(tide(0), *BOTH)
    model.save(tmp_path / "model.relgym", history=history)
    assert _predicted(WorldModel.load(tmp_path / "model.relgym"), tide(1)) == _predicted(model, tide(1))
    monkeypatch.delitem(hypotheses._classes, PERIODIC.name)
    with pytest.raises(ModelFileError, match="no class 'periodic' is registered in this process"):
        WorldModel.load(tmp_path / "model.relgym")


def test_a_class_that_cant_read_its_law_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fitted(tide(0), PERIODIC.name).save(tmp_path / "model.json")
    other = Tables()
    other.name = PERIODIC.name
    monkeypatch.setitem(hypotheses._classes, PERIODIC.name, other)
    with pytest.raises(ModelFileError, match="'periodic' can't read its law from the file"):
        WorldModel.load(tmp_path / "model.json")


def test_a_model_that_asks_nobody_says_nothing_of_hypotheses() -> None:
    data = fitted(slider(0, 50)).to_json()
    assert "hypotheses" not in data["config"] and "candidates" not in data["targets"][0]["model"]


def test_a_search_waits_for_its_budget() -> None:
    model = fitted(tide(0), PERIODIC.name, cells_per_step=200_000, most_cells=200_000, saved_cells=0)
    assert relgym.score(model, tide(1, 50)).targets["self.x0"].right == 1.0


def test_a_regressor_is_a_hypothesis_class() -> None:
    register_hypothesis(Tables())
    rng = np.random.default_rng(0)
    book, x = rng.permutation(12), np.zeros((401, 1))
    for t in range(400):
        x[t + 1] = book[int(x[t, 0])] if t % 12 else rng.integers(12)
    u = np.zeros((400, 1))
    data = relgym.Dataset.from_arrays(x[:-1], u, x[1:])
    part = fitted(data, "table").property_model("self", "x")
    assert part.candidates.laws[0] is not None


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        (object(), "is no hypothesis class"),
        (type("Bad", (Tables,), {"name": "a b"})(), "expected an identifier"),
    ],
)
def test_what_is_no_class_is_refused(kind: Any, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        register_hypothesis(kind)


@pytest.mark.parametrize(
    ("given", "said"),
    [(("nobody",), "no class 'nobody'"), ("periodic", "a tuple of registered"), (BOTH[:1] * 2, "twice")],
)
def test_config_names_what_is_wrong(given: Any, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        relgym.fit(slider(0, 10), config={"hypotheses": given})


def test_a_law_of_the_wrong_shape_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(type(SATURATING), "propose", lambda self, examples: Table(examples.x, examples.x))
    with pytest.raises(ConfigError, match=r"a law of 'saturating' gives shape \(\d+, \d\) for \d+ rows"):
        fitted(motor(0, 80), SATURATING.name)


def _transitions(model: WorldModel, data: relgym.Dataset) -> list[Any]:
    from relgym.data.learner import _transitions, _view_of  # what `score` uses

    return list(_transitions(_view_of(model, data, None), data, model, "raise"))


def _first(model: WorldModel, data: relgym.Dataset) -> Any:
    return _transitions(model, data)[0].before


def _predicted(model: WorldModel, data: relgym.Dataset) -> list[list[tuple[str, str, float, str, bool]]]:
    told = [model.predict_one(t.before).parts for t in _transitions(model, data)]
    return [[(p.object, p.property, p.value, p.outcome.name, p.ok) for p in parts] for parts in told]
