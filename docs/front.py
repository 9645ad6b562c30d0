"""Searches the front of each attitude law: error, delay margin, lag margin, error with mismatch, and effort.

`search` tunes one law together with its guidance by SMS-EMOA (Beume, Naujoks and Emmerich, European Journal of
Operational Research 181, 2007) and keeps tries that no other try dominates. `judge` flies the kept tries of all
searches on draws of another seed. `report` prints the hypervolume of each law, and the tunings that the rule of
docs/tried.md takes, flown on draws of a third seed. `laws` prints the best tuning of each law as TOML. The program
`trefoil` flies, or the one that TREFOIL names. docs/results/laws.md has the results.

    python3 -m venv front && front/bin/pip install pymoo==0.6.2 moocore==0.3.2 pyarrow
    for k in 1 2 3 4 5; do for law in mpc lqr pid geometric indi lqr1; do front/bin/python docs/front.py search $law $k
    done; done
    trefoil new nmpc --lang acados && make -C nmpc && front/bin/python docs/front.py search nmpc 1
    front/bin/python docs/front.py judge 41
    front/bin/python docs/front.py report 41 83; front/bin/python docs/front.py laws 41
"""

import itertools
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

import moocore
import numpy as np
import pyarrow.parquet
from pymoo.algorithms.moo.sms import SMSEMOA
from pymoo.core.problem import Problem
from pymoo.optimize import minimize
from scipy import stats

CAMPAIGNS = pathlib.Path(__file__).parents[1] / "campaigns"
TREFOIL = os.environ.get("TREFOIL", "trefoil")
RUNS = pathlib.Path("runs/front")
NMPC = pathlib.Path(os.environ.get("NMPC", "nmpc/controller.so")).absolute()  # by `trefoil new nmpc --lang acados`

# Each group of settings is scaled by one factor; a search begins at the values here.
GUIDANCE = [
    {"guidance.kp_phi": 0.55, "guidance.kp_theta": -0.55},
    {"guidance.ki_phi": 0.1, "guidance.ki_theta": -0.1},
    {"guidance.kd_phi": 0.45, "guidance.kd_theta": -0.45},
    {"guidance.disturbance_observer_radps": 1.0},
]
LAG = [{"attitude.actuator_lag_model_s": 0.035}]
ESTIMATE = [{"attitude.disturbance_gain": 0.02}]
# The weights of the demands stay as they are, because effort is measured with them. A common factor of all weights
# changes nothing, and each demand acts on states of its own, so that the weights of the states suffice.
COST = [
    {"attitude.mpc.q.0": 100.0},
    {"attitude.mpc.q.1": 1000.0, "attitude.mpc.q.2": 1000.0},
    {"attitude.mpc.q.3": 1000.0},
    {"attitude.mpc.q.4": 5.0, "attitude.mpc.q.5": 5.0},
]


def gains(law):
    """Returns the gains of a law without a model, with poles at 6 rad/s."""
    table = f"attitude.{law}"
    return [
        {f"{table}.kp.0": 6.0, f"{table}.ki.0": 9.0},
        {f"{table}.kp.1": 108.0, f"{table}.kp.2": 108.0},
        {f"{table}.ki.1": 216.0, f"{table}.ki.2": 216.0},
        {f"{table}.kd.0": 18.0, f"{table}.kd.1": 18.0},
        {f"{table}.kp.3": 108.0, f"{table}.ki.3": 216.0, f"{table}.kd.2": 18.0},
    ]


