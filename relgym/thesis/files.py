"""Files of the thesis' system: its settings and its examples, from which the same model is learned again."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.errors import ModelFileError, RelgymError
from relgym.files.reading import StoredArrays
from relgym.model.files.storage import (
    read_model,
    schema_from_json,
    schema_to_json,
    target_from_json,
    target_to_json,
    write_model,
)
from relgym.scene.objects import SceneLayout, Target
from relgym.scene.schema import SceneSchema
from relgym.thesis.settings import ThesisSettings

__all__ = ["StoredExamples", "read_examples", "write_examples"]

Example: TypeAlias = tuple[SceneLayout, int, NDArray[np.float64], float]

_KIND: Final = "thesis"


@dataclass(frozen=True)
class StoredExamples:
    """What a file holds.

    Attributes
    ----------
    schema, targets, settings
        Of the model.
    seen
        Number of transitions that the examples come from.
    extra
        Plain data of the caller's.
    examples
        For each target layout, target object, state vector and next value of each example, as they came.
    """

    schema: SceneSchema
    targets: tuple[Target, ...]
    settings: ThesisSettings
    seen: int
    extra: dict[str, Any]
    examples: list[Iterable[Example]]


def write_examples(path: str | os.PathLike[str], stored: StoredExamples) -> None:
    """Write a file, whole or not at all; `ModelFileError` where that can't be."""
    kinds: list[list[list[Any]]] = []
    arrays: dict[str, NDArray[Any]] = {}
    for number, examples in enumerate(stored.examples):
        known: dict[tuple[tuple[str, ...], int], int] = {}
        rows: list[list[NDArray[np.float64]]] = []
        kind, values = [], []
        for layout, target, x, y in examples:
            place = known.setdefault((layout.names, target), len(known))
            if place == len(rows):
                rows.append([])
            rows[place].append(x)
            kind.append(place)
            values.append(y)
        kinds.append([[list(names), target] for names, target in known])
        arrays[f"kind{number}"] = np.array(kind, dtype=np.int32)
        arrays[f"y{number}"] = np.array(values, dtype=np.float64)
        arrays |= {f"x{number}.{place}": np.stack(part) for place, part in enumerate(rows)}
    body = {
        "kind": _KIND,
        "schema": schema_to_json(stored.schema),
        "targets": [target_to_json(t) for t in stored.targets],
        "settings": asdict(stored.settings),
        "seen": stored.seen,
        "extra": stored.extra,
        "arrangements": kinds,
    }
    write_model(path, body, arrays)


def read_examples(path: str | os.PathLike[str]) -> StoredExamples:
    """Read what `write_examples` wrote; `ModelFileError` for anything else."""
    body, arrays = read_model(path)
    if body.get("kind") != _KIND or arrays is None:
        raise ModelFileError(
            f"{path}: expected a file of the thesis' system; WorldModel.load reads relgym's models"
        )
    try:
        schema = schema_from_json(body["schema"])
        targets = tuple(target_from_json(t) for t in body["targets"])
        examples: list[Iterable[Example]] = [
            list(_examples(schema, arrays, number, kinds))
            for number, (_, kinds) in enumerate(zip(targets, body["arrangements"], strict=True))
        ]
        settings = ThesisSettings(**body["settings"])
        return StoredExamples(schema, targets, settings, int(body["seen"]), dict(body["extra"]), examples)
    except (RelgymError, KeyError, IndexError, TypeError, ValueError) as error:
        raise ModelFileError(f"{path}: {error}; save the model again") from None


def _examples(
    schema: SceneSchema, arrays: StoredArrays, number: int, kinds: list[list[Any]]
) -> Iterator[Example]:
    """Examples of one target."""
    layouts = [(schema.layout(names), int(target)) for names, target in kinds]
    rows = [iter(arrays[f"x{number}.{place}"]) for place in range(len(kinds))]
    for kind, y in zip(arrays[f"kind{number}"].tolist(), arrays[f"y{number}"].tolist(), strict=True):
        layout, target = layouts[kind]
        x = np.asarray(next(rows[kind]), dtype=np.float64)
        if x.shape != (layout.width,):
            raise ValueError(f"examples of {layout.width} numbers expected, got {x.shape}")
        yield layout, target, x, float(y)
