"""Layouts of state vectors: what a copy of one holds."""

from __future__ import annotations

import copy
import pickle

from relgym.model.percepts.scenes import passage
from relgym.scene.objects import ObjectType, SceneLayout


def test_a_copy_of_a_layout_leaves_out_what_is_kept_beside_it() -> None:
    # Layouts name those that scenes went on to; if copies held these, copies of copies would grow without bounds.
    disc = ObjectType("disc", ("x", "v"))
    first, then = SceneLayout(("a", "b"), (disc, disc)), SceneLayout(("a",), (disc,))
    way = passage(first, then)
    assert (first.width, way.columns.tolist(), way.stays) == (4, [0, 1], (True, False))
    for again in (copy.deepcopy(first), copy.copy(first), pickle.loads(pickle.dumps(first))):
        assert again == first and set(again.__dict__) == {"names", "types"}
        assert again.width == 4 and again.column(1, "v") == 3
        assert passage(again, then).columns.tolist() == [0, 1]
