"""What least squares on a type's own numbers and the action say of its targets: a baseline beside modes and guesses.

Regression of the change on (x, u, 1), and on squares and products of these where they are few, is what anybody would
try first. So it is tried beside everything else, and where it codes what comes in fewer bits it gives the value
(`relgym.model.predicting.calibration`). It claims nothing: it has no conditions.

Where a row lies far from all that were learned, a regression errs by far more than among them, and the more so the more
columns it has. So the second kind counts each word as far as its leverage h allows: first that nothing changes, then
the linear one's, then the products'. What a regression leaves, s in the mean square in the midst of n rows of d
columns, is mostly misfit: other slopes would suit other places. That grows with the squared distance from what is
known, which is h n, and d of a row like those: to s (1 + h n / d), of fewer rows than columns to s (1 + h). What the
words before it leave is more by b everywhere. What adds up to the least error is b / (b + s h n / d) of its word, and
the rest of theirs (shrinkage: James & Stein 1961).
"""

from __future__ import annotations

from base64 import b64decode, b64encode
from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.columns import PRIME, SlotSignature
from relgym.config.constants import BEYOND, SUMMABLE
from relgym.numeric.online_ridge import OnlineRidge
from relgym.scene.objects import TASK

__all__ = ["KINDS", "Regressed", "Regression"]

KINDS = 2
"""Linear; and what all together say, squares and products too, as far as the leverage allows."""

FIRST = 64
"""So many rows tell where a column lies and how far it varies; from then on it is regressed on."""


