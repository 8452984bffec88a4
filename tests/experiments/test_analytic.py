from __future__ import annotations

import math

import numpy as np
import pytest

from relgym.experiments.analytic import AnalyticModes, Case, analytic_modes, contact_law, truck_modes

NORMALS = [(0.0, 1.0), (1.0, 0.0), (0.6, 0.8), (-0.6, 0.8)]


Row = tuple[float, float, float]


def functions(modes: AnalyticModes, axis: str) -> list[tuple[float, float, float]]:
    return sorted(
        (round(m.weights[0], 9) + 0.0, round(m.weights[1], 9) + 0.0, round(m.intercept, 12) + 0.0)
        for m in getattr(modes, axis)
    )


def test_experiment_1_has_the_functions_of_table_4_2() -> None:
    modes = analytic_modes(30.0, 0.9, 0.0)
    c = round(-1.9 * 0.5 * math.cos(math.radians(30)), 9)  # -0.822724134
    assert functions(modes, "x") == sorted([(1.0, 0, 0), (-0.9, 0, 0), (0.525, c, 4.24352448e-4)])
    assert functions(modes, "y") == sorted(
        [(0, 1.0, -9.8e-4), (0, -0.9, 0), (0, 0, 0), (c, -0.425, -2.45e-4)]
    )


def test_experiment_2_has_the_functions_of_table_4_9_and_those_it_lacks() -> None:
    modes = analytic_modes(45.0, 0.95, 0.2)
    table: list[Row] = [
        (1, -0.39, 1.96e-4),
        (1, 0.39, -1.96e-4),
        (1, 0, 0),
        (-0.95, 0, 0),
        (0, 0, 0),
        (-0.17, -1.17, 5.88e-4),
    ]
    missing = [(0.22, -0.78, 3.92e-4), (-0.475, -0.475, 0)]
    sliding = [(1, 0, 1.96e-4), (1, 0, -1.96e-4)]  # the first two without v_y
    assert functions(modes, "x") == sorted(table + missing + sliding)
    table = [
        (0, 1, -9.8e-4),
        (0, 0, 0),
        (0, -0.95, 0),
        (0.39, 1, -9.8e-4),
        (-0.39, 1, -9.8e-4),
        (-0.78, 0.22, -5.88e-4),
    ]
    missing = [(-1.17, -0.17, -3.92e-4), (-0.475, -0.475, 0)]
    assert functions(modes, "y") == sorted(table + missing)


def test_experiment_3_has_the_functions_of_table_4_17() -> None:
    modes = functions(analytic_modes(45.0, 0.95, (0.1, 0.2)), "x")
    table = [
        (1, 0, -9.8e-5),
        (1, 0, 9.8e-5),
        (1, 0, -1.96e-4),
        (1, 0, 1.96e-4),
        (1, 0, 0),
        (-0.95, 0, 0),
        (0, 0, 0),
        (1, 0.195, -9.8e-5),
        (1, 0.39, -1.96e-4),
        (1, -0.195, 9.8e-5),
        (1, -0.39, 1.96e-4),
        (-0.0725, -1.0725, 5.39e-4),
        (-0.17, -1.17, 5.88e-4),
        (-0.475, -0.475, 0),
        (0.1225, -0.8775, 4.41e-4),
    ]
    assert set(table) <= set(modes)
    assert set(modes) - set(table) == {(0.22, -0.78, 3.92e-4)}


@pytest.mark.parametrize("normal", NORMALS)
@pytest.mark.parametrize("slip", ["none", "forward", "backward", "halt"])
def test_a_bounce_returns_the_normal_velocity_and_friction_is_bounded(
    normal: tuple[float, float], slip: str, rng: np.random.Generator
) -> None:
    elasticity, friction = 0.8, 0.3
    matrix, offset = contact_law(normal, elasticity, friction, slip)
    n, t, g = np.array(normal), np.array([-normal[1], normal[0]]), np.array([0.0, -9.8e-4])
    for v in rng.normal(size=(20, 2)):
        after = matrix @ v + offset
        impulse = after - (v + g)
        push = float(impulse @ n)
        assert float(after @ n) == pytest.approx(-elasticity * float(v @ n), abs=1e-12)
        if slip == "halt":
            assert float(after @ t) == pytest.approx(0.0, abs=1e-12)
        else:
            bound = {"none": 0.0, "forward": -friction, "backward": friction}[slip]
            assert float(impulse @ t) == pytest.approx(bound * push, abs=1e-12)


def test_explaining_lists_every_fitting_mode() -> None:
    modes = analytic_modes(30.0, 0.9, 0.0)
    before = np.array([[0.01, 0.0], [0.01, -0.02], [0.01, -0.02]])
    after = np.array([[0.01, 0.0], [0.01, -0.02 - 9.8e-4], [0.5, 0.5]])
    fly, bounce, slide, slope = (
        modes.index("y", case)
        for case in (Case("none"), Case("floor"), Case("floor", sliding=True), Case("slope"))
    )
    found = modes.explaining("y", before, after)
    assert found.shape == (3, 4)
    assert set(np.flatnonzero(found[0])) == {bounce, slide}  # at v_y = 0 both say 0
    assert set(np.flatnonzero(found[1])) == {fly}
    assert not found[2].any()
    assert slope not in (fly, bounce, slide)
    assert modes.index("y", Case("floor", "halt", 0.7)) == -1
    assert modes.y[slide].name == "slide, floor"


def test_the_trucks_modes_are_table_3_1() -> None:
    assert [(m.heights, m.force_weight, m.friction_weights) for m in truck_modes(3)] == [
        ((3,), 0.025, (-7.5,)),
        ((2, 1), 0.025, (-5.0, -2.5)),
        ((1, 1, 1), 0.025, (-2.5, -2.5, -2.5)),
    ]
    assert [m.name for m in truck_modes(4)][:2] == ["stacks of 4", "stacks of 3, 1"]
