# SPDX-License-Identifier: MIT
"""Fingerprint of the arguments of a run, to tell whether a checkpoint is of the same one."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from functools import partial
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

CODE = "code"
"""Last part of the names of what depends on the version of Python."""


class Description:
    """Every number and name that can be reached from some values, each under its own name.

    Functions are compared by their code, their defaults, the variables around them and the numbers
    and functions of their module that they use.  What offers ``state()`` and ``restore(state)``,
    and random generators of NumPy, are not compared but found.

    Attributes:
        texts: Text by name, such as ``{"scene.beams[0] 'left'.section.EI": "2000.0"}``.
        stateful: What has a state, by name.
    """

    def __init__(self, values: Mapping[str, Any]) -> None:
        self.texts: dict[str, str] = {}
        self.stateful: dict[str, Any] = {}
        # By identity; the objects are kept, so that none gets the identity of another.
        self._seen: dict[int, tuple[str, Any]] = {}
        for name, value in values.items():
            self._put(name, value)

    def _put(self, name: str, value: Any) -> None:
        if value is None or isinstance(value, bool | str | bytes | Fraction | ModuleType | type):
            self.texts[name] = getattr(value, "__qualname__", repr(value))
            return
        if isinstance(value, int | float | np.integer | np.floating):
            whole = isinstance(value, int) and abs(value) >= 2**53
            self.texts[name] = repr(value if whole else float(value))  # 2 and 2.0 are one number
            return
        if not isinstance(value, tuple):
            first, _ = self._seen.setdefault(id(value), (name, value))
            if first != name:
                self.texts[name] = f"the same as {first}"
                return
        for part, what in self._parts(name, value):
            self._put(f"{name}{part}", what)

    def _parts(self, name: str, value: Any) -> Iterator[tuple[str, Any]]:
        """Note what a thing is; the things it consists of, and how they are called."""
        if has_state(value):
            self.stateful[name] = value
            self.texts[name] = type(value).__qualname__
        elif dataclasses.is_dataclass(value):
            self.texts[name] = type(value).__qualname__
            for field in dataclasses.fields(value):
                yield f".{field.name}", getattr(value, field.name)
        elif isinstance(value, np.ndarray):
            digest = hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()[:16]
            self.texts[name] = f"{value.dtype} of shape {value.shape}, checksum {digest}"
        elif isinstance(value, Mapping):
            self.texts[name] = f"{len(value)} by name"
            yield from ((f"[{key!r}]", part) for key, part in value.items())
        elif isinstance(value, Sequence | set | frozenset):
            self.texts[name] = f"{len(value)} in a row"
            parts = value if isinstance(value, Sequence) else sorted(value, key=repr)
            for i, part in enumerate(parts):
                label = getattr(part, "name", None)
                yield f"[{i}]{f' {label!r}' if isinstance(label, str) else ''}", part
        elif isinstance(value, FunctionType):
            self.texts[name] = f"function {value.__qualname__}"
            yield from self._of_function(name, value)
        elif isinstance(value, MethodType):
            self.texts[name] = f"method {value.__func__.__qualname__}"
            yield "", value.__func__
            yield ".self", value.__self__
        elif isinstance(value, partial):
            self.texts[name] = "partial"
            yield from ((f".{p}", getattr(value, p)) for p in ("func", "args", "keywords"))
        else:
            self.texts[name] = type(value).__qualname__
            if not type(value).__module__.startswith("ufl_beam."):
                members = getattr(value, "__dict__", {})
                yield from ((f".{key}", part) for key, part in members.items())

    def _of_function(self, name: str, function: FunctionType) -> Iterator[tuple[str, Any]]:
        code, names = function.__code__, set[str]()
        text = _text_of(code, names)
        self.texts[f"{name}.{CODE}"] = hashlib.sha256(text.encode()).hexdigest()[:16]
        for variable, cell in zip(code.co_freevars, function.__closure__ or (), strict=True):
            try:
                yield f".{variable}", cell.cell_contents
            except ValueError:  # not yet assigned
                self.texts[f"{name}.{variable}"] = "nothing"
        yield ".defaults", function.__defaults__
        yield ".defaults by name", function.__kwdefaults__
        for variable in sorted(names & function.__globals__.keys()):
            used = function.__globals__[variable]
            mine = getattr(used, "__module__", None) == function.__module__
            plain = isinstance(
                used, int | float | str | Sequence | Mapping | np.ndarray | np.number
            )
            if plain or has_state(used) or (isinstance(used, FunctionType) and mine):
                yield f".{variable}", used


def has_state(value: Any) -> bool:
    """Return whether something says its state and takes it back."""
    if isinstance(value, type):
        return False
    own = callable(getattr(value, "state", None)) and callable(getattr(value, "restore", None))
    return own or isinstance(value, np.random.Generator | np.random.RandomState)


def _text_of(code: CodeType, names: set[str]) -> str:
    """Return a code as text that can be compared, and add the names that it uses to ``names``."""
    names.update(code.co_names)
    constants = [
        _text_of(c, names)
        if isinstance(c, CodeType)
        else repr(sorted(c, key=repr) if isinstance(c, frozenset) else c)
        for c in code.co_consts
    ]
    return repr((code.co_code, code.co_names, constants))


def difference(now: Mapping[str, str], then: Mapping[str, str]) -> str:
    """The first thing in which two descriptions differ, in words; empty if there is none."""
    for name, text in now.items():
        if name not in then:
            return f"{name} is {text}, in the file there is none"
        if then[name] != text:
            if name.endswith(f".{CODE}"):
                return f"the function {name.removesuffix(f'.{CODE}')} has changed"
            return f"{name} is {text}, in the file {then[name]}"
    for name, text in then.items():
        if name not in now:
            return f"{name} is {text} in the file, and there is none now"
    return ""
