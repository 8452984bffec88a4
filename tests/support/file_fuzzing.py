"""Whether what is accepted of changed files works: each is loaded, and asked for all that a model does."""

from __future__ import annotations

import contextlib
import json
import random
import signal
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from file_mutations import Arrays, Mutator
from numpy.typing import NDArray

from relgym.envs.dreams.env import LearnedModelEnv
from relgym.errors import RelgymError
from relgym.files.reading import ARCHIVE, read_members
from relgym.model.files.storage import read_model, write_model
from relgym.model.files.upgrade import upgraded
from relgym.model.running.compiled import KERNEL
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene, Transition
from relgym.wrappers import ModelLearner
from relgym.wrappers.dyna.reward_models import LearnedRewardModel

__all__ = ["EARLIER", "Finding", "Fuzzer", "Tally", "spied", "worlds"]

_FILES = Path(__file__).parent.parent / "model" / "files"
EARLIER = _FILES / "v1", _FILES / "v2"
"""Files of earlier versions, of four worlds."""
SMALL = Path(__file__).parent.parent / "fuzz" / "corpus"
"""Files of small worlds (`tests/fuzz/make_corpus.py`), with some steps of each beside them."""
STEPS = 20
HANG = 5.0
"""Seconds of processor time: the machine may be busy."""


class Hang(BaseException):
    """Raised by the alarm, through whatever runs."""


@dataclass
class Finding:
    """A file that broke something."""

    seed: str
    number: int
    stage: str
    trace: str


@dataclass
class Tally:
    """What came of some files."""

    files: int = 0
    accepted: int = 0
    typed_later: Counter[str] = field(default_factory=Counter)
    findings: list[Finding] = field(default_factory=list)
    slowest: float = 0.0


def worlds() -> dict[str, list[Transition]]:
    """Some real steps of each world of the corpus, by the beginning of its files' names."""
    ball = {"incline": 30, "elasticity": 0.9, "friction": 0.0}
    told = {"learn_reward": True, "learn_termination": True}
    return {
        "ball": _steps(gym.make("relgym/BallBoxRamp-v0", **ball)),
        "truck": _steps(gym.make("relgym/TruckPush-v0")),
        "cart-pole": _steps(gym.make("CartPole-v1"), **told),
        "mountain-car": _steps(gym.make("MountainCar-v0")),
    }


@contextlib.contextmanager
def spied() -> Iterator[list[Transition]]:
    """The transitions that models learn from meanwhile."""
    seen: list[Transition] = []
    learn = WorldModel._learn

    def spying(model: WorldModel, transition: Transition, *told: Any) -> Any:
        seen.append(transition)
        return learn(model, transition, *told)

    WorldModel._learn = spying  # type: ignore[method-assign]
    try:
        yield seen
    finally:
        WorldModel._learn = learn  # type: ignore[method-assign]


def _steps(env: gym.Env[Any, Any], **options: Any) -> list[Transition]:
    with spied() as seen:
        learner = ModelLearner(env, **options)
        learner.action_space.seed(1)
        learner.reset(seed=1)
        while len(seen) < 40:
            *_, terminated, truncated, _ = learner.step(learner.action_space.sample())
            if terminated or truncated:
                learner.reset()
    return seen


def _compile(path: Path, steps: dict[str, list[Transition]]) -> None:
    """Have the kernel that runs models, which takes longer to compile than any case may."""
    KERNEL.load()
    model, scene = WorldModel.load(path), steps[path.stem][0].before
    for _ in range(3):
        model.predict_one(scene)
        model.predict_batch(scene.layout, scene.vector[None])


