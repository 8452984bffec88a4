"""Cells of predictions: who speaks, how probably it is right, and how wide its interval is."""

from __future__ import annotations

import copy
import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.model.calibration import (
    ENOUGH,
    EXPERTS,
    FEW,
    LINEAR,
    MEMORY,
    OWN,
    PERSISTENCE,
    Audit,
    Calibration,
    Key,
    key_of,
    keys_of,
)

KEY = Key(0, 1, 3)


def values(own: float = math.nan, linear: float = math.nan, now: float = 0.0) -> tuple[float, ...]:
    found = [math.nan] * len(EXPERTS)
    found[OWN], found[LINEAR], found[PERSISTENCE] = own, linear, now
    return tuple(found)


def seen(
    known: Calibration, said: tuple[float, ...], came: float, key: Key = KEY, *, claimed: bool = True
) -> None:
    audit = Audit(key, said, known.assess(key, said).speaker)
    known.look_back(audit, came, claimed=claimed, rounding=1e-9, error=0.05)


def right(n: int) -> Calibration:
    known = Calibration()
    for _ in range(n):
        seen(known, values(own=1.0), 1.0)
    return known


def test_nothing_is_known_of_what_nobody_looked_back_at() -> None:
    told = Calibration().assess(KEY, values(own=1.0))
    assert told.speaker == OWN
    assert math.isnan(told.probability)
    assert math.isnan(told.interval)


def test_the_probability_is_the_posterior_mean() -> None:
    # All modes: (4 + 1/2) / (4 + 1); the cell: (4 + that) / (4 + 1), if hits come in a share, which has 4 hits with a
    # probability of 1/2 3/4 5/6 7/8; otherwise, which is as likely to begin with, it is always right.
    share, chance = (4 + 4.5 / 5) / 5, 35 / 128
    expected = (share * chance + 1.0) / (chance + 1.0)
    known = right(4)
    assert known.assess(KEY, values(own=1.0)).probability == pytest.approx(expected)
    seen(known, values(own=1.0), 2.0)  # not always right
    assert known.assess(KEY, values(own=1.0)).probability == pytest.approx((4 + 4.5 / 6) / 6)


def test_laws_are_believed_as_far_as_they_describe_what_came_in_fewer_bits() -> None:
    law, known = Key(0, -1, 7), right(4)
    assert known.assess(law, values(own=1.0)).probability == 0.5
    known.vouch(3.0)  # always right by 8 to 1
    told = known.assess(law, values(own=1.0))
    assert told.probability == pytest.approx(1.0 - 0.5 / 9.0)
    assert known.claims(law, told)
    seen(known, values(own=1.0), 2.0, key=law)
    assert known.assess(law, values(own=1.0)).probability == pytest.approx(0.25 / 2.0)


def test_a_new_kind_of_prediction_begins_with_what_the_others_tell() -> None:
    known = right(50)
    assert known.assess(Key(0, 2, 3), values(own=1.0)).probability == pytest.approx(50.5 / 51)
    assert known.assess(Key(0, -1, 7), values(own=1.0)).probability == 0.5  # modes say nothing of laws
    assert known.assess(Key(3, 0, 0), values(own=1.0)).probability == 0.5  # nor is another outcome's known


def test_a_new_mode_speaks_whoever_was_better_than_those_before_it() -> None:
    known = Calibration()
    for k in range(40):
        seen(known, values(own=5.0 * (-1) ** k, now=0.0), 0.1)
    assert known.assess(KEY, values(own=5.0)).speaker == PERSISTENCE
    assert known.assess(Key(0, 2, 3), values(own=5.0)).speaker == OWN


@pytest.mark.parametrize(("hits", "misses"), [(100, 3), (500, 2)])
def test_a_few_misses_of_a_sure_law_end_its_record(hits: int, misses: int) -> None:
    known = right(hits)
    for _ in range(misses - 1):
        seen(known, values(own=1.0), 2.0)
        assert known.assess(KEY, values(own=1.0)).probability > 0.97
    seen(known, values(own=1.0), 2.0)
    assert known.assess(KEY, values(own=1.0)).probability < 0.2


def test_a_run_of_hits_of_what_was_right_half_the_time_do_so_too() -> None:
    known = Calibration()
    for k in range(100):
        seen(known, values(own=1.0), 1.0 + k % 2)
    assert known.assess(KEY, values(own=1.0)).probability == pytest.approx(0.5, abs=0.05)
    for _ in range(FEW):
        assert known.assess(KEY, values(own=1.0)).probability < 0.7
        seen(known, values(own=1.0), 1.0)
    assert known.assess(KEY, values(own=1.0)).probability > 0.9


