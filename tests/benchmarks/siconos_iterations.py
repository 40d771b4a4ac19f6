"""Time an iteration of siconos' fc2d_nsgs; run by Debian's Python, which has siconos, on a saved contact problem.

python3 siconos_iterations.py DELASSUS.npz: prints one line of JSON.
"""

import json
import sys
import time

import numpy as np
import siconos.numerics as sn
from scipy.sparse import csr_matrix

FEW, MANY = 20, 220


def main(path):
    data = np.load(path)
    size = len(data["free"])
    delassus = csr_matrix((data["value"], (data["row"], data["col"])), shape=(size, size))
    status, blocks = sn.SBM_from_csparse(2, delassus)
    assert status == 0
    problem = sn.FrictionContactProblem()
    problem.dimension, problem.numberOfContacts = 2, size // 2
    problem.M = sn.NM_new_SBM(size, size, blocks)
    problem.q = data["free"]
    problem.mu = np.full(size // 2, float(data["friction"]))

    def seconds(iterations):
        options = sn.SolverOptions(sn.SICONOS_FRICTION_2D_NSGS)
        options.iparam[sn.SICONOS_IPARAM_MAX_ITER] = iterations
        options.dparam[sn.SICONOS_DPARAM_TOL] = 0.0
        reaction, velocity = np.zeros(size), np.zeros(size)
        since = time.process_time()
        sn.fc2d_driver(problem, reaction, velocity, options)
        spent = time.process_time() - since
        assert options.iparam[sn.SICONOS_IPARAM_ITER_DONE] >= iterations, "siconos stopped early"
        return spent, float(np.abs(reaction).sum())

    few = min(seconds(FEW)[0] for _ in range(5))
    many, force = min(seconds(MANY) for _ in range(5))
    assert force > 0
    print(json.dumps({"ns_per_contact": (many - few) / (MANY - FEW) / (size // 2) * 1e9}))


main(sys.argv[1])
