"""Reads rule lists back from their text."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from relgym.errors import ConfigError
from relgym.reporting.conditions import CONTEXTS, Condition, parse_condition
from relgym.reporting.functions import Sum, number_of, parse_sum, split_outside, whole_of
from relgym.reporting.motion import HEADING, parse_motion
from relgym.reporting.rules import (
    ENDED,
    SEEN,
    Bound,
    Branch,
    Derivation,
    Experience,
    PropertyRules,
    RuleList,
    RuleRole,
    seen_of,
)

__all__ = ["parse_rules"]

_LEARNED = re.compile(r"Learned from ([\d,]+) transitions?\.")
_NOTHING = re.compile(r"No targets yet: nothing changed in ([\d,]+) transitions?\.")
_SCOPE = re.compile(r"Scenes held (.*); other numbers of objects were never seen\.")
_COUNT = re.compile(r"(\S+) × (\d+)(?: to (\d+))?")
_TARGET = re.compile(r"(?P<type>[^\s.]+)\.(?P<property>\S+)'  \((?P<steps>[\d,]+) steps?\)")
_STEPS = re.compile(r"([\d,]+) steps?(?:, ([\d,]+) right)?")
_UNEXPLAINED = re.compile(r"([\d,]+) of these steps \(.*\) follow none of these functions")
_PLACE = re.compile(r"number (\d+) of the other objects of type (.+)")
_BOUND = re.compile(r"then (at least|at most) (\S+?)(?:  \(([\d,]+) steps?\))?")
_IF = re.compile(r"then if (.*): (\S+?)(?:  \(([\d,]+) steps?\))?")
_WITHIN = re.compile(r"the change within (\S+) and (\S+)")
_EXPERIENCE = re.compile(r"(\S+): [\d,]+, told apart by (.*)")
_CONTEXT = {word or "all": context for context, word in CONTEXTS.items()}
_KINEMATICS = re.compile(r"([^\s.]+)\.(\S+)' = (.*)")


@dataclass
class _Draft:
    """A property's list as far as it was read."""

    type: str
    property: str
    steps: int
    branches: list[Branch] = field(default_factory=list)
    heads: list[str] = field(default_factory=list)
    bounds: list[Bound] = field(default_factory=list)
    roles: list[RuleRole] = field(default_factory=list)
    names: dict[str, tuple[Condition, ...]] = field(default_factory=dict)
    unexplained: int = 0
    doubt: str = ""
    advice: str = ""
    ended: list[str] = field(default_factory=list)

    def rules(self) -> PropertyRules:
        branches = tuple(self._named(*pair) for pair in zip(self.branches, self.heads, strict=True))
        return PropertyRules(
            self.type,
            self.property,
            branches,
            tuple(self.bounds),
            tuple(self.roles),
            self.steps,
            self.unexplained,
            self.doubt,
            self.advice,
            ended=tuple(self.ended),
        )

    def _named(self, branch: Branch, head: str) -> Branch:
        if not head:
            return branch
        if head in self.names:
            return replace(branch, cases=self.names[head], name=head)
        return replace(branch, cases=_cases(head))


def parse_rules(text: str) -> RuleList:
    """Read the text of a `RuleList`, as `WorldModel.describe` prints it.

    Returns
    -------
    The rules. Numbers are those that the text shows: print more digits for finer ones.

    Raises
    ------
    ConfigError
        A line that says nothing in this language; the message quotes it.
    """
    head, *sections = list(_sections(text)) or [[""]]
    transitions, scope, agreement = _head(head)
    found = RuleList(transitions, scope, agreement=agreement)
    for section in sections:
        first = section[0]
        if first == HEADING:
            found = replace(found, motion=parse_motion(section))
        elif first == "Declared kinematics":
            found = replace(found, kinematics=tuple(map(_derivation, section[1:])))
        elif first == SEEN:
            found = replace(found, properties=_experienced(found.properties, section[1:]))
        elif (match := _TARGET.fullmatch(first)) is not None:
            draft = _Draft(match["type"], match["property"], whole_of(match["steps"]))
            _read(draft, section[1:])
            found = replace(found, properties=(*found.properties, draft.rules()))
        else:
            raise ConfigError(f"rules: expected a property such as ball.vx'  (16 steps), got {first!r}")
    return found


