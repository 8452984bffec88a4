"""Versions of libraries in digests of code."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError

import pytest

from relgym.experiments.jobs import code


def test_a_library_that_is_not_installed_has_the_version_that_is_pinned(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """So a page of results is as old with the extra that made it as without."""

    def missing(distribution: str) -> str:
        raise PackageNotFoundError(distribution)

    pinned = code._version("numpy")
    monkeypatch.setattr(code, "version", missing)
    assert code._version("numpy") == pinned != "none"
    assert code._version("no-such-library") == "none"


def test_builds_of_one_version_are_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(code, "version", lambda _: "2.13.0+cpu")
    assert code._version("torch") == "2.13.0"
