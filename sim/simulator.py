"""The simulated robot: physics, motor controller, sensors, people and referee behind the driver
interface of every robot.

It is stepped from outside and reads no clock: time advances by 1/240 s in each `step`, and only
there.
"""

from __future__ import annotations

from types import TracebackType

import numpy as np
import numpy.typing as npt

from navcore.errors import BadConfiguration
from navcore.geometry.transform import Pose2, Twist
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY, RobotProfile
from sim.bullet import pybullet
from sim.models.ground import Ground
from sim.physics.build import Crowd, build_world
from sim.quiet import quiet_output
from sim.referee.referee import Referee
from sim.rendering.visible_world import Image
from sim.robot.chassis import chassis_for
from sim.robot.odometry import Gyro, Odometry
from sim.robot.odometry_grade import ODOMETRY_ERRORS, OdometryGrade, odometry_grade
from sim.robot.skid_steer import GRAVITY_MPS2, Driver, SkidSteer, pose_of
from sim.scenario.schema import Scenario
from sim.scenario.validation import check_standing, started_at
from sim.scenario.variation import Source, generator, randomise
from sim.sensors.camera import Camera
from sim.sensors.faults import Fault, FaultSchedule
from sim.sensors.gnss import GnssReceiver
from sim.sensors.gnss_settings import GnssKind, carried
from sim.sensors.imu import Accelerometer
from sim.sensors.laser_scanner import LaserScanner
from sim.sensors.stereo_noise import StereoErrors

STEPS_PER_S = 240
PERIOD_S = 1 / STEPS_PER_S
SETTLING_STEPS = 60
"""Physics steps in which the model comes to rest on its wheels, before the clock starts."""


