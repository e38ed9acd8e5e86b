"""Maps that are loaded at the start: the robot's own, with its class names, and a prior map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.runtime.record.map_persistence import load_map, save_map
from navcore.config.mapping import MappingConfig
from navcore.config.perception.perception import ObservationConfig
from navcore.costmap.costmap import layer_grid
from navcore.errors import BadConfiguration
from navcore.formats.nav2_map import map_from_cells
from navcore.grid.grid import GridSpec
from navcore.grid.growth import growth_to
from navcore.mapping.point_map import PointMap
from navcore.mapping.storage.map_file import load
from navcore.mapping.views.observation import observe
from navcore.mission.beware_list import BewareList
from navcore.perception.colour_segmenter import ColourSegmenter
from tests.navcore.formats.stored import save
from tests.navcore.scene import RED_ID, RED_LIST, SPEC, Paint, picture

EMPTY = BewareList(classes=())


def observe_scene(cloud: PointMap, *things: Paint) -> None:
    frame = picture(*things)
    labels = ColourSegmenter().segment(frame, RED_LIST)
    cloud.insert(observe(frame, labels, RED_LIST, cloud.spec, ObservationConfig()), frame, labels)


def test_a_class_removed_from_the_list_keeps_its_name_on_the_map_and_can_be_restored(
    tmp_path: Path,
) -> None:
    kept = tmp_path / "kept.map"
    cloud = PointMap(SPEC, MappingConfig())
    observe_scene(cloud, Paint(x=(1.5, 2.0), y=(-0.3, 0.3)))
    save_map(cloud, RED_LIST, kept)
    for beware in (EMPTY, RED_LIST):
        again = PointMap(SPEC, MappingConfig())
        load_map(again, beware, prior=None, kept=kept)
        save_map(again, beware, kept)
        assert load(kept).class_names[RED_ID] == "red floor"
    never_kept = tmp_path / "other.map"
    save_map(cloud, RED_LIST.replaced(()), never_kept)
    assert load(never_kept).class_names == {RED_ID: "red floor"}
    assert layer_grid(again, RED_LIST, ()).beware[RED_ID].any()


def test_an_obstacle_of_the_prior_map_that_was_seen_to_be_gone_stays_gone(
    tmp_path: Path,
) -> None:
    before = np.zeros((SPEC.rows, SPEC.cols), dtype=np.bool_)
    row, col = SPEC.cell(2.0, 0.0)
    before[row, col] = True  # in view of the camera, which sees free floor
    before[row, 3] = True  # behind it
    save(
        map_from_cells(occupied=before, known=np.ones_like(before), spec=SPEC),
        tmp_path / "prior.yaml",
    )
    for session in range(2):
        cloud = PointMap(SPEC, MappingConfig())
        load_map(cloud, EMPTY, prior=tmp_path / "prior.yaml", kept=tmp_path / "kept.map")
        assert layer_grid(cloud, EMPTY, ()).geometric[row, col] == (session == 0)
        assert layer_grid(cloud, EMPTY, ()).geometric[row, 3]
        observe_scene(cloud)
        assert not layer_grid(cloud, EMPTY, ()).geometric[row, col]
        save_map(cloud, EMPTY, tmp_path / "kept.map")


def test_a_map_that_had_grown_and_a_prior_map_beyond_it_are_loaded_as_a_whole(
    tmp_path: Path,
) -> None:
    grown, growth = PointMap(SPEC, MappingConfig()), growth_to(SPEC, (-5, 0, 1, SPEC.cols + 300))
    assert growth is not None
    grown.grow(growth)
    observe_scene(grown, Paint(x=(1.5, 2.0), y=(-0.3, 0.3)))
    save_map(grown, RED_LIST, tmp_path / "kept.map")
    far = SPEC.part(0, 0, SPEC.rows, SPEC.cols + 700)
    before = np.zeros((far.rows, far.cols), dtype=np.bool_)
    before[3, far.cols - 1] = True
    save(
        map_from_cells(occupied=before, known=np.ones_like(before), spec=far),
        tmp_path / "prior.yaml",
    )
    cloud = PointMap(SPEC, MappingConfig())
    load_map(cloud, RED_LIST, prior=tmp_path / "prior.yaml", kept=tmp_path / "kept.map")
    layers, spec = layer_grid(cloud, RED_LIST, ()), cloud.spec
    assert spec.rows == SPEC.rows + 256 and spec.cols == SPEC.cols + 3 * 256
    assert layers.geometric[spec.cell(*far.centre(3, far.cols - 1))]
    was = layer_grid(grown, RED_LIST, ()).beware[RED_ID]
    assert was.any()
    np.testing.assert_array_equal(layers.beware[RED_ID][: was.shape[0], : was.shape[1]], was)
    assert len(cloud.points.points_map) == len(grown.points.points_map)


def test_a_map_of_another_world_is_refused(tmp_path: Path) -> None:
    other = GridSpec.centred(size_m=(10.0, 10.0), resolution_m=0.1)
    save_map(PointMap(other, MappingConfig()), RED_LIST, tmp_path / "kept.map")
    with pytest.raises(BadConfiguration, match="begins with"):
        load_map(PointMap(SPEC, MappingConfig()), EMPTY, prior=None, kept=tmp_path / "kept.map")
