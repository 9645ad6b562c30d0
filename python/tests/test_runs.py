"""Flights and campaigns by the launcher, and their results."""

from pathlib import Path

import pytest
from conftest import SHORT, SURVEY, TOP

import trefoil
from trefoil._toml import value_of


def test_a_flight_is_read_as_frames(tmp_path: Path) -> None:
    pytest.importorskip("mcap_protobuf", reason="needs the extra `read`")
    kill = {"fault": [{"at_s": 1.0, "target": "attitude-mpc", "kind": "kill"}]}
    run = trefoil.fly(SURVEY, mode="inprocess", settings={**SHORT, **kill}, out=tmp_path / "run")
    log = trefoil.read(run.folder)
    assert len(log.state) == len(log.reference) == 301
    assert log.state.index[-1] == pytest.approx(3.0)
    assert log.state["actual.position_m.z"].iloc[-1] < 0.0
    assert {"demand.col", "status", "stamp.tick"} <= set(log.controls.columns)
    assert {"command.rotor_speed.rotor_1", "flags"} <= set(log.actuators.columns)
    assert list(log.events["what"][:1]) == ["injected"] or "died" in set(log.events["what"])
    assert log.metrics["max_position_error_m"] == run.metrics.max_position_error_m
    assert log.timing.empty


def test_the_timing_of_processes_is_a_frame(tmp_path: Path, namespace: str) -> None:
    pytest.importorskip("mcap_protobuf", reason="needs the extra `read`")
    run = trefoil.fly(mode="lockstep", settings={"run.duration_s": 0.5}, out=tmp_path / "run", namespace=namespace)
    timing = trefoil.read(run).timing
    assert set(timing.index) == {"plant", "guidance", "attitude-mpc", "mixer"}
    assert timing.loc["mixer", "misses"] == 0


def test_a_flight_that_cannot_be_flown_raises_the_words_of_the_launcher() -> None:
    with pytest.raises(trefoil.Error, match="unknown key `attitude.mpc.nq`") as raised:
        trefoil.fly(settings={"attitude.mpc.nq": 1})
    assert raised.value.exit_code == 2


def test_a_flight_outside_its_bounds_is_flown_all_the_same(tmp_path: Path) -> None:
    tight = {**SHORT, "bounds.max_position_error_m": 1e-9}
    run = trefoil.fly(SURVEY, mode="inprocess", settings=tight, out=tmp_path / "run")
    assert run.exit_code == run.record["exit_code"] == 1


def test_the_folder_of_a_run_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    run = trefoil.fly(SURVEY, mode="inprocess", settings=SHORT)
    assert run.folder.parent == Path("runs") and (run.folder / "run.json").exists()


def test_a_campaign_is_a_frame(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow", reason="needs the extra `read`")
    file = tmp_path / "masses.toml"
    file.write_text(
        f'scenario = "{TOP}/scenarios/survey.toml"\n'
        "[settings]\nrun.duration_s = 1.0\nbounds.max_position_error_m = 1.0\n[vary]\nplant.airframe.mass_kg = [1.0, 1.2]\n"
    )
    rows = trefoil.campaign(file, out=tmp_path / "campaign")
    assert len(rows) == 2 and set(rows["verdict"]) == {"passed"}
    assert set(rows["plant.airframe.mass_kg"]) == {1.0, 1.2}
    with pytest.raises(trefoil.Error):
        trefoil.campaign(tmp_path / "none.toml", out=tmp_path / "none")


def test_settings_are_written_in_toml() -> None:
    import numpy as np

    for value, text in [
        (True, "true"),
        (0.1, "0.1"),
        (float("inf"), "inf"),
        ('a "b"', '"a \\"b\\""'),
        (np.array([1.0, 2.0]), "[1.0, 2.0]"),
        (np.int64(3), "3"),
        ({"at_s": 1.0, "set": ["a=1"]}, '{ "at_s" = 1.0, "set" = ["a=1"] }'),
        (Path("/a/b"), '"/a/b"'),
    ]:
        assert value_of(value) == text
    with pytest.raises(TypeError, match="cannot be a NoneType"):
        value_of(None)
