"""What takes time before a robot drives: compiled kernels and a network with its engine."""

from __future__ import annotations

from collections.abc import Callable

from app.runtime.start.engine_memory import EngineMemory
from app.runtime.start.kernel_compiler import compiling_apart
from app.runtime.start.progress_lines import LOADING_NETWORK, Progress, announced, on_stderr
from app.runtime.start.segmentation import Perception, compose
from app.runtime.start.segmenter_choice import SegmenterChoice
from navcore.config.perception.perception import DEFAULT_PERCEPTION, PerceptionConfig
from navcore.perception.esanet.inference.selection import TrialStep
from navcore.robot.profile import DepthSensor


def prepared_perception(
    choice: SegmenterChoice,
    *,
    sensor: DepthSensor,
    config: PerceptionConfig = DEFAULT_PERCEPTION,
    say: Callable[[Progress], None] = on_stderr,
) -> Perception:
    """Compose the chosen segmenter for the depth camera `sensor`, with the engine that is
    remembered, while what is not in the cache of kernels is compiled beside it; both are done at
    the end.

    The compilers pause while an engine is timed: only a quiet machine tells which one is fast.
    """
    trials: list[TrialStep] = []

    with compiling_apart(say) as compiler:
        if choice.kind == "colour":  # there is nothing to load
            return compose(choice, sensor=sensor, config=config)

        def watch(step: TrialStep) -> None:
            trials.append(step)
            compiler.pause(step.is_timed)

        def count() -> tuple[int, int] | None:
            return (trials[-1].done, trials[-1].all) if trials else None

        with announced(LOADING_NETWORK, say=say, count=count):
            return compose(
                choice,
                sensor=sensor,
                config=config,
                memory=EngineMemory.of_user(),
                apart=True,
                watch=watch,
            )
