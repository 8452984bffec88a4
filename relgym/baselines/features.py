"""Scenes as rows of numbers, in two ways: the thesis' (all objects' properties) and ours (what touches or is near).

A comparison is fair between learners that were shown the same (§4.7). Rows of both kinds begin with the target
object's own numbers; every other object (thesis) or contact follows with equally many columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from relgym.baselines.base import Float2D
from relgym.errors import ConfigError, SchemaError
from relgym.scene.objects import POSE, SceneLayout
from relgym.scene.relations import Extractor
from relgym.scene.schema import SceneSchema

__all__ = ["FEATURES", "ContactFeatures", "Features", "ThesisFeatures", "columns", "features"]

_PLACE = tuple(POSE[:3])


class Features(Protocol):
    """A way to see the scenes of one schema around one object."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        ...

    @property
    def own(self) -> int:
        """How many columns at the beginning are the target object's own."""
        ...

    @property
    def objects(self) -> int:
        """How many other objects follow, with equally many columns each."""
        ...

    def rows(self, layout: SceneLayout, vectors: Float2D) -> Float2D:
        """Features of scenes of shape ``(n, layout.width)``, shape ``(n, len(names))``."""
        ...


@dataclass(frozen=True)
class ThesisFeatures:
    """All properties of all objects, in the schema's order (§4.7.1).

    Parameters
    ----------
    schema
        The scenes' schema.
    target
        Name of the object around which to look.
    centred
        Whether positions are taken relative to the target's (Figure 4.19) or not (Figure 4.20).
    """

    schema: SceneSchema
    target: str
    centred: bool = True

    @property
    def own(self) -> int:
        """Properties of the target."""
        return len(self.schema.type_of(self.target).properties)

    @property
    def objects(self) -> int:
        """All others."""
        return len(self._others)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Such as ``ball.vx``, ``box.px``."""
        own = [(self.target, p) for p in self.schema.type_of(self.target).properties]
        rest = [(n, p) for n in self._others for p in self.schema.type_of(n).properties]
        return tuple(f"{name}.{prop}" for name, prop in (*own, *rest))

    @cached_property
    def _others(self) -> tuple[str, ...]:
        return tuple(name for name in self.schema.order if name != self.target)

    def rows(self, layout: SceneLayout, vectors: Float2D) -> Float2D:
        """Features of scenes; `SchemaError` when an object of the schema is missing: a row has no place for that."""
        if layout.names != self.schema.order:
            raise SchemaError(
                f"the thesis' features need all of {self.schema.order}, the scenes have {layout.names}: "
                "a row of fixed length can't tell which is missing (§4.9); use the contact features"
            )
        target = layout.index(self.target)
        order = [target, *(i for i in range(len(layout.names)) if i != target)]
        centre = vectors[:, layout.slice(target)]
        parts = []
        for i in order:
            part = vectors[:, layout.slice(i)].copy()
            if self.centred and layout.types[i].has_body:
                for mine, his in _places(layout, i, target):
                    part[:, mine] -= centre[:, his]
            parts.append(part)
        return np.hstack(parts)


def _places(layout: SceneLayout, one: int, target: int) -> list[tuple[int, int]]:
    """Pairs of columns that hold the same component of two objects' positions."""
    ours, his = (layout.types[i].pose_columns()[: len(_PLACE)] for i in (one, target))
    return [(a, b) for a, b in zip(ours, his, strict=True) if a >= 0 and b >= 0]


@dataclass(frozen=True)
class ContactFeatures:
    """The target's own numbers, and what its nearest objects are to it: the contact facts that relgym's clauses see.

    Parameters
    ----------
    schema
        The scenes' schema.
    target
        Name of the object around which to look.
    contacts
        How many of the nearest objects are shown, nearest first.
    """

    schema: SceneSchema
    target: str
    contacts: int = 2
    _extractor: Extractor = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.contacts < 1:
            raise ConfigError(f"contacts must be at least 1, got {self.contacts}")
        object.__setattr__(self, "_extractor", Extractor(self.schema))

    @cached_property
    def _free(self) -> tuple[str, ...]:
        """Own properties that are no pose: a place in the world means nothing."""
        t = self.schema.type_of(self.target)
        pose = {k for k in t.pose_columns() if k >= 0}
        return tuple(p for k, p in enumerate(t.properties) if k not in pose)

    @cached_property
    def _kinds(self) -> tuple[str, ...]:
        """Types of the bodies that may touch the target."""
        return tuple(sorted({t for name, t in self.schema.objects if self.schema.type(t).has_body}))

    @property
    def own(self) -> int:
        """Own properties that are no pose."""
        return len(self._free)

    @property
    def objects(self) -> int:
        """The nearest ones."""
        return self.contacts

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Such as ``vx``, ``1.distance``, ``2.is-floor``."""
        each = ("touching", *self._extractor.features, *(f"is-{kind}" for kind in self._kinds))
        return (*self._free, *(f"{k + 1}.{name}" for k in range(self.contacts) for name in each))

    def rows(self, layout: SceneLayout, vectors: Float2D) -> Float2D:
        """Features of scenes; contacts that there are too few objects for are 0."""
        target = layout.index(self.target)
        body = layout.bodies.index(target)
        relations = self._extractor.extract(layout, vectors)
        facts, distance = relations.contacts(body), relations.distance[:, body]
        nearest = np.argsort(distance, axis=1, kind="stable")[:, : min(self.contacts, len(layout.bodies) - 1)]
        kinds = np.array(
            [[layout.types[i].name == kind for kind in self._kinds] for i in layout.bodies], dtype=np.float64
        )
        every, touched = np.arange(len(vectors)), relations.touched(body)
        parts = [vectors[:, [layout.column(target, p) for p in self._free]]]
        for near in nearest.T:
            touching = touched[every, near]
            parts += [touching[:, None].astype(np.float64), facts[every, near], kinds[near]]
        rows = np.hstack(parts)
        return np.pad(rows, ((0, 0), (0, len(self.names) - rows.shape[1])))


FEATURES: tuple[str, ...] = ("thesis", "thesis-uncentred", "contact")
"""Names that `features` knows."""


def features(name: str, schema: SceneSchema, target: str) -> Features:
    """The features of that name; `ConfigError` for another one."""
    if name == "contact":
        return ContactFeatures(schema, target)
    if name not in FEATURES:
        raise ConfigError(f"features {name!r}: expected one of {FEATURES}")
    return ThesisFeatures(schema, target, centred=name == "thesis")


def columns(seen: Features, names: Sequence[str]) -> tuple[int, ...]:
    """Where the target's own properties of these names lie."""
    own = [name.rsplit(".", 1)[-1] for name in seen.names[: seen.own]]
    return tuple(own.index(name) for name in names)
