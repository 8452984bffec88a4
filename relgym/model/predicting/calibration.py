"""How right predictions like this one were: who gives the value, how probably it is right, and its interval.

Several experts have a value for what comes next: the mode or law that won, the guess, regressions on everything, and
that nothing changes. A learner that predicts before each step reports how each of them came out
(`WorldModel.look_back`), and that is counted in *cells*: by outcome, winner, and how far it led its runner-up, or of an
approximation how far from what it was made of it is asked; in those of its winner where there are few trials. Of a cell

- the expert who coded what came in fewest bits gives the value; another one takes over when it leads by
  `EVIDENCE` bits (a prequential plug-in code: Dawid 1984, Rissanen 1984), and who does in all cells together where
  it doesn't trail by as many. Of those who make no claims it is who does in all cells together in any case: errors of
  one episode are alike, so that what one kind of predictions shows of them is often the luck of a few. A law that can
  be claimed keeps the word where it is hardly worse;
- the *probability* of being right is the posterior mean of the share of hits, its prior that of all that modes, or
  laws, said of changes with this outcome; and until the first miss a mode or law may be one that is always right, the
  likelier the more examples an only mode explains. A hit is off by no more than `ModelConfig.claim_error` of what
  mostly changes;
- the *interval* is the 95 % quantile of errors, of order statistics (split conformal prediction, Vovk et al. 2005).

Who is right less often than nearly always in a cell is an approximation there, whose value is one of many: another
one speaks who leaves less in all cells together, by `EVIDENCE` bits; and if it leaves nearly all of what saying that
nothing changes does, it says no more than that.

Of who makes claims, a run of hits or of misses that the record calls unlikely by `EVIDENCE` bits ends the record: a law
that changed is doubted at once, and a mode whose conditions were found is believed at once; but not who was right more
often than not before, for that one comes through calm times; nor who was believed twice and failed, until it was right
twice as long: an epidemic ends, and the next one comes. What others leave in the cell counts for few trials then, so
that they are compared by the same ones, and the cells of the winner tell more until there are enough. Who makes none is
known by all its values, whether it spoke or not. Most learn more and more, so late squares count for more, and late
hits of who is fitted. Where somebody had no value yet, all cells together tell whether it speaks. A new mode speaks at
once if others were right in what they said of changes, laws explain what is seen, and it is told from all others
without an error and scatters by less than what comes out right may be off; else it is to prove itself first.

Of what comes out as such predictions do most isn't learned from (`Calibration.confirm`, `Calibration.thin`). How it
came out is counted all the same; of what is only roughly right when the next one is learned from, so that predictions
stay as they are in between.

Only its own faults count. What a mode makes of another property's next value that was predicted wrongly says nothing of
the mode; so its record is of steps in which what it reads was right, and it is right as probably as both are. And where
it is learned again when a mode holds, and then without an error in a world that laws explain, what it got wrong before
was another rule's fault: its record begins anew (`Calibration.revise`), with less credit each time.

Where laws come and go (`Calibration.fleeting`), that one has been right since it was found says little of what comes
next: it is no surer, and its interval no narrower, than what all modes said lately came out.

A prediction is claimed only where its winner speaks and its probability is at least `ModelConfig.claim_probability`.
Claims are rationed: of all kinds the surest ones, as many as are expected to be off in no more than
`ModelConfig.claim_slips` of the target's predictions (selective prediction: Geifman & El-Yaniv 2017). That is reckoned
from the records of those who speak now: what slipped before a law was known isn't held against the law. An
approximation isn't claimed further out than it was asked and right, however right it is near: a misfit grows. Of a
model that was never told how its predictions came out nothing is known, and nothing is doubted.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from relgym.config import ModelConfig
from relgym.config.constants import (
    COVERED,
    EVIDENCE,
    FEW,
    FIRST,
    MAJORITY,
    MEMORY,
    NEARLY_ALL,
    OCTAVE,
    SUMMABLE,
)
from relgym.program.records import EXPERTS, NO_RUNNER_UP, OF_ALL, OF_FAMILY, OF_REGRESSION, OF_WINNER

__all__ = [
    "EXPERTS",
    "Assessment",
    "Audit",
    "Calibration",
    "Key",
    "Rough",
    "far_bin",
    "far_bins",
    "key_of",
    "keys_of",
    "lead_bins",
    "missed",
]

OWN, GUESS, REGRESSION, LATEST, PERSISTENCE = range(len(EXPERTS))

_KNOWN: Final = (REGRESSION, PERSISTENCE)
"""What anybody would try first."""

_FITTED: Final = (GUESS, REGRESSION)
"""Who hits the more the more was learned from: of n trials the i-th counts for nearly (i / n)^2. What falls as c / i,
as least squares' part of the errors does, is taken for 1.5 c / n then; the variance is that of 5 n / 9 trials. Squares
of all count so, for what is compared is to be of the same trials."""

_VALUES: Final = (GUESS, REGRESSION, PERSISTENCE)
"""Who makes no claims."""

_BY_DEFAULT: Final = (OWN, GUESS, REGRESSION, PERSISTENCE)
"""Who speaks before anything is known, the first of them who has a value."""

_EXACT: Final = 2 * OCTAVE * (sys.float_info.min_exp - sys.float_info.mant_dig)
"""The bin of errors no larger than rounding, of a size that is 0 as a float64."""

_BEYOND: Final = math.sqrt(1.0 - COVERED)
"""Share outside of intervals that aren't what they were: half way, in logarithms, between as many as are to and all."""

_HELD: Final = math.log2((1.0 - _BEYOND) / COVERED)
_OUTSIDE: Final = math.log2(_BEYOND / (1.0 - COVERED))
"""Bits that speak for that where an interval held, and where it didn't."""

_DEFAULT: Final = ModelConfig()

FAR: Final = range(NO_RUNNER_UP, NO_RUNNER_UP + NO_RUNNER_UP)[1:]
"""Bins of leads of approximations that are asked far from what they were made of, as many as of leads: octaves of the
squared distance (`relgym.model.predicting.regression.Regressed`), with which a misfit grows."""


class Key(NamedTuple):
    """A cell: number of the outcome, winner (a mode's id, laws below 0; 0: none), and bin of its lead."""

    outcome: int
    winner: int
    lead: int


class Audit(msgspec.Struct, frozen=True, gc=False):
    """What looking back at a prediction needs: its cell, what each of `EXPERTS` said (NaN: nothing), and who spoke."""

    key: Key
    values: tuple[float, ...]
    speaker: int = 0


class Rough(NamedTuple):
    """How a prediction came out that is only roughly right.

    Attributes
    ----------
    key
        Its kind.
    speaker
        Who spoke.
    argued
        Whether others had a say; if not, only what the speaker and persistence were off by is known.
    errors
        What each expert was off by (`missed`), NaN of who had no value.
    """

    key: Key
    speaker: int
    argued: bool
    errors: tuple[float, ...]


class Assessment(NamedTuple):
    """What is made of a prediction.

    Attributes
    ----------
    speaker
        Place in `EXPERTS` of who gives the value.
    probability
        That it is right; NaN where nothing is known.
    interval
        Half width of the 95 % interval, in units of the property; NaN where too little is known.
    spread
        Root mean square of what the speaker left lately; NaN where nothing is known.
    """

    speaker: int
    probability: float
    interval: float
    spread: float


@lru_cache
def key_of(outcome: int, winner: int, margin: float, far: int = 0) -> Key:
    """The cell of a prediction; most margins come again and again. `far`: see `far_bin`, or `VALUED`."""
    if far:
        return Key(outcome, winner, far)
    if not margin > 0.0:
        return Key(outcome, winner, 0)
    if math.isinf(margin):
        return Key(outcome, winner, NO_RUNNER_UP)
    return Key(outcome, winner, min(max(math.frexp(margin)[1] + 2, 1), NO_RUNNER_UP - 1))


