"""The code of README.md and of all pages in docs/ runs from top to bottom, and prints what they say it prints."""

from __future__ import annotations

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import gymnasium as gym
import pages
import pytest
from PIL import Image

import relgym  # noqa: F401  (registers the envs)

NEEDS = {"docs/guides/dyna.md": pytest.mark.sb3}
"""Pages whose code needs an extra."""

SMALLER = {
    "docs/guides/dyna.md": {
        "agent.learn(1_000, callback=Dyna(model, DynaConfig(updates=40, catch_up=10_000))": (
            "agent.learn(40, callback=Dyna(model, DynaConfig(updates=2, catch_up=20))"
        ),
        "agent.learn(1_000": "agent.learn(30",
        "steps=1_000, seed=0": "steps=450, seed=0",
        "num_envs=64": "num_envs=4",
        "agent.learn(200_000": "agent.learn(256",
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


def test_what_is_run(tmp_path: Path) -> None:
    page = "```python\nprint(1)\n```\nso\n```text\n1\n```\n<!-- not run: hours -->\n```sh\nrelgym dyna\n```\n"
    page += "```toml\n```\n"
    (only,) = pages.snippets(page)
    assert (only.kind, only.code, only.shown, only.line) == ("python", "print(1)\n", "1\n", 2)
    assert page[slice(*only.span)] == "1\n"
    assert pages.run(only, {}, tmp_path) == "1\n"


def test_commands_with_their_output(tmp_path: Path) -> None:
    page = "```console\n$ relgym envs\n…\n$ relgym learn CartPol-v1 --out a\nrelgym: there is no\n```\n"
    first, second = pages.snippets(page)
    assert (first.code, first.shown) == ("relgym envs", "…\n")
    assert page[slice(*second.span)] == second.shown == "relgym: there is no\n"
    assert "CartPole-v1" in pages.run(second, {}, tmp_path)


@pytest.mark.parametrize("line", ["make tea", "pip install 'relgym[tea]'", "brew tea"])
def test_commands_that_nobody_can_run(line: str, tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match="tea"):
        pages.run(pages.Snippet("sh", f"{line}\n", None, (0, 0), 1), {}, tmp_path)


def test_every_env_has_a_picture_that_moves() -> None:
    folder = pages.ROOT / "docs" / "envs"
    shown = {path.stem for path in folder.glob("*.md")} - {"index"}
    assert shown == {path.stem for path in folder.glob("*.webp")} == set(tool("animations").ANIMATIONS)
    assert len(shown) == sum(name.startswith("relgym/") for name in gym.registry)
    for name in shown:
        path = folder / f"{name}.webp"
        assert f"({path.name})" in (folder / f"{name}.md").read_text(encoding="utf-8")
        assert path.stat().st_size < 300_000
        with Image.open(path) as picture:
            assert getattr(picture, "n_frames", 1) > 20


def test_pictures_are_drawn_by_the_script(tmp_path: Path) -> None:
    """One of them: what it writes moves as the committed one does."""
    with (
        Image.open(tool("animations").write("truck-push", tmp_path)) as drawn,
        Image.open(pages.ROOT / "docs" / "envs" / "truck-push.webp") as kept,
    ):
        assert (drawn.size, drawn.n_frames) == (kept.size, kept.n_frames)  # type: ignore[attr-defined]


def test_what_is_wrong_with_a_site(tmp_path: Path) -> None:
    good = '<h1 id="relgym.A">A</h1> <a href="b.html#x">b</a> <a href="https://gymnasium.farama.org">g</a>'
    (tmp_path / "a.html").write_text(good, encoding="utf-8")
    (tmp_path / "b.html").write_text('<p id="x"><a href="a.html">a</a></p>', encoding="utf-8")
    check = tool("check_site").faults
    assert check(tmp_path, {"relgym.A"}) == []
    assert check(tmp_path, {"relgym.B"}) == ["the reference lacks relgym.B"]
    for page, fault in {
        '<a href="c.html">c</a>': "c.html leads nowhere",
        '<a href="a.html#y">a</a>': "a.html#y: the page has no such place",
        '<script src="https://example.org/a.js"></script>': "loads https://example.org/a.js from elsewhere",
        "<p>==== ====</p>": "reStructuredText was left as it is",
    }.items():
        (tmp_path / "b.html").write_text(f'<p id="x">{page}</p>', encoding="utf-8")
        assert check(tmp_path, {"relgym.A"}) == [f"b.html: {fault}"]


def tool(name: str) -> ModuleType:
    """A script of docs/tools."""
    spec = spec_from_file_location(name, pages.ROOT / "docs" / "tools" / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look there
    spec.loader.exec_module(module)
    return module
