"""No page of results hides that it is older than the code."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from relgym.experiments.chapter4 import staleness
from relgym.experiments.chapter4.command import Request, reproduce
from relgym.experiments.chapter4.reproduce import page
from relgym.experiments.chapter4.staleness import OLDER, declared, digest_of, outdated, problem, stamped
from relgym.experiments.jobs import code

RESULTS = Path(__file__).parents[3] / "docs" / "results.md"
LEARNER = "relgym.thesis.settings"


def test_the_page_of_results_says_what_is_older_than_the_code() -> None:
    text = RESULTS.read_text(encoding="utf-8")
    assert not (said := problem(text, "docs/results.md")), said


def test_pages_state_protocol_digest_and_duration(tmp_path: Path) -> None:
    list(reproduce(Request(("table-4.1",), tmp_path, fast=True)))
    page(tmp_path, tmp_path / "results.md")
    text = (tmp_path / "results.md").read_text()
    assert f"; code `{digest_of('table-4.1')}`; fast protocol, 2 of 50 batches" in text
    assert "s of computing." in text and OLDER not in text
    assert stamped(text) == {"table-4.1": digest_of("table-4.1")} and not outdated(text)


def test_a_changed_constant_of_the_learner_names_the_sections(monkeypatch: pytest.MonkeyPatch) -> None:
    names = ("table-3.1", "figure-4.8")
    text = "# Results\n\n" + "".join(f"## {n}: Title (§1)\n\n`x`; code `{digest_of(n)}`\n\n" for n in names)
    assert not problem(text, "page.md")
    source = code._source(LEARNER)
    assert source is not None and b"min_examples: int = 40" in source
    changed = source.replace(b"min_examples: int = 40", b"min_examples: int = 41")
    read = code._source
    for cache in (code._content, code.code_version, digest_of):
        cache.cache_clear()
    monkeypatch.setattr(code, "_source", lambda name: changed if name == LEARNER else read(name))
    try:
        said = problem(text, "page.md")
    finally:
        monkeypatch.undo()
        for cache in (code._content, code.code_version, digest_of):
            cache.cache_clear()
    assert "there is now: table-3.1. Make" in said  # what is only drawn is as it was
    assert "relgym reproduce table-3.1 --page page.md" in said and "--mark" in said


def test_a_page_may_say_that_it_is_older() -> None:
    text = "# Results\n\nWords.\n\n## table-4.1: A (§1)\n\n## table-4.2: B (§2)\n\ncode\n"
    marked = declared(text, ["table-4.2"])
    assert marked.startswith(f"# Results\n\n{OLDER} table-4.2: made before")
    assert not problem(marked, "page.md", {"table-4.1": "", "table-4.2": "0"})
    both = problem(marked, "page.md", {"table-4.1": "0", "table-4.2": "0"})  # it names but one of them
    assert "there is now: table-4.1, table-4.2. Make" in both
    assert declared(marked, ["table-4.2"]) == marked and declared(marked, []) == text
    assert f"{OLDER} All sections" in declared(text, ["table-4.1", "table-4.2"])


def test_the_command_marks_a_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "results.md"
    target.write_text("# Results\n\n## table-4.1: A (§1)\n\nno digest\n")
    assert staleness.main([str(target)]) == 0 and OLDER not in target.read_text()
    assert staleness.main([str(target), "--mark"]) == 0 and OLDER in target.read_text()
    assert capsys.readouterr().out == "table-4.1\n" * 2


def test_no_figure_without_its_section_and_none_left_over(tmp_path: Path) -> None:
    """What an earlier run drew goes when there is nothing to draw any more."""
    made = [
        m for m in reproduce(Request(("table-4.1",), tmp_path / "out", fast=True)) if hasattr(m, "figure")
    ]
    folder = tmp_path / "docs" / "results"
    folder.mkdir(parents=True)
    (folder / "table-4.1.png").write_bytes(b"old")
    page(tmp_path / "out", tmp_path / "docs" / "results.md")
    assert not (folder / "table-4.1.png").exists() and replace(made[0], figure="") == made[0]


def test_sections_that_were_not_made_anew_stay(tmp_path: Path) -> None:
    target = tmp_path / "results.md"
    for name, folder in (("table-4.1", "one"), ("figure-4.8", "two")):
        list(reproduce(Request((name,), tmp_path / folder, fast=True)))
        page(tmp_path / folder, target)
    text = target.read_text()
    assert list(stamped(text)) == ["table-4.1", "figure-4.8"] and OLDER not in text
    assert "](#table-41-configuration-parameters-42)" in text and "Not made yet: figure-1.3" in text


def test_every_figure_of_the_page_exists_and_is_shown() -> None:
    text = RESULTS.read_text(encoding="utf-8")
    shown = {line.split("(results/")[1][:-1] for line in text.splitlines() if line.startswith("![")}
    there = {path.name for path in RESULTS.with_suffix("").glob("figure-*.png")}
    assert shown == there
