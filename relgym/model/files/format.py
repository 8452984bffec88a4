"""The declared format of a model file's body, version 3: every field, its type and its range.

`docs/reference/model-file.md` says what the parts mean, and the JSON Schema beside it is made from these records. What
the records can't say, such as that a clause names relations that there are, is said in `relgym.model.files.checks`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

from msgspec import Meta, Struct, field

from relgym.config import ModelConfig
from relgym.files.records import (
    Amount,
    Count,
    Finite,
    Hex,
    Name,
    Noise,
    Number,
    Pair,
    Random,
    Record,
    Spread,
    Weight,
)
from relgym.program.records import RATES

__all__ = [
    "Body",
    "CastingRecord",
    "ClassifierRecord",
    "ClustererRecord",
    "ColumnsRecord",
    "DefinitionRecord",
    "ExemplarsRecord",
    "LandingRecord",
    "LawsRecord",
    "LiteralRecord",
    "ModeRecord",
    "PairRecord",
    "SchemaRecord",
    "ShapeRecord",
    "StopRecord",
    "TargetModel",
    "TargetRecord",
    "TreeRecord",
]

ModeId: TypeAlias = Annotated[int, Meta(ge=1, le=2**31 - 1, description="id of a mode")]
ModeOrNoise: TypeAlias = Annotated[int, Meta(ge=0, le=2**31 - 1, description="id of a mode; 0: noise")]
Known: TypeAlias = Annotated[int, Meta(ge=-1, le=2**31 - 1, description="id of a mode; -1: none")]
Variable: TypeAlias = Annotated[int, Meta(ge=-1, le=63, description="number of a variable; -1: any object")]
Node: TypeAlias = Annotated[int, Meta(ge=0, le=10_000, description="number of a node")]
Context: TypeAlias = Literal["approached", "touching", "all"]
Whole: TypeAlias = Annotated[int, Meta(ge=-(2**53), le=2**53, description="a whole number")]
Terms: TypeAlias = list[tuple[Name, Finite]]
Counts: TypeAlias = tuple[Weight, Weight]
Say: TypeAlias = Annotated[
    list[Annotated[float, Meta(ge=0.0, le=1.0)]],
    Meta(min_length=len(RATES), max_length=len(RATES), description="how far each rate has a say"),
]

# ---------------------------------------------------------------------- the scenes' schema
Point2: TypeAlias = tuple[Finite, Finite]
Point3: TypeAlias = tuple[Finite, Finite, Finite]


class SphereRecord(Record, tag_field="kind", tag="sphere"):
    """A ball of diameter 1."""


class BoxRecord(Record, tag_field="kind", tag="box"):
    """The unit cube."""


class WedgeRecord(Record, tag_field="kind", tag="wedge"):
    """A right-angled prism in the unit cube."""


class PrismRecord(Record, tag_field="kind", tag="prism"):
    """A convex polygon, extruded along the depth axis."""

    vertices: Annotated[list[Point2], Meta(min_length=3, max_length=1_000)]


class PolyhedronRecord(Record, tag_field="kind", tag="polyhedron"):
    """The convex hull of its corners."""

    vertices: Annotated[list[Point3], Meta(min_length=4, max_length=1_000)]


class CompoundRecord(Record, tag_field="kind", tag="compound"):
    """Convex polygons that hang together, extruded along the depth axis."""

    parts: Annotated[
        list[Annotated[list[Point2], Meta(min_length=3, max_length=1_000)]],
        Meta(min_length=1, max_length=100),
    ]


ShapeRecord: TypeAlias = (
    SphereRecord | BoxRecord | WedgeRecord | PrismRecord | PolyhedronRecord | CompoundRecord
)


class TypeRecord(Record):
    """A type of objects (`relgym.scene.types.ObjectType`)."""

    name: Name
    properties: list[Name]
    shape: ShapeRecord | None
    parent: Name | None
    pose: dict[Name, Name]
    velocity: list[Name | None]
    exogenous: list[Name]
    optional: bool
    angles: list[Name] = []
    flags: list[Name] = []


class TargetRecord(Struct, array_like=True, forbid_unknown_fields=True):
    """A target: type, property, and the (type, property) pairs whose next values it is given."""

    type: Name
    property: Name
    given: list[Pair]


class KinematicsRecord(Struct, array_like=True, forbid_unknown_fields=True):
    """A declared law ``property' = property + step * rate'``, or ``* rate``."""

    type: Name
    property: Name
    rate: Name
    step: Finite
    uses_next: bool


class SchemaRecord(Record):
    """The scenes' schema (`relgym.scene.schema.SceneSchema`)."""

    types: list[TypeRecord]
    objects: list[Pair]
    up: Literal["x", "y", "z"]
    planar: bool
    kinematics: list[KinematicsRecord]
    targets: list[TargetRecord] | None
    action_scale: list[tuple[Name, Finite, Finite]]
    offsets: bool = False
    precision: Annotated[float, Meta(ge=0.0, lt=1.0)] = 0.0


