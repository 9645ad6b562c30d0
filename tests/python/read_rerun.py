"""Lists the contents of two Rerun recordings: the converter's and that of docs/layouts/rerun_view.py.

    pip install rerun-sdk
    python3 read_rerun.py CONVERTED.rrd RECORDING.rrd

Prints one line of JSON: for each recording the components of every entity.
"""

import collections
import json
import re
import subprocess
import sys
from pathlib import Path

#: A chunk in the listing of `rerun rrd print`.
CHUNK = re.compile(r"^Chunk\(.*\) with \d+ rows .* - (/\S*) - data columns: \[(.*)\]$")


def components(recording):
    rerun = Path(sys.executable).with_name("rerun")
    listing = subprocess.run([rerun, "rrd", "print", recording], check=True, capture_output=True, text=True).stdout
    found = collections.defaultdict(set)
    for entity, columns in (match.groups() for match in map(CHUNK.match, listing.splitlines()) if match):
        found[entity].update(columns.split())
    return {entity: sorted(columns) for entity, columns in sorted(found.items())}


if __name__ == "__main__":
    print(json.dumps({"converted": components(sys.argv[1]), "recording": components(sys.argv[2])}))
