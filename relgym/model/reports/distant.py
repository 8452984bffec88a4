"""Forces between objects that don't touch: which pairs they act between, where no law says what they do.

A spring or a magnet changes a body's velocity along the line to another body. Across that line a linear law holds on:
of each example it explains all numbers but one. How the force goes with the distance needs no guess for that, and it
needn't be the same from one episode to the next. An object is named where that takes fewer bits than anything else:
than a linear law for each of the world's axes, than one across the object's own velocity (resistance acts along it),
and than the line to any other object. What several objects do at once is not told apart.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from relgym.clustering.columns import SlotSignature
from relgym.clustering.examples import ExampleTable
from relgym.config.constants import ALIKE, EVIDENCE, LEFT_OPEN, STDS
from relgym.laws.columns import Sources
from relgym.laws.description import EXCEPTION_BITS, piece_bits
from relgym.laws.records import Piece
from relgym.model.parts import Parts
from relgym.numeric.ransac import consensus
from relgym.numeric.stepwise import LinearFit, forward_stepwise
from relgym.scene.axes import Axes
from relgym.scene.context import relations_of
from relgym.scene.objects import SceneLayout, Target

__all__ = ["DistantForce", "distant_forces"]

ROWS = 1000
"""The newest so many examples of an object that touches nothing are looked at."""

MOST_TERMS = 6
"""Of a linear law for one component."""

DRAWS, FEW_DRAWS = 256, 16
"""Random samples among which a law is sought; and one that must hold of nearly all examples: of some twenty three in
four hold no other ones."""

PAIRS = 600
"""Of many bodies that something unexplained moves the first ones are looked at: so many pairs take some 3 s."""

LEAST = 1e-300
"""A tolerance is no less: nothing is divided by 0."""

_Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class DistantForce:
    """What moves some objects where nothing touches them, and isn't explained.

    Attributes
    ----------
    objects
        Their names; that of their type where scenes don't always hold the same objects.
    other
        The object to which they are pulled, or from which they are pushed.
    sense
        1 if they are pulled there, -1 if they are pushed away, 0 if it is now this and now that.
    trend
        1 if the force grows with the distance, -1 if it falls, 0 if neither holds, or too little is known.
    """

    objects: tuple[str, ...]
    other: str
    sense: int
    trend: int

    def __str__(self) -> str:
        *most, last = self.objects
        whom = f"{', '.join(most)} and {last}" if most else last
        force = {1: "a pull towards", -1: "a push away from", 0: "a force along the line to"}[self.sense]
        goes = {1: ", the stronger the farther apart", -1: ", the weaker the farther apart", 0: ""}[
            self.trend
        ]
        return f"what moves {whom} and isn't explained is {force} {self.other}{goes}"


def distant_forces(parts: Parts, unexplained: Sequence[Target]) -> dict[str, tuple[DistantForce, ...]]:
    """Forces by which objects seem to act on those of a type without touching them, by the type's name.

    Parameters
    ----------
    parts
        The model's state; unchanged.
    unexplained
        Targets that nothing explains: types are looked at of which components of the velocity are among them.

    Notes
    -----
    Cost: some 5 ms for each pair of bodies of which one is of the type, and moved by what isn't explained; at most
    `PAIRS` of them are looked at for each type, twice where laws suppose noise. Where one body alone has more, none.
    """
    found: dict[str, tuple[DistantForce, ...]] = {}
    if parts.laws is None:
        return found
    book = parts.laws.learner.book
    models = {(t.type, t.property): model for t, model in parts.models.items()}
    for name, sources in book.sources.items():
        logs = [models[name, v].clusterer for v in sources.velocity if (name, v) in models]
        wanted = any(t.type == name and t.property in sources.velocity for t in unexplained)
        if not wanted or not logs:
            continue
        # What came before a target was found isn't among its examples, nor what it was left out of.
        shared = reduce(np.intersect1d, [log.rows for log in logs])
        if not len(shared):
            continue
        examples = _Examples(
            parts.tables[name],
            sources,
            Axes.of(parts.schema),
            shared,
            np.stack([log.y[np.isin(log.rows, shared)] for log in logs], axis=1),
            parts.perception.extractor.names,
            parts.schema.layout(),
            max(book.tolerance, LEAST),
        )
        # The noise that laws suppose may be what isn't explained; it is more than rounding, then.
        exact = min(examples.tolerance, max(LEAST, STDS * max(log.floor for log in logs)))
        for tolerance in dict.fromkeys((exact, examples.tolerance)):
            if told := _together(replace(examples, tolerance=tolerance).forces()):
                found[name] = told
                break
    return found


@dataclass(frozen=True, slots=True)
class _Examples:
    """Examples of a type.

    Attributes
    ----------
    table, sources, axes
        Where they are, what free laws of the type read, and the axes in use.
    rows, after
        Numbers of the rows, shape ``(n,)``, and the next velocities, shape ``(n, d)``.
    names
        Names of relations.
    layout
        That of all objects.
    tolerance
        Largest residual of an explained component.
    """

    table: ExampleTable
    sources: Sources
    axes: Axes
    rows: NDArray[np.int64]
    after: _Array
    names: tuple[str, ...]
    layout: SceneLayout
    tolerance: float

    def forces(self) -> Iterator[DistantForce]:
        """What acts on each of the objects."""
        kinds, own = self.table.signature_ids[self.rows], self.table.bodies[self.rows, 0]
        left = PAIRS
        for kind in np.unique(kinds).tolist():
            signature = self.table.signatures[kind]
            bodies = sum(t.has_body for t in signature.types)
            free = (kinds == kind) & ~self._touched(bodies)
            for body in np.unique(own[free]).tolist():
                if left < bodies - 1:
                    return
                found = self._on(signature, body, np.flatnonzero(free & (own == body))[-ROWS:])
                if found is not None:
                    left -= bodies - 1
                    yield from found

    def _touched(self, bodies: int) -> NDArray[np.bool_]:
        """Whether the object touches something, where there are so many bodies, shape ``(n,)``."""
        relation, keys = self.names.index("intersect"), self.table.stratum_keys
        states, which = np.unique(self.table.strata[self.rows], return_inverse=True)
        tables = (relations_of(keys[state], len(self.names), bodies) for state in states.tolist())
        return np.array([table[relation, 0].any() for table in tables], dtype=np.bool_)[which]

    def _on(
        self, signature: SlotSignature, body: int, part: NDArray[np.intp]
    ) -> tuple[DistantForce, ...] | None:
        """What acts on one object, in examples of one signature in which it touches nothing; None: all is explained."""
        if self.after[part].size < EVIDENCE:
            return None
        rows = self.rows[part]
        x, y = self.table.x[rows], self.after[part]
        velocity = x[:, [signature.column(0, name) for name in self.sources.velocity]]
        columns = self._columns(signature, x, velocity)
        lines, slots = self._lines(signature, x, rows)
        # Bits of a number that isn't explained: how far changes go beyond the tolerance.
        change = float(np.abs(y - velocity).max()) / self.tolerance
        price = min(EXCEPTION_BITS, math.log2(max(change, 1.0)))
        plain = [self._law(columns, component, price) for component in y.T]
        if not lines or sum(wrong for _, _, wrong in plain) < EVIDENCE:
            return None
        along = self._across(velocity, columns, y, price)[0]
        told = {other: self._across(line, columns, y, price) for other, line in lines.items()}
        best = min(told, key=lambda other: told[other][0])
        # A line on which several objects always lie names none of them.
        others = (bits for other, (bits, _, _) in told.items() if other != best)
        least = min(sum(bits for _, bits, _ in plain), along, *others)
        bits, pull, holds = told[best]
        if not holds or bits + math.log2(len(lines)) + EVIDENCE > least:
            return ()
        apart = np.sqrt((lines[best] ** 2).sum(axis=1))
        moved = np.abs(pull) > self.tolerance
        # From one example to the next: masses may be others in the next episode.
        farther, stronger = np.diff(apart[moved]), np.diff(np.abs(pull[moved]))
        changed = np.abs(stronger) > self.tolerance
        force = DistantForce(
            (self._name(signature, 0, body),),
            self._name(signature, slots[best], best),
            _sense(pull[moved]),
            _sense((farther * stronger)[changed]),
        )
        return (force,)

    def _columns(self, signature: SlotSignature, x: _Array, velocity: _Array) -> _Array:
        """What a linear law may read: what free laws read, and a constant."""
        read = [
            k
            for k, c in enumerate(signature.columns)
            if (c.property if c.slot == 0 else f"{signature.types[c.slot].name}.{c.property}")
            in self.sources.readable
        ]
        speed = np.sqrt((velocity**2).sum(axis=1, keepdims=True))
        return np.column_stack([x[:, read], np.ones(len(x)), speed * velocity])

    def _lines(
        self, signature: SlotSignature, x: _Array, rows: NDArray[np.int64]
    ) -> tuple[dict[int, _Array], dict[int, int]]:
        """From the object to each other one, by number of the body, shape ``(n, d)``, and a slot where each was.

        Of those that are always there. Which one of a type is in a slot changes from scene to scene.
        """
        lines: dict[int, _Array] = {}
        slots: dict[int, int] = {}
        at = self._places(signature, x, 0)
        for slot, t in enumerate(signature.types):
            if not slot or not t.has_body:
                continue
            there, line = self.table.bodies[rows, slot], self._places(signature, x, slot) - at
            for other in np.unique(there).tolist():
                held = lines.setdefault(other, np.full(line.shape, np.nan))
                held[there == other] = line[there == other]
                slots[other] = slot
        return {other: line for other, line in sorted(lines.items()) if np.isfinite(line).all()}, slots

    def _places(self, signature: SlotSignature, x: _Array, slot: int) -> _Array:
        """Positions of the objects in a slot, shape ``(n, d)``."""
        t = signature.types[slot]
        found = np.zeros((len(x), len(self.axes.used)))
        for k, axis in enumerate(self.axes.used):
            if (own := t.pose_columns()[axis]) >= 0:
                found[:, k] = x[:, signature.column(slot, t.properties[own])]
        return found

    def _across(self, line: _Array, columns: _Array, y: _Array, price: float) -> tuple[float, _Array, bool]:
        """Bits of the examples with a linear law across a line, what is left along it, and whether the law holds."""
        n, d = y.shape
        apart = np.sqrt((line**2).sum(axis=1, keepdims=True))
        unit = line / np.where(apart > 0.0, apart, 1.0)
        # The columns of the reflection that takes the first axis to the line, but for the first, are across it.
        mirror = unit + np.where(unit[:, :1] < 0.0, -1.0, 1.0) * np.eye(d)[0]
        size = (mirror**2).sum(axis=1)[:, None, None]
        across = (np.eye(d) - 2.0 * mirror[:, :, None] * mirror[:, None] / size)[..., 1:].swapaxes(1, 2)
        features = (across[..., None] * columns[:, None, None]).reshape(n * (d - 1), -1)
        fit, bits, wrong = self._law(features, (across @ y[..., None]).ravel(), price, d)
        weights = np.zeros(features.shape[1])
        weights[list(fit.columns)] = fit.weights
        pull = ((y - columns @ weights.reshape(d, -1).T) * unit).sum(axis=1)
        bits += _exceptions(np.abs(pull) > self.tolerance, price)
        return bits, pull, wrong <= LEFT_OPEN * len(features)

    def _law(self, x: _Array, y: _Array, price: float, components: int = 1) -> tuple[LinearFit, float, int]:
        """A linear law, the bits of the examples with it, and how many it leaves unexplained at so many bits each.

        `components`: for how many of the velocity it is one.
        """
        sigma, terms = self.tolerance / STDS, min(x.shape[1], components * MOST_TERMS)
        fit = forward_stepwise(x, y, sigma=sigma, max_terms=terms)
        wrong = np.abs(fit.predict(x) - y) > self.tolerance
        if wrong.any():
            # A few examples in which something else happened must not spoil it.
            found = consensus(
                x, y, sigma=sigma, tolerance=self.tolerance, terms=terms, size=terms + 3,
                draws=DRAWS if components == 1 else FEW_DRAWS,
                rng=np.random.default_rng(0),
            )  # fmt: skip
            if found is not None and found.size > len(y) - wrong.sum():
                fit, wrong = found.fit, ~found.inliers
        weights = [*fit.weights, *([fit.intercept] if fit.intercept != 0.0 else [])]
        whole = [float(round(w)) if abs(abs(w) - 1.0) <= ALIKE else w for w in weights]
        stated = piece_bits(Piece(tuple((str(k), w) for k, w in enumerate(whole))), x.shape[1], len(y))
        return fit, stated + _exceptions(wrong, price), int(wrong.sum())

    def _name(self, signature: SlotSignature, slot: int, body: int) -> str:
        """Name of a body; that of its type where scenes don't always hold all objects."""
        every = [self.layout.types[index].name for index in self.layout.bodies]
        there = [t.name for t in signature.types if t.has_body]
        whole = sorted(every) == sorted(there)
        return self.layout.names[self.layout.bodies[body]] if whole else signature.types[slot].name


def _exceptions(wrong: NDArray[np.bool_], price: float) -> float:
    """Bits of what isn't explained: which of the numbers they are, and each of them."""
    share = float(wrong.mean())
    which = 0.0 if share in (0.0, 1.0) else -share * math.log2(share) - (1.0 - share) * math.log2(1.0 - share)
    return len(wrong) * which + price * float(wrong.sum())


def _sense(values: _Array) -> int:
    """1 if nearly all are positive, -1 if nearly all are negative, else 0; 0 of few."""
    up, down = int((values > 0.0).sum()), int((values < 0.0).sum())
    nearly = max(up, down) >= EVIDENCE and min(up, down) <= LEFT_OPEN * len(values)
    return int(np.sign(up - down)) if nearly else 0


def _together(forces: Iterable[DistantForce]) -> tuple[DistantForce, ...]:
    """The same, those of several objects in one."""
    found: dict[tuple[str, int, int], list[str]] = {}
    for each in forces:
        found.setdefault((each.other, each.sense, each.trend), []).extend(each.objects)
    return tuple(DistantForce(tuple(dict.fromkeys(names)), *said) for said, names in found.items())
