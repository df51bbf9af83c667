"""Write elementary functions of vectors of doubles as LLVM code without branches: a lane is one number of the vector.

Every function is written with fused multiplications and additions. A lane is computed from its own argument alone, so its bits
depend neither on the other lanes nor on their number. Argument reductions and polynomials are the usual ones (Cody and Waite;
Tang; coefficients of Sun's fdlibm, or of Taylor series where these suffice). ``pow``, and sine and cosine of angles beyond
`GREATEST_ANGLE`, cannot be written without branches: they call the C library for each lane.

`BOUNDS` has the largest errors in units in the last place, which the tests check against mpmath. The bounds hold for arguments
between 1e-150 and 1e150. The sign of a result that is zero is not kept.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import inf, log, nan, pi
from typing import Any

from llvmlite import binding, ir

DOUBLE = ir.DoubleType()
_LONG = ir.IntType(64)

#: Greatest error of each function, in units in the last place of its value.
BOUNDS = {
    "sin": 1.0, "cos": 1.0, "tan": 2.5, "asin": 2.5, "acos": 2.5, "atan": 1.5, "atan2": 1.5, "sinh": 2.5, "cosh": 2.5,
    "tanh": 3.0, "exp": 1.0, "log": 1.0, "sqrt": 0.5, "fabs": 0.0, "hypot": 2.0,
}  # fmt: skip
#: Angle (rad) beyond which the C library computes the sine: 1.7e8 turns; up to it the argument reduction is exact.
GREATEST_ANGLE = 2.0**30

# adding this number rounds a double to an integer, in the last bits of the sum; subtracting it gives the integer as a double
_ROUNDER = 1.5 * 2.0**52
_ROUNDER_BITS = 0x4338000000000000
# pi / 2 as a sum of three doubles; log 2 as a sum of two, the first of which ends with 21 zero bits
_HALF_PI = 1.5707963267948966, 6.123233995736766e-17, -1.4973849048591833e-33
_LOG_2 = 6.93147180369123816490e-01, 1.90821492927058770002e-10
_SINE = (
    -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04, 2.75573137070700676789e-06,
    -2.50507602534068634195e-08, 1.58969099521155010221e-10,
)  # fmt: skip
_COSINE = (
    4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05, -2.75573143513906633035e-07,
    2.08757232129817482790e-09, -1.13596475577881948265e-11,
)  # fmt: skip
_LOGARITHM = (
    6.666666666666735130e-01, 3.999999999940941908e-01, 2.857142874366239149e-01, 2.222219843214978396e-01,
    1.818357216161805012e-01, 1.531383769920937332e-01, 1.479819860511658591e-01,
)  # fmt: skip
_ARCTANGENT = (
    3.33333333333329318027e-01, -1.99999999998764832476e-01, 1.42857142725034663711e-01, -1.11111104054623557880e-01,
    9.09088713343650656196e-02, -7.69187620504482999495e-02, 6.66107313738753120669e-02, -5.83357013379057348645e-02,
    4.97687799461593236017e-02, -3.65315727442169155270e-02, 1.62858201153657823623e-02,
)  # fmt: skip
# arctangents of 0.5, 1, 1.5 and infinity, each as a sum of two doubles
_ARCTANGENTS = (
    (4.63647609000806093515e-01, 2.26987774529616870924e-17), (7.85398163397448278999e-01, 3.06161699786838301793e-17),
    (9.82793723247329054082e-01, 1.39033110312309984516e-17), (1.57079632679489655800e00, 6.12323399573676603587e-17),
)  # fmt: skip


@cache
def width() -> int:
    """Return the number of doubles in a vector of the processor; 1 if it has no fused multiply-add for vectors."""
    features = binding.get_host_cpu_features()
    if features.get("avx512f"):
        return 8
    if features.get("fma") and features.get("avx2"):
        return 4
    return 2 if binding.get_default_triple().startswith(("aarch64", "arm64")) else 1


def vector(lanes: int, of: Any = DOUBLE) -> Any:
    """Return the LLVM type of a vector of ``lanes`` numbers of the type ``of``; for one lane, the type ``of`` itself."""
    return ir.VectorType(of, lanes) if lanes > 1 else of


def constant(kind: Any, number: float) -> Any:
    """Return a constant of an LLVM type: a number, or a vector with the same number in each lane."""
    return ir.Constant(kind, [number] * kind.count if isinstance(kind, ir.VectorType) else number)


def repeat_number(build: Any, number: Any, lanes: int) -> Any:
    """Return a vector with the same number in each lane; for one lane, the number itself."""
    if lanes == 1:
        return number
    single = build.insert_element(ir.Constant(vector(lanes), ir.Undefined), number, ir.Constant(ir.IntType(32), 0))
    return build.shuffle_vector(single, single, ir.Constant(vector(lanes, ir.IntType(32)), [0] * lanes))


class Vector:
    """An LLVM vector, or number, whose Python operators write LLVM instructions; the other operand may be a Python number."""

    def __init__(self, build: Any, value: Any) -> None:
        self.build = build
        self.value = value

    @property
    def lanes(self) -> int:
        count: int = getattr(self.value.type, "count", 1)
        return count

    def as_vector(self, other: Any) -> Any:
        """Return an operand as an LLVM vector: a number is repeated in all lanes."""
        return other.value if isinstance(other, Vector) else constant(self.value.type, float(other))

    def _make(self, value: Any) -> Vector:
        return Vector(self.build, value)

    def __add__(self, other: Any) -> Vector:
        return self._make(self.build.fadd(self.value, self.as_vector(other)))

    def __sub__(self, other: Any) -> Vector:
        return self._make(self.build.fsub(self.value, self.as_vector(other)))

    def __mul__(self, other: Any) -> Vector:
        return self._make(self.build.fmul(self.value, self.as_vector(other)))

    def __truediv__(self, other: Any) -> Vector:
        return self._make(self.build.fdiv(self.value, self.as_vector(other)))

    def __neg__(self) -> Vector:
        return self._make(self.build.fneg(self.value))

    def __radd__(self, other: float) -> Vector:
        return self + other

    def __rmul__(self, other: float) -> Vector:
        return self * other

    def __rsub__(self, other: float) -> Vector:
        return self._make(self.as_vector(other)) - self

    def __rtruediv__(self, other: float) -> Vector:
        return self._make(self.as_vector(other)) / self

    def __lt__(self, other: Any) -> Any:
        return self.build.fcmp_ordered("<", self.value, self.as_vector(other))

    def equals(self, other: Any) -> Any:
        """Return a mask of the lanes in which two vectors are equal."""
        return self.build.fcmp_ordered("==", self.value, self.as_vector(other))

    def where(self, condition: Any, other: Any) -> Vector:
        """Return this vector in the lanes where a condition holds, the other vector elsewhere."""
        return self._make(self.build.select(condition, self.value, self.as_vector(other)))

    def intrinsic(self, name: str, *others: Any) -> Vector:
        """Call one of LLVM's intrinsic functions with this vector and others as arguments."""
        kind = self.value.type
        full = f"llvm.{name}.{f'v{self.lanes}' * (self.lanes > 1)}f64"
        function = declare_function(self.build.module, full, kind, 1 + len(others))
        return self._make(self.build.call(function, [self.value, *map(self.as_vector, others)]))

    def multiply_add(self, factor: Any, summand: Any) -> Vector:
        """Return this vector times a factor plus a summand, rounded once."""
        return self.intrinsic("fma", factor, summand)

    def square_root(self) -> Vector:
        return self.intrinsic("sqrt")

    def absolute(self) -> Vector:
        return self.intrinsic("fabs")

    def with_signs(self, other: Vector) -> Vector:
        """Return the absolute values of this vector with the signs of another."""
        return self.intrinsic("copysign", other)

    def bits(self) -> Any:
        return self.build.bitcast(self.value, vector(self.lanes, _LONG))

    def from_bits(self, bits: Any) -> Vector:
        return self._make(self.build.bitcast(bits, self.value.type))

    def longs(self, number: int) -> Any:
        """Return a vector with the same integer in each lane."""
        return constant(vector(self.lanes, _LONG), number)

    def polynomial(self, coefficients: tuple[float, ...]) -> Vector:
        """Evaluate a polynomial in this vector; the constant is the first coefficient."""
        result = self._make(self.as_vector(coefficients[-1]))
        for c in coefficients[-2::-1]:
            result = result.multiply_add(self, c)
        return result


