"""Solve the controller's exported problems with DAQP, PIQP and OSQP, and time each solver from inside.

    trefoil measure mpc --export DIR
    pip install daqp piqp osqp numpy scipy
    python compare_solvers.py DIR [--json]

Each file in DIR holds the problems of one flight: minimise 1/2 x'Hx + f'x so that rows x + offsets >= 0, with one f per
tick and everything else the same. Every solver is set up once per flight and then only told the next f, as a controller
would. `trefoil measure mpc --compare PYTHON` runs this script, and judges.

What is timed:
  daqp   its own `solve_time`, from the last working set, and on top the update of f, which its `solve_time` leaves out:
         the call `update(f)` less the same call to a model of one variable, which leaves what Python takes of it.
         One more row has `solve_time` alone.
  piqp   its own `update_time` and `solve_time`, dense solver.
  osqp   its own `update_time` and `solve_time`, from the last solution.
"""

import argparse
import functools
import json
import pathlib
import statistics
import sys
import time
from importlib.metadata import version

import daqp
import numpy as np
import osqp
import piqp
from scipy import sparse



def solve_daqp(problem, rounds, with_update=True):
    """Times [ns] by tick and round, and the solutions."""
    hessian, upper, offsets, fs = problem
    one = np.ones(1)
    tiny = daqp.Model()
    tiny.setup(np.eye(1), one, np.eye(1), one, -one)
    times, solutions = [], []
    for _ in range(rounds):
        model = daqp.Model()
        model.setup(hessian, fs[0], upper, offsets)
        model.settings = {"primal_tol": 1e-9}
        times.append([])
        solutions = []
        for f in fs:
            start = time.perf_counter_ns()
            tiny.update(f=one)
            between = time.perf_counter_ns()
            model.update(f=f)
            end = time.perf_counter_ns()
            x, _, flag, info = model.solve()
            update = max(0, (end - between) - (between - start)) if with_update else 0
            times[-1].append(info["solve_time"] * 1e9 + update)
            solutions.append(np.array(x) if flag > 0 else None)
    return times, solutions


def solve_piqp(problem, rounds):
    """Times [ns] by tick and round, and the solutions."""
    hessian, upper, offsets, fs = problem
    solver = piqp.DenseSolver()
    solver.settings.compute_timings = True
    solver.settings.eps_abs = solver.settings.eps_rel = 1e-9
    solver.setup(hessian, fs[0], None, None, upper, None, offsets, None, None)
    times, solutions = [], []
    for _ in range(rounds):
        times.append([])
        solutions = []
        for f in fs:
            solver.update(c=f)
            status = solver.solve()
            info = solver.result.info
            times[-1].append((info.update_time + info.solve_time) * 1e9)
            solutions.append(solver.result.x.copy() if status == piqp.PIQP_SOLVED else None)
    return times, solutions


def solve_osqp(problem, rounds):
    """Times [ns] by tick and round, and the solutions."""
    hessian, upper, offsets, fs = problem
    times, solutions = [], []
    for _ in range(rounds):
        solver = osqp.OSQP()
        solver.setup(
            sparse.csc_matrix(np.triu(hessian)), fs[0], sparse.csc_matrix(upper), np.full(len(offsets), -np.inf), offsets,
            verbose=False, eps_abs=1e-5, eps_rel=1e-5, max_iter=100_000,
        )
        times.append([])
        solutions = []
        for f in fs:
            solver.update(q=f)
            result = solver.solve()
            times[-1].append((result.info.update_time + result.info.solve_time) * 1e9)
            solutions.append(result.x if result.info.status == "solved" else None)
    return times, solutions


SOLVERS = [
    ("daqp", "", solve_daqp, "update of f, from outside, and its solve_time; warm"),
    ("daqp", ", solve alone", functools.partial(solve_daqp, with_update=False), "its solve_time; warm"),
    ("piqp", "", solve_piqp, "its update_time and solve_time; dense, 1e-9"),
    ("osqp", "", solve_osqp, "its update_time and solve_time; warm, 1e-5"),
]


def read(path):
    """The problems of one file: (H, A, b, fs) with A x <= b, and all that the file says."""
    told = json.loads(path.read_text())
    hessian, rows, offsets, fs = (np.array(told[key]) for key in ("H", "rows", "offsets", "f"))
    return (hessian, -rows, offsets, fs), told


def miss(problem, solutions, told):
    """The largest difference from our objectives where a constraint is active, as a share of them, and how many problems
    were not solved."""
    hessian, _, _, fs = problem
    worst, unsolved = 0.0, 0
    for x, f, ours, constrained in zip(solutions, fs, told["objective"], told["constrained"]):
        if x is None or not np.all(np.isfinite(x)):
            unsolved += 1
        elif constrained and ours is not None:
            worst = max(worst, abs(float(x @ hessian @ x / 2 + f @ x) - ours) / abs(ours))
    return worst, unsolved


def measure(package, part, solve, timed, files, rounds):
    """One row of the table."""
    times, worst, unsolved = [], 0.0, 0
    for problem, told in files:
        by_round, solutions = solve(problem, rounds)
        times += [round(statistics.median(of_tick)) for of_tick in zip(*by_round)]
        here, missing = miss(problem, solutions, told)
        worst, unsolved = max(worst, here), unsolved + missing
    return {
        "solver": f"{package} {version(package)}{part}", "timed": timed,
        "worst_difference": worst, "unsolved": unsolved, "times_ns": times,
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path, help="what `trefoil measure mpc --export` wrote")
    parser.add_argument("--rounds", type=int, default=11, help="a problem's time is its median over so many")
    parser.add_argument("--json", action="store_true", help="print JSON")
    arguments = parser.parse_args()
    files = [read(path) for path in sorted(arguments.folder.glob("*.json"))]
    if not files:
        sys.exit(f"no problems in {arguments.folder}: write them with `trefoil measure mpc --export`")
    table = [measure(*solver, files, arguments.rounds) for solver in SOLVERS]
    if arguments.json:
        print(json.dumps(table))
        return
    print(f"{'':26}{'p50':>10}{'p90':>10}{'p99':>10}{'max':>10} us   difference  unsolved   timed")
    for row in table:
        p50, p90, p99, top = np.percentile(row["times_ns"], [50, 90, 99, 100]) / 1e3
        print(f"{row['solver']:26}{p50:10.2f}{p90:10.2f}{p99:10.2f}{top:10.2f}      {row['worst_difference']:10.1e}"
              f"{row['unsolved']:10}   {row['timed']}")


if __name__ == "__main__":
    main()
