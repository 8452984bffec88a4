"""The code of README.md and of all pages in docs/ runs from top to bottom, and prints what they say it prints."""

from __future__ import annotations

from pathlib import Path

import pages
import pytest

NEEDS = {"docs/guides/dyna.md": pytest.mark.sb3}
"""Pages whose code needs an extra."""

SMALLER = {
    "docs/guides/dyna.md": {
        "agent.learn(1_000, callback=Dyna(model, DynaConfig(updates=40, catch_up=10_000))": (
            "agent.learn(120, callback=Dyna(model, DynaConfig(updates=2, catch_up=100))"
        ),
        "agent.learn(1_000": "agent.learn(30",
        "agent.learn(200_000": "agent.learn(6_000",
    }
}
"""What is made smaller in tests, of pages that show no output."""


def named(path: Path) -> str:
    return path.relative_to(pages.ROOT).as_posix()


@pytest.mark.filterwarnings("ignore::UserWarning:minari")  # more could be said of a data set than a page says
@pytest.mark.parametrize(
    "path", [pytest.param(path, id=named(path), marks=NEEDS.get(named(path), ())) for path in pages.pages()]
)
def test_the_code_of_a_page(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    page = path.read_text(encoding="utf-8")
    for large, small in SMALLER.get(named(path), {}).items():
        assert large in page
        page = page.replace(large, small)
    names: dict[str, object] = {"__name__": "__main__"}
    for snippet in pages.snippets(page):
        printed = pages.run(snippet, names, tmp_path)
        if snippet.shown is not None:
            assert pages.agrees(snippet.shown, printed), (
                f"line {snippet.line}: `make pages` renews it\n{printed}"
            )
        elif snippet.kind == "python":
            assert not printed, f"line {snippet.line} prints what the page doesn't show:\n{printed}"


def test_what_is_left_out_and_what_is_not() -> None:
    for text, printed in (("a\n…\nc\n", "a\nb\nc\n"), ("…\nb\n…\n", "a\nb\nc\n")):
        assert pages.agrees(text, printed)
    for text in ("a\nc\n", "b\n…\n", "…\nb\n", "a\n…\nb\n"):
        assert not pages.agrees(text, "a\nb\nc\n")


def test_a_renewed_text_leaves_out_what_the_old_one_did() -> None:
    printed = "head 2\nrows 3\nball.vx: 4 modes\nvx' = 2 vx\nrest\nend\n"
    assert pages.renewed("head 1\nrows 1\n", printed) == printed
    assert pages.renewed("head 1\n…\nvx' = vx\n…\n", printed) == "head 2\n…\nvx' = 2 vx\n…\n"
    assert (
        pages.renewed("…\nball.vx: 3 modes\nvx' = vx\n…\n", printed) == "…\nball.vx: 4 modes\nvx' = 2 vx\n…\n"
    )
    assert pages.renewed("…\nend\n", printed) == "…\nend\n"


def test_blocks_that_are_run(tmp_path: Path) -> None:
    page = "```python\nprint(1)\n```\nso\n```text\n1\n```\n<!-- not run: hours -->\n```sh\nrelgym dyna\n```\n"
    page += "```toml\n```\n"
    (only,) = pages.snippets(page)
    assert (only.kind, only.code, only.shown, only.line) == ("python", "print(1)\n", "1\n", 2)
    assert page[slice(*only.span)] == "1\n"
    assert pages.run(only, {}, tmp_path) == "1\n"


@pytest.mark.parametrize("line", ["make tea", "pip install 'relgym[tea]'", "brew tea"])
def test_commands_that_nobody_can_run(line: str, tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match="tea"):
        pages.run(pages.Snippet("commands", f"{line}\n", None, (0, 0), 1), {}, tmp_path)
