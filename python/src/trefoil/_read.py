"""The folder of a run as pandas frames."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from operator import attrgetter
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd
    from google.protobuf.descriptor import Descriptor

TOPICS = ("state", "reference", "controls", "actuators")


@dataclass(frozen=True)
class Log:
    """Folder of a run.

    A frame of a topic has one row for each message, processes on standby included (``stamp.delivery`` is 0 for the
    messages that were delivered), with ``time_s`` of its sample as index. Its columns are the fields of the schema
    ``trefoil.proto``, nested fields with dots: ``measured.position_m.x``. The fields of ``/truth`` at the same tick are
    in ``state``: ``actual.position_m.x``; they are NaN if the message of ``/truth`` was lost.
    """

    #: STATE and TRUTH: measured and true motion, actuators, command in force.
    state: pd.DataFrame
    #: REFERENCE, the answers of guidance.
    reference: pd.DataFrame
    #: CONTROLS, the answers of attitude-mpc.
    controls: pd.DataFrame
    #: ACTUATORS, the answers of the mixer.
    actuators: pd.DataFrame
    #: Events of processes and faults: ``at_s``, ``node``, ``epoch``, ``what``, ...
    events: pd.DataFrame
    #: Timing of ``run.json``: one row for each node, nested fields with dots (``execution.p99_us``); empty for a flight
    #: in process.
    timing: pd.DataFrame
    #: Metrics of ``run.json`` by their names; metrics with several numbers are lists.
    metrics: pd.Series
    #: ``run.json``.
    record: dict[str, Any]


def read(run: Any) -> Log:
    """Reads the folder of a run.

    Args:
        run: a :class:`Run`, or the path of its folder.

    Raises:
        FileNotFoundError: the run has no log (``--no-log``) or no ``run.json``.
    """
    import pandas as pd

    folder = Path(fspath(getattr(run, "folder", run)))
    record = json.loads((folder / "run.json").read_text())
    *topics, truth = _topics(folder / "flight.mcap", record)
    topics = dict(zip(TOPICS, topics))
    topics["state"] = topics["state"].join(truth.set_index("tick").filter(regex="^actu"), on="stamp.tick")
    nodes = (record["timing"] or {}).get("nodes", {})
    return Log(
        **topics,
        events=pd.DataFrame(record["events"]),
        timing=pd.json_normalize(list(nodes.values())).set_axis(list(nodes)) if nodes else pd.DataFrame(),
        metrics=pd.Series(record["metrics"], dtype=object, name="metrics"),
        record=record,
    )


def _topics(log: Path, record: dict[str, Any]) -> Iterator[pd.DataFrame]:
    """Reads the messages of each topic, and TRUTH."""
    import pandas as pd
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory

    topics = (*TOPICS, "truth")
    rows: dict[str, list[tuple]] = {topic: [] for topic in topics}
    times_s: dict[str, list[float]] = {topic: [] for topic in topics}
    columns: dict[str, list[str]] = {topic: [] for topic in topics}
    with log.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages([f"/{topic}" for topic in topics]):
            topic = channel.topic[1:]
            columns[topic] = columns[topic] or list(_columns(decoded.DESCRIPTOR))
            rows[topic].append(attrgetter(*columns[topic])(decoded))
            times_s[topic].append(message.log_time * 1e-9)
    for topic in topics:
        index = pd.Index(times_s[topic], name="time_s")
        yield pd.DataFrame.from_records(rows[topic], columns=columns[topic], index=index)


def _columns(message: Descriptor, before: str = "") -> Iterator[str]:
    """Lists the fields of a message, nested fields with dots."""
    for field in message.fields:
        if field.message_type is None:
            yield before + field.name
        else:
            yield from _columns(field.message_type, f"{before}{field.name}.")
