"""What the site is made of beside the pages in docs/: pages from the repository's root, and the package's layout."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
LAYOUT = ROOT / "build" / "docs" / "relgym"
"""relgym as it is once installed, with envs/ and wrappers/ in it; mkdocstrings reads it."""

FROM_ROOT = {"changelog.md": "CHANGELOG.md", "contributing.md": "CONTRIBUTING.md", "index.md": "README.md"}
"""Pages of the site that are files of the repository's root."""


def on_startup(**_: Any) -> None:
    """Lay the package out, before mkdocstrings looks for it: that reads sources and knows nothing of `package-dir`."""
    leave = shutil.ignore_patterns("__pycache__")
    shutil.rmtree(LAYOUT, ignore_errors=True)
    shutil.copytree(ROOT / "relgym", LAYOUT, ignore=leave)
    for name in ("envs", "wrappers"):
        shutil.copytree(ROOT / name, LAYOUT / name, ignore=leave)


def on_files(files: Files, config: Any) -> Files:
    """Add the pages from the root, whose links are relative to it."""
    for page, source in FROM_ROOT.items():
        text = (ROOT / source).read_text(encoding="utf-8").replace("](docs/", "](")
        for other, file in FROM_ROOT.items():
            text = text.replace(f"]({file}", f"]({other}")
        if page == "index.md":
            text = f"---\nhide: [navigation]\n---\n{text}"
        files.append(File.generated(config, page, content=text))
    return files
