"""Learning is done as a whole or not at all, wherever it fails."""

from __future__ import annotations

import gc
import os
import pickle
import sys
import weakref
from collections.abc import Callable
from contextlib import suppress
from types import FrameType
from typing import Any

import numpy as np
import pytest

from relgym.experiments.rooms import rooms
from relgym.model import world_model
from relgym.model.files.archive import parts_to_arrays
from relgym.model.learning import journal
from relgym.model.target.hindsight import hindsight_to_json
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Transition


class BrokenError(Exception):
    """What is raised where nobody expects it."""


def lessons(seed: int = 0, steps: int = 100) -> list[Transition]:
    rng = np.random.default_rng(seed)
    room = rooms(1, objects=3, elasticity=0.9, friction=0.0, rng=rng, steps=steps)[0]
    return list(room.transitions())


def written(model: WorldModel) -> Any:
    arrays = {name: a.tobytes() for name, a in parts_to_arrays(model._parts).items()}
    return model.to_json(history=True), hindsight_to_json(model._parts), arrays, model.set_aside


def calls_of(
    step: Callable[[], Any], stop_at: int | None = None, error: type[BaseException] = BrokenError
) -> int:
    """Make a step, and raise an error when the so-manieth function is called; how many were."""
    count = 0

    def profile(frame: FrameType, event: str, argument: Any) -> None:
        nonlocal count
        if event in ("call", "c_call", "return", "c_return"):
            count += 1
            if count == stop_at:
                sys.setprofile(None)
                raise error

    def swallowed(lost: sys.UnraisableHookArgs) -> None:
        """Where a generator is thrown away, Python itself ignores what is raised: the step goes on."""
        if not isinstance(lost.exc_value, error):
            usual(lost)

    usual = sys.unraisablehook
    sys.unraisablehook = swallowed
    sys.setprofile(profile)
    try:
        step()
    finally:
        sys.setprofile(None)
        sys.unraisablehook = usual
    return count


def inject_everywhere(model: WorldModel, transition: Transition, most: int) -> int:
    """Fail at up to so many boundaries of calls, evenly spread; how many there are."""
    begin, before = pickle.dumps(model), written(model)
    twin = pickle.loads(begin)
    calls_of(Learn(pickle.loads(begin), transition))  # what is worked out once for all
    count = calls_of(Learn(twin, transition))
    after, done = written(twin), 0
    for k in np.unique(np.linspace(1, count, most).astype(int)).tolist():
        with suppress(BrokenError):  # caches may have made it shorter
            calls_of(Learn(model, transition), k)
        found = written(model)
        assert found in (before, after), f"half changed by an error at boundary {k} of {count}"
        if found == after:  # the error came when all was done
            done += 1
            model = pickle.loads(begin)
    assert done < most // 2
    return count


class Learn:
    """Learning one transition."""

    def __init__(self, model: WorldModel, transition: Transition) -> None:
        self.model, self.transition = model, transition

    def __call__(self) -> Any:
        return self.model.learn_one(self.transition)


@pytest.mark.parametrize("at", [0, 12, 60])
def test_an_error_at_any_boundary_of_a_call_leaves_the_model_as_it_was(at: int) -> None:
    model, steps = WorldModel(lessons()[0].before.schema), lessons()
    for transition in steps[:at]:
        model.look_back(model.predict_one(transition.before), {("ball", "vx"): 0.0})
        model.learn_one(transition)
    assert inject_everywhere(model, steps[at], int(os.environ.get("RELGYM_INJECTIONS", "60"))) > 500


def test_after_a_rollback_learning_goes_on_as_if_nothing_had_been(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(journal, "CHECKPOINT", 16)
    steps = lessons()
    calm, troubled = (WorldModel(steps[0].before.schema) for _ in range(2))
    for k, transition in enumerate(steps):
        calm.learn_one(transition)
        if k % 9 == 4:
            with pytest.raises(KeyboardInterrupt):
                calls_of(Learn(troubled, transition), 300, KeyboardInterrupt)
        troubled.learn_one(transition)
    assert written(calm) == written(troubled)
    assert troubled.finish() == calm.finish()
    assert written(calm) == written(troubled)


def test_an_interrupted_rollback_is_made_up_for(monkeypatch: pytest.MonkeyPatch) -> None:
    steps = lessons()
    model = WorldModel(steps[0].before.schema)
    for transition in steps[:30]:
        model.learn_one(transition)
    known = written(model)
    learn = world_model.learn

    def fails(*given: Any) -> Any:
        learn(*given)
        monkeypatch.setattr(world_model, "learn", interrupted)
        raise BrokenError

    def interrupted(*given: Any) -> Any:
        raise KeyboardInterrupt

    monkeypatch.setattr(world_model, "learn", fails)
    with pytest.raises(KeyboardInterrupt):
        model.learn_one(steps[30])
    monkeypatch.setattr(world_model, "learn", learn)
    assert model.seen == 30
    assert written(model) == known
    assert model.learn_one(steps[30]) is not None


def test_a_copy_begins_a_journal_of_its_own() -> None:
    steps = lessons()
    model = WorldModel(steps[0].before.schema)
    for transition in steps[:20]:
        model.learn_one(transition)
    twin = pickle.loads(pickle.dumps(model))
    assert twin._journal._taken is None
    assert written(twin) == written(model)


def test_a_checkpoint_takes_up_the_room_of_the_last_one() -> None:
    whole = {"history": np.arange(50_000.0), "few": np.arange(3.0), "name": "x"}
    kept = journal.Journal()
    kept.prepare(lambda: whole)
    room = kept._room
    assert 400_000 <= len(room) < 500_000
    whole["history"][0] = 7.0  # type: ignore[index]
    again = kept.replayed(lambda *_: None)
    assert again["history"][0] == 0.0
    again["history"][1] = 9.0
    assert kept.replayed(lambda *_: None)["history"][1] == 1.0
    kept.forget()
    kept.prepare(lambda: whole)
    assert kept._room is room
    found = kept.replayed(lambda *_: None)
    assert found["history"][0] == 7.0 and found["few"].tolist() == [0.0, 1.0, 2.0] and found["name"] == "x"
    whole["name"] = "y" * 100_000
    for name in ("history", "more"):  # smaller and larger than what was there
        whole[name] = np.arange(60_000.0 if name == "more" else 40_000.0)
        kept.forget()
        kept.prepare(lambda: whole)
        found = kept.replayed(lambda *_: None)
        np.testing.assert_array_equal(found[name], whole[name])
        assert found["name"] == whole["name"]
        whole["name"] = "z"
    assert len(kept._room) > len(room)


def test_no_more_steps_are_held_than_before_a_checkpoint() -> None:
    class Step:
        """A step's argument."""

    kept, alive = journal.Journal(), weakref.WeakSet[Step]()

    for number in range(3 * journal.CHECKPOINT):
        kept.prepare(dict)
        alive.add(step := Step())
        kept.add("step", (step,))
        del step
        assert len(alive) <= min(number + 1, journal.CHECKPOINT)
    done: list[str] = []
    kept.replayed(lambda whole, name, given: done.append(name))
    assert len(done) == journal.CHECKPOINT


def test_the_collector_is_as_it_was() -> None:
    kept = journal.Journal()
    for enabled in (False, True):
        (gc.enable if enabled else gc.disable)()
        try:
            kept.forget()
            kept.prepare(lambda: {"what": lambda: 0})  # has no name of its own: it is copied
            assert gc.isenabled() == enabled
        finally:
            gc.enable()
