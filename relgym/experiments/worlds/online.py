"""Learning from episodes one transition at a time, each predicted before it is learned from (§4.2)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from time import perf_counter
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.config import ModelConfig
from relgym.experiments.analytic import AnalyticModes
from relgym.experiments.episodes import Episode
from relgym.experiments.evaluate import TOLERANCE, explicable
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Float1D

__all__ = ["Course", "follow", "last", "learned"]

_Bools: TypeAlias = NDArray[np.bool_]

_THESIS_AXES = ModelConfig(frames="world")
"""The thesis' results are those of modes, not of contact laws."""


@dataclass(slots=True)
class Course:
    """How learning from a stream of episodes went.

    Attributes
    ----------
    model
        The model; the episodes seen so far taught it.
    wrong
        Per target and episode: which predictions were off by more than `TOLERANCE` or made by no mode.
    counted
        Likewise: which transitions count (see `explicable`).
    seconds
        Per episode: time of predicting and learning from each transition, in seconds.
    """

    model: WorldModel
    wrong: dict[str, list[_Bools]] = field(default_factory=dict)
    counted: dict[str, list[_Bools]] = field(default_factory=dict)
    seconds: list[Float1D] = field(default_factory=list)

    def rate(self, target: str, first: int, last: int | None = None) -> float:
        """Share of wrong predictions of a target from episode `first` on (the first is 1) up to `last`."""
        part = slice(first - 1, last)
        counted = np.concatenate(self.counted[target][part])
        return float(np.concatenate(self.wrong[target][part])[counted].mean())


def follow(
    episodes: Iterable[Episode], *, config: ModelConfig | None = None, laws: AnalyticModes | None = None
) -> Iterator[Course]:
    """Predict and learn episode after episode.

    Parameters
    ----------
    episodes
        Episodes of one schema.
    config
        Free parameters of the model; default: along the world's axes, as in the thesis.
    laws
        The ball world's linear laws, for `Course.counted`.

    Yields
    ------
    The course after each episode; always the same object.
    """
    course: Course | None = None
    for episode in episodes:
        course = course or Course(WorldModel(episode.schema, config or _THESIS_AXES))
        seconds, wrong = _learn(course.model, episode)
        course.seconds.append(seconds)
        for target, counted in explicable(episode, laws).items():
            course.counted.setdefault(target, []).append(counted)
            course.wrong.setdefault(target, []).append(wrong[target])
        yield course


def last(courses: Iterable[Course]) -> Course:
    """The course after the last episode."""
    *_, course = courses
    return course


def learned(episodes: Iterable[Episode], *, config: ModelConfig | None = None) -> WorldModel:
    """The model that some episodes teach, its classifiers up to date; nothing is predicted on the way."""
    model: WorldModel | None = None
    for episode in episodes:
        model = model or WorldModel(episode.schema, config or _THESIS_AXES)
        for transition in episode.transitions():
            model.learn_one(transition)
    assert model is not None, "no episodes, no schema"
    model.finish()
    return model


def _learn(model: WorldModel, episode: Episode) -> tuple[Float1D, dict[str, _Bools]]:
    n, layout = len(episode), episode.layout
    seconds, wrong = np.zeros(n), {target: np.ones(n, dtype=np.bool_) for target in episode.truth.mode}
    for k, transition in enumerate(episode.transitions()):
        start = perf_counter()
        prediction = model.predict_one(transition.before)
        model.learn_one(transition)
        seconds[k] = perf_counter() - start
        for part in prediction.parts:
            index = layout.index(part.object)
            target = f"{layout.types[index].name}.{part.property}"
            actual = transition.after.vector[layout.column(index, part.property)]
            if target in wrong:
                wrong[target][k] = not part.ok or abs(part.value - actual) > TOLERANCE
    return seconds, wrong
