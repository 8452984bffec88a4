"""Compiled programs beside arrays: do both say the same of some scenes?"""

from __future__ import annotations

import copy
from collections.abc import Iterable

import numpy as np
from dreams import cart_model, flat_model, hilly_model, line_model, lost_model, room_model, rough_model
from hypothesis import strategies as st
from law_streams import Stream, taught
from numpy.typing import NDArray

from relgym.classification.binary import BinaryClassifier, tree_columns
from relgym.classification.examples import Vocabulary
from relgym.classification.views import CONTEXTS
from relgym.classification.views import Scope as Offered
from relgym.clustering.mode import NOISE
from relgym.config import ModelConfig
from relgym.envs.dreams.setting import recorded
from relgym.experiments.laws.trials import Trial, trial_rooms
from relgym.laws.book import LawBook
from relgym.laws.columns import Sources
from relgym.laws.frames import FRAMES, POINT, axis_names
from relgym.laws.learner import LawLearner
from relgym.laws.records import ONE, AxisLaw, FreeLaw, PairLaw, Piece, Share
from relgym.logic.clause import Clause, Coverage, Definition, Literal
from relgym.model.parts import Parts
from relgym.model.predicting.calibration import EXPERTS, OWN, Audit, Key
from relgym.model.predicting.prediction import BatchPrediction
from relgym.model.predicting.querying import predict_many
from relgym.model.running.compiled import KERNEL
from relgym.model.running.lowering import lowered
from relgym.model.running.runner import Runner
from relgym.model.target.hindsight import Hindsight
from relgym.model.target.limits import Limits
from relgym.model.target.property_model import PropertyModel
from relgym.model.target.scope import Scope
from relgym.model.target.stops import Landing, Stop, Stops
from relgym.model.world_model import WorldModel
from relgym.numeric.tree import DecisionTree
from relgym.scene.objects import POSE, Kinematics, ObjectType, SceneLayout, Target
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, Prism, Sphere, Wedge

Array = NDArray[np.float64]


def runner(parts: Parts, layout: SceneLayout) -> Runner:
    """What runs the program of a model."""
    machine = KERNEL.load()
    assert machine is not None
    return Runner(parts, layout, lowered(parts, layout), machine)


def arrays(parts: Parts, layout: SceneLayout, vectors: Array) -> BatchPrediction:
    """What arrays say."""
    with np.errstate(all="ignore"):
        return predict_many(parts, parts.perception.percept(layout, vectors), layout, vectors)


def assert_alike(parts: Parts, layout: SceneLayout, vectors: Array, tolerance: float = 1e-12) -> None:
    """The program of a model says of some scenes what arrays say."""
    vectors = np.ascontiguousarray(vectors)
    said, known = runner(parts, layout).many(vectors), arrays(parts, layout, vectors)
    assert said is not None, "the kernel left it to arrays"
    assert said.parts == known.parts and said.frames == known.frames
    np.testing.assert_array_equal(said.outcomes, known.outcomes)
    np.testing.assert_array_equal(said.modes, known.modes)
    np.testing.assert_array_equal(said.margins, known.margins)
    np.testing.assert_array_equal(said.probabilities, known.probabilities)
    np.testing.assert_array_equal(said.intervals, known.intervals)
    scale = np.maximum(1.0, np.abs(known.vectors))
    assert (np.abs(said.vectors - known.vectors) <= tolerance * scale).all()


def lawful(trial: Trial, *, seed: int = 1, count: int = 3) -> tuple[Parts, SceneLayout, Array]:
    """Parts of a model that knows the laws of a trial world, and scenes of others of its rooms."""

    def streams(seed: int, rooms: int) -> Iterable[Stream]:
        found = trial_rooms(trial.world, rooms, seed=seed, steps=150)
        return [Stream(r.schema, r.layout, r.vectors) for r in found]

    learner = taught(streams(seed, count))
    shown = list(streams(seed + 1, 2))
    parts = with_laws(shown[0].schema, learner)
    return parts, shown[0].layout, np.concatenate([s.vectors for s in shown])


def with_laws(schema: SceneSchema, learner: LawLearner) -> Parts:
    """Parts of a model whose laws govern everything that moves."""
    parts = Parts(schema, ModelConfig(), schema.targets)
    assert parts.laws is not None
    parts.laws.learner = learner
    parts.laws.governed = frozenset(learner.types)
    return parts


