"""The free law: how an object moves that touches nothing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.arguments import finite
from relgym.config.clustering import ClusteringConfig
from relgym.config.constants import (
    DRAWS,
    FEWEST,
    LEFT_OPEN,
    MOST_ROWS,
    NEARLY_ALL,
    OFTEN,
    ROUNDED,
    ROUNDINGS,
    STDS,
    TYPICAL,
)
from relgym.laws.columns import Sources
from relgym.laws.description import CONSTANT_BITS, EXCEPTION_BITS, function_bits, piece_bits, shorter_apart
from relgym.laws.records import ONE, FreeLaw, Piece, Region
from relgym.laws.regions import find_laws, find_regions
from relgym.laws.store import Store, Stream
from relgym.numeric.changes import changed_at
from relgym.numeric.ransac import consensus
from relgym.numeric.stepwise import LinearFit, forward_stepwise
from relgym.scene.geometry.vectors import FloatArray
from relgym.scheduling.renewal import due

__all__ = ["FreeLearner", "free_motion"]

MOST_TERMS = ClusteringConfig().max_terms
"""A law of free motion has as many terms at most as a mode."""


def free_motion(law: FreeLaw, names: tuple[str, ...], x: FloatArray) -> FloatArray:
    """Next velocities of free objects, shape ``(d, ...)``, from columns ``(len(names), ...)``.

    NaN where two regions meet, as far as that isn't known.
    """
    columns = dict(zip(names, x, strict=True))
    found = np.stack([piece.values(columns, x[0]) for piece in law.components])
    for region in reversed(law.regions):
        inside, outside = region.where(columns)
        there = np.stack([piece.values(columns, x[0]) for piece in region.components])
        found = np.where(inside | (there == found), there, np.where(outside, found, np.nan))
    return found


class FreeLearner:
    """Learns the free law of one type from a stream; an over-specific law is revised when it fails.

    Parameters
    ----------
    sources
        Columns it may read.
    seed
        Seed of the choice of examples that are kept.
    """

    def __init__(self, sources: Sources, *, seed: int) -> None:
        self.sources = sources
        self.law: FreeLaw | None = None
        self._d = len(sources.moving)
        self.store = Store(len(sources.names) + self._d, MOST_ROWS, seed=seed)
        self._rng = np.random.default_rng([seed, Stream.FREE])
        self._news = 0

    @property
    def seen(self) -> int:
        """Number of examples so far."""
        return self.store.seen

    def learn_one(
        self, x: NDArray[np.float64], after: NDArray[np.float64], right: bool, tolerance: float
    ) -> bool:
        """Take up one example; whether the law changed.

        Parameters
        ----------
        x
            The object's columns, shape ``(len(names),)``.
        after
            Its next velocity, and spin if it has one, shape ``(d [+ 1],)``.
        right
            Whether the law explained it.
        tolerance
            Largest residual of an explained component.
        """
        if not np.isfinite(x).all():
            return False
        self.store.add(np.concatenate([x, after]), cell=int(not right))
        if right and not due(self.seen, 1):
            return False
        self._news += 1
        if len(self.store.rows) < FEWEST or self._news <= self._patience():
            return False
        self._news = 0
        return self.fit(tolerance)

    def confirms(self, more: int) -> bool:
        """Whether so many more examples that the law explains change nothing but the choice of those kept."""
        return not any([due(self.seen + k + 1, 1) for k in range(more)])

    def confirm(self, x: NDArray[np.float64], after: NDArray[np.float64]) -> None:
        """`learn_one` of an example that the law explains, where `confirms` says that this is all."""
        if finite(x) and (place := self.store.draw(0)) is not None:
            self.store.put(place, np.concatenate([x, after]), cell=0)

    def _patience(self) -> float:
        """How much news doesn't call for another search: ever more while there is no law, or one that fails."""
        known = self.seen - self._news if self.law is None else self.law.unexplained
        return (OFTEN - 1.0) * known

    def fit(self, tolerance: float) -> bool:
        """Learn the law anew from the examples kept; whether it changed."""
        found = self._fitted(self.store.rows, tolerance)
        if len(gone := self._outdated(found, tolerance)):
            self.store.drop(gone)
            found = self._fitted(self.store.rows, tolerance)
        before, self.law = self.law, found
        return (before and before.says()) != (found and found.says())

    def _outdated(self, found: FreeLaw | None, tolerance: float) -> NDArray[np.intp]:
        """Where examples of a world that has changed are kept (`shorter_apart`).

        What the later law says of earlier ones, too, isn't outdated. Where other laws may hold in other regions, what
        is met late is another region's.
        """
        rows, order = self.store.rows, np.argsort(self.store.arrived)
        if self.sources.where or (found is not None and not found.unexplained):
            return order[:0]
        if (began := changed_at(self.store.cells[order] == 1)) is None:
            return order[:0]
        early, late = order[:began], order[began:]
        then, now = (self._fitted(rows[part], tolerance) for part in (early, late))
        if then is None or now is None:
            return order[:0]
        whole = EXCEPTION_BITS * self._d * len(rows) if found is None else found.bits
        if not shorter_apart(whole, then.bits, now.bits, len(rows)):
            return order[:0]
        return early[~self._explained(now, rows[early], tolerance)]

    def _explained(self, law: FreeLaw, rows: NDArray[np.float64], tolerance: float) -> NDArray[np.bool_]:
        """Which examples a law explains, all components that it is of."""
        x, y = rows[:, : -self._d], rows[:, -self._d :]
        says = free_motion(law, self.sources.names, x.T).T
        explained = np.asarray((np.abs(says - y[:, : says.shape[1]]) <= tolerance).all(axis=1))
        return explained

    def _fitted(self, rows: NDArray[np.float64], tolerance: float) -> FreeLaw | None:
        x, y = rows[:, : -self._d], rows[:, -self._d :]
        if len(rows) < FEWEST:
            return None
        components = tuple(self._component(x, y[:, k], k, tolerance) for k in range(self._d))
        # A spin that follows no law is no reason to have none of the velocity.
        for count in dict.fromkeys((self._d, len(self.sources.velocity))):
            law = self._law(components[:count], (), x, y[:, :count], tolerance)
            # What few constants say of a region, many may say of the bodies that happened to be there.
            if self.sources.where and law.bits > EXCEPTION_BITS * FEWEST:
                law = min(law, self._regional(x, y[:, :count], tolerance) or law, key=_law_bits)
            if law.unexplained <= (1.0 - NEARLY_ALL) * len(rows):
                return law
        return None

    def _law(
        self,
        components: tuple[Piece, ...],
        regions: tuple[Region, ...],
        x: NDArray[np.float64],
        y: NDArray[np.float64],
        tolerance: float,
    ) -> FreeLaw:
        law = FreeLaw(self.sources.type.name, components, regions=regions)
        off = np.abs(free_motion(law, self.sources.names, x.T).T - y)
        wrong = int((~(off <= tolerance).all(axis=1)).sum())
        features = len(self.sources.readable) + 1
        bits = function_bits(components, features, len(y))
        for region in regions:
            bits += function_bits(region.components, features, len(y))
            bits += len(region.bounds) * (1.0 + np.log2(len(self.sources.where)) + CONSTANT_BITS)
        bits += len(components) * EXCEPTION_BITS * wrong
        return replace(law, examples=len(y), unexplained=wrong, bits=float(bits))

    def _regional(self, x: NDArray[np.float64], y: NDArray[np.float64], tolerance: float) -> FreeLaw | None:
        """Laws that hold in different regions, if they explain nearly everything."""
        columns = dict(zip(self.sources.names, x.T, strict=True))
        count = y.shape[1]

        def fit(rows: NDArray[np.intp]) -> tuple[Piece, ...] | None:
            pieces = []
            own = {name: values[rows] for name, values in columns.items()}
            for k in range(count):
                piece = self._component(x[rows], y[rows, k], k, tolerance, mixed=False)
                off = np.abs(piece.values(own, y[rows, k]) - y[rows, k])
                if (off > tolerance).mean() > LEFT_OPEN:
                    return None
                pieces.append(piece)
            return tuple(pieces)

        def obeys(pieces: tuple[Piece, ...]) -> NDArray[np.bool_]:
            values = np.stack([piece.values(columns, y[:, 0]) for piece in pieces], axis=1)
            right = np.asarray((np.abs(values - y) <= tolerance).all(axis=1))
            return right

        place = x[:, len(self.sources.readable) :]
        known = [] if self.law is None else [self.law.components, *(r.components for r in self.law.regions)]
        # What was found before is tried first: more examples mostly move the borders of regions only.
        for laws in (list(dict.fromkeys(known)), find_laws(fit, obeys, place, fewest=FEWEST)):
            if len(laws) < 2 or len(laws[0]) != count:
                continue
            regions = find_regions(laws, [obeys(law) for law in laws], place, self.sources.where)
            found = self._law(laws[0], regions, x, y, tolerance)
            if found.unexplained <= LEFT_OPEN * len(y):
                return found
        return None

    def _component(
        self, x: NDArray[np.float64], y: NDArray[np.float64], k: int, tolerance: float, *, mixed: bool = True
    ) -> Piece:
        """One component's law: the shortest description among a few forms, the plainest first.

        If examples may be mixed with others, they are told from those.

        A body that keeps its velocity, or changes it steadily, is described so as long as that holds; else
        whatever happened to be constant so far (a velocity, say) would stand in for the constant term.
        """
        order = list(self.sources.preference(k))
        names = [self.sources.names[c] for c in order]
        columns, sigma = x[:, order], tolerance / STDS
        steady = float(np.median(y - columns[:, 0]))
        forms = [
            Piece(((names[0], 1.0),)),
            _simplest(LinearFit((0,), (1.0,), steady, 0.0), names, columns, y, tolerance),
        ]
        least = min(_bits(piece, names, columns, y, tolerance) for piece in forms)
        if least > EXCEPTION_BITS * FEWEST:  # what founds a law, no fewer exceptions
            fit = forward_stepwise(columns, y, sigma=sigma, max_terms=MOST_TERMS)
            if mixed and np.abs(y - fit.predict(columns)).max() > tolerance:
                terms = min(len(order), MOST_TERMS)
                found = consensus(
                    columns, y, sigma=sigma, tolerance=tolerance, terms=terms, size=terms + 2, draws=DRAWS,
                    rng=self._rng,
                )  # fmt: skip
                fit = fit if found is None else found.fit
            forms.append(_simplest(fit, names, columns, y, tolerance))
        return min(forms, key=lambda piece: _bits(piece, names, columns, y, tolerance))

    def spread(self) -> float:
        """Standard deviation of what a linear function of all columns leaves, robustly estimated."""
        x, y = self.store.rows[:, : -self._d], self.store.rows[:, -self._d :]
        left = []
        for k in range(self._d):
            if not y[:, k].any():
                continue  # what never moved scatters by nothing
            columns = x[:, list(self.sources.preference(k))]
            start = float(np.abs(y[:, k]).max()) * ROUNDINGS * float(np.finfo(np.float64).eps)
            fit = forward_stepwise(columns, y[:, k], sigma=start, max_terms=MOST_TERMS, eliminate=False)
            left.append(float(np.median(np.abs(y[:, k] - fit.predict(columns)))) / TYPICAL)
        return max(left, default=0.0)

    def to_json(self) -> list[Any]:
        """What further learning needs, but the law and the examples."""
        return [self._news, self._rng.bit_generator.state, self.store.to_json()]

    def restore(self, data: list[Any], arrays: Mapping[str, NDArray[Any]]) -> None:
        """Take over what `to_json` wrote, and the examples."""
        self._news = int(data[0])
        self._rng.bit_generator.state = data[1]
        self.store.restore(data[2], arrays)


