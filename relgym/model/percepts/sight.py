"""What a body sees of a single scene, by the compiled kernel: relations, contexts and features of pairs.

The same bits as `relgym.scene.relations` and `relgym.scene.surroundings` give, in some microseconds instead of some
hundred. What the kernel can't look at is left to them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from threading import Lock
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relgym.model.running.bodies import body_of, check_bodies, constants_of
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
        self._space, self._parting, self._turn = encoded(program).space(), parting, Lock()
        count, width = len(program.bodies), len(program.facts) + numbers.shape[1]
        self._now = np.empty(program.width)
        self._table = np.empty((1, len(program.relations), count, count), dtype=np.bool_)
        self._close, self._struck = np.empty((2, 1, count), dtype=np.bool_)
        self._pair, self._order = np.empty((1, count, width)), np.empty((1, count), dtype=np.int64)
        told = self._now, self._table, self._close, self._struck, self._pair, self._order
        self._see = partial(_see, machine.see, self._space.ctypes.data, *(each.ctypes.data for each in told))

    @property
    def nbytes(self) -> int:
        """What its work space takes, in bytes; at most 2 MB."""
        return self._space.nbytes

    def see(self, vector: NDArray[np.float64], body: int) -> Seen | None:
        """What a body sees of a scene; None: arrays must look, or can say why not."""
        with self._turn:  # another thread may look before this one has copied what it saw
            self._now[:] = vector
            if self._see(body):
                return None
            return Seen(
                self._table.copy(),
                self._close.copy(),
                self._struck.copy() if self._parting else None,
                self._pair.copy(),
                self._order[:, 1:].copy(),
            )


def _see(call: Callable[..., int], space: int, now: int, *places: int) -> int:
    """Let the kernel look at a scene for a body, whose number comes last."""
    *told, body = places
    return call(space, body, now, *told)


def _program(
    extractor: Extractor, layout: SceneLayout, numbers: NDArray[np.intp], *, parting: bool
) -> ir.Program:
    """A program that predicts nothing, but asks for all that there is to be seen."""
    axes, schema = extractor.axes, extractor.schema
    nan, _, one = constants_of(layout)
    names = sorted({layout.types[i].name for i in layout.bodies})
    return ir.Program(
        layout.width,
        one + 1,
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
        (),
    )
