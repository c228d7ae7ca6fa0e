"""Named points of any file: the joints of a BVH skeleton, or the points of a table.

Unlike the readers of known sources, nothing is known here of what the points are; see
:mod:`loco_drake.datasets.skeleton`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError, quoted
from loco_drake.datasets.bvh import END_SITE, parse_bvh, plain_name
from loco_drake.datasets.point_table import parse_point_table
from loco_drake.datasets.recording import read_lines

# Between the names of joints of which one is below the other.
BELOW = "/"
_MOST_NAMES = 60


@dataclass(frozen=True)
class NamedPoints:
    """Points over time, in the unit and axes of their file."""

    form: str  # of the file, in words
    names: tuple[str, ...]  # of the N points, END_SITE for the end of a chain
    parents: tuple[int, ...]  # index of the joint each hangs on, -1 for none
    positions: Array  # NaN where the file has gaps, shape (T, N, 3)
    fps: float | None  # frames per second, None if the file does not tell

    @property
    def is_tree(self) -> bool:
        """Whether the file says which point hangs on which."""
        return any(parent >= 0 for parent in self.parents)

    def ancestors(self, index: int) -> list[int]:
        """Returns the joints from a point's parent to the root."""
        found = []
        while (index := self.parents[index]) >= 0:
            found.append(index)
        return found

    def find(self, name: str) -> int:
        """Returns the index of the point of a name, or of a path such as ``Paw/Toe``.

        Joints may lie between those of a path. Case and namespaces are ignored.

        Raises:
            InputError: if there is none, or more than one; names those that there are.
        """
        found = self._matching((name,)) or self._matching(name.split(BELOW))
        if len(found) > 1:
            directly = [k for k in found if self._is_directly(k, name.split(BELOW))]
            found = directly if len(directly) == 1 else found
        if len(found) == 1:
            return found[0]
        if found:
            paths = ", ".join(self.path(k) for k in found)
            raise InputError(
                f"it has {len(found)} joints {quoted(name)}; name one of {paths}."
            )
        kind = "joint" if self.is_tree else "point"
        raise InputError(f"it has no {kind} {quoted(name)}, but {self.listing()}.")

    def path(self, index: int) -> str:
        """Returns the shortest path by which :meth:`find` finds the point."""
        path = self.names[index]
        for above in self.ancestors(index):
            if path != END_SITE and len(self._matching(path.split(BELOW))) == 1:
                break
            path = f"{self.names[above]}{BELOW}{path}"
        return path

    def listing(self) -> str:
        """Returns the names of all points but the ends of chains."""
        names = [name for name in dict.fromkeys(self.names) if name != END_SITE]
        more = len(names) - _MOST_NAMES
        return ", ".join(names[:_MOST_NAMES]) + (
            f" and {more} more" if more > 0 else ""
        )

    def _matching(self, path: Sequence[str]) -> list[int]:
        *above, last = map(plain_name, path)
        return [
            index
            for index, name in enumerate(self.names)
            if plain_name(name) == last and self._is_below(index, above)
        ]

    def _is_below(self, index: int, path: Sequence[str]) -> bool:
        left = list(path)
        for ancestor in self.ancestors(index):
            if left and plain_name(self.names[ancestor]) == left[-1]:
                left.pop()
        return not left

    def _is_directly(self, index: int, path: Sequence[str]) -> bool:
        names = [plain_name(self.names[k]) for k in self.ancestors(index)]
        wanted = [plain_name(name) for name in reversed(path[:-1])]
        return names[: len(wanted)] == wanted


def read_points(
    path: Path, columns: Mapping[str, Sequence[str | int]] | None = None
) -> NamedPoints:
    """Reads a BVH file or a table of points; the content tells which.

    Args:
        path: the file.
        columns: names or numbers, from 0, of the three columns of points of a table,
            besides the points that the table names itself.

    Raises:
        InputError: if the file cannot be read, or is neither.
    """
    lines = read_lines(path)
    if lines[0].strip().upper() == "HIERARCHY":
        if columns:
            raise InputError("it is a BVH file, which has joints and no columns.")
        bvh = parse_bvh(lines)
        return NamedPoints(
            "BVH",
            tuple(joint.name for joint in bvh.joints),
            tuple(joint.parent for joint in bvh.joints),
            bvh.positions(),
            # The file rounds the time of a frame to six digits.
            round(bvh.fps, 2),
        )
    table = parse_point_table(lines, columns or {})
    names = tuple(table.points)
    return NamedPoints("table", names, (-1,) * len(names), table.positions(), table.fps)
