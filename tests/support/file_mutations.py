"""Model files changed at random where it hurts: types, values, keys, references, shapes; the checksum always fits."""

from __future__ import annotations

import base64
import copy
import math
import random
import re
from collections.abc import Iterator
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["Arrays", "Mutator"]

Arrays: TypeAlias = dict[str, NDArray[Any]]
_Path: TypeAlias = tuple[str | int, ...]

STRANGE: tuple[Any, ...] = (
    None, True, False, -1, 0, 1, 2, 3, 7, 255, 2**15, 2**31, 2**53, 2**63, 2**64, -(2**63), 10**30, 10**400,
    0.0, -0.0, 0.5, 1.5, -1.0, 1e-320, 1e30, -1e30, 1e160, 1e308, -1e308, math.nan, math.inf, -math.inf,
    "", "x", "a.b", "F1", "F1 - F2", "1", "*", "A", "'", "action", "task", "reward", "terminated", "self", "é∧",
    "a" * 2_000, "px", "px'", "vx'", "sx", "sphere", "box", "world", "trig", "aa", "zz",
    [], {}, [[]], [0], [None], [1, 2, 3], {"x": 1}, [[0, 1]], [["a", 1.0]],
)  # fmt: skip
"""What is put in place of what was there."""


WORDS = (
    "", "0", "-1", "0.0", "1e-320", "1e308", "-1e308", "1e999", "nan", "inf", "9" * 30, "9" * 5_000, "1_000", "if",
    "elif", "else", "always", "not", "no", "some", "or", "and", "max", "min", "(", ")", "((", "[", "]", "A", "B", "Z",
    "n", "t", "v_n", "u_n", "J_n", "J_t", "v'_n", "x", "task.reward", "sin(", "action", "touching", "nothing:", "is",
    "±", "steps", "é",
)  # fmt: skip
"""What is put in place of a word of a text."""