class Fuzzer:
    """Changes the files of the corpus, and uses what is accepted.

    Parameters
    ----------
    folder
        Where files are written.
    seed
        Seed of everything random: case k is the same whenever it is drawn.
    """

    def __init__(self, folder: Path, seed: int = 0) -> None:
        self.folder, self.seed = folder, seed
        self.steps = worlds() | {path.stem: _kept(path) for path in sorted(SMALL.glob("*.npz"))}
        paths = [path for corpus in (*EARLIER, SMALL) for path in sorted(corpus.glob("*.relgym"))]
        self.files: dict[str, tuple[dict[str, Any], Arrays | None]] = {}
        self.versions: dict[str, int] = {}
        for path in paths:
            self.versions[path.stem], body, arrays = _content(path)
            self.files[path.stem] = body, arrays
        self._mutators: dict[str, Mutator] = {}
        _compile(next(path for path in paths if path.stem in self.steps), self.steps)

    def case(self, number: int) -> tuple[str, dict[str, Any], Arrays | None]:
        """The name of the file that was changed, and what became of it."""
        rng = random.Random(f"{self.seed}:{number}")
        name = rng.choice(sorted(self.files))
        if name not in self._mutators:
            self._mutators[name] = Mutator(*self.files[name], rng)
        mutator = self._mutators[name]
        mutator.rng = rng
        return name, *mutator.draw()

    def run(self, numbers: Sequence[int] | range, until: float = float("inf")) -> Tally:
        """Try some cases, until a time of `time.monotonic`."""
        tally = Tally()
        for number in numbers:
            if time.monotonic() > until:
                break
            self.one(number, tally)
        return tally

    def use(self, name: str, body: dict[str, Any], arrays: Arrays | None) -> Tally:
        """Try a file that wasn't drawn."""
        tally = Tally()
        self._try(0, name, body, arrays, tally)
        return tally

    def one(self, number: int, tally: Tally) -> None:
        """Try one case."""
        self._try(number, *self.case(number), tally)

    def _try(self, number: int, name: str, body: dict[str, Any], given: Arrays | None, tally: Tally) -> None:
        arrays: Mapping[str, NDArray[Any]] | None = given
        path = self.folder / "case.relgym"
        stage = ["write"]
        began = time.process_time()
        tally.files += 1
        try:
            with _alarm(HANG), warnings.catch_warnings():
                warnings.simplefilter("ignore")  # numbers may overflow
                body = upgraded(body, self.versions[name])
                if number % 8 == 0:  # the container is dear, and much the same whatever it holds
                    try:
                        write_model(path, body, arrays)
                    except RelgymError:  # surrogates, nesting
                        return
                    stage[0] = "load"
                    body, arrays = read_model(path)
                stage[0] = "load"
                self._use(WorldModel._restored(body, arrays), path, name, stage, tally)
        except RelgymError as error:
            # What a model writes, it reads; but for counters that a file had at their limit of 2^53.
            if stage[0] == "load again" and f"<= {2**53} " not in str(error):
                tally.findings.append(Finding(name, number, stage[0], traceback.format_exc(limit=-6)))
            elif stage[0] != "load":
                tally.typed_later[f"{stage[0]}: {type(error).__name__}"] += 1
        except (Exception, Hang):
            tally.findings.append(Finding(name, number, stage[0], traceback.format_exc(limit=-6)))
        tally.slowest = max(tally.slowest, time.process_time() - began)

    def _use(self, model: WorldModel, path: Path, name: str, stage: list[str], tally: Tally) -> None:
        tally.accepted += 1
        world = next(key for key in self.steps if name.startswith(key))
        steps = [_in(model, step) for step in self.steps[world]]
        stage[0] = "predict"
        for step in steps[:3]:
            model.predict_one(step.before)
        before = steps[0].before
        model.predict_batch(
            before.layout, np.stack([s.before.vector for s in steps if _same(s.before, before)])
        )
        stage[0] = "describe"
        assert model.describe(details=True)
        assert model.describe()
        model.advice()
        stage[0] = "explain"
        assert model.explain(steps[0].before)
        stage[0] = "dream"
        self._dream(model, tally)
        if not model.frozen:
            stage[0] = "learn"
            for step in steps[:STEPS]:
                model.learn_one(step)
            model.predict_one(steps[-1].before)
        stage[0] = "save"
        model.save(path, history=not model.frozen)
        stage[0] = "load again"
        WorldModel.load(path)
        if "learned_task" in model.extra:
            self._pay(path, stage, tally)

    def _pay(self, path: Path, stage: list[str], tally: Tally) -> None:
        """What reward models do: say what steps are worth, learn on, save again."""
        stage[0] = "load reward model"
        try:
            model = LearnedRewardModel.load(path)
        except RelgymError as error:  # what stands beside a model isn't its own
            tally.typed_later[f"reward model: {type(error).__name__}"] += 1
            return
        layout = model.schema.layout()
        steps = [
            Transition(*(Scene(model.schema, layout, scene.vector) for scene in (step.before, step.after)))
            for step in self.steps["puck"]
        ]
        before, after = (np.stack([getattr(s, side).vector for s in steps]) for side in ("before", "after"))
        stage[0] = "evaluate"
        model.evaluate(layout, before, np.zeros((len(steps), 1)), after)
        stage[0] = "learn rewards"
        for step in steps[:STEPS]:
            model.learn_step(step, 1.0, terminated=False)
        stage[0] = "save reward model"
        model.save(path)
        LearnedRewardModel.load(path)

    @staticmethod
    def _dream(model: WorldModel, tally: Tally) -> None:
        try:
            env = LearnedModelEnv(model)
            env.action_space.seed(0)
            env.reset(seed=0)
            for _ in range(STEPS):
                *_, terminated, truncated, _ = env.step(env.action_space.sample())
                if terminated or truncated:
                    env.reset()
        except RelgymError as error:  # what the file says of the env isn't the model's
            tally.typed_later[f"dream: {type(error).__name__}"] += 1


def _content(path: Path) -> tuple[int, dict[str, Any], Arrays | None]:
    """The version of a file, its body as that version has it, and its history."""
    data, (_, stored) = path.read_bytes(), read_model(path)
    if data[:2] == ARCHIVE:
        data = read_members(data, ("model.json", "history.npz"))["model.json"]
    whole = json.loads(data)
    return whole["version"], whole["body"], None if stored is None else dict(stored)


def _kept(path: Path) -> list[Transition]:
    """Steps of a small world, as scenes of its file's schema."""
    schema = WorldModel.load(path.with_suffix(".relgym")).schema
    with np.load(path) as arrays:
        names = json.loads(arrays["names"].tobytes()) if "names" in arrays else {}
        layouts = [schema.layout(names.get(side)) for side in ("before", "after")]
        pairs = zip(arrays["before"], arrays["after"], strict=True)
        return [
            Transition(*(Scene(schema, layout, v.copy()) for layout, v in zip(layouts, pair, strict=True)))
            for pair in pairs
        ]


def _same(one: Scene, other: Scene) -> bool:
    return one.layout.names == other.layout.names


def _in(model: WorldModel, step: Transition) -> Transition:
    """A step as one of the model's schema."""
    return Transition(*(_as(model, scene) for scene in (step.before, step.after)))


def _as(model: WorldModel, scene: Scene) -> Scene:
    values = scene.values()
    return model.schema.scene({name: values[name] for name in model.schema.order if name in values})


@contextlib.contextmanager
def _alarm(seconds: float) -> Iterator[None]:
    def ring(*_: object) -> None:
        raise Hang(f"more than {seconds} s")

    before = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
