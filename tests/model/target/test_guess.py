"""Best guesses: what stands in for what isn't explained, and never for what is."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from points import formulas, learned, schema_of, transitions

from relgym.config.constants import RECENT
from relgym.model.learning.fitting import compare_and_learn
from relgym.model.predicting.prediction import Outcome
from relgym.model.target.guess import Guesses, _terms
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene, Target, Transition

SCHEMA = schema_of(("x", "v"), ("a",))
V = Target("self", "v")
OFFERED = ("trig(x)",)


def drivers(n: int, seed: int = 0) -> list[Transition]:
    """Half of what changes v is as the action says, the other half as somebody nobody sees likes."""
    rng = np.random.default_rng(seed)
    whims = rng.normal(size=n).tolist()
    return transitions(
        SCHEMA,
        lambda s, u: [s[0] + s[1], s[1] + u[0] + whims.pop()],
        rng.normal(size=(n, 2)),
        rng.normal(size=(n, 1)),
    )


def strollers(n: int) -> list[Transition]:
    """v changes as it likes."""
    rng = np.random.default_rng(0)
    whims = rng.normal(size=n).tolist()
    return transitions(
        SCHEMA, lambda s, u: [s[0], s[1] + whims.pop()], rng.normal(size=(n, 2)), rng.normal(size=(n, 1))
    )


@pytest.fixture(scope="module")
def model() -> WorldModel:
    return learned(SCHEMA, drivers(400), features=OFFERED)


def regressed(model: WorldModel, scene: Scene) -> float:
    """The change of v that regressions say, all together."""
    parts = model._parts
    changes = parts.regressed(parts.perception.percept(scene.layout, scene.vector[None]), 0, "v")
    assert changes is not None
    return float(changes[0])


def off(model: WorldModel, steps: list[Transition]) -> float:
    said = [model.predict_one(t.before)["self", "v"].value for t in steps]
    return float(np.std([v - t.after["self"]["v"] for v, t in zip(said, steps, strict=True)]))


def test_what_is_not_explained_is_guessed_and_said_not_to_be(model: WorldModel) -> None:
    fresh = drivers(200, seed=1)
    one = model.predict_one(fresh[0].before)["self", "v"]
    assert one.outcome is Outcome.UNEXPLAINED
    assert one.informed and not one.ok
    assert one.spread == pytest.approx(1.0, rel=0.15)
    assert off(model, fresh) == pytest.approx(1.0, rel=0.2)
    guess = model.property_model("self", "v").fallback.guess
    assert guess is not None
    weights = dict(guess.mode.roles[0].terms)
    assert weights["v"] == pytest.approx(1.0, abs=0.2)
    assert guess.left == pytest.approx(np.sqrt(0.5), rel=0.2)  # half of the variance is a whim
    assert guess.text(2).startswith("best guess, no law: v' = ")


def test_without_features_regressions_speak() -> None:
    """Of a model that nobody told how its predictions came out, too."""
    model, fresh = learned(SCHEMA, drivers(400)), drivers(200, seed=1)
    part = model.property_model("self", "v")
    assert part.fallback.lawless and not part.fallback.guessable and part.fallback.guess is None
    one = model.predict_one(fresh[0].before)["self", "v"]
    assert one.outcome is Outcome.UNEXPLAINED and not one.ok
    assert off(model, fresh) == pytest.approx(1.0, rel=0.2)
    scenes = [t.before for t in fresh]
    batch = model.predict_batch(scenes[0].layout, np.stack([s.vector for s in scenes]))
    for k, scene in enumerate(scenes):
        assert model.predict_one(scene).scene.vector.tobytes() == batch.vectors[k].tobytes()


def test_what_is_explained_is_not_guessed(model: WorldModel) -> None:
    assert formulas(model, "x") == ["x' = x + v"]
    assert model.property_model("self", "x").fallback.guess is None


def test_a_guess_that_is_no_better_than_no_change_is_none() -> None:
    model = learned(SCHEMA, strollers(200), features=OFFERED)
    one = model.predict_one(strollers(1)[0].before)["self", "v"]
    assert model.property_model("self", "v").fallback.guess is None
    assert not one.informed
    kept = strollers(1)[0].before
    assert one.value == pytest.approx(kept["self"]["v"] + regressed(model, kept))
    assert abs(regressed(model, kept)) < 0.1  # of noise of 1


@pytest.mark.parametrize("seed", range(5))
def test_a_few_large_changes_make_no_guess(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(100, 8))
    change = np.where(np.arange(100) % 10 == 0, 5.0 * rng.normal(size=100), 0.0)
    assert _terms(x, change) == (None, 1.0)


def test_of_nearly_as_good_guesses_the_shortest() -> None:
    rng = np.random.default_rng(1)
    x = rng.normal(size=(400, 8))
    assert _terms(x, 300.0 + rng.normal(size=400))[0] == 0  # what changes in the mean
    terms, left = _terms(x, x[:, 0] - x[:, 1] + rng.normal(size=400))
    assert terms == 2
    assert left == pytest.approx(np.sqrt(1.0 / 3.0), rel=0.1)


def test_guesses_come_alone_and_in_batches_with_the_same_bits(model: WorldModel) -> None:
    scenes = [t.before for t in drivers(20, seed=2)]
    batch = model.predict_batch(scenes[0].layout, np.stack([s.vector for s in scenes]))
    for k, scene in enumerate(scenes):
        assert model.predict_one(scene).scene.vector.tobytes() == batch.vectors[k].tobytes()


def test_what_depends_on_a_guess_follows_from_it() -> None:
    rng = np.random.default_rng(0)

    def moved(s: list[float], u: list[float]) -> list[float]:
        v = s[1] + u[0] + rng.normal()
        return [s[0] + v, v]

    steps = transitions(SCHEMA, moved, rng.normal(size=(420, 2)), rng.normal(size=(420, 1)))
    model = learned(SCHEMA, steps[:400], features=OFFERED)
    assert formulas(model, "x") == ["x' = x + v'"]
    scenes = [t.before for t in steps[400:]]
    batch = model.predict_batch(scenes[0].layout, np.stack([s.vector for s in scenes]))
    for k, scene in enumerate(scenes):
        said = model.predict_one(scene)
        x, v = said["self", "x"], said["self", "v"]
        assert (x.outcome, v.outcome) == (Outcome.DEPENDS, Outcome.UNEXPLAINED)
        assert v.informed and v.value != scene["self"]["v"]
        assert x.value == pytest.approx(scene["self"]["x"] + v.value, abs=1e-9)
        assert said.scene.vector.tobytes() == batch.vectors[k].tobytes()
    assert not batch.ok.any()


def test_a_guess_takes_no_place_of_modes_that_other_laws_read(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)

    def moved(s: list[float], u: list[float]) -> list[float]:
        v = s[1] + u[0] + 0.01 * rng.normal()
        return [s[0] + v, v]

    steps = transitions(SCHEMA, moved, rng.normal(size=(401, 2)), rng.normal(size=(401, 1)))
    model = learned(SCHEMA, steps[:400], features=OFFERED)
    assert formulas(model, "x") == ["x' = x + v'"]
    part, scene = model.property_model("self", "v"), steps[400].before
    part.fallback.guesses.errors[:] = [[1.0, 1.0], [0.5, 0.5]]
    assert part.fallback.guesses.superior
    assert part.leaned_on and not model.property_model("self", "x").leaned_on
    assert model.predict_one(scene).ok
    model.save(tmp_path / "model.json")
    assert WorldModel.load(tmp_path / "model.json").predict_one(scene).ok
    part.leaned_on = False
    assert model.predict_one(scene)["self", "v"].outcome is Outcome.UNEXPLAINED


def test_what_depends_on_what_is_kept_follows_from_it() -> None:
    rng = np.random.default_rng(0)
    whims = rng.normal(size=200).tolist()

    def moved(s: list[float], u: list[float]) -> list[float]:
        v = s[1] + whims.pop()
        return [s[0] + v, v]

    steps = transitions(SCHEMA, moved, rng.normal(size=(200, 2)), rng.normal(size=(200, 1)))
    model = learned(SCHEMA, steps, features=OFFERED)
    assert formulas(model, "x") == ["x' = x + v'"]
    assert model.property_model("self", "v").fallback.guess is None
    scene = SCHEMA.scene({"self": [2.0, 3.0], "action": [0.0]})
    said = model.predict_one(scene)
    assert said["self", "x"].outcome is Outcome.DEPENDS
    v = 3.0 + regressed(model, scene)
    assert said.scene["self"].values.tolist() == pytest.approx([2.0 + v, v])
    assert v == pytest.approx(
        3.0, abs=0.5
    )  # of noise of 1 regressions make little, this far from what was seen
    batch = model.predict_batch(scene.layout, scene.vector[None])
    assert batch.vectors[0].tobytes() == said.scene.vector.tobytes()


def test_a_loaded_model_guesses_the_same(model: WorldModel, tmp_path: Path) -> None:
    model.save(tmp_path / "model.json")
    again, scene = WorldModel.load(tmp_path / "model.json"), drivers(1, seed=3)[0].before
    assert again.predict_one(scene).scene.vector.tobytes() == model.predict_one(scene).scene.vector.tobytes()


@pytest.mark.parametrize(
    ("usual", "rare", "own", "better"),
    [
        (0.5, 0.5, 0.3, True),
        (0.3, 0.3, 0.5, False),
        (0.3, 5.0, 0.35, True),  # hardly worse as a rule, and never so far off
        (0.01, 5.0, 0.35, False),  # smaller in root mean square, but mostly worse by far
        (0.3, 1.0, 0.37, False),  # somewhat smaller in root mean square, but mostly worse by more
        (0.3, 1.0, 0.33, True),
    ],
)
def test_a_guess_replaces_modes_that_err_more(
    model: WorldModel, usual: float, rare: float, own: float, better: bool
) -> None:
    guesses = Guesses()
    for k in range(1000):
        guesses.compare(rare if k % 20 == 0 else usual, own)
    assert not guesses.superior  # there is none
    guesses.best = model.property_model("self", "v").fallback.guess
    assert guesses.superior is better
    again = Guesses.from_json(V, guesses.to_json())
    assert again.superior is better
    assert again.to_json() == guesses.to_json()


@pytest.mark.parametrize("off", [1e300, math.inf, math.nan])
def test_a_guess_that_leads_anywhere_can_be_held_against_what_comes_later(off: float) -> None:
    guesses = Guesses()
    for own in (off, 1e-3, off):
        guesses.compare(1e-3, own)
    assert np.isfinite(guesses.errors).all() and guesses.errors[1, 0] > 1e280
    assert guesses.errors[0, 0] == pytest.approx(1e-6 * (1.0 - (1.0 - 1.0 / RECENT) ** 3))
    assert not guesses.superior


def test_of_approximations_that_which_held_last_is_not_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two laws, and nothing tells which of them holds: the one that held last may go on, if it is exact."""
    rng = np.random.default_rng(0)
    signs = np.repeat([1.0, -1.0], 20)[np.arange(400) % 40].tolist()
    steps = transitions(
        SCHEMA,
        lambda s, u: [s[0], s[1] + signs.pop() * u[0]],
        rng.normal(size=(400, 2)),
        rng.normal(size=(400, 1)),
    )
    model = WorldModel(SCHEMA)
    for step in steps:
        compare_and_learn(model, step, model.predict_one(step.before))
    part = model.property_model("self", "v")
    assert len(part.modes) == 2 and not part.fallback.inexact
    assert part.asks_latest
    monkeypatch.setattr(part.clusterer.population, "approximate", True)
    assert part.fallback.inexact and not part.asks_latest


def test_which_mode_held_last_is_known_though_most_steps_are_not_learned_from() -> None:
    """What stays 0 or 1 for a while, and in between jumps as it likes: that is known roughly, and left out mostly."""
    rng, came = np.random.default_rng(0), list[float]()
    while len(came) < 1_000:
        calm, length = rng.choice(3, p=[0.2, 0.2, 0.6]), int(rng.integers(5, 25))
        came += rng.normal(size=length).tolist() if calm == 2 else [float(calm)] * length
    steps = transitions(
        SCHEMA, lambda s, u: [s[0], came.pop()], rng.normal(size=(1_000, 2)), rng.normal(size=(1_000, 1))
    )
    model, left_out = WorldModel(SCHEMA), 0
    for step in steps:
        out = compare_and_learn(model, step, model.predict_one(step.before))
        part, v = model.property_model("self", "v"), step.after["self"]["v"]
        if part.asks_latest and v in (0.0, 1.0) and ("self", "v") not in out.learned.parts:
            left_out += 1
            assert formulas(model, "v")[[m.id for m in part.modes].index(part.latest)] == f"v' = {v:g}"
    assert left_out > 50
