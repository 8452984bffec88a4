"""How right predictions like this one were: who gives the value, how probably it is right, and its interval.

Several experts have a value for what comes next: the mode or law that won, the guess, regressions on everything, and
that nothing changes. A learner that predicts before each step reports how each of them came out
(`WorldModel.look_back`), and that is counted in *cells*: by outcome, winner, and how far it led its runner-up. Of a
cell

- the expert who coded what came in fewest bits gives the value; another one takes over when it leads by
  `EVIDENCE` bits (a prequential plug-in code: Dawid 1984, Rissanen 1984). A law that can be claimed keeps the word
  where it is hardly worse;
- the *probability* of being right is the posterior mean of the share of hits, its prior that of all cells of the
  outcome. A hit is off by no more than `ModelConfig.claim_error` of what mostly changes;
- the *interval* is the 95 % quantile of errors, of order statistics (split conformal prediction, Vovk et al. 2005).

A run of hits or of misses that the record calls unlikely by `EVIDENCE` bits ends the record: a law that changed is
doubted at once, and a mode whose conditions were found is believed at once.

A prediction is claimed only where its winner speaks and its probability is at least `ModelConfig.claim_probability`;
where more than `ModelConfig.claim_slips` of a target's predictions were claimed and off lately, it must be that sure.
Of a model that was never told how its predictions came out nothing is known, and nothing is doubted.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import EVIDENCE

__all__ = ["EXPERTS", "Assessment", "Audit", "Calibration", "Key", "key_of", "keys_of", "lead_bins"]

EXPERTS: Final = ("own", "guess", "linear", "products", "latest", "persistence")
"""Who may give a value: the winner of the vote (or the law); the guess; both regressions; the mode that held last,
since what decides may be hidden, and a law that changed stays changed; and that nothing changes."""

OWN, GUESS, LINEAR, LATEST, PERSISTENCE = 0, 1, 2, 4, 5

_KNOWN: Final = (LINEAR, LINEAR + 1, PERSISTENCE)
"""What anybody would try first."""

_BY_DEFAULT: Final = (OWN, GUESS, PERSISTENCE)
"""Who speaks before anything is known, the first of them who has a value."""

MEMORY: Final = 1024
"""Of more trials than this the older ones count half: a share of 99 % is known to 0.4 % from half as many, and a lead
of 10 bits is one of 1.4 % in root mean square."""

FEW: Final = 32
"""In a cell of fewer trials what all cells of the outcome say counts; and fewer hits don't end a record."""

LEAVE: Final = 1.1
"""A law that can be claimed, and read, may leave so much more than regressions and persistence (root mean square)."""

PRIOR: Final = 1.0
"""Trials that the prior of a share counts for, as Jeffreys' does."""

YOUNG: Final = 256.0
"""The share of slips is taken of at least so many predictions: one or two early ones say little."""

COVERED: Final = 0.95
"""Share of what comes that intervals are to hold."""

ENOUGH: Final = 19
"""Fewest errors that can tell such an interval: the largest of them does then."""

OCTAVE: Final = 4
"""Bins of errors' sizes in an octave: an interval is 19 % too wide at most."""

_EXACT: Final = -(1 << 14)
"""The bin of errors no larger than rounding."""


class Key(NamedTuple):
    """A cell: number of the outcome, winner (a mode's id, laws below 0; 0: none), and bin of its lead."""

    outcome: int
    winner: int
    lead: int


class Audit(NamedTuple):
    """What looking back at a prediction needs: its cell, what each of `EXPERTS` said (NaN: nothing), and who spoke."""

    key: Key
    values: tuple[float, ...]
    speaker: int = 0


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


def key_of(outcome: int, winner: int, margin: float) -> Key:
    """The cell of a prediction."""
    if not margin > 0.0:
        return Key(outcome, winner, 0)
    return Key(outcome, winner, 7 if math.isinf(margin) else min(max(math.frexp(margin)[1] + 2, 1), 6))


def keys_of(
    outcomes: NDArray[np.int8], winners: NDArray[np.int64], margins: NDArray[np.float64]
) -> Iterator[tuple[Key, NDArray[np.intp]]]:
    """The cells of n predictions, and which of them lie in each."""
    table = np.stack([outcomes.astype(np.int64), winners, lead_bins(margins)], axis=1)
    cells, which = np.unique(table, axis=0, return_inverse=True)
    for number, cell in enumerate(cells.tolist()):
        yield Key(*cell), np.flatnonzero(which.reshape(-1) == number)