def declare_function(module: Any, name: str, kind: Any, arguments: int) -> Any:
    """Return an external function of ``arguments`` arguments of one type; declare it in the module if necessary."""
    if (found := module.globals.get(name)) is None:
        found = ir.Function(module, ir.FunctionType(kind, [kind] * arguments), name)
        found.attributes.add("nounwind")
    return found


def lane_by_lane(name: str, *arguments: Vector) -> Vector:
    """Call a function of the C library for each lane; return the vector of its values."""
    build = arguments[0].build
    function = declare_function(build.module, name, DOUBLE, len(arguments))
    if arguments[0].lanes == 1:
        return Vector(build, build.call(function, [a.value for a in arguments]))
    result = ir.Constant(arguments[0].value.type, ir.Undefined)
    for place in range(arguments[0].lanes):
        lane = ir.Constant(ir.IntType(32), place)
        value = build.call(function, [build.extract_element(a.value, lane) for a in arguments])
        result = build.insert_element(result, value, lane)
    return Vector(build, result)


def _with_fallback(great: Any, result: Vector, name: str, x: Vector) -> Vector:
    """Return a result in which the lanes marked by ``great`` are replaced by the C library's function of x."""
    build = x.build
    before = build.block
    any_of_them = build.icmp_unsigned("!=", build.bitcast(great, ir.IntType(x.lanes)), ir.IntType(x.lanes)(0))
    with build.if_then(any_of_them, likely=False):
        slow = lane_by_lane(name, x).where(great, result)
        after = build.block
    chosen = build.phi(x.value.type)
    chosen.add_incoming(result.value, before)
    chosen.add_incoming(slow.value, after)
    return Vector(build, chosen)