# ---------------------------------------------------------------------- modes
class RoleRecord(Record):
    """An object type, and the weights on its properties."""

    type: Name
    terms: Terms


class ModeRecord(Record):
    """A linear function; ``roles[0]`` is the target object."""

    id: ModeOrNoise
    frame: Literal["world"]
    roles: Annotated[list[RoleRecord], Meta(min_length=1, max_length=64)]
    intercept: Finite
    examples: Count
    sigma: Amount


class ClustererRecord(Record):
    """The modes of a target, and what finding more of them needs."""

    sigma: Noise
    next_id: ModeId
    largest: Number
    reach: Number
    spread: Number
    rounding: Noise
    approximate: bool
    noise: Count
    modes: list[ModeRecord]
    fitted: list[tuple[ModeId, Count, Count]]
    searches: list[tuple[Count, Count, Annotated[int, Meta(ge=0, le=10**6)]]]
    random: Random
    due: bool = False
    chancy: bool = False
    estimating: bool = False
    passed: list[tuple[Count, Count]] = []


# ---------------------------------------------------------------------- clauses and trees
class LiteralRecord(Record):
    """A relation or its negation, or a number compared with a threshold."""

    relation: Name
    args: Annotated[list[Variable], Meta(max_length=2)]
    negated: bool = False
    op: Literal["<=", ">"] | None = None
    threshold: Finite = 0.0


class DefinitionRecord(Record):
    """A disjunction of clauses, and the training examples that each of them decides."""

    arity: Annotated[int, Meta(ge=1, le=2)]
    negated: bool
    clauses: Annotated[list[Annotated[list[LiteralRecord], Meta(max_length=256)]], Meta(max_length=256)]
    coverage: list[Counts]
    uncovered: Counts
    bits: Spread


class TreeRecord(Record):
    """A decision tree in preorder; column -1 is a leaf."""

    columns: list[str]
    column: Annotated[list[Annotated[int, Meta(ge=-1, le=10**6)]], Meta(min_length=1, max_length=10_000)]
    threshold: list[Finite]
    below: list[Node]
    above: list[Node]
    positive: list[Weight]
    negative: list[Weight]


class BinaryRecord(Record):
    """Tells mode i from mode j: a tree (or none) for each clause and one for what no clause covers."""

    i: ModeId
    j: ModeId
    context: Context
    definition: DefinitionRecord
    trees: Annotated[list[TreeRecord | None], Meta(min_length=1)]
    counts: Annotated[list[Counts], Meta(min_length=1)]


class PairRecord(Record):
    """The classifier of two modes, and what happened since it was learned."""

    seen: Counts
    errors: Weight
    contradictions: Weight
    mended: bool
    stale: bool
    learned: Counts
    classifier: BinaryRecord
    draft: list[tuple[Context, DefinitionRecord]] | None


