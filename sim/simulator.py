"""The simulated robot: physics, driver, sensors, people and referee behind the port that every
robot satisfies.

It is stepped from outside and reads no clock: time passes by 1/240 s in each `step`, and only
there.
"""

from __future__ import annotations

import math
from types import TracebackType
from typing import Literal

import numpy as np
import numpy.typing as npt
import pybullet

from navcore.errors import BadConfiguration
from navcore.geometry.transform import Pose2, Twist
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY, RobotProfile
from sim.models.ground import Ground
from sim.physics.bodies import newest_bodies
from sim.physics.build import Crowd, build_world
from sim.physics.quiet import quiet_stdout
from sim.referee.referee import Referee
from sim.robot.chassis import chassis_for
from sim.robot.odometry import Gyro, Odometry
from sim.robot.skid_steer import Driver, SkidSteer
from sim.scenario.schema import Scenario
from sim.scenario.variation import Source, generator, randomise
from sim.sensors.camera import Camera, Renderer
from sim.sensors.faults import Fault, FaultSchedule
from sim.sensors.stereo_noise import StereoErrors
from sim.truth.true_objects import class_of_bodies

STEPS_PER_S = 240
PERIOD_S = 1 / STEPS_PER_S
SETTLING_STEPS = 60
"""The model needs a moment to come to rest on its wheels; the clock starts after it."""


