"""What a program's operations do: one step of one scene, of many scenes; for any tape.

Written out number by number, in the order in which `relgym.scene`, `relgym.laws` and `relgym.classification` work on
arrays: the same operations, hence the same bits. It is the plain Python of numbers that `relgym.program.compiling`
reads, and runs as Python, too, some thousand times slower.

`s` is a scene's work space (`relgym.program.tape.SPACE`); ``s.x`` holds the registers (`relgym.program.records`).
"""

from __future__ import annotations

import math

import numpy as np

from relgym.program.records import LEAST_RATE, SAYS, VALUED, WIDER
from relgym.program.tape import (
    ANGLES,
    ANSWERS,
    ASKED,
    AT_ANGLES,
    AT_ANSWERS,
    AT_BODIES,
    AT_KINEMATICS,
    AT_LAWS,
    AT_MOVERS,
    AT_NEXTS,
    AT_PAIRS,
    BODIES,
    BODY,
    DIMENSIONS,
    EVERYTHING,
    FACTS,
    KEYS,
    KINEMATICS,
    LAWS,
    MOST_CONTACTS,
    MOVERS,
    NEXTS,
    NOBODY,
    OFFSETS,
    OTHERS,
    PAIRS,
    PART,
    PARTING,
    PRECISION,
    RELATIONS,
    REMEMBERED,
    REMEMBERED_MODES,
    REMEMBERED_ROLES,
    SLACK,
    TOUCH,
    TURN,
    UP,
    WIDTH,
)

__all__ = ["forget", "roll", "run", "see"]

PREDICTED, NO_MODE, UNEXPLAINED, NO_ROLES, OUTSIDE, DEPENDS, UNSURE = range(7)
"""Outcomes, in the order of `relgym.model.predicting.prediction.OUTCOMES`."""

lanes = range
"""A range whose rounds don't wait for each other: compiled, several are made at once."""

BAD_SIZE = 1
"""A body's extents can't be: arrays say which."""

TOO_MANY = 2
"""More contacts than there is space for: arrays have more."""

TURNED = 3
"""A box in space is turned: that takes arrays."""

NOT_FINITE = 4
"""A number is NaN or infinite: arrays say so."""

OWN, GUESS, REGRESSION, LATEST, PERSISTENCE = range(5)
"""Who gives a value (`relgym.program.records.EXPERTS`); what nobody does stays as it is."""

FREE, TOUCHING = 1, 2
VOTE_UNIT = 4294967296.0
SWEEPS, LEAP, FARTHEST, SETTLED = 400, 10, 100.0, 1e-15
ROUNDINGS = 8.0 * 2.220446049250313e-16
ROUND = 1e-9
CLEAR = 1e-6
ALIGN_MARGIN, MIN_OVERLAP, SIZE_RATIO = 0.05, 0.1, 1.1
SAME_DISTANCE = 1e-9
TURN_AROUND = 2.0 * math.pi
GOLDEN = np.uint64(0x9E3779B97F4A7C15)
MIX_A, MIX_B = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
S30, S27, S31, ONE64, ZERO64 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(1), np.uint64(0)
BX, LOW_X, HIGH_X, SIZE, SPEED, WHOLE = 0, 3, 6, 9, 10, 11
BY, LOW_Y, HIGH_Y = 1, 4, 7
(SHAPE, CORNERS, OUTLINE, COL_X, COL_Y, COL_Z, COL_SX, COL_SY, COL_SZ, COL_ANGLE, COL_VX, COL_VY, COL_VZ) = (
    range(13)
)
MOVES, COL_SPIN, SPINS, GROUP, POSE = range(13, 18)
(NX, NY, CX, CY, COS, SIN, SHARE, GRIP, ARM_A, ARM_B, JX, JY, DX, DY, EX, EY) = range(16)


# ---------------------------------------------------------------------------------------------- numbers
def largest(a: float, b: float) -> float:
    """The larger one; NaN if either is."""
    if a != a or b != b:
        return math.nan
    return a if a >= b else b


def smallest(a: float, b: float) -> float:
    """The smaller one; NaN if either is."""
    if a != a or b != b:
        return math.nan
    return a if a <= b else b


def total(s, at):
    """A sum of weighted registers."""
    value, weight = 0.0, s.code[at + 1]
    for k in range(s.code[at]):
        column = s.code[at + 2 + k]
        if column < 0:
            value += s.numbers[weight + k]
        else:
            value += s.numbers[weight + k] * s.x[column]
    return value


def piece(s, at):
    """A sum over what laws read of a contact."""
    value, weight = 0.0, s.code[at + 1]
    for k in range(s.code[at]):
        column = s.code[at + 2 + k]
        if column < 0:
            value += s.numbers[weight + k]
        else:
            value += s.numbers[weight + k] * s.features[column]
    return value


def mixed(h):
    """Scramble 64 bits (splitmix64)."""
    h = (h ^ (h >> S30)) * MIX_A
    h = (h ^ (h >> S27)) * MIX_B
    return h ^ (h >> S31)


# ---------------------------------------------------------------------------------------------- shapes
def look(s):
    """Take up the bodies of a scene: places, bounding boxes; 0, or `BAD_SIZE`."""
    x, body = s.x, s.body
    precision = s.numbers[PRECISION]
    s.masks[5] += 3  # what is known of other scenes' pairs is out of date
    for k in range(s.code[BODIES]):
        at = s.code[AT_BODIES] + BODY * k
        body[k, BX], body[k, BY] = x[s.code[at + COL_X]], x[s.code[at + COL_Y]]
        width, height = x[s.code[at + COL_SX]], x[s.code[at + COL_SY]]
        if not (width > 0.0 and height > 0.0):
            return BAD_SIZE
        s.placed[k] = 0
        if s.code[DIMENSIONS] == 3:
            depth = x[s.code[at + COL_SZ]]
            if not depth > 0.0:
                return BAD_SIZE
            if s.code[at + SHAPE] == 0 and max(abs(depth - width), abs(height - width)) > ROUND * width:
                return BAD_SIZE
            if s.code[at + SHAPE] != 0:
                for d in (3, 4, 5):
                    if x[s.code[at + POSE + d]] != 0.0:
                        return TURNED
            else:
                height = depth = width
            body[k, BX + 2] = x[s.code[at + COL_Z]]
            body[k, LOW_X], body[k, LOW_X + 1], body[k, LOW_X + 2] = -0.5 * width, -0.5 * height, -0.5 * depth
            body[k, HIGH_X], body[k, HIGH_X + 1], body[k, HIGH_X + 2] = 0.5 * width, 0.5 * height, 0.5 * depth
        elif s.code[at + SHAPE] == 0:
            if abs(height - width) > ROUND * width:
                return BAD_SIZE
            radius = 0.5 * width
            body[k, LOW_X], body[k, LOW_Y], body[k, HIGH_X], body[k, HIGH_Y] = (
                -radius,
                -radius,
                radius,
                radius,
            )
        elif x[s.code[at + COL_ANGLE]] == 0.0:
            n = s.code[at + OUTLINE]
            body[k, LOW_X], body[k, LOW_Y] = s.numbers[n] * width, s.numbers[n + 1] * height
            body[k, HIGH_X], body[k, HIGH_Y] = s.numbers[n + 2] * width, s.numbers[n + 3] * height
        else:
            place(s, k)
            least_x = least_y = math.inf
            most_x = most_y = -math.inf
            for v in range(s.code[at + CORNERS]):
                least_x, most_x = min(least_x, s.edge[0, k, v]), max(most_x, s.edge[0, k, v])
                least_y, most_y = min(least_y, s.edge[1, k, v]), max(most_y, s.edge[1, k, v])
            body[k, LOW_X], body[k, LOW_Y], body[k, HIGH_X], body[k, HIGH_Y] = (
                least_x,
                least_y,
                most_x,
                most_y,
            )
        if precision != 0.0:
            size = speed = 1.0
            for column in (COL_X, COL_Y, COL_Z, COL_SX, COL_SY, COL_SZ):
                size = max(size, abs(x[s.code[at + column]]))
            for column in (COL_VX, COL_VY, COL_VZ):
                speed = max(speed, abs(x[s.code[at + column]]))
            body[k, SIZE], body[k, SPEED] = size, speed
    return 0


def place(s, k):
    """Work out a polygon's edges: where they start, relative to its place, their outward normals and lengths."""
    if s.placed[k]:
        return
    s.placed[k] = 1
    at = s.code[AT_BODIES] + BODY * k
    count, n = s.code[at + CORNERS], s.code[at + OUTLINE] + 4
    width, height = s.x[s.code[at + COL_SX]], s.x[s.code[at + COL_SY]]
    angle = s.x[s.code[at + COL_ANGLE]] * s.numbers[TURN]
    cos, sin = (1.0, angle) if angle == 0.0 else (math.cos(angle), math.sin(angle))  # zeros have signs
    for v in range(count):
        w = v + 1 if v + 1 < count else 0
        a, b = s.numbers[n + 2 * v] * width, s.numbers[n + 2 * v + 1] * height
        along = (s.numbers[n + 2 * w] - s.numbers[n + 2 * v]) * width
        up = (s.numbers[n + 2 * w + 1] - s.numbers[n + 2 * v + 1]) * height
        if up == 0.0:  # what the root and the quotients would be, to the last bit
            length, across, down = abs(along), 0.0, -1.0 if along > 0.0 else 1.0
        elif along == 0.0:
            length, across, down = abs(up), 1.0 if up > 0.0 else -1.0, -0.0
        else:
            length = math.sqrt(along * along + up * up)
            across, down = up / length, -along / length
        s.edge[0, k, v] = cos * a + -sin * b
        s.edge[1, k, v] = sin * a + cos * b
        s.edge[2, k, v] = cos * across + -sin * down
        s.edge[3, k, v] = sin * across + cos * down
        s.edge[4, k, v] = length


def disc_and_polygon(x, y, radius, edge, k, count):
    """Signed distance and normal from a disc at (x, y), relative to a polygon's place, to polygon k."""
    best, above = 0, -math.inf
    for v in range(count):
        height = edge[2, k, v] * (x - edge[0, k, v]) + edge[3, k, v] * (y - edge[1, k, v])
        if height > above:
            best, above = v, height
    a, b, nx, ny = x - edge[0, k, best], y - edge[1, k, best], edge[2, k, best], edge[3, k, best]
    along = nx * b - ny * a
    foot = min(max(along, 0.0), edge[4, k, best])
    if foot != along and above > 0.0:
        a, b = a + foot * ny, b - foot * nx
        far = math.sqrt(a * a + b * b)
        return far - radius, a / far, b / far
    return above - radius, nx, ny


