"""What one body sees of the others: which of them are close or struck, and the contact facts of each."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relgym.scene.relations import Relations

__all__ = ["Surroundings", "surroundings"]


class Surroundings(NamedTuple):
    """A body's surroundings in n scenes of K bodies.

    Attributes
    ----------
    close
        The body itself and all that touch it and don't leave it, or else the nearest one, shape ``(n, K)``.
    struck
        The body itself and what it approaches fastest of what it touches, shape ``(n, K)``; None without `parting`.
    contacts
        Contact features in the order of `Extractor.features`, shape ``(n, K, F)``; NaN where undefined.
    """

    close: NDArray[np.bool_]
    struck: NDArray[np.bool_] | None
    contacts: NDArray[np.float64]


def surroundings(
    relations: Relations, body: int, features: tuple[str, ...], *, offsets: bool = False, parting: bool = True
) -> Surroundings:
    """What a body sees of the others.

    Parameters
    ----------
    relations
        Relations of n scenes.
    body
        The body's number.
    features
        Names of the contact features (`Extractor.features`).
    offsets
        Whether distance, approach and offsets are told of all pairs, touching or not (`SceneSchema.offsets`).
    parting
        Whether a body that this one is leaving is left out of its close set, if it touches another one.
    """
    contacts = relations.contacts(body)
    gaps = _gaps(features) if offsets else []
    kept = contacts[..., gaps].copy()
    at = features.index("approach")
    # Contact facts are facts of touching pairs: a normal towards something far says nothing.
    contacts[~relations.touched(body)] = np.nan
    leaving = contacts[..., at] > relations.parting(body)
    # Where bodies part, the contact does nothing any more, whichever way it faces: only that they part is said.
    contacts[leaving, :at] = contacts[leaving, at + 1] = np.nan
    close, struck = relations.context(body), None
    if parting:
        close = _without(close, leaving)
        struck = _approached(contacts[..., at], body, relations.parting(body))
    contacts[..., gaps] = kept
    return Surroundings(close, struck, contacts)


def _gaps(names: tuple[str, ...]) -> list[int]:
    """Columns of the contact features that are told of all pairs where offsets are asked for, touching or not."""
    return [
        k for k, name in enumerate(names) if name in ("distance", "approach") or name.startswith("offset-")
    ]


def _approached(
    approach: NDArray[np.float64], body: int, parting: float | NDArray[np.float64]
) -> NDArray[np.bool_]:
    """The target, and of the bodies that it touches and doesn't leave the one that it approaches fastest.

    Parameters
    ----------
    approach
        The target's and each touched body's relative normal velocity, NaN for the others, shape ``(n, K)``.
    body
        The target's number.
    parting
        Speed up to which bodies don't part.
    """
    closing = np.where(approach <= parting, approach, np.inf)
    found: NDArray[np.bool_] = closing <= closing.min(axis=1, keepdims=True) + parting
    found &= closing < np.inf
    found[:, body] = True
    return found


def _without(close: NDArray[np.bool_], leaving: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Close sets without the bodies that the target is leaving, where others are left beside itself."""
    kept = close & ~leaving
    return np.where(kept.sum(axis=1, keepdims=True) > 1, kept, close)
