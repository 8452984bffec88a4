"""Tables of a model, as records and as text: 3.1-3.2 and 4.2-4.5, and the roles of Figure 3.8."""

from __future__ import annotations

from dataclasses import dataclass

from relgym.html import html_text
from relgym.laws.text import LEGEND, LawRow
from relgym.model.reports.advice import Advice
from relgym.model.reports.text import Cell, amount, indented, percent, table, wrapped

__all__ = ["ClauseRow", "ModeRow", "ModelReport", "PairTable", "RoleRow", "TargetReport"]

_CLAUSE_WIDTH = 62
"""Widest column of clauses, in characters; longer clauses continue on the next line."""

_FUNCTION_WIDTH = 76
"""The same for functions: a report fits a terminal of 100 columns."""


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
        The clause; ``else`` for the examples that no clause covers (the thesis' row "Negative").
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
    other
        The mode that holds if no clause does.
    rows
        Clauses in the order in which they are tried.
    """

    mode: int
    other: int
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
    place
        Number of the object among the others of its type, in the scene's order; 0: it isn't told by that.
    """

    mode: int
    type: str
    roles: tuple[str, ...]
    rule: str
    place: int = 0


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
    beyond
        Tests of the places where modes don't speak (`relgym.model.target.scope`).
    record
        How its predictions came out, in a sentence; empty if nobody looked back at them.
    """

    target: str
    type: str
    noise: int
    modes: tuple[ModeRow, ...]
    pairs: tuple[PairTable, ...]
    roles: tuple[RoleRow, ...]
    advice: Advice | None = None
    beyond: tuple[str, ...] = ()
    record: str = ""

    @property
    def examples(self) -> int:
        """Number of training examples, noise included."""
        return self.noise + sum(mode.examples for mode in self.modes)

    def __str__(self) -> str:
        if not self.modes:
            head = f"{self.target}: no mode learned yet, {amount(self.examples, 'example')}"
            return f"{head}{self._record()}{self._advice()}"
        head = f"{self.target}: {amount(len(self.modes), 'mode')}, {amount(self.examples, 'example')}"
        parts = [head, indented(_mode_table(self))]
        if self.beyond:
            parts.append("\n".join(["  where no mode speaks:", *(f"    {t}" for t in self.beyond)]))
        if self.pairs:
            parts.append(indented(_clause_table(self.pairs)))
        if self.roles:
            parts.append(indented(_role_table(self.roles)))
        return "\n\n".join(parts) + self._record() + self._advice()

    def _record(self) -> str:
        return f"\n\n  record: {self.record}" if self.record else ""

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

    def _repr_html_(self) -> str:
        return html_text(f"Learned from {amount(self.transitions, 'transition')}", str(self))


def _mode_table(target: TargetReport) -> str:
    noise = "noise"
    if target.noise:
        noise += f": no mode explains these {percent(target.noise / target.examples)}"
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
        rows.append(f"mode {pair.mode} rather than {pair.other}  (training accuracy {pair.performance:.4f})")
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
        who = f"number {r.place} of the other objects of type {r.type}" if r.place else who
        rows.append([r.mode, ", ".join(r.roles), who])
    return table(["mode", "role", "bound to"], rows)


def _legend(targets: tuple[TargetReport, ...]) -> str:
    """What the notation means, as far as it occurs."""
    pairs = [pair for target in targets for pair in target.pairs]
    text = " ".join(row.clause + " ".join(row.tests) for pair in pairs for row in pair.rows)
    lines = []
    if pairs:
        lines = [
            "mode i rather than j: the first clause that holds speaks for i; if none does, it is j.",
            "correct, incorrect: training examples that only one of the two modes explains, estimated.",
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


def _law_text(rows: tuple[LawRow, ...]) -> str:
    lines = [[str(r), r.examples or "", r.unexplained if r.examples else ""] for r in rows]
    return f"{'─' * 80}\n{table(['law', 'examples', 'unexplained'], lines)}\n\n{LEGEND}"
