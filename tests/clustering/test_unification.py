"""One general function in place of over-specific ones (§3.2.5), and what must stay apart."""

from __future__ import annotations

import numpy as np
import pytest
from streams import ALONE, BALL, Stream, V, mode_of

from relgym.clustering.columns import SlotSignature
from relgym.clustering.discovery import Scale
from relgym.clustering.em import Cluster
from relgym.clustering.mode import Mode
from relgym.clustering.unification import _spread, covering, reordered, unified, unified_family
from relgym.config import ClusteringConfig
from relgym.config.constants import FIRST
from relgym.numeric.stepwise import LinearFit
from relgym.scene.objects import ObjectType
from relgym.scene.shapes import Box

SCALE = Scale(1e-13, 4.0, 8.0)
CONFIG = ClusteringConfig()


def filled(x: np.ndarray) -> tuple[Stream, np.ndarray]:
    """A table of rows (v, w) and their numbers."""
    stream = Stream()
    return stream, np.array([stream.table.add(ALONE, row, b"", [-1]) for row in x])


def covered(mode: Mode, x: np.ndarray, y: np.ndarray) -> bool:
    stream, rows = filled(x)
    return covering(Cluster(mode), stream.table, rows, y, SCALE, CONFIG)


def test_a_function_covers_what_it_explains(rng: np.random.Generator) -> None:
    x = rng.normal(size=(20, 2))
    assert covered(mode_of(("v", -0.9)), x, -0.9 * x[:, 0])
    assert not covered(mode_of(("v", -0.8)), x, -0.9 * x[:, 0])


def test_a_function_covers_no_rest_on_which_it_doesnt_act() -> None:
    rest = np.column_stack([np.zeros(20), np.ones(20)])
    assert not covered(mode_of(("v", -0.9)), rest, np.zeros(20))
    assert covered(mode_of(), rest, np.zeros(20))


@pytest.mark.parametrize(("exceptions", "covers"), [(2, True), (3, False)])
def test_r_unify_of_the_examples_must_be_explained(
    exceptions: int, covers: bool, rng: np.random.Generator
) -> None:
    x = rng.normal(size=(20, 2))
    y = 0.5 * x[:, 0]
    y[:exceptions] += 1.0
    assert covered(mode_of(("v", 0.5)), x, y) is covers


def both(
    x: np.ndarray, y: np.ndarray, modes: tuple[Mode, Mode], config: ClusteringConfig = CONFIG
) -> LinearFit | None:
    """The first half of the examples unified with the second half."""
    stream, rows = filled(x)
    new, old = np.split(np.arange(len(y)), 2)
    found = unified(stream.table, rows, y, new, old, target=V, scale=SCALE, config=config, simpler_than=modes)
    return None if found is None else found[1]


def test_two_constants_give_persistence_in_spite_of_a_coincidence() -> None:
    x = np.repeat([[3.0, 1.0], [5.0, 1.0]], 20, axis=0)
    y = x[:, 0].copy()
    x[7, 0] = 5.0  # v was 5, and some bounce made it 3: the constant explains it, persistence doesn't
    fit = both(x, y, (mode_of(constant=3.0), mode_of(constant=5.0)))
    assert fit == LinearFit((0,), (1.0,), 0.0, 0.0)


def test_halves_of_a_law_unify_to_it(rng: np.random.Generator) -> None:
    x = rng.normal(size=(40, 2))
    x[:20, 1], x[20:, 0] = 0.0, 0.0
    fit = both(x, 0.5 * x[:, 0] - 0.2 * x[:, 1], (mode_of(("v", 0.5)), mode_of(("w", -0.2), constant=1.0)))
    assert fit is not None
    assert fit.columns == (0, 1)
    assert fit.weights == pytest.approx((0.5, -0.2), abs=1e-12)


def test_the_general_function_must_be_simpler_than_both(rng: np.random.Generator) -> None:
    x = rng.normal(size=(40, 2))
    x[:20, 1], x[20:, 0] = 0.0, 0.0
    assert both(x, 0.5 * x[:, 0] - 0.2 * x[:, 1], (mode_of(("v", 0.5)), mode_of(("w", -0.2)))) is None


def test_different_laws_stay_apart(rng: np.random.Generator) -> None:
    x = rng.normal(size=(40, 2))
    y = np.where(np.arange(40) < 20, x[:, 0], -0.9 * x[:, 0])
    assert both(x, y, (mode_of(("v", 1.0), constant=0.1), mode_of(("v", -0.9), constant=0.1))) is None


