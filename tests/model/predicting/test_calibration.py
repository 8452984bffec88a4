"""Cells of predictions: who speaks, how probably it is right, and how wide its interval is."""

from __future__ import annotations

import copy
import json
import math
import sys
from collections.abc import Iterator
from itertools import count, islice

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from relgym.config.constants import COVERED, EVIDENCE, FEW, FIRST, MEMORY, NEARLY_ALL, SUMMABLE
from relgym.mixing import GOLDEN, mixed_one
from relgym.model.predicting.calibration import (
    _EXACT,
    EXPERTS,
    GUESS,
    LATEST,
    OWN,
    PERSISTENCE,
    REGRESSION,
    Assessment,
    Audit,
    Calibration,
    Key,
    Rough,
    _Cell,
    _counted,
    _place,
    _quantile,
    _Record,
    far_bin,
    far_bins,
    key_of,
    keys_of,
    lead_bins,
    missed,
)
from relgym.program.records import OF_FAMILY, OF_WINNER

KEY = Key(0, 1, 3)
CLAIMS = (0.9, 0.0075)
"""Least probability of a claim, and share of predictions that may slip."""


def values(own: float = math.nan, regression: float = math.nan, now: float = 0.0) -> tuple[float, ...]:
    found = [math.nan] * len(EXPERTS)
    found[OWN], found[REGRESSION], found[PERSISTENCE] = own, regression, now
    return tuple(found)


def seen(
    known: Calibration, said: tuple[float, ...], came: float, key: Key = KEY, *, claimed: bool = True
) -> None:
    audit = Audit(key, said, known.assess(key, said).speaker)
    known.look_back(audit, came, claimed=claimed, rounding=1e-9, error=0.05)


def right(n: int) -> Calibration:
    known = Calibration(0.9)
    for _ in range(n):
        seen(known, values(own=1.0), 1.0)
    return known


def test_nothing_is_known_of_what_nobody_looked_back_at() -> None:
    told = Calibration(0.9).assess(KEY, values(own=1.0))
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
    assert known.assess(law, values(own=1.0)).probability == 0.5 / 5  # nothing stayed as it was, of 4
    known.vouch(3.0)  # always right by 8 to 1
    told = known.assess(law, values(own=1.0))
    assert told.probability == pytest.approx(1.0 - 0.5 / 9.0)
    assert known.claims(law, told)
    seen(known, values(own=1.0), 2.0, key=law)
    assert known.assess(law, values(own=1.0)).probability == pytest.approx(0.25 / 2.0)


def test_a_new_kind_of_prediction_begins_with_what_the_others_tell() -> None:
    known = right(50)
    assert known.assess(Key(0, 2, 3), values(own=1.0)).probability == pytest.approx(50.5 / 51)
    told = known.assess(Key(0, -1, 7), values(own=1.0))  # modes say nothing of laws
    assert (told.speaker, told.probability) == (PERSISTENCE, 0.5 / 51)
    assert known.assess(Key(3, 0, 0), values(own=1.0)) == told  # nor of another outcome


def test_a_new_mode_speaks_once_it_was_right_whoever_was_better_than_those_before_it() -> None:
    known = Calibration(0.9)
    for k in range(40):
        seen(known, values(own=5.0 * (-1) ** k, now=0.0), 0.1)
    assert known.assess(KEY, values(own=5.0)).speaker == PERSISTENCE
    new = Key(0, 2, 3)
    told = known.assess(new, values(own=5.0))
    assert told.speaker == PERSISTENCE
    assert told.spread == pytest.approx(0.1)
    assert not known.claims(new, told)
    seen(known, values(own=0.1), 0.1, key=new)
    assert known.assess(new, values(own=5.0)).speaker == OWN


def test_a_new_mode_speaks_at_once_where_those_before_it_were_right() -> None:
    known = right(40)
    told = known.assess(Key(0, 2, 3), values(own=5.0, regression=3.0))
    assert told.speaker == OWN
    assert known.claims(Key(0, 2, 3), told)


def test_where_laws_come_and_go_one_is_no_surer_than_all_of_them() -> None:
    known = Calibration(0.5)
    for mode in range(1, 7):
        for k in range(100):
            seen(known, values(own=1.0), 1.0 if k < 90 or mode == 6 else 4.0, Key(0, mode, 3))
    key = Key(0, 6, 3)
    sure = known.assess(key, values(own=1.0))
    assert sure.probability > 0.99 and known.claims(key, sure)
    known.fleeting = True
    told = known.assess(key, values(own=1.0))
    assert told.probability == pytest.approx(0.9, abs=0.02)
    assert told.speaker == OWN and not known.claims(key, told)
    assert told.interval > 2.0  # one in ten was off by 3
    again = Calibration.from_json(known.to_json(), 0.5)
    assert again.fleeting and again.assess(key, values(own=1.0)) == told
    for merged in (known.united(right(5)), right(5).united(known), right(900).united(known)):
        assert merged.fleeting


@pytest.mark.parametrize(("hits", "misses"), [(100, 3), (500, 2)])
def test_a_few_misses_of_a_sure_law_end_its_record(hits: int, misses: int) -> None:
    known = right(hits)
    for _ in range(misses - 1):
        seen(known, values(own=1.0), 2.0)
        assert known.assess(KEY, values(own=1.0)).probability > 0.97
    seen(known, values(own=1.0), 2.0)
    assert known.assess(KEY, values(own=1.0)).probability < 0.2


def test_a_run_of_hits_of_what_was_right_half_the_time_do_so_too() -> None:
    known = Calibration(0.9)
    for k in range(100):
        seen(known, values(own=1.0), 1.0 + k % 2)
    assert known.assess(KEY, values(own=1.0)).probability == pytest.approx(0.5, abs=0.05)
    for _ in range(FEW):
        assert known.assess(KEY, values(own=1.0)).probability < 0.7
        seen(known, values(own=1.0), 1.0)
    assert known.assess(KEY, values(own=1.0)).probability > 0.9


def test_a_hit_is_off_by_a_part_of_what_mostly_changes() -> None:
    known = Calibration(0.9)
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
    known = Calibration(0.9)
    spoke = []
    for came in rng.normal(size=60).tolist():
        said = values(own=came + float(rng.normal()), regression=came + 0.5 * float(rng.normal()))
        spoke.append(known.assess(KEY, said).speaker)
        seen(known, said, came)
    assert spoke[0] == OWN
    assert spoke[-1] == REGRESSION
    assert spoke == sorted(spoke)  # it takes over once


def test_where_a_cell_tells_little_who_codes_best_in_all_of_them_speaks() -> None:
    """Regressions are twice as close as persistence: 20 trials of it are 20 bits, 8 of them 8."""
    known, little, enough = Calibration(0.9), Key(2, 0, 0), Key(3, 0, 0)
    for _ in range(FEW):
        seen(known, values(now=0.0), 0.0, key=little, claimed=False)  # so persistence speaks there
        seen(known, values(now=0.0), 0.0, key=enough, claimed=False)
    said = values(regression=1.0, now=0.0)
    for _ in range(8):
        seen(known, said, 2.0, key=little, claimed=False)
    assert known.assess(little, said).speaker == PERSISTENCE  # by 8 bits there, and everywhere
    for _ in range(20):
        seen(known, said, 2.0, key=KEY._replace(outcome=1), claimed=False)
    assert known.assess(little, said).speaker == REGRESSION
    for _ in range(20):
        seen(known, values(regression=2.0, now=0.0), 0.0, key=enough, claimed=False)
    assert known.assess(enough, said).speaker == PERSISTENCE  # which was never off there


def test_where_a_lead_tells_little_all_that_its_winner_said_does() -> None:
    known, rare = Calibration(0.5), KEY._replace(lead=5)
    rng = np.random.default_rng(4)
    for k in range(200):
        came = float(rng.random() < 0.3)  # a flag that nobody foresees is most closely told by its mean
        seen(known, values(own=0.0, regression=0.3), came, key=KEY if k % 5 else rare)
    assert known.assess(KEY, values(own=0.0, regression=0.3)).speaker == REGRESSION
    told = known.assess(rare, values(own=0.0, regression=0.3))
    assert told.speaker == REGRESSION
    assert not known.claims(rare, told)


def test_modes_vouch_for_a_new_one_by_what_they_said_of_changes() -> None:
    known, new = Calibration(0.9), KEY._replace(winner=2)
    for _ in range(200):
        seen(known, values(own=1.0, now=1.0), 1.0)  # nothing changes, and one mode says so
    assert known.assess(new, values(own=2.0, now=1.0)).speaker == PERSISTENCE
    for _ in range(20):
        seen(known, values(own=2.0, now=1.0), 2.0)
    assert known.assess(new, values(own=2.0, now=1.0)).speaker == OWN


def test_a_mode_that_is_not_reliable_is_to_prove_itself() -> None:
    known, new, said = right(50), KEY._replace(winner=2), values(own=1.0)
    assert known.assess(new, said).speaker == OWN
    known.reliable = frozenset({KEY.winner})
    assert known.assess(new, said).speaker == PERSISTENCE
    assert known.assess(KEY, said).speaker == OWN  # which was right itself
    for _ in range(4):
        seen(known, said, 1.0, key=new)
    assert known.assess(new, said).speaker == OWN


def test_an_only_mode_that_explains_all_examples_is_believed_untried() -> None:
    known, said = Calibration(0.9), values(own=1.0)
    for _ in range(50):
        seen(known, values(now=0.5), 1.0, key=Key(2, 0, 0))  # nobody won yet
    known.reliable, untried = frozenset({KEY.winner}), known.assess(KEY, said)
    assert untried.speaker == PERSISTENCE
    known.proven = 10
    told = known.assess(KEY, said)
    assert told.speaker == OWN and told.probability == pytest.approx(1.0 - 0.5 / (2.0**10 + 1.0), rel=1e-3)
    assert known.claims(KEY, told)
    # A table that says of any prediction what it says names the mode, too.
    rows = {(key, able): (told, claimed) for key, able, told, claimed in known.table(6, [1])}
    assert rows[KEY._replace(lead=OF_WINNER), 1] == (told, True)
    for _ in range(3):
        seen(known, said, 2.0)
    assert known.assess(KEY, said).probability < 0.5


def test_what_few_trials_of_a_kind_tell_is_filled_up_by_those_of_its_winner() -> None:
    known, said = Calibration(0.9), values(regression=1.0, now=0.0)
    for k in range(400):
        seen(known, said, 1.0 if k % 10 == 0 else 2.0)  # right one time in ten
    other = KEY._replace(lead=5)
    for _ in range(3):
        seen(known, said, 1.0, key=other)
    told = known.assess(other, said)
    assert told.speaker == REGRESSION
    assert 0.1 < told.probability < 0.25  # three hits of three
    for _ in range(4 * FEW):  # of who is fitted n trials count for n / 3
        seen(known, said, 1.0, key=other)
    assert known.assess(other, said).probability > 0.9


def test_regression_speaks_where_nobody_looked_back_if_it_leaves_little_of_other_rows() -> None:
    known, new, said = right(50), KEY._replace(winner=2), values(own=1.0, regression=2.0)
    known.reliable = frozenset({KEY.winner})
    assert known.assess(new, said).speaker == PERSISTENCE
    known.regressed(1000.0, 990.0, 1000.0)  # ahead by 7 bits, which is too little
    assert known.assess(new, said).speaker == PERSISTENCE
    known.regressed(1000.0, 500.0, 1000.0)
    assert known.assess(new, said).speaker == REGRESSION
    assert known.assess(KEY, said).speaker == OWN  # which was right there
    again = Calibration.from_json(json.loads(json.dumps(known.to_json())), 0.9)
    again.reliable = known.reliable
    assert again.assess(new, said) == known.assess(new, said)


