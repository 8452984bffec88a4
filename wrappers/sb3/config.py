"""Free parameters of Dyna, as one frozen record."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from relgym.errors import ConfigError

__all__ = ["DynaConfig", "checked_config"]


@dataclass(frozen=True, slots=True)
class DynaConfig:
    """How an agent trains in its model while it acts in the world.

    Parameters
    ----------
    real_ratio
        Share of every batch that really happened, 0 to 1. 0.05 is MBPO's; raising it costs the model's help.
    horizon
        Decisions that a dream lasts at most, at least 1: the k of k-step branches. Dreams from first scenes
        last as long, so that with the task's time limit as horizon they are whole episodes.
    from_start
        Share of the dreams that begin in first scenes of episodes; the others branch off anywhere.
    dreams
        How many scenes are dreamed on at once. Raising it refreshes the imagined transitions faster.
    every
        Real steps between two rounds of dreams.
    capacity
        How many imagined transitions are kept, the latest. Small enough that those of old policies and
        models are soon forgotten.
    updates, updates_alone
        Gradient steps per real step while the model is accepted, and while it isn't; the latter none: as many as
        the algorithm was made for.
    catch_up
        Gradient steps at once, in fresh dreams all the while, the first time that the model is accepted and the
        algorithm's random steps are over, and again whenever a learned reward model has come to know of another reward
        or end (`LearnedRewardModel.verdicts`); 0: none. A model of few objects is often exact long before real steps at
        `updates` each have trained a policy: raising it trades computing for real steps. Should hold `updates` *
        `every`, a round of dreams, many times.
    permute
        Whether dreams exchange the roles of objects of one type. The model licenses that, a net doesn't.
    resample
        Whether dreams resample properties of bodiless objects that no law but their own mentions, between the
        smallest and the largest value seen at the start of episodes. The model licenses that too; where nothing has a
        body, nothing is resampled.
    perturb_velocity
        Share of the dreams in which moving bodies begin with other velocities, up to twice as fast as they were ever
        seen. So dreams get where no real step has led yet: exploring starts (Sutton & Barto 2018, §5.3), which the
        world doesn't offer and a model does. Helps where a goal lies behind what only a fast body gets over.
    shuffle
        The model learns transitions in random order, out of a stock of so many. What stays the same
        throughout an episode would otherwise pass for a law; 0: as they come.
    accept_at, reject_at
        The model is accepted when its prequential error falls to `accept_at`, until it rises to `reject_at`
        (`ModelAcceptance`).
    renew
        A model that was accepted and is no more gets a replacement that learns the same steps from nothing, and
        takes its place if it is accepted first (`ModelTrainer`); one that isn't accepted within so many real steps
        begins anew. 0: no replacements.
    window, least
        Latest real steps that the error is a mean of, and how many there must be.
    seed
        Of everything that dreams draw.
    """

    real_ratio: float = 0.05
    horizon: int = 20
    from_start: float = 0.5
    dreams: int = 128
    every: int = 10
    capacity: int = 20_000
    updates: int = 20
    updates_alone: int | None = None
    catch_up: int = 0
    permute: bool = True
    resample: bool = True
    perturb_velocity: float = 0.0
    shuffle: int = 150
    accept_at: float = 0.1
    reject_at: float = 0.2
    renew: int = 1_000
    window: int = 100
    least: int = 50
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("real_ratio", "from_start", "perturb_velocity"):
            value = getattr(self, name)
            if not _number(value) or not 0.0 <= value <= 1.0:
                raise ConfigError(f"{name}={getattr(self, name)!r}: expected a share from 0 to 1")
        for name, low in _LEAST.items():
            value = getattr(self, name)
            if value is None and name == "updates_alone":
                continue
            if not isinstance(value, (int, np.integer)) or isinstance(value, bool) or value < low:
                raise ConfigError(f"{name}={value!r}: expected a whole number, at least {low}")
        if self.least > self.window:
            raise ConfigError(f"least={self.least}: expected at most window={self.window}")
        fine = _number(self.accept_at) and _number(self.reject_at)
        if not fine or not 0.0 <= self.accept_at <= self.reject_at or not math.isfinite(self.reject_at):
            raise ConfigError(
                f"accept_at={self.accept_at!r}, reject_at={self.reject_at!r}: expected 0 <= accept_at <= reject_at, so "
                "that a model isn't accepted and rejected in turns"
            )


def checked_config(given: DynaConfig | None) -> DynaConfig:
    """The parameters, or the default ones for none; `ConfigError` for anything else."""
    if given is not None and not isinstance(given, DynaConfig):
        raise ConfigError(f"config={given!r}: expected a DynaConfig, as DynaConfig(updates=40)")
    return given or DynaConfig()


def _number(value: Any) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)


_LEAST = {
    "horizon": 1,
    "dreams": 1,
    "every": 1,
    "capacity": 1,
    "updates": 1,
    "updates_alone": 0,
    "catch_up": 0,
    "shuffle": 0,
    "renew": 0,
    "window": 1,
    "least": 1,
    "seed": 0,
}
