"""How often, on what and how long: the protocol of §4.2, whole or as much of it as there is time for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final

from relgym.errors import ConfigError
from relgym.experiments.seeds import TEST_SEEDS, TRAINING_SEEDS

__all__ = ["ABLATIONS", "LEARNERS", "WHOLE_TEST", "Batch", "Protocol"]

ORDERS: Final = 10
"""Episode orders of the thesis; with its five seeds they make 50 batches (§4.2)."""

WHOLE_TEST: Final = 120
"""Episodes of the thesis' test set: 24,000 examples (§4.3.3)."""

LEARNERS: Final[Mapping[str, str]] = {
    "original": "the thesis' program, its rules and slips of counting included: ThesisSettings.original()",
    "thesis": "chapter III as published: ThesisSettings.thesis()",
    "world": 'relgym with modes along the world\'s axes: ModelConfig(frames="world")',
    "default": "relgym as it comes, with contact laws: ModelConfig()",
}
"""Learners that are reported side by side."""

ABLATIONS: Final[Mapping[str, str]] = {
    "original": "as it is",
    "original, all examples test": "clauses are evaluated by all negatives, not by a quarter of them: grow_share=1",
    "original, trees for rare modes": "a tree also for few examples of a mode: tree_least=3, tree_success=0.95",
    "original, either class positive or not": "the older mode of a pair is always the positive class: polarities=False",
}
"""The thesis' program, and what becomes of it with one cause of its errors taken away."""


@dataclass(frozen=True, slots=True)
class Batch:
    """One training: which scenes, in which order."""

    seed: int
    order: int


@dataclass(frozen=True, slots=True)
class Protocol:
    """Size of every experiment.

    Attributes
    ----------
    batches
        Trainings per learner, of at most 50 (§4.2); the first ones differ in both seed and order.
    test_episodes
        Episodes of 200 examples tested on, from three other seeds in equal parts; 120 in the thesis (24,000 examples).
    checkpoints
        Per ball experiment: after how many episodes to test. The last number is the length of the training.
    noise_batches
        Trainings per cell of the noise sweep; 15 in the thesis (§4.6).
    variances
        Variances of the noise, true and expected.
    transfer_batches
        Trainings per learner in the transfer experiments; 20 in the thesis (§4.9).
    trials
        Roll-outs; 80 in the thesis (§4.8).
    long_batches
        Trainings per learner in experiment 3, whose trainings are the longest.
    comparison_batches
        Trainings per baseline.
    tuning_episodes
        Episodes on which settings of baselines are compared, with tuning seeds.
    """

    batches: int = 50
    test_episodes: int = WHOLE_TEST
    checkpoints: Mapping[int, tuple[int, ...]] | None = None
    noise_batches: int = 15
    variances: tuple[float, ...] = (1e-20, 1e-15, 1e-10, 1e-8, 1e-5)
    transfer_batches: int = 20
    trials: int = 80
    long_batches: int = 50
    comparison_batches: int = 50
    tuning_episodes: int = 40

    @classmethod
    def thesis(cls, batches: int = 50) -> Protocol:
        """As in chapter IV, with at most this many batches of everything.

        Raises
        ------
        ConfigError
            Fewer than 1 batch or more than 50.
        """
        _check(batches)
        whole = cls()
        return cls(
            batches,
            noise_batches=min(batches, whole.noise_batches),
            transfer_batches=min(batches, whole.transfer_batches),
            long_batches=batches,
            comparison_batches=batches,
        )

    @classmethod
    def fast(cls, batches: int = 2) -> Protocol:
        """A tenth of the tests, few checkpoints, a noise sweep of 3 x 3, shorter trainings in experiment 3."""
        _check(batches)
        return cls(
            batches,
            test_episodes=12,
            checkpoints={1: (16, 80), 2: (16, 80, 160), 3: (80, 160)},
            noise_batches=1,
            variances=(1e-15, 1e-10, 1e-5),
            transfer_batches=min(batches, 2),
            long_batches=1,
            comparison_batches=1,
            tuning_episodes=8,
        )

    def after(self, experiment: int) -> tuple[int, ...]:
        """After how many episodes a ball experiment tests."""
        if self.checkpoints is not None:
            return self.checkpoints[experiment]
        whole = {1: 80, 2: 160, 3: 480}[experiment]
        every = 16 if experiment < 3 else 80
        return (1, *range(every, whole + 1, every))

    def runs(self, count: int | None = None) -> tuple[Batch, ...]:
        """The first batches of the 50: all five seeds before an order is seen with the same seed again."""
        pairs = [
            Batch(TRAINING_SEEDS[k % len(TRAINING_SEEDS)], (k + k // ORDERS) % ORDERS)
            for k in range(ORDERS * len(TRAINING_SEEDS))
        ]
        return tuple(pairs[: self.batches if count is None else count])

    def tests(self) -> dict[str, Any]:
        """Arguments that say which examples to test on."""
        return {"seeds": list(TEST_SEEDS), "episodes": self.test_episodes}

    def __str__(self) -> str:
        size = "whole" if self.checkpoints is None else "fast"
        return f"{size} protocol, {self.batches} of 50 batches, {self.test_episodes} of {WHOLE_TEST} test episodes"

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


def _check(batches: int) -> None:
    most = ORDERS * len(TRAINING_SEEDS)
    if not 1 <= batches <= most:
        raise ConfigError(f"batches must lie between 1 and {most} (10 orders x 5 seeds), got {batches}")