class Simulator:
    """A robot in one scenario with one seed: the same seed and commands give the same run, bit for
    bit. Several may live in one process."""

    def __init__(
        self,
        scenario: Scenario,
        *,
        seed: int,
        camera_size: tuple[int, int] | None = None,
        camera_rate_hz: float | None = None,
        errors: StereoErrors | None = None,
        robot: RobotProfile = HUSKY,
        randomised: bool = False,
        start: Pose2 | None = None,
        odometry: OdometryGrade | str = OdometryGrade.TYPICAL,
        odometry_origin: Pose2 | None = None,
        gnss: GnssKind | None = None,
    ) -> None:
        """Build the world. `seed` ≥ 0 decides the small displacements of chairs and items, where
        people are, and the sensor errors.

        `camera_size` is (columns, rows); size and rate are those of the robot's profile when left
        out. `randomised`: the scenario already is what a seed has made
        of it, and every object stays where the scenario puts it. `start`: true T_map_base at the
        start instead of the scenario's. `odometry_origin`: T_odom_base at the start; the true pose
        when left out, so that odometry's frame is the map's. `gnss`: receiver instead of the
        scenario's. Raises `BadConfiguration`.
        """
        camera_size = camera_size or robot.stream.size
        if camera_rate_hz is None:
            camera_rate_hz = robot.stream.rate_hz
        if not 0 < camera_rate_hz <= STEPS_PER_S:
            raise BadConfiguration(
                f"camera_rate_hz is {camera_rate_hz:g}, allowed above 0 to {STEPS_PER_S}"
            )
        if seed < 0:
            raise BadConfiguration(f"seed is {seed}, expected 0 or more")
        self.profile, self._chassis = robot, chassis_for(robot)
        self.odometry_grade = odometry_grade(odometry)
        """How good the odometry is."""
        self.scenario = scenario if randomised else randomise(scenario, seed)
        """The scenario after the seed has varied it, with the start of this run."""
        self.gnss = carried(scenario.gnss, gnss)
        """GNSS receiver of the robot; None without one."""
        if start is not None:
            self.scenario = started_at(self.scenario, start, robot)
        with quiet_output():
            self.client: int = pybullet.connect(pybullet.DIRECT)
            """Number of the physics client, negative once closed."""
            try:
                self._build(seed, odometry_origin)
                self.camera = self._make_camera(camera_size, errors or StereoErrors(), seed)
                self._scanner = self._make_scanner(seed)
            except BaseException:
                pybullet.disconnect(physicsClientId=self.client)
                raise
        self._steps, self._frames, self._camera_rate_hz = 0, 0, camera_rate_hz
        self._yaw_rate_radps = 0.0
        self._faults = FaultSchedule(scenario.faults, (seed, Source.FAULTS))
        self._frame: Frame | None = None
        self._taken: Frame | None = None
        self.referee = Referee(self.scenario, robot)
        """The judge of this run by the ground truth."""

    def now_ns(self) -> int:
        """Return the simulated time since the start, in nanoseconds."""
        return self._steps * 1_000_000_000 // STEPS_PER_S

    def step(self) -> None:
        """Advance the world by 1/240 s and take a frame when one is due."""
        before = self.true_pose()
        t_s = self._steps * PERIOD_S
        speeds = self._driver.wheel_speeds(self.now_ns(), self._yaw_rate_radps)
        self._robot.drive(*self._faults.wheels(speeds, t_s), before)
        self._crowd.step(before)
        pybullet.stepSimulation(physicsClientId=self.client)
        self._steps += 1
        pose = self.true_pose()
        self._yaw_rate_radps = self._faults.gyro(
            self._gyro.measure(self._robot.velocity(pose).w_radps), t_s
        )
        self._odometry.update(*self._robot.rolled_m(), self._yaw_rate_radps, self._robot.gradient)
        if self._receiver is not None:
            self._receiver.observe(self.now_ns(), pose)
        self.referee.observe(
            t_s=self._steps * PERIOD_S,
            pose=pose,
            rolling=self._robot.rolling(),
            people=self.moving_poses(),
            items=[pose_of(self.client, body) for body in self.world.item_bodies],
            pushed_items=self._pushed_items(),
            period_s=PERIOD_S,
            odometry=self.dead_reckoning(),
            tilt_rad=self._robot.tilt_rad(),
        )
        if self._steps * PERIOD_S * self._camera_rate_hz >= self._frames:
            self._frames += 1
            self._taken = self.capture()
            self._frame = self._faults.frame(self._taken, self._steps * PERIOD_S) or self._frame

    def newest_frame(self) -> Frame | None:
        """Return the frame that was due last, or None before the first."""
        return self._frame

    def taken_frame(self) -> Frame | None:
        """Return the frame that was taken last, without faults, or None before the first: for the
        referee, never for navigation."""
        return self._taken

    def capture(self) -> Frame:
        """Return a frame taken now."""
        pose = self.true_pose()
        self.world.update_visible()
        taken = self.camera.capture(pose, self._robot.velocity(pose).w_radps)
        roll, pitch, _ = self.ground.attitude(pose)
        roll_rad, pitch_rad = self._accelerometer.measure(roll, pitch)
        for pixels in (taken.rgb, taken.depth_m, taken.uncoloured):
            if pixels is not None:
                pixels.flags.writeable = False
        return Frame(
            stamp_ns=self.now_ns(),
            rgb=taken.rgb,
            depth_m=taken.depth_m,
            uncoloured=taken.uncoloured,
            intrinsics=self.camera.intrinsics,
            T_base_camera=self.camera.mount,
            pose=self.odometry(),
            twist=self.velocity(),
            roll_rad=roll_rad,
            pitch_rad=pitch_rad,
            fixes=() if self._receiver is None else self._receiver.fixes,
            scan=None if self._scanner is None else self._scanner.scan(pose),
        )

    def true_labels(self) -> dict[str, npt.NDArray[np.bool_]]:
        """Return class → (H, W) mask of the pixels of a frame taken now that show beware objects
        and people: for oracles and tests."""
        objects = self.image().objects
        shown: dict[str, npt.NDArray[np.bool_]] = {}
        for number, name in self.world.class_of.items():
            pixels = objects == number
            shown[name] = shown[name] | pixels if name in shown else pixels
        return shown

    def image(self) -> Image:
        """Return an image taken now, without camera errors."""
        self.world.update_visible()
        return self.camera.image(self.true_pose())

    def send(self, twist: Twist) -> None:
        """Command a velocity; it is clipped to the platform limits and expires after 0.25 s."""
        self._driver.command(twist, self.now_ns())

    def odometry(self) -> Pose2:
        """Return T_odom_base."""
        return self._odometry.pose

    def dead_reckoning(self) -> Pose2:
        """Return T_map_base by odometry alone, from the true start."""
        return self._T_map_odom @ self.odometry()

    def velocity(self) -> Twist:
        """Return the velocity by encoders and gyro."""
        return self._odometry.twist

    def true_pose(self) -> Pose2:
        """Return the true T_map_base: for referee and tests, never for navigation."""
        return self._robot.pose()

    def moving_poses(self) -> tuple[Pose2, ...]:
        """Return the true T_map_body of people, then movers: for referee and tests."""
        return tuple(self._crowd.poses())

    @property
    def body(self) -> int:
        """Number of the robot's body in the physics client: for tests."""
        return self._robot.body

    @property
    def faults(self) -> tuple[Fault, ...]:
        """The scheduled faults, on the clock of the simulator."""
        return self._faults.faults

    def inject(self, fault: Fault) -> None:
        """Schedule one more fault; its times are on the clock of the simulator. Raises
        `BadConfiguration` for an impossible one."""
        self._faults.add(fault)

    def teleport(self, pose: Pose2) -> None:
        """Put the robot at another true T_map_base, where it stands still; odometry goes on as if
        nothing had happened. Raises `BadConfiguration` where the robot cannot stand."""
        check_standing(self.scenario, pose, self.profile, "teleport")
        self._robot.put(pose)
        self.referee.note_teleport(self.true_pose())

    def new_run(self) -> None:
        """Start a new judgement with the same zones; robot, people and clock go on."""
        zones = self.referee.zones
        self.referee = Referee(self.scenario, self.profile, self.true_pose())
        self.referee.set_zones(zones)

    def close(self) -> None:
        """Release the physics client; the simulator cannot be used afterwards."""
        if self.client >= 0:
            with quiet_output():
                pybullet.disconnect(physicsClientId=self.client)
            self.client = -1

    def __enter__(self) -> Simulator:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _pushed_items(self) -> list[int]:
        """Return the numbers of the items that the robot pushes."""
        bodies = self.world.item_bodies
        pushed = self._robot.pushed() if bodies else set()
        return [number for number, body in enumerate(bodies) if body in pushed]

    def _make_camera(self, size: tuple[int, int], errors: StereoErrors, seed: int) -> Camera:
        return Camera(
            self.world.seen,
            size=size,
            errors=errors,
            rng=generator(seed, Source.CAMERA),
            mount=self.profile.camera.T_base_camera,
            ground=self.ground,
            lighting=self.scenario.lighting,
            colour_lens=self.profile.stream.colour_lens,
        )

    def _make_scanner(self, seed: int) -> LaserScanner | None:
        if self.profile.scanner is None:
            return None
        rng = generator(seed, Source.SCANNER)
        return LaserScanner(self.world.seen, self.profile.scanner, rng, self.ground)

    def _build(self, seed: int, odometry_origin: Pose2 | None) -> None:
        pybullet.setGravity(0, 0, -GRAVITY_MPS2, physicsClientId=self.client)
        pybullet.setTimeStep(PERIOD_S, physicsClientId=self.client)
        self.world = build_world(self.client, self.scenario)
        """The bodies of the world, and what the camera sees of them."""
        self._crowd = Crowd(
            self.world, self.scenario, generator(seed, Source.PEOPLE), PERIOD_S, self.profile
        )
        self.ground = Ground(
            self.scenario.relief, self.scenario.raised, foot_m=self._chassis.foot_m
        )
        """The ground of the world."""
        self._robot = SkidSteer(self.client, self.scenario.start_pose, self._chassis, self.ground)
        for _ in range(SETTLING_STEPS):
            self._robot.drive(0.0, 0.0, self.true_pose())
            pybullet.stepSimulation(physicsClientId=self.client)
        self._driver = Driver(PERIOD_S, self.profile, self._chassis)
        errors, slip = ODOMETRY_ERRORS[self.odometry_grade], generator(seed, Source.SLIP)
        self._gyro = Gyro(errors, generator(seed, Source.GYRO), PERIOD_S, scale_rng=slip)
        true_start = self.true_pose()
        origin = true_start if odometry_origin is None else odometry_origin
        self._T_map_odom = true_start @ origin.inverse()
        self._accelerometer = Accelerometer(generator(seed, Source.ACCELEROMETER))
        self._receiver = (
            None if self.gnss is None else GnssReceiver(self.gnss, generator(seed, Source.GNSS))
        )
        self._odometry: Odometry = Odometry(
            origin, errors, generator(seed, Source.ENCODER), PERIOD_S, slip_rng=slip
        )
