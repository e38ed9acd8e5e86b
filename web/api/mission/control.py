"""Routes of control of the robot, and teleoperation.

`WS control/live` carries a page's sign of life: the console sends the holder of control twice a
second, the page answers, and while a drive key is held it sends velocities. A page that is closed,
frozen or cut off sends none, and a velocity holds for 0.25 s. The emergency stop is accepted on it,
too, from every visitor, and answered by `stopped`.
"""

from __future__ import annotations

import asyncio
import json
import re
import time
from collections import deque
from typing import Annotated, Literal

from fastapi import APIRouter, WebSocket
from pydantic import Field, TypeAdapter, ValidationError

from navcore.errors import BewareNavError, Refused
from navcore.geometry.transform import Twist
from web.api.router import api_router
from web.auth.audit import Auditor
from web.auth.control_lease import ControlLeases, NotInControl
from web.auth.roles import CurrentVisitor, Role, SessionRenewal, Visitor
from web.gateway.problems import refusals
from web.gateway.websockets import BAD_MESSAGE, until_one_ends
from web.interface.operations import RobotService
from web.schemas.access import ControlOut, VisitorOut
from web.schemas.mission.teleop import (
    DriveMessage,
    HeartbeatMessage,
    StopMessage,
    stop_label,
)

Action = Literal["take", "ask", "give", "keep"]
REPEAT_S, POLL_S = 0.5, 0.05
"""Longest time between two messages on the holder, and period of the search for changes, seconds.
"""
MAX_DELAY_S = 0.25
"""Delay in seconds, beyond that of the fastest message, after which a velocity is dropped: the
operator has released the key since."""
MAX_TEXT = 1000
"""Largest length of a message of a page in characters; a longer one is none, or a stop."""
_STOP = re.compile(r'"type"\s*:\s*"stop"')
MAX_LATE = 10
"""Number of velocities in a row that were dropped after which the operator is told so: about a
second of driving."""
CLOCK_DRIFT = 1e-3
"""Largest drift between the clocks of page and console, seconds per second."""

LiveMessage: TypeAdapter[HeartbeatMessage | StopMessage | DriveMessage] = TypeAdapter(
    Annotated[HeartbeatMessage | StopMessage | DriveMessage, Field(discriminator="type")]
)


def control_router(operations: RobotService, control: ControlLeases, auditor: Auditor) -> APIRouter:
    """Return the routes below `/api/v1`."""
    router = api_router("control")

    @router.get("/control", response_model=ControlOut)
    async def get_control(visitor: CurrentVisitor) -> ControlOut:
        """Return the visitor in control and the one who asked for it."""
        return _control_of(control, visitor)

    @router.post("/control/{action}", response_model=ControlOut, responses=refusals(409, 422))
    async def act(action: Action, visitor: CurrentVisitor) -> ControlOut:
        """Take control, ask for it, or give it to the visitor who asked, or to none. A program that
        waits keeps it by `keep`, which is refused once it has lost control; the wish of a program
        lapses after 30 s, unless it asks again."""
        getattr(control, action)(visitor)
        return _control_of(control, visitor)

    @router.websocket("/control/live")
    async def live(socket: WebSocket, visitor: CurrentVisitor, renew: SessionRenewal) -> None:
        await socket.accept()
        session = TeleopSession(operations, control, visitor)
        try:
            await until_one_ends(
                _send(socket, control, session),
                _receive(socket, control, session, auditor, renew),
            )
        except ValidationError:
            await socket.close(BAD_MESSAGE)
        finally:
            session.release()
            _note_driving(auditor, session)

    return router


class TeleopSession:
    """Teleoperation by one page."""

    def __init__(self, operations: RobotService, control: ControlLeases, visitor: Visitor) -> None:
        self.operations, self.visitor = operations, visitor
        self._control = control
        self._least_delay_s: float | None = None
        self._received_s, self._late = 0.0, 0
        self.is_driving = False
        self.is_logged = False
        """Whether the audit log says that this page drives."""
        self.is_stop_unanswered = False
        self.refusals: deque[dict[str, str]] = deque(maxlen=1)
        """What the page has to be told next. The messages of the page, a stop perhaps, do not wait
        until it has taken that."""

    def move(self, message: DriveMessage) -> bool:
        """Pass a velocity on; return False when it came too late. Raises a refusal."""
        if message.v_mps == 0.0 and message.w_radps == 0.0:
            self._late = 0
            self.release()
            return True
        if self._is_late(message.t_ms / 1000, time.monotonic()):
            self._late += 1
            if self._late == MAX_LATE:
                raise Refused("the connection is too slow to drive the robot by hand")
            return False
        self._late = 0
        self._control.claim(self.visitor)
        self.operations.drive(Twist(v_mps=message.v_mps, w_radps=message.w_radps))
        self.is_driving = True
        return True

    def release(self) -> None:
        """Stop the robot if this page drives it; where another one is in control by now, what that
        one has begun goes on, and the last velocity of this page expires."""
        if self.is_driving:
            self.is_driving = False
            now = self._control.now
            if now.holder is None or now.is_held_by(self.visitor):
                self.operations.drive(None)

    def _is_late(self, sent_s: float, now_s: float) -> bool:
        # The offset of the two clocks is unknown: delays count from that of the fastest message.
        delay_s, past_s = now_s - sent_s, now_s - self._received_s
        least_s = (
            delay_s
            if self._least_delay_s is None
            else min(delay_s, self._least_delay_s + CLOCK_DRIFT * past_s)
        )
        self._least_delay_s, self._received_s = least_s, now_s
        return delay_s - least_s > MAX_DELAY_S