class Regressed(NamedTuple):
    """What regressions say of some rows.

    Attributes
    ----------
    changes
        Predicted changes, shape ``(n, KINDS, targets)``: NaN where a regression isn't made, never far beyond the
        changes that were seen.
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
    """

    def __init__(self, most: int) -> None:
        self.names: tuple[str, ...] = ()
        self.targets: list[str] = []
        self.seen = 0
        self._most = most
        self._ridges: list[OnlineRidge] = []
        self._waiting: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []
        self._centre = np.zeros(0)
        self._scale = np.ones(0)
        self._range = np.zeros((2, 0))  # smallest and largest change of each target
        # Mean squares of what was left of each target, where h is 0: by that nothing changes, and each regression.
        self._left = np.zeros((1 + KINDS, 0))
        self._places: dict[int, tuple[SlotSignature, NDArray[np.intp] | None]] = {}
        self._texts: dict[int, tuple[NDArray[np.float32], str]] = {}  # see `_text`

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_places": {}, "_texts": {}}  # keyed by identity, which a copy doesn't share

    def learn_one(
        self, signature: SlotSignature, row: NDArray[np.float64], changes: Mapping[str, float]
    ) -> None:
        """Take in one example: a row of the signature's columns, and what each target changed by."""
        if not self.names:
            self.names = _names(signature)
        places = self._columns(signature)
        if places is None or not 0 < len(places) <= self._most:
            return
        self.targets += [name for name in changes if name not in self.targets]
        self.seen += 1
        x, y = row[places], np.array([changes.get(name, 0.0) for name in self.targets])
        missing = len(y) - self._range.shape[1]
        if missing:
            self._range, self._left = (np.pad(a, ((0, 0), (0, missing))) for a in (self._range, self._left))
        self._range = np.stack([np.minimum(self._range[0], y), np.maximum(self._range[1], y)])
        if self._ridges:
            self._compare(x, y)
            self._add(x, y)
            return
        self._waiting.append((x, y))
        if len(self._waiting) == FIRST:
            self._begin()

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
        size = np.abs(np.concatenate([np.zeros((1, len(y))), found[0]]) - y)
        size[1:] /= np.sqrt(1.0 + leverage[0] * self._growth())[:, None]
        known = np.isfinite(size)
        rate = min(1.0, 2.0 / (self._ridges[0].rows - FIRST + 1))  # each counts in proportion to its number
        squares = np.square(np.minimum(np.where(known, size, 0.0), np.sqrt(SUMMABLE)))
        begun = np.where(np.isfinite(self._left), self._left, squares)
        self._left = np.where(known, begun + rate * (squares - begun), self._left)

    def _add(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> None:
        with np.errstate(over="ignore"):  # what isn't finite is left out
            shown = self._shown(self._scaled(x[None]))
        for ridge, columns in zip(self._ridges, shown, strict=False):
            ridge.add(columns[0], y)

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
        if not self._ridges or (places := self._columns(signature)) is None:
            return None
        found, leverage = self._said(x[:, places])
        whole = np.zeros_like(found[:, 0])
        for k in range(len(self._ridges)):
            word = found[:, k]
            whole = np.where(
                np.isfinite(word), whole + self._share(k, leverage[:, k]) * (word - whole), whole
            )
        found[:, 1] = np.where(np.isfinite(found[:, 0]), whole, np.nan)
        first = self._ridges[0]
        with np.errstate(over="ignore"):
            return Regressed(found, leverage[:, 0] / min(1.0, first.columns * (1.0 / max(first.rows, 1))))

    def _said(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """What each regression says of rows of its columns, ``(n, KINDS, targets)``, and leverages, ``(n, KINDS)``."""
        found = np.full((len(x), KINDS, len(self.targets)), np.nan)
        leverage = np.zeros((len(x), KINDS))
        with np.errstate(over="ignore", invalid="ignore"):  # of a gross error nothing is told
            shown = self._shown(self._scaled(x))
            for k, (ridge, columns) in enumerate(zip(self._ridges, shown, strict=False)):
                found[:, k, : len(ridge.weights)] = ridge.predict(columns)
                leverage[:, k] = ridge.leverage(columns)
        return np.clip(found, *self._bounds()), leverage

    def _share(self, kind: int, leverage: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far a regression's word counts, at leverages ``(n,)``, for each target, shape ``(n, targets)``."""
        bias, left = self._bias(kind)
        with np.errstate(over="ignore", invalid="ignore"):
            more = np.where(left > 0.0, left * leverage[:, None], 0.0)
            return np.where(bias > 0.0, bias / (bias + more), 0.0)

    def _bias(self, kind: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """How much more the words before a regression leave of each target than it, and what it leaves more at h = 1.

        In the mean square. Where nobody ever compared them it has the last word.
        """
        left = self._left[kind + 1]
        known = np.isfinite(left)
        bias = np.maximum(self._left[: kind + 1].min(axis=0) - left, 0.0)
        return np.where(known, bias, 1.0), np.where(known, left * self._growth()[kind], 0.0)

    def _growth(self) -> NDArray[np.float64]:
        """By how much of itself what each regression leaves grows with a leverage of 1, shape ``(KINDS,)``."""
        found = np.ones(KINDS)
        for k, ridge in enumerate(self._ridges):
            found[k] = max(1.0, ridge.rows / ridge.columns)
        return found

    def fit(
        self, signature: SlotSignature
    ) -> tuple[list[int], list[float], list[float], list[tuple[tuple[float, ...], str]]] | None:
        """What is the same for all targets: columns of a row, their centres and scales; None while there is nothing.

        And what the leverage in each regression is worked out from: mean and packed spread.
        """
        if not self._ridges or (places := self._columns(signature)) is None:
            return None
        reach = [(tuple(r.mean.tolist()), self._text(k)) for k, r in enumerate(self._ridges)]
        return places.tolist(), self._centre.tolist(), self._scale.tolist(), reach

    def sums(self, target: str) -> tuple[tuple[tuple[float, ...], ...], tuple[float, float]] | None:
        """Weights of each regression for a target, and bounds of the change; None where nothing is known of it."""
        if not self._ridges or target not in self.targets:
            return None
        k = self.targets.index(target)
        least, most = self._bounds()[:, k].tolist()
        weights = (  # a file may know those of some targets alone
            r.weights[k].tolist() if k < len(r.weights) else [np.nan] * (r.columns + 1) for r in self._ridges
        )
        return tuple(map(tuple, weights)), (least, most)

    @property
    def trusted(self) -> NDArray[np.float64]:
        """How far the word of each regression counts for each target, shape ``(targets, regressions, 3)``.

        What the words before it leave more than it, what it leaves more at h = 1, both in the mean square, and 1 / rows
        (`relgym.program.records.Trusted`).
        """
        found = np.empty((len(self.targets), len(self._ridges), 3))
        for kind, ridge in enumerate(self._ridges):
            found[:, kind, 0], found[:, kind, 1] = self._bias(kind)
            found[:, kind, 2] = 1.0 / max(ridge.rows, 1)
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
        compared = bool(np.isfinite(self._left).all())  # a file of earlier versions tells nothing of it
        return {
            "names": list(self.names),
            "seen": self.seen,
            "targets": list(self.targets),
            "centre": self._centre.tolist(),
            "scale": self._scale.tolist(),
            "range": self._range.tolist(),
            "left": self._left.tolist() if compared else [],
            "waiting": [[x.tolist(), y.tolist()] for x, y in self._waiting] if history else [],
            "ridges": [[r.rows, r.due, r.weights.tolist()] for r in self._ridges],
            "leverage": [{"mean": r.mean.tolist(), "inverse": _packed(r.spread)} for r in self._ridges]
            if compared
            else [],
        }

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Sums that further learning adds to."""
        found: dict[str, NDArray[Any]] = {}
        for k, ridge in enumerate(self._ridges):
            arrays = ridge.to_arrays()
            found |= {f"gram{k}": arrays["gram"], f"moments{k}": arrays["moments"]}
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
            self._ridges.append(OnlineRidge.restored(int(rows), int(due), parts))
        self._left = np.full((1 + KINDS, len(self.targets)), np.nan)
        if data.get("left"):
            self._left = np.array(data["left"], dtype=np.float64).reshape(self._left.shape)
        for ridge in self._ridges:
            ridge.spread = np.zeros_like(ridge.spread)
        for ridge, known in zip(self._ridges, data.get("leverage", ()), strict=False):
            ridge.mean = np.array(known["mean"], dtype=np.float64)
            ridge.spread = _unpacked(known["inverse"], ridge.columns)


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