def separation(x, y, edge, a, na, b, nb):
    """Largest gap of polygon a at (x, y) from polygon b along b's edge normals, and that normal."""
    best, nx, ny = -math.inf, 0.0, 0.0
    for v in range(nb):
        px, py = edge[2, b, v], edge[3, b, v]
        support = math.inf
        for w in range(na):
            support = min(support, px * edge[0, a, w] + py * edge[1, a, w])
        gap = (support - (px * edge[0, b, v] + py * edge[1, b, v])) + (px * x + py * y)
        if gap > best:
            best, nx, ny = gap, px, py
    return best, nx, ny


def nearest(x, y, edge, a, na, b, nb):
    """Distance and normal from the nearest of a's corners to b's edges, for polygons apart."""
    best, nx, ny = math.inf, 0.0, 0.0
    for w in range(na):
        for v in range(nb):
            p, q = x + (edge[0, a, w] - edge[0, b, v]), y + (edge[1, a, w] - edge[1, b, v])
            ex, ey = edge[2, b, v], edge[3, b, v]
            height = ex * p + ey * q
            along = ex * q - ey * p
            foot = min(max(along, 0.0), edge[4, b, v])
            if foot == along and height > 0.0:
                if height < best:
                    best, nx, ny = height, ex, ey
                continue
            p, q = p + foot * ey, q - foot * ex
            far = math.sqrt(p * p + q * q)
            if far < best:
                size = far if far > 0.0 else 1.0
                best, nx, ny = far, p / size, q / size
    return best, nx, ny


def polygons(x, y, edge, a, na, b, nb):
    """Signed distance and normal of two polygons, a at (x, y) from b."""
    depth, nx, ny = separation(x, y, edge, a, na, b, nb)
    other, ox, oy = separation(-x, -y, edge, b, nb, a, na)
    if other > depth:
        depth, nx, ny = other, -ox, -oy
    if depth > 0.0:
        depth, nx, ny = nearest(x, y, edge, a, na, b, nb)
        other, ox, oy = nearest(-x, -y, edge, b, nb, a, na)
        if other < depth:
            depth, nx, ny = other, -ox, -oy
    return depth, nx, ny


def discs(x, y, reach):
    """Signed distance and normal of two discs; upwards where centres coincide."""
    length = math.sqrt(x * x + y * y)
    if length > 0.0:
        return length - reach, x / length, y / length
    return length - reach, x, 1.0


def boxes(x, y, reach_x, reach_y):
    """Signed distance and normal of two boxes that aren't turned."""
    gap_x, gap_y = abs(x) - reach_x, abs(y) - reach_y
    depth = max(gap_x, gap_y)
    if depth > 0.0:
        nx, ny = max(gap_x, 0.0), max(gap_y, 0.0)
        depth = math.sqrt(nx * nx + ny * ny)
        nx, ny = nx / depth, ny / depth
    elif gap_x >= gap_y:
        nx, ny = 1.0, 0.0
    else:
        nx, ny = 0.0, 1.0
    return depth, -nx if x < 0.0 else nx, -ny if y < 0.0 else ny


def solids(s, i, j, kind):
    """Signed distance and normal of two spheres, or of two boxes that aren't turned, in space."""
    x, y, z = s.body[i, 0] - s.body[j, 0], s.body[i, 1] - s.body[j, 1], s.body[i, 2] - s.body[j, 2]
    if kind == 0:
        length = math.sqrt(x * x + y * y + z * z)
        size = length if length > 0.0 else 1.0
        s.gap[0, i, j] = length - (s.body[i, HIGH_X] + s.body[j, HIGH_X])
        s.gap[1, i, j], s.gap[2, i, j] = x / size, y / size
        s.gap[3, i, j] = z / size if length > 0.0 else 1.0
        return
    gap_x = abs(x) - (s.body[i, HIGH_X] + s.body[j, HIGH_X])
    gap_y = abs(y) - (s.body[i, HIGH_X + 1] + s.body[j, HIGH_X + 1])
    gap_z = abs(z) - (s.body[i, HIGH_X + 2] + s.body[j, HIGH_X + 2])
    depth = max(max(gap_x, gap_y), gap_z)
    nx = ny = nz = 0.0
    if max(min(gap_x, max(gap_y, gap_z)), min(gap_y, gap_z)) > 0.0:  # two of them are
        nx, ny, nz = max(gap_x, 0.0), max(gap_y, 0.0), max(gap_z, 0.0)
        depth = math.sqrt(nx * nx + ny * ny + nz * nz)
        nx, ny, nz = nx / depth, ny / depth, nz / depth
    elif gap_x >= gap_y and gap_x >= gap_z:
        nx = 1.0
    elif gap_y >= gap_z:
        ny = 1.0
    else:
        nz = 1.0
    s.gap[0, i, j] = depth
    s.gap[1, i, j], s.gap[2, i, j] = -nx if x < 0.0 else nx, -ny if y < 0.0 else ny
    s.gap[3, i, j] = -nz if z < 0.0 else nz


def measure(s, i, j):
    """Signed distance of bodies i < j; the normal points from j to i."""
    now = s.masks[5]
    if s.known[0, i, j] == now:
        return s.gap[0, i, j]
    s.known[0, i, j] = now
    a, b = s.code[AT_BODIES] + BODY * i, s.code[AT_BODIES] + BODY * j
    kind_a, kind_b = s.code[a + SHAPE], s.code[b + SHAPE]
    if s.code[DIMENSIONS] == 3:
        solids(s, i, j, kind_a)
        return s.gap[0, i, j]
    x, y = s.body[i, BX] - s.body[j, BX], s.body[i, BY] - s.body[j, BY]
    wide_a, wide_b = s.x[s.code[a + COL_SX]], s.x[s.code[b + COL_SX]]
    if kind_a == 0 and kind_b == 0:
        d, nx, ny = discs(x, y, 0.5 * wide_a + 0.5 * wide_b)
    elif kind_a == 0:
        place(s, j)
        d, nx, ny = disc_and_polygon(x, y, 0.5 * wide_a, s.edge, j, s.code[b + CORNERS])
    elif kind_b == 0:
        place(s, i)
        d, nx, ny = disc_and_polygon(-x, -y, 0.5 * wide_b, s.edge, i, s.code[a + CORNERS])
        nx, ny = -nx, -ny
    elif (
        kind_a == 2
        and kind_b == 2
        and s.x[s.code[a + COL_ANGLE]] == 0.0
        and s.x[s.code[b + COL_ANGLE]] == 0.0
    ):
        tall_a, tall_b = s.x[s.code[a + COL_SY]], s.x[s.code[b + COL_SY]]
        d, nx, ny = boxes(x, y, 0.5 * wide_a + 0.5 * wide_b, 0.5 * tall_a + 0.5 * tall_b)
    else:
        place(s, i)
        place(s, j)
        d, nx, ny = polygons(x, y, s.edge, i, s.code[a + CORNERS], j, s.code[b + CORNERS])
    s.gap[0, i, j], s.gap[1, i, j], s.gap[2, i, j] = d, nx, ny
    return d


def apart(s, i, j):
    """Gap of the bounding boxes of two bodies: no more than their distance, but for rounding."""
    widest = max(clearance(s.body, i, j, 0), clearance(s.body, i, j, 1))
    return max(widest, clearance(s.body, i, j, 2)) if s.code[DIMENSIONS] == 3 else widest


def clearance(body, i, j, d):
    """Gap of two bounding boxes along one axis."""
    x = body[i, BX + d] - body[j, BX + d]
    return max(body[i, LOW_X + d] + x - body[j, HIGH_X + d], body[j, LOW_X + d] - x - body[i, HIGH_X + d])


def limit(s, i, j, least, size):
    """Distance up to which two bodies touch, or speed up to which they don't part."""
    if s.numbers[PRECISION] == 0.0:
        return s.numbers[least]
    return s.numbers[least] + s.numbers[PRECISION] * max(s.body[i, size], s.body[j, size])


def touch(s, i, j):
    """Whether two bodies touch. Those whose bounding boxes are clear of each other aren't measured."""
    if i > j:
        i, j = j, i
    now = s.masks[5]
    if s.known[1, i, j] >= now:
        return s.known[1, i, j] == now + 1
    return touch_at(s, i, j, -math.inf if s.known[0, i, j] == now else apart(s, i, j))


def touch_at(s, i, j, gap):
    """Whether bodies i < j touch, whose bounding boxes are so far apart."""
    most, now = limit(s, i, j, TOUCH, SIZE), s.masks[5]
    near = not gap > max(CLEAR, 2.0 * most) and measure(s, i, j) <= most
    s.known[1, i, j] = now + np.int64(near)
    return near


# ---------------------------------------------------------------------------------------------- contacts
def axes(frame, c, slip_x, slip_y):
    """Unit vectors of a frame's two axes at a contact."""
    if frame == 5:
        return 1.0, 0.0, 0.0, 1.0
    if frame == 4:
        return c[COS], c[SIN], -c[SIN], c[COS]
    nx, ny = (c[CX], c[CY]) if frame == 3 else (c[NX], c[NY])
    tx, ty = -ny, nx
    if frame != 2 and slip_x * tx + slip_y * ty < 0.0:
        tx, ty = -tx, -ty
    return nx, ny, tx, ty


def relative(point, v, c, a, b):
    """Relative velocity at a contact: of the centres, or of the points that touch."""
    x, y = v[0, a] - v[0, b], v[1, a] - v[1, b]
    if point:
        turning = v[2, a] * c[ARM_A] + v[2, b] * c[ARM_B]
        x, y = x - turning * -c[NY], y - turning * c[NX]
    return x, y


def push(point, v, c, a, b, x, y):
    """Let a change of the relative velocity act on both bodies."""
    slide_x, slide_y, share = x, y, c[SHARE]
    if point:
        normal = x * c[NX] + y * c[NY]
        along_x, along_y = normal * c[NX], normal * c[NY]
        slide_x, slide_y = along_x + c[GRIP] * (x - along_x), along_y + c[GRIP] * (y - along_y)
        rest = (1.0 - c[GRIP]) * (x * -c[NY] + y * c[NX])
        both = c[ARM_A] != 0.0 and c[ARM_B] != 0.0
        if c[ARM_A] != 0.0:
            v[2, a] -= (share if both else 1.0) * rest / c[ARM_A]
        if c[ARM_B] != 0.0:
            v[2, b] -= (1.0 - share if both else 1.0) * rest / c[ARM_B]
    v[0, a] += share * slide_x
    v[1, a] += share * slide_y
    v[0, b] -= (1.0 - share) * slide_x
    v[1, b] -= (1.0 - share) * slide_y


