"""What a body sees of a single scene, by the compiled kernel: relations, contexts and features of pairs.

The same bits as `relgym.scene.relations` and `relgym.scene.surroundings` give, in some microseconds instead of some
hundred. What the kernel can't look at is left to them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relgym.model.bodies import body_of, check_bodies
from relgym.program import records as ir
from relgym.program.machine import Machine
from relgym.program.tape import encoded
from relgym.scene.contacts import APPROACH_EPS
from relgym.scene.objects import SceneLayout
from relgym.scene.relations import Extractor

__all__ = ["Seen", "Sight"]


class Seen(NamedTuple):
    """What one body sees of one scene of K bodies.

    Attributes
    ----------
    table
        Which relation holds for which ordered pair, shape ``(1, R, K, K)``.
    close, struck
        `relgym.scene.surroundings.Surroundings`, shape ``(1, K)``; the second None without `parting`.
    pair
        Contact features, and the bodies' own numbers, shape ``(1, K, F)``; NaN for the body itself.
    order
        Numbers of the other bodies in canonical order, shape ``(1, K - 1)``.
    """

    table: NDArray[np.bool_]
    close: NDArray[np.bool_]
    struck: NDArray[np.bool_] | None
    pair: NDArray[np.float64]
    order: NDArray[np.intp]


class Sight:
    """Looks at single scenes of a layout.

    Parameters
    ----------
    machine
        The compiled kernel.
    extractor, layout
        Of whose relations it tells, and of which scenes.
    numbers
        Columns of the bodies' own numbers, shape ``(K, P)``; the layout's width where there is none.
    parting
        Whether a body that is being left is left out of what is close.

    Raises
    ------
    BeyondError
        The kernel can't look at such bodies.
    """

    def __init__(
        self,
        machine: Machine,
        extractor: Extractor,
        layout: SceneLayout,
        numbers: NDArray[np.intp],
        *,
        parting: bool,
    ) -> None:
        check_bodies(extractor.axes, extractor.geometry, layout)
        program = _program(extractor, layout, numbers, parting=parting)
        self._space = encoded(program).space()
        self._machine, self._parting = machine, parting
        count, width = len(program.bodies), len(program.facts) + numbers.shape[1]
        self._shapes = (1, len(program.relations), count, count), (1, count), (1, count, width)

    def see(self, vector: NDArray[np.float64], body: int) -> Seen | None:
        """What a body sees of a scene; None: arrays must look, or can say why not."""
        square, row, block = self._shapes
        told = np.empty(square, dtype=np.bool_), np.empty(row, dtype=np.bool_), np.empty(row, dtype=np.bool_)
        pair, order = np.empty(block), np.empty(row, dtype=np.int64)
        vector = np.ascontiguousarray(vector, dtype=np.float64)
        places = (each.ctypes.data for each in (vector, *told, pair, order))
        if self._machine.see(self._space.ctypes.data, body, *places):
            return None
        table, close, struck = told
        return Seen(table, close, struck if self._parting else None, pair, order[:, 1:])


def _program(
    extractor: Extractor, layout: SceneLayout, numbers: NDArray[np.intp], *, parting: bool
) -> ir.Program:
    """A program that predicts nothing, but asks for all that there is to be seen."""
    axes, schema = extractor.axes, extractor.schema
    nan = 2 * layout.width
    names = sorted({layout.types[i].name for i in layout.bodies})
    return ir.Program(
        layout.width,
        2 * layout.width + 3,
        (),
        tuple(body_of(axes, layout, k) for k in range(len(layout.bodies))),
        tuple(names.index(layout.types[i].name) for i in layout.bodies),
        len(axes.used),
        axes.up,
        axes.turn,
        extractor.eps,
        APPROACH_EPS,
        schema.precision,
        tuple(extractor.names),
        frozenset(range(len(extractor.names))),
        tuple(extractor.features),
        tuple(tuple(nan if c == layout.width else int(c) for c in row) for row in numbers),
        schema.offsets,
        parting,
        True,
        None,
        (),
        (),
        (),
    )
