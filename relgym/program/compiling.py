"""Machine code from plain Python functions on numbers and fixed arrays: what `relgym.program.kernel` is written in.

The part of Python that these functions keep to is small: whole numbers of 64 bits with and without a sign, floats,
truth values, arrays of known shape in one work space, ``if``, ``while``, ``for`` over ranges and over tuples of
constants, tuples as results. Several rounds of a loop over ``lanes``, not ``range``, are made at once.
Each function is written as LLVM's assembly, by the types it is called with; LLVM does the rest. A just-in-time compiler
of Python as a whole (numba) says the same, to the bit, in 28 s and 310 MB where this takes two seconds and 130 MB; to
load what it made takes 0.6 s, its import included, where this takes 0.03 to 0.06 s.

Arithmetic is IEEE's, nothing is put in another order, and indices aren't checked.
"""

from __future__ import annotations

import ast
import inspect
import math
import struct
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

__all__ = ["Array", "CompileError", "Type", "Variant", "assembly"]


class CompileError(Exception):
    """A function says something that can't be written down: which, and in which line."""


@dataclass(frozen=True, slots=True)
class Array:
    """The type of an array, or of a part of one.

    Attributes
    ----------
    element
        Type of its entries: a name of LLVM's, or ``"u64"``.
    shape
        Lengths; empty where nobody needs to know the only one.
    place
        What it is a part of: arrays of different places never overlap; empty: it isn't known.
    """

    element: str
    shape: tuple[int, ...]
    place: str


Type: TypeAlias = "str | Array | tuple[Type, ...]"
"""``"i64"``, ``"u64"``, ``"double"``, ``"i1"``, ``"space"``, ``"void"``, an array, or a tuple of these."""


class Value(NamedTuple):
    """A value: its type, and how the assembly calls it; of constants also which one it is."""

    type: Type
    text: str
    known: Any = None


class _Function(NamedTuple):
    name: str
    result: Type


_ELEMENTS: Final = {"int64": "i64", "uint64": "u64", "float64": "double", "int8": "i8"}
_INTRINSICS: Final = {math.sqrt: "llvm.sqrt.f64", math.sin: "sin", math.cos: "cos", np.round: "llvm.rint.f64"}
_WHOLE: Final = {
    ast.Add: "add",
    ast.Sub: "sub",
    ast.Mult: "mul",
    ast.BitAnd: "and",
    ast.BitOr: "or",
    ast.BitXor: "xor",
    ast.LShift: "shl",
}
_LOOPS: Final = 1_000_000
"""Notes on loops are numbered from here, behind those on arrays."""
_REAL: Final = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"}
_COMPARED: Final = {ast.Eq: "eq", ast.NotEq: "ne", ast.Lt: "lt", ast.LtE: "le", ast.Gt: "gt", ast.GtE: "ge"}


@dataclass(frozen=True, slots=True)
class Variant:
    """What is to be understood otherwise than it was written.

    Attributes
    ----------
    constants
        What names of constants mean: sizes of another work space, for example.
    elsewhere
        Fields that don't lie in the work space, and aren't written to: where they lie instead, as LLVM's assembly says.
    instead
        Functions that are called instead of others.
    lanes
        Whether several rounds of loops over `lanes` are made at once.
    """

    constants: Mapping[str, Any] = field(default_factory=dict)
    elsewhere: Mapping[str, str] = field(default_factory=dict)
    instead: Mapping[Callable[..., Any], Callable[..., Any]] = field(default_factory=dict)
    lanes: bool = True


def assembly(
    entries: Mapping[str, tuple[Callable[..., Any], tuple[Type, ...]]],
    space: np.dtype[Any],
    variant: Variant = Variant(),
) -> str:
    """LLVM's assembly of some functions and of all that they call.

    Parameters
    ----------
    entries
        By the name under which others call it: each function, and the types of its arguments. What it and its callees
        name is looked up where each was defined.
    space
        What arguments of type ``"space"`` point at: fields that are arrays.
    variant
        What is to be understood otherwise than it was written.

    Raises
    ------
    CompileError
        Something is said that there is no word for here.
    """
    module = _Module(space, variant)
    for name, (function, types) in entries.items():
        module.function(function, types, name)
    return module.text()


