"""The interrupt key and SIGTERM end a command within 10 s, whatever it is doing.

Python runs a signal handler between two instructions of the main thread, and the exception that the handler
raises ends the command. Three things can prevent this; each is handled here:

* The signal comes just before a call that blocks (a lock, a pipe, a future), or another thread takes it: then
  the handler waits until the call returns. Therefore the main thread is woken repeatedly by a second
  signal that does nothing else.
* The exception is raised where Python drops it: in a destructor, or a callback of the garbage collector.
* Cleaning up takes time: a server does not answer, a call of a library cannot be interrupted.

In the last two cases the process ends itself some seconds after the signal. Files are then as safe as after a
kill: finished stages are kept, nothing is half published.

It imports hardly anything, so that it is in place before anything else is loaded.
"""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from types import FrameType
from typing import NoReturn

INTERRUPTED = 130
TERMINATED = 143
#: Exit codes of the contract, by the signal that asks for the end.
_EXIT_CODES = {int(signal.SIGINT): INTERRUPTED, int(signal.SIGTERM): TERMINATED}

#: What cleaning up may take, s, and how often the main thread is woken meanwhile.
_GRACE_S = 8.0
_WAKE_S = 0.1
#: Ignored by default and used by nobody here.
_WAKING = signal.SIGURG

_KEPT = b"completed stages are kept and will be reused.\n"
_ENDED = {int(signal.SIGINT): b"Interrupted; " + _KEPT, int(signal.SIGTERM): b"Terminated; " + _KEPT}
_AT_ONCE = b"Ended without cleaning up, which took too long; " + _KEPT


class TerminationError(BaseException):
    """The process was asked to end (SIGTERM). No subclass of Exception, so that no handler swallows it."""


def end_on_signals(command: Callable[[], object]) -> NoReturn:
    """Carry out a command, then end the process; SIGTERM and the interrupt key end it early.

    A signal determines the exit code even if the command has ended by itself meanwhile.
    """
    asked: list[int] = []

    def note_and_raise(number: int, _frame: FrameType | None) -> NoReturn:
        asked.append(number)
        raise KeyboardInterrupt if number == signal.SIGINT else TerminationError

    code: str | int | None = 0
    try:
        _on_each_signal(note_and_raise)
        _start_watch()
        command()
    except SystemExit as end:
        code = end.code
    except BaseException:
        # Libraries make other exceptions of ours (pydantic, in the middle of a serialization).
        if not asked:
            raise
    for stream in (sys.stdout, sys.stderr):
        # Closed by whoever started the command, or by whoever read it.
        with contextlib.suppress(AttributeError, OSError, ValueError):
            stream.flush()
    # What is left is worth no waiting (libraries empty their queues): from here on a signal ends the process
    # by itself, and a shell shows the same exit codes.
    _on_each_signal(signal.SIG_DFL)
    if asked:
        _say(_ENDED[asked[0]])
    # The system takes back all memory at once; to look through it for what nobody holds takes half a second.
    gc.freeze()
    sys.exit(_EXIT_CODES[asked[0]] if asked else code)


def _say(sentence: bytes) -> None:
    with contextlib.suppress(OSError):
        os.write(2, sentence)


def _on_each_signal(handler: Callable[[int, FrameType | None], object] | signal.Handlers) -> None:
    for number in _EXIT_CODES:
        # A shell has commands in the background ignore the interrupt key.
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, handler)


def _start_watch() -> None:
    """Start the thread that ends the process after a signal."""
    signal.signal(_WAKING, lambda _number, _frame: None)
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    # Written by the interpreter's own handler at once, whatever the main thread is doing.
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    threading.Thread(target=_watch, args=(reading,), name="signals", daemon=True).start()


def _watch(reading: int) -> NoReturn:
    """Wait for a signal to end; interrupt the main thread until it ends, or end the process."""
    while (number := os.read(reading, 1)[0]) not in _EXIT_CODES:
        pass
    main_thread = threading.main_thread().ident
    assert main_thread is not None
    until = time.monotonic() + _GRACE_S
    while time.monotonic() < until:
        time.sleep(_WAKE_S)
        signal.pthread_kill(main_thread, _WAKING)
    _say(_AT_ONCE)
    os._exit(_EXIT_CODES[number])
