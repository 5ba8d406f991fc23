# SPDX-License-Identifier: MIT
"""Scenes as JSON data: the class and the exact fields of each object.

Users' functions are code, which is not saved.  Instead, functions of time are saved as values at
the times of a solution, curves as points, and other functions as names.  Users' laws and other
objects of users' classes are saved as fields and the name of the class.  They can be compared with
a scene, but not rebuilt.
"""

from __future__ import annotations

import dataclasses
import hashlib
import warnings
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from fractions import Fraction
from functools import cache, partial
from importlib import import_module
from pkgutil import iter_modules
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any, NoReturn

import numpy as np

from ufl_beam.errors import ArgumentError, ModelWarning, require_vector
from ufl_beam.model.bodies import GROUND
from ufl_beam.model.connector_laws import RIGID
from ufl_beam.model.functions import Spline, steady, still
from ufl_beam.model.records import Record
from ufl_beam.output.output_files import WrongReader

Data = Any  # JSON data
Sampling = Callable[[Any, str, Any], Any]
"""Function (object, name of its field, user's function in it) that returns a substitute or None."""

SAMPLES = 1000  # number of intervals between equally spaced points of a curve


@dataclasses.dataclass(frozen=True)
class SavedFunction:
    """Function of time with values at saved times only."""

    name: str  # name of the function
    times: tuple[float, ...]  # ascending; s
    values: tuple[float, ...]  # one for each time

    @classmethod
    def sampled(cls, function: Callable[[float], float], times: Iterable[float]) -> SavedFunction:
        """Sample a function at 0 and at ``times``; omit times at which it raises an error."""
        known = {}
        for t in sorted({0.0, *times}):
            with suppress(Exception):
                known[t] = float(function(t))
        return cls(function_name(function), tuple(known), tuple(known.values()))

    def __call__(self, t: float) -> float:
        """Return the value at a sampled time; :class:`ArgumentError` at other times."""
        n = bisect_left(self.times, t)
        if n == len(self.times) or self.times[n] != t:
            raise ArgumentError(
                f"the function {self.name} is not known at t = {t:g}: a file of a solution has "
                "the values of functions at its times only; load it with your own scene, which has "
                "the function: ub.Solution.load(path, scene=scene)"
            )
        return self.values[n]


@dataclasses.dataclass(frozen=True)
class SavedCurve(Spline):
    """Spline through points of a curve."""

    name: str = ""  # name of the function

    @classmethod
    def sampled(
        cls, name: str, curve: Callable[[float], Any], parameters: Iterable[float]
    ) -> SavedCurve:
        """Sample a curve; omit points with an error, and those that are no numbers."""
        known = {}
        for s in sorted({*map(float, parameters)}):
            with suppress(Exception):
                known[s] = require_vector(curve(s), name)
        return cls(tuple(known.values()), tuple(known), name)


@dataclasses.dataclass(frozen=True)
class LostFunction:
    """Placeholder for a function that cannot be saved, such as a controller."""

    name: str  # name of the function

    def __call__(self, *arguments: object, **named: object) -> NoReturn:
        """Raise :class:`ArgumentError`, because the function was not saved."""
        raise ArgumentError(
            f"the function {self.name} is not in the file of the solution, which has results and "
            "numbers; build the scene with the function to simulate it"
        )


def function_name(function: Any) -> str:
    """Return the name of a function, or of the class of a callable object."""
    return str(getattr(function, "__qualname__", type(function).__qualname__))


# Objects that all scenes share
KNOWN: dict[str, Any] = {"GROUND": GROUND, "HELD": RIGID, "steady": steady, "still": still}

PACKAGES = "ufl_beam.model", "ufl_beam.structures"
"""Subpackages with the classes of objects in files; they are imported when they are needed."""


def is_record(kind: type) -> bool:
    """Return whether files have objects of a class: dataclasses of the model, and further laws."""
    package = kind.__module__.rpartition(".")[0]
    known = package in PACKAGES[:1] or (package in PACKAGES and issubclass(kind, Record))
    return dataclasses.is_dataclass(kind) and (known or kind.__module__ == __name__)


