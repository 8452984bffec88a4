"""What least squares on a type's own numbers and the action say of its targets: a baseline beside modes and guesses.

Regression of the change on (x, u, 1), and on squares and products of these where they are few, is what anybody would
try first. So it is tried beside everything else, and where it codes what comes in fewer bits it gives the value
(`relgym.model.predicting.calibration`). It claims nothing: it has no conditions.

Where a row lies far from all that were learned, a regression errs by more than among them, and the more so the more
columns it has. So each word counts as far as its leverage h allows: first that nothing changes, then the linear
regression's, then that of products. At a squared distance q = h n / d (n rows of d columns; 1 in the mean), which of
fewer rows than columns is h, a word counts for 1 / (1 + k q), and those before it for the rest: by k a misfit outgrows
what the word explains (shrinkage: James & Stein 1961; other slopes suit other places). How k does is measured, target
by target: on what came before it was learned, since the next episode, too, may lead where none was; and of the linear
regression as much on rows that are remembered, each as if it hadn't been learned (`OnlineRidge.without`), since more is
known now than when most of them came. Products explain a row that was left out by those next to it. But far rows are
few and come one after the other, so what was best of them needn't be of the next ones: all of some k (`RATES`) have a
say, with weights that fall exponentially with what is left by them, over n rows by the square root of n, as is best
whatever comes (Cesa-Bianchi & Lugosi 2006, §2.3). And what suits most targets of a type is likelier to suit one more of
them: a rate's weight is multiplied by how many of the others have it, and one (empirical Bayes: Robbins 1956).
"""

from __future__ import annotations

import math
from base64 import b64decode, b64encode
from collections.abc import Mapping
from functools import cache
from itertools import takewhile
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.columns import PRIME, SlotSignature
from relgym.config.constants import BEYOND, FIRST, MEMORY, ROUNDS, SUMMABLE
from relgym.numeric.online_ridge import OnlineRidge
from relgym.numeric.spaced_rows import SpacedRows
from relgym.program.records import RATES
from relgym.scene.objects import TASK

__all__ = ["KINDS", "Regressed", "Regression"]

KINDS = ("linear", "quadratic")
"""On the numbers themselves, and on these and their squares and products."""


class Regressed(NamedTuple):
    """What regressions say of some rows.

    Attributes
    ----------
    changes
        Predicted changes, shape ``(n, targets)``: NaN where nothing is regressed on, never far beyond the changes that
        were seen.
    distances
        How far the rows lie from those that were learned, shape ``(n,)``: h n / d, a squared distance that is about 1
        in the mean of those.
    """

    changes: NDArray[np.float64]
    distances: NDArray[np.float64]