def rule(s, at):
    """The velocity after a contact along one axis: maximum or minimum of pieces."""
    value = piece(s, s.code[at + 4])
    for k in range(1, s.code[at + 3]):
        other = piece(s, s.code[at + 4 + k])
        value = largest(value, other) if s.code[at] else smallest(value, other)
    return value


def respond(s, law, pair, c, now_x, now_y, free_x, free_y):
    """Change of the relative velocity at a contact (`relgym.laws.composition.respond`)."""
    ax, ay, bx, by = axes(s.code[law], c, free_x, free_y)
    s.features[0], s.features[1] = free_x * ax + free_y * ay, now_x * ax + now_y * ay
    s.features[2], s.features[3] = free_x * bx + free_y * by, now_x * bx + now_y * by
    change_x = change_y = 0.0
    for k in range(2):
        number = s.code[s.code[law + 3 + k] + pair]
        u = s.features[2 * k]
        after = u if number < 0 else rule(s, s.code[s.code[law + 1 + k] + number])
        s.features[4 + k] = after - u
        change_x += s.features[4 + k] * (ax if k == 0 else bx)
        change_y += s.features[4 + k] * (ay if k == 0 else by)
    return change_x, change_y


def compose(s, law, count, bodies, spins, out):
    """Let all contacts act until nothing changes (`relgym.laws.composition.compose`); whether it settled."""
    now, free, v = s.velocity[0], s.velocity[1], s.velocity[out]
    point = s.code[law] == 1
    worst = 0.0
    for k in range(bodies):
        for d in range(3 if spins else 2):
            v[d, k] = free[d, k]
            worst = largest(worst, abs(free[d, k]))
    for k in range(count):
        s.contact[k, JX] = s.contact[k, JY] = s.contact[k, EX] = s.contact[k, EY] = 0.0
    still = largest(SETTLED, ROUNDINGS * worst)
    for sweep in range(1, SWEEPS + 1):
        moved = 0.0
        for k in range(count):
            c, pair, a, b = s.contact[k], s.pair[k, 0], s.pair[k, 1], s.pair[k, 2]
            x, y = relative(point, v, c, a, b)
            now_x, now_y = relative(point, now, c, a, b)
            new_x, new_y = respond(s, law, pair, c, now_x, now_y, x - c[JX], y - c[JY])
            c[DX], c[DY] = new_x - c[JX], new_y - c[JY]
            push(point, v, c, a, b, c[DX], c[DY])
            c[JX], c[JY] = new_x, new_y
            moved = largest(moved, largest(abs(c[DX]), abs(c[DY])))
        if count == 1 or not moved > still:
            return True
        if sweep % LEAP == 0:
            leap(point, s, count, v)
        for k in range(count):
            s.contact[k, EX], s.contact[k, EY] = s.contact[k, DX], s.contact[k, DY]
    return False


def leap(point, s, count, v):
    """Continue a sequence of sweeps, each like the one before, to where it ends."""
    kept = along = 0.0
    for k in range(count):
        c = s.contact[k]
        kept += c[EX] * c[EX] + c[EY] * c[EY]
        along += c[EX] * c[DX] + c[EY] * c[DY]
    ratio = along / (kept if kept > 0.0 else 1.0)
    if ratio < 0.0:
        ratio = 0.0
    if ratio > 1.0 - 1.0 / FARTHEST:
        ratio = 1.0 - 1.0 / FARTHEST
    steps = ratio / (1.0 - ratio) if ratio > 0.5 else 0.0
    for k in range(count):
        c = s.contact[k]
        push(point, v, c, s.pair[k, 1], s.pair[k, 2], steps * c[DX], steps * c[DY])
        c[JX] += steps * c[DX]
        c[JY] += steps * c[DY]


def within(s, law, count, v):
    """Whether no contact turns a body back in a sense in which none was seen to (`relgym.laws.composition.within`)."""
    slack, point = s.numbers[SLACK], s.code[law] == 1
    for k in range(count):
        c, pair = s.contact[k], s.pair[k, 0]
        after_x, after_y = relative(point, v, c, s.pair[k, 1], s.pair[k, 2])
        free_x, free_y = after_x - c[JX], after_y - c[JY]
        ax, ay, bx, by = axes(s.code[law], c, free_x, free_y)
        for j in range(2):
            x, y = (ax, ay) if j == 0 else (bx, by)
            value, without = after_x * x + after_y * y, free_x * x + free_y * y
            number = s.code[s.code[law + 3 + j] + pair]
            if number < 0:
                return False
            at = s.code[s.code[law + 1 + j] + number]
            if value < -slack and without >= -slack and not s.code[at + 1]:
                return False
            if value > slack and without <= slack and not s.code[at + 2]:
                return False
    return True


def meet(s):
    """Find the contacts of those who move; how many there are."""
    count = 0
    for pair in range(s.code[PAIRS]):
        at = s.code[AT_PAIRS] + 6 * pair
        a, b = s.code[at], s.code[at + 1]
        if not touch(s, a, b):
            continue
        if count == MOST_CONTACTS:
            return -1
        c = s.contact[count]
        s.pair[count, 0], s.pair[count, 1], s.pair[count, 2] = pair, a, b
        sign = 1.0 if a < b else -1.0
        i, j = (a, b) if a < b else (b, a)
        c[NX], c[NY] = s.gap[1, i, j] * sign, s.gap[2, i, j] * sign
        x, y = s.body[a, BX] - s.body[b, BX], s.body[a, BY] - s.body[b, BY]
        length = math.sqrt(x * x + y * y)
        length = length if length > 0.0 else 1.0
        c[CX], c[CY] = x / length, y / length
        first, second = s.code[AT_BODIES] + BODY * a, s.code[AT_BODIES] + BODY * b
        angle = s.numbers[TURN] * s.x[s.code[first + COL_ANGLE]]
        c[COS], c[SIN] = math.cos(angle), math.sin(angle)
        c[ARM_A] = 0.5 * s.numbers[TURN] * s.x[s.code[first + COL_SX]] if s.code[first + SPINS] else 0.0
        c[ARM_B] = 0.5 * s.numbers[TURN] * s.x[s.code[second + COL_SX]] if s.code[second + SPINS] else 0.0
        c[GRIP] = s.numbers[s.code[at + 5] + 1] if c[ARM_A] != 0.0 or c[ARM_B] != 0.0 else 1.0
        c[SHARE] = s.numbers[s.code[at + 5]]
        if s.code[at + 2]:
            mine = theirs = 1.0
            for _ in range(s.code[at + 2]):
                mine, theirs = mine * s.x[s.code[at + 3]], theirs * s.x[s.code[at + 4]]
            both = mine + theirs
            c[SHARE] = math.nan if both == 0.0 else theirs / both
        count += 1
    return count


def go_on(s, k):
    """A body's velocities now, which would stay as they are."""
    at = s.code[AT_BODIES] + BODY * k
    now, free = s.velocity[0], s.velocity[1]
    now[0, k], now[1, k], now[2, k] = (
        s.x[s.code[at + COL_VX]],
        s.x[s.code[at + COL_VY]],
        s.x[s.code[at + COL_SPIN]],
    )
    free[0, k], free[1, k], free[2, k] = now[0, k], now[1, k], now[2, k]


def move(s):
    """Next velocities of all movers (`relgym.laws.book.LawBook.motion`); the number of contacts, -1: too many."""
    bodies = s.code[BODIES]
    free, v, flags = s.velocity[1], s.velocity[2], s.body_flags
    count = meet(s)
    if count < 0:
        return count
    for k in lanes(bodies):
        flags[0, k] = flags[1, k] = flags[2, k] = 0
    for k in range(bodies if count else 0):  # those who don't move take part in contacts alone
        go_on(s, k)
    for m in range(s.code[MOVERS]):
        at = s.code[s.code[AT_MOVERS] + m]
        k = s.code[at]
        if count == 0:
            go_on(s, k)
        for d in range(s.code[at + 2]):
            free[d, k] = math.nan
        for d in range(s.code[at + 3]):
            free[d, k] = total(s, s.code[at + 4 + d])
        stated = np.int64(1)
        for d in range(s.code[at + 1]):
            stated &= np.int64(math.isfinite(free[d, k]))
        flags[0, k] = flags[1, k] = stated
        v[0, k], v[1, k], v[2, k] = free[0, k], free[1, k], free[2, k]
    if count == 0:
        return count
    spins = False
    for k in range(bodies):
        spins = spins or s.code[s.code[AT_BODIES] + BODY * k + SPINS] == 1
        v[0, k], v[1, k], v[2, k] = free[0, k], free[1, k], free[2, k]
    for k in range(count):
        flags[2, s.pair[k, 1]] = flags[2, s.pair[k, 2]] = 1
    if s.code[LAWS] == 0:
        for k in range(bodies):
            if flags[2, k]:
                flags[0, k] = flags[1, k] = 0
        return count
    law = s.code[s.code[AT_LAWS]]
    settled = compose(s, law, count, bodies, spins, 2)
    lawful, point = True, s.code[law] == 1
    for k in range(count):
        c, pair = s.contact[k], s.pair[k, 0]
        if (
            s.code[s.code[law + 3] + pair] < 0
            or s.code[s.code[law + 4] + pair] < 0
            or not math.isfinite(c[SHARE])
        ):
            lawful = False
        if point and not math.isfinite(c[GRIP]):
            lawful = False
    seen = settled and lawful and within(s, law, count, v)
    governed = 3 if point and spins else 2
    for k in range(bodies):
        if not flags[2, k]:
            v[0, k], v[1, k], v[2, k] = free[0, k], free[1, k], free[2, k]
            continue
        stated = lawful
        for d in range(governed):
            stated = stated and math.isfinite(v[d, k])
        flags[1, k] = 1 if stated and seen and flags[1, k] else 0
        flags[3, k] = 1 if stated else 0
        flags[0, k] = 1 if stated and flags[0, k] else 0
    for other in range(1, s.code[LAWS]):
        compose(s, s.code[s.code[AT_LAWS] + other], count, bodies, spins, 3)
        for k in range(bodies):
            if flags[2, k]:
                for d in range(governed):
                    if not abs(s.velocity[3, d, k] - v[d, k]) <= s.numbers[SLACK]:
                        flags[1, k] = 0
    for k in range(bodies):
        if flags[2, k] and not flags[3, k]:
            v[0, k], v[1, k], v[2, k] = free[0, k], free[1, k], free[2, k]
    return count


