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
    """Parameters of `Dyna`: how an agent trains in its model while it acts in the world.

    Parameters
    ----------
    real_ratio
        Share of real transitions in every batch, 0 to 1. 0.05 is MBPO's; raising it uses the model less.
    horizon
        Length of a roll-out in decisions, at least 1: the k of k-step branches. With the task's time limit as horizon,
        roll-outs from first scenes are whole episodes.
    from_start
        Share of the roll-outs that begin in first scenes of episodes; the others begin in any scene that was seen.
    dreams
        How many roll-outs are made at once. Raising it refreshes the imagined transitions faster.
    every
        Real steps between two rounds of roll-outs.
    capacity
        How many imagined transitions are kept, the latest. It should be small enough that those of old policies and
        models are soon dropped.
    updates, updates_alone
        Gradient steps per real step while the model is accepted, and while it isn't; ``None`` for the latter: as many
        as the algorithm was made with.
    catch_up
        Catch-up updates: gradient steps made at once, with fresh roll-outs throughout, the first time that the model is
        accepted and the algorithm's random steps are over, and again whenever a learned reward model has learned
        another reward or end (`LearnedRewardModel.verdicts`); 0: none. A model of few objects is often exact long
        before real steps at `updates` each have trained a policy: raising it trades computing time for real steps. It
        should be many times `updates` * `every`, which belong to one round of roll-outs.
    permute
        Whether objects of one type are exchanged in the scenes where roll-outs begin. A relational model is invariant
        to that, a neural net isn't.
    resample
        Whether properties of bodiless objects that no law but their own mentions are drawn anew where roll-outs begin,
        between the smallest and the largest value seen at the start of episodes. Where nothing has a body, nothing is
        resampled.
    perturb_velocity
        Share of the roll-outs that begin with other velocities of moving bodies, up to twice as fast as were ever seen:
        exploring starts (Sutton & Barto 2018, §5.3). Helps where only a fast body reaches the goal.
    shuffle
        The model learns transitions in random order, out of a buffer of so many; 0: as they come. In order, what is
        constant within an episode could be taken for a law.
    accept_at, reject_at
        The model is accepted when its prequential error falls to `accept_at`, and rejected when it rises to `reject_at`
        (`ModelAcceptance`).
    renew
        Beside a model that was accepted and then rejected, a replacement learns the same steps from nothing, and takes
        its place if it is accepted first (`ModelTrainer`). A replacement that isn't accepted within so many real steps
        starts anew. 0: no replacements.
    window, least
        The error is a mean over so many of the latest real steps; with fewer than `least` the model isn't accepted.
    seed
        Seed of everything that is drawn for roll-outs.
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