def _plain(kind: Type) -> str:
    """What LLVM calls a type."""
    if isinstance(kind, Array) or kind == "space":
        return "ptr"
    if isinstance(kind, tuple):
        return "{" + ", ".join(map(_plain, kind)) + "}"
    return "i64" if kind == "u64" else kind


def _constant(value: Any) -> Value:
    if isinstance(value, bool):
        return Value("i1", str(int(value)), value)
    if isinstance(value, int | np.int64):
        return Value("i64", str(int(value)), int(value))
    if isinstance(value, np.uint64):
        return Value("u64", str(int(value)), int(value))
    if isinstance(value, float):
        (bits,) = struct.unpack("<Q", struct.pack("<d", value))
        return Value("double", f"0x{bits:016X}", value)
    raise CompileError(f"a constant {value!r}")


@dataclass
class _Module:
    """What was written so far."""

    space: np.dtype[Any]
    variant: Variant
    functions: dict[tuple[Any, tuple[Type, ...]], _Function] = field(default_factory=dict)
    begun: int = 0
    """How many functions were begun."""
    trees: dict[str, dict[str, ast.FunctionDef]] = field(default_factory=dict)
    """The functions of each module that was read."""
    written: list[str] = field(default_factory=list)
    places: dict[str, int] = field(default_factory=dict)
    """Numbers of the places of arrays, of which LLVM is told that they don't overlap."""
    loops: int = 0
    """How many loops are to work on several numbers at once."""

    def function(self, function: Callable[..., Any], types: tuple[Type, ...], name: str = "") -> _Function:
        """A function for arguments of some types; it is written first if nobody called it so before."""
        key = function, types
        if key not in self.functions:
            writer = _Writer(self, function, types, name)
            known = writer.write()
            self.written.append(writer.text(known, internal=not name))
            self.functions[key] = known
        return self.functions[key]

    def definition(self, function: Callable[..., Any]) -> ast.FunctionDef:
        """How a function is defined."""
        home = function.__module__
        if home not in self.trees:
            tree = ast.parse(inspect.getsource(sys.modules[home]))
            self.trees[home] = {each.name: each for each in tree.body if isinstance(each, ast.FunctionDef)}
        return self.trees[home][function.__name__]

    def place(self, name: str) -> int:
        return self.places.setdefault(name, len(self.places))

    def vectorized(self) -> str:
        """What is said of one more loop that is to work on several numbers at once."""
        if not self.variant.lanes:
            return ""
        self.loops += 1
        return f", !llvm.loop !{_LOOPS + self.loops}"

    def text(self) -> str:
        notes = ['!0 = !{!"arrays"}']
        for name, number in self.places.items():
            notes.append(f'!{2 * number + 1} = !{{!"{name}", !0, i64 0}}')
            notes.append(f"!{2 * number + 2} = !{{!{2 * number + 1}, !{2 * number + 1}, i64 0}}")
        notes += [f"!{_LOOPS + k} = distinct !{{!{_LOOPS + k}, !{_LOOPS}}}" for k in range(1, self.loops + 1)]
        notes.append(f'!{_LOOPS} = !{{!"llvm.loop.vectorize.enable", i1 true}}')
        known = ("sin", "cos", "llvm.sqrt.f64", "llvm.rint.f64", "llvm.fabs.f64")
        declared = [f"declare double @{each}(double) nounwind memory(none)" for each in known]
        return "\n\n".join((*declared, *self.written, *notes)) + "\n"


