"""One followed person: position, motion and certainty, by a Kalman filter at constant velocity."""

from __future__ import annotations

import dataclasses
import itertools
import math
from dataclasses import dataclass, field

import numpy as np

from navcore.config.perception.perception import DEFAULT_PERCEPTION, PersonTrackConfig
from navcore.geometry.arrays import Floats
from navcore.geometry.transform import IDENTITY, Pose2
from navcore.perception.people.detector import Cells, Cluster
from navcore.robot.profile import RobotProfile

_DEFAULT = DEFAULT_PERCEPTION.people.track
_STEP_M = 0.02
"""Step in metres in which the position before the robot is found."""
_KEPT_CLUSTERS = 50
"""Number of newest clusters whose cells are remembered for an object that does not walk yet."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """A person, as of the newest frame."""

    id: int
    """Number of the person, constant while the person is followed."""
    x_m: float
    """x of the middle of the body in metres; the tracker follows people in odometry's frame,
    everything after localisation has them in the map frame."""
    y_m: float
    """y of the middle of the body in metres of the same frame."""
    vx_mps: float
    """Velocity along x in metres per second of the same frame; exactly 0 for a standing person."""
    vy_mps: float
    """Velocity along y in metres per second of the same frame; exactly 0 for a standing person."""
    radius_m: float
    """Radius in metres of the disc that the person covers."""
    age_s: float
    """Time in seconds since the person was first seen."""
    last_seen_ns: int
    """Stamp in nanoseconds of the last frame that showed the person."""
    unseen_s: float = 0.0
    """Time in seconds since that frame, over which the motion is predicted."""
    walking_speed_mps: float = 0.0
    """Greatest recent walking speed in metres per second; 0 for a person who never walked."""
    stood_s: float = 0.0
    """Time in seconds for which the person has been seen to stand."""
    course_rad: float = 0.0
    """Last walking direction in radians of the map frame; meaningless for a person who never
    walked."""

    @property
    def speed_mps(self) -> float:
        """Present speed in metres per second."""
        return math.hypot(self.vx_mps, self.vy_mps)

    def is_brisk(self, brisk_share: float = _DEFAULT.brisk_share) -> bool:
        """Return whether the person walks at more than this share of the walking speed; a slower
        one is about to stop or turn."""
        return self.speed_mps > brisk_share * self.walking_speed_mps

    def placed(self, T_map_odom: Pose2) -> Track:
        """Return the track of odometry's frame in the map frame."""
        if T_map_odom == IDENTITY:
            return self
        position = T_map_odom @ Pose2(x_m=self.x_m, y_m=self.y_m, yaw_rad=self.course_rad)
        turned = Pose2(x_m=0.0, y_m=0.0, yaw_rad=T_map_odom.yaw_rad)
        vx_mps, vy_mps = turned.to_parent(np.array([self.vx_mps, self.vy_mps])).tolist()
        return dataclasses.replace(
            self,
            x_m=position.x_m,
            y_m=position.y_m,
            vx_mps=vx_mps,
            vy_mps=vy_mps,
            course_rad=position.yaw_rad,
        )

    def after(self, t_s: float) -> Track:
        """Return the track `t_s` seconds later, in which no frame has shown the person, if they
        walk on."""
        x_m, y_m = self.at(t_s)
        return dataclasses.replace(
            self, x_m=x_m, y_m=y_m, age_s=self.age_s + t_s, unseen_s=self.unseen_s + t_s
        )

    def at(self, t_s: float) -> tuple[float, float]:
        """Return (x, y) in metres of the map frame, predicted `t_s` seconds after the frame."""
        return self.x_m + t_s * self.vx_mps, self.y_m + t_s * self.vy_mps


