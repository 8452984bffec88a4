"""Guesses: sparse least squares over all examples, used as fallback values where no mode or law predicts.

Where a property depends on something unobserved (a driver's intentions) no mode holds. What is linear in the numbers,
and in few products of them, regressions tell (`relgym.model.predicting.regression`); of non-linear features that are
offered there are mostly more than they have room for. A guess is a sparse function of what the target and bodiless
objects have, features included, that predicts best what it wasn't fitted to. It has no modes and no conditions, and its
outcome stays `UNEXPLAINED`. It replaces an approximation that errs more; and where approximations aren't used
(`relgym.model.target.scope`), a guess fitted to the examples there is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.clusterer import ModeClusterer
from relgym.clustering.columns import SlotSignature
from relgym.clustering.examples import ExampleTable
from relgym.clustering.mode import NOISE, Mode
from relgym.clustering.roles import identify_roles
from relgym.clustering.unification import reordered
from relgym.config.constants import (
    ALTERNATIVES,
    FIRST,
    LITTLE,
    MOST_FEATURES,
    MOST_ROWS,
    OFTEN,
    RECENT,
    SEARCHED_CELLS,
    STDS,
    SUMMABLE,
)
from relgym.model.reports.text import percent
from relgym.model.target.scope import Scope, alike, alike_to, spread_out
from relgym.numeric.stepwise import LinearFit, fitting_cells, forward_order, least_squares
from relgym.scene.objects import Target
from relgym.scheduling.agenda import Budget
from relgym.scheduling.work import Steps, Task, resumable

__all__ = ["Guess", "Guesses"]


@dataclass(frozen=True, slots=True)
class Guess:
    """The function of a guess, and how much of the change it leaves.

    Attributes
    ----------
    mode
        The function, in a mode's form; its id is 0, as that of no mode, and its sigma what it leaves.
    left
        What it leaves of the change's standard deviation, on examples that it wasn't fitted to.
    """

    mode: Mode
    left: float

    def text(self, digits: int) -> str:
        """For people."""
        return f"best guess, no law: {self.mode.formula(digits)}, which leaves {percent(self.left)} of the change"


class Guesses:
    """The best guess of one target, kept up to date as examples come.

    Attributes
    ----------
    best
        The guess; None as long as none is needed, or none is better than that nothing changes.
    beyond
        The same of examples beyond an approximation's scope; None also where they are few.
    errors
        What the modes' and the guess's predictions were off by lately: discounted means of squares, and of square
        roots, which rare large errors hardly move, shape ``(2, 2)``.
    """

    def __init__(self) -> None:
        self.best: Guess | None = None
        self.beyond: Guess | None = None
        self.errors = np.zeros((2, 2))
        self._due = FIRST
        self._trials: list[_Trial] | None = None  # those under way

    @property
    def superior(self) -> bool:
        """Whether the guess is better than the modes' predictions.

        Its root mean square error must be smaller, and by a greater factor than the typical error (the square of the
        mean root) is larger: rare large errors must not decide over what is mostly right.
        """
        (modes, typical_modes), (own, typical) = self.errors.tolist()
        # Squares are compared: so the typical error, itself a square of what is kept, counts to the fourth.
        # Multiplied, since a power of a number that is too great would be an error, and the product is infinite.
        gains = own * _fourth(typical) < modes * _fourth(typical_modes)
        return self.best is not None and own < modes and gains

    def compare(self, modes: float, own: float) -> None:
        """Take in by how much the modes' prediction and the guess, made before the outcome was learned, were off."""
        # A guess may lead anywhere: what it is off by is to be summed with what comes later, whatever it is.
        off = np.minimum(np.nan_to_num(np.abs([modes, own]), nan=np.inf), SUMMABLE)
        self.errors += (np.column_stack([np.square(off), np.sqrt(off)]) - self.errors) / RECENT

    def stale(self, seen: int) -> bool:
        """Whether a new guess is due after so many examples, or under way."""
        return seen >= self._due or self._trials is not None

    @property
    def underway(self) -> bool:
        """Whether a new guess is being worked on."""
        return self._trials is not None

    def drop(self) -> None:
        """Forget the guess that is being worked on: it was of other columns."""
        self._trials = None

    def renew(self, clusterer: ModeClusterer, table: ExampleTable, scope: Scope, budget: Budget) -> None:
        """Guess anew, beyond the scope of approximations too, as far as the budget goes.

        Cost O(`ALTERNATIVES` * rows * columns * terms) with at most `SEARCHED_CELLS` for rows times columns, some
        0.3 s among 500 features.
        """
        if self._trials is None and not budget.left:
            return  # what waits holds no data
        if self._trials is None:
            self._due = int(OFTEN * max(FIRST, clusterer.seen))
            numbers, slots = alike(clusterer, table)
            beyond = numbers[~scope.covers(table.x[clusterer.rows[numbers]], slots)]
            self._trials = [_Trial.of(clusterer, table, slots, some) for some in (numbers, beyond)]
        if not all([trial.go_on(budget) for trial in self._trials]):
            return
        (whole, rest), self._trials = self._trials, None
        numbers = alike_to(clusterer, table, whole.slots)
        beyond = numbers[~scope.covers(table.x[clusterer.rows[numbers]], whole.slots)]
        self.best = whole.fitted(clusterer, table, numbers)
        self.beyond = rest.fitted(clusterer, table, beyond)

    def to_json(self) -> dict[str, Any]:
        """Plain data that `from_json` reads back."""
        known = {"best": self.best, "beyond": self.beyond}
        told = {
            name: None if each is None else [each.mode.to_json(), each.left] for name, each in known.items()
        }
        return {**told, "errors": self.errors.tolist(), "due": 0 if self.underway else self._due}

    @classmethod
    def from_json(cls, target: Target, data: dict[str, Any]) -> Guesses:
        """Read what `to_json` wrote."""
        found = cls()
        found.best, found.beyond = (_read(target, data.get(name)) for name in ("best", "beyond"))
        if "errors" in data:
            found.errors = np.array(data["errors"], dtype=np.float64)
        found._due = data.get("due", FIRST)
        return found


