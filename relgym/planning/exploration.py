"""Where an agent hasn't been: pairs of values that no real step has shown together (§5.1)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import gymnasium as gym
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from relgym.arguments import array_of, refusing_calls
from relgym.envs.arguments import checked_count, checked_least
from relgym.envs.tasks import RewardFunctions, TaskOutcome
from relgym.errors import ConfigError
from relgym.planning.rollouts import Bonus
from relgym.planning.simulators import Correctable, Simulator, Steps
from relgym.scene.objects import POSE, TASK, Float1D, Float2D, Scene, SceneLayout
from relgym.wrappers.views import ViewLike, recordable, view_of

__all__ = ["Coverage", "Explore", "Familiar", "NoTask", "relative_columns"]

_OCTAVES: Final = 6
"""Values are told apart by sign and power of two, down to this many powers below the largest one seen; below it they
count as zero. Conditions of modes lie at zero more often than anywhere else, so near it the cells are small."""

_PATIENCE: Final = 10
"""Visits after which a pair of values is known, whatever happens there: more examples than a new mode needs, and where
so many teach nothing, as in noise, more wouldn't."""

_PLACES: Final = POSE[:3]
"""What has a meaning only in relation to other objects: laws are the same everywhere."""


@refusing_calls(ConfigError)
class Coverage:
    """Counts which values of two properties were seen together, and what a step would add.

    A reward that is paid at the goal when the truck stands still is a mode that random play never sees; what the agent
    can know is that it never stood still there. Counting single properties would miss that (it stood still elsewhere,
    and drove over the goal), whole states never come again; pairs are what two-literal clauses are made of.

    Pairs of values at which the model was surprised the last time count as new too: there is something to learn. And
    where a step paid more than the model can account for, the surplus is expected again until it can: a mode of the
    reward takes several examples, and nobody plans to go where, for all that the model knows, nothing is paid.

    Parameters
    ----------
    columns
        What counts, of the state vectors: columns, or pairs of columns whose difference counts (`relative_columns`).
    varying
        Whether only what was seen to change from one step to the next counts, not what merely differs between episodes:
        no plan can change that.
    capacity
        Real steps that are remembered.

    Notes
    -----
    Cost: of `bonus` a table look-up for each pair of columns and each step.
    """

    def __init__(
        self,
        columns: Iterable[int | tuple[int, int]],
        *,
        varying: bool = False,
        capacity: int = 20_000,
    ) -> None:
        pairs = sorted({(c, -1) if isinstance(c, (int, np.integer)) else (c[0], c[1]) for c in columns})
        if any(first < 0 or second < -1 for first, second in pairs):
            raise ConfigError(
                f"columns={columns!r}: expected numbers of columns, 0 and above, or pairs of them"
            )
        self._plus = np.array([first for first, _ in pairs], dtype=np.intp)
        self._minus = np.array([second for _, second in pairs], dtype=np.intp)
        self._capacity = checked_count("capacity", capacity, 1, 10**9)
        self._seen: list[tuple[Float1D, bool, float, float]] = []
        self._paid: dict[bytes, tuple[float, int]] = {}
        self._largest = np.zeros(len(pairs))
        self._varying = varying
        self._active = (
            np.zeros(len(pairs), dtype=np.bool_) if varying else np.ones(len(pairs), dtype=np.bool_)
        )
        self._lay_out()

    def __len__(self) -> int:
        return len(self._seen)

    def add(
        self,
        state: Float1D,
        *,
        before: Float1D | None = None,
        surprised: bool = False,
        surplus: float = 0.0,
        paid: float = 0.0,
    ) -> None:
        """Take note of a state that a real step led to.

        Parameters
        ----------
        state
            Shape ``(width,)``.
        before
            The state before the step; tells what varies.
        surprised
            Whether the model had predicted something else, or nothing.
        surplus
            What was paid beyond what the model had predicted.
        paid
            What was paid in all: where the model is right about as much as the surplus was, it accounts for it.
        """
        if not isinstance(surprised, (bool, np.bool_)):
            raise ConfigError(f"surprised={surprised!r}: expected True or False")
        row = self._values(self._checked([state]))[0]
        last = None if before is None else self._values(self._checked([before]))[0]
        surplus, paid = (
            float(array_of(what, given, (), ConfigError))
            for what, given in (("surplus", surplus), ("paid", paid))
        )
        self._seen.append((row, surprised, surplus, paid))
        sizes = np.exp2(np.ceil(np.log2(np.maximum(np.abs(row), 1e-300))))
        moved = np.zeros(len(row), dtype=np.bool_)
        if self._varying and last is not None:
            moved = np.abs(row - last) > 1e-9 * np.maximum(1.0, np.abs(row))
        fresh = moved & ~self._active
        if (sizes > self._largest).any() or fresh.any() or len(self._seen) > self._capacity:
            self._largest = np.maximum(self._largest, np.where(row == 0.0, 0.0, sizes))
            self._active |= fresh
            del self._seen[: -self._capacity]
            self._lay_out()
            for lesson in self._seen:
                self._count(*lesson)
        else:
            self._count(row, surprised, surplus, paid)

    def novelty(self, states: Float2D) -> Float1D:
        """Share of the pairs of values that were never seen together or surprised, of n states; shape ``(n,)``."""
        states = self._checked(states)
        if not len(self._first):
            return np.zeros(len(states))
        cells = self._cells(self._values(states))[:, self._active]
        at = np.arange(len(self._first)), cells[:, self._first], cells[:, self._second]
        fresh: Float1D = ((self._counts[at] == 0) | self._open[at]).mean(axis=1)
        return fresh

    def familiar(self, states: Float2D) -> NDArray[np.bool_]:
        """Whether every value of n states, each by itself, was seen before; shape ``(n,)``."""
        states = self._checked(states)
        alone = np.flatnonzero(self._first == self._second)
        if not len(alone):
            return np.ones(len(states), dtype=np.bool_)
        cells = self._cells(self._values(states))[:, self._active]
        seen = self._counts[alone, cells, cells] > 0
        return np.asarray(seen.all(axis=1), dtype=np.bool_)

    def surplus(self, states: Float2D) -> Float1D:
        """What is expected beyond what the model can account for, of n states; shape ``(n,)``.

        The mean over the visits to the same values of all properties, until the model accounts for it.
        """
        states = self._checked(states)
        found = np.zeros(len(states))
        if self._paid:
            cells = self._cells(self._values(states))[:, self._active].astype(np.int8)
            for key, (total, visits) in self._paid.items():
                found[(cells == np.frombuffer(key, dtype=np.int8)).all(axis=1)] = max(0.0, total / visits)
        return found

    def bonus(self, weight: float) -> Bonus:
        """A `Bonus` that pays `weight` times the novelty of the next state, and its surplus."""
        return _Paid(self, weight)

    def _lay_out(self) -> None:
        """Empty tables for the pairs of what counts; a column with itself: the values alone."""
        self._first, self._second = np.triu_indices(int(self._active.sum()), k=0)
        shape = (len(self._first), 2 * _OCTAVES + 3, 2 * _OCTAVES + 3)
        self._paid.clear()
        self._counts, self._open = np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.bool_)

    def _count(self, row: Float1D, surprised: bool, surplus: float, paid: float) -> None:
        cells = self._cells(row[None])[0, self._active]
        at = np.arange(len(self._first)), cells[self._first], cells[self._second]
        self._counts[at] += 1
        self._open[at] = surprised & (self._counts[at] < _PATIENCE)
        key = cells.astype(np.int8).tobytes()
        total, visits = self._paid.pop(key, (0.0, 0))
        # Cells are coarse: other visits may have nothing to do with what was paid.
        if visits and not surprised and paid >= 0.5 * total / visits > 0.0:  # accounted for by now
            return
        if visits or surplus > 1e-6:
            self._paid[key] = total + surplus, visits + 1

    def _checked(self, states: Any) -> Float2D:
        """`states` as an array; `ConfigError` unless they have all columns that count."""
        found = array_of("states", states, (None, None), ConfigError)
        width = 1 + max(self._plus.max(initial=-1), self._minus.max(initial=-1))
        if found.shape[1] < width:
            raise ConfigError(f"states: expected shape (n, {width}) or wider, got {found.shape}")
        return found

    def _values(self, states: Float2D) -> Float2D:
        values = states[:, self._plus]
        if (related := self._minus >= 0).any():
            values[:, related] -= states[:, self._minus[related]]
        return values

    def _cells(self, rows: Float2D) -> NDArray[np.intp]:
        """The cell of each value: sign and power of two below the largest, one more beyond it; shape of `rows`."""
        size = np.where(self._largest > 0.0, self._largest, 1.0)
        with np.errstate(divide="ignore"):
            octave = np.floor(np.log2(np.abs(rows) / size)) + _OCTAVES + 1
        level = np.clip(octave, 0, _OCTAVES + 1).astype(np.intp)
        found: NDArray[np.intp] = _OCTAVES + 1 + np.sign(rows).astype(np.intp) * level
        return found


