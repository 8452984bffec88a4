"""The field's words: retired ones are in no name, page, docstring, comment, message or option (docs/glossary.md)."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

WORDS = {
    "apprentice": "model trainer (ModelTrainer)",
    "bar": "limit, criterion",
    "block": "episode; to people, steps",
    "burst": "catch-up updates (catch_up)",
    "foretell": "predict",
    "foretelling": "predicting",
    "foretells": "predicts",
    "foretold": "predicted",
    "gate": "acceptance; accepted, rejected (ModelAcceptance)",
    "glimpse": "truncated episode (TruncatedEpisodes)",
    "issue": "say what is meant: pages and code don't point into a tracker",
    "judge": "reward model (RewardModel); to judge: evaluate, test",
    "judgement": "TaskOutcome; evaluation",
    "judged": "evaluated, tested",
    "judging": "evaluating, testing",
    "kick": "velocity perturbation (perturb_velocity)",
    "kicked": "perturbed",
    "redraw": "resample",
    "redrawn": "resampled",
    "rival": "runner-up (prediction), alternative (law), replacement (model), baseline (comparison)",
    "silence": "no prediction",
    "silent": "abstaining; it abstains",
    "stopgap": "fallback value",
}
"""Retired words, alone or as a part of a name, also in the plural; and what to write instead."""

PHRASES = {
    r"who (plays|play|played)\b|\bplays? (the|its|their|a) roles?\b": "role binding; is bound to a role",
    r"for want of\b": "no prediction",
    r"takes? the word\b": "predicts",
    r"\b(in|of|on|see) rows? \d|^#+ [Rr]ows? \d": "the name of the benchmark",
    r"\"otherwise\"|'otherwise'": "else",
}
"""Retired phrases, as regular expressions."""

ROOMS = {"room": "package, subpackage"}
"""Of the architecture only: balls do live in rooms."""

ALLOWED = {
    "bar": (
        r"progress bar|BarColumn|_progress\(|bar=bar"
        r"|\bbar\.(add_task|advance|tasks|update|reset|start|stop|console|finished|set_label)"
        r"|\bbar: Progress|^    bar$|\b(panel|axes|ax)\.bar(h)?\(|colour ?bar|color ?bar|bars? of progress"
    ),
    "block": r"with`` block|code block|np\.block|[Bb]locks? the way|SIG_BLOCK|\(\"block\",\)|\{\"block\": Material",
    "issue": r"/issues",
    "rival": r'^_KEY = "rivals"',  # a key of model files
}
"""Lines on which a word has its ordinary sense, by regular expressions."""

ALLOWED_IN = {
    "block": (
        "relgym/logic/",  # candidates are scored a block of arrays at a time
        "tests/logic/",
        "relgym/baselines/interaction.py",  # blocks of a matrix
        "relgym/experiments/laws/",  # blocks stand in the rooms of other worlds
        "tests/experiments/laws/test_worlds.py",
        "tests/fuzz/make_corpus.py",
        "tests/laws/",
        "tests/wrappers/dyna/test_stock.py",
        "tests/scene/geometry/",
    ),
}
"""Files in which a word has its ordinary sense."""

UNREAD = ("CHANGELOG.md", "tests/test_vocabulary.py", "docs/glossary.md")
"""What happened under the old names, and the pages that list them."""

_PART = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")


@dataclass(frozen=True)
class Found:
    """A retired word and where it stands."""

    place: str
    word: str
    use: str

    def __str__(self) -> str:
        return f"{self.place}: {self.word} → {self.use}"


def _tracked() -> list[str]:
    listed = subprocess.run(
        [
            "git",
            "ls-files",
            "--cached",
            "--others",
            "--exclude-standard",
            "*.py",
            "*.md",
            "*.toml",
            "*.yml",
            "Makefile",
            ".ci/run",
        ],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    names = listed.stdout.split("\n") if listed.returncode == 0 else _on_disk()
    return sorted(n for n in names if n and n not in UNREAD and (ROOT / n).is_file())


def _on_disk() -> list[str]:
    """Without git, as in an unpacked archive: what is written here, by folder."""
    folders = ("docs", "envs", "examples", "relgym", "tests", "wrappers")
    paths = [p for folder in folders for kind in ("*.py", "*.md") for p in (ROOT / folder).rglob(kind)]
    return [str(p.relative_to(ROOT)) for p in [*ROOT.glob("*.md"), *paths]]


def _singular(part: str) -> str:
    return part[:-1] if part.endswith("s") and part[:-1] in WORDS | ROOMS else part


def _retired(text: str, name: str) -> Iterator[tuple[str, str]]:
    """Retired words of a line, and what to use instead."""
    words = WORDS | (ROOMS if name in ARCHITECTURE else {})
    for part in _PART.findall(text):
        word = _singular(part.lower())
        if word in words and not _ordinary(word, text, name):
            yield part, words[word]
    for pattern, use in PHRASES.items():
        if found := re.search(pattern, text):
            yield found[0], use


def _ordinary(word: str, text: str, name: str) -> bool:
    here = re.search(ALLOWED[word], text) if word in ALLOWED else None
    return here is not None or name.startswith(ALLOWED_IN.get(word, ()))


ARCHITECTURE = (
    "CONTRIBUTING.md",
    "docs/architecture.md",
    "tests/test_architecture.py",
    "tests/support/source_tree.py",
)
"""Where rooms would be packages."""


def _found(names: list[str]) -> list[Found]:
    found = [Found(name, word, use) for name in names for word, use in _retired(name, name)]
    for name in names:
        lines = (ROOT / name).read_text(encoding="utf-8").split("\n")
        for number, text in enumerate(lines, start=1):
            found += [Found(f"{name}:{number}", word, use) for word, use in _retired(text, name)]
    return found


def test_retired_words_are_gone() -> None:
    found = _found(_tracked())
    told = "\n".join(map(str, found))
    assert not found, f"{len(found)} retired words; docs/glossary.md says what relgym calls things\n{told}"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("class TrustGate:", ["Gate"]),
        ("def foretell(self): # two rivals", ["foretell", "rivals"]),
        ("negated, arrivals, an aggregate; barely a bargain", []),
        ("with _progress() as bar:", []),
        ("the bar of row 3", ["bar", "of row 3"]),
        ("what follows is kept for want of a mode", ["for want of"]),
        ('return "otherwise"', ['"otherwise"']),
        ("it says otherwise", []),
    ],
)
def test_words_are_found_as_parts_of_names(text: str, words: list[str]) -> None:
    assert [word for word, _ in _retired(text, "relgym/x.py")] == words


def test_every_exception_is_needed() -> None:
    """A file that is allowed a word has it."""
    for word, names in ALLOWED_IN.items():
        for name in names:
            files = [ROOT / n for n in _tracked() if n.startswith(name)]
            assert any(word in f.read_text(encoding="utf-8").lower() for f in files), (
                f"{name} has no {word!r}: take it out of ALLOWED_IN"
            )