def missed(values: Sequence[float], came: float, rounding: float, turn: float = 0.0) -> tuple[float, ...]:
    """How far each value was off; 0 up to rounding. Of angles, whose full turn is so long, the shorter way round."""
    found = []
    for value in values:
        off = abs(math.remainder(value - came, turn) if turn and value == value else value - came)
        found.append(0.0 if off <= rounding else SUMMABLE if off > SUMMABLE else off)
    return tuple(found)


def far_bin(distance: float) -> int:
    """The bin of a squared distance (`FAR`); 0: it is below 2, about twice the mean of what was learned."""
    if not distance >= 2.0:
        return 0
    return FAR[-1] if math.isinf(distance) else min(NO_RUNNER_UP - 1 + math.frexp(distance)[1], FAR[-1])


def far_bins(distances: NDArray[np.float64]) -> NDArray[np.int64]:
    """`far_bin` of n squared distances."""
    _, exponents = np.frexp(np.where(np.isfinite(distances), distances, 1.0))
    found = np.where(distances >= 2.0, np.minimum(NO_RUNNER_UP - 1 + exponents, FAR[-1]), 0)
    return np.where(np.isposinf(distances), FAR[-1], found).astype(np.int64)


def keys_of(
    outcomes: NDArray[np.int8],
    winners: NDArray[np.int64],
    margins: NDArray[np.float64],
    far: NDArray[np.int64] | None = None,
) -> Iterator[tuple[Key, NDArray[np.intp]]]:
    """The cells of n predictions, and which of them lie in each; `far`: see `far_bins`, or `VALUED`."""
    leads = lead_bins(margins)
    if far is not None:
        leads = np.where(far > 0, far, leads)
    kinds = int(outcomes.max(initial=0)) + 1
    for rows in _groups((winners * kinds + outcomes) * (FAR[-1] + 1) + leads):
        first = rows[0]
        yield Key(int(outcomes[first]), int(winners[first]), int(leads[first])), rows


def _groups(codes: NDArray[np.int64]) -> Iterator[NDArray[np.intp]]:
    """Places of equal numbers, in ascending order, number by number."""
    order = np.argsort(codes, kind="stable")
    ends = np.flatnonzero(np.diff(codes[order])) + 1
    yield from np.split(order, ends) if len(codes) else ()


def lead_bins(margins: NDArray[np.float64]) -> NDArray[np.int64]:
    """Bins of leads. 0: no lead; else by octaves of the log-odds; `NO_RUNNER_UP`."""
    _, exponents = np.frexp(np.where(np.isfinite(margins), margins, 1.0))
    found = np.where(margins > 0.0, np.clip(exponents + 2, 1, NO_RUNNER_UP - 1), 0)
    return np.where(np.isposinf(margins), NO_RUNNER_UP, found).astype(np.int64)


@dataclass(slots=True)
class _Record:
    """How one expert's values came out, the older ones counting less."""

    trials: float = 0.0
    hits: float = 0.0
    run: int = 0  # of hits (> 0) or misses (< 0), up to now
    errors: dict[int, float] = field(default_factory=dict)  # trials by bin of the error
    # Over: trials in those of misses, of hits; how many. Then the mean length of those of hits in the two records
    # before this one that misses ended; 0: there was none.
    runs: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    revised: int = 0  # how often what tells when a mode holds was learned again after it had been wrong
    _even: tuple[float, float, float] | None = field(default=None, repr=False, compare=False)

    def add(self, hit: bool, times: int, *, fitted: bool) -> None:
        """Take in a value that nobody claims, so that no run of hits or misses needs to be noticed at once."""
        if fitted and self.trials:  # weights of (i / n)^power sum to n / (power + 1)
            power = 2.0
            kept = max(1.0 - power * times / ((power + 1.0) * self.trials), 0.0)
            self.trials, self.hits = kept * self.trials, kept * self.hits
        self.trials += times
        self.hits += times * hit
        if self.trials > MEMORY:
            self.trials, self.hits = 0.5 * self.trials, 0.5 * self.hits

    def count(self, error: float, within: float, times: int = 1) -> bool:
        """Take in an error, which is a hit if it is no larger than so much; whether that ends what was known before."""
        self.errors = _counted(self.errors, _place(error), times)
        hit = error <= within
        if hit and self.run > 0 and self.run >= self.trials:  # of what was always right nothing ends
            self.run += times
            self.trials, self.hits = self.trials + times, self.hits + times
            if self.trials > MEMORY:
                self.trials, self.hits = 0.5 * self.trials, 0.5 * self.hits
            return False
        if hit != (self.run > 0):
            own = min(
                abs(self.run), self.trials
            )  # others were of a record before that (`Calibration.revise`)
            if own:
                was = self.run > 0
                self.runs[was] += own
                self.runs[2 + was] += 1.0
            self.run = 0
        self.run += times if hit else -times
        # The run under way isn't part of the record that it is held against.
        length = abs(self.run)
        before = max(self.trials - (length - times), 0.0)
        share = (max(self.hits - max(self.run - times, 0), 0.0) + 0.5) / (before + 1.0)
        one = share if hit else max(1.0 - share, sys.float_info.min)
        # Where hits, or misses, mostly come in long runs, another one is no news.
        trials, ends = self.runs[hit], self.runs[2 + hit]
        again = max(one, (trials - ends + one) / (trials + 1.0))
        # It may have begun at any of the trials, which takes the logarithm of their number to say.
        bits = -math.log2(one) - (length - 1) * math.log2(again) - math.log2(before + 1.0)
        self.trials += times
        self.hits += times * hit
        # Hits come in runs where little happens: what was doubted is believed after more of them; what came and went
        # twice comes and goes.
        ended = (
            before > 0.0
            and bits >= EVIDENCE
            and (not hit or (share <= MAJORITY and self.run >= max(FEW, 2.0 * min(self.runs[4:]))))
        )
        if ended:  # a run of hits begins with the miss that it follows: what failed once isn't right always
            self.trials, self.hits = float(abs(self.run) + hit), float(max(self.run, 0))
            if not hit and self.runs[3]:
                self.runs[4:] = self.runs[5], self.runs[1] / self.runs[3]
            self.runs[:4] = [0.0, 0.0, 0.0, 0.0]
        if self.trials > MEMORY:
            self.trials, self.hits = 0.5 * self.trials, 0.5 * self.hits
        if self.runs[0] + self.runs[1] > MEMORY:
            self.runs[:4] = [0.5 * each for each in self.runs[:4]]
        return ended

    def even(self) -> float:
        """`share` after a prior that says nothing; worked out once between trials."""
        if self._even is None or self._even[:2] != (self.trials, self.hits):
            self._even = (self.trials, self.hits, self.share(0.5))
        return self._even[2]

    def mean(self, prior: float) -> float:
        """Posterior mean of the share of hits; the prior has the given mean and counts for one trial, as Jeffreys'."""
        return (self.hits + prior) / (self.trials + 1.0)

    def filled(self, prior: float) -> float:
        """The same of who makes no claims: what lacks for many trials is as the prior says."""
        short = max(FEW - self.trials, 1.0)
        return (self.hits + short * prior) / (self.trials + short)

    def share_of(self, speaker: int, prior: float, bits: float = 0.0) -> float:
        """`share` of an expert's values; that what held last goes on is a guess at what is hidden, and no law."""
        return self.mean(prior) if speaker == LATEST else self.share(prior, bits)

    def share(self, prior: float, bits: float = 0.0) -> float:
        """How probably the next one is a hit.

        One part of the prior has it that hits come in some share (`mean`). The other one, larger by so many bits, that
        what speaks is a law and always right: that holds until the first miss. Who was revised r times, and failed each
        time, will be right with the odds of 1 to 2 r + 1 (Jeffreys' prior), whoever else is.
        """
        failed = 2 * self.revised + 1
        some, bits = self.mean(min(prior, 1.0 / failed)), bits - math.log2(failed)
        if self.hits < self.trials or not (self.trials or bits):
            return some
        n = (
            self.trials
        )  # all hits: how likely is that in a share of which nothing is known (Jeffreys' prior)?
        by_chance = math.exp(math.lgamma(n + 0.5) - math.lgamma(n + 1.0) - bits * math.log(2.0))
        by_chance /= math.sqrt(math.pi)
        return 1.0 - (1.0 - some) * by_chance / (1.0 + by_chance)


