"""Which world axes a schema's geometry looks at, and how they are called."""

from __future__ import annotations

from dataclasses import dataclass

from relgym.scene.schema import SceneSchema

__all__ = ["WORLD", "Axes"]

WORLD = ("x", "y", "z")
"""Names of the world axes."""


@dataclass(frozen=True, slots=True)
class Axes:
    """The axes of a schema's geometry.

    Canonical shapes are described along (first, up, depth): the depth axis is z when y is up and y
    otherwise, the first axis is the remaining one. A planar schema leaves the depth axis out.

    Parameters
    ----------
    used
        World axes (0, 1, 2) that geometry looks at: ``(first, up)`` in the plane, ``(0, 1, 2)`` in space.
    canonical
        World axes that the canonical shapes' (first, up, depth) lie along.
    turn
        +1 or -1: sense in which the rotation about the depth axis turns the (first, up) plane.
    """

    used: tuple[int, ...]
    canonical: tuple[int, int, int]
    turn: float

    @classmethod
    def of(cls, schema: SceneSchema) -> Axes:
        """Return the axes of a schema."""
        up = WORLD.index(schema.up)
        depth = 2 if up == 1 else 1
        first = 3 - up - depth
        # About y, a positive angle turns z towards x: backwards as seen in the (x, z) plane.
        turn = -1.0 if (first, up, depth) == (0, 2, 1) else 1.0
        return cls((first, up) if schema.planar else (0, 1, 2), (first, up, depth), turn)

    @property
    def planar(self) -> bool:
        """Whether the depth axis is left out."""
        return len(self.used) == 2

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the used axes, in their order."""
        return tuple(WORLD[axis] for axis in self.used)

    @property
    def up(self) -> int:
        """Position of the up axis among the used ones."""
        return self.used.index(self.canonical[1])

    @property
    def horizontal(self) -> tuple[int, ...]:
        """Positions of the other used axes."""
        return tuple(k for k in range(len(self.used)) if k != self.up)

    @property
    def depth(self) -> int:
        """World axis of the depth."""
        return self.canonical[2]