# Sine and cosine


def _split_quarter_turns(x: Vector, quarters: int) -> tuple[Any, Vector, Vector]:
    """Split x into n quarter turns and a remainder; return n + ``quarters``, and sine and cosine of the remainder."""
    shifted = x.multiply_add(2.0 / pi, _ROUNDER)
    k = shifted - _ROUNDER
    # exact, as the difference has no more bits than x
    first = k.multiply_add(-_HALF_PI[0], x)
    second = k * _HALF_PI[1]
    r = first - second
    back = r - first
    # rounding errors of the product and the difference (Knuth)
    lost = (first - (r - back)) - (second + back)
    rest = k.multiply_add(-_HALF_PI[2], lost - k.multiply_add(_HALF_PI[1], -second))
    z = r * r
    sine = r + (r * z).multiply_add(z.polynomial(_SINE), (rest * z).multiply_add(-0.5, rest))
    half = 0.5 * z
    w = 1.0 - half
    cosine = w + (((1.0 - w) - half) + (z * z).multiply_add(z.polynomial(_COSINE), -(r * rest)))
    return x.build.add(shifted.bits(), x.longs(quarters)), sine, cosine


def _circular(x: Vector, quarters: int, name: str) -> Vector:
    """Return sin(x + quarters pi/2); for large x the C function ``name`` is called instead."""
    build = x.build
    number, sine, cosine = _split_quarter_turns(x, quarters)
    odd = build.icmp_unsigned("!=", build.and_(number, x.longs(1)), x.longs(0))
    chosen = cosine.where(odd, sine)
    sign = build.shl(build.and_(number, x.longs(2)), x.longs(62))
    result = x.from_bits(build.xor(chosen.bits(), sign))
    return _with_fallback(Vector.__lt__(-x.absolute(), -GREATEST_ANGLE), result, name, x)


