"""Every way a port dies, as one error: for one pulled plug, pyserial raises four families of exceptions."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager

from r2s2r_cli.devices.link import LinkError
from r2s2r_cli.errors import quoted
from r2s2r_cli.hardware.look import look_at

_REASONS: dict[int, tuple[str, str, str]] = {
    errno.ENOENT: ("there is no such port", "plugged in, or `r2s2r rig` running", "r2s2r doctor ports"),
    errno.ENODEV: ("there is no such port", "plugged in and switched on", "r2s2r doctor ports"),
    errno.EACCES: ("this user may not open the port", "membership in its group", 'sudo usermod -aG dialout "$USER"'),
    errno.EPERM: ("this user may not open the port", "membership in its group", 'sudo usermod -aG dialout "$USER"'),
    errno.EAGAIN: ("another program holds the port", "one program at a time", "fuser -v {port}"),
    errno.EBUSY: ("another program holds the port", "one program at a time", "fuser -v {port}"),
    errno.EADDRINUSE: ("another program listens on that address", "an address of our own", "ss -lunp"),
    errno.EADDRNOTAVAIL: ("this machine does not have that address", "an address of this machine", "ip -brief address"),
    errno.ECONNREFUSED: ("nobody listens at that address", "a robot or `r2s2r rig --link tcp`", "r2s2r doctor ports"),
    errno.ENOTTY: ("this is no port", "a serial device", "r2s2r doctor ports"),
    errno.EISDIR: ("this is no port", "a serial device", "r2s2r doctor ports"),
}


@contextmanager
def port_errors(port: str, doing: str) -> Iterator[None]:
    """Turn whatever the operating system or pyserial raise inside into a LinkError that names the port.

    serial.SerialException is an OSError (so is a time-out of writing), in_waiting raises a plain OSError, flush and
    reset raise termios.error, which is none; a port that another thread closed gives TypeError or ValueError.
    """
    try:
        yield
    except LinkError:
        raise
    except (OSError, TypeError, ValueError, OverflowError) as error:
        raise _link_error(port, doing, error) from error
    except Exception as error:
        # termios exists on POSIX alone, and its error has no base but Exception.
        if type(error).__module__ != "termios":
            raise
        raise _link_error(port, doing, error) from error


def not_taken(port: str, seconds: float) -> LinkError:
    """The other side does not read: what we write stays in the buffer."""
    return LinkError(
        "the robot does not take what it is sent", where=f"{port}, writing", expected=f"room within {seconds:g} s",
        received="a full buffer", hint=look_at(port),
    )  # fmt: skip


def no_such_host(port: str, host: str) -> LinkError:
    """The name of an address means nothing."""
    return LinkError("there is no such host", where=f"{port}, opening", expected="the address of the robot",
                     received=host, hint=f"getent hosts {quoted(host)}   # or give its number")  # fmt: skip


def hung_up(port: str) -> LinkError:
    """The other side closed the connection."""
    return LinkError("the robot closed the connection", where=f"{port}, reading", expected="an open connection",
                     received="end of the stream", hint=look_at(port))  # fmt: skip


def _link_error(port: str, doing: str, error: Exception) -> LinkError:
    number = _number(error)
    text = " ".join((os.strerror(number) if number else str(error) or type(error).__name__).split())[:160]
    what, expected, hint = _REASONS.get(number, ("", "", "")) if doing == "opening" else ("", "", "")
    return LinkError(
        what or ("the port cannot be opened" if doing == "opening" else "the link to the robot broke"),
        where=f"{port}, {doing}", expected=expected or "a port that works", received=text,
        hint=hint.format(port=quoted(port)) or look_at(port),
    )  # fmt: skip


def _number(error: BaseException | None) -> int:
    """The number of the operating system's error, also where pyserial has wrapped it; 0: none."""
    while error is not None:
        number = getattr(error, "errno", None) or (error.args[0] if error.args else None)
        if isinstance(number, int) and not isinstance(number, bool):
            return number
        error = error.__cause__ or error.__context__
    return 0
