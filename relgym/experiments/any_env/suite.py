"""Other people's envs, through views, as benchmarks (`relgym benchmark any-env`).

Every env is learned twice from the same transitions: with the default configuration, and with the features that the
default's own advice recommends. Errors are *nRMSE-d*: root mean square error of one step over the standard deviation of
the change, per property, on fresh episodes, where steps at a limit (a wall, a clip) are measured apart: an error over
everything would measure the rare kind only.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Callable, Iterator, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from relgym.config import ModelConfig
from relgym.errors import ConfigError
from relgym.experiments.any_env.data import (
    STUDIES,
    Lesson,
    Policy,
    Study,
    at_random,
    collect,
    errors,
    learned,
    nrmse_d,
    pumping,
    racing,
    recommended,
    regular,
)
from relgym.experiments.any_env.fleet import fleet
from relgym.experiments.any_env.flight import flight
from relgym.experiments.any_env.memory import LIVES, memory
from relgym.experiments.any_env.stream import prequential
from relgym.experiments.any_env.tables import RECORDED
from relgym.experiments.benchmark import Benchmark, Extent, Known, Option, Shown, Suite
from relgym.experiments.criterion import Figure, gathered
from relgym.experiments.seeds import TEST_SEEDS, TRAINING_SEEDS, TUNING_SEEDS, TUNING_TEST_SEED
from relgym.model.world_model import WorldModel

__all__ = ["SUITE", "Setting", "part", "weight"]

TEST: Final = 4_000
"""Transitions evaluated on."""


@dataclass(frozen=True, slots=True)
class Setting:
    """How one benchmark is measured.

    Attributes
    ----------
    study
        Name of the env.
    train
        Transitions learned from.
    limit
        Largest nRMSE-d.
    policy
        Who acts; default: anything.
    features
        What is switched on; default: what the default configuration recommends.
    constants
        Values at which a property is held, each of which a mode must state: property, value.
    """

    study: str
    train: int
    limit: float
    policy: Policy = at_random
    features: tuple[str, ...] = ()
    constants: tuple[tuple[str, float], ...] = ()


HELD: Final = (("x", -1.2), ("v", 0.0), ("v", -0.07))
"""Where a car is held: at the left wall, and at its highest speed (to the left: to the right the goal comes first)."""

SETTINGS: Final = {
    "mountain": Setting("mountain", 2_000, 1e-4),
    "mountain-continuous": Setting("mountain-continuous", 2_000, 1e-4),
    "mountain-pumped": Setting("mountain", 20_000, 1e-3, pumping),
    "mountain-continuous-pumped": Setting("mountain-continuous", 20_000, 1e-3, pumping),
    "mountain-raced": Setting("mountain", 8_000, 1e-3, racing, constants=HELD),
    "mountain-continuous-raced": Setting("mountain-continuous", 8_000, 1e-3, racing, constants=HELD),
    "cart": Setting("cart", 2_000, 1e-3),
    "pendulum": Setting("pendulum", 10_000, 1e-4),
    "acrobot": Setting("acrobot", 2_000, 0.1, features=("trig", "degree4")),
}
"""Classic control."""

Pairs = Sequence[tuple[int, int]]


def _one_step(setting: Setting, seeds: Pairs, *, quick: bool) -> Iterator[Figure]:
    """Classic control: errors of one step by property, and the coefficients of the law in the source."""
    study = STUDIES[setting.study]
    for number, (training, test) in enumerate(seeds):
        lesson = collect(
            study, min(setting.train, 1_000) if quick else setting.train, training, setting.policy
        )
        fresh = collect(study, 1_000 if quick else TEST, 2_000 + test, setting.policy)
        model = _model(study, setting, lesson, verbose=not number)
        for what, value in _evaluated(study, model, fresh).items():
            yield what, setting.limit, value, "<="
        for prop, value in setting.constants:
            held = min((abs(c - value) for c in _constants(model, prop)), default=np.inf)
            yield f"{prop}: a mode for being held at {value:g}, off by", 1e-7, held, "<="
        for prop, term, value in study.weights if setting.policy is at_random else ():
            off = abs(weight(model, prop, term) / value - 1.0)
            yield f"{prop}: {value:g} {term}, off by", 0.01, off, "<="


def _model(study: Study, setting: Setting, lesson: Lesson, *, verbose: bool) -> WorldModel:
    plain = learned(lesson)
    advised = recommended(plain)
    features = setting.features or advised
    model = learned(lesson, ModelConfig(features=features)) if features else plain
    if verbose:
        print(
            f"{study.env}, {len(lesson.transitions):,} transitions; recommended: {advised or 'nothing'}, ",
            end="",
        )
        print(f"switched on: {features or 'nothing'}\n")
        print(
            *[f"default, {a.target}: {a}" for a in plain.advice()], "", model.describe(digits=5), "", sep="\n"
        )
    return model


def _evaluated(study: Study, model: WorldModel, fresh: Lesson) -> dict[str, float]:
    usual = regular(study, fresh)
    found = {f"{p}, regular": e for p, e in nrmse_d(model, fresh, usual).items()}
    if not usual.all():
        found |= _at_limits(model, fresh, ~usual)
    return found


def _at_limits(model: WorldModel, lesson: Lesson, rows: NDArray[np.bool_]) -> dict[str, float]:
    """Errors at limits over the standard deviation of the change in all rows: there, changes may be constant."""
    size = np.sqrt(np.square(errors(model, lesson)[rows]).mean(axis=0)) / lesson.change.std(axis=0)
    names = lesson.view.schema.type_of("self").properties
    return {f"{p}, at a limit": float(e) for p, e in zip(names, size, strict=True)}


def weight(model: WorldModel, prop: str, term: str) -> float:
    """Weight of a term, named as it is printed, in the largest mode of a property of `self`; 0 if it has none."""
    modes = model.modes("self", prop)
    if not modes:
        return 0.0
    largest = max(modes, key=lambda m: m.examples)
    own, *others = largest.roles
    terms: dict[str, float] = dict(own.terms) | {f"{r.type}.{name}": w for r in others for name, w in r.terms}
    return terms.get(term, 0.0)


def _constants(model: WorldModel, prop: str) -> list[float]:
    """Constants that modes of a property of `self` state."""
    return [m.intercept for m in model.modes("self", prop) if not any(role.terms for role in m.roles)]


_TITLES: Final = {
    "mountain": "MountainCar",
    "mountain-continuous": "MountainCarContinuous",
    "mountain-pumped": "MountainCar, pumped up the hill",
    "mountain-continuous-pumped": "MountainCarContinuous, pumped up the hill",
    "mountain-raced": "MountainCar, raced into walls and limits",
    "mountain-continuous-raced": "MountainCarContinuous, raced into walls and limits",
    "cart": "CartPole",
    "pendulum": "Pendulum",
    "acrobot": "Acrobot",
    "lander": "LunarLander in flight",
    "stream": "The stream as it comes",
    "fleet": "Fleets",
    "highway": "Traffic, highway-env's table",
    "pong": "Pong, objects of OCAtari",
    **{name: f"A long life: {name}" for name in LIVES},
}


def part(
    *,
    name: str,
    seeds: Pairs,
    quick: bool,
    steps: int | None = None,
    recordings: str | None = None,
    files: str = "",
) -> dict[str, Any]:
    """Measure one benchmark, as a task for the store of results; what it tells on the way are its notes.

    Parameters
    ----------
    name
        Of the benchmark.
    seeds
        Pairs of a training and a test seed.
    quick
        Few transitions, and of recordings few other learners: a smoke test.
    steps
        Length of a long life, if not a million.
    recordings, files
        Folder of what `examples/adapters` recorded, and a digest of what is in it.
    """
    others: dict[str, Callable[..., Iterator[Figure]]] = {
        "lander": flight,
        "stream": prequential,
        "fleet": fleet,
    }
    if recordings is not None:
        figures = RECORDED[name](Path(recordings), [training for training, _ in seeds], batch=not quick)
    elif name in others:
        figures = others[name](seeds, quick=quick)
    elif name in LIVES:
        figures = memory(name, seeds, quick=quick, steps=steps, bound=steps and steps // 5)
    else:
        figures = _one_step(SETTINGS[name], seeds, quick=quick)
    told = io.StringIO()
    with redirect_stdout(told):
        measures = gathered(figures)
    return Shown(measures, [told.getvalue().strip()]).to_json()


def _benchmark(name: str) -> Benchmark:
    def measure(extent: Extent, known: Known) -> Shown:
        training = TUNING_SEEDS if extent["tuning"] else TRAINING_SEEDS
        tests = (TUNING_TEST_SEED,) if extent["tuning"] else TEST_SEEDS
        pairs = [(seed, tests[k % len(tests)]) for k, seed in enumerate(training)]
        asked: dict[str, Any] = {"name": name, "quick": extent["quick"]}
        if name in LIVES and extent["steps"]:
            asked["steps"] = extent["steps"]
        if name in RECORDED:
            folder = extent["recordings"]
            asked |= _recorded(name, folder)
            pairs = [pair for pair in pairs if Path(folder, f"{name}-{pair[0]}.npz").is_file()]
        return known.whole(
            "relgym.experiments.any_env.suite:part", {**asked, "seeds": list(extent.first(pairs))}
        )

    return Benchmark(_TITLES[name], measure)


def _recorded(name: str, folder: str) -> dict[str, str]:
    """The folder of recordings, and a digest of them: a result is of what was recorded."""
    files = sorted(Path(folder).glob(f"{name}*.npz")) if folder else []
    if not files:
        missing = f"{folder} holds none of it" if folder else "no folder was named"
        raise ConfigError(
            f"{name} is learned from recordings, and {missing}: "
            "make them with examples/adapters (option --record FOLDER), and name their folder (--recordings FOLDER)"
        )
    digest = hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()
    return {"recordings": folder, "files": digest}


SUITE: Final = Suite(
    "any-env",
    "Other people's envs",
    {name: _benchmark(name) for name in _TITLES},
    seeds=len(TRAINING_SEEDS),
    options={
        "tuning": Option(False, "the seeds for tuning instead of those for reporting"),
        "quick": Option(False, "few transitions"),
        "steps": Option(0, "transitions of a long life, of which a fifth is kept; 0: a million"),
        "recordings": Option("", "folder of what was recorded of Pong and traffic"),
    },
    usual=tuple(name for name in _TITLES if name not in {*RECORDED, *LIVES}),
)
