"""The hypotheses of one target (`relgym.hypotheses`): when they are asked, and the best law that each has proposed."""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.clusterer import ModeClusterer
from relgym.clustering.columns import PRIME, SlotSignature
from relgym.clustering.examples import ExampleTable
from relgym.config.constants import CALL, EVIDENCE, FIRST, MOST_ROWS
from relgym.errors import ConfigError
from relgym.hypotheses import Examples, Law, code_length, registered
from relgym.model.target.scope import alike, spread_out
from relgym.scene.objects import TASK
from relgym.scheduling.agenda import Budget
from relgym.scheduling.work import Steps, Task, resumable

__all__ = ["Candidates"]


class Candidates:
    """Laws of registered classes for one target; whether they speak, calibration decides.

    Parameters
    ----------
    names
        Of the classes (`ModelConfig.hypotheses`); `ConfigError` where one isn't registered.

    Attributes
    ----------
    names
        Of the classes.
    laws
        For each of them the law that codes best so far; None where it has none.
    """

    def __init__(self, names: Sequence[str]) -> None:
        for name in names:
            registered(name)
        self.names = tuple(names)
        self.laws: list[Law | None] = [None] * len(names)
        self._columns: list[tuple[str, ...]] = [()] * len(names)  # that each law reads, by name
        self._due = FIRST
        self._tried = 0  # proposals
        self._asked: tuple[Examples, list[Task[Law | None]]] | None = None  # proposals being made

    def __bool__(self) -> bool:
        return bool(self.names)

    def due(self, seen: int) -> bool:
        """Whether proposals are to be asked for after so many examples, or are being made."""
        return self._asked is not None or (bool(self.names) and seen >= self._due)

    @property
    def under_way(self) -> bool:
        """Whether proposals are being made."""
        return self._asked is not None

    def forget(self) -> None:
        """The examples mean something else now: begin anew."""
        self.laws, self._columns = [None] * len(self.names), [()] * len(self.names)
        self._due, self._asked = FIRST, None

    def renew(self, clusterer: ModeClusterer, table: ExampleTable, budget: Budget) -> tuple[int, ...]:
        """Ask for proposals, as far as the budget goes; which of the classes have another law than before.

        Parameters
        ----------
        clusterer, table
            The target's examples and their rows.
        budget
            In cells; who isn't done goes on at the next call.
        """
        if self._asked is None:
            self._due = 2 * max(FIRST, clusterer.seen)
            shown = _shown(clusterer, table)
            self._asked = (shown, [Task(_proposed, name, shown) for name in self.names])
        shown, tasks = self._asked
        if not all([budget.work(task) for task in tasks]):
            return ()
        self._asked = None
        return tuple(k for k, task in enumerate(tasks) if self._accepts(k, task.result, shown))

    def _accepts(self, which: int, law: Law | None, shown: Examples) -> bool:
        """Keep a law if it codes the examples, itself included, in fewer bits than what there is, and plain laws.

        Plain ones are that nothing changes, and least squares on the same columns.
        """
        self._tried += 1
        if law is None:
            return False
        known, read = self.laws[which], self._columns[which]
        bits = [code_length(shown.y - shown.present, shown.resolution), _linear_bits(shown)]
        if known is not None and read == shown.names:
            bits.append(_bits(self.names[which], known, shown))
        if _bits(self.names[which], law, shown) + EVIDENCE + math.log2(self._tried) > min(bits):
            return False
        self.laws[which], self._columns[which] = law, shown.names
        return True

    def values(self, signature: SlotSignature, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """What each law says of rows ``(n, width)`` of a signature, shape ``(n, laws)``; NaN: nothing."""
        found = np.full((len(x), len(self.names)), np.nan)
        places = _places(signature)
        for k, law in enumerate(self.laws):
            if law is not None and all(name in places for name in self._columns[k]):
                said = _said(self.names[k], law, x[:, [places[name] for name in self._columns[k]]])
                found[:, k] = np.where(np.isfinite(said), said, np.nan)
        return found

    def statement(self, which: int) -> str:
        """A class's name and its law, for people."""
        law = self.laws[which]
        return f"{self.names[which]}: {'no law yet' if law is None else law.text()}"

    # ------------------------------------------------------------------ saving
    def to_json(self) -> dict[str, Any]:
        """Plain data that `restore` reads back."""
        laws = [
            None if law is None else [list(read), law.to_json()]
            for law, read in zip(self.laws, self._columns, strict=True)
        ]
        return {"due": 0 if self._asked is not None else self._due, "tried": self._tried, "laws": laws}

    def restore(self, data: Mapping[str, Any]) -> None:
        """Take over what `to_json` wrote; `ConfigError` for a law that its class can't read."""
        self._due, self._tried = int(data["due"]), int(data["tried"])
        for k, (name, each) in enumerate(zip(self.names, data["laws"], strict=True)):
            if each is None:
                continue
            try:
                self.laws[k] = registered(name).from_json(each[1])
            except Exception as error:
                raise ConfigError(
                    f"hypotheses: {name!r} can't read its law from the file ({error!r}); register the class that the "
                    "model was made with"
                ) from error
            self._columns[k] = tuple(each[0])


@resumable
def _proposed(name: str, shown: Examples) -> Steps[Law | None]:
    """What a class proposes; by name, so that it can be gone on with after it was copied."""
    found = registered(name).propose(shown)
    yield CALL + shown.x.size
    if isinstance(found, Generator):
        found = yield from found
    return found


def _shown(clusterer: ModeClusterer, table: ExampleTable) -> Examples:
    """The examples that look as the newest one does."""
    numbers, slots = alike(clusterer, table)
    half = MOST_ROWS // 2
    numbers = np.concatenate([spread_out(numbers[:-half], half), numbers[-half:]])
    rows, places = table.x[clusterer.rows[numbers]], _places(slots)
    present = slots.present(rows, clusterer.target)
    return Examples(
        tuple(places), rows[:, list(places.values())], clusterer.y[numbers].copy(), present, clusterer.floor
    )


def _places(slots: SlotSignature) -> dict[str, int]:
    """Columns of what there is before a step, by name; what the task says is left aside."""
    columns = ((k, slots.at(k)) for k in range(slots.core))
    return {
        slots.named(k): k
        for k, column in columns
        if not column.property.endswith(PRIME) and slots.types[column.slot].name != TASK
    }


def _bits(name: str, law: Law, shown: Examples) -> float:
    errors = shown.y - _said(name, law, shown.x)
    return code_length(errors, shown.resolution, law.parameters)


def _linear_bits(shown: Examples) -> float:
    """What least squares on the columns and 1 takes."""
    x = np.column_stack([shown.x, np.ones(len(shown.y))])
    weights = np.linalg.lstsq(x, shown.y, rcond=None)[0]
    return code_length(shown.y - x @ weights, shown.resolution, x.shape[1])


def _said(name: str, law: Law, x: NDArray[np.float64]) -> NDArray[np.float64]:
    with np.errstate(all="ignore"):
        said = np.asarray(law.predict(x), dtype=np.float64)
    if said.shape != (len(x),):
        raise ConfigError(
            f"hypotheses: a law of {name!r} gives shape {said.shape} for {len(x)} rows, expected ({len(x)},)"
        )
    return said
