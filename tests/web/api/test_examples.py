"""Routes of classes by example: click, look, add; and where no network runs."""

from __future__ import annotations

import httpx
import pytest

from tests.navcore.perception.colour_network import ColourNetwork
from tests.web.api.answers import wrong
from tests.web.fake_operations import FakeOperations

BEWARE = "/api/v1/beware"
BOX = {"right": 45 / 320, "down": 75 / 180}
FLOOR = {"right": 0.1, "down": 0.95}


class TestWithNetwork:
    @pytest.fixture
    def operations(self) -> FakeOperations:
        """Return a robot whose network has features."""
        return FakeOperations(network=ColourNetwork())

    def test_a_thing_is_clicked_looked_at_and_added(self, client: httpx.Client) -> None:
        assert client.get(BEWARE).json()["no_examples"] is None
        click = client.post(f"{BEWARE}/example/click", json=BOX).json()
        assert click["mask"].startswith("data:image/png;base64,")
        made = client.post(f"{BEWARE}/example", json={"clicks": [click["key"]]}).json()
        newest = made["looks"][0]
        assert 0 < newest["share"] < 0.1
        looks = client.post(f"{BEWARE}/example/looks", json=made["prototype"]).json()["looks"]
        assert looks[0]["mask"] == newest["mask"]
        foreign = client.post(
            f"{BEWARE}/example/looks", json={**made["prototype"], "network": "other"}
        )
        assert "another network" in wrong(foreign, 409)["message"]
        draft = {"name": "crate", "prototype": made["prototype"]}
        preview = client.post(f"{BEWARE}/preview", json={"add": draft})
        assert preview.status_code == 200
        added = client.post(BEWARE, json=draft).json()["classes"][-1]
        assert (added["name"], added["found_by"]) == ("crate", "example")
        text = client.get(f"{BEWARE}.toml").text
        assert client.put(f"{BEWARE}.toml", content=text).json()["classes"][-1] == added
        again = wrong(client.post(f"{BEWARE}/example/click", json=BOX), 409)
        assert "“crate” already" in again["message"]

    def test_floor_and_forgotten_clicks_and_images_are_refused(self, client: httpx.Client) -> None:
        assert (
            "only floor"
            in wrong(client.post(f"{BEWARE}/example/click", json=FLOOR), 409)["message"]
        )
        old = client.post(f"{BEWARE}/example/click", json={**BOX, "frame": "5"})
        assert "no longer kept" in wrong(old, 409)["message"]
        gone = client.post(f"{BEWARE}/example", json={"clicks": ["x"]})
        assert "click the thing again" in wrong(gone, 409)["message"]
        for clicks in ([], ["x"] * 17, [5]):
            wrong(client.post(f"{BEWARE}/example", json={"clicks": clicks}), 422)
        endless = {"name": "crate", "prototype": {"weights": [1.0] * 600}}
        wrong(client.post(BEWARE, json=endless), 422)


def test_without_a_network_the_answer_says_why_it_cannot_be_done(client: httpx.Client) -> None:
    assert "only colour rules run here" in client.get(BEWARE).json()["no_examples"]
    refused = client.post(f"{BEWARE}/example/click", json=BOX)
    assert "only colour rules run here" in wrong(refused, 409)["message"]
