from concurrent.futures import ThreadPoolExecutor

import pytest

from loco_drake.models.meshes import convert_meshes


@pytest.fixture(scope="session")
def mesh_cache(tmp_path_factory):
    """An empty cache into which two converters have written at the same time."""
    cache = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("LOCO_DRAKE_CACHE", str(cache))
        with ThreadPoolExecutor(2) as pool:
            folders = list(pool.map(lambda _: convert_meshes(), range(2)))
        assert folders == [cache / "meshes"] * 2
        yield cache
