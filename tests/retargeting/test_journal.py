"""A run of retarget that was stopped goes on, and does nothing twice."""

import os
from itertools import islice

import pytest

from loco_drake.common.errors import InputError
from loco_drake.datasets.segments import read_segments
from loco_drake.datasets.split import Split
from loco_drake.models.robots import get_robot
from loco_drake.retargeting import retarget
from loco_drake.retargeting.journal import JOURNAL, Journal, settings_of
from loco_drake.retargeting.retarget import retarget_segments
from loco_drake.retargeting.scaling import AS_RECORDED, Variant

SETTINGS = settings_of(get_robot("go2"), AS_RECORDED)


@pytest.fixture
def segments(made_data):
    return read_segments(made_data)[:3]


@pytest.fixture
def run(segments, tmp_path, monkeypatch):
    """Retargets some of the segments; returns outcomes, and the names of those done."""
    done = []
    made = retarget.SegmentRetargeter.__call__

    def count(self, segment):
        done.append(segment.name)
        return made(self, segment)

    monkeypatch.setattr(retarget.SegmentRetargeter, "__call__", count)
    split = Split(segments)

    def go(count=None, *, resume=True, settings=SETTINGS):
        done.clear()
        out = tmp_path / "out"
        journal = Journal(out, settings, split, resume=resume)
        outcomes = retarget_segments(
            segments, get_robot("go2"), out, split, journal=journal
        )
        return list(islice(outcomes, count)), list(done)

    return go


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.glob("*.npz")}


def test_only_what_is_missing_is_done_and_all_is_told(run, segments, tmp_path):
    names = [segment.name for segment in segments]
    assert len(names) == 3
    before, done = run(2, resume=False)
    assert done[:2] == names[:2]
    kept = contents(tmp_path / "out")
    outcomes, done = run()
    assert done == names[2:]
    assert [outcome.segment.name for outcome in outcomes] == names
    assert [o.report for o in outcomes[:2]] == [o.report for o in before]
    assert kept.items() <= contents(tmp_path / "out").items()
    whole = contents(tmp_path / "out")
    assert run()[1] == []
    assert run(resume=False)[1] == names
    assert contents(tmp_path / "out") == whole


def test_what_was_changed_or_torn_is_done_again(run, segments, tmp_path):
    names = [segment.name for segment in segments]
    run(resume=False)
    out = tmp_path / "out"
    (out / f"{names[0]}.npz").unlink()
    assert run()[1] == names[:1]
    with (out / f"{names[1]}.npz").open("ab") as file:
        file.write(b"more")
    assert run()[1] == names[1:2]
    moment = segments[2].path.stat().st_mtime_ns + 10**9
    os.utime(segments[2].path, ns=(moment, moment))
    assert run()[1] == names[2:]
    journal = out / JOURNAL
    journal.write_bytes(journal.read_bytes()[:-30])  # a kill
    assert run()[1] == names[2:]
    run(resume=False)
    whole = journal.read_bytes()
    journal.write_bytes(whole.replace(b'"frames": 200', b'"frames": 201', 1))
    assert run()[1] == names[:1]
    assert run()[1] == []


def test_other_settings_and_no_run_are_refused(run, tmp_path):
    with pytest.raises(InputError, match="No run of retarget"):
        run()
    run(1, resume=False)
    mirrored = settings_of(get_robot("go2"), Variant(mirror=True))
    with pytest.raises(InputError, match="with other mirror;"):
        run(settings=mirrored)
    a1 = settings_of(get_robot("a1"), AS_RECORDED)
    with pytest.raises(InputError, match="with other robot;"):
        run(settings=a1)
    (tmp_path / "out" / JOURNAL).write_bytes(b"\xff")
    with pytest.raises(InputError, match="No run of retarget"):
        run()
