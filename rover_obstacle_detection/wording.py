"""Counts and names in messages."""

from __future__ import annotations

import os


def counted(number: int, noun: str, plural: str = '') -> str:
    """Return a number and its noun, in the plural unless the number is 1.

    Parameters
    ----------
    number : int
    noun : str
        In the singular; may have adjectives before it.
    plural : str, optional
        The noun with an s by default.
    """
    return f'{number} {noun if number == 1 else plural or noun + "s"}'


def printable(name: object) -> str:
    r"""Return a path or a name as text that every terminal and file takes.

    File names on Linux are bytes; those that are no text are shown as ``\xff``.
    """
    return os.fsencode(str(name)).decode(errors='backslashreplace')
