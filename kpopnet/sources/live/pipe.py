"""Depth that another program sends while it measures, through standard input or a socket of this machine (see `stream`)."""

import contextlib
import hmac
import re
import secrets
import socket
import threading
import time
from typing import BinaryIO

import numpy as np

from kpopnet.camera import Camera, depth_in_metres, tells_unit
from kpopnet.errors import InputError
from kpopnet.languages import Said
from kpopnet.runtime.input_files import parsing
from kpopnet.sources.lenses import View
from kpopnet.sources.source import SEARCH_EVERY_S, SILENCE_S, CameraAwayError, CameraClock, StoredImage
from kpopnet.sources.stream import HEAD, LINE_BYTES, parsed_header

START_S = 10.0
"""How long a sender may take for its first line: it may have to start a camera."""

SCHEMES = STDIN, TCP, UNIX = "stdin:", "tcp:", "unix:"
LOOPBACK = ("127.0.0.1", "localhost", "::1")

SECRET_BYTES = 32
RELAYED = re.compile(rf"{STDIN}([0-9]{{1,5}})/([0-9a-f]{{{2 * SECRET_BYTES}}})")
"""A `Relay`: its port and the secret with which a camera begins."""


def check_address(address: str) -> str:
    """Returns the address of a sender: tcp:127.0.0.1:PORT or unix:PATH. Raises InputError for another, or another machine's."""
    if address.startswith(TCP):
        host, _, port = address.removeprefix(TCP).rpartition(":")
        if host.strip("[]") in LOOPBACK and port.isdecimal() and 0 < int(port) < 65536:
            return address
    elif (address.startswith(UNIX) and address != UNIX and hasattr(socket, "AF_UNIX")) or RELAYED.fullmatch(address):
        return address
    raise InputError(f"{address}: expected tcp:127.0.0.1:PORT, a port of this machine, or unix:PATH, a socket (not on Windows)")


def _silent(name: str) -> Said:
    return Said("{name} sends nothing; look at the program and the camera behind it", name=name)


def _connected(address: str) -> socket.socket:
    """The connection to a sender; raises OSError where there is none."""
    kind, _, place = address.partition(":")
    if kind == "tcp":
        host, _, port = place.rpartition(":")
        return socket.create_connection((host.strip("[]"), int(port)), timeout=START_S)
    if relayed := RELAYED.fullmatch(address):
        connection = socket.create_connection((LOOPBACK[0], int(relayed[1])), timeout=START_S)
        connection.sendall(bytes.fromhex(relayed[2]))
        return connection
    connection = socket.socket(socket.AF_UNIX)
    connection.settimeout(START_S)
    try:
        connection.connect(place)
    except OSError:
        connection.close()
        raise
    return connection


