"""The relational state of one scene, for people: which relations hold between which named objects."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from relgym.arguments import refusing
from relgym.errors import ObservationError, QueryError
from relgym.scene.objects import Scene
from relgym.scene.relations import Extractor

__all__ = ["RelationalState", "relational_state"]


@dataclass(frozen=True, slots=True)
class RelationalState:
    """Relations of one scene by name, each a set of tuples of object names.

    Parameters
    ----------
    relations
        All relations of the schema, unary ones included, alphabetical; those that never hold are empty.
    """

    relations: Mapping[str, frozenset[tuple[str, ...]]]

    @refusing(QueryError)
    def tuples(self, name: str) -> frozenset[tuple[str, ...]]:
        """Tuples of object names for which a relation holds; `QueryError` where there is no such relation."""
        try:
            return self.relations[name]
        except KeyError:
            raise QueryError(f"unknown relation {name!r}; there are {list(self.relations)}") from None

    def __iter__(self) -> Iterator[tuple[str, tuple[str, ...]]]:
        return ((name, objects) for name, found in self.relations.items() for objects in sorted(found))

    def __str__(self) -> str:
        return "\n".join(f"{name}({', '.join(objects)})" for name, objects in self)


@refusing(ObservationError)
def relational_state(scene: Scene, extractor: Extractor | None = None) -> RelationalState:
    """Return the relations of a scene; pass an `extractor` of its schema to use its settings and caches."""
    extractor = Extractor(scene.schema) if extractor is None else extractor
    layout = scene.layout
    found = extractor.extract(layout, scene.vector[None])
    names = [layout.names[i] for i in layout.bodies]
    relations: dict[str, frozenset[tuple[str, ...]]] = {
        name: frozenset((names[a], names[b]) for a, b in zip(*found.table[0, r].nonzero(), strict=True))
        for r, name in enumerate(found.names)
    }
    for name, holds in extractor.unary(layout).items():
        relations[name] = frozenset((names[k],) for k in holds.nonzero()[0])
    return RelationalState(dict(sorted(relations.items())))