class Regression:
    """Regressions of one type's targets on what objects of the type and bodiless ones have.

    Parameters
    ----------
    most
        Most columns (`ModelConfig.regression_columns`); more aren't regressed on.

    Attributes
    ----------
    names
        Names of the columns; empty as long as nothing was learned.
    targets
        Properties predicted, in the order of the responses.
    seen
        Number of examples.
    worked
        Cells that solving took with the latest example.
    revision
        Another number whenever predictions may be others than before.
    """

    def __init__(self, most: int) -> None:
        self.names: tuple[str, ...] = ()
        self.targets: list[str] = []
        self.seen = self.worked = self.revision = 0
        self._most = most
        self._ridges: list[OnlineRidge] = []
        self._waiting: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []
        self._centre = np.zeros(0)
        self._scale = np.ones(0)
        self._range = np.zeros((2, 0))  # smallest and largest change of each target
        # What is left of each target, in the mean square, if a regression's word counts by one of the rates, and if it
        # doesn't count; and how far each rate has a say.
        self._left = np.zeros((len(KINDS), len(RATES) + 1, 0))
        self._say = np.zeros((len(KINDS), len(RATES), 0))
        # Rows to leave out of the linear one, how many of them have been since it was solved, of how many, and the sum
        # of what was left of these.
        self._rows = SpacedRows()
        self._gone_over = self._rows_before = 0
        self._left_out = np.zeros((len(RATES) + 1, 0))
        self._places: dict[int, tuple[SlotSignature, NDArray[np.intp] | None]] = {}
        self._texts: dict[int, tuple[NDArray[np.float32], str]] = {}  # see `_text`

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_places": {}, "_texts": {}}  # keyed by identity, which a copy doesn't share

    def learn_one(
        self, signature: SlotSignature, row: NDArray[np.float64], changes: Mapping[str, float]
    ) -> bool:
        """Take in one example: a row of the signature's columns, and what each target changed by.

        Returns whether that changed the weights.
        """
        self.worked = 0
        if not self.names:
            self.names = _names(signature)
        places = self._columns(signature)
        if places is None or not 0 < len(places) <= self._most:
            return False
        self.targets += [name for name in changes if name not in self.targets]
        self.seen, self.revision = self.seen + 1, self.revision + 1
        x, y = row[places], np.array([changes.get(name, 0.0) for name in self.targets])
        missing = len(y) - self._range.shape[1]
        if missing:
            self._range, self._left, self._say, self._left_out = (
                np.pad(each, ((0, 0),) * (each.ndim - 1) + ((0, missing),))
                for each in (self._range, self._left, self._say, self._left_out)
            )
            self._say[:, 0, -missing:] = 1.0  # all of a word counts
        self._range = np.stack([np.minimum(self._range[0], y), np.maximum(self._range[1], y)])
        if self._ridges:
            first, before = self._ridges[0], [ridge.weights for ridge in self._ridges]
            spread = first.spread
            self._compare(x, y)
            if not self._add(x, y):
                return False
            if first.spread is not spread:  # weights of a new target are new, too, and no solution
                self._begin_leaving_out()
            else:
                self._leave_out(max(1, first.due - first.rows))
            return any(r.weights is not known for r, known in zip(self._ridges, before, strict=True))
        self._waiting.append((x, y))
        if len(self._waiting) == FIRST:
            self._begin()
            self._begin_leaving_out()
        return bool(self._ready)

    @property
    def _ready(self) -> list[OnlineRidge]:
        """Regressions that have been solved; one with products tells what it adds to the linear one."""
        return list(takewhile(attrgetter("solved"), self._ridges))

    def record(self, target: str) -> tuple[float, float, float] | None:
        """Rows learned, squares of a target's changes that would be left of as many others, and those of the changes.

        Of the regression that leaves least, by generalised cross-validation (`OnlineRidge.left`). None: it isn't known.
        """
        if not self._ridges or target not in self.targets:
            return None
        k, first = self.targets.index(target), self._ridges[0]
        left = min(float(ridge.left[k]) for ridge in self._ridges)  # infinite before it is solved
        if not math.isfinite(left):
            return None
        return float(first.rows), first.rows * left, first.rows * float(first.size[k])

    def settle(self) -> None:
        """Solve for all rows that there are; meanwhile weights lag by a tenth of them."""
        if not self._ridges:
            return
        before = self._ridges[0].spread
        for ridge in self._ridges:
            ridge.solve()
        if self._ridges[0].spread is not before:
            self._begin_leaving_out()
        self._leave_out(1)
        self.revision += 1

    def _begin(self) -> None:
        x = np.array([row for row, _ in self._waiting])
        self._centre = np.median(x, axis=0)
        spread = x.std(axis=0)
        self._scale = np.where(spread > 0.0, spread, 1.0)
        d = len(self._centre)
        self._ridges = [OnlineRidge(d, FIRST)]
        if d + d * (d + 1) // 2 <= self._most:
            self._ridges.append(OnlineRidge(d + d * (d + 1) // 2, FIRST))
        for row, y in self._waiting:
            self._add(row, y)
        self._waiting = []

    def _compare(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> None:
        """Take in what each would have left of an example that isn't learned yet; late ones count for more."""
        found, leverage = self._said(x[None])
        if not np.isfinite(leverage).all():  # a gross error, which isn't learned either
            return
        trials = max(1, self._ridges[0].rows - FIRST + 1)
        late = min(1.0, 2.0 / trials)  # each counts in proportion to its number
        with np.errstate(over="ignore"):
            far = leverage * self._growth()
        whole = np.zeros_like(y)
        for kind, (word, q) in enumerate(zip(found[0, : len(self._ready)], far[0], strict=False)):
            known, left = np.isfinite(word), self._left[kind]
            more = np.where(known, word - whole, 0.0)
            squares = _squares(y[None], whole, more[None], np.array([q]))
            left += np.where(known, late * (squares - left), 0.0)
            whole = whole + _counted(self._say[kind], q) * more

    def _begin_leaving_out(self) -> None:
        """The weights are new: what is left of the rows that they come from isn't known of any of them."""
        self._rows.thin(2 * MEMORY)
        self._gone_over, self._rows_before = 0, len(self._rows)
        self._left_out[:] = 0.0

    def _leave_out(self, steps: int) -> None:
        """Leave out some rows, so many that all are gone over in as many steps; then the rates have a new say."""
        begin, first = self._gone_over, self._ridges[0]
        if not first.solved:
            return
        self._gone_over = end = begin - (begin - self._rows_before) // steps
        if begin == end:
            return
        y = self._rows.responses[begin:end]
        word, leverage = first.without(self._rows.columns[begin:end], y)
        least, most = self._bounds()[:, : y.shape[1]]
        far = leverage * self._growth()[0]
        self._left_out[:, : y.shape[1]] += _squares(y, 0.0, np.clip(word, least, most), far) * len(y)
        # What comes from an earlier file remembers few rows at first, which tell less than the say that it has.
        if end == self._rows_before and end >= min(FIRST, first.rows):
            # Each row is tried twice: before it was learned, and left out of all.
            self._say[0] = _says(self._left[0] + self._left_out / end, end)
            trials = first.rows - FIRST
            for kind in range(1, len(self._ready) if trials > 0 else 1):
                self._say[kind] = _says(self._left[kind], trials)

    def _add(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> bool:
        """Learn an example; whether that is one with numbers of which sums are finite."""
        with np.errstate(over="ignore"):  # what isn't finite is left out
            shown = self._shown(self._scaled(x[None]))
        before = self._ridges[0].rows
        for ridge, columns in zip(self._ridges, shown, strict=False):
            ridge.add(columns[0], y)
            self.worked += ridge.worked
        self._rows.widen(len(y))
        taken = self._ridges[0].rows > before
        if taken:
            self._rows.add(shown[0][0], y)
        return taken

    def _scaled(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        return (x - self._centre) / self._scale

    def _shown(self, z: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Columns for each of the regressions."""
        found = [z]
        if len(self._ridges) > 1:
            first, second = _products(z.shape[1])
            found.append(np.concatenate([z, z[:, first] * z[:, second]], axis=1))
        return found

    def values(self, signature: SlotSignature, x: NDArray[np.float64]) -> Regressed | None:
        """What they say of rows ``(n, width)``; None while there is nothing."""
        if not (ready := self._ready) or (places := self._columns(signature)) is None:
            return None
        words, leverage = self._said(x[:, places])
        found, first = np.zeros_like(words[:, 0]), ready[0]
        with np.errstate(over="ignore"):  # what lies that far is far from all
            far = leverage * self._growth()
            for kind in range(len(ready)):
                word, share = words[:, kind], _counted(self._say[kind][:, None], far[:, kind, None])
                found = np.where(np.isfinite(word), found + share * (word - found), found)
            distances = leverage[:, 0] / min(1.0, first.columns * (1.0 / max(first.rows, 1)))
        return Regressed(np.where(np.isfinite(words[:, 0]), found, np.nan), distances)

    def _said(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """What each regression says of rows of its columns, ``(n, kinds, targets)``, and leverages, ``(n, kinds)``."""
        found = np.full((len(x), len(KINDS), len(self.targets)), np.nan)
        leverage = np.zeros((len(x), len(KINDS)))
        with np.errstate(over="ignore", invalid="ignore"):  # of a gross error nothing is told
            shown = self._shown(self._scaled(x))
            for k, (ridge, columns) in enumerate(zip(self._ready, shown, strict=False)):
                found[:, k, : len(ridge.weights)] = ridge.predict(columns)
                leverage[:, k] = ridge.leverage(columns)
        return np.clip(found, *self._bounds()), leverage

    def _growth(self) -> NDArray[np.float64]:
        """The squared distance at a leverage of 1, for each regression, shape ``(kinds,)``."""
        found = np.ones(len(KINDS))
        for k, ridge in enumerate(self._ready):
            found[k] = max(1.0, ridge.rows / ridge.columns)
        return found

    def fit(
        self, signature: SlotSignature
    ) -> tuple[list[int], list[float], list[float], list[tuple[tuple[float, ...], str]]] | None:
        """What is the same for all targets: columns of a row, their centres and scales; None while there is nothing.

        And what the leverage in each regression is worked out from: mean and packed spread.
        """
        if not (ready := self._ready) or (places := self._columns(signature)) is None:
            return None
        reach = [(tuple(r.mean.tolist()), self._text(k)) for k, r in enumerate(ready)]
        return places.tolist(), self._centre.tolist(), self._scale.tolist(), reach

    def sums(self, target: str) -> tuple[tuple[tuple[float, ...], ...], tuple[float, float]] | None:
        """Weights of each regression for a target, and bounds of the change; None where nothing is known of it."""
        if not (ready := self._ready) or target not in self.targets:
            return None
        k = self.targets.index(target)
        least, most = self._bounds()[:, k].tolist()
        weights = (  # a file may know those of some targets alone
            r.weights[k].tolist() if k < len(r.weights) else [np.nan] * (r.columns + 1) for r in ready
        )
        return tuple(map(tuple, weights)), (least, most)

    @property
    def trusted(self) -> NDArray[np.float64]:
        """How far the word of each regression counts for each target, shape ``(targets, regressions, k)``.

        The squared distance at h = 1, 1 / rows, and how far each rate has a say (`relgym.program.records.Trusted`).
        """
        ready, growth = self._ready, self._growth()
        found = np.empty((len(self.targets), len(ready), 2 + len(RATES)))
        for kind, ridge in enumerate(ready):
            found[:, kind, 0], found[:, kind, 1] = growth[kind], 1.0 / max(ridge.rows, 1)
            found[:, kind, 2:] = self._say[kind].T
        return found

    @property
    def reach(self) -> NDArray[np.float64]:
        """Bounds of each target's changes, then what `trusted` says: what changes often, shape ``(targets, k)``."""
        known = self.trusted
        return np.concatenate([self._bounds().T, known.reshape(len(known), -1)], axis=1)

    def _bounds(self) -> NDArray[np.float64]:
        """How far changes go, shape ``(2, targets)``: beyond what was seen by `BEYOND` of its range."""
        least, most = self._range
        slack = BEYOND * (most - least)
        return np.stack([least - slack, most + slack])

    @property
    def solved(self) -> tuple[tuple[object, ...], int]:
        """Arrays that are replaced when weights, or what leverage follows from, change, and the number of targets."""
        return tuple(r.weights for r in self._ridges), len(self.targets)

    def _text(self, kind: int) -> str:
        """The packed spread of a regression, worked out once."""
        ridge = self._ridges[kind]
        known = self._texts.get(kind)
        if known is None or known[0] is not ridge.spread:
            known = self._texts[kind] = ridge.spread, _packed(ridge.spread)
        return known[1]

    def _columns(self, signature: SlotSignature) -> NDArray[np.intp] | None:
        """Where the columns lie in a signature's rows; None where one is missing."""
        known = self._places.get(id(signature))
        if known is None or known[0] is not signature:
            there = {name: k for k, name in zip(_core(signature), _names(signature), strict=True)}
            places = None
            if all(name in there for name in self.names):
                places = np.array([there[name] for name in self.names], dtype=np.intp)
            known = self._places[id(signature)] = (signature, places)
        return known[1]

    # ------------------------------------------------------------------ saving
    def to_json(self, *, history: bool) -> dict[str, Any]:
        """Plain data; with history what further learning needs, too, but the sums in `to_arrays`."""
        return {
            "names": list(self.names),
            "seen": self.seen,
            "targets": list(self.targets),
            "centre": self._centre.tolist(),
            "scale": self._scale.tolist(),
            "range": self._range.tolist(),
            "say": self._say.transpose(0, 2, 1).tolist(),
            "waiting": [[x.tolist(), y.tolist()] for x, y in self._waiting] if history else [],
            "ridges": [[r.rows, r.due, r.weights.tolist()] for r in self._ridges],
            "leverage": [
                {"mean": r.mean.tolist(), "inverse": _packed(r.spread)} if r.solved else None
                for r in self._ridges
            ],
        }

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Sums that further learning adds to."""
        found: dict[str, NDArray[Any]] = {"left": self._left.reshape(-1, len(self.targets))}
        if len(self._rows):
            found |= self._rows.to_arrays()
            found["gone_over"] = np.array([self._gone_over, self._rows_before], dtype=np.int64)
            found["left_out"] = self._left_out
        for k, ridge in enumerate(self._ridges):
            found |= {f"{name}{k}": array for name, array in ridge.to_arrays().items() if name != "weights"}
        return found

    def restore(self, data: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> None:
        """Take over what `to_json` and `to_arrays` wrote; without arrays it can only predict."""
        self.names, self.targets = tuple(data["names"]), list(data["targets"])
        self.seen = int(data["seen"])
        self._centre, self._scale = np.array(data["centre"]), np.array(data["scale"])
        self._range = np.array(data["range"], dtype=np.float64).reshape(2, len(self.targets))
        self._waiting = [(np.array(x), np.array(y)) for x, y in data["waiting"]]
        self._ridges = []
        for k, (rows, due, weights) in enumerate(data["ridges"]):
            parts: dict[str, NDArray[Any]] = {"weights": np.array(weights, dtype=np.float64)}
            if f"gram{k}" in arrays:
                parts |= {"gram": arrays[f"gram{k}"], "moments": arrays[f"moments{k}"]}
                # Files of earlier versions don't say it; what was left lately of all changes is as much.
                before = rows * arrays["left"][len(RATES)] if "left" in arrays else np.zeros(len(weights))
                parts["squares"] = arrays.get(f"squares{k}", before)
                if f"left{k}" in arrays:
                    parts["left"] = arrays[f"left{k}"]
            begun = {part: f"{part}{k}" for part in ("begun", "begun_gram", "begun_moments", "begun_squares")}
            if begun["begun"] in arrays:
                parts |= {part: arrays[name] for part, name in begun.items()}
            self._ridges.append(OnlineRidge.restored(int(rows), int(due), parts))
        count = len(self.targets)
        say = np.array(data["say"], dtype=np.float64).reshape(len(KINDS), count, len(RATES))
        self._say = np.ascontiguousarray(say.transpose(0, 2, 1))
        left = arrays.get("left", np.zeros((len(KINDS) * (len(RATES) + 1), count)))
        self._left = left.reshape(len(KINDS), -1, count).copy()
        self._left_out = np.zeros((len(RATES) + 1, count))
        if "columns" in arrays:
            self._rows = SpacedRows.restored(arrays)
            self._gone_over, self._rows_before = arrays["gone_over"].tolist()
            self._left_out = arrays["left_out"].copy()
        leverage = data.get("leverage", ())
        for k, ridge in enumerate(self._ridges):
            if k >= len(leverage):  # earlier files don't say it
                ridge.spread = np.zeros_like(ridge.spread)
            elif (known := leverage[k]) is None:
                ridge.solved = False
            else:
                ridge.mean = np.array(known["mean"], dtype=np.float64)
                ridge.spread = _unpacked(known["inverse"], ridge.columns)


def _counted(say: NDArray[np.float64], far: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """How far words count, by what each rate has to say, shape ``(rates, ...)``, at squared distances."""
    found: NDArray[np.float64] = say[0]
    for weight, rate in zip(say[1:], RATES[1:], strict=True):
        found = found + weight / (1.0 + rate * far)
    return found


def _squares(
    y: NDArray[np.float64],
    whole: NDArray[np.float64] | float,
    more: NDArray[np.float64],
    far: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Mean squares left of n rows where a word adds to those before it by each of the rates, and not at all.

    Shape ``(rates + 1, targets)``; not all too large.
    """
    shares = np.array([*(1.0 / (1.0 + rate * far) for rate in RATES), np.zeros_like(far)])
    missed = np.minimum(np.abs(whole + shares[:, :, None] * more - y), np.sqrt(SUMMABLE))
    found: NDArray[np.float64] = np.square(missed).mean(axis=1)
    return found


def _says(left: NDArray[np.float64], rows: int) -> NDArray[np.float64]:
    """How far each rate has a say for each target, shape ``(rates, targets)``, by what is left by each, and by none."""
    bits, moves = np.log2(np.maximum(left, math.ulp(0.0))), left[-1] > 0.0
    own = 0.5 * math.sqrt(max(rows, 1)) * (bits.min(axis=0) - bits)
    say = _shared(own)
    for _ in range(ROUNDS):
        others = np.where(moves, say, 0.0)
        others = others.sum(axis=1)[:, None] - others
        say = _shared(own + np.log2(np.maximum(others, 0.0) + 1.0))
    return say[:-1]


def _shared(bits: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shares of one, by bits, along the first axis."""
    weights: NDArray[np.float64] = np.exp2(bits - bits.max(axis=0))
    shares: NDArray[np.float64] = weights / weights.sum(axis=0)
    return shares


@cache
def _products(columns: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Pairs of columns, each with itself and with those behind it."""
    first, second = np.triu_indices(columns)
    return first, second


def _packed(matrix: NDArray[np.float32]) -> str:
    """A symmetric matrix as text: its upper triangle, row by row, little-endian, in base64."""
    return b64encode(matrix[np.triu_indices(len(matrix))].astype("<f4").tobytes()).decode("ascii")


def _unpacked(text: str, columns: int) -> NDArray[np.float32]:
    """What `_packed` wrote."""
    found = np.zeros((columns, columns), dtype=np.float32)
    found[np.triu_indices(columns)] = np.frombuffer(b64decode(text), dtype="<f4")
    return found + np.triu(found, 1).T


def _core(signature: SlotSignature) -> list[int]:
    """Columns of present numbers that mean the same in every signature, what the task says left aside."""
    return [
        k
        for k in range(signature.core)
        if not signature.at(k).property.endswith(PRIME) and signature.types[signature.at(k).slot].name != TASK
    ]


def _names(signature: SlotSignature) -> tuple[str, ...]:
    return tuple(signature.named(k) for k in _core(signature))