@dataclass(frozen=True, slots=True)
class _Paid:
    """What `Coverage.bonus` returns; no closure, so that agents can be copied and pickled in mid-life."""

    coverage: Coverage
    weight: float

    def __call__(self, states: Float2D, actions: NDArray[Any], following: Float2D) -> Float1D:
        paid: Float1D = self.weight * self.coverage.novelty(following) + self.coverage.surplus(following)
        return paid


class NoTask(RewardFunctions):
    """No step is worth anything, and none ends an episode: for agents that only want to know."""

    def evaluate(self, layout: SceneLayout, before: Float2D, actions: Any, after: Float2D) -> TaskOutcome:
        """Nothing, of n steps."""
        never = np.zeros(len(before), dtype=np.bool_)
        return TaskOutcome(np.zeros(len(before)), never, never)


@refusing_calls(ConfigError)
class Familiar:
    """A simulator that knows the outcomes only of steps into what is familiar: for agents that must not err.

    A law says what will happen where nothing like it was ever seen, too: that the road goes on behind the edge. So
    steps to values that no real step has shown (`Coverage.familiar`), such as a distance smaller than any so far,
    count as of unknown outcome.

    Parameters
    ----------
    simulator
        What predicts.
    coverage
        What was seen; live.
    """

    def __init__(self, simulator: Simulator, coverage: Coverage) -> None:
        self._simulator, self._coverage = simulator, coverage

    @property
    def action_space(self) -> gym.spaces.Space[Any]:
        """Space of one action."""
        return self._simulator.action_space

    @property
    def observation_space(self) -> gym.spaces.Space[Any]:
        """Space of one observation."""
        return self._simulator.observation_space

    def state(self, observation: Any) -> Float1D:
        """State vector that an observation (or a `Scene`) shows."""
        return self._simulator.state(observation)

    def prepare(self) -> None:
        """As the simulator's."""
        self._simulator.prepare()

    def corrected(self, error: Float1D | None, *, guesses: bool = False) -> Simulator:
        """As the simulator's, if it can be corrected; what isn't familiar stays of unknown outcome."""
        own = self._simulator
        return (
            Familiar(own.corrected(error, guesses=guesses), self._coverage)
            if isinstance(own, Correctable)
            else self
        )

    def step(self, states: Float2D, actions: NDArray[Any]) -> Steps:
        """Follow n actions from n states."""
        stepped = self._simulator.step(states, actions)
        known = stepped.known & self._coverage.familiar(stepped.states)
        after = np.where(known[:, None], stepped.states, states)
        return Steps(after, np.where(known, stepped.rewards, 0.0), stepped.terminated & known, known)


