"""Exported Python says what the model says, and needs numpy alone."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from programs import MODELS, arrays, books, crowded, room_schema, scenes_of, with_laws

from relgym.laws.learner import LawLearner
from relgym.model.lowering import lowered
from relgym.model.prediction import OUTCOMES, BatchPrediction
from relgym.program.source import python_source

SENTENCES = tuple(outcome.value for outcome in OUTCOMES)


def run(text: str) -> dict[str, Any]:
    module: dict[str, Any] = {"__name__": "exported"}
    exec(compile(text, "exported.py", "exec"), module)
    return module


def assert_same(text: str, vectors: Any, known: BatchPrediction) -> None:
    after, outcomes, modes, margins, probabilities, intervals = run(text)["predict"](vectors)
    np.testing.assert_array_equal(outcomes, known.outcomes)
    np.testing.assert_array_equal(modes, known.modes)
    np.testing.assert_array_equal(margins, known.margins)
    np.testing.assert_array_equal(probabilities, known.probabilities)
    np.testing.assert_array_equal(intervals, known.intervals)
    np.testing.assert_allclose(after, known.vectors, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", MODELS)
def test_learned_models(name: str) -> None:
    model = MODELS[name]()
    layout, vectors = scenes_of(model, 40)
    assert_same(model.to_python(layout), vectors, arrays(model._parts, layout, vectors))


@settings(max_examples=3, deadline=None)
@given(data=st.data(), shapes=st.integers(1, 3), balls=st.integers(1, 3), seed=st.integers(0, 10**6))
def test_laws_of_any_form(data: st.DataObject, shapes: int, balls: int, seed: int) -> None:
    schema = room_schema(shapes, balls)
    learner = LawLearner(schema, schema.targets or (), seed=0)
    learner.book = data.draw(books(schema))
    parts, layout, vectors = with_laws(schema, learner), schema.layout(), crowded(schema, 12, seed)
    text = python_source(lowered(parts, layout), "laws of any form", SENTENCES)
    with np.errstate(all="ignore"):
        assert_same(text, vectors, arrays(parts, layout, vectors))


def test_it_needs_numpy_alone(tmp_path: Path) -> None:
    model = MODELS["room by laws"]()
    layout, vectors = scenes_of(model, 2)
    file = tmp_path / "room.py"
    file.write_text(model.to_python(layout), encoding="utf-8")
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import room\n"
        f"print(room.predict({vectors.tolist()!r})[1].tolist())\n"
        "print(sorted({n.partition('.')[0] for n in sys.modules} & {'relgym', 'scipy', 'gymnasium', 'numba'}))"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    known = arrays(model._parts, layout, vectors)
    assert said.splitlines() == [str(known.outcomes.tolist()), "[]"]


def test_it_can_be_read() -> None:
    text = MODELS["room by laws"]().to_python()
    assert "def free_ball" in text and "largest(u_n, -0.9" in text and "Laws of motion" in text
