"""Steps per second of :class:`trefoil.Flight` on one core: ``python -m trefoil.speed [SCENARIO]``.

The times are CPU times of this process, which other processes on the machine change little.
"""

import sys
import time
from collections.abc import Callable

import numpy as np

from ._flight import Flight
from ._inputs import Reference, Sample

SETTINGS = {"run.duration_s": 600.0, "mission.trajectory": "hover"}

Law = Callable[[Sample, Reference], np.ndarray]


def pd_law(flight: Flight) -> Law:
    """Makes one PD law per axis: double poles at 6 rad/s for the attitude, a pole at 4 rad/s for the climb."""
    roll_pitch_yaw = [1, 0, 2]  # the demand has pitch first
    inertia = np.array([flight.setup.mass_kg, *flight.setup.inertia_kgm2[roll_pitch_yaw]])
    wanted = np.empty(4)

    def law(sample: Sample, reference: Reference) -> np.ndarray:
        turn = 36.0 * (reference.attitude_rad - sample.attitude_rad)
        turn += 12.0 * (reference.rates_radps - sample.rates_radps)
        wanted[0] = 4.0 * (reference.w_mps - sample.velocity_mps[2])
        wanted[1:] = turn[roll_pitch_yaw]
        return inertia * wanted

    return law


def recorded(answers: np.ndarray) -> Law:
    """Makes a law that returns the rows of ``answers``, one after the other."""
    rows = iter(answers)
    return lambda sample, reference: next(rows)


def flown(scenario: str | None, law_of: Callable[[Flight], Law]) -> tuple[float, np.ndarray, str]:
    """Flies a law; returns steps per second, the answers, shape (steps, 4), and the state hash."""
    answers = []
    with Flight(scenario, settings=SETTINGS) as flight:
        law, began = law_of(flight), time.process_time()
        for sample, reference in flight:
            answer = law(sample, reference)
            flight.answer(answer)
            answers.append(answer)
        return len(answers) / (time.process_time() - began), np.array(answers), flight.state_hash


def main() -> None:
    scenario = sys.argv[1] if len(sys.argv) > 1 else None
    steps, answers, state_hash = flown(scenario, pd_law)
    print(f"{'a PD law of numpy':<28}{steps:>9.0f} steps/s")
    steps, _, same = flown(scenario, lambda flight: recorded(answers))
    print(f"{'its answers, copied':<28}{steps:>9.0f} steps/s")
    if same != state_hash:
        sys.exit("the same answers have flown other states")


if __name__ == "__main__":
    main()
