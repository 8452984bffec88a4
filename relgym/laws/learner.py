"""Learns laws of motion from a stream of transitions: a free law per type, one law of touching pairs.

The law of pairs is learned from single contacts; transitions in which a body has several test how laws compose. Every
contact is predicted before it is learned from. When the laws don't explain one, the law of pairs is searched for again,
in all frames, among the bounded number of contacts kept. When a free law turns out to have been over-specific, all that
was derived from it is derived again from the raw contacts.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.config.constants import FIRST, LEFT_OPEN, OFTEN, ROUNDINGS, SELDOM, STDS, TOLD
from relgym.laws.book import LawBook, Motion
from relgym.laws.columns import Sources, vector_types
from relgym.laws.description import EXCEPTION_BITS
from relgym.laws.drift import Drift
from relgym.laws.encounters import EncounterStore
from relgym.laws.free import FreeLearner
from relgym.laws.inertia import Inertia
from relgym.laws.ledger import Ledger, doubtful
from relgym.laws.pair import PairFit, fit_pair, outdated
from relgym.laws.points import Points
from relgym.laws.records import FreeLaw, Kind, PairLaw, Share
from relgym.laws.store import Stream
from relgym.laws.touching import Cast, Contacts
from relgym.laws.turning import PushStore
from relgym.scene.objects import Target
from relgym.scene.schema import SceneSchema
from relgym.scheduling.renewal import due

__all__ = ["LawLearner"]


class LawLearner:
    """Laws of all types whose velocity is a vector of learned properties.

    Parameters
    ----------
    schema
        The scenes' schema.
    targets
        What is learned; a type takes part when all components of its velocity do.
    seed
        Seed of everything random.
    noise_std
        Standard deviation of the noise on velocities, or ``"auto"``.

    Attributes
    ----------
    book
        The laws learned so far.

    Notes
    -----
    Cost per transition: the laws' evaluation, some 0.1 ms a moving body that touches something; a search, up
    to some 0.1 s, when a contact is news, and ever more rarely while searches fail.
    """

    def __init__(
        self,
        schema: SceneSchema,
        targets: tuple[Target, ...],
        *,
        seed: int,
        noise_std: float | str = "auto",
    ) -> None:
        self.schema = schema
        self.sources = {t.name: Sources.of(schema, t, targets) for t in vector_types(schema, targets)}
        self.book = LawBook(schema, self.sources)
        self._noise = None if noise_std == "auto" else float(noise_std)
        self._free = {name: FreeLearner(s, seed=seed) for name, s in self.sources.items()}
        # Of bodies that turn only contacts in one point tell which impulse did what.
        self._store: EncounterStore | PushStore = EncounterStore(schema, self.sources, seed=seed)
        if self.book.turning:
            self._store = PushStore(schema, self.sources, seed=seed)
        self._drift = {name: Drift() for name in self.sources}
        self._rng = np.random.default_rng([seed, Stream.PAIRS])
        self._ledger = Ledger(self.sources)
        self._news = 0
        self._stored_wrong = 0
        self._claims: dict[
            Kind, list[int]
        ] = {}  # of each kind of contacts since the law changed: all, and wrong ones
        self._doubted: set[Kind] = set()

    # ------------------------------------------------------------------ what is known
    @property
    def types(self) -> tuple[str, ...]:
        """Names of the types that take part."""
        return tuple(self.sources)

    def ready(self, type_name: str) -> bool:
        """Whether there are a free law of the type and a law of pairs.

        Bodies that turn do what no mode says where they touch: without a law of pairs nothing is claimed there.
        """
        return type_name in self.book.free and (self.book.pair is not None or self.book.turning)

    @property
    def contacts_seen(self) -> int:
        """Number of contacts from which laws could be learned so far."""
        return self._store.seen

    def seen(self, type_name: str) -> int:
        """Number of a type's transitions."""
        return self._ledger.seen(type_name)

    def settled(self, type_name: str) -> bool:
        """Whether the laws have long been as they are, and hardly ever wrong since."""
        return self._ledger.settled(type_name)

    def bits(self, type_name: str) -> float:
        """Description length of a type's transitions with the laws: statements, then exceptions.

        Of examples only some are kept; exceptions among those stand for more.
        """
        if not self.ready(type_name):
            return float("inf")
        count, free, pair = len(self.book.components(type_name)), self.book.free[type_name], self.book.pair
        forgotten = self._free[type_name].seen / max(1, free.examples) - 1.0
        numbers = len(free.components) * free.unexplained * max(0.0, forgotten)
        numbers += count * self._ledger.unlearned(type_name)
        if pair is None:
            return free.bits + EXCEPTION_BITS * (numbers + count * self._store.seen)
        numbers += (
            pair.unexplained * max(0.0, self._store.seen / max(1, pair.examples) - 1.0) + count * self._news
        )
        return free.bits + pair.bits + EXCEPTION_BITS * numbers

    # ------------------------------------------------------------------ learning
    def learn_one(
        self,
        contacts: Contacts,
        vector: NDArray[np.float64],
        following: NDArray[np.float64],
        stays: Mapping[int, bool],
        motion: Motion | None = None,
    ) -> bool:
        """Take up one transition; whether the laws changed.

        Parameters
        ----------
        contacts, vector
            Who touches whom in the scene, and its state vector.
        following
            The next state vector in the same layout.
        stays
            Whether each object (by index) is there in the next scene as well.
        motion
            What the laws say of the scene, if that is known already.
        """
        cast = contacts.cast
        if not cast.movers:
            return False
        self._rescale(cast, vector)
        motion = motion or self.book.motion(contacts, vector[None])
        after = cast.padded(following[None])[cast.velocities][..., 0]
        touching = np.flatnonzero(contacts.hits[0])
        counts = np.zeros(len(cast.layout.bodies), dtype=np.int64)
        np.add.at(counts, cast.first[touching], 1)
        np.add.at(counts, cast.second[touching], 1)
        degree = counts.tolist()
        changed = False
        right = {}
        for body in cast.movers:
            if stays[cast.layout.bodies[body]]:
                right[body] = self._assess(cast, motion, body, after)
                if degree[body] == 0:
                    changed |= self._learn_free(cast, body, motion, after[:, body], right[body])
        if changed:
            self._restate()
        elif contacts.points is not None:
            changed |= self._check_claims(cast, touching, motion, vector, after, stays)
        single = self._single(cast, touching.tolist(), degree, stays, contacts.points)
        self._count(cast, right, degree, single)
        news = [self._meet(contacts, pair, vector, after, right) for pair in single]
        if any(news) or (news and _doubled(self._store.seen, len(news))):
            changed |= self._hear(sum(news))
        return changed

    def confirm(
        self,
        cast: Cast,
        vector: NDArray[np.float64],
        following: NDArray[np.float64],
        touched: Mapping[int, Sequence[int]],
        off: Mapping[int, float],
        contacts: Callable[[NDArray[np.float64]], Contacts],
    ) -> bool:
        """`learn_one` of a transition that came as the laws said, if that is all it teaches: else nothing is done.

        It is counted, and offered to the examples kept. Parameters that are others than there:

        Parameters
        ----------
        touched
            Bodies that each mover touches.
        off
            What the prediction of each mover was off by at most.
        contacts
            Gives who touches whom in scenes of that layout, with all that is to be known of it; asked only of contacts
            that are kept, and later.
        """
        self._rescale(cast, vector)
        tolerance = self.book.tolerance
        if len(off) != len(cast.movers) or not all(
            [off.get(body, math.inf) <= tolerance for body in cast.movers]
        ):
            return False
        touching = (
            [k for k, (a, b) in enumerate(cast.pairs) if b in touched[a]] if any(touched.values()) else []
        )
        if touching and self.book.turning:
            return False  # whether they touch in one point is to be looked at
        degree = [0] * len(cast.layout.bodies)
        for pair in touching:
            for body in cast.pairs[pair]:
                degree[body] += 1
        free = [body for body in cast.movers if not degree[body]]
        single = self._single(cast, touching, degree) if touching else []
        if not self._confirms(cast, free) or not self._expects(cast, single):
            return False
        after = cast.padded_one(following)[cast.velocities]
        state = cast.padded_one(vector)
        for body in free:
            sources, places = cast.sources[body]
            d, type_name, x = len(sources.velocity), sources.type.name, state[places]
            name = cast.layout.names[cast.layout.bodies[body]]
            self._drift[type_name].add(name, x[:d], after[:d, body])
            self._free[type_name].confirm(x, after[: len(sources.moving), body])
        self._count(cast, dict.fromkeys(cast.movers, True), degree, single)
        for pair in single:
            assert isinstance(self._store, EncounterStore), "of bodies that turn none is single here"
            self._store.confirm(contacts, cast, pair, vector, after)
        return True

    def _confirms(self, cast: Cast, free: Sequence[int]) -> bool:
        """Whether these free bodies, which came as the laws said, change nothing but the choice of examples kept."""
        counts: dict[str, int] = {}
        for body in free:
            name = cast.sources[body][0].type.name
            counts[name] = counts.get(name, 0) + 1
        for name, more in counts.items():
            learner = self._free[name]
            seen = range(learner.seen + 1, learner.seen + more + 1)
            if not learner.confirms(more) or any([due(k, FIRST, SELDOM) for k in seen]):
                return False
        return True

    def _expects(self, cast: Cast, single: Sequence[int]) -> bool:
        """Whether these single contacts, which came as the laws said, change nothing but those kept."""
        store = self._store
        if single and _doubled(store.seen + len(single), len(single)):
            return False
        return all([cast.kinds[pair] in store.kinds for pair in single])

    def _assess(self, cast: Cast, motion: Motion, body: int, after: NDArray[np.float64]) -> bool:
        count = len(self.book.components(cast.sources[body][0].type.name))
        off = np.abs(motion.velocity[:count, 0, body] - after[:count, body])
        return bool(motion.stated[0, body] and (off <= self.book.tolerance).all())

    def _count(self, cast: Cast, right: Mapping[int, bool], degree: Sequence[int], single: list[int]) -> None:
        """Enter every mover in the ledger; laws are learned from free ones and from single contacts."""
        taught = {body for pair in single for body in cast.pairs[pair]} if single else ()
        for body, was in right.items():
            learned = degree[body] == 0 or body in taught
            self._ledger.count(cast.sources[body][0].type.name, right=was, learned=learned)

    def _learn_free(
        self, cast: Cast, body: int, motion: Motion, after: NDArray[np.float64], right: bool
    ) -> bool:
        name = cast.sources[body][0].type.name
        learner = self._free[name]
        d = len(learner.sources.velocity)
        now = motion.columns[body][:d, 0]
        self._drift[name].add(cast.layout.names[cast.layout.bodies[body]], now, after[:d])
        after = after[: len(learner.sources.moving)]
        changed = learner.learn_one(motion.columns[body][:, 0], after, right, self.book.tolerance)
        if due(learner.seen, FIRST, SELDOM) and self._noise is None:
            changed |= self._estimate(learner, self._drift[name])
        if learner.law is not None:  # more examples may have changed its last digits
            self.book.free[name] = learner.law
        return changed

    def _single(
        self,
        cast: Cast,
        touching: Sequence[int],
        degree: Sequence[int],
        stays: Mapping[int, bool] | None = None,
        points: Points | None = None,
    ) -> list[int]:
        """Pairs whose bodies touch nothing else; what a body that never moves touches is all the same.

        Of bodies that turn those that touch in a single point.
        """
        found = []
        for pair in touching:
            a, b = cast.pairs[pair]
            alone = degree[a] == 1 and (degree[b] == 1 or not cast.both[pair])
            alone = alone and (points is None or int((points.pair == pair).sum()) == 1)
            if alone and (stays is None or (stays[cast.layout.bodies[a]] and stays[cast.layout.bodies[b]])):
                found.append(pair)
        return found

    def _meet(
        self,
        contacts: Contacts,
        pair: int,
        vector: NDArray[np.float64],
        after: NDArray[np.float64],
        right: Mapping[int, bool],
    ) -> bool:
        """Keep a single contact; whether the laws had it wrong."""
        cast = contacts.cast
        a, b = int(cast.first[pair]), int(cast.second[pair])
        wrong = not right[a] or not right.get(b, True)
        self._store.add(contacts, pair, vector, after, wrong=wrong)
        return wrong

    def _check_claims(
        self,
        cast: Cast,
        touching: NDArray[np.intp],
        motion: Motion,
        vector: NDArray[np.float64],
        after: NDArray[np.float64],
        stays: Mapping[int, bool],
    ) -> bool:
        """Doubt kinds of contacts of which too many claims were wrong; whether there are more of them now.

        Laws are learned from contacts in one point. How they do where bodies lie flat, or touch others, shows here. An
        engine that hasn't settled is off by little: laws are wrong that are off by a hundredth of what contacts did.
        Claims that a contact does nothing, and that came true, aren't counted: they hide what it does where it acts.
        """
        if not len(touching):
            return False
        slack = TOLD * self.book.tolerance
        with np.errstate(invalid="ignore"):
            error = np.abs(motion.velocity[:, 0] - after).max(axis=0)
            done = np.abs(after - self.book.free_motion(cast, vector[None])[1][:, 0]).max(axis=0)
            off = ~(error <= slack) & ~(error <= done / TOLD)
            acts = off | ~(done <= slack)
        found: set[Kind] = set()
        for pair in touching.tolist():
            bodies = [
                body for body in cast.pairs[pair] if body in cast.sources and stays[cast.layout.bodies[body]]
            ]
            if not all(motion.known[0, body] for body in bodies):
                continue
            kind = cast.kinds[pair]
            counts = self._claims.setdefault(kind, [0, 0])
            counts[0] += any(acts[body] for body in bodies)
            counts[1] += any(off[body] for body in bodies)
            if kind not in self._doubted and doubtful(counts[1], counts[0], LEFT_OPEN):
                found.add(kind)
        if not found or self.book.pair is None:
            return False
        self._doubted |= found
        self.book.pair = self.book.pair.doubting(self._doubted)
        self.book.forget()
        return True

    # ------------------------------------------------------------------ deriving
    def _restate(self) -> None:
        """A free law changed: what was derived from it is derived again."""
        self.book.free = {name: f.law for name, f in self._free.items() if f.law is not None}
        self._settle()
        self._derive()

    def _hear(self, news: int) -> bool:
        """Seek the law of pairs again, if enough contacts are news; whether it changed."""
        self._news += news
        if self._news and self._news <= (OFTEN - 1.0) * self._stored_wrong:
            return False
        return self._derive()

    def _derive(self) -> bool:
        """Seek the law of pairs among the contacts kept; whether it changed."""
        before = self._says()
        found = self._found()
        if found is None:
            return False
        self._news = 0
        self.book.pair = found.law.doubting(self._doubted)
        self._stored_wrong = int((~found.explained).sum())
        changed = before != self._says()
        if changed:
            self.book.pair = found.law
            self._settle()
        self.book.forget()
        return changed

    def _found(self) -> PairFit | None:
        """The law of pairs that the contacts kept give, and how bodies share what it says; None if too few do."""
        book, store = self.book, self._store
        if len(store) < 2:  # one contact fixes a weight, another one verifies it
            return None
        if isinstance(store, PushStore):
            book.inertia = store.inertia(book.free, book.tolerance, rng=self._rng)
            return store.fit(book.free, book.inertia, book.tolerance, rng=self._rng)
        encounters = store.encounters(book)
        if encounters is None or len(encounters) < 2:
            return None
        found = fit_pair(encounters, rng=self._rng)
        if len(gone := outdated(encounters, found, rng=self._rng)):
            store.drop(gone)
            rest = store.encounters(book)
            assert rest is not None, "what came later stays"
            found = fit_pair(rest, rng=self._rng)
        book.pair = found.law
        book.shares = store.shares(book)
        return found

    def _says(self) -> tuple[Any, ...]:
        """What the laws of contacts state."""
        pair = self.book.pair
        return None if pair is None else pair.says(), dict(self.book.shares), self.book.inertia.says()

    def _settle(self) -> None:
        self.book.forget()
        self._ledger.start_again()
        self._claims.clear()
        self._doubted.clear()

    # ------------------------------------------------------------------ noise
    def _rescale(self, cast: Cast, vector: NDArray[np.float64]) -> None:
        """The tolerance covers the rounding of the largest position and velocity so far."""
        if self._noise is not None:
            self.book.tolerance = STDS * self._noise
            return
        largest = max(map(abs, vector[self.book.rounded(cast)].tolist()), default=0.0)
        floor = STDS * ROUNDINGS * sys.float_info.epsilon * largest
        self.book.tolerance = max(self.book.tolerance, floor)

    def _estimate(self, learner: FreeLearner, drift: Drift) -> bool:
        """Estimate the noise where the free law holds for few examples only; whether that gave a law."""
        law = learner.law
        if not drift.noisy():
            return False
        if law is not None and law.unexplained <= LEFT_OPEN * law.examples:
            return False
        spread = learner.spread()
        if STDS * spread <= self.book.tolerance:
            return False
        self.book.tolerance = STDS * spread
        return learner.fit(self.book.tolerance)

    # ------------------------------------------------------------------ saving
    @property
    def store_shape(self) -> tuple[int, int]:
        """Width of a stored contact, and most of them that are kept."""
        return self._store.shape

    @property
    def object_columns(self) -> tuple[int, ...]:
        """Columns of a stored contact that hold numbers of objects: none unless bodies turn."""
        return self._store.object_columns if isinstance(self._store, PushStore) else ()

    def free_shape(self, type_name: str) -> tuple[int, int]:
        """The same of a type's free examples."""
        return self._free[type_name].store.shape

    def to_json(self, *, history: bool) -> dict[str, Any]:
        """Plain data: the laws; with history all that further learning needs but the examples."""
        data: dict[str, Any] = {
            "tolerance": self.book.tolerance,
            "free": [law.to_json() for _, law in sorted(self.book.free.items())],
            "pair": None if self.book.pair is None else self.book.pair.to_json(),
            "shares": [
                [*kind, s.property, s.power, s.constant] for kind, s in sorted(self.book.shares.items())
            ],
            "inertia": self.book.inertia.to_json(),
            "ledger": self._ledger.to_json(),
            "stored_wrong": self._stored_wrong,
            "news": self._news,
            "seen": self._store.seen,
        }
        if history:
            data |= {
                "random": self._rng.bit_generator.state,
                "store": self._store.to_json(),
                "drift": [[name, *d.to_json()] for name, d in sorted(self._drift.items())],
                "learners": [[name, *f.to_json()] for name, f in sorted(self._free.items())],
            }
        return data

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """The examples kept."""
        arrays = {f"contacts.{name}": a for name, a in self._store.to_arrays().items()}
        for k, (_, learner) in enumerate(sorted(self._free.items())):
            arrays |= {f"free{k}.{name}": a for name, a in learner.store.to_arrays().items()}
        return arrays

    def restore(self, data: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]] | None) -> None:
        """Take over what `to_json` and `to_arrays` wrote; without arrays the laws can only predict."""
        book = self.book
        book.tolerance = float(data["tolerance"])
        book.free = {law.type: law for law in map(FreeLaw.from_json, data["free"])}
        book.pair = None if data["pair"] is None else PairLaw.from_json(data["pair"])
        book.shares = {(a, b): Share(p, int(k), float(c)) for a, b, p, k, c in data["shares"]}
        book.inertia = Inertia.from_json(data["inertia"]) if "inertia" in data else Inertia()
        book.forget()
        laws = () if book.pair is None else (law for axis in book.pair.axes for law in axis)
        self._doubted = {kind for law in laws for kind in law.doubted}
        self._ledger.restore(data["ledger"])
        self._stored_wrong, self._news = int(data["stored_wrong"]), int(data["news"])
        for name, learner in self._free.items():
            learner.law = book.free.get(name)
        self._store.seen = int(data["seen"])
        if not arrays:
            return
        self._rng.bit_generator.state = data["random"]
        self._store.restore(data["store"], _part(arrays, "contacts"))
        for name, *sums in data.get("drift") or ():
            self._drift[name].restore(sums)
        for k, (name, *state) in enumerate(data["learners"]):
            self._free[name].restore(state, _part(arrays, f"free{k}"))


def _part(arrays: Mapping[str, NDArray[Any]], prefix: str) -> dict[str, NDArray[Any]]:
    return {name.split(".", 1)[1]: a for name, a in arrays.items() if name.startswith(f"{prefix}.")}


def _doubled(seen: int, more: int) -> bool:
    """Whether the number of contacts has just passed a power of two."""
    return seen.bit_length() != (seen - more).bit_length()
