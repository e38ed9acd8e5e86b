"""Who drives, and driving by hand.

`WS control/live` is a page's sign of life: the console says twice a second who is in control, the
page answers, and while a drive key is held it sends velocities. A page that is closed, frozen or
cut off sends none, and a velocity lives 0.25 s. The emergency stop is heard on it too, from
everybody who may look.
"""

from __future__ import annotations

import asyncio
import json
import time
from typing import Annotated, Any, Literal

from fastapi import APIRouter, WebSocket
from pydantic import Field, TypeAdapter, ValidationError

from navcore.errors import BewareNavError
from navcore.geometry.transform import Twist
from web.auth.audit import Auditor
from web.auth.control_lease import ControlLeases
from web.auth.roles import CurrentVisitor, Role, Visitor
from web.gateway.problems import RESPONSES, JsonResponse
from web.gateway.websockets import until_one_ends
from web.interface.operations import RobotService
from web.schemas.responses import ControlOut, VisitorOut
from web.schemas.teleop import DriveMessage, HeartbeatMessage, StopMessage

Action = Literal["take", "ask", "give"]
BEAT_S, LOOK_S = 0.5, 0.05
MAX_DELAY_S = 0.25
"""A velocity that was longer on its way than the quickest one is dropped: the operator has let go
since."""
DRIFT = 1e-3
"""How much the clocks of page and console may run apart."""
BAD_MESSAGE = 1007

LiveMessage: TypeAdapter[HeartbeatMessage | StopMessage | DriveMessage] = TypeAdapter(
    Annotated[HeartbeatMessage | StopMessage | DriveMessage, Field(discriminator="type")]
)


def control_router(operations: RobotService, control: ControlLeases, auditor: Auditor) -> APIRouter:
    """Routes below `/api/v1`."""
    router = APIRouter(tags=["control"], default_response_class=JsonResponse)

    @router.get("/control", response_model=ControlOut)
    async def get_control(visitor: CurrentVisitor) -> ControlOut:
        """Who drives, who has asked to, and who is asking this."""
        return _control_of(control, visitor)

    @router.post(
        "/control/{action}",
        response_model=ControlOut,
        responses={409: RESPONSES[409], 422: RESPONSES[422]},
    )
    async def act(action: Action, visitor: CurrentVisitor) -> ControlOut:
        """Take control over, ask for it, or give it to whoever has asked (to nobody if nobody has)."""
        {"take": control.take, "ask": control.ask, "give": control.give}[action](visitor)
        return _control_of(control, visitor)

    @router.websocket("/control/live")
    async def live(socket: WebSocket, visitor: CurrentVisitor) -> None:
        await socket.accept()
        hand = TeleopSession(operations, control, visitor)
        try:
            await until_one_ends(
                _tell(socket, control, visitor), _listen(socket, operations, control, hand, auditor)
            )
        except ValidationError:
            await socket.close(BAD_MESSAGE)
        finally:
            hand.release()

    return router


class TeleopSession:
    """One page's hand on the robot."""

    def __init__(self, operations: RobotService, control: ControlLeases, visitor: Visitor) -> None:
        self._operations, self._control, self.visitor = operations, control, visitor
        self._quickest_s: float | None = None
        self._heard_s = 0.0
        self.is_driving = False

    def move(self, wish: DriveMessage) -> bool:
        """Pass a velocity on; False when it came too late. Raises a refusal."""
        if wish.v_mps == 0.0 and wish.w_radps == 0.0:
            self.release()
            return True
        if self._is_late(wish.t_ms / 1000, time.monotonic()):
            return False
        self._control.claim(self.visitor)
        self._operations.drive(Twist(v_mps=wish.v_mps, w_radps=wish.w_radps))
        self.is_driving = True
        return True

    def release(self) -> None:
        """Stand, if it was this hand that drove."""
        if self.is_driving:
            self.is_driving = False
            self._operations.drive(None)

    def _is_late(self, sent_s: float, now_s: float) -> bool:
        # The two clocks have nothing in common but their pace: the quickest message so far says
        # what is quick.
        way_s, past_s = now_s - sent_s, now_s - self._heard_s
        quickest_s = (
            way_s if self._quickest_s is None else min(way_s, self._quickest_s + DRIFT * past_s)
        )
        self._quickest_s, self._heard_s = quickest_s, now_s
        return way_s - quickest_s > MAX_DELAY_S


def stop_source(visitor: Visitor, by: str) -> str:
    """Who stopped the robot, and by what means, for the operators' eyes."""
    return f"{visitor.name} ({by})" if visitor.logged_in else by


async def _tell(socket: WebSocket, control: ControlLeases, visitor: Visitor) -> None:
    clock = asyncio.get_running_loop().time
    said_at, said = -BEAT_S, -1
    while True:
        if control.now.serial != said or clock() - said_at >= BEAT_S:
            said_at, said = clock(), control.now.serial
            await socket.send_text(_control_of(control, visitor).model_dump_json())
        await asyncio.sleep(LOOK_S)


async def _listen(
    socket: WebSocket, operations: RobotService, control: ControlLeases, hand: TeleopSession, auditor: Auditor
) -> None:
    while True:
        message = await socket.receive()
        if message["type"] == "websocket.disconnect":
            return
        heard = LiveMessage.validate_json(message.get("text") or "")
        control.heartbeat(hand.visitor)
        if isinstance(heard, StopMessage) and not operations.state().stop_latched:
            hand.release()
            operations.stop(stop_source(hand.visitor, heard.by))
            who, role = hand.visitor.name, str(hand.visitor.role)
            await auditor.note(
                {"who": who, "role": role, "method": "WS", "path": f"stop?by={heard.by}"}
            )
        if isinstance(heard, DriveMessage) and hand.visitor.role.may(Role.OPERATOR):
            drove = hand.is_driving
            try:
                hand.move(heard)
            except BewareNavError as refused:
                hand.release()
                await socket.send_text(json.dumps({"type": "refused", "message": str(refused)}))
            if hand.is_driving != drove:
                what = "by hand: begins" if hand.is_driving else "by hand: ends"
                await auditor.note(
                    {
                        "who": hand.visitor.name,
                        "role": str(hand.visitor.role),
                        "method": "WS",
                        "path": what,
                    }
                )


def _control_of(control: ControlLeases, visitor: Visitor) -> ControlOut:
    now = control.now
    return ControlOut(
        serial=now.serial,
        you=_visitor_of(visitor),
        yours=now.holder is not None and now.holder.client_id == visitor.client_id,
        holder=_visitor_of(now.holder),
        asking=_visitor_of(now.asking),
        asked_by_you=now.asking is not None and now.asking.client_id == visitor.client_id,
        before=_visitor_of(now.before),
        was_yours=now.before is not None and now.before.client_id == visitor.client_id,
        taken=now.taken,
    )


def _visitor_of(visitor: Any) -> VisitorOut | None:
    return (
        None
        if visitor is None
        else VisitorOut(name=visitor.name, role=str(visitor.role), logged_in=visitor.logged_in)
    )
