"""The intermediate form: a learned model laid over the objects of a scene, as one typed flat program.

A program says what happens to a row of numbers, and nothing else: it knows columns, constants and operations, no types
of objects and no names of properties. `relgym.model.running.lowering` makes it of a model; `relgym.program.tape` writes
it as two arrays, which `relgym.program.kernel` runs; `relgym.program.source` writes it as Python.

**Registers.** For a state vector of width w, columns 0 … w - 1 hold the present values, w … 2 w - 1 the next ones
(which begin as copies and are filled in as they become known), 2 w is NaN (missing), 2 w + 1 is 0, 2 w + 2 is 1.
Behind them lie features and what modes predict. `CONSTANT` in the place of a column stands for the number 1.

**A step.** (1) `Motion`: free laws give every mover's next velocity; contacts then change them until all agree.
(2) Every `Answer` in causal order writes one next value: what motion says, or what the mode says that wins the vote.
(3) Declared kinematics. (4) Angles are brought into [-π, π].

**Objects** are bodies by number, and sets of them are bit masks; `ANY` stands for every one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = [
    "ANY",
    "CONSTANT",
    "CONTEXTS",
    "EXPERTS",
    "FRAMES",
    "FREE",
    "LEAST_RATE",
    "MOST_BODIES",
    "NO_RUNNER_UP",
    "OF_ALL",
    "OF_FAMILY",
    "OF_REGRESSION",
    "OF_WINNER",
    "RATES",
    "SAYS",
    "TOUCHING",
    "VALUED",
    "WIDER",
    "Answer",
    "AxisRule",
    "Belief",
    "BeyondError",
    "Body",
    "Casting",
    "Clause",
    "Contest",
    "Description",
    "Experience",
    "Factor",
    "Feature",
    "Fit",
    "Follow",
    "IsA",
    "Landing",
    "Law",
    "Leverage",
    "Literal",
    "Mode",
    "Motion",
    "Mover",
    "Pair",
    "PairTest",
    "Program",
    "Reach",
    "Regression",
    "Related",
    "Role",
    "Share",
    "Sight",
    "Stage",
    "Stop",
    "Sum",
    "Test",
    "Tree",
    "Trust",
    "Trusted",
    "Vote",
]

CONSTANT = -1
"""Column of the number 1."""

ANY = -1
"""The variable that stands for every object."""

MOST_BODIES = 62
"""Sets of bodies are bits of one integer."""

CONTEXTS = ("approached", "touching", "all")
"""Which objects a clause may mention: what the target approaches fastest, what is close to it, or all."""

EXPERTS = ("own", "guess", "regression", "latest", "persistence")
"""Who may give a value, and of whom a `Belief` tells by bits: the winner of the vote (or the law); the guess;
regressions on everything; the mode that held last, since what decides may be hidden, and a law that changed stays
changed; and that nothing changes."""

FREE, TOUCHING = 1, 2
"""What predictions by laws name in place of a mode: the free law, or laws of touching pairs on top of it."""

NO_RUNNER_UP = 7
"""Bin of leads where there is nobody to lead."""

VALUED = 1
"""Bin of leads where nobody is said to have won, since what it reads is in doubt or outside experience, but who would
have given a value."""

OF_WINNER, OF_FAMILY, OF_ALL, OF_REGRESSION = -1, -2, -3, -4
"""Bins of leads that stand for all of a winner's, for those of all modes or all laws, and for all there were before the
model was another one; and for what is known of the regression from all that it was fitted to."""

FRAMES = ("contact", "point", "turned", "centres", "own", "world")
"""Frames of contact laws (`relgym.laws.frames`)."""


class BeyondError(Exception):
    """A program has no words, or no room, for what was learned; the message says for what."""


# ---------------------------------------------------------------------------------------------- numbers
@dataclass(frozen=True, slots=True)
class Sum:
    """``sum(weight * column)``, in this order; without terms it is 0."""

    terms: tuple[tuple[int, float], ...]


@dataclass(frozen=True, slots=True)
class Factor:
    """A column as it is, or the sine or cosine (`function`) of `frequency` times it."""

    column: int
    function: str = ""
    frequency: int = 1


@dataclass(frozen=True, slots=True)
class Feature:
    """``register = product of factors``."""

    register: int
    factors: tuple[Factor, ...]
    name: str


@dataclass(frozen=True, slots=True)
class Follow:
    """``register = column + scale * value``, or ``column * value`` where `scale` is 0."""

    register: int
    column: int
    value: int
    scale: float


# ---------------------------------------------------------------------------------------------- bodies
@dataclass(frozen=True, slots=True)
class Body:
    """A body: its canonical outline, and the columns of its pose and velocity.

    Attributes
    ----------
    name
        For people.
    shape
        ``"round"``, ``"box"`` or ``"polygon"``.
    outline
        Corners in the plane, counter-clockwise, scaled by the extents; none where round, or in space.
    position, extent
        Columns along the axes in use; in the plane the first axis, the upward one, and behind them the depth.
    angle
        Column of the rotation about the depth axis.
    velocity
        Columns along the same axes; that of 0 where it has none.
    moves
        Whether its type has a velocity.
    spin
        Column of how fast it spins, where that is learned; else that of 0.
    spins
        Whether it is.
    pose
        Columns of the whole pose, in the order of `relgym.scene.objects.POSE`.
    """

    name: str
    shape: str
    outline: tuple[tuple[float, float], ...]
    position: tuple[int, int, int]
    extent: tuple[int, int, int]
    angle: int
    velocity: tuple[int, int, int]
    moves: bool
    spin: int
    spins: bool
    pose: tuple[int, ...]


# ---------------------------------------------------------------------------------------------- laws of motion
@dataclass(frozen=True, slots=True)
class AxisRule:
    """The velocity after a contact along one axis: the maximum or minimum of pieces.

    Attributes
    ----------
    operator
        ``"max"`` or ``"min"``.
    pieces
        Sums over six columns: u and v along the first axis, u and v along the second one, and the impulses of both.
    back, forth
        Whether a velocity below and above 0 was ever seen after a contact.
    """

    operator: str
    pieces: tuple[Sum, ...]
    back: bool
    forth: bool


@dataclass(frozen=True, slots=True)
class Law:
    """What contacts do: rules of both axes of a frame, and for each axis which rule holds for which pair (-1: none)."""

    frame: str
    rules: tuple[tuple[AxisRule, ...], tuple[AxisRule, ...]]
    chosen: tuple[tuple[int, ...], tuple[int, ...]]


@dataclass(frozen=True, slots=True)
class Share:
    """The first body's part of an impulse: `constant`, or ``b^power / (a^power + b^power)`` of two columns."""

    constant: float = 1.0
    columns: tuple[int, int] | None = None
    power: int = 1