def _fourth(number: float) -> float:
    return (number * number) * (number * number)


def _read(target: Target, data: list[Any] | None) -> Guess | None:
    return None if data is None else Guess(Mode.from_json(target, data[0]), float(data[1]))


@dataclass(slots=True)
class _Trial:
    """The choice of a guess's terms, under way; on examples as they were when it began.

    Attributes
    ----------
    slots, order
        The examples' signature, and its columns in order of preference.
    tasks
        The choice among the own columns, and among features too.
    """

    slots: SlotSignature
    order: NDArray[np.intp]
    tasks: list[Task[tuple[tuple[int, ...] | None, float]]]

    @classmethod
    def of(
        cls, clusterer: ModeClusterer, table: ExampleTable, slots: SlotSignature, numbers: NDArray[np.intp]
    ) -> _Trial:
        """Begin with some examples; there is nothing to do if they are too few."""
        order, stages = slots.preference(clusterer.target)
        if len(numbers) < FIRST or slots.feature_count > MOST_FEATURES:
            return cls(slots, order, [])
        present = np.array([slots.at(int(k)).property[-1:] != "'" for k in order])
        widths = [int(present[:stage].sum()) for stage in (stages[:2] if slots.features else stages[:1])]
        order, tasks = order[present], []
        for width in widths:  # few examples choose among many features badly
            some = spread_out(numbers, min(MOST_ROWS, max(FIRST, SEARCHED_CELLS // width)))
            tasks.append(Task(_choice, *_data(clusterer, table, slots, order[:width], some)))
        return cls(slots, order, tasks)

    def go_on(self, budget: Budget) -> bool:
        """Work as far as the budget goes; whether all is done."""
        return all([budget.work(task) for task in self.tasks])

    def fitted(
        self, clusterer: ModeClusterer, table: ExampleTable, numbers: NDArray[np.intp]
    ) -> Guess | None:
        """The guess, if there is one that is better than none, with weights from these examples."""
        best: tuple[int, ...] | None = None
        left = 1.0
        for task in self.tasks:
            columns, leaves = task.result
            if columns is not None and (best is None or leaves < left):
                best, left = columns, leaves
        if best is None or not len(numbers):
            return None
        return Guess(
            _fitted(clusterer, table, self.slots, self.order, spread_out(numbers, MOST_ROWS), best), left
        )


def _data(
    clusterer: ModeClusterer,
    table: ExampleTable,
    slots: SlotSignature,
    order: NDArray[np.intp],
    numbers: NDArray[np.intp],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Columns and changes of some examples, shapes ``(n, d)`` and ``(n,)``."""
    rows = table.x[clusterer.rows[numbers]]
    present = slots.present(rows, clusterer.target)
    return slots.matrix(rows, order), clusterer.y[numbers] - present


@resumable
def _choice(
    x: NDArray[np.float64], change: NDArray[np.float64]
) -> Steps[tuple[tuple[int, ...] | None, float]]:
    """Columns that serve best, None if it is no better to say that nothing changes, and what they leave of it."""
    terms, leaves = yield from _terms.steps(x, change)
    if terms is None:
        return None, leaves
    order = yield from _order(x, change, terms)
    return least_squares(x, change, order).columns, leaves


@resumable
def _terms(x: NDArray[np.float64], change: NDArray[np.float64]) -> Steps[tuple[int | None, float]]:
    """The smallest number of terms that predicts well what it wasn't fitted to.

    Tried are none, which is what changes in the mean, and powers of two up to the square root of the number of
    examples. It must be better than that nothing changes by `STDS` standard errors: where a handful of examples makes
    most of the squares, it may be luck.

    Returns
    -------
    The number, and what it leaves of the change; None if it is no better to say that nothing changes.
    """
    n = len(change)
    sizes, size = [0], 1
    while size * size <= n:
        sizes.append(size)
        size *= 2
    squares = np.empty((len(sizes), n))
    for part in np.array_split(np.arange(n), ALTERNATIVES):
        others = np.setdiff1d(np.arange(n), part)
        order = yield from _order(x[others], change[others], sizes[-1])
        fits = []
        for k in sizes:
            fits.append(least_squares(x[others], change[others], order[:k]))
            yield fitting_cells(len(others), min(k, len(order)))
        squares[:, part] = [np.square(change[part] - fit.predict(x[part])) for fit in fits]
    gain = np.square(change) - squares
    sure = gain.mean(axis=1) > STDS * gain.std(axis=1) / np.sqrt(n)
    if not sure.any():
        return None, 1.0
    errors = np.where(sure, np.sqrt(squares.mean(axis=1)), np.inf)
    first = int(np.argmax(errors <= (1.0 + LITTLE) * errors.min()))
    return sizes[first], float(errors[first]) / max(float(change.std()), float(np.finfo(np.float64).tiny))


def _order(x: NDArray[np.float64], change: NDArray[np.float64], terms: int) -> Steps[tuple[int, ...]]:
    """Columns in the order in which they serve."""
    return forward_order.steps(x, change, sigma=float(np.finfo(np.float64).eps), max_terms=terms)


def _fitted(
    clusterer: ModeClusterer,
    table: ExampleTable,
    slots: SlotSignature,
    order: NDArray[np.intp],
    numbers: NDArray[np.intp],
    columns: tuple[int, ...],
) -> Mode:
    """The function of these columns, fitted to many examples: the property's value, not its change."""
    x, change = _data(clusterer, table, slots, order[list(columns)], numbers)
    fit = least_squares(x, change, tuple(range(len(columns))))
    weights = {columns[c]: w for c, w in zip(fit.columns, fit.weights, strict=True)}
    if order[0] == slots.column(0, clusterer.target.property):  # the task's values count from 0
        weights[0] = weights.get(0, 0.0) + 1.0
    places = tuple(sorted(weights))
    whole = LinearFit(places, tuple(weights[c] for c in places), fit.intercept, fit.rss)
    roles = identify_roles(reordered(whole, order), slots)
    sigma = float(np.sqrt(fit.rss / len(numbers)))
    return Mode(NOISE, clusterer.target, roles, fit.intercept, sigma=sigma)
