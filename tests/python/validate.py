"""Validates files against a JSON Schema: validate.py SCHEMA FILE... Prints one line for each error."""

import json
import sys
import tomllib
from pathlib import Path

import jsonschema

schema = json.loads(Path(sys.argv[1]).read_text())
jsonschema.Draft7Validator.check_schema(schema)
validator = jsonschema.Draft7Validator(schema)
for name in sys.argv[2:]:
    text = Path(name).read_text()
    value = json.loads(text) if name.endswith(".json") else tomllib.loads(text)
    for error in validator.iter_errors(value):
        print(f"{name}: {'.'.join(map(str, error.absolute_path))}: {error.message[:200]}")