def test_what_regression_leaves_is_taken_in_once_somebody_looked_back() -> None:
    known = Calibration(0.9)
    known.regressed(1000.0, 500.0, 1000.0)
    assert known.to_json() == Calibration(0.9).to_json()


def test_of_regression_late_trials_count_for_more() -> None:
    known, errors = Calibration(0.9), np.linspace(3.0, 0.0, 200).tolist()  # it is off by less and less
    for off in errors:
        seen(known, values(regression=off, now=4.0), 0.0)
    trials, squares, base = known._cells[KEY].squares[REGRESSION]
    weights = np.square(np.arange(1, 201) / 200.0)  # of the i-th of n trials: (i / n)^2
    assert squares / trials == pytest.approx(np.average(np.square(errors), weights=weights), rel=0.05)
    assert (trials, base / trials) == (200.0, pytest.approx(16.0))


def test_what_held_last_is_no_law_and_speaks_only_where_something_changes() -> None:
    known, said = Calibration(0.9), list(values(own=0.0, now=1.0))
    said[LATEST] = 1.0
    for _ in range(40):
        seen(known, tuple(said), 1.0)
    assert known.assess(KEY, tuple(said)).speaker == PERSISTENCE  # as right, and simpler
    known = Calibration(0.9)
    for _ in range(FEW):
        seen(known, values(own=0.0, now=1.0), 0.4)  # persistence is worse, and nobody knew what held last
    for _ in range(4):
        seen(known, tuple(said), 1.0)
    assert known.assess(KEY, tuple(said)).speaker != LATEST
    known, said[PERSISTENCE] = Calibration(0.9), 0.5
    for _ in range(40):
        seen(known, tuple(said), 1.0)
    told, record = known.assess(KEY, tuple(said)), known._cells[KEY].records[LATEST]
    prior = known._cells[KEY._replace(lead=OF_FAMILY)].records[LATEST].mean(0.5)
    assert told.speaker == LATEST
    assert told.probability == record.mean(prior) < record.share(prior)


def test_who_never_leads_by_ten_bits_never_speaks() -> None:
    known = Calibration(0.9)
    rng = np.random.default_rng(1)
    for came in rng.normal(size=FEW).tolist():
        seen(known, values(own=0.0, regression=0.01 * came), came)
    assert known.assess(KEY, values(own=0.0, regression=0.0)).speaker == OWN


def test_a_law_that_can_be_claimed_keeps_the_word_where_it_is_hardly_worse() -> None:
    for off, speaker in ((0.0105, OWN), (0.0115, REGRESSION)):
        known = Calibration(0.9)
        for k in range(500):
            came = 1.0 + 0.1 * (k % 5)
            seen(known, values(own=came + off, regression=came + 0.01), came)
        assert known.assess(KEY, values(own=1.0, regression=1.0)).speaker == speaker


def test_another_speaks_for_an_approximation_who_leaves_less_in_all_cells() -> None:
    """The regression is twice as close there as here; so it is where the mode is hardly ever right, and not else."""
    for hits, speaker in ((4, REGRESSION), (10, OWN)):
        known, other = Calibration(0.9), KEY._replace(outcome=1)
        for k in range(100):
            came = 1.0 if k % 2 else -1.0
            seen(known, values(own=0.7 * came if k % 10 >= hits else came, regression=0.7 * came), came)
            seen(known, values(regression=0.8 * came), came, key=other, claimed=False)
        for _ in range(100):
            seen(known, values(regression=1.0), 1.0, key=other, claimed=False)
        assert known.assess(KEY, values(own=1.0, regression=1.0)).speaker == speaker


def test_what_leaves_more_here_does_not_speak_for_what_leaves_little() -> None:
    """Nor what leaves a smaller share elsewhere, where more changes."""
    known, other = Calibration(0.9), KEY._replace(outcome=1)
    for k in range(200):
        came = 1.0 if k % 2 else -1.0
        seen(known, values(own=0.7 * came, regression=0.0), came)
        seen(known, values(regression=9.0 * came), 10.0 * came, key=other, claimed=False)
    assert known.assess(KEY, values(own=1.0, regression=1.0)).speaker == OWN


def test_an_approximation_that_says_no_more_than_that_nothing_changes_is_no_better_than_that() -> None:
    """Regressions speak that leave little in all cells, more here, too; but a rule that holds nearly always does."""
    for hits, speaker in ((15, REGRESSION), (19, OWN)):
        known, other = Calibration(0.9), KEY._replace(outcome=1)
        for k in range(200):
            came = 0.0 if k % 20 < hits else 1.0
            seen(known, values(own=0.0, regression=0.6), came)
            seen(known, values(regression=9.0), 10.0, key=other, claimed=False)
        assert known.assess(KEY, values(own=0.0, regression=0.6)).speaker == speaker


def test_calm_times_make_no_law_of_what_was_right_more_often_than_not() -> None:
    known = Calibration(0.9)
    for k in range(100):
        seen(known, values(own=1.0), 1.0 + (k % 4 == 0))
    for _ in range(5 * FEW):
        seen(known, values(own=1.0), 1.0)
    assert known.assess(KEY, values(own=1.0)).probability == pytest.approx(
        (75 + 5 * FEW) / (100 + 5 * FEW), abs=0.01
    )


def test_nothing_changes_speaks_where_a_mode_is_worse() -> None:
    known = Calibration(0.9)
    for k in range(40):
        seen(known, values(own=5.0 * (-1) ** k, now=0.0), 0.1)
    assert known.assess(KEY, values(own=5.0)).speaker == PERSISTENCE


def test_an_expert_without_a_value_is_no_speaker() -> None:
    known = Calibration(0.9)
    for _ in range(40):
        seen(known, values(own=5.0, regression=1.0), 1.0)
    assert known.assess(KEY, values(own=5.0, regression=1.0)).speaker == REGRESSION
    told = known.assess(KEY, values(own=5.0))
    assert told.speaker == PERSISTENCE  # which is off by 1, not by 4
    assert told.probability <= 0.5 / 41  # and never was right, though it never spoke
    for _ in range(60):  # what the regression knew is learned by a law, and nobody asks it any more
        seen(known, values(own=1.0), 1.0)
    told = known.assess(KEY, values(own=1.0))
    assert told.probability > 0.9


def test_intervals_hold_what_they_say() -> None:
    rng = np.random.default_rng(2)
    known = Calibration(0.9)
    inside = []
    for came in rng.normal(size=4_000).tolist():
        half = known.assess(KEY, values(own=0.0)).interval
        if math.isfinite(half):
            inside.append(abs(came) <= half)
        seen(known, values(own=0.0), came)
    assert len(inside) == 4_000 - 19
    assert 0.93 <= np.mean(inside[200:]) <= 0.97


def test_slips_are_claims_that_were_off() -> None:
    known = right(298)
    seen(known, values(own=1.0), 9.0)
    seen(known, values(own=1.0), 9.0, claimed=False)
    assert known.slips == pytest.approx(1 / 300)


def test_claims_are_the_surest_kinds_that_together_are_hardly_ever_off() -> None:
    known = Calibration(0.9, slips=0.01)
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
    known = Calibration(0.9, slips=0.001)
    for k in range(500):
        seen(known, values(own=1.0), 2.0 if k % 20 == 0 else 1.0)
    law = Key(0, -1, 7)
    for _ in range(5):
        seen(known, values(own=1.0), 1.0, key=law)
    assert known.claims(law, known.assess(law, values(own=1.0)))


def test_angles_are_off_the_short_way_round() -> None:
    known = Calibration(0.9)
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
    known = Calibration(0.9)
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


def test_who_was_right_and_is_always_wrong_fails() -> None:
    known = right(100)
    assert not known.failing(KEY)
    for misses in range(1, 15):
        seen(known, values(own=1.0), 2.0)
        # The first misses end the record of hits; then ten of them are news.
        assert known.failing(KEY) == (misses >= 10)
    seen(known, values(own=1.0), 1.0)
    assert not known.failing(KEY)
    assert not known.failing(Key(0, 7, 0))  # who never won


def test_modes_that_are_gone_are_forgotten() -> None:
    known = right(20)
    for _ in range(20):
        seen(known, values(own=1.0), 1.0, key=Key(0, -2, 7))
    known.keep((2, 3))
    assert {key.winner for key in known._cells if key.lead >= 0} == {-2}
    # What all modes said tells a new one how to begin, whoever is gone.
    assert {key for key in known._cells if key.lead == OF_FAMILY} == {
        Key(0, 1, OF_FAMILY),
        Key(0, -1, OF_FAMILY),
    }


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
    known = Calibration(0.9)
    for own, came in steps:
        seen(known, values(own=own), came)
    again = Calibration.from_json(json.loads(json.dumps(known.to_json())), 0.95)
    for each in (known, again):
        seen(each, values(own=1.0, regression=2.0), 2.0)
    assert known.to_json() == again.to_json()
    told = [each.assess(KEY, values(own=1.0, regression=2.0)) for each in (known, again)]
    np.testing.assert_array_equal(told[0], told[1])


def test_united_records_keep_both_models_cells() -> None:
    known, other = right(30), Calibration(0.9)
    for _ in range(10):
        seen(other, values(own=1.0), 2.0, key=Key(0, 9, 1))
    both = known.united(other)
    assert both.trials == 40
    assert both.assess(KEY, values(own=1.0)) == known.assess(KEY, values(own=1.0))
    assert both.assess(Key(0, 9, 1), values(own=1.0)).probability < 0.5
    assert copy.deepcopy(known).to_json() == known.to_json()


# ---------------------------------------------------------------------- records of one expert
def record(hits: int, misses: int, *, hits_first: bool = True) -> _Record:
    """What was counted of a run of hits and one of misses."""
    found = _Record()
    for hit in [True] * hits + [False] * misses if hits_first else [False] * misses + [True] * hits:
        found.count(0.0 if hit else 2.0, 1.0)
    return found


@pytest.mark.parametrize(("hits", "misses"), [(255, 2), (11, 3)])
def test_a_run_of_misses_ends_a_record_at_ten_bits(hits: int, misses: int) -> None:
    # A miss after n hits has the probability 1/2 / (n + 1), so m of them say m (1 + log2(n + 1)) bits; that they begin
    # after just so many takes log2(n + 1) of these. After 255 hits two misses say 2 * 9 - 8 = 10, after 254 a little
    # less; after 11 hits three say 3 + 2 * 3.58 = 10.2, after 10 hits 9.9.
    for n, ended in ((hits, True), (hits - 1, False)):
        found = record(n, misses - 1)
        assert (found.trials, found.hits, found.run) == (n + misses - 1, n, 1 - misses)
        assert found.count(2.0, 1.0) is ended
        assert (found.trials, found.hits) == ((misses, 0) if ended else (n + misses, n))


def test_a_run_of_hits_ends_a_record_when_it_is_no_short_one() -> None:
    # After 255 misses two hits say ten bits, too, but only so many as tell a record of their own are believed. The new
    # one begins with the miss before them: what failed once isn't always right.
    found = record(FEW - 1, 255, hits_first=False)
    assert (found.trials, found.hits) == (255 + FEW - 1, FEW - 1)
    assert found.count(0.0, 1.0)
    assert (found.trials, found.hits, found.runs) == (FEW + 1, FEW, [0.0] * 6)


