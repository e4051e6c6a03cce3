"""Workers inside another pool's worker, and killed ones."""

from __future__ import annotations

import subprocess
import sys
from multiprocessing import get_context

import numpy as np
import pytest
from model import build
from threadpoolctl import threadpool_limits

from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.posterior.chains.sampling import sample
from mpam_calib.posterior.density.target import build_target, locate


def chain(seed: int) -> np.ndarray:
    """A short posterior sample, in processes of its own where it may have some."""
    made = build.specimen({"law": "linear", "order": 2}, build.loops((100.0, 150.0), 12.0, 20))
    noise = np.random.default_rng(seed).standard_normal(len(made.loops.force_N))
    made = build.with_force(made, 20.0 + noise)
    target = build_target(made, draw_blueprint(made, build.PLAIN))
    target, modes = locate(target, np.random.default_rng(seed))
    return sample(target, modes, seed, max_steps=40).chain


def test_a_worker_that_may_have_no_workers_draws_the_same():
    with get_context("fork").Pool(1, initializer=threadpool_limits, initargs=(1,)) as pool:
        inside = pool.apply(chain, (3,))
    np.testing.assert_array_equal(inside, chain(3))


HALF_SENT = """
import gc, os, struct, time
from multiprocessing.queues import SimpleQueue
from mpam_calib.posterior.density.pool import workers

def half(begun):
    for queue in [each for each in gc.get_objects() if isinstance(each, SimpleQueue)]:
        os.write(queue._writer.fileno(), struct.pack("!i", 1000) + b"half")
    os.write(begun, b".")
    time.sleep(600.0)

seen, begun = os.pipe()
try:
    with workers(None, 2) as pool:
        pool.executor.submit(half, begun)
        os.read(seen, 1)
        time.sleep(0.2)
        raise KeyboardInterrupt
except KeyboardInterrupt:
    print("stopped")
"""


@pytest.mark.skipif(sys.platform != "linux", reason="pipes and forks as Linux has them")
def test_nobody_waits_for_the_rest_of_a_result_of_a_killed_worker():
    result = subprocess.run([sys.executable, "-c", HALF_SENT], capture_output=True, timeout=60, check=False)
    assert (result.returncode, result.stdout, result.stderr) == (0, b"stopped\n", b"")