def lead_bins(margins: NDArray[np.float64]) -> NDArray[np.int64]:
    """Bins of leads. 0: no lead; else by octaves of the log-odds; 7: no runner-up."""
    _, exponents = np.frexp(np.where(np.isfinite(margins), margins, 1.0))
    found = np.where(margins > 0.0, np.clip(exponents + 2, 1, 6), 0)
    return np.where(np.isposinf(margins), 7, found).astype(np.int64)


@dataclass(slots=True)
class _Record:
    """How one expert's values came out, the older ones counting less."""

    trials: float = 0.0
    hits: float = 0.0
    run: int = 0  # of hits (> 0) or misses (< 0), up to now
    errors: dict[int, float] = field(default_factory=dict)  # trials by bin of the error

    def count(self, error: float, within: float) -> bool:
        """Take in an error, which is a hit if it is no larger than so much; whether that ends what was known before."""
        self.errors = _counted(self.errors, _place(error))
        hit = error <= within
        if hit != (self.run > 0):
            self.run = 0
        self.run += 1 if hit else -1
        # The run under way isn't part of the record that it is held against.
        before = max(self.trials - (abs(self.run) - 1), 0.0)
        share = (max(self.hits - max(self.run - 1, 0), 0.0) + 0.5) / (before + 1.0)
        # It may have begun at any of the trials, which takes the logarithm of their number to say.
        bits = -abs(self.run) * math.log2(share if hit else max(1.0 - share, 1e-300)) - math.log2(
            before + 1.0
        )
        self.trials += 1.0
        self.hits += hit
        # Hits come in runs where little happens: what was doubted is believed after more of them.
        ended = before > 0.0 and bits >= EVIDENCE and (not hit or self.run >= FEW)
        if ended:
            self.trials, self.hits = float(abs(self.run)), float(max(self.run, 0))
        if self.trials > MEMORY:
            self.trials, self.hits = 0.5 * self.trials, 0.5 * self.hits
        return ended

    def share(self, prior: float) -> float:
        """Posterior mean of the share of hits."""
        return (self.hits + prior * PRIOR) / (self.trials + PRIOR)


@dataclass(slots=True)
class _Cell:
    """Predictions of one kind."""

    speaker: int
    records: dict[int, _Record]  # of the winner and of the speaker
    squares: list[
        list[float]
    ]  # for each expert: trials, its squares, those of persistence in the same trials

    @classmethod
    def new(cls, speaker: int, experts: int) -> _Cell:
        return cls(speaker, {}, [[0.0, 0.0, 0.0] for _ in range(experts)])

    def count(self, errors: Sequence[float], within: float) -> None:
        """Take in what each expert was off by; the best one speaks, if it leads by enough."""
        for expert in sorted({OWN, self.speaker}):
            if errors[expert] == errors[expert]:
                if self.records.setdefault(expert, _Record()).count(errors[expert], within):
                    self.squares[expert] = [0.0, 0.0, 0.0]
        base = errors[PERSISTENCE] ** 2
        for sums, error in zip(self.squares, errors, strict=True):
            if error == error:
                if sums[0] >= MEMORY:
                    sums[:] = [0.5 * s for s in sums]
                sums[0] += 1.0
                sums[1] += error * error
                sums[2] += base
        best = min((k for k, error in enumerate(errors) if error == error), key=self.left)
        if best != self.speaker and self.lead(best, self.speaker) >= EVIDENCE:
            self.records = {OWN: self.records[OWN]} if OWN in self.records else {}
            self.speaker = best

    def left(self, expert: int) -> float:
        """Squares left of what saying that nothing changes leaves; infinite if the expert was never heard."""
        trials, own, base = self.squares[expert]
        if not trials:
            return math.inf
        return (own + 1e-300) / (base + 1e-300)

    def lead(self, expert: int, other: int) -> float:
        """Bits by which one expert codes the trials better than another one (normal errors of unknown size)."""
        trials = min(self.squares[expert][0], self.squares[other][0] or math.inf)
        ratio = self.left(other) / self.left(expert)
        return 0.5 * trials * math.log2(min(max(ratio, 1e-300), 1e300))

    def preferred(self, able: Collection[int], probability: float) -> int:
        """Who of those who have a value speaks.

        The winner where that can be claimed and leaves hardly more than what anybody would try; else who codes best.
        """
        own = self.records.get(OWN)
        if OWN in able and own is not None and own.share(0.5) >= probability:
            least = min(self.left(expert) for expert in able if expert in _KNOWN or expert >= len(EXPERTS))
            if self.left(OWN) <= LEAVE * LEAVE * least:
                return OWN
        return self.speaker if self.speaker in able else min(able, key=self.left)