def stop_source(visitor: Visitor, by: str) -> str:
    """Return the visitor who stopped the robot and the means, for the operators."""
    return f"{visitor.name} ({by})" if visitor.logged_in else by


async def _send(socket: WebSocket, control: ControlLeases, session: TeleopSession) -> None:
    clock = asyncio.get_running_loop().time
    sent_at, sent = -REPEAT_S, -1
    while True:
        if session.is_stop_unanswered:
            session.is_stop_unanswered = False
            await socket.send_text('{"type": "stopped"}')
        if session.refusals:
            await socket.send_text(json.dumps(session.refusals.popleft()))
        if control.now.serial != sent or clock() - sent_at >= REPEAT_S:
            sent_at, sent = clock(), control.now.serial
            await socket.send_text(_control_of(control, session.visitor).model_dump_json())
        await asyncio.sleep(POLL_S)


async def _receive(
    socket: WebSocket,
    control: ControlLeases,
    session: TeleopSession,
    auditor: Auditor,
    renew: SessionRenewal,
) -> None:
    while True:
        message = await socket.receive()
        if message["type"] == "websocket.disconnect":
            return
        received = _message_of(message.get("text") or "")
        if not isinstance(received, HeartbeatMessage):
            renew()
        if isinstance(received, StopMessage):
            by = stop_label(received.by, "console")
            session.operations.stop(stop_source(session.visitor, by))
            session.is_stop_unanswered = True
            auditor.note_stop(_entry(session.visitor, f"stop?by={by}"))
            session.release()
        control.heartbeat(session.visitor)
        if isinstance(received, DriveMessage) and session.visitor.role.may(Role.OPERATOR):
            try:
                session.move(received)
            except BewareNavError as refused:
                session.release()
                code = "not_in_control" if isinstance(refused, NotInControl) else "refused"
                session.refusals.append({"type": "refused", "code": code, "message": str(refused)})
        _note_driving(auditor, session)


def _message_of(text: str) -> HeartbeatMessage | StopMessage | DriveMessage:
    """Return the message in a text; raises `ValidationError` where there is none. What is read here
    holds up the stop of another visitor; of a long text, and of one that is no JSON, only a stop is
    taken, without its label."""
    try:
        return LiveMessage.validate_json(text if len(text) <= MAX_TEXT else "")
    except ValidationError:
        if _STOP.search(text):
            return StopMessage(type="stop")
        raise


def _note_driving(auditor: Auditor, session: TeleopSession) -> None:
    """Log that a page has begun to drive, which is tried again while it drives, or has ended it;
    the next message, a stop perhaps, does not wait for the disk."""
    if session.is_driving and not session.is_logged:
        begins = _entry(session.visitor, "by hand: begins")
        session.is_logged = auditor.note_driving(begins, begins=True) is not None
    elif session.is_logged and not session.is_driving:
        session.is_logged = False
        auditor.note_driving(_entry(session.visitor, "by hand: ends"), begins=False)


def _entry(visitor: Visitor, what: str) -> dict[str, str]:
    return {"who": visitor.name, "role": str(visitor.role), "method": "WS", "path": what}


def _control_of(control: ControlLeases, visitor: Visitor) -> ControlOut:
    now = control.now

    def shown(other: Visitor | None) -> VisitorOut | None:
        return None if other is None else VisitorOut.model_validate(other)

    def is_own(other: Visitor | None) -> bool:
        return other is not None and other.client_id == visitor.client_id

    return ControlOut(
        serial=now.serial,
        you=shown(visitor),
        yours=is_own(now.holder),
        holder=shown(now.holder),
        asking=shown(now.asking),
        asked_by_you=is_own(now.asking),
        before=shown(now.before),
        was_yours=is_own(now.before),
        taken=now.taken,
    )
