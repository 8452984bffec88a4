"""Whatever a public call is given, it works or says what it expected: generated from the public signatures.

Every call is made with arguments that are right, but for one that is replaced by something else: another type, NaN,
infinity, a number that no float can hold, another shape, nothing at all. Nothing but relgym's own errors may come of
it, or Gymnasium's where its contract says so; and a model that refuses what it is given is, to the byte, what it was.
"""

from __future__ import annotations

import inspect
import json
import os
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from public_surface import surface

from relgym.config import ClassificationConfig, ClusteringConfig, ModelConfig
from relgym.errors import RelgymError
from relgym.model.world_model import WorldModel


class Odd:
    """Something that nobody expects."""

    def __repr__(self) -> str:
        return "Odd()"


ODD = Odd()
BAD: list[Any] = [
    None, True, 0, 1, -1, 7, 2**31, 2**63, -(2**64), 10**400, 0.0, -0.5, 1.5, 1e308, -1e308, 5e-324,
    float("nan"), float("inf"), float("-inf"), 1j, "", "x", "ball", "ball.vx", "nan", b"", b"\xff", "\ud800", "\0",
    (), [], {}, set(), [None], [[]], [1, [2]], ["a", 1], [float("nan")], (1, 2), (1, 2, 3), ((1,),), (("a", "b"),),
    {"b": None}, {"x": float("nan")}, {"b": "text"}, {1: 2}, {("b", "vx"): float("nan")}, {("b", "vx"): 10**400},
    {"seed": 1}, {"draws": "many"}, np.array([]), np.zeros((0, 7)), np.zeros(3), np.zeros((2, 3)), np.zeros((2, 2, 2)),
    np.array(["a"]), np.array([None, 1], dtype=object), np.array([np.nan, np.inf]), np.float64("nan"), np.int64(3),
    np.array(1.0), np.full((2, 7), np.nan), np.full(7, 10.0**300), ODD, Odd, lambda: None, lambda x: x, print,
    range(3), iter([]), spaces.Box(-1, 1, (0,)), spaces.Dict({}), spaces.Discrete(2), spaces.Text(5), spaces.Tuple(()),
    Path("/"),
    Path("/nonexistent/file"), "/", [10**400], (float("inf"),) * 3, {"a": {"b": {}}}, slice(None), Ellipsis,
    NotImplemented,
]  # fmt: skip


def outcome(name: str, parameter: str, value: Any) -> str:
    """Empty where a call did what it may; else what it raised."""
    call = surface()[name]
    model = call.owner if isinstance(call.owner, WorldModel) else getattr(call.owner, "model", None)
    before = written(model) if isinstance(model, WorldModel) else None
    try:
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            call.function(**{**call.arguments, parameter: value})
    except (RelgymError, gym.error.Error) as error:
        if not str(error):
            return "an error without words"
        if before is not None and written(model) != before:
            return f"changed the model and raised {error!r}"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return ""


def written(model: WorldModel) -> str:
    return json.dumps(model.to_json(history=True), sort_keys=True)


@pytest.fixture(autouse=True, scope="module")
def elsewhere(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """What is saved under odd names isn't saved here."""
    before = Path.cwd()
    os.chdir(tmp_path_factory.mktemp("bad-calls"))
    yield
    os.chdir(before)


@st.composite
def bad_calls(draw: Any) -> tuple[str, str, Any]:
    name = draw(st.sampled_from(sorted(surface())))
    return name, draw(st.sampled_from(surface()[name].parameters)), draw(st.sampled_from(BAD))


def test_arguments_that_are_right_are_taken() -> None:
    for name, call in surface().items():
        try:
            call.function(**call.arguments)
        except Exception as error:
            pytest.fail(f"{name}: {error!r}")


@settings(
    max_examples=int(os.environ.get("RELGYM_BAD_CALLS", "400")),
    deadline=None,
    suppress_health_check=list(HealthCheck),
)
@given(bad_calls())
def test_every_public_call_refuses_what_it_cannot_use(call: tuple[str, str, Any]) -> None:
    name, parameter, value = call
    assert not outcome(name, parameter, value), f"{name}({parameter}={value!r})"


@pytest.mark.parametrize("config", [ClusteringConfig, ClassificationConfig, ModelConfig])
@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf"), 10**400])
def test_configs_refuse_what_is_no_finite_number(config: Any, value: Any) -> None:
    for name in inspect.signature(config).parameters:
        with pytest.raises(RelgymError, match=name):
            config(**{name: value})
