"""Numbers that people type: no text is taken for one, and out of its bounds the usual slip of unit is named.

The bounds are those of any robot that this project could be about, from the hand to a 5 m rod and well beyond: they
catch a wrong unit, not an unusual robot. What is merely implausible for its size is for the checks of `validate`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import AfterValidator, Field, GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema


@dataclass(frozen=True)
class AtMost:
    """Annotation of a number: its size may not exceed `limit`; `trap` says what a larger one was probably meant as."""

    limit: float
    unit: str
    trap: str

    def check(self, value: float) -> float:
        """The value itself. Raises the error that pydantic reports."""
        if abs(value) > self.limit:
            text = f"at most {self.limit:g}{' ' * bool(self.unit)}{self.unit}: {value:g} {self.trap}"
            raise PydanticCustomError("too_large", "{text}", {"text": text})
        return value

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Hook of pydantic: validate the number first, then its size."""
        return core_schema.no_info_after_validator_function(self.check, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Hook of pydantic: the bound in the published JSON schema, on both sides where none is stated below."""
        found = handler(schema)
        below = {} if found.keys() & {"minimum", "exclusiveMinimum"} else {"minimum": -self.limit}
        return {**found, **below, "maximum": self.limit}


def _named(text: str) -> str:
    if not text.strip():
        raise PydanticCustomError("no_name", "a name with at least one letter")
    return text


LENGTH_MAX_M = 20.0
"""Four times the largest robot thought of; 0.02 m, the smallest part that is a length of its own, is 20 in mm."""
_MM = "looks like millimetres"
_MODULUS = "looks like the modulus of the material in pascals; times area over length it is N/m"

Number = Annotated[float, Field(strict=True)]
Positive = Annotated[float, Field(strict=True, gt=0)]
NonNegative = Annotated[float, Field(strict=True, ge=0)]
Whole = Annotated[int, Field(strict=True)]
Flag = Annotated[bool, Field(strict=True)]
Fraction = Annotated[float, Field(strict=True, ge=0, le=1)]
Share = Annotated[float, Field(strict=True, gt=0, le=1)]
Length = Annotated[float, Field(strict=True, gt=0), AtMost(LENGTH_MAX_M, "m", _MM)]
"""[m], above 0."""
Size = Annotated[float, Field(strict=True, ge=0), AtMost(LENGTH_MAX_M, "m", _MM)]
"""[m], 0 where there is none."""
Radius = Annotated[float, Field(strict=True, gt=0), AtMost(1.0, "m", _MM)]
"""[m] of something thin: rod, cap, winch. Those of a 5 m robot like the 36 cm one have 0.27 m at most."""
Coordinate = Annotated[float, Field(strict=True), AtMost(LENGTH_MAX_M, "m", _MM)]
Mass = Annotated[float, Field(strict=True, gt=0), AtMost(1000.0, "kg", "looks like grams")]
"""A part [kg]; a ton is what no cable robot of this sort lifts."""
Stiffness = Annotated[float, Field(strict=True, gt=0), AtMost(1e9, "N/m", _MODULUS)]
"""Of a tendon: 6 mm of steel wire 1 m long have 6e6 N/m. The engine divides its step by the root of it, and from 1e11 on
a second of simulation takes hours."""
TendonStiffness = Annotated[float, Field(strict=True, ge=0), AtMost(1e9, "N/m", _MODULUS)]
"""The same, 0 where there is none."""
Stiffness2 = Annotated[float, Field(strict=True), AtMost(1e12, "N/m^2", _MODULUS)]
"""Coefficient of the squared stretch: one that a millimetre of stretch makes of the stiffest tendon."""
Stiffness3 = Annotated[float, Field(strict=True), AtMost(1e15, "N/m^3", _MODULUS)]
"""Of the cube, likewise."""
Damping = Annotated[float, Field(strict=True, ge=0), AtMost(1e6, "N s/m", "is more than any cable has")]
Turning = Annotated[float, Field(strict=True, gt=0), AtMost(1e4, "rad/s", "looks like revolutions per minute")]
"""Of a motor without load: dental drills reach 4e4, winches 1e3."""
Frequency = Annotated[float, Field(strict=True, gt=0), AtMost(1e5, "Hz", "is faster than any controller")]
Friction = Annotated[float, Field(strict=True, ge=0), AtMost(10.0, "", "looks like per cent: rubber on concrete has 1")]
Gain = Annotated[float, Field(strict=True, ge=0), AtMost(1e4, "", "looks like counts of a motor board: the error is a share of the cable's range, full command is 1")]  # fmt: skip
"""Of the controller: 1e4 is full command for an error of a ten-thousandth of the range."""
Name = Annotated[str, AfterValidator(_named)]
"""What something is called: not empty, nor blanks alone."""
Tolerance = Annotated[float, Field(strict=True, gt=0), AtMost(1.0, "", "looks like per cent or millimetres: 0.1 is a tenth of the range")]  # fmt: skip
"""Share of a cable's range: beyond 1 every cable would be done before it has moved."""
Duration = Annotated[float, Field(strict=True, ge=0), AtMost(3600.0, "s", "looks like milliseconds")]
"""[s] of one step: nobody waits an hour for a cable, and 6000 is 6 s in milliseconds."""
Wait = Annotated[float, Field(strict=True, gt=0), AtMost(3600.0, "s", "looks like milliseconds")]
"""The same, above 0."""
CapacitanceSlope = Annotated[
    float, Field(strict=True), AtMost(1e-6, "F/m", "looks like pF/mm, of which one is 1e-9 F/m")
]
"""Stretch sensors have about 3e-11 F/m (0.03 pF/mm)."""
Capacitance = Annotated[float, Field(strict=True), AtMost(1e-6, "F", "looks like pF, of which one is 1e-12 F")]
"""Stretch sensors have about 1e-11 F."""
