"""Beware list, configuration and TOML tables: errors name the key."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import pytest

from navcore.config.control import LocalPlannerConfig
from navcore.config.navigator import NavigatorConfig, config_for, load_config
from navcore.errors import BadConfiguration
from navcore.mission.beware_list import (
    BewareClass,
    BewareList,
    ColourRule,
    default_beware_list,
    load_beware_list,
)
from navcore.robot.profile import HEADROOM_M, load_profile
from navcore.toml_config import MAX_BYTES, from_table, ranged, read_toml

CUP = {"name": "cup", "class_id": 1}
RED = {"name": "red floor", "class_id": 2, "colour": {"hue_deg": [345, 15]}}


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"margn_m": 0.1}, "unknown key 'margn_m'"),
        ({"margin_m": "wide"}, r"\.margin_m: expected float, got 'wide'"),
        ({"margin_m": True}, r"\.margin_m: expected float"),
        ({"margin_m": -0.1}, r"\.margin_m: -0.1 is out of range"),
        ({"margin_m": 2.1}, r"\.margin_m: 2.1 is out of range"),
        ({"margin_m": float("nan")}, r"\.margin_m: nan is out of range"),
        ({"margin_m": float("inf")}, r"\.margin_m: inf is out of range"),
        ({"margin_m": 10**400}, r"\.margin_m"),
        ({"class_id": 10**400}, r"\.class_id"),
        ({"class_id": 0}, r"\.class_id: 0 is out of range"),
        ({"class_id": 64}, r"\.class_id: 64 is out of range"),
        ({"class_id": 1.0}, r"\.class_id: expected int"),
        ({"class_id": True}, r"\.class_id: expected int"),
        ({"enabled": 1}, r"\.enabled: expected bool"),
        ({"name": 7}, r"\.name: expected str"),
        ({"min_confidence": 1.01}, r"\.min_confidence: 1.01 is out of range"),
        ({"colour": "red"}, r"\.colour: expected a table"),
        ({"colour": {}}, r"\.colour: key 'hue_deg' is missing"),
        ({"colour": {"hue_deg": [1]}}, r"\.colour\.hue_deg: expected 2 values"),
        ({"colour": {"hue_deg": 1}}, r"\.colour\.hue_deg: expected a list"),
        ({"colour": {"hue_deg": [1, 361]}}, r"\.colour\.hue_deg\[1\]: 361.0 is out of range"),
        ({"colour": {"hue_deg": [1, 2], "hue": 1}}, r"\.colour: unknown key 'hue'"),
    ],
)
def test_a_bad_entry_is_refused_by_the_name_of_its_key(change: dict[str, Any], key: str) -> None:
    with pytest.raises(BadConfiguration, match=f"list.toml.*{key}"):
        from_table(BewareClass, {**CUP, **change}, "list.toml: beware[0]")


@pytest.mark.parametrize("key", ["name", "class_id"])
def test_a_missing_key_is_named(key: str) -> None:
    with pytest.raises(BadConfiguration, match=f"key '{key}' is missing"):
        from_table(BewareClass, {k: v for k, v in CUP.items() if k != key}, "list.toml")


def test_good_entries_are_read_with_their_defaults_and_whole_numbers_will_do() -> None:
    """Control for the refusals."""
    assert from_table(BewareClass, CUP, "t") == BewareClass(name="cup", class_id=1)
    assert from_table(BewareClass, {**RED, "margin_m": 1}, "t") == BewareClass(
        name="red floor", class_id=2, margin_m=1.0, colour=ColourRule(hue_deg=(345.0, 15.0))
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    mode: Literal["slow", "fast"] = "slow"
    places: tuple[tuple[float, float], ...] = ranged(-1.0, 1.0, default=())
    count: int = ranged(0, 5, default=0)


def test_nested_tuples_and_choices_are_checked_down_to_the_number() -> None:
    assert from_table(Sample, {"mode": "fast", "places": [[0, 1], [0.5, -1]]}, "t").places == (
        (0.0, 1.0),
        (0.5, -1.0),
    )
    with pytest.raises(
        BadConfiguration, match=r"t\.places\[1\]\[0\]: 2.0 is out of range, allowed -1 to 1"
    ):
        from_table(Sample, {"places": [[0, 1], [2, 0]]}, "t")
    with pytest.raises(
        BadConfiguration, match=r"t\.mode: expected one of 'slow', 'fast', got 'quick'"
    ):
        from_table(Sample, {"mode": "quick"}, "t")
    with pytest.raises(BadConfiguration, match="t: expected a table"):
        from_table(Sample, [], "t")


@pytest.mark.parametrize("what", ["name", "class_id"])
def test_no_name_and_no_id_may_occur_twice(what: str) -> None:
    first, second = {"name": "a", "class_id": 1}, {"name": "b", "class_id": 2}
    second[what] = first[what]
    with pytest.raises(BadConfiguration, match=f"{what} .* occurs more than once"):
        BewareList(classes=tuple(from_table(BewareClass, entry, "t") for entry in (first, second)))


LIST = BewareList(
    classes=(
        BewareClass(name="cup", class_id=1, margin_m=0.3, min_confidence=0.8),
        BewareClass(name="mud", class_id=2),
    )
)


def test_an_edit_makes_the_next_version_and_leaves_the_old_value_untouched() -> None:
    before = BewareList(classes=LIST.classes, version=LIST.version)
    after = LIST.edited("mud", enabled=False, margin_m=0.5)
    assert before == LIST
    assert after.version == LIST.version + 1
    assert after.classes[0] is LIST.classes[0]
    assert after.named("mud") == BewareClass(name="mud", class_id=2, enabled=False, margin_m=0.5)
    assert [entry.name for entry in after.enabled] == ["cup"]


@pytest.mark.parametrize(
    ("name", "changes", "words"),
    [
        ("cat", {"enabled": True}, "no class 'cat'; known classes: cup, mud"),
        ("cup", {"margin_m": 9.0}, r"beware list: cup\.margin_m: 9.0 is out of range"),
        ("cup", {"margin_m": "0.1"}, r"cup\.margin_m: expected float"),
        ("cup", {"name": "mud"}, "'mud' has class_id 2 for ever"),
        ("cup", {"class_id": 2}, "class_id cannot be changed"),
        ("cup", {"margn_m": 0.1}, "margn_m"),
        ("cup", {"margin_m": None}, "margin_m"),
        ("cup", {"min_confidence": None}, "min_confidence"),
    ],
)
def test_a_bad_edit_is_refused_by_name_and_changes_nothing(
    name: str, changes: dict[str, object], words: str
) -> None:
    before = BewareList(classes=LIST.classes, version=LIST.version)
    with pytest.raises(BadConfiguration, match=words):
        LIST.edited(name, **changes)
    assert before == LIST


def test_a_class_keeps_its_id_since_the_map_knows_it_by_that() -> None:
    with pytest.raises(BadConfiguration, match="'mud' has class_id 2 for ever"):
        LIST.replaced(
            replace(entry, class_id=9) if entry.name == "mud" else entry for entry in LIST.classes
        )


def test_a_removed_class_keeps_its_id_because_the_map_may_still_hold_points_of_it() -> None:
    cup, mud = (LIST.named(name) for name in ("cup", "mud"))
    without = LIST.replaced(entry for entry in LIST.classes if entry != cup).edited(
        "mud", enabled=False
    )
    assert without.retired == (("cup", cup.class_id),)
    with pytest.raises(BadConfiguration, match="class_id 1 belongs to 'cup' for ever"):
        without.replaced([mud, replace(cup, name="snake")])
    with pytest.raises(BadConfiguration, match="'cup' has class_id 1 for ever"):
        without.replaced([mud, replace(cup, class_id=9)])
    back = without.replaced([mud, cup])
    assert back.retired == ()
    assert back.classes == (mud, cup)


def test_the_list_that_is_shipped_is_sound() -> None:
    shipped = default_beware_list()
    assert shipped.enabled
    assert len({entry.class_id for entry in shipped.classes}) == len(shipped.classes)


def test_files_are_read_and_errors_name_file_and_key(tmp_path: Path) -> None:
    file = tmp_path / "list.toml"
    file.write_text(
        '[[beware]]\nname = "cup"\nclass_id = 1\n'
        '[[beware]]\nname = "mud"\nclass_id = 2\nenabled = false\n'
    )
    assert [entry.name for entry in load_beware_list(file).enabled] == ["cup"]
    file.write_text('[[beware]]\nname = "cup"\nclass_id = 1\ncolor = 3\n')
    with pytest.raises(
        BadConfiguration, match=r"list\.toml: line 4: beware\[0\]: unknown key 'color'"
    ):
        load_beware_list(file)
    file.write_text("[[beware\n")
    with pytest.raises(BadConfiguration, match=r"list\.toml: not readable as TOML.*line 1"):
        load_beware_list(file)
    with pytest.raises(BadConfiguration, match="no such file"):
        load_beware_list(tmp_path / "none.toml")
    file.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BadConfiguration, match="not readable"):
        load_beware_list(file)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r", "\r\r\n"])
def test_the_line_ends_of_every_system_are_read(end: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_bytes(f"# one{end}a = 1{end}b = 2{end}".encode())
    assert read_toml(file) == {"a": 1, "b": 2}


def test_what_is_no_file_of_a_usual_size_is_refused_without_being_read_whole(
    tmp_path: Path,
) -> None:
    large = tmp_path / "large.toml"
    large.touch()
    os.truncate(large, MAX_BYTES + 1)
    os.mkfifo(tmp_path / "pipe.toml")
    for path, words in (
        (large, f"larger than the allowed {MAX_BYTES} bytes"),
        (tmp_path, "not a regular file"),
        (tmp_path / "pipe.toml", "not a regular file"),
    ):
        with pytest.raises(BadConfiguration, match=words):
            read_toml(path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("safety_margin = 0.1", r"nav\.toml: unknown key 'safety_margin'"),
        ("safety_margin_m = -0.1", r"nav\.toml\.safety_margin_m: -0.1 is out of range"),
        ("safety_margin_m = inf", r"nav\.toml\.safety_margin_m: inf is out of range"),
        ("[points]\nmin_support = 0", r"nav\.toml\.points\.min_support: 0 is out of range"),
        ("[map]\npose_spacing = 1", r"nav\.toml\.map: unknown key 'pose_spacing'"),
        ("[local]\npadding_m = 'x'", r"nav\.toml\.local\.padding_m: expected float"),
        ("local = 3", r"nav\.toml\.local: expected a table"),
        (
            "[control.dynamic_window]\nturn_shares = []",
            r"nav\.toml\.control\.dynamic_window\.turn_shares: is empty",
        ),
        ("[points]\nobstacle_height_m = 0.9\nceiling_m = 0.3", "ceiling_m|obstacle_height_m"),
        (
            "[perception.people.detector]\nradius_m = 0.6",
            r"nav\.toml\..*people\.detector: radius_m 0\.6 must be below half",
        ),
        (
            "[perception.people.detector]\ncell_m = 0.05",
            r"people\.detector: max_range_m 5\.5 must be at most 3\.2",
        ),
    ],
)
def test_a_bad_configuration_is_refused_by_file_and_key(
    tmp_path: Path, text: str, words: str
) -> None:
    file = tmp_path / "nav.toml"
    file.write_text(text)
    with pytest.raises(BadConfiguration, match=words):
        load_config(file)


def test_an_empty_file_is_the_default_configuration(tmp_path: Path) -> None:
    file = tmp_path / "nav.toml"
    file.write_text("")
    assert load_config(file) == NavigatorConfig()
    file.write_text("safety_margin_m = 0.25\n[points]\nmin_support = 4\n")
    assert (load_config(file).safety_margin_m, load_config(file).points.min_support) == (0.25, 4)


def test_what_is_an_obstacle_follows_the_height_of_the_robot() -> None:
    husky = load_profile("husky")
    assert config_for(husky).points.ceiling_m == pytest.approx(husky.height_m + HEADROOM_M)
    low = replace(husky, height_m=0.3)
    assert config_for(low).points.ceiling_m == pytest.approx(husky.camera.z_m + HEADROOM_M)
    # A profile that does not say how tall the robot is may be that of a tall one.
    assert config_for(load_profile("jackal")).points.ceiling_m == pytest.approx(1.5)
    mast = replace(husky, camera=replace(husky.camera, z_m=4.0))
    assert config_for(mast).points.ceiling_m < 2.8


def test_what_a_file_leaves_out_is_as_the_robot_starts_with(tmp_path: Path) -> None:
    file, jackal = tmp_path / "nav.toml", load_profile("jackal")
    file.write_text("[local]\nlookahead_m = 1.0\n")
    base = config_for(jackal)
    assert base.local.padding_m != LocalPlannerConfig().padding_m
    assert load_config(file, jackal) == replace(base, local=replace(base.local, lookahead_m=1.0))
    file.write_text("[local]\nlookahead_m = 30.0\n")
    with pytest.raises(
        BadConfiguration, match=r"nav\.toml\.local\.lookahead_m: 30\.0 is out of range"
    ):
        load_config(file)
