"""Learning from episodes one transition at a time, each predicted before it is learned from (§4.2)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.config import ModelConfig
from relgym.experiments.analytic import AnalyticModes
from relgym.experiments.episodes import Episode
from relgym.experiments.evaluate import TOLERANCE, explicable
from relgym.model.world_model import WorldModel

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
    """

    model: WorldModel
    wrong: dict[str, list[_Bools]] = field(default_factory=dict)
    counted: dict[str, list[_Bools]] = field(default_factory=dict)

    def rate(self, target: str, first: int) -> float:
        """Share of wrong predictions of a target from episode `first` on (the first is 1)."""
        counted = np.concatenate(self.counted[target][first - 1 :])
        return float(np.concatenate(self.wrong[target][first - 1 :])[counted].mean())


def follow(episodes: Iterable[Episode], *, laws: AnalyticModes | None = None) -> Iterator[Course]:
    """Predict and learn episode after episode, with modes along the world's axes, as in the thesis.

    Parameters
    ----------
    episodes
        Episodes of one schema.
    laws
        The ball world's linear laws, for `Course.counted`.

    Yields
    ------
    The course after each episode; always the same object.
    """
    course: Course | None = None
    for episode in episodes:
        course = course or Course(WorldModel(episode.schema, _THESIS_AXES))
        wrong = _learn(course.model, episode)
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


def _learn(model: WorldModel, episode: Episode) -> dict[str, _Bools]:
    """Which predictions of each target are wrong."""
    layout, wrong = episode.layout, {t: np.ones(len(episode), dtype=np.bool_) for t in episode.truth.mode}
    for k, transition in enumerate(episode.transitions()):
        prediction = model.predict_one(transition.before)
        model.learn_one(transition)
        for part in prediction.parts:
            index = layout.index(part.object)
            target = f"{layout.types[index].name}.{part.property}"
            actual = transition.after.vector[layout.column(index, part.property)]
            if target in wrong:
                wrong[target][k] = not part.ok or abs(part.value - actual) > TOLERANCE
    return wrong