def _sin(x: Vector) -> Vector:
    return _circular(x, 0, "sin")


def _cos(x: Vector) -> Vector:
    return _circular(x, 1, "cos")


# Exponentials


def _power_of_two(x: Vector, number: Any) -> Vector:
    """Return 2 to the power of an integer between -1022 and 1023."""
    return x.from_bits(x.build.shl(x.build.add(number, x.longs(1023)), x.longs(52)))


def _reduce_exponent(x: Vector) -> tuple[Any, Vector]:
    """Split x = n log 2 + r; return the integer n and exp(r) - 1."""
    shifted = x.multiply_add(1.0 / log(2.0), _ROUNDER)
    k = shifted - _ROUNDER
    high = k.multiply_add(-_LOG_2[0], x)
    r = k.multiply_add(-_LOG_2[1], high)
    rest = k.multiply_add(-_LOG_2[1], high - r)
    factorials = [0.5]
    for n in range(3, 15):
        factorials.append(factorials[-1] / n)
    return x.build.sub(shifted.bits(), x.longs(_ROUNDER_BITS)), r + (r * r).multiply_add(
        r.polynomial(tuple(factorials)), r.multiply_add(rest, rest)
    )


def _exp(x: Vector) -> Vector:
    build = x.build
    low = x._make(x.as_vector(-746.0)).where(x < -746.0, x)
    number, less = _reduce_exponent(low._make(low.as_vector(710.0)).where(Vector.__lt__(-low, -710.0), low))
    half = build.ashr(number, x.longs(1))
    return (1.0 + less) * _power_of_two(x, half) * _power_of_two(x, build.sub(number, half))


def _exp_minus_one(x: Vector) -> Vector:
    """Return exp(x) - 1 for x between 0 and 44."""
    number, less = _reduce_exponent(x)
    scale = _power_of_two(x, number)
    return scale.multiply_add(less, scale - 1.0)


def _limit_above(a: Vector, limit: float) -> Vector:
    return a._make(a.as_vector(limit)).where(Vector.__lt__(-a, -limit), a)


def _tanh(x: Vector) -> Vector:
    e = _exp_minus_one(2.0 * _limit_above(x.absolute(), 22.0))
    return (e / (e + 2.0)).with_signs(x)


def _sinh(x: Vector) -> Vector:
    a = x.absolute()
    small = _exp_minus_one(_limit_above(a, 22.0))
    root = _exp(0.5 * a)
    return (0.5 * (small + small / (small + 1.0))).where(a < 22.0, 0.5 * root * root).with_signs(x)


def _cosh(x: Vector) -> Vector:
    root = _exp(0.5 * x.absolute())
    half = 0.5 * root * root
    return half + 0.25 / half


def _log(x: Vector) -> Vector:
    build = x.build
    tiny = x < 2.0**-1022
    bits = (x * 2.0**54).where(tiny, x).bits()
    # the power of two by which x is divided to lie between sqrt(1/2) and sqrt(2)
    number = build.ashr(build.sub(bits, x.longs(0x3FE6A09E667F3BCD)), x.longs(52))
    f = x.from_bits(build.sub(bits, build.shl(number, x.longs(52)))) - 1.0
    k = x.from_bits(build.add(number, x.longs(_ROUNDER_BITS))) - _ROUNDER
    k = (k - 54.0).where(tiny, k)
    s = f / (2.0 + f)
    z = s * s
    half = 0.5 * f * f
    result = k * _LOG_2[0] - ((half - s.multiply_add(half + z * z.polynomial(_LOGARITHM), k * _LOG_2[1])) - f)
    result = x._make(x.as_vector(-inf)).where(x.equals(0.0), result)
    result = x._make(x.as_vector(nan)).where(x < 0.0, result)
    return result.where(x < inf, x + x).where(build.or_(x < inf, x.equals(inf)), x)