def test_hits_alone_end_nothing() -> None:
    found = _Record()
    assert not any(found.count(0.0, 1.0) for _ in range(MEMORY))
    assert (found.trials, found.hits, found.run) == (MEMORY, MEMORY, MEMORY)


def test_runs_are_counted_when_they_are_over() -> None:
    found = _Record()
    for hit, length in ((True, 3), (False, 2), (True, 2), (False, 1)):
        for _ in range(length):
            found.count(0.0 if hit else 2.0, 1.0)
    assert found.runs == [2.0, 5.0, 1.0, 2.0, 0.0, 0.0]  # the last one isn't over
    assert (found.trials, found.hits, found.run) == (8, 5, -1)


def test_where_misses_come_in_long_runs_another_one_is_no_news() -> None:
    # 32 hits and 8 misses; a first miss has the probability 1 - 32.5 / 41 = 8.5 / 41, and says 2.27 bits.
    # Where the misses came one by one each other one says as much, and 7 in a row, less the log2(41) = 5.36 bits of
    # when they begin, are 10.5 bits; where they came in one run, each other one has the probability
    # (8 - 1 + 8.5 / 41) / 9 = 0.80 and says 0.32 bits: it takes 42 of them until 2.27 + 41 * 0.32 - 5.36 > 10.
    first, after = math.log2(41 / 8.5), math.log2(9.0 / (7.0 + 8.5 / 41.0))
    alone = math.ceil((10.0 + math.log2(41)) / first)
    together = 1 + math.ceil((10.0 + math.log2(41) - first) / after)
    assert (alone, together) == (7, 42)
    for runs, length in (([8.0, 31.0, 8.0, 9.0], alone), ([8.0, 31.0, 1.0, 2.0], together)):
        known = _Record(40.0, 32.0, 1, {}, [*runs, 0.0, 0.0])
        ended = [known.count(2.0, 1.0) for _ in range(length)]
        assert ended == [False] * (length - 1) + [True]


def test_the_older_half_of_a_record_counts_half() -> None:
    found = record(768, 0)
    for _ in range(256):  # one miss in four from here on: nothing that ends a record
        found.count(2.0 if found.trials % 4 == 3 else 0.0, 1.0)
    assert (found.trials, found.hits) == (1024, 960)
    found.count(0.0, 1.0)
    assert (found.trials, found.hits) == (512.5, 480.5)
    assert sum(found.errors.values()) == 512.5


def test_who_was_believed_twice_and_failed_is_not_believed_at_once() -> None:
    """Phases in which little happens come and go; what they tell is the share of hits in both."""
    found, quiet, active = _Record(), [], []
    for _ in range(5):
        active += [found.count(1.0, 0.1) for _ in range(60)]
        quiet += [found.count(0.0, 0.1) for _ in range(100)]
        shares = found.hits / found.trials
        if len(quiet) == 200:
            assert shares > 0.95
            assert found.runs[4:] == [0.0, 100.0]
    assert [any(quiet[k : k + 100]) for k in range(0, 500, 100)] == [True, True, False, False, False]
    assert 0.5 < shares < 0.8
    assert found.runs[4:] == [100.0, 100.0]  # nothing ended it since
    # What goes on is believed in the end, as the older half of a record counts half again and again.
    assert not any(found.count(0.0, 0.1) for _ in range(5_000))
    assert found.share(0.5) > 0.99


def test_past_runs_are_kept_in_files() -> None:
    known = Calibration(0.9)
    for k in range(400):
        seen(known, values(own=1.0 if k % 100 < 60 else 2.0), 1.0)
    data = json.loads(json.dumps(known.to_json()))
    lengths = {len(record[5]) for cell in data["cells"] for record in cell["records"]}
    assert lengths == {4, 6}
    again = Calibration.from_json(data, known.probability, known.allowed)
    assert [c.records for c in again._cells.values()] == [c.records for c in known._cells.values()]


def test_runs_are_halved_with_what_they_are_of() -> None:
    # 513 hits, a miss, 511 hits: the first run of hits is over. The miss after them ends the second one, and 1,025
    # trials in runs are more than are remembered.
    found = _Record(600.0, 540.0, 511, {}, [1.0, 513.0, 1.0, 1.0, 0.0, 0.0])
    found.count(2.0, 1.0)
    assert found.runs[:4] == [0.5, 512.0, 0.5, 1.0]


def test_shares_by_hand() -> None:
    # Jeffreys' prior: n hits in a row have the probability 1/2 3/4 5/6 ..., where hits come in some share; that what
    # speaks is always right is as likely before.
    assert _Record().share(0.3) == 0.3
    assert _Record().mean(0.3) == 0.3
    assert record(1, 0).share(0.5) == pytest.approx((0.75 * 0.5 + 1.0) / 1.5)
    assert record(2, 0).share(0.5) == pytest.approx((5 / 6 * 3 / 8 + 1.0) / (3 / 8 + 1.0))
    assert record(2, 0).share(0.5, bits=3.0) == pytest.approx((5 / 6 * 3 / 64 + 1.0) / (3 / 64 + 1.0))
    assert _Record().share(0.5, bits=3.0) == pytest.approx((0.5 / 8 + 1.0) / (1 / 8 + 1.0))
    # A miss ends that hope, however sure: what is left is the mean.
    assert record(2, 1).share(0.8, bits=99.0) == record(2, 1).mean(0.8) == pytest.approx(2.8 / 4)


@given(st.lists(st.booleans(), max_size=300), st.floats(0.0, 1.0), st.floats(0.0, 50.0))
def test_shares_are_probabilities_and_records_bounded(hits: list[bool], prior: float, bits: float) -> None:
    known = _Record()
    for hit in hits:
        known.count(0.0 if hit else 2.0, 1.0)
    assert 0.0 <= known.hits <= known.trials <= MEMORY
    assert 0.0 <= known.mean(prior) <= known.share(prior, bits) <= 1.0
    assert known.share(prior, bits) <= known.share(prior, bits + 1.0)
    assert known.run == (0 if not hits else len(hits) if False not in hits else _run(hits))


def _run(hits: list[bool]) -> int:
    length = 0
    for hit in reversed(hits):
        if hit != hits[-1]:
            break
        length += 1
    return length if hits[-1] else -length


# ---------------------------------------------------------------------- sizes of errors
def test_bins_are_quarters_of_octaves() -> None:
    assert [_place(x) for x in (0.0, 0.25, 0.5, 1.0, 1.0001, 2.0**0.25, 1.2, 2.0, 2.1)] == [
        _EXACT,
        -8,
        -4,
        0,
        1,
        1,
        2,
        4,
        5,
    ]


def test_of_many_sizes_the_older_ones_count_half_and_few_nothing() -> None:
    known = {0: 1023.0, 5: 2.0**-10, 6: 2.0**-8}
    found = _counted(known, 7)
    assert found == {0: 511.5, 6: 2.0**-9, 7: 0.5}
    assert _counted({0: 1022.0}, 7) == {0: 1022.0, 7: 1.0}


def test_quantiles_by_hand() -> None:
    assert _quantile({}, 0.95) == 0.0
    # 19 sizes in (2^-1/4, 1] and one more: 95 % of 20 are 19, all of them.
    assert _quantile({0: 19.0}, 0.95) == 1.0
    # Half of 4 and one more is 2.5: 2.5 / 4 of the way through the bin.
    assert _quantile({0: 4.0}, 0.5) == pytest.approx(2.0 ** ((-1.0 + 2.5 / 4.0) / 4.0))
    # Of 8 and one more 4.5: a half of the way through the second one.
    assert _quantile({-4: 4.0, 3: 1.0, 8: 3.0}, 0.5) == pytest.approx(2.0 ** (2.5 / 4.0))
    # More is asked for than there is: the largest.
    assert _quantile({0: 3.0, 4: 1.0}, 0.95) == 2.0
    # Exact ones are sizes of 0, unless they are left aside.
    assert _quantile({_EXACT: 10.0, 0: 4.0}, 0.5) == 0.0
    assert _quantile({_EXACT: 10.0, 0: 4.0}, 0.5, exact=10.0) == _quantile({0: 4.0}, 0.5)
    assert _quantile({_EXACT: 10.0}, 0.5, exact=10.0) == 0.0


@given(st.lists(st.floats(1e-12, 1e12), min_size=1, max_size=200), st.sampled_from([0.5, 0.95]))
def test_quantiles_are_within_a_bin_of_the_order_statistic(sizes: list[float], share: float) -> None:
    bins: dict[int, float] = {}
    for size in sizes:
        bins = _counted(bins, _place(size))
    place = math.ceil(share * (len(sizes) + 1.0))  # split conformal prediction
    exact = sorted(sizes)[min(place, len(sizes)) - 1]
    assert abs(math.log2(_quantile(bins, share) / exact)) <= 0.25 + 1e-9


def test_what_mostly_changes_is_a_median_of_changes() -> None:
    known = Calibration(0.9)
    assert known.change == 0.0
    for came in [0.0] * 50 + [1.0] * 2 + [8.0] * 2 + [64.0]:
        seen(known, values(own=came), came)
    # Five changes and one more, half of which is 3: the second half-way through the bin of 8.
    assert known.change == pytest.approx(2.0 ** ((12 - 1 + 0.5) / 4.0))
    known = Calibration(0.9)
    for _ in range(5):
        seen(known, values(own=0.0), 1e-10)  # less than rounding
    assert known.change == 0.0


# ---------------------------------------------------------------------- who speaks
def cell(hits: float, trials: float, *, heard: float = 0.0, speaker: int = OWN) -> _Cell:
    """A cell of a winner that was right so often, and leaves nothing of what persistence leaves."""
    found = _Cell.new(speaker, len(EXPERTS))
    found.records[speaker] = _Record(trials, hits)
    found.squares[speaker] = [trials, 0.0, trials]
    found.squares[PERSISTENCE] = [trials, trials, trials]
    found.heard = heard
    return found


def test_leads_by_hand() -> None:
    found = _Cell.new(OWN, len(EXPERTS))
    found.squares[OWN] = [8.0, 4.0, 32.0]
    found.squares[REGRESSION] = [6.0, 1.0, 32.0]
    assert (found.left(OWN), found.left(REGRESSION)) == (1 / 8, 1 / 32)
    # Normal errors of unknown size: half of log2(left / left) bits for each trial of who was heard less.
    assert found.lead(REGRESSION, OWN) == pytest.approx(0.5 * 6.0 * 2.0)
    assert found.lead(OWN, REGRESSION) == pytest.approx(-6.0)
    # Who was never heard has left everything: any other one leads.
    assert found.left(GUESS) == math.inf
    assert found.lead(REGRESSION, GUESS) == pytest.approx(0.5 * 6.0 * math.log2(sys.float_info.max))


@pytest.mark.parametrize("size", [1e11, 1e100, 1e150])
def test_exact_laws_of_huge_changes_lead_by_finite_bits(size: float) -> None:
    """What they leave of the squares is less than the smallest number there is."""
    found, errors = _Cell.new(PERSISTENCE, len(EXPERTS)), [math.nan] * len(EXPERTS)
    errors[OWN], errors[REGRESSION], errors[PERSISTENCE] = 0.0, 0.0, size
    for _ in range(300):
        found.count(errors, 0.5)
    assert found.speaker == OWN
    assert found.lead(OWN, REGRESSION) == found.lead(REGRESSION, OWN) == 0.0
    assert found.lead(OWN, PERSISTENCE) == pytest.approx(0.5 * 300 * math.log2(sys.float_info.max))
    assert found.lead(PERSISTENCE, OWN) == -found.lead(OWN, PERSISTENCE)


