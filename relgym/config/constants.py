"""Constants that several parts of the learner share, each with its unit, what it means and what it follows from.

They aren't settings: nothing in an env asks for others. What a user may want to change is a field of `ModelConfig`.
What follows from others is written as what it follows from; what doesn't is counted (`tests/test_constants.py`).
"""

from __future__ import annotations

import math
import sys
from statistics import NormalDist
from typing import Final

import numpy as np

__all__ = [
    "ACTING",
    "ALIKE",
    "ALL_DIGITS",
    "ALTERNATIVES",
    "ANSWERS",
    "BEYOND",
    "CACHED",
    "CALL",
    "CHECKPOINT",
    "COVERED",
    "DEGREES",
    "DIGITS",
    "DRAWS",
    "ENOUGH",
    "EVIDENCE",
    "EXACT",
    "EXTRAPOLATED",
    "FEW",
    "FEWEST",
    "FEW_VALUES",
    "FIRST",
    "FIRST_ROOM",
    "FOUNDING",
    "LARGE",
    "LAYOUTS",
    "LEAST_EXEMPLARS",
    "LEFT_OPEN",
    "LITTLE",
    "MAJORITY",
    "MEBIBYTE",
    "MEMORY",
    "MORE_ROOM",
    "MOST_BYTES",
    "MOST_FEATURES",
    "MOST_ROWS",
    "MOST_STEPS",
    "MOST_TARGETS",
    "NEAREST",
    "NEARLY_ALL",
    "NUMBER_BITS",
    "OCTAVE",
    "OFTEN",
    "OUTLYING",
    "PAIRS",
    "RECENT",
    "REPAID",
    "REPEATED",
    "RESOLUTION",
    "ROUGH",
    "ROUNDED",
    "ROUNDINGS",
    "ROUNDS",
    "SAME_DIGITS",
    "SAMPLES_ALIKE",
    "SAMPLES_TRIED",
    "SCENE_ROWS",
    "SEARCHED_CELLS",
    "SEARCHED_ROWS",
    "SELDOM",
    "SHORT",
    "SMALL",
    "STDS",
    "SUMMABLE",
    "SWEEPS",
    "TOLD",
    "TYPICAL",
    "VERIFYING",
    "WIDE",
]

# ---------------------------------------------------------------------- what evidence takes
EVIDENCE: Final = 10.0
"""Bits by which evidence must lead before anything is changed for it: such a lead misleads once in 2^10 times."""

MOST_ROWS: Final = 3_000
"""Examples that are kept for, or looked at in, one fit at most, the newest or some spread over time: more tell weights
and spreads to less than 2 %, 1 / sqrt(n), of what they can't explain."""

EXACT: Final = float(math.ceil(2 * math.log2(MOST_ROWS)))
"""Bits by which an example of exact data verifies a function that it fits, at least: few such examples are enough. Two
agree by chance once in 2^24 times, so that of all pairs of `MOST_ROWS` hardly one does."""

VERIFYING: Final = 2
"""Rows of a random sample that verify a function, besides those that fix its numbers: the second one shows most of
what the first one agrees with by chance. Of many terms, chosen among many columns, so many verify each."""

FOUNDING: Final = (10, 40)
"""Examples that found a mode, T of §3.2.2: where each verifies its function by `EXACT` bits, and where by half of them
or less, as in the thesis."""

FEWEST: Final = 2 * VERIFYING
"""Examples that found something where nothing says how sure each makes it: two that fix two weights, as most functions
have, and two that verify them."""

# ---------------------------------------------------------------------- shares, and what is large beside something
MAJORITY: Final = 0.5
"""So large a share of them are most of them."""

SMALL: Final = 0.1
"""A tenth of something is a small part of it: what errs more by so much is as good, and what leaves no more of the
changes than that explains them."""

NEARLY_ALL: Final = 1.0 - SMALL
"""Share of the examples that a function must explain where others may come between: what comes from nowhere, what is
explained by chance, what happens at a border."""

COVERED: Final = 0.95
"""Share of what comes that intervals are to hold: two standard deviations, if errors are normal."""

TOLD: Final = float(round(SMALL**-2))
"""A change of so many tolerances tells a weight to 1 %; numbers that differ by less tell nothing, and what is estimated
is of the same order up to so many times as much."""

LITTLE: Final = 1.0 / TOLD
"""A hundredth of something, a small part of a small part of it, is little beside it."""

LEFT_OPEN: Final = 2.0 * LITTLE
"""Share of its examples that a law may leave unexplained: contacts that no engine settles, corners. The bits of so many
exceptions are a twentieth of those that numbers without a law would take."""

ACTING: Final = SMALL * TOLD
"""A term acts on an example where it contributes more than so many tolerances: a tenth of what tells its weight."""

EXTRAPOLATED: Final = TOLD
"""A function through a few rows is evaluated at first with a tolerance this much wider: its errors grow with the
distance from them, in units of how far they lie apart, and that is seldom more."""

BEYOND: Final = 0.5
"""Changes may go beyond those that were seen by so much of their range: on other days somebody flies faster."""

