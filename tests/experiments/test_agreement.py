"""Arrays, kernel and exported Python are compared in few scenes; `relgym benchmark agreement` asks many."""

from __future__ import annotations

import pytest

from relgym.experiments import agreement as agreements
from relgym.experiments.agreement import MODELS, agreement


def test_a_world_of_laws_agrees() -> None:
    found = agreement(
        MODELS[next(name for name in MODELS if name.startswith("laws"))](), scenes=300, exported=60
    )
    assert (found["scenes"], found["exported"]) == (300, 60)
    assert (found["outcomes"], found["exported_outcomes"]) == (1.0, 1.0)
    assert found["alone"] and found["largest"] <= 1e-14 and found["exported_largest"] <= 1e-12


def test_what_differs_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Arrays that round to thousandths differ from the kernel, and from the exported Python."""
    honest = agreements.predict_many

    def rounding(*arguments: object) -> object:
        said = honest(*arguments)  # type: ignore[arg-type]
        said.vectors[:] = said.vectors.round(3)
        return said

    monkeypatch.setattr(agreements, "predict_many", rounding)
    name = next(name for name in MODELS if name.startswith("laws"))
    found = agreement(MODELS[name](), scenes=100, exported=50)
    assert found["scenes"] == 100 and found["alone"]
    assert 1e-5 < found["largest"] < 1e-3 and 1e-5 < found["exported_largest"] < 1e-3
