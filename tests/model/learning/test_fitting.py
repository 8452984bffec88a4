"""Learning from many transitions at once: the same model, progress, scores, and what is refused."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from relgym.config import ClusteringConfig, ModelConfig
from relgym.errors import ConfigError, DataError, ModelFileError
from relgym.model.predicting.prequential import compared
from relgym.model.world_model import WorldModel
from relgym.scene.objects import ObjectType, Scene, Transition
from relgym.scene.schema import SceneSchema

ALONE = SceneSchema((ObjectType("ball", ("v",)),), (("b", "ball"),))
# The action stands between the others.
PUSHED = SceneSchema(
    (ObjectType("cart", ("x", "v")), ObjectType("action", ("a",))),
    (("left", "cart"), ("action", "action"), ("right", "cart")),
)


def rows(count: int, seed: int = 0) -> tuple[dict[str, Any], Any, dict[str, Any]]:
    rng = np.random.default_rng(seed)
    now = {name: rng.uniform(-3.0, 3.0, (count, 2)) for name in ("left", "right")}
    acts = rng.uniform(-1.0, 1.0, (count, 1))
    later = {}
    for name, cart in now.items():
        v = 0.5 * cart[:, [1]] + acts
        later[name] = np.concatenate([cart[:, [0]] + v, v], axis=1)
    return now, acts, later


def transitions(count: int, seed: int = 0) -> list[Transition]:
    now, acts, later = rows(count, seed)
    return [
        Transition(
            PUSHED.scene({"left": now["left"][k], "action": acts[k], "right": now["right"][k]}),
            PUSHED.scene({name: later[name][k] for name in later}),
        )
        for k in range(count)
    ]


def online(given: list[Transition], model: WorldModel) -> WorldModel:
    """One by one: predict, look back, learn."""
    for transition in given:
        prediction = model.predict_one(transition.before)
        residuals, _ = compared(prediction, transition.after)
        model.look_back(prediction, residuals)
        model.learn_one(transition)
    return model


def file_of(model: WorldModel, folder: Path) -> bytes:
    model.save(folder / "model.relgym", history=True)
    return (folder / "model.relgym").read_bytes()


def test_fitted_is_learned_one_by_one(tmp_path: Path) -> None:
    one_by_one = online(transitions(60), WorldModel(PUSHED))
    now, acts, later = rows(60)
    flat = np.concatenate([now["left"], now["right"]], axis=1)
    models = [
        WorldModel(PUSHED).fit(transitions(60)),
        WorldModel(PUSHED).fit([SimpleNamespace(transition=t) for t in transitions(60)]),
        WorldModel(PUSHED).fit(now, acts, later),
        WorldModel(PUSHED).fit(flat, acts, np.concatenate([later["left"], later["right"]], axis=1)),
        WorldModel(PUSHED).fit(transitions(60)[:25]).fit(transitions(60)[25:]),
    ]
    for model in models:
        assert file_of(model, tmp_path) == file_of(one_by_one, tmp_path)
    assert models[0].modes("cart", "v")[0].formula() == "v' = 0.5 v + action.a"


def test_rows_that_follow_one_another() -> None:
    v = 8.0 * 0.5 ** np.arange(8.0)[:, None]
    model = WorldModel(ALONE)
    assert model.fit(v).seen == 7
    both = np.concatenate([v, v])
    cut = WorldModel(ALONE).fit(both, truncations=np.arange(16) == 7)
    assert cut.seen == 14
    assert cut.modes("ball", "v")[0].formula() == "v' = 0.5 v"
    assert model.score(both, terminations=np.arange(16) == 7).transitions == 14


def test_progress_counts_what_was_predicted_before_it_was_learned() -> None:
    model = WorldModel(PUSHED)
    reports = list(model.progressive(transitions(70), every=30))
    assert [(r.steps, r.score.transitions) for r in reports] == [(30, 30), (60, 30), (70, 10)]
    assert reports[0].score.right < 1.0 == reports[-1].score.right
    assert reports[-1].report.transition == transitions(70)[-1]
    assert model.seen == 70
    with pytest.raises(ConfigError, match="every=0"):
        next(model.progressive(transitions(2), every=0))


def test_scores_learn_nothing(tmp_path: Path) -> None:
    model = WorldModel(PUSHED).fit(transitions(60))
    before = file_of(model, tmp_path)
    score = model.score(*rows(40, seed=1))
    assert (score.right, score.abstained, score.exact) == (1.0, 0.0, 40)
    assert file_of(model, tmp_path) == before


@settings(max_examples=15, deadline=None)
@given(st.integers(1, 30), st.integers(0, 1000))
def test_arrays_and_scenes_say_the_same(count: int, seed: int) -> None:
    now, acts, later = rows(count, seed)
    found = WorldModel(PUSHED)._transitions(now, acts, later, None, None)
    assert found == transitions(count, seed)


def test_what_is_no_config_is_refused_as_by_the_learner() -> None:
    assert WorldModel(ALONE, {"seed": 3, "clustering": {"draws": 500}}).config == ModelConfig(
        ClusteringConfig(draws=500), seed=3
    )
    assert WorldModel(ALONE, config={"features": ["trig"]}).config.features == ("trig",)
    assert WorldModel(ALONE, {"clustering": ClusteringConfig(draws=7)}).config.clustering.draws == 7
    assert WorldModel(ALONE, None).config == ModelConfig()
    with pytest.raises(ConfigError, match="expected a ModelConfig, or a dict of what differs"):
        WorldModel(ALONE, 3)  # type: ignore[arg-type]
    with pytest.raises(
        ConfigError, match=r"ModelConfig: got an unexpected keyword argument 'speed'; see help"
    ):
        WorldModel(ALONE, {"speed": 3})
    with pytest.raises(ConfigError, match="draws must be a whole number"):
        WorldModel(ALONE, {"clustering": {"draws": "many"}})


NOW, ACTS, LATER = rows(5)
BAD: dict[str, tuple[tuple[Any, ...], dict[str, Any], str]] = {
    "a number": ((3,), {}, "expected transitions, got int"),
    "a path": (("data.npz",), {}, "expected transitions, got str.*relgym.fit"),
    "numbers": (([1, 2],), {}, "item 0: expected a Transition .* got int"),
    "nothing": (([],), {}, "no transitions to learn from"),
    "another world": (
        ([Transition(ALONE.scene({"b": [1.0]}), ALONE.scene({"b": [1.0]}))],),
        {},
        "transition 0: ",
    ),
    "lengths": ((NOW, ACTS[:3], LATER), {}, "actions: expected 5 rows"),
    "next lengths": (
        (NOW, ACTS, {n: x[:4] for n, x in LATER.items()}),
        {},
        "next_observations: expected 5 rows",
    ),
    "parts": (({**NOW, "left": NOW["left"][:3]}, ACTS, LATER), {}, "equally many rows of all objects"),
    "objects": (
        ({"left": NOW["left"]}, ACTS, LATER),
        {},
        r"expected an array for each of \['left', 'right'\]",
    ),
    "width": ((np.zeros((5, 3)), ACTS), {}, r"expected shape \(n, 4\) for \['left.x', .*got \(5, 3\)"),
    "no action": ((NOW, None, LATER), {}, "the schema has an action object, and none were given"),
    "dtype": ((np.full((5, 4), "a"), ACTS), {}, "expected an array of numbers, got dtype <U1"),
    "ragged": ((NOW, [[1.0], [1.0, 2.0]] * 2, LATER), {}, "rows of different lengths"),
    "nan": (
        (NOW, np.where(np.arange(5)[:, None] == 3, np.nan, ACTS), LATER),
        {},
        "actions: row 3, action.a: .*nan",
    ),
    "empty": (({n: x[:0] for n, x in NOW.items()}, ACTS[:0]), {}, "no rows; expected at least one"),
    "one row": (({n: x[:1] for n, x in NOW.items()}, ACTS[:1]), {}, "no step to learn from"),
    "flags": ((NOW, ACTS), {"truncations": [True]}, "truncations: expected 5 flags"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_data_leave_the_model_as_it_was(case: str, tmp_path: Path) -> None:
    arguments, options, message = BAD[case]
    model = WorldModel(PUSHED).fit(transitions(20))
    before = file_of(model, tmp_path)
    with pytest.raises(DataError, match=message):
        model.fit(*arguments, **options)
    with pytest.raises(DataError, match=message):
        model.score(*arguments, **options)
    assert file_of(model, tmp_path) == before


def test_one_bad_transition_among_good_ones_teaches_nothing() -> None:
    good = transitions(4)
    bad = Scene(PUSHED, good[0].after.layout, np.array([1.0, np.inf, 0.0, 0.0]))
    model = WorldModel(PUSHED)
    with pytest.raises(DataError, match=r"transition 2: .*'left', property 'v'.*inf"):
        model.fit([*good[:2], Transition(good[2].before, bad), good[3]])
    assert model.seen == 0


def test_actions_that_the_schema_does_not_have() -> None:
    v = np.ones((3, 1))
    with pytest.raises(DataError, match="no action object, and some were given"):
        WorldModel(ALONE).fit(v, v)
    with pytest.raises(DataError, match=r"reshape\(-1, 1\)"):
        WorldModel(ALONE).fit(np.ones(3))


def test_a_model_without_history_can_only_be_scored(tmp_path: Path) -> None:
    WorldModel(PUSHED).fit(transitions(60)).save(tmp_path / "model.relgym")
    model = WorldModel.load(tmp_path / "model.relgym")
    with pytest.raises(ModelFileError, match="without its history"):
        model.fit(transitions(3))
    assert model.score(transitions(9, seed=2)).right == 1.0
