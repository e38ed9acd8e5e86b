"""Ticks that take time on the simulated clock."""

from __future__ import annotations

import dataclasses
import itertools
import json
import re
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from app.episode.ablation import Oracle
from app.episode.latency import (
    CONSOLE_TICKS,
    NO_LATENCY,
    Latency,
    TickSchedule,
    latency_of,
    live_latency,
)
from app.episode.task import Task, episode_of
from navcore.errors import BadConfiguration
from navcore.mission.beware_list import default_beware_list
from navcore.navigator import Navigator, TickResult
from navcore.perception.esanet.inference.network_file import SHIPPED
from navcore.perception.esanet.weights import weights_file
from navcore.robot.frame import Frame
from navcore.robot.profile import HUSKY
from navcore.safety.gate import GateDecision
from sim.scenario.load import load_scenario
from sim.scenario.schema import Person
from tests.sim.worlds import open_floor

WALKER = Person(points=((8.0, -8.0), (8.0, 8.0)))


def frame(stamp_ns: int) -> Frame:
    """A frame of which only the stamp and the size matter."""
    return cast(Frame, SimpleNamespace(stamp_ns=stamp_ns, depth_m=np.ones((2, 2))))


def driven(latency: Latency, *, seed: int = 0) -> tuple[dict[str, Any], list[float]]:
    """Drive for two seconds; return the report, and the age of the image at the end of each
    tick in seconds."""
    world = dataclasses.replace(open_floor(people=(WALKER,)), goals=((6.0, 0.0),))
    task = Task(scenario=world, latency=latency, max_time_s=2.0)
    episode = episode_of(task, seed, robot=HUSKY, beware=default_beware_list(), perception=None)
    ages_s: list[float] = []

    def note(t_s: float, decision: TickResult) -> None:
        ages_s.append(t_s - decision.frame.stamp_ns / 1e9)

    episode.on_decision = note
    try:
        return episode.run(), ages_s
    finally:
        episode.close()


def test_a_record_is_replayed_in_its_order_from_a_drawn_tick_on() -> None:
    recorded = Latency(name="recorded", ticks_ms=tuple(float(ms) for ms in range(50)))
    first, again, other = (
        list(itertools.islice(recorded.delays_s(seed), 120)) for seed in (3, 3, 4)
    )
    assert first == again != other
    steps = np.round(np.diff(np.array(first) * 1e3)) % 50
    assert (steps == 1).all()
    assert sorted(set(np.round(np.array(first) * 1e3))) == list(range(50))


def test_latencies_are_parsed_and_wrong_ones_refused() -> None:
    assert latency_of("none") is NO_LATENCY
    assert latency_of("live") is live_latency()
    assert latency_of("120") == Latency(name="120 ms", ticks_ms=(120.0,))
    for wrong in ("fast", "-1", "nan", "inf", "20000", ""):
        with pytest.raises(BadConfiguration, match="--latency"):
            latency_of(wrong)


def test_the_kept_record_is_of_the_shipped_architecture_and_names_its_machine() -> None:
    record = json.loads(CONSOLE_TICKS.read_text(encoding="utf-8"))
    # What an image takes depends on architecture, size and engine, not on what was learned.
    card = weights_file.load(SHIPPED).card
    assert card.size is not None
    network = f"network {card.variant} × {card.width:g}"
    assert record["segmenter"].startswith(f"{network}, openvino int8, ")
    assert record["segmenter"].endswith(f", {card.size.width} × {card.size.height}")
    assert re.fullmatch("[0-9a-f]{64}", record["weights_sha256"])
    assert record["command"].startswith("bewarenav bench latency ")
    assert record["machine"] and record["version"] and record["date"]
    assert len(record["ticks_ms"]) >= 200 and min(record["ticks_ms"]) > 1.0


def test_of_the_images_that_arrive_during_a_tick_only_the_last_is_processed() -> None:
    first, second, third, fourth = (frame(number) for number in range(4))
    schedule = TickSchedule(lambda: 0.25)
    assert schedule.advance(None, 0.0) is None
    assert schedule.advance(first, 0.1) is None
    assert schedule.advance(second, 0.2) is None
    assert schedule.advance(third, 0.3) is None
    assert schedule.advance(third, 0.36) is first
    assert schedule.advance(third, 0.37) is None
    assert schedule.advance(fourth, 0.5) is None
    assert schedule.advance(fourth, 0.63) is third
    assert schedule.advance(fourth, 0.64) is None
    assert schedule.advance(fourth, 0.9) is fourth
    assert schedule.advance(fourth, 1.9) is None


