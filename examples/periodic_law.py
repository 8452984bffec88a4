"""A law with a period that nobody knows, taught to relgym from outside; run: python examples/periodic_law.py."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import relgym
from relgym.hypotheses import Examples, register_hypothesis


@dataclass(frozen=True)
class Periodic:
    """Weights of the columns, of 1, and of the sine and cosine of ``speed`` times the column ``clock``."""

    names: tuple[str, ...]
    weights: tuple[float, ...]
    clock: int
    speed: float

    @property
    def parameters(self) -> int:
        return len(self.weights) + 2

    def predict(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        columns = zip(self.weights, _design(x, self.clock, self.speed).T, strict=True)
        return np.add.reduce([weight * column for weight, column in columns])

    def text(self) -> str:
        wave = f"{self.speed:.5g} {self.names[self.clock]}"
        terms = zip(self.weights, (*self.names, "1", f"sin({wave})", f"cos({wave})"), strict=True)
        return " + ".join(f"{weight:.4g} {term}" for weight, term in terms if abs(weight) > 1e-9)

    def to_json(self) -> dict[str, Any]:
        return asdict(self)


class PeriodicLaws:
    """Proposes the speed that a periodogram of what linear terms leave shows, refined by Gauss and Newton's method."""

    name = "periodic"

    def propose(self, examples: Examples) -> Generator[int, None, Periodic | None]:
        x, y = examples.x[-256:], examples.y[-256:]
        left = y - x @ np.linalg.lstsq(x, y)[0]
        found = [(0.0, 0, 0.0)]
        for clock in np.flatnonzero(np.ptp(x, axis=0) > 0.0).tolist():
            speeds = np.arange(1, 2 * len(x)) * (0.5 * np.pi / np.ptp(x[:, clock]))
            power = np.abs(np.exp(1j * np.outer(speeds, x[:, clock])) @ left)
            found.append((float(power.max()), clock, float(speeds[power.argmax()])))
            yield 8 * len(speeds) * len(x)
        _, clock, speed = max(found)
        for _ in range(20):
            columns = _design(x, clock, speed)
            fit = np.linalg.lstsq(columns, y)[0]
            slope = x[:, clock] * (fit[-2] * columns[:, -1] - fit[-1] * columns[:, -2])
            speed += float(np.linalg.lstsq(np.column_stack([columns, slope]), y - columns @ fit)[0][-1])
        fitted = tuple(np.linalg.lstsq(_design(examples.x, clock, speed), examples.y)[0].tolist())
        return Periodic(examples.names, fitted, clock, speed)

    def from_json(self, data: Mapping[str, Any]) -> Periodic:
        return Periodic(tuple(data["names"]), tuple(data["weights"]), data["clock"], data["speed"])


def _design(x: NDArray[np.float64], clock: int, speed: float) -> NDArray[np.float64]:
    """Columns of ``a x + b u + c + d sin(speed t) + e cos(speed t)``, where t is the column ``clock``."""
    return np.column_stack([x, np.ones(len(x)), np.sin(speed * x[:, clock]), np.cos(speed * x[:, clock])])


if __name__ == "__main__":
    register_hypothesis(PeriodicLaws())
    x, u = np.zeros((401, 2)), np.random.default_rng(0).uniform(-1.0, 1.0, (400, 1))
    for t in range(400):  # what rises and falls every 17.3 steps
        x[t + 1] = 0.9 * x[t, 0] - 0.2 * u[t, 0] + 0.5 * np.sin(2 * np.pi * t / 17.3 + 0.4), t + 1
    data = relgym.Dataset.from_arrays(x[:-1], u, x[1:])
    print(relgym.fit(data, config={"hypotheses": ["periodic"]}).describe())
