"""Units of measured numbers as people and programs write them: the one table of files, mappings, benches and commands.

`quantity` reads ``N``, ``Newtons``, ``m/s²``, ``m/s/s``, ``ms-2``, ``mV/g``, ``(m/s^2)/N``. Where letters mean several
things they mean what they do in vibration testing: ``g`` is standard gravity, ``lb`` a force, ``mil`` a thousandth of an inch.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

Exponents = tuple[tuple[str, int], ...]
"""Base units and their exponents, sorted."""
_LONGEST = 40  # letters of a unit that is read; chosen: whatever is longer is a remark
_LARGEST_EXPONENT = 9
_WITH_UNIT = re.compile(r"\s*([+-]?(?:\d++\.?\d*+|\.\d++)(?:[eE][+-]?\d{1,2})?)\s*(\D.*)")


@dataclass(frozen=True)
class Quantity:
    """What a unit measures, and how much of the SI unit it is."""

    exponents: Exponents
    """Exponents of m, kg, s, V, A, K, rad; none for a ratio."""
    factor: Fraction
    """SI units in one of it."""

    @property
    def si(self) -> str:
        """The SI unit as this program writes it: ``m/s2``, ``N``, ``1``; by base units where it has no name."""
        return _NAMES.get(self.exponents) or " ".join(f"{base}{power}" for base, power in self.exponents)

    def __mul__(self, other: "Quantity") -> "Quantity":
        return Quantity(_sum(self.exponents, other.exponents, 1), self.factor * other.factor)

    def __truediv__(self, other: "Quantity") -> "Quantity":
        return Quantity(_sum(self.exponents, other.exponents, -1), self.factor / other.factor)

    def __pow__(self, power: int) -> "Quantity":
        return Quantity(tuple((base, n * power) for base, n in self.exponents if n * power), self.factor**power)


def _sum(one: Exponents, other: Exponents, sign: int) -> Exponents:
    both = dict(one)
    for base, power in other:
        both[base] = both.get(base, 0) + sign * power
    return tuple(sorted((base, power) for base, power in both.items() if power))


def _made(factor: str, **exponents: int) -> Quantity:
    return Quantity(tuple(sorted(exponents.items())), Fraction(factor))


_POUND = "4.4482216152605"  # N per pound of force (BIPM, The International System of Units)
POUND_N = float(_POUND)
"""A pound of force, N."""
GRAVITY_M_S2 = 9.80665
"""Standard gravity, m/s2: sensitivities are stated by g."""
_G = str(GRAVITY_M_S2)
_PREFIXED = {
    "m": _made("1", m=1), "s": _made("1", s=1), "sec": _made("1", s=1), "Hz": _made("1", s=-1),
    "N": _made("1", kg=1, m=1, s=-2), "V": _made("1", V=1), "A": _made("1", A=1), "C": _made("1", A=1, s=1),
    "Pa": _made("1", kg=1, m=-1, s=-2), "rad": _made("1", rad=1), "strain": _made("1"), "ε": _made("1"),
}  # fmt: skip
"""Units that take prefixes."""
_PLAIN = {
    "1": _made("1"), "%": _made("0.01"), "kg": _made("1", kg=1), "K": _made("1", K=1), "ohm": _made("1", V=1, A=-1),
    "g": _made(_G, m=1, s=-2), "mg": _made(_G, m=1, s=-2) / _made("1000"), "G": _made(_G, m=1, s=-2),
    "in": _made("0.0254", m=1), "ft": _made("0.3048", m=1), "mil": _made("0.0000254", m=1),
    "lbf": _made(_POUND, kg=1, m=1, s=-2), "kgf": _made(_G, kg=1, m=1, s=-2),
    "kip": _made(_POUND, kg=1, m=1, s=-2) * _made("1000"), "psi": _made(_POUND, kg=1, m=1, s=-2) / _made("0.00064516", m=2),
    "bar": _made("100000", kg=1, m=-1, s=-2), "min": _made("60", s=1), "h": _made("3600", s=1), "d": _made("86400", s=1),
    "rpm": _made("1/60", s=-1), "°": _made("0.017453292519943295", rad=1),
}  # fmt: skip
"""Units without prefixes, of which none is a prefix and a unit; these come first."""
_PREFIXES = {"p": -12, "n": -9, "u": -6, "m": -3, "c": -2, "k": 3, "M": 6, "G": 9}
_LONG_PREFIXES = {"nano": "n", "micro": "u", "milli": "m", "centi": "c", "kilo": "k", "mega": "M", "giga": "G"}
_WORDS = {
    "newton": "N", "volt": "V", "meter": "m", "metre": "m", "second": "s", "sec": "s", "hertz": "Hz", "hz": "Hz",
    "pascal": "Pa", "ampere": "A", "amp": "A", "coulomb": "C", "radian": "rad", "degree": "°", "deg": "°", "kelvin": "K",
    "inch": "in", "inche": "in", "foot": "ft", "feet": "ft", "mil": "mil", "thou": "mil", "micron": "um",
    "lb": "lbf", "pound": "lbf", "lbf": "lbf", "pound-force": "lbf", "poundforce": "lbf", "pound_force": "lbf",
    "kgf": "kgf", "kp": "kgf", "minute": "min", "hour": "h", "hr": "h", "day": "d", "percent": "%",
    "gn": "g", "g_n": "g", "g0": "g", "g": "g", "gee": "g", "gravity": "g", "microstrain": "ustrain", "volts": "V",
}  # fmt: skip
"""Words, in small letters and without the s of a plural, and the unit that each is."""
_WHOLE = {"ms-2": "m/s2", "ms^-2": "m/s2", "ms-1": "m/s", "ms^-1": "m/s", "Gs": "g", "gs": "g", "g's": "g"}
"""Texts which products of units would give another meaning."""
_LETTERS = (("²", "2"), ("³", "3"), ("⁻", "-"), ("¹", "1"), ("µ", "u"), ("μ", "u"), ("**", "^"), ("·", "*"), ("⋅", "*"))
_TERM = re.compile(r"\s*(?:([*/])\s*)?(?:([A-Za-z%°ε_]+0?(?:-force)?)|(1)(?![\d^+-]))(?:\^?([+-]?\d+))?\s*")
_NAMES = {
    q.exponents: name
    for name, q in {
        **{"m": _made("1", m=1), "m/s": _made("1", m=1, s=-1), "m/s2": _made("1", m=1, s=-2)},
        **{"N": _PREFIXED["N"], "V": _PREFIXED["V"], "1": _made("1"), "s": _PREFIXED["s"], "Hz": _PREFIXED["Hz"]},
        **{"rad": _PREFIXED["rad"], "rad/s": _made("1", rad=1, s=-1), "Pa": _PREFIXED["Pa"], "kg": _PLAIN["kg"]},
        **{"A": _PREFIXED["A"], "C": _PREFIXED["C"], "K": _PLAIN["K"], "ohm": _PLAIN["ohm"]},
    }.items()
}
SIGNALS = ("m", "m/s", "m/s2", "N", "V", "1")
"""SI units of the signals of a test."""
USUAL = (
    *("m", "mm", "um", "in", "mil", "ft", "m/s", "mm/s", "in/s", "m/s2", "mm/s2", "in/s2", "g"),
    *("N", "mN", "kN", "lbf", "kgf", "V", "mV", "1"),
)
"""Usual units of signals, as messages and pages list them; other spellings and prefixes are understood as well."""
_NOTHING = ("", "-", "--", "none", "n/a", "na", "unknown", "undefined", "unit", "units", "?", "*")
"""Texts in the place of a unit that say that there is none, in small letters."""


def says_a_unit(text: str) -> bool:
    """Return whether a text in the place of a unit says one, known or not."""
    return text.strip().lower() not in _NOTHING


@lru_cache(maxsize=4096)
def quantity(text: str) -> Quantity | None:
    """Return what a unit measures; None if it is not understood, such as decibels and degrees Celsius, which are no factors."""
    if len(text) > _LONGEST:
        return None
    plain = text.strip()
    for old, new in _LETTERS:
        plain = plain.replace(old, new)
    plain = re.sub(r"\bper\b", "/", plain, flags=re.IGNORECASE)
    return _product(_WHOLE.get("".join(plain.split()), plain))


def number_in(text: str, unit: str) -> float | None:
    """Return the number of a text such as ``17 lbf`` in another unit; None if it is no number with a unit of that kind."""
    found = _WITH_UNIT.fullmatch(text)
    given, wanted = (quantity(found[2]), quantity(unit)) if found else (None, None)
    if found is None or given is None or wanted is None or given.exponents != wanted.exponents:
        return None
    return float(found[1]) * float(given.factor / wanted.factor)


def _product(text: str) -> Quantity | None:
    """Return the product of the terms of a text, each ``/`` before one dividing by it; brackets are quantities."""
    parts = list(_bracketed(text))
    if not parts:
        return None
    found = Quantity((), Fraction(1))
    for sign, inner, power in parts:
        if inner is None or abs(power) > _LARGEST_EXPONENT:
            return None
        found = found / inner**power if sign == "/" else found * inner**power
    return found


def _bracketed(text: str) -> Iterator[tuple[str, Quantity | None, int]]:
    """Yield sign, quantity and exponent of every term; a quantity of None where a text is none."""
    at = 0
    while at < len(text):
        if opened := re.compile(r"\s*([*/])?\s*([\[(])").match(text, at):
            end = _closing(text, opened.end() - 1)
            yield opened[1] or "*", _product(text[opened.end() : end]) if end > 0 else None, 1
            at = end + 1 if end > 0 else len(text)
        elif term := _TERM.match(text, at):
            yield term[1] or "*", _named(term[2] or term[3]), int(term[4] or 1)
            at = term.end()
        else:
            yield "*", None, 1
            return


def _closing(text: str, start: int) -> int:
    """Return where the bracket at ``start`` closes; -1 if it does not."""
    depth = 0
    for at in range(start, len(text)):
        depth += (text[at] in "[(") - (text[at] in "])")
        if depth == 0:
            return at
    return -1


def _named(name: str) -> Quantity | None:
    """Return the quantity of a single name, with its prefix."""
    if name in _PLAIN or name in _PREFIXED:
        return _PLAIN.get(name) or _PREFIXED[name]
    prefix, rest = name[:1], name[1:]
    if prefix in _PREFIXES and rest in _PREFIXED:
        return Quantity(_PREFIXED[rest].exponents, _PREFIXED[rest].factor * Fraction(10) ** _PREFIXES[prefix])
    word = name.lower()
    for form in (word, word.removesuffix("s")):
        if form in _WORDS:
            return _named(_WORDS[form]) if _WORDS[form] != name else None
    for long, short in _LONG_PREFIXES.items():
        inner = _WORDS.get(word.removeprefix(long).removesuffix("s")) if word.startswith(long) else None
        if inner in _PREFIXED:
            return _named(short + inner)
    return None


def seconds_in(text: str) -> float | None:
    """Return the seconds in a unit of time, also one with its beginning (``ms since 2020-01-01``); None for anything else."""
    found = quantity(text.partition(" since ")[0])
    return float(found.factor) if found is not None and found.si == "s" else None
