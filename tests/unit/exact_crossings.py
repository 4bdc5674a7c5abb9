"""Crossings of one ray in integers of hundreds of bits, by another algorithm than the oracle's.

Numbers are integers that count 2^-BITS. The inputs are binary fractions and enter exactly. The density over an interval is a
polynomial in powers of s, the distance in units of the direction's length. It loses digits that a double does not have, and
rounding at 2^-BITS stays below 1e-100 in what is decided from it. Signs are proven: a piece of an interval is halved until
its Taylor polynomial about the middle shows that it keeps its sign, or that it rises or falls throughout.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import isqrt

BITS = 512
ONE = 1 << BITS
# The inputs are multiples of 2^-INPUT_BITS.
INPUT_BITS = 160
# Densities within 2^-400 of the isovalue have no sign, and pieces of 2^-300 are not halved: there the ray touches the surface.
TOUCHES = 1 << (BITS - 400)
SHORTEST = 1 << (BITS - 300)


@dataclass(frozen=True)
class ExactBall:
    """A ball along a ray: ``x(s) = x[0] + x[1] s + x[2] s^2``, positive between entry and exit; and ``q f(x(s))``."""

    index: int
    entry: int
    exit: int
    x: list[int]
    density: list[int]


class ExactRay:
    """The density along a ray.

    Parameters
    ----------
    balls
        ``(position, radius, weight)`` each, floats.
    kernel
        Coefficients of the density kernel, exact.
    """

    def __init__(self, balls, kernel: list[Fraction], origin, direction):
        self.kernel = kernel
        self.direction = [as_input(number) for number in direction]
        self.origin = [as_input(number) for number in origin]
        self.length_2 = sum(number**2 for number in self.direction)
        candidates = (self._ball(index, *ball) for index, ball in enumerate(balls))
        self.balls = [ball for ball in candidates if ball]

    def _ball(self, index, position, radius, weight):
        to_center = [as_input(c) - o for c, o in zip(position, self.origin, strict=True)]
        radius_2 = as_input(radius) ** 2
        along = sum(e * d for e, d in zip(to_center, self.direction, strict=True))
        within_2 = radius_2 - sum(e * e for e in to_center)
        discriminant = along**2 + self.length_2 * within_2
        if discriminant <= 0:
            return None
        half_chord = isqrt(discriminant << (2 * BITS)) // self.length_2
        middle = (along << BITS) // self.length_2
        x = [(number << BITS) // radius_2 for number in (within_2, 2 * along, -self.length_2)]
        density = times(fixed(Fraction(weight)), composed(self.kernel, x))
        entry, leave = max(middle - half_chord, 0), middle + half_chord
        return ExactBall(index, entry, leave, x, density) if leave > entry else None

    def t(self, s: int) -> int:
        """Distance along the unit ray."""
        return s * isqrt(self.length_2 << (2 * BITS)) >> (BITS + INPUT_BITS)

    def s(self, t: float) -> int:
        """The parameter at a distance along the unit ray."""
        return (fixed(Fraction(t)) << (BITS + INPUT_BITS)) // isqrt(self.length_2 << (2 * BITS))

    def point(self, s: int) -> list[int]:
        """The place at s, world space."""
        return [(o << (BITS - INPUT_BITS)) + (s * d >> INPUT_BITS) for o, d in zip(self.origin, self.direction, strict=True)]

    def reaching(self, s: int) -> list[ExactBall]:
        """The balls in whose influence spheres s is."""
        return [ball for ball in self.balls if ball.entry <= s <= ball.exit]

    def density(self, s: int) -> int:
        """The field at s."""
        return sum(value(ball.density, s) for ball in self.reaching(s))

    def crossings(self, isovalue: Fraction) -> list[tuple[int, bool]]:
        """s and whether the ray goes into the fluid, of all crossings in order."""
        found = []
        side = 0
        for begin, end, polynomial in self._intervals(isovalue):
            for low, high, low_sign, high_sign in pieces(polynomial, begin, end):
                for s, sign in ((low, low_sign), (None, high_sign)):
                    if sign * side < 0:
                        found.append((change(polynomial, low, high) if s is None else s, sign > 0))
                    side = sign or side
        return found

    def _intervals(self, isovalue):
        """The intervals on which the same balls count, and the density less the isovalue on each."""
        events = sorted([(ball.entry, 1, ball.density) for ball in self.balls] + [(b.exit, -1, b.density) for b in self.balls])
        polynomial = [-fixed(isovalue)] + [0] * (2 * len(self.kernel) - 2)
        last = 0
        for s, side, density in events:
            if s > last:
                yield last, s, polynomial
            # Sums of integers do not drift.
            polynomial = [*polynomial]
            for power, coefficient in enumerate(density):
                polynomial[power] += side * coefficient
            last = s


def as_input(number: float) -> int:
    """A float as a multiple of 2^-INPUT_BITS, which it must be."""
    numerator, denominator = float(number).as_integer_ratio()
    scaled, rest = divmod(numerator << INPUT_BITS, denominator)
    assert rest == 0, f"{number} has digits below 2^-{INPUT_BITS}"
    return scaled


def fixed(number: Fraction) -> int:
    """The nearest number below."""
    return (number.numerator << BITS) // number.denominator


def times(factor: int, p: list[int]) -> list[int]:
    """The polynomial times a number."""
    return [factor * coefficient >> BITS for coefficient in p]


def composed(kernel: list[Fraction], x: list[int]) -> list[int]:
    """``f(x(s))`` by Horner's scheme."""
    result = [fixed(kernel[-1])]
    for coefficient in reversed(kernel[:-1]):
        product = [0] * (len(result) + 2)
        for i, p in enumerate(result):
            for j, q in enumerate(x):
                product[i + j] += p * q >> BITS
        result = product
        result[0] += fixed(coefficient)
    return result


