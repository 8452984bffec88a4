"""A law that saturates, taught to relgym from outside: ``x' = clip(a x + b u + c, low, high)``, under noise too.

Run: python examples/saturating_law.py
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import relgym
from relgym.hypotheses import Examples, register_hypothesis


@dataclass(frozen=True)
class Saturating:
    """Weights of the columns and of 1, and the bounds that cut their sum off."""

    names: tuple[str, ...]
    weights: tuple[float, ...]
    low: float
    high: float

    @property
    def parameters(self) -> int:
        return len(self.weights) + 2

    def predict(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        columns = zip(self.weights, (*x.T, np.ones(len(x))), strict=True)
        total = np.add.reduce([weight * column for weight, column in columns])
        return np.clip(total, self.low, self.high)

    def text(self) -> str:
        terms = zip(self.weights, (*self.names, "1"), strict=True)
        return f"clip({' + '.join(f'{w:.4g} {t}' for w, t in terms)}, {self.low:.4g}, {self.high:.4g})"

    def to_json(self) -> dict[str, Any]:
        return asdict(self)


class SaturatingLaws:
    """Fits weights to what lies between the bounds, and each bound to what lies beyond it, in turns."""

    name = "saturating"

    def propose(self, examples: Examples) -> Saturating | None:
        x, y = np.column_stack([examples.x, np.ones(len(examples.y))]), examples.y
        low, high = np.quantile(y, [0.1, 0.9])
        inside, weights = (y > low) & (y < high), np.zeros(x.shape[1])
        for _ in range(30):
            if inside.sum() < 2 * x.shape[1]:
                return None
            weights = np.linalg.lstsq(x[inside], y[inside])[0]
            below, above = x @ weights < low, x @ weights > high
            low = np.median(y[below]) if below.any() else low
            high = np.median(y[above]) if above.any() else high
            inside = ~(below | above)
        if inside.all():
            return None  # nothing saturates: others say so in fewer words
        return Saturating(examples.names, tuple(weights.tolist()), float(low), float(high))

    def from_json(self, data: Mapping[str, Any]) -> Saturating:
        return Saturating(tuple(data["names"]), tuple(data["weights"]), data["low"], data["high"])


if __name__ == "__main__":
    register_hypothesis(SaturatingLaws())
    rng = np.random.default_rng(0)
    v, u = np.zeros((601, 1)), rng.uniform(-1.0, 1.0, (600, 1))
    for t in range(600):  # a motor whose speed is limited, and measured with an error
        v[t + 1] = np.clip(0.8 * v[t] + 0.7 * u[t], -0.6, 0.9) + 0.003 * rng.normal()
    data = relgym.Dataset.from_arrays(v[:-1], u, v[1:])
    print(relgym.fit(data, config={"hypotheses": ["saturating"]}).describe())