class Simulator:
    """One scenario, one seed; same seed and commands, same run, bit for bit. Several may live in
    one process."""

    def __init__(
        self,
        scenario: Scenario,
        *,
        seed: int,
        renderer: Literal["auto", "tiny", "egl"] = "auto",
        camera_size: tuple[int, int] = (424, 240),
        camera_rate_hz: float = 10.0,
        errors: StereoErrors | None = None,
        robot: RobotProfile = HUSKY,
        as_found: bool = False,
    ) -> None:
        """`seed` ≥ 0 moves chairs and items a little and decides where people are and how sensors
        err.

        `as_found`: the scenario is what a seed has made of it already, and everything stands where
        it says.
        """
        if not 0 < camera_rate_hz <= STEPS_PER_S:
            raise BadConfiguration(
                f"camera_rate_hz is {camera_rate_hz:g}, allowed above 0 to {STEPS_PER_S}"
            )
        if seed < 0:
            raise BadConfiguration(f"seed is {seed}, expected 0 or more")
        self.profile, self._chassis = robot, chassis_for(robot)
        self.scenario = scenario if as_found else randomise(scenario, seed)
        """As it is found in this run."""
        with quiet_stdout():
            self._client: int = pybullet.connect(
                pybullet.DIRECT, options="--width={} --height={}".format(*camera_size)
            )
            try:
                self._camera = self._add_camera(
                    renderer, camera_size, errors or StereoErrors(), seed
                )
                self._build(seed)
                for _ in range(2):  # EGL talks during its first pictures
                    self._camera.render_ideal(self.true_pose())
            except BaseException:
                pybullet.disconnect(physicsClientId=self._client)
                raise
        self._steps, self._pictures, self._camera_rate_hz = 0, 0, camera_rate_hz
        self._yaw_rate_radps = 0.0
        self._faults = FaultSchedule(scenario.faults, (seed, Source.FAULTS))
        self._frame: Frame | None = None
        self.referee = Referee(self.scenario, robot)
        """The ground truth's verdict."""

    @property
    def renderer(self) -> Renderer:
        """What renders the camera's pictures."""
        return self._camera.renderer

    def now_ns(self) -> int:
        """Simulated time since the start."""
        return self._steps * 1_000_000_000 // STEPS_PER_S

    def step(self) -> None:
        """Let 1/240 s pass; takes a picture when one is due."""
        before = self.true_pose()
        t_s = self._steps * PERIOD_S
        self._robot.drive(
            *self._faults.wheels(
                self._driver.wheel_speeds(self.now_ns(), self._yaw_rate_radps), t_s
            )
        )
        self._crowd.step(before)
        pybullet.stepSimulation(physicsClientId=self._client)
        self._steps += 1
        pose = self.true_pose()
        self._yaw_rate_radps = self._faults.gyro(
            self._gyro.measure(self._robot.velocity(pose).w_radps), t_s
        )
        self._odometry.update(*self._robot.rolled_m(), self._yaw_rate_radps)
        self.referee.observe(
            t_s=self._steps * PERIOD_S,
            pose=pose,
            rolling=self._robot.rolling(),
            people=self._crowd.poses(),
            items=[self._lies_at(body) for body in self._loose],
            period_s=PERIOD_S,
            odometry=self.odometry(),
        )
        if self._steps * PERIOD_S * self._camera_rate_hz >= self._pictures:
            self._pictures += 1
            self._frame = self._faults.frame(self.capture(), self._steps * PERIOD_S) or self._frame

    def newest_frame(self) -> Frame | None:
        """The last picture that was due, or None before the first."""
        return self._frame

    def capture(self) -> Frame:
        """Take a picture now."""
        rgb, depth_m = self._camera.picture(self.true_pose())
        rgb.flags.writeable = depth_m.flags.writeable = False
        return Frame(
            stamp_ns=self.now_ns(),
            rgb=rgb,
            depth_m=depth_m,
            intrinsics=self._camera.intrinsics,
            T_base_camera=self._camera.mount,
            pose=self.odometry(),
            twist=self.velocity(),
        )

    def true_labels(self) -> dict[str, npt.NDArray[np.bool_]]:
        """(H, W) which pixels of a picture taken now show what is to beware of and people, by
        class: for oracles and tests."""
        bodies = self._camera.bodies(self.true_pose())
        shown: dict[str, npt.NDArray[np.bool_]] = {}
        for body, name in self._class_of.items():
            pixels = bodies == body
            shown[name] = shown[name] | pixels if name in shown else pixels
        return shown

    def send(self, twist: Twist) -> None:
        """Ask the wheels for a velocity; it is clipped to the platform's limits and forgotten after
        0.25 s."""
        self._driver.ask(twist, self.now_ns())

    def odometry(self) -> Pose2:
        """T_map_base as the robot believes."""
        return self._odometry.pose

    def velocity(self) -> Twist:
        """As the robot measures it."""
        return self._odometry.twist

    def true_pose(self) -> Pose2:
        """T_map_base as it is: for the referee and for tests, never for navigation."""
        return self._robot.pose()

    def true_people(self) -> tuple[Pose2, ...]:
        """T_map_person of everybody: for tests, never for navigation."""
        return tuple(walker.pose for walker in self._crowd.walkers)

    @property
    def faults(self) -> tuple[Fault, ...]:
        """The schedule of what goes wrong, on the simulator's clock."""
        return self._faults.faults

    def inject(self, fault: Fault) -> None:
        """Let one more thing go wrong, from `fault.from_s` on this clock; raises `BadConfiguration`
        when it cannot."""
        self._faults.add(fault)

    def new_run(self) -> None:
        """Begin to judge afresh, by the same zones; robot, people and clock go on."""
        zones, self.referee = self.referee.zones, Referee(self.scenario, self.profile)
        self.referee.set_zones(zones)

    def close(self) -> None:
        """Free the physics client; the simulator is of no use afterwards."""
        if self._client >= 0:
            with quiet_stdout():
                self._camera.close()
                pybullet.disconnect(physicsClientId=self._client)
            self._client = -1

    def __enter__(self) -> Simulator:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _lies_at(self, body: int) -> Pose2:
        (x_m, y_m, _), (x, y, z, w) = pybullet.getBasePositionAndOrientation(
            body, physicsClientId=self._client
        )
        return Pose2(
            x_m=x_m, y_m=y_m, yaw_rad=math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        )

    def _add_camera(
        self,
        renderer: Literal["auto", "tiny", "egl"],
        size: tuple[int, int],
        errors: StereoErrors,
        seed: int,
    ) -> Camera:
        rng = generator(seed, Source.CAMERA)
        return Camera(
            self._client,
            size=size,
            renderer=renderer,
            errors=errors,
            rng=rng,
            mount=self.profile.camera.T_base_camera,
            ground=Ground(self.scenario.relief),
        )

    def _build(self, seed: int) -> None:
        pybullet.setGravity(0, 0, -9.81, physicsClientId=self._client)
        pybullet.setTimeStep(PERIOD_S, physicsClientId=self._client)
        build_world(self._client, self.scenario)
        self._loose = newest_bodies(
            self._client, len(self.scenario.items)
        )  # the world's last: see `build_world`
        first = pybullet.getNumBodies(physicsClientId=self._client)
        self._crowd = Crowd(
            self._client, self.scenario, generator(seed, Source.PEOPLE), PERIOD_S, self.profile
        )
        self._class_of = class_of_bodies(self.scenario, loose=self._loose, first_person=first)
        self._robot = SkidSteer(
            self._client, self.scenario.start_pose, self._chassis, Ground(self.scenario.relief)
        )
        for _ in range(SETTLING_STEPS):
            self._robot.drive(0.0, 0.0)
            pybullet.stepSimulation(physicsClientId=self._client)
        self._driver = Driver(PERIOD_S, self.profile, self._chassis)
        self._gyro = Gyro(generator(seed, Source.GYRO), PERIOD_S)
        self._odometry: Odometry = Odometry(
            self.true_pose(), generator(seed, Source.ENCODER), PERIOD_S
        )