def _sections(text: str) -> Iterator[list[str]]:
    """Sections of lines, the head first: each begins, after an empty line, with one that isn't indented.

    Continued lines are joined, comments left out.
    """
    section: list[str] = []
    fresh = False
    for line in text.rstrip().split("\n"):
        stripped = line.strip()
        if not stripped:
            fresh = True
        if not stripped or stripped.startswith("#"):
            continue
        if stripped.startswith("| ") and section:
            section[-1] += f" {stripped[2:].strip()}"
        elif line[0] != " " and section and fresh:
            yield section
            section = [line.rstrip()]
        else:
            section.append(line.rstrip())
        fresh = False
    if section:
        yield section


def _head(lines: list[str]) -> tuple[int, tuple[tuple[str, int, int], ...], str]:
    text, _, agreement = " ".join(lines).partition(" Agreement: ")
    if nothing := _NOTHING.match(text):
        return whole_of(nothing[1]), (), ""
    learned = _LEARNED.match(text)
    if learned is None:
        raise ConfigError(
            f"rules: expected 'Learned from N transitions.' at the beginning, got {text[:60]!r}"
        )
    scope = _SCOPE.search(text)
    counts = [] if scope is None else [_COUNT.fullmatch(part) for part in scope[1].split(", ")]
    return (
        whole_of(learned[1]),
        tuple((c[1], whole_of(c[2]), whole_of(c[3] or c[2])) for c in counts if c),
        agreement,
    )


def _experienced(properties: tuple[PropertyRules, ...], lines: list[str]) -> tuple[PropertyRules, ...]:
    known = {part.target: part for part in properties}
    target = ""
    for line in lines:
        text = line.strip()
        if match := _EXPERIENCE.fullmatch(text):
            target = match[1]
            told = [
                (_CONTEXT[part[1]], _list(part[2]), _list(part[3]))
                for part in re.finditer(r"(\w+) \((.*?); (.*?)\)", match[2])
            ]
            experience = Experience(tuple(told), ())
        elif text.startswith("= ") and target in known:
            before = known[target].experience
            assert before is not None, "the line before told what is looked at"
            experience = replace(before, seen=(*before.seen, *seen_of(text[2:])))
        else:
            raise ConfigError(f"rules: expected fingerprints of situations, got {text!r}")
        if target not in known:
            raise ConfigError(f"rules: situations of {target!r}, of which there are no rules")
        known[target] = replace(known[target], experience=experience)
    return tuple(known.values())


def _derivation(line: str) -> Derivation:
    match = _KINEMATICS.fullmatch(line.strip())
    terms = parse_sum(match[3]).terms if match else ()
    if match is None or len(terms) != 2 or terms[0] != (1.0, match[2]):
        raise ConfigError(f"rules: expected kinematics such as ball.px' = px + vx', got {line.strip()!r}")
    step, rate = terms[1]
    return Derivation(match[1], match[2], rate.removesuffix("'"), step, rate.endswith("'"))


def _read(draft: _Draft, lines: list[str]) -> None:
    waiting = ""
    for line in lines:
        text = line.strip()
        if waiting:
            _branch(draft, waiting, re.split(r" {2,}", text))
            waiting = ""
        elif re.match(r"(if|elif|else|always)\b", text):
            head, *rest = re.split(r" {2,}", re.sub(r"^if +", "if ", text))
            if rest:
                _branch(draft, head, rest)
            else:
                waiting = head
        elif re.match(r"[+-] ", text) and draft.branches and draft.branches[-1].function is not None:
            last = draft.branches[-1]
            whole = _joined(last.function, text)
            draft.branches[-1] = replace(last, function=whole)
        elif not _bound(draft, text) and not _rest(draft, text):
            raise ConfigError(
                f"rules of {draft.type}.{draft.property}: expected a branch or a name, got {text!r}"
            )


