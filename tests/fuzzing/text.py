"""Ways to damage text: tables of numbers, CSV, JSON, YAML and XML."""

import json
import re
from collections.abc import Iterator
from typing import Any

from tests.fuzzing.damage import DEEP, VALUES, Damage, Random

OF_NUMBERS = {
    "a hundred times": lambda v: 100 * v,
    "ten more": lambda v: v + 10,
    "the other sign": lambda v: -v,
}
CELLS = {
    "1e300": "1e300",
    "-1e300": "-1e300",
    "1e-320": "1e-320",
    "1e999": "1e999",
    "nan": "nan",
    "-inf": "-inf",
    "empty": "",
    "space": " ",
    "text": "abc",
    "decimal comma": "0,5",
    **dict.fromkeys(OF_NUMBERS),
    "0x10": "0x10",
    "1_0": "1_0",
    "Arabic digits": "٣",
    "complex": "1+2j",
    "quoted": '"1.0"',
    "quote": '"',
    "zero byte": "\x00",
    "escape": "\x1b[31m",
    "10,000 letters": "x" * 10_000,
    "200,000 digits": "1" * 200_000,
    "a path": "../canary",
    "an absolute path": "/etc/passwd",
    "minus one": "-1",
    "a huge number": "1" + "0" * 30,
    "3.7": "3.7",
    "minus zero": "-0",
}


def encodings(text: str) -> Iterator[Damage]:
    """Yields a text in other encodings and with other line ends."""
    for code in ("utf-16", "utf-16-le", "utf-32", "utf-7", "cp037", "utf-8-sig"):
        yield Damage(f"as {code}", text.encode(code, errors="replace"))
    yield Damage("two byte order marks", b"\xef\xbb\xbf" * 2 + text.encode())
    lines = text.splitlines()
    for what, end in (
        ("CRLF", "\r\n"),
        ("CR", "\r"),
        ("line separators", "\u2028"),
        ("form feeds", "\x0c"),
        ("no line breaks", ""),
        ("blank lines between", "\n\n"),
        ("LF CR", "\n\r"),
    ):
        yield Damage(f"lines end with {what}", (end.join(lines) + end).encode())
    yield Damage("1 MB of blank lines", text.encode() + b"\n" * 2**20)
    yield Damage("60 MB of spaces", text.encode() + b" " * 60_000_000)
    yield Damage("no line break at the end", text.rstrip().encode())
    yield Damage("one line of 5 MB", b"1," * 2_500_000 + b"1\n")
    yield Damage("Latin-1 letters", text.encode() + b"\xe4\xf6\n")


