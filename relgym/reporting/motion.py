"""Laws of motion as branches, and back: the free law, then along each axis of a contact which piece holds."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from relgym.errors import ConfigError
from relgym.laws.account import happens
from relgym.laws.book import LawBook
from relgym.laws.columns import Sources
from relgym.laws.frames import FRAMES, POINT
from relgym.laws.inertia import AREA, NOTHING, SQUARE, By, Gyration, Inertia, Mass
from relgym.laws.records import (
    ONE,
    AxisLaw,
    Bound,
    FreeLaw,
    Kind,
    Operator,
    PairLaw,
    Piece,
    Region,
    Share,
)
from relgym.laws.text import DIRECTIONS
from relgym.reporting.functions import number_of, parse_sum, whole_of
from relgym.scene.objects import Target
from relgym.scene.schema import SceneSchema

__all__ = ["HEADING", "MotionRules", "parse_motion"]

HEADING: Final = "Laws of motion"
"""First line of the section."""

_SIGN: Final[dict[Operator, str]] = {"max": ">", "min": "<"}
_WIDTH = 34


@dataclass(frozen=True, slots=True)
class MotionRules:
    """Laws of motion in force.

    Attributes
    ----------
    free
        What objects of a type do that touch nothing.
    components
        Properties that the laws predict, by type.
    pair
        What a contact does.
    letters
        Names of the axes along which that is stated.
    shares
        How two moving bodies share an impulse.
    tolerance
        Largest residual of an explained velocity.
    inertia
        Masses and moments, where bodies turn.
    """

    free: tuple[FreeLaw, ...]
    components: tuple[tuple[str, tuple[str, ...]], ...]
    pair: PairLaw | None = None
    letters: str = "nt"
    shares: tuple[tuple[Kind, Share], ...] = ()
    tolerance: float = 0.0
    inertia: Inertia = NOTHING

    def text(self, digits: int = 7) -> str:
        """The laws as text."""
        names = dict(self.components)
        rows: list[tuple[str, str, str]] = []
        for law in self.free:
            count = self._stats(law.examples, law.unexplained)
            for where, components in (
                ("", law.components),
                *((f", where {r.text(digits)}", r.components) for r in law.regions),
            ):
                for number, (name, piece) in enumerate(zip(names[law.type], components, strict=False)):
                    head = f"{law.type} touching nothing{where}:" if not number else ""
                    stats = count if not number and not where else ""
                    rows.append((head, f"{name}' = {piece.formula(digits)}", stats))
        for letter, laws in zip(self.letters, self.pair.axes if self.pair else (), strict=False):
            for each in laws:
                rows += self._axis(letter, each, digits, alone=len(laws) == 1)
        lines = [HEADING, *_aligned(rows)]
        for (a, b), share in self.shares:
            lines.append(
                f"  of a change between {a} A and {b} B, A takes {share.formula(digits)}, B the rest"
            )
        for (a, b), grip in self.pair.grips if self.pair else ():
            lines.append(
                f"  of a change along t between {a} and {b}, velocities take {grip:.{digits}g}, spins the rest"
            )
        for (a, b), speed in self.pair.surfaces if self.pair else ():
            lines.append(f"  surfaces of {a} on {b} run at {speed:.{digits}g} along the turned normal")
        lines += [f"  {sentence}" for sentence in self.inertia.sentences(digits)]
        if self.pair is not None:
            lines.append(f"  frame: {self.pair.frame}")
        legend = _POINTS if self.inertia != NOTHING else _LEGEND
        return "\n".join([*lines, *legend])

    def _stats(self, examples: int, unexplained: int) -> str:
        wrong = f", {unexplained:,} unexplained" if unexplained else ""
        return f"{examples:,} steps{wrong}  ± {self.tolerance:.2g}"

    def _axis(self, letter: str, law: AxisLaw, digits: int, *, alone: bool) -> Iterator[tuple[str, str, str]]:
        # Where some kinds are doubted it takes all of them to tell what is claimed of others (`AxisLaw.trusted`).
        named = law.doubted or not alone
        whom = f" ({', '.join('-'.join(kind) for kind in law.kinds)})" if named else ""
        where = DIRECTIONS.get(letter, f"along {letter}")
        points = " (of the points that touch)" if self.pair is not None and self.pair.frame == POINT else ""
        stats = self._stats(law.examples - law.excused, law.unexplained - law.excused)
        yield f"touching{whom}, {where}{points}:", "", stats
        texts = [piece.formula(digits) for piece in law.pieces]
        sign = _SIGN[law.operator]
        for number, (piece, text) in enumerate(zip(law.pieces, texts, strict=True)):
            later = texts[number + 1 :]
            word = "if  " if not number else "elif"
            tests = " and ".join(f"{text} {sign} {other}" for other in later)
            head = f"{word} {tests}:" if later else ("else:" if number else "always:")
            yield f"  {head}", f"v'_{letter} = {text}", f"# {self._word(piece, letter)}"
        for operator, pieces in law.alternatives:
            form = f"{operator}({', '.join(piece.formula(digits) for piece in pieces)})"
            yield f"  or, as good: v'_{letter} = {form}; where they differ, no prediction", "", ""
        for a, b in law.doubted:
            yield f"  where {a} touches {b}: no prediction", "", ""
        for known, side in zip(law.signs, "<>", strict=True):
            if not known:
                yield f"  where that turns the motion to v'_{letter} {side} 0: no prediction", "", ""

    def _word(self, piece: Piece, letter: str) -> str:
        moving, still = happens(piece, letter, math.inf, 0.0), happens(piece, letter, 0.0, 0.0)
        return moving if moving == still else f"{moving}, or {still} where v_{letter} = 0"

    def book(self, schema: SceneSchema) -> LawBook:
        """The laws, ready to be asked of scenes of a schema."""
        targets = tuple(Target(t, p) for t, names in self.components for p in names)
        types = [schema.type(name) for name, _ in self.components]
        book = LawBook(schema, {t.name: Sources.of(schema, t, targets) for t in types})
        book.free = {law.type: law for law in self.free}
        book.pair, book.shares = self.pair, dict(self.shares)
        book.tolerance = self.tolerance
        book.inertia = self.inertia
        return book

    def _repr_html_(self) -> str:
        import html

        return f"<pre>{html.escape(self.text())}</pre>"


_LEGEND = (
    "  # v: velocity now; u: what the next one would be without this contact; v': what it is with it; all of them",
    "  # relative to the other body. J_n = v'_n - u_n is the impulse. Several contacts act until nothing changes.",
)


_POINTS = (
    "  # v: velocity now; u: what the next one would be without this point's impulse along that axis; v': what it is",
    "  # with it; all of them of one surface against the other. J_n: what the impulse along n would change along t.",
    "  # An impulse moves a body by 1 / mass, and turns it by arm / moment. All points act until nothing changes.",
    f"  # {AREA}: a body's area; {SQUARE}: mean square distance of its points from its position.",
)


def _aligned(rows: list[tuple[str, str, str]]) -> list[str]:
    heads = max((len(h) for h, said, _ in rows if said), default=0) + 2
    width = max((len(said) for _, said, _ in rows), default=0) + 2
    lines = []
    for head, said, stats in rows:
        if not said and not stats:
            lines.append(f"  {head}")
        elif not said:
            lines.append(
                f"  {head.ljust(heads + width)}{'' if len(head) < heads + width else '  '}{stats}".rstrip()
            )
        else:
            lines.append(f"  {head.ljust(heads)}{said.ljust(width)}{stats}".rstrip())
    return lines


# ------------------------------------------------------------------ from text
_STATS = r"(?: {2,}(?P<n>[\d,]+) steps?(?:, (?P<bad>[\d,]+) unexplained)?  ± (?P<tol>\S+))?"
_FREE = re.compile(
    rf"  (?:(?P<type>\S+) touching nothing(?:, where (?P<where>[^:]+))?:)? +(?P<name>[^\s']+)' = (?P<piece>.*?){_STATS}"
)
_BOUND = re.compile(r"(?P<name>\S+) (?P<sign><=|>=) (?P<here>\S+) \(else \S+ (?:<=|>=) (?P<there>\S+)\)")
_AXIS = re.compile(
    rf"  touching(?: \((?P<kinds>.*?)\))?, (?P<where>.*?)(?: \(of the points that touch\))?:{_STATS}"
)
_PIECE = re.compile(
    r"    (?P<head>if|elif|else|always)(?P<tests>.*?): +v'_(?P<axis>\w) = (?P<piece>.*?)(?:  +# .*)?"
)
_OTHER = re.compile(
    r"    or, as good: v'_\w = (?P<operator>max|min)\((?P<pieces>.*)\); where they differ, .*"
)
_TURN = re.compile(r"    where that turns the motion to v'_\w (?P<side>[<>]) 0: no prediction")
_DOUBT = re.compile(r"    where (?P<a>\S+) touches (?P<b>\S+): no prediction")
_SHARE = re.compile(r"  of a change between (\S+) A and (\S+) B, A takes (.*), B the rest")
_GRIP = re.compile(r"  of a change along t between (\S+) and (\S+), velocities take (\S+), spins the rest")
_SURFACE = re.compile(r"  surfaces of (\S+) on (\S+) run at (\S+) along the turned normal")
_MASS = re.compile(r"  masses go as (?P<factors>.*?)(?:; by (?P<by>type|object), times (?P<constants>.*))?")
_GYRATION = re.compile(r"  moment over mass(?: of (?P<types>.*?))?: (?P<piece>.*)")
_POWER = re.compile(r"(?P<name>\w+)_B(?:\^(?P<power>\d))? / \(.*\)")


@dataclass
class _Draft:
    """Laws as far as they were read."""

    free: dict[str, list[tuple[str, Piece]]] = field(default_factory=dict)
    regions: dict[str, list[tuple[tuple[Bound, ...], list[Piece]]]] = field(default_factory=dict)
    counts: dict[str, tuple[int, int]] = field(default_factory=dict)
    axes: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    shares: list[tuple[Kind, Share]] = field(default_factory=list)
    grips: list[tuple[Kind, float]] = field(default_factory=list)
    surfaces: list[tuple[Kind, float]] = field(default_factory=list)
    mass: Mass | None = None
    gyrations: list[Gyration] = field(default_factory=list)
    frame: str = "contact"
    tolerance: float = 0.0
    law: dict[str, Any] = field(default_factory=dict)
    kind: str = ""

    def read(self, line: str) -> bool:
        """Take up a line; whether it says something."""
        if line.startswith("  frame: "):
            self.frame = line.removeprefix("  frame: ")
            return self.frame in FRAMES
        return self._of_axis(line) or self._between(line) or self._of_free(line)

    def _of_axis(self, line: str) -> bool:
        if match := _AXIS.fullmatch(line):
            letter = next((c for c, text in DIRECTIONS.items() if text == match["where"]), match["where"][-1])
            kinds = tuple(_kind(k) for k in match["kinds"].split(", ")) if match["kinds"] else ()
            self.law = {
                "pieces": [],
                "operator": "max",
                "kinds": kinds,
                "others": [],
                "signs": [True, True],
                "doubted": [],
            }
            self.law |= {
                "examples": whole_of(match["n"] or "0"),
                "unexplained": whole_of(match["bad"] or "0"),
            }
            self.axes.setdefault(letter, []).append(self.law)
            self.tolerance = number_of(match["tol"] or f"{self.tolerance!r}")
        elif self.law and (match := _PIECE.fullmatch(line)):
            self.law["pieces"].append(_piece(match["piece"]))
            self.law["operator"] = "min" if " < " in match["tests"] else self.law["operator"]
        elif self.law and (match := _OTHER.fullmatch(line)):
            pieces = tuple(map(_piece, match["pieces"].split(", ")))
            self.law["others"].append((match["operator"], pieces))
        elif self.law and (match := _DOUBT.fullmatch(line)):
            self.law["doubted"].append((match["a"], match["b"]))
        elif self.law and (match := _TURN.fullmatch(line)):
            self.law["signs"]["<>".index(match["side"])] = False
        else:
            return False
        return True

    def _between(self, line: str) -> bool:
        if match := _SHARE.fullmatch(line):
            self.shares.append(((match[1], match[2]), _share(match[3])))
        elif match := _GRIP.fullmatch(line):
            self.grips.append(((match[1], match[2]), number_of(match[3])))
        elif match := _SURFACE.fullmatch(line):
            self.surfaces.append(((match[1], match[2]), number_of(match[3])))
        elif match := _MASS.fullmatch(line):
            pairs = [part.rpartition(": ") for part in (match["constants"] or "").split(", ") if part]
            constants = tuple((name, number_of(value)) for name, _, value in pairs)
            by: By = "type" if match["by"] == "type" else "object" if match["by"] else ""
            self.mass = Mass(_powers(match["factors"]), by, constants)
        elif match := _GYRATION.fullmatch(line):
            types = tuple(match["types"].split(", ")) if match["types"] else ()
            piece = None if match["piece"] == "infinite" else _piece(match["piece"])
            self.gyrations.append(Gyration(types, piece, not types))
        return match is not None

    def _of_free(self, line: str) -> bool:
        if match := _FREE.fullmatch(line):
            self.kind = match["type"] or self.kind
            if match["where"]:
                bounds = tuple(map(_bound, match["where"].split(" and ")))
                self.regions.setdefault(self.kind, []).append((bounds, [_piece(match["piece"])]))
            elif self.kind in self.regions and not match["type"]:
                self.regions[self.kind][-1][1].append(_piece(match["piece"]))
            else:
                self.free.setdefault(self.kind, []).append((match["name"], _piece(match["piece"])))
            if match["n"]:
                self.counts[self.kind] = whole_of(match["n"] or "0"), whole_of(match["bad"] or "0")
                self.tolerance = number_of(match["tol"])
        return match is not None


def parse_motion(lines: list[str]) -> MotionRules:
    """Read the lines of a section of laws; `ConfigError` where one says nothing."""
    draft = _Draft()
    for line in lines[1:]:
        if not draft.read(line):
            raise ConfigError(
                f"laws of motion: expected a law, a piece, a share or a frame, got {line.strip()!r}"
            )
    pair = None
    if draft.axes:
        laws = tuple(tuple(_axis_law(each) for each in found) for found in draft.axes.values())
        pair = PairLaw(draft.frame, laws, 0.0, tuple(draft.grips), tuple(draft.surfaces))
    free = draft.free.items()
    return MotionRules(
        tuple(
            FreeLaw(
                t,
                tuple(p for _, p in found),
                *draft.counts.get(t, (0, 0)),
                regions=tuple(Region(bounds, tuple(pieces)) for bounds, pieces in draft.regions.get(t, ())),
            )
            for t, found in free
        ),
        tuple((t, tuple(name for name, _ in found)) for t, found in free),
        pair,
        "".join(draft.axes),
        tuple(draft.shares),
        draft.tolerance,
        Inertia(draft.mass, tuple(draft.gyrations)),
    )


def _axis_law(data: Mapping[str, Any]) -> AxisLaw:
    if not data["pieces"]:
        raise ConfigError(
            "laws of motion: expected a piece, such as 'always: v'_n = u_n', after each contact"
        )
    return AxisLaw(
        tuple(data["pieces"]),
        data["operator"],
        data["kinds"],
        tuple(data["others"]),
        tuple(data["signs"]),
        data["examples"],
        data["unexplained"],
        doubted=tuple(data["doubted"]),
    )


def _kind(text: str) -> Kind:
    a, _, b = text.partition("-")
    return a, b


def _piece(text: str) -> Piece:
    found = parse_sum(text)
    constant = ((ONE, found.constant),) if found.constant != 0.0 else ()
    return Piece((*((name, weight) for weight, name in found.terms), *constant))


def _bound(text: str) -> Bound:
    match = _BOUND.fullmatch(text)
    if match is None:
        raise ConfigError(
            f"laws of motion: expected a bound, such as 'px >= 0.1 (else px <= 0)', got {text!r}"
        )
    here, there = number_of(match["here"]), number_of(match["there"])
    above = match["sign"] == ">="
    return Bound(match["name"], above, there if above else here, here if above else there)


def _share(text: str) -> Share:
    match = _POWER.fullmatch(text)
    if match is None:
        return Share(constant=number_of(text))
    return Share(match["name"], int(match["power"] or 1))


def _powers(text: str) -> tuple[tuple[str, int], ...]:
    """Names and powers in a product such as ``shape.area mass^2``; 1 is the empty one."""
    parts = [part.partition("^") for part in text.split(" ") if part != ONE]
    return tuple((name, int(power or 1)) for name, _, power in parts)
