"""Model roll-outs by the hundred: a policy acts in predicted scenes, and a reward model gives rewards and ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.errors import ConfigError
from relgym.scene.objects import ACTION, Float2D, SceneLayout
from relgym.wrappers.dyna.lens import Lens, Observations, picked
from relgym.wrappers.dyna.reward_models import RewardModel, check_rewards
from relgym.wrappers.dyna.stock import DreamModel

__all__ = ["Imagination", "Imagined", "Policy"]

Policy: TypeAlias = Callable[[Observations], tuple[NDArray[Any], NDArray[Any]]]
"""From n observations to n actions, as the env takes them and as a replay buffer keeps them."""


@dataclass(frozen=True, slots=True)
class Imagined:
    """Imagined transitions, dream after dream, each in the order of its steps.

    Attributes
    ----------
    observations, next_observations
        What the agent saw, m rows.
    actions
        As a replay buffer keeps them, m rows.
    rewards
        Shape ``(m,)``.
    terminated
        Where the task said that the episode was over, shape ``(m,)``.
    cut
        Where a roll-out was truncated: at the horizon, or where the model made no prediction. Shape ``(m,)``.
    known
        Share of the decisions that the model could predict.
    """

    observations: Observations
    next_observations: Observations
    actions: NDArray[Any]
    rewards: NDArray[np.float64]
    terminated: NDArray[np.bool_]
    cut: NDArray[np.bool_]
    known: float

    def __len__(self) -> int:
        return len(self.rewards)


@dataclass(frozen=True, slots=True)
class _Step:
    """One decision in all dreams that went on: their numbers, and what happened."""

    dreams: NDArray[np.intp]
    seen: Observations
    following: Observations
    actions: NDArray[Any]
    rewards: NDArray[np.float64]
    ended: NDArray[np.bool_]


class Imagination:
    """Follows a policy through a model's dreams.

    Parameters
    ----------
    model
        Predicts what follows; used as it is, live.
    lens
        What the agent sees and does.
    reward_model
        Reward and termination; must be finite.

    Notes
    -----
    A dream ends where the model makes no prediction or leaves the observation space: that step isn't kept, and the one
    before it counts as truncated, never as terminated. Cost: one `predict_batch` per env step for all dreams together.
    """

    def __init__(self, model: DreamModel, lens: Lens, reward_model: RewardModel) -> None:
        self.model = model
        self.lens = lens
        self.reward_model = reward_model

    def dream(
        self, layout: SceneLayout, vectors: Float2D, policy: Policy, *, horizon: int
    ) -> Imagined | None:
        """Dream on from n scenes.

        Parameters
        ----------
        layout, vectors
            Scenes without an action, shape ``(n, layout.width)``.
        policy
            Chooses the actions.
        horizon
            Decisions per dream at most, at least 1.

        Returns
        -------
        None if the model predicted no step at all.

        Raises
        ------
        ConfigError
            A horizon below 1, or a reward that isn't finite.
        """
        if horizon < 1:
            raise ConfigError(f"horizon={horizon!r}: expected at least 1 decision")
        alive = np.arange(len(vectors))
        seen = self.lens.observations(layout, vectors)
        steps: list[_Step] = []
        asked = 0
        for _ in range(horizon):
            asked += len(alive)
            step, vectors = self._decide(layout, vectors, alive, seen, policy)
            steps.append(step)
            going = ~step.ended
            alive, vectors, seen = step.dreams[going], vectors[going], picked(step.following, going)
            if not len(alive):
                break
        return _collected(steps, asked)

    def _decide(
        self,
        layout: SceneLayout,
        vectors: Float2D,
        dreams: NDArray[np.intp],
        seen: Observations,
        policy: Policy,
    ) -> tuple[_Step, Float2D]:
        """One decision in every dream; those that the model can't predict drop out."""
        actions, kept = policy(seen)
        after, rewards, ended, known = self.follow(layout, vectors, self.lens.actions(actions))
        following = self.lens.observations(layout, after)
        after, rewards, ended = after[known], rewards[known], ended[known]
        step = _Step(
            dreams[known], picked(seen, known), picked(following, known), kept[known], rewards, ended
        )
        return step, after

    def follow(
        self, layout: SceneLayout, vectors: Float2D, actions: NDArray[Any]
    ) -> tuple[Float2D, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_]]:
        """The scenes after a decision.

        Parameters
        ----------
        layout, vectors
            Scenes without an action, shape ``(n, layout.width)``.
        actions
            Of the bare env, n rows.

        Returns
        -------
        State vectors, rewards, where the episode ended, and where the model made a prediction; elsewhere the state
        stays as it was.
        """
        after, rewards = vectors.copy(), np.zeros(len(vectors))
        ended, known = np.zeros(len(vectors), dtype=bool), np.ones(len(vectors), dtype=bool)
        for _ in range(self.lens.repeat):
            going = np.flatnonzero(known & ~ended)
            if not len(going):
                break
            before, done = after[going], actions[going]
            following, predicted = self._predict(layout, before, done)
            evaluated = self.reward_model.evaluate(layout, before, done, following)
            if getattr(self.reward_model, "learned", False):
                predicted &= np.isfinite(evaluated.rewards)
            check_rewards(evaluated.rewards[predicted], self.reward_model)
            after[going] = np.where(predicted[:, None], following, before)
            rewards[going] += np.where(predicted, evaluated.rewards, 0.0)
            ended[going], known[going] = evaluated.terminated & predicted, predicted
        return after, rewards, ended, known

    def _predict(
        self, layout: SceneLayout, vectors: Float2D, actions: NDArray[Any]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        whole, joined = self.lens.acting(layout, vectors, actions)
        found = self.model.predict_batch(whole, joined)
        after = found.vectors
        if whole is not layout:
            after = np.delete(after, whole.slice(whole.index(ACTION)), axis=1)
        return after, found.ok & self.lens.inside(layout, after)


def _collected(steps: list[_Step], asked: int) -> Imagined | None:
    """The steps in the order of their dreams; the last of each that didn't terminate counts as truncated."""
    dreams = np.concatenate([step.dreams for step in steps])
    if not len(dreams):
        return None
    order = np.argsort(dreams, kind="stable")
    ended = np.concatenate([step.ended for step in steps])[order]
    last = np.append(dreams[order][1:] != dreams[order][:-1], True)
    return Imagined(
        _joined([step.seen for step in steps], order),
        _joined([step.following for step in steps], order),
        np.concatenate([step.actions for step in steps])[order],
        np.concatenate([step.rewards for step in steps])[order],
        ended,
        last & ~ended,
        len(dreams) / asked,
    )


def _joined(parts: list[Observations], order: NDArray[np.intp]) -> Observations:
    first = parts[0]
    if isinstance(first, dict):
        return {
            key: np.concatenate([part[key] for part in parts if isinstance(part, dict)])[order]
            for key in first
        }
    return np.concatenate([np.asarray(part) for part in parts])[order]
