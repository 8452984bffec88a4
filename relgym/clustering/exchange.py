"""Functions of what other objects have where they change places between scenes.

Which box lies at the bottom, and so has its friction in the law, differs from scene to scene; a column follows the box.
So no function fits the rows of several scenes, and one scene doesn't tell the weight of what is constant in it: it has
to come about several times that the same boxes lie in the same places. Here a sample holds rows of a few scenes, read
in one of two ways. Either all objects of a type count alike, as one sum; or in each scene they stand in an order of
their own, drawn at random (random sampling of correspondences, Fischler & Bolles 1981). One scene more than there are
weights on what is constant verifies a function; it has no constant term, which so few scenes can't tell from them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.columns import SlotSignature
from relgym.config.constants import CALL, SAMPLES_ALIKE, SAMPLES_TRIED, SCENE_ROWS
from relgym.numeric.ransac import choose_columns
from relgym.numeric.stepwise import LinearFit, choosing_cells, least_squares, varying_columns
from relgym.scheduling.work import Steps

__all__ = ["Reading", "orders_of", "readings"]


def orders_of(signature: SlotSignature, columns: NDArray[np.intp], draws: int) -> NDArray[np.intp] | None:
    """Where each column's number stands if objects of a type are taken in another order.

    Parameters
    ----------
    signature
        What the columns are of.
    columns
        Some of its columns, those of all objects of a type or of none.
    draws
        Samples that a search draws.

    Returns
    -------
    For each order a place in `columns` for each column, shape ``(orders, len(columns))``, the present one first. Of n
    orders a sample of three scenes has the right ones in one of n^2 times; where all are too many for that, those in
    which objects only move up. None where these are too many, too, or where there is no other order.
    """
    several = [slots for slots in signature.slots_by_type.values() if len(slots) > 1]
    most = math.isqrt(draws)
    if signature.features or not several or math.prod(map(len, several)) > most:
        return None
    every = math.prod(math.factorial(len(slots)) for slots in several) <= most
    arranged = [
        tuple(permutations(slots)) if every else [slots[k:] + slots[:k] for k in range(len(slots))]
        for slots in several
    ]
    described = [signature.at(int(k)) for k in columns]
    places = {(column.slot, column.property): k for k, column in enumerate(described)}
    found = []
    for chosen in product(*arranged):
        moved = {
            a: b for now, then in zip(several, chosen, strict=True) for a, b in zip(now, then, strict=True)
        }
        found.append([places[moved.get(column.slot, column.slot), column.property] for column in described])
    return np.array(found, dtype=np.intp)


@dataclass(frozen=True, slots=True)
class _Scenes:
    """Which rows are of one scene: those in which all that may change places, and takes few values, is the same.

    Attributes
    ----------
    number, sizes
        Scene of each row, and how many rows there are of each scene.
    """

    number: NDArray[np.intp]
    sizes: NDArray[np.intp]

    @classmethod
    def of(cls, x: NDArray[np.float64], movable: NDArray[np.bool_]) -> _Scenes:
        """Those of some rows; `movable`: columns of objects that may change places."""
        few = [k for k in np.flatnonzero(movable) if SCENE_ROWS * len(np.unique(x[:, k])) <= len(x)]
        _, number, sizes = np.unique(x[:, few], axis=0, return_inverse=True, return_counts=True)
        return cls(number.reshape(-1), sizes)

    def drawn(self, draws: int, count: int, fresh: int, rng: np.random.Generator) -> NDArray[np.intp]:
        """Numbers of the rows of samples, shape ``(draws, SCENE_ROWS * count)``: so many of each of `count` scenes.

        The first scene of each holds one of so many rows at the end. Empty where there are too few scenes.
        """
        enough = np.flatnonzero(self.sizes >= SCENE_ROWS)
        first = np.intersect1d(self.number[len(self.number) - fresh :], enough)
        if not len(first) or len(enough) < count:
            return np.empty((0, SCENE_ROWS * count), dtype=np.intp)
        keys = rng.random((draws, len(enough)))
        keys[enough == rng.choice(first, size=(draws, 1))] = -1.0
        chosen = enough[np.argsort(keys, axis=1)[:, :count]]
        begins, sizes = (np.cumsum(self.sizes) - self.sizes)[chosen], self.sizes[chosen]
        places = rng.integers(sizes)[:, :, None] + np.arange(SCENE_ROWS)
        rows = np.argsort(self.number, kind="stable")
        return rows[begins[:, :, None] + places % sizes[:, :, None]].reshape(draws, -1)


@dataclass(frozen=True, slots=True)
class Reading:
    """One way to read rows in which objects change places.

    Attributes
    ----------
    x
        The rows, shape ``(n, k)``.
    orders
        Orders in which the objects of a row may stand, as places among the k columns, shape ``(orders, k)``.
    parts
        The columns of the table that are summed up in each of the k.
    most
        How many weights there may be on what is constant in a scene, one for each object of a type.
    """

    x: NDArray[np.float64]
    orders: NDArray[np.intp]
    parts: tuple[tuple[int, ...], ...]
    most: int
    _scenes: _Scenes

    def best(self, fit: LinearFit, y: NDArray[np.float64], slack: float) -> NDArray[np.float64]:
        """The rows with the objects of each in the order that suits a function best; of equal ones in the first."""
        errors = np.stack([np.abs(y - fit.predict(self.x[:, order])) for order in self.orders])
        first = np.argmax(errors <= errors.min(axis=0) + slack, axis=0)
        return np.take_along_axis(self.x, self.orders[first], axis=1)

    def written_out(self, fit: LinearFit) -> LinearFit:
        """A function of the k columns as one of the table's."""
        weights = {c: w for k, w in zip(fit.columns, fit.weights, strict=True) for c in self.parts[k]}
        columns = tuple(sorted(weights))
        return LinearFit(columns, tuple(weights[c] for c in columns), fit.intercept, fit.rss)

    def candidates(
        self,
        y: NDArray[np.float64],
        *,
        sigma: float,
        loose: float,
        terms: int,
        draws: int,
        fresh: int,
        rng: np.random.Generator,
    ) -> Steps[list[LinearFit]]:
        """Functions, without a constant term, that fit samples of a few scenes; those of fewest terms first.

        Parameters
        ----------
        y
            Responses of shape ``(n,)``.
        sigma, loose
            Noise on y, in units of y, and how many standard deviations a sample's rows may be off.
        terms
            Largest number of weights.
        draws
            Number of samples.
        fresh
            Number of rows at the end, from the scenes of which each sample's first one is.
        """
        x, varying = self.x, varying_columns(self.x)
        _, one = np.unique(self._scenes.number, return_index=True)
        steady = (x == x[one[self._scenes.number]]).all(axis=0)  # throughout each scene
        others = (self.orders != self.orders[0]).any(axis=0)
        others |= np.array([len(part) > 1 for part in self.parts])
        found: list[LinearFit] = []
        counts = range(2, 2 + self.most)  # with one scene more than weights
        for count in counts:
            rows = self._scenes.drawn(max(1, draws // len(counts)), count, fresh, rng)
            order = rng.integers(len(self.orders), size=(len(rows), count))
            order[:, :1] = 0
            a = np.take_along_axis(x[rows], self.orders[np.repeat(order, SCENE_ROWS, axis=1)], axis=2)
            enough = rows.shape[1] * (loose * sigma) ** 2
            sample = np.ascontiguousarray(a[:, :, varying].swapaxes(0, 1))
            chosen, left = choose_columns(sample, y[rows], terms, sigma, enough)
            yield choosing_cells(a.size, terms)
            alike: dict[tuple[int, ...], int] = {}
            for k in np.flatnonzero(left <= enough).tolist():
                picked = tuple(sorted(int(varying[c]) for c in chosen[k] if c >= 0))
                constant = [c for c in picked if steady[c]]
                # As many weights on what is constant as there are scenes would fit anything.
                if len(constant) < count and any(others[c] for c in constant):
                    alike[picked] = alike.get(picked, 0) + 1
                    if alike[picked] <= SAMPLES_ALIKE:
                        found.append(least_squares(a[k], y[rows[k]], picked, intercept=False))
            yield CALL * (1 + len(found))
        return sorted(found, key=lambda fit: fit.terms)[:SAMPLES_TRIED]


def readings(x: NDArray[np.float64], orders: NDArray[np.intp]) -> tuple[Reading, Reading]:
    """Rows with a sum for each property of the objects that may change places; then with these in any order.

    Parameters
    ----------
    x
        Rows of shape ``(n, d)``, oldest first, columns in order of preference.
    orders
        See `orders_of`.
    """
    scenes = _Scenes.of(x, (orders != orders[0]).any(axis=0))
    parts = tuple(dict.fromkeys(tuple(np.unique(places).tolist()) for places in orders.T))
    most = max(map(len, parts))
    sums = np.stack([np.add.reduce(x[:, part], axis=1) for part in parts], axis=1)
    alike = Reading(sums, np.arange(len(parts))[None], parts, most, scenes)
    return alike, Reading(x, orders, tuple((k,) for k in range(x.shape[1])), most, scenes)