def test_another_expert_takes_over_at_ten_bits() -> None:
    # A quarter of the squares are 1 bit for each trial.
    found, errors = _Cell.new(OWN, len(EXPERTS)), [math.nan] * len(EXPERTS)
    errors[OWN], errors[REGRESSION], errors[PERSISTENCE] = 2.0, 1.0, 4.0
    spoke = []
    for _ in range(11):
        found.count(errors, 0.5)
        spoke.append(found.speaker)
    assert spoke == [OWN] * 9 + [REGRESSION] * 2
    # Its record goes back to where it had a value, of which late trials count for more; of its errors it begins now.
    assert (found.records[OWN].trials, found.records[REGRESSION].trials) == (
        11.0,
        pytest.approx((11.0 + 2.0) / 3.0),
    )
    assert sum(found.records[REGRESSION].errors.values()) == 1.0


def test_squares_of_many_trials_are_halved() -> None:
    found, errors = _Cell.new(OWN, len(EXPERTS)), [math.nan] * len(EXPERTS)
    errors[OWN], errors[PERSISTENCE] = 0.0, 2.0
    found.squares[OWN], found.squares[PERSISTENCE] = [1024.0, 8.0, 4096.0], [1023.0, 4092.0, 4092.0]
    found.count(errors, 0.5)
    assert found.squares[OWN] == [513.0, 4.0 - 4.0 / 256.0, 2052.0]  # a late one counts for three
    assert found.squares[PERSISTENCE] == [1024.0, 4096.0, 4096.0]
    assert found.squares[REGRESSION] == [0.0, 0.0, 0.0]  # had nothing to say


@given(trials=st.integers(1, 1000), times=st.integers(1, 1000))
def test_squares_are_never_below_nothing(trials: int, times: int) -> None:
    """However many trials one stands for, and though nothing is added to them."""
    found, errors = _Cell.new(OWN, len(EXPERTS)), [math.nan] * len(EXPERTS)
    errors[OWN] = errors[PERSISTENCE] = 0.0
    found.squares[OWN] = [float(trials), 8.0, 4096.0]
    found.count(errors, 0.5, times)
    assert min(found.squares[OWN]) >= 0.0


def test_a_law_that_broke_is_measured_anew() -> None:
    found, errors = _Cell.new(OWN, len(EXPERTS)), [math.nan] * len(EXPERTS)
    errors[PERSISTENCE] = 4.0
    for own in [0.0] * 255 + [4.0, 4.0]:  # see above: the second miss ends the record
        errors[OWN] = own
        found.count(errors, 0.5)
    assert found.squares[OWN] == [1.0, 16.0, 16.0]
    assert found.squares[PERSISTENCE] == [
        EVIDENCE + 1.0,
        16.0 * (EVIDENCE - 2.0) + 48.0,
        16.0 * (EVIDENCE - 2.0) + 48.0,
    ]


def test_a_law_keeps_the_word_by_hand() -> None:
    """It must be likely enough, and what anybody would try must leave nearly as much."""

    def prefers(
        share: float, left: float, other: float = 0.5, able: tuple[int, ...] = (OWN, REGRESSION, PERSISTENCE)
    ) -> int:
        found = _Cell.new(REGRESSION, len(EXPERTS))
        found.records = {
            OWN: _Record(99.0, 100.0 * share - 0.5),
            REGRESSION: _Record(99.0, 100.0 * other - 0.5),
        }
        found.squares[OWN] = [99.0, left * left, 1.0]
        found.squares[REGRESSION] = [99.0, 1e-4, 1.0]
        found.squares[PERSISTENCE] = [99.0, 1.0, 1.0]
        return found.preferred(able, CLAIMS)

    least = 0.01 / NEARLY_ALL
    assert prefers(0.905, 0.999 * least) == OWN
    assert prefers(0.905, 1.001 * least) == REGRESSION  # leaves too much
    assert prefers(0.895, 0.999 * least) == REGRESSION  # can't be claimed
    assert prefers(0.955, 0.999 * least, other=0.96) == REGRESSION  # is right less often than who codes best
    assert prefers(0.965, 0.999 * least, other=0.96) == OWN
    assert prefers(0.9935, 0.999 * least, other=0.999) == OWN  # often enough for all to be claimed
    assert prefers(0.9915, 0.999 * least, other=0.999) == REGRESSION
    assert prefers(0.999, 0.999 * least, able=(REGRESSION, PERSISTENCE)) == REGRESSION  # has no value
    assert prefers(0.5, 0.02, able=(OWN, PERSISTENCE)) == OWN  # who speaks has none: the next best


def test_a_law_that_is_right_only_where_nothing_changes_explains_nothing() -> None:
    """Of a number that is 0 but for a few steps a law is nearly always right whose terms are 0, too."""

    def speaks(hits: float, squares: float) -> int:
        found = _Cell.new(REGRESSION, len(EXPERTS))
        found.records = {
            OWN: _Record(200.0, hits),
            PERSISTENCE: _Record(200.0, 195.0),
            REGRESSION: _Record(200.0, 150.0),
        }
        found.squares[OWN], found.squares[PERSISTENCE] = [200.0, squares, 4.0], [200.0, 4.0, 4.0]
        found.squares[REGRESSION] = [200.0, 3.9, 4.0]
        return found.preferred((OWN, REGRESSION, PERSISTENCE), (0.5, 0.0075))

    assert speaks(194.0, 4.2) == REGRESSION  # in .97 of all, where that nothing changes is right in .975
    assert speaks(194.0, 3.9) == OWN  # leaves less
    assert speaks(195.0, 4.2) == OWN  # is right as often: a crash or two make most of the squares
    assert speaks(194.0, 4.0) == OWN  # says that nothing changes


def test_a_guess_takes_no_law_the_word_but_an_added_class_does() -> None:
    """What nobody would have tried first says nothing of a law that is right often enough."""
    for other, speaker in (
        (GUESS, OWN),
        (LATEST, OWN),
        (PERSISTENCE, REGRESSION),
        (len(EXPERTS), REGRESSION),
    ):
        found = _Cell.new(REGRESSION, len(EXPERTS) + 1)
        found.records[OWN] = _Record(99.0, 99.0)
        for expert, left in ((OWN, 0.5), (REGRESSION, 0.5), (other, 0.1)):
            found.squares[expert] = [99.0, left, 1.0]
        assert found.preferred((OWN, REGRESSION, other), CLAIMS) == speaker


def test_the_first_who_has_a_value_speaks_before_anything_is_known() -> None:
    known = Calibration(0.9)
    some = list(values())
    assert known.assess(KEY, some).speaker == PERSISTENCE
    some[LATEST] = 1.0
    assert known.assess(Key(1, 0, 0), some).speaker == PERSISTENCE
    some[REGRESSION] = 1.0
    assert known.assess(Key(1, 0, 1), some).speaker == REGRESSION
    some[GUESS] = 1.0
    assert known.assess(Key(2, 0, 0), some).speaker == GUESS
    some[OWN] = 1.0
    assert known.assess(Key(3, 0, 0), some).speaker == OWN


def test_a_cell_of_few_trials_lets_its_winner_tell_who_speaks() -> None:
    known = Calibration(0.9)
    winner, here = KEY._replace(lead=OF_WINNER), KEY
    other = KEY._replace(lead=KEY.lead + 1)
    often = cell(60.0, 64.0, speaker=REGRESSION)
    known._cells = {winner: often, other: copy.deepcopy(often), here: cell(31.0, 31.0, speaker=OWN)}
    known.trials = 64
    said = values(own=1.0, regression=1.0)
    assert known.assess(here, said).speaker == REGRESSION
    known = copy.deepcopy(known)
    known._cells[here] = cell(float(FEW), float(FEW), speaker=OWN)
    assert known.assess(here, said).speaker == OWN


def test_of_two_who_make_no_claims_all_kinds_together_tell_who_speaks() -> None:
    known = Calibration(0.9)
    here, elsewhere = KEY._replace(winner=0, lead=0), KEY
    few, many = (cell(0.0, n, speaker=PERSISTENCE) for n in (400.0, 800.0))
    few.squares[REGRESSION], many.squares[REGRESSION] = [400.0, 500.0, 400.0], [800.0, 100.0, 800.0]
    known._cells, known.trials = {here: few, elsewhere: many}, 1_200
    assert few.lead(PERSISTENCE, REGRESSION) > 4 * EVIDENCE
    assert known.assess(here, values(regression=1.0)).speaker == REGRESSION
    few.squares[REGRESSION][1] = 1_500.0  # 1600 of 1200 are left of all
    assert copy.deepcopy(known).assess(here, values(regression=1.0)).speaker == PERSISTENCE
    # Who makes claims is known by each kind.
    few.squares[OWN] = [400.0, 100.0, 400.0]
    few.speaker = OWN
    assert copy.deepcopy(known).assess(here, values(own=1.0, regression=1.0)).speaker == OWN


def test_whose_record_is_asked_by_hand() -> None:
    """The share of a cell, begun with that of all modes; of the winner's where the cell has no trials."""
    known = Calibration(0.5)
    family, winner = Key(0, 1, OF_FAMILY), KEY._replace(lead=OF_WINNER)
    known._cells = {family: cell(59.5, 99.0), winner: cell(10.0, 19.0)}
    known.trials = 99
    # All modes: (59.5 + 1/2) / 100 = 0.6; this one's: (10 + 0.6) / 20.
    assert known.assess(KEY, values(own=1.0)).probability == pytest.approx(10.6 / 20)
    known = copy.deepcopy(known)
    known._cells[KEY] = cell(3.0, 9.0)
    assert known.assess(KEY, values(own=1.0)).probability == pytest.approx(3.6 / 10)
    assert known.assess(KEY._replace(winner=2), values(own=1.0)).probability == pytest.approx(0.6)
    assert known.assess(KEY._replace(winner=-2), values(own=1.0)).probability == 0.5  # a law


def test_intervals_and_spread_by_hand() -> None:
    known = Calibration(0.9)
    found = cell(10.0, 40.0)
    found.records[OWN].errors = {0: 18.0}
    found.squares[OWN] = [40.0, 90.0, 160.0]
    known._cells, known.trials = {KEY: found}, 40
    told = known.assess(KEY, values(own=1.0))
    assert math.isnan(told.interval)
    assert told.spread == 1.5  # sqrt(90 / 40)
    found.records[OWN].errors = {0: 19.0}
    assert copy.deepcopy(known).assess(KEY, values(own=1.0)).interval == 1.0


# ---------------------------------------------------------------------- what is claimed
def rationed(slips: float, *, extra: float = 0.0) -> Calibration:
    """Four kinds of predictions, right in 99, 98, 96 and 95 of 100."""
    known = Calibration(0.9, slips=slips)
    kinds = ((0.99, 600.0), (0.98, 250.0), (0.96, 50.0), (0.95, 100.0))
    for lead, (share, heard) in enumerate(kinds):
        known._cells[Key(0, 1, lead)] = cell(100.0 * share - 0.5, 99.0, heard=heard)
    if extra:
        known._cells[Key(0, 2, 0)] = cell(9.5, 19.0, heard=extra)
    known.trials = 1000
    return known


