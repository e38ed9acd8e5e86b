"""Turns on the spot: what a robot sees that was switched on anywhere on a drive and looks round for
its place, as the console lets it, before it drives on."""

from __future__ import annotations

import math
from pathlib import Path

from app.episode.episode import Episode, EpisodeSettings
from app.evaluation.localisation.drives import FRAME_NS, Drive, DriveRecorder, kept
from navcore.behaviours.search_turn import RATE_RADPS
from navcore.config.navigator import NavigatorConfig
from navcore.geometry.transform import Twist
from navcore.mission.beware_list import BewareList
from sim.robot.odometry_grade import OdometryGrade
from sim.scenario.schema import Scenario

ROUND_S = 2 * math.pi / RATE_RADPS
"""Time of one turn in seconds."""
_STOP_S = 1.0
"""Time in seconds in which the robot comes to a stand."""


def kept_turn(
    folder: Path,
    world: Scenario,
    beware: BewareList,
    *,
    seed: int,
    config: NavigatorConfig,
    drive: Drive,
    start: int,
) -> Drive:
    """Return one turn of the robot where a frame of a drive of that seed was taken in a world that
    a seed has made, from its file in a folder or driven now and kept there.

    The turn is driven by hand with nearly perfect odometry: where the gate stops it, less is seen.
    """

    here = drive.true_poses[start]

    def recorded() -> Drive:
        episode = Episode(
            world,
            EpisodeSettings(
                beware=beware,
                config=config,
                odometry=OdometryGrade.IDEAL,
                start=here,
                randomised=True,
            ),
            seed=seed,
        )
        recorder = DriveRecorder(episode)
        try:
            episode.observe(_STOP_S)
            episode.drive_by_hand(Twist(v_mps=0.0, w_radps=RATE_RADPS), _STOP_S + ROUND_S)
            episode.drive_by_hand(Twist(v_mps=0.0, w_radps=0.0), 2 * _STOP_S + ROUND_S)
        finally:
            episode.close()
        return recorder.drive

    made_of = (world, beware.classes, config, seed, here)
    return kept(folder, f"{world.name}-{seed}-turn-{start}", made_of, recorded)


def turned_first(turn: Drive, drive: Drive, start: int) -> Drive:
    """Return a turn and then the drive from the frame `start` on, at which the turn was driven."""
    last, here = turn.true_poses[-1], drive.true_poses[start]
    T_turn_drive = (
        turn.by_odometry[-1] @ (last.inverse() @ here) @ drive.by_odometry[start].inverse()
    )
    later_ns = turn.stamps_ns[-1] + FRAME_NS - drive.stamps_ns[start]
    return Drive(
        stamps_ns=(*turn.stamps_ns, *(stamp + later_ns for stamp in drive.stamps_ns[start:])),
        by_odometry=(*turn.by_odometry, *(T_turn_drive @ one for one in drive.by_odometry[start:])),
        pitch_rad=turn.pitch_rad + drive.pitch_rad[start:],
        true_poses=turn.true_poses + drive.true_poses[start:],
        scans=turn.scans + drive.scans[start:],
    )
