"""Bodies that earlier versions of the format held, as the present version holds them.

A body is plain data of which nothing is known yet: what isn't as that version had it is left alone, and named by
whoever checks the result against `relgym.model.files.format`.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from typing import Any, Final

from relgym.program.records import RATES

__all__ = ["upgraded"]

_RETIRED: Final[dict[str, dict[str, Any]]] = {
    "clustering": {"approximate": True, "stickiness": "simple", "review": True},
    "classification": {
        "votes": "soft",
        "runoff": True,
        "numeric_literals": True,
        "mode_function_features": True,
        "ambiguous": "drop",
        "both_polarities": True,
        "literal_choice": "gain",
        "mdl": True,
        "min_precision": 0.5,
        "tree_errors": "class",
        "class_balance": 0.0,
        "repair": True,
    },
}
"""Settings that there were before version 3, with the values of which the present rules are made."""

_BUDGETS: Final = frozenset({"work_per_step"})
"""Budgets that there were before version 6; learning goes on within those that there are."""


def upgraded(body: dict[str, Any], version: int) -> dict[str, Any]:
    """A body as the present version has it.

    Parameters
    ----------
    body
        Of a file whose checksum fits; it isn't changed.
    version
        Of the format that it was written in; 1 and 2 differ in the checksum alone.

    Warns
    -----
    UserWarning
        The model was learned with a setting that is gone, and with another value of it than the present rules have.
    """
    if version >= 6:
        return body
    found = dict(body)
    if isinstance(body.get("config"), dict):
        found["config"] = _without_retired(body["config"], version)
    if version >= 5:
        return found
    if isinstance(body.get("regressions"), dict):
        found["regressions"] = {name: _with_say(each) for name, each in body["regressions"].items()}
    if isinstance(body.get("calibration"), dict):
        found["calibration"] = {
            name: _one_regression(_completed(each, version)) for name, each in body["calibration"].items()
        }
    return found


def _without_retired(config: Mapping[str, Any], version: int) -> dict[str, Any]:
    """Settings without those that are gone."""
    found = {name: value for name, value in config.items() if name not in _BUDGETS}
    other: list[str] = []
    for part, retired in _RETIRED.items() if version < 3 else ():
        given = config.get(part)
        if not isinstance(given, dict):
            continue
        found[part] = {name: value for name, value in given.items() if name not in retired}
        other += [
            f"{part}.{name}={value!r:.40}"
            for name, value in given.items()
            if name in retired and value != retired[name]
        ]
    if other:
        warnings.warn(
            f"the model was learned with {', '.join(other)}, which relgym no longer has; it now predicts and learns "
            "by the rules that all models have, and what it says may differ: learn it anew to be sure",
            UserWarning,
            stacklevel=2,
        )
    return found


def _completed(calibration: Any, version: int) -> Any:
    """A calibration with all that version 4 tells."""
    if version >= 4:
        return calibration
    return _with_runs(calibration) if version < 3 else _steady(calibration)


def _with_runs(calibration: Any) -> Any:
    """A calibration with the fields that tell how often each kind of predictions comes, and in what runs.

    Version 2 got them on the way. Where they are missing, a kind came as often as anybody's values in it were looked
    back at, no run is known, and laws are as likely as modes.
    """
    if not isinstance(calibration, dict):
        return calibration
    cells = calibration.get("cells")
    completed = [_cell(each) for each in cells] if isinstance(cells, list) else cells
    return _steady({"vouched": 0.0, **calibration, "cells": completed})


def _steady(calibration: Any) -> Any:
    """A calibration with the fields that version 4 brought: how many predictions of a kind came true in a row.

    Where they are missing none did, so that what comes next is learned from whole.
    """
    if not isinstance(calibration, dict) or not isinstance(calibration.get("cells"), list):
        return calibration
    cells = [{"steady": 0, "passed": 0, **c} if isinstance(c, dict) else c for c in calibration["cells"]]
    return {**calibration, "cells": cells}


def _cell(cell: Any) -> Any:
    if not isinstance(cell, dict) or not isinstance(cell.get("records"), list):
        return cell
    records = [
        [*each, [0.0] * 4] if isinstance(each, list) and len(each) == 5 else each for each in cell["records"]
    ]
    trials = [each[1] for each in records if isinstance(each, list) and len(each) == 6]
    heard = max((each for each in trials if isinstance(each, (int, float))), default=0.0)
    return {"heard": heard, **cell, "records": records}


_LINEAR: Final = 2
"""Place of an expert that there was before version 5: linear regression, which is part of regression on everything."""


def _one_regression(calibration: Any) -> Any:
    """A calibration without the expert that is gone; where it spoke, the one that it is part of does."""
    if not isinstance(calibration, dict) or not isinstance(calibration.get("cells"), list):
        return calibration
    return {**calibration, "cells": [_without_linear(cell) for cell in calibration["cells"]]}


def _without_linear(cell: Any) -> Any:
    if not isinstance(cell, dict):
        return cell
    found = dict(cell)
    if isinstance(speaker := cell.get("speaker"), int):
        found["speaker"] = speaker - (speaker > _LINEAR)
    if isinstance(squares := cell.get("squares"), list):
        found["squares"] = squares[:_LINEAR] + squares[_LINEAR + 1 :]
    if isinstance(records := cell.get("records"), list):
        found["records"] = [
            [each[0] - (each[0] > _LINEAR), *each[1:]] if _tells(each) else each
            for each in records
            if not _tells(each) or each[0] != _LINEAR
        ]
    return found


def _tells(record: Any) -> bool:
    """Whether a record says whose it is."""
    return isinstance(record, list) and bool(record) and isinstance(record[0], int)


def _with_say(regression: Any) -> Any:
    """A regression with what version 5 tells of its words: how far each rate by which they count has a say.

    Before, a word counted for 1 / (1 + s q / b) at a squared distance q, of which the words before it left b more than
    it, s: now the rate next to s / b has the say. Where nothing is known of that the word counts everywhere.
    """
    if not isinstance(regression, dict) or not isinstance(regression.get("targets"), list):
        return regression
    found = dict(regression)
    try:
        nothing, linear, products = (list(map(float, each)) for each in found.pop("left", ()))
        least = map(min, nothing, linear)
        found["say"] = [list(map(_say, nothing, linear)), list(map(_say, least, products))]
    except (OverflowError, TypeError, ValueError):
        found["say"] = [[_say(1.0, 0.0) for _ in regression["targets"]]] * 2
    return found


def _say(before: float, left: float) -> list[float]:
    rate = left / (before - left) if before > left else math.inf
    if rate > 2.0 * RATES[-1]:
        return [0.0] * len(RATES)
    nearest = min(RATES, key=lambda each: abs(math.log(each + 1e-3) - math.log(rate + 1e-3)))
    return [float(each == nearest) for each in RATES]