def test_a_hit_is_off_by_a_part_of_what_mostly_changes() -> None:
    known = Calibration()
    for _ in range(30):
        seen(known, values(own=10.4), 10.0)  # what changes is 10, what it is off by 4 %
    assert known.assess(KEY, values(own=1.0)).probability > 0.9
    for _ in range(30):
        seen(known, values(own=10.7), 10.0)
    assert known.assess(KEY, values(own=1.0)).probability < 0.1


@given(outlier=st.sampled_from([1e3, 1e30, 1e200, -1e300]))
def test_an_outlier_changes_nothing_for_good(outlier: float) -> None:
    known = right(100)
    before = known.change
    seen(known, values(own=1.0), outlier)
    assert known.change == pytest.approx(before, rel=0.01)
    for _ in range(20):
        seen(known, values(own=1.0), 1.0)
    told = known.assess(KEY, values(own=1.0))
    assert told.probability > 0.98
    assert told.interval == 0.0


def test_who_codes_best_speaks_once_it_leads_by_ten_bits() -> None:
    rng = np.random.default_rng(0)
    known = Calibration()
    spoke = []
    for came in rng.normal(size=60).tolist():
        said = values(own=came + float(rng.normal()), linear=came + 0.5 * float(rng.normal()))
        spoke.append(known.assess(KEY, said).speaker)
        seen(known, said, came)
    assert spoke[0] == OWN
    assert spoke[-1] == LINEAR
    assert spoke == sorted(spoke)  # it takes over once


def test_who_never_leads_by_ten_bits_never_speaks() -> None:
    known = Calibration()
    rng = np.random.default_rng(1)
    for came in rng.normal(size=FEW).tolist():
        seen(known, values(own=0.0, linear=0.01 * came), came)
    assert known.assess(KEY, values(own=0.0, linear=0.0)).speaker == OWN


def test_a_law_that_can_be_claimed_keeps_the_word_where_it_is_hardly_worse() -> None:
    for off, speaker in ((0.0105, OWN), (0.0115, LINEAR)):
        known = Calibration()
        for k in range(500):
            came = 1.0 + 0.1 * (k % 5)
            seen(known, values(own=came + off, linear=came + 0.01), came)
        assert known.assess(KEY, values(own=1.0, linear=1.0)).speaker == speaker


def test_nothing_changes_speaks_where_a_mode_is_worse() -> None:
    known = Calibration()
    for k in range(40):
        seen(known, values(own=5.0 * (-1) ** k, now=0.0), 0.1)
    assert known.assess(KEY, values(own=5.0)).speaker == PERSISTENCE


def test_an_expert_without_a_value_is_no_speaker() -> None:
    known = Calibration()
    for _ in range(40):
        seen(known, values(own=5.0, linear=1.0), 1.0)
    assert known.assess(KEY, values(own=5.0, linear=1.0)).speaker == LINEAR
    told = known.assess(KEY, values(own=5.0))
    assert told.speaker == PERSISTENCE  # which is off by 1, not by 4
    assert told.probability == 0.5  # that nothing changes was never counted here
    for _ in range(60):  # what the regression knew is learned by a law, and nobody asks it any more
        seen(known, values(own=1.0), 1.0)
    told = known.assess(KEY, values(own=1.0))
    assert told.probability > 0.9


def test_intervals_hold_what_they_say() -> None:
    rng = np.random.default_rng(2)
    known = Calibration()
    inside = []
    for came in rng.normal(size=4_000).tolist():
        half = known.assess(KEY, values(own=0.0)).interval
        if math.isfinite(half):
            inside.append(abs(came) <= half)
        seen(known, values(own=0.0), came)
    assert len(inside) == 4_000 - ENOUGH
    assert 0.93 <= np.mean(inside[200:]) <= 0.97


def test_slips_are_claims_that_were_off() -> None:
    known = right(298)
    seen(known, values(own=1.0), 9.0)
    seen(known, values(own=1.0), 9.0, claimed=False)
    assert known.slips == pytest.approx(1 / 300)


def test_claims_are_the_surest_kinds_that_together_are_hardly_ever_off() -> None:
    known = Calibration(slips=0.01)
    rng = np.random.default_rng(3)
    often, seldom = Key(0, 1, 3), Key(0, 2, 3)
    for k in range(1_000):
        key = seldom if k % 50 == 0 else often
        off = rng.random() < (0.05 if key == often else 0.1)
        seen(known, values(own=1.0), 2.0 if off else 1.0, key=key)
    sure, rare, common = Key(0, 3, 3), seldom, often
    for _ in range(10):
        seen(known, values(own=1.0), 1.0, key=sure)
    told = {key: known.assess(key, values(own=1.0)) for key in (sure, rare, common)}
    assert known.claims(sure, told[sure])
    assert told[common].probability > 0.9
    assert not known.claims(common, told[common])  # of 1,000 predictions 50 would be off
    assert not known.claims(sure, told[sure]._replace(speaker=PERSISTENCE))