def claimed(known: Calibration, who: int = 1) -> list[bool]:
    """Which kinds of a winner's are claimed, whatever their family says."""
    sure = Assessment(OWN, 1.0, math.nan, math.nan)
    return [known.claims(Key(0, who, lead), sure) for lead in range(4)]


def test_claims_are_rationed_by_hand() -> None:
    # Of 1,000 predictions 10 may slip, and 1.5 more. The first kind takes 6 of them, the second one 5; of the third
    # one 2 would slip, and 0.5 are left.
    assert claimed(rationed(0.01)) == [True, True, False, False]
    # 2.5 for the third; of the last one 5 would slip, for which there are 21.5 - 13.
    assert claimed(rationed(0.02)) == [True] * 4
    assert claimed(rationed(0.016)) == [True, True, True, False]
    assert claimed(rationed(0.0)) == [False] * 4  # 1.5 for the 6 of the first kind
    # Predictions that can't be claimed count among those of which a share may slip.
    assert claimed(rationed(0.01, extra=160.0)) == [True, True, True, False]


def test_rations_are_each_familys_own() -> None:
    known = rationed(0.01)
    for lead in range(4):
        known._cells[Key(0, -3, lead)] = cell(95.5 - 0.5, 99.0, heard=10_000.0)
    assert claimed(known) == [True, True, False, False]
    assert claimed(copy.deepcopy(known), -3) == [False] * 4


def test_one_miss_is_left_to_every_kind() -> None:
    # A single kind, right in 99 of 100: 1.5 may slip though the share is 0, hence 150 predictions and no more.
    for heard, expected in ((149.0, True), (151.0, False)):
        known = Calibration(0.9, slips=0.0)
        known._cells[KEY] = cell(98.5, 99.0, heard=heard)
        known.trials = 99
        assert known.claims(KEY, Assessment(OWN, 1.0, math.nan, math.nan)) is expected


def test_what_was_never_seen_is_claimed_when_all_like_it_are_or_it_needs_no_rations() -> None:
    known, other = rationed(0.01), Key(0, 7, 3)  # of whose like two kinds of four are claimed
    assert known.claims(other, Assessment(OWN, 0.99, math.nan, math.nan))
    assert not known.claims(other, Assessment(OWN, 0.985, math.nan, math.nan))
    assert not known.claims(other, Assessment(REGRESSION, 0.99, math.nan, math.nan))
    assert known.claims(other, Assessment(LATEST, 0.99, math.nan, math.nan))
    assert known.claims(other, Assessment(len(EXPERTS), 0.99, math.nan, math.nan))  # an added class' law


def test_of_a_winner_of_which_all_kinds_are_claimed_a_new_kind_is() -> None:
    known = Calibration(0.9)
    for lead in (2, 5):
        known._cells[Key(0, 4, lead)] = cell(40.0, 40.0, heard=40.0)
    known._cells[Key(0, 5, 2)] = cell(20.0, 40.0, heard=1_000.0)
    known.trials = 1_080
    assert known.claims(Key(0, 4, 3), Assessment(OWN, 0.96, math.nan, math.nan))
    assert not known.claims(Key(0, 5, 3), Assessment(OWN, 0.96, math.nan, math.nan))
    assert not known.claims(Key(0, 6, 3), Assessment(OWN, 0.96, math.nan, math.nan))


def test_the_least_probability_holds_of_both() -> None:
    known = Calibration(0.9)
    known._cells[KEY], known.trials = cell(98.5, 99.0, heard=1.0), 99
    assert known.claims(KEY, Assessment(OWN, 0.901, math.nan, math.nan))
    assert not known.claims(KEY, Assessment(OWN, 0.9, math.nan, math.nan))  # no likelier than asked
    known = Calibration(0.9)
    known._cells[KEY], known.trials = cell(89.0, 99.0, heard=1.0), 99
    assert not known.claims(KEY, Assessment(OWN, 0.99, math.nan, math.nan))


def test_how_sure_a_cell_is() -> None:
    assert cell(98.5, 99.0).sure(CLAIMS, 0.0) == pytest.approx(0.99)
    assert cell(98.5, 99.0, speaker=LATEST).sure(CLAIMS, 0.0) == pytest.approx(0.99)
    assert cell(98.5, 99.0, speaker=REGRESSION).sure(CLAIMS, 0.0) == 0.0  # nothing is claimed then
    # Two hits of what is right always, by 8 to 1: see `test_shares_by_hand`.
    assert cell(2.0, 2.0).sure(CLAIMS, 3.0) == pytest.approx((5 / 6 * 3 / 64 + 1.0) / (3 / 64 + 1.0))
    assert _Cell.new(OWN, len(EXPERTS)).sure(CLAIMS, 0.0) == 0.5  # nobody was heard


def test_bits_that_vouch_are_for_laws() -> None:
    known = Calibration(0.9)
    for who in (1, -1):
        known._cells[Key(0, who, 7)] = cell(2.0, 2.0, heard=2.0)
    known.trials = 4
    before = known.assess(Key(0, 1, 7), values(own=1.0)).probability
    known.vouch(6.0)
    assert known.assess(Key(0, 1, 7), values(own=1.0)).probability == before
    chance = 3 / 8 / 64
    told = known.assess(Key(0, -1, 7), values(own=1.0))
    assert told.probability == pytest.approx((5 / 6 * chance + 1.0) / (chance + 1.0))
    assert (known.claims(Key(0, 1, 7), told), known.claims(Key(0, -1, 7), told)) == (True, True)


def test_bits_that_vouch_tell_what_is_claimed() -> None:
    """One hit alone makes 11 / 12; of a law that described what came in six bits less, hardly any doubt is left."""
    known, law = Calibration(probability=0.95), Key(0, -1, 7)
    known._cells[law], known.trials = cell(1.0, 1.0, heard=1.0), 1
    sure = Assessment(OWN, 1.0, math.nan, math.nan)
    assert not known.claims(law, sure)
    known.vouch(6.0)
    assert known.claims(law, sure)


def test_bits_vouch_for_no_one_who_speaks_in_a_laws_place() -> None:
    known, law = Calibration(0.9), Key(0, -1, 7)
    known._cells[law], known.trials = cell(2.0, 2.0, speaker=REGRESSION), 2
    said = values(regression=1.0)
    before = known.assess(law, said)
    assert (before.speaker, before.probability) == (REGRESSION, (2.0 + 0.5 * (FEW - 2.0)) / FEW)
    known.vouch(9.0)
    np.testing.assert_array_equal(known.assess(law, said), before)


# ---------------------------------------------------------------------- a long memory, and what is forgotten
def test_how_many_were_heard_is_halved_with_the_slips() -> None:
    known, other = right(MEMORY), KEY._replace(lead=4)
    assert known._cells[KEY].heard == MEMORY
    seen(known, values(own=1.0), 1.0, key=other)
    assert (known._cells[KEY].heard, known._cells[other].heard) == (MEMORY / 2, 1.0)
    assert known._slips == [(MEMORY + 1) / 2, 0.0]


def test_cells_that_a_prediction_is_counted_in() -> None:
    known = right(1)
    seen(known, values(own=1.0), 1.0, key=Key(2, -3, 7))
    seen(known, values(), 1.0, key=Key(3, 0, 0))
    assert sorted(known._cells) == [
        Key(0, 1, OF_FAMILY),
        Key(0, 1, OF_WINNER),
        Key(0, 1, 3),
        Key(2, -3, OF_WINNER),
        Key(2, -3, 7),
        Key(2, -1, OF_FAMILY),
        Key(3, 0, 0),  # where nobody won there is nobody to tell apart
    ]
    assert {key: c.heard for key, c in known._cells.items() if c.heard} == {
        Key(0, 1, 3): 1.0,
        Key(2, -3, 7): 1.0,
        Key(3, 0, 0): 1.0,
    }


def test_all_modes_know_how_often_each_was_right_who_spoke() -> None:
    known, spoke = Calibration(0.9), []
    for _ in range(30):
        said = values(own=5.0, regression=1.0)
        spoke.append(known.assess(KEY, said).speaker)
        seen(known, said, 1.0)
    (family,) = [c for key, c in known._cells.items() if key.lead == OF_FAMILY]
    assert spoke.count(REGRESSION) > 20
    known_of = pytest.approx((spoke.count(REGRESSION) + 2) / 3)
    assert (family.records[REGRESSION].trials, family.records[REGRESSION].hits) == (known_of, known_of)
    assert (family.records[OWN].trials, family.records[OWN].hits) == (30, 0)


def test_who_was_never_heard_in_a_cell_speaks_there_if_elsewhere_it_codes_best() -> None:
    known, other = Calibration(0.9), KEY._replace(winner=2)
    for _ in range(40):  # linear had nothing to say yet: that nothing changes codes best
        seen(known, values(own=5.0, now=0.5), 1.0, other)
    assert known.assess(other, values(own=5.0, regression=1.0, now=0.5)).speaker == PERSISTENCE
    for _ in range(40):
        seen(known, values(own=5.0, regression=1.0, now=0.5), 1.0)
    told = known.assess(other, values(own=5.0, regression=1.0, now=0.5))
    assert told.speaker == REGRESSION and told.interval == 0.0 and told.probability > 0.9
    assert known.assess(other, values(own=5.0, now=0.5)).speaker == PERSISTENCE


def test_a_renewed_expert_begins_with_ten_trials_of_who_speaks() -> None:
    known = Calibration(0.9, hypotheses=1)
    many, few, none = Key(0, 1, 1), Key(0, 1, 2), Key(0, 1, 3)
    for key, squares in ((many, [40.0, 8.0, 80.0]), (few, [4.0, 2.0, 8.0]), (none, [0.0, 0.0, 0.0])):
        known._cells[key] = _Cell.new(OWN, known.experts)
        known._cells[key].squares[OWN] = squares
    known.renewed(len(EXPERTS))
    found = [known._cells[key].squares[len(EXPERTS)] for key in (many, few, none)]
    assert found == [[10.0, 2.0, 20.0], [4.0, 2.0, 8.0], [0.0, 0.0, 0.0]]
    assert known._cells[many].squares[OWN] == [40.0, 8.0, 80.0]


def test_what_another_model_says_is_no_known_kind() -> None:
    known = right(40)
    known.vouch(5.0)
    change = known.change
    known.forget()
    assert (known.trials, known.change) == (40, change)
    told = known.assess(KEY, values(own=1.0))
    assert (told.speaker, told.probability) == (PERSISTENCE, 0.5 / 41)  # what is known of that is still true
    assert told.spread == 1.0
    assert not known.claims(KEY, told)
    seen(known, values(own=1.0), 1.0)
    told = known.assess(KEY, values(own=1.0))
    assert told.speaker == OWN
    assert known.claims(KEY, told._replace(probability=0.95))


def test_shares_of_an_outcome_and_doubts() -> None:
    known = Calibration(0.9, slips=0.05)
    assert math.isnan(known.share(0))
    assert not known.doubts(0)  # nothing was said
    for k in range(20):
        seen(known, values(own=1.0), 2.0 if k == 10 else 1.0)
    assert known.share(0) == 0.95
    assert not known.doubts(0)
    seen(known, values(own=1.0), 2.0)
    assert known.share(0) == pytest.approx(19 / 21)
    assert known.doubts(0)
    assert math.isnan(known.share(1))
    sure = right(40)
    assert not sure.doubts(0)
    sure._cells[KEY].speaker = LATEST
    sure._changed()
    assert sure.doubts(0)
    assert not sure.doubts(1)


