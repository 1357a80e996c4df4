"""Units that people write after a number, and the number in SI.

A prefix moves the decimal exponent of the text before it is rounded, so that `16.1 mm` is the same double as `0.0161`,
and two scenes that say the same have one digest; a product of two floats, as libraries of units have, would not be.
"""

from __future__ import annotations

import math
import re
from typing import NamedTuple


class Unit(NamedTuple):
    """A unit as 10^power times factor of the SI unit of its dimensions: exponents of kg, m, s and rad."""

    power: int
    factor: float
    dimensions: tuple[int, int, int, int]


# With the prefixes below.
_SYMBOLS = {
    "m": Unit(0, 1.0, (0, 1, 0, 0)),
    "g": Unit(-3, 1.0, (1, 0, 0, 0)),
    "s": Unit(0, 1.0, (0, 0, 1, 0)),
    "N": Unit(0, 1.0, (1, 1, -2, 0)),
    "J": Unit(0, 1.0, (1, 2, -2, 0)),
    "rad": Unit(0, 1.0, (0, 0, 0, 1)),
}
_PREFIXES = {"n": -9, "µ": -6, "μ": -6, "u": -6, "m": -3, "c": -2, "k": 3, "M": 6, "G": 9}
# Those, and units that have no prefix.
_UNITS = {
    prefix + symbol: unit._replace(power=unit.power + power)
    for prefix, power in {**_PREFIXES, "": 0}.items()
    for symbol, unit in _SYMBOLS.items()
} | {
    "min": Unit(0, 60.0, (0, 0, 1, 0)),
    "h": Unit(0, 3600.0, (0, 0, 1, 0)),
    "deg": Unit(0, math.pi / 180, (0, 0, 0, 1)),
    "°": Unit(0, math.pi / 180, (0, 0, 0, 1)),
}

# A value as people would write it, for each SI unit of a scene's quantities.
EXAMPLES = {
    "m": "16 mm",
    "kg": "5 g",
    "s": "10 ms",
    "rad": "30 deg",
    "m/s": "50 cm/s",
    "m/s²": "9.81 m/s^2",
    "kg/s²": "10 kN/m",
    "kg/s": "200 g/s",
    "kg m²": "10 kg mm^2",
    "kg m²/s": "10 kg mm^2/s",
    "rad/s": "20 rad/s",
}

_LONGEST = 60  # signs of a number with its unit
_MANTISSA = r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)"
_VALUE = re.compile(rf"\s*({_MANTISSA})(?:[eE]([-+]?[0-9]{{1,6}}))?\s*([^\s0-9.,;:+-].*?)\s*")
_COMMA = re.compile(r"\s*([-+]?[0-9]+),([0-9]+(?:[eE][-+]?[0-9]+)?)(\s*[^\s0-9,].*)?")
_FACTOR = re.compile(r"\s*([/*·]?)\s*([A-Za-zµμ°]+)(?:(?:\^|\*\*)?([-+]?[1-9]))?\s*")
_RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")


def unit_of(text: str) -> Unit | None:
    """Return a unit such as `N/m`, `kg m²/s` or `m s-2`; none where a symbol is not known. What follows a / divides."""
    power, factor, dimensions, at = 0, 1.0, (0, 0, 0, 0), 0
    raised = text.translate(_RAISED)
    while at < len(raised):
        found = _FACTOR.match(raised, at)
        symbol = _UNITS.get(found[2]) if found else None
        if found is None or symbol is None or (at == 0 and found[1]):
            return None
        exponent = int(found[3] or 1) * (-1 if found[1] == "/" else 1)
        power += symbol.power * exponent
        factor *= symbol.factor**exponent
        a, b, c, d = (x + exponent * y for x, y in zip(dimensions, symbol.dimensions, strict=True))
        dimensions, at = (a, b, c, d), found.end()
    return Unit(power, factor, dimensions) if raised.strip() else None


def in_si(text: str, unit: str) -> float:
    """Return the number [unit] that a text such as `16 mm` stands for; unit: an SI unit, as `kg/s²`.

    Raises ValueError with what is wrong in words, empty if it does not look like a number with a unit at all.
    """
    if comma := decimal_comma(text):
        raise ValueError(comma)
    found, wanted = _VALUE.fullmatch(text) if len(text) <= _LONGEST else None, unit_of(unit)
    if found is None:
        raise ValueError
    given = unit_of(found[3])
    if given is None:
        raise ValueError(f"{found[3]} is no unit known here")
    if wanted is None:
        raise ValueError("it has no unit")
    if given.dimensions != wanted.dimensions:
        raise ValueError(f"{found[3]} is no unit of [{unit}]")
    # The exponent is moved in the text: rounded once, as the number in SI would be.
    return float(f"{found[1]}e{int(found[2] or 0) + given.power}") * given.factor


def decimal_comma(text: str) -> str:
    """Return what to say of a number with a comma, nothing if it has none."""
    found = _COMMA.fullmatch(text) if len(text) <= _LONGEST else None
    return f"a decimal comma is not read; write {found[1]}.{found[2]}{found[3] or ''}" if found else ""