def test_what_does_not_speak_any_more_is_not_held_against_who_does() -> None:
    known = Calibration(slips=0.001)
    for k in range(500):
        seen(known, values(own=1.0), 2.0 if k % 20 == 0 else 1.0)
    law = Key(0, -1, 7)
    for _ in range(5):
        seen(known, values(own=1.0), 1.0, key=law)
    assert known.claims(law, known.assess(law, values(own=1.0)))


def test_angles_are_off_the_short_way_round() -> None:
    known = Calibration()
    for _ in range(20):
        known.look_back(
            Audit(KEY, values(own=3.14159265358979, now=3.0)),
            -3.14159265358979,
            claimed=True,
            rounding=1e-9,
            error=0.05,
            turn=2 * math.pi,
        )
    assert known.assess(KEY, values(own=1.0)).probability > 0.9


def test_memory_is_bounded() -> None:
    known = Calibration()
    for k in range(3 * MEMORY):
        seen(known, values(own=1.0), 1.0 + (k % 7 == 0))
    (cell,) = [c for key, c in known._cells.items() if key == KEY]
    assert cell.records[OWN].trials <= MEMORY
    assert sum(cell.records[OWN].errors.values()) <= MEMORY + 1
    assert known.assess(KEY, values(own=1.0)).probability == pytest.approx(6 / 7, abs=0.02)


def test_long_runs_of_either_kind_are_taken() -> None:
    known = right(3 * MEMORY)
    for _ in range(3 * MEMORY):
        seen(known, values(own=1.0), 2.0)
    assert known.assess(KEY, values(own=1.0)).probability < 0.01
    for _ in range(3 * MEMORY):
        seen(known, values(own=1.0), 1.0)
    assert known.assess(KEY, values(own=1.0)).probability > 0.99


def test_modes_that_are_gone_are_forgotten() -> None:
    known = right(20)
    for _ in range(20):
        seen(known, values(own=1.0), 1.0, key=Key(0, -2, 7))
    known.keep((2, 3))
    assert {key.winner for key in known._cells if key.lead >= 0} == {-2}


@pytest.mark.parametrize("margin", [0.0, 0.1, 0.25, 1.0, 7.9, 1e9, math.inf])
def test_cells_are_the_same_one_by_one_and_together(margin: float) -> None:
    many = keys_of(np.zeros(3, dtype=np.int8), np.array([1, 2, 1]), np.array([margin, 1.0, margin]))
    found = {key: rows.tolist() for key, rows in many}
    assert found[key_of(0, 1, margin)] == [0, 2]
    assert found[key_of(0, 2, 1.0)] == [1]


@given(
    st.lists(
        st.tuples(
            st.integers(0, 4),
            st.sampled_from([-3, -1, 0, 1, 2, 2**31 - 1]),
            st.sampled_from([0.0, -1.0, math.nan, 1e-9, 0.3, 5.0, math.inf]),
        ),
        max_size=30,
    )
)
def test_many_predictions_lie_in_the_cells_that_each_of_them_lies_in(
    asked: list[tuple[int, int, float]],
) -> None:
    outcomes = np.array([outcome for outcome, _, _ in asked], dtype=np.int8)
    winners = np.array([winner for _, winner, _ in asked], dtype=np.int64)
    margins = np.array([margin for _, _, margin in asked], dtype=np.float64)
    cells = list(keys_of(outcomes, winners, margins))
    assert len({key for key, _ in cells}) == len(cells)
    told = {int(row): key for key, rows in cells for row in rows}
    assert [told[row] for row in range(len(asked))] == [key_of(*each) for each in asked]
    assert sum(len(rows) for _, rows in cells) == len(asked)


@given(st.lists(st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6)), max_size=60))
def test_saved_and_read_it_goes_on_as_before(steps: list[tuple[float, float]]) -> None:
    known = Calibration()
    for own, came in steps:
        seen(known, values(own=own), came)
    again = Calibration.from_json(json.loads(json.dumps(known.to_json())), 0.95)
    for each in (known, again):
        seen(each, values(own=1.0, linear=2.0), 2.0)
    assert known.to_json() == again.to_json()
    told = [each.assess(KEY, values(own=1.0, linear=2.0)) for each in (known, again)]
    np.testing.assert_array_equal(told[0], told[1])


def test_united_records_keep_both_models_cells() -> None:
    known, other = right(30), Calibration()
    for _ in range(10):
        seen(other, values(own=1.0), 2.0, key=Key(0, 9, 1))
    both = known.united(other)
    assert both.trials == 40
    assert both.assess(KEY, values(own=1.0)) == known.assess(KEY, values(own=1.0))
    assert both.assess(Key(0, 9, 1), values(own=1.0)).probability < 0.5
    assert copy.deepcopy(known).to_json() == known.to_json()
