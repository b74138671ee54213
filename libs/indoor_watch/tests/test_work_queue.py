"""What waits for the observer: a flood of one kind costs the others nothing."""

from __future__ import annotations

from indoor_watch.work_queue import WorkQueue


class Worker:
    """Takes work, as the thread would."""

    def __init__(self, most: dict[str, int]) -> None:
        self.dropped: list[str] = []
        self.done: list[str] = []
        self.backlog = WorkQueue(most, self.dropped.append)

    def put(self, name: str, kind: str = '', worth: int = 0) -> None:
        self.backlog.put(lambda: self.done.append(name), kind, worth)

    def finish(self) -> list[str]:
        self.backlog.end()
        while (work := self.backlog.take()) is not None:
            work()
        return self.done


def test_a_flood_of_sweeps_leaves_the_pictures_and_what_else_is_to_be_done():
    worker = Worker({'sweeps': 3, 'pictures': 2})
    worker.put('arrive')
    worker.put('picture', 'pictures')
    for number in range(100):
        worker.put(f'sweep {number}', 'sweeps')
    worker.put('answer')
    expected = ['arrive', 'picture', 'sweep 97', 'sweep 98', 'sweep 99', 'answer']
    assert worker.finish() == expected
    assert worker.dropped == ['sweeps'] * 97


def test_a_picture_of_a_camera_that_stood_outlives_those_taken_in_passing():
    worker = Worker({'pictures': 2})
    worker.put('stood', 'pictures', worth=1)
    for number in range(3):
        worker.put(f'passing {number}', 'pictures')
    worker.put('stood again', 'pictures', worth=1)
    assert worker.finish() == ['stood', 'stood again']


def test_what_is_done_again_and_again_waits_once_and_keeps_its_turn():
    worker = Worker({})
    for number in range(3):
        worker.backlog.put_once(lambda: worker.done.append('assess'), 'assess')
        worker.put(f'{number}')
    assert worker.finish() == ['assess', '0', '1', '2']
    assert not worker.dropped