# ---------------------------------------------------------------------------------------------- what a body sees
def nearest_to(s, t):
    """The body nearest to t, of several the first one; t itself where there is no other."""
    first, gap = t, math.inf
    for k in range(s.code[BODIES]):
        if k != t and apart(s, t, k) < gap:
            first, gap = k, apart(s, t, k)
    if first == t:
        return t
    best, least = first, measure(s, min(t, first), max(t, first))
    for k in range(s.code[BODIES]):
        if k != t and k != first and not apart(s, t, k) - CLEAR > least:
            distance = measure(s, min(t, k), max(t, k))
            if distance < least or (distance == least and k < best):
                best, least = k, distance
    return best


def surroundings(s, t):
    """Contexts and pair features of body t (`relgym.scene.surroundings`)."""
    if s.masks[3] == t:
        return
    s.masks[3] = t
    bodies, facts, others = s.code[BODIES], s.code[FACTS], s.code[OTHERS]
    offsets = s.code[OFFSETS]
    one = np.int64(1)
    own, dims = s.code[AT_BODIES] + BODY * t, s.code[DIMENSIONS]
    touched = leaving = np.int64(0)
    at_others = s.code[AT_BODIES] + BODY * bodies + s.code[RELATIONS]
    fastest = math.inf
    for k in range(bodies):
        told = s.told[k]
        if k == t:
            continue
        i, j = (t, k) if t < k else (k, t)
        near = touch(s, t, k)
        if near or offsets:
            for f in range(facts):
                told[f] = math.nan
            measure(s, i, j)
            sign = 1.0 if t < k else -1.0
            nx, ny, nz = s.gap[1, i, j] * sign, s.gap[2, i, j] * sign, 0.0
            at = s.code[AT_BODIES] + BODY * k
            rx = s.x[s.code[own + COL_VX]] - s.x[s.code[at + COL_VX]]
            ry = s.x[s.code[own + COL_VY]] - s.x[s.code[at + COL_VY]]
            approach = rx * nx + ry * ny
            slip = nx * ry - ny * rx
            if dims == 3:
                nz, rz = s.gap[3, i, j] * sign, s.x[s.code[own + COL_VZ]] - s.x[s.code[at + COL_VZ]]
                approach += rz * nz
                sx, sy, sz = rx - approach * nx, ry - approach * ny, rz - approach * nz
                slip = math.sqrt(sx * sx + sy * sy + sz * sz)
            parting = approach > limit(s, i, j, PART, SPEED)
            if near:
                touched |= one << k
                told[dims + 1] = approach
                if parting:
                    leaving |= one << k
                else:
                    told[0], told[1], told[2], told[dims + 2] = s.gap[0, i, j], nx, ny, slip
                    if dims == 3:
                        told[3] = nz
                    fastest = min(fastest, approach)
            if offsets:
                told[0], told[dims + 1] = s.gap[0, i, j], approach
                for d in range(dims):
                    told[dims + 3 + d] = s.body[t, BX + d] - s.body[k, BX + d]
    close = touched
    if touched == 0:
        close = one << nearest_to(s, t)
    close |= one << t
    s.masks[1] = close
    s.masks[2] = (one << bodies) - one
    s.masks[0] = close
    if s.code[PARTING]:
        kept = close & ~leaving
        if kept != one << t:
            s.masks[1] = kept
        struck = one << t
        for k in range(bodies):
            if touched & ~leaving & (one << k):
                i, j = (t, k) if t < k else (k, t)
                if s.told[k, dims + 1] <= fastest + limit(s, i, j, PART, SPEED):
                    struck |= one << k
        s.masks[0] = struck
    asked = s.masks[2] if s.code[EVERYTHING] else s.masks[0] | s.masks[1]
    for k in range(bodies):
        if asked & (one << k):
            if not (touched & (one << k) or (offsets and k != t)):
                for f in range(facts):
                    s.told[k, f] = math.nan
            for f in range(others):
                s.told[k, facts + f] = math.nan if k == t else s.x[s.code[at_others + k * others + f]]


def closing(s, a, b):
    """Normal speed of two bodies that touch and don't part; infinite of others."""
    first, second = s.code[AT_BODIES] + BODY * a, s.code[AT_BODIES] + BODY * b
    if not (s.code[first + MOVES] or s.code[second + MOVES]) or not touch(s, a, b):
        return math.inf
    i, j = (a, b) if a < b else (b, a)
    first, second = s.code[AT_BODIES] + BODY * i, s.code[AT_BODIES] + BODY * j
    x = s.x[s.code[first + COL_VX]] - s.x[s.code[second + COL_VX]]
    y = s.x[s.code[first + COL_VY]] - s.x[s.code[second + COL_VY]]
    speed = x * s.gap[1, i, j] + y * s.gap[2, i, j]
    if s.code[DIMENSIONS] == 3:
        speed += (s.x[s.code[first + COL_VZ]] - s.x[s.code[second + COL_VZ]]) * s.gap[3, i, j]
    return speed if speed <= limit(s, i, j, PART, SPEED) else math.inf


def sides(s, a, b):
    """How body a lies to b, and b to a: bits of the kinds of relations between bounding boxes.

    Those aside that take touching, on top among them. And the boxes' gap.
    """
    one, there, back, beside = np.int64(1), np.int64(0), np.int64(0), np.int64(0)
    gap = -math.inf
    for d in range(s.code[DIMENSIONS]):
        low_a, high_a = s.body[a, LOW_X + d], s.body[a, HIGH_X + d]
        low_b, high_b = s.body[b, LOW_X + d], s.body[b, HIGH_X + d]
        offset = s.body[a, BX + d] - s.body[b, BX + d]
        margin = -(ALIGN_MARGIN * min(high_a - low_a, high_b - low_b))
        ahead, behind = (low_b - high_a) - offset, (low_a - high_b) + offset
        gap = max(gap, max(ahead, behind))
        below, above = np.int64(ahead >= margin), np.int64(behind >= margin)
        there |= below << (5 + d) | above << (8 + d)
        back |= below << (8 + d) | above << (5 + d)
        beside |= (one ^ (below | above)) << (11 + d)
    there |= np.int64(SIZE_RATIO * s.body[a, WHOLE] < s.body[b, WHOLE]) << 4
    back |= np.int64(SIZE_RATIO * s.body[b, WHOLE] < s.body[a, WHOLE]) << 4
    return there | beside, back | beside, gap


def on_top(s, a, b, there):
    """Which of two bodies that touch lies on top of the other, a (1), b (2) or neither; `there`: what `sides` says."""
    over, under = there >> (8 + s.code[UP]) & 1, there >> (5 + s.code[UP]) & 1
    if over | under == 0:
        return np.int64(0)
    for d in range(s.code[DIMENSIONS]):
        if d != s.code[UP]:
            low_a, high_a = s.body[a, LOW_X + d], s.body[a, HIGH_X + d]
            low_b, high_b = s.body[b, LOW_X + d], s.body[b, HIGH_X + d]
            offset = s.body[a, BX + d] - s.body[b, BX + d]
            shared = min(high_a + offset, high_b) - max(low_a + offset, low_b)
            over &= np.int64(shared >= MIN_OVERLAP * (high_a - low_a))
            shared = min(high_b - offset, high_a) - max(low_b - offset, low_a)
            under &= np.int64(shared >= MIN_OVERLAP * (high_b - low_b))
    return over | under << 1


def fastest(s, a, b, own):
    """Whether a approaches no other body faster than b, which it approaches at such a speed."""
    slack = limit(s, min(a, b), max(a, b), PART, SPEED)
    for k in range(s.code[BODIES]):
        if k != a and k != b and own > closing(s, a, k) + slack:
            return False
    return True


def relate(s, among):
    """Work out all relations that are asked for between some objects: bits of kinds, and a number for all of them."""
    if among & ~s.masks[4] == 0:
        return
    among |= s.masks[4]
    s.masks[4], s.masks[6] = among, 0
    one, bodies, asked, state = np.int64(1), s.code[BODIES], s.code[ASKED], mixed(np.uint64(among))
    if asked & (one << 4):
        for k in range(bodies):
            whole = 0.0
            for d in range(s.code[DIMENSIONS]):
                wide = s.body[k, HIGH_X + d] - s.body[k, LOW_X + d]
                whole += wide * wide
            s.body[k, WHOLE] = math.sqrt(whole)
    for a in range(bodies):
        if not among & (one << a):
            continue
        for b in range(a + 1, bodies):
            if not among & (one << b):
                continue
            there = back = np.int64(0)
            if asked & ~7:
                there, back, gap = sides(s, a, b)
                near = touch(s, a, b) if s.known[1, a, b] >= s.masks[5] else touch_at(s, a, b, gap)
            else:
                near = touch(s, a, b)
            if near:
                lying = on_top(s, a, b, there) if asked & 8 else np.int64(0)
                there, back = there | 4 | (lying & 1) << 3, back | 4 | (lying >> 1) << 3
                speed = closing(s, a, b) if asked & 3 else math.inf
                if speed < math.inf:
                    there, back = there | 1, back | 1
                    if asked & 2:
                        there |= 2 if fastest(s, a, b, speed) else 0
                        back |= 2 if fastest(s, b, a, speed) else 0
            there, back = there & asked, back & asked
            s.kinds[a, b], s.kinds[b, a] = there, back
            state = (state ^ np.uint64((there << 16) + back + 1)) * MIX_A
            state ^= state >> S27
    s.state[0] = state


def unfold(s):
    """Write relations out: for each of them, and for each object, to whom it stands in it, and who does to it."""
    if s.masks[6]:
        return
    s.masks[6] = 1
    one, among, bodies = np.int64(1), s.masks[4], s.code[BODIES]
    at = s.code[AT_BODIES] + BODY * bodies
    for r in range(s.code[RELATIONS]):
        kind = s.code[at + r]
        if kind < 0:
            continue
        for k in range(bodies):
            s.rows[r, k] = s.columns[r, k] = 0
        for a in range(bodies):
            if among & (one << a):
                for b in range(bodies):
                    if b != a and among & (one << b) and s.kinds[a, b] >> kind & 1:
                        s.rows[r, a] |= one << b
                        s.columns[r, b] |= one << a


# ---------------------------------------------------------------------------------------------- clauses
def passes(value, at_most, threshold, negated):
    """Whether a number passes a test."""
    holds = value <= threshold if at_most else value > threshold
    return holds != (negated != 0)


