"""Numbers as people read them: millimetres and degrees instead of metres and radians, few digits, the unit said once."""

from __future__ import annotations

import math

_READ = {
    "1": ("", 1.0, ""), "m": ("mm", 1e3, "_m"), "m/s": ("mm/s", 1e3, "_m_per_s"), "m/N": ("mm/N", 1e3, "_m_per_n"),
    "m/(N s)": ("mm/(N s)", 1e3, "_m_per_ns"), "rad": ("deg", math.degrees(1.0), "_rad"), "s": ("s", 1.0, "_s"),
    "kg": ("kg", 1.0, "_kg"), "N": ("N", 1.0, "_n"), "1/s": ("1/s", 1.0, "_per_s"), "1/m": ("1/m", 1.0, "_per_m"),
    "s/m": ("s/m", 1.0, "_s_per_m"), "N s/m": ("N s/m", 1.0, "_n_s_per_m"),
}  # fmt: skip
"""By SI unit: the unit that people read, what SI is multiplied by, how names of numbers in it end."""


def read_in(unit: str) -> tuple[str, float]:
    """The unit that people read (empty: none) and what a number in the SI unit is multiplied by; any other unit
    stays."""
    shown, factor, _ = _READ.get(unit, (unit, 1.0, ""))
    return shown, factor


def plain_name(name: str, unit: str) -> str:
    """`axial` of `axial_m` in m: the unit stands behind the number."""
    return name.removesuffix(_READ.get(unit, ("", 1.0, ""))[2])


def rounded(value: float, digits: int = 3) -> str:
    """To as many significant digits, never in powers of ten; whole numbers keep all of theirs."""
    if value == 0.0 or not math.isfinite(value):
        return f"{value:g}"
    decimals = max(digits - 1 - math.floor(math.log10(abs(value))), 0)
    return f"{value:.{decimals}f}"


def share_of_gap(share: float) -> str:
    """`63 %` of a gap that closes; `none` where it would grow, by however much."""
    return f"{round(100 * share)} %" if share > 0.0 else "none"


def quantity(value: float, unit: str, digits: int = 3) -> str:
    """`9.66 mm` of 0.00966 in m."""
    shown, factor = read_in(unit)
    return f"{rounded(factor * value, digits)} {shown}".rstrip()
