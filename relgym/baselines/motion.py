"""The two guesses that need no learning: nothing moves; everything keeps moving as it does."""

from __future__ import annotations

from relgym.baselines.base import Float1D, Float2D

__all__ = ["ConstantVelocity", "Persistence"]


class Persistence:
    """Objects stay where they are: the next displacement is 0.

    Parameters
    ----------
    velocity
        Columns of the features that hold the present velocity.
    """

    def __init__(self, velocity: tuple[int, ...]) -> None:
        self.velocity = velocity

    def learn_one(self, x: Float1D, y: Float1D) -> None:
        """There is nothing to learn."""

    def predict_one(self, x: Float1D) -> Float1D:
        """Zero for each velocity."""
        values: Float1D = self.predict_batch(x[None])[0]
        return values

    def predict_batch(self, x: Float2D) -> Float2D:
        """Zeros, shape ``(n, len(velocity))``."""
        return 0.0 * x[:, list(self.velocity)]


class ConstantVelocity(Persistence):
    """Objects keep their velocity: the thesis' "no change" (§4.3.3, the dashed line of its figures)."""

    def predict_batch(self, x: Float2D) -> Float2D:
        """Present velocities, shape ``(n, len(velocity))``."""
        return x[:, list(self.velocity)].copy()