def allowed(s, literal, variable, context):
    """Objects of a context that a variable may stand for, as far as one literal says; -1: all, without a variable."""
    one = np.int64(1)
    kind, first, second = s.code[literal], s.code[literal + 1], s.code[literal + 2]
    negated, found, bodies = s.code[literal + 4], np.int64(0), max(s.code[BODIES], 1)
    if kind == 2:
        if second == -1 or second != variable:
            # A universal test, or one of an object that is bound.
            holds = True
            for k in range(bodies):
                if (second == -1 and context & (one << k)) or (second != -1 and k == s.value[second]):
                    value = s.told[k, first]
                    if not passes(value, s.code[literal + 3], s.numbers[s.code[literal + 5]], negated):
                        holds = False
            return np.int64(-1) if holds else np.int64(0)
        for k in range(bodies):
            if context & (one << k):
                value = s.told[k, first]
                if passes(value, s.code[literal + 3], s.numbers[s.code[literal + 5]], negated):
                    found |= one << k
        return found
    if kind == 3:
        if second == variable:
            return context & (~first if negated else first)
        holds = (first & context) != 0 if second == -1 else (first & (one << s.value[second])) != 0
        return np.int64(-1) if holds != (negated != 0) else np.int64(0)
    third = s.code[literal + 3]  # relation `first` of `second` and `third`
    if second == variable or third == variable:
        table = s.rows[first] if second == variable else s.columns[first]
        back = s.columns[first] if second == variable else s.rows[first]
        other = third if second == variable else second
        if other == -1:
            for k in range(bodies):
                if context & (one << k) and table[k] & context:
                    found |= one << k
        else:
            found = back[s.value[other]] & context
        return context & ~found if negated else found
    if second == -1 and third == -1:
        holds = False
        for k in range(bodies):
            if context & (one << k) and s.rows[first, k] & context:
                holds = True
    elif second == -1:
        holds = (s.columns[first, s.value[third]] & context) != 0
    elif third == -1:
        holds = (s.rows[first, s.value[second]] & context) != 0
    else:
        holds = (s.rows[first, s.value[second]] & context & (one << s.value[third])) != 0
    return np.int64(-1) if holds != (negated != 0) else np.int64(0)


def open_to(s, level, context):
    """Objects that the variable of a level may stand for; without one: -1 if its tests hold, 0 if not."""
    variable = s.code[level]
    found = context if variable >= 0 else np.int64(-1)
    for k in range(s.code[level + 1]):
        found &= allowed(s, s.code[level + 2 + k], variable, context)
        if found == 0:
            break
    return found


def solve(s, clause, context, everything):
    """Whether objects make a clause true; what its first variables stand for is in `s.value`.

    With `everything` all solutions are found, and `s.found` says which objects each variable can stand for.
    """
    one, levels = np.int64(1), s.code[clause + 2]
    if everything:
        for k in range(s.found.shape[0]):
            s.found[k] = 0
    if open_to(s, s.code[clause + 3], context) == 0:
        return False
    if levels == 1:
        return True
    true, depth = False, 1
    s.left[1] = open_to(s, s.code[clause + 4], context)
    while depth > 0:
        if s.left[depth] == 0:
            depth -= 1
            continue
        lowest = s.left[depth] & -s.left[depth]
        s.left[depth] ^= lowest
        number = 0
        while lowest >> number != 1:
            number += 1
        s.value[s.code[s.code[clause + 3 + depth]]] = number
        if depth + 1 < levels:
            depth += 1
            s.left[depth] = open_to(s, s.code[clause + 3 + depth], context)
            continue
        true = True
        if not everything:
            return True
        for k in range(1, levels):
            variable = s.code[s.code[clause + 3 + k]]
            s.found[variable] |= one << s.value[variable]
    return true


def leaf(s, tree):
    """The leaf of a tree that a scene reaches; `s.found` says whom variables stand for."""
    node, at, one, bodies = np.int64(0), s.code[tree + 1], np.int64(1), max(s.code[BODIES], 1)
    while True:
        record = tree + 2 + 3 * node
        sight = s.code[record]
        if sight == 0:
            return node
        if s.code[sight] >= 0:
            value = s.x[s.code[sight]]
            if s.code[sight + 1] >= 0:
                value -= s.x[s.code[sight + 1]]
        else:
            value, feature = math.inf, s.code[sight + 3]
            for k in range(bodies):
                if s.found[s.code[sight + 2]] & (one << k) and s.told[k, feature] < value:
                    value = s.told[k, feature]
            if value == math.inf:
                value = math.nan
        node = s.code[record + 1] if value <= s.numbers[at + node] else s.code[record + 2]


def decide(s, contest, target):
    """Number of the outcome of one contest."""
    context = s.masks[s.code[contest + 2]]
    for k in range(s.code[contest + 4]):
        stage = s.code[contest + 5 + k]
        clause, tests, tree = s.code[stage], s.code[stage + 2], s.code[stage + 3]
        holds = True
        for t in range(s.code[stage + 1]):
            at = tests + 5 * t
            value = s.x[s.code[at]]
            if s.code[at + 1] >= 0:
                value -= s.x[s.code[at + 1]]
            if not passes(value, s.code[at + 2], s.numbers[s.code[at + 4]], s.code[at + 3]):
                holds = False
                break
        if not holds:
            continue
        if clause:
            s.value[0] = target
            if not solve(s, clause, context, tree != 0):
                continue
        if tree == 0:
            return s.code[s.code[stage + 4]]
        outcome = s.code[s.code[stage + 4] + leaf(s, tree)]
        if outcome >= 0:
            return outcome
    return np.int64(0)


# ---------------------------------------------------------------------------------------------- votes
def hash_set(members, count):
    """Sum of the distinct ones among some numbers, which are put in order."""
    for i in range(1, count):
        value, j = members[i], i
        while j > 0 and members[j - 1] > value:
            members[j] = members[j - 1]
            j -= 1
        members[j] = value
    found = ZERO64
    for i in range(count):
        if i == 0 or members[i] != members[i - 1]:
            found += members[i]
    return found


def weight(k):
    """What bit number k counts in a hash."""
    return mixed((ONE64 + np.uint64(k)) * GOLDEN)


def situation(s, used, target):
    """A number for what some relations say of a context (`relgym.logic.situations`)."""
    one = np.int64(1)
    exists, n_rel, n_un = s.masks[s.code[used]], s.code[used + 1], s.code[used + 2]
    described, around, whole = s.hashes[0], s.hashes[1], s.hashes[2]
    count = 0
    bodies = max(s.code[BODIES], 1)
    for k in range(bodies):
        if exists & (one << k) == 0:
            continue
        bits = ZERO64
        for u in range(n_un):
            if s.code[used + 3 + n_rel + u] & (one << k):
                bits += weight(u)
        for r in range(n_rel):
            if s.rows[s.code[used + 3 + r], k] & (one << target):
                bits += weight(n_un + r)
            if s.columns[s.code[used + 3 + r], k] & (one << target):
                bits += weight(n_un + n_rel + r)
        if k == target:
            bits += weight(n_un + 2 * n_rel)
        described[k] = mixed(bits + GOLDEN)
    for k in range(bodies):
        if exists & (one << k) == 0:
            continue
        inner = 0
        for j in range(bodies):
            if exists & (one << j) == 0:
                continue
            bits = ZERO64
            for r in range(n_rel):
                if s.rows[s.code[used + 3 + r], k] & (one << j):
                    bits += weight(r)
            around[inner] = mixed(mixed(bits + GOLDEN) + described[j])
            inner += 1
        whole[count] = mixed(described[k] + hash_set(around, inner))
        count += 1
    return hash_set(whole, count)


def seen_before(s, experience, target):
    """Whether the situation was seen in training."""
    unfold(s)
    number = ZERO64
    for k in range(s.code[experience]):
        number = mixed(number + situation(s, s.code[experience + 3 + k], target))
    low, high = np.int64(0), s.code[experience + 1]
    while low < high:
        middle = (low + high) // 2
        value = np.uint64(s.code[s.code[experience + 2] + middle])
        if value == number:
            return True
        if value < number:
            low = middle + 1
        else:
            high = middle
    return False


def rank(s, vote, count, target):
    """Put the modes in order, `s.order[0]`, the winner first; its lead in the last count."""
    unfold(s)
    lead, totals, alive, order = s.votes, s.order[1], s.order[2], s.order[0]
    for i in range(count):
        for j in range(count):
            lead[i, j] = 0
    for k in range(s.code[vote]):
        contest = s.code[vote + 3 + k]
        a, b = s.code[contest], s.code[contest + 1]
        at = s.code[contest + 3] + 2 * decide(s, contest, target)
        lead[a, b] = s.code[at]
        lead[b, a] = s.code[at + 1]
    for i in range(count):
        for j in range(i):
            lead[i, j], lead[j, i] = lead[i, j] - lead[j, i], lead[j, i] - lead[i, j]
    for i in range(count):
        alive[i] = s.code[s.code[vote + 1] + i]
        totals[i] = 0
        for j in range(count):
            totals[i] += lead[i, j]
    margin, left = np.int64(0), count
    while left > 1:
        worst = left - 1
        for k in range(left - 2, -1, -1):
            if totals[alive[k]] < totals[alive[worst]]:
                worst = k
        out = alive[worst]
        for k in range(worst, left - 1):
            alive[k] = alive[k + 1]
        left -= 1
        order[left] = out
        margin = lead[alive[0], out]
        for k in range(left):
            totals[alive[k]] -= lead[alive[k], out]
    order[0] = alive[0]
    return margin


# ---------------------------------------------------------------------------------------------- roles
def line_up(s, t):
    """Bodies in canonical order as t sees them (`relgym.scene.context.canonical_order`), t itself first.

    Returns whether some are alike in their relations to t, and whether some are in all relations: then numbers decide.
    """
    bodies, relations = s.code[BODIES], s.code[RELATIONS]
    toward, around = s.hashes[0], s.hashes[1]
    order = s.lineup[0]
    for k in range(bodies):
        toward[k] = both_ways(s, relations, k, t)
    tied = False
    for k in range(bodies):
        for j in range(k):
            same = (
                s.code[s.code[AT_BODIES] + BODY * k + GROUP] == s.code[s.code[AT_BODIES] + BODY * j + GROUP]
            )
            if k != t and j != t and same and toward[k] == toward[j]:
                tied = True
    if tied:
        rank_groups(s, t, relations)
    for k in range(bodies):
        around[k] = ZERO64
        if tied and k != t:
            for j in range(bodies):
                if j != k and j != t:
                    bits = both_ways(s, relations, k, j) + s.hashes[2, j]
                    around[k] += mixed(mixed(bits + GOLDEN) + toward[j] + GOLDEN)
    order[0], count, alike = t, 1, False
    for k in range(bodies):
        if k == t:
            continue
        j = count
        while j > 1:
            known, first = by_relations(s, k, order[j - 1])
            if not known:
                alike, first = True, by_numbers(s, t, k, order[j - 1])
            if not first:
                break
            order[j] = order[j - 1]
            j -= 1
        order[j] = k
        count += 1
    return tied, alike


