"""Starts on a saved map, and what searches of the whole map tell of them."""

from __future__ import annotations

import numpy as np

from navcore.config.localisation.localisation import LocalisationConfig, StartConfig
from navcore.geometry.transform import IDENTITY, Pose2
from navcore.localisation.estimate import LocalisationEstimate
from navcore.localisation.localisation import Localisation
from navcore.localisation.relocalisation.place_fit import PlaceFit
from navcore.localisation.relocalisation.relocalisation import SearchResult, SearchTask
from navcore.localisation.scans.scan import Keyframe, Scan
from navcore.localisation.tracking.localiser import Localiser
from navcore.mapping.points.pose_ids import PoseIds
from navcore.robot.profile import HUSKY
from tests.navcore.localisation.plan_worlds import drive, office, room_doors
from tests.navcore.localisation.tracking.test_localiser import frame_at

RULES = StartConfig()
MANY, FEW = RULES.telling_points, RULES.telling_points - 1
WORLD = office(3)
ROUTE = drive([(1.5, 0.0), (9.0, 0.0)])
DOOR_M, SIDE, DEPTH_M = room_doors(3)[1]
INTO_ROOM = drive([(1.5, 0.0), (DOOR_M, 0.0), (DOOR_M, SIDE * (DEPTH_M - 0.5))])


def kept_map() -> tuple[PoseIds, tuple[Keyframe, ...]]:
    """The map of the route, and its poses."""
    rng, ids = np.random.default_rng(1), PoseIds(0.25, 10.0)
    maker = Localiser(ids)
    for k, pose in enumerate(INTO_ROOM):
        maker.follow(frame_at(pose, k), WORLD.scan(pose, rng))
    ids.freeze()
    return ids, maker.keyframes


def fit(
    score: float = 0.8,
    *,
    x_m: float = 0.0,
    yaw_deg: float = 0.0,
    share: float = 0.9,
    clear: float = 0.0,
    walls: float = 0.0,
    sigma_m: float = 1.0,
) -> PlaceFit:
    return PlaceFit(
        T_map_base=Pose2(x_m=x_m, y_m=0.0, yaw_rad=np.radians(yaw_deg)),
        covariance=sigma_m**2 * np.eye(3),
        evidence=score - 3.0 * clear - walls,
        score=score,
        fit_share=share,
        through_walls_share=walls,
        contradicted_share=clear,
    )


def search_result(
    given: PlaceFit | None,
    *others: PlaceFit,
    mirrored: tuple[PlaceFit, ...] = (),
    unmoved: PlaceFit | None = None,
    count: int = MANY,
) -> SearchResult:
    views = ((IDENTITY, WORLD.scan(ROUTE[0], np.random.default_rng(0))),)
    task = SearchTask(everything=views, recent=views)
    found = (*others, *(() if given is None else (given,)))
    return SearchResult(
        task=task,
        points=count,
        everything=found,
        newest=None,
        again=None,
        mirrored=mirrored,
        given=given,
        moved=given,
        unmoved=unmoved,
    )


def started(last: Pose2 | None = None) -> tuple[Localisation, Scan, LocalisationEstimate]:
    """A robot whose place in the kept map the first looks have confirmed, its scan there, and the
    newest estimate."""
    ids, keyframes = kept_map()
    localisation = Localisation(ids, LocalisationConfig(), HUSKY.depth_sensor)
    localisation.load(keyframes, last)
    scan = WORLD.scan(ROUTE[40], np.random.default_rng(2))
    for k in range(10):
        before = localisation.follow(frame_at(ROUTE[40], k), scan)
    assert before.is_known
    return localisation, scan, before
