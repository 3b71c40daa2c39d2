"""Which passes an output needs, and which of those are stale."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from ..errors import GiError
from .handles import Shared, Slot, View
from .passes import Pass


@dataclass(frozen=True)
class Stale:
    """Why a pass runs.

    "changed": an input is new, so progress starts again. "settling": it goes on as declared. "repeated": with the same
    inputs as before, since another pass needs what it overwrites; what it writes does not count as new.
    """

    kind: Literal["changed", "settling", "repeated"]
    reason: str


def link(passes: list[Pass], outputs: Iterable[View]) -> None:
    """Set `active`, `producers` and `fellows` of each pass. Raises GiError where something is read but not written."""
    writers: dict[Slot, list[Pass]] = {}
    for p in passes:
        for slot in p.written_slots:
            writers.setdefault(slot, []).append(p)
    place = {p: i for i, p in enumerate(passes)}
    for p in passes:
        _check_reads(p, writers, place)
    _cull(passes, outputs, writers, place)
    for p in passes:
        if not p.active:
            continue
        reads, writes = p.read_slots, p.written_slots
        sources = {q for s in reads | writes for q in writers.get(s, ()) if place[q] < place[p]}
        p.producers = {q: _names_from(p, q) for q in passes if q in sources}
        # What p reads is gone if a later pass has written over it: then all of its writers must run again.
        overwritten = {s for s in reads if any(q.active and place[q] > place[p] for q in writers.get(s, ()))}
        others = {q for s in writes | overwritten for q in writers.get(s, ()) if q.active and q is not p}
        p.fellows = tuple(q for q in passes if q in others)


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


def _cull(passes: list[Pass], outputs: Iterable[View], writers: dict[Slot, list[Pass]], place: dict[Pass, int]) -> None:
    """Mark the passes that `outputs` need: writers of what is read, also earlier ones (clear before splat)."""
    needed: list[Pass] = []
    for view in outputs:
        found = [q for s in view.slots() for q in writers.get(s, ())]
        if not found:
            raise GiError(f"output {str(view)!r} is written by no pass")
        needed += found
    for p in passes:
        p.active, p.producers, p.fellows, p.culled_because = False, {}, (), ""
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


def inputs(p: Pass) -> tuple:
    """Return the versions of all that a pass depends on."""
    return (
        p.params_bytes,
        *[uniform.version for _, uniform in p.uniforms],
        *[(r.generation, r.version) if isinstance(r, Shared) else r.generation for r in p.resources],
        *[q.state.serial for q in p.producers],
    )


def stale_passes(order: list[Pass], force: bool = False) -> dict[Pass, Stale]:
    """Return the passes that must run, and why; `order` are the active passes as declared."""
    stale: dict[Pass, Stale] = {}
    renewed: set[Pass] = set()  # these will write something new
    for p in order:
        found = _own_reason(p, renewed, force)
        if found is not None:
            stale[p] = found
            if found.kind != "repeated":
                renewed.add(p)
    todo = list(stale)
    while todo:
        p = todo.pop()
        for q in p.fellows:
            if q not in stale:
                stale[q] = Stale("repeated", f"pass {p.name} needs it again")
                todo.append(q)
    return stale


def _own_reason(p: Pass, renewed: set[Pass], force: bool) -> Stale | None:
    state = p.state
    if state.seen is None:
        return Stale("changed", "first run")
    if not renewed.isdisjoint(p.producers):
        names = [name for q, written in p.producers.items() if q in renewed for name in written]
        return Stale("changed", f"input changed: {', '.join(dict.fromkeys(names))}")
    now = inputs(p)
    if now != state.seen:
        return Stale("changed", f"input changed: {', '.join(_differences(p, now, state.seen))}")
    if state.settle_index + 1 < p.settle:
        return Stale("settling", f"settling: run {state.settle_index + 2} of {p.settle}")
    if force:
        # What has settled for good would find nothing left to do: it starts again.
        settled = p.settle > 1 and not p.reads_history
        return Stale("changed" if settled else "settling" if p.progresses else "repeated", "forced")
    return None


def _names_from(p: Pass, producer: Pass) -> tuple[str, ...]:
    """Return the names of the resources of `p` that an earlier pass writes."""
    slots = producer.written_slots
    names = [u.view.resource.name for u in p.uses if not u.view.previous and not slots.isdisjoint(u.view.slots())]
    return tuple(dict.fromkeys(names))


def _differences(p: Pass, now: tuple, before: tuple) -> list[str]:
    names = _input_names(p)
    if len(now) != len(before):
        return ["the passes before it"]
    return list(dict.fromkeys(n for n, a, b in zip(names, now, before, strict=True) if a != b))


def _input_names(p: Pass) -> list[str]:
    """Return the names that go with `inputs`."""
    return [
        "params",
        *[uniform.name for _, uniform in p.uniforms],
        *[resource.name for resource in p.resources],
        *[", ".join(names) for names in p.producers.values()],
    ]
