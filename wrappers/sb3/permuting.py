"""Data augmentation without a model: what happened, with objects of one type renamed."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from stable_baselines3.common.callbacks import BaseCallback

from relgym.errors import ConfigError
from relgym.scene.objects import ACTION, TASK, SceneLayout
from relgym.wrappers.dyna.imagination import Imagined
from relgym.wrappers.dyna.recorder import Experience
from relgym.wrappers.sb3.dyna import check_algorithm, lens_of

__all__ = ["PermutedReplay"]


class PermutedReplay(BaseCallback):  # type: ignore[misc]
    """Stores every real transition several times more, with objects of the same type renamed.

    This holds without a model: names of objects mean nothing. Exchanging which object stands where needs a model
    (`relgym.wrappers.dyna.stock.permuted`).

    Parameters
    ----------
    copies
        Renamed transitions per real one, >= 1.
    capacity
        How many are kept.
    seed
        Draws the names.
    like
        As for `Dyna`.
    """

    def __init__(
        self,
        *,
        copies: int = 4,
        capacity: int = 1_000_000,
        seed: int = 0,
        like: gym.Env[Any, Any] | None = None,
    ) -> None:
        super().__init__()
        self.copies, self.capacity = copies, capacity
        self._rng = np.random.default_rng([seed, 2])
        self._like = like
        self._mixed: Any = None

    def _init_callback(self) -> None:
        check_algorithm(self.model)
        self._lens = lens_of(self.training_env, self._like)
        buffer: Any = self.model.replay_buffer
        if getattr(buffer, "n_steps", 1) > 1:
            raise ConfigError("renamed transitions stand alone and give no n-step returns: take n_steps=1")
        if self._mixed is not buffer:  # another agent's, or one that was loaded
            buffer.hold(min(self.capacity, self.copies * buffer.buffer_size))
            self._mixed = buffer
        buffer.real_ratio = 1.0 / (1.0 + self.copies)
        buffer.accepted = True

    def _on_training_start(self) -> None:
        self.training_env.env_method("take")  # made by somebody else, before: not what is stored now

    def _on_training_end(self) -> None:
        self.model.replay_buffer.accepted = False  # without this callback nobody adds to the renamed

    def _on_step(self) -> bool:
        scaled, rewards, dones = (self.locals[name] for name in ("buffer_actions", "rewards", "dones"))
        if (normalise := self.model.get_vec_normalize_env()) is not None:  # batches are normalised when drawn
            rewards = normalise.get_original_reward()
        infos = self.locals["infos"]
        for k, steps in enumerate(self.training_env.env_method("take")):
            late = bool(infos[k].get("TimeLimit.truncated", False))
            ended = bool(dones[k])
            self.model.replay_buffer.imagine(
                self._renamed(steps, scaled[k], float(rewards[k]), ended and not late, ended and late)
            )
        return True

    def _renamed(
        self, steps: list[Experience], action: Any, reward: float, terminated: bool, cut: bool
    ) -> Imagined:
        """One decision under other names; it may have lasted several env steps."""
        first, last = steps[0].start, steps[-1].transition.after
        orders = _orders(first.layout, self.copies, self._rng)
        n = self.copies
        return Imagined(
            self._lens.observations(first.layout, first.vector[orders]),
            self._lens.observations(last.layout, last.vector[orders]),
            np.repeat(np.asarray(action)[None], n, axis=0),
            np.full(n, reward),
            np.full(n, terminated),
            np.full(n, cut),
            1.0,
        )


def _orders(layout: SceneLayout, n: int, rng: np.random.Generator) -> Any:
    """N permutations of a state vector's columns, shape ``(n, layout.width)``: objects of one type exchanged."""
    orders = np.tile(np.arange(layout.width), (n, 1))
    for name in dict.fromkeys(t.name for t in layout.types):
        indices = layout.of_type(name)
        if len(indices) < 2 or name in (ACTION, TASK):
            continue
        places = np.array([np.arange(layout.width)[layout.slice(i)] for i in indices])
        for row in orders:
            row[places] = places[rng.permutation(len(indices))]
    return orders