def test_who_speaks_in_how_many_trials() -> None:
    known = right(40)
    for _ in range(50):
        seen(known, values(own=5.0, regression=1.0), 1.0, key=Key(0, 2, 3))
    assert known.speakers() == {OWN: 40.0, REGRESSION: 50.0}
    kinds = {key: (heard, told.speaker) for key, heard, told in known.kinds(0)}
    assert kinds == {KEY: (40.0, OWN), Key(0, 2, 3): (50.0, REGRESSION)}
    assert list(known.kinds(1)) == []


# ---------------------------------------------------------------------- one by one, together, and as a table
@st.composite
def calibrations(draw: st.DrawFn) -> tuple[Calibration, int]:
    """What is known after some predictions of few winners, and who had values, as bits."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    known = Calibration(0.9, slips=draw(st.sampled_from([0.0, 0.0075, 0.1])))
    if draw(st.booleans()):
        known.vouch(draw(st.floats(0.0, 20.0)))
    able = draw(st.integers(0, 15))
    having = np.array([bool(able >> k & 1) for k in range(PERSISTENCE)] + [True])
    sizes = rng.choice([1e-12, 0.01, 1.0], size=(4, len(EXPERTS)))
    for _ in range(draw(st.integers(0, 120))):
        winner, lead = int(rng.integers(-1, 3)), int(rng.choice(4))
        said = sizes[lead] * rng.normal(size=len(EXPERTS))
        said[~having | (rng.random(len(EXPERTS)) < 0.2)] = math.nan
        said[PERSISTENCE] = 1.0
        far = 8 + lead if winner > 0 and rng.random() < 0.3 else lead
        key = Key(int(rng.integers(2)), winner, 7 if winner < 0 else far)
        seen(known, tuple(said.tolist()), 0.0, key=key)
    return known, able


@settings(max_examples=40)
@given(calibrations(), st.booleans())
def test_the_table_says_what_assess_and_claims_say(made: tuple[Calibration, int], distant: bool) -> None:
    """As kernels read it: a cell, else its winner's, else its family's."""
    known, able = made
    sets = [bits for bits in range(able + 1) if bits & ~able == 0]
    listed = list(known.table(3, sets, distant=distant))
    rows = {(key, bits): (told, sure) for key, bits, told, sure in listed}
    assert len(rows) == len(listed)  # nothing is listed twice
    for outcome in range(3):
        for winner in range(-3, 4):
            far = range(8, 14) if distant and winner > 0 else ()
            for lead in (0, 1, 2, 3, 5, 7, *far):
                key = Key(outcome, winner, lead)
                who = (winner > 0) - (winner < 0)
                chain = (key, key._replace(lead=OF_WINNER), Key(outcome, who, OF_FAMILY))
                for bits in sets:
                    told, sure = next(rows[each, bits] for each in chain if (each, bits) in rows)
                    said = [1.0 if bits >> k & 1 else math.nan for k in range(PERSISTENCE)] + [1.0]
                    expected = known.assess(key, said)
                    np.testing.assert_array_equal(told, expected)
                    assert sure == known.claims(key, expected)


@given(calibrations(), st.lists(st.lists(st.booleans(), min_size=4, max_size=4), min_size=1, max_size=9))
def test_many_are_assessed_as_one_by_one(made: tuple[Calibration, int], having: list[list[bool]]) -> None:
    known, _ = made
    rows = np.where([[*each, True] for each in having], 2.0, np.nan)
    told: dict[int, Assessment] = {}
    for which, each in known.assess_many(KEY, rows):
        assert not told.keys() & set(which.tolist())
        told |= dict.fromkeys(which.tolist(), each)
    expected = [known.assess(KEY, row.tolist()) for row in rows]
    np.testing.assert_array_equal([told[k] for k in range(len(rows))], expected)


@given(calibrations())
def test_what_is_read_says_what_was_saved(made: tuple[Calibration, int]) -> None:
    known, _ = made
    text = json.dumps(known.to_json())
    again = Calibration.from_json(json.loads(text), known.probability, known.allowed)
    assert json.dumps(again.to_json()) == text
    for a, b in zip(known.table(3, [0, 15]), again.table(3, [0, 15]), strict=True):
        assert (a[0], a[1], a[3]) == (b[0], b[1], b[3])
        np.testing.assert_array_equal(a[2], b[2])
    assert (known.slips, known.change, known.speakers()) == (again.slips, again.change, again.speakers())


@settings(max_examples=40)
@given(calibrations(), calibrations())
def test_what_two_models_know_is_united_in_either_order(
    first: tuple[Calibration, int], second: tuple[Calibration, int]
) -> None:
    one, two = first[0], second[0]
    before = json.dumps([one.to_json(), two.to_json()])
    both = one.united(two)
    assert both._cells.keys() == one._cells.keys() | two._cells.keys()
    more, less = (one, two) if one.trials >= two.trials else (two, one)
    for key, found in both._cells.items():
        assert found == more._cells.get(key, less._cells.get(key))
    assert both.trials == one.trials + two.trials
    if one.trials != two.trials:
        assert both.to_json() == two.united(one).to_json()
    assert json.dumps([one.to_json(), two.to_json()]) == before


WINNERS = st.integers(-3, 3) | st.sampled_from([2**31 - 1, -(2**31)])
MARGINS = st.sampled_from([0.0, 0.1, 1.0, 9.0, math.inf])


@given(st.lists(st.tuples(st.integers(0, 7), WINNERS, MARGINS, st.integers(8, 13) | st.just(0)), max_size=20))
def test_each_prediction_lies_in_one_cell_its_own(told: list[tuple[int, int, float, int]]) -> None:
    outcomes = np.array([each[0] for each in told], dtype=np.int8)
    winners, far = (np.array([each[k] for each in told], dtype=np.int64) for k in (1, 3))
    margins = np.array([each[2] for each in told], dtype=np.float64)
    found = {k: key for key, rows in keys_of(outcomes, winners, margins, far) for k in rows.tolist()}
    assert [found[k] for k in range(len(told))] == [key_of(*each) for each in told]
    assert len(set(found.values())) == len({key_of(*each) for each in told})


@given(st.lists(st.floats(0.0, 1e9) | st.just(math.inf), min_size=1, max_size=20))
def test_bins_of_leads_are_the_same_in_arrays(margins: list[float]) -> None:
    bins = [key_of(0, 1, margin).lead for margin in margins]
    assert lead_bins(np.array(margins)).tolist() == bins
    for margin, place in zip(margins, bins, strict=True):
        assert place == (7 if math.isinf(margin) else 0 if margin == 0.0 else place)
        if 1 < place < 6:  # octaves of the log-odds, from an eighth
            assert 2.0 ** (place - 3) <= margin < 2.0 ** (place - 2)


def draws() -> Iterator[float]:
    """Random numbers, always the same."""
    return (mixed_one(k * GOLDEN) / 2**64 for k in count(1))


def test_of_predictions_that_come_true_ever_fewer_are_learned_from() -> None:
    # 1/8: after r of them one in r/4; until eight came true in a row that is less than one in two.
    half, third = 0.51, 0.34
    known = right(1)
    assert [known.confirm(KEY, 0.125, half) for _ in range(10)] == [1] * 7 + [0] * 3
    # From the twelfth on it is one of three, and each stands for those before it, too.
    assert [known.confirm(KEY, 0.125, third) for _ in range(3)] == [4, 0, 0]
    assert [known.confirm(KEY, 0.125, 0) for _ in range(2)] == [3, 1]


def test_one_of_as_many_is_learned_from() -> None:
    known, drawn = right(1), draws()
    taken = np.array([known.confirm(KEY, 0.0625, next(drawn)) > 0 for _ in range(8_000)])
    expected = np.minimum(1.0, 1.0 / np.maximum(np.arange(1, 8_001) // 8, 1))
    for part in (slice(0, 100), slice(100, 1_000), slice(1_000, 8_000)):
        assert abs(taken[part].sum() - expected[part].sum()) < 3.0 * math.sqrt(expected[part].sum())


def test_after_one_that_failed_all_are_learned_from_again() -> None:
    known = right(1)
    first = [known.confirm(KEY, 0.125, 0.51) for _ in range(30)]
    seen(known, values(own=1.0), 2.0)
    again = [known.confirm(KEY, 0.125, 0.51) for _ in range(7)]
    assert sum(first) == 7
    assert again == [24, 1, 1, 1, 1, 1, 1]  # the first one for those that were left out before


def test_of_a_kind_that_nobody_looked_back_at_all_are_learned_from() -> None:
    assert [Calibration(0.9).confirm(KEY, 0.5, 1.0) for _ in range(9)] == [1] * 9


def test_without_downsampling_all_are_learned_from() -> None:
    known = right(1)
    assert [known.confirm(KEY, 0.0, 1.0) for _ in range(1_000)] == [1] * 1_000


@given(st.integers(0, 3_000), st.sampled_from([0.0075, 0.03, 0.125]))
@settings(max_examples=60, deadline=None)
def test_an_exception_is_rare_among_what_is_learned_from(length: int, share: float) -> None:
    """A run of what comes true, ended by an exception."""
    known, drawn = right(1), draws()
    learned = sum(known.confirm(KEY, share, next(drawn)) > 0 for _ in range(length)) + 1
    assert 1.0 / learned <= max(share, 1.0 / (length + 1))


def test_what_a_prediction_stands_for_counts_as_often() -> None:
    one, many = right(40), right(40)
    audit = Audit(KEY, values(own=1.0), OWN)
    for _ in range(4):
        seen(one, values(own=1.0), 1.0)
    many.look_back(audit, 1.0, claimed=True, rounding=1e-9, error=0.05, times=4)
    assert many.assess(KEY, values(own=1.0)) == one.assess(KEY, values(own=1.0))
    kept, counted = one.to_json(), many.to_json()
    assert kept["cells"] == counted["cells"]
    assert kept["changes"] == counted["changes"]


def test_how_many_came_true_in_a_row_is_kept() -> None:
    known, drawn = right(1), draws()
    for _ in range(30):
        known.confirm(KEY, 0.125, next(drawn))
    again = Calibration.from_json(json.loads(json.dumps(known.to_json())), 0.9)
    for _ in range(50):
        number = next(drawn)
        assert again.confirm(KEY, 0.125, number) == known.confirm(KEY, 0.125, number)


def test_of_another_model_who_never_spoke_is_right_no_more_often_than_who_did() -> None:
    # The regression spoke, and was right once in ten times; the guess codes best by now, and never spoke.
    known = Calibration(0.9)
    for k in range(60):
        said = [math.nan] * len(EXPERTS)
        said[GUESS], said[REGRESSION], said[PERSISTENCE] = 1.3, 1.0 if k % 10 == 0 else 1.5, 0.0
        known.look_back(Audit(KEY, tuple(said), REGRESSION), 1.0, claimed=False, rounding=1e-9, error=0.05)
    known.forget()
    said = [math.nan] * len(EXPERTS)
    said[GUESS], said[PERSISTENCE] = 1.3, 0.0
    told = known.assess(Key(2, 0, 0), said)
    assert told.speaker == GUESS
    assert told.probability < 0.15


def test_a_miss_that_a_law_explains_counts_once() -> None:
    known = right(40)
    known.look_back(Audit(KEY, values(own=1.5), OWN), 1.0, claimed=True, rounding=1e-9, error=0.05, times=8)
    assert known._cells[KEY].records[OWN].run == -1
    assert known._cells[KEY].steady == 0


# ---------------------------------------------------------------------- who isn't to blame
def until_claimed(known: Calibration, probability: float) -> int:
    """How often the winner has to be right until that is so probable."""
    for n in range(200):
        if known.assess(KEY, values(own=1.0)).probability > probability:
            return n
        seen(known, values(own=1.0), 1.0)
    raise AssertionError("never")


def test_a_mode_whose_conditions_were_revised_begins_anew() -> None:
    known = right(5)
    for _ in range(3):
        seen(known, values(own=1.5), 1.0)
    assert known.assess(KEY, values(own=1.0)).probability < 0.9
    unlike = Calibration.from_json(json.loads(json.dumps(known.to_json())), 0.9)
    known.revise({1})
    unlike.revise({2})  # another one
    needed = [until_claimed(each, 0.9) for each in (known, unlike)]
    assert needed[0] <= 8
    assert needed[1] >= 4 * needed[0]


def test_who_fails_after_each_revision_is_believed_later_each_time() -> None:
    known, needed = right(5), []
    for _ in range(4):
        seen(known, values(own=1.5), 1.0)
        known.revise({1})
        needed.append(until_claimed(known, 0.95))
    assert needed == sorted(needed)
    assert needed[-1] > needed[0]
    again = Calibration.from_json(json.loads(json.dumps(known.to_json())), 0.9)
    assert again.to_json() == known.to_json()
    assert again.assess(KEY, values(own=1.0)) == known.assess(KEY, values(own=1.0))


def test_misses_in_a_row_show_that_who_wins_fails_though_clauses_were_learned_again_in_between() -> None:
    known = right(100)
    for misses in range(1, 15):
        if misses % 4 == 0:
            known.revise({1})
            assert not known.failing(KEY)  # that it wins wrongly still is to be seen
        seen(known, values(own=1.0), 2.0)
        assert known.failing(KEY) == (misses >= 10)
    again = Calibration.from_json(json.loads(json.dumps(known.to_json())), 0.9)
    assert again.failing(KEY)
    seen(known, values(own=1.0), 1.0)
    assert not known.failing(KEY)


@pytest.mark.parametrize("misses", [5, 20, 60])
def test_misses_before_a_revision_do_not_hide_those_that_come_later(misses: int) -> None:
    """That misses came in a long run is no part of the record that begins anew."""
    known = right(100)
    for _ in range(misses):
        seen(known, values(own=1.0), 2.0)
    known.revise({1})
    for _ in range(200):
        seen(known, values(own=1.0), 1.0)
    for later in range(1, 15):
        seen(known, values(own=1.0), 2.0)
        assert known.failing(KEY) == (later >= 10)


def test_a_revision_says_nothing_of_what_was_always_right() -> None:
    known = right(20)
    before = known.to_json()
    known.revise({1})
    assert known.to_json() == before


def test_what_was_misled_is_no_miss() -> None:
    known, misled = right(20), right(20)
    audit = Audit(KEY, values(own=1.5), OWN)
    misled.look_back(audit, 1.0, claimed=False, rounding=1e-9, error=0.05, misled=True)
    assert misled.to_json()["cells"] == known.to_json()["cells"]
    assert misled.assess(KEY, values(own=1.0)) == known.assess(KEY, values(own=1.0))
    assert misled.trials == 21
    assert misled.slips == 0.0


def test_what_was_claimed_and_misled_is_claimed_again_soon() -> None:
    misled, audit = right(20), Audit(KEY, values(own=1.5), OWN)
    misled.look_back(audit, 1.0, claimed=True, rounding=1e-9, error=0.05, misled=True)
    assert misled.slips == pytest.approx(1.0 / 21.0)
    assert until_claimed(misled, 0.9) == 3  # after a miss of its own it takes thirty
    assert misled.assess(KEY, values(own=1.0)) == right(23).assess(KEY, values(own=1.0))  # its record went on


def test_claims_pause_however_many_such_ones_came_before() -> None:
    misled, audit = right(500), Audit(KEY, values(own=1.0), OWN)
    misled.look_back(audit, 2.0, claimed=True, rounding=1e-9, error=0.05, misled=True)
    assert misled.paused(KEY.outcome)
    claimed = []
    for _ in range(5):
        claimed.append(misled.verdict(KEY, values(own=1.0))[1])
        seen(misled, values(own=1.0), 1.0)
    assert claimed == [False] * 3 + [True] * 2
    assert not misled.paused(KEY.outcome)


def test_a_miss_prolongs_a_pause_and_files_keep_it() -> None:
    misled, audit = right(20), Audit(KEY, values(own=1.5), OWN)
    misled.look_back(audit, 1.0, claimed=True, rounding=1e-9, error=0.05, misled=True)
    seen(misled, values(own=1.0), 1.0)
    again = Calibration.from_json(json.loads(json.dumps(misled.to_json())), 0.9)
    assert again.to_json() == misled.to_json()
    assert until_claimed(again, 0.9) == 2
    seen(misled, values(own=1.5), 1.0)
    assert until_claimed(misled, 0.9) >= 3


def test_of_two_models_together_all_is_learned_from_at_first() -> None:
    known = right(1)
    for _ in range(1_000):
        known.confirm(KEY, 0.125, 1.0)
    both = known.united(right(1))
    assert [both.confirm(KEY, 0.125, 1.0) for _ in range(7)] == [1] * 7


def thinned(known: Calibration, draw: float, *, held: bool = True, key: Key = KEY) -> int:
    """How many a prediction that is only roughly right stands for; learned from if any."""
    audit = Audit(key, values(own=1.3), OWN)
    if weight := known.thin(Rough(key, OWN, True, values(own=0.3, now=1.0)), draw, held=held):
        known.look_back(audit, 1.0, claimed=False, rounding=1e-9, error=0.05, stands=weight)
    return weight


def test_of_what_is_roughly_known_ever_fewer_are_learned_from() -> None:
    # Of n one of n / 64: of two from the 128th on, of three from the 192nd on.
    drawn, runs = draws(), []
    for _ in range(60):
        known = right(FEW)
        weights = [thinned(known, next(drawn)) for _ in range(64 * 16)]
        assert weights[:127] == [1] * 127
        # Each that is learned from stands for those before it that aren't.
        last = max(k for k, weight in enumerate(weights) if weight)
        assert sum(weights) == last + 1
        runs.append(weights)
    taken = np.array(runs) > 0
    for many in (2, 3, 7, 15):
        share = taken[:, 64 * many : 64 * (many + 1)].mean()
        assert abs(share - 1.0 / many) < 4.0 * math.sqrt(1.0 / many / (60 * 64))


def left_out(known: Calibration, audit: Audit, came: float, *, misled: bool = False) -> None:
    """A prediction that is left out, since a great many like it came before."""
    for key in {audit.key, audit.key._replace(lead=OF_WINNER)} & known._cells.keys():
        known._cells[key].steady = FEW * FIRST
    errors = missed(audit.values, came, 1e-9)
    assert known.thin(Rough(audit.key, audit.speaker, True, errors), 1.0, held=True, misled=misled) == 0


@pytest.mark.parametrize(
    "audit", [Audit(Key(2, 0, 0), values(regression=1.0), REGRESSION), Audit(KEY, values(own=1.0), OWN)]
)
def test_who_speaks_is_counted_where_predictions_are_left_out_too(audit: Audit) -> None:
    """When the next one is learned from, and as if all had been: hits, errors and what changes."""
    known, whole = Calibration(), Calibration()
    for each in (known, whole):
        for came in (1.0, 1.5, 0.5) * 50:
            each.look_back(audit, came, claimed=False, rounding=1e-9, error=0.05)
    others = (1.01, 0.7, 1.0 + 1e-10, 2.5, 7.0)
    told = known.assess(audit.key, audit.values)
    for came in others:
        left_out(known, audit, came)
        whole.look_back(audit, came, claimed=False, rounding=1e-9, error=0.05)
    known._changed()
    assert known.assess(audit.key, audit.values) == told  # until then nothing is known of them
    for each in (known, whole):
        each.look_back(audit, 1.25, claimed=False, rounding=1e-9, error=0.05)
    assert known._changes == whole._changes
    for key in known._cells.keys() - {Key(0, 1, OF_FAMILY)}:
        found = [each._cells[key].records[audit.speaker] for each in (known, whole)]
        assert found[0] == found[1]
    squares = [each._cells[audit.key].squares for each in (known, whole)]
    assert [trials for trials, *_ in squares[0]] == [trials for trials, *_ in squares[1]]
    assert np.allclose(squares[0], squares[1], rtol=0.05)  # five at once are weighed as one


def test_who_had_no_say_is_heard_of_no_more_than_he_was_asked() -> None:
    """Of a mode that has the word whatever others say only its own error is known; it isn't held against theirs."""
    known, audit = right(200), Audit(KEY, values(own=1.0), OWN)
    before = [list(sums) for sums in known._cells[KEY].squares]
    known._cells[KEY].steady = known._cells[KEY._replace(lead=OF_WINNER)].steady = FEW * FIRST
    assert known.thin(Rough(KEY, OWN, False, values(own=0.0, now=1.0)), 1.0, held=True) == 0
    known._catch_up(0.05)
    assert known._cells[KEY].records[OWN].trials == 201.0
    assert known._cells[KEY].squares == before
    left_out(known, audit, 1.0)
    known._catch_up(0.05)
    assert known._cells[KEY].squares[OWN][0] == before[OWN][0] + 1.0


