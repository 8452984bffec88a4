"""A world model read into tables, and told as text."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from relgym.classification.binary import BinaryClassifier
from relgym.classification.role_classifier import RoleKind
from relgym.clustering.mode import Mode
from relgym.config.constants import DIGITS, ROUGH
from relgym.errors import ConfigError
from relgym.laws.text import LawRow, WorldRow, law_rows, world_rows
from relgym.model.predicting.prediction import OUTCOMES, Outcome
from relgym.model.reports.advice import Advice
from relgym.model.reports.rules import agreement
from relgym.model.reports.spread_text import spread_text
from relgym.model.reports.tables import ClauseRow, ModelReport, ModeRow, PairTable, RoleRow, TargetReport
from relgym.model.reports.text import SURFACES, Cell, as_relations, percent, table
from relgym.reporting.naming import named_text
from relgym.reporting.parser import parse_rules
from relgym.reporting.rules import RuleList
from relgym.scene.objects import ACTION, Scene

if TYPE_CHECKING:
    from relgym.model.target.property_model import PropertyModel
    from relgym.model.world_model import WorldModel

__all__ = [
    "ClauseRow",
    "ModeRow",
    "ModelReport",
    "PairTable",
    "RoleRow",
    "TargetReport",
    "checked_rules",
    "describe",
    "report",
]

_ELSE = "else"

_PREDICTED = OUTCOMES.index(Outcome.PREDICTED)


def report(model: WorldModel, *, digits: int = DIGITS) -> ModelReport:
    """Modes, clauses and roles of every target as records, for programs.

    Parameters
    ----------
    model
        The model; unchanged.
    digits
        Significant digits of coefficients.
    """
    advice = {a.target: a for a in model.advice()}
    parts = [
        model.property_model(target.type, target.property)
        for target in model.targets
        if not model.governs(target)
    ]
    laws: tuple[LawRow, ...] = ()
    if model.laws is not None and model.governed:
        laws = law_rows(model.laws, model.governed, digits)
    return ModelReport(
        model.seen, tuple(_target_report(part, digits, advice.get(str(part.target))) for part in parts), laws
    )


def describe(
    model: WorldModel,
    *,
    details: bool = False,
    digits: int = DIGITS,
    names: Mapping[str, str] | None = None,
    check: Iterable[Scene] | None = None,
    frame: str | None = None,
    incline: float | Sequence[float] = SURFACES,
) -> str:
    """A model as text, for people: its rules, or the tables behind them.

    Parameters
    ----------
    model
        The model; unchanged.
    details
        Tables of modes, functions, clauses and roles instead of rules; so they are of a model that has no rules
        (`WorldModel.has_rules`).
    digits
        Significant digits of coefficients.
    names
        Other names for conditions.
    check
        Scenes on which what the printed text says is compared with what the model says.
    frame
        ``"world"``: behind the laws, also the functions along the world's axes that follow from them.
    incline
        For which surfaces: their angles in degrees (`relgym.laws.text.world_rows`).

    Raises
    ------
    ConfigError
        Another frame; or ``"world"`` where the laws in force aren't stated along the normals of a planar world; a name
        that can't be one; or `names` or `check` with `details`.
    """
    if frame not in (None, "world"):
        raise ConfigError(f"frame={frame!r}: expected None (as learned) or 'world'")
    if details and (names or check is not None):
        raise ConfigError("details=True prints tables, which have no names and no agreement: leave them out")
    if details or (not model.has_rules and not names and check is None):
        text = str(report(model, digits=digits))
    else:
        text = checked_rules(model, digits, names, check).text(digits)
    if frame is None or model.laws is None or not model.governed:
        return text
    angles = (incline,) if isinstance(incline, (int, float)) else tuple(incline)
    tables = [
        _world_text(name, angle, world_rows(model.laws, name, angle, digits))
        for name in sorted(model.governed)
        for angle in angles
    ]
    return "\n\n".join([text, *tables])


def checked_rules(
    model: WorldModel,
    digits: int = DIGITS,
    names: Mapping[str, str] | None = None,
    check: Iterable[Scene] | None = None,
) -> RuleList:
    """A model's rules, with other names of conditions, and with how well the text agrees on some scenes.

    Parameters are those of `describe`, which prints them.
    """
    rules = model.rules()
    if names:
        rules = rules.renamed({named_text(rules, old): new for old, new in names.items()})
    if check is not None:
        measured, _ = agreement(model, parse_rules(rules.text(digits)), check)
        rules = replace(rules, agreement=measured.agreement)
    return rules


def _world_text(name: str, incline: float, rows: tuple[WorldRow, ...]) -> str:
    lines: list[list[Cell] | str] = []
    for row in rows:
        lines.append(f"where {row.case}:")
        lines += [[f"  {function}"] for function in row.functions]
    return table([f"{name} touching a surface at {incline:g} degrees, along the world's axes"], lines)


def _target_report(part: PropertyModel, digits: int, advice: Advice | None) -> TargetReport:
    modes = tuple(ModeRow(m.id, m.examples, _function(part, m, digits), _spread(part, m)) for m in part.modes)
    pairs = tuple(_pair_table(c, part.flags) for c in part.classifier.classifiers)
    return TargetReport(
        str(part.target),
        part.target.type,
        part.clusterer.population.unexplained,
        modes,
        pairs,
        _role_rows(part),
        advice,
        tuple(as_relations(tests, part.flags) for tests in part.fallback.scope.beyond()),
        _record(part),
    )


def _record(part: PropertyModel) -> str:
    """How a target's predictions came out; empty if nobody looked back at them."""
    known = part.calibration
    if not known.trials or not part.config.abstain:
        return ""
    kinds = list(known.kinds(_PREDICTED))
    trials = sum(count for _, count, _ in kinds)
    sure = sum(count for key, count, told in kinds if part.claims(key, told))
    share = 100.0 * sure / trials if trials else 0.0
    return (
        f"{share:.3g} % of what modes predicted lately is of a kind that is claimed; "
        f"{percent(known.slips)} of all was claimed and off by more than a claim may be"
    )


