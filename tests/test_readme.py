"""The README's code runs, and prints what the README says it prints."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
TEN_LINES, SAVED, *_ = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
LAWS, MODES, *_ = re.findall(r"```text\n(.*?)```", README, re.DOTALL)

PLAIN, MODEL_LEARNER = "ModelLearner(env) ", 'ModelLearner(env, config={"frames": "world"}) '


def test_ten_lines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """And the model is saved and dreamed in as the README goes on to say."""
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(TEN_LINES, names)
    assert capsys.readouterr().out == LAWS
    exec(SAVED + "first, _ = dream.reset(seed=0)\ndreams.reset(seed=0)\n", names)
    assert set(names["first"]) == set(names["obs"])  # type: ignore[call-overload]


@pytest.mark.slow
def test_the_modes_of_the_same_stream(capsys: pytest.CaptureFixture[str]) -> None:
    """The README leaves out what follows the ellipsis."""
    assert MODEL_LEARNER.strip() in README
    changed = TEN_LINES.replace(PLAIN, MODEL_LEARNER)
    assert changed != TEN_LINES
    exec(changed, {})
    shown, ellipsis, _ = MODES.partition("  …\n")
    assert ellipsis
    assert capsys.readouterr().out.startswith(shown)