def test_a_tick_is_overdue_after_twice_the_time_of_the_one_before() -> None:
    durations_s = iter([0.1, 1.0, 0.0, 1.0])
    schedule = TickSchedule(lambda: next(durations_s))
    assert not schedule.is_overdue(0.0), "none is in progress"
    schedule.advance(frame(0), 0.0)
    assert schedule.is_overdue(0.05), "the first is waited for"
    assert schedule.advance(frame(0), 0.1) is not None
    schedule.advance(frame(1), 0.1)
    assert not schedule.is_overdue(0.29) and schedule.is_overdue(0.31)
    assert schedule.advance(frame(1), 1.2) is not None
    assert schedule.advance(frame(2), 1.2) is not None
    schedule.advance(frame(3), 1.3)
    assert schedule.is_overdue(1.31), "one without latency hangs"


def test_a_tick_without_latency_ends_when_it_begins() -> None:
    schedule = TickSchedule(lambda: 0.0)
    only = frame(0)
    assert schedule.advance(only, 0.1) is only
    assert schedule.advance(only, 0.2) is None


def test_an_oracle_labels_a_frame_by_what_was_there_when_it_was_taken() -> None:
    entry = default_beware_list().classes[0]
    shown = np.zeros((2, 2), dtype=np.bool_)
    oracle = Oracle(cast(Any, SimpleNamespace(true_labels=lambda: {entry.name: shown.copy()})))
    oracle.look(frame(1))
    shown[0, 0] = True
    oracle.look(frame(2))
    before, after = (oracle.segment(frame(stamp), default_beware_list()) for stamp in (1, 2))
    assert not (before.class_ids == entry.class_id).any()
    assert (after.class_ids == entry.class_id).tolist() == [[True, False], [False, False]]


def test_images_are_as_old_as_the_latency_says_and_reports_name_it() -> None:
    """Control: without latency the same drive acts on new images."""
    late, late_ages_s = driven(latency_of("150"))
    prompt, prompt_ages_s = driven(NO_LATENCY)
    assert min(late_ages_s) >= 0.15 > max(prompt_ages_s)
    assert len(late_ages_s) < len(prompt_ages_s)
    assert late["series"] != prompt["series"]
    assert [report["latency"] for report in (late, prompt)] == ["150 ms", "none"]
    assert late["people"] == "walk on"


def test_the_robot_is_steered_by_the_images_that_come_during_a_tick(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Control: without latency each image gets its tick."""
    later_s = list[float]()
    steer = Navigator.steer

    def counted(navigator: Navigator, newest: Frame, obstacles: Any) -> Any:
        if (result := steer(navigator, newest, obstacles)) is not None:
            later_s.append((newest.stamp_ns - result.frame.stamp_ns) / 1e9)
        return result

    monkeypatch.setattr(Navigator, "steer", counted)
    driven(NO_LATENCY)
    assert not later_s
    driven(latency_of("250"))
    assert len(later_s) > 10 and 0.0 < min(later_s) <= max(later_s) < 0.6


def test_no_command_goes_by_an_older_image_than_the_newest() -> None:
    world = dataclasses.replace(open_floor(), goals=((6.0, 0.0),))
    task = Task(scenario=world, latency=latency_of("250"), max_time_s=3.0)
    episode = episode_of(task, 0, robot=HUSKY, beware=default_beware_list(), perception=None)
    ages_s = list[float]()

    def note(t_s: float, verdict: GateDecision) -> None:
        if verdict.twist.v_mps > 0.0:
            ages_s.append(t_s - (episode.controller.tick_state.frame_ns or 0) / 1e9)

    episode.on_verdict = note
    try:
        episode.run()
    finally:
        episode.close()
    assert len(ages_s) > 20 and max(ages_s) < 0.11


def test_replayed_latency_gives_the_same_run_again() -> None:
    recorded = Latency(name="live", ticks_ms=(60.0, 70.0, 140.0, 90.0))
    first, again = (driven(recorded, seed=2) for _ in range(2))
    assert first[0]["series"] == again[0]["series"] and first[1] == again[1]


def test_people_walk_on_unless_they_are_asked_to_yield() -> None:
    office = load_scenario("office")
    assert any(person.yields for person in office.people)
    assert not any(person.yields for person in Task(scenario=office).populated.people)
    assert Task(scenario=office, yielding=True).populated == office
