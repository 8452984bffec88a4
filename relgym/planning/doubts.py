"""What steps are worth as far as the real ones bear it out: rewards of rules that few examples have shown."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from relgym.arguments import refusing_calls
from relgym.envs.tasks import RewardFunctions, TaskOutcome
from relgym.errors import ConfigError
from relgym.numeric.version_space import VersionSpace
from relgym.scene.objects import TASK, Float1D, Float2D, SceneLayout
from relgym.wrappers.dyna.reward_models import LearnedRewardModel

__all__ = ["DoubtedTask", "OptimisticTask"]

_RIGHT: Final = 1e-6
"""How far a right verdict may be off."""

_LIKELY: Final = 0.5
"""What always ended the episode does so where at least this share of the rules holds; an optimist counts
on as many."""

_REVIEW: Final = 10
"""Real steps after which the rules are drawn again at the latest, if no other mode was found and no episode ended."""


@refusing_calls(ConfigError)
class DoubtedTask(RewardFunctions):
    """A learned reward model that says how much a step is worth in expectation over all short rules that fit.

    A plan goes where a reward model promises most, so it goes where that is wrong: just beyond the threshold of a
    bonus, which lies somewhere between what was seen to pay and what wasn't, or far outside of all that a rule was ever
    right of. And of a bonus that was paid once or twice the model says nothing yet: a mode takes more examples.

    Here each pair of modes of reward and end is compared with the rules (`VersionSpace`) that hold of all remembered
    steps of which the pair was right and of none of which its claim is wrong. Where only a share of them holds the step
    is worth that share of what the model says; the rest counts as what is usual, if that is less: the median of what
    all modes would say, each weighed by its examples, so that a bonus counts for nothing. Where the model doesn't know
    which mode holds, what is usual is all that counts: what happens there is known, and a plan may lead through. And
    what was paid beyond the model's word is expected again by the share of the rules that tell these steps from all
    others, which is why an agent returns to where it was rewarded, and stays near to it.

    Parameters
    ----------
    model
        The reward model; live.
    seed
        Of the rules.

    Notes
    -----
    Cost: to draw the rules some tens of milliseconds for each pair of modes, when an episode has ended or another mode
    was found; to evaluate, as much again as the model itself.
    """

    learned: Final = True

    def __init__(self, model: LearnedRewardModel, *, seed: int = 0) -> None:
        self.model = model
        self._rng = np.random.default_rng([seed, 6])
        self._state: tuple[Any, ...] = ()
        self._seen = 0
        self._groups: dict[tuple[int, int], _Group] = {}
        self._beyond: _Beyond | None = None

    def evaluate(self, layout: SceneLayout, before: Float2D, actions: Any, after: Float2D) -> TaskOutcome:
        """Expected rewards, and ends as the model says; NaN where it knows nothing."""
        return self.expected(self.model.joined(layout, before, actions, after))

    def expected(self, vectors: Float2D) -> TaskOutcome:
        """The same of n steps as `LearnedRewardModel.joined` makes them, shape ``(n, width)``."""
        rewards, ended, modes = self.model.outcomes(vectors)
        self._review()
        known = np.isfinite(rewards)
        share, least = known.astype(np.float64), np.full(len(vectors), np.inf)
        for pair, group in self._groups.items():
            rows = np.flatnonzero(known & (modes[:, 0] == pair[0]) & (modes[:, 1] == pair[1]))
            if len(rows):
                share[rows], least[rows] = group.rules.share(vectors[rows]), group.otherwise
        worth = rewards.copy()
        doubtful = np.flatnonzero(share < 1.0)
        if len(doubtful):
            usual = self._usual(vectors[doubtful], ended[doubtful])
            said = np.where(known[doubtful], rewards[doubtful], usual)
            rest = np.minimum(np.minimum(usual, said), least[doubtful])
            worth[doubtful] = share[doubtful] * said + (1.0 - share[doubtful]) * rest
        if self._beyond is not None:
            share = self._beyond.rules.share(vectors)
            if self._beyond.ends:  # or it would be paid in one plan again and again
                ended = ended | (share >= _LIKELY)
                share = np.where(ended, share, 0.0)
            worth += self._beyond.surplus * share
        return TaskOutcome(worth, ended, np.zeros(len(vectors), dtype=bool))

    def claims(self, vectors: Float2D) -> Iterator[tuple[Float1D, VersionSpace, bool]]:
        """Of each pair of modes: what it says n steps pay, the rules that tell where it holds, and whether it ends."""
        for ends in sorted({group.ends for group in self._groups.values()}):
            modes, said = self.model.claims(vectors, np.full(len(vectors), ends))
            numbers = [mode.id for mode in modes]
            for (reward, _), group in self._groups.items():
                if group.ends is ends and reward in numbers:
                    yield said[:, numbers.index(reward)], group.rules, ends

    def _usual(self, vectors: Float2D, ended: NDArray[np.bool_]) -> Float1D:
        """The median of what all modes of the reward say of n steps, by their examples; NaN if there is no mode."""
        modes, said = self.model.claims(vectors, ended)
        if not modes:
            return np.full(len(vectors), np.nan)
        order = np.argsort(said, axis=1, kind="stable")
        examples = np.cumsum(np.array([mode.examples for mode in modes])[order], axis=1)
        middle = (2 * examples >= examples[:, -1:]).argmax(axis=1)
        every = np.arange(len(vectors))
        found: Float1D = said[every, order[every, middle]]
        return found

    def _review(self) -> None:
        """Draw the rules again when there is something new to tell apart."""
        own = self.model
        if own.model.seen == self._seen:
            return
        self._seen = own.model.seen
        lessons = own.lessons()
        paid, over = own.said(lessons)
        modes = tuple(mode.id for prop in ("reward", "terminated") for mode in own.model.modes(TASK, prop))
        state = own.model.seen // _REVIEW, int(over.sum()), modes
        if state == self._state:
            return
        self._state = state
        rewards, ended, pairs = own.outcomes(lessons)
        right = (np.abs(paid - rewards) <= _RIGHT) & (ended == over)
        known, claims = own.claims(lessons, over)
        # Where nothing is known: beyond the most that any mode would have said.
        told = np.where(np.isfinite(rewards), rewards, claims.max(axis=1, initial=-np.inf))
        surplus = np.where(np.isfinite(told), paid - told, 0.0)
        features = own.unsaid(lessons)
        self._groups = {}
        for reward, end in sorted(set(map(tuple, pairs[right].tolist()))):
            mine = (pairs[:, 0] == reward) & (pairs[:, 1] == end)
            ends_so = bool(over[mine & right].all())
            own_claim = claims[:, [mode.id for mode in known].index(reward)]
            false = (np.abs(own_claim - paid) > _RIGHT) | (over != ends_so)
            if not false.any():
                continue
            rules = VersionSpace(features[mine & right], features[false], rng=self._rng)
            if rules.found:
                wrong = paid[mine & ~right]
                otherwise = float(wrong.mean()) if len(wrong) else np.inf
                self._groups[reward, end] = _Group(rules, otherwise, ends_so)
        self._beyond = None
        if (most := float(surplus.max(initial=0.0))) > _RIGHT:
            # What is paid in several places for several reasons isn't told apart from the rest by one rule.
            more = surplus >= 0.5 * most
            rules = VersionSpace(features[more], features[surplus <= _RIGHT], rng=self._rng)
            if rules.found:
                self._beyond = _Beyond(rules, float(surplus[more].mean()), bool(over[more].all()))


@dataclass(frozen=True, slots=True)
class _Group:
    """A pair of modes: rules that tell where it holds, what was paid on average where it was wrong, whether it ends."""

    rules: VersionSpace
    otherwise: float
    ends: bool


@dataclass(frozen=True, slots=True)
class _Beyond:
    """What was paid beyond the model's word: rules that tell where, how much, and whether it always ended episodes."""

    rules: VersionSpace
    surplus: float
    ends: bool