def test_what_was_off_stays_off_whatever_comes_next() -> None:
    """A large value may be off by much more that is rounding."""
    audit = Audit(Key(2, 0, 0), values(regression=1.0), REGRESSION)
    known = Calibration()
    for _ in range(FEW):
        known.look_back(audit, 1.0, claimed=False, rounding=1e-9, error=0.05)
    before = known._cells[audit.key].records[REGRESSION].hits
    for _ in range(5):
        left_out(known, audit, 1.5)
    known.look_back(audit, 1e9, claimed=False, rounding=1e3, error=0.05)
    assert known._cells[audit.key].records[REGRESSION].hits < before


def test_what_read_something_that_was_off_is_no_fault_where_it_is_left_out() -> None:
    known = right(200)
    for _ in range(5):
        left_out(known, Audit(KEY, values(own=1.5), OWN), 1.0, misled=True)
    seen(known, values(own=1.0), 1.0)
    record = known._cells[KEY].records[OWN]
    assert (record.trials, record.hits) == (201.0, 201.0)


def test_a_record_that_begins_anew_knows_nothing_of_what_was_left_out() -> None:
    known, audit = right(200), Audit(KEY, values(own=1.5), OWN)
    for said in (1.5, 1.0, 1.0, 1.0, 1.5, 1.0):
        seen(known, values(own=said), 1.0)
    for _ in range(5):
        left_out(known, audit, 1.0)
    known.revise({KEY.winner})
    for _ in range(40):
        seen(known, values(own=1.0), 1.0)
    record = known._cells[KEY].records[OWN]
    assert (record.trials, record.hits) == (40.0, 40.0)


def test_what_was_only_roughly_right_is_no_hit_of_what_comes_true() -> None:
    known, audit = right(200), Audit(KEY, values(own=1.5), OWN)
    for _ in range(20):
        left_out(known, audit, 1.0)
    assert known.confirm(KEY, 0.0075, 0.0) == 1
    assert thinned(known, 0.0) == 21


