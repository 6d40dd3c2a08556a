"""Films are made in a process of their own, one at a time, for as long as their page waits for them."""

import asyncio
import contextlib
import multiprocessing
import os
import time
from collections.abc import AsyncGenerator
from multiprocessing.connection import Connection

from kpopnet.dance.joint_files.reader import read_performance
from kpopnet.errors import InputError
from kpopnet.teacher.film import write_film
from kpopnet.teacher.library import Library
from kpopnet.teacher.tries import Tries

TELL_EVERY_S = 0.5
END_S = 5.0
PATIENCE_S = 2.0
"""A film that is asked for waits as long for one that is being cancelled."""

NICENESS = 5
"""Lessons go first."""


class CancelledError(Exception):
    """The film is not wanted any more."""


class Filming:
    """Makes the films of tries."""

    def __init__(self, library: Library, tries: Tries) -> None:
        self._library, self._tries = library, tries
        self._one, self._ended = asyncio.Lock(), False

    async def make(self, dance: str, name: str) -> AsyncGenerator[float]:
        """Makes the film of a try, if there is none yet. Closing this generator ends the work, and nothing is left of it.

        Yields:
            How much of it is done, 0..1, every TELL_EVERY_S seconds or so.

        Raises:
            InputError: there is no such try, or its film cannot be made; another film is being made; the server ends.
        """
        if self._tries.film_path(dance, name).is_file():
            return
        try:
            await asyncio.wait_for(self._one.acquire(), PATIENCE_S)
        except TimeoutError as error:
            raise InputError("another film is being made; wait for it, or cancel it where it was begun") from error
        context = multiprocessing.get_context("spawn")
        connection, other = context.Pipe()
        given = other, self._library, self._tries, dance, name
        process = context.Process(target=make_film, args=given, daemon=True, name="film")
        fraction = 0.0
        try:
            process.start()
            other.close()
            while fraction < 1:
                if await asyncio.to_thread(connection.poll, TELL_EVERY_S):
                    fraction, error = connection.recv()
                    if error:
                        raise InputError(error)
                if self._ended:
                    raise InputError("the program ends; make the film again")
                yield fraction  # also where there is nothing new: writing to a page that has gone fails
        except (EOFError, OSError) as error:
            raise InputError("the film was not finished; make it again") from error
        finally:
            connection.close()
            try:
                if process.pid is not None:  # it was started
                    await asyncio.to_thread(_end, process)
            finally:
                other.close()
                self._one.release()

    def end(self) -> None:
        """Ends the film that is being made, if there is one, and makes no others."""
        self._ended = True


def _end(process: multiprocessing.process.BaseProcess) -> None:
    process.join(END_S)
    if process.is_alive():
        process.terminate()
        process.join(END_S)


def make_film(connection: Connection, library: Library, tries: Tries, dance: str, name: str) -> None:
    """Makes a film and sends (fraction that is done, what went wrong); ends when the other end is closed."""
    with contextlib.suppress(AttributeError, OSError):  # where processes have no niceness
        os.nice(NICENESS)
    next_s = 0.0

    def tell(fraction: float) -> None:
        nonlocal next_s
        if connection.poll():  # only the end of the connection can be there
            raise CancelledError
        if time.monotonic() >= next_s:
            connection.send((fraction, ""))
            next_s = time.monotonic() + TELL_EVERY_S

    with contextlib.suppress(CancelledError, BrokenPipeError, ConnectionResetError, KeyboardInterrupt):
        try:
            learner, result = read_performance(tries.path(dance, name, "npz")), tries.result(dance, name)
            write_film(tries.film_path(dance, name), library.body, library.dance(dance), learner, result, tell)
        except InputError as error:
            connection.send((0.0, str(error)))
        except (BrokenPipeError, ConnectionResetError):
            raise
        except OSError as error:
            connection.send((0.0, f"the film could not be saved: {error.strerror}"))
        else:
            connection.send((1.0, ""))