def test_a_family_of_constants_gives_their_law_and_leaves_strangers_out(rng: np.random.Generator) -> None:
    friction = rng.uniform(0.1, 1.0, 8)
    x = np.column_stack([rng.normal(size=96), np.repeat(friction, 12)])
    y = x[:, 0] - 2.5 * x[:, 1]
    y[:12] = x[:12, 0] + 17.0
    stream, rows = filled(x)
    found = unified_family(
        stream.table,
        rows,
        y,
        [np.arange(12 * k, 12 * k + 12) for k in range(8)],
        (("v", 1.0),),
        target=V,
        scale=SCALE,
        config=CONFIG,
        rng=rng,
    )
    assert found is not None
    signature, fit, which = found
    assert signature == 0
    assert which == list(range(1, 8))
    assert dict(zip(fit.columns, fit.weights, strict=True)) == pytest.approx({0: 1.0, 1: -2.5}, abs=1e-12)
    assert fit.intercept == 0.0


def test_reordering_puts_columns_back() -> None:
    fit = reordered(LinearFit((0, 2), (1.5, -0.5), 3.0, 0.0), np.array([4, 1, 0]))
    assert fit == LinearFit((0, 4), (-0.5, 1.5), 3.0, 0.0)


def test_a_function_covers_no_examples_at_all() -> None:
    assert covered(mode_of(("v", -0.8)), np.empty((0, 2)), np.empty(0))


@pytest.mark.parametrize(("resting", "covers"), [(10, True), (11, False)])
def test_half_of_the_examples_must_not_be_at_rest(
    resting: int, covers: bool, rng: np.random.Generator
) -> None:
    x = rng.normal(size=(20, 2))
    x[:resting, 0] = 0.0
    assert covered(mode_of(("v", -0.9)), x, -0.9 * x[:, 0]) is covers


def test_half_of_either_side_may_arrive_from_elsewhere_at_what_persists(rng: np.random.Generator) -> None:
    """Of twenty on the worse side ten may be another matter, of the better side none is."""
    for odd, found in ((10, True), (11, False)):
        x = np.repeat([[3.0, 1.0], [5.0, 1.0]], 20, axis=0)
        y = x[:, 0].copy()
        x[:odd, 0] = 4.0
        fit = both(x, y, (mode_of(constant=3.0), mode_of(constant=5.0)))
        assert (fit == LinearFit((0,), (1.0,), 0.0, 0.0)) is found


def test_examples_that_share_no_signature_do_not_unify(rng: np.random.Generator) -> None:
    boxed = SlotSignature((BALL, ObjectType("box", ("friction",), Box())))
    stream, x = Stream(), rng.normal(size=(40, 3))
    rows = [stream.table.add(ALONE, row[:2], b"", [-1]) for row in x[:20]]
    rows += [stream.table.add(boxed, row, b"", [-1, -1]) for row in x[20:]]
    new, old = np.split(np.arange(40), 2)
    modes = mode_of(constant=1.0), mode_of(constant=2.0)
    arguments = {"target": V, "scale": SCALE, "config": CONFIG, "simpler_than": modes}
    assert unified(stream.table, np.array(rows), x[:, 0].copy(), new, old, **arguments) is None
    # Where a few examples of the one are of the other's kind, these decide.
    mixed = np.concatenate([new, old[:8]])
    found = unified(stream.table, np.array(rows), x[:, 0].copy(), mixed, old[8:], **arguments)
    assert found == (1, LinearFit((0,), (1.0,), 0.0, 0.0))


def test_if_asked_for_only_the_objects_own_properties_are_looked_at(rng: np.random.Generator) -> None:
    boxed = SlotSignature((BALL, ObjectType("box", ("friction",), Box())))
    stream, x = Stream(boxed), rng.uniform(1.0, 2.0, size=(40, 3))
    rows = np.array([stream.table.add(boxed, row, b"", [-1, -1]) for row in x])
    y = x[:, 0] - 2.5 * x[:, 2]
    new, old = np.split(np.arange(40), 2)
    modes = mode_of(("v", 1.0), ("w", 1.0)), mode_of(("v", 1.0), ("w", 2.0))
    for own_only in (False, True):
        config = ClusteringConfig(own_only=own_only)
        found = unified(
            stream.table, rows, y, new, old, target=V, scale=SCALE, config=config, simpler_than=modes
        )
        assert (found is None) is own_only
        assert found is None or found[1].columns == (0, 2)


def test_of_many_examples_some_evenly_spread_are_regressed() -> None:
    assert _spread(np.arange(FIRST)).tolist() == list(range(FIRST))
    some = _spread(np.arange(1_000))
    assert len(some) == FIRST and (some[0], some[-1]) == (0, 999)
    assert set(np.diff(some)) <= {15, 16}