# ---------------------------------------------------------------------- noise and rounding
STDS: Final = 4.0
"""Standard deviations within which an error is noise: a normal one is beyond them once in 16,000 times."""

TYPICAL: Final = NormalDist().inv_cdf(0.5 + 0.5 * MAJORITY)
"""Median of a normal variable's size, in standard deviations: half of all are within."""

ROUNDED: Final = 1e-9
"""What differs by so small a share, or by so much of 1, differs by rounding: half of a float's digits, which is what is
left of them where squares are compared, and more than sums of a million numbers lose. A column whose part orthogonal to
others, or to 1, is relatively smaller is collinear with them."""

SAME_DIGITS: Final = round(-math.log10(ROUNDED))
"""Digits to which numbers agree that differ by rounding: those of `ROUNDED`."""

ALIKE: Final = 2.0 ** (-2.0 * EVIDENCE)
"""What differs by so small a share, or by so many bits, is the same though it was found in another way, fitted to other
examples or summed up from squares of what differs by rounding: a millionth. By chance two numbers are as close once in
2^20 times: `EVIDENCE`, though they were the closest of as many pairs as evidence misleads in once."""

ROUNDINGS: Final = 32.0
"""Roundings that a function of a few terms on differences of stored numbers carries at most: each of some eight terms
has two of the difference, one of the product and one of the sum."""

ROUGH: Final = STDS
"""So many times the rounding noise can't be rounding."""

RESOLUTION: Final = 1 << 32
"""Parts of a whole, or tolerances of a number, finer than which nothing is told: votes are counted in integer multiples
of 1 / `RESOLUTION`, so that their sums are exact, in whatever order."""

NUMBER_BITS: Final = 1.0 + math.log2(RESOLUTION)
"""Bits of a number that nothing tells: its sign, and which of `RESOLUTION` tolerances it has."""

SUMMABLE: Final = math.sqrt(sys.float_info.max / 2**sys.float_info.mant_dig)
"""Numbers up to this can be multiplied, and 2^53 of the products be summed, before a float64 overflows."""

OUTLYING: Final = 32.0
"""A number this much larger than what is known of its property is suspicious; so of `FIRST` suspicious ones `ENOUGH`
within this factor of one another are no errors."""

REPEATED: Final = 1 + 2 * VERIFYING
"""So many numbers as large must have come for a magnitude to be known: one or two outliers, each of which is seen after
one step and before the next one, don't widen the limit. So many suspicious ones that are exactly equal are no errors
(rewards, codes), nor are so many in successive transitions (another scale)."""

# ---------------------------------------------------------------------- how many examples
FIRST: Final = 64
"""Examples that something is fitted to for the first time; from then on whenever there are so many times as many
(`relgym.scheduling.renewal`). So many tell a standard deviation to 9 %, 1 / sqrt(2 n)."""

OFTEN: Final = 1.0 + MAJORITY
"""What lags behind is fitted anew when there are half as many examples more: a third of them is new then, and all fits
before the latest one cost twice as much as that."""

SELDOM: Final = 4
"""What shouldn't come and go, such as the noise and the order of targets, is estimated anew when there are so many
times as many examples: what is left to chance is half as much then. A search draws so many times fewer random samples
where it looks at more than the fewest columns, and again where at more than `WIDE`, since each costs the more."""

ENOUGH: Final = FIRST // SELDOM
"""Examples that tell roughly how large something is: a standard deviation to 18 %, 1 / sqrt(2 n), half as well as
`FIRST`."""

FEW: Final = FIRST // 2
"""Trials that tell how often something comes true: a share to 9 %, 1 / sqrt(4 n). Of a kind of fewer, more common kinds
tell; and fewer hits don't end a record."""

FEW_VALUES: Final = FIRST
"""Numbers that take no more values than what is fitted first has examples are a choice among a few, or count something:
pixels, cells, actions."""

RECENT: Final = round(max(FOUNDING) / (2.0 * SMALL))
"""Latest examples that tell how things stand at present: enough to found a mode that is a fifth of them, so that there
is a law among them, or it is doubtful that there is one. A share of them is known to 3.5 %, 1 / sqrt(4 n)."""

MEMORY: Final = round(2.0**EVIDENCE)
"""Latest trials that tell how right predictions are, so many that evidence misleads in one of them; of more the older
ones count half. From half as many a share of 99 % is known to 0.4 %, and a lead of 10 bits is one of 1.4 % in root
mean square."""

OCTAVE: Final = math.ceil(1.0 / math.log2(1.0 + 2.0 * SMALL))
"""Bins of errors' sizes in an octave: so many that an interval is a fifth too wide at most."""

SEARCHED_ROWS: Final = round(max(FOUNDING) / SMALL)
"""Examples among which functions are searched for at a time: there are enough to found a mode that is a tenth of them,
and all their distances take 1.3 MB. What is found is fitted to more."""

LEAST_EXEMPLARS: Final = round(min(FOUNDING) / SMALL)
"""Classified examples that are kept whatever memory they take: enough of each mode of ten."""

