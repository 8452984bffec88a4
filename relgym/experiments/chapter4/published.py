"""What the thesis printed: the numbers of its tables and, where its text names them, of its figures.

Velocities are in units per step, rates are shares. Clauses (tables 3.2, 4.3-4.6 and 4.10-4.14) lie in
``published_clauses.txt``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Final

__all__ = [
    "CLASSIFIER_ERRORS",
    "CONFUSIONS",
    "MODES",
    "RATES",
    "REMARKS",
    "RENUMBERED",
    "ROLLOUT_FAILURES",
    "Confusion",
    "PublishedClause",
    "PublishedMode",
    "PublishedPair",
    "published_pairs",
    "rows_of_pair",
]


@dataclass(frozen=True, slots=True)
class PublishedMode:
    """A row of tables 4.2, 4.9 or 4.17: ``v' = weights . (vx, vy) + intercept``; noise has no weights."""

    number: int
    behaviour: str
    examples: int
    weights: tuple[float, float] | None = None
    intercept: float = 0.0


def _noise(examples: int) -> PublishedMode:
    return PublishedMode(0, "Noise", examples)


MODES: Final[Mapping[tuple[str, str], tuple[PublishedMode, ...]]] = {
    ("4.2", "x"): (
        _noise(7),
        PublishedMode(1, "Slide on horiz. surf./fly", 15574, (1.0, 0.0)),
        PublishedMode(2, "Bounce on vert. surf.", 295, (-0.9, 0.0)),
        PublishedMode(3, "Bounce/slide on ramp", 124, (0.525, -0.823), 4.24e-4),
    ),
    ("4.2", "y"): (
        _noise(10),
        PublishedMode(1, "Fly (in gravity)", 9169, (0.0, 1.0), -9.8e-4),
        PublishedMode(2, "Slide on horiz. surf.", 6355, (0.0, 0.0)),
        PublishedMode(3, "Bounce on horiz. surf.", 334, (0.0, -0.9)),
        PublishedMode(4, "Bounce/slide on ramp", 132, (-0.823, -0.425), -2.45e-4),
    ),
    ("4.9", "x"): (
        _noise(65),
        PublishedMode(1, "Slide/bounce left on horizontal surface", 6477, (1.0, -0.39), 1.96e-4),
        PublishedMode(2, "Slide/bounce right on horizontal surface", 6094, (1.0, 0.39), -1.96e-4),
        PublishedMode(3, "Fly", 18882, (1.0, 0.0)),
        PublishedMode(4, "Bounce on vert. surf.", 347, (-0.95, 0.0)),
        PublishedMode(5, "Halt from friction", 93, (0.0, 0.0)),
        PublishedMode(6, "Bounce/slide on ramp", 42, (-0.17, -1.17), 5.88e-4),
    ),
    ("4.9", "y"): (
        _noise(64),
        PublishedMode(1, "Fly (in gravity)", 17151, (0.0, 1.0), -9.8e-4),
        PublishedMode(2, "Slide on horiz. surf.", 13639, (0.0, 0.0)),
        PublishedMode(3, "Bounce on horiz. surf.", 308, (0.0, -0.95)),
        PublishedMode(4, "Bounce on vert. surf.", 437, (0.39, 1.0), -9.8e-4),
        PublishedMode(5, "Bounce on vert. surf.", 359, (-0.39, 1.0), -9.8e-4),
        PublishedMode(6, "Slide/bounce on ramp", 42, (-0.78, 0.22), -5.88e-4),
    ),
    ("4.17", "x"): (
        _noise(179),
        PublishedMode(1, "Slide right, 0.1 fric.", 5253, (1.0, 0.0), -9.8e-5),
        PublishedMode(2, "Slide left, 0.1 fric.", 4766, (1.0, 0.0), 9.8e-5),
        PublishedMode(3, "Slide right, 0.2 fric.", 6343, (1.0, 0.0), -1.96e-4),
        PublishedMode(4, "Slide left, 0.2 fric.", 6623, (1.0, 0.0), 1.96e-4),
        PublishedMode(5, "Fly", 46031, (1.0, 0.0)),
        PublishedMode(6, "Bounce on vert. surf.", 1191, (-0.95, 0.0)),
        PublishedMode(7, "Halt from friction", 7892, (0.0, 0.0)),
        PublishedMode(8, "Bounce right, 0.1 fric.", 4318, (1.0, 0.195), -9.8e-5),
        PublishedMode(9, "Bounce right, 0.2 fric.", 2656, (1.0, 0.39), -1.96e-4),
        PublishedMode(10, "Bounce left, 0.1 fric.", 6358, (1.0, -0.195), 9.8e-5),
        PublishedMode(11, "Bounce right, 0.2 fric.", 4151, (1.0, -0.39), 1.96e-4),
        PublishedMode(12, "Ramp bounce, 0.1 fric.", 79, (-0.0725, -1.0725), 5.39e-4),
        PublishedMode(13, "Ramp bounce, 0.2 fric.", 63, (-0.17, -1.17), 5.88e-4),
        PublishedMode(14, "Ramp bounce, 0.1 fric.", 50, (-0.475, -0.475)),
        PublishedMode(15, "Ramp bounce, 0.1 fric.", 47, (0.1225, -0.8775), 4.41e-4),
    ),
}
"""Rows by table and axis. The last row but four of Table 4.17 says right and means left: its weight is negative."""


