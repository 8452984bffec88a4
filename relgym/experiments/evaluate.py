"""How good is a model, one step ahead, on episodes that it hasn't seen? By what really happened (§4.3.3).

A prediction is *wrong* if it is off by more than 1e-9, or if no mode made it. Left out, and counted, are only
steps of which the env's own contact log says that a corner was hit or that several contacts acted at once,
and which none of the world's linear laws explains.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.experiments.analytic import AnalyticModes, Case
from relgym.experiments.episodes import Episode
from relgym.model.predicting.prediction import OUTCOMES, Outcome
from relgym.model.reports.text import Cell, table
from relgym.model.world_model import WorldModel

__all__ = [
    "TOLERANCE",
    "Evaluation",
    "ModeErrors",
    "TargetErrors",
    "chunks",
    "evaluate",
    "explicable",
    "mode_labels",
]

TOLERANCE = 1e-9
"""Largest residual of a right prediction, in units of the property."""

_CHUNK = 4000
"""Scenes predicted at once: their relations need some 10 kB each."""

_SPOKE = OUTCOMES.index(Outcome.PREDICTED)
_UNLABELLED = "several contacts at once"

_Parts: TypeAlias = dict[str, list[NDArray[np.float64]]]


@dataclass(frozen=True, slots=True)
class ModeErrors:
    """Errors on the transitions of one true mode.

    Attributes
    ----------
    name
        What really happened.
    examples
        Number of transitions.
    wrong
        How many were predicted wrongly, those without a prediction included.
    abstained
        How many were not predicted by any mode.
    """

    name: str
    examples: int
    wrong: int
    abstained: int

    @property
    def rate(self) -> float:
        """Share of wrong predictions; 0 without examples."""
        return self.wrong / self.examples if self.examples else 0.0


@dataclass(frozen=True, slots=True)
class TargetErrors:
    """Errors of one target.

    Attributes
    ----------
    target
        Such as ``ball.vx``.
    modes
        Errors by true mode, as far as it occurred.
    left_out
        Transitions that were not counted.
    largest
        Largest residual of a right prediction, in units of the property.
    """

    target: str
    modes: tuple[ModeErrors, ...]
    left_out: int
    largest: float

    @property
    def total(self) -> ModeErrors:
        """Errors in all modes together."""
        sums = (sum(getattr(m, name) for m in self.modes) for name in ("examples", "wrong", "abstained"))
        return ModeErrors("all", *sums)


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Errors of a model on a set of episodes, by target."""

    targets: tuple[TargetErrors, ...]

    def __getitem__(self, target: str) -> TargetErrors:
        """Return the errors of the target of that name (``ball.vx``)."""
        return next(t for t in self.targets if t.target == target)

    def __str__(self) -> str:
        rows: list[list[Cell] | str] = []
        for target in self.targets:
            rows.append(f"{target.target}  (right ones within {target.largest:.0e})")
            rows += [_row(m) for m in target.modes]
            if len(target.modes) > 1:
                rows.append(_row(target.total))
        text = table(["what really happened", "examples", "wrong", "abstained", "wrong %"], rows)
        notes = [f"wrong: off by more than {TOLERANCE:g}, or abstained: not predicted by any mode"]
        left_out = [f"{t.left_out} of {t.left_out + t.total.examples:,} ({t.target})" for t in self.targets]
        if any(t.left_out for t in self.targets):
            notes += [f"left out: {', '.join(left_out)}:"]
            notes += ["the engine's own log has a corner hit or several contacts at once, and no linear law"]
            notes += ["explains the step"]
        return "\n".join([text, "", *notes])


def evaluate(
    model: WorldModel, episodes: Iterable[Episode], modes: AnalyticModes | None = None
) -> Evaluation:
    """Predict every transition of some episodes, one step ahead, as a batch.

    Parameters
    ----------
    model
        The model; unchanged.
    episodes
        Episodes of the model's schema, not those that it learned from.
    modes
        The ball world's linear laws; without them all corner hits and multiple contacts are left out.

    Notes
    -----
    Cost: some 20 µs per transition and target.
    """
    names: dict[str, tuple[str, ...]] = {}
    found: _Parts = {}
    for part in chunks(episodes):
        names |= part[0].truth.mode_names if modes is None else mode_labels(modes)
        for target, results in _results(model, part, modes).items():
            found.setdefault(target, []).extend(results)
    return Evaluation(tuple(_target_errors(t, names.get(t, ()), np.concatenate(r)) for t, r in found.items()))