def _function(part: PropertyModel, mode: Mode, digits: int) -> str:
    if mode.id in part.stops:
        return f"{mode.formula(digits)} {part.stops.text(mode.id, part.target.property)}"
    if mode.id in part.past:
        return f"{mode.formula(digits)} has ended: others hold now"
    if mode.id not in part.limits:
        return mode.formula(digits)
    side = "least" if mode.id == part.limits.low else "most"
    return f"{mode.formula(digits)} at {side}: a limit to what the others predict"


def _spread(part: PropertyModel, mode: Mode) -> str:
    """A mode's spread in words, action by action where they differ much."""
    known = part.spreads.by_mode.get(mode.id)
    if known is None or known.whole <= max(part.clusterer.floor, part.clusterer.scale.sigma / ROUGH):
        return ""
    names = next((t.properties for t in part.schema.types if t.name == ACTION), ())
    return spread_text(known, names)


def _pair_table(classifier: BinaryClassifier, flags: frozenset[str]) -> PairTable:
    trees = (*classifier.clause_trees, classifier.fall_through_tree)
    rows = []
    for (name, right, wrong, _), tree in zip(classifier.describe(), trees, strict=True):
        tests = [as_relations(rule, flags) for rule in (() if tree is None else tree.rules())]
        rows.append(ClauseRow(as_relations(name, flags), right, wrong, tuple(tests)))
    rows[-1] = ClauseRow(_ELSE, rows[-1].correct, rows[-1].incorrect, rows[-1].tests)
    # §3.4.5: a negated definition's clauses describe mode j.
    other = classifier.i if classifier.positive == classifier.j else classifier.j
    return PairTable(classifier.positive, other, tuple(rows))


def _role_rows(part: PropertyModel) -> tuple[RoleRow, ...]:
    rows = []
    for mode in part.modes:
        alike: dict[RoleKind, list[str]] = {}
        for label, role in zip(mode.role_labels()[1:], mode.open_roles, strict=True):
            if role in part.casting.embodied(mode):
                alike.setdefault(RoleKind(*role.kind), []).append(label)
        known = part.casting.classifiers.get(mode.id)
        rules = {d.kind: d.definition for d in known.descriptions} if known is not None else {}
        for kind, labels in alike.items():
            rule = "" if rules.get(kind) is None else str(rules[kind])
            rows.append(RoleRow(mode.id, kind.type, tuple(labels), rule))
        placed = zip(mode.role_labels()[1:], mode.open_roles, part.functions.place(mode.id), strict=False)
        for label, role, number in placed:
            rows.append(RoleRow(mode.id, role.type, (label,), "", number + 1))
    return tuple(rows)
