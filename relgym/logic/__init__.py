"""First-order rules from examples: FOIL (Quinlan 1990), over integers and symbols only.

A library of its own: it knows nothing of scenes, modes or numbers' meanings.

Examples
--------
Who is whose grandparent (§3.4.1)?

>>> import numpy as np
>>> from relgym.logic import FoilConfig, facts_from_tuples, learn
>>> parents = [("ann", "bob"), ("bob", "cid"), ("bob", "dan"), ("cid", "eve")]
>>> names = ["ann", "bob", "cid", "dan", "eve"]
>>> facts, [number] = facts_from_tuples([{"parent": parents}], [names])
>>> pairs = [("ann", "cid"), ("ann", "dan"), ("bob", "eve")]
>>> positives = np.array([[0, number[old], number[young]] for old, young in pairs])
>>> others = [(old, young) for old in names for young in names if (old, young) not in pairs]
>>> negatives = np.array([[0, number[old], number[young]] for old, young in others])
>>> print(learn(facts, positives, negatives, config=FoilConfig(mdl=False)))
(parent(A, C) ∧ parent(C, B))
"""

from relgym.logic.clause import ANY, Clause, Coverage, Definition, Literal
from relgym.logic.csp import World, decide, holds, matches, satisfiable, solutions, world_of
from relgym.logic.facts import Facts, facts_from_tuples
from relgym.logic.foil import FoilConfig, learn, learn_both

__all__ = [
    "ANY",
    "Clause",
    "Coverage",
    "Definition",
    "Facts",
    "FoilConfig",
    "Literal",
    "World",
    "decide",
    "facts_from_tuples",
    "holds",
    "learn",
    "learn_both",
    "matches",
    "satisfiable",
    "solutions",
    "world_of",
]
