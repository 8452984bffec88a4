"""One-step errors, learned modes and roll-outs in the ball experiments: training seeds x test seeds (§4.3-§4.5).

`relgym benchmark worlds ball-1 ball-2 ball-3` tells them beside their limits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.mode import Mode
from relgym.experiments.analytic import AnalyticMode, AnalyticModes, Case
from relgym.experiments.benchmark import Shown
from relgym.experiments.criterion import Measure, measured
from relgym.experiments.data import BALL_EXPERIMENTS, ball_episodes
from relgym.experiments.episodes import Episode
from relgym.experiments.evaluate import Evaluation, evaluate, mode_labels
from relgym.experiments.rollouts import RolloutErrors, rollouts
from relgym.experiments.worlds.online import learned
from relgym.model.world_model import WorldModel

__all__ = ["AXES", "TargetOutcome", "ball"]

AXES: Final = {"x": "ball.vx", "y": "ball.vy"}

_SAME: Final = 1e-9  # coefficients that differ by less are equal
_RARE: Final = 20  # a mode with fewer training examples may be missing
_EXPLAINED: Final = 0.95  # ... and so may one that known modes explain to this share: it is a special case

_Kind: TypeAlias = Callable[[Case], bool]


def _level(case: Case) -> bool:
    return case.surface in ("floor", "ceiling") and not case.sliding


def _vertical(case: Case) -> bool:
    return case.surface in ("left face", "right face")


def _slope(case: Case) -> bool:
    return case.surface == "slope"


def _halt(case: Case) -> bool:
    return case.surface in ("floor", "ceiling") and case.slip == "halt"


_CLASSES: Final[Mapping[int, Sequence[tuple[str, str, _Kind, float]]]] = {
    1: (
        ("horizontal bounce", "y", _level, 0.03),
        ("vertical bounce", "x", _vertical, 0.01),
        ("ramp bounce", "x", _slope, 0.01),
        ("ramp bounce", "y", _slope, 0.01),
    ),
    2: (("halt", "x", _halt, 0.05), ("floor bounce", "y", _level, 0.02)),
    3: (),
}
"""Per experiment: the true modes with a limit of their own (tables 4.7, 4.8, 4.15 and 4.16)."""

_WRONG: Final = {1: 0.0005, 2: 0.001, 3: 0.002}
_FAILED: Final = {1: 3, 2: 10}

TRIALS: Final = 80
"""Episodes of a test set that are rolled out."""


@dataclass(frozen=True, slots=True)
class TargetOutcome:
    """What a model knows of one target.

    Attributes
    ----------
    stated
        Numbers of the analytic modes that a learned mode states to 1e-9.
    spurious
        Formulas of learned modes that are no analytic mode.
    missing
        Analytic modes with at least 20 training examples that aren't stated, nor a special case of what is.
    noise
        Share of the training examples that no mode explains.
    """

    stated: tuple[int, ...]
    spurious: tuple[str, ...]
    missing: tuple[str, ...]
    noise: float


def ball(experiment: int, training: Sequence[int], tests: Sequence[int]) -> Shown:
    """Train on each training seed, test on each test seed: figures beside their limits, and what is wrong of each."""
    laws = BALL_EXPERIMENTS[experiment].modes()
    evaluations: list[Evaluation] = []
    rolled: list[RolloutErrors] = []
    targets: dict[str, list[TargetOutcome]] = {axis: [] for axis in AXES}
    notes: list[str] = []
    for seed in training:
        taught = list(ball_episodes(experiment, seed=seed))
        model = learned(taught)
        notes.append(f"training seed {seed}:")
        for axis, found in targets.items():
            known = _target_outcome(model, axis, _of(laws, axis), taught)
            found.append(known)
            notes.append(f"  {axis}: {len(known.stated)} analytic modes, noise {known.noise:.3%}")
            notes += [f"     missing:  {name}" for name in known.missing]
            notes += [f"     spurious: {formula}" for formula in known.spurious]
        for test in tests:
            fresh = list(ball_episodes(experiment, seed=test, test=True))
            evaluations.append(evaluate(model, fresh, laws))
            rolled.append(rollouts(model, fresh[:TRIALS]))
            notes += _lines(test, evaluations[-1], rolled[-1])
    measures = [
        measured(f"wrong, {axis}", _WRONG[experiment], [e[target].total.rate for e in evaluations])
        for axis, target in AXES.items()
    ]
    for name, axis, kind, limit in _CLASSES[experiment]:
        rates = [_rate(e, axis, laws, kind) for e in evaluations]
        measures.append(measured(f"wrong, {name}, {axis}", limit, rates))
    measures += _mode_measures(experiment, targets)
    if rolled and experiment in _FAILED:
        failed = [r.failed_without_corner for r in rolled]
        measures.append(measured("roll-outs failed without a corner", _FAILED[experiment], failed))
    return Shown(measures, notes)


def _lines(test: int, evaluation: Evaluation, rolled: RolloutErrors) -> Iterator[str]:
    """What is wrong with a test seed."""
    for axis, target in AXES.items():
        errors = evaluation[target]
        bad = ", ".join(f"{m.name} {m.wrong}/{m.examples}" for m in errors.modes if m.wrong)
        yield f"  test {test} {axis}: wrong {errors.total.rate:.4%} ({bad}); left out {errors.left_out}"
    yield (
        f"  test {test} roll-outs: {rolled.failed} of {rolled.trials} failed, {rolled.failed_without_corner} "
        f"without a corner, {rolled.stopped} stopped early; median error {rolled.median:.1e}"
    )


def _mode_measures(experiment: int, targets: Mapping[str, Sequence[TargetOutcome]]) -> list[Measure]:
    if experiment == 2:
        sliding = _sliding(BALL_EXPERIMENTS[2].modes().x)
        x = [len(set(t.stated) - sliding) for t in targets["x"]]
        y = [len(t.stated) for t in targets["y"]]
        return [measured("x modes", 8, x, ">="), measured("y modes", 7, y, ">=")]
    if experiment == 3:
        both = [*targets["x"], *targets["y"]]
        return [
            measured("modes that are no row of the analytic list", 0, [len(t.spurious) for t in both]),
            measured("analytic modes missing", 0, [len(t.missing) for t in both]),
        ]
    return []


def _sliding(laws: Sequence[AnalyticMode]) -> set[int]:
    """Modes that hold on a floor without vertical velocity only: special cases of bouncing."""
    return {k for k, law in enumerate(laws) if all(case.sliding for case in law.cases)}


def _rate(evaluation: Evaluation, axis: str, laws: AnalyticModes, kind: _Kind) -> float:
    """Share of wrong predictions among the transitions of all true modes of a kind."""
    labels = mode_labels(laws)[AXES[axis]]
    names = {labels[k] for k, law in enumerate(_of(laws, axis)) if all(map(kind, law.cases))}
    modes = [m for m in evaluation[AXES[axis]].modes if m.name in names]
    return sum(m.wrong for m in modes) / max(sum(m.examples for m in modes), 1)


def _of(laws: AnalyticModes, axis: str) -> tuple[AnalyticMode, ...]:
    return laws.x if axis == "x" else laws.y


def _matched(mode: Mode, laws: Sequence[AnalyticMode]) -> int | None:
    """Number of the analytic mode that a learned mode states to 1e-9; none if it is no such."""
    weights = dict(mode.roles[0].terms)
    if any(role.terms for role in mode.open_roles) or not weights.keys() <= {"vx", "vy"}:
        return None
    stated = np.array([weights.get("vx", 0.0), weights.get("vy", 0.0), mode.intercept])
    off = [np.abs(stated - [*law.weights, law.intercept]).max() for law in laws]
    best = int(np.argmin(off))
    return best if off[best] <= _SAME else None


def _target_outcome(
    model: WorldModel, axis: str, laws: Sequence[AnalyticMode], episodes: Sequence[Episode]
) -> TargetOutcome:
    part = model.property_model(*AXES[axis].split("."))
    found = {mode: _matched(mode, laws) for mode in part.modes}
    stated = tuple(sorted({k for k in found.values() if k is not None}))
    true = np.concatenate([episode.truth.mode[AXES[axis]] for episode in episodes])
    missing = _missing(stated, laws, true, _velocities(episodes))
    spurious = tuple(mode.formula() for mode, k in found.items() if k is None)
    return TargetOutcome(stated, spurious, missing, part.clusterer.noise_examples / model.seen)


def _missing(
    stated: Sequence[int], laws: Sequence[AnalyticMode], true: NDArray[np.int64], v: NDArray[np.float64]
) -> tuple[str, ...]:
    names = []
    for k, law in enumerate(laws):
        own = v[true == k]
        if k in stated or len(own) < _RARE:
            continue
        values = [np.abs(laws[s].predict(own) - law.predict(own)) <= _SAME for s in stated]
        if not stated or np.any(values, axis=0).mean() < _EXPLAINED:
            names.append(f"{law.name} ({len(own)})")
    return tuple(names)


def _velocities(episodes: Sequence[Episode]) -> NDArray[np.float64]:
    return np.concatenate([episode.columns("ball", "vx", "vy")[:-1] for episode in episodes])
