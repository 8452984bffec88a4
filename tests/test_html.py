from __future__ import annotations

from dataclasses import replace
from html.parser import HTMLParser
from typing import Any

import gymnasium as gym
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relgym.html import html_table, html_text
from relgym.model.reports.report import report
from relgym.wrappers import ModelLearner, StepReport

VOID = {"br", "hr", "img"}


class Reader(HTMLParser):
    """Reads HTML back: text by innermost tag; tags must be closed in order."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.texts: list[tuple[str, str]] = []
        self.feed(page)
        self.close()
        assert not self.open

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.tags.append(tag)
        self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append((self.open[-1], data))

    def of(self, tag: str) -> str:
        return "".join(text for where, text in self.texts if where == tag)


@given(st.text(st.characters(codec="utf-8", exclude_characters="\r\0")))
def test_text_is_shown_as_it_is(text: str) -> None:
    read = Reader(html_text("a < b", text))
    assert read.tags == ["details", "summary", "pre"]
    assert (read.of("summary"), read.of("pre")) == ("a < b", text)


def test_nothing_in_a_cell_becomes_a_tag() -> None:
    read = Reader(html_table("<b>", ("a&b",), [("<script>alert(1)</script>",), (2.5,)]))
    assert "script" not in read.tags and "b" not in read.tags
    assert read.of("th") == "a&b"
    assert read.of("td") == "<script>alert(1)</script>2.5"


@pytest.fixture(scope="module")
def watched() -> tuple[ModelLearner, StepReport]:
    env = ModelLearner(gym.make("relgym/BallBoxRamp-v0"))
    env.reset(seed=0)
    for _ in range(150):
        *_, info = env.step(env.action_space.sample())
    return env, info["relgym"]


def test_models_and_reports_show_their_text(watched: tuple[ModelLearner, StepReport]) -> None:
    model = watched[0].model
    read = Reader(model._repr_html_())
    assert read.of("pre") == model.describe()
    assert read.of("summary") == repr(model)
    assert Reader(report(model)._repr_html_()).of("pre") == str(report(model))


def test_laws_are_a_table(watched: tuple[ModelLearner, StepReport]) -> None:
    laws = watched[0].model.laws
    assert laws is not None
    read = Reader(laws._repr_html_())
    assert read.of("th") == "aboutlawexamplesunexplained"
    assert "ball touching nothing" in read.of("td") and "vy' = vy - 0.00098" in read.of("td")


def test_a_step_says_what_was_wrong(watched: tuple[ModelLearner, StepReport]) -> None:
    told = watched[1]
    read = Reader(told._repr_html_())
    assert "ball.vx" in read.of("td") and read.of("td").count("right") == 2
    assert Reader(replace(told, wrong=(("ball", "vx"),))._repr_html_()).of("td").count("wrong") == 1
    assert told.prediction is not None and told.learned is not None
    assert "ball.vy" in Reader(told.prediction._repr_html_()).of("td")
    assert "cells" in Reader(told.learned._repr_html_()).of("summary")
    nothing = StepReport(None, {}, (), None)
    assert Reader(nothing._repr_html_()).of("td") == ""
