"""Reads the module-scope declarations of WGSL text: structs, bindings, constants, overrides and entry points.

A small recursive parser; function bodies are only searched for the names that they use. Errors carry the line of the
pasted text; the caller knows the file.
"""

from __future__ import annotations

from .module import Binding, EntryPoint, Member, Module, Type
from .tokens import ParseError, Token, evaluate, tokenize


def parse(text: str) -> Module:
    """Return the module-scope declarations of the WGSL `text`. Raises ParseError."""
    return _Parser(tokenize(text)).module()


class _Parser:
    def __init__(self, tokens: list[Token]) -> None:
        self.tokens = [*tokens, Token("end", "end of file", tokens[-1].line if tokens else 1)]
        self.at = 0
        self.out = Module()
        self.aliases: dict[str, Type] = {}
        self.bodies: dict[str, set[str]] = {}
        self.stages: dict[str, tuple[str, tuple[int | str, ...], dict[str, int], Type]] = {}
        self.samplings: list[set[str]] = []

    # The token stream.

    @property
    def token(self) -> Token:
        return self.tokens[self.at]

    def take(self, text: str = "") -> Token:
        token = self.token
        if token.kind == "end" or (text and token.text != text):
            raise ParseError(f"expected {text or 'more'!r}, found {token.text!r}", token.line)
        self.at += 1
        return token

    def name(self) -> str:
        if self.token.kind != "name":
            raise ParseError(f"expected a name, found {self.token.text!r}", self.token.line)
        return self.take().text

    def skips(self, text: str) -> bool:
        if self.token.kind != "end" and self.token.text == text:
            self.at += 1
            return True
        return False

    # Declarations.

    def module(self) -> Module:
        while self.token.kind != "end":
            self.declaration()
        reached = {name: self.reach(name) for name in self.stages}
        for name, (stage, size, outputs, returned) in self.stages.items():
            members = self.out.structs.get(returned.name, ())
            outputs |= {m.name: m.location for m in members if m.location >= 0}
            self.out.entry_points[name] = EntryPoint(name, stage, size, frozenset(reached[name]), outputs)
        kinds = {b.name: b.space for b in self.out.bindings.values()}
        for words in self.samplings:
            textures = [w for w in words if kinds.get(w) == "texture"]
            samplers = [w for w in words if kinds.get(w) == "sampler"]
            self.out.sampled.update((t, s) for t in textures for s in samplers)
        return self.out

    def declaration(self) -> None:
        attributes = self.attributes()
        keyword = self.take()
        if keyword.text == ";":
            return
        if keyword.text == "struct":
            self.struct()
        elif keyword.text == "fn":
            self.function(attributes)
        elif keyword.text == "var":
            self.variable(attributes, keyword.line)
        elif keyword.text in ("const", "override"):
            self.constant(keyword.text)
        elif keyword.text == "alias":
            alias = self.name()
            self.take("=")
            self.aliases[alias] = self.type()
            self.take(";")
        elif keyword.text in ("enable", "requires", "diagnostic", "const_assert"):
            while self.take().text != ";":
                pass
        else:
            raise ParseError(f"expected a declaration, found {keyword.text!r}", keyword.line)

    def attributes(self) -> dict[str, list[list[Token]]]:
        """Parse `@name(a, b)` and so on into {name: [tokens of a, tokens of b]}."""
        found: dict[str, list[list[Token]]] = {}
        while self.skips("@"):
            arguments = found.setdefault(self.name(), [])
            if self.skips("("):
                depth = 1
                arguments.append([])
                while depth:
                    token = self.take()
                    depth += {"(": 1, ")": -1}.get(token.text, 0)
                    if depth == 1 and token.text == ",":
                        arguments.append([])
                    elif depth:
                        arguments[-1].append(token)
        return {name: [a for a in arguments if a] for name, arguments in found.items()}

    def struct(self) -> None:
        struct = self.name()
        members = []
        self.take("{")
        while not self.skips("}"):
            attributes = self.attributes()
            member = self.name()
            self.take(":")
            explicit = {a: self.integer(attributes[a][0]) for a in ("align", "size", "location") if a in attributes}
            members.append(Member(member, self.type(), **explicit))
            if not self.skips(","):
                self.take("}")
                break
        self.out.structs[struct] = tuple(members)

    def variable(self, attributes: dict[str, list[list[Token]]], line: int) -> None:
        words: list[str] = []
        if self.skips("<"):
            while not self.skips(">"):
                words.append(self.take().text)
        name = self.name()
        kind = self.type() if self.skips(":") else Type("")
        self.skip_to_semicolon()
        if "group" not in attributes or "binding" not in attributes:
            return
        space, access = words[0] if words else "texture", words[2] if len(words) > 2 else "read"
        if kind.name.startswith("sampler"):
            space = "sampler"
        elif kind.name.startswith("texture_storage"):
            space, access = "storage_texture", str(kind.args[1])
        group, number = (self.integer(attributes[a][0]) for a in ("group", "binding"))
        self.out.bindings[name] = Binding(group, number, name, space, access, kind, line)

    def constant(self, keyword: str) -> None:
        name = self.name()
        kind = self.type() if self.skips(":") else Type("")
        value: int | float | None = None
        if self.skips("="):
            start = self.at
            self.skip_to_semicolon()
            value = self.value(self.tokens[start : self.at - 1])
        else:
            self.take(";")
            self.out.required_overrides.add(name)
        if value is not None and kind.name in ("f32", "f16"):
            value = float(value)
        if keyword == "override":
            self.out.overrides[name] = bool(value) if kind.name == "bool" and value is not None else value
        elif value is not None:
            self.out.constants[name] = value

    def function(self, attributes: dict[str, list[list[Token]]]) -> None:
        name = self.name()
        start = self.at
        outputs: dict[str, int] = {}
        returned = Type("")
        while self.token.text != "{":
            if self.take().text == "->":
                result = self.attributes()
                returned = self.type()
                outputs = {"": self.integer(result["location"][0])} if "location" in result else {}
        depth = 0
        while True:
            text = self.take().text
            if text == "{":
                depth += 1
            elif text == "}":
                depth -= 1
                if depth == 0:
                    break
        words = self.tokens[start : self.at]
        # A name after a dot is a member, not a variable of that name.
        before = [self.tokens[start - 1], *words]
        self.bodies[name] = {t.text for b, t in zip(before, words, strict=False) if t.kind == "name" and b.text != "."}
        self.note_sampling(words)
        for stage in ("compute", "vertex", "fragment"):
            if stage in attributes:
                sizes = attributes.get("workgroup_size", [])
                self.stages[name] = (stage, tuple(map(self.size_or_override, sizes)), outputs, returned)
                self.bodies[name] |= {t.text for tokens in sizes for t in tokens if t.kind == "name"}

    def note_sampling(self, words: list[Token]) -> None:
        """Collect the names among the arguments of each textureSample or textureGather call."""
        for i, token in enumerate(words):
            if not token.text.startswith(("textureSample", "textureGather")):
                continue
            names, depth = set(), 0
            for word in words[i + 1 :]:
                depth += {"(": 1, ")": -1}.get(word.text, 0)
                if depth == 0:
                    break
                names.add(word.text)
            self.samplings.append(names)

    def reach(self, entry: str) -> set[str]:
        """Return all names that the function `entry` uses, directly or through functions that it calls."""
        seen: set[str] = set()
        todo = [entry]
        while todo:
            for word in self.bodies.get(todo.pop(), ()):
                if word not in seen:
                    seen.add(word)
                    todo.append(word)
        return seen

    def skip_to_semicolon(self) -> None:
        while self.take().text != ";":
            pass

    # Types and constant expressions.

    def type(self) -> Type:
        name = self.name()
        args: list[Type | int] = []
        if self.skips("<"):
            while not self.skips(">"):
                args.append(self.type_argument())
                self.skips(",")
        if not args and name in self.aliases:
            return self.aliases[name]
        return Type(name, tuple(args))

    def type_argument(self) -> Type | int:
        """Parse a type, or an array size: an integer expression up to the `,` or `>` that ends it."""
        token = self.token
        if token.kind == "name" and token.text not in self.out.constants:
            return self.type()
        start, depth = self.at, 0
        while depth or self.token.text not in (",", ">"):
            depth += {"(": 1, ")": -1}.get(self.take().text, 0)
        return self.integer(self.tokens[start : self.at])

    def size_or_override(self, tokens: list[Token]) -> int | str:
        if len(tokens) == 1 and tokens[0].kind == "name" and tokens[0].text not in self.out.constants:
            return tokens[0].text
        return self.integer(tokens)

    def integer(self, tokens: list[Token]) -> int:
        value = self.value(tokens)
        if not isinstance(value, int):
            text = " ".join(t.text for t in tokens)
            raise ParseError(f"{text!r} is not an integer made of literals and constants", tokens[0].line)
        return value

    def value(self, tokens: list[Token]) -> int | float | None:
        return evaluate(tokens, self.out.constants)
