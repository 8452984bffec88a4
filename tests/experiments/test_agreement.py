"""Arrays, kernel and exported Python are compared in few scenes; `python -m relgym.experiments.agreement` asks many."""

from __future__ import annotations

import pytest

from relgym.experiments import agreement as agreements
from relgym.experiments.agreement import MODELS, agreement, main


def test_a_world_of_laws_agrees() -> None:
    found = agreement(
        MODELS[next(name for name in MODELS if name.startswith("laws"))](), scenes=300, exported=60
    )
    assert (found.scenes, found.outcomes, found.exported, found.exported_outcomes) == (300, 1.0, 60, 1.0)
    assert found.alone and found.largest <= 1e-14 and found.exported_largest <= 1e-12


def test_what_differs_is_told(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Arrays that round to thousandths differ from the kernel, and from the exported Python."""
    honest = agreements.predict_many

    def rounding(*arguments: object) -> object:
        said = honest(*arguments)  # type: ignore[arg-type]
        said.vectors[:] = said.vectors.round(3)
        return said

    monkeypatch.setattr(agreements, "predict_many", rounding)
    name = next(name for name in MODELS if name.startswith("laws"))
    main([name, "--scenes", "100", "--exported", "50"])
    line = capsys.readouterr().out.splitlines()[1].removeprefix(name).split()
    assert line[0] == "100" and line[3] == "yes"
    assert 1e-5 < float(line[2]) < 1e-3 and 1e-5 < float(line[6]) < 1e-3
