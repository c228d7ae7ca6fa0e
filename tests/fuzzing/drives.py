"""Ways to damage recorded drives."""

import json
from collections.abc import Iterator
from typing import Any

from tests.fuzzing import text
from tests.fuzzing.damage import CHECKSUM, Damage, Random


def drive_files(data: bytes, random: Random) -> Iterator[Damage]:
    """Yields recorded drives whose header, scenario or orders were edited.

    A drive whose hash fits was recorded so, for all that a reader can tell.
    """
    first, *rows = data.decode().splitlines()
    header = json.loads(first)
    hashes = {key: header[key] for key in (CHECKSUM, "states_sha256", "policy_sha256")}
    for what, changed in text.replaced(header, 40, random):
        yield Damage(f"header: {what}", _lines(changed, rows))
    for what, changed in text.replaced(header, 60, random):
        yield _signed(f"header: {what}", changed, rows)
    for damage in text.yaml_texts(header["scenario"], random):
        scenario = damage.data.decode(errors="surrogatepass")
        yield _signed(
            f"scenario: {damage.what}", {**header, "scenario": scenario}, rows
        )
    values = [json.loads(row) for row in rows]
    for what, changed in text.replaced(values, 60, random):
        new = [json.dumps(row) for row in changed]
        yield Damage(f"rows: {what}", _lines(header, new))
        yield _signed(f"rows: {what}", header, new)
    for what, new in (
        ("no rows", []),
        ("a blank row", [*rows, ""]),
        ("rows turned round", rows[::-1]),
        ("a row twice", [*rows, rows[-1]]),
        ("a deep row", [*rows, "[" * 100_000]),
        ("a row that is text", [*rows, "text"]),
        ("100,000 rows", [rows[0]] * 100_000),
    ):
        yield _signed(what, header, new)
    for name, value in hashes.items():
        for new in (value[::-1], value[:-1], value.upper(), ""):
            yield Damage(f"{name} is {new}", _lines({**header, name: new}, rows))
    yield from text.encodings(data.decode())


def _lines(header: Any, rows: list[str]) -> bytes:
    return "\n".join([json.dumps(header), *rows, ""]).encode()


def _signed(what: str, header: Any, rows: list[str]) -> Damage:
    """Returns a drive whose hash fits."""
    from loco_drake.common.files import content_sha256
    from loco_drake.control.driving import COLUMNS

    full = {key: value for key, value in header.items() if key != CHECKSUM}
    full[CHECKSUM] = content_sha256(full, {"rows": "\n".join(rows).encode()})
    legal = header.get("columns") == list(COLUMNS)
    return Damage(f"signed, {what}", _lines(full, rows), legal=legal)
