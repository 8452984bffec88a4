"""Is the built site whole? Run after mkdocs, with the folder: python docs/tools/check_site.py site.

Every link and every picture leads to a file and a place that there is, nothing is loaded from elsewhere, each public
name has its place, and no docstring's table is left as it was typed.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

sys.path.insert(0, str(Path(__file__).parent))
from facades import FACADES, public_names

LOADED = {("img", "src"), ("link", "href"), ("script", "src"), ("source", "src"), ("iframe", "src")}
"""What a browser fetches without being asked to."""


@dataclass
class Page(HTMLParser):
    """The places of one page, its links, and its text outside of code."""

    path: Path
    ids: set[str] = field(default_factory=set)
    links: list[tuple[str, str, str]] = field(default_factory=list)
    text: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()
        self._hidden = 0
        self.feed(self.path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note ids and links."""
        self._hidden += tag in ("pre", "code", "script", "style")
        for name, value in attrs:
            if name in ("id", "name") and value:
                self.ids.add(value)
            if name in ("href", "src") and value:
                self.links.append((tag, name, value))

    def handle_endtag(self, tag: str) -> None:
        """Note where code ends."""
        self._hidden -= tag in ("pre", "code", "script", "style")

    def handle_data(self, data: str) -> None:
        """Keep prose."""
        if not self._hidden:
            self.text.append(data)


def faults(site: Path, public: Iterable[str]) -> list[str]:
    """Everything that is wrong, a line each; `public` are the names that must have a place."""
    pages = {path: Page(path) for path in sorted(site.rglob("*.html"))}
    found = [
        f"{page.path.relative_to(site)}: {fault}" for page in pages.values() for fault in _broken(page, pages)
    ]
    everywhere = {name for page in pages.values() for name in page.ids}
    found += [f"the reference lacks {name}" for name in sorted(set(public) - everywhere)]
    for page in pages.values():
        if re.search(r"={4,} +={4,}|:class:|:func:", "".join(page.text)):
            found.append(f"{page.path.relative_to(site)}: reStructuredText was left as it is")
    return found


def _broken(page: Page, pages: dict[Path, Page]) -> list[str]:
    wrong = []
    for tag, name, value in page.links:
        parts = urlsplit(value)
        if parts.scheme or parts.netloc:
            if (tag, name) in LOADED and parts.scheme != "data":
                wrong.append(f"loads {value} from elsewhere")
            continue
        target = (page.path.parent / unquote(parts.path)).resolve() if parts.path else page.path
        if page.path.name == "404.html" or value.startswith("javascript:"):
            continue  # served for any address, so its links begin with the site's
        if not target.is_file():
            wrong.append(f"{value} leads nowhere")
        elif parts.fragment and target.suffix == ".html" and not _has(pages[target], unquote(parts.fragment)):
            wrong.append(f"{value}: the page has no such place")
    return wrong


def _has(page: Page, place: str) -> bool:
    return place in page.ids or place.startswith("__")


def main() -> None:
    """Print what is wrong, and exit with 1 if anything is."""
    site = Path(sys.argv[1]).resolve()
    if wrong := faults(site, set(public_names().values()) - set(FACADES)):  # have pages
        sys.exit("\n".join(wrong))
    print(
        f"{len(list(site.rglob('*.html')))} pages: every link leads somewhere, nothing comes from elsewhere"
    )


if __name__ == "__main__":
    main()
