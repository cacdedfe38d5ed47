"""Sine and cosine of lanes, in the small language: a module whose functions need them begins with their source."""

from __future__ import annotations

import math

# pi as a sum (Cody and Waite): the first two parts have at most 32 bits, so that their products with m < 2**20 (multiples of 1/2) are exact
# in 53 bits; beyond 3e6 rad, where m approaches that, the C library's functions are called lane by lane
PI = 3.1415926534682512, 1.2154201012607932e-10, 4.044532497591901e-21
FURTHEST = 3e6
MAGIC = 6755399441055744.0  # 1.5 * 2**52: added and subtracted again it rounds to a whole number


def source(name: str, shift: float, sign: float) -> str:
    """With ``x = (k + shift) pi + r`` the value is the sine of r, with a sign that changes from k to k + 1.

    The sine is a Taylor polynomial, whose next term would be 1e-18 at pi / 2; its terms are added in pairs (Estrin's scheme), so that few
    operations wait for each other.
    """
    terms = [repr((-1) ** k / math.factorial(2 * k + 1)) for k in range(1, 11)]
    pairs = [f"({a} + q * {b})" for a, b in zip(terms[::2], terms[1::2], strict=True)]
    return f"""def {name}_of_lanes(x: lane) -> lane:
    if any_of(not abs(x) <= {FURTHEST}):
        return {name}(x)
    k = (x * {1 / math.pi!r} - {shift} + {MAGIC}) - {MAGIC}
    m = k + {shift}
    r = ((x - m * {PI[0]!r}) - m * {PI[1]!r}) - m * {PI[2]!r}
    q = r * r
    q2 = q * q
    q4 = q2 * q2
    p = {pairs[0]} + q2 * {pairs[1]} + q4 * ({pairs[2]} + q2 * {pairs[3]} + q4 * {pairs[4]})
    odd = abs(0.5 * k - ((0.5 * k + {MAGIC}) - {MAGIC}))
    return ({sign} - {4.0 * sign} * odd) * (r + r * q * p)


"""


FUNCTIONS = {"sin": source("sin", 0.0, 1.0), "cos": source("cos", 0.5, -1.0)}
