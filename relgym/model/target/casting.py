"""Role binding for a target's modes: one role classifier per mode that has any (§3.5)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from relgym.classification.examples import Example, Vocabulary
from relgym.classification.exemplars import Exemplars
from relgym.classification.role_classifier import RoleClassifier, RoleKind
from relgym.clustering.mode import Mode, Role
from relgym.config import ClassificationConfig

__all__ = ["Casting"]


class Casting:
    """The role classifiers of one target, by mode.

    Only roles of types with a body are cast; a bodiless object is alone of its type and needs no description.

    Parameters
    ----------
    vocabulary
        Names of what examples hold.
    config
        Free parameters of classification.

    Attributes
    ----------
    classifiers
        Mode id → its role classifier.
    """

    def __init__(self, vocabulary: Vocabulary, config: ClassificationConfig) -> None:
        self.vocabulary = vocabulary
        self.config = config
        self.classifiers: dict[int, RoleClassifier] = {}
        self._cast: dict[int, tuple[Mode, tuple[Role, ...], tuple[RoleKind, ...]]] = {}

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_cast": {}}

    def embodied(self, mode: Mode) -> tuple[Role, ...]:
        """Roles of a mode that bodies play, the target's own left aside."""
        return self._roles(mode)[0]

    def _roles(self, mode: Mode) -> tuple[tuple[Role, ...], tuple[RoleKind, ...]]:
        """Roles that bodies play, and their kinds; of the latest mode of each id they are remembered."""
        known = self._cast.get(mode.id)
        if known is None or known[0] is not mode:
            roles = tuple(role for role in mode.open_roles if role.type in self.vocabulary.unary)
            known = self._cast[mode.id] = (mode, roles, tuple(RoleKind(*role.kind) for role in roles))
        return known[1], known[2]

    def sync(self, modes: Mapping[int, Mode]) -> None:
        """Follow a change of the modes: drop classifiers of those that are gone or have other roles."""
        for number in sorted(self.classifiers):
            if number not in modes or self.classifiers[number].kinds != self._kinds(modes[number]):
                del self.classifiers[number]

    def recall(self, exemplars: Exemplars) -> None:
        """Take in how players stood in exemplars that were given to other modes since they were observed."""
        for number in sorted(self.classifiers):
            self.classifiers[number].recall(exemplars, number)

    @property
    def waits(self) -> bool:
        """Whether there are descriptions that wait to be learned anew."""
        return any([known.stale for known in self.classifiers.values()])

    def observe(self, mode: Mode, example: Example, roles: Sequence[int], weight: float = 1.0) -> bool:
        """Learn from the role binding of one example, which stands for so many.

        Returns whether that contradicts the descriptions.
        """
        kinds = self._kinds(mode)
        known = self.classifiers.get(mode.id)
        if known is None or known.kinds != kinds:
            known = self.classifiers[mode.id] = RoleClassifier(self.vocabulary, kinds, self.config)
        return known.observe(example, roles, weight)

    @property
    def flawed(self) -> set[int]:
        """Modes whose descriptions err, or wait to be learned anew."""
        return {number for number, known in self.classifiers.items() if known.errors > 0 or known.stale}

    def refresh(self, exemplars: Exemplars, budget: float, amended: set[int] | None = None) -> int:
        """Learn stale descriptions anew as far as the budget goes; the work spent. Their modes go to `amended`."""
        spent = 0
        for number in sorted(self.classifiers):
            if spent >= budget:
                break
            known = self.classifiers[number]
            stale = known.stale
            spent += known.refresh(exemplars, number, budget - spent)
            if amended is not None and stale and not known.stale:
                amended.add(number)
        return spent

    def assign(
        self, mode: Mode, example: Example, order: Sequence[int], *, sure: bool
    ) -> tuple[int, ...] | None:
        """Bodies that play the mode's embodied roles, or None if some can't be filled.

        Parameters
        ----------
        mode
            The mode.
        example
            The query.
        order
            All bodies, those to prefer where nothing else decides first.
        sure
            Whether to fill no role where nothing but `order` decides, unless that was so in examples too.
        """
        known = self.classifiers.get(mode.id)
        return None if known is None else known.assign(example, order, sure=sure)

    def to_json(self) -> list[Any]:
        """Plain data."""
        return [[number, c.to_dict()] for number, c in sorted(self.classifiers.items())]

    def restore(self, data: list[Any]) -> None:
        """Take over what `to_json` wrote."""
        self.classifiers = {
            int(number): RoleClassifier.from_dict(plain, self.vocabulary, self.config)
            for number, plain in data
        }

    def _kinds(self, mode: Mode) -> tuple[RoleKind, ...]:
        return self._roles(mode)[1]
