"""What a model file must be beyond types and ranges: everything that is named is there, and everything fits.

The records of `relgym.model.files.format` say what each field may hold. Here fields are held against one another:
modes, relations, roles and properties against those there are, arrays against what refers to their rows. What passes is
taken over without another look.
"""

from __future__ import annotations

import base64
import binascii
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import combinations
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from relgym.classification.binary import tree_columns
from relgym.classification.exemplars import COLUMNS
from relgym.classification.views import Scope
from relgym.clustering.columns import PRIME, SlotSignature
from relgym.clustering.mode import Mode
from relgym.clustering.roles import bind
from relgym.config import ClassificationConfig, ClusteringConfig, ModelConfig
from relgym.config.constants import SUMMABLE
from relgym.errors import ModelFileError
from relgym.files.reading import StoredArrays
from relgym.files.records import LARGEST
from relgym.laws.frames import axis_names
from relgym.laws.learner import LawLearner
from relgym.laws.records import ONE
from relgym.laws.shares import EXTENT
from relgym.model.files.format import (
    AxisLawRecord,
    Body,
    CastingRecord,
    ClassifierRecord,
    ClustererRecord,
    DefinitionRecord,
    ExemplarsRecord,
    InertiaRecord,
    LandingRecord,
    LawsRecord,
    LearnedLawsRecord,
    LiteralRecord,
    ModeRecord,
    PairRecord,
    PropertyRecord,
    RegressionRecord,
    ScreenRecord,
    StopRecord,
    TableRecord,
    TargetRecord,
    TreeRecord,
)
from relgym.model.parts import Parts
from relgym.model.predicting.calibration import EXPERTS, PERSISTENCE
from relgym.model.predicting.regression import KINDS
from relgym.model.target.conditions import Conditions
from relgym.program.records import RATES
from relgym.scene.axes import Axes
from relgym.scene.objects import Target

__all__ = ["check_body", "check_settings"]

_Arrays = Mapping[str, NDArray[Any]]

_CHOICES: Final = 4
"""More roles of one kind aren't filled at once: all ways to do so are gone through."""


def _require(ok: object, where: str, said: str) -> None:
    if not ok:
        raise ModelFileError(
            f"{where}: {said}; the file was damaged or made by another program, save the model again"
        )


def _distinct(values: Sequence[Any], where: str) -> None:
    _require(len(set(values)) == len(values), where, "something stands there twice")


def check_settings(config: Mapping[str, Any]) -> None:
    """Refuse settings that there aren't; types and ranges of the others are known to hold.

    Parameters
    ----------
    config
        The file's `ModelConfig`, as plain data.

    Raises
    ------
    ModelFileError
        It names a setting that relgym doesn't have.
    """
    kinds = {"": ModelConfig, "clustering.": ClusteringConfig, "classification.": ClassificationConfig}
    for part, kind in kinds.items():
        given = config.get(part[:-1], {}) if part else config
        for name in sorted(set(given) - {each.name for each in fields(kind)}):
            _require(False, f"config.{part}{name}"[:200], "relgym has no such setting")


def check_body(body: Body, parts: Parts, arrays: _Arrays | None) -> None:
    """Check what a file says against the schema, and its parts against one another.

    Parameters
    ----------
    body
        What the file says.
    parts
        A model of the file's schema, configuration and targets that has learned nothing.
    arrays
        The history; None if the file has none.

    Raises
    ------
    ModelFileError
        Something names what isn't there, or doesn't fit.
    """
    targets = [_target(part.target) for part in body.targets]
    _require(
        list(parts.targets) == targets and set(parts.models) == set(targets),
        "targets",
        "expected targets in causal order, each given only next values that there are",
    )
    for k, (part, target) in enumerate(zip(body.targets, targets, strict=True)):
        _TargetCheck(parts, target, f"targets[{k}].model", arrays is not None).check(part.model)
    if body.arrival is not None:
        types = {t.name: t for t in parts.schema.types}
        _distinct([name for name, _ in body.arrival.objects], "arrival")
        _require(all(kind in types for _, kind in body.arrival.objects), "arrival", "no such type")
        width = sum(len(types[kind].properties) for _, kind in body.arrival.objects)
        _require(len(body.arrival.values) == width, "arrival", f"expected {width} numbers")
    known = {str(target) for target in targets}
    for name, hindsight in body.hindsight.items():
        _require(name in known, "hindsight", f"{name!r} is no target")
        _require(all(wrong <= said for said, wrong in hindsight.steps), "hindsight", "more wrong than said")
    _check_calibration(body, known, len(EXPERTS) + len(body.config.hypotheses))
    pairs = {(t.type, t.property) for t in targets}
    _check_regressions(body, parts, pairs)
    _require(all((name, prop) in pairs for name, prop, _ in body.looks), "looks", "expected targets")
    if body.screen is not None:
        _check_screen(body.screen, parts)
    _require((parts.laws is None) == (body.laws is None), "laws", "they don't go with config.frames")
    if arrays is None:
        _require(not body.tables, "tables", "expected none without history")
    else:
        _check_history(body, parts, targets, arrays)
    if parts.laws is not None and body.laws is not None:
        _check_laws(body.laws, parts.laws.learner, arrays)


def _check_calibration(body: Body, known: set[str], experts: int) -> None:
    for name, calibration in body.calibration.items():
        _require(name in known, "calibration", f"{name!r} is no target")
        _distinct([cell.key for cell in calibration.cells], "calibration")
        _require(calibration.slips[1] <= calibration.slips[0], "calibration", "more slips than predictions")
        records = [record for cell in calibration.cells for record in cell.records]
        for cell in calibration.cells:
            _distinct([who for who, *_ in cell.records], "calibration")
            whole = len(cell.squares) == experts > max([cell.speaker, *(who for who, *_ in cell.records)])
            _require(whole, "calibration", f"expected {experts} experts: five, and config.hypotheses")
        for _, who, _, errors in calibration.waiting:
            _require(len(errors) == experts > who, "calibration", f"expected {experts} experts")
            told = None not in (errors[who], errors[PERSISTENCE])
            _require(told, "calibration", "expected what the speaker and persistence were off by")
        _require(
            all(hits <= trials for _, trials, hits, *_ in records), "calibration", "more hits than trials"
        )
        for bins in (calibration.changes, *(record[4] for record in records)):
            _distinct([place for place, _ in bins], "calibration")
            _require(all(-(1 << 14) <= place < 1 << 12 for place, _ in bins), "calibration", "no such size")