def explicable(episode: Episode, modes: AnalyticModes | None) -> dict[str, NDArray[np.bool_]]:
    """Per labelled target: which of an episode's transitions count, shape ``(n,)``.

    Those with one plain contact or none do; of the others those that some linear law explains.
    """
    plain = ~(episode.truth.corner | (episode.truth.active > 1))
    result = {}
    for target in episode.truth.mode:
        result[target] = plain.copy()
        if modes is not None and not plain.all():
            v = episode.columns("ball", "vx", "vy")
            result[target] |= modes.explaining(target[-1], v[:-1], v[1:], TOLERANCE).any(axis=1)
    return result


def mode_labels(modes: AnalyticModes) -> dict[str, tuple[str, ...]]:
    """For people: per target, in which cases each analytic mode holds (``fly, floor, ceiling``)."""
    axes = {"ball.vx": modes.x, "ball.vy": modes.y}
    return {
        t: tuple(", ".join(dict.fromkeys(map(_label, m.cases))) for m in of_axis)
        for t, of_axis in axes.items()
    }


def _label(case: Case) -> str:
    if case.surface == "none":
        return "fly"
    where = f"slide on {case.surface}" if case.sliding else case.surface
    return where if case.slip == "none" else f"{where} ({case.slip}, mu {case.friction:g})"


def _row(errors: ModeErrors) -> list[Cell]:
    return [
        f"  {errors.name}",
        errors.examples,
        errors.wrong,
        errors.abstained,
        round(100.0 * errors.rate, 3),
    ]


def chunks(episodes: Iterable[Episode]) -> Iterator[list[Episode]]:
    """Consecutive episodes with the same objects, some thousand transitions at a time."""
    for _, group in groupby(episodes, key=lambda episode: episode.layout.names):
        part: list[Episode] = []
        for episode in group:
            part.append(episode)
            if sum(map(len, part)) >= _CHUNK:
                yield part
                part = []
        if part:
            yield part


def _results(model: WorldModel, part: Sequence[Episode], modes: AnalyticModes | None) -> _Parts:
    """Per target, arrays of shape ``(n, 4)``: residual, did a mode predict, true mode, does it count."""
    layout, results = part[0].layout, _Parts()
    prediction = model.predict_batch(layout, np.concatenate([b.vectors[:-1] for b in part]))
    after = np.concatenate([b.vectors[1:] for b in part])
    counted = [explicable(b, modes) for b in part]
    for k, (name, prop) in enumerate(prediction.parts):
        index = layout.index(name)
        target, column = f"{layout.types[index].name}.{prop}", layout.column(index, prop)
        residual = np.abs(prediction.vectors[:, column] - after[:, column])
        truth = np.concatenate([b.truth.mode.get(target, np.zeros(len(b), dtype=np.int64)) for b in part])
        counts = [c.get(target, np.ones(len(b), dtype=np.bool_)) for b, c in zip(part, counted, strict=True)]
        spoke = prediction.outcomes[:, k] == _SPOKE
        columns = np.column_stack([residual, spoke, truth, np.concatenate(counts)])
        results.setdefault(target, []).append(columns)
    return results


def _target_errors(target: str, names: Sequence[str], results: NDArray[np.float64]) -> TargetErrors:
    counts = results[:, 3] > 0
    residual, spoke, truth = results[counts, 0], results[counts, 1] > 0, results[counts, 2].astype(np.int64)
    wrong = (residual > TOLERANCE) | ~spoke
    modes = []
    for number in sorted(np.unique(truth).tolist(), key=lambda n: (n < 0, n)):
        part = truth == number
        name = _UNLABELLED if number < 0 else names[number] if names else "all"
        modes.append(ModeErrors(name, *(int(n[part].sum()) for n in (part, wrong, ~spoke))))
    right = residual[~wrong]
    return TargetErrors(target, tuple(modes), int((~counts).sum()), float(right.max()) if len(right) else 0.0)
