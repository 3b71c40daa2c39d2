"""Finds the active passes, which an output needs, and the stale passes among them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from ..errors import GiError
from .handles import Resource, Shared, Slot, View
from .passes import Pass


class Stale(NamedTuple):
    """Why a pass runs.

    "changed": an input has changed, so progress starts over. "settling": progress continues. "repeated": the pass
    reruns only because another pass needs a buffer that has been overwritten; readers do not become stale. `why` is
    the reason as text, or a function that returns it, so that the text is formatted only on demand.
    """

    kind: Literal["changed", "settling", "repeated"]
    why: str | Callable[[], str]

    @property
    def reason(self) -> str:
        """The reason in words."""
        return self.why if isinstance(self.why, str) else self.why()


class Work(ABC):
    """Work on shared resources that runs before a frame's passes; passes see it by the versions of the resources."""

    due = ""  # why it must run; empty if it need not

    @abstractmethod
    def run(self) -> None:
        """Run it; `due` is empty afterwards."""


@dataclass(frozen=True)
class Skipped:
    """Why a pass is not declared, and what it could add at most, or a function that returns that."""

    reason: str
    bound: str | Callable[[], str]


def link(passes: Sequence[Pass], outputs: Iterable[View]) -> None:
    """Find which passes are active, and what each depends on.

    Raises GiError for a resource that is read before any pass writes it.
    """
    writers: dict[Slot, list[Pass]] = {}
    for p in passes:
        for slot in p.written_slots:
            writers.setdefault(slot, []).append(p)
    place = {p: i for i, p in enumerate(passes)}
    for p in passes:
        _check_reads(p, writers, place)
    _cull(passes, outputs, writers, place)
    touched: set[Resource] = set()
    for p in passes:
        if not p.active:
            continue
        reads, writes = p.read_slots, p.written_slots
        # Its producers are the earlier writers of what it reads or overwrites.
        sources = {q for s in reads | writes for q in writers.get(s, ()) if place[q] < place[p]}
        p.producers = {q: _names_from(p, q) for q in passes if q in sources}
        p.stamped = (*(uniform for _, uniform in p.uniforms), *p.resources, *(q.state for q in p.producers))
        # A later pass may overwrite what this one reads. Then the contents are gone in the next frame, and whenever
        # this pass runs, all writers must rerun with it.
        overwritten = {s for s in reads if any(q.active and place[q] > place[p] for q in writers.get(s, ()))}
        others = {q for s in writes | overwritten for q in writers.get(s, ()) if q.active and q is not p}
        p.reruns_with = tuple(q for q in passes if q in others)
        # Buffers that no earlier pass uses are cleared when the frame begins. Split passes submit alone and clear late.
        p.clear_first = tuple(r for r in p.clear if r not in touched and not p.split)
        p.clear_late = tuple(r for r in p.clear if r not in p.clear_first)
        touched.update(p.resources)


def _check_reads(p: Pass, writers: dict[Slot, list[Pass]], place: dict[Pass, int]) -> None:
    for use in p.uses:
        if use.writes or isinstance(use.view.resource, Shared):
            continue
        found = [q for s in use.view.slots() for q in writers.get(s, ())]
        if not found:
            raise GiError(f"{p.where}: {use.name!r} reads {str(use.view)!r}, which no pass writes")
        if not use.view.previous and all(place[q] >= place[p] for q in found):
            raise GiError(
                f"{p.where}: {use.name!r} reads {str(use.view)!r} before pass {found[0].name!r} writes it; "
                "declare that pass first, or read .previous of a resource with history=True"
            )


def _cull(
    passes: Sequence[Pass], outputs: Iterable[View], writers: dict[Slot, list[Pass]], place: dict[Pass, int]
) -> None:
    """Mark the passes that `outputs` need: all earlier writers of what a pass uses (clear before splat)."""
    needed: list[Pass] = []
    for view in outputs:
        found = [q for s in view.slots() for q in writers.get(s, ())]
        if not found:
            raise GiError(f"output {str(view)!r} is written by no pass")
        needed += found
    for p in passes:
        p.active, p.producers, p.reruns_with, p.culled_because = False, {}, (), ""
    while needed:
        p = needed.pop()
        if p.active:
            continue
        p.active = True
        for use in p.uses:
            for slot in use.view.slots():
                needed += [q for q in writers.get(slot, ()) if use.view.previous or place[q] < place[p]]
    for p in passes:
        if not p.active:
            p.culled_because = "no output needs " + ", ".join(r.name for r in p.written)


def stale_passes(order: list[Pass], force: bool = False) -> dict[Pass, Stale]:
    """Return the passes that must run, and why; `order` has the active passes in order of declaration."""
    stale: dict[Pass, Stale] = {}
    renewed: set[Pass] = set()  # passes that will write new results
    for p in order:
        found = _own_reason(p, renewed, force)
        if found is not None:
            stale[p] = found
            if found.kind != "repeated":
                renewed.add(p)
    todo = list(stale)
    while todo:
        p = todo.pop()
        for q in p.reruns_with:
            if q not in stale:
                stale[q] = Stale("repeated", f"pass {p.name} needs its results")
                todo.append(q)
    return stale


def _own_reason(p: Pass, renewed: set[Pass], force: bool) -> Stale | None:
    """Return why a pass must run, apart from what later passes need; `renewed` passes will have new results."""
    state, before = p.state, p.state.seen
    if before is None:
        return Stale("changed", "first run")
    producers = p.producers
    if not renewed.isdisjoint(producers):
        return Stale("changed", lambda: _changed(n for q, names in producers.items() if q in renewed for n in names))
    now = p.inputs()
    if now != before:
        return Stale("changed", lambda: _changed(_differences(p, now, before)))
    if state.settle_index + 1 < p.settle:
        return Stale("settling", f"settling: run {state.settle_index + 2} of {p.settle}")
    if force:
        # A settled pass has no further step, so it starts over.
        settled = p.settle > 1 and not p.reads_history
        return Stale("changed" if settled else "settling" if p.progresses else "repeated", "forced")
    return None


def _changed(names: Iterable[str]) -> str:
    return f"input changed: {', '.join(dict.fromkeys(names))}"


def _names_from(p: Pass, producer: Pass) -> tuple[str, ...]:
    """Return the names of the resources of `p` that an earlier pass writes."""
    slots = producer.written_slots
    names = [u.view.resource.name for u in p.uses if not u.view.previous and not slots.isdisjoint(u.view.slots())]
    return tuple(dict.fromkeys(names))


def _differences(p: Pass, now: tuple, before: tuple) -> list[str]:
    names = _input_names(p)
    if len(now) != len(before):
        return ["the passes before it"]
    return [n for n, a, b in zip(names, now, before, strict=True) if a != b]


def _input_names(p: Pass) -> list[str]:
    """Return a name for each item of `Pass.inputs`."""
    return [
        "params",
        *[uniform.name for _, uniform in p.uniforms],
        *[resource.name for resource in p.resources],
        *[", ".join(names) for names in p.producers.values()],
    ]
