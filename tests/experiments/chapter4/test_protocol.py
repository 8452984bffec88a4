from __future__ import annotations

import pytest

from relgym.errors import ConfigError
from relgym.experiments.chapter4.protocol import Protocol
from relgym.experiments.seeds import TEST_SEEDS, TRAINING_SEEDS, TUNING_SEEDS


def test_fifty_batches_are_ten_orders_of_five_seeds() -> None:
    runs = Protocol.thesis().runs()
    assert len({(run.seed, run.order) for run in runs}) == 50
    assert {run.seed for run in runs} == set(TRAINING_SEEDS) and {run.order for run in runs} == set(range(10))


def test_the_first_batches_differ_in_both() -> None:
    runs = Protocol.fast(2).runs()
    assert runs[0].seed != runs[1].seed and runs[0].order != runs[1].order
    assert Protocol.thesis(7).runs() == Protocol.thesis(50).runs()[:7]


def test_the_thesis_own_numbers() -> None:
    whole = Protocol.thesis()
    assert whole.after(1) == (1, 16, 32, 48, 64, 80) and whole.after(2)[-1] == 160
    assert whole.tests() == {"seeds": list(TEST_SEEDS), "episodes": 120}  # 24,000 examples
    assert (whole.noise_batches, whole.transfer_batches, whole.trials) == (15, 20, 80)
    assert whole.variances == (1e-20, 1e-15, 1e-10, 1e-8, 1e-5)


def test_the_fast_one() -> None:
    fast = Protocol.fast()
    assert [fast.after(k) for k in (1, 2)] == [(16, 80), (16, 80, 160)]
    assert fast.test_episodes * 200 == 2400 and len(fast.variances) == 3


def test_tuning_and_reporting_are_apart() -> None:
    assert not set(TUNING_SEEDS) & {*TRAINING_SEEDS, *TEST_SEEDS}


@pytest.mark.parametrize("batches", [0, 51])
@pytest.mark.parametrize("make", [Protocol.thesis, Protocol.fast])
def test_batches_have_bounds(batches: int, make: object) -> None:
    with pytest.raises(ConfigError, match="between 1 and 50"):
        make(batches)  # type: ignore[operator]
