"""A folder to write to, and a cluster, for the commands of the farm."""

from __future__ import annotations

import pytest

from wgpu_gi.farm import worker


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The folder of the test, in which the command runs; no job is kept from another test."""
    monkeypatch.chdir(tmp_path)
    worker.release()
    yield tmp_path
    worker.release()


@pytest.fixture(scope="module")
def cluster():
    """The address of a scheduler and two workers in this process, as others start them on other machines."""
    distributed = pytest.importorskip("distributed")
    options = {"dashboard_address": "127.0.0.1:0", "memory_limit": 0, "silence_logs": 50}
    with distributed.LocalCluster(2, threads_per_worker=1, processes=False, protocol="tcp://", **options) as found:
        yield found.scheduler_address