def rank_groups(s, t, relations):
    """Numbers of the bodies' types among those of all bodies but t, from 1 on, above the bits of relations."""
    one, there = np.int64(1), np.int64(0)
    for k in range(s.code[BODIES]):
        if k != t:
            there |= one << s.code[s.code[AT_BODIES] + BODY * k + GROUP]
    for k in range(s.code[BODIES]):
        rank_ = ONE64
        for g in range(s.code[s.code[AT_BODIES] + BODY * k + GROUP]):
            if there >> g & 1:
                rank_ += ONE64
        s.hashes[2, k] = rank_ << np.uint64(2 * relations)


def both_ways(s, relations, a, b):
    """Which relations hold between two bodies either way round, as bits; the first one's are the highest."""
    bits, one = ZERO64, np.int64(1)
    for r in range(relations):
        bits = bits << ONE64 | np.uint64(s.rows[r, a] >> b & one)
        bits = bits << ONE64 | np.uint64(s.columns[r, a] >> b & one)
    return bits


def by_relations(s, a, b):
    """Whether types and relations tell which of two bodies comes first; whether a does."""
    first, second = s.code[AT_BODIES] + BODY * a, s.code[AT_BODIES] + BODY * b
    if s.code[first + GROUP] != s.code[second + GROUP]:
        return True, s.code[first + GROUP] < s.code[second + GROUP]
    if s.hashes[0, a] != s.hashes[0, b]:
        return True, s.hashes[0, a] > s.hashes[0, b]
    return s.hashes[1, a] != s.hashes[1, b], s.hashes[1, a] < s.hashes[1, b]


def by_numbers(s, t, a, b):
    """Whether body a comes before b, which is alike in all relations: who is nearer to t, then by places and sizes."""
    first, second = s.code[AT_BODIES] + BODY * a, s.code[AT_BODIES] + BODY * b
    near_a = np.round(measure(s, min(a, t), max(a, t)) / SAME_DISTANCE)
    near_b = np.round(measure(s, min(b, t), max(b, t)) / SAME_DISTANCE)
    if near_a != near_b:
        return near_a < near_b
    for k in range(9):
        x, y = s.x[s.code[first + POSE + k]], s.x[s.code[second + POSE + k]]
        if x != y:
            return x < y
    return False


def assign(s, casting, t):
    """Bodies of the embodied roles, in `s.cast[0]`; whether they are found (`RoleClassifier.assign`)."""
    bodies, roles, one = s.code[BODIES], s.code[casting + 1], np.int64(1)
    everyone = (one << bodies) - one
    descriptions = s.code[casting]
    # options of description d: rows of `s.options`, from d * (roles + 1) on
    counts, need, chosen, best = s.cast[1], s.cast[2], s.cast[3], s.cast[0]
    for d in range(descriptions):
        record = s.code[casting + 3 + d]
        need[d] = s.code[record + 4]
        counts[d] = 0
        base = d * (roles + 1)
        for at in range(bodies):
            each = s.lineup[0, at]
            if each == t or s.code[record] & (one << each) == 0:
                continue
            score = s.numbers[s.code[record + 1] + s.code[record + 3]]
            for k in range(s.code[record + 3]):
                s.value[0], s.value[1] = t, each
                if solve(s, s.code[record + 5 + k], everyone, False):
                    score = s.numbers[s.code[record + 1] + k]
                    break
            if score != score:
                continue
            typical = 1.0 if typically(s, s.code[record + 2], each, t) else 0.0
            j = counts[d]
            while j > 0 and better(s.options, base + j - 1, score, typical):
                if j <= roles:
                    for c in range(4):
                        s.options[base + j, c] = s.options[base + j - 1, c]
                j -= 1
            if j <= roles:
                row = s.options[base + j]
                row[0], row[1], row[2], row[3] = score, typical, float(at), float(each)
                counts[d] = min(counts[d] + 1, roles + 1)
    return search(s, casting, descriptions, roles, chosen, counts, need, best)


def better(options, row, score, typical):
    """Whether a candidate comes before an option; of equals the one that was there."""
    if options[row, 0] != score:
        return score > options[row, 0]
    return typical > options[row, 1]


def typically(s, common, each, t):
    """Whether a body has all that players so far had in common."""
    one = np.int64(1)
    if common == 0 or s.code[common] & (one << each) == 0:
        return False
    towards, back = s.code[common + 1], s.code[common + 2]
    for k in range(towards):
        if s.rows[s.code[common + 3 + k], each] & (one << t) == 0:
            return False
    for k in range(back):
        if s.columns[s.code[common + 3 + towards + k], each] & (one << t) == 0:
            return False
    return True


def search(s, casting, descriptions, roles, chosen, counts, need, best):
    """All ways to fill all roles, of which the best is kept; whether there is one, and no doubt about it."""
    depth, found, single = 0, False, True
    best_score, best_typical = 0.0, -1.0
    of = s.cast[4]  # description of each depth
    depth = 0
    for d in range(descriptions):
        for _ in range(need[d]):
            of[depth] = d
            depth += 1
    deep = depth
    depth = 0
    chosen[0] = -1
    while depth >= 0:
        chosen[depth] += 1
        d = of[depth]
        if chosen[depth] >= counts[d]:
            depth -= 1
            continue
        each = s.options[d * (roles + 1) + chosen[depth], 3]
        taken = False
        for k in range(depth):
            if s.options[of[k] * (roles + 1) + chosen[k], 3] == each:
                taken = True
        if taken:
            continue
        if depth + 1 < deep:
            depth += 1
            chosen[depth] = chosen[depth - 1] if of[depth] == of[depth - 1] else -1
            continue
        score, typical = 0.0, 0.0
        for k in range(deep):
            row = of[k] * (roles + 1) + chosen[k]
            score, typical = score + s.options[row, 0], typical + s.options[row, 1]
        score = np.round(score * 1e9)
        if found and score == best_score and typical == best_typical:
            single = False
        if not found or score > best_score or (score == best_score and typical > best_typical):
            found, single, best_score, best_typical = True, True, score, typical
            keep(s, casting, roles, chosen, deep, of, best)
    if not found:
        return False
    return (single and best_typical == roles) or s.code[casting + 2] != 0


def keep(s, casting, roles, chosen, deep, of, best):
    """Give the chosen bodies their roles: of alike roles the first goes to who comes first in order."""
    for k in range(deep):
        row = of[k] * (roles + 1) + chosen[k]
        ahead = 0
        for j in range(deep):
            other = of[j] * (roles + 1) + chosen[j]
            if of[j] == of[k] and s.options[other, 2] < s.options[row, 2]:
                ahead += 1
        record = s.code[casting + 3 + of[k]]
        best[s.code[record + 5 + s.code[record + 3] + ahead]] = np.int64(s.options[row, 3])


# ---------------------------------------------------------------------------------------------- answers
def product(s, feature):
    """A product of columns, their sines and cosines."""
    value = 1.0
    for k in range(s.code[feature + 1]):
        at = feature + 2 + 3 * k
        factor = s.x[s.code[at]]
        if s.code[at + 1] == 1:
            factor = math.sin(s.code[at + 2] * factor)
        elif s.code[at + 1] == 2:
            factor = math.cos(s.code[at + 2] * factor)
        value = factor if k == 0 else value * factor
    return value


def clip(s, answer_numbers, present, value):
    """A value, as far as changes may go."""
    if present < 0 or value != value:
        return value
    low, high = s.x[present] + s.numbers[answer_numbers], s.x[present] + s.numbers[answer_numbers + 1]
    return min(max(value, low), high)


def remembered(s, a):
    """The place in the memory of what relations alone decide of an answer; -1: there is no room for it.

    A record holds flags (1: the situation was seen, 2: it wasn't, 4: ranked), the margin, the ranking, and for
    every mode whether its roles were filled (1, 2: they can't be) and by whom. States are told apart by 64 bits, as
    situations are (`relgym.classification.familiarity`).
    """
    if s.code[s.code[a + 10]] > REMEMBERED_MODES:
        return np.int64(-1)
    key = s.state[0] ^ mixed(np.uint64(a + 1))
    for k in range(3):
        key = mixed(key ^ np.uint64(s.masks[k]))
    slot = np.int64(key & np.uint64(REMEMBERED - 1))
    if s.memory_keys[slot] != key:
        s.memory_keys[slot] = key
        for k in range(s.memory.shape[1]):
            s.memory[slot, k] = 0
    return slot


def ranked(s, a, slot):
    """Rank the modes, or remember how they are ranked; the margin."""
    vote, count = s.code[a + 11], s.code[s.code[a + 10]]
    if slot < 0 or s.code[a + 23] == 0:
        return rank(s, vote, count, max(s.code[a + 2], 0))
    record = s.memory[slot]
    if record[0] & 4 == 0:
        record[1] = rank(s, vote, count, max(s.code[a + 2], 0))
        record[0] |= 4
        for k in range(count):
            record[2 + k] = s.order[0, k]
    for k in range(count):
        s.order[0, k] = record[2 + k]
    return record[1]


def familiar(s, a, slot):
    """Whether the situation was seen in training, or what is remembered of that."""
    experience, target = s.code[s.code[a + 11] + 2], max(s.code[a + 2], 0)
    if slot < 0:
        return seen_before(s, experience, target)
    record = s.memory[slot]
    if record[0] & 3 == 0:
        record[0] |= 1 if seen_before(s, experience, target) else 2
    return record[0] & 1 == 1


def players_of(s, a, mode, number, slot, alike):
    """Fill the roles of a mode: bodies in `s.cast[0]`; whether they can be, and whether numbers decide an order.

    What relations alone decide is remembered. `alike`: whether numbers decide; -1: nobody was lined up yet.
    """
    casting = s.code[mode + 3]
    if casting == 0:
        return False, alike
    roles = s.code[casting + 1]
    record = s.memory[max(slot, 0)]
    at = 2 + REMEMBERED_MODES + number * (1 + REMEMBERED_ROLES)
    if slot >= 0 and record[at]:
        for k in range(roles):
            s.cast[0, k] = record[at + 1 + k]
        return record[at] == 1, alike
    unfold(s)
    if alike < 0:
        _, numeric = line_up(s, s.code[a + 2])
        alike = 1 if numeric else 0
    done = assign(s, casting, s.code[a + 2])
    if slot >= 0 and alike == 0 and roles <= REMEMBERED_ROLES:
        record[at] = 1 if done else 2
        for k in range(roles):
            record[at + 1 + k] = s.cast[0, k]
    return done, alike


