"""Rule lists: a model as ordered ``if / elif / else`` branches, one list for each property it predicts.

The text of a `RuleList` is complete: `relgym.reporting.parser.parse_rules` reads it back, and either one says what
follows a scene (`relgym.reporting.evaluation`).
"""

from __future__ import annotations

import base64
import builtins
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import LEFT_OPEN
from relgym.errors import ConfigError
from relgym.reporting.conditions import CONTEXTS, Condition, condition_text
from relgym.reporting.evaluation import evaluate
from relgym.reporting.functions import Sum, split_outside
from relgym.reporting.motion import MotionRules

if TYPE_CHECKING:
    from relgym.scene.objects import Scene, SceneLayout

__all__ = [
    "ENDED",
    "SEEN",
    "Bound",
    "Branch",
    "Derivation",
    "Experience",
    "PropertyRules",
    "RuleList",
    "RuleRole",
    "bound_text",
    "scope_text",
    "seen_of",
    "steps_text",
]

WIDTH = 96
"""Longest line, in characters, if its parts allow it."""

ENDED = "has ended: "
"""Before a function that held until the world changed."""

SEEN = "Situations seen; in others there is no prediction"
"""First line of the section of fingerprints."""

_NAME = re.compile(r"[^\W\d][\w-]*( [^\W\d][\w-]*)*")
_RESERVED = frozenset({"if", "elif", "else", "then", "and", "or", "not", "some", "no", "the", "any", "where"})


@dataclass(frozen=True, slots=True)
class Branch:
    """One line of a list.

    Attributes
    ----------
    cases
        Conditions of which one must hold, provided that no earlier branch does; none: always.
    name
        What they are called; empty: they are told in full.
    function
        The property's next value; ``None``: no prediction.
    reason
        Why there is no prediction.
    steps
        Training steps that go by it.
    wrong
        Of how many of them it isn't right, in the end: where nothing tells yet what follows, of most.
    spread
        Standard deviation of what it leaves, in units of the property; 0 where that is rounding.
    """

    cases: tuple[Condition, ...]
    function: Sum | None
    name: str = ""
    reason: str = ""
    steps: int = 0
    wrong: int = 0
    spread: float = 0.0

    @property
    def text(self) -> str:
        """The condition in full."""
        return " or ".join(map(condition_text, self.cases))


@dataclass(frozen=True, slots=True)
class Bound:
    """What has the last word on a value.

    Attributes
    ----------
    kind
        ``"at least"``, ``"at most"``: a limit; ``"if"``: a constant where a comparison holds, in which the property's
        own next value is what the branches say; ``"change within"``: how far approximations go.
    value
        The limit or constant; of ``"change within"`` the least change.
    most
        Of ``"change within"`` the largest change.
    tests
        Of ``"if"`` what must hold.
    steps
        Training steps at which it was reached.
    """

    kind: str
    value: float
    most: float = 0.0
    tests: Condition = ()
    steps: int = 0


@dataclass(frozen=True, slots=True)
class RuleRole:
    """Which object a name in a function stands for.

    Attributes
    ----------
    labels
        The names; several where objects are interchangeable.
    type
        The objects' type.
    alternatives
        Conditions of A and such an object B, the surest first; none: any object of the type.
    place
        Number of the object among the others of its type, in the scene's order; 0: it isn't told by that.
    """

    labels: tuple[str, ...]
    type: str
    alternatives: tuple[Condition, ...] = ()
    place: int = 0


@dataclass(frozen=True, slots=True)
class Experience:
    """The situations that a property's rules were learned from; of others they say nothing.

    Attributes
    ----------
    relations
        For each context the binary and the unary relations that are looked at, in order.
    seen
        Fingerprints of the situations (`relgym.logic.situations`): their upper 24 bits, ascending.
    """

    relations: tuple[tuple[str, tuple[str, ...], tuple[str, ...]], ...]
    seen: tuple[int, ...]

    @property
    def told(self) -> str:
        """What is looked at."""
        parts = []
        for context, binary, unary in self.relations:
            word = CONTEXTS[context] or "all"
            parts.append(f"{word} ({', '.join(binary) or '-'}; {', '.join(unary) or '-'})")
        return ", ".join(parts)

    @property
    def prints(self) -> str:
        """The fingerprints as text, four characters each."""
        return base64.urlsafe_b64encode(b"".join(each.to_bytes(3, "big") for each in self.seen)).decode()


