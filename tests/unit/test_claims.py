"""Claims: commands at work on the same frames share them; those that ended or went silent do not count."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from wgpu_gi.errors import GiError
from wgpu_gi.sequence.claims import STALE, Claims, wait_for


@pytest.fixture
def job(tmp_path):
    return tmp_path / "f_job.json"


def edit(file: Path, **fields: object) -> None:
    file.write_text(json.dumps(json.loads(file.read_text()) | fields))


def test_a_block_is_claimed_once(job):
    with Claims(job) as one, Claims(job) as other:
        assert one.take([0, 1, 2]) == [0, 1, 2]
        assert other.take([1, 2, 3]) == [3]
        assert other.take([2, 4]) == [4]
        (claim,) = other.others()
        assert claim.blocks == {0, 1, 2} and f"process {os.getpid()} on " in str(claim)
    assert list(job.parent.iterdir()) == []


def test_many_threads_claim_each_block_once(job):
    taken: list[int] = []

    def work():
        with Claims(job) as claims:
            for number in range(20):
                taken.extend(claims.take([number]))
            barrier.wait()

    barrier = threading.Barrier(6)
    threads = [threading.Thread(target=work) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(taken) == list(range(20))
    assert list(job.parent.iterdir()) == []


def test_claims_of_an_ended_process_do_not_count(job):
    code = (
        "import os, sys; from wgpu_gi.sequence.claims import Claims;"
        " c = Claims(sys.argv[1]).__enter__(); c.take([0, 1]); os._exit(0)"
    )
    subprocess.run([sys.executable, "-c", code, str(job)], check=True)
    assert len(list(job.with_suffix(".claims").iterdir())) == 1
    with Claims(job) as claims:
        assert claims.take([0, 1, 2]) == [0, 1, 2]
    assert list(job.parent.iterdir()) == []


def test_claims_of_another_machine_count_until_they_are_stale(job):
    with Claims(job) as there, Claims(job) as here:
        there.take([5])
        edit(there._file, space="another machine", process=0)
        assert here.take([5, 6]) == [6]
        now = here._now()
        os.utime(there._file, (now - STALE - 5, now - STALE - 5))
        assert here.take([5]) == [5]
        assert not there._file.exists()


def test_lock_of_a_killed_process_is_broken(job):
    with Claims(job) as claims:
        claims._lock.touch()
        os.utime(claims._lock, (1, 1))
        assert claims.take([3]) == [3]


def test_waiting_ends_when_the_other_is_done_or_gone(job):
    done: set[int] = set()
    told = []
    with Claims(job) as other, Claims(job) as claims:
        other.take([1, 2])

        def tell(others, count):
            told.append((len(others), count))
            done.add(1)
            if len(told) == 2:
                other.drop([2])
                other._write()

        assert wait_for(claims, [1, 2], done.__contains__, tell) == [2]
        assert told == [(1, 2), (1, 1)]
        done.add(2)
        assert wait_for(claims, [1, 2], done.__contains__, tell) == []


def test_damaged_claims_are_ignored(job):
    with Claims(job) as claims:
        for name, text in (("a", "{"), ("b", "[]"), ("c", '{"space": "x"}')):
            (claims._folder / f"{name}.json").write_text(text)
        assert claims.take([0]) == [0]


def test_folder_that_cannot_be_made_is_one_sentence(job):
    job.with_suffix(".claims").write_text("a file")
    with pytest.raises(GiError, match="cannot be made"), Claims(job):
        pass
