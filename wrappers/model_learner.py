"""The learner around an env: it watches every step and changes none (design §5)."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs

from relgym.config import ModelConfig
from relgym.envs.arguments import checked_action
from relgym.envs.spaces_json import space_to_json
from relgym.errors import ConfigError
from relgym.model.prediction import ScenePrediction
from relgym.model.world_model import LearnReport, WorldModel
from relgym.scene.objects import Scene, Target, Transition
from relgym.wrappers.views import View, view_of

__all__ = ["ModelLearner", "Prequential", "StepReport"]

WRONG = 1e-9
"""A prediction off by more than this, in units of the property, counts as wrong."""

STARTS = 16
"""Scenes at which episodes began that are kept for dreams."""

Key: TypeAlias = tuple[str, str]


@dataclass(frozen=True, slots=True)
class StepReport:
    """What one step told the learner; ``info["relgym"]``.

    Attributes
    ----------
    prediction
        What the model had expected, made before it saw the outcome; None while predicting is off.
    residuals
        Observed minus predicted value of every target, by (object, property).
    wrong
        Those targets that were off by more than 1e-9, or that no mode predicted.
    learned
        What the transition taught; None while learning is paused.
    """

    prediction: ScenePrediction | None
    residuals: Mapping[Key, float]
    wrong: tuple[Key, ...]
    learned: LearnReport | None


class Prequential:
    """Test, then train: how often the model was wrong on steps it had not seen, in total and lately."""

    def __init__(self, window: int = 1000) -> None:
        self.steps = 0
        self.wrong: dict[Key, int] = {}
        self._window: deque[bool] = deque(maxlen=window)

    def count(self, wrong: Sequence[Key]) -> None:
        """Take in one step."""
        self.steps += 1
        self._window.append(bool(wrong))
        for key in wrong:
            self.wrong[key] = self.wrong.get(key, 0) + 1

    @property
    def recent(self) -> float:
        """Share of the last steps (1,000 by default) with a wrong prediction; NaN before the first."""
        return sum(self._window) / len(self._window) if self._window else float("nan")


class ModelLearner(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Learns a model of the wrapped env during roll-outs; observations, rewards and seeding pass through untouched.

    Parameters
    ----------
    env
        An env whose observations are scenes: it has a `schema`.
    targets
        What to learn: `Target` records or ``(type, property)`` pairs; default: the schema's targets, and if it names
        none, every property that changes.
    config
        Free parameters, as `ModelConfig` or as what its `to_json` gives.
    learn, predict
        Whether to learn from every step, and whether to predict it first.

    Notes
    -----
    ``env.get_wrapper_attr("model")`` is the `WorldModel`, ``prequential`` the running error. Every step's
    ``info["relgym"]`` is a `StepReport`. A new episode begins a new sequence: no transition crosses a reset. An env
    rebuilt from ``env.spec`` begins with an empty model.

    Examples
    --------
    >>> import gymnasium as gym, relgym
    >>> env = relgym.wrappers.ModelLearner(gym.make("relgym/BallBoxRamp-v0"))
    >>> _ = env.reset(seed=0)
    >>> _, _, _, _, info = env.step(0)
    >>> info["relgym"].prediction.ok
    False
    """

    def __init__(
        self,
        env: gym.Env[Any, Any],
        *,
        targets: Sequence[Target | tuple[str, str]] | None = None,
        config: ModelConfig | Mapping[str, Any] | None = None,
        learn: bool = True,
        predict: bool = True,
    ) -> None:
        if isinstance(env, gym.vector.VectorEnv):
            raise ConfigError("ModelLearner wraps a single env, got a vector env; wrap the envs inside it one by one")
        plain = config.to_json() if isinstance(config, ModelConfig) else config
        RecordConstructorArgs.__init__(self, targets=targets, config=plain, learn=learn, predict=predict)
        gym.Wrapper.__init__(self, env)
        self.view: View = view_of(env)
        wanted = None if targets is None else [t if isinstance(t, Target) else Target(*t) for t in targets]
        settings = ModelConfig() if plain is None else ModelConfig.from_json({**ModelConfig().to_json(), **plain})
        self.model = WorldModel(self.view.schema, settings, targets=wanted)
        self.learning = learn
        self.predicting = predict
        self.prequential = Prequential()
        self._observation: Any = None
        self._starts: list[Scene] = []

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode of the env; nothing is learned from the jump."""
        self._observation = None
        observation, info = self.env.reset(seed=seed, options=options)
        if len(self._starts) < STARTS:
            self._starts.append(self.view.scene(observation))
        self._observation = observation
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Predict, step the env, learn.

        Raises
        ------
        ActionError
            The action lies outside the space; neither env nor model changed.
        ObservationError
            The env gave NaN, infinity or something that isn't a scene. The env has stepped, the model is unchanged.
        """
        if self._observation is None:
            return self.env.step(action)  # raises ResetNeeded, or continues an episode that nobody watched
        checked_action(self.env.action_space, action)
        before = self.view.scene(self._observation, action)
        prediction = self.model.predict_one(before) if self.predicting else None
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._observation = None  # what follows an unreadable observation is not learned from
        after = self.view.scene(observation)
        residuals, wrong = _residuals(prediction, after)
        if prediction is not None:
            self.prequential.count(wrong)
        learned = self.model.learn_one(Transition(before, after)) if self.learning else None
        self._observation = None if terminated or truncated else observation
        report = StepReport(prediction, residuals, wrong, learned)
        return observation, reward, terminated, truncated, {**info, "relgym": report}

    def save(self, path: str | os.PathLike[str], *, history: bool = False) -> None:
        """Write the model with all that a dream needs: spaces, metadata and a few scenes at which episodes began."""
        env = self.env.unwrapped
        extra = {
            "observation_space": space_to_json(self.env.observation_space),
            "action_space": space_to_json(self.env.action_space),
            "render_fps": env.metadata.get("render_fps", 30),
            "starts": [{name: v.tolist() for name, v in scene.values().items()} for scene in self._starts],
        }
        self.model.save(path, history=history, extra=extra)


def _residuals(prediction: ScenePrediction | None, after: Scene) -> tuple[dict[Key, float], tuple[Key, ...]]:
    residuals: dict[Key, float] = {}
    wrong: list[Key] = []
    for part in prediction.parts if prediction is not None else ():
        key = (part.object, part.property)
        if part.object not in after:
            continue
        residuals[key] = after[part.object][part.property] - part.value
        if not part.ok or not np.abs(residuals[key]) <= WRONG:
            wrong.append(key)
    return residuals, tuple(wrong)
