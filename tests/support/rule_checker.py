"""Printed conditions, tested by another route: names and loops, another geometry, none of relgym.reporting."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from itertools import product

from relgym.model.predicting.prediction import ScenePrediction
from relgym.model.reports.explain import Explanation
from relgym.scene.contacts import APPROACH_EPS
from relgym.scene.objects import Scene
from relgym.scene.relations import Extractor
from relgym.scene.state import relational_state

QUANTIFIED = re.compile(r"(some|no) (struck |close |)((?:[A-Z], )*[A-Z]) \[(.*)\]$")
CALL = re.compile(r"([^\s()]+)\(((?:[A-Z], )*[A-Z])\)$")
ROUNDING = 1e-12
"""Of normals and distances by fcl: they are another geometry's than the model's."""
COMPARED = re.compile(r"(.*) (<=|>=|<|>|=|!=) (\S+)$")
TERM = re.compile(r"([-+]) (?:([\d.]+(?:e[-+]?\d+)?)(?: |$))?(\S.*?)?(?= [-+] |$)")
COMPARE: Mapping[str, Callable[[float, float], bool]] = {
    "<=": lambda a, b: a <= b,
    ">=": lambda a, b: a >= b,
    "<": lambda a, b: a < b,
    ">": lambda a, b: a > b,
    "=": lambda a, b: a == b,
    "!=": lambda a, b: a != b,
}


def printed(explanation: Explanation) -> list[str]:
    """Conditions that the text of an explanation states, without the objects that it names."""
    lines, found = str(explanation).split("\n"), list[str]()
    for number, line in enumerate(lines):
        if line.startswith("  because   ") or (found and line.startswith(" " * 12)):
            found.append(line[12:].split(", with ")[0])
        elif found or (number and line.startswith("  runner-up")):
            break
    return [text for text in found if text != "no other rule is known"]


class Checker:
    """One scene, and what follows it, as conditions of one object see them."""

    def __init__(self, scene: Scene, target: str, prediction: ScenePrediction) -> None:
        self.scene, self.target, self.following = scene, target, prediction.scene
        extractor = Extractor(scene.schema, geometry="fcl")
        self.state = relational_state(scene, extractor)
        layout = scene.layout
        self.bodies = [layout.names[i] for i in layout.bodies]
        self.facts: dict[str, dict[str, float]] = {}
        if target in self.bodies:
            relations = extractor.extract(layout, scene.vector[None])
            contacts = relations.contacts(self.bodies.index(target))[0]
            for name, row in zip(self.bodies, contacts.tolist(), strict=True):
                self.facts[name] = dict(zip(extractor.features, row, strict=True))
        self.touched = [b for b in self.bodies if (target, b) in self.state.tuples("intersect")]

    def leaves(self, body: str) -> bool:
        return self.facts[body]["approach"] > APPROACH_EPS

    def seen(self, word: str) -> list[str]:
        """Objects that a variable ranges over."""
        if not word or self.target not in self.bodies:
            return self.bodies or [self.target]
        met = [b for b in self.touched if not self.leaves(b)]
        if word == "struck":
            least = min((self.facts[b]["approach"] for b in met), default=0.0)
            return [self.target, *(b for b in met if self.facts[b]["approach"] <= least + APPROACH_EPS)]
        others = [b for b in self.bodies if b != self.target]
        nearest = [min(others, key=lambda b: self.facts[b]["distance"])] if others else []
        return [self.target, *(met or self.touched or nearest)]

    def true(self, text: str) -> bool:
        return all(self._true(part, {"A": self.target}, self.bodies, True) for part in _split(text))

    def _true(self, text: str, names: dict[str, str], seen: list[str], open_: bool) -> bool:
        """Whether it is true; where this geometry's rounding decides, the answer is `open_`."""
        if match := QUANTIFIED.match(text):
            sign, word, variables, body = match.groups()
            shown, within = self.seen(word.strip()), open_ == (sign == "some")
            found = any(
                all(self._true(part, names | dict(zip(variables.split(", "), chosen, strict=True)), shown, within)
                    for part in _split(body))
                for chosen in product(shown, repeat=len(variables.split(", ")))
            )  # fmt: skip
            return found == (sign == "some")
        if text.startswith("not "):
            return not self._true(text[4:], names, seen, not open_)
        if match := COMPARED.match(text):
            left, sign, right = match.groups()
            value = self._number(left, names)
            if CALL.match(left) and abs(value - float(right)) <= ROUNDING:
                return open_
            return not math.isnan(value) and COMPARE[sign](value, float(right))
        call = CALL.match(text)
        if call is None:
            return self._column(text) > 0.5
        objects = tuple(names[v] for v in call[2].split(", "))
        return objects in self.state.tuples(call[1])

    def _number(self, text: str, names: dict[str, str]) -> float:
        if call := CALL.match(text):
            body = names[call[2].split(", ")[1]]
            if call[1] not in self.facts[body]:
                return float(self.scene[body][call[1].removeprefix("other-")])
            known = self.facts[body][call[1]]
            close = body in self.touched and (call[1] == "approach" or not self.leaves(body))
            gap = self.scene.schema.offsets and (call[1] in ("distance", "approach") or "offset" in call[1])
            return known if close or gap else math.nan
        if text.startswith("("):
            inside, name = text[1:].rsplit(") * ", 1)
            return self._number(inside, names) * self._column(name)
        if text.startswith("|"):
            return abs(self._number(text[1:-1], names))
        total = 0.0
        for sign, weight, name in TERM.findall(text if text.startswith("-") else f"+ {text}"):
            size = float(weight or 1.0) * (self._column(name) if name else 1.0)
            total += -size if sign == "-" else size
        return total

    def _column(self, name: str) -> float:
        scene = self.following if name.endswith("'") else self.scene
        owner, _, prop = name.rstrip("'").rpartition(".")
        if not owner:
            return float(scene[self.target][prop])
        (only,) = [o.name for o in scene if o.type.name == owner]
        return float(scene[only][prop])


def _split(text: str) -> list[str]:
    parts, depth, start = [], 0, 0
    for at, letter in enumerate(text):
        depth += (letter in "[(") - (letter in "])")
        if not depth and text.startswith(" and ", at):
            parts.append(text[start:at])
            start = at + 5
    return [*parts, text[start:]]
