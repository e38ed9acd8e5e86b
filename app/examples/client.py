"""Drive the robot from a program: draw a zone around a wet floor, drive to a goal, and leave the
robot standing and the zones as they were in any case.

`python app/examples/client.py http://127.0.0.1:8000 2.0 2.5`, with a user's token in
BEWARENAV_TOKEN if a login is required.
"""

import os
import sys
import time

import httpx


def ask(robot: httpx.Client, method: str, path: str, body: object = None) -> httpx.Response:
    """Send a request; a refusal ends the program with the console's own sentence."""
    answer = robot.request(method, path, json=body)
    if answer.is_error:
        raise SystemExit(answer.json()["error"]["message"])
    return answer


def main(console: str, x_m: float, y_m: float) -> int:
    """Return 0 when the robot has reached this goal, 1 when the mission has ended without it."""
    token = os.environ.get("BEWARENAV_TOKEN")
    headers = {"Authorization": f"Bearer {token}"} if token else {}
    with httpx.Client(
        base_url=f"{console}/api/v1", headers=headers, timeout=10.0, trust_env=False
    ) as robot:
        corners = [[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]]
        zone = {"name": "wet floor", "geometry": {"type": "Polygon", "coordinates": [corners]}}
        zone = ask(robot, "POST", "/zones", zone).json()
        goal = None
        try:
            goal = ask(robot, "POST", "/goals", {"x_m": x_m, "y_m": y_m}).json()["id"]
            ask(robot, "POST", "/mission/start")
            while (state := ask(robot, "GET", "/state").json())["phase"] == "driving":
                print(state["summary"])
                robot.post("/control/keep")  # a sign of life, for a console that pauses without one
                time.sleep(0.5)
            return 0 if goal in [reached["id"] for reached in state["reached"]] else 1
        finally:
            # Each of these is refused where there is nothing to do, and that is fine.
            robot.post("/mission/pause")
            robot.delete(f"/goals/{goal}")
            robot.delete(f"/zones/{zone['id']}")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], float(sys.argv[2]), float(sys.argv[3])))
