"""Laws of motion are text that is read back, and that says of any scene what the laws say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from programs import books, crowded, room_schema

from relgym.errors import ConfigError
from relgym.laws.book import LawBook
from relgym.laws.frames import axis_names
from relgym.laws.inertia import Gyration, Inertia, Mass
from relgym.laws.records import ONE, AxisLaw, Bound, FreeLaw, PairLaw, Piece, Region, Share
from relgym.reporting.motion import MotionRules, parse_motion
from relgym.reporting.parser import parse_rules
from relgym.reporting.rules import RuleList

FREE = FreeLaw("ball", (Piece((("vx", 1.0),)), Piece((("vy", 1.0), (ONE, -0.25)))), 600)
BOUNCE = AxisLaw(
    (Piece((("u_n", 1.0),)), Piece((("v_n", -0.5),))),
    "max",
    (),
    signs=(False, True),
    examples=3000,
    unexplained=2,
)
SLIDE = AxisLaw((Piece((("u_t", 1.0),)),), "max", (), signs=(False, False), examples=3000)
MET = (("ball", "box"), ("ball", "ramp"))
RULES = MotionRules(
    (FREE,),
    (("ball", ("vx", "vy")),),
    PairLaw("contact", ((BOUNCE,), (SLIDE,)), 0.0),
    "nt",
    ((("ball", "ball"), Share("mass", 1)),),
    1e-6,
)
TEXT = """\
Laws of motion
  ball touching nothing:  vx' = vx             600 steps  ± 1e-06
                          vy' = vy - 0.25
  touching, along the normal n:                3,000 steps, 2 unexplained  ± 1e-06
    if   u_n > -0.5 v_n:  v'_n = u_n           # lets go
    else:                 v'_n = -0.5 v_n      # bounces, or rests where v_n = 0
    where that turns the motion to v'_n < 0: no prediction
  touching, along the slip direction t:        3,000 steps  ± 1e-06
    always:               v'_t = u_t           # slides freely
    where that turns the motion to v'_t < 0: no prediction
    where that turns the motion to v'_t > 0: no prediction
  of a change between ball A and ball B, A takes mass_B / (mass_A + mass_B), B the rest
  frame: contact"""


def body(text: str) -> list[str]:
    """The lines that say something."""
    return [line for line in text.splitlines() if not line.startswith("  # ")]


def test_word_for_word() -> None:
    assert [line.split() for line in body(RULES.text())] == [line.split() for line in TEXT.splitlines()]


def test_read_back() -> None:
    assert parse_motion(body(RULES.text())) == RULES


def test_what_is_doubted_of_a_kind_says_nothing_against_the_others_in_text_either() -> None:
    law = replace(BOUNCE, kinds=MET, doubted=MET[1:], examples=7, unexplained=3, excused=3)
    read = parse_motion(body(replace(RULES, pair=PairLaw("contact", ((law,), (SLIDE,)), 0.0)).text()))
    assert read is not None and read.pair is not None
    found = read.pair.axes[0][0]
    for kind in (*MET, ("ball", "floor")):
        assert found.trusted(kind) == law.trusted(kind) == (kind == MET[0])


EVERY = {
    "a minimum": replace(
        RULES, pair=PairLaw("world", ((replace(BOUNCE, operator="min"),), (SLIDE,)), 0.0), letters="xy"
    ),
    "laws by kinds": replace(
        RULES,
        pair=PairLaw(
            "contact",
            (
                (
                    replace(BOUNCE, kinds=(("ball", "box"), ("ball", "ball"))),
                    replace(SLIDE, pieces=(Piece((("u_n", 1.0),)),), kinds=(("ball", "ramp"),)),
                ),
                (SLIDE,),
            ),
            0.0,
        ),
    ),
    "as good": replace(
        RULES,
        pair=PairLaw(
            "contact",
            (
                (
                    replace(
                        BOUNCE,
                        alternatives=(("min", (Piece((("u_n", 1.0), ("v_n", 0.5))), Piece(((ONE, 2.0),)))),),
                    ),
                ),
                (SLIDE,),
            ),
            0.0,
        ),
    ),
    "doubts": replace(
        RULES, pair=PairLaw("contact", ((replace(BOUNCE, kinds=MET, doubted=MET[1:]),), (SLIDE,)), 0.0)
    ),
    "grips": replace(
        RULES,
        pair=PairLaw(
            "point", ((BOUNCE,), (SLIDE,)), 0.0, ((("ball", "box"), 0.25),), ((("ball", "belt"), -1.5),)
        ),
    ),
    "regions": replace(
        RULES,
        free=(
            replace(
                FREE,
                regions=(
                    Region(
                        (Bound("px", True, 0.0, 0.5), Bound("py", False, 2.0, 3.0)),
                        (Piece((("vx", 0.5),)), Piece((("vy", 0.5),))),
                    ),
                ),
            ),
        ),
    ),
    "two types": replace(
        RULES,
        free=(FREE, FreeLaw("disc", (Piece((("spin", 1.0),)),), 12, 1)),
        components=(("ball", ("vx", "vy")), ("disc", ("spin",))),
    ),
    "constant shares": replace(
        RULES, shares=((("ball", "box"), Share(constant=0.25)), (("ball", "ball"), Share("extent", 2)))
    ),
    "masses": replace(
        RULES,
        inertia=Inertia(
            Mass((("shape.area", 1), ("mass", 2)), "type", (("ball", 1.0), ("box", 2.5))),
            (Gyration(("box",), Piece((("shape.square", 1.0),)), False), Gyration((), None, True)),
        ),
    ),
    "no contacts": replace(RULES, pair=None, letters="", shares=()),
}


@pytest.mark.parametrize("what", EVERY)
def test_whatever_laws_say_is_read_back(what: str) -> None:
    rules = EVERY[what]
    assert parse_motion(body(rules.text())) == rules


@pytest.mark.parametrize(
    ("lines", "problem"),
    [
        (
            ["Laws of motion", "  ball is happy"],
            "expected a law, a piece, a share or a frame, got 'ball is happy'",
        ),
        (["Laws of motion", "  frame: sideways"], "got 'frame: sideways'"),
        (["Laws of motion", "  touching, along the normal n:"], "expected a piece"),
        (["Laws of motion", "    always: v'_n = u_n"], 'got "always: v\'_n = u_n"'),
        (["Laws of motion", "  ball touching nothing, where px > 3:  vx' = vx"], "expected a bound"),
    ],
)
def test_what_says_nothing_is_refused(lines: list[str], problem: str) -> None:
    with pytest.raises(ConfigError, match=problem):
        parse_motion(lines)


def motion_of(book: LawBook) -> MotionRules:
    """A law book, of balls, as rules."""
    names = tuple(book.components("ball"))
    letters = "" if book.pair is None else "".join(axis_names(book.pair.frame, 2))
    return MotionRules(
        tuple(law.first(len(names)) for law in book.free.values()),
        (("ball", names),),
        book.pair,
        letters,
        tuple(sorted(book.shares.items())),
        book.tolerance,
    )


@settings(max_examples=6, deadline=None)
@given(data=st.data(), shapes=st.integers(1, 3), balls=st.integers(1, 2), seed=st.integers(0, 10**6))
def test_laws_of_any_form_say_the_same_once_they_were_read_back(
    data: st.DataObject, shapes: int, balls: int, seed: int
) -> None:
    schema = room_schema(shapes, balls)
    rules = RuleList(1, (), (), motion_of(data.draw(books(schema))))
    again = parse_rules(rules.text(17))
    vectors = crowded(schema, 25, seed)
    with np.errstate(all="ignore"):
        known, told = (each.predict_batch(schema, schema.layout(), vectors) for each in (rules, again))
    assert rules.motion is not None
    ((_, names),) = rules.motion.components
    assert known.keys() == told.keys() == {(f"ball{k}", p) for k in range(balls) for p in names}
    for key, values in known.items():
        np.testing.assert_allclose(told[key], values, rtol=1e-12, atol=1e-12)
