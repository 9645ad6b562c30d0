"""The loop of one node: the samples, and the answer to each of them."""

import ctypes as c
from collections.abc import Iterator
from typing import Any, Self

import numpy as np

from ._inputs import Demand, Reference, Sample
from ._native import Error, Setup
from ._types import NODES


class Loop:
    """Samples for one node, answered one after the other.

    The iteration gives the input of the node at each sample; the loop body calls :meth:`answer` once.

    =================  ======================  ============================================================
    node               the iteration gives     :meth:`answer` takes
    =================  ======================  ============================================================
    ``guidance``       ``sample``              ``position_m velocity_mps attitude_rad rates_radps w_mps``
    ``attitude-mpc``   ``sample, reference``   ``demand``, and ``status=1`` for no answer
    ``mixer``          ``sample, demand``      ``rotor_speed tilt_rad``
    =================  ======================  ============================================================

    A loop is used from one thread.

    Attributes:
        name: name of the node.
        setup: vehicle and settings.
    """

    #: Functions of the library, and the handle to pass to them.
    _next: Any
    _send: Any
    _handle: int | None
    setup: Setup

    def __init__(self, node: str) -> None:
        if node not in NODES:
            raise ValueError(f"there is no node `{node}` to be: {', '.join(NODES)} answer to samples")
        self.name = node
        types = NODES[node]
        self._input, self._answer = np.zeros((), types[0]), np.zeros((), types[1])
        self._to_next = (c.c_void_p(self._input.ctypes.data), types[0].itemsize)
        self._to_send = (c.c_void_p(self._answer.ctypes.data), types[1].itemsize)
        self._fields = {name: self._answer[name] for name in types[1].names}
        self._defaults = {"status": np.uint64(0)} if "status" in self._fields else {}
        given = {"sample": Sample, "reference": Reference, "demand": Demand}
        parts = [given[name](self._input[name]) for name in types[0].names if name in given]
        self._given = parts[0] if node == "guidance" else tuple(parts)

    @property
    def settings(self) -> dict[str, Any]:
        """``[node.NAME.settings]`` of the scenario."""
        return self.setup.settings

    @property
    def tick(self) -> int:
        """Number of the sample to answer to, from 0."""
        return int(self._input["tick"])

    @property
    def time_s(self) -> float:
        """Time of the sample to answer to [s]."""
        return float(self._input["time_s"])

    def __iter__(self) -> Iterator[Any]:
        while self._step():
            yield self._given

    def _step(self) -> bool:
        """Waits for the next sample, or flies to it; returns ``False`` at the end."""
        return self._checked(self._next(self._living(), *self._to_next)) == 1

    def answer(self, *values: Any, **fields: Any) -> None:
        """Answers to the sample.

        Args:
            values: the fields of the answer in their order, see :class:`Loop`. ``demand``: deviations of col, lon, lat,
                ped from trim, 4 numbers [N, N m, N m, N m]. ``rotor_speed``: 3 numbers [rotor speed unit].
                ``tilt_rad``: tilt of rotor 1 [rad]. The values of guidance are fields of :class:`Reference`.
            fields: the fields of the answer by their names. ``status`` is 0 by default; any other number says that
                there is no answer, and the demand counts as late for the mixer.

        Raises:
            TypeError: a field is missing, given twice, or not a field of the node's answer.
            ValueError: a field has another shape.
            Error: there is no sample to answer.
        """
        by_place = dict(zip(self._fields, values))
        given = {**self._defaults, **by_place, **fields}
        twice = fields.keys() & by_place.keys() if fields else False
        if given.keys() != self._fields.keys() or len(values) > len(by_place) or twice:
            takes = ", ".join(self._fields)
            raise TypeError(f"an answer of {self.name} has the fields {takes}, each once; given: {', '.join(given)}")
        for name, value in given.items():
            self._put(name, value)
        self._checked(self._send(self._living(), *self._to_send))

    def _put(self, name: str, value: Any) -> None:
        field = self._fields[name]
        shape = value.shape if hasattr(value, "shape") else np.shape(value)
        if shape != field.shape:
            raise ValueError(f"`{name}` has the shape {shape}, and must have {field.shape}")
        field[...] = value

    def _living(self) -> int:
        if self._handle is None:
            raise Error(f"{self.name} is closed: use it inside its `with`")
        return self._handle

    def _checked(self, code: int) -> int:
        """Returns the result of a call, or raises its failure."""
        if code < 0:
            self._failed(-code)
        return code

    def _failed(self, exit_code: int) -> None:
        raise NotImplementedError

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        raise NotImplementedError
