from __future__ import annotations

import threading

from rover_obstacle_detection.node.mailbox import Mailbox


class Drops:
    def __init__(self) -> None:
        self.count = 0

    def __call__(self) -> None:
        self.count += 1


def test_newest_item_is_kept_and_the_others_are_counted() -> None:
    drops = Drops()
    box: Mailbox[int] = Mailbox(drops)

    for item in range(5):
        box.put(item)

    assert box.take() == 4
    assert drops.count == 4


def test_take_waits_for_an_item() -> None:
    box: Mailbox[str] = Mailbox(Drops())
    taken: list[str | None] = []
    taker = threading.Thread(target=lambda: taken.append(box.take()))
    taker.start()

    box.put('pair')
    taker.join(10)

    assert taken == ['pair']


def test_close_ends_a_waiting_take() -> None:
    drops = Drops()
    box: Mailbox[int] = Mailbox(drops)
    taken: list[int | None] = [0]
    taker = threading.Thread(target=lambda: taken.append(box.take()))
    taker.start()

    box.close()
    taker.join(10)

    assert taken == [0, None]
    assert drops.count == 0


def test_items_left_at_close_are_counted() -> None:
    drops = Drops()
    box: Mailbox[int] = Mailbox(drops)

    box.put(1)
    box.close()
    box.put(2)

    assert box.take() is None
    assert drops.count == 2