class PipeCamera:
    """The newest image of a sender, which may end and come back; a `LiveCamera`.

    A time that the sender states is one of `time.monotonic`, which all programs of a machine share (CLOCK_MONOTONIC,
    std::chrono::steady_clock on Linux); instead of any other the time of the arrival counts.
    """

    def __init__(self, address: str) -> None:
        """Connects to a sender, see `check_address`. Raises InputError without one, or if it sends something else."""
        self._address, self._closed = check_address(address), False
        self._name = Said("standard input") if address.startswith(STDIN) else address
        self._changed = threading.Condition()
        self.camera: Camera | None = None
        self._newest: tuple[View, StoredImage, float] | None = None
        self._away, self._error, self._ended, self._unit_known = "", "", False, False
        self._connection: socket.socket | None = None
        self._clock = CameraClock()
        threading.Thread(target=self._receive, daemon=True, name="pipe").start()
        with self._changed:
            self._changed.wait_for(lambda: self.camera or self._away or self._error, START_S)
        if self.camera is None:
            self.close()
            raise InputError(self._error or self._away or _silent(self._name))

    def read(self) -> tuple[np.ndarray, float] | None:
        """See `LiveCamera.read`; None after the end of standard input."""
        with self._changed:
            self._changed.wait_for(lambda: self._newest or self._error or self._ended, SILENCE_S)
            newest, self._newest = self._newest, None
        if newest is None and self._error:
            raise InputError(self._error)
        if newest is None and self._ended:
            return None
        if newest is None:
            raise CameraAwayError(self._away or _silent(self._name))
        view, image, arrived = newest
        depth_m = depth_in_metres(image.depth, where=image.where, unit_known=self._unit_known)
        self._unit_known = self._unit_known or tells_unit(depth_m)
        return view.image(depth_m), self._clock.moment(image.time_s, arrived)

    def close(self) -> None:
        self._closed = True
        if self._connection is not None:
            with contextlib.suppress(OSError):  # it has ended
                self._connection.shutdown(socket.SHUT_RDWR)

    def _receive(self) -> None:
        """Keeps the newest image, and looks for the sender again where it has ended, until the camera is closed."""
        while not (self._closed or self._error or self._ended):
            away = error = ""
            try:
                with _connected(self._address) as self._connection, self._connection.makefile("rb") as file:
                    self._follow(self._connection, file)
                away = Said("{name} has ended; start the program that sends depth again", name=self._name)
            except TimeoutError:
                away = _silent(self._name)
            except OSError as failed:
                text = "no program sends depth through {name} ({reason}); start it"
                away = Said(text, name=self._name, reason=failed.strerror or str(failed))
            except InputError as failed:
                error = failed.said
            with self._changed:
                self._away, self._error = away, error
                self._ended = self._address.startswith(STDIN)  # it does not come back
                self._changed.notify_all()
            time.sleep(SEARCH_EVERY_S)

    def _follow(self, connection: socket.socket, file: BinaryIO) -> None:
        """Takes what a sender sends until it ends."""
        if not (line := file.readline(LINE_BYTES)):
            return
        connection.settimeout(None)
        with parsing(self._name, "no depth"):
            header = parsed_header(line, self._name)
            view = header.optics.view()
        with self._changed:
            if self.camera not in (None, view.camera):
                raise InputError(Said("{name}: another camera sends now; start again", name=self._name))
            self.camera, self._away, self._unit_known = view.camera, "", False
            self._changed.notify_all()
        while (image := header.read(file, self._name)) is not None and not self._closed:
            with self._changed:
                self._newest, self._away = (view, image, time.monotonic()), ""
                self._changed.notify_all()


class Relay:
    """Passes what standard input brings to the cameras of other processes that know its address.

    Attributes:
        address: for `PipeCamera`; a secret, as every user of the machine reaches the port. Windows has no sockets of files.
    """

    def __init__(self, file: BinaryIO | None = None) -> None:
        """Waits for the first line. Raises InputError if it is no header."""
        try:
            self._file = file or open(0, "rb", closefd=False)  # noqa: SIM115 Python's own is locked at exit by who reads it
        except OSError as error:
            raise InputError("standard input is closed: send depth to it, as of `python send.py |`") from error
        if self._file.isatty():
            raise InputError("standard input is a terminal: send depth to it, as in `python send.py | kpopnet live -`")
        self._line = self._file.readline(LINE_BYTES)
        self._size = HEAD.size + parsed_header(self._line, "standard input").depth_bytes
        self._changed = threading.Condition()
        self._frame, self._number, self._ended = b"", 0, False
        self._secret = secrets.token_bytes(SECRET_BYTES)
        self._listener = socket.create_server((LOOPBACK[0], 0))
        self.address = f"{STDIN}{self._listener.getsockname()[1]}/{self._secret.hex()}"
        for work in (self._read, self._accept):
            threading.Thread(target=work, daemon=True, name=f"relay {work.__name__}").start()

    def close(self) -> None:
        self._end()
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()

    def _end(self) -> None:
        with self._changed:
            self._ended = True
            self._changed.notify_all()

    def _read(self) -> None:
        while len(frame := self._file.read(self._size)) == self._size and not self._ended:
            with self._changed:
                self._frame, self._number = frame, self._number + 1
                self._changed.notify_all()
        self._end()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):  # it is closed
            while True:
                threading.Thread(target=self._serve, args=self._listener.accept()[:1], daemon=True, name="relay").start()

    def _serve(self, connection: socket.socket) -> None:
        with connection, contextlib.suppress(OSError):  # the camera was closed
            connection.settimeout(START_S)
            with connection.makefile("rb") as file:
                if not hmac.compare_digest(file.read(SECRET_BYTES), self._secret):
                    return
            connection.settimeout(None)
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            # Before the line, after which a camera counts on every image. Where all images came before, it gets the last one.
            sent = 0 if self._ended else self._number
            connection.sendall(self._line)
            while True:
                with self._changed:
                    while self._number == sent and not self._ended:
                        self._changed.wait()
                    if self._number == sent:
                        return
                    frame, sent = self._frame, self._number
                connection.sendall(frame)