@dataclass(slots=True)
class _Cell:
    """Predictions of one kind."""

    speaker: int
    # Of the winner, of the speaker and of all who make no claims; only those who speak have bins of errors.
    records: dict[int, _Record]
    squares: list[
        list[float]
    ]  # for each expert: trials, its squares, those of persistence in the same trials
    heard: float = 0.0  # predictions, those of long ago counting less
    # Predictions in a row, up to now, that came out as such ones do; of rough ones in the cell of their winner.
    steady: int = 0
    # Predictions left out lately: that came true, and that were only roughly right. The next one of these that is
    # learned from stands for them, too.
    passed: int = 0
    thinned: int = 0
    doubt: float = 0.0  # bits by which a winner's intervals held less often lately than they are to
    # Hits in a row since the winner was claimed though what it read was predicted wrongly; None: that is over.
    since: int | None = None
    _sure: tuple[float, float] | None = field(
        default=None, repr=False, compare=False
    )  # by bits, since the last trial

    @classmethod
    def new(cls, speaker: int, experts: int) -> _Cell:
        return cls(speaker, {}, [[0.0, 0.0, 0.0] for _ in range(experts)])

    def note(self, speaker: int, errors: Sequence[float], within: float, times: int = 1) -> None:
        """Take in whether the winner and the speaker were right, no more; so many times."""
        self._sure = None
        for expert in {OWN, speaker}:
            self._hear(expert, errors[expert], within, times, speaks=True)

    def _hear(self, expert: int, error: float, within: float, times: int, *, speaks: bool) -> None:
        """Take in what one expert was off by, if it had a value."""
        if error != error:
            return
        record = self.records.get(expert)
        if record is None:
            record = self.records[expert] = _Record()
        if _makes_claims(expert):
            if record.count(error, within, times):
                self._restart(expert)
            return
        record.add(error <= within, times, fitted=expert in _FITTED)
        if speaks:
            record.errors = _counted(record.errors, _place(error), times)

    def count(self, errors: Sequence[float], within: float, times: int = 1, spoke: int | None = None) -> None:
        """Take in what each expert was off by, so many times, and who spoke; who is best speaks, if by enough."""
        self._sure = None
        for expert in {OWN, self.speaker, *_VALUES}:
            self._hear(expert, errors[expert], within, times, speaks=expert in (OWN, self.speaker, spoke))
        base = times * errors[PERSISTENCE] ** 2
        for sums, error in zip(self.squares, errors, strict=True):
            if error == error:
                _weigh(sums, times, times * error * error, base)
        if errors[self.speaker] == 0.0 and self.squares[self.speaker][1] == 0.0:
            return  # nobody is better than who was never off
        self._choose([k for k, error in enumerate(errors) if error == error])

    def catch_up(self, waiting: Sequence[Rough], within: float) -> None:
        """Take in how predictions came out that were left out; hits are off by no more than so much."""
        self._sure = None
        for _, speaker, _, errors in waiting:
            if speaker in (OWN, self.speaker, *_VALUES):
                self._hear(speaker, errors[speaker], within, 1, speaks=True)
        argued = [each.errors for each in waiting if each.argued]
        able = []
        for expert, sums in enumerate(self.squares):
            some = [(e[expert] ** 2, e[PERSISTENCE] ** 2) for e in argued if e[expert] == e[expert]]
            if some:
                _weigh(sums, len(some), *map(sum, zip(*some, strict=True)))
                able.append(expert)
        if able:
            self._choose(able)

    def _choose(self, able: Collection[int]) -> None:
        """Let who codes best speak, if by enough."""
        best = self.best(able)
        if best != self.speaker and self.lead(best, self.speaker) >= EVIDENCE:
            self.records = {k: r for k, r in self.records.items() if k in (OWN, *_VALUES)}
            if self.speaker in _VALUES:
                self.records[self.speaker].errors = {}
            self.speaker = best

    def _restart(self, expert: int) -> None:
        """An expert is another one now; the rest are compared with it by what comes from now on, nearly."""
        self.squares[expert] = [0.0, 0.0, 0.0]
        for sums in self.squares:
            share = min(1.0, EVIDENCE / sums[0]) if sums[0] else 0.0
            sums[:] = [share * each for each in sums]

    @classmethod
    def united(cls, cells: Sequence[_Cell], experts: int) -> _Cell:
        """What some cells know together, of whoever spoke in one of them, but for errors; runs have no order then."""
        found = cls.new(PERSISTENCE, experts)
        for cell in cells:
            for sums, (trials, own, base) in zip(found.squares, cell.squares, strict=True):
                if trials:
                    sums[0], sums[1], sums[2] = sums[0] + trials, sums[1] + own, sums[2] + base
            for expert, record in cell.records.items():
                known = found.records.get(expert)
                if known is None:
                    known = found.records[expert] = _Record()
                known.trials, known.hits = known.trials + record.trials, known.hits + record.hits
        return found

    def credit(self, prior: float, bits: float) -> float:
        """How probably what the winner reads is right again: as what failed once, and was right ever since."""
        if self.since is None:
            return 1.0
        return _Record(self.since, self.since, revised=1).share(prior, bits)

    def drop(self, expert: int) -> None:
        """Forget how an expert did: another one takes its place."""
        self.records.pop(expert, None)
        self.squares[expert] = [0.0, 0.0, 0.0]

    def sure(self, claims: tuple[float, float], bits: float) -> float:
        """How probably what would be claimed is right, after this record alone; 0 if no mode and no law speaks."""
        if self._sure is None or self._sure[0] != bits:
            able = [k for k, sums in enumerate(self.squares) if sums[0]]
            speaker = self.preferred(able, claims) if able else OWN
            known = self.records.get(speaker)
            share = 0.5 if known is None else known.share_of(speaker, 0.5, bits)
            self._sure = bits, share if _makes_claims(speaker) else 0.0
        return self._sure[1]

    def left(self, expert: int) -> float:
        """Squares left of what saying that nothing changes leaves; infinite if the expert was never heard."""
        trials, own, base = self.squares[expert]
        if not trials:
            return math.inf
        # Of who was never off nothing is left, whether or not there was anything to be said; but that what held last
        # goes on is worth something only where that nothing changes is off.
        if own == 0.0 and (base or expert != LATEST):
            return math.ulp(0.0)
        none = 1.0 / SUMMABLE  # far below the square of what isn't rounding
        return max((own + none) / (base + none), math.ulp(0.0))  # of huge changes an exact law leaves less

    def best(self, able: Collection[int]) -> int:
        """Who of some codes best; of equals the winner, else that nothing changes, which takes no number to say."""
        left = {k: self.left(k) for k in able}
        least = min(left.values())
        return next((k for k in (OWN, PERSISTENCE) if left.get(k) == least), min(left, key=left.__getitem__))

    def lead(self, expert: int, other: int, heard: _Cell | None = None) -> float:
        """Bits by which one expert codes the trials better than another one does, here or in another cell.

        Of normal errors of unknown size. Of other trials it is to leave less both in squares and as a share of what
        saying that nothing changes leaves.
        """
        there = heard or self
        trials = min(self.squares[expert][0], there.squares[other][0] or math.inf)
        ratio = there.left(other) / self.left(expert)
        if heard is not None:
            (n, own, _), (m, others, _) = self.squares[expert], heard.squares[other]
            ratio = min(ratio, max(others * n, math.ulp(0.0)) / max(own * m, math.ulp(0.0)))
        most = sys.float_info.max
        return 0.5 * trials * math.log2(min(max(ratio, 1.0 / most), most))

    def rough(self, speaker: int) -> bool:
        """Whether a mode or a law isn't right nearly always: an approximation, whose value is one of many."""
        known = self.records.get(speaker) if _makes_claims(speaker) else None
        return known is not None and known.trials >= FEW and known.mean(0.5) < NEARLY_ALL

    def _idle(self, own: _Record) -> bool:
        """Whether the winner is right less often than that nothing changes, and leaves more: it explains nothing.

        So it is of a law found among rows that hardly ever change, which is right as long as all of them are 0.
        """
        none = self.records.get(PERSISTENCE)
        return none is not None and self.left(OWN) > self.left(PERSISTENCE) and own.even() < none.even()

    def undecided(self, expert: int, other: int) -> bool:
        """Whether an expert doesn't lead another one by enough; one that was never heard, if not even persistence."""
        return self.lead(expert, other if self.squares[other][0] else PERSISTENCE) < EVIDENCE

    def preferred(self, able: Collection[int], claims: tuple[float, float]) -> int:
        """Who of those who have a value speaks.

        The winner where that can be claimed, is right as often as who codes best (or as it takes for all to be
        claimed), and leaves hardly more than what anybody would try; else who codes best. Nor does it keep the word
        from one who codes better where it is right less often than that nothing changes, and leaves more.
        """
        own, other = self.records.get(OWN), self.records.get(self.speaker, _Record())
        probability, slips = claims
        least = max(probability, min(other.even(), 1.0 - slips))
        if OWN in able and own is not None and own.even() >= least and not self._idle(own):
            least = min(self.left(expert) for expert in able if expert in _KNOWN or expert >= len(EXPERTS))
            if self.left(OWN) * NEARLY_ALL * NEARLY_ALL <= least:  # squares: in root mean square a tenth more
                return OWN
        return self.speaker if self.speaker in able else self.best(able)


