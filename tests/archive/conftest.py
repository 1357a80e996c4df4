from __future__ import annotations

import pytest
from tests.archive import packing


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """A project whose study is done, and the study; nobody changes it."""
    folder = packing.project(tmp_path_factory.mktemp("finished"))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        planned = packing.plan(folder)
        packing.make(planned, folder)
    return folder, planned
