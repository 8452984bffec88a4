"""Constants that several parts of the learner share, each with its unit, what it means and what it follows from.

They aren't settings: nothing in an env asks for others. What a user may want to change is a field of `ModelConfig`.
"""

from __future__ import annotations

import sys
from typing import Final

__all__ = [
    "ACTING",
    "ALIKE",
    "ALL_DIGITS",
    "ALTERNATIVES",
    "ANSWERS",
    "BEYOND",
    "CACHED",
    "CALL",
    "COVERED",
    "DIGITS",
    "DRAWS",
    "ENOUGH",
    "EVIDENCE",
    "EXACT",
    "EXTRAPOLATED",
    "FEWEST",
    "FEW_VALUES",
    "FIRST",
    "FIRST_ROOM",
    "FOUNDING",
    "FREQUENCIES",
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
    "NEARLY_ALL",
    "NUMBER_BITS",
    "OFTEN",
    "PAIRS",
    "POWERS",
    "RECENT",
    "REPAID",
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
    "UNIT",
    "VERIFYING",
    "WIDE",
]

EVIDENCE: Final = 10.0
"""Bits by which evidence must lead before anything is changed for it: such a lead misleads once in 2^10 times."""

EXACT: Final = 24.0
"""Bits by which an example of exact data verifies a function that it fits, at least: few such examples are enough. Two
agree by chance once in 2^24 times, so that of all pairs of a few thousand hardly one does."""

ROUNDED: Final = 1e-9
"""What differs by so small a share, or by so much of 1, differs by rounding: half of a float's digits, which is what is
left of them where squares are compared, and more than sums of a million numbers lose. A column whose part orthogonal to
others, or to 1, is relatively smaller is collinear with them."""

SAME_DIGITS: Final = 9
"""Digits to which numbers agree that differ by rounding: those of `ROUNDED`."""

ALIKE: Final = 1e-6
"""What differs by so small a share, or by so many bits, is the same though it was found in another way, fitted to other
examples or summed up from squares of what differs by rounding: a thousand times `ROUNDED`."""

STDS: Final = 4.0
"""Standard deviations within which an error is noise: a normal one is beyond them once in 16,000 times."""

ROUNDINGS: Final = 32.0
"""Roundings that a function of a few terms on differences of stored numbers carries at most: each of some eight terms
has two of the difference, one of the product and one of the sum."""

ROUGH: Final = 4.0
"""So many times the rounding noise can't be rounding: two more bits than the largest estimate of it has."""

EXTRAPOLATED: Final = 100.0
"""A function through a few rows is evaluated at first with a tolerance this much wider: its errors grow with the
distance from them, in units of how far they lie apart, and that is seldom more."""

TOLD: Final = 100.0
"""A change of so many tolerances tells a weight to 1 %; numbers that differ by less tell nothing, and what is estimated
is of the same order up to so many times as much."""

ACTING: Final = 10.0
"""A term acts on an example where it contributes more than so many tolerances: a tenth of what tells its weight."""

NUMBER_BITS: Final = 33.0
"""Bits of a number that nothing tells: its sign, and which of 2^32 tolerances it has."""

BEYOND: Final = 0.5
"""Changes may go beyond those that were seen by so much of their range: on other days somebody flies faster."""

FIRST: Final = 64
"""Examples that something is fitted to for the first time; from then on whenever there are so many times as many
(`relgym.scheduling.renewal`). So many tell a standard deviation to 9 %, 1 / sqrt(2 n)."""

OFTEN: Final = 1.5
"""What lags behind is fitted anew when there are so many times as many examples: a third of them is new then, and all
fits before the latest one cost twice as much as that."""

SELDOM: Final = 4
"""What shouldn't come and go, such as the noise, is estimated anew when there are so many times as many examples: what
is left to chance is half as much then."""

RECENT: Final = 200
"""Latest examples that tell how things stand at present: five times what the thesis' modes need, so that there is a law
among them, or it is doubtful that there is one. A share of them is known to 3.5 %, 1 / sqrt(4 n)."""

MEMORY: Final = 1024
"""Latest trials that tell how right predictions are; of more the older ones count half. From half as many a share of
99 % is known to 0.4 %, and a lead of 10 bits is one of 1.4 % in root mean square."""

MOST_ROWS: Final = 3_000
"""Examples that are kept for, or looked at in, one fit at most, the newest or some spread over time: more tell weights
and spreads to less than 2 %, 1 / sqrt(n), of what they can't explain."""

SEARCHED_ROWS: Final = 400
"""Examples among which functions are searched for at a time: there are forty of a mode that is a tenth of them, and all
their distances take 1.3 MB. What is found is fitted to more."""

FEWEST: Final = 4
"""Examples that found something where nothing says how sure each makes it: two that fix two weights, as most functions
have, and two that verify them."""

FOUNDING: Final = (10, 40)
"""Examples that found a mode, T of §3.2.2: where each verifies its function by `EXACT` bits, and where by half of them
or less, as in the thesis."""

VERIFYING: Final = 2
"""Rows of a random sample that verify a function, besides those that fix its numbers: the second one shows most of
what the first one agrees with by chance. Of many terms, chosen among many columns, so many verify each."""

ENOUGH: Final = 16
"""Examples that tell roughly how large something is: a standard deviation to 18 %, 1 / sqrt(2 n)."""

