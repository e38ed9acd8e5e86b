"""Routes for monitoring: health check, and metrics for Prometheus."""

from __future__ import annotations

import math
from collections.abc import Iterator

from fastapi import APIRouter, Response

from navcore.mission.mission import Phase
from web.gateway.problems import JsonResponse
from web.interface.operations import RobotService
from web.interface.snapshots import State
from web.schemas.health import HealthOut


def health_router(operations: RobotService) -> APIRouter:
    """Return the routes at the root."""
    router = APIRouter(tags=["health"], default_response_class=JsonResponse)

    @router.get("/healthz", response_model=HealthOut)
    async def healthz() -> HealthOut:
        """Return the age of the frame that decides; an answer proves that the console runs."""
        state = operations.state()
        return HealthOut(scenario=state.scenario, robot=state.robot, frame_age_s=state.frame_age_s)

    @router.get("/metrics", response_class=Response)
    async def metrics() -> Response:
        """Return metrics in Prometheus' text format."""
        text = "".join(_lines(operations.state()))
        return Response(text, media_type="text/plain; version=0.0.4; charset=utf-8")

    return router


def _lines(state: State) -> Iterator[str]:
    metrics: tuple[tuple[str, str, str, float | None], ...] = (
        (
            "stop_latched",
            "gauge",
            "1 while the emergency stop holds, or pose or clock await a reset.",
            float(state.stop_latched),
        ),
        ("moving", "gauge", "1 while a command other than zero is sent.", float(state.moving)),
        (
            "stop_reasons",
            "gauge",
            "Present reasons why the robot stands.",
            float(len(state.reasons)),
        ),
        ("goals_waiting", "gauge", "Goals still to reach.", float(len(state.queue))),
        (
            "goals_reached_total",
            "counter",
            "Goals reached by the mission; the next one counts from 0.",
            float(state.reached_count),
        ),
        ("travelled_metres_total", "counter", "Distance driven.", state.travelled_m),
        ("explored_square_metres", "gauge", "Area of the floor seen.", state.explored_m2),
        ("replans_total", "counter", "Paths planned.", float(state.replans)),
        ("tick_seconds", "gauge", "Duration of the navigator's last tick.", state.tick_ms / 1000),
        (
            "frame_age_seconds",
            "gauge",
            "Age of the camera frame by which the motion was decided.",
            state.frame_age_s,
        ),
        ("map_age_seconds", "gauge", "Age of the newest frame on the map.", state.map_age_s),
        ("speed_metres_per_second", "gauge", "Forward speed by odometry.", state.twist.v_mps),
    )
    for name, kind, meaning, value in metrics:
        if value is not None and math.isfinite(value):
            yield f"# HELP bewarenav_{name} {meaning}\n# TYPE bewarenav_{name} {kind}\n"
            yield f"bewarenav_{name} {value!r}\n"
    yield "# HELP bewarenav_phase What the operator has asked for.\n# TYPE bewarenav_phase gauge\n"
    for phase in Phase:
        yield f'bewarenav_phase{{phase="{phase}"}} {float(state.phase is phase)!r}\n'
