"""Laws of motion in the frames that scenes offer: how things move freely, and what touching pairs do.

Along the world's axes a bounce is a new mode for every direction, and a corner is noise; in the frame of the contact
they are one law. For types whose velocity is a vector of targets, `relgym.laws` learns

- a *free law*, sparse linear, from objects that touch nothing: ``u = v + g``;
- a *law of touching pairs* for the relative velocity, along the axes of a frame that the scene offers (contact normal
  and slip direction, line of centres, own axes, the world's). Along each axis it is one linear piece or the maximum
  or minimum of two or three, in `u` (the velocity without this contact), `v` (the present one) and, as `J`, the
  impulses of earlier axes: ``v'_n = max(u_n, -0.9 v_n)``, ``v'_t = max(0, u_t - 0.2 J_n)``;
- how two moving bodies *share* an impulse: by halves, by a property of theirs, or by a constant;
- the *grip* of round bodies that spin in the plane (the declared rate of their rotation is learned too): the law is
  then one of the points that touch, and part of a change along the slip is the velocity's, the rest the spin's.

*Bodies that turn.* Where a type spins that isn't round (the declared rate of its rotation is learned), contacts are
points. `relgym.scene.geometry.manifolds` finds up to two for each pair of convex parts, from geometry alone: the axis
of least overlap, on each body the edge that faces the other one, both clipped against each other. They are the
engine's, on each body's own edge, to rounding. In space, and for curved bodies but discs, there are none, and nothing
is claimed of spins. At each point there are two *rows*, along the normal and along the slip direction of the two
surfaces; a row's `u` is its velocity without its own impulse, and `J_n` what the normal impulse would change along t.
The laws are those of above. How impulses move and turn bodies is learned from bodies that touch in one point and
touch nothing else (`relgym.laws.inertia`): impulses are opposite, whatever the law, so that one contact tells the
ratio of two masses, and of each body moment over mass. Both are functions of what is seen, of area and mean square
radius, or else constants of types or of objects: the shortest description wins, and needs no law of contact. A type
never seen moves as its kin, if all types with its parent agree.

Bodies that points tie together are an *island*. Which piece of each law holds there is tried (a semismooth Newton
method), each try one linear system in all impulses; where that goes round in circles, sweeps come between
(`relgym.laws.impulses`). Redundant points leave impulses open, never velocities: where those are open too, or nothing
settles, nothing is claimed. Without a law of pairs, types that turn are governed by their free law, and every contact
is left unsaid. What no free law explains is noise only if it is anew in every step (`relgym.laws.drift`): a magnet's
pull isn't, and is left unsaid as well.

Bodies that turn may move freely by other laws in other regions (`relgym.laws.regions`): where wind blows, though
nothing marks the place. Laws are found in stretches of neighbouring examples, and a tree over positions tells where
each holds; between the last example on one side and the first one on the other nothing is claimed. Their velocity
times its magnitude is among what free laws read, for drag. What modes say of bodies that turn is never claimed while
no law governs them: what contacts do to them is no function along the world's axes, and no clause tells when they are
touched where. Surfaces may run, as a conveyor's: what is stuck to one moves at its speed, and less that speed its
contacts obey the law of all others.

*Composition.* Every contact sees the free motion and what all others do to it; sweeps repeat until nothing changes. A
ball jammed in a rough wedge would need thousands; they are extrapolated, and where nothing settles nothing is
claimed. Single contacts teach, the others check.

*Selection.* Frame, pieces, operator and features are those of the shortest description. Types of bodies get laws of
their own only where that is shorter (materials). Other laws that explain all examples as briefly stay as
*alternatives*: where they disagree, nothing is predicted. So it is where a law fails on its own examples, or surely on
those of one kind of contacts (a conveyor among walls), and where an impulse would turn a body back in a sense in which
none was seen to. A law that has no piece for letting go pays extra. A piece is found once more examples agree
than chance explains: where states are exact, one more than it has weights.

*Revision.* Contacts are kept raw, at most 3,000; what was news when it came stays longest. When a free law turns out
to have been over-specific, all that rests on it is derived again. Where contacts, or free bodies, came as predicted
less often from some time on, and two laws, one for what was before and one for what came since, are shorter than one,
the world has changed: what the later law doesn't say of earlier examples is forgotten.

*Laws or modes?* The model weighs both by description length, each unexplained number once, and lets laws govern a
type where they are shorter: laws that leave all bounces open may win, and then say nothing of bounces. Without
contacts there is no law of pairs, and nothing changes. While laws govern and are hardly ever wrong, the type's modes
rest; wrong predictions in more than 2 % wake them. ``frames="world"`` is the learner of the thesis.
"""