@dataclass(frozen=True, slots=True)
class Confusion:
    """Tables 4.7, 4.8, 4.15 and 4.16: counts by predicted mode (rows) and correct mode (columns)."""

    errors: tuple[tuple[int, ...], ...]
    examples: tuple[int, ...]

    @property
    def rate(self) -> float:
        """Share of errors."""
        return sum(map(sum, self.errors)) / sum(self.examples)


CONFUSIONS: Final[Mapping[str, Confusion]] = {
    "4.7": Confusion(((0, 12, 1), (26, 0, 17), (63, 1, 0)), (23495, 318, 187)),
    "4.8": Confusion(((0, 69, 0, 0), (6, 0, 91, 0), (4, 0, 0, 1), (75, 12, 1, 0)), (13530, 9768, 515, 187)),
    "4.15": Confusion(
        (
            (0, 0, 3, 0, 20, 0),
            (0, 0, 620, 0, 43, 0),
            (32, 16, 0, 0, 0, 0),
            (5, 2, 0, 0, 0, 0),
            (0, 25, 0, 0, 0, 0),
            (0, 0, 3, 11, 0, 0),
        ),
        (4746, 4976, 13936, 199, 67, 30),
    ),
    "4.16": Confusion(
        (
            (0, 48, 0, 0, 0, 0),
            (12, 0, 138, 1, 0, 0),
            (0, 0, 0, 0, 0, 0),
            (0, 1, 0, 0, 1, 0),
            (1, 10, 0, 5, 0, 0),
            (2, 10, 0, 1, 4, 0),
        ),
        (13325, 10337, 210, 23, 30, 30),
    ),
}
"""As printed, save that Table 4.16 has its column sums once more in the row of mode 6; here is what they leave."""

RATES: Final[Mapping[tuple[int, str], tuple[float, float]]] = {
    (1, "ball.vx"): (0.003, 0.007),
    (1, "ball.vy"): (0.007, 0.015),
    (2, "ball.vx"): (0.02, 0.05),
    (2, "ball.vy"): (0.007, 0.016),
}
"""Around the rates of errors of tables 4.7, 4.8, 4.15 and 4.16, by experiment and target: what counts as landing there.

The tables are of one model each; 0.005, 0.011, 0.033 and 0.010."""

ROLLOUT_FAILURES: Final[Mapping[str, int]] = {
    "bad collision resolution, vertical": 9,
    "bad collision resolution, ramp slant": 9,
    "bounce against a corner": 4,
    "misclassified ramp bounce": 5,
    "delayed falling": 7,
}
"""Table 4.18. The text counts 13 and 9 bad resolutions (22, then corrected by hand) and 26 trials with an error."""

CLASSIFIER_ERRORS: Final[Mapping[str, Mapping[int, float]]] = {
    "FOIL": {32: 0.041, 160: 0.035},
    "svm-printed": {32: 0.177, 160: 0.082},
    "knn-10-printed": {32: 0.307, 160: 0.259},
}
"""Figure 4.21 as its text gives it (§4.7.2): misclassified x modes of experiment 2 after so many episodes."""

RENUMBERED: Final[Mapping[str, Mapping[int, int]]] = {"4.5": {3: 4, 4: 3}, "4.6": {3: 4, 4: 3}}
"""Tables of clauses whose modes aren't numbered as in Table 4.2, and which rows of that theirs are.

Mode 3 of Table 4.5 has 124 examples, and ramp(B) tells them from mode 4: it is the ramp's. The text takes it for the
floor bounce, and so explains its clauses by a ball that sinks in.
"""