def seen_of(prints: str) -> tuple[int, ...]:
    """Inverse of `Experience.prints`; `ConfigError` for what that never gives."""
    try:
        data = base64.urlsafe_b64decode(prints)
    except ValueError as error:
        raise ConfigError(f"rules: expected fingerprints in base64 ({error}), got {prints!r:.60}") from None
    return tuple(int.from_bytes(data[k : k + 3], "big") for k in range(0, len(data), 3))


@dataclass(frozen=True, slots=True)
class PropertyRules:
    """The list of one property of all objects of a type.

    Attributes
    ----------
    type, property
        What it predicts.
    branches
        In the order in which they are tried. One whose function reads an object that isn't there is passed over.
    bounds
        What is applied to the value then, in order.
    roles
        The names of objects in functions.
    steps
        Training steps, those that nothing explains included.
    unexplained
        How many of them nothing explains.
    doubt
        Why the list makes no prediction although it has branches; empty: it predicts.
    advice
        What the property lacks, a sentence.
    experience
        Situations outside which there is no prediction; None: there is one everywhere.
    ended
        Functions that held until the world changed.
    """

    type: str
    property: str
    branches: tuple[Branch, ...]
    bounds: tuple[Bound, ...] = ()
    roles: tuple[RuleRole, ...] = ()
    steps: int = 0
    unexplained: int = 0
    doubt: str = ""
    advice: str = ""
    experience: Experience | None = None
    ended: tuple[str, ...] = ()

    @builtins.property  # `property` is a field here
    def target(self) -> str:
        """Such as ``ball.vx``."""
        return f"{self.type}.{self.property}"

    @builtins.property  # `property` is a field here
    def names(self) -> dict[str, str]:
        """Named conditions, in full."""
        return {b.name: b.text for b in self.branches if b.name}

    def renamed(self, names: Mapping[str, str]) -> PropertyRules:
        """The list with other names for conditions: their present name or their text to the new one."""
        found = []
        for branch in self.branches:
            new = names.get(branch.text, names.get(branch.name, branch.name)) if branch.cases else ""
            found.append(replace(branch, name=new))
        return replace(self, branches=tuple(found))

    def __str__(self) -> str:
        return self.text()

    def text(self, digits: int = 7) -> str:
        """The list as text, numbers of functions with so many significant digits."""
        lines = [f"{self.target}'  ({_steps(self.steps)})"]
        if self.doubt:
            lines.append(f"  no prediction: {self.doubt}")
        lines += _branch_lines(self, digits)
        lines += [f"  {bound_text(bound, '', digits)}" for bound in self.bounds]
        if self.unexplained and self.branches:
            share = 100.0 * self.unexplained / max(self.steps, 1)
            lines.append(
                f"  {self.unexplained:,} of these steps ({share:.2g} %) follow none of these functions"
            )
        for function in self.ended:
            first, *rest = _wrapped(function, WIDTH - 20, (" + ", " - ", " "))
            lines += [f"  {ENDED}{first}", *(f"    | {line}" for line in rest)]
        told = [*_role_lines(self.roles), *_name_lines(self.branches)]
        if told:
            lines += ["", *told]
        if self.advice:
            first, *rest = _wrapped(self.advice, WIDTH - 10, ("; ", " + ", " - ", ", ", " "))
            lines += ["", f"  advice: {first}", *(f"    | {line}" for line in rest)]
        return "\n".join(lines)

    def plain(self, digits: int = 7) -> dict[str, Any]:
        """The list as dicts, lists and texts: conditions and functions as they are printed, numbers as numbers."""
        return {
            "property": self.target,
            "steps": self.steps,
            "unexplained": self.unexplained,
            "doubt": self.doubt,
            "advice": self.advice,
            "branches": [
                {
                    "if": branch.text if branch.cases else None,
                    "name": branch.name,
                    "value": None if branch.function is None else branch.function.text(digits),
                    "reason": branch.reason,
                    "steps": branch.steps,
                    "wrong": branch.wrong,
                    "spread": branch.spread,
                }
                for branch in self.branches
            ],
            "bounds": [bound_text(bound, digits=digits).removeprefix("then ") for bound in self.bounds],
            "ended": list(self.ended),
            "roles": [
                {
                    "names": [*role.labels],
                    "type": role.type,
                    "if": [*map(condition_text, role.alternatives)],
                    "place": role.place or None,
                }
                for role in self.roles
            ],
            "situations": None if self.experience is None else len(self.experience.seen),
        }


