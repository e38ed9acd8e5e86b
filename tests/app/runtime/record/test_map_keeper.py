"""The map on disk: no snapshot is lost between the thread that copies and the one that writes."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.runtime.record.map_keeper import MapKeeper
from navcore.config.mapping import MappingConfig
from navcore.errors import StorageFailed
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


def test_what_a_correction_moves_is_stored_once_the_map_that_was_copied_with_it_is_written(
    tmp_path: Path,
) -> None:
    kept, cloud = tmp_path / "kept.map", PointMap(SPEC, MappingConfig())
    keeper, copies, stored = MapKeeper(kept, NO_NAMES), list[int](), list[int]()

    def copy_rest() -> Callable[[], None]:
        copies.append(len(copies))
        number = copies[-1]
        return lambda: stored.append(number)

    keeper.copy_rest = copy_rest
    keeper.note_tick(cloud, NO_NAMES, 0)
    keeper.note_correction()
    keeper.note_tick(cloud, NO_NAMES, 1)
    assert keeper.is_behind and not copies, "the map of before is still to be written"
    keeper._write()
    assert keeper.is_behind and not stored
    keeper.note_tick(cloud, NO_NAMES, 2)  # long before the next look at a map that changes
    keeper.note_correction()
    keeper._write()
    assert keeper.is_behind and stored == [0], "the newer correction is not on the disk"
    keeper.note_tick(cloud, NO_NAMES, 3)
    keeper._write()
    assert not keeper.is_behind and stored == [0, 1]


def test_a_map_is_written_again_with_what_could_not_be_stored_beside_it(tmp_path: Path) -> None:
    kept, cloud = tmp_path / "kept.map", PointMap(SPEC, MappingConfig())
    keeper, tries = MapKeeper(kept, NO_NAMES), list[bool]()

    def store() -> None:
        tries.append(True)
        if len(tries) == 1:
            raise StorageFailed("the disk is full")

    keeper.copy_rest = lambda: store
    keeper.note_correction()
    keeper.note_tick(cloud, NO_NAMES, 0)
    with pytest.raises(StorageFailed):
        keeper._write()
    assert keeper.is_behind
    keeper._write()
    assert not keeper.is_behind and len(tries) == 2
