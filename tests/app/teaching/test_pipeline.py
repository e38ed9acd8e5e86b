"""The pipeline of the paper's figure 3 without page and drive: frames of the simulator, marked by a
click each, teach the shipped network a class that it never knew."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.teaching.frames.live_frames import LiveFrames
from app.teaching.networks.versions import MODEL_NAME
from app.teaching.training.plan import TrainingPlan, prepare
from app.teaching.training.run import TeachingRun
from navcore.learning.data.card import Sample
from navcore.learning.teaching.teaching_recipe import TeachingRecipe
from navcore.learning.training.evaluation import InferenceSettings, predict
from navcore.perception.esanet.inference.network_file import SHIPPED
from navcore.perception.esanet.network.preprocess import Size
from navcore.perception.esanet.weights.weights_file import load
from tests.app.teaching.shoe_room import VIEWPOINTS, frames_of_the_shoe, room_file, shoe_in
from web.interface.teaching import Annotation

SIZE = Size(height=256, width=416)
TOLERANCE = 18.0


def marked_frames(folder: Path) -> LiveFrames:
    """Return frames of a shoe, each marked by a click into its middle."""
    frames_of_the_shoe(folder / "frames", room_file(folder))
    frames = LiveFrames(folder / "frames", newest=lambda: None, class_names=lambda: ["shoe"])
    for frame in frames.all():
        at = shoe_in(frames.store.images(frame.id)[0])
        assert at is not None
        region = frames.region(frame.id, *at, TOLERANCE).astype(np.uint8)
        frames.annotate(frame.id, Annotation(class_names=("shoe",), labels=region))
    return frames


@pytest.mark.long
def test_a_class_is_captured_marked_taught_and_found(tmp_path: Path) -> None:
    frames = marked_frames(tmp_path)
    plan = TrainingPlan(
        name="taught 1",
        start_name="start",
        start_path=str(SHIPPED),
        class_names=(),
        created_unix_s=0.0,
        threads=1,
        size=(SIZE.height, SIZE.width),
        recipe=TeachingRecipe(rehearsal=4, rendered_test=4, seed=2000),
    )
    prepare(tmp_path / plan.name, frames.store, plan)
    version = TeachingRun(tmp_path / plan.name).run()
    figures = {one.name: one for one in version.figures}
    assert version.not_found == () and version.class_names[-1] == "shoe"
    assert figures["shoe"].old is None and (figures["shoe"].new or 0.0) > 0.7
    assert version.kept_share is not None and version.kept_share > 0.99

    # The file that the robot would use finds the shoe, where the shipped network finds something
    # else.
    newest = frames.all()[len(VIEWPOINTS) - 1].id
    rgb, depth = frames.store.images(newest)
    truth = frames.annotation(newest).labels > 0
    sample = Sample(rgb=rgb, depth=depth, labels=truth.astype(np.uint8))
    taught = load(tmp_path / plan.name / MODEL_NAME)
    settings = InferenceSettings(size=SIZE, batch=1)
    seen = predict(taught.network, [sample], settings, taught.card.depth)[0]
    shoe = version.class_names.index("shoe")
    assert (seen[truth] == shoe).mean() > 0.7 and (seen[~truth] == shoe).mean() < 0.005
