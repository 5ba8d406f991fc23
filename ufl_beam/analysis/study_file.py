# SPDX-License-Identifier: MIT
"""Results of the members of a study, and their file."""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.display import Rich
from ufl_beam.errors import SceneError, require_kind
from ufl_beam.output.archive import above, below, decoding, plain, read, require_arrays, write
from ufl_beam.output.output_files import require_path

Outcome = dict[str, Array] | str  # result of a member, or the reason of its failure

FORMAT = "study of ufl_beam, 2"


@dataclass(frozen=True, eq=False)
class Study(Rich):
    """Results of the members of a study, the same on every process.

    ``study["peak"]`` has a row for each case; that of a failed member is NaN.

    Attributes:
        member: Name of the function.
        cases: Arguments of each member; lists where these were tuples or arrays.
        results: Returned values by name; (len(cases), ...) each.
        failed: Number of a case that failed, and its error.
        seconds: Wall time of each member; (len(cases),); s.

    Example:
        >>> results = ub.study(lambda n: {"square": n**2}, [{"n": 3}, {"n": 4}])
        >>> print(results["square"], results.failed)
        [ 9. 16.] {}
    """

    member: str
    cases: tuple[dict[str, Any], ...]
    results: dict[str, Array]
    failed: dict[int, str]
    seconds: Array

    @classmethod
    def of(cls, member: str, records: dict[str, tuple[Outcome, float]]) -> Study:
        """Make a study from outcome and seconds of each case, cases as :func:`text_of`."""
        outcomes = [outcome for outcome, _ in records.values()]
        failed = {i: outcome for i, outcome in enumerate(outcomes) if isinstance(outcome, str)}
        first: dict[str, Array] = next((row for row in outcomes if not isinstance(row, str)), {})
        none = {name: np.full_like(first[name], np.nan) for name in sorted(first)}
        rows = [none if isinstance(outcome, str) else outcome for outcome in outcomes]
        results = {name: np.array([row[name] for row in rows]) for name in none}
        seconds = np.array([seconds for _, seconds in records.values()])
        return cls(member, tuple(map(json.loads, records)), results, failed, seconds)

    def records(self) -> dict[str, tuple[Outcome, float]]:
        """Return the data from which :meth:`of` makes this study."""
        found: dict[str, tuple[Outcome, float]] = {}
        for i, case in enumerate(self.cases):
            row = {name: values[i] for name, values in self.results.items()}
            found[text_of(case)] = self.failed.get(i, row), float(self.seconds[i])
        return found

    def __len__(self) -> int:
        return len(self.cases)

    def __getitem__(self, name: str) -> Array:
        if name not in self.results:
            raise SceneError(f"study: no result {name!r}; there is {', '.join(self.results)}")
        return self.results[name]

    def __repr__(self) -> str:
        names = ", ".join(self.results) or "no results"
        return f"<Study of {self.member}: {len(self)} cases, {len(self.failed)} failed; {names}>"

    def __str__(self) -> str:
        lines = [f"study of {self.member}: {len(self)} members, {len(self.failed)} failed"]
        lines += [f"  failed: {self.cases[i]}: {error}" for i, error in self.failed.items()]
        return "\n".join(lines)

    def save(self, path: str | Path) -> None:
        """Write a file with a checksum; an existing one is replaced once the new one is complete.

        Raises:
            SceneError: The file cannot be written.
            OSError: There is no space for it.
        """
        file = require_path(path, "study")
        content = {
            "member": self.member, "cases": [*map(text_of, self.cases)], "seconds": self.seconds,
            "errors": [self.failed.get(i, "") for i in range(len(self))],
        }  # fmt: skip
        write(file, FORMAT, {**content, **above("results/", self.results)})

    @classmethod
    def load(cls, path: str | Path) -> Study:
        """Read a file that :meth:`save` or :func:`study` wrote.

        Raises:
            SceneError: There is no such file, or it holds no study, or is damaged.
        """
        file = require_path(path, "study")
        with decoding(file, FORMAT):
            content = read(file, FORMAT)
            cases, results = content["cases"], below("results/", content)
            failed = {i: str(error) for i, error in enumerate(content["errors"]) if error}
            require_arrays(content, {"seconds": (len(cases),)})
            for name, values in results.items():
                require_arrays(results, {name: (len(cases), *values.shape[1:])})
            if len(content["errors"]) != len(cases):
                raise SceneError("the file is damaged: it has not one 'errors' for each case")
            made = tuple(map(json.loads, cases))
            return cls(str(content["member"]), made, results, failed, content["seconds"])


def text_of(case: dict[str, Any], what: str = "case") -> str:
    """Write a case as JSON, by which cases are compared: all digits, names sorted."""
    require_kind(case, dict, what)
    for name in case:
        require_kind(name, str, f"{what}: name")
    try:
        return json.dumps(case, sort_keys=True, ensure_ascii=False, default=plain)
    except (TypeError, ValueError):
        raise SceneError(
            f"{what} = {case}: values must be numbers, texts or lists of them; let the member "
            "make of these what else it needs"
        ) from None


def numbers_of(case: dict[str, Any], returned: Any) -> dict[str, Array]:
    """Return the result of a member as arrays of floats, or raise :class:`SceneError`."""
    if not isinstance(returned, dict) or not returned:
        raise SceneError(f"study: {case} returned {returned!r}; return a dict of numbers or arrays")
    arrays = {}
    for name, value in returned.items():
        if not isinstance(name, str) or name in {"", "."} or "/" in name or not name.isprintable():
            raise SceneError(f"study: {case} returned {name!r}, which is no name of a result")
        array = np.asarray(None)  # stays so if rows have different lengths
        with suppress(ValueError):
            array = np.asarray(value)
        if array.dtype.kind not in "biuf":
            raise SceneError(
                f"study: {case} returned {name} = {value!r}, which is no number or array of them"
            )
        arrays[name] = array.astype(float)
    return arrays