def power(x: Vector, y: Vector) -> Vector:
    """Return x to the power of y without the C library; the error is at most 2 + 3 abs(y log(x)) units in the last place."""
    build, one = x.build, x._make(x.as_vector(1.0))
    shifted = y + _ROUNDER
    odd = build.icmp_unsigned("!=", build.and_(shifted.bits(), x.longs(1)), x.longs(0))
    result = _exp(y * _log(x.absolute()))
    # negative numbers have only whole powers
    whole = (-result).where(odd, result).where((shifted - _ROUNDER).equals(y), x._make(x.as_vector(nan)))
    return one.where(y.equals(0.0), whole.where(x < 0.0, result))


# Inverses of circular functions


def _angle(y: Vector, x: Vector) -> Vector:
    """Return the arctangent of y / x for y and x that are not negative."""
    numerator, denominator = -x, y
    high, low = (y._make(y.as_vector(part)) for part in _ARCTANGENTS[3])
    for above, center, (a, b) in zip((39 / 16, 19 / 16, 11 / 16), (1.5, 1.0, 0.5), reversed(_ARCTANGENTS[:3])):
        inside = y < above * x
        numerator = x.multiply_add(-center, y).where(inside, numerator)
        denominator = y.multiply_add(center, x).where(inside, denominator)
        high, low = high._make(high.as_vector(a)).where(inside, high), low._make(low.as_vector(b)).where(inside, low)
    inside = y < 7 / 16 * x
    t = y.where(inside, numerator) / x.where(inside, denominator)
    z = t * t
    curved = t * z * z.polynomial(_ARCTANGENT)
    result = (t - curved).where(inside, high - ((curved - low) - t))
    return y.where(y.equals(0.0), result)


def _supplement_of_negative(angle: Vector, x: Vector) -> Vector:
    """Return pi - angle where x is negative, the angle elsewhere."""
    negative = x.build.icmp_signed("<", x.bits(), x.longs(0))
    return (pi - (angle - 2.0 * _HALF_PI[1])).where(negative, angle)


def _atan2(y: Vector, x: Vector) -> Vector:
    return _supplement_of_negative(_angle(y.absolute(), x.absolute()), x).with_signs(y)


def _atan(x: Vector) -> Vector:
    return _angle(x.absolute(), x._make(x.as_vector(1.0))).with_signs(x)


def _leg(x: Vector) -> Vector:
    return ((1.0 - x) * (1.0 + x)).square_root()


def _hypot(x: Vector, y: Vector) -> Vector:
    a, b = x.absolute(), y.absolute()
    great, small = b.where(a < b, a), a.where(a < b, b)
    ratio = small / great
    return great.where(great.equals(0.0), great * ratio.multiply_add(ratio, 1.0).square_root())


#: The functions by their names in `math`.
FUNCTIONS: dict[str, Callable[..., Vector]] = {
    "sin": _sin,
    "cos": _cos,
    "tan": lambda x: _sin(x) / _cos(x),
    "asin": lambda x: _angle(x.absolute(), _leg(x)).with_signs(x),
    "acos": lambda x: _supplement_of_negative(_angle(_leg(x), x.absolute()), x),
    "atan": _atan,
    "atan2": _atan2,
    "sinh": _sinh,
    "cosh": _cosh,
    "tanh": _tanh,
    "exp": _exp,
    "log": _log,
    "sqrt": Vector.square_root,
    "fabs": Vector.absolute,
    "hypot": _hypot,
    "pow": lambda x, y: lane_by_lane("pow", x, y),
}
