"""A world model as records and as text: tables 3.1-3.2 and 4.2-4.5, and the roles of Figure 3.8."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from relgym.classification.binary import BinaryClassifier
from relgym.classification.role_classifier import RoleKind
from relgym.clustering.mode import Mode
from relgym.errors import ConfigError
from relgym.laws.text import LEGEND, LawRow, WorldRow, law_rows, world_rows
from relgym.model.advice import Advice
from relgym.model.text import Cell, amount, indented, table, wrapped

if TYPE_CHECKING:
    from relgym.model.property_model import PropertyModel
    from relgym.model.world_model import WorldModel

__all__ = [
    "ClauseRow",
    "ModeRow",
    "ModelReport",
    "PairTable",
    "RoleRow",
    "TargetReport",
    "describe",
    "report",
]

_CLAUSE_WIDTH = 62
"""Widest column of clauses, in characters; longer clauses continue on the next line."""

_FUNCTION_WIDTH = 76
"""The same for functions: a report fits a terminal of 100 columns."""

_ROUNDING = 0.1
"""A spread below this fraction of the noise assumed is not worth telling."""

_OTHERWISE = "otherwise"


@dataclass(frozen=True, slots=True)
class ModeRow:
    """One row of Table 4.2.

    Attributes
    ----------
    mode
        Its id, by which predictions and clauses (``F3``) name it.
    examples
        Training examples that it explains and that were assigned to it.
    function
        Such as ``vx' = -0.9 vx``.
    spread
        How far examples scatter about it, where that is more than rounding; empty otherwise.
    """

    mode: int
    examples: int
    function: str
    spread: str = ""


@dataclass(frozen=True, slots=True)
class ClauseRow:
    """One row of Table 4.3.

    Attributes
    ----------
    clause
        The clause; ``otherwise`` for the examples that no clause covers (the thesis' row "Negative").
    correct, incorrect
        Training examples that were decided here, rightly and wrongly: those that just one of the two modes
        explains, whichever mode they belong to. Estimates, where only a sample of them is remembered.
    tests
        Leaves of the decision tree behind the clause (§3.4.4), one line each; empty if there is none.
    """

    clause: str
    correct: float
    incorrect: float
    tests: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class PairTable:
    """One section of Table 4.3: how two modes are told apart.

    Attributes
    ----------
    mode
        The mode that the clauses speak for.
    rival
        The mode that holds otherwise.
    rows
        Clauses in the order in which they are tried.
    """

    mode: int
    rival: int
    rows: tuple[ClauseRow, ...]

    @property
    def performance(self) -> float:
        """Share of the training examples that the pair gets right, "train perf."; 1 without any."""
        right, wrong = (sum(n) for n in zip(*((r.correct, r.incorrect) for r in self.rows), strict=True))
        return right / (right + wrong) if right + wrong > 0 else 1.0


@dataclass(frozen=True, slots=True)
class RoleRow:
    """One box of Figure 3.8.

    Attributes
    ----------
    mode
        Whose function reads the role.
    type
        The objects' type.
    roles
        What the function calls the objects; several where they are interchangeable.
    rule
        What must hold of such an object B, A being the target; empty if any object of the type will do.
    """

    mode: int
    type: str
    roles: tuple[str, ...]
    rule: str


@dataclass(frozen=True, slots=True)
class TargetReport:
    """All that is known of one target.

    Attributes
    ----------
    target
        Such as ``ball.vx``.
    type
        The target objects' type, clauses' variable A.
    noise
        Training examples that no mode explains.
    modes, pairs, roles
        The tables' rows. Roles without a body (the action) are left out: there is only one such object.
    advice
        What the target lacks, if modes don't explain it.
    """

    target: str
    type: str
    noise: int
    modes: tuple[ModeRow, ...]
    pairs: tuple[PairTable, ...]
    roles: tuple[RoleRow, ...]
    advice: Advice | None = None

    @property
    def examples(self) -> int:
        """Number of training examples, noise included."""
        return self.noise + sum(mode.examples for mode in self.modes)

    def __str__(self) -> str:
        if not self.modes:
            return f"{self.target}: no mode learned yet, {amount(self.examples, 'example')}{self._advice()}"
        head = f"{self.target}: {amount(len(self.modes), 'mode')}, {amount(self.examples, 'example')}"
        parts = [head, indented(_mode_table(self))]
        if self.pairs:
            parts.append(indented(_clause_table(self.pairs)))
        if self.roles:
            parts.append(indented(_role_table(self.roles)))
        return "\n\n".join(parts) + self._advice()

    def _advice(self) -> str:
        if self.advice is None:
            return ""
        first, *rest = wrapped(str(self.advice), _FUNCTION_WIDTH, "+-")
        return "\n\n" + "\n".join([f"  advice: {first}", *(f"          {line}" for line in rest)])


@dataclass(frozen=True, slots=True)
class ModelReport:
    """A whole model as tables; its text is what `describe` returns.

    Attributes
    ----------
    transitions
        How many it has learned from.
    targets
        Tables of the targets that modes predict.
    laws
        Laws of motion that are in force, a sentence each; they predict the targets that have no tables.
    """

    transitions: int
    targets: tuple[TargetReport, ...]
    laws: tuple[LawRow, ...] = ()

    def __str__(self) -> str:
        if not self.targets and not self.laws:
            return f"No targets yet: nothing changed in {amount(self.transitions, 'transition')}."
        head = f"Learned from {amount(self.transitions, 'transition')}."
        parts = [head, *([_law_text(self.laws)] if self.laws else [])]
        parts += [f"{'─' * 80}\n{target}" for target in self.targets]
        legend = _legend(self.targets)
        return "\n\n".join([*parts, f"{'─' * 80}\n{legend}"] if legend else parts)


def report(model: WorldModel, *, digits: int = 7) -> ModelReport:
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
    digits: int = 7,
    frame: str | None = None,
    incline: float | Sequence[float] = (0.0, 90.0),
) -> str:
    """Laws, modes, functions, clauses and roles of every target as text, for people.

    Parameters
    ----------
    model
        The model; unchanged.
    digits
        Significant digits of coefficients.
    frame
        ``"world"``: behind the laws, also the functions along the world's axes that follow from them.
    incline
        For which surfaces: their angles in degrees (`relgym.laws.text.world_rows`).

    Raises
    ------
    ConfigError
        Another frame; or ``"world"`` where the laws in force aren't stated along the normals of a planar world.
    """
    if frame not in (None, "world"):
        raise ConfigError(f"frame={frame!r}: expected None (as learned) or 'world'")
    text = str(report(model, digits=digits))
    if frame is None or model.laws is None or not model.governed:
        return text
    angles = (incline,) if isinstance(incline, (int, float)) else tuple(incline)
    tables = [
        _world_text(name, angle, world_rows(model.laws, name, angle, digits))
        for name in sorted(model.governed)
        for angle in angles
    ]
    return "\n\n".join([text, *tables])


def _law_text(rows: tuple[LawRow, ...]) -> str:
    lines = [[str(r), r.examples or "", r.unexplained if r.examples else ""] for r in rows]
    return f"{'─' * 80}\n{table(['law', 'examples', 'unexplained'], lines)}\n\n{LEGEND}"


def _world_text(name: str, incline: float, rows: tuple[WorldRow, ...]) -> str:
    lines: list[list[Cell] | str] = []
    for row in rows:
        lines.append(f"where {row.case}:")
        lines += [[f"  {function}"] for function in row.functions]
    return table([f"{name} touching a surface at {incline:g} degrees, along the world's axes"], lines)


def _target_report(part: PropertyModel, digits: int, advice: Advice | None) -> TargetReport:
    modes = tuple(ModeRow(m.id, m.examples, _function(part, m, digits), _spread(part, m)) for m in part.modes)
    pairs = tuple(_pair_table(c) for c in part.classifier.classifiers)
    return TargetReport(
        str(part.target),
        part.target.type,
        part.clusterer.noise_examples,
        modes,
        pairs,
        _role_rows(part),
        advice,
    )


def _function(part: PropertyModel, mode: Mode, digits: int) -> str:
    if mode.id not in part.limits:
        return mode.formula(digits)
    side = "least" if mode.id == part.limits.low else "most"
    return f"{mode.formula(digits)} at {side}: a limit to what the others predict"


def _spread(part: PropertyModel, mode: Mode) -> str:
    """A mode's spread in words, action by action where they differ much."""
    known = part.spreads.by_mode.get(mode.id)
    if known is None or known.whole <= max(part.clusterer.floor, _ROUNDING * part.clusterer.scale.sigma):
        return ""
    if not known.uneven():
        return f"± {known.whole:.2g}"
    texts = (f"± {s:.2g} after {', '.join(f'{x:g}' for x in a)}" for a, s in known.by_action.items())
    return "; ".join(texts)


def _pair_table(classifier: BinaryClassifier) -> PairTable:
    trees = (*classifier.clause_trees, classifier.fall_through_tree)
    rows = [
        ClauseRow(name, right, wrong, () if tree is None else tree.rules())
        for (name, right, wrong, _), tree in zip(classifier.describe(), trees, strict=True)
    ]
    rows[-1] = ClauseRow(_OTHERWISE, rows[-1].correct, rows[-1].incorrect, rows[-1].tests)
    # §3.4.5: a negated definition's clauses describe mode j.
    rival = classifier.i if classifier.positive == classifier.j else classifier.j
    return PairTable(classifier.positive, rival, tuple(rows))


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
    return tuple(rows)


# ------------------------------------------------------------------ text
def _mode_table(target: TargetReport) -> str:
    noise = "noise"
    if target.noise:
        noise += f": no mode explains these {100.0 * target.noise / target.examples:.2g} %"
    rows: list[list[Cell]] = [[0, target.noise, noise]]
    for m in target.modes:
        first, *rest = wrapped(m.function, _FUNCTION_WIDTH, "+-")
        rows.append([m.mode, m.examples, first])
        rows += [["", "", f"      {line}"] for line in rest]
        rows += [["", "", f"      {line}"] for line in wrapped(m.spread, _FUNCTION_WIDTH, "a") if line]
    return table(["mode", "examples", "function"], rows)


def _clause_table(pairs: tuple[PairTable, ...]) -> str:
    """All pairs' clauses under one heading, so that the columns of all pairs line up."""
    rows: list[list[Cell] | str] = []
    for pair in pairs:
        rows.append(f"mode {pair.mode} rather than {pair.rival}  (training accuracy {pair.performance:.4f})")
        for row in pair.rows:
            first, *rest = wrapped(row.clause, _CLAUSE_WIDTH, "∧")
            rows.append(
                [f"  {first}", round(row.correct), round(row.incorrect), "yes" if row.tests else "no"]
            )
            rows += [f"    {line}" for line in rest]
            rows += [f"      {test}" for test in row.tests]
    return table(["clauses", "correct", "incorrect", "tree"], rows)


def _role_table(roles: tuple[RoleRow, ...]) -> str:
    rows: list[list[Cell]] = []
    for r in roles:
        who = f"a {r.type} B with {r.rule}" if r.rule else f"any {r.type}"
        rows.append([r.mode, ", ".join(r.roles), who])
    return table(["mode", "role", "who plays it"], rows)


def _legend(targets: tuple[TargetReport, ...]) -> str:
    """What the notation means, as far as it occurs."""
    pairs = [pair for target in targets for pair in target.pairs]
    text = " ".join(row.clause + " ".join(row.tests) for pair in pairs for row in pair.rows)
    lines = []
    if pairs:
        lines = [
            "mode i rather than j: the first clause that holds speaks for i; if none does, it is j.",
            "correct, incorrect: training examples that only one of the two modes explains.",
            "A is the object whose property is predicted; another letter says that there is such an object.",
        ]
    if "*" in text:
        lines.append("* is any object: ¬touching(A, *) says that A touches nothing.")
    if "F" in text:
        lines.append("F1 is what mode 1 would predict, F1 - F2 by how much two modes differ.")
    if any(row.tests for pair in pairs for row in pair.rows):
        lines.append(
            "tree: numeric tests behind a clause; yes: it speaks for mode i then (examples of i : of j)."
        )
    return "\n".join(lines)
