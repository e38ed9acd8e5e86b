"""A robot at its sites, for tests of them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from tests.app.console.site.desk import Desk
from tests.navcore.scene import RED_LIST


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    opened = Desk(tmp_path)
    with closing(opened.store):
        opened.tick()
        opened.sites.make("hall")
        opened.store.sites.open("hall").save_beware(RED_LIST)
        yield opened
