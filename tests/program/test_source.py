"""Exported Python says what the model says, and needs numpy alone."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from programs import MODELS, arrays, books, crowded, looked_back, room_schema, scenes_of, with_laws

from relgym.laws.learner import LawLearner
from relgym.model.predicting.prediction import OUTCOMES, BatchPrediction
from relgym.model.running.lowering import lowered
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


@pytest.mark.parametrize("name", MODELS)
def test_what_somebody_looked_back_at(name: str) -> None:
    model = looked_back(MODELS[name]())
    layout, vectors = scenes_of(model, 40)
    assert_same(model.to_python(layout), vectors, arrays(model._parts, layout, vectors))


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
def test_learned_models_in_24_000_scenes(name: str) -> None:
    model = MODELS[name]()
    layout, vectors = scenes_of(model, 24_000)
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


def test_it_runs_where_there_is_nothing_but_numpy(tmp_path: Path) -> None:
    """`-I -S` leaves the standard library; numpy is all that is put beside it."""
    alone = tmp_path / "site"
    alone.mkdir()
    home = Path(np.__file__).parent
    for folder in (home, home.parent / "numpy.libs"):
        if folder.exists():
            (alone / folder.name).symlink_to(folder)
    asked: dict[str, Any] = {}
    for k, name in enumerate(MODELS):
        model = MODELS[name]()
        layout, vectors = scenes_of(model, 3)
        (alone / f"model{k}.py").write_text(model.to_python(layout), encoding="utf-8")
        asked[f"model{k}"] = vectors.tolist(), arrays(model._parts, layout, vectors).outcomes.tolist()
    code = (
        "import importlib, json, sys\n"
        f"sys.path.append({str(alone)!r})\n"
        "for name, (vectors, known) in json.load(sys.stdin).items():\n"
        "    said = importlib.import_module(name).predict(vectors)[1].tolist()\n"
        "    assert said == known, (name, said, known)\n"
        "print(sorted({m.partition('.')[0] for m in sys.modules} - set(sys.stdlib_module_names)))"
    )
    said = subprocess.run(
        [sys.executable, "-I", "-S", "-c", code], input=json.dumps(asked), capture_output=True, text=True
    )
    assert said.returncode == 0, said.stderr
    others = {name for name in ast.literal_eval(said.stdout) if not name.startswith(("model", "__"))}
    assert others == {"numpy"}


def test_it_can_be_read() -> None:
    text = MODELS["room by laws"]().to_python()
    assert "def free_ball" in text and "largest(u_n, -0.9" in text and "Laws of motion" in text