MODELS = {
    "cart": cart_model,
    "cart with a lost velocity": lost_model,
    "cart with a rough velocity": rough_model,
    "cart on a hill": hilly_model,
    "flat numbers": flat_model,
    "room by laws": lambda: room_model("auto"),
    "room by modes": room_model,
    "line with roles": line_model,
}


def looked_back(model: WorldModel, seed: int = 0) -> WorldModel:
    """A model some of whose predictions, it is told, came out anyhow: others than modes and laws speak, too."""
    model, rng = copy.deepcopy(model), np.random.default_rng(seed)
    for target, part in model._parts.models.items():
        governed = model._parts.governs(target)
        winners = [0, -1, -2] if governed else [0, *part.classifier.modes]
        if not governed and rng.random() < 0.5:
            part.hindsight = Hindsight([(1, 1)] * 100)
        if part.clusterer.clusters:
            part.latest = min(part.clusterer.clusters)
        bins = 14 if part.tells_how_far else 8
        bias = rng.choice([1e-13, 1.0], size=(bins, len(EXPERTS)))
        bias[rng.random(bins) < 0.5, OWN] = 1e-13
        for _ in range(400):
            winner = int(rng.choice(winners))
            outcome = 0 if winner else int(rng.integers(6))
            lead = int(rng.integers(bins if winner else 8))
            errors = bias[lead] * rng.normal(size=len(EXPERTS))
            errors[1:-1][rng.random(len(EXPERTS) - 2) < 0.3] = np.nan
            audit = Audit(Key(outcome, winner, lead), (*errors[:-1].tolist(), 1.0), 0)
            part.calibration.look_back(audit, 0.0, claimed=True, rounding=1e-9, error=0.05)
    model._programs.changed()
    return model


def scenes_of(model: WorldModel, count: int, seed: int = 0) -> tuple[SceneLayout, Array]:
    """Scenes near those that a model has seen, some of them far off."""
    table = next(iter(model._parts.tables.values()))
    assert len(table)
    starts = recorded(model).starts
    names = [name for name in model.schema.order if name not in starts[0].layout.names]
    layout = model.schema.layout([*starts[0].layout.names, *names])
    rng = np.random.default_rng(seed)
    rows = []
    for k in range(count):
        start = starts[k % len(starts)]
        parts = {o.name: o.values.copy() for o in start}
        for name in names:
            parts[name] = rng.uniform(0.0, 5.0, len(model.schema.type_of(name).properties))
        rows.append(np.concatenate([parts[name] for name in layout.names]))
    vectors = np.array(rows)
    moved = np.ones(layout.width, dtype=bool)
    for index in layout.bodies:
        sizes = [layout.offsets[index] + k for k in layout.types[index].pose_columns()[3:] if k >= 0]
        moved[sizes] = False
    noise = rng.normal(size=vectors.shape) * moved * rng.choice([0.0, 1e-3, 0.3], size=(count, 1))
    return layout, vectors + noise


# ---------------------------------------------------------------------- worlds that hypothesis makes up
_MOVING = ("vx", "vy", "spin", "mass")
_SHAPES = (Box(), Wedge(), Prism(((-0.5, -0.3), (0.4, -0.5), (0.5, 0.2), (-0.1, 0.5))))
_NUMBERS = st.floats(-2.0, 2.0).map(lambda x: round(x, 3))


def room_schema(shapes: int, balls: int) -> SceneSchema:
    """Balls and some bodies of other shapes, in the plane."""
    types = [
        ObjectType("ball", (*POSE, *_MOVING), Sphere(), velocity=("vx", "vy", None)),
        *(ObjectType(f"body{k}", POSE, _SHAPES[k]) for k in range(shapes)),
    ]
    objects = [(f"ball{k}", "ball") for k in range(balls)] + [(f"b{k}", f"body{k}") for k in range(shapes)]
    rates = (("px", "vx"), ("py", "vy"), ("rz", "spin"))
    laws = tuple(Kinematics("ball", place, rate) for place, rate in rates)
    targets = tuple(Target("ball", name) for name in _MOVING[:3])
    return SceneSchema(tuple(types), tuple(objects), kinematics=laws, targets=targets)


