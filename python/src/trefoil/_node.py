"""A process of the ring."""

import ctypes as c
import sys

from ._loop import Loop
from ._native import ERROR_BYTES, LIB, Setup, opened, texts

#: Largest memory that a process can leave for the next process [byte].
MEMORY_BYTES = 1000


class Node(Loop):
    """Process of the ring: the launcher starts this program, as ``exec`` of a node, and it answers to samples.

    In a scenario: ``[node.attitude-mpc] exec = "python3", args = ["my.py"]``. Deadline, faults, trial, timing and
    replay work as for every node. The first step of the iteration says that the process is ready: import, compile and
    allocate before that step. An exception ends the process; its traceback is in the run's folder, in
    ``NODE.EPOCH.log``.

    Example::

        with trefoil.Node("attitude-mpc") as node:
            for sample, reference in node:
                node.answer(my_law(sample, reference))

    Args:
        node: ``guidance``, ``attitude-mpc`` or ``mixer``.

    Raises:
        Error: the launcher has not started this program.
    """

    _next = LIB.trefoil_next
    _send = LIB.trefoil_send

    def __init__(self, node: str) -> None:
        super().__init__(node)
        self._handle = opened(LIB.trefoil_join, node.encode(), len(sys.argv), texts(sys.argv))
        self.setup = Setup.of(LIB.trefoil_setup(self._handle).contents)

    def memory(self) -> bytes | None:
        """Returns the memory that the process before this one left by :meth:`remember`; ``None`` if there is none.

        Call it before the iteration. A program that does not call it begins cold, as the first process does.
        """
        left = c.create_string_buffer(MEMORY_BYTES)
        size = self._checked(LIB.trefoil_memory(self._living(), left, MEMORY_BYTES))
        return left.raw[:size] if size else None

    def remember(self, memory: bytes) -> None:
        """Leaves ``memory``, at most 1000 byte, with the next answer, to the process that continues after this one."""
        memory = bytes(memory)
        self._checked(LIB.trefoil_remember(self._living(), memory, len(memory)))

    def _failed(self, exit_code: int) -> None:
        """Ends the process as the launcher's own nodes end: with the reason on stderr, and its exit code."""
        print(f"{self.name}: {LIB.trefoil_error(self._living()).decode()}", file=sys.stderr)
        raise SystemExit(exit_code)

    def close(self) -> None:
        """Leaves the run."""
        handle, self._handle = self._handle, None
        LIB.trefoil_leave(handle)