def _check_regressions(body: Body, parts: Parts, pairs: set[tuple[str, str]]) -> None:
    for name, regression in body.regressions.items():
        where = f"regressions[{name!r}]"
        _require(name in parts.regressions, where, "nothing of this type is predicted")
        _require(all((name, prop) in pairs for prop in regression.targets), where, "expected targets")
        _distinct(regression.targets, where)
        _require(regression.seen > 0, where, "nothing was seen")
        d, count = len(regression.names), len(regression.targets)
        _require(d <= parts.config.regression_columns, where, "more columns than are regressed on")
        widths = {len(regression.centre), len(regression.scale)}
        _require(widths == {d} or (widths == {0} and not regression.ridges), where, "expected one a column")
        _require(all(each > 0.0 for each in regression.scale), where, "expected scales above 0")
        least, most = regression.range
        _require(len(least) == len(most) == count, where, "expected a range for each target")
        _require(
            all(a <= b for a, b in zip(least, most, strict=True)), where, "the smaller change comes first"
        )
        _require(all(len(x) == d and len(y) <= count for x, y in regression.waiting), where, "another width")
        for (_, _, weights), width in zip(regression.ridges, (d, d + d * (d + 1) // 2), strict=False):
            _require(0 < len(weights) <= count, where, "expected weights of some of the targets")
            _require(
                all(len(row) == width + 1 for row in weights), where, "expected a weight for each column"
            )
        _require(
            all(len(each) == count for each in regression.say), where, "expected what counts of each target"
        )
        _require(len(regression.leverage) <= len(regression.ridges), where, "leverage on what there isn't")
        for spread, width in zip(regression.leverage, (d, d + d * (d + 1) // 2), strict=False):
            if spread is None:
                continue
            _require(len(spread.mean) == width, where, "expected a mean for each column")
            _decoded(spread.inverse, "float32", (width * (width + 1) // 2,), where)


def _target(record: TargetRecord) -> Target:
    return Target(record.type, record.property, tuple((t, p) for t, p in record.given))


# ---------------------------------------------------------------------- one target
@dataclass(frozen=True, slots=True)
class _TargetCheck:
    """Checks the model of one target."""

    parts: Parts
    target: Target
    where: str
    history: bool

    def check(self, model: PropertyRecord) -> None:
        ids = self._check_clusterer(model.clusterer)
        self._check_classifier(model.classifier, ids)
        self._check_casting(model)
        for name, part in (("best", model.guess.best), ("beyond", model.guess.beyond)):
            if part is not None:
                where = f"{self.where}.guess.{name}"
                _require(part[0].id == 0, where, "a guess is no mode: expected the id 0")
                self._check_mode(part[0], where)
                _require(len(part[0].roles) == 1 + self._alone(part[0]), where, "expected bodiless roles")
        _distinct([s.mode for s in model.spreads], f"{self.where}.spreads")
        if model.scope.tree is not None:
            _check_tree(model.scope.tree, f"{self.where}.scope.tree")
        if model.scope.reach is not None:
            least, most = model.scope.reach
            _require(least <= most, f"{self.where}.scope.reach", "expected the smaller change first")
        self._check_bounds(model, ids)
        names = self.parts.config.hypotheses
        laws = [] if model.candidates is None else model.candidates.laws
        _require(len(laws) == len(names), f"{self.where}.candidates", f"expected laws or none of {names}")

    def _alone(self, mode: ModeRecord) -> int:
        """Number of roles that bodiless objects play."""
        kinds = {t.name for t in self.parts.schema.types if not t.has_body}
        return sum(role.type in kinds for role in mode.roles[1:])

    # ------------------------------------------------------------------ modes
    def _check_clusterer(self, clusterer: ClustererRecord) -> tuple[int, ...]:
        where = f"{self.where}.clusterer"
        ids = [mode.id for mode in clusterer.modes]
        _distinct(ids, f"{where}.modes")
        _require(0 not in ids, f"{where}.modes", "0 is the id of noise")
        _require(max(ids, default=0) < clusterer.next_id, f"{where}.next_id", "it is taken")
        _require(
            sorted(ids) == [i for i, _, _ in clusterer.fitted], f"{where}.fitted", "expected every mode once"
        )
        _distinct([i for i, _, _ in clusterer.searches], f"{where}.searches")
        for k, mode in enumerate(clusterer.modes):
            self._check_mode(mode, f"{where}.modes[{k}]")
        return tuple(sorted(ids))

    def _check_mode(self, mode: ModeRecord, where: str) -> None:
        schema = self.parts.schema
        _require(mode.roles[0].type == self.target.type, where, "the first role is the target's own")
        types = {t.name: t for t in schema.types}
        for k, role in enumerate(mode.roles):
            _require(role.type in types, where, f"there is no type {role.type!r}")
            offered = set(types[role.type].properties)
            offered |= {p + PRIME for t, p in self.target.given if t == role.type}
            names = [name for name, _ in role.terms]
            _require(names or k == 0, where, "a role of which no property counts")
            _distinct(names, where)
            # Features are worked out of what a row holds; where they aren't offered the mode says nothing.
            features = bool(self.parts.config.features) and k == 0
            _require(features or offered.issuperset(names), where, f"{role.type!r} has no {names}")
        kinds = [(role.type, tuple(role.terms)) for role in mode.roles[1:]]
        _require(
            len(kinds) <= 2 * _CHOICES, where, f"expected at most {2 * _CHOICES} roles beside the target's"
        )

    # ------------------------------------------------------------------ when modes hold
    def _check_classifier(self, classifier: ClassifierRecord, ids: tuple[int, ...]) -> None:
        where = f"{self.where}.classifier"
        self._check_vocabulary(classifier)
        modes = tuple(classifier.modes)
        _require(modes == tuple(sorted(set(modes))), f"{where}.modes", "expected ids in ascending order")
        _require(set(modes) <= set(ids), f"{where}.modes", f"expected some of {list(ids)}")
        counted = [mode for mode, _ in classifier.counts]
        _distinct(counted, f"{where}.counts")
        _require(set(modes) <= set(counted), f"{where}.counts", "expected all modes")
        _require(all(each < 2**64 for each in classifier.seen), f"{where}.seen", "expected 64 bits")
        found = [(pair.classifier.i, pair.classifier.j) for pair in classifier.pairs]
        _require(found == list(combinations(modes, 2)), f"{where}.pairs", "expected every pair of modes once")
        for k, pair in enumerate(classifier.pairs):
            self._check_pair(pair, f"{where}.pairs[{k}]", self._scope(classifier, found[k]))
        _require(
            (classifier.exemplars is not None) == self.history,
            f"{where}.exemplars",
            "they go with the history",
        )
        _distinct([key for key, _ in classifier.certain], f"{where}.certain")
        if classifier.exemplars is not None:
            _check_exemplars(classifier.exemplars, classifier, ids, f"{where}.exemplars")

    def _check_vocabulary(self, classifier: ClassifierRecord) -> None:
        found, where = classifier.vocabulary, f"{self.where}.classifier.vocabulary"
        own = self.parts.schema.type(self.target.type)
        base = self.parts.perception.vocabulary(own)
        expected = self._conditions(classifier).vocabulary(base, tuple(found.follows))
        plain = expected.to_dict()
        for name in ("relations", "unary", "pair", "own", "contact", "present"):
            _require(getattr(found, name) == plain[name], f"{where}.{name}", f"expected {plain[name]!r:.200}")
        names = [name for name, _ in found.follows]
        _distinct(names, f"{where}.follows")
        _require(
            set(names) <= set(plain["own"]), f"{where}.follows", f"expected some of {plain['own']!r:.200}"
        )

    def _conditions(self, classifier: ClassifierRecord) -> Conditions:
        found = Conditions(self.parts.schema, self.target)
        found.keep(classifier.vocabulary.own)
        return found

    def _scope(self, classifier: ClassifierRecord, modes: Sequence[int]) -> Scope:
        base = self.parts.perception.vocabulary(self.parts.schema.type(self.target.type))
        follows = tuple(classifier.vocabulary.follows)
        vocabulary = self._conditions(classifier).vocabulary(base, follows)
        return Scope.of(vocabulary, self.parts.config.classification, modes)

    def _check_pair(self, pair: PairRecord, where: str, scope: Scope) -> None:
        definition = pair.classifier.definition
        self._check_definition(definition, f"{where}.classifier.definition", scope, arity=1)
        for k, (context, draft) in enumerate(pair.draft or ()):
            self._check_definition(draft, f"{where}.draft[{k}]", scope, arity=1)
            _require(
                context not in [c for c, _ in (pair.draft or ())[:k]], f"{where}.draft", "a context twice"
            )
        trees, stages = pair.classifier.trees, len(definition.clauses)
        _require(len(trees) == stages + 1, f"{where}.classifier.trees", f"expected {stages + 1} of them")
        outcomes = 0
        for stage, tree in enumerate(trees):
            at = f"{where}.classifier.trees[{stage}]"
            if tree is None:
                outcomes += 1
                continue
            names = scope.scalars
            if stage < stages:
                names = tree_columns(scope, _variables(definition.clauses[stage], 1))
            _require(tuple(tree.columns) == names, f"{at}.columns", f"expected {list(names)!r:.200}")
            _check_tree(tree, at)
            leaves = [k for k, column in enumerate(tree.column) if column < 0]
            # In a clause's tree the leaves that say no lead on to the next clause.
            outcomes += sum(stage == stages or tree.positive[k] > tree.negative[k] for k in leaves)
        counts = pair.classifier.counts
        _require(len(counts) == outcomes, f"{where}.classifier.counts", f"expected {outcomes} of them")

    def _check_definition(
        self, definition: DefinitionRecord, where: str, scope: Scope, *, arity: int
    ) -> None:
        _require(definition.arity == arity, f"{where}.arity", f"expected {arity}")
        counted = len(definition.coverage)
        _require(
            counted == len(definition.clauses) or (not counted and arity == 1),
            f"{where}.coverage",
            "expected one count for each clause",
        )
        most = arity + self.parts.config.classification.max_new_variables
        for k, clause in enumerate(definition.clauses):
            at = f"{where}.clauses[{k}]"
            for literal in clause:
                _check_literal(literal, at, scope)
            existential = {v for literal in clause for v in literal.args if v >= arity}
            _require(existential <= set(range(arity, most)), at, f"expected variables below {most}")
            _require(existential == set(range(arity, arity + len(existential))), at, "a variable is left out")

    # ------------------------------------------------------------------ role bindings
    def _check_casting(self, model: PropertyRecord) -> None:
        where = f"{self.where}.casting"
        modes = {mode.id: mode for mode in model.clusterer.modes}
        _distinct([number for number, _ in model.casting], where)
        unary = set(model.classifier.vocabulary.unary)
        for number, casting in model.casting:
            _require(number in modes, where, f"there is no mode {number}")
            roles = [role for role in modes[number].roles[1:] if role.type in unary]
            named = [(role.type, [name for name, _ in role.terms]) for role in roles]
            found = [(kind, [name for name, _ in weights]) for kind, weights in casting.kinds]
            _require(found == named, f"{where}[{number}].kinds", f"expected the mode's roles {named!r:.200}")
            self._check_roles(casting, model.classifier, f"{where}[{number}]")

    def _check_roles(self, casting: CastingRecord, classifier: ClassifierRecord, where: str) -> None:
        kinds = {(kind, tuple(weights)) for kind, weights in casting.kinds}
        most = max((sum((k, tuple(w)) == kind for k, w in casting.kinds) for kind in kinds), default=0)
        _require(most <= _CHOICES, where, f"expected at most {_CHOICES} roles of one kind")
        sizes = {len(kinds), len(casting.definitions), len(casting.common)}
        _require(len(sizes) == 1, where, f"expected {len(kinds)} definitions, one for each kind of role")
        base = self._scope(classifier, ())
        scope = Scope(base.relations, base.unary, (), ())
        for definition in casting.definitions:
            if definition is not None:
                self._check_definition(definition, f"{where}.definitions", scope, arity=2)
        stances = 2 * len(classifier.vocabulary.relations) + len(classifier.vocabulary.unary)
        for common in casting.common:
            _require(
                common is None or max(common, default=0) < stances, f"{where}.common", f"expected < {stances}"
            )

    def _check_bounds(self, model: PropertyRecord, ids: Collection[int]) -> None:
        """Limits, stops, landings and what has ended are modes, and none that take part in the vote."""
        limits = [bound for bound in (model.limits.low, model.limits.high) if bound is not None]
        if len(limits) == 2:
            least, most = limits[0][1], limits[1][1]
            _require(least <= most, f"{self.where}.limits", "expected the low one below the high one")
        every: list[StopRecord | LandingRecord] = [*model.stops.stops, *model.stops.landings]
        voting = set(model.classifier.modes)
        where = f"{self.where}.limits, stops or past"
        for mode in model.amended:
            _require(mode in ids, f"{self.where}.amended", f"there is no mode {mode}")
        others = {mode.id: len(mode.roles) - 1 for mode in model.clusterer.modes}
        _distinct([mode for mode, _ in model.places], f"{self.where}.places")
        for mode, found in model.places:
            _require(mode in ids, f"{self.where}.places", f"there is no mode {mode}")
            whole = all(len(slots) == others[mode] for slots in found)
            _require(whole, f"{self.where}.places", f"expected slots of {others[mode]} roles")
        for mode in (*(bound[0] for bound in limits), *(each.mode for each in every), *model.past):
            _require(mode in ids, where, f"there is no mode {mode}")
            _require(mode not in voting, where, f"mode {mode} takes part in the vote")
        properties = self.parts.schema.type(self.target.type).properties
        for each in every:
            _require(
                each.property in properties, f"{self.where}.stops", f"there is no property {each.property!r}"
            )
        for stop in model.stops.stops:
            _require(abs(stop.side) == 1.0, f"{self.where}.stops", "expected the side -1 or 1")


def _check_literal(literal: LiteralRecord, where: str, scope: Scope) -> None:
    name, places = literal.relation, len(literal.args)
    if literal.op is None:
        known = {**{n: 2 for n, _ in scope.relations}, **{n: 1 for n, _ in scope.unary}}
        _require(known.get(name) == places, where, f"there is no relation {name!r} of {places} objects")
        return
    if places == 0:
        _require(name in scope.scalars, where, f"there is no number {name!r}")
        return
    _require(name in [n for n, _ in scope.pair], where, f"there is no number {name!r} of two objects")
    _require(
        places == 2 and literal.args[0] == 0 and literal.args[1] != 0, where, "expected (A, another object)"
    )


def _variables(clause: Sequence[LiteralRecord], arity: int) -> int:
    return max(arity, 1 + max((v for literal in clause for v in literal.args), default=-1))


def _check_tree(tree: TreeRecord, where: str) -> None:
    """All lists are equally long, columns exist, and the nodes are a tree in preorder."""
    size = len(tree.column)
    lists = (tree.threshold, tree.below, tree.above, tree.positive, tree.negative)
    _require(all(len(each) == size for each in lists), where, f"expected lists of {size} nodes")
    _require(max(tree.column) < len(tree.columns), where, "a column is tested that isn't there")
    due = [0]
    for node in range(size):
        _require(due and due.pop() == node, where, "expected nodes in preorder")
        if tree.column[node] < 0:
            _require(tree.below[node] == tree.above[node] == node, where, "a leaf leads on")
        else:
            _require(node < tree.below[node] and node < tree.above[node], where, "a node leads back")
            due += [tree.above[node], tree.below[node]]
    _require(not due, where, "a node leads nowhere")


# ---------------------------------------------------------------------- exemplars
def _check_exemplars(
    found: ExemplarsRecord, classifier: ClassifierRecord, ids: Collection[int], where: str
) -> None:
    _require(found.modes == classifier.modes, f"{where}.modes", f"expected {classifier.modes}")
    sizes, size, names = found.columns.sizes, found.columns.size, classifier.vocabulary
    expected: dict[str, list[Any]] = {
        "R": names.relations,
        "U": names.unary,
        "F": names.pair,
        "A": names.own,
        "M": found.modes,
    }
    for axis, those in expected.items():
        _require(
            getattr(sizes, axis) == len(those), f"{where}.columns.sizes.{axis}", f"expected {len(those)}"
        )
    _require(sizes.K == sizes.K2, f"{where}.columns.sizes", "expected K and K2 to be equal")
    arrays = {}
    _require(
        set(found.columns.arrays) == set(COLUMNS), f"{where}.columns.arrays", f"expected {sorted(COLUMNS)}"
    )
    for name, column in COLUMNS.items():
        shape = (size, *(getattr(sizes, axis) for axis in column.axes))
        arrays[name] = _decoded(
            found.columns.arrays[name], column.dtype, shape, f"{where}.columns.arrays.{name}"
        )
    _check_values(arrays, sizes.K, ids, len(found.cells), where)
    _check_cells(found, arrays, where)


def _decoded(text: str, dtype: str, shape: tuple[int, ...], where: str) -> NDArray[Any]:
    """An array in base64; its length is looked at before it is decoded."""
    items = math.prod(shape)
    size = -(-items // 8) if dtype == "bool" else items * np.dtype(dtype).itemsize
    _require(len(text) == 4 * -(-size // 3), where, f"expected {size:,} bytes for the shape {shape}")
    try:
        raw = base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError) as error:
        raise ModelFileError(f"{where}: expected base64 ({error}); save the model again") from None
    _require(len(raw) == size, where, f"expected {size:,} bytes for the shape {shape}")
    if dtype == "bool":
        bits = np.unpackbits(np.frombuffer(raw, dtype=np.uint8), count=items)
        return bits.astype(np.bool_).reshape(shape)
    return np.frombuffer(raw, dtype=dtype).reshape(shape)


def _check_values(arrays: _Arrays, objects: int, ids: Collection[int], cells: int, where: str) -> None:
    n = len(arrays["target"])
    exists, target = arrays["exists"], arrays["target"]
    _require(_within(target, 0, objects), f"{where}: target", "expected one of the objects")
    _require(exists[np.arange(n), target].all(), f"{where}: target", "expected an object that exists")
    for name in ("close", "approached"):
        _require(not (arrays[name] & ~exists).any(), f"{where}: {name}", "expected objects that exist")
        _require(
            arrays[name][np.arange(n), target].all(), f"{where}: {name}", "expected the target among them"
        )
    both = exists[:, :, None] & exists[:, None, :]
    _require(not (arrays["table"] & ~both[:, None]).any(), f"{where}: table", "expected objects that exist")
    _require(not (arrays["unary"] & ~exists[:, None]).any(), f"{where}: unary", "expected objects that exist")
    _require(_within(arrays["row"], 0, 2**53), f"{where}: row", "expected numbers of examples")
    _require(
        np.isin(arrays["assigned"], [-1, *ids]).all(),
        f"{where}: assigned",
        f"expected -1 or one of {list(ids)}",
    )
    _require(_within(arrays["cell"], 0, cells), f"{where}: cell", "expected one of the cells")
    _require(_within(arrays["roles"], -1, objects), f"{where}: roles", "expected objects, or -1")


def _check_cells(found: ExemplarsRecord, arrays: _Arrays, where: str) -> None:
    """The cells share out all slots, and agree with what the slots say of themselves."""
    slots = [slot for *_, members in found.cells for slot in members]
    _require(
        sorted(slots) == list(range(found.columns.size)), f"{where}.cells", "expected every slot in one cell"
    )
    _distinct([(mode, key) for mode, key, _, _ in found.cells], f"{where}.cells")
    cell, assigned = arrays["cell"].tolist(), arrays["assigned"].tolist()
    for number, (mode, _, _, members) in enumerate(found.cells):
        agree = all(cell[slot] == number and assigned[slot] == mode for slot in members)
        _require(agree, f"{where}.cells[{number}]", "its slots say otherwise")


def _within(values: NDArray[Any], low: int, high: int) -> bool:
    """Whether all values lie in [low, high)."""
    return not values.size or bool(values.min() >= low and values.max() < high)


def _sized(values: NDArray[np.float64]) -> bool:
    """Whether numbers are such that can be learned from: the squares of larger ones would overflow."""
    return bool((np.abs(values) <= LARGEST).all())


_SIZED: Final = f"expected finite numbers of at most {LARGEST:g}"


# ---------------------------------------------------------------------- laws of motion
def _check_screen(record: ScreenRecord, parts: Parts) -> None:
    known = {(t.name, prop) for t in parts.schema.types for prop in t.properties}
    pairs = [(row[0], row[1]) for row in record.properties]
    _require(
        len(set(pairs)) == len(pairs) and set(pairs) <= known, "screen", "expected properties of the schema"
    )
    _require(
        all(row[3] == sorted(row[3]) for row in record.properties), "screen", "expected ascending magnitudes"
    )


def _check_laws(record: LawsRecord, learner: LawLearner, arrays: _Arrays | None) -> None:
    laws, sources = record.laws, learner.sources
    free = [law.type for law in laws.free]
    _distinct(free, "laws.free")
    for law in laws.free:
        _require(law.type in sources, "laws.free", f"no law is learned of {law.type!r}")
        own = sources[law.type]
        counts = {len(own.velocity), len(own.moving)}
        _require(
            len(law.components) in counts,
            "laws.free",
            f"expected {sorted(counts)} components of {law.type!r}",
        )
        for terms in law.components:
            _check_terms(terms, {*own.readable, ONE}, "laws.free")
        for region in law.regions:
            _require(
                len(region.components) == len(law.components),
                "laws.free",
                "expected as many components everywhere",
            )
            for terms in region.components:
                _check_terms(terms, {*own.readable, ONE}, "laws.free")
            _require(
                all(name in own.where and low <= high for name, _, low, high in region.bounds),
                "laws.free",
                f"expected bounds of {list(own.where)}, low before high",
            )
    _distinct(record.governed, "laws.governed")
    ready = set(free) if laws.pair is not None or learner.book.turning else set()
    _require(ready.issuperset(record.governed), "laws.governed", f"expected some of {sorted(ready)}")
    if laws.pair is not None:
        _check_pair_law(laws, learner)
    names = {name: {EXTENT, *(n for n in s.names if "." not in n)} for name, s in sources.items()}
    _check_inertia(laws, learner)
    _distinct([(a, b) for a, b, *_ in laws.shares], "laws.shares")
    for a, b, prop, _, _ in laws.shares:
        _require(a in sources and b in sources, "laws.shares", f"no law is learned of {a!r} and {b!r}")
        _require(not prop or (prop in names[a] and prop in names[b]), "laws.shares", f"there is no {prop!r}")
    _require(
        [name for name, *_ in laws.ledger] == sorted(sources), "laws.ledger", f"expected {sorted(sources)}"
    )
    kept = (laws.random, laws.store, laws.learners)
    whole = all(each is not None for each in kept) if arrays is not None else not any(kept)
    _require(whole, "laws", "random, store and learners go with the history")
    if laws.store is not None and laws.learners is not None and arrays is not None:
        _check_kept(laws, learner, arrays)


def _check_inertia(laws: LearnedLawsRecord, learner: LawLearner) -> None:
    """What masses and moments are functions of is looked up name by name: a name that nothing has says nothing."""
    inertia = laws.inertia
    _require(
        learner.book.turning or inertia == InertiaRecord(), "laws.inertia", "nothing turns in these scenes"
    )
    if inertia.mass is not None:
        _distinct([name for name, _ in inertia.mass.constants], "laws.inertia.mass.constants")
        _require(
            all(value > 0.0 for _, value in inertia.mass.constants),
            "laws.inertia.mass",
            "expected constants above 0",
        )
    for gyration in inertia.gyrations:
        for name in gyration.types:
            _require(name in learner.sources, "laws.inertia.gyrations", f"no law is learned of {name!r}")


def _check_terms(terms: Sequence[tuple[str, float]], known: Collection[str], where: str) -> None:
    names = [name for name, _ in terms]
    _distinct(names, where)
    _require(
        set(known).issuperset(names), where, f"there is nothing called {sorted(set(names) - set(known))}"
    )


def _check_pair_law(laws: LearnedLawsRecord, learner: LawLearner) -> None:
    pair = laws.pair
    assert pair is not None
    axes = Axes.of(learner.schema)
    _require(
        pair.frame != "turned" or len(axes.used) == 2, "laws.pair.frame", "'turned' is a frame of the plane"
    )
    letters = axis_names(pair.frame, len(axes.used))
    _require(len(pair.axes) == len(letters), "laws.pair.axes", f"expected the axes {letters}")
    bodies = {t.name for t in learner.schema.types if t.has_body}
    for k, each in enumerate(pair.axes):
        known = {ONE, *(f"{kind}_{c}" for kind in "uv" for c in letters), *(f"J_{c}" for c in letters[:k])}
        for law in each:
            _check_axis(law, known, bodies)
        kinds = [kind for law in each for kind in law.kinds]
        _distinct(kinds, "laws.pair.axes")
    _require(not pair.surfaces or pair.frame == "point", "laws.pair.surfaces", "expected the frame 'point'")
    for a, b, _ in pair.surfaces:
        _require(a in bodies and b in bodies, "laws.pair.surfaces", f"there are no bodies {a!r} and {b!r}")
    for a, b, _ in pair.grips:
        _require(a in bodies and b in bodies, "laws.pair.grips", f"there are no bodies {a!r} and {b!r}")
    if pair.frame == "point":
        spins = [learner.sources[name].spin for name in (law.type for law in laws.free)]
        _require(any(spins), "laws.pair.frame", "'point' is a frame of bodies that spin")


def _check_axis(law: AxisLawRecord, known: Collection[str], bodies: Collection[str]) -> None:
    for a, b in law.kinds:
        _require(a in bodies and b in bodies, "laws.pair.axes", f"there are no bodies {a!r} and {b!r}")
    _require(
        set(law.doubted) <= set(law.kinds), "laws.pair.axes", "expected doubts of kinds that a law is of"
    )
    _require(
        law.excused <= law.unexplained, "laws.pair.axes", "expected no more excused than unexplained examples"
    )
    for pieces in (law.pieces, *(pieces for _, pieces in law.alternatives)):
        for terms in pieces:
            _check_terms(terms, known, "laws.pair.axes")


def _check_kept(laws: LearnedLawsRecord, learner: LawLearner, arrays: _Arrays) -> None:
    assert laws.store is not None and laws.learners is not None
    bodies = {t.name for t in learner.schema.types if t.has_body}
    for a, b in laws.store.kinds:
        _require(
            a in learner.sources and b in bodies,
            "laws.store.kinds",
            f"there is no contact of {a!r} and {b!r}",
        )
    _distinct(laws.store.kinds, "laws.store.kinds")
    names = sorted(learner.sources)
    _require([name for name, *_ in laws.learners] == names, "laws.learners", f"expected {names}")
    _require(
        laws.drift is None or [name for name, *_ in laws.drift] == names, "laws.drift", f"expected {names}"
    )
    width, limit = learner.store_shape
    rows = _stored(arrays, "laws.contacts", width, limit, laws.store.store.seen, 2 * len(laws.store.kinds))
    if rows.size:
        kinds = rows[:, 0]
        _require(_within(kinds, 0, len(laws.store.kinds)), "laws.contacts", "expected kinds of contacts")
        _require((kinds == np.floor(kinds)).all(), "laws.contacts", "expected numbers of kinds")
        for column in learner.object_columns:
            numbers = rows[:, column]
            _require(_within(numbers, 0, len(laws.store.objects)), "laws.contacts", "expected objects")
            _require((numbers == np.floor(numbers)).all(), "laws.contacts", "expected numbers of objects")
    for k, (name, _, _, store) in enumerate(laws.learners):
        width, limit = learner.free_shape(name)
        _stored(arrays, f"laws.free{k}", width, limit, store.seen, 2)


def _stored(arrays: _Arrays, name: str, width: int, limit: int, seen: int, cells: int) -> NDArray[Any]:
    """The rows of a store: as wide as they must be, not too many, all in one of its cells."""
    n = _rows(arrays, f"{name}.rows", "float64", (None, width))
    _require(n <= min(limit, seen), f"{name}.rows", f"expected at most {min(limit, seen)}, got {n:,}")
    _rows(arrays, f"{name}.cells", "int64", (n,))
    if f"{name}.arrived" in arrays:
        _rows(arrays, f"{name}.arrived", "int64", (n,))
        _require(
            _within(arrays[f"{name}.arrived"], 0, seen + 1), f"{name}.arrived", "expected no more than came"
        )
    rows, found = arrays[f"{name}.rows"], arrays[f"{name}.cells"]
    _require(_sized(rows), f"{name}.rows", _SIZED)
    _require(_within(found, 0, cells), f"{name}.cells", "expected one of the cells")
    return rows


# ---------------------------------------------------------------------- the history
def _rows(arrays: _Arrays, name: str, dtype: str, shape: tuple[int | None, ...]) -> int:
    """Length of an array, which must be of this dtype and shape; of a stored one no more is read than its header."""
    _require(name in arrays, "history", f"the array {name!r} is missing")
    if isinstance(arrays, StoredArrays):
        kind, found = arrays.claim(name)
    else:
        kind, found = arrays[name].dtype, arrays[name].shape
    fits = len(shape) == len(found) and all(w in (None, n) for w, n in zip(shape, found, strict=True))
    _require(kind == np.dtype(dtype) and fits, f"history: {name}", f"expected {dtype} of shape {shape}")
    return found[0]


def _check_history(body: Body, parts: Parts, targets: Sequence[Target], arrays: _Arrays) -> None:
    types = sorted(parts.tables)
    _require(len(body.tables) == len(types), "tables", f"expected one for each of {types}")
    expected = {f"table{k}.{name}" for k in range(len(types)) for name in _TABLE}
    expected |= {f"target{k}.{name}" for k in range(len(targets)) for name in _TARGET}
    if body.laws is not None:
        stores = ["contacts", *(f"free{k}" for k in range(len(body.laws.laws.learners or ())))]
        expected |= {f"laws.{store}.{name}" for store in stores for name in ("rows", "cells")}
        came = {f"laws.{store}.arrived" for store in stores}  # which earlier files don't say
        expected |= came & set(arrays)
    expected |= _check_regression_shapes(body, arrays)
    _require(
        set(arrays) == expected,
        "history",
        f"arrays are missing or too many: {sorted(set(arrays) ^ expected)[:5]}",
    )
    signatures = {
        name: _signatures(table, name, parts, f"table{k}")
        for k, (name, table) in enumerate(zip(types, body.tables, strict=True))
    }
    for k, (name, table) in enumerate(zip(types, body.tables, strict=True)):
        _check_table_shapes(table, signatures[name], arrays, f"table{k}")
    for k, (part, target) in enumerate(zip(body.targets, targets, strict=True)):
        most = _rows(arrays, f"table{types.index(target.type)}.serial", "int64", (None,))
        _check_target_shapes(part.model, most, arrays, f"target{k}")
    for k, (name, table) in enumerate(zip(types, body.tables, strict=True)):
        _check_table(table, signatures[name], arrays, f"table{k}")
    for k, (part, target) in enumerate(zip(body.targets, targets, strict=True)):
        table_at = f"table{types.index(target.type)}"
        _check_examples(part.model, target, signatures[target.type], arrays, table_at, f"target{k}")


def _check_regression_shapes(body: Body, arrays: _Arrays) -> set[str]:
    """Names of the arrays of regressions, whose shapes and numbers are such as they must be."""
    names: set[str] = set()
    for k, (_, regression) in enumerate(sorted(body.regressions.items())):
        for number, (_, _, weights) in enumerate(regression.ridges):
            width = len(weights[0])
            shapes = {f"gram{number}": (width, width), f"moments{number}": (len(weights), width)}
            for part, shape in shapes.items():
                name = f"regression{k}.{part}"
                _rows(arrays, name, "float64", shape)
                _require(np.isfinite(arrays[name]).all(), f"history: {name}", "expected finite numbers")
                names.add(name)
            names |= _check_begun(regression, number, arrays, f"regression{k}")
            name = f"regression{k}.left{number}"
            if name in arrays:  # which earlier files don't say
                _rows(arrays, name, "float64", (len(weights),))
                _require((arrays[name] >= 0.0).all(), f"history: {name}", "expected mean squares")
                names.add(name)
            name = f"regression{k}.squares{number}"
            if name in arrays:  # which earlier files don't say
                _rows(arrays, name, "float64", (len(weights),))
                fits = np.isfinite(arrays[name]).all() and (arrays[name] >= 0.0).all()
                _require(fits, f"history: {name}", "expected sums of squares")
                names.add(name)
        name = f"regression{k}.left"
        if name in arrays:  # which earlier files don't say
            _rows(arrays, name, "float64", (len(KINDS) * (len(RATES) + 1), len(regression.targets)))
            fits = np.isfinite(arrays[name]).all() and (arrays[name] >= 0.0).all()
            _require(fits, f"history: {name}", "expected mean squares")
            names.add(name)
        names |= _check_remembered(regression, arrays, f"regression{k}")
    return names


def _check_begun(regression: RegressionRecord, number: int, arrays: _Arrays, at: str) -> set[str]:
    """Names of the arrays that a solution was begun from, if one was."""
    seen, _, weights = regression.ridges[number]
    width = len(weights[0])
    place, gram, moments, squares = (
        f"{at}.{part}{number}" for part in ("begun", "begun_gram", "begun_moments", "begun_squares")
    )
    if not any(name in arrays for name in (place, gram, moments, squares)):
        return set()
    _rows(arrays, place, "int64", (2,))
    _rows(arrays, gram, "float64", (width, width))
    known = _rows(arrays, moments, "float64", (None, width))
    _rows(arrays, squares, "float64", (known,))
    for name in (gram, moments, squares):
        _require(np.isfinite(arrays[name]).all(), f"history: {name}", "expected finite numbers")
    rows, swept = arrays[place].tolist()
    fits = 0 < rows <= seen and 0 <= swept < width
    _require(fits, f"history: {place}", "expected rows that came, and columns that are done")
    _require(known <= len(weights), f"history: {moments}", "expected sums of some of the targets")
    return {place, gram, moments, squares}


def _check_remembered(regression: RegressionRecord, arrays: _Arrays, at: str) -> set[str]:
    """Names of the arrays of rows that a regression remembers, which earlier files don't say."""
    names = [f"{at}.{part}" for part in ("columns", "responses", "count", "gone_over", "left_out")]
    if not any(name in arrays for name in names):
        return set()
    columns, responses, count, gone_over, left_out = names
    rows = _rows(arrays, columns, "float64", (None, len(regression.names)))
    _require(
        bool(regression.ridges), f"history: {columns}", "expected a regression that rows are left out of"
    )
    _rows(arrays, responses, "float64", (rows, len(regression.ridges[0][2])))
    for name in (columns, responses):
        fits = (np.abs(arrays[name]) <= SUMMABLE).all()
        _require(fits, f"history: {name}", "expected numbers whose squares can be summed")
    for name in (count, gone_over):
        _rows(arrays, name, "int64", (2,))
    seen, every = arrays[count].tolist()
    fits = 0 < seen <= regression.ridges[0][0] and every.bit_count() == 1 and rows == -(-seen // every)
    _require(fits, f"history: {count}", "expected one of so many rows to be remembered")
    over, rows_before = arrays[gone_over].tolist()
    _require(0 <= over <= rows_before <= rows, f"history: {gone_over}", "expected numbers of rows, in order")
    _rows(arrays, left_out, "float64", (len(RATES) + 1, len(regression.targets)))
    fits = np.isfinite(arrays[left_out]).all() and (arrays[left_out] >= 0.0).all()
    _require(fits, f"history: {left_out}", "expected sums of squares")
    return set(names)


_TABLE: Final = ("x", "signature", "stratum", "bodies", "serial")
_TARGET: Final = ("y", "labels", "rows", "forgotten")


def _signatures(table: TableRecord, type_name: str, parts: Parts, at: str) -> list[SlotSignature]:
    """What the rows of a table hold."""
    known = {t.name: t for t in parts.schema.types}
    signatures = []
    for names in table.signatures:
        _require(names[0] == type_name, at, f"expected rows of {type_name!r}")
        _require(known.keys() >= set(names), at, f"there is no type among {names}")
        bodily = [known[name].has_body for name in names[1:]]
        _require(bodily == sorted(bodily), at, "expected bodiless objects before bodies")
        signatures.append(parts.signature_of(tuple(names)))
    _distinct(signatures, f"{at}: signatures")
    return signatures


def _check_table_shapes(
    table: TableRecord, signatures: Sequence[SlotSignature], arrays: _Arrays, at: str
) -> None:
    """Shapes are looked at before room is made for any array."""
    n = _rows(arrays, f"{at}.x", "float64", (None, max((len(s.columns) for s in signatures), default=0)))
    _require(n <= table.seen, f"history: {at}.x", "there are more rows than were seen")
    for name in ("signature", "stratum"):
        _rows(arrays, f"{at}.{name}", "int32", (n,))
    _rows(arrays, f"{at}.bodies", "int16", (n, max((len(s.types) for s in signatures), default=0)))
    _rows(arrays, f"{at}.serial", "int64", (n,))


def _check_target_shapes(model: PropertyRecord, most: int, arrays: _Arrays, at: str) -> None:
    """The same of the examples of a target, each of which is a row of a table."""
    n = _rows(arrays, f"{at}.y", "float64", (None,))
    _require(n <= most, f"history: {at}.y", f"expected at most {most:,} examples, as many as there are rows")
    _rows(arrays, f"{at}.labels", "int32", (n,))
    _rows(arrays, f"{at}.rows", "int64", (n,))
    counted = _rows(arrays, f"{at}.forgotten", "int64", (None, 2))
    _require(counted <= model.clusterer.next_id, f"history: {at}.forgotten", "there are more than modes")


def _check_table(table: TableRecord, signatures: Sequence[SlotSignature], arrays: _Arrays, at: str) -> None:
    _distinct(table.strata, f"{at}: strata")
    x = arrays[f"{at}.x"]
    n = len(x)
    _require(_sized(x), f"history: {at}.x", _SIZED)
    ids = arrays[f"{at}.signature"]
    _require(_within(ids, 0, len(signatures)), f"history: {at}.signature", "expected one of the signatures")
    strata = arrays[f"{at}.stratum"]
    _require(_within(strata, 0, len(table.strata)), f"history: {at}.stratum", "expected one of the states")
    bodies = arrays[f"{at}.bodies"]
    for number, signature in enumerate(signatures):
        _check_bodies(bodies[ids == number], signature, f"history: {at}.bodies")
    serial = arrays[f"{at}.serial"]
    _require(
        n == 0 or ((np.diff(serial) > 0).all() and serial[0] >= 0),
        f"history: {at}.serial",
        "expected an order",
    )
    _require(n == 0 or serial[-1] < table.seen, f"history: {at}.serial", "there are more rows than were seen")


def _check_bodies(bodies: NDArray[Any], signature: SlotSignature, where: str) -> None:
    """Each slot of a body holds another one, and the other slots none."""
    bodily = [k for k, t in enumerate(signature.types) if t.has_body]
    rest = np.delete(bodies, bodily, axis=1)
    _require((rest == -1).all(), where, "expected -1 for what has no body")
    expected = np.broadcast_to(np.arange(len(bodily)), (len(bodies), len(bodily)))
    _require(np.array_equal(np.sort(bodies[:, bodily], axis=1), expected), where, "expected every body once")


def _check_examples(
    model: PropertyRecord,
    target: Target,
    signatures: Sequence[SlotSignature],
    arrays: _Arrays,
    table: str,
    at: str,
) -> None:
    ids = [mode.id for mode in model.clusterer.modes]
    y = arrays[f"{at}.y"]
    _require(_sized(y), f"history: {at}.y", _SIZED)
    labels = arrays[f"{at}.labels"]
    _require(np.isin(labels, [0, *ids]).all(), f"history: {at}.labels", f"expected 0 or one of {ids}")
    rows = arrays[f"{at}.rows"]
    _require(_within(rows, 0, len(arrays[f"{table}.x"])), f"history: {at}.rows", "expected rows of the table")
    _distinct(rows.tolist(), f"history: {at}.rows")
    dropped = arrays[f"{at}.forgotten"]
    _require(_within(dropped, 0, 2**53), f"history: {at}.forgotten", "expected modes and numbers of examples")
    _distinct(dropped[:, 0].tolist(), f"history: {at}.forgotten")
    within = _within(dropped[:, 0], 0, model.clusterer.next_id)
    _require(within, f"history: {at}.forgotten", "examples of a mode that never was")
    passed = [mode for mode, _ in model.clusterer.passed]
    _distinct(passed, f"{at}: passed")
    _require(max(passed, default=0) < model.clusterer.next_id, f"{at}: passed", "a mode that never was")
    _require(len(y) or not ids, f"history: {at}.y", "there are modes, but no examples")
    exemplars = model.classifier.exemplars
    if exemplars is not None:
        numbers = np.frombuffer(base64.b64decode(exemplars.columns.arrays["row"]), dtype="int64")
        _require(_within(numbers, 0, len(y)), f"history: {at}", "examples are remembered that aren't there")
    seen = arrays[f"{table}.signature"][rows]
    known = {i for i, _, _ in model.clusterer.searches}
    _require(all(i < len(signatures) for i in known), f"history: {at}", "a search of rows that aren't there")
    for mode in model.clusterer.modes:
        function = Mode.from_json(target, _plain(mode))
        for number in np.unique(seen[labels == mode.id]).tolist():
            bound = bind(function, signatures[number])
            _require(
                bound is not None, f"history: {at}.labels", f"mode {mode.id} can't explain what it is said to"
            )


def _plain(mode: ModeRecord) -> dict[str, Any]:
    roles = [{"type": role.type, "terms": role.terms} for role in mode.roles]
    return {
        "id": mode.id,
        "frame": mode.frame,
        "roles": roles,
        "intercept": mode.intercept,
        "examples": mode.examples,
        "sigma": mode.sigma,
    }
