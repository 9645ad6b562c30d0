"""Campaigns by the launcher."""

from __future__ import annotations

from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING

from ._fly import launch
from ._native import Error

if TYPE_CHECKING:
    import pandas as pd

#: Exit codes with which all results are written: 1 = some flights could not be flown, or a promise is broken.
WRITTEN = (0, 1)


def campaign(file: str | PathLike[str], *, out: str | PathLike[str]) -> pd.DataFrame:
    """Flies a campaign by the launcher; continues a campaign that was interrupted.

    Args:
        file: campaign file.
        out: folder for the results.

    Returns:
        One row for each flight: the varied settings, ``verdict``, ``cause`` and the metrics, in SI units. The columns
        are those of ``flights.parquet`` in docs/campaigns.md.

    Raises:
        Error: the results are not complete; it has the launcher's message and exit code.
    """
    import pandas as pd

    done = launch("campaign", fspath(file), "--out", fspath(out))
    if done.returncode not in WRITTEN:
        raise Error(done.stderr.strip() or done.stdout.strip(), done.returncode)
    return pd.read_parquet(Path(fspath(out)) / "flights.parquet")
