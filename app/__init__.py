"""The composition root: configuration, command line, threads, storage and robot back ends."""

import os

# Two busy BLAS threads starve the command thread (p99 of its wait 144 ms instead of 44 ms on two
# cores), and no array here is large enough to gain from them. Must be set before the numpy import.
for _library in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_library, "1")

# A waiting torch thread spins, without end on a machine whose cores are busy. Measured on two cores
# beside one busy process: 1860 ms per image with the library's default, 120 ms with this value;
# alone 39 and 38 ms.
os.environ.setdefault("GOMP_SPINCOUNT", "6000")
