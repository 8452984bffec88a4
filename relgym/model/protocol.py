"""What wrappers, dreams and comparisons ask of a model: `relgym.model.world_model.WorldModel`, or any other learner."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

from relgym.clustering.mode import Mode
from relgym.model.learning.transition import LearnReport
from relgym.model.predicting.prediction import BatchPrediction, ScenePrediction
from relgym.scene.objects import Float2D, Scene, SceneLayout, Target, Transition
from relgym.scene.schema import SceneSchema

__all__ = ["SceneLearner"]


@runtime_checkable
class SceneLearner(Protocol):
    """Learns scenes' next values online.

    Attributes
    ----------
    extra : dict
        Plain data of the caller's, kept in its file: a wrapper's spaces and view.
    seen : int
        Number of transitions learned from.
    frozen : bool
        Whether it can only predict.
    """

    extra: dict[str, Any]
    seen: int
    frozen: bool

    @property
    def schema(self) -> SceneSchema:
        """Of the scenes."""

    @property
    def targets(self) -> tuple[Target, ...]:
        """What it predicts."""

    @property
    def discovers(self) -> bool:
        """Whether targets are added as it sees what changes."""

    def governs(self, target: Target) -> bool:
        """Whether laws of motion, and no modes, predict a target."""

    def modes(self, type_name: str, prop: str) -> Sequence[Mode]:
        """Modes of a target."""

    def learn_one(self, transition: Transition) -> LearnReport:
        """Learn from a transition."""

    def take_up(
        self,
        transition: Transition,
        prediction: ScenePrediction,
        residuals: Mapping[tuple[str, str], float],
        precision: float = 0.0,
    ) -> LearnReport:
        """Learn from a transition and from how a prediction of it came out."""

    def predict_one(self, scene: Scene) -> ScenePrediction:
        """Predict the next scene."""

    def predict_batch(self, layout: SceneLayout, vectors: Float2D) -> BatchPrediction:
        """Predict what follows n scenes with the same objects, shape ``(n, layout.width)``."""

    def describe(self) -> str:
        """What was learned, as text."""

    def save(self, path: str | os.PathLike[str], *, history: bool = False) -> None:
        """Write it to a file; `history`: with what further learning needs."""