# ---------------------------------------------------------------------- classifiers
class VocabularyRecord(Record):
    """Names of what the classifiers are shown; the schema determines all but `follows`."""

    relations: list[Name]
    unary: list[Name]
    pair: list[Name]
    own: list[Name]
    contact: list[Name]
    follows: Terms
    present: str


class SizesRecord(Record):
    """Lengths of the named axes: relations, unary relations, features, objects, modes, roles."""

    A: Count
    F: Count
    K: Annotated[int, Meta(ge=1, le=100_000)]
    K2: Annotated[int, Meta(ge=1, le=100_000)]
    M: Count
    P: Annotated[int, Meta(ge=0, le=64)]
    R: Count
    U: Count


class ColumnsRecord(Record):
    """Arrays in base64, little-endian, rows first; truth values are packed eight to a byte."""

    size: Annotated[int, Meta(ge=0, le=10**7)]
    sizes: SizesRecord
    arrays: dict[Name, str]


class ExemplarsRecord(Record):
    """The examples that classifiers remember; cells are (mode, relational state, how many were seen, slots)."""

    modes: list[ModeId]
    columns: ColumnsRecord
    cells: list[tuple[Known, Hex, Weight, list[Count]]]


class ClassifierRecord(Record):
    """When each mode of a target holds."""

    vocabulary: VocabularyRecord
    modes: list[ModeId]
    counts: list[tuple[ModeId, Weight]]
    pairs: list[PairRecord]
    seen: list[Annotated[int, Meta(ge=0)]]
    covered: list[tuple[ModeId, ModeId]]
    exemplars: ExemplarsRecord | None
    certain: list[tuple[Hex, list[tuple[ModeId, Weight]]]] = []


class CastingRecord(Record):
    """Which objects play a mode's roles: a definition for each kind of role, and what all players had in common."""

    seen: Weight
    learned: Weight
    errors: Weight
    contradictions: Weight
    stale: bool
    kinds: list[tuple[Name, Terms]]
    definitions: list[DefinitionRecord | None]
    common: list[list[Count] | None]


# ---------------------------------------------------------------------- what else is known of a target
class SplitRecord(Struct, array_like=True, forbid_unknown_fields=True):
    """How far examples scatter where a number is at most a threshold, and where it is greater."""

    name: Name
    threshold: Finite
    below: Spread
    above: Spread


class SpreadRecord(Struct, array_like=True, forbid_unknown_fields=True):
    """How far a mode's examples scatter: over all, by action, or by a number's threshold."""

    mode: ModeOrNoise
    whole: Spread
    by_action: list[tuple[list[Finite], Spread]]
    pooled: bool = False
    split: SplitRecord | None = None


class ScopeRecord(Record):
    """Where modes speak (a tree that says yes), and the smallest and largest change."""

    tree: TreeRecord | None = None
    reach: tuple[Finite, Finite] | None = None


class GuessRecord(Record):
    """Functions of last resort, each with the share of the change that it leaves."""

    best: tuple[ModeRecord, Amount] | None = None
    beyond: tuple[ModeRecord, Amount] | None = None
    errors: tuple[tuple[Spread, Spread], tuple[Spread, Spread]] = ((0.0, 0.0), (0.0, 0.0))
    due: Count = 64


class CandidatesRecord(Record):
    """Laws of registered hypothesis classes, in the order of `config.hypotheses`.

    Of each that has one the names of the columns that it reads, and what the class wrote; when they are asked again,
    and how many proposals there were.
    """

    laws: list[tuple[list[str], dict[str, Any]] | None]
    due: Count
    tried: Count


class LimitsRecord(Record):
    """Constant modes beyond which the target never goes, with their values."""

    low: tuple[ModeId, Finite] | None = None
    high: tuple[ModeId, Finite] | None = None


class StopRecord(Record):
    """A constant mode that holds where the property that follows the target would reach a bound."""

    mode: ModeId
    value: Finite
    property: Name
    step: Finite
    bound: Finite
    side: Annotated[float, Meta(ge=-1.0, le=1.0)]
    slack: Amount


