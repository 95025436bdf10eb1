"""Bags of ROS 1 and ROS 2: their topics, and their messages in the order of time."""

import heapq
from collections.abc import Collection, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

from pcsr.errors import UserError
from pcsr.extras import imported
from pcsr.inputs import check_file
from pcsr.ros.paths import METADATA, SUFFIXES, files_of
from pcsr.ros.topics import Topic, listed, short

USER = "a ROS bag"
"""Feature that needs rosbags, for the message if it is not installed."""
MAGIC = {".bag": b"#ROSBAG V", ".mcap": b"\x89MCAP0\r\n", ".db3": b"SQLite format 3\0"}
"""First bytes of a bag, by its suffix."""
REPAIR = {".bag": "rosbag reindex", ".mcap": "mcap recover", ".db3": "ros2 bag reindex"}
"""Program that repairs a bag whose recording was cut off, by its suffix."""
TF = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
"""Type of the messages of /tf, and its old name in ROS 1."""
WINDOW = 10**9
"""First length of the time, back from the end of a bag, in which the last message is sought; nanoseconds."""


class Message(NamedTuple):
    """Message of a bag."""

    topic: str
    received: int
    """Time at which it was recorded, in nanoseconds."""
    stamp: int
    """Time of its header in nanoseconds; `received` where that is 0 or there is no header."""
    content: Any
    """Fields of the message, as attributes."""


class _Source(NamedTuple):
    """One file, or folder of ROS 2, of a bag."""

    path: Path
    reader: Any
    store: Any
    is_ros_1: bool


class Bag(AbstractContextManager["Bag"]):
    """One or several bags that are read as one; a context manager.

    Messages are decoded by the definitions of ROS itself. Those in a bag are not used, since code would have to be made
    of them, and the types that are read here are the same in all versions.

    Args:
        paths: files `.bag`, `.mcap` or `.db3`, or folders of ROS 2.

    Raises:
        UserError: rosbags is not installed, or a bag cannot be read.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self.name = ", ".join(map(str, paths))
        """The paths, for messages."""
        self._stack = ExitStack()
        with ExitStack() as stack:
            parts = [part for path in paths for part in _parts(path)]
            self._sources = [_opened(part, stack) for part in parts]
            self._stack = stack.pop_all()

    def __enter__(self) -> "Bag":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()

    @property
    def topics(self) -> dict[str, Topic]:
        """The topics by name."""
        found: dict[str, Topic] = {}
        for source in self._sources:
            for one in source.reader.connections:
                before = found.get(one.topic, Topic(one.topic, one.msgtype, 0))
                found[one.topic] = Topic(one.topic, before.type, before.count + one.msgcount)
        return dict(sorted(found.items()))

    @property
    def start(self) -> int:
        """Time of the first message in nanoseconds; 0 if there is none."""
        return min((one.reader.start_time for one in self._sources if one.reader.message_count), default=0)

    @property
    def end(self) -> int:
        """Time of the last message in nanoseconds; 0 if there is none."""
        return max((one.reader.end_time - 1 for one in self._sources if one.reader.message_count), default=0)

    def topic(self, name: str, types: Collection[str]) -> Topic:
        """Return a topic that must have messages of one of some types.

        Args:
            name: name of the topic; its first slash may be missing.
            types: names of types, such as "sensor_msgs/msg/Image".

        Raises:
            UserError: there is no such topic, it has messages of another type, or none.
        """
        topics = self.topics
        found = topics.get(name) or topics.get(f"/{name}")
        if found is None:
            raise UserError(f"{self.name} has no topic {name}: it has {listed(topics.values())}")
        if found.type not in types:
            fitting = [one for one in topics.values() if one.type in types]
            raise UserError(
                f"{self.name}: the topic {found.name} has messages {short(found.type)}, not "
                f"{' or '.join(map(short, types))}: {f'name {listed(fitting)}' if fitting else 'no topic has these'}"
            )
        if found.count == 0:
            raise UserError(f"{self.name}: the topic {found.name} is empty: it has no messages")
        return found

    def messages(self, topics: Collection[str], start: int | None = None, stop: int | None = None) -> Iterator[Message]:
        """Yield the messages of topics in the order in which they were recorded.

        Args:
            topics: names of the topics.
            start: time of recording from which on messages are read, in nanoseconds.
            stop: time before which they are.

        Raises:
            UserError: the bag is damaged, or a message is not of its topic's type.
        """
        streams = [_messages(source, topics, start, stop) for source in self._sources]
        yield from heapq.merge(*streams, key=lambda message: message.received)

    def last(self, topic: str) -> Message:
        """Return the last message of a topic that has messages.

        Raises:
            UserError: as `messages`.
        """
        window, found = WINDOW, None
        while found is None and window < 2**62:
            for message in self.messages([topic], self.end - window):
                found = message
            window *= 8
        return self._there(found, topic)

    def first(self, topic: str, moment: tuple[int, int] | None = None) -> Message:
        """Return the first message of a topic that has messages, or the first of a moment.

        Args:
            topic: name of the topic.
            moment: times of a message, `received` and `stamp`.

        Raises:
            UserError: as `messages`.
        """
        if moment is None:
            return self._there(next(self.messages([topic]), None), topic)
        found = self.messages([topic], moment[0], moment[0] + 1)
        return self._there(next((one for one in found if one.stamp == moment[1]), None), topic)

    def _there(self, found: Message | None, topic: str) -> Message:
        if found is None:
            raise UserError(f"{self.name}: the topic {topic} lacks messages that the bag lists: it is damaged")
        return found


def nanoseconds(stamp: Any) -> int:
    """Return a time of a message in nanoseconds."""
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _parts(path: Path) -> list[Path]:
    """Return the files and folders that rosbags reads of a bag.

    Raises:
        UserError: it does not exist, or is no bag.
    """
    if path.is_dir():
        if not (found := files_of(path)):
            raise UserError(f"{path} is a folder without {METADATA}, .mcap and .db3 files: it is no bag of ROS 2")
        return found
    check_file(path)
    suffix = path.suffix.lower()
    if suffix in (".mcap", ".db3") and suffix != path.suffix:
        raise UserError(f"{path}: rosbags knows bags by suffixes of small letters: rename it to {path.stem}{suffix}")
    if suffix not in SUFFIXES:
        raise UserError(f"{path} is no bag by its suffix: bags are {', '.join(SUFFIXES)} files, or folders of ROS 2")
    with path.open("rb") as file:
        if file.read(len(MAGIC[suffix])) != MAGIC[suffix]:
            raise UserError(f"{path} is no {suffix} file by its content: its first bytes are others; get it again")
    return [path]


def _opened(path: Path, stack: ExitStack) -> _Source:
    is_ros_1 = path.suffix.lower() == ".bag"
    module = imported("rosbags.rosbag1" if is_ros_1 else "rosbags.rosbag2", USER)
    with _as_user_errors(path):
        reader = module.Reader(path)
        stack.enter_context(reader)
    return _Source(path, reader, _definitions(is_ros_1), is_ros_1)


def _definitions(is_ros_1: bool) -> Any:
    """Return rosbags' definitions of ROS 1 or ROS 2, with those of transforms."""
    types = imported("rosbags.typesys", USER)
    ros_2 = types.get_typestore(types.Stores.ROS2_HUMBLE)
    if not is_ros_1:
        return ros_2
    ros_1 = types.get_typestore(types.Stores.ROS1_NOETIC)
    ros_1.register(dict.fromkeys(TF, ros_2.fielddefs[TF[0]]))
    return ros_1