def by_modes(s, a, answer):
    """Value, outcome, mode and margin of an answer by modes (`relgym.model.answers`)."""
    x, target = s.x, s.code[a + 2]
    if s.code[a + 7] == 1:
        return math.nan, UNEXPLAINED, np.int64(0), 0.0
    if s.code[a + 7] == 2:
        return math.nan, NO_MODE, np.int64(0), 0.0
    if beyond(s, a):
        return math.nan, UNEXPLAINED, np.int64(0), 0.0
    modes, count, vote = s.code[a + 10] + 1, s.code[s.code[a + 10]], s.code[a + 11]
    for k in range(count):
        mode = s.code[modes + k]
        fixed = s.code[mode + 2] != 0 and s.code[mode + 4] == 0
        x[s.code[mode + 1]] = total(s, s.code[mode + 2]) if fixed else math.nan
    follows = s.code[a + 6]
    for k in range(s.code[follows]):
        at = follows + 1 + 5 * k
        if s.code[at + 4]:
            x[s.code[at]] = x[s.code[at + 1]] * x[s.code[at + 2]]
        else:
            x[s.code[at]] = x[s.code[at + 1]] + s.numbers[s.code[at + 3]] * x[s.code[at + 2]]
    clipped = s.code[a + 15] if s.code[a + 14] else np.int64(-1)
    margin = math.inf
    s.order[0, 0] = 0
    casts, slot = s.code[a + 22] != 0, np.int64(-1)
    if vote or casts:
        if target >= 0:
            if s.code[a + 24]:
                surroundings(s, target)
            else:  # nobody asks what is near
                s.masks[0] = s.masks[1] = 0
                s.masks[2], s.masks[3] = (np.int64(1) << s.code[BODIES]) - 1, -1
            relate(s, s.masks[2] if s.code[EVERYTHING] else s.masks[0] | s.masks[1])
        else:
            # What has no body stands alone: object 0 of one, in no relation to anything.
            s.masks[0] = s.masks[1] = s.masks[2] = 1
            s.masks[3], s.masks[4], s.masks[6] = -1, 0, 1
            for f in range(s.told.shape[1]):
                s.told[0, f] = math.nan
            for r in range(s.rows.shape[0]):
                s.rows[r, 0] = s.columns[r, 0] = 0
            s.state[0] = ZERO64
        slot = remembered(s, a)
    if vote:
        margin = ranked(s, a, slot) / VOTE_UNIT
        if s.code[vote + 2] and not familiar(s, a, slot):
            mode = s.code[modes + s.order[0, 0]]
            value = x[s.code[mode + 1]]
            return clip(s, s.code[a + 18], clipped, value), OUTSIDE, s.code[mode], 0.0
    alike = -1
    for rank_ in range(count):
        mode = s.code[modes + s.order[0, rank_]]
        if s.code[mode + 2] == 0:
            continue
        value = x[s.code[mode + 1]]
        if s.code[mode + 4]:
            done, alike = players_of(s, a, mode, s.order[0, rank_], slot, alike)
            if not done:
                if not s.code[a + 9]:
                    continue
                return math.nan, OUTSIDE, np.int64(0), 0.0
            value = total(s, s.code[mode + 2])
            for r in range(s.code[mode + 4]):
                role = s.code[mode + 5 + r]
                body = s.cast[0, s.code[role]]
                s.players[answer, s.code[role + 3]] = body
                for k in range(s.code[role + 1]):
                    value += s.numbers[s.code[role + 2] + k] * x[s.code[role + 4 + k * s.code[BODIES] + body]]
        value = clip(s, s.code[a + 18], clipped, value)
        number, at = s.code[mode], s.code[a + 18]
        if value < s.numbers[at + 2]:
            value, number = s.numbers[at + 2], s.code[a + 19]
        elif value > s.numbers[at + 3]:
            value, number = s.numbers[at + 3], s.code[a + 20]
        for k in range(s.code[s.code[a + 21]]):
            stop = s.code[s.code[a + 21] + 1 + k]
            n = s.code[stop + 3]
            if s.code[stop] == 0:
                reached = x[s.code[stop + 2]] + s.numbers[n + 1] * value - s.numbers[n + 2]
                held = s.numbers[n + 3] * reached >= 0.0
            else:
                held = abs(x[s.code[stop + 2]] - s.numbers[n + 1]) <= s.numbers[n + 2] and math.isfinite(
                    value
                )
            if held:
                value, number = s.numbers[n], s.code[stop + 1]
        return value, PREDICTED if s.code[a + 8] else UNEXPLAINED, number, margin if rank_ == 0 else 0.0
    return math.nan, NO_ROLES, np.int64(0), 0.0


def beyond(s, a):
    """Whether a scene lies out of the scope of an answer's modes."""
    return s.code[a + 12] != 0 and s.code[s.code[a + 13] + leaf(s, s.code[a + 12])] == 0


def guessed(s, a):
    """The fallback value of an answer; NaN if there is none."""
    value = math.nan
    if s.code[a + 16]:
        value = total(s, s.code[a + 16])
    if s.code[a + 17]:
        if beyond(s, a):
            value = total(s, s.code[a + 17])
    return clip(s, s.code[a + 18], s.code[a + 15], value)


def lead_of(margin):
    """The bin of a lead (`relgym.model.predicting.calibration.key_of`)."""
    if not margin > 0.0:
        return 0
    if margin == math.inf:
        return 7
    found, most = 1, 0.5
    while found < 6 and margin >= most:
        found, most = found + 1, 2.0 * most
    return found


def far_bin(distance):
    """The bin of how far a scene lies from what regressions know (`relgym.model.predicting.calibration.far_bin`)."""
    if not distance >= 2.0:
        return 0
    found, most = 8, 4.0
    while found < 13 and distance >= most:
        found, most = found + 1, 2.0 * most
    return found


def find(s, at, count, wanted):
    """The place of a number among ascending ones; -1: it isn't there."""
    low, high = np.int64(0), count
    while low < high:
        middle = (low + high) // 2
        if s.code[at + middle] < wanted:
            low = middle + 1
        else:
            high = middle
    return low if low < count and s.code[at + low] == wanted else np.int64(-1)


def look_at(s, fit):
    """Work out what regressions look at, and how far that lies from all that they know, unless it is known."""
    if s.fitted[0] == fit:
        return
    s.fitted[0] = fit
    count, columns, centres = s.code[fit], s.code[fit + 1], s.code[fit + 2]
    shown, off = s.shown[0], s.shown[1]
    for k in range(count):
        shown[k] = (s.x[s.code[columns + k]] - s.numbers[centres + 2 * k]) / s.numbers[centres + 2 * k + 1]
    for kind in range(s.code[fit + 3]):
        at, width = s.code[fit + 4 + kind], count
        if kind:
            for i in range(count):
                for j in range(i, count):
                    shown[width] = shown[i] * shown[j]
                    width += 1
        for k in range(width):
            off[k] = shown[k] - s.numbers[at + k]
        entry, far = at + width, 0.0
        for i in range(width):
            along = 0.0
            for j in range(i, width):
                along += s.numbers[entry] * off[j]
                entry += 1
            far += off[i] * along
        s.leverage[kind] = far if far >= 0.0 else math.inf


def regress(s, record, k):
    """What regressions say of an answer (`relgym.model.predicting.regression.Regression.values`)."""
    fit = s.code[record]
    look_at(s, fit)
    width, kinds = s.code[fit], s.code[fit + 3]
    present, reach = s.x[s.code[record + 1]], s.code[record + 2]
    low, high, whole, linear = s.numbers[reach], s.numbers[reach + 1], 0.0, math.nan
    for kind in range(kinds):
        weights = s.code[record + 3 + kind]
        if kind:
            width += width * (width + 1) // 2
        word = s.numbers[weights]
        for j in range(width):
            word += s.numbers[weights + 1 + j] * s.shown[0, j]
        if word == word:
            word = min(max(word, low), high)
        if kind == 0:
            linear = word
        if math.isfinite(word):
            at = reach + 2 + (2 + SAYS) * kind
            far = (s.leverage[kind] + s.numbers[at + 1]) * s.numbers[at]
            share, rate = s.numbers[at + 2], LEAST_RATE
            for j in range(1, SAYS):
                share = share + s.numbers[at + 2 + j] / (1.0 + rate * far)
                rate = WIDER * rate
            whole = whole + share * (word - whole)
    midst = s.numbers[reach + 3]
    s.far[k] = far_bin((s.leverage[0] + midst) / min(1.0, s.code[fit] * midst))
    s.experts[k, REGRESSION] = present + whole if math.isfinite(linear) else math.nan


def consult(s, a, k, value):
    """What everybody says of an answer, in `s.experts`, the winner's value among it; who has a value, as bits."""
    said = s.experts[k]
    said[OWN] = value
    said[GUESS] = guessed(s, a) if s.code[a + 16] or s.code[a + 17] else math.nan
    said[REGRESSION] = math.nan
    s.far[k] = 0
    if s.code[a + 26]:
        regress(s, s.code[a + 26], k)
    said[LATEST] = math.nan  # no program knows what held last
    able = np.int64(0)
    for expert in range(PERSISTENCE):
        if math.isfinite(said[expert]):
            able |= np.int64(1) << expert
        else:
            said[expert] = math.nan
    return able