_SWAPPED: Final = (
    "mode 3 here has 124 examples and is told by ramp(B): it is mode 4 of Table 4.2, the ramp's, and mode 4 here the "
    "floor bounce;\nthe text of §4.3.2 takes them for one another"
)

REMARKS: Final[Mapping[str, str]] = {
    "table-4.5": _SWAPPED,
    "table-4.6": _SWAPPED,
    "figure-4.2": _SWAPPED,
    "table-4.4": 'headed "Mode 1 vs. 2", but its text and counts are of modes 2 and 3',
    "figure-4.3": "95 % of all errors below 1e-12 from 16 episodes on",
    "figure-4.4": "bounces and ramp with high errors for many episodes, low ones after 80",
    "figure-4.5": "the same; the third quartile of floor bounces never improves",
    "figure-4.6": "y: 2 % after 80 episodes by the text (1.1 % by Table 4.8), mostly misclassified; x 0.5 % by "
    "Table 4.7",
    "figure-4.7": "essentially zero after 32 episodes if the right mode is always chosen",
    "figure-4.12": "as in experiment 1, most modes are learned very quickly",
    "figure-4.13": "the halt's errors stay high throughout",
    "figure-4.14": "floor bounces' errors stay high throughout",
    "figure-4.15": "x 3.6 %, y 1.3 % after 160 episodes",
    "figure-4.16": "no number; the extra modes are accommodated",
    "figure-4.17": "slightly higher than in experiment 2",
    "figure-4.18": "expecting too little, modes are lost once the noise exceeds it (none learned at 1e-5); expecting "
    "1e-5, they are overgeneral",
    "figure-4.19": "median above our 95th percentile until 128 episodes, then a drop; the third quartile never below "
    "the change",
    "figure-4.20": "uncentred: all three worse than in Figure 4.19",
    "figure-4.22": "26 of 80 trials with a significant error",
    "figure-4.23": "26 of 80 trials with a significant error",
    "figure-4.27": "modes 1 and 2 right; mode 3 not learned, for there was no ramp",
    "figure-4.28": "all three learned; bounces against the box sometimes taken for the ramp's",
    "figure-4.29": "about as Figure 4.28",
}
"""What the thesis says of jobs' figures that print no numbers, and of one table."""


@dataclass(frozen=True, slots=True)
class PublishedClause:
    """A row of Table 4.3: the clause, examples it decides rightly and wrongly, whether a tree stands behind it."""

    clause: str
    correct: int
    incorrect: int
    tree: bool


@dataclass(frozen=True, slots=True)
class PublishedPair:
    """A section of Table 4.3: the modes, whether it is marked "Negated", and its training performance."""

    mode: int
    other: int
    negated: bool
    performance: float
    clauses: tuple[PublishedClause, ...]


@cache
def published_pairs(table: str) -> tuple[PublishedPair, ...]:
    """Sections of a table of clauses: ``"3.2"``, ``"4.3"`` to ``"4.6"``, ``"4.10"`` to ``"4.14"``."""
    text = files(__package__).joinpath("published_clauses.txt").read_text(encoding="utf-8")
    section = text.split(f"[{table}]\n")[1].split("\n[")[0]
    pairs: list[PublishedPair] = []
    clauses: list[PublishedClause] = []
    for line in section.strip("\n").split("\n"):
        if line.startswith(" "):
            clause, correct, incorrect, tree = (part.strip() for part in line.split("|"))
            clauses.append(PublishedClause(clause, int(correct), int(incorrect), tree == "yes"))
            pairs[-1] = PublishedPair(*_head(pairs[-1]), tuple(clauses))
        else:
            mode, other, sign, performance = line.split()
            clauses = []
            pairs.append(PublishedPair(int(mode), int(other), sign == "negated", float(performance), ()))
    return tuple(pairs)


def rows_of_pair(table: str, pair: PublishedPair) -> frozenset[int]:
    """Rows of the table of modes that a section of a table of clauses tells apart."""
    rows = RENUMBERED.get(table, {})
    return frozenset(rows.get(number, number) for number in (pair.mode, pair.other))


def _head(pair: PublishedPair) -> tuple[int, int, bool, float]:
    return pair.mode, pair.other, pair.negated, pair.performance
