"""A world model as plain data and arrays, and back; what `relgym.model.files.storage` puts into files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.errors import ModelFileError
from relgym.files.reading import check_depth
from relgym.model.files.storage import schema_from_json, schema_to_json, target_from_json, target_to_json
from relgym.model.parts import Parts
from relgym.model.percepts.scenes import Arrival

__all__ = ["parts_from_json", "parts_to_arrays", "parts_to_json"]

_Arrays = dict[str, NDArray[Any]]


def parts_to_json(parts: Parts, *, history: bool) -> dict[str, Any]:
    """Schema, config and everything learned; with history also what further learning needs."""
    # What is under way isn't kept: whoever reads the file begins it again.
    looks = [*([] if parts.inquiry is None else [parts.inquiry.look]), *parts.looks]
    return {
        "schema": schema_to_json(parts.schema),
        "config": parts.config.to_json(),
        "open": parts.open,
        "given": [list(pair) for pair in parts.perception.given],
        "targets": [
            {"target": target_to_json(t), "model": parts.models[t].to_json(history=history)}
            for t in parts.targets
        ],
        **({"looks": [list(look) for look in looks]} if history and looks else {}),
        **({"saved_cells": parts.agenda.saved} if history else {}),
        "tables": [parts.tables[name].to_json() for name in sorted(parts.tables)] if history else [],
        "laws": None if parts.laws is None else parts.laws.to_json(history=history),
        **({} if parts.arrival is None else {"arrival": parts.arrival.to_json()}),
        **({"screen": parts.screen.to_json()} if history else {}),
        "regressions": {
            name: regression.to_json(history=history)
            for name, regression in sorted(parts.regressions.items())
            if regression.seen
        },
    }


def parts_to_arrays(parts: Parts) -> _Arrays:
    """The history: examples of all types and targets, and of the laws."""
    arrays: _Arrays = {}
    for k, type_name in enumerate(sorted(parts.tables)):
        arrays |= {f"table{k}.{name}": a for name, a in parts.tables[type_name].to_arrays().items()}
    for k, target in enumerate(parts.targets):
        arrays |= {f"target{k}.{name}": a for name, a in parts.models[target].to_arrays().items()}
    for k, name in enumerate(_regressed(parts)):
        arrays |= {f"regression{k}.{part}": a for part, a in parts.regressions[name].to_arrays().items()}
    if parts.laws is not None:
        arrays |= {f"laws.{name}": a for name, a in parts.laws.learner.to_arrays().items()}
    return arrays


def parts_from_json(
    given: Mapping[str, Any], arrays: Mapping[str, NDArray[np.generic]] | None
) -> tuple[Parts, dict[str, Any]]:
    """Read what `parts_to_json` and `parts_to_arrays` wrote; without arrays it can only predict.

    Everything is checked before anything is taken over (`relgym.model.files.format`, `relgym.model.files.checks`), and
    what is taken over is what was checked: the records' plain data, not the file's.

    Returns
    -------
    The parts, and all that the file says as plain data of the types declared, without what defaults say.

    Raises
    ------
    ModelFileError
        Something is missing, malformed, out of range, or refers to what isn't there.
    """
    # msgspec is loaded with the first file, not with relgym.
    from relgym.files.records import checked, plain
    from relgym.model.files.checks import check_body, check_settings
    from relgym.model.files.format import Body

    body: Body = checked(given, Body, "the model")
    check_settings(given["config"])
    data = plain(body)
    try:
        check_depth(body.extra)
    except ValueError as error:
        raise ModelFileError(f"extra: {error}; save the model again with other data") from None
    schema = schema_from_json(data["schema"])
    targets = [target_from_json(part["target"]) for part in data["targets"]]
    parts = Parts(schema, body.config, None if body.open else targets)
    for target in targets if parts.open else ():
        parts.add_target(target)
    check_body(body, parts, arrays)
    for k, type_name in enumerate(sorted(parts.tables) if arrays is not None else ()):
        parts.tables[type_name].restore(data["tables"][k], _of(arrays, f"table{k}."), parts.signature_of)
    for k, target in enumerate(targets):
        parts.models[target].restore(data["targets"][k]["model"], _of(arrays, f"target{k}."))
    for k, name in enumerate(sorted(body.regressions)):
        parts.regressions[name].restore(data["regressions"][name], _of(arrays, f"regression{k}."))
    parts.looks = [(name, prop, inert) for name, prop, inert in body.looks]
    if body.saved_cells is not None:
        parts.agenda.saved = body.saved_cells
    if "screen" in data:
        parts.screen.restore(data["screen"])
    if "arrival" in data:
        parts.arrival = Arrival.from_json(data["arrival"], {t.name: t for t in parts.schema.types})
    if parts.laws is not None:
        parts.laws.restore(data["laws"], _of(arrays, "laws."))
        parts.laws.mark(parts.models)
    return parts, data


def _regressed(parts: Parts) -> list[str]:
    """Types whose targets regressions predict."""
    return [name for name, regression in sorted(parts.regressions.items()) if regression.seen]


def _of(arrays: Mapping[str, NDArray[np.generic]] | None, prefix: str) -> _Arrays:
    """Arrays whose names begin with a prefix, without it."""
    return {name[len(prefix) :]: a for name, a in (arrays or {}).items() if name.startswith(prefix)}
