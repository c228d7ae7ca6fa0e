import hashlib
import re
from collections import Counter

from loco_drake.datasets.download import MANIFEST, files_by_source, read_manifest
from loco_drake.datasets.registry import DATASETS
from loco_drake.datasets.segments import SHIPPED, read_rows
from loco_drake.motion.gaits import LABELS


def test_shipped_manifest_names_each_file_once_with_commit_and_checksum():
    files = read_manifest(MANIFEST)
    assert Counter(file.name.split("/")[0] for file in files) == {
        "dog_mann": 21,
        "horse_vhdc": 96,
        "mpc_rfmpc": 41,
        "solo8_cassi": 168,
    }
    assert len({file.name for file in files}) == len(files)
    assert len({file.sha256 for file in files}) == len(files)
    for file in files:
        assert re.fullmatch(r"[0-9a-f]{64}", file.sha256)
        assert file.size > 0
        assert not {"", ".", ".."} & set(file.name.split("/"))


def test_address_is_that_of_the_content_at_a_commit():
    file = read_manifest(MANIFEST)[3]
    assert file.name == "dog_mann/keypoints/dog_run00.txt"
    assert file.url == (
        "https://raw.githubusercontent.com/luliuxxx/LearnDiverseLoco/"
        "142ca0357540aefc1bc8bccef4155799519e13f3/"
        "motion_retarget/datasets/dog_mocap/data/dog_run00.txt"
    )


def test_shipped_manifest_describes_the_real_recordings(real_data):
    """As far as the folder has them."""
    files = [f for f in read_manifest(MANIFEST) if (real_data / f.name).exists()]
    assert files
    for file in files:
        content = (real_data / file.name).read_bytes()
        assert len(content) == file.size, file.name
        assert hashlib.sha256(content).hexdigest() == file.sha256, file.name


def test_each_source_that_can_be_read_can_be_fetched():
    assert list(files_by_source()) == list(DATASETS)
    for source, files in files_by_source().items():
        assert {file.name.split("/")[0] for file in files} == {DATASETS[source].folder}


def test_shipped_segments_are_of_files_in_the_manifest_and_cover_the_labels():
    rows = read_rows(SHIPPED)
    names = {file.name for file in read_manifest(MANIFEST)}
    assert {f"{row['dataset']}/{row['file']}" for row in rows} <= names
    gaits = {f"{row['dataset'].split('_')[0]}-{row['gait']}" for row in rows}
    assert gaits >= {str(label) for label in LABELS}


def test_shipped_segments_are_those_of_the_real_recordings(real_data):
    """As far as both tables speak of the same files."""
    shipped, real = read_rows(SHIPPED), read_rows(real_data / "segments.csv")
    common = {row["file"] for row in shipped} & {row["file"] for row in real}
    assert common
    of_common = [[r for r in rows if r["file"] in common] for rows in (shipped, real)]
    assert of_common[0] == of_common[1]