class _Writer:
    """Writes one function."""

    def __init__(
        self, module: _Module, function: Callable[..., Any], types: tuple[Type, ...], name: str
    ) -> None:
        self.module, self.names = module, function.__globals__
        self.definition, self.types = module.definition(function), types
        module.begun += 1
        self.name = name or f"{function.__name__}.{module.begun}"
        self.lines: list[str] = []
        self.entry: list[str] = []
        self.counted = 0
        self.variables: dict[str, Value] = {}  # type, and where it is kept
        self.result: Type | None = None
        self.loops: list[tuple[str, str]] = []  # where `continue` and `break` lead
        self.open = True  # whether what comes next can be reached
        self.reached: set[str] = set()  # labels that something leads to
        self.place = ""  # of what was addressed last

    def write(self) -> _Function:
        """Write the body; what the function is called, and what it returns."""
        for argument, kind in zip(self.definition.args.args, self.types, strict=True):
            if kind == "space":
                self.variables[argument.arg] = Value("space", f"%{argument.arg}")
            else:
                self.set(argument.arg, Value(kind, f"%{argument.arg}"))
        self.body(self.definition.body)
        if self.open:
            if self.result not in {None, "void"}:
                raise CompileError(f"{self.definition.name} ends without a result")
            self.result = "void"
            self.lines.append("ret void")
        assert self.result is not None
        return _Function(self.name, self.result)

    def text(self, known: _Function, *, internal: bool) -> str:
        arguments = ", ".join(
            f"{_plain(t)} %{a.arg}" for t, a in zip(self.types, self.definition.args.args, strict=True)
        )
        head = f"define {'internal ' if internal else ''}{_plain(known.result)} @{known.name}({arguments}) nounwind {{"
        return "\n".join((head, "start:", *self.entry, *self.lines, "}"))

    # ------------------------------------------------------------------ lines
    def new(self, text: str) -> str:
        """Write an instruction; what its value is called."""
        self.counted += 1
        self.lines.append(f"%.{self.counted} = {text}")
        return f"%.{self.counted}"

    def label(self, what: str) -> str:
        self.counted += 1
        return f"{what}.{self.counted}"

    def go(self, label: str, note: str = "") -> None:
        if self.open:
            self.lines.append(f"br label %{label}{note}")
            self.reached.add(label)
        self.open = False

    def at(self, label: str) -> None:
        """What follows stands at a label."""
        self.go(label)
        self.lines.append(f"{label}:")
        self.open = True

    def branch(self, condition: Value, yes: str, no: str) -> None:
        self.lines.append(f"br i1 {condition.text}, label %{yes}, label %{no}")
        self.open = False

    def room(self, kind: Type) -> str:
        """Room for a variable."""
        self.counted += 1
        self.entry.append(f"%v.{self.counted} = alloca {_plain(kind)}")
        return f"%v.{self.counted}"

    def set(self, name: str, value: Value) -> None:
        if name not in self.variables:
            self.variables[name] = Value(value.type, self.room(value.type))
        kept = self.variables[name]
        value = self.to(value, kept.type)
        self.lines.append(f"store {_plain(kept.type)} {value.text}, ptr {kept.text}")

    # ------------------------------------------------------------------ types
    def to(self, value: Value, kind: Type) -> Value:
        """A value as one of another type, if that loses nothing."""
        if value.type == kind:
            return value
        if isinstance(value.known, bool | int) and kind in {"i64", "u64", "double"}:
            return _constant({"i64": int, "u64": np.uint64, "double": float}[str(kind)](value.known))
        if value.type == "i64" and kind == "double":
            return Value("double", self.new(f"sitofp i64 {value.text} to double"))
        if value.type == "i1" and kind in {"i64", "u64"}:
            return Value(kind, self.new(f"zext i1 {value.text} to i64"))
        if value.type == "i64" and kind == "i8":
            return Value("i8", self.new(f"trunc i64 {value.text} to i8"))
        if isinstance(value.type, Array) and replace(value.type, place="") == kind:
            return Value(kind, value.text)
        if value.type == "i1" and kind == "double":
            return Value("double", self.new(f"uitofp i1 {value.text} to double"))
        raise CompileError(f"{value.type} where {kind} is meant")

    def alike(self, a: Value, b: Value) -> tuple[Value, Value]:
        """Two numbers as ones of the same type."""
        for kind in ("double", "u64", "i64"):
            if kind in {a.type, b.type}:
                return self.to(a, kind), self.to(b, kind)
        return self.to(a, "i64"), self.to(b, "i64")

    def truth(self, value: Value) -> Value:
        if value.type == "i1":
            return value
        if value.type == "double":
            return Value("i1", self.new(f"fcmp une double {value.text}, 0.0"))
        if value.type in {"i64", "u64"}:
            return Value("i1", self.new(f"icmp ne i64 {value.text}, 0"))
        raise CompileError(f"whether {value.type} is true")

    # ------------------------------------------------------------------ statements
    def body(self, statements: Sequence[ast.stmt]) -> None:
        for statement in statements:
            if not self.open:
                return  # can't be reached
            try:
                self.statement(statement)
            except CompileError as error:
                if "line" in str(error):
                    raise
                raise CompileError(f"{self.definition.name}, line {statement.lineno}: {error}") from None

    def statement(self, node: ast.stmt) -> None:
        match node:
            case ast.Expr(ast.Constant()) | ast.Pass():
                pass
            case ast.Expr(value):
                self.value(value)
            case ast.Assign(targets, value):
                self.assign_all(targets, self.value(value))
            case ast.AugAssign(target, operator, value):
                old = self.value(ast.parse(ast.unparse(target), mode="eval").body)
                self.assign(target, self.operate(operator, old, self.value(value)))
            case ast.If(test, then, otherwise):
                self.choice(test, lambda: self.body(then), lambda: self.body(otherwise))
            case ast.While(test, inner):
                self.repeat(test, inner)
            case ast.For():
                self.loop(node)
            case ast.Break() | ast.Continue():
                self.go(self.loops[-1][isinstance(node, ast.Break)])
            case ast.Return(value):
                self.leave(value)
            case _:
                raise CompileError(ast.unparse(node))

    @contextmanager
    def looping(self, again: str, end: str) -> Iterator[None]:
        self.loops.append((again, end))
        yield
        self.loops.pop()

    def repeat(self, test: ast.expr, inner: Sequence[ast.stmt]) -> None:
        head, run, end = self.label("while"), self.label("do"), self.label("end")
        self.at(head)
        if not (isinstance(test, ast.Constant) and test.value is True):
            self.branch(self.truth(self.value(test)), run, end)
            self.reached.add(end)
            self.at(run)
        with self.looping(head, end):
            self.body(inner)
        self.go(head)
        if end in self.reached:
            self.at(end)

    def choice(self, test: ast.expr, then: Callable[[], Any], otherwise: Callable[[], Any]) -> None:
        yes, no, end = self.label("then"), self.label("else"), self.label("end")
        self.branch(self.truth(self.value(test)), yes, no)
        self.at(yes)
        then()
        first = self.open
        self.go(end)
        self.at(no)
        otherwise()
        if first or self.open:
            self.at(end)

    def loop(self, node: ast.For) -> None:
        match node:
            case ast.For(ast.Name(name), ast.Tuple(each), inner):
                self.unrolled(name, each, inner)
            case ast.For(ast.Name(name), ast.Call(ast.Name("range"), bounds), inner):
                self.counting(name, bounds, inner)
            case ast.For(ast.Name(name), ast.Call(ast.Name("lanes"), bounds), inner):
                self.counting(name, bounds, inner, self.module.vectorized())
            case _:
                raise CompileError(f"a loop over {ast.unparse(node.iter)}")

    def counting(
        self, name: str, bounds: Sequence[ast.expr], inner: Sequence[ast.stmt], note: str = ""
    ) -> None:
        """A loop over a range; what is assigned to its variable doesn't count. The note is what LLVM is told of it."""
        values = [self.to(self.value(b), "i64") for b in bounds]
        start = values[0] if len(values) > 1 else _constant(0)
        stop, step = values[min(len(values) - 1, 1)], values[2] if len(values) > 2 else _constant(1)
        if step.known is None or step.known == 0:
            raise CompileError("a range whose step isn't a constant")
        head, run, again, end = (self.label(what) for what in ("for", "do", "next", "end"))
        counter = self.room("i64")
        self.lines.append(f"store i64 {start.text}, ptr {counter}")
        self.at(head)
        now = self.new(f"load i64, ptr {counter}")
        going = self.new(f"icmp {'slt' if step.known > 0 else 'sgt'} i64 {now}, {stop.text}")
        self.branch(Value("i1", going), run, end)
        self.at(run)
        self.set(name, Value("i64", now))
        with self.looping(again, end):
            self.body(inner)
        self.at(again)
        following = self.new(f"add nsw i64 {now}, {step.text}")
        self.lines.append(f"store i64 {following}, ptr {counter}")
        self.go(head, note)
        self.at(end)

    def unrolled(self, name: str, each: Sequence[ast.expr], inner: Sequence[ast.stmt]) -> None:
        """A loop over constants, written out."""
        end = self.label("end")
        for one in each:
            again = self.label("next")
            self.set(name, self.value(one))
            with self.looping(again, end):
                self.body(inner)
            self.at(again)
        self.at(end)

    def leave(self, node: ast.expr | None) -> None:
        value = Value("void", "") if node is None else self.value(node)
        if self.result is None:
            self.result = value.type
        if value.type != self.result and isinstance(self.result, tuple) and isinstance(value.type, tuple):
            parts = [self.to(v, t) for v, t in zip(self.parts(value), self.result, strict=True)]
            value = self.packed(parts)
        value = self.to(value, self.result)
        self.lines.append(f"ret {_plain(value.type)} {value.text}".rstrip())
        self.open = False

    def assign_all(self, targets: Sequence[ast.expr], value: Value) -> None:
        for target in targets:
            self.assign(target, value)

    def assign(self, target: ast.expr, value: Value) -> None:
        match target:
            case ast.Name(name):
                self.set(name, value)
            case ast.Tuple(targets):
                for each, part in zip(targets, self.parts(value), strict=True):
                    self.assign(each, part)
            case ast.Subscript(value=array, slice=index):
                kind, address = self.address(array, index)
                if isinstance(kind, Array) or kind == "":
                    raise CompileError("an assignment to a whole array")
                self.lines.append(
                    f"store {_plain(kind)} {self.to(value, kind).text}, ptr {address}, {self.aligned(kind)}"
                )
            case _:
                raise CompileError(ast.unparse(target))

    # ------------------------------------------------------------------ tuples
    def packed(self, parts: Sequence[Value]) -> Value:
        kind = tuple(p.type for p in parts)
        text, plain = "poison", _plain(kind)
        for k, part in enumerate(parts):
            text = self.new(f"insertvalue {plain} {text}, {_plain(part.type)} {part.text}, {k}")
        return Value(kind, text, tuple(parts))

    def parts(self, value: Value) -> list[Value]:
        if isinstance(value.known, tuple):
            return list(value.known)
        if not isinstance(value.type, tuple):
            raise CompileError(f"parts of {value.type}")
        return [
            Value(t, self.new(f"extractvalue {_plain(value.type)} {value.text}, {k}"))
            for k, t in enumerate(value.type)
        ]

    # ------------------------------------------------------------------ expressions
    def value(self, node: ast.expr) -> Value:
        match node:
            case ast.Constant() | ast.Name() | ast.Attribute() | ast.Subscript():
                return self.read(node)
            case ast.Tuple(each):
                return self.packed([self.value(e) for e in each])
            case ast.UnaryOp(operator, operand):
                return self.unary(operator, self.value(operand))
            case ast.BinOp(left, operation, right):
                return self.operate(operation, self.value(left), self.value(right))
            case ast.Compare():
                return self.compare(node)
            case ast.BoolOp():
                return self.either(node)
            case ast.IfExp(test, then, otherwise):
                return self.conditional(test, then, otherwise)
            case ast.Call():
                return self.call(node)
            case _:
                raise CompileError(ast.unparse(node))

    def read(self, node: ast.expr) -> Value:
        """What a constant, a variable, a field or a part of an array holds."""
        match node:
            case ast.Constant(value):
                return _constant(value)
            case ast.Name(name) if name in self.variables:
                kept = self.variables[name]
                if kept.type == "space":
                    return kept
                return Value(kept.type, self.new(f"load {_plain(kept.type)}, ptr {kept.text}"))
            case ast.Name() | ast.Attribute(value=ast.Name("math" | "np")):
                return _constant(self.named(node))
            case ast.Attribute():
                return self.attribute(node)
            case ast.Subscript(value=ast.Attribute(value=array, attr="shape"), slice=ast.Constant(int(k))):
                kind = self.value(array).type
                assert isinstance(kind, Array)
                return _constant(kind.shape[k])
            case ast.Subscript(value=array, slice=index):
                kind, address = self.address(array, index)
                if isinstance(kind, Array):
                    return Value(kind, address)
                return Value(kind, self.new(f"load {_plain(kind)}, ptr {address}, {self.aligned(kind)}"))
            case _:
                raise CompileError(ast.unparse(node))

    def named(self, node: ast.expr) -> Any:
        """What a name means where the function was defined."""
        if isinstance(node, ast.Name):
            if node.id in self.module.variant.constants:
                return self.module.variant.constants[node.id]
            if node.id in self.names:
                return self.names[node.id]
            builtin = {"abs": abs, "min": min, "max": max, "float": float, "int": int}
            if node.id in builtin:
                return builtin[node.id]
        if isinstance(node, ast.Attribute):
            return getattr(self.named(node.value), node.attr)
        raise CompileError(f"the name {ast.unparse(node)}, to which nothing was assigned before")

    def attribute(self, node: ast.Attribute) -> Value:
        """A field of a work space."""
        owner = self.value(node.value)
        if owner.type != "space" or self.module.space.fields is None:
            raise CompileError(ast.unparse(node))
        kind, offset = self.module.space.fields[node.attr][:2]
        base, shape = kind.subdtype or (kind, ())
        address = self.module.variant.elsewhere.get(node.attr, "")
        if not address:
            address = self.new(f"getelementptr inbounds i8, ptr {owner.text}, i64 {offset}")
        return Value(Array(_ELEMENTS[base.name], shape, node.attr), address)

    def address(self, array: ast.expr, index: ast.expr) -> tuple[Any, str]:
        """Type and address of a part of an array."""
        owner = self.value(array)
        kind = owner.type
        if not isinstance(kind, Array):
            raise CompileError(f"a part of {kind}")
        indices = [
            self.to(self.value(i), "i64") for i in (index.elts if isinstance(index, ast.Tuple) else (index,))
        ]
        rest = kind.shape[len(indices) :]
        place: Value | None = None
        for k, each in enumerate(indices):
            width = math.prod(kind.shape[k + 1 :])
            term = self.times(each, width)
            place = (
                term if place is None else Value("i64", self.new(f"add nsw i64 {place.text}, {term.text}"))
            )
        assert place is not None
        self.place = kind.place
        address = self.new(
            f"getelementptr inbounds {_plain(kind.element)}, ptr {owner.text}, i64 {place.text}"
        )
        return (Array(kind.element, rest, kind.place) if rest else kind.element), address

    def times(self, value: Value, width: int) -> Value:
        if width == 1:
            return value
        if value.known is not None:
            return _constant(value.known * width)
        return Value("i64", self.new(f"mul nsw i64 {value.text}, {width}"))

    def aligned(self, kind: Type) -> str:
        """Alignment of what was addressed last, and what it can overlap with."""
        note = f", !tbaa !{2 * self.module.place(self.place) + 2}" if self.place else ""
        return f"align {1 if kind == 'i8' else 8}{note}"

    def unary(self, operator: ast.unaryop, value: Value) -> Value:
        match operator:
            case ast.Not():
                return Value("i1", self.new(f"xor i1 {self.truth(value).text}, 1"))
            case ast.USub() if value.known is not None:
                return _constant(-value.known)
            case ast.USub() if value.type == "double":
                return Value("double", self.new(f"fneg double {value.text}"))
            case ast.USub():
                return Value(value.type, self.new(f"sub i64 0, {value.text}"))
            case ast.Invert() if isinstance(value.known, int) and value.type == "i64":
                return _constant(~value.known)
            case ast.Invert():
                return Value(value.type, self.new(f"xor i64 {value.text}, -1"))
            case _:
                raise CompileError(ast.dump(operator))

    def operate(self, operator: ast.operator, a: Value, b: Value) -> Value:
        if isinstance(operator, ast.Div):
            a, b = self.to(a, "double"), self.to(b, "double")
        else:
            a, b = self.alike(a, b)
        if a.type == "double":
            if type(operator) not in _REAL:
                raise CompileError(f"{type(operator).__name__} of floats")
            return Value("double", self.new(f"{_REAL[type(operator)]} double {a.text}, {b.text}"))
        if type(operator) in _WHOLE:
            if a.known is not None and b.known is not None and a.type == "i64":
                return _constant(_folded(operator, a.known, b.known))
            return Value(a.type, self.new(f"{_WHOLE[type(operator)]} i64 {a.text}, {b.text}"))
        signed = a.type == "i64"
        if isinstance(operator, ast.RShift):
            return Value(a.type, self.new(f"{'ashr' if signed else 'lshr'} i64 {a.text}, {b.text}"))
        if isinstance(operator, ast.FloorDiv | ast.Mod) and signed:
            return self.divide(a, b, isinstance(operator, ast.Mod))
        raise CompileError(type(operator).__name__)

    def divide(self, a: Value, b: Value, rest: bool) -> Value:
        """Quotient, rounded down, or what remains."""
        quotient, remains = self.new(f"sdiv i64 {a.text}, {b.text}"), self.new(f"srem i64 {a.text}, {b.text}")
        uneven = self.new(f"icmp ne i64 {remains}, 0")
        opposite = self.new(f"icmp slt i64 {self.new(f'xor i64 {remains}, {b.text}')}, 0")
        down = self.new(f"and i1 {uneven}, {opposite}")
        if rest:
            more = self.new(f"select i1 {down}, i64 {b.text}, i64 0")
            return Value("i64", self.new(f"add i64 {remains}, {more}"))
        return Value("i64", self.new(f"sub i64 {quotient}, {self.new(f'zext i1 {down} to i64')}"))

    def compare(self, node: ast.Compare) -> Value:
        values = [self.value(v) for v in (node.left, *node.comparators)]
        found: Value | None = None
        for operator, a, b in zip(node.ops, values, values[1:], strict=False):
            one = self.ordered(_COMPARED[type(operator)], a, b)
            found = one if found is None else Value("i1", self.new(f"and i1 {found.text}, {one.text}"))
        assert found is not None
        return found

    def ordered(self, how: str, a: Value, b: Value) -> Value:
        a, b = self.alike(a, b)
        if a.type == "double":
            word = "une" if how == "ne" else f"o{how}"
            return Value("i1", self.new(f"fcmp {word} double {a.text}, {b.text}"))
        word = how if how in {"eq", "ne"} else f"{'s' if a.type == 'i64' else 'u'}{how}"
        return Value("i1", self.new(f"icmp {word} i64 {a.text}, {b.text}"))

    def either(self, node: ast.BoolOp) -> Value:
        """And, or: the truth of it; what needn't be known isn't worked out."""
        kept, end = self.room("i1"), self.label("known")
        for k, each in enumerate(node.values):
            value = self.truth(self.value(each))
            self.lines.append(f"store i1 {value.text}, ptr {kept}")
            if k < len(node.values) - 1:
                on = self.label("on")
                self.branch(value, *((on, end) if isinstance(node.op, ast.And) else (end, on)))
                self.at(on)
        self.at(end)
        return Value("i1", self.new(f"load i1, ptr {kept}"))

    def conditional(self, test: ast.expr, then: ast.expr, otherwise: ast.expr) -> Value:
        """One of two values, the other of which isn't worked out."""
        yes, no, end = self.label("then"), self.label("else"), self.label("end")
        self.branch(self.truth(self.value(test)), yes, no)
        self.at(yes)
        one = self.value(then)
        self.counted += 1
        mark = len(self.lines)  # where the first value is stored, once its type is known
        self.lines.append("")
        self.go(end)
        self.at(no)
        other = self.value(otherwise)
        kind = self.common(one, other)
        kept = self.room(kind)
        other = self.converted(other, kind)
        self.lines.append(f"store {_plain(kind)} {other.text}, ptr {kept}")
        self.at(end)
        rest, self.lines = self.lines[mark + 1 :], self.lines[:mark]
        one = self.converted(one, kind)
        self.lines.append(f"store {_plain(kind)} {one.text}, ptr {kept}")
        self.lines += rest
        return Value(kind, self.new(f"load {_plain(kind)}, ptr {kept}"))

    def common(self, a: Value, b: Value) -> Type:
        if isinstance(a.known, tuple) and isinstance(b.known, tuple):
            return tuple(self.common(x, y) for x, y in zip(a.known, b.known, strict=True))
        if a.type == b.type:
            return a.type
        for kind in ("double", "u64", "i64"):
            if kind in {a.type, b.type}:
                return kind
        if (
            isinstance(a.type, Array)
            and isinstance(b.type, Array)
            and replace(a.type, place=b.type.place) == b.type
        ):
            return replace(a.type, place="")
        raise CompileError(f"either {a.type} or {b.type}")

    def converted(self, value: Value, kind: Type) -> Value:
        if isinstance(value.known, tuple) and isinstance(kind, tuple):
            return self.packed([self.to(v, t) for v, t in zip(value.known, kind, strict=True)])
        return self.to(value, kind)

    # ------------------------------------------------------------------ calls
    def call(self, node: ast.Call) -> Value:
        if isinstance(node.func, ast.Name | ast.Attribute):
            function = self.named(node.func)
            values = [self.value(a) for a in node.args]
            if function in self.module.variant.instead:
                return self.called(
                    self.module.variant.instead[function], [self.to(v, "double") for v in values]
                )
            if function in {min, max} and len(values) == 2:
                return self.extreme(function is min, *values)
            if function is abs:
                return self.absolute(*values)
            if function is float:
                return self.to(values[0], "double")
            if function in {np.int64, np.uint64}:
                return self.whole("i64" if function is np.int64 else "u64", values[0])
            if function is math.isfinite:
                size = self.absolute(self.to(values[0], "double"))
                return self.ordered("lt", size, _constant(math.inf))
            if function in _INTRINSICS:
                number = self.to(values[0], "double")
                return Value(
                    "double", self.new(f"call double @{_INTRINSICS[function]}(double {number.text})")
                )
            if inspect.isfunction(function):
                return self.called(function, values)
        raise CompileError(ast.unparse(node))

    def called(self, function: Callable[..., Any], values: Sequence[Value]) -> Value:
        known = self.module.function(function, tuple(v.type for v in values))
        arguments = ", ".join(f"{_plain(v.type)} {v.text}" for v in values)
        call = f"call {_plain(known.result)} @{known.name}({arguments})"
        if known.result == "void":
            self.lines.append(call)
            return Value("void", "")
        return Value(known.result, self.new(call))

    def extreme(self, least: bool, a: Value, b: Value) -> Value:
        """The second one if it is smaller, or larger; else the first one, also where they can't be compared."""
        a, b = self.alike(a, b)
        second = self.ordered("lt" if least else "gt", b, a)
        plain = _plain(a.type)
        return Value(a.type, self.new(f"select i1 {second.text}, {plain} {b.text}, {plain} {a.text}"))

    def absolute(self, value: Value) -> Value:
        if value.type == "double":
            return Value("double", self.new(f"call double @llvm.fabs.f64(double {value.text})"))
        negative = self.ordered("lt", value, _constant(0))
        other = self.new(f"sub i64 0, {value.text}")
        return Value("i64", self.new(f"select i1 {negative.text}, i64 {other}, i64 {value.text}"))

    def whole(self, kind: str, value: Value) -> Value:
        """A number as a whole one of 64 bits."""
        if value.type == "double":
            return Value(kind, self.new(f"fptosi double {value.text} to i64"))
        if value.type == "i1":
            return self.to(value, kind)
        known = value.known if isinstance(value.known, int) else None
        return Value(kind, value.text, known)


def _folded(operator: ast.operator, a: int, b: int) -> int:
    """What whole constants make, as 64 bits have it."""
    folds: dict[type[ast.operator], Callable[[int, int], int]] = {
        ast.Add: int.__add__,
        ast.Sub: int.__sub__,
        ast.Mult: int.__mul__,
        ast.BitAnd: int.__and__,
        ast.BitOr: int.__or__,
        ast.BitXor: int.__xor__,
        ast.LShift: int.__lshift__,
    }
    found = folds[type(operator)](a, b) & (2**64 - 1)
    return found - 2**64 if found >= 2**63 else found