@dataclass(frozen=True, slots=True)
class Derivation:
    """A declared law of kinematics: ``property' = property + step * rate'``, or ``* rate`` of the present."""

    type: str
    property: str
    rate: str
    step: float = 1.0
    uses_next: bool = True

    def __str__(self) -> str:
        rate = f"{self.rate}'" if self.uses_next else self.rate
        terms = Sum(((1.0, self.property), (self.step, rate)))
        return f"{self.type}.{self.property}' = {terms.text(17)}"


@dataclass(frozen=True, slots=True)
class RuleList:
    """A whole model as text.

    Attributes
    ----------
    transitions
        How many it was learned from.
    scope
        Type, and the smallest and largest number of its objects in scenes that it was learned from.
    properties
        A list of each property, in the order in which they are predicted.
    motion
        Laws of motion; they predict the velocities that have no list.
    kinematics
        What follows from them.
    agreement
        How well the text agreed with the model, as it was last measured; empty: it wasn't.
    """

    transitions: int
    scope: tuple[tuple[str, int, int], ...] = ()
    properties: tuple[PropertyRules, ...] = ()
    motion: MotionRules | None = None
    kinematics: tuple[Derivation, ...] = ()
    agreement: str = ""

    def __getitem__(self, target: str) -> PropertyRules:
        """The list of a property such as ``"ball.vx"``; KeyError if there is none."""
        for each in self.properties:
            if each.target == target:
                return each
        raise KeyError(f"no rules of {target!r}; there are {[p.target for p in self.properties]}")

    @property
    def names(self) -> dict[str, dict[str, str]]:
        """Named conditions of every property."""
        return {p.target: p.names for p in self.properties}

    def predict(self, scene: Scene) -> dict[tuple[str, str], float]:
        """What follows a scene.

        Returns
        -------
        Next value by (object, property); NaN where the list makes no prediction.
        """
        found = evaluate(self, scene.schema, scene.layout, scene.vector[None])
        return {key: float(values[0]) for key, values in found.values.items()}

    def predict_batch(
        self, schema: Any, layout: SceneLayout, vectors: NDArray[np.float64]
    ) -> dict[tuple[str, str], NDArray[np.float64]]:
        """The same for n scenes with the same objects, state vectors of shape ``(n, layout.width)``."""
        return evaluate(self, schema, layout, vectors).values

    def renamed(self, names: Mapping[str, str]) -> RuleList:
        """The same rules with other names for conditions.

        Parameters
        ----------
        names
            From a condition's present name, or its text, to the new one.

        Raises
        ------
        ConfigError
            A name that isn't made of words, that is reserved, or that two conditions of a property would share.
        """
        for name in names.values():
            check_name(name)
        found = tuple(p.renamed(names) for p in self.properties)
        for part in found:
            used = [b.name for b in part.branches if b.name]
            twice = sorted({name for name in used if used.count(name) > 1})
            if twice:
                raise ConfigError(f"names: two conditions of {part.target} would be called {twice[0]!r}")
        return replace(self, properties=found)

    def __str__(self) -> str:
        return self.text()

    def text(self, digits: int = 7) -> str:
        """The rules as text, numbers of functions with so many significant digits."""
        if not self.properties and self.motion is None:
            return f"No targets yet: nothing changed in {_amount(self.transitions, 'transition')}."
        head = [f"Learned from {_amount(self.transitions, 'transition')}."]
        if self.scope:
            head.append(scope_text(self.scope))
        if self.agreement:
            head += _wrapped(f"Agreement: {self.agreement}", WIDTH, (" ",))
        parts = ["\n".join(head)]
        parts += [] if self.motion is None else [self.motion.text(digits)]
        parts += [p.text(digits) for p in self.properties]
        seen = [p for p in self.properties if p.experience is not None]
        if self.kinematics:
            parts.append("\n".join(["Declared kinematics", *(f"  {each}" for each in self.kinematics)]))
        if seen:
            parts.append("\n".join([SEEN, *(line for p in seen for line in _seen_lines(p))]))
        legend = self._legend()
        return "\n\n".join([*parts, legend] if legend else parts)

    def plain(self, digits: int = 7) -> dict[str, Any]:
        """What `text` prints as dicts, lists and texts, ready for JSON.

        Parameters
        ----------
        digits
            Significant digits of the coefficients of functions.

        Returns
        -------
        ``transitions``, ``objects`` (the fewest and the most of each type in training), ``agreement``, ``motion`` (laws
        as sentences, a text or None), ``properties`` (a dict each: `PropertyRules.plain`) and ``kinematics``.
        """
        return {
            "transitions": self.transitions,
            "objects": {name: [least, most] for name, least, most in self.scope},
            "agreement": self.agreement,
            "motion": None if self.motion is None else self.motion.text(digits),
            "properties": [part.plain(digits) for part in self.properties],
            "kinematics": [*map(str, self.kinematics)],
        }

    def _repr_html_(self) -> str:
        import html

        return f"<pre>{html.escape(str(self))}</pre>"

    def _legend(self) -> str:
        text = "\n".join(str(p) for p in self.properties)
        lines = []
        if "(A" in text or ", A" in text:
            lines.append("A: the object whose property is predicted.")
        if " close " in text:
            lines.append("close: A and all that touches it, or else what is nearest.")
        if " struck " in text:
            lines.append("struck: A and what it approaches fastest of all that it touches.")
        if re.search(r"\b(some|no) [B-Z](, [B-Z])* \[", text):
            lines.append("some B, no B: among all objects of the scene.")
        if any(len(p.branches) > 1 for p in self.properties):
            lines.append(
                "Branches are tried in order; steps: training steps that go by it; ±: what it leaves there."
            )
        if any(_often_wrong(branch) for p in self.properties for branch in p.branches):
            lines.append(
                "right: for so many of them what is said holds, if not for nearly all; ± is of these."
            )
        return "\n".join(f"# {line}" for line in lines)


