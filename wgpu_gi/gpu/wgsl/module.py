"""The module-scope declarations of WGSL text: structs, bindings, constants, overrides and entry points."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Type:
    """A type as written: `array<vec3f, 4>` is Type("array", (Type("vec3f"), 4)). Aliases are resolved."""

    name: str
    args: tuple[Type | int, ...] = ()

    def __str__(self) -> str:
        return self.name + (f"<{', '.join(map(str, self.args))}>" if self.args else "")


@dataclass(frozen=True)
class Member:
    """A struct member with its explicit alignment and size (0: none is given) and its location (-1: none)."""

    name: str
    type: Type
    align: int = 0
    size: int = 0
    location: int = -1


@dataclass(frozen=True)
class Binding:
    """A resource variable; `space` is uniform, storage, texture, storage_texture or sampler, `access` as in WGSL."""

    group: int
    number: int
    name: str
    space: str
    access: str
    type: Type
    line: int


@dataclass(frozen=True, eq=False)
class EntryPoint:
    """A shader stage. `uses` has the names it reaches; `workgroup_size` holds numbers or names of overrides.

    `outputs` maps the names of user-defined outputs to their locations; a bare return value is called "".
    """

    name: str
    stage: str
    workgroup_size: tuple[int | str, ...]
    uses: frozenset[str]
    outputs: dict[str, int]


@dataclass
class Module:
    """All module-scope declarations.

    `overrides` maps names to defaults; None means a computed default, or none (then `required_overrides` has the name).
    `sampled` has the pairs of texture and sampler names that are used together.
    """

    structs: dict[str, tuple[Member, ...]] = field(default_factory=dict)
    bindings: dict[str, Binding] = field(default_factory=dict)
    constants: dict[str, int | float] = field(default_factory=dict)
    overrides: dict[str, int | float | bool | None] = field(default_factory=dict)
    required_overrides: set[str] = field(default_factory=set)
    entry_points: dict[str, EntryPoint] = field(default_factory=dict)
    sampled: set[tuple[str, str]] = field(default_factory=set)
