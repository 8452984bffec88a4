"""What is said of one property, as a record."""

from __future__ import annotations

import copy
import gc
import math
import pickle

import pytest

from relgym.model.predicting.calibration import Audit, Key
from relgym.model.predicting.prediction import Outcome, Prediction

SAID = Prediction("ball", "vx", 0.5, Outcome.PREDICTED, 2, ("ball", "floor"), 1.5)
AUDIT = Audit(Key(0, 1, 2), (0.5, math.nan), 0)


def test_two_are_equal_if_all_but_the_record_is() -> None:
    assert SAID == SAID.replace(record=AUDIT)
    assert SAID != SAID.replace(mode=3)
    assert SAID != ("ball", "vx", 0.5)
    assert "record" not in repr(SAID)
    assert repr(SAID).startswith(
        "Prediction(object='ball', property='vx', value=0.5, outcome=<Outcome.PREDICTED"
    )
    with pytest.raises(TypeError, match="unhashable"):
        hash(SAID)


def test_it_stays_as_it_is() -> None:
    with pytest.raises(AttributeError, match="immutable"):
        SAID.value = 1.0  # type: ignore[misc]
    assert SAID.replace(value=1.0).value == 1.0
    assert SAID.value == 0.5
    with pytest.raises(TypeError, match="colour"):
        SAID.replace(colour="red")


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda p: pickle.loads(pickle.dumps(p))])
def test_copies_are_equal(copied: object) -> None:
    found = copied(SAID.replace(record=AUDIT))  # type: ignore[operator]
    assert found == SAID
    assert found.audit.key == AUDIT.key


def test_the_collector_of_cycles_passes_them_by() -> None:
    assert not gc.is_tracked(SAID)
    assert not gc.is_tracked(AUDIT)


def test_what_it_says_of_itself() -> None:
    assert SAID.ok and SAID.informed
    abstained = SAID.replace(outcome=Outcome.OUTSIDE, mode=0)
    assert not abstained.ok and not abstained.informed
    assert abstained.replace(spread=0.1).informed
    assert abstained.audit is None
