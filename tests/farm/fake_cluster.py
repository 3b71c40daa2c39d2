"""A cluster without processes, in place of `wgpu_gi.farm.cluster.Cluster`: workers do a chunk when asked for news."""

from collections import deque

from wgpu_gi.farm.chunk_task import Kind, Outcome, failure_of


class Died(BaseException):
    """Raised by a task: the worker ends, and another takes its place."""


class Hangs(BaseException):
    """Raised by a task: the worker never ends its chunk."""


class FakeCluster:
    """Workers "0", "1", ... of which each item takes a second, one chunk at a time in the order of submission."""

    def __init__(self, workers, task, gone_after=None):
        self.workers = {str(number) for number in range(workers)}
        self.started, self.task, self.gone_after = workers, task, gone_after
        self.waiting, self.dropped, self.submitted = deque([self.workers.copy()]), set(), []

    is_connected = True

    def submit(self, items, worker):
        number = len(self.submitted)
        self.submitted.append((items, worker))
        self.waiting.append((number, items, worker))
        return number

    def drop(self, number):
        self.dropped.add(number)

    def news(self, timeout):
        if not self.waiting:
            return None
        news = self.waiting.popleft()
        if isinstance(news, set):
            return news
        number, items, worker = news
        if number in self.dropped:
            return None
        try:
            return number, self._do(items, worker)
        except Hangs:
            return None
        except Died:
            self.workers = self.workers - {worker} | {str(self.started)}
            self.started += 1
            self.waiting.append(self.workers.copy())
            return None

    def _do(self, items, worker):
        outcomes = []
        for item in items:
            result, failure = None, None
            try:
                result = self.task(worker, item)
            except Exception as error:
                failure = failure_of(error)
            outcomes.append(Outcome(item, result, failure, 1.0))
            if failure is not None and failure.kind in (Kind.WORKER, Kind.DISK):
                break
        return outcomes

    def why_gone(self):
        is_gone = self.gone_after is not None and len(self.submitted) > self.gone_after
        return "the scheduler is gone" if is_gone else None