@dataclass(slots=True)
class KalmanTrack:
    """Kalman filter at constant velocity, equal along x and y, with the evidence that the followed
    object is a person."""

    id: int
    """Number of the track."""
    first: Cluster
    """First cluster, or the first that the border of the image did not cut."""
    now_ns: int
    """Stamp in nanoseconds of the frame that it begins with."""
    non_cooperative: bool = False
    """Whether every moving object counts as a walking person, wherever it came from."""
    config: PersonTrackConfig = _DEFAULT
    """Noise, thresholds and smoothing factors."""
    x_m: float = 0.0
    """Estimated x in metres of the map frame."""
    y_m: float = 0.0
    """Estimated y in metres of the map frame."""
    vx_mps: float = 0.0
    """Estimated velocity along x in metres per second."""
    vy_mps: float = 0.0
    """Estimated velocity along y in metres per second."""
    P: Floats = field(default_factory=lambda: np.diag([0.0, 1.0]))
    """(2, 2) covariance of position and velocity along one axis."""
    cells: Cells = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))
    """(K, 2) cells of the newest cluster."""
    on_map: list[Cells] = field(default_factory=list)
    """Cells of earlier clusters that the map may show, because the object did not walk yet."""
    is_person: bool = False
    """Whether the object counts as a person."""
    person_score: float = 0.0
    """Smoothed share of images that labelled the object as a person."""
    walks: bool = False
    """Whether the person walks."""
    rest_x_m: float = 0.0
    """x in metres of the position where the person may be standing."""
    rest_y_m: float = 0.0
    """y in metres of the position where the person may be standing."""
    rested_s: float = 0.0
    """Time in seconds for which the person has been seen there."""
    on_new_floor: float = 0.0
    """Smoothed share of cells on recently seen floor."""
    before_robot: bool = False
    """Whether the person is taken to stand before the robot, too near for the camera."""
    missed_s: float = 0.0
    """Time in seconds for which the camera has looked where the person may be, and not shown
    them."""
    past_s: float = 0.0
    """Time in seconds for which depth was measured past where the person may be."""
    slow_s: float = 0.0
    """Time in seconds for which the speed has been that of a standing person."""
    radius_m: float = 0.0
    """Estimated radius in metres."""
    recent_speed_mps: float = 0.0
    """Smoothed speed in metres per second."""
    walking_speed_mps: float = 0.0
    """Slowly decaying maximum of the smoothed speed in metres per second."""
    course_rad: float = 0.0
    """Last walking direction in radians."""
    born_ns: int = 0
    """Stamp in nanoseconds of the first frame."""
    seen_ns: int = 0
    """Stamp in nanoseconds of the last frame that showed the object."""

    def __post_init__(self) -> None:
        self.x_m, self.y_m, self.born_ns = self.first.x_m, self.first.y_m, self.now_ns
        self.rest_x_m, self.rest_y_m = self.x_m, self.y_m
        self.radius_m = self.first.radius_m
        self.P[0, 0] = self._noise_m(self.first) ** 2
        self._note(self.first, self.now_ns)
        self.on_new_floor = self.first.on_new_floor

    def predict(self, step_s: float, *, lost: bool) -> None:
        """Predict the state; a person who stood when lost from sight is taken to stay there,
        whatever the last noise said."""
        if lost and self.is_person and not self.walks:
            self.vx_mps = self.vy_mps = 0.0
        self.x_m, self.y_m = self.x_m + step_s * self.vx_mps, self.y_m + step_s * self.vy_mps
        F = np.array([[1.0, step_s], [0.0, 1.0]])
        push = np.array([step_s**2 / 2, step_s])
        self.P = F @ self.P @ F.T + self.config.accel_mps2**2 * np.outer(push, push)

    def update(self, cluster: Cluster, now_ns: int) -> None:
        """Correct the state by a detection."""
        config = self.config
        step_s = (now_ns - self.seen_ns) / 1e9
        gain = self.P[:, 0] / (self.P[0, 0] + self._noise_m(cluster) ** 2)
        off_x, off_y = cluster.x_m - self.x_m, cluster.y_m - self.y_m
        self.x_m, self.y_m = self.x_m + gain[0] * off_x, self.y_m + gain[0] * off_y
        self.vx_mps, self.vy_mps = self.vx_mps + gain[1] * off_x, self.vy_mps + gain[1] * off_y
        self.P = self.P - np.outer(gain, self.P[0])
        self.on_new_floor += config.new_floor_gain * (cluster.on_new_floor - self.on_new_floor)
        if self.first.is_cut and not cluster.is_cut:
            self.first = cluster  # from here on the distance covered can be measured
        self._note(cluster, now_ns)
        speed = math.hypot(self.vx_mps, self.vy_mps)
        if not self.is_person and speed > config.walks_mps and self._course_cosine(speed) < 0.0:
            self.first = cluster  # it comes back: what it covers from here on counts
        step_s = min(step_s, config.max_step_s)
        self.slow_s = self.slow_s + step_s if speed < config.stands_mps else 0.0
        self._update_rest(step_s)
        if self.walks:
            self._update_walk(speed, step_s)
        elif self._starts_walking(speed):
            self.walks = self.is_person = True
            self.recent_speed_mps = self.walking_speed_mps = max(
                config.walks_mps, self.walking_speed_mps
            )
            self.course_rad = math.atan2(self.vy_mps, self.vx_mps)

    def stop_before(self, profile: RobotProfile, pose: Pose2) -> None:
        """Stop a person out of sight whose way leads into the robot, at a pose in the frame of the
        track: they stand before it."""
        speed = math.hypot(self.vx_mps, self.vy_mps)
        if speed == 0.0:
            return
        step_x, step_y = _STEP_M * self.vx_mps / speed, _STEP_M * self.vy_mps / speed

        def gap_m(steps: int) -> float:
            """Distance in metres to the robot so many steps back on the way."""
            at = np.array([self.x_m - steps * step_x, self.y_m - steps * step_y])
            return profile.gap_m(*pose.from_parent(at).tolist()) - self.radius_m

        if gap_m(0) >= 0.0 or gap_m(1) < gap_m(0):
            return  # not there, or walking away from it
        back = next(steps for steps in itertools.count(1) if gap_m(steps) >= 0.0)
        self.x_m, self.y_m = self.x_m - back * step_x, self.y_m - back * step_y
        self.vx_mps = self.vy_mps = 0.0
        self.before_robot = True

    def last_seen_at(self, now_ns: int) -> tuple[float, float]:
        """Return (x, y) in metres of the map frame where the object was seen last."""
        unseen_s = (now_ns - self.seen_ns) / 1e9
        return self.x_m - unseen_s * self.vx_mps, self.y_m - unseen_s * self.vy_mps

    def track(self, now_ns: int) -> Track:
        """Return the state as a value; a standing person has no velocity."""
        config, unseen_s = self.config, (now_ns - self.seen_ns) / 1e9
        spread_m = min(config.spread_mps * unseen_s, config.max_spread_m) if self.walks else 0.0
        return Track(
            id=self.id,
            x_m=self.x_m,
            y_m=self.y_m,
            vx_mps=self.vx_mps if self.walks else 0.0,
            vy_mps=self.vy_mps if self.walks else 0.0,
            radius_m=self.radius_m + spread_m,
            age_s=(now_ns - self.born_ns) / 1e9,
            last_seen_ns=self.seen_ns,
            unseen_s=unseen_s,
            walking_speed_mps=self.walking_speed_mps,
            stood_s=self.rested_s,
            course_rad=self.course_rad,
        )

    def _update_rest(self, step_s: float) -> None:
        moved_m = math.hypot(self.x_m - self.rest_x_m, self.y_m - self.rest_y_m)
        if moved_m < self.config.rest_radius_m:
            self.rested_s += step_s
        else:
            self.rest_x_m, self.rest_y_m, self.rested_s = self.x_m, self.y_m, 0.0

    def _update_walk(self, speed: float, step_s: float) -> None:
        config = self.config
        self.recent_speed_mps += config.speed_gain * (speed - self.recent_speed_mps)
        self.walking_speed_mps = max(
            self.walking_speed_mps - config.slows_mps2 * step_s, self.recent_speed_mps
        )
        self.walks = self.slow_s < config.stands_s
        if speed > config.brisk_share * self.walking_speed_mps:
            self.course_rad = math.atan2(self.vy_mps, self.vx_mps)

    def _note(self, cluster: Cluster, now_ns: int) -> None:
        config = self.config
        self.seen_ns, self.cells, self.before_robot = now_ns, cluster.cells, False
        self.radius_m += config.width_gain * (cluster.radius_m - self.radius_m)
        vote = float(cluster.labelled > config.min_labelled)
        self.person_score += config.score_gain * (vote - self.person_score)
        limit = config.no_person_score if self.is_person else config.person_score
        self.is_person = self.walking_speed_mps > 0 or self.person_score > limit
        if not self.walks:
            self.on_map = [*self.on_map[1 - _KEPT_CLUSTERS :], cluster.cells]

    def _starts_walking(self, speed: float) -> bool:
        """Return whether the object can only be a walking person: it moves, it came where floor
        was, and it came in the direction of its velocity."""
        config = self.config
        if self.is_person:
            moved_m = math.hypot(self.x_m - self.rest_x_m, self.y_m - self.rest_y_m)
            return speed > config.walks_mps and (
                speed > 2 * math.sqrt(self.P[1, 1]) or moved_m > config.moved_m
            )
        return (
            (self.on_new_floor > config.min_new_floor or self.non_cooperative)
            and speed > config.walks_mps
            and self._course_cosine(speed) > config.min_course_cosine
        )

    def _course_cosine(self, speed: float) -> float:
        """Return the cosine of the angle between the velocity, of a speed above 0, and the way from
        the first position; 0 where that is no farther than noise may put it."""
        dx_m, dy_m = self.x_m - self.first.x_m, self.y_m - self.first.y_m
        moved_m = math.hypot(dx_m, dy_m)
        if moved_m <= max(self.config.moved_m, 3 * self._noise_m(self.first)):
            return 0.0
        return (dx_m * self.vx_mps + dy_m * self.vy_mps) / (moved_m * speed)

    def _noise_m(self, cluster: Cluster) -> float:
        """Return the standard deviation in metres of the position of a cluster, which grows with
        the square of the distance as the scatter of stereo depth."""
        config = self.config
        cut_m = config.cut_noise_m if cluster.is_cut else 0.0
        return config.position_noise_m + config.position_noise_per_m * cluster.range_m**2 + cut_m
