"""Changed model files are refused, or work: a short run; `make fuzz` goes on for as long as it is told to."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from file_fuzzing import Fuzzer


@pytest.fixture(scope="module")
def fuzzer(tmp_path_factory: pytest.TempPathFactory) -> Fuzzer:
    return Fuzzer(tmp_path_factory.mktemp("fuzz"))


def test_the_corpus_itself_works(fuzzer: Fuzzer, tmp_path: Path) -> None:
    for name, (body, arrays) in fuzzer.files.items():
        tally = fuzzer.use(name, body, arrays)
        assert not tally.findings, tally.findings[0].trace
        assert tally.accepted == 1
        told = {"describe: no rules": 1, "explain: no rules": 1} | (
            {} if "metadata" in body["extra"] else {"dream: ModelFileError": 1}  # a reward model is no env
        )
        assert tally.typed_later.keys() <= told.keys()


def test_changed_files_are_refused_or_work(fuzzer: Fuzzer) -> None:
    tally = fuzzer.run(range(60))
    assert not tally.findings, "\n".join(f"case {f.number}: {f.stage}\n{f.trace}" for f in tally.findings)
    # Neither is all refused, nor is all accepted.
    assert 6 < tally.accepted < 54


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(lambda laws: laws["pair"].update(frame="contact", grips=[]), id="spins of no contact"),
        pytest.param(lambda laws: laws["free"][0]["components"].pop(), id="spins of no free law"),
    ],
)
def test_laws_that_speak_of_velocities_alone_are_told(
    change: Callable[[dict[str, Any]], object], fuzzer: Fuzzer
) -> None:
    for name in ("discs", "discs-frozen"):
        body, arrays = copy.deepcopy(fuzzer.files[name])
        change(body["laws"]["laws"])
        tally = fuzzer.use(name, body, arrays)
        assert not tally.findings, tally.findings[0].trace