@dataclass(frozen=True, slots=True)
class Pair:
    """Two bodies that may meet; the first one moves. `grip`: which part of a slip velocities take, spins the rest."""

    first: int
    second: int
    share: Share
    grip: float


@dataclass(frozen=True, slots=True)
class Mover:
    """A body whose velocity laws predict: `free` sums where it touches nothing, of `governed` components."""

    body: int
    free: tuple[Sum, ...]
    governed: int
    moving: int


@dataclass(frozen=True, slots=True)
class Motion:
    """All laws of motion: `laws` are the law in force, then alternatives that explain the examples equally well."""

    movers: tuple[Mover, ...]
    pairs: tuple[Pair, ...]
    laws: tuple[Law, ...]
    slack: float
    spins: bool


# ---------------------------------------------------------------------------------------------- conditions
@dataclass(frozen=True, slots=True)
class Test:
    """``column [- minus] <= threshold`` (or ``>``), or that this isn't so; a NaN is on neither side."""

    column: int
    minus: int
    at_most: bool
    threshold: float
    negated: bool


@dataclass(frozen=True, slots=True)
class PairTest:
    """The same of a feature of (target, variable); with `ANY`, always negated: of no object."""

    feature: int
    variable: int
    at_most: bool
    threshold: float
    negated: bool


