"""Modes: linear functions of the properties of a few roles (§1.2.4-1.2.5, §3.2.1)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from relgym.config.constants import DIGITS, ROUNDED
from relgym.scene.objects import Target

__all__ = ["NOISE", "Mode", "Role", "sum_text"]

NOISE = 0
"""Id of the noise mode, the catch-all for examples that no mode explains (§3.2)."""


@dataclass(frozen=True, slots=True, order=True)
class Role:
    """A part that an object plays in a mode: its type and the weights on its properties (§3.2.3).

    A property with a prime (``vx'``) stands for its next value.
    """

    type: str
    terms: tuple[tuple[str, float], ...]

    @property
    def kind(self) -> tuple[str, tuple[tuple[str, float], ...]]:
        """What makes roles interchangeable: type and weights, the latter to nine digits."""
        return self.type, tuple((prop, float(f"{weight:.9g}")) for prop, weight in self.terms)


@dataclass(frozen=True, slots=True)
class Mode:
    """One behaviour of a target: ``intercept`` plus the weighted properties of the roles' objects.

    Attributes
    ----------
    id
        Positive; `NOISE` is 0.
    target
        What it predicts.
    roles
        ``roles[0]`` is the target object itself, even when it has no terms; the others in sorted order.
    intercept
        Constant term, in units of the target.
    frame
        Axes in which the function is stated.
    examples
        Number of training examples assigned to it.
    sigma
        Standard deviation of its residuals as far as known, in units of the target.
    """

    id: int
    target: Target
    roles: tuple[Role, ...]
    intercept: float
    frame: str = "world"
    examples: int = 0
    sigma: float = 0.0

    @property
    def parameters(self) -> int:
        """Number of free parameters: weights and, unless it is zero, the intercept."""
        return sum(len(role.terms) for role in self.roles) + (self.intercept != 0.0)

    @property
    def constant(self) -> bool:
        """Whether it gives one value whatever there is."""
        return not any(role.terms for role in self.roles)

    @property
    def persists(self) -> bool:
        """Whether it says that nothing changes."""
        return self.roles == (Role(self.target.type, ((self.target.property, 1.0),)),) and not self.intercept

    @property
    def open_roles(self) -> tuple[Role, ...]:
        """All roles but the target's."""
        return self.roles[1:]

    def with_examples(self, examples: int) -> Mode:
        """The same mode with another example count."""
        return replace(self, examples=examples)

    def same_function(
        self, other: Mode, tolerance: float = ROUNDED, *, constant: bool = True, slack: float = 0.0
    ) -> bool:
        """Whether both have the same roles, weights and (if `constant`) intercept, within a share of `tolerance`.

        Intercepts may differ by `slack`, too: one that is but what rounding leaves of it has no size of its own.
        """
        pattern = [(r.type, [p for p, _ in r.terms]) for r in self.roles]
        if pattern != [(r.type, [p for p, _ in r.terms]) for r in other.roles]:
            return False
        weights = [[w for role in m.roles for _, w in role.terms] for m in (self, other)]
        if not all(abs(a - b) <= tolerance * max(abs(a), abs(b)) for a, b in zip(*weights, strict=True)):
            return False
        a, b = self.intercept, other.intercept
        return not constant or abs(a - b) <= max(tolerance * max(abs(a), abs(b)), slack)

    def formula(self, digits: int = DIGITS) -> str:
        """The function as text: ``vx' = 0.525 vx - 0.8227241 vy + 0.0004243524``.

        The target's own properties stand alone; those of another role are prefixed by its letter
        (``a.friction``), those of an only role of its type by the type (``action.force``).
        """
        terms = []
        for label, role in zip(self.role_labels(), self.roles, strict=True):
            terms += [(weight, f"{label}.{prop}" if label else prop) for prop, weight in role.terms]
        text = sum_text(terms, self.intercept, digits)
        return f"{self.target.property}' = {text}"

    def role_labels(self) -> tuple[str, ...]:
        """How the roles are called in `formula`: empty for the target, a type's name, or letters a, b, c."""
        several = {r.type for r in self.open_roles if sum(o.type == r.type for o in self.open_roles) > 1}
        labels, letter = [""], ord("a")
        for role in self.open_roles:
            if role.type in several or role.type == self.target.type:
                labels.append(f"{role.type}_{chr(letter)}")
                letter += 1
            else:
                labels.append(role.type)
        return tuple(labels)

    def to_json(self) -> dict[str, Any]:
        """Plain data that `from_json` reads back."""
        return {
            "id": self.id,
            "frame": self.frame,
            "roles": [{"type": r.type, "terms": [[p, w] for p, w in r.terms]} for r in self.roles],
            "intercept": self.intercept,
            "examples": self.examples,
            "sigma": self.sigma,
        }

    @classmethod
    def from_json(cls, target: Target, data: dict[str, Any]) -> Mode:
        """Read what `to_json` wrote."""
        roles = tuple(
            Role(r["type"], tuple((str(p), float(w)) for p, w in r["terms"])) for r in data["roles"]
        )
        return cls(
            id=int(data["id"]),
            target=target,
            roles=roles,
            intercept=float(data["intercept"]),
            frame=str(data["frame"]),
            examples=int(data["examples"]),
            sigma=float(data["sigma"]),
        )


def sum_text(terms: list[tuple[float, str]], intercept: float, digits: int) -> str:
    """Weighted names and a constant as text: ``-0.9 v + 1``."""
    pieces = []
    for weight, name in terms:
        size = f"{abs(weight):.{digits}g}"
        pieces.append((weight < 0, name if size == "1" else f"{size} {name}"))
    if intercept != 0.0 or not pieces:
        pieces.append((intercept < 0, f"{abs(intercept):.{digits}g}"))
    negative, text = pieces[0]
    head = f"-{text}" if negative else text
    return head + "".join(f" {'-' if minus else '+'} {piece}" for minus, piece in pieces[1:])
