"""``relgym export``: a model as a file of Python, and how often both say the same."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from relgym.console.models import ModelInEnv
from relgym.errors import ConfigError
from relgym.files.writing import write_whole
from relgym.model.predicting.prediction import BatchPrediction
from relgym.scene.objects import Float2D, Scene
from relgym.wrappers.follower import scenes_of

__all__ = ["Exported", "exported"]

CHUNK = 1000
"""Scenes that are predicted at once."""


@dataclass(frozen=True, slots=True)
class Exported:
    """What was written, and how it compares.

    Attributes
    ----------
    path, lines
        The file, and how long it is.
    steps
        Fresh steps on which it was compared with the model.
    outcomes
        Share of predictions of the same outcome and the same mode.
    largest
        Largest difference of a next value, in units of the property.
    """

    path: str
    lines: int
    steps: int
    outcomes: float
    largest: float

    def __str__(self) -> str:
        same = f"{100.0 * self.outcomes:.6g} % of the outcomes are the model's"
        told = f"on {self.steps:,} fresh steps {same}, values differ by at most {self.largest:.2g}"
        return f"{self.path}: {self.lines} lines of Python that need numpy alone\n{told}"


def exported(found: ModelInEnv, out: Path, *, steps: int, seed: int) -> Exported:
    """Write a model as Python, run what was written on fresh steps of its env, and compare.

    Parameters
    ----------
    found
        The model and its env.
    out
        The file; one that exists is replaced.
    steps
        Steps with random actions. Those with other objects than the first one are left out.
    seed
        Of everything random.

    Raises
    ------
    ConfigError
        The model holds what isn't written as Python (`WorldModel.to_python`), or the env shows no scene.
    """
    fresh = list(islice(scenes_of(found.env, found.view, steps, seed=seed), steps))
    if not fresh:
        raise ConfigError("the env showed no scene to compare on; expected at least one step")
    layout = fresh[0].layout
    alike = [scene for scene in fresh if scene.layout == layout]
    text = found.model.to_python(layout)
    write_whole(out, text.encode(), error=ConfigError)
    module: dict[str, Any] = {"__name__": "exported"}
    exec(compile(text, str(out), "exec"), module)
    same = total = 0
    largest = 0.0
    for start in range(0, len(alike), CHUNK):
        vectors = _vectors(alike[start : start + CHUNK])
        told = found.model.predict_batch(layout, vectors)
        after, outcomes, modes, *_ = module["predict"](vectors)
        agreed = (outcomes == told.outcomes) & (modes == told.modes)
        same, total = same + int(agreed.sum()), total + agreed.size
        largest = max(largest, _difference(after, told))
    share = same / total if total else 1.0
    return Exported(str(out), len(text.splitlines()), len(alike), share, largest)


def _vectors(scenes: list[Scene]) -> Float2D:
    return np.array([scene.vector for scene in scenes])


def _difference(after: Float2D, told: BatchPrediction) -> float:
    return float(np.abs(after - told.vectors).max(initial=0.0))