LAWS = {
    "mpc": [*GUIDANCE, *LAG, *ESTIMATE, *COST, {"guidance.preview_s": 0.4}],
    "lqr": [*GUIDANCE, *LAG, *ESTIMATE, *COST, {"guidance.lead_s": 0.12}],
    "pid": [*GUIDANCE, *LAG, *ESTIMATE, *gains("pid"), {"guidance.lead_s": 0.04}],
    "geometric": [*GUIDANCE, *LAG, *ESTIMATE, *gains("geometric"), {"guidance.lead_s": 0.04}],
    "indi": [
        *GUIDANCE,
        *LAG,
        {"attitude.indi.filter_radps": 30.0},
        {"attitude.indi.kp.0": 4.0},
        {"attitude.indi.kp.1": 36.0, "attitude.indi.kp.2": 36.0},
        {"attitude.indi.kd.0": 12.0, "attitude.indi.kd.1": 12.0},
        {"attitude.indi.kp.3": 36.0, "attitude.indi.kd.2": 12.0},
        {"guidance.lead_s": 0.35},
    ],
    "lqr1": [*GUIDANCE, *LAG, *COST, {"guidance.lead_s": 0.05}],
    # Weights of w, roll and pitch, yaw, p and q, r, and of the commands.
    "nmpc": [
        *GUIDANCE,
        {"node.attitude-mpc.settings.weights.0": 1e2},
        {f"node.attitude-mpc.settings.weights.{i}": 1e3 for i in (1, 2)},
        {"node.attitude-mpc.settings.weights.3": 1e3},
        {f"node.attitude-mpc.settings.weights.{i}": 1e1 for i in (4, 5)},
        {"node.attitude-mpc.settings.weights.6": 1e1},
        {f"node.attitude-mpc.settings.weights.{i}": 2e2 for i in (7, 8, 9)},
        {"node.attitude-mpc.settings.weights.10": 1e2},
        {"guidance.lead_s": 0.05},
    ],
}
# The NMPC predicts over one sample and has no disturbance estimate; lqr1 is the linear law with the same limits.
FIXED = {
    "lqr1": {"attitude.law": "lqr", "attitude.delay_compensation": True, "attitude.disturbance_gain": 0.0},
    "nmpc": {"node.attitude-mpc.exec": str(NMPC)},
}
WIDEST = 8.0  # largest factor, and the inverse of the smallest
SPREAD = 0.5  # standard deviation of the logarithms of the factors of the first tries
TRIES, GENERATION = 168, 24
JUDGED = 16  # tries of each front that are judged: those that add most hypervolume

# Objectives to minimise, with the best and the worst value that count. Objectives whose ratio matters are logarithms.
OBJECTIVES = {
    "error": (np.log(0.005), np.log(0.1)),  # RMS of the position error [m]
    "delay": (-350.0, 0.0),  # delay margin, negative [ms]
    "lag": (-305.0, 0.0),  # lag margin, negative [ms]
    "mismatch": (np.log(0.03), np.log(0.5)),  # mean of e / (1 m + e), where e is the RMS error [m]; 1 for a lost flight
    "effort": (np.log(0.1), np.log(10.0)),  # mean of u'Ru
}
BEST, WORST = np.array(list(OBJECTIVES.values())).T
MARGINS_MS = 170.0, 120.0  # delay margin and lag margin in the rule of docs/tried.md


def toml_of(name, settings):
    """Returns a controller as TOML; an array is written with all its elements."""
    lines, arrays = [], {}
    for key, value in settings.items():
        array, _, element = key.rpartition(".")
        if element.isdigit():
            arrays.setdefault(array, {})[int(element)] = value
        else:
            lines.append(f"{key} = {json.dumps(value)}")
    if "attitude.mpc.q" in arrays:
        arrays["attitude.mpc.q"][6] = 0.0  # weight of r, as by default
    lines += [f"{key} = {[elements[i] for i in sorted(elements)]}" for key, elements in arrays.items()]
    return "\n".join([f"[controller.{name}]", *lines, ""])


def flown(campaign, controllers, replaced):
    """Flies a campaign with these controllers and with the values of `replaced`; returns the rows of its table."""
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        text = (CAMPAIGNS / f"{campaign}.toml").read_text().split("\n[compare]")[0]  # this table names the shipped laws
        for key, value in replaced.items():
            text, times = re.subn(rf"^{key} = .*$", f"{key} = {value}", text, flags=re.MULTILINE)
            assert times == 1, f"{campaign} has `{key}` {times} times"
        (folder / f"{campaign}.toml").write_text(text)
        (folder / "front-laws.toml").write_text(controllers)
        command = [TREFOIL, "campaign", folder / f"{campaign}.toml", "--out", folder / "out"]
        done = subprocess.run(command, capture_output=True, text=True)
        table = folder / "out/flights.parquet"
        if not table.exists():
            sys.exit(done.stdout + done.stderr)
        return pyarrow.parquet.read_table(table).to_pylist()