@st.composite
def books(draw: st.DrawFn, schema: SceneSchema) -> LawBook:
    """Laws of any form."""
    frame = draw(st.sampled_from(FRAMES))
    letters = axis_names(frame, 2)
    kinds = tuple(("ball", t.name) for t in schema.types)
    names = [f"{what}_{letter}" for letter in letters for what in "uv"]

    def piece(able: list[str]) -> Piece:
        terms = draw(st.lists(st.tuples(st.sampled_from(able), _NUMBERS), max_size=3))
        return Piece(tuple(terms))

    def rule(axis: int, some: tuple[tuple[str, str], ...]) -> AxisLaw:
        able = [*names, ONE, *(f"J_{letter}" for letter in letters[:axis])]
        pieces = tuple(piece(able) for _ in range(draw(st.integers(1, 3))))
        others = ((draw(st.sampled_from(("max", "min"))), (piece(able),)),) if draw(st.booleans()) else ()
        signs = draw(st.booleans()), draw(st.booleans())
        operator = draw(st.sampled_from(("max", "min")))
        return AxisLaw(pieces, operator, some, others, signs, 100, draw(st.sampled_from((0, 0, 50))))

    cut = draw(st.integers(1, len(kinds)))
    groups = [some for some in (kinds[:cut], kinds[cut:]) if some]
    axes = tuple(tuple(rule(axis, some) for some in groups) for axis in range(2))
    grips = tuple((kind, draw(st.floats(0.1, 1.0))) for kind in kinds) if frame == POINT else ()
    sources = {"ball": Sources.of(schema, schema.types[0], schema.targets or ())}
    book = LawBook(schema, sources)
    book.pair = PairLaw(frame, axes, 10.0, grips) if draw(st.integers(0, 9)) else None
    columns = [*_MOVING, ONE]
    book.free["ball"] = FreeLaw("ball", tuple(piece(columns) for _ in _MOVING[:3]))
    shares = (Share(), Share("mass", 2), Share("extent"), Share(constant=0.25), None)
    if (share := draw(st.sampled_from(shares))) is not None:
        book.shares["ball", "ball"] = share
    book.tolerance = draw(st.sampled_from((1e-12, 1e-3, 0.1)))
    return book


def crowded(schema: SceneSchema, count: int, seed: int) -> Array:
    """State vectors of rooms in which bodies lie about anyhow, many of them touching."""
    rng, layout = np.random.default_rng(seed), schema.layout()
    vectors = rng.normal(size=(count, layout.width))
    for k, t in enumerate(layout.types):
        at = layout.offsets[k]
        vectors[:, at : at + 2] *= 0.4
        vectors[:, at + 5] *= rng.random(count) < 0.5
        sizes = rng.uniform(0.2, 1.5, (count, 3))
        vectors[:, at + 6 : at + 9] = sizes[:, :1] if isinstance(t.shape, Sphere) else sizes
        if t.name == "ball":
            vectors[:, at + 12] = rng.uniform(0.5, 2.0, count)
    return vectors


# ---------------------------------------------------------------------- choices that nobody learned
@st.composite
def scrambled(draw: st.DrawFn, model: WorldModel) -> WorldModel:
    """The model with other conditions, limits, walls, scopes, guesses and descriptions of players, drawn anyhow."""
    model = copy.deepcopy(model)
    for target, part in model._parts.models.items():
        if model._parts.governs(target):
            continue
        for state in part.classifier._pairs.values():
            state.classifier = draw(_classifiers(state.classifier))
        part.classifier._reset_caches()
        part.hindsight = Hindsight([(1, 1)] * draw(st.sampled_from((0, 0, 100))))
        _scramble_walls(draw, target, part)
        slots = model._parts.tables[target.type].signatures[0]
        numbers = [slots.named(k) for k in range(slots.core) if not slots.named(k).endswith("'")]
        if draw(st.booleans()):
            least = draw(_NUMBERS) - 2.0
            tree = draw(_trees(tuple(numbers))) if draw(st.booleans()) else None
            part.fallback.scope = Scope(tree, least, least + 4.0)
        for cast in part.casting.classifiers.values():
            cast.errors = draw(st.sampled_from((0.0, 1.0)))
            for description in cast.descriptions:
                description.definition = draw(_described(cast.vocabulary))
                if draw(st.booleans()):
                    bits = 2 * len(cast.vocabulary.relations) + len(cast.vocabulary.unary)
                    common = draw(st.lists(st.integers(0, bits - 1), max_size=2))
                    description.common = np.isin(np.arange(bits), common)
            cast._answers.clear()
            cast._extensions.clear()
    model._programs.changed()
    return model


