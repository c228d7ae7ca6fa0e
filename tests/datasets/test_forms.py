"""Forms in which right recordings and tables come, and ways in which they lie."""

import re

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.datasets import download
from loco_drake.datasets.download import read_manifest
from loco_drake.datasets.registry import read_clip
from loco_drake.datasets.segments import read_segments
from tests.synthetic_bvh import write_dog_bvh
from tests.synthetic_horse import make_horse, write_raw_recording

BOM = "\N{ZERO WIDTH NO-BREAK SPACE}"
TABLES = {
    "byte order mark": lambda text: (BOM + text).encode(),
    "UTF-16": lambda text: text.encode("utf-16"),
    "UTF-16 big-endian": lambda text: (BOM + text).encode("utf-16-be"),
    "carriage returns and line feeds": lambda text: text.replace("\n", "\r\n").encode(),
    "carriage returns": lambda text: text.replace("\n", "\r").encode(),
    "semicolons": lambda text: text.replace(",", ";").encode(),
    "spaces behind commas": lambda text: text.replace(",", ", ").encode(),
    "blank lines at the end": lambda text: (text + "\n  \n\n").encode(),
    "empty rows at the end": lambda text: f"{text},,,,,\n,,,,,\n".encode(),
    "quoted cells": lambda text: re.sub(r"([^,\n]+)", r'"\1"', text).encode(),
}


@pytest.mark.parametrize("form", TABLES)
def test_table_as_spreadsheets_write_it_reads_the_same(form, tmp_path):
    """The horse's with its header, and the list of stretches."""
    path = tmp_path / "Horse1_M1_walk1.csv"
    write_raw_recording(path, make_horse("walk", 60.0))
    right = read_clip("horse", path, gait="walk")
    path.write_bytes(TABLES[form](path.read_text().replace('"', "")))
    np.testing.assert_array_equal(
        read_clip("horse", path, gait="walk").toes, right.toes
    )

    rows = "dataset,file,gait,start_frame,end_frame,fps\ndog_mann,a.txt,trot,0,99,60\n"
    (tmp_path / "segments.csv").write_bytes(TABLES[form](rows))
    (segment,) = read_segments(tmp_path)
    assert segment.name == "dog-trot-a-0-99"
    assert segment.path == tmp_path / "dog_mann" / "a.txt"


def namespace(text):
    return re.sub(r"(ROOT|JOINT) ", r"\1 dog:", text)


def ear(text):
    """A joint more, with an end site, before the skull's own."""
    lines = ["JOINT Ear", "{", "OFFSET 0 5 0", "CHANNELS 0", "End Site", "{"]
    lines += ["OFFSET 0 5 0", "}", "}"]
    return text.replace("JOINT Head", "\n".join([*lines, "JOINT Head"]))


def wrist(text):
    """A joint between forearm and paw."""
    text = text.replace(
        "JOINT LeftHand", "JOINT Wrist\n{\nOFFSET 0 0 0\nCHANNELS 0\nJOINT LeftHand"
    )
    return re.sub(r"(?s)(JOINT LeftHand.*?End Site.*?\}\s*\})", r"\1\n}", text)


def children_reversed(text):
    """The children of each joint, and their columns, from last to first."""
    head, _, motion = text.replace("\r", "").partition("MOTION\n")
    lines = [line.strip() for line in head.splitlines()[1:]]
    count = 0

    def joint():
        nonlocal count
        own, columns, children = [lines.pop(0), lines.pop(0)], [], []
        while lines[0] != "}":
            if lines[0].startswith(("JOINT", "End")):
                children.append(joint())
                continue
            own.append(lines.pop(0))
            if own[-1].startswith("CHANNELS"):
                channels = int(own[-1].split()[1])
                columns, count = list(range(count, count + channels)), count + channels
        for inner, of_inner in reversed(children):
            own, columns = own + inner, columns + of_inner
        return [*own, lines.pop(0)], columns

    skeleton, columns = joint()
    frames, step, *rows = motion.splitlines()
    rows = [" ".join(row.split()[k] for k in columns) for row in rows]
    return "\n".join(["HIERARCHY", *skeleton, "MOTION", frames, step, *rows])


FORMS = {
    "children reversed": children_reversed,
    "namespace": namespace,
    "upper case": str.upper,
    "lower case": str.lower,
    "one space": lambda text: re.sub(r"\n +", "\n ", text),
    "tabs": lambda text: text.replace("  ", "\t"),
    "brace on the same line": lambda text: re.sub(r"\s+\{", " {", text),
    "ear": ear,
    "wrist": wrist,
    "exponent": lambda text: text.replace("0.0166667", "1.66667e-02"),
    "spaces in the label": lambda text: text.replace("Frame Time:", "FRAME  TIME :"),
    "byte order mark": lambda text: BOM + text,
}


