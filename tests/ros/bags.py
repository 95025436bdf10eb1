"""Bags for tests, written by rosbags: ROS 1, ROS 2 with SQLite, and MCAP."""

from pathlib import Path

import numpy as np
import pytest

KINDS = ("ros1", "sqlite3", "mcap")
START = 1_700_000_000 * 10**9
"""Time of the first messages in nanoseconds."""


class BagWriter:
    """Writes messages at times in seconds after `START`, to a bag of one of `KINDS`.

    `path` is the file or folder that is read. The stamp of a header is the time at which the message is recorded, or
    `stamp` in seconds.
    """

    def __init__(self, folder, kind="mcap", name="scan"):
        typesys = pytest.importorskip("rosbags.typesys", reason="bags need rosbags: pip install 'pcsr[ros]'")
        self.kind = kind
        stores = typesys.Stores
        self.store = typesys.get_typestore(stores.ROS1_NOETIC if kind == "ros1" else stores.ROS2_HUMBLE)
        tf = typesys.get_typestore(stores.ROS2_HUMBLE).fielddefs["tf2_msgs/msg/TFMessage"]
        if kind == "ros1":
            self.store.register({"tf2_msgs/msg/TFMessage": tf})
            from rosbags.rosbag1 import Writer

            self.path = Path(folder) / f"{name}.bag"
            self.writer = Writer(self.path)
        else:
            from rosbags.rosbag2 import StoragePlugin, Writer

            self.path = Path(folder) / name
            plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
            self.writer = Writer(self.path, version=9, storage_plugin=plugin)
        self.connections = {}
        self.types = self.store.types

    def __enter__(self):
        self.writer.open()
        return self

    def __exit__(self, *error):
        self.writer.close()

    @property
    def file(self):
        """The one file in the folder of ROS 2."""
        (found,) = (path for path in self.path.iterdir() if path.suffix in (".db3", ".mcap"))
        return found

    def add_topic(self, topic, kind):
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, kind, typestore=self.store)
        return self.connections[topic]

    def write(self, topic, kind, message, time):
        connection = self.add_topic(topic, kind)
        serialize = self.store.serialize_ros1 if self.kind == "ros1" else self.store.serialize_cdr
        self.writer.write(connection, START + round(time * 1e9), serialize(message, kind))

    def header(self, frame, time, stamp=None):
        seconds = START + round(time * 1e9) if stamp is None else round(stamp * 1e9)
        when = self.types["builtin_interfaces/msg/Time"](*divmod(seconds, 10**9))
        head = {"stamp": when, "frame_id": frame} | ({"seq": 0} if self.kind == "ros1" else {})
        return self.types["std_msgs/msg/Header"](**head)

    def cloud(self, topic, time, points, *, frame="camera", stamp=None, kind="f4", big=False, rows=1, pad=0, **more):
        """Points (n, 3) in metres, with further fields of n numbers each; `pad` bytes are behind each point and row."""
        names = ["x", "y", "z", *more]
        columns = [*np.asarray(points).reshape(-1, 3).T, *more.values()]
        kinds = [kind] * 3 + [column.dtype.str[1:] for column in more.values()]
        numbers = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
        kinds = [np.dtype((">" if big else "<") + one) for one in kinds]
        offsets = [pad, *(pad + np.cumsum([one.itemsize for one in kinds])).tolist()]
        step = offsets.pop() + pad
        whole = np.zeros(
            len(columns[0]), np.dtype({"names": names, "formats": kinds, "offsets": offsets, "itemsize": step})
        )
        for name, column in zip(names, columns, strict=True):
            whole[name] = column
        width = len(whole) // rows
        lines = np.zeros((rows, width * step + pad), np.uint8)
        lines[:, : width * step] = whole.view(np.uint8).reshape(rows, -1)
        fields = [
            self.types["sensor_msgs/msg/PointField"](name, offset, numbers[one.str[1:]], 1)
            for name, offset, one in zip(names, offsets, kinds, strict=True)
        ]
        message = self.types["sensor_msgs/msg/PointCloud2"](
            header=self.header(frame, time, stamp),
            height=rows,
            width=width,
            fields=fields,
            is_bigendian=big,
            point_step=step,
            row_step=width * step + pad,
            data=lines.reshape(-1),
            is_dense=False,
        )
        self.write(topic, "sensor_msgs/msg/PointCloud2", message, time)

    def image(self, topic, time, pixels, encoding, *, frame="camera", stamp=None, pad=0):
        pixels = np.ascontiguousarray(pixels)
        lines = pixels.view(np.uint8).reshape(len(pixels), -1)
        lines = np.pad(lines, ((0, 0), (0, pad)))
        message = self.types["sensor_msgs/msg/Image"](
            self.header(frame, time, stamp), *pixels.shape[:2], encoding, 0, lines.shape[1], lines.reshape(-1)
        )
        self.write(topic, "sensor_msgs/msg/Image", message, time)

    def compressed(self, topic, time, data, kind="png", *, frame="camera"):
        message = self.types["sensor_msgs/msg/CompressedImage"](
            self.header(frame, time), kind, np.frombuffer(data, np.uint8)
        )
        self.write(topic, "sensor_msgs/msg/CompressedImage", message, time)

    def camera_info(self, topic, time, fx, fy, cx, cy, size):
        matrix = np.array([fx, 0, cx, 0, fy, cy, 0, 0, 1.0])
        roi = self.types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
        rest = ("plumb_bob", np.zeros(5), matrix, np.eye(3).reshape(-1), np.zeros(12), 0, 0, roi)
        message = self.types["sensor_msgs/msg/CameraInfo"](self.header("camera", time), *size, *rest)
        self.write(topic, "sensor_msgs/msg/CameraInfo", message, time)

    def transform(
        self, child, parent, time, translation=(0, 0, 0), quaternion=(0, 0, 0, 1), *, stamp=None, static=False
    ):
        types = self.types
        one = types["geometry_msgs/msg/TransformStamped"](
            self.header(parent, time, stamp),
            child,
            types["geometry_msgs/msg/Transform"](
                types["geometry_msgs/msg/Vector3"](*map(float, translation)),
                types["geometry_msgs/msg/Quaternion"](*map(float, quaternion)),
            ),
        )
        message = types["tf2_msgs/msg/TFMessage"]([one])
        self.write("/tf_static" if static else "/tf", "tf2_msgs/msg/TFMessage", message, time)

    def pose(self, topic, time, translation, quaternion=(0, 0, 0, 1), *, frame="base", stamp=None):
        types = self.types
        pose = types["geometry_msgs/msg/Pose"](
            types["geometry_msgs/msg/Point"](*map(float, translation)),
            types["geometry_msgs/msg/Quaternion"](*map(float, quaternion)),
        )
        message = types["geometry_msgs/msg/PoseStamped"](self.header(frame, time, stamp), pose)
        self.write(topic, "geometry_msgs/msg/PoseStamped", message, time)