def _scramble_walls(draw: st.DrawFn, target: Target, part: PropertyModel) -> None:
    low = draw(st.sampled_from((NOISE, 70)))
    part.limits = Limits(low, NOISE, draw(_NUMBERS) - 1.0 if low else -np.inf, np.inf)
    rate, wall = target.property, "p" + target.property[1:] if target.property.startswith("v") else "x"
    stop = Stop(
        71, draw(_NUMBERS), wall, draw(_NUMBERS), draw(_NUMBERS), draw(st.sampled_from((-1.0, 1.0))), 0.1
    )
    landing = Landing(72, draw(_NUMBERS), target.given[0][1] if target.given else rate, draw(_NUMBERS), 0.5)
    stops = (stop,) if draw(st.booleans()) else ()
    part.stops = Stops(stops, (landing,) if draw(st.booleans()) else ())


@st.composite
def _trees(draw: st.DrawFn, columns: tuple[str, ...]) -> DecisionTree:
    """Trees of three tests at most."""
    some, cut = st.integers(0, len(columns) - 1), _NUMBERS.map(lambda x: x / 4.0)
    shapes = [
        ([1, 0, 0], [1, 1, 2], [2, 1, 2]),
        ([1, 1, 0, 0, 0], [1, 2, 2, 3, 4], [4, 3, 2, 3, 4]),
        ([1, 0, 1, 1, 0, 0, 0], [1, 1, 3, 4, 4, 5, 6], [2, 1, 6, 5, 4, 5, 6]),
    ]
    inner, below, above = draw(st.sampled_from(shapes))
    column = tuple(draw(some) if k else -1 for k in inner)
    threshold = tuple(draw(cut) if k else 0.0 for k in inner)
    positive = tuple(draw(st.sampled_from((0.0, 2.0))) for _ in inner)
    return DecisionTree(columns, column, threshold, tuple(below), tuple(above), positive, (1.0,) * len(inner))


@st.composite
def _clauses(draw: st.DrawFn, scope: Offered, arity: int) -> Clause:
    """Clauses over all that a scope names."""
    free = st.integers(0, arity + 1)
    literals = []
    for _ in range(draw(st.integers(0, 3))):
        negated, op = draw(st.booleans()), draw(st.sampled_from(("<=", ">")))
        kind = draw(
            st.sampled_from([k for k in ("relations", "unary", "pair", "scalars") if getattr(scope, k)])
        )
        if kind == "relations":
            pair = draw(st.lists(free, min_size=2, max_size=2, unique=True))
            name = draw(st.sampled_from([name for name, _ in scope.relations]))
            literals.append(Literal(name, tuple(pair), negated))
        elif kind == "unary":
            literals.append(
                Literal(draw(st.sampled_from([n for n, _ in scope.unary])), (draw(free),), negated)
            )
        elif kind == "pair" and arity == 1:
            name, other = draw(st.sampled_from([n for n, _ in scope.pair])), draw(st.integers(1, 2))
            literals.append(Literal(name, (0, other), negated, op, draw(_NUMBERS) / 4.0))
        elif arity == 1:
            name = draw(st.sampled_from(scope.scalars))
            literals.append(Literal(name, (), negated, op, draw(_NUMBERS) / 16.0))
    return Clause.of(literals, arity)


@st.composite
def _classifiers(draw: st.DrawFn, known: BinaryClassifier) -> BinaryClassifier:
    """Other classifiers of the same two modes."""
    scope = known.scope
    clauses = tuple(draw(st.lists(_clauses(scope, 1), max_size=2)))
    definition = Definition(clauses, negated=draw(st.booleans()))
    trees = [
        draw(_trees(tree_columns(scope, clause.variables))) if draw(st.booleans()) else None
        for clause in clauses
    ]
    last = draw(_trees(scope.scalars)) if draw(st.booleans()) else None
    context = draw(st.sampled_from(CONTEXTS))
    made = BinaryClassifier(known.i, known.j, scope, context, definition, tuple(trees), last)
    made.counts = [[float(draw(st.integers(0, 5))), float(draw(st.integers(0, 5)))] for _ in made.outcomes]
    return made


@st.composite
def _described(draw: st.DrawFn, vocabulary: Vocabulary) -> Definition | None:
    """Descriptions of what is bound to a role: clauses over target and candidate, with what they covered."""
    relations = tuple((n, k) for k, n in enumerate(vocabulary.relations))
    unary = tuple((n, k) for k, n in enumerate(vocabulary.unary))
    scope = Offered(relations, unary, (), ())
    clauses = tuple(draw(st.lists(_clauses(scope, 2), max_size=2)))
    counts = st.builds(Coverage, st.sampled_from((0.0, 3.0)), st.sampled_from((0.0, 1.0)))
    coverage = tuple(draw(counts) for _ in clauses)
    return draw(st.just(Definition(clauses, 2, False, coverage, draw(counts))) | st.none())
