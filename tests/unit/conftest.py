"""Fixtures that several unit tests share."""

import pytest
from helpers.scene_dtypes import DTYPES


@pytest.fixture(scope="session")
def dtypes():
    return DTYPES
