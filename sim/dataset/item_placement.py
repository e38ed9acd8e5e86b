"""Random placement of beware objects, and of objects that only resemble them, on the floor of a
random world."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from navcore.geometry.transform import Pose2
from sim.dataset import palette
from sim.dataset.outlines import Corners, as_tuples, blob, zone
from sim.dataset.scene import BACKGROUND, Decal, Poster, ScenePlan, SolidObject, Spot
from sim.models.item_shapes import cable_solids
from sim.models.items import ITEM_COLOURS, ITEM_SIZES, item_extent, item_shapes, item_solids
from sim.models.person import DEFAULT_APPEARANCE, Appearance, person_solids
from sim.models.solids import Solid, cylinder, facing_quaternion, quaternion

SHARES = {
    "book": 0.6,
    "cup": 0.7,
    "bottle": 0.6,
    "cable": 0.6,
    "box": 0.5,
    "keyboard": 0.6,
    "landmine": 0.6,
    "wet-floor sign": 0.5,
}
"""Share of worlds that hold each kind of item."""
RED_SHARE, SPILL_SHARE, PERSON_SHARE = 0.55, 0.6, 0.6
SIZE_RANGES = {
    "cup": (0.85, 1.25),
    "book": (0.6, 1.25),
    "bottle": (0.8, 1.3),
    "box": (0.5, 1.4),
    "landmine": (0.75, 1.2),
}
"""Range of the size factor by kind; others vary by a tenth."""


class ItemPlacer:
    """Places objects in a scene plan around one focus."""

    def __init__(
        self, plan: ScenePlan, *, focus: tuple[float, float], patterns: tuple[int, int], prints: int
    ) -> None:
        self._plan, self._rng, self._focus = plan, plan.rng, focus
        self._patterns, self._prints = patterns, prints

    def place_all(self) -> None:
        """Place all objects, from the floor upwards."""
        self._put_other_markings()
        self._put_red_floor()
        self._put_spills()
        for kind, share in SHARES.items():
            draw = self._rng.random()
            for _ in range((draw < share) + (draw < 0.35 * share)):
                self._put_item(kind)
        self._put_clutter()
        self._put_people()
        self._put_prints()

    def _near_focus(self, low_m: float = 0.0, high_m: float = 2.4) -> tuple[float, float]:
        distance, turn = self._rng.uniform(low_m, high_m), self._rng.uniform(-math.pi, math.pi)
        return self._focus[0] + float(distance * math.cos(turn)), self._focus[1] + float(
            distance * math.sin(turn)
        )

    def _spot(self, radius_m: float, *, high_m: float = 2.4) -> tuple[float, float] | None:
        for _ in range(25):
            x, y = self._near_focus(high_m=high_m)
            if self._plan.free(x, y, radius_m):
                return x, y
        return None

    def _put(
        self,
        label: str,
        solids: tuple[Solid, ...],
        at: tuple[float, float],
        radius_m: float,
        *,
        aim: bool,
    ) -> None:
        yaw = float(self._rng.uniform(-math.pi, math.pi))
        self._plan.objects.append(
            SolidObject(label=label, solids=solids, pose=Pose2(x_m=at[0], y_m=at[1], yaw_rad=yaw))
        )
        spot = Spot(x_m=at[0], y_m=at[1], radius_m=radius_m)
        self._plan.blocked.append(spot)
        if aim:
            self._plan.targets.append(spot)

    def _put_item(self, kind: str) -> None:
        rng = self._rng
        low, high = SIZE_RANGES.get(kind, (0.9, 1.1))
        by, own = rng.uniform(low, high), rng.uniform(0.92, 1.08, 3)
        x, y, z = (
            float(side * by * scale) for side, scale in zip(ITEM_SIZES[kind], own, strict=True)
        )
        if kind in ("cup", "bottle", "landmine"):
            y = x
        if kind == "book":
            z = float(rng.uniform(0.012, 0.06))
        shapes = item_shapes(kind)
        shape = shapes[0] if self._plan.plain and rng.random() < 0.4 else str(rng.choice(shapes))
        colour = (
            ITEM_COLOURS[kind]
            if self._plan.plain and rng.random() < 0.4
            else palette.item(rng, kind)
        )
        extent = item_extent(kind, (x, y, z), shape)
        radius = 0.4 if kind == "cable" else math.hypot(extent[0], extent[1]) / 2
        at = self._spot(radius + 0.04)
        if at is None:
            return
        solids = (
            self._cable(colour) if kind == "cable" else item_solids(kind, (x, y, z), colour, shape)
        )
        self._put(kind, solids, at, radius, aim=True)

    def _cable(self, colour: tuple[int, int, int]) -> tuple[Solid, ...]:
        """Return a cable of one to two metres with random bends."""
        rng = self._rng
        count, length = 28, rng.uniform(1.0, 2.0)
        bend = np.interp(
            np.arange(count), np.linspace(0, count - 1, 6), rng.normal(0, 0.24, 6)
        ) + rng.normal(0, 0.08)
        turns = np.cumsum(bend)
        steps = length / count * np.column_stack([np.cos(turns), np.sin(turns)])
        points = np.vstack([[0.0, 0.0], np.cumsum(steps, axis=0)])
        return cable_solids(points - points.mean(axis=0), float(rng.uniform(0.006, 0.015)), colour)

    def _put_clutter(self) -> None:
        """Place small background objects of any colour."""
        rng = self._rng
        for _ in range(int(rng.integers(0, 4))):
            colour, size = palette.any_colour(rng), float(rng.uniform(0.08, 0.35))
            kind = str(rng.choice(["bag", "shoe", "ball", "cone", "stool"]))
            if kind in ITEM_SIZES:
                solids = item_solids(kind, ITEM_SIZES[kind], colour, item_shapes(kind)[0])
            elif kind == "stool":
                solids = (cylinder(0.25 + size, 0.25 + size, (0.0, 0.0), colour),)
            else:
                height = size if kind == "ball" else 1.6 * size
                form = Solid(
                    kind="ball",
                    size_m=(size, size, height),
                    centre_m=(0.0, 0.0, height / 2),
                    colour=colour,
                )
                solids = (form if kind == "ball" else replace(form, kind="cone"),)
            at = self._spot(0.3, high_m=3.5)
            if at is not None:
                self._put(BACKGROUND, solids, at, 0.25, aim=False)

    def _put_people(self) -> None:
        rng = self._rng
        if rng.random() > PERSON_SHARE:
            return
        for _ in range(1 + (rng.random() < 0.35)):
            stride = float(rng.choice([0.0, rng.uniform(0.05, 0.28)]))
            appearance = (
                DEFAULT_APPEARANCE
                if self._plan.plain and rng.random() < 0.6
                else self._random_appearance()
            )
            at = self._spot(0.35, high_m=3.2)
            if at is not None:
                self._put("person", person_solids(stride, appearance), at, 0.6, aim=True)

    def _random_appearance(self) -> Appearance:
        rng = self._rng
        return Appearance(
            height_m=float(rng.uniform(1.5, 1.98)),
            girth=float(rng.uniform(0.85, 1.25)),
            skin=palette.skin(rng),
            hair=None if rng.random() < 0.2 else palette.hair(rng),
            shirt=palette.any_colour(rng),
            trousers=palette.any_colour(rng),
            shoes=palette.any_colour(rng),
            skirt=bool(rng.random() < 0.2),
        )

    def _put_red_floor(self) -> None:
        rng = self._rng
        if rng.random() > RED_SHARE:
            return
        colour = (200, 20, 20) if self._plan.plain and rng.random() < 0.5 else palette.red(rng)
        x, y = self._near_focus(0.2, 2.6)
        corners = zone(rng, float(rng.uniform(0.35, 1.4))) + np.array([x, y])
        if rng.random() < 0.3:
            self._tape("red floor", corners, colour)
        else:
            self._plan.decals.append(
                Decal(label="red floor", polygon=as_tuples(corners), colour=colour)
            )
        self._plan.targets.append(Spot(x_m=x, y_m=y, radius_m=0.2))

    def _put_spills(self) -> None:
        rng = self._rng
        if rng.random() > SPILL_SHARE:
            return
        for _ in range(1 + (rng.random() < 0.25)):
            surface = str(rng.choice(["water", "mud", "chemical"]))
            x, y = self._near_focus(0.1, 2.4)
            outline = blob(rng, float(rng.uniform(0.2, 0.75))) + np.array([x, y])
            texture = int(rng.integers(4)) + 4 * ("water", "mud", "chemical").index(surface)
            ground = self._plan.decals[0].colour
            share = {"water": rng.uniform(0.4, 0.8), "mud": 0.1, "chemical": rng.uniform(0.0, 0.4)}[
                surface
            ]
            own = palette.spilt(rng, surface)
            mixed = tuple(
                round((1 - share) * a + share * b) for a, b in zip(own, ground, strict=True)
            )
            self._plan.decals.append(
                Decal(
                    label="spill",
                    polygon=as_tuples(outline),
                    colour=(mixed[0], mixed[1], mixed[2]),
                    texture=sum(self._patterns) + texture,
                    texture_side_m=float(rng.uniform(0.8, 2.0)),
                )
            )
            self._plan.targets.append(Spot(x_m=x, y_m=y, radius_m=0.15))

    def _put_other_markings(self) -> None:
        """Place tape, paint and rugs of other colours."""
        rng = self._rng
        for _ in range(int(rng.integers(0, 4))):
            at, kind = self._near_focus(0.0, 3.5), rng.random()
            corners = zone(rng, float(rng.uniform(0.3, 1.5))) + at
            if kind < 0.45:
                self._tape(BACKGROUND, corners, palette.other_marking(rng))
            else:
                rug = kind > 0.75 and not self._plan.plain
                texture = int(rng.integers(self._patterns[0])) if rug else None
                polygon, colour = as_tuples(corners), palette.other_marking(rng)
                self._plan.decals.append(
                    Decal(label=BACKGROUND, polygon=polygon, colour=colour, texture=texture)
                )

    def _tape(self, label: str, corners: Corners, colour: tuple[int, int, int]) -> None:
        """Add strips along the edges of a polygon, or along some of them."""
        width = float(self._rng.uniform(0.04, 0.12))
        keep = (
            len(corners)
            if self._rng.random() < 0.6
            else int(self._rng.integers(1, len(corners) + 1))
        )
        for a, b in list(zip(corners, np.roll(corners, -1, axis=0), strict=True))[:keep]:
            along = (b - a) / max(float(np.hypot(*(b - a))), 1e-6)
            side, ahead = width / 2 * np.array([-along[1], along[0]]), width / 2 * along
            strip = np.array(
                [a - ahead - side, b + ahead - side, b + ahead + side, a - ahead + side]
            )
            self._plan.decals.append(Decal(label=label, polygon=as_tuples(strip), colour=colour))

    def _put_prints(self) -> None:
        rng, (half_x, half_y) = self._rng, self._plan.half_m
        if rng.random() > 0.5:
            return
        for _ in range(int(rng.integers(1, 4))):
            size = (float(rng.uniform(0.15, 0.7)),) * 2
            texture, yaw = int(rng.integers(self._prints)), float(rng.uniform(-math.pi, math.pi))
            at_m, turn = (*self._near_focus(), 0.0), tuple(quaternion(yaw))
            if self._plan.walled and rng.random() < 0.4:
                side = int(rng.integers(4))
                shift, height = float(rng.uniform(-0.7, 0.7)), float(rng.uniform(0.3, 1.7))
                wall = (
                    (half_x, shift * half_y),
                    (shift * half_x, half_y),
                    (-half_x, shift * half_y),
                    (shift * half_x, -half_y),
                )
                inwards = 1 - 0.03 / max(abs(wall[side][0]), abs(wall[side][1]))
                at_m = (wall[side][0] * inwards, wall[side][1] * inwards, height)
                turn = tuple(facing_quaternion(side * math.pi / 2 + math.pi))
            self._plan.posters.append(Poster(texture=texture, at_m=at_m, turn=turn, size_m=size))
            if rng.random() < 0.5:
                self._plan.targets.append(Spot(x_m=at_m[0], y_m=at_m[1], radius_m=0.1))