class Mutator:
    """Draws variants of one file.

    Parameters
    ----------
    body, arrays
        What the file holds; never changed.
    rng
        Where chance comes from.
    """

    def __init__(self, body: dict[str, Any], arrays: Arrays | None, rng: random.Random) -> None:
        self.body, self.arrays, self.rng = body, arrays, rng
        self._places: dict[_Path, list[_Path]] = {}
        self._strings: list[str] = []
        self._numbers: list[float] = []
        for path, node in _walk(body, ()):
            self._places.setdefault(tuple("*" if isinstance(k, int) else k for k in path), []).append(path)
            if isinstance(node, str) and len(node) < 60:
                self._strings.append(node)
            if isinstance(node, (int, float)) and not isinstance(node, bool):
                self._numbers.append(node)
        self._patterns = sorted(self._places, key=str)

    def draw(self) -> tuple[dict[str, Any], Arrays | None]:
        """A variant: one to three changes, mostly one."""
        body, arrays = self.body, self.arrays
        for _ in range(self.rng.choice((1, 1, 1, 2, 3))):
            if arrays is not None and self.rng.random() < 0.2:
                arrays = self._other_arrays(arrays)
            else:
                body = self._other_body(body)
        return body, arrays

    def _other_body(self, body: dict[str, Any]) -> dict[str, Any]:
        path = self.rng.choice(self._places[self.rng.choice(self._patterns)])
        try:
            return _changed(body, path, self._mutated)
        except (AttributeError, KeyError, IndexError, TypeError):  # an earlier change took it away
            return body

    def _mutated(self, holder: Any, key: Any) -> None:
        rng, node = self.rng, holder[key]
        ways = [self._strange, self._strange, self._delete]
        if isinstance(node, bool):
            ways.append(self._flip)
        elif isinstance(node, (int, float)):
            ways += [self._nudge] * 6
        elif isinstance(node, str):
            ways += [self._rename] * 3
            if "\n" in node:
                ways += [self._edit] * 12
            elif len(node) > 40:
                ways += [self._scramble] * 4
        elif isinstance(node, list) and node:
            ways += [self._reorder] * 4
        elif isinstance(node, dict):
            ways += [self._swap_fields] * 2
        rng.choice(ways)(holder, key)

    def _strange(self, holder: Any, key: Any) -> None:
        holder[key] = copy.deepcopy(self.rng.choice(STRANGE))

    def _delete(self, holder: Any, key: Any) -> None:
        del holder[key]

    def _flip(self, holder: Any, key: Any) -> None:
        holder[key] = not holder[key]

    def _nudge(self, holder: Any, key: Any) -> None:
        node, rng = holder[key], self.rng
        whole = isinstance(node, int)
        values: list[Any] = [node + 1, node - 1, -node, node * 10, node * 2, rng.choice(self._numbers), 0]
        if not whole:
            values += [node * 1e6, node * 1e150, node * (1 + 1e-9), node + rng.gauss(0, 1), node / 1e9]
        holder[key] = rng.choice(values)

    def _rename(self, holder: Any, key: Any) -> None:
        node, other = holder[key], self.rng.choice(self._strings)
        holder[key] = self.rng.choice((other, other, node + "x", node[1:], node.upper(), node + "'"))

    def _edit(self, holder: Any, key: Any) -> None:
        """Of a text some lines or words go, come twice, change places, or become others."""
        rng = self.rng
        lines = holder[key].split("\n")
        for _ in range(rng.choice((1, 1, 2, 4))):
            k, j = rng.randrange(len(lines)), rng.randrange(len(lines))
            match rng.randrange(7):
                case 0:
                    lines[k] = ""
                case 1:
                    lines.insert(j, lines[k])
                case 2:
                    lines[k], lines[j] = lines[j], lines[k]
                case _:
                    words, others = (re.findall(r"\s+|[\w.]+|\W", lines[at]) for at in (k, j))
                    if words and others:
                        words[rng.randrange(len(words))] = rng.choice((*WORDS, rng.choice(others)))
                        lines[k] = "".join(words)
        holder[key] = "\n".join(lines)

    def _scramble(self, holder: Any, key: Any) -> None:
        """Of an array in base64 some bytes become others, or some are missing."""
        rng = self.rng
        try:
            raw = bytearray(base64.b64decode(holder[key]))
        except ValueError:
            return
        for _ in range(rng.choice((1, 3, 50))):
            if raw:
                raw[rng.randrange(len(raw))] = rng.choice((0, 1, 127, 255, rng.randrange(256)))
        if rng.random() < 0.15:
            raw = raw[: rng.randrange(len(raw) + 1)]
        holder[key] = base64.b64encode(bytes(raw)).decode()

    def _reorder(self, holder: Any, key: Any) -> None:
        node, rng = holder[key], self.rng
        k = rng.randrange(len(node))
        match rng.randrange(6):
            case 0:
                del node[k]
            case 1:
                node.insert(rng.randrange(len(node) + 1), copy.deepcopy(node[k]))
            case 2:
                j = rng.randrange(len(node))
                node[k], node[j] = node[j], node[k]
            case 3:
                node.reverse()
            case 4:
                node[:] = []
            case _:
                node.append(copy.deepcopy(rng.choice(STRANGE)))

    def _swap_fields(self, holder: Any, key: Any) -> None:
        node, rng = holder[key], self.rng
        names = sorted(node)
        if not names or rng.random() < 0.2:
            node[rng.choice(("x", "kind", "extra", "1"))] = copy.deepcopy(rng.choice(STRANGE))
            return
        a, b = rng.choice(names), rng.choice(names)
        node[a], node[b] = node[b], node[a]

    def _other_arrays(self, arrays: Arrays) -> Arrays:
        rng, found = self.rng, dict(arrays)
        name = rng.choice(sorted(found))
        array = found[name].copy()
        way = rng.randrange(9)
        if way < 2:
            del found[name]
            return found if way else found | {f"{name}x": array}
        match way:
            case 2:
                array = array[: rng.randrange(len(array) + 1)]
            case 3:
                array = array.astype(rng.choice(("float64", "int64", "int32", "int16")))
            case 4:
                array = np.concatenate([array, array])
            case 5:
                array = array.reshape(-1) if array.ndim > 1 else array[:, None]
            case 6:
                other = rng.choice(sorted(found))
                array, found[other] = found[other], array
            case _:
                self._other_values(array.reshape(-1))
        found[name] = array
        return found

    def _other_values(self, flat: NDArray[Any]) -> None:
        rng = self.rng
        for _ in range(rng.choice((1, 1, 20)) if flat.size else 0):
            value = rng.choice((0, 1, -1, 2, 7, 100, 2**14, 1e9, 1e30, 1e308, -1e308, 1e-300, math.nan))
            if flat.dtype.kind == "i":
                most = np.iinfo(flat.dtype)
                value = int(max(min(0 if value != value else value, most.max), most.min))
            flat[rng.randrange(flat.size)] = value


def _walk(node: Any, path: _Path) -> Iterator[tuple[_Path, Any]]:
    if path:
        yield path, node
    if isinstance(node, dict):
        for key, inner in node.items():
            yield from _walk(inner, (*path, key))
    elif isinstance(node, list):
        for k, inner in enumerate(node):
            yield from _walk(inner, (*path, k))


def _changed(root: Any, path: _Path, change: Any) -> Any:
    """A copy along the path, changed at its end; what lies beside it is shared, what lies below is copied."""
    new: Any = root.copy()
    holder = new
    for key in path[:-1]:
        holder[key] = holder[key].copy()
        holder = holder[key]
    holder[path[-1]] = copy.deepcopy(holder[path[-1]])
    change(holder, path[-1])
    return new
