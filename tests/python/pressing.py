"""Ctrl-C, as a person at a terminal presses it."""

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def heard() -> Iterator[None]:
    """Ctrl-C is heard; where the tests run in the background the signal may come ignored, as no terminal's would."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def pressed_after(delay: float) -> Iterator[list[float]]:
    """Ctrl-C, some time after; the list holds when."""
    when: list[float] = []

    def press() -> None:
        when.append(time.monotonic())
        signal.raise_signal(signal.SIGINT)

    timer = threading.Timer(delay, press)
    with heard():
        timer.start()
        try:
            yield when
        finally:
            timer.cancel()
            timer.join()