def measured(controllers, draws):
    """Returns the objectives of each controller, one row each, and the number of mismatch flights that each lost."""
    text = "\n".join(toml_of(f"t{i}", settings) for i, settings in enumerate(controllers))
    tables = {name: flown(f"front-{name}", text, draws[name]) for name in ("legs", "delay", "lag", "mixed")}

    def one(i):
        of_one = ([row for row in table if row["controller"] == f"t{i}"] for table in tables.values())
        legs, delay, lag, mixed = of_one
        passes = [row["verdict"] == "passed" for row in mixed]
        error = [row["rms_position_error_m"] for row in mixed]
        cost = np.mean([e / (1.0 + e) if passed else 1.0 for e, passed in zip(error, passes)])
        if any(row["verdict"] != "passed" for row in legs):
            of_legs = WORST[0], WORST[4]
        else:
            keys = "rms_position_error_m", "demand_effort"
            of_legs = (np.log(np.mean([row[key] for row in legs])) for key in keys)
        error, effort = of_legs
        delay_ms, lag_s = (np.median([row["limit"] or 0.0 for row in table]) for table in (delay, lag))
        return [error, -delay_ms, -1e3 * lag_s, np.log(cost), effort], passes.count(False)

    objectives, lost = zip(*map(one, range(len(controllers))))
    return np.array(objectives, float), lost


class Tuning(Problem):
    """Tuning of the settings of a law, whose variables are the logarithms of the factors."""

    def __init__(self, law, number):
        super().__init__(n_var=len(LAWS[law]), n_obj=len(OBJECTIVES), xl=-np.log(WIDEST), xu=np.log(WIDEST))
        self.law = law
        seeds = [100 + number]
        self.draws = {
            "legs": {"seeds": seeds},
            "delay": {"seeds": seeds, "resolution": 10.0},
            "lag": {"seeds": seeds, "resolution": 0.01},
            "mixed": {"seed": seeds[0], "samples": 16},
        }

    def settings(self, logarithms):
        settings = FIXED.get(self.law, {"attitude.law": self.law}).copy()
        for group, logarithm in zip(LAWS[self.law], logarithms):
            settings |= {key: float(f"{start * np.exp(logarithm):.3g}") for key, start in group.items()}
        return settings

    def _evaluate(self, x, out, *_, **__):
        out["F"], _ = measured([self.settings(one) for one in x], self.draws)


def volume(objectives, of=range(len(OBJECTIVES))):
    """Returns the hypervolume of a front in the objectives `of`, as a share of the box from best to worst values."""
    shares = np.clip((np.array(objectives) - BEST) / (WORST - BEST), 0.0, 1.0)[:, list(of)]
    return moocore.hypervolume(shares, ref=np.ones(shares.shape[1]))