def tables(text: str, separator: str, header: int, random: Random) -> Iterator[Damage]:
    """Yields tables with rows, columns and single cells spoilt.

    Args:
        text: of the table.
        separator: between cells.
        header: lines before the numbers.
        random: where.
    """
    lines = text.splitlines()
    head, rows = lines[:header], [line.split(separator) for line in lines[header:]]
    width, end = len(rows[0]), len(rows)

    def table(what: str, rows: list[list[str]]) -> Damage:
        body = [separator.join(row) for row in rows]
        return Damage(what, ("\n".join(head + body) + "\n").encode(errors="replace"))

    for what, cell in CELLS.items():
        a, b = int(random.integers(end)), int(random.integers(width))
        new = [list(row) for row in rows]
        old = new[a][b]
        if cell is None:
            try:
                value = float(old)
            except ValueError:
                continue
            cell = f"{OF_NUMBERS[what](value):g}"
        new[a][b] = cell
        yield table(f"{what} in row {a}, column {b}", new)
        if what in ("nan", "empty", "1e300", "text"):
            yield table(f"{what} in all of column {b}", _column(rows, b, cell))
    for what, order in (
        ("two columns exchanged", _exchanged(width, random)),
        ("columns shifted", [*range(1, width), 0]),
        ("columns turned round", [*range(width)][::-1]),
        ("last column missing", [*range(width - 1)]),
        ("first column missing", [*range(1, width)]),
        ("a column twice", [*range(width), 0]),
    ):
        yield table(what, [[row[k] for k in order if k < len(row)] for row in rows])
    a = int(random.integers(end))
    yield table("a row twice", [*rows[: a + 1], *rows[a:]])
    yield table("a row missing", rows[:a] + rows[a + 1 :])
    yield table("rows turned round", rows[::-1])
    yield table("a third of the rows missing", rows[: end // 3] + rows[2 * end // 3 :])
    yield table("first row only", rows[:1])
    yield table("two rows", rows[:2])
    yield table("five rows", rows[:5])
    yield table("no rows", [])
    yield table("all rows alike", [rows[0]] * end)
    yield table("every second row", rows[::2])
    shuffled = [rows[k] for k in random.permutation(end)]
    yield table("rows shuffled", shuffled)
    yield table("a cell more in a row", [*rows[:a], [*rows[a], "1"], *rows[a + 1 :]])
    yield table("a cell less in a row", [*rows[:a], rows[a][1:], *rows[a + 1 :]])
    for other in (";", "\t", " ", "|", ",,", ", "):
        body = "\n".join(head + [other.join(row) for row in rows])
        yield Damage(f"separated by {other!r}", (body + "\n").encode())
    for factor in (100.0, 1000.0, 0.001, 0.0, -1.0, 1e200):
        yield table(
            f"all numbers times {factor:g}", _numbers(rows, lambda v, f=factor: v * f)
        )
    for noise in (1e-5, 0.3):
        yield table(
            f"noise of {noise}",
            _numbers(rows, lambda v, n=noise: v + random.normal() * n),
        )
    yield table("one more on everything", _numbers(rows, lambda v: v + 1.0))


def _column(rows: list[list[str]], b: int, cell: str) -> list[list[str]]:
    return [[*row[:b], cell, *row[b + 1 :]] for row in rows]


def _exchanged(width: int, random: Random) -> list[int]:
    order = list(range(width))
    a, b = random.choice(width, 2, replace=False)
    order[a], order[b] = order[b], order[a]
    return order


def _numbers(rows: list[list[str]], change: Any) -> list[list[str]]:
    def cell(text: str) -> str:
        try:
            return f"{change(float(text)):.9g}"
        except (ValueError, OverflowError):
            return text

    return [[cell(value) for value in row] for row in rows]


def json_texts(value: Any, limit: int, random: Random) -> Iterator[Damage]:
    """Yields JSON documents with one part replaced, and some that are none.

    Args:
        value: the sound document.
        limit: how many of the replacements, drawn at random.
        random: which.
    """
    yield Damage("deep", DEEP.encode())
    yield Damage("deep objects", b'{"a":' * 100_000)
    yield Damage("a list", b"[]")
    yield Damage("a text", b'"text"')
    yield Damage("null", b"null")
    yield Damage("NaN", b"NaN")
    yield Damage("single quotes", str(value).encode(errors="replace"))
    whole = json.dumps(value)
    yield Damage("a comma too many", (whole[:-1] + ",}").encode())
    yield Damage("a key twice", (whole[:-1] + "," + whole[1:]).encode())
    yield Damage("a deep part", (whole[:-1] + ',"deep":' + DEEP).encode())
    for damage, changed in replaced(value, limit, random):
        yield Damage(damage, json.dumps(changed).encode())


def replaced(value: Any, limit: int, random: Random) -> Iterator[tuple[str, Any]]:
    """Yields copies of a JSON value with one of its parts replaced or left out."""
    places = list(_places(value))
    choices = [(p, v) for p in places for v in (*VALUES, None)]
    order = random.permutation(len(choices))[:limit]
    for k in order:
        place, name = choices[k]
        copy = json.loads(json.dumps(value))
        within = copy
        for key in place[:-1]:
            within = within[key]
        where = ".".join(map(str, place))
        if name is None:
            del within[place[-1]]
            yield f"{where} missing", copy
        else:
            within[place[-1]] = VALUES[name]
            yield f"{where} is {name}", copy


def _places(value: Any) -> Iterator[tuple[Any, ...]]:
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value[:3])
        for key, part in items:
            yield (key,)
            for rest in _places(part):
                yield (key, *rest)


def yaml_texts(text: str, random: Random) -> Iterator[Damage]:
    """Yields YAML documents with tags, bombs, and single values replaced."""
    head = text.encode()
    nine = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    nine += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, 12)]
    bomb = "\n".join(nine).encode()
    yield Damage("a bomb of anchors", head + b"\n" + bomb + b"\n")
    yield Damage("only a bomb of anchors", bomb)
    yield Damage("an anchor within itself", b"a: &a [*a]\n" + head)
    yield Damage("deep", DEEP.encode())
    yield Damage(
        "deep indents", "\n".join(" " * k + "a:" for k in range(2000)).encode()
    )
    yield Damage("a tag of Python", b"!!python/object/apply:os.system ['touch canary']")
    yield Damage("a tag within", head + b"\nname: !!python/name:os.system\n")
    yield Damage("an unknown tag", b"!Unknown\n" + head)
    yield Damage("two documents", head + b"\n---\n" + head)
    yield Damage("everything twice", head + b"\n" + head)
    yield Damage("an unknown field", head + b"\nunknown: 1\n")
    yield Damage("tabs", head.replace(b"  ", b"\t"))
    yield Damage("a list", b"- 1\n- 2\n")
    yield Damage("a text", b"text\n")
    yield Damage("null", b"~\n")
    yield Damage("a comment", b"# nothing\n")
    yield Damage("a merge key", b"<<: {a: 1}\n" + head)
    values = list(
        re.finditer(r"(?<=[:\[,] )[^\s,{}\[\]#]+|(?<=\[)[^\s,{}\[\]#]+", text)
    )
    names = list(VALUES)
    for k in random.permutation(len(values) * len(names))[:60]:
        match, name = values[k // len(names)], names[k % len(names)]
        value = json.dumps(VALUES[name])
        new = text[: match.start()] + value + text[match.end() :]
        yield Damage(f"{match[0]} is {name}", new.encode(errors="surrogatepass"))


def xml_texts(text: str, random: Random) -> Iterator[Damage]:
    """Yields URDFs with entities, bombs, and single attributes replaced."""
    body = re.sub(r"<\?xml.*?\?>", "", text)
    levels = ['<!ENTITY a0 "aaaaaaaaaa">']
    levels += [f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 10)]
    doctype = f"<!DOCTYPE robot [{''.join(levels)}]>"
    at = body.index(">", body.index("<robot")) + 1
    yield Damage(
        "a bomb of entities", (doctype + body[:at] + "&a9;" + body[at:]).encode()
    )
    used = re.sub(r'name="[^"]*"', 'name="&a9;"', body, count=1)
    yield Damage("a bomb in an attribute", (doctype + used).encode())
    outer = '<!DOCTYPE robot [<!ENTITY x SYSTEM "file:///etc/passwd">]>'
    yield Damage("an outer entity", (outer + body[:at] + "&x;" + body[at:]).encode())
    deep = "<a>" * 50_000 + "</a>" * 50_000
    yield Damage("deep", (body[:at] + deep + body[at:]).encode())
    deep = "<link>" * 50_000 + "</link>" * 50_000
    yield Damage("deep links", (body[:at] + deep + body[at:]).encode())
    yield Damage("another root", body.replace("robot", "sdf").encode())
    yield Damage(
        "said to be UTF-16", b'<?xml version="1.0" encoding="utf-16"?>' + body.encode()
    )
    yield Damage(
        "said to be unknown", b'<?xml version="1.0" encoding="no"?>' + body.encode()
    )
    yield Damage("everything twice", body.replace("</robot>", body[at:]).encode())
    elements = list(re.finditer(r"<(joint|link)\b.*?</\1>", body, re.DOTALL))
    for k in random.permutation(len(elements))[:8]:
        piece = elements[k]
        name = piece[0][:40].split(">")[0]
        cut = body[: piece.start()] + body[piece.end() :]
        yield Damage(f"{name} missing", cut.encode())
        twice = body[: piece.end()] + piece[0] + body[piece.end() :]
        yield Damage(f"{name} twice", twice.encode())
    attributes = list(re.finditer(r'(\w+)="([^"]*)"', body))
    new_values = ["", "nan", "inf", "1e300", "-1", "0 0", "a b c", "nan nan nan"]
    new_values += ["1e200 0 0", "0 0 0", "10 0 0", "x" * 10_000, "a&#10;b", "&#27;[31m"]
    new_values += ["../canary", "floating", "prismatic", "mimic", "world", "٣"]
    for k in random.permutation(len(attributes) * len(new_values))[:80]:
        match = attributes[k // len(new_values)]
        value = new_values[k % len(new_values)]
        new = f"{body[: match.start(2)]}{value}{body[match.end(2) :]}"
        yield Damage(f"{match[0][:60]} is {value[:20]!r}", new.encode())


def csv_cells(text: str, random: Random) -> Iterator[Damage]:
    """Yields CSV tables with every cell of a row replaced in turn."""
    lines = text.splitlines()
    names = lines[0].split(",")
    more = ["", " ", "a\nb", '"a\nb"', "x" * 200_000, "../canary", "../../canary"]
    more += ["/tmp/loco_drake_canary", "a/../../../canary", "-5", "nan", "inf", "1e300"]
    more += ["10" * 30, "3.7", "1_0", "٣", "\x00", "\x1b[31m", '"', "trot ", " trot"]
    more += ["dog_mann", ".", "..", "~", "C:\\a", "\u202e", "=1+1", "0", "1e3", "+5"]
    for k in random.permutation(len(names) * len(more))[:120]:
        column, cell = int(k) // len(more), more[int(k) % len(more)]
        row = int(random.integers(1, len(lines)))
        cells = lines[row].split(",")
        if column >= len(cells):
            continue
        cells[column] = cell
        new = [*lines[:row], ",".join(cells), *lines[row + 1 :]]
        what = f"{names[column]} of line {row + 1} is {cell[:20]!a}"
        yield Damage(what, ("\n".join(new) + "\n").encode())
    for name in names:
        yield Damage(f"no column {name}", text.replace(name, "other", 1).encode())
    head, rows = lines[0], lines[1:]
    yield Damage("no header", ("\n".join(rows) + "\n").encode())
    yield Damage("header only", (head + "\n").encode())
    yield Damage("header twice", "\n".join([head, head, *rows]).encode())
    yield Damage("every line twice", "\n".join([head, *rows, *rows]).encode())
    yield Damage("upper case", text.upper().encode())
    yield Damage("quotes open", (text + '"dog_mann,').encode())
    yield Damage("a column twice", text.replace(names[2], names[1], 1).encode())
    yield Damage("100,000 lines", (text + (rows[0] + "\n") * 100_000).encode())
    yield Damage("spaces behind commas", text.replace(",", ", ").encode())
    yield Damage("a comment", ("# made\n" + text).encode())