@cache
def record_class(name: str) -> type:
    """Return a class of objects in files by its name."""
    for package in PACKAGES:
        places = import_module(package).__path__
        modules = [import_module(x.name) for x in iter_modules(places, f"{package}.")]
        for known in (globals(), *map(vars, modules)):
            if isinstance(kind := known.get(name), type) and is_record(kind):
                return kind
    raise KeyError(name)


def to_data(value: Any, sampling: Sampling | None = None) -> Data:
    """Describe a scene or another object of the model as data.

    Users' functions are replaced by results of ``sampling``, or by their names.
    """
    records: list[Data] = []
    # By id; the reference to each object prevents Python from reusing the id.
    indices: dict[int, tuple[int, Any]] = {}

    def describe(value: Any, owner: Any, field: str) -> Data:
        if isinstance(value, np.generic):
            value = value.item()
        if value is None or isinstance(value, bool | str | int | float):
            return value
        if isinstance(value, Fraction):
            return {"fraction": str(value)}
        if isinstance(value, np.ndarray):
            return {"array": value.tolist()}
        if isinstance(value, tuple | list):
            return [describe(item, owner, field) for item in value]
        if isinstance(value, Mapping):
            pairs = [[describe(x, owner, field) for x in pair] for pair in value.items()]
            return {"mapping": pairs}
        for name, known in KNOWN.items():
            if value is known:
                return {"known": name}
        if id(value) not in indices:
            record = value
            if not is_record(type(value)):
                if callable(value):
                    known = sampling(owner, field, value) if sampling else None
                    record = LostFunction(function_name(value)) if known is None else known
                elif not dataclasses.is_dataclass(value):
                    raise ArgumentError(
                        f"{value!r} cannot be saved: {type(value).__name__} is no record of "
                        "numbers and names; make it a dataclass"
                    )
            content = {
                f.name: describe(getattr(record, f.name), record, f.name)
                for f in dataclasses.fields(record)
                if f.init
            }
            indices[id(value)] = len(records), value
            kind = type(record)
            if not is_record(kind):
                content["from"] = kind.__module__
            records.append({"is": kind.__qualname__, **content})
        return {"record": indices[id(value)][0]}

    root = describe(value, None, "")
    return {"records": records, "root": root}


def require_no_code(data: Data) -> None:
    """Raise :class:`ArgumentError` if a scene has objects of classes outside the package."""
    for record in data["records"]:
        if "from" in record:
            kind = f"the class {record['is']} of your own (module {record['from']})"
            raise WrongReader(
                f"the scene has {kind}, and files have no code; load it with the scene of the "
                "script, ub.Solution.load(path, scene=scene)"
            )


def add_new_fields(data: Data, present: Data = None) -> Data:
    """Add the fields of the package's classes that are newer than the data, with their defaults.

    A number that is None by default, such as ``Section(GJ=)``, was not known: it is taken from
    ``present``, the data of a scene that is to be compared.
    """
    others = {} if present is None else dict(enumerate(present["records"]))
    for i, record in enumerate(data["records"]):
        kind = None if "from" in record else record_class(record["is"])
        for field in dataclasses.fields(kind) if kind else ():
            made, missing = field.default_factory, dataclasses.MISSING
            value = field.default if made is missing else made()
            default = {} if value is missing else to_data(value)
            if field.init and not default.get("records", True):  # a number, a text or the like
                number = others.get(i, {}).get(field.name) if default["root"] is None else None
                known = number if isinstance(number, float | int) else default["root"]
                record.setdefault(field.name, known)
    return data


