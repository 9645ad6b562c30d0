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
    run = trefoil.fly(SURVEY, mode="realtime", settings={**SHORT, **PD}, out=tmp_path / "run", namespace=namespace)
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


def test_a_program_that_the_launcher_has_not_started_is_told_so() -> None:
    alone = subprocess.run([sys.executable, HERE / "pd.py"], capture_output=True, text=True)
    assert alone.returncode == 1
    assert "the launcher has not started this program" in alone.stderr


def test_a_program_that_another_process_starts_in_the_name_of_the_launcher_is_refused() -> None:
    words = ["--namespace", "no-such-stack", "--epoch", "1"]
    alone = subprocess.run([sys.executable, HERE / "pd.py", *words], capture_output=True, text=True)
    assert alone.returncode == 1
    assert "no stack runs in namespace 'no-such-stack'" in alone.stderr