class LandingRecord(Record):
    """A constant mode that holds where the rate that the target is given has a certain value."""

    mode: ModeId
    value: Finite
    property: Name
    at: Finite
    slack: Amount


class StopsRecord(Record):
    """All stops and landings of a target."""

    stops: list[StopRecord] = []
    landings: list[LandingRecord] = []


class PropertyRecord(Record):
    """The model of one target."""

    clusterer: ClustererRecord
    unexplained: bool
    spreads: list[SpreadRecord]
    classifier: ClassifierRecord
    casting: list[tuple[ModeId, CastingRecord]]
    guess: GuessRecord = field(default_factory=GuessRecord)
    scope: ScopeRecord = field(default_factory=ScopeRecord)
    limits: LimitsRecord = field(default_factory=LimitsRecord)
    candidates: CandidatesRecord | None = None
    stops: StopsRecord = field(default_factory=StopsRecord)
    places: list[tuple[ModeId, list[list[Count]]]] = []
    """Of modes with roles that relations can't describe: numbers of the players among the others of their types, with
    which all examples agree."""
    past: list[ModeId] = []
    amended: list[ModeId] = []
    latest: ModeOrNoise = 0
    unsettled: bool = False


class TargetModel(Record):
    """A target and its model."""

    target: TargetRecord
    model: PropertyRecord


class HindsightRecord(Record):
    """How the latest predictions came out: (predictions, wrong ones) by step."""

    steps: Annotated[list[tuple[Count, Count]], Meta(max_length=200)]
    undecided: bool


Expert: TypeAlias = Annotated[
    int, Meta(ge=0, description="who gave a value, as a place among all experts: five, and hypotheses")
]
Squares: TypeAlias = Annotated[
    float, Meta(ge=0.0, le=1e304, description="a sum of squares of errors, each of 1e150 at most")
]
Off: TypeAlias = Annotated[
    float, Meta(ge=0.0, le=1e150, description="how far two values of a property lie apart")
]
Bin: TypeAlias = Annotated[int, Meta(ge=-(2**14), le=2**11, description="quarter octaves of a size")]
Bins: TypeAlias = list[tuple[Bin, Weight]]
Kind: TypeAlias = tuple[
    Annotated[int, Meta(ge=0, le=127, description="number of an outcome")],
    Annotated[int, Meta(ge=-(2**31), le=2**31 - 1, description="id of a mode; a law is below 0; 0: nobody")],
    Annotated[
        int,
        Meta(
            ge=-4,
            le=13,
            description="bin of the lead, from 8 on of how far an approximation is asked from what it was made of; "
            "below 0: all of a winner's, of all modes or laws, all, what regression leaves of all it was fitted to",
        ),
    ],
]


Runs: TypeAlias = Annotated[list[Weight], Meta(min_length=4, max_length=7)]


class CellRecord(Record):
    """How one kind of predictions came out: its key, who speaks, and of every expert what it left.

    A record is an expert, trials, hits, the run under way, bins of errors, and of runs that are over the trials in
    those of misses and of hits, and how many there were, maybe then the mean lengths of those of hits in the two
    records before this one that misses ended, and how often the mode was revised; squares are trials, the expert's own
    and those of saying that nothing changes. Steady are predictions in a row, up to now, that came out as such ones do,
    passed those of them that came true, and thinned those that were only roughly right, for which the next one that is
    learned from stands; doubt are bits by which intervals held less
    often than they are to; since are hits in a row after one was claimed though what it read was predicted wrongly.
    """

    key: Kind
    speaker: Expert
    heard: Weight
    steady: Count
    passed: Count
    records: list[tuple[Expert, Weight, Weight, Whole, Bins, Runs]]
    squares: Annotated[list[tuple[Weight, Squares, Squares]], Meta(min_length=5)]
    doubt: Weight = 0.0
    since: Count | None = None
    thinned: Count = 0


