"""The closed loop, stepped by the caller."""

import json
from collections.abc import Mapping
from os import PathLike, fspath
from types import SimpleNamespace
from typing import Any

from ._loop import Loop
from ._native import LIB, Error, Setup, opened, texts
from ._toml import assignments


class Flight(Loop):
    """Flight in this process; the caller takes the place of one node.

    The flight is equal, bit for bit, to ``trefoil fly --mode inprocess`` with the same answers.

    Example::

        with trefoil.Flight("scenarios/wind.toml", node="attitude-mpc", settings={"run.duration_s": 20}) as flight:
            for sample, reference in flight:
                flight.answer(my_law(sample, reference))
        print(flight.metrics.max_position_error_m)

    Samples at which a fault leaves the node without a process are flown without an answer. Libraries of other nodes are
    loaded without a trial: a library that crashes ends Python.

    Args:
        scenario: scenario file; ``None`` = the defaults.
        node: ``guidance``, ``attitude-mpc`` or ``mixer``.
        settings: settings by key, as for ``trefoil fly --set``.

    Raises:
        Error: the scenario cannot be flown.
    """

    _next = LIB.trefoil_flight_next
    _send = LIB.trefoil_flight_answer

    def __init__(
        self,
        scenario: str | PathLike[str] | None = None,
        *,
        node: str = "attitude-mpc",
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        super().__init__(node)
        file = None if scenario is None else fspath(scenario).encode()
        given = assignments(settings)
        self._handle = opened(LIB.trefoil_flight_open, file, texts(given), len(given), node.encode())
        self.setup = Setup.of(LIB.trefoil_flight_setup(self._handle).contents)
        self._record: dict[str, Any] | None = None

    @property
    def record(self) -> dict[str, Any]:
        """``run.json`` of the flight, with ``stepped``, the name of the node. A flight that is not over ends here."""
        if self._record is None:
            text = LIB.trefoil_flight_record(self._living())
            if text is None:
                self._failed(2)
            self._record = json.loads(text)
        return self._record

    @property
    def metrics(self) -> SimpleNamespace:
        """Metrics of ``run.json``, as attributes. A flight that is not over ends here."""
        return SimpleNamespace(**self.record["metrics"])

    @property
    def state_hash(self) -> str:
        """SHA-256 over all states of the flight. A flight that is not over ends here."""
        return self.record["state_hash"]

    @property
    def exit_code(self) -> int:
        """Exit code of ``trefoil fly`` for this flight: 0 = inside its bounds. A flight that is not over ends here."""
        return self.record["exit_code"]

    def _failed(self, exit_code: int) -> None:
        raise Error(LIB.trefoil_flight_error(self._living()).decode(), exit_code)

    def close(self) -> None:
        """Frees the flight, and keeps its record. A flight that is not over ends as interrupted."""
        if self._handle is not None:
            _ = self.record
            handle, self._handle = self._handle, None
            LIB.trefoil_flight_close(handle)

    def __del__(self) -> None:
        handle, self._handle = getattr(self, "_handle", None), None
        LIB.trefoil_flight_close(handle)