@refusing_calls(ConfigError)
class Explore(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Says of every step how new the scene is that it led to: for agents of any kind, and for collecting data.

    The novelty, in [0, 1], is in ``info["novelty"]``; with a `weight` so many times as much is added to the reward.

    Parameters
    ----------
    env
        As for `relgym.wrappers.ModelLearner`.
    weight
        Of the novelty in the reward; 0: rewards stay as they are.
    view
        How observations become scenes, as for `relgym.wrappers.ModelLearner`.

    Attributes
    ----------
    coverage : Coverage or None
        What has been seen; made with the first step.

    Examples
    --------
    >>> import gymnasium as gym, relgym
    >>> from relgym.planning import Explore
    >>> env = Explore(gym.make("relgym/TruckPush-v0"), weight=0.1)
    >>> _ = env.reset(seed=0)
    >>> *_, info = env.step(env.action_space.sample())
    >>> 0.0 <= info["novelty"] <= 1.0
    True
    """

    def __init__(self, env: gym.Env[Any, Any], *, weight: float = 0.0, view: ViewLike = None) -> None:
        RecordConstructorArgs.__init__(self, weight=weight, view=recordable(view))
        gym.Wrapper.__init__(self, env)
        self.weight = checked_least("weight", weight, 0.0)
        self.view = view_of(env, view)
        self.coverage: Coverage | None = None
        self._scene: Scene | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._scene = self.view.scene(observation, info)
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Step the env, and compare with all that was seen."""
        if self._scene is None:
            raise ResetNeeded("no current scene: call reset() first")
        observation, reward, terminated, truncated, info = self.env.step(action)
        before, after = self._scene, self.view.scene(observation, info, last=self._scene)
        self._scene = after
        if self.coverage is None:
            every = {(t.name, prop) for t in after.layout.types for prop in t.properties}
            self.coverage = Coverage(relative_columns(after.layout, every), varying=True)
            self._layout = after.layout
        novelty = 0.0
        if after.layout == self._layout:
            novelty = float(self.coverage.novelty(after.vector[None])[0])
            known = before.layout == self._layout
            self.coverage.add(after.vector, before=before.vector if known else None)
        paid = float(reward) + self.weight * novelty if self.weight else reward
        return observation, paid, terminated, truncated, {**info, "novelty": novelty}


def relative_columns(layout: SceneLayout, moving: set[tuple[str, str]]) -> list[int | tuple[int, int]]:
    """What tells situations apart: the properties that may change, but of places how far objects are from one another.

    Parameters
    ----------
    layout
        Of the scenes.
    moving
        (type, property) pairs that may change.

    Returns
    -------
    Columns, and pairs of columns whose difference counts. The place of an object that has no other beside it, such as
    that of one pendulum, counts itself.
    """
    found: list[int | tuple[int, int]] = []
    placed = [k for k, t in enumerate(layout.types) if t.has_body]
    for k, t in enumerate(layout.types):
        for prop in t.properties:
            if t.name == TASK or (t.name, prop) not in moving:
                continue
            column = layout.column(k, prop)
            if prop not in _PLACES or not t.has_body or len(placed) < 2:
                found.append(column)
                continue
            for other in placed:
                # Of two that move one difference is enough.
                both = (layout.types[other].name, prop) in moving
                if other != k and not (both and other < k):
                    found.append((column, layout.column(other, prop)))
    return found
