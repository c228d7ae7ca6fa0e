"""Values in a Context that are never changed."""

from typing import Any, Self


class Immutable:
    """Base of values whose copies are the same object.

    Drake copies all abstract values of a Context at each unrestricted update.
    """

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self