def from_data(data: Data) -> Any:
    """Rebuild the scene or object that :func:`to_data` described, without its warnings."""
    require_no_code(data)
    made: list[Any] = []

    def make(data: Data) -> Any:
        if isinstance(data, list):
            return tuple(map(make, data))
        if not isinstance(data, dict):
            return data
        ((kind, content),) = data.items()
        return makers[kind](content)

    makers: dict[str, Callable[[Any], Any]] = {
        "fraction": Fraction, "array": np.array, "known": KNOWN.__getitem__,
        "record": made.__getitem__, "mapping": lambda pairs: dict(map(make, pairs)),
    }  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        for record in add_new_fields(data)["records"]:
            fields = {name: make(value) for name, value in record.items() if name != "is"}
            kind = record_class(record["is"])
            known = {field.name for field in dataclasses.fields(kind) if field.init}
            if others := fields.keys() ^ known:
                unlike = ", ".join(sorted(others))
                raise TypeError(f"{kind.__name__}: fields {unlike} are missing or unknown")
            # Arguments of constructors may differ from the fields.
            made.append(object.__new__(kind))
            for name, value in fields.items():
                object.__setattr__(made[-1], name, value)
            getattr(made[-1], "__post_init__", lambda: None)()
    return make(data["root"])


# -- comparison ------------------------------------------------------------------------------------

CODE = "code"
"""Last component of names of data that depend on the version of Python."""


class Description:
    """Texts of all numbers and names that are reachable from given values, for comparison.

    Functions are compared by their code, defaults and closure variables, and by the data and the
    functions of their own module that they use.  Objects with ``state()`` and ``restore(state)``,
    and random generators of NumPy, are not compared, but collected in :attr:`stateful`.

    Attributes:
        texts: Text by unique name, such as ``{"scene.beams[0] 'left'.section.EI": "2000.0"}``.
        stateful: Objects with a state, by unique name.
    """

    def __init__(self, values: Mapping[str, Any]) -> None:
        self.texts: dict[str, str] = {}
        self.stateful: dict[str, Any] = {}
        # By id; the reference to each object prevents Python from reusing the id.
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
        for key, what in self._members(name, value):
            self._put(f"{name}{key}", what)

    def _members(self, name: str, value: Any) -> Iterator[tuple[str, Any]]:
        """Store a text for an object, and yield names and values of its members."""
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
            yield from ((f"[{key!r}]", member) for key, member in value.items())
        elif isinstance(value, Sequence | set | frozenset):
            self.texts[name] = f"{len(value)} in a row"
            sequence = value if isinstance(value, Sequence) else sorted(value, key=repr)
            for i, member in enumerate(sequence):
                label = getattr(member, "name", None)
                yield f"[{i}]{f' {label!r}' if isinstance(label, str) else ''}", member
        elif isinstance(value, FunctionType):
            self.texts[name] = f"function {value.__qualname__}"
            yield from self._function_members(name, value)
        elif isinstance(value, MethodType):
            yield "", value.__func__
            yield ".self", value.__self__
        elif isinstance(value, partial):
            self.texts[name] = "partial"
            yield from ((f".{p}", getattr(value, p)) for p in ("func", "args", "keywords"))
        else:
            self.texts[name] = type(value).__qualname__
            if not type(value).__module__.startswith("ufl_beam."):
                members = getattr(value, "__dict__", {})
                yield from ((f".{key}", member) for key, member in members.items())

    def _function_members(self, name: str, function: FunctionType) -> Iterator[tuple[str, Any]]:
        code, names = function.__code__, set[str]()
        text = _code_text(code, names)
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
    """Return whether an object can save and restore its state."""
    if isinstance(value, type):
        return False
    own = callable(getattr(value, "state", None)) and callable(getattr(value, "restore", None))
    return own or isinstance(value, np.random.Generator | np.random.RandomState)


def _code_text(code: CodeType, names: set[str]) -> str:
    """Return code as text for comparison, and add the names in the code to ``names``."""
    names.update(code.co_names)
    constants = [
        _code_text(c, names)
        if isinstance(c, CodeType)
        else repr(sorted(c, key=repr) if isinstance(c, frozenset) else c)
        for c in code.co_consts
    ]
    return repr((code.co_code, code.co_names, constants))


def difference(now: Mapping[str, str], then: Mapping[str, str]) -> str:
    """Describe the first difference between two :attr:`Description.texts`; empty if equal."""
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
