"""State, goals, missions and the stop.

The stop's handlers are coroutines on purpose: a plain function waits for a thread of the pool, and
the pool may be busy with pictures. They answer when the intent is posted, which takes no longer
than a function call.
"""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Query, Response

from web.api.control import stop_source
from web.auth.roles import CurrentVisitor
from web.gateway.problems import RESPONSES, JsonResponse
from web.interface.operations import MissionAction, RobotService
from web.schemas.convert import goals, mission_of, state_of
from web.schemas.fields import MAX_NAME, Name
from web.schemas.mission import GoalIn, GoalOrderIn, GoalPatchIn, LoopIn
from web.schemas.responses import GoalOut, MissionOut, SavedMissionOut, StateOut


def mission_router(operations: RobotService) -> APIRouter:
    """Routes below `/api/v1`."""
    router = APIRouter(tags=["mission"], default_response_class=JsonResponse)

    @router.get("/state", response_model=StateOut)
    async def get_state() -> StateOut:
        """Everything small that is shown, in one consistent snapshot; the reasons of a stop with
        the worst first."""
        return state_of(operations)

    @router.get("/goals", response_model=MissionOut)
    async def get_goals() -> MissionOut:
        """The goals that wait, the present one first, and those reached."""
        return mission_of(operations.state())

    @router.post("/goals", status_code=201, response_model=GoalOut, responses=_refusals(409, 422))
    def add_goal(goal: GoalIn) -> GoalOut:
        """Queue a goal; refused outside the map and inside an obstacle or zone that is known
        already.

        Such a refusal names the `nearest` place where the robot could stand.
        """
        return goals(
            [operations.goals.add(goal.x_m, goal.y_m, yaw_rad=goal.yaw_rad, name=goal.name)]
        )[0]

    @router.put("/goals/order", response_model=MissionOut, responses=_refusals(409, 422))
    def order_goals(order: GoalOrderIn) -> MissionOut:
        """Drive to the waiting goals in this order; the ids have to name every one of them once."""
        operations.goals.order(order.ids)
        return mission_of(operations.state())

    @router.patch("/goals/{goal_id}", response_model=GoalOut, responses=_refusals(404, 422))
    def change_goal(goal_id: Annotated[int, Path(ge=0, le=2**53)], changes: GoalPatchIn) -> GoalOut:
        """Move, turn or rename a waiting goal."""
        return goals([operations.goals.change(goal_id, changes.changes())])[0]

    @router.delete("/goals/{goal_id}", status_code=204, responses=_refusals(404, 422))
    def remove_goal(goal_id: Annotated[int, Path(ge=0, le=2**53)]) -> None:
        """Take a waiting goal, or the present one, out of the queue."""
        operations.goals.remove(goal_id)

    @router.put("/mission/loop", response_model=MissionOut, responses=_refusals(422))
    def loop(body: LoopIn) -> MissionOut:
        """Whether goals that are reached wait again, behind the others."""
        operations.goals.loop(body.loop)
        return mission_of(operations.state())

    @router.get("/missions")
    def list_missions() -> list[SavedMissionOut]:
        """Goals that are kept under a name."""
        saved = operations.goals.missions().items()
        return [
            SavedMissionOut(name=name, goals=len(mission.goals), loop=mission.loop)
            for name, mission in saved
        ]

    @router.put("/missions/{name:path}", status_code=204, responses=_refusals(409, 422, 503))
    def save_mission(name: Annotated[Name, Path()]) -> Response:
        """Keep the waiting goals under a name."""
        operations.goals.save(name)
        return Response(status_code=204)

    @router.post(
        "/missions/{name:path}/load", response_model=MissionOut, responses=_refusals(404, 409, 422)
    )
    def load_mission(name: Annotated[Name, Path()]) -> MissionOut:
        """Put kept goals in the place of those that wait; the mission then stands and waits for its
        start."""
        operations.goals.load(name)
        return mission_of(operations.state())

    @router.delete("/missions/{name:path}", status_code=204, responses=_refusals(404, 503))
    def delete_mission(name: Annotated[Name, Path()]) -> Response:
        """Forget a kept mission."""
        operations.goals.forget(name)
        return Response(status_code=204)

    @router.post("/mission/{action}", response_model=MissionOut, responses=_refusals(409, 422))
    async def act(action: MissionAction) -> MissionOut:
        """Start, pause, resume or cancel; the answer is the state after it."""
        operations.mission(action)
        return mission_of(operations.state())

    @router.post("/stop", response_model=StateOut)
    async def stop(
        visitor: CurrentVisitor, by: Annotated[str, Query(max_length=MAX_NAME)] = "REST"
    ) -> StateOut:
        """Emergency stop, for everybody who may look. It holds until it is reset, whatever else is
        asked for. `by` says by what means, for the operators' eyes.
        """
        by = by if by.isprintable() and by.strip() else "REST"
        operations.stop(stop_source(visitor, by))
        return state_of(operations)

    @router.post("/stop/reset", response_model=StateOut, responses=_refusals(409))
    async def reset_stop() -> StateOut:
        """Release the emergency stop. The mission stays paused until it is started or resumed
        again."""
        operations.reset_stop()
        return state_of(operations)

    return router


def _refusals(*statuses: int) -> dict[int | str, dict[str, object]]:
    return {status: RESPONSES[status] for status in statuses}