FEW_VALUES: Final = 64
"""Numbers that take no more values are a choice among a few, or count something: pixels, cells, actions."""

ALTERNATIVES: Final = 4
"""Alternatives of a kind that are followed up at most, the best first, where all would be too many: a budget, each
takes a search or a fit."""

ROUNDS: Final = 3
"""Rounds of fitting to what the fit before explains, at most: a budget."""

DRAWS: Final = 96
"""Random samples of two rows: of what holds for a fifth of the rows, all but one in fifty searches draws a sample."""

WIDE: Final = 40
"""Searches of more columns than this draw fewer and larger samples, and choose in a cheaper way."""

SWEEPS: Final = 20
"""Sweeps over the contacts of a scene, or trials of which pieces of their laws hold, before something else is tried;
and how often that is done: a budget, of 400 sweeps."""

NEARLY_ALL: Final = 0.9
"""Share of the examples that a function must explain where others may come between: what comes from nowhere, what is
explained by chance, what happens at a border."""

COVERED: Final = 0.95
"""Share of what comes that intervals are to hold: two standard deviations, if errors are normal."""
MAJORITY: Final = 0.5
"""So large a share of them are most of them."""

SMALL: Final = 0.1
"""A tenth of something is a small part of it: what errs more by so much is as good, and what leaves no more of the
changes than that explains them."""

LITTLE: Final = 0.01
"""A hundredth of something is little beside it."""

LEFT_OPEN: Final = 0.02
"""Share of its examples that a law may leave unexplained: contacts that no engine settles, corners. The bits of so many
exceptions are a twentieth of those that numbers without a law would take."""

SEARCHED_CELLS: Final = 1_000_000
"""Numbers that one search looks at, at most: about 4 ms for each of the passes that it makes over them."""

SAMPLES_ALIKE: Final = 6
"""Random samples that chose the same columns and are tried on all rows, at most: where one in three is of one mode,
none of six is in a tenth of all searches, and the next search draws others."""

SAMPLES_TRIED: Final = 48
"""Random samples that are tried on all rows in one search, at most: those of eight sets of columns."""

SCENE_ROWS: Final = 3
"""Rows of each scene in a random sample of a few scenes: one tells what is constant in it, the others what changes. Of
two scenes, the fewest, half of the six rows verify a function of a present value, an action and what is constant."""

POWERS: Final = (1, 2, 3)
"""Powers of extents that inertia and shares may go with: length, area, volume."""

FREQUENCIES: Final = (1, 2, 3)
"""Multiples of an angle of which sines and cosines are offered as columns: higher ones are seldom seen in a law."""

MOST_FEATURES: Final = 6_000
"""Columns that are made of others, at most: of `MOST_ROWS` rows they take 144 MB, and a search takes minutes."""

SUMMABLE: Final = 1e146
"""Numbers up to this can be multiplied, and 2^53 of the products be summed, before a float64 overflows."""

LEAST_EXEMPLARS: Final = 100
"""Classified examples that are kept whatever memory they take: some ten of each mode of a few."""

DIGITS: Final = 7
"""Significant digits of numbers in formulas, unless somebody asks for others."""

ALL_DIGITS: Final = sys.float_info.dig + 2
"""Significant digits that tell every float64 from every other one."""

TYPICAL: Final = 0.6744897501960817
"""Median of a normal variable's size, in standard deviations: ``NormalDist().inv_cdf(0.75)``."""

SHORT: Final = 3
"""Literals of a definition so short that a faultless one is taken as it is: hardly anything shorter would be found."""

ANSWERS: Final = 4_096
"""Answers of a kind that are remembered only to be quicker; before there are more, all are forgotten."""

MEBIBYTE: Final = 1 << 20
"""Bytes of what settings call a megabyte."""

MOST_BYTES: Final = 32 * MEBIBYTE
"""Memory of what is remembered only to be quicker, and of one array that is worked on: a few of them fit anywhere."""

LAYOUTS: Final = 256
"""Layouts of scenes of which something is remembered only to be quicker; before there are more, all are forgotten."""

REPAID: Final = 128
"""Times something is asked before that is made which answers sooner: to make it takes as long (rent or buy: Karlin et
al. 1988). So the kernel, 60 ms to load, where arrays take half a millisecond; and tables of what is asked again."""

PAIRS: Final = 10_000
"""Pairs of bodies that one step looks at, at most, as many as a hundred bodies make: a budget."""

MOST_TARGETS: Final = 256
"""Properties that one model learns, at most: of more a step would take seconds."""

CALL: Final = 25_000
"""What a few array operations cost however few numbers they look at, in cells: a tenth of a millisecond."""

FIRST_ROOM: Final = 256
"""Rows that a growing array has room for at first, and for at least so many more whenever it is full."""

UNIT: Final = 12
"""Cells that one unit of `ModelConfig.work_per_step` stands for."""

CACHED: Final = 1 << 14
"""Numbers that are worked on at once where more would be, 128 kB: with what is made of them they fit a core's cache."""

LARGE: Final = 1 << 14
"""Bytes of an array from which on it is copied beside what is serialised, no longer with it."""

MORE_ROOM: Final = 0.125
"""Share by which an array that is full grows, as CPython's lists do: a row is copied some eight times in all. A
regression is solved anew when there are so many rows more: it lags by a ninth of them at most."""

MOST_STEPS: Final = 10**9
"""Steps of a roll-out, whose predictions all lie in memory: no machine holds more."""