def search(law, number, budget=TRIES):
    problem = Tuning(law, number)
    generation = min(GENERATION, budget)
    first = np.random.default_rng(number).normal(0.0, SPREAD, (generation, problem.n_var))
    first[0] = 0.0
    tries = {}

    def remember(algorithm):
        tries.update(zip(map(tuple, algorithm.pop.get("X")), algorithm.pop.get("F")))
        print(law, number, len(tries), "tries,", round(volume(np.array(list(tries.values()))), 3), flush=True)

    algorithm = SMSEMOA(pop_size=generation, sampling=np.clip(first, problem.xl, problem.xu))
    minimize(problem, algorithm, ("n_gen", budget // generation), seed=number, callback=remember)
    x, objectives = np.array(list(tries)), np.array(list(tries.values()))
    front = np.flatnonzero(moocore.is_nondominated(objectives))
    chosen = []
    while len(chosen) < min(JUDGED, len(front)):
        left = [i for i in front if i not in chosen]
        chosen.append(max(left, key=lambda i: volume(objectives[[*chosen, i]])))
    RUNS.mkdir(parents=True, exist_ok=True)
    (RUNS / f"{law}-{number}.json").write_text(json.dumps([problem.settings(x[i]) for i in chosen], indent=1))


def draws_of(seed):
    draws = {name: {"seeds": [seed, seed + 1]} for name in ("legs", "delay", "lag")}
    return draws | {"mixed": {"seed": seed, "samples": 60}}


def judge(seed):
    fronts = {}
    for path in sorted(RUNS.glob("*-?.json")):
        controllers = json.loads(path.read_text())
        objectives, lost = measured(controllers, draws_of(seed))
        fronts[path.stem] = {"controllers": controllers, "objectives": objectives.tolist(), "lost": lost}
        print(path.stem, "hypervolume", round(volume(objectives), 3), flush=True)
    (RUNS / f"judged-{seed}.json").write_text(json.dumps(fronts))


def taken(front):
    """Returns the index of the tuning that the rule takes: fewest lost flights, then the margins, then the errors."""

    def worth(i):
        error, delay, lag, mismatch, _ = front["objectives"][i]
        short = max(0.0, 1.0 + delay / MARGINS_MS[0]) + max(0.0, 1.0 + lag / MARGINS_MS[1])
        return front["lost"][i], round(short, 3), error + mismatch

    return min(range(len(front["lost"])), key=worth)


def interval(values):
    """Returns the mean and the ends of its 95 % interval (Student); the ends are NaN for one value."""
    mean, n = np.mean(values), len(values)
    reach = stats.t.ppf(0.975, n - 1) * np.std(values, ddof=1) / np.sqrt(n) if n > 1 else np.nan
    return mean, mean - reach, mean + reach


def best_of(chosen, law):
    """Returns the search of a law whose tuning the rule takes, and the index of that tuning."""
    fronts = {name: front for name, front in chosen.items() if name.startswith(f"{law}-")}
    each = {name: taken(front) for name, front in fronts.items()}
    of_each = {"lost": [fronts[name]["lost"][i] for name, i in each.items()]}
    of_each["objectives"] = [fronts[name]["objectives"][i] for name, i in each.items()]
    return list(each.items())[taken(of_each)]


def report(choice, other):
    """Prints the fronts on the draws of `choice`, and flies the tunings that the rule takes on the draws of `other`."""
    fronts = json.loads((RUNS / f"judged-{choice}.json").read_text())
    laws = [law for law in LAWS if any(name.startswith(f"{law}-") for name in fronts)]

    def volumes(law, of=range(len(OBJECTIVES))):
        return [volume(front["objectives"], of) for name, front in fronts.items() if name.startswith(f"{law}-")]

    def compared(one, two):
        of = volumes(one), volumes(two)
        return stats.ttest_ind(*of, equal_var=False).pvalue, np.mean(of[0]) - np.mean(of[1]), one, two

    print("hypervolume: mean of the searches, 95 % interval, and each search")
    for law in laws:
        mean, low, high = interval(volumes(law))
        reach = "one search    " if np.isnan(low) else f"{low:.3f} to {high:.3f}"
        print(f"{law:10}{mean:.3f}  {reach}  ", *(f"{one:.3f}" for one in volumes(law)))
    pairs = [pair for pair in itertools.combinations(laws, 2) if min(len(volumes(law)) for law in pair) > 1]
    print(f"differences of the means, and p of Welch's test with Holm's correction for {len(pairs)} pairs")
    least = 0.0
    for rank, (p, difference, one, two) in enumerate(sorted(compared(*pair) for pair in pairs)):
        least = max(least, min(1.0, p * (len(pairs) - rank)))
        print(f"{one:10}less {two:10} {difference:+.3f}  {least:.2g}")
    print("means if one number does not count")
    for left_out, name in enumerate(OBJECTIVES):
        of = [i for i in range(len(OBJECTIVES)) if i != left_out]
        means = sorted(((np.mean(volumes(law, of)), law) for law in laws), reverse=True)
        print(f"without {name:9}", ", ".join(f"{law} {mean:.3f}" for mean, law in means))
    print("the tuning that the rule takes of each search; * of all searches of its law")
    print("             error m  delay ms  lag ms  mismatch  effort  lost of 60")
    tunings = {name: front["controllers"][taken(front)] for name, front in fronts.items()}
    objectives, lost = measured(list(tunings.values()), draws_of(other))
    best = {best_of(fronts, law)[0] for law in laws}
    for name, (error, delay, lag, mismatch, effort), of in zip(tunings, objectives, lost):
        print(f"{name + '*' * (name in best):12}{np.exp(error):8.4f}{-delay:10.0f}{-lag:8.0f}"
              f"{np.exp(mismatch):10.3f}{np.exp(effort):8.2f}{of:12}")


def laws(choice):
    """Prints the tuning of each law as TOML."""
    judged = json.loads((RUNS / f"judged-{choice}.json").read_text())
    for law in LAWS:
        if any(name.startswith(f"{law}-") for name in judged):
            name, i = best_of(judged, law)
            print(toml_of(law, judged[name]["controllers"][i]))


COMMANDS = {"search": search, "judge": judge, "report": report, "laws": laws}
if __name__ == "__main__":
    if sys.argv[1:2] == [] or sys.argv[1] not in COMMANDS:
        sys.exit(__doc__)
    COMMANDS[sys.argv[1]](*(int(word) if word.isdigit() else word for word in sys.argv[2:]))
