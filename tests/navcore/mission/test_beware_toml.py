"""A file of a beware list: what is wrong in it is named with its line and key."""

from __future__ import annotations

import pytest

from navcore.errors import BadConfiguration
from navcore.mission.beware_list import parse_beware_list

GOOD = """\
# a comment
[[beware]]
name = "cup"
class_id = 3
margin_m = 0.1

[[beware]]
name = "tape"
class_id = 4
colour = { hue_deg = [345, 15], min_saturation = 0.5 }
"""


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("margin_m = 0.1", "margin_m = 9", r"f.toml: line 5: beware\[0\].margin_m: 9.0 is out of"),
        ("margin_m = 0.1", "marge = 1", r"line 5: beware\[0\]: unknown key 'marge'"),
        ("class_id = 4", "", r"line 7: beware\[1\]: key 'class_id' is missing"),
        ("min_saturation = 0.5", "min_saturation = 5", r"line 10: beware\[1\].colour.min_sat"),
        ("[345, 15]", '"red"', r"line 10: beware\[1\].colour.hue_deg: expected a list"),
        ('"tape"', '"cup"', "line 8: name 'cup' occurs more than once"),
        ("class_id = 4", "class_id = 3", "line 9: class_id 3 occurs more than once"),
        ('"tape"', '""', "line 8: name ''"),
        ('"tape"', '".."', "line 8: .* are no names"),
        ('[[beware]]\nname = "tape"', "[[beware]\nname = 1", "not readable as TOML.*line 7"),
        ("class_id = 4", "class_id = ", "f.toml: not readable as TOML, see line 9$"),
        ("[345, 15]", "[345, 15", "f.toml: not readable as TOML, see line 10$"),
        (GOOD, "beware = 3", "f.toml: beware: expected a list, got 3"),
        (
            "margin_m = 0.1",
            "prototype = { network = 'a', centre = [1], spread = [1], weights = [1], radius = 1, "
            "threshold = 1, typical = 2, max_size_m = 1, min_height_m = 0, max_height_m = 1, "
            "clicks = 1 }",
            r"line 5: beware\[0\].prototype: centre, spread and weights: expected one number a",
        ),
        ("# a comment", "x = 1", "unknown key 'x'"),
        (
            "margin_m = 0.1",
            "min_size_m = 2\nmax_size_m = 0.5",
            r"line 5: beware\[0\].min_size_m: 2 is above max_size_m 0.5",
        ),
        (
            "min_saturation = 0.5",
            "min_saturation = 0.5, max_saturation = 0.1",
            r"line 10: beware\[1\].colour.min_saturation: 0.5 is above max_saturation 0.1",
        ),
        (
            "min_saturation = 0.5",
            "pattern = { max_gap_m = 1, min_value = 0.9, max_value = 0.2 }",
            r"line 10: beware\[1\].colour.pattern.min_value: 0.9 is above max_value 0.2",
        ),
    ],
)
def test_a_wrong_entry_is_named_with_its_line(old: str, new: str, reason: str) -> None:
    assert len(parse_beware_list(GOOD, "f.toml").classes) == 2  # control
    assert old in GOOD
    with pytest.raises(BadConfiguration, match=reason):
        parse_beware_list(GOOD.replace(old, new), "f.toml")
