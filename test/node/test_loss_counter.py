from __future__ import annotations

from rover_obstacle_detection.node.loss_counter import LossCounter


def losses(*numbers: int | None) -> list[int]:
    counter = LossCounter()
    return [counter.lost_before(number) for number in numbers]


def test_gaps_are_counted() -> None:
    assert losses(7, 8, 10, 14, 15) == [0, 0, 1, 3, 0]


def test_restarted_publisher_is_not_a_loss() -> None:
    assert losses(500, 1, 2, 4) == [0, 0, 0, 1]


def test_two_publishers_are_not_a_loss() -> None:
    assert losses(5000, 1, 5001, 2, 5002) == [0, 0, 0, 0, 0]


def test_messages_without_numbers_are_not_a_loss() -> None:
    assert losses(None, None, 3, None, 9) == [0, 0, 0, 0, 0]
