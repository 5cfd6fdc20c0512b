"""Counts in messages, such as 1 pair and 2 pairs."""

from __future__ import annotations


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