def _joined(function: Sum | None, text: str) -> Sum:
    assert function is not None, "checked by the caller"
    sign, _, rest = text.partition(" ")
    more = parse_sum(f"-{rest}" if sign == "-" else rest)
    return Sum((*function.terms, *more.terms), function.constant + more.constant)


def _branch(draft: _Draft, head: str, fields: list[str]) -> None:
    if not head.endswith(":"):
        raise ConfigError(f"rules of {draft.type}.{draft.property}: expected a colon after {head!r}")
    said, *stats = fields
    condition = re.sub(r"^(if|elif) |^(else|always)$", "", head[:-1])
    numbers = [match for stat in stats if (match := _STEPS.fullmatch(stat))]
    spreads = [number_of(stat[2:]) for stat in stats if stat.startswith("± ")]
    steps, right = (whole_of(each or numbers[0][1]) for each in numbers[0].groups()) if numbers else (0, 0)
    branch = Branch((), None, steps=steps, wrong=steps - right, spread=spreads[0] if spreads else 0.0)
    if said.startswith("no prediction"):
        branch = replace(branch, reason=said.removeprefix("no prediction").strip(" ()"))
    else:
        name, equals, function = said.partition("' = ")
        if not equals or name != draft.property:
            raise ConfigError(
                f"rules of {draft.type}.{draft.property}: expected {draft.property}' = ..., got {said!r}"
            )
        branch = replace(branch, function=parse_sum(function))
    draft.branches.append(branch)
    draft.heads.append(condition)


def _bound(draft: _Draft, text: str) -> bool:
    if match := _BOUND.fullmatch(text):
        draft.bounds.append(Bound(match[1], number_of(match[2]), steps=whole_of(match[3] or "0")))
    elif match := _IF.fullmatch(text):
        tests = parse_condition(match[1])
        draft.bounds.append(Bound("if", number_of(match[2]), tests=tests, steps=whole_of(match[3] or "0")))
    elif match := _WITHIN.fullmatch(text):
        draft.bounds.append(Bound("change within", number_of(match[1]), number_of(match[2])))
    return match is not None


def _rest(draft: _Draft, text: str) -> bool:
    if text.startswith(ENDED):
        draft.ended.append(text.removeprefix(ENDED))
    elif text.startswith("no prediction: "):
        draft.doubt = text.removeprefix("no prediction: ")
    elif text.startswith("advice: "):
        draft.advice = text.removeprefix("advice: ")
    elif match := _UNEXPLAINED.fullmatch(text):
        draft.unexplained = whole_of(match[1])
    elif " := " in text:
        name, said = (part.strip() for part in text.split(" := ", 1))
        if said.startswith("any "):
            draft.roles.append(RuleRole(tuple(name.split(", ")), said.removeprefix("any ")))
        elif match := _PLACE.fullmatch(said):
            draft.roles.append(RuleRole((name,), match[2], place=whole_of(match[1])))
        elif said.startswith("the ") and " B where " in said:
            kind, rules = said.removeprefix("the ").split(" B where ", 1)
            alternatives = _cases(rules, arity=2)
            draft.roles.append(RuleRole(tuple(name.split(", ")), kind, alternatives))
        else:
            draft.names[name] = _cases(said)
    else:
        return False
    return True


def _list(text: str) -> tuple[str, ...]:
    return () if text == "-" else tuple(text.split(", "))


def _cases(text: str, arity: int = 1) -> tuple[Condition, ...]:
    return tuple(parse_condition(part.strip(), arity) for part in split_outside(text, " or "))
