"""Labels of pixels whose colour is not known do not count."""

from __future__ import annotations

import dataclasses

import numpy as np

from navcore.mission.beware_list import NOTHING
from navcore.perception.labels import Labels, with_full_confidence
from navcore.stages import Stages
from tests.navcore.scene import RED_LIST, picture


class Everywhere:
    """A segmenter that sees the same class in every pixel, by two sources."""

    def segment(self, frame: object, beware: object) -> Labels:
        source = with_full_confidence(np.full(picture().depth_m.shape, 5, dtype=np.uint8))
        return dataclasses.replace(source, hypotheses=(source, source))


def test_the_stage_of_the_segmenter_labels_no_pixel_without_a_colour() -> None:
    uncoloured = np.zeros(picture().depth_m.shape, dtype=np.bool_)
    uncoloured[40:60, 30:50] = True
    segment = Stages().segment
    frame = dataclasses.replace(picture(), uncoloured=uncoloured)
    labels = segment(Everywhere(), frame, RED_LIST)  # type: ignore[arg-type]
    for source in (labels, *labels.hypotheses):
        np.testing.assert_array_equal(source.class_ids == NOTHING, uncoloured)
    whole = segment(Everywhere(), picture(), RED_LIST)  # type: ignore[arg-type]
    assert (whole.class_ids == 5).all()
