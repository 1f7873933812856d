"""The numeric settings of a stereo method, and values worth trying for each."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from stereolag.core.settings import Bounds, Number, Settings, changed
from stereolag.stereo.matcher import StereoMatcher

HALF_OCTAVE = math.sqrt(2)
OUTWARDS = [sign * number for number in range(1, 13) for sign in (1, -1)]
ENOUGH_TO_TELL = 3
WHOLE_RANGE_UP_TO = 1.0
"""Parameters with an allowed range up to this wide are tried over all of it, the others around their current value."""


@dataclass(frozen=True)
class Parameter:
    """A number among the settings of a method.

    Attributes
    ----------
    name
        Dotted for nested settings: "search.vertical".
    title
        Its label on the page.
    value
        Its current value.
    bounds
        Its allowed range.
    """

    name: str
    title: str
    value: Number
    bounds: Bounds

    def values(self, count: int) -> tuple[Number, ...]:
        """Return at most `count` allowed values worth trying, ascending, including the current one.

        Sizes are tried in half octaves around their value, fractions over their whole range, and numbers that are zero
        or may be negative in doubling steps away from their value.
        """
        low, high, step = self.bounds.low, self.bounds.high, self.bounds.step
        if low is not None and high is not None and high - low <= WHOLE_RANGE_UP_TO:
            wanted = [low + (high - low) * number / (count - 1) for number in range(count)]
        elif self.value > 0 and (low is None or low >= 0):
            wanted = [self.value * HALF_OCTAVE**number for number in OUTWARDS]
        else:
            wanted = [self.value + step * math.copysign(2 ** (abs(number) - 1), number) for number in OUTWARDS]
        found: list[Number] = [self.value]
        for one in wanted:
            allowed = self._nearest(one)
            if allowed is not None and allowed not in found and len(found) < count:
                found.append(allowed)
        return tuple(sorted(found))

    def _nearest(self, wanted: float) -> Number | None:
        """Return the number nearest to `wanted` that is whole steps from the value; None beyond the bounds."""
        low, high, step = self.bounds.low, self.bounds.high, self.bounds.step
        nearest = self.value + step * round((wanted - self.value) / step)
        if (low is not None and nearest < low) or (high is not None and nearest > high):
            return None
        return round(nearest, 9)


def parameters(matcher: StereoMatcher) -> dict[str, Parameter]:
    """Return the numeric settings of a matcher that have an effect, by name, in order of declaration."""
    return {parameter.name: parameter for parameter in _within(matcher, "") if _free(matcher, parameter)}


def _free(matcher: StereoMatcher, parameter: Parameter) -> bool:
    """Return whether the other settings allow a parameter any value but its current one."""
    for value in parameter.values(ENOUGH_TO_TELL):
        try:
            if changed(matcher, {parameter.name: value}) != matcher:
                return True
        except ValueError:
            continue
    return False


def _within(settings: Settings, path: str) -> Iterator[Parameter]:
    for name, field in type(settings).model_fields.items():
        value = getattr(settings, name)
        if type(settings).obstacle(name, settings) is not None:
            continue
        if isinstance(value, Settings):
            yield from _within(value, f"{path}{name}.")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield Parameter(f"{path}{name}", field.title or name, value, Bounds.of(field))