@pytest.mark.parametrize("saved", [False, True])
def test_what_is_left_out_tells_how_right_such_values_are(saved: bool) -> None:
    """Of all, one in three is right; and of the many one in 32 is learned from."""
    known, drawn, learned = Calibration(), draws(), []
    audit = Audit(Key(2, 0, 0), values(regression=1.0), REGRESSION)
    for k in range(6_000):
        came = 0.99 if k % 3 == 0 else 0.6
        errors = missed(audit.values, came, 1e-9)
        weight = known.thin(Rough(audit.key, REGRESSION, True, errors), next(drawn), held=True)
        learned.append(weight > 0)
        if weight:
            known.look_back(audit, came, claimed=False, rounding=1e-9, error=0.05, stands=weight)
        if saved and k % 500 == 250:
            known = Calibration.from_json(json.loads(json.dumps(known.to_json())), 0.9)
    assert abs(sum(learned[3_000:]) - 3_000 / FEW) < 40
    told = known.assess(audit.key, audit.values)
    assert told.speaker == REGRESSION
    assert told.probability == pytest.approx(1.0 / 3.0, abs=0.02)


def test_how_far_off_is_told_up_to_rounding_and_the_shorter_way_round() -> None:
    assert missed((1.0, 1.5), 1.25, 0.1) == (0.25, 0.25)
    assert missed((1.0,), 1.25, 0.25) == (0.0,)
    assert missed((3.0,), -3.0, 0.1, turn=6.25) == (0.25,)
    assert missed((-1e308,), 1e308, 0.1) == (SUMMABLE,)
    (nothing,) = missed((math.nan,), 1.0, 0.1, turn=6.25)
    assert math.isnan(nothing)


def test_what_teaches_who_needs_less_teaches_who_needs_more() -> None:
    old, young, exact, drawn = right(FEW), right(FEW), right(FEW), draws()
    for _ in range(300):
        thinned(old, next(drawn))
    for _ in range(130):
        thinned(young, next(drawn))
    for _ in range(2_000):
        exact.confirm(KEY, 0.0075, next(drawn))
    taken = [
        (thinned(young, number) > 0, thinned(old, number) > 0, exact.confirm(KEY, 0.0075, number) > 0)
        for number in islice(drawn, 200)
    ]
    assert set(taken) == {(True, True, True), (True, True, False), (True, False, False), (False,) * 3}


def test_a_kind_of_few_trials_is_learned_from_however_long_its_winner_is_known() -> None:
    known, rare = right(FEW), KEY._replace(lead=KEY.lead - 1)
    for _ in range(5_000):
        thinned(known, 1.0)
    assert 0 not in [thinned(known, 1.0, key=rare) for _ in range(FEW)]
    assert thinned(known, 1.0, key=rare) == 0


def test_where_intervals_hold_less_often_all_is_learned_from() -> None:
    known, drawn = right(FEW), draws()
    for _ in range(5_000):
        thinned(known, next(drawn))
    # Outside of its interval each speaks for a change by log2(.22 / .05) = 2.2 bits; ten are enough.
    outside = [thinned(known, next(drawn), held=False) for _ in range(8)]
    assert 0 not in outside[4:]
    # Those that it holds speak against that by .3 bits each: after some, others are left out again.
    held = [thinned(known, next(drawn)) for _ in range(200)]
    assert 0 not in held[:20]
    assert held[-100:].count(0) >= 90  # of five thousand one in 78 is learned from


def test_of_another_world_all_is_learned_from_as_of_the_first() -> None:
    known, drawn = right(FEW), draws()
    for _ in range(30_000):
        thinned(known, next(drawn))
    # Ten outside of their intervals are twice as many bits as it takes to doubt: it begins anew.
    for _ in range(15):
        thinned(known, next(drawn), held=False)
    assert 0 not in [thinned(known, next(drawn)) for _ in range(2 * FIRST - 1)]


def test_one_in_twenty_outside_of_its_interval_is_as_it_should_be() -> None:
    known, rng, drawn = right(FEW), np.random.default_rng(0), draws()
    weights = [thinned(known, next(drawn), held=bool(held)) for held in rng.random(20_000) < COVERED]
    assert weights[10_000:].count(0) > 0.8 * 10_000


def test_what_a_rough_prediction_stands_for_counts_where_claims_are_rationed_and_nowhere_else() -> None:
    one, many = right(40), right(40)
    audit = Audit(KEY, values(own=1.3), OWN)
    for known, stands in ((one, 0), (many, 5)):
        for _ in range(3):
            known.thin(Rough(KEY, OWN, True, values(own=0.3, now=1.0)), 0.0, held=True)
        known.look_back(audit, 1.0, claimed=True, rounding=1e-9, error=0.05, stands=stands)
    cells = one._cells[KEY], many._cells[KEY]
    assert cells[0].records == cells[1].records and cells[0].squares == cells[1].squares
    assert cells[1].heard == cells[0].heard + 4
    assert many._slips == [one._slips[0] + 4, one._slips[1] + 4]
    of_winner = KEY._replace(lead=OF_WINNER)
    assert (one._cells[of_winner].steady, many._cells[of_winner].steady) == (0, 3)


def test_how_roughly_things_are_known_is_kept() -> None:
    known, drawn = right(FEW), draws()
    for k in range(5_003):
        thinned(known, next(drawn), held=k % 30 > 0)
    again = Calibration.from_json(json.loads(json.dumps(known.to_json())), 0.9)
    pattern = [bool(k % 7) for k in range(50)]
    for held in pattern:
        number = next(drawn)
        assert thinned(again, number, held=held) == thinned(known, number, held=held)


def test_what_came_true_while_something_was_looked_for_ends_no_run() -> None:
    known = right(1)
    for _ in range(64):
        known.confirm(KEY, 0.125, 1.0)
    audit = Audit(KEY, values(own=1.0), OWN)
    known.look_back(audit, 1.0, claimed=True, rounding=1e-9, error=0.05)
    assert known._cells[KEY].steady == 64
    known.look_back(audit, 1.01, claimed=True, rounding=1e-9, error=0.05)  # nearly isn't true
    assert known._cells[KEY].steady == 0


def test_each_prediction_that_somebody_looked_back_at_is_counted_once() -> None:
    known, drawn = right(FEW), draws()
    left_out = sum(thinned(known, next(drawn)) == 0 for _ in range(5_000))
    assert left_out > 1_000 and known.trials == FEW + 5_000
    audit = Audit(KEY, values(own=1.3), OWN)
    for stands in (0, 1, 3):
        known.look_back(audit, 1.0, claimed=True, rounding=1e-9, error=0.05, stands=stands)
    assert known.trials == FEW + 5_003


def test_a_new_mode_of_a_model_whose_modes_were_wrong_half_the_time_claims_nothing() -> None:
    # Nothing like it is left that rations could be reckoned from, but what became of its like is known.
    known = Calibration(probability=0.5)
    for k in range(40):
        seen(known, values(own=1.0 if k % 2 else 2.0), 1.0)
    known.keep([])
    new = KEY._replace(winner=KEY.winner + 1)
    told = Assessment(OWN, 0.51, math.nan, math.nan)
    assert not known.claims(new, told)
    assert known.claims(new, told._replace(probability=0.999))


def test_who_never_spoke_but_leaves_less_is_right_as_often_as_those_who_did() -> None:
    known = Calibration(0.9)
    for k in range(60):
        said = [math.nan] * len(EXPERTS)
        said[REGRESSION] = 1.0 if k % 10 else 1.3
        said[GUESS], said[PERSISTENCE] = 1.0 if k % 10 else 1.2, 0.0
        known.look_back(
            Audit(KEY._replace(winner=0), tuple(said), REGRESSION),
            1.0,
            claimed=False,
            rounding=1e-9,
            error=0.05,
        )
    known.forget()
    said = [math.nan] * len(EXPERTS)
    said[GUESS], said[REGRESSION], said[PERSISTENCE] = 1.2, 1.3, 0.0
    told = known.assess(Key(2, 0, 0), said)
    assert told.speaker == GUESS
    assert 0.85 < told.probability < 0.95


def test_of_who_learns_on_late_trials_count_for_more() -> None:
    fitted, constant = _Record(), _Record()
    for k in range(40):
        fitted.add(k >= 20, 1, fitted=True)
        constant.add(k >= 20, 1, fitted=False)
    # the i-th of 40 counts for i (i + 1) / (40 * 41)
    assert fitted.trials == pytest.approx(sum(i * (i + 1) for i in range(1, 41)) / (40 * 41))
    assert fitted.hits == pytest.approx(sum(i * (i + 1) for i in range(21, 41)) / (40 * 41))
    assert (constant.trials, constant.hits) == (40.0, 20.0)


def test_of_who_makes_no_claims_no_run_ends_the_record() -> None:
    """Hits come in runs where little happens: the share of all trials is what the next one tells."""
    found, errors = _Cell.new(PERSISTENCE, len(EXPERTS)), [math.nan] * len(EXPERTS)
    for k in range(200):
        errors[PERSISTENCE] = 0.0 if 100 <= k < 160 else 1.0
        found.count(errors, 0.5)
    record = found.records[PERSISTENCE]
    assert (record.trials, record.hits) == (200.0, 60.0)


@given(
    st.lists(st.floats(0.0, 1e9) | st.sampled_from([2.0, 4.0, math.inf, math.nan]), min_size=1, max_size=20)
)
def test_bins_of_distances_are_the_same_in_arrays(distances: list[float]) -> None:
    bins = [far_bin(each) for each in distances]
    assert far_bins(np.array(distances)).tolist() == bins
    for distance, place in zip(distances, bins, strict=True):
        assert (place == 0) == (not distance >= 2.0)
        if 0 < place < 13:  # octaves, from 2 on
            assert 2.0 ** (place - 7) <= distance < 2.0 ** (place - 6)


def test_an_approximation_is_claimed_no_further_than_it_was_asked() -> None:
    near, far, further = Key(0, 1, 7), Key(0, 1, 8), Key(0, 1, 10)
    known = Calibration(0.9)
    for _ in range(200):
        seen(known, values(own=1.0), 1.0, key=near)
    said = values(own=1.0)
    assert known.claims(near, known.assess(near, said))
    told = known.assess(far, said)
    assert (told.speaker, told.probability) == (OWN, 0.5)
    assert not known.claims(far, told)
    for _ in range(FEW - 1):
        seen(known, said, 1.0, key=far)
    assert known.assess(far, said).probability > 0.9
    assert not known.claims(far, known.assess(far, said))  # few lie at the near edge of a bin
    seen(known, said, 1.0, key=far)
    assert known.claims(far, known.assess(far, said))
    assert not known.claims(further, known.assess(further, said))


def test_where_an_approximation_fails_far_out_it_is_claimed_near() -> None:
    near, far = Key(0, 1, 7), Key(0, 1, 9)
    known = Calibration(0.9)
    for k in range(400):
        seen(known, values(own=1.0), 1.0, key=near)
        if k % 8 == 0:
            seen(known, values(own=1.5), 1.0, key=far)
    said = values(own=1.0)
    assert known.claims(near, known.assess(near, said))
    told = known.assess(far, said)
    assert told.probability < 0.1
    assert not known.claims(far, told)
    assert known.assess(near, said).probability > 0.99
    # Twice as far nobody has asked: what is known of less far counts.
    assert known.assess(far._replace(lead=10), said).probability == told.probability


def test_of_a_mode_that_was_never_asked_a_distance_tells_nothing() -> None:
    known = right(100)
    new = Key(0, 9, 9)
    told = known.assess(new, values(own=1.0))
    assert told == known.assess(new._replace(lead=7), values(own=1.0))
    assert known.claims(new, told) == known.claims(new._replace(lead=7), told)
