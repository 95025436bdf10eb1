"""Messages of a tactile topic: by time, and those that are contacts."""

import warnings
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from pcsr.errors import PcsrWarning, UserError
from pcsr.recorded.bags.contacts import contacts, threshold
from pcsr.recorded.bags.poses import Advance
from pcsr.recorded.bags.pressed import TactileTopic
from pcsr.ros.bag import Bag
from pcsr.ros.topics import Topic

NEAR = 0.5
"""Longest time from a named time to a message, in seconds."""


MOST_UNREAD = 20
"""If so many messages at the beginning cannot be read, none is expected to be readable."""


class Moment(NamedTuple):
    """Times of a message in nanoseconds."""

    received: int
    """When it was recorded."""
    stamp: int
    """Of its header."""


class TopicMessages:
    """Messages of one topic.

    Args:
        bag: bag of the topic.
        topic: topic that has messages.
        advance: called while all messages are read.
    """

    def __init__(self, bag: Bag, topic: Topic, advance: Advance) -> None:
        self.bag, self.topic, self.advance = bag, topic, advance

    @cached_property
    def moments(self) -> list[Moment]:
        """Times of all messages, in the order in which they were recorded."""
        found = []
        for number, message in enumerate(self.bag.messages([self.topic.name]), 1):
            found.append(Moment(message.received, message.stamp))
            self.advance(f"reading times of {self.topic.name}", number, self.topic.count)
        return found

    def name(self, index: int) -> str:
        """Return the time of a message since the start of the bag, as the name of a touch."""
        return f"{self._seconds(self.moments[index]):.3f} s"

    def content(self, index: int) -> Any:
        """Return the content of a message."""
        return self.bag.first(self.topic.name, self.moments[index]).content

    def at(self, time: float, option: str) -> Any:
        """Return the content of the message that is nearest to a time; see `nearest`."""
        return self.content(self.nearest(time, option))

    def nearest(self, time: float, option: str) -> int:
        """Return the index of the message that is nearest to a time.

        Args:
            time: seconds since the start of the bag, up to its length; a larger number is the stamp of a header.
            option: option with the time, for messages.

        Raises:
            UserError: the time is not within the bag, or there is no message near it.
        """
        since_start = 0 <= time <= (self.bag.end - self.bag.start) / 1e9
        sought = time * 1e9 + (self.bag.start if since_start else 0)
        times = [one.received if since_start else one.stamp for one in self.moments]
        index = min(range(len(times)), key=lambda i: abs(times[i] - sought))
        if not abs(times[index] - sought) / 1e9 <= NEAR:  # nor may it be nan
            first, last = self.moments[0], self.moments[-1]
            raise UserError(
                f"{option} {time:.10g}: {self.topic.name} has no message within {NEAR:g} s: it has some from "
                f"{self._seconds(first):.3f} to {self._seconds(last):.3f} s after the start of the bag, with stamps "
                f"from {first.stamp / 1e9:.3f} to {last.stamp / 1e9:.3f}"
            )
        return index

    def contacts(self, reader: TactileTopic) -> list[int]:
        """Return the indices of the deepest message of each contact.

        Raises:
            UserError: there is no contact, or no message can be read.

        Warns:
            PcsrWarning: some messages cannot be read. They count as untouched.
        """
        found, depths = [], []
        unread: list[str] = []
        for number, message in enumerate(self.bag.messages([self.topic.name]), 1):
            moment = Moment(message.received, message.stamp)
            try:
                depths.append(reader.indentation(message.content))
            except UserError as error:
                depths.append(0.0)
                unread.append(f"{self.topic.name} at {self._seconds(moment):.3f} s: {error}")
                if len(unread) == number >= min(MOST_UNREAD, self.topic.count):
                    raise UserError(unread[0]) from error
            found.append(moment)
            self.advance(f"finding contacts in {self.topic.name}", number, self.topic.count)
        self.moments = found
        if unread:
            count = f"{len(unread)} of {len(found)} messages"
            warnings.warn(f"{count} cannot be read and count as untouched: {unread[0]}", PcsrWarning, stacklevel=3)
        indentation = np.array(depths, np.float64)
        times = np.array([moment.received for moment in found], np.int64)
        chosen = contacts(indentation, times)
        if not chosen:
            raise UserError(
                f"{self.topic.name}: no contact in its {len(found)} messages: the gel is indented by {max(depths):.3g} "
                f"mm at most, and contacts by more than {threshold(indentation, times):.3g} mm: check --axes and "
                f"--face, or name times with --at"
            )
        return chosen

    def _seconds(self, moment: Moment) -> float:
        return (moment.received - self.bag.start) / 1e9
