"""Replay buffers whose batches mix what happened with what was imagined."""

from __future__ import annotations

from typing import Any

import torch
from gymnasium import spaces
from stable_baselines3.common.buffers import DictReplayBuffer, NStepReplayBuffer, ReplayBuffer

from relgym.envs.arguments import checked_count
from relgym.errors import ConfigError
from relgym.wrappers.dyna.imagination import Imagined
from relgym.wrappers.dyna.lens import Observations, picked

__all__ = ["MixedDictReplayBuffer", "MixedNStepReplayBuffer", "MixedReplayBuffer", "Mixing", "replay_options"]


class Mixing:
    """Gives a replay buffer of Stable-Baselines3 a second one beside it, for imagined transitions.

    What the algorithm collects goes into the buffer itself, as ever. While `accepted`, batches hold a share of
    `real_ratio` of it, and the rest comes from `imagined`.

    Attributes
    ----------
    imagined
        A plain buffer of the same kind for a single stream: dream after dream, as one env's episodes.
    accepted : bool
        Whether batches are mixed.
    real_ratio : float
        Share of real transitions, 0 to 1.
    """

    plain: Any = None
    """The buffer class of Stable-Baselines3 that is extended."""

    def __init__(self, buffer_size: int, *spaces_and_device: Any, **options: Any) -> None:
        super().__init__(buffer_size, *spaces_and_device, **options)  # type: ignore[call-arg]
        self.accepted = False
        self.real_ratio = 0.05
        self._device = spaces_and_device[2:3] or (options.get("device", "auto"),)
        self._spaces = spaces_and_device[:2]
        self._options = {name: value for name, value in options.items() if name in ("n_steps", "gamma")}
        self.imagined: Any = self._twin(1)

    def hold(self, capacity: int) -> None:
        """Make room for so many imagined transitions; those there were are gone."""
        self.imagined = self._twin(capacity)

    def __getstate__(self) -> dict[str, Any]:
        """What a file or a copy keeps: what happened. What was dreamed is of the model of that hour."""
        return {**self.__dict__, "accepted": False, "imagined": self._twin(1)}

    def _twin(self, capacity: int) -> Any:
        return self.plain(capacity, *self._spaces, device=self._device[0], n_envs=1, **self._options)

    def imagine(self, found: Imagined) -> None:
        """Store imagined transitions: scaled actions, and cuts as time limits, from which values bootstrap."""
        over = found.terminated | found.cut
        for k in range(len(found)):
            self.imagined.add(
                _row(found.observations, k),
                _row(found.next_observations, k),
                found.actions[k : k + 1],
                found.rewards[k : k + 1],
                over[k : k + 1],
                [{"TimeLimit.truncated": bool(found.cut[k])}],
            )

    def sample(self, batch_size: int, env: Any = None) -> Any:
        """A batch; mixed while the model is accepted and something was imagined."""
        real = batch_size
        if self.accepted and self.imagined.size() > self._options.get("n_steps", 1):
            real = round(self.real_ratio * batch_size) if super().size() else 0  # type: ignore[misc]
        if real == batch_size:
            return super().sample(batch_size, env=env)  # type: ignore[misc]
        dreamed = self.imagined.sample(batch_size - real, env=env)
        if real == 0:
            return dreamed
        return _mixed(super().sample(real, env=env), dreamed)  # type: ignore[misc]


class MixedReplayBuffer(Mixing, ReplayBuffer):  # type: ignore[misc]
    """`Mixing` for observations that are one array."""

    plain = ReplayBuffer


class MixedDictReplayBuffer(Mixing, DictReplayBuffer):  # type: ignore[misc]
    """`Mixing` for Dict observations."""

    plain = DictReplayBuffer


class MixedNStepReplayBuffer(Mixing, NStepReplayBuffer):  # type: ignore[misc]
    """`Mixing` for n-step returns: they run along dreams, and end where these end."""

    plain = NStepReplayBuffer


def replay_options(
    observation_space: spaces.Space[Any], *, n_steps: int = 1, gamma: float = 0.99
) -> dict[str, Any]:
    """Arguments for an off-policy algorithm of Stable-Baselines3 that make its batches ready to be mixed.

    Parameters
    ----------
    observation_space
        The agent's.
    n_steps
        Steps of n-step returns; given here instead of to the algorithm.
    gamma
        The algorithm's discount.

    Raises
    ------
    ConfigError
        n-step returns with Dict observations, which Stable-Baselines3 doesn't know, or ``n_steps < 1``.
    """
    n_steps = checked_count("n_steps", n_steps, 1, 10**6)
    is_dict = isinstance(observation_space, spaces.Dict)
    if is_dict and n_steps > 1:
        raise ConfigError(
            f"n_steps={n_steps} with Dict observations: Stable-Baselines3 has no such buffer; flatten the "
            "observations or take n_steps=1"
        )
    if n_steps > 1:
        return {
            "replay_buffer_class": MixedNStepReplayBuffer,
            "replay_buffer_kwargs": {"n_steps": n_steps, "gamma": gamma},
        }
    return {"replay_buffer_class": MixedDictReplayBuffer if is_dict else MixedReplayBuffer}


def _row(seen: Observations, k: int) -> Any:
    return picked(seen, slice(k, k + 1))


def _mixed(real: Any, dreamed: Any) -> Any:
    """Two batches as one: their records' fields joined."""
    return type(real)(*map(_concatenated, real, dreamed))


def _concatenated(a: Any, b: Any) -> Any:
    if a is None:
        return None
    if isinstance(a, dict):
        return {key: torch.cat([a[key], b[key]]) for key in a}
    return torch.cat([a, b])
