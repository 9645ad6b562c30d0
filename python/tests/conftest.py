"""Scenario, settings and namespace that the tests share."""

import os
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[2]
SURVEY = TOP / "scenarios" / "survey.toml"
SHORT = {"run.duration_s": 3.0}


@pytest.fixture
def namespace(request: pytest.FixtureRequest) -> str:
    """Name that no other flight on this machine has."""
    return f"pytest-{os.getpid()}-{abs(hash(request.node.name)) % 10**6}"
