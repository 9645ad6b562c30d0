"""Flights that the test steps."""

import ctypes
import os
import platform
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from conftest import SHORT, SURVEY, TOP

import trefoil
from trefoil.speed import pd_law


def flown(settings: dict[str, object] = {}) -> trefoil.Flight:
    with trefoil.Flight(SURVEY, node="attitude-mpc", settings={**SHORT, **settings}) as flight:
        law = pd_law(flight)
        for sample, reference in flight:
            flight.answer(law(sample, reference))
    return flight


def test_our_own_answers_given_by_python_fly_the_same_bits(tmp_path: Path) -> None:
    pytest.importorskip("mcap_protobuf", reason="needs the extra `read`")
    run = trefoil.fly(SURVEY, mode="inprocess", settings=SHORT, out=tmp_path / "run")
    controls = trefoil.read(run).controls
    demands = controls[[f"demand.{axis}" for axis in ("col", "lon", "lat", "ped")]].to_numpy()
    assert np.abs(demands).max() > 0.0
    with trefoil.Flight(SURVEY, settings=SHORT) as flight:
        for _ in flight:
            flight.answer(demands[flight.tick])
    assert flight.state_hash == run.state_hash
    assert flight.record["metrics"] == run.record["metrics"]
    assert flight.record["stepped"] == "attitude-mpc"


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
@pytest.mark.parametrize("fault", [{}, {"fault": [{"at_s": 1.0, "target": "attitude-mpc", "kind": "kill"}]}])
def test_a_law_in_python_and_in_c_fly_the_same_bits(fault: dict[str, object], tmp_path: Path) -> None:
    source, library = TOP / "tests/controllers/pd.c", tmp_path / "pd.so"
    flags = ["-O2", "-ffp-contract=off", "-fPIC", "-shared", "-I", TOP / "foreign/include"]
    subprocess.run(["cc", *flags, "-o", library, source, "-lm"], check=True)
    settings = {**SHORT, **fault, "node.attitude-mpc.exec": library}
    run = trefoil.fly(SURVEY, mode="inprocess", settings=settings, out=tmp_path / "run")
    with trefoil.Flight(SURVEY, settings={**SHORT, **fault}) as flight:
        inertia = [flight.setup.mass_kg, *(float(flight.setup.inertia_kgm2[axis]) for axis in (1, 0, 2))]
        for s, r in flight:
            demand = [inertia[0] * 4.0 * (r.w_mps - float(s.velocity_mps[2]))]
            for i, axis in ((1, 1), (2, 0), (3, 2)):
                error_rad = float(r.attitude_rad[axis]) - float(s.attitude_rad[axis])
                error_radps = float(r.rates_radps[axis]) - float(s.rates_radps[axis])
                demand.append(inertia[i] * (36.0 * error_rad + 12.0 * error_radps))
            flight.answer(demand)
    assert flight.state_hash == run.state_hash
    assert [event["what"] for event in flight.record["events"]] == [event["what"] for event in run.record["events"]]


@pytest.mark.skipif(shutil.which("cc") is None or platform.machine() != "x86_64", reason="needs a C compiler for x86-64")
def test_a_library_that_changes_the_rounding_mode_changes_no_bit(tmp_path: Path) -> None:
    usual = flown().state_hash
    source, library = tmp_path / "mode.c", tmp_path / "mode.so"
    body = "unsigned before = __builtin_ia32_stmxcsr(); __builtin_ia32_ldmxcsr(mode); return before;"
    source.write_text(f"unsigned swap(unsigned mode) {{ {body} }}")
    subprocess.run(["cc", "-shared", "-fPIC", "-o", library, source], check=True)
    swap = ctypes.CDLL(str(library)).swap
    upward = 0x5F80
    before = swap(upward)
    try:
        with trefoil.Flight(SURVEY, settings=SHORT) as flight:
            for sample, reference in flight:
                swap(before)
                answer = pd_law(flight)(sample, reference)
                swap(upward)
                flight.answer(answer)
    finally:
        assert swap(before) & 0x6000 == 0x4000, "the mode of the caller is left as it was"
    assert flight.state_hash == usual


