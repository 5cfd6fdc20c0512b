"""What the client and the workers of one run on a Dask cluster tell each other."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import distributed


@dataclass(frozen=True)
class Begun:
    """A worker begins the bag of an index; `versions` are those of `offline.summary`."""

    index: int
    address: str
    host: str
    versions: dict[str, str]


@dataclass(frozen=True)
class Progress:
    """Steps done and expected of the bag of an index."""

    index: int
    done: int
    expected: int


@dataclass(frozen=True)
class Warned:
    """A warning that a worker has logged."""

    text: str


Message = Begun | Progress | Warned

_KINDS: dict[str, type[Message]] = {each.__name__: each for each in (Begun, Progress, Warned)}


class Channel:
    """Messages to the client and flags for the workers, both kept by the scheduler.

    Every call has taken effect on the scheduler when it returns. So once the client has set
    `stop`, each worker that has not seen it has sent its `Begun` before.

    Parameters
    ----------
    run : str
        A name that no other run has.
    client : distributed.Client
        The client of this process, in a worker as well.
    """

    def __init__(self, run: str, client: Any) -> None:
        self._run = run
        self._client = client
        self._messages = distributed.Queue(run, client)
        self.stop = self._flag('stop')
        """Set: workers end after the current step and keep what is done."""
        self.abort = self._flag('abort')
        """Set: workers end after the current step and keep nothing."""

    def send(self, message: Message) -> None:
        """Send a message to the client."""
        self._messages.put({'kind': type(message).__name__, **asdict(message)})

    def begin(self, begun: Begun) -> bool:
        """Say that a bag is begun; return whether another worker had begun it before."""
        flag = self._flag(f'begun-{begun.index}')
        is_again = bool(flag.is_set())
        flag.set()
        self.send(begun)
        return is_again

    def received(self) -> list[Message]:
        """Return the messages since the last call."""
        messages = self._messages.get(batch=True)
        return [_KINDS[kind](**rest) for kind, rest in map(_split, messages)]

    def close(self) -> None:
        """Leave the channel; the scheduler forgets its messages when all have left it."""
        self._messages.close()

    def forget(self, begun: Iterable[int]) -> None:
        """Remove the flags of the run and of the bags that have begun."""
        for flag in (self.stop, self.abort, *(self._flag(f'begun-{index}') for index in begun)):
            flag.clear()

    def _flag(self, name: str) -> Any:
        return distributed.Event(f'{self._run}-{name}', self._client)


def _split(message: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    return message['kind'], {name: value for name, value in message.items() if name != 'kind'}