@dataclass(frozen=True, slots=True)
class Related:
    """Relation number `relation` of two variables, or that it doesn't hold."""

    relation: int
    first: int
    second: int
    negated: bool


@dataclass(frozen=True, slots=True)
class IsA:
    """A variable is one of these objects, or isn't."""

    objects: int
    variable: int
    negated: bool


Literal = PairTest | Related | IsA


@dataclass(frozen=True, slots=True)
class Clause:
    """There are objects, one for each variable from `arity` on, for which all literals hold."""

    arity: int
    variables: int
    literals: tuple[Literal, ...]
    text: str = ""


@dataclass(frozen=True, slots=True)
class Sight:
    """What a tree looks at: ``column - minus``, or the least value of a pair feature among a variable's objects."""

    column: int = -1
    minus: int = -1
    variable: int = 0
    feature: int = -1


@dataclass(frozen=True, slots=True)
class Tree:
    """Nodes (sight, threshold, below, above): below where ``sight <= threshold``; a leaf has the sight -1."""

    sights: tuple[Sight, ...]
    nodes: tuple[tuple[int, float, int, int], ...]


@dataclass(frozen=True, slots=True)
class Stage:
    """A clause with tests of numbers and a tree; `outcomes` by leaf (of one without a tree: one), -1: go on."""

    clause: Clause | None
    tests: tuple[Test, ...]
    tree: Tree | None
    outcomes: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Contest:
    """Two modes, by place: the first stage that decides gives votes to both (integers of 2**-32)."""

    first: int
    second: int
    context: int
    stages: tuple[Stage, ...]
    votes: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True)
class Experience:
    """Situations seen in training, as numbers, of what clauses look at: (context, relations, sets of objects) each."""

    used: tuple[tuple[int, tuple[int, ...], tuple[int, ...]], ...]
    seen: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Vote:
    """One-against-one voting with a run-off: all contests, and places by who wins ties."""

    contests: tuple[Contest, ...]
    by_tie: tuple[int, ...]
    experience: Experience | None


# ---------------------------------------------------------------------------------------------- roles
@dataclass(frozen=True, slots=True)
class Description:
    """Who may play some alike roles.

    Attributes
    ----------
    objects
        All of their type.
    clauses
        Each with its log-odds; the first one that holds of (target, candidate) counts.
    otherwise
        Log-odds where none holds; NaN: it can't be.
    common
        Relations that all players had (to the target, from it), and the objects of all types they had; None: no player
        was ever seen.
    places
        Which of the embodied roles.
    """

    objects: int
    clauses: tuple[tuple[Clause, float], ...]
    otherwise: float
    common: tuple[tuple[int, ...], tuple[int, ...], int] | None
    places: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Casting:
    """Who plays the embodied roles of a mode; `lenient`: even where nothing but the order decides."""

    descriptions: tuple[Description, ...]
    roles: int
    lenient: bool


@dataclass(frozen=True, slots=True)
class Role:
    """A role that several bodies could play.

    Attributes
    ----------
    place
        Which of the embodied roles it is.
    terms
        Weight, and for each body its column (-1: not of that type).
    name
        Its place among all roles of the mode but the target's.
    """

    place: int
    terms: tuple[tuple[float, tuple[int, ...]], ...]
    number: int


# ---------------------------------------------------------------------------------------------- answers
@dataclass(frozen=True, slots=True)
class Mode:
    """A function with its roles filled as far as there is no choice.

    Attributes
    ----------
    id
        Its number.
    register
        Where its value goes, for clauses.
    function
        None: some role has nobody to play it.
    roles, casting
        Roles that are cast in each scene, and how.
    players
        Names of the objects bound to the roles, the target first; None for roles that are bound in each scene.
    """

    id: int
    register: int
    function: Sum | None
    roles: tuple[Role, ...] = ()
    casting: Casting | None = None
    players: tuple[str | None, ...] = ()