@pytest.mark.parametrize("form", FORMS)
def test_bvh_in_another_form_reads_the_same(form, tmp_path):
    path = tmp_path / "a.bvh"
    write_dog_bvh(path, "trot", seconds=1.0)
    right = read_clip("dog", path, gait="trot")
    text = FORMS[form](path.read_text())
    assert text != path.read_text()
    path.write_text(text)
    clip = read_clip("dog", path, gait="trot")
    np.testing.assert_array_equal(clip.toes, right.toes)
    np.testing.assert_array_equal(clip.withers, right.withers)


DAMAGED_TABLES = {
    "no stretch": ("0,99,60", "99,99,60", "line 2 .* Frames 99 to 99"),
    "negative": ("0,99,60", "-5,99,60", "line 2 .* Frames -5 to 99"),
    "no number": ("0,99,60", "a,99,60", "line 2 has frames or a rate"),
    "rate": ("0,99,60", "0,99,1e9", "line 2 .* 10 to 1000"),
    "above the folder": ("a.txt", "../../a.txt", "line 2 names no file inside"),
    "absolute": ("a.txt", "/etc/passwd", "line 2 names no file inside"),
    "drive": ("a.txt", "C:a.txt", "line 2 names no file inside"),
    "backslash": ("a.txt", r"..\a.txt", "line 2 names no file inside"),
    "gait with a slash": ("trot", "../trot", "line 2 .* no slash"),
    "gait of a thousand letters": ("trot", "t" * 1000, "line 2 .* 64"),
    "endless cell": ("a.txt", "a" * 200_000, "is not a CSV table"),
    "repeated": ("60\n", "60\ndog_mann,a.txt,trot,0,99,60\n", "3 repeats line 2"),
    "unknown": ("dog_mann", "cat", "line 2 is of another dataset than dog_mann"),
    "missing cell": (",60\n", ",\n", "line 2 lacks fps"),
    "too many cells": (",60\n", ",60,,\n", "line 2 has more cells"),
    "missing column": ("gait,", "gate,", "line 1 lacks gait"),
    "binary": ("trot", "tr\0t", "not plain text"),
}


@pytest.mark.parametrize("how", DAMAGED_TABLES)
def test_row_that_cannot_be_is_refused_with_its_line(how, tmp_path):
    rows = "dataset,file,gait,start_frame,end_frame,fps\ndog_mann,a.txt,trot,0,99,60\n"
    old, new, reason = DAMAGED_TABLES[how]
    (tmp_path / "segments.csv").write_text(rows.replace(old, new, 1))
    with pytest.raises(InputError, match=reason) as error:
        read_segments(tmp_path)
    assert len(str(error.value)) < 500


DAMAGED_MANIFESTS = {
    "above the folder": ("dog_mann/bvh/", "../../"),
    "within, then above": ("dog_mann/bvh/", "dog_mann/../../"),
    "absolute": ("dog_mann/bvh/", "/tmp/"),
    "drive": ("dog_mann/bvh/", "C:/"),
    "backslash": ("dog_mann/bvh/", "..\\"),
    "control character": ("dog_mann/bvh/", "dog\x07"),
    "no name": ("dog_mann/bvh/D1_007_KAN01_001__dog_walk00.bvh", ""),
    "no commit": ("142ca0357540aefc1bc8bccef4155799519e13f3", "main"),
    "other host": ("luliuxxx/", "https://x/"),
    "no size": ("338195", "-1"),
    "no checksum": ("99fad4469d3e8f35", ""),
    "missing cell": ("338195,", ""),
    "too many cells": ("338195", "338195,1"),
    "missing column": ("sha256", "md5"),
    "endless cell": ("dog_walk00", "a" * 200_000),
}


@pytest.mark.parametrize("how", DAMAGED_MANIFESTS)
def test_manifest_that_cannot_be_is_refused_with_its_line(how, tmp_path):
    lines = download.MANIFEST.read_text().splitlines(keepends=True)[:3]
    path = tmp_path / "manifest.csv"
    path.write_text("".join(lines))
    assert len(read_manifest(path)) == 2
    path.write_text("".join(lines).replace(*DAMAGED_MANIFESTS[how], 1))
    with pytest.raises(InputError, match=r"line \d+ is damaged"):
        read_manifest(path)
    path.write_text("".join([*lines, lines[1]]))
    with pytest.raises(InputError, match=r"line 4 .* a second time"):
        read_manifest(path)
