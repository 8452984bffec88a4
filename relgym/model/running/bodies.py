"""Bodies of a layout as programs know them: outlines, and the columns of poses and velocities."""

from __future__ import annotations

from relgym.program import records as ir
from relgym.scene.axes import Axes
from relgym.scene.objects import SceneLayout, pose_columns
from relgym.scene.shapes import Box, Compound, Sphere, outline

__all__ = ["body_of", "check_bodies", "constants_of"]


def check_bodies(axes: Axes, geometry: str, layout: SceneLayout) -> None:
    """Refuse the bodies that programs have no words for.

    Raises
    ------
    BeyondError
        Arrays must answer.
    """
    shapes = {type(layout.types[i].shape) for i in layout.bodies}
    if shapes and not axes.planar and shapes not in ({Box}, {Sphere}):
        raise ir.BeyondError("a world in space of other bodies than boxes, or spheres")
    if Compound in shapes:
        raise ir.BeyondError("bodies of several convex parts")
    if shapes and geometry != "arrays":
        raise ir.BeyondError(f"the geometry {geometry!r}")
    if len(layout.bodies) > ir.MOST_BODIES:
        raise ir.BeyondError(f"more than {ir.MOST_BODIES} bodies")


def constants_of(layout: SceneLayout) -> tuple[int, int, int]:
    """Registers of NaN, 0 and 1, behind those of the scene before and after."""
    nan = 2 * layout.width
    return nan, nan + 1, nan + 2


def body_of(axes: Axes, layout: SceneLayout, number: int, spin: str | None = None) -> ir.Body:
    """A body of a layout.

    Parameters
    ----------
    axes
        The schema's axes.
    layout, number
        The layout, and which of its bodies.
    spin
        Property that laws read as how fast it turns; None: none.
    """
    zero, one = 2 * layout.width + 1, 2 * layout.width + 2
    index = layout.bodies[number]
    t = layout.types[index]
    shape = t.shape
    assert shape is not None, "a body has a shape"
    used, depth = axes.used, axes.depth
    # `pose_columns` numbers the constants 0 and 1 behind the state vector.
    place = [
        int(c) if c < layout.width else (zero, one)[int(c) - layout.width]
        for c in pose_columns(layout)[0][number]
    ]
    own = t.velocity_columns()
    along = (*used, depth)[:3]
    velocity = [layout.offsets[index] + own[axis] if own[axis] >= 0 else zero for axis in used]
    corners = (
        ()
        if isinstance(shape, Sphere) or not axes.planar
        else tuple((float(a), float(b)) for a, b in outline(shape, (used[0], used[1])))
    )
    kind = "round" if isinstance(shape, Sphere) else "box" if isinstance(shape, Box) else "polygon"
    return ir.Body(
        layout.names[index],
        kind,
        corners,
        (place[along[0]], place[along[1]], place[along[2]]),
        (place[6 + along[0]], place[6 + along[1]], place[6 + along[2]]),
        place[3 + depth],
        (velocity[0], velocity[1], velocity[2] if len(used) > 2 else zero),
        any(own[axis] >= 0 for axis in used),
        zero if spin is None else layout.column(index, spin),
        spin is not None,
        tuple(place),
    )
