"""Programs in Python as processes of the ring."""

import subprocess
import sys
from pathlib import Path

import pytest
from conftest import SHORT, SURVEY

import trefoil

HERE = Path(__file__).parent


def node_of(name: str, file: str, *arguments: str) -> dict[str, object]:
    words = [str(HERE / file), *arguments]
    return {f"node.{name}.exec": sys.executable, f"node.{name}.args": words}


PD = node_of("attitude-mpc", "pd.py")


def test_a_node_flies_in_lockstep_with_the_bits_of_the_same_law_in_a_flight(tmp_path: Path, namespace: str) -> None:
    from trefoil.speed import pd_law

    run = trefoil.fly(SURVEY, mode="lockstep", settings={**SHORT, **PD}, out=tmp_path / "run", namespace=namespace)
    with trefoil.Flight(SURVEY, settings=SHORT) as flight:
        law = pd_law(flight)
        for sample, reference in flight:
            flight.answer(law(sample, reference))
    assert run.state_hash == flight.state_hash
    assert (run.folder / "attitude-mpc.1.log").read_text() == "begins cold\n"


def test_a_node_flies_against_the_clock(tmp_path: Path, namespace: str) -> None:
    # A process that the machine stalls is late, and not replaced.
    settings = {**SHORT, **PD, "supervision.hang_ms": 60_000.0, "supervision.start_limit_s": 60.0}
    run = trefoil.fly(SURVEY, mode="realtime", settings=settings, out=tmp_path / "run", namespace=namespace)
    assert run.record["timing"]["nodes"]["attitude-mpc"]["execution"]["n"] > 250


@pytest.mark.parametrize("name", ["guidance", "mixer"])
def test_guidance_and_the_mixer_can_be_programs_too(name: str, tmp_path: Path, namespace: str) -> None:
    settings = {"run.duration_s": 1.0, "mission.trajectory": "hover", **node_of(name, "hold.py", name)}
    run = trefoil.fly(SURVEY, mode="lockstep", settings=settings, out=tmp_path / "run", namespace=namespace)
    assert run.exit_code == 0, run.record["ended"]
    assert run.metrics.max_position_error_m < 0.05


def test_an_exception_ends_the_process_and_the_next_one_goes_on_with_its_memory(tmp_path: Path, namespace: str) -> None:
    settings = {**SHORT, **PD, "node.attitude-mpc.settings": {"fail_at": 100}, "supervision.restart_ms": [0.0]}
    run = trefoil.fly(SURVEY, mode="lockstep", settings=settings, out=tmp_path / "run", namespace=namespace)
    events = [(event["what"], event["node"]) for event in run.record["events"]]
    assert events[:2] == [("died", "attitude-mpc"), ("started", "attitude-mpc")]
    assert "RuntimeError: this law has failed" in (run.folder / "attitude-mpc.1.log").read_text()
    assert (run.folder / "attitude-mpc.2.log").read_text() == "goes on from tick 100\n"


def test_a_plant_flies_in_lockstep_and_every_repeat_has_the_same_bits(tmp_path: Path, namespace: str) -> None:
    settings = {**SHORT, **node_of("plant", "vehicle.py")}
    one, again = (
        trefoil.fly(SURVEY, mode="lockstep", settings=settings, out=tmp_path / name, namespace=namespace)
        for name in ("one", "again")
    )
    assert one.exit_code == 0, one.record["ended"]
    assert one.metrics.max_position_error_m < 0.1
    assert one.state_hash == again.state_hash
    assert (one.folder / "plant.1.log").read_text() == "the run is over\n"


def test_a_plant_that_fails_ends_the_flight_with_its_reason(tmp_path: Path, namespace: str) -> None:
    for settings, why in [({"fail_at": 100}, "this vehicle has failed"), ({"drag_nspm": 1}, "this body has no drag")]:
        settings = {**SHORT, **node_of("plant", "vehicle.py"), "node.plant.settings": settings}
        out = tmp_path / why.split()[-1]
        with pytest.raises(trefoil.Error) as failed:
            trefoil.fly(SURVEY, mode="lockstep", settings=settings, out=out, namespace=namespace)
        assert failed.value.exit_code == 3
        assert why in (out / "plant.1.log").read_text()


def test_a_program_that_the_launcher_has_not_started_is_told_so() -> None:
    alone = subprocess.run([sys.executable, HERE / "pd.py"], capture_output=True, text=True)
    assert alone.returncode == 1
    assert "the launcher has not started this program" in alone.stderr


def test_a_program_that_another_process_starts_in_the_name_of_the_launcher_is_refused() -> None:
    words = ["--namespace", "no-such-stack", "--epoch", "1"]
    alone = subprocess.run([sys.executable, HERE / "pd.py", *words], capture_output=True, text=True)
    assert alone.returncode == 1
    assert "no stack runs in namespace 'no-such-stack'" in alone.stderr
