"""Settings as ``KEY=VALUE``, the value in TOML."""

import json
import math
from collections.abc import Mapping
from os import PathLike, fspath
from typing import Any


def assignments(settings: Mapping[str, Any] | None) -> list[str]:
    """Writes settings as the arguments of ``--set``."""
    return [f"{key}={value_of(value)}" for key, value in (settings or {}).items()]


def value_of(value: Any) -> str:
    """Writes a value in TOML: numbers, truth values, text, paths, lists, tables, and arrays of numpy."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    match value:
        case bool():
            return str(value).lower()
        case float() if not math.isfinite(value):
            return str(value)
        case int() | float():
            return repr(value)
        case str():
            return json.dumps(value)
        case PathLike():
            return json.dumps(fspath(value))
        case Mapping():
            return "{ " + ", ".join(f"{json.dumps(key)} = {value_of(part)}" for key, part in value.items()) + " }"
        case list() | tuple():
            return "[" + ", ".join(map(value_of, value)) + "]"
    raise TypeError(f"a setting cannot be a {type(value).__name__}")
