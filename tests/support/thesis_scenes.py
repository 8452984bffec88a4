"""Relational states of three objects for the thesis' FOIL, written by hand."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from relgym.thesis.facts import Facts

TYPES = ("ball", "floor", "ramp")
RELATIONS = ("aligned", "intersect")


def facts(
    *scenes: dict[str, list[tuple[int, int]]], kinds: tuple[str, ...] = ("ball", "floor", "ramp")
) -> Facts:
    """Scenes of three objects; the ball is object 0. A scene maps relations to the pairs for which they hold."""
    binary = np.zeros((len(scenes), 2, 3, 3), dtype=np.bool_)
    unary = np.zeros((len(scenes), 3, 3), dtype=np.bool_)
    for k, scene in enumerate(scenes):
        for name, pairs in scene.items():
            for a, b in pairs:
                binary[k, RELATIONS.index(name), a, b] = True
        for number, kind in enumerate(kinds):
            unary[k, TYPES.index(kind), number] = True
    return Facts(RELATIONS, TYPES, binary, unary, np.zeros((len(scenes), 1), dtype=np.intp))


Scene: TypeAlias = dict[str, list[tuple[int, int]]]
FLYING: Scene = {}
ON_FLOOR = {"intersect": [(0, 1), (1, 0)]}
ON_RAMP = {"intersect": [(0, 2), (2, 0)], "aligned": [(0, 2), (2, 0)]}
