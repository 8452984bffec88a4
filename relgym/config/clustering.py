"""Parameters of clustering: how modes are found, kept and united (§3.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from relgym.arguments import refusing_fields
from relgym.config.checks import GREATEST_NOISE, LEAST_NOISE, at_least, at_most, plain
from relgym.errors import ConfigError

__all__ = ["ClusteringConfig"]


@refusing_fields(ConfigError)
@dataclass(frozen=True, slots=True)
class ClusteringConfig:
    """Modes: discovery, assignment and unification (§3.2).

    Parameters
    ----------
    noise_std
        σ of §3.2.2, the standard deviation of the noise on a target, in its units. ``"auto"`` (default)
        estimates it per target from the data and their precision; a number in [1e-100, 1e100] overrides the estimate.
        Too large folds behaviours into one mode, too small learns none (§4.6).
    inlier_stds
        An example fits a function when its residual is at most this many σ. Default 4 (thesis 2, its program 3), range
        [1e-6, 1e6]. Raising it admits more of a noisy mode's tail.
    tail_stds
        Noise within this many σ of a known mode never seeds another. Default 6, range [1e-6, 1e6]: an estimated σ may
        be a third too small. Raising it prevents duplicates of a noisy frequent mode and hides behaviours that differ
        by less.
    min_examples
        T of §3.2.2, examples needed to found a mode; it is deleted below half of them. ``"auto"`` (default):
        10 where data are exact, because each further example then verifies the function to many digits, up to
        40 (the thesis' value) the noisier they are; or a number from 4 to a million. Raising it learns
        later and fewer modes.
    draws
        N of §3.2.2, samples drawn per search. Default 1536 (thesis 2000), range 1 to 100,000. Raising it finds
        rarer modes sooner.
    max_terms
        Largest number of weights in a mode. Default 8, range 0 to 64.
    own_only
        Whether only the target's own properties (and bodiless objects') may enter. Default false.
    unify_ratio
        R_unify of §3.2.5: share of the examples of *each* side that a unified function must explain. Default 0.9, as
        in the thesis: a side may owe a few of its examples to coincidence. Raising it leaves more modes apart.
    support
        Number of examples that must back each weight: what fewer than this many leverage points alone
        determine isn't learned. Default 3, range 1 to a million.
    refit_growth
        A mode is refitted when its examples have grown by this factor. Default 2.
    """

    noise_std: float | Literal["auto"] = "auto"
    inlier_stds: float = 4.0
    tail_stds: float = 6.0
    min_examples: int | Literal["auto"] = "auto"
    draws: int = 1536
    max_terms: int = 8
    own_only: bool = False
    unify_ratio: float = 0.9
    support: int = 3
    refit_growth: float = 2.0

    def __post_init__(self) -> None:
        plain(self)
        at_least(self, 1, "draws", "support")
        at_least(self, 0, "max_terms")
        at_most(self, draws=100_000, support=1_000_000, max_terms=64)
        noise: object = self.noise_std
        least: object = self.min_examples
        if noise != "auto" and not (isinstance(noise, int | float) and noise > 0):
            raise ConfigError(f"noise_std must be 'auto' or a positive float, got {self.noise_std!r}")
        if noise != "auto":
            at_least(self, LEAST_NOISE, "noise_std")
            at_most(self, noise_std=GREATEST_NOISE)
        if least != "auto" and not (isinstance(least, int) and least >= 4):
            raise ConfigError(f"min_examples must be 'auto' or an int >= 4, got {self.min_examples!r}")
        if least != "auto":
            at_most(self, min_examples=1_000_000)
        at_least(self, 1e-6, "inlier_stds", "tail_stds")
        at_most(self, inlier_stds=1e6, tail_stds=1e6)
        if not 0.5 <= self.unify_ratio <= 1.0:
            raise ConfigError(f"unify_ratio must lie in [0.5, 1], got {self.unify_ratio}")
        if not self.refit_growth > 1.0:
            raise ConfigError(f"refit_growth must be greater than 1, got {self.refit_growth}")
