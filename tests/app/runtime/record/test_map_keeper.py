"""The map on disk: no snapshot is lost between the thread that copies and the one that writes."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.runtime.record.map_keeper import MapKeeper
from navcore.config.mapping import MappingConfig
from navcore.mapping.point_map import PointMap
from navcore.mapping.storage import map_file
from navcore.mapping.storage.map_file import load
from tests.app.runtime.record.test_map_persistence import observe_scene
from tests.navcore.scene import SPEC, Paint

NO_NAMES: dict[int, str] = {}


class Interrupted(MapKeeper):
    """A keeper into whose forgetting of a snapshot another thread steps."""

    def interrupt(self, act: Any) -> None:
        self.thread = threading.Thread(target=act)

    def __setattr__(self, name: str, value: Any) -> None:
        if (
            name == "_waiting"
            and value is None
            and hasattr(self, "thread")
            and not self.thread.ident
        ):
            self.thread.start()
            self.thread.join(0.1)  # it ends before only where nothing keeps it out
        super().__setattr__(name, value)


def test_a_snapshot_that_is_copied_while_the_one_before_is_done_with_is_kept(
    tmp_path: Path,
) -> None:
    kept, cloud = tmp_path / "kept.map", PointMap(SPEC, MappingConfig())
    keeper = Interrupted(kept, NO_NAMES)
    keeper.note_tick(cloud, NO_NAMES, 0)
    observe_scene(cloud, Paint(x=(1.5, 2.0), y=(-0.3, 0.3)))
    keeper.interrupt(lambda: keeper._copy(cloud, NO_NAMES))
    keeper._write()
    keeper.thread.join()
    assert not len(load(kept).state.points.pose_ids)
    keeper._write()
    np.testing.assert_array_equal(load(kept).state.points.pose_ids, cloud.state().points.pose_ids)
    assert len(cloud.state().points.pose_ids)


def test_a_map_that_is_too_large_is_given_up_and_the_next_one_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept, cloud = tmp_path / "kept.map", PointMap(SPEC, MappingConfig())
    keeper = MapKeeper(kept, NO_NAMES)
    keeper.note_tick(cloud, NO_NAMES, 0)
    with monkeypatch.context() as small:
        small.setattr(map_file, "MAX_BYTES", 10)
        with pytest.raises(map_file.MapTooLarge):
            keeper._write()
    observe_scene(cloud, Paint(x=(1.5, 2.0), y=(-0.3, 0.3)))
    keeper.note_tick(cloud, NO_NAMES, 10**12)
    keeper._write()
    assert len(load(kept).state.points.pose_ids)


@pytest.mark.parametrize("how", ["by the thread", "as an operator asks for it"])
def test_why_the_map_is_not_kept_is_told_until_it_is(tmp_path: Path, how: str) -> None:
    blocked, cloud = tmp_path / "file", PointMap(SPEC, MappingConfig())
    blocked.write_text("no folder")
    keeper = MapKeeper(blocked / "kept.map", NO_NAMES)
    assert keeper.failure is None
    keeper.note_tick(cloud, NO_NAMES, 0)
    for _ in range(2):
        keeper._write_logged()
        assert keeper.failure is not None and "kept.map" in keeper.failure
    blocked.unlink()
    if how == "by the thread":
        keeper._write_logged()
    else:

        def edit_map(edit: Any) -> None:
            edit(cloud)
            keeper.note_tick(cloud, NO_NAMES, 1)

        keeper.write_now(edit_map)
    assert keeper.failure is None and (blocked / "kept.map").exists()


def test_any_failure_of_a_write_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise MemoryError("no memory")

    keeper = MapKeeper(tmp_path / "kept.map", NO_NAMES)
    keeper.note_tick(PointMap(SPEC, MappingConfig()), NO_NAMES, 0)
    monkeypatch.setattr(map_file, "save", fail)
    with pytest.raises(MemoryError):
        keeper._write_logged()
    assert keeper.failure == "no memory"
