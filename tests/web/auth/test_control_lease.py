"""The lease of control over time; only the monotonic clock counts."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import pytest

from tests.web.auth.test_access import Clock
from web.auth.control_lease import PAGE_LEASE_S, PROGRAM_LEASE_S, ControlLeases, NotInControl
from web.auth.roles import Role, Visitor


def client_id(name: str, kind: str = "page") -> Visitor:
    return Visitor(name=name, role=Role.OPERATOR, client_id=f"{kind} {name}")


def test_the_first_visitor_to_act_gets_control_until_their_lease_expires() -> None:
    clock = Clock()
    control, anna, bob = ControlLeases(clock=clock), client_id("anna"), client_id("bob")
    assert control.now.holder is None
    control.claim(anna)
    with pytest.raises(NotInControl, match="anna is in control"):
        control.claim(bob)
    clock.now_s += PAGE_LEASE_S - 0.1
    control.heartbeat(anna)
    control.heartbeat(bob)
    clock.now_s += PAGE_LEASE_S - 0.1
    assert control.now.is_held_by(anna)
    clock.now_s += 0.2
    assert control.now.holder is None and control.now.before == anna
    control.claim(bob)
    assert control.now.is_held_by(bob)
    program = client_id("robot", "program")
    control.take(program)
    clock.now_s += PROGRAM_LEASE_S - 0.1
    assert control.now.is_held_by(program)


def test_a_holder_who_is_a_viewer_by_now_does_not_keep_control() -> None:
    clock = Clock()
    control, anna = ControlLeases(clock=clock), client_id("anna", "program")
    control.claim(anna)
    clock.now_s += PROGRAM_LEASE_S - 1
    control.heartbeat(dataclasses.replace(anna, role=Role.VIEWER))
    clock.now_s += 2
    assert control.now.holder is None


def test_control_is_asked_for_given_taken_and_everybody_can_see_it() -> None:
    control, anna, bob = ControlLeases(), client_id("anna"), client_id("bob")
    control.claim(anna)
    serials = [control.now.serial]
    act: Callable[[Visitor], None]
    for act, visitor in (
        (control.ask, bob),
        (control.give, anna),
        (control.take, anna),
        (control.give, anna),
    ):
        act(visitor)
        serials.append(control.now.serial)
    assert serials == sorted(set(serials))
    control.claim(anna)
    control.ask(bob)
    assert (control.now.holder, control.now.asking) == (anna, bob)
    control.give(anna)
    assert (control.now.holder, control.now.before, control.now.taken) == (bob, anna, False)
    control.take(anna)
    assert (control.now.holder, control.now.before, control.now.taken) == (anna, bob, True)
    with pytest.raises(NotInControl, match="hand it over"):
        control.give(bob)
    control.give(anna)
    assert control.now.holder is None


def test_control_is_handed_over_to_a_visitor_who_asked_and_is_still_there() -> None:
    clock = Clock()
    control, anna, bob = ControlLeases(clock=clock), client_id("anna"), client_id("bob")
    control.claim(anna)
    control.ask(bob)
    for _ in range(2):
        clock.now_s += PAGE_LEASE_S - 0.1
        control.heartbeat(anna)
        control.heartbeat(bob)
    assert control.now.asking == bob
    for _ in range(2):
        clock.now_s += PAGE_LEASE_S - 0.1
        control.heartbeat(anna)
        control.heartbeat(dataclasses.replace(bob, role=Role.VIEWER))
    left = control.now
    assert left.is_held_by(anna) and left.asking is None
    control.give(anna)
    assert control.now.holder is None
