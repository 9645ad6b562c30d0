"""Reads the table of a campaign with DuckDB, pandas and polars; prints what each found as one line of JSON.

Usage: read_campaign.py FOLDER
"""

import json
import sys

import duckdb
import pandas
import polars

folder = sys.argv[1]
shards = f"{folder}/shards/*.parquet"
merged = f"{folder}/flights.parquet"

passed = "SELECT count(*), sum(CAST(verdict = 'passed' AS INT)), avg(\"plant.airframe.mass_kg\"), max(max_position_error_m) FROM"
by_duckdb = [duckdb.sql(f"{passed} '{files}'").fetchall()[0] for files in (shards, merged)]
frame = pandas.read_parquet(merged)
lazy = polars.scan_parquet(shards).collect()


def of(table, is_passed):
    return [
        len(table),
        int(is_passed.sum()),
        float(table["plant.airframe.mass_kg"].mean()),
        float(table["max_position_error_m"].max()),
    ]


print(
    json.dumps(
        {
            "duckdb": [list(map(float, row)) for row in by_duckdb],
            "pandas": of(frame, frame["verdict"] == "passed"),
            "polars": of(lazy, lazy["verdict"] == "passed"),
            "columns": list(frame.columns),
            "types": {name: str(frame[name].dtype) for name in ("flight", "controller", "max_position_error_m")},
        }
    )
)