def test_two_flights_at_once_do_not_touch_each_other() -> None:
    alone = flown().state_hash
    with trefoil.Flight(SURVEY, settings=SHORT) as first, trefoil.Flight(SURVEY, settings=SHORT) as second:
        laws = pd_law(first), pd_law(second)
        for (sample, reference), (other, wanted) in zip(first, second, strict=True):
            first.answer(laws[0](sample, reference))
            second.answer(laws[1](other, wanted) * 0.5)
    assert first.state_hash == alone != second.state_hash


def test_guidance_and_the_mixer_can_be_stepped() -> None:
    hover = {**SHORT, "mission.trajectory": "hover"}
    with trefoil.Flight(SURVEY, node="mixer", settings=hover) as flight:
        for sample, demand in flight:
            assert demand.age_ticks == 0 and sample.tilt_rad == pytest.approx(flight.setup.trim_tilt_rad)
            flight.answer(flight.setup.trim_rotor_speed, flight.setup.trim_tilt_rad)
    assert flight.exit_code == 0 and flight.metrics.max_position_error_m < 0.01
    with trefoil.Flight(SURVEY, node="guidance", settings=hover) as flight:
        for sample in flight:
            zero = np.zeros(3)
            roll = [flight.setup.trim_roll_rad, 0.0, 0.0]
            flight.answer(position_m=sample.position_m, velocity_mps=zero, attitude_rad=roll, rates_radps=zero, w_mps=0.0)
    assert flight.exit_code == 0 and flight.metrics.max_position_error_m < 0.05


def test_no_answer_has_the_mixer_go_on_without() -> None:
    with trefoil.Flight(SURVEY, settings=SHORT) as flight:
        for _ in flight:
            flight.answer([0.0] * 4, status=1)
    assert flight.metrics.fallback_s > 1.0


def test_a_flight_that_is_left_ends_as_interrupted() -> None:
    with trefoil.Flight(SURVEY, settings=SHORT) as flight:
        for _ in flight:
            flight.answer([0.0] * 4)
            if flight.tick == 20:
                break
    assert (flight.exit_code, flight.record["ended"]) == (130, "interrupted at 0.20 s")
    with pytest.raises(trefoil.Error, match="is closed"):
        flight.answer([0.0] * 4)


def test_wrong_answers_are_refused() -> None:
    flight = trefoil.Flight(SURVEY, settings=SHORT)
    with pytest.raises(trefoil.Error, match="no sample to answer"):
        flight.answer([0.0] * 4)
    next(iter(flight))
    for wrong in ([1.0], np.zeros((4, 1)), 1.0):
        with pytest.raises(ValueError, match="`demand` has the shape"):
            flight.answer(wrong)
    for wrong in ({}, {"demand": [0.0] * 4, "thrust": 1.0}):
        with pytest.raises(TypeError, match="each once"):
            flight.answer(**wrong)
    with pytest.raises(TypeError, match="each once"):
        flight.answer([0.0] * 4, demand=[0.0] * 4)
    with pytest.raises(trefoil.Error, match="the last sample has no answer"):
        next(iter(flight))


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"settings": {"run.mode": "lockstep"}}, "a stepped flight is in process"),
        ({"settings": {"run.duraton_s": 1.0}}, "did you mean `run.duration_s`"),
        ({"settings": {"node.mixer.exec": "/no/such.so"}}, "is not there"),
        ({"settings": {"swap": [{"at_s": 1.0, "node": "attitude-mpc"}]}}, "replaces the caller"),
        ({"scenario": "no-such.toml"}, "cannot read the scenario"),
    ],
)
def test_a_scenario_that_cannot_be_stepped_is_refused(given: dict[str, object], why: str) -> None:
    with pytest.raises(trefoil.Error, match=why):
        trefoil.Flight(**given)


def test_a_program_in_the_place_of_the_caller_is_refused(tmp_path: Path) -> None:
    program = tmp_path / "my.so"
    program.write_bytes(os.urandom(8))
    with pytest.raises(trefoil.Error, match="`node.attitude-mpc.exec` has no effect"):
        trefoil.Flight(settings={"node.attitude-mpc.exec": program})
    with pytest.raises(ValueError, match="no node `plant` to be"):
        trefoil.Flight(node="plant")
