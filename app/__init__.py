"""The composition root: configuration, command line, threads, storage and robot back ends."""

import os

# Two busy BLAS threads starve the command thread (p99 of its wait 144 ms instead of 44 ms on two
# cores), and no array here is large enough to gain from them. Must be set before numpy is imported.
for _library in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_library, "1")

# A thread of torch that waits for the other spins; for ever, on a machine where something else
# wants the core. Measured on two cores beside one busy process: 1860 ms a picture with the
# library's own number, 120 ms with this one, 39 and 38 ms alone.
os.environ.setdefault("GOMP_SPINCOUNT", "6000")
