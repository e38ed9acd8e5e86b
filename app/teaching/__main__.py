"""The process of a training run: `python -m app.teaching FOLDER`, started by the console.

Exit codes: 0 done, 1 failed (the progress says why), 3 cancelled, 4 another process runs it.
"""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import sys
import threading
from pathlib import Path

from app.teaching.training.lock import RunLock

DONE, FAILED, CANCELLED, TAKEN = 0, 1, 3, 4
NICENESS = 19
"""The lowest priority: on a busy machine the robot's threads get nearly all of a core."""


def main(folder: Path) -> int:
    """Run the training in a folder."""
    # Ctrl-C reaches the whole group of the terminal; the console then ends this process itself.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with contextlib.suppress(OSError):  # where memory is short, a training is given up first
        Path("/proc/self/oom_score_adj").write_text("1000", encoding="ascii")
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(message)s")
    os.nice(NICENESS)
    with RunLock(folder) as is_mine:
        return _run(folder) if is_mine else TAKEN


def _run(folder: Path) -> int:
    import cv2
    import torch

    from app.teaching.training.progress import note_end
    from app.teaching.training.run import Cancelled, TeachingRun
    from navcore.errors import BewareNavError

    asked = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: asked.set())
    cv2.setNumThreads(1)
    try:
        run = TeachingRun(folder, asked.is_set)
        torch.set_num_threads(run.plan.threads)
        run.run()
    except Cancelled:
        note_end(folder, "cancelled")
        return CANCELLED
    except Exception as error:
        logging.exception("the training failed")
        known = isinstance(error, BewareNavError)
        said = str(error) if known else f"{type(error).__name__}: {error}"[:300]
        note_end(folder, "failed", said)
        return FAILED
    return DONE


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