class CalibrationRecord(Record):
    """How right a target's predictions were, and what it changes by, in bins.

    Waiting to be counted are predictions that were left out: of what kind, who spoke, whether others had a say, and
    what each expert was off by.
    """

    trials: Count
    slips: tuple[Weight, Weight]
    vouched: Weight
    changes: Bins
    cells: list[CellRecord]
    proven: Count = 0
    fleeting: bool = False
    waiting: list[tuple[Kind, Expert, bool, list[Off | None]]] = []


class LeverageRecord(Record):
    """Where the columns of a regression lie, and how far (`OnlineRidge.spread`)."""

    mean: list[float]
    inverse: Annotated[str, Meta(description="upper triangle, row by row: float32, little-endian, base64")]


class RegressionRecord(Record):
    """Least squares on all numbers of a type: columns, targets, and for each kind rows, when due, and weights.

    No leverage is known, and weights are 0, of what hasn't been solved yet.
    """

    names: list[Name]
    seen: Count
    targets: list[Name]
    centre: list[float]
    scale: list[float]
    range: tuple[list[float], list[float]]
    waiting: Annotated[list[tuple[list[float], list[float]]], Meta(max_length=64)]
    ridges: Annotated[list[tuple[Count, Count, list[list[float]]]], Meta(max_length=2)]
    say: tuple[list[Say], list[Say]]
    leverage: Annotated[list[LeverageRecord | None], Meta(max_length=2)] = []


class TableRecord(Record):
    """Types in the slots of the rows, relational states, and how many rows ever came; the rows are arrays."""

    signatures: list[Annotated[list[Name], Meta(min_length=1)]]
    strata: list[Hex]
    seen: Count


# ---------------------------------------------------------------------- laws of motion
_KEY = "rivals"
"""What alternative laws are called in files: their format is older than the word."""

Pieces: TypeAlias = Annotated[list[Terms], Meta(min_length=1, max_length=16)]


class RegionRecord(Record):
    """Where other functions hold: bounds of positions (name, whether above, last number below, first one above)."""

    bounds: Annotated[list[tuple[Name, bool, Finite, Finite]], Meta(min_length=1, max_length=16)]
    components: Annotated[list[Terms], Meta(min_length=1, max_length=4)]


class FreeLawRecord(Record):
    """How objects of a type move that touch nothing: a function for each component, and where others hold."""

    type: Name
    components: Annotated[list[Terms], Meta(min_length=1, max_length=4)]
    examples: Count
    unexplained: Count
    bits: Spread
    regions: Annotated[list[RegionRecord], Meta(max_length=64)] = []


class AxisLawRecord(Record):
    """The velocity after a contact along one axis: the greatest or the least of some pieces."""

    pieces: Pieces
    operator: Literal["max", "min"]
    kinds: list[Pair]
    alternatives: list[tuple[Literal["max", "min"], Pieces]] = field(name=_KEY)
    signs: tuple[bool, bool]
    examples: Count
    unexplained: Count
    bits: Spread
    doubted: list[Pair] = []
    excused: Count = 0


class PairLawRecord(Record):
    """What a contact does to the relative velocity of two bodies, axis by axis of a frame."""

    frame: Literal["contact", "point", "turned", "centres", "own", "world"]
    axes: Annotated[
        list[Annotated[list[AxisLawRecord], Meta(min_length=1, max_length=256)]],
        Meta(min_length=1, max_length=3),
    ]
    bits: Spread
    grips: list[tuple[Name, Name, Finite]]
    surfaces: list[tuple[Name, Name, Finite]] = []


class MassRecord(Record):
    """Masses up to a common factor: a product of powers, times a constant of each type or object."""

    factors: Annotated[list[tuple[str, Literal[1, 2, 3]]], Meta(max_length=4)]
    by: Literal["", "type", "object"]
    constants: list[tuple[str, Finite]]
    examples: Count
    unexplained: Count