@refusing_calls(ConfigError)
class OptimisticTask(RewardFunctions):
    """The same model's word of how much a step may pay at best: for agents that look for what pays.

    Where two modes may hold and no step has shown which, such as a stop just short of the goal, where the bonus is
    known to be paid, and one just beyond it, expectation keeps an agent from ever finding out. So a step is worth as
    much as any mode says of which at least half the rules hold that fit all examples; each stop that pays less rules
    some of them out (optimism in the face of uncertainty: Brafman and Tennenholtz 2002).

    Parameters
    ----------
    expected
        Says what steps are worth in expectation; live.
    """

    learned: Final = True

    def __init__(self, expected: DoubtedTask) -> None:
        self._expected = expected

    def evaluate(self, layout: SceneLayout, before: Float2D, actions: Any, after: Float2D) -> TaskOutcome:
        """The most that n steps may pay, and the ends that go with it."""
        own = self._expected
        vectors = own.model.joined(layout, before, actions, after)
        expected = own.expected(vectors)
        rewards, ended = expected.rewards.copy(), expected.terminated.copy()
        for claim, rules, over in own.claims(vectors):
            more = np.flatnonzero(~(claim <= rewards + _RIGHT))
            if len(more):
                more = more[rules.share(vectors[more]) >= _LIKELY]
                rewards[more], ended[more] = claim[more], over
        return TaskOutcome(rewards, ended, expected.succeeded)