def _seen_lines(part: PropertyRules) -> list[str]:
    assert part.experience is not None, "checked by the caller"
    prints = part.experience.prints
    pieces = [prints[k : k + 88] for k in range(0, len(prints), 88)]
    told = f"{part.target}: {len(part.experience.seen):,}, told apart by {part.experience.told}"
    first, *rest = _wrapped(told, WIDTH - 4, (" ",))
    return [f"  {first}", *(f"    | {line}" for line in rest), *(f"    = {piece}" for piece in pieces)]


def check_name(name: str) -> None:
    """Raise `ConfigError` where a text can't be a condition's name."""
    if not _NAME.fullmatch(name) or set(name.split()) & _RESERVED:
        raise ConfigError(
            f"name {name!r}: expected words of letters, digits and hyphens, none of them {sorted(_RESERVED)}"
        )


def scope_text(scope: Iterable[tuple[str, int, int]]) -> str:
    """What was seen, such as ``Scenes held ball × 1, box × 2 to 3; ...``."""
    told = []
    for name, least, most in scope:
        count = f"{least}" if least == most else f"{least} to {most}"
        told.append(f"{name} × {count}")
    return f"Scenes held {', '.join(told)}; other numbers of objects were never seen."


def _often_wrong(branch: Branch) -> bool:
    return branch.function is not None and branch.wrong > LEFT_OPEN * branch.steps


def steps_text(branch: Branch) -> tuple[str, str]:
    """Number of steps and spread, as columns; and of how many it is right, unless that is nearly all of them."""
    right = f", {branch.steps - branch.wrong:,} right" if _often_wrong(branch) else ""
    return f"{_steps(branch.steps)}{right}", f"± {branch.spread:.2g}"


def _steps(steps: int) -> str:
    return _amount(steps, "step")


