"""What is a grandparent? relgym.logic is an inductive logic programming library of its own: facts in, clauses out.

Run: python examples/grandparents.py
"""

from __future__ import annotations

import numpy as np

from relgym.logic import FoilConfig, facts_from_tuples, learn

PARENTS = [
    ("ann", "bob"),
    ("ann", "cleo"),
    ("bob", "dora"),
    ("bob", "emil"),
    ("cleo", "fay"),
    ("dora", "gus"),
    ("emil", "hal"),
    ("fay", "ida"),
]
PEOPLE = sorted({name for pair in PARENTS for name in pair})


def main() -> None:
    """Learn the relation from who is a grandparent of whom, and who isn't."""
    facts, (number,) = facts_from_tuples([{"parent": PARENTS}], [PEOPLE])
    grand = {(a, d) for a, b in PARENTS for c, d in PARENTS if b == c}
    pairs = [(a, b) for a in PEOPLE for b in PEOPLE if a != b]
    examples = np.array([(0, number[a], number[b]) for a, b in pairs])
    holds = np.array([pair in grand for pair in pairs])
    found = learn(facts, examples[holds], examples[~holds], config=FoilConfig(mdl=False))
    for clause in found.clauses:
        print(f"grandparent(A, B) ← {clause}")
    print(f"right in {found.performance:.0%} of {len(pairs)} pairs")


if __name__ == "__main__":
    main()
