"""What the site is made of beside the pages in docs/: pages from the repository's root."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
FROM_ROOT = {"changelog.md": "CHANGELOG.md", "contributing.md": "CONTRIBUTING.md", "index.md": "README.md"}
"""Pages of the site that are files of the repository's root."""


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
