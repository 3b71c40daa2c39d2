"""What several unit tests build on."""

import pytest
from helpers.scene_dtypes import DTYPES


@pytest.fixture(scope="session")
def dtypes():
    return DTYPES