# ---------------------------------------------------------------------- searches, and what they may cost
ALTERNATIVES: Final = 4
"""Alternatives of a kind that are followed up at most, the best first, where all would be too many: a budget, each
takes a search or a fit."""

ROUNDS: Final = 3
"""Rounds of fitting to what the fit before explains, at most: a budget."""

SWEEPS: Final = 20
"""Sweeps over the contacts of a scene, or trials of which pieces of their laws hold, before something else is tried;
and how often that is done: a budget, of 400 sweeps."""

SHORT: Final = 3
"""Literals of a definition so short that a faultless one is taken as it is: hardly anything shorter would be found."""

DEGREES: Final = (1, 2, 3)
"""Low degrees, as laws have them: powers of extents that inertia and shares may go with (length, area, volume), and
multiples of an angle of which sines and cosines are offered, polynomials of such degrees in its sine and cosine."""

DRAWS: Final = math.ceil(math.log(LEFT_OPEN) / math.log1p(-((2.0 * SMALL) ** 2)))
"""Random samples of two rows: of what holds for a fifth of the rows, all but one in fifty searches draws a sample."""

WIDE: Final = max(FOUNDING)
"""Searches of more columns than found a mode as examples draw fewer and larger samples, and choose in a cheaper way."""

SAMPLES_ALIKE: Final = math.ceil(math.log(LEFT_OPEN) / math.log1p(-MAJORITY))
"""Random samples that chose the same columns and are tried on all rows, at most: where every other one is of one mode,
some of six is in all but one of fifty searches, and the next search draws others."""

SAMPLES_TRIED: Final = 2 * ALTERNATIVES * SAMPLES_ALIKE
"""Random samples that are tried on all rows in one search, at most: those of eight sets of columns."""

SCENE_ROWS: Final = 1 + VERIFYING
"""Rows of each scene in a random sample of a few scenes: one tells what is constant in it, the others what changes. Of
two scenes, the fewest, half of the six rows verify a function of a present value, an action and what is constant."""

MOST_FEATURES: Final = 2 * MOST_ROWS
"""Columns that are made of others, at most: of `MOST_ROWS` rows they take 144 MB, and a search takes minutes."""

SEARCHED_CELLS: Final = 1_000_000
"""Numbers that one search looks at, at most: about 4 ms for each of the passes that it makes over them."""

CALL: Final = 25_000
"""What a few array operations cost however few numbers they look at, in cells: a tenth of a millisecond."""

# ---------------------------------------------------------------------- room and machines
PAIRS: Final = 10_000
"""Pairs of bodies that one step looks at, at most, as many as a hundred bodies make: a budget."""

NEAREST: Final = round(math.sqrt(SMALL * PAIRS))
"""About so many bodies, at least one of each type, make a small scene: their pairs are a small part of `PAIRS`."""

MOST_TARGETS: Final = 256
"""Properties that one model learns, at most: of more a step would take seconds."""

MOST_STEPS: Final = int(np.iinfo(np.int32).max)
"""Steps of a roll-out, whose predictions all lie in memory: no machine holds more than 32 bits can count."""

CHECKPOINT: Final = 1_000
"""A checkpoint is taken after so many steps at the latest: a rollback takes as long as so many steps."""

MEBIBYTE: Final = 1 << 20
"""Bytes of what settings call a megabyte."""

MOST_BYTES: Final = 32 * MEBIBYTE
"""Memory of what is remembered only to be quicker, and of one array that is worked on: a few of them fit anywhere."""

FIRST_ROOM: Final = FIRST * SELDOM
"""Rows that a growing array has room for at first, and for at least so many more whenever it is full: as many as there
are when what shouldn't come and go is estimated for the second time."""

MORE_ROOM: Final = SMALL
"""Share by which an array that is full grows: a row is copied some ten times in all. A regression is solved anew when
there are so many rows more: it lags by an eleventh of them at most."""

CACHED: Final = 1 << 14
"""Numbers that are worked on at once where more would be, 128 kB: with what is made of them they fit a core's cache."""

LAYOUTS: Final = MOST_BYTES // (CACHED * np.float64().nbytes)
"""Layouts of scenes of which something is remembered only to be quicker, each in the room of so many numbers; before
there are more, all are forgotten."""

ANSWERS: Final = MOST_BYTES // (MEMORY * np.float64().nbytes)
"""Answers of a kind, of a thousand numbers at most, that are remembered only to be quicker; before there are more, all
are forgotten."""

LARGE: Final = CACHED
"""Bytes of an array from which on it is copied beside what is serialised, no longer with it: an eighth of that."""

REPAID: Final = 128
"""Times something is asked before that is made which answers sooner: to make it takes as long (rent or buy: Karlin et
al. 1988). So the kernel, 60 ms to load, where arrays take half a millisecond; and tables of what is asked again."""

DIGITS: Final = 7
"""Significant digits of numbers in formulas, unless somebody asks for others."""

ALL_DIGITS: Final = sys.float_info.dig + 2
"""Significant digits that tell every float64 from every other one."""
