"""Flights by the launcher."""

import json
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Literal

from ._native import LAUNCHER, Error
from ._toml import assignments

Mode = Literal["realtime", "lockstep", "inprocess"]
#: Largest exit code of a flight that was flown to its end.
FLOWN = 1


@dataclass(frozen=True)
class Run:
    """Flight of the launcher that was flown to its end."""

    #: Folder of the run.
    folder: Path
    #: 0 = inside its bounds; 1 = not inside, see ``record["ended"]`` and ``record["reservations"]``.
    exit_code: int
    #: ``run.json``.
    record: dict[str, Any]

    @property
    def metrics(self) -> SimpleNamespace:
        """Metrics of ``run.json``, as attributes."""
        return SimpleNamespace(**self.record["metrics"])

    @property
    def state_hash(self) -> str:
        """SHA-256 over all states of the flight."""
        return self.record["state_hash"]


def launch(*arguments: str | PathLike[str]) -> subprocess.CompletedProcess[str]:
    """Runs the launcher of this package to its end."""
    return subprocess.run([LAUNCHER, *arguments], capture_output=True, text=True)


def fly(
    scenario: str | PathLike[str] | None = None,
    *,
    mode: Mode | None = None,
    settings: Mapping[str, Any] | None = None,
    out: str | PathLike[str] | None = None,
    namespace: str = "default",
) -> Run:
    """Flies a scenario by the launcher, to its end.

    Args:
        scenario: scenario file; ``None`` = the defaults.
        mode: mode of the flight; ``None`` = the mode of the scenario, by default ``realtime``.
        settings: settings by key, as for ``trefoil fly --set``.
        out: folder for the results; ``None`` = a new folder in ``runs/``.
        namespace: name of the stack; several stacks can fly at once under different names.

    Raises:
        Error: the flight was not flown to its end; it has the launcher's message and exit code (2 = cannot be flown, 3
            = a process or the log was lost, 4 = a deadline with the policy ``stop`` was missed, 130 = interrupted).
    """
    words = ["fly", *([] if scenario is None else [fspath(scenario)]), "--namespace", namespace]
    words += ["--mode", mode] if mode else []
    words += ["--out", fspath(out)] if out is not None else []
    for assignment in assignments(settings):
        words += ["--set", assignment]
    flown = launch(*words)
    if flown.returncode > FLOWN or flown.returncode < 0:
        raise Error(flown.stderr.strip() or flown.stdout.strip(), flown.returncode)
    folder = Path(fspath(out)) if out is not None else _folder_in(flown.stdout)
    record = json.loads((folder / "run.json").read_text())
    return Run(folder, flown.returncode, record)


def _folder_in(summary: str) -> Path:
    """Finds the folder of the run in the summary that the launcher prints."""
    key = "written to"
    return next(Path(line.strip()[len(key) :].strip()) for line in summary.splitlines() if line.strip().startswith(key))