class Calibration:
    """The record of one target's predictions.

    Parameters
    ----------
    probability
        How probable it must be that what the winner says is right, for it to be claimed
        (`ModelConfig.claim_probability`).
    hypotheses
        Laws of `ModelConfig.hypotheses`: experts behind those that there always are.

    Attributes
    ----------
    trials
        Predictions that somebody looked back at.
    """

    def __init__(self, probability: float = 0.9, hypotheses: int = 0) -> None:
        self.probability = probability
        self.experts = len(EXPERTS) + hypotheses
        self.trials = 0
        self._cells: dict[Key, _Cell] = {}
        self._changes: dict[int, float] = {}  # changes by bin of their size
        self._slips = [0.0, 0.0]  # predictions, and those that were claimed and off
        self._assessed: dict[Key, tuple[tuple[int, ...], Assessment]] = {}

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_assessed": {}}

    @property
    def change(self) -> float:
        """Median of what the property changed by lately where it changed, in its units; 0 if it never did.

        A median, since a few crashes make most of the squares, and no outlier is to say what is right.
        """
        return _quantile({k: n for k, n in self._changes.items() if k != _EXACT}, 0.5)

    @property
    def slips(self) -> float:
        """Share of the latest predictions that were claimed and off; of few, as if more had been right."""
        return self._slips[1] / max(self._slips[0], YOUNG)

    # ------------------------------------------------------------------ what is made of a prediction
    def assess(self, key: Key, values: Sequence[float]) -> Assessment:
        """Who gives the value of a prediction, and how far that can be relied on."""
        able = tuple(k for k, value in enumerate(values) if math.isfinite(value))
        known = self._assessed.get(key)
        if known is None or known[0] != able:
            known = self._assessed[key] = (able, self._assess(key, able))
        return known[1]

    def assess_many(
        self, key: Key, values: NDArray[np.float64]
    ) -> Iterator[tuple[NDArray[np.intp], Assessment]]:
        """`assess` of n predictions in one cell, ``values`` of shape ``(n, experts)``."""
        able, which = np.unique(np.isfinite(values), axis=0, return_inverse=True)
        for number, row in enumerate(able):
            rows = np.flatnonzero(which.reshape(-1) == number)
            yield rows, self.assess(key, np.where(row, 0.0, np.nan).tolist())

    def _assess(self, key: Key, able: tuple[int, ...]) -> Assessment:
        default = next(k for k in _BY_DEFAULT if k in able)
        whole, cell = self._cells.get(_whole(key)), self._cells.get(key)
        if whole is None:
            return Assessment(default, math.nan if not self.trials else 0.5, math.nan, math.nan)
        trusted = cell if cell is not None and cell.squares[PERSISTENCE][0] >= FEW else whole
        speaker = trusted.preferred(able, self.probability)
        share = 0.5
        for each in (whole, cell):
            if each is not None and speaker in each.records:
                share = each.records[speaker].share(share)
        record = trusted.records.get(speaker)
        few = record is None or sum(record.errors.values()) < ENOUGH
        half = math.nan if record is None or few else _quantile(record.errors, COVERED)
        trials, own, _ = trusted.squares[speaker]
        return Assessment(speaker, share, half, math.sqrt(own / trials) if trials else math.nan)

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
        """
        errors = [math.remainder(v - came, turn) if turn and v == v else v - came for v in audit.values]
        errors = [0.0 if abs(e) <= rounding else min(abs(e), 1e150) for e in errors]
        self.trials += 1
        self._changes = _counted(self._changes, _place(errors[PERSISTENCE]))
        within = max(rounding, error * self.change)
        self._slips[0] += 1.0
        self._slips[1] += claimed and errors[audit.speaker] > within
        if self._slips[0] > MEMORY:
            self._slips = [0.5 * each for each in self._slips]
        for key in dict.fromkeys((_whole(audit.key), audit.key)):
            if key not in self._cells:
                self._cells[key] = _Cell.new(audit.speaker, self.experts)
            self._cells[key].count(errors, within)
        self._assessed.clear()

    def keep(self, modes: Collection[int]) -> None:
        """Forget the records of modes that are gone; those of laws stay."""
        self._cells = {k: c for k, c in self._cells.items() if k.winner <= 0 or k.winner in modes}
        self._assessed.clear()

    def renewed(self, expert: int) -> None:
        """An expert has another law: it begins as if it had been as good as who speaks in the latest few trials.

        Of the first trials alone chance would tell. With `EVIDENCE` of them to begin with, an exact law speaks after as
        many again.
        """
        for cell in self._cells.values():
            known = cell.squares[cell.speaker]
            share = min(1.0, EVIDENCE / known[0]) if known[0] else 0.0
            cell.squares[expert] = [share * each for each in known]
        self._assessed.clear()

    def speakers(self) -> dict[int, float]:
        """Trials of the cells in which each expert gives the value, by place of the expert."""
        found: dict[int, float] = {}
        for key, cell in sorted(self._cells.items()):
            if key != _whole(key):
                speaker = self._assess(key, tuple(range(self.experts))).speaker
                found[speaker] = found.get(speaker, 0.0) + cell.squares[PERSISTENCE][0]
        return found

    def doubts(self, outcome: int, probability: float) -> bool:
        """Whether what won the vote was right less often than that, or the mode that held last speaks instead."""
        whole = self._cells.get(Key(outcome, -1, -1))
        return whole is not None and (whole.speaker != OWN or self.share(outcome) < probability)

    def forget(self) -> None:
        """What follows is another model's word: only what mostly changes stays."""
        self._cells, self._assessed, self.trials = {}, {}, 0

    def share(self, outcome: int) -> float:
        """Share of an outcome's predictions that were hits lately; NaN where there were none."""
        whole = self._cells.get(_whole(Key(outcome, 0, 0)))
        own = None if whole is None else whole.records.get(OWN)
        return math.nan if own is None or not own.trials else own.hits / own.trials

    def kinds(self, outcome: int) -> Iterator[tuple[float, Assessment]]:
        """Trials of each kind of predictions of an outcome, and what is made of such a prediction."""
        for key, cell in sorted(self._cells.items()):
            if key.outcome == outcome and key != _whole(key):
                yield cell.squares[PERSISTENCE][0], self._assess(key, tuple(range(self.experts)))

    def united(self, other: Calibration) -> Calibration:
        """What two models know together: cell by cell, the record of who looked back more often."""
        more, less = (self, other) if self.trials >= other.trials else (other, self)
        hypotheses = self.experts - len(EXPERTS)
        found = Calibration.from_json(more.to_json(), self.probability, hypotheses)
        for key, cell in Calibration.from_json(less.to_json(), self.probability, hypotheses)._cells.items():
            found._cells.setdefault(key, cell)
        found.trials = self.trials + other.trials
        return found

    # ------------------------------------------------------------------ saving
    def to_json(self) -> dict[str, Any]:
        """Plain data that `from_json` reads back."""
        return {
            "trials": self.trials,
            "slips": list(self._slips),
            "changes": [[place, count] for place, count in sorted(self._changes.items())],
            "cells": [
                {
                    "key": list(key),
                    "speaker": cell.speaker,
                    "records": [
                        [who, r.trials, r.hits, r.run, [[k, n] for k, n in sorted(r.errors.items())]]
                        for who, r in sorted(cell.records.items())
                    ],
                    "squares": [list(sums) for sums in cell.squares],
                }
                for key, cell in sorted(self._cells.items())
            ],
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any], probability: float, hypotheses: int = 0) -> Calibration:
        """Read what `to_json` wrote."""
        found = cls(probability, hypotheses)
        found.trials = int(data["trials"])
        found._slips = [float(each) for each in data["slips"]]
        found._changes = {int(place): float(count) for place, count in data["changes"]}
        for each in data["cells"]:
            records = {
                int(who): _Record(float(n), float(hits), int(run), {int(k): float(c) for k, c in bins})
                for who, n, hits, run, bins in each["records"]
            }
            squares = [[float(s) for s in sums] for sums in each["squares"]]
            found._cells[Key(*map(int, each["key"]))] = _Cell(int(each["speaker"]), records, squares)
        return found


def _whole(key: Key) -> Key:
    """The cell of all predictions of one outcome."""
    return Key(key.outcome, -1, -1)


def _place(error: float) -> int:
    """The bin of an error's size."""
    return _EXACT if error <= 0.0 else math.ceil(OCTAVE * math.log2(error))


def _counted(bins: dict[int, float], place: int) -> dict[int, float]:
    """Bins with one more in one of them; of many the older ones count less."""
    bins[place] = bins.get(place, 0.0) + 1.0
    if sum(bins.values()) <= MEMORY:
        return bins
    return {k: 0.5 * v for k, v in bins.items() if v > 2.0**-10}


def _quantile(bins: Mapping[int, float], share: float) -> float:
    """What a share of the sizes, and of one more, are no larger than; 0 where there are none."""
    wanted, seen = share * (sum(bins.values()) + 1.0), 0.0
    for place in sorted(bins):
        before, seen = seen, seen + bins[place]
        if seen >= wanted:
            if place == _EXACT:
                return 0.0
            # Within a bin, sizes are taken to be spread evenly over its part of an octave.
            return float(2.0 ** ((place - 1 + (wanted - before) / bins[place]) / OCTAVE))
    return 2.0 ** (max(bins) / OCTAVE) if bins else 0.0
