"""The base of every table of a world file, and the kinds of number that stand in it."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field


class Section(BaseModel):
    """A table of a world file: immutable, SI, an unknown key is an error. Docstrings of fields are its reference."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)


Real = Annotated[float, Field(strict=True)]
Positive = Annotated[float, Field(strict=True, gt=0)]
NonNegative = Annotated[float, Field(strict=True, ge=0)]
Share = Annotated[float, Field(strict=True, ge=0, le=1)]
"""A probability, or a part of a whole."""
Index = Annotated[int, Field(strict=True, ge=0)]
Count = Annotated[int, Field(strict=True, gt=0)]
Shift = Annotated[float, Field(strict=True, ge=-0.5, le=0.5)]
"""A length on a robot, of either sign [m]; beyond half a metre it was meant in millimetres."""
Size = Annotated[float, Field(strict=True, ge=0, le=0.5)]
"""The same, at least 0 [m]."""
Angle = Annotated[float, Field(strict=True, ge=0, le=10)]
"""[rad], at least 0; beyond ten it was meant in degrees."""
Error = Annotated[float, Field(strict=True, ge=-0.4, le=0.4)]
"""Relative."""
Delay = Annotated[float, Field(strict=True, ge=-1, le=1)]
"""[s]; beyond one it was meant in milliseconds."""
Slope = Annotated[float, Field(strict=True, ge=-0.7, le=0.7)]
"""[rad]; beyond 40 degrees it was meant in degrees."""
Factor = Annotated[float, Field(strict=True, ge=0.01, le=100)]
"""How many times as much."""
Place = Annotated[float, Field(strict=True, ge=-10, le=10)]
"""Along the floor [m]; beyond ten it was meant in millimetres."""
Spread = Annotated[float, Field(strict=True, ge=0, le=0.3)]
"""Relative standard deviation of what is above 0 and drawn as far as three of them: a tenth of it is left."""
Shift3 = tuple[Shift, Shift, Shift]
Vector3 = tuple[Real, Real, Real]
Vector2 = tuple[Real, Real]
