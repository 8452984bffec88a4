"""Other people's envs, through views, as benchmarks (``python -m relgym.experiments.any_env``).

Every env is learned twice from the same transitions: with the default configuration, and with the features that the
default's own advice recommends. Errors are *nRMSE-d*: root mean square error of one step over the standard deviation of
the change, per property, on fresh episodes, where steps at a limit (a wall, a clip) are measured apart: an error over
everything would measure the rare kind only.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from relgym.config import ModelConfig
from relgym.experiments.any_env_data import (
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
from relgym.experiments.any_env_fleet import fleet
from relgym.experiments.any_env_flight import flight
from relgym.experiments.any_env_memory import LIVES, memory
from relgym.experiments.any_env_stream import prequential
from relgym.experiments.criterion import Measure, measured, one_of, report
from relgym.experiments.seeds import TEST_SEEDS, TRAINING_SEEDS, TUNING_SEEDS, TUNING_TEST_SEED
from relgym.model.world_model import WorldModel

__all__ = ["BENCHMARKS", "Setting", "main", "weight"]

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


def _one_step(setting: Setting, seeds: Pairs, *, quick: bool) -> list[Measure]:
    """Classic control: errors of one step by property, and the coefficients of the law in the source."""
    study = STUDIES[setting.study]
    found: dict[tuple[str, float], list[float]] = {}
    for number, (training, test) in enumerate(seeds):
        lesson = collect(
            study, min(setting.train, 1_000) if quick else setting.train, training, setting.policy
        )
        fresh = collect(study, 1_000 if quick else TEST, 2_000 + test, setting.policy)
        model = _model(study, setting, lesson, verbose=not number)
        for what, value in _evaluated(study, model, fresh).items():
            found.setdefault((what, setting.limit), []).append(value)
        for prop, value in setting.constants:
            held = min((abs(c - value) for c in _constants(model, prop)), default=np.inf)
            found.setdefault((f"{prop}: a mode for being held at {value:g}, off by", 1e-7), []).append(held)
        for prop, term, value in study.weights if setting.policy is at_random else ():
            off = abs(weight(model, prop, term) / value - 1.0)
            found.setdefault((f"{prop}: {value:g} {term}, off by", 0.01), []).append(off)
    return [measured(what, limit, values) for (what, limit), values in found.items()]


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


BENCHMARKS: Final = (*SETTINGS, "lander", "stream", "fleet", *LIVES)
"""By name."""


def benchmark(name: str, seeds: Pairs, *, quick: bool, steps: int | None = None) -> str:
    """Measure one; its figures beside their limits. `steps` is the length of a long life, if not a million."""
    others: dict[str, Callable[..., list[Measure]]] = {
        "lander": flight,
        "stream": prequential,
        "fleet": fleet,
    }
    if name in others:
        return report(name, others[name](seeds, quick=quick))
    if name in LIVES:
        return report(name, memory(name, seeds, quick=quick, steps=steps, bound=steps and steps // 5))
    return report(name, _one_step(SETTINGS[name], seeds, quick=quick))


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line: benchmarks, ``--seeds N``, ``--tuning`` for the tuning seeds, ``--quick`` for few transitions."""
    parser = argparse.ArgumentParser(description=__doc__)
    names = ", ".join(BENCHMARKS)
    parser.add_argument("benchmarks", nargs="*", type=one_of(BENCHMARKS), help=f"{names}; default: all")
    parser.add_argument("--seeds", type=int, default=1, help="how many training seeds, each with a test seed")
    parser.add_argument(
        "--steps", type=int, help="length of a long life (benchmarks 'memory…'), of which a fifth is kept"
    )
    parser.add_argument("--tuning", action="store_true")
    parser.add_argument("--quick", action="store_true")
    given = parser.parse_args(arguments)
    training = TUNING_SEEDS if given.tuning else TRAINING_SEEDS
    tests = (TUNING_TEST_SEED,) if given.tuning else TEST_SEEDS
    seeds = [(s, tests[k % len(tests)]) for k, s in enumerate(training[: given.seeds])]
    for name in given.benchmarks or BENCHMARKS:
        print(benchmark(name, seeds, quick=given.quick, steps=given.steps), "\n", flush=True)


if __name__ == "__main__":
    main()
