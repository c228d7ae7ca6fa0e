"""Replays that share what they have in common."""

from loco_drake.evaluation.report.page import share_pieces


def test_pages_come_back_whole_and_common_parts_are_kept_once():
    mesh = "x" * 100_000
    pages = [f"<a>\n{mesh}\nfirst\n", f"<a>\n{mesh}\nsecond", f"id1{mesh}", ""]
    shared = share_pieces(pages)
    pieces = shared["pieces"]
    made = ["".join(pieces[i] for i in page) for page in shared["pages"]]
    assert made == pages
    assert len(set(pieces)) == len(pieces)
    assert sum(map(len, pieces)) < 10_000
