"""The one family of errors a user can meet, each with its place, its cause, its remedy and its exit code."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True, order=True)
class Fault:
    """One thing that is wrong: what was found, what is allowed, what to do.

    Parameters
    ----------
    message : the sentence a person reads; it names the value found and what is allowed
    file : path as the person wrote it, or None where no file is concerned
    line, column : 1-based position in `file`, or None
    """

    message: str
    file: str | None = None
    line: int | None = None
    column: int | None = None

    def __str__(self) -> str:
        place = ":".join(str(part) for part in (self.file, self.line, self.column) if part is not None)
        return f"{place}: {self.message}" if place else self.message


class SkincliError(Exception):
    """Base of every error that is the user's or the machine's, never ours; printed without a traceback.

    Parameters
    ----------
    faults : a message, a Fault, or several Faults of one file that are reported together
    """

    exit_code = 1

    def __init__(self, faults: str | Fault | Iterable[Fault]) -> None:
        if isinstance(faults, str):
            faults = Fault(faults)
        self.faults: list[Fault] = [faults] if isinstance(faults, Fault) else list(faults)
        super().__init__("\n".join(str(fault) for fault in self.faults))


class UsageError(SkincliError):
    """The command line itself is wrong."""

    exit_code = 2


class InputError(SkincliError):
    """A scene, skin, mesh or image is missing or broken, or a value is out of range."""

    exit_code = 3


class DeviceError(SkincliError):
    """No usable GL device, or a shader it refuses."""

    exit_code = 4


class FramesError(SkincliError):
    """Some frames failed while others were written."""

    exit_code = 5


class LimitError(SkincliError):
    """Valid, but larger than the machine, the driver or a stated limit allows."""

    exit_code = 6


class OutputError(SkincliError):
    """The result cannot be written where it was asked for."""

    exit_code = 7


def did_you_mean(word: str, allowed: Sequence[str]) -> str:
    """Return "; did you mean 'x'?" for the nearest of `allowed`, or an empty string when none is near."""
    near = difflib.get_close_matches(word, allowed, n=1, cutoff=0.6)
    return f"; did you mean '{near[0]}'?" if near else ""