def _simplest(
    fit: LinearFit, names: list[str], x: NDArray[np.float64], y: NDArray[np.float64], tolerance: float
) -> Piece:
    """The fit as a piece, weights next to 1 or -1 made exactly that where it explains as much."""
    weights = [float(round(w)) if abs(abs(w) - 1.0) <= ROUNDED else w for w in fit.weights]
    total = np.zeros(len(y))
    for column, weight in zip(fit.columns, weights, strict=True):
        total = total + weight * x[:, column]
    constant = float(np.median(y - total)) if fit.intercept != 0.0 else 0.0
    was, now = (np.abs(y - v) <= tolerance for v in (fit.predict(x), total + constant))
    if now.sum() < was.sum():
        weights, constant = list(fit.weights), fit.intercept
    elif constant != 0.0 and now.any():
        constant = float((y - total)[now].mean())
    terms = [(names[c], w) for c, w in zip(fit.columns, weights, strict=True)]
    return Piece((*terms, *([(ONE, constant)] if constant != 0.0 else [])))


def _bits(
    piece: Piece, names: list[str], x: NDArray[np.float64], y: NDArray[np.float64], tolerance: float
) -> float:
    wrong = np.abs(y - piece.values(dict(zip(names, x.T, strict=True)), y)) > tolerance
    return piece_bits(piece, len(names) + 1, len(y)) + EXCEPTION_BITS * float(wrong.sum())


def _law_bits(law: FreeLaw) -> float:
    return law.bits