def value(p: list[int], s: int) -> int:
    """``p(s)``."""
    result = 0
    for coefficient in reversed(p):
        result = (result * s >> BITS) + coefficient
    return result


def taylor(p: list[int], s: int) -> list[int]:
    """Coefficients of the polynomial in powers of the distance from s."""
    c = [*p]
    for first in range(len(c) - 1):
        for power in range(len(c) - 2, first - 1, -1):
            c[power] += c[power + 1] * s >> BITS
    return c


def pieces(p: list[int], low: int, high: int):
    """Pieces of [low, high] on which p keeps its sign or is monotone, in order, with the signs at their ends."""
    half = (high - low) // 2
    c = taylor(p, low + half)
    reach, slope_reach = [0], [0]
    stretch = ONE
    for power in range(1, len(c)):
        slope_reach.append(power * abs(c[power]) * stretch >> BITS)
        stretch = stretch * (half + 1) >> BITS
        reach.append(abs(c[power]) * stretch >> BITS)
    if abs(c[0]) > sum(reach) + len(c):
        yield low, high, sign(c[0]), sign(c[0])
    elif abs(c[1]) > sum(slope_reach[2:]) + len(c):
        yield low, high, sign(value(p, low)), sign(value(p, high))
    elif high - low > SHORTEST:
        yield from pieces(p, low, low + half)
        yield from pieces(p, low + half, high)


def sign(number: int) -> int:
    """1, -1, or 0 where it is too near to 0 to have one."""
    return 0 if abs(number) <= TOUCHES else 1 if number > 0 else -1


def change(p: list[int], low: int, high: int) -> int:
    """Where a monotone piece changes its sign: Newton's method, halving where it leaves the bracket."""
    derivative = [power * coefficient for power, coefficient in enumerate(p)][1:]
    rises = value(p, high) > 0
    s = (low + high) // 2
    while True:
        height, slope = value(p, s), value(derivative, s)
        low, high = (low, s) if (height > 0) == rises else (s, high)
        following = s - (height << BITS) // slope if slope else low
        if not low < following < high:
            following = (low + high) // 2
        if abs(following - s) <= SHORTEST:
            return following
        s = following