@dataclass(frozen=True, slots=True)
class Stop:
    """``side * (column + step * value - bound) >= 0`` makes the value `value`, of mode `mode`."""

    mode: int
    value: float
    column: int
    step: float
    bound: float
    side: float


@dataclass(frozen=True, slots=True)
class Landing:
    """``|column - at| <= slack`` makes the value `value`, of mode `mode`."""

    mode: int
    value: float
    column: int
    at: float
    slack: float


@dataclass(frozen=True, slots=True)
class Reach:
    """How far guesses and approximations go from the column `present`: from `least` to `most` more."""

    present: int
    least: float
    most: float


# ---------------------------------------------------------------------------------------------- who is believed
@dataclass(frozen=True, slots=True)
class Leverage:
    """What a regression's leverage is worked out from (`relgym.numeric.online_ridge.OnlineRidge.leverage`).

    Attributes
    ----------
    mean, spread
        Where its columns lie, and the inverse of the sums of squares about that: the upper triangle, row by row, as
        little-endian float32 in base64.
    """

    mean: tuple[float, ...]
    spread: str


@dataclass(frozen=True, slots=True)
class Fit:
    """What least squares of all targets of one object look at.

    Attributes
    ----------
    columns
        Column, centre and scale of each number: ``z = (column - centre) / scale``.
    leverage
        Of each regression: on z; and on z and all products of two of them, row by row, if there is such a one.
    """

    columns: tuple[tuple[int, float, float], ...]
    leverage: tuple[Leverage, ...]


LEAST_RATE, WIDER, SAYS = 4.0**-3, 4.0, 8
RATES = (0.0, *(LEAST_RATE * WIDER**k for k in range(SAYS - 1)))
"""By how much of itself what a regression leaves may grow with the squared distance: from nothing to so much that among
few rows alone its word counts, in steps of which a finer choice leaves 3 % less at best."""


@dataclass(frozen=True, slots=True)
class Trusted:
    """How far the word of a regression counts at leverage h: the sum of ``say / (1 + rate growth h)`` over `RATES`.

    Attributes
    ----------
    growth
        Squared distance at a leverage of 1.
    least
        Leverage in the midst of all that is known: one part in the number of rows.
    say
        How far each of the rates has a say; together no more than 1.
    """

    growth: float
    least: float
    say: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Regression:
    """Least squares of one target: ``present + weights @ (1, z)``, changes kept within bounds.

    Attributes
    ----------
    fit
        Number of what is looked at, in `Program.fits`.
    present
        Column of the present value.
    weights
        Of each regression, that of 1 first.
    least, most
        Bounds of the change.
    trusted
        How far the word of each counts in what all together say.
    """

    fit: int
    present: int
    weights: tuple[tuple[float, ...], ...]
    least: float
    most: float
    trusted: tuple[Trusted, ...]


@dataclass(frozen=True, slots=True)
class Belief:
    """What is made of predictions of one kind.

    Attributes
    ----------
    outcome, winner, lead
        The kind: its outcome, who gave the value (a mode, laws below 0; 0: nobody) and the bin of its lead. A lead of
        -1 stands for all others of the winner, -2 for those of all other modes (winner 1), laws (-1) or nobody (0).
    able
        Who of `EXPERTS` has a value, as bits, persistence left aside, which always has.
    speaker
        Place in `EXPERTS` of who gives the value.
    probability, interval
        That it is right, and the half width of its 95 % interval; NaN where too little is known.
    claimed
        Whether that is a prediction.
    spread
        Root mean square of what the speaker left lately; NaN where nothing is known. No kernel reads it.
    """

    outcome: int
    winner: int
    lead: int
    able: int
    speaker: int
    probability: float
    interval: float
    claimed: bool
    spread: float = math.nan