def settled(s, a, k, value, outcome, mode, margin, able):
    """Value, outcome and mode, once it is known how right such predictions were, as `querying.settled`."""
    trust = s.code[a + 25]
    winner = -mode if s.code[trust + 4] else mode
    kind = np.int64(PREDICTED if mode else outcome)
    lead = np.int64(0)
    if not mode:
        lead = able & VALUED  # the winner's bit
    elif s.code[trust + 5]:
        lead = s.far[k]
    if lead == 0:
        lead = np.int64(lead_of(margin))
    number = ((winner * 16 + lead + 2) * 8 + kind) * 16 + able
    if s.believed[k, 0] != number:
        place = find(s, s.code[trust + 1], s.code[trust], number)
        if place < 0:  # all of the winner
            place = find(s, s.code[trust + 1], s.code[trust], ((winner * 16 + 1) * 8 + kind) * 16 + able)
        if place < 0:  # all that modes, or laws, or neither say
            who = np.int64(winner > 0) - np.int64(winner < 0)
            place = find(s, s.code[trust + 1], s.code[trust], (who * 128 + kind) * 16 + able)
        s.believed[k, 0], s.believed[k, 1] = number, place
    place = s.believed[k, 1]
    said, sure = s.code[trust + 2] + 2 * place, s.code[trust + 3] + 2 * place
    speaker, claimed = s.code[said], s.code[said + 1]
    rests, read = 1.0, s.code[trust + 6]
    if speaker == OWN and winner > 0:  # its record is of steps in which what it relies on was right
        for j in range(s.code[read]):
            rests *= s.odds[s.code[read + 1 + j]]
    s.sure[k, 0], s.sure[k, 1] = s.numbers[sure] * rests, s.numbers[sure + 1]
    if not claimed:
        outcome = UNSURE if outcome == PREDICTED else outcome
    elif outcome == UNEXPLAINED and winner:
        outcome = PREDICTED
    return s.experts[k, speaker] if speaker < PERSISTENCE else math.nan, outcome, mode


def step(s, settling, telling):
    """One step of the scene whose present values stand in `s.x`; 0, or why not."""
    x, width = s.x, s.code[WIDTH]
    if s.code[BODIES]:
        bad = look(s)
        if bad:
            return bad
        s.masks[3], s.masks[4], s.masks[6] = -1, 0, 0
        if s.code[MOVERS] and move(s) < 0:
            return TOO_MANY
    s.fitted[0] = 0
    for k in range(s.code[KEYS]):
        s.lost[k], s.odds[k] = 0, 1.0
    for k in range(s.code[ANSWERS]):
        a = s.code[s.code[AT_ANSWERS] + k]
        column = s.code[a]
        features = s.code[a + 5]
        for f in range(s.code[features]):
            x[s.code[s.code[features + 1 + f]]] = product(s, s.code[features + 1 + f])
        if s.code[a + 3] >= 0:
            body = s.code[a + 2]
            if s.body_flags[1, body]:
                value, outcome, margin = s.velocity[2, s.code[a + 3], body], PREDICTED, math.inf
                mode = np.int64(TOUCHING if s.body_flags[2, body] else FREE)
            else:
                value, outcome, mode, margin = math.nan, OUTSIDE, np.int64(0), 0.0
            if telling:
                s.touched[k] = hits(s, body)
        else:
            value, outcome, mode, margin = by_modes(s, a, k)
            s.touched[k] = mode
        needs = s.code[a + 4]
        for j in range(s.code[needs]):
            if s.lost[s.code[needs + 1 + j]]:
                outcome, margin = DEPENDS, 0.0
        told = math.isfinite(value)
        if not told and outcome == PREDICTED:
            outcome = OUTSIDE
        if not (told and (outcome == PREDICTED or outcome == UNEXPLAINED)):
            mode = np.int64(0)
        able = consult(s, a, k, value) if telling or settling else np.int64(0)
        if settling and s.code[a + 25]:
            value, outcome, mode = settled(s, a, k, value, outcome, mode, margin, able)
        else:
            s.sure[k, 0] = s.sure[k, 1] = math.nan
        if not (told or (settling and s.code[a + 25])):
            value = guessed(s, a)
            s.touched[k] = 0
            if math.isfinite(value):
                s.touched[k] = -2 if beyond(s, a) else -1
            elif s.code[a + 26]:  # nobody knows who is right: least squares speak
                regress(s, s.code[a + 26], k)
                value = s.experts[k, REGRESSION]
        s.outcomes[k], s.modes[k], s.margins[k] = outcome, mode, margin
        lost = outcome != PREDICTED
        if s.given[k]:
            x[width + column], lost = s.given_values[k], s.given[k] == 2
        elif math.isfinite(value):
            x[width + column] = value
        if lost:
            s.lost[s.code[a + 1]] = 1
        if s.sure[k, 0] < s.odds[s.code[a + 1]]:
            s.odds[s.code[a + 1]] = s.sure[k, 0]
    for k in range(s.code[KINEMATICS]):
        at = s.code[AT_KINEMATICS] + 3 * k
        x[width + s.code[at]] = x[s.code[at]] + s.numbers[s.code[at + 2]] * x[s.code[at + 1]]
    for k in range(s.code[ANGLES]):
        column = width + s.code[s.code[AT_ANGLES] + k]
        x[column] -= TURN_AROUND * np.round(x[column] / TURN_AROUND)
    return 0


def hits(s, body):
    """Whom a mover touches, as bits."""
    found, one = np.int64(0), np.int64(1)
    for k in range(s.code[BODIES]):
        if k != body and s.known[1, min(k, body), max(k, body)] == s.masks[5] + 1:
            found |= one << k
    return found


def run(s, n, settling, telling, writing, vectors, following, outcomes, modes, margins, sure):
    """A step of n scenes.

    Parameters
    ----------
    s
        Work space with the tape in it; what is told of the last scene stands there afterwards.
    n
        How many scenes.
    settling
        Whether how right predictions were decides who gives the value, and what is claimed.
    telling
        Whether it is noted down whom movers touch.
    writing
        Whether there are arrays for all but the next state vectors; else what stands behind those isn't looked at.
    vectors
        State vectors, one after the other, of `width` each.
    following
        Where the next ones go.
    outcomes, modes, margins
        Where these go, one for each answer of each scene.
    sure
        How probably each value is right, then how far off each may be; looked at where it is settled.

    Returns
    -------
    0, or why some scene can't be.
    """
    width, nexts, answers = s.code[WIDTH], s.code[AT_NEXTS], s.code[ANSWERS]
    s.x[2 * width], s.x[2 * width + 1], s.x[2 * width + 2] = math.nan, 0.0, 1.0
    for i in range(n):
        now, wrong = i * width, 0
        for k in lanes(width):
            value = vectors[now + k]
            s.x[k] = following[now + k] = value
            wrong += not abs(value) < math.inf
        if wrong:
            return NOT_FINITE
        for k in range(s.code[NEXTS]):
            column = s.code[nexts + k]
            s.x[width + column] = s.x[column]
        bad = step(s, settling, telling)
        if bad:
            return bad
        for k in range(s.code[NEXTS]):
            column = s.code[nexts + k]
            following[now + column] = s.x[width + column]
        if writing:
            for k in range(answers):
                at = i * answers + k
                outcomes[at], modes[at], margins[at] = s.outcomes[k], s.modes[k], s.margins[k]
                if settling:
                    sure[at], sure[n * answers + at] = s.sure[k, 0], s.sure[k, 1]
    return 0


def roll(s, n, apart_by, steps, settling, first, count, actions, vectors, following, lasted):
    """So many steps of n scenes, each from what was predicted last, for as long as all of it is predicted.

    Parameters
    ----------
    s
        Work space with the tape in it.
    n
        How many scenes.
    apart_by
        How many scenes there are actions of in each step, which may be more.
    steps
        How many steps, at most.
    settling
        As for `run`.
    first, count
        Column of the first number of an action, and how many there are.
    actions
        Actions: step by step, scene by scene.
    vectors
        State vectors, one after the other.
    following
        Where those go that were predicted last.
    lasted
        Where it goes how many steps were predicted; why not, below 0, of scenes that can't be.
    """
    width, nexts, answers = s.code[WIDTH], s.code[AT_NEXTS], s.code[ANSWERS]
    s.x[2 * width], s.x[2 * width + 1], s.x[2 * width + 2] = math.nan, 0.0, 1.0
    for i in range(n):
        now, wrong, done = i * width, 0, np.int64(0)
        for k in lanes(width):
            s.x[k] = vectors[now + k]
            wrong += not abs(s.x[k]) < math.inf
        while wrong == 0 and done < steps:
            given = (done * apart_by + i) * count
            for k in range(count):
                s.x[first + k] = actions[given + k]
                wrong += not abs(s.x[first + k]) < math.inf
            for k in range(s.code[NEXTS]):
                column = s.code[nexts + k]
                s.x[width + column] = s.x[column]
            bad = step(s, settling, False) if wrong == 0 else np.int64(NOT_FINITE)
            if bad:
                done = -bad
                break
            sure = True
            for k in range(answers):
                sure = sure and s.outcomes[k] == PREDICTED
            if not sure:
                break
            for k in range(s.code[NEXTS]):
                column = s.code[nexts + k]
                s.x[column] = s.x[width + column]
                wrong += not abs(s.x[column]) < math.inf
            done += 1
        if wrong:
            done = np.int64(-NOT_FINITE)
        lasted[i] = done
        for k in lanes(width):
            following[now + k] = s.x[k]


def forget(s):
    """Know nothing of scenes that were asked before: a work space that holds zeros may be used then."""
    for k in range(s.believed.shape[0]):
        s.believed[k, 0] = NOBODY


def see(s, t, vector, table, close, struck, told, order):
    """What one body sees of a scene (`relgym.model.percepts.sight`).

    Parameters
    ----------
    s
        Work space with the tape in it, of a program that asks for all relations, and for everything.
    t
        Number of the body.
    vector
        The scene's state vector.
    table
        Where it goes which relation holds for which pair of bodies: 0 or 1 for each relation, first and second body.
    close, struck
        Where the contexts of the body go: 0 or 1 for each body.
    told
        Where the features of its pairs go, body by body.
    order
        Where the others go as they are lined up for it, behind 1 if more than their relations to it decides that.

    Returns
    -------
    0, or why the scene can't be.
    """
    width, bodies, one = s.code[WIDTH], s.code[BODIES], np.int64(1)
    for k in range(width):
        s.x[k] = vector[k]
        if not abs(vector[k]) < math.inf:
            return NOT_FINITE
    s.x[2 * width], s.x[2 * width + 1], s.x[2 * width + 2] = math.nan, 0.0, 1.0
    bad = look(s)
    if bad:
        return bad
    s.masks[3], s.masks[4], s.masks[6] = -1, 0, 0
    surroundings(s, t)
    relate(s, s.masks[2])
    unfold(s)
    at = 0
    for r in range(s.code[RELATIONS]):
        for a in range(bodies):
            for b in range(bodies):
                table[at] = s.rows[r, a] >> b & one
                at += 1
    width = s.code[FACTS] + s.code[OTHERS]
    for k in range(bodies):
        close[k], struck[k] = s.masks[1] >> k & one, s.masks[0] >> k & one
        for f in range(width):
            told[k * width + f] = s.told[k, f]
    tied, _ = line_up(s, t)
    order[0] = 1 if tied else 0
    for k in range(1, bodies):
        order[k] = s.lineup[0, k]
    return 0