class GyrationRecord(Record):
    """Moment over mass of some types, or of all: a linear function; null where contacts don't turn them."""

    types: list[Name]
    whole: bool
    terms: Terms | None
    examples: Count
    unexplained: Count


class InertiaRecord(Record):
    """How hard bodies are to move and to turn."""

    mass: MassRecord | None = None
    gyrations: list[GyrationRecord] = []


class StoreRecord(Record):
    """How many examples ever came, and how those kept are chosen; the examples are arrays."""

    seen: Count
    random: Random


class ContactsRecord(Record):
    """Kinds of contacts (types of the two bodies), names of the objects if bodies turn, and their store."""

    kinds: list[Pair]
    store: StoreRecord
    objects: list[str] = []


class LearnedLawsRecord(Record):
    """The laws; the last four fields only with history."""

    tolerance: Noise
    free: list[FreeLawRecord]
    pair: PairLawRecord | None
    shares: list[tuple[Name, Name, str, Literal[1, 2, 3], Finite]]
    ledger: list[tuple[Name, Count, Count, Count, Count]]
    stored_wrong: Count
    news: Count
    seen: Count
    inertia: InertiaRecord = field(default_factory=InertiaRecord)
    random: Random | None = None
    store: ContactsRecord | None = None
    learners: list[tuple[Name, Count, Random, StoreRecord]] | None = None
    drift: list[tuple[Name, Count, Count, tuple[Finite, Finite, Finite], Amount, Amount]] | None = None


class LawsRecord(Record):
    """Laws of motion, and the types that they govern."""

    laws: LearnedLawsRecord
    governed: list[Name]
    seen: Count


# ---------------------------------------------------------------------- the whole
class ForceRecord(Record):
    """What moves objects without touching them (`relgym.model.reports.distant`)."""

    objects: Annotated[tuple[str, ...], Meta(min_length=1)]
    other: str
    sense: Literal[-1, 0, 1]
    trend: Literal[-1, 0, 1]


class AdviceRecord(Record):
    """What a target lacks (`relgym.model.reports.advice`)."""

    target: str
    unexplained: float
    left: float
    features: tuple[str, ...]
    law: str
    remains: float
    wrong: int = 0
    spoken: int = 0
    forces: tuple[ForceRecord, ...] = ()


class ReportRecord(Record):
    """What can't be told without the history: rules as text (`relgym.reporting.parse_rules`), and advice."""

    rules: str = ""
    advice: list[AdviceRecord] = []


class ScreenRecord(Record):
    """What sizes of numbers are known, by which gross errors are told (`relgym.model.percepts.screening`).

    Of each property its type and name, in how many scenes it was seen, its largest magnitudes in ascending order, the
    suspicious numbers that wait for others like them, and how many transitions in a row held one.
    """

    set_aside: Count
    properties: list[
        tuple[
            Name,
            Name,
            Count,
            Annotated[list[Amount], Meta(min_length=5, max_length=5)],
            Annotated[list[Finite], Meta(max_length=10_000)],
            Count,
        ]
    ]


class ArrivalRecord(Record):
    """The scene that the latest transition came to: its objects' names and types, and their numbers in this order."""

    objects: Annotated[list[Pair], Meta(min_length=1)]
    values: list[Finite]


class Body(Record):
    """All that a model file says, but for the arrays of its history."""

    schema: SchemaRecord
    config: ModelConfig
    open: bool
    given: list[Pair]
    targets: list[TargetModel]
    tables: list[TableRecord]
    laws: LawsRecord | None
    seen: Count
    extra: dict[str, Any]
    looks: list[tuple[Name, Name, bool]] = []
    saved_cells: Whole | None = None
    screen: ScreenRecord | None = None
    arrival: ArrivalRecord | None = None
    hindsight: dict[str, HindsightRecord] = {}
    calibration: dict[str, CalibrationRecord] = {}
    regressions: dict[str, RegressionRecord] = {}
    names: dict[str, Name] = {}
    report: ReportRecord = field(default_factory=ReportRecord)
