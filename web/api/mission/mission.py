"""Routes of state, goals, missions and emergency stop.

The handlers of the stop are coroutines: a plain function waits for a thread of the pool, which may
be busy with images. They answer when the request is posted, which takes no longer than a function
call.
"""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Query, Response

from navcore.mission.mission import Goal
from web.api.mission.control import stop_source
from web.api.router import api_router
from web.auth.roles import CurrentVisitor
from web.gateway.problems import refusals
from web.interface.operations import MissionAction, RobotService
from web.interface.snapshots import State
from web.schemas.fields import Name, NewName
from web.schemas.mission.mission import (
    GoalIn,
    GoalOrderIn,
    GoalPatchIn,
    LoopIn,
    MissionOut,
    SavedMissionOut,
)
from web.schemas.mission.teleop import stop_label


def mission_router(operations: RobotService) -> APIRouter:
    """Return the routes below `/api/v1`."""
    router = api_router("mission")

    def mission() -> MissionOut:
        state = operations.state()
        return MissionOut(
            phase=state.phase,
            queue=state.queue,
            reached=state.reached,
            reached_count=state.reached_count,
            loop=state.loop,
        )

    @router.get("/state", response_model=State)
    async def get_state() -> State:
        """Return the small values of the system in one consistent snapshot."""
        return operations.state()

    @router.get("/goals", response_model=MissionOut)
    async def get_goals() -> MissionOut:
        """Return the waiting goals, the present one first, and the reached ones."""
        return mission()

    @router.post("/goals", status_code=201, response_model=Goal, responses=refusals(409, 422))
    def add_goal(goal: GoalIn) -> Goal:
        """Queue a goal, to which the map grows; refused too far away and in an obstacle or zone.

        Such a refusal names the `nearest` free position, if there is a map yet.
        """
        return operations.goals.add(goal.x_m, goal.y_m, yaw_rad=goal.yaw_rad, name=goal.name)

    @router.put("/goals/order", response_model=MissionOut, responses=refusals(409, 422))
    def order_goals(order: GoalOrderIn) -> MissionOut:
        """Change the order of the waiting goals; the ids must name each of them once."""
        operations.goals.order(order.ids)
        return mission()

    @router.patch("/goals/{goal_id}", response_model=Goal, responses=refusals(404, 422))
    def change_goal(goal_id: Annotated[int, Path(ge=0, le=2**53)], changes: GoalPatchIn) -> Goal:
        """Move, turn or rename a waiting goal."""
        return operations.goals.change(goal_id, changes)

    @router.delete("/goals/{goal_id}", status_code=204, responses=refusals(404, 422))
    def remove_goal(goal_id: Annotated[int, Path(ge=0, le=2**53)]) -> None:
        """Remove a waiting goal, or the present one."""
        operations.goals.remove(goal_id)

    @router.put("/mission/loop", response_model=MissionOut, responses=refusals(422))
    def loop(body: LoopIn) -> MissionOut:
        """Set whether reached goals are queued again, behind the others."""
        operations.goals.loop(body.loop)
        return mission()

    @router.get("/missions")
    def list_missions() -> list[SavedMissionOut]:
        """Return the saved missions."""
        saved = operations.goals.missions().items()
        return [
            SavedMissionOut(name=name, goals=len(mission.goals), loop=mission.loop)
            for name, mission in saved
        ]

    @router.put("/missions/{name:path}", status_code=204, responses=refusals(409, 422, 503))
    def save_mission(
        name: Annotated[NewName, Path()],
        replace: Annotated[
            bool, Query(description="Replace a saved mission of that name.")
        ] = False,
    ) -> Response:
        """Save the waiting goals under a name; refused with 409 where a mission has it, unless
        `replace` is true."""
        operations.goals.save(name, replace=replace)
        return Response(status_code=204)

    @router.post(
        "/missions/{name:path}/load", response_model=MissionOut, responses=refusals(404, 409, 422)
    )
    def load_mission(name: Annotated[Name, Path()]) -> MissionOut:
        """Replace the waiting goals by those of a saved mission, which then waits for its start."""
        operations.goals.load(name)
        return mission()

    @router.delete("/missions/{name:path}", status_code=204, responses=refusals(404, 503))
    def delete_mission(name: Annotated[Name, Path()]) -> Response:
        """Delete a saved mission."""
        operations.goals.forget(name)
        return Response(status_code=204)

    @router.post("/mission/back-off", response_model=MissionOut, responses=refusals(409))
    async def back_off() -> MissionOut:
        """Drive half a metre straight back, through the safety gate; a mission that was driving
        goes on afterwards."""
        operations.back_off()
        return mission()

    @router.post("/mission/{action}", response_model=MissionOut, responses=refusals(409, 422))
    async def act(action: MissionAction) -> MissionOut:
        """Start, pause, resume or cancel the mission, or leave a beware area; return the mission
        after it."""
        operations.mission(action)
        return mission()

    @router.post("/stop", response_model=State)
    async def stop(visitor: CurrentVisitor, by: Annotated[str, Query()] = "REST") -> State:
        """Stop the robot at once; allowed for every visitor. The stop holds until it is reset. `by`
        names the means for the operators, such as a button."""
        operations.stop(stop_source(visitor, stop_label(by, "REST")))
        return operations.state()

    @router.post("/stop/reset", response_model=State, responses=refusals(409))
    async def reset_stop(stops: Annotated[int | None, Query()] = None) -> State:
        """Release the emergency stop. The mission stays paused until it is started or resumed.
        `stops`: number of stops in the state that the operator has seen; a newer stop then holds,
        and the answer is 409."""
        operations.reset_stop(stops)
        return operations.state()

    return router
