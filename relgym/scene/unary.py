"""Unary relations: what kind of object a body is. Every type's name is one, and every ancestor's (§3.4)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relgym.arguments import refusing
from relgym.errors import QueryError
from relgym.scene.objects import SceneLayout
from relgym.scene.schema import SceneSchema

__all__ = ["unary", "unary_names"]


@refusing(QueryError)
def unary(schema: SceneSchema, layout: SceneLayout) -> dict[str, NDArray[np.bool_]]:
    """Return the unary relations of a layout's bodies: every type name with a body, and all its ancestors.

    Returns
    -------
    Shape ``(K,)`` by name, alphabetical; the same names for all layouts of a schema.
    """
    chains = [schema.ancestry(layout.types[i].name) for i in layout.bodies]
    return {name: np.array([name in chain for chain in chains], dtype=bool) for name in unary_names(schema)}


def unary_names(schema: SceneSchema) -> tuple[str, ...]:
    """Return a schema's unary relations, alphabetical: types with a body, and all their ancestors."""
    return tuple(sorted({name for t in schema.types if t.has_body for name in schema.ancestry(t.name)}))
