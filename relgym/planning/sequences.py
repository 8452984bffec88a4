"""Searches over sequences of actions: random shooting, the cross-entropy method, path integrals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from relgym.arguments import array_of, refusing_calls
from relgym.envs.arguments import checked_count
from relgym.errors import ConfigError
from relgym.planning.actions import ActionCoder
from relgym.planning.rollouts import Objective, Plan, roll_out
from relgym.planning.simulators import Simulator
from relgym.scene.objects import Float1D, Float2D

__all__ = ["CrossEntropy", "PathIntegral", "RandomShooting", "Search", "held_noise"]

_LEAST_SPREAD: Final = 0.02
"""A search that has settled still looks about: half a hundredth of a Box's width either way."""


_KEPT: Final = 32
"""One candidate in so many is kept for the next round, and varied there."""


class Search(Protocol):
    """Finds a good sequence of actions; frozen settings, no state of its own."""

    @property
    def horizon(self) -> int:
        """Decisions that a plan lasts at most."""
        ...

    def plan(
        self,
        simulator: Simulator,
        coder: ActionCoder,
        start: Float1D,
        objective: Objective,
        *,
        warm: Float2D | None,
        rng: np.random.Generator,
        deadline: float | None,
    ) -> Plan:
        """Search from one state.

        Parameters
        ----------
        simulator, coder
            Where, and how actions are made of latent vectors.
        start
            State vector, shape ``(width,)``.
        objective
            What is looked for.
        warm
            Latents of the rest of the last plan, shape ``(k, coder.size)``, ``k <= horizon``; None: none.
        rng
            Draws the candidates.
        deadline
            When `time.perf_counter` says so, no new round begins; at least one takes place. None: all rounds.
        """
        ...


def held_noise(count: int, horizon: int, size: int, *, rng: np.random.Generator) -> NDArray[np.float64]:
    """Standard normal noise that is held for a while, shape ``(count, horizon, size)``.

    Each sequence keeps a value for 1, 2, 4, … decisions, a length of its own: white noise alone averages out over a
    horizon and goes nowhere (the reason for coloured noise in Pinneri et al. 2020, iCEM).
    """
    scales = np.array([2**k for k in range(int(np.log2(max(horizon, 1))) + 1)] + [horizon])
    holds = scales[rng.integers(len(scales), size=count)]
    phases = rng.integers(holds)
    pieces = (np.arange(horizon)[None] + phases[:, None]) // holds[:, None]
    drawn = rng.standard_normal((count, horizon + 1, size))
    held: NDArray[np.float64] = np.take_along_axis(drawn, pieces[:, :, None], axis=1)
    return held


@refusing_calls(ConfigError)
@dataclass(frozen=True, slots=True, kw_only=True)
class CrossEntropy:
    """The cross-entropy method: draw, keep the best, draw nearer to them (Rubinstein 1999; iCEM, Pinneri et al. 2020).

    Parameters
    ----------
    horizon
        Decisions that a plan lasts at most.
    candidates
        Sequences drawn in the first round.
    rounds
        How often; each has `shrink` times the candidates of the one before.
    elites
        Share of the candidates that the next round is drawn about.
    shrink
        In (0, 1].
    momentum
        Weight of the old mean and spread beside those of the elites, in [0, 1).

    Notes
    -----
    The best sequence of all rounds is the plan. The rest of the last plan, and in later rounds the best elites, are
    candidates too, so that a plan never gets worse for being looked at again.
    """

    horizon: int = 20
    candidates: int = 512
    rounds: int = 3
    elites: float = 0.08
    shrink: float = 0.7
    momentum: float = 0.1

    def __post_init__(self) -> None:
        _check(self.horizon, self.candidates, self.rounds)
        if not (0.0 < self.elites < 1.0 and 0.0 < self.shrink <= 1.0 and 0.0 <= self.momentum < 1.0):
            raise ConfigError(
                f"elites={self.elites!r}, shrink={self.shrink!r}, momentum={self.momentum!r}: expected shares in "
                "(0, 1), (0, 1] and [0, 1)"
            )

    def plan(
        self,
        simulator: Simulator,
        coder: ActionCoder,
        start: Float1D,
        objective: Objective,
        *,
        warm: Float2D | None,
        rng: np.random.Generator,
        deadline: float | None,
    ) -> Plan:
        """See `Search.plan`."""

        def towards(mean: Float2D, spread: Float2D, latents: Any, worth: Float1D) -> tuple[Float2D, Float2D]:
            best = np.argsort(-worth, kind="stable")[: max(2, int(self.elites * self.candidates))]
            chosen, m = latents[best], self.momentum
            return (
                m * mean + (1 - m) * chosen.mean(axis=0),
                m * spread + (1 - m) * np.maximum(chosen.std(axis=0), _LEAST_SPREAD),
            )

        counts = [max(8, int(self.candidates * self.shrink**k)) for k in range(self.rounds)]
        return _iterated(
            simulator,
            coder,
            start,
            objective,
            self.horizon,
            counts,
            towards,
            warm=warm,
            rng=rng,
            deadline=deadline,
        )


