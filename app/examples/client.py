"""Drive the robot from a program: draw a zone around a wet floor, drive to a goal, and stop the
robot in any case.

`python app/examples/client.py http://127.0.0.1:8000 2.0 2.5`, with a user's token in
BEWARENAV_TOKEN if a login is required.
"""

import os
import sys
import time

import httpx


def main(console: str, x_m: float, y_m: float) -> int:
    """Return 0 when the robot has reached the goal."""
    token = os.environ.get("BEWARENAV_TOKEN")
    headers = {"Authorization": f"Bearer {token}"} if token else {}
    with httpx.Client(
        base_url=f"{console}/api/v1", headers=headers, timeout=10.0, trust_env=False
    ) as robot:
        corners = [[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]]
        zone = {"name": "wet floor", "geometry": {"type": "Polygon", "coordinates": [corners]}}
        zone = robot.post("/zones", json=zone).raise_for_status().json()
        try:
            robot.post("/goals", json={"x_m": x_m, "y_m": y_m}).raise_for_status()
            robot.post("/mission/start").raise_for_status()
            while (state := robot.get("/state").raise_for_status().json())["phase"] == "driving":
                print(state["summary"])
                time.sleep(0.5)
            return 0 if state["reached"] else 1
        finally:
            robot.post("/stop", params={"by": "client.py"})
            robot.delete(f"/zones/{zone['id']}")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], float(sys.argv[2]), float(sys.argv[3])))