def _messages(source: _Source, topics: Collection[str], start: int | None, stop: int | None) -> Iterator[Message]:
    connections = [one for one in source.reader.connections if one.topic in topics]
    if not connections:
        return
    decode = source.store.deserialize_ros1 if source.is_ros_1 else source.store.deserialize_cdr
    with _as_user_errors(source.path):
        for connection, received, data in source.reader.messages(connections, start=start, stop=stop):
            if connection.msgtype not in source.store.fielddefs:
                raise UserError(f"{source.path}: {connection.topic}: messages {connection.msgtype} are not known")
            content = decode(data, connection.msgtype)
            header = getattr(content, "header", None)
            stamp = 0 if header is None else nanoseconds(header.stamp)
            if not 0 <= received < 2**63:
                raise ValueError(f"a message of time {received}")
            yield Message(connection.topic, received, stamp or received, content)


@contextmanager
def _as_user_errors(path: Path) -> Iterator[None]:
    """Turn what rosbags raises into messages of our own; damaged bags make it raise errors of any type."""
    try:
        yield
    except (UserError, GeneratorExit):
        raise
    except MemoryError as error:
        raise UserError(f"{path} cannot be read: it needs more memory than is free, or is damaged") from error
    except Exception as error:
        if "Profile is not ros2" in str(error):
            raise UserError(f"{path} is an MCAP of another profile than ros2: only bags of ROS 2 are read") from error
        program = REPAIR.get(path.suffix.lower(), "ros2 bag reindex")
        raise UserError(
            f"{path} is cut off or damaged, or is no bag: get it again, or repair it with `{program}`"
        ) from error