@dataclass(frozen=True, slots=True)
class Trust:
    """How right an answer's predictions were, and whose value counts therefore.

    What is claimed of a mode is a prediction, though the answer as a whole is undecided.

    Attributes
    ----------
    beliefs
        One for each kind.
    lawful
        Whether winners are laws.
    distant
        Whether kinds of what modes say far from what was learned have the bin of that instead of a lead.
    rests
        Keys of answers that modes rely on, ascending: their record is of steps in which these were right.
    """

    beliefs: tuple[Belief, ...]
    lawful: bool
    distant: bool = False
    rests: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Answer:
    """The next value of one property of one object.

    Attributes
    ----------
    object, property
        For people.
    column
        Of the present value.
    key, needs
        Number of (type, property), and of those whose next values must be known.
    body, component
        Who it is of, -1: something without a body; which component of motion it is, -1: modes answer.
    features, follows
        Registers to fill first, and once the modes' values are known.
    state
        ``"modes"``, ``"lost"`` (modes aren't asked), ``"none"`` (there is none).
    said
        Whether what modes say is a prediction (else it is unexplained).
    abstains
        Whether situations that were never seen, and doubtful players, give no prediction.
    modes, vote
        The modes, and who of them holds.
    scope
        Tree with outcome 1 where modes are used; None: everywhere.
    clipped
        Whether modes keep within `reach`.
    guess, beyond
        Fallback values, and those out of scope.
    regression
        Least squares; None where nobody asks.
    low, high
        Limits: (mode, value).
    stops
        Walls, in the order in which they are applied.
    trust
        How right its predictions were; None: that isn't told.
    """

    object: str
    property: str
    column: int
    key: int
    needs: tuple[int, ...]
    body: int
    component: int = -1
    features: tuple[Feature, ...] = ()
    follows: tuple[Follow, ...] = ()
    state: str = "modes"
    said: bool = True
    abstains: bool = True
    modes: tuple[Mode, ...] = ()
    vote: Vote | None = None
    scope: tuple[Tree, tuple[int, ...]] | None = None
    clipped: bool = False
    reach: Reach | None = None
    guess: Sum | None = None
    beyond: Sum | None = None
    regression: Regression | None = None
    low: tuple[int, float] = (0, float("-inf"))
    high: tuple[int, float] = (0, float("inf"))
    stops: tuple[Stop | Landing, ...] = ()
    trust: Trust | None = None


@dataclass(frozen=True, slots=True)
class Program:
    """A whole step.

    Attributes
    ----------
    width, registers
        Of a state vector, and of all registers.
    columns
        Name of each column of the state vector.
    bodies, groups
        The bodies, and number of each one's type in alphabetical order (for lining up objects that are alike).
    dimensions, up, turn
        2 in the plane, else 3; which of the axes in use points up; sense in which angles turn, 1 or -1.
    touch, part, precision
        Distance up to which bodies touch, speed up to which they don't part, relative precision of the numbers.
    relations, wanted
        Names of all relations, in the order of their numbers, and the numbers of those that anybody asks for.
    facts
        Names of the contact facts of a pair; behind them come the numbers that other bodies have.
    others
        Columns of these, for each body; those of NaN where it has none.
    offsets, parting
        As of `relgym.scene.surroundings`.
    everything
        Whether some clause or role looks at all objects.
    motion
        Laws of motion, if any govern anything.
    fits
        What regressions look at.
    answers
        One for each target of each object, in causal order.
    kinematics
        (place, step, rate) in order: ``next[place] = now[place] + step * rate``.
    angles
        Columns of angles.
    """

    width: int
    registers: int
    columns: tuple[str, ...]
    bodies: tuple[Body, ...]
    groups: tuple[int, ...]
    dimensions: int
    up: int
    turn: float
    touch: float
    part: float
    precision: float
    relations: tuple[str, ...]
    wanted: frozenset[int]
    facts: tuple[str, ...]
    others: tuple[tuple[int, ...], ...]
    offsets: bool
    parting: bool
    everything: bool
    motion: Motion | None
    fits: tuple[Fit, ...]
    answers: tuple[Answer, ...]
    kinematics: tuple[tuple[int, float, int], ...]
    angles: tuple[int, ...]

    @property
    def casts(self) -> bool:
        """Whether some mode has roles that are cast in each scene."""
        return any(mode.roles for a in self.answers for mode in a.modes)
