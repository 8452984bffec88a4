"""A neural model of a whole world: what a `WorldModel` is asked, answered by nets (needs torch).

Dynamics, reward and termination are outputs of the same ensemble, as in MBPO. It sees a scene as a row of numbers, so
that it knows nothing of objects: exchange two, and it must learn anew.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.baselines.ensemble import MLPEnsemble
from relgym.errors import ConfigError
from relgym.model.percepts.scenes import unwrapped, wrap
from relgym.model.predicting.prediction import OUTCOMES, BatchPrediction, Outcome, Prediction, ScenePrediction
from relgym.scene.objects import ACTION, Float2D, Scene, SceneLayout, Target, Transition
from relgym.scene.schema import SceneSchema

__all__ = ["Features", "NeuralWorldModel"]

Features: TypeAlias = Callable[[SceneLayout, Float2D], NDArray[Any]]
"""From a layout without the action and state vectors of shape ``(n, width)`` to rows of numbers."""

_PREDICTED, _NOTHING = OUTCOMES.index(Outcome.PREDICTED), OUTCOMES.index(Outcome.NO_MODE)


class NeuralWorldModel:
    """Predicts scenes, rewards and ends of episodes with an `MLPEnsemble`.

    Parameters
    ----------
    schema
        The scenes' schema; they must always show the same objects.
    features
        How the nets see a scene; default: its state vector as it is.
    targets
        What changes; default: the schema's targets. Everything else persists; declared kinematics follow.
    ensemble
        The nets; default: `MLPEnsemble()`.

    Raises
    ------
    ConfigError
        No targets, neither given nor in the schema.
    """

    def __init__(
        self,
        schema: SceneSchema,
        *,
        features: Features | None = None,
        targets: Sequence[Target] | None = None,
        ensemble: MLPEnsemble | None = None,
    ) -> None:
        self.schema = schema
        self.targets = tuple(targets if targets is not None else schema.targets or ())
        if not self.targets:
            raise ConfigError("nothing to predict: pass targets=, since the schema names none")
        self.ensemble = ensemble or MLPEnsemble()
        self._features = features or _as_they_are

    @property
    def seen(self) -> int:
        """Number of transitions learned from."""
        return self.ensemble.seen

    # ------------------------------------------------------------------ learning
    def learn_one(self, transition: Transition) -> None:
        """Take up a transition without a reward."""
        self._learn(transition, 0.0, terminated=False)

    def learn_step(self, transition: Transition, reward: float, *, terminated: bool) -> None:
        """Take up a transition together with what the task said of it."""
        self._learn(transition, reward, terminated=terminated)

    def _learn(self, transition: Transition, reward: float, *, terminated: bool) -> None:
        before, after = transition.before, transition.after
        columns = self._columns(before.layout)
        now = before.vector[columns]
        whole = np.concatenate(
            [after[name].values if name in after else before[name].values for name in before.layout.names]
        )
        following = unwrapped(before.layout, before.vector, whole)[columns]
        values = np.concatenate([following - now, [reward, float(terminated)]])
        self.ensemble.learn_one(self._rows(before.layout, before.vector[None])[0], values)

    # ------------------------------------------------------------------ prediction
    def predict_one(self, scene: Scene) -> ScenePrediction:
        """Predict what follows a scene with an action in it."""
        found = self.predict_batch(scene.layout, scene.vector[None])
        ok = bool(found.ok[0])
        parts = tuple(
            Prediction(name, prop, float(value), Outcome.PREDICTED if ok else Outcome.NO_MODE)
            for (name, prop), value in zip(
                found.parts, found.vectors[0, self._columns(scene.layout)], strict=True
            )
        )
        return ScenePrediction(Scene(scene.schema, scene.layout, found.vectors[0]), parts)

    def predict_batch(self, layout: SceneLayout, vectors: Float2D) -> BatchPrediction:
        """Predict what follows n scenes with the same objects and actions in them."""
        following, n = vectors.copy(), len(vectors)
        columns, parts = self._columns(layout), self._parts(layout)
        outcome = _NOTHING
        if self.ensemble.ready:
            outcome = _PREDICTED
            changes = self.ensemble.predict_batch(self._rows(layout, vectors))
            following[:, columns] += changes[:, : len(columns)]
            self._derive(layout, vectors, following)
            wrap(layout, following)
        return BatchPrediction(
            layout,
            following,
            parts,
            np.zeros((n, len(parts)), dtype=np.int64),
            np.full((n, len(parts)), outcome, dtype=np.int8),
            np.zeros((n, len(parts))),
        )

    def predict_rewards(
        self, layout: SceneLayout, vectors: Float2D
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Rewards and ends of episodes for n scenes with actions in them, each of shape ``(n,)``."""
        if not self.ensemble.ready:
            return np.zeros(len(vectors)), np.zeros(len(vectors), dtype=bool)
        found = self.ensemble.predict_batch(self._rows(layout, vectors))
        return found[:, -2], found[:, -1] > 0.5

    # ------------------------------------------------------------------ helpers
    def _rows(self, layout: SceneLayout, vectors: Float2D) -> NDArray[np.float64]:
        """What the nets see: features of the scene, then the action."""
        if ACTION not in layout.names:
            return np.asarray(self._features(layout, vectors), dtype=np.float64)
        bare = self.schema.layout(name for name in layout.names if name != ACTION)
        own = layout.slice(layout.index(ACTION))
        seen = np.asarray(self._features(bare, np.delete(vectors, own, axis=1)), dtype=np.float64)
        return np.concatenate([seen, vectors[:, own]], axis=1)

    def _parts(self, layout: SceneLayout) -> tuple[tuple[str, str], ...]:
        return tuple((layout.names[i], t.property) for t in self.targets for i in layout.of_type(t.type))

    def _columns(self, layout: SceneLayout) -> list[int]:
        return [layout.column(layout.index(name), prop) for name, prop in self._parts(layout)]

    def _derive(self, layout: SceneLayout, now: Float2D, following: Float2D) -> None:
        for law in self.schema.derivations:
            for index in layout.of_type(law.type):
                place, rate = layout.column(index, law.property), layout.column(index, law.rate)
                source = following if law.uses_next else now
                following[:, place] = now[:, place] + law.step * source[:, rate]


def _as_they_are(layout: SceneLayout, vectors: Float2D) -> NDArray[Any]:
    return vectors