def _amount(count: int, noun: str) -> str:
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def _branch_lines(rules: PropertyRules, digits: int) -> list[str]:
    rows = []
    for number, branch in enumerate(rules.branches):
        if branch.cases:
            head = f"{'elif' if number else 'if  '} {branch.name or branch.text}:"
        else:
            head = "else:" if number else "always:"
        if branch.function is None:
            said = f"no prediction ({branch.reason})" if branch.reason else "no prediction"
        else:
            said = f"{rules.property}' = {branch.function.text(digits)}"
        stats = "  ".join(steps_text(branch)) if branch.function is not None else ""
        rows.append((head, said, stats))
    heads = [len(head) for head, _, _ in rows if len(head) <= 40]
    margin = max(heads, default=0) + 2
    room = max(24, WIDTH - margin - 26)
    said_width = max((min(len(said), room) for _, said, stats in rows if stats), default=0)
    counts = max((len(stats.split("  ")[0]) for _, _, stats in rows if stats), default=0)
    lines = []
    for head, said, stats in rows:
        first, *rest = _wrapped(said, room, (" + ", " - "))
        aligned = ""
        if stats:
            steps, spread = stats.split("  ", 1)
            aligned = f"  {steps.rjust(counts)}  {spread}"
        if len(head) + 2 > margin:
            lines.append(f"  {head}")
            lines.append(f"  {' ' * margin}{first.ljust(said_width)}{aligned}".rstrip())
        else:
            lines.append(f"  {head.ljust(margin)}{first.ljust(said_width)}{aligned}".rstrip())
        lines += [f"  {' ' * margin}  {more}" for more in rest]
    return lines


def bound_text(bound: Bound, prop: str = "", digits: int = 7) -> str:
    """A bound in words; with a property's name for an explanation, else as a line of its rules."""
    steps = f"  ({_steps(bound.steps)})" if bound.steps and not prop else ""
    head = "" if prop else "then "
    if bound.kind == "change within":
        return f"the change within {bound.value:.{digits}g} and {bound.most:.{digits}g}"
    if bound.kind == "if" and prop:
        return f"{bound.value:.{digits}g}, as the rule alone would lead to {condition_text(bound.tests)}"
    if bound.kind == "if":
        return f"{head}if {condition_text(bound.tests)}: {bound.value:.{digits}g}{steps}"
    return f"{head}{bound.kind} {bound.value:.{digits}g}{steps}"


def _role_lines(roles: Iterable[RuleRole]) -> list[str]:
    lines = []
    for role in roles:
        names = ", ".join(role.labels)
        if role.place:
            lines.append(f"  {names} := number {role.place} of the other objects of type {role.type}")
            continue
        if not role.alternatives:
            lines.append(f"  {names} := any {role.type}")
            continue
        rules = " or ".join(map(condition_text, role.alternatives))
        first, *rest = _wrapped(f"the {role.type} B where {rules}", WIDTH - len(names) - 6, (" and ", " or "))
        lines += [f"  {names} := {first}", *(f"    | {line}" for line in rest)]
    return lines


def _name_lines(branches: Iterable[Branch]) -> list[str]:
    named = {b.name: b.text for b in branches if b.name}
    width = max(map(len, named), default=0)
    lines = []
    for name, text in named.items():
        for number, case in enumerate(split_outside(text, " or ")):
            first, *rest = _filled(split_outside(case, " and "), WIDTH - width - 10)
            lines.append(
                f"  {name.ljust(width)} := {first}" if not number else f"  {' ' * width}  | or {first}"
            )
            lines += [f"  {' ' * width}  |    {line}" for line in rest]
    return lines


def _filled(parts: list[str], width: int) -> list[str]:
    """Conjuncts on lines of at most so many characters."""
    lines = [parts[0]]
    for part in parts[1:]:
        if len(lines[-1]) + 5 + len(part) <= width:
            lines[-1] += f" and {part}"
        else:
            lines.append(f"and {part}")
    return lines


def _wrapped(text: str, width: int, marks: tuple[str, ...]) -> list[str]:
    """Lines of at most so many characters, broken at the blank before (or after) a mark, if there is one."""
    lines, rest = [], text
    while len(rest) > width:
        cuts = [at + (mark in ("; ", ", ")) for mark in marks if (at := rest.rfind(mark, 1, width)) > 0]
        cut = max(cuts, default=-1)
        if cut < 0:
            found = [at for mark in marks if (at := rest.find(mark, 1)) > 0]
            if not found:
                break
            cut = min(found)
        lines.append(rest[:cut])
        rest = rest[cut + 1 :]
    return [*lines, rest]
