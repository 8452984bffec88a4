"""A policy that plans: it follows its plan while the world does what the model predicted, and plans anew when not."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass, replace
from time import perf_counter
from typing import Any, Final, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from relgym.arguments import refusing_calls
from relgym.envs.arguments import checked_count
from relgym.errors import ConfigError
from relgym.planning.actions import ActionCoder
from relgym.planning.rollouts import Objective, Plan, roll_out
from relgym.planning.sequences import Search
from relgym.planning.simulators import Correctable, Simulator
from relgym.planning.tree import TreeSearch
from relgym.scene.objects import Float1D

__all__ = ["Planner", "PlannerState"]


_TRIED: Final = 256
"""Actions among which one of known outcome is looked for."""


@dataclass
class PlannerState:
    """How far one episode's plan has come; what `Planner.predict` returns beside the action.

    Attributes
    ----------
    plan
        What is being followed; None before the first decision.
    taken
        Decisions taken of it.
    decisions
        Taken in this episode.
    searches, surprises
        How often the planner has searched, and how often because the world did something else than predicted.
    error
        By how much the state was off the simulator's prediction at the last surprise, shape ``(width,)``; None before
        the first one, and where the simulator was right after all.
    last
        State and action of the last decision.
    due
        Decisions of the plan after which there is another search.
    """

    plan: Plan | None = None
    taken: int = 0
    decisions: int = 0
    searches: int = 0
    surprises: int = 0
    error: Float1D | None = None
    last: tuple[Float1D, Any] | None = None
    due: int = 0


States: TypeAlias = tuple[Any, ...]
"""What Stable-Baselines3 hands from one call of ``predict`` to the next: one `PlannerState` for each env."""


@refusing_calls(ConfigError)
@dataclass
class Planner:
    """Acts by searching in what a simulator predicts.

    Parameters
    ----------
    simulator
        Where to search: `ModelSimulator`, `EnvSimulator`, or anything with their methods.
    search
        How; default: `TreeSearch`.
    objective
        What for; default: the sum of rewards.
    commit
        Decisions of a plan that are taken before the next search; default: half the search's horizon. Of a plan that
        ends the episode always half of what is left: a search from nearer by hits a narrow goal more often, and the
        plan goes on where that finds nothing better. A surprise is followed by a search at once.
    tolerance
        How far a property may be off its prediction without a surprise, relative to its size (absolute below 1).
    limit
        Decisions after which episodes are cut short, if that is known: no plan lasts longer.
    seconds
        Time for one search; None: all its rounds.
    safe
        Never to take an action whose outcome the simulator doesn't know while it knows that of another one; nor to
        guess.
    adapts
        Whether to correct a `Correctable` simulator: much of what a law misses, a friction or a wind, stays the same
        for an episode, so by as much as the last prediction was off the next ones are taken to be off as well (offset-
        free predictive control, Pannocchia and Rawlings 2003). And where it knows the outcome of no action, to plan
        with its guesses.
    source
        Function from an observation to the scene (or observation of the model's env) that it shows; for agents whose
        wrappers hide part of it: ``lambda _: env.get_wrapper_attr("scene")``. Default: the observation itself.
    seed
        Of the candidates.

    Examples
    --------
    >>> import gymnasium as gym, relgym
    >>> from relgym.planning import CrossEntropy, EnvSimulator, Planner
    >>> env = gym.make("relgym/TruckPush-v0")
    >>> planner = Planner(EnvSimulator(env), search=CrossEntropy(candidates=16, rounds=1))
    >>> observation, info = env.reset(seed=0)
    >>> action, state = planner.predict(observation)
    >>> env.action_space.contains(action)
    True

    Notes
    -----
    `predict` has the signature of Stable-Baselines3's policies, so `evaluate_policy` and other loops take a planner for
    one. The action is the plan's, whatever `deterministic` says.
    """

    simulator: Simulator
    search: Search = field(default_factory=TreeSearch)
    objective: Objective = field(default_factory=Objective)
    commit: int | None = None
    tolerance: float = 1e-6
    limit: int | None = None
    seconds: float | None = None
    safe: bool = False
    adapts: bool = True
    source: Callable[[Any], Any] | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        if not isinstance(self.simulator, Simulator):
            raise ConfigError(
                f"simulator={self.simulator!r}: expected a ModelSimulator(model), an EnvSimulator(env), or an object "
                "with action_space, observation_space, state, prepare and step"
            )
        for name in ("commit", "limit"):
            if getattr(self, name) is not None:
                checked_count(name, getattr(self, name), 1, 10**9)
        for name in ("tolerance", "seconds"):
            value = getattr(self, name)
            if value is not None and not (isinstance(value, (int, float)) and 0.0 <= value < np.inf):
                raise ConfigError(f"{name}={value!r}: expected a finite number of at least 0")
        self.coder = ActionCoder(self.simulator.action_space)
        self._rng = np.random.default_rng(checked_count("seed", self.seed, 0, 2**63))

    def predict(
        self,
        observation: Any,
        state: States | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Any, States]:
        """Choose an action for an observation, or one for each of a batch.

        Parameters
        ----------
        observation
            One, or a batch with a leading axis as vector envs give it.
        state
            What the last call returned; None: episodes begin.
        episode_start
            Where an episode begins, shape ``(n,)``; plans of the last one are forgotten there.
        deterministic
            Without meaning here.

        Returns
        -------
        The action or actions, and the state for the next call.

        Raises
        ------
        ObservationError
            The simulator can't read the observation.
        """
        count = self._batch(observation)
        if count == 0:
            raise ConfigError("observation: a batch of none; expected at least one observation")
        seen = [observation] if count is None else [_picked(observation, k) for k in range(count)]
        begun = np.zeros(len(seen), dtype=np.bool_) if episode_start is None else np.asarray(episode_start)
        if begun.size != len(seen) or (state is not None and len(state) != len(seen)):
            raise ConfigError(
                f"state and episode_start: expected one for each of {len(seen)} observations, as the last call returned"
            )
        threads = [
            PlannerState() if state is None or begun.reshape(-1)[k] else state[k] for k in range(len(seen))
        ]
        actions = [self.act(one, thread) for one, thread in zip(seen, threads, strict=True)]
        return (actions[0] if count is None else np.stack(actions)), tuple(threads)

    def act(self, observation: Any, thread: PlannerState) -> Any:
        """Choose an action for one observation, and note in `thread` how far the plan has come."""
        shown = observation if self.source is None else self.source(observation)
        now = self.simulator.state(shown)
        plan = self._kept(thread, now)
        if plan is None or thread.taken >= thread.due:
            plan = self._looked_again(plan, thread, now)
        action = plan.actions[thread.taken]
        if self.safe and thread.taken >= len(plan.rewards):
            action = self._known(now, action)
        thread.taken += 1
        thread.decisions += 1
        thread.last = now, action
        return action

    def plan(
        self,
        now: Float1D,
        *,
        warm: NDArray[np.float64] | None = None,
        left: int | None = None,
        error: Float1D | None = None,
    ) -> Plan:
        """Search from a state vector.

        Parameters
        ----------
        now
            The state, shape ``(width,)``.
        warm
            Latents to begin with.
        left
            Decisions that the episode still has.
        error
            What is added to the states that a `Correctable` simulator predicts.
        """
        self.simulator.prepare()
        given: Any = self.search  # of any class
        search: Search = given
        if left is not None and left < search.horizon and is_dataclass(given):
            search = cast(Search, replace(cast(Any, given), horizon=left))
            warm = None if warm is None else warm[:left]
        deadline = None if self.seconds is None else perf_counter() + self.seconds

        def searched(simulator: Simulator) -> Plan:
            return search.plan(
                simulator, self.coder, now, self.objective, warm=warm, rng=self._rng, deadline=deadline
            )

        found = searched(self._advised(error))
        guesses = self.adapts and not self.safe and self.objective.curiosity is None
        if len(found.rewards) or not guesses or not isinstance(self.simulator, Correctable):
            return found
        return searched(self._advised(error, guesses=True))

    def _off(self, thread: PlannerState, now: Float1D) -> Float1D | None:
        """By how much the simulator was off in the last decision; None where it wasn't."""
        if thread.last is None or not (self.adapts and isinstance(self.simulator, Correctable)):
            return None
        before, action = thread.last
        self.simulator.prepare()
        guess = self.simulator.corrected(None, guesses=True).step(before[None], np.asarray(action)[None])
        if not guess.known[0] or guess.states[0].shape != now.shape:
            return None
        off: Float1D = now - guess.states[0]
        off[np.abs(off) <= self.tolerance * np.maximum(1.0, np.abs(now))] = 0.0
        return off if off.any() else None

    def _known(self, now: Float1D, otherwise: Any) -> Any:
        """The best of some random actions whose outcomes are known; if there is none, the one that was to be taken."""
        drawn = self._rng.standard_normal((_TRIED, self.coder.size))
        drawn[0] = 0.0  # the middle of the action space: to do nothing, in many a world
        actions = self.coder.actions(drawn)
        stepped = self.simulator.step(np.repeat(now[None], _TRIED, axis=0), actions)
        if not stepped.known.any():
            return otherwise
        return actions[int(np.where(stepped.known, stepped.rewards, -np.inf).argmax())]

    def _kept(self, thread: PlannerState, now: Float1D) -> Plan | None:
        """The plan if it can go on: it isn't used up, and the world did what it said."""
        plan, taken = thread.plan, thread.taken
        if plan is None:
            return None
        if taken < len(plan.states):
            if self._as_expected(now, plan.states[taken]):
                return plan if taken < len(plan.actions) else None
            thread.surprises += 1
        thread.error = self._off(thread, now)
        return None

    def _as_expected(self, now: Float1D, expected: Float1D) -> bool:
        if now.shape != expected.shape:  # objects have come or gone
            return False
        return bool((np.abs(now - expected) <= self.tolerance * np.maximum(1.0, np.abs(expected))).all())

    def _looked_again(self, kept: Plan | None, thread: PlannerState, now: Float1D) -> Plan:
        """Search; what is found takes the place of a plan that can go on if it is better."""
        warm = None if thread.plan is None else thread.plan.latents[thread.taken :]
        left = None if self.limit is None else max(1, self.limit - thread.decisions)
        found = self.plan(now, warm=warm, left=left, error=thread.error)
        thread.searches += 1
        # Of plans that don't end the episode one that begins now looks further ahead.
        if kept is not None and kept.terminates:
            actions = kept.actions[None, thread.taken :]
            rest = roll_out(self._advised(thread.error), now, actions, self.objective)
            if rest.worth[0] >= found.worth:
                thread.due += max(1, (len(kept) - thread.due) // 2)
                return kept
        thread.plan, thread.taken = found, 0
        thread.due = self.commit or max(1, self.search.horizon // 2)
        if found.terminates:
            thread.due = max(1, len(found) // 2)
        return found

    def _advised(self, error: Float1D | None, *, guesses: bool = False) -> Simulator:
        """The simulator, corrected if it can be."""
        own = self.simulator
        if (error is None and not guesses) or not isinstance(own, Correctable):
            return own
        return own.corrected(error, guesses=guesses)

    def _batch(self, observation: Any) -> int | None:
        """How many observations there are; None: one, without a leading axis."""
        if self.source is not None:
            return (
                None if not isinstance(observation, np.ndarray) or observation.ndim < 2 else len(observation)
            )
        space: Any = self.simulator.observation_space
        one: Any = observation
        while isinstance(parts := getattr(space, "spaces", None), Mapping | Sequence) and parts:
            named = isinstance(parts, Mapping)
            name = next(iter(parts)) if named else 0  # what tells of one part tells of all
            if not isinstance(one, Mapping if named else tuple):
                return None
            if name not in (one if named else range(len(one))):
                return None
            space, one = parts[name], one[name]
        if not isinstance(one, np.ndarray) or one.ndim != len(space.shape or ()) + 1:
            return None
        return len(one)


def _picked(observation: Any, k: int) -> Any:
    if isinstance(observation, Mapping):
        return {name: _picked(part, k) for name, part in observation.items()}
    if isinstance(observation, tuple):
        return tuple(_picked(part, k) for part in observation)
    return observation[k]