@refusing_calls(ConfigError)
@dataclass(frozen=True, slots=True, kw_only=True)
class PathIntegral:
    """Model-predictive path integral control: the mean moves to the candidates' average, weighted by worth (MPPI).

    Parameters
    ----------
    horizon, candidates, rounds
        As of `CrossEntropy`.
    temperature
        Of the weights ``exp(worth / temperature)``, in units of the spread of the candidates' worths.
    spread
        Standard deviation of the candidates about the mean, in latent units.

    Notes
    -----
    Source: Williams et al. 2017, *Information theoretic MPC*.
    """

    horizon: int = 20
    candidates: int = 512
    rounds: int = 2
    temperature: float = 0.2
    spread: float = 0.7

    def __post_init__(self) -> None:
        _check(self.horizon, self.candidates, self.rounds)
        if not (self.temperature > 0.0 and self.spread > 0.0):
            raise ConfigError(
                f"temperature={self.temperature!r}, spread={self.spread!r}: expected positive numbers"
            )

    def plan(
        self,
        simulator: Simulator,
        coder: ActionCoder,
        start: Float1D,
        objective: Objective,
        *,
        warm: Float2D | None,
        rng: np.random.Generator,
        deadline: float | None,
    ) -> Plan:
        """See `Search.plan`."""

        def towards(mean: Float2D, spread: Float2D, latents: Any, worth: Float1D) -> tuple[Float2D, Float2D]:
            fine = np.isfinite(worth)
            if not fine.any():
                return mean, spread
            scale = float(worth[fine].std()) or 1.0
            weights = np.exp((worth[fine] - worth[fine].max()) / (self.temperature * scale))
            weights /= weights.sum()
            return np.einsum("n,nhd->hd", weights, latents[fine]), np.full_like(spread, self.spread)

        counts = [self.candidates] * self.rounds
        return _iterated(
            simulator,
            coder,
            start,
            objective,
            self.horizon,
            counts,
            towards,
            warm=warm,
            rng=rng,
            deadline=deadline,
        )


@refusing_calls(ConfigError)
@dataclass(frozen=True, slots=True, kw_only=True)
class RandomShooting:
    """The best of many random sequences.

    Parameters
    ----------
    horizon, candidates
        As of `CrossEntropy`.
    """

    horizon: int = 20
    candidates: int = 1024

    def __post_init__(self) -> None:
        _check(self.horizon, self.candidates, 1)

    def plan(
        self,
        simulator: Simulator,
        coder: ActionCoder,
        start: Float1D,
        objective: Objective,
        *,
        warm: Float2D | None,
        rng: np.random.Generator,
        deadline: float | None,
    ) -> Plan:
        """See `Search.plan`."""
        return _iterated(
            simulator,
            coder,
            start,
            objective,
            self.horizon,
            [self.candidates],
            lambda mean, spread, latents, worth: (mean, spread),
            warm=warm,
            rng=rng,
            deadline=deadline,
        )


_Update = Callable[[Any, Any, Any, Any], tuple[Any, Any]]


def _iterated(
    simulator: Simulator,
    coder: ActionCoder,
    start: Float1D,
    objective: Objective,
    horizon: int,
    counts: list[int],
    towards: _Update,
    *,
    warm: Float2D | None,
    rng: np.random.Generator,
    deadline: float | None,
) -> Plan:
    """Rounds of drawing about a mean and moving it; the best sequence of all."""
    mean, spread = np.zeros((horizon, coder.size)), np.ones((horizon, coder.size))
    kept = np.empty((0, horizon, coder.size))
    if warm is not None and len(warm := array_of("warm", warm, (None, coder.size), ConfigError)):
        rest = min(len(warm), horizon)
        mean[:rest] = warm[:rest]
        kept = mean[None].copy()
    best: Plan | None = None
    for number, count in enumerate(counts):
        if number and deadline is not None and perf_counter() >= deadline:
            break
        noise = held_noise(count, horizon, coder.size, rng=rng)
        drawn = mean + spread * noise
        if len(kept):  # half of them about the mean, half about good sequences: they may differ in kind
            half = drawn[count // 2 :]
            half[:] = _varied(kept, noise[count // 2 :], rng=rng)
            if number == 0:  # a last plan may have been bad: some as if there were none
                half[::2] = noise[count // 2 :][::2]
        latents = np.concatenate([kept, drawn])
        actions = coder.actions(latents)
        found = roll_out(simulator, start, actions, objective)
        order = np.argsort(-found.worth, kind="stable")
        if best is None or found.worth[order[0]] > best.worth:
            best = found.plan(int(order[0]), actions, latents)
        kept = latents[order[: max(1, count // _KEPT)]]
        mean, spread = towards(mean, spread, latents, found.worth)
    assert best is not None, "one round at least"
    return best


def _varied(
    kept: NDArray[np.float64], noise: NDArray[np.float64], *, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Each of n drawn from those kept and changed a little, or much, from a random decision on for a while."""
    count, horizon, _ = noise.shape
    chosen = kept[rng.integers(len(kept), size=count)]
    scale = np.exp(rng.uniform(np.log(_LEAST_SPREAD), 0.0, size=(count, 1, 1)))
    first = rng.integers(horizon, size=(count, 1))
    last = first + rng.integers(1, horizon + 1, size=(count, 1))
    steps = np.arange(horizon)[None]
    reached = ((first <= steps) & (steps < last))[:, :, None]
    varied: NDArray[np.float64] = chosen + scale * noise * reached
    return varied


def _check(horizon: int, candidates: int, rounds: int) -> None:
    checked_count("horizon", horizon, 1, 10**6)
    checked_count("candidates", candidates, 2, 10**7)
    checked_count("rounds", rounds, 1, 10**4)
