"""Roll-outs of many sequences of actions at once, and what they are worth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.arguments import array_of, refusing_calls
from relgym.errors import ConfigError
from relgym.planning.simulators import Simulator
from relgym.scene.objects import Float1D, Float2D

__all__ = ["Bonus", "Objective", "Plan", "Rollouts", "Value", "roll_out"]

Value: TypeAlias = Callable[[Float2D], Float1D]
"""What n states are worth beyond the horizon, shape ``(n,)``."""

Bonus: TypeAlias = Callable[[Float2D, NDArray[Any], Float2D], Float1D]
"""What n steps (states, actions, next states) are worth beside their reward, shape ``(n,)``."""


@refusing_calls(ConfigError)
@dataclass(frozen=True, slots=True)
class Objective:
    """What a plan is to be good for.

    Attributes
    ----------
    discount
        Of each decision, in (0, 1].
    value
        What states at the horizon are worth; None: nothing.
    bonus
        What steps are worth beside their reward, for agents that explore; None: nothing.
    curiosity
        What a step of unknown outcome is worth; None: such a step is priced as if all that remains of the horizon paid
        the least reward that any sequence got in the same search, and one that begins with it as if it lost all. So a
        plan through what isn't known is taken only where every plan that is known is as bad.
    """

    discount: float = 1.0
    value: Value | None = None
    bonus: Bonus | None = None
    curiosity: float | None = None

    def __post_init__(self) -> None:
        if not 0.0 < self.discount <= 1.0:
            raise ConfigError(f"discount={self.discount!r}: expected a number in (0, 1]")


@dataclass(frozen=True, slots=True)
class Plan:
    """A sequence of actions and what is expected of it.

    Attributes
    ----------
    actions
        Shape ``(h, *action shape)``.
    states
        Expected state vectors, the present one first, shape ``(h + 1, width)``; one fewer where the last outcome isn't
        known.
    rewards
        Expected rewards, shape ``(h,)``; one fewer where the last outcome isn't known.
    worth
        What the search maximised.
    terminates, known
        Whether the episode is expected to end with the last action; whether every outcome is known.
    latents
        The actions as the search had them, to begin the next search with; shape ``(h, size)``.
    """

    actions: NDArray[Any]
    states: Float2D
    rewards: Float1D
    worth: float
    terminates: bool
    known: bool
    latents: Float2D

    def __len__(self) -> int:
        return len(self.actions)


@dataclass(frozen=True, slots=True)
class Rollouts:
    """n roll-outs of at most h decisions.

    Attributes
    ----------
    states
        Shape ``(h + 1, n, width)``; after its end a roll-out stays where it was.
    rewards
        Shape ``(h, n)``; 0 after the end.
    lengths
        Decisions that were followed, shape ``(n,)``; one of unknown outcome isn't counted.
    terminated, known
        How they ended, shape ``(n,)``.
    worth
        What they are worth, shape ``(n,)``.
    curious
        Whether unknown outcomes are worth something: plans then lead into them.
    """

    states: NDArray[np.float64]
    rewards: Float2D
    lengths: NDArray[np.intp]
    terminated: NDArray[np.bool_]
    known: NDArray[np.bool_]
    worth: Float1D
    curious: bool = False

    def plan(self, k: int, actions: NDArray[Any], latents: NDArray[np.float64]) -> Plan:
        """Roll-out k as a plan; its actions and latents are those of all, shape ``(n, h, …)``.

        A plan whose first outcome isn't known still has its first action.
        """
        length = int(self.lengths[k])
        leads = self.curious and not self.known[k]
        kept = max(length + leads, 1)
        return Plan(
            actions[k, :kept],
            self.states[: length + 1, k].copy(),
            self.rewards[:length, k].copy(),
            float(self.worth[k]),
            bool(self.terminated[k]),
            bool(self.known[k]),
            latents[k, :kept].copy(),
        )


def roll_out(simulator: Simulator, start: Float1D, actions: NDArray[Any], objective: Objective) -> Rollouts:
    """Follow n sequences of actions from one state.

    Parameters
    ----------
    simulator
        Where.
    start
        State vector, shape ``(width,)``.
    actions
        Shape ``(n, h, *action shape)``.
    objective
        What they are worth.

    Notes
    -----
    Cost: h calls of `Simulator.step`, each with the roll-outs that are still under way.
    """
    start = array_of("start", start, (None,), ConfigError)
    n, h = actions.shape[:2]
    states = np.empty((h + 1, n, len(start)))
    states[0] = start
    rewards, total = np.zeros((h, n)), np.zeros(n)
    lengths = np.zeros(n, dtype=np.intp)
    ended, known = np.zeros(n, dtype=np.bool_), np.ones(n, dtype=np.bool_)
    factor = 1.0
    for t in range(h):
        states[t + 1] = states[t]
        rows = np.flatnonzero(known & ~ended)
        if not len(rows):
            states[t + 2 :] = states[t]
            break
        before, acts = states[t, rows], actions[rows, t]
        stepped = simulator.step(before, acts)
        known[rows] = stepped.known
        ended[rows] = stepped.terminated & stepped.known
        followed = rows[stepped.known]
        states[t + 1, followed] = stepped.states[stepped.known]
        rewards[t, followed] = stepped.rewards[stepped.known]
        lengths[followed] += 1
        total[followed] += factor * rewards[t, followed]
        if objective.bonus is not None and len(followed):
            fresh = objective.bonus(before[stepped.known], acts[stepped.known], states[t + 1, followed])
            total[followed] += factor * fresh
        if objective.curiosity is not None:
            total[rows[~stepped.known]] += factor * objective.curiosity
        factor *= objective.discount
    total += _beyond(objective, states[-1], rewards, lengths, ended, known)
    return Rollouts(states, rewards, lengths, ended, known, total, objective.curiosity is not None)


def _beyond(
    objective: Objective,
    last: Float2D,
    rewards: Float2D,
    lengths: NDArray[np.intp],
    ended: NDArray[np.bool_],
    known: NDArray[np.bool_],
) -> Float1D:
    """What lies past the horizon, and what is lost where a roll-out left what is known."""
    h = len(rewards)
    worth = np.zeros(len(last))
    going = known & ~ended
    if objective.value is not None and going.any():
        worth[going] = objective.discount**h * objective.value(last[going])
    if objective.curiosity is None and not known.all():
        took_place = np.arange(h)[:, None] < lengths
        least = min(float(rewards[took_place].min(initial=0.0)), 0.0)
        g = objective.discount
        rest = h - lengths[~known]
        span = rest.astype(np.float64) if g == 1.0 else (1.0 - g**rest) / (1.0 - g)
        # Less than nothing even where no reward is negative: of equals the one that is known is better.
        worth[~known] = g ** lengths[~known] * span * least - 1e-9
        worth[~known & (lengths == 0)] = -np.inf  # no first step into what isn't known while another one is
    return worth