class Calibration:
    """The record of one target's predictions.

    Parameters
    ----------
    probability
        How probable it must be that what the winner says is right, for it to be claimed
        (`ModelConfig.claim_probability`).
    slips
        Share of predictions that may be expected to be claimed and off (`ModelConfig.claim_slips`).
    hypotheses
        Laws of `ModelConfig.hypotheses`: experts behind those that there always are.

    Attributes
    ----------
    trials
        Predictions that somebody looked back at.
    """

    def __init__(
        self,
        probability: float = _DEFAULT.claim_probability,
        slips: float = _DEFAULT.claim_slips,
        hypotheses: int = 0,
    ) -> None:
        self.probability, self.allowed = probability, slips
        self.experts = len(EXPERTS) + hypotheses
        self.trials = 0
        self._cells: dict[Key, _Cell] = {}
        self._changes: dict[int, float] = {}  # changes by bin of their size
        # Predictions that were left out, until the next one is learned from.
        self._waiting: list[Rough] = []
        self._slips = [0.0, 0.0]  # predictions, and those that were claimed and off
        self._claimed: dict[tuple[Key, Assessment], bool] = {}
        self._least: dict[int, float] = {}  # probability that claims need, by who makes them
        self._kinds: dict[int, list[_Cell]] = {}  # cells of kinds of predictions, by who makes them
        self._doubted: dict[int, bool] = {}  # see `doubts`
        self._vouched = (
            0.0  # bits by which laws, when they came in force, described what came better than modes
        )
        self._reliable: frozenset[int] | None = None
        self._proven = 0
        self._fleeting = False
        self._everyone = tuple(range(self.experts))
        self._assessed: dict[tuple[Key, tuple[int, ...]], Assessment] = {}
        self._verdicts: dict[tuple[Key, tuple[bool, ...]], tuple[Assessment, bool]] = {}
        self._united: _Cell | None = None  # see `_whole`
        self._listed: list[_Cell] | None = None  # see `_all_cells`

    def __getstate__(self) -> dict[str, Any]:
        cached = ("_assessed", "_verdicts", "_claimed", "_least", "_kinds", "_doubted")
        return self.__dict__ | {name: {} for name in cached} | {"_united": None, "_listed": None}

    def _changed(self, *, cells: bool = True) -> None:
        """What was worked out from the cells is out of date; of which kinds there are, too, if cells came or went."""
        self._assessed.clear()
        self._verdicts.clear()
        self._claimed.clear()
        self._least.clear()
        self._doubted.clear()
        self._united = None
        if cells:
            self._kinds.clear()
            self._listed = None

    @property
    def reliable(self) -> frozenset[int] | None:
        """Modes that are told from all others without an error in what is remembered, where laws explain what is seen.

        None: nobody said, and it may be any mode.

        Only for these modes that were right vouch. Where more is unexplained, what was found may be part of what
        nothing explains, and where conditions err it isn't known when a mode holds: both are to prove themselves.
        """
        return self._reliable

    @reliable.setter
    def reliable(self, modes: frozenset[int] | None) -> None:
        if modes != self._reliable:
            self._reliable = modes
            self._changed()

    @property
    def proven(self) -> int:
        """Bits by which examples speak for a mode that is the only one and explains them all; 0 where there is none."""
        return self._proven

    @proven.setter
    def proven(self, bits: int) -> None:
        if bits != self._proven:
            self._proven = bits
            self._changed()

    @property
    def fleeting(self) -> bool:
        """Whether laws come and go (`relgym.model.target.ended.come_and_go`).

        A mode is no surer then than all modes were lately, those that have ended included, nor its interval narrower.
        """
        return self._fleeting

    @fleeting.setter
    def fleeting(self, come_and_go: bool) -> None:
        if come_and_go != self._fleeting:
            self._fleeting = come_and_go
            self._changed()

    @property
    def change(self) -> float:
        """Median of what the property changed by lately where it changed, in its units; 0 if it never did.

        A median, since a few crashes make most of the squares, and no outlier is to say what is right.
        """
        return _quantile(self._changes, 0.5, self._changes.get(_EXACT, 0.0))

    @property
    def slips(self) -> float:
        """Share of the latest predictions that were claimed and off."""
        return self._slips[1] / max(self._slips[0], 1.0)

    # ------------------------------------------------------------------ what is made of a prediction
    def assess(self, key: Key, values: Sequence[float]) -> Assessment:
        """Who gives the value of a prediction, and how far that can be relied on."""
        return self._known(key, _able(values))

    def verdict(self, key: Key, values: Sequence[float]) -> tuple[Assessment, bool]:
        """What `assess` and `claims` say of a prediction; worked out once between changes."""
        held = tuple(map(math.isfinite, values))
        if (known := self._verdicts.get((key, held))) is None:
            told = self._known(key, _places(held))
            known = self._verdicts[key, held] = told, self.claims(key, told)
        return known

    def own_word(self, key: Key) -> Assessment | None:
        """What is made of a prediction if the winner has the word whatever others say; None where that depends."""
        told = self._known(key, self._everyone)
        return told if told.speaker == OWN == self._known(key, (OWN, PERSISTENCE)).speaker else None

    def _known(self, key: Key, able: tuple[int, ...]) -> Assessment:
        """`_assess`, worked out once between changes."""
        if (known := self._assessed.get((key, able))) is None:
            known = self._assessed[key, able] = self._assess(key, able)
        return known

    def assess_many(
        self, key: Key, values: NDArray[np.float64]
    ) -> Iterator[tuple[NDArray[np.intp], Assessment]]:
        """`assess` of n predictions in one cell, ``values`` of shape ``(n, experts)``."""
        able = np.isfinite(values)
        for rows in _groups(able @ (1 << np.arange(values.shape[1]))):
            yield rows, self.assess(key, np.where(able[rows[0]], 0.0, np.nan).tolist())

    def table(
        self, outcomes: int, able: Sequence[int], *, distant: bool = False
    ) -> Iterator[tuple[Key, int, Assessment, bool]]:
        """What is made of every kind of predictions: a table that says of any prediction what `assess` and `claims` do.

        A prediction whose cell isn't listed is of the kind of its winner (a lead of `OF_WINNER`); one whose winner
        isn't listed of the kind of its family (`OF_FAMILY`, and 1, -1 or 0 for a winner).

        Parameters
        ----------
        outcomes
            Numbers of outcomes are smaller than this.
        able
            Experts who may have a value, as bits by their places in `EXPERTS`, set by set; persistence always has one.
        distant
            Whether kinds far from what was learned are asked for (`far_bin`): all there may be of every winner.

        Yields
        ------
        Key, set of experts, what is made of it, and whether it is claimed.
        """
        nowhere = sys.maxsize  # as a lead, and for a winner: there is none such
        families = [(outcome, who) for outcome in range(outcomes) for who in (-1, 0, 1)]
        rows = [(Key(*each, OF_FAMILY), Key(each[0], each[1] * nowhere, nowhere)) for each in families]
        rows += [(k, k._replace(lead=nowhere)) for k in sorted(self._cells) if k.lead == OF_WINNER]
        # Modes that nobody tried yet, and others may vouch for.
        untried = {Key(0, mode, OF_WINNER) for mode in self._reliable or ()} - self._cells.keys()
        rows += [(k, k._replace(lead=nowhere)) for k in sorted(untried)]
        kinds = {k for k in self._cells if k.lead >= 0}
        if distant:
            of = [k for k in self._cells if k.lead == OF_WINNER and k.winner > 0]
            kinds |= {k._replace(lead=far) for k in of for far in FAR}
        rows += [(k, k) for k in sorted(kinds)]
        for shown, key in rows:
            for bits in able:
                having = tuple(k for k in range(len(EXPERTS)) if bits >> k & 1 or k == PERSISTENCE)
                told = self._assess(key, having)
                yield shown, bits, told, self.claims(key, told)

    def _assess(self, key: Key, able: tuple[int, ...]) -> Assessment:
        if self._far_out(key) and key not in self._cells:
            return self._further(key, able)
        family, winner, cell = (self._cells.get(each) for each in _levels(key))
        family = family if key.winner else None
        bits = self._bits(_who(key))
        known = [c for c in (winner, cell) if c is not None and c.squares[PERSISTENCE][0]]
        if known:
            trusted = known[-1] if known[-1].squares[PERSISTENCE][0] >= FEW else known[0]
            speaker = trusted.preferred(able, (self.probability, self.allowed))
            others = [
                k
                for k in able
                if k != speaker and (_only_values(speaker, k) or trusted.undecided(speaker, k))
            ]
            usual, wider = self._usual(known[0], able, speaker, trusted) if others else (speaker, trusted)
            if usual not in others and trusted.rough(speaker):
                usual, wider = self._instead(able, speaker, trusted), self._whole()
                others = [usual] if usual != speaker else []
            if usual in others:
                speaker = usual
                if not trusted.squares[usual][0]:  # never heard here
                    trusted = family = wider
                    known = [wider]
        elif not self.trials or (OWN in able and self._vouches(family, bits, key)):
            speaker = next(k for k in _BY_DEFAULT if k in able)
        else:  # of a new winner nothing is known, and of those like it nothing good
            trusted = family = self._whole()
            speaker, known = self._anywhere(able, PERSISTENCE), [trusted]
        heard = [c for c in (winner, cell) if c is not None and speaker in c.records]
        share = self._right(key, speaker, _mean(family, speaker), heard) if self.trials else math.nan
        if not known:
            return Assessment(speaker, share, math.nan, math.nan)
        lasting = family if self._fleeting and key.winner > 0 and family is not None else trusted
        half = self._half(lasting, speaker)
        trials, squares, _ = trusted.squares[speaker]
        return Assessment(speaker, share, half, math.sqrt(squares / trials) if trials else math.nan)

    def _right(self, key: Key, speaker: int, prior: float, heard: Sequence[_Cell]) -> float:
        """How probably who speaks is right: the prior is that of the family, the cells are where he was heard."""
        if not _makes_claims(speaker):
            # In a cell of few trials those lacking are as those of its winner, and of that as those of its family.
            share = prior if key.winner else self._mean_of_all(speaker)
            for each in heard if key.winner else heard[:1]:  # without a winner they are one
                share = each.records[speaker].filled(share)
            return share
        bits = self._bits(_who(key)) if speaker == OWN else 0.0
        said = heard[-1].records[speaker] if heard else _Record()
        share = said.share_of(speaker, prior, bits)
        if heard and speaker == OWN:
            share = min(share, heard[-1].credit(prior, bits))
        return min(share, prior) if self._fleeting and key.winner > 0 else share

    def _mean_of_all(self, speaker: int) -> float:
        """`_mean` of who makes no claims in all cells together."""
        known = [c.records[speaker] for c in self._all_cells() if speaker in c.records]
        if not known:
            return _mean(self._whole(), speaker)
        return _Record(sum([r.trials for r in known]), sum([r.hits for r in known])).mean(0.5)

    def _far_out(self, key: Key) -> bool:
        """Whether an approximation that was asked before is asked far from what it was made of."""
        return key.lead in FAR and _winner(key) in self._cells

    def _further(self, key: Key, able: tuple[int, ...]) -> Assessment:
        """What is made of an approximation further than it was ever asked: who spoke nearer does, no surer than not."""
        nearer = key
        while nearer.lead in FAR and nearer not in self._cells:
            nearer = nearer._replace(lead=nearer.lead - 1)
        told = self._assess(nearer, able)
        return told._replace(probability=min(told.probability, 0.5))

    def _usual(self, winner: _Cell, able: tuple[int, ...], speaker: int, trusted: _Cell) -> tuple[int, _Cell]:
        """Who codes better than who would speak, by enough, in all cells of a winner, or in all; and in which.

        Who makes no claims is known by all cells together: what one kind shows of two of them is the luck of a few
        episodes, in each of which errors are alike.
        """
        if winner is not trusted:
            best = winner.preferred(able, (self.probability, self.allowed))
            if best != speaker and not _only_values(best, speaker) and winner.lead(best, speaker) >= EVIDENCE:
                return best, winner
        if _makes_claims(speaker):
            return speaker, winner
        return self._anywhere(able, speaker), self._whole()

    def _anywhere(self, able: tuple[int, ...], speaker: int, heard: _Cell | None = None) -> int:
        """Who needs no winner and codes better in all cells than who would speak, there or where he was heard."""
        whole = self._whole()
        best = whole.best([k for k in able if k not in (OWN, LATEST)])
        return best if whole.lead(best, speaker, heard) >= EVIDENCE else speaker

    def _instead(self, able: tuple[int, ...], speaker: int, heard: _Cell) -> int:
        """Who speaks where an approximation would: that one, unless another codes better, by enough, in all cells."""
        if heard.left(speaker) < NEARLY_ALL:
            return self._anywhere(able, speaker, heard)
        best = self._anywhere(able, PERSISTENCE)  # it has said no more than that nothing changes
        return speaker if best == PERSISTENCE else best

    def _vouches(self, family: _Cell | None, bits: float, key: Key) -> bool:
        """Whether modes, or laws, were right often enough in what they said of changes for a new one to speak.

        Of a flag that seldom changes nearly all that they say is right, and of its changes next to nothing.
        """
        if key.winner > 0 and self.reliable is not None and key.winner not in self.reliable:
            return False
        return _Record().share(_mean(family, OWN), bits) > self.probability

    def _half(self, trusted: _Cell, speaker: int) -> float:
        """Half width of the interval of an expert's values, by a cell that is trusted."""
        cells = self._all_cells() if trusted is self._united else [trusted]
        return _interval([c.records[speaker].errors for c in cells if speaker in c.records])

    def _all_cells(self) -> list[_Cell]:
        if self._listed is None:
            known = sorted(self._cells.items())
            self._listed = [c for k, c in known if k.lead >= 0 or k == _beside(OF_ALL)]
        return self._listed

    def _whole(self) -> _Cell:
        """What all cells know together."""
        if self._united is None:
            self._united = _Cell.united(self._all_cells(), self.experts)
            if (known := self._cells.get(_beside(OF_REGRESSION))) is not None:
                for expert in (REGRESSION, PERSISTENCE):
                    self._united.squares[expert] = max(known.squares[expert], self._united.squares[expert])
        return self._united

    def claims(self, key: Key, told: Assessment) -> bool:
        """Whether a prediction in a cell is claimed: a mode or a law speaks, and it is right probably enough.

        The surest kinds are claimed first, as many as may together be expected to be off in no more than the share
        allowed of what is predicted, and once more: a single miss tells no share. What doesn't speak any more isn't
        counted: neither modes where laws predict, nor the reverse.
        """
        if not _makes_claims(told.speaker):
            return False
        if not self.trials:
            return True
        if (known := self._claimed.get((key, told))) is None:
            known = self._claimed[key, told] = self._claims(key, told)
        return known

    def _claims(self, key: Key, told: Assessment) -> bool:
        """`claims` of what somebody looked back at, worked out once between changes."""
        who, cell = _who(key), self._cells.get(key)
        if self._far_out(key) and (cell is None or cell.squares[PERSISTENCE][0] < FEW):
            return False  # too few have shown what an approximation is worth there
        if self._fleeting and who > 0:  # what is in force now isn't all that is to be claimed
            return told.probability >= 1.0 - self.allowed
        if who not in self._least:
            self._least[who] = self._needed(who)
        like = [cell] if cell is not None else self._alike(key)
        claims, bits = (self.probability, self.allowed), self._bits(who)
        # Nothing like it is left: what became of it is known, or it has never been tried.
        others = 0.0 if _family(key) in self._cells else told.probability
        share = min([c.sure(claims, bits) for c in like], default=others)
        if cell is None and told.probability >= 1.0 - self.allowed:  # rations aren't needed
            share = max(share, told.probability)
        return min(told.probability, share) > self.probability and share >= self._least[who]

    def _alike(self, key: Key) -> list[_Cell]:
        """Kinds of predictions of which one that was never seen, and isn't rationed therefore, is no surer than any.

        Those of its winner; of a winner that was never seen, those of all modes, or all laws.
        """
        kinds = [
            (k, c)
            for k, c in self._cells.items()
            if k.lead >= 0 and k.outcome == key.outcome and c.heard >= 1.0
        ]
        own = [c for k, c in kinds if k.winner == key.winner]
        return own or [c for k, c in kinds if _who(k) == _who(key)]

    def _needed(self, who: int) -> float:
        """The least probability that is claimed."""
        kinds = self._kinds.get(who)
        if kinds is None:
            kinds = [c for k, c in self._cells.items() if _who(k) == who and k.lead >= 0]
            self._kinds[who] = kinds
        left = 1.0 + 0.5 + self.allowed * sum([c.heard for c in kinds])
        claims, bits = (self.probability, self.allowed), self._bits(who)
        for share, heard in sorted([(c.sure(claims, bits), c.heard) for c in kinds], reverse=True):
            if share <= self.probability:
                break
            left -= (1.0 - share) * heard
            if left < 0.0:
                return math.nextafter(share, 2.0)
        return 0.0

    def _bits(self, who: int) -> float:
        return self._vouched if who < 0 else float(self._proven) if who > 0 else 0.0

    def vouch(self, bits: float) -> None:
        """Laws come in force, which describe what came in so many bits less than modes: so much likelier they are."""
        self._vouched = bits
        self._changed()

    # ------------------------------------------------------------------ how it came out
    def look_back(
        self,
        audit: Audit,
        came: float,
        *,
        claimed: bool,
        rounding: float,
        error: float,
        turn: float = 0.0,
        times: int = 0,
        stands: int = 0,
        misled: bool = False,
    ) -> None:
        """Take in how a prediction came out.

        Parameters
        ----------
        audit
            What was said.
        came
            What came.
        claimed
            Whether the prediction was a claim.
        rounding
            Errors up to this aren't told from none.
        error
            Largest error of a hit, as a share of what mostly changes (`ModelConfig.claim_error`).
        turn
            Length of a full turn, of an angle; 0 of anything else.
        times
            For how many predictions it stands that were confirmed (`confirm`); 0: it wasn't.
        stands
            For how many it stands that came out as such ones do (`thin`); 0: it stands for itself alone.
        misled
            Whether what it read was predicted wrongly: that says nothing of what it makes of it. Who was claimed all
            the same is claimed again once he was right a few times.
        """
        if self._waiting:
            self._catch_up(error)
        errors = missed(audit.values, came, rounding, turn)
        self.trials += not times
        self._changes = _counted(self._changes, _place(errors[PERSISTENCE]))
        within = max(rounding, error * self.change)
        if errors[audit.speaker] > within:  # which its law explains; those it would stand for were hits
            times = 0
        many = max(times, 1)
        if many > 1:
            self._changes = _counted(self._changes, _place(errors[PERSISTENCE]), many - 1)
        self._slips[0] += max(many, stands)
        self._slips[1] += max(stands, 1) * (claimed and errors[audit.speaker] > within)
        if self._slips[0] > MEMORY:
            self._slips = [0.5 * each for each in self._slips]
            for cell in self._cells.values():
                cell.heard *= 0.5
        known = len(self._cells)
        if not misled:
            self._tally(audit, errors, within, rounding, times, stands)
        elif claimed:
            self._pause(audit.key)
        self._changed(cells=len(self._cells) > known)

    def _tally(
        self, audit: Audit, errors: Sequence[float], within: float, rounding: float, times: int, stands: int
    ) -> None:
        """Count how a prediction came out in its cells; arguments as of `look_back`."""
        many = max(times, 1)
        for key in _levels(audit.key) if audit.key.winner else (audit.key,):
            if key not in self._cells:
                self._cells[key] = _Cell.new(audit.speaker, self.experts)
            cell = self._cells[key]
            if key.lead == OF_FAMILY:  # what is right because nothing changes vouches for nobody
                if not abs(audit.values[OWN] - audit.values[PERSISTENCE]) <= rounding:
                    cell.note(audit.speaker, errors, within, many)
            else:
                cell.count(errors, within, many, audit.speaker)
            if cell.since is not None:
                cell.since = cell.since + many if errors[OWN] <= within else 0
                if cell.credit(0.5, self._bits(_who(key))) > self.probability:
                    cell.since = None
        self._cells[audit.key].heard += max(many, stands)
        if not (times or stands) and errors[audit.speaker] > rounding:
            for key in _levels(audit.key)[1:]:
                self._cells[key].steady = 0

    def confirm(self, key: Key, share: float, draw: float) -> int:
        """Take note that a prediction came true; how many such ones it stands for, 0 if another one will for it.

        What comes true teaches little, and the less the longer all of its kind did. After r of them in a row half of
        one in r is expected to fail (Jeffreys' prior). Where that is so many times less than `share`, one of as many
        will do.

        Parameters
        ----------
        key
            Its kind.
        share
            `ModelConfig.downsampling`.
        draw
            A random number from 0 to 1, one for all predictions of a step: where one is learned from, those of which
            more are needed are, too, and of most steps none is. Drawn, not counted off: things take turns, and none is
            to be left out.
        """
        self.trials += 1
        cell = self._cells.get(key)
        if cell is None:
            return 1
        cell.steady += 1
        if draw * int(2.0 * share * cell.steady) > 1.0:
            cell.passed += 1
            return 0
        weight, cell.passed = cell.passed + 1, 0
        return weight

    def thin(self, rough: Rough, draw: float, *, held: bool, misled: bool = False) -> int:
        """Take note of a prediction that is only roughly right; how many such ones it stands for, 0: another one will.

        The more of a winner there are, the less one more tells: `FIRST` of them tell what it leaves to 9 %.
        So of n, one of n / `FIRST` is learned from, of each twice as many as many again, until one of `FEW` is: then
        learning takes little beside predicting. Kinds of few trials are learned from in any case. Where intervals hold
        less often than they are to, by `EVIDENCE` bits, the world isn't what it was, and all is learned from
        (cumulative sums: Page 1954; the alternative is that four to five times as many lie outside). How often who
        speaks is right, and how far off everybody is, is counted of all, in the cells of their kind and winner.

        Parameters
        ----------
        rough
            How it came out.
        draw
            As of `confirm`.
        held
            Whether what came lay in its interval.
        misled
            As of `look_back`.
        """
        kind = self._cells.get(rough.key)
        cell = self._cells.get(_winner(rough.key)) if rough.key.winner else kind
        if cell is None or kind is None:
            return 1
        cell.steady += 1
        cell.doubt = min(max(0.0, cell.doubt + (_HELD if held else _OUTSIDE)), 2.0 * EVIDENCE)
        if cell.doubt == 2.0 * EVIDENCE:  # those before were of another world
            cell.steady = 0
        left_out = draw * min(cell.steady // FIRST, FEW) > 1.0
        if left_out and cell.doubt < EVIDENCE and kind.squares[PERSISTENCE][0] >= FEW:
            self.trials += 1
            kind.thinned += 1
            if not misled:
                self._waiting.append(rough)
            return 0
        weight, kind.thinned = kind.thinned + 1, 0
        return weight

    def _catch_up(self, error: float) -> None:
        """Count how predictions came out that were left out; `error` as of `look_back`."""
        waiting, self._waiting = self._waiting, []
        of: dict[Key, list[Rough]] = {}
        for each in waiting:
            self._changes = _counted(self._changes, _place(each.errors[PERSISTENCE]))
            for key in _levels(each.key)[1:] if each.key.winner else (each.key,):
                of.setdefault(key, []).append(each)
        within = error * self.change
        for key, some in of.items():
            if (cell := self._cells.get(key)) is not None:  # its winner may be gone
                cell.catch_up(some, within)

    def stood_still(self, outcome: int, count: int) -> None:
        """What nobody predicted stayed as it was, so many times: that nothing changes was right."""
        times = min(count, MEMORY)
        cell = self._cells.setdefault(Key(outcome, 0, 0), _Cell.new(PERSISTENCE, self.experts))
        record = cell.records.setdefault(PERSISTENCE, _Record())
        record.add(True, times, fitted=False)
        record.errors = _counted(record.errors, _EXACT, times)
        cell.squares[PERSISTENCE][0] += times
        cell.heard += times
        self.trials += count
        self._changed()

    def revise(self, modes: Collection[int]) -> None:
        """What tells when these modes hold was learned again and errs nowhere: that it erred says little any more.

        A record that was good enough for all to be claimed goes on: a new one would have to show that first.
        """
        begun: set[int] = set()
        for key, cell in self._cells.items():
            own = cell.records.get(OWN) if key.winner in modes and key.lead != OF_FAMILY else None
            if own is not None and own.hits < own.trials and own.even() < 1.0 - self.allowed:
                cell.records[OWN] = _Record(run=min(own.run, 0), revised=own.revised + 1)
                cell._restart(OWN)
                cell._sure = None
                begun.add(key.winner)
        self._waiting = [w for w in self._waiting if w.speaker != OWN or w.key.winner not in begun]
        self._changed()

    def _pause(self, key: Key) -> None:
        """What was claimed read what was wrong: what it reads may go on so, so it isn't claimed for a while."""
        for each in {key, _winner(key)} & self._cells.keys():
            self._cells[each].since = self._cells[each].steady = 0  # all of what follows is looked at

    def keep(self, modes: Collection[int]) -> None:
        """Forget the records of modes that are gone; those of laws stay."""
        self._cells = {
            k: c for k, c in self._cells.items() if k.winner <= 0 or k.lead <= OF_FAMILY or k.winner in modes
        }
        self._changed()

    def renewed(self, expert: int) -> None:
        """An expert has another law: it begins as if it had been as good as who speaks in the latest few trials.

        Of the first trials alone chance would tell. With `EVIDENCE` of them to begin with, an exact law speaks after as
        many again.
        """
        for cell in self._cells.values():
            known = cell.squares[cell.speaker]
            share = min(1.0, EVIDENCE / known[0]) if known[0] else 0.0
            cell.squares[expert] = [share * each for each in known]
            cell._sure = None
        self._changed()

    def regressed(self, trials: float, squares: float, persistence: float) -> None:
        """Take in what regression leaves of rows like those it was fitted to: nobody may have looked back at most.

        Who was never told how predictions came out doubts nothing, and has no use for it.

        Parameters
        ----------
        trials
            How many rows that were.
        squares, persistence
            What it leaves of as many others, and what saying that nothing changes does.
        """
        if not self.trials:
            return
        cell = self._cells.setdefault(_beside(OF_REGRESSION), _Cell.new(PERSISTENCE, self.experts))
        cell.squares[REGRESSION] = [trials, squares, persistence]
        cell.squares[PERSISTENCE] = [trials, persistence, persistence]
        self._changed(cells=False)

    def speakers(self) -> dict[int, float]:
        """Trials of the cells in which each expert gives the value, by place of the expert."""
        found: dict[int, float] = {}
        for key, cell in sorted(self._cells.items()):
            if key.lead >= 0:
                speaker = self._assess(key, tuple(range(self.experts))).speaker
                found[speaker] = found.get(speaker, 0.0) + cell.squares[PERSISTENCE][0]
        return found

    def doubts(self, outcome: int) -> bool:
        """Whether what won votes was off more often than claims may be, or the mode that held last spoke instead."""
        if (known := self._doubted.get(outcome)) is None:
            if self.share(outcome) >= 1.0 - self.allowed:
                known = any([c.speaker == LATEST for k, c in self._cells.items() if k.outcome == outcome])
            else:
                known = _family(Key(outcome, 1, 0)) in self._cells
            self._doubted[outcome] = known
        return known

    def failing(self, key: Key) -> bool:
        """Whether who won was less often right than a fair coin, by `EVIDENCE` bits, since the record last ended.

        Misses in a row count though what tells when the mode holds was learned again in between, if it was wrong again.
        """
        cell = self._cells.get(_winner(key))
        own = None if cell is None else cell.records.get(OWN)
        if own is None or own.hits >= own.trials:
            return False
        counts = (own.hits, max(own.trials - own.hits, -own.run))
        trials = sum(counts)
        coded = sum(-n * math.log2(n / trials) for n in counts if n)
        return counts[1] > counts[0] and trials - coded >= EVIDENCE

    def forget(self) -> None:
        """What follows is another model's word: only what mostly changes stays, and what the others know."""
        whole = self._whole()
        for expert in (OWN, LATEST, *range(len(EXPERTS), self.experts)):
            whole.drop(expert)
        self._cells, self._vouched = {_beside(OF_ALL): whole} if self._cells else {}, 0.0
        self._waiting = []
        self._changed()

    def share(self, outcome: int) -> float:
        """Share of what modes predicted with an outcome that were hits lately; NaN where there were none."""
        whole = self._cells.get(_family(Key(outcome, 1, 0)))
        own = None if whole is None else whole.records.get(OWN)
        return math.nan if own is None or not own.trials else own.hits / own.trials

    def paused(self, outcome: int) -> bool:
        """Whether some kind isn't claimed, for what it reads was predicted wrongly."""
        return any(
            c.since is not None for k, c in self._cells.items() if k.outcome == outcome and k.lead >= 0
        )

    def kinds(self, outcome: int) -> Iterator[tuple[Key, float, Assessment]]:
        """Each kind of predictions of an outcome, its trials, and what is made of such a prediction."""
        for key, cell in sorted(self._cells.items()):
            if key.outcome == outcome and key.lead >= 0:
                yield key, cell.heard, self._assess(key, tuple(range(self.experts)))

    def united(self, other: Calibration) -> Calibration:
        """What two models know together: cell by cell, the record of who looked back more often."""
        more, less = (self, other) if self.trials >= other.trials else (other, self)
        others = self.allowed, self.experts - len(EXPERTS)
        found = Calibration.from_json(more.to_json(), self.probability, *others)
        for key, cell in Calibration.from_json(less.to_json(), self.probability, *others)._cells.items():
            found._cells.setdefault(key, cell)
        for cell in found._cells.values():  # a number stands for another mode here, maybe
            cell.steady, cell.passed, cell.thinned, cell.doubt = 0, 0, 0, 0.0
        found._waiting = []
        found._fleeting = self._fleeting or other._fleeting
        found.trials = self.trials + other.trials
        return found

    # ------------------------------------------------------------------ saving
    def to_json(self) -> dict[str, Any]:
        """Plain data that `from_json` reads back."""
        return {
            "trials": self.trials,
            "slips": list(self._slips),
            "vouched": self._vouched,
            **({"proven": self._proven} if self._proven else {}),
            **({"fleeting": True} if self._fleeting else {}),
            "changes": [[place, count] for place, count in sorted(self._changes.items())],
            **({"waiting": [_plain(each) for each in self._waiting]} if self._waiting else {}),
            "cells": [
                {
                    "key": list(key),
                    "speaker": cell.speaker,
                    "heard": cell.heard,
                    "steady": cell.steady,
                    "passed": cell.passed,
                    **({"thinned": cell.thinned} if cell.thinned else {}),
                    **({"doubt": cell.doubt} if cell.doubt else {}),
                    **({} if cell.since is None else {"since": cell.since}),
                    "records": [
                        [
                            who,
                            r.trials,
                            r.hits,
                            r.run,
                            [[k, n] for k, n in sorted(r.errors.items())],
                            [*r.runs, float(r.revised)] if r.revised else r.runs[: 6 if r.runs[5] else 4],
                        ]
                        for who, r in sorted(cell.records.items())
                    ],
                    "squares": [list(sums) for sums in cell.squares],
                }
                for key, cell in sorted(self._cells.items())
            ],
        }

    @classmethod
    def from_json(
        cls,
        data: Mapping[str, Any],
        probability: float,
        slips: float = _DEFAULT.claim_slips,
        hypotheses: int = 0,
    ) -> Calibration:
        """Read what `to_json` wrote."""
        found = cls(probability, slips, hypotheses)
        found.trials = int(data["trials"])
        found._slips = [float(each) for each in data["slips"]]
        found._vouched = float(data["vouched"])
        found._proven = int(data.get("proven", 0))
        found._fleeting = bool(data.get("fleeting", False))
        found._changes = _bins(data["changes"])
        found._waiting = [
            Rough(
                Key(*map(int, key)),
                int(who),
                bool(argued),
                tuple(math.nan if e is None else float(e) for e in off),
            )
            for key, who, argued, off in data.get("waiting", ())
        ]
        for each in data["cells"]:
            records = {
                int(who): _Record(
                    float(n),
                    float(hits),
                    int(run),
                    _bins(bins),
                    [*map(float, runs), 0.0, 0.0][:6],
                    int(next(iter(runs[6:]), 0)),
                )
                for who, n, hits, run, bins, runs in each["records"]
            }
            squares = [[float(s) for s in sums] for sums in each["squares"]]
            found._cells[Key(*map(int, each["key"]))] = _Cell(
                int(each["speaker"]),
                records,
                squares,
                float(each["heard"]),
                int(each["steady"]),
                int(each["passed"]),
                int(each.get("thinned", 0)),
                float(each.get("doubt", 0.0)),
                None if (since := each.get("since")) is None else int(since),
            )
        return found


def _weigh(sums: list[float], trials: int, own: float, base: float) -> None:
    """Add some trials' squares to an expert's: trials, its own squares, and those of persistence."""
    if sums[0] >= MEMORY:
        sums[:] = [0.5 * s for s in sums]
    # The latest of n trials counts for two more, and those before for less: (i / n)^2.
    more = min(2.0, sums[0] / trials)
    kept = max(0.0, 1.0 - more * trials / sums[0]) if more else 1.0
    sums[0] += trials
    sums[1] = kept * sums[1] + (1.0 + more) * own
    sums[2] = kept * sums[2] + (1.0 + more) * base


def _plain(waiting: Rough) -> list[Any]:
    """One that waits, as plain data."""
    errors = [None if error != error else error for error in waiting.errors]
    return [list(waiting.key), waiting.speaker, waiting.argued, errors]


def _able(values: Sequence[float]) -> tuple[int, ...]:
    """Places of the experts that have a value."""
    return _places(tuple(map(math.isfinite, values)))


@cache
def _places(held: tuple[bool, ...]) -> tuple[int, ...]:
    """Where something holds; kept, for there are few such patterns and many predictions."""
    return tuple(k for k, holds in enumerate(held) if holds)


def _makes_claims(speaker: int) -> bool:
    """Whether an expert is a mode, a law, or a law of a hypothesis class that was added; others have values only."""
    return speaker not in _VALUES


def _only_values(first: int, second: int) -> bool:
    """Whether neither of two experts makes claims."""
    return not (_makes_claims(first) or _makes_claims(second))


def _who(key: Key) -> int:
    """Who makes a prediction: laws (-1), modes (1), or neither (0)."""
    return (key.winner > 0) - (key.winner < 0)


@lru_cache
def _family(key: Key) -> Key:
    """The cell of all predictions of one outcome that laws, or modes, make."""
    return Key(key.outcome, _who(key), OF_FAMILY)


@lru_cache
def _winner(key: Key) -> Key:
    """The cell of all predictions of one outcome and winner."""
    return Key(key.outcome, key.winner, OF_WINNER)


def _beside(lead: int) -> Key:
    """The cell of no kind of predictions: see `OF_ALL` and `OF_REGRESSION`."""
    return Key(0, 0, lead)


@lru_cache
def _levels(key: Key) -> tuple[Key, Key, Key]:
    """The cells that a prediction is counted in, the widest first; where nobody won they are one."""
    return (_family(key), _winner(key), key) if key.winner else (key, key, key)


def _mean(cell: _Cell | None, expert: int, prior: float = 0.5) -> float:
    """Posterior mean of an expert's hits in a cell; the prior where there is none.

    Who makes no claims and never spoke there is right as often as those like him who did, if he leaves no more than any
    of them; else no more often.
    """
    if cell is None:
        return prior
    if (record := cell.records.get(expert)) is not None:
        return record.mean(prior)
    others = {} if _makes_claims(expert) else {k: r for k, r in cell.records.items() if not _makes_claims(k)}
    if cell.squares[expert][0] and all(cell.left(expert) <= cell.left(other) for other in others):
        known = others.values()
        return _Record(sum(r.trials for r in known), sum(r.hits for r in known)).mean(prior)
    return min([prior, *(other.mean(prior) for other in others.values())])


def _place(error: float) -> int:
    """The bin of an error's size."""
    if error <= 0.0:
        return _EXACT
    return math.ceil(OCTAVE * math.log2(min(error, SUMMABLE)))


def _bins(data: Iterable[tuple[int, float]]) -> dict[int, float]:
    """Bins as files have them; in those of before that of exact hits lies farther below."""
    found: dict[int, float] = {}
    for place, count in data:
        at = max(int(place), _EXACT)
        found[at] = found.get(at, 0.0) + float(count)
    return found


def _counted(bins: dict[int, float], place: int, times: int = 1) -> dict[int, float]:
    """Bins with so many more in one of them; of many the older ones count less."""
    bins[place] = bins.get(place, 0.0) + times
    if sum(bins.values()) <= MEMORY:
        return bins
    return {k: 0.5 * v for k, v in bins.items() if v > 1.0 / MEMORY}


def _interval(cells: Sequence[Mapping[int, float]]) -> float:
    """Half width of the interval that `COVERED` of what comes lies in; NaN where even the largest error can't tell.

    By the bins of errors of all cells together.
    """
    bins: Mapping[int, float] = cells[0] if cells else {}
    if len(cells) > 1:
        bins = dict(bins)
        for each in cells[1:]:
            for place, count in each.items():
                bins[place] = bins.get(place, 0.0) + count
    count = sum(bins.values())
    return _quantile(bins, COVERED) if count >= COVERED * (count + 1.0) else math.nan


def _quantile(bins: Mapping[int, float], share: float, exact: float = 0.0) -> float:
    """What a share of the sizes, and of one more, are no larger than; 0 where there are none.

    Of the sizes that are no larger than rounding so many are left aside: all, if any.
    """
    below = sum(bins.values()) - exact
    wanted = share * (below + 1.0)
    if below < wanted:
        return 2.0 ** (max(bins) / OCTAVE) if bins else 0.0
    for place in sorted(bins, reverse=True):  # shares are large, and counts are added without rounding
        below -= bins[place]
        if below < wanted:
            break
    if place == _EXACT:
        return 0.0
    # Within a bin, sizes are taken to be spread evenly over its part of an octave.
    return float(2.0 ** ((place - 1 + (wanted - below) / bins[place]) / OCTAVE))
