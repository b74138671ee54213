"""What a source's stamps say by this node's clock, also where the two clocks disagree.

A camera may stamp by a clock of its own: one that runs a minute late, that starts at 0, that
somebody has set, or none at all. Its stamps still tell which message came after which. So each
stamp is compared with those of the same source; the offset between its clock and the node's is
the smallest time that a recent message seems to have taken (the minimum filter of the clock
synchronisation in NTP, RFC 5905, section 10: delays only ever add). Where that is small, it is
taken for a delay, and the stamp for right. No delay has a message come before it was stamped.
"""

from __future__ import annotations

from collections import Counter, deque

# seconds within which a stamp is believed as it is: a slow driver, or fast simulated time
_LARGE = 2.0
# seconds that a stamp may be ahead of a clock that is in step with the source's
_AHEAD = 0.1
# seconds of the node's clock, and messages, from which the offset is estimated
_WINDOW, _MOST_SAMPLES = 5.0, 50
# of the last so many messages, how many must be odd before it is said
_RECENT, _ENOUGH = 10, 3
# seconds that a message may be late, which a clock that is behind looks like
_LATEST = 30.0
# seconds that only a clock of another kind is off by
_OTHER_CLOCK = 1e6


class StampOffset:
    """Follows the stamps of one source.

    Args:
        source: What the source is called in a finding, such as its topic.
        simulated: Whether the node's clock is the one of a simulation, which all share: then what
            is behind by seconds is late, since a second may pass in a tenth of one; and what is
            ahead shows that the node's own clock is.
    """

    def __init__(self, source: str, simulated: bool = False) -> None:
        self._source = source
        self._late = _LATEST if simulated else _LARGE
        # each node hears simulated time by itself, and may hear it late
        self._ahead = _LATEST if simulated else _AHEAD
        # what each recent message seems to have taken, and when it came
        self._delays: deque[tuple[float, float]] = deque(maxlen=_MOST_SAMPLES)
        self._last: float | None = None
        self._odd: deque[str] = deque(maxlen=_RECENT)
        self._offset = 0.0
        self._said = False

    @property
    def offset(self) -> float:
        """What the source's clock is behind the node's, seconds; 0 while they agree."""
        return self._offset

    def time_of(self, stamp: float, now: float) -> float:
        """Return when a message was stamped, by the node's clock.

        Args:
            stamp: The message's stamp, seconds of the source's clock.
            now: When it arrived, seconds of the node's clock.

        Returns:
            Seconds of the node's clock: the stamp itself while the clocks agree, else the stamp
            with the offset added, at most `now`; `now` where the stamps stand still.
        """
        delay, last = now - stamp, self._last
        self._last = stamp
        if last is not None and stamp == last:
            # the same image again, as long as its stamp is not far off; then the clock stands still
            again = not self._offset and -self._ahead <= delay <= self._late
            self._odd.append('' if again else 'still')
            return stamp if again else now
        jumped = last is not None and stamp < last - _LARGE
        while self._delays and not 0.0 <= now - self._delays[0][1] <= _WINDOW:
            self._delays.popleft()
        # delays only add: what seems to be much faster than all before has another clock
        jumped |= bool(self._delays) and delay < self._least() - self._late
        if jumped:
            self._delays.clear()
        self._delays.append((delay, now))
        least = self._least()
        self._offset = 0.0 if -self._ahead <= least <= self._late else least
        self._odd.append('jump' if jumped else 'offset' if self._offset else '')
        return stamp + self._offset

    def span_of(self, stamp: float, now: float) -> tuple[float, float]:
        """Return between which times a message was stamped, by the node's clock.

        Where all messages are late, as on a busy machine in fast simulated time, that looks as if
        the source's clock were behind. Who pairs a message with something that changes has to
        reckon with both. Call this or `time_of` for a message, not both.

        Args:
            stamp: The message's stamp, seconds of the source's clock.
            now: When it arrived, seconds of the node's clock.

        Returns:
            Twice the stamp while the clocks agree.
        """
        taken = self.time_of(stamp, now)
        if taken == stamp:
            return stamp, stamp
        earliest = taken - _LARGE
        return (min(earliest, stamp) if now - stamp <= _LATEST else earliest), taken

    def finding(self) -> str | None:
        """Return what is wrong with the stamps in one line; None while nothing is."""
        counts = Counter(each for each in self._odd if each)
        if counts.total() < _ENOUGH:
            return None
        kind = counts.most_common(1)[0][0]
        hint = ''
        if kind == 'jump':
            what = "jump against this node's clock"
        else:
            ahead = self._offset < 0.0
            what = f'are {_spoken(abs(self._offset))} {"ahead of" if ahead else "behind"} this '
            what += "node's clock"
            if kind == 'still':
                what = f'do not advance ({what})' if self._offset else 'do not advance'
            if abs(self._offset) > _OTHER_CLOCK:
                hint = ' (is use_sim_time set on one side only, or does the driver not stamp?)'
        return f'stamps of {self._source} {what}: judged by when they arrive{hint}'

    def warning(self) -> str | None:
        """Return the finding when there is one for the first time; None afterwards."""
        found = None if self._said else self.finding()
        self._said |= found is not None
        return found

    def _least(self) -> float:
        return min(delay for delay, _ in self._delays)


def _spoken(seconds: float) -> str:
    return f'{seconds:.1f} s' if seconds < _OTHER_CLOCK else f'{seconds:.3g} s'
